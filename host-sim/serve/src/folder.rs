//! The folder of the bench: the one place that is read and written.
//!
//! Names are plain words, so that none of them is an option, a device, a way out or a script; on the way to a file no
//! component is a link, and what is there at the end is a file.

use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::UNIX_EPOCH;

use serde::Serialize;
use thiserror::Error;

use flexspline_base::output::{OutputError, write_whole};

/// Where the results of jobs lie.
pub(crate) const JOBS: &str = "bench";
/// Characters of a name, at most: a guess, and far below what file systems take.
const LONGEST_NAME: usize = 100;
/// Limit of the folders that a name may lead through: `bench/NAME/extended` and one more.
const DEEPEST: usize = 5;
/// Bytes of a file that is sent or received, at most: a guess; logs of an hour at 1 kHz have 200 MB.
pub(crate) const LARGEST_FILE: u64 = 256 << 20;
/// Bytes received in one run, at most: a guess.
const MOST_BYTES: u64 = 4 << 30;
/// Files received in one run, at most: a guess.
const MOST_FILES: usize = 1000;
/// Entries of the folder and of each folder in it that are looked at: a guess.
const MOST_ENTRIES: usize = 2000;
/// Limit of the names that are tried for a file whose name is taken.
const MOST_TRIES: usize = 1000;

/// Why a file is not read or written.
#[derive(Debug, Error)]
pub enum FolderError {
    /// A name that is no plain word.
    #[error(
        "{0:?}: allowed: names of letters, digits, \".\", \"_\" and \"-\" that begin with a letter or a digit, at most \
         {longest} characters, folders between with \"/\"",
        longest = LONGEST_NAME
    )]
    Name(String),
    /// Nothing there.
    #[error("{0}: not there")]
    Absent(String),
    /// A link, a device, a folder.
    #[error("{0}: allowed: a file, not behind a link")]
    NoFile(String),
    /// More than is sent or received.
    #[error("{0}: {1} bytes; allowed: {largest}", largest = LARGEST_FILE)]
    Large(String, u64),
    /// More than one run receives.
    #[error(
        "this run has received {files} files or {} MB, which is all that it takes",
        MOST_BYTES >> 20,
        files = MOST_FILES
    )]
    Full,
    /// The system refuses.
    #[error("{0}: {1}")]
    Io(String, std::io::Error),
    /// The file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// The folder.
#[derive(Debug)]
pub struct Folder {
    /// Where it is, without links.
    path: PathBuf,
    /// Files and bytes received.
    received: Mutex<(usize, u64)>,
}

/// A file of the folder.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FolderEntry {
    /// Its name, from the folder on.
    pub name: String,
    /// Bytes.
    pub bytes: u64,
    /// When it was changed, seconds since 1970.
    pub changed_s: u64,
}

/// Whether this is one plain word.
pub(crate) fn is_plain(word: &str) -> bool {
    let allowed = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    let begins = word.chars().next().is_some_and(|c| c.is_ascii_alphanumeric());
    begins && word.len() <= LONGEST_NAME && word.chars().all(allowed) && !word.ends_with('.')
}

impl Folder {
    /// The folder at `path`, which exists.
    ///
    /// # Errors
    /// It does not, or is no folder.
    pub fn new(path: &Path) -> Result<Folder, FolderError> {
        let shown = path.display().to_string();
        let real = fs::canonicalize(path).map_err(|error| FolderError::Io(shown.clone(), error))?;
        if !real.is_dir() {
            return Err(FolderError::Absent(format!("{shown}, a folder")));
        }
        Ok(Folder { path: real, received: Mutex::new((0, 0)) })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The path of a name, there or not, no component of which is a link.
    ///
    /// # Errors
    /// The name is no plain one, or leads through a link or a file.
    pub fn place(&self, name: &str) -> Result<PathBuf, FolderError> {
        let words: Vec<&str> = name.split('/').collect();
        if words.len() > DEEPEST || !words.iter().all(|word| is_plain(word)) {
            return Err(FolderError::Name(name.chars().take(LONGEST_NAME).collect()));
        }
        let mut path = self.path.clone();
        for (at, word) in words.iter().enumerate() {
            path.push(word);
            let last = at + 1 == words.len();
            match fs::symlink_metadata(&path) {
                Ok(found) if found.is_dir() || last && found.is_file() => {}
                Ok(_) => return Err(FolderError::NoFile(name.to_owned())),
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
                Err(error) => return Err(FolderError::Io(name.to_owned(), error)),
            }
        }
        Ok(path)
    }

    /// The path of a file that is there.
    ///
    /// # Errors
    /// It is not, or no file, or behind a link.
    pub fn file(&self, name: &str) -> Result<PathBuf, FolderError> {
        let path = self.place(name)?;
        match fs::symlink_metadata(&path) {
            Ok(found) if found.is_file() => Ok(path),
            Ok(_) => Err(FolderError::NoFile(name.to_owned())),
            Err(_) => Err(FolderError::Absent(name.to_owned())),
        }
    }

    /// The path of a folder that is there.
    ///
    /// # Errors
    /// It is not, or no folder, or behind a link.
    pub fn folder(&self, name: &str) -> Result<PathBuf, FolderError> {
        let path = self.place(name)?;
        match fs::symlink_metadata(&path) {
            Ok(found) if found.is_dir() => Ok(path),
            _ => Err(FolderError::Absent(name.to_owned())),
        }
    }

    /// The bytes of a file, or its first `most`.
    ///
    /// # Errors
    /// There is no such file, or more of it than is sent.
    pub fn read(&self, name: &str, most: Option<u64>) -> Result<Vec<u8>, FolderError> {
        let failed = |error| FolderError::Io(name.to_owned(), error);
        let file = fs::File::open(self.file(name)?).map_err(failed)?;
        let length = file.metadata().map_err(failed)?.len();
        if most.is_none() && length > LARGEST_FILE {
            return Err(FolderError::Large(name.to_owned(), length));
        }
        let mut bytes = Vec::new();
        // A file that grows meanwhile is read no further.
        file.take(most.unwrap_or(length)).read_to_end(&mut bytes).map_err(failed)?;
        Ok(bytes)
    }

    /// Writes a file that was received, whole, over none that is there: if the name is taken by other bytes it gets
    /// another one. Returns its name.
    ///
    /// # Errors
    /// The name is no plain word, the run has received enough, or the folder cannot be written to.
    pub fn receive(&self, name: &str, bytes: &[u8]) -> Result<String, FolderError> {
        if !is_plain(name) || name == JOBS {
            return Err(FolderError::Name(name.chars().take(LONGEST_NAME).collect()));
        }
        if bytes.len() as u64 > LARGEST_FILE {
            return Err(FolderError::Large(name.to_owned(), bytes.len() as u64));
        }
        // Held while it is written, so that no two files take one name.
        let mut received = self.received.lock().unwrap_or_else(PoisonError::into_inner);
        if received.0 >= MOST_FILES || received.1 + bytes.len() as u64 > MOST_BYTES {
            return Err(FolderError::Full);
        }
        let (stem, ending) = name.rsplit_once('.').map_or((name, String::new()), |(a, b)| (a, format!(".{b}")));
        for k in 1..=MOST_TRIES {
            let tried = if k == 1 { name.to_owned() } else { format!("{stem}-{k}{ending}") };
            let path = self.path.join(&tried);
            match fs::symlink_metadata(&path) {
                Err(_) => {
                    write_whole(&path, |file| file.write_all(bytes))?;
                    *received = (received.0 + 1, received.1 + bytes.len() as u64);
                    return Ok(tried);
                }
                Ok(found) if found.is_file() && found.len() == bytes.len() as u64 => {
                    if self.read(&tried, None)? == bytes {
                        return Ok(tried);
                    }
                }
                Ok(_) => {}
            }
        }
        Err(FolderError::Full)
    }

    /// Contents of the folder: its files and those of the folders in it, by name. Hidden ones, links and names that are
    /// no plain words are left out.
    pub fn entries(&self) -> Vec<FolderEntry> {
        let mut found = Vec::new();
        self.collect("", 3, &mut found);
        found.sort_by(|a, b| a.name.cmp(&b.name));
        found
    }

    fn collect(&self, under: &str, deep: usize, found: &mut Vec<FolderEntry>) {
        let Ok(entries) = fs::read_dir(self.path.join(under)) else { return };
        for entry in entries.take(MOST_ENTRIES).flatten() {
            let Ok(word) = entry.file_name().into_string() else { continue };
            // Of the entry itself, not of what a link leads to.
            let Ok(about) = entry.metadata() else { continue };
            if !is_plain(&word) || found.len() >= MOST_ENTRIES {
                continue;
            }
            let name = if under.is_empty() { word } else { format!("{under}/{word}") };
            if about.is_dir() && deep > 1 {
                self.collect(&name, deep - 1, found);
            } else if about.is_file() {
                let changed = about.modified().ok().and_then(|at| at.duration_since(UNIX_EPOCH).ok());
                found.push(FolderEntry { name, bytes: about.len(), changed_s: changed.map_or(0, |at| at.as_secs()) });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_plain_words_are_names() {
        for good in ["bench.log", "a", "Run_7-b.csv", "9.fxt"] {
            assert!(is_plain(good), "{good}");
        }
        let long = "x".repeat(LONGEST_NAME + 1);
        for bad in
            ["", ".", "..", ".hidden", "-o", "--out=x", "a b", "a/b", "a\\b", "a\0", "ä", "a;b", "a.", "$x", "~", &long]
        {
            assert!(!is_plain(bad), "{bad}");
        }
    }

    #[test]
    fn what_is_received_replaces_nothing() {
        let inside = tempfile::tempdir().unwrap();
        let folder = Folder::new(inside.path()).unwrap();
        assert_eq!(folder.receive("a.csv", b"one").unwrap(), "a.csv");
        assert_eq!(folder.receive("a.csv", b"one").unwrap(), "a.csv");
        assert_eq!(folder.receive("a.csv", b"two").unwrap(), "a-2.csv");
        assert_eq!(folder.receive("a.csv", b"three").unwrap(), "a-3.csv");
        assert_eq!(folder.read("a.csv", None).unwrap(), b"one");
        for bad in ["../a", "-x", "", ".x", JOBS, "a/b"] {
            assert!(matches!(folder.receive(bad, b""), Err(FolderError::Name(_))), "{bad}");
        }
        let left: Vec<_> = fs::read_dir(inside.path()).unwrap().collect();
        assert_eq!(left.len(), 3);
    }

    #[test]
    fn a_run_takes_so_much_and_no_more() {
        let inside = tempfile::tempdir().unwrap();
        let folder = Folder::new(inside.path()).unwrap();
        *folder.received.lock().unwrap() = (0, MOST_BYTES - 1);
        assert_eq!(folder.receive("a", b"1").unwrap(), "a");
        assert!(matches!(folder.receive("b", b"1"), Err(FolderError::Full)));
        *folder.received.lock().unwrap() = (MOST_FILES, 0);
        assert!(matches!(folder.receive("c", b""), Err(FolderError::Full)));
    }

    /// In the folder of a process nobody makes files, root neither.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_where_nobody_may_write_is_an_error_that_names_the_file() {
        let written = Folder::new(Path::new("/proc/self")).unwrap().receive("a.csv", b"one");
        assert!(
            matches!(&written, Err(FolderError::Output(error)) if error.to_string().contains("a.csv")),
            "{written:?}"
        );
    }
}
