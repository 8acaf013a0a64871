//! What every command works with: the drive, the output folder, how to talk, when to stop.

use std::ffi::OsString;
use std::io::Write;
use std::path::Path;
use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::Serialize;

use super::{Common, Failure, Outcome};
use crate::drive::Drive;
use crate::output::prepare_folder;
use crate::progress::Progress;

/// Set by Ctrl-C.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// The common options, at work.
pub(super) struct Context {
    common: Common,
    /// The command line as it was given.
    pub(super) command: String,
}

impl Context {
    pub(super) fn new(common: Common, args: &[OsString]) -> Context {
        let words = args.iter().skip(1).map(|arg| {
            let word = arg.to_string_lossy();
            let plain = |c: char| c.is_alphanumeric() || "-_=./,:+".contains(c);
            if !word.is_empty() && word.chars().all(plain) {
                word.into_owned()
            } else {
                format!("'{}'", word.replace('\'', r"'\''"))
            }
        });
        let command = ["flexspline".to_owned()].into_iter().chain(words).collect::<Vec<_>>().join(" ");
        Context { common, command }
    }

    /// Runs `work` on as many threads as were asked for.
    pub(super) fn with_threads<R: Send>(&self, work: impl FnOnce() -> Result<R, Failure> + Send) -> Result<R, Failure> {
        let threads = self.common.threads.map_or(0, usize::from);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|error| Failure::Failed(format!("cannot start {threads} threads: {error}")))?;
        pool.install(work)
    }

    /// The drive of `--drive` with every `--set`.
    pub(super) fn drive(&self) -> Result<Drive, Failure> {
        let name = &self.common.drive;
        let drive = match Drive::built_in(name) {
            Some(drive) => drive,
            None => {
                let text = std::fs::read_to_string(name).map_err(|error| {
                    let known = Drive::BUILT_IN.join(", ");
                    Failure::BadInput(format!(
                        "--drive: found {name:?}, which cannot be read as a file ({error}); allowed: a drive file, or one \
                         of the built-in drives {known}"
                    ))
                })?;
                Drive::from_toml(name, &text).map_err(|error| Failure::BadInput(error.to_string()))?
            }
        };
        drive
            .with_sets(self.common.sets.iter().map(String::as_str))
            .map_err(|error| Failure::BadInput(error.to_string()))
    }

    /// Name and text of the file of `--drive`; nothing for a built-in drive.
    pub(super) fn drive_file(&self) -> Option<(&str, String)> {
        let name = self.common.drive.as_str();
        if Drive::built_in(name).is_some() {
            return None;
        }
        std::fs::read_to_string(name).ok().map(|text| (name, text))
    }

    /// The output folder, which can be written to.
    pub(super) fn out(&self) -> Result<&Path, Failure> {
        let out = self.common.out.as_path();
        prepare_folder(out).map_err(|error| Failure::BadInput(format!("--out: {error}")))?;
        Ok(out)
    }

    /// A progress bar for work called `title`.
    pub(super) fn progress(&self, title: &str) -> Progress {
        Progress::new(title, self.common.quiet)
    }

    pub(super) fn verbose(&self) -> bool {
        self.common.verbose
    }

    /// Prints the result: as JSON if that was asked for, else as text unless quiet.
    pub(super) fn print(&self, result: &impl Serialize, text: impl FnOnce() -> String) -> Result<(), Failure> {
        if self.common.json {
            let json = serde_json::to_string_pretty(result)
                .map_err(|error| Failure::Failed(format!("cannot print the result: {error}")))?;
            put(&json);
        } else if !self.common.quiet {
            put(&text());
        }
        Ok(())
    }

    /// Whether the user has pressed Ctrl-C (or ended the process politely). From the first call on that no longer ends the process, so that the run can stop
    /// between two increments and clear up; pressing it again ends it at once and may leave a hidden temporary file.
    pub(super) fn watch_interrupt(&self) -> impl Fn() -> bool + use<> {
        static WATCH: Once = Once::new();
        WATCH.call_once(|| {
            // Without a handler the first Ctrl-C acts as the second would.
            let _ = ctrlc::set_handler(|| {
                if INTERRUPTED.swap(true, Ordering::Relaxed) {
                    std::process::exit(i32::from(Outcome::Failed as u8));
                }
            });
        });
        || INTERRUPTED.load(Ordering::Relaxed)
    }
}

/// Prints data on stdout. A reader that has gone is no reason to fail.
pub(super) fn put(text: &str) {
    let mut stdout = std::io::stdout().lock();
    let _ = writeln!(stdout, "{}", text.trim_end_matches('\n'));
}
