//! The `.fxt` table image: how it is laid out, written, and checked.
//!
//! Little-endian throughout, every part at a multiple of four bytes, read in place from any address on any host.
//!
//! | offset | bytes | what |
//! |---|---|---|
//! | 0 | 8 | magic `89 46 58 54 0d 0a 1a 0a` (`\x89FXT`, then what a text transfer would change) |
//! | 8 | 2 | format version, 3 |
//! | 10 | 2 | byte order mark `0xfeff` |
//! | 12 | 4 | length of the image in bytes |
//! | 16 | 32 | drive hash (BLAKE3 of the drive the samples came from) |
//! | 48 | 8 | table id: first 8 bytes of BLAKE3 of the body with these 8 bytes zero |
//! | 56 | 24 | tool version, printable ASCII padded with zeros |
//! | 80 | 24 | mesh level, likewise |
//! | 104 | 1, 1 | generator kind; fixed member (0 flexspline, 1 circular spline) |
//! | 106 | 2, 2 | flexspline teeth; circular spline teeth |
//! | 110 | 1, 1 | torque nodes (1 to 64); temperature nodes (1 to 8) |
//! | 112 | 1, 1, 1, 1 | ripple nodes (0, or 4 to 32); nodes of A, B, C (0, or 4 to 128) |
//! | 116 | 4 | ripple unit, 2⁻¹⁹ count |
//! | 120 | 4 | error limit, counts |
//! | 124 | 4 | residual the solver reached |
//! | 128 | 4, 4 | projection error, worst and rms, rad |
//! | 136 | 8, 8 | torque range N·m; temperature range °C: least, most |
//! | 152 | 4 | error limit, rad |
//! | 156 | 4 | width of a cell of the ripple at the output, counts, signed like the ratio; 1 without ripple |
//! | 160 | 2, 2 | last torque interval; last temperature interval |
//! | 164 | 2, 2 | where nodes start; from one temperature to the next |
//! | 168 | 2, 2 | where records start; from one temperature to the next |
//! | 172 | 2, 2 | from one record to the next; ripple nodes |
//! | 176 | 4 · 3 | A, B, C: where it starts (2), its nodes (2) |
//! | 188 | 4 | iterations of the inverse |
//! | 192 | 4 | hold: targets this close to the output leave the generator where it is, counts |
//! | 196 | 4 | words of the body |
//! | 200 | 56 | zero |
//! | 256 | 4 · 64 | torque nodes, N·m, padded with the largest number |
//! | 512 | 4 · 8 | temperature nodes, °C, padded likewise |
//! | 544 | | A, B, C: `i32` in half counts, stored closed |
//! | | | nodes `[temperature][torque node]`: D, its slope over the torque, H |
//! | | | (`f32` each; counts, counts/(N·m)); the last bit of H is set |
//! | | | where the interval above is a jump; a node alone is stored twice |
//! | | | records `[temperature][torque node]`: the ripple of forward motion, `R − h`, at each node, then that |
//! | | | of backward motion, `R + h`, each stored closed as an even number of `i16`, ripple units |
//! | | | end of the body |
//! | | | CRC-32 of each 256-byte page of the body (the last may be shorter) |
//! | | 4 | CRC-32 of everything before |
//!
//! Counts are of 2⁻³² output turn; places and steps are in words of four bytes, steps 0 along an axis of one node. A
//! periodic curve of n nodes is stored closed, as n + 3 values: the last node, all nodes, the first two; the three
//! around any place are then neighbours. A ripple goes on for one or two nodes more, n + 4 or n + 5 values: so are the
//! five. CRC-32 is the one of ISO-HDLC (zlib).
//!
//! Data that follow from other numbers (offsets, units, the inverse) are stored so that a step finds all it needs in
//! the image, where two copies are compared; [`Table::check`](super::Table::check) computes it again.
//!
//! Size with 3 temperatures, 25 torques, 8 ripple nodes and 32 nodes each for A, B, C:
//! 544 + 4·3·35 + 75·(12 + 48) = 5464, and 22 pages and the end 4·23 = 92: 5556 bytes. With 2 temperatures and 60
//! torques, as the two-roller generator needs: 7872. Both are below 8 KiB.

mod check;
mod header;
mod layout;
mod sums;
#[cfg(test)]
mod tests;

pub(crate) use check::ImageCheck;
pub(crate) use header::Laid;
pub use layout::{
    BYTE_ORDER_MARK, FORMAT_VERSION, MAGIC, MAX_AXIS_VALUE, MAX_ERROR_RAD, MAX_RIPPLE_NODES, MAX_TEMPERATURE_NODES,
    PAGE_BYTES, RESERVED, TEXT_BYTES, UNITS_PER_COUNT, cell_width, counted, image_bytes, limit_counts, plan_of,
    ripple_row,
};
pub(crate) use layout::{ID_OFFSET, NODE_WORDS, word};
pub use sums::complete;
pub(crate) use sums::page_intact;
#[cfg(any(test, feature = "testing"))]
pub use sums::reseal;
