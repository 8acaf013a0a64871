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
//! | | | nodes `[temperature][torque node]`: D, its slope over the torque, H (`f32` each; counts, counts/(N·m)); the last bit of |
//! | | | H is set where the interval above is a jump; a node alone is stored twice |
//! | | | records `[temperature][torque node]`: the ripple of forward motion, `R − h`, at each node, then that of backward |
//! | | | motion, `R + h`, each stored closed as an even number of `i16`, ripple units |
//! | | | end of the body |
//! | | | CRC-32 of each 256-byte page of the body (the last may be shorter) |
//! | | 4 | CRC-32 of everything before |
//!
//! Counts are of 2⁻³² output turn; places and steps are in words of four bytes, steps 0 along an axis of one node. A periodic
//! curve of n nodes is stored closed, as n + 3 values: the last node, all nodes, the first two; the three around any place
//! are then neighbours. A ripple goes on for one or two nodes more, n + 4 or n + 5 values: so are the five. CRC-32 is the one of ISO-HDLC (zlib).
//!
//! What follows from other numbers (offsets, units, the inverse) is stored so that a step finds all it needs in the image, where
//! two copies are compared; [`Table::check`] computes it again.
//!
//! Size with 3 temperatures, 25 torques, 8 ripple nodes and 32 nodes each for A, B, C:
//! 544 + 4·3·35 + 75·(12 + 48) = 5464, and 22 pages and the end 4·23 = 92: 5556 bytes. With 2 temperatures and 60 torques, as
//! the two-roller generator needs: 7872. Both are below 8 KiB.

use super::bounds::{Bounds, HOLD_COUNTS, InverseBound, MAX_INVERSE_ERROR_RAD};
use super::grid::{self, MAX_CLAMPED_NODES, MAX_PERIODIC_NODES, MIN_PERIODIC_NODES, PeriodicAxis};
use super::windup::Slopes;
use super::{GeneratorKind, NODE_WORDS, Table, TableId, Words, f32_at, halves, word, word_at};
use crate::angle::RAD_PER_COUNT;
use crate::crc::crc32;
use crate::drive::{Drive, FixedMember};
use crate::error::{Field, ImageError};
use crate::num::{self, larger, larger64};
use core::f64::consts::TAU;
use core::fmt;

/// Format version written and read.
pub const FORMAT_VERSION: u16 = 3;
/// Bytes of one page, the unit of a scrub and of an upload.
pub const PAGE_BYTES: usize = 256;
/// Most temperature nodes.
pub const MAX_TEMPERATURE_NODES: usize = 1 << TEMPERATURE_HALVINGS;
pub(crate) const TEMPERATURE_HALVINGS: u32 = 3;
/// Most ripple nodes over one tooth pitch.
pub const MAX_RIPPLE_NODES: usize = 32;
/// No table may give a larger error, rad (2.9°, one and a half tooth pitches of a 188-tooth drive).
pub const MAX_ERROR_RAD: f32 = 0.05;
/// Bytes of the tool version and of the mesh level.
pub const TEXT_BYTES: usize = 24;

const MAGIC: [u8; 8] = *b"\x89FXT\r\n\x1a\n";
const BYTE_ORDER_MARK: u16 = 0xfeff;
const HEADER_BYTES: usize = 256;
/// Slots of the torque axis and of the temperature axis.
const AXIS_SLOTS: [usize; 2] = [MAX_CLAMPED_NODES, MAX_TEMPERATURE_NODES];
/// Ripple units in a count: 2¹⁹.
const UNITS_PER_COUNT: f64 = 524_288.0;
/// Half-widths may miss zero by this, counts, and the ripple unit: rounding.
const HALF_WIDTH_ROUNDING_COUNTS: f64 = 3.0;
/// Largest ripple unit for each count of a cell: a ripple of 15.9 cells.
const MAX_UNITS_PER_CELL: f32 = 255.0;
/// How far B-spline weights of 15 bits can be off, times the largest step between coefficients: one unit for the place in the
/// cell and one for each of the two weights that are rounded.
const WEIGHT_ROUNDING: f32 = 3.0 / 32_768.0;
const CRC_BYTES: usize = 4;
const ID_OFFSET: usize = 48;
const RESERVED: core::ops::Range<usize> = 200..HEADER_BYTES;
/// |torque| N·m and |temperature| °C of any node or range: keeps differences of nodes finite.
pub(crate) const MAX_AXIS_VALUE: f32 = 1e6;

/// What made a table and how far it holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Provenance<'a> {
    /// Kind of wave generator.
    pub generator_kind: GeneratorKind,
    /// BLAKE3 of the drive description.
    pub drive_hash: [u8; 32],
    /// Program and version, at most 24 printable ASCII characters.
    pub tool_version: &'a str,
    /// Mesh or data the samples came from, at most 24 printable ASCII characters.
    pub mesh_level: &'a str,
    /// Relative residual the solver reached, ≥ 0; 0 for measured samples.
    pub solver_residual: f32,
    /// Torques the table holds for, N·m; inside the torque nodes unless there is only one.
    pub torque_range_n_m: [f32; 2],
    /// Temperatures the table holds for, °C; inside the temperature nodes unless there is only one.
    pub temperature_range_c: [f32; 2],
    /// Largest |error| the table may give, rad, above 0 and at most [`MAX_ERROR_RAD`].
    pub error_limit_rad: f32,
}

/// The numbers of a table. All angles are radians at the output; curves and ripple are B-spline coefficients
/// ([`grid`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableData<'a> {
    /// Tooth counts and fixed member.
    pub drive: Drive,
    /// Torque nodes, N·m, strictly increasing.
    pub torque_nodes_n_m: &'a [f32],
    /// Temperature nodes, °C, strictly increasing.
    pub temperature_nodes_c: &'a [f32],
    /// Nodes over one tooth pitch; 0 for no ripple.
    pub ripple_nodes: usize,
    /// D, `[temperature][torque]`; its slopes follow from it ([`crate::make`]).
    pub mean_rad: &'a [f32],
    /// H, `[temperature][torque]`, ≥ 0.
    pub half_width_rad: &'a [f32],
    /// R, `[temperature][torque][ripple node]`.
    pub mean_ripple_rad: &'a [f32],
    /// h, `[temperature][torque][ripple node]`, `H + h ≥ 0`.
    pub half_width_ripple_rad: &'a [f32],
    /// A over the generator angle; empty if absent.
    pub generator_curve_rad: &'a [f32],
    /// B over the material phase; empty if absent.
    pub material_curve_rad: &'a [f32],
    /// C over the output angle; empty if absent.
    pub output_curve_rad: &'a [f32],
    /// Largest deviation from the samples, rad.
    pub projection_worst_rad: f32,
    /// Root mean square deviation from the samples, rad.
    pub projection_rms_rad: f32,
}

/// Why no image was written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WriteError {
    /// The buffer does not hold the image.
    BufferTooSmall {
        /// Bytes needed.
        needed: usize,
        /// Bytes given.
        found: usize,
    },
    /// An array does not have the length that the axes give.
    Shape {
        /// Which array.
        field: Field,
        /// Numbers found.
        found: usize,
        /// Numbers needed.
        needed: usize,
    },
    /// A text is too long.
    TextTooLong {
        /// Which text.
        field: Field,
        /// Bytes found; [`TEXT_BYTES`] are allowed.
        found: usize,
    },
    /// The reader would refuse the image.
    Refused(ImageError),
}

impl fmt::Display for WriteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::BufferTooSmall { needed, found } => {
                write!(f, "the image needs {needed} bytes, the buffer has {found}")
            }
            Self::Shape { field, found, needed } => {
                write!(f, "{field}: {found} numbers where the axes need {needed}")
            }
            Self::TextTooLong { field, found } => {
                write!(f, "{field}: {found} bytes, at most {TEXT_BYTES} are allowed")
            }
            Self::Refused(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for WriteError {}

impl From<ImageError> for WriteError {
    fn from(error: ImageError) -> Self {
        Self::Refused(error)
    }
}

/// Bytes of the image of a table with these node counts; `curves` are those of A, B, C.
#[must_use]
pub const fn image_bytes(torque: usize, temperature: usize, ripple: usize, curves: [usize; 3]) -> usize {
    let body = body_bytes(torque, temperature, ripple, curves);
    body.div_ceil(PAGE_BYTES).saturating_add(1).saturating_mul(CRC_BYTES).saturating_add(body)
}

const fn body_bytes(torque: usize, temperature: usize, ripple: usize, curves: [usize; 3]) -> usize {
    Layout::new(torque, temperature, ripple, curves).end.saturating_mul(4)
}

/// As [`PeriodicAxis::stored_len`], for any number.
const fn stored(nodes: usize) -> usize {
    if nodes == 0 { 0 } else { nodes.saturating_add(3) }
}

/// Values of the ripple of one direction in a record; also the words of a record.
pub(crate) const fn ripple_row(nodes: usize) -> usize {
    if nodes == 0 { 0 } else { nodes.saturating_add(5) & !1 }
}

/// Where everything lies, in words.
#[derive(Clone, Copy, Debug)]
struct Layout {
    curves: [usize; 3],
    nodes: usize,
    node_plane: usize,
    records: usize,
    record: usize,
    end: usize,
}

impl Layout {
    const fn new(torque: usize, temperature: usize, ripple: usize, [a, b, c]: [usize; 3]) -> Self {
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
    fn plan(&self, torque: usize, temperature: usize, ripple: usize, curves: [usize; 3]) -> [u32; 7] {
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

/// Fills a buffer from the front; what does not fit is only counted.
struct Writer<'o> {
    rest: &'o mut [u8],
    needed: usize,
}

impl<'o> Writer<'o> {
    fn put(&mut self, bytes: &[u8]) {
        self.needed = self.needed.saturating_add(bytes.len());
        let room = bytes.len().min(self.rest.len());
        let (here, rest) = core::mem::take(&mut self.rest).split_at_mut_checked(room).unwrap_or_default();
        here.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        self.rest = rest;
    }

    fn put_numbers(&mut self, numbers: &[f32]) {
        numbers.iter().for_each(|number| self.put(&number.to_le_bytes()));
    }

    fn put_text(&mut self, text: &str) {
        let padding = [0u8; TEXT_BYTES];
        self.put(text.as_bytes());
        self.put(padding.get(text.len()..).unwrap_or_default());
    }
}

/// The one place where numbers become integers: to nearest.
fn quantise(value: f64) -> i32 {
    (value + if value < 0.0 { -0.5 } else { 0.5 }) as i32
}

fn check_finite(field: Field, values: &[f32]) -> Result<(), WriteError> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(ImageError::NotFinite { field, index }.into()),
        None => Ok(()),
    }
}

/// Width of a cell of the ripple at the output, counts.
fn cell_width(drive: &Drive, ripple_nodes: usize) -> f32 {
    if ripple_nodes == 0 {
        return 1.0;
    }
    (4_294_967_296.0 / (ripple_nodes as f64 * drive.tooth_periods() as f64)) as f32
}

fn needs(field: Field, values: &[f32], needed: usize) -> Result<(), WriteError> {
    if values.len() == needed { Ok(()) } else { Err(WriteError::Shape { field, found: values.len(), needed }) }
}

pub(crate) fn counted(field: Field, found: usize, least: usize, most: usize) -> Result<u8, ImageError> {
    let optional = least == MIN_PERIODIC_NODES && found == 0;
    if optional || (least..=most).contains(&found) {
        Ok(found as u8)
    } else {
        Err(ImageError::Count { field, found, least, most })
    }
}

impl TableData<'_> {
    fn check_shapes(&self) -> Result<(), WriteError> {
        let records = self.torque_nodes_n_m.len().saturating_mul(self.temperature_nodes_c.len());
        let ripples = records.saturating_mul(self.ripple_nodes);
        needs(Field::Mean, self.mean_rad, records)?;
        needs(Field::HalfWidth, self.half_width_rad, records)?;
        needs(Field::MeanRipple, self.mean_ripple_rad, ripples)?;
        needs(Field::HalfWidthRipple, self.half_width_ripple_rad, ripples)
    }

    /// Node counts as the header holds them: torque, temperature, ripple, A, B, C.
    fn counts(&self) -> Result<[u8; 6], ImageError> {
        let curve = |field, values: &[f32]| counted(field, values.len(), MIN_PERIODIC_NODES, MAX_PERIODIC_NODES);
        Ok([
            counted(Field::TorqueNodes, self.torque_nodes_n_m.len(), 1, MAX_CLAMPED_NODES)?,
            counted(Field::TemperatureNodes, self.temperature_nodes_c.len(), 1, MAX_TEMPERATURE_NODES)?,
            counted(Field::RippleNodes, self.ripple_nodes, MIN_PERIODIC_NODES, MAX_RIPPLE_NODES)?,
            curve(Field::GeneratorCurve, self.generator_curve_rad)?,
            curve(Field::MaterialCurve, self.material_curve_rad)?,
            curve(Field::OutputCurve, self.output_curve_rad)?,
        ])
    }

    /// The unit in which the largest ripple of either direction is 32767, rounded up.
    fn ripple_unit(&self) -> u32 {
        let pairs = self.mean_ripple_rad.iter().zip(self.half_width_ripple_rad);
        let largest = pairs.fold(0.0f64, |most, (r, h)| larger64(most, (*r as f64).abs() + (*h as f64).abs()));
        let unit = num::counts(largest) / i16::MAX as f64 * UNITS_PER_COUNT;
        let whole = unit as u32;
        if unit > whole as f64 { whole.saturating_add(1) } else { whole }
    }

    fn put_nodes(&self, out: &mut Writer<'_>) {
        let slopes = &Slopes::new(self.torque_nodes_n_m);
        let nodes = self.torque_nodes_n_m;
        let jumps = grid::jump_intervals(nodes.len(), |i| nodes.get(i).copied().unwrap_or(0.0));
        let torques = nodes.len().max(1);
        for (means, halves) in self.mean_rad.chunks_exact(torques).zip(self.half_width_rad.chunks_exact(torques)) {
            for (node, (mean, half)) in means.iter().zip(halves).enumerate() {
                let slope = slopes.at(node).of(means);
                let half = (num::counts(*half as f64) as f32).to_bits() & !1 | grid::is_jump(jumps, node) as u32;
                for _ in 0..if nodes.len() == 1 { 2 } else { 1 } {
                    out.put_numbers(&[*mean as f64, slope].map(|rad| num::counts(rad) as f32));
                    out.put(&half.to_le_bytes());
                }
            }
        }
    }

    fn put_records(&self, out: &mut Writer<'_>, unit: u32) {
        let Some(axis) = PeriodicAxis::new(self.ripple_nodes).filter(|axis| !axis.is_empty()) else { return };
        let units = |rad: f64| if unit == 0 { 0 } else { quantise(num::counts(rad) * UNITS_PER_COUNT / unit as f64) };
        let mean_ripples = self.mean_ripple_rad.chunks_exact(axis.len());
        for (mean, half) in mean_ripples.zip(self.half_width_ripple_rad.chunks_exact(axis.len())) {
            for side in [-1.0, 1.0] {
                for position in 0..ripple_row(axis.len()) {
                    let value = |ripple: &[f32]| ripple.get(axis.stored_node(position)).copied().unwrap_or(0.0) as f64;
                    out.put(&(units(value(mean) + side * value(half)) as i16).to_le_bytes());
                }
            }
        }
    }
}

/// Writes the image of a table to the front of `out` and returns its length.
///
/// `id` gets the body of the image with the table id zero and returns the first eight bytes of its BLAKE3 hash.
/// The image written has passed [`Table::check`].
///
/// # Errors
/// [`WriteError`] if the arrays do not fit the axes or the buffer, or if the reader would refuse the table.
pub fn write_image(
    data: &TableData<'_>,
    provenance: &Provenance<'_>,
    out: &mut [u8],
    id: impl FnOnce(&[u8]) -> [u8; 8],
) -> Result<usize, WriteError> {
    data.check_shapes()?;
    let counts = data.counts()?;
    for (field, text) in [(Field::ToolVersion, provenance.tool_version), (Field::MeshLevel, provenance.mesh_level)] {
        if text.len() > TEXT_BYTES {
            return Err(WriteError::TextTooLong { field, found: text.len() });
        }
    }
    let curves = [data.generator_curve_rad, data.material_curve_rad, data.output_curve_rad];
    let needed = image_bytes(
        data.torque_nodes_n_m.len(),
        data.temperature_nodes_c.len(),
        data.ripple_nodes,
        curves.map(<[f32]>::len),
    );
    let found = out.len();
    let image = out.get_mut(..needed).ok_or(WriteError::BufferTooSmall { needed, found })?;
    check_finite(Field::MeanRipple, data.mean_ripple_rad)?;
    check_finite(Field::HalfWidthRipple, data.half_width_ripple_rad)?;
    let ripple_unit = data.ripple_unit();
    let nodes = (data.torque_nodes_n_m.len(), data.temperature_nodes_c.len(), data.ripple_nodes);
    let curve_nodes = curves.map(<[f32]>::len);
    let layout = Layout::new(nodes.0, nodes.1, nodes.2, curve_nodes);

    let mut writer = Writer { rest: image, needed: 0 };
    writer.put(&MAGIC);
    writer.put(&FORMAT_VERSION.to_le_bytes());
    writer.put(&BYTE_ORDER_MARK.to_le_bytes());
    writer.put(&(needed as u32).to_le_bytes());
    writer.put(&provenance.drive_hash);
    writer.put(&[0; 8]);
    writer.put_text(provenance.tool_version);
    writer.put_text(provenance.mesh_level);
    let fixed = match data.drive.fixed() {
        FixedMember::Flexspline => 0,
        FixedMember::CircularSpline => 1,
    };
    writer.put(&[provenance.generator_kind.code(), fixed]);
    writer.put(&data.drive.flexspline_teeth().to_le_bytes());
    writer.put(&data.drive.circular_spline_teeth().to_le_bytes());
    writer.put(&counts);
    writer.put(&ripple_unit.to_le_bytes());
    writer.put(&limit_counts(provenance.error_limit_rad).to_le_bytes());
    writer.put_numbers(&[provenance.solver_residual, data.projection_worst_rad, data.projection_rms_rad]);
    writer.put_numbers(&provenance.torque_range_n_m);
    writer.put_numbers(&provenance.temperature_range_c);
    writer.put_numbers(&[provenance.error_limit_rad, cell_width(&data.drive, nodes.2)]);
    layout.plan(nodes.0, nodes.1, nodes.2, curve_nodes).iter().for_each(|word| writer.put(&word.to_le_bytes()));
    // The inverse follows from the bounds, which are found in the finished image.
    writer.put(&[0; 8]);
    writer.put(&(layout.end as u32).to_le_bytes());
    writer.put(&[0; RESERVED.end - RESERVED.start]);
    for (axis, slots) in [data.torque_nodes_n_m, data.temperature_nodes_c].into_iter().zip(AXIS_SLOTS) {
        writer.put_numbers(axis);
        (axis.len()..slots).for_each(|_| writer.put_numbers(&[f32::MAX]));
    }
    for (field, curve) in [Field::GeneratorCurve, Field::MaterialCurve, Field::OutputCurve].into_iter().zip(curves) {
        check_finite(field, curve)?;
        let axis = PeriodicAxis::new(curve.len()).unwrap_or_default();
        for position in 0..axis.stored_len() {
            let value = curve.get(axis.stored_node(position)).copied().unwrap_or(0.0);
            writer.put(&quantise(2.0 * num::counts(value as f64)).to_le_bytes());
        }
    }
    data.put_nodes(&mut writer);
    data.put_records(&mut writer, ripple_unit);

    let body_bytes = writer.needed;
    complete(image, body_bytes)?;
    let id = id(image.get(..body_bytes).unwrap_or_default());
    if let Some(place) = image.get_mut(ID_OFFSET..).and_then(|rest| rest.first_chunk_mut::<8>()) {
        *place = id;
    }
    seal(image, body_bytes);
    Table::check(image)?;
    Ok(needed)
}

/// Stores what follows from the bounds of the numbers.
fn complete(image: &mut [u8], body_bytes: usize) -> Result<(), ImageError> {
    seal(image, body_bytes);
    let derived = Table::parse(image)?.derived();
    for (word, value) in DERIVED_WORDS.into_iter().zip(derived) {
        let place = image.as_chunks_mut::<4>().0.get_mut(word);
        place.into_iter().for_each(|bytes| *bytes = value.to_le_bytes());
    }
    Ok(())
}

/// Words that follow from the bounds: iterations, hold.
const DERIVED_WORDS: [usize; 2] = [word::CELL_WIDTH.saturating_add(8), word::CELL_WIDTH.saturating_add(9)];

/// An error limit in counts, rounded up; the per mille takes up the rounding of single precision, the counts that of integers.
fn limit_counts(limit_rad: f32) -> u32 {
    (num::counts(limit_rad as f64) * 1.001 + 16.0) as u32
}

/// Computes and stores every checksum of an image whose body is complete.
fn seal(image: &mut [u8], body_bytes: usize) {
    let Some((body, sums)) = image.split_at_mut_checked(body_bytes) else {
        return;
    };
    let (sums, _) = sums.as_chunks_mut::<CRC_BYTES>();
    for (sum, page) in sums.iter_mut().zip(body.chunks(PAGE_BYTES)) {
        *sum = crc32(page).to_le_bytes();
    }
    if let Some((before, last)) = image.split_last_chunk_mut::<CRC_BYTES>() {
        *last = crc32(before).to_le_bytes();
    }
}

/// Makes every checksum of an image right that states its body, whatever is in it.
#[cfg(any(test, feature = "fuzzing"))]
#[doc(hidden)]
pub fn reseal(image: &mut [u8]) {
    let body_bytes = word_at(image.as_chunks::<4>().0, word::BODY) as usize;
    let body_bytes = body_bytes.saturating_mul(4);
    if body_bytes < image.len() {
        seal(image, body_bytes);
        let _ = complete(image, body_bytes);
        seal(image, body_bytes);
    }
}

/// Reads fields of the header; the offsets are all inside it.
#[derive(Clone, Copy)]
struct Header<'a>(&'a [u8; HEADER_BYTES]);

impl<'a> Header<'a> {
    fn bytes<const N: usize>(self, offset: usize) -> [u8; N] {
        self.0.get(offset..).and_then(|rest| rest.first_chunk::<N>()).copied().unwrap_or([0; N])
    }

    fn u8(self, offset: usize) -> u8 {
        u8::from_le_bytes(self.bytes(offset))
    }

    fn u16(self, offset: usize) -> u16 {
        u16::from_le_bytes(self.bytes(offset))
    }

    fn u32(self, offset: usize) -> u32 {
        u32::from_le_bytes(self.bytes(offset))
    }

    fn f32(self, offset: usize) -> f32 {
        f32::from_le_bytes(self.bytes(offset))
    }

    /// The text at `offset` without its padding.
    fn text(self, offset: usize, field: Field) -> Result<&'a str, ImageError> {
        let bytes = self.0.get(offset..offset.saturating_add(TEXT_BYTES)).unwrap_or_default();
        let length = bytes.iter().position(|byte| *byte == 0).unwrap_or(TEXT_BYTES);
        let (text, padding) = bytes.split_at_checked(length).unwrap_or_default();
        let printable = text.iter().all(|byte| (0x20..0x7f).contains(byte)) && padding.iter().all(|byte| *byte == 0);
        match core::str::from_utf8(text) {
            Ok(text) if printable => Ok(text),
            _ => Err(ImageError::Text { field }),
        }
    }
}

fn finite(field: Field, index: usize, value: f32) -> Result<f32, ImageError> {
    if value.is_finite() { Ok(value) } else { Err(ImageError::NotFinite { field, index }) }
}

fn in_range(field: Field, index: usize, found: f32, least: f32, most: f32) -> Result<f32, ImageError> {
    finite(field, index, found)?;
    if found >= least && found <= most { Ok(found) } else { Err(ImageError::OutOfRange { field, found, least, most }) }
}

/// The nodes increase and what follows is padding.
fn check_axis(field: Field, words: Words<'_>, first: usize, nodes: usize, slots: usize) -> Result<(), ImageError> {
    let mut before = f32::NEG_INFINITY;
    for index in 0..slots {
        let at = first.saturating_add(index);
        if index >= nodes {
            derived_is(words, at, f32::MAX.to_bits())?;
            continue;
        }
        let node = in_range(field, index, f32_at(words, at), -MAX_AXIS_VALUE, MAX_AXIS_VALUE)?;
        if node <= before {
            return Err(ImageError::NotIncreasing { field, index });
        }
        before = node;
    }
    Ok(())
}

/// Whether a word is what it must be.
fn derived_is(words: Words<'_>, at: usize, value: u32) -> Result<(), ImageError> {
    if word_at(words, at) == value { Ok(()) } else { Err(ImageError::Derived { offset: at.saturating_mul(4) }) }
}

/// A range must lie inside the axis; an axis of one node holds wherever its maker says.
fn check_range(field: Field, words: Words<'_>, at: usize, first: usize, nodes: usize) -> Result<(), ImageError> {
    let [least, most] = [0, 1].map(|end: usize| f32_at(words, at.saturating_add(end)));
    let (mut from, mut to) = (-MAX_AXIS_VALUE, MAX_AXIS_VALUE);
    if nodes > 1 {
        (from, to) = (f32_at(words, first), f32_at(words, first.saturating_add(nodes).saturating_sub(1)));
    }
    in_range(field, 0, least, from, to)?;
    in_range(field, 1, most, least, to)?;
    Ok(())
}

/// What a closed B-spline has at most: coefficient, slope per node spacing, value. Coefficients bound values too, and are simpler
/// to blend; values tell how far the curve really goes.
fn extremes(stored: usize, value: impl Fn(usize) -> f32) -> [f32; 3] {
    let mut most = [0.0; 3];
    for i in 0..stored.saturating_sub(2) {
        let [largest, steepest, reached] = most;
        let (a, b, c) = (value(i), value(i.saturating_add(1)), value(i.saturating_add(2)));
        // A parabola from (a + b)/2 to (b + c)/2; its top, if inside, where the slope b − a + t·(a − 2b + c) vanishes.
        let turn = (a - b) / (a - 2.0 * b + c);
        let top = 0.5 * (a + b) + 0.5 * turn * (b - a);
        let top = if turn > 0.0 && turn < 1.0 { top.abs() } else { 0.0 };
        most = [
            larger(largest, a.abs()),
            larger(steepest, (b - a).abs()),
            larger(reached, larger(top, 0.5 * (a + b).abs())),
        ];
    }
    most
}

/// Half word `index` of a record.
#[inline(never)]
fn half_at(record: Words<'_>, index: usize) -> i16 {
    let word = word_at(record, index / 2);
    (if index.is_multiple_of(2) { word } else { word >> 16 }) as i16
}

/// Whether the three repeated words of a stored curve equal the nodes they repeat.
fn check_closed(field: Field, axis: PeriodicAxis, words: Words<'_>) -> Result<(), ImageError> {
    let word = |position: usize| words.get(position);
    for index in 0..axis.stored_len() {
        // Node i is stored at position i + 1.
        if word(index) != word(axis.stored_node(index).saturating_add(1)) {
            return Err(ImageError::NotClosed { field, index });
        }
    }
    Ok(())
}

/// Counts in radians.
fn rad(counts: f32) -> f32 {
    counts * RAD_PER_COUNT
}

impl<'a> Table<'a> {
    /// Checks an image and gives the table in it. Nothing of an image can be used before.
    ///
    /// Verified: length, magic, version, byte order, CRC-32 of the whole and of every page, texts, tooth counts, node
    /// counts; every number finite; axes strictly increasing; half-width of the play ≥ 0 everywhere; torque intervals that
    /// meet at their nodes; the largest error the table can give within its stated limit and [`MAX_ERROR_RAD`];
    /// `|ratio·de/dψ| < 1` everywhere, so that the inverse exists, and how it converges; periodic parts closed at the wrap;
    /// every offset, unit and bound that follows from other numbers.
    ///
    /// Bounds hold for every input, not only at nodes: a B-spline stays within its coefficients, and what the cubic of the
    /// wind-up departs from the straight line between two nodes counts in full.
    ///
    /// Two passes over the image and its CRC-32 twice, once per upload, not in the step.
    ///
    /// # Errors
    /// The first check that fails, in the order of [`ImageError`].
    pub fn check(image: &'a [u8]) -> Result<Self, ImageError> {
        let table = Self::parse(image)?;
        for (at, value) in DERIVED_WORDS.into_iter().zip(table.derived()) {
            derived_is(table.words, at, value)?;
        }
        Ok(table)
    }

    /// [`Self::check`] but for the words that follow from the bounds.
    fn parse(image: &'a [u8]) -> Result<Self, ImageError> {
        let header = check_envelope(image)?;
        let drive = check_identity(header)?;
        let generator_kind =
            GeneratorKind::from_code(header.u8(104)).ok_or(ImageError::GeneratorKind { found: header.u8(104) })?;
        let count = |offset: usize, field, least, most| {
            counted(field, header.u8(offset) as usize, least, most).map(usize::from)
        };
        let torque_nodes = count(110, Field::TorqueNodes, 1, MAX_CLAMPED_NODES)?;
        let temperature_nodes = count(111, Field::TemperatureNodes, 1, MAX_TEMPERATURE_NODES)?;
        let ripple_nodes = count(112, Field::RippleNodes, MIN_PERIODIC_NODES, MAX_RIPPLE_NODES)?;
        let curve_nodes = [
            count(113, Field::GeneratorCurve, MIN_PERIODIC_NODES, MAX_PERIODIC_NODES)?,
            count(114, Field::MaterialCurve, MIN_PERIODIC_NODES, MAX_PERIODIC_NODES)?,
            count(115, Field::OutputCurve, MIN_PERIODIC_NODES, MAX_PERIODIC_NODES)?,
        ];
        let needed = image_bytes(torque_nodes, temperature_nodes, ripple_nodes, curve_nodes);
        let size = ImageError::Size { needed, found: image.len() };
        if needed != image.len() {
            return Err(size);
        }
        let layout = Layout::new(torque_nodes, temperature_nodes, ripple_nodes, curve_nodes);
        let body_bytes = layout.end.saturating_mul(4);
        if let Some(page) = (0..body_bytes.div_ceil(PAGE_BYTES)).find(|&page| !page_intact(image, body_bytes, page)) {
            return Err(ImageError::PageCrc { page });
        }
        let (words, _) = image.get(..body_bytes).ok_or(size)?.as_chunks::<4>();
        let plan = layout.plan(torque_nodes, temperature_nodes, ripple_nodes, curve_nodes);
        derived_is(words, word::BODY, layout.end as u32)?;
        derived_is(words, word::CELL_WIDTH, cell_width(&drive, ripple_nodes).to_bits())?;
        for (at, value) in (word::CELL_WIDTH.saturating_add(1)..).zip(plan) {
            derived_is(words, at, value)?;
        }
        let limit = in_range(Field::ErrorLimit, 0, header.f32(152), f32::MIN_POSITIVE, MAX_ERROR_RAD)?;
        derived_is(words, word::RIPPLE_UNIT.saturating_add(1), limit_counts(limit))?;
        check_axis(Field::TorqueNodes, words, word::TORQUE_NODES, torque_nodes, MAX_CLAMPED_NODES)?;
        let slots = MAX_TEMPERATURE_NODES;
        check_axis(Field::TemperatureNodes, words, word::TEMPERATURE_NODES, temperature_nodes, slots)?;
        check_range(Field::TorqueRange, words, word::TORQUE_RANGE, word::TORQUE_NODES, torque_nodes)?;
        let (range, nodes) = (word::TEMPERATURE_RANGE, word::TEMPERATURE_NODES);
        check_range(Field::TemperatureRange, words, range, nodes, temperature_nodes)?;
        in_range(Field::SolverResidual, 0, header.f32(124), 0.0, f32::MAX)?;
        in_range(Field::ProjectionWorst, 0, header.f32(128), 0.0, MAX_ERROR_RAD)?;
        in_range(Field::ProjectionRms, 0, header.f32(132), 0.0, header.f32(128))?;
        let mut table = Self {
            image,
            words,
            body_bytes,
            drive,
            generator_kind,
            torque_nodes,
            temperature_nodes,
            ripple: PeriodicAxis::new(ripple_nodes).ok_or(size)?,
            bounds: Bounds::default(),
            inverse: InverseBound::default(),
            plan: Table::plan_in(words),
        };
        table.bounds = table.check_bounds(&layout, curve_nodes)?;
        let cell_rad = rad(cell_width(&drive, ripple_nodes).abs());
        table.inverse = table.bounds.inverse(if ripple_nodes == 0 { f32::INFINITY } else { cell_rad });
        let left_rad = table.inverse.error_rad;
        if left_rad.is_nan() || left_rad > MAX_INVERSE_ERROR_RAD {
            return Err(ImageError::Inverse { left_rad });
        }
        Ok(table)
    }

    /// Values of [`DERIVED_WORDS`].
    fn derived(&self) -> [u32; 2] {
        let hold = num::counts(self.inverse.error_rad as f64) as i32;
        [self.inverse.iterations as u32, hold.saturating_add(HOLD_COUNTS) as u32]
    }

    fn check_bounds(&self, layout: &Layout, curve_nodes: [usize; 3]) -> Result<Bounds, ImageError> {
        let mut bounds = Bounds::default();
        // So that the ripple in cells, and in counts, fits the integers of a step.
        let most = cell_width(&self.drive, self.ripple.len()).abs() * MAX_UNITS_PER_CELL;
        let most = if self.ripple.is_empty() || most > i32::MAX as f32 { i32::MAX as f32 } else { most };
        in_range(Field::MeanRipple, 0, word_at(self.words, word::RIPPLE_UNIT) as f32, 0.0, most)?;
        self.check_nodes(layout, &mut bounds)?;
        self.check_records(layout, &mut bounds)?;
        bounds.error_rad += bounds.periodic_rad;
        let ratio = self.drive.ratio();
        let curves = [(Field::GeneratorCurve, ratio), (Field::MaterialCurve, ratio - 1.0), (Field::OutputCurve, 1.0)];
        for (((field, periods), at), nodes) in curves.into_iter().zip(layout.curves).zip(curve_nodes) {
            self.add_curve(&mut bounds, field, at, nodes, periods)?;
        }
        let limit = self.error_limit_rad();
        if bounds.error_rad.is_nan() || bounds.error_rad > limit {
            return Err(ImageError::ErrorBound { found_rad: bounds.error_rad, allowed_rad: limit });
        }
        if bounds.slope.is_nan() || bounds.slope >= 1.0 {
            return Err(ImageError::Slope { found: bounds.slope });
        }
        Ok(bounds)
    }

    /// Adds what a curve of A, B, C can give; `periods` of it in one output turn.
    fn add_curve(
        &self,
        bounds: &mut Bounds,
        field: Field,
        at: usize,
        nodes: usize,
        periods: f32,
    ) -> Result<(), ImageError> {
        let axis = PeriodicAxis::new(nodes).unwrap_or_default();
        let value = |i: usize| rad(word_at(self.words, at.saturating_add(i)) as i32 as f32 * 0.5);
        for index in 0..axis.stored_len() {
            in_range(field, index, value(index), -MAX_ERROR_RAD, MAX_ERROR_RAD)?;
        }
        check_closed(field, axis, self.words.get(at..).unwrap_or_default())?;
        let [largest, steepest, _] = extremes(axis.stored_len(), value);
        let slope = steepest * nodes as f32 * periods.abs() / TAU as f32;
        // Two readings, which may lie on both sides of a step.
        bounds.rounding_rad += 2.0 * WEIGHT_ROUNDING * steepest;
        bounds.error_rad += largest;
        bounds.periodic_rad += largest;
        bounds.slope += slope;
        bounds.curve_slope += slope;
        Ok(())
    }

    /// Where node `index`, over all temperatures, starts.
    fn node_at(&self, layout: &Layout, index: usize) -> usize {
        let step = if self.torque_nodes > 1 { NODE_WORDS } else { NODE_WORDS.saturating_mul(2) };
        layout.nodes.saturating_add(index.saturating_mul(step))
    }

    /// What D and H can give: linear interpolation between temperatures stays within them, a cubic within its Bernstein
    /// coefficients.
    fn check_nodes(&self, layout: &Layout, bounds: &mut Bounds) -> Result<(), ImageError> {
        let jumps = self.torque_jumps();
        let most = num::counts(MAX_ERROR_RAD as f64) as f32;
        // Torque, D, slope of D and H of the node before.
        let mut before: Option<[f32; 4]> = None;
        for index in 0..self.torque_nodes.saturating_mul(self.temperature_nodes) {
            let node = index.checked_rem(self.torque_nodes).unwrap_or(0);
            let at = self.node_at(layout, index);
            let number = |i: usize| f32_at(self.words, at.saturating_add(i));
            let mean = in_range(Field::Mean, index, number(0), -most, most)?;
            let slope = finite(Field::MeanSlope, index, number(1))?;
            let half = in_range(Field::HalfWidth, index, number(2), 0.0, most)?;
            if number(2).to_bits() & 1 != grid::is_jump(jumps, node) as u32 {
                return Err(ImageError::Derived { offset: at.saturating_add(2).saturating_mul(4) });
            }
            if self.torque_nodes == 1 {
                for word in 0..NODE_WORDS {
                    derived_is(self.words, at.saturating_add(NODE_WORDS).saturating_add(word), number(word).to_bits())?;
                }
                // Nowhere to go with it.
                in_range(Field::MeanSlope, index, slope, 0.0, 0.0)?;
            }
            let torque = f32_at(self.words, word::TORQUE_NODES.saturating_add(node));
            bounds.error_rad = larger(bounds.error_rad, rad(mean.abs() + half));
            let below = before.filter(|_| node > 0 && !grid::is_jump(jumps, node.saturating_sub(1)));
            if let Some([torque_below, mean_below, slope_below, half_below]) = below {
                let third = (torque - torque_below) / 3.0;
                let inner = larger((mean_below + slope_below * third).abs(), (mean - slope * third).abs());
                let inner = if inner.is_finite() { inner } else { f32::INFINITY };
                bounds.error_rad = larger(bounds.error_rad, rad(inner + larger(half, half_below)));
            }
            before = Some([torque, mean, slope, half]);
        }
        Ok(())
    }

    /// What R and h can give, and that they leave no negative half-width.
    fn check_records(&self, layout: &Layout, bounds: &mut Bounds) -> Result<(), ImageError> {
        let nodes = self.ripple.len();
        let unit = (word_at(self.words, word::RIPPLE_UNIT) as f64 / UNITS_PER_COUNT) as f32;
        let cells_per_rad = nodes as f32 * self.drive.tooth_periods().abs() / TAU as f32;
        for index in 0..self.torque_nodes.saturating_mul(self.temperature_nodes) {
            let first = layout.records.saturating_add(index.saturating_mul(layout.record));
            let record = self.words.get(first..first.saturating_add(layout.record)).unwrap_or_default();
            let value = |i: usize| half_at(record, i);
            for index in 0..layout.record.saturating_mul(2) {
                let node = self.ripple.stored_node(index.checked_rem(layout.record).unwrap_or(0)).saturating_add(1);
                let first = if index < layout.record { 0 } else { layout.record };
                if value(index) != value(first.saturating_add(node)) {
                    return Err(ImageError::NotClosed { field: Field::MeanRipple, index });
                }
            }
            let ripple = |i: usize| [i, i.saturating_add(layout.record)].map(|i| value(i) as f32 * unit);
            let torque = index.checked_rem(self.torque_nodes).unwrap_or(0);
            let temperature = index.checked_div(self.torque_nodes).unwrap_or(0);
            let half = f32_at(self.words, self.node_at(layout, index).saturating_add(2));
            let least = (0..self.ripple.stored_len()).fold(half, |least, i| {
                let [forward, backward] = ripple(i);
                least.min(half + 0.5 * (backward - forward))
            });
            if least < -(HALF_WIDTH_ROUNDING_COUNTS as f32 + unit) {
                return Err(ImageError::NegativeHalfWidth { temperature, torque, found_rad: rad(least) });
            }
            // Steady motion follows forward or backward.
            for first in [0, layout.record] {
                let way = |i: usize| rad(value(first.saturating_add(i)) as f32 * unit);
                let [largest, steepest, reached] = extremes(self.ripple.stored_len(), way);
                bounds.periodic_rad = larger(bounds.periodic_rad, largest);
                bounds.slope = larger(bounds.slope, steepest * cells_per_rad);
                bounds.ripple_cells = larger(bounds.ripple_cells, reached * cells_per_rad);
                bounds.rounding_rad = larger(bounds.rounding_rad, WEIGHT_ROUNDING * steepest);
            }
        }
        Ok(())
    }

    /// How far the ripple takes the half-width of the play below H at most, counts, rounded up.
    pub(crate) fn play_ripple_counts(&self) -> i32 {
        let layout = Layout::new(self.torque_nodes, self.temperature_nodes, self.ripple.len(), [0; 3]);
        let [_, first] = halves(word_at(self.words, word::CELL_WIDTH.saturating_add(3)));
        let words = layout.record.saturating_mul(self.torque_nodes).saturating_mul(self.temperature_nodes);
        let records = self.words.get(first..first.saturating_add(words)).unwrap_or_default();
        let mut narrowest = 0;
        for record in records.chunks_exact(layout.record.max(1)) {
            for i in 0..record.len() {
                let [forward, backward] = [i, i.saturating_add(record.len())].map(|i| half_at(record, i) as i32);
                let narrower = forward.wrapping_sub(backward);
                narrowest = if narrower > narrowest { narrower } else { narrowest };
            }
        }
        let narrowest = narrowest.unsigned_abs() as u64;
        // Half of it in counts of 2¹⁹ units, rounded up, and two for the rounding of the ripple.
        let counts = narrowest.wrapping_mul(word_at(self.words, word::RIPPLE_UNIT) as u64) >> 20;
        if self.ripple.is_empty() { 0 } else { (counts as i32).saturating_add(3) }
    }

    fn header(&self) -> Header<'a> {
        Header(self.image.first_chunk().unwrap_or(&[0; HEADER_BYTES]))
    }

    /// The table id: printed by tools, matched with devices in the field.
    #[must_use]
    pub fn id(&self) -> TableId {
        TableId(self.header().bytes(ID_OFFSET))
    }

    /// BLAKE3 of the drive description the table was made from.
    #[must_use]
    pub fn drive_hash(&self) -> [u8; 32] {
        self.header().bytes(16)
    }

    /// The largest error the image states it may give, rad.
    #[must_use]
    pub fn error_limit_rad(&self) -> f32 {
        self.header().f32(152)
    }

    /// Program that made the table.
    #[must_use]
    pub fn tool_version(&self) -> &'a str {
        self.header().text(56, Field::ToolVersion).unwrap_or_default()
    }

    /// Mesh or data the samples came from.
    #[must_use]
    pub fn mesh_level(&self) -> &'a str {
        self.header().text(80, Field::MeshLevel).unwrap_or_default()
    }

    /// Relative residual the solver reached; 0 for measured samples.
    #[must_use]
    pub fn solver_residual(&self) -> f32 {
        self.header().f32(124)
    }

    /// Largest deviation of the table from the samples it was made of, rad.
    #[must_use]
    pub fn projection_worst_rad(&self) -> f32 {
        self.header().f32(128)
    }

    /// Root mean square deviation of the table from the samples it was made of, rad.
    #[must_use]
    pub fn projection_rms_rad(&self) -> f32 {
        self.header().f32(132)
    }

    /// The image the table is read from.
    #[must_use]
    pub const fn image(&self) -> &'a [u8] {
        self.image
    }

    /// Number of [`PAGE_BYTES`] pages in the body.
    #[must_use]
    pub const fn page_count(&self) -> usize {
        self.body_bytes.div_ceil(PAGE_BYTES)
    }

    /// The bytes of one page; `None` beyond the last.
    #[must_use]
    pub fn page(&self, page: usize) -> Option<&'a [u8]> {
        page_of(self.image, self.body_bytes, page)
    }

    /// Whether a page still matches its CRC-32; false beyond the last. At most 256 bytes, 1400 instructions.
    #[must_use]
    pub fn is_page_intact(&self, page: usize) -> bool {
        page_intact(self.image, self.body_bytes, page)
    }
}

fn page_of(image: &[u8], body_bytes: usize, page: usize) -> Option<&[u8]> {
    image.get(..body_bytes)?.chunks(PAGE_BYTES).nth(page)
}

pub(crate) fn page_intact(image: &[u8], body_bytes: usize, page: usize) -> bool {
    let sums = image.get(body_bytes..).map_or(&[][..], |sums| sums.as_chunks::<CRC_BYTES>().0);
    match (page_of(image, body_bytes, page), sums.get(page)) {
        (Some(bytes), Some(sum)) => crc32(bytes) == u32::from_le_bytes(*sum),
        _ => false,
    }
}

/// Everything about an image that needs no knowledge of tables.
fn check_envelope(image: &[u8]) -> Result<Header<'_>, ImageError> {
    let needed = image_bytes(1, 1, 0, [0; 3]);
    let found = image.len();
    let too_short = ImageError::TooShort { found, needed };
    let header = Header(image.first_chunk().ok_or(too_short)?);
    if found < needed {
        return Err(too_short);
    }
    if header.bytes(0) != MAGIC {
        return Err(ImageError::Magic);
    }
    // The mark before the version: swapped bytes would make the version look wrong.
    if header.u16(10) != BYTE_ORDER_MARK {
        return Err(ImageError::ByteOrder { found: header.u16(10) });
    }
    if header.u16(8) != FORMAT_VERSION {
        return Err(ImageError::Version { found: header.u16(8), allowed: FORMAT_VERSION });
    }
    let stated = header.u32(12) as usize;
    if stated != found {
        return Err(ImageError::Length { stated, found });
    }
    let (before, sum) = image.split_last_chunk::<CRC_BYTES>().ok_or(too_short)?;
    let (stated, computed) = (u32::from_le_bytes(*sum), crc32(before));
    if stated != computed {
        return Err(ImageError::Crc { stated, computed });
    }
    Ok(header)
}

/// Reserved bytes, texts, and the drive.
fn check_identity(header: Header<'_>) -> Result<Drive, ImageError> {
    let reserved = header.0.get(RESERVED).unwrap_or_default();
    if let Some(at) = reserved.iter().position(|byte| *byte != 0) {
        return Err(ImageError::Reserved { offset: at.saturating_add(RESERVED.start) });
    }
    header.text(56, Field::ToolVersion)?;
    header.text(80, Field::MeshLevel)?;
    let fixed = match header.u8(105) {
        0 => FixedMember::Flexspline,
        1 => FixedMember::CircularSpline,
        found => return Err(ImageError::FixedMember { found }),
    };
    Drive::new(header.u16(106), header.u16(108), fixed).map_err(ImageError::Teeth)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Phases;
    use crate::error::DriveError;
    use crate::fixture;
    use proptest::prelude::*;
    use std::vec;
    use std::vec::Vec;

    /// Where nodes and records of the image of `fixture::image(false)` start, bytes.
    const NODES: usize = 4 * word::CURVES;
    const NODE_BYTES: usize = 4 * NODE_WORDS;
    const RECORDS: usize = NODES + 3 * 11 * NODE_BYTES;
    const RECORD_BYTES: usize = 4 * 20;

    /// A small table with every part; ripple alternates in sign.
    fn data() -> TableData<'static> {
        const RIPPLE: [f32; 32] = {
            let mut ripple = [1.0e-6; 32];
            let mut i = 0;
            while i < 32 {
                ripple[i] = if i % 2 == 0 { 1.0e-6 } else { -0.7e-6 };
                i += 1;
            }
            ripple
        };
        TableData {
            drive: fixture::drive(),
            torque_nodes_n_m: &[-1.0, 1.0],
            temperature_nodes_c: &[0.0, 40.0],
            ripple_nodes: 8,
            mean_rad: &[-1.0e-3, 1.0e-3, -2.0e-3, 2.0e-3],
            half_width_rad: &[1.0e-4, 2.0e-4, 3.0e-4, 4.0e-4],
            mean_ripple_rad: &RIPPLE,
            half_width_ripple_rad: &RIPPLE,
            generator_curve_rad: &[1.0e-5, -1.0e-5, 2.0e-5, 0.0],
            material_curve_rad: &[],
            output_curve_rad: &[1.0e-4, 0.0, -1.0e-4, 0.0, 0.0],
            projection_worst_rad: 2.0e-8,
            projection_rms_rad: 1.0e-8,
        }
    }

    fn provenance() -> Provenance<'static> {
        Provenance { torque_range_n_m: [-1.0, 0.5], temperature_range_c: [0.0, 40.0], ..fixture::provenance() }
    }

    fn write(data: &TableData<'_>, provenance: &Provenance<'_>) -> Result<Vec<u8>, WriteError> {
        let mut out = vec![0xff; 4096];
        let bytes = write_image(data, provenance, &mut out, fixture::id)?;
        out.truncate(bytes);
        Ok(out)
    }

    #[test]
    fn what_is_written_is_read_back() {
        let image = write(&data(), &provenance()).unwrap();
        assert_eq!(image.len(), image_bytes(2, 2, 8, [4, 0, 5]));
        let table = Table::check(&image).unwrap();
        assert_eq!(*table.drive(), fixture::drive());
        assert_eq!(table.generator_kind(), GeneratorKind::Cam);
        assert_eq!(table.drive_hash(), [0x5a; 32]);
        assert_eq!((table.tool_version(), table.mesh_level()), ("flexspline 0.1.0", "closed form"));
        assert_eq!((table.solver_residual(), table.projection_worst_rad()), (1e-9, 2.0e-8));
        assert_eq!(table.projection_rms_rad(), 1.0e-8);
        assert_eq!((table.torque_range_n_m(), table.temperature_range_c()), ([-1.0, 0.5], [0.0, 40.0]));
        assert!(table.torque_nodes_n_m().eq([-1.0, 1.0]) && table.temperature_nodes_c().eq([0.0, 40.0]));
        assert_eq!(table.error_limit_rad(), 0.02);
        assert_eq!(table.ripple_axis().len(), 8);
        // At every node and on both sides what was written, to the quantisation.
        let (unit, count) = (1.7e-6 / 32767.0, 1.5e-9);
        for (temperature_node, temperature) in [0.0, 40.0].into_iter().enumerate() {
            for (torque_node, torque) in [-1.0f32, 0.5].into_iter().enumerate() {
                let point = table.at(torque, temperature).unwrap();
                let share = (torque + 1.0) / 2.0;
                let at = |values: &[f32]| {
                    let first = 2 * temperature_node;
                    values[first] * (1.0 - share) + values[first + 1] * share
                };
                assert!((point.mean_rad() - at(data().mean_rad)).abs() < 2.0 * count, "{torque_node}");
                let half = point.half_width as f32 * RAD_PER_COUNT;
                assert!((half - at(data().half_width_rad)).abs() < 2.0 * count);
                for node in 0..8 {
                    let phase = table.ripple_axis().node_phase(node);
                    let phases = Phases { generator: 0, material: 0, output: 0, tooth: phase };
                    let play = crate::table::play_at(&table, &point, phases, &mut Default::default());
                    let ripple = |values: &[f32]| {
                        let value = |node: usize| {
                            let record = (2 * temperature_node) * 8 + node % 8;
                            values[record] * (1.0 - share) + values[record + 8] * share
                        };
                        0.125 * (value(node + 7) + 6.0 * value(node) + value(node + 1))
                    };
                    // A at ψ = 0 and C at δ = 0.
                    let curves = (-0.0 + 6.0 * 1.0e-5 - 1.0e-5 + 6.0 * 1.0e-4) * 0.125;
                    let centre = at(data().mean_rad) + ripple(data().mean_ripple_rad) + curves;
                    assert!((play.centre as f32 * RAD_PER_COUNT - centre).abs() < 4.0 * count + unit);
                    let half = at(data().half_width_rad) + ripple(data().half_width_ripple_rad);
                    assert!((play.half as f32 * RAD_PER_COUNT - half).abs() < 4.0 * count + unit);
                }
            }
        }
    }

    #[test]
    fn the_id_is_that_of_the_body_with_the_id_zero() {
        let mut image = write(&data(), &provenance()).unwrap();
        let table = Table::check(&image).unwrap();
        let (id, body_bytes) = (table.id(), table.body_bytes);
        image[ID_OFFSET..ID_OFFSET + 8].fill(0);
        assert_eq!(id, TableId(fixture::id(&image[..body_bytes])));
        assert_eq!(std::format!("{}", TableId([0, 1, 2, 0xab, 4, 5, 6, 0xff])), "000102ab040506ff");
    }

    #[test]
    fn quantisation_rounds_to_nearest() {
        assert_eq!([0.49, 0.51, -0.49, -0.51, 32767.0].map(quantise), [0, 1, 0, -1, 32767]);
        assert_eq!(quantise(f64::NAN), 0);
    }

    #[test]
    fn a_half_width_that_touches_zero_stays_writable() {
        for i in 0..500u32 {
            // Rounding of the lowest ripple goes up for some and down for others.
            let lowest = 1.0e-9 * (1.0 + 0.618_034 * i as f32);
            let mut ripple = data().half_width_ripple_rad.to_vec();
            ripple[3] = -lowest;
            ripple.iter_mut().filter(|h| **h < -lowest).for_each(|h| *h = -lowest);
            let touching = TableData { half_width_rad: &[lowest; 4], half_width_ripple_rad: &ripple, ..data() };
            let written = write(&touching, &provenance());
            assert!(written.is_ok(), "{lowest}: {written:?}");
        }
    }

    #[test]
    fn the_stated_sizes_hold() {
        assert_eq!(image_bytes(25, 3, 8, [32; 3]), 5556);
        assert_eq!(image_bytes(60, 2, 8, [0; 3]), 7872);
        assert_eq!(fixture::image(false).len(), fixture::plan(false).image_bytes());
    }

    #[test]
    fn pages_cover_the_body_and_find_their_damage() {
        let mut image = fixture::image(false);
        let table = Table::check(&image).unwrap();
        let (pages, body_bytes) = (table.page_count(), table.body_bytes);
        assert_eq!((0..pages).map(|page| table.page(page).unwrap().len()).sum::<usize>(), body_bytes);
        assert!((0..pages).all(|page| table.is_page_intact(page)));
        assert!(!table.is_page_intact(pages) && table.page(pages).is_none());
        image[2 * PAGE_BYTES] ^= 1;
        assert!(page_intact(&image, body_bytes, 1) && !page_intact(&image, body_bytes, 2));
    }

    #[test]
    fn unaligned_images_are_read() {
        let image = fixture::image(false);
        for shift in 0..4 {
            let mut shifted = vec![0; shift];
            shifted.extend_from_slice(&image);
            assert!(Table::check(&shifted[shift..]).is_ok());
        }
    }

    #[test]
    fn no_single_bit_may_flip() {
        let mut image = write(&data(), &provenance()).unwrap();
        for bit in 0..image.len() * 8 {
            image[bit / 8] ^= 1 << (bit % 8);
            assert!(Table::check(&image).is_err(), "bit {bit}");
            image[bit / 8] ^= 1 << (bit % 8);
        }
        assert!(Table::check(&image).is_ok());
    }

    /// The error after `damage`, with every checksum made right again: what a broken or hostile writer would send.
    fn resealed(damage: impl FnOnce(&mut Vec<u8>)) -> ImageError {
        let mut image = fixture::image(false);
        let body_bytes = Table::check(&image).unwrap().body_bytes;
        damage(&mut image);
        seal(&mut image, body_bytes);
        Table::check(&image).expect_err("accepted")
    }

    fn put(offset: usize, value: f32) -> impl FnOnce(&mut Vec<u8>) {
        move |image| image[offset..offset + 4].copy_from_slice(&value.to_le_bytes())
    }

    #[test]
    fn each_damage_of_the_envelope_has_its_own_error() {
        let image = fixture::image(false);
        let damaged = |damage: fn(&mut Vec<u8>)| {
            let mut image = image.clone();
            damage(&mut image);
            Table::check(&image).unwrap_err()
        };
        let short = damaged(|image| image.truncate(100));
        assert_eq!(short, ImageError::TooShort { found: 100, needed: image_bytes(1, 1, 0, [0; 3]) });
        assert_eq!(Table::check(&[]).unwrap_err(), ImageError::TooShort { found: 0, needed: 584 });
        assert_eq!(damaged(|image| image[0] = 0), ImageError::Magic);
        // What a text-mode transfer does.
        assert_eq!(damaged(|image| _ = image.remove(4)), ImageError::Magic);
        assert_eq!(damaged(|image| image[8] = 2), ImageError::Version { found: 2, allowed: 3 });
        assert_eq!(damaged(|image| image.swap(10, 11)), ImageError::ByteOrder { found: 0xfffe });
        let full = image.len();
        assert_eq!(damaged(|image| _ = image.pop()), ImageError::Length { stated: full, found: full - 1 });
        assert_eq!(damaged(|image| image.push(0)), ImageError::Length { stated: full, found: full + 1 });
        assert!(matches!(damaged(|image| image[300] ^= 4), ImageError::Crc { .. }));
        assert!(matches!(damaged(|image| image[16] ^= 4), ImageError::Crc { .. }));
        let one_page = damaged(|image| {
            image[3 * PAGE_BYTES] ^= 4;
            let (before, last) = image.split_last_chunk_mut::<4>().unwrap();
            *last = crc32(before).to_le_bytes();
        });
        assert_eq!(one_page, ImageError::PageCrc { page: 3 });
    }

    #[test]
    fn each_damage_of_the_header_has_its_own_error() {
        assert_eq!(resealed(|image| image[230] = 1), ImageError::Reserved { offset: 230 });
        assert_eq!(resealed(|image| image[57] = 7), ImageError::Text { field: Field::ToolVersion });
        assert_eq!(resealed(|image| image[102] = b'x'), ImageError::Text { field: Field::MeshLevel });
        assert_eq!(resealed(|image| image[104] = 5), ImageError::GeneratorKind { found: 5 });
        assert_eq!(resealed(|image| image[105] = 2), ImageError::FixedMember { found: 2 });
        let teeth = DriveError { flexspline_teeth: 190, circular_spline_teeth: 190 };
        assert_eq!(resealed(|image| image[106] = 190), ImageError::Teeth(teeth));
        for (offset, found, field, least, most) in [
            (110, 0, Field::TorqueNodes, 1, 64),
            (110, 65, Field::TorqueNodes, 1, 64),
            (111, 9, Field::TemperatureNodes, 1, 8),
            (112, 3, Field::RippleNodes, 4, 32),
            (112, 33, Field::RippleNodes, 4, 32),
            (113, 3, Field::GeneratorCurve, 4, 128),
            (114, 255, Field::MaterialCurve, 4, 128),
            (115, 129, Field::OutputCurve, 4, 128),
        ] {
            let error = resealed(|image| image[offset] = found);
            assert_eq!(error, ImageError::Count { field, found: found as usize, least, most });
        }
        assert!(matches!(resealed(|image| image[110] = 12), ImageError::Size { .. }));
        let outside = |offset, value, field| {
            let error = resealed(put(offset, value));
            assert!(matches!(error, ImageError::OutOfRange { field: named, .. } if named == field), "{error}");
        };
        outside(124, -1.0, Field::SolverResidual);
        outside(128, 0.06, Field::ProjectionWorst);
        outside(132, 0.01, Field::ProjectionRms);
        outside(136, -50.1, Field::TorqueRange);
        outside(140, -50.1, Field::TorqueRange);
        outside(148, 80.1, Field::TemperatureRange);
        // What follows from other numbers must do so: unit of the ripple aside, each of these words.
        for at in [120, 156, 160, 164, 166, 168, 170, 172, 174, 176, 180, 184, 188, 192, 196] {
            let error = resealed(|image| image[at] ^= 1);
            assert_eq!(error, ImageError::Derived { offset: at / 4 * 4 });
        }
        outside(152, 0.0, Field::ErrorLimit);
        outside(152, 0.051, Field::ErrorLimit);
        for (offset, field, index) in [
            (124, Field::SolverResidual, 0),
            (132, Field::ProjectionRms, 0),
            (140, Field::TorqueRange, 1),
            (144, Field::TemperatureRange, 0),
            (152, Field::ErrorLimit, 0),
        ] {
            assert_eq!(resealed(put(offset, f32::NAN)), ImageError::NotFinite { field, index });
        }
    }

    #[test]
    fn each_damage_of_the_numbers_has_its_own_error() {
        let node = |i: usize| HEADER_BYTES + 4 * i;
        let infinite = ImageError::NotFinite { field: Field::TorqueNodes, index: 10 };
        assert_eq!(resealed(put(node(10), f32::INFINITY)), infinite);
        // Equal nodes are no jump: they have no interval to interpolate in.
        let equal = ImageError::NotIncreasing { field: Field::TorqueNodes, index: 4 };
        assert_eq!(resealed(put(node(4), -1.51)), equal);
        let falling = ImageError::NotIncreasing { field: Field::TemperatureNodes, index: 2 };
        assert_eq!(resealed(put(node(66), 19.0)), falling);
        assert_eq!(resealed(put(node(11), 99.0)), ImageError::Derived { offset: node(11) });
        let at_node = |i: usize| NODES + NODE_BYTES * i;
        let error = resealed(put(at_node(5), f32::NEG_INFINITY));
        assert_eq!(error, ImageError::NotFinite { field: Field::Mean, index: 5 });
        for (place, field) in [(4, Field::MeanSlope), (8, Field::HalfWidth)] {
            for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                let error = resealed(put(at_node(12) + place, value));
                assert_eq!(error, ImageError::NotFinite { field, index: 12 });
            }
        }
        // At the end of the axis, in the middle, and a slope that overflows: 30 N·m on, a third of it is too much.
        for (index, slope) in [(0, 2.0e6), (9, 2.0e6), (10, -2.0e6), (4, f32::MAX), (32, -f32::MAX)] {
            let error = resealed(put(at_node(index) + 4, slope));
            assert!(matches!(error, ImageError::ErrorBound { allowed_rad: 0.02, .. }), "{index}: {error}");
        }
        let error = resealed(put(at_node(20), 3.0e7));
        assert!(matches!(error, ImageError::ErrorBound { allowed_rad: 0.02, .. }), "{error}");
        let error = resealed(put(at_node(7) + 8, -1.0));
        assert!(matches!(error, ImageError::OutOfRange { field: Field::HalfWidth, .. }), "{error}");
        // The mark of a jump is where the nodes put it.
        let error = resealed(|image| image[at_node(7) + 8] ^= 1);
        assert_eq!(error, ImageError::Derived { offset: at_node(7) + 8 });
        let record = |i: usize| RECORDS + RECORD_BYTES * i;
        // Half-width below its own ripple, at temperature 1 and torque 2.
        let error = resealed(put(at_node(13) + 8, 30.0));
        assert!(matches!(error, ImageError::NegativeHalfWidth { temperature: 1, torque: 2, .. }), "{error}");
        // The repeated nodes at either end of a record.
        for index in [0, 17, 18, 19, 20, 39] {
            let offset = record(3) + 2 * index;
            let error = resealed(|image| image[offset] ^= 1);
            assert_eq!(error, ImageError::NotClosed { field: Field::MeanRipple, index });
        }
        // Ripple sixty times as large, where the half-width allows it: the same at every node of the last record.
        let error = resealed(|image| {
            let unit = u32::from_le_bytes(*image[116..].first_chunk().unwrap());
            image[116..120].copy_from_slice(&(unit * 60).to_le_bytes());
            for record in image[RECORDS..RECORDS + 33 * RECORD_BYTES].chunks_exact_mut(RECORD_BYTES) {
                // The half-width ripple goes.
                record.copy_within(0..RECORD_BYTES / 2, RECORD_BYTES / 2);
            }
        });
        assert!(matches!(error, ImageError::Slope { found } if found > 1.0 && found < 20.0), "{error}");
    }

    #[test]
    fn the_bounds_hold_and_are_close() {
        let image = fixture::image(true);
        let bounds = Table::check(&image).unwrap().bounds();
        let (mut steepest, mut largest): (f64, f64) = (0.0, 0.0);
        for i in 0..100_000 {
            let generator = 596.9 * (i as f64 * 0.618_033_988).rem_euclid(1.0);
            for direction in [crate::Direction::Forward, crate::Direction::Backward] {
                let error = |generator| fixture::error(generator, 50.0, 80.0, direction, true);
                let slope = (error(generator + 1e-6) - error(generator - 1e-6)) / 2e-6 * 95.0;
                steepest = steepest.max(slope.abs());
                largest = largest.max(error(generator).abs());
            }
        }
        let (slope, error) = (bounds.slope as f64, bounds.error_rad as f64);
        assert!(steepest < slope && slope < 1.3 * steepest, "{steepest} {slope}");
        assert!(largest < error && error < 1.1 * largest, "{largest} {error}");
    }

    #[test]
    fn a_limit_as_small_as_what_the_table_gives_disables_nothing() {
        let data = TableData {
            mean_rad: &[0.0; 4],
            half_width_rad: &[0.0; 4],
            mean_ripple_rad: &[2.0e-8; 32],
            half_width_ripple_rad: &[0.0; 32],
            generator_curve_rad: &[2.0e-8, -1.0e-8, 1.5e-8, 0.0],
            output_curve_rad: &[3.0e-8, 0.0, -3.0e-8, 0.0, 0.0],
            ..data()
        };
        let wide = write(&data, &provenance()).unwrap();
        let reached = Table::check(&wide).unwrap().bounds().error_rad;
        let tight = write(&data, &Provenance { error_limit_rad: reached, ..provenance() }).unwrap();
        let table = Table::check(&tight).unwrap();
        for i in 0..2000 {
            let target = crate::OutputAngle::from_counts(i * 8_589_934);
            for direction in [crate::Direction::Forward, crate::Direction::Backward] {
                let command = table.inverse(target, 0.5, 20.0, crate::Approach::Moving(direction));
                assert_eq!(command.quality, crate::Quality::InRange, "{i}");
                assert!(table.steady_error_rad(command.generator, 0.5, 20.0, direction).is_some(), "{i}");
            }
        }
    }

    #[test]
    fn an_axis_of_one_node_holds_where_its_maker_says() {
        let mut data = data();
        data.temperature_nodes_c = &[20.0];
        data.mean_rad = &data.mean_rad[..2];
        data.half_width_rad = &data.half_width_rad[..2];
        data.mean_ripple_rad = &data.mean_ripple_rad[..16];
        data.half_width_ripple_rad = &data.half_width_ripple_rad[..16];
        assert!(write(&data, &provenance()).is_ok());
    }

    #[test]
    fn short_axes_give_flat_tables() {
        // One node alone, and an end of the axis that a jump cuts off.
        for nodes in [&[0.0][..], &[0.0, 2.0, 20.0, 40.0]] {
            let flat = TableData {
                torque_nodes_n_m: nodes,
                temperature_nodes_c: &[20.0],
                ripple_nodes: 0,
                mean_rad: &[1.0e-3; 4][..nodes.len()],
                half_width_rad: &[1.0e-4; 4][..nodes.len()],
                mean_ripple_rad: &[],
                half_width_ripple_rad: &[],
                generator_curve_rad: &[],
                output_curve_rad: &[],
                ..data()
            };
            let image = write(&flat, &Provenance { torque_range_n_m: [0.0; 2], ..provenance() }).unwrap();
            let table = Table::check(&image).unwrap();
            for torque in [-1.0, 0.0, 0.5, 1.9, 2.0, 7.0, 40.0, 50.0] {
                assert!((table.at(torque, 20.0).unwrap().mean_rad() - 1.0e-3).abs() < 2e-9, "{torque}");
            }
        }
    }

    #[test]
    fn the_writer_names_what_does_not_fit() {
        let mut small = [0; 300];
        let needed = image_bytes(2, 2, 8, [4, 0, 5]);
        let found = write_image(&data(), &provenance(), &mut small, fixture::id);
        assert_eq!(found, Err(WriteError::BufferTooSmall { needed, found: 300 }));
        let short = TableData { half_width_rad: &[1e-4; 3], ..data() };
        let expected = WriteError::Shape { field: Field::HalfWidth, found: 3, needed: 4 };
        assert_eq!(write(&short, &provenance()), Err(expected));
        let long = Provenance { mesh_level: "a mesh that takes too many words", ..provenance() };
        let expected = WriteError::TextTooLong { field: Field::MeshLevel, found: 32 };
        assert_eq!(write(&data(), &long), Err(expected));
        let foreign = Provenance { tool_version: "Σ", ..provenance() };
        let expected = WriteError::Refused(ImageError::Text { field: Field::ToolVersion });
        assert_eq!(write(&data(), &foreign), Err(expected));
        let many = TableData {
            torque_nodes_n_m: &[0.0; 65],
            mean_rad: &[0.0; 130],
            half_width_rad: &[0.0; 130],
            mean_ripple_rad: &[],
            half_width_ripple_rad: &[],
            ripple_nodes: 0,
            ..data()
        };
        let expected = ImageError::Count { field: Field::TorqueNodes, found: 65, least: 1, most: 64 };
        assert_eq!(write(&many, &provenance()), Err(WriteError::Refused(expected)));
        let mut ripple = [0.0; 32];
        ripple[9] = f32::NAN;
        let undefined = TableData { mean_ripple_rad: &ripple, ..data() };
        let expected = ImageError::NotFinite { field: Field::MeanRipple, index: 9 };
        assert_eq!(write(&undefined, &provenance()), Err(WriteError::Refused(expected)));
    }

    proptest! {
        #[test]
        fn arbitrary_bytes_neither_panic_nor_pass(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            prop_assert!(Table::check(&bytes).is_err());
        }

        /// Slopes of any size and sign are either refused or leave every torque within the stated bounds.
        #[test]
        fn slopes_never_give_more_than_the_table_states(
            slopes in prop::collection::vec((0usize..33, -1.0f32..1.0, -4i32..8), 1..12),
            torque in -60.0f32..60.0, temperature in -50.0f32..90.0,
        ) {
            let mut image = fixture::image(false);
            let body_bytes = Table::check(&image).unwrap().body_bytes;
            for (record, mantissa, decade) in slopes {
                put(NODES + NODE_BYTES * record + 4, mantissa * 1.0e6 * 10.0f32.powi(-decade))(&mut image);
            }
            let _ = complete(&mut image, body_bytes);
            seal(&mut image, body_bytes);
            if let Ok(table) = Table::check(&image) {
                for torque in [torque, 0.3 * torque, 0.05 * torque] {
                    let found = table.at(torque, temperature).unwrap();
                    let reached = (found.mean.abs() + found.half_width) as f32 * RAD_PER_COUNT;
                    prop_assert!(reached <= 1.0001 * table.bounds().error_rad, "{} at {}", reached, torque);
                }
            }
        }

        /// Past the checksums, any damage is either refused or leaves a table within its stated bounds.
        #[test]
        fn resealed_damage_never_gives_more_than_the_table_states(
            damage in prop::collection::vec((104usize..3000, any::<u8>()), 1..6),
            generator in any::<i64>(), torque in any::<f32>(), temperature in any::<f32>(),
        ) {
            let mut image = write(&data(), &provenance()).unwrap();
            let body_bytes = Table::check(&image).unwrap().body_bytes;
            for (offset, value) in damage {
                image[offset.min(body_bytes - 1)] = value;
            }
            seal(&mut image, body_bytes);
            let _ = complete(&mut image, body_bytes);
            seal(&mut image, body_bytes);
            if let Ok(table) = Table::check(&image) {
                let generator = crate::GeneratorAngle::from_counts(generator);
                let mut state = crate::PlayState::unknown();
                let found = table.forward(&mut state, generator, torque, temperature);
                prop_assert!(found.transmission_error_rad.abs() <= 1.0001 * table.bounds().error_rad);
                prop_assert_eq!(found.quality == crate::Quality::Disabled, !(torque.is_finite() && temperature.is_finite()));
            }
        }
    }
}
