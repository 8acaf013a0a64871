//! The process of a job.

use std::fs;
use std::io::{BufRead as _, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::record::JobProgress;
use flexspline_base::progress;

/// How long a process has to clear up when it is asked to end.
const GRACE: Duration = Duration::from_millis(500);
/// Bytes of what a process prints that are kept: a guess; what `look` prints of fifty columns has 50 kB.
const MOST_PRINTED: u64 = 8 << 20;
/// Limit of the lines on stderr that are kept.
const MOST_LINES: usize = 40;
/// Limit of a line on stderr, bytes.
const LONGEST_LINE: u64 = 4000;
/// How long the threads that read a process that has ended have to come to its end.
const DRAIN: Duration = Duration::from_millis(500);

/// A line of a process on stderr.
#[derive(Debug, Default)]
struct Talk {
    progress: Option<JobProgress>,
    lines: Vec<String>,
}

/// How a process ended.
#[derive(Debug)]
pub struct ProcessEnd {
    /// Its exit code; none if a signal ended it.
    pub code: Option<i32>,
    /// Whether it was cancelled.
    pub cancelled: bool,
    /// Its messages.
    pub said: Vec<String>,
    /// Its output.
    pub printed: Vec<u8>,
    /// How long it ran, ms.
    pub wall_ms: u64,
}

/// A process that runs.
pub struct Running {
    child: Child,
    begun: Instant,
    told_to_end: Option<Instant>,
    talk: Arc<Mutex<Talk>>,
    printed: Arc<Mutex<Vec<u8>>>,
    readers: Vec<JoinHandle<()>>,
}

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Running {
    /// Starts `program` in a folder.
    pub fn start(program: &Path, arguments: &[String], folder: &Path) -> std::io::Result<Running> {
        let mut command = Command::new(program);
        command
            .args(arguments)
            .current_dir(folder)
            .env(progress::LINES, "1")
            .env("NO_COLOR", "1")
            .env_remove("CLICOLOR_FORCE")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        // A group of its own, which ends with all that it has started.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn()?;
        let talk = Arc::new(Mutex::new(Talk::default()));
        let printed = Arc::new(Mutex::new(Vec::new()));
        let mut readers = Vec::new();
        if let Some(stderr) = child.stderr.take() {
            let talk = talk.clone();
            readers.push(thread::spawn(move || listen(stderr, &talk)));
        }
        if let Some(stdout) = child.stdout.take() {
            let printed = printed.clone();
            readers.push(thread::spawn(move || keep(stdout, &printed)));
        }
        Ok(Running { child, begun: Instant::now(), told_to_end: None, talk, printed, readers })
    }

    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// How far it says that it is.
    pub fn progress(&self) -> Option<JobProgress> {
        lock(&self.talk).progress.clone()
    }

    /// Tells it to end: it clears up, and does not come back.
    pub fn cancel(&mut self) {
        if self.told_to_end.is_none() {
            self.told_to_end = Some(Instant::now());
            signal(&mut self.child, false);
        }
    }

    /// Ends it at once.
    pub fn kill(&mut self) {
        self.cancel();
        let until = Instant::now() + GRACE;
        while Instant::now() < until {
            if !matches!(self.child.try_wait(), Ok(None)) {
                return;
            }
            thread::sleep(Duration::from_millis(10));
        }
        signal(&mut self.child, true);
        let _ = self.child.wait();
    }

    /// How it ended, if it has; one that was asked to end and does not is ended.
    pub fn ended(&mut self) -> Option<ProcessEnd> {
        let status = match self.child.try_wait() {
            Ok(Some(status)) => status.code(),
            Ok(None) => {
                if self.told_to_end.is_some_and(|at| at.elapsed() > GRACE) {
                    signal(&mut self.child, true);
                }
                return None;
            }
            Err(_) => None,
        };
        // What it started may hold its pipes open: not for ever.
        let until = Instant::now() + DRAIN;
        while Instant::now() < until && !self.readers.iter().all(JoinHandle::is_finished) {
            thread::sleep(Duration::from_millis(2));
        }
        Some(ProcessEnd {
            code: status,
            cancelled: self.told_to_end.is_some(),
            said: std::mem::take(&mut lock(&self.talk).lines),
            printed: std::mem::take(&mut *lock(&self.printed)),
            wall_ms: u64::try_from(self.begun.elapsed().as_millis()).unwrap_or(u64::MAX),
        })
    }
}

/// Tells a process that was not waited for yet, and so still has its number, to end, with all that it has started.
#[cfg(unix)]
fn signal(child: &mut Child, at_once: bool) {
    use rustix::process::{Pid, Signal, kill_process_group};
    let signal = if at_once { Signal::KILL } else { Signal::TERM };
    let group = i32::try_from(child.id()).ok().and_then(Pid::from_raw);
    if group.is_none_or(|group| kill_process_group(group, signal).is_err()) {
        let _ = child.kill();
    }
}

#[cfg(not(unix))]
fn signal(child: &mut Child, _at_once: bool) {
    let _ = child.kill();
}

/// Keeps what a process prints, as far as anybody looks at it, and lets it print on.
fn keep(mut stdout: impl Read, printed: &Mutex<Vec<u8>>) {
    let mut bytes = Vec::new();
    let _ = stdout.by_ref().take(MOST_PRINTED).read_to_end(&mut bytes);
    *lock(printed) = bytes;
    let _ = std::io::copy(&mut stdout, &mut std::io::sink());
}

/// Reads what a process says, line by line.
fn listen(stderr: impl Read, talk: &Mutex<Talk>) {
    let mut reader = BufReader::new(stderr);
    loop {
        let mut line = Vec::new();
        match reader.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return,
            Ok(_) => {}
        }
        let line = String::from_utf8_lossy(&line);
        let line = line.trim_end();
        let mut talk = lock(talk);
        match progress::read(line) {
            Some((done, of, note)) => talk.progress = Some(JobProgress { done, of, note: note.to_owned() }),
            None if line.is_empty() => {}
            None => {
                if talk.lines.len() >= MOST_LINES {
                    talk.lines.remove(0);
                }
                talk.lines.push(line.to_owned());
            }
        }
    }
}

/// Removes what a process that had no time to clear up has left in the folder of its results.
pub(crate) fn clear_unfinished(folder: &Path, out: &str) {
    let out = folder.join(out);
    let Ok(entries) = fs::read_dir(out) else { return };
    for entry in entries.flatten() {
        if entry.file_name().to_string_lossy().starts_with(".part-") {
            let path = entry.path();
            let _ = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
        }
    }
}

/// Ends a process that an earlier server started and could not end: one with this number and these very words.
pub(crate) fn end_orphan(pid: Option<u32>, arguments: &[String]) {
    let Some(pid) = pid else { return };
    #[cfg(unix)]
    {
        use rustix::process::{Pid, Signal, kill_process_group};
        let line = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        let words: Vec<&[u8]> = line.strip_suffix(&[0]).unwrap_or(&line).split(|byte| *byte == 0).collect();
        let wanted: Vec<&[u8]> = arguments.iter().map(|argument| argument.as_bytes()).collect();
        let same = words.len() > wanted.len() && words.ends_with(&wanted);
        if let Some(group) = i32::try_from(pid).ok().and_then(Pid::from_raw).filter(|_| same) {
            let _ = kill_process_group(group, Signal::TERM);
        }
    }
    #[cfg(not(unix))]
    let _ = (pid, arguments);
}
