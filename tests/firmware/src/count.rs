//! Instructions executed, counted exactly.
//!
//! Under `-icount shift=10` every instruction takes 1.024 µs of virtual time, and the 25 MHz SysTick of the MPS2 counts
//! 25.6 ticks for each. (The cycle counter of the DWT reads 0 in QEMU; without `-icount` SysTick follows the wall
//! clock.)

use core::sync::atomic::{Ordering, compiler_fence};

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;

/// Ticks for ten instructions.
const TICKS_OF_TEN: u32 = 256;
const RELOAD: u32 = 0x00ff_ffff;

/// Counts instructions between two readings of SysTick.
pub struct Counter {
    timer: SYST,
    own: u32,
}

/// Smallest and largest count seen.
#[derive(Clone, Copy, Debug)]
pub struct Range {
    /// Fewest instructions.
    pub min: u32,
    /// Most instructions.
    pub max: u32,
}

impl Default for Range {
    fn default() -> Self {
        Self { min: u32::MAX, max: 0 }
    }
}

impl Range {
    /// Takes one more count in.
    pub fn add(&mut self, count: u32) {
        self.min = self.min.min(count);
        self.max = self.max.max(count);
    }
}

impl Counter {
    /// Starts SysTick and finds what a measurement of nothing counts.
    pub fn new(mut timer: SYST) -> Self {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(RELOAD);
        timer.clear_current();
        timer.enable_counter();
        let mut counter = Self { timer, own: 0 };
        counter.own = counter.of(|| ()).0;
        counter
    }

    /// Instructions that `work` takes and what it gave.
    ///
    /// Never inlined, so that nothing of what comes before or after is moved in between; what the caller hands over is
    /// fetched in it and counted.
    #[inline(never)]
    pub fn of<T>(&self, work: impl FnOnce() -> T) -> (u32, T) {
        let _ = &self.timer;
        let before = SYST::get_current();
        compiler_fence(Ordering::SeqCst);
        let given = work();
        compiler_fence(Ordering::SeqCst);
        let after = SYST::get_current();
        let ticks = before.wrapping_sub(after) & RELOAD;
        ((ticks * 10 + TICKS_OF_TEN / 2) / TICKS_OF_TEN - self.own, given)
    }
}
