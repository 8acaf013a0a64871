//! A new table in chunks, as a telecommand brings it: in order, into a buffer of the caller, checked in full at the end.
//!
//! Nothing of it can be used before [`Upload::finish`] gives a [`Table`]; the table in use is not touched.

use crate::error::ImageError;
use crate::table::Table;
use core::fmt;

/// A table on its way in.
#[derive(Debug)]
pub struct Upload<'b> {
    buffer: &'b mut [u8],
    received: usize,
}

/// Why an upload is refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UploadError {
    /// The buffer is smaller than the image announced.
    Buffer {
        /// Bytes announced.
        announced: usize,
        /// Bytes of the buffer.
        found: usize,
    },
    /// A chunk that does not follow the last one: lost, repeated or in the wrong order.
    Order {
        /// Offset of the next byte.
        expected: usize,
        /// Offset of the chunk.
        found: usize,
    },
    /// More bytes than announced.
    TooLong {
        /// Bytes announced.
        announced: usize,
        /// Bytes with this chunk.
        found: usize,
    },
    /// Finished before all bytes came.
    Incomplete {
        /// Bytes announced.
        announced: usize,
        /// Bytes received.
        found: usize,
    },
    /// All bytes came and make no table.
    Image(ImageError),
}

impl fmt::Display for UploadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Buffer { announced, found } => write!(f, "{announced} bytes announced, the buffer has {found}"),
            Self::Order { expected, found } => write!(f, "chunk at offset {found}, {expected} is next"),
            Self::TooLong { announced, found } => write!(f, "{found} bytes, {announced} were announced"),
            Self::Incomplete { announced, found } => write!(f, "{found} bytes of {announced} received"),
            Self::Image(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for UploadError {}

impl<'b> Upload<'b> {
    /// Begins an upload of `announced` bytes.
    ///
    /// # Errors
    /// [`UploadError::Buffer`] if they do not fit.
    pub fn begin(buffer: &'b mut [u8], announced: usize) -> Result<Self, UploadError> {
        let found = buffer.len();
        let buffer = buffer.get_mut(..announced).ok_or(UploadError::Buffer { announced, found })?;
        Ok(Self { buffer, received: 0 })
    }

    /// Takes the bytes from `offset` on.
    ///
    /// # Errors
    /// [`UploadError::Order`] or [`UploadError::TooLong`]; the chunk is left out, and the one expected can still come.
    pub fn chunk(&mut self, offset: usize, bytes: &[u8]) -> Result<(), UploadError> {
        if offset != self.received {
            return Err(UploadError::Order { expected: self.received, found: offset });
        }
        let announced = self.buffer.len();
        let end = offset.saturating_add(bytes.len());
        let place = self.buffer.get_mut(offset..end).ok_or(UploadError::TooLong { announced, found: end })?;
        place.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        self.received = end;
        Ok(())
    }

    /// Bytes received so far: the offset of the next chunk.
    #[must_use]
    pub const fn received(&self) -> usize {
        self.received
    }

    /// The table, if all bytes came and pass every check.
    ///
    /// # Errors
    /// [`UploadError::Incomplete`] or [`UploadError::Image`].
    pub fn finish(self) -> Result<Table<'b>, UploadError> {
        let announced = self.buffer.len();
        if self.received != announced {
            return Err(UploadError::Incomplete { announced, found: self.received });
        }
        Table::check(self.buffer).map_err(UploadError::Image)
    }
}
