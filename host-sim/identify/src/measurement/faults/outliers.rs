//! Single rows that neither the rows before nor those after bear out. Where most of many are off to one side of the
//! motion, they were read late.

use std::ops::Range;

use super::reads::period_s;
use super::resolution::seen;
use super::{ARCSEC, Findings, HELD, farthest, largest_torque, level, marked};
use crate::measurement::columns::Quantity;
use crate::measurement::cubic_at_zero;
use crate::measurement::fault::{Fault, FaultName, Treatment};
use crate::measurement::gear::Gear;
use crate::measurement::log::Log;
use flexspline_base::robust::{MAD_TO_STD, least_and_most, median_of, quantile_of, sampled, white_noise};

/// A row is out by this number of standard deviations of the white noise… *Guess*, raised from 8 for fewer false
/// alarms.
const OUT: f64 = 10.0;
/// …and by this multiple of what all rows around it but one are out by: ripple that rows sample too coarsely stands out
/// everywhere. *Guess*: noise alone does not stand out so far.
const OUT_OF_AROUND: f64 = 3.0;
/// And by this at least, rad at the output. *Guess*, raised from 0.1 arcsec likewise.
const LEAST_RAD: f64 = 3.0 * ARCSEC;
/// And by this number of steps of the resolution. *Guess*: rounding gives one.
const STEPS: f64 = 2.0;
/// And, in torque and temperature, by this share of the range. *Guess*: less does not matter to a model.
const LEAST_OF_RANGE: f64 = 0.05;
/// A few outliers of torque or temperature are named only if one is so large, as a share of the range: loads that
/// change from row to row give small ones. *Guess*: no load of a drive turns back by half its range within a row.
const LARGE_OF_RANGE: f64 = 0.5;
/// Width of the pulse of a tooth, rad of the generator; rows farther apart may catch it once. *Guess*: one to two tooth
/// pitches of the generator angle, 2π/z.
const TOOTH_RAD: f64 = 0.05;
/// Fewer outliers than this, or any in fast motion, are named only if they are large: teeth and kinks of the motion
/// give small ones. *Guess*: fewer show no pattern.
const FEW: usize = 4;
/// Large, rad at the output: more than a tooth or a usual clearance gives. *Guess*: two arc-minutes.
const LARGE_RAD: f64 = 120.0 * ARCSEC;
/// A load that changes by this share of its largest within the neighbouring rows moves the drive: the backlash is
/// crossed, wind-up follows. *Guess*: the order of magnitude of friction.
const SWINGS: f64 = 0.05;
/// Rows before and after that are looked at. *Guess*: the least number of which a median rejects one.
const AROUND_ONE: usize = 3;
/// Rows around, for what is usual there. *Guess*: 30 rows in all, of which few are out.
const AROUND: usize = 15;
/// If more than this share of the rows is out, these are not outliers but the noise. *Guess*: of normal rows none is.
const SHARE: f64 = 0.1;
/// If more than this share of the rows is out, others are out by less. *Guess*: of normal rows none is.
const MANY: f64 = 0.003;
/// Mean resultant length above which four or more outliers repeat with position: a damaged tooth, which is the drive.
/// *Guess*: four at random exceed it at one angle in one case of forty.
const REPEATS: f64 = 0.9;
/// Rayleigh's n R² above which many outliers repeat with position. *Source*: derived, n R² is exponential, so chance
/// gives it with exp(−12); that this is enough for six angles is a guess.
const REPEATS_MANY: f64 = 12.0;

/// How far row `row` is from the rows before and after, and from where they go on to, if all say so; 0 if one of them
/// bears it out. A load turns sharply within a row and means it, and the wind-up with it: such a tip goes on as one of
/// its sides does. It is out `by` this at most.
fn off_course(values: &[f64], row: usize, by: f64) -> f64 {
    let (before, after) = ([3, 2, 1].map(|k| values[row - k]), [3, 2, 1].map(|k| values[row + k]));
    let borne_out = [before[2], after[2], carried_on(before), carried_on(after)];
    let (low, high) = least_and_most(borne_out);
    let beyond = values[row] - values[row].clamp(low, high);
    if beyond * by <= 0.0 { 0.0 } else { by.signum() * by.abs().min(beyond.abs()) }
}

/// Where three rows go on to: their median slope (Theil and Sen) from the median of where it puts them, so that one of
/// them may be out.
fn carried_on([a, b, c]: [f64; AROUND_ONE]) -> f64 {
    let slope = median_of(&mut [b - a, c - b, 0.5 * (c - a)]);
    median_of(&mut [a + 3.0 * slope, b + 2.0 * slope, c + slope])
}

/// Whether the load moves the drive for a row: it stands out itself, or lets go of its flank next to the row, where the
/// teeth cross the clearance and strike. The row itself does not count there, as it may be the one that is wrong.
fn load_swings(torque: &[f64], row: usize, largest_n_m: f64) -> bool {
    let near = row.saturating_sub(AROUND_ONE)..(row + AROUND_ONE + 1).min(torque.len());
    let others = || near.clone().filter(|k| *k != row).map(|k| torque[k]);
    let (low, high) = least_and_most(others());
    let strikes = high - low > SWINGS * largest_n_m && others().any(|torque| torque.abs() < HELD * largest_n_m);
    strikes || out_by(torque, row).abs() > SWINGS * largest_n_m
}

/// How far row `row` is from the rows before and after, if both say so; 0 if one of them bears it out.
fn out_by(values: &[f64], row: usize) -> f64 {
    if row < AROUND_ONE || row + AROUND_ONE >= values.len() {
        return 0.0;
    }
    let middle = |from: usize| {
        let (a, b, c) = (values[from], values[from + 1], values[from + 2]);
        a.max(b).min(a.min(b).max(c))
    };
    let (before, after) = (values[row] - middle(row - AROUND_ONE), values[row] - middle(row + 1));
    if before * after <= 0.0 { 0.0 } else { before.signum() * before.abs().min(after.abs()) }
}

/// A row, and by how much it is out.
type Out = (usize, f64);

/// Rows of a channel that are out by more than `least` in their session.
fn in_sessions(log: &Log, channel: Quantity, least: f64) -> Vec<Out> {
    let of = |rows: Range<usize>| {
        let found = rows_out(log.of(channel).get(rows.clone()).unwrap_or_default(), least);
        found.into_iter().map(move |(row, by)| (rows.start + row, by))
    };
    log.sessions().flat_map(of).collect()
}

/// Rows that are out by more than `least`, and by far more than all around them but one of them.
fn rows_out(values: &[f64], least: f64) -> Vec<Out> {
    let mut found = Vec::new();
    for row in AROUND_ONE..values.len().saturating_sub(AROUND_ONE) {
        // The cheaper bound first: it is the larger one.
        let most = out_by(values, row);
        let by = if most.abs() > least { off_course(values, row, most) } else { 0.0 };
        if by.abs() <= least {
            continue;
        }
        let around = row.saturating_sub(AROUND)..(row + AROUND + 1).min(values.len());
        let mut usual: Vec<f64> = around.filter(|k| *k != row).map(|k| out_by(values, k).abs()).collect();
        usual.sort_unstable_by(f64::total_cmp);
        let usual = usual.iter().rev().nth(1).copied().unwrap_or(0.0);
        let step = (level(values, row - AROUND_ONE..row) - level(values, row + 1..row + 1 + AROUND_ONE)).abs();
        if by.abs() > OUT_OF_AROUND * usual && step < 0.5 * by.abs() {
            found.push((row, by));
        }
    }
    found
}

/// Finds outliers; rows with an outlying error are left out, other channels are mended from the neighbouring rows.
pub(in crate::measurement) fn check(log: &mut Log, gear: &Gear, findings: &mut Findings) {
    of_error(log, gear, findings);
    for channel in [Quantity::Torque, Quantity::Temperature] {
        of_load(log, channel, findings);
    }
}

/// Outliers of the error: left out, and named where they are the data's and not the drive's.
fn of_error(log: &mut Log, gear: &Gear, findings: &mut Findings) {
    let (rows, noise) = (log.len(), white_noise(log.pieces(log.of(Quantity::Error))));
    let resolution = seen(log, gear).into_iter().map(|(_, step)| step).fold(0.0, f64::max);
    let least = (OUT * noise).max(LEAST_RAD).max(STEPS * resolution);
    let largest_n_m = largest_torque(log);
    let found = in_sessions(log, Quantity::Error, least);
    let swings = |(row, _): &Out| {
        let session = log.around(*row);
        let torque = log.get(Quantity::Torque).map(|torque| &torque[session.clone()]);
        torque.is_some_and(|torque| load_swings(torque, row - session.start, largest_n_m))
    };
    let (mut moved, mut found): (Vec<Out>, Vec<Out>) = found.into_iter().partition(swings);
    for rows in [&mut moved, &mut found] {
        if rows.len() as f64 > SHARE * log.len() as f64 {
            rows.clear();
        }
    }
    let (count, number, generator) = (moved.len(), found.len(), log.of(Quantity::Generator));
    if count > 0 {
        findings.notes.push(format!(
            "{count} single rows stand out where the load swings within a row, and the drive with it; they are left out"
        ));
    }
    let fast = found.iter().all(|(row, _)| (generator[row + 1] - generator[row - 1]).abs() > 2.0 * TOOTH_RAD);
    let large = found.iter().any(|(_, by)| by.abs() > LARGE_RAD);
    let of_the_drive = if (number < FEW || fast) && !large {
        Some(": too few, or in too fast a motion, to tell drive from data")
    } else {
        let repeat = repeat_with_position(generator, &found, gear);
        repeat.then_some(", always in the same position: the drive, not the data")
    };
    if let Some(why) = of_the_drive.filter(|_| number > 0) {
        findings.notes.push(format!("{number} single rows stand out{why}"));
        found.clear();
    }
    let late_by = late_by(generator, &found);
    report(log, &found, Quantity::Error, Treatment::Masked, "their rows are left out", findings);
    let hide_others = found.len() as f64 > MANY * log.len() as f64;
    log.leave_out(&marked(log.len(), moved.into_iter().chain(found).map(|(row, _)| row)));
    if hide_others {
        let more: usize = (0..TAIL_ROUNDS).map(|_| leave_out_the_doubtful(log, STEPS * resolution)).sum();
        if let Some(fault) = findings.faults.iter_mut().rfind(|fault| fault.name == FaultName::Outliers) {
            fault.rows += more as u64;
            if let Some(late_by) = late_by {
                name_late(fault, fault.rows as f64 / rows as f64);
                // Rows that are late by less than can be detected stay: as many again, and as late, on the mean.
                let share = UNSEEN * fault.rows as f64 / rows as f64;
                log.unsure_s = share * late_by * gear.ratio.abs() * period_s(log).unwrap_or(1.0);
            }
        }
    }
}

/// Names rows that are out, a `share` of all, by what they are: read late.
fn name_late(fault: &mut Fault, share: f64) {
    let (rows, largest) = (fault.rows, fault.size_arcsec.unwrap_or_default().abs());
    (fault.name, fault.channel, fault.size_arcsec) = (FaultName::ReadJitter, None, Some(largest));
    fault.advice = FaultName::ReadJitter.advice();
    fault.measures.late_rows = Some(rows);
    fault.what = format!(
        "the two angles are not read at one instant: {rows} rows ({:.1} %) are read late, by up to {largest:.0} \
         arcsec: they are left out",
        100.0 * share
    );
}

/// Rows that are out were read late if they are this number at least… *Guess*: enough to see that they are off to one
/// side.
const LATE_ROWS: usize = 30;
/// …of which this share is off to the same side, seen in the direction of motion. *Guess*: thirty rows at random are so
/// in one case of seven hundred.
const ONE_SIDED: f64 = 0.8;
/// Late rows that cannot be distinguished from others are up to this many times those that can. *Guess*.
const UNSEEN: f64 = 2.0;
/// By how much, over the generator's travel from row to row, rows are out that were read late: those are off to one
/// side of the motion. At rest there is none.
fn late_by(generator: &[f64], found: &[Out]) -> Option<f64> {
    let by_travel = |(row, by): &Out| 2.0 * by / (generator[row + 1] - generator[row - 1]);
    let mut late: Vec<f64> = found.iter().map(by_travel).filter(|late| late.is_finite()).collect();
    let ahead = late.iter().filter(|by| **by > 0.0).count();
    let most = ahead.max(late.len() - ahead);
    let are_late = late.len() >= LATE_ROWS && most as f64 >= ONE_SIDED * late.len() as f64;
    are_late.then(|| median_of(&mut late).abs())
}

/// Where many rows are far out, others are out by less: the tail of the same fault, mostly to one side, which would
/// move means. What is off by more than this number of standard deviations is left out as well, of sound rows one in
/// thousands. *Source*: Hampel's identifier rejects from 3 on (Davies and Gather 1993); the noise of one log is not
/// everywhere the same.
const TAIL: f64 = 4.0;
/// Rounds of that search, as rows that are out hide others. *Guess*: each finds far fewer than the one before.
const TAIL_ROUNDS: usize = 5;

/// Where many rows are out, those are as well that are off the cubic through the rows before and after by far more than
/// usual, by `least` and by more than these. Gives how many are left out.
fn leave_out_the_doubtful(log: &mut Log, least: f64) -> usize {
    let (error, rows) = (log.of(Quantity::Error), log.len());
    let off = |k: usize| {
        let beside = [k - 2, k - 1, k + 1, k + 2];
        (error[k] - cubic_at_zero(beside.map(|j| (log.line[j] as f64 - log.line[k] as f64, error[j])))).abs()
    };
    let mut by = vec![0.0; rows];
    log.sessions().for_each(|of| (of.start + 2..of.end.saturating_sub(2)).for_each(|k| by[k] = off(k)));
    let least = least.max(TAIL * MAD_TO_STD * median_of(&mut by.clone()));
    let is_doubtful = |k: &usize| by[*k] > least && by[*k - 2..*k + 3].iter().all(|beside| *beside <= by[*k]);
    let doubtful: Vec<usize> = (2..rows.saturating_sub(2)).filter(is_doubtful).collect();
    log.leave_out(&marked(rows, doubtful));
    rows - log.len()
}

/// Outliers of torque or temperature: mended from the neighbouring rows.
fn of_load(log: &mut Log, channel: Quantity, findings: &mut Findings) {
    let mut some: Vec<f64> = log.pieces(log.of(channel)).flat_map(sampled).collect();
    let range = quantile_of(&mut some, 0.99) - quantile_of(&mut some, 0.01);
    let least = (OUT * white_noise(log.pieces(log.of(channel)))).max(LEAST_OF_RANGE * range);
    if least == 0.0 {
        return;
    }
    let found = in_sessions(log, channel, least);
    let large = found.iter().any(|(_, by)| by.abs() > LARGE_OF_RANGE * range);
    let too_many = found.len() as f64 > SHARE * log.len() as f64;
    if found.is_empty() || too_many || (found.len() < FEW && !large) {
        return;
    }
    report(log, &found, channel, Treatment::Repaired, "the rows beside stand in", findings);
    if let Some(values) = log.get_mut(channel) {
        found.iter().for_each(|(row, _)| values[*row] = 0.5 * (values[row - 1] + values[row + 1]));
    }
}

/// Reports rows of a channel that are out, and what was done with them.
fn report(log: &Log, found: &[Out], channel: Quantity, treatment: Treatment, done: &str, findings: &mut Findings) {
    let largest = farthest(found.iter().map(|(_, by)| *by));
    let largest_arcsec = Some(largest / ARCSEC).filter(|_| channel == Quantity::Error);
    let size = largest_arcsec.map_or(format!("{largest:.3}"), |arcsec| format!("{arcsec:.1} arcsec"));
    let fault = log.fault(FaultName::Outliers, found.iter().map(|(row, _)| *row));
    findings.add(fault, channel, treatment, |fault| {
        fault.size_arcsec = largest_arcsec;
        if channel != Quantity::Error {
            fault.advice = "check the cable and the amplifier of this sensor; log its raw values";
        }
        format!("{} single rows of the {channel} are out, the farthest by {size}: {done}", fault.rows)
    });
}

/// Whether rows gather at the same angle of a wheel, more than all rows do.
fn repeat_with_position(generator: &[f64], found: &[Out], gear: &Gear) -> bool {
    let n = found.len() as f64;
    if n < FEW as f64 {
        return false;
    }
    // Generator on the flexspline, once or twice a turn (two lobes); on the circular spline likewise; the output.
    let share = 1.0 / gear.ratio;
    [1.0, 2.0, 1.0 - share, 2.0 * (1.0 - share), share, 2.0 * share].iter().any(|order| {
        let resultant = |angles: &mut dyn Iterator<Item = f64>| {
            let (mut c, mut s, mut n) = (0.0, 0.0, 0.0);
            for angle in angles {
                let (sin, cos) = (order * angle).sin_cos();
                (c, s, n) = (c + cos, s + sin, n + 1.0);
            }
            f64::hypot(c, s) / f64::max(n, 1.0)
        };
        let of_found = resultant(&mut found.iter().map(|(row, _)| generator[*row]));
        let of_all = resultant(&mut generator.iter().copied());
        of_found > of_all + 0.3 && (of_found > REPEATS || n * of_found.powi(2) > REPEATS_MANY)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::Session;

    /// An error that swings slowly with 2 arcsec of noise, and rows off by 60 to 600 arcsec.
    fn with_rows_out(share: f64) -> (Vec<Session>, Vec<usize>) {
        let mut random = fastrand::Rng::with_seed(12);
        let mut session = Session::default();
        let mut out = Vec::new();
        for k in 0..6000u64 {
            let noise = 2.0 * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0);
            let mut error = 40.0 * (2e-3 * k as f64).sin() + noise;
            if random.f64() < share {
                out.push(k as usize);
                error += (60.0 + 540.0 * random.f64()) * if random.bool() { 1.0 } else { -1.0 };
            }
            session.line.push(k);
            session.generator_rad.push(0.06 * k as f64);
            session.error_rad.push(error * ARCSEC);
        }
        (vec![session], out)
    }

    #[test]
    fn of_many_rows_that_are_out_hardly_any_stays() {
        for share in [0.01, 0.05] {
            let (mut sessions, out) = with_rows_out(share);
            let mut findings = Findings::default();
            Log::on(&mut sessions, |log| check(log, &Gear::of_ratio(95.0), &mut findings));
            let stay = sessions[0].line.iter().filter(|line| out.contains(&(**line as usize))).count();
            let left_out = 6000 - sessions[0].len();
            assert!(stay * 100 <= out.len(), "{stay} of {} stay", out.len());
            assert!(left_out < out.len() + 40, "{left_out} for {}", out.len());
            let found = findings.faults.iter().find(|fault| fault.name == FaultName::Outliers).expect("outliers");
            assert_eq!(found.rows as usize, left_out);
        }
    }

    #[test]
    fn rows_that_are_out_at_rest_were_not_read_late() {
        let found: Vec<Out> = (1..=60).map(|k| (2 * k, 1e-3)).collect();
        let late_by = |step: f64| late_by(&(0..140).map(|k| step * f64::from(k)).collect::<Vec<f64>>(), &found);
        assert!(late_by(0.0).is_none() && (late_by(0.1).unwrap() - 1e-2).abs() < 1e-9);
    }

    #[test]
    fn the_tip_of_a_load_is_borne_out_by_its_sides_and_a_spike_is_not() {
        let mut load: Vec<f64> = (0..41).map(|k| 40.0 - 1.5 * (f64::from(k) - 20.0).abs()).collect();
        let found = |load: &[f64]| rows_out(load, 1.0).iter().map(|(row, _)| *row).collect::<Vec<_>>();
        assert!(out_by(&load, 20) > 2.0, "a tip stands above the rows beside");
        assert_eq!(found(&load), [0_usize; 0]);
        load[10] += 20.0;
        assert_eq!(found(&load), [10]);
        load[30] -= 20.0;
        assert_eq!(found(&load), [10, 30]);
    }

    #[test]
    fn a_row_in_which_the_load_swings_is_the_drives() {
        let swings = |torque: [f64; 7]| load_swings(&torque, 3, 40.0);
        assert!(swings([-6.6, -5.1, -3.8, -0.4, -2.9, -4.1, -4.2]), "a flank is let go");
        assert!(!swings([0.4; 7]), "a load that does not change leaves the play where it is");
        assert!(swings([-24.6, -22.7, -20.3, -16.9, -20.7, -19.2, -21.7]), "wind-up follows a tip");
        assert!(!swings([-26.6, -25.1, -23.8, -22.4, -21.9, -20.1, -19.2]), "and no more than a tip");
    }
}
