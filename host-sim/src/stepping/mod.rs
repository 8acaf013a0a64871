//! Quasi-static stepping of the whole drive: state, travelling-wave predictor, Newton, paths.

mod error;
mod newton;
mod predictor;
mod problem;
mod state;

pub use error::SolveError;
pub use newton::{Effort, Increment, Solver};
pub use problem::{Problem, SolverSettings};
pub use state::State;
