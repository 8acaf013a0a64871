//! Addition to the table in one tick.

use crate::angle::{RAD_PER_COUNT, counts_from_rad};
use crate::play::MAX_ADDED_COUNTS;

/// Addition to the table in one tick, from a friction model or from coefficients learnt on board.
///
/// Counts of 2⁻³² output turn. Each is taken within ±[`Adjustment::MAX_RAD`]. The half-width never falls below zero
/// anywhere on the tooth pitch: a reduction is taken only that far. The error that a table may give
/// ([`Table::error_limit_rad`](crate::Table::error_limit_rad)) is that much larger.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Adjustment {
    /// Added to the mean error (actual less nominal).
    pub mean_counts: i32,
    /// Added to the half-width of the play.
    pub half_width_counts: i32,
}

impl Adjustment {
    /// Largest magnitude, rad: 0.049.
    pub const MAX_RAD: f32 = Self::MAX_COUNTS as f32 * RAD_PER_COUNT;
    /// Largest adjustment in counts.
    pub const MAX_COUNTS: i32 = MAX_ADDED_COUNTS;

    /// From radians at the output, rounded to a count; saturates at ±[`Self::MAX_RAD`], NaN is taken as none.
    #[must_use]
    pub fn from_rad(mean_rad: f32, half_width_rad: f32) -> Self {
        let counts = |rad: f32| bounded(counts_from_rad(rad));
        Self { mean_counts: counts(mean_rad), half_width_counts: counts(half_width_rad) }
    }
}

/// An adjustment within its magnitude.
#[inline(always)]
pub(super) const fn bounded(counts: i32) -> i32 {
    // From −2²⁵ on: one instruction.
    let above = if counts > !Adjustment::MAX_COUNTS { counts } else { !Adjustment::MAX_COUNTS };
    if above < Adjustment::MAX_COUNTS { above } else { Adjustment::MAX_COUNTS }
}
