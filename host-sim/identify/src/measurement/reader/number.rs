//! A cell as a number: decimals behind a point or a comma, groups of thousands, exponents of Fortran, units inside of
//! cells, marks of what was beyond a range.

use super::super::unit::Unit;

/// What a cell holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Cell {
    /// A number, with its unit where the cell says one.
    Number(f64, Option<Unit>),
    /// Nothing was recorded.
    Nothing,
    /// The instrument says that the value was beyond its range.
    Over,
    /// No number.
    Word,
}

/// What says that nothing was recorded.
const MISSING: [&str; 16] = [
    "na",
    "n/a",
    "#n/a",
    "null",
    "<null>",
    "none",
    "nil",
    "\\n",
    "-",
    "--",
    "---",
    "?",
    "nan(ind)",
    "-nan(ind)",
    "1.#qnan",
    "-1.#ind",
];
/// What says that a value was beyond the range, as voltmeters, loggers (Keyence, Keysight, NI) and spreadsheets write
/// it.
const OVER: [&str; 17] = [
    "over",
    "under",
    "overrange",
    "over range",
    "overflow",
    "underflow",
    "ovrflw",
    "ovrng",
    "ovld",
    "overload",
    "ol",
    "o.l",
    "ol.",
    "burnout",
    "out of range",
    "1.#inf",
    "#num!",
];
/// SCPI-99, volume 1, 7.2.1.4: 9.9E37 is infinity, 9.91E37 no number; some instruments write 9.9E36. The largest single
/// float is another.
const OVER_NUMBERS: [(f64, f64); 2] = [(9.89e36, 1.0e38), (3.402e38, 3.404e38)];
/// Units of cells that no column of a mapping has.
const OTHER_UNITS: [&str; 12] = ["rpm", "1/min", "%", "deg/s", "°/s", "rad/s", "mm", "um", "µm", "Hz", "W", "bar"];
/// Between thousands, besides the decimal sign that is not in use: apostrophes, blanks of three widths.
const GROUPS: [char; 6] = ['\'', '\u{2019}', ' ', '\u{A0}', '\u{202F}', '\u{2009}'];

/// What a cell holds; its decimals follow a comma if `comma`.
pub(super) fn cell(bytes: &[u8], comma: bool) -> Cell {
    let bytes = bytes.trim_ascii();
    if bytes.is_empty() {
        return Cell::Nothing;
    }
    // Nearly all numbers end here.
    if !comma
        && let Ok(text) = std::str::from_utf8(bytes)
        && let Ok(value) = text.parse::<f64>()
    {
        // A number that no float holds is none that is missing.
        let beyond = value.is_infinite() && bytes.iter().any(u8::is_ascii_digit);
        return if beyond { Cell::Over } else { of_value(value) };
    }
    let text = String::from_utf8_lossy(bytes);
    odd_cell(text.trim(), comma)
}

fn of_value(value: f64) -> Cell {
    if !value.is_finite() {
        return Cell::Nothing;
    }
    let size = value.abs();
    if OVER_NUMBERS.iter().any(|(from, to)| (*from..=*to).contains(&size)) {
        Cell::Over
    } else {
        Cell::Number(value, None)
    }
}

fn odd_cell(text: &str, comma: bool) -> Cell {
    if let Some(value) = numeric(text, comma) {
        return of_value(value);
    }
    let lower = text.to_ascii_lowercase();
    if lower.is_empty() || MISSING.contains(&lower.as_str()) || ["nan", "inf", "infinity"].contains(&unsigned(&lower)) {
        return Cell::Nothing;
    }
    let filled = text.len() > 2 && ['*', '#'].iter().any(|fill| text.chars().all(|c| c == *fill));
    if filled || OVER.contains(&unsigned(&lower)) {
        return Cell::Over;
    }
    with_unit(text, comma).map_or(Cell::Word, |(value, unit)| Cell::Number(value, unit))
}

fn unsigned(text: &str) -> &str {
    text.trim_start_matches(['+', '-'])
}

/// `12.5 deg`, `0,3°`: the number before a unit.
fn with_unit(text: &str, comma: bool) -> Option<(f64, Option<Unit>)> {
    let end = text.rfind(|c: char| c.is_ascii_digit())? + 1;
    let word = text[end..].trim_start_matches(['.', ',']).trim();
    let value = numeric(text[..end].trim(), comma)?;
    let unit = Unit::in_brackets(word);
    (unit.is_some() || OTHER_UNITS.contains(&word)).then_some((value, unit))
}

/// A number written in a way that Rust does not read.
fn numeric(text: &str, comma: bool) -> Option<f64> {
    if let Some(hex) = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        return u64::from_str_radix(hex, 16).ok().map(|value| value as f64);
    }
    let (sign, text) = match text.chars().next()? {
        '-' | '\u{2212}' => ("-", &text[text.chars().next()?.len_utf8()..]),
        '+' => ("", &text[1..]),
        _ => ("", text),
    };
    let (mantissa, exponent) = match text.find(['e', 'E', 'd', 'D']) {
        Some(at) => (&text[..at], &text[at + 1..]),
        None => (text, "0"),
    };
    let decimal = if comma { ',' } else { '.' };
    let (whole, fraction) = mantissa.split_once(decimal).unwrap_or((mantissa, ""));
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let whole = ungrouped(whole, if comma { '.' } else { ',' })?;
    if !digits(fraction)
        || (whole.is_empty() && fraction.is_empty())
        || !digits(unsigned(exponent))
        || exponent.is_empty()
    {
        return None;
    }
    format!("{sign}{whole}.{fraction}e{exponent}").parse().ok()
}

/// The digits of a whole number without what stands between its thousands.
fn ungrouped(text: &str, group: char) -> Option<String> {
    if text.bytes().all(|byte| byte.is_ascii_digit()) {
        return Some(text.to_owned());
    }
    let sign = text.chars().find(|c| !c.is_ascii_digit())?;
    if sign != group && !GROUPS.contains(&sign) {
        return None;
    }
    let mut parts = text.split(sign);
    let first = parts.next()?;
    let sound = |part: &str, length: std::ops::RangeInclusive<usize>| {
        length.contains(&part.len()) && part.bytes().all(|byte| byte.is_ascii_digit())
    };
    if !sound(first, 1..=3) || first.starts_with('0') {
        return None;
    }
    let mut all = first.to_owned();
    for part in parts {
        if !sound(part, 3..=3) {
            return None;
        }
        all.push_str(part);
    }
    Some(all)
}

/// What a cell says of how decimals are written: `Some(true)` behind a comma, `Some(false)` behind a point, `None`
/// nothing.
pub(super) fn decimals(text: &str) -> Option<bool> {
    let (point, comma) = (text.rfind('.'), text.rfind(','));
    let number = |comma: bool| matches!(odd_cell(text, comma), Cell::Number(..));
    match (point, comma) {
        (None, None) => None,
        (Some(_), None) => (number(false) && !number(true)).then_some(false),
        (None, Some(_)) => (number(true) && !number(false)).then_some(true),
        (Some(point), Some(comma)) => {
            let behind_comma = comma > point;
            number(behind_comma).then_some(behind_comma)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_every_locale_are_read() {
        for (text, comma, value) in [
            ("1.5", false, 1.5),
            ("1,5", true, 1.5),
            ("-1,5e-3", true, -1.5e-3),
            ("7", true, 7.0),
            ("1,008.5", false, 1008.5),
            ("1.008,5", true, 1008.5),
            ("1.008.000", true, 1_008_000.0),
            ("1'008.5", false, 1008.5),
            ("1\u{2019}008,5", true, 1008.5),
            ("12 345,5", true, 12_345.5),
            ("12\u{202F}345\u{202F}678", true, 12_345_678.0),
            ("1,008", false, 1008.0),
            ("\u{2212}0.25", false, -0.25),
            ("1.0D+02", false, 100.0),
            ("-3.5d-1", false, -0.35),
            (".5", false, 0.5),
            ("5.", false, 5.0),
            ("0x1F", false, 31.0),
        ] {
            assert_eq!(cell(text.as_bytes(), comma), Cell::Number(value, None), "{text}");
        }
    }

    #[test]
    fn what_is_no_number_says_what_it_is() {
        for text in ["", " ", "NaN", "-nan", "inf", "N/A", "-", "null", "1.#QNAN"] {
            assert_eq!(cell(text.as_bytes(), false), Cell::Nothing, "{text}");
        }
        for text in [
            "OVER",
            "-Over",
            "+OL",
            "1e400",
            "-1e999",
            "9.9E37",
            "+9.9E+37",
            "-9.9e37",
            "9.91E37",
            "3.4028235e38",
            "*****",
            "#NUM!",
        ] {
            assert_eq!(cell(text.as_bytes(), false), Cell::Over, "{text}");
        }
        for text in
            ["high", "1,5", "1,00", "01,234", "1,0005", "1.2.3", "1e", "e5", ".", "-", "12 34", "5 apples", "ERR"]
        {
            let found = cell(text.as_bytes(), false);
            assert!(found == Cell::Word || text == "-", "{text}: {found:?}");
        }
        assert_eq!(cell(b"1e300", false), Cell::Number(1e300, None));
    }

    #[test]
    fn units_inside_of_cells() {
        for (text, comma, value, unit) in [
            ("12.5 deg", false, 12.5, Some(Unit::Degree)),
            ("12.5°", false, 12.5, Some(Unit::Degree)),
            ("-0,017 N.m", true, -0.017, Some(Unit::NewtonMetre)),
            ("0.00 s", false, 0.0, Some(Unit::Second)),
            ("1,200 rpm", false, 1200.0, None),
            ("5e-3 rad", false, 5e-3, Some(Unit::Radian)),
        ] {
            assert_eq!(cell(text.as_bytes(), comma), Cell::Number(value, unit), "{text}");
        }
    }

    #[test]
    fn decimals_are_told_by_what_has_one_meaning() {
        for (text, says) in [
            ("1,5", Some(true)),
            ("0,123", Some(true)),
            ("1,008", None),
            ("1.008", None),
            ("0.25", Some(false)),
            ("1,008.5", Some(false)),
            ("1.008,5", Some(true)),
            ("12", None),
            ("a,b", None),
            ("12,5 deg", Some(true)),
        ] {
            assert_eq!(decimals(text), says, "{text}");
        }
    }
}
