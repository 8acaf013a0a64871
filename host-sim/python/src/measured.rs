//! Measured data: to a table (`calibrate`), to a verdict (`diagnose`).

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use flexspline::Table;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::kernels::Kernels;
use flexspline_identify::calibrate::{CalibrationError, Prior, calibrate as fit, calibrate_and_split};
use flexspline_identify::causes::CauseName;
use flexspline_identify::diagnosis::{
    Explanation, PipelineError, Series, Settings, Subject, diagnose_rows, parse_rows,
};
use flexspline_identify::extension::{CauseEntry, Model};
use flexspline_identify::known_rows::parse_known;
use flexspline_identify::look::{look as look_at, text};
use flexspline_identify::measurement::{ColumnMap, MeasuredError, Session, bytes_of, raw};
use flexspline_identify::nominal::Nominal;
use flexspline_identify::synthesize::{
    DrawnUnit, MotionPlan, RATE_HZ, Sensors, Sizes, parse, synthesize as make, to_csv, within_temperatures,
};
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

    /// Its name in messages, and its bytes.
    fn bytes(&self) -> Result<(String, Cow<'_, [u8]>), MeasuredError> {
        Ok(match self {
            LogFrom::File(path) => bytes_of(path).map(|(name, bytes)| (name, Cow::Owned(bytes)))?,
            LogFrom::Memory((name, bytes)) => (name.clone(), Cow::Borrowed(bytes)),
        })
    }
}

/// What is in logs: the text of the JSON of `flexspline look`, and what it prints.
#[pyfunction]
pub fn look(logs: Vec<LogFrom>) -> PyResult<(String, String)> {
    let of_log = |log: &LogFrom| log.bytes().and_then(|(name, bytes)| raw::parse(&name, bytes));
    let files = logs.iter().map(of_log).collect::<Result<Vec<_>, _>>().map_err(bad)?;
    let looked = look_at(&files).map_err(bad)?;
    Ok((serde_json::to_string(&looked).map_err(bad)?, text(&looked)))
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

/// Rows of a drive with hidden effects, each `NAME:param=value,…`, as `flexspline synthesize` makes them with this
/// seed: a CSV, and the text of the effects with all values. `motion` is sessions, rows in each, largest speed (rad/s)
/// and torque (N·m), `noise_arcsec` white noise and wander.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "each is an option of the run")]
pub fn synthesize(
    known: KnownFrom,
    drive: &Drive,
    effects: Vec<String>,
    motion: (usize, usize, f64, f64),
    temperatures_c: [f64; 2],
    noise_arcsec: [f64; 2],
    spread: bool,
    seed: u64,
) -> PyResult<(String, String)> {
    let table = match &known {
        KnownFrom::Image(image) => Some(Table::check(image).map_err(bad)?),
        _ => None,
    };
    let (nominal, mut chosen) = match (&known, &table) {
        (KnownFrom::Model(path), _) => {
            let Model { nominal, causes, .. } = Model::read(path).map_err(bad)?;
            (nominal, causes.iter().filter_map(CauseEntry::effect).collect())
        }
        (_, Some(table)) => (Nominal::of_table(table), Vec::new()),
        _ => return Err(bad("expected model or table")),
    };
    for text in &effects {
        chosen.push(parse(text).map_err(|error| bad(format!("effects: {error}")))?);
    }
    let mut random = fastrand::Rng::with_seed(seed);
    let (sessions, rows, speed_rad_s, torque_n_m) = motion;
    let plan = MotionPlan { sessions, rows, rate_hz: RATE_HZ, speed_rad_s, torque_n_m };
    let mut motion = plan.excite(&mut random);
    within_temperatures(&mut motion, temperatures_c);
    let unit = if spread { DrawnUnit::draw(&nominal, &mut random) } else { DrawnUnit::nominal(&nominal) };
    let [white_arcsec, wander_arcsec] = noise_arcsec;
    let sensors = Sensors { white_arcsec, wander_arcsec, ..Sensors::USUAL };
    let drawn = (&nominal, table.as_ref());
    let made = make(drawn, Sizes::of(&drive.0), &chosen, motion, &sensors, &unit, &mut random).map_err(bad)?;
    let csv = to_csv(&made.sessions, nominal.ratio, &made.effects, &mut random);
    Ok((csv, serde_json::to_string(&made.effects).map_err(bad)?))
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
            let known =
                |(name, bytes): (String, Cow<'_, [u8]>)| parse_known(&name, bytes, &map, &prior.nominal, prior.table);
            log.bytes().and_then(known).map_err(PythonFailure::bad)
        };
        let mut files = logs.iter().enumerate().map(one).collect::<Result<Vec<_>, PythonFailure>>()?;
        let causes = extended.map_or(Ok(None), |subject| subject.known_before(&mut files, split));
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
            KnownFrom::Ratio(ratio) => {
                let (name, bytes) = log.bytes().map_err(PythonFailure::bad)?;
                Subject::of_ratio(*ratio, (drive.clone(), kind), (&name, bytes.into_owned(), &map)).map_err(failed)?
            }
        };
        let mut subject = match &kernels {
            Some(path) => with_kernels(subject, path)?,
            None => subject,
        };
        let (name, bytes) = log.bytes().map_err(PythonFailure::bad)?;
        let recording = parse_rows(&name, bytes, &map, &mut subject);
        let options = Settings { asked, ..Settings::default() };
        let tell = |done: usize, of: usize, what: &str| watch.tell_or_unwind(done, of, what.to_owned());
        let done = diagnose_rows(recording.map_err(failed)?, &subject, &options, tell).map_err(failed)?;
        let made = done.extend(&subject).map_err(failed)?;
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
