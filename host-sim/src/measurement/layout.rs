//! How a text file of numbers is laid out: what separates fields, how decimals are written, where the names of the columns stand.
//!
//! The form of this project (commas, a point, the names in the first line) is known by its names and read as it is. Any other form
//! is told from the first lines: the separator that gives rows of one width with the most numbers in them, the line of text
//! before the first of these rows, a line of units between the two.

use super::clock_text;
use super::unit::Unit;

/// Bytes of a file that its layout is told from.
pub(super) const HEAD: u64 = 1 << 16;
/// Share of the rows looked at that have the same width, at least.
const SAME_WIDTH: f64 = 0.8;
/// Share of the fields that are numbers, times or empty, at least: a row may hold a word or two.
const NUMBERS: f64 = 0.5;

/// What stands between two fields.
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
}

impl Separator {
    /// In the order in which the first of several that fit is taken.
    const ALL: [Separator; 5] =
        [Separator::Comma, Separator::Semicolon, Separator::Tab, Separator::Bar, Separator::Blanks];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Separator::Comma => "comma",
            Separator::Semicolon => "semicolon",
            Separator::Tab => "tab",
            Separator::Bar => "bar",
            Separator::Blanks => "blanks",
        }
    }

    /// The byte between fields; blanks are made one tab before.
    pub(super) const fn byte(self) -> u8 {
        match self {
            Separator::Comma => b',',
            Separator::Semicolon => b';',
            Separator::Tab | Separator::Blanks => b'\t',
            Separator::Bar => b'|',
        }
    }

    /// The fields of a line without the space around them.
    fn fields(self, line: &str) -> Vec<String> {
        let unquoted = |field: &str| {
            let field = field.trim();
            field.strip_prefix('"').and_then(|f| f.strip_suffix('"')).unwrap_or(field).trim().to_owned()
        };
        if self == Separator::Blanks {
            return line.split_whitespace().map(unquoted).collect();
        }
        if !line.contains('"') {
            return line.split(char::from(self.byte())).map(unquoted).collect();
        }
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(self.byte())
            .from_reader(line.trim().as_bytes());
        let record = reader.records().next().and_then(Result::ok).unwrap_or_default();
        record.iter().map(|field| field.trim().to_owned()).collect()
    }
}

/// How a file is laid out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    /// Between fields.
    pub separator: Separator,
    /// Whether decimals follow a comma.
    pub decimal_comma: bool,
    /// Names of the columns; `#1`, `#2`, … where the file has none.
    pub names: Vec<String>,
    /// Whether the file has names.
    pub has_names: bool,
    /// Units, from a line below the names; empty where there is none.
    pub units: Vec<String>,
    /// The line of the names, or where they would be.
    pub header_line: u64,
    /// The line from which rows are read.
    pub first_row_line: u64,
}

/// What a field holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Field {
    Number,
    Time,
    Nothing,
    Text,
}

/// Whether a field says that nothing was recorded.
pub(super) fn missing(text: &str) -> bool {
    const WORDS: [&str; 8] = ["", "na", "n/a", "null", "none", "nil", "-", "?"];
    WORDS.iter().any(|word| text.eq_ignore_ascii_case(word))
}

/// A number with its decimals behind a comma: `-1,5`, `0,25e-3`.
pub(super) fn with_comma(text: &str) -> Option<f64> {
    let at = text.find(',')?;
    let digit = |byte: Option<&u8>| byte.is_some_and(u8::is_ascii_digit);
    let bytes = text.as_bytes();
    let sound = digit(bytes.get(at + 1)) && (at > 0 && digit(bytes.get(at - 1))) && !text.contains('.');
    if sound { text.replacen(',', ".", 1).parse().ok() } else { None }
}

impl Field {
    pub fn of(text: &str, decimal_comma: bool) -> Field {
        if missing(text) {
            Field::Nothing
        } else if text.parse::<f64>().is_ok() || (decimal_comma && with_comma(text).is_some()) {
            Field::Number
        } else if clock_text::seconds(text).is_some() {
            Field::Time
        } else {
            Field::Text
        }
    }
}

/// A line of the head of a file.
struct Line {
    /// From 1.
    number: u64,
    text: String,
}

impl Layout {
    /// The layout of a file that begins with `head`; `known` are names of columns that are looked for. `None` where the file is to be read
    /// as it is: with commas, a point and its first line as header.
    pub fn of(head: &[u8], known: &[&str]) -> Option<Layout> {
        let head = head.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(head);
        if head.contains(&0) || head.starts_with(b"\xFF\xFE") || head.starts_with(b"\xFE\xFF") {
            return None;
        }
        let mut lines: Vec<Line> = text_of(head)
            .split('\n')
            .zip(1..)
            .map(|(text, number)| Line { number, text: text.trim_end_matches('\r').to_owned() })
            .collect();
        // The last one may be cut.
        if head.len() as u64 >= HEAD {
            lines.pop();
        }
        lines.retain(|line| !line.text.trim().is_empty());
        let (comments, lines): (Vec<Line>, Vec<Line>) = lines.into_iter().partition(|line| line.text.starts_with('#'));
        let first = lines.first()?;
        let plain = Separator::Comma.fields(&first.text);
        if plain.len() > 1 && plain.iter().any(|name| known.contains(&name.as_str())) {
            return None;
        }
        let (separator, decimal_comma, width) = separator_of(&lines)?;
        let fields: Vec<Vec<String>> = lines.iter().map(|line| separator.fields(&line.text)).collect();
        // A row of a preamble, `Rate;1000`, is shorter.
        let is_row = |k: usize| is_row(&fields[k], decimal_comma) && fields[k].len() >= width;
        let rows_from = (0..lines.len()).find(|k| is_row(*k))?;
        let found = header_above(&lines, &fields, rows_from, separator, width, decimal_comma);
        let layout = match found {
            Some((header, units, from)) => Layout {
                separator,
                decimal_comma,
                names: header_names(&lines[header].text, separator, width),
                has_names: true,
                units: units.map_or_else(Vec::new, |k| fields[k].clone()),
                header_line: lines[header].number,
                first_row_line: from.map_or(lines[rows_from].number, |k| lines[k].number),
            },
            None => {
                let begins = lines[rows_from].number;
                // `numpy.savetxt` and gnuplot write the names as a comment.
                let comment = comments
                    .iter()
                    .rev()
                    .filter(|line| line.number < begins)
                    .map(|line| (line, line.text.trim_start_matches(['#', ' ', '\t', '%'])))
                    .map(|(line, text)| (line, header_names(text, separator, width)))
                    .find(|(_, names)| names.len() == width && looks_like_names(names));
                let (has_names, header_line, names) = match comment {
                    Some((line, names)) => (true, line.number, names),
                    None => (false, begins, (1..=width).map(|k| format!("#{k}")).collect()),
                };
                Layout {
                    separator,
                    decimal_comma,
                    names,
                    has_names,
                    units: Vec::new(),
                    header_line,
                    first_row_line: begins,
                }
            }
        };
        let plain = separator == Separator::Comma
            && layout.has_names
            && layout.units.is_empty()
            && layout.header_line == first.number
            && lines.get(1).is_some_and(|line| line.number == layout.first_row_line);
        if plain { None } else { Some(layout) }
    }
}

/// Text in UTF-8, else in Latin-1, which every byte is.
pub(super) fn text_of(bytes: &[u8]) -> String {
    // A character at the end may be cut.
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(error) if error.error_len().is_none() => {
            String::from_utf8_lossy(&bytes[..error.valid_up_to()]).into_owned()
        }
        Err(_) => bytes.iter().map(|byte| char::from(*byte)).collect(),
    }
}

/// The separator with which most fields are numbers, how it writes decimals, and the width of its rows.
fn separator_of(lines: &[Line]) -> Option<(Separator, bool, usize)> {
    // Behind a preamble, if there is one.
    let lines = &lines[lines.len() / 3..];
    let mut best: Option<(f64, Separator, bool, usize)> = None;
    for separator in Separator::ALL {
        let rows: Vec<Vec<String>> = lines.iter().map(|line| separator.fields(&line.text)).collect();
        let mut widths: Vec<usize> = rows.iter().map(Vec::len).collect();
        widths.sort_unstable();
        let width = *widths.get(widths.len() / 2)?;
        let even = rows.iter().filter(|row| row.len() == width).count();
        if width < 2 || (even as f64) < SAME_WIDTH * rows.len() as f64 {
            continue;
        }
        let all = || rows.iter().filter(|row| row.len() == width).flatten();
        let commas = separator != Separator::Comma && all().any(|field| with_comma(field).is_some());
        let points = all().any(|field| field.contains('.') && field.parse::<f64>().is_ok());
        let decimal_comma = commas && !points;
        let kinds = || all().map(|field| Field::of(field, decimal_comma));
        let numbers = kinds().filter(|kind| *kind != Field::Text).count() as f64 / all().count().max(1) as f64;
        let some = kinds().any(|kind| kind == Field::Number);
        if some && numbers >= NUMBERS && best.is_none_or(|(share, ..)| numbers > share + 1e-9) {
            best = Some((numbers, separator, decimal_comma, width));
        }
    }
    best.map(|(_, separator, decimal_comma, width)| (separator, decimal_comma, width))
}

/// Whether fields are those of a row of numbers.
fn is_row(fields: &[String], decimal_comma: bool) -> bool {
    let kinds: Vec<Field> = fields.iter().map(|field| Field::of(field, decimal_comma)).collect();
    let text = kinds.iter().filter(|kind| **kind == Field::Text).count();
    kinds.contains(&Field::Number) && 2 * text <= kinds.len()
}

/// Whether fields may be names: none is a number, and some are words.
fn looks_like_names(fields: &[String]) -> bool {
    let number = |field: &String| field.parse::<f64>().is_ok() || with_comma(field).is_some();
    !fields.iter().any(number) && fields.iter().any(|field| field.chars().any(char::is_alphabetic))
}

/// Whether fields are units.
fn looks_like_units(fields: &[String]) -> bool {
    let words = || fields.iter().map(|field| unit_word(field)).filter(|word| !word.is_empty());
    let known = |word: &str| Unit::written(word).is_some() || ["-", "1", "rpm", "deg/s", "rad/s", "%"].contains(&word);
    words().count() > 0 && words().all(known)
}

/// A unit without the brackets around it.
pub(super) fn unit_word(field: &str) -> &str {
    field.trim().trim_matches(['[', ']', '(', ')']).trim()
}

/// The line of names above the rows, that of units, and the row from which rows are read if it is not the first that is one.
type Header = (usize, Option<usize>, Option<usize>);

fn header_above(
    lines: &[Line],
    fields: &[Vec<String>],
    rows_from: usize,
    separator: Separator,
    width: usize,
    decimal_comma: bool,
) -> Option<Header> {
    let above = rows_from.checked_sub(1)?;
    let names = |k: usize| header_names(&lines[k].text, separator, width);
    let fits = |k: usize| {
        let names = names(k);
        // A header may lack the name of an empty last field, and rows may be too long: that is for the reader to say.
        looks_like_names(&names) && (names.len() == width || names.len() + 1 == width || (k == 0 && names.len() > 1))
    };
    if fits(above) {
        let units = above > 0 && looks_like_units(&fields[above]) && fits(above - 1);
        return Some(if units { (above - 1, Some(above), None) } else { (above, None, None) });
    }
    // Rows that are none, below the names: they are for the reader to refuse.
    let damaged =
        |k: usize| fields[k].len() == width && fields[k].iter().any(|f| Field::of(f, decimal_comma) == Field::Number);
    let header = (0..above).rev().find(|k| fits(*k))?;
    (header + 1..=above).all(damaged).then_some((header, None, Some(header + 1)))
}

/// The names in a header line: separated as the rows are, or by something else that gives as many.
fn header_names(line: &str, separator: Separator, width: usize) -> Vec<String> {
    let own = separator.fields(line);
    if own.len() == width {
        return own;
    }
    let other = Separator::ALL.into_iter().map(|other| other.fields(line)).find(|names| names.len() == width);
    other.filter(|_| width > 1).unwrap_or(own)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(text: &str) -> Option<Layout> {
        Layout::of(text.as_bytes(), &["generator_rad"])
    }

    fn rows(row: &str) -> String {
        format!("{row}\n").repeat(20)
    }

    #[test]
    fn the_form_of_this_project_is_left_alone() {
        for text in ["a,b\n1,2\n", "generator_rad,b\n1;2\n3;4\n", "", "Only prose.\nTwo lines.\n"] {
            assert_eq!(layout(text), None, "{text:?}");
        }
        assert!(layout("generator_rad;x\n1;2\n3;4\n").is_some());
        assert_eq!(Layout::of(&[b'1'; HEAD as usize + 5], &[]), None);
    }

    #[test]
    fn separators_and_decimals_are_told() {
        for (text, separator, comma) in [
            (format!("t;a;b\n{}", rows("0,5;1;2,25")), Separator::Semicolon, true),
            (format!("t;a;b\n{}", rows("0.5;1;2.25")), Separator::Semicolon, false),
            (format!("t\ta\tb\n{}", rows("0,5\t1\t2,25")), Separator::Tab, true),
            (format!("t|a|b\n{}", rows("0.5|1|2.25")), Separator::Bar, false),
            (format!("  t   a  b\n{}", rows("  0.5    1   -2.25e-3")), Separator::Blanks, false),
            (format!("t a b\n{}", rows("0,5 1,0 2,0")), Separator::Blanks, true),
            (format!("\"t\";\"a\"\n{}", rows("\"0,5\";\"1,5\"")), Separator::Semicolon, true),
            (format!("t;a;b\n{}", rows("2026-11-22 14:05:00,5;1;2,25")), Separator::Semicolon, true),
        ] {
            let found = layout(&text).unwrap_or_else(|| panic!("{text:?}"));
            assert_eq!((found.separator, found.decimal_comma), (separator, comma), "{text:?}");
            assert_eq!((found.names[0].as_str(), found.header_line, found.first_row_line), ("t", 1, 2), "{text:?}");
        }
    }

    #[test]
    fn names_are_found_below_a_preamble_and_above_units() {
        let text = format!("Logger 7\nRate;1000\n\nZeit;Winkel;M\n[s];[°];[Nm]\n{}", rows("0,5;1;2,25"));
        let found = layout(&text).unwrap();
        assert_eq!(found.names, ["Zeit", "Winkel", "M"]);
        assert_eq!(found.units, ["[s]", "[°]", "[Nm]"]);
        assert_eq!((found.header_line, found.first_row_line), (4, 6));
        // Without names: by their numbers; as a comment, as numpy writes them.
        let found = layout(&rows("1 2 3")).unwrap();
        assert_eq!((found.has_names, found.names.join(" ")), (false, "#1 #2 #3".to_owned()));
        let found = layout(&format!("# bench 4\n# t psi delta\n{}", rows("1 2 3"))).unwrap();
        assert_eq!((found.has_names, found.names.join(" "), found.header_line), (true, "t psi delta".to_owned(), 2));
        assert_eq!(found.first_row_line, 3);
        // Commas with a preamble.
        let found = layout(&format!("Bench 4, Tuesday\nt,psi,delta\n{}", rows("1,2,3"))).unwrap();
        assert_eq!((found.names.join(" "), found.header_line), ("t psi delta".to_owned(), 2));
        // A first row that is damaged is a row.
        let found = layout(&format!("t;psi;delta\nx;y;1\n{}", rows("1;2;3"))).unwrap();
        assert_eq!((found.header_line, found.first_row_line), (1, 2));
    }
}
