//! Addition to the table in one tick.

use crate::angle::{RAD_PER_COUNT, counts_from_rad};
use crate::play::MAX_ADDED_COUNTS;
use crate::whole::{START, Sealed, add};

/// Addition to the table in one tick, from a friction model or from coefficients learnt on board, and how far it is
/// known.
///
/// Counts of 2⁻³² output turn. Mean and half-width are each taken within ±[`Adjustment::MAX_RAD`]. The half-width never
/// falls below zero anywhere on the tooth pitch: a reduction is taken only that far. The error that a table may give
/// ([`Table::error_limit_rad`](crate::Table::error_limit_rad)) is that much larger.
///
/// It is kept under a sum: an upset of one word is mended where the adjustment is used. One that is lost is not used;
/// the tick keeps its correction as without a torque ([`Flags::NOT_CORRECTED`](crate::Flags::NOT_CORRECTED)).
#[must_use]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adjustment {
    /// Mean, half-width, uncertainty.
    counts: Sealed<[i32; 3]>,
}

impl Default for Adjustment {
    /// Adds nothing.
    fn default() -> Self {
        Self::new(0, 0)
    }
}

impl Adjustment {
    /// Largest magnitude, rad: 0.049.
    pub const MAX_RAD: f32 = Self::MAX_COUNTS as f32 * RAD_PER_COUNT;
    /// Largest adjustment in counts.
    pub const MAX_COUNTS: i32 = MAX_ADDED_COUNTS;
    /// Not whole.
    const LOST: Self = Self { counts: Sealed::of([0; 3], 0) };

    /// Adds these to the mean error (actual less nominal) and to the half-width of the play.
    pub const fn new(mean_counts: i32, half_width_counts: i32) -> Self {
        Self::of([mean_counts, half_width_counts, 0])
    }

    const fn of(counts: [i32; 3]) -> Self {
        let [mean, half_width, uncertainty] = counts;
        let sum = add(add(add(START, mean as u32), half_width as u32), uncertainty as u32);
        Self { counts: Sealed::of(counts, add(sum, 0)) }
    }

    /// From radians at the output, rounded to a count; saturates at ±[`Self::MAX_RAD`], NaN is taken as none.
    pub fn from_rad(mean_rad: f32, half_width_rad: f32) -> Self {
        let counts = |rad: f32| bounded(counts_from_rad(rad));
        Self::new(counts(mean_rad), counts(half_width_rad))
    }

    /// With an uncertainty of the mean that is larger by this, rad: the tick adds it to its own
    /// ([`Output::uncertainty_rad`](crate::Output::uncertainty_rad)) and is
    /// [`Uncertain`](crate::Quality::Uncertain). Below 0 and NaN count as [`Self::MAX_RAD`], which is the largest.
    pub fn with_uncertainty(self, rad: f32) -> Self {
        self.with([0, 0, uncertainty_counts(rad)])
    }

    /// With these added; lost if it is.
    #[doc(hidden)]
    pub fn with(self, [more, wider, further]: [i32; 3]) -> Self {
        let Some([mean, half_width, uncertainty]) = self.open() else { return Self::LOST };
        let sum = |one: i32, other: i32| within(one.saturating_add(other), Self::MAX_COUNTS.wrapping_neg());
        Self::of([sum(mean, more), sum(half_width, wider), sum(uncertainty, further)])
    }

    /// The sum of two, each part held within ±[`Self::MAX_COUNTS`]; lost if either is.
    pub fn plus(self, other: Self) -> Self {
        other.open().map_or(Self::LOST, |counts| self.with(counts))
    }

    /// Mean, half-width and uncertainty, counts, mended if they have to be; `None` if it is lost.
    #[inline(always)]
    #[doc(hidden)]
    #[must_use]
    pub fn open(&self) -> Option<[i32; 3]> {
        self.counts.open()
    }

    /// Added to the mean error, counts; 0 if it is lost.
    #[must_use]
    pub fn mean_counts(&self) -> i32 {
        self.open().map_or(0, |[mean, ..]| mean)
    }

    /// Added to the half-width of the play, counts; 0 if it is lost.
    #[must_use]
    pub fn half_width_counts(&self) -> i32 {
        self.open().map_or(0, |[_, half_width, _]| half_width)
    }

    /// The mean lies within ± this, rad; [`Self::MAX_RAD`] if it is lost.
    #[must_use]
    pub fn uncertainty_rad(&self) -> f32 {
        self.open().map_or(Self::MAX_RAD, |[.., uncertainty]| uncertainty as f32 * RAD_PER_COUNT)
    }
}

/// An uncertainty in counts: what is no number, or none that can be, is the largest.
pub fn uncertainty_counts(rad: f32) -> i32 {
    if (0.0..=Adjustment::MAX_RAD).contains(&rad) { counts_from_rad(rad) } else { Adjustment::MAX_COUNTS }
}

#[inline(always)]
const fn within(counts: i32, least: i32) -> i32 {
    let above = if counts > least { counts } else { least };
    if above < Adjustment::MAX_COUNTS { above } else { Adjustment::MAX_COUNTS }
}

/// An adjustment within its magnitude.
#[inline(always)]
pub const fn bounded(counts: i32) -> i32 {
    // From −2²⁵ on: one instruction.
    within(counts, !Adjustment::MAX_COUNTS)
}

bits_of!(Adjustment { counts });
