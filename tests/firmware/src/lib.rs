//! What the programs share: exact instruction counts under QEMU's `-icount`, and how a program ends.
#![no_std]

pub mod count;

use cortex_m_semihosting::debug;

/// Ends the emulation: exit code 0 if all went well, else 1.
pub fn finish(well: bool) -> ! {
    loop {
        debug::exit(if well { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    }
}

/// The panic handler of programs that may print; the flight build has one that cannot be linked.
#[cfg(not(feature = "flight"))]
#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    cortex_m_semihosting::hprintln!("{}", info);
    finish(false)
}

#[cfg(feature = "flight")]
use panic_never as _;
