//! How a text file of numbers is laid out: the separator of its fields, how decimals are written, the lines of the
//! names and units of its columns.
//!
//! One idea serves all: most lines of the file have one width and columns of one kind (number, time, word). That
//! majority shows the separator; a line that begins with a word where the majority has a number is no row.

use std::collections::BTreeSet;

use super::super::unit::Unit;
use super::clock::{self, TimeForm};
use super::number::{self, CellValue};
use flexspline_base::csv_rows::TableProblem;

/// Bytes of a file that its layout is found from. *Guess*: some hundreds of rows, behind the longest preambles.
pub(super) const HEAD: usize = 1 << 16;
/// Share of the rows looked at that have the same width, at least. *Guess*: remarks are fewer.
const SAME_WIDTH: f64 = 0.8;
/// Share of the fields that are numbers, times or empty, at least: a row may hold a word or two. *Guess*: with half of
/// them words it is no log.
const NUMBERS: f64 = 0.5;
/// Names that a file with one value in a line may have. *Guess*: a bench has no more channels.
const NAMES_OF_VALUES: std::ops::RangeInclusive<usize> = 2..=64;
/// Rows of each such name in the head of the file. *Guess*: a word that is seldom is a remark.
const ROWS_OF_A_NAME: usize = 4;
/// Seconds since 1970 of the years 2001 to 2065.
const EPOCH_S: std::ops::RangeInclusive<f64> = 1e9..=3e9;

table! {
    /// The separator of two fields, with its name and the byte between them, of blanks the tab that `with_tabs` puts
    /// in their place. Of several that fit the first is taken.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
    pub enum Separator: (&'static str, u8) {
        /// `,`
        #[default]
        Comma = ("comma", b','),
        /// `;`
        Semicolon = ("semicolon", b';'),
        /// A tab.
        Tab = ("tab", b'\t'),
        /// `|`
        Bar = ("bar", b'|'),
        /// Any number of spaces and tabs.
        Blanks = ("blanks", b'\t'),
    }
}

impl Separator {
    /// Its name.
    pub const fn name(self) -> &'static str {
        self.row().0
    }

    /// Records of a text; of one with [`Separator::Blanks`] as [`with_tabs`] writes it.
    pub(super) fn records(self, text: &[u8]) -> csv::Reader<&[u8]> {
        let mut form = csv::ReaderBuilder::new();
        form.delimiter(self.row().1).has_headers(false).flexible(true).from_reader(text)
    }
}

/// A text whose fields are separated by blanks, with one tab for each run of them.
pub(super) fn with_tabs(text: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(text.len());
    let mut quoted = false;
    for byte in text {
        quoted ^= *byte == b'"';
        let blank = matches!(byte, b' ' | b'\t') && !quoted;
        let begins = matches!(out.last(), None | Some(b'\n' | b'\t'));
        match (blank, begins) {
            (true, true) => {}
            (true, false) => out.push(b'\t'),
            (false, _) => {
                if matches!(byte, b'\n' | b'\r') && out.last() == Some(&b'\t') {
                    out.pop();
                }
                out.push(*byte);
            }
        }
    }
    out
}

/// A field without the blanks and the quotes around it.
pub(super) fn plain(field: &[u8]) -> &[u8] {
    let field = field.trim_ascii();
    field.strip_prefix(b"\"").and_then(|field| field.strip_suffix(b"\"")).map_or(field, <[u8]>::trim_ascii)
}

/// Whether a record is a comment.
pub(super) fn is_comment(record: &csv::ByteRecord) -> bool {
    record.get(0).is_some_and(|field| field.trim_ascii_start().starts_with(b"#"))
}

/// The fields of a record as texts.
pub(super) fn texts(record: &csv::ByteRecord) -> Vec<String> {
    record.iter().map(|field| String::from_utf8_lossy(plain(field)).into_owned()).collect()
}

/// How a file is laid out.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layout {
    /// Between fields.
    pub separator: Separator,
    /// Whether decimals follow a comma.
    pub decimal_comma: bool,
    /// Names of the columns; `#1`, `#2`, … where the file has none.
    pub names: Vec<String>,
    /// Whether the file has names.
    pub has_names: bool,
    /// Units by column, from a line below the names; empty where there is none.
    pub units: Vec<String>,
    /// The line of the names, or where they would be.
    pub header_line: u64,
    /// The line from which rows are read.
    pub(super) first_row_line: u64,
    /// The kind of most cells of a column.
    pub(super) kinds: Vec<CellKind>,
    /// The form of the times of a column.
    pub(super) forms: Vec<Option<TimeForm>>,
    /// A column of whole seconds whose parts stand in the next one, and what to do: it is no time by itself.
    pub(in crate::measurement) whole_seconds: Option<(usize, String)>,
}

/// Kinds of field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CellKind {
    Number,
    Time,
    Date,
    Text,
    Nothing,
}

impl CellKind {
    fn of(text: &str, comma: bool) -> CellKind {
        match number::cell(text.as_bytes(), comma) {
            CellValue::Number(_) => CellKind::Number,
            CellValue::Nothing | CellValue::Over => CellKind::Nothing,
            CellValue::Word if clock::form([text].into_iter()).is_some() => CellKind::Time,
            CellValue::Word if clock::is_date(text) => CellKind::Date,
            CellValue::Word => CellKind::Text,
        }
    }
}

/// A line of the head of a file.
struct HeadLine {
    /// From 1.
    number: u64,
    fields: Vec<String>,
}

impl Layout {
    /// The layout of a text; `known` are names of columns that are looked for. What is left out is added to `notes`.
    ///
    /// # Errors
    /// The rows have more fields than names, or are no rows of one instant each.
    pub(super) fn of(text: &[u8], known: &[&str], notes: &mut Vec<String>) -> Result<Layout, TableProblem> {
        let head = &text[..text.len().min(HEAD)];
        // The last line may be cut.
        let head = &head[..head.iter().rposition(|byte| *byte == b'\n').map_or(head.len(), |end| end + 1)];
        if let Some((layout, lines)) = guess(head) {
            return layout.with_names(head, &lines, known, notes);
        }
        // No rows were found: what does not fit below the first line is for the reader to refuse.
        let first = lines(head, Separator::Comma).into_iter().next();
        let HeadLine { number, fields } = first.unwrap_or(HeadLine { number: 1, fields: Vec::new() });
        let kinds = vec![CellKind::Number; fields.len()];
        let (names, header_line, first_row_line) = (fields, number, number + 1);
        Ok(Layout { has_names: true, header_line, first_row_line, kinds, names, ..Layout::default() })
    }

    /// With names, units and forms of times by the lines of the head.
    fn with_names(
        mut self,
        head: &[u8],
        lines: &[HeadLine],
        known: &[&str],
        notes: &mut Vec<String>,
    ) -> Result<Layout, TableProblem> {
        let width = self.kinds.len();
        let row = |line: &HeadLine| {
            is_row(&line.fields, self.decimal_comma) && !begins_with_a_word(&line.fields, &self.kinds)
        };
        let full = lines.iter().position(|line| line.fields.len() >= width && row(line)).unwrap_or(0);
        // Rows of fewer fields above the first of the usual width are rows as well.
        let is_text = |field: &String| CellKind::of(field, self.decimal_comma) == CellKind::Text;
        let shorter = |line: &&HeadLine| line.fields.len() > 1 && row(line) && !line.fields.iter().any(is_text);
        let rows_from = full - lines[..full].iter().rev().take_while(shorter).count();
        let begins = lines[rows_from].number;
        let (above, rows) = lines.split_at(rows_from);
        let names = self.find_names(above, known, notes);
        let names = names.or_else(|| comment_with_names(head, begins, self.separator, width));
        self.has_names = names.is_some();
        self.first_row_line = begins;
        (self.header_line, self.names) =
            names.unwrap_or_else(|| (begins, (1..=width).map(|k| format!("#{k}")).collect()));
        self.enough_names(rows)?;
        self.kinds.resize(self.names.len().max(width), CellKind::Nothing);
        self.find_times(rows, notes);
        self.one_instant_a_line(rows)?;
        Ok(self)
    }

    /// The names of the columns above the rows, and the units below them.
    fn find_names(
        &mut self,
        above: &[HeadLine],
        known: &[&str],
        notes: &mut Vec<String>,
    ) -> Option<(u64, Vec<String>)> {
        // A header may lack the name of an empty last field; one that lacks more is refused later.
        let fits = |k: &usize| {
            let (names, width) = (above[*k].fields.len(), self.kinds.len());
            names == width || names + 1 == width || (names > 1 && (*k == 0 || *k + 1 == above.len()))
        };
        let block = &above[(0..above.len()).rev().take_while(fits).last().unwrap_or(above.len())..];
        let candidates: Vec<&HeadLine> = block.iter().filter(|line| looks_like_names(&line.fields)).collect();
        // Below names a line with one unit is one of units: a word of it that is none is refused as that of its column.
        let mut below = candidates.iter().skip(1);
        let units = below.find(|line| units_of(&line.fields).any(|known| known));
        let above = candidates.first().filter(|line| candidates.len() > 1 && units_of(&line.fields).all(|known| known));
        let units = units.or(above);
        let units_line = units.map_or(0, |line| line.number);
        // Names differ from one another; a line that has one word for all columns is something else.
        let distinct =
            |line: &HeadLine| line.fields.iter().filter(|name| !name.is_empty()).collect::<BTreeSet<_>>().len();
        let of_known = |line: &HeadLine| line.fields.iter().filter(|name| known.contains(&name.as_str())).count();
        let names = candidates.iter().filter(|line| line.number != units_line);
        let names = names.max_by_key(|line| (of_known(line), distinct(line), line.number < units_line, line.number));
        let names = names?;
        self.units = units.map_or_else(Vec::new, |line| line.fields.clone());
        let others = block.iter().filter(|line| line.number != names.number && line.number != units_line);
        let others: Vec<&HeadLine> = others.collect();
        if let (Some(first), Some(last)) = (others.first(), others.last()) {
            let (lines, are) = lines_text(first.number, last.number);
            let words = others.iter().filter_map(|line| line.fields.iter().find(|field| !field.is_empty()));
            let words = shortened(&words.map(String::as_str).collect::<Vec<_>>().join(", "));
            notes.push(format!("{lines} above the rows {are} neither names nor units ({words}): left out"));
        }
        Some((names.number, names.fields.clone()))
    }

    /// Refuses rows that have more fields than there are names: it is not known which names are whose.
    fn enough_names(&self, rows: &[HeadLine]) -> Result<(), TableProblem> {
        let used = 1 + self.kinds.iter().rposition(|kind| *kind != CellKind::Nothing).unwrap_or(0);
        let wide = rows.iter().find(|line| line.fields.len() > self.names.len());
        let Some(HeadLine { number, fields }) = wide.filter(|_| self.has_names && used > self.names.len()) else {
            return Ok(());
        };
        let torn = self.separator == Separator::Comma && fields.iter().all(|field| field.parse::<i128>().is_ok());
        let hint = if torn { "numbers are written with a point, not with a comma" } else { "each column has a name" };
        let what = format!("{} fields, but the header has {}; {hint}", fields.len(), self.names.len());
        Err(TableProblem { line: *number, what })
    }

    /// Finds the forms of times; a note says how to put together one that stands in two columns.
    fn find_times(&mut self, rows: &[HeadLine], notes: &mut Vec<String>) {
        let width = self.kinds.len();
        let column = |k: usize| rows.iter().filter_map(move |row| row.fields.get(k)).map(String::as_str);
        let timed = |k: usize| column(k).filter(|text| CellKind::of(text, self.decimal_comma) == CellKind::Time);
        let form = |k: usize| if self.kinds[k] == CellKind::Time { clock::form(timed(k)) } else { None };
        self.forms = (0..width).map(form).collect();
        let numbers = |k: usize| column(k).filter_map(|text| text.parse::<f64>().ok()).collect::<Vec<f64>>();
        for k in 1..width {
            let apart = |whole: &str| {
                format!("the time is in columns {k} and {}; allowed: one column, in pandas: {whole}", k + 1)
            };
            if self.kinds[k - 1..=k] == [CellKind::Date, CellKind::Time] {
                notes.push(apart("pd.to_datetime(df[DATE] + \" \" + df[TIME])") + "; the date is not read");
            } else if let Some(of_a_second) = parts_of_a_second(&numbers(k - 1), &numbers(k)) {
                let what = apart(&format!("df[SECONDS] + df[PARTS] / {of_a_second:e}"));
                notes.push(what.clone());
                self.whole_seconds = Some((k - 1, what));
            }
        }
    }

    /// Refuses rows that do not hold the values of one instant, with the line of pandas that makes such rows of them.
    fn one_instant_a_line(&self, rows: &[HeadLine]) -> Result<(), TableProblem> {
        let timely = |name: &String| {
            let word = name.to_lowercase();
            let word = word.split(['[', '(', '_', ' ', '.']).next().unwrap_or_default();
            let word = word.trim_end_matches(|c: char| c.is_ascii_digit());
            ["time", "t", "x", "zeit", "timestamp", "name"].contains(&word)
        };
        let in_pairs = self.names.len() >= 4 && self.names.len().is_multiple_of(2) && self.has_names;
        if in_pairs && self.names.iter().enumerate().all(|(k, name)| timely(name) == k.is_multiple_of(2)) {
            let what = format!(
                "each channel has a time column of its own ({}); allowed: one time for all, in pandas: \
                 pd.merge_asof(df[[T1, MOTOR]], df[[T2, JOINT]].dropna(), left_on=T1, right_on=T2, \
                 direction=\"nearest\").to_csv(FILE)",
                shortened(&self.names.join(", "))
            );
            return Err(TableProblem { line: self.header_line, what });
        }
        let of_kind = |kind: CellKind| (0..self.kinds.len()).filter(|k| self.kinds[*k] == kind).collect::<Vec<_>>();
        let (numbers, times) = (of_kind(CellKind::Number), of_kind(CellKind::Time));
        if !matches!((numbers.len(), times.len()), (1, 1) | (2, 0)) {
            return Ok(());
        }
        for k in of_kind(CellKind::Text) {
            let names: BTreeSet<&str> = rows.iter().filter_map(|row| row.fields.get(k)).map(String::as_str).collect();
            if NAMES_OF_VALUES.contains(&names.len()) && ROWS_OF_A_NAME * names.len() <= rows.len() {
                let what = format!(
                    "each line has the value of one channel, named in column {} ({}); allowed: a column for each, \
                     in pandas: df.pivot_table(index=TIME, columns=NAME, \
                     values=VALUE).interpolate(\"index\").to_csv(FILE)",
                    k + 1,
                    shortened(&names.into_iter().collect::<Vec<_>>().join(", "))
                );
                return Err(TableProblem { line: self.first_row_line, what });
            }
        }
        Ok(())
    }
}

/// Whether a column has seconds since 1970 and the next one parts of a second: how many of these make one.
fn parts_of_a_second(seconds: &[f64], parts: &[f64]) -> Option<f64> {
    let begins_anew = seconds.windows(2).zip(parts.windows(2)).any(|(s, part)| s[1] > s[0] && part[1] < part[0]);
    let whole = seconds.iter().chain(parts).all(|value| value.fract() == 0.0);
    let sound = begins_anew && whole && seconds.iter().all(|s| EPOCH_S.contains(s));
    // The smallest unit of which a second has more than the largest part, if a second is used up.
    let fits = |of: &f64| {
        sound && parts.iter().all(|part| (0.0..*of).contains(part)) && parts.iter().any(|part| *part >= 0.5 * of)
    };
    [1e3, 1e6, 1e9].into_iter().find(fits)
}

/// The lines of the head that are neither blank nor comments.
fn lines(head: &[u8], separator: Separator) -> Vec<HeadLine> {
    let spread = (separator == Separator::Blanks).then(|| with_tabs(head));
    let mut records = separator.records(spread.as_deref().unwrap_or(head));
    let mut record = csv::ByteRecord::new();
    let mut lines = Vec::new();
    while let Ok(true) = records.read_byte_record(&mut record) {
        // The head ends with the end of a line.
        let line = HeadLine { number: records.position().line() - 1, fields: texts(&record) };
        let said = !is_comment(&record) && line.fields.iter().any(|field| !field.is_empty());
        lines.extend(Some(line).filter(|_| said));
    }
    lines
}

/// The separator with which most fields are numbers, as a layout without names, and the lines that it makes of the
/// head.
fn guess(head: &[u8]) -> Option<(Layout, Vec<HeadLine>)> {
    let mut best: Option<(f64, (Layout, Vec<HeadLine>))> = None;
    for separator in Separator::ALL {
        let lines = lines(head, separator);
        // Behind a preamble, if there is one.
        let some = &lines[lines.len() / 3..];
        let mut widths: Vec<usize> = some.iter().map(|line| line.fields.len()).collect();
        widths.sort_unstable();
        let Some(width) = widths.get(widths.len() / 2).copied().filter(|width| *width > 1) else { continue };
        let even: Vec<&HeadLine> = some.iter().filter(|line| line.fields.len() == width).collect();
        if (even.len() as f64) < SAME_WIDTH * some.len() as f64 {
            continue;
        }
        let fields = || even.iter().flat_map(|line| &line.fields);
        let says = |comma: bool| separator != Separator::Comma && fields().any(|f| number::decimals(f) == Some(comma));
        let decimal_comma = says(true) && !says(false);
        let kinds: Vec<Vec<CellKind>> = (0..width)
            .map(|k| even.iter().map(|line| CellKind::of(&line.fields[k], decimal_comma)).collect())
            .collect();
        let words = kinds.iter().flatten().filter(|kind| **kind == CellKind::Text).count();
        let share = 1.0 - words as f64 / (width * even.len()) as f64;
        let some = kinds.iter().flatten().any(|kind| *kind == CellKind::Number);
        if some && share >= NUMBERS && best.as_ref().is_none_or(|(most, _)| share > most + 1e-9) {
            let kinds = kinds.iter().map(|kinds| majority(kinds)).collect();
            best = Some((share, (Layout { separator, decimal_comma, kinds, ..Layout::default() }, lines)));
        }
    }
    best.map(|(_, guess)| guess)
}

/// The kind of most cells, of those that hold anything.
fn majority(kinds: &[CellKind]) -> CellKind {
    let count = |kind: &CellKind| kinds.iter().filter(|other| *other == kind).count();
    // The last of those that are as many.
    let most = [CellKind::Text, CellKind::Date, CellKind::Time, CellKind::Number].into_iter().max_by_key(count);
    most.filter(|kind| count(kind) > 0).unwrap_or(CellKind::Nothing)
}

/// Whether fields are those of a row of numbers.
fn is_row(fields: &[String], comma: bool) -> bool {
    let kinds: Vec<CellKind> = fields.iter().map(|field| CellKind::of(field, comma)).collect();
    let text = kinds.iter().filter(|kind| **kind == CellKind::Text).count();
    (kinds.contains(&CellKind::Number) || kinds.contains(&CellKind::Time)) && 2 * text <= kinds.len()
}

/// Whether a line begins with a word where most have a number or a time.
pub(super) fn begins_with_a_word(fields: &[String], kinds: &[CellKind]) -> bool {
    let numbers = matches!(kinds.first(), Some(CellKind::Number | CellKind::Time | CellKind::Date));
    let word = |field: &String| field.starts_with(|c: char| c.is_alphabetic() || c == '[' || c == '%' || c == '_');
    numbers && fields.first().is_some_and(|field| word(field) && CellKind::of(field, false) == CellKind::Text)
}

/// Whether fields may be names: none is a number, and some are words.
pub(super) fn looks_like_names(fields: &[String]) -> bool {
    let number = |field: &String| [false, true].into_iter().any(|comma| CellKind::of(field, comma) == CellKind::Number);
    !fields.iter().any(number) && fields.iter().any(|field| field.chars().any(char::is_alphabetic))
}

/// Whether each of the fields that has a word is a unit.
fn units_of(fields: &[String]) -> impl Iterator<Item = bool> {
    let words = fields.iter().map(|field| unit_word(field)).filter(|word| !word.is_empty());
    words.map(|word| Unit::written(word).is_some() || ["-", "1", "rpm", "deg/s", "rad/s", "%"].contains(&word))
}

/// A unit without the brackets around it.
pub(in crate::measurement) fn unit_word(field: &str) -> &str {
    field.trim().trim_matches(['[', ']', '(', ')']).trim()
}

/// `numpy.savetxt` and gnuplot write the names as a comment.
fn comment_with_names(head: &[u8], begins: u64, separator: Separator, width: usize) -> Option<(u64, Vec<String>)> {
    let above: Vec<&[u8]> = head.split(|byte| *byte == b'\n').take(begins as usize - 1).collect();
    above.iter().enumerate().rev().find_map(|(k, line)| {
        let names = [line.strip_prefix(b"#")?.trim_ascii(), b"\n"].concat();
        let names = lines(&names, separator).pop()?.fields;
        (names.len() == width && looks_like_names(&names)).then_some((k as u64 + 1, names))
    })
}

/// Lines of a file, and the verb that goes with them.
pub(super) fn lines_text(first: u64, last: u64) -> (String, &'static str) {
    if first == last { (format!("line {first}"), "is") } else { (format!("lines {first} to {last}"), "are") }
}

/// A text of at most 60 characters.
pub(super) fn shortened(text: &str) -> String {
    if text.chars().count() <= 60 { text.to_owned() } else { text.chars().take(57).chain("...".chars()).collect() }
}
