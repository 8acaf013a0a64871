//! Values that were not recorded.

use super::{Findings, marked, straight};
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{Fault, FaultName, Treatment};
use crate::measurement::log::Log;

/// Missing rows one after another that are filled by a straight line, except in the angles. *Guess*: torque and
/// temperature hardly bend within ten.
const LONGEST_FILL: usize = 10;

/// Fills short holes of time, torque, temperature and orientation, leaves out a channel of which more than half is
/// missing.
pub(in crate::measurement) fn fill(log: &mut Log, findings: &mut Findings) {
    let rows = log.len();
    for channel in [Quantity::Time, Quantity::Torque, Quantity::Temperature, Quantity::Orientation] {
        let holes = holes(log, channel);
        let fault = log.fault(FaultName::MissingSamples, holes.iter().copied());
        let Some(values) = log.get_mut(channel) else { continue };
        if 2 * holes.len() > rows {
            log.take(channel);
            let fault = fault.map(|fault| Fault { time_s: None, until_s: None, ..fault });
            findings.add(fault, channel, Treatment::Masked, |fault| {
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
