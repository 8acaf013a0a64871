//! States passed in steady motion, and the prediction of the next.

use std::collections::{BTreeMap, VecDeque};

use crate::mesh::rotate;

use super::predictor::turn_field;
use super::problem::Problem;
use super::state::State;

/// Number of states that the predictor interpolates in phase, how far off they may be and must be apart (pitches), and
/// the largest weight.
const PHASES: usize = 3;
const PHASE_REACH: f64 = 0.06;
const PHASES_APART: f64 = 1e-3;
const LARGEST_WEIGHT: f64 = 6.0;

/// States of steady motion that are remembered: a fine sampling of one pitch.
const REMEMBERED: usize = 48;

/// The last states of steady motion under one load.
#[derive(Default)]
pub(super) struct Passed {
    /// Oldest first.
    states: VecDeque<State>,
    /// Generator angle at which the motion became steady.
    since: f64,
}

impl Passed {
    /// Whether the motion goes on from here as it was.
    pub(crate) fn go_on(&self, from: &State, torque_n_m: f64) -> bool {
        self.states.back().is_some_and(|last| {
            last.torque_n_m == torque_n_m && from.torque_n_m == torque_n_m && last.travel == from.travel
        })
    }

    /// Remembers a state that was reached by turning; false, and all forgotten, when the motion is not steady.
    pub(crate) fn remember(&mut self, problem: &Problem, state: &State) -> bool {
        let steady = (state.output_rate * problem.drive.ratio() - 1.0).abs() < 0.2;
        let goes_on =
            self.states.back().is_none_or(|last| last.torque_n_m == state.torque_n_m && last.travel == state.travel);
        if !steady || !goes_on {
            self.states.clear();
        }
        if steady {
            if self.states.is_empty() {
                self.since = state.generator_rad;
            }
            if self.states.len() == REMEMBERED {
                self.states.pop_front();
            }
            self.states.push_back(State { friction: BTreeMap::new(), ..state.clone() });
        }
        steady && goes_on
    }

    /// State predicted for a generator angle: the wave turned, the output going on as it did before.
    ///
    /// A drive in steady motion passes through the same state after every flexspline pitch, one tooth further: states
    /// that stood nearly there, whole pitches ago, are turned and interpolated. Otherwise the last state, or one that
    /// needs a smaller fraction of a pitch, is turned. An output that carries no load stays where it is when the
    /// generator reverses: it has the clearance to cross.
    pub fn predict(&self, problem: &Problem, from: &State, generator_rad: f64, torque_n_m: f64) -> State {
        let turn = generator_rad - from.generator_rad;
        if turn == 0.0 {
            return State { torque_n_m, ..from.clone() };
        }
        let idle = problem.per_width(torque_n_m).abs() <= problem.drag;
        let reversing = turn.signum() * from.travel < 0.0;
        let nominal = 1.0 / problem.drive.ratio();
        let pitch = problem.flexspline.pitch();
        let steady = !reversing && (from.output_rate / nominal - 1.0).abs() < 0.2 && self.go_on(from, torque_n_m);
        let off = |state: &State| {
            let pitches = (generator_rad - state.generator_rad) / pitch;
            (pitches - pitches.round()).abs()
        };
        if steady {
            // States of the first pitch may not have settled yet.
            let settled = |state: &State| (state.generator_rad - self.since).abs() > pitch;
            let passed: Vec<&State> = self.states.iter().filter(|state| settled(state)).collect();
            let pitches = |state: &&State| (generator_rad - state.generator_rad) / pitch;
            let weights = phase_weights(&passed.iter().map(pitches).collect::<Vec<_>>());
            if let Some(weights) = weights.filter(|w| w.nearest < 0.5 * off(from)) {
                let states: Vec<(&State, f64)> = weights.states.iter().map(|(k, w)| (passed[*k], *w)).collect();
                return turned_on(problem, from, &states, generator_rad, torque_n_m, |turn| turn * nominal);
            }
        }
        let nearest = self.states.iter().filter(|_| steady).min_by(|a, b| off(a).total_cmp(&off(b)));
        let base = nearest.filter(|state| off(state) < 0.5 * off(from)).unwrap_or(from);
        let output_turn = |turn: f64| match (idle, reversing) {
            (true, true) => 0.0,
            (false, true) => turn * nominal,
            _ if std::ptr::eq(base, from) => from.output_rate * turn,
            _ => turn * nominal,
        };
        turned_on(problem, from, &[(base, 1.0)], generator_rad, torque_n_m, output_turn)
    }
}

/// The weighted sum of states, each with its wave turned to a generator angle and its output by `output_turn` of that.
fn turned_on(
    problem: &Problem,
    from: &State,
    states: &[(&State, f64)],
    generator_rad: f64,
    torque_n_m: f64,
    output_turn: impl Fn(f64) -> f64,
) -> State {
    let (fs, cs) = problem.wheels();
    let mut predicted = State {
        u: vec![0.0; from.u.len()],
        v: vec![0.0; from.v.len()],
        output_rad: 0.0,
        sleeve_moment: 0.0,
        lateral_force: [0.0; 2],
        generator_rad,
        torque_n_m,
        ..from.clone()
    };
    for (state, weight) in states {
        let turn = generator_rad - state.generator_rad;
        let add = |sum: &mut [f64], part: &[f64]| sum.iter_mut().zip(part).for_each(|(x, p)| *x += weight * p);
        add(&mut predicted.u, &turn_field(fs, &state.u, turn));
        add(&mut predicted.v, &turn_field(cs, &state.v, turn - output_turn(turn)));
        predicted.output_rad += weight * (state.output_rad + output_turn(turn));
        predicted.sleeve_moment += weight * state.sleeve_moment;
        add(&mut predicted.lateral_force, &rotate(state.lateral_force, turn.sin_cos()));
    }
    predicted
}

/// States and their weights, and how far (pitches) the nearest of them is.
struct PhaseWeights {
    states: Vec<(usize, f64)>,
    nearest: f64,
}

/// Interpolates (or goes on from) the few states whose distance in pitches is nearest to a whole number; the latest of
/// those that coincide.
fn phase_weights(pitches: &[f64]) -> Option<PhaseWeights> {
    let off = |k: usize| pitches[k] - pitches[k].round();
    let mut order: Vec<usize> = (0..pitches.len()).collect();
    order.sort_by(|a, b| off(*a).abs().total_cmp(&off(*b).abs()).then(b.cmp(a)));
    let mut chosen: Vec<usize> = Vec::new();
    for k in order {
        let apart = chosen.iter().all(|c| (off(*c) - off(k)).abs() > PHASES_APART);
        if apart && off(k).abs() < PHASE_REACH && chosen.len() < PHASES {
            chosen.push(k);
        }
    }
    let nearest = off(*chosen.first()?).abs();
    let weight =
        |k: usize| -> f64 { chosen.iter().filter(|c| **c != k).map(|c| -off(*c) / (off(k) - off(*c))).product() };
    let mut states: Vec<(usize, f64)> = chosen.iter().map(|k| (*k, weight(*k))).collect();
    // Going on too far from states too close together magnifies what they have not settled.
    if states.iter().any(|(_, weight)| weight.abs() > LARGEST_WEIGHT) {
        states = vec![(chosen[0], 1.0)];
    }
    Some(PhaseWeights { states, nearest })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Prediction of a function of the phase by the weights.
    fn predicted(pitches: &[f64], function: impl Fn(f64) -> f64) -> f64 {
        let weights = phase_weights(pitches).unwrap();
        weights.states.iter().map(|(k, weight)| weight * function(pitches[*k] - pitches[*k].round())).sum()
    }

    #[test]
    fn a_parabola_of_the_phase_is_met_exactly() {
        let pitches = [2.992, 5.984, 8.976, 0.3, 1.7];
        let found = predicted(&pitches, |x| 1.0 + 30.0 * x - 400.0 * x * x);
        assert!((found - 1.0).abs() < 1e-9, "{found}");
    }

    #[test]
    fn of_states_at_the_same_phase_the_latest_counts() {
        let weights = phase_weights(&[6.0, 4.0, 2.0]).unwrap();
        assert_eq!(weights.states, [(2, 1.0)]);
        assert_eq!(weights.nearest, 0.0);
    }

    #[test]
    fn states_too_close_together_are_not_gone_on_from() {
        let weights = phase_weights(&[1.05, 2.049]).unwrap();
        assert_eq!(weights.states.len(), 1, "weights of 50 and -49 would magnify what had not settled");
        assert!(phase_weights(&[0.5, 1.4]).is_none());
    }
}
