//! What the crates next to this one are built of: how a table is laid out, values under a sum that mends one word,
//! saved bytes with a checksum, and arithmetic with the same bits on every machine. Firmware needs none of it, and it
//! may change with every version.

pub use crate::angle::{COUNTS_PER_RAD, RAD_PER_COUNT, counts_from_rad};
pub use crate::crc::{crc32, seal};
pub use crate::joint::{bounded, opened, owner, uncertainty_counts};
pub use crate::play::MAX_HALF_COUNTS;
pub use crate::table::{grid, windup};
pub use crate::whole::{START, Sealed, Words, add, words};

/// Limits of a table, and where everything lies in its image.
pub mod image {
    pub use crate::table::{
        BYTE_ORDER_MARK, MAGIC, MAX_AXIS_VALUE, MAX_RIPPLE_NODES, MAX_TEMPERATURE_NODES, RESERVED, TEXT_BYTES,
        UNITS_PER_COUNT, cell_width, complete, counted, image_bytes, limit_counts, plan_of, ripple_row,
    };
}

/// Numbers.
pub mod num {
    pub use crate::num::{counts, finite, larger, sqrt, within};
}
