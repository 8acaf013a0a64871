//! Values that were not recorded, for a while or in most rows.

use super::{Findings, marked, rhythm, straight};
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{FaultName, Treatment};
use crate::measurement::log::Log;

/// Missing rows one after another that are filled by a straight line, except in the angles. *Guess*: torque and
/// temperature hardly bend within ten.
const LONGEST_FILL: usize = 10;

/// Share of the distances between values that are the usual one (one row more or less), at least: a slower clock, not
/// holes. *Guess*: a clock that is slower loses a value now and then.
const REGULAR: f64 = 0.9;
/// Fewest values that show a rhythm. *Guess*: fewer may be evenly spaced by chance.
const FEWEST: usize = 8;

/// Fills the rows between the values of channels that were recorded more slowly than the angles, by straight lines.
fn fill_slower(log: &mut Log, notes: &mut Vec<String>) {
    for channel in [Quantity::Torque, Quantity::Temperature, Quantity::Orientation] {
        let Some(values) = log.get_mut(channel) else { continue };
        let there: Vec<usize> = (0..values.len()).filter(|row| values[*row].is_finite()).collect();
        let Some(every) = period_rows(&there) else { continue };
        // Beyond two of its periods values are missing, as for any channel.
        let near = there.windows(2).filter(|pair| pair[1] - pair[0] <= 2 * every);
        near.for_each(|pair| straight(values, pair[0], pair[1]));
        let (first, last, rows) = (there[0], there[there.len() - 1], values.len());
        let (at_first, at_last) = (values[first], values[last]);
        values[first.saturating_sub(every)..first].fill(at_first);
        values[last + 1..rows.min(last + 1 + every)].fill(at_last);
        notes.push(format!(
            "the {channel} has a value in one of {every} rows: between them it is a straight line, at the ends it is \
             held"
        ));
    }
}

/// One value in how many rows, if the rows with a value come regularly.
fn period_rows(there: &[usize]) -> Option<usize> {
    let distances = there.windows(2).map(|pair| (pair[1] - pair[0]) as f64).collect();
    rhythm(distances, REGULAR, |distance, every| (distance - every).abs() <= 1.0).filter(|_| there.len() >= FEWEST)
}

/// Fills short holes of time, torque, temperature and orientation, leaves out a channel of which more than half is
/// missing.
pub(in crate::measurement) fn fill(log: &mut Log, findings: &mut Findings) {
    fill_slower(log, &mut findings.notes);
    let rows = log.len();
    for channel in [Quantity::Time, Quantity::Torque, Quantity::Temperature, Quantity::Orientation] {
        let holes = holes(log, channel);
        let fault = log.fault(FaultName::MissingSamples, holes.iter().copied());
        let Some(values) = log.get_mut(channel) else { continue };
        if 2 * holes.len() > rows {
            log.take(channel);
            findings.add(fault, channel, Treatment::Masked, |fault| {
                (fault.time_s, fault.until_s) = (None, None);
                format!("{} of {rows} values of the {channel} are missing: it is not used", fault.rows)
            });
            continue;
        }
        let mut left = 0;
        for hole in holes.chunk_by(|a, b| a + 1 == *b) {
            let (begin, end) = (hole[0], hole[hole.len() - 1] + 1);
            if begin == 0 || end == rows || hole.len() > LONGEST_FILL {
                left += hole.len();
            } else {
                straight(values, begin - 1, end);
            }
        }
        let treatment = if left == 0 { Treatment::Repaired } else { Treatment::Masked };
        findings.add(fault, channel, treatment, |fault| {
            format!(
                "{} values of the {channel} are missing or not finite: holes of up to {LONGEST_FILL} rows are filled \
                 by a straight line, {left} rows left out",
                fault.rows
            )
        });
    }
    // The clock is judged on rows that have a time.
    log.leave_out(&marked(rows, holes(log, Quantity::Time)));
}

/// Rows in which a channel that was recorded has no value.
fn holes(log: &Log, channel: Quantity) -> Vec<usize> {
    let values = log.get(channel).unwrap_or_default();
    (0..values.len()).filter(|row| !values[*row].is_finite()).collect()
}

/// Leaves out rows without an angle, or in a long hole of another channel.
pub(in crate::measurement) fn leave_out(log: &mut Log, findings: &mut Findings) {
    let mut all = Vec::new();
    for channel in Quantity::ALL {
        let holes = holes(log, channel);
        if matches!(channel, Quantity::Generator | Quantity::Output | Quantity::Error) {
            let fault = log.fault(FaultName::MissingSamples, holes.iter().copied());
            findings.add(fault, channel, Treatment::Masked, |fault| {
                format!("{} values of the {channel} are missing or not finite: their rows are left out", fault.rows)
            });
        }
        all.extend(holes);
    }
    log.leave_out(&marked(log.len(), all));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slower_channel_is_distinguished_from_holes() {
        let every = |n: usize| -> Vec<f64> { (0..400).map(|k| if k % n == 3 { k as f64 } else { f64::NAN }).collect() };
        let rhythm_of = |values: &[f64]| {
            period_rows(&(0..values.len()).filter(|row| values[*row].is_finite()).collect::<Vec<usize>>())
        };
        assert_eq!(rhythm_of(&every(10)), Some(10));
        assert_eq!(rhythm_of(&every(200)), None);
        let holes: Vec<f64> = (0..400).map(|k| if k % 7 == 3 { f64::NAN } else { 1.0 }).collect();
        assert_eq!(rhythm_of(&holes), None);
        let mut log = Log::default();
        log.line = (0..400).collect();
        log.put(Quantity::Torque, every(10));
        let mut notes = Vec::new();
        fill_slower(&mut log, &mut notes);
        let filled = log.get(Quantity::Torque).unwrap();
        assert!(filled.iter().all(|value| value.is_finite()));
        assert!((filled[8] - 8.0).abs() < 1e-12 && filled[0] == 3.0 && filled[399] == 393.0);
        assert_eq!(notes.len(), 1);
    }
}
