//! Long work on a thread of its own, so that the thread that asked hears Ctrl-C and can show how far it is.
//!
//! Nothing that computes touches Python. The thread that asked sleeps without the GIL, wakes a few times in a second,
//! lets Python handle signals, and tells the progress. Once an exception comes of that, the work is asked to stop,
//! which it does where it next tells how far it is; what it would still have found is thrown away. Who asked does not
//! wait longer for it than a moment.

use std::any::Any;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;

use crate::failure::{PythonFailure, bad};

/// How often signals are looked for.
const TICK: Duration = Duration::from_millis(50);
/// How long is waited for work that was asked to stop. An increment of the FEM takes less, most often.
const MOMENT: Duration = Duration::from_millis(400);

/// How far the work is, and whether it should go on.
#[derive(Clone, Default)]
pub struct RunWatch {
    stop: Arc<AtomicBool>,
    told: Arc<Mutex<Option<(usize, usize, String)>>>,
}

/// Payload that unwinds from work that can stop in no other way.
struct Stopped;

impl RunWatch {
    /// `done` of `total` parts are done; breaks if the work is to stop.
    pub fn tell(&self, done: usize, total: usize, note: String) -> ControlFlow<()> {
        *self.told.lock().unwrap_or_else(PoisonError::into_inner) = Some((done, total, note));
        if self.stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// The same for work that does not ask whether it should stop: it is unwound from here.
    pub(crate) fn tell_or_unwind(&self, done: usize, total: usize, note: String) {
        if self.tell(done, total, note).is_break() {
            resume_unwind(Box::new(Stopped));
        }
    }

    fn news(&self) -> Option<(usize, usize, String)> {
        self.told.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// Runs `work` on `threads` threads (by default one for each core). `progress(done, total, note)` is called from the
/// thread that asked.
pub fn run<R: Send + 'static>(
    py: Python<'_>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&RunWatch) -> Result<R, PythonFailure> + Send + 'static,
) -> PyResult<R> {
    if threads.is_some_and(|threads| !(1..=1024).contains(&threads)) {
        return Err(bad(format!("threads: found {}, allowed: 1 to 1024", threads.unwrap_or_default())));
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build()
        .map_err(|error| PythonFailure::NotConverged(format!("cannot start threads: {error}")))?;
    let watch = RunWatch::default();
    let (send, receive) = channel::<Result<Result<R, PythonFailure>, Box<dyn Any + Send>>>();
    let works = watch.clone();
    thread::spawn(move || {
        let done = catch_unwind(AssertUnwindSafe(|| pool.install(|| work(&works))));
        // Nobody waits any more where it was stopped.
        let _ = send.send(done);
    });
    // A receiver alone may not be shared with the closure that runs without the GIL.
    let receive = Mutex::new(receive);
    let wait = |time: Duration| py.detach(|| receive.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(time));
    loop {
        match wait(TICK) {
            Ok(Ok(result)) => {
                tell(progress, &watch)?;
                return Ok(result?);
            }
            Ok(Err(panic)) => resume_unwind(panic),
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PythonFailure::NotConverged("the run ended without a result".to_owned()).into());
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
        if let Err(exception) = py.check_signals().and_then(|()| tell(progress, &watch)) {
            watch.stop.store(true, Ordering::Relaxed);
            let _ = wait(MOMENT);
            return Err(exception);
        }
    }
}

fn tell(progress: Option<&Bound<'_, PyAny>>, watch: &RunWatch) -> PyResult<()> {
    if let (Some(progress), Some(now)) = (progress, watch.news()) {
        progress.call1(now)?;
    }
    Ok(())
}
