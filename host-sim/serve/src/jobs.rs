//! Jobs: commands that wait, run one at a time, and are over.
//!
//! A job is a process of this very program with the words that its page shows, in the folder of the bench. So what it
//! writes is what the command writes, it ends when it is asked to, and nothing in a file that it reads can take the
//! server with it.
//!
//! There are two lines: short work, for which somebody waits with the page open, two processes at a time where there
//! are two cores, and long work, one at a time; unless another number is asked for. A job has a folder of its own,
//! `bench/NAME-N`, with its results and `job.json`, the record: a server that starts finds what is finished, and marks
//! as interrupted what was under way.

mod process;
mod record;

use std::collections::{BTreeMap, VecDeque};
use std::fs;
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::Serialize;
use thiserror::Error;
use tokio::sync::watch;

use crate::folder::{Folder, JOBS};
use crate::work::{WorkAsked, WorkError, shown};
use process::{ProcessEnd, Running};
pub use record::{JobProgress, JobRecord, JobStatus};

/// Jobs that wait, at most: a guess; a person does not queue more.
pub(crate) const MOST_WAITING: usize = 32;
/// Records that are kept in view: a guess.
const MOST_KEPT: usize = 500;
/// Short jobs over that keep their folders (a guess); of older ones, which were looks and single pitches, they are
/// cleared away.
const SHORT_KEPT: usize = 100;
/// Short jobs at a time, where there are as many cores: the first answer and the better one, of which each keeps one
/// core busy (measured of a pitch of HHD-95, coarse and standard: 0.5 s and 1.5 s, as much of processor).
const SHORT_AT_A_TIME: usize = 2;
/// How often a running process is looked at.
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// Why a job is not taken.
#[derive(Debug, Error)]
pub enum JobError {
    /// The request makes no command.
    #[error(transparent)]
    Work(#[from] WorkError),
    /// Too many wait.
    #[error("{most} jobs wait already: cancel one, or wait for them", most = MOST_WAITING)]
    Full,
    /// The folder cannot be written to.
    #[error("{0}")]
    Folder(String),
}

/// The two lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum JobLine {
    Short,
    Long,
}

#[derive(Default)]
struct Inside {
    jobs: BTreeMap<u64, JobRecord>,
    next: u64,
    /// By line.
    waiting: [VecDeque<u64>; 2],
    running: BTreeMap<u64, Running>,
    over: bool,
}

/// All jobs of a folder.
pub struct Jobs {
    folder: Arc<Folder>,
    program: PathBuf,
    inside: Mutex<Inside>,
    /// Something waits, or all is over.
    something: Condvar,
    /// Counts changes, for pages that wait for one.
    changes: watch::Sender<u64>,
}

/// List of all jobs for a page.
#[derive(Debug, Serialize)]
pub struct JobsSeen {
    /// Counts changes.
    pub revision: u64,
    /// The jobs, the newest first.
    pub jobs: Vec<JobRecord>,
}

/// Now, seconds since 1970.
fn now_s() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs())
}

impl Jobs {
    /// The jobs of a folder, those of earlier servers among them; `program` runs them, `at_a_time` of each line if that
    /// is given.
    pub fn new(folder: Arc<Folder>, program: PathBuf, at_a_time: Option<usize>) -> Arc<Jobs> {
        let mut inside = Inside { next: 1, ..Inside::default() };
        for mut job in record::all(&folder) {
            if matches!(job.state, JobStatus::Waiting | JobStatus::Running) {
                process::end_orphan(job.pid, &job.arguments);
                (job.state, job.pid, job.progress) = (JobStatus::Interrupted, None, None);
                job.ended_s = Some(now_s());
                job.say("the server ended before this job did");
                // A folder that cannot be written to has a record that is behind; what is shown is right.
                let _ = record::write(&folder, &job);
            }
            inside.next = inside.next.max(job.id + 1);
            inside.jobs.insert(job.id, job);
        }
        let jobs = Arc::new(Jobs {
            folder,
            program,
            inside: Mutex::new(inside),
            something: Condvar::new(),
            changes: watch::Sender::new(1),
        });
        let cores = thread::available_parallelism().map_or(1, std::num::NonZero::get);
        for (line, usual) in [(JobLine::Short, SHORT_AT_A_TIME.min(cores)), (JobLine::Long, 1)] {
            for _ in 0..at_a_time.unwrap_or(usual).max(1) {
                let jobs = jobs.clone();
                thread::spawn(move || jobs.work(line));
            }
        }
        jobs
    }

    fn lock(&self) -> MutexGuard<'_, Inside> {
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn changed(&self) {
        self.changes.send_modify(|count| *count += 1);
    }

    /// Tells of changes.
    pub fn watch(&self) -> watch::Receiver<u64> {
        self.changes.subscribe()
    }

    /// The jobs.
    pub fn seen(&self) -> JobsSeen {
        let revision = *self.changes.borrow();
        JobsSeen { revision, jobs: self.lock().jobs.values().rev().cloned().collect() }
    }

    /// One job.
    pub fn job(&self, id: u64) -> Option<JobRecord> {
        self.lock().jobs.get(&id).cloned()
    }

    /// Puts work in its line.
    ///
    /// # Errors
    /// It makes no command, too much waits, or there is nowhere to write to.
    pub fn add(&self, work: WorkAsked) -> Result<JobRecord, JobError> {
        let mut inside = self.lock();
        let line = if work.is_short() { JobLine::Short } else { JobLine::Long };
        if inside.waiting.iter().map(VecDeque::len).sum::<usize>() >= MOST_WAITING {
            return Err(JobError::Full);
        }
        let id = inside.next;
        let out = format!("{JOBS}/{}-{id}", work.name());
        let words = work.words(&self.folder, &out)?;
        let job = JobRecord {
            id,
            work: work.name().to_owned(),
            asked: serde_json::to_value(&work).unwrap_or_default(),
            command: shown(&words, &out),
            arguments: words.arguments,
            printed_to: words.printed_to.map(str::to_owned),
            out,
            state: JobStatus::Waiting,
            short: line == JobLine::Short,
            begun_s: None,
            ended_s: None,
            wall_ms: None,
            exit_code: None,
            progress: None,
            said: Vec::new(),
            printed: String::new(),
            pid: None,
        };
        let place = self.folder.place(&job.out).map_err(|error| JobError::Folder(error.to_string()))?;
        fs::create_dir_all(&place).map_err(|error| JobError::Folder(format!("{}: {error}", job.out)))?;
        record::write(&self.folder, &job).map_err(|error| JobError::Folder(error.to_string()))?;
        inside.next += 1;
        inside.jobs.insert(id, job.clone());
        inside.waiting[line as usize].push_back(id);
        self.forget_the_oldest(&mut inside);
        drop(inside);
        self.something.notify_all();
        self.changed();
        Ok(job)
    }

    /// Folders of short work long over go; so does the view of what is older still.
    fn forget_the_oldest(&self, inside: &mut Inside) {
        let passing = |job: &JobRecord| job.is_over() && matches!(job.work.as_str(), "look" | "simulate" | "sweep");
        let old: Vec<u64> = inside.jobs.values().rev().filter(|job| passing(job)).map(|job| job.id).collect();
        for id in old.into_iter().skip(SHORT_KEPT) {
            let Some(job) = inside.jobs.remove(&id) else { continue };
            if let Ok(place) = self.folder.folder(&job.out) {
                // What another program holds open stays, and is found again.
                let _ = fs::remove_dir_all(place);
            }
        }
        let over: Vec<u64> = inside.jobs.values().filter(|job| job.is_over()).map(|job| job.id).collect();
        let too_many = inside.jobs.len().saturating_sub(MOST_KEPT);
        for id in over.into_iter().take(too_many) {
            inside.jobs.remove(&id);
        }
    }

    /// Ends a job, wherever it is; true if there was something to end.
    pub fn cancel(&self, id: u64) -> bool {
        let mut inside = self.lock();
        let inside = &mut *inside;
        let waits = inside.waiting.iter().any(|line| line.contains(&id));
        if waits {
            inside.waiting.iter_mut().for_each(|line| line.retain(|other| *other != id));
            if let Some(job) = inside.jobs.get_mut(&id) {
                (job.state, job.ended_s) = (JobStatus::Cancelled, Some(now_s()));
                let _ = record::write(&self.folder, job);
            }
        }
        let runs = inside.running.get_mut(&id).map(Running::cancel).is_some();
        self.changed();
        waits || runs
    }

    /// Ends everything that runs, for a server that ends; nothing begins any more. Records say so.
    pub fn end(&self) {
        let mut inside = self.lock();
        inside.over = true;
        let inside = &mut *inside;
        for (id, running) in &mut inside.running {
            running.kill();
            if let Some(job) = inside.jobs.get_mut(id) {
                (job.state, job.pid, job.ended_s) = (JobStatus::Interrupted, None, Some(now_s()));
                job.say("the server ended before this job did");
                let _ = record::write(&self.folder, job);
            }
        }
        self.something.notify_all();
    }

    /// A line at work, until all is over.
    fn work(&self, line: JobLine) {
        while let Some(id) = self.next_of(line) {
            self.run(id);
            self.changed();
        }
    }

    /// The next job of a line, when there is one; none when all is over.
    fn next_of(&self, line: JobLine) -> Option<u64> {
        let mut inside = self.lock();
        loop {
            if inside.over {
                return None;
            }
            if let Some(id) = inside.waiting[line as usize].pop_front() {
                return Some(id);
            }
            inside = self.something.wait(inside).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn run(&self, id: u64) {
        if !self.begin(id) {
            return;
        }
        self.changed();
        let mut progress = None;
        let ended = loop {
            thread::sleep(LOOK_EVERY);
            let mut inside = self.lock();
            let inside = &mut *inside;
            let (Some(running), Some(job)) = (inside.running.get_mut(&id), inside.jobs.get_mut(&id)) else { return };
            let now = running.progress();
            if now != progress {
                job.progress.clone_from(&now);
                progress = now;
                self.changed();
            }
            if let Some(ended) = running.ended() {
                inside.running.remove(&id);
                break ended;
            }
            if inside.over {
                return;
            }
        };
        self.finish(id, ended);
    }

    /// Starts the process of a job; false if it was cancelled meanwhile or does not start.
    fn begin(&self, id: u64) -> bool {
        let mut inside = self.lock();
        let inside = &mut *inside;
        let Some(job) = inside.jobs.get_mut(&id).filter(|job| job.state == JobStatus::Waiting) else { return false };
        if inside.over {
            return false;
        }
        job.begun_s = Some(now_s());
        match Running::start(&self.program, &job.arguments, self.folder.path()) {
            Ok(running) => {
                (job.state, job.pid) = (JobStatus::Running, Some(running.pid()));
                inside.running.insert(id, running);
            }
            Err(error) => {
                (job.state, job.ended_s) = (JobStatus::Failed, Some(now_s()));
                job.say(&format!("cannot start {}: {error}", self.program.display()));
            }
        }
        let _ = record::write(&self.folder, job);
        job.state == JobStatus::Running
    }

    fn finish(&self, id: u64, ended: ProcessEnd) {
        let mut inside = self.lock();
        let Some(job) = inside.jobs.get_mut(&id) else { return };
        (job.pid, job.progress, job.ended_s) = (None, None, Some(now_s()));
        job.wall_ms = Some(ended.wall_ms);
        job.exit_code = ended.code;
        job.state = match ended.code {
            _ if ended.cancelled => JobStatus::Cancelled,
            Some(0) => JobStatus::Done,
            _ => JobStatus::Failed,
        };
        for line in &ended.said {
            job.say(line);
        }
        match &job.printed_to {
            Some(file) if job.state == JobStatus::Done => {
                let path = self.folder.place(&format!("{}/{file}", job.out));
                let written = path.map_err(|error| error.to_string()).and_then(|path| {
                    flexspline_base::output::write_whole(&path, |to| to.write_all(&ended.printed))
                        .map_err(|error| error.to_string())
                });
                if let Err(error) = written {
                    job.state = JobStatus::Failed;
                    job.say(&error);
                }
            }
            Some(_) => {}
            None => job.printed = String::from_utf8_lossy(&ended.printed).into_owned(),
        }
        if ended.cancelled {
            process::clear_unfinished(self.folder.path(), &job.out);
        }
        if let Err(error) = record::write(&self.folder, job) {
            job.say(&error.to_string());
        }
    }
}

#[cfg(test)]
mod tests;
