//! Angles that begin anew after a turn, made continuous.

use std::f64::consts::TAU;

use super::Findings;
use crate::measurement::columns::{MappedColumn, Quantity, Unit};
use crate::measurement::fault::{FaultName, Treatment};
use crate::measurement::log::Log;
use crate::measurement::rollover::{COVERED, LEAPS, UNAMBIGUOUS, stays_within};
use flexspline_base::robust::{least_and_most, quantile_of};

/// The columns are exchanged if this share of what an exchange gives is there. *Guess*: clearance takes the rest of a
/// small motion.
const EXCHANGED: f64 = 0.75;
/// Times that a column must begin anew before a unit other than the one given is believed. *Guess*: once may be a stray
/// value.
const OFTEN: usize = 3;
/// A unit other than the one given is believed of a column that covers this share of its turn. *Guess*: a column that
/// begins anew at another size leaves more out.
const COVERED_BY_ANOTHER: f64 = 0.98;
/// A step that differs from the one before by less than this share of a turn goes on as it did; where files are joined
/// without a time between them, it does not. *Guess*: half of what leaves the turn open.
const GOES_ON: f64 = 0.25;
/// Teeth do not skip by more than this number of motor turns in a row. *Guess*: two pitches are one turn, so that these
/// are seven pitches.
const MOST_SKIPPED: f64 = 3.5;

/// Finds wrapped angles (also in a unit other than the one given, which is a fault) and unwraps them.
pub(in crate::measurement) fn unwrap(log: &mut Log, columns: &[MappedColumn], ratio: f64, findings: &mut Findings) {
    // The output first: it is slow, and shows how far a fast generator has turned.
    for channel in [Quantity::Output, Quantity::Orientation, Quantity::Generator] {
        let Some(column) = columns.iter().find(|column| column.quantity == channel) else { continue };
        let Some(values) = log.get(channel) else { continue };
        let travel = log
            .get(Quantity::Output)
            .filter(|_| channel == Quantity::Generator)
            .map_or(0.0, |output| span_of(output) * ratio.abs());
        // An output that turns by the ratio times as much is the generator: columns taken for each other, and not an
        // angle that began anew.
        let leaps = values.windows(2).any(|pair| (pair[1] - pair[0]).abs() > 0.5 * TAU);
        if !leaps && travel > EXCHANGED * ratio.powi(2) * span_of(values) {
            continue;
        }
        let Some(unit) = wrapped_at(values, column.unit, travel, log) else { continue };
        let scale = unit.factor() / column.unit.factor();
        if unit != column.unit {
            let all = log.fault(FaultName::UnitMismatch, 0..log.len());
            findings.add(all, channel, Treatment::Repaired, |_| {
                let after = TAU / unit.factor();
                format!(
                    "{} begins anew after {after:.6} {}, one turn in {unit}: it is read in {unit}",
                    column.name, column.unit
                )
            });
        }
        let Some(mut values) = log.take(channel) else { continue };
        values.iter_mut().for_each(|value| *value *= scale);
        let output = log.get(Quantity::Output).filter(|_| channel == Quantity::Generator);
        let helped = output.is_some();
        let ambiguous = along(&mut values, log, ratio, output);
        findings.notes.push(format!("{} is within one turn: it was made continuous", column.name));
        if ambiguous {
            findings.notes.push(format!(
                "{} moves by more than {UNAMBIGUOUS} turns from row to row: {}",
                column.name,
                if helped { "turns are counted by the output angle" } else { "the count of its turns is not certain" }
            ));
        }
        log.put(channel, values);
    }
}

/// From the least to the largest of some values.
fn span_of(values: &[f64]) -> f64 {
    let (least, most) = least_and_most(values.iter().copied());
    most - least
}

/// The unit in which a column stays within one turn and begins anew, as it shows by its steps, or by the output, which
/// has travelled so far.
fn wrapped_at(values: &[f64], unit: Unit, travel_rad: f64, log: &Log) -> Option<Unit> {
    let range = span_of(values);
    let again = |turn: f64| {
        let leaps = (1..values.len()).filter(|row| (values[*row] - values[*row - 1]).abs() > LEAPS * turn);
        leaps.filter(|row| log.continues(*row)).take(OFTEN).count()
    };
    let turn_of = |candidate: Unit| TAU / candidate.factor() * unit.factor();
    if stays_within(range, turn_of(unit), COVERED) && (again(TAU) > 0 || travel_rad > 1.5 * TAU) {
        return Some(unit);
    }
    let mut others = Unit::ANGLES.into_iter().filter(|candidate| *candidate != unit);
    others.find(|other| stays_within(range, turn_of(*other), COVERED_BY_ANOTHER) && again(turn_of(*other)) >= OFTEN)
}

/// Makes `values` continuous. `output`, if given, is continuous and turns `ratio` times slower; it counts turns where
/// one row is too far from the next, where a session begins, and at the very first row. Returns whether rows are too
/// far apart.
fn along(values: &mut [f64], log: &Log, ratio: f64, output: Option<&[f64]>) -> bool {
    let nearest = |d: f64| d - TAU * (d / TAU).round();
    let mut steps: Vec<f64> = match output {
        Some(output) => output.windows(2).map(|o| ((o[1] - o[0]) * ratio).abs()).collect(),
        None => values.windows(2).map(|v| nearest(v[1] - v[0]).abs()).collect(),
    };
    let fast = quantile_of(&mut steps, 0.99) > UNAMBIGUOUS * TAU;
    if let Some(output) = output {
        values[0] += TAU * ((output[0] * ratio - values[0]) / TAU).round();
    }
    let mut last = 0.0;
    for row in 1..values.len() {
        let plain = nearest(values[row] - values[row - 1]);
        let expected = output.map_or(plain, |output| (output[row] - output[row - 1]) * ratio);
        let far = (expected - plain).abs() > MOST_SKIPPED * TAU;
        let step = match output {
            // What goes on as it did needs no help: there it is the output that may skip, by some teeth.
            Some(_) if fast || far || !log.continues(row) || (plain - last).abs() > GOES_ON * TAU => {
                expected + nearest(values[row] - values[row - 1] - expected)
            }
            _ => plain,
        };
        values[row] = values[row - 1] + step;
        last = step;
    }
    fast
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_files_joined_without_a_time_are_made_continuous_without_a_jump_of_a_turn() {
        let ratio = 100.0;
        // The drive went on by 0.7 output turns between the two.
        let psi: Vec<f64> = (0..2000).map(|k| 0.11 * f64::from(k) + if k < 1000 { 0.0 } else { 70.3 * TAU }).collect();
        let output: Vec<f64> = psi.iter().map(|psi| psi / ratio).collect();
        let mut log = Log::default();
        log.line = (0..2000).collect();
        let mut wrapped: Vec<f64> = psi.iter().map(|psi| psi.rem_euclid(TAU)).collect();
        along(&mut wrapped, &log, ratio, Some(&output));
        let apart = wrapped.iter().zip(&psi).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-6, "{apart}");
        // Teeth that skip by two pitches, which is a turn of the motor, stay where they are: in the output.
        let skipped: Vec<f64> =
            (0..2000).map(|k| 0.0011 * f64::from(k) + if k < 1000 { 0.0 } else { TAU / ratio }).collect();
        let mut wrapped: Vec<f64> = (0..2000).map(|k| (0.11 * f64::from(k)).rem_euclid(TAU)).collect();
        along(&mut wrapped, &log, ratio, Some(&skipped));
        assert!((wrapped[1999] - wrapped[0] - 0.11 * 1999.0).abs() < 1e-6);
    }
}
