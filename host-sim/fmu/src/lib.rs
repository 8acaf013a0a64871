//! The compensation of a strain wave drive, and a joint with mass, behind the C interfaces of FMI 2.0 and FMI 3.0 for
//! co-simulation.
//!
//! The library is the same in every FMU. What it simulates, with which table and which start values, is in the FMU's
//! resources ([`resources`]); which variables there are is in [`variables`], for the library and for who writes
//! `modelDescription.xml`.
//! [`instance`] is the state machine of the standards, in safe code; [`abi`] is nothing but pointers.
//!
//! Facts about FMI are from "Functional Mock-up Interface for Model Exchange and Co-Simulation", version 2.0.4, and
//! "Functional Mock-up Interface Specification", version 3.0.2; sections are named.
#![deny(unsafe_code)]

#[allow(unsafe_code, non_snake_case)] // Pointers from C, and the names of the standards.
pub mod abi;
pub mod compensation;
mod error;
pub mod instance;
pub mod joint;
pub mod resources;
pub mod variables;

pub use error::FmuError;

/// What a library for the resources of this version has among its bytes.
pub const MARK: &str = concat!("flexspline-fmu ", env!("CARGO_PKG_VERSION"), ", resources 2");

/// A version of the standard: an FMU has one, a library both.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FmiVersion {
    /// FMI 2.0.
    Two,
    /// FMI 3.0.
    Three,
}

impl FmiVersion {
    /// Its number.
    pub const fn name(self) -> &'static str {
        match self {
            FmiVersion::Two => "2.0",
            FmiVersion::Three => "3.0",
        }
    }
}
