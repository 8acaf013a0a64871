//! Examines `flexspline diagnose` from outside: measured-looking data from a plant of its own, the truth kept apart and
//! committed to beforehand, and scores with intervals.
//!
//! Nothing here is linked with the simulator or shares a law with the diagnosis; what they have in common is the
//! written contract: column names, `nominal.toml`, names of causes, `diagnosis.json`. The laws, their sources and what
//! is counted as fair are in the README of this crate.

pub mod answer;
pub mod bench;
pub mod case;
pub mod cause;
pub mod chance;
pub mod drive;
pub mod effect;
pub mod exam;
pub mod fault;
pub mod fresh;
pub mod laws;
pub mod motion;
pub mod noise;
pub mod outside;
pub mod plant;
pub mod question;
pub mod rate;
pub mod rival;
pub mod score;
pub mod teeth;
pub mod truth;

/// Arc-seconds in a radian.
pub const ARCSEC: f64 = 180.0 * 3600.0 / std::f64::consts::PI;
