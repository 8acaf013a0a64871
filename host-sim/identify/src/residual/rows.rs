//! A residual with the angles that it may be tied to.

use serde::Serialize;
use thiserror::Error;

use crate::diagnosis::rows::Rows;
use crate::measurement::{directions, median_of, sampled};
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
}

/// Sense in which the generator moves, or moved last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Growing generator angle.
    Forward,
    /// Falling generator angle.
    Backward,
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

/// A residual over the rows.
pub(super) struct ResidualRows<'a> {
    pub rows: &'a Rows,
    /// One value for each row, arcsec.
    pub value: &'a [f64],
    /// Measured output angle, rad.
    pub output: Vec<f64>,
    /// Whether the generator moves forward, or moved so last.
    pub forward: Vec<bool>,
}

impl<'a> ResidualRows<'a> {
    pub fn new(rows: &'a Rows, value: &'a [f64]) -> Result<Self, SizeMismatch> {
        if value.len() != rows.len() {
            return Err(SizeMismatch { found: value.len(), needed: rows.len() });
        }
        let output = rows.output.iter().zip(&rows.error).map(|(nominal, error)| nominal + error / ARCSEC_PER_RAD);
        let directions = rows.sessions.iter().flat_map(|session| directions(&rows.generator[session.clone()]));
        let forward = directions.map(|way| way > 0.0).collect();
        Ok(ResidualRows { rows, value, output: output.collect(), forward })
    }

    /// The angle of an axis, rad.
    pub fn angle(&self, axis: Axis) -> Vec<f64> {
        let generator = &self.rows.generator;
        match axis {
            Axis::Generator => generator.clone(),
            Axis::Output => self.output.clone(),
            Axis::GeneratorLessOutput => generator.iter().zip(&self.output).map(|(psi, delta)| psi - delta).collect(),
        }
    }

    /// The residual less its median in each direction.
    pub fn centred_by_direction(&self) -> Vec<f64> {
        let values = || self.value.iter().copied().zip(&self.forward);
        let [backward, forward] = [false, true].map(|way| {
            let of_way: Vec<f64> = values().filter(|(_, forward)| **forward == way).map(|(value, _)| value).collect();
            median_of(&mut sampled(&of_way))
        });
        values().map(|(value, is_forward)| value - if *is_forward { forward } else { backward }).collect()
    }
}
