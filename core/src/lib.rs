//! Compensation of strain wave (harmonic) drives on a microcontroller.
//!
//! A table says how far the output of a drive is from `generator / ratio`, at every generator angle, torque and
//! temperature, and on which side of its play it rests. This crate reads such a table in place, follows the play, and
//! tells which generator angle brings the output where it is wanted.
//!
//! ```
//! use flexspline::{Approach, GeneratorAngle, ImageError, OutputAngle, PlayState, Quality, Table};
//!
//! // Once: nothing of an image can be used before all of it is checked.
//! fn accept(image: &[u8]) -> Result<Table<'_>, ImageError> {
//!     Table::check(image)
//! }
//!
//! // Every tick: follow the play with the measured generator angle, then ask what to command.
//! fn tick(table: &Table, play: &mut PlayState, measured: GeneratorAngle, target: OutputAngle) -> GeneratorAngle {
//!     let (torque_n_m, temperature_c) = (12.0, 21.5);
//!     let now = table.forward(play, measured, torque_n_m, temperature_c);
//!     if now.quality == Quality::Disabled {
//!         return table.drive().nominal_generator(target);
//!     }
//!     table.inverse(target, torque_n_m, temperature_c, Approach::From(play)).generator
//! }
//! # use flexspline::{Drive, FixedMember, GeneratorKind, Provenance, TableData, image_bytes, write_image};
//! # let data = TableData {
//! #     drive: Drive::new(188, 190, FixedMember::Flexspline).unwrap(),
//! #     torque_nodes_n_m: &[-20.0, 20.0], temperature_nodes_c: &[20.0], ripple_nodes: 0,
//! #     mean_rad: &[-1e-3, 1e-3], half_width_rad: &[1e-4, 1e-4],
//! #     mean_ripple_rad: &[], half_width_ripple_rad: &[],
//! #     generator_curve_rad: &[], material_curve_rad: &[], output_curve_rad: &[],
//! #     projection_worst_rad: 0.0, projection_rms_rad: 0.0,
//! # };
//! # let provenance = Provenance {
//! #     generator_kind: GeneratorKind::Cam, drive_hash: [0; 32], tool_version: "doc", mesh_level: "none",
//! #     solver_residual: 0.0, torque_range_n_m: [-20.0, 20.0], temperature_range_c: [0.0, 40.0],
//! #     error_limit_rad: 0.02,
//! # };
//! # let mut image = vec![0; image_bytes(2, 1, 0, [0; 3])];
//! # write_image(&data, &provenance, &mut image, |_| [0; 8]).unwrap();
//! # let table = accept(&image).unwrap();
//! # let mut play = PlayState::unknown();
//! # let target = OutputAngle::from_rad(0.01).unwrap();
//! # let mut command = GeneratorAngle::ZERO;
//! # for _ in 0..3 {
//! #     command = tick(&table, &mut play, command, target);
//! # }
//! # let reached = table.forward(&mut play, command, 12.0, 21.5);
//! # assert!(reached.output.minus_rad(target).abs() < 1e-8 && reached.uncertainty_rad == 0.0);
//! ```
//!
//! # Promises
//! * No heap, no panic, no `unsafe`. [`Table::step`], [`Table::forward`] and [`Table::inverse`] loop a number of times that is
//!   fixed when the table is accepted, search in a fixed number of comparisons, and call no libm.
//! * A damaged or hostile image gives an [`ImageError`], never a wrong correction. What a table can give at most is bounded
//!   from its coefficients when it is accepted, for every input and not only at nodes.
//! * NaN or infinity in torque or temperature gives [`Quality::Disabled`] and no correction.
//! * Angles are integers: turning for years, or a million small steps, adds no error.
//! * The host makes tables with the code that reads them: one definition of where a node sits ([`grid`]), and the
//!   deviation from the samples is measured on the finished image ([`precompute`]).
//!
//! # Signs and units
//! * Angles in radians at the interface, positive counter-clockwise; torque N·m, temperature °C.
//! * `transmission_error = actual − ideal` at the output. `command_correction = −predicted_error·ratio`
//!   ([`Drive::corrected_command`]).
//! * The ratio is signed: `+cs/(cs − fs)` with the flexspline fixed, `−fs/(cs − fs)` with the circular spline fixed.
//! * Positive load torque turns the output forward and gives positive wind-up.
//! * A [`Direction`] is that of the output, in samples ([`precompute::Sample::direction`], a column `direction`: +1 where the
//!   output turns forward, −1 where backward) as in the play; with the circular spline fixed the generator turns against it.
//!
//! # Not in here
//! Elastic oscillation and rate-dependent friction: the table is quasi-static. The rate of a correction is not limited.
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
mod runtime;
mod store;
mod table;
mod upload;
mod windup;

pub use angle::{GeneratorAngle, OutputAngle};
pub use drive::{Drive, FixedMember, Phases};
pub use error::{DriveError, Field, ImageError};
pub use hysteresis::{Direction, PlayState, SAVED_STATE_BYTES};
pub use image::{
    FORMAT_VERSION, MAX_ERROR_RAD, MAX_RIPPLE_NODES, MAX_TEMPERATURE_NODES, PAGE_BYTES, Provenance, TEXT_BYTES,
    TableData, WriteError, image_bytes, write_image,
};
pub use model::{Approach, Command, INVERSE_TOLERANCE_RAD, MAX_INVERSE_ERROR_RAD, MAX_INVERSE_ITERATIONS, Prediction};
pub use runtime::{
    Flags, Input, Joint, JointState, Limits, Mode, ModeError, Output, Overrun, RateGroup, SAVED_JOINT_BYTES,
    SettingError,
};
pub use store::{ActivateError, Counters, Health, Images, STORE_WORDS, Store, mend_page};
pub use table::{Bounds, GeneratorKind, OperatingPoint, Quality, Table, TableId};
pub use upload::{Upload, UploadError};
