//! Compensation of strain wave (harmonic) drives on a microcontroller.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    warn(
        clippy::indexing_slicing,
        clippy::arithmetic_side_effects,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic
    )
)]

#[cfg(any(test, feature = "std"))]
extern crate std;

mod angle;
mod drive;
mod error;
#[cfg(test)]
mod fixture;
pub mod grid;
mod hysteresis;
mod image;
mod model;
pub mod precompute;
mod table;

pub use angle::{GeneratorAngle, OutputAngle};
pub use drive::{Drive, FixedMember, Phases};
pub use error::{DriveError, Field, ImageError};
pub use hysteresis::{Direction, PlayState, SAVED_STATE_BYTES};
pub use image::{
    FORMAT_VERSION, MAX_ERROR_RAD, MAX_RIPPLE_NODES, MAX_TEMPERATURE_NODES, PAGE_BYTES, Provenance,
    TEXT_BYTES, TableData, WriteError, image_bytes, write_image,
};
pub use model::{Approach, Command, INVERSE_ITERATIONS, Prediction};
pub use table::{Bounds, GeneratorKind, Quality, Table, TableId};
