//! A run along a generator path.

use flexspline::Direction;
use flexspline_design::simulate::{
    Path, PathPoint, SimulateError, SimulationSettings, read_path, simulate as run_along,
};
use flexspline_mechanics::stepping::SolverSettings;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::columns::columns;
use crate::drive::{Drive, generator, method};
use crate::failure::{PythonFailure, bad};
use crate::run::run;
use crate::step::direction_of;

/// Points of a path: generator angle, and where wanted torque and temperature.
type Points<'py> = (PyReadonlyArray1<'py, f64>, Option<PyReadonlyArray1<'py, f64>>, Option<PyReadonlyArray1<'py, f64>>);

/// Runs a drive along a path; the columns of `results.csv` and the text of `summary.json`.
#[pyfunction]
#[pyo3(signature = (
    drive, generator_name, path, points, *, increment_rad, direction, torque_n_m, temperature_c,
    mesh, solver, threads, progress
))]
#[expect(clippy::too_many_arguments, reason = "each is an option of the run")]
pub fn simulate<'py>(
    py: Python<'py>,
    drive: &Drive,
    generator_name: &str,
    path: &str,
    points: Option<Points<'py>>,
    increment_rad: Option<f64>,
    direction: Option<i32>,
    torque_n_m: Option<f64>,
    temperature_c: Option<f64>,
    mesh: &str,
    solver: &str,
    threads: Option<usize>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Bound<'py, PyDict>, String)> {
    let drive = drive.0.clone();
    let (mesh, method) = method(mesh, solver)?;
    let path = match (points, Path::built_in(path)) {
        (Some(points), _) => Path::Points(path_points(&points)?),
        (None, Some(path)) => path,
        (None, None) => {
            let text = std::fs::read_to_string(path).map_err(|error| {
                bad(format!(
                    "path: found {path:?}, which cannot be read as a file ({error}); allowed: paper, pitch, turn, a \
                     CSV file or columns"
                ))
            })?;
            let temperatures_c = drive.temperature.minimum_c..=drive.temperature.maximum_c;
            Path::Points(read_path(path, &text, temperatures_c).map_err(bad)?)
        }
    };
    if let Path::Points(points) = &path {
        let first = points.first().copied().unwrap_or_default();
        said_once("torque_n_m", torque_n_m, first.torque_n_m)?;
        said_once("temperature_c", temperature_c, first.temperature_c)?;
    }
    let direction = match direction {
        None => Direction::Forward,
        Some(_) if !matches!(path, Path::Pitch | Path::Turn) => {
            return Err(bad("direction: the path has its own; allowed with the paths pitch and turn"));
        }
        Some(sign) => direction_of(sign)?,
    };
    let settings = SimulationSettings {
        increment_rad,
        direction,
        torque_n_m: torque_n_m.unwrap_or(0.0),
        temperature_c,
        solver: SolverSettings { method, mesh, ..SolverSettings::default() },
        ..SimulationSettings::new(generator(generator_name)?, path)
    };
    let simulation = run(py, threads, progress, move |watch| {
        run_along(&drive, &settings, &mut |now| {
            watch.tell(now.done, now.total, format!("{} iterations", now.iterations))
        })
        .map_err(|error: SimulateError| PythonFailure::of(&error, error.is_bad_input()))
    })?;
    Ok((columns(py, &simulation.rows)?, serde_json::to_string(&simulation.summary).map_err(bad)?))
}

fn path_points(points: &Points<'_>) -> PyResult<Vec<PathPoint>> {
    let (generator, torque, temperature) = points;
    let torque = torque.as_ref().map(|column| column.as_array());
    let temperature = temperature.as_ref().map(|column| column.as_array());
    let rows = generator.as_array().into_iter().enumerate();
    Ok(rows
        .map(|(row, generator_rad)| PathPoint {
            generator_rad: *generator_rad,
            torque_n_m: torque.and_then(|column| column.get(row).copied()),
            temperature_c: temperature.and_then(|column| column.get(row).copied()),
        })
        .collect())
}

/// Refuses what both the path and an argument say.
fn said_once(name: &str, given: Option<f64>, in_path: Option<f64>) -> PyResult<()> {
    match (given, in_path) {
        (Some(given), Some(_)) => {
            Err(bad(format!("{name}: found {given}, but the path has a column {name}; give one of the two")))
        }
        _ => Ok(()),
    }
}
