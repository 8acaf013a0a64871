//! A drive on paper: simulation, tables, data sheet, sweeps over variants, by contact FEM.
//!
//! [`simulate`] runs one drive along one path, [`tables`] makes and validates the table that firmware reads,
//! [`data_sheet`] gives the figures of a data sheet and [`stated`] compares them with those of a maker, [`sweep`]
//! computes variants and drives drawn from tolerances, [`kernels`] is the response of the error to small deviations of
//! the surfaces, [`relief`] lowers tips that clash under load, [`sketch`] draws the sizes.
#![forbid(unsafe_code)]

pub mod catalogue;
pub mod cautions;
pub mod data_sheet;
pub mod kernels;
pub mod pitch_wave;
pub mod relief;
pub mod simulate;
pub mod sketch;
pub mod stated;
pub mod sweep;
pub mod tables;
