//! A drive drawn from tolerances by contact FEM.

use super::model::{WAVE, spread};
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Problem, SolveError, SolverSettings};

/// Load, temperature and method of a computation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Conditions {
    /// The generator.
    pub kind: GeneratorKind,
    /// Temperature, °C.
    pub temperature_c: f64,
    /// Load, N·m.
    pub torque_n_m: f64,
    /// The numerical method.
    pub solver: SolverSettings,
}

/// Figures of a drive by FEM, in the order of the columns of results.
pub(super) const FEM_FIGURES: [&str; 2] = ["fem_places_pp_arcsec", "fem_places_rms_arcsec"];

/// Error of a drive deformed afresh at each generator angle and loaded: peak to peak and root mean square, arcsec.
pub(super) fn figures(
    drive: &Drive,
    at: Conditions,
    angles_rad: impl Iterator<Item = f64>,
) -> Result<[f64; 2], SolveError> {
    let problem = Problem::new(drive, at.kind, at.temperature_c, at.solver)?;
    let errors = angles_rad
        .map(|angle| {
            let mut motion = Motion::deformed_or_turned_in(&problem, angle)?;
            motion.load(at.torque_n_m)?;
            Ok(motion.error_arcsec())
        })
        .collect::<Result<Vec<f64>, SolveError>>()?;
    let (pp, rms) = spread(&errors);
    Ok([pp, rms])
}

/// Error in settled motion at even places over a tooth pitch, from whole pitches on, arcsec.
pub(super) fn wave(drive: &Drive, at: Conditions) -> Result<Vec<f64>, SolveError> {
    let problem = Problem::new(drive, at.kind, at.temperature_c, at.solver)?;
    let step = problem.flexspline.pitch() / WAVE as f64;
    let mut motion = Motion::deformed(&problem, -step)?;
    motion.load(at.torque_n_m)?;
    motion.settle(step)?;
    let settled = (motion.state().generator_rad / step).round() as usize;
    let mut errors = vec![0.0; WAVE];
    for position in settled + 1..=settled + WAVE {
        motion.turn_to(position as f64 * step)?;
        errors[position % WAVE] = motion.error_arcsec();
    }
    Ok(errors)
}
