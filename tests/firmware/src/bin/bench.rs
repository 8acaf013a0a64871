//! Instructions of the control step and of its parts over mixed inputs: least and most.
//!
//! ```sh
//! tests/run firmware
//! ```
#![no_std]
#![no_main]

use core::hint::black_box;

use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use flexspline::{Approach, GeneratorAngle, OutputAngle, PlayState, Table};
use flexspline_firmware::count::{Counter, Range};
use flexspline_firmware::finish;

static FULL: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/full.fxt"));

const INPUTS: u32 = 10_000;

/// Splitmix-like numbers: the same inputs on every machine.
struct Mixed(u32);

impl Mixed {
    fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9);
        let mut x = self.0;
        x = (x ^ (x >> 16)).wrapping_mul(0x85eb_ca6b);
        x = (x ^ (x >> 13)).wrapping_mul(0xc2b2_ae35);
        x ^ (x >> 16)
    }

    /// Between −1 and 1.
    fn part(&mut self) -> f32 {
        (self.next() >> 8) as f32 * (2.0 / 16_777_216.0) - 1.0
    }
}

#[inline(never)]
fn forward(t: &Table<'_>, p: &mut PlayState, g: GeneratorAngle, torque: f32, temperature: f32) -> flexspline::Prediction {
    t.forward(p, g, torque, temperature)
}

#[inline(never)]
fn inverse(t: &Table<'_>, p: &PlayState, target: OutputAngle, torque: f32, temperature: f32) -> flexspline::Command {
    t.inverse(target, torque, temperature, Approach::From(p))
}

#[entry]
fn main() -> ! {
    let Some(peripherals) = cortex_m::Peripherals::take() else { finish(false) };
    let counter = Counter::new(peripherals.SYST);
    let Ok(table) = Table::check(FULL) else { finish(false) };
    let mut mixed = Mixed(1);
    let mut play = PlayState::unknown();
    let (mut forwards, mut inverses) = (Range::default(), Range::default());
    let mut generator = GeneratorAngle::ZERO;
    for _ in 0..INPUTS {
        generator = generator.offset_counts(i64::from(mixed.next() as i32) >> 3);
        let torque = 60.0 * mixed.part();
        let temperature = 20.0 + 80.0 * mixed.part();
        let (count, here) = counter.of(|| black_box(forward(&table, &mut play, generator, torque, temperature)));
        forwards.add(count);
        let target = here.output.offset_rad(1e-3 * mixed.part());
        let (count, _) = counter.of(|| black_box(inverse(&table, &play, target, torque, temperature)));
        inverses.add(count);
    }
    hprintln!("forward {} {}", forwards.min, forwards.max);
    hprintln!("inverse {} {}", inverses.min, inverses.max);
    finish(true)
}
