//! The residual over the angle of each wheel.

use std::f64::consts::TAU;

use serde::Serialize;

use super::rows::{Axis, Direction, Rows};
use crate::measurement::median_and_std;

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
    /// Their robust standard deviation, arcsec.
    pub spread_arcsec: f64,
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

pub(super) fn of(rows: &Rows) -> Vec<AngleMap> {
    let mut maps = Vec::new();
    for axis in Axis::ALL {
        let angle = rows.within_turn(axis);
        for direction in [Direction::Forward, Direction::Backward] {
            let mut bins: Vec<Vec<f64>> = vec![Vec::new(); BINS];
            for row in 0..angle.len() {
                if rows.forward[row] == (direction == Direction::Forward) {
                    bins[((angle[row] / TAU * BINS as f64) as usize).min(BINS - 1)].push(rows.value[row]);
                }
            }
            let bins: Vec<Bin> = bins
                .iter_mut()
                .enumerate()
                .filter(|(_, values)| !values.is_empty())
                .map(|(place, values)| {
                    let count = values.len();
                    let (median_arcsec, spread_arcsec) = median_and_std(values);
                    let angle_rad = (place as f64 + 0.5) / BINS as f64 * TAU;
                    Bin { angle_rad, count, median_arcsec, spread_arcsec }
                })
                .collect();
            if !bins.is_empty() {
                maps.push(AngleMap { axis, direction, bins });
            }
        }
    }
    maps
}
