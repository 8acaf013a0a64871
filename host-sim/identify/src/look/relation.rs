//! Relations between columns: a ratio, the counts of a turn, which way a torque counts.

use std::f64::consts::TAU;

use crate::least_squares::{FreeSpan, dot};
use crate::measurement::{LineFit, least_and_most, rms};

/// Rows that a relation is found on, at most.
const LOOKED_AT: usize = 4000;
/// Two columns turn together if what a straight line leaves is below this share of the range of the second.
pub(super) const TOGETHER: f64 = 5e-3;
/// Counts of a turn are a power of two to this: one encoder against another on the same shaft, eccentric by an
/// arc-minute.
const SAME_COUNT: f64 = 1e-4;
/// Counts that a turn may have. *Guess*: encoders of 6 to 32 bits.
const COUNTS_OF_A_TURN: std::ops::RangeInclusive<f64> = 64.0..=4_294_967_296.0;
/// Ratios of strain wave gears, and a little more.
pub(super) const RATIOS: [f64; 2] = [20.0, 400.0];
/// A torque is believed to turn the error one way if it explains this share of what the turn of the output leaves.
pub(super) const CLEAR: f64 = 0.05;

/// Rows in which all columns have a number, thinned.
fn rows<const N: usize>(columns: [&[f64]; N]) -> Vec<[f64; N]> {
    let count = columns.iter().map(|column| column.len()).min().unwrap_or(0);
    let all =
        (0..count).map(|k| columns.map(|column| column[k])).filter(|row| row.iter().all(|value| value.is_finite()));
    let all: Vec<[f64; N]> = all.collect();
    all.iter().copied().step_by(all.len().div_ceil(LOOKED_AT).max(1)).collect()
}

/// How the first column follows the second, if it does; `of_file` says of which file each row is, as each has a zero of
/// its own. The change of the first for one of the second, and the root mean square of the residual of the first, over
/// its range.
pub(super) fn slope(first: &[f64], second: &[f64], of_file: &[f64]) -> Option<(f64, f64)> {
    let mut rows = rows([first, second, of_file]);
    if rows.len() < 16 {
        return None;
    }
    for of_one in rows.chunk_by_mut(|a, b| a[2] == b[2]) {
        for at in [0, 1] {
            let mean = of_one.iter().map(|row| row[at]).sum::<f64>() / of_one.len() as f64;
            of_one.iter_mut().for_each(|row| row[at] -= mean);
        }
    }
    let range = least_and_most(rows.iter().map(|row| row[0]));
    let LineFit { slope, square, residual } = LineFit::of(&rows.iter().map(|row| (row[1], row[0])).collect::<Vec<_>>());
    let moves = square > 0.0 && range.1 > range.0;
    moves.then(|| (slope, rms(&residual) / (range.1 - range.0)))
}

/// Counts of a turn, from counts over an angle in rad: the power of two that they nearly are; and how far off, as a
/// share.
pub(super) fn counts_of_a_turn(per_rad: f64) -> Option<(f64, f64)> {
    let counts = (per_rad * TAU).abs();
    let near = 2f64.powf(counts.log2().round());
    let off = (counts / near - 1.0).abs();
    (COUNTS_OF_A_TURN.contains(&near) && off < SAME_COUNT).then_some((near, off))
}

/// How an error (rad) follows a torque in addition to what turns with the output (rad): an eccentric encoder and the
/// weight of an arm look alike, so both may explain what one of them does. The slope, positive where
/// more of the torque turns the output forward, rad for one of its unit; and the share of what the turns of the output
/// leave of the error that it explains.
pub(super) fn torque_says(error: &[f64], output: &[f64], torque: &[f64], of_file: &[f64]) -> Option<(f64, f64)> {
    let mut rows = rows([error, output, torque, of_file]);
    // Where it should be: where it is has the error in it, which a load that goes with the angle would then explain.
    rows.iter_mut().for_each(|row| row[1] -= row[0]);
    let mut files: Vec<f64> = rows.iter().map(|row| row[3]).collect();
    files.dedup();
    let (least, most) = least_and_most(rows.iter().map(|row| row[1]));
    let turns = (most - least) / TAU;
    let column = |of: &dyn Fn(&[f64; 4]) -> f64| rows.iter().map(of).collect::<Vec<f64>>();
    let mut free: Vec<Vec<f64>> =
        files.iter().map(|file| column(&|row| f64::from(u8::from(row[3] == *file)))).collect();
    // Within less than a third of a turn a sine and a straight line look alike.
    if turns > 0.33 {
        free.extend([column(&|row| row[1].sin()), column(&|row| row[1].cos())]);
    } else {
        free.push(column(&|row| row[1]));
    }
    let (free, torque) = (FreeSpan::default().beyond(free), column(&|row| row[2]));
    let (own, left) = (free.freed(torque.clone()), free.freed(column(&|row| row[0])));
    // Else nothing is the torque's alone.
    let moves = rows.len() > 40 && rms(&own) > 1e-6 * rms(&torque);
    let (square, product) = (dot(&own, &own), dot(&own, &left));
    moves.then(|| (product / square, product * product / (square * dot(&left, &left)).max(f64::MIN_POSITIVE)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratio_and_counts_come_out() {
        let motor: Vec<f64> = (0..3000).map(|k| 0.05 * f64::from(k)).collect();
        let out: Vec<f64> = motor.iter().map(|m| 65_536.0 / TAU * (m / 101.0 + 1e-3 * (m / 101.0).sin())).collect();
        let one = vec![0.0; 3000];
        let (found, left) = slope(&out, &motor, &one).unwrap();
        assert!(left < TOGETHER);
        // A second file, with zeros of its own.
        let two: Vec<f64> = (0..3000).map(|k| f64::from(u8::from(k >= 1200))).collect();
        let again =
            |values: &[f64], by: f64| values.iter().zip(&two).map(|(v, two)| v + by * two).collect::<Vec<f64>>();
        let (out_again, motor_again) = (again(&out, 90_000.0), again(&motor, -40.0));
        assert!(slope(&out_again, &motor_again, &one).unwrap().1 >= TOGETHER);
        let (again, left) = slope(&out_again, &motor_again, &two).unwrap();
        assert!(left < TOGETHER && (again / found - 1.0).abs() < 1e-3, "{again} {left}");
        let counts = |of: f64| counts_of_a_turn(of / TAU).map(|(counts, _)| counts);
        assert_eq!((counts(-65_536.0), counts(20_000.1), counts(2.7e8)), (Some(65_536.0), None, None));
        let noise: Vec<f64> = (0..3000).map(|k| f64::from((k * 7919) % 3001)).collect();
        assert!(slope(&noise, &motor, &one).unwrap().1 >= TOGETHER);
    }

    #[test]
    fn the_sign_of_a_torque_is_found() {
        let out: Vec<f64> = (0..2000).map(|k| 2e-3 * f64::from(k)).collect();
        let torque: Vec<f64> = (0..2000).map(|k| 20.0 * (0.013 * f64::from(k)).sin()).collect();
        let error: Vec<f64> = out.iter().zip(&torque).map(|(o, t)| 1e-3 * o.sin() - t / 3e4).collect();
        let two: Vec<f64> = (0..2000).map(|k| f64::from(u8::from(k >= 700))).collect();
        let other_zero: Vec<f64> = error.iter().zip(&two).map(|(e, two)| e + 0.5 * two).collect();
        for (error, of_file) in [(&error, &vec![0.0; 2000]), (&other_zero, &two)] {
            let reached: Vec<f64> = out.iter().zip(error).map(|(o, e)| o + e).collect();
            let says = torque_says(error, &reached, &torque, of_file).unwrap();
            assert!(says.1 > CLEAR && (says.0 * -3e4 - 1.0).abs() < 1e-6, "{says:?}");
        }
        // A ramp of the load goes with the output: what the wheels do on the way is as well the torque's.
        let short: Vec<f64> = out[..300].to_vec();
        let ramp: Vec<f64> = short.iter().map(|o| 50.0 * o - 10.0 + 1e-3 * (70.0 * o).sin()).collect();
        let error: Vec<f64> = short.iter().zip(&ramp).map(|(o, t)| t / 3e4 - 3e-4 * (9.0 * o).sin()).collect();
        let reached: Vec<f64> = short.iter().zip(&error).map(|(o, e)| o + e).collect();
        let says = torque_says(&error, &reached, &ramp, &vec![0.0; 300]).unwrap();
        assert!(says.1 <= CLEAR, "{says:?}");
    }
}
