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
//! Between torque nodes D is a cubic through the values and slopes of the two around the torque, but straight inside a
//! jump: D and its slope are continuous from one jump, or end of the axis, to the next. H, R, h are linear in torque.
//! All are linear in temperature and constant beyond the range of the table. R, h, A, B, C are periodic quadratic
//! B-splines ([`grid`]).
//!
//! A run fixes the torque axis: with frictionless flanks and a drag torque `Td` at the output, steady motion in
//! direction `d` loads the flanks by `τ − d·Td`, and the error jumps by the backlash where that load changes sign. So
//! the tables have two nearly coincident torque nodes each side of `±Td`. While the torque lies inside such an interval
//! the error is known only up to the height of the jump, and the [`Quality`] says so.
//!
//! # How it is read
//! Everything a step needs is in the words of the image, offsets too, so that two copies of the image can be compared
//! word for word while they are read (`Memory`). The error is in counts of 2⁻³² output turn from there on, in integers
//! but for the cubic and one division: the same bits on every machine.

mod bounds;
pub mod grid;
mod identity;
mod image;
mod memory;
mod model;
mod point;
mod read;
pub mod windup;
mod words;

pub use identity::{Identity, IdentityCheck};
#[cfg(any(test, feature = "testing"))]
pub use image::reseal;
pub use image::{
    BYTE_ORDER_MARK, MAGIC, MAX_AXIS_VALUE, MAX_ERROR_RAD, MAX_RIPPLE_NODES, MAX_TEMPERATURE_NODES, PAGE_BYTES,
    RESERVED, TEXT_BYTES, UNITS_PER_COUNT, cell_width, complete, counted, image_bytes, limit_counts, plan_of,
    ripple_row,
};
pub(crate) use image::{ImageCheck, NODE_WORDS, page_intact, word};
pub(crate) use memory::{Doubt, Memory, PointPlan};
pub use model::{Approach, Command, Prediction};
pub(crate) use model::{Estimate, TableModel, departure};
pub(crate) use point::TorquePlace;
pub use point::{OperatingPoint, Quality};
pub(crate) use read::play_at;
pub(crate) use words::{Words, blend_halves, blend_number, f32_at, halves, word_at, words_from};

use crate::drive::Drive;
use bounds::{Bounds, InverseBound};
use grid::PeriodicAxis;

numbered! { coded
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
}

/// First eight bytes of the BLAKE3 hash of a table's contents; prints as 16 hex digits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct TableId(pub [u8; 8]);

impl core::fmt::Display for TableId {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
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
    pub(crate) plan: PointPlan,
    pub(crate) bounds: Bounds,
    pub(crate) inverse: InverseBound,
    /// How far the ripple takes the half-width of the play below H at most, counts, rounded up.
    pub(crate) play_ripple: i32,
}

impl Memory for Table<'_> {
    #[inline(always)]
    fn plan(&self) -> &PointPlan {
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
    fn halves<const N: usize>(&self, at: usize, (step, share): (usize, i32), _: &mut Doubt) -> [u32; N] {
        // Of the image: what is read beyond the last record are its checksums.
        let words = |at: usize| words_from(self.image, at.wrapping_mul(2));
        let [mut here, hot]: [[u32; N]; 2] = [words(at), words(at.wrapping_add(step))];
        here.iter_mut().zip(hot).for_each(|(word, hot)| *word = blend_halves(*word, hot, share));
        here
    }
}

impl<'a> Table<'a> {
    /// Format version written and read.
    pub const FORMAT_VERSION: u16 = image::FORMAT_VERSION;
    /// Bytes of one page, the unit of a scrub and of an upload.
    pub const PAGE_BYTES: usize = PAGE_BYTES;
    /// No table may give a larger error, rad (2.9°, one and a half tooth pitches of a 188-tooth drive).
    pub const MAX_ERROR_RAD: f32 = MAX_ERROR_RAD;
    /// Most iterations of an inverse.
    pub const MAX_INVERSE_ITERATIONS: u8 = bounds::MAX_INVERSE_ITERATIONS;
    /// No table is accepted whose inverse is left with more, rad at the output: 0.2″.
    pub const MAX_INVERSE_ERROR_RAD: f32 = bounds::MAX_INVERSE_ERROR_RAD;

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
    pub(crate) fn plan_in(words: Words<'a>) -> PointPlan {
        let at = |place: usize| word_at(words, place);
        let first = word::CELL_WIDTH;
        let (unit, width) = (at(word::RIPPLE_UNIT), f32_at(words, first));
        PointPlan {
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
}
