//! What the rows of a log go through: turns, loads, temperatures, speeds, directions.

use std::f64::consts::TAU;

use serde::Serialize;

use super::{Guess, Role};
use crate::measurement::{Unit, least_and_most, quantile_of, sampled};

/// Parts of a turn of the output that are counted.
const PARTS: usize = 36;

/// What the rows go through.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Coverage {
    /// Turns of the generator, from its least to its largest angle.
    pub generator_turns: f64,
    /// Turns of the output.
    pub output_turns: f64,
    /// Rows in each tenth of a radian, more or less (a 36th) of the output's turn that move forward, and backward.
    pub rows_forward: Vec<usize>,
    /// Rows in each part of the output's turn that move backward.
    pub rows_backward: Vec<usize>,
    /// Shares of the rows that move the generator forward, backward, and not.
    pub directions: [f64; 3],
    /// Least and largest torque as mapped, N·m.
    pub torque_n_m: Option<[f64; 2]>,
    /// Least and largest temperature, °C.
    pub temperature_c: Option<[f64; 2]>,
    /// Median and largest (99 %) speed of the generator, turns a minute.
    pub speed_rpm: Option<[f64; 2]>,
}

/// What the rows go through, if a generator angle is known.
pub(super) fn of(guesses: &[Guess], ratio: Option<f64>, starts: &[usize]) -> Option<Coverage> {
    let used = |role: Role| guesses.iter().find(|guess| guess.used && guess.role == role);
    let generator = used(Role::Generator)?;
    let generator: Vec<f64> =
        generator.values.iter().map(|value| value * generator.rad().unwrap_or(f64::NAN)).collect();
    let output: Vec<f64> = match (used(Role::Output).and_then(|guess| guess.rad().zip(Some(guess))), ratio) {
        (Some((rad, guess)), _) => guess.values.iter().map(|value| rad * value).collect(),
        (None, Some(ratio)) => generator.iter().map(|angle| angle / ratio).collect(),
        // The ratio of an error alone is not known; one turn of the output is that of the generator at most.
        (None, None) => generator.iter().map(|_| f64::NAN).collect(),
    };
    let range = |values: &[f64]| least_and_most(values.iter().copied().filter(|value| value.is_finite()));
    let turns = |values: &[f64]| ((range(values).1 - range(values).0) / TAU).max(0.0);
    let moved: Vec<(usize, f64)> = (1..generator.len())
        .filter(|row| !starts.contains(row))
        .map(|row| (row, generator[row] - generator[row - 1]))
        .filter(|(_, step)| step.is_finite())
        .collect();
    // What stands moves by less than a hundredth of what moves usually.
    let mut steps: Vec<f64> = sampled(&moved.iter().map(|(_, step)| step.abs()).collect::<Vec<_>>());
    let still = 0.01 * quantile_of(&mut steps, 0.9);
    let (mut forward, mut backward) = (vec![0; PARTS], vec![0; PARTS]);
    let mut directions = [0.0; 3];
    for (row, step) in &moved {
        let way = usize::from(*step < -still) + 2 * usize::from(step.abs() <= still);
        directions[way] += 1.0 / moved.len() as f64;
        if output[*row].is_finite() && way < 2 {
            let part = ((output[*row] / TAU).rem_euclid(1.0) * PARTS as f64) as usize % PARTS;
            if way == 0 { forward[part] += 1 } else { backward[part] += 1 }
        }
    }
    let limits = |role: Role| {
        let guess = guesses.iter().find(|guess| guess.used && (guess.role == role))?;
        let unit = guess.unit?;
        let sign = if guess.negative { -1.0 } else { 1.0 };
        let read = |value: f64| sign * value * unit.factor() + unit.zero();
        let ends = [read(guess.facts.least), read(guess.facts.most)];
        Some([ends[0].min(ends[1]), ends[0].max(ends[1])])
    };
    let speed_rpm = used(Role::Time).and_then(|time| {
        let factor = time.unit.map_or(1.0, Unit::factor);
        let mut speeds: Vec<f64> = moved
            .iter()
            .map(|(row, step)| (step.abs(), factor * (time.values[*row] - time.values[row - 1])))
            .filter(|(_, time)| *time > 0.0)
            .map(|(step, time)| step / time * 60.0 / TAU)
            .collect();
        speeds = sampled(&speeds);
        (!speeds.is_empty()).then(|| [quantile_of(&mut speeds, 0.5), quantile_of(&mut speeds, 0.99)])
    });
    Some(Coverage {
        generator_turns: turns(&generator),
        output_turns: turns(&output),
        rows_forward: forward,
        rows_backward: backward,
        directions,
        torque_n_m: limits(Role::Torque),
        temperature_c: limits(Role::Temperature),
        speed_rpm,
    })
}
