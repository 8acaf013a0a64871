//! A resolution so coarse that no noise blurs it.

use std::collections::HashSet;
use std::ops::Range;

use super::held::{Runs, goes_on_between};
use super::lattice::lattice;
use super::steps::largest_torque;
use super::{ARCSEC, Findings, runs, throughout};
use crate::measurement::Session;
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{Fault, FaultName, Treatment};
use crate::measurement::gear::Gear;
use flexspline_base::robust::{median_of, white_noise};

/// Steps at the output below this are those of good encoders, and below what a drive repeats. *Source*: derived, 19
/// bits a turn; that these are the good ones is a guess.
const COARSE_RAD: f64 = 2.5 * ARCSEC;
/// Noise of more than this share of a step blurs it, so that averages go below the step; a step alone leaves 0.29 of
/// it. *Guess*: half a step of noise, of which an average shows next to nothing, makes 0.58 with the rounding, and the
/// noise of a file is known to a fifth.
const BLURRED: f64 = 0.7;

/// A step is real if the output leaves this share of it as noise… *Guess*: half of the 0.29 that rounding leaves.
const SEEN: f64 = 0.15;
/// …or, in even motion, the channel's changes from row to row are uneven by a step in this share. *Guess*: an exact one
/// is uneven nowhere.
const UNEVEN: f64 = 0.1;
/// A generator that goes from stop to stop by the same angle lies on a lattice too, and is exact. What is rounded is in
/// the error, which differs by 0.4 steps on the mean from one reading to another: where half of them differ by less
/// than this share, nothing is. *Guess*.
const ROUNDED: f64 = 0.1;
/// Rows from one reading to another. At a speed that is nearly a whole number of steps to a row the next one is rounded
/// by just about as much, and a later one is not. *Guess*: octaves, of which one is not near a whole number.
const APART: [usize; 4] = [1, 2, 4, 8];

/// Steps of a torque of less than this share of the largest load are no matter: those of eight bits are. *Guess*.
const LEAST_STEP: f64 = 0.004;
/// Steps are those of a sensor, and not weights that somebody put on and wrote down, if there are this many of them, …
/// *Guess*: nobody writes down as many weights.
const MANY_STEPS: usize = 12;
/// … and this share of the runs of one value is shorter than [`TORN_ROWS`] or goes on to the next step. *Guess*:
/// weights that are put on by hand are neither.
const TORN: f64 = 0.2;
/// Rows of a run that noise or a change has torn, less than. *Guess*: no weight is put on for so short.
const TORN_ROWS: usize = 3;

/// Resolutions that show in the data, in rad at the output.
pub(super) fn seen(sessions: &[Session], gear: &Gear, error_recorded: bool) -> Vec<(Quantity, f64)> {
    let Some((session, noise)) = longest(sessions) else { return Vec::new() };
    let (generator, output) = (&session.generator_rad, session.output_rad(gear.ratio));
    let uneven = |values: &[f64], step: f64| {
        let bends = values.windows(3).filter(|v| (v[2] - 2.0 * v[1] + v[0]).abs() > 0.5 * step).count();
        bends as f64 >= UNEVEN * values.len() as f64
    };
    let mut found = Vec::new();
    let (channel, measured) =
        if error_recorded { (Quantity::Error, &session.error_rad) } else { (Quantity::Output, &output) };
    if let Some(step) = lattice(measured)
        && (noise >= SEEN * step || uneven(measured, step))
    {
        found.push((channel, step));
    }
    if let Some(step) = lattice(generator)
        && uneven(generator, step)
        && differs(generator, &session.error_rad, step) >= ROUNDED * step / gear.ratio.abs()
    {
        found.push((Quantity::Generator, step / gear.ratio.abs()));
    }
    found
}

/// The longest session, and the white noise of the error of all, rad.
fn longest(sessions: &[Session]) -> Option<(&Session, f64)> {
    let session = sessions.iter().max_by_key(|session| session.len())?;
    Some((session, white_noise(sessions.iter().map(|session| session.error_rad.as_slice()))))
}

/// By how much the error differs, at the median, from one row to another where a channel has moved by a step or more,
/// rad: at that distance of [`APART`] where it differs most.
fn differs(channel: &[f64], error: &[f64], step: f64) -> f64 {
    let at = |apart: usize| {
        let moved = (apart..channel.len()).filter(|row| (channel[*row] - channel[row - apart]).abs() > 0.5 * step);
        median_of(&mut moved.map(|row| (error[row] - error[row - apart]).abs()).collect::<Vec<f64>>())
    };
    APART.into_iter().map(at).fold(0.0, f64::max)
}

/// Names a resolution of output or generator that is coarse at the output; nothing can be done about it but to know
/// that rounding is a noise.
pub(in crate::measurement) fn check(
    sessions: &mut [Session],
    gear: &Gear,
    error_recorded: bool,
    findings: &mut Findings,
) {
    let mut coarsest = 0.0f64;
    let Some((session, noise)) = longest(sessions) else { return };
    for (channel, step) in seen(sessions, gear, error_recorded) {
        if step < COARSE_RAD || noise > BLURRED * step {
            continue;
        }
        coarsest = coarsest.max(step);
        let fault = throughout(std::slice::from_ref(session), FaultName::Quantisation);
        let fault = fault.map(|fault| Fault { size_arcsec: Some(step / ARCSEC), ..fault });
        findings.add(fault, channel, Treatment::Kept, |_| {
            format!(
                "the {channel} has a resolution of {:.2} arcsec at the output, and too little noise to blur it ({:.2} \
                 arcsec)",
                step / ARCSEC,
                noise / ARCSEC
            )
        });
    }
    sessions.iter_mut().for_each(|session| session.coarse_rad = coarsest);
}

/// Names a torque that a sensor writes in steps that matter. Where the load goes on between them a curve takes their
/// place (cubic, with the slopes of the steps around): from one step to the next the load is halfway. Steps of weights
/// that are put on are the load itself.
pub(in crate::measurement) fn check_torque(sessions: &mut [Session], findings: &mut Findings) {
    let torque_of = |session: &Session| session.torque_n_m.clone().unwrap_or_default();
    let torques: Vec<Vec<f64>> = sessions.iter().map(torque_of).collect();
    // A session of few loads shows a multiple of the step.
    let Some(step) = torques.iter().filter_map(|torque| lattice(torque)).min_by(f64::total_cmp) else { return };
    let steps: HashSet<i64> = torques.iter().flatten().map(|torque| (torque / step).round() as i64).collect();
    if step < LEAST_STEP * largest_torque(sessions) || steps.len() < MANY_STEPS {
        return;
    }
    let of: Vec<Runs> = torques.iter().map(|torque| runs(torque, |a, b| a == b)).collect();
    let by_one = |a: f64, b: f64| (b - a).abs() < 1.5 * step;
    let (mut count, mut torn) = (0, 0);
    for (torque, runs) in torques.iter().zip(&of) {
        for pair in runs.windows(2) {
            count += 1;
            torn += usize::from(by_one(torque[pair[0].start], torque[pair[1].start]) || pair[0].len() < TORN_ROWS);
        }
    }
    let fault = throughout(sessions, FaultName::Quantisation).filter(|_| torn as f64 >= TORN * f64::from(count));
    let goes_on = fault.is_some() && goes_on_between(sessions, &of);
    let (treatment, between) = if goes_on {
        (Treatment::Repaired, "the load goes on between them: a curve from one change to the next stands in")
    } else {
        (Treatment::Kept, "what the load does within a step is not seen")
    };
    findings.add(fault, Quantity::Torque, treatment, |_| {
        format!("the torque is written in steps of {step:.3} N·m: {between}")
    });
    for (session, (written, runs)) in sessions.iter_mut().zip(torques.iter().zip(&of)).filter(|_| goes_on) {
        let Some(torque) = &mut session.torque_n_m else { continue };
        for near in runs.windows(3) {
            let [before, here, after] = [0, 1, 2].map(|k| written[near[k].start]);
            let end = |other: f64| if by_one(here, other) { 0.5 * (here + other) } else { here };
            let rows = near[1].len() as f64;
            let rise = |other: &Range<usize>, by: f64| {
                if by_one(0.0, by) { by / (0.5 * (rows + other.len() as f64)) } else { 0.0 }
            };
            let (from, to) = (end(before), end(after));
            let (leaves, arrives) = (rise(&near[0], here - before), rise(&near[2], after - here));
            for (k, torque) in torque[near[1].clone()].iter_mut().enumerate() {
                let share = (k as f64 + 0.5) / rows;
                let rest = 1.0 - share;
                let curve = rest * rest * (from + share * (2.0 * from + rows * leaves))
                    + share * share * (to + rest * (2.0 * to - rows * arrives));
                *torque = curve.clamp(here - 0.5 * step, here + 0.5 * step);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ratio of the made-up drive. *Guess*: a round one; any would do.
    const RATIO: f64 = 100.0;

    fn session(rows: u32, generator: impl Fn(f64) -> f64, read_as: impl Fn(f64) -> f64) -> Session {
        let mut random = fastrand::Rng::with_seed(3);
        let mut session = Session::default();
        for k in 0..rows {
            let psi = generator(f64::from(k));
            let noise = (random.f64() + random.f64() + random.f64() - 1.5) * 2.0;
            let output = psi / RATIO + (15.0 * (2.0 * psi).sin() + 1.7 * noise) * ARCSEC;
            session.push([f64::NAN, read_as(psi), output - read_as(psi) / RATIO, f64::NAN]);
        }
        session
    }

    fn of_generator(session: Session) -> Option<f64> {
        let found = seen(&[session], &Gear::of_ratio(RATIO), false);
        found.into_iter().find(|(channel, _)| *channel == Quantity::Generator).map(|(_, step)| step)
    }

    #[test]
    fn stops_at_even_distances_are_no_resolution() {
        // Seven readings at each stop.
        let stops = |k: f64| 1.1 * (k / 7.0).floor();
        assert_eq!(of_generator(session(6000, stops, |psi| psi)), None);
    }

    #[test]
    fn a_coarse_encoder_is_one_at_a_speed_of_nearly_whole_steps_to_a_row() {
        // Of 8 bits a turn, in legs of three and of six steps to a row, and a little more, with rests between.
        let step = std::f64::consts::TAU / 256.0;
        let turns = |k: f64| {
            let (leg, in_leg) = ((k / 400.0).floor(), (k % 400.0).min(330.0));
            let by = if leg % 2.0 == 0.0 { 3.056 } else { -6.11 };
            step * (by * in_leg + (leg / 2.0).ceil() * 330.0 * 3.056 - (leg / 2.0).floor() * 330.0 * 6.11)
        };
        let found = of_generator(session(6000, turns, |psi| step * (psi / step).round()));
        assert!((found.expect("coarse") * RATIO - step).abs() < 1e-3 * step, "{found:?}");
    }

    #[test]
    fn a_coarse_encoder_of_a_generator_that_turns_on_is_one() {
        // Steps of 0.1 rad of the generator are 206 arcsec at the output.
        let found = of_generator(session(6000, |k| 0.037 * k, |psi| 0.1 * (psi / 0.1).floor()));
        assert!((found.expect("coarse") * RATIO - 0.1).abs() < 1e-3, "{found:?}");
    }

    #[test]
    fn steps_of_a_sensor_are_named_and_weights_are_not() {
        let mut random = fastrand::Rng::with_seed(2);
        let levels: Vec<f64> = (0..60).map(|_| 25.0 * (2.0 * random.f64() - 1.0)).collect();
        let named = |step: f64, load: &dyn Fn(f64) -> f64| {
            let written = (0..6000).map(|k| (load(0.01 * f64::from(k)) / step).round() * step).collect();
            let generator_rad = (0..6000).map(|k| 0.04 * f64::from(k)).collect();
            let (line, error_rad) = ((2..6002).collect(), vec![0.0; 6000]);
            let session = Session { line, generator_rad, error_rad, torque_n_m: Some(written), ..Session::default() };
            let mut findings = Findings::default();
            check_torque(&mut [session], &mut findings);
            findings.faults.pop().map(|fault| (fault.name, fault.channel, fault.treatment))
        };
        let quantisation = Some((FaultName::Quantisation, Some(Quantity::Torque), Treatment::Kept));
        // Put on within three rows.
        let put_on = |t: f64| {
            let (at, since) = ((t as usize).min(58), (t.fract() / 0.03).min(1.0));
            levels[at] + since * (levels[at + 1] - levels[at])
        };
        assert_eq!(named(1.0, &put_on), quantisation);
        assert_eq!(named(1.0, &|t| levels[(t as usize).min(59)]), None);
        let swings = |t: f64| 25.0 * (0.9 * t).sin() + 6.0 * (2.3 * t).cos();
        assert_eq!(named(5.0, &swings), quantisation);
        // Digits are no steps.
        assert_eq!(named(1e-3, &swings), None);
    }

    #[test]
    fn a_load_that_goes_on_between_steps_is_read_off() {
        let load = |t: f64| 25.0 * (0.9 * t).sin() + 6.0 * (2.3 * t).cos();
        let times = || (0..6000).map(|k| 0.01 * f64::from(k));
        // 30 µrad per N·m.
        let mut sessions = [Session {
            line: (2..6002).collect(),
            generator_rad: times().map(|t| 4.0 * t).collect(),
            error_rad: times().map(|t| 3e-5 * load(t)).collect(),
            torque_n_m: Some(times().map(|t| (load(t) / 2.5).round() * 2.5).collect()),
            ..Session::default()
        }];
        let mut findings = Findings::default();
        check_torque(&mut sessions, &mut findings);
        assert_eq!(findings.faults.pop().expect("a fault").treatment, Treatment::Repaired);
        let torque = sessions[0].torque_n_m.as_ref().unwrap();
        let rms = (times().zip(torque).map(|(t, of)| (of - load(t)).powi(2)).sum::<f64>() / 6000.0).sqrt();
        // Rounding leaves 2.5/√12 = 0.72.
        assert!(rms < 0.36, "{rms}");
    }
}
