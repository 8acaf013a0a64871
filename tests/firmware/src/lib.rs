//! Shared by the programs: exact instruction counts under QEMU's `-icount`, a trajectory, the tables, and how a
//! program ends.
#![no_std]

pub mod count;
/// A tick of a joint, and the tapes of flights, as the host has them.
#[path = "../../../host-sim/motion/src/on_board.rs"]
pub mod on_board;
pub mod trajectory;

use cortex_m_semihosting::debug;

/// A file at two places of the flash: two statics are never one.
#[macro_export]
macro_rules! twice {
    ($path:expr) => {{
        const BYTES: usize = include_bytes!($path).len();
        static FIRST: [u8; BYTES] = *include_bytes!($path);
        static SECOND: [u8; BYTES] = *include_bytes!($path);
        [&FIRST as &[u8], &SECOND]
    }};
}

/// The tables of the four generators that `flexspline tables` made, read in place from flash, each twice.
pub static TABLES: [(&str, [&[u8]; 2]); 4] = [
    ("cam", twice!(concat!(env!("FLEXSPLINE_TABLES"), "/cam.fxt"))),
    ("double-disc", twice!(concat!(env!("FLEXSPLINE_TABLES"), "/double-disc.fxt"))),
    ("four-roller", twice!(concat!(env!("FLEXSPLINE_TABLES"), "/four-roller.fxt"))),
    ("two-roller", twice!(concat!(env!("FLEXSPLINE_TABLES"), "/two-roller.fxt"))),
];

/// Two inertias, discretised on the host.
pub static PREDICTOR: [f32; flexspline_estimation::PREDICTOR_PARTS] =
    include!(concat!(env!("OUT_DIR"), "/predictor.rs"));

/// Prints through semihosting, for a [`core::fmt::Write`].
pub struct Console;

impl core::fmt::Write for Console {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        cortex_m_semihosting::hprint!("{}", text);
        Ok(())
    }
}

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
