//! What to record next, to tell look-alikes apart.
//!
//! Each run of a short menu is imagined: the cause named, as it was fitted, is simulated on it without noise, and every
//! look-alike is fitted to that. The run is chosen whose closest look-alike stands off the furthest, in standard
//! deviations (Hunter & Reiner 1965; T-optimality, Atkinson & Fedorov 1975).

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::Fineness;
use super::base::Base;
use super::candidate::{Excitation, Law};
use super::model::{Problem, Scaffold, Term};
use super::noise::Noise;
use super::rows::{Rows, add_scaled, quantile};
use crate::measurement::Session;

/// Generator turns, torque in units of the load scale, K above nominal, orientation in rad.
type RunState = [f64; 4];

/// Rows of an imagined session. *Guess*: enough for the orders of the generator.
const ROWS: usize = 1500;
/// Length of an imagined session, s. *Guess*: what a bench records in one go.
const SECONDS: f64 = 120.0;
/// Runs that separate causes by less than this, in standard deviations, are not worth recording. *Source*: five, as
/// between rivals.
const WORTH_IT: f64 = 5.0;

/// A generator that goes forward and comes back: share of the way.
fn there_and_back(share: f64) -> f64 {
    1.0 - (2.0 * share - 1.0).abs()
}

/// Torque steps of both signs and three sizes.
fn steps(share: f64) -> f64 {
    [0.3, -0.3, 1.0, -1.0, 0.1, -0.1, 0.6, -0.6][((share * 16.0) as usize) % 8]
}

/// A run: its text, and session by session how the drive is driven at a share (0 to 1) of its time.
type Run = (&'static str, &'static [fn(f64) -> RunState]);

/// Runs to choose from.
static MENU: [Run; 6] = [
    (
        "one output turn forward and back at steady torque, once with either sign",
        &[|s| [95.0 * there_and_back(s), 0.7, 0.0, 0.0], |s| [95.0 * there_and_back(s), -0.7, 0.0, 0.0]],
    ),
    (
        "half an output turn forward and back with torque steps of both signs, drive turned against gravity by 0, \
             90 and 180 degrees",
        &[
            |s| [50.0 * there_and_back(s), steps(s), 0.0, 0.0],
            |s| [50.0 * there_and_back(s), steps(s), 0.0, FRAC_PI_2],
            |s| [50.0 * there_and_back(s), steps(s), 0.0, PI],
        ],
    ),
    (
        "torque triangles of three amplitudes through zero, generator creeping",
        &[|s| {
            let amplitude = [0.15, 0.4, 1.0][((s * 3.0) as usize).min(2)];
            let triangle = 2.0 / PI * (TAU * 12.0 * s).sin().asin();
            [2.0 * s, amplitude * triangle, 0.0, 0.0]
        }],
    ),
    (
        "a cold, a hot and again a cold soak, torque steps of both signs at each, slow and fast in both directions",
        &[
            |s| [30.0 * there_and_back(s) * s, steps(s), -35.0, 0.0],
            |s| [30.0 * there_and_back(s) * s, steps(s), 35.0, 0.0],
            |s| [30.0 * there_and_back(s) * s, steps(s), -35.0, 0.0],
        ],
    ),
    (
        "constant speeds from slow to fast in both directions, torque through zero in between",
        &[|s| {
            let run = (s * 8.0).floor();
            let speed = [0.1, -0.1, 0.3, -0.3, 0.6, -0.6, 1.0, -1.0][(run as usize).min(7)];
            let before: f64 = [0.0, 0.1, 0.0, 0.3, 0.0, 0.6, 0.0, 1.0][(run as usize).min(7)];
            [15.0 * (before + speed * (8.0 * s - run)), 0.7 * (TAU * 10.0 * s).sin(), 0.0, 0.0]
        }],
    ),
    (
        "torque steps of both signs with the generator at rest, recorded as fast as the encoder allows",
        &[|s| [0.01 * s, steps(s), 0.0, 0.0]],
    ),
];

/// Speeds that differ by less than this factor are one speed. *Guess*.
const ONE_SPEED: f64 = 1.5;

/// What to record where no look-alike asks for a run: what the data lack, or the same again.
pub(crate) fn anyhow(on: &Excitation<'_>, not_understood: bool) -> String {
    let rows = on.rows;
    let speeds = |share: f64| quantile(rows.speed.iter().map(|speed| speed.abs()).filter(|speed| *speed > 0.0), share);
    let mut asked: Vec<&str> = Vec::new();
    if !rows.recorded.time {
        asked.push("record the time of each row");
    }
    if !rows.recorded.torque {
        asked.push("record the torque at the output");
    }
    if rows.recorded.time && speeds(0.9) < ONE_SPEED * speeds(0.1) {
        asked.push("run at three speeds, one of them a third of this one");
    }
    if rows.sessions_used().count() < 3 {
        asked.push("record three sessions or more");
    }
    if asked.is_empty() {
        let again = if not_understood {
            "the same run slower, at a third of the speed, and once with another load: what stays where it is comes \
             from angles, what moves from time or load"
        } else {
            "the same run again on another day, then with the cause put right: it should come back, and be gone"
        };
        return again.to_owned();
    }
    asked.join("; ")
}

/// Recording that separates n waves of the generator's encoder in a turn from those of a wheel or of the motor: half a
/// period turns them over.
pub(crate) fn turn_the_encoder(waves: f64) -> String {
    format!(
        "the same run with the generator's encoder turned on its shaft by {:.1} degrees, or with another one: an \
         encoder's waves turn over with it, those of a wheel and of the motor stay",
        180.0 / waves
    )
}

/// The run of the menu that tells `term` from each of `alike` best, with how far the closest then stands off.
pub fn next(
    on: &Excitation<'_>,
    term: &Term<'_>,
    coefficients: &[f64],
    alike: &[&Law],
    noise: Noise,
) -> Option<(String, f64)> {
    use rayon::prelude::*;
    let apart = |(text, run): &Run| (*text, least_apart(on, run, term, coefficients, alike, noise).unwrap_or(0.0));
    let all: Vec<(&str, f64)> = MENU.par_iter().map(apart).collect();
    let (text, apart) = all.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    (apart > WORTH_IT).then(|| (text.to_owned(), apart))
}

/// Standard deviations by which the closest of `alike` misses what `term` would do on a run.
fn least_apart(
    on: &Excitation<'_>,
    run: &[fn(f64) -> RunState],
    term: &Term<'_>,
    coefficients: &[f64],
    alike: &[&Law],
    noise: Noise,
) -> Option<f64> {
    let sessions: Vec<Session> = run
        .iter()
        .enumerate()
        .map(|(k, at)| {
            let states: Vec<RunState> = (0..ROWS).map(|row| at(row as f64 / ROWS as f64)).collect();
            let column = |of: usize, value: &dyn Fn(f64) -> f64| states.iter().map(|state| value(state[of])).collect();
            let time_s = (0..ROWS).map(|row| SECONDS * (2.0 * k as f64 + row as f64 / ROWS as f64)).collect();
            let generator_rad = column(0, &|turns| TAU * turns * on.nominal.ratio.abs() / 95.0);
            let others = [
                column(1, &|torque| torque * on.scales.load),
                column(2, &|warmer| on.nominal.temperature_c + warmer),
                column(3, &|orientation| orientation),
            ];
            Session::imagined(time_s, generator_rad, others)
        })
        .collect();
    let mut rows = Rows::new(&sessions, on.nominal);
    let base = Base::new(&rows, on.nominal, None);
    let mut truth = base.prediction.clone();
    {
        let imagined = Excitation { rows: &rows, base: &base, ..*on };
        for (column, c) in term.law.columns(&imagined, &term.values()).iter().zip(coefficients) {
            add_scaled(&mut truth, &column.values, *c);
        }
    }
    rows.error = truth;
    let imagined = Excitation { rows: &rows, base: &base, ..*on };
    let problem = Problem::new(imagined, &base.uncertain, Fineness { stride: 1, noise, worth: 1.0 });
    let scaffold = Scaffold::new(&problem, Vec::new());
    let own = scaffold.fit(Some(&Term::new(&problem, term.law, term.places.clone())))?.solution.misfit;
    let mut least = f64::INFINITY;
    for law in alike {
        let best = scaffold
            .begin(law)
            .into_iter()
            .filter_map(|places| Some((scaffold.trial(law, &places, false)?.misfit, places)))
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        let (_, fit) = scaffold.refine(Term::new(&problem, law, best.1))?;
        least = least.min((fit.solution.misfit - own).max(0.0).sqrt());
    }
    Some(least)
}
