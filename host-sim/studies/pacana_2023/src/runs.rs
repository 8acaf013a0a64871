//! The runs of the protocol, and the metrics of a run.
//!
//! ```text
//!  e ^        B ______________________ C   e_b   backward: the other flank drives
//!    |       /                                   A-B: the output stands (dwell)
//!  0 |-O----/---------------------------> travel
//!    |  \_______________ A                 e_f   forward, after start-up
//! ```

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde::Serialize;

use crate::claims::TORQUE_N_M;
use flexspline_design::simulate::{Observation, Path, Row, SimulateError, Simulation, SimulationSettings, simulate};
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::{Holding, Method, SolverSettings};

/// Called after every increment, from any thread: number done, number in all, name of the run.
pub type Observe<'o> = dyn Fn(usize, usize, &str) + Sync + 'o;

/// The run that nothing is changed in.
const STANDARD: &str = "standard";
/// The run whose rim is kept from turning at one point of its bore instead of by the mean of the bore. Coarse mesh.
pub(crate) const ONE_POINT: &str = "rim held at one point";

/// A variant of a run: name, whether the quick form has it, change of the settings.
type Variant = (&'static str, bool, fn(&mut SimulationSettings));

/// All variants, the standard run first.
const VARIANTS: [Variant; 7] = [
    (STANDARD, true, |_| {}),
    ("penalty times 2", true, |settings| stiffen(settings, 2.0)),
    ("penalty times 0.5", false, |settings| stiffen(settings, 0.5)),
    ("half the increment", false, |settings| settings.increment_rad = Some(0.005)),
    ("coarse mesh", false, |settings| settings.solver.mesh = MeshLevel::Coarse),
    ("standard mesh", false, |settings| settings.solver.mesh = MeshLevel::Standard),
    (ONE_POINT, true, |SimulationSettings { solver, .. }| {
        (solver.mesh, solver.holding) = (MeshLevel::Coarse, Holding::OnePoint);
    }),
];

/// Multiplies every contact penalty.
fn stiffen(settings: &mut SimulationSettings, factor: f64) {
    let solver = &mut settings.solver;
    solver.flank_penalty *= factor;
    solver.bore_penalty = Some(factor * solver.bore_penalty(settings.generator));
}

/// Metrics of a run; NaN, in JSON `null`, where the run does not give one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RunMetrics {
    /// Largest |error| from the start to +1 rad. The error is zero where the drive was deformed, the output in the
    /// middle of its clearance.
    pub largest_out_arcsec: f64,
    /// Largest |error| on the way back.
    pub largest_back_arcsec: f64,
    /// Mean error over whole tooth pitches forward, after start-up.
    pub lag_forward_arcsec: f64,
    /// Ripple after start-up, peak to peak.
    pub ripple_pp_arcsec: f64,
    /// Half of the mean error backward less that forward; the whole is the backlash.
    pub half_width_arcsec: f64,
    /// Generator travel A–B during which the output stands after the reversal, rad.
    pub dwell_rad: f64,
    /// Error where the generator turns back, +1 rad.
    pub error_at_turn_arcsec: f64,
    /// Error at the end, −1 rad.
    pub error_at_end_arcsec: f64,
    /// Mean of |e(B–C) − e(0–A)| at the same generator angles, the start and A–B left out.
    pub lost_motion_arcsec: f64,
    /// Largest von Mises stress on the path, MPa.
    pub peak_mpa: f64,
    /// Its angle from the major axis, degrees, 0 to 90.
    pub peak_from_major_deg: f64,
}

/// A run of the protocol.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PaperRun {
    /// Wave generator.
    pub generator: GeneratorKind,
    /// Load, N·m.
    pub torque_n_m: f64,
    /// The change.
    pub variant: &'static str,
    /// `converged`, or why not.
    pub status: String,
    /// Metrics of a run that converged.
    pub metrics: Option<RunMetrics>,
    /// Its rows.
    #[serde(skip)]
    pub rows: Vec<Row>,
    /// Path of a tooth tip in the frame of the paper's figure 6: angle from the major axis (rad), w
    /// and v (mm). All teeth of a quarter at once, which is one tooth through a quarter turn.
    #[serde(skip)]
    pub tip_path: Vec<[f64; 3]>,
    #[serde(skip)]
    settings: SimulationSettings,
}

/// The standard run with a generator under a load (N·m).
pub(crate) fn standard(runs: &[PaperRun], kind: GeneratorKind, torque_n_m: f64) -> Option<&PaperRun> {
    let is_it = |run: &&PaperRun| run.generator == kind && run.torque_n_m == torque_n_m && run.variant == STANDARD;
    runs.iter().find(is_it)
}

/// The runs to make, before they are solved.
pub(crate) fn planned(mesh: MeshLevel, quick: bool) -> Vec<PaperRun> {
    let mut planned: Vec<PaperRun> = Vec::new();
    let same = format!("{mesh} mesh");
    for (variant, _, change) in
        VARIANTS.into_iter().filter(|(name, in_quick, _)| (*in_quick || !quick) && *name != same)
    {
        for generator in GeneratorKind::ALL {
            let torques: &[f64] = match (variant, generator) {
                // Two rollers held between them have no equilibrium near 0.3 rad.
                (ONE_POINT, GeneratorKind::TwoRoller) => &[],
                (ONE_POINT, _) | (_, GeneratorKind::TwoRoller | GeneratorKind::FourRoller) => &[0.0],
                (STANDARD, _) => &[0.0, TORQUE_N_M, -TORQUE_N_M],
                // One way is the mirror image of the other.
                _ => &[0.0, -TORQUE_N_M],
            };
            for &torque_n_m in torques {
                let mut settings = SimulationSettings::new(generator, Path::Paper);
                settings.torque_n_m = torque_n_m;
                settings.solver = SolverSettings { method: Method::Fast, mesh, ..SolverSettings::default() };
                change(&mut settings);
                let (status, metrics, rows, tip_path) = Default::default();
                planned.push(PaperRun { generator, torque_n_m, variant, status, metrics, rows, tip_path, settings });
            }
        }
    }
    planned
}

/// Runs the protocol, several runs at once.
pub(crate) fn run_all(
    drive: &Drive,
    mesh: MeshLevel,
    quick: bool,
    observe: &Observe<'_>,
) -> Result<Vec<PaperRun>, SimulateError> {
    let mut runs = planned(mesh, quick);
    // A run that ends early leaves its increments undone.
    let total = runs.iter().map(|run| if run.settings.increment_rad.is_some() { 602 } else { 302 }).sum();
    let done = AtomicUsize::new(0);
    runs.par_iter_mut().with_max_len(1).try_for_each(|run| {
        let note = format!("{}, {} N·m, {}", run.generator, run.torque_n_m, run.variant);
        run.status = match solve(drive, run, &|| observe(done.fetch_add(1, Ordering::Relaxed) + 1, total, &note)) {
            Err(error) if error.is_bad_input() => return Err(error),
            Err(error) => error.to_string(),
            Ok(()) => "converged".to_owned(),
        };
        Ok(())
    })?;
    Ok(runs)
}

fn solve(drive: &Drive, run: &mut PaperRun, tick: &dyn Fn()) -> Result<(), SimulateError> {
    let found = simulate(drive, &run.settings, &mut |now| {
        if now.row.is_some_and(|row| row.step == 0) {
            run.tip_path = tip_path(now);
        }
        tick();
        ControlFlow::Continue(())
    })?;
    run.metrics = Some(RunMetrics::new(&found, TAU / f64::from(drive.flexspline.teeth)));
    run.rows = found.rows;
    Ok(())
}

/// An angle from the nearer end of the major axis, −π/2 to π/2.
fn from_major(angle: f64) -> f64 {
    let folded = angle.rem_euclid(PI);
    if folded > FRAC_PI_2 { folded - PI } else { folded }
}

fn tip_path(now: &Observation) -> Vec<[f64; 3]> {
    let (problem, drive) = (now.problem, &now.problem.drive);
    let mesh = &problem.flexspline;
    let whole = problem.whole_state(now.state);
    let radius = drive.flexspline.neutral_radius_mm();
    // The node on the axis of a tooth that lies farthest out.
    let on_axis = (0..mesh.nodes_per_sector).filter(|&k| mesh.nodes[k][1].abs() < 1e-9);
    let tip = on_axis.max_by(|&a, &b| mesh.nodes[a][0].total_cmp(&mesh.nodes[b][0])).expect("a tooth has an axis");
    let of_tooth = |tooth: usize| {
        let phi = mesh.sector_angle(tooth) - now.state.generator_rad;
        let n = mesh.node(tooth as isize, tip as u32);
        let [x, y] = [0, 1].map(|k| mesh.nodes[n][k] + whole.u[2 * n + k]);
        // From the axis of the tooth that is met at the minor axis, the output where the ratio has it.
        let angle = y.atan2(x) - now.state.generator_rad - phi - (FRAC_PI_2 - phi) / drive.ratio();
        let r = x.hypot(y);
        (0.0..=FRAC_PI_2).contains(&phi).then(|| [phi, r * angle.cos() - radius, r * angle.sin()])
    };
    (0..mesh.teeth).filter_map(of_tooth).collect()
}

/// The way out, to the largest angle, and the way back.
pub(crate) fn both_ways(rows: &[Row]) -> (&[Row], &[Row]) {
    let farthest = rows.iter().enumerate().max_by(|a, b| a.1.generator_rad.total_cmp(&b.1.generator_rad));
    rows.split_at(farthest.map_or(0, |(at, _)| at + 1))
}

impl RunMetrics {
    /// Of a run along the paper's path; `pitch` is that of the flexspline, rad.
    fn new(run: &Simulation, pitch: f64) -> RunMetrics {
        let (rows, summary) = (&run.rows, &run.summary);
        let (out, back) = both_ways(rows);
        let largest = |rows: &[Row]| rows.iter().map(|row| row.error_arcsec.abs()).fold(0.0, f64::max);
        let last = |rows: &[Row]| rows.last().map_or(f64::NAN, |row| row.error_arcsec);
        let [forward, backward] = [summary.mean_error_forward_arcsec, summary.mean_error_backward_arcsec]
            .map(|mean| mean.unwrap_or(f64::NAN));
        let [x, y] = summary.max_von_mises_position_mm;
        let at_peak = rows.iter().find(|row| row.step == summary.max_von_mises_step);
        let generator = at_peak.map_or(0.0, |row| row.generator_rad);
        RunMetrics {
            largest_out_arcsec: largest(out),
            largest_back_arcsec: largest(back),
            lag_forward_arcsec: forward,
            ripple_pp_arcsec: summary.kinematic_error_pp_arcsec.unwrap_or(f64::NAN),
            half_width_arcsec: 0.5 * (backward - forward),
            dwell_rad: summary.dwell_generator_rad.unwrap_or(f64::NAN),
            error_at_turn_arcsec: last(out),
            error_at_end_arcsec: last(back),
            lost_motion_arcsec: lost_motion(out, back, pitch),
            peak_mpa: summary.max_von_mises_mpa,
            peak_from_major_deg: from_major(y.atan2(x) - generator).abs().to_degrees(),
        }
    }
}

/// Mean of |e back − e out| at the angles of the way out, from a pitch after the start to two pitches before the turn.
fn lost_motion(out: &[Row], back: &[Row], pitch: f64) -> f64 {
    let between = out[0].generator_rad + pitch..out[out.len() - 1].generator_rad - 2.0 * pitch;
    let back_at = |angle: f64| {
        back.windows(2).find_map(|pair| {
            let t = (angle - pair[0].generator_rad) / (pair[1].generator_rad - pair[0].generator_rad);
            let [a, b] = [pair[0].error_arcsec, pair[1].error_arcsec];
            (-1e-9..=1.0 + 1e-9).contains(&t).then_some(a + t * (b - a))
        })
    };
    let steady = out.iter().filter(|row| between.contains(&row.generator_rad));
    let lost: Vec<f64> =
        steady.filter_map(|row| Some((back_at(row.generator_rad)? - row.error_arcsec).abs())).collect();
    lost.iter().sum::<f64>() / lost.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(generator_rad: f64, error_arcsec: f64) -> Row {
        Row { generator_rad, error_arcsec, settled: true, ..Row::default() }
    }

    const PITCH: f64 = TAU / 188.0;

    #[test]
    fn the_lost_motion_is_the_distance_of_the_two_ways() {
        let out = (0..=100).map(|k| row(0.01 * f64::from(k), -30.0));
        let rows: Vec<Row> = out.chain((1..=200).map(|k| row(1.0 - 0.01 * f64::from(k), 31.0))).collect();
        let (out, back) = both_ways(&rows);
        assert_eq!((out.len(), back.len()), (101, 200));
        assert!((lost_motion(out, back, PITCH) - 61.0).abs() < 1e-9);
        assert!(lost_motion(&out[..3], back, PITCH).is_nan());
    }

    #[test]
    fn angles_are_counted_from_the_nearer_end_of_the_major_axis() {
        for (angle, expected) in [(0.0, 0.0), (3.0, 3.0 - PI), (-0.2, -0.2), (PI + 0.3, 0.3), (1.5, 1.5)] {
            assert!((from_major(angle) - expected).abs() < 1e-12, "{angle}");
        }
    }

    #[test]
    fn the_paper_loads_two_generators_and_every_variant_runs_alike() {
        let runs = planned(MeshLevel::Fine, false);
        assert_eq!(runs.len(), 8 + 5 * 6 + 3);
        let of = |variant| &runs.iter().find(|run| run.variant == variant).expect("a run").settings;
        assert_eq!(of("half the increment").increment_rad, Some(0.005));
        assert_eq!(of("coarse mesh").solver.mesh, MeshLevel::Coarse);
        let (soft, plain) = (of("penalty times 2").solver, of(STANDARD).solver);
        assert_eq!(soft.flank_penalty, 2.0 * plain.flank_penalty);
        assert_eq!(soft.bore_penalty, Some(2.0 * plain.bore_penalty(GeneratorKind::TwoRoller)));
        assert!(planned(MeshLevel::Coarse, false).iter().all(|run| run.variant != "coarse mesh"));
        assert_eq!(planned(MeshLevel::Coarse, true).len(), 8 + 6 + 3);
    }
}
