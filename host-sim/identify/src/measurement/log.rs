//! A file as it stands: its columns in rad, s, N·m and °C, what is missing as NaN.

use std::fmt;
use std::ops::Range;

use thiserror::Error;

use super::columns::{ColumnMap, MappedColumn, Quantity};
use super::fault::{Fault, FaultName, Treatment};
use super::faults::Findings;
use super::reader::{Cells, Columns, Layout, Sheet, clock, stamps};
use super::{Session, phd2};
use flexspline_base::csv_rows::TableProblem;

/// Fewest rows that say anything about noise or an order. *Guess*: fewer give no standard deviation to speak of.
pub const FEWEST_ROWS: usize = 16;

/// A line of names begins a session of rows without a time where there are this many rows to each such line. *Guess*:
/// a logger that repeats its names for whoever reads along does so once a page.
const ROWS_OF_A_PART: usize = 200;

/// Measured data that cannot be used. Its text names file, line where there is one, what was found and what is allowed.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{file}{}: {what}", .line.map_or_else(String::new, |line| format!(":{line}")))]
pub struct MeasuredError {
    /// Which file.
    pub file: String,
    /// Line, from 1, if one is to blame.
    pub line: Option<u64>,
    /// The found value and the allowed ones.
    pub what: String,
}

impl MeasuredError {
    /// A problem in a line of a file.
    pub(crate) fn at(file: &str, problem: TableProblem) -> MeasuredError {
        MeasuredError { file: file.to_owned(), line: Some(problem.line), what: problem.what }
    }

    /// Why a file is refused as a whole.
    pub(crate) fn of_file(file: &str, why: &dyn fmt::Display) -> MeasuredError {
        MeasuredError { file: file.to_owned(), line: None, what: why.to_string() }
    }
}

/// Columns of the same length.
#[derive(Clone, Debug, Default)]
pub(crate) struct Log {
    /// Line of each row.
    pub line: Vec<u64>,
    /// Session of each row; empty as long as there is one.
    pub session: Vec<u32>,
    columns: [Option<Vec<f64>>; 7],
    /// Whether the error was recorded, and no output angle.
    pub(super) error_recorded: bool,
    /// Noise of each row against that of a row of mean worth, where rows differ.
    pub(super) loudness: Option<Vec<f64>>,
    /// Time by which one angle may be read before the other on the mean, s.
    pub(super) unsure_s: f64,
    /// Step of the resolution at the output where no noise blurs it, rad; else 0.
    pub(super) coarse_rad: f64,
    /// Sessions of another zero, and what was taken off each, rad.
    pub(super) zeros: Vec<(u32, f64)>,
}

impl Log {
    pub fn len(&self) -> usize {
        self.line.len()
    }

    pub fn get(&self, quantity: Quantity) -> Option<&[f64]> {
        self.columns[quantity as usize].as_deref()
    }

    pub fn get_mut(&mut self, quantity: Quantity) -> Option<&mut Vec<f64>> {
        self.columns[quantity as usize].as_mut()
    }

    pub fn take(&mut self, quantity: Quantity) -> Option<Vec<f64>> {
        self.columns[quantity as usize].take()
    }

    pub fn put(&mut self, quantity: Quantity, values: Vec<f64>) {
        self.columns[quantity as usize] = Some(values);
    }

    /// A channel that every log has, or nothing.
    pub(super) fn of(&self, quantity: Quantity) -> &[f64] {
        self.get(quantity).unwrap_or_default()
    }

    /// With the error in place of an output angle.
    pub(super) fn with_error(mut self, ratio: f64) -> Log {
        self.error_recorded = self.get(Quantity::Output).is_none();
        if let Some(mut error) = self.take(Quantity::Output) {
            error.iter_mut().zip(self.of(Quantity::Generator)).for_each(|(error, psi)| *error -= psi / ratio);
            self.put(Quantity::Error, error);
        }
        self
    }

    /// The output angle by generator and error, rad.
    pub(super) fn output_rad(&self, ratio: f64) -> Vec<f64> {
        let rows = self.of(Quantity::Generator).iter().zip(self.of(Quantity::Error));
        rows.map(|(generator, error)| generator / ratio + error).collect()
    }

    /// Its rows as sessions, each with columns of its own.
    pub(super) fn into_sessions(mut self) -> Vec<Session> {
        let whole = Session {
            generator_rad: self.take(Quantity::Generator).unwrap_or_default(),
            error_rad: self.take(Quantity::Error).unwrap_or_default(),
            time_s: self.take(Quantity::Time),
            torque_n_m: self.take(Quantity::Torque),
            temperature_c: self.take(Quantity::Temperature),
            orientation_rad: self.take(Quantity::Orientation),
            loudness: self.loudness.take(),
            line: self.line.clone(),
            unsure_s: self.unsure_s,
            coarse_rad: self.coarse_rad,
            ..Session::default()
        };
        let of = |rows: Range<usize>| {
            let number = self.number(rows.start);
            let zero = self.zeros.iter().rfind(|(session, _)| *session <= number);
            let own_zero = zero.is_some_and(|(session, _)| *session == number);
            Session { own_zero, zero_off_rad: zero.map_or(0.0, |(_, off)| *off), ..whole.part(rows) }
        };
        self.sessions().map(of).collect()
    }

    /// The output angle, or the error where that was recorded.
    pub(crate) fn output_or_error(&self) -> Quantity {
        if self.columns[Quantity::Output as usize].is_some() { Quantity::Output } else { Quantity::Error }
    }

    /// A fault in these rows, in rising order, to be completed; none without rows.
    pub(super) fn fault(&self, name: FaultName, rows: impl IntoIterator<Item = usize>) -> Option<Fault> {
        let time = self.get(Quantity::Time);
        let at = |row: usize| (self.line[row], time.map(|time| time[row]).filter(|time| time.is_finite()));
        Fault::of_rows(name, rows.into_iter().map(at))
    }

    /// The session of a row.
    pub(super) fn number(&self, row: usize) -> u32 {
        self.session.get(row).copied().unwrap_or(0)
    }

    /// Whether a row goes on where the one before it ended; what is behind the last row does not.
    pub(crate) fn continues(&self, row: usize) -> bool {
        (1..self.len()).contains(&row) && self.number(row) == self.number(row - 1)
    }

    /// The rows that go on where the ones before them ended.
    pub(super) fn continued(&self) -> impl Iterator<Item = usize> + '_ {
        (1..self.len()).filter(|row| self.continues(*row))
    }

    /// The rows of the session that a row is of.
    pub(super) fn around(&self, row: usize) -> Range<usize> {
        let (number, all) = (self.number(row), &self.session);
        let end = if all.is_empty() { self.len() } else { all.partition_point(|of| *of <= number) };
        all.partition_point(|of| *of < number)..end
    }

    /// A series of a value for each row, session by session.
    pub(super) fn pieces<'a>(&'a self, values: &'a [f64]) -> impl Iterator<Item = &'a [f64]> {
        self.sessions().filter_map(|rows| values.get(rows))
    }

    /// Stretches of rows of a session, `shortest` of them at least, that are the same as the first.
    pub(super) fn runs(&self, values: &[f64], shortest: usize, same: impl Fn(f64, f64) -> bool) -> Vec<Range<usize>> {
        let (mut found, mut from) = (Vec::new(), 0);
        for row in 1..=values.len() {
            if !self.continues(row) || !same(values[row], values[from]) {
                found.push(std::mem::replace(&mut from, row)..row);
            }
        }
        found.retain(|run: &Range<usize>| run.len() >= shortest);
        found
    }

    /// The rows of each session.
    pub(crate) fn sessions(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let mut begin = 0;
        let ends = (1..=self.len()).filter(|row| !self.continues(*row));
        ends.map(move |end| std::mem::replace(&mut begin, end)..end)
    }

    /// Whether a row says what the one before says, in every column.
    pub(super) fn repeats(&self, row: usize) -> bool {
        self.columns.iter().flatten().all(|values| values[row].total_cmp(&values[row - 1]).is_eq())
    }

    /// Begins a session at these rows, in rising order, in addition to those that begin already.
    pub(super) fn begin_sessions(&mut self, at: &[usize]) {
        let (mut next, mut number) = (at.iter().peekable(), 0);
        let session = (0..self.len()).map(|row| {
            let begins = next.next_if(|at| **at == row).is_some() || !self.continues(row);
            number += u32::from(row > 0 && begins);
            number
        });
        self.session = session.collect();
    }

    /// Leaves out the rows for which `drop` is true.
    pub(crate) fn leave_out(&mut self, drop: &[bool]) {
        if !drop.contains(&true) {
            return;
        }
        self.line = kept(&self.line, drop);
        self.session = kept(&self.session, drop);
        self.columns.iter_mut().chain([&mut self.loudness]).flatten().for_each(|values| *values = kept(values, drop));
    }
}

/// The values for which `drop` is not true.
pub(super) fn kept<T: Copy>(values: &[T], drop: &[bool]) -> Vec<T> {
    values.iter().zip(drop).filter(|(_, drop)| !**drop).map(|(value, _)| *value).collect()
}

/// Reads a file called `file`, of at least `fewest` rows, with its columns in use: none of a guide log, whose numbers
/// need no mapping, and which says no generator angle, so that `ratio` is that of its axis.
pub(super) fn read(
    file: &str,
    bytes: Vec<u8>,
    map: &ColumnMap,
    ratio: f64,
    fewest: usize,
    findings: &mut Findings,
) -> Result<(Log, Vec<MappedColumn>), MeasuredError> {
    let refuse = |problem: TableProblem| MeasuredError::at(file, problem);
    if phd2::is_one(&bytes) {
        return guide_log(&bytes, map, ratio, findings).map(|log| (log, Vec::new())).map_err(refuse);
    }
    let sheet = Sheet::of(bytes, &map.known()).map_err(refuse)?;
    let layout = &sheet.layout;
    let columns = map.resolve(layout).map_err(refuse)?;
    let places: Vec<usize> = columns.iter().map(|column| column.place).collect();
    let read = sheet.columns(&places).map_err(refuse)?;
    findings.notes.extend(map.misspelt(&layout.names, &columns));
    findings.notes.extend(sheet.notes.iter().chain(&read.notes).cloned());
    match of_columns(layout, read, &columns, map.rate_hz, fewest, findings) {
        (_, Some(problem)) => Err(refuse(problem)),
        (log, None) => Ok((log, columns)),
    }
}

/// The log of `read`, which has the columns in use in their order; `rate_hz` if the file has no time; and the first
/// reason to refuse it, if there is one: then what cannot be used is missing in it.
pub(crate) fn of_columns(
    layout: &Layout,
    mut read: Columns,
    columns: &[MappedColumn],
    rate_hz: Option<f64>,
    fewest: usize,
    findings: &mut Findings,
) -> (Log, Option<TableProblem>) {
    let last = columns.iter().map(|column| column.place).max().unwrap_or(0);
    let broken_off = read.without_broken_end(last);
    let broken_off = broken_off.map(|line| Fault::new(FaultName::MissingSamples, [line; 2], 1));
    findings.add(broken_off, None::<Quantity>, Treatment::Masked, |_| {
        "the last line breaks off: it is left out".to_owned()
    });
    let notes = &mut findings.notes;
    let mut refused = check_rows(layout, &read, columns);
    let mut refuse = |why: Option<TableProblem>| refused = refused.take().or(why);
    let of_header = |what: String| Some(TableProblem { line: layout.header_line, what });
    if let Some((place, what)) = &layout.whole_seconds
        && columns.iter().any(|column| column.quantity == Quantity::Time && column.place == *place)
    {
        refuse(of_header(what.clone()));
    }
    let mut log = Log::default();
    for (column, cells) in columns.iter().zip(std::mem::take(&mut read.cells)) {
        refuse(check_cells(column, &cells));
        notes.extend(cells.over_note(&column.name));
        let times = cells.times.count > 0;
        let mut values = cells.values;
        let beyond = if times { None } else { within_limits(column, &values, &read.lines) };
        if beyond.is_some() || times && column.quantity != Quantity::Time {
            values.fill(f64::NAN);
        } else if !times {
            values.iter_mut().for_each(|value| *value = column.reading.value(*value));
        }
        refuse(beyond);
        if cells.time_of_day {
            past_midnight(&mut values, notes);
        }
        log.put(column.quantity, values);
    }
    log.line = read.lines;
    if log.len() < fewest {
        let rows = match log.len() {
            0 => "no rows".to_owned(),
            1 => "1 row".to_owned(),
            n => format!("{n} rows"),
        };
        refuse(of_header(format!(
            "{rows} after the header; at least {fewest} are needed: a log has a line for each instant of a motion"
        )));
    }
    let timed = log.get(Quantity::Time).is_some();
    if !timed && log.len() >= ROWS_OF_A_PART * read.restarts.len() {
        // Nothing else says where one recording ends and the next begins.
        let mut begins: Vec<usize> =
            read.restarts.iter().map(|names| log.line.partition_point(|line| line < names)).collect();
        begins.dedup();
        log.begin_sessions(&begins);
    }
    if let Some(rate_hz) = rate_hz.filter(|_| !timed) {
        log.put(Quantity::Time, (0..log.len()).map(|row| row as f64 / rate_hz).collect());
        notes.push(format!("time is counted, {rate_hz} rows in a second: rows that are lost cannot be seen"));
    } else if rate_hz.is_some() {
        refuse(of_header("the file has a column of time; allowed with it: no --rate".to_owned()));
    }
    in_order(&mut log, findings);
    (log, refused)
}

fn guide_log(bytes: &[u8], map: &ColumnMap, ratio: f64, findings: &mut Findings) -> Result<Log, TableProblem> {
    if *map != ColumnMap::default() {
        let what = "a guide log of PHD2 has columns and times of its own, found --columns or --rate; allowed: neither"
            .to_owned();
        return Err(TableProblem { line: 1, what });
    }
    let (log, notes) = phd2::read(bytes, ratio)?;
    if log.len() < FEWEST_ROWS {
        let what = format!("{} guided frames with a star; at least {FEWEST_ROWS} are needed", log.len());
        return Err(TableProblem { line: 1, what });
    }
    findings.notes.extend(notes);
    Ok(log)
}

/// Refuses rows that end before a column in use, or have more fields than names.
fn check_rows(layout: &Layout, read: &Columns, columns: &[MappedColumn]) -> Option<TableProblem> {
    let beyond = |fields: usize| columns.iter().find(|column| column.place >= fields);
    let is_odd = |(_, fields): &&(u64, usize)| *fields > layout.names.len() || beyond(*fields).is_some();
    let (line, fields) = read.odd.iter().filter(is_odd).min().copied()?;
    // A cell above it that is no number comes first.
    if read.cells.iter().filter_map(|cells| cells.words.first.as_ref()).any(|word| word.line <= line) {
        return None;
    }
    let what = match beyond(fields) {
        Some(column) => format!("{fields} fields, but {} is field {}", column.name, column.place + 1),
        None => format!("{fields} fields, but the header has {}", layout.names.len()),
    };
    Some(TableProblem { line, what })
}

/// Refuses what is neither a number nor nothing, and times elsewhere than in the column of time.
fn check_cells(column: &MappedColumn, cells: &Cells) -> Option<TableProblem> {
    let times = cells.times.first.as_ref().filter(|_| column.quantity != Quantity::Time);
    let cell = cells.words.first.iter().chain(times).min_by_key(|cell| cell.line)?;
    let more = cells.words.count.saturating_sub(1);
    let others = if more == 0 { String::new() } else { format!(" ({more} more in this column)") };
    let what = format!(
        "{}: found \"{}\"{others}, allowed: a number, or nothing where none was recorded",
        column.name, cell.text
    );
    Some(TableProblem { line: cell.line, what })
}

/// Refuses numbers that nothing of the kind has.
fn within_limits(column: &MappedColumn, numbers: &[f64], lines: &[u64]) -> Option<TableProblem> {
    let limit = column.quantity.limit();
    let row = numbers.iter().position(|number| column.reading.value(*number).abs() > limit)?;
    let unit = match column.quantity {
        Quantity::Error => super::columns::Unit::Radian,
        quantity => quantity.default_column().1,
    };
    let what = format!("{}: found \"{:e}\", allowed: at most {limit:e} {unit}", column.name, numbers[row]);
    Some(TableProblem { line: lines[row], what })
}

/// Rows in the order of their time.
fn in_order(log: &mut Log, findings: &mut Findings) {
    let Some((order, note)) = log.get(Quantity::Time).and_then(stamps::order) else { return };
    log.line = order.iter().map(|row| log.line[*row]).collect();
    for values in log.columns.iter_mut().flatten() {
        *values = order.iter().map(|row| values[*row]).collect();
    }
    let lines = [log.line.iter().copied().min().unwrap_or(1), log.line.iter().copied().max().unwrap_or(1)];
    let fault = Fault::new(FaultName::ClockError, lines, log.len() as u64);
    findings.add(Some(fault), Quantity::Time, Treatment::Repaired, |_| note);
}

/// A time of day goes on where a day ends.
fn past_midnight(time: &mut [f64], notes: &mut Vec<String>) {
    let (mut days, mut last) = (0.0, f64::NEG_INFINITY);
    for t in time.iter_mut().filter(|t| t.is_finite()) {
        // A clock that is set back by half a day or more has passed midnight.
        if *t < last - 0.5 * clock::DAY_S {
            days += 1.0;
        }
        last = *t;
        *t += days * clock::DAY_S;
    }
    if days > 0.0 {
        notes.push(format!("the time of day passes midnight {days} times: days are counted"));
    }
}
