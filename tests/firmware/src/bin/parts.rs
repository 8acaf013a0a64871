//! Cost of a tick with a joint made at run time, and of the parts next to it: the update of the coefficients, the slip
//! bank, the telemetry. With `--features flight` it counts nothing and shows that they link without a panic path.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::num::NonZeroU32;

use cortex_m_rt::entry;
use flexspline::{
    Adjustment, Aged, Identity, IdentityCheck, Images, Input, Joint, JointState, Mode, Output, OutputAngle, Store,
    self_test,
};
use flexspline_estimation::{
    AdaptSettings, AdaptState, Adapted, Coefficient, Learning, MaxwellSlip, OnlineCalibration, Seen, Slip, SlipElement,
    SlipState, Term,
};
use flexspline_firmware::count::{Counter, Range};
use flexspline_firmware::trajectory::{JOINT, Mixed, Trajectory};
use flexspline_firmware::{TABLES, finish};
use flexspline_telemetry::{Queue, Recorder, Ring, Sink, Watch};

const INPUTS: u32 = 10_000;

/// Offset, wind-up, half-width and one order.
const SETTINGS: AdaptSettings<5> = AdaptSettings {
    coefficients: [
        Coefficient { term: Term::Mean, limit: 2e-4, initial_std: 1e-4 },
        Coefficient { term: Term::WindUp, limit: 1e-5, initial_std: 5e-6 },
        Coefficient { term: Term::HalfWidth, limit: 2e-5, initial_std: 1e-5 },
        Coefficient { term: Term::Cos(2), limit: 1e-4, initial_std: 3e-5 },
        Coefficient { term: Term::Sin(2), limit: 1e-4, initial_std: 3e-5 },
    ],
    noise_rad: 2e-6,
    memory_measurements: 2000.0,
    gate: 5.0,
    settle_rad: 0.0,
    torque_limit_n_m: 50.0,
};

const SPRINGS: [SlipElement; 4] = [
    SlipElement { width_rad: 1e-4, gain: 0.05 },
    SlipElement { width_rad: 3e-4, gain: 0.03 },
    SlipElement { width_rad: 1e-3, gain: 0.02 },
    SlipElement { width_rad: 3e-3, gain: 0.01 },
];

#[inline(never)]
fn tick_of(joint: &Joint, images: &Images<'_>, store: &mut Store, state: &mut JointState, input: &Input) -> Output {
    joint.tick(images, store, state, input)
}

/// Checks of a start-up: the processor, and whether the table is the one of its id.
fn starts_well(image: &[u8]) -> bool {
    let mut check = IdentityCheck::new();
    loop {
        match check.step(image) {
            Identity::Hashing => {}
            Identity::Same(_) => return self_test().is_ok(),
            Identity::Other(_) => return false,
        }
    }
}

#[inline(never)]
fn update(adapter: &OnlineCalibration<5>, state: &mut AdaptState<5>, seen: &Seen<'_>) -> Adapted {
    adapter.update(state, seen)
}

#[inline(never)]
fn slip(
    bank: &MaxwellSlip<4>,
    state: &mut SlipState<4>,
    nominal: OutputAngle,
    adjustment: Adjustment,
) -> (Slip, Adjustment) {
    let slip = bank.update(state, nominal);
    (slip, slip.added_to(adjustment))
}

#[inline(never)]
fn push<S: Sink>(recorder: &mut Recorder<S>, tick: u32, state: &JointState, store: &Store, output: &Output) -> bool {
    recorder.record(tick, state, store, output)
}

fn run(counter: &Counter) -> Option<[Range; 6]> {
    let [(_, [first, second]), ..] = TABLES;
    if !starts_well(first) {
        return None;
    }
    let joint = black_box(JOINT);
    let mut torque = Aged::new(100);
    let images = Images::new(first, second);
    let mut store = Store::new();
    store.activate(&images, JOINT.drive(), 21.0).ok()?;
    let adapter = OnlineCalibration::new(&SETTINGS, &joint, &store, 0).ok()?;
    let mut learnt = adapter.start();
    learnt.set_learning(Learning::On);
    let bank = MaxwellSlip::new(SPRINGS)?;
    let mut springs = SlipState::unknown();
    let mut ring = Recorder::new(Ring::<16>::new(), NonZeroU32::MIN);
    let mut queue = Queue::<16>::new();
    let (writer, mut reader) = queue.split();
    let mut records = Recorder::new(writer, NonZeroU32::MIN);
    let (mut state, mut watch) = (JointState::new(), Watch::new());
    state.request(Mode::Tracking).ok()?;
    let (mut trajectory, mut mixed) = (Trajectory::new(1), Mixed(5));
    let mut ranges = [Range::default(); 6];
    let mut sum = 0u32;
    for tick in 0..INPUTS {
        let mut input = trajectory.input();
        // Within the table, so that measurements are used.
        input.torque_n_m *= 0.5;
        input.torque_n_m = torque.tick(Some(input.torque_n_m));
        let (count, output) =
            counter.of(|| black_box(tick_of(&joint, &images, &mut store, &mut state, black_box(&input))));
        ranges[5].add(count);
        trajectory.saw(&output);
        let measured = output.output.offset_rad(5e-5 + 2e-6 * mixed.part());
        let measured = (tick % 2 == 0).then_some(measured);
        let seen = Seen { input: &input, play: state.play(), output: &output, measured };
        let before = learnt.counters().used;
        let (count, found) = counter.of(|| black_box(update(&adapter, &mut learnt, black_box(&seen))));
        let adjustment = found.adjustment;
        // Used, or nothing to use.
        if learnt.counters().used > before {
            ranges[0].add(count);
        } else if seen.measured.is_none() {
            ranges[1].add(count);
        }
        let (count, added) = counter.of(|| black_box(slip(&bank, &mut springs, output.output, adjustment)));
        ranges[2].add(count);
        sum = sum.wrapping_add(added.1.mean_counts() as u32);
        let (count, _) = counter.of(|| black_box(push(&mut ring, tick, &state, &store, &output)));
        // The first are before it is full.
        if tick > 16 {
            ranges[3].add(count);
        }
        let (count, _) = counter.of(|| black_box(push(&mut records, tick, &state, &store, &output)));
        ranges[4].add(count);
        sum = sum.wrapping_add(reader.take().map_or(0, |record| u32::from(record.encode()[48])));
        sum = sum.wrapping_add(watch.see(&state, &store, &output).iter().count() as u32);
    }
    let mut saved = [0; 128];
    adapter.save(&learnt, &mut saved)?;
    bank.save(&springs, &joint, &store, &mut saved)?;
    let restored = bank.restore(&joint, &store, &saved).ok()?;
    let done = learnt.counters().used > INPUTS / 20 && restored == springs && black_box(sum) != 0;
    done.then_some(ranges)
}

#[entry]
fn main() -> ! {
    let Some(peripherals) = cortex_m::Peripherals::take() else { finish(false) };
    let counter = Counter::new(peripherals.SYST);
    let Some(ranges) = run(&counter) else { finish(false) };
    #[cfg(not(feature = "flight"))]
    {
        let names = ["update", "update-idle", "slip", "telemetry-ring", "telemetry", "made-tick"];
        for (name, range) in names.iter().zip(ranges) {
            cortex_m_semihosting::hprintln!(
                "{}: {} instructions (min {}, max {})",
                name,
                range.max,
                range.min,
                range.max
            );
        }
    }
    let [_, _, slip, ring, telemetry, tick] = ranges;
    finish([slip, ring, telemetry, tick].iter().all(|range| range.min == range.max))
}
