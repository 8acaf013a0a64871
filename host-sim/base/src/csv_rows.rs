//! Rows of a CSV file that this project defines (samples, paths): read strictly, so that what does not fit is refused.
//! Other people's files are read by the reader of the crate `flexspline-identify`.
//!
//! Commas between fields, a point in numbers, fields quoted where needed, `#` lines comments, blank lines nothing,
//! lines ended by LF or CRLF, a byte order mark passed over. What a field must hold is for the caller to say; here
//! stands where it was found.

use std::io::{BufRead, BufReader, Read};

use crate::suggest::{likeliest, question};

/// A fault, with its line, from 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TableProblem {
    /// Line, from 1.
    pub line: u64,
    /// Value found and values allowed.
    pub what: String,
}

/// Why a field is no number.
#[derive(Debug, Clone, PartialEq)]
pub enum NotANumber {
    /// The row ends before this field; it has this many fields.
    Absent(usize),
    /// This text.
    Text(String),
}

/// Rows of a CSV file, one at a time.
pub struct CsvRows<R: Read> {
    reader: csv::Reader<Ended<BufReader<R>>>,
    header: Vec<String>,
    header_line: u64,
    record: csv::ByteRecord,
}

/// One row.
#[derive(Debug, Clone, Copy)]
pub struct Row<'a> {
    record: &'a csv::ByteRecord,
    /// Line, from 1; the last one of a row that a quoted field spreads over several.
    pub line: u64,
}

/// A source whose last line is ended.
struct Ended<R> {
    source: R,
    /// The last byte handed on.
    last: u8,
}

impl<R: Read> Read for Ended<R> {
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        let n = self.source.read(to)?;
        if n > 0 {
            self.last = to[n - 1];
        } else if self.last != b'\n' && !to.is_empty() {
            (to[0], self.last) = (b'\n', b'\n');
            return Ok(1);
        }
        Ok(n)
    }
}

impl<R: Read> CsvRows<R> {
    /// Reads the header. An empty file has an empty header.
    pub fn new(source: R) -> Result<Self, TableProblem> {
        let mut source = BufReader::with_capacity(1 << 16, source);
        let unreadable = |line: u64, error: &dyn std::fmt::Display| TableProblem { line, what: error.to_string() };
        let start = source.fill_buf().map_err(|error| unreadable(1, &error))?;
        if let Some(what) = not_csv(start) {
            return Err(TableProblem { line: 1, what: what.to_owned() });
        }
        if start.starts_with(b"\xEF\xBB\xBF") {
            source.consume(3);
        }
        let reader = parser(source);
        let record = csv::ByteRecord::new();
        let mut rows = CsvRows { reader, header: Vec::new(), header_line: 1, record };
        let mut header = Vec::new();
        let mut header_line = 1;
        if let Some(row) = rows.next_row()? {
            header_line = row.line;
            for field in row.record {
                let name = std::str::from_utf8(field)
                    .map_err(|_| unreadable(header_line, &"not readable as UTF-8 text with commas"))?;
                header.push(name.trim().to_owned());
            }
        }
        if header.iter().any(|name| name.contains('\r')) {
            return Err(unreadable(header_line, &"lines end with CR alone; allowed: LF or CRLF"));
        }
        (rows.header, rows.header_line) = (header, header_line);
        Ok(rows)
    }

    /// Names of the columns.
    pub fn header(&self) -> &[String] {
        &self.header
    }

    /// Line of the header, from 1.
    #[cfg(test)]
    fn header_line(&self) -> u64 {
        self.header_line
    }

    /// Where the column `name` stands; an error if there are two.
    pub fn find(&self, name: &str) -> Result<Option<usize>, TableProblem> {
        let mut found = self.header.iter().enumerate().filter(|(_, column)| *column == name).map(|(i, _)| i);
        let first = found.next();
        match found.next() {
            Some(_) => Err(self.header_problem(format!("column {name} is there twice"))),
            None => Ok(first),
        }
    }

    /// Where the column `name` stands; an error if it is missing or there are two.
    pub fn need(&self, name: &str) -> Result<usize, TableProblem> {
        self.find(name)?.ok_or_else(|| {
            let hint = self.like(name).map_or_else(String::new, |like| format!("; {}", question(like)));
            self.header_problem(format!("column {name} is missing{hint}"))
        })
    }

    /// A column that is nearly called `name`.
    pub(crate) fn like(&self, name: &str) -> Option<&str> {
        likeliest(name, self.header.iter().map(String::as_str))
    }

    /// A problem of the header.
    pub(crate) fn header_problem(&self, what: String) -> TableProblem {
        TableProblem { line: self.header_line, what }
    }

    /// The next row that is not blank.
    pub fn next_row(&mut self) -> Result<Option<Row<'_>>, TableProblem> {
        loop {
            let line = |reader: &csv::Reader<_>| reader.position().line().saturating_sub(1).max(1);
            match self.reader.read_byte_record(&mut self.record) {
                Ok(false) => return Ok(None),
                Ok(true) => {
                    let blank = self.record.len() == 1 && self.record[0].trim_ascii().is_empty();
                    if !blank {
                        let line = line(&self.reader);
                        return Ok(Some(Row { record: &self.record, line }));
                    }
                }
                Err(error) => return Err(TableProblem { line: line(&self.reader), what: error.to_string() }),
            }
        }
    }
}

impl Row<'_> {
    /// Fields.
    pub fn fields(&self) -> usize {
        self.record.len()
    }

    /// The text of a field without the space around it; `None` if the row ends before it. Bytes that are not UTF-8 are
    /// shown as U+FFFD.
    pub fn text(&self, place: usize) -> Option<std::borrow::Cow<'_, str>> {
        self.record.get(place).map(|field| String::from_utf8_lossy(field.trim_ascii()))
    }

    /// A field as a number, which may be infinite or NaN if the text says so.
    pub fn number(&self, place: usize) -> Result<f64, NotANumber> {
        let field = self.record.get(place).ok_or(NotANumber::Absent(self.record.len()))?.trim_ascii();
        std::str::from_utf8(field)
            .ok()
            .and_then(|text| text.parse().ok())
            .ok_or_else(|| NotANumber::Text(String::from_utf8_lossy(field).into_owned()))
    }
}

/// Lines are ended here by LF, and CR is trimmed: the line of a row is then the lines counted so far.
fn parser<R: Read>(source: BufReader<R>) -> csv::Reader<Ended<BufReader<R>>> {
    csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .flexible(true)
        .has_headers(false)
        .terminator(csv::Terminator::Any(b'\n'))
        .from_reader(Ended { source, last: b'\n' })
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

    fn lines(text: &str) -> Vec<(u64, Vec<String>)> {
        let mut rows = CsvRows::new(text.as_bytes()).unwrap();
        let mut all = vec![(rows.header_line(), rows.header().to_vec())];
        while let Some(row) = rows.next_row().unwrap() {
            all.push((row.line, (0..row.fields()).map(|i| row.text(i).unwrap().into_owned()).collect()));
        }
        all
    }

    #[test]
    fn rows_know_their_line_whatever_stands_between_them() {
        for end in ["\n", "\r\n"] {
            let text = ["\u{feff}# a \"bench", "", " a , b", "1,2", "# \"pause", "", "", "3,\" 4\"", "5,6"].join(end);
            for text in [text.clone(), text + end] {
                let rows = lines(&text);
                let numbers: Vec<u64> = rows.iter().map(|(line, _)| *line).collect();
                assert_eq!(numbers, [3, 4, 8, 9], "{text:?}");
                assert_eq!(rows[0].1, ["a", "b"]);
                assert_eq!(rows[2].1, ["3", "4"]);
                assert_eq!(rows[3].1, ["5", "6"]);
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
            (b"a,\xFF\n1,2\n", "UTF-8"),
        ] {
            let problem = CsvRows::new(bytes).err().unwrap();
            assert!(problem.what.contains(said), "{bytes:?}: {problem:?}");
        }
    }

    #[test]
    fn a_field_is_a_number_or_its_text_is_said() {
        let mut rows = CsvRows::new(&b"a,b\n 1e-3 ,x\xFF\n"[..]).unwrap();
        let row = rows.next_row().unwrap().unwrap();
        assert_eq!(row.number(0), Ok(1e-3));
        assert_eq!(row.number(1), Err(NotANumber::Text("x\u{fffd}".to_owned())));
        assert_eq!(row.number(2), Err(NotANumber::Absent(2)));
    }

    #[test]
    fn a_missing_column_is_sought_under_a_name_like_it() {
        let rows = CsvRows::new(&b"generator_rad,torque_nm,x\n"[..]).unwrap();
        let what = |name: &str| rows.need(name).unwrap_err().what;
        assert_eq!(what("torque_n_m"), "column torque_n_m is missing; did you mean `torque_nm`?");
        assert_eq!(what("direction"), "column direction is missing");
        assert_eq!(rows.need("generator_rad"), Ok(0));
    }
}
