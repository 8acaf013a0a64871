//! What the rows of a log go through: turns, loads, temperatures, speeds, directions.

use std::f64::consts::TAU;

use serde::Serialize;

use crate::measurement::{Quantity, ReadRows, least_and_most, quantile_of, sampled};

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

/// What the rows go through, if they have a generator angle.
pub(super) fn of(read: &[ReadRows]) -> Option<Coverage> {
    let column = |quantity: Quantity| -> Vec<f64> {
        read.iter().filter_map(|rows| rows.log.get(quantity)).flatten().copied().collect()
    };
    let (generator, output) = (column(Quantity::Generator), column(Quantity::Output));
    if generator.is_empty() {
        return None;
    }
    let range = |values: &[f64]| least_and_most(values.iter().copied().filter(|value| value.is_finite()));
    let turns = |values: &[f64]| ((range(values).1 - range(values).0) / TAU).max(0.0);
    let mut moved: Vec<(usize, f64)> = Vec::new();
    let mut speeds = Vec::new();
    let mut before = 0;
    for rows in read {
        let (Some(generator), time) = (rows.log.get(Quantity::Generator), rows.log.get(Quantity::Time)) else {
            continue;
        };
        for row in (1..generator.len()).filter(|row| rows.log.continues(*row)) {
            let step = generator[row] - generator[row - 1];
            moved.push((before + row, step));
            let passed = time.map_or(0.0, |time| time[row] - time[row - 1]);
            if passed > 0.0 {
                speeds.push(step.abs() / passed * 60.0 / TAU);
            }
        }
        before += generator.len();
    }
    // What stands moves by less than a hundredth of what moves usually.
    let mut steps: Vec<f64> = sampled(&moved.iter().map(|(_, step)| step.abs()).collect::<Vec<_>>());
    let still = 0.01 * quantile_of(&mut steps, 0.9);
    let (mut forward, mut backward) = (vec![0; PARTS], vec![0; PARTS]);
    let mut directions = [0.0; 3];
    for (row, step) in &moved {
        let way = usize::from(*step < -still) + 2 * usize::from(step.abs() <= still);
        directions[way] += 1.0 / moved.len() as f64;
        if let Some(output) = output.get(*row).filter(|_| way < 2) {
            let part = ((output / TAU).rem_euclid(1.0) * PARTS as f64) as usize % PARTS;
            if way == 0 { forward[part] += 1 } else { backward[part] += 1 }
        }
    }
    let limits = |quantity: Quantity| {
        let values = column(quantity);
        (!values.is_empty()).then(|| range(&values)).map(|(least, most)| [least, most])
    };
    speeds = sampled(&speeds);
    let speed_rpm = (!speeds.is_empty()).then(|| [quantile_of(&mut speeds, 0.5), quantile_of(&mut speeds, 0.99)]);
    Some(Coverage {
        generator_turns: turns(&generator),
        output_turns: turns(&output),
        rows_forward: forward,
        rows_backward: backward,
        directions,
        torque_n_m: limits(Quantity::Torque),
        temperature_c: limits(Quantity::Temperature),
        speed_rpm,
    })
}
