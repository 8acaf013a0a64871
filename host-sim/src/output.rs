//! Output files, written whole or not at all: a temporary file in the same folder, made durable, then renamed.
//!
//! A reader never sees a half-written file, and a run that fails or is stopped leaves the files of the run before it as
//! they were.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use tempfile::{NamedTempFile, TempDir};
use thiserror::Error;

/// A file or folder that could not be written.
#[derive(Debug, Error)]
#[error("cannot write {}: {source}", path.display())]
pub struct OutputError {
    /// Which.
    pub path: PathBuf,
    /// Why.
    pub source: io::Error,
}

fn failed(path: &Path) -> impl FnOnce(io::Error) -> OutputError + '_ {
    |source| OutputError { path: path.to_owned(), source }
}

/// Makes the folder and finds out, before any work is done, whether a file can be made in it.
pub fn prepare_folder(folder: &Path) -> Result<(), OutputError> {
    fs::create_dir_all(folder).map_err(failed(folder))?;
    NamedTempFile::new_in(folder).map(drop).map_err(failed(folder))
}

/// Writes a file through `content`; if that fails, the file keeps its old content or stays absent.
pub fn write_whole(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), OutputError> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let write = || -> io::Result<()> {
        let mut file = tempfile::Builder::new().prefix(".part-").tempfile_in(folder)?;
        let mut buffer = BufWriter::new(file.as_file_mut());
        content(&mut buffer)?;
        buffer.flush()?;
        drop(buffer);
        file.as_file().sync_all()?;
        readable_by_all(file.path())?;
        file.persist(path).map_err(|error| error.error)?;
        Ok(())
    };
    write().map_err(failed(path))
}

/// Temporary files are private; outputs are as readable as any other file.
#[cfg(unix)]
fn readable_by_all(path: &Path) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    fs::set_permissions(path, fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn readable_by_all(_path: &Path) -> io::Result<()> {
    Ok(())
}

/// Writes a value as indented JSON.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), OutputError> {
    write_whole(path, |file| {
        serde_json::to_writer_pretty(&mut *file, value)?;
        file.write_all(b"\n")
    })
}

/// Writes records as CSV; the header is the names of their fields.
pub fn write_csv<R: Serialize>(path: &Path, records: impl IntoIterator<Item = R>) -> Result<(), OutputError> {
    write_whole(path, |file| {
        let mut table = csv::Writer::from_writer(file);
        for record in records {
            table.serialize(record).map_err(io::Error::other)?;
        }
        table.flush()
    })
}

/// A folder that appears under its name with all its files at once.
#[derive(Debug)]
pub struct WholeFolder {
    target: PathBuf,
    parts: TempDir,
}

impl WholeFolder {
    /// A folder that will stand at `target`, beside which it is filled.
    pub fn new(target: &Path) -> Result<WholeFolder, OutputError> {
        let parent = target.parent().unwrap_or(Path::new("."));
        let parts = tempfile::Builder::new().prefix(".part-").tempdir_in(parent).map_err(failed(target))?;
        Ok(WholeFolder { target: target.to_owned(), parts })
    }

    /// Where its files are to be written until it is done.
    pub fn path(&self) -> &Path {
        self.parts.path()
    }

    /// Puts the folder in its place; one that stood there goes.
    pub fn finish(self) -> Result<(), OutputError> {
        let WholeFolder { target, parts } = self;
        let swap = || -> io::Result<()> {
            let mut old = None;
            if target.exists() {
                let parent = target.parent().unwrap_or(Path::new("."));
                let aside = tempfile::Builder::new().prefix(".old-").tempdir_in(parent)?;
                fs::rename(&target, aside.path().join("old"))?;
                old = Some(aside);
            }
            #[cfg(unix)]
            {
                use std::os::unix::fs::PermissionsExt;
                fs::set_permissions(parts.path(), fs::Permissions::from_mode(0o755))?;
            }
            fs::rename(parts.path(), &target)?;
            // Its folder is gone from where it was made: nothing is left to clear.
            let _ = parts.keep();
            drop(old);
            Ok(())
        };
        swap().map_err(failed(&target))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_write_that_fails_midway_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("results.csv");
        write_whole(&path, |file| file.write_all(b"old")).unwrap();
        let error = write_whole(&path, |file| {
            file.write_all(b"half of the new")?;
            Err(io::Error::other("disk full"))
        })
        .unwrap_err();
        assert!(error.to_string().contains("results.csv") && error.to_string().contains("disk full"));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["results.csv"]);
        write_whole(&path, |file| file.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn csv_has_the_field_names_as_header_and_floats_that_read_back_exactly() {
        #[derive(Serialize)]
        struct Record {
            step: usize,
            error_arcsec: f64,
            missing: Option<f64>,
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let value = 0.1 + 0.2;
        write_csv(&path, [Record { step: 3, error_arcsec: value, missing: None }]).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("step,error_arcsec,missing"));
        let cells: Vec<&str> = lines.next().unwrap().split(',').collect();
        assert_eq!((cells[0], cells[2]), ("3", ""));
        assert_eq!(cells[1].parse::<f64>().unwrap().to_bits(), value.to_bits());
    }

    #[test]
    fn a_folder_appears_whole_and_replaces_the_one_before() {
        let place = tempfile::tempdir().unwrap();
        let target = place.path().join("frames");
        for content in ["first", "second"] {
            let folder = WholeFolder::new(&target).unwrap();
            fs::write(folder.path().join(content), content).unwrap();
            assert!(!target.join(content).exists());
            folder.finish().unwrap();
            assert_eq!(names(&target), [content]);
        }
        drop(WholeFolder::new(&target).unwrap());
        assert_eq!(names(place.path()), ["frames"]);
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_named() {
        let place = tempfile::tempdir().unwrap();
        let file = place.path().join("file");
        fs::write(&file, "").unwrap();
        let error = prepare_folder(&file.join("out")).unwrap_err();
        assert!(error.to_string().contains("file"), "{error}");
    }
}
