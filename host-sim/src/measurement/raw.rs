//! A file of numbers as it stands, whatever its columns are: for looking at it before anything is known of it.

use std::fs::File;
use std::io::{Cursor, Read};
use std::path::Path;

use super::csv_rows::{CsvRows, NotANumber, TableProblem};
use super::layout::{HEAD, Layout, Separator, missing};
use super::log::{FEWEST_ROWS, MeasuredError};
use super::{clock_text, phd2};

/// A file as it stands.
#[derive(Debug, Clone, PartialEq)]
pub struct RawFile {
    /// Which file.
    pub file: String,
    /// Between fields.
    pub separator: Separator,
    /// Whether decimals follow a comma.
    pub decimal_comma: bool,
    /// Whether the file names its columns.
    pub has_names: bool,
    /// The line of the names.
    pub header_line: u64,
    /// Lines of the rows.
    pub rows: usize,
    /// Rows of another width than the header, which a measurement may not have.
    pub odd_rows: usize,
    /// The columns.
    pub columns: Vec<RawColumn>,
}

/// A column as it stands.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RawColumn {
    /// Its name, `#1` and so on where the file has none.
    pub name: String,
    /// What a line of units says.
    pub unit: Option<String>,
    /// Numbers, or seconds where times are written as text; NaN where there is neither.
    pub values: Vec<f64>,
    /// Fields that are times written as text.
    pub times: usize,
    /// Fields in which nothing was recorded.
    pub empty: usize,
    /// Fields that are words.
    pub words: usize,
}

/// Reads a file of numbers.
///
/// # Errors
/// The file cannot be read, is no text, or holds no rows of numbers.
pub fn read(path: &Path) -> Result<RawFile, MeasuredError> {
    let file = path.display().to_string();
    match File::open(path) {
        Ok(source) => parse(&file, source),
        Err(error) => Err(MeasuredError { file, line: None, what: error.to_string() }),
    }
}

/// Reads numbers from `source`, a file called `file`.
///
/// # Errors
/// As [`read`].
pub fn parse(file: &str, mut source: impl Read) -> Result<RawFile, MeasuredError> {
    let refuse =
        |problem: TableProblem| MeasuredError { file: file.to_owned(), line: Some(problem.line), what: problem.what };
    let mut head = Vec::new();
    let begun = source.by_ref().take(HEAD).read_to_end(&mut head);
    begun.map_err(|error| refuse(TableProblem { line: 1, what: error.to_string() }))?;
    if phd2::is_one(&head) {
        let what =
            "a guide log of PHD2 has columns of its own, and needs no mapping: flexspline calibrate FILE --ratio N"
                .to_owned();
        return Err(refuse(TableProblem { line: 1, what }));
    }
    let layout = Layout::of(&head, &[]);
    let source = Cursor::new(head).chain(source);
    let mut rows = match &layout {
        None => CsvRows::new(source),
        Some(layout) => CsvRows::by_layout(source, layout),
    }
    .map_err(refuse)?;
    let names = rows.header().to_vec();
    let header_line = rows.header_line();
    let unit = |place: usize| layout.as_ref().and_then(|layout| layout.units.get(place)).cloned();
    let mut columns: Vec<RawColumn> = names
        .iter()
        .enumerate()
        .map(|(place, name)| RawColumn { name: name.clone(), unit: unit(place), ..RawColumn::default() })
        .collect();
    let (mut count, mut odd_rows) = (0, 0);
    while let Some(row) = rows.next_row().map_err(refuse)? {
        if row.repeats(&names) {
            continue;
        }
        count += 1;
        odd_rows += usize::from(row.fields() < names.len() || !row.blank_from(names.len()));
        for (place, column) in columns.iter_mut().enumerate() {
            let value = match row.number(place) {
                Ok(value) => value,
                Err(NotANumber::Text(text)) if !missing(&text) => match clock_text::seconds(&text) {
                    Some(seconds) => {
                        column.times += 1;
                        seconds
                    }
                    None => {
                        column.words += 1;
                        f64::NAN
                    }
                },
                Err(_) => {
                    column.empty += 1;
                    f64::NAN
                }
            };
            column.values.push(if value.is_finite() { value } else { f64::NAN });
        }
    }
    let numbers = columns.iter().any(|column| column.values.iter().any(|value| value.is_finite()));
    if count < FEWEST_ROWS || !numbers {
        let what = match count {
            0 => "no rows of numbers; allowed: a text file with a line for each instant".to_owned(),
            n if numbers => format!("{n} rows; at least {FEWEST_ROWS} are needed"),
            _ => "no rows of numbers; allowed: a text file with a line for each instant".to_owned(),
        };
        return Err(refuse(TableProblem { line: header_line, what }));
    }
    Ok(RawFile {
        file: file.to_owned(),
        separator: layout.as_ref().map_or(Separator::Comma, |layout| layout.separator),
        decimal_comma: layout.as_ref().is_some_and(|layout| layout.decimal_comma),
        has_names: layout.as_ref().is_none_or(|layout| layout.has_names),
        header_line,
        rows: count,
        odd_rows,
        columns,
    })
}
