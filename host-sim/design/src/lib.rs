//! A drive on paper: what contact FEM says of it.
//!
//! [`simulate`] runs one drive along one path, [`tables`] makes and validates the table that firmware reads,
//! [`data_sheet`] gives the figures of a data sheet and [`stated`] compares them with those of a maker, [`study`]
//! compares variants, [`campaign`] draws drives from tolerances, [`kernels`] holds what small deviations of the
//! surfaces do to the error, [`relief`] lowers tips that clash under load.
#![forbid(unsafe_code)]

pub mod campaign;
pub mod catalogue;
pub mod cautions;
pub mod data_sheet;
pub mod kernels;
pub mod pitch_wave;
pub mod relief;
pub mod simulate;
pub mod stated;
pub mod study;
pub mod tables;
