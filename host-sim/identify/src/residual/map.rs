//! The residual over the angle of each wheel.

use std::f64::consts::TAU;

use serde::Serialize;

use super::rows::{Axis, Direction, ResidualRows};
use crate::measurement::median_of;

/// Bins of a turn: 3 degrees, a third of the arc over which teeth engage.
const BINS: usize = 120;

/// Rows near one angle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bin {
    /// Middle of the bin, rad.
    pub angle_rad: f64,
    /// Rows.
    pub count: usize,
    /// Their median, arcsec.
    pub median_arcsec: f64,
}

/// The residual over an angle, in one direction of motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AngleMap {
    /// Which angle.
    pub axis: Axis,
    /// Direction of motion.
    pub direction: Direction,
    /// Bins with rows, by angle.
    pub bins: Vec<Bin>,
}

pub(super) fn of(residual: &ResidualRows<'_>) -> Vec<AngleMap> {
    let mut maps = Vec::new();
    for axis in Axis::ALL {
        let angle = residual.angle(axis);
        for direction in [Direction::Forward, Direction::Backward] {
            let of_way = |k: &usize| residual.forward[*k] == (direction == Direction::Forward);
            let rows = (0..angle.len()).filter(of_way).map(|k| (angle[k], residual.value[k]));
            let bins: Vec<Bin> = folded(rows, BINS)
                .iter_mut()
                .enumerate()
                .filter(|(_, values)| !values.is_empty())
                .map(|(place, values)| {
                    let angle_rad = (place as f64 + 0.5) / BINS as f64 * TAU;
                    Bin { angle_rad, count: values.len(), median_arcsec: median_of(values) }
                })
                .collect();
            if !bins.is_empty() {
                maps.push(AngleMap { axis, direction, bins });
            }
        }
    }
    maps
}

/// Values at angles (rad) by the bin of a turn that they lie in.
pub(super) fn folded(rows: impl Iterator<Item = (f64, f64)>, bins: usize) -> Vec<Vec<f64>> {
    let mut of_bins = vec![Vec::new(); bins];
    for (angle, value) in rows {
        of_bins[((angle.rem_euclid(TAU) / TAU * bins as f64) as usize).min(bins - 1)].push(value);
    }
    of_bins
}
