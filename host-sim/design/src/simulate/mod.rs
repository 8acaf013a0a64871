//! A quasi-static run: the drive deformed by its generator, loaded, and turned along a path.
//!
//! 1. Deform: the generator stands where the path begins, no load, the output in the middle of its clearance.
//! 2. If the path is loaded throughout: a light touch either way, which finds the middle of the clearance.
//! 3. Bring on the load.
//! 4. `pitch` and `turn`: move on until the drive has settled. No rows.
//! 5. Follow the path, one row to each point.
//!
//! The result is quasi-static and two-dimensional: no inertia, no viscosity, no speed.

mod path;
pub(crate) mod places;
mod row;
pub mod stress;
mod summary;
pub mod zones;

use std::f64::consts::TAU;
use std::ops::ControlFlow;

use flexspline::Direction;
use thiserror::Error;

use crate::cautions::{Caution, LookedAt, rigid_gap_um, room_as_built_arcsec};
use flexspline_base::spent::Stopwatch;
use flexspline_mechanics::drive::{Drive, GeneratorKind, ThermalState};
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Face, Increment, Problem, SolveError, Solver, SolverSettings, State};

pub use path::{Path, PathError, PathPoint, read_path};
pub(crate) use places::judged_fillet_mpa;
pub use places::{
    Fatigue, MESHES, Place, PlaceStress, SurfaceEdge, edge_stress, fillet_edges, on_mesh, stress_by_place,
};
pub use row::Row;
pub use stress::{PeakStress, peak_stress};
pub(crate) use summary::SUMMARY_SCHEMA;
pub use summary::Summary;
pub use zones::{TipContact, Zone, zones};

use path::LARGEST_TORQUE_N_M;
use summary::{Metrics, Touches, largest, shared, wheel_name};

/// Increment of the paper's path, rad.
const PAPER_INCREMENT_RAD: f64 = 0.01;
/// Increments to a flexspline tooth pitch while the drive settles, and on `turn`.
const INCREMENTS_PER_PITCH: f64 = 8.0;
/// Rows of `pitch`. HHD-95 under 50 N·m, standard mesh, against 48 rows: the wave through 8, 12 and 24 of them is 0.96,
/// 0.98 and 1.01 of the ripple of two rollers, 0.82, 0.90 and 0.98 of four; of discs and cam (coarse mesh) 24 give 0.99
/// and 0.98.
const ROWS_OF_A_PITCH: f64 = 24.0;
/// A light touch presses the flanks with as much as the drag takes of it, but at least and at most with these shares of
/// what presses them under the load. The least keeps the touch of a drive without drag small beside any load; the most
/// keeps it below a load that hardly exceeds the drag.
const TOUCH_SHARES: [f64; 2] = [2e-5, 0.25];
/// Halvings of a change of temperature before giving up.
const TEMPERATURE_HALVINGS: usize = 5;
/// Parts of what is tried again where the solver found no equilibrium on its own steps. A guess: steps that are eight
/// times finer than the solver's own first ones, and a torsion curve of this many points where they do not help either.
const SECOND_TRY_PARTS: u32 = 8;
/// Newton iterations of one increment, all its parts and ways together, before it counts as one that finds no
/// equilibrium. *Guess*: 600 N·m, 9 times the rated torque of a CSF-25-100, come on in 248; what takes more is tried
/// again in parts, each with as many.
const MOST_WORK: usize = 500;

/// Settings of a simulation.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulationSettings {
    /// Which wave generator.
    pub generator: GeneratorKind,
    /// Where it goes.
    pub path: Path,
    /// Largest increment, rad; by default 0.01 on `paper`, a twenty-fourth of a tooth pitch on `pitch` and an eighth of
    /// one on `turn`. Paths given by points have their own.
    pub increment_rad: Option<f64>,
    /// Which way `pitch` and `turn` go.
    pub direction: Direction,
    /// Load torque, N m, where the path does not say; positive turns the output forward.
    pub torque_n_m: f64,
    /// Temperature, °C, where the path does not say; by default the drive's reference temperature.
    pub temperature_c: Option<f64>,
    /// The numerical method.
    pub solver: SolverSettings,
}

impl SimulationSettings {
    /// A path at no load and reference temperature.
    pub fn new(generator: GeneratorKind, path: Path) -> Self {
        SimulationSettings {
            generator,
            path,
            increment_rad: None,
            direction: Direction::Forward,
            torque_n_m: 0.0,
            temperature_c: None,
            solver: SolverSettings::default(),
        }
    }

    /// Refuses settings that cannot be run with this drive.
    pub fn check(&self, drive: &Drive) -> Result<(), SimulateError> {
        let refuse = |setting: &'static str, found: String, allowed: String| {
            Err(SimulateError::Setting { setting, found, allowed })
        };
        if let Some(increment) = self.increment_rad {
            if matches!(self.path, Path::Points(_)) {
                return refuse("increment", increment.to_string(), "none, as the path gives its own points".into());
            }
            if !(1e-5..=0.5).contains(&increment) {
                return refuse("increment", increment.to_string(), "0.00001 to 0.5 rad".into());
            }
        }
        let (coldest, warmest) = (drive.temperature.minimum_c, drive.temperature.maximum_c);
        let points = match &self.path {
            Path::Points(points) if points.is_empty() => {
                return refuse("path", "no points".into(), "at least one".into());
            }
            Path::Points(points) => points.as_slice(),
            _ => &[],
        };
        let torques = points.iter().filter_map(|p| p.torque_n_m).chain([self.torque_n_m]);
        for torque in torques {
            if torque.is_nan() || torque.abs() > LARGEST_TORQUE_N_M {
                let allowed = format!("-{LARGEST_TORQUE_N_M} to {LARGEST_TORQUE_N_M} N·m");
                return refuse("torque", torque.to_string(), allowed);
            }
        }
        if let Some(angle) = points.iter().map(|p| p.generator_rad).find(|angle| !angle.is_finite()) {
            return refuse("generator angle", angle.to_string(), "a finite number".into());
        }
        let temperatures = points.iter().filter_map(|p| p.temperature_c).chain(self.temperature_c);
        for temperature in temperatures {
            if !(coldest..=warmest).contains(&temperature) {
                let allowed = format!("{coldest} to {warmest} C, the operating range of the drive");
                return refuse("temperature", temperature.to_string(), allowed);
            }
        }
        let solver = &self.solver;
        for (setting, penalty) in
            [("flank penalty", solver.flank_penalty), ("bore penalty", solver.bore_penalty(self.generator))]
        {
            if !(1e3..=1e10).contains(&penalty) {
                return refuse(setting, penalty.to_string(), "1e3 to 1e10 N/mm^3".into());
            }
        }
        if !(1e-12..=1e-2).contains(&solver.tolerance) {
            return refuse("tolerance", solver.tolerance.to_string(), "1e-12 to 1e-2".into());
        }
        if solver.max_iterations == 0 {
            return refuse("iterations", "0".into(), "1 or more".into());
        }
        Ok(())
    }
}

/// A run that gave no result.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SimulateError {
    /// A setting is out of its range.
    #[error("{setting}: found {found}, allowed: {allowed}")]
    Setting {
        /// Which.
        setting: &'static str,
        /// Its value.
        found: String,
        /// Allowed values.
        allowed: String,
    },
    /// The drive is impossible, or is not even deformed.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// No equilibrium, or the drive did not settle; what there was until then.
    #[error(transparent)]
    Unfinished(Box<Unfinished>),
    /// The observer asked to stop.
    #[error("stopped by the observer")]
    Stopped,
}

/// A run that ended on its way.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{error}{}", self.until_then())]
pub struct Unfinished {
    /// Why, after all that is tried.
    pub error: SolveError,
    /// The rows of the path so far. Where the load did not come on: the drive under the loads that did, its generator
    /// at rest.
    pub rows: Vec<Row>,
    /// Error of the last row against the middle of the backlash, arc-seconds; missing where that was not looked for.
    pub wind_up_arcsec: Option<f64>,
}

impl Unfinished {
    fn until_then(&self) -> String {
        let Some(last) = self.rows.last() else { return String::new() };
        let wind_up =
            self.wind_up_arcsec.map_or_else(String::new, |arcsec| format!(", wound up by {arcsec:.2} arcsec"));
        let tried = match self.error {
            SolveError::NotConverged { .. } => "; finer steps were tried and end there too",
            _ => "",
        };
        format!(
            "; the last equilibrium is at {:.4} N·m and {:.6} rad{wind_up}{tried}",
            last.torque_n_m, last.generator_rad
        )
    }
}

impl SimulateError {
    /// Whether the input is to blame, not the run.
    pub fn is_bad_input(&self) -> bool {
        matches!(self, SimulateError::Setting { .. } | SimulateError::Solve(SolveError::Drive(_) | SolveError::Mesh(_)))
    }
}

/// Phase of the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// The generator deforms the flexspline.
    Deforming,
    /// A light touch finds the middle of the clearance.
    Touching,
    /// The load comes on.
    Loading,
    /// Moving until start-up is over.
    Settling,
    /// Another temperature at the same angle.
    ChangingTemperature,
    /// On the path.
    Following,
}

/// Values passed to the observer after every increment.
pub struct Observation<'a> {
    /// Phase of the run.
    pub phase: Phase,
    /// Increments solved.
    pub done: usize,
    /// Increments expected in all; may grow while the drive settles.
    pub total: usize,
    /// Newton iterations of this increment.
    pub iterations: usize,
    /// The row of the results that this increment made, if it made one.
    pub row: Option<&'a Row>,
    /// The mechanical problem.
    pub problem: &'a Problem,
    /// The drive now.
    pub state: &'a State,
}

/// Result of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    /// `results.csv`.
    pub rows: Vec<Row>,
    /// `summary.json`.
    pub summary: Summary,
}

/// Runs `drive` along a path. `observer` is called after every increment and may stop the run by breaking.
pub fn simulate(
    drive: &Drive,
    settings: &SimulationSettings,
    observer: &mut dyn FnMut(&Observation) -> ControlFlow<()>,
) -> Result<Simulation, SimulateError> {
    settings.check(drive)?;
    RunState::new(drive, settings, observer).run()
}

/// A point of the path with nothing left open.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PathTarget {
    generator_rad: f64,
    torque_n_m: f64,
    temperature_c: f64,
}

struct RunState<'a> {
    drive: &'a Drive,
    settings: &'a SimulationSettings,
    observer: &'a mut dyn FnMut(&Observation) -> ControlFlow<()>,
    begun: Stopwatch,
    pitch: f64,
    temperature_c: f64,
    rows: Vec<Row>,
    peak: Option<(PeakStress, usize)>,
    by_place_mpa: [f64; 3],
    /// The zones of the row that has the largest pressure between flanks, and that pressure.
    zones: (f64, Vec<Zone>),
    touches: Option<Touches>,
    degrees_of_freedom: usize,
    increments: usize,
    iterations: usize,
    total: usize,
    /// Iterations of changes of temperature, which the next row counts.
    pending_iterations: usize,
}

impl<'a> RunState<'a> {
    fn new(
        drive: &'a Drive,
        settings: &'a SimulationSettings,
        observer: &'a mut dyn FnMut(&Observation) -> ControlFlow<()>,
    ) -> Self {
        RunState {
            drive,
            settings,
            observer,
            begun: Stopwatch::start(),
            pitch: TAU / f64::from(drive.flexspline.teeth),
            temperature_c: settings.temperature_c.unwrap_or(drive.temperature.reference_c),
            rows: Vec::new(),
            peak: None,
            by_place_mpa: [0.0; 3],
            zones: (f64::NEG_INFINITY, Vec::new()),
            touches: None,
            degrees_of_freedom: 0,
            increments: 0,
            iterations: 0,
            total: 0,
            pending_iterations: 0,
        }
    }

    fn run(mut self) -> Result<Simulation, SimulateError> {
        match self.along_path() {
            Ok(()) => Ok(self.finish()),
            Err(SimulateError::Solve(error)) if !error.is_bad_input() && !self.rows.is_empty() => {
                let zero = self.touches.map(|touches| 0.5 * (touches.forward + touches.backward));
                let last = self.rows.last().map(|row| row.error_arcsec);
                let wind_up_arcsec = last.zip(zero).map(|(last, zero)| last - zero);
                Err(SimulateError::Unfinished(Box::new(Unfinished { error, rows: self.rows, wind_up_arcsec })))
            }
            Err(error) => Err(error),
        }
    }

    fn along_path(&mut self) -> Result<(), SimulateError> {
        let targets: Vec<PathTarget> = match &self.settings.path {
            Path::Pitch => return self.settle_and_turn(self.pitch),
            Path::Turn => return self.settle_and_turn(TAU),
            Path::Paper => {
                let increment = self.settings.increment_rad.unwrap_or(PAPER_INCREMENT_RAD);
                let angles = [vec![0.0], line(0.0, 1.0, increment), line(1.0, -1.0, increment)].concat();
                angles.into_iter().map(|angle| self.target(angle)).collect()
            }
            Path::Points(points) => points
                .iter()
                .map(|point| PathTarget {
                    generator_rad: point.generator_rad,
                    torque_n_m: point.torque_n_m.unwrap_or(self.settings.torque_n_m),
                    temperature_c: point.temperature_c.unwrap_or(self.temperature_c),
                })
                .collect(),
        };
        self.follow(&targets)
    }

    fn target(&self, generator_rad: f64) -> PathTarget {
        PathTarget { generator_rad, torque_n_m: self.settings.torque_n_m, temperature_c: self.temperature_c }
    }

    /// Paths that begin where the drive is deformed; the first point makes a row too.
    fn follow(&mut self, targets: &[PathTarget]) -> Result<(), SimulateError> {
        let one_load = targets.iter().all(|target| target.torque_n_m == targets[0].torque_n_m);
        self.total = targets.len() + self.increments_to_start(targets[0].torque_n_m, one_load) - 1;
        let mut carried: Option<State> = None;
        for group in targets.chunk_by(|a, b| a.temperature_c == b.temperature_c) {
            let temperature_c = group[0].temperature_c;
            let (problem, warmed) = match carried.take() {
                None => (self.problem(temperature_c)?, None),
                Some(state) => {
                    let from_c = self.temperature_c;
                    let (problem, state, increment) =
                        self.change_temperature(state, from_c, temperature_c, TEMPERATURE_HALVINGS)?;
                    (problem, Some((state, increment)))
                }
            };
            self.temperature_c = temperature_c;
            let (mut motion, rest) = match warmed {
                Some((state, increment)) => (Motion::taken_over(&problem, state, increment), group),
                None => {
                    let (motion, increment) = self.start(&problem, group[0], one_load)?;
                    self.record(&motion, &increment, 0.0)?;
                    (motion, &group[1..])
                }
            };
            for target in rest {
                self.advance(&mut motion, *target)?;
            }
            carried = Some(motion.state().clone());
        }
        Ok(())
    }

    /// Paths of a settled drive: `travel_rad` in one direction, after start-up.
    fn settle_and_turn(&mut self, travel_rad: f64) -> Result<(), SimulateError> {
        let sign = f64::from(self.settings.direction.sign());
        let eighth = self.pitch / INCREMENTS_PER_PITCH;
        let increment = match (&self.settings.path, self.settings.increment_rad) {
            (Path::Pitch, given) => given.map_or(self.pitch / ROWS_OF_A_PITCH, |given| given.min(eighth)),
            (_, given) => given.unwrap_or(eighth),
        };
        let path = |from: f64| line(from, from + sign * travel_rad, increment);
        let start = self.target(0.0);
        self.total = self.increments_to_start(start.torque_n_m, true) + INCREMENTS_PER_PITCH as usize + path(0.0).len();
        let problem = self.problem(start.temperature_c)?;
        let (mut motion, _) = self.start(&problem, start, true)?;
        while motion.settle_on(sign * eighth)? {
            self.solved(Phase::Settling, &motion)?;
        }
        let angles = path(motion.state().generator_rad);
        self.total = self.increments + angles.len();
        for angle in angles {
            self.advance(&mut motion, self.target(angle))?;
        }
        Ok(())
    }

    fn problem(&mut self, temperature_c: f64) -> Result<Problem, SimulateError> {
        let settings = SolverSettings { max_work: MOST_WORK, ..self.settings.solver };
        let problem = Problem::new(self.drive, self.settings.generator, temperature_c, settings)?;
        self.degrees_of_freedom = problem.degrees_of_freedom();
        Ok(problem)
    }

    /// Whether the clearance takes part in nothing but the start: the load holds the flanks of one side together.
    fn exceeds_drag(&self, torque_n_m: f64) -> bool {
        torque_n_m.abs() > self.drive.output.drag_torque_n_m
    }

    fn increments_to_start(&self, torque_n_m: f64, one_load: bool) -> usize {
        1 + 2 * usize::from(one_load && self.exceeds_drag(torque_n_m)) + usize::from(torque_n_m != 0.0)
    }

    /// Deforms the drive, touches, loads. Gives the last increment with the iterations of deforming and loading.
    fn start<'p>(
        &mut self,
        problem: &'p Problem,
        at: PathTarget,
        one_load: bool,
    ) -> Result<(Motion<'p>, Increment), SimulateError> {
        let mut motion = Motion::deformed_or_turned_in(problem, at.generator_rad)?;
        let mut increment = motion.last().clone();
        self.solved(Phase::Deforming, &motion)?;
        if one_load && self.exceeds_drag(at.torque_n_m) {
            let deformed = motion.state().clone();
            let torque = light_touch_n_m(self.drive.output.drag_torque_n_m, at.torque_n_m);
            let mut touch = |torque_n_m: f64| -> Result<f64, SimulateError> {
                motion.load(torque_n_m)?;
                self.solved(Phase::Touching, &motion)?;
                let touched = motion.error_arcsec();
                motion.go_back(deformed.clone());
                Ok(touched)
            };
            let (forward, backward) = (touch(torque)?, touch(-torque)?);
            self.touches = Some(Touches { forward, backward });
        }
        if at.torque_n_m != 0.0 {
            if let Err(error) = motion.load(at.torque_n_m) {
                self.load_in_parts(&mut motion, at.torque_n_m, error)?;
            }
            self.solved(Phase::Loading, &motion)?;
            let deforming = increment.iterations;
            increment = motion.last().clone();
            increment.iterations += deforming;
        }
        Ok((motion, increment))
    }

    /// One increment along the path, with its row.
    fn advance(&mut self, motion: &mut Motion<'_>, to: PathTarget) -> Result<(), SimulateError> {
        let from_rad = motion.state().generator_rad;
        if let Err(error) = motion.to(to.generator_rad, to.torque_n_m) {
            if !matches!(error, SolveError::NotConverged { .. }) {
                return Err(error.into());
            }
            in_parts(motion, to.generator_rad, to.torque_n_m)?;
        }
        self.increments += 1;
        self.iterations += motion.last().iterations;
        self.record(motion, motion.last(), to.generator_rad - from_rad)
    }

    /// A load that did not come on at once: up to the last one that had an equilibrium in parts, each a row, and on
    /// from there in finer ones by a solver that remembers nothing. Where that helps the rows go, since they are none
    /// of the path.
    fn load_in_parts(
        &mut self,
        motion: &mut Motion<'_>,
        torque_n_m: f64,
        error: SolveError,
    ) -> Result<(), SimulateError> {
        let SolveError::NotConverged { reached_n_m, .. } = error else { return Err(error.into()) };
        self.load_row(motion)?;
        if reached_n_m != 0.0 {
            self.load_on(motion, reached_n_m)?;
        }
        motion.forget();
        self.load_on(motion, torque_n_m)?;
        self.rows.clear();
        Ok(())
    }

    /// The load brought on in parts, each a row; of the part that failed as much as went.
    fn load_on(&mut self, motion: &mut Motion<'_>, torque_n_m: f64) -> Result<(), SimulateError> {
        let from_n_m = motion.state().torque_n_m;
        for part in 1..=SECOND_TRY_PARTS {
            let loaded = motion.load(part_of_way(from_n_m, torque_n_m, part));
            if let Err(SolveError::NotConverged { reached_n_m, .. }) = loaded
                && reached_n_m != motion.state().torque_n_m
                && motion.load(reached_n_m).is_ok()
            {
                self.load_row(motion)?;
            }
            loaded?;
            self.load_row(motion)?;
        }
        Ok(())
    }

    fn load_row(&mut self, motion: &Motion<'_>) -> Result<(), SimulateError> {
        self.solved(Phase::Loading, motion)?;
        let (row, _) = self.row(motion, motion.last(), 0.0);
        self.rows.push(row);
        Ok(())
    }

    /// Adds a row and shows it.
    fn record(&mut self, motion: &Motion<'_>, increment: &Increment, turn_rad: f64) -> Result<(), SimulateError> {
        let (row, peak) = self.row(motion, increment, turn_rad);
        for (largest, here) in self.by_place_mpa.iter_mut().zip(peak.by_place_mpa) {
            *largest = largest.max(here);
        }
        if self.peak.is_none_or(|(highest, _)| peak.von_mises_mpa > highest.von_mises_mpa) {
            self.peak = Some((peak, row.step));
        }
        self.show(Phase::Following, increment.iterations, motion.problem(), motion.state(), Some(&row))?;
        self.rows.push(row);
        Ok(())
    }

    /// The drive as it stands, as the next row.
    fn row(&mut self, motion: &Motion<'_>, increment: &Increment, turn_rad: f64) -> (Row, PeakStress) {
        let state = motion.state();
        let peak = peak_stress(motion.problem(), state);
        let zones = zones(motion.problem(), state);
        let tips = TipContact::of(&zones, &self.drive.flexspline).filter(|_| self.exceeds_drag(state.torque_n_m));
        let pressure_mpa = increment.peak_pressure_mpa[0];
        if pressure_mpa > self.zones.0 {
            self.zones = (pressure_mpa, zones);
        }
        // Rows of a path that begins with the deformed drive count from 0, others from 1.
        let step = self.rows.last().map_or(usize::from(turn_rad != 0.0), |row| row.step + 1);
        let row = Row {
            step,
            generator_rad: state.generator_rad,
            output_rad: motion.problem().output_rad(state),
            error_arcsec: motion.error_arcsec(),
            torque_n_m: state.torque_n_m,
            flank_contacts: increment.flank_contacts,
            generator_contacts: increment.generator_contacts,
            max_von_mises_mpa: peak.von_mises_mpa,
            iterations: increment.iterations + std::mem::take(&mut self.pending_iterations),
            temperature_c: self.temperature_c,
            generator_torque_n_m: increment.generator_torque_n_m,
            drag_torque_n_m: increment.drag_torque_n_m,
            torque_balance_n_m: state.torque_n_m + increment.drag_torque_n_m + increment.flank_torque_n_m,
            peak_flank_pressure_mpa: increment.peak_pressure_mpa[0],
            peak_generator_pressure_mpa: increment.peak_pressure_mpa[1],
            residual: increment.residual,
            settled: motion.settled(),
            face: increment.face,
            lobe_force_n: increment.lobe_force_n,
            tips,
            turn_rad,
        };
        (row, peak)
    }

    /// Counts an increment that makes no row, and shows it.
    fn solved(&mut self, phase: Phase, motion: &Motion<'_>) -> Result<(), SimulateError> {
        self.counted(phase, motion.last(), motion.problem(), motion.state())
    }

    fn counted(
        &mut self,
        phase: Phase,
        increment: &Increment,
        problem: &Problem,
        state: &State,
    ) -> Result<(), SimulateError> {
        self.increments += 1;
        self.iterations += increment.iterations;
        self.show(phase, increment.iterations, problem, state, None)
    }

    fn show(
        &mut self,
        phase: Phase,
        iterations: usize,
        problem: &Problem,
        state: &State,
        row: Option<&Row>,
    ) -> Result<(), SimulateError> {
        let (done, total) = (self.increments, self.total.max(self.increments));
        let seen = Observation { phase, done, total, iterations, row, problem, state };
        match (self.observer)(&seen) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(SimulateError::Stopped),
        }
    }

    /// The drive brought from one temperature to another where it stands; in parts where one part is too much.
    fn change_temperature(
        &mut self,
        state: State,
        from_c: f64,
        to_c: f64,
        halvings: usize,
    ) -> Result<(Problem, State, Increment), SimulateError> {
        let problem = self.problem(to_c)?;
        let guess = resized(&state, &self.drive.at_temperature(from_c).thermal_state, &problem);
        let solved = Solver::new(&problem).increment(&guess, guess.generator_rad, guess.torque_n_m);
        match solved {
            Ok((state, increment)) => {
                self.pending_iterations += increment.iterations;
                self.total += 1;
                self.counted(Phase::ChangingTemperature, &increment, &problem, &state)?;
                Ok((problem, state, increment))
            }
            Err(SolveError::NotConverged { history, .. }) if halvings > 0 => {
                self.pending_iterations += history.len();
                self.iterations += history.len();
                let middle_c = 0.5 * (from_c + to_c);
                let (_, state, _) = self.change_temperature(state, from_c, middle_c, halvings - 1)?;
                self.change_temperature(state, middle_c, to_c, halvings - 1)
            }
            Err(error) => Err(error.into()),
        }
    }

    fn finish(self) -> Simulation {
        let (settings, rows) = (self.settings, &self.rows);
        let repeats = self.drive.as_built.first_not_uniform().is_none();
        let metrics = Metrics::new(rows, self.pitch, self.drive.ratio(), repeats);
        let torque_n_m = shared(rows, |row| row.torque_n_m);
        let loaded = torque_n_m.is_some_and(|torque| self.exceeds_drag(torque));
        let never_loaded = rows.iter().all(|row| !self.exceeds_drag(row.torque_n_m));
        let middle = self.touches.map(|touches| 0.5 * (touches.forward + touches.backward));
        let against = |zero: Option<f64>| Some(metrics.mean_error()? - zero?);
        let touched = self
            .touches
            .map(|touches| if torque_n_m.unwrap_or(0.0) > 0.0 { touches.forward } else { touches.backward });
        let (peak, peak_step) = self.peak.expect("every path has a row");
        let more = |a: Face, b: Face| if b.peak_over_mean > a.peak_over_mean { b } else { a };
        let uneven = rows.iter().map(|row| row.face).reduce(more).unwrap_or_default();
        let peak_flank_pressure_mpa = largest(rows, |row| row.peak_flank_pressure_mpa);
        let tip_contact = TipContact::worst(rows.iter().filter_map(|row| row.tips));
        let looked = LookedAt {
            rigid_gap_um: rigid_gap_um(self.drive, settings.generator),
            room_as_built_arcsec: room_as_built_arcsec(self.drive, settings.generator),
            max_von_mises_mpa: Some(peak.von_mises_mpa),
            root_fillet_mpa: rows.iter().find(|row| row.step == peak_step).map(|row| {
                let (kind, at) = (settings.generator, (row.generator_rad, row.torque_n_m));
                judged_fillet_mpa(self.drive, kind, row.temperature_c, at, settings.solver, self.by_place_mpa[0])
            }),
            peak_flank_pressure_mpa: Some(peak_flank_pressure_mpa),
            tip_contact,
            slope_bound: None,
        };
        let wind_up_arcsec = against(middle).filter(|_| loaded);
        let friction = self.drive.flanks.friction_coefficient;
        let against_load = wind_up_arcsec.zip(torque_n_m).filter(|(wind_up, torque)| wind_up * torque < 0.0);
        let cautions = against_load.filter(|_| friction > 0.0).map(|(value, torque_n_m)| Caution {
            figure: "wind_up_arcsec",
            value,
            limit: 0.0,
            words: format!(
                "under {torque_n_m} N·m the output stands {:.0} arcsec against its load: friction between the flanks \
                 ({friction}) rules the sign, not the stiffness{}",
                value.abs(),
                metrics.friction_over_load().map_or_else(String::new, |times| format!(
                    ", as sliding takes {times:.1} times the work of the load"
                ))
            ),
        });
        let stiff = Caution::of_stiffness(self.drive);
        let cautions = stiff.into_iter().chain(looked.cautions()).chain(cautions).collect();
        let spent = self.begun.spent();
        let summary = Summary {
            schema_version: SUMMARY_SCHEMA,
            tool_version: env!("CARGO_PKG_VERSION"),
            command: String::new(),
            status: "converged",
            drive: self.drive.name.clone(),
            drive_hash: blake3::Hash::from_bytes(self.drive.hash()).to_hex().to_string(),
            generator: settings.generator.to_string(),
            path: settings.path.to_string(),
            mesh: settings.solver.mesh.to_string(),
            solver: settings.solver.method.to_string(),
            flank_penalty_n_per_mm3: settings.solver.flank_penalty,
            bore_penalty_n_per_mm3: settings.solver.bore_penalty(settings.generator),
            degrees_of_freedom: self.degrees_of_freedom,
            torque_n_m,
            temperature_c: shared(rows, |row| row.temperature_c),
            rows: rows.len(),
            kinematic_error_pp_arcsec: metrics.kinematic_error_pp,
            kinematic_error_pp_of_rows_arcsec: metrics.kinematic_error_pp_of_rows,
            mean_error_forward_arcsec: metrics.mean_forward,
            mean_error_backward_arcsec: metrics.mean_backward,
            backlash_arcsec: metrics.reversal.filter(|_| never_loaded),
            reversal_lost_motion_arcsec: metrics.reversal.filter(|_| loaded),
            dwell_generator_rad: metrics.dwell_rad,
            wind_up_arcsec,
            wind_up_elastic_arcsec: against(touched).filter(|_| loaded),
            wind_up_parts: Vec::new(),
            backlash_middle_arcsec: middle,
            max_von_mises_mpa: peak.von_mises_mpa,
            max_von_mises_wheel: wheel_name(&peak),
            max_von_mises_position_mm: peak.position_mm,
            max_von_mises_step: peak_step,
            root_fillet_mpa: self.by_place_mpa[0],
            nodal_bore_mpa: self.by_place_mpa[1],
            nodal_flank_mpa: self.by_place_mpa[2],
            stress: Vec::new(),
            peak_flank_pressure_mpa,
            zones: self.zones.1,
            tip_contact,
            peak_generator_pressure_mpa: largest(rows, |row| row.peak_generator_pressure_mpa),
            lobe_force_n: largest(rows, |row| row.lobe_force_n),
            tilt_mrad: 1e3 * largest(rows, |row| row.face.tilt_rad),
            skew_mrad: 1e3 * largest(rows, |row| row.face.skew_rad),
            load_across_face_peak_over_mean: uneven.peak_over_mean,
            face_in_contact: uneven.share,
            generator_torque_mean_n_m: metrics.generator_torque,
            generator_torque_virtual_work_n_m: metrics.generator_torque_expected,
            without_friction: self.drive.flanks.friction_coefficient == 0.0,
            torque_balance_worst_n_m: largest(rows, |row| row.torque_balance_n_m.abs()),
            residual_worst: largest(rows, |row| row.residual),
            room_as_built_arcsec: looked.room_as_built_arcsec,
            cautions,
            data_sheet: None,
            increments: self.increments,
            iterations: self.iterations,
            wall_s: spent.wall_s,
            processor_s: spent.processor_s,
        };
        Simulation { rows: self.rows, summary }
    }
}

/// Torque of a light touch before a load that exceeds the drag: more than the drag, less than the load, N m. It is made
/// of these two alone, so that drives that are one another's image at another scale are touched alike.
fn light_touch_n_m(drag_n_m: f64, load_n_m: f64) -> f64 {
    let pressing = load_n_m.abs() - drag_n_m;
    let [least, most] = TOUCH_SHARES.map(|share| share * pressing);
    drag_n_m + drag_n_m.clamp(least, most)
}

/// To a place and a load once more, in parts, by a solver that remembers nothing of the way here.
fn in_parts(motion: &mut Motion<'_>, generator_rad: f64, torque_n_m: f64) -> Result<(), SolveError> {
    motion.forget();
    let (from_rad, from_n_m) = (motion.state().generator_rad, motion.state().torque_n_m);
    for part in 1..=SECOND_TRY_PARTS {
        motion.to(part_of_way(from_rad, generator_rad, part), part_of_way(from_n_m, torque_n_m, part))?;
    }
    Ok(())
}

/// Cut by a number of parts for a second try; the end exactly.
fn part_of_way(from: f64, to: f64, part: u32) -> f64 {
    if part == SECOND_TRY_PARTS { to } else { from + (to - from) * f64::from(part) / f64::from(SECOND_TRY_PARTS) }
}

/// Equally spaced angles from `from` (left out) to `to` (exactly), `increment` apart or less.
fn line(from: f64, to: f64, increment: f64) -> Vec<f64> {
    let count = ((to - from).abs() / increment - 1e-6).ceil().max(1.0);
    (1..=count as usize).map(|i| from + (to - from) * (i as f64 / count)).collect()
}

/// A first guess of the state at another temperature: displacements grow with the sizes of the wheels, the seat holds
/// the circular spline where the new temperature has it.
fn resized(state: &State, old: &ThermalState, problem: &Problem) -> State {
    let new = &problem.drive.thermal_state;
    let mut guess = state.clone();
    let fs = new.flexspline_scale / old.flexspline_scale;
    guess.u.iter_mut().for_each(|x| *x *= fs);
    let cs = new.circular_spline_scale / old.circular_spline_scale;
    guess.v.iter_mut().for_each(|x| *x *= cs);
    problem.seat_state(&mut guess.v);
    guess
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_mechanics::mesh::MeshLevel;

    fn coarse(path: Path) -> SimulationSettings {
        let solver = SolverSettings { mesh: MeshLevel::Coarse, ..Default::default() };
        SimulationSettings { solver, ..SimulationSettings::new(GeneratorKind::Cam, path) }
    }

    fn run(settings: &SimulationSettings) -> Simulation {
        simulate(&Drive::hhd_95(), settings, &mut |_| ControlFlow::Continue(())).unwrap()
    }

    fn points(angles: &[f64]) -> Path {
        let point = |&generator_rad| PathPoint { generator_rad, ..Default::default() };
        Path::Points(angles.iter().map(point).collect())
    }

    #[test]
    fn lines_end_where_they_are_to_end_and_never_step_too_far() {
        assert_eq!(line(0.0, 1.0, 0.01).len(), 100);
        assert_eq!(line(1.0, -1.0, 0.01).len(), 200);
        let back = line(1.0, -1.0, 0.3);
        assert_eq!((back.len(), back[6]), (7, -1.0));
        assert!((back[0] - (1.0 - 2.0 / 7.0)).abs() < 1e-15);
        assert_eq!(line(0.0, 0.001, 0.5), [0.001]);
    }

    #[test]
    #[ignore = "long: tests/run slow"]
    fn a_pitch_gives_settled_rows_either_way_and_mirror_images() {
        let forward = run(&coarse(Path::Pitch));
        let backward = run(&SimulationSettings { direction: Direction::Backward, ..coarse(Path::Pitch) });
        for run in [&forward, &backward] {
            assert!(run.rows.iter().all(|row| row.settled));
            let steps: Vec<usize> = run.rows.iter().map(|row| row.step).collect();
            assert_eq!(steps, (1..=24).collect::<Vec<_>>());
        }
        let travel = forward.rows[23].generator_rad - forward.rows[0].generator_rad;
        assert!((travel - TAU / 188.0 * 23.0 / 24.0).abs() < 1e-12);
        for (f, b) in forward.rows.iter().zip(&backward.rows) {
            assert!((f.error_arcsec + b.error_arcsec).abs() < 0.01, "{} {}", f.error_arcsec, b.error_arcsec);
        }
        let summary = &forward.summary;
        // Half the clearance of about an arc-minute, behind; ripple of less than an arc-second.
        let mean = summary.mean_error_forward_arcsec.unwrap();
        assert!((-33.0..-26.0).contains(&mean), "{mean}");
        let ripple = summary.kinematic_error_pp_arcsec.unwrap();
        assert!((0.05..1.5).contains(&ripple), "{ripple}");
        assert_eq!((summary.backlash_arcsec, summary.wind_up_arcsec), (None, None));
        assert!(summary.torque_balance_worst_n_m < 1e-6);
        let (found, expected) =
            (summary.generator_torque_mean_n_m.unwrap(), summary.generator_torque_virtual_work_n_m.unwrap());
        assert!((found / expected - 1.0).abs() < 0.02, "{found}, by virtual work {expected}");
        // One deforms, four cross half the clearance, twenty-four are the pitch.
        assert_eq!(summary.increments, 29);
    }

    #[test]
    #[ignore = "long: tests/run slow"]
    fn wind_up_is_counted_from_the_middle_of_the_clearance() {
        let summary = run(&SimulationSettings { torque_n_m: 10.0, ..coarse(Path::Pitch) }).summary;
        // On the major axis the middle is there by symmetry.
        assert!(summary.backlash_middle_arcsec.unwrap().abs() < 0.01);
        let (whole, elastic) = (summary.wind_up_arcsec.unwrap(), summary.wind_up_elastic_arcsec.unwrap());
        assert!(elastic > 0.0, "{elastic}");
        assert!(((whole - elastic) - 29.6).abs() < 2.0, "half the clearance: {}", whole - elastic);
        assert_eq!(summary.backlash_arcsec, None);
        let (found, expected) =
            (summary.generator_torque_mean_n_m.unwrap(), summary.generator_torque_virtual_work_n_m.unwrap());
        assert!(expected < 0.0 && (found / expected - 1.0).abs() < 0.02, "{found}, by virtual work {expected}");
    }

    #[test]
    fn a_light_touch_is_more_than_the_drag_and_less_than_the_load() {
        for (drag, load) in
            [(0.02, 0.021), (0.02, 0.1), (0.02, 320.0), (0.5, 5.0), (0.0, 1e-3), (0.0, -50.0), (5e-6, -8e-3)]
        {
            let touch = light_touch_n_m(drag, load);
            assert!(touch > drag && touch < load.abs(), "{drag} {load}: {touch}");
            assert!((light_touch_n_m(8.0 * drag, 8.0 * load) / touch - 8.0).abs() < 1e-12, "{drag} {load}");
        }
        // Where the load is some times the drag it is twice the drag.
        for load in [0.1, 1.0, 320.0] {
            assert!((light_touch_n_m(0.02, load) - 0.04).abs() < 1e-15);
        }
    }

    /// HHD-95 with all lengths times `scale`, and its drag as a torque.
    fn at_scale(scale: f64) -> Drive {
        let mut drive = Drive::hhd_95();
        let (f, c) = (&mut drive.flexspline, &mut drive.circular_spline);
        for length in
            [&mut f.module_mm, &mut f.root_radius_mm, &mut f.tip_radius_mm, &mut f.rim_thickness_mm, &mut f.width_mm]
        {
            *length *= scale;
        }
        for length in [&mut c.module_mm, &mut c.root_radius_mm, &mut c.tip_radius_mm, &mut c.outer_radius_mm] {
            *length *= scale;
        }
        for length in [&mut f.root_fillet_mm, &mut f.tip_rounding_mm, &mut c.root_fillet_mm, &mut c.tip_rounding_mm] {
            *length *= scale;
        }
        drive.generator.w0_mm *= scale;
        drive.generator.roller_diameter_mm *= scale;
        drive.output.drag_torque_n_m *= scale.powi(3);
        drive
    }

    /// Angles are the same where lengths go with the scale, torques with its cube and penalties with its inverse: the
    /// bodies are the same.
    #[test]
    #[ignore = "long: tests/run slow"]
    fn a_drive_a_tenth_as_large_winds_up_alike() {
        let of = |scale: f64| {
            let drive = at_scale(scale);
            let torque_n_m = 20.0 * scale.powi(3);
            let mut settings = SimulationSettings { torque_n_m, ..coarse(Path::Pitch) };
            settings.solver.flank_penalty /= scale;
            settings.solver.bore_penalty = Some(settings.solver.bore_penalty(settings.generator) / scale);
            let summary = simulate(&drive, &settings, &mut |_| ControlFlow::Continue(())).unwrap().summary;
            (summary.wind_up_arcsec.unwrap(), summary.wind_up_elastic_arcsec.unwrap())
        };
        let ((whole, elastic), (small_whole, small_elastic)) = (of(1.0), of(0.1));
        assert!((small_whole / whole - 1.0).abs() < 0.005, "{small_whole} {whole}");
        assert!((small_elastic / elastic - 1.0).abs() < 0.01, "{small_elastic} {elastic}");
    }

    /// The pressure between flanks is a result of forces and shapes: as stiff as the penalty is, and as large as the
    /// drive, it is the same.
    #[test]
    fn flanks_press_alike_whatever_the_penalty_and_the_scale() {
        let of = |scale: f64, flank_penalty: f64| {
            let mut settings = SimulationSettings { torque_n_m: 100.0 * scale.powi(3), ..coarse(points(&[0.0])) };
            settings.solver.flank_penalty = flank_penalty;
            simulate(&at_scale(scale), &settings, &mut |_| ControlFlow::Continue(()))
                .unwrap()
                .summary
                .peak_flank_pressure_mpa
        };
        let usual = of(1.0, 5e7);
        assert!((300.0..900.0).contains(&usual), "{usual}");
        // A softer flank and a smaller drive; `FLEXSPLINE_LONG` has a stiffer one and a larger one too.
        let count = if std::env::var_os("FLEXSPLINE_LONG").is_some() { 4 } else { 2 };
        for (scale, penalty) in [(1.0, 5e6), (0.3, 5e7), (1.0, 5e8), (3.0, 5e7)].into_iter().take(count) {
            let other = of(scale, penalty);
            assert!((other / usual - 1.0).abs() < 0.05, "{scale} {penalty}: {other} {usual}");
        }
    }

    #[test]
    fn a_path_by_points_has_a_row_for_each_and_crosses_its_clearance_at_a_reversal() {
        let there: Vec<f64> = (0..=10).map(|i| 0.01 * f64::from(i)).collect();
        let back: Vec<f64> = (1..=8).map(|i| 0.1 - 0.01 * f64::from(i)).collect();
        let run = run(&coarse(points(&[there, back].concat())));
        assert_eq!(run.rows.len(), 19);
        assert_eq!((run.rows[0].step, run.rows[18].step), (0, 18));
        let summary = &run.summary;
        let backlash = summary.backlash_arcsec.unwrap();
        assert!((54.0..64.0).contains(&backlash), "{backlash}");
        let dwell = summary.dwell_generator_rad.unwrap() * flexspline_base::units::ARCSEC_PER_RAD / 95.0;
        assert!((dwell - backlash).abs() < 1.0, "{dwell}, {backlash}");
        assert_eq!(summary.reversal_lost_motion_arcsec, None);
    }

    /// All of one steel: warming the whole drive scales it, and no angle changes; warming the flexspline alone takes up
    /// clearance.
    #[test]
    fn warming_goes_on_from_the_state_it_finds() {
        let warm = |temperature: [f64; 6]| {
            let angles = [0.0, 0.02, 0.04, 0.04, 0.05, 0.06];
            let point = |(generator_rad, temperature_c): (f64, f64)| PathPoint {
                generator_rad,
                torque_n_m: None,
                temperature_c: Some(temperature_c),
            };
            coarse(Path::Points(angles.into_iter().zip(temperature).map(point).collect()))
        };
        let even = run(&warm([20.0; 6]));
        let warmed = run(&warm([20.0, 20.0, 20.0, 60.0, 60.0, 60.0]));
        assert_eq!(warmed.rows[3].temperature_c, 60.0);
        assert_eq!(warmed.summary.temperature_c, None);
        for (a, b) in even.rows.iter().zip(&warmed.rows) {
            assert!((a.error_arcsec - b.error_arcsec).abs() < 0.02, "{} {}", a.error_arcsec, b.error_arcsec);
        }
        let drive = Drive::hhd_95().with_set("temperature.circular_spline_expansion_per_k=10e-6").unwrap();
        let drive = drive.with_set("temperature.housing_expansion_per_k=10e-6").unwrap();
        let tight =
            simulate(&drive, &warm([20.0, 20.0, 20.0, 60.0, 60.0, 60.0]), &mut |_| ControlFlow::Continue(())).unwrap();
        // The flexspline grows 2.9 µm on the other wheel: 2 dr tan a / r less clearance, half of it on this side.
        let gained = tight.rows[5].error_arcsec - even.rows[5].error_arcsec;
        assert!((2.0..10.0).contains(&gained), "{gained}");
    }

    #[test]
    fn the_observer_sees_every_increment_and_can_stop() {
        let mut seen = Vec::new();
        let settings = coarse(points(&[0.0, 0.004, 0.008]));
        let stopped = simulate(&Drive::hhd_95(), &settings, &mut |now| {
            seen.push((now.phase, now.done, now.total, now.row.map(|row| row.step)));
            if now.done == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!(stopped.unwrap_err(), SimulateError::Stopped);
        assert_eq!(
            seen,
            [(Phase::Deforming, 1, 3, None), (Phase::Following, 1, 3, Some(0)), (Phase::Following, 2, 3, Some(1))]
        );
    }

    #[test]
    fn settings_out_of_range_are_refused_before_any_work() {
        let good = coarse(Path::Paper);
        let hot = Path::Points(vec![PathPoint { temperature_c: Some(200.0), ..Default::default() }]);
        let solver = |solver| SimulationSettings { solver, ..good.clone() };
        let cases = [
            (SimulationSettings { increment_rad: Some(0.0), ..good.clone() }, "increment: found 0"),
            (SimulationSettings { increment_rad: Some(f64::NAN), ..good.clone() }, "increment: found NaN"),
            (SimulationSettings { increment_rad: Some(0.1), ..coarse(points(&[0.0])) }, "increment: found 0.1"),
            (SimulationSettings { torque_n_m: f64::NAN, ..good.clone() }, "torque: found NaN"),
            (SimulationSettings { torque_n_m: 1e6, ..good.clone() }, "torque: found 1000000"),
            (SimulationSettings { temperature_c: Some(-300.0), ..good.clone() }, "temperature: found -300"),
            (coarse(hot), "temperature: found 200, allowed: -60 to 80"),
            (coarse(points(&[])), "path: found no points"),
            (coarse(points(&[f64::INFINITY])), "generator angle: found inf"),
            (solver(SolverSettings { flank_penalty: 0.0, ..good.solver }), "flank penalty: found 0"),
            (solver(SolverSettings { bore_penalty: Some(1e20), ..good.solver }), "bore penalty"),
            (solver(SolverSettings { tolerance: 0.5, ..good.solver }), "tolerance: found 0.5"),
            (solver(SolverSettings { max_iterations: 0, ..good.solver }), "iterations: found 0"),
        ];
        for (settings, start) in cases {
            let mut increments = 0;
            let error = simulate(&Drive::hhd_95(), &settings, &mut |_| {
                increments += 1;
                ControlFlow::Continue(())
            })
            .unwrap_err();
            assert!(error.is_bad_input() && increments == 0);
            assert!(error.to_string().starts_with(start), "{error}");
        }
    }
}
