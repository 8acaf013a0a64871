//! Channels that repeat a value while they should change.

use std::ops::Range;

use super::lattice::lattice;
use super::steps::WHOLE_PITCH;
use super::{ARCSEC, Findings, WIDEST_CLEARANCE_RAD, leave_out, of_rows, rows_of, runs, straight, whole_pitches};
use crate::measurement::Session;
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{Fault, FaultName, Treatment};
use crate::measurement::gear::Gear;
use crate::measurement::refusal::Refusal;
use flexspline_base::robust::{least_and_most, white_noise};

/// Chance of one false alarm in a file, for a channel with noise. *Guess*: small enough for a lifetime of files.
const CHANCE: f64 = 1e-6;
/// If the noise is at least this share of a step of the lattice, a channel changes in every second row or more.
/// *Source*: derived, white noise of 0.6 steps rounds neighbouring rows to other values in 57 % of the cases.
const BLURRED: f64 = 0.6;
/// Shortest stretch that counts, rows. *Guess*: by chance of one half in each row such a stretch has [`CHANCE`].
const SHORTEST: usize = 20;
/// White noise below this is none at the output, rad: what a solver leaves. *Guess*: far below any encoder.
const NO_NOISE_RAD: f64 = 0.02 * ARCSEC;
/// An output that dwells for longer than this, rad, has been frozen: clearance and as much of wind-up are shorter.
/// *Guess*.
const LONG_DWELL_RAD: f64 = 2.0 * WIDEST_CLEARANCE_RAD;
/// Stretches of rows with one value, at least `shortest` rows long.
fn stretches(values: &[f64], shortest: usize, same: impl Fn(f64, f64) -> bool) -> impl Iterator<Item = Range<usize>> {
    runs(values, same).into_iter().filter(move |run| run.len() >= shortest)
}

/// Length of a stretch that chance does not give in this many rows, of a channel that changes at every second row at
/// least.
fn beyond_chance(rows: usize) -> usize {
    let length = (CHANCE / rows.max(1) as f64).ln() / 0.5_f64.ln();
    SHORTEST.max(length.ceil() as usize)
}

/// Whether an output, while the generator stands, moves by whole tooth pitches and has done so within a part of the
/// stretch: teeth that skip move it, not a generator that is not read.
fn slips_a_tooth(output: &[f64], stretch: &Range<usize>, gear: &Gear) -> bool {
    let angles = &output[stretch.clone()];
    let (first, last) = (angles[0], angles[angles.len() - 1]);
    let apart = (angles.len() / 4).max(1);
    whole_pitches(last - first, gear, WHOLE_PITCH)
        && angles.windows(apart + 1).any(|a| (a[apart] - a[0]).abs() > SUDDEN * (last - first).abs())
}

/// A motion is sudden if this share of it happens within a quarter of the time. *Guess*: an even motion makes a
/// quarter.
const SUDDEN: f64 = 0.9;

/// Finds frozen stretches and leaves their rows out; a channel that is frozen throughout is an error.
pub(in crate::measurement) fn check(
    sessions: &mut Vec<Session>,
    gear: &Gear,
    error_recorded: bool,
    findings: &mut Findings,
) -> Result<(), Refusal> {
    let rows = rows_of(sessions);
    let outputs: Vec<Vec<f64>> = sessions.iter().map(|session| session.output_rad(gear.ratio)).collect();
    let outputs_noisy = has_noise(&outputs.iter().map(Vec::as_slice).collect::<Vec<_>>(), NO_NOISE_RAD);
    let longest = beyond_chance(rows);
    // Digits of an error that was written down leave something of the angle.
    let digits = if error_recorded { 1e-3 * ARCSEC } else { 0.0 };
    let same = |a: f64, b: f64| (a - b).abs() <= digits + 1e-13 * (a.abs() + b.abs());
    let follower = if error_recorded { Quantity::Error } else { Quantity::Output };
    let mut drop: Vec<Vec<bool>> = sessions.iter().map(|session| vec![false; session.len()]).collect();
    for (number, (session, output)) in sessions.iter().zip(&outputs).enumerate() {
        let generator = &session.generator_rad;
        let mut frozen: Vec<(Quantity, Range<usize>, f64)> = Vec::new();
        // A channel, and the other one.
        let angles = [(follower, output, generator), (Quantity::Generator, generator, output)];
        for (channel, values, other) in angles.into_iter().take(if error_recorded { 1 } else { 2 }) {
            let of_output = channel != Quantity::Generator;
            for stretch in stretches(values, 3, same) {
                let missed = missed(other, &stretch) / if of_output { gear.ratio.abs() } else { 1.0 };
                let long = missed > LONG_DWELL_RAD && (of_output || !slips_a_tooth(output, &stretch, gear));
                if long || (of_output && outputs_noisy && stretch.len() >= longest) {
                    frozen.push((channel, stretch, missed));
                }
            }
        }
        if error_recorded {
            let noisy = has_noise(&[&session.error_rad], NO_NOISE_RAD);
            let of_error = stretches(&session.error_rad, longest, |a, b| a == b);
            let of_error = of_error.filter(|stretch| noisy || stretch.len() == session.len());
            frozen.extend(of_error.map(|stretch| (Quantity::Error, stretch, 0.0)));
        }
        for (channel, stretch, missed) in frozen {
            let fault = of_rows(sessions, FaultName::FrozenChannel, stretch.clone().map(|row| (number, row)));
            let fault = fault.map(|fault| Fault { size_arcsec: Some(missed / ARCSEC), ..fault });
            findings.add(fault, channel, Treatment::Masked, |fault| {
                format!(
                    "the {channel} keeps one value over {} rows, in which it should have moved by {:.1} arcsec at the \
                     output: they are left out",
                    fault.rows,
                    missed / ARCSEC
                )
            });
            drop[number][stretch].fill(true);
        }
    }
    let left: usize = drop.iter().flatten().filter(|dropped| !**dropped).count();
    if 2 * left < rows {
        let fault = findings.faults.iter().find(|fault| fault.name == FaultName::FrozenChannel);
        let channel = fault.and_then(|fault| fault.channel).unwrap_or(Quantity::Output);
        return Err(Refusal::Frozen { channel, frozen: rows - left, rows });
    }
    saturated(sessions, rows, &mut drop, findings);
    of_channel(sessions, Quantity::Torque, rows, &mut drop, findings);
    of_channel(sessions, Quantity::Temperature, rows, &mut drop, findings);
    leave_out(sessions, &drop);
    sessions.retain(|session| !session.is_empty());
    Ok(())
}

/// Whether a channel has white noise, more than `least` and enough to blur its resolution.
fn has_noise(series: &[&[f64]], least: f64) -> bool {
    let longest = series.iter().max_by_key(|values| values.len()).copied().unwrap_or(&[]);
    let (noise, step) = (white_noise(series.iter().copied()), lattice(longest).unwrap_or(0.0));
    noise > BLURRED * step && noise > least
}

/// The farthest an angle goes from its first value in a stretch in which the other one stands.
fn missed(values: &[f64], stretch: &Range<usize>) -> f64 {
    values[stretch.clone()].iter().map(|value| (value - values[stretch.start]).abs()).fold(0.0, f64::max)
}

/// A torque stands at a limit in stretches of this many rows or more, … *Guess*: two may be a peak.
const AT_LIMIT_ROWS: usize = 3;
/// … and in this share of all rows at least. *Guess*: fewer may be left in.
const AT_LIMIT_SHARE: f64 = 0.005;
/// Noise below this share of the range of a torque is round-off. *Guess*: sensors are no better than 20 bits.
const ROUND_OFF: f64 = 1e-6;

/// Leaves out rows in which the torque stands at its largest or its least value, though it has noise elsewhere: the
/// sensor or its amplifier is at its end, and nobody knows the load.
fn saturated(sessions: &[Session], rows: usize, drop: &mut [Vec<bool>], findings: &mut Findings) {
    let torques: Vec<&[f64]> = sessions.iter().filter_map(|session| session.column(Quantity::Torque)).collect();
    if torques.len() < sessions.len() || torques.is_empty() {
        return;
    }
    let (least, most) = least_and_most(torques.iter().copied().flatten().copied());
    let at_end = |torque: &f64| *torque == least || *torque == most;
    let between: Vec<&[f64]> =
        torques.iter().flat_map(|torque| torque.split(at_end)).filter(|part| part.len() > SHORTEST).collect();
    if most <= least || !has_noise(&between, ROUND_OFF * (most - least)) {
        return;
    }
    for limit in [least, most].into_iter().filter(|limit| *limit != 0.0) {
        let at_limit = |(number, torque): (usize, &&[f64])| {
            let at_limit = stretches(torque, AT_LIMIT_ROWS, |a, b| a == b).filter(|run| torque[run.start] == limit);
            at_limit.flatten().map(|row| (number, row)).collect::<Vec<_>>()
        };
        let found: Vec<(usize, usize)> = torques.iter().enumerate().flat_map(at_limit).collect();
        if (found.len() as f64) < AT_LIMIT_SHARE * rows as f64 || found.len() < SHORTEST {
            continue;
        }
        let advice = "take a torque sensor, or a gain of its amplifier, with room for the largest load";
        let fault = of_rows(sessions, FaultName::FrozenChannel, found.iter().copied());
        let fault = fault.map(|fault| Fault { advice, ..fault });
        findings.add(fault, Quantity::Torque, Treatment::Masked, |fault| {
            format!(
                "the torque never passes {limit:.3} N·m, and stands there in {} rows, though it has noise elsewhere: \
                 it saturates, and these rows are left out",
                fault.rows
            )
        });
        found.into_iter().for_each(|(number, row)| drop[number][row] = true);
    }
}

/// Torque or temperature: the whole channel is left out if half of it is frozen; else a temperature goes on by a
/// straight line, and rows whose torque nobody knows are left out, since a load swings and the drive with it.
///
/// A constant load, a load in steps and a soak at one temperature are not faults: only a channel with noise that lost
/// it is frozen.
fn of_channel(
    sessions: &mut [Session],
    channel: Quantity,
    rows: usize,
    drop: &mut [Vec<bool>],
    findings: &mut Findings,
) {
    let series: Vec<&[f64]> = sessions.iter().filter_map(|session| session.column(channel)).collect();
    if series.is_empty() {
        return;
    }
    let has_noise = has_noise(&series, 0.0);
    let standing = series.iter().flat_map(|values| values.windows(2)).filter(|pair| pair[0] == pair[1]).count();
    let longest = beyond_chance(rows);
    let mut frozen: Vec<(usize, Range<usize>)> = Vec::new();
    for (number, values) in sessions.iter().enumerate().filter_map(|(k, session)| Some((k, session.column(channel)?))) {
        for stretch in stretches(values, longest, |a, b| a == b) {
            // No load at all is a load, and may be written as exactly nothing; what saturates is known already.
            if values[stretch.start] == 0.0 || drop[number][stretch.start] {
                continue;
            }
            // Without this stretch the channel stands in this many of its steps.
            let elsewhere = (standing + 1).saturating_sub(stretch.len()) as f64 / (rows - stretch.len()).max(1) as f64;
            if has_noise && elsewhere < 0.5 {
                frozen.push((number, stretch));
            }
        }
    }
    let count: usize = frozen.iter().map(|(_, stretch)| stretch.len()).sum();
    let useless = 2 * count > rows;
    let (treatment, done) = match channel {
        _ if useless => (Treatment::Masked, "the channel is not used"),
        Quantity::Torque => (Treatment::Masked, "they are left out"),
        _ => (Treatment::Repaired, "a straight line is put in its place"),
    };
    for (number, stretch) in frozen {
        let fault = of_rows(sessions, FaultName::FrozenChannel, stretch.clone().map(|row| (number, row)));
        findings.add(fault, channel, treatment, |fault| {
            format!("the {channel} keeps one value over {} rows: {done}", fault.rows)
        });
        let values = sessions[number].column_mut(channel).as_mut();
        if channel == Quantity::Torque && !useless {
            drop[number][stretch].fill(true);
        } else if let Some(values) = values.filter(|values| stretch.end < values.len()) {
            straight(values, stretch.start, stretch.end);
        }
    }
    if useless {
        sessions.iter_mut().for_each(|session| *session.column_mut(channel) = None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows left of a torque, and what is reported.
    fn left(torque: impl Iterator<Item = f64>) -> (usize, Vec<FaultName>) {
        let mut sessions = vec![Session {
            torque_n_m: Some(torque.collect()),
            line: (2..4002).collect(),
            generator_rad: (0..4000).map(|k| 0.02 * f64::from(k)).collect(),
            error_rad: (0..4000).map(|k| 1e-5 * f64::from(k % 7)).collect(),
            ..Session::default()
        }];
        let mut findings = Findings::default();
        check(&mut sessions, &Gear::of_ratio(100.0), false, &mut findings).unwrap();
        (sessions[0].len(), findings.faults.iter().map(|fault| fault.name).collect())
    }

    #[test]
    fn a_torque_that_saturates_is_named_once_for_each_end_and_its_rows_are_left_out() {
        let mut random = fastrand::Rng::with_seed(4);
        let noisy: Vec<f64> =
            (0..4000).map(|k| 40.0 * (0.01 * f64::from(k)).sin() + 0.1 * (random.f64() - 0.5)).collect();
        let (rows, names) = left(noisy.iter().map(|load| load.clamp(-20.0, 20.0)));
        // Beyond half of the amplitude of a sine are two thirds of its time.
        assert!((1200..1500).contains(&rows), "{rows}");
        assert_eq!(names, [FaultName::FrozenChannel; 2]);
        assert_eq!(left(noisy.iter().copied()), (4000, vec![]));
        // Ramps between two loads that are held, as they were asked for.
        let ramps = |k: i32| (80.0 * ((0.002 * f64::from(k)).fract() - 0.5).abs() - 20.0).clamp(-10.0, 10.0);
        assert_eq!(left((0..4000).map(ramps)), (4000, vec![]));
        // A log of two loads, and the nine rows from one to the other in digits.
        let held = |k: i32| (-20.0 + 4.04040404 * f64::from(k - 1995)).clamp(-20.0, 20.0);
        assert_eq!(left((0..4000).map(held)), (4000, vec![]));
    }
}
