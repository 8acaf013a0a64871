//! Angles that a residual may be tied to, and its rows by direction.

use serde::Serialize;
use thiserror::Error;

use crate::diagnosis::rows::Rows;
use crate::measurement::{median_of, sampled};
use flexspline_base::units::ARCSEC_PER_RAD;

/// An angle that something may be tied to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// ψ: what is tied to the flexspline and the generator.
    #[default]
    Generator,
    /// ψ−δ: what is tied to the circular spline.
    GeneratorLessOutput,
    /// δ: what is tied to the output, its encoder and its load.
    Output,
}

impl Axis {
    /// All of them.
    pub(crate) const ALL: [Axis; 3] = [Axis::Generator, Axis::GeneratorLessOutput, Axis::Output];

    /// Turns of it in a generator turn, for a drive with this ratio.
    pub fn turns_per_generator_turn(self, ratio: f64) -> f64 {
        match self {
            Axis::Generator => 1.0,
            Axis::GeneratorLessOutput => 1.0 - 1.0 / ratio,
            Axis::Output => 1.0 / ratio,
        }
    }

    /// The angle in each row, rad, from the measured output.
    pub fn angles(self, rows: &Rows) -> Vec<f64> {
        let output = rows.output.iter().zip(&rows.error).map(|(nominal, error)| nominal + error / ARCSEC_PER_RAD);
        match self {
            Axis::Generator => rows.generator.clone(),
            Axis::Output => output.collect(),
            Axis::GeneratorLessOutput => rows.generator.iter().zip(output).map(|(psi, delta)| psi - delta).collect(),
        }
    }
}

/// A residual that does not have one value for each row.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{found} values of the residual for {needed} rows")]
pub struct SizeMismatch {
    /// Values found.
    pub found: usize,
    /// Rows.
    pub needed: usize,
}

/// A residual over the rows less its median in each direction of the output.
pub(super) fn centred_by_direction(rows: &Rows, residual: &[f64]) -> Vec<f64> {
    let values: Vec<(f64, bool)> = residual.iter().copied().zip(rows.direction.iter().map(|way| *way > 0.0)).collect();
    let [backward, forward] = [false, true].map(|way| {
        let of_way: Vec<f64> = values.iter().filter(|of| of.1 == way).map(|of| of.0).collect();
        median_of(&mut sampled(&of_way))
    });
    values.into_iter().map(|(value, is_forward)| value - if is_forward { forward } else { backward }).collect()
}
