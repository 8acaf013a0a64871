//! Ctrl-C, and a polite request to end: the process clears up and ends at once, wherever it is.
//!
//! Results are hidden files until all of them are complete, and all of these are known ([`crate::output`]). So nothing that computes
//! has to look whether it should stop: the thread that hears of the signal removes them and ends the process.

use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

use super::{Outcome, say};
use crate::output::abandon;
use crate::progress;

/// From now on SIGINT, SIGTERM and SIGHUP end the process with exit code 1 and leave no unfinished file. A second one does not wait for
/// the clearing up.
pub(super) fn end_cleanly_on_signals() {
    static WATCH: Once = Once::new();
    static STOPPED: AtomicBool = AtomicBool::new(false);
    let end = || std::process::exit(i32::from(Outcome::Failed as u8));
    WATCH.call_once(|| {
        // Without a handler a signal ends the process as the second would.
        let _ = ctrlc::set_handler(move || {
            if STOPPED.swap(true, Ordering::Relaxed) {
                end();
            }
            // On a thread of its own, so that the next signal is heard.
            std::thread::spawn(move || {
                progress::silence();
                let written = abandon();
                let left = if written { "what was written is whole" } else { "nothing was written" };
                say::error(&format!("stopped; {left}"));
                end();
            });
        });
    });
}
