//! Record of a job: a file in its folder, `job.json`.

use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::folder::{Folder, JOBS};
use flexspline_base::output::{OutputError, Outputs};

/// The record in a job's folder.
const FILE: &str = "job.json";
/// Limit of a record, bytes: more than what is kept of a process.
const LARGEST: u64 = 4 << 20;
/// Limit of the lines of what a job says that are kept.
const MOST_LINES: usize = 40;
/// Limit of such a line, characters.
const LONGEST_LINE: usize = 2000;
/// Limit of the folders of jobs that are looked at when a server starts.
const MOST_FOLDERS: usize = 10_000;

/// How far a job is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum JobStatus {
    /// In its line.
    Waiting,
    /// Its process runs.
    Running,
    /// Its results are there.
    Done,
    /// It ended without, or with results that miss a bound; what it said says why.
    Failed,
    /// Somebody ended it.
    Cancelled,
    /// The server ended before it did.
    Interrupted,
}

/// How far a process says that it is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct JobProgress {
    /// Parts done.
    pub done: u64,
    /// Steps in all.
    pub of: u64,
    /// Steps done.
    pub note: String,
}

/// A job.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JobRecord {
    /// Number, counting up in a folder.
    pub id: u64,
    /// The command.
    pub work: String,
    /// Request of the page.
    pub asked: Value,
    /// The command for a terminal in the folder, which makes the same files.
    pub command: String,
    /// Arguments of the program.
    pub arguments: Vec<String>,
    /// The file that takes what it prints.
    #[serde(default)]
    pub printed_to: Option<String>,
    /// Folder of its results.
    pub out: String,
    /// How far it is.
    pub state: JobStatus,
    /// Whether it stands in the line of short work.
    pub short: bool,
    /// When it began, seconds since 1970.
    pub begun_s: Option<u64>,
    /// When it ended.
    pub ended_s: Option<u64>,
    /// How long its process ran, ms.
    pub wall_ms: Option<u64>,
    /// Exit code of its process; none if it was ended.
    pub exit_code: Option<i32>,
    /// How far its process says that it is.
    pub progress: Option<JobProgress>,
    /// Its messages.
    pub said: Vec<String>,
    /// Its output, where that goes to no file.
    #[serde(default)]
    pub printed: String,
    /// Its process.
    #[serde(default)]
    pub pid: Option<u32>,
}

impl JobRecord {
    /// Adds a line to what it said.
    pub fn say(&mut self, line: &str) {
        if self.said.len() < MOST_LINES {
            self.said.push(line.chars().take(LONGEST_LINE).collect());
        }
    }

    /// Whether it neither waits nor runs.
    pub(crate) fn is_over(&self) -> bool {
        !matches!(self.state, JobStatus::Waiting | JobStatus::Running)
    }
}

/// Writes the record of a job, whole.
pub fn write(folder: &Folder, job: &JobRecord) -> Result<(), OutputError> {
    let mut outputs = Outputs::new();
    outputs.json(&folder.path().join(&job.out).join(FILE), job)?;
    outputs.finish()
}

/// The jobs that a folder has records of.
pub fn all(folder: &Folder) -> Vec<JobRecord> {
    let Ok(entries) = fs::read_dir(folder.path().join(JOBS)) else { return Vec::new() };
    entries.take(MOST_FOLDERS).flatten().filter_map(|entry| one(folder, &entry.path())).collect()
}

/// The record of a folder, if it is one of this folder: others cannot say where results are.
fn one(folder: &Folder, path: &Path) -> Option<JobRecord> {
    let name = format!("{JOBS}/{}", path.file_name()?.to_str()?);
    let record = folder.file(&format!("{name}/{FILE}")).ok()?;
    if fs::metadata(&record).ok()?.len() > LARGEST {
        return None;
    }
    let job: JobRecord = serde_json::from_slice(&fs::read(record).ok()?).ok()?;
    (job.out == name && name == format!("{JOBS}/{}-{}", job.work, job.id)).then_some(job)
}
