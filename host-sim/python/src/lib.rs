//! The compiled half of the Python package `flexspline`: `flexspline._native`.
//!
//! The Python half (`python/flexspline/*.py`) has the interface that analysts see; this half runs the functions of
//! the crates that the command runs, and the core's step over numpy arrays. Long runs are in `run`, which lets
//! Ctrl-C through; results go over as numpy columns (`columns`) and as the JSON that the command writes.

mod columns;
mod drive;
mod failure;
mod measured;
mod run;
mod simulate;
mod step;
mod tables;

/// The module, as Python loads it.
#[pyo3::pymodule(name = "_native")]
mod native {
    #[pymodule_export]
    use super::drive::Drive;
    #[pymodule_export]
    use super::measured::{calibrate, diagnose, look, synthesize};
    #[pymodule_export]
    use super::simulate::simulate;
    #[pymodule_export]
    use super::step::{PlayState, Table};
    #[pymodule_export]
    use super::tables::{project, tables};

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
