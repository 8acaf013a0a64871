//! The C interface: calls in any order with null, misaligned, uninitialised, overlapping and short arguments.
//!
//! Only what C can be kept from breaking: a pointer that is aligned and not null points to an object of its type, or to
//! one that the same call must refuse, and images have the length given.

use crate::Choices;
use crate::tables::BASES;
use flexspline_c as c;
use flexspline_c::{
    FlexsplineImages as Images, FlexsplineInput as Input, FlexsplineOutput as Output, FlexsplineSettings as Settings,
};
use std::mem::{align_of, size_of};
use std::ptr::{null, null_mut};

type Object = *mut u64;

const OK: u32 = 0;
const POINTER: u32 = 1;
const NOT_INITIALISED: u32 = 2;
const OVERLAP: u32 = 3;
/// Of no call: an activation failed at a step, and is over.
const ENDED: u32 = 99;

const STORE_WORDS: usize = 1072;
const JOINT_WORDS: usize = 32;
const STATE_WORDS: usize = 24;
/// Words of whatever else is written.
const OTHER_WORDS: usize = 24;
/// Words of the objects beside a tick, two of each: the largest is that of an activation.
const BESIDE_WORDS: usize = 88;
/// Kinds of these objects.
const BESIDE: usize = 13;
/// Records in the list of a recorder.
const RECORDS: usize = 8;
const RECORDS_WORDS: usize = RECORDS * size_of::<c::FlexsplineRecord>() / 8;
/// Bytes of a table on its way in, as words.
const BUFFER_WORDS: usize = 32;
/// Two of each object, what is written, and room for a store beyond the last.
const WORDS: usize = 2 * (STORE_WORDS + JOINT_WORDS + STATE_WORDS + BESIDE * BESIDE_WORDS)
    + 2 * OTHER_WORDS
    + RECORDS_WORDS
    + BUFFER_WORDS
    + STORE_WORDS;

/// Where things are in the memory.
struct Places {
    stores: [usize; 2],
    joints: [usize; 2],
    states: [usize; 2],
    output: usize,
    saved: usize,
    beside: usize,
    records: usize,
    buffer: usize,
}

const PLACES: Places = {
    let joints = 2 * STORE_WORDS;
    let states = joints + 2 * JOINT_WORDS;
    let output = states + 2 * STATE_WORDS;
    let beside = output + 2 * OTHER_WORDS;
    let records = beside + 2 * BESIDE * BESIDE_WORDS;
    Places {
        stores: [0, STORE_WORDS],
        joints: [joints, joints + JOINT_WORDS],
        states: [states, states + STATE_WORDS],
        output,
        saved: output + OTHER_WORDS,
        beside,
        records,
        buffer: records + RECORDS_WORDS,
    }
};

/// A pointer, and whether it is one to an object.
#[derive(Clone, Copy)]
struct Given {
    pointer: Object,
    usable: bool,
}

/// Where an answer goes, whether there is room, and whether that is inside an object.
#[derive(Clone, Copy)]
struct Answer<T> {
    pointer: *mut T,
    usable: bool,
    overlaps: bool,
}

struct Memory {
    words: Vec<u64>,
    base: Object,
}

impl Memory {
    fn new() -> Self {
        let mut words = vec![0; WORDS];
        let base = words.as_mut_ptr();
        Self { words, base }
    }

    fn at(&self, place: usize) -> Object {
        self.base.wrapping_add(place)
    }

    /// One of two objects; or null, or beside it.
    fn object(&self, choices: &mut Choices<'_>, [first, second]: [usize; 2]) -> Given {
        let right = self.at(if choices.below(6) == 0 { second } else { first });
        match choices.below(16) {
            0 => Given { pointer: null_mut(), usable: false },
            1 => Given { pointer: right.wrapping_byte_add(1 + choices.below(7)), usable: false },
            _ => Given { pointer: right, usable: true },
        }
    }

    /// An object of the kinds beside a tick, as [`Self::object`].
    fn beside(&self, choices: &mut Choices<'_>, kind: usize) -> Given {
        let first = PLACES.beside + 2 * kind * BESIDE_WORDS;
        self.object(choices, [first, first + BESIDE_WORDS])
    }

    /// Where an answer is to go: right, null, beside it, or inside an object of the call.
    fn answer<T>(&self, choices: &mut Choices<'_>, objects: &[Given]) -> Answer<T> {
        let right: *mut T = self.at(PLACES.output).cast();
        let (pointer, usable, overlaps) = match choices.below(12) {
            0 => (null_mut(), false, false),
            1 if align_of::<T>() > 1 => (right.wrapping_byte_add(1), false, false),
            2 if !objects.is_empty() => {
                let inside = objects[choices.below(objects.len())];
                (inside.pointer.wrapping_add(1).cast(), inside.usable, true)
            }
            _ => (right, true, false),
        };
        Answer { pointer, usable, overlaps }
    }

    fn copy(&self) -> Vec<u64> {
        // What lies between the fields of an object is no number to Miri.
        if cfg!(miri) {
            return Vec::new();
        }
        // Through the pointer that the calls write through.
        (0..WORDS).map(|i| unsafe { self.at(i).read() }).collect()
    }
}

impl Choices<'_> {
    /// The usual number, or now and then any.
    fn mostly(&mut self, usual: f32) -> f32 {
        if self.below(4) == 0 { self.wild() } else { usual }
    }
}

/// A pointer to a structure; or null, or beside it.
fn plain<T>(choices: &mut Choices<'_>, value: &[T; 2]) -> (*const T, bool) {
    let right: *const T = value.as_ptr();
    match choices.below(20) {
        0 => (null(), false),
        1 => (right.wrapping_byte_add(1), false),
        _ => (right, true),
    }
}

fn any_settings(choices: &mut Choices<'_>) -> Settings {
    let mut settings = Settings {
        flexspline_teeth: 188,
        circular_spline_teeth: 190,
        fixed_member: 0,
        overrun: choices.below(3) as u8,
        fade_ticks: 1 + choices.any::<u8>() as u16,
        patience: 3,
        tick_s: 1e-3,
        rate_rad_s: 0.05,
        acceleration_rad_s2: 5.0,
        generator_rate_rad_s: 600.0,
        hold_rad: 0.0,
    };
    match choices.below(12) {
        1 => [settings.flexspline_teeth, settings.circular_spline_teeth] = choices.any(),
        2 => settings.fixed_member = choices.any(),
        3 => settings.overrun = choices.any(),
        4 => settings.fade_ticks = 0,
        5 => settings.tick_s = choices.wild(),
        6 => settings.rate_rad_s = choices.wild(),
        7 => settings.acceleration_rad_s2 = choices.wild(),
        8 => settings.generator_rate_rad_s = choices.wild(),
        9 => settings.hold_rad = choices.wild(),
        _ => {}
    }
    settings
}

/// Two images, the second now and then the first: sound, hostile, short, at odd addresses. The bytes go into `kept`.
fn any_images(choices: &mut Choices<'_>, kept: &mut Vec<Vec<u8>>) -> (Images, bool) {
    let mut one = |choices: &mut Choices<'_>| {
        let mut image = BASES[choices.below(3)].clone();
        if choices.below(6) == 1 {
            let at = choices.below(image.len());
            image[at] ^= 1 << choices.below(8);
        }
        let shift = choices.below(4);
        let length = match choices.below(12) {
            1 => choices.below(image.len()),
            2 => 0,
            3 => usize::MAX - choices.below(3),
            _ => image.len(),
        };
        let lies = length > image.len();
        let mut shifted = vec![0; shift];
        shifted.append(&mut image);
        kept.push(shifted);
        let bytes = kept.last().expect("just pushed");
        let pointer = if choices.below(16) == 1 { null() } else { bytes.as_ptr().wrapping_add(shift) };
        (pointer, length, !lies && !pointer.is_null())
    };
    let first = one(choices);
    let mut twin = |choices: &mut Choices<'_>| {
        let image = BASES[choices.below(3)].clone();
        kept.push(image);
        let bytes = kept.last().expect("just pushed");
        (bytes.as_ptr(), bytes.len(), true)
    };
    let second = match choices.below(8) {
        0 => first,
        _ => twin(choices),
    };
    let images = Images { first: first.0, first_bytes: first.1, second: second.0, second_bytes: second.1 };
    (images, first.2 && second.2)
}

/// Objects for every call next to a tick.
struct Objects {
    store: Given,
    joint: Given,
    state: Given,
    tables: *const Images,
    tables_usable: bool,
}

const START_UP: c::FlexsplineStartUpSettings =
    c::FlexsplineStartUpSettings { way_rad: 20.0, output_error_rad: 1e-3, drag_n_m: 1.0, ticks: 8 };

/// Makes one of each object beside a tick, so that what is chosen then finds them.
fn begin_beside(memory: &Memory) {
    let at = |kind: usize| memory.at(PLACES.beside + 2 * kind * BESIDE_WORDS);
    let term = |term, order| c::FlexsplineCoefficient { limit: 1e-4, initial_std: 5e-5, term, order };
    let terms = [term(0, 0), term(1, 0), term(2, 0), term(3, 2), term(4, 2)];
    let learn = c::FlexsplineLearnSettings {
        noise_rad: 2e-6,
        memory_measurements: 100.0,
        gate: 5.0,
        settle_rad: 1e-5,
        torque_limit_n_m: 20.0,
    };
    let springs = [c::FlexsplineSpring { width: 1e-4, gain: 0.1 }; 3];
    let torque = c::FlexsplineTorqueSettings {
        tick_s: 1e-3,
        bandwidth_hz: 20.0,
        drag_n_m: 0.5,
        table_drag_n_m: 0.1,
        hold_n_m: 0.1,
    };
    let counts = c::FlexsplineEncoderSettings { zero_counts: 0, counts_per_turn: 20_000, wrap_bits: 16, reversed: 0 };
    let begun = [
        c::flexspline_learner_init(at(0).cast(), &learn, terms.as_ptr(), 5),
        c::flexspline_learner_set(at(0).cast(), c::FLEXSPLINE_LEARNING_ON),
        c::flexspline_slip_init(at(1).cast(), c::FLEXSPLINE_SLIP_OF_TORQUE, springs.as_ptr(), 3),
        c::flexspline_torque_init(at(2).cast(), &torque),
        c::flexspline_aged_init(at(3).cast(), 3),
        c::flexspline_encoder_init(at(4).cast(), &counts),
        c::flexspline_encoder_start(at(4).cast(), 7, 0),
        c::flexspline_recorder_init(at(5).cast(), 4, 1, 0, c::FLEXSPLINE_FULL_LOSE_OLDEST),
        c::flexspline_predictor_init(at(6).cast(), &*PARTS),
        c::flexspline_observer_init(at(7).cast()),
        c::flexspline_upload_begin(at(8).cast(), 8 * BUFFER_WORDS),
        c::flexspline_watch_init(at(9).cast()),
        c::flexspline_activation_begin(at(10).cast(), memory.at(PLACES.joints[0]).cast(), 20.0),
        c::flexspline_identity_begin(at(11).cast()),
        c::flexspline_start_up_init(at(12).cast(), memory.at(PLACES.joints[0]).cast(), 0, &START_UP),
    ];
    assert!(begun.iter().all(|begun| *begun as u32 == OK), "{begun:?}");
}

/// A text of the library: within it, and not for ever.
fn is_text(text: *const std::ffi::c_char) -> bool {
    // SAFETY: static, and ends.
    let text = unsafe { std::ffi::CStr::from_ptr(text) };
    (1..60).contains(&text.to_bytes().len())
}

/// Of a call of these objects that answers: its result, whether all its arguments can be used, and whether something
/// overlaps.
fn answered<T>(status: c::FlexsplineStatus, objects: &[Given], to: Answer<T>) -> (u32, bool, bool) {
    (status as u32, objects.iter().all(|object| object.usable) && to.usable, to.overlaps)
}

/// A call next to a tick: its result, whether all its arguments can be used, and whether something overlaps.
fn beside(choices: &mut Choices<'_>, memory: &Memory, o: &Objects) -> (u32, bool, bool) {
    let [learner, slip, path, aged, encoder, recorder] = [0, 1, 2, 3, 4, 5].map(|kind| memory.beside(choices, kind));
    let [predictor, observer, upload, watch, activation, identity] =
        [6, 7, 8, 9, 10, 11].map(|kind| memory.beside(choices, kind));
    let start_up = memory.beside(choices, 12);
    let (store, joint, state) = (o.store, o.joint, o.state);
    let (joint_at, store_at, state_at) = (joint.pointer.cast(), store.pointer.cast(), state.pointer.cast());
    let all = |objects: &[Given]| objects.iter().all(|object| object.usable);
    // Of a call that writes nothing but its objects.
    let done = |status: c::FlexsplineStatus, objects: &[Given]| (status as u32, all(objects), false);
    let records: *mut c::FlexsplineRecord = memory.at(PLACES.records).cast();
    let buffer: *mut u8 = memory.at(PLACES.buffer).cast();
    let output = [Output {
        command_counts: choices.any(),
        output_counts: choices.any(),
        transmission_error_rad: choices.wild(),
        uncertainty_rad: choices.wild(),
        correction_rad: choices.wild(),
        held_back_rad: choices.wild(),
        quality: choices.below(6) as u8,
        flags: choices.any(),
    }; 2];
    let (output, output_usable) = plain(choices, &output);
    let number = choices.below(10) as u8;
    match choices.below(50) {
        0 => {
            let settings = [c::FlexsplineLearnSettings {
                noise_rad: choices.mostly(2e-6),
                memory_measurements: choices.mostly(100.0),
                gate: choices.mostly(5.0),
                settle_rad: 1e-5,
                torque_limit_n_m: choices.mostly(20.0),
            }; 2];
            let (settings, plain_ok) = plain(choices, &settings);
            let mut list = [c::FlexsplineCoefficient { limit: 1e-4, initial_std: 1e-5, term: 0, order: 0 }; 16];
            for one in &mut list {
                one.term = choices.below(6) as u8;
                one.order = if one.term > 2 || choices.below(16) == 0 { choices.any() } else { 0 };
                if choices.below(16) == 0 {
                    one.limit = choices.wild();
                }
            }
            let status = c::flexspline_learner_init(learner.pointer.cast(), settings, list.as_ptr(), number);
            (status as u32, learner.usable && plain_ok, false)
        }
        1 => done(c::flexspline_learner_set(learner.pointer.cast(), choices.below(4) as u8), &[learner]),
        2 if choices.any() => done(c::flexspline_learner_reset(learner.pointer.cast()), &[learner]),
        2 => done(
            c::flexspline_learner_bind(learner.pointer.cast(), joint_at, store_at, choices.any()),
            &[learner, joint, store],
        ),
        3..=6 => {
            let input = [Input {
                generator_counts: choices.any::<i32>().into(),
                target_counts: 0,
                torque_n_m: choices.wild(),
                missed_ticks: 0,
                has_generator: choices.below(4) as u8,
                mean_counts: choices.any(),
                half_width_counts: choices.any(),
            }; 2];
            let (input, plain_ok) = plain(choices, &input);
            let to = memory.answer::<c::FlexsplineAdapted>(choices, &[learner, state]);
            let (has, measured) = (choices.below(4) as u8, choices.any::<i32>().into());
            let learner_at = learner.pointer.cast();
            let status = c::flexspline_learner_update(learner_at, state_at, input, output, has, measured, to.pointer);
            if status as u32 == OK {
                let found = unsafe { to.pointer.read() };
                let most = 1 << 25;
                assert!(found.mean_counts.abs() < most && found.half_width_counts.abs() < most, "{found:?}");
                assert!(found.uncertainty_rad >= 0.0 && found.verdict <= 6, "{found:?}");
            }
            (status as u32, all(&[learner, state]) && plain_ok && output_usable && to.usable, to.overlaps)
        }
        7 => {
            let to = memory.answer(choices, &[learner]);
            answered(c::flexspline_learner_coefficient(learner.pointer.cast(), number, to.pointer), &[learner], to)
        }
        8 => {
            let to = memory.answer(choices, &[learner]);
            answered(c::flexspline_learner_report(learner.pointer.cast(), to.pointer), &[learner], to)
        }
        9 | 10 => {
            let (of, call) = if choices.any() { (learner, 0) } else { (slip, 1) };
            let to = memory.answer(choices, &[of]);
            let saved: *mut u8 = memory.at(PLACES.saved).cast();
            let room = choices.below(8 * OTHER_WORDS);
            let status = match call {
                0 => c::flexspline_learner_save(of.pointer.cast(), saved, room, to.pointer),
                _ => c::flexspline_slip_save(of.pointer.cast(), saved, room, to.pointer),
            };
            (status as u32, of.usable && to.usable, to.overlaps)
        }
        11 => {
            let saved: *const u8 = memory.at(PLACES.saved).cast::<u8>().cast_const();
            let length = choices.below(8 * OTHER_WORDS);
            match choices.any() {
                true => done(c::flexspline_learner_restore(learner.pointer.cast(), saved, length), &[learner]),
                false => done(c::flexspline_slip_restore(slip.pointer.cast(), saved, length), &[slip]),
            }
        }
        12 => {
            let mut list = [c::FlexsplineSpring { width: 1e-4, gain: 0.1 }; 16];
            for one in &mut list {
                if choices.below(16) == 0 {
                    (one.width, one.gain) = (choices.wild(), choices.wild());
                }
            }
            let variable = choices.below(3) as u8;
            done(c::flexspline_slip_init(slip.pointer.cast(), variable, list.as_ptr(), number), &[slip])
        }
        13 => done(c::flexspline_slip_set(slip.pointer.cast(), choices.below(3) as u8), &[slip]),
        14..=16 => {
            let to = memory.answer::<c::FlexsplineSlipReport>(choices, &[slip]);
            let status = match choices.any() {
                true => c::flexspline_slip_update(slip.pointer.cast(), choices.any(), to.pointer),
                false => c::flexspline_slip_update_torque(slip.pointer.cast(), choices.wild(), to.pointer),
            };
            if status as u32 == OK {
                let found = unsafe { to.pointer.read() };
                assert!(found.mean_counts.abs() < 1 << 25 && found.is_known <= 1, "{found:?}");
            }
            (status as u32, slip.usable && to.usable, to.overlaps)
        }
        17 => {
            let settings = [c::FlexsplineTorqueSettings {
                tick_s: choices.mostly(1e-3),
                bandwidth_hz: choices.mostly(20.0),
                drag_n_m: choices.mostly(0.5),
                table_drag_n_m: 0.1,
                hold_n_m: 0.1,
            }; 2];
            let (settings, plain_ok) = plain(choices, &settings);
            let [settle, largest] = [0.05, 100.0].map(|usual| choices.mostly(usual));
            let made = if choices.below(2) == 0 {
                c::flexspline_torque_init(path.pointer.cast(), settings)
            } else {
                c::flexspline_torque_init_sensor(path.pointer.cast(), settings, settle, largest)
            };
            (made as u32, path.usable && plain_ok, false)
        }
        18 => {
            let to = memory.answer(choices, &[path]);
            let (place, direction) = (choices.below(3) as u8, choices.below(3) as i8 - 1);
            answered(
                c::flexspline_torque_tick(path.pointer.cast(), place, choices.wild(), direction, to.pointer),
                &[path],
                to,
            )
        }
        19 => done(c::flexspline_aged_init(aged.pointer.cast(), choices.any()), &[aged]),
        20 => {
            let to = memory.answer(choices, &[aged]);
            let status =
                c::flexspline_aged_tick(aged.pointer.cast(), choices.below(3) as u8, choices.wild(), to.pointer);
            (status as u32, aged.usable && to.usable, to.overlaps)
        }
        21 => {
            let to = memory.answer(choices, &[aged]);
            answered(c::flexspline_aged_is_stale(aged.pointer.cast(), to.pointer), &[aged], to)
        }
        22 => {
            let settings = [c::FlexsplineEncoderSettings {
                zero_counts: choices.any(),
                counts_per_turn: if choices.any() { 20_000 } else { choices.any() },
                wrap_bits: choices.below(70) as u8,
                reversed: choices.below(3) as u8,
            }; 2];
            let (settings, plain_ok) = plain(choices, &settings);
            (c::flexspline_encoder_init(encoder.pointer.cast(), settings) as u32, encoder.usable && plain_ok, false)
        }
        23 => {
            let reading = if choices.any() { choices.any::<u16>().into() } else { choices.any() };
            done(c::flexspline_encoder_start(encoder.pointer.cast(), reading, choices.any()), &[encoder])
        }
        24 => {
            let to = memory.answer(choices, &[joint, state, encoder]);
            let reading = if choices.any() { choices.any::<u16>().into() } else { choices.any() };
            let (of, at) = ((joint_at, state_at), encoder.pointer.cast());
            answered(c::flexspline_joint_read(of.0, of.1, at, reading, to.pointer), &[joint, state, encoder], to)
        }
        25 => {
            let to = memory.answer(choices, &[encoder]);
            let reading = if choices.any() { choices.any::<u16>().into() } else { choices.any() };
            answered(c::flexspline_encoder_read(encoder.pointer.cast(), reading, to.pointer), &[encoder], to)
        }
        26 => {
            let to = memory.answer(choices, &[encoder]);
            answered(c::flexspline_encoder_reading(encoder.pointer.cast(), choices.any(), to.pointer), &[encoder], to)
        }
        27 => {
            let (places, offset) = (choices.below(RECORDS + 1) as u16, choices.below(3) as u32);
            let (divisor, full) = (choices.below(4) as u32, choices.below(3) as u8);
            done(c::flexspline_recorder_init(recorder.pointer.cast(), places, divisor, offset, full), &[recorder])
        }
        28 | 29 => {
            let inside = choices.below(8) == 0;
            let list = if inside { state_at.cast() } else { records };
            let [store, state, recorder] = [store, state, recorder];
            let status = c::flexspline_recorder_see(
                recorder.pointer.cast(),
                list,
                choices.any(),
                choices.below(2) as u8,
                state_at,
                store_at,
                output,
            );
            (status as u32, all(&[store, state, recorder]) && output_usable, inside)
        }
        30 => {
            let to = memory.answer(choices, &[recorder]);
            let is_taken: *mut u8 = memory.at(PLACES.saved).cast();
            answered(
                c::flexspline_recorder_take(recorder.pointer.cast(), records, to.pointer, is_taken),
                &[recorder],
                to,
            )
        }
        31 => {
            let (from, to) = (memory.at(PLACES.saved), memory.answer(choices, &[]));
            match choices.any() {
                true => answered(c::flexspline_record_encode(from.cast(), to.pointer), &[], to),
                false => {
                    let to = memory.answer(choices, &[]);
                    answered(c::flexspline_record_decode(from.cast(), to.pointer), &[], to)
                }
            }
        }
        32 => {
            let to = memory.answer::<[u8; c::FLEXSPLINE_RECORD_BYTES]>(choices, &[state, store]);
            let status = c::flexspline_record(choices.any(), 1, 0, state_at, store_at, output, to.pointer);
            (status as u32, all(&[state, store]) && output_usable && to.usable, to.overlaps)
        }
        33 => match choices.any() {
            true => done(c::flexspline_watch_init(watch.pointer.cast()), &[watch]),
            false => {
                let to = memory.answer(choices, &[watch, state, store]);
                let status = c::flexspline_watch_see(watch.pointer.cast(), state_at, store_at, output, to.pointer);
                (status as u32, all(&[watch, state, store]) && output_usable && to.usable, to.overlaps)
            }
        },
        34 => {
            // The numbers of a sound predictor, now and then one of them another; finding the gains takes too long for
            // a fuzzer.
            let mut parts = [*PARTS; 2];
            if choices.any() {
                parts[0][choices.below(PARTS.len())] = choices.wild();
            }
            let (parts, plain_ok) = plain(choices, &parts);
            (c::flexspline_predictor_init(predictor.pointer.cast(), parts) as u32, predictor.usable && plain_ok, false)
        }
        35 => match choices.any() {
            true => done(c::flexspline_observer_init(observer.pointer.cast()), &[observer]),
            false => {
                let to = memory.answer(choices, &[observer]);
                answered(c::flexspline_observer_report(observer.pointer.cast(), to.pointer), &[observer], to)
            }
        },
        36 => {
            let measured = [c::FlexsplineMeasured {
                torque_n_m: choices.wild(),
                speed_rad_s: choices.wild(),
                twist_rad: choices.wild(),
            }; 2];
            let (measured, plain_ok) = plain(choices, &measured);
            let status = c::flexspline_observer_step(observer.pointer.cast(), predictor.pointer.cast(), measured);
            (status as u32, all(&[observer, predictor]) && plain_ok, false)
        }
        37 => {
            let now = [c::FlexsplineNow {
                generator_counts: choices.any(),
                measured_counts: choices.any(),
                measured_bound_rad: choices.wild(),
                torque_n_m: choices.wild(),
                torque_off_n_m: choices.wild(),
                load_change_n_m: choices.wild(),
                state_bound: [choices.wild(), 1e-4, choices.wild(), 0.1],
                ticks: choices.below(30) as u16,
                has_measured: choices.below(3) as u8,
            }; 2];
            let (now, plain_ok) = plain(choices, &now);
            let to = memory.answer(choices, &[predictor, observer, joint, store, state]);
            let status = c::flexspline_predict(
                predictor.pointer.cast(),
                observer.pointer.cast(),
                joint_at,
                store_at,
                state_at,
                now,
                to.pointer,
            );
            (status as u32, all(&[predictor, observer, joint, store, state]) && plain_ok && to.usable, to.overlaps)
        }
        38 => {
            let to = memory.answer(choices, &[predictor]);
            answered(c::flexspline_predictor_parts(predictor.pointer.cast(), to.pointer), &[predictor], to)
        }
        39 if choices.any() => {
            let objects = [joint, store];
            let to = memory.answer::<c::FlexsplineLocated>(choices, &objects);
            let [off, torque, torque_off] = [1e-5, 5.0, 2.0].map(|usual| choices.mostly(usual));
            let status =
                c::flexspline_joint_locate(joint_at, store_at, choices.any(), off, torque, torque_off, to.pointer);
            if status as u32 == OK {
                let found = unsafe { to.pointer.read() };
                assert!(found.half_width_rad >= 0.0 && (found.turns == 0) == (found.quality == 3), "{found:?}");
            }
            answered(status, &objects, to)
        }
        40 if choices.any() => {
            let objects = [joint, store, state];
            let to = memory.answer::<c::FlexsplineTorqueFromWindUp>(choices, &objects);
            let (way, generator, output) = (choices.below(5) as i8 - 2, choices.any(), choices.any::<i32>().into());
            let (off, none) = (choices.mostly(1e-5), null());
            let torque = c::flexspline_joint_torque;
            let status = torque(joint_at, store_at, state_at, none, way, generator, output, off, to.pointer);
            if status as u32 == OK {
                let found = unsafe { to.pointer.read() };
                assert!(found.low_n_m <= found.high_n_m && found.quality <= 3, "{found:?}");
                assert!(found.torque_n_m.is_finite() == (found.quality != 3), "{found:?}");
            }
            answered(status, &objects, to)
        }
        39 => {
            let to = memory.answer(choices, &[joint, store, state]);
            let torque = choices.wild();
            answered(
                c::flexspline_forward(joint_at, store_at, state_at, choices.any(), torque, to.pointer),
                &[joint, store, state],
                to,
            )
        }
        40 => {
            let to = memory.answer(choices, &[joint, store, state]);
            let (target, torque, way) = (choices.any(), choices.wild(), choices.below(5) as i8 - 2);
            answered(
                c::flexspline_inverse(joint_at, store_at, state_at, target, torque, way, to.pointer),
                &[joint, store, state],
                to,
            )
        }
        41 => {
            let objects = [joint, store];
            let to = memory.answer(choices, &objects);
            let (rate, torque, ahead) = (choices.wild(), choices.wild(), choices.wild());
            let target = choices.any();
            let status = if choices.below(2) == 0 {
                c::flexspline_rate_ahead(joint_at, store_at, target, rate, torque, ahead, to.pointer)
            } else {
                let faster = choices.wild();
                c::flexspline_motion_ahead(joint_at, store_at, target, rate, faster, torque, ahead, to.pointer.cast())
            };
            (status as u32, all(&objects) && to.usable, to.overlaps)
        }
        42 => {
            let to = memory.answer(choices, &[joint]);
            let status = match choices.below(4) {
                0 => c::flexspline_nominal_output(joint_at, choices.any(), to.pointer),
                1 => c::flexspline_nominal_generator(joint_at, choices.any(), to.pointer),
                2 => {
                    let to = memory.answer(choices, &[joint]);
                    return answered(c::flexspline_ratio(joint_at, to.pointer), &[joint], to);
                }
                _ => {
                    let to = memory.answer(choices, &[state]);
                    let status = c::flexspline_state_play(state_at, to.pointer);
                    return (status as u32, state.usable && to.usable, to.overlaps);
                }
            };
            (status as u32, joint.usable && to.usable, to.overlaps)
        }
        43 => {
            let to = memory.answer::<u8>(choices, &[activation, store]);
            if choices.below(16) == 0 {
                let temperature = choices.wild();
                let begun = c::flexspline_activation_begin(activation.pointer.cast(), joint_at, temperature);
                return (begun as u32, all(&[activation, joint]), false);
            }
            let usable = all(&[activation, store]) && to.usable && o.tables_usable;
            let activation_at = activation.pointer.cast();
            let mut status = 0;
            // Far enough to fill the store now and then.
            for _ in 0..1 + 40 * choices.below(16) {
                status = c::flexspline_activation_step(activation_at, store_at, o.tables.cast(), to.pointer) as u32;
                if status != OK {
                    break;
                }
            }
            // A step that fails ends the activation, and what was done before it stays.
            let refused_at_once = [POINTER, NOT_INITIALISED, OVERLAP].contains(&status);
            (
                if status != OK && !refused_at_once && usable && !to.overlaps { ENDED } else { status },
                usable,
                to.overlaps,
            )
        }
        44 => match choices.below(4) {
            0 => done(c::flexspline_identity_begin(identity.pointer.cast()), &[identity]),
            1 => {
                let to = memory.answer(choices, &[identity]);
                let image = &BASES[choices.below(3)];
                let length = choices.below(image.len() + 1);
                answered(
                    c::flexspline_identity_step(identity.pointer.cast(), image.as_ptr(), length, to.pointer),
                    &[identity],
                    to,
                )
            }
            2 => {
                let to = memory.answer(choices, &[]);
                let image = &BASES[choices.below(3)];
                let length = if choices.any() { image.len() } else { choices.below(image.len()) };
                let status = if choices.any() {
                    c::flexspline_image_report(image.as_ptr(), length, to.pointer)
                } else {
                    c::flexspline_image_sheet_scatter(image.as_ptr(), length, to.pointer.cast())
                };
                (status as u32, to.usable, false)
            }
            _ => {
                let (length, page) = (choices.below(8 * BUFFER_WORDS + 1), choices.below(40) as u8);
                let image = choices.below(3) as u8;
                let good = &BASES[0];
                let status = c::flexspline_store_mend_page(store_at, buffer, good.as_ptr(), length, image, page);
                (status as u32, store.usable, false)
            }
        },
        45 => {
            let settings = [c::FlexsplineStartUpSettings {
                way_rad: choices.mostly(20.0),
                drag_n_m: choices.mostly(1.0),
                ticks: if choices.below(4) == 0 { choices.any() } else { 8 },
                ..START_UP
            }; 2];
            let (settings, plain_ok) = plain(choices, &settings);
            let (at, from) = (start_up.pointer.cast(), choices.any());
            let status = c::flexspline_start_up_init(at, joint_at, from, settings);
            (status as u32, all(&[start_up, joint]) && plain_ok, false)
        }
        46 => {
            let readings = [c::FlexsplineReadings {
                generator_counts: choices.any(),
                output_counts: choices.any(),
                torque_n_m: choices.wild(),
                has_generator: choices.below(3) as u8,
                has_output: choices.below(3) as u8,
                has_torque: choices.below(3) as u8,
            }; 2];
            let (readings, plain_ok) = plain(choices, &readings);
            let to = memory.answer::<c::FlexsplineStartUpStep>(choices, &[start_up]);
            let status = c::flexspline_start_up_step(start_up.pointer.cast(), readings, to.pointer);
            (status as u32, start_up.usable && to.usable && plain_ok, to.overlaps)
        }
        47 => {
            let saved: *mut u8 = memory.at(PLACES.saved).cast();
            let room = choices.below(8 * OTHER_WORDS);
            let slip_at = slip.pointer.cast();
            if choices.any() {
                let status = c::flexspline_slip_restore_for(slip_at, joint_at, store_at, saved, room);
                return (status as u32, all(&[slip, joint, store]), false);
            }
            let to = memory.answer(choices, &[slip, joint, store]);
            answered(
                c::flexspline_slip_save_for(slip_at, joint_at, store_at, saved, room, to.pointer),
                &[slip, joint, store],
                to,
            )
        }
        48 => {
            let jump = if choices.any() { 5.0 } else { choices.wild() };
            done(c::flexspline_torque_set_sensor(path.pointer.cast(), jump, choices.any()), &[path])
        }
        _ => {
            let announced = choices.below(8 * BUFFER_WORDS + 20);
            match choices.below(6) {
                0 => done(c::flexspline_upload_begin(upload.pointer.cast(), announced), &[upload]),
                1 | 2 => {
                    let (offset, length) = (choices.below(40), choices.below(40));
                    let chunk = BASES[0].as_ptr();
                    let upload_at = upload.pointer.cast();
                    done(
                        c::flexspline_upload_chunk(upload_at, buffer, 8 * BUFFER_WORDS, offset, chunk, length),
                        &[upload],
                    )
                }
                3 => {
                    let to = memory.answer(choices, &[upload]);
                    let status =
                        c::flexspline_upload_finish(upload.pointer.cast(), buffer, 8 * BUFFER_WORDS, to.pointer);
                    (status as u32, upload.usable && to.usable, to.overlaps)
                }
                4 => {
                    let input: *mut c::FlexsplineInput = memory.at(PLACES.output).cast();
                    let status = match choices.any() {
                        true => c::flexspline_input_add(input, choices.any(), choices.any()),
                        false => c::flexspline_input_add_rad(input, choices.wild(), choices.wild()),
                    };
                    let found = unsafe { input.read() };
                    assert!(found.mean_counts.abs() < 1 << 25 && found.half_width_counts.abs() < 1 << 25);
                    (status as u32, true, false)
                }
                _ => {
                    let (code, bits) = (choices.any::<u8>(), choices.any::<u16>());
                    let names = [
                        c::flexspline_mode_name,
                        c::flexspline_quality_name,
                        c::flexspline_health_name,
                        c::flexspline_overrun_name,
                        c::flexspline_fixed_member_name,
                        c::flexspline_generator_name,
                        c::flexspline_progress_name,
                        c::flexspline_identity_name,
                        c::flexspline_learning_name,
                        c::flexspline_verdict_name,
                        c::flexspline_term_name,
                    ];
                    assert!(names.iter().all(|name| is_text(name(code))));
                    assert!(is_text(c::flexspline_flag_name(bits)) && is_text(c::flexspline_event_name(bits)));
                    assert!(is_text(c::flexspline_implausible_name(bits)));
                    assert!(is_text(c::flexspline_status_text(choices.any())) && is_text(c::flexspline_version()));
                    assert!(c::flexspline_mode_may_become(code, code) <= 1 && c::flexspline_is_due(7, 3, 1) == 1);
                    assert!(c::flexspline_version_number() > 0 && c::flexspline_layout() != 0);
                    assert!(c::flexspline_format_version() > 0);
                    let (from, to) = (choices.any(), choices.any());
                    assert!(c::flexspline_rad_between(from, to).abs() < 3.15);
                    assert!(c::flexspline_rad_from_counts(from).is_finite());
                    let answer = memory.answer(choices, &[]);
                    let rad = f64::from(choices.wild());
                    answered(c::flexspline_counts_from_rad(rad, answer.pointer), &[], answer)
                }
            }
        }
    }
}

/// Numbers of a predictor.
static PARTS: std::sync::LazyLock<[f32; c::FLEXSPLINE_PREDICTOR_PARTS]> = std::sync::LazyLock::new(|| {
    // To find gains takes too long in an interpreter: there one whose state halves in a tick, but for the torque on the
    // load, which stays, is seen in the twist and corrected by it.
    if cfg!(miri) {
        let mut parts = [0.0; c::FLEXSPLINE_PREDICTOR_PARTS];
        let (twist_by_load, load_stays, load_by_twist) = (12, 15, 27);
        [0, 5, 10, load_by_twist].iter().for_each(|place| parts[*place] = 0.5);
        [twist_by_load, load_stays].iter().for_each(|place| parts[*place] = 1.0);
        parts[c::FLEXSPLINE_PREDICTOR_PARTS - 1] = 3e4;
        return parts;
    }
    let mut room = vec![0u64; BESIDE_WORDS];
    let inertias = c::FlexsplineInertias {
        motor_kg_m2: 1.0,
        load_kg_m2: 3.0,
        stiffness_n_m_per_rad: 3e4,
        damping_n_m_s_per_rad: 20.0,
    };
    let noise =
        c::FlexsplineNoise { torque_n_m: 0.5, load_change_n_m: 0.2, speed_rad_s: 1e-4, twist_rad: 1e-6, has_twist: 1 };
    let at = room.as_mut_ptr();
    let (mut parts, mut bound) = ([0.0; c::FLEXSPLINE_PREDICTOR_PARTS], [0.0; 4]);
    assert_eq!(c::flexspline_predictor_of(at.cast(), &inertias, &noise, 1e-3) as u32, OK);
    assert_eq!(c::flexspline_predictor_parts(at.cast(), &mut parts) as u32, OK);
    let off = c::FlexsplineDisturbance { torque_n_m: 0.5, load_change_n_m: 0.05, speed_rad_s: 1e-4, twist_rad: 1e-6 };
    assert_eq!(c::flexspline_predictor_state_bound(at.cast(), &off, &mut bound) as u32, OK);
    assert!(bound.iter().all(|bound| *bound > 0.0));
    assert_eq!(c::flexspline_self_test() as u32, OK);
    parts
});

/// Any calls.
pub fn run(data: &[u8]) {
    let mut choices = Choices::new(data);
    let memory = Memory::new();
    // Half of the runs begin with what a firmware begins with.
    if choices.any() {
        let settings = any_settings(&mut Choices::new(&[]));
        let [store, joint, state] = [PLACES.stores, PLACES.joints, PLACES.states].map(|places| memory.at(places[0]));
        assert_eq!(c::flexspline_store_init(store.cast()) as u32, OK);
        assert_eq!(c::flexspline_joint_init(joint.cast(), &settings) as u32, OK);
        assert_eq!(c::flexspline_state_init(state.cast()) as u32, OK);
        begin_beside(&memory);
    }
    let mut kept = Vec::new();
    let (mut table, mut table_usable) = any_images(&mut Choices::new(&[]), &mut kept);
    for _ in 0..200 {
        if choices.is_empty() {
            break;
        }
        if choices.below(8) == 0 {
            kept.clear();
            (table, table_usable) = any_images(&mut choices, &mut kept);
        }
        let store = memory.object(&mut choices, PLACES.stores);
        let joint = memory.object(&mut choices, PLACES.joints);
        let state = memory.object(&mut choices, PLACES.states);
        let (joint_at, store_at, state_at) = (joint.pointer.cast(), store.pointer.cast(), state.pointer.cast());
        let tables = [table; 2];
        let (tables, plain_ok) = plain(&mut choices, &tables);
        let before = memory.copy();
        let temperature = choices.wild();
        // SAFETY of the calls: every pointer that is aligned and not null points into the memory, or to what is kept.
        let mut loose = false;
        let (status, usable, refused) = match choices.below(18) {
            0 => (c::flexspline_store_init(store_at) as u32, store.usable, false),
            1 => {
                let settings = [any_settings(&mut choices); 2];
                let (settings, plain_ok) = plain(&mut choices, &settings);
                (c::flexspline_joint_init(joint_at, settings) as u32, joint.usable && plain_ok, false)
            }
            2 => (c::flexspline_state_init(state_at) as u32, state.usable, false),
            3 | 4 => {
                let status = c::flexspline_store_activate(store_at, joint_at, tables, temperature) as u32;
                (status, store.usable && joint.usable && plain_ok && table_usable, false)
            }
            5 => {
                let status = c::flexspline_store_set_temperature(store_at, tables, temperature) as u32;
                (status, store.usable && plain_ok && table_usable, false)
            }
            6 => {
                let status = c::flexspline_store_check_images(store_at, tables, choices.below(2000) as u16) as u32;
                (status, store.usable && plain_ok && table_usable, false)
            }
            7 => (c::flexspline_state_request(state_at, choices.below(6) as u8) as u32, state.usable, false),
            8 => {
                let inside = choices.below(4) == 0;
                let saved =
                    if inside { state.pointer.wrapping_byte_add(choices.below(180)) } else { memory.at(PLACES.saved) };
                let saved = if choices.below(12) == 0 { null_mut() } else { saved.cast::<u8>() };
                let status = c::flexspline_state_save(state_at, joint_at, store_at, saved.cast()) as u32;
                (status, state.usable && joint.usable && store.usable && !saved.is_null(), inside && !saved.is_null())
            }
            9 => {
                let inside = choices.below(4) == 0;
                let saved =
                    if inside { state.pointer.wrapping_byte_add(choices.below(180)) } else { memory.at(PLACES.saved) };
                let saved = if choices.below(12) == 0 { null() } else { saved.cast::<u8>().cast_const() };
                let status = c::flexspline_state_restore(state_at, joint_at, store_at, saved.cast()) as u32;
                (status, state.usable && joint.usable && store.usable && !saved.is_null(), inside && !saved.is_null())
            }
            10 => (c::flexspline_state_forget_side(state_at) as u32, state.usable, false),
            11 => (c::flexspline_joint_mend(joint_at) as u32, joint.usable, false),
            12 => {
                let status = c::flexspline_state_report(state_at, memory.at(PLACES.saved).cast()) as u32;
                (status, state.usable, false)
            }
            13 => {
                let status = c::flexspline_store_report(store_at, memory.at(PLACES.saved).cast()) as u32;
                (status, store.usable, false)
            }
            16 | 17 => {
                loose = true;
                let objects = Objects { store, joint, state, tables, tables_usable: plain_ok && table_usable };
                beside(&mut choices, &memory, &objects)
            }
            _ => {
                let input = [Input {
                    generator_counts: choices.any::<i32>().into(),
                    target_counts: choices.any::<i16>().into(),
                    torque_n_m: choices.wild(),
                    missed_ticks: choices.below(3) as u16,
                    has_generator: choices.below(3) as u8,
                    mean_counts: 0,
                    half_width_counts: 0,
                }; 2];
                let (input, given) = plain(&mut choices, &input);
                let right = memory.at(PLACES.output).cast::<Output>();
                // Inside an object of this very call.
                let inside = [joint, store, state][choices.below(3)];
                let (output, usable, overlaps) = match choices.below(12) {
                    0 => (null_mut(), false, false),
                    1 => (right.wrapping_byte_add(4), false, false),
                    2 => (inside.pointer.wrapping_add(choices.below(12)).cast(), inside.usable, true),
                    _ => (right, true, false),
                };
                let status = c::flexspline_tick(joint_at, tables, store_at, state_at, input, output) as u32;
                let objects = store.usable && joint.usable && state.usable;
                if status == OK {
                    let found = unsafe { right.read() };
                    assert!(
                        found.correction_rad.abs() <= 0.0501 && found.quality <= 3 && found.flags < 1024,
                        "{found:?}"
                    );
                    assert!(
                        found.transmission_error_rad.abs() <= 0.0501 && found.held_back_rad.is_finite(),
                        "{found:?}"
                    );
                }
                (status, objects && plain_ok && table_usable && given && usable, overlaps)
            }
        };
        assert!(status <= 18 || status == ENDED, "{status}");
        if !usable || refused {
            assert!(status != OK && status != ENDED, "{status}");
        }
        if usable && !refused {
            assert!(status != POINTER && status != OVERLAP, "{status}");
        }
        if usable && refused {
            assert!(status == OVERLAP || status == NOT_INITIALISED || loose && status != OK, "{status}");
        }
        if status != OK && status != ENDED {
            assert_eq!(memory.copy(), before, "status {status} and yet something changed");
        }
    }
    drop(memory.words);
}
