//! Instructions of a tick and of forward and inverse over 10 000 mixed inputs, least and most, with each generator's table.
//! The last line is that of the costliest.
#![no_std]
#![no_main]

use core::hint::black_box;

use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use flexspline::{
    Approach, Command, GeneratorAngle, Images, Input, Joint, JointState, Measured, Mode, Output, OutputAngle,
    PlayState, Prediction, Predictor, PredictorState, Store,
};
use flexspline_firmware::count::{Counter, Range};
use flexspline_firmware::trajectory::{JOINT, Mixed, Trajectory};
use flexspline_firmware::{PREDICTOR, TABLES, finish};

/// 25 torques, 3 temperatures, and harmonics of all three angles, which no table of FEM has.
static FULL: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/full.fxt"));

const INPUTS: u32 = 10_000;

#[inline(never)]
fn tick(joint: &Joint, images: &Images<'_>, store: &mut Store, state: &mut JointState, input: &Input) -> Output {
    joint.tick(images, store, state, input)
}

#[inline(never)]
fn forward(joint: &Joint, store: &Store, play: &mut PlayState, generator: GeneratorAngle, torque: f32) -> Prediction {
    joint.forward(store, play, generator, torque)
}

#[inline(never)]
fn inverse(joint: &Joint, store: &Store, play: &PlayState, target: OutputAngle, torque: f32) -> Command {
    joint.inverse(store, target, torque, Approach::From(play))
}

#[inline(never)]
fn observe(predictor: &Predictor, state: &mut PredictorState, measured: &Measured) {
    predictor.step(state, measured);
}

/// Counts of the observer.
fn measure_observer(counter: &Counter) -> Option<Range> {
    let predictor = Predictor::from_parts(&PREDICTOR).ok()?;
    let (mut state, mut mixed, mut range) = (PredictorState::new(), Mixed(3), Range::default());
    for _ in 0..INPUTS {
        let measured =
            Measured { torque_n_m: 50.0 * mixed.part(), speed_rad_s: mixed.part(), twist_rad: 1e-3 * mixed.part() };
        range.add(counter.of(|| observe(&predictor, &mut state, black_box(&measured))).0);
    }
    hprintln!("observer: {} instructions (min {}, max {})", range.max, range.min, range.max);
    Some(range)
}

/// Counts with one table; the tick's is given back.
fn measure(counter: &Counter, name: &str, image: &[u8]) -> Option<Range> {
    let images = Images::new(image, image);
    let mut store = Store::new();
    store.activate(&images, JOINT.drive(), 21.0).ok()?;
    let (mut state, mut play) = (JointState::new(), PlayState::unknown());
    state.request(Mode::Tracking).ok()?;
    let mut trajectory = Trajectory::new(1);
    let (mut ticks, mut forwards, mut inverses) = (Range::default(), Range::default(), Range::default());
    let mut generator = GeneratorAngle::ZERO;
    for _ in 0..INPUTS {
        let input = trajectory.input();
        let (count, out) = counter.of(|| black_box(tick(&JOINT, &images, &mut store, &mut state, &input)));
        ticks.add(count);
        trajectory.saw(&out);
        generator = input.generator.unwrap_or(generator);
        let torque = input.torque_n_m;
        let (count, _) = counter.of(|| black_box(forward(&JOINT, &store, &mut play, generator, torque)));
        forwards.add(count);
        let (count, _) = counter.of(|| black_box(inverse(&JOINT, &store, &play, input.target, torque)));
        inverses.add(count);
    }
    for (part, range) in [("forward", forwards), ("inverse", inverses), ("tick", ticks)] {
        hprintln!("{} {}: {} instructions (min {}, max {})", name, part, range.max, range.min, range.max);
    }
    Some(ticks)
}

#[entry]
fn main() -> ! {
    let Some(peripherals) = cortex_m::Peripherals::take() else { finish(false) };
    let counter = Counter::new(peripherals.SYST);
    let mut costliest = Range { min: 0, max: 0 };
    for (name, image) in TABLES {
        let Some(ticks) = measure(&counter, name, image) else { finish(false) };
        if ticks.max > costliest.max {
            costliest = ticks;
        }
    }
    if measure(&counter, "all-curves", FULL).is_none() {
        finish(false);
    }
    let Some(observer) = measure_observer(&counter) else { finish(false) };
    // The observer is part of a step.
    costliest.min += observer.min;
    costliest.max += observer.max;
    hprintln!("step: {} instructions (min {}, max {})", costliest.max, costliest.min, costliest.max);
    finish(costliest.min == costliest.max)
}
