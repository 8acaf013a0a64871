//! The coverage of a log: its turns, loads, temperatures, speeds and directions.

use std::f64::consts::TAU;

use serde::Serialize;

use crate::measurement::{Quantity, ReadRows, least_and_most, quantile_of, sampled};

/// The turns, loads, temperatures and speeds of the rows.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Coverage {
    /// Turns of the generator, from its least to its largest angle.
    pub generator_turns: f64,
    /// Turns of the output.
    pub output_turns: f64,
    /// Shares of the rows that move the generator forward, backward, and not.
    pub directions: [f64; 3],
    /// Least and largest torque as mapped, N·m.
    pub torque_n_m: Option<[f64; 2]>,
    /// Least and largest temperature, °C.
    pub temperature_c: Option<[f64; 2]>,
    /// Median and largest (99 %) speed of the generator, turns a minute.
    pub speed_rpm: Option<[f64; 2]>,
}

/// The coverage of the rows, if they have a generator angle.
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
    // How far the generator moves into a row.
    let (mut moved, mut speeds) = (Vec::new(), Vec::new());
    for log in read.iter().map(|rows| &rows.log) {
        let (generator, time) = (log.get(Quantity::Generator).unwrap_or_default(), log.get(Quantity::Time));
        for row in (1..generator.len()).filter(|row| log.continues(*row)) {
            let step: f64 = generator[row] - generator[row - 1];
            moved.push(step);
            let passed = time.map_or(0.0, |time| time[row] - time[row - 1]);
            if passed > 0.0 {
                speeds.push(step.abs() / passed * 60.0 / TAU);
            }
        }
    }
    // What stands moves by less than a hundredth of what moves usually.
    let still = 0.01 * quantile_of(&mut sampled(&moved.iter().map(|step| step.abs()).collect::<Vec<_>>()), 0.9);
    let mut directions = [0.0; 3];
    for step in &moved {
        let way = usize::from(*step < -still) + 2 * usize::from(step.abs() <= still);
        directions[way] += 1.0 / moved.len() as f64;
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
        directions,
        torque_n_m: limits(Quantity::Torque),
        temperature_c: limits(Quantity::Temperature),
        speed_rpm,
    })
}
