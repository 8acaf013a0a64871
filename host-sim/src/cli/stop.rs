//! Ctrl-C, and a polite request to end: the process clears up and ends at once, wherever it is.
//!
//! Results are hidden files until all of them are complete, and all of these are known ([`flexspline_base::output`]).
//! So nothing that computes has to look whether it should stop: the thread that hears of the signal removes them and
//! ends the process.

use std::sync::{Once, OnceLock};
use std::time::{Duration, Instant};

use super::{Outcome, say};
use flexspline_base::output::abandon;
use flexspline_base::progress;

/// From now on SIGINT, SIGTERM and SIGHUP end the process with exit code 1 and leave no unfinished file. A second one
/// does not wait for the clearing up. Who started it with SIGHUP ignored, as `nohup` does, means it to go on without a
/// terminal. On systems other than Unix no handler is installed.
pub(super) fn end_cleanly_on_signals() {
    static WATCH: Once = Once::new();
    // Where the signals cannot be heard they end the process as the second would.
    WATCH.call_once(|| drop(listen(stop)));
}

/// End of a command that runs until it is asked to stop: it is done, not stopped.
static ENDING: OnceLock<Box<dyn Fn() + Send + Sync>> = OnceLock::new();

/// From now on a signal is how this command ends: `ending` clears up after it, and the exit code is that of a command
/// that is done.
#[cfg(feature = "serve")]
pub(super) fn ends_by_signal(ending: impl Fn() + Send + Sync + 'static) {
    // A process runs one command.
    let _ = ENDING.set(Box::new(ending));
}

/// A second signal so soon is the first again: `timeout` and shells send one to a process and to its group.
const ECHO: Duration = Duration::from_millis(300);

fn stop() {
    static FIRST: OnceLock<Instant> = OnceLock::new();
    let end = || std::process::exit(i32::from(Outcome::Failed as u8));
    let now = Instant::now();
    let since_first = now - *FIRST.get_or_init(|| now);
    if since_first > ECHO {
        end();
    }
    if since_first > Duration::ZERO {
        return;
    }
    // On a thread of its own, so that the next signal is heard.
    std::thread::spawn(move || {
        progress::silence();
        if let Some(ending) = ENDING.get() {
            ending();
            abandon();
            std::process::exit(i32::from(Outcome::Done as u8));
        }
        let written = abandon();
        let left = if written { "what was written is whole" } else { "nothing was written" };
        say::error(&format!("stopped; {left}"));
        end();
    });
}

/// Calls `heard` for each signal.
#[cfg(unix)]
fn listen(heard: fn()) -> std::io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

    let hang_up = Some(SIGHUP).filter(|signal| !is_ignored(*signal));
    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM].into_iter().chain(hang_up))?;
    std::thread::Builder::new().name("signals".to_owned()).spawn(move || signals.forever().for_each(|_| heard()))?;
    Ok(())
}

/// Elsewhere the system ends the process: files have their names only once they are whole.
#[cfg(not(unix))]
fn listen(_heard: fn()) -> std::io::Result<()> {
    Ok(())
}

/// Whether the process was started with a signal ignored; where the system does not say so, it was not.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal - 1) & 1 == 1
}
