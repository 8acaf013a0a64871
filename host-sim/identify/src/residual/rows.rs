//! All rows of all sessions one after another, with the angles that matter.

use std::f64::consts::TAU;

use serde::Serialize;
use thiserror::Error;

use crate::measurement::{Session, directions, median_of, sampled};
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
#[error("session {session}: {found} values of the residual for {needed} rows")]
pub struct SizeMismatch {
    /// Session, from 0.
    pub session: usize,
    /// Values found.
    pub found: usize,
    /// Rows.
    pub needed: usize,
}

/// Rows of all sessions.
pub(super) struct Rows<'a> {
    pub sessions: &'a [Session],
    /// Where each session begins, and where the last one ends.
    pub starts: Vec<usize>,
    /// Residual, arcsec.
    pub value: Vec<f64>,
    /// Generator angle, rad.
    pub generator: Vec<f64>,
    /// Output angle, rad.
    pub output: Vec<f64>,
    /// Direction of motion.
    pub forward: Vec<bool>,
}

impl<'a> Rows<'a> {
    pub fn new(sessions: &'a [Session], residual_rad: &[Vec<f64>], ratio: f64) -> Result<Self, SizeMismatch> {
        let mut rows = Rows {
            sessions,
            starts: vec![0],
            value: Vec::new(),
            generator: Vec::new(),
            output: Vec::new(),
            forward: Vec::new(),
        };
        for (number, session) in sessions.iter().enumerate() {
            let found = residual_rad.get(number).map_or(0, Vec::len);
            if found != session.len() {
                return Err(SizeMismatch { session: number, found, needed: session.len() });
            }
            rows.value.extend(residual_rad[number].iter().map(|value| value * ARCSEC_PER_RAD));
            rows.generator.extend_from_slice(&session.generator_rad);
            rows.output.extend(session.output_rad(ratio));
            rows.forward.extend(directions(&session.generator_rad).into_iter().map(|way| way > 0.0));
            rows.starts.push(rows.value.len());
        }
        Ok(rows)
    }

    /// The angle of an axis, rad.
    pub fn angle(&self, axis: Axis) -> Vec<f64> {
        match axis {
            Axis::Generator => self.generator.clone(),
            Axis::Output => self.output.clone(),
            Axis::GeneratorLessOutput => {
                self.generator.iter().zip(&self.output).map(|(psi, delta)| psi - delta).collect()
            }
        }
    }

    /// The angle of an axis within a turn, 0 to 2π.
    pub(crate) fn within_turn(&self, axis: Axis) -> Vec<f64> {
        let mut angle = self.angle(axis);
        angle.iter_mut().for_each(|angle| *angle = angle.rem_euclid(TAU));
        angle
    }

    /// The residual less its median in each direction.
    pub(crate) fn centred_by_direction(&self) -> Vec<f64> {
        let median = |direction: bool| {
            let some: Vec<f64> = self
                .value
                .iter()
                .zip(&self.forward)
                .filter(|(_, f)| **f == direction)
                .map(|(value, _)| *value)
                .collect();
            median_of(&mut sampled(&some))
        };
        let (backward, forward) = (median(false), median(true));
        self.value.iter().zip(&self.forward).map(|(value, f)| value - if *f { forward } else { backward }).collect()
    }
}
