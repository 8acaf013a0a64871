//! The error of a drive by its state alone: the parts that a table may have soak up flanks, load, position, speed and
//! temperature, so that what is left can be asked how it was read.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::{HELD, largest_torque};
use crate::least_squares::dot;
use crate::linear::{Gram, Prior, solve};
use crate::measurement::columns::Quantity;
use crate::measurement::gear::Gear;
use crate::measurement::log::Log;
use crate::measurement::{directions, rates};
use crate::parts::{PartName, Scales, State, row};
use flexspline_base::robust::{least_and_most, median_and_std};

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

/// The error freed of what the state says, where there are rows enough.
pub(super) fn left(log: &Log, gear: &Gear) -> Option<Vec<f64>> {
    let (generator, error) = (log.of(Quantity::Generator), log.of(Quantity::Error));
    let [torque, temperature, time] = [Quantity::Torque, Quantity::Temperature, Quantity::Time].map(|of| log.get(of));
    let range = |of: Option<&[f64]>| of.map_or([0.0; 2], |of| least_and_most(of.iter().copied()).into());
    let scales = Scales {
        torque_n_m: range(torque),
        friction_n_m: HELD * largest_torque(log),
        temperature_c: range(temperature),
        teeth: gear.tooth_pitch_rad.map_or(1.0, |pitch| TAU / pitch * (1.0 - 1.0 / gear.ratio)),
        speed_rad_s: 1.0,
        ..Scales::default()
    };
    let has_load = scales.torque_n_m[1] > scales.torque_n_m[0];
    let is_there = |part: &PartName| match part {
        PartName::WindUp => has_load,
        PartName::ToothPitch => gear.tooth_pitch_rad.is_some(),
        PartName::Temperature => temperature.is_some(),
        _ => true,
    };
    let parts = PartName::ALL.into_iter().filter(is_there).chain([PartName::ReadingDelay(0)]);
    let parts: Vec<PartName> = parts.collect();
    let ways: Vec<f64> = log.pieces(generator).flat_map(directions).collect();
    let numbers = || (0..log.len()).map(|row| row as f64).collect();
    let speeds = rates(&log.sessions().collect::<Vec<_>>(), &time.map_or_else(numbers, <[f64]>::to_vec), generator);
    let columns = |k: usize| {
        let at = |of: Option<&[f64]>| of.map_or(0.0, |of| of[k]);
        let state = State {
            generator_rad: generator[k],
            output_rad: generator[k] / gear.ratio,
            torque_n_m: at(torque),
            temperature_c: at(temperature),
            way: ways[k],
            speed_rad_s: speeds[k],
            log: 0,
        };
        [vec![1.0], row(&parts, &state, &scales)].concat()
    };
    let step = log.len().div_ceil(FIT_ROWS).max(1);
    let some = log.sessions().flat_map(|rows| rows.step_by(step));
    let rows: Vec<(Vec<f64>, f64)> = some.map(|k| (columns(k), error[k])).collect();
    let width = rows.first()?.0.len();
    if rows.len() < 2 * width {
        return None;
    }
    let (mut weights, mut coefficients) = (vec![1.0; rows.len()], Vec::new());
    let everything: Vec<usize> = (0..=width).collect();
    for _ in 0..4 {
        let mut gram = Gram::none(width + 1);
        for ((columns, error), weight) in rows.iter().zip(&weights) {
            gram.add_row(&[&columns[..], &[*error]].concat(), *weight);
        }
        let wide = |k: usize| Prior { mean: 0.0, std: WIDE / gram.at(k, k).sqrt().max(LEAST_SIZE) };
        let priors: Vec<Prior> = (0..width).map(wide).collect();
        coefficients = solve(&gram.among(&everything), &priors, 1.0)?.coefficients;
        let left: Vec<f64> = rows.iter().map(|(columns, error)| error - dot(columns, &coefficients)).collect();
        let (_, sigma) = median_and_std(&mut left.clone());
        if sigma <= 0.0 {
            break;
        }
        weights = left.iter().map(|left| (HUBER * sigma / left.abs()).min(1.0)).collect();
    }
    Some((0..log.len()).into_par_iter().map(|k| error[k] - dot(&columns(k), &coefficients)).collect())
}
