//! Compensation tables: from a drive, or from samples, to the image that firmware reads.
//!
//! ```text
//! drive -> torque_nodes -> sweep, turns -> samples -> project -> image (.fxt), info (.json), source_files (.rs, .h)
//!                                             ^                    |
//!                         another program, a bench                 +-> validate: against fresh FEM; replay: over measured rows
//! ```

mod info;
pub mod make;
mod positions;
mod project;
pub mod replay;
pub mod samples;
mod source_files;
pub mod sweep;
pub mod torque_nodes;
pub mod turns;
pub mod validate;

pub use info::{MadeTable, Source, TableInfo, TurnsAtTorque, TurnsInfo};
pub use make::{MakeError, TableProgress, TableSettings, TorqueNodes, make};
pub(crate) use positions::places_that_tell_apart;
pub(crate) use project::from_plan;
pub use project::{SampleOptions, TableError, core_drive, core_kind, from_samples, from_sweep};
pub use source_files::{c_header, rust_source};
