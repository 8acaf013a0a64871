//! Bytes of a file to text: encodings, line ends, and files that are no text.

use encoding_rs::{Encoding, WINDOWS_1252};
use flexspline_base::csv_rows::{TableProblem, known_format};

/// Bytes that a file is judged by. *Guess*: a hundred lines or so.
const LOOKED_AT: usize = 4096;
/// Share of control characters above which a file is no text. *Guess*: text has none, compressed and binary numbers 12
/// % (32 of 256 values).
const BINARY: f64 = 0.02;
/// Share of zeros above which it is none. *Guess*: numbers in UTF-16 without a byte order mark have one half.
const ZEROS: f64 = 0.25;

/// The text of a file as UTF-8 with lines ended by LF, the last one too; what was converted is added to `notes`.
///
/// # Errors
/// The kind of the file, if it is no text.
pub(super) fn of(bytes: Vec<u8>, notes: &mut Vec<String>) -> Result<Vec<u8>, TableProblem> {
    let refused = |what: &str| Err(TableProblem { line: 1, what: what.to_owned() });
    if let Some(kind) = known_format(&bytes) {
        return refused(kind);
    }
    let mut text = match Encoding::for_bom(&bytes) {
        Some((encoding, mark)) if encoding != encoding_rs::UTF_8 => {
            notes.push(format!("the file is in {}: it is converted", encoding.name()));
            encoding.decode_without_bom_handling(&bytes[mark..]).0.into_owned().into_bytes()
        }
        Some((_, mark)) => bytes[mark..].to_vec(),
        None => bytes,
    };
    if std::str::from_utf8(&text).is_err() {
        // Windows-1252 holds Latin-1's letters and degree sign, and every byte means something in it.
        notes.push("the file is not in UTF-8: it is read as Windows-1252".to_owned());
        text = WINDOWS_1252.decode_without_bom_handling(&text).0.into_owned().into_bytes();
    }
    if is_binary(&text) {
        return refused("a binary file; allowed: CSV text");
    }
    if text.contains(&b'\r') {
        if text.contains(&b'\n') {
            text.retain(|byte| *byte != b'\r');
        } else {
            text.iter_mut().filter(|byte| **byte == b'\r').for_each(|byte| *byte = b'\n');
            notes.push("lines end with CR alone: each is taken for a line".to_owned());
        }
    }
    // Ctrl-Z ended text files once, and some instruments still write it.
    while text.last() == Some(&0x1A) {
        text.pop();
    }
    if text.last().is_some_and(|byte| *byte != b'\n') {
        text.push(b'\n');
    }
    Ok(text)
}

fn is_binary(bytes: &[u8]) -> bool {
    let some = &bytes[..bytes.len().min(LOOKED_AT)];
    let share = |of: fn(&u8) -> bool| some.iter().filter(|byte| of(byte)).count() as f64 / some.len().max(1) as f64;
    let control = |byte: &u8| (1..32).contains(byte) && !matches!(byte, b'\t' | b'\n' | b'\r' | 0x0B | 0x0C | 0x1A);
    share(control) > BINARY || share(|byte| *byte == 0) > ZEROS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encodings_become_utf_8() {
        let said = "t;Winkel [°]\n0,5;1\n1,5;2\n";
        let utf_16 = |little: bool| -> Vec<u8> {
            let units = [0xFEFF].into_iter().chain(said.encode_utf16());
            units.flat_map(|unit| if little { unit.to_le_bytes() } else { unit.to_be_bytes() }).collect()
        };
        let latin: Vec<u8> = said.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
        for bytes in [utf_16(true), utf_16(false), latin] {
            let mut notes = Vec::new();
            assert_eq!(String::from_utf8(of(bytes, &mut notes).unwrap()).unwrap(), said);
            assert_eq!(notes.len(), 1);
        }
        let mut notes = Vec::new();
        assert_eq!(of([b"\xEF\xBB\xBF", said.as_bytes()].concat(), &mut notes).unwrap(), said.as_bytes());
        assert_eq!(of(b"a,b\r1,2\r3,4\r".to_vec(), &mut notes).unwrap(), b"a,b\n1,2\n3,4\n");
        assert_eq!(of(b"1,2\n\x1A".to_vec(), &mut notes).unwrap(), b"1,2\n");
        assert_eq!(notes.len(), 1);
    }

    #[test]
    fn files_that_are_no_text_are_named() {
        let binary: Vec<u8> = (0..=255_u8).cycle().take(4000).collect();
        let unmarked: Vec<u8> = "1;2\n3;4\n".repeat(100).encode_utf16().flat_map(u16::to_be_bytes).collect();
        for (bytes, said) in [
            (&b"\x1F\x8B\x08"[..], "gzip"),
            (b"PK\x03\x04...", "workbook"),
            (binary.as_slice(), "binary"),
            (unmarked.as_slice(), "binary"),
        ] {
            assert!(of(bytes.to_vec(), &mut Vec::new()).unwrap_err().what.contains(said));
        }
    }
}
