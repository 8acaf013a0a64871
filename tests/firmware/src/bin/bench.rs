//! Instructions of a tick and of forward and inverse over 10 000 mixed inputs, least and most, with each generator's
//! table. The last line is that of the costliest.
#![no_std]
#![no_main]

use core::hint::black_box;

use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use flexspline::parts::{self, OperatingPoint};
use flexspline::{
    Activation, Adjustment, Approach, Command, GeneratorAngle, Identity, IdentityCheck, Images, Input, Joint,
    JointState, Located, Mode, Output, OutputAngle, PlayState, Prediction, Progress, Store, TorqueFromWindUp,
    self_test,
};
use flexspline_estimation::{Measured, PredictorState, TwoMassObserver};
use flexspline_firmware::count::{Counter, Range};
use flexspline_firmware::trajectory::{JOINT, Mixed, Trajectory};
use flexspline_firmware::{PREDICTOR, TABLES, finish, twice};

/// 25 torques, 3 temperatures, and harmonics of all three angles, which no table of FEM has.
static FULL: [&[u8]; 2] = twice!(concat!(env!("OUT_DIR"), "/full.fxt"));

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
fn place(joint: &Joint, store: &Store, output: OutputAngle, torque: f32) -> Located {
    joint.locate(store, output, 2e-5, torque, 5.0)
}

#[inline(never)]
fn torque(
    joint: &Joint,
    store: &Store,
    play: &PlayState,
    generator: GeneratorAngle,
    output: OutputAngle,
) -> TorqueFromWindUp {
    joint.torque(store, play, &Adjustment::default(), generator, output, 2e-5)
}

#[inline(never)]
fn locate(store: &Store, torque: f32) -> OperatingPoint {
    parts::locate(store, torque)
}

#[inline(never)]
fn slice(store: &mut Store, images: &Images<'_>) {
    store.check_images(images, 1);
}

#[inline(never)]
fn output(
    joint: &Joint,
    store: &Store,
    point: &OperatingPoint,
    play: &mut PlayState,
    generator: GeneratorAngle,
) -> i32 {
    parts::forward(joint, store, point, play, generator)
}

#[inline(never)]
fn move_play(play: &mut PlayState, nominal: OutputAngle) -> i32 {
    parts::play(play, nominal)
}

#[inline(never)]
fn solve(joint: &Joint, store: &Store, point: &OperatingPoint, target: OutputAngle, backward: bool) -> i32 {
    parts::inverse(joint, store, point, target, backward)
}

#[inline(never)]
fn observe(predictor: &TwoMassObserver, state: &mut PredictorState, measured: &Measured) {
    predictor.step(state, measured);
}

/// Counts of the observer.
fn measure_observer(counter: &Counter) -> Option<Range> {
    let predictor = TwoMassObserver::from_parts(&PREDICTOR).ok()?;
    let (mut state, mut mixed, mut range) = (PredictorState::new(), Mixed(3), Range::default());
    for _ in 0..INPUTS {
        let measured =
            Measured { torque_n_m: 50.0 * mixed.part(), speed_rad_s: mixed.part(), twist_rad: 1e-3 * mixed.part() };
        range.add(counter.of(|| observe(&predictor, &mut state, black_box(&measured))).0);
    }
    hprintln!("observer: {} instructions (min {}, max {})", range.max, range.min, range.max);
    Some(range)
}

#[inline(never)]
fn step(activation: &mut Activation, store: &mut Store, images: &Images<'_>) -> Option<Progress> {
    activation.step(store, images).ok()
}

/// The costliest step of an activation, and how many there are.
fn measure_activation(counter: &Counter, name: &str, [first, second]: [&[u8]; 2]) -> Option<()> {
    let images = Images::new(first, second);
    let (mut store, mut range, mut all) = (Store::new(), Range::default(), [0; 2]);
    let mut activation = Store::begin(JOINT.drive(), 21.0).ok()?;
    loop {
        let (count, progress) = counter.of(|| black_box(step(&mut activation, &mut store, &images)));
        range.add(count);
        all = [all[0] + 1, all[1] + count];
        if matches!(progress?, Progress::Done(_)) {
            break;
        }
    }
    let [steps, sum] = all;
    hprintln!("{} activation: {} instructions (min {}), {} steps, {} in all", name, range.max, range.min, steps, sum);
    Some(())
}

#[inline(never)]
fn hash(check: &mut IdentityCheck, image: &[u8]) -> Identity {
    check.step(image)
}

/// The costliest step of finding out whether an image is the one of its id.
fn measure_identity(counter: &Counter, name: &str, image: &[u8]) -> Option<()> {
    let (mut check, mut range, mut all) = (IdentityCheck::new(), Range::default(), [0; 2]);
    loop {
        let (count, found) = counter.of(|| black_box(hash(&mut check, image)));
        range.add(count);
        all = [all[0] + 1, all[1] + count];
        match found {
            Identity::Hashing => {}
            Identity::Same(_) => break,
            Identity::Other(_) => return None,
        }
    }
    let [steps, sum] = all;
    hprintln!("{} identity: {} instructions (min {}), {} steps, {} in all", name, range.max, range.min, steps, sum);
    Some(())
}

/// Ranges of one table, by name.
type Ranges = [(&'static str, Range); 10];

/// Counts with one table; the tick's is given back.
///
/// `tick`, and `forward`, `inverse`, `place` (of the generator by the output, under a load known to 5 N·m) and `torque`
/// as they are called alone, from locating the torque to angles. Then the parts of a tick, each called alone: `locate`
/// the torque, `output` (nominal, ripple and play) and, of that, the `play`, `solve` for the command; the rest is what
/// is left of the tick: judging the sample, goal, limiter, flags, sums. A `slice` of the slow group checks a word of
/// the images and makes one of the copies anew.
fn measure(counter: &Counter, name: &str, [first, second]: [&[u8]; 2]) -> Option<Range> {
    let images = Images::new(first, second);
    let mut store = Store::new();
    store.activate(&images, JOINT.drive(), 21.0).ok()?;
    let (mut state, mut play, mut other) = (JointState::new(), PlayState::unknown(), PlayState::unknown());
    state.request(Mode::Tracking).ok()?;
    let mut trajectory = Trajectory::new(1);
    let names = ["forward", "inverse", "place", "torque", "locate", "output", "play", "solve", "slice", "tick"];
    let mut ranges: Ranges = names.map(|name| (name, Range::default()));
    let mut generator = GeneratorAngle::ZERO;
    for _ in 0..INPUTS {
        let input = trajectory.input();
        let (tick_count, out) = counter.of(|| black_box(tick(&JOINT, &images, &mut store, &mut state, &input)));
        trajectory.saw(&out);
        generator = input.generator.unwrap_or(generator);
        let (load, target) = (input.torque_n_m, input.target);
        let (forwards, _) = counter.of(|| black_box(forward(&JOINT, &store, &mut play, generator, load)));
        let (inverses, _) = counter.of(|| black_box(inverse(&JOINT, &store, &play, target, load)));
        let (places, _) = counter.of(|| black_box(place(&JOINT, &store, out.output, load)));
        let (torques, _) = counter.of(|| black_box(torque(&JOINT, &store, &play, generator, out.output)));
        let (locates, point) = counter.of(|| black_box(locate(&store, load)));
        let (outputs, _) = counter.of(|| black_box(output(&JOINT, &store, &point, &mut other, generator)));
        let (plays, _) = counter.of(|| black_box(move_play(&mut other, out.output)));
        let backward = target.counts() & 1 != 0;
        let (solves, _) = counter.of(|| black_box(solve(&JOINT, &store, &point, target, backward)));
        let (slices, ()) = counter.of(|| slice(&mut store, &images));
        let counts = [forwards, inverses, places, torques, locates, outputs, plays, solves, slices, tick_count];
        ranges.iter_mut().zip(counts).for_each(|((_, range), count)| range.add(count));
    }
    for (part, range) in ranges {
        hprintln!("{} {}: {} instructions (min {}, max {})", name, part, range.max, range.min, range.max);
    }
    let [.., (_, locate), (_, output), _, (_, solve), _, (_, tick)] = ranges;
    let rest = |end: fn(&Range) -> u32| end(&tick) - [locate, output, solve].iter().map(end).sum::<u32>();
    let (min, max) = (rest(|range| range.min), rest(|range| range.max));
    hprintln!("{} rest: {} instructions (min {}, max {}), by difference", name, max, min, max);
    Some(tick)
}

#[entry]
fn main() -> ! {
    let Some(peripherals) = cortex_m::Peripherals::take() else { finish(false) };
    let counter = Counter::new(peripherals.SYST);
    let (count, answer) = counter.of(|| black_box(self_test()));
    hprintln!("self-test: {} instructions", count);
    if answer.is_err() {
        finish(false);
    }
    let mut costliest = Range { min: 0, max: 0 };
    for (name, images) in TABLES {
        let Some(ticks) = measure(&counter, name, images) else { finish(false) };
        if ticks.max > costliest.max {
            costliest = ticks;
        }
    }
    if measure(&counter, "all-curves", FULL).is_none() {
        finish(false);
    }
    for (name, images) in TABLES.into_iter().chain([("full", FULL)]) {
        if measure_activation(&counter, name, images).is_none() {
            finish(false);
        }
    }
    for (name, [image, _]) in TABLES {
        if measure_identity(&counter, name, image).is_none() {
            finish(false);
        }
    }
    let Some(observer) = measure_observer(&counter) else { finish(false) };
    // The observer is part of a step.
    costliest.min += observer.min;
    costliest.max += observer.max;
    hprintln!("step: {} instructions (min {}, max {})", costliest.max, costliest.min, costliest.max);
    finish(costliest.min == costliest.max)
}
