//! The compensation of a strain wave drive, and a joint with mass, behind the C interface of FMI 2.0 for co-simulation.
//!
//! The library is the same in every FMU. The model, its table and its start values are in the FMU's resources
//! ([`resources`]); the variables of each model are in [`variables`], for the library and for who writes
//! `modelDescription.xml`.
//! [`instance`] is the state machine of the standard, in safe code; [`abi`] is nothing but pointers.
//!
//! Facts about FMI are from "Functional Mock-up Interface for Model Exchange and Co-Simulation", version 2.0.4;
//! sections are named.
#![deny(unsafe_code)]

#[allow(unsafe_code, non_snake_case)] // Pointers from C, and the names of the standard.
pub mod abi;
pub mod compensation;
mod error;
pub mod instance;
pub mod joint;
pub mod resources;
pub mod variables;

pub use error::FmuError;

/// Text among the bytes of a library for the resources of this version.
pub const MARK: &str = concat!("flexspline-fmu ", env!("CARGO_PKG_VERSION"), ", resources 2");
