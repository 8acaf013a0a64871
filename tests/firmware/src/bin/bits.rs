//! A hash over every bit of 100 000 ticks with each generator's table, to compare with that of the host
//! (`core/examples/bits.rs`).
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use flexspline::Store;
use flexspline_firmware::{TABLES, finish, trajectory};

#[entry]
fn main() -> ! {
    for (name, images) in TABLES {
        hprintln!("{} {:016x}", name, trajectory::run(images, &mut Store::new(), 100_000));
    }
    finish(true)
}
