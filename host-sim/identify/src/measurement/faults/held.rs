//! A channel that is read more slowly than the log is written, and repeated in between: one value for several rows, all
//! along.
//!
//! A change of the load between two readings moves the drive, and the column does not show it. A load that is put on in
//! steps as long as these moves the error in the very row of a step, and is left alone. An angle that is repeated is
//! as old as the row is late: only rows with a new one show an error. One that stands because it is read in coarse
//! counts goes on by single counts.

use std::ops::Range;

use super::lattice::lattice;
use super::{Findings, leave_out_rows, rhythm, runs, straight, throughout};
use crate::measurement::Session;
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{Fault, FaultName, Measures, Treatment};
use crate::measurement::gear::Gear;
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
/// the load goes on between. *Guess*.
const WITHIN_THE_ROW: f64 = 0.5;

/// Readings go on by this number of counts from one to the next, at the median, where it is not the counts that make an
/// angle stand. *Guess*.
const COUNTS: f64 = 4.0;
/// They are whole counts within this: an even motion goes by even steps, and not by the same to the last digit.
/// *Guess*.
const WHOLE: f64 = 2e-3;
/// Two values of an angle that are this near each other are the same, against the largest: round-off of a sum.
/// *Guess*.
const SAME: f64 = 1e-13;

/// Names channels that are repeated from row to row: a straight line takes the place of what is repeated of a torque,
/// and rows that repeat an angle are left out.
pub(in crate::measurement) fn check(sessions: &mut [Session], gear: &Gear, findings: &mut Findings) {
    for channel in [Quantity::Torque, Quantity::Generator, Quantity::Output] {
        let values: Vec<Vec<f64>> = sessions
            .iter()
            .map(|session| match channel {
                Quantity::Torque => session.torque_n_m.clone().unwrap_or_default(),
                Quantity::Generator => session.generator_rad.clone(),
                _ => session.output_rad(gear.ratio),
            })
            .collect();
        let of: Vec<Runs> = values.iter().map(|values| runs_of(values)).collect();
        let Some((every, fault)) = repeats(sessions, &of) else { continue };
        let is_torque = channel == Quantity::Torque;
        let is_as_it_was = if is_torque {
            every >= NO_STEPS_OF_A_BENCH && !goes_on_between(sessions, &of)
        } else {
            values.iter().zip(&of).max_by_key(|(angle, _)| angle.len()).is_some_and(|(angle, runs)| counts(angle, runs))
        };
        if is_as_it_was {
            continue;
        }
        let (treatment, meanwhile) = if is_torque {
            (Treatment::Repaired, ", while the load goes on: a straight line from one to the next stands in")
        } else {
            (Treatment::Masked, " while the drive moves on: rows that repeat one are left out")
        };
        findings.add(Some(fault), channel, treatment, |_| {
            format!("the {channel} has a new value in one of {every} rows, and is repeated in the others{meanwhile}")
        });
        if is_torque {
            for (session, runs) in sessions.iter_mut().zip(&of) {
                let Some(torque) = &mut session.torque_n_m else { continue };
                runs.windows(2).for_each(|pair| straight(torque, pair[0].start, pair[1].start));
            }
        } else {
            // Where it stands for longer, it is the drive that stands.
            let short = |runs: &Runs| runs.clone().into_iter().filter(|run| run.len() <= 2 * every);
            leave_out_rows(sessions, of.iter().map(|runs| short(runs).flat_map(|run| run.start + 1..run.end)));
        }
    }
}

/// Runs of one value of a channel in a session.
pub(super) type Runs = Vec<Range<usize>>;

/// Runs of one value, but for round-off.
fn runs_of(values: &[f64]) -> Runs {
    let same = SAME * values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    runs(values, |a, b| (a - b).abs() <= same)
}

/// Rows from one new value to the next, if most runs of one value are as long; with the fault of it, to be completed.
fn repeats(sessions: &[Session], of: &[Runs]) -> Option<(usize, Fault)> {
    // The first and the last of a session are cut.
    let inner = of.iter().flat_map(|runs| runs.get(1..runs.len().saturating_sub(1)).unwrap_or_default());
    let lengths: Vec<f64> = inner.map(|run| run.len() as f64).collect();
    let enough = lengths.len() >= FEWEST_RUNS;
    let every = rhythm(lengths, REGULAR, |rows, every| rows == every || rows == 2.0 * every)?;
    let rows = of.iter().flatten().map(|run| run.len() as u64 - 1).sum();
    let measures = Measures { every_rows: Some(every as u64), ..Measures::default() };
    let fault = throughout(sessions, FaultName::FrozenChannel).filter(|_| enough && every <= LONGEST)?;
    Some((every, Fault { rows, measures, ..fault }))
}

/// Whether an angle stands because it is read in coarse counts.
fn counts(angle: &[f64], runs: &[Range<usize>]) -> bool {
    let steps = runs.windows(2).map(|pair| (angle[pair[1].start] - angle[pair[0].start]).abs());
    lattice(angle).is_some_and(|count| {
        let mut steps: Vec<f64> = steps.map(|step| step / count).collect();
        let mut off: Vec<f64> = steps.iter().map(|step| (step - step.round()).abs()).collect();
        median_of(&mut off) < WHOLE && median_of(&mut steps) < COUNTS
    })
}

/// Whether the error goes on from run to run, instead of changing with the torque within a row. Where the torque
/// changes its sign the flank does, and those do not count.
pub(super) fn goes_on_between(sessions: &[Session], of: &[Runs]) -> bool {
    let (mut within, mut in_all) = (0.0, 0.0);
    for (session, runs) in sessions.iter().zip(of) {
        let (torque, error) = (session.torque_n_m.as_deref().unwrap_or_default(), &session.error_rad);
        let level = |rows: &Range<usize>| error[rows.clone()].iter().sum::<f64>() / rows.len() as f64;
        for pair in runs.windows(2) {
            let [low, high] = [torque[pair[0].start], torque[pair[1].start]];
            if low * high > 0.0 {
                // Large changes say more than small ones.
                within += (high - low) * (error[pair[1].start] - error[pair[1].start - 1]);
                in_all += (high - low) * (level(&pair[1]) - level(&pair[0]));
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

    /// Rows of a drive that a load moves by 30 µrad per N·m; `read` is the column in a row.
    fn sessions(felt: impl Fn(usize) -> f64, read: impl Fn(usize) -> f64) -> Vec<Session> {
        let mut random = fastrand::Rng::with_seed(6);
        vec![Session {
            line: (2..6002).collect(),
            generator_rad: (0..6000).map(|k| 0.04 * f64::from(k)).collect(),
            error_rad: (0..6000).map(|k| 3e-5 * felt(k) + 5e-6 * (random.f64() - 0.5)).collect(),
            torque_n_m: Some((0..6000).map(read).collect()),
            ..Session::default()
        }]
    }

    fn found(sessions: &mut [Session]) -> Option<(FaultName, Option<u64>)> {
        let mut findings = Findings::default();
        check(sessions, &Gear::of_ratio(100.0), &mut findings);
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

    /// A drive of ratio 100 whose generator turns by 0.04 rad in a row; its output is read as `read` says of its angle
    /// in each row.
    fn read_as(read: impl Fn(&dyn Fn(usize) -> f64, usize) -> f64) -> Vec<Session> {
        let output = |row: usize| 4e-4 * row as f64 + 5e-5 * (0.04 * row as f64).sin();
        let generator = |row: usize| 0.04 * row as f64;
        vec![Session {
            line: (2..6002).collect(),
            generator_rad: (0..6000).map(generator).collect(),
            error_rad: (0..6000).map(|row| read(&output, row) - generator(row) / 100.0).collect(),
            ..Session::default()
        }]
    }

    #[test]
    fn rows_that_repeat_an_angle_are_left_out_and_those_of_coarse_counts_are_not() {
        let mut held = read_as(|output, row| output(row / 5 * 5));
        assert_eq!(found(&mut held), Some((FaultName::FrozenChannel, Some(5))));
        assert_eq!(held[0].len(), 1200);
        let largest = held[0].error_rad.iter().fold(0.0, |largest: f64, error| largest.max(error.abs()));
        assert!(largest < 5.1e-5, "{largest}: as old as the row is");
        // 2e-3 rad are five rows.
        let mut coarse = read_as(|output, row| 2e-3 * (output(row) / 2e-3).round());
        assert_eq!(found(&mut coarse), None);
        assert_eq!(coarse[0].len(), 6000);
    }

    #[test]
    fn a_load_that_is_put_on_in_steps_is_one() {
        let steps = |row: usize| load(0.01 * (row / 20 * 20) as f64);
        assert_eq!(found(&mut sessions(steps, steps)), None);
    }
}
