//! How a text file of numbers is laid out: what separates fields, how decimals are written, where the names of the
//! columns and their units stand, which lines above the rows are settings.
//!
//! One idea serves all forms: the lines of the file's majority have one width and columns of one kind (number, time,
//! word). That majority says the separator; a line that begins with a word where the majority has a number is no row.

use std::collections::BTreeSet;

use super::super::unit::{Family, Unit};
use super::clock::{self, Order};
use super::number::{self, Cell};

/// Bytes of a file that its layout is found from.
pub(super) const HEAD: usize = 1 << 16;
/// Share of the rows looked at that have the same width, at least.
const SAME_WIDTH: f64 = 0.8;
/// Share of the fields that are numbers, times or empty, at least: a row may hold a word or two.
const NUMBERS: f64 = 0.5;
/// Names that a file with one value in a line may have, and rows of each in its head: a word that is seldom is a
/// remark. *Guess*.
const NAMES_OF_VALUES: std::ops::RangeInclusive<usize> = 2..=64;
const ROWS_OF_A_NAME: usize = 4;
/// Seconds since 1970 of the years 2001 to 2065.
const EPOCH_S: std::ops::RangeInclusive<f64> = 1e9..=3e9;

/// The separator of two fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Separator {
    /// `,`
    Comma,
    /// `;`
    Semicolon,
    /// A tab.
    Tab,
    /// `|`
    Bar,
    /// Any number of spaces and tabs.
    Blanks,
    /// `, ` where a comma alone stands before decimals.
    CommaBlank,
}

impl Separator {
    /// In the order in which the first of several that fit is taken.
    const ALL: [Separator; 6] = [
        Separator::CommaBlank,
        Separator::Comma,
        Separator::Semicolon,
        Separator::Tab,
        Separator::Bar,
        Separator::Blanks,
    ];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Separator::Comma => "comma",
            Separator::Semicolon => "semicolon",
            Separator::Tab => "tab",
            Separator::Bar => "bar",
            Separator::Blanks => "blanks",
            Separator::CommaBlank => "comma and blank",
        }
    }

    const fn byte(self) -> u8 {
        match self {
            Separator::Comma | Separator::CommaBlank => b',',
            Separator::Semicolon => b';',
            Separator::Tab | Separator::Blanks => b'\t',
            Separator::Bar => b'|',
        }
    }

    /// Hands on the fields of a line in order, without the space and the quotes around them; returns how many there
    /// are.
    pub(super) fn split<'a>(self, line: &'a [u8], mut field: impl FnMut(usize, &'a [u8])) -> usize {
        let line = line.trim_ascii_end();
        let mut count = 0;
        let mut give = |bytes: &'a [u8]| {
            field(count, bytes.trim_ascii());
            count += 1;
        };
        if self == Separator::Blanks {
            let words = line.split(|byte| matches!(byte, b' ' | b'\t')).filter(|word| !word.is_empty());
            words.for_each(|word| give(unquoted(word)));
            return count;
        }
        let separator = self.byte();
        let (mut rest, mut from) = (line, 0);
        loop {
            // A quoted field ends at the quote before the next separator.
            let blank = rest.iter().take_while(|byte| byte.is_ascii_whitespace() && **byte != separator).count();
            if rest.get(blank) == Some(&b'"') && from <= blank {
                let closes = |at: &usize| rest[*at] == b'"' && rest.get(at + 1) != Some(&b'"') && rest[at - 1] != b'"';
                let empty = rest.get(blank + 1) == Some(&b'"');
                from = if empty {
                    blank + 2
                } else {
                    (blank + 2..rest.len()).find(closes).map_or(rest.len(), |at| at + 1)
                };
            }
            let found = rest[from.min(rest.len())..].iter().position(|byte| *byte == separator).map(|at| at + from);
            match found {
                Some(at) if self == Separator::CommaBlank && rest.get(at + 1) != Some(&b' ') => from = at + 1,
                Some(at) => {
                    give(unquoted(&rest[..at]));
                    (rest, from) = (&rest[at + 1..], 0);
                }
                None => {
                    give(unquoted(rest));
                    return count;
                }
            }
        }
    }

    /// The fields of a line.
    pub(super) fn fields(self, line: &[u8]) -> Vec<String> {
        let mut fields = Vec::new();
        self.split(line, |_, field| fields.push(String::from_utf8_lossy(field).into_owned()));
        fields
    }
}

fn unquoted(field: &[u8]) -> &[u8] {
    let field = field.trim_ascii();
    field.strip_prefix(b"\"").and_then(|field| field.strip_suffix(b"\"")).unwrap_or(field)
}

/// How a file is laid out.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Between fields.
    pub separator: Separator,
    /// Whether decimals follow a comma in any column.
    pub decimal_comma: bool,
    /// Names of the columns; `#1`, `#2`, … where the file has none.
    pub names: Vec<String>,
    /// Whether the file has names.
    pub has_names: bool,
    /// Units by column, from a line below the names or from the cells; empty where there are none.
    pub units: Vec<String>,
    /// The line of the names, or where they would be.
    pub header_line: u64,
    /// The line from which rows are read.
    pub first_row_line: u64,
    /// What a column holds in most rows.
    pub(super) kinds: Vec<Field>,
    /// Whether the decimals of a column follow a comma.
    pub(super) commas: Vec<bool>,
    /// The unit that the cells of a column say.
    pub(super) cell_units: Vec<Option<Unit>>,
    /// How times are put together of several columns.
    pub(super) stamp: Option<StampParts>,
    /// How rows are to be understood.
    pub(super) shape: Shape,
    /// Which number of a date is the day.
    pub(super) order: Order,
    /// Cells that were read otherwise than they stand.
    pub(super) notes: Vec<String>,
}

/// Kinds of row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shape {
    /// The values of an instant.
    Table,
    /// One value, with the name of its channel.
    OneValue { name: usize, value: usize, time: usize },
    /// A time and a value for each channel, side by side.
    Pairs,
}

/// A time that stands in several columns.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum StampParts {
    /// Date, clock, and AM or PM, as texts; the whole is in the column of the clock.
    Texts { date: usize, clock: usize, half: Option<usize> },
    /// Whole seconds and what they are to be added to, times a factor; the whole is in the first.
    Seconds { whole: usize, part: usize, factor: f64 },
}

/// Kinds of field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Field {
    Number,
    Time,
    Date,
    Nothing,
    Text,
}

impl Field {
    pub fn of(text: &str, comma: bool) -> Field {
        match number::cell(text.as_bytes(), comma) {
            Cell::Number(..) => Field::Number,
            Cell::Nothing | Cell::Over => Field::Nothing,
            Cell::Word if clock::seconds(text).is_some() => Field::Time,
            Cell::Word if clock::is_date(text) => Field::Date,
            Cell::Word => Field::Text,
        }
    }
}

/// A line of the head of a file.
struct Line {
    /// From 1.
    number: u64,
    text: String,
}

/// The rows of the head as one separator gives them.
struct Guess {
    separator: Separator,
    width: usize,
    commas: Vec<bool>,
    kinds: Vec<Field>,
}

impl Layout {
    /// The layout of a text; `known` are names of columns that are looked for.
    pub(super) fn of(text: &[u8], known: &[&str]) -> Layout {
        let head = &text[..text.len().min(HEAD)];
        let mut lines: Vec<Line> = String::from_utf8_lossy(head)
            .split('\n')
            .zip(1..)
            .map(|(text, number)| Line { number, text: text.trim_end_matches('\r').to_owned() })
            .collect();
        // The last one may be cut.
        if text.len() > head.len() {
            lines.pop();
        }
        lines.retain(|line| !line.text.trim().is_empty());
        let (comments, lines): (Vec<Line>, Vec<Line>) = lines.into_iter().partition(|line| line.text.starts_with('#'));
        // Names that are looked for, in the first line with commas, are a header whatever stands below: what does not
        // fit is for the reader to refuse.
        let own = is_own(&lines, known);
        let guessed = guess(&lines).map(|guess| Layout::guessed(&comments, &lines, guess, known));
        match guessed {
            Some(layout) if !own || layout.header_line == lines[0].number => layout,
            _ => Layout::own(&lines),
        }
    }

    /// The unit that the cells of a column say.
    pub(in crate::measurement) fn unit_in_cells(&self, place: usize) -> Option<Unit> {
        self.cell_units.get(place).copied().flatten()
    }

    /// Whether each channel has a time column of its own before it.
    pub(in crate::measurement) fn has_pairs(&self) -> bool {
        self.shape == Shape::Pairs
    }

    /// Commas, a point, and the names in the first line.
    fn own(lines: &[Line]) -> Layout {
        let names = lines.first().map_or_else(Vec::new, |line| Separator::Comma.fields(line.text.as_bytes()));
        let header_line = lines.first().map_or(1, |line| line.number);
        let width = names.len();
        let mut layout = Layout {
            separator: Separator::Comma,
            decimal_comma: false,
            has_names: true,
            units: Vec::new(),
            header_line,
            first_row_line: header_line + 1,
            kinds: vec![Field::Number; width],
            commas: vec![false; width],
            cell_units: vec![None; width],
            stamp: None,
            shape: Shape::Table,
            order: Order::default(),
            notes: Vec::new(),
            names,
        };
        layout.look_into_cells(&rows_of(lines, Separator::Comma, header_line + 1));
        layout
    }

    fn guessed(comments: &[Line], lines: &[Line], guess: Guess, known: &[&str]) -> Layout {
        let Guess { separator, width, commas, kinds } = guess;
        let fields: Vec<Vec<String>> = lines.iter().map(|line| separator.fields(line.text.as_bytes())).collect();
        let rows_from = (0..lines.len())
            .find(|k| {
                fields[*k].len() >= width && is_row(&fields[*k], &commas) && !begins_with_a_word(&fields[*k], &kinds)
            })
            .unwrap_or(0);
        let begins = lines[rows_from].number;
        let mut layout = Layout {
            separator,
            decimal_comma: commas.contains(&true),
            names: (1..=width).map(|k| format!("#{k}")).collect(),
            has_names: false,
            units: Vec::new(),
            header_line: begins,
            first_row_line: begins,
            kinds,
            commas,
            cell_units: vec![None; width],
            stamp: None,
            shape: Shape::Table,
            order: Order::default(),
            notes: Vec::new(),
        };
        if let Some(header) = Header::above(lines, &fields, rows_from, separator, width, known) {
            layout.has_names = true;
            layout.header_line = lines[header.names].number;
            layout.names = header_names(&lines[header.names].text, separator, width);
            layout.units = header.units.map_or_else(Vec::new, |k| fields[k].clone());
            layout.settings(lines, &fields, &header, rows_from);
            layout.keys_and_values(&fields, &header, rows_from);
        } else if let Some((line, names)) = comment_with_names(comments, begins, separator, width) {
            (layout.has_names, layout.header_line, layout.names) = (true, line, names);
        }
        // A header may have more names than rows have fields.
        let columns = layout.names.len().max(width);
        layout.kinds.resize(columns, Field::Nothing);
        layout.commas.resize(columns, false);
        layout.cell_units.resize(columns, None);
        layout.look_into_cells(&fields[rows_from..]);
        layout.find_pairs();
        layout.one_value_a_line(&fields[rows_from..]);
        layout
    }

    /// Says which lines between names and rows are neither.
    fn settings(&mut self, lines: &[Line], fields: &[Vec<String>], header: &Header, rows_from: usize) {
        let others: Vec<usize> =
            (header.block..rows_from).filter(|k| *k != header.names && Some(*k) != header.units).collect();
        let (Some(first), Some(last)) = (others.first(), others.last()) else { return };
        let words: Vec<&str> =
            others.iter().filter_map(|k| fields[*k].iter().find(|f| !f.is_empty())).map(String::as_str).collect();
        let which = match (lines[*first].number, lines[*last].number) {
            (first, last) if first == last => format!("line {first} above the rows is"),
            (first, last) => format!("lines {first} to {last} above the rows are"),
        };
        self.notes.push(format!("{which} neither names nor units ({}): left out", shortened(&words.join(", "))));
    }

    /// Headers that say `Name, motor, Name, joint` and `SampleTime[ms], 50, SampleTime[ms], 50`: a time and a value for
    /// each channel.
    fn keys_and_values(&mut self, fields: &[Vec<String>], header: &Header, rows_from: usize) {
        let width = self.names.len();
        let keyed = |k: usize| {
            let keys: Vec<&String> = fields[k].iter().step_by(2).collect();
            fields[k].len() == width && keys.len() > 1 && !keys[0].is_empty() && keys.iter().all(|key| *key == keys[0])
        };
        let lines: Vec<usize> = (header.block..rows_from).filter(|k| keyed(*k)).collect();
        if !width.is_multiple_of(2) || lines.is_empty() {
            return;
        }
        let distinct = |k: usize| fields[k].iter().skip(1).step_by(2).collect::<BTreeSet<_>>().len();
        let Some(names) = lines.iter().copied().find(|k| 2 * distinct(*k) == width) else { return };
        let time_unit = lines.iter().find_map(|k| {
            let unit = Unit::in_name(&fields[*k][0])?;
            (unit.family() == Family::Time && fields[*k][0].to_lowercase().contains("time")).then_some(unit)
        });
        self.names = fields[names].clone();
        self.units = vec![String::new(); width];
        for time in (0..width).step_by(2) {
            self.names[time] = if time == 0 { "time".to_owned() } else { format!("time {}", time / 2 + 1) };
            if let Some(unit) = time_unit {
                self.units[time] = unit.name().to_owned();
            }
        }
        self.shape = Shape::Pairs;
    }

    /// A time column before each channel, by their names.
    fn find_pairs(&mut self) {
        let width = self.names.len();
        let timely = |name: &str| {
            let word = name.to_lowercase();
            let word = word
                .split(['[', '(', '_', ' ', '.'])
                .next()
                .unwrap_or_default()
                .trim_end_matches(|c: char| c.is_ascii_digit());
            ["time", "t", "x", "zeit", "timestamp"].contains(&word)
        };
        let pairs = width >= 4 && width.is_multiple_of(2) && self.has_names;
        if pairs && (0..width).all(|k| timely(&self.names[k]) == (k % 2 == 0)) {
            self.shape = Shape::Pairs;
        }
    }

    /// A column of names and one of values: channel after channel, a value in each line.
    fn one_value_a_line(&mut self, rows: &[Vec<String>]) {
        let of_kind = |kind: Field| (0..self.kinds.len()).filter(|k| self.kinds[*k] == kind).collect::<Vec<_>>();
        let (numbers, mut times, words) = (of_kind(Field::Number), of_kind(Field::Time), of_kind(Field::Text));
        if let ([value, second], []) = (numbers.as_slice(), times.as_slice()) {
            // Seconds and a value: the time stands first.
            times.push(*value);
            let (value, time) = (*second, *value);
            return self.one_value_of(rows, &words, value, time);
        }
        if let ([value], [time]) = (numbers.as_slice(), times.as_slice()) {
            self.one_value_of(rows, &words, *value, *time);
        }
    }

    fn one_value_of(&mut self, rows: &[Vec<String>], words: &[usize], value: usize, time: usize) {
        let named = words.iter().copied().find(|k| {
            let names: BTreeSet<&String> = rows.iter().filter_map(|row| row.get(*k)).collect();
            NAMES_OF_VALUES.contains(&names.len()) && ROWS_OF_A_NAME * names.len() <= rows.len()
        });
        if let Some(name) = named {
            self.shape = Shape::OneValue { name, value, time };
        }
    }

    /// What the cells of the head say: units, dates, times in several columns.
    fn look_into_cells(&mut self, rows: &[Vec<String>]) {
        let width = self.names.len();
        let column = |k: usize| rows.iter().filter_map(move |row| row.get(k)).map(String::as_str);
        for k in 0..width {
            let unit = column(k).find_map(|text| match number::cell(text.as_bytes(), self.commas[k]) {
                Cell::Number(_, unit) => unit,
                _ => None,
            });
            self.cell_units[k] = unit;
            if let Some(unit) = unit {
                self.units.resize(width, String::new());
                if self.units[k].is_empty() {
                    self.units[k] = unit.name().to_owned();
                }
            }
            if matches!(self.kinds.get(k), Some(Field::Time | Field::Date)) && self.order == Order::default() {
                self.order = clock::order(column(k));
            }
        }
        let kind = |k: usize| self.kinds.get(k).copied().unwrap_or(Field::Nothing);
        let dated = (0..width).find(|k| kind(*k) == Field::Date && kind(k + 1) == Field::Time);
        if let Some(date) = dated {
            let is_half = |text: &str| ["am", "pm"].contains(&text.to_ascii_lowercase().as_str());
            let half = (kind(date + 2) == Field::Text && column(date + 2).all(is_half)).then_some(date + 2);
            if half.is_some() && self.order == Order::default() {
                let written: Vec<String> = column(date).map(|text| format!("{text} AM")).collect();
                self.order = clock::order(written.iter().map(String::as_str));
            }
            self.stamp = Some(StampParts::Texts { date, clock: date + 1, half });
            self.notes.push(format!(
                "date and time stand in columns {} and {}: they are read together, as column {}",
                date + 1,
                date + 2,
                date + 2
            ));
            return;
        }
        for whole in 0..width.saturating_sub(1) {
            if let Some((factor, unit)) = self.parts_of_a_second(whole, &column) {
                self.stamp = Some(StampParts::Seconds { whole, part: whole + 1, factor });
                self.notes.push(format!(
                    "column {} has seconds since 1970, column {} what is to be added in {unit}: they are read \
                     together, as column {}",
                    whole + 1,
                    whole + 2,
                    whole + 1
                ));
                return;
            }
        }
    }

    /// Whether a column has seconds since 1970 and the next one what is to be added, and in which unit.
    fn parts_of_a_second<'a, I: Iterator<Item = &'a str>>(
        &self,
        whole: usize,
        column: &impl Fn(usize) -> I,
    ) -> Option<(f64, &'static str)> {
        let values = |k: usize| -> Vec<f64> { column(k).filter_map(|text| text.parse().ok()).collect() };
        let (seconds, parts) = (values(whole), values(whole + 1));
        let is_whole = |values: &[f64]| values.iter().all(|value| value.fract() == 0.0);
        let sound = seconds.len() > 1
            && seconds.len() == parts.len()
            && is_whole(&seconds)
            && is_whole(&parts)
            && seconds.iter().all(|s| EPOCH_S.contains(s));
        if !sound {
            return None;
        }
        let most = parts.iter().copied().fold(0.0, f64::max);
        let least = parts.iter().copied().fold(f64::INFINITY, f64::min);
        let begins_anew = seconds.windows(2).zip(parts.windows(2)).any(|(s, part)| s[1] > s[0] && part[1] < part[0]);
        // The smallest unit of which a second has more than the largest part, if a second is used up.
        [(1e3, "ms"), (1e6, "us"), (1e9, "ns")]
            .into_iter()
            .find(|(parts, _)| least >= 0.0 && most < *parts && (most >= 0.5 * parts) && begins_anew)
            .map(|(parts, unit)| (1.0 / parts, unit))
    }
}

/// The fields of the lines from one on.
fn rows_of(lines: &[Line], separator: Separator, from: u64) -> Vec<Vec<String>> {
    lines.iter().filter(|line| line.number >= from).map(|line| separator.fields(line.text.as_bytes())).collect()
}

/// Whether the first line has one of the names that are looked for, between commas.
fn is_own(lines: &[Line], known: &[&str]) -> bool {
    let names = lines.first().map_or_else(Vec::new, |line| Separator::Comma.fields(line.text.as_bytes()));
    names.len() > 1 && names.iter().any(|name| known.contains(&name.as_str()))
}

/// The separator with which most fields are numbers, and what it makes of the rows.
fn guess(lines: &[Line]) -> Option<Guess> {
    // Behind a preamble, if there is one.
    let lines = &lines[lines.len() / 3..];
    let mut best: Option<(f64, Guess)> = None;
    for separator in Separator::ALL {
        let rows: Vec<Vec<String>> = lines.iter().map(|line| separator.fields(line.text.as_bytes())).collect();
        let mut widths: Vec<usize> = rows.iter().map(Vec::len).collect();
        widths.sort_unstable();
        let width = *widths.get(widths.len() / 2)?;
        let even: Vec<&Vec<String>> = rows.iter().filter(|row| row.len() == width).collect();
        if width < 2 || (even.len() as f64) < SAME_WIDTH * rows.len() as f64 {
            continue;
        }
        let commas = decimal_commas(&even, width);
        if separator == Separator::CommaBlank && !commas.contains(&true) {
            continue;
        }
        let kinds: Vec<Vec<Field>> =
            (0..width).map(|k| even.iter().map(|row| Field::of(&row[k], commas[k])).collect()).collect();
        let count = |what: &dyn Fn(Field) -> bool| kinds.iter().flatten().filter(|kind| what(**kind)).count();
        let numbers = count(&|kind| kind != Field::Text) as f64 / (width * even.len()).max(1) as f64;
        let some = count(&|kind| kind == Field::Number) > 0;
        if some && numbers >= NUMBERS && best.as_ref().is_none_or(|(share, _)| numbers > share + 1e-9) {
            let kinds = kinds.iter().map(|kinds| majority(kinds)).collect();
            best = Some((numbers, Guess { separator, width, commas, kinds }));
        }
    }
    best.map(|(_, guess)| guess)
}

/// Whether the decimals of a column follow a comma: by the numbers that can be read in one way, of the column or else
/// of the file.
fn decimal_commas(rows: &[&Vec<String>], width: usize) -> Vec<bool> {
    let says: Vec<[usize; 2]> = (0..width)
        .map(|k| {
            let says = rows.iter().filter_map(|row| number::decimals(&row[k]));
            says.fold([0, 0], |mut count, comma| {
                count[usize::from(comma)] += 1;
                count
            })
        })
        .collect();
    let all = says.iter().fold([0, 0], |all, says| [all[0] + says[0], all[1] + says[1]]);
    let file = all[1] > 0 && all[0] == 0;
    says.iter().map(|says| if *says == [0, 0] { file } else { says[1] > says[0] }).collect()
}

/// What most cells hold, of those that hold anything.
fn majority(kinds: &[Field]) -> Field {
    let count = |kind: Field| kinds.iter().filter(|other| **other == kind).count();
    let some = [Field::Number, Field::Time, Field::Date, Field::Text].into_iter().map(|kind| (count(kind), kind));
    // The first of those that are as many.
    some.rev().max_by_key(|(count, _)| *count).filter(|(count, _)| *count > 0).map_or(Field::Nothing, |(_, kind)| kind)
}

/// Whether fields are those of a row of numbers.
fn is_row(fields: &[String], commas: &[bool]) -> bool {
    let kinds: Vec<Field> =
        fields.iter().enumerate().map(|(k, field)| Field::of(field, commas.get(k).copied().unwrap_or(false))).collect();
    let text = kinds.iter().filter(|kind| **kind == Field::Text).count();
    (kinds.contains(&Field::Number) || kinds.contains(&Field::Time)) && 2 * text <= kinds.len()
}

/// Whether a line begins with a word where most have a number or a time.
pub(super) fn begins_with_a_word(fields: &[String], kinds: &[Field]) -> bool {
    let numbers = matches!(kinds.first(), Some(Field::Number | Field::Time | Field::Date));
    let word = |field: &String| {
        Field::of(field, false) == Field::Text
            && field.starts_with(|c: char| c.is_alphabetic())
            && Field::of(field, true) == Field::Text
    };
    numbers && fields.first().is_some_and(word)
}

/// Whether fields may be names: none is a number, and some are words.
pub(super) fn looks_like_names(fields: &[String]) -> bool {
    let number = |field: &String| {
        !field.is_empty() && [false, true].into_iter().any(|comma| Field::of(field, comma) == Field::Number)
    };
    !fields.iter().any(number) && fields.iter().any(|field| field.chars().any(char::is_alphabetic))
}

/// Whether fields are units.
fn looks_like_units(fields: &[String]) -> bool {
    let words = || fields.iter().map(|field| unit_word(field)).filter(|word| !word.is_empty());
    let known =
        |word: &str| Unit::in_brackets(word).is_some() || ["-", "1", "rpm", "deg/s", "rad/s", "%"].contains(&word);
    words().count() > 0 && words().all(known)
}

/// A unit without the brackets around it.
pub(in crate::measurement) fn unit_word(field: &str) -> &str {
    field.trim().trim_matches(['[', ']', '(', ')']).trim()
}

/// The lines above the rows that say what the columns are.
struct Header {
    names: usize,
    units: Option<usize>,
    /// The first of the lines that stand together above the rows.
    block: usize,
}

impl Header {
    fn above(
        lines: &[Line],
        fields: &[Vec<String>],
        rows_from: usize,
        separator: Separator,
        width: usize,
        known: &[&str],
    ) -> Option<Header> {
        let names = |k: usize| header_names(&lines[k].text, separator, width);
        // A header may lack the name of an empty last field, and rows may be too long: that is for the reader to say.
        let fits = |k: usize| {
            let names = names(k);
            names.len() == width || names.len() + 1 == width || (k == 0 && names.len() > 1)
        };
        let block = (0..rows_from).rev().take_while(|k| fits(*k)).last()?;
        let candidates: Vec<usize> = (block..rows_from).filter(|k| looks_like_names(&names(*k))).collect();
        let units = candidates.iter().copied().find(|k| looks_like_units(&fields[*k])).filter(|_| candidates.len() > 1);
        // Names differ from one another; what says the same of all columns is something else.
        let distinct = |k: usize| names(k).into_iter().filter(|name| !name.is_empty()).collect::<BTreeSet<_>>().len();
        let of_known = |k: usize| names(k).iter().filter(|name| known.contains(&name.as_str())).count();
        let best = |among: &dyn Fn(usize) -> bool| {
            let some = candidates.iter().copied().filter(|k| Some(*k) != units && among(*k));
            some.max_by_key(|k| (of_known(*k), distinct(*k), *k))
        };
        let above_units = units.and_then(|units| best(&|k| k < units));
        let names = above_units.or_else(|| best(&|_| true))?;
        Some(Header { names, units, block: block.min(names) })
    }
}

/// `numpy.savetxt` and gnuplot write the names as a comment.
fn comment_with_names(
    comments: &[Line],
    begins: u64,
    separator: Separator,
    width: usize,
) -> Option<(u64, Vec<String>)> {
    comments
        .iter()
        .rev()
        .filter(|line| line.number < begins)
        .map(|line| (line.number, header_names(line.text.trim_start_matches(['#', ' ', '\t', '%']), separator, width)))
        .find(|(_, names)| names.len() == width && looks_like_names(names))
}

/// The names in a header line: separated as the rows are, or by something else that gives as many.
fn header_names(line: &str, separator: Separator, width: usize) -> Vec<String> {
    let own = separator.fields(line.as_bytes());
    if own.len() == width {
        return own;
    }
    let other =
        Separator::ALL.into_iter().map(|other| other.fields(line.as_bytes())).find(|names| names.len() == width);
    other.filter(|_| width > 1).unwrap_or(own)
}

/// A text of at most 60 characters.
pub(super) fn shortened(text: &str) -> String {
    if text.chars().count() <= 60 { text.to_owned() } else { text.chars().take(57).chain("...".chars()).collect() }
}
