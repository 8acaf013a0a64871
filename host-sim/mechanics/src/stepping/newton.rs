//! Newton's method on the whole drive, the same for both solvers; only the wheels differ (see [`Wheels`]).
//!
//! Unknowns are the displacements of both wheels and, as a dense border, the output angle, the moment of the sleeve (a
//! Lagrange multiplier when the sleeve is rigid), its lateral force, and those of its shells on waves of the bore. One
//! increment:
//!
//! predict, lay out the contact; repeat { assemble; done? factorise; solve; update } until done.

use std::collections::VecDeque;
use std::rc::Rc;
use std::time::{Duration, Instant};

use crate::contact::{AlongFace, BoreLaw, Configuration, FlankContact, FlankLaw, FlankPair, Lean};
use crate::fem::{Border, BorderedSystem};

use super::error::SolveError;
use super::fast::{CondensedWheels, Kept};
use super::near::{NearPairs, configuration};
use super::passed::Passed;
use super::problem::Problem;
use super::reference::SparseWheels;
use super::slip::{Field, Slipping};
use super::state::State;
use super::step::{ANCHORED, BORDERS, LATERAL, OUTPUT, Residual, SLEEVE, Step, improve};
use super::wheels::Wheels;

/// Pairs closer than this (mm) get a place in the sparsity pattern.
const PATTERN_REACH: f64 = 0.04;
/// Stiffness (N/mm per mm) that anchors one node of the flexspline while the matrix is factorised; the border takes it
/// out again.
pub(super) const ANCHOR: f64 = 1e5;
/// Springs (N/mm per mm) that are tried in turn when the tangent is not positive definite.
const GROUNDED_SPRINGS: [f64; 4] = [1e-3, 1e-1, 1e1, 1e3];
/// Largest change of a displacement that an undamped Newton step may make, modules: a drive twice as large goes the
/// same way.
const LARGEST_STEP: f64 = 0.2;
/// Largest first step of a changing load, N m.
const LARGEST_LOAD_STEP: f64 = 100.0;
/// Factors on the penalties while the way to a new load is found.
const LOADING_SOFTNESS: [f64; 3] = [1e-3, 3e-2, 1.0];
/// No way at all: contact as hard as it is.
const DIRECTLY: [f64; 1] = [1.0];
/// Factors on the penalties on the way to a far place: of 1, 0.1, 0.03, 0.01 and (0.001, 0.03) before 1 this takes the
/// fewest iterations where most are needed (20 to 30; cam, 5 µm of eccentricity and pitch errors, 4 and 100 N·m).
const JUMPING_SOFTNESS: [f64; 2] = [1e-2, 1.0];
/// Relative residual at which a stage with soft contact is done: it only finds the way. Drives of all four generators
/// to their rated load and over a tooth pitch (HHD-95, coarse) take 1002 iterations with the tolerance of the last
/// stage, 877 with 1e-2, 825 with 1e-1, and end within 1e-5″ of one another.
const FOUND_THE_WAY: f64 = 0.1;
/// Share of the new load from which on the load that there is shows the way by itself, and contact need not be softened
/// first: the same drives then take 716 iterations. A guess: between the loads of a data sheet it is 0.19 and more,
/// from its light touch on 0.005.
const SHOWS_THE_WAY: f64 = 0.03;
/// Stiffness of the bore (N/mm³) below which it is not softened: the softest penalty on the way to a new load.
const SOFTEST_BORE: f64 = 1e3;
/// Soft stages of further ways to deform a drive whose usual way ends, each with patience. Rollers in a soft bearing
/// creep: a CSG-32-120 with cup and balls and a rim of 1.05 mm takes 97 iterations, of 0.8 and 1.3 mm 34 and 43.
const DEFORMING_SOFTNESS: [&[f64]; 3] = [&[1e-3, 1.0], &[1e-3, 3e-2, 1.0], &[1e-2, 1e-1, 1.0]];
/// Iterations of one increment, all its parts and ways together, over those that Newton has before an increment is
/// halved: so much work at most, whatever it leads to. A guess, far above what increments that converge take.
const MOST_WORK: usize = 100;
/// Share of the output's largest stiffness below which a load that finds no equilibrium is taken for one that the drive
/// does not bear: it softens as teeth begin to climb over one another. A guess: half.
const GIVES_WAY: f64 = 0.5;
/// Iterations after which the next part of an increment may be twice as large.
const EASY: usize = 10;
/// Halvings after which Newton is given so many times the iterations. Heavily loaded rollers creep along their way, and
/// halving does not shorten it: of nine drives that failed with 60 iterations at 63 % of their rated load and more,
/// eight converge with 200, in less time than failing took.
const PATIENT_AFTER: usize = 2;
const PATIENCE: usize = 4;

/// Share of the force along a step that may act back at its end. Where contact opens and closes with each step,
/// iterations that give back nearly all they took go round in a circle: after so many they may give back less.
/// (Straight teeth that wedge in a cup, loaded to 24 N·m.)
const RETURNS: f64 = 0.9;
const RETURNS_LITTLE: f64 = 0.3;
const GOES_ROUND_AFTER: usize = 25;

/// Halvings of a step after which the pairs that were open are looked at again before it is made shorter still: far
/// from equilibrium a flank may come past the tip of a space, where its gap changes by more than it moves, and bear in
/// a state that took it for open. Not while the drive is assembled: from so far off a step that took in all that bears
/// may carry every flank out of reach, and then nothing holds an output without drag.
const LOOKS_BACK_AT: usize = 5;

/// Relative residual below which steps are taken whole: what is left is near round-off.
const ROUND_OFF: f64 = 1e-6;

/// Gain of an iteration after which the last factor serves again.
const CHORD_GAIN: f64 = 0.2;
/// Fraction of a pitch off which a tangent of an earlier pitch still serves, and the gain that each iteration must then
/// make.
const RECALL_WITHIN: f64 = 0.06;
const RECALL_GAIN: f64 = 0.3;
/// A tangent made further from equilibrium than this (relative residual) knows the wrong contact.
const KEEP_BELOW: f64 = 0.1;
/// Layouts of the contact in one increment.
const MOST_LAYOUTS: usize = 3;
/// Halvings of a step along which forces turn round: it is taken then as it is.
const MOST_TRIALS: usize = 10;
/// Parts of one increment at most. *Guess*: a load of 100 kN m that comes on without a single easy part has 1000.
const MOST_PARTS: usize = 10_000;
/// Stiffness (N mm/mm per rad) of an output that nothing holds and nothing turns, so that the wheels have a step. Of
/// any size: no torque acts on it.
const HOLDS_A_FREE_OUTPUT: f64 = 1.0;
/// Why Newton finds no place for an output that nothing holds.
const FLOATS: &str = "without load and without drag nothing holds the output within its clearance; give it a load, or \
                      output.drag_torque_n_m";
/// Tangents remembered.
const TANGENTS: usize = 12;

/// How a new load is brought on.
#[derive(Clone, Copy, PartialEq)]
enum Way {
    /// With contact as hard as it is.
    Directly,
    /// With soft contact first, which only finds the way.
    Softly,
    /// With soft contact first, each stage brought to its end.
    Carefully,
}

/// A converged increment.
#[derive(Debug, Clone)]
pub struct Increment {
    /// Newton iterations, halved increments included.
    pub iterations: usize,
    /// Residual relative to the largest contact force.
    pub residual: f64,
    /// Tooth flanks that carry load.
    pub flank_contacts: usize,
    /// Bore edges that touch the generator.
    pub generator_contacts: usize,
    /// Torque of the generator on the flexspline, N m (positive turns it forward).
    pub generator_torque_n_m: f64,
    /// Torque of the flanks on the circular spline, N m.
    pub flank_torque_n_m: f64,
    /// Drag torque on the output, N m.
    pub drag_torque_n_m: f64,
    /// How far the output turns for one more N m of load, the generator held: rad/(N m).
    pub compliance_rad_per_n_m: f64,
    /// Force of the generator along its major axis on the half of the rim at 0°, outward, N.
    pub lobe_force_n: f64,
    /// Largest contact pressure on a flank and on the bore, MPa; on a flank that of two elastic bodies under its force,
    /// where the load along the face is largest ([`FlankContact::peak_pressure_mpa`]); on the bore that of the penalty.
    pub peak_pressure_mpa: [f64; 2],
    /// The teeth and the load along the face.
    pub face: Face,
}

/// The teeth along their face, which a plane slice takes for straight, and how the load lies along it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Face {
    /// Largest tilt of a tooth, outward along its face, rad; the taper is no part of it.
    pub tilt_rad: f64,
    /// Largest skew of a tooth, around along its face, rad.
    pub skew_rad: f64,
    /// Load along the face of the flank with the largest load for its width anywhere: peak over mean. 1 where nothing
    /// leans, or nothing bears.
    pub peak_over_mean: f64,
    /// Share of the face of that flank that bears.
    pub share: f64,
}

impl Face {
    /// Straight teeth, evenly loaded.
    pub const EVEN: Face = Face { tilt_rad: 0.0, skew_rad: 0.0, peak_over_mean: 1.0, share: 1.0 };
}

/// Time spent in the parts of the solver, by the clock.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Effort {
    /// Element tangents, forces and their assembly.
    pub assembly: Duration,
    /// Contact search, forces and tangents.
    pub contact: Duration,
    /// Ordering and symbolic factorisation.
    pub analysis: Duration,
    /// Numerical factorisation.
    pub factorisation: Duration,
    /// Triangular solves.
    pub solution: Duration,
    /// Number of factorisations.
    pub factorisations: usize,
}

/// Newton solver with its work space: one per thread.
pub struct Solver<'p> {
    problem: &'p Problem,
    flanks: FlankContact<'p>,
    wheels: Box<dyn Wheels + 'p>,
    /// Number of each circular-spline node among the free nodes of the system.
    cs_index: Vec<Option<u32>>,
    border: Border,
    /// The border eliminated with the last factor, once there is one.
    eliminated: Option<Rc<BorderedSystem>>,
    /// Pitches by which the state is turned against the one that the factor was made for.
    turned: isize,
    /// Relative residual of the state that the factor was made for.
    made_at: f64,
    /// Tangents of steady motion, oldest first.
    tangents: VecDeque<Tangent>,
    /// What the tangent leaves out.
    slipping: Slipping,
    /// Factor on the penalties, below 1 only while the way to a new shape or load is found.
    softening: f64,
    /// While the drive is assembled its flanks slip freely.
    assembling: bool,
    /// Soft stages only find the way, and end early.
    hurries: bool,
    /// Newton has [`PATIENCE`].
    patient: bool,
    /// The states passed in steady motion.
    passed: Passed,
    /// Motion of the ends of a face for displacements of 1 mm, at most.
    leans_within: f64,
    /// Iterations of this increment so far, and the least compliance under load that was met, rad/(N m).
    work: usize,
    stiffest: f64,
    /// Time spent so far.
    pub effort: Effort,
}

/// A tangent of steady motion: the drive passes through it again after every pitch.
struct Tangent {
    generator_rad: f64,
    kept: Kept,
    eliminated: Rc<BorderedSystem>,
}

impl<'p> Solver<'p> {
    /// A solver for a problem.
    pub fn new(problem: &'p Problem) -> Self {
        let cs_index = problem.free_circular_spline_nodes();
        let wheels: Box<dyn Wheels + 'p> = match &problem.condensed {
            Some(condensed) => Box::new(CondensedWheels::new(problem, condensed)),
            None => Box::new(SparseWheels::new(problem, &cs_index)),
        };
        let border = fixed_border(problem, wheels.as_ref());
        Solver {
            problem,
            flanks: problem.flanks(),
            wheels,
            cs_index,
            border,
            eliminated: None,
            turned: 0,
            made_at: f64::INFINITY,
            tangents: VecDeque::new(),
            slipping: Slipping::default(),
            softening: 1.0,
            assembling: false,
            hurries: false,
            patient: false,
            passed: Passed::default(),
            leans_within: problem.leans_within(),
            work: 0,
            stiffest: f64::INFINITY,
            effort: Effort::default(),
        }
    }

    /// The flexspline deformed by the generator at `generator_rad`, without load.
    pub fn deform(&mut self, generator_rad: f64) -> Result<(State, Increment), SolveError> {
        self.work = 0;
        let first = self.deform_by(DEFORMING_SOFTNESS[0], generator_rad);
        if !matches!(first, Err(SolveError::NotConverged { .. })) {
            return first;
        }
        self.patient = true;
        let found = DEFORMING_SOFTNESS.iter().find_map(|stages| self.deform_by(stages, generator_rad).ok());
        self.patient = false;
        found.map_or(first, Ok)
    }

    /// The flexspline deformed with contact that is soft at first: factors on the penalties, the last of them 1.
    fn deform_by(&mut self, stages: &[f64], generator_rad: f64) -> Result<(State, Increment), SolveError> {
        let mut state = self.problem.starting_shape(generator_rad);
        // All of a conforming generator touches at once; a soft contact first finds which part stays.
        let mut iterations = 0;
        for &softening in stages {
            (self.softening, self.assembling) = (softening, true);
            let solved = self.newton(&state, &state, generator_rad, 0.0);
            (self.softening, self.assembling) = (1.0, false);
            let (next, mut increment) = solved?;
            iterations += increment.iterations;
            increment.iterations = iterations;
            state = next;
            if softening == 1.0 {
                return Ok((state, increment));
            }
        }
        unreachable!("the last softening is 1")
    }

    /// Turns the generator to `generator_rad` and brings the load to `torque_n_m`, in one increment or, where Newton
    /// needs it, in several.
    pub fn increment(
        &mut self,
        from: &State,
        generator_rad: f64,
        torque_n_m: f64,
    ) -> Result<(State, Increment), SolveError> {
        self.work = 0;
        let solved = self.in_parts(from, generator_rad, torque_n_m);
        self.patient = false;
        solved
    }

    fn in_parts(
        &mut self,
        from: &State,
        generator_rad: f64,
        torque_n_m: f64,
    ) -> Result<(State, Increment), SolveError> {
        let mut state = from.clone();
        let mut iterations = 0;
        let mut compliance = None;
        let beyond = |error, reached: &State, softened_to| match error {
            SolveError::NotConverged { generator_rad, torque_n_m, reason, history, .. } => SolveError::NotConverged {
                generator_rad,
                torque_n_m,
                reached_n_m: reached.torque_n_m,
                softened_to,
                reason,
                history,
            },
            error => error,
        };
        let (turn, load) = (generator_rad - from.generator_rad, torque_n_m - from.torque_n_m);
        // A load that comes on from nothing is best brought on in a few steps.
        let first = if load.abs() > LARGEST_LOAD_STEP { LARGEST_LOAD_STEP / load.abs() } else { 1.0 };
        let (mut done, mut part, mut halvings) = (0.0_f64, first, 0_usize);
        for _ in 0..MOST_PARTS {
            let to = (done + part).min(1.0);
            match self.solve_part(&state, from.generator_rad + turn * to, from.torque_n_m + load * to) {
                Ok((next, mut increment)) => {
                    iterations += increment.iterations;
                    self.problem.check_range(&next)?;
                    state = next;
                    compliance = Some(increment.compliance_rad_per_n_m);
                    if state.torque_n_m != 0.0 {
                        self.stiffest = self.stiffest.min(increment.compliance_rad_per_n_m);
                    }
                    done = to;
                    if done >= 1.0 {
                        increment.iterations = iterations;
                        return Ok((state, increment));
                    }
                    if increment.iterations <= EASY {
                        part *= 2.0;
                        halvings = halvings.saturating_sub(1);
                    }
                }
                Err(SolveError::NotConverged { history, .. })
                    if halvings < self.problem.settings.max_halvings
                        && (turn != 0.0 || load != 0.0)
                        && self.work < self.most_work() =>
                {
                    iterations += history.len();
                    part *= 0.5;
                    halvings += 1;
                    self.patient = halvings >= PATIENT_AFTER;
                }
                Err(error) => {
                    let softened_to = compliance.map(|now| self.stiffest / now).filter(|left| *left < GIVES_WAY);
                    return Err(beyond(error, &state, softened_to.filter(|_| load != 0.0)));
                }
            }
        }
        let reason = "the increment falls into too many parts";
        Err(SolveError::NotConverged {
            generator_rad,
            torque_n_m,
            reached_n_m: state.torque_n_m,
            softened_to: None,
            reason,
            history: Vec::new(),
        })
    }

    /// Iterations that one increment may take in all.
    fn most_work(&self) -> usize {
        MOST_WORK * self.problem.settings.max_iterations
    }

    /// Turns the generator on, by whole flexspline pitches and under the same load, to a place where an imperfect drive
    /// stands differently: the state is turned with it, and a soft contact finds the way first. For flanks without
    /// friction: what they remember is not carried along.
    pub fn jump(&mut self, from: &State, generator_rad: f64) -> Result<(State, Increment), SolveError> {
        // The output goes on at its mean rate, whatever it did last.
        let from = &State { output_rate: 1.0 / self.problem.drive.ratio(), ..from.clone() };
        self.work = 0;
        let solved = self.newton_softly(from, generator_rad, from.torque_n_m, &JUMPING_SOFTNESS)?;
        self.problem.check_range(&solved.0)?;
        Ok(solved)
    }

    /// One part of an increment. A load that changes has no predictor: unless the load that there is shows the way, a
    /// soft contact finds it first. Where one does not lead there the other may: teeth that bind without load sink into
    /// one another while they are soft, and wedge (two rollers in a hat, loaded to twice the drag). Last of all each
    /// soft stage is brought to its end.
    fn solve_part(
        &mut self,
        from: &State,
        generator_rad: f64,
        torque_n_m: f64,
    ) -> Result<(State, Increment), SolveError> {
        if torque_n_m == from.torque_n_m {
            let turned = self.newton(from, from, generator_rad, torque_n_m);
            return match turned {
                // Halved as often as this, the way is not too long but blocked: with two rollers in a hat, teeth that
                // wedge.
                Err(SolveError::NotConverged { .. }) if self.patient => {
                    self.newton_softly(from, generator_rad, torque_n_m, &LOADING_SOFTNESS)
                }
                turned => turned,
            };
        }
        let share = from.torque_n_m / torque_n_m;
        let shows_the_way = (SHOWS_THE_WAY..=SHOWS_THE_WAY.recip()).contains(&share);
        let mut last = None;
        let ways = if shows_the_way {
            [Way::Directly, Way::Softly, Way::Carefully]
        } else {
            [Way::Softly, Way::Directly, Way::Carefully]
        };
        for way in ways {
            self.hurries = way == Way::Softly;
            let softness = if way == Way::Directly { &DIRECTLY[..] } else { &LOADING_SOFTNESS };
            let solved = self.newton_softly(from, generator_rad, torque_n_m, softness);
            self.hurries = false;
            match solved {
                Err(SolveError::NotConverged { .. }) => last = Some(solved),
                solved => return solved,
            }
        }
        last.expect("there are three ways")
    }

    /// Newton with contact that is soft at first: factors on the penalties in turn, the last of them 1.
    fn newton_softly(
        &mut self,
        from: &State,
        generator_rad: f64,
        torque_n_m: f64,
        softness: &[f64],
    ) -> Result<(State, Increment), SolveError> {
        let mut guess = from.clone();
        let mut iterations = 0;
        for &softening in softness {
            self.softening = softening;
            let solved = self.newton(from, &guess, generator_rad, torque_n_m);
            self.softening = 1.0;
            let (state, mut increment) = solved?;
            iterations += increment.iterations;
            if softening == 1.0 {
                increment.iterations = iterations;
                return Ok((state, increment));
            }
            guess = state;
        }
        unreachable!("the last softening is 1")
    }

    /// Equilibrium at this angle and load, looked for from `guess`; slip and drag are counted from the state `from`.
    fn newton(
        &mut self,
        from: &State,
        guess: &State,
        generator_rad: f64,
        torque_n_m: f64,
    ) -> Result<(State, Increment), SolveError> {
        let settings = self.problem.settings;
        let largest_step = LARGEST_STEP * self.problem.drive.flexspline.module_mm;
        let tolerance = if self.hurries && self.softening < 1.0 {
            FOUND_THE_WAY.max(settings.tolerance)
        } else {
            settings.tolerance
        };
        let failed = |history: Vec<f64>, reason| SolveError::NotConverged {
            generator_rad,
            torque_n_m,
            reached_n_m: torque_n_m,
            softened_to: None,
            reason,
            history,
        };
        let most_work = self.most_work();
        let predicted = self.passed.predict(self.problem, guess, generator_rad, torque_n_m);
        let mut state = State { drag_anchor_rad: from.drag_anchor_rad, friction: from.friction.clone(), ..predicted };
        self.problem.lean(&mut state);
        let mut near = NearPairs::default();
        self.balance_output(&mut state, from, torque_n_m, &mut near);
        let mut residual = self.assemble(&mut state, from, torque_n_m, &mut near);
        let mut history = Vec::new();
        let mut last_length = 1.0;
        let (mut looked_back, mut looked_at_all, mut held) = (false, false, false);
        let mut chords: Vec<Step> = Vec::new();
        let steady = self.softening == 1.0 && self.passed.go_on(guess, torque_n_m);
        let mut recalled = steady && generator_rad != guess.generator_rad && self.recall(generator_rad);
        // A new layout of the contact is a new start, up to a few times.
        let most_iterations = settings.max_iterations * if self.patient { PATIENCE } else { 1 };
        let (mut last_iteration, mut layouts) = (most_iterations, 0);
        while history.len() <= last_iteration {
            let relative = residual.relative();
            history.push(relative);
            self.work += 1;
            if self.work > most_work {
                return Err(failed(history, "the increment takes more work than it may"));
            }
            if !relative.is_finite() {
                return Err(failed(history, "the residual is not finite"));
            }
            // While contact is soft it may touch nothing: that only shows the way.
            if relative <= tolerance && (!residual.free_output || self.softening < 1.0) {
                if !looked_at_all && near.missed(&self.flanks, configuration(&state)) {
                    looked_at_all = true;
                    near.look_again();
                    residual = self.assemble(&mut state, from, torque_n_m, &mut near);
                    continue;
                }
                // The contact was laid out for the predicted state; where the corner of a space ended elsewhere, again.
                if near.layouts_fit(&self.flanks, configuration(&state)) {
                    let Some(compliance) = self.compliance(&residual) else {
                        return Err(failed(history, "the stiffness matrix is not positive definite"));
                    };
                    let mut increment = self.report(&state, &residual, compliance, history.len() - 1);
                    if self.softening == 1.0 {
                        let (at, law) = (configuration(&state), self.flank_law());
                        let modulus_mpa = self.problem.contact_modulus_mpa();
                        increment.peak_pressure_mpa[0] = near.peak_pressure_mpa(&self.flanks, at, law, modulus_mpa);
                    }
                    self.wheels.complete(&mut state);
                    self.finish(&mut state, from, &near);
                    if generator_rad != from.generator_rad && self.softening == 1.0 {
                        if !self.passed.remember(self.problem, &state) {
                            self.tangents.clear();
                        }
                        self.keep_tangent(state.generator_rad);
                    }
                    return Ok((state, increment));
                }
                layouts += 1;
                if layouts <= MOST_LAYOUTS {
                    last_iteration = history.len() + most_iterations;
                }
                near.clear();
                residual = self.assemble(&mut state, from, torque_n_m, &mut near);
                continue;
            }
            if residual.free_output && !held {
                let stood = state.output_rad;
                self.balance_output(&mut state, from, torque_n_m, &mut near);
                residual = self.assemble(&mut state, from, torque_n_m, &mut near);
                // No flank in reach, and no load that turns it: it stays while the wheels go on.
                held = residual.free_output && state.output_rad == stood && residual.border[OUTPUT] == 0.0;
                continue;
            }
            held = false;
            // While it makes good progress an old factor serves again: a step with it costs a tenth.
            let gain = last_gain(&history);
            recalled &= history.len() == 1 || gain < RECALL_GAIN;
            let chord = recalled || gain < CHORD_GAIN;
            let Some(mut step) = self.solve(&residual, chord) else {
                return Err(failed(history, "the stiffness matrix is not positive definite"));
            };
            if chord {
                improve(&mut step, &chords);
            } else {
                chords.clear();
                self.made_at = relative;
            }
            // The force along the step falls from `before` to nothing at the end of a perfect step; far beyond, halve
            // it.
            let before = step.work(&residual);
            let mut length = (largest_step / step.largest()).min(1.0).min(8.0 * last_length);
            let motion = self.motion(&step);
            near.advance(length * motion);
            let mut mistaken = false;
            for trial in 0..=MOST_TRIALS {
                // Teeth that come near from here on need their flanks in this state, too: the next candidate starts
                // from it.
                if near.must_search() {
                    self.wheels.complete(&mut state);
                }
                let mut candidate = step.applied_to(&state, length);
                self.wheels.follow(&mut candidate);
                residual = self.assemble(&mut candidate, from, torque_n_m, &mut near);
                let may_return = if history.len() > GOES_ROUND_AFTER { RETURNS_LITTLE } else { RETURNS };
                let overshoot = before > 0.0 && step.work(&residual) < -may_return * before;
                if !overshoot || relative < ROUND_OFF || trial == MOST_TRIALS {
                    state = candidate;
                    break;
                }
                if recalled || (trial == LOOKS_BACK_AT && !looked_back && !self.assembling) {
                    mistaken = true;
                    break;
                }
                length *= 0.5;
                near.advance(length * motion);
            }
            if mistaken {
                looked_back = !recalled;
                recalled = false;
                near.advance(length * motion);
                if looked_back {
                    near.look_again();
                }
                residual = self.assemble(&mut state, from, torque_n_m, &mut near);
                continue;
            }
            looked_back = false;
            last_length = length;
            // A shortened step says nothing about the tangent.
            if length == 1.0 {
                chords.push(step);
            } else {
                chords.clear();
            }
        }
        let floats = torque_n_m == 0.0 && self.problem.drag == 0.0;
        Err(failed(history, if floats { FLOATS } else { "the iterations ran out" }))
    }

    /// Bound on the motion of flanks against one another in a step, mm. Nodal displacements bound those between them to
    /// 1.25 (the Lebesgue constant of a quadratic).
    fn motion(&self, step: &Step) -> f64 {
        let largest = |x: &[f64]| x.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let nodes = largest(&step.u) + largest(&step.v);
        (1.25 + self.leans_within) * std::f64::consts::SQRT_2 * nodes
            + self.problem.drive.circular_spline.root_radius_mm * step.border[OUTPUT].abs()
    }

    /// Turns the output to where load, drag and flanks balance while the wheels keep their shape.
    fn balance_output(&mut self, state: &mut State, from: &State, torque_n_m: f64, near: &mut NearPairs) {
        let clock = Instant::now();
        let load = self.problem.per_width(torque_n_m);
        let anchor_rad = state.drag_anchor_rad;
        let others = |output_rad: f64| {
            let (drag, slope) = self.problem.drag_torque(output_rad - anchor_rad);
            (load + drag, -slope)
        };
        self.look_around(state, from, near);
        let law = FlankLaw { friction: 0.0, ..self.flank_law() };
        let tolerance = 1e-3 * (load.abs() + self.problem.drag);
        if let Some(output_rad) = near.balance(&self.flanks, state, law, tolerance, others) {
            near.advance((output_rad - state.output_rad).abs() * self.problem.drive.circular_spline.root_radius_mm);
            state.output_rad = output_rad;
        }
        self.effort.contact += clock.elapsed();
    }

    /// Looks for pairs that may have come near.
    fn look_around(&self, state: &mut State, from: &State, near: &mut NearPairs) {
        if near.must_search() {
            self.wheels.complete(state);
            near.search(&self.flanks, configuration(state), from, self.problem.flank_law.friction > 0.0);
        }
    }

    /// Assembles the out-of-balance forces and the tangent.
    fn assemble(&mut self, state: &mut State, from: &State, torque_n_m: f64, near: &mut NearPairs) -> Residual {
        let clock = Instant::now();
        self.problem.lean(state);
        self.look_around(state, from, near);
        self.effort.contact += clock.elapsed();
        self.make_room(configuration(state), near);
        let clock = Instant::now();
        let mut residual = Residual::zero(self.wheels.unknowns());
        self.wheels.assemble(state, &mut residual.force);
        self.effort.assembly += clock.elapsed();
        let clock = Instant::now();
        self.assemble_contact(state, near, &mut residual);
        self.assemble_holding(state, torque_n_m, &mut residual);
        self.effort.contact += clock.elapsed();
        residual
    }

    /// Makes sure that the tangent has room for these pairs.
    fn make_room(&mut self, at: Configuration, near: &NearPairs) {
        let clock = Instant::now();
        let pairs: Vec<FlankPair> = near.pairs().collect();
        if self.wheels.prepare(&pairs, &|| self.flanks.near_pairs(at, PATTERN_REACH)) {
            self.eliminated = None;
        }
        self.effort.analysis += clock.elapsed();
    }

    fn bore_law(&self) -> BoreLaw {
        let stiffness = self.problem.bore_law.stiffness;
        // A bearing that yields is soft enough as it is.
        BoreLaw { stiffness: stiffness.min((self.softening * stiffness).max(SOFTEST_BORE)) }
    }

    fn flank_law(&self) -> FlankLaw {
        let law = self.problem.flank_law;
        FlankLaw {
            stiffness: self.softening * law.stiffness,
            stick_stiffness: self.softening * law.stick_stiffness,
            friction: if self.assembling { 0.0 } else { law.friction },
        }
    }

    fn assemble_contact(&mut self, state: &State, near: &mut NearPairs, residual: &mut Residual) {
        let problem = self.problem;
        let (bore_law, flank_law) = (self.bore_law(), self.flank_law());
        let bore_nodes = &problem.wheels().0.nodes;
        let major = [state.generator_rad.cos(), state.generator_rad.sin()];
        let wheels = self.wheels.as_mut();
        problem.bore.evaluate_near(
            bore_law,
            &problem.outline,
            state.generator_rad,
            &state.u,
            &mut near.bore,
            |contact| {
                for (a, &n) in problem.bore.edges[contact.edge].iter().enumerate() {
                    for k in 0..2 {
                        let f = contact.force[2 * a + k];
                        residual.force[2 * n as usize + k] += f;
                        residual.scale = residual.scale.max(f.abs());
                    }
                    let [x, y] = bore_nodes[n as usize];
                    if major[0] * x + major[1] * y > 0.0 {
                        residual.lobe_force += major[0] * contact.force[2 * a] + major[1] * contact.force[2 * a + 1];
                    }
                }
                wheels.add_bore(contact);
                residual.generator_moment += contact.moment;
                residual.generator_contacts += 1;
                residual.bore_peak = residual.bore_peak.max(contact.peak);
            },
        );
        self.slipping.clear();
        let slipping = &mut self.slipping;
        let at = configuration(state);
        self.border.column_mut(OUTPUT).fill(0.0);
        let mut corner = 0.0;
        let mut leaning = Leaning::new(problem, &mut self.border);
        near.evaluate(&self.flanks, at, flank_law, |pair, contact| {
            let cs_node = |n: usize| self.cs_index[n].expect("flank nodes are free") as usize;
            let nodes: Vec<usize> = self.flanks.fs_nodes(pair).chain(self.flanks.cs_nodes(pair).map(cs_node)).collect();
            contact.slipping.iter().for_each(|point| slipping.add(point, |i| 2 * nodes[i / 2] + i % 2));
            let column = self.border.column_mut(OUTPUT);
            for (a, node) in nodes.iter().enumerate() {
                for k in 0..2 {
                    let i = 2 * a + k;
                    residual.force[2 * node + k] += contact.force[i];
                    residual.scale = residual.scale.max(contact.force[i].abs());
                    column[2 * node + k] += contact.border[i];
                }
            }
            wheels.add_flank(pair, contact);
            corner += contact.corner;
            residual.flank_torque += contact.torque;
            residual.torque_scale += contact.torque.abs();
            residual.flank_contacts += 1;
            if let Some(along) = &contact.along_face {
                leaning.add(problem, &mut self.border, pair, along, |i| 2 * nodes[i / 2] + i % 2);
                if contact.load * along.peak_over_mean > residual.line_load {
                    residual.line_load = contact.load * along.peak_over_mean;
                    (residual.peak_over_mean, residual.face_share) = (along.peak_over_mean, along.share);
                }
            }
        });
        self.border.corner.fill(0.0);
        self.border.corner[0] = corner;
        leaning.finish(problem, &mut self.border, residual);
    }

    /// Load and drag on the output, sleeve on the bore, and the anchor.
    fn assemble_holding(&mut self, state: &State, torque_n_m: f64, residual: &mut Residual) {
        let problem = self.problem;
        let width = self.border.width;
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let load = problem.per_width(torque_n_m);
        let (drag, drag_stiffness) = problem.drag_torque(state.output_rad - state.drag_anchor_rad);
        residual.drag_torque = drag;
        // The drag that sticks is so stiff that the last digit of the output angle is felt after a few radians.
        residual.torque_round_off = drag_stiffness * f64::EPSILON * state.output_rad.abs();
        residual.border[OUTPUT] = load + residual.flank_torque + residual.drag_torque;
        residual.torque_scale += load.abs() + problem.drag;
        residual.free_output = residual.flank_contacts == 0 && drag_stiffness == 0.0;
        let corner = &mut self.border.corner;
        corner[OUTPUT * width + OUTPUT] += if residual.free_output { HOLDS_A_FREE_OUTPUT } else { drag_stiffness };

        for (f, w) in residual.force.iter_mut().zip(&problem.rotation_weights) {
            *f -= state.sleeve_moment * w;
        }
        let rotation = dot(&problem.rotation_weights, &state.u);
        residual.border[SLEEVE] = -(rotation - problem.sleeve_compliance * state.sleeve_moment);
        corner[SLEEVE * width + SLEEVE] = -problem.sleeve_compliance;
        corner[ANCHORED * width + ANCHORED] = 1.0 / ANCHOR;

        if problem.lateral_stiffness > 0.0 {
            for axis in 0..2 {
                let force = state.lateral_force[axis];
                let mut mean = 0.0;
                for (i, w) in problem.mean_weights.iter().enumerate().step_by(2) {
                    residual.force[i + axis] -= force * w;
                    mean += w * state.u[i + axis];
                }
                let compliance = 1.0 / problem.lateral_stiffness;
                let row = LATERAL + axis;
                residual.border[row] = -(mean - compliance * force);
                corner[row * width + row] = -compliance;
            }
        }
        for (row, wave) in (problem.first_wave()..).zip(&problem.waves) {
            wave.add_force(-wave.stiffness * wave.amplitude(&state.u), &mut residual.force);
            match problem.first_amplitude() {
                None => corner[row * width + row] = -1.0 / wave.stiffness,
                // The amplitude is an unknown of its own, and the force what makes it that of the bore.
                Some(first) => {
                    let amplitude = first + row - problem.first_wave();
                    corner[amplitude * width + amplitude] += wave.stiffness;
                    corner[row * width + amplitude] = -1.0;
                    corner[amplitude * width + row] = -1.0;
                }
            }
        }
    }

    /// One Newton step, or nothing when the tangent is not positive definite.
    ///
    /// With `chord` the last tangent serves again.
    fn solve(&mut self, residual: &Residual, chord: bool) -> Option<Step> {
        if !chord || self.eliminated.is_none() {
            let clock = Instant::now();
            self.eliminated = None;
            // Far from equilibrium the rim may resist no sliding along the generator; a grounded spring at every node
            // then shortens the step and leaves its direction downhill.
            let definite = std::iter::once(0.0).chain(GROUNDED_SPRINGS).any(|spring| self.wheels.factorise(spring));
            self.effort.factorisation += clock.elapsed();
            self.effort.factorisations += 1;
            if !definite {
                return None;
            }
            let clock = Instant::now();
            self.eliminated = Some(Rc::new(BorderedSystem::new(self.wheels.as_mut(), &self.border)));
            self.turned = 0;
            self.effort.solution += clock.elapsed();
        }
        let clock = Instant::now();
        let slipping = std::mem::take(&mut self.slipping);
        let forces = Field { free: residual.force.clone(), border: residual.border };
        let solved = slipping.solve(forces, |field| self.solve_symmetric(field));
        self.slipping = slipping;
        self.effort.solution += clock.elapsed();
        let Field { free, border } = solved?;
        let (fs, _) = self.problem.wheels();
        let u = free[..2 * fs.nodes.len()].to_vec();
        let mut v = vec![0.0; 2 * self.cs_index.len()];
        for (n, index) in self.cs_index.iter().enumerate() {
            if let Some(free_node) = index {
                v[2 * n] = free[2 * *free_node as usize];
                v[2 * n + 1] = free[2 * *free_node as usize + 1];
            }
        }
        Some(Step { free, u, v, border })
    }

    /// Solves with the last factor, in place.
    fn solve_symmetric(&mut self, field: &mut Field) -> Option<()> {
        let Field { free, border } = field;
        self.turn(free, border, -self.turned);
        let solved = self.eliminated.as_ref()?.solve(self.wheels.as_mut(), free, &mut border[..self.border.width]);
        self.turn(free, border, self.turned);
        solved.then_some(())
    }

    /// Turns forces or displacements by so many pitches.
    fn turn(&self, free: &mut [f64], border: &mut [f64; BORDERS], pitches: isize) {
        if pitches != 0 {
            self.wheels.turn(free, pitches);
            let (sin, cos) = (pitches as f64 * self.problem.flexspline.pitch()).sin_cos();
            let [x, y] = [border[LATERAL], border[LATERAL + 1]];
            (border[LATERAL], border[LATERAL + 1]) = (cos * x - sin * y, sin * x + cos * y);
        }
    }

    /// Takes up a tangent that was passed whole pitches ago, or nearly; whether there is one.
    fn recall(&mut self, generator_rad: f64) -> bool {
        let pitch = self.problem.flexspline.pitch();
        let pitches = |tangent: &Tangent| (generator_rad - tangent.generator_rad) / pitch;
        let off = |tangent: &Tangent| (pitches(tangent) - pitches(tangent).round()).abs();
        let Some(tangent) = self.tangents.iter().min_by(|a, b| off(a).total_cmp(&off(b))) else {
            return false;
        };
        if off(tangent) > RECALL_WITHIN {
            return false;
        }
        self.turned = pitches(tangent).round() as isize;
        self.wheels.recall(&tangent.kept, self.turned);
        self.eliminated = Some(tangent.eliminated.clone());
        true
    }

    /// Keeps the tangent just made for the next pitches.
    fn keep_tangent(&mut self, generator_rad: f64) {
        if self.made_at > KEEP_BELOW {
            return;
        }
        if let (0, Some(kept), Some(eliminated)) = (self.turned, self.wheels.keep(), &self.eliminated) {
            if self.tangents.len() == TANGENTS {
                self.tangents.pop_front();
            }
            self.tangents.push_back(Tangent { generator_rad, kept, eliminated: eliminated.clone() });
        }
    }

    /// Turn of the output for a unit torque on it (rad mm / N mm), by the last tangent.
    fn compliance(&mut self, residual: &Residual) -> Option<f64> {
        if self.eliminated.is_none() {
            self.solve(residual, false)?;
        }
        let mut border = [0.0; BORDERS];
        border[OUTPUT] = 1.0;
        let solved = self.eliminated.as_ref()?.solve_border(&mut border[..self.border.width]);
        solved.then_some(border[OUTPUT])
    }

    /// Carries the history over the end of an increment.
    fn finish(&self, state: &mut State, from: &State, near: &NearPairs) {
        let problem = self.problem;
        let reach = problem.drag / problem.drag_stiffness;
        let stretched = state.output_rad - state.drag_anchor_rad;
        state.drag_anchor_rad += stretched - stretched.clamp(-reach, reach);
        let turn = state.generator_rad - from.generator_rad;
        if turn != 0.0 {
            let nominal = 1.0 / problem.drive.ratio();
            state.output_rate = ((state.output_rad - from.output_rad) / turn).clamp(-2.0 * nominal, 4.0 * nominal);
            state.travel = turn.signum();
        }
        if problem.flank_law.friction > 0.0 {
            state.friction = near.friction(&self.flanks, configuration(state), self.flank_law());
        }
    }

    fn report(&self, state: &State, residual: &Residual, compliance: f64, iterations: usize) -> Increment {
        let to_n_m = self.problem.drive.flexspline.width_mm / 1e3;
        Increment {
            iterations,
            residual: residual.relative(),
            flank_contacts: residual.flank_contacts,
            generator_contacts: residual.generator_contacts,
            generator_torque_n_m: residual.generator_moment * to_n_m,
            flank_torque_n_m: residual.flank_torque * to_n_m,
            drag_torque_n_m: residual.drag_torque * to_n_m,
            // Per width: rad per (N mm/mm); a torque in N m is 1 / to_n_m of that.
            compliance_rad_per_n_m: compliance / to_n_m,
            lobe_force_n: residual.lobe_force * self.problem.drive.flexspline.width_mm,
            // Of flanks: where contact is as hard as it is, looked at later.
            peak_pressure_mpa: [0.0, residual.bore_peak],
            face: self.face(state, residual),
        }
    }

    fn face(&self, state: &State, residual: &Residual) -> Face {
        // Without taper, and whether the load along the face is even or not.
        let mut leans: Vec<Lean> = vec![[0.0; 2]; self.problem.flexspline.teeth];
        self.problem.waves.iter().for_each(|wave| wave.add_lean(wave.amplitude(&state.u), &mut leans));
        let largest = |k: usize| leans.iter().map(|lean| lean[k].abs()).fold(0.0, f64::max);
        Face {
            tilt_rad: largest(0),
            skew_rad: largest(1),
            peak_over_mean: residual.peak_over_mean,
            share: residual.face_share,
        }
    }
}

/// What leans the teeth does so by waves of the rim: a load at the end of a face works on their amplitudes.
struct Leaning {
    /// Row of the first amplitude, if there are any.
    first: Option<usize>,
    /// Forces on the amplitudes, their tangent by rows, and that with the output angle.
    force: Vec<f64>,
    tangent: Vec<f64>,
    by_output: Vec<f64>,
}

impl Leaning {
    fn new(problem: &Problem, border: &mut Border) -> Leaning {
        let first = problem.first_amplitude();
        let count = if first.is_some() { problem.waves.len() } else { 0 };
        for k in 0..count {
            border.column_mut(first.unwrap_or(0) + k).fill(0.0);
        }
        Leaning { first, force: vec![0.0; count], tangent: vec![0.0; count * count], by_output: vec![0.0; count] }
    }

    /// Adds a pair; `unknown` tells that of the system for each of its own.
    fn add(
        &mut self,
        problem: &Problem,
        border: &mut Border,
        pair: FlankPair,
        along: &AlongFace,
        unknown: impl Fn(usize) -> usize,
    ) {
        let Some(first) = self.first else { return };
        let slopes: Vec<f64> =
            problem.waves.iter().map(|wave| problem.face_slope(wave.lean(pair.tooth), pair.side)).collect();
        let count = slopes.len();
        for (k, slope) in slopes.iter().enumerate() {
            self.force[k] += along.moment * slope;
            self.by_output[k] += along.by_output * slope;
            for (entry, other) in self.tangent[k * count..(k + 1) * count].iter_mut().zip(&slopes) {
                *entry += along.by_slope * slope * other;
            }
            let column = border.column_mut(first + k);
            for (i, by) in along.by_node.iter().enumerate() {
                column[unknown(i)] += by * slope;
            }
        }
    }

    /// Puts forces and tangent where they belong.
    fn finish(self, problem: &Problem, border: &mut Border, residual: &mut Residual) {
        let Some(first) = self.first else { return };
        let (width, count) = (border.width, self.force.len());
        for (k, wave) in problem.waves.iter().enumerate() {
            wave.add_force(self.force[k], &mut residual.force);
            border.corner[OUTPUT * width + first + k] = self.by_output[k];
            border.corner[(first + k) * width + OUTPUT] = self.by_output[k];
            for l in 0..count {
                border.corner[(first + k) * width + first + l] = self.tangent[k * count + l];
            }
        }
    }
}

/// The border of this drive; the columns of the output angle and of the amplitudes and the corner change with the
/// contact.
fn fixed_border(problem: &Problem, wheels: &dyn Wheels) -> Border {
    let width = problem.first_amplitude().unwrap_or(problem.first_wave()) + problem.waves.len();
    let mut border = Border::zeros(wheels.unknowns(), width);
    border.column_mut(SLEEVE)[..problem.rotation_weights.len()].copy_from_slice(&problem.rotation_weights);
    for (unknown, weight) in wheels.anchor() {
        border.column_mut(ANCHORED)[unknown] = weight;
    }
    for (row, wave) in (problem.first_wave()..).zip(&problem.waves) {
        wave.add_force(1.0, border.column_mut(row));
    }
    if problem.lateral_stiffness > 0.0 {
        for (i, w) in problem.mean_weights.iter().enumerate().step_by(2) {
            border.column_mut(LATERAL)[i] = *w;
            border.column_mut(LATERAL + 1)[i + 1] = *w;
        }
    }
    border
}

/// How far the last iteration brought the residual down.
fn last_gain(history: &[f64]) -> f64 {
    match history {
        [.., before, after] => after / before,
        _ => 1.0,
    }
}
