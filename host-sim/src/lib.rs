//! Contact FEM of strain wave (harmonic) drives, and the compensation tables made from it.
#![forbid(unsafe_code)]

pub mod contact;
pub mod drive;
pub mod element;
pub mod fem;
pub mod material;
pub mod mesh;
pub mod reference;
pub mod stepping;
pub mod samples;
pub mod sweep;
