//! The `reference` solver: full sparse Newton on the whole mesh.
//!
//! Unknowns are the displacements of both wheels and, as a dense border, the output angle, the moment of the sleeve (a
//! Lagrange multiplier when the sleeve is rigid) and its lateral force. One increment:
//!
//! predict, lay out the contact; repeat { assemble; done? factorise; solve; update } until done.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

use crate::contact::{BoreLaw, Configuration, FlankContact, FlankLaw, FlankLayout, FlankPair};
use crate::element::{PACKED, add_tangent_and_force, linear_stiffness};
use crate::fem::{BlockPosition, Border, BorderedSystem, Cholesky, ElementPositions, Pattern};

use super::error::SolveError;
use super::predictor::turn_field;
use super::problem::Problem;
use super::state::State;

/// Pairs closer than this (mm) get a place in the sparsity pattern.
const PATTERN_REACH: f64 = 0.04;
/// Pairs closer than this (mm) are evaluated in every iteration of an increment.
const CONTACT_REACH: f64 = 0.015;
/// Stiffness (N/mm per mm) that anchors one bore node while the matrix is factorised; the border takes it out again.
const ANCHOR: f64 = 1e5;
/// Springs (N/mm per mm) that are tried in turn when the tangent is not positive definite.
const GROUNDED_SPRINGS: [f64; 4] = [1e-3, 1e-1, 1e1, 1e3];
/// Largest change of a displacement that an undamped Newton step may make, mm.
const LARGEST_STEP: f64 = 0.1;
/// Largest first step of a changing load, N m.
const LARGEST_LOAD_STEP: f64 = 100.0;
/// Factor on the penalties while the way to a new load is found.
const LOADING_SOFTNESS: f64 = 1e-3;
/// Iterations after which the next part of an increment may be twice as large.
const EASY: usize = 10;

/// How far (mm) flanks are looked for when the output is balanced.
const CLEARANCE_REACH: f64 = 0.06;
/// Gap (mm) below which a pair counts as touching when its layout is checked.
const TOUCH: f64 = 1e-7;
/// Shift (mm) of a corner on the flank up to which the integration points stay.
const CORNER_DRIFT: f64 = 1e-4;
/// Relative residual below which steps are taken whole: what is left is near round-off.
const ROUND_OFF: f64 = 1e-6;

/// Relative residual below which the last factor may serve again, and the gain that the last iteration must have made.
const CHORD_BELOW: f64 = 1e-2;
const CHORD_GAIN: f64 = 0.2;

/// States of steady motion that the predictor remembers: a fine sampling of one pitch.
const REMEMBERED: usize = 48;

type Layouts = BTreeMap<FlankPair, FlankLayout>;

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
}

/// Newton solver with its work space: one per thread.
pub struct Solver<'p> {
    problem: &'p Problem,
    flanks: FlankContact<'p>,
    /// Number of each circular-spline node among the free nodes of the system.
    cs_index: Vec<Option<u32>>,
    free_nodes: usize,
    /// Small-strain stiffness of the circular-spline elements of sector 0.
    cs_template: Vec<[f64; PACKED]>,
    system: Option<System>,
    /// Factor on the penalties, below 1 only while the drive is first deformed.
    softening: f64,
    /// The last states of steady motion, oldest first.
    passed: VecDeque<State>,
    /// Time spent so far.
    pub effort: Effort,
}

/// The sparse system for one set of flank pairs.
struct System {
    pairs: BTreeMap<FlankPair, PairPositions>,
    pattern: Pattern,
    fs_positions: Vec<ElementPositions>,
    bore_positions: Vec<[Option<BlockPosition>; 3]>,
    /// Values of the circular spline, which do not change.
    cs_values: Vec<f64>,
    factor: Cholesky,
    /// The border eliminated with the factor, once there is one.
    eliminated: Option<BorderedSystem>,
    values: Vec<f64>,
    border: Border,
}

/// Where a pair's contribution goes.
struct PairPositions {
    /// Free node of each local node.
    nodes: Vec<u32>,
    /// Blocks of local node pairs (a, b < a) that the pattern holds.
    blocks: Vec<(usize, usize, BlockPosition)>,
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
        let mut next = problem.flexspline.nodes.len() as u32;
        let cs_index = problem
            .held
            .iter()
            .map(|held| {
                (!held).then(|| {
                    next += 1;
                    next - 1
                })
            })
            .collect();
        let cs_template = problem.circular_spline.gauss[..problem.circular_spline.elements_per_sector]
            .iter()
            .map(|points| linear_stiffness(points, &problem.material))
            .collect();
        Solver {
            problem,
            flanks: problem.flanks(),
            cs_index,
            free_nodes: next as usize,
            cs_template,
            system: None,
            softening: 1.0,
            passed: VecDeque::new(),
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
        self.softening = LOADING_SOFTNESS;
        let soft = self.newton(from, generator_rad, torque_n_m);
        self.softening = 1.0;
        let (mut guess, first) = soft?;
        // History is that of the start, not of the guess.
        guess.drag_anchor_rad = from.drag_anchor_rad;
        guess.friction = from.friction.clone();
        let (state, mut increment) = self.newton(&guess, generator_rad, torque_n_m)?;
        increment.iterations += first.iterations;
        Ok((state, increment))
    }

    /// State predicted for a generator angle: the wave turned, the output going on as it did before.
    ///
    /// A drive in steady motion passes through the same state after every flexspline pitch, one tooth further. Of the last
    /// states the one is turned that needs the smallest fraction of a pitch, whole teeth being exact. An output that carries
    /// no load stays where it is when the generator reverses: it has the clearance to cross.
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
        let fraction = |state: &State| {
            let turns = (generator_rad - state.generator_rad) / pitch;
            (turns - turns.round()).abs()
        };
        let steady = !reversing && (from.output_rate / nominal - 1.0).abs() < 0.2;
        let base = self
            .passed
            .iter()
            .filter(|state| steady && state.torque_n_m == torque_n_m && state.travel == from.travel)
            .min_by(|a, b| fraction(a).total_cmp(&fraction(b)))
            .filter(|state| fraction(state) < 0.5 * fraction(from))
            .unwrap_or(from);
        let turn = generator_rad - base.generator_rad;
        let output_turn = match (idle, reversing) {
            (true, true) => 0.0,
            (false, true) => turn * nominal,
            _ if std::ptr::eq(base, from) => from.output_rate * turn,
            _ => turn * nominal,
        };
        State {
            u: turn_field(&problem.flexspline, &base.u, turn),
            v: turn_field(&problem.circular_spline, &base.v, turn - output_turn),
            output_rad: base.output_rad + output_turn,
            generator_rad,
            torque_n_m,
            sleeve_moment: base.sleeve_moment,
            drag_anchor_rad: from.drag_anchor_rad,
            lateral_force: base.lateral_force,
            friction: from.friction.clone(),
            output_rate: from.output_rate,
            travel: from.travel,
        }
    }

    /// Remembers a state of steady motion for the predictor.
    fn remember(&mut self, state: &State) {
        let nominal = 1.0 / self.problem.drive.ratio();
        let steady = (state.output_rate / nominal - 1.0).abs() < 0.2;
        let fits = |old: &State| old.torque_n_m == state.torque_n_m && old.travel == state.travel;
        if !steady || self.passed.front().is_some_and(|old| !fits(old)) {
            self.passed.clear();
        }
        if steady {
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
        let clock = Instant::now();
        self.balance_output(&mut state, torque_n_m);
        self.effort.contact += clock.elapsed();
        let mut layouts = Layouts::new();
        let mut residual = self.assemble(&state, from, torque_n_m, &mut layouts);
        let mut history = Vec::new();
        let mut last_length = 1.0;
        while history.len() <= settings.max_iterations {
            let relative = residual.relative();
            history.push(relative);
            if !relative.is_finite() {
                return Err(failed(history, "the residual is not finite"));
            }
            if relative <= settings.tolerance {
                // The contact was laid out for the predicted state; where the corner of a space ended elsewhere, again.
                if self.layouts_fit(&state, &layouts) {
                    let Some(compliance) = self.compliance(&residual) else {
                        return Err(failed(history, "the stiffness matrix is not positive definite"));
                    };
                    let increment = self.report(&residual, compliance, history.len() - 1);
                    self.finish(&mut state, from, &layouts);
                    if generator_rad != from.generator_rad {
                        self.remember(&state);
                    }
                    return Ok((state, increment));
                }
                layouts.clear();
                residual = self.assemble(&state, from, torque_n_m, &mut layouts);
                continue;
            }
            if residual.free_output {
                self.balance_output(&mut state, torque_n_m);
                residual = self.assemble(&state, from, torque_n_m, &mut layouts);
                continue;
            }
            // Near the end the last factor still points the right way, and a step with it costs a tenth.
            let chord = relative < CHORD_BELOW && last_gain(&history) < CHORD_GAIN;
            let Some(step) = self.solve(&residual, chord) else {
                return Err(failed(history, "the stiffness matrix is not positive definite"));
            };
            // The force along the step falls from `before` to nothing at the end of a perfect step; far beyond, halve it.
            let before = step.work(&residual);
            let mut length = (LARGEST_STEP / step.largest()).min(1.0).min(8.0 * last_length);
            for trial in 0.. {
                let candidate = step.applied_to(&state, length);
                residual = self.assemble(&candidate, from, torque_n_m, &mut layouts);
                let overshoot = before > 0.0 && step.work(&residual) < -0.9 * before;
                if !overshoot || relative < ROUND_OFF || trial == 10 {
                    state = candidate;
                    break;
                }
                length *= 0.5;
            }
            last_length = length;
        }
        Err(failed(history, "the iterations ran out"))
    }

    /// Turns the output to where load, drag and flanks balance while the wheels keep their shape. The torque falls as the
    /// output turns forward, so the balance is bracketed and then found by Newton safeguarded with bisection.
    fn balance_output(&self, state: &mut State, torque_n_m: f64) {
        let load = self.problem.per_width(torque_n_m);
        let start = configuration(state);
        let layouts: Vec<_> = self
            .flanks
            .near_pairs(start, CLEARANCE_REACH)
            .into_iter()
            .map(|pair| (pair, self.flanks.layout(pair, start)))
            .collect();
        let law = FlankLaw { friction: 0.0, ..self.flank_law() };
        let balance = |output_rad: f64| -> (f64, f64) {
            let at = Configuration { output_rad, ..start };
            let (drag, drag_slope) = self.problem.drag_torque(output_rad - state.drag_anchor_rad);
            let (mut torque, mut slope) = (load + drag, -drag_slope);
            for (pair, layout) in &layouts {
                if let Some(contact) = self.flanks.evaluate(*pair, at, law, &layout.points) {
                    torque += contact.torque;
                    slope -= contact.corner;
                }
            }
            (torque, slope)
        };
        let tolerance = 1e-3 * (load.abs() + self.problem.drag);
        let (mut torque, mut slope) = balance(state.output_rad);
        let mut output_rad = state.output_rad;
        // `behind` has a positive torque, `ahead` a negative one.
        let (mut behind, mut ahead) = (None::<f64>, None::<f64>);
        let mut stride = 1e-6_f64;
        for _ in 0..60 {
            if torque.abs() <= tolerance {
                break;
            }
            if torque > 0.0 {
                behind = Some(output_rad);
            } else {
                ahead = Some(output_rad);
            }
            let newton = if slope < 0.0 { output_rad - torque / slope } else { f64::NAN };
            output_rad = match (behind, ahead) {
                (Some(low), Some(high)) => {
                    if newton > low && newton < high {
                        newton
                    } else {
                        0.5 * (low + high)
                    }
                }
                _ => {
                    stride *= 4.0;
                    let stride = stride.copysign(torque);
                    if (newton - output_rad).abs() < stride.abs() { newton } else { output_rad + stride }
                }
            };
            if (output_rad - state.output_rad).abs() > CLEARANCE_REACH / self.flanks.space.base_radius {
                return;
            }
            (torque, slope) = balance(output_rad);
        }
        state.output_rad = output_rad;
    }

    /// Assembles the out-of-balance forces and, into the system, the tangent.
    fn assemble(&mut self, state: &State, from: &State, torque_n_m: f64, layouts: &mut Layouts) -> Residual {
        let clock = Instant::now();
        let at = configuration(state);
        for pair in self.flanks.near_pairs(at, CONTACT_REACH) {
            if let Entry::Vacant(place) = layouts.entry(pair) {
                let mut layout = self.flanks.layout(pair, at);
                if self.problem.flank_law.friction > 0.0 {
                    let empty = Vec::new();
                    let history = from.friction.get(&(pair.tooth, pair.side)).unwrap_or(&empty);
                    self.flanks.start_friction(pair, configuration(from), history, &mut layout.points);
                }
                place.insert(layout);
            }
        }
        self.effort.contact += clock.elapsed();
        self.prepare_system(at, layouts);
        let mut system = self.system.take().expect("the system was just prepared");
        let mut residual = Residual::zero(2 * self.free_nodes);
        self.assemble_wheels(state, &mut system, &mut residual);
        let clock = Instant::now();
        self.assemble_contact(state, layouts, &mut system, &mut residual);
        self.assemble_holding(state, torque_n_m, &mut system, &mut residual);
        self.effort.contact += clock.elapsed();
        self.system = Some(system);
        residual
    }

    /// Makes sure that the sparsity pattern has room for these pairs.
    fn prepare_system(&mut self, at: Configuration, layouts: &Layouts) {
        if let Some(system) = &self.system
            && layouts.keys().all(|pair| system.pairs.contains_key(pair))
        {
            return;
        }
        let clock = Instant::now();
        let mut pairs: Vec<FlankPair> = self.flanks.near_pairs(at, PATTERN_REACH);
        pairs.extend(layouts.keys());
        pairs.sort_unstable();
        pairs.dedup();
        self.system = Some(self.analyse(&pairs));
        self.effort.analysis += clock.elapsed();
    }

    fn analyse(&self, pairs: &[FlankPair]) -> System {
        let problem = self.problem;
        let cs_nodes: Vec<[Option<u32>; 8]> =
            problem.circular_spline.elements.iter().map(|element| element.map(|n| self.cs_index[n as usize])).collect();
        let cs_groups: Vec<Vec<u32>> = cs_nodes.iter().map(|e| e.iter().flatten().copied().collect()).collect();
        let pair_nodes: Vec<(Vec<u32>, Vec<u32>)> = pairs
            .iter()
            .map(|&pair| {
                let fs = self.flanks.fs_nodes(pair).map(|n| n as u32).collect();
                let cs = self.flanks.cs_nodes(pair).map(|n| self.cs_index[n].expect("flank nodes are free")).collect();
                (fs, cs)
            })
            .collect();
        let groups =
            problem.flexspline.elements.iter().map(|e| e.as_slice()).chain(cs_groups.iter().map(Vec::as_slice));
        let across = pair_nodes.iter().map(|(fs, cs)| (fs.as_slice(), cs.as_slice()));
        let pattern = Pattern::new(self.free_nodes, groups, across);
        let factor = Cholesky::new(&pattern);

        let mut cs_values = vec![0.0; pattern.stored()];
        for (nodes, points) in cs_nodes.iter().zip(&problem.circular_spline.gauss) {
            pattern.element(nodes).scatter(&linear_stiffness(points, &problem.material), &mut cs_values);
        }
        let fs_positions = problem.flexspline.elements.iter().map(|e| pattern.element(&e.map(Some))).collect();
        let bore_positions = problem
            .bore
            .edges
            .iter()
            .map(|[a, m, b]| [pattern.block(*m, *a), pattern.block(*b, *a), pattern.block(*b, *m)])
            .collect();
        let pairs = pairs
            .iter()
            .zip(pair_nodes)
            .map(|(&pair, (fs, cs))| {
                let nodes: Vec<u32> = fs.into_iter().chain(cs).collect();
                let blocks = (0..nodes.len())
                    .flat_map(|a| (0..a).map(move |b| (a, b)))
                    .filter_map(|(a, b)| Some((a, b, pattern.block(nodes[a], nodes[b])?)))
                    .collect();
                (pair, PairPositions { nodes, blocks })
            })
            .collect();
        let unknowns = pattern.unknowns();
        let width = if problem.lateral_stiffness > 0.0 { BORDERS } else { LATERAL };
        let mut border = Border::zeros(unknowns, width);
        border.column_mut(SLEEVE)[..problem.rotation_weights.len()].copy_from_slice(&problem.rotation_weights);
        border.column_mut(ANCHORED)[self.anchored_unknown()] = 1.0;
        if width == BORDERS {
            for (i, w) in problem.mean_weights.iter().enumerate() {
                border.column_mut(LATERAL)[i] = *w;
                if i % 2 == 0 {
                    border.column_mut(LATERAL + 1)[i + 1] = *w;
                }
            }
        }
        let values = vec![0.0; pattern.stored()];
        System { pairs, pattern, fs_positions, bore_positions, cs_values, factor, eliminated: None, values, border }
    }

    /// The tangential unknown of a bore node at angle ~0.
    fn anchored_unknown(&self) -> usize {
        2 * self.problem.bore.edges[0][1] as usize + 1
    }

    fn assemble_wheels(&mut self, state: &State, system: &mut System, residual: &mut Residual) {
        let clock = Instant::now();
        let problem = self.problem;
        system.values.copy_from_slice(&system.cs_values);
        let fs = &problem.flexspline;
        for ((element, points), positions) in fs.elements.iter().zip(&fs.gauss).zip(&system.fs_positions) {
            let mut local = [0.0; 16];
            for (a, &n) in element.iter().enumerate() {
                local[2 * a] = state.u[2 * n as usize];
                local[2 * a + 1] = state.u[2 * n as usize + 1];
            }
            let (mut stiffness, mut force) = ([0.0; PACKED], [0.0; 16]);
            add_tangent_and_force(points, &problem.material, &local, &mut stiffness, &mut force);
            positions.scatter(&stiffness, &mut system.values);
            for (a, &n) in element.iter().enumerate() {
                residual.force[2 * n as usize] -= force[2 * a];
                residual.force[2 * n as usize + 1] -= force[2 * a + 1];
            }
        }
        let cs = &problem.circular_spline;
        for (e, element) in cs.elements.iter().enumerate() {
            let (sin, cos) = cs.sector_angle(e / cs.elements_per_sector).sin_cos();
            let stiffness = &self.cs_template[e % cs.elements_per_sector];
            let mut local = [0.0; 16];
            for (a, &n) in element.iter().enumerate() {
                let (x, y) = (state.v[2 * n as usize], state.v[2 * n as usize + 1]);
                local[2 * a] = cos * x + sin * y;
                local[2 * a + 1] = cos * y - sin * x;
            }
            let force = packed_times(stiffness, &local);
            for (a, &n) in element.iter().enumerate() {
                if let Some(free) = self.cs_index[n as usize] {
                    let k = 2 * free as usize;
                    residual.force[k] -= cos * force[2 * a] - sin * force[2 * a + 1];
                    residual.force[k + 1] -= sin * force[2 * a] + cos * force[2 * a + 1];
                }
            }
        }
        self.effort.assembly += clock.elapsed();
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

    fn assemble_contact(&self, state: &State, layouts: &Layouts, system: &mut System, residual: &mut Residual) {
        let problem = self.problem;
        system.border.column_mut(OUTPUT).fill(0.0);
        let (values, pattern, bore_positions) = (&mut system.values, &system.pattern, &system.bore_positions);
        problem.bore.evaluate(self.bore_law(), &problem.outline, state.generator_rad, &state.u, |contact| {
            let nodes = problem.bore.edges[contact.edge];
            for (a, &n) in nodes.iter().enumerate() {
                for k in 0..2 {
                    let f = contact.force[2 * a + k];
                    residual.force[2 * n as usize + k] += f;
                    residual.scale = residual.scale.max(f.abs());
                }
                let row_x = a * (2 * a + 1);
                let row_y = row_x + 2 * a + 1;
                let [xx, yy] = pattern.diagonal(n).map(|p| p as usize);
                values[xx] += contact.stiffness[row_x + 2 * a];
                values[xx + 1] += contact.stiffness[row_y + 2 * a];
                values[yy] += contact.stiffness[row_y + 2 * a + 1];
                for b in 0..a {
                    let p = bore_positions[contact.edge][a * (a - 1) / 2 + b].expect("bore nodes share an element");
                    let (base, row, column) = (p.base as usize, p.row as usize, p.column as usize);
                    values[base] += contact.stiffness[row_x + 2 * b];
                    values[base + column] += contact.stiffness[row_x + 2 * b + 1];
                    values[base + row] += contact.stiffness[row_y + 2 * b];
                    values[base + row + column] += contact.stiffness[row_y + 2 * b + 1];
                }
            }
            residual.generator_moment += contact.moment;
            residual.generator_contacts += 1;
            residual.peak[1] = residual.peak[1].max(contact.peak);
        });
        let at = configuration(state);
        let mut corner = 0.0;
        for (&pair, layout) in layouts {
            let Some(contact) = self.flanks.evaluate(pair, at, self.flank_law(), &layout.points) else {
                continue;
            };
            let positions = &system.pairs[&pair];
            let n = contact.force.len();
            let column = system.border.column_mut(OUTPUT);
            for (a, &node) in positions.nodes.iter().enumerate() {
                for k in 0..2 {
                    let i = 2 * a + k;
                    residual.force[2 * node as usize + k] += contact.force[i];
                    residual.scale = residual.scale.max(contact.force[i].abs());
                    column[2 * node as usize + k] += contact.border[i];
                }
                let [xx, yy] = system.pattern.diagonal(node).map(|p| p as usize);
                system.values[xx] += contact.stiffness[2 * a * n + 2 * a];
                system.values[xx + 1] += contact.stiffness[(2 * a + 1) * n + 2 * a];
                system.values[yy] += contact.stiffness[(2 * a + 1) * n + 2 * a + 1];
            }
            for &(a, b, p) in &positions.blocks {
                for i in 0..2 {
                    for j in 0..2 {
                        let position = p.base as usize + i * p.row as usize + j * p.column as usize;
                        system.values[position] += contact.stiffness[(2 * a + i) * n + 2 * b + j];
                    }
                }
            }
            corner += contact.corner;
            residual.flank_torque += contact.torque;
            residual.torque_scale += contact.torque.abs();
            residual.flank_contacts += 1;
            residual.peak[0] = residual.peak[0].max(contact.peak);
        }
        let width = system.border.width;
        system.border.corner.fill(0.0);
        system.border.corner[OUTPUT * width + OUTPUT] = corner;
    }

    /// Load and drag on the output, sleeve on the bore, and the anchor.
    fn assemble_holding(&self, state: &State, torque_n_m: f64, system: &mut System, residual: &mut Residual) {
        let problem = self.problem;
        let width = system.border.width;
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let load = problem.per_width(torque_n_m);
        let (drag, drag_stiffness) = problem.drag_torque(state.output_rad - state.drag_anchor_rad);
        residual.drag_torque = drag;
        residual.border[OUTPUT] = load + residual.flank_torque + residual.drag_torque;
        residual.torque_scale += load.abs() + problem.drag;
        residual.free_output = residual.flank_contacts == 0 && drag_stiffness == 0.0;
        let corner = &mut system.border.corner;
        corner[OUTPUT * width + OUTPUT] += drag_stiffness;

        for (f, w) in residual.force.iter_mut().zip(&problem.rotation_weights) {
            *f -= state.sleeve_moment * w;
        }
        let rotation = dot(&problem.rotation_weights, &state.u);
        residual.border[SLEEVE] = -(rotation - problem.sleeve_compliance * state.sleeve_moment);
        corner[SLEEVE * width + SLEEVE] = -problem.sleeve_compliance;

        let anchored = self.anchored_unknown();
        system.values[system.pattern.column_starts[anchored] as usize] += ANCHOR;
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
        let system = self.system.as_mut()?;
        if !chord || system.eliminated.is_none() {
            let clock = Instant::now();
            system.eliminated = None;
            let mut definite = system.factor.factorise(&system.pattern, &system.values).is_ok();
            // Far from equilibrium the rim may resist no sliding along the generator; a grounded spring at every node then
            // shortens the step and leaves its direction downhill.
            for spring in GROUNDED_SPRINGS {
                if definite {
                    break;
                }
                for &start in &system.pattern.column_starts[..system.pattern.unknowns()] {
                    system.values[start as usize] += spring;
                }
                definite = system.factor.factorise(&system.pattern, &system.values).is_ok();
            }
            self.effort.factorisation += clock.elapsed();
            if !definite {
                return None;
            }
            let clock = Instant::now();
            system.eliminated = Some(BorderedSystem::new(&mut system.factor, &system.border));
            self.effort.solution += clock.elapsed();
        }
        let clock = Instant::now();
        let mut free = residual.force.clone();
        let mut border = residual.border;
        let width = system.border.width;
        let eliminated = system.eliminated.as_ref()?;
        let solved = eliminated.solve(&mut system.factor, &mut free, &mut border[..width]);
        self.effort.solution += clock.elapsed();
        if !solved {
            return None;
        }
        let fs = 2 * self.problem.flexspline.nodes.len();
        let mut v = vec![0.0; 2 * self.cs_index.len()];
        for (n, index) in self.cs_index.iter().enumerate() {
            if let Some(free_node) = index {
                v[2 * n] = free[2 * *free_node as usize];
                v[2 * n + 1] = free[2 * *free_node as usize + 1];
            }
        }
        let u = free[..fs].to_vec();
        Some(Step { free, u, v, border })
    }

    /// Turn of the output for a unit torque on it (rad mm / N mm), by the last tangent.
    fn compliance(&mut self, residual: &Residual) -> Option<f64> {
        if self.system.as_ref()?.eliminated.is_none() {
            self.solve(residual, false)?;
        }
        let system = self.system.as_mut()?;
        let mut free = vec![0.0; residual.force.len()];
        let mut border = [0.0; BORDERS];
        border[OUTPUT] = 1.0;
        let width = system.border.width;
        let solved = system.eliminated.as_ref()?.solve(&mut system.factor, &mut free, &mut border[..width]);
        solved.then_some(border[OUTPUT])
    }

    /// Whether the corners of the spaces still face the places they were laid out for.
    fn layouts_fit(&self, state: &State, layouts: &Layouts) -> bool {
        let at = configuration(state);
        layouts.iter().filter(|(pair, _)| self.flanks.smallest_gap(**pair, at) < TOUCH).all(|(pair, layout)| {
            match (layout.corner, self.flanks.corner(*pair, at)) {
                (Some(a), Some(b)) => (a - b).abs() < CORNER_DRIFT,
                (None, None) => true,
                (Some(r), None) | (None, Some(r)) => {
                    (r - self.flanks.tooth.start_radius).abs().min((r - self.flanks.tooth.junction_radius).abs())
                        < CORNER_DRIFT
                }
            }
        })
    }

    /// Carries the history over the end of an increment.
    fn finish(&self, state: &mut State, from: &State, layouts: &Layouts) {
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
            let at = configuration(state);
            state.friction = layouts
                .iter()
                .map(|(&pair, layout)| {
                    let history = self.flanks.friction_history(pair, at, problem.flank_law, &layout.points);
                    ((pair.tooth, pair.side), history)
                })
                .filter(|(_, history)| history.iter().any(|(_, t)| *t != 0.0))
                .collect();
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

fn configuration(state: &State) -> Configuration<'_> {
    Configuration { u: &state.u, v: &state.v, output_rad: state.output_rad }
}

/// Product of a packed symmetric 16 x 16 matrix with a vector.
fn packed_times(packed: &[f64; PACKED], x: &[f64; 16]) -> [f64; 16] {
    let mut y = [0.0; 16];
    let mut k = 0;
    for i in 0..16 {
        for j in 0..i {
            y[i] += packed[k] * x[j];
            y[j] += packed[k] * x[i];
            k += 1;
        }
        y[i] += packed[k] * x[i];
        k += 1;
    }
    y
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
