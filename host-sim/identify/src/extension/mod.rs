//! The findings of a diagnosis as a model that the simulator loads again, and as tables that the core compensates with.
//!
//! * [`Model`]: `drive-extended.toml` of a catalogue drive: the nominal model recalibrated, and `[[extension.cause]]`
//!   entries.
//! * `FoundGeometry`: causes that are geometry, as `[as_built]` of a drive that the FEM runs.
//! * `ExtendedTables`: tables of the extended model, sampled in steady motion at the nodes of a table.
//! * [`evaluate`]: what the core leaves of the error in sessions that took no part in the fit, without tables, with
//!   nominal, calibrated and extended ones.

mod compensation;
mod geometry;
mod model;
mod sampled;

pub use compensation::{Evaluation, NotApplied, TableKind, evaluate, left_by_core, split};
pub(crate) use compensation::{less, without_zero};
pub(crate) use geometry::{Placing, found_geometry};
pub use model::{CauseEntry, Model, causes_in, causes_to_toml};
pub(crate) use sampled::ExtendedTables;
