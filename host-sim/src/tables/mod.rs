//! Compensation tables: from a drive, or from samples, to the image that firmware reads.
//!
//! ```text
//! drive -> torque_nodes -> sweep, turns -> samples -> project -> image (.fxt), info (.json), source_files (.rs, .h)
//!                                             ^                    |
//!                         another program, a bench                 +-> validate: against fresh FEM; replay: over measured rows
//! ```

mod info;
pub(crate) mod make;
mod positions;
mod project;
pub(crate) mod replay;
pub mod samples;
mod source_files;
pub(crate) mod sweep;
pub(crate) mod torque_nodes;
pub(crate) mod turns;
mod turns_off;
pub(crate) mod validate;

pub use info::{MadeTable, Source, TableInfo, TurnsAtTorque, TurnsInfo};
pub use make::{MakeError, TableObserver, TableProgress, TableSettings, TorqueNodes, make};
pub(crate) use positions::places_that_tell_apart;
pub(crate) use project::from_plan;
pub use project::{SampleOptions, TableError, core_drive, core_kind, from_samples, from_sweep};
pub use replay::{
    MeasuredRow, MeasurementError, OtherRows, ReplaySummary, ReplayedRow, RowsOf, parse as parse_measured, replay,
};
pub(crate) use source_files::put_bytes;
pub use source_files::{c_header, rust_source};
pub use sweep::{SweepError, SweepPlan, SweepProgress, symmetric_nodes};
pub use torque_nodes::NodeChoice;
pub(crate) use torque_nodes::{accepted, refined};
pub use turns_off::TurnsOff;
pub use validate::{ValidateError, Validation, ValidationSettings, validate};

use flexspline::Table;

/// Torque below which a table leaves the output inside its clearance, N·m: where its axis jumps.
pub fn dead_zone_n_m(table: &Table<'_>) -> f64 {
    let nodes: Vec<f32> = table.torque_nodes_n_m().collect();
    (0..nodes.len().saturating_sub(1))
        .filter(|node| table.is_torque_jump(*node))
        .map(|node| f64::from(nodes[node].midpoint(nodes[node + 1])).abs())
        .fold(0.0, f64::max)
}
