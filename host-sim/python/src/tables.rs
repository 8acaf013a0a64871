//! Tables by contact FEM, or from samples of another program.

use std::path::PathBuf;
use std::sync::Mutex;

use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::tables::{
    MadeTable, MakeError, SampleOptions, TableSettings, c_header, from_samples, make, rust_source, samples,
};
use flexspline_mechanics::stepping::SolverSettings;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rayon::prelude::*;

use crate::drive::{Drive, generator, method};
use crate::failure::{PythonFailure, bad};
use crate::run::run;

/// A finished table as Python takes it: generator, image, text of its JSON, Rust source, C header, samples as CSV.
pub type Parts<'py> = (String, Bound<'py, PyBytes>, String, String, String, Option<String>);

pub fn parts<'py>(py: Python<'py>, made: &MadeTable) -> PyResult<Parts<'py>> {
    let info = serde_json::to_string(&made.info).map_err(bad)?;
    let samples = made.samples.as_deref().map(samples::to_csv);
    let image = PyBytes::new(py, &made.image);
    Ok((made.kind.name().to_owned(), image, info, rust_source(made), c_header(made), samples))
}

/// Makes the tables of a drive by contact FEM.
#[pyfunction]
#[pyo3(signature = (
    drive, generators, *, torque_n_m, most_nodes, node_tolerance_arcsec, positions, temperatures_c,
    mesh, solver, threads, progress
))]
#[expect(clippy::too_many_arguments, reason = "each is an option of the run")]
pub fn tables<'py>(
    py: Python<'py>,
    drive: &Drive,
    generators: Vec<String>,
    torque_n_m: Option<f64>,
    most_nodes: Option<usize>,
    node_tolerance_arcsec: Option<f64>,
    positions: usize,
    temperatures_c: Option<Vec<f64>>,
    mesh: &str,
    solver: &str,
    threads: Option<usize>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Vec<Parts<'py>>> {
    let drive = drive.0.clone();
    let (mesh, method) = method(mesh, solver)?;
    within("positions", positions, 4, 32)?;
    most_nodes.map_or(Ok(()), |nodes| within("most_nodes", nodes, 5, 30))?;
    let mut wanted = Vec::new();
    for name in &generators {
        let kind = generator(name)?;
        let mut settings = TableSettings::for_generator(&drive, kind);
        settings.solver = SolverSettings { method, mesh, ..settings.solver };
        settings.positions = positions;
        let choice = &mut settings.torque_nodes;
        choice.largest_n_m = torque_n_m.unwrap_or(choice.largest_n_m);
        choice.most = most_nodes.unwrap_or(choice.most);
        choice.tolerance_arcsec = node_tolerance_arcsec.unwrap_or(choice.tolerance_arcsec);
        if let Some(temperatures) = &temperatures_c {
            settings.temperature_nodes_c = temperatures.iter().map(|t| *t as f32).collect();
            settings.temperature_nodes_c.sort_by(f32::total_cmp);
            settings.temperature_nodes_c.dedup();
        }
        settings.check(&drive).map_err(bad)?;
        wanted.push((kind, settings));
    }
    let made = run(py, threads, progress, move |watch| {
        let counts = Mutex::new(vec![[0; 2]; wanted.len()]);
        let one = |(k, (kind, settings)): (usize, &(_, TableSettings))| {
            let failed = |error: MakeError| match error.is_bad_input() {
                true => PythonFailure::bad(error),
                false => PythonFailure::NotConverged(format!("{kind}: {error}")),
            };
            make(&drive, *kind, settings, &|now| {
                let Ok(mut counts) = counts.lock() else { return std::ops::ControlFlow::Continue(()) };
                counts[k] = [counts[k][0] + 1, now.expected];
                let [done, expected] = [0, 1].map(|of: usize| counts.iter().map(|count| count[of]).sum());
                watch.tell(
                    done,
                    expected,
                    format!("{kind} {:+.3} N·m {:+.0} °C", now.last.torque_n_m, now.last.temperature_c),
                )
            })
            .map_err(failed)
        };
        wanted.par_iter().enumerate().map(one).collect::<Result<Vec<MadeTable>, PythonFailure>>()
    })?;
    made.iter().map(|made| parts(py, made)).collect()
}

fn within(name: &str, found: usize, least: usize, most: usize) -> PyResult<()> {
    if (least..=most).contains(&found) {
        return Ok(());
    }
    Err(bad(format!("{name}: found {found}, allowed: {least} to {most}")))
}

/// A table from a file of samples.
#[pyfunction]
#[pyo3(signature = (drive, generator_name, file, *, half_width_arcsec, deviation_arcsec))]
pub fn project<'py>(
    py: Python<'py>,
    drive: &Drive,
    generator_name: &str,
    file: PathBuf,
    half_width_arcsec: Option<f64>,
    deviation_arcsec: Option<f64>,
) -> PyResult<Parts<'py>> {
    let radians = |name: &str, value: Option<f64>| match value {
        Some(v) if !(0.0..=3600.0).contains(&v) => Err(bad(format!("{name}: found {v}; allowed: 0 to 3600 arcsec"))),
        other => Ok(other.map(|v| v / ARCSEC_PER_RAD)),
    };
    let options = SampleOptions {
        half_width_rad: radians("half_width_arcsec", half_width_arcsec)?,
        deviation_limit_rad: radians("deviation_arcsec", deviation_arcsec)?
            .unwrap_or(SampleOptions::default().deviation_limit_rad),
    };
    let kind = generator(generator_name)?;
    let read = samples::read(&file).map_err(bad)?;
    let name = file.display().to_string();
    let bytes = std::fs::read(&file).map_err(|error| bad(format!("{name}: {error}")))?;
    let made =
        from_samples(&drive.0, kind, &read, &name, &bytes, options).map_err(|error| bad(format!("{name}: {error}")))?;
    parts(py, &made)
}
