//! A file as it stands: its columns in rad, s, N·m and °C, what is missing as NaN.

use std::io::{Cursor, Read};

use thiserror::Error;

use super::clock_text;
use super::columns::{Column, ColumnMap, Quantity};
use super::csv_rows::{CsvRows, NotANumber, Row, TableProblem};
use super::layout::{HEAD, Layout, missing};
use super::{phd2, rollover, slower};

/// Fewest rows that say anything about noise or an order.
pub const FEWEST_ROWS: usize = 16;

/// Measured data that cannot be used. Its text names file, line where there is one, what was found and what is allowed.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{file}{}: {what}", .line.map_or_else(String::new, |line| format!(":{line}")))]
pub struct MeasuredError {
    /// Which file.
    pub file: String,
    /// Line, from 1, if one is to blame.
    pub line: Option<u64>,
    /// What was found and what is allowed.
    pub what: String,
}

/// Columns of the same length.
#[derive(Clone, Debug, Default)]
pub(super) struct Log {
    /// Line of each row.
    pub line: Vec<u64>,
    /// Session of each row; empty as long as there is one.
    pub session: Vec<u32>,
    /// Whether time is a time of day.
    pub time_of_day: bool,
    columns: [Option<Vec<f64>>; 7],
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

    /// The output angle, or the error where that was recorded.
    pub fn output_or_error(&self) -> Quantity {
        if self.columns[Quantity::Output as usize].is_some() { Quantity::Output } else { Quantity::Error }
    }

    /// Time of a row, s.
    pub fn time_at(&self, row: usize) -> Option<f64> {
        self.get(Quantity::Time).map(|time| time[row]).filter(|time| time.is_finite())
    }

    /// Session of a row.
    pub fn session_at(&self, row: usize) -> u32 {
        self.session.get(row).copied().unwrap_or(0)
    }

    /// Whether a row goes on where the one before it ended.
    pub fn continues(&self, row: usize) -> bool {
        row > 0 && self.session_at(row) == self.session_at(row - 1)
    }

    /// Leaves out the rows for which `drop` is true.
    pub fn leave_out(&mut self, drop: &[bool]) {
        fn thin<T>(values: &mut Vec<T>, drop: &[bool]) {
            let mut row = 0;
            values.retain(|_| {
                row += 1;
                !drop[row - 1]
            });
        }
        thin(&mut self.line, drop);
        if !self.session.is_empty() {
            thin(&mut self.session, drop);
        }
        for values in self.columns.iter_mut().flatten() {
            thin(values, drop);
        }
    }
}

/// What reading found besides the rows.
#[derive(Debug)]
pub(super) struct Found {
    /// The columns in use.
    pub columns: Vec<Column>,
    /// The last line, if it broke off.
    pub broken_off: Option<u64>,
    /// What was read otherwise than it stands, or not at all though it may have been meant.
    pub notes: Vec<String>,
    /// Whether each session has a zero of its own.
    pub own_zeros: bool,
}

/// Reads a file called `file`; `ratio` is that of the axis of a guide log, which says no generator angle.
pub(super) fn read(
    file: &str,
    mut source: impl Read,
    map: &ColumnMap,
    ratio: f64,
) -> Result<(Log, Found), MeasuredError> {
    let refuse =
        |problem: TableProblem| MeasuredError { file: file.to_owned(), line: Some(problem.line), what: problem.what };
    let mut head = Vec::new();
    let begun = source.by_ref().take(HEAD).read_to_end(&mut head);
    begun.map_err(|error| refuse(TableProblem { line: 1, what: error.to_string() }))?;
    if phd2::is_one(&head) {
        if *map != ColumnMap::default() {
            let what =
                "a guide log of PHD2 has columns and times of its own, found --columns or --rate; allowed: neither"
                    .to_owned();
            return Err(refuse(TableProblem { line: 1, what }));
        }
        let (log, notes) = phd2::read(Cursor::new(head).chain(source), ratio).map_err(refuse)?;
        if log.len() < FEWEST_ROWS {
            let what = format!("{} guided frames with a star; at least {FEWEST_ROWS} are needed", log.len());
            return Err(refuse(TableProblem { line: 1, what }));
        }
        return Ok((log, Found { columns: phd2::columns(), broken_off: None, notes, own_zeros: true }));
    }
    let layout = Layout::of(&head, &map.known());
    let source = Cursor::new(head).chain(source);
    let mut rows = match &layout {
        None => CsvRows::new(source),
        Some(layout) => CsvRows::by_layout(source, layout),
    }
    .map_err(refuse)?;
    let columns = map.resolve(rows.header(), rows.header_line(), layout.as_ref()).map_err(refuse)?;
    let mut notes = map.misspelt(rows.header(), &columns);
    let names = rows.header().to_vec();
    let width = names.len();
    let mut restarts = Vec::new();
    let header_line = rows.header_line();
    let mut values: Vec<Vec<f64>> = vec![Vec::new(); columns.len()];
    let mut log = Log::default();
    // A short row is an error unless the file ends with it.
    let mut short: Option<TableProblem> = None;
    while let Some(row) = rows.next_row().map_err(refuse)? {
        if let Some(problem) = short {
            return Err(refuse(problem));
        }
        if row.repeats(&names) {
            restarts.push(row.line);
            continue;
        }
        let at = |what: String| refuse(TableProblem { line: row.line, what });
        if row.fields() > width && !row.blank_from(width) {
            return Err(at(too_wide(&row, width)));
        }
        if let Some(column) = columns.iter().find(|column| column.place >= row.fields()) {
            let what = format!("{} fields, but {} is field {}", row.fields(), column.name, column.place + 1);
            short = Some(TableProblem { line: row.line, what });
            continue;
        }
        for (column, values) in columns.iter().zip(&mut values) {
            values.push(number(&row, column, &mut log.time_of_day).map_err(at)?);
        }
        log.line.push(row.line);
    }
    let broken_off = short.map(|problem| problem.line);
    if log.len() < FEWEST_ROWS {
        let what = match log.len() {
            0 => format!("no rows after the header; at least {FEWEST_ROWS} are needed"),
            n => {
                format!("{n} row{} after the header; at least {FEWEST_ROWS} are needed", if n == 1 { "" } else { "s" })
            }
        };
        return Err(refuse(TableProblem { line: header_line, what }));
    }
    if let Some(first) = restarts.first() {
        let times = if restarts.len() == 1 { "once".to_owned() } else { format!("{} times", restarts.len()) };
        notes.push(format!(
            "the names of the columns are repeated {times}, first in line {first}: these lines are left out"
        ));
    }
    for (column, mut values) in columns.iter().zip(values) {
        values.shrink_to_fit();
        log.put(column.quantity, values);
    }
    past_midnight(&mut log, &mut notes);
    count_time(&mut log, map, &mut notes).map_err(|what| refuse(TableProblem { line: header_line, what }))?;
    rollover::undo(&mut log, &columns, &mut notes);
    slower::fill(&mut log, &mut notes);
    Ok((log, Found { columns, broken_off, notes, own_zeros: false }))
}

/// The time of rows that were recorded at a rate, where the file has none.
fn count_time(log: &mut Log, map: &ColumnMap, notes: &mut Vec<String>) -> Result<(), String> {
    let Some(rate_hz) = map.rate_hz() else { return Ok(()) };
    if log.get(Quantity::Time).is_some() {
        return Err("the file has a column of time; allowed with it: no --rate".to_owned());
    }
    log.put(Quantity::Time, (0..log.len()).map(|row| row as f64 / rate_hz).collect());
    notes.push(format!("time is counted, {rate_hz} rows in a second: rows that are lost cannot be seen"));
    Ok(())
}

/// A time of day goes on where a day ends.
fn past_midnight(log: &mut Log, notes: &mut Vec<String>) {
    if !log.time_of_day {
        return;
    }
    let Some(time) = log.get_mut(Quantity::Time) else { return };
    let (mut days, mut last) = (0.0, f64::NEG_INFINITY);
    for t in time.iter_mut().filter(|t| t.is_finite()) {
        // A clock that is set back by half a day or more has passed midnight.
        if *t < last - 0.5 * clock_text::DAY_S {
            days += 1.0;
        }
        last = *t;
        *t += days * clock_text::DAY_S;
    }
    if days > 0.0 {
        notes.push(format!("the time of day passes midnight {days} times: days are counted"));
    }
}

/// The value of a column, NaN if it is missing or not finite; notes a time of day.
fn number(row: &Row<'_>, column: &Column, time_of_day: &mut bool) -> Result<f64, String> {
    let value = match row.number(column.place) {
        Ok(value) if value.is_finite() => column.reading.value(value),
        Ok(_) => return Ok(f64::NAN),
        Err(NotANumber::Text(text)) if missing(&text) => return Ok(f64::NAN),
        Err(NotANumber::Text(text))
            if column.quantity == Quantity::Time
                && let Some(seconds) = clock_text::seconds(&text) =>
        {
            *time_of_day |= clock_text::has_no_date(&text);
            seconds
        }
        Err(NotANumber::Text(text)) => {
            return Err(format!(
                "{}: found \"{text}\", allowed: a number, or nothing where none was recorded",
                column.name
            ));
        }
        Err(NotANumber::Absent(fields)) => return Err(format!("{} is missing: {fields} fields", column.name)),
    };
    let limit = column.quantity.limit();
    if value.abs() > limit {
        let text = row.text(column.place).unwrap_or_default();
        let unit = column.quantity.default_column().1;
        let unit = if column.quantity == Quantity::Error { super::columns::Unit::Radian } else { unit };
        return Err(format!("{}: found \"{text}\", allowed: at most {limit:e} {unit}", column.name));
    }
    Ok(value)
}

fn too_wide(row: &Row<'_>, width: usize) -> String {
    let mut what = format!("{} fields, but the header has {width}", row.fields());
    // Whole numbers on both sides of commas are what decimal commas leave.
    let whole = |place: usize| {
        let text = row.text(place).unwrap_or_default();
        let digits = text.trim_start_matches(['-', '+']);
        !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit())
    };
    if row.fields() > width + 1 && (0..row.fields()).all(whole) {
        what.push_str("; numbers are written with a point, not with a comma");
    }
    what
}
