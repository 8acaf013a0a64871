//! A channel that is read more slowly than the log is written, and repeated in between: one value for several rows, all
//! along.
//!
//! A change of the load between two readings moves the drive, and the column does not show it. A load that is put on in
//! steps as long as these moves the error in the very row of a step, and is left alone. An angle that is repeated is
//! as old as the row is late: only rows with a new one show an error. One that stands because it is read in coarse
//! counts goes on by single counts.
//!
//! A torque that is written in coarse steps stands likewise: laws of the load would see steps that the drive does not
//! make. Where the column goes from one step to the next the load is halfway between them: a curve through these
//! points, within half a step of what is written, stands in. A load that is put on in steps is left alone here, too.

use std::ops::Range;

use super::resolution::lattice;
use super::{Findings, largest_torque, marked, rhythm, straight};
use crate::measurement::columns::Quantity;
use crate::measurement::cubic_at_zero;
use crate::measurement::fault::{FaultName, Treatment};
use crate::measurement::gear::Gear;
use crate::measurement::log::Log;
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
pub(in crate::measurement) fn check(log: &mut Log, gear: &Gear, findings: &mut Findings) {
    for channel in [Quantity::Torque, Quantity::Generator, Quantity::Output] {
        let values = if channel == Quantity::Output { log.output_rad(gear.ratio) } else { log.of(channel).to_vec() };
        // But for round-off.
        let same = SAME * values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        let runs = log.runs(&values, 1, |a, b| (a - b).abs() <= same);
        let Some(every) = repeats(log, &runs) else { continue };
        let is_torque = channel == Quantity::Torque;
        let is_as_it_was = if is_torque {
            every >= NO_STEPS_OF_A_BENCH && !goes_on_between(log, &runs)
        } else {
            counts(log, &values, &runs)
        };
        if is_as_it_was {
            continue;
        }
        let (treatment, meanwhile) = if is_torque {
            (Treatment::Repaired, ", while the load goes on: a straight line from one to the next stands in")
        } else {
            (Treatment::Masked, " while the drive moves on: rows that repeat one are left out")
        };
        findings.add(log.fault(FaultName::FrozenChannel, 0..log.len()), channel, treatment, |fault| {
            fault.rows = runs.iter().map(|run| run.len() as u64 - 1).sum();
            fault.measures.every_rows = Some(every as u64);
            format!("the {channel} has a new value in one of {every} rows, and is repeated in the others{meanwhile}")
        });
        if is_torque {
            let mut torque = values;
            let pairs = runs.windows(2).filter(|pair| log.continues(pair[1].start));
            pairs.for_each(|pair| straight(&mut torque, pair[0].start, pair[1].start));
            log.put(channel, torque);
        } else {
            // Where it stands for longer, it is the drive that stands.
            let short = runs.into_iter().filter(|run| run.len() <= 2 * every);
            log.leave_out(&marked(log.len(), short.flat_map(|run| run.start + 1..run.end)));
        }
    }
}

/// Rows from one new value to the next, if most runs of one value are as long.
fn repeats(log: &Log, runs: &[Range<usize>]) -> Option<usize> {
    // The first and the last of a session are cut.
    let inner = runs.iter().filter(|run| log.continues(run.start) && log.continues(run.end));
    let lengths: Vec<f64> = inner.map(|run| run.len() as f64).collect();
    let enough = lengths.len() >= FEWEST_RUNS;
    let every = rhythm(lengths, REGULAR, |rows, every| rows == every || rows == 2.0 * every)?;
    (enough && every <= LONGEST).then_some(every)
}

/// Whether an angle stands because it is read in coarse counts.
fn counts(log: &Log, angle: &[f64], runs: &[Range<usize>]) -> bool {
    let session = log.sessions().max_by_key(Range::len).unwrap_or_default();
    let pairs = runs.windows(2).filter(|pair| pair[0].start >= session.start && pair[1].end <= session.end);
    let steps = pairs.map(|pair| (angle[pair[1].start] - angle[pair[0].start]).abs());
    lattice(&angle[session.clone()]).is_some_and(|count| {
        let mut steps: Vec<f64> = steps.map(|step| step / count).collect();
        let mut off: Vec<f64> = steps.iter().map(|step| (step - step.round()).abs()).collect();
        median_of(&mut off) < WHOLE && median_of(&mut steps) < COUNTS
    })
}

/// Whether the error goes on from run to run, instead of changing with the torque within a row. Where the torque
/// changes its sign the flank does, and those do not count.
fn goes_on_between(log: &Log, runs: &[Range<usize>]) -> bool {
    let (torque, error) = (log.of(Quantity::Torque), log.of(Quantity::Error));
    let level = |rows: &Range<usize>| error[rows.clone()].iter().sum::<f64>() / rows.len() as f64;
    let (mut within, mut in_all) = (0.0, 0.0);
    for pair in runs.windows(2).filter(|pair| log.continues(pair[1].start)) {
        let [low, high] = [torque[pair[0].start], torque[pair[1].start]];
        if low * high > 0.0 {
            // Large changes say more than small ones.
            within += (high - low) * (error[pair[1].start] - error[pair[1].start - 1]);
            in_all += (high - low) * (level(&pair[1]) - level(&pair[0]));
        }
    }
    in_all > 0.0 && within < WITHIN_THE_ROW * in_all
}

/// Steps of less than this share of the largest load are no matter: those of eight bits are. *Guess*.
const LEAST_STEP: f64 = 0.004;
/// A change by more steps than this is by more than one. *Source*: derived, half way between one step and two.
const MORE_THAN_ONE: f64 = 1.5;
/// Changes to and fro between the same two steps within this many rows are one, which noise has torn. *Guess*.
const TORN_ROWS: usize = 12;
/// A step that lasts this many times as long as most says little of the load: its rows are left out. *Guess*.
const LONG: f64 = 8.0;
/// Rows far from a change are left out as long as this share of the rows stays. *Guess*: fewer would leave little to
/// diagnose.
const STAYS: f64 = 0.5;

/// Where the load is known: between two rows (in rows), and how large it is there, N·m.
type Known = (f64, f64);

/// Names a torque in coarse steps, and puts the load between them in its place.
pub(in crate::measurement) fn check_coarse_torque(log: &mut Log, findings: &mut Findings) {
    let torque = log.of(Quantity::Torque);
    // A session of few loads shows a multiple of the step.
    let Some(step) = log.pieces(torque).filter_map(lattice).min_by(f64::total_cmp) else { return };
    // Steps that the error makes, too, are those of the load.
    if step < LEAST_STEP * largest_torque(log) || !goes_on_between(log, &log.runs(torque, 1, |a, b| a == b)) {
        return;
    }
    let fault = log.fault(FaultName::Quantisation, 0..log.len());
    let known = stretches(log, torque, step);
    let pairs = known.iter().flat_map(|known| known.windows(2));
    let mut lasting: Vec<f64> = pairs.map(|pair| pair[1].0 - pair[0].0).collect();
    let long = LONG * median_of(&mut lasting);
    let (mut torque, mut drop) = (torque.to_vec(), vec![true; log.len()]);
    known.iter().for_each(|known| between(&mut torque, known, step, long, &mut drop));
    log.put(Quantity::Torque, torque);
    let out = drop.iter().filter(|out| **out).count();
    let is_few = (out as f64) < (1.0 - STAYS) * log.len() as f64;
    if is_few {
        log.leave_out(&drop);
    }
    let left_out =
        if is_few && out > 0 { format!("; {out} rows far from any such point are left out") } else { String::new() };
    findings.add(fault, Quantity::Torque, Treatment::Repaired, |_| {
        format!(
            "the torque is written in steps of {step:.3} N·m, and the load goes on between them: where it goes from \
             one to the next it is halfway, and a curve through these points stands in{left_out}"
        )
    });
}

/// Where the load is known, in stretches of a session without a change by more than one step: there it is put on, or
/// goes on too fast.
fn stretches(log: &Log, torque: &[f64], step: f64) -> Vec<Vec<Known>> {
    let changes: Vec<usize> =
        (1..torque.len()).filter(|row| torque[*row] != torque[row - 1] || !log.continues(*row)).collect();
    let middle = |row: usize| 0.5 * (torque[row] + torque[row - 1]);
    let put_on = |row: &usize| (torque[*row] - torque[row - 1]).abs() > MORE_THAN_ONE * step || !log.continues(*row);
    let known = |torn: &[usize]| (0.5 * (torn[0] + torn[torn.len() - 1]) as f64 - 0.5, middle(torn[0]));
    let stretch = |changes: &[usize]| {
        let is_torn = |a: &usize, b: &usize| middle(*a) == middle(*b) && b - a <= TORN_ROWS;
        changes.chunk_by(is_torn).map(known).collect()
    };
    changes.split(put_on).map(stretch).collect()
}

/// Puts curves through four places each where the load is known in the place of the torque, within half a step of it,
/// and says of which rows: not those of a step that lasts `long`.
fn between(torque: &mut [f64], known: &[Known], step: f64, long: f64, drop: &mut [bool]) {
    for four in known.windows(4) {
        let (from, to) = (four[1].0, four[2].0);
        for row in from.ceil() as usize..=to.floor() as usize {
            let curve = cubic_at_zero([0, 1, 2, 3].map(|k| (four[k].0 - row as f64, four[k].1)));
            torque[row] = curve.clamp(torque[row] - 0.5 * step, torque[row] + 0.5 * step);
            drop[row] = to - from > long;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::Session;

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
        Log::on(sessions, |log| check(log, &Gear::of_ratio(100.0), &mut findings));
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

#[cfg(test)]
mod tests_of_a_coarse_torque {
    use super::*;
    use crate::measurement::Session;

    /// A load that swings, the error it makes (30 µrad per N·m and some noise), and what a column in steps of `step`
    /// says of the load.
    fn sessions(step: f64, load: impl Fn(f64) -> f64, felt: impl Fn(f64) -> f64) -> Vec<Session> {
        let mut random = fastrand::Rng::with_seed(6);
        let times = || (0..6000).map(|k| 0.01 * f64::from(k));
        let error = |t: f64, random: &mut fastrand::Rng| 3e-5 * felt(t) + 5e-6 * (random.f64() - 0.5);
        vec![Session {
            line: (2..6002).collect(),
            generator_rad: times().map(|t| 4.0 * t).collect(),
            error_rad: times().map(|t| error(t, &mut random)).collect(),
            torque_n_m: Some(times().map(|t| (load(t) / step).round() * step).collect()),
            ..Session::default()
        }]
    }

    fn on(sessions: &mut [Session], findings: &mut Findings) {
        Log::on(sessions, |log| check_coarse_torque(log, findings));
    }

    #[test]
    fn a_load_between_coarse_steps_is_read_off_and_one_in_steps_is_left_alone() {
        let load = |t: f64| 25.0 * (0.9 * t).sin() + 6.0 * (2.3 * t).cos();
        let mut rounded = sessions(5.0, load, load);
        let mut findings = Findings::default();
        on(&mut rounded, &mut findings);
        let fault = findings.faults.pop().expect("a fault");
        assert_eq!((fault.name, fault.channel), (FaultName::Quantisation, Some(Quantity::Torque)));
        let of = &rounded[0];
        let off = |k: usize| of.torque_n_m.as_ref().unwrap()[k] - load(0.01 * (of.line[k] - 2) as f64);
        let rms = ((0..of.len()).map(|k| off(k).powi(2)).sum::<f64>() / of.len() as f64).sqrt();
        // Rounding leaves 5/√12 = 1.44.
        assert!(rms < 0.25 && of.len() > 4500, "{rms} in {} rows", of.len());
        let in_steps = |t: f64| (load(t) / 5.0).round() * 5.0;
        let mut put_on = sessions(5.0, in_steps, in_steps);
        let before = put_on.clone();
        on(&mut put_on, &mut findings);
        assert!(findings.faults.is_empty() && put_on == before);
        // Digits are no steps.
        let mut fine = sessions(1e-3, load, load);
        on(&mut fine, &mut findings);
        assert!(findings.faults.is_empty());
    }
}
