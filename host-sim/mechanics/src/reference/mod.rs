//! Closed forms to hold the simulation against, each with its source and its own tests.
//!
//! Used by tests and by the validation; no part of the simulation itself.

mod tooth_path;

pub use tooth_path::{ToothPath, ToothPathPoint};
