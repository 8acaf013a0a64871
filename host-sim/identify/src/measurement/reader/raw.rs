//! All columns of a file as they stand, for looking at it before anything is known of it.

use std::io::Read;
use std::path::Path;

use super::super::log::{FEWEST_ROWS, MeasuredError};
use super::super::{bytes_of, phd2};
use super::layout::{Separator, Shape};
use super::{Cells, FoundCell, Sheet, align, shortened};
use flexspline_base::csv_rows::TableProblem;

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
    /// The first line that a measurement would be refused for its width, and why.
    pub refused: Option<FoundCell>,
    /// What was read otherwise than it stands, or left out.
    pub notes: Vec<String>,
    /// The columns.
    pub columns: Vec<RawColumn>,
}

/// A column as it stands.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RawColumn {
    /// Its name, `#1` and so on where the file has none.
    pub name: String,
    /// What a line of units, or the cells, say.
    pub unit: Option<String>,
    /// Its cells.
    pub(crate) cells: Cells,
}

/// Reads a file of numbers.
///
/// # Errors
/// The file cannot be read, is no text, or holds no rows of numbers.
pub fn read(path: &Path) -> Result<RawFile, MeasuredError> {
    let (file, bytes) = bytes_of(path)?;
    parse(&file, &bytes[..])
}

/// Reads numbers from `source`, a file called `file`.
///
/// # Errors
/// As [`read`].
pub fn parse(file: &str, mut source: impl Read) -> Result<RawFile, MeasuredError> {
    let refuse =
        |problem: TableProblem| MeasuredError { file: file.to_owned(), line: Some(problem.line), what: problem.what };
    let mut bytes = Vec::new();
    source.read_to_end(&mut bytes).map_err(|error| refuse(TableProblem { line: 1, what: error.to_string() }))?;
    if phd2::is_one(&bytes[..bytes.len().min(super::layout::HEAD)]) {
        let what = "a guide log of PHD2 has columns of its own, and needs no mapping: flexspline calibrate FILE \
                    --ratio N"
            .to_owned();
        return Err(refuse(TableProblem { line: 1, what }));
    }
    let sheet = Sheet::of(bytes, &[]).map_err(refuse)?;
    let names = &sheet.layout.names;
    let all: Vec<usize> = (0..names.len()).collect();
    let read = sheet.columns(&all);
    let mut notes = sheet.notes.clone();
    let mut columns: Vec<RawColumn> = Vec::with_capacity(names.len());
    for (place, cells) in read.cells.into_iter().enumerate() {
        let name = names[place].clone();
        notes.extend(cells.over_note(&name));
        columns.push(RawColumn {
            name,
            unit: sheet.layout.units.get(place).filter(|unit| !unit.is_empty()).cloned(),
            cells,
        });
    }
    let rows = read.lines.len();
    let numbers = columns.iter().any(|column| column.cells.values.iter().any(|value| value.is_finite()));
    if rows < FEWEST_ROWS || !numbers {
        let what = if numbers {
            format!("{rows} row{}; at least {FEWEST_ROWS} are needed", if rows == 1 { "" } else { "s" })
        } else {
            let first = columns.iter().find_map(|column| column.cells.first_word.clone());
            let found = first.map_or_else(String::new, |cell| {
                format!("; found \"{}\" in line {}", shortened(&cell.text), cell.line)
            });
            format!("no rows of numbers; allowed: a text file with a line for each instant{found}")
        };
        return Err(refuse(TableProblem { line: sheet.layout.header_line, what }));
    }
    let refused = read.wide.first().into_iter().chain(read.short.iter().find(|(row, _)| row + 1 < rows)).min().map(
        |(row, fields)| FoundCell {
            line: read.lines[*row],
            text: format!("{fields} fields, but the header has {}", names.len()),
        },
    );
    let mut file = RawFile {
        file: file.to_owned(),
        separator: sheet.layout.separator,
        decimal_comma: sheet.layout.decimal_comma,
        has_names: sheet.layout.has_names,
        header_line: sheet.layout.header_line,
        rows,
        odd_rows: read.wide.len() + read.short.len(),
        refused,
        notes,
        columns,
    };
    match sheet.layout.shape {
        Shape::Pairs => file.align_pairs(),
        _ => file.align_sparse(),
    }
    Ok(file)
}

impl RawFile {
    /// Channels with a time column each, laid on the instants of the first.
    fn align_pairs(&mut self) {
        let own: Vec<Vec<f64>> = self.columns.iter().step_by(2).map(|column| column.cells.values.clone()).collect();
        if let Some(note) = align_pairs(&own, self.columns.iter_mut().map(|column| &mut column.cells.values)) {
            self.notes.push(note);
        }
    }

    /// Channels that are never recorded in one row, laid on the rows of the one that has most.
    fn align_sparse(&mut self) {
        let count = |column: &RawColumn| column.cells.values.iter().filter(|value| value.is_finite()).count();
        let full = |column: &RawColumn| 10 * count(column) > 9 * self.rows;
        let sparse: Vec<usize> = (0..self.columns.len())
            .filter(|k| count(&self.columns[*k]) >= FEWEST_ROWS && !full(&self.columns[*k]))
            .collect();
        let Some(base) = sparse.iter().copied().max_by_key(|k| (count(&self.columns[*k]), usize::MAX - k)) else {
            return;
        };
        let other = sparse
            .iter()
            .any(|k| *k != base && align::apart(&self.columns[base].cells.values, &self.columns[*k].cells.values));
        if !other {
            return;
        }
        let rows: Vec<f64> = (0..self.rows).map(|row| row as f64).collect();
        let time = self.columns.iter().find(|column| full(column) && rises(&column.cells.values));
        let instants = time.map_or(rows, |column| column.cells.values.clone());
        let keep: Vec<usize> = (0..self.rows).filter(|row| self.columns[base].cells.values[*row].is_finite()).collect();
        let at: Vec<f64> = keep.iter().map(|row| instants[*row]).collect();
        for (k, column) in self.columns.iter_mut().enumerate() {
            column.cells.values = if sparse.contains(&k) && k != base {
                align::at(&at, &instants, &column.cells.values, false).0
            } else {
                keep.iter().map(|row| column.cells.values[*row]).collect()
            };
        }
        self.notes.push(format!(
            "the channels are not recorded in the same rows: {} of {} rows have {}, and the others are laid on these \
             by their time",
            keep.len(),
            self.rows,
            self.columns[base].name
        ));
        self.rows = keep.len();
    }
}

/// Whether a column never falls.
fn rises(values: &[f64]) -> bool {
    let finite: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    finite.windows(2).all(|pair| pair[1] >= pair[0])
}

/// Lays channels on the instants of the first time column, where they differ; `own` are the time columns, `columns` all
/// columns, times first.
pub(in crate::measurement) fn align_pairs<'a>(
    own: &[Vec<f64>],
    columns: impl Iterator<Item = &'a mut Vec<f64>>,
) -> Option<String> {
    let same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| a == b || a.is_nan() || b.is_nan());
    let first = own.first()?;
    let mut moved = 0;
    let mut farthest: f64 = 0.0;
    for (k, values) in columns.enumerate() {
        let of = &own[k / 2];
        if k / 2 == 0 || same(first, of) {
            continue;
        }
        if k % 2 == 0 {
            values.clone_from(first);
            continue;
        }
        let (aligned, far) = align::at(first, of, values, false);
        *values = aligned;
        (moved, farthest) = (moved + 1, farthest.max(far));
    }
    (moved > 0).then(|| {
        format!(
            "each channel has stamps of its own: {moved} are laid on those of the first, which are up to {farthest} \
             (in its unit) away"
        )
    })
}
