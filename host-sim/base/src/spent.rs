//! Time of work: by the clock, and of the processor.
//!
//! The two differ by what waits (a shared machine) one way and by what works side by side the other way. Who wants to
//! know how long the work will take elsewhere needs both.

use std::time::{Duration, Instant};

/// A clock that runs since it was made.
#[derive(Debug, Clone, Copy)]
pub struct Stopwatch {
    begun: Instant,
    processor: Option<Duration>,
}

/// Time spent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spent {
    /// By the clock, s.
    pub wall_s: f64,
    /// By all threads of this process on the processor, s; missing where the system is no Unix.
    pub processor_s: Option<f64>,
}

impl Stopwatch {
    /// From now on.
    pub fn start() -> Stopwatch {
        Stopwatch { begun: Instant::now(), processor: processor_time() }
    }

    /// So far.
    pub fn spent(&self) -> Spent {
        let processor = self.processor.and_then(|begun| processor_time()?.checked_sub(begun));
        Spent { wall_s: self.begun.elapsed().as_secs_f64(), processor_s: processor.as_ref().map(Duration::as_secs_f64) }
    }
}

/// Of all threads of this process so far.
#[cfg(unix)]
fn processor_time() -> Option<Duration> {
    use rustix::time::{ClockId, clock_gettime};

    clock_gettime(ClockId::ProcessCPUTime).try_into().ok()
}

#[cfg(not(unix))]
fn processor_time() -> Option<Duration> {
    None
}

impl Spent {
    /// As `115 s on the clock, 46 s of processor`.
    pub fn in_words(&self) -> String {
        let seconds = |s: f64| if s < 10.0 { format!("{s:.1} s") } else { format!("{s:.0} s") };
        let processor = self.processor_s.map_or_else(String::new, |s| format!(", {} of processor", seconds(s)));
        format!("{} on the clock{processor}", seconds(self.wall_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A thread that sleeps takes the clock's time alone, one that works takes the processor's.
    #[test]
    fn the_clock_and_the_processor_differ() {
        let watch = Stopwatch::start();
        std::thread::sleep(Duration::from_millis(200));
        let slept = watch.spent();
        assert!(slept.wall_s >= 0.2);
        let Some(idle_s) = slept.processor_s else { return };
        let mut sum = 0_u64;
        for k in 0..200_000_000_u64 {
            sum = std::hint::black_box(sum ^ k);
        }
        assert!(watch.spent().processor_s.unwrap() > idle_s);
        assert_eq!(
            Spent { wall_s: 115.2, processor_s: Some(4.63) }.in_words(),
            "115 s on the clock, 4.6 s of processor"
        );
        assert_eq!(Spent { wall_s: 1.0, processor_s: None }.in_words(), "1.0 s on the clock");
    }
}
