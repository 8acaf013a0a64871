//! A cell as a number: decimals behind a point or a comma, marks of what was not recorded or beyond a range.

/// Contents of a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum CellValue {
    /// A number.
    Number(f64),
    /// Nothing was recorded.
    Nothing,
    /// The instrument says that the value was beyond its range.
    Over,
    /// No number.
    Word,
}

/// Marks of a value that was not recorded, besides those of no number (`NaN`, `1.#QNAN`).
const MISSING: [&str; 12] = ["na", "n/a", "#n/a", "null", "<null>", "none", "nil", "\\n", "-", "--", "---", "?"];
/// Marks of a value beyond the range as voltmeters, loggers (Keyence, Keysight, NI) and spreadsheets write them,
/// besides words that begin with one of [`OVER_BEGINS`].
const OVER: [&str; 6] = ["ol", "o.l", "ol.", "burnout", "out of range", "#num!"];
const OVER_BEGINS: [&str; 3] = ["ov", "under", "1.#inf"];
/// SCPI-99, volume 1, 7.2.1.4: 9.9E37 is infinity, 9.91E37 no number; some instruments write 9.9E36. The largest single
/// float is another.
const OVER_NUMBERS: [(f64, f64); 2] = [(9.89e36, 1.0e38), (3.402e38, 3.404e38)];

/// Contents of a cell; its decimals follow a comma if `comma`.
pub(super) fn cell(bytes: &[u8], comma: bool) -> CellValue {
    let Ok(text) = std::str::from_utf8(bytes) else { return CellValue::Word };
    if text.is_empty() {
        return CellValue::Nothing;
    }
    let parsed = match comma && text.contains([',', '.']) {
        true if text.contains('.') => None,
        true => text.replace(',', ".").parse().ok(),
        false => text.parse::<f64>().ok(),
    };
    match parsed {
        Some(value) if OVER_NUMBERS.iter().any(|(from, to)| (*from..=*to).contains(&value.abs())) => CellValue::Over,
        Some(value) if value.is_finite() => CellValue::Number(value),
        // A number that no float holds is none that is missing.
        Some(value) if value.is_infinite() && bytes.iter().any(u8::is_ascii_digit) => CellValue::Over,
        Some(_) => CellValue::Nothing,
        None => mark(text),
    }
}

/// A text that is no number.
fn mark(text: &str) -> CellValue {
    let lower = text.to_ascii_lowercase();
    let unsigned = lower.trim_start_matches(['+', '-']);
    let filled = text.len() > 2 && ['*', '#'].iter().any(|fill| text.chars().all(|c| c == *fill));
    if filled || OVER.contains(&unsigned) || OVER_BEGINS.iter().any(|begin| unsigned.starts_with(begin)) {
        CellValue::Over
    } else if MISSING.contains(&lower.as_str()) || unsigned.starts_with("nan") || unsigned.starts_with("1.#") {
        CellValue::Nothing
    } else {
        CellValue::Word
    }
}

/// The sign of decimals that a cell shows: `Some(true)` behind a comma, `Some(false)` behind a point, `None`
/// nothing.
pub(super) fn decimals(text: &str) -> Option<bool> {
    let number = |comma: bool| matches!(cell(text.as_bytes(), comma), CellValue::Number(_));
    text.contains([',', '.']).then(|| (number(true), number(false))).and_then(|says| match says {
        (true, false) => Some(true),
        (false, true) => Some(false),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_they_are_written() {
        for (text, comma, value) in [
            ("1.5", false, 1.5),
            ("1,5", true, 1.5),
            ("-1,5e-3", true, -1.5e-3),
            ("7", true, 7.0),
            (".5", false, 0.5),
            ("5.", false, 5.0),
            ("1e300", false, 1e300),
        ] {
            assert_eq!(cell(text.as_bytes(), comma), CellValue::Number(value), "{text}");
        }
    }

    #[test]
    fn what_is_no_number_says_what_it_is() {
        for text in ["", "NaN", "-nan", "inf", "N/A", "-", "null", "1.#QNAN", "-nan(ind)"] {
            assert_eq!(cell(text.as_bytes(), false), CellValue::Nothing, "{text}");
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
            assert_eq!(cell(text.as_bytes(), false), CellValue::Over, "{text}");
        }
        for (text, comma) in [
            ("high", false),
            ("1,5", false),
            ("1,008.5", false),
            ("1.008,5", true),
            ("1.5", true),
            ("1e", false),
            (".", false),
            ("5 deg", false),
            ("1.0D+02", false),
            ("1'008", false),
        ] {
            assert_eq!(cell(text.as_bytes(), comma), CellValue::Word, "{text}");
        }
    }

    #[test]
    fn decimals_are_seen_by_what_has_one_meaning() {
        for (text, says) in [("1,5", Some(true)), ("0.25", Some(false)), ("1,008.5", None), ("12", None), ("a,b", None)]
        {
            assert_eq!(decimals(text), says, "{text}");
        }
    }
}
