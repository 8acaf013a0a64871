//! Progress on stderr: how far, how hard the solver works, how long it will take.
//!
//! A bar is drawn on a terminal, for work that takes more than a second. Into a file or a pipe goes a line every ten
//! seconds: work that says nothing for minutes looks like work that has died. A program that starts this one and wants
//! to show how far it is sets [`LINES`], and [`read`]s lines.

use std::io::{IsTerminal, Write, stderr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle, WeakProgressBar};

/// Work shorter than this shows no bar.
const PATIENCE: Duration = Duration::from_secs(1);
/// How often the time on a bar moves on.
const TICK: Duration = Duration::from_millis(250);
/// How often a line goes where no bar can be drawn. A guess: as long as one waits before one looks.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// With this variable of the environment set there is no bar, but lines for another program, [`read`] by it.
pub const LINES: &str = "FLEXSPLINE_PROGRESS_LINES";
/// How a line for another program begins.
const BEGINS: &str = "progress: ";
/// How often there is such a line, at most.
const PROGRAM_LINE_EVERY: Duration = Duration::from_millis(50);

/// Bars that are drawn.
static DRAWN: Mutex<Vec<WeakProgressBar>> = Mutex::new(Vec::new());
/// Whether no bar may be drawn any more.
static SILENT: AtomicBool = AtomicBool::new(false);

/// Takes every bar away, for a process that is about to end: nothing is drawn any more.
pub fn silence() {
    let drawn = DRAWN.lock().unwrap_or_else(PoisonError::into_inner);
    SILENT.store(true, Ordering::Relaxed);
    for bar in drawn.iter().filter_map(WeakProgressBar::upgrade) {
        bar.finish_and_clear();
    }
}

/// How far work has come.
#[derive(Default)]
struct Stand {
    done: usize,
    total: usize,
    note: String,
    least_left_s: Option<f64>,
}

/// Progress that may never show.
pub struct Progress {
    shown: Outlet,
    /// Ends the wait for the bar to show, or for the next line.
    _over: Option<mpsc::Sender<()>>,
}

/// Where progress is shown.
enum Outlet {
    Nothing,
    /// On a terminal.
    Bar(ProgressBar),
    /// A line every ten seconds, of what stands here.
    Lines(Arc<Mutex<Stand>>),
    /// Lines for another program: their title, and when the last one was written.
    Program(String, Mutex<Option<Instant>>),
}

impl Progress {
    /// Progress of work called `title`; `quiet` keeps it hidden.
    pub fn new(title: impl Into<String>, quiet: bool) -> Progress {
        let title = title.into();
        if quiet {
            return Progress { shown: Outlet::Nothing, _over: None };
        }
        if std::env::var_os(LINES).is_some() {
            return Progress { shown: Outlet::Program(title, Mutex::new(None)), _over: None };
        }
        let (over, wait) = mpsc::channel();
        if !stderr().is_terminal() {
            let stand = Arc::new(Mutex::new(Stand::default()));
            let (shared, begun) = (stand.clone(), Instant::now());
            thread::spawn(move || {
                while wait.recv_timeout(LINE_EVERY) == Err(mpsc::RecvTimeoutError::Timeout) {
                    if SILENT.load(Ordering::Relaxed) {
                        break;
                    }
                    let line = shared.lock().unwrap_or_else(PoisonError::into_inner).line(&title, begun.elapsed());
                    // A reader that has gone is no reason to fail.
                    let _ = writeln!(stderr(), "{line}");
                }
            });
            return Progress { shown: Outlet::Lines(stand), _over: Some(over) };
        }
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden()).with_prefix(title);
        let waiting = bar.clone();
        thread::spawn(move || {
            if wait.recv_timeout(PATIENCE) == Err(mpsc::RecvTimeoutError::Timeout) {
                show(&waiting);
            }
        });
        Progress { shown: Outlet::Bar(bar), _over: Some(over) }
    }

    /// `done` of `total` parts are done; `note` says what just happened.
    pub fn set(&self, done: usize, total: usize, note: &str) {
        match &self.shown {
            Outlet::Nothing => {}
            Outlet::Bar(bar) => {
                if !SILENT.load(Ordering::Relaxed) {
                    bar.set_length(total as u64);
                    bar.set_position(done as u64);
                    bar.set_message(note.to_owned());
                }
            }
            Outlet::Lines(stand) => {
                let mut stand = stand.lock().unwrap_or_else(PoisonError::into_inner);
                (stand.done, stand.total) = (done, total);
                note.clone_into(&mut stand.note);
            }
            Outlet::Program(title, last) => {
                let mut last = last.lock().unwrap_or_else(PoisonError::into_inner);
                if done == total || last.is_none_or(|last| last.elapsed() >= PROGRAM_LINE_EVERY) {
                    *last = Some(Instant::now());
                    // A reader that has gone is no reason to fail.
                    drop(writeln!(stderr(), "{}", written(title, done, total, note)));
                }
            }
        }
    }

    /// A line above the bar, or alone.
    pub fn line(&self, text: &str) {
        match &self.shown {
            Outlet::Bar(bar) if !bar.is_hidden() => bar.println(text),
            // A reader that has gone is no reason to fail.
            _ => drop(writeln!(stderr(), "{text}")),
        }
    }
}

/// A line for another program.
fn written(title: &str, done: usize, total: usize, note: &str) -> String {
    format!("{BEGINS}{done}/{total} {title}: {}", note.replace('\n', " "))
}

/// Reads a line for another program: parts done, of how many, and what was said.
pub fn read(line: &str) -> Option<(u64, u64, &str)> {
    let (count, note) = line.strip_prefix(BEGINS)?.split_once(' ')?;
    let (done, of) = count.split_once('/')?;
    Some((done.parse().ok()?, of.parse().ok()?, note))
}

impl Stand {
    /// As a line: how far, what just happened, how long so far and, where it is known, how long from here.
    fn line(&mut self, title: &str, elapsed: Duration) -> String {
        let Stand { done, total, note, least_left_s } = self;
        let far = if *total > 0 { format!(" {done}/{total}") } else { String::new() };
        let note = if note.is_empty() { String::new() } else { format!(", {note}") };
        let left = left_s(*done, *total, elapsed, least_left_s);
        let left = left.map_or_else(String::new, |left| format!(", about {left:.0} s left"));
        format!("{title}{far}{note}: {:.0} s so far{left}", elapsed.as_secs_f64())
    }
}

/// Draws a bar from now on.
fn show(bar: &ProgressBar) {
    let mut drawn = DRAWN.lock().unwrap_or_else(PoisonError::into_inner);
    if SILENT.load(Ordering::Relaxed) || bar.is_finished() {
        return;
    }
    let style = ProgressStyle::with_template("{prefix} {bar:30} {pos}/{len}  {msg}  {left}");
    let least = Arc::new(Mutex::new(None));
    let time_left = move |state: &ProgressState, to: &mut dyn std::fmt::Write| time_left(&least, state, to);
    bar.set_style(style.expect("the template is valid").with_key("left", time_left));
    bar.set_draw_target(ProgressDrawTarget::stderr());
    bar.enable_steady_tick(TICK);
    drawn.retain(|bar| bar.upgrade().is_some());
    drawn.push(bar.downgrade());
}

/// Parts of the work from which on what they took says what the rest will take; a few large ones are too unlike.
const TELLING: usize = 10;

/// Growth of the time that is left from which on it is no longer said. *Chosen*: a fifth, which nobody minds.
const MOST_GROWTH: f64 = 1.2;

/// How long the work will take from here, s, by the mean of all that is done: at the pace of late, parts that take
/// longer than most doubled it. Nothing where too little is known, and where a part takes so long that the `least` that
/// was said before no longer holds.
fn left_s(done: usize, total: usize, elapsed: Duration, least: &mut Option<f64>) -> Option<f64> {
    let each_s = (done > 0 && total >= TELLING).then(|| elapsed.as_secs_f64() / done as f64)?;
    let left_s = each_s * total.saturating_sub(done) as f64;
    let least_s = *least.insert(left_s.min(least.unwrap_or(left_s)));
    (left_s <= MOST_GROWTH * least_s).then_some(left_s)
}

/// How long the work will take, or has taken where that is not known.
fn time_left(least: &Mutex<Option<f64>>, state: &ProgressState, to: &mut dyn std::fmt::Write) {
    let [done, total] = [state.pos(), state.len().unwrap_or(0)].map(|parts| parts as usize);
    let _ = match left_s(done, total, state.elapsed(), &mut least.lock().unwrap_or_else(PoisonError::into_inner)) {
        Some(left) => write!(to, "about {left:.0} s left"),
        None => write!(to, "{:.0} s so far", state.elapsed().as_secs_f64()),
    };
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Outlet::Bar(bar) = &self.shown {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_for_another_program_is_read_as_it_was_written() {
        let line = written("cam", 3, 24, "turning,\n4 iterations");
        assert_eq!(read(&line), Some((3, 24, "cam: turning, 4 iterations")));
        for other in ["", "error: no", "progress: 3 of 4", "progress: a/b c", "progress: 1/2"] {
            assert_eq!(read(other), None, "{other}");
        }
    }

    #[test]
    fn a_line_says_how_far_how_long_and_what_is_left() {
        let line = |done, total, note: &str, s| {
            let mut stand = Stand { done, total, note: note.to_owned(), ..Stand::default() };
            stand.line("cam", Duration::from_secs(s))
        };
        assert_eq!(line(0, 0, "", 10), "cam: 10 s so far");
        assert_eq!(line(1, 4, "loading", 20), "cam 1/4, loading: 20 s so far");
        assert_eq!(line(10, 40, "turning", 20), "cam 10/40, turning: 20 s so far, about 60 s left");
    }

    /// Seconds, parts done and expected of `tables` with other work beside it, whose parts differ by generator,
    /// threefold; then of `simulate` while a load comes on that the drive does not bear.
    #[test]
    fn what_is_left_never_grows_by_more_than_a_fifth() {
        let seconds = [31.3, 32.4, 32.4, 42.5, 48.1, 68.2, 94.9, 95.1, 114.1, 134.2];
        let done = [446, 454, 455, 631, 722, 938, 1143, 1144, 1277, 1445];
        let total = [1904, 1904, 2008, 2008, 1884, 1884, 1884, 1540, 1516, 1516];
        let mut least = None;
        let mut left = |done, total, s| left_s(done, total, Duration::from_secs_f64(s), &mut least);
        assert!((0..seconds.len()).all(|k| left(done[k], total[k], seconds[k]).is_some()));
        least = None;
        let mut left = |done, total, s| left_s(done, total, Duration::from_secs_f64(s), &mut least);
        assert_eq!([10.0, 20.0, 30.0].map(|s| left(3, 36, s)), [Some(110.0), None, None]);
    }
}
