//! Response of a drive to its tolerances by contact FEM: kernels of what acts tooth by tooth and of displaced axes, and
//! a parabola for each field that changes the drive uniformly.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::PlanError;
use super::draw::Drawn;
use super::model::{Parabola, Response, SHEET, WAVE, displaces};
use super::plan::{HowComputed, SweepProgress};
use super::tolerance::{FieldTolerance, ToleranceActs, Tolerances};
use crate::data_sheet::{FIGURES, Loads, data_sheet};
use crate::kernels::{KernelError, KernelPlan, make};
use flexspline_mechanics::drive::Drive;
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Problem, SolveError, SolverSettings};

/// The parabola of a uniform change is taken at the value that this share of the drives lies below, and at its mirror.
const OUTER_SHARE: f64 = 0.05;
/// Lost motion is measured between this share of the rated load either way, as in catalogues, and at most half of the
/// load of the tolerances.
const LIGHT: [f64; 2] = [0.04, 0.5];
/// Positions over the tooth pitch of a data sheet.
const SHEET_POSITIONS: usize = 4;
/// Share of the drives whose displacements the kernels have to reach. Where teeth wedge further out, at limits that one
/// drive in millions meets, kernels are extrapolated, and `reduce` counts the drives beyond.
const NEARLY_ALL: f64 = 0.99;
/// Displacement (µm for a millimetre of module) and directions of kernels that no tolerance asks for: the fewest.
const UNUSED: (f64, usize) = (20.0, 4);

/// The load and the light load of lost motion, N·m.
fn torques_n_m(of: &Tolerances) -> [f64; 2] {
    let rated = of.drive.rated_torque_n_m(of.generator);
    [of.torque_n_m, (LIGHT[0] * rated).min(LIGHT[1] * of.torque_n_m)]
}

/// Kernels and response.
///
/// # Errors
/// The middle of the tolerances makes no drive, or the FEM finds no equilibrium.
pub(super) fn respond(
    of: &Tolerances,
    solver: SolverSettings,
    progress: &SweepProgress<'_>,
) -> Result<HowComputed, PlanError> {
    let drawn_as = uniform(of, &Drawn::middle(&of.list))?;
    let plan = kernel_plan(of);
    let alike = of.list.iter().filter(|tolerance| tolerance.acts == ToleranceActs::Alike).count();
    let steps = plan.steps() + 1 + 2 * alike;
    let kernels = make(&drawn_as, of.generator, &plan, solver, &|done| {
        progress(done, steps, &format!("kernels, {}", of.generator));
    })
    .map_err(|error| kernels_failed(of, &error))?;
    let step = |done| progress(plan.steps() + done, steps, &format!("sheets, {}", of.generator));
    let response = response(of, solver, &step)?;
    Ok(HowComputed::Kernels { torques_n_m: torques_n_m(of), kernels: Box::new(kernels), response })
}

/// The drive with the uniform changes of `drawn` alone.
fn uniform(of: &Tolerances, drawn: &[Drawn]) -> Result<Drive, PlanError> {
    let mut drive = of.drive_with(drawn).map_err(|error| PlanError::BadInput(error.to_string()))?;
    drive.as_built = drive.as_built.uniform_part();
    Ok(drive)
}

/// Kernels at the loads of the tolerances, and displacements up to their limits.
fn kernel_plan(of: &Tolerances) -> KernelPlan {
    let [torque, light] = torques_n_m(of);
    let usual = KernelPlan::for_drive(&of.drive, of.generator);
    let displacing = || of.list.iter().filter(|t| displaces(t)).map(|t| t.distribution);
    let reach: f64 = displacing().map(|distribution| distribution.limits[1]).sum();
    let (sizes_um, directions) = if reach > 0.0 {
        (usual.sizes_to(reach), usual.directions)
    } else {
        (vec![UNUSED.0 * of.drive.flexspline.module_mm], UNUSED.1)
    };
    KernelPlan {
        torques_n_m: vec![light, torque],
        sizes_um,
        enough_um: Some(displacing().map(|distribution| distribution.quantile(NEARLY_ALL)).sum()),
        directions,
        temperature_c: Some(of.temperature_c),
        ..usual
    }
}

/// Why kernels failed: which tolerances ask for the displacement, and the remedy.
fn kernels_failed(of: &Tolerances, error: &KernelError) -> PlanError {
    let kind = of.generator;
    let KernelError::Displaced { reached_um, .. } = error else {
        return PlanError::Failed(format!("{kind}: kernels of the drive as drawn: {error}"));
    };
    let displacing = of.list.iter().filter(|t| displaces(t)).map(|t| {
        let most = t.distribution.quantile(NEARLY_ALL);
        format!("{} (99 of 100 drives up to {most:.1} um)", t.field)
    });
    PlanError::Failed(format!(
        "{kind}: {}: {error}. The teeth wedge: give narrower limits (limits = [0, {reached_um:.3}] together), or the \
         drive more clearance (flanks.preload_um below 0), or a generator bearing that yields \
         (generator.bearing_stiffness_n_per_mm3)",
        displacing.collect::<Vec<_>>().join(" and ")
    ))
}

/// State of the middle drive, and a parabola for each field that changes the drive uniformly.
fn response(of: &Tolerances, solver: SolverSettings, step: &(dyn Fn(usize) + Sync)) -> Result<Response, PlanError> {
    let middle = Drawn::middle(&of.list);
    let alike = || of.list.iter().enumerate().filter(|(_, tolerance)| tolerance.acts == ToleranceActs::Alike);
    let ends = |(t, tolerance): (usize, &FieldTolerance)| {
        [OUTER_SHARE, 1.0 - OUTER_SHARE].map(|share| Some((t, tolerance.distribution.quantile(share))))
    };
    let jobs: Vec<Option<(usize, f64)>> = [None].into_iter().chain(alike().flat_map(ends)).collect();
    let done = AtomicUsize::new(0);
    let state_of = |job: &Option<(usize, f64)>| {
        let mut drawn = middle.clone();
        if let Some((t, value)) = job {
            drawn[*t].value = *value;
        }
        let state = state(of, &uniform(of, &drawn)?, solver).map_err(|error| {
            let which = job.map_or("the middle drive".to_owned(), |(t, v)| format!("{} = {v}", of.list[t].field));
            PlanError::Failed(format!("{}, {which}: {error}", of.generator))
        });
        step(done.fetch_add(1, Ordering::Relaxed) + 1);
        state
    };
    let states = jobs.par_iter().with_max_len(1).map(state_of).collect::<Result<Vec<Vec<f64>>, PlanError>>()?;
    let change = |k: usize| -> Vec<f64> { states[k].iter().zip(&states[0]).map(|(a, b)| a - b).collect() };
    let parabolas = alike().enumerate().map(|(k, (t, FieldTolerance { field, distribution, .. }))| {
        let [low, high] = [OUTER_SHARE, 1.0 - OUTER_SHARE].map(|share| distribution.quantile(share));
        let at = [low, middle[t].value, high];
        Parabola { field: field.clone(), at, below: change(1 + 2 * k), above: change(2 + 2 * k) }
    });
    Ok(Response { middle: states[0].clone(), parabolas: parabolas.collect() })
}

/// State of a drive: settled errors under both loads, and the sheet.
fn state(of: &Tolerances, drive: &Drive, solver: SolverSettings) -> Result<Vec<f64>, SolveError> {
    let kind = of.generator;
    let problem = Problem::new(drive, kind, of.temperature_c, solver)?;
    let mut state = Vec::new();
    for torque_n_m in torques_n_m(of) {
        state.extend(wave(&problem, torque_n_m)?);
    }
    let loads = Loads::up_to(drive.rated_torque_n_m(kind));
    let (sheet, done) = data_sheet(drive, kind, of.temperature_c, loads, SHEET_POSITIONS, solver);
    done?;
    let figure = |name: &str| FIGURES.iter().find(|(known, _)| *known == name).and_then(|(_, of)| of(&sheet));
    state.extend(SHEET.iter().map(|name| figure(name).unwrap_or(f64::NAN)));
    Ok(state)
}

/// Error in settled motion at even places over a tooth pitch, from whole pitches on, arcsec.
fn wave(problem: &Problem, torque_n_m: f64) -> Result<[f64; WAVE], SolveError> {
    let step = problem.flexspline.pitch() / WAVE as f64;
    let mut motion = Motion::deformed(problem, -step)?;
    motion.load(torque_n_m)?;
    motion.settle(step)?;
    let settled = (motion.state().generator_rad / step).round() as usize;
    let mut errors = [0.0; WAVE];
    for position in settled + 1..=settled + WAVE {
        motion.turn_to(position as f64 * step)?;
        errors[position % WAVE] = motion.error_arcsec();
    }
    Ok(errors)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The message names the tolerance that wedges the teeth, and how far it may go.
    #[test]
    fn kernels_that_fail_name_the_tolerance_and_how_far_it_may_go() {
        let text = "drive = \"HHD-95\"\ngenerator = \"cam\"\ntorque_n_m = 5\n[[tolerance]]\nfield = \
                    \"as_built.circular_spline_eccentricity_um\"\ndistribution = \"rayleigh\"\nstd = 5\n";
        let of = Tolerances::read("t.toml", text, |name| Drive::built_in(name).ok_or("no drive")).unwrap();
        let reason = SolveError::NotConverged {
            generator_rad: 0.0,
            torque_n_m: 0.0,
            reached_n_m: 0.0,
            softened_to: None,
            reason: "the iterations ran out",
            history: Vec::new(),
        };
        let error = KernelError::Displaced { size_um: 27.5, reached_um: 17.0, reason };
        let said = kernels_failed(&of, &error).to_string();
        for words in [
            "as_built.circular_spline_eccentricity_um (99 of 100 drives up to 15.2 um)",
            "limits = [0, 17",
            "27.5 um beside its axis",
        ] {
            assert!(said.contains(words), "{words}: {said}");
        }
    }
}
