//! Quasi-static stepping of the whole drive: state, travelling-wave predictor, Newton, paths.

mod continuation;
mod convergence;
mod error;
mod fast;
mod line_search;
mod near;
mod newton;
mod passed;
mod predictor;
mod problem;
mod reference;
mod slip;
mod state;
mod step;
mod waves;
mod wheels;

pub use error::SolveError;
pub use fast::CondensedDrive;
pub use newton::{Face, Increment, Solver};
pub use problem::{Holding, Method, Problem, SolverSettings};
pub use state::State;
