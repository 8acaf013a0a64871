//! Contact FEM of strain wave (harmonic) drives, and the compensation tables made from it.
//!
//! ```text
//! drive.toml -> drive -> mesh -> fem, contact -> stepping -> motion -> tables -> image (.fxt), read by `flexspline`
//!                                                              |
//!                                   simulate, kernels, sweep, reproduce, fly
//! measured.csv -> measurement -> residual -> diagnosis (beside a table, or nominal.toml) -> extension -> drive, tables
//! ```
//!
//! [`drive::Drive`] says what the drive is, [`stepping::Problem`] makes meshes and contact of it with one wave
//! generator at one temperature, [`motion::Motion`] deforms, loads and turns it. [`tables::make()`] samples steady
//! motion at the torques and temperatures that it finds to be needed, and projects the samples onto the table that
//! firmware reads; [`tables::validate()`] compares the table with fresh FEM. [`diagnosis`] says what measured data have
//! beyond all that.
//!
//! A drive, a solver, one error:
//!
//! ```
//! use flexspline_sim::drive::{Drive, GeneratorKind};
//! use flexspline_sim::mesh::MeshLevel;
//! use flexspline_sim::motion::Motion;
//! use flexspline_sim::stepping::{Method, Problem, SolverSettings};
//!
//! let drive = Drive::hhd_95();
//! let settings = SolverSettings { method: Method::Fast, mesh: MeshLevel::Coarse, ..SolverSettings::default() };
//! let problem = Problem::new(&drive, GeneratorKind::Cam, drive.temperature.reference_c, settings)?;
//! let mut motion = Motion::deformed(&problem, 0.0)?;
//! motion.settle(motion.pitch() / 8.0)?;
//! // Driven forward without load, the output lags by half the clearance of 0.987'.
//! assert!((motion.error_arcsec() + 0.5 * 0.987 * 60.0).abs() < 1.0);
//! # Ok::<(), flexspline_sim::stepping::SolveError>(())
//! ```
//!
//! Lengths are mm, forces N, torques N m, angles rad, temperatures °C, and a name carries any other unit. A positive
//! load turns the output forward; the error is output angle minus generator angle over the ratio, positive when the
//! output leads.
#![forbid(unsafe_code)]

pub use flexspline_base::{csv_rows, output, robust, statistics, suggest, toml_file, units};
pub use flexspline_design::{catalogue, cautions, data_sheet, kernels, pitch_wave, simulate, stated, sweep, tables};
pub use flexspline_export as export;
pub use flexspline_export::bundle;
pub use flexspline_fly::{fly, plant_map};
pub use flexspline_identify::{
    calibrate, causes, diagnosis, extension, look, measurement, nominal, replay, residual, synthesize,
};
pub use flexspline_mechanics::{bearing, condense, contact, drive, fem, mesh, motion, reference, sleeve, stepping};
pub use flexspline_pacana_2023 as reproduce;
pub use flexspline_report as report;
