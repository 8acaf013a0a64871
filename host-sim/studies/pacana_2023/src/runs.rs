//! The runs: the paper's protocol with each generator, the same with another discretisation, and what one of them shows
//! of the deformed flexspline.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde::Serialize;

use super::metrics::ProtocolMetrics;
use super::paper;
use super::rank::Measured;
use flexspline_design::simulate::stress::nodal_von_mises;
use flexspline_design::simulate::{Observation, Path, Row, SimulateError, SimulationSettings, simulate};
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::{Method, SolverSettings};

/// Told how many increments are done of how many, and of what the last was; may stop everything.
pub type Observe<'o> = dyn Fn(usize, usize, &str) -> ControlFlow<()> + Sync + 'o;

/// How a run is discretised.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Variant {
    /// As the command was asked to.
    Standard,
    /// On another mesh.
    Mesh(MeshLevel),
    /// Half the increment.
    HalfIncrement,
    /// Every contact penalty times this.
    Penalty(f64),
}

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Variant::Standard => f.write_str("standard"),
            Variant::Mesh(level) => write!(f, "{level} mesh"),
            Variant::HalfIncrement => f.write_str("half the increment"),
            Variant::Penalty(factor) => write!(f, "penalty times {factor}"),
        }
    }
}

/// One run of the protocol.
pub(super) struct Job {
    pub drive: Drive,
    pub kind: GeneratorKind,
    pub torque_n_m: f64,
    pub variant: Variant,
    pub solver: SolverSettings,
    /// Whether its rows are plotted.
    pub keep_rows: bool,
    /// Whether the deformed drive is looked at.
    pub snapshot: bool,
}

impl Job {
    fn settings(&self) -> SimulationSettings {
        let mut solver = self.solver;
        let mut increment_rad = None;
        match self.variant {
            Variant::Standard => {}
            Variant::Mesh(mesh) => solver.mesh = mesh,
            Variant::HalfIncrement => increment_rad = Some(0.005),
            Variant::Penalty(factor) => {
                solver.flank_penalty *= factor;
                solver.bore_penalty = Some(factor * solver.bore_penalty(self.kind));
            }
        }
        SimulationSettings {
            torque_n_m: self.torque_n_m,
            increment_rad,
            solver,
            ..SimulationSettings::new(self.kind, Path::Paper)
        }
    }

    /// Increments it will take, about.
    fn increments(&self) -> usize {
        if self.variant == Variant::HalfIncrement { 602 } else { 302 }
    }
}

/// The drive as it was deformed, at generator angle 0 and no load.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// Path of a tooth tip past the tooth it meets at the minor axis, the frame of the paper's figure 6: angle from the
    /// major axis (rad), w and v (mm). All teeth of a quarter at once, which is one tooth through a quarter turn.
    pub tip_path: Vec<[f64; 3]>,
    /// Largest von Mises stress in each sector of the flexspline: angle from the major axis (degrees, −90 to 90) and
    /// MPa.
    pub stress: Vec<[f64; 2]>,
}

/// A run that converged.
#[derive(Debug, Clone, PartialEq)]
pub struct Solved {
    /// What it comes to.
    pub metrics: ProtocolMetrics,
    /// Its rows, of those that are plotted.
    pub rows: Vec<Row>,
    /// The deformed drive, of those that show it.
    pub snapshot: Option<Snapshot>,
    /// Where the largest stress of the path is: angle from the major axis, degrees, 0 to 90.
    pub peak_from_major_deg: f64,
    /// Unknowns.
    pub degrees_of_freedom: usize,
    /// Largest residual.
    pub residual: f64,
    /// Time, s.
    pub wall_s: f64,
}

/// What a run gave.
pub struct ProtocolRun {
    /// Which generator.
    pub kind: GeneratorKind,
    /// Load, N m.
    pub torque_n_m: f64,
    /// How it was discretised.
    pub variant: Variant,
    /// What came of it.
    pub outcome: Result<Solved, SimulateError>,
}

/// A run in `reproduce.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunRecord {
    /// Wave generator.
    pub generator: &'static str,
    /// Load, N m.
    pub torque_n_m: f64,
    /// Discretisation.
    pub variant: String,
    /// `converged`, or why not.
    pub status: String,
    /// What it comes to.
    pub metrics: Option<ProtocolMetrics>,
    /// Angle of the largest stress from the major axis, degrees.
    pub peak_from_major_deg: Option<f64>,
    /// Unknowns.
    pub degrees_of_freedom: Option<usize>,
}

impl ProtocolRun {
    /// As the JSON has it.
    pub fn record(&self) -> RunRecord {
        let solved = self.outcome.as_ref().ok();
        RunRecord {
            generator: self.kind.name(),
            torque_n_m: self.torque_n_m,
            variant: self.variant.to_string(),
            status: self.outcome.as_ref().map_or_else(ToString::to_string, |_| "converged".into()),
            metrics: solved.map(|s| s.metrics),
            peak_from_major_deg: solved.map(|s| s.peak_from_major_deg),
            degrees_of_freedom: solved.map(|s| s.degrees_of_freedom),
        }
    }
}

/// All runs of the protocol.
pub struct Runs(pub Vec<ProtocolRun>);

impl Runs {
    fn of(&self, kind: GeneratorKind, torque_n_m: f64) -> impl Iterator<Item = &ProtocolRun> {
        self.0.iter().filter(move |run| run.kind == kind && run.torque_n_m == torque_n_m)
    }

    /// The standard run with a generator under a load, if it converged.
    pub fn get(&self, kind: GeneratorKind, torque_n_m: f64) -> Option<&Solved> {
        self.of(kind, torque_n_m).find(|run| run.variant == Variant::Standard)?.outcome.as_ref().ok()
    }

    /// A value of the standard run with what the other discretisations make of it; NaN where the run gives none.
    pub fn measure(
        &self,
        kind: GeneratorKind,
        torque_n_m: f64,
        of: impl Fn(&ProtocolMetrics) -> Option<f64>,
    ) -> Measured {
        let value = |run: &ProtocolRun| of(&run.outcome.as_ref().ok()?.metrics);
        let standard = self.get(kind, torque_n_m).and_then(|s| of(&s.metrics)).unwrap_or(f64::NAN);
        let variants = self
            .of(kind, torque_n_m)
            .filter(|run| run.variant != Variant::Standard)
            .filter_map(|run| Some((run.variant.to_string(), value(run)?)))
            .collect();
        Measured::new(standard, variants)
    }

    /// A value of the standard run; NaN where it gives none.
    pub fn value(&self, kind: GeneratorKind, torque_n_m: f64, of: impl Fn(&ProtocolMetrics) -> Option<f64>) -> f64 {
        self.get(kind, torque_n_m).and_then(|s| of(&s.metrics)).unwrap_or(f64::NAN)
    }
}

/// Loads at which a generator is run: the paper loads double disc and cam alone.
pub(crate) fn torques_of(kind: GeneratorKind) -> &'static [f64] {
    match kind {
        GeneratorKind::TwoRoller | GeneratorKind::FourRoller => &[0.0],
        GeneratorKind::DoubleDisc | GeneratorKind::Cam => &[0.0, paper::TORQUE_N_M, -paper::TORQUE_N_M],
    }
}

/// Every run of the protocol that the claims need.
pub(super) fn jobs(drive: &Drive, mesh: MeshLevel, variants: &[Variant]) -> Vec<Job> {
    let solver = SolverSettings { method: Method::Fast, mesh, ..SolverSettings::default() };
    let mut jobs = Vec::new();
    for variant in [Variant::Standard].iter().chain(variants) {
        for kind in GeneratorKind::ALL {
            for &torque_n_m in torques_of(kind) {
                let standard = *variant == Variant::Standard;
                if !standard && torque_n_m > 0.0 {
                    // The mirror image of the load the other way.
                    continue;
                }
                jobs.push(Job {
                    drive: drive.clone(),
                    kind,
                    torque_n_m,
                    variant: *variant,
                    solver,
                    keep_rows: standard,
                    snapshot: standard && torque_n_m == 0.0,
                });
            }
        }
    }
    jobs
}

/// Runs all jobs, several at once; results in their order. `Err` when the observer stopped them.
pub(super) fn run_all(
    jobs: &[Job],
    observe: &Observe<'_>,
) -> Result<Vec<Result<Solved, SimulateError>>, SimulateError> {
    let total: usize = jobs.iter().map(Job::increments).sum();
    let done = AtomicUsize::new(0);
    let solved: Vec<Result<Solved, SimulateError>> = jobs
        .par_iter()
        .with_max_len(1)
        .map(|job| {
            let note = format!("{}, {} N.m, {}", job.kind, job.torque_n_m, job.variant);
            let mut mine = 0;
            let result = solve(job, &mut || {
                mine += 1;
                observe(done.fetch_add(1, Ordering::Relaxed) + 1, total, &note)
            });
            // One that ended early counts as done.
            done.fetch_add(job.increments().saturating_sub(mine), Ordering::Relaxed);
            result
        })
        .collect();
    match solved.iter().find_map(|run| run.as_ref().err().filter(|e| matches!(e, SimulateError::Stopped { .. }))) {
        Some(stopped) => Err(stopped.clone()),
        None => Ok(solved),
    }
}

fn solve(job: &Job, tick: &mut dyn FnMut() -> ControlFlow<()>) -> Result<Solved, SimulateError> {
    let mut snapshot = None;
    let run = simulate(&job.drive, &job.settings(), &mut |now| {
        if job.snapshot && now.row.is_some_and(|row| row.step == 0) {
            snapshot = Some(Snapshot::new(now));
        }
        tick()
    })?;
    let summary = &run.summary;
    let pitch = TAU / f64::from(job.drive.flexspline.teeth);
    let [x, y] = summary.max_von_mises_position_mm;
    let generator = run.rows.iter().find(|row| row.step == summary.max_von_mises_step).map_or(0.0, |r| r.generator_rad);
    Ok(Solved {
        metrics: ProtocolMetrics::new(&run, job.drive.ratio(), pitch),
        snapshot,
        peak_from_major_deg: from_major(y.atan2(x) - generator).abs().to_degrees(),
        degrees_of_freedom: summary.degrees_of_freedom,
        residual: summary.residual_worst,
        wall_s: summary.wall_s,
        rows: if job.keep_rows { run.rows } else { Vec::new() },
    })
}

/// An angle from the nearer end of the major axis, −π/2 to π/2.
fn from_major(angle: f64) -> f64 {
    let folded = angle.rem_euclid(PI);
    if folded > FRAC_PI_2 { folded - PI } else { folded }
}

impl Snapshot {
    fn new(now: &Observation) -> Snapshot {
        let (problem, drive) = (now.problem, &now.problem.drive);
        let mesh = &problem.flexspline;
        let whole = problem.whole_state(now.state);
        let radius = drive.flexspline.neutral_radius_mm();
        // The node on the axis of a tooth that lies farthest out.
        let on_axis = (0..mesh.nodes_per_sector).filter(|&k| mesh.nodes[k][1].abs() < 1e-9);
        let tip = on_axis.max_by(|&a, &b| mesh.nodes[a][0].total_cmp(&mesh.nodes[b][0])).expect("a tooth has an axis");
        let mut tip_path = Vec::new();
        for tooth in 0..mesh.teeth {
            let phi = mesh.sector_angle(tooth) - now.state.generator_rad;
            if !(0.0..=FRAC_PI_2).contains(&phi) {
                continue;
            }
            let n = mesh.node(tooth as isize, tip as u32);
            let x = mesh.nodes[n][0] + whole.u[2 * n];
            let y = mesh.nodes[n][1] + whole.u[2 * n + 1];
            // From the axis of the tooth that is met at the minor axis, the output where the ratio has it.
            let beside = y.atan2(x) - now.state.generator_rad - phi - (FRAC_PI_2 - phi) / drive.ratio();
            let r = x.hypot(y);
            tip_path.push([phi, r * beside.cos() - radius, r * beside.sin()]);
        }
        let stress = nodal_von_mises(mesh, &problem.material, &whole.u);
        let mut sectors: Vec<[f64; 2]> = (0..mesh.teeth / 2)
            .map(|sector| {
                let most = (0..mesh.nodes_per_sector).map(|k| stress[mesh.node(sector as isize, k as u32)]);
                let angle = from_major(mesh.sector_angle(sector) - now.state.generator_rad);
                [angle.to_degrees(), most.fold(0.0, f64::max)]
            })
            .collect();
        sectors.sort_by(|a, b| a[0].total_cmp(&b[0]));
        Snapshot { tip_path, stress: sectors }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_counted_from_the_nearer_end_of_the_major_axis() {
        for (angle, expected) in [(0.0, 0.0), (3.0, 3.0 - PI), (-0.2, -0.2), (PI + 0.3, 0.3), (1.5, 1.5)] {
            assert!((from_major(angle) - expected).abs() < 1e-12, "{angle}");
        }
    }

    #[test]
    fn the_paper_loads_two_generators_and_every_variant_runs_alike() {
        let jobs = jobs(&Drive::hhd_95(), MeshLevel::Coarse, &[Variant::HalfIncrement, Variant::Penalty(2.0)]);
        assert_eq!(jobs.len(), 8 + 2 * 6);
        assert_eq!(jobs.iter().filter(|job| job.snapshot).count(), 4);
        let of = |variant: Variant| jobs.iter().find(|job| job.variant == variant).unwrap().settings();
        assert_eq!(of(Variant::HalfIncrement).increment_rad, Some(0.005));
        let (soft, plain) = (of(Variant::Penalty(2.0)).solver, of(Variant::Standard).solver);
        assert_eq!(soft.flank_penalty, 2.0 * plain.flank_penalty);
        assert_eq!(soft.bore_penalty, Some(2.0 * plain.bore_penalty(GeneratorKind::TwoRoller)));
    }
}
