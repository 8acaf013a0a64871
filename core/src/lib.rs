//! Compensation of strain wave (harmonic) drives on a microcontroller.
//!
//! A table says how far the output of a drive is from `generator / ratio`, at every generator angle, torque and
//! temperature, and on which side of its play it rests. This crate reads such a table in place, follows the play, and
//! gives the generator angle that brings the output where it is wanted.
//!
//! # From `cargo add flexspline` to a compensated step
//! `flexspline tables` makes `cam.fxt`; the firmware has it twice, at two places of its flash. Then:
//! ```
//! use flexspline::*;
//!
//! const JOINT: Joint = {
//!     let Ok(drive) = Drive::new(188, 190, FixedMember::Flexspline) else { panic!() };
//!     let limits = Limits {
//!         tick_s: 1e-3, rate_rad_s: 0.05, acceleration_rad_s2: 5.0, generator_rate_rad_s: 600.0, debounce_ticks: 5,
//!         deadband_rad: 1e-6,
//!     };
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
//! fn tick(
//!     images: &Images, store: &mut Store, state: &mut JointState, measured: GeneratorAngle, target: OutputAngle,
//! ) -> GeneratorAngle {
//!     let input = Input {
//!         generator: Some(measured), target, torque_n_m: 12.0, missed_ticks: 0, adjustment: Adjustment::default(),
//!     };
//!     JOINT.tick(images, store, state, &input).command
//! }
//! # let image = *include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/src/fixtures/short.fxt"));
//! # let twin = image.clone();
//! # let images = Images::new(&image, &twin);
//! # let (mut store, mut state) = (Store::new(), JointState::new());
//! # start(&images, &mut store, &mut state).unwrap();
//! # let target = OutputAngle::from_rad(0.01).unwrap();
//! # let mut command = GeneratorAngle::ZERO;
//! # for _ in 0..500 {
//! #     command = tick(&images, &mut store, &mut state, command, target);
//! # }
//! # let reached = Table::check(&image).unwrap().forward(&mut state.play().clone(), command, 12.0, 21.0);
//! # assert!(reached.output.minus_rad(target).abs() < 2e-8, "{}", reached.output.minus_rad(target));
//! ```
//! [`Encoder`] converts the counts of an encoder into an angle, and back: any counts in a turn, registers that begin
//! anew, no drift; that of the generator is read by [`Joint::read`], with which a wrong bit moves no turn. In a slow
//! rate group, such as every hundredth tick, the firmware sets the temperature ([`Store::set_temperature`]) and lets a
//! few words of the images be checked ([`Store::check_images`]). Where no loop runs, as on the host, [`Table`] alone
//! answers: [`Table::forward`], [`Table::inverse`].
//!
//! # The crates next to this one
//! Motion of the drive that its table does not have goes into the [`Adjustment`] of the next tick, from whatever knows
//! of it. None of them flies in the tick itself:
//!
//! | crate | contents |
//! |---|---|
//! | `flexspline-estimation` | online calibration, Maxwell slip, a two-mass observer |
//! | `flexspline-telemetry` | records for the ground, events |
//! | `flexspline-make` | from samples to a table |
//! | `flexspline-c` | all of them from C |
//!
//! # Promises
//! * No heap, no panic, no `unsafe`: what flies links with a panic handler that cannot be linked.
//! * [`Joint::tick`] takes the same number of instructions in every tick with the same table (unless a glitch was
//!   believed, there was no sample yet, something was hit by an upset, or the images differ): 1658 on a Cortex-M4F with
//!   the tables of all four generators and a joint that is a constant; forward alone 595, inverse alone 639. No loop
//!   depends on data, no libm is called.
//! * The two copies of what a tick reads are compared as they are read; settings, state and what is known of the table
//!   are kept twice with sums. A tick that finds something not whole mends it, says so, and is done again; what cannot
//!   be mended is not used ([`Flags`], [`store`](Store)).
//! * A table is checked and filled in, in steps of at most 2000 instructions between ticks ([`Activation`]); so is
//!   found out whether it is the one of its id ([`IdentityCheck`]).
//! * A torque or temperature that is too old is not used ([`Aged`]).
//! * A damaged image gives an [`ImageError`]. What a table can give at most is bounded from its coefficients when it is
//!   accepted, for every input and not only at nodes: a hostile image can give no more either.
//! * NaN or infinity in torque or temperature gives [`Quality::Disabled`] and no correction; such a temperature
//!   activates nothing.
//! * Which side of the play the drive rests on is unknown after a reset, until motion has shown it.
//! * Angles are integers: turning for years, or a million small steps, adds no error.
//! * The host makes tables with the code that reads them: one definition of where a node sits ([`grid`](shared::grid)),
//!   and the deviation from the samples is measured on the finished image (`flexspline-make`).
//!
//! # Signs and units
//! * Angles in radians at the interface, positive counter-clockwise; torque N·m, temperature °C.
//! * `transmission_error = actual − ideal` at the output. `command_correction = −predicted_error·ratio`.
//! * The ratio is signed: `+cs/(cs − fs)` with the flexspline fixed, `−fs/(cs − fs)` with the circular spline fixed.
//! * Positive load torque turns the output forward and gives positive wind-up.
//! * A [`Direction`] is that of the output, in samples (of `flexspline-make`, a column `direction`: +1 where the
//!   output turns forward, −1 where backward) as in the play; with the circular spline fixed the generator turns
//!   against it.
//!
//! # Not in here
//! Rate-dependent friction. The table is quasi-static; elastic oscillation is for `flexspline-estimation`.
#![no_std]
#![forbid(unsafe_code)]
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

#[cfg(any(test, feature = "testing"))]
extern crate std;

/// `?` in a constant.
macro_rules! tried {
    ($result:expr) => {
        match $result {
            Ok(value) => value,
            Err(error) => return Err(error),
        }
    };
}

/// An enum that is kept, or shown, as a number.
macro_rules! numbered {
    ($(#[$doc:meta])* $vis:vis enum $name:ident { $($(#[$of:meta])* $variant:ident,)* }) => {
        $(#[$doc])*
        $vis enum $name {
            $($(#[$of])* $variant,)*
        }

        impl $name {
            const ALL: [Self; [$(Self::$variant),*].len()] = [$(Self::$variant),*];

            /// The one of a number, if there is one.
            fn numbered(number: u32) -> Option<Self> {
                Self::ALL.get(number as usize).copied()
            }
        }
    };
    // With its number in public: of images, of telemetry, of the C interface.
    (coded $(#[$doc:meta])* $vis:vis enum $name:ident $variants:tt) => {
        numbered! { $(#[$doc])* $vis enum $name $variants }

        impl $name {
            /// As a number.
            #[must_use]
            pub const fn code(self) -> u8 {
                self as u8
            }

            /// From its number, if it is one.
            #[must_use]
            pub fn from_code(code: u8) -> Option<Self> {
                Self::numbered(u32::from(code))
            }
        }
    };
}

/// What has bits that an upset may flip: for campaigns alone.
macro_rules! bits_of {
    ($($type:tt)*) => {
        #[cfg(any(test, feature = "testing"))]
        crate::upset::upsets!($($type)*);
    };
}

mod angle;
mod crc;
mod drive;
mod encoder;
mod error;
#[cfg(any(test, feature = "testing"))]
mod fixture;
mod joint;
mod num;
#[cfg(feature = "parts")]
#[doc(hidden)]
pub mod parts;
mod play;
mod self_test;
pub mod shared;
mod store;
mod table;
#[cfg(any(test, feature = "testing"))]
#[doc(hidden)]
pub mod testing;
mod unit;
#[cfg(any(test, feature = "testing"))]
mod upset;
mod whole;

pub use angle::{GeneratorAngle, OutputAngle};
pub use drive::{Drive, FixedMember, Phases};
pub use encoder::{Encoder, EncoderError, EncoderSettings, EncoderState, EncoderWrap};
pub use error::{DriveError, Field, ImageError};
pub use joint::{
    Adjustment, Aged, Flags, Implausible, Input, Joint, JointState, Limits, Located, Mode, ModeError, Output, Overrun,
    Readings, RestoreError, SettingError, StartUp, StartUpSettings, StartUpStep, TorqueFromWindUp, TorquePath,
    TorqueReading, TorqueSettings,
};
pub use play::{Direction, PlayState};
pub use self_test::{SelfTestError, self_test};
pub use store::{ActivateError, Activation, Counters, Health, Images, Progress, Store, Upload, UploadError};
pub use table::{Approach, Command, GeneratorKind, Identity, IdentityCheck, Prediction, Quality, Table, TableId};
pub use unit::{Arcsec, Degrees};

// The writer of images is that of `flexspline-make`: the tests of the reader need it, with the types of this crate.
#[cfg(test)]
extern crate self as flexspline;
#[cfg(test)]
#[path = "../make/src/slopes.rs"]
mod slopes;
#[cfg(test)]
#[path = "../make/src/write.rs"]
mod write;
