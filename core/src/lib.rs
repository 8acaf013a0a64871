//! Compensation of strain wave (harmonic) drives on a microcontroller.
//!
//! A table says how far the output of a drive is from `generator / ratio`, at every generator angle, torque and
//! temperature, and on which side of its play it rests. This crate reads such a table in place, follows the play, and
//! tells which generator angle brings the output where it is wanted.
//!
//! # From `cargo add flexspline` to a compensated step
//! `flexspline tables` makes `cam.fxt`; the firmware has it twice, at two places of its flash. Then:
//! ```
//! use flexspline::*;
//!
//! const JOINT: Joint = {
//!     let Ok(drive) = Drive::new(188, 190, FixedMember::Flexspline) else { panic!() };
//!     let limits = Limits { tick_s: 1e-3, rate_rad_s: 0.05, acceleration_rad_s2: 5.0, generator_rate_rad_s: 600.0, patience: 5 };
//!     let Ok(joint) = Joint::new(drive, limits, Overrun::FadeOut { ticks: 50 }) else { panic!() };
//!     joint
//! };
//!
//! /// Once: nothing of an image is used before all of it is checked.
//! fn start(images: &Images, store: &mut Store, state: &mut JointState) -> Result<(), ActivateError> {
//!     store.activate(images, JOINT.drive(), 21.0)?;
//!     let _ = state.request(Mode::Tracking); // from off to tracking: legal
//!     Ok(())
//! }
//!
//! /// Every millisecond: what to command so that the output comes to `target`.
//! fn tick(images: &Images, store: &mut Store, state: &mut JointState, measured: GeneratorAngle, target: OutputAngle) -> GeneratorAngle {
//!     let input = Input { generator: Some(measured), target, torque_n_m: 12.0, missed_ticks: 0 };
//!     JOINT.tick(images, store, state, &input).command
//! }
//! # let data = TableData {
//! #     drive: *JOINT.drive(),
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
//! # let images = Images::new(&image, &image);
//! # let (mut store, mut state) = (Store::new(), JointState::new());
//! # start(&images, &mut store, &mut state).unwrap();
//! # let target = OutputAngle::from_rad(0.01).unwrap();
//! # let mut command = GeneratorAngle::ZERO;
//! # for _ in 0..500 {
//! #     command = tick(&images, &mut store, &mut state, command, target);
//! # }
//! # let reached = Table::check(&image).unwrap().forward(&mut state.play().clone(), command, 12.0, 20.0);
//! # assert!(reached.output.minus_rad(target).abs() < 2e-8, "{}", reached.output.minus_rad(target));
//! ```
//! In a slow rate group ([`RateGroup`]) the firmware tells the temperature ([`Store::set_temperature`]) and lets a few words of the
//! images be checked ([`Store::check_images`]). Where no loop runs, as on the host, [`Table`] alone answers: [`Table::forward`],
//! [`Table::inverse`].
//!
//! # Promises
//! * No heap, no panic, no `unsafe`: what flies links with a panic handler that cannot be linked.
//! * [`Joint::tick`] takes the same number of instructions in every tick with the same table (unless a glitch was believed or
//!   the state was hit by an upset): 1544 on a Cortex-M4F with the tables of cam, double disc and four rollers, 1775 with that of
//!   two rollers, of them 570 for forward and 769 or 1005 for inverse if called alone. No loop depends on data, no libm is called.
//! * The two copies of what a tick reads are compared as they are read. A tick that read something doubtful says so and does not
//!   use it ([`store`](Store)).
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
//! Elastic oscillation and rate-dependent friction: the table is quasi-static.
#![no_std]
#![cfg_attr(not(feature = "c-api"), forbid(unsafe_code))]
#![cfg_attr(feature = "c-api", deny(unsafe_code))]
#![cfg_attr(
    not(test),
    deny(
        clippy::indexing_slicing,
        clippy::arithmetic_side_effects,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::unreachable,
        clippy::todo,
        clippy::unimplemented
    )
)]

#[cfg(any(test, feature = "std"))]
extern crate std;

mod angle;
#[cfg(all(feature = "c-api", not(feature = "fuzzing")))]
mod c_api;
#[cfg(all(feature = "c-api", feature = "fuzzing"))]
#[doc(hidden)]
#[allow(clippy::not_unsafe_ptr_arg_deref)] // As C calls them; public for `tests/fuzz` alone.
pub mod c_api;
mod drive;
mod error;
#[cfg(test)]
mod fixture;
pub mod grid;
mod hysteresis;
mod image;
mod model;
pub mod precompute;
mod predictor;
mod runtime;
mod slip;
mod store;
mod table;
mod upload;
mod windup;

pub use angle::{GeneratorAngle, OutputAngle};
pub use drive::{Drive, FixedMember, Phases};
pub use error::{DriveError, Field, ImageError};
pub use hysteresis::{Direction, PlayState, SAVED_STATE_BYTES};
#[cfg(feature = "fuzzing")]
#[doc(hidden)]
pub use image::reseal;
pub use image::{
    FORMAT_VERSION, MAX_ERROR_RAD, MAX_RIPPLE_NODES, MAX_TEMPERATURE_NODES, PAGE_BYTES, Provenance, TEXT_BYTES,
    TableData, WriteError, image_bytes, write_image,
};
pub use model::{Approach, Command, INVERSE_TOLERANCE_RAD, MAX_INVERSE_ERROR_RAD, MAX_INVERSE_ITERATIONS, Prediction};
pub use predictor::{Ahead, Inertias, Measured, Noise, PREDICTOR_PARTS, Predictor, PredictorError, PredictorState};
pub use runtime::{
    Flags, Input, Joint, JointState, Limits, Mode, ModeError, Output, Overrun, RateGroup, SAVED_JOINT_BYTES,
    SettingError,
};
pub use slip::{Slip, SlipBank, SlipElement, SlipState};
pub use store::{ActivateError, Counters, Health, Images, STORE_PAGES, STORE_WORDS, Store, mend_page};
pub use table::{Bounds, GeneratorKind, OperatingPoint, Quality, Table, TableId};
pub use upload::{Upload, UploadError};
