//! Upsets of everything that a tick reads or keeps, one bit at a time, beside a twin that is not hit.
//!
//! Store, state and joint live on from tick to tick after the flip, and so does what feeds the tick: encoder, torque
//! with its age, springs, learning, observer. The twin has its own and the same readings. A flip is *silent* if
//! in any later tick the command is off by more than 0.1″ at the output (5″ where sensors feed the joint), and that
//! tick reports nothing: no flag of doubt, no worse health of the store, and bounds that do not hold the twin's. What
//! encoder, learning or springs say of themselves does not count: whoever flies looks at the tick. Errors that show
//! only in what the limiter holds back are counted separately.

use core::f64::consts::TAU;
use flexspline::testing::fixture::{self, ARCSEC};
use flexspline::testing::{Upset, upsets};
use flexspline::{
    Adjustment, Aged, Direction, Encoder, EncoderSettings, EncoderState, EncoderWrap, Flags, GeneratorAngle, Health,
    Images, Input, Joint, JointState, Limits, Mode, Output, OutputAngle, Overrun, Quality, Store, TorquePath,
    TorqueReading, TorqueSettings,
};
use flexspline_c::Object;
use flexspline_estimation::{
    AdaptSettings, AdaptState, Coefficient, Inertias, Learning, LoadTorque, MaxwellSlip, Measured, Noise,
    OnlineCalibration, PredictorState, Seen, SlipElement, SlipState, Term, TorqueSlipElement, TwoMassObserver,
};
use std::collections::BTreeMap;
use std::string::{String, ToString};
use std::sync::LazyLock;
use std::vec::Vec;

/// Off by more than this is wrong, rad at the output.
const WRONG_RAD: f64 = 0.1 * ARCSEC;
/// The same where encoder, torque and springs feed the joint: after a torque was missing (which is reported) the
/// low-pass is where it would be to less than this and not to the bit.
const WRONG_FED_RAD: f64 = 5.0 * ARCSEC;
const TICKS: usize = 450;

static IMAGES: LazyLock<[Vec<u8>; 2]> = LazyLock::new(|| [fixture::image(true), fixture::image(true)]);

fn images() -> Images<'static> {
    Images::new(&IMAGES[0], &IMAGES[1])
}

/// Everything that lives from tick to tick.
#[derive(Clone)]
struct World {
    joint: Joint,
    store: Store,
    state: JointState,
    feed: Feed,
}

upsets!(World { joint, store, state, feed });

/// Inputs of the tick.
#[derive(Clone, Debug, PartialEq)]
struct Feed {
    encoder: Encoder,
    at: EncoderState,
    aged: Aged,
    path: TorquePath,
    bank: MaxwellSlip<3>,
    springs: SlipState<3>,
    torque_bank: MaxwellSlip<2, LoadTorque>,
    torque_springs: SlipState<2, LoadTorque>,
    predictor: TwoMassObserver,
    observer: PredictorState,
    adapter: OnlineCalibration<3>,
    learnt: AdaptState<3>,
    firmware: Firmware,
}

upsets!(Feed {
    encoder,
    at,
    aged,
    path,
    bank,
    springs,
    torque_bank,
    torque_springs,
    predictor,
    observer,
    adapter,
    learnt,
    firmware
});

/// Variables of the firmware, from one tick to the next: what learning says, and the sum.
#[derive(Clone, Debug, Default, PartialEq)]
struct Firmware {
    own: Adjustment,
    sum: Adjustment,
}

upsets!(Firmware { own, sum });

/// Raw sensor readings of a tick.
#[derive(Clone, Copy, Debug)]
struct Raw {
    register: u64,
    torque_n_m: Option<f32>,
    direction: Direction,
    motor: Measured,
    /// The torque is the observer's.
    observed: bool,
}

impl Feed {
    fn new(joint: &Joint, store: &Store) -> Self {
        let encoder = Encoder::new(EncoderSettings {
            counts_per_turn: 1 << 20,
            wrap: EncoderWrap::Bits(32),
            reversed: true,
            zero_counts: 12_345,
        })
        .unwrap();
        let path = TorquePath::new(TorqueSettings {
            tick_s: 1e-3,
            bandwidth_hz: 20.0,
            drag_n_m: 0.5,
            table_drag_n_m: 0.02,
            hold_n_m: 0.1,
            settle_s: 0.02,
            largest_n_m: 100.0,
        })
        .unwrap();
        let spring = |width_rad, gain| SlipElement { width_rad, gain };
        let torque_spring = |width_n_m, gain_rad_per_n_m| TorqueSlipElement { width_n_m, gain_rad_per_n_m };
        let coefficient = |term, limit| Coefficient { term, limit, initial_std: 0.5 * limit };
        let settings = AdaptSettings {
            coefficients: [
                coefficient(Term::Mean, 2e-4),
                coefficient(Term::HalfWidth, 5e-5),
                coefficient(Term::Cos(2), 1e-4),
            ],
            noise_rad: 2e-6,
            memory_measurements: 1e3,
            gate: 5.0,
            settle_rad: 1e-5,
            torque_limit_n_m: 20.0,
        };
        let adapter = OnlineCalibration::new(&settings, joint, store, 0).unwrap();
        let mut learnt = adapter.start();
        learnt.set_learning(Learning::On);
        let inertias =
            Inertias { motor_kg_m2: 1.0, load_kg_m2: 3.0, stiffness_n_m_per_rad: 3e4, damping_n_m_s_per_rad: 20.0 };
        let noise = Noise { torque_n_m: 0.5, load_change_n_m: 2.0, speed_rad_s: 1e-3, twist_rad: Some(1e-5) };
        let predictor = TwoMassObserver::new(inertias, noise, 1e-3).unwrap();
        Self {
            at: encoder.start(encoder.reading(0), 0).unwrap(),
            encoder,
            aged: Aged::new(4),
            path,
            bank: MaxwellSlip::new([spring(1e-4, 0.2), spring(3e-4, 0.1), spring(1e-3, 0.05)]).unwrap(),
            springs: SlipState::relaxed(),
            torque_bank: MaxwellSlip::of_torque([torque_spring(2.0, 1e-5), torque_spring(6.0, 4e-6)]).unwrap(),
            torque_springs: SlipState::relaxed(),
            predictor,
            observer: PredictorState::new(),
            adapter,
            learnt,
            firmware: Firmware::default(),
        }
    }

    /// From the sensors to the input of a tick: of what the story gives it keeps target and late ticks.
    fn input(&mut self, raw: &Raw, story: Input) -> Input {
        let read = self.encoder.read(&mut self.at, raw.register);
        let generator = self.encoder.angle(&self.at).filter(|_| read).map(GeneratorAngle::from_counts);
        let _ = self.predictor.step(&mut self.observer, &raw.motor);
        let sensed = self.aged.tick(raw.torque_n_m);
        let torque = if raw.observed { self.observer.load_torque_n_m() } else { sensed };
        let torque_n_m = self.path.tick(TorqueReading::OnLoad(torque), raw.direction);
        Input { generator, torque_n_m, adjustment: self.firmware.sum, ..story }
    }

    /// After a tick.
    fn after(&mut self, input: &Input, output: &Output, state: &JointState, measured: OutputAngle) {
        // As the page of the crate says: learning is given its own adjustment alone.
        let own = Input { adjustment: self.firmware.own, ..*input };
        // While the springs are not known what they miss would be learnt.
        let known = self.springs.is_known() && self.torque_springs.is_known();
        let seen = Seen { input: &own, play: state.play(), output, measured: known.then_some(measured) };
        self.firmware.own = self.adapter.update(&mut self.learnt, &seen).adjustment;
        let nominal = fixture::drive().nominal_output(input.generator.unwrap_or_default());
        let nominal = if input.generator.is_some() { nominal } else { state.play().nominal().unwrap_or_default() };
        let slip = self.bank.update(&mut self.springs, nominal);
        let torque_slip = self.torque_bank.update(&mut self.torque_springs, input.torque_n_m);
        self.firmware.sum = torque_slip.added_to(slip.added_to(self.firmware.own));
    }
}

impl World {
    fn new() -> Self {
        let limits = Limits { rate_rad_s: 0.1, acceleration_rad_s2: 20.0, deadband_rad: 2e-6, ..fixture::LIMITS };
        let joint = Joint::new(fixture::drive(), limits, Overrun::FadeOut { ticks: 50 }).unwrap();
        let mut store = Store::new();
        store.activate(&images(), &fixture::drive(), 20.0).unwrap();
        let mut state = JointState::new();
        state.request(Mode::Tracking).unwrap();
        let feed = Feed::new(&joint, &store);
        Self { joint, store, state, feed }
    }

    /// One tick, and what it was given.
    fn tick(&mut self, story: Story, tick: usize, raw: &Raw, input: Input) -> (Input, Output) {
        story.before(tick, self);
        let input = if story.is_fed() { self.feed.input(raw, input) } else { input };
        (input, self.joint.tick(&images(), &mut self.store, &mut self.state, &input))
    }

    fn is_like(&self, other: &Self) -> bool {
        let same = self.state == other.state && self.joint == other.joint && self.feed == other.feed;
        same && self.store.is_like(&other.store)
    }
}

/// How many bits of an object are flipped in the campaigns, or the test that flips those of one that feeds no tick: an
/// object of the C interface that is not here does not compile.
fn campaign(object: Object, World { joint, store, state, feed }: &World) -> Result<usize, &'static str> {
    match object {
        Object::Store => Ok(store.bits()),
        Object::Joint => Ok(joint.bits()),
        Object::State => Ok(state.bits()),
        Object::Adjustment => Ok(feed.firmware.own.bits() + feed.firmware.sum.bits()),
        Object::Learner => Ok(feed.adapter.bits() + feed.learnt.bits()),
        Object::Slip => {
            Ok(feed.bank.bits() + feed.springs.bits() + feed.torque_bank.bits() + feed.torque_springs.bits())
        }
        Object::Encoder => Ok(feed.encoder.bits() + feed.at.bits()),
        Object::TorquePath => Ok(feed.path.bits()),
        Object::Aged => Ok(feed.aged.bits()),
        Object::Predictor => Ok(feed.predictor.bits()),
        Object::Observer => Ok(feed.observer.bits()),
        Object::Activation => Err("no_single_bit_of_an_activation_makes_another_table"),
        Object::Identity => Err("an_upset_of_the_check_never_makes_another_image_the_one_of_its_id"),
        Object::StartUp => Err("an_upset_of_the_test_is_mended_or_ends_it"),
        // What was received is checked whole, and what is reported moves nothing.
        Object::Upload => Err("what_is_no_table_of_this_drive_is_not_activated"),
        Object::Watch | Object::Recorder => Err("damaged_records_are_refused_and_named"),
    }
}

#[test]
fn every_object_has_its_campaign() {
    let world = World::new();
    let mut bits = 0;
    for object in Object::ALL {
        match campaign(object, &world) {
            Ok(found) => bits += found,
            Err(test) => {
                let core = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
                let files = [
                    "src/store/tests.rs",
                    "src/table/identity.rs",
                    "src/joint/start_up.rs",
                    "telemetry/src/records.rs",
                ];
                let sources = files.map(|file| std::fs::read_to_string(std::format!("{core}/{file}")).unwrap());
                assert!(
                    sources.iter().any(|source| source.contains(&std::format!("fn {test}()"))),
                    "{object:?}: {test}"
                );
            }
        }
    }
    // All that lives on from tick to tick belongs to one of them.
    assert_eq!(bits, world.bits());
}

/// Scenario around the flip.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Story {
    Tracking,
    Hold,
    Off,
    Fade,
    Glitch,
    Blind,
    Adjusted,
    Restored,
    /// By encoder, torque sensor, springs, and what was learnt until tick 110 and stays then: a tick that is done again
    /// teaches nothing, and what is learnt a tick later would be another command. That learning goes on to the same
    /// bits is a test of its own.
    Fed,
    /// With the torque that the observer finds.
    Observed,
}

/// Stories, and the ticks before which a bit flips.
const STORIES: [(Story, &[usize]); 10] = [
    (Story::Tracking, &[0, 1, 120, 203]),
    (Story::Hold, &[150]),
    (Story::Off, &[103, 150]),
    (Story::Fade, &[150]),
    (Story::Glitch, &[151]),
    (Story::Blind, &[151]),
    (Story::Adjusted, &[150]),
    (Story::Restored, &[100, 101]),
    (Story::Fed, &[120, 203, 330]),
    (Story::Observed, &[150]),
];

impl Story {
    fn is_fed(self) -> bool {
        matches!(self, Self::Fed | Self::Observed)
    }

    /// Raw sensor readings: the motor is where it was commanded.
    fn raw(self, tick: usize, generator: GeneratorAngle, register: u64) -> Raw {
        let load = self.input(tick, generator).torque_n_m;
        let backward = (200..=320).contains(&tick);
        let speed_rad_s = if tick < 200 {
            1e-2
        } else if backward {
            -1e-2
        } else {
            0.0
        };
        Raw {
            register,
            // New in every third tick.
            torque_n_m: tick.is_multiple_of(3).then_some(load),
            direction: if tick < 200 { Direction::Forward } else { Direction::Backward },
            motor: Measured { torque_n_m: -load, speed_rad_s, twist_rad: load / 3e4 },
            observed: self == Self::Observed,
        }
    }

    /// Actions of the firmware before a tick.
    fn before(self, tick: usize, world: &mut World) {
        let request = match (self, tick) {
            (Self::Hold, 100) => Some(Mode::Hold),
            (Self::Off, 100) => Some(Mode::Off),
            (Self::Hold | Self::Restored, 250) | (Self::Off, 300) => Some(Mode::Tracking),
            _ => None,
        };
        if let Some(mode) = request {
            let _ = world.state.request(mode);
        }
        if self == Self::Restored
            && tick == 100
            && let Ok(state) =
                JointState::restore(&world.state.save(&world.joint, &world.store), &world.joint, &world.store)
        {
            world.state = state;
            let _ = world.state.request(Mode::Tracking);
        }
        if self.is_fed() && tick == 110 {
            world.feed.learnt.set_learning(Learning::Frozen);
        }
        if tick % 20 == 10 {
            // The same: else a word made anew in another tick than the twin's would have another temperature.
            let _ = world.store.set_temperature(&images(), 20.0);
            world.store.check_images(&images(), 16);
        }
    }

    fn input(self, tick: usize, generator: GeneratorAngle) -> Input {
        // Forward, from tick 200 on backward, from 320 on standing.
        // Springs differ by a little after a tick that moved them later: a standing target could then be reached on
        // another flank.
        let last = if self.is_fed() { TICKS } else { 320 };
        let place = if tick < 200 { tick as f64 } else { 400.0 - tick.min(last) as f64 };
        let target = OutputAngle::from_rad(1e-3 + 1e-5 * place).unwrap();
        let during = (149..153).contains(&tick);
        let generator = match self {
            Self::Glitch if during => Some(generator.offset_rad(2.0)),
            _ => Some(generator),
        };
        let adjustment = if self == Self::Adjusted { Adjustment::from_rad(3e-5, 1e-5) } else { Adjustment::default() };
        Input {
            generator,
            target,
            torque_n_m: if self == Self::Blind && during { f32::NAN } else { 20.0 * (tick as f32 / 200.0).sin() },
            missed_ticks: u16::from(self == Self::Fade && tick == 145),
            adjustment,
        }
    }
}

/// A tick of the twin, and what it was given.
struct Twin {
    input: Input,
    raw: Raw,
    /// Reading of an encoder at the output after it.
    measured: OutputAngle,
    output: Output,
    health: Health,
    /// After it, if it is fed.
    feed: Option<Feed>,
    /// Snapshot after some of the ticks.
    world: Option<World>,
}

/// The run that is not hit, and the world before each tick of `at`.
fn undisturbed(story: Story, at: &[usize]) -> (Vec<Twin>, Vec<World>) {
    let mut world = World::new();
    let (mut run, mut worlds) = (Vec::new(), Vec::new());
    let mut generator = GeneratorAngle::ZERO;
    let encoder = world.feed.encoder;
    for tick in 0..TICKS {
        if at.contains(&tick) {
            worlds.push(world.clone());
        }
        let raw = story.raw(tick, generator, encoder.reading(generator.counts()));
        let (input, output) = world.tick(story, tick, &raw, story.input(tick, generator));
        // What the table misses: an offset, and more where the generator is turned by half.
        let hidden = 3e-5 + 1e-5 * (2.0 * TAU * f64::from(generator.fraction()) / 4_294_967_296.0).cos();
        let added = i64::from(input.adjustment.mean_counts());
        let measured = output.output.offset_counts(-added).offset_rad(hidden as f32);
        if story.is_fed() {
            world.feed.after(&input, &output, &world.state, measured);
        }
        generator = output.command;
        let kept = (tick % 25 == 0).then(|| world.clone());
        let feed = story.is_fed().then(|| world.feed.clone());
        run.push(Twin { input, raw, measured, output, health: world.store.health(), feed, world: kept });
    }
    (run, worlds)
}

/// How well the fault was reported, best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Fate {
    /// Never off.
    Harmless,
    /// Flags, health or bounds say so.
    Reported,
    /// Only the limiter reports that it is behind, and nothing else ever.
    HeldBack,
    Silent,
}

/// Counts of the generator in rad of the output.
fn output_rad(counts: i64) -> f64 {
    counts as f64 * TAU / 4_294_967_296.0 / fixture::drive().exact_ratio()
}

/// Whether a tick reports something that the twin's does not.
fn reports(found: &Output, world: &World, twin: &Twin) -> bool {
    let doubts = [
        Flags::SAMPLE_LOST,
        Flags::BOUNDED,
        Flags::NOT_CORRECTED,
        Flags::TABLE_DOUBT,
        Flags::STATE_TORN,
        Flags::JOINT_TORN,
        Flags::SAFE,
        Flags::OTHER_IMAGES,
    ];
    let flagged = doubts.into_iter().any(|flag| found.flags.contains(flag) && !twin.output.flags.contains(flag));
    flagged || world.store.health() != twin.health
}

/// Whether a tick is off, compared with the twin's, and reports it; `reported` is whether it or an earlier one did.
fn fate(found: &Output, reported: bool, reporting: bool, twin: &Twin) -> Fate {
    let expected = &twin.output;
    let away = output_rad(found.command.minus_counts(expected.command));
    let wrong = if twin.feed.is_some() { WRONG_FED_RAD } else { WRONG_RAD };
    if away.abs() <= wrong || reporting || found.quality == Quality::Disabled {
        return if away.abs() <= wrong { Fate::Harmless } else { Fate::Reported };
    }
    // What is wanted: the command with what was held back of it.
    let wanted = (away - f64::from(found.held_back_rad - expected.held_back_rad)).abs();
    if wanted <= wrong {
        return if reported { Fate::Reported } else { Fate::HeldBack };
    }
    let bounded = found.quality != Quality::InRange && wanted <= f64::from(found.uncertainty_rad) + wrong;
    if bounded { Fate::Reported } else { Fate::Silent }
}

/// A tick of a hit world with what the twin was given.
fn go_on(world: &mut World, story: Story, tick: usize, twin: &Twin) -> Output {
    let (input, found) = world.tick(story, tick, &twin.raw, twin.input);
    if story.is_fed() {
        world.feed.after(&input, &found, &world.state, twin.measured);
    }
    found
}

/// Lets a hit world live on beside the twin.
fn live_on(mut world: World, story: Story, from: usize, run: &[Twin]) -> Fate {
    let (mut worst, mut reported) = (Fate::Harmless, false);
    for (tick, twin) in run.iter().enumerate().skip(from) {
        let found = go_on(&mut world, story, tick, twin);
        let reporting = reports(&found, &world, twin);
        reported |= reporting;
        let now = fate(&found, reported, reporting, twin);
        worst = worst.max(now);
        // What is as if there had been no flip stays so.
        let healed = twin.world.as_ref().is_some_and(|twin| twin.is_like(&world));
        if worst == Fate::Silent || healed {
            break;
        }
    }
    worst
}

/// Flips by field: how many, and how many of each fate.
#[derive(Default)]
struct Counts(BTreeMap<String, [usize; 4]>);

impl Counts {
    fn add(&mut self, path: &str, fate: Fate) {
        self.0.entry(path.to_string()).or_default()[fate as usize] += 1;
    }

    fn sum(&self) -> [usize; 4] {
        let mut sum = [0; 4];
        self.0.values().for_each(|found| sum.iter_mut().zip(found).for_each(|(sum, found)| *sum += found));
        sum
    }

    /// Prints the counts by field, poorly reported faults first; none may be silent.
    #[track_caller]
    fn none_is_silent(&self, name: &str) {
        let all = |found: &[usize; 4]| found.iter().sum::<usize>();
        let mut fields: Vec<_> = self.0.iter().collect();
        fields.sort_by_key(|(_, found)| core::cmp::Reverse((found[3], found[2])));
        std::println!(
            "{name}: {:>34} {:>8} {:>8} {:>8} {:>8} {:>8}",
            "field",
            "flips",
            "silent",
            "held",
            "reported",
            "none"
        );
        for (path, found) in fields {
            let [none, reported, held, silent] = found;
            std::println!("{path:>50} {:>8} {silent:>8} {held:>8} {reported:>8} {none:>8}", all(found));
        }
        let [none, reported, held, silent] = self.sum();
        std::println!("{:>50} {:>8} {silent:>8} {held:>8} {reported:>8} {none:>8}", "all", all(&self.sum()));
        assert_eq!(silent, 0, "{name}");
    }
}

/// Whether a path is to a word of a copy of the table.
fn is_copy(path: &str) -> bool {
    [".store.first", ".store.second"].contains(&path)
}

/// Whether a bit has any effect in a story: what feeds is not read where nothing is fed.
fn is_idle(story: Story, path: &str) -> bool {
    !story.is_fed() && path.starts_with(".feed")
}

#[test]
#[ignore = "long: tests/run slow"]
fn no_single_bit_of_what_lives_on_is_wrong_in_silence() {
    let mut counts = Counts::default();
    for (story, at) in STORIES {
        let (run, worlds) = undisturbed(story, at);
        for (&from, world) in at.iter().zip(&worlds) {
            for bit in 0..world.bits() {
                let (mut hit, mut path) = (world.clone(), String::new());
                hit.flip(bit, &mut path);
                if !is_copy(&path) && !is_idle(story, &path) {
                    counts.add(&path, live_on(hit, story, from, &run));
                }
            }
        }
    }
    counts.none_is_silent("single bits");
}

/// Every bit of what feeds a tick, while learning goes on: what it says afterwards is the same to the bit, as if there
/// had been no flip.
#[test]
fn what_feeds_a_tick_goes_on_to_the_same_bits_after_any_single_bit() {
    for (story, at) in [(Story::Fed, 100), (Story::Observed, 60)] {
        let (run, worlds) = undisturbed(story, &[at]);
        let bits = worlds[0].feed.bits();
        let mut moved = Adjustment::default();
        for bit in 0..bits {
            let (mut hit, mut path) = (worlds[0].clone(), String::new());
            hit.feed.flip(bit, &mut path);
            // Four ticks: each object is asked in each of them, and Aged measured in one of three.
            for (tick, twin) in run.iter().enumerate().skip(at).take(4) {
                let found = go_on(&mut hit, story, tick, twin);
                // What is read only is mended by the slow group; each call until then mended a copy.
                let Feed { encoder, bank, torque_bank, predictor, adapter, .. } = &mut hit.feed;
                assert!(
                    [encoder.mend(), bank.mend(), torque_bank.mend(), predictor.mend(), adapter.mend()] == [true; 5]
                );
                let aged = path.starts_with(".aged");
                assert!(
                    aged || (found == twin.output && Some(&hit.feed) == twin.feed.as_ref()),
                    "{path} {bit}, {tick}"
                );
                moved = hit.feed.firmware.sum;
            }
        }
        assert!(bits > 5000 && moved != Adjustment::default(), "{bits}");
    }
}

/// Learning, springs and their settings, lost: every tick after that is as the twin's within what it says, as long as
/// they are; and it says nothing where they are not.
#[test]
fn the_loss_of_learning_or_springs_is_in_every_tick() {
    let (run, worlds) = undisturbed(Story::Fed, &[203]);
    let flips: [fn(&mut Feed, usize); 6] = [
        |feed, bit| feed.adapter.flip(bit, &mut String::new()),
        |feed, bit| feed.learnt.flip(bit, &mut String::new()),
        |feed, bit| feed.bank.flip(bit, &mut String::new()),
        |feed, bit| feed.springs.flip(bit, &mut String::new()),
        |feed, bit| feed.torque_bank.flip(bit, &mut String::new()),
        |feed, bit| feed.torque_springs.flip(bit, &mut String::new()),
    ];
    for (lost, flip) in flips.into_iter().enumerate() {
        let mut hit = worlds[0].clone();
        [3, 90].into_iter().for_each(|bit| flip(&mut hit.feed, bit));
        let (mut worst, mut off, mut said) = (Fate::Harmless, 0.0f64, 0);
        for (tick, twin) in run.iter().enumerate().skip(203) {
            let found = go_on(&mut hit, Story::Fed, tick, twin);
            let reporting = reports(&found, &hit, twin);
            worst = worst.max(fate(&found, false, reporting, twin));
            off = off.max(output_rad(found.command.minus_counts(twin.output.command)).abs() / ARCSEC);
            said += usize::from(found.quality != Quality::InRange);
        }
        std::println!("{lost}: {off:.1} arcsec off at most, said in {said} of {} ticks", TICKS - 203);
        assert!(off > 1.0 && worst != Fate::Silent, "{lost}: {worst:?}");
        // Springs that are lost are known again after their strokes; what else is lost stays so. The tick at once has
        // the adjustment of before.
        assert!(if lost % 2 == 1 && lost > 1 { said > 10 } else { said >= TICKS - 204 }, "{lost}: {said}");
    }
}

#[test]
fn no_single_bit_of_the_copies_is_wrong_in_silence() {
    let mut counts = Counts::default();
    let (run, worlds) = undisturbed(Story::Tracking, &[120]);
    let world = &worlds[0];
    // And what is read beyond the last word in use.
    let used = world.store.used_words() + 4;
    for copy in 0..2 {
        for bit in 0..32 * used {
            let mut hit = world.clone();
            hit.store.upset(copy, bit / 32, 1 << (bit % 32));
            counts.add(if copy == 0 { "first copy" } else { "second copy" }, live_on(hit, Story::Tracking, 120, &run));
        }
    }
    counts.none_is_silent("bits of the copies");
}

/// Numbers that look random, the same in every run.
struct Mixed(u64);

impl Mixed {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % limit as u64) as usize
    }
}

/// Flips at random over everything: single bits, pairs, bursts of neighbours, the same bit of words in a row, and bits
/// that are turned again in every one of some ticks. What goes on after each is followed for that number of ticks,
/// until it is as if there had been none.
fn mixed(stories: &[(Story, &[usize])], trials: usize, seed: u64, follow: usize) -> Counts {
    let mut counts = Counts::default();
    let mut mixed = Mixed(seed);
    let runs: Vec<_> = stories.iter().map(|&(story, at)| (story, at, undisturbed(story, at))).collect();
    let mut done = 0;
    for _ in 0..trials {
        let (story, at, (run, worlds)) = &runs[mixed.below(runs.len())];
        let number = mixed.below(at.len());
        let (from, world) = (at[number], &worlds[number]);
        let mut hit = world.clone();
        // As often in what is not a copy of the table as in one, and half of all in what feeds the tick, where it is
        // fed.
        let used = 32 * world.store.used_words();
        let (joint, copy) = (world.joint.bits(), 32 * (Store::WORDS + 8));
        let bits = world.bits();
        let feed = bits - world.feed.bits();
        let bit = match mixed.below(if story.is_fed() { 8 } else { 4 }) {
            0 => joint + mixed.below(used),
            1 => joint + copy + mixed.below(used),
            2 => mixed.below(joint),
            3 => joint + 2 * copy + mixed.below(feed - joint - 2 * copy),
            _ => feed + mixed.below(bits - feed),
        };
        let last = bits - 1;
        let kind = ["single", "pair", "burst", "column", "again and again"][mixed.below(5)];
        let bits: Vec<usize> = match kind {
            "pair" => std::vec![bit, (bit + 1 + mixed.below(700)).min(last)],
            "burst" => (0..2 + mixed.below(7)).map(|i| (bit + i).min(last)).collect(),
            "column" => (0..2 + mixed.below(5)).map(|i| (bit + 32 * i).min(last)).collect(),
            _ => std::vec![bit],
        };
        let times = if kind == "again and again" { 1 + mixed.below(30) } else { 1 };
        let (mut worst, mut reported) = (Fate::Harmless, false);
        for (tick, twin) in run.iter().enumerate().skip(from).take(follow) {
            if tick < from + times {
                bits.iter().for_each(|&bit| hit.flip(bit, &mut String::new()));
                done += bits.len();
            }
            let found = go_on(&mut hit, *story, tick, twin);
            let reporting = reports(&found, &hit, twin);
            reported |= reporting;
            worst = worst.max(fate(&found, reported, reporting, twin));
            if tick >= from + times && twin.world.as_ref().is_some_and(|twin| twin.is_like(&hit)) {
                break;
            }
        }
        if worst == Fate::Silent {
            let mut path = String::new();
            bits.iter().for_each(|&bit| world.clone().flip(bit, &mut path));
            std::println!("{story:?} from {from}, {times} times: {path}");
        }
        counts.add(kind, worst);
    }
    std::println!("{trials} trials, {done} flips");
    counts
}

/// Stories in which everything together feeds the tick.
fn fed() -> Vec<(Story, &'static [usize])> {
    STORIES.into_iter().filter(|(story, _)| story.is_fed()).collect()
}

#[test]
fn no_mixed_flips_are_wrong_in_silence() {
    mixed(&STORIES, 6_000, 1, 100).none_is_silent("mixed flips");
}

#[test]
fn no_mixed_flips_of_what_feeds_a_tick_are_wrong_in_silence() {
    mixed(&fed(), 20_000, 3, 250).none_is_silent("mixed flips of what feeds");
}

#[test]
#[ignore = "a million trials over everything"]
fn no_mixed_flips_of_a_million_are_wrong_in_silence() {
    let mut counts = mixed(&fed(), 700_000, 4, 250);
    for (kind, found) in mixed(&STORIES, 300_000, 2, 250).0 {
        counts.0.entry(kind).or_default().iter_mut().zip(found).for_each(|(sum, found)| *sum += found);
    }
    counts.none_is_silent("mixed flips");
}

/// Saved states cut anywhere and gone on with by another: only whole ones are taken.
#[test]
fn a_torn_saved_state_is_refused() {
    let (_, worlds) = undisturbed(Story::Tracking, &[100, 260]);
    let [a, b] = [&worlds[0], &worlds[1]].map(|world| world.state.save(&world.joint, &world.store));
    let World { joint, store, .. } = &worlds[0];
    for at in 0..=a.len() {
        let mut torn = a;
        torn[at..].copy_from_slice(&b[at..]);
        let whole = torn == a || torn == b;
        assert_eq!(JointState::restore(&torn, joint, store).is_ok(), whole, "at {at}");
        torn[at..].fill(0xff);
        assert_eq!(JointState::restore(&torn, joint, store).is_ok(), torn == a, "cut at {at}");
    }
    for bit in 0..8 * a.len() {
        let mut damaged = a;
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert!(JointState::restore(&damaged, joint, store).is_err(), "bit {bit}");
    }
}

/// A saved state is for one joint and one table.
#[test]
fn a_state_of_another_joint_or_table_is_refused() {
    use flexspline::RestoreError::{OtherJoint, OtherTable, Version};
    let (_, worlds) = undisturbed(Story::Tracking, &[100]);
    let World { joint, store, state, .. } = &worlds[0];
    let saved = state.save(joint, store);
    let other = Joint::new(fixture::drive(), fixture::LIMITS, Overrun::FadeOut { ticks: 50 }).unwrap();
    assert_eq!(JointState::restore(&saved, &other, store), Err(OtherJoint));
    let images = [fixture::image(false), fixture::image(false)];
    let mut second = Store::new();
    assert_eq!(JointState::restore(&saved, joint, &second), Err(OtherTable));
    second.activate(&Images::new(&images[0], &images[1]), &fixture::drive(), 20.0).unwrap();
    assert_eq!(JointState::restore(&saved, joint, &second), Err(OtherTable));
    assert!(matches!(
        JointState::restore(&[0; flexspline::JointState::SAVED_BYTES], joint, store),
        Err(Version { .. })
    ));
}

/// Saved springs are for one joint and one table.
#[test]
fn springs_are_restored_only_where_they_belong() {
    use flexspline::RestoreError::{Crc, OtherJoint, OtherTable, Version};
    let World { joint, store, feed, .. } = World::new();
    let (bank, mut springs) = (feed.bank, feed.springs);
    let _ = bank.update(&mut springs, OutputAngle::ZERO);
    let mut saved = [0; flexspline_estimation::saved_slip_bytes(3)];
    assert_eq!(bank.save(&springs, &joint, &store, &mut saved), Some(saved.len()));
    assert_eq!(bank.restore(&joint, &store, &saved), Ok(springs));
    let other = Joint::new(fixture::drive(), fixture::LIMITS, Overrun::SkipAndCount).unwrap();
    assert_eq!(bank.restore(&other, &store, &saved), Err(OtherJoint));
    let images = [fixture::image(false), fixture::image(false)];
    let mut second = Store::new();
    second.activate(&Images::new(&images[0], &images[1]), &fixture::drive(), 20.0).unwrap();
    assert_eq!(bank.restore(&joint, &second, &saved), Err(OtherTable));
    for bit in 0..8 * saved.len() {
        let mut damaged = saved;
        damaged[bit / 8] ^= 1 << (bit % 8);
        let expected = if bit < 32 { Version { found: *damaged.first_chunk().unwrap() } } else { Crc };
        assert_eq!(bank.restore(&joint, &store, &damaged), Err(expected), "{bit}");
    }
    bank.save(&springs, &joint, &Store::new(), &mut saved).unwrap();
    assert_eq!(bank.restore(&joint, &store, &saved), Err(OtherTable));
}

/// The order of a start: an encoder that is late by some ticks, after a reset and after a restore.
#[test]
fn the_side_stays_unknown_until_motion_has_shown_it() {
    let (run, worlds) = undisturbed(Story::Tracking, &[100]);
    for late in 0..4 {
        // After a reset: the first sample is anywhere.
        let mut world = World::new();
        for tick in 0..100 {
            let generator = (tick >= late).then_some(run[100].input.generator.unwrap());
            let input = Input { generator, ..run[100].input };
            let out = world.joint.tick(&images(), &mut world.store, &mut world.state, &input);
            if tick < late {
                assert!(out.flags.contains(Flags::NOT_CORRECTED) && out.quality == Quality::Disabled, "{out:?}");
                continue;
            }
            // The truth is on either side.
            let off = f64::from(out.transmission_error_rad - run[100].output.transmission_error_rad).abs();
            assert_eq!(out.quality, Quality::Uncertain, "{late} {tick}");
            assert!(off <= f64::from(out.uncertainty_rad) + 1e-8 && out.uncertainty_rad > 1e-5, "{off:e} {out:?}");
        }
        // After a restore: nothing is known before the sample; then where it was.
        let World { joint, mut store, state, .. } = worlds[0].clone();
        let mut restored = JointState::restore(&state.save(&joint, &store), &joint, &store).unwrap();
        restored.request(Mode::Tracking).unwrap();
        for _ in 0..late {
            let out = joint.tick(&images(), &mut store, &mut restored, &Input { generator: None, ..run[100].input });
            assert!(out.flags.contains(Flags::NOT_CORRECTED) && out.quality == Quality::Disabled, "{out:?}");
            assert!((out.correction_rad - run[99].output.correction_rad).abs() < 1e-6);
        }
        let out = joint.tick(&images(), &mut store, &mut restored, &run[100].input);
        assert_eq!(
            (out.quality, out.transmission_error_rad),
            (Quality::InRange, run[100].output.transmission_error_rad)
        );
    }
}

#[test]
fn a_first_sample_is_held_against_what_was_saved() {
    let (run, worlds) = undisturbed(Story::Tracking, &[100]);
    let World { joint, mut store, state, .. } = worlds[0].clone();
    let mut restored = JointState::restore(&state.save(&joint, &store), &joint, &store).unwrap();
    restored.request(Mode::Tracking).unwrap();
    let elsewhere = run[100].input.generator.unwrap().offset_rad(2.0);
    for tick in 0..7 {
        let input = Input { generator: Some(elsewhere), ..run[100].input };
        let out = joint.tick(&images(), &mut store, &mut restored, &input);
        // A glitch as long as one is not believed; then a new place, with the side unknown.
        let expected = if tick < 5 { Quality::Disabled } else { Quality::Uncertain };
        assert_eq!((out.flags.contains(Flags::GLITCH), out.quality), (tick < 5, expected), "{tick}");
    }
}

/// On command the side is unknown, until motion has shown it again.
#[test]
fn the_side_can_be_forgotten_on_command() {
    let (run, worlds) = undisturbed(Story::Tracking, &[120]);
    let World { joint, mut store, mut state, .. } = worlds[0].clone();
    state.forget_side();
    let quality = |out: Output| out.quality;
    let mut tick = |tick: usize| joint.tick(&images(), &mut store, &mut state, &run[tick].input);
    assert_eq!(quality(tick(120)), Quality::Uncertain);
    let last = (121..180).map(&mut tick).last().unwrap();
    assert_eq!((last.quality, last.uncertainty_rad), (Quality::InRange, 0.0));
}

/// Standing target and a noisy encoder: how often the correction crosses the play in a second, and how far off the
/// output is, ″.
fn chatter(deadband_rad: f32, noise_rad: f64, torque_n_m: f32) -> (usize, f64) {
    let limits = Limits { rate_rad_s: 0.1, acceleration_rad_s2: 20.0, deadband_rad, ..fixture::LIMITS };
    let joint = Joint::new(fixture::drive(), limits, Overrun::SkipAndCount).unwrap();
    let World { mut store, mut state, .. } = World::new();
    let (mut generator, mut noise) = (GeneratorAngle::ZERO, Mixed(3));
    let (mut changes, mut worst, mut before) = (0, 0.0f64, None);
    let mut truth = flexspline::PlayState::unknown();
    let table = flexspline::Table::check(&IMAGES[0]).unwrap();
    for tick in 0..3000 {
        let place = 1e-3 + 1e-5 * tick.min(1000) as f64;
        let part = noise.below(2001) as f64 / 1000.0 - 1.0;
        let seen = generator.offset_rad((noise_rad * part * 95.0) as f32);
        let target = OutputAngle::from_rad(place).unwrap();
        let input =
            Input { generator: Some(seen), target, torque_n_m, missed_ticks: 0, adjustment: Adjustment::default() };
        let out = joint.tick(&images(), &mut store, &mut state, &input);
        generator = out.command;
        let there = table.forward(&mut truth, generator, torque_n_m, 20.0);
        if tick >= 2000 {
            worst = worst.max(f64::from(there.output.minus_rad(target)).abs() / ARCSEC);
            // Faster than noise goes: on its way through the play.
            let way = before.map(|last: f32| out.correction_rad - last).filter(|way| way.abs() > 2e-6);
            changes += usize::from(way.is_some());
            assert!(deadband_rad == 0.0 || way.is_none(), "tick {tick}: {way:?}");
        }
        before = Some(out.correction_rad);
    }
    (changes, worst)
}

/// With noise of 0.05″ the play is crossed all the time without a band, and never with one of three times that.
#[test]
fn a_hold_band_ends_the_chatter_and_costs_no_more_than_it_says() {
    for torque in [0.0, 5.0] {
        let noise = 0.05 * ARCSEC;
        let (without, _) = chatter(0.0, noise, torque);
        let (with, worst) = chatter((3.0 * noise) as f32, noise, torque);
        std::println!(
            "{torque} N.m: {without} ticks of a second on the way through the play, {with} with a band, {worst:.3} \
             arcsec off"
        );
        assert!(without > 20 && with == 0, "{without} {with}");
        assert!(worst <= 0.15 + 0.05, "{worst}");
    }
}
