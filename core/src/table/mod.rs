//! The accepted table and what it says at one operating point.
//!
//! Output error `e = actual − nominal` in radians at the output, at torque τ and temperature θ:
//!
//! ```text
//! centre     = D[θ][τ] + R[θ][τ](teeth·ψ) + A(ψ) + B(ψ − δ) + C(δ)
//! half-width = H[θ][τ] + h[θ][τ](teeth·ψ)
//! e          = centre + (p − x),   p = clamp(p, x − half-width, x + half-width),   x = nominal output
//! ```
//!
//! Between torque nodes D is a cubic through the values and slopes of the two around the torque, but straight inside a jump:
//! D and its slope are continuous from one jump, or end of the axis, to the next. H, R, h are linear in torque. All are
//! linear in temperature and constant beyond the range of the table. R, h, A, B, C are periodic quadratic B-splines
//! ([`grid`]).
//!
//! A run fixes the torque axis: with frictionless flanks and a drag torque `Td` at the output, steady motion in direction
//! `d` loads the flanks by `τ − d·Td`, and the error jumps by the backlash where that load changes sign. So the tables
//! have two nearly coincident torque nodes each side of `±Td`. While the torque lies inside such an interval the error is
//! known only up to the height of the jump, and the [`Quality`] says so.
//!
//! # How it is read
//! Everything a step needs is in the words of the image, offsets too, so that two copies of the image can be compared word
//! for word while they are read (`Memory`). The error is in counts of 2⁻³² output turn from there on, in integers but for
//! the cubic and one division: the same bits on every machine.

mod bounds;
pub mod grid;
mod image;
mod model;
pub(crate) mod windup;

pub use bounds::{Bounds, INVERSE_TOLERANCE_RAD, MAX_INVERSE_ERROR_RAD, MAX_INVERSE_ITERATIONS};
#[cfg(any(test, feature = "fuzzing"))]
pub use image::reseal;
pub use image::{
    FORMAT_VERSION, MAX_ERROR_RAD, MAX_RIPPLE_NODES, MAX_TEMPERATURE_NODES, PAGE_BYTES, Provenance, TEXT_BYTES,
    TableData, WriteError, image_bytes, write_image,
};
pub(crate) use image::{MAX_AXIS_VALUE, counted, page_intact, ripple_row};
pub use model::{Approach, Command, Prediction};
pub(crate) use model::{Estimate, Model, departure};

#[cfg(test)]
use crate::angle::RAD_PER_COUNT;
use crate::drive::{Drive, Phases};
use crate::num::{finite, sqrt, within};
use bounds::InverseBound;
use grid::{Cell, PeriodicAxis};

/// How far an answer can be trusted, worst last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Quality {
    /// Inside the range of the table, side of the play known.
    InRange,
    /// The error is known only to within the uncertainty reported: the torque lies inside a jump, or the side of the
    /// play is not known yet.
    Uncertain,
    /// Torque or temperature outside the range the table holds for; the value at its edge is used.
    Extrapolated,
    /// An input was not finite, or the table gave a number it cannot give: no correction is made.
    Disabled,
}

/// Kind of wave generator, for the record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum GeneratorKind {
    /// None of the others, or unknown.
    Other,
    /// Two rollers.
    TwoRoller,
    /// Four rollers.
    FourRoller,
    /// Two eccentric discs.
    DoubleDisc,
    /// A cam with a flexible bearing.
    Cam,
}

impl GeneratorKind {
    /// The code in an image.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::Other => 0,
            Self::TwoRoller => 1,
            Self::FourRoller => 2,
            Self::DoubleDisc => 3,
            Self::Cam => 4,
        }
    }

    /// From the code in an image.
    #[must_use]
    pub const fn from_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Self::Other),
            1 => Some(Self::TwoRoller),
            2 => Some(Self::FourRoller),
            3 => Some(Self::DoubleDisc),
            4 => Some(Self::Cam),
            _ => None,
        }
    }
}

/// First eight bytes of the BLAKE3 hash of a table's contents; prints as 16 hex digits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct TableId(pub [u8; 8]);

impl core::fmt::Display for TableId {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// Little-endian words of an image, read where they lie.
pub(crate) type Words<'a> = &'a [[u8; 4]];

/// Word `index` as a number; 0 beyond the end, which an accepted table never reaches.
pub(crate) fn f32_at(words: Words<'_>, index: usize) -> f32 {
    f32::from_bits(word_at(words, index))
}

/// Word `index`; 0 beyond the end.
pub(crate) fn word_at(words: Words<'_>, index: usize) -> u32 {
    words.get(index).map_or(0, |word| u32::from_le_bytes(*word))
}

/// Where a step finds things in an image, in words; the layout is told in [`image`].
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

/// What two copies of a table disagreed in while they were read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Doubt(pub u32);

impl Doubt {
    /// Whether everything read was beyond doubt.
    #[inline(always)]
    pub const fn none(self) -> bool {
        self.0 == 0
    }
}

/// The words of a table, in one copy or in two that are compared as they are read.
pub(crate) trait Memory {
    /// Records that are blended as they are read: 2, or 4 with two temperatures.
    const ROWS: usize;

    /// Where things are.
    fn plan(&self) -> &Plan;

    /// `N` words from word `at`. What two copies disagree in is added to `doubt`.
    fn words<const N: usize>(&self, at: usize, doubt: &mut Doubt) -> [u32; N];

    /// The same from half word `at`: the first of `2·N` halves is the low one of the first word.
    fn halves<const N: usize>(&self, at: usize, doubt: &mut Doubt) -> [u32; N];
}

/// `N` words from this byte on.
#[inline(always)]
pub(crate) fn words_from<const N: usize>(bytes: &[u8], at: usize) -> [u32; N] {
    let found = bytes.get(at..).and_then(|bytes| bytes.as_chunks::<4>().0.first_chunk::<N>());
    found.map_or([0; N], |words| words.map(u32::from_le_bytes))
}

/// Where the ripple and the curves of a table are, and what else a step needs of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Plan {
    pub ripple_nodes: u32,
    pub ripple_unit: u32,
    /// A sum of ripple units and weights, in 2⁻¹⁴, times this is 2⁻²⁴ cells of the ripple at the output, times 2³²; signed like
    /// the ratio.
    pub ripple_cells: i32,
    /// Nodes and place of A, B, C, 16 bits each.
    pub curves: [u32; 3],
    /// Largest error the table may give, counts.
    pub limit: i32,
    pub iterations: u32,
    /// Targets this close to the output leave the generator where it is, counts.
    pub hold: i32,
    /// Width of a cell of the ripple's axis at the output, counts; signed like the ratio.
    pub cell_width: f32,
    /// How far the ripple takes the half-width below H at most, counts; 0 where it is not needed.
    pub play_ripple: i32,
}

impl Plan {
    /// Iterations of an inverse; whatever the memory that holds the table says, no more than the most allowed.
    #[inline(always)]
    pub const fn iterations(&self) -> u32 {
        let most = MAX_INVERSE_ITERATIONS as u32;
        if self.iterations < most { self.iterations } else { most }
    }

    /// Values of one direction in a record: [`ripple_row`], of a number that is known to be small.
    #[inline(always)]
    const fn row(&self) -> usize {
        (self.ripple_nodes as usize).wrapping_add(5) & !1
    }

    /// 2⁻²⁴ cells in counts.
    #[inline(always)]
    pub fn counts_of(&self, cells: i32) -> i32 {
        (cells as f32 * (self.cell_width * (1.0 / CELL as f32))) as i32
    }

    /// Whether there is a ripple and no A, B, C, and one iteration of the inverse is enough.
    #[inline(always)]
    pub const fn is_simple(&self) -> bool {
        (self.iterations == 1) & (self.ripple_nodes > 0) & !self.has_curves()
    }

    /// Whether there is any of A, B, C.
    #[inline(always)]
    pub const fn has_curves(&self) -> bool {
        let [a, b, c] = self.curves;
        (a | b | c) >> 16 != 0
    }
}

impl Memory for Table<'_> {
    const ROWS: usize = 4;

    #[inline(always)]
    fn plan(&self) -> &Plan {
        &self.plan
    }

    #[inline(always)]
    fn words<const N: usize>(&self, at: usize, _: &mut Doubt) -> [u32; N] {
        self.words
            .get(at..)
            .and_then(|words| words.first_chunk::<N>())
            .map_or([0; N], |words| words.map(u32::from_le_bytes))
    }

    #[inline(always)]
    fn halves<const N: usize>(&self, at: usize, _: &mut Doubt) -> [u32; N] {
        // Of the image: what is read beyond the last record are its checksums.
        words_from(self.image, at.wrapping_mul(2))
    }
}

/// A table that passed every check of its image; borrows the image and reads it in place.
///
/// Made by [`Table::check`], the only way to get one. Immutable: what changes while running is in
/// [`PlayState`](crate::PlayState).
#[derive(Clone, Copy, Debug)]
pub struct Table<'a> {
    pub(crate) image: &'a [u8],
    pub(crate) words: Words<'a>,
    pub(crate) body_bytes: usize,
    pub(crate) drive: Drive,
    pub(crate) generator_kind: GeneratorKind,
    pub(crate) torque_nodes: usize,
    pub(crate) temperature_nodes: usize,
    pub(crate) ripple: PeriodicAxis,
    pub(crate) plan: Plan,
    pub(crate) bounds: Bounds,
    pub(crate) inverse: InverseBound,
}

/// A torque and temperature, located in the table: [`Table::at`]. What forward and inverse of one tick share.
#[derive(Clone, Copy, Debug)]
pub struct OperatingPoint {
    /// Half words: where the record below the torque starts, its torque step and its temperature step.
    rows: [usize; 3],
    /// Their shares in 2⁻³⁰, to 2⁻¹⁴: low torque, high torque; the same at the higher temperature.
    shares: [i32; 4],
    /// D and H there, counts.
    pub(crate) mean: i32,
    pub(crate) half_width: i32,
    /// What of them was added to the table's.
    added: [i32; 2],
    /// Height of the jump the torque lies in, else 0, counts.
    pub(crate) jump: i32,
    /// All inputs are finite.
    pub(crate) finite: bool,
    /// What the store knows of its table is what it was told.
    pub(crate) whole: bool,
    in_range: bool,
    /// What two copies of the table disagreed in while it was read.
    pub(crate) doubt: Doubt,
}

impl OperatingPoint {
    /// The quality here, lowered while the side of the play is not known.
    #[inline(always)]
    pub(crate) const fn quality(&self, sane: bool, known: bool) -> Quality {
        let inside = if known & (self.jump == 0) { Quality::InRange } else { Quality::Uncertain };
        let quality = if self.in_range { inside } else { Quality::Extrapolated };
        if sane { quality } else { Quality::Disabled }
    }

    /// The point with this added to D and H, each within ±2²⁵ counts. H stays where the ripple can take no play below zero, or
    /// where it is.
    #[inline(always)]
    pub(crate) fn adjusted(mut self, plan: &Plan, mean: i32, half_width: i32) -> Self {
        let before = self.half_width;
        let least = if before < plan.play_ripple { before } else { plan.play_ripple };
        let half = before.wrapping_add(half_width);
        let half = if half > least { half } else { least };
        self.mean = self.mean.wrapping_add(mean);
        self.half_width = half;
        self.added = [mean, half.wrapping_sub(before)];
        self
    }

    /// Whether |centre| + |half| is within what an accepted table can give, and what was added to it.
    #[inline(always)]
    pub(crate) const fn allows(&self, plan: &Plan, centre: i32, half: i32) -> bool {
        let [mean, half_width] = self.added;
        let (centre, half) = (centre.wrapping_sub(mean), half.wrapping_sub(half_width));
        // Negative numbers have room for every magnitude.
        let centre = if centre > 0 { centre.wrapping_neg() } else { centre };
        let half = if half > 0 { half.wrapping_neg() } else { half };
        centre.saturating_add(half) >= plan.limit.wrapping_neg()
    }

    /// Whether an error on this side is.
    #[inline(always)]
    pub(crate) const fn allows_error(&self, plan: &Plan, error: i32, backward: bool) -> bool {
        let [mean, half_width] = self.added;
        let mask = (backward as i32).wrapping_neg();
        let added = (half_width ^ !mask).wrapping_sub(!mask).wrapping_add(mean);
        error.wrapping_sub(added).wrapping_add(plan.limit) as u32 <= plan.limit.wrapping_mul(2) as u32
    }

    /// D, rad.
    #[cfg(test)]
    pub(crate) fn mean_rad(&self) -> f32 {
        self.mean as f32 * RAD_PER_COUNT
    }
}

/// Centre and half-width of the play at a generator position, counts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Play {
    pub centre: i32,
    pub half: i32,
    /// Inside what an accepted table can give.
    pub sane: bool,
}

/// `a·b/2³²`, rounded down.
#[inline(always)]
const fn mul_high(a: i32, b: i32) -> i32 {
    ((a as i64).wrapping_mul(b as i64) >> 32) as i32
}

/// `Σ coefficients·weights/2¹⁶`, for weights in 2⁻¹⁵.
#[inline(always)]
const fn weighed([a, b, c]: [i32; 3], [first, second, third]: [i32; 3]) -> i32 {
    mul_high(a, first << 16).wrapping_add(mul_high(b, second << 16)).wrapping_add(mul_high(c, third << 16))
}

/// The high and the low half of a word.
#[inline(always)]
pub(crate) const fn halves(word: u32) -> [usize; 2] {
    [(word >> 16) as usize, (word & 0xffff) as usize]
}

/// D, slope of D and H of a torque node.
pub(crate) type Node = [f32; NODE_WORDS];

/// The torque among nodes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TorquePlace {
    /// Place in the interval, 0 to 1, and the interval's width, N·m.
    pub weight: f32,
    pub width: f32,
    /// Whether the interval is a jump.
    pub jump: bool,
}

impl OperatingPoint {
    /// From the nodes around the torque; `warm` is how far from the lower of two temperatures to the other, 0 to 1.
    #[inline(always)]
    pub(crate) fn new(
        place: TorquePlace,
        [low, high]: [Node; 2],
        warm: f32,
        rows: [usize; 3],
        (finite, in_range): (bool, bool),
        doubt: Doubt,
    ) -> Self {
        let TorquePlace { weight, width, jump } = place;
        let ([mean_low, slope_low, half_low], [mean_high, slope_high, half_high]) = (low, high);
        let (rise, widening) = (mean_high - mean_low, half_high - half_low);
        let bend = windup::bend(weight, width, [rise, slope_low, slope_high]);
        let bend = if jump { 0.0 } else { bend };
        let (t, w) = ((weight * 16_384.0) as i32, (warm * 16_384.0) as i32);
        // A search that was led astray ends in an interval that does not hold the torque.
        let doubt = Doubt(doubt.0 | (t as u32 > 16_384) as u32);
        // In doubt strictly inside a jump.
        let inside = (t.wrapping_sub(1) as u32) < 16_383;
        let height = (rise.abs() + widening.abs()) as i32 & ((jump & inside) as i32).wrapping_neg();
        let both = t.wrapping_mul(w) >> 14;
        let rest = 16_384i32.wrapping_sub(t).wrapping_sub(w).wrapping_add(both);
        Self {
            rows,
            shares: [rest, t.wrapping_sub(both), w.wrapping_sub(both), both].map(|share| share << 16),
            mean: (mean_low + weight * rise + bend) as i32,
            half_width: (half_low + weight * widening) as i32,
            added: [0; 2],
            jump: height,
            finite,
            whole: true,
            in_range,
            doubt,
        }
    }
}

/// Locates a torque (N·m) and temperature (°C). The same work for all values; those that are not finite give the lower end of
/// the range and are marked.
pub(crate) fn locate(table: &Table<'_>, torque_n_m: f32, temperature_c: f32) -> OperatingPoint {
    let mut doubt = Doubt::default();
    let [torque_least, torque_most, least, most] = table.words(word::TORQUE_RANGE, &mut doubt).map(f32::from_bits);
    let torque = within(torque_n_m, [torque_least, torque_most]);
    let [last, nodes, records, steps] = table.words(word::CELL_WIDTH.wrapping_add(1), &mut doubt);
    let [last_temperature, last_torque] = halves(last);
    let [node_plane, nodes] = halves(nodes);
    let [record_plane, records] = halves(records);
    let [_, record_step] = halves(steps);

    let number = |i: usize| f32_at(table.words, i);
    let interval = grid::search_64(|i| number(word::TORQUE_NODES.wrapping_add(i)), torque).min(last_torque);
    let [low, high] = table.words(word::TORQUE_NODES.wrapping_add(interval), &mut doubt).map(f32::from_bits);
    let temperature = within(temperature_c, [least, most]);
    let plane = grid::search_8(|i| number(word::TEMPERATURE_NODES.wrapping_add(i)), temperature).min(last_temperature);
    let [cold, hot] = table.words(word::TEMPERATURE_NODES.wrapping_add(plane), &mut doubt).map(f32::from_bits);
    let warm = (temperature - cold) / (hot - cold);

    let at = nodes.wrapping_add(plane.wrapping_mul(node_plane)).wrapping_add(interval.wrapping_mul(NODE_WORDS));
    let here: [u32; 2 * NODE_WORDS] = table.words(at, &mut doubt);
    let there: [u32; 2 * NODE_WORDS] = table.words(at.wrapping_add(node_plane), &mut doubt);
    let [_, _, flagged, ..] = here;
    let blend = |cold: u32, hot: u32| {
        let (cold, hot) = (f32::from_bits(cold), f32::from_bits(hot));
        cold + warm * (hot - cold)
    };
    let [c0, c1, c2, c3, c4, c5] = here;
    let [h0, h1, h2, h3, h4, h5] = there;
    let around = [[blend(c0, h0), blend(c1, h1), blend(c2, h2)], [blend(c3, h3), blend(c4, h4), blend(c5, h5)]];
    let width = high - low;
    // 0 in the endless width that an axis of one node has. The last bit of H tells whether the interval above is a jump.
    let place = TorquePlace { weight: (torque - low) / width, width, jump: flagged & 1 != 0 };
    let first_record =
        records.wrapping_add(plane.wrapping_mul(record_plane)).wrapping_add(interval.wrapping_mul(record_step));
    let marks = (finite(torque_n_m) & finite(temperature_c), (torque == torque_n_m) & (temperature == temperature_c));
    let rows = [first_record, record_step, record_plane].map(|words: usize| words.wrapping_mul(2));
    OperatingPoint::new(place, around, warm, rows, marks, doubt)
}

/// Where the records around a torque start, half words, and their shares in 2⁻³⁰.
#[inline(always)]
fn rows(point: &OperatingPoint) -> impl Iterator<Item = (usize, i32)> {
    let [first, torque_step, plane_step] = point.rows;
    let hot = first.wrapping_add(plane_step);
    [first, first.wrapping_add(torque_step), hot, hot.wrapping_add(torque_step)].into_iter().zip(point.shares)
}

#[inline(always)]
const fn low(word: u32) -> i32 {
    word as i16 as i32
}

#[inline(always)]
const fn high(word: u32) -> i32 {
    word as i32 >> 16
}

/// A + B + C at these phases, counts.
#[inline(never)]
pub(crate) fn curves_at<M: Memory>(memory: &M, phases: Phases, doubt: &mut Doubt) -> i32 {
    let mut sum = 0i32;
    for (curve, phase) in memory.plan().curves.into_iter().zip([phases.generator, phases.material, phases.output]) {
        let [nodes, at] = halves(curve);
        // The same way for every call with this table: it has the curve or not.
        if nodes > 0 {
            let cell = Cell::at(nodes as u32, phase);
            let coefficients = memory.words(at.wrapping_add(cell.node), doubt).map(|word| word as i32);
            // Coefficients in half counts make up for the weights in half units.
            sum = sum.wrapping_add(weighed(coefficients, cell.weights_q15()));
        }
    }
    sum
}

/// The ripple of forward and of backward motion at this phase of the tooth pitch, counts.
#[inline(always)]
fn ripple_at<M: Memory>(memory: &M, point: &OperatingPoint, tooth: u32, doubt: &mut Doubt) -> (i32, i32) {
    let plan = memory.plan();
    let cell = Cell::at(plan.ripple_nodes, tooth);
    let [before, at, after] = cell.weights_q15().map(|weight| weight as i16 as i32);
    let backward_row = plan.row();
    let (mut forward, mut backward) = (0i32, 0i32);
    for (row, share) in rows(point).take(M::ROWS) {
        let first = row.wrapping_add(cell.node);
        for (sum, place) in [(&mut forward, first), (&mut backward, first.wrapping_add(backward_row))] {
            let [a, b] = memory.halves(place, doubt);
            // |Σ| ≤ 2¹⁵·2¹⁵: the weights add up to 2¹⁵; 2¹³ of it to a unit.
            let own = low(a).wrapping_mul(before).wrapping_add(high(a).wrapping_mul(at));
            let own = own.wrapping_add(low(b).wrapping_mul(after));
            *sum = sum.wrapping_add(mul_high(own, share));
        }
    }
    (mul_high(forward, plan.ripple_unit as i32), mul_high(backward, plan.ripple_unit as i32))
}

/// Centre and half-width of the play at a located point and these phases. The same work for all phases.
#[inline(always)]
pub(crate) fn play_at<M: Memory>(memory: &M, point: &OperatingPoint, phases: Phases, doubt: &mut Doubt) -> Play {
    let plan = memory.plan();
    let (mut centre, mut half) = (point.mean, point.half_width);
    if plan.ripple_nodes > 0 {
        let (forward, backward) = ripple_at(memory, point, phases.tooth, doubt);
        centre = centre.wrapping_add(forward.wrapping_add(backward) >> 1);
        half = half.wrapping_add(backward.wrapping_sub(forward) >> 1);
    }
    if plan.has_curves() {
        centre = centre.wrapping_add(curves_at(memory, phases, doubt));
    }
    // Not negative but for rounding: the image check bounds it.
    let half = if half < 0 { 0 } else { half };
    Play { centre, half, sane: point.allows(plan, centre, half) }
}

/// 2⁻²⁴ cells in one.
pub(crate) const CELL: i32 = 1 << 24;

/// How far from a place the solution of `x + ripple(x) = place` is, 2⁻²⁴ cells. The same work for all places.
///
/// `tooth` is the phase at a guess that is `ahead` of the place, 2⁻²⁴ cells. Within a cell of the guess the answer is exact: in the
/// cell around the node next to the guess, or that before or after it, whichever has the solution between its ends, it is the root
/// of a parabola. `x + ripple` grows steadily, so what is further away is at least the end of these that is given.
#[inline(always)]
pub(crate) fn to_solution<M: Memory>(
    memory: &M,
    point: &OperatingPoint,
    (tooth, ahead): (u32, i32),
    backward: bool,
    doubt: &mut Doubt,
) -> i32 {
    let plan = memory.plan();
    let cell = Cell::at(plan.ripple_nodes, tooth);
    let node = if cell.node == 0 { plan.ripple_nodes as usize } else { cell.node };
    let row_of_side = plan.row() & (backward as usize).wrapping_neg();
    // Two nodes before and two after, which a stored ripple has for all but the first.
    let first = node.wrapping_sub(1).wrapping_add(row_of_side);
    let mut sums = [0i32; 5];
    for (row, share) in rows(point).take(M::ROWS) {
        let [a, b, c] = memory.halves(row.wrapping_add(first), doubt);
        for (sum, ripple) in sums.iter_mut().zip([low(a), high(a), low(b), high(b), low(c)]) {
            *sum = sum.wrapping_add(ripple.wrapping_mul(share >> 16));
        }
    }
    let cells = sums.map(|sum| mul_high(sum, plan.ripple_cells));
    let [_, b, c, d, _] = cells;
    // All from here on in 2⁻²⁴ cells from the node: the place, and what is missing at either end of the cell.
    let place = ((cell.fraction ^ 0x8000_0000) as i32 >> 8).wrapping_sub(ahead);
    let missing = |a: i32, b: i32| (a.wrapping_add(b) >> 1).wrapping_sub(place);
    // 0 the cell before, 1 that of the node, 2 the one after. An index, not choices: the compiler makes branches of choices.
    let which = (missing(b, c) <= CELL / 2) as usize;
    let which = which.wrapping_add((missing(c, d) <= -CELL / 2) as usize);
    let [a, b, c] = cells.get(which..).and_then(|cells| cells.first_chunk::<3>()).copied().unwrap_or([0; 3]);
    let start = (which as i32).wrapping_mul(CELL).wrapping_sub(CELL / 2 * 3);
    let start = start.wrapping_sub(place);
    // missing + t·linear + t²·bend/2 = 0 from the start of the cell on.
    let linear = CELL.wrapping_add(b.wrapping_sub(a)) as f32;
    let bend = a.wrapping_sub(b).wrapping_add(c.wrapping_sub(b)) as f32;
    let missing = (a.wrapping_add(b) >> 1).wrapping_add(start) as f32;
    let twice = missing + missing;
    let root = twice / (linear + sqrt(linear * linear - bend * twice));
    let along = (root * -(CELL as f32)) as i32;
    let along = if along > 0 { along } else { 0 };
    let along = if along < CELL { along } else { CELL };
    start.wrapping_add(along)
}

impl<'a> Table<'a> {
    /// The drive the table is for.
    #[must_use]
    pub const fn drive(&self) -> &Drive {
        &self.drive
    }

    /// Kind of wave generator the table is for.
    #[must_use]
    pub const fn generator_kind(&self) -> GeneratorKind {
        self.generator_kind
    }

    /// Torques the table holds for, N·m, both ends included.
    #[must_use]
    pub fn torque_range_n_m(&self) -> [f32; 2] {
        [0, 1].map(|end: usize| f32_at(self.words, word::TORQUE_RANGE.wrapping_add(end)))
    }

    /// Temperatures the table holds for, °C, both ends included.
    #[must_use]
    pub fn temperature_range_c(&self) -> [f32; 2] {
        [0, 1].map(|end: usize| f32_at(self.words, word::TEMPERATURE_RANGE.wrapping_add(end)))
    }

    /// From the words of an image.
    pub(crate) fn plan_in(words: Words<'a>) -> Plan {
        let at = |place: usize| word_at(words, place);
        let first = word::CELL_WIDTH;
        let (unit, width) = (at(word::RIPPLE_UNIT), f32_at(words, first));
        Plan {
            ripple_nodes: at(first.wrapping_add(4)) >> 16,
            ripple_unit: unit,
            ripple_cells: (unit as f32 * (8_388_608.0 / width)) as i32,
            curves: [5, 6, 7].map(|place: usize| at(first.wrapping_add(place))),
            limit: at(word::RIPPLE_UNIT.wrapping_add(1)) as i32,
            iterations: at(first.wrapping_add(8)),
            hold: at(first.wrapping_add(9)) as i32,
            cell_width: width,
            play_ripple: 0,
        }
    }

    /// Torque nodes, N·m.
    pub fn torque_nodes_n_m(&self) -> impl ExactSizeIterator<Item = f32> + use<'a> {
        let words = self.words;
        (0..self.torque_nodes).map(move |node| f32_at(words, word::TORQUE_NODES.wrapping_add(node)))
    }

    /// Temperature nodes, °C.
    pub fn temperature_nodes_c(&self) -> impl ExactSizeIterator<Item = f32> + use<'a> {
        let words = self.words;
        (0..self.temperature_nodes).map(move |node| f32_at(words, word::TEMPERATURE_NODES.wrapping_add(node)))
    }

    /// Which intervals between torque nodes are jumps; bit *i* is the one above node *i*.
    pub(crate) fn torque_jumps(&self) -> u64 {
        grid::jump_intervals(self.torque_nodes, |i| f32_at(self.words, word::TORQUE_NODES.wrapping_add(i)))
    }

    /// Whether the interval above torque node `node` is a jump.
    #[must_use]
    pub fn is_torque_jump(&self, node: usize) -> bool {
        grid::is_jump(self.torque_jumps(), node)
    }

    /// Axis of the ripple over one tooth pitch.
    #[must_use]
    pub const fn ripple_axis(&self) -> PeriodicAxis {
        self.ripple
    }

    /// Bounds computed from the coefficients when the table was accepted.
    #[must_use]
    pub const fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Locates a torque (N·m) and temperature (°C); `None` if either is not finite.
    #[must_use]
    pub fn at(&self, torque_n_m: f32, temperature_c: f32) -> Option<OperatingPoint> {
        Some(locate(self, torque_n_m, temperature_c)).filter(|point| point.finite)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::FixedMember;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// A record of one ripple for both torques.
    struct Record {
        halves: Vec<i16>,
        plan: Plan,
    }

    impl Memory for Record {
        const ROWS: usize = 2;

        fn plan(&self) -> &Plan {
            &self.plan
        }

        fn words<const N: usize>(&self, _: usize, _: &mut Doubt) -> [u32; N] {
            [0; N]
        }

        fn halves<const N: usize>(&self, at: usize, _: &mut Doubt) -> [u32; N] {
            let half = |i: usize| self.halves.get(at + i).map_or(0, |half| *half as u16 as u32);
            core::array::from_fn(|i| half(2 * i) | half(2 * i + 1) << 16)
        }
    }

    /// The ripple in cells at a place in cells.
    fn ripple(cells: &[f64], place: f64) -> f64 {
        let node = (place + 0.5).floor();
        let (t, n) = (place + 0.5 - node, cells.len() as f64);
        let at = |i: f64| cells[i.rem_euclid(n) as usize];
        let (a, b, c) = (at(node - 1.0), at(node), at(node + 1.0));
        0.5 * a * (1.0 - t) * (1.0 - t) + b * (0.5 + t * (1.0 - t)) + 0.5 * c * t * t
    }

    proptest! {
        /// Within a cell of the guess the root is exact; what is further away is approached by a cell at least.
        #[test]
        fn a_solution_is_found_in_the_cells_around_a_guess(
            steps in prop::collection::vec(-0.95f64..0.95, 4..=32), size in 0.01f64..1.0,
            place in 0.0f64..1.0, off in -3.0f64..3.0, reversed: bool, weight in 0.0f32..1.0,
        ) {
            // Coefficients whose steps are below a cell, so that place + ripple grows.
            let n = steps.len();
            let mean = steps.iter().sum::<f64>() / n as f64;
            let mut cells: Vec<f64> = Vec::new();
            let mut sum = 0.0;
            for step in &steps {
                sum += (step - mean) * size / (1.0 + mean.abs());
                cells.push(sum);
            }
            let largest = cells.iter().fold(1e-3, |most: f64, c| most.max(c.abs()));
            prop_assume!(largest < 15.0);
            let fixed = if reversed { FixedMember::CircularSpline } else { FixedMember::Flexspline };
            let width = Drive::new(188, 190, fixed).unwrap().tooth_periods().recip() / n as f32 * 4_294_967_296.0;
            // Units that the largest coefficient has 32767 of, signed like the ratio.
            let unit = (largest * width.abs() as f64 * 524_288.0 / 32_766.0) as u32;
            let row = ripple_row(n);
            let half = |position: usize| {
                let cell = cells[(position + n - 1) % n] * width.signum() as f64;
                (cell * width.abs() as f64 * 524_288.0 / unit as f64).round() as i16
            };
            let mut halves = std::vec![0x7abc; row];
            halves.extend((0..row).map(half));
            let plan = Plan {
                ripple_nodes: n as u32,
                ripple_cells: (unit as f64 * 8_388_608.0 / width as f64) as i32,
                cell_width: width,
                ..Plan::default()
            };
            let record = Record { halves, plan };
            let place_of = TorquePlace { weight, width: 1.0, jump: false };
            let point = OperatingPoint::new(place_of, [[0.0; 3]; 2], 0.0, [0; 3], (true, true), Doubt(0));

            // Where x + ripple(x) = place: by bisection.
            let place = place * n as f64;
            let (mut low, mut high) = (place - 2.0 * largest - 1.0, place + 2.0 * largest + 1.0);
            for _ in 0..60 {
                let x = 0.5 * (low + high);
                if x + ripple(&cells, x) > place { high = x } else { low = x }
            }
            let guess = low + off;
            let phase = ((guess / n as f64).rem_euclid(1.0) * 4_294_967_296.0) as u32;
            let ahead = ((guess - place) * CELL as f64) as i32;
            let found = to_solution(&record, &point, (phase, ahead), true, &mut Doubt(0)) as f64 / CELL as f64 + place;
            if off.abs() < 0.999 {
                // Rounding of coefficients, seen through the slope of x + ripple.
                let step = |i: usize| (cells[(i + 1) % n] - cells[i]).abs();
                let slope = 1.0 - (0..n).fold(0.0, |most: f64, i| most.max(step(i)));
                let allowed = (largest / 16_000.0 + 2e-6) / slope + 1e-6;
                prop_assert!((found - low).abs() < allowed, "{} {} of {}, {}", found, low, place, allowed);
            } else {
                prop_assert!((found - low).abs() < off.abs() - 0.95 && (found - low) * off >= -1e-2, "{} {}", found - low, off);
            }
        }
    }
}
