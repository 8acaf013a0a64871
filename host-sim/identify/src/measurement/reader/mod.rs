//! The one reader of other people's files: bytes to text, text to rows of one layout, cells to numbers.
//!
//! [`Sheet::of`] finds the layout; `Sheet::columns` reads the columns that are asked for. Whatever is left out or
//! converted is said in notes with its line. `look` asks for all columns, `calibrate`, `diagnose` and `replay` for
//! those of the mapping.

pub(super) mod clock;
mod layout;
mod number;
pub mod raw;
pub(super) mod stamps;
mod text;

use flexspline_base::csv_rows::TableProblem;
pub(super) use layout::unit_word;
pub use layout::{Layout, Separator};
use layout::{begins_with_a_word, is_comment, lines_text, looks_like_names, plain, shortened, texts, with_tabs};
use number::CellValue;

/// Lines that a quoted field may spread over: a quote that nothing closes would take the rest of the file. *Guess*: a
/// header of a spreadsheet has two or three.
const MOST_LINES_OF_A_FIELD: usize = 20;

/// A file as rows of text.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    /// How it is laid out.
    pub layout: Layout,
    /// Sentences on what was converted or left out.
    pub notes: Vec<String>,
    text: Vec<u8>,
}

/// A cell that was found, for whoever has to say so.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct FoundCell {
    /// Line of the file, from 1.
    pub line: u64,
    /// The text there.
    pub text: String,
}

/// Cells of one kind: how many, and the first of them.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct CellCount {
    pub count: usize,
    pub first: Option<FoundCell>,
}

impl CellCount {
    fn one(&mut self, field: &[u8], line: u64) {
        self.count += 1;
        let text = || String::from_utf8_lossy(field).into_owned();
        self.first.get_or_insert_with(|| FoundCell { line, text: text() });
    }
}

/// A column of a [`Sheet`].
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Cells {
    /// Numbers, or seconds where times are written as text; NaN where there is neither.
    pub values: Vec<f64>,
    /// Times written as text.
    pub times: CellCount,
    /// Whether a time has no date.
    pub time_of_day: bool,
    /// Whether a number is written with decimals: then they are no counts, though all may be whole.
    pub decimals: bool,
    /// Cells in which nothing was recorded.
    pub empty: usize,
    /// Cells that say that the value was beyond the range.
    pub over: CellCount,
    /// Cells that are words.
    pub words: CellCount,
}

/// Columns as they were read.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Columns {
    /// Those that were asked for.
    pub cells: Vec<Cells>,
    /// Line of each row.
    pub lines: Vec<u64>,
    /// Rows that have fewer fields than names, or more which are not blank: line, and fields it has.
    pub odd: Vec<(u64, usize)>,
    /// Lines that repeat the names of the columns.
    pub restarts: Vec<u64>,
    /// Sentences on what was left out.
    pub notes: Vec<String>,
}

impl Sheet {
    /// Reads the bytes of a file; `known` are names of columns that are looked for.
    ///
    /// # Errors
    /// The file is no text, or has another form than a row for each instant.
    pub fn of(bytes: Vec<u8>, known: &[&str]) -> Result<Sheet, TableProblem> {
        let mut notes = Vec::new();
        let text = text::of(bytes, &mut notes)?;
        let layout = Layout::of(&text, known, &mut notes)?;
        let text = if layout.separator == Separator::Blanks { with_tabs(&text) } else { text };
        Ok(Sheet { layout, notes, text })
    }

    /// Reads the columns at these places.
    ///
    /// # Errors
    /// A quote is open, or a second line of names has other ones.
    pub(crate) fn columns(&self, places: &[usize]) -> Result<Columns, TableProblem> {
        let mut read = Columns { cells: vec![Cells::default(); places.len()], ..Columns::default() };
        let above = self.layout.first_row_line - 1;
        let begins = memchr::memchr_iter(b'\n', &self.text).take(above as usize).last().map_or(0, |end| end + 1);
        let [zeros, quotes] = [0, b'"'].map(|byte| memchr::memchr(byte, &self.text).is_some());
        // Lines that begin with a word where most have a number: what follows them says whether they are rows.
        let mut wordy: Vec<(u64, csv::ByteRecord)> = Vec::new();
        let mut holes = Vec::new();
        let mut records = self.layout.separator.records(&self.text[begins..]);
        let mut record = csv::ByteRecord::new();
        loop {
            let more = records.read_byte_record(&mut record);
            // The text ends with the end of a line.
            let line = above + records.position().line() - 1;
            if !more.map_err(|error| TableProblem { line, what: error.to_string() })? {
                break;
            }
            let spread = if quotes { memchr::memchr_iter(b'\n', record.as_slice()).count() } else { 0 };
            if spread > MOST_LINES_OF_A_FIELD {
                let what = "a quote that nothing closes; allowed: quotes in pairs".to_owned();
                return Err(TableProblem { line: line - spread as u64, what });
            }
            if zeros && memchr::memchr(0, record.as_slice()).is_some() {
                holes.push(line);
                continue;
            }
            if is_comment(&record) || record.len() == 1 && plain(&record[0]).is_empty() {
                continue;
            }
            // Words are seldom: a row begins with a digit, a sign or a quote.
            let first = record.get(0).map_or(&b""[..], plain).first().copied().unwrap_or(b'0');
            let letter = first.is_ascii_alphabetic() || matches!(first, b'[' | b'%' | b'_' | 0x80..);
            if letter && (begins_with_a_word(&texts(&record), &self.layout.kinds) || self.has_the_names(&record)) {
                wordy.push((line, record.clone()));
                continue;
            }
            self.sort_out(places, &mut wordy, &mut read)?;
            self.read_row(places, &record, line, &mut read);
        }
        if let Some(first) = holes.first() {
            let (lines, are) = if holes.len() == 1 { ("line", "it is") } else { ("lines", "they are") };
            read.notes.push(format!(
                "zero bytes stand in {} {lines}, first in line {first}, as a card leaves them that lost its power: \
                 {are} left out",
                holes.len()
            ));
        }
        // What begins with words at the end is a summary.
        let summary = wordy.first().zip(wordy.last()).filter(|_| !read.lines.is_empty());
        let names = wordy.iter().any(|(_, record)| self.has_the_names(record));
        if let Some(((first, record), (last, _))) = summary.filter(|_| !names) {
            let (lines, are) = lines_text(*first, *last);
            let rows = if first == last { "row" } else { "rows" };
            let from = shortened(&texts(record)[0]);
            read.notes.push(format!("{lines} at the end, from \"{from}\" on, {are} no {rows}: left out"));
        } else {
            self.sort_out(places, &mut wordy, &mut read)?;
        }
        if let Some(first) = read.restarts.first() {
            let count = read.restarts.len();
            let times = if count == 1 { "once".to_owned() } else { format!("{count} times") };
            read.notes.push(format!(
                "the names of the columns are repeated {times}, first in line {first}: these lines are left out"
            ));
        }
        Ok(read)
    }

    fn has_the_names(&self, record: &csv::ByteRecord) -> bool {
        self.layout.has_names && texts(record) == self.layout.names
    }

    /// Reads the cells of a row.
    fn read_row(&self, places: &[usize], record: &csv::ByteRecord, line: u64, read: &mut Columns) {
        let (count, width) = (record.len(), self.layout.names.len());
        if count < width || record.iter().skip(width).any(|field| !plain(field).is_empty()) {
            read.odd.push((line, count));
        }
        read.lines.push(line);
        for (cells, place) in read.cells.iter_mut().zip(places) {
            let field = record.get(*place).map_or(&b""[..], plain);
            let value = self.cell(cells, *place, field, line);
            cells.values.push(value);
        }
    }

    /// The value of one cell of the column at `place`.
    fn cell(&self, cells: &mut Cells, place: usize, field: &[u8], line: u64) -> f64 {
        match number::cell(field, self.layout.decimal_comma) {
            CellValue::Number(value) => {
                cells.decimals = cells.decimals || field.iter().any(|byte| matches!(byte, b'.' | b','));
                return value;
            }
            CellValue::Nothing => cells.empty += 1,
            CellValue::Over => cells.over.one(field, line),
            CellValue::Word => {
                let form = self.layout.forms.get(place).copied().flatten();
                if let Some(stamp) = form.and_then(|form| form.read(std::str::from_utf8(field).ok()?)) {
                    cells.times.one(field, line);
                    cells.time_of_day |= !stamp.has_date;
                    return stamp.seconds;
                }
                cells.words.one(field, line);
            }
        }
        f64::NAN
    }

    /// Takes lines that begin with a word, with rows behind them: rows, unless the names of the columns are among them.
    fn sort_out(
        &self,
        places: &[usize],
        wordy: &mut Vec<(u64, csv::ByteRecord)>,
        read: &mut Columns,
    ) -> Result<(), TableProblem> {
        if let Some((line, _)) = wordy.iter().find(|(_, record)| self.has_the_names(record)) {
            read.restarts.push(*line);
            wordy.clear();
        }
        for (line, record) in wordy.drain(..) {
            let fields = texts(&record);
            let word = |name: &String| looks_like_names(std::slice::from_ref(name));
            if fields.len() > 1 && self.layout.has_names && fields.iter().all(word) {
                let (names, header) = (shortened(&fields.join(", ")), self.layout.header_line);
                let what = format!(
                    "a second line of names ({names}), which are not those of line {header}; allowed: one form in a \
                     file, so cut it there"
                );
                return Err(TableProblem { line, what });
            }
            self.read_row(places, &record, line, read);
        }
        Ok(())
    }
}

impl Columns {
    /// The same rows with other columns.
    pub(super) fn with_cells(&self, cells: Vec<Cells>) -> Columns {
        let (lines, odd, restarts) = (self.lines.clone(), self.odd.clone(), self.restarts.clone());
        Columns { cells, lines, odd, restarts, notes: Vec::new() }
    }

    /// Leaves out the last row if it breaks off before the field at `place`; its line.
    pub(super) fn without_broken_end(&mut self, place: usize) -> Option<u64> {
        let last = self.odd.last().filter(|(line, fields)| *fields <= place && self.lines.last() == Some(line));
        let (line, _) = *last?;
        self.odd.pop();
        self.lines.pop();
        for cells in &mut self.cells {
            cells.values.pop();
            if cells.words.first.as_ref().is_some_and(|word| word.line == line) {
                cells.words = CellCount::default();
            }
        }
        Some(line)
    }
}

impl Cells {
    /// A sentence on the cells that were beyond the range.
    pub(crate) fn over_note(&self, name: &str) -> Option<String> {
        let FoundCell { line, text } = self.over.first.as_ref()?;
        let (count, text) = (self.over.count, shortened(text));
        let cells = if count == 1 { "cell is" } else { "cells are" };
        Some(format!(
            "{name}: {count} {cells} beyond the range of the instrument, the first in line {line} (\"{text}\"): \
             nothing is taken to be recorded there"
        ))
    }
}

#[cfg(test)]
mod tests;
