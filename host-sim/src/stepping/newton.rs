//! Newton's method on the whole drive, the same for both solvers; only the wheels differ (see [`Wheels`]).
//!
//! Unknowns are the displacements of both wheels and, as a dense border, the output angle, the moment of the sleeve (a
//! Lagrange multiplier when the sleeve is rigid) and its lateral force. One increment:
//!
//! predict, lay out the contact; repeat { assemble; done? factorise; solve; update } until done.

use std::collections::{BTreeMap, VecDeque};
use std::rc::Rc;
use std::time::{Duration, Instant};

use crate::contact::{BoreLaw, Configuration, FlankContact, FlankLaw, FlankPair};
use crate::fem::{Border, BorderedSystem};

use super::error::SolveError;
use super::fast::{CondensedWheels, Kept};
use super::near::{NearPairs, configuration};
use super::predictor::turn_field;
use super::problem::Problem;
use super::reference::SparseWheels;
use super::state::State;
use super::wheels::Wheels;

/// Pairs closer than this (mm) get a place in the sparsity pattern.
const PATTERN_REACH: f64 = 0.04;
/// Stiffness (N/mm per mm) that anchors one node of the flexspline while the matrix is factorised; the border takes it out
/// again.
pub(super) const ANCHOR: f64 = 1e5;
/// Springs (N/mm per mm) that are tried in turn when the tangent is not positive definite.
const GROUNDED_SPRINGS: [f64; 4] = [1e-3, 1e-1, 1e1, 1e3];
/// Largest change of a displacement that an undamped Newton step may make, mm.
const LARGEST_STEP: f64 = 0.1;
/// Largest first step of a changing load, N m.
const LARGEST_LOAD_STEP: f64 = 100.0;
/// Factors on the penalties while the way to a new load is found.
const LOADING_SOFTNESS: [f64; 3] = [1e-3, 3e-2, 1.0];
/// Iterations after which the next part of an increment may be twice as large.
const EASY: usize = 10;

/// Relative residual below which steps are taken whole: what is left is near round-off.
const ROUND_OFF: f64 = 1e-6;

/// Gain of an iteration after which the last factor serves again.
const CHORD_GAIN: f64 = 0.2;
/// Under friction: relative residual and gain from which the last factor is kept and improved, so many times.
const SLUGGISH_BELOW: f64 = 0.3;
const SLUGGISH_GAIN: f64 = 0.3;
const MOST_CHORDS: usize = 12;

/// Fraction of a pitch off which a tangent of an earlier pitch still serves, and the gain that each iteration must then make.
const RECALL_WITHIN: f64 = 0.06;
const RECALL_GAIN: f64 = 0.3;
/// A tangent made further from equilibrium than this (relative residual) knows the wrong contact.
const KEEP_BELOW: f64 = 0.1;
/// Layouts of the contact in one increment.
const MOST_LAYOUTS: usize = 3;
/// Tangents remembered.
const TANGENTS: usize = 12;

/// Number of states that the predictor interpolates in phase, how far off they may be and must be apart (pitches), and the
/// largest weight.
const PHASES: usize = 3;
const PHASE_REACH: f64 = 0.06;
const PHASES_APART: f64 = 1e-3;
const LARGEST_WEIGHT: f64 = 6.0;

/// States of steady motion that the predictor remembers: a fine sampling of one pitch.
const REMEMBERED: usize = 48;

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
    /// Largest contact pressure on a flank and on the bore, MPa.
    pub peak_pressure_mpa: [f64; 2],
}

/// CPU time spent in the parts of the solver.
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
    /// Factor on the penalties, below 1 only while the drive is first deformed.
    softening: f64,
    /// The last states of steady motion, oldest first.
    passed: VecDeque<State>,
    /// Generator angle at which the motion became steady.
    steady_since: f64,
    /// Time spent so far.
    pub effort: Effort,
}

/// A tangent of steady motion: the drive passes through it again after every pitch.
struct Tangent {
    generator_rad: f64,
    kept: Kept,
    eliminated: Rc<BorderedSystem>,
}

/// Out-of-balance forces at a configuration.
struct Residual {
    /// On the free nodes.
    force: Vec<f64>,
    /// On output angle, sleeve rotation, anchor, lateral x, lateral y.
    border: [f64; BORDERS],
    /// Largest contact force on a node.
    scale: f64,
    torque_scale: f64,
    flank_contacts: usize,
    generator_contacts: usize,
    generator_moment: f64,
    flank_torque: f64,
    drag_torque: f64,
    peak: [f64; 2],
    /// Neither flank nor drag holds the output.
    free_output: bool,
}

/// Rows of the border.
const OUTPUT: usize = 0;
const SLEEVE: usize = 1;
const ANCHORED: usize = 2;
const LATERAL: usize = 3;
const BORDERS: usize = 5;

impl Residual {
    fn zero(unknowns: usize) -> Residual {
        Residual {
            force: vec![0.0; unknowns],
            border: [0.0; BORDERS],
            scale: 1e-3,
            torque_scale: 1e-3,
            flank_contacts: 0,
            generator_contacts: 0,
            generator_moment: 0.0,
            flank_torque: 0.0,
            drag_torque: 0.0,
            peak: [0.0; 2],
            free_output: false,
        }
    }

    /// Relative to the contact forces; the torque, which everything serves, ten times as strictly.
    fn relative(&self) -> f64 {
        let force = self.force.iter().fold(0.0_f64, |m, x| m.max(x.abs())) / self.scale;
        force.max(10.0 * self.border[OUTPUT].abs() / self.torque_scale)
    }
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
            softening: 1.0,
            passed: VecDeque::new(),
            steady_since: 0.0,
            effort: Effort::default(),
        }
    }

    /// The flexspline deformed by the generator at `generator_rad`, without load.
    pub fn deform(&mut self, generator_rad: f64) -> Result<(State, Increment), SolveError> {
        let mut state = self.problem.starting_shape(generator_rad);
        // All of a conforming generator touches at once; a soft contact first finds which part stays.
        let mut iterations = 0;
        for softening in [1e-3, 1.0] {
            self.softening = softening;
            let solved = self.newton(&state, generator_rad, 0.0);
            self.softening = 1.0;
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

    /// Turns the generator to `generator_rad` and brings the load to `torque_n_m`, in one increment or, where Newton needs
    /// it, in several.
    pub fn increment(
        &mut self,
        from: &State,
        generator_rad: f64,
        torque_n_m: f64,
    ) -> Result<(State, Increment), SolveError> {
        let mut state = from.clone();
        let mut iterations = 0;
        let (turn, load) = (generator_rad - from.generator_rad, torque_n_m - from.torque_n_m);
        // A load that comes on from nothing is best brought on in a few steps.
        let first = if load.abs() > LARGEST_LOAD_STEP { LARGEST_LOAD_STEP / load.abs() } else { 1.0 };
        let (mut done, mut part, mut halvings) = (0.0_f64, first, 0_usize);
        loop {
            let to = (done + part).min(1.0);
            match self.solve_part(&state, from.generator_rad + turn * to, from.torque_n_m + load * to) {
                Ok((next, mut increment)) => {
                    iterations += increment.iterations;
                    self.problem.check_range(&next)?;
                    state = next;
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
                    if halvings < self.problem.settings.max_halvings && (turn != 0.0 || load != 0.0) =>
                {
                    iterations += history.len();
                    part *= 0.5;
                    halvings += 1;
                }
                Err(error) => return Err(error),
            }
        }
    }

    /// One part of an increment. A load that changes has no predictor: a soft contact finds the way first.
    fn solve_part(
        &mut self,
        from: &State,
        generator_rad: f64,
        torque_n_m: f64,
    ) -> Result<(State, Increment), SolveError> {
        if torque_n_m == from.torque_n_m {
            return self.newton(from, generator_rad, torque_n_m);
        }
        let mut guess = from.clone();
        let mut iterations = 0;
        for softening in LOADING_SOFTNESS {
            self.softening = softening;
            let solved = self.newton(&guess, generator_rad, torque_n_m);
            self.softening = 1.0;
            let (state, mut increment) = solved?;
            iterations += increment.iterations;
            if softening == 1.0 {
                increment.iterations = iterations;
                return Ok((state, increment));
            }
            // History is that of the start, not of the guess.
            guess = State { drag_anchor_rad: from.drag_anchor_rad, friction: from.friction.clone(), ..state };
        }
        unreachable!("the last softening is 1")
    }

    /// State predicted for a generator angle: the wave turned, the output going on as it did before.
    ///
    /// A drive in steady motion passes through the same state after every flexspline pitch, one tooth further: states that
    /// stood nearly there, whole pitches ago, are turned and interpolated. Otherwise the last state, or one that needs a smaller fraction
    /// of a pitch, is turned. An output that carries no load stays where it is when the generator reverses: it has the clearance to
    /// cross.
    fn predict(&self, from: &State, generator_rad: f64, torque_n_m: f64) -> State {
        let turn = generator_rad - from.generator_rad;
        if turn == 0.0 {
            return State { torque_n_m, ..from.clone() };
        }
        let problem = self.problem;
        let idle = problem.per_width(torque_n_m).abs() <= problem.drag;
        let reversing = turn.signum() * from.travel < 0.0;
        let nominal = 1.0 / problem.drive.ratio();
        let pitch = problem.flexspline.pitch();
        let steady = !reversing
            && (from.output_rate / nominal - 1.0).abs() < 0.2
            && self.passed.back().is_some_and(|last| goes_on(last, from, torque_n_m));
        let (fs, cs) = problem.wheels();
        if steady {
            // What was passed in the first pitch may not have settled yet.
            let settled = |state: &State| (state.generator_rad - self.steady_since).abs() > pitch;
            let passed: Vec<&State> = self.passed.iter().filter(|state| settled(state)).collect();
            let pitches = |state: &State| (generator_rad - state.generator_rad) / pitch;
            let weights = phase_weights(&passed.iter().map(|state| pitches(state)).collect::<Vec<_>>());
            let own = (pitches(from) - pitches(from).round()).abs();
            if let Some(weights) = weights.filter(|w| w.nearest < 0.5 * own) {
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
                for (k, weight) in weights.states {
                    let state = passed[k];
                    let turn = generator_rad - state.generator_rad;
                    let add = |sum: &mut [f64], part: &[f64]| {
                        sum.iter_mut().zip(part).for_each(|(x, p)| *x += weight * p);
                    };
                    add(&mut predicted.u, &turn_field(fs, &state.u, turn));
                    add(&mut predicted.v, &turn_field(cs, &state.v, turn - turn * nominal));
                    predicted.output_rad += weight * (state.output_rad + turn * nominal);
                    predicted.sleeve_moment += weight * state.sleeve_moment;
                    let (sin, cos) = turn.sin_cos();
                    let [x, y] = state.lateral_force;
                    add(&mut predicted.lateral_force, &[cos * x - sin * y, sin * x + cos * y]);
                }
                return predicted;
            }
        }
        let off = |state: &State| {
            let pitches = (generator_rad - state.generator_rad) / pitch;
            (pitches - pitches.round()).abs()
        };
        let nearest = self.passed.iter().filter(|_| steady).min_by(|a, b| off(a).total_cmp(&off(b)));
        let base = nearest.filter(|state| off(state) < 0.5 * off(from)).unwrap_or(from);
        let turn = generator_rad - base.generator_rad;
        let output_turn = match (idle, reversing) {
            (true, true) => 0.0,
            (false, true) => turn * nominal,
            _ if std::ptr::eq(base, from) => from.output_rate * turn,
            _ => turn * nominal,
        };
        let (sin, cos) = turn.sin_cos();
        let [x, y] = base.lateral_force;
        State {
            u: turn_field(fs, &base.u, turn),
            v: turn_field(cs, &base.v, turn - output_turn),
            output_rad: base.output_rad + output_turn,
            sleeve_moment: base.sleeve_moment,
            lateral_force: [cos * x - sin * y, sin * x + cos * y],
            generator_rad,
            torque_n_m,
            ..from.clone()
        }
    }

    /// Remembers a state of steady motion for the predictor.
    fn remember(&mut self, state: &State) {
        let nominal = 1.0 / self.problem.drive.ratio();
        let steady = (state.output_rate / nominal - 1.0).abs() < 0.2;
        let fits = |old: &State| old.torque_n_m == state.torque_n_m && old.travel == state.travel;
        if !steady || self.passed.front().is_some_and(|old| !fits(old)) {
            self.passed.clear();
            self.tangents.clear();
        }
        if steady {
            self.keep_tangent(state.generator_rad);
            if self.passed.is_empty() {
                self.steady_since = state.generator_rad;
            }
            if self.passed.len() == REMEMBERED {
                self.passed.pop_front();
            }
            self.passed.push_back(State { friction: BTreeMap::new(), ..state.clone() });
        }
    }

    fn newton(&mut self, from: &State, generator_rad: f64, torque_n_m: f64) -> Result<(State, Increment), SolveError> {
        let settings = self.problem.settings;
        let failed =
            |history: Vec<f64>, reason| SolveError::NotConverged { generator_rad, torque_n_m, reason, history };
        let mut state = self.predict(from, generator_rad, torque_n_m);
        let mut near = NearPairs::default();
        self.balance_output(&mut state, from, torque_n_m, &mut near);
        let mut residual = self.assemble(&mut state, from, torque_n_m, &mut near);
        let mut history = Vec::new();
        let mut last_length = 1.0;
        let mut chords: Vec<Step> = Vec::new();
        let steady = self.softening == 1.0 && self.passed.back().is_some_and(|last| goes_on(last, from, torque_n_m));
        let mut recalled = steady && generator_rad != from.generator_rad && self.recall(generator_rad);
        // A new layout of the contact is a new start, up to a few times.
        let (mut last_iteration, mut layouts) = (settings.max_iterations, 0);
        while history.len() <= last_iteration {
            let relative = residual.relative();
            history.push(relative);
            if !relative.is_finite() {
                return Err(failed(history, "the residual is not finite"));
            }
            if relative <= settings.tolerance {
                // The contact was laid out for the predicted state; where the corner of a space ended elsewhere, again.
                if near.layouts_fit(&self.flanks, configuration(&state)) {
                    let Some(compliance) = self.compliance(&residual) else {
                        return Err(failed(history, "the stiffness matrix is not positive definite"));
                    };
                    let increment = self.report(&residual, compliance, history.len() - 1);
                    self.wheels.complete(&mut state);
                    self.finish(&mut state, from, &near);
                    if generator_rad != from.generator_rad {
                        self.remember(&state);
                    }
                    return Ok((state, increment));
                }
                layouts += 1;
                if layouts <= MOST_LAYOUTS {
                    last_iteration = history.len() + settings.max_iterations;
                }
                near.clear();
                residual = self.assemble(&mut state, from, torque_n_m, &mut near);
                continue;
            }
            if residual.free_output {
                self.balance_output(&mut state, from, torque_n_m, &mut near);
                residual = self.assemble(&mut state, from, torque_n_m, &mut near);
                continue;
            }
            // Near the end the last factor still points the right way, and a step with it costs a tenth.
            recalled &= history.len() == 1 || last_gain(&history) < RECALL_GAIN;
            let gain = last_gain(&history);
            // The tangent of friction leaves out that slip follows pressure: made anew it is no better, improved it is.
            let sluggish = self.problem.flank_law.friction > 0.0
                && relative < SLUGGISH_BELOW
                && (SLUGGISH_GAIN..1.0).contains(&gain)
                && chords.len() < MOST_CHORDS;
            let chord = recalled || gain < CHORD_GAIN || sluggish;
            let Some(mut step) = self.solve(&residual, chord) else {
                return Err(failed(history, "the stiffness matrix is not positive definite"));
            };
            if chord {
                improve(&mut step, &chords);
            } else {
                chords.clear();
                self.made_at = relative;
            }
            // The force along the step falls from `before` to nothing at the end of a perfect step; far beyond, halve it.
            let before = step.work(&residual);
            let mut length = (LARGEST_STEP / step.largest()).min(1.0).min(8.0 * last_length);
            near.advance(length * self.motion(&step));
            let mut mistaken = false;
            for trial in 0.. {
                // Teeth that come near from here on need their flanks in this state, too: the next candidate starts from it.
                if near.must_search() {
                    self.wheels.complete(&mut state);
                }
                let mut candidate = step.applied_to(&state, length);
                residual = self.assemble(&mut candidate, from, torque_n_m, &mut near);
                let overshoot = before > 0.0 && step.work(&residual) < -0.9 * before;
                if !overshoot || relative < ROUND_OFF || trial == 10 {
                    state = candidate;
                    break;
                }
                if recalled {
                    mistaken = true;
                    break;
                }
                length *= 0.5;
                near.advance(length * self.motion(&step));
            }
            if mistaken {
                recalled = false;
                near.advance(length * self.motion(&step));
                residual = self.assemble(&mut state, from, torque_n_m, &mut near);
                continue;
            }
            last_length = length;
            // A shortened step says nothing about the tangent.
            if length == 1.0 {
                chords.push(step);
            } else {
                chords.clear();
            }
        }
        Err(failed(history, "the iterations ran out"))
    }

    /// Bound on the motion of flanks against one another in a step, mm. Nodal displacements bound those between them to 1.25
    /// (the Lebesgue constant of a quadratic).
    fn motion(&self, step: &Step) -> f64 {
        let largest = |x: &[f64]| x.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let nodes = largest(&step.u) + largest(&step.v);
        1.25 * std::f64::consts::SQRT_2 * nodes
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
        if near.must_search() {
            self.wheels.complete(state);
            near.search(&self.flanks, configuration(state), from, self.problem.flank_law.friction > 0.0);
        }
        let law = FlankLaw { friction: 0.0, ..self.flank_law() };
        let tolerance = 1e-3 * (load.abs() + self.problem.drag);
        if let Some(output_rad) = near.balance(&self.flanks, state, law, tolerance, others) {
            near.advance((output_rad - state.output_rad).abs() * self.problem.drive.circular_spline.root_radius_mm);
            state.output_rad = output_rad;
        }
        self.effort.contact += clock.elapsed();
    }

    /// Assembles the out-of-balance forces and the tangent.
    fn assemble(&mut self, state: &mut State, from: &State, torque_n_m: f64, near: &mut NearPairs) -> Residual {
        let clock = Instant::now();
        if near.must_search() {
            self.wheels.complete(state);
            near.search(&self.flanks, configuration(state), from, self.problem.flank_law.friction > 0.0);
        }
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
        BoreLaw { stiffness: self.softening * self.problem.bore_law.stiffness }
    }

    fn flank_law(&self) -> FlankLaw {
        let law = self.problem.flank_law;
        FlankLaw {
            stiffness: self.softening * law.stiffness,
            stick_stiffness: self.softening * law.stick_stiffness,
            ..law
        }
    }

    fn assemble_contact(&mut self, state: &State, near: &mut NearPairs, residual: &mut Residual) {
        let problem = self.problem;
        let (bore_law, flank_law) = (self.bore_law(), self.flank_law());
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
                }
                wheels.add_bore(contact);
                residual.generator_moment += contact.moment;
                residual.generator_contacts += 1;
                residual.peak[1] = residual.peak[1].max(contact.peak);
            },
        );
        let at = configuration(state);
        let column = self.border.column_mut(OUTPUT);
        column.fill(0.0);
        let mut corner = 0.0;
        near.evaluate(&self.flanks, at, flank_law, |pair, contact| {
            let cs_node = |n: usize| self.cs_index[n].expect("flank nodes are free") as usize;
            let nodes = self.flanks.fs_nodes(pair).chain(self.flanks.cs_nodes(pair).map(cs_node));
            for (a, node) in nodes.enumerate() {
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
            residual.peak[0] = residual.peak[0].max(contact.peak);
        });
        self.border.corner.fill(0.0);
        self.border.corner[0] = corner;
    }

    /// Load and drag on the output, sleeve on the bore, and the anchor.
    fn assemble_holding(&mut self, state: &State, torque_n_m: f64, residual: &mut Residual) {
        let problem = self.problem;
        let width = self.border.width;
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let load = problem.per_width(torque_n_m);
        let (drag, drag_stiffness) = problem.drag_torque(state.output_rad - state.drag_anchor_rad);
        residual.drag_torque = drag;
        residual.border[OUTPUT] = load + residual.flank_torque + residual.drag_torque;
        residual.torque_scale += load.abs() + problem.drag;
        residual.free_output = residual.flank_contacts == 0 && drag_stiffness == 0.0;
        let corner = &mut self.border.corner;
        corner[OUTPUT * width + OUTPUT] += drag_stiffness;

        for (f, w) in residual.force.iter_mut().zip(&problem.rotation_weights) {
            *f -= state.sleeve_moment * w;
        }
        let rotation = dot(&problem.rotation_weights, &state.u);
        residual.border[SLEEVE] = -(rotation - problem.sleeve_compliance * state.sleeve_moment);
        corner[SLEEVE * width + SLEEVE] = -problem.sleeve_compliance;
        corner[ANCHORED * width + ANCHORED] = 1.0 / ANCHOR;

        if width == BORDERS {
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
    }

    /// One Newton step, or nothing when the tangent is not positive definite.
    ///
    /// With `chord` the last tangent serves again.
    fn solve(&mut self, residual: &Residual, chord: bool) -> Option<Step> {
        if !chord || self.eliminated.is_none() {
            let clock = Instant::now();
            self.eliminated = None;
            // Far from equilibrium the rim may resist no sliding along the generator; a grounded spring at every node then
            // shortens the step and leaves its direction downhill.
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
        let mut free = residual.force.clone();
        let mut border = residual.border;
        self.turn(&mut free, &mut border, -self.turned);
        let solved = self.eliminated.as_ref()?.solve(self.wheels.as_mut(), &mut free, &mut border[..self.border.width]);
        self.turn(&mut free, &mut border, self.turned);
        self.effort.solution += clock.elapsed();
        if !solved {
            return None;
        }
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
            state.friction = near.friction(&self.flanks, configuration(state), problem.flank_law);
        }
    }

    fn report(&self, residual: &Residual, compliance: f64, iterations: usize) -> Increment {
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
            peak_pressure_mpa: residual.peak,
        }
    }
}

/// The border of this drive; the column of the output angle and the corner change with the contact.
fn fixed_border(problem: &Problem, wheels: &dyn Wheels) -> Border {
    let width = if problem.lateral_stiffness > 0.0 { BORDERS } else { LATERAL };
    let mut border = Border::zeros(wheels.unknowns(), width);
    border.column_mut(SLEEVE)[..problem.rotation_weights.len()].copy_from_slice(&problem.rotation_weights);
    for (unknown, weight) in wheels.anchor() {
        border.column_mut(ANCHORED)[unknown] = weight;
    }
    if width == BORDERS {
        for (i, w) in problem.mean_weights.iter().enumerate().step_by(2) {
            border.column_mut(LATERAL)[i] = *w;
            border.column_mut(LATERAL + 1)[i + 1] = *w;
        }
    }
    border
}

/// States and their weights, and how far (pitches) the nearest of them is.
struct PhaseWeights {
    states: Vec<(usize, f64)>,
    nearest: f64,
}

/// Interpolates (or goes on from) the few states whose distance in pitches is nearest to a whole number; the latest of those
/// that coincide.
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

/// Whether the motion under a load goes on as it was.
fn goes_on(last: &State, from: &State, torque_n_m: f64) -> bool {
    last.torque_n_m == torque_n_m && from.torque_n_m == torque_n_m && last.travel == from.travel
}

/// Broyden's update of an old tangent by the steps that were taken with it (Kelley, Iterative Methods for Linear and Nonlinear
/// Equations, 1995, section 7.3): `step` is the old tangent's.
fn improve(step: &mut Step, taken: &[Step]) {
    for pair in taken.windows(2) {
        let part = pair[0].dot(step) / pair[0].dot(&pair[0]);
        step.add(part, &pair[1]);
    }
    if let Some(last) = taken.last() {
        let part = last.dot(step) / last.dot(last);
        // Beyond this the secant says more about the contact than about the tangent.
        if part.abs() < 0.5 {
            let more = part / (1.0 - part);
            let own = Step { free: step.free.clone(), u: step.u.clone(), v: step.v.clone(), border: step.border };
            step.add(more, &own);
        }
    }
}

/// How far the last iteration brought the residual down.
fn last_gain(history: &[f64]) -> f64 {
    match history {
        [.., before, after] => after / before,
        _ => 1.0,
    }
}

/// A Newton step in all unknowns.
struct Step {
    free: Vec<f64>,
    u: Vec<f64>,
    v: Vec<f64>,
    border: [f64; BORDERS],
}

impl Step {
    /// Work of the out-of-balance forces along the step.
    fn work(&self, residual: &Residual) -> f64 {
        residual.force.iter().zip(&self.free).map(|(f, d)| f * d).sum::<f64>()
            + residual.border[OUTPUT] * self.border[OUTPUT]
    }

    /// Scalar product of displacements (mm²), the turn of the output counted at a radius.
    fn dot(&self, other: &Step) -> f64 {
        const RADIUS: f64 = 50.0;
        let nodes = self.free.iter().zip(&other.free).map(|(a, b)| a * b).sum::<f64>();
        nodes + RADIUS * RADIUS * self.border[OUTPUT] * other.border[OUTPUT]
    }

    fn add(&mut self, factor: f64, other: &Step) {
        let add = |x: &mut [f64], y: &[f64]| x.iter_mut().zip(y).for_each(|(x, y)| *x += factor * y);
        add(&mut self.free, &other.free);
        add(&mut self.u, &other.u);
        add(&mut self.v, &other.v);
        add(&mut self.border, &other.border);
    }

    /// Largest displacement, mm.
    fn largest(&self) -> f64 {
        self.free.iter().fold(1e-30, |m, x| x.abs().max(m))
    }

    fn applied_to(&self, state: &State, length: f64) -> State {
        let mut next = state.clone();
        next.u.iter_mut().zip(&self.u).for_each(|(x, d)| *x += length * d);
        next.v.iter_mut().zip(&self.v).for_each(|(x, d)| *x += length * d);
        next.output_rad += length * self.border[OUTPUT];
        next.sleeve_moment += length * self.border[SLEEVE];
        next.lateral_force[0] += length * self.border[LATERAL];
        next.lateral_force[1] += length * self.border[LATERAL + 1];
        next
    }
}
