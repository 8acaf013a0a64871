//! A new table in chunks, as a telecommand brings it: in order, into a buffer of the caller, checked in full at the
//! end.
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

    /// Goes on with an upload of which so much has come: for C, where no pointer is kept between calls.
    #[doc(hidden)]
    pub fn resume(buffer: &'b mut [u8], announced: usize, received: usize) -> Result<Self, UploadError> {
        Self::begin(buffer, announced).map(|begun| Self { received, ..begun })
    }

    /// [`Self::finish`] of an upload of which so much has come.
    #[doc(hidden)]
    pub fn check(buffer: &'b [u8], announced: usize, received: usize) -> Result<Table<'b>, UploadError> {
        let found = buffer.len();
        let image = buffer.get(..announced).ok_or(UploadError::Buffer { announced, found })?;
        if received != announced {
            return Err(UploadError::Incomplete { announced, found: received });
        }
        Table::check(image).map_err(UploadError::Image)
    }

    /// The table, if all bytes came and pass every check.
    ///
    /// # Errors
    /// [`UploadError::Incomplete`] or [`UploadError::Image`].
    pub fn finish(self) -> Result<Table<'b>, UploadError> {
        let announced = self.buffer.len();
        Self::check(self.buffer, announced, self.received)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{fixture, table};
    use std::vec;
    use std::vec::Vec;

    fn send(image: &[u8], chunks: &[(usize, &[u8])]) -> Result<(), UploadError> {
        let mut buffer = vec![0xff; image.len()];
        let mut upload = Upload::begin(&mut buffer, image.len())?;
        for (offset, bytes) in chunks {
            upload.chunk(*offset, bytes)?;
        }
        upload.finish().map(|table| assert_eq!(table.image(), image))
    }

    fn chunks(image: &[u8], size: usize) -> Vec<(usize, &[u8])> {
        image.chunks(size).enumerate().map(|(i, bytes)| (i * size, bytes)).collect()
    }

    #[test]
    fn a_whole_table_in_order_is_accepted_in_chunks_of_any_size() {
        let image = fixture::image(false);
        for size in [1, 7, 64, 256, 100_000] {
            assert_eq!(send(&image, &chunks(&image, size)), Ok(()));
        }
    }

    #[test]
    fn what_is_lost_repeated_or_exchanged_is_refused_and_can_be_sent_again() {
        let image = fixture::image(false);
        let good = chunks(&image, 256);
        let with = |change: fn(&mut Vec<(usize, &[u8])>)| {
            let mut chunks = good.clone();
            change(&mut chunks);
            send(&image, &chunks)
        };
        assert_eq!(with(|c| _ = c.remove(3)), Err(UploadError::Order { expected: 768, found: 1024 }));
        assert_eq!(with(|c| c.swap(2, 3)), Err(UploadError::Order { expected: 512, found: 768 }));
        assert_eq!(with(|c| c.insert(3, c[2])), Err(UploadError::Order { expected: 768, found: 512 }));
        let whole = image.len();
        let found = with(|c| _ = c.pop());
        assert_eq!(found, Err(UploadError::Incomplete { announced: whole, found: whole / 256 * 256 }));
        let found = with(|c| c.push((c.last().unwrap().0 + c.last().unwrap().1.len(), &[0])));
        assert_eq!(found, Err(UploadError::TooLong { announced: whole, found: whole + 1 }));
        let small = Upload::begin(&mut [0; 10], 11).map(|_| ());
        assert_eq!(small, Err(UploadError::Buffer { announced: 11, found: 10 }));
        // After a refusal the chunk expected still counts.
        let mut buffer = vec![0; whole];
        let mut upload = Upload::begin(&mut buffer, whole).unwrap();
        for (offset, bytes) in &good {
            assert!(upload.chunk(offset + 1, bytes).is_err());
            upload.chunk(*offset, bytes).unwrap();
        }
        assert!(upload.finish().is_ok());
    }

    /// Damage of every kind, with the checksums left as they were and with checksums made right: either the table is
    /// refused, or it is one that keeps every bound that a table must keep.
    fn campaign(images: usize, seed: u64) -> [usize; 2] {
        let whole = fixture::image(true);
        let mut random = seed;
        let mut next = |limit: usize| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 33) as usize % limit
        };
        let (mut refused, mut harmless) = (0, 0);
        for number in 0..images {
            let mut image = whole.clone();
            let sealed = number % 2 == 0;
            for _ in 0..=next(3) {
                let at = next(image.len());
                match next(8) {
                    0 => image.truncate(at.max(1)),
                    1 => image[at] ^= 1 << next(8),
                    2 => {
                        let other = (at + 256) % image.len();
                        image.swap(at, other);
                    }
                    3 => image[at..].iter_mut().take(4).zip(f32::NAN.to_le_bytes()).for_each(|(to, from)| *to = from),
                    4 => {
                        let place = at / 4 * 4;
                        let value = (next(2000) as f32 - 1000.0) * 10f32.powi(next(12) as i32 - 4);
                        image[place..].iter_mut().take(4).zip(value.to_le_bytes()).for_each(|(to, from)| *to = from);
                    }
                    5 => image.as_chunks_mut::<4>().0.iter_mut().for_each(|word| word.reverse()),
                    6 => image.iter_mut().skip(104).take(12).for_each(|byte| *byte = byte.wrapping_add(next(3) as u8)),
                    _ => image.push(next(256) as u8),
                }
            }
            if sealed {
                table::reseal(&mut image);
            }
            match Table::check(&image) {
                Err(_) => refused += 1,
                Ok(table) => {
                    harmless += usize::from(image != whole);
                    let bounds = table.bounds;
                    assert!(bounds.slope < 1.0 && bounds.error_rad <= table.error_limit_rad());
                    assert!(table.inverse_error_bound_rad() <= crate::Table::MAX_INVERSE_ERROR_RAD);
                    for _ in 0..10 {
                        let generator = crate::GeneratorAngle::from_counts((next(usize::MAX / 2) as i64) << 20);
                        let torque = next(200) as f32 - 100.0;
                        let found = table.forward(&mut crate::PlayState::unknown(), generator, torque, 20.0);
                        assert!(found.transmission_error_rad.abs() <= 1.0001 * bounds.error_rad);
                    }
                }
            }
        }
        [refused, harmless]
    }

    #[test]
    fn no_hostile_image_is_accepted_that_breaks_a_bound() {
        let [refused, harmless] = campaign(4000, 1);
        assert!(refused > 3000 && harmless < 600, "{refused} {harmless}");
    }

    #[test]
    #[ignore = "two hundred thousand images"]
    fn no_hostile_image_of_many_is_accepted_that_breaks_a_bound() {
        let [refused, harmless] = campaign(200_000, 2);
        std::println!("{refused} images refused, {harmless} changed ones that keep every bound");
    }
}
