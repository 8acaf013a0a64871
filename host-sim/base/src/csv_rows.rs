//! Rows of a CSV file that this project defines (samples, paths): read strictly, so that what does not fit is refused.
//! Other people's files are read by the reader of the crate `flexspline-identify`.
//!
//! Commas between fields, a point in numbers, fields quoted where needed, `#` lines comments, blank lines nothing,
//! lines ended by LF or CRLF, a byte order mark passed over. What a field must hold is for the caller to say.

use std::borrow::Cow;

/// A fault, with its line, from 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TableProblem {
    /// Line, from 1.
    pub line: u64,
    /// Value found and values allowed.
    pub what: String,
}

/// The text of a file; bytes that are not UTF-8 are shown as U+FFFD.
///
/// # Errors
/// It is none of such rows.
pub fn text(file: &[u8]) -> Result<Cow<'_, str>, TableProblem> {
    let by_cr =
        || (file.contains(&b'\r') && !file.contains(&b'\n')).then_some("lines end with CR alone; allowed: LF or CRLF");
    match not_csv(file).or_else(by_cr) {
        Some(what) => Err(TableProblem { line: 1, what: what.to_owned() }),
        None => Ok(String::from_utf8_lossy(file)),
    }
}

/// Rows with their lines, from 1, and their fields, without quotes and the space around them; the first is the header.
pub fn rows(text: &str) -> impl Iterator<Item = (u64, Vec<&str>)> {
    let says = |line: &&str| !line.trim().is_empty() && !line.trim_start().starts_with('#');
    let lines = (1..).zip(text.trim_start_matches('\u{feff}').lines()).filter(move |(_, line)| says(line));
    lines.map(|(number, line)| {
        let mut is_quoted = false;
        let fields = line.split(|c: char| {
            is_quoted ^= c == '"';
            c == ',' && !is_quoted
        });
        (number, fields.map(|field| field.trim().trim_matches('"').trim()).collect())
    })
}

/// Name of the known binary format that begins with these bytes.
pub fn known_format(start: &[u8]) -> Option<&'static str> {
    let kinds: [(&[u8], &str); 7] = [
        (b"\x1F\x8B", "a gzip archive; unpack it first"),
        (b"PK\x03\x04", "a ZIP archive or a workbook (.xlsx); save it as CSV"),
        (b"\xD0\xCF\x11\xE0", "an Office file (.xls); save it as CSV"),
        (b"\x89HDF", "an HDF5 or MATLAB file; write it as CSV, as examples/to_csv.py does"),
        (b"MATLAB 5.0", "a MATLAB file; write it as CSV, as examples/to_csv.py does"),
        (b"PAR1", "a Parquet file; write it as CSV, as examples/to_csv.py does"),
        (b"TDSm", "a TDMS file; write it as CSV"),
    ];
    kinds.iter().find(|(magic, _)| start.starts_with(magic)).map(|(_, kind)| *kind)
}

/// Name of the format of a file that is no CSV text in UTF-8, by its first bytes.
fn not_csv(start: &[u8]) -> Option<&'static str> {
    let utf_16 = start.starts_with(b"\xFF\xFE") || start.starts_with(b"\xFE\xFF");
    let kind = known_format(start).or(utf_16.then_some("text in UTF-16; save it as UTF-8"));
    kind.or_else(|| start.iter().take(4096).any(|byte| *byte == 0).then_some("a binary file; allowed: CSV text"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_know_their_line_whatever_stands_between_them() {
        for end in ["\n", "\r\n"] {
            let file = ["\u{feff}# a \"bench", "", " a , b", "1,2", "# \"pause", "", "", "3,\" 4\"", "5,\"6, or 7\""]
                .join(end);
            for file in [file.clone(), file + end] {
                let text = text(file.as_bytes()).unwrap();
                let rows: Vec<_> = rows(&text).collect();
                let fields = [["a", "b"], ["1", "2"], ["3", "4"], ["5", "6, or 7"]].map(Vec::from);
                assert_eq!(rows, [3, 4, 8, 9].into_iter().zip(fields).collect::<Vec<_>>(), "{file:?}");
            }
        }
    }

    #[test]
    fn files_that_are_no_text_are_named() {
        for (bytes, said) in [
            (&b"\x1F\x8B\x08"[..], "gzip"),
            (b"PK\x03\x04...", "workbook"),
            (b"\xFF\xFEa\0", "UTF-16"),
            (b"a,b\n1,\0\0\0", "binary"),
            (b"a,b\r1,2\r3,4\r", "CR alone"),
        ] {
            let problem = text(bytes).unwrap_err();
            assert!(problem.what.contains(said), "{bytes:?}: {problem:?}");
        }
    }
}
