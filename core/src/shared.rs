//! What the crates next to this one are built of: how a table is laid out, values under a sum that mends one word, saved
//! bytes with a checksum, and arithmetic with the same bits on every machine. Firmware needs none of it, and it may
//! change with every version.

pub use crate::angle::{COUNTS_PER_RAD, RAD_PER_COUNT, counts_from_rad};
pub use crate::crc::{crc32, seal};
pub use crate::joint::{bounded, opened, owner, uncertainty_counts};
pub use crate::play::MAX_HALF_COUNTS;
pub use crate::table::{MAX_AXIS_VALUE, counted, windup};
pub use crate::whole::{START, Sealed, Words, add, words};

/// Numbers.
pub mod num {
    pub use crate::num::{finite, larger, sqrt, within};
}
