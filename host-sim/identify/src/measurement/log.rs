//! A file as it stands: its columns in rad, s, N·m and °C, what is missing as NaN.

use std::io::{Cursor, Read};

use thiserror::Error;

use super::columns::{Column, ColumnMap, Quantity};
use super::reader::{Cells, Columns, Sheet, align, clock, slower, stamps, too_wide};
use super::{phd2, rollover};
use flexspline_base::csv_rows::TableProblem;

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
    /// The found value and the allowed ones.
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
    pub(crate) fn output_or_error(&self) -> Quantity {
        if self.columns[Quantity::Output as usize].is_some() { Quantity::Output } else { Quantity::Error }
    }

    /// Time of a row, s.
    pub(crate) fn time_at(&self, row: usize) -> Option<f64> {
        self.get(Quantity::Time).map(|time| time[row]).filter(|time| time.is_finite())
    }

    /// Session of a row.
    pub(crate) fn session_at(&self, row: usize) -> u32 {
        self.session.get(row).copied().unwrap_or(0)
    }

    /// Whether a row goes on where the one before it ended.
    pub(crate) fn continues(&self, row: usize) -> bool {
        row > 0 && self.session_at(row) == self.session_at(row - 1)
    }

    /// Leaves out the rows for which `drop` is true.
    pub(crate) fn leave_out(&mut self, drop: &[bool]) {
        leave_out(&mut self.line, drop);
        if !self.session.is_empty() {
            leave_out(&mut self.session, drop);
        }
        self.columns.iter_mut().flatten().for_each(|values| leave_out(values, drop));
    }
}

/// Leaves out the values for which `drop` is true.
pub(super) fn leave_out<T>(values: &mut Vec<T>, drop: &[bool]) {
    let mut row = 0;
    values.retain(|_| {
        row += 1;
        !drop[row - 1]
    });
}

/// The findings of the reader besides the rows.
#[derive(Debug)]
pub(super) struct Found {
    /// The columns in use.
    pub columns: Vec<Column>,
    /// The last line, if it broke off.
    pub broken_off: Option<u64>,
    /// What is wrong with the order of the rows, which was mended.
    pub order: Vec<String>,
    /// What was read otherwise than it stands, or not at all though it may have been meant.
    pub notes: Vec<String>,
    /// Whether each session has a zero of its own.
    pub own_zeros: bool,
}

/// Reads a file called `file`, of at least `fewest` rows; `ratio` is that of the axis of a guide log, which says no
/// generator angle.
pub(super) fn read(
    file: &str,
    mut source: impl Read,
    map: &ColumnMap,
    ratio: f64,
    fewest: usize,
) -> Result<(Log, Found), MeasuredError> {
    let refuse =
        |problem: TableProblem| MeasuredError { file: file.to_owned(), line: Some(problem.line), what: problem.what };
    let mut bytes = Vec::new();
    let begun = source.read_to_end(&mut bytes);
    begun.map_err(|error| refuse(TableProblem { line: 1, what: error.to_string() }))?;
    if phd2::is_one(&bytes) {
        return guide_log(file, bytes, map, ratio);
    }
    let sheet = Sheet::of(bytes, &map.known()).map_err(refuse)?;
    let layout = &sheet.layout;
    let columns = map.resolve(&layout.names, layout.header_line, Some(layout)).map_err(refuse)?;
    let mut notes = map.misspelt(&layout.names, &columns);
    notes.extend(sheet.notes.iter().cloned());
    let places: Vec<usize> = columns.iter().map(|column| column.place).collect();
    let mut read = sheet.columns(&places);
    let broken_off = broken_off(&sheet, &columns, &mut read).map_err(refuse)?;
    let mut log = Log::default();
    let mut local_time = false;
    for (column, cells) in columns.iter().zip(std::mem::take(&mut read.cells)) {
        check_cells(&sheet, column, &cells).map_err(refuse)?;
        notes.extend(cells.over_note(&column.name));
        log.time_of_day |= cells.time_of_day;
        local_time |= cells.local_time;
        let mut values = cells.values;
        if cells.times == 0 {
            values.iter_mut().for_each(|value| *value = column.reading.value(*value));
        }
        within_limits(&sheet, column, &values, &read.lines).map_err(refuse)?;
        log.put(column.quantity, values);
    }
    log.line = read.lines;
    let header_line = layout.header_line;
    if log.len() < fewest {
        let are = if fewest == 1 { "is" } else { "are" };
        let what = match log.len() {
            0 => format!("no rows after the header; at least {fewest} {are} needed"),
            n => format!("{n} row{} after the header; at least {fewest} {are} needed", if n == 1 { "" } else { "s" }),
        };
        return Err(refuse(TableProblem { line: header_line, what }));
    }
    past_midnight(&mut log, &mut notes);
    count_time(&mut log, map, &mut notes).map_err(|what| refuse(TableProblem { line: header_line, what }))?;
    align_channels(&sheet, &columns, &mut log, &mut notes);
    if let Some(time) = log.get_mut(Quantity::Time).filter(|_| local_time) {
        stamps::daylight_saving(time, &mut notes);
    }
    let mut order = Vec::new();
    in_order(&mut log, &mut order);
    rollover::undo(&mut log, &columns, &mut notes);
    slower::fill(&mut log, &mut notes);
    Ok((log, Found { columns, broken_off, order, notes, own_zeros: false }))
}

fn guide_log(file: &str, bytes: Vec<u8>, map: &ColumnMap, ratio: f64) -> Result<(Log, Found), MeasuredError> {
    let refuse =
        |problem: TableProblem| MeasuredError { file: file.to_owned(), line: Some(problem.line), what: problem.what };
    if *map != ColumnMap::default() {
        let what = "a guide log of PHD2 has columns and times of its own, found --columns or --rate; allowed: neither"
            .to_owned();
        return Err(refuse(TableProblem { line: 1, what }));
    }
    let (log, notes) = phd2::read(Cursor::new(bytes), ratio).map_err(refuse)?;
    if log.len() < FEWEST_ROWS {
        let what = format!("{} guided frames with a star; at least {FEWEST_ROWS} are needed", log.len());
        return Err(refuse(TableProblem { line: 1, what }));
    }
    Ok((log, Found { columns: phd2::columns(), broken_off: None, order: Vec::new(), notes, own_zeros: true }))
}

/// The line that breaks off, if it is the last one, whose row is then left out. A row of another width anywhere else is
/// an error.
fn broken_off(sheet: &Sheet, columns: &[Column], read: &mut Columns) -> Result<Option<u64>, TableProblem> {
    let rows = read.lines.len();
    let width = sheet.layout.names.len();
    let short = read.short.first().filter(|(row, _)| row + 1 < rows);
    let wide = read.wide.first();
    let first = match (short, wide) {
        (Some(short), Some(wide)) if wide.0 < short.0 => Some((wide, true)),
        (Some(short), _) => Some((short, false)),
        (None, wide) => wide.map(|wide| (wide, true)),
    };
    // A cell above it that is no number comes first.
    let before = |line: u64| {
        let words = read.cells.iter().filter_map(|cells| cells.first_word.as_ref());
        words.map(|cell| cell.line).min().is_none_or(|word| line < word)
    };
    if let Some(((row, fields), is_wide)) = first.filter(|((row, _), _)| before(read.lines[*row])) {
        let line = read.lines[*row];
        let what = if is_wide {
            too_wide(&sheet.row(*row), width)
        } else {
            let beyond = columns.iter().find(|column| column.place >= *fields);
            let (name, place) =
                beyond.map_or(("a column in use", width), |column| (column.name.as_str(), column.place));
            format!("{fields} fields, but {name} is field {}", place + 1)
        };
        return Err(TableProblem { line, what });
    }
    let Some((row, _)) = read.short.last().copied() else { return Ok(None) };
    let line = read.lines.remove(row);
    for cells in &mut read.cells {
        cells.values.remove(row);
        if cells.first_word.as_ref().is_some_and(|word| word.line == line) {
            cells.first_word = None;
        }
    }
    Ok(Some(line))
}

/// Refuses what is neither a number nor nothing, and times elsewhere than in the column of time.
fn check_cells(sheet: &Sheet, column: &Column, cells: &Cells) -> Result<(), TableProblem> {
    let times = cells.first_time.as_ref().filter(|_| column.quantity != Quantity::Time);
    let Some(cell) = cells.first_word.iter().chain(times).min_by_key(|cell| cell.line) else { return Ok(()) };
    let more = cells.words.saturating_sub(1);
    let others = if more == 0 { String::new() } else { format!(" ({more} more in this column)") };
    let unit = sheet.layout.unit_in_cells(column.place).map_or_else(String::new, |unit| format!(" in {unit}"));
    Err(TableProblem {
        line: cell.line,
        what: format!(
            "{}: found \"{}\"{others}, allowed: a number{unit}, or nothing where none was recorded",
            column.name, cell.text
        ),
    })
}

/// Refuses numbers that nothing of the kind has.
fn within_limits(sheet: &Sheet, column: &Column, values: &[f64], lines: &[u64]) -> Result<(), TableProblem> {
    let limit = column.quantity.limit();
    let Some(row) = values.iter().position(|value| value.abs() > limit) else { return Ok(()) };
    let text = sheet.text_at(row, column.place).unwrap_or_default();
    let unit = match column.quantity {
        Quantity::Error => super::columns::Unit::Radian,
        quantity => quantity.default_column().1,
    };
    Err(TableProblem {
        line: lines[row],
        what: format!("{}: found \"{text}\", allowed: at most {limit:e} {unit}", column.name),
    })
}

/// Channels that are recorded each at its own instants, laid on those of one of the angles.
fn align_channels(sheet: &Sheet, columns: &[Column], log: &mut Log, notes: &mut Vec<String>) {
    if sheet.layout.has_pairs() {
        align_pairs(sheet, columns, log, notes);
    }
    let follower = log.output_or_error();
    let (Some(generator), Some(output)) = (log.get(Quantity::Generator), log.get(follower)) else { return };
    if !align::apart(generator, output) {
        return;
    }
    let count = |values: &[f64]| values.iter().filter(|value| value.is_finite()).count();
    let base = if count(output) > count(generator) { follower } else { Quantity::Generator };
    let rows = log.len();
    let instants = log.get(Quantity::Time).map_or_else(|| (0..rows).map(|row| row as f64).collect(), <[f64]>::to_vec);
    let drop: Vec<bool> = log.get(base).map_or_else(Vec::new, |values| {
        values.iter().zip(&instants).map(|(value, instant)| !value.is_finite() || !instant.is_finite()).collect()
    });
    let at: Vec<f64> = (0..rows).filter(|row| !drop[*row]).map(|row| instants[row]).collect();
    let mut aligned = Vec::new();
    let mut farthest: f64 = 0.0;
    for channel in Quantity::ALL.into_iter().filter(|channel| *channel != base && *channel != Quantity::Time) {
        let Some(values) = log.get(channel) else { continue };
        let (values, far) = align::at(&at, &instants, values, is_angle(channel));
        farthest = farthest.max(far);
        aligned.push((channel, values));
    }
    log.leave_out(&drop);
    for (channel, values) in aligned {
        log.put(channel, values);
    }
    notes.push(format!(
        "generator and {follower} are never recorded in one row: the other channels are laid on the {} rows of the \
         {base}, up to {farthest:.3} s away, by cubics through their own values",
        at.len()
    ));
}

fn is_angle(channel: Quantity) -> bool {
    matches!(channel, Quantity::Generator | Quantity::Output | Quantity::Error)
}

fn align_pairs(sheet: &Sheet, columns: &[Column], log: &mut Log, notes: &mut Vec<String>) {
    let time = columns.iter().find(|column| column.quantity == Quantity::Time).map_or(0, |column| column.place);
    let (mut moved, mut farthest) = (0, 0.0_f64);
    let mut read = sheet.columns(&[time]).cells;
    let Some(base) = read.pop().map(|cells| cells.values) else { return };
    for column in columns.iter().filter(|column| column.place % 2 == 1) {
        let own = sheet.columns(&[column.place - 1]).cells.pop().map(|cells| cells.values).unwrap_or_default();
        let same = own.iter().zip(&base).all(|(a, b)| a == b || a.is_nan() || b.is_nan());
        if same || own.len() < log.len() {
            continue;
        }
        let Some(values) = log.get_mut(column.quantity) else { continue };
        let rows = values.len();
        let (aligned, far) = align::at(&base[..rows], &own[..rows], values, is_angle(column.quantity));
        *values = aligned;
        (moved, farthest) = (moved + 1, farthest.max(far));
    }
    if moved > 0 {
        notes.push(format!(
            "each channel has stamps of its own: {moved} are laid on those of column {}, which are up to {farthest} \
             (in its unit) away",
            time + 1
        ));
    }
}

/// Rows in the order of their time, each once.
fn in_order(log: &mut Log, said: &mut Vec<String>) {
    if let Some((order, note)) = log.get(Quantity::Time).and_then(stamps::order) {
        log.line = order.iter().map(|row| log.line[*row]).collect();
        for values in log.columns.iter_mut().flatten() {
            *values = order.iter().map(|row| values[*row]).collect();
        }
        said.push(note);
    }
    if log.get(Quantity::Time).is_none() {
        return;
    }
    let columns: Vec<&[f64]> = log.columns.iter().flatten().map(Vec::as_slice).collect();
    if let Some((drop, note)) = stamps::twice(&columns) {
        log.leave_out(&drop);
        said.push(note);
    }
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
