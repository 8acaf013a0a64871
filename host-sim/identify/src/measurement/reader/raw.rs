//! All columns of a file, for looking at it before anything is known of it.

use super::super::log::{FEWEST_ROWS, MeasuredError};
use super::super::phd2;
use super::{Columns, FoundCell, Sheet, shortened};
use flexspline_base::csv_rows::TableProblem;

/// A file and all of its columns.
#[derive(Debug, Clone, PartialEq)]
pub struct RawFile {
    /// Which file.
    pub file: String,
    /// Its rows as text.
    pub(crate) sheet: Sheet,
    /// Its columns, in the order of their names.
    pub(crate) columns: Columns,
}

/// Reads numbers: `bytes` of a file called `file`.
///
/// # Errors
/// They are no text, or hold no rows of numbers.
pub fn parse(file: &str, bytes: impl Into<Vec<u8>>) -> Result<RawFile, MeasuredError> {
    let at = |problem: TableProblem| MeasuredError::at(file, problem);
    let refuse = |line: u64, what: String| Err(at(TableProblem { line, what }));
    let bytes = bytes.into();
    if phd2::is_one(&bytes) {
        let what = "a guide log of PHD2 has columns of its own, and needs no mapping: flexspline calibrate FILE \
                    --ratio N";
        return refuse(1, what.to_owned());
    }
    let sheet = Sheet::of(bytes, &[]).map_err(at)?;
    let all: Vec<usize> = (0..sheet.layout.names.len()).collect();
    let columns = sheet.columns(&all).map_err(at)?;
    let (rows, line) = (columns.lines.len(), sheet.layout.header_line);
    if !columns.cells.iter().any(|cells| cells.values.iter().any(|value| value.is_finite())) {
        let first = columns.cells.iter().find_map(|cells| cells.words.first.as_ref());
        let found = |cell: &FoundCell| format!("; found \"{}\" in line {}", shortened(&cell.text), cell.line);
        let found = first.map_or_else(String::new, found);
        return refuse(line, format!("no rows of numbers; allowed: a text file with a line for each instant{found}"));
    }
    if rows < FEWEST_ROWS {
        let what = format!("{rows} row{}; at least {FEWEST_ROWS} are needed", if rows == 1 { "" } else { "s" });
        return refuse(line, what);
    }
    Ok(RawFile { file: file.to_owned(), sheet, columns })
}
