//! Channels that repeat a value while they should change.

use std::ops::Range;

use super::resolution::lattice;
use super::{ARCSEC, Findings, WIDEST_CLEARANCE_RAD, straight, whole_pitches};
use crate::measurement::Refusal;
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{FaultName, Treatment};
use crate::measurement::gear::Gear;
use crate::measurement::log::Log;
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

/// A change is whole tooth pitches within this share of one. *Guess*: pitch errors of fine gears are a third of that.
const WHOLE_PITCH: f64 = 0.01;

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
    whole_pitches(last - first, gear, WHOLE_PITCH, 0.0).is_some()
        && angles.windows(apart + 1).any(|a| (a[apart] - a[0]).abs() > SUDDEN * (last - first).abs())
}

/// A motion is sudden if this share of it happens within a quarter of the time. *Guess*: an even motion makes a
/// quarter.
const SUDDEN: f64 = 0.9;

/// Finds frozen stretches and leaves their rows out; a channel that is frozen throughout is an error.
pub(in crate::measurement) fn check(log: &mut Log, gear: &Gear, findings: &mut Findings) -> Result<(), Refusal> {
    let rows = log.len();
    let (output, generator) = (&log.output_rad(gear.ratio), log.of(Quantity::Generator));
    let outputs_noisy = has_noise(log.pieces(output), NO_NOISE_RAD);
    let longest = beyond_chance(rows);
    // Digits of an error that was written down leave something of the angle.
    let digits = if log.error_recorded { 1e-3 * ARCSEC } else { 0.0 };
    let same = |a: f64, b: f64| (a - b).abs() <= digits + 1e-13 * (a.abs() + b.abs());
    let follower = if log.error_recorded { Quantity::Error } else { Quantity::Output };
    let mut drop = vec![false; rows];
    let mut frozen: Vec<(Quantity, Range<usize>, f64)> = Vec::new();
    // A channel, and the other one.
    let angles = [(follower, &output[..], generator), (Quantity::Generator, generator, output)];
    for (channel, values, other) in angles.into_iter().take(if log.error_recorded { 1 } else { 2 }) {
        let of_output = channel != Quantity::Generator;
        for stretch in log.runs(values, 3, same) {
            let missed = missed(other, &stretch) / if of_output { gear.ratio.abs() } else { 1.0 };
            let long = missed > LONG_DWELL_RAD && (of_output || !slips_a_tooth(output, &stretch, gear));
            if long || (of_output && outputs_noisy && stretch.len() >= longest) {
                frozen.push((channel, stretch, missed));
            }
        }
    }
    if log.error_recorded {
        let error = log.of(Quantity::Error);
        let is_frozen = |stretch: &Range<usize>| {
            let session = log.around(stretch.start);
            *stretch == session || has_noise([&error[session]].into_iter(), NO_NOISE_RAD)
        };
        let of_error = log.runs(error, longest, |a, b| a == b);
        frozen.extend(of_error.into_iter().filter(is_frozen).map(|stretch| (Quantity::Error, stretch, 0.0)));
    }
    for (channel, stretch, missed) in &frozen {
        findings.add(log.fault(FaultName::FrozenChannel, stretch.clone()), *channel, Treatment::Masked, |fault| {
            fault.size_arcsec = Some(missed / ARCSEC);
            format!(
                "the {channel} keeps one value over {} rows, in which it should have moved by {:.1} arcsec at the \
                 output: they are left out",
                fault.rows,
                missed / ARCSEC
            )
        });
        drop[stretch.clone()].fill(true);
    }
    let left = drop.iter().filter(|dropped| !**dropped).count();
    if 2 * left < rows {
        let channel = frozen.first().map_or(Quantity::Output, |(channel, ..)| *channel);
        return Err(Refusal(format!(
            "the {channel} keeps one value over {} of {rows} rows; allowed: at most half of them",
            rows - left
        )));
    }
    saturated(log, &mut drop, findings);
    of_channel(log, Quantity::Torque, &mut drop, findings);
    of_channel(log, Quantity::Temperature, &mut drop, findings);
    log.leave_out(&drop);
    Ok(())
}

/// Whether a channel has white noise, more than `least` and enough to blur its resolution.
fn has_noise<'a>(series: impl Iterator<Item = &'a [f64]>, least: f64) -> bool {
    let series: Vec<&[f64]> = series.collect();
    let longest = series.iter().max_by_key(|values| values.len()).copied().unwrap_or(&[]);
    let (noise, step) = (white_noise(series), lattice(longest).unwrap_or(0.0));
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
/// Noise below this share of the range of a channel is round-off. *Guess*: sensors are no better than 20 bits.
const ROUND_OFF: f64 = 1e-6;

/// Leaves out rows in which the torque stands at its largest or its least value, though it has noise elsewhere: the
/// sensor or its amplifier is at its end, and nobody knows the load.
fn saturated(log: &Log, drop: &mut [bool], findings: &mut Findings) {
    let Some(torque) = log.get(Quantity::Torque) else { return };
    let (least, most) = least_and_most(torque.iter().copied());
    let at_end = |torque: &f64| *torque == least || *torque == most;
    let between = log.pieces(torque).flat_map(|torque| torque.split(at_end)).filter(|part| part.len() > SHORTEST);
    if most <= least || !has_noise(between, ROUND_OFF * (most - least)) {
        return;
    }
    for limit in [least, most].into_iter().filter(|limit| *limit != 0.0) {
        let standing = log.runs(torque, AT_LIMIT_ROWS, |a, b| a == b);
        let found: Vec<usize> = standing.into_iter().filter(|run| torque[run.start] == limit).flatten().collect();
        if (found.len() as f64) < AT_LIMIT_SHARE * log.len() as f64 || found.len() < SHORTEST {
            continue;
        }
        let fault = log.fault(FaultName::FrozenChannel, found.iter().copied());
        findings.add(fault, Quantity::Torque, Treatment::Masked, |fault| {
            fault.advice = "take a torque sensor, or a gain of its amplifier, with room for the largest load";
            format!(
                "the torque never passes {limit:.3} N·m, and stands there in {} rows, though it has noise elsewhere: \
                 it saturates, and these rows are left out",
                fault.rows
            )
        });
        found.into_iter().for_each(|row| drop[row] = true);
    }
}

/// Torque or temperature: the whole channel is left out if half of it is frozen; else a temperature goes on by a
/// straight line, and rows whose torque nobody knows are left out, since a load swings and the drive with it.
///
/// A constant load, a load in steps and a soak at one temperature are not faults: only a channel with noise that lost
/// it is frozen.
fn of_channel(log: &mut Log, channel: Quantity, drop: &mut [bool], findings: &mut Findings) {
    let Some(mut values) = log.take(channel) else { return };
    let rows = log.len();
    let (least, most) = least_and_most(values.iter().copied());
    let has_noise = has_noise(log.pieces(&values), ROUND_OFF * (most - least));
    let standing = log.continued().filter(|row| values[*row] == values[row - 1]).count();
    let is_frozen = |stretch: &Range<usize>| {
        // Without this stretch the channel stands in this many of its steps.
        let elsewhere = (standing + 1).saturating_sub(stretch.len()) as f64 / (rows - stretch.len()).max(1) as f64;
        // No load at all is a load, and may be written as exactly nothing; what saturates is known already.
        has_noise && elsewhere < 0.5 && values[stretch.start] != 0.0 && !drop[stretch.start]
    };
    let mut frozen = log.runs(&values, beyond_chance(rows), |a, b| a == b);
    frozen.retain(is_frozen);
    let useless = 2 * frozen.iter().map(Range::len).sum::<usize>() > rows;
    let (treatment, done) = match channel {
        _ if useless => (Treatment::Masked, "the channel is not used"),
        Quantity::Torque => (Treatment::Masked, "they are left out"),
        _ => (Treatment::Repaired, "a straight line is put in its place"),
    };
    for stretch in frozen {
        findings.add(log.fault(FaultName::FrozenChannel, stretch.clone()), channel, treatment, |fault| {
            format!("the {channel} keeps one value over {} rows: {done}", fault.rows)
        });
        if channel == Quantity::Torque && !useless {
            drop[stretch].fill(true);
        } else if log.continues(stretch.end) {
            straight(&mut values, stretch.start, stretch.end);
        }
    }
    if !useless {
        log.put(channel, values);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::Session;

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
        Log::on(&mut sessions, |log| check(log, &Gear::of_ratio(100.0), &mut findings)).unwrap();
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
