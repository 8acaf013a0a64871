//! The files in the folder `resources` of an FMU: `model.txt`, `table.fxt`, and for a joint `drive.bin` and
//! `designed.bin`.
//!
//! `model.txt` has lines `name = value`: `model`, `guid`, and start values of variables that differ from the usual.
//! `table.fxt` is the table of the compensation. `drive.bin` is the drive that moves, `designed.bin` what is known of
//! it without a measurement (where it is missing: the same), as little-endian `f64` ([`Gear::numbers`]).

use std::path::{Path, PathBuf};

use flexspline::{Table, TableId};
use flexspline_motion::gear::Gear;

use crate::FmuError;
use crate::variables::{FmiRole, FmiType, ModelKind};

/// Name of the file with model and start values.
pub const MODEL_FILE: &str = "model.txt";
/// Name of the table's file.
pub const TABLE_FILE: &str = "table.fxt";
/// Name of the drive's file.
pub const DRIVE_FILE: &str = "drive.bin";
/// Name of the file of the drive as designed.
pub const DESIGNED_FILE: &str = "designed.bin";

/// The contents of that folder.
#[derive(Clone, Debug, PartialEq)]
pub struct Resources {
    /// Which model.
    pub kind: ModelKind,
    /// Which description it belongs to.
    pub guid: String,
    /// Start values of all variables; 0 for text.
    pub starts: Vec<f64>,
    /// The image of the table; it passes the core's checks.
    pub image: Vec<u8>,
    /// Its id.
    pub table_id: TableId,
    /// The drive that moves, and as designed; the joint has them.
    pub gears: Option<[Gear; 2]>,
}

/// A file of a drive.
pub fn drive_file(gear: &Gear) -> Vec<u8> {
    gear.numbers().into_iter().flat_map(f64::to_le_bytes).collect()
}

pub(crate) fn file_error(file: &str, what: &str) -> FmuError {
    FmuError::File { file: file.to_owned(), what: what.to_owned() }
}

fn gear_of(name: &str, bytes: &[u8]) -> Result<Gear, FmuError> {
    let (numbers, left) = bytes.as_chunks::<8>();
    let numbers: Vec<f64> = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
    let gear = Gear::of_numbers(&numbers).filter(|_| left.is_empty());
    gear.ok_or_else(|| file_error(name, "damaged"))
}

impl Resources {
    /// From the contents of the files; `drives` are those of the drive that moves, and as designed.
    ///
    /// # Errors
    /// File, line or field, value found and what is allowed.
    pub fn parse(model: &str, image: Vec<u8>, drives: [Option<&[u8]>; 2]) -> Result<Self, FmuError> {
        let refuse = |line: usize, what: String| Err(file_error(&format!("{MODEL_FILE}:{line}"), &what));
        let mut guid = None;
        let mut found = None;
        let mut starts = Vec::new();
        for (line, text) in (1..).zip(model.lines()) {
            let text = text.trim();
            if text.is_empty() || text.starts_with('#') {
                continue;
            }
            let Some((name, value)) = text.split_once('=').map(|(name, value)| (name.trim(), value.trim())) else {
                return refuse(line, format!("found \"{text}\", allowed: name = value"));
            };
            match (name, found) {
                ("model", None) => {
                    let Some(kind) = ModelKind::ALL.into_iter().find(|kind| kind.name() == value) else {
                        return refuse(line, format!("model: found \"{value}\", allowed: compensation, joint"));
                    };
                    starts = kind.variables().iter().map(|variable| variable.start).collect();
                    found = Some(kind);
                }
                ("guid", _) => guid = Some(value.to_owned()),
                (_, Some(kind)) => {
                    let Some(place) = kind.place(name) else {
                        return refuse(line, format!("{name}: the model {} has no such variable", kind.name()));
                    };
                    let variable = &kind.variables()[place];
                    match value.parse::<f64>() {
                        Ok(number) if number.is_finite() && variable.allows(number) => starts[place] = number,
                        _ => return refuse(line, format!("{name}: found \"{value}\", which is no value of it")),
                    }
                }
                (_, None) => return refuse(line, format!("found \"{name}\", allowed first: model")),
            }
        }
        let kind = found.ok_or_else(|| file_error(MODEL_FILE, "model is missing"))?;
        let guid = guid.ok_or_else(|| file_error(MODEL_FILE, "guid is missing"))?;
        let table = Table::check(&image)?;
        let table_id = table.id();
        let gears = match kind {
            ModelKind::Compensation => None,
            ModelKind::Joint => {
                let [built, designed] = drives;
                let built = gear_of(DRIVE_FILE, built.ok_or_else(|| file_error(DRIVE_FILE, "missing"))?)?;
                let designed = designed.map_or_else(|| Ok(built.clone()), |bytes| gear_of(DESIGNED_FILE, bytes))?;
                Some([built, designed])
            }
        };
        let ratio = gears.as_ref().map_or(table.drive().exact_ratio(), |[built, _]| built.ratio);
        if let Some(place) = kind.place("ratio") {
            starts[place] = ratio;
        }
        Ok(Self { kind, guid, starts, image, table_id, gears })
    }

    /// From the folder, for the description with this GUID.
    ///
    /// # Errors
    /// As [`Self::parse`], with the folder; or that the description belongs to another FMU.
    pub(crate) fn read(folder: &Path, guid: &str) -> Result<Self, FmuError> {
        let bytes = |name: &str| {
            let file = folder.join(name);
            std::fs::read(&file).map_err(|error| file_error(&file.display().to_string(), &error.to_string()))
        };
        let model = String::from_utf8(bytes(MODEL_FILE)?).map_err(|_| file_error(MODEL_FILE, "no UTF-8"))?;
        let drives = [DRIVE_FILE, DESIGNED_FILE].map(|name| bytes(name).ok());
        let read = Self::parse(&model, bytes(TABLE_FILE)?, drives.each_ref().map(Option::as_deref));
        let read = read.map_err(|error| file_error(&folder.display().to_string(), &error.to_string()))?;
        if read.guid != guid {
            return Err(FmuError::Guid { found: guid.to_owned(), allowed: read.guid });
        }
        Ok(read)
    }

    /// Start value of a variable of a name; not a number if there is none.
    pub fn start(&self, name: &str) -> f64 {
        self.kind.place(name).map_or(f64::NAN, |place| self.starts[place])
    }

    /// `model.txt`.
    pub fn model_file(&self) -> String {
        let mut text = format!("model = {}\nguid = {}\n", self.kind.name(), self.guid);
        for (variable, start) in self.kind.variables().iter().zip(&self.starts) {
            let said = !variable.is_output() && variable.kind != FmiType::Text;
            if said && (*start != variable.start || variable.role == FmiRole::Constant) {
                text += &format!("{} = {start}\n", variable.name);
            }
        }
        text
    }
}

/// The path that a `file:` URI names (section 2.1.5: the unzipped folder `resources`), percent-decoded, without the
/// slash before a drive letter of Windows; a path that is none is taken as it is, as some importers give it.
///
/// # Errors
/// Another scheme, another host, or bad escapes.
pub(crate) fn folder_of(uri: &str) -> Result<PathBuf, FmuError> {
    let refuse = |why| FmuError::Location { uri: uri.to_owned(), why };
    let letter = |text: &str| matches!(text.as_bytes(), [letter, b':', ..] if letter.is_ascii_alphabetic());
    let Some(rest) = uri.strip_prefix("file:").or_else(|| uri.strip_prefix("FILE:")) else {
        return match uri.split_once("://") {
            Some(_) => Err(refuse("")),
            None => Ok(PathBuf::from(uri)),
        };
    };
    let (host, path) = match rest.strip_prefix("//") {
        None => ("", rest),
        Some(rest) if letter(rest) => ("", rest),
        Some(rest) => rest.split_at(rest.find('/').unwrap_or(rest.len())),
    };
    let decoded = decoded(path).ok_or_else(|| refuse(" with a bad escape"))?;
    if !host.is_empty() && !host.eq_ignore_ascii_case("localhost") {
        // A share of Windows.
        return if cfg!(windows) {
            Ok(PathBuf::from(format!("//{host}{decoded}")))
        } else {
            Err(refuse(" on another host"))
        };
    }
    let bare = decoded.strip_prefix('/').filter(|bare| letter(bare)).unwrap_or(&decoded);
    Ok(PathBuf::from(bare))
}

fn decoded(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let [first, after @ ..] = rest {
        if *first == b'%' {
            let ([high, low], left) = after.split_first_chunk::<2>()?;
            let digit = |byte: u8| (byte as char).to_digit(16);
            bytes.push((digit(*high)? * 16 + digit(*low)?) as u8);
            rest = left;
        } else {
            bytes.push(*first);
            rest = after;
        }
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_found_behind_every_form_of_uri() {
        for (uri, path) in [
            ("file:///tmp/a/resources", "/tmp/a/resources"),
            ("file:/tmp/a/resources", "/tmp/a/resources"),
            ("file://localhost/tmp/a", "/tmp/a"),
            ("file:///tmp/my%20model/%C3%A4%25", "/tmp/my model/ä%"),
            ("file:///C:/Users/me/resources", "C:/Users/me/resources"),
            ("file:///c%3A/Users/me", "c:/Users/me"),
            ("file://C:/Users/me", "C:/Users/me"),
            ("/tmp/a", "/tmp/a"),
            (r"C:\tmp\a", r"C:\tmp\a"),
        ] {
            assert_eq!(folder_of(uri), Ok(PathBuf::from(path)), "{uri}");
        }
        for uri in ["http://x/y", "file:///tmp/%2", "file:///tmp/%zz", "file:///%ff", "file://host/tmp"] {
            assert!(folder_of(uri).is_err() || cfg!(windows), "{uri}");
        }
    }

    #[test]
    fn a_bad_model_file_says_where() {
        let said = |text: &str| Resources::parse(text, Vec::new(), [None; 2]).unwrap_err().to_string();
        assert_eq!(said("guid = 1\ntick_s = 1\nmodel = joint"), "model.txt:2: found \"tick_s\", allowed first: model");
        assert_eq!(said("model = joints"), "model.txt:1: model: found \"joints\", allowed: compensation, joint");
        let model = "model = compensation\n";
        assert_eq!(
            said(&format!("{model}# remark\nx = 1")),
            "model.txt:3: x: the model compensation has no such variable"
        );
        assert_eq!(said(&format!("{model}tick = fast")), "model.txt:2: tick: found \"fast\", which is no value of it");
        assert_eq!(said(model), "model.txt: guid is missing");
        assert!(said(&format!("{model}guid = 1")).starts_with("table.fxt: "));
    }
}
