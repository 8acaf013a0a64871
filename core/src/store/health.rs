//! How the table in the store is, what was seen of it, and why one is not activated.

use super::copies::STORE_WORDS;
use crate::error::ImageError;
use core::fmt;

/// Most pages of an image that a [`Store`](crate::Store) takes, 8 KiB: one bit for each.
pub const STORE_PAGES: usize = 32;

/// Counts of the store since it was made; they wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Ticks that were done again, as a step read words that differ between the copies or something else was not whole.
    pub doubtful_ticks: u32,
    /// Words of the copies that were found to differ when they were made anew.
    pub words_mended: u32,
    /// Words that were not made anew because the images differ and neither page is known to be the intact one.
    pub words_skipped: u32,
    /// Pages of an image found damaged.
    pub pages_damaged: u32,
    /// Passes over both copies.
    pub passes: u32,
}

numbered! { coded
    /// How the table in the store is, as far as it is known.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    pub enum Health {
        /// Nothing is known to be wrong.
        Sound,
        /// A page of one image is damaged.
        OneImage,
        /// A page is damaged in both images: only a new table helps.
        Lost,
        /// No table was activated.
        Empty,
        /// The store's data on the table is corrupt in both copies: nothing is corrected until the table is activated
        /// again.
        Torn,
    }
}

/// Why a table was not activated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ActivateError {
    /// Neither image is a table; this is wrong with the first.
    Image(ImageError),
    /// The table needs more than the store has.
    TooLarge {
        /// Words needed; [`Store::WORDS`](crate::Store::WORDS) are there.
        needed: usize,
    },
    /// The image has more pages than the store can distinguish.
    TooManyPages {
        /// Pages found; [`Store::PAGES`](crate::Store::PAGES) are allowed.
        found: usize,
    },
    /// Each image is a table, and they differ: words of two tables would be mixed.
    TwoTables,
    /// The table is for other tooth counts or another fixed member.
    OtherDrive,
    /// The temperature is not finite.
    Temperature {
        /// °C.
        found_c: f32,
    },
    /// Both images lie at the same place, or overlap.
    SameImage,
    /// The saved progress of an [`Activation`](crate::Activation) is corrupt: begin again.
    Torn,
}

impl fmt::Display for ActivateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Image(error) => error.fmt(f),
            Self::TooLarge { needed } => write!(f, "the table needs {needed} words, the store has {STORE_WORDS}"),
            Self::TooManyPages { found } => write!(f, "the image has {found} pages, a store takes {STORE_PAGES}"),
            Self::TwoTables => f.write_str("the images are two different tables"),
            Self::OtherDrive => f.write_str("the table is for another drive"),
            Self::Temperature { found_c } => write!(f, "temperature {found_c} C: must be finite"),
            Self::Torn => f.write_str("what was kept of an activation is not whole: begin again"),
            Self::SameImage => f.write_str("both images are the same place in memory: two are needed"),
        }
    }
}

impl core::error::Error for ActivateError {}

bits_of!(Counters { doubtful_ticks, words_mended, words_skipped, pages_damaged, passes });
