//! Variants of a drive side by side.

use flexspline_sim::mesh::MeshLevel;
use flexspline_sim::stepping::{Method, SolverSettings};
use flexspline_sim::study::{Constraint, Sense, StudyError, StudySettings, StudyTarget, Vary, study as run_study};
use pyo3::prelude::*;

use crate::drive::{Drive, generator};
use crate::failure::{Failure, bad};
use crate::run::run;

/// Runs every variant with every generator; the fields and runs of `study.json`.
#[pyfunction]
#[pyo3(signature = (drive, vary, generators, *, variants, seed, torque_n_m, keep, least, most, positions, compute_all, mesh, threads, progress))]
#[expect(clippy::too_many_arguments, reason = "each is an option of the run")]
pub fn study(
    py: Python<'_>,
    drive: &Drive,
    vary: Vec<String>,
    generators: Vec<String>,
    variants: Option<u32>,
    seed: u32,
    torque_n_m: Option<f64>,
    keep: Vec<String>,
    least: Vec<String>,
    most: Vec<String>,
    positions: usize,
    compute_all: bool,
    mesh: &str,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let (drive, stated) = (drive.0.clone(), drive.1.clone());
    let mesh: MeshLevel = mesh.parse().map_err(bad)?;
    if torque_n_m.is_some_and(|torque| !(torque > 0.0 && torque.is_finite())) {
        return Err(bad(format!("torque_n_m: found {}, allowed: above 0", torque_n_m.unwrap_or_default())));
    }
    if !(4..=32).contains(&positions) {
        return Err(bad(format!("positions: found {positions}, allowed: 4 to 32")));
    }
    let least = least.iter().map(|name| StudyTarget::new(name, Sense::Least).map_err(bad));
    let most = most.iter().map(|name| StudyTarget::new(name, Sense::Most).map_err(bad));
    let settings = StudySettings {
        vary: vary.iter().map(|text| text.parse::<Vary>().map_err(bad)).collect::<PyResult<_>>()?,
        spread: variants,
        seed,
        generators: generators.iter().map(|name| generator(name)).collect::<Result<_, Failure>>()?,
        torque_n_m,
        stated,
        positions,
        constraints: keep.iter().map(|text| text.parse::<Constraint>().map_err(bad)).collect::<PyResult<_>>()?,
        targets: least.chain(most).collect::<PyResult<_>>()?,
        compute_all,
        solver: SolverSettings { method: Method::Fast, mesh, ..SolverSettings::default() },
    };
    let made = run(py, threads, progress, move |watch| {
        run_study(&drive, &settings, &|done, of, run| {
            watch.tell(done, of, format!("variant {} {}", run.variant, run.generator))
        })
        .map_err(|error: StudyError| Failure::bad(error))
    })?;
    serde_json::to_string(&made).map_err(bad)
}
