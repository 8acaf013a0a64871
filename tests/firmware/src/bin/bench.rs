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
use flexspline::{Drive, FixedMember, GeneratorAngle, Input, Joint, JointState, Limits, Mode, OutputAngle, Images, Overrun, Store};
use flexspline_firmware::count::{Counter, Range};
use flexspline_firmware::finish;

static FULL: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/full.fxt"));
static CAM: &[u8] = include_bytes!("/tmp/c4/cam.fxt");
static TWO: &[u8] = include_bytes!("/tmp/c4/two-roller.fxt");

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
fn step(joint: &Joint, images: &Images<'_>, store: &mut Store, state: &mut JointState, input: &Input) -> flexspline::Output {
    joint.tick(images, store, state, input)
}

const JOINT: Joint = {
    let Ok(drive) = Drive::new(188, 190, FixedMember::Flexspline) else { panic!() };
    let limits = Limits { tick_s: 1e-3, rate_rad_s: 0.05, acceleration_rad_s2: 5.0, generator_rate_rad_s: 600.0, patience: 5 };
    let Ok(joint) = Joint::new(drive, limits, Overrun::FadeOut { ticks: 50 }) else { panic!() };
    joint
};

#[entry]
fn main() -> ! {
    let Some(peripherals) = cortex_m::Peripherals::take() else { finish(false) };
    let counter = Counter::new(peripherals.SYST);
    for image in [FULL, CAM, TWO] {
    let images = Images::new(image, image);
    let mut store = Store::new();
    if store.activate(&images, JOINT.drive(), 21.0).is_err() { finish(false) }
    let mut mixed = Mixed(1);
    let mut state = JointState::new();
    let _ = state.request(Mode::Tracking);
    let mut steps = Range::default();
    let mut generator = GeneratorAngle::ZERO;
    let mut output = OutputAngle::ZERO;
    for _ in 0..INPUTS {
        generator = generator.offset_counts(i64::from(mixed.next() as i32) >> 8);
        let torque_n_m = 60.0 * mixed.part();

        let target = output.offset_rad(1e-3 * mixed.part());
        let input = Input { generator: Some(generator), target, torque_n_m, missed_ticks: 0 };
        let (count, out) = counter.of(|| black_box(step(&JOINT, &images, &mut store, &mut state, &input)));
        output = out.output;
        steps.add(count);
    }
    hprintln!("step: {} instructions (min {}, max {})", steps.max, steps.min, steps.max);
    hprintln!("{:?} {:?}", store.counters(), store.health());
    }
    finish(true)
}
