//! Bytes of a file to text: encodings, line ends, and what a logger leaves in a file that is no text.

use flexspline_base::csv_rows::known_format;
use std::borrow::Cow;

use encoding_rs::{UTF_16BE, UTF_16LE, WINDOWS_1252};

/// Bytes that a file is judged by.
const LOOKED_AT: usize = 4096;
/// Share of control characters above which a file is no text. *Guess*: text has none, compressed and binary numbers 12
/// % (32 of 256 values).
const BINARY: f64 = 0.02;
/// Share of zeros at every second byte that makes UTF-16 of a file without a byte order mark: numbers in UTF-16 have
/// nothing else there.
const UTF_16: f64 = 0.9;

/// A file as text: UTF-8 but for stray bytes, lines ended by LF.
#[derive(Debug, Default)]
pub(super) struct Text {
    pub bytes: Vec<u8>,
    /// Lines that held zero bytes, from 1, and how many; the zeros are removed.
    pub zeros: Vec<(u64, usize)>,
    /// What was read otherwise than it stands, one sentence each.
    pub notes: Vec<String>,
}

/// The text of a file.
///
/// # Errors
/// What the file is, if it is no text.
pub(super) fn of(bytes: Vec<u8>) -> Result<Text, String> {
    if let Some(kind) = known_format(&bytes) {
        return Err(kind.to_owned());
    }
    let mut text = Text::default();
    let mut bytes = match utf_16(&bytes) {
        Some((encoding, name)) => {
            text.notes.push(format!("the file is in {name}: it is converted"));
            encoding.decode(&bytes).0.into_owned().into_bytes()
        }
        None => bytes,
    };
    if bytes.starts_with(b"\xEF\xBB\xBF") {
        bytes.drain(..3);
    }
    if std::str::from_utf8(&bytes).is_err() {
        // Windows-1252 holds Latin-1's letters and degree sign, and every byte means something in it.
        text.notes.push("the file is not in UTF-8: it is read as Windows-1252".to_owned());
        if let Cow::Owned(converted) = WINDOWS_1252.decode_without_bom_handling(&bytes).0 {
            bytes = converted.into_bytes();
        }
    }
    if bytes.contains(&0) {
        // CR ends lines here, so that line numbers are those of the text.
        lines_end_with_lf(&mut bytes, &mut text.notes);
        text.zeros = without_zeros(&mut bytes);
    }
    if is_binary(&bytes) {
        return Err("a binary file; allowed: CSV text".to_owned());
    }
    lines_end_with_lf(&mut bytes, &mut text.notes);
    // Ctrl-Z ended text files once, and some instruments still write it.
    while bytes.last() == Some(&0x1A) {
        bytes.pop();
    }
    text.bytes = bytes;
    Ok(text)
}

/// UTF-16 by its mark, or by a zero at every second byte.
fn utf_16(bytes: &[u8]) -> Option<(&'static encoding_rs::Encoding, &'static str)> {
    let zeros = |from: usize| {
        let some: Vec<&u8> = bytes.iter().take(LOOKED_AT).skip(from).step_by(2).collect();
        some.len() > 8 && some.iter().filter(|byte| ***byte == 0).count() as f64 > UTF_16 * some.len() as f64
    };
    let (even, odd) = (zeros(0), zeros(1));
    if bytes.starts_with(b"\xFF\xFE") || (odd && !even) {
        Some((UTF_16LE, "UTF-16 (little-endian)"))
    } else if bytes.starts_with(b"\xFE\xFF") || (even && !odd) {
        Some((UTF_16BE, "UTF-16 (big-endian)"))
    } else {
        None
    }
}

/// CR alone, as old instruments end lines, becomes LF; CR before LF is left, as it is trimmed with the blanks.
fn lines_end_with_lf(bytes: &mut [u8], notes: &mut Vec<String>) {
    if bytes.contains(&b'\r') && !bytes.contains(&b'\n') {
        bytes.iter_mut().filter(|byte| **byte == b'\r').for_each(|byte| *byte = b'\n');
        notes.push("lines end with CR alone: each is taken for a line".to_owned());
    }
}

/// Removes zero bytes; says in which lines they stood.
fn without_zeros(bytes: &mut Vec<u8>) -> Vec<(u64, usize)> {
    let mut lines: Vec<(u64, usize)> = Vec::new();
    let mut line = 1;
    bytes.retain(|byte| {
        line += u64::from(*byte == b'\n');
        if *byte == 0 {
            match lines.last_mut() {
                Some((last, count)) if *last == line => *count += 1,
                _ => lines.push((line, 1)),
            }
        }
        *byte != 0
    });
    lines
}

fn is_binary(bytes: &[u8]) -> bool {
    let some = &bytes[..bytes.len().min(LOOKED_AT)];
    let control = |byte: &&u8| **byte < 32 && !matches!(**byte, b'\t' | b'\n' | b'\r' | 0x0B | 0x0C | 0x1A);
    some.iter().filter(control).count() as f64 > BINARY * some.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encodings_become_utf_8() {
        let said = "t;Winkel [°]\n0,5;1\n1,5;2\n";
        let utf_16 = |mark: bool, little: bool| -> Vec<u8> {
            let units = mark.then_some(0xFEFF).into_iter().chain(said.encode_utf16());
            units.flat_map(|unit| if little { unit.to_le_bytes() } else { unit.to_be_bytes() }).collect()
        };
        let latin: Vec<u8> = said.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
        let files = [utf_16(true, true), utf_16(true, false), utf_16(false, true), utf_16(false, false), latin];
        for bytes in files {
            let text = of(bytes).unwrap();
            assert_eq!(String::from_utf8(text.bytes).unwrap().trim_start_matches('\u{feff}'), said);
            assert_eq!(text.notes.len(), 1);
        }
        let marked = of([b"\xEF\xBB\xBF", said.as_bytes()].concat()).unwrap();
        assert_eq!((marked.bytes, marked.notes), (said.as_bytes().to_vec(), Vec::new()));
    }

    #[test]
    fn line_ends_and_zeros() {
        let text = of(b"a,b\r1,2\r3,4\r".to_vec()).unwrap();
        assert_eq!((text.bytes.as_slice(), text.notes.len()), (&b"a,b\n1,2\n3,4\n"[..], 1));
        let text = of(b"a,b\n1,2\n\0\0\0\0 3,\x00004\n5,6\n".to_vec()).unwrap();
        assert_eq!((text.bytes.as_slice(), text.zeros), (&b"a,b\n1,2\n 3,004\n5,6\n"[..], vec![(3, 5)]));
        assert_eq!(of(b"1,2\n\x1A".to_vec()).unwrap().bytes, b"1,2\n");
    }

    #[test]
    fn files_that_are_no_text_are_named() {
        let binary: Vec<u8> = (0..=255_u8).cycle().take(4000).collect();
        for (bytes, said) in
            [(&b"\x1F\x8B\x08"[..], "gzip"), (b"PK\x03\x04...", "workbook"), (binary.as_slice(), "binary")]
        {
            assert!(of(bytes.to_vec()).unwrap_err().contains(said));
        }
    }
}
