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
//! linear in temperature and constant beyond the ends. R, h, A, B, C are periodic cubic B-splines ([`crate::grid`]); R and
//! h are kept in 16 bits with one scale each.
//!
//! A run fixes the torque axis: with frictionless flanks and a drag torque `Td` at the output, steady motion in direction
//! `d` loads the flanks by `τ − d·Td`, and the error jumps by the backlash where that load changes sign. So the tables
//! have two nearly coincident torque nodes each side of `±Td`. While the torque lies inside such an interval the error is
//! known only up to the height of the jump, and the [`Quality`] says so.

use crate::drive::{Drive, Phases};
use crate::grid::{self, MAX_HALVINGS, PeriodicAxis};
use crate::image::TEMPERATURE_HALVINGS;
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
    words.get(index).map_or(0.0, |word| f32::from_le_bytes(*word))
}

/// A ripple word: ripple of the mean and of the half-width in units of their scales.
pub(crate) fn ripple_at(words: Words<'_>, index: usize) -> (i16, i16) {
    words.get(index).map_or((0, 0), |&[a, b, c, d]| (i16::from_le_bytes([a, b]), i16::from_le_bytes([c, d])))
}

/// Unit of the ripple weights.
const Q15: f32 = 1.0 / 32_768.0;

/// Four words in a row; `None` beyond the end, which an accepted table never reaches.
fn four_at(words: Words<'_>, first: usize) -> Option<[[u8; 4]; 4]> {
    words.get(first..)?.first_chunk().copied()
}

/// D, H and the slope of D of the record at `first`; `None` beyond the end, which an accepted table never reaches.
fn head_at(words: Words<'_>, first: usize) -> Option<[f32; RECORD_HEAD_WORDS]> {
    Some(words.get(first..)?.first_chunk::<RECORD_HEAD_WORDS>()?.map(f32::from_le_bytes))
}

/// The larger of two numbers; the second if the first is NaN. (`f32::max` is a library call on a Cortex-M4F.)
pub(crate) fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Ripple of the mean and of the half-width at weights in 2⁻¹⁵: |sum| < 2³¹, since the weights add up to 2¹⁵.
fn ripple_sum(words: [[u8; 4]; 4], weights: [i16; 4]) -> (f32, f32) {
    let (mut mean, mut half) = (0i32, 0i32);
    for ([a, b, c, d], weight) in words.into_iter().zip(weights) {
        let weight = weight as i32;
        mean = mean.wrapping_add((i16::from_le_bytes([a, b]) as i32).wrapping_mul(weight));
        half = half.wrapping_add((i16::from_le_bytes([c, d]) as i32).wrapping_mul(weight));
    }
    (mean as f32, half as f32)
}

/// Words of a record before its ripple: D, H, slope of D.
pub(crate) const RECORD_HEAD_WORDS: usize = 3;

/// A periodic curve in an image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PeriodicCurve<'a> {
    pub axis: PeriodicAxis,
    pub words: Words<'a>,
}

impl PeriodicCurve<'_> {
    fn at(&self, phase: u32) -> f32 {
        if self.axis.is_empty() {
            return 0.0;
        }
        let cell = self.axis.locate(phase);
        four_at(self.words, cell.node).map_or(0.0, |words| dot(words.map(f32::from_le_bytes), cell.weights()))
    }
}

/// A table that passed every check of its image; borrows the image and reads it in place.
///
/// Made by [`Table::check`], the only way to get one. Immutable: what changes while running is in
/// [`PlayState`](crate::PlayState).
#[derive(Clone, Copy, Debug)]
pub struct Table<'a> {
    pub(crate) image: &'a [u8],
    pub(crate) body_bytes: usize,
    pub(crate) drive: Drive,
    pub(crate) generator_kind: GeneratorKind,
    pub(crate) torque: Words<'a>,
    pub(crate) temperature: Words<'a>,
    pub(crate) generator_curve: PeriodicCurve<'a>,
    pub(crate) material_curve: PeriodicCurve<'a>,
    pub(crate) output_curve: PeriodicCurve<'a>,
    /// `[temperature][torque]` records of `RECORD_HEAD_WORDS + ripple.stored_len()` words.
    pub(crate) records: Words<'a>,
    pub(crate) ripple: PeriodicAxis,
    pub(crate) mean_ripple_scale: f32,
    pub(crate) half_ripple_scale: f32,
    pub(crate) torque_jumps: u32,
    pub(crate) torque_range_n_m: [f32; 2],
    pub(crate) temperature_range_c: [f32; 2],
    pub(crate) error_limit_rad: f32,
    pub(crate) bounds: Bounds,
    pub(crate) inverse_iterations: u8,
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
}

/// A torque and temperature, located in the table: [`Table::at`]. What forward and inverse of one tick share.
#[derive(Clone, Copy, Debug)]
pub struct OperatingPoint {
    /// First word of the four records around it.
    rows: [usize; 4],
    weights: [f32; 4],
    /// D and H there.
    pub(crate) mean_rad: f32,
    pub(crate) half_width_rad: f32,
    /// Height of the jump the torque lies in, else 0.
    pub(crate) jump_rad: f32,
    pub(crate) quality: Quality,
}

impl OperatingPoint {
    /// The quality here, lowered while the side of the play is not known.
    pub(crate) fn quality_if_known(&self, known: bool) -> Quality {
        if known { self.quality } else { self.quality.max(Quality::Uncertain) }
    }
}

/// The two numbers that a generator position adds: centre and half-width of the play.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Play {
    pub centre_rad: f32,
    pub half_width_rad: f32,
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
    pub const fn torque_range_n_m(&self) -> [f32; 2] {
        self.torque_range_n_m
    }

    /// Temperatures the table holds for, °C, both ends included.
    #[must_use]
    pub const fn temperature_range_c(&self) -> [f32; 2] {
        self.temperature_range_c
    }

    /// Torque nodes, N·m.
    pub fn torque_nodes_n_m(&self) -> impl ExactSizeIterator<Item = f32> + use<'a> {
        self.torque.iter().map(|word| f32::from_le_bytes(*word))
    }

    /// Temperature nodes, °C.
    pub fn temperature_nodes_c(&self) -> impl ExactSizeIterator<Item = f32> + use<'a> {
        self.temperature.iter().map(|word| f32::from_le_bytes(*word))
    }

    /// Whether the interval above torque node `node` is a jump.
    #[must_use]
    pub fn is_torque_jump(&self, node: usize) -> bool {
        grid::is_jump(self.torque_jumps, node)
    }

    /// Axis of the ripple over one tooth pitch.
    #[must_use]
    pub const fn ripple_axis(&self) -> PeriodicAxis {
        self.ripple
    }

    /// The largest error the image states it may give, rad.
    #[must_use]
    pub const fn error_limit_rad(&self) -> f32 {
        self.error_limit_rad
    }

    /// Bounds computed from the coefficients when the table was accepted.
    #[must_use]
    pub const fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Locates a torque (N·m) and temperature (°C); `None` if either is not finite.
    ///
    /// (Or if the table ended before its records, which no accepted table does.)
    #[must_use]
    pub fn at(&self, torque_n_m: f32, temperature_c: f32) -> Option<OperatingPoint> {
        if !(torque_n_m.is_finite() && temperature_c.is_finite()) {
            return None;
        }
        let (torque, width) =
            grid::locate_with_width::<MAX_HALVINGS>(self.torque.len(), |i| f32_at(self.torque, i), torque_n_m);
        let temperature = grid::locate_clamped::<TEMPERATURE_HALVINGS>(
            self.temperature.len(),
            |i| f32_at(self.temperature, i),
            temperature_c,
        );
        let stride = self.ripple.stored_len().wrapping_add(RECORD_HEAD_WORDS);
        let row = |temperature: usize, torque: usize| {
            temperature.wrapping_mul(self.torque.len()).wrapping_add(torque).wrapping_mul(stride)
        };
        let rows = [
            row(temperature.below, torque.below),
            row(temperature.below, torque.above),
            row(temperature.above, torque.below),
            row(temperature.above, torque.above),
        ];
        let (cold, low) = (1.0 - temperature.weight, 1.0 - torque.weight);
        let weights = [cold * low, cold * torque.weight, temperature.weight * low, temperature.weight * torque.weight];
        let [a, b, c, d] = rows;
        let (a, b) = (head_at(self.records, a)?, head_at(self.records, b)?);
        let (c, d) = (head_at(self.records, c)?, head_at(self.records, d)?);
        let (means, halves) = ([a, b, c, d].map(|[mean, ..]| mean), [a, b, c, d].map(|[_, half, _]| half));
        let blend = |[mean, _, slope]: [f32; RECORD_HEAD_WORDS], [mean_hot, _, slope_hot]: [f32; RECORD_HEAD_WORDS]| {
            let hot = temperature.weight;
            (cold * mean + hot * mean_hot, cold * slope + hot * slope_hot)
        };
        let ((mean_low, slope_low), (mean_high, slope_high)) = (blend(a, c), blend(b, d));
        // The height of a jump is taken on both temperature planes; the larger counts.
        let height = |[a, b, c, d]: [f32; 4]| larger((b - a).abs(), (d - c).abs());
        let is_jump = self.is_torque_jump(torque.below);
        let in_jump = is_jump && torque.weight > 0.0 && torque.weight < 1.0;
        let straight = low * mean_low + torque.weight * mean_high;
        let bend = windup::bend(torque.weight, width, [mean_high - mean_low, slope_low, slope_high]);
        let within = |value: f32, [least, most]: [f32; 2]| value >= least && value <= most;
        let in_range = within(torque_n_m, self.torque_range_n_m) && within(temperature_c, self.temperature_range_c);
        Some(OperatingPoint {
            rows,
            weights,
            mean_rad: straight + if is_jump { 0.0 } else { bend },
            half_width_rad: dot(halves, weights),
            jump_rad: if in_jump { height(means) + height(halves) } else { 0.0 },
            quality: match (in_range, in_jump) {
                (false, _) => Quality::Extrapolated,
                (true, true) => Quality::Uncertain,
                (true, false) => Quality::InRange,
            },
        })
    }

    /// Centre and half-width of the play at a located point and these phases; `None` if the memory that holds the table
    /// gives a number no accepted table can give.
    pub(crate) fn play_at(&self, point: &OperatingPoint, phases: Phases) -> Option<Play> {
        let (mut mean, mut half) = (0.0, 0.0);
        if !self.ripple.is_empty() {
            let cell = self.ripple.locate(phases.tooth);
            let weights = cell.weights_q15();
            let first = cell.node.wrapping_add(RECORD_HEAD_WORDS);
            for (row, share) in point.rows.into_iter().zip(point.weights) {
                let words = four_at(self.records, row.wrapping_add(first))?;
                let (mean_here, half_here) = ripple_sum(words, weights);
                mean += share * mean_here;
                half += share * half_here;
            }
        }
        let curves = self.generator_curve.at(phases.generator)
            + self.material_curve.at(phases.material)
            + self.output_curve.at(phases.output);
        let centre_rad = point.mean_rad + mean * (self.mean_ripple_scale * Q15) + curves;
        // Not negative but for rounding: the image check bounds it.
        let half_width_rad = larger(point.half_width_rad + half * (self.half_ripple_scale * Q15), 0.0);
        // The per mille takes up rounding; NaN fails the comparison.
        let sane = centre_rad.abs() + half_width_rad <= self.error_limit_rad * 1.001;
        sane.then_some(Play { centre_rad, half_width_rad })
    }
}

/// a·b, summed in order.
fn dot(a: [f32; 4], b: [f32; 4]) -> f32 {
    let ([a0, a1, a2, a3], [b0, b1, b2, b3]) = (a, b);
    a0 * b0 + a1 * b1 + a2 * b2 + a3 * b3
}
