//! Compensation tables: from a drive, or from samples, to the image that firmware reads.
//!
//! ```text
//! drive -> torque_nodes -> sweep, turns -> samples -> project -> image (.fxt), info (.json), source_files (.rs, .h)
//!                                             ^                    |
//!                         another program, a bench                 +-> validate: fresh FEM; replay: measured rows
//! ```

mod complete;
mod info;
pub(crate) mod make;
mod positions;
mod project;
pub mod samples;
mod source_files;
pub mod sweep;
pub(crate) mod torque_nodes;
pub(crate) mod turns;
pub mod validate;

pub use complete::{Completed, CompletionError, MissingSpring, SheetStiffness, SlipSpring};
pub use info::{MadeTable, Source, TableInfo, TurnsAtTorque, TurnsInfo};
pub use make::{MakeError, TableObserver, TableProgress, TableSettings, make};
pub use positions::places_that_tell_apart;
pub use project::{
    PARTS_OF_A_TURN, SampleOptions, TableError, core_drive, core_kind, empirical_percent, from_plan, from_samples,
    parts_between, was_recorded,
};
pub use source_files::put_bytes;
pub use source_files::{c_header, rust_source};
pub use sweep::{SweepProgress, TorqueSweepError};
pub use torque_nodes::NodeChoice;
pub use torque_nodes::{Refined, accepted, refined};
pub use validate::{ValidateError, Validation, ValidationSettings, generator_of, validate};

use flexspline::Table;

/// Torque below which a table leaves the output inside its clearance, N·m: where its axis jumps.
pub fn dead_zone_n_m(table: &Table<'_>) -> f64 {
    let nodes: Vec<f32> = table.torque_nodes_n_m().collect();
    (0..nodes.len().saturating_sub(1))
        .filter(|node| table.is_torque_jump(*node))
        .map(|node| f64::from(nodes[node].midpoint(nodes[node + 1])).abs())
        .fold(0.0, f64::max)
}
