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

use rayon::prelude::*;

use flexspline_base::csv_rows::TableProblem;
pub(super) use layout::unit_word;
use layout::{
    Joined, begins_with_a_word, is_comment, lines_text, looks_like_names, plain, shortened, texts, with_tabs,
};
pub use layout::{Layout, Separator};
use number::CellValue;

/// Bytes that one thread reads at a time, about. *Guess*: some ten thousand rows, enough to keep a thread busy.
const CHUNK: usize = 1 << 20;
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
    fn take(&mut self, more: CellCount) {
        self.count += more.count;
        self.first = self.first.take().into_iter().chain(more.first).min_by_key(|cell| cell.line);
    }

    fn one(&mut self, field: &[u8], line: u64) {
        let first = self.count == 0;
        let text = || String::from_utf8_lossy(field).into_owned();
        self.take(CellCount { count: 1, first: first.then(|| FoundCell { line, text: text() }) });
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
    /// Sentences on what was left out.
    pub notes: Vec<String>,
}

/// Some rows, with lines that begin with a word where most have a number, which may be none.
#[derive(Default)]
struct RowsPart {
    read: Columns,
    /// Their row, line and fields; the row is empty so far.
    wordy: Vec<(usize, u64, csv::ByteRecord)>,
    /// Lines with zero bytes.
    holes: Vec<u64>,
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
        let along = match self.layout.stamp {
            Some(Joined::Seconds { whole, factor }) => {
                places.iter().position(|place| *place == whole).map(|at| (at, whole + 1, factor))
            }
            _ => None,
        };
        let wanted: Vec<usize> = places.iter().copied().chain(along.map(|(_, part, _)| part)).collect();
        let mut all = self.rows(&wanted)?;
        if let Some((at, _, factor)) = along {
            let parts = all.cells.pop().unwrap_or_default();
            all.cells[at].values.iter_mut().zip(&parts.values).for_each(|(whole, part)| *whole += factor * part);
        }
        Ok(all)
    }

    /// Parts of the text that end where a row does, each with the line before it.
    fn parts(&self) -> Vec<(u64, &[u8])> {
        let skipped = memchr::memchr_iter(b'\n', &self.text).take(self.layout.first_row_line as usize - 1).last();
        let mut rest = skipped.map_or(&self.text[..], |end| &self.text[end + 1..]);
        let mut before = self.layout.first_row_line - 1;
        let mut parts = Vec::new();
        while !rest.is_empty() {
            let (mut end, mut counted, mut quotes) = (CHUNK.min(rest.len()), 0, 0);
            loop {
                end = memchr::memchr(b'\n', &rest[end..]).map_or(rest.len(), |at| end + at + 1);
                quotes += memchr::memchr_iter(b'"', &rest[counted..end]).count();
                counted = end;
                if quotes % 2 == 0 || end == rest.len() {
                    break;
                }
            }
            let (part, more) = rest.split_at(end);
            parts.push((before, part));
            before += memchr::memchr_iter(b'\n', part).count() as u64;
            rest = more;
        }
        parts
    }

    fn rows(&self, places: &[usize]) -> Result<Columns, TableProblem> {
        let odd = [0, b'"'].map(|byte| memchr::memchr(byte, &self.text).is_some());
        let parts = self.parts();
        let parts: Vec<RowsPart> =
            parts.par_iter().map(|(before, text)| self.part(places, *before, text, odd)).collect::<Result<_, _>>()?;
        let mut all = Columns { cells: vec![Cells::default(); places.len()], ..Columns::default() };
        let (mut wordy, mut holes) = (Vec::new(), Vec::new());
        let rows = parts.iter().map(|part| part.read.lines.len()).sum();
        all.cells.iter_mut().for_each(|cells| cells.values.reserve_exact(rows));
        all.lines.reserve_exact(rows);
        for part in parts {
            wordy.extend(part.wordy.into_iter().map(|(row, line, record)| (all.lines.len() + row, line, record)));
            holes.extend(part.holes);
            for (all, cells) in all.cells.iter_mut().zip(part.read.cells) {
                all.append(cells);
            }
            all.lines.extend(part.read.lines);
            all.odd.extend(part.read.odd);
        }
        if let Some(first) = holes.first() {
            let (lines, are) = if holes.len() == 1 { ("line", "it is") } else { ("lines", "they are") };
            all.notes.push(format!(
                "zero bytes stand in {} {lines}, first in line {first}, as a card leaves them that lost its power: \
                 {are} left out",
                holes.len()
            ));
        }
        self.sort_out(places, wordy, &mut all)?;
        Ok(all)
    }

    /// Reads some rows, behind line `before`, of a text with zero bytes and quotes or without.
    fn part(
        &self,
        places: &[usize],
        before: u64,
        text: &[u8],
        [zeros, quotes]: [bool; 2],
    ) -> Result<RowsPart, TableProblem> {
        let empty = Columns { cells: vec![Cells::default(); places.len()], ..Columns::default() };
        let mut part = RowsPart { read: empty, ..RowsPart::default() };
        let mut records = self.layout.separator.records(text);
        let mut record = csv::ByteRecord::new();
        loop {
            let more = records.read_byte_record(&mut record);
            // The text ends with the end of a line.
            let line = before + records.position().line() - 1;
            if !more.map_err(|error| TableProblem { line, what: error.to_string() })? {
                return Ok(part);
            }
            if quotes && memchr::memchr_iter(b'\n', record.as_slice()).count() > MOST_LINES_OF_A_FIELD {
                let line = line - memchr::memchr_iter(b'\n', record.as_slice()).count() as u64;
                return Err(TableProblem {
                    line,
                    what: "a quote that nothing closes; allowed: quotes in pairs".to_owned(),
                });
            }
            if zeros && memchr::memchr(0, record.as_slice()).is_some() {
                part.holes.push(line);
                continue;
            }
            if is_comment(&record) || record.len() == 1 && plain(&record[0]).is_empty() {
                continue;
            }
            let row = part.read.lines.len();
            part.read.lines.push(line);
            // Words are seldom: a row begins with a digit, a sign or a quote.
            let first = record.get(0).map_or(&b""[..], plain).first().copied().unwrap_or(b'0');
            let begins = first.is_ascii_alphabetic() || matches!(first, b'[' | b'%' | b'_' | 0x80..);
            part.read.cells.iter_mut().for_each(|cells| cells.values.push(f64::NAN));
            if begins && (begins_with_a_word(&texts(&record), &self.layout.kinds) || self.has_the_names(&record)) {
                part.wordy.push((row, line, record.clone()));
            } else {
                self.read_row(places, &record, line, row, &mut part.read);
            }
        }
    }

    fn has_the_names(&self, record: &csv::ByteRecord) -> bool {
        self.layout.has_names && texts(record) == self.layout.names
    }

    /// Reads the cells of a row.
    fn read_row(&self, places: &[usize], record: &csv::ByteRecord, line: u64, row: usize, read: &mut Columns) {
        let (count, width) = (record.len(), self.layout.names.len());
        if count < width || record.iter().skip(width).any(|field| !plain(field).is_empty()) {
            read.odd.push((line, count));
        }
        for (cells, place) in read.cells.iter_mut().zip(places) {
            let field = record.get(*place).map_or(&b""[..], plain);
            cells.values[row] = self.cell(cells, *place, field, record, line);
        }
    }

    /// The value of one cell of the column at `place`.
    fn cell(&self, cells: &mut Cells, place: usize, field: &[u8], record: &csv::ByteRecord, line: u64) -> f64 {
        match number::cell(field, self.layout.decimal_comma) {
            CellValue::Number(value) => {
                cells.decimals = cells.decimals || field.iter().any(|byte| matches!(byte, b'.' | b','));
                return value;
            }
            CellValue::Nothing => cells.empty += 1,
            CellValue::Over => cells.over.one(field, line),
            CellValue::Word => {
                if let Some(stamp) = self.time(place, field, record) {
                    cells.times.one(field, line);
                    cells.time_of_day |= !stamp.has_date;
                    return stamp.seconds;
                }
                cells.words.one(field, line);
            }
        }
        f64::NAN
    }

    /// A time written as text, with what other columns say of it.
    fn time(&self, place: usize, field: &[u8], record: &csv::ByteRecord) -> Option<clock::Stamp> {
        let form = self.layout.forms.get(place).copied().flatten()?;
        let of = |place: usize| std::str::from_utf8(plain(record.get(place)?)).ok();
        match self.layout.stamp.and_then(|joined| joined.text(place, of)) {
            Some(whole) => form.read(&whole),
            None => form.read(std::str::from_utf8(field).ok()?),
        }
    }

    /// Decides which lines that begin with a word are rows: not the names once more, nor a summary at the end.
    fn sort_out(
        &self,
        places: &[usize],
        wordy: Vec<(usize, u64, csv::ByteRecord)>,
        all: &mut Columns,
    ) -> Result<(), TableProblem> {
        let rows = all.lines.len();
        let mut drop = vec![false; if wordy.is_empty() { 0 } else { rows }];
        let mut restarts = Vec::new();
        for group in wordy.chunk_by(|a, b| a.0 + 1 == b.0) {
            let (first, last) = (&group[0], &group[group.len() - 1]);
            let names = group.iter().find(|(.., record)| self.has_the_names(record));
            if let Some((_, line, _)) = names {
                restarts.push(*line);
            } else if last.0 + 1 == rows && wordy.len() < rows {
                // What begins with words at the end is a summary.
                let (lines, are) = lines_text(first.1, last.1);
                let rows = if first.1 == last.1 { "row" } else { "rows" };
                let from = texts(&first.2).swap_remove(0);
                let from = shortened(&from);
                all.notes.push(format!("{lines} at the end, from \"{from}\" on, {are} no {rows}: left out"));
            } else {
                for (row, line, record) in group {
                    let fields = texts(record);
                    if fields.len() > 1
                        && self.layout.has_names
                        && fields.iter().all(|name| looks_like_names(std::slice::from_ref(name)))
                    {
                        let what = format!(
                            "a second line of names ({}), which are not those of line {}; allowed: one form in a file, \
                             so cut it there",
                            shortened(&fields.join(", ")),
                            self.layout.header_line
                        );
                        return Err(TableProblem { line: *line, what });
                    }
                    self.read_row(places, record, *line, *row, all);
                }
                continue;
            }
            group.iter().for_each(|(row, ..)| drop[*row] = true);
        }
        if let Some(first) = restarts.first() {
            let times = if restarts.len() == 1 { "once".to_owned() } else { format!("{} times", restarts.len()) };
            all.notes.push(format!(
                "the names of the columns are repeated {times}, first in line {first}: these lines are left out"
            ));
        }
        if drop.contains(&true) {
            super::log::leave_out(&mut all.lines, &drop);
            all.cells.iter_mut().for_each(|cells| super::log::leave_out(&mut cells.values, &drop));
        }
        Ok(())
    }
}

impl Columns {
    /// The same rows with other columns.
    pub(super) fn with_cells(&self, cells: Vec<Cells>) -> Columns {
        Columns { cells, lines: self.lines.clone(), odd: self.odd.clone(), notes: Vec::new() }
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
    fn append(&mut self, more: Cells) {
        self.values.extend_from_slice(&more.values);
        self.times.take(more.times);
        self.time_of_day |= more.time_of_day;
        self.decimals |= more.decimals;
        self.empty += more.empty;
        self.over.take(more.over);
        self.words.take(more.words);
    }

    /// A sentence on the cells that were beyond the range.
    #[must_use]
    pub(crate) fn over_note(&self, name: &str) -> Option<String> {
        let first = self.over.first.as_ref()?;
        Some(format!(
            "{name}: {} cell{} beyond the range of the instrument, the first in line {} (\"{}\"): nothing is taken to \
             be recorded there",
            self.over.count,
            if self.over.count == 1 { " is" } else { "s are" },
            first.line,
            shortened(&first.text)
        ))
    }
}

#[cfg(test)]
mod tests;
