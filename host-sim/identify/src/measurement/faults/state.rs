//! The error of a drive by its state alone: a plain regression that soaks up flanks, load, position, speed and
//! temperature, so that what is left can be asked how it was read.
//!
//! It names no cause and is not the diagnosis; it only has to be rich enough that no cause is taken for a fault of the
//! data.

use rayon::prelude::*;

use super::largest_torque;
use crate::least_squares::add_scaled;
use crate::linear::{Gram, Prior, solve};
use crate::measurement::columns::Quantity;
use crate::measurement::directions;
use crate::measurement::gear::Gear;
use crate::measurement::log::Log;
use flexspline_base::robust::{median_and_std, rms};

/// Rows that a fit uses at most, spread evenly. *Guess*: it bounds the time.
const FIT_ROWS: usize = 8000;
/// Weights fall from this many robust standard deviations on (Huber 1964). *Guess*: he takes 1 to 2; with 2.5 nearly
/// all normal rows keep their weight.
const HUBER: f64 = 2.5;
/// Prior standard deviation of a coefficient, in units of what one row of error 1 says of it: so wide that rows alone
/// decide, where they do. *Guess*: 1e-9 of their information.
const WIDE: f64 = 31_622.776_601_683_8;
/// A column is at least of this size, in its own unit. *Guess*: smaller is round-off.
const LEAST_SIZE: f64 = 1e-12;

/// Columns that depend on the state.
pub(super) struct StateModel<'a> {
    log: &'a Log,
    ratio: f64,
    /// +1 after forward motion, -1 after backward, row by row.
    flank: Vec<f64>,
    torque_scale: f64,
    motion_scale: f64,
    temperature: (f64, f64),
}

impl<'a> StateModel<'a> {
    pub fn new(log: &'a Log, gear: &Gear) -> Self {
        let generator = log.of(Quantity::Generator);
        let temperatures = log.of(Quantity::Temperature);
        let mean = temperatures.iter().sum::<f64>() / temperatures.len().max(1) as f64;
        let warmest = temperatures.iter().fold(1.0, |most: f64, value| most.max(value.abs()));
        StateModel {
            log,
            ratio: gear.ratio,
            flank: log.pieces(generator).flat_map(directions).collect(),
            torque_scale: largest_torque(log),
            motion_scale: generator.iter().fold(1e-12, |most: f64, psi| most.max(psi.abs())),
            temperature: (mean, warmest),
        }
    }

    /// The columns at a row.
    fn fill(&self, row: usize, to: &mut Vec<f64>) {
        let generator = self.log.of(Quantity::Generator);
        let (psi, flank) = (generator[row], self.flank[row]);
        let delta = psi / self.ratio;
        to.extend([1.0, flank, psi / self.motion_scale]);
        for (angle, orders) in [(psi, &[1.0, 2.0, 4.0][..]), (psi - delta, &[1.0, 2.0, 4.0]), (delta, &[1.0, 2.0])] {
            to.extend(orders.iter().flat_map(|order| <[f64; 2]>::from((order * angle).sin_cos())));
        }
        let (sin, cos) = (2.0 * psi).sin_cos();
        to.extend([flank * sin, flank * cos]);
        let continues = |row: usize| self.log.continues(row);
        let begins = !continues(row);
        let previous = if begins { row + usize::from(continues(row + 1)) } else { row - 1 };
        let moved = (generator[row] - generator[previous]) * if begins { -1.0 } else { 1.0 };
        let speed = match self.log.get(Quantity::Time) {
            Some(time) if time[row] != time[previous] => moved / (time[row] - time[previous]).abs(),
            _ => moved,
        };
        to.push(speed);
        let torque = self.log.get(Quantity::Torque).filter(|_| self.torque_scale > 0.0);
        let t = torque.map_or(0.0, |torque| torque[row] / self.torque_scale);
        to.extend([t, t * t.abs(), (t / 0.05).tanh(), flank * t.abs()]);
        let (mean, warmest) = self.temperature;
        let temperature = self.log.get(Quantity::Temperature);
        let t = temperature.map_or(0.0, |temperature| (temperature[row] - mean) / warmest);
        to.extend([t, flank * t]);
    }

    /// The error freed of what the state says, where there are rows enough.
    pub fn left(&self) -> Option<Vec<f64>> {
        let coefficients = self.fit()?;
        let left = |columns: &mut Vec<f64>, (row, error): (usize, &f64)| {
            columns.clear();
            self.fill(row, columns);
            error - columns.iter().zip(&coefficients).map(|(column, value)| column * value).sum::<f64>()
        };
        Some(self.log.of(Quantity::Error).par_iter().enumerate().map_init(Vec::new, left).collect())
    }

    /// Coefficients of the columns, by rows spread evenly.
    fn fit(&self) -> Option<Vec<f64>> {
        let step = self.log.len().div_ceil(FIT_ROWS).max(1);
        let (mut columns, mut error, mut at_row): (Vec<Vec<f64>>, Vec<f64>, _) = (Vec::new(), Vec::new(), Vec::new());
        for row in self.log.sessions().flat_map(|rows| rows.step_by(step)) {
            at_row.clear();
            self.fill(row, &mut at_row);
            columns.resize_with(at_row.len(), Vec::new);
            columns.iter_mut().zip(&at_row).for_each(|(column, value)| column.push(*value));
            error.push(self.log.of(Quantity::Error)[row]);
        }
        let n = error.len();
        if n < 2 * columns.len() {
            return None;
        }
        let wide = |column: &Vec<f64>| WIDE / (n as f64).sqrt() / rms(column).max(LEAST_SIZE);
        let priors: Vec<Prior> = columns.iter().map(|column| Prior { mean: 0.0, std: wide(column) }).collect();
        let mut weight = vec![1.0; n];
        let mut coefficients = None;
        for _ in 0..4 {
            let times_root =
                |column: &Vec<f64>| column.iter().zip(&weight).map(|(v, w): (_, &f64)| v * w.sqrt()).collect();
            let weighted: Vec<Vec<f64>> = columns.iter().chain([&error]).map(times_root).collect();
            let views: Vec<&[f64]> = weighted.iter().map(Vec::as_slice).collect();
            let fit = solve(&Gram::of(&views, 0..n), &priors, 1.0)?;
            let mut left = error.clone();
            columns.iter().zip(&fit.coefficients).for_each(|(column, c)| add_scaled(&mut left, column, -c));
            coefficients = Some(fit.coefficients);
            let sigma = median_and_std(&mut left.clone()).1;
            if sigma <= 0.0 {
                break;
            }
            for (weight, left) in weight.iter_mut().zip(&left) {
                *weight = (HUBER * sigma / left.abs()).min(1.0);
            }
        }
        coefficients
    }
}
