//! A drive drawn from tolerances by contact FEM.

use super::model::WAVE;
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
