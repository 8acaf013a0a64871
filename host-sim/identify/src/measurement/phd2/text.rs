//! The text of a guide log: what a line says of a section, and the fields of its rows.
//!
//! PHD2 writes a point in its numbers; a spreadsheet that saves a log again may write commas, between semicolons or in
//! quotes.

/// Separators of the fields of a row.
const SEPARATORS: [char; 3] = [',', ';', '\t'];

/// A number, with how many decimals it is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WrittenNumber {
    pub value: f64,
    pub decimals: i32,
}

/// The number behind `word`, which begins a line or stands behind a comma or a semicolon: `Dec = ` is none in
/// `Cal Dec = 5.0`. Nothing where another unit than one of `units` follows (`Dec = 6.8"/s` is a rate); no units are
/// any.
pub(super) fn said(line: &str, word: &str, units: &[&str]) -> Option<WrittenNumber> {
    let begins = |at: &usize| {
        let before = line[..*at].trim_end().chars().next_back();
        before.is_none_or(|c| SEPARATORS.contains(&c) || c == '"')
    };
    let at = line.match_indices(word).map(|(at, _)| at).find(begins)?;
    let rest = &line[at + word.len()..];
    let bytes = rest.as_bytes();
    let digit = |at: usize| bytes.get(at).is_some_and(u8::is_ascii_digit);
    // A comma with a digit behind it is one of decimals: what parts fields has a blank.
    let belongs = |at: usize, c: char| {
        c.is_ascii_digit() || c == '.' || at == 0 && matches!(c, '-' | '+') || c == ',' && digit(at + 1)
    };
    let end = rest.char_indices().find(|(at, c)| !belongs(*at, *c)).map_or(rest.len(), |(at, _)| at);
    let unit = rest[end..].trim_start();
    if !units.is_empty() && !units.iter().any(|known| unit.starts_with(known)) {
        return None;
    }
    let decimals = rest[..end].find(['.', ',']).map_or(0, |point| end - point - 1);
    Some(WrittenNumber { value: number(&rest[..end])?, decimals: decimals as i32 })
}

/// The word behind `word`.
pub(super) fn word_of<'l>(line: &'l str, word: &str) -> Option<&'l str> {
    let rest = &line[line.find(word)? + word.len()..];
    rest.split([',', ';', '"']).next().map(str::trim)
}

/// A finite number with a point or a comma before its decimals.
pub(super) fn number(text: &str) -> Option<f64> {
    let text = text.trim();
    let parsed = text.parse::<f64>().or_else(|_| text.replacen(',', ".", 1).parse());
    parsed.ok().filter(|value| value.is_finite())
}

/// The names of the columns of a table of rows.
#[derive(Clone, Debug)]
pub(super) struct Header {
    separator: char,
    names: Vec<String>,
}

impl Header {
    /// Of a line that begins with the column `Frame`.
    pub fn of(line: &str) -> Option<Header> {
        let rest = line.trim_start_matches('"').strip_prefix("Frame")?.trim_start_matches('"');
        let separator = rest.chars().next().filter(|c| SEPARATORS.contains(c))?;
        Some(Header { separator, names: split(line, separator) })
    }

    /// The fields of columns by their names, empty where there is none; `None` where there are more than the names
    /// allow, as numbers with decimal commas between commas make them.
    pub fn fields<const N: usize>(&self, line: &str, columns: [&str; N]) -> Option<[String; N]> {
        let fields = split(line, self.separator);
        let place = |column: &str| self.names.iter().position(|name| name == column);
        let field = |column| place(column).and_then(|place| fields.get(place).cloned()).unwrap_or_default();
        // One more than names says why a star was lost.
        (fields.len() <= self.names.len() + 1).then(|| columns.map(field))
    }
}

/// The fields of a line, without quotes; what parts them may stand within quotes.
fn split(line: &str, separator: char) -> Vec<String> {
    let mut form = csv::ReaderBuilder::new();
    let mut records = form.has_headers(false).delimiter(separator as u8).from_reader(line.as_bytes());
    let record = records.records().next().and_then(Result::ok).unwrap_or_default();
    record.iter().map(|field| field.trim().to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_found_behind_the_words_that_mean_them() {
        let deg = |line: &str| said(line, "Dec = ", &["deg"]).map(|written| written.value);
        assert_eq!(deg("RA = 5.00 hr, Dec = 69.0 deg, Hour angle = 1.00 hr"), Some(69.0));
        assert_eq!(deg("Dec = -12.5 deg, Hour angle = -3.84 hr"), Some(-12.5));
        assert_eq!(deg("RA = 5,00 hr, Dec = 35,25 deg"), Some(35.25));
        assert_eq!(deg("\"RA = 5.00 hr\";\"Dec = 35.5 deg\""), Some(35.5));
        for none in [
            "RA Guide Speed = 7.5 a-s/s, Dec Guide Speed = 7.5 a-s/s, Cal Dec = 20.0 deg, Last Cal Issue = None",
            "Norm rates RA = 7.0\"/s @ dec 0, Dec = 6.8\"/s; ortho.err. = 11.8 deg",
            "Mount = mount, Dec = Unknown, Hour angle = Unknown",
            "Last Cal Dec = 5.0 deg",
            "",
        ] {
            assert_eq!(deg(none), None, "{none}");
        }
        let hours = said("Dec = 69,0 deg, Hour angle = -3,84 hr", "Hour angle = ", &["hr"]);
        assert_eq!(hours, Some(WrittenNumber { value: -3.84, decimals: 2 }));
        assert_eq!(said("Hour angle = N/A hr", "Hour angle = ", &["hr"]), None);
        assert_eq!(said("Pixel scale = 1.50 arc-sec/px, Binning = 1", "Pixel scale = ", &[]).unwrap().value, 1.5);
        assert_eq!(word_of("Hour angle = 1 hr, Pier side = West, Alt", "Pier side = "), Some("West"));
    }

    #[test]
    fn fields_are_parted_whatever_decimals_are_written_with() {
        let names = "Frame,Time,mount,dx,RARawDistance,RADuration,RADirection,StarMass,SNR,ErrorCode";
        let used = ["Time", "RARawDistance", "RADuration", "RADirection", "ErrorCode", "Absent"];
        let plain = ["2.093", "0.15", "108", "W", "0", ""];
        let header = Header::of(names).unwrap();
        let fields = |line: &str| header.fields(line, used);
        assert_eq!(fields("7,2.093,\"Mount\",-0.5,0.15,108,W,1702,28.36,0").unwrap(), plain);
        assert_eq!(fields("7,2,093,\"Mount\",-0,5,0,15,108,W,1702,28,36,0"), None);
        let quoted = fields("7,\"2,093\",Mount,\"-0,5\",\"0,15\",108,W,1702,\"28,36\",0").unwrap();
        assert_eq!(number(&quoted[0]), Some(2.093));
        let lost = fields("8,3.1,\"DROP\",,,,,0,0.00,3,\"Star lost, low mass\"").unwrap();
        assert_eq!(lost[4], "3");
        let header = Header::of(&names.replace(',', ";")).unwrap();
        let semicolons = header.fields("7;2,093;Mount;-0,5;0,15;108;W;1702;28,36;0", used).unwrap();
        assert_eq!(number(&semicolons[1]), Some(0.15));
        assert!(Header::of("Frames lost").is_none());
    }
}
