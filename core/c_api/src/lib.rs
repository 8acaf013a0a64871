//! The C interface: [`include/flexspline.h`](https://docs.rs/crate/flexspline/latest/source/include/flexspline.h), made
//! by cbindgen.
//!
//! Objects are the caller's, opaque and of known size; no pointer is kept beyond a call, also not to images. Every
//! argument is checked: null, alignment, whether the object was initialised, overlap of what is written, lengths and
//! enumerations. A call that returns anything but [`FlexsplineStatus::Ok`] has changed nothing unless its documentation
//! says so.
//!
//! # Threads and interrupts
//! A call works on the objects that it is given and on nothing else: there is no state of its own, no lock, no memory
//! from a heap. So calls for different joints may interrupt each other. One store, one state and one joint belong to
//! one context at a time: a call in an interrupt must not be given an object that the code it interrupted is working
//! on. A slow group in the background therefore runs with the interrupt of the tick held off, or in the same one. What
//! is only read (`const`) may be shared while nobody writes.
//!
//! Not to be called from Rust, which has the crates behind it. The only crate of the core with `unsafe`. What it relies
//! on, and what C cannot be kept from breaking: a pointer that is not null and is aligned points to an object of its
//! type, and images have the length given.
#![no_std]
#![allow(unsafe_code, clippy::not_unsafe_ptr_arg_deref)] // As C calls them.
#![cfg_attr(
    not(test),
    deny(
        clippy::indexing_slicing,
        clippy::arithmetic_side_effects,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::unreachable,
        clippy::todo,
        clippy::unimplemented
    )
)]

// A static library for a PC has the panic handler of `std`; on the target it has one that cannot be linked.
#[cfg(any(test, not(target_os = "none")))]
extern crate std;

mod ask;
mod beside;
mod encoder;
mod learn;
mod names;
mod safe;
mod telemetry;
mod torque;

pub use {ask::*, beside::*, encoder::*, learn::*, names::*, safe::*, telemetry::*, torque::*};

use core::mem::{MaybeUninit, align_of, size_of};
use flexspline::{
    ActivateError, Activation, Adjustment, Approach, Counters, Direction, Drive, FixedMember, Flags, GeneratorAngle,
    Health, Identity, IdentityCheck, ImageError, Images, Input, Joint, JointState, Limits, Mode, Output, OutputAngle,
    Overrun, PlayState, Progress, Quality, RestoreError, Store, Table, TableId, self_test,
};
use torque::direction_of;

#[cfg(all(target_os = "none", not(test)))]
use panic_never as _;

/// Status of a call.
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
    /// The state was saved with another table.
    OtherTable = 11,
    /// The state was saved by a joint with other settings.
    OtherJoint = 12,
    /// Both images are the same place in memory.
    SameImage = 13,
    /// A chunk of an upload is not the next one.
    Order = 14,
    /// Not all bytes of an upload came.
    Incomplete = 15,
    /// The image is whole and its wind-up is none that a drive has: a flank falls while the load grows (the sign of the
    /// torque?), or rises too fast.
    Implausible = 16,
    /// The saved progress of an activation is corrupt: begin again.
    Torn = 17,
    /// The self-test gave another answer than it must: processor or program are not what they were.
    SelfTest = 18,
}

/// There was no sample.
pub const FLEXSPLINE_FLAG_SAMPLE_LOST: u16 = 1;
/// The sample was not believed; or it was, and what the one before it did to the play was taken back.
pub const FLEXSPLINE_FLAG_GLITCH: u16 = 2;
/// The tick came late.
pub const FLEXSPLINE_FLAG_OVERRUN: u16 = 4;
/// The correction is not what the table wants: the limiter, the mode (off, safe, hold) or the overrun policy holds it
/// back.
pub const FLEXSPLINE_FLAG_HELD_BACK: u16 = 8;
/// No correction could be made; the last one is kept or fades out.
pub const FLEXSPLINE_FLAG_NOT_CORRECTED: u16 = 16;
/// The words read of the table differed between the copies. They were repaired and the tick repeated, unless not
/// corrected is set too.
pub const FLEXSPLINE_FLAG_TABLE_DOUBT: u16 = 32;
/// The state was not whole, and was taken from its other copy; where neither was, the joint is safe.
pub const FLEXSPLINE_FLAG_STATE_TORN: u16 = 64;
/// The settings are not whole: `flexspline_joint_mend`, or make the joint anew. If no correction could be made either,
/// the command is the last sample that was believed (0 before the first): hold the generator.
pub const FLEXSPLINE_FLAG_JOINT_TORN: u16 = 128;
/// The joint is in mode safe.
pub const FLEXSPLINE_FLAG_SAFE: u16 = 256;
/// An image is not the one that was activated, or both are the same one.
pub const FLEXSPLINE_FLAG_OTHER_IMAGES: u16 = 512;

/// The adjustment of the input was larger than any may be, and was taken at its largest: what made it is not sound.
pub const FLEXSPLINE_FLAG_BOUNDED: u16 = 1024;

/// Eight-byte words of a [`FlexsplineStore`], as the crate below was compiled; the header has 1072 for any table.
pub const FLEXSPLINE_STORE_WORDS: usize = Store::ROOM;
/// Eight-byte words of a [`FlexsplineJoint`].
pub const FLEXSPLINE_JOINT_WORDS: usize = 32;
/// Eight-byte words of a [`FlexsplineState`].
pub const FLEXSPLINE_STATE_WORDS: usize = 24;
/// Eight-byte words of a [`FlexsplineActivation`].
pub const FLEXSPLINE_ACTIVATION_WORDS: usize = 88;
/// Eight-byte words of a [`FlexsplineIdentity`].
pub const FLEXSPLINE_IDENTITY_WORDS: usize = 40;
/// Bytes of a saved state.
pub const FLEXSPLINE_SAVED_BYTES: usize = 72;

/// The copies of a table.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineStore {
    opaque: [MaybeUninit<u64>; FLEXSPLINE_STORE_WORDS],
}

/// A table on its way into a store.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineActivation {
    opaque: [MaybeUninit<u64>; FLEXSPLINE_ACTIVATION_WORDS],
}

/// Whether an image is the one of its id, as far as it was found out.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineIdentity {
    opaque: [MaybeUninit<u64>; FLEXSPLINE_IDENTITY_WORDS],
}

/// The settings of a joint.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineJoint {
    opaque: [MaybeUninit<u64>; FLEXSPLINE_JOINT_WORDS],
}

/// State of a running joint.
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
    /// `FLEXSPLINE_FIXED_...`.
    pub fixed_member: u8,
    /// `FLEXSPLINE_OVERRUN_...`.
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
    /// Fastest generator, rad/s, also in ticks that were missed.
    pub generator_rate_rad_s: f32,
    /// A target no further from the output than this is reached on the flank that bears already, rad; 0 for none. Three
    /// times the peak of the encoder's noise at the output keeps the flank from changing to and fro; it costs up to
    /// this much after a reversal.
    pub hold_rad: f32,
}

/// Two images of one table.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct FlexsplineImages {
    /// First image.
    pub first: *const u8,
    /// Its bytes.
    pub first_bytes: usize,
    /// Second image, at another place.
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
    /// Load torque at the output, N m, positive when it turns the output forward: that in the mesh, with the drag added
    /// that the table was made with (times the direction), not that on the load where drag or inertia differ:
    /// `flexspline_torque_tick` makes it of a reading.
    pub torque_n_m: f32,
    /// Ticks missed since the last call.
    pub missed_ticks: u16,
    /// 0 if there is no sample of the generator, else 1.
    pub has_generator: u8,
    /// Added to the mean error of the table in this tick, counts at the output; 0 for none.
    pub mean_counts: i32,
    /// Added to the half-width of the play, counts; 0 for none.
    pub half_width_counts: i32,
}

/// One tick's results. Angles are counts of 2^-32 turn.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineOutput {
    /// Generator angle to command: the target times the ratio, as it is, less the correction. Where the target leaps
    /// this leaps, without a flag: its rate is the caller's to limit.
    pub command_counts: i64,
    /// Where the output is estimated to be.
    pub output_counts: i64,
    /// Transmission error now, rad.
    pub transmission_error_rad: f32,
    /// It lies within +- this, rad. Of the estimate, whether it is corrected or not. Without a sample that is believed
    /// in this tick: no less than the table's limit and the reported uncertainty.
    pub uncertainty_rad: f32,
    /// Correction in the command, rad: target less command over ratio. It is taken off the target, and has the sign of
    /// the error.
    pub correction_rad: f32,
    /// Correction missing from the table's demand, rad: held back by the limiter, the mode or the overrun policy.
    pub held_back_rad: f32,
    /// `FLEXSPLINE_QUALITY_...`.
    pub quality: u8,
    /// `FLEXSPLINE_FLAG_...`.
    pub flags: u16,
}

/// Report on a store.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineStoreReport {
    /// Id of the table in use; zeros if there is none.
    pub table_id: [u8; 8],
    /// Ticks that were done again because something was not whole; wraps, as all counters.
    pub doubtful_ticks: u32,
    /// Words of the copies that were found to differ and made anew.
    pub words_mended: u32,
    /// Words that could not be made anew.
    pub words_skipped: u32,
    /// Pages of an image found damaged.
    pub pages_damaged: u32,
    /// Passes over both copies.
    pub passes: u32,
    /// `FLEXSPLINE_HEALTH_...`.
    pub health: u8,
    /// Image with a page that can be written again from the other: 0 or 1; 255 if there is none.
    pub damaged_image: u8,
    /// That page.
    pub damaged_page: u8,
}

/// Report on a state.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineStateReport {
    /// Ticks missed since the start; wraps.
    pub missed_ticks: u32,
    /// `FLEXSPLINE_MODE_...`.
    pub mode: u8,
    /// 1 if the side of the play is known, else 0.
    pub side_known: u8,
}

/// A value with a mark that shows that it was initialised.
#[repr(C)]
struct Marked<T> {
    mark: u32,
    value: T,
}

/// An object of the caller, by the mark that shows that it was initialised. Each has its campaign of upsets
/// (`tests/campaign.rs`).
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
#[allow(missing_docs)]
pub enum Object {
    Store = 0x7853_5446,
    Joint = 0x784a_5446,
    State = 0x7841_5446,
    Activation = 0x7856_5446,
    Identity = 0x7849_5446,
    Adjustment = 0x7844_5446,
    Learner = 0x784c_5446,
    Slip = 0x7842_5446,
    Encoder = 0x7845_5446,
    TorquePath = 0x7854_5446,
    Aged = 0x7847_5446,
    Upload = 0x7855_5446,
    Watch = 0x7857_5446,
    Predictor = 0x7850_5446,
    Observer = 0x784f_5446,
    Recorder = 0x7852_5446,
    StartUp = 0x7843_5446,
}

const _: () = assert!(FLEXSPLINE_SAVED_BYTES == JointState::SAVED_BYTES);

impl Object {
    /// All of them.
    pub const ALL: [Self; 17] = [
        Self::Store,
        Self::Joint,
        Self::State,
        Self::Activation,
        Self::Identity,
        Self::Adjustment,
        Self::Learner,
        Self::Slip,
        Self::Encoder,
        Self::TorquePath,
        Self::Aged,
        Self::Upload,
        Self::Watch,
        Self::Predictor,
        Self::Observer,
        Self::Recorder,
        Self::StartUp,
    ];
}

/// Whether a value with its mark has room in an opaque object.
const fn fits<O, T>() -> bool {
    size_of::<Marked<T>>() <= size_of::<O>() && align_of::<Marked<T>>() <= 8
}

/// Marks in memory: any two differ in enough bits (a test counts them) that one bit of one may flip.
const fn spread(object: Object) -> u32 {
    (object as u32).wrapping_mul(0x9e37_79b1)
}

/// Whether a mark is this one, but for a bit that an upset turned: a call that writes the object makes it anew.
#[inline(always)]
const fn is_marked(found: u32, object: Object) -> bool {
    let off = found ^ spread(object);
    off & off.wrapping_sub(1) == 0
}

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
fn put<O, T>(object: *mut O, mark: Object, value: T) -> Result<(), FlexsplineStatus> {
    const { assert!(fits::<O, T>()) };
    usable(object)?;
    // SAFETY: not null, aligned for `O`, in which the value has room; the caller owns it.
    unsafe { object.cast::<Marked<T>>().write(Marked { mark: spread(mark), value }) };
    Ok(())
}

/// The value in an opaque object, to read.
fn get<'a, O, T>(object: *const O, mark: Object) -> Result<&'a T, FlexsplineStatus> {
    usable(object)?;
    let marked = object.cast::<Marked<T>>();
    // SAFETY: not null and aligned, and all bytes of the mark are a number whatever they are. Nothing else is looked at
    // before the mark says whose it is: another object may be smaller.
    if !is_marked(unsafe { (&raw const (*marked).mark).read() }, mark) {
        return Err(FlexsplineStatus::NotInitialised);
    }
    // SAFETY: marked, so written by `put`. The reference does not outlive the call it is made in.
    Ok(unsafe { &(*marked).value })
}

/// The object behind a pointer, to write.
fn get_mut<'a, O, T>(object: *mut O, mark: Object) -> Result<&'a mut T, FlexsplineStatus> {
    get::<O, T>(object, mark)?;
    // SAFETY: as in `get`; the callers see to it that nothing else refers to it during the call.
    let marked = unsafe { &mut *object.cast::<Marked<T>>() };
    // A bit of it may have flipped.
    marked.mark = spread(mark);
    Ok(&mut marked.value)
}

/// A plain structure of the caller, copied.
fn copied<T: Copy>(object: *const T) -> Result<T, FlexsplineStatus> {
    usable(object)?;
    // SAFETY: not null, aligned, and of a type in which every pattern of bits is a value (numbers and pointers).
    Ok(unsafe { *object })
}

/// The first entries of a list of the caller, the rest as given; `Argument` for none, or more than there are places.
fn list<T: Copy, const N: usize>(first: *const T, number: u8, mut to: [T; N]) -> Result<[T; N], FlexsplineStatus> {
    usable(first)?;
    let number = number as usize;
    if number == 0 || number > N {
        return Err(FlexsplineStatus::Argument);
    }
    for (place, to) in to.iter_mut().take(number).enumerate() {
        *to = copied(first.wrapping_add(place))?;
    }
    Ok(to)
}

/// Writes an answer; where that is must have been found apart from all that is borrowed.
fn give<T>(to: *mut T, value: T) -> Result<(), FlexsplineStatus> {
    usable(to)?;
    // SAFETY: not null, aligned, and the caller's.
    unsafe { to.write(value) };
    Ok(())
}

fn bytes<'a>(first: *const u8, length: usize) -> Result<&'a [u8], FlexsplineStatus> {
    usable(first)?;
    if length > isize::MAX as usize {
        return Err(FlexsplineStatus::Argument);
    }
    // SAFETY: not null; the caller guarantees this length. Not kept beyond the call.
    Ok(unsafe { core::slice::from_raw_parts(first, length) })
}

/// The images, apart from what is written: to be asked for before that is borrowed. Inlined: a tick would pay for a
/// call.
#[inline(always)]
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

/// Bytes to write; where they are must have been found apart from all that is borrowed.
fn bytes_mut<'a>(first: *mut u8, length: usize) -> Result<&'a mut [u8], FlexsplineStatus> {
    usable(first)?;
    if length > isize::MAX as usize {
        return Err(FlexsplineStatus::Argument);
    }
    // SAFETY: not null; the caller guarantees this length and owns the bytes. Not kept beyond the call.
    Ok(unsafe { core::slice::from_raw_parts_mut(first, length) })
}

/// Whether what is written is apart from what is read.
fn clear<const N: usize>(written: (usize, usize), read: [(usize, usize); N]) -> Result<(), FlexsplineStatus> {
    read.into_iter().try_for_each(|read| apart([written, read]))
}

/// A call that changes objects.
#[inline(always)]
fn status(call: impl FnOnce() -> Result<(), FlexsplineStatus>) -> FlexsplineStatus {
    call().err().unwrap_or(FlexsplineStatus::Ok)
}

/// A call that gives an answer, written only if there is one. `others` are the objects that `ask` borrows: the place of
/// the answer must be apart from all of them.
#[inline(always)]
fn answer<T, const N: usize>(
    to: *mut T,
    others: [(usize, usize); N],
    ask: impl FnOnce() -> Result<T, FlexsplineStatus>,
) -> FlexsplineStatus {
    status(|| {
        usable(to)?;
        clear(span(to), others)?;
        give(to, ask()?)
    })
}

fn joint_of<'a>(joint: *const FlexsplineJoint) -> Result<&'a Joint, FlexsplineStatus> {
    get(joint, Object::Joint)
}

fn store_of<'a>(store: *const FlexsplineStore) -> Result<&'a Store, FlexsplineStatus> {
    get(store, Object::Store)
}

fn state_of<'a>(state: *const FlexsplineState) -> Result<&'a JointState, FlexsplineStatus> {
    get(state, Object::State)
}

/// Why an image is refused, as far as a caller can act on it.
fn image_status(error: ImageError) -> FlexsplineStatus {
    match error {
        ImageError::Falls { .. } | ImageError::Steep { .. } => FlexsplineStatus::Implausible,
        _ => FlexsplineStatus::Image,
    }
}

fn span<T>(pointer: *const T) -> (usize, usize) {
    (pointer as usize, size_of::<T>())
}

/// Makes an empty store, where it lies: nothing of its size is on the stack.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_store_init(store: *mut FlexsplineStore) -> FlexsplineStatus {
    status(|| {
        const { assert!(fits::<FlexsplineStore, Store>()) };
        usable(store)?;
        let marked = store.cast::<Marked<Store>>();
        // SAFETY: not null, aligned, large enough, and the caller's. A store is made of numbers, and
        // one without a table of zeros (a test holds that), so the reference is to a store.
        let marked = unsafe {
            marked.write_bytes(0, 1);
            &mut *marked
        };
        marked.mark = spread(Object::Store);
        Ok(())
    })
}

/// Makes a joint of its settings.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_joint_init(
    joint: *mut FlexsplineJoint,
    settings: *const FlexsplineSettings,
) -> FlexsplineStatus {
    status(|| {
        let s = copied(settings)?;
        let fixed = match s.fixed_member {
            FLEXSPLINE_FIXED_FLEXSPLINE => FixedMember::Flexspline,
            FLEXSPLINE_FIXED_CIRCULAR_SPLINE => FixedMember::CircularSpline,
            _ => return Err(FlexsplineStatus::Argument),
        };
        let overrun = match s.overrun {
            FLEXSPLINE_OVERRUN_SKIP => Overrun::SkipAndCount,
            FLEXSPLINE_OVERRUN_HOLD => Overrun::HoldLast,
            FLEXSPLINE_OVERRUN_FADE if s.fade_ticks > 0 => Overrun::FadeOut { ticks: s.fade_ticks },
            _ => return Err(FlexsplineStatus::Argument),
        };
        let limits = Limits {
            tick_s: s.tick_s,
            rate_rad_s: s.rate_rad_s,
            acceleration_rad_s2: s.acceleration_rad_s2,
            generator_rate_rad_s: s.generator_rate_rad_s,
            debounce_ticks: s.patience,
            deadband_rad: s.hold_rad,
        };
        let argument = FlexsplineStatus::Argument;
        let drive = Drive::new(s.flexspline_teeth, s.circular_spline_teeth, fixed).map_err(|_| argument)?;
        put(joint, Object::Joint, Joint::new(drive, limits, overrun).map_err(|_| argument)?)
    })
}

/// Limits the acceleration of a joint's generator, rad/s^2: a sample that would need more is a glitch, and one that is
/// out and back within two ticks is taken back. A multiple of what motor and load can do. Without this call a sample
/// may need full speed in one tick, and one that is out and back a 64th of that in each. After
/// `flexspline_joint_init`: a state saved before belongs to another joint. `FLEXSPLINE_STATUS_ARGUMENT` if it is not
/// finite or too small to matter in a tick.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_joint_limit_acceleration(joint: *mut FlexsplineJoint, rad_s2: f32) -> FlexsplineStatus {
    status(|| {
        let joint: &mut Joint = get_mut(joint, Object::Joint)?;
        *joint = joint.with_generator_acceleration(rad_s2).map_err(|_| FlexsplineStatus::Argument)?;
        Ok(())
    })
}

/// Makes the state of a joint after a reset.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_state_init(state: *mut FlexsplineState) -> FlexsplineStatus {
    status(|| put(state, Object::State, JointState::new()))
}

/// Checks the images and fills the store from them, between two ticks. If it fails the table in use stays.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_store_activate(
    store: *mut FlexsplineStore,
    joint: *const FlexsplineJoint,
    table: *const FlexsplineImages,
    temperature_c: f32,
) -> FlexsplineStatus {
    status(|| {
        apart([span(store), span(joint)])?;
        let images = images(table, [span(store)])?;
        let joint = joint_of(joint)?;
        let store: &mut Store = get_mut(store, Object::Store)?;
        store.activate(&images, joint.drive(), temperature_c).map(|_| ()).map_err(activate_status)
    })
}

/// Why a table is not activated.
fn activate_status(error: ActivateError) -> FlexsplineStatus {
    match error {
        ActivateError::Image(error) => image_status(error),
        ActivateError::TooLarge { .. } | ActivateError::TooManyPages { .. } => FlexsplineStatus::TooLarge,
        ActivateError::TwoTables => FlexsplineStatus::TwoTables,
        ActivateError::OtherDrive => FlexsplineStatus::OtherDrive,
        ActivateError::SameImage => FlexsplineStatus::SameImage,
        ActivateError::Temperature { .. } => FlexsplineStatus::Argument,
        ActivateError::Torn => FlexsplineStatus::Torn,
    }
}

/// Begins to bring a table into a store in short steps, between ticks.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_activation_begin(
    activation: *mut FlexsplineActivation,
    joint: *const FlexsplineJoint,
    temperature_c: f32,
) -> FlexsplineStatus {
    status(|| {
        apart([span(activation), span(joint)])?;
        let begun = Store::begin(joint_of(joint)?.drive(), temperature_c).map_err(activate_status)?;
        put(activation, Object::Activation, begun)
    })
}

/// A step: the same store and images with each, until `progress` (`FLEXSPLINE_PROGRESS_...`) is done. If a step fails
/// the activation is over; begin again.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_activation_step(
    activation: *mut FlexsplineActivation,
    store: *mut FlexsplineStore,
    table: *const FlexsplineImages,
    progress: *mut u8,
) -> FlexsplineStatus {
    answer(progress, [span(activation), span(store)], || {
        apart([span(activation), span(store)])?;
        let images = images(table, [span(activation), span(store), span(progress)])?;
        let activation: &mut Activation = get_mut(activation, Object::Activation)?;
        let store: &mut Store = get_mut(store, Object::Store)?;
        Ok(match activation.step(store, &images).map_err(activate_status)? {
            Progress::Checking => FLEXSPLINE_PROGRESS_CHECKING,
            Progress::Filling => FLEXSPLINE_PROGRESS_FILLING,
            Progress::Done(_) => FLEXSPLINE_PROGRESS_DONE,
        })
    })
}

/// Begins to find out whether an image is the one of its id.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_identity_begin(identity: *mut FlexsplineIdentity) -> FlexsplineStatus {
    status(|| put(identity, Object::Identity, IdentityCheck::new()))
}

/// Takes in a block of 64 bytes of the image, the same one with each step. `found` (`FLEXSPLINE_IDENTITY_...`) is
/// hashing while there is more, then same or other; with the next step it begins anew.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_identity_step(
    identity: *mut FlexsplineIdentity,
    image: *const u8,
    image_bytes: usize,
    found: *mut u8,
) -> FlexsplineStatus {
    answer(found, [span(identity), (image as usize, image_bytes)], || {
        apart([span(identity), (image as usize, image_bytes)])?;
        let image = bytes(image, image_bytes)?;
        let identity: &mut IdentityCheck = get_mut(identity, Object::Identity)?;
        Ok(match identity.step(image) {
            Identity::Hashing => FLEXSPLINE_IDENTITY_HASHING,
            Identity::Same(_) => FLEXSPLINE_IDENTITY_SAME,
            Identity::Other(_) => FLEXSPLINE_IDENTITY_OTHER,
        })
    })
}

/// Known answers of what a tick is made of, for a slow rate group: `FLEXSPLINE_STATUS_SELF_TEST` if one is another.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_self_test() -> FlexsplineStatus {
    status(|| self_test().map_err(|_| FlexsplineStatus::SelfTest))
}

/// Sets the temperature, degrees C: in a slow rate group.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_store_set_temperature(
    store: *mut FlexsplineStore,
    table: *const FlexsplineImages,
    temperature_c: f32,
) -> FlexsplineStatus {
    status(|| {
        let images = images(table, [span(store)])?;
        let store: &mut Store = get_mut(store, Object::Store)?;
        if store.set_temperature(&images, temperature_c) { Ok(()) } else { Err(FlexsplineStatus::Argument) }
    })
}

/// Checks the given number of words of the images: in a slow rate group.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_store_check_images(
    store: *mut FlexsplineStore,
    table: *const FlexsplineImages,
    words: u16,
) -> FlexsplineStatus {
    status(|| {
        let images = images(table, [span(store)])?;
        let store: &mut Store = get_mut(store, Object::Store)?;
        store.check_images(&images, words as usize);
        Ok(())
    })
}

/// Writes the report on a store.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_store_report(
    store: *const FlexsplineStore,
    report: *mut FlexsplineStoreReport,
) -> FlexsplineStatus {
    answer(report, [span(store)], || {
        let store = store_of(store)?;
        let Counters { doubtful_ticks, words_mended, words_skipped, pages_damaged, passes } = store.counters();
        let (image, page) = store.damaged_page().unwrap_or((255, 0));
        Ok(FlexsplineStoreReport {
            table_id: store.id().0,
            doubtful_ticks,
            words_mended,
            words_skipped,
            pages_damaged,
            passes,
            health: store.health().code(),
            damaged_image: image as u8,
            damaged_page: page as u8,
        })
    })
}

/// Writes a damaged page of an image in memory again from the other image, both whole images of `bytes` bytes, and
/// notifies the store. What `flexspline_store_report` named is `image` and `page`.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_store_mend_page(
    store: *mut FlexsplineStore,
    damaged: *mut u8,
    good: *const u8,
    length: usize,
    image: u8,
    page: u8,
) -> FlexsplineStatus {
    status(|| {
        apart([span(store), (damaged as usize, length), (good as usize, length)])?;
        let store: &mut Store = get_mut(store, Object::Store)?;
        let (damaged, good) = (bytes_mut(damaged, length)?, bytes(good, length)?);
        if image > 1 || !Images::mend_page(damaged, good, page as usize) {
            return Err(FlexsplineStatus::Argument);
        }
        store.mended(image as usize, page as usize);
        Ok(())
    })
}

/// Makes a copy of a joint's settings that is not whole anew from the other; `FLEXSPLINE_STATUS_ARGUMENT` if neither
/// is. In a slow rate group.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_joint_mend(joint: *mut FlexsplineJoint) -> FlexsplineStatus {
    status(|| {
        let joint: &mut Joint = get_mut(joint, Object::Joint)?;
        if joint.mend() { Ok(()) } else { Err(FlexsplineStatus::Argument) }
    })
}

/// Changes the mode (`FLEXSPLINE_MODE_...`): `FLEXSPLINE_STATUS_MODE` where there is no such transition
/// (`flexspline_mode_may_become`).
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_state_request(state: *mut FlexsplineState, mode: u8) -> FlexsplineStatus {
    status(|| {
        let state: &mut JointState = get_mut(state, Object::State)?;
        if mode > FLEXSPLINE_MODE_SAFE {
            return Err(FlexsplineStatus::Argument);
        }
        state.request(Mode::from_code(mode as u32)).map_err(|_| FlexsplineStatus::Mode)
    })
}

/// On command: which side of the play the drive rests on is not known any more, as after work on it.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_state_forget_side(state: *mut FlexsplineState) -> FlexsplineStatus {
    status(|| {
        let state: &mut JointState = get_mut(state, Object::State)?;
        state.forget_side();
        Ok(())
    })
}

/// Writes the report on a state, as the last tick left it.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_state_report(
    state: *const FlexsplineState,
    report: *mut FlexsplineStateReport,
) -> FlexsplineStatus {
    answer(report, [span(state)], || {
        let state = state_of(state)?;
        Ok(FlexsplineStateReport {
            missed_ticks: state.missed_ticks(),
            mode: state.mode().code() as u8,
            side_known: state.play().is_known() as u8,
        })
    })
}

/// Writes what must survive a reset: `FLEXSPLINE_SAVED_BYTES` bytes, with version, table and joint.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_state_save(
    state: *const FlexsplineState,
    joint: *const FlexsplineJoint,
    store: *const FlexsplineStore,
    saved: *mut [u8; FLEXSPLINE_SAVED_BYTES],
) -> FlexsplineStatus {
    answer(saved, [span(state), span(joint), span(store)], || {
        Ok(state_of(state)?.save(joint_of(joint)?, store_of(store)?))
    })
}

/// Makes a state of bytes that the same joint saved with the same table, in mode off; only if the joint cannot have
/// moved meanwhile. The first sample is held against the one that was saved.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_state_restore(
    state: *mut FlexsplineState,
    joint: *const FlexsplineJoint,
    store: *const FlexsplineStore,
    saved: *const [u8; FLEXSPLINE_SAVED_BYTES],
) -> FlexsplineStatus {
    status(|| {
        clear(span(state), [span(joint), span(store), span(saved)])?;
        let restored = JointState::restore(&copied(saved)?, joint_of(joint)?, store_of(store)?);
        put(state, Object::State, restored.map_err(restore_status)?)
    })
}

/// Why saved bytes are not restored.
fn restore_status(error: RestoreError) -> FlexsplineStatus {
    match error {
        RestoreError::OtherTable => FlexsplineStatus::OtherTable,
        RestoreError::OtherJoint => FlexsplineStatus::OtherJoint,
        RestoreError::Version { .. } | RestoreError::Crc | RestoreError::Impossible => FlexsplineStatus::Saved,
    }
}

/// Input of a tick, as the core takes it.
#[inline(always)]
fn core_input(input: &FlexsplineInput) -> Input {
    let generator = GeneratorAngle::from_counts(input.generator_counts);
    Input {
        generator: if input.has_generator != 0 { Some(generator) } else { None },
        target: OutputAngle::from_counts(input.target_counts),
        torque_n_m: input.torque_n_m,
        missed_ticks: input.missed_ticks,
        adjustment: Adjustment::new(input.mean_counts, input.half_width_counts),
    }
}

/// One tick: from what was measured to what to command, once every `tick_s` and in the order of time.
/// `FLEXSPLINE_STATUS_OK` also where no correction could be made: `flags` and `quality` of the output say so.
///
/// The adjustment in the input is taken as known, and unprotected: what learning or springs add belongs into an
/// adjustment of its own (`flexspline_tick_adjusted`).
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_tick(
    joint: *const FlexsplineJoint,
    table: *const FlexsplineImages,
    store: *mut FlexsplineStore,
    state: *mut FlexsplineState,
    input: *const FlexsplineInput,
    output: *mut FlexsplineOutput,
) -> FlexsplineStatus {
    tick(joint, table, store, state, input, None, output)
}

/// As `flexspline_tick`, with an adjustment that was kept under a sum since the tick before, and has its uncertainty;
/// that of the input comes on top.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_tick_adjusted(
    joint: *const FlexsplineJoint,
    table: *const FlexsplineImages,
    store: *mut FlexsplineStore,
    state: *mut FlexsplineState,
    input: *const FlexsplineInput,
    adjustment: *const FlexsplineAdjustment,
    output: *mut FlexsplineOutput,
) -> FlexsplineStatus {
    tick(joint, table, store, state, input, Some(adjustment), output)
}

#[inline(always)]
fn tick(
    joint: *const FlexsplineJoint,
    table: *const FlexsplineImages,
    store: *mut FlexsplineStore,
    state: *mut FlexsplineState,
    input: *const FlexsplineInput,
    adjustment: Option<*const FlexsplineAdjustment>,
    output: *mut FlexsplineOutput,
) -> FlexsplineStatus {
    status(|| {
        apart([span(joint), span(store), span(state), span(output)])?;
        usable(output)?;
        let images = images(table, [span(store), span(state), span(output)])?;
        if let Some(own) = adjustment {
            clear(span(own), [span(store), span(state), span(output)])?;
        }
        let input = copied(input)?;
        let joint = joint_of(joint)?;
        let store: &mut Store = get_mut(store, Object::Store)?;
        let state: &mut JointState = get_mut(state, Object::State)?;
        let mut input = core_input(&input);
        if let Some(own) = adjustment {
            let own: &Adjustment = get(own, Object::Adjustment)?;
            input.adjustment = input.adjustment.plus(*own);
        }
        let found = joint.tick(&images, store, state, &input);
        let filled = FlexsplineOutput {
            command_counts: found.command.counts(),
            output_counts: found.output.counts(),
            transmission_error_rad: found.transmission_error_rad,
            uncertainty_rad: found.uncertainty_rad,
            correction_rad: found.correction_rad,
            held_back_rad: found.held_back_rad,
            quality: found.quality.code(),
            flags: Flags::bits(found.flags),
        };
        give(output, filled)
    })
}

#[cfg(test)]
mod mixed;

#[cfg(test)]
mod tests {
    use super::*;
    use core::ptr::{null, null_mut};
    use flexspline::testing::fixture;
    use std::boxed::Box;
    use std::sync::LazyLock;
    use std::vec::Vec;

    pub(super) const SETTINGS: FlexsplineSettings = FlexsplineSettings {
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
        hold_rad: 0.0,
    };

    /// The same for Rust.
    pub(super) const LIMITS: Limits = Limits {
        tick_s: SETTINGS.tick_s,
        rate_rad_s: SETTINGS.rate_rad_s,
        acceleration_rad_s2: SETTINGS.acceleration_rad_s2,
        generator_rate_rad_s: SETTINGS.generator_rate_rad_s,
        debounce_ticks: SETTINGS.patience,
        deadband_rad: SETTINGS.hold_rad,
    };

    pub(super) struct Objects {
        pub store: Box<FlexsplineStore>,
        pub joint: FlexsplineJoint,
        pub state: FlexsplineState,
    }

    fn blank() -> Objects {
        Objects {
            store: Box::new(FlexsplineStore { opaque: [MaybeUninit::zeroed(); FLEXSPLINE_STORE_WORDS] }),
            joint: FlexsplineJoint { opaque: [MaybeUninit::zeroed(); FLEXSPLINE_JOINT_WORDS] },
            state: FlexsplineState { opaque: [MaybeUninit::zeroed(); FLEXSPLINE_STATE_WORDS] },
        }
    }

    pub(super) fn made() -> Objects {
        let mut o = blank();
        assert_eq!(flexspline_store_init(&mut *o.store), FlexsplineStatus::Ok);
        assert_eq!(flexspline_joint_init(&mut o.joint, &SETTINGS), FlexsplineStatus::Ok);
        assert_eq!(flexspline_state_init(&mut o.state), FlexsplineStatus::Ok);
        o
    }

    /// Two images at two places.
    pub(super) fn pair(image: &[u8], twin: &[u8]) -> FlexsplineImages {
        FlexsplineImages {
            first: image.as_ptr(),
            first_bytes: image.len(),
            second: twin.as_ptr(),
            second_bytes: twin.len(),
        }
    }

    /// A table twice.
    pub(super) static TABLE: LazyLock<[Vec<u8>; 2]> = LazyLock::new(|| [false; 2].map(fixture::image));

    pub(super) fn table() -> FlexsplineImages {
        pair(&TABLE[0], &TABLE[1])
    }

    /// Objects with the table in use.
    pub(super) fn active() -> (Objects, FlexsplineImages) {
        let (mut o, table) = (made(), table());
        assert_eq!(flexspline_store_activate(&mut *o.store, &o.joint, &table, 20.0), FlexsplineStatus::Ok);
        (o, table)
    }

    pub(super) const INPUT: FlexsplineInput = FlexsplineInput {
        generator_counts: 1 << 30,
        target_counts: 11_000_000,
        torque_n_m: 5.0,
        missed_ticks: 0,
        has_generator: 1,
        mean_counts: 0,
        half_width_counts: 0,
    };

    #[test]
    fn a_tick_through_c_is_a_tick() {
        let (mut o, table) = active();
        assert_eq!(flexspline_state_request(&mut o.state, 1), FlexsplineStatus::Ok);
        let mut out = FlexsplineOutput::default();
        assert_eq!(
            flexspline_tick(&o.joint, &table, &mut *o.store, &mut o.state, &INPUT, &mut out),
            FlexsplineStatus::Ok
        );

        let images = Images::new(&TABLE[0], &TABLE[1]);
        let joint = Joint::new(fixture::drive(), LIMITS, Overrun::FadeOut { ticks: 50 }).unwrap();
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
        assert_eq!(flexspline_state_save(&o.state, &o.joint, &*o.store, &mut saved), FlexsplineStatus::Ok);
        assert_eq!(saved, state.save(&joint, &store));
        assert_eq!(flexspline_state_restore(&mut o.state, &o.joint, &*o.store, &saved), FlexsplineStatus::Ok);
        saved[30] ^= 1;
        assert_eq!(flexspline_state_restore(&mut o.state, &o.joint, &*o.store, &saved), FlexsplineStatus::Saved);
        saved[30] ^= 1;
        let mut other = blank();
        let settings = FlexsplineSettings { patience: 6, ..SETTINGS };
        assert_eq!(flexspline_joint_init(&mut other.joint, &settings), FlexsplineStatus::Ok);
        let found = flexspline_state_restore(&mut o.state, &other.joint, &*o.store, &saved);
        assert_eq!(found, FlexsplineStatus::OtherJoint);
        assert_eq!(flexspline_store_init(&mut *other.store), FlexsplineStatus::Ok);
        let found = flexspline_state_restore(&mut o.state, &o.joint, &*other.store, &saved);
        assert_eq!(found, FlexsplineStatus::OtherTable);
        assert_eq!(flexspline_store_set_temperature(&mut *o.store, &table, 30.0), FlexsplineStatus::Ok);
        assert_eq!(flexspline_store_set_temperature(&mut *o.store, &table, f32::NAN), FlexsplineStatus::Argument);
        assert_eq!(flexspline_store_check_images(&mut *o.store, &table, 100), FlexsplineStatus::Ok);
    }

    #[test]
    fn a_table_is_activated_in_steps() {
        let (mut o, table) = (made(), table());
        let mut activation = Box::new(FlexsplineActivation { opaque: [MaybeUninit::new(7); _] });
        let mut progress = 9;
        let step = |o: &mut Objects, activation: &mut FlexsplineActivation, progress: &mut u8| {
            flexspline_activation_step(activation, &mut *o.store, &table, progress)
        };
        assert_eq!(step(&mut o, &mut activation, &mut progress), FlexsplineStatus::NotInitialised);
        let begun = flexspline_activation_begin(&mut *activation, &o.joint, f32::NAN);
        assert_eq!(begun, FlexsplineStatus::Argument);
        assert_eq!(flexspline_activation_begin(&mut *activation, &o.joint, 20.0), FlexsplineStatus::Ok);
        let inside = (&raw mut *activation).cast::<u8>();
        let found = flexspline_activation_step(&mut *activation, &mut *o.store, &table, inside);
        assert_eq!((found, progress), (FlexsplineStatus::Overlap, 9));
        let null = core::ptr::null_mut();
        let found = flexspline_activation_step(&mut *activation, &mut *o.store, &table, null);
        assert_eq!(found, FlexsplineStatus::Pointer);
        let mut seen = [0; 3];
        while progress != 2 {
            assert_eq!(step(&mut o, &mut activation, &mut progress), FlexsplineStatus::Ok);
            seen[usize::from(progress)] += 1;
        }
        assert!(seen[0] > 200 && seen[1] > 50 && seen[2] == 1, "{seen:?}");
        let mut at_once = made();
        assert_eq!(flexspline_store_activate(&mut *at_once.store, &o.joint, &table, 20.0), FlexsplineStatus::Ok);
        let mut reports = [FlexsplineStoreReport::default(); 2];
        let [one, other] = &mut reports;
        assert_eq!(flexspline_store_report(&*o.store, one), FlexsplineStatus::Ok);
        assert_eq!(flexspline_store_report(&*at_once.store, other), FlexsplineStatus::Ok);
        assert_eq!((one.table_id, one.health), (other.table_id, 0));
        assert!(one.table_id != [0; 8]);
    }

    #[test]
    fn an_image_is_verified_and_the_program_tested_from_c() {
        assert_eq!(flexspline_self_test(), FlexsplineStatus::Ok);
        let mut image = fixture::image(false);
        let mut identity = Box::new(FlexsplineIdentity { opaque: [MaybeUninit::new(7); _] });
        let mut found = 9;
        let step = flexspline_identity_step;
        assert_eq!(step(&mut *identity, image.as_ptr(), image.len(), &mut found), FlexsplineStatus::NotInitialised);
        assert_eq!(flexspline_identity_begin(&mut *identity), FlexsplineStatus::Ok);
        let null = core::ptr::null();
        assert_eq!(step(&mut *identity, null, image.len(), &mut found), FlexsplineStatus::Pointer);
        let inside = image.as_mut_ptr();
        assert_eq!(step(&mut *identity, inside, image.len(), inside), FlexsplineStatus::Overlap);
        let mut run = |image: &[u8]| {
            for _ in 0..5000 {
                let status = step(&mut *identity, image.as_ptr(), image.len(), &mut found);
                assert_eq!(status, FlexsplineStatus::Ok);
                if found != 0 {
                    break;
                }
            }
            found
        };
        // The fixture's id is no BLAKE3.
        assert_eq!(run(&image), 2);
        let mut hash = flexspline::IdentityCheck::new();
        let real = (0..5000).map(|_| hash.step(&image)).find(|found| *found != flexspline::Identity::Hashing);
        let Some(flexspline::Identity::Other(id)) = real else { panic!("{real:?}") };
        image[48..56].copy_from_slice(&id.0);
        assert_eq!(run(&image), 1);
        image[1000] ^= 1;
        assert_eq!(run(&image), 2);
    }

    #[test]
    fn what_is_known_can_be_read_and_mended() {
        let mut images = [fixture::image(false), fixture::image(false)];
        images[1][700] ^= 4;
        let table = |images: &[Vec<u8>; 2]| pair(&images[0], &images[1]);
        let mut o = made();
        let mut seen = FlexsplineStoreReport::default();
        let mut report = |store: &FlexsplineStore| {
            assert_eq!(flexspline_store_report(store, &mut seen), FlexsplineStatus::Ok);
            seen
        };
        assert_eq!(report(&o.store).health, 3);
        // An empty store is the one of Rust.
        let empty: &Store = get(&*o.store, Object::Store).unwrap();
        assert_eq!(std::format!("{empty:?}"), std::format!("{:?}", Store::new()));
        let bad = flexspline_store_activate(&mut *o.store, &o.joint, &table(&images), f32::NAN);
        assert_eq!((bad, report(&o.store).health), (FlexsplineStatus::Argument, 3));
        let once = FlexsplineImages { second: images[0].as_ptr(), ..table(&images) };
        let found = flexspline_store_activate(&mut *o.store, &o.joint, &once, 20.0);
        assert_eq!(found, FlexsplineStatus::SameImage);
        assert_eq!(flexspline_store_activate(&mut *o.store, &o.joint, &table(&images), 20.0), FlexsplineStatus::Ok);
        assert_eq!(flexspline_store_check_images(&mut *o.store, &table(&images), 20_000), FlexsplineStatus::Ok);
        let damaged = report(&o.store);
        assert_eq!((damaged.health, damaged.damaged_image, damaged.damaged_page), (1, 1, 2));
        let [good, bad] = &mut images;
        let mend = flexspline_store_mend_page(&mut *o.store, bad.as_mut_ptr(), good.as_ptr(), good.len(), 1, 2);
        assert_eq!((mend, good == bad), (FlexsplineStatus::Ok, true));
        let whole = report(&o.store);
        assert_eq!((whole.health, whole.damaged_image), (0, 255));
        assert_eq!(whole.table_id, flexspline::Table::check(&images[0]).unwrap().id().0);

        let mut state = FlexsplineStateReport::default();
        assert_eq!(flexspline_state_request(&mut o.state, 1), FlexsplineStatus::Ok);
        assert_eq!(flexspline_state_report(&o.state, &mut state), FlexsplineStatus::Ok);
        assert_eq!((state.mode, state.side_known), (1, 0));
        assert_eq!(flexspline_state_forget_side(&mut o.state), FlexsplineStatus::Ok);
        assert_eq!(flexspline_joint_mend(&mut o.joint), FlexsplineStatus::Ok);
        // SAFETY: texts of the library.
        let text = |name: *const core::ffi::c_char| unsafe { core::ffi::CStr::from_ptr(name) }.to_str().unwrap();
        assert_eq!(text(flexspline_version()), env!("CARGO_PKG_VERSION"));
        assert_eq!([text(flexspline_mode_name(3)), text(flexspline_health_name(4))], ["safe", "torn"]);
        assert_eq!(
            (flexspline_format_version(), text(flexspline_mode_name(9))),
            (flexspline::Table::FORMAT_VERSION, "?")
        );
        let flags = [Flags::SAMPLE_LOST, Flags::TABLE_DOUBT, Flags::JOINT_TORN, Flags::SAFE, Flags::OTHER_IMAGES];
        let names = ["sample lost", "table doubt", "joint torn", "safe", "other images"];
        assert!(flags.iter().zip(names).all(|(flag, name)| text(flexspline_flag_name(flag.bits())) == name));
    }

    #[test]
    fn every_argument_is_checked() {
        use FlexsplineStatus::{Argument, Image, Mode, NotInitialised, OtherDrive, Overlap, Pointer};
        let (mut o, mut raw, table) = (made(), blank(), table());
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

        // An image, or the structure that points to it, inside the memory that is written.
        let store = &raw mut *o.store;
        let within = FlexsplineImages { second: store.cast_const().cast(), second_bytes: 100, ..table };
        assert_eq!(flexspline_store_activate(store, &o.joint, &within, 20.0), Overlap);
        assert_eq!(flexspline_store_set_temperature(store, &within, 20.0), Overlap);
        assert_eq!(flexspline_store_check_images(store, &within, 9), Overlap);
        assert_eq!(flexspline_tick(&o.joint, &within, store, &mut o.state, &INPUT, &mut out), Overlap);
        let mut room = [table; 400];
        let inside = room.as_mut_ptr().cast::<FlexsplineStore>();
        assert_eq!(flexspline_store_init(inside), FlexsplineStatus::Ok);
        let moved = inside.cast::<FlexsplineImages>().wrapping_add(300);
        // SAFETY: inside the room; the store holds nothing there yet that is read before the call refuses.
        unsafe { moved.write(table) };
        assert_eq!(flexspline_store_check_images(inside, moved, 9), FlexsplineStatus::Ok, "beyond the store");
        let moved = inside.cast::<FlexsplineImages>().wrapping_add(100);
        unsafe { moved.write(table) };
        assert_eq!(flexspline_store_check_images(inside, moved, 9), Overlap);
    }

    #[test]
    fn settings_make_the_joint_they_name() {
        let members = [FixedMember::Flexspline, FixedMember::CircularSpline];
        let policies = [Overrun::SkipAndCount, Overrun::HoldLast, Overrun::FadeOut { ticks: 50 }];
        for (fixed_member, member) in (0..).zip(members) {
            for (overrun, policy) in (0..).zip(policies) {
                let mut o = blank();
                let settings = FlexsplineSettings { fixed_member, overrun, ..SETTINGS };
                assert_eq!(flexspline_joint_init(&mut o.joint, &settings), FlexsplineStatus::Ok);
                let expected = Joint::new(Drive::new(188, 190, member).unwrap(), LIMITS, policy).unwrap();
                assert_eq!(get::<_, Joint>(&o.joint, Object::Joint), Ok(&expected), "{fixed_member} {overrun}");
            }
        }
    }

    #[test]
    fn each_number_is_the_mode_it_stands_for() {
        for (number, mode) in (0..).zip([Mode::Off, Mode::Tracking, Mode::Hold, Mode::Safe]) {
            let mut o = made();
            assert_eq!(flexspline_state_request(&mut o.state, 1), FlexsplineStatus::Ok);
            assert_eq!(flexspline_state_request(&mut o.state, number), FlexsplineStatus::Ok);
            assert_eq!(get::<_, JointState>(&o.state, Object::State).unwrap().mode(), mode);
        }
    }

    #[test]
    fn each_quality_and_a_missing_sample_are_told() {
        let (mut o, table) = active();
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
        let (mut o, table) = (made(), table());
        let state = (&raw const o.state).cast::<FlexsplineJoint>();
        assert_eq!(flexspline_store_activate(&mut *o.store, state, &table, 20.0), FlexsplineStatus::NotInitialised);
        let joint = (&raw mut o.joint).cast::<FlexsplineState>();
        assert_eq!(flexspline_state_request(joint, 1), FlexsplineStatus::NotInitialised);
    }
}
