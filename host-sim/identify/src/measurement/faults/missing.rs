//! Values that were not recorded.

use super::{Findings, span};
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{FaultName, Treatment};
use crate::measurement::log::Log;

/// Missing rows one after another that are filled by a straight line, except in the angles. *Guess*: torque and
/// temperature hardly bend within ten.
const LONGEST_FILL: usize = 10;

/// Fills short holes of time, torque, temperature and orientation, leaves out a channel of which more than half is
/// missing.
pub(in crate::measurement) fn fill(log: &mut Log, findings: &mut Findings) {
    let rows = log.len();
    for channel in [Quantity::Time, Quantity::Torque, Quantity::Temperature, Quantity::Orientation] {
        let Some(values) = log.get(channel) else { continue };
        let holes: Vec<usize> = (0..rows).filter(|row| !values[*row].is_finite()).collect();
        let (Some(&first), Some(&last)) = (holes.first(), holes.last()) else { continue };
        let mut fault = span(log, FaultName::MissingSamples, first, last);
        (fault.channel, fault.rows) = (Some(channel), holes.len() as u64);
        if 2 * holes.len() > rows {
            log.take(channel);
            (fault.time_s, fault.until_s) = (None, None);
            fault.treatment = Treatment::Masked;
            fault.what = format!("{} of {rows} values of the {channel} are missing: it is not used", holes.len());
            findings.faults.push(fault);
            continue;
        }
        let Some(values) = log.get_mut(channel) else { continue };
        let mut left = 0;
        for hole in holes.chunk_by(|a, b| a + 1 == *b) {
            let (begin, end) = (hole[0], hole[hole.len() - 1] + 1);
            if begin == 0 || end == rows || hole.len() > LONGEST_FILL {
                left += hole.len();
                continue;
            }
            let (from, to) = (values[begin - 1], values[end]);
            for row in begin..end {
                let part = (row + 1 - begin) as f64 / (end + 1 - begin) as f64;
                values[row] = from + part * (to - from);
            }
        }
        fault.treatment = if left == 0 { Treatment::Repaired } else { Treatment::Masked };
        fault.what = format!(
            "{} values of the {channel} are missing or not finite: holes of up to {LONGEST_FILL} rows are filled by a \
             straight line, {left} rows left out",
            holes.len()
        );
        findings.faults.push(fault);
    }
    // The clock is judged on rows that have a time.
    let timeless: Vec<bool> =
        log.get(Quantity::Time).map_or_else(Vec::new, |t| t.iter().map(|t| !t.is_finite()).collect());
    if timeless.contains(&true) {
        log.leave_out(&timeless);
    }
}

/// Leaves out rows without an angle, or in a long hole of another channel.
pub(in crate::measurement) fn leave_out(log: &mut Log, findings: &mut Findings) {
    let rows = log.len();
    let mut drop = vec![false; rows];
    for channel in Quantity::ALL {
        let Some(values) = log.get(channel) else { continue };
        let holes = || (0..rows).filter(|row| !values[*row].is_finite());
        let (Some(first), Some(last)) = (holes().next(), holes().next_back()) else { continue };
        let count = holes().count();
        if matches!(channel, Quantity::Generator | Quantity::Output | Quantity::Error) {
            let mut fault = span(log, FaultName::MissingSamples, first, last);
            (fault.channel, fault.rows, fault.treatment) = (Some(channel), count as u64, Treatment::Masked);
            fault.what = format!("{count} values of the {channel} are missing or not finite: their rows are left out");
            findings.faults.push(fault);
        }
        holes().for_each(|row| drop[row] = true);
    }
    if drop.contains(&true) {
        log.leave_out(&drop);
    }
}
