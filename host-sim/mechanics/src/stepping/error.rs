//! Why an increment failed.

use crate::drive::DriveError;
use crate::mesh::MeshError;
use thiserror::Error;

/// A run that could not be completed. Not converging is an ordinary result and carries its history.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SolveError {
    /// The drive is impossible.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// The mesh is impossible.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// Newton did not converge, not even in the smallest increment.
    #[error(
        "{} at generator angle {generator_rad:.6} rad, load {torque_n_m} N·m: {reason}{}{}",
        if softened_to.is_some() { GIVES_WAY } else { UNSOLVED },
        beyond(*torque_n_m, *reached_n_m),
        meaning(*torque_n_m, *softened_to)
    )]
    NotConverged {
        /// Where, rad.
        generator_rad: f64,
        /// Under which load.
        torque_n_m: f64,
        /// The last load on the way for which there was an equilibrium, N m.
        reached_n_m: f64,
        /// Remaining stiffness of the output at that last load, as a share of the largest on the way, where it has
        /// fallen so far that the drive itself gives way. Missing where the solver failed on a drive that may well
        /// stand.
        softened_to: Option<f64>,
        /// Reason of the stop.
        reason: &'static str,
        /// Residual of each iteration relative to the contact forces.
        history: Vec<f64>,
    },
    /// The load pushes the rim out of the range of the model.
    #[error(
        "at generator angle {generator_rad:.6} rad and load {torque_n_m} N·m the rim leaves the range of the model: \
         {what}"
    )]
    OutOfRange {
        /// Where, rad.
        generator_rad: f64,
        /// Under which load.
        torque_n_m: f64,
        /// Which limit, with the value found and the limit.
        what: String,
    },
    /// The output does not follow the generator.
    #[error(
        "the drive has not settled after {pitches:.1} tooth pitches of motion one way, at generator angle \
         {generator_rad:.4} rad and load {torque_n_m} N·m: in the last increment the output turned by {rate:.3} of \
         what the ratio says; check the clearance between the teeth, or the drag, of the drive"
    )]
    NotSettled {
        /// Where, rad.
        generator_rad: f64,
        /// Under which load.
        torque_n_m: f64,
        /// Flexspline pitches that the generator has travelled one way.
        pitches: f64,
        /// Turn of the output in the last increment, as a share of what the ratio says.
        rate: f64,
    },
}

/// How the message of a load begins that the drive does not bear.
const GIVES_WAY: &str = "the drive gives way: no equilibrium";
/// How it begins where nothing is known of the drive.
const UNSOLVED: &str = "not solved";

/// Meaning of the failure for the drive.
fn meaning(torque_n_m: f64, softened_to: Option<f64>) -> String {
    match softened_to {
        Some(left) => format!(", where {:.0} % of the output's stiffness is left", 100.0 * left),
        None if torque_n_m == 0.0 => {
            "; this is a failure of the solver: without load an elastic drive stands".to_owned()
        }
        None => "; whether the drive stands there is not known".to_owned(),
    }
}

/// The last load that there was an equilibrium for, where a load came on.
fn beyond(torque_n_m: f64, reached_n_m: f64) -> String {
    if torque_n_m == reached_n_m { String::new() } else { format!("; the last load with one is {reached_n_m:.4} N·m") }
}

impl SolveError {
    /// Whether the drive is to blame, not the run.
    pub fn is_bad_input(&self) -> bool {
        matches!(self, SolveError::Drive(_) | SolveError::Mesh(_))
    }

    /// Relative residual of each iteration of the last attempt, for who wants to see how it went.
    pub fn residuals(&self) -> Option<String> {
        match self {
            SolveError::NotConverged { history, .. } => {
                Some(history.iter().map(|r| format!("{r:.1e}")).collect::<Vec<_>>().join(" "))
            }
            _ => None,
        }
    }
}
