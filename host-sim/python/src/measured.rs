//! Measured data: to a table (`calibrate`), to a verdict (`diagnose`).

use std::path::{Path, PathBuf};

use flexspline::Table;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::kernels::Kernels;
use flexspline_identify::calibrate::{CalibrationError, Prior, calibrate as fit, calibrate_and_split};
use flexspline_identify::causes::CauseName;
use flexspline_identify::diagnosis::{
    Explanation, Options, PipelineError, Series, Subject, diagnose_rows, parse_rows, read_rows,
};
use flexspline_identify::extension::Model;
use flexspline_identify::known_rows::{parse_known, read_known};
use flexspline_identify::measurement::{ColumnMap, Session};
use flexspline_mechanics::drive::Drive as MechanicsDrive;
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyDict;

use crate::drive::{Drive, generator};
use crate::failure::{PythonFailure, bad};
use crate::run::run;
use crate::tables::{Parts, parts};

/// A log: a file, or a CSV in memory under a name.
#[derive(FromPyObject)]
pub enum LogFrom {
    #[pyo3(transparent)]
    File(PathBuf),
    #[pyo3(transparent)]
    Memory((String, PyBackedBytes)),
}

impl LogFrom {
    fn name(&self) -> String {
        match self {
            LogFrom::File(path) => path.display().to_string(),
            LogFrom::Memory((name, _)) => name.clone(),
        }
    }
}

/// How the columns of logs are read: mapping, rows in a second, torque of an ampere.
type Reading = (String, Option<f64>, Option<f64>);

fn column_map((columns, rate_hz, torque_constant): &Reading) -> Result<ColumnMap, PythonFailure> {
    ColumnMap::of_options(columns, *rate_hz, *torque_constant).map_err(PythonFailure::bad)
}

/// The drive as it is known before.
#[derive(FromPyObject)]
pub enum KnownFrom {
    #[pyo3(transparent)]
    Ratio(f64),
    /// The image of a table.
    #[pyo3(transparent)]
    Image(PyBackedBytes),
    /// A nominal model.
    #[pyo3(transparent)]
    Model(PathBuf),
}

/// Logs of one unit to its table: the text of `calibration.json`, the table, and the rows of a picture.
#[pyfunction]
#[pyo3(signature = (logs, known, generator_name, reading, split, *, threads, progress))]
#[expect(clippy::too_many_arguments, reason = "those of Python")]
pub fn calibrate<'py>(
    py: Python<'py>,
    logs: Vec<LogFrom>,
    known: KnownFrom,
    generator_name: &str,
    reading: Reading,
    split: bool,
    threads: Option<usize>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<(String, Parts<'py>, Bound<'py, PyDict>)> {
    let kind = generator(generator_name)?;
    let map = column_map(&reading)?;
    let made = run(py, threads, progress, move |watch| {
        let table;
        let (prior, extended) = match &known {
            KnownFrom::Image(image) => {
                table = Table::check(image).map_err(PythonFailure::bad)?;
                (Prior::of_table(&table, kind), None)
            }
            KnownFrom::Model(path) => {
                let (prior, model) = Prior::of_file(path, kind).map_err(PythonFailure::bad)?;
                (prior, Some(Subject::of_model(model, MechanicsDrive::hhd_95(), kind)))
            }
            KnownFrom::Ratio(ratio) => (Prior::of_given_ratio(*ratio, kind).map_err(PythonFailure::bad)?, None),
        };
        let one = |(k, log): (usize, &LogFrom)| {
            watch.tell_or_unwind(k, logs.len() + 1, format!("reading {}", log.name()));
            match log {
                LogFrom::File(path) => read_known(path, &map, &prior.nominal, prior.table),
                LogFrom::Memory((name, bytes)) => parse_known(name, bytes, &map, &prior.nominal, prior.table),
            }
            .map_err(PythonFailure::bad)
        };
        let mut files = logs.iter().enumerate().map(one).collect::<Result<Vec<_>, PythonFailure>>()?;
        let causes = extended.map_or(Ok(None), |subject| subject.known_before(&mut files));
        let causes = causes.map_err(PythonFailure::bad)?;
        let causes = causes.as_ref().map(|made| Table::check(&made.image)).transpose().map_err(PythonFailure::bad)?;
        let prior = causes.as_ref().map_or(prior, |table| Prior::of_table(table, kind));
        watch.tell_or_unwind(logs.len(), logs.len() + 1, "fitting".to_owned());
        let made = if split { calibrate_and_split } else { fit }(&files, &prior)
            .map_err(|error| calibration_failure(&error, &logs))?;
        watch.tell_or_unwind(logs.len() + 1, logs.len() + 1, "done".to_owned());
        Ok((made.calibration, made.table, made.shown))
    })?;
    let (calibration, table, shown) = made;
    let column = |of: usize| shown.iter().map(|row| row[of]).collect();
    let rows = PyDict::new(py);
    add(&rows, [("output_rad", column(0)), ("measured_arcsec", column(1)), ("left_arcsec", column(2))])?;
    Ok((serde_json::to_string(&calibration).map_err(bad)?, parts(py, &table)?, rows))
}

fn calibration_failure(error: &CalibrationError, logs: &[LogFrom]) -> PythonFailure {
    let names: Vec<String> = logs.iter().map(LogFrom::name).collect();
    let what = error.of_files(&names);
    match error {
        CalibrationError::NothingGained(_) => PythonFailure::NothingGained(what),
        _ => PythonFailure::of(what, error.is_bad_input()),
    }
}

/// Results of a diagnosis: text of the JSON, drive-extended.toml, extended table, why a cause was named or not,
/// columns.
type Diagnosed<'py> = (String, Option<String>, Option<Parts<'py>>, Option<(String, String)>, Bound<'py, PyDict>);

/// Names what the simulation gets wrong in measured data.
#[pyfunction]
#[pyo3(signature = (log, known, drive, generator_name, reading, *, kernels, explain, threads, progress))]
#[expect(clippy::too_many_arguments, reason = "each is an option of the run")]
pub fn diagnose<'py>(
    py: Python<'py>,
    log: LogFrom,
    known: KnownFrom,
    drive: &Drive,
    generator_name: &str,
    reading: Reading,
    kernels: Option<PathBuf>,
    explain: Option<&str>,
    threads: Option<usize>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Diagnosed<'py>> {
    let kind = generator(generator_name)?;
    let map = column_map(&reading)?;
    let asked = explain.map(str::parse::<CauseName>).transpose().map_err(|error| bad(format!("explain: {error}")))?;
    let drive = drive.0.clone();
    let done = run(py, threads, progress, move |watch| {
        let failed = |error: PipelineError| {
            let what = match &error {
                PipelineError::Known(_) | PipelineError::Diagnosis(_) => format!("{}: {error}", log.name()),
                _ => error.to_string(),
            };
            PythonFailure::of(what, error.is_bad_input())
        };
        let subject = match &known {
            KnownFrom::Model(path) => {
                Subject::of_model(Model::read(path).map_err(PythonFailure::bad)?, drive.clone(), kind)
            }
            KnownFrom::Image(image) => Subject::of_table(image, drive.clone(), kind).map_err(PythonFailure::bad)?,
            KnownFrom::Ratio(_) => return Err(PythonFailure::bad("expected model or table")),
        };
        let subject = match &kernels {
            Some(path) => with_kernels(subject, path)?,
            None => subject,
        };
        let recording = match &log {
            LogFrom::File(path) => read_rows(path, &map, &subject),
            LogFrom::Memory((name, bytes)) => parse_rows(name, bytes, &map, &subject),
        };
        let options = Options { asked, ..Options::default() };
        let tell = |done: usize, of: usize, what: &str| watch.tell_or_unwind(done, of, what.to_owned());
        let done = diagnose_rows(recording.map_err(failed)?, &subject, &options, tell).map_err(failed)?;
        let made = done.extend(&subject, &options, || tell(4, 5, "FEM of the extended drive")).map_err(failed)?;
        let files = made.table_files().into_iter().map(|(name, _)| name).collect::<Vec<_>>();
        let mut extension = made.extension;
        // As the command lists what it writes.
        extension.files.extend(made.drive_toml.as_ref().map(|_| "drive-extended.toml".to_owned()));
        extension.files.extend(files);
        let json = serde_json::to_string(&done.file(&extension, "")).map_err(PythonFailure::bad)?;
        let explanation = asked.map(|cause| {
            let explanation = Explanation::of(&done.diagnosis, cause);
            Ok((
                explanation.text().trim_end().to_owned(),
                serde_json::to_string(&explanation).map_err(PythonFailure::bad)?,
            ))
        });
        let series = done.extended.predict(&done.recording.sessions, &subject.nominal, subject.table.as_ref());
        let of_session = |(k, session): (usize, &Session)| vec![k as i64 + 1; session.len()];
        let session: Vec<i64> = done.recording.sessions.iter().enumerate().flat_map(of_session).collect();
        let rows = (session, rows_of(&done.recording.sessions, &series));
        let best = made.tables.into_iter().next().map(|(_, table)| table);
        Ok((json, made.drive_toml, best, explanation.transpose()?, rows))
    })?;
    let (json, drive_toml, table, explanation, (session, numbers)) = done;
    let table = table.map(|table| parts(py, &table)).transpose()?;
    let rows = PyDict::new(py);
    rows.set_item("session", session.into_pyarray(py))?;
    add(&rows, numbers)?;
    Ok((json, drive_toml, table, explanation, rows))
}

/// A subject with the influence kernels of a file.
fn with_kernels<'a>(subject: Subject<'a>, path: &Path) -> Result<Subject<'a>, PythonFailure> {
    let named = |what: String| PythonFailure::bad(format!("{}: {what}", path.display()));
    let text = std::fs::read_to_string(path).map_err(|error| named(error.to_string()))?;
    let kernels = Kernels::from_json(&text).map_err(|problem| named(problem.to_string()))?;
    subject.with_kernels(kernels).map_err(|error| named(error.to_string()))
}

/// The rows that a diagnosis looked at, with what the models say of them.
fn rows_of(sessions: &[Session], series: &[Series]) -> Vec<(&'static str, Vec<f64>)> {
    let of = |values: fn(&Session, &Series) -> Vec<f64>| {
        sessions.iter().zip(series).flat_map(|(a, b)| values(a, b)).collect::<Vec<f64>>()
    };
    let recorded = |values: &Option<Vec<f64>>, rows: usize| values.clone().unwrap_or_else(|| vec![f64::NAN; rows]);
    let or_absent = |values: fn(&Session) -> &Option<Vec<f64>>| {
        sessions.iter().flat_map(|session| recorded(values(session), session.len())).collect::<Vec<f64>>()
    };
    vec![
        ("time_s", or_absent(|session| &session.time_s)),
        ("generator_rad", of(|session, _| session.generator_rad.clone())),
        ("error_arcsec", of(|session, _| session.error_rad.iter().map(|e| e * ARCSEC_PER_RAD).collect())),
        ("torque_n_m", or_absent(|session| &session.torque_n_m)),
        ("temperature_c", or_absent(|session| &session.temperature_c)),
        ("nominal_arcsec", of(|_, series| series.nominal_arcsec.clone())),
        ("recalibrated_arcsec", of(|_, series| series.recalibrated_arcsec.clone())),
        ("extended_arcsec", of(|_, series| series.extended_arcsec.clone())),
    ]
}

/// Adds columns of numbers, as arrays by their names.
fn add(to: &Bound<'_, PyDict>, columns: impl IntoIterator<Item = (&'static str, Vec<f64>)>) -> PyResult<()> {
    columns.into_iter().try_for_each(|(name, values)| to.set_item(name, values.into_pyarray(to.py())))
}
