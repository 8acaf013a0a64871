//! The C interface: calls in any order with null, misaligned, uninitialised, overlapping and short arguments.
//!
//! Only what C can be kept from breaking: a pointer that is aligned and not null points to an object of its type, or to one that
//! the same call must refuse, and images have the length given.

use crate::Choices;
use crate::tables::BASES;
use std::ptr::{null, null_mut};

/// As in `core/include/flexspline.h`.
#[repr(C)]
#[derive(Clone, Copy)]
struct Settings {
    teeth: [u16; 2],
    fixed_member: u8,
    overrun: u8,
    fade_ticks: u16,
    patience: u16,
    tick_s: f32,
    rate_rad_s: f32,
    acceleration_rad_s2: f32,
    generator_rate_rad_s: f32,
    hold_rad: f32,
}

#[repr(C)]
#[derive(Clone, Copy)]
struct Images {
    first: *const u8,
    first_bytes: usize,
    second: *const u8,
    second_bytes: usize,
}

#[repr(C)]
#[derive(Clone, Copy)]
struct Input {
    generator_counts: i64,
    target_counts: i64,
    torque_n_m: f32,
    missed_ticks: u16,
    has_generator: u8,
    mean_counts: i32,
    half_width_counts: i32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug)]
struct Output {
    command_counts: i64,
    output_counts: i64,
    transmission_error_rad: f32,
    uncertainty_rad: f32,
    correction_rad: f32,
    held_back_rad: f32,
    quality: u8,
    flags: u16,
}

type Object = *mut u64;

// As C calls them: pointers to structures of its own.
unsafe fn flexspline_store_init(store: Object) -> u32 {
    flexspline::c_api::flexspline_store_init(store.cast()) as u32
}
unsafe fn flexspline_joint_init(joint: Object, settings: *const Settings) -> u32 {
    flexspline::c_api::flexspline_joint_init(joint.cast(), settings.cast()) as u32
}
unsafe fn flexspline_state_init(state: Object) -> u32 {
    flexspline::c_api::flexspline_state_init(state.cast()) as u32
}
unsafe fn flexspline_store_activate(store: Object, joint: Object, table: *const Images, temperature_c: f32) -> u32 {
    flexspline::c_api::flexspline_store_activate(store.cast(), joint.cast(), table.cast(), temperature_c) as u32
}
unsafe fn flexspline_store_set_temperature(store: Object, table: *const Images, temperature_c: f32) -> u32 {
    flexspline::c_api::flexspline_store_set_temperature(store.cast(), table.cast(), temperature_c) as u32
}
unsafe fn flexspline_store_check_images(store: Object, table: *const Images, words: u16) -> u32 {
    flexspline::c_api::flexspline_store_check_images(store.cast(), table.cast(), words) as u32
}
unsafe fn flexspline_state_request(state: Object, mode: u8) -> u32 {
    flexspline::c_api::flexspline_state_request(state.cast(), mode) as u32
}
unsafe fn flexspline_state_save(state: Object, joint: Object, store: Object, saved: *mut u8) -> u32 {
    flexspline::c_api::flexspline_state_save(state.cast(), joint.cast(), store.cast(), saved.cast()) as u32
}
unsafe fn flexspline_state_restore(state: Object, joint: Object, store: Object, saved: *const u8) -> u32 {
    flexspline::c_api::flexspline_state_restore(state.cast(), joint.cast(), store.cast(), saved.cast()) as u32
}
unsafe fn flexspline_state_forget_side(state: Object) -> u32 {
    flexspline::c_api::flexspline_state_forget_side(state.cast()) as u32
}
unsafe fn flexspline_joint_mend(joint: Object) -> u32 {
    flexspline::c_api::flexspline_joint_mend(joint.cast()) as u32
}
unsafe fn flexspline_state_report(state: Object, report: Object) -> u32 {
    flexspline::c_api::flexspline_state_report(state.cast(), report.cast()) as u32
}
unsafe fn flexspline_store_report(store: Object, report: Object) -> u32 {
    flexspline::c_api::flexspline_store_report(store.cast(), report.cast()) as u32
}
unsafe fn flexspline_tick(
    joint: Object,
    table: *const Images,
    store: Object,
    state: Object,
    input: *const Input,
    output: *mut Output,
) -> u32 {
    flexspline::c_api::flexspline_tick(
        joint.cast(),
        table.cast(),
        store.cast(),
        state.cast(),
        input.cast(),
        output.cast(),
    ) as u32
}

const OK: u32 = 0;
const POINTER: u32 = 1;
const NOT_INITIALISED: u32 = 2;
const OVERLAP: u32 = 3;

const STORE_WORDS: usize = 1072;
const JOINT_WORDS: usize = 32;
const STATE_WORDS: usize = 24;
/// Words of whatever else is written.
const OTHER_WORDS: usize = 12;
/// Two of each object, what is written, and room for a store beyond the last.
const WORDS: usize = 2 * (STORE_WORDS + JOINT_WORDS + STATE_WORDS) + 2 * OTHER_WORDS + STORE_WORDS;

/// Where things are in the memory.
struct Places {
    stores: [usize; 2],
    joints: [usize; 2],
    states: [usize; 2],
    output: usize,
    saved: usize,
}

const PLACES: Places = {
    let joints = 2 * STORE_WORDS;
    let states = joints + 2 * JOINT_WORDS;
    let output = states + 2 * STATE_WORDS;
    Places {
        stores: [0, STORE_WORDS],
        joints: [joints, joints + JOINT_WORDS],
        states: [states, states + STATE_WORDS],
        output,
        saved: output + OTHER_WORDS,
    }
};

/// A pointer, and whether it is one to an object.
#[derive(Clone, Copy)]
struct Given {
    pointer: Object,
    usable: bool,
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

    fn copy(&self) -> Vec<u64> {
        // What lies between the fields of an object is no number to Miri.
        if cfg!(miri) {
            return Vec::new();
        }
        // Through the pointer that the calls write through.
        (0..WORDS).map(|i| unsafe { self.at(i).read() }).collect()
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
        teeth: [188, 190],
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
        1 => settings.teeth = choices.any(),
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

/// Any calls.
pub fn run(data: &[u8]) {
    let mut choices = Choices::new(data);
    let memory = Memory::new();
    // Half of the runs begin with what a firmware begins with.
    if choices.any() {
        let settings = any_settings(&mut Choices::new(&[]));
        unsafe {
            assert_eq!(flexspline_store_init(memory.at(PLACES.stores[0])), OK);
            assert_eq!(flexspline_joint_init(memory.at(PLACES.joints[0]), &settings), OK);
            assert_eq!(flexspline_state_init(memory.at(PLACES.states[0])), OK);
        }
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
        let tables = [table; 2];
        let (tables, told) = plain(&mut choices, &tables);
        let before = memory.copy();
        let temperature = choices.wild();
        // SAFETY of the calls: every pointer that is aligned and not null points into the memory, or to what is kept.
        let (status, usable, refused) = match choices.below(18) {
            0 => (unsafe { flexspline_store_init(store.pointer) }, store.usable, false),
            1 => {
                let settings = [any_settings(&mut choices); 2];
                let (settings, told) = plain(&mut choices, &settings);
                (unsafe { flexspline_joint_init(joint.pointer, settings) }, joint.usable && told, false)
            }
            2 => (unsafe { flexspline_state_init(state.pointer) }, state.usable, false),
            3 | 4 => {
                let status = unsafe { flexspline_store_activate(store.pointer, joint.pointer, tables, temperature) };
                (status, store.usable && joint.usable && told && table_usable, false)
            }
            5 => {
                let status = unsafe { flexspline_store_set_temperature(store.pointer, tables, temperature) };
                (status, store.usable && told && table_usable, false)
            }
            6 => {
                let status =
                    unsafe { flexspline_store_check_images(store.pointer, tables, choices.below(2000) as u16) };
                (status, store.usable && told && table_usable, false)
            }
            7 => (unsafe { flexspline_state_request(state.pointer, choices.below(6) as u8) }, state.usable, false),
            8 => {
                let inside = choices.below(4) == 0;
                let saved =
                    if inside { state.pointer.wrapping_byte_add(choices.below(180)) } else { memory.at(PLACES.saved) };
                let saved = if choices.below(12) == 0 { null_mut() } else { saved.cast::<u8>() };
                let status = unsafe { flexspline_state_save(state.pointer, joint.pointer, store.pointer, saved) };
                (status, state.usable && joint.usable && store.usable && !saved.is_null(), inside && !saved.is_null())
            }
            9 => {
                let inside = choices.below(4) == 0;
                let saved =
                    if inside { state.pointer.wrapping_byte_add(choices.below(180)) } else { memory.at(PLACES.saved) };
                let saved = if choices.below(12) == 0 { null() } else { saved.cast::<u8>().cast_const() };
                let status = unsafe { flexspline_state_restore(state.pointer, joint.pointer, store.pointer, saved) };
                (status, state.usable && joint.usable && store.usable && !saved.is_null(), inside && !saved.is_null())
            }
            10 => (unsafe { flexspline_state_forget_side(state.pointer) }, state.usable, false),
            11 => (unsafe { flexspline_joint_mend(joint.pointer) }, joint.usable, false),
            12 => {
                let status = unsafe { flexspline_state_report(state.pointer, memory.at(PLACES.saved)) };
                (status, state.usable, false)
            }
            13 => {
                let status = unsafe { flexspline_store_report(store.pointer, memory.at(PLACES.saved)) };
                (status, store.usable, false)
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
                let status =
                    unsafe { flexspline_tick(joint.pointer, tables, store.pointer, state.pointer, input, output) };
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
                (status, objects && told && table_usable && given && usable, overlaps)
            }
        };
        assert!(status <= 13, "{status}");
        if !usable || refused {
            assert_ne!(status, OK);
        }
        if usable && !refused {
            assert!(status != POINTER && status != OVERLAP, "{status}");
        }
        if usable && refused {
            assert!(status == OVERLAP || status == NOT_INITIALISED, "{status}");
        }
        if status != OK {
            assert_eq!(memory.copy(), before, "status {status} and yet something changed");
        }
    }
    drop(memory.words);
}
