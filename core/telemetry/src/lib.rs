//! Reports of a joint: records for the ground, events for a log.
//!
//! A [`Recorder`] keeps records, a [`Watch`] finds what changed:
//! ```
//! use flexspline::*;
//! use flexspline_telemetry::*;
//!
//! let mut recorder = Recorder::new(Ring::<64>::new(), core::num::NonZeroU32::new(100).ok_or("every")?);
//! let mut watch = Watch::new();
//! let mut after_tick = |tick, state: &JointState, store: &Store, output: &Output| {
//!     recorder.record(tick, state, store, output);
//!     let events = watch.see(state, store, output); // with the feature `defmt`: events.log(tick)
//!     for _event in events.iter() {}
//! };
//! # let output = Output { command: GeneratorAngle::ZERO, output: OutputAngle::ZERO, transmission_error_rad: 0.0,
//! #     uncertainty_rad: 0.0,
//! #     correction_rad: 0.0, held_back_rad: 0.0, quality: Quality::InRange, flags: Flags::default() };
//! # after_tick(0, &JointState::new(), &Store::new(), &output);
//! // When there is time: bytes for the ground.
//! while let Some(record) = recorder.sink().take() {
//!     let bytes: [u8; RECORD_BYTES] = record.encode();
//!     assert_eq!(Record::decode(&bytes), Ok(record));
//! }
//! # Ok::<(), &str>(())
//! ```
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

#[cfg(feature = "defmt")]
mod defmt;
mod events;
mod records;

pub use events::{Event, Events, Watch};
#[doc(hidden)] // For the C interface.
pub use records::is_due;
pub use records::{Queue, RECORD_BYTES, Reader, Record, RecordError, Recorder, Ring, Sink, Writer};

#[cfg(test)]
extern crate std;
