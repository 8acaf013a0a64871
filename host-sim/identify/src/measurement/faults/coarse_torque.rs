//! A torque that is written in coarse steps while the load goes on between them: laws of the load would see steps that
//! the drive does not make.
//!
//! Where the column goes from one step to the next the load is halfway between them: a curve through these points,
//! within half a step of what is written, stands in. A load that is put on in steps moves the error within the row,
//! too, and is left alone.

use std::collections::HashSet;

use super::held::{Runs, goes_on_between};
use super::lattice::lattice;
use super::steps::largest_torque;
use super::{Findings, leave_out, rows_of, runs, throughout};
use crate::measurement::Session;
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{FaultName, Treatment};
use flexspline_base::robust::median_of;

/// Steps of less than this share of the largest load are no matter: those of eight bits are. *Guess*.
const LEAST_STEP: f64 = 0.004;
/// Steps are those of a sensor, and not weights that somebody put on and wrote down, if there are this many of them, …
/// *Guess*: nobody writes down as many weights.
const MANY_STEPS: usize = 12;
/// … and this share of the runs of one value is shorter than [`LEAST_ROWS`]: noise and changes tear them. *Guess*:
/// weights that are put on by hand are not torn.
const TORN: f64 = 0.2;
/// Rows to a step at least on either side of a change that is looked at. *Guess*: fewer give no level.
const LEAST_ROWS: usize = 3;
/// A change by more steps than this is by more than one. *Source*: derived, half way between one step and two.
const MORE_THAN_ONE: f64 = 1.5;
/// Changes to and fro between the same two steps within this many rows are one, which noise has torn. *Guess*.
const TORN_ROWS: f64 = 12.0;
/// A step that lasts this many times as long as most says little of the load: its rows are left out. *Guess*.
const LONG: f64 = 8.0;
/// Rows far from a change are left out as long as this share of the rows stays. *Guess*: fewer would leave little to
/// diagnose.
const STAYS: f64 = 0.5;

/// Where the load is known: between two rows (in rows), and how large it is there, N·m.
type Known = (f64, f64);

/// Names a torque in coarse steps, and puts the load between them in its place.
pub(in crate::measurement) fn check(sessions: &mut Vec<Session>, findings: &mut Findings) {
    // A session of few loads shows a multiple of the step.
    let steps = sessions.iter().filter_map(|session| lattice(session.torque_n_m.as_deref()?));
    let Some(step) = steps.min_by(f64::total_cmp) else { return };
    if step < LEAST_STEP * largest_torque(sessions) {
        return;
    }
    let fault = throughout(sessions, FaultName::Quantisation);
    let torques = sessions.iter().map(|session| session.torque_n_m.as_deref().unwrap_or_default());
    let levels: Vec<Runs> = torques.map(|torque| runs(torque, |a, b| a == b)).collect();
    if !goes_on_between(sessions, &levels) {
        let fault = fault.filter(|_| is_of_a_sensor(sessions, step));
        findings.add(fault, Quantity::Torque, Treatment::Kept, |_| {
            format!(
                "the torque is written in steps of {step:.3} N·m: what the load does within a step is not seen, and \
                 nothing in the rows tells it"
            )
        });
        return;
    }
    let of = |session: &Session| session.torque_n_m.as_deref().map_or_else(Vec::new, |torque| stretches(torque, step));
    let known: Vec<Vec<Vec<Known>>> = sessions.iter().map(of).collect();
    let pairs = known.iter().flatten().flat_map(|known| known.windows(2));
    let mut lasting: Vec<f64> = pairs.map(|pair| pair[1].0 - pair[0].0).collect();
    let long = LONG * median_of(&mut lasting);
    let rows = rows_of(sessions);
    let mut drop: Vec<Vec<bool>> = sessions.iter().map(|s| vec![s.torque_n_m.is_some(); s.len()]).collect();
    for ((session, known), drop) in sessions.iter_mut().zip(&known).zip(&mut drop) {
        if let Some(torque) = &mut session.torque_n_m {
            known.iter().for_each(|known| between(torque, known, step, long, drop));
        }
    }
    let out = drop.iter().flatten().filter(|out| **out).count();
    let is_few = (out as f64) < (1.0 - STAYS) * rows as f64;
    if is_few {
        leave_out(sessions, &drop);
        sessions.retain(|session| !session.is_empty());
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

/// Whether steps are those of a sensor, between which nothing shows where the load is.
fn is_of_a_sensor(sessions: &[Session], step: f64) -> bool {
    let torques = || sessions.iter().filter_map(|session| session.torque_n_m.as_deref());
    let runs: Vec<usize> = torques().flat_map(|torque| runs(torque, |a, b| a == b)).map(|run| run.len()).collect();
    let torn = runs.iter().filter(|rows| **rows < LEAST_ROWS).count();
    let steps: HashSet<i64> = torques().flatten().map(|torque| (torque / step).round() as i64).collect();
    steps.len() >= MANY_STEPS && (torn as f64) >= TORN * runs.len() as f64
}

/// Where the load of a session is known, in stretches without a change by more than one step: there it is put on, or
/// goes on too fast.
fn stretches(torque: &[f64], step: f64) -> Vec<Vec<Known>> {
    let mut found: Vec<Vec<Known>> = vec![Vec::new()];
    // Rows that a change torn by noise begins and ends at, and what it is halfway between.
    let mut torn: Option<(f64, f64, f64)> = None;
    let whole = |(from, to, of): (f64, f64, f64)| (0.5 * (from + to), of);
    for row in 1..torque.len() {
        let by = (torque[row] - torque[row - 1]).abs();
        if by == 0.0 {
            continue;
        }
        let (at, middle) = (row as f64 - 0.5, 0.5 * (torque[row] + torque[row - 1]));
        let put_on = by > MORE_THAN_ONE * step;
        torn = match torn {
            Some((from, to, of)) if of == middle && at - to <= TORN_ROWS && !put_on => Some((from, at, of)),
            other => {
                if let (Some(stretch), Some(of)) = (found.last_mut(), other) {
                    stretch.push(whole(of));
                }
                (!put_on).then_some((at, at, middle))
            }
        };
        if put_on {
            found.push(Vec::new());
        }
    }
    if let (Some(stretch), Some(of)) = (found.last_mut(), torn) {
        stretch.push(whole(of));
    }
    found
}

/// Slopes of the natural cubic spline through what is known: of all curves the least bent one, as a load is that a
/// machine swings. A tridiagonal system, solved by elimination (Thomas).
fn slopes(known: &[Known]) -> Vec<f64> {
    let length = |k: usize| known[k + 1].0 - known[k].0;
    let chord = |k: usize| (known[k + 1].1 - known[k].1) / length(k);
    let Some(last) = known.len().checked_sub(1).filter(|last| *last > 0) else { return vec![0.0; known.len()] };
    // Before, on and after the diagonal, and the right side.
    let row = |k: usize| match k {
        0 => [0.0, 2.0, 1.0, 3.0 * chord(0)],
        k if k == last => [1.0, 2.0, 0.0, 3.0 * chord(last - 1)],
        k => {
            let (h, g) = (length(k - 1), length(k));
            [g, 2.0 * (h + g), h, 3.0 * (g * chord(k - 1) + h * chord(k))]
        }
    };
    let (mut after, mut slopes) = (Vec::with_capacity(last + 1), Vec::with_capacity(last + 1));
    for k in 0..=last {
        let [before, on, next, right] = row(k);
        let (above, known) = if k > 0 { (after[k - 1], slopes[k - 1]) } else { (0.0, 0.0) };
        let pivot = on - before * above;
        after.push(next / pivot);
        slopes.push((right - before * known) / pivot);
    }
    for k in (0..last).rev() {
        slopes[k] -= after[k] * slopes[k + 1];
    }
    slopes
}

/// Puts a curve through what is known in the place of the torque, within half a step of it, and says of which rows: not
/// those of a step that lasts `long`.
fn between(torque: &mut [f64], known: &[Known], step: f64, long: f64, drop: &mut [bool]) {
    let slopes = slopes(known);
    for (k, pair) in known.windows(2).enumerate() {
        let [(from, low), (to, high)] = [pair[0], pair[1]];
        let length = to - from;
        for row in from.ceil() as usize..=to.floor() as usize {
            let share = (row as f64 - from) / length;
            let rest = 1.0 - share;
            let curve = rest * rest * ((1.0 + 2.0 * share) * low + share * length * slopes[k])
                + share * share * ((1.0 + 2.0 * rest) * high - rest * length * slopes[k + 1]);
            torque[row] = curve.clamp(torque[row] - 0.5 * step, torque[row] + 0.5 * step);
            drop[row] = length > long;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn steps_of_a_sensor_are_named_where_the_load_is_put_on_and_weights_are_not() {
        let mut random = fastrand::Rng::with_seed(2);
        let mut levels = Vec::new();
        (0..60).for_each(|_| levels.push(25.0 * (2.0 * random.f64() - 1.0)));
        // Put on within three rows.
        let load = |t: f64| {
            let (at, since) = ((t as usize).min(58), (t.fract() / 0.03).min(1.0));
            levels[at] + since * (levels[at + 1] - levels[at])
        };
        let mut findings = Findings::default();
        check(&mut sessions(1.0, load, load), &mut findings);
        let fault = findings.faults.pop().expect("a fault");
        assert_eq!((fault.name, fault.treatment), (FaultName::Quantisation, Treatment::Kept));
        let weights = |t: f64| levels[(t as usize).min(59)].round();
        check(&mut sessions(1.0, weights, weights), &mut findings);
        assert!(findings.faults.is_empty());
    }

    #[test]
    fn a_load_between_coarse_steps_is_read_off_and_one_in_steps_is_left_alone() {
        let load = |t: f64| 25.0 * (0.9 * t).sin() + 6.0 * (2.3 * t).cos();
        let mut rounded = sessions(5.0, load, load);
        let mut findings = Findings::default();
        check(&mut rounded, &mut findings);
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
        check(&mut put_on, &mut findings);
        assert!(findings.faults.is_empty() && put_on == before);
        // Digits are no steps.
        let mut fine = sessions(1e-3, load, load);
        check(&mut fine, &mut findings);
        assert!(findings.faults.is_empty());
    }
}
