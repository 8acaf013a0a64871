//! Newton's method on the whole drive, the same for both solvers; only the wheels differ (see [`Wheels`]).
//!
//! Unknowns are the displacements of both wheels and, as a dense border, the output angle, the moment of the sleeve (a
//! Lagrange multiplier when the sleeve is rigid), its lateral force, and those of its shells on waves of the bore. One
//! increment:
//!
//! predict, lay out the contact; repeat { assemble; done? factorise; solve; go along the step } until done.
//!
//! [`Convergence`] says when it is done, [`LineSearch`] how far along a step it goes, [`Continuation`] by which parts
//! of an increment, and a [`ContactStage`] how hard contact is.

use std::collections::VecDeque;
use std::rc::Rc;

use crate::contact::{AlongFace, Configuration, FlankContact, FlankLaw, FlankPair, Lean};
use crate::fem::{Border, BorderedSystem, largest};
use crate::mesh::rotate;

use super::continuation::{
    ContactStage, Continuation, DEFORMING_SOFTNESS, JUMPING_SOFTNESS, LOADING_SOFTNESS, Sought, Way,
};
use super::convergence::{Convergence, WorkLimit};
use super::error::SolveError;
use super::fast::{CondensedWheels, Kept};
use super::line_search::{LineSearch, MOST_TRIALS, Trial};
use super::near::{NearPairs, configuration};
use super::passed::Passed;
use super::problem::Problem;
use super::reference::SparseWheels;
use super::slip::{NodalField, Slipping};
use super::state::State;
use super::step::{ANCHORED, BORDERS, LATERAL, OUTPUT, SLEEVE, Unbalance, improve};
use super::wheels::Wheels;

/// Pairs closer than this (mm) get a place in the sparsity pattern.
const PATTERN_REACH: f64 = 0.04;
/// Stiffness (N/mm per mm) that anchors one node of the flexspline while the matrix is factorised; the border takes it
/// out again.
pub(super) const ANCHOR: f64 = 1e5;
/// Springs (N/mm per mm) that are tried in turn when the tangent is not positive definite.
const GROUNDED_SPRINGS: [f64; 4] = [1e-3, 1e-1, 1e1, 1e3];
/// Share of the output's largest stiffness below which a load that finds no equilibrium is taken for one that the drive
/// does not bear: it softens as teeth begin to climb over one another. A guess: half.
const GIVES_WAY: f64 = 0.5;
/// Gain of an iteration after which the last factor serves again.
const CHORD_GAIN: f64 = 0.2;
/// Fraction of a pitch off which a tangent of an earlier pitch still serves, and the gain that each iteration must then
/// make.
const RECALL_WITHIN: f64 = 0.06;
const RECALL_GAIN: f64 = 0.3;
/// A tangent made further from equilibrium than this (relative residual) knows the wrong contact.
const KEEP_BELOW: f64 = 0.1;
/// Parts of one increment at most. *Guess*: a load of 100 kN m that comes on without a single easy part has 1000.
const MOST_PARTS: usize = 10_000;
/// Stiffness (N mm/mm per rad) of an output that nothing holds and nothing turns, so that the wheels have a step. Of
/// any size: no torque acts on it.
const HOLDS_A_FREE_OUTPUT: f64 = 1.0;
/// Why a step cannot be had.
const NOT_DEFINITE: &str = "the stiffness matrix is not positive definite";
/// Why Newton finds no place for an output that nothing holds.
const FLOATS: &str = "without load and without drag nothing holds the output within its clearance; give it a load, or \
                      output.drag_torque_n_m";
/// Tangents remembered.
const TANGENTS: usize = 12;

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
    /// where the load along the face is largest (`FlankContact::peak_pressure_mpa`); on the bore that of the penalty.
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

impl Default for Face {
    /// Straight teeth, evenly loaded.
    fn default() -> Face {
        Face { tilt_rad: 0.0, skew_rad: 0.0, peak_over_mean: 1.0, share: 1.0 }
    }
}

/// Where the drive stands, and how it was found.
type Solved = Result<(State, Increment), SolveError>;

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
    /// The part that the tangent leaves out.
    slipping: Slipping,
    /// The states passed in steady motion.
    passed: Passed,
    /// Motion of the ends of a face for displacements of 1 mm, at most.
    leans_within: f64,
    /// Least compliance under load that was met, rad/(N m).
    stiffest: f64,
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
            passed: Passed::default(),
            leans_within: problem.leans_within(),
            stiffest: f64::INFINITY,
        }
    }

    /// The flexspline deformed by the generator at `generator_rad`, without load.
    pub fn deform(&mut self, generator_rad: f64) -> Solved {
        let mut work = WorkLimit::new(&self.problem.settings);
        let shape = self.problem.starting_shape(generator_rad);
        // All of a conforming generator touches at once; a soft contact first finds which part stays.
        let stage = ContactStage { assembling: true, ..ContactStage::default() };
        let sought = Sought { from: &shape, generator_rad, torque_n_m: 0.0, stage };
        let first = self.newton_softly(sought, DEFORMING_SOFTNESS[0], &mut work);
        if !matches!(first, Err(SolveError::NotConverged { .. })) {
            return first;
        }
        let patiently = Sought { stage: ContactStage { patient: true, ..stage }, ..sought };
        let found = DEFORMING_SOFTNESS.iter().find_map(|soft| self.newton_softly(patiently, soft, &mut work).ok());
        found.map_or(first, Ok)
    }

    /// Turns the generator to `generator_rad` and brings the load to `torque_n_m`, in one increment or, where Newton
    /// needs it, in several.
    pub fn increment(&mut self, from: &State, generator_rad: f64, torque_n_m: f64) -> Solved {
        let mut work = WorkLimit::new(&self.problem.settings);
        let mut way = Continuation::new(from, generator_rad, torque_n_m, self.problem.settings.load_step_n_m);
        let mut state = from.clone();
        let mut compliance = None;
        for _ in 0..MOST_PARTS {
            let stage = ContactStage { patient: way.patient, ..ContactStage::default() };
            let [generator_rad, torque_n_m] = way.next();
            match self.solve_part(Sought { from: &state, generator_rad, torque_n_m, stage }, &mut work) {
                Ok((next, mut increment)) => {
                    self.problem.check_range(&next)?;
                    state = next;
                    compliance = Some(increment.compliance_rad_per_n_m);
                    if state.torque_n_m != 0.0 {
                        self.stiffest = self.stiffest.min(increment.compliance_rad_per_n_m);
                    }
                    if way.advance(increment.iterations) {
                        increment.iterations = way.iterations;
                        return Ok((state, increment));
                    }
                }
                Err(SolveError::NotConverged { history, .. }) if way.may_halve(self.problem) && work.is_left() => {
                    way.halve(history.len());
                }
                Err(mut error) => {
                    if let SolveError::NotConverged { reached_n_m, softened_to, .. } = &mut error {
                        let left = compliance.map(|now| self.stiffest / now);
                        *reached_n_m = state.torque_n_m;
                        *softened_to = left.filter(|left| *left < GIVES_WAY && way.changes_load());
                    }
                    return Err(error);
                }
            }
        }
        let reason = "the increment falls into too many parts";
        let (reached_n_m, history) = (state.torque_n_m, Vec::new());
        Err(SolveError::NotConverged { generator_rad, torque_n_m, reached_n_m, softened_to: None, reason, history })
    }

    /// Turns the generator on, by whole flexspline pitches and under the same load, to a place where an imperfect drive
    /// stands differently: the state is turned with it, and a soft contact finds the way first. For flanks without
    /// friction: what they remember is not carried along.
    pub fn jump(&mut self, from: &State, generator_rad: f64) -> Solved {
        // The output goes on at its mean rate, whatever it did last.
        let from = &State { output_rate: 1.0 / self.problem.drive.ratio(), ..from.clone() };
        let sought = Sought { from, generator_rad, torque_n_m: from.torque_n_m, stage: ContactStage::default() };
        let solved = self.newton_softly(sought, &JUMPING_SOFTNESS, &mut WorkLimit::new(&self.problem.settings))?;
        self.problem.check_range(&solved.0)?;
        Ok(solved)
    }

    /// One part of an increment, by each of the ways to its load until one leads there.
    fn solve_part(&mut self, sought: Sought<'_>, work: &mut WorkLimit) -> Solved {
        let Sought { from, torque_n_m, stage, .. } = sought;
        if torque_n_m == from.torque_n_m {
            let turned = self.newton(sought, from, work);
            // Halved as often as this, the way is not too long but blocked: with two rollers in a hat, teeth that
            // wedge.
            let blocked = stage.patient && matches!(turned, Err(SolveError::NotConverged { .. }));
            return if blocked { self.newton_softly(sought, &LOADING_SOFTNESS, work) } else { turned };
        }
        let mut last = None;
        for way in Way::to_load(from.torque_n_m, torque_n_m) {
            let stage = ContactStage { hurries: way == Way::Softly, ..stage };
            match self.newton_softly(Sought { stage, ..sought }, way.softness(), work) {
                Err(error @ SolveError::NotConverged { .. }) => last = Some(error),
                solved => return solved,
            }
        }
        Err(last.expect("there are three ways"))
    }

    /// Newton with contact that is soft at first: by these factors on the penalties in turn, then as hard as it is.
    fn newton_softly(&mut self, sought: Sought<'_>, softness: &[f64], work: &mut WorkLimit) -> Solved {
        let mut guess = sought.from.clone();
        let mut iterations = 0;
        for &softening in softness {
            let stage = ContactStage { softening: Some(softening), ..sought.stage };
            let (state, increment) = self.newton(sought.at(stage, &guess), &guess, work)?;
            iterations += increment.iterations;
            guess = state;
        }
        let (state, mut increment) = self.newton(sought.at(sought.stage, &guess), &guess, work)?;
        increment.iterations += iterations;
        Ok((state, increment))
    }

    /// Equilibrium at this angle and load, looked for from `guess`.
    fn newton(&mut self, sought: Sought<'_>, guess: &State, work: &mut WorkLimit) -> Solved {
        let Sought { generator_rad, torque_n_m, stage, .. } = sought;
        let settings = &self.problem.settings;
        let mut convergence = Convergence::new(stage.tolerance(settings), stage.most_iterations(settings));
        let floats = torque_n_m == 0.0 && self.problem.drag == 0.0;
        self.iterate(sought, guess, &mut convergence, work).map_err(|reason| SolveError::NotConverged {
            generator_rad,
            torque_n_m,
            reached_n_m: torque_n_m,
            softened_to: None,
            reason: if floats { FLOATS } else { reason },
            history: convergence.history,
        })
    }

    /// Newton's iterations, or why they lead nowhere.
    fn iterate(
        &mut self,
        sought: Sought<'_>,
        guess: &State,
        convergence: &mut Convergence,
        work: &mut WorkLimit,
    ) -> Result<(State, Increment), &'static str> {
        let Sought { from, generator_rad, torque_n_m, stage } = sought;
        let predicted = self.passed.predict(self.problem, guess, generator_rad, torque_n_m);
        let mut state = State { drag_anchor_rad: from.drag_anchor_rad, friction: from.friction.clone(), ..predicted };
        self.problem.lean(&mut state);
        let mut near = NearPairs::default();
        self.balance_output(&mut state, sought, &mut near);
        let mut residual = self.assemble(&mut state, sought, &mut near);
        let mut held = false;
        let mut chords: Vec<NodalField> = Vec::new();
        let mut search = LineSearch::new(self.problem, stage);
        let steady = stage.softening.is_none() && self.passed.go_on(guess, torque_n_m);
        search.recalled = steady && generator_rad != guess.generator_rad && self.recall(generator_rad);
        while convergence.goes_on() {
            convergence.push(residual.relative(), work)?;
            // While contact is soft it may touch nothing: that only shows the way.
            if convergence.is_met() && (!residual.free_output || stage.softening.is_some()) {
                if self.contact_stands(&state, &mut near, convergence) {
                    return self.converged(state, sought, &near, &residual, convergence.history.len() - 1);
                }
                residual = self.assemble(&mut state, sought, &mut near);
                continue;
            }
            if residual.free_output && !held {
                let stood = state.output_rad;
                self.balance_output(&mut state, sought, &mut near);
                residual = self.assemble(&mut state, sought, &mut near);
                // No flank in reach, and no load that turns it: it stays while the wheels go on.
                held = residual.free_output && state.output_rad == stood && residual.border[OUTPUT] == 0.0;
                continue;
            }
            held = false;
            // While it makes good progress an old factor serves again: a step with it costs a tenth.
            let gain = convergence.gain();
            search.recalled &= convergence.history.len() == 1 || gain < RECALL_GAIN;
            let chord = search.recalled || gain < CHORD_GAIN;
            let mut step = self.solve(&residual, chord).ok_or(NOT_DEFINITE)?;
            if chord {
                improve(&mut step, &chords);
            } else {
                chords.clear();
                self.made_at = convergence.relative();
            }
            search.begin(&step, &residual, convergence);
            match self.go_along(&step, &mut state, sought, &mut near, &mut search) {
                Some(at_its_end) => {
                    residual = at_its_end;
                    // A shortened step says nothing about the tangent.
                    if search.length == 1.0 { chords.push(step) } else { chords.clear() }
                }
                None => residual = self.assemble(&mut state, sought, &mut near),
            }
        }
        Err("the iterations ran out")
    }

    /// Goes along a step as far as forces do not turn round; what is out of balance there, or nothing where the step
    /// was mistaken.
    fn go_along(
        &mut self,
        step: &NodalField,
        state: &mut State,
        sought: Sought<'_>,
        near: &mut NearPairs,
        search: &mut LineSearch,
    ) -> Option<Unbalance> {
        let motion = self.motion(step);
        near.advance(search.length * motion);
        for trial in 0..=MOST_TRIALS {
            // Teeth that come near from here on need their flanks in this state, too: the next candidate starts from
            // it.
            if near.must_search() {
                self.wheels.complete(state);
            }
            let mut candidate = step.applied_to(state, search.length, &self.problem.held);
            self.wheels.follow(&mut candidate);
            let residual = self.assemble(&mut candidate, sought, near);
            match search.judge(trial, step, &residual) {
                Trial::Taken => {
                    *state = candidate;
                    return Some(residual);
                }
                Trial::Halved => near.advance(search.length * motion),
                Trial::Mistaken => {
                    near.advance(search.length * motion);
                    break;
                }
            }
        }
        if search.looked_back {
            near.look_again();
        }
        None
    }

    /// Whether all that bears in this state was laid out for it; what was not is laid out anew.
    fn contact_stands(&self, state: &State, near: &mut NearPairs, convergence: &mut Convergence) -> bool {
        let at = configuration(state);
        if !convergence.looked_at_all && near.missed(&self.flanks, at) {
            convergence.looked_at_all = true;
            near.look_again();
            return false;
        }
        // The contact was laid out for the predicted state; where the corner of a space ended elsewhere, again.
        let fits = near.layouts_fit(&self.flanks, at);
        if !fits {
            convergence.start_again();
            near.clear();
        }
        fits
    }

    /// End of an increment: its report, and the values to remember.
    fn converged(
        &mut self,
        mut state: State,
        Sought { from, generator_rad, stage, .. }: Sought<'_>,
        near: &NearPairs,
        residual: &Unbalance,
        iterations: usize,
    ) -> Result<(State, Increment), &'static str> {
        let compliance = self.compliance(residual).ok_or(NOT_DEFINITE)?;
        let law = stage.flank_law(self.problem.flank_law);
        let mut increment = self.report(&state, residual, compliance, iterations);
        let hard = stage.softening.is_none();
        if hard {
            let modulus_mpa = self.problem.contact_modulus_mpa();
            increment.peak_pressure_mpa[0] =
                near.peak_pressure_mpa(&self.flanks, configuration(&state), law, modulus_mpa);
        }
        self.wheels.complete(&mut state);
        self.finish(&mut state, from, near, law);
        if hard && generator_rad != from.generator_rad {
            if !self.passed.remember(self.problem, &state) {
                self.tangents.clear();
            }
            self.keep_tangent(state.generator_rad);
        }
        Ok((state, increment))
    }

    /// Bound on the motion of flanks against one another in a step, mm. Nodal displacements bound those between them to
    /// 1.25 (the Lebesgue constant of a quadratic).
    fn motion(&self, step: &NodalField) -> f64 {
        let (u, v) = step.free.split_at(2 * self.problem.wheels().0.nodes.len());
        let nodes = largest(u) + largest(v);
        (1.25 + self.leans_within) * std::f64::consts::SQRT_2 * nodes
            + self.problem.drive.circular_spline.root_radius_mm * step.border[OUTPUT].abs()
    }

    /// Turns the output to where load, drag and flanks balance while the wheels keep their shape.
    fn balance_output(&mut self, state: &mut State, sought: Sought<'_>, near: &mut NearPairs) {
        let load = self.problem.per_width(sought.torque_n_m);
        let anchor_rad = state.drag_anchor_rad;
        let others = |output_rad: f64| {
            let (drag, slope) = self.problem.drag_torque(output_rad - anchor_rad);
            (load + drag, -slope)
        };
        self.look_around(state, sought.from, near);
        let law = FlankLaw { friction: 0.0, ..sought.stage.flank_law(self.problem.flank_law) };
        let tolerance = 1e-3 * (load.abs() + self.problem.drag);
        if let Some(output_rad) = near.balance(&self.flanks, state, law, tolerance, others) {
            near.advance((output_rad - state.output_rad).abs() * self.problem.drive.circular_spline.root_radius_mm);
            state.output_rad = output_rad;
        }
    }

    /// Looks for pairs that may have come near.
    fn look_around(&self, state: &mut State, from: &State, near: &mut NearPairs) {
        if near.must_search() {
            self.wheels.complete(state);
            near.search(&self.flanks, configuration(state), from, self.problem.flank_law.friction > 0.0);
        }
    }

    /// Assembles the out-of-balance forces and the tangent.
    fn assemble(&mut self, state: &mut State, sought: Sought<'_>, near: &mut NearPairs) -> Unbalance {
        self.problem.lean(state);
        self.look_around(state, sought.from, near);
        self.make_room(configuration(state), near);
        let mut residual = Unbalance::zero(self.wheels.unknowns());
        self.wheels.assemble(state, &mut residual.force);
        self.assemble_contact(state, sought.stage, near, &mut residual);
        self.assemble_holding(state, sought.torque_n_m, &mut residual);
        residual
    }

    /// Makes sure that the tangent has room for these pairs.
    fn make_room(&mut self, at: Configuration, near: &NearPairs) {
        let pairs: Vec<FlankPair> = near.pairs().collect();
        if self.wheels.prepare(&pairs, &|| self.flanks.near_pairs(at, PATTERN_REACH)) {
            self.eliminated = None;
        }
    }

    fn assemble_contact(&mut self, state: &State, stage: ContactStage, near: &mut NearPairs, residual: &mut Unbalance) {
        let problem = self.problem;
        let (bore_law, flank_law) = (stage.bore_law(problem.bore_law), stage.flank_law(problem.flank_law));
        let bore_nodes = &problem.wheels().0.nodes;
        let major = [state.generator_rad.cos(), state.generator_rad.sin()];
        let wheels = self.wheels.as_mut();
        problem.bore.evaluate(bore_law, &problem.outline, state.generator_rad, &state.u, &mut near.bore, |contact| {
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
        });
        self.slipping.clear();
        let slipping = &mut self.slipping;
        let at = configuration(state);
        self.border.column_mut(OUTPUT).fill(0.0);
        let mut corner = 0.0;
        let mut leaning = Leaning::new(problem, &mut self.border);
        near.evaluate(&self.flanks, at, flank_law, |pair, contact| {
            let cs_node = |n: usize| self.cs_index[n].expect("flank nodes are free") as usize;
            let nodes: Vec<usize> = self.flanks.fs_nodes(pair).chain(self.flanks.cs_nodes(pair).map(cs_node)).collect();
            slipping.add(&contact.slipping, |i| 2 * nodes[i / 2] + i % 2);
            let column = self.border.column_mut(OUTPUT);
            for (a, node) in nodes.iter().enumerate() {
                for k in 0..2 {
                    let i = 2 * a + k;
                    residual.force[2 * node + k] += contact.force[i];
                    residual.scale = residual.scale.max(contact.force[i].abs());
                    column[2 * node + k] += contact.border[i];
                }
            }
            wheels.add_flank(pair, contact.stiffness);
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
    fn assemble_holding(&mut self, state: &State, torque_n_m: f64, residual: &mut Unbalance) {
        let problem = self.problem;
        let width = self.border.width;
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

        problem.rotation_weights.iter().for_each(|(k, w)| residual.force[*k] -= state.sleeve_moment * w);
        let rotation = problem.rotation_weights.iter().map(|(k, w)| w * state.u[*k]).sum::<f64>();
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
    fn solve(&mut self, residual: &Unbalance, chord: bool) -> Option<NodalField> {
        // Displacements by the forces without the border, solved together with the border of a new factor.
        let mut begun = None;
        if !chord || self.eliminated.is_none() {
            self.eliminated = None;
            // Far from equilibrium the rim may resist no sliding along the generator; a grounded spring at every node
            // then shortens the step and leaves its direction downhill.
            let definite = std::iter::once(0.0).chain(GROUNDED_SPRINGS).any(|spring| self.wheels.factorise(spring));
            if !definite {
                return None;
            }
            let (system, solved) = BorderedSystem::new(self.wheels.as_mut(), &self.border, &residual.force);
            self.eliminated = Some(Rc::new(system));
            begun = Some(solved);
            self.turned = 0;
        }
        let slipping = std::mem::take(&mut self.slipping);
        let forces = NodalField { free: residual.force.clone(), border: residual.border };
        let solved = slipping.solve(forces, |field| self.solve_symmetric(field, begun.take()));
        self.slipping = slipping;
        solved
    }

    /// Solves with the last factor, in place; `begun` is what that factor did with the forces when it was made.
    fn solve_symmetric(&mut self, field: &mut NodalField, begun: Option<Vec<f64>>) -> Option<()> {
        let NodalField { free, border } = field;
        let system = self.eliminated.clone()?;
        if let Some(begun) = begun {
            *free = begun;
            return system.complete(free, &mut border[..self.border.width]).then_some(());
        }
        self.turn(free, border, -self.turned);
        let solved = system.solve(self.wheels.as_mut(), free, &mut border[..self.border.width]);
        self.turn(free, border, self.turned);
        solved.then_some(())
    }

    /// Turns forces or displacements by a number of pitches.
    fn turn(&self, free: &mut [f64], border: &mut [f64; BORDERS], pitches: isize) {
        if pitches != 0 {
            self.wheels.turn(free, pitches);
            let turn = (pitches as f64 * self.problem.flexspline.pitch()).sin_cos();
            [border[LATERAL], border[LATERAL + 1]] = rotate([border[LATERAL], border[LATERAL + 1]], turn);
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
    fn compliance(&mut self, residual: &Unbalance) -> Option<f64> {
        if self.eliminated.is_none() {
            self.solve(residual, false)?;
        }
        let mut border = [0.0; BORDERS];
        border[OUTPUT] = 1.0;
        let solved = self.eliminated.as_ref()?.solve_border(&mut border[..self.border.width]);
        solved.then_some(border[OUTPUT])
    }

    /// Carries the history over the end of an increment.
    fn finish(&self, state: &mut State, from: &State, near: &NearPairs, law: FlankLaw) {
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
            state.friction = near.friction(&self.flanks, configuration(state), law);
        }
    }

    fn report(&self, state: &State, residual: &Unbalance, compliance: f64, iterations: usize) -> Increment {
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

    fn face(&self, state: &State, residual: &Unbalance) -> Face {
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

/// Lean of the teeth, by waves of the rim: a load at the end of a face works on their amplitudes.
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

    /// Adds a pair; `unknown` gives that of the system for each of its own.
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
    fn finish(self, problem: &Problem, border: &mut Border, residual: &mut Unbalance) {
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
    problem.rotation_weights.iter().for_each(|(k, w)| border.column_mut(SLEEVE)[*k] = *w);
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
