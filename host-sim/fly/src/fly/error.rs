//! Why a joint with mass is not flown.

use flexspline_base::toml_file::Problem;
use flexspline_motion::flight::FlightError;

use super::OwnTableError;

/// A scenario that is refused, or one that cannot be flown.
#[derive(Debug, thiserror::Error)]
pub enum FlyError {
    /// The scenario's file: the first thing that is wrong with it.
    #[error("{0}")]
    Scenario(Problem),
    /// The drive does not carry the load.
    #[error("load: found up to {largest_n_m:.1} N·m, allowed: {most_n_m} N·m with {of}")]
    Load {
        /// Largest load of the scenario, N·m.
        largest_n_m: f64,
        /// Rated torque of the drive, or the largest of the table, N·m.
        most_n_m: f64,
        /// Which of them.
        of: String,
    },
    /// A table whose drive cannot be flown.
    #[error(transparent)]
    Table(#[from] OwnTableError),
    /// The flight itself.
    #[error(transparent)]
    Flight(#[from] FlightError),
}
