//! Where everything lies in an image: limits, sizes, and words that follow from them.

use crate::drive::Drive;
use crate::error::{Field, ImageError};
use crate::num;
use crate::table::grid::MIN_PERIODIC_NODES;

/// Format version written and read.
pub const FORMAT_VERSION: u16 = 3;
/// Bytes of one page, the unit of a scrub and of an upload.
pub const PAGE_BYTES: usize = 256;
/// Most temperature nodes.
pub const MAX_TEMPERATURE_NODES: usize = 1 << TEMPERATURE_HALVINGS;
const TEMPERATURE_HALVINGS: u32 = 3;
/// Most ripple nodes over one tooth pitch.
pub const MAX_RIPPLE_NODES: usize = 32;
/// No table may give a larger error, rad (2.9°, one and a half tooth pitches of a 188-tooth drive).
pub const MAX_ERROR_RAD: f32 = 0.05;
/// Bytes of the tool version and of the mesh level.
pub const TEXT_BYTES: usize = 24;

/// First bytes of an image.
pub const MAGIC: [u8; 8] = *b"\x89FXT\r\n\x1a\n";
/// After the version: bytes in another order are found by it.
pub const BYTE_ORDER_MARK: u16 = 0xfeff;
pub(super) const HEADER_BYTES: usize = 256;
/// Ripple units in a count: 2¹⁹.
pub const UNITS_PER_COUNT: f64 = 524_288.0;

pub(super) const CRC_BYTES: usize = 4;
pub(crate) const ID_OFFSET: usize = 48;
/// Bytes that are zero.
pub const RESERVED: core::ops::Range<usize> = 200..HEADER_BYTES;
/// |torque| N·m and |temperature| °C of any node or range: keeps differences of nodes finite.
pub const MAX_AXIS_VALUE: f32 = 1e6;

/// Where a step finds things in an image, in words; the layout is described in [`image`](super).
pub(crate) mod word {
    /// Here two words: ripple unit, error limit.
    pub const RIPPLE_UNIT: usize = 29;
    pub const TORQUE_RANGE: usize = 34;
    pub const TEMPERATURE_RANGE: usize = 36;
    /// From here ten words: cell width, last intervals, nodes, records, record step and ripple nodes, curves A, B, C,
    /// iterations, hold.
    pub const CELL_WIDTH: usize = 39;
    /// Words of the body.
    pub const BODY: usize = 49;
    pub const TORQUE_NODES: usize = 64;
    pub const TEMPERATURE_NODES: usize = 128;
    pub const CURVES: usize = 136;
}
/// Words of a torque node: D, its slope, H.
pub(crate) const NODE_WORDS: usize = 3;

/// Bytes of the image of a table with these node counts; `curves` are those of A, B, C.
#[must_use]
pub const fn image_bytes(torque: usize, temperature: usize, ripple: usize, curves: [usize; 3]) -> usize {
    let body = body_bytes(torque, temperature, ripple, curves);
    body.div_ceil(PAGE_BYTES).saturating_add(1).saturating_mul(CRC_BYTES).saturating_add(body)
}

const fn body_bytes(torque: usize, temperature: usize, ripple: usize, curves: [usize; 3]) -> usize {
    ImageLayout::new(torque, temperature, ripple, curves).end.saturating_mul(4)
}

/// As [`PeriodicAxis::stored_len`](crate::grid::PeriodicAxis::stored_len), for any number.
const fn stored(nodes: usize) -> usize {
    if nodes == 0 { 0 } else { nodes.saturating_add(3) }
}

/// Values of the ripple of one direction in a record; also the words of a record.
pub const fn ripple_row(nodes: usize) -> usize {
    if nodes == 0 { 0 } else { nodes.saturating_add(5) & !1 }
}

/// Where everything lies, in words.
#[derive(Clone, Copy, Debug)]
pub(super) struct ImageLayout {
    pub curves: [usize; 3],
    pub nodes: usize,
    node_plane: usize,
    pub records: usize,
    pub record: usize,
    pub end: usize,
}

impl ImageLayout {
    pub const NONE: Self = Self { curves: [0; 3], nodes: 0, node_plane: 0, records: 0, record: 0, end: 0 };

    pub const fn new(torque: usize, temperature: usize, ripple: usize, [a, b, c]: [usize; 3]) -> Self {
        let curve_b = word::CURVES.saturating_add(stored(a));
        let curve_c = curve_b.saturating_add(stored(b));
        let nodes = curve_c.saturating_add(stored(c));
        let node_plane = (if torque > 1 { torque } else { 2 }).saturating_mul(NODE_WORDS);
        let records = nodes.saturating_add(node_plane.saturating_mul(temperature));
        let record = ripple_row(ripple);
        let end = records.saturating_add(record.saturating_mul(torque).saturating_mul(temperature));
        Self { curves: [word::CURVES, curve_b, curve_c], nodes, node_plane, records, record, end }
    }

    /// The words from [`word::CELL_WIDTH`] on that follow from the node counts, without cell width and inverse.
    pub fn plan(&self, torque: usize, temperature: usize, ripple: usize, curves: [usize; 3]) -> [u32; 7] {
        let pair = |low: usize, high: usize| low as u32 & 0xffff | (high as u32) << 16;
        let along = |nodes: usize, step: usize| if nodes > 1 { step } else { 0 };
        let [a, b, c] = self.curves;
        let [nodes_a, nodes_b, nodes_c] = curves;
        [
            pair(torque.saturating_sub(2), temperature.saturating_sub(2)),
            pair(self.nodes, along(temperature, self.node_plane)),
            pair(self.records, along(temperature, self.record.saturating_mul(torque))),
            pair(along(torque, self.record), ripple),
            pair(a, nodes_a),
            pair(b, nodes_b),
            pair(c, nodes_c),
        ]
    }
}

/// The words of an image behind the cell width that follow from the node counts, and how many words
/// its body has.
#[must_use]
pub fn plan_of(torque: usize, temperature: usize, ripple: usize, curves: [usize; 3]) -> ([u32; 7], u32) {
    let layout = ImageLayout::new(torque, temperature, ripple, curves);
    (layout.plan(torque, temperature, ripple, curves), layout.end as u32)
}

bits_of!(ImageLayout { curves, nodes, node_plane, records, record, end });

/// Width of a cell of the ripple at the output, counts.
pub fn cell_width(drive: &Drive, ripple_nodes: usize) -> f32 {
    if ripple_nodes == 0 {
        return 1.0;
    }
    (4_294_967_296.0 / (ripple_nodes as f64 * drive.tooth_periods() as f64)) as f32
}

/// Words that follow from the bounds: iterations, hold.
pub(super) const DERIVED_WORDS: [usize; 2] = [word::CELL_WIDTH.saturating_add(8), word::CELL_WIDTH.saturating_add(9)];

/// An error limit in counts, rounded up; the per mille takes up the rounding of single precision, the counts that of
/// integers.
pub fn limit_counts(limit_rad: f32) -> u32 {
    (num::counts(limit_rad as f64) * 1.001 + 16.0) as u32
}

/// A number of nodes as an image keeps it; 0 is allowed for what is periodic.
pub fn counted(field: Field, found: usize, least: usize, most: usize) -> Result<u8, ImageError> {
    let optional = least == MIN_PERIODIC_NODES && found == 0;
    if optional || (least..=most).contains(&found) {
        Ok(found as u8)
    } else {
        Err(ImageError::Count { field, found, least, most })
    }
}
