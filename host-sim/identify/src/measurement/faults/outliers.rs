//! Single rows that neither the rows before nor those after bear out.

use super::resolution::seen;
use super::steps::{HELD, largest_torque};
use super::{ARCSEC, Findings, farthest, leave_out_rows, level, of_rows, rows_of};
use crate::measurement::Session;
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{Fault, FaultName, Treatment};
use crate::measurement::gear::Gear;
use flexspline_base::robust::{least_and_most, median_of, quantile_of, sampled, white_noise};

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
/// If more than this share of the rows is out, [`OTHERS_OUT`] of the rows around one do not count for what is usual
/// there. *Guess*: then another one is around every tenth of them.
const MANY: f64 = 0.003;
/// Rows around one that may be out as well. *Source*: derived, of 30 rows of which 5 % are out more are so in one case
/// of fifty (Poisson). Where as many are out as [`SHARE`] allows, it is seven: *guess*, that few files have so many.
const OTHERS_OUT: usize = 4;
/// Mean resultant length above which four or more outliers repeat with position: a damaged tooth, which is the drive.
/// *Guess*: four at random exceed it at one angle in one case of forty.
const REPEATS: f64 = 0.9;
/// Rayleigh's n R² above which many outliers repeat with position. *Source*: derived, n R² is exponential, so chance
/// gives it with exp(−12); that this is enough for six angles is a guess.
const REPEATS_MANY: f64 = 12.0;

/// How far row `row` is from the rows before and after, and from where they go on to, if all say so; 0 if one of them
/// bears it out. A load turns sharply within a row and means it, and the wind-up with it: such a tip goes on as one of
/// its sides does.
fn off_course(values: &[f64], row: usize) -> f64 {
    let by = out_by(values, row);
    if by == 0.0 {
        return 0.0;
    }
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

/// Whether the load lets go of its flank next to a row: the teeth cross the clearance and strike. The row itself does
/// not count, as it may be the one that is wrong.
fn strikes(torque: &[f64], row: usize, largest_n_m: f64) -> bool {
    let near = row.saturating_sub(AROUND_ONE)..(row + AROUND_ONE + 1).min(torque.len());
    let others = || near.clone().filter(|k| *k != row).map(|k| torque[k]);
    let (low, high) = least_and_most(others());
    high - low > SWINGS * largest_n_m && others().any(|torque| torque.abs() < HELD * largest_n_m)
}

/// Whether the load moves the drive for a row: it lets go of a flank, or stands out itself.
fn load_swings(session: &Session, row: usize, largest_n_m: f64) -> bool {
    session
        .torque_n_m
        .as_ref()
        .is_some_and(|torque| strikes(torque, row, largest_n_m) || out_by(torque, row).abs() > SWINGS * largest_n_m)
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

/// Rows of the error that are out by more than `least`, in all sessions; looked for again with less regard for the rows
/// around where there are many.
fn in_sessions(sessions: &[Session], least: f64) -> Vec<Vec<Out>> {
    let beyond = |others: usize| -> Vec<Vec<Out>> {
        sessions.iter().map(|session| rows_out(&session.error_rad, least, others)).collect()
    };
    let found = beyond(1);
    let many = count(&found) as f64 > MANY * rows_of(sessions) as f64;
    if many { beyond(OTHERS_OUT) } else { found }
}

/// Rows of all sessions.
fn count(found: &[Vec<Out>]) -> usize {
    found.iter().map(Vec::len).sum()
}

/// Rows that are out by more than `least`, and by far more than all around them but `others` of them.
fn rows_out(values: &[f64], least: f64, others: usize) -> Vec<Out> {
    let mut found = Vec::new();
    for row in AROUND_ONE..values.len().saturating_sub(AROUND_ONE) {
        // The cheaper bound first: it is the larger one.
        if out_by(values, row).abs() <= least {
            continue;
        }
        let by = off_course(values, row);
        if by.abs() <= least {
            continue;
        }
        let around = row.saturating_sub(AROUND)..(row + AROUND + 1).min(values.len());
        let mut usual: Vec<f64> = around.filter(|k| *k != row).map(|k| out_by(values, k).abs()).collect();
        usual.sort_unstable_by(f64::total_cmp);
        let usual = usual.iter().rev().nth(others).copied().unwrap_or(0.0);
        let step = (level(values, row - AROUND_ONE..row) - level(values, row + 1..row + 1 + AROUND_ONE)).abs();
        if by.abs() > OUT_OF_AROUND * usual && step < 0.5 * by.abs() {
            found.push((row, by));
        }
    }
    found
}

/// Finds outliers; rows with an outlying error are left out, other channels are mended from the neighbouring rows.
pub(in crate::measurement) fn check(
    sessions: &mut [Session],
    gear: &Gear,
    error_recorded: bool,
    findings: &mut Findings,
) {
    of_error(sessions, gear, error_recorded, findings);
    for channel in [Quantity::Torque, Quantity::Temperature] {
        of_load(sessions, channel, findings);
    }
}

/// Outliers of the error: left out, and named where they are the data's and not the drive's.
fn of_error(sessions: &mut [Session], gear: &Gear, error_recorded: bool, findings: &mut Findings) {
    let rows = rows_of(sessions) as f64;
    let noise = white_noise(sessions.iter().map(|session| session.error_rad.as_slice()));
    let resolution = seen(sessions, gear, error_recorded).into_iter().map(|(_, step)| step).fold(0.0, f64::max);
    let least = (OUT * noise).max(LEAST_RAD).max(STEPS * resolution);
    let largest_n_m = largest_torque(sessions);
    let swings = |(number, found): (usize, Vec<Out>)| -> (Vec<Out>, Vec<Out>) {
        found.into_iter().partition(|(row, _)| load_swings(&sessions[number], *row, largest_n_m))
    };
    let (moved, found): (Vec<Vec<Out>>, Vec<Vec<Out>>) =
        in_sessions(sessions, least).into_iter().enumerate().map(swings).unzip();
    let some = |found: &[Vec<Out>]| (1.0..=SHARE * rows).contains(&(count(found) as f64));
    let mut drop: Vec<Vec<usize>> = vec![Vec::new(); sessions.len()];
    let mut drop_all = |found: &[Vec<Out>]| {
        drop.iter_mut().zip(found).for_each(|(drop, found)| drop.extend(found.iter().map(|(row, _)| *row)));
    };
    if some(&moved) {
        findings.notes.push(format!(
            "{} single rows stand out where the load swings within a row, and the drive with it; they are left out",
            count(&moved)
        ));
        drop_all(&moved);
    }
    let number = count(&found);
    let mut many = false;
    if some(&found) {
        let is_fast = |session: &Session, row: usize| {
            (session.generator_rad[row + 1] - session.generator_rad[row - 1]).abs() > 2.0 * TOOTH_RAD
        };
        let mut of_sessions = found.iter().zip(sessions.iter());
        let fast = of_sessions.all(|(rows, session)| rows.iter().all(|(row, _)| is_fast(session, *row)));
        let large = found.iter().flatten().any(|(_, by)| by.abs() > LARGE_RAD);
        if (number < FEW || fast) && !large {
            findings.notes.push(format!(
                "{number} single rows stand out: too few, or in too fast a motion, to tell drive from data"
            ));
        } else if repeat_with_position(sessions, &found, gear) {
            findings
                .notes
                .push(format!("{number} single rows stand out, always in the same position: the drive, not the data"));
        } else {
            report(sessions, &found, Quantity::Error, Treatment::Masked, "their rows are left out", findings);
            drop_all(&found);
            many = number as f64 > MANY * rows;
        }
    }
    leave_out_rows(sessions, drop);
    if many {
        let tail = (TAIL * noise).max(STEPS * resolution);
        let more: u64 = (0..TAIL_ROUNDS).map(|_| leave_out_the_doubtful(sessions, tail)).sum();
        if let Some(fault) = findings.faults.iter_mut().rfind(|fault| fault.name == FaultName::Outliers) {
            fault.rows += more;
        }
    }
}

/// Rows before and after of which the medians confirm a row where many are out. *Source*: derived, of five two may be
/// out as well.
const WIDELY_AROUND: usize = 5;
/// Where many rows are far out, others are out by less: the tail of the same fault, mostly to one side, which would
/// move means. What is off by more than this number of standard deviations of the white noise is left out as well, of
/// sound rows one in thousands. *Source*: Hampel's identifier rejects from 3 on (Davies and Gather 1993); medians of
/// five rows have a noise of their own.
const TAIL: f64 = 4.0;
/// Rounds of that search, as rows that are out hide others. *Guess*: each finds far fewer than the one before.
const TAIL_ROUNDS: usize = 3;

/// Where many rows are out, those are as well that stand next to others, or where the drive might have moved them, at
/// reversals and steps of the load. Gives how many are left out.
fn leave_out_the_doubtful(sessions: &mut [Session], least: f64) -> u64 {
    let mut more = 0;
    for session in sessions.iter_mut().filter(|session| session.len() > 4 * AROUND_ONE) {
        let error = &session.error_rad;
        let drop: Vec<bool> = (0..error.len())
            .map(|row| {
                if row < AROUND_ONE || row + AROUND_ONE >= error.len() {
                    return false;
                }
                let before = level(error, row.saturating_sub(WIDELY_AROUND)..row);
                let after = level(error, row + 1..(row + 1 + WIDELY_AROUND).min(error.len()));
                let (from_before, from_after) = (error[row] - before, error[row] - after);
                let by = from_before.abs().min(from_after.abs());
                from_before * from_after > 0.0 && by > least && (after - before).abs() < 0.5 * by
            })
            .collect();
        more += drop.iter().filter(|drop| **drop).count() as u64;
        session.leave_out(&drop);
    }
    more
}

/// Outliers of torque or temperature: mended from the neighbouring rows.
fn of_load(sessions: &mut [Session], channel: Quantity, findings: &mut Findings) {
    let series: Vec<&[f64]> = sessions.iter().filter_map(|session| session.column(channel)).collect();
    let mut some: Vec<f64> = series.iter().flat_map(|values| sampled(values)).collect();
    let range = quantile_of(&mut some, 0.99) - quantile_of(&mut some, 0.01);
    let least = (OUT * white_noise(series)).max(LEAST_OF_RANGE * range);
    if least == 0.0 {
        return;
    }
    let of = |session: &Session| rows_out(session.column(channel).unwrap_or_default(), least, 1);
    let found: Vec<Vec<Out>> = sessions.iter().map(of).collect();
    let number = count(&found);
    let large = found.iter().flatten().any(|(_, by)| by.abs() > LARGE_OF_RANGE * range);
    let too_many = number as f64 > SHARE * rows_of(sessions) as f64;
    if number == 0 || too_many || (number < FEW && !large) {
        return;
    }
    report(sessions, &found, channel, Treatment::Repaired, "the rows beside stand in", findings);
    for (session, found) in sessions.iter_mut().zip(&found) {
        if let Some(values) = session.column_mut(channel) {
            found.iter().for_each(|(row, _)| values[*row] = 0.5 * (values[row - 1] + values[row + 1]));
        }
    }
}

/// Reports rows of a channel that are out, and what was done with them.
fn report(
    sessions: &[Session],
    found: &[Vec<Out>],
    channel: Quantity,
    treatment: Treatment,
    done: &str,
    findings: &mut Findings,
) {
    let rows = found.iter().enumerate().flat_map(|(k, rows)| rows.iter().map(move |(row, _)| (k, *row)));
    let largest = farthest(found.iter().flatten().map(|(_, by)| *by));
    let largest_arcsec = Some(largest / ARCSEC).filter(|_| channel == Quantity::Error);
    let size = largest_arcsec.map_or(format!("{largest:.3}"), |arcsec| format!("{arcsec:.1} arcsec"));
    let advice = match channel {
        Quantity::Error => FaultName::Outliers.advice(),
        _ => "check the cable and the amplifier of this sensor; log its raw values",
    };
    let fault = of_rows(sessions, FaultName::Outliers, rows);
    let fault = fault.map(|fault| Fault { size_arcsec: largest_arcsec, advice, ..fault });
    findings.add(fault, channel, treatment, |fault| {
        format!("{} single rows of the {channel} are out, the farthest by {size}: {done}", fault.rows)
    });
}

/// Whether rows gather at the same angle of a wheel, more than all rows do.
pub(super) fn repeat_with_position(sessions: &[Session], found: &[Vec<Out>], gear: &Gear) -> bool {
    let n = count(found) as f64;
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
        let of = |(session, rows): (&Session, &Vec<Out>)| -> Vec<f64> {
            rows.iter().map(|(row, _)| session.generator_rad[*row]).collect()
        };
        let of_found = resultant(&mut sessions.iter().zip(found).flat_map(of));
        let of_all = resultant(&mut sessions.iter().flat_map(|session| session.generator_rad.iter().copied()));
        of_found > of_all + 0.3 && (of_found > REPEATS || n * of_found.powi(2) > REPEATS_MANY)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

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
            check(&mut sessions, &Gear::of_ratio(95.0), false, &mut findings);
            let stay = sessions[0].line.iter().filter(|line| out.contains(&(**line as usize))).count();
            let left_out = 6000 - sessions[0].len();
            assert!(stay * 100 <= out.len(), "{stay} of {} stay", out.len());
            assert!(left_out < out.len() + 40, "{left_out} for {}", out.len());
            let found = findings.faults.iter().find(|fault| fault.name == FaultName::Outliers).expect("outliers");
            assert_eq!(found.rows as usize, left_out);
        }
    }

    #[test]
    fn the_tip_of_a_load_is_borne_out_by_its_sides_and_a_spike_is_not() {
        let mut load: Vec<f64> = (0..41).map(|k| 40.0 - 1.5 * (f64::from(k) - 20.0).abs()).collect();
        let found = |load: &[f64]| rows_out(load, 1.0, 1).iter().map(|(row, _)| *row).collect::<Vec<_>>();
        assert!(out_by(&load, 20) > 2.0, "a tip stands above the rows beside");
        assert_eq!(found(&load), [0_usize; 0]);
        load[10] += 20.0;
        assert_eq!(found(&load), [10]);
        load[30] -= 20.0;
        assert_eq!(found(&load), [10, 30]);
    }

    #[test]
    fn a_row_in_which_the_load_swings_is_the_drives() {
        let session = |torque: [f64; 7]| Session {
            generator_rad: (0..7).map(|k| 0.05 * f64::from(k)).collect(),
            torque_n_m: Some(torque.to_vec()),
            ..Session::default()
        };
        let swings = |torque| load_swings(&session(torque), 3, 40.0);
        assert!(swings([-6.6, -5.1, -3.8, -0.4, -2.9, -4.1, -4.2]), "a flank is let go");
        assert!(!swings([0.4; 7]), "a load that does not change leaves the play where it is");
        assert!(swings([-24.6, -22.7, -20.3, -16.9, -20.7, -19.2, -21.7]), "wind-up follows a tip");
        assert!(!swings([-26.6, -25.1, -23.8, -22.4, -21.9, -20.1, -19.2]), "and no more than a tip");
    }
}
