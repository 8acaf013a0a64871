//! A drive: built in, from a file, with fields set.

use flexspline_design::stated::Stated;
use flexspline_mechanics::drive::{Drive as Inner, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::Method;
use pyo3::prelude::*;

use crate::failure::{PythonFailure, bad};

/// A drive that has passed every check, and what the `[data_sheet]` of its file says.
#[pyclass(frozen, module = "flexspline._native")]
pub struct Drive(pub Inner, pub Option<Stated>);

#[pymethods]
impl Drive {
    /// Names of the drives that are built in.
    #[staticmethod]
    fn built_in() -> Vec<&'static str> {
        Inner::BUILT_IN.to_vec()
    }

    /// The built-in drive of that name, if there is one.
    #[staticmethod]
    fn named(name: &str) -> Option<Drive> {
        Inner::built_in(name).map(|drive| Drive(drive, None))
    }

    /// The drive in the text of a file.
    #[staticmethod]
    fn from_toml(file_name: &str, text: &str) -> PyResult<Drive> {
        let drive = Inner::from_toml(file_name, text).map_err(bad)?;
        Ok(Drive(drive, Stated::of_file(file_name, text).map_err(bad)?))
    }

    /// With fields changed, each `path=value`.
    fn with_sets(&self, sets: Vec<String>) -> PyResult<Drive> {
        let drive = self.0.with_sets(sets.iter().map(String::as_str)).map_err(bad)?;
        Ok(Drive(drive, self.1.clone()))
    }

    /// The whole file, with the data sheet.
    fn to_toml(&self) -> String {
        self.0.to_toml() + &self.1.as_ref().map_or_else(String::new, Stated::to_toml)
    }

    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// BLAKE3 of the drive's physics, hexadecimal.
    #[getter]
    fn drive_hash(&self) -> String {
        blake3::Hash::from_bytes(self.0.hash()).to_hex().to_string()
    }

    #[getter]
    fn ratio(&self) -> f64 {
        self.0.ratio()
    }
}

/// The generator of that name.
pub fn generator(name: &str) -> Result<GeneratorKind, PythonFailure> {
    name.parse::<GeneratorKind>().map_err(|error| PythonFailure::bad(format!("generator: {error}")))
}

/// Mesh and solver of those names.
pub fn method(mesh: &str, solver: &str) -> Result<(MeshLevel, Method), PythonFailure> {
    Ok((mesh.parse().map_err(PythonFailure::bad)?, solver.parse().map_err(PythonFailure::bad)?))
}
