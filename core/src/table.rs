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
//! ([`crate::grid`]).
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

#[cfg(test)]
use crate::angle::RAD_PER_COUNT;
use crate::drive::{Drive, Phases};
use crate::grid::{self, Cell, PeriodicAxis};
use crate::windup;

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

/// The larger of two numbers; the second if the first is NaN. (`f32::max` is a library call on a Cortex-M4F.)
pub(crate) fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Where a step finds things in an image, in words; the layout is told in [`crate::image`].
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

    /// `N` words from word `at`. What two copies disagree in is added to `doubt`.
    fn words<const N: usize>(&self, at: usize, doubt: &mut Doubt) -> [u32; N];
}

/// Where the ripple and the curves of a table are, and what else a step needs of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Plan {
    pub ripple_nodes: u32,
    pub ripple_unit: u32,
    /// Nodes and place of A, B, C, 16 bits each.
    pub curves: [u32; 3],
    /// Largest error the table may give, counts.
    pub limit: i32,
    pub iterations: u32,
    /// Targets this close to the output leave the generator where it is, counts.
    pub hold: i32,
    /// Width of a cell of the ripple's axis at the output, counts; signed like the ratio.
    pub cell_width: f32,
}

impl Memory for Table<'_> {
    const ROWS: usize = 4;

    #[inline(always)]
    fn words<const N: usize>(&self, at: usize, _: &mut Doubt) -> [u32; N] {
        self.words
            .get(at..)
            .and_then(|words| words.first_chunk::<N>())
            .map_or([0; N], |words| words.map(u32::from_le_bytes))
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
    pub(crate) bounds: Bounds,
    pub(crate) inverse: InverseBound,
}

/// What a table can give at most, from its coefficients.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bounds {
    /// Largest |e|, rad.
    pub error_rad: f32,
    /// Largest deviation of `centre ± half-width` from `D ± H`: the periodic parts together, rad.
    pub periodic_rad: f32,
    /// Largest |ratio·de/dψ| in steady motion: how much the output departs from following the generator.
    pub slope: f32,
    /// The part of the slope that A, B and C have.
    pub curve_slope: f32,
    /// Largest ripple, in cells of the ripple's axis: how far off a first guess of the inverse can be.
    pub ripple_cells: f32,
    /// What the integers of a step round of A, B, C and the ripple, rad: the place in a cell and the weights have 15 bits.
    pub rounding_rad: f32,
}

/// What the iterations of the inverse leave.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct InverseBound {
    pub iterations: u8,
    pub error_rad: f32,
}

/// A torque and temperature, located in the table: [`Table::at`]. What forward and inverse of one tick share.
#[derive(Clone, Copy, Debug)]
pub struct OperatingPoint {
    /// Where the record below the torque starts, its torque step and its temperature step.
    records: [usize; 3],
    /// Their shares in 2⁻¹⁴: low torque, high torque; the same at the higher temperature.
    shares: [i32; 4],
    pub(crate) plan: Plan,
    /// D and H there, counts.
    pub(crate) mean: i32,
    pub(crate) half_width: i32,
    /// Height of the jump the torque lies in, else 0, counts.
    pub(crate) jump: i32,
    /// All inputs are finite.
    pub(crate) finite: bool,
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

    /// Iterations of an inverse; whatever the memory that holds the table says, no more than the most allowed.
    #[inline(always)]
    pub(crate) const fn iterations(&self) -> u32 {
        let most = crate::model::MAX_INVERSE_ITERATIONS as u32;
        if self.plan.iterations < most { self.plan.iterations } else { most }
    }

    /// Whether |centre| + |half| is within what an accepted table can give.
    #[inline(always)]
    pub(crate) const fn allows(&self, centre: i32, half: i32) -> bool {
        // Negative numbers have room for every magnitude.
        let centre = if centre > 0 { centre.wrapping_neg() } else { centre };
        let half = if half > 0 { half.wrapping_neg() } else { half };
        centre.saturating_add(half) >= self.plan.limit.wrapping_neg()
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

/// The ripple around a phase, as a function of the distance `t` from the boundary between two cells nearest to it, −1 to 1 in
/// cells: `value + t·slope + t²·bend`, counts; `bend` differs from one side to the other.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RippleAround {
    /// The phase itself, as a distance from the boundary.
    pub place: f32,
    pub forward: Bend,
    pub backward: Bend,
}

/// Two parabolas that meet at 0 with the same slope.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Bend {
    pub value: f32,
    pub slope: f32,
    /// Before and after 0.
    pub bend: [f32; 2],
}

impl Bend {
    /// Of four B-spline coefficients.
    #[inline(always)]
    fn new([before, a, b, after]: [f32; 4]) -> Self {
        let slope = b - a;
        Self { value: 0.5 * (a + b), slope, bend: [0.5 * (slope - (a - before)), 0.5 * ((after - b) - slope)] }
    }

    /// Half the sum of both weighed with `1 + side` and `1 − side`.
    #[inline(always)]
    pub fn mix(self, other: Self, side: f32) -> Self {
        let mix = |a: f32, b: f32| 0.5 * ((a + b) + side * (a - b));
        let ([before, after], [other_before, other_after]) = (self.bend, other.bend);
        Self {
            value: mix(self.value, other.value),
            slope: mix(self.slope, other.slope),
            bend: [mix(before, other_before), mix(after, other_after)],
        }
    }

    #[inline(always)]
    pub fn at(self, t: f32) -> f32 {
        let [before, after] = self.bend;
        let bend = if t < 0.0 { before } else { after };
        self.value + t * (self.slope + t * bend)
    }

    /// Where `width·(t − place) + self = 0`, within ±1: how far a target is from the boundary. |slope| < |width|.
    #[inline(always)]
    pub fn root(self, place: f32, width: f32) -> f32 {
        let (constant, linear) = (self.value - width * place, self.slope + width);
        // The sign of the root is that of −constant/width.
        let [before, after] = self.bend;
        let behind = (constant > 0.0) == (width > 0.0);
        let bend = if behind { before } else { after };
        let discriminant = linear * linear - 4.0 * bend * constant;
        let discriminant = if discriminant > 0.0 { discriminant } else { 0.0 };
        let root = sqrt(discriminant);
        let root = if width > 0.0 { root } else { -root };
        within(-2.0 * constant / (linear + root), [-1.0, 1.0])
    }
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

/// Square root of a number that is not negative, to 3e-7 of it: an estimate of 1/√x from the exponent and three steps of Newton.
///
/// The same on every machine, and a tenth of the instructions that `libm` takes without a processor's own root.
#[inline(always)]
pub(crate) fn sqrt(x: f32) -> f32 {
    let mut inverse = f32::from_bits(0x5f37_59df_u32.wrapping_sub(x.to_bits() >> 1));
    let half = 0.5 * x;
    for _ in 0..3 {
        inverse *= 1.5 - half * inverse * inverse;
    }
    x * inverse
}

/// `value` within a range; its lower end if NaN.
#[inline(always)]
pub(crate) fn within(value: f32, [least, most]: [f32; 2]) -> f32 {
    let above = if value > least { value } else { least };
    if above < most { above } else { most }
}

#[inline(always)]
pub(crate) fn finite(value: f32) -> bool {
    value.to_bits() & 0x7fff_ffff < 0x7f80_0000
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
        records: [usize; 3],
        plan: Plan,
        (finite, in_range): (bool, bool),
        doubt: Doubt,
    ) -> Self {
        let TorquePlace { weight, width, jump } = place;
        let ([mean_low, slope_low, half_low], [mean_high, slope_high, half_high]) = (low, high);
        let (rise, widening) = (mean_high - mean_low, half_high - half_low);
        let bend = windup::bend(weight, width, [rise, slope_low, slope_high]);
        let bend = if jump { 0.0 } else { bend };
        // In doubt strictly inside a jump.
        let height = rise.abs() + widening.abs();
        let height = if jump & (weight > 0.0) & (weight < 1.0) { height } else { 0.0 };
        let (t, w) = ((weight * 16_384.0) as i32, (warm * 16_384.0) as i32);
        let both = t.wrapping_mul(w) >> 14;
        let rest = 16_384i32.wrapping_sub(t).wrapping_sub(w).wrapping_add(both);
        Self {
            records,
            shares: [rest, t.wrapping_sub(both), w.wrapping_sub(both), both],
            plan,
            mean: (mean_low + weight * rise + bend) as i32,
            half_width: (half_low + weight * widening) as i32,
            jump: height as i32,
            finite,
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
    OperatingPoint::new(place, around, warm, [first_record, record_step, record_plane], table.plan(), marks, doubt)
}

/// Ripple coefficients of forward and backward motion from `node` on, at a located point, 2⁻¹⁴ ripple units.
#[inline(always)]
fn coefficients<M: Memory, const N: usize>(
    memory: &M,
    point: &OperatingPoint,
    node: usize,
    doubt: &mut Doubt,
) -> [[i32; N]; 2] {
    let (mut forward, mut backward) = ([0i32; N], [0i32; N]);
    let [first, torque_step, plane_step] = point.records;
    let at = first.wrapping_add(node);
    let hot = at.wrapping_add(plane_step);
    let rows = [at, at.wrapping_add(torque_step), hot, hot.wrapping_add(torque_step)];
    for (row, share) in rows.into_iter().zip(point.shares).take(M::ROWS) {
        let words: [u32; N] = memory.words(row, doubt);
        for ((forward, backward), word) in forward.iter_mut().zip(&mut backward).zip(words) {
            // |Σ| ≤ 2¹⁵·2¹⁴: the shares add up to 2¹⁴.
            *forward = forward.wrapping_add((word as i16 as i32).wrapping_mul(share as i16 as i32));
            *backward = backward.wrapping_add(((word as i32 >> 16) as i16 as i32).wrapping_mul(share as i16 as i32));
        }
    }
    [forward, backward]
}

/// A + B + C at these phases, counts.
#[inline(always)]
pub(crate) fn curves_at<M: Memory>(memory: &M, point: &OperatingPoint, phases: Phases, doubt: &mut Doubt) -> i32 {
    let mut sum = 0i32;
    for (curve, phase) in point.plan.curves.into_iter().zip([phases.generator, phases.material, phases.output]) {
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

/// Centre and half-width of the play at a located point and these phases. The same work for all phases.
#[inline(always)]
pub(crate) fn play_at<M: Memory>(memory: &M, point: &OperatingPoint, phases: Phases, doubt: &mut Doubt) -> Play {
    let (mut centre, mut half) = (point.mean, point.half_width);
    if point.plan.ripple_nodes > 0 {
        let cell = Cell::at(point.plan.ripple_nodes, phases.tooth);
        let weights = cell.weights_q15();
        let ripples = coefficients(memory, point, cell.node, doubt);
        let [forward, backward] =
            ripples.map(|ripple| mul_high(weighed(ripple, weights), point.plan.ripple_unit as i32));
        centre = centre.wrapping_add(forward.wrapping_add(backward) >> 1);
        half = half.wrapping_add(backward.wrapping_sub(forward) >> 1);
    }
    centre = centre.wrapping_add(curves_at(memory, point, phases, doubt));
    // Not negative but for rounding: the image check bounds it.
    let half = if half < 0 { 0 } else { half };
    Play { centre, half, sane: point.allows(centre, half) }
}

/// The ripple around a phase of the tooth pitch. The same work for all phases.
#[inline(always)]
pub(crate) fn ripple_around<M: Memory>(
    memory: &M,
    point: &OperatingPoint,
    tooth: u32,
    doubt: &mut Doubt,
) -> RippleAround {
    if point.plan.ripple_nodes == 0 {
        return RippleAround::default();
    }
    let scaled = (tooth as u64).wrapping_mul(point.plan.ripple_nodes as u64);
    // Node to node: the boundary of their cells is in the middle.
    let [forward, backward] = coefficients(memory, point, (scaled >> 32) as usize, doubt);
    let counts = point.plan.ripple_unit as f32 * (1.0 / (524_288.0 * 16_384.0));
    RippleAround {
        place: (scaled as u32 ^ 0x8000_0000) as i32 as f32 * (1.0 / 4_294_967_296.0),
        forward: Bend::new(forward.map(|ripple| ripple as f32 * counts)),
        backward: Bend::new(backward.map(|ripple| ripple as f32 * counts)),
    }
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

    pub(crate) fn plan(&self) -> Plan {
        let at = |place: usize| word_at(self.words, place);
        let first = word::CELL_WIDTH;
        Plan {
            ripple_nodes: at(first.wrapping_add(4)) >> 16,
            ripple_unit: at(word::RIPPLE_UNIT),
            curves: [5, 6, 7].map(|place: usize| at(first.wrapping_add(place))),
            limit: at(word::RIPPLE_UNIT.wrapping_add(1)) as i32,
            iterations: at(first.wrapping_add(8)),
            hold: at(first.wrapping_add(9)) as i32,
            cell_width: f32::from_bits(at(first)),
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

/// Radians in counts.
pub(crate) const fn counts(rad: f64) -> f64 {
    rad * (4_294_967_296.0 / core::f64::consts::TAU)
}
