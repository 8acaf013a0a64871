//! The C interface: [`include/flexspline.h`](https://docs.rs/crate/flexspline/latest/source/include/flexspline.h), made by
//! cbindgen.
//!
//! Objects are the caller's, opaque and of known size; no pointer is kept beyond a call, also not to images. Every argument is
//! checked: null, alignment, whether the object was initialised, overlap of what is written, lengths and enumerations. A call that
//! returns anything but [`FlexsplineStatus::Ok`] has changed nothing unless its documentation says so.
//!
//! Not to be called from Rust, and private for that reason. The only `unsafe` of the crate. What it relies on, and what C cannot be kept from breaking: a pointer that is not null and
//! is aligned points to an object of its type, and images have the length given.
#![allow(unsafe_code)]

use crate::{
    ActivateError, Adjustment, Drive, FixedMember, Flags, GeneratorAngle, Images, Input, Joint, JointState, Limits,
    Mode, OutputAngle, Overrun, Quality, SAVED_JOINT_BYTES, Store,
};
use core::mem::{MaybeUninit, align_of, size_of};

#[cfg(all(target_os = "none", not(test)))]
use panic_never as _;

/// What a call came to.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlexsplineStatus {
    /// Done.
    Ok = 0,
    /// A pointer is null, or not aligned for its type.
    Pointer = 1,
    /// An object was not initialised, or is damaged.
    NotInitialised = 2,
    /// Two objects of which one is written overlap.
    Overlap = 3,
    /// A number or enumeration is not allowed.
    Argument = 4,
    /// Neither image is a table.
    Image = 5,
    /// The table is larger than a store.
    TooLarge = 6,
    /// The table is for another drive.
    OtherDrive = 7,
    /// No transition between these modes.
    Mode = 8,
    /// The saved bytes are damaged.
    Saved = 9,
    /// Each image is a table, and they differ.
    TwoTables = 10,
}

/// Eight-byte words of a [`FlexsplineStore`].
pub const FLEXSPLINE_STORE_WORDS: usize = 1056;
/// Eight-byte words of a [`FlexsplineJoint`].
pub const FLEXSPLINE_JOINT_WORDS: usize = 16;
/// Eight-byte words of a [`FlexsplineState`].
pub const FLEXSPLINE_STATE_WORDS: usize = 16;
/// Bytes of a saved state.
pub const FLEXSPLINE_SAVED_BYTES: usize = 40;

/// The copies of a table.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineStore {
    opaque: [MaybeUninit<u64>; FLEXSPLINE_STORE_WORDS],
}

/// The settings of a joint.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineJoint {
    opaque: [MaybeUninit<u64>; FLEXSPLINE_JOINT_WORDS],
}

/// What changes while a joint runs.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineState {
    opaque: [MaybeUninit<u64>; FLEXSPLINE_STATE_WORDS],
}

/// Settings of a joint; angles at the output unless named otherwise.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct FlexsplineSettings {
    /// Teeth of the flexspline.
    pub flexspline_teeth: u16,
    /// Teeth of the circular spline, more than those.
    pub circular_spline_teeth: u16,
    /// 0: the flexspline is fixed; 1: the circular spline.
    pub fixed_member: u8,
    /// 0: skip late ticks and count; 1: hold the last correction; 2: fade out.
    pub overrun: u8,
    /// Ticks of a fade.
    pub fade_ticks: u16,
    /// Ticks for which a glitch is not believed, and the last correction is kept where none can be made.
    pub patience: u16,
    /// Time from tick to tick, s.
    pub tick_s: f32,
    /// Fastest correction, rad/s.
    pub rate_rad_s: f32,
    /// Largest acceleration of the correction, rad/s^2.
    pub acceleration_rad_s2: f32,
    /// Fastest generator, rad/s.
    pub generator_rate_rad_s: f32,
}

/// Two images of one table.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct FlexsplineImages {
    /// First image.
    pub first: *const u8,
    /// Its bytes.
    pub first_bytes: usize,
    /// Second image; the same one is allowed.
    pub second: *const u8,
    /// Its bytes.
    pub second_bytes: usize,
}

/// One tick's measurements. Angles are counts of 2^-32 turn.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct FlexsplineInput {
    /// Generator angle.
    pub generator_counts: i64,
    /// Where the output shall be.
    pub target_counts: i64,
    /// Load torque at the output, N m, positive when it turns the output forward.
    pub torque_n_m: f32,
    /// Ticks missed since the last call.
    pub missed_ticks: u16,
    /// 0 if there is no sample of the generator, else 1.
    pub has_generator: u8,
}

/// One tick's results. Angles are counts of 2^-32 turn.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineOutput {
    /// Generator angle to command.
    pub command_counts: i64,
    /// Where the output is estimated to be.
    pub output_counts: i64,
    /// Transmission error now, rad.
    pub transmission_error_rad: f32,
    /// It lies within +- this, rad.
    pub uncertainty_rad: f32,
    /// Correction in the command, rad.
    pub correction_rad: f32,
    /// What the limiter held back, rad.
    pub held_back_rad: f32,
    /// 0 in range, 1 uncertain, 2 extrapolated, 3 disabled.
    pub quality: u8,
    /// Bits: 1 sample lost, 2 glitch, 4 overrun, 8 held back, 16 not corrected, 32 table in doubt, 64 state torn.
    pub flags: u16,
}

/// A value with a mark that tells that it was initialised.
#[repr(C)]
struct Marked<T> {
    mark: u32,
    value: T,
}

const STORE_MARK: u32 = 0x7853_5446;
const JOINT_MARK: u32 = 0x784a_5446;
const STATE_MARK: u32 = 0x7841_5446;

const _: () = {
    assert!(size_of::<Marked<Store>>() <= size_of::<FlexsplineStore>());
    assert!(size_of::<Marked<Joint>>() <= size_of::<FlexsplineJoint>());
    assert!(size_of::<Marked<JointState>>() <= size_of::<FlexsplineState>());
    assert!(
        align_of::<Marked<Store>>() <= 8 && align_of::<Marked<Joint>>() <= 8 && align_of::<Marked<JointState>>() <= 8
    );
    assert!(FLEXSPLINE_SAVED_BYTES == SAVED_JOINT_BYTES);
};

fn usable<T>(pointer: *const T) -> Result<usize, FlexsplineStatus> {
    let address = pointer as usize;
    let aligned = address.checked_rem(align_of::<T>()) == Some(0);
    if pointer.is_null() || !aligned { Err(FlexsplineStatus::Pointer) } else { Ok(address) }
}

/// Whether any two of these objects, start and length, overlap.
fn apart<const N: usize>(objects: [(usize, usize); N]) -> Result<(), FlexsplineStatus> {
    for (number, (start, length)) in objects.into_iter().enumerate() {
        for (other, other_length) in objects.into_iter().skip(number.saturating_add(1)) {
            if start < other.saturating_add(other_length) && other < start.saturating_add(length) {
                return Err(FlexsplineStatus::Overlap);
            }
        }
    }
    Ok(())
}

/// Writes a marked value into an opaque object.
fn put<O, T>(object: *mut O, mark: u32, value: T) -> Result<(), FlexsplineStatus> {
    usable(object)?;
    // SAFETY: not null, aligned for `O`, whose size and alignment are at least those of the value (asserted above); the
    // caller owns it.
    unsafe { object.cast::<Marked<T>>().write(Marked { mark, value }) };
    Ok(())
}

/// The value in an opaque object, to read.
fn get<'a, O, T>(object: *const O, mark: u32) -> Result<&'a T, FlexsplineStatus> {
    usable(object)?;
    // SAFETY: not null and aligned; all bytes of the mark are a number whatever they are. The value is only used if the mark
    // says that `put` wrote it. The reference does not outlive the call it is made in.
    let marked = unsafe { &*object.cast::<Marked<MaybeUninit<T>>>() };
    if marked.mark != mark {
        return Err(FlexsplineStatus::NotInitialised);
    }
    // SAFETY: marked, so written by `put`.
    Ok(unsafe { marked.value.assume_init_ref() })
}

/// The same, to write.
fn get_mut<'a, O, T>(object: *mut O, mark: u32) -> Result<&'a mut T, FlexsplineStatus> {
    get::<O, T>(object, mark)?;
    // SAFETY: as in `get`; the callers see to it that nothing else refers to it during the call.
    Ok(unsafe { &mut (*object.cast::<Marked<T>>()).value })
}

/// A plain structure of the caller, copied.
fn copied<T: Copy>(object: *const T) -> Result<T, FlexsplineStatus> {
    usable(object)?;
    // SAFETY: not null, aligned, and of a type in which every pattern of bits is a value (numbers and pointers).
    Ok(unsafe { *object })
}

fn bytes<'a>(first: *const u8, length: usize) -> Result<&'a [u8], FlexsplineStatus> {
    usable(first)?;
    if length > isize::MAX as usize {
        return Err(FlexsplineStatus::Argument);
    }
    // SAFETY: not null; the caller says that so many bytes are there. Not kept beyond the call.
    Ok(unsafe { core::slice::from_raw_parts(first, length) })
}

/// The images, apart from what is written: to be asked for before that is borrowed.
fn images<'a, const N: usize>(
    images: *const FlexsplineImages,
    written: [(usize, usize); N],
) -> Result<Images<'a>, FlexsplineStatus> {
    let FlexsplineImages { first, first_bytes, second, second_bytes } = copied(images)?;
    let found = Images::new(bytes(first, first_bytes)?, bytes(second, second_bytes)?);
    for object in written {
        for read in [span(images), (first as usize, first_bytes), (second as usize, second_bytes)] {
            apart([object, read])?;
        }
    }
    Ok(found)
}

fn status(result: Result<(), FlexsplineStatus>) -> FlexsplineStatus {
    result.err().unwrap_or(FlexsplineStatus::Ok)
}

fn span<T>(pointer: *const T) -> (usize, usize) {
    (pointer as usize, size_of::<T>())
}

/// Makes an empty store.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_store_init(store: *mut FlexsplineStore) -> FlexsplineStatus {
    status(put(store, STORE_MARK, Store::new()))
}

/// Makes a joint of its settings.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_joint_init(
    joint: *mut FlexsplineJoint,
    settings: *const FlexsplineSettings,
) -> FlexsplineStatus {
    let make = || {
        let s = copied(settings)?;
        let fixed = match s.fixed_member {
            0 => FixedMember::Flexspline,
            1 => FixedMember::CircularSpline,
            _ => return Err(FlexsplineStatus::Argument),
        };
        let overrun = match s.overrun {
            0 => Overrun::SkipAndCount,
            1 => Overrun::HoldLast,
            2 if s.fade_ticks > 0 => Overrun::FadeOut { ticks: s.fade_ticks },
            _ => return Err(FlexsplineStatus::Argument),
        };
        let limits = Limits {
            tick_s: s.tick_s,
            rate_rad_s: s.rate_rad_s,
            acceleration_rad_s2: s.acceleration_rad_s2,
            generator_rate_rad_s: s.generator_rate_rad_s,
            patience: s.patience,
        };
        let argument = FlexsplineStatus::Argument;
        let drive = Drive::new(s.flexspline_teeth, s.circular_spline_teeth, fixed).map_err(|_| argument)?;
        put(joint, JOINT_MARK, Joint::new(drive, limits, overrun).map_err(|_| argument)?)
    };
    status(make())
}

/// Makes the state of a joint after a reset.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_state_init(state: *mut FlexsplineState) -> FlexsplineStatus {
    status(put(state, STATE_MARK, JointState::new()))
}

/// Checks the images and fills the store from them, between two ticks. If it fails the table in use stays.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_store_activate(
    store: *mut FlexsplineStore,
    joint: *const FlexsplineJoint,
    table: *const FlexsplineImages,
    temperature_c: f32,
) -> FlexsplineStatus {
    let activate = || {
        apart([span(store), span(joint)])?;
        let images = images(table, [span(store)])?;
        let joint: &Joint = get(joint, JOINT_MARK)?;
        let store: &mut Store = get_mut(store, STORE_MARK)?;
        store.activate(&images, joint.drive(), temperature_c).map(|_| ()).map_err(|error| match error {
            ActivateError::Image(_) => FlexsplineStatus::Image,
            ActivateError::TooLarge { .. } | ActivateError::TooManyPages { .. } => FlexsplineStatus::TooLarge,
            ActivateError::TwoTables => FlexsplineStatus::TwoTables,
            ActivateError::OtherDrive => FlexsplineStatus::OtherDrive,
        })
    };
    status(activate())
}

/// Tells the temperature, degrees C: in a slow rate group.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_store_set_temperature(
    store: *mut FlexsplineStore,
    table: *const FlexsplineImages,
    temperature_c: f32,
) -> FlexsplineStatus {
    let set = || {
        let images = images(table, [span(store)])?;
        let store: &mut Store = get_mut(store, STORE_MARK)?;
        if store.set_temperature(&images, temperature_c) { Ok(()) } else { Err(FlexsplineStatus::Argument) }
    };
    status(set())
}

/// Checks so many words of the images: in a slow rate group.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_store_check_images(
    store: *mut FlexsplineStore,
    table: *const FlexsplineImages,
    words: u16,
) -> FlexsplineStatus {
    let check = || {
        let images = images(table, [span(store)])?;
        let store: &mut Store = get_mut(store, STORE_MARK)?;
        store.check_images(&images, words as usize);
        Ok(())
    };
    status(check())
}

/// Changes the mode: 0 off, 1 tracking, 2 hold, 3 safe.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_state_request(state: *mut FlexsplineState, mode: u8) -> FlexsplineStatus {
    let request = || {
        let state: &mut JointState = get_mut(state, STATE_MARK)?;
        let mode = match mode {
            0 => Mode::Off,
            1 => Mode::Tracking,
            2 => Mode::Hold,
            3 => Mode::Safe,
            _ => return Err(FlexsplineStatus::Argument),
        };
        state.request(mode).map_err(|_| FlexsplineStatus::Mode)
    };
    status(request())
}

/// Writes what must survive a reset: `FLEXSPLINE_SAVED_BYTES` bytes.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_state_save(
    state: *const FlexsplineState,
    saved: *mut [u8; FLEXSPLINE_SAVED_BYTES],
) -> FlexsplineStatus {
    let save = || {
        apart([span(state), span(saved)])?;
        let state: &JointState = get(state, STATE_MARK)?;
        usable(saved)?;
        // SAFETY: not null, apart from the state; the caller owns so many bytes.
        unsafe { saved.write(state.save()) };
        Ok(())
    };
    status(save())
}

/// Makes a state of saved bytes, in mode off; only if the joint cannot have moved meanwhile.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_state_restore(
    state: *mut FlexsplineState,
    saved: *const [u8; FLEXSPLINE_SAVED_BYTES],
) -> FlexsplineStatus {
    let restore = || {
        apart([span(state), span(saved)])?;
        let restored = JointState::restore(&copied(saved)?).ok_or(FlexsplineStatus::Saved)?;
        put(state, STATE_MARK, restored)
    };
    status(restore())
}

/// One tick.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_tick(
    joint: *const FlexsplineJoint,
    table: *const FlexsplineImages,
    store: *mut FlexsplineStore,
    state: *mut FlexsplineState,
    input: *const FlexsplineInput,
    output: *mut FlexsplineOutput,
) -> FlexsplineStatus {
    let tick = || {
        apart([span(joint), span(store), span(state), span(output)])?;
        usable(output)?;
        let images = images(table, [span(store), span(state), span(output)])?;
        let input = copied(input)?;
        let joint: &Joint = get(joint, JOINT_MARK)?;
        let store: &mut Store = get_mut(store, STORE_MARK)?;
        let state: &mut JointState = get_mut(state, STATE_MARK)?;
        let generator = GeneratorAngle::from_counts(input.generator_counts);
        let input = Input {
            generator: if input.has_generator != 0 { Some(generator) } else { None },
            target: OutputAngle::from_counts(input.target_counts),
            torque_n_m: input.torque_n_m,
            missed_ticks: input.missed_ticks,
            adjustment: Adjustment::default(),
        };
        let found = joint.tick(&images, store, state, &input);
        let given = FlexsplineOutput {
            command_counts: found.command.counts(),
            output_counts: found.output.counts(),
            transmission_error_rad: found.transmission_error_rad,
            uncertainty_rad: found.uncertainty_rad,
            correction_rad: found.correction_rad,
            held_back_rad: found.held_back_rad,
            quality: match found.quality {
                Quality::InRange => 0,
                Quality::Uncertain => 1,
                Quality::Extrapolated => 2,
                Quality::Disabled => 3,
            },
            flags: Flags::bits(found.flags),
        };
        // SAFETY: checked above: not null, aligned, apart from what is borrowed here.
        unsafe { output.write(given) };
        Ok(())
    };
    status(tick())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;
    use core::ptr::{null, null_mut};
    use std::boxed::Box;

    const SETTINGS: FlexsplineSettings = FlexsplineSettings {
        flexspline_teeth: 188,
        circular_spline_teeth: 190,
        fixed_member: 0,
        overrun: 2,
        fade_ticks: 50,
        patience: 5,
        tick_s: 1e-3,
        rate_rad_s: 0.05,
        acceleration_rad_s2: 5.0,
        generator_rate_rad_s: 600.0,
    };

    struct Objects {
        store: Box<FlexsplineStore>,
        joint: FlexsplineJoint,
        state: FlexsplineState,
    }

    fn blank() -> Objects {
        Objects {
            store: Box::new(FlexsplineStore { opaque: [MaybeUninit::zeroed(); FLEXSPLINE_STORE_WORDS] }),
            joint: FlexsplineJoint { opaque: [MaybeUninit::zeroed(); FLEXSPLINE_JOINT_WORDS] },
            state: FlexsplineState { opaque: [MaybeUninit::zeroed(); FLEXSPLINE_STATE_WORDS] },
        }
    }

    fn made() -> Objects {
        let mut o = blank();
        assert_eq!(flexspline_store_init(&mut *o.store), FlexsplineStatus::Ok);
        assert_eq!(flexspline_joint_init(&mut o.joint, &SETTINGS), FlexsplineStatus::Ok);
        assert_eq!(flexspline_state_init(&mut o.state), FlexsplineStatus::Ok);
        o
    }

    fn pair(image: &[u8]) -> FlexsplineImages {
        FlexsplineImages {
            first: image.as_ptr(),
            first_bytes: image.len(),
            second: image.as_ptr(),
            second_bytes: image.len(),
        }
    }

    const INPUT: FlexsplineInput = FlexsplineInput {
        generator_counts: 1 << 30,
        target_counts: 11_000_000,
        torque_n_m: 5.0,
        missed_ticks: 0,
        has_generator: 1,
    };

    #[test]
    fn a_tick_through_c_is_a_tick() {
        let image = fixture::image(false);
        let (mut o, table) = (made(), pair(&image));
        assert_eq!(flexspline_store_activate(&mut *o.store, &o.joint, &table, 20.0), FlexsplineStatus::Ok);
        assert_eq!(flexspline_state_request(&mut o.state, 1), FlexsplineStatus::Ok);
        let mut out = FlexsplineOutput::default();
        assert_eq!(
            flexspline_tick(&o.joint, &table, &mut *o.store, &mut o.state, &INPUT, &mut out),
            FlexsplineStatus::Ok
        );

        let images = Images::new(&image, &image);
        let limits = Limits {
            tick_s: 1e-3,
            rate_rad_s: 0.05,
            acceleration_rad_s2: 5.0,
            generator_rate_rad_s: 600.0,
            patience: 5,
        };
        let joint = Joint::new(fixture::drive(), limits, Overrun::FadeOut { ticks: 50 }).unwrap();
        let (mut store, mut state) = (Store::new(), JointState::new());
        store.activate(&images, &fixture::drive(), 20.0).unwrap();
        state.request(Mode::Tracking).unwrap();
        let input = Input {
            generator: Some(GeneratorAngle::from_counts(1 << 30)),
            target: OutputAngle::from_counts(11_000_000),
            torque_n_m: 5.0,
            missed_ticks: 0,
            adjustment: Adjustment::default(),
        };
        let expected = joint.tick(&images, &mut store, &mut state, &input);
        assert_eq!((out.command_counts, out.output_counts), (expected.command.counts(), expected.output.counts()));
        assert_eq!((out.correction_rad, out.flags), (expected.correction_rad, expected.flags.bits()));

        let mut saved = [0; FLEXSPLINE_SAVED_BYTES];
        assert_eq!(flexspline_state_save(&o.state, &mut saved), FlexsplineStatus::Ok);
        assert_eq!(saved, state.save());
        assert_eq!(flexspline_state_restore(&mut o.state, &saved), FlexsplineStatus::Ok);
        saved[3] ^= 1;
        assert_eq!(flexspline_state_restore(&mut o.state, &saved), FlexsplineStatus::Saved);
        assert_eq!(flexspline_store_set_temperature(&mut *o.store, &table, 30.0), FlexsplineStatus::Ok);
        assert_eq!(flexspline_store_set_temperature(&mut *o.store, &table, f32::NAN), FlexsplineStatus::Argument);
        assert_eq!(flexspline_store_check_images(&mut *o.store, &table, 100), FlexsplineStatus::Ok);
    }

    #[test]
    fn every_argument_is_checked() {
        use FlexsplineStatus::{Argument, Image, Mode, NotInitialised, OtherDrive, Overlap, Pointer};
        let image = fixture::image(false);
        let (mut o, mut raw, table) = (made(), blank(), pair(&image));
        assert_eq!(flexspline_store_init(null_mut()), Pointer);
        assert_eq!(flexspline_state_init(null_mut()), Pointer);
        let odd = (&raw mut o.state).cast::<u8>().wrapping_add(1).cast::<FlexsplineState>();
        assert_eq!(flexspline_state_init(odd), Pointer);
        assert_eq!(flexspline_joint_init(&mut raw.joint, null()), Pointer);
        let wrong: [fn(&mut FlexsplineSettings); 7] = [
            |s| s.flexspline_teeth = 190,
            |s| s.fixed_member = 2,
            |s| s.overrun = 3,
            |s| s.fade_ticks = 0,
            |s| s.tick_s = f32::NAN,
            |s| s.rate_rad_s = 0.0,
            |s| s.generator_rate_rad_s = 1e30,
        ];
        for (number, wrong) in wrong.into_iter().enumerate() {
            let mut settings = SETTINGS;
            wrong(&mut settings);
            assert_eq!(flexspline_joint_init(&mut raw.joint, &settings), Argument, "{number}");
        }
        assert_eq!(flexspline_state_request(&mut raw.state, 1), NotInitialised);
        assert_eq!(flexspline_state_request(&mut o.state, 4), Argument);
        assert_eq!(flexspline_state_request(&mut o.state, 2), Mode);

        let activate =
            |o: &mut Objects, table: &FlexsplineImages| flexspline_store_activate(&mut *o.store, &o.joint, table, 20.0);
        assert_eq!(flexspline_store_activate(&mut *raw.store, &o.joint, &table, 20.0), NotInitialised);
        assert_eq!(flexspline_store_activate(&mut *o.store, &raw.joint, &table, 20.0), NotInitialised);
        assert_eq!(flexspline_store_activate(&mut *o.store, &o.joint, null(), 20.0), Pointer);
        assert_eq!(activate(&mut o, &FlexsplineImages { second: null(), ..table }), Pointer);
        assert_eq!(activate(&mut o, &FlexsplineImages { first_bytes: usize::MAX, ..table }), Argument);
        assert_eq!(activate(&mut o, &FlexsplineImages { first_bytes: 900, second_bytes: 900, ..table }), Image);
        let settings = FlexsplineSettings { circular_spline_teeth: 192, ..SETTINGS };
        assert_eq!(flexspline_joint_init(&mut raw.joint, &settings), FlexsplineStatus::Ok);
        assert_eq!(flexspline_store_activate(&mut *o.store, &raw.joint, &table, 20.0), OtherDrive);

        let mut out = FlexsplineOutput::default();
        let tick =
            |o: &mut Objects, input, out| flexspline_tick(&o.joint, &table, &mut *o.store, &mut o.state, input, out);
        assert_eq!(tick(&mut o, null(), &mut out), Pointer);
        assert_eq!(tick(&mut o, &INPUT, null_mut()), Pointer);
        let inside = (&raw mut o.state).cast::<FlexsplineOutput>();
        assert_eq!(tick(&mut o, &INPUT, inside), Overlap);
        assert_eq!(tick(&mut o, &INPUT, &mut out), FlexsplineStatus::Ok);
        assert_eq!(out.quality, 3, "no table yet");

        // An image, or what tells of it, inside what is written.
        let store = &raw mut *o.store;
        let within = FlexsplineImages { second: store.cast_const().cast(), second_bytes: 100, ..table };
        assert_eq!(flexspline_store_activate(store, &o.joint, &within, 20.0), Overlap);
        assert_eq!(flexspline_store_set_temperature(store, &within, 20.0), Overlap);
        assert_eq!(flexspline_store_check_images(store, &within, 9), Overlap);
        assert_eq!(flexspline_tick(&o.joint, &within, store, &mut o.state, &INPUT, &mut out), Overlap);
        let mut room = [table; 400];
        let inside = room.as_mut_ptr().cast::<FlexsplineStore>();
        assert_eq!(flexspline_store_init(inside), FlexsplineStatus::Ok);
        let told = inside.cast::<FlexsplineImages>().wrapping_add(300);
        // SAFETY: inside the room; the store holds nothing there yet that is read before the call refuses.
        unsafe { told.write(table) };
        assert_eq!(flexspline_store_check_images(inside, told, 9), FlexsplineStatus::Ok, "beyond the store");
        let told = inside.cast::<FlexsplineImages>().wrapping_add(200);
        unsafe { told.write(table) };
        assert_eq!(flexspline_store_check_images(inside, told, 9), Overlap);
    }

    #[test]
    fn settings_make_the_joint_they_name() {
        let limits = Limits {
            tick_s: SETTINGS.tick_s,
            rate_rad_s: SETTINGS.rate_rad_s,
            acceleration_rad_s2: SETTINGS.acceleration_rad_s2,
            generator_rate_rad_s: SETTINGS.generator_rate_rad_s,
            patience: SETTINGS.patience,
        };
        let members = [FixedMember::Flexspline, FixedMember::CircularSpline];
        let policies = [Overrun::SkipAndCount, Overrun::HoldLast, Overrun::FadeOut { ticks: 50 }];
        for (fixed_member, member) in (0..).zip(members) {
            for (overrun, policy) in (0..).zip(policies) {
                let mut o = blank();
                let settings = FlexsplineSettings { fixed_member, overrun, ..SETTINGS };
                assert_eq!(flexspline_joint_init(&mut o.joint, &settings), FlexsplineStatus::Ok);
                let expected = Joint::new(Drive::new(188, 190, member).unwrap(), limits, policy).unwrap();
                assert_eq!(get::<_, Joint>(&o.joint, JOINT_MARK), Ok(&expected), "{fixed_member} {overrun}");
            }
        }
    }

    #[test]
    fn each_number_is_the_mode_it_stands_for() {
        for (number, mode) in (0..).zip([Mode::Off, Mode::Tracking, Mode::Hold, Mode::Safe]) {
            let mut o = made();
            assert_eq!(flexspline_state_request(&mut o.state, 1), FlexsplineStatus::Ok);
            assert_eq!(flexspline_state_request(&mut o.state, number), FlexsplineStatus::Ok);
            assert_eq!(get::<_, JointState>(&o.state, STATE_MARK).unwrap().mode(), mode);
        }
    }

    #[test]
    fn each_quality_and_a_missing_sample_are_told() {
        let image = fixture::image(false);
        let (mut o, table) = (made(), pair(&image));
        assert_eq!(flexspline_store_activate(&mut *o.store, &o.joint, &table, 20.0), FlexsplineStatus::Ok);
        let mut tick = |input: FlexsplineInput| {
            let mut out = FlexsplineOutput::default();
            let status = flexspline_tick(&o.joint, &table, &mut *o.store, &mut o.state, &input, &mut out);
            assert_eq!(status, FlexsplineStatus::Ok);
            out
        };
        assert_eq!(tick(INPUT).quality, 1, "the side is not known");
        // Forward through the play, in ticks that are no glitch.
        let at = |i: i64| FlexsplineInput { generator_counts: (1 << 30) + i * 20_000_000, ..INPUT };
        let last = at(20);
        assert_eq!((1..=20).map(|i| tick(at(i))).last().unwrap().quality, 0);
        assert_eq!(tick(FlexsplineInput { torque_n_m: 1e3, ..last }).quality, 2);
        assert_eq!(tick(FlexsplineInput { torque_n_m: f32::NAN, ..last }).quality, 3);
        assert_eq!(tick(FlexsplineInput { has_generator: 0, ..last }).flags & 1, 1);
        assert_eq!(tick(last).flags & 1, 0);
    }

    #[test]
    fn objects_side_by_side_do_not_overlap() {
        for (objects, expected) in [
            ([(100, 10), (110, 5), (50, 50)], Ok(())),
            ([(100, 10), (109, 5), (50, 50)], Err(FlexsplineStatus::Overlap)),
            ([(100, 10), (110, 5), (50, 51)], Err(FlexsplineStatus::Overlap)),
            ([(100, 10), (110, 5), (112, 1)], Err(FlexsplineStatus::Overlap)),
            ([(100, 10), (usize::MAX, 5), (0, 100)], Ok(())),
        ] {
            assert_eq!(apart(objects), expected, "{objects:?}");
        }
    }

    #[test]
    fn what_another_call_made_is_no_object() {
        let (mut o, image) = (made(), fixture::image(false));
        let table = pair(&image);
        let state = (&raw const o.state).cast::<FlexsplineJoint>();
        assert_eq!(flexspline_store_activate(&mut *o.store, state, &table, 20.0), FlexsplineStatus::NotInitialised);
        let joint = (&raw mut o.joint).cast::<FlexsplineState>();
        assert_eq!(flexspline_state_request(joint, 1), FlexsplineStatus::NotInitialised);
    }
}
