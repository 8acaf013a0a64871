//! A torque that is read more slowly than the angles, and repeated in between: one value for so many rows, all along.
//!
//! What the load does between two readings moves the drive, and the column does not say it. A load that is put on in
//! steps as long as these moves the error in the very row of a step, and is left alone.

use std::ops::Range;

use super::{Findings, of_rows};
use crate::measurement::Session;
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{FaultName, Measures, Treatment};
use flexspline_base::robust::median_of;

/// Runs of one value that show a rhythm, at least. *Guess*.
const FEWEST_RUNS: usize = 40;
/// Share of the runs that are as long as most are, or twice as long, where a reading repeats the one before. *Guess*.
const REGULAR: f64 = 0.8;
/// Longest runs, rows: a load that is held for longer is a load. *Guess*.
const LONGEST: usize = 64;
/// Where runs are shorter than this no bench puts the load on in such steps. *Guess*.
const NO_STEPS_OF_A_BENCH: usize = 5;
/// Share of what the error changes by from run to run that it changes by in the very row where the load does: below,
/// the load goes on between.
/// *Guess*.
const WITHIN_THE_ROW: f64 = 0.5;

/// Names a torque that is repeated from row to row, and puts a straight line between its readings.
pub(in crate::measurement) fn check(sessions: &mut [Session], findings: &mut Findings) {
    let of: Vec<Vec<Range<usize>>> =
        sessions.iter().map(|session| session.torque_n_m.as_deref().map_or_else(Vec::new, runs)).collect();
    // The first and the last of a session are cut.
    let inner = || of.iter().flat_map(|runs| runs.get(1..runs.len().saturating_sub(1)).unwrap_or_default());
    let mut lengths: Vec<f64> = inner().map(|run| run.len() as f64).collect();
    let every = median_of(&mut lengths) as usize;
    let regular = inner().filter(|run| run.len() == every || run.len() == 2 * every).count();
    if lengths.len() < FEWEST_RUNS
        || !(2..=LONGEST).contains(&every)
        || (regular as f64) < REGULAR * lengths.len() as f64
        || (every >= NO_STEPS_OF_A_BENCH && !goes_on_between(sessions, &of))
    {
        return;
    }
    let (Some(first), Some(last)) = (sessions.first(), sessions.last()) else { return };
    let mut fault = of_rows(first, FaultName::FrozenChannel, 0..first.len());
    fault.last_line = last.line[last.len() - 1];
    fault.until_s = last.time_s.as_ref().and_then(|time| time.last().copied());
    fault.rows = of.iter().flatten().map(|run| run.len() as u64 - 1).sum();
    (fault.channel, fault.treatment) = (Some(Quantity::Torque), Treatment::Repaired);
    fault.measures = Measures { every_rows: Some(every as u64), ..Measures::default() };
    fault.what = format!(
        "the torque has a new value in one of {every} rows, and is repeated in the others, while the load goes on: a \
         straight line from one to the next stands in"
    );
    findings.faults.push(fault);
    for (session, runs) in sessions.iter_mut().zip(&of) {
        let Some(torque) = &mut session.torque_n_m else { continue };
        for pair in runs.windows(2) {
            let (from, to) = (pair[0].start, pair[1].start);
            let (low, high) = (torque[from], torque[to]);
            for row in from + 1..to {
                torque[row] = low + (high - low) * (row - from) as f64 / (to - from) as f64;
            }
        }
    }
}

/// Runs of rows with one value.
fn runs(values: &[f64]) -> Vec<Range<usize>> {
    let mut from = 0;
    let ends = (1..=values.len()).filter(|row| *row == values.len() || values[*row] != values[*row - 1]);
    ends.map(|end| std::mem::replace(&mut from, end)..end).collect()
}

/// Whether the error goes on from run to run, instead of changing with the torque within a row. Where the torque
/// changes its sign the flank does, and those do not count.
fn goes_on_between(sessions: &[Session], of: &[Vec<Range<usize>>]) -> bool {
    let (mut within, mut in_all) = (0.0, 0.0);
    for (session, runs) in sessions.iter().zip(of) {
        let Some(torque) = session.torque_n_m.as_deref() else { continue };
        let level = |rows: &Range<usize>| session.error_rad[rows.clone()].iter().sum::<f64>() / rows.len() as f64;
        for pair in runs.windows(2) {
            let (before, after) = (&pair[0], &pair[1]);
            let (low, high) = (torque[before.start], torque[after.start]);
            if low * high > 0.0 {
                // Large changes say more than small ones.
                within += (high - low) * (session.error_rad[after.start] - session.error_rad[after.start - 1]);
                in_all += (high - low) * (level(after) - level(before));
            }
        }
    }
    in_all > 0.0 && within < WITHIN_THE_ROW * in_all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn load(t: f64) -> f64 {
        25.0 * (0.9 * t).sin() + 6.0 * (2.3 * t).cos()
    }

    /// Rows of a drive that a load moves by 30 µrad per N·m; `told` is what the column says of it in a row.
    fn sessions(felt: impl Fn(usize) -> f64, told: impl Fn(usize) -> f64) -> Vec<Session> {
        let mut random = fastrand::Rng::with_seed(6);
        vec![Session {
            line: (2..6002).collect(),
            generator_rad: (0..6000).map(|k| 0.04 * f64::from(k)).collect(),
            error_rad: (0..6000).map(|k| 3e-5 * felt(k) + 5e-6 * (random.f64() - 0.5)).collect(),
            torque_n_m: Some((0..6000).map(told).collect()),
            ..Session::default()
        }]
    }

    fn found(sessions: &mut [Session]) -> Option<(FaultName, Option<u64>)> {
        let mut findings = Findings::default();
        check(sessions, &mut findings);
        findings.faults.pop().map(|fault| (fault.name, fault.measures.every_rows))
    }

    #[test]
    fn a_torque_that_is_repeated_is_told_with_its_rhythm_and_goes_on_between_its_readings() {
        let at = |row: usize| load(0.01 * row as f64);
        for every in [2, 4, 10, 20] {
            let mut held = sessions(at, |row| at(row / every * every));
            assert_eq!(found(&mut held), Some((FaultName::FrozenChannel, Some(every as u64))));
            let torque = held[0].torque_n_m.as_ref().unwrap();
            let off = (0..5900).map(|row| (torque[row] - at(row)).abs()).fold(0.0, f64::max);
            assert!(off < 0.3, "{off} N·m off, every {every}");
        }
        let mut right = sessions(at, at);
        let before = right.clone();
        assert!(found(&mut right).is_none() && right == before);
    }

    #[test]
    fn a_load_that_is_put_on_in_steps_is_one() {
        let steps = |row: usize| load(0.01 * (row / 20 * 20) as f64);
        assert_eq!(found(&mut sessions(steps, steps)), None);
    }
}
