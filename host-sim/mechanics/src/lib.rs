//! The mechanics of strain wave (harmonic) drives: what a drive is, its meshes, contact FEM, and quasi-static motion.
//!
//! A crate below `flexspline-sim`, which shows all of it under the same names. It is apart because it is what computes
//! long: it is compiled as one unit, which makes it fast, and not again where something above it changes.
#![forbid(unsafe_code)]

pub mod bearing;
pub mod condense;
pub mod contact;
pub mod drive;
pub mod fem;
pub mod mesh;
pub mod motion;
pub mod reference;
pub mod sleeve;
pub mod stepping;

use flexspline_base::{suggest, toml_file, units};
