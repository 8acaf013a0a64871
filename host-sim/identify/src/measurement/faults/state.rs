//! The error of a drive by its state alone: a plain regression that soaks up flanks, load, position, speed and
//! temperature, so that what is left can be asked for steps and drift.
//!
//! It names no cause and is not the diagnosis; it only has to be rich enough that no cause is taken for a fault of the
//! data.

use std::sync::OnceLock;

use rayon::prelude::*;

use super::WIDEST_CLEARANCE_RAD;
use super::steps::largest_torque;
use crate::least_squares::add_scaled;
use crate::linear::{Gram, Prior, solve};
use crate::measurement::columns::Quantity;
use crate::measurement::gear::Gear;
use crate::measurement::log::Log;
use crate::measurement::{TURNED_BACK_RAD, directions, turns};
use flexspline_base::robust::{median_and_std, rms};

/// Rows that a fit uses at most, spread evenly. *Guess*: it bounds the time.
const FIT_ROWS: usize = 8000;
/// Rows by which a reversal may be noticed late. *Guess*: as long as it takes to turn back by more than noise.
const BEFORE: usize = 5;
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
    pub(super) flank: Vec<f64>,
    torque_scale: f64,
    motion_scale: f64,
    temperature: (f64, f64),
    /// Rows that fits use, once there is one.
    sampled: OnceLock<SampledRows>,
}

/// Rows that a fit uses.
#[derive(Default)]
struct SampledRows {
    places: Vec<usize>,
    error: Vec<f64>,
    /// Columns of the state.
    columns: Vec<Vec<f64>>,
}

/// A fit of some columns.
pub(super) struct StateFit {
    /// Coefficients in the order of the columns.
    pub value: Vec<f64>,
    /// Their standard deviations, correlation of neighbouring rows considered.
    pub std: Vec<f64>,
    /// Sum of squared, weighted residuals.
    pub misfit: f64,
}

/// A column in addition to those of the state.
pub(super) type Extra<'a> = &'a (dyn Fn(usize) -> f64 + Sync);

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
            sampled: OnceLock::new(),
        }
    }

    /// Rows at which the generator has gone on so far since it turned back that clearance is taken up, and does not
    /// turn back within a few rows.
    pub fn settled(&self) -> Vec<bool> {
        let of = |psi: &[f64]| -> Vec<bool> {
            let far = |((_, turned_at), psi): (&(f64, f64), &f64)| {
                (psi - turned_at).abs() > WIDEST_CLEARANCE_RAD * self.ratio.abs()
            };
            let far: Vec<bool> = turns(psi, TURNED_BACK_RAD).iter().zip(psi).map(far).collect();
            (0..far.len()).map(|row| far[row] && far[(row + BEFORE).min(far.len() - 1)]).collect()
        };
        self.log.pieces(self.log.of(Quantity::Generator)).flat_map(of).collect()
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

    /// The error freed of what a fit of the state and `extras` says.
    pub fn left(&self, fit: &StateFit, extras: &[Extra]) -> Vec<f64> {
        let left = |columns: &mut Vec<f64>, (row, error): (usize, &f64)| {
            columns.clear();
            self.fill(row, columns);
            columns.extend(extras.iter().map(|extra| extra(row)));
            error - columns.iter().zip(&fit.value).map(|(column, value)| column * value).sum::<f64>()
        };
        self.log.of(Quantity::Error).par_iter().enumerate().map_init(Vec::new, left).collect()
    }

    /// Rows spread evenly, with the columns of the state.
    fn sample(&self) -> SampledRows {
        let step = self.log.len().div_ceil(FIT_ROWS).max(1);
        let mut sampled = SampledRows::default();
        let mut at_row = Vec::new();
        for row in self.log.sessions().flat_map(|rows| rows.step_by(step)) {
            at_row.clear();
            self.fill(row, &mut at_row);
            sampled.columns.resize_with(at_row.len(), Vec::new);
            sampled.columns.iter_mut().zip(&at_row).for_each(|(column, value)| column.push(*value));
            sampled.places.push(row);
            sampled.error.push(self.log.of(Quantity::Error)[row]);
        }
        sampled
    }

    /// Fits state and extra columns to the error; coefficients of the extra ones come last.
    pub fn fit(&self, extras: &[Extra]) -> Option<StateFit> {
        let SampledRows { places, error, columns } = self.sampled.get_or_init(|| self.sample());
        let n = error.len();
        let extra_column = |extra: &Extra| places.iter().map(|row| extra(*row)).collect();
        let extra_columns: Vec<Vec<f64>> = extras.iter().map(extra_column).collect();
        let all: Vec<&[f64]> = columns.iter().chain(&extra_columns).map(Vec::as_slice).collect();
        if n < 2 * all.len() {
            return None;
        }
        let wide = |column: &&[f64]| WIDE / (n as f64).sqrt() / rms(column).max(LEAST_SIZE);
        let priors: Vec<Prior> = all.iter().map(|column| Prior { mean: 0.0, std: wide(column) }).collect();
        let mut weight = vec![1.0; n];
        let (mut solution, mut left, mut sigma) = (None, error.clone(), 0.0);
        for _ in 0..4 {
            let times_root =
                |column: &[f64]| column.iter().zip(&weight).map(|(v, w): (_, &f64)| v * w.sqrt()).collect();
            let weighted: Vec<Vec<f64>> = all.iter().copied().chain([error.as_slice()]).map(times_root).collect();
            let views: Vec<&[f64]> = weighted.iter().map(Vec::as_slice).collect();
            let fit = solve(&Gram::of(&views, 0..n), &priors, 1.0)?;
            left.clone_from(error);
            all.iter().zip(&fit.coefficients).for_each(|(column, c)| add_scaled(&mut left, column, -c));
            solution = Some(fit);
            sigma = median_and_std(&mut left.clone()).1;
            if sigma <= 0.0 {
                break;
            }
            for (weight, left) in weight.iter_mut().zip(&left) {
                *weight = (HUBER * sigma / left.abs()).min(1.0);
            }
        }
        let solution = solution?;
        // Correlation from row to row, of residuals that are cut where outliers begin.
        let cut = |x: f64| x.clamp(-3.0 * sigma, 3.0 * sigma);
        let (mut own, mut next) = (0.0, 0.0);
        for k in 1..n {
            if self.log.continues(places[k]) {
                own += cut(left[k]).powi(2);
                next += cut(left[k]) * cut(left[k - 1]);
            }
        }
        let correlation = if own > 0.0 { (next / own).clamp(0.0, 0.98) } else { 0.0 };
        let inflation = (1.0 + correlation) / (1.0 - correlation);
        let misfit = left.iter().zip(&weight).map(|(left, weight)| weight * left * left).sum();
        let variances = solution.covariance().into_iter().step_by(all.len() + 1);
        let std = variances.map(|variance| sigma * (inflation * variance).sqrt()).collect();
        Some(StateFit { value: solution.coefficients, std, misfit })
    }
}
