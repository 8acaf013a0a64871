//! Progress on stderr: how far, how hard the solver works, how long it will take.
//!
//! A bar is drawn only on a terminal, and only for work that takes more than a second.

use std::io::{IsTerminal, Write, stderr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Work shorter than this shows no bar.
const PATIENCE: Duration = Duration::from_secs(1);

/// Whether a bar is on the terminal, and whether there is to be one.
static SHOWN: AtomicBool = AtomicBool::new(false);
static SILENT: AtomicBool = AtomicBool::new(false);

/// Takes the bar away, for a process that is about to end: nothing is drawn any more.
pub fn silence() {
    SILENT.store(true, Ordering::Relaxed);
    if SHOWN.load(Ordering::Relaxed) {
        // To the beginning of the line, and clear it.
        let _ = write!(stderr(), "\r\x1b[2K");
    }
}

/// A progress bar that may never show.
pub struct Progress {
    wanted: bool,
    title: String,
    begun: Instant,
    bar: Option<ProgressBar>,
}

impl Progress {
    /// Progress of work called `title`; `quiet` keeps it hidden.
    pub fn new(title: impl Into<String>, quiet: bool) -> Progress {
        Progress { wanted: !quiet && stderr().is_terminal(), title: title.into(), begun: Instant::now(), bar: None }
    }

    /// `done` of `total` parts are done; `note` says what just happened.
    pub fn set(&mut self, done: usize, total: usize, note: &str) {
        if !self.wanted || SILENT.load(Ordering::Relaxed) {
            return;
        }
        let elapsed = self.begun.elapsed();
        if self.bar.is_none() && elapsed < PATIENCE {
            return;
        }
        let bar = self.bar.get_or_insert_with(|| {
            let style = ProgressStyle::with_template("{prefix} {bar:30} {pos}/{len}  {msg}  {eta} left")
                .expect("the template is valid");
            ProgressBar::with_draw_target(Some(total as u64), ProgressDrawTarget::stderr())
                .with_style(style)
                .with_prefix(self.title.clone())
                .with_elapsed(elapsed)
        });
        SHOWN.store(true, Ordering::Relaxed);
        bar.set_length(total as u64);
        bar.set_position(done as u64);
        bar.set_message(note.to_owned());
    }

    /// A line above the bar, or alone.
    pub fn line(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.println(text),
            // A reader that has gone is no reason to fail.
            None => drop(writeln!(stderr(), "{text}")),
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
            SHOWN.store(false, Ordering::Relaxed);
        }
    }
}
