//! A drive that was measured: from the rows of a log to the causes of its error and to the table that corrects it.
//!
//! [`look`] says what a file holds, [`measurement`] reads it, [`calibrate`] makes the table of this unit, [`residual`]
//! is the error less a model, [`diagnosis`] names causes ([`causes`]) and [`extension`] puts them into the model.
//! [`synthesize`] makes rows with a hidden cause, [`replay`] runs the core over measured rows, [`wind_up`] reads a
//! torque from two encoders, [`nominal`] is a drive known from a catalogue alone.
#![forbid(unsafe_code)]

pub mod calibrate;
pub mod causes;
pub mod diagnosis;
pub mod extension;
pub mod known_rows;
mod least_squares;
mod linear;
pub mod look;
pub mod measurement;
mod misfit;
pub mod nominal;
pub mod replay;
pub mod residual;
pub mod synthesize;
pub mod wind_up;
