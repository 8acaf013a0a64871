//! Largest values of a table, and the remaining error of its inverse's iterations; their convergence is described in
//! [`model`](super::model).

use crate::num::larger;

/// Error of the inverse that the number of its iterations aims at, rad at the output: 0.02″, far below what a table
/// misses of its samples.
pub(crate) const INVERSE_TOLERANCE_RAD: f32 = 1.0e-7;
/// Iterations of an inverse, at most: of waves that a rougher bound is enough for, and of steep ones. *Guess*: with
/// 24 a slope of 0.7 brings 1000″ below what is allowed.
const USUAL_ITERATIONS: u8 = 8;
pub(crate) const MAX_INVERSE_ITERATIONS: u8 = 24;

/// No table is accepted whose inverse is left with more, rad at the output: 0.2″.
pub(crate) const MAX_INVERSE_ERROR_RAD: f32 = 1.0e-6;

/// Targets this close to the output leave the generator where it is: the rounding of forward and inverse, counts.
pub(crate) const HOLD_COUNTS: i32 = 8;

/// Largest values of a table, from its coefficients.
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
    /// Rounding error of a step in A, B, C and the ripple, rad: the place in a cell and the weights have 15
    /// bits.
    pub rounding_rad: f32,
}

/// Remaining error of the inverse's iterations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct InverseBound {
    pub iterations: u8,
    pub error_rad: f32,
}

impl InverseBound {
    pub const NONE: Self = Self { iterations: 0, error_rad: 0.0 };
}

impl Bounds {
    /// Of a table that gives nothing.
    pub(crate) const NONE: Self =
        Self { error_rad: 0.0, periodic_rad: 0.0, slope: 0.0, curve_slope: 0.0, ripple_cells: 0.0, rounding_rad: 0.0 };

    /// Iterations that an inverse takes, 1 to 24, and what they and rounding leave; `cell_rad` is a cell of the ripple
    /// at the output.
    pub(crate) fn inverse(self, cell_rad: f32) -> InverseBound {
        let rough = self.curve_slope / (1.0 - self.slope);
        let usual = self.iterated(USUAL_ITERATIONS, rough, [self.periodic_rad * rough, 1.0 + rough, 0.0], cell_rad);
        if usual.error_rad <= MAX_INVERSE_ERROR_RAD {
            return usual;
        }
        let ripple = self.slope - self.curve_slope;
        let rate = self.curve_slope / (1.0 - ripple);
        self.iterated(MAX_INVERSE_ITERATIONS, rate, [0.0, ripple * (1.0 + rate), 1.0 + ripple], cell_rad)
    }

    /// Iterations that bring the error below [`INVERSE_TOLERANCE_RAD`], or `most` of them, each to `rate` of the error
    /// before it. The solution for A, B, C held fixed is off the place where it is looked for by no more than the
    /// ripple and the first of `away` at first, then by these multiples of the error and of what the last search fell
    /// short.
    #[inline(never)]
    fn iterated(self, most: u8, rate: f32, away: [f32; 3], cell_rad: f32) -> InverseBound {
        let [first_rad, of_error, of_short] = away;
        let mut bound = InverseBound { iterations: 0, error_rad: self.periodic_rad };
        let mut away_rad = self.ripple_cells * cell_rad + first_rad;
        while bound.iterations < most {
            let short_rad = larger(away_rad - cell_rad, 0.0);
            bound.error_rad = bound.error_rad * rate + short_rad;
            away_rad = bound.error_rad * of_error + short_rad * of_short;
            bound.iterations = bound.iterations.saturating_add(1);
            if bound.error_rad <= INVERSE_TOLERANCE_RAD {
                break;
            }
        }
        // Places in a cell are in single precision.
        let place_rad = if cell_rad.is_finite() { 4.0 * f32::EPSILON * cell_rad } else { 0.0 };
        bound.error_rad += (self.rounding_rad + place_rad) / (1.0 - self.slope);
        bound
    }
}

bits_of!(Bounds { error_rad, periodic_rad, slope, curve_slope, ripple_cells, rounding_rad });
bits_of!(InverseBound { iterations, error_rad });

#[cfg(test)]
mod tests {
    use super::*;

    /// Each iteration leaves 0.45 / 0.95 of the error, and ten are enough; or nine tenths, and the last ends it.
    #[test]
    fn an_inverse_of_steep_waves_takes_more_iterations_up_to_the_most() {
        let steep = Bounds { periodic_rad: 1e-4, slope: 0.5, curve_slope: 0.45, ..Bounds::NONE };
        let bound = steep.inverse(1e-3);
        assert_eq!(bound.iterations, 10);
        assert!((bound.error_rad / (1e-4 * (0.45f32 / 0.95).powi(10)) - 1.0).abs() < 0.03, "{}", bound.error_rad);
        let steeper = Bounds { slope: 0.9, curve_slope: 0.9, ..steep }.inverse(1e-3);
        assert_eq!(steeper.iterations, MAX_INVERSE_ITERATIONS);
        assert!((steeper.error_rad / (1e-4 * 0.9f32.powi(24)) - 1.0).abs() < 0.03, "{}", steeper.error_rad);
    }
}
