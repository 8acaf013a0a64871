//! Output files, written whole or not at all: a temporary file in the same folder, made durable, then renamed.
//!
//! A reader never sees a half-written file, and a run that fails or is stopped leaves the files of the run before it as
//! they were. The files of one run appear together ([`Outputs`]).
//!
//! Whatever is on disk and no output yet is known in one place, so that a process that is asked to end can clear up at
//! once, wherever its threads are ([`abandon`]).

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

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
    |source| {
        // The name of a hidden file helps nobody.
        let denied = source.kind() == io::ErrorKind::PermissionDenied;
        OutputError { path: path.to_owned(), source: if denied { source.kind().into() } else { source } }
    }
}

/// Files that this process reads, as they are called: no output takes their place.
static READ: Mutex<Vec<(PathBuf, PathBuf)>> = Mutex::new(Vec::new());

/// Keeps a file that this process reads: from now on no output takes its place.
pub fn keep(path: &Path) {
    if let Ok(place) = fs::canonicalize(path) {
        READ.lock().unwrap_or_else(PoisonError::into_inner).push((place, path.to_owned()));
    }
}

/// Refuses an output in the place of a file that is kept, or a folder in the place of one that holds such a file.
pub fn replaces_none_kept(target: &Path) -> Result<(), OutputError> {
    let Ok(place) = fs::canonicalize(target) else { return Ok(()) };
    let read = READ.lock().unwrap_or_else(PoisonError::into_inner);
    let Some((_, path)) = read.iter().find(|(read, _)| read.starts_with(&place)) else { return Ok(()) };
    let what = format!("it would replace {}, which this run reads; allowed: another --out", path.display());
    Err(failed(target)(io::Error::new(io::ErrorKind::InvalidInput, what)))
}

/// Files on disk that are no output yet. Hidden files are made, and become outputs, while this is held.
struct UnfinishedFiles {
    /// Hidden files and folders.
    hidden: Vec<PathBuf>,
    /// Folders made for outputs, the outermost first.
    folders: Vec<PathBuf>,
    /// Whether an output stands in its place.
    written: bool,
}

static UNFINISHED: Mutex<UnfinishedFiles> =
    Mutex::new(UnfinishedFiles { hidden: Vec::new(), folders: Vec::new(), written: false });

fn unfinished() -> MutexGuard<'static, UnfinishedFiles> {
    // The list is whole at every instant, whoever panicked with it.
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

impl UnfinishedFiles {
    /// Removes the folders made for outputs that hold none.
    fn remove_empty_folders(&mut self) {
        while let Some(folder) = self.folders.pop() {
            // One that is not empty stays.
            let _ = fs::remove_dir(folder);
        }
    }
}

/// A hidden file or folder, known to be unfinished as long as this lives.
#[derive(Debug)]
struct HiddenPath(PathBuf);

impl HiddenPath {
    fn new(unfinished: &mut UnfinishedFiles, path: &Path) -> HiddenPath {
        unfinished.hidden.push(path.to_owned());
        HiddenPath(path.to_owned())
    }
}

impl Drop for HiddenPath {
    fn drop(&mut self) {
        unfinished().hidden.retain(|path| *path != self.0);
    }
}

/// Notes that a file to which rows are appended, each of them whole, stands in its place.
pub fn note_appended() {
    unfinished().written = true;
}

/// Removes all that is unfinished, and lets nothing be begun or finished any more: for a process that is about to end.
/// True if outputs of it stand in their place already.
pub fn abandon() -> bool {
    let mut unfinished = unfinished();
    for path in std::mem::take(&mut unfinished.hidden).iter().rev() {
        // What another thread has cleared away is gone too.
        let _ = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
    }
    unfinished.remove_empty_folders();
    let written = unfinished.written;
    // Held for good.
    std::mem::forget(unfinished);
    written
}

/// Removes the folders made by [`prepare_folder`] that nothing was written to, after a run that failed.
pub fn remove_empty_folders() {
    unfinished().remove_empty_folders();
}

/// Makes the folder and finds out, before any work is done, whether a file can be made in it.
pub fn prepare_folder(folder: &Path) -> Result<(), OutputError> {
    let mut unfinished = unfinished();
    let mut missing: Vec<PathBuf> =
        folder.ancestors().take_while(|f| !f.as_os_str().is_empty() && !f.exists()).map(Path::to_owned).collect();
    missing.reverse();
    unfinished.folders.append(&mut missing);
    if folder.is_file() {
        let what = "it is a file; allowed: a folder";
        return Err(failed(folder)(io::Error::new(io::ErrorKind::InvalidInput, what)));
    }
    fs::create_dir_all(folder).map_err(failed(folder))?;
    NamedTempFile::new_in(folder).map(drop).map_err(failed(folder))
}

/// The files of one run, which appear under their names together, or not at all.
#[derive(Debug, Default)]
pub struct Outputs {
    files: Vec<HiddenFile>,
    folders: Vec<WholeFolder>,
}

/// A file that is complete under a hidden name.
#[derive(Debug)]
struct HiddenFile {
    target: PathBuf,
    file: Option<NamedTempFile>,
    _hidden: HiddenPath,
}

impl HiddenFile {
    /// Writes it.
    fn new(target: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<HiddenFile> {
        let (mut file, hidden) = {
            let mut unfinished = unfinished();
            let file = tempfile::Builder::new().prefix(".part-").tempfile_in(parent_of(target))?;
            let hidden = HiddenPath::new(&mut unfinished, file.path());
            (file, hidden)
        };
        let mut buffer = BufWriter::new(file.as_file_mut());
        content(&mut buffer)?;
        buffer.flush()?;
        drop(buffer);
        file.as_file().sync_all()?;
        permit(file.path(), 0o644)?;
        Ok(HiddenFile { target: target.to_owned(), file: Some(file), _hidden: hidden })
    }
}

impl Outputs {
    /// No file yet.
    pub fn new() -> Outputs {
        Outputs::default()
    }

    /// A file with what `content` writes.
    pub fn file(
        &mut self,
        path: &Path,
        content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), OutputError> {
        replaces_none_kept(path)?;
        self.files.push(HiddenFile::new(path, content).map_err(failed(path))?);
        Ok(())
    }

    /// A value as indented JSON.
    pub fn json(&mut self, path: &Path, value: &impl Serialize) -> Result<(), OutputError> {
        self.file(path, |file| {
            serde_json::to_writer_pretty(&mut *file, value)?;
            file.write_all(b"\n")
        })
    }

    /// Records as CSV; the header is the names of their fields.
    pub fn csv<R: Serialize>(&mut self, path: &Path, records: impl IntoIterator<Item = R>) -> Result<(), OutputError> {
        self.file(path, |file| {
            let mut table = csv::Writer::from_writer(file);
            for record in records {
                table.serialize(record).map_err(io::Error::other)?;
            }
            table.flush()
        })
    }

    /// A folder that is filled.
    pub fn folder(&mut self, folder: WholeFolder) {
        self.folders.push(folder);
    }

    /// Puts everything in its place.
    pub fn finish(mut self) -> Result<(), OutputError> {
        let mut replaced = Vec::new();
        let mut unfinished = unfinished();
        let mut put = || -> Result<(), OutputError> {
            for folder in &mut self.folders {
                folder.put(&mut unfinished, &mut replaced)?;
            }
            for HiddenFile { target, file, .. } in &mut self.files {
                let file = file.take().expect("a part is put in its place once");
                file.persist(&*target).map_err(|error| failed(target)(error.error))?;
                // One in a folder that is itself hidden goes with it.
                unfinished.written |= !unfinished.hidden.iter().any(|folder| target.starts_with(folder));
            }
            Ok(())
        };
        let result = put();
        drop(unfinished);
        // Only now may what was replaced go, and what is in its place be forgotten.
        result
    }
}

/// Writes a file through `content`; if that fails, the file keeps its old content or stays absent.
pub fn write_whole(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), OutputError> {
    let mut outputs = Outputs::new();
    outputs.file(path, content)?;
    outputs.finish()
}

/// Temporary files are private; outputs are as readable as any other file.
#[cfg(unix)]
fn permit(path: &Path, mode: u32) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    fs::set_permissions(path, fs::Permissions::from_mode(mode))
}

#[cfg(not(unix))]
fn permit(_path: &Path, _mode: u32) -> io::Result<()> {
    Ok(())
}

/// A folder that appears under its name with all its files at once.
#[derive(Debug)]
pub struct WholeFolder {
    target: PathBuf,
    parts: Option<TempDir>,
    path: HiddenPath,
}

impl WholeFolder {
    /// A folder that will stand at `target`, next to which it is filled.
    pub fn new(target: &Path) -> Result<WholeFolder, OutputError> {
        replaces_none_kept(target)?;
        let mut unfinished = unfinished();
        let parts = tempfile::Builder::new().prefix(".part-").tempdir_in(parent_of(target)).map_err(failed(target))?;
        let path = HiddenPath::new(&mut unfinished, parts.path());
        Ok(WholeFolder { target: target.to_owned(), parts: Some(parts), path })
    }

    /// Where its files are to be written until it is done.
    pub fn path(&self) -> &Path {
        &self.path.0
    }

    /// Puts the folder in its place; the one that stood there is in `replaced`.
    fn put(
        &mut self,
        unfinished: &mut UnfinishedFiles,
        replaced: &mut Vec<(TempDir, HiddenPath)>,
    ) -> Result<(), OutputError> {
        let WholeFolder { target, parts, .. } = self;
        let parts = parts.take().expect("a folder is put in its place once");
        let swap = || -> io::Result<()> {
            let mut before = None;
            if target.exists() {
                let aside = tempfile::Builder::new().prefix(".old-").tempdir_in(parent_of(target))?;
                let hidden = HiddenPath::new(unfinished, aside.path());
                let old = aside.path().join("old");
                replaced.push((aside, hidden));
                fs::rename(&*target, &old)?;
                before = Some(old);
            }
            permit(parts.path(), 0o755)?;
            if let Err(error) = fs::rename(parts.path(), &*target) {
                // The one before comes back.
                let _ = before.map(|old| fs::rename(old, &*target));
                return Err(error);
            }
            // Its folder is gone from where it was made: nothing is left to clear.
            let _ = parts.keep();
            unfinished.written = true;
            Ok(())
        };
        swap().map_err(failed(&self.target))
    }
}

/// The folder that a file stands in.
fn parent_of(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A word as a shell takes it.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_=./,:+".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
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
    fn an_output_takes_the_place_of_no_file_that_is_read() {
        let place = tempfile::tempdir().unwrap();
        let (data, other) = (place.path().join("frames/data.csv"), place.path().join("frames/other.csv"));
        fs::create_dir(place.path().join("frames")).unwrap();
        fs::write(&data, "mine").unwrap();
        keep(&data);
        let again = place.path().join("frames/../frames/data.csv");
        let error = write_whole(&again, |file| file.write_all(b"new")).unwrap_err();
        assert_eq!(error.source.kind(), io::ErrorKind::InvalidInput);
        assert!(error.to_string().contains(&data.display().to_string()), "{error}");
        assert!(WholeFolder::new(&place.path().join("frames")).is_err());
        assert_eq!(fs::read(&data).unwrap(), b"mine");
        write_whole(&other, |file| file.write_all(b"new")).unwrap();
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
        let mut outputs = Outputs::new();
        outputs.csv(&path, [Record { step: 3, error_arcsec: value, missing: None }]).unwrap();
        outputs.finish().unwrap();
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
            let mut outputs = Outputs::new();
            outputs.folder(folder);
            outputs.finish().unwrap();
            assert_eq!(names(&target), [content]);
        }
        drop(WholeFolder::new(&target).unwrap());
        assert_eq!(names(place.path()), ["frames"]);
    }

    #[test]
    fn the_files_of_a_run_appear_together() {
        let place = tempfile::tempdir().unwrap();
        let mut outputs = Outputs::new();
        outputs.file(&place.path().join("a"), |file| file.write_all(b"a")).unwrap();
        outputs.json(&place.path().join("b"), &1).unwrap();
        let folder = WholeFolder::new(&place.path().join("c")).unwrap();
        fs::write(folder.path().join("in"), "c").unwrap();
        outputs.folder(folder);
        assert!(names(place.path()).iter().all(|name| name.starts_with(".part-")));
        outputs.finish().unwrap();
        assert_eq!(names(place.path()), ["a", "b", "c"]);
        let mut lost = Outputs::new();
        lost.file(&place.path().join("a"), |file| file.write_all(b"new")).unwrap();
        lost.folder(WholeFolder::new(&place.path().join("c")).unwrap());
        drop(lost);
        assert_eq!(names(place.path()), ["a", "b", "c"]);
        assert_eq!(fs::read(place.path().join("a")).unwrap(), b"a");
        assert!(place.path().join("c/in").exists());
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
