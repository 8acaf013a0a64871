//! The one reader of other people's files: bytes to text, text to rows of one layout, cells to numbers.
//!
//! [`Sheet::of`] finds the layout and which lines are rows; `Sheet::columns` reads the columns that are asked for.
//! Whatever is left out or read otherwise than it stands is said in [`Sheet::notes`] with its line. `look` asks for all
//! columns, `calibrate`, `diagnose` and `replay` for those of the mapping.

pub(super) mod align;
pub(super) mod clock;
mod layout;
mod number;
pub mod raw;
pub(super) mod slower;
pub(crate) mod stamps;
mod text;

use std::collections::HashMap;

use rayon::prelude::*;

use super::unit::Unit;
use flexspline_base::csv_rows::TableProblem;
pub(super) use layout::unit_word;
use layout::{Field, Shape, StampParts, begins_with_a_word, looks_like_names, shortened};
pub use layout::{Layout, Separator};
use number::Cell;

/// Rows that one thread reads at a time.
const CHUNK: usize = 1 << 14;
/// Lines that a quoted field may spread over.
const MOST_LINES_OF_A_FIELD: usize = 20;
/// Channels of a file with one value in a line, at most.
const MOST_CHANNELS: usize = 256;

/// A file as rows of text.
#[derive(Debug)]
pub struct Sheet {
    /// How it is laid out.
    pub layout: Layout,
    /// What was read otherwise than it stands, or left out; one sentence each.
    pub notes: Vec<String>,
    text: Vec<u8>,
    rows: Vec<RowAt>,
    /// From which row on columns stand in another order: where each column is found.
    segments: Vec<(usize, Vec<Option<usize>>)>,
    /// Names of the channels of a file with one value in a line.
    channels: Vec<String>,
    /// Fields that a row may have.
    width: usize,
}

/// Where a row stands.
#[derive(Debug, Clone, Copy)]
struct RowAt {
    begin: usize,
    end: usize,
    /// From 1; the last one of a row that a quoted field spreads over several.
    line: u64,
}

/// A cell that was found, for whoever has to say so.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct FoundCell {
    /// Line of the file, from 1.
    pub line: u64,
    /// The text there.
    pub text: String,
}

/// A column of a [`Sheet`].
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Cells {
    /// Numbers, or seconds where times are written as text; NaN where there is neither.
    pub values: Vec<f64>,
    /// Times written as text, and the first of them.
    pub times: usize,
    /// The first of them.
    pub first_time: Option<FoundCell>,
    /// Whether a time has no date.
    pub time_of_day: bool,
    /// Whether the times have a date and no zone: a clock on the wall, which is set forward and back in spring and
    /// autumn.
    pub local_time: bool,
    /// Whether a number is written with decimals: then they are no counts, though all may be whole.
    pub decimals: bool,
    /// Cells in which nothing was recorded.
    pub empty: usize,
    /// Cells that say that the value was beyond the range.
    pub over: usize,
    /// The first of them.
    pub first_over: Option<FoundCell>,
    /// Cells that are words.
    pub words: usize,
    /// The first of them.
    pub first_word: Option<FoundCell>,
}

/// Columns as they were read.
#[derive(Debug, Default)]
pub(crate) struct Columns {
    /// Those that were asked for.
    pub cells: Vec<Cells>,
    /// Line of each row.
    pub lines: Vec<u64>,
    /// Rows that end before the last column that was asked for: row, and fields it has.
    pub short: Vec<(usize, usize)>,
    /// Rows that have more fields than names, which are not blank: row, and fields it has.
    pub wide: Vec<(usize, usize)>,
}

impl Sheet {
    /// Reads the bytes of a file; `known` are names of columns that are looked for.
    ///
    /// # Errors
    /// The file is no text, or changes its columns midway.
    pub fn of(bytes: Vec<u8>, known: &[&str]) -> Result<Sheet, TableProblem> {
        let text = text::of(bytes).map_err(|what| TableProblem { line: 1, what })?;
        let layout = Layout::of(&text.bytes, known);
        let mut sheet = Sheet {
            notes: text.notes,
            width: layout.names.len(),
            layout,
            text: text.bytes,
            rows: Vec::new(),
            segments: Vec::new(),
            channels: Vec::new(),
        };
        sheet.notes.append(&mut sheet.layout.notes);
        sheet.find_rows(&text.zeros)?;
        sheet.refuse_commas_of_two_kinds()?;
        if let Shape::OneValue { name, value, time } = sheet.layout.shape {
            sheet.find_channels(name, value, time);
        }
        Ok(sheet)
    }

    /// Rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The fields of a row.
    fn fields(&self, row: RowAt) -> Vec<String> {
        self.layout.separator.fields(&self.text[row.begin..row.end])
    }

    /// The fields of a row, as texts.
    #[must_use]
    pub(crate) fn row(&self, row: usize) -> Vec<String> {
        self.fields(self.rows[row])
    }

    /// The text of a cell, if the row has it.
    #[must_use]
    pub(crate) fn text_at(&self, row: usize, place: usize) -> Option<String> {
        self.fields(self.rows[row]).into_iter().nth(place)
    }

    /// Finds the lines that are rows: not comments, names once more, summaries at the end, lines with holes of zero
    /// bytes.
    fn find_rows(&mut self, zeros: &[(u64, usize)]) -> Result<(), TableProblem> {
        let text = std::mem::take(&mut self.text);
        let mut group: Vec<RowAt> = Vec::new();
        let mut found = Found::default();
        let mut zeros = zeros.iter().peekable();
        let (mut begin, mut line) = (0, 0_u64);
        while begin < text.len() {
            let mut end = line_end(&text, begin);
            let mut last_line = line + 1;
            if text[begin..end].contains(&b'"') {
                (end, last_line) = end_of_quotes(&text, begin, end, line + 1);
            }
            let (from, at) = (begin, RowAt { begin, end, line: last_line });
            let first_line = line + 1;
            (begin, line) = (end + 1, last_line);
            if first_line < self.layout.first_row_line {
                continue;
            }
            let bytes = text[from..end].trim_ascii();
            while zeros.next_if(|(zero, _)| *zero < first_line).is_some() {}
            if zeros.peek().is_some_and(|(zero, _)| *zero <= last_line) {
                found.holes.push(first_line);
                continue;
            }
            if bytes.is_empty() || bytes[0] == b'#' {
                continue;
            }
            // Words are seldom: a row begins with a digit, a sign or a quote.
            let wordy = bytes[0].is_ascii_alphabetic() || matches!(bytes[0], b'"' | b'[' | b'%' | b'_' | 0x80..);
            if wordy && self.is_no_row(&self.layout.separator.fields(bytes)) {
                group.push(at);
                continue;
            }
            if !group.is_empty() {
                self.take_group(&text, &mut group, &mut found)?;
            }
            self.rows.push(at);
        }
        // What begins with words at the end is a summary, or a logger that was started anew and wrote nothing more.
        if self.rows.is_empty() {
            self.rows.append(&mut group);
        } else if let (Some(first), Some(last)) = (group.first(), group.last()) {
            let fields = |at: &RowAt| self.layout.separator.fields(&text[at.begin..at.end]);
            match group.iter().find(|at| self.order_of(&fields(at)).is_some()) {
                Some(at) => found.restarts.push(at.line),
                None => found.summary = Some((first.line, last.line, fields(first)[0].clone())),
            }
        }
        // Zeros behind the last line: room that was kept for rows that were never written.
        found.holes.extend(zeros.map(|(line, _)| *line).filter(|zero| *zero > line));
        self.text = text;
        found.say(&mut self.notes);
        Ok(())
    }

    /// Whether a line may be no row: it begins with a word where most have a number, or has the names of the columns.
    fn is_no_row(&self, fields: &[String]) -> bool {
        begins_with_a_word(fields, &self.layout.kinds) || (looks_like_names(fields) && self.order_of(fields).is_some())
    }

    /// Where each column stands by a line of names, if it is one: it holds two of the names at least, or all.
    fn order_of(&self, fields: &[String]) -> Option<Vec<Option<usize>>> {
        let names = &self.layout.names;
        let place = |name: &String| fields.iter().position(|field| field == name && !name.is_empty());
        let order: Vec<Option<usize>> = names.iter().map(place).collect();
        let there = order.iter().flatten().count();
        (self.layout.has_names && there >= 2.min(names.len()) && looks_like_names(fields)).then_some(order)
    }

    /// Lines in the middle that begin with words: a logger that was started anew, if names are among them, else rows
    /// that cannot be read.
    fn take_group(&mut self, text: &[u8], group: &mut Vec<RowAt>, found: &mut Found) -> Result<(), TableProblem> {
        let fields: Vec<Vec<String>> =
            group.iter().map(|at| self.layout.separator.fields(&text[at.begin..at.end])).collect();
        let header = (0..group.len()).rev().find_map(|k| Some((k, self.order_of(&fields[k])?)));
        match header {
            Some((k, order)) => {
                found.restarts.push(group[k].line);
                let as_it_was = order.iter().enumerate().all(|(place, at)| *at == Some(place));
                let before = self.segments.last().map(|(_, order)| order.clone());
                let same = before.as_ref().map_or(as_it_was, |before| *before == order);
                if !same {
                    found.reordered.push(group[k].line);
                    self.segments.push((self.rows.len(), order));
                }
            }
            None => {
                let other = fields.iter().position(|fields| {
                    fields.len() >= 2 && fields.iter().all(|field| Field::of(field, false) == Field::Text)
                });
                if let Some(k) = other.filter(|_| self.layout.has_names) {
                    let what = format!(
                        "a second line of names ({}), which are not those of line {}; allowed: one form in a file, so \
                         cut it there",
                        shortened(&fields[k].join(", ")),
                        self.layout.header_line
                    );
                    return Err(TableProblem { line: group[k].line, what });
                }
                self.rows.append(group);
            }
        }
        group.clear();
        Ok(())
    }

    /// Commas between fields and before decimals, which no reader tells apart.
    fn refuse_commas_of_two_kinds(&self) -> Result<(), TableProblem> {
        let width = self.layout.names.len();
        let some = &self.rows[..self.rows.len().min(100)];
        let torn = |row: &RowAt| torn_by_commas(&self.fields(*row), width);
        match some.first().filter(|_| self.layout.separator == Separator::Comma && width > 0 && some.iter().all(torn)) {
            Some(row) => Err(TableProblem { line: row.line, what: too_wide(&self.fields(*row), width) }),
            None => Ok(()),
        }
    }

    /// The channels of a file with one value in a line become columns: the time, and one for each name in the order in
    /// which they come.
    fn find_channels(&mut self, name: usize, value: usize, time: usize) {
        let mut places: HashMap<Vec<u8>, usize> = HashMap::new();
        for row in &self.rows {
            self.layout.separator.split(&self.text[row.begin..row.end], |k, field| {
                if k == name && places.len() < MOST_CHANNELS && !places.contains_key(field) {
                    places.insert(field.to_vec(), places.len());
                }
            });
        }
        let mut names: Vec<(usize, String)> =
            places.into_iter().map(|(name, at)| (at, String::from_utf8_lossy(&name).into_owned())).collect();
        names.sort();
        self.channels = names.into_iter().map(|(_, name)| name).collect();
        self.notes.push(format!(
            "each line has the value of one channel, named in column {} ({}): they are laid side by side",
            name + 1,
            shortened(&self.channels.join(", "))
        ));
        let unit = self.layout.cell_units[value];
        let width = self.channels.len() + 1;
        self.layout.names = std::iter::once("time".to_owned()).chain(self.channels.iter().cloned()).collect();
        self.layout.has_names = true;
        self.layout.units = if unit.is_some() || self.layout.units.len() > time {
            let of_time = self.layout.units.get(time).cloned().unwrap_or_default();
            std::iter::once(of_time)
                .chain((1..width).map(|_| unit.map_or_else(String::new, |unit| unit.name().to_owned())))
                .collect()
        } else {
            Vec::new()
        };
    }

    /// Reads the columns at these places.
    #[must_use]
    pub(crate) fn columns(&self, places: &[usize]) -> Columns {
        if let Shape::OneValue { name, value, time } = self.layout.shape {
            return self.channels_as_columns(places, name, value, time);
        }
        self.plain_columns(places)
    }

    fn channels_as_columns(&self, places: &[usize], name: usize, value: usize, time: usize) -> Columns {
        let read = self.plain_columns(&[time, value]);
        let Columns { cells, lines, short, wide } = read;
        let [times, values] = <[Cells; 2]>::try_from(cells).unwrap_or_default();
        let channels: HashMap<&[u8], usize> =
            self.channels.iter().enumerate().map(|(k, name)| (name.as_bytes(), k + 1)).collect();
        let of_row: Vec<usize> = self
            .rows
            .iter()
            .map(|row| {
                let mut of = 0;
                self.layout.separator.split(&self.text[row.begin..row.end], |k, field| {
                    if k == name {
                        of = channels.get(field).copied().unwrap_or(0);
                    }
                });
                of
            })
            .collect();
        let channel = |place: usize| -> Cells {
            if place == 0 {
                return times.clone();
            }
            let of = |row: usize| if of_row[row] == place { values.values[row] } else { f64::NAN };
            let mine = |cell: &Option<FoundCell>| {
                cell.clone().filter(|cell| {
                    lines.iter().position(|line| *line == cell.line).is_some_and(|row| of_row[row] == place)
                })
            };
            let (first_word, first_over) = (mine(&values.first_word), mine(&values.first_over));
            Cells {
                values: (0..of_row.len()).map(of).collect(),
                decimals: values.decimals,
                words: first_word.as_ref().map_or(0, |_| values.words),
                over: first_over.as_ref().map_or(0, |_| values.over),
                first_word,
                first_over,
                ..Cells::default()
            }
        };
        Columns { cells: places.iter().map(|place| channel(*place)).collect(), lines, short, wide }
    }

    fn plain_columns(&self, places: &[usize]) -> Columns {
        // Columns that a time is put together of are read along.
        let along: Vec<usize> = match &self.layout.stamp {
            Some(StampParts::Seconds { whole, part, .. }) if places.contains(whole) => vec![*part],
            _ => Vec::new(),
        };
        let wanted: Vec<usize> = places.iter().copied().chain(along.iter().copied()).collect();
        let chunks: Vec<&[RowAt]> = self.rows.chunks(CHUNK).collect();
        let parts: Vec<Columns> =
            chunks.par_iter().enumerate().map(|(k, chunk)| self.chunk(&wanted, k * CHUNK, chunk)).collect();
        let mut all = Columns { cells: vec![Cells::default(); wanted.len()], ..Columns::default() };
        for cells in &mut all.cells {
            cells.values.reserve_exact(self.rows.len());
        }
        for part in parts {
            for (all, cells) in all.cells.iter_mut().zip(part.cells) {
                all.append(cells);
            }
            all.lines.extend(part.lines);
            all.short.extend(part.short);
            all.wide.extend(part.wide);
        }
        if let (Some(StampParts::Seconds { whole, factor, .. }), [_, ..]) = (&self.layout.stamp, along.as_slice()) {
            let parts = all.cells.pop().unwrap_or_default();
            if let Some(at) = places.iter().position(|place| place == whole) {
                all.cells[at].values.iter_mut().zip(&parts.values).for_each(|(whole, part)| *whole += factor * part);
            }
        }
        all
    }

    /// Reads some rows, the first of which is row `from` of the file.
    fn chunk(&self, places: &[usize], from: usize, rows: &[RowAt]) -> Columns {
        let width = self.width;
        let mut read = Columns { cells: vec![Cells::default(); places.len()], ..Columns::default() };
        read.cells.iter_mut().for_each(|cells| cells.values.reserve_exact(rows.len()));
        let as_they_stand: Vec<Option<usize>> = places.iter().map(|place| Some(*place)).collect();
        let mut segment = self.segments.partition_point(|(begins, _)| *begins <= from);
        let mut order = self.order_in(segment, places, &as_they_stand);
        let mut fields: Vec<&[u8]> = Vec::new();
        for (k, row) in rows.iter().enumerate() {
            while self.segments.get(segment).is_some_and(|(begins, _)| *begins <= from + k) {
                segment += 1;
                order = self.order_in(segment, places, &as_they_stand);
            }
            fields.clear();
            let mut beyond = false;
            let count = self.layout.separator.split(&self.text[row.begin..row.end], |place, field| {
                beyond |= place >= width && !field.is_empty();
                fields.push(field);
            });
            if beyond {
                read.wide.push((from + k, count));
            }
            if order.iter().flatten().any(|place| *place >= count) {
                read.short.push((from + k, count));
            }
            for ((cells, place), asked) in read.cells.iter_mut().zip(&order).zip(places) {
                let field = place.and_then(|place| fields.get(place)).copied().unwrap_or_default();
                self.read_cell(cells, *asked, field, &fields, row.line);
            }
            read.lines.push(row.line);
        }
        read
    }

    fn order_in(&self, segment: usize, places: &[usize], as_they_stand: &[Option<usize>]) -> Vec<Option<usize>> {
        match segment.checked_sub(1).and_then(|k| self.segments.get(k)) {
            Some((_, order)) => places.iter().map(|place| order.get(*place).copied().flatten()).collect(),
            None => as_they_stand.to_vec(),
        }
    }

    /// Reads one cell of the column at `place`.
    fn read_cell(&self, cells: &mut Cells, place: usize, field: &[u8], row: &[&[u8]], line: u64) {
        let comma = self.layout.commas.get(place).copied().unwrap_or(false);
        let found = || Some(FoundCell { line, text: String::from_utf8_lossy(field).into_owned() });
        let value = match number::cell(field, comma) {
            Cell::Number(value, None) => {
                cells.decimals = cells.decimals || field.iter().any(|byte| matches!(byte, b'.' | b','));
                value
            }
            Cell::Number(value, Some(unit)) => match self.in_unit_of_column(value, unit, place) {
                Some(value) => value,
                None => {
                    cells.words += 1;
                    cells.first_word = cells.first_word.take().or_else(found);
                    f64::NAN
                }
            },
            Cell::Nothing => {
                cells.empty += 1;
                f64::NAN
            }
            Cell::Over => {
                cells.over += 1;
                cells.first_over = cells.first_over.take().or_else(found);
                f64::NAN
            }
            Cell::Word => match self.time(place, field, row) {
                Some(stamp) => {
                    cells.times += 1;
                    cells.first_time = cells.first_time.take().or_else(found);
                    cells.time_of_day |= !stamp.has_date;
                    cells.local_time |= stamp.has_date && !stamp.has_zone;
                    stamp.seconds
                }
                None => {
                    cells.words += 1;
                    cells.first_word = cells.first_word.take().or_else(found);
                    f64::NAN
                }
            },
        };
        cells.values.push(value);
    }

    /// A value in the unit in which the first cell of the column is.
    fn in_unit_of_column(&self, value: f64, unit: Unit, place: usize) -> Option<f64> {
        let of_column = self.layout.cell_units.get(place).copied().flatten()?;
        if unit == of_column {
            return Some(value);
        }
        (unit.family() == of_column.family())
            .then(|| (value * unit.factor() + unit.zero() - of_column.zero()) / of_column.factor())
    }

    /// A time written as text, with what other columns say of it.
    fn time(&self, place: usize, field: &[u8], row: &[&[u8]]) -> Option<clock::Stamp> {
        let text = std::str::from_utf8(field).ok()?;
        match &self.layout.stamp {
            Some(StampParts::Texts { date, clock, half }) if *clock == place => {
                let of = |place: usize| std::str::from_utf8(row.get(place).copied().unwrap_or_default()).ok();
                let half = half.map_or(Some(""), of)?;
                clock::stamp(&format!("{} {text} {half}", of(*date)?), self.layout.order)
            }
            _ => clock::stamp(text, self.layout.order),
        }
    }
}

impl Cells {
    fn append(&mut self, more: Cells) {
        self.values.extend_from_slice(&more.values);
        self.times += more.times;
        self.first_time = self.first_time.take().or(more.first_time);
        self.time_of_day |= more.time_of_day;
        self.local_time |= more.local_time;
        self.decimals |= more.decimals;
        self.empty += more.empty;
        self.over += more.over;
        self.first_over = self.first_over.take().or(more.first_over);
        self.words += more.words;
        self.first_word = self.first_word.take().or(more.first_word);
    }

    /// What is to be said of the cells that were beyond the range.
    #[must_use]
    pub(crate) fn over_note(&self, name: &str) -> Option<String> {
        let first = self.first_over.as_ref()?;
        Some(format!(
            "{name}: {} cell{} beyond the range of the instrument, the first in line {} (\"{}\"): nothing is taken to \
             be recorded there",
            self.over,
            if self.over == 1 { " is" } else { "s are" },
            first.line,
            shortened(&first.text)
        ))
    }
}

/// Lines that are no rows.
#[derive(Debug, Default)]
struct Found {
    holes: Vec<u64>,
    restarts: Vec<u64>,
    reordered: Vec<u64>,
    summary: Option<(u64, u64, String)>,
}

impl Found {
    fn say(&self, notes: &mut Vec<String>) {
        if let Some(first) = self.holes.first() {
            let holes = self.holes.len();
            notes.push(format!(
                "zero bytes stand in {holes} line{}, first in line {first}, as a card leaves them that lost its \
                 power: {} left out",
                if holes == 1 { "" } else { "s" },
                if holes == 1 { "it is" } else { "they are" }
            ));
        }
        if let Some(first) = self.restarts.first() {
            let times =
                if self.restarts.len() == 1 { "once".to_owned() } else { format!("{} times", self.restarts.len()) };
            notes.push(format!(
                "the names of the columns are repeated {times}, first in line {first}: these lines are left out"
            ));
        }
        if let Some(line) = self.reordered.first() {
            notes.push(format!("from line {line} on the columns stand in another order: they are read by their names"));
        }
        if let Some((first, last, word)) = &self.summary {
            let lines = if first == last { format!("line {first}") } else { format!("lines {first} to {last}") };
            notes.push(format!(
                "{lines} at the end, from \"{}\" on, {} no row{}: left out",
                shortened(word),
                if first == last { "is" } else { "are" },
                if first == last { "" } else { "s" }
            ));
        }
    }
}

/// Where a line ends.
fn line_end(text: &[u8], begin: usize) -> usize {
    memchr::memchr(b'\n', &text[begin..]).map_or(text.len(), |at| begin + at)
}

/// Where a row ends of which a quote is open at the end of its line, and the line where that is.
fn end_of_quotes(text: &[u8], begin: usize, end: usize, line: u64) -> (usize, u64) {
    let open = |end: usize| text[begin..end].iter().filter(|byte| **byte == b'"').count() % 2 == 1;
    let (mut at, mut last) = (end, line);
    for _ in 0..MOST_LINES_OF_A_FIELD {
        if !open(at) {
            return (at, last);
        }
        if at >= text.len() {
            break;
        }
        (at, last) = (line_end(text, at + 1), last + 1);
    }
    // A quote that nothing closes is a character.
    (end, line)
}

/// What is to be said of a row with more fields than names.
pub(super) fn too_wide(fields: &[String], width: usize) -> String {
    let mut what = format!("{} fields, but the header has {width}", fields.len());
    if torn_by_commas(fields, width) {
        what.push_str("; numbers are written with a point, not with a comma");
    }
    what
}

/// Whether a row has whole numbers on both sides of its commas, and more of them than names: what decimal commas leave.
fn torn_by_commas(fields: &[String], width: usize) -> bool {
    let whole = |text: &String| {
        let digits = text.trim_start_matches(['-', '+']);
        !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit())
    };
    fields.len() > width + 1 && fields.iter().all(whole)
}

#[cfg(test)]
mod tests;
