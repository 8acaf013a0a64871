//! Contact FEM of strain wave (harmonic) drives, and the compensation tables made from it.
#![forbid(unsafe_code)]

pub mod drive;
pub mod reference;
