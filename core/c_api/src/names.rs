//! Versions, and numbers that have a name.

use super::*;
use core::ffi::{CStr, c_char, c_int};

/// Version of this header: the first of three numbers.
pub const FLEXSPLINE_VERSION_MAJOR: u32 = 0;
/// The second.
pub const FLEXSPLINE_VERSION_MINOR: u32 = 1;
/// The third.
pub const FLEXSPLINE_VERSION_PATCH: u32 = 0;
/// 10000 times the first, 100 times the second, and the third: as `flexspline_version_number` says of the library.
pub const FLEXSPLINE_VERSION_NUMBER: u32 = 100;

/// No correction: it is taken back within the limits. The start.
pub const FLEXSPLINE_MODE_OFF: u8 = 0;
/// The correction follows the table.
pub const FLEXSPLINE_MODE_TRACKING: u8 = 1;
/// The correction stays as it is; withdrawn where none could be made for `debounce_ticks`, it stays so.
pub const FLEXSPLINE_MODE_HOLD: u8 = 2;
/// No correction, and none before off was asked for: after a fault.
pub const FLEXSPLINE_MODE_SAFE: u8 = 3;

/// Trust estimate and correction. Output angles, and loads at an angle, that were not recorded count as inside.
pub const FLEXSPLINE_QUALITY_IN_RANGE: u8 = 0;
/// The side of the play is not known yet: the uncertainty says by how much the estimate can be off.
pub const FLEXSPLINE_QUALITY_UNCERTAIN: u8 = 1;
/// Torque or temperature lies beyond the table: that of its edge is used.
pub const FLEXSPLINE_QUALITY_EXTRAPOLATED: u8 = 2;
/// Nothing can be said: the error is taken as none.
pub const FLEXSPLINE_QUALITY_DISABLED: u8 = 3;

/// Both images are whole, as far as they were checked.
pub const FLEXSPLINE_HEALTH_SOUND: u8 = 0;
/// A page of one image is damaged, and can be written again from the other.
pub const FLEXSPLINE_HEALTH_ONE_IMAGE: u8 = 1;
/// A page is damaged in both images.
pub const FLEXSPLINE_HEALTH_LOST: u8 = 2;
/// There is no table.
pub const FLEXSPLINE_HEALTH_EMPTY: u8 = 3;
/// The store's data on the table is corrupt: activate it again.
pub const FLEXSPLINE_HEALTH_TORN: u8 = 4;

/// A tick that came late: the ticks missed are counted, nothing more.
pub const FLEXSPLINE_OVERRUN_SKIP: u8 = 0;
/// The correction stays as it is in that tick, in tracking and hold, and where some can be made.
pub const FLEXSPLINE_OVERRUN_HOLD: u8 = 1;
/// The correction fades out within `fade_ticks`, stays there for as many after the last late tick, and comes back.
pub const FLEXSPLINE_OVERRUN_FADE: u8 = 2;

/// The flexspline is fixed, the circular spline is the output.
pub const FLEXSPLINE_FIXED_FLEXSPLINE: u8 = 0;
/// The circular spline is fixed, the flexspline is the output.
pub const FLEXSPLINE_FIXED_CIRCULAR_SPLINE: u8 = 1;

/// `flexspline_activation_step`: the images are checked, the store is as it was.
pub const FLEXSPLINE_PROGRESS_CHECKING: u8 = 0;
/// The store is filled, and has no table meanwhile.
pub const FLEXSPLINE_PROGRESS_FILLING: u8 = 1;
/// The table is in use.
pub const FLEXSPLINE_PROGRESS_DONE: u8 = 2;

/// `flexspline_identity_step`: there is more to take in.
pub const FLEXSPLINE_IDENTITY_HASHING: u8 = 0;
/// The image is the one of its id.
pub const FLEXSPLINE_IDENTITY_SAME: u8 = 1;
/// It is not.
pub const FLEXSPLINE_IDENTITY_OTHER: u8 = 2;

const fn number(text: &str) -> u32 {
    match u32::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => u32::MAX,
    }
}

const _: () = {
    assert!(
        FLEXSPLINE_VERSION_MAJOR == number(env!("CARGO_PKG_VERSION_MAJOR"))
            && FLEXSPLINE_VERSION_MINOR == number(env!("CARGO_PKG_VERSION_MINOR"))
            && FLEXSPLINE_VERSION_PATCH == number(env!("CARGO_PKG_VERSION_PATCH")),
        "FLEXSPLINE_VERSION_MAJOR, _MINOR, _PATCH are not those of the package"
    );
    let above = FLEXSPLINE_VERSION_MAJOR.wrapping_mul(100).wrapping_add(FLEXSPLINE_VERSION_MINOR).wrapping_mul(100);
    assert!(FLEXSPLINE_VERSION_NUMBER == above.wrapping_add(FLEXSPLINE_VERSION_PATCH));
    assert!(
        FLEXSPLINE_MODE_OFF as u32 == Mode::code(Mode::Off)
            && FLEXSPLINE_MODE_TRACKING as u32 == Mode::code(Mode::Tracking)
    );
    assert!(
        FLEXSPLINE_MODE_HOLD as u32 == Mode::code(Mode::Hold) && FLEXSPLINE_MODE_SAFE as u32 == Mode::code(Mode::Safe)
    );
};

/// Sizes of all that goes between C and the library: what `FLEXSPLINE_LAYOUT` of the header adds up.
const SIZES: [usize; 53] = [
    size_of::<FlexsplineStatus>(),
    size_of::<usize>(),
    size_of::<FlexsplineStore>(),
    size_of::<FlexsplineActivation>(),
    size_of::<FlexsplineIdentity>(),
    size_of::<FlexsplineJoint>(),
    size_of::<FlexsplineState>(),
    size_of::<FlexsplineSettings>(),
    size_of::<FlexsplineImages>(),
    size_of::<FlexsplineInput>(),
    size_of::<FlexsplineOutput>(),
    size_of::<FlexsplineStoreReport>(),
    size_of::<FlexsplineStateReport>(),
    size_of::<FlexsplineUpload>(),
    size_of::<FlexsplineWatch>(),
    size_of::<FlexsplinePredictor>(),
    size_of::<FlexsplineObserver>(),
    size_of::<FlexsplineEvents>(),
    size_of::<FlexsplineMeasured>(),
    size_of::<FlexsplineObserverReport>(),
    size_of::<FlexsplineNow>(),
    size_of::<FlexsplineAhead>(),
    size_of::<FlexsplineInertias>(),
    size_of::<FlexsplineNoise>(),
    size_of::<FlexsplineDisturbance>(),
    size_of::<FlexsplinePrediction>(),
    size_of::<FlexsplineCommand>(),
    size_of::<FlexsplineLocated>(),
    size_of::<FlexsplineTorqueFromWindUp>(),
    size_of::<FlexsplinePlay>(),
    size_of::<FlexsplineImageReport>(),
    size_of::<FlexsplineTorqueSettings>(),
    size_of::<FlexsplineTorquePath>(),
    size_of::<FlexsplineAged>(),
    size_of::<FlexsplineMotionAhead>(),
    size_of::<FlexsplineCoefficient>(),
    size_of::<FlexsplineLearnSettings>(),
    size_of::<FlexsplineLearner>(),
    size_of::<FlexsplineAdapted>(),
    size_of::<FlexsplineLearnerReport>(),
    size_of::<FlexsplineLearnt>(),
    size_of::<FlexsplineSpring>(),
    size_of::<FlexsplineSlip>(),
    size_of::<FlexsplineSlipReport>(),
    size_of::<FlexsplineRecorder>(),
    size_of::<FlexsplineRecord>(),
    size_of::<FlexsplineEncoderSettings>(),
    size_of::<FlexsplineEncoder>(),
    size_of::<FlexsplineStartUp>(),
    size_of::<FlexsplineStartUpSettings>(),
    size_of::<FlexsplineReadings>(),
    size_of::<FlexsplineStartUpStep>(),
    size_of::<FlexsplineAdjustment>(),
];

/// A sum of the sizes of all types of this header, as the library has them. Where it is not `FLEXSPLINE_LAYOUT` the
/// program was compiled with another header, or with options that change a layout (packed structures, enumerations of
/// another size): do not go on.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_layout() -> u32 {
    const LAYOUT: u32 = {
        let (mut sum, mut sizes) = (0u32, SIZES.as_slice());
        while let [size, rest @ ..] = sizes {
            sum = sum.wrapping_mul(31).wrapping_add(*size as u32);
            sizes = rest;
        }
        sum
    };
    LAYOUT
}

/// Version of this library, as text.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// Version of this library, to compare with `FLEXSPLINE_VERSION_NUMBER` of the header.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_version_number() -> u32 {
    FLEXSPLINE_VERSION_NUMBER
}

/// Version of the table format that is read.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_format_version() -> u16 {
    Table::FORMAT_VERSION
}

/// Text of a number; "?" where there is none. Static, as all texts here.
fn text(texts: &'static [&'static CStr], number: usize) -> *const c_char {
    texts.get(number).copied().unwrap_or(c"?").as_ptr()
}

/// Text of the one bit that is set; "?" where there is none, or none for it.
fn name_of_bit(names: &'static [&'static CStr], bits: u16) -> *const c_char {
    text(names, if bits.is_power_of_two() { bits.trailing_zeros() as usize } else { usize::MAX })
}

/// Short text of a status.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_status_text(status: c_int) -> *const c_char {
    const TEXTS: [&CStr; 19] = [
        c"done",
        c"a pointer is null or not aligned",
        c"an object was not initialised, or is damaged",
        c"objects overlap of which one is written",
        c"a number is not allowed",
        c"neither image is a table",
        c"larger than there is room for",
        c"the table is for another drive",
        c"no transition between these modes",
        c"the saved bytes are damaged",
        c"each image is a table, and they differ",
        c"saved with another table",
        c"saved with other settings",
        c"both images are the same place in memory",
        c"not the next chunk of an upload",
        c"not all bytes of an upload came",
        c"the image is whole, and no drive is like that",
        c"what was kept of an activation is not whole",
        c"the self-test failed",
    ];
    text(&TEXTS, usize::try_from(status).unwrap_or(usize::MAX))
}

/// Name of a mode.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_mode_name(mode: u8) -> *const c_char {
    text(&[c"off", c"tracking", c"hold", c"safe"], mode as usize)
}

/// 1 if a mode may be followed by another, else 0: everything may become off or safe; off and hold tracking; tracking
/// hold.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_mode_may_become(mode: u8, next: u8) -> u8 {
    let known = mode <= FLEXSPLINE_MODE_SAFE && next <= FLEXSPLINE_MODE_SAFE;
    (known && Mode::from_code(mode as u32).may_become(Mode::from_code(next as u32))) as u8
}

/// Name of a quality.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_quality_name(quality: u8) -> *const c_char {
    text(&[c"in range", c"uncertain", c"extrapolated", c"disabled"], quality as usize)
}

/// Name of a health, as in `FlexsplineStoreReport`.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_health_name(health: u8) -> *const c_char {
    text(&[c"sound", c"one image", c"lost", c"empty", c"torn"], health as usize)
}

/// Name of one flag: of `FLEXSPLINE_FLAG_...`, one bit at a time.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_flag_name(flag: u16) -> *const c_char {
    const NAMES: [&CStr; 11] = [
        c"sample lost",
        c"glitch",
        c"overrun",
        c"held back",
        c"not corrected",
        c"table doubt",
        c"state torn",
        c"joint torn",
        c"safe",
        c"other images",
        c"bounded",
    ];
    name_of_bit(&NAMES, flag)
}

/// Name of one event: of `FLEXSPLINE_EVENT_...`, one bit at a time.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_event_name(event: u16) -> *const c_char {
    const NAMES: [&CStr; 8] =
        [c"mode", c"health", c"page damaged", c"table doubt", c"fallback", c"recovered", c"overrun", c"state torn"];
    name_of_bit(&NAMES, event)
}

/// Name of what is implausible: of `FLEXSPLINE_IMPLAUSIBLE_...`, one bit at a time.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_implausible_name(implausible: u16) -> *const c_char {
    const NAMES: [&CStr; 11] = [
        c"generator lost",
        c"generator still",
        c"generator sign",
        c"generator ratio",
        c"output still",
        c"output sign",
        c"output ratio",
        c"torque still",
        c"torque sign",
        c"torque ratio",
        c"lost",
    ];
    name_of_bit(&NAMES, implausible)
}

/// Name of what is done in a tick that came late: of `FLEXSPLINE_OVERRUN_...`.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_overrun_name(overrun: u8) -> *const c_char {
    text(&[c"skip and count", c"hold last", c"fade out"], overrun as usize)
}

/// Name of a fixed member: of `FLEXSPLINE_FIXED_...`.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_fixed_member_name(fixed_member: u8) -> *const c_char {
    text(&[c"flexspline", c"circular spline"], fixed_member as usize)
}

/// Name of a kind of wave generator, as in `FlexsplineImageReport`.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_generator_name(generator: u8) -> *const c_char {
    text(&[c"other", c"two-roller", c"four-roller", c"double-disc", c"cam"], generator as usize)
}

/// Name of how far an activation is: of `FLEXSPLINE_PROGRESS_...`.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_progress_name(progress: u8) -> *const c_char {
    text(&[c"checking", c"filling", c"done"], progress as usize)
}

/// Name of what was found of an identity: of `FLEXSPLINE_IDENTITY_...`.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_identity_name(found: u8) -> *const c_char {
    text(&[c"hashing", c"same", c"other"], found as usize)
}

/// Name of what learning does: of `FLEXSPLINE_LEARNING_...`.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_learning_name(learning: u8) -> *const c_char {
    text(&[c"off", c"frozen", c"on"], learning as usize)
}

/// Name of what became of a measurement: of `FLEXSPLINE_VERDICT_...`.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_verdict_name(verdict: u8) -> *const c_char {
    text(&[c"idle", c"used", c"quiet", c"outlier", c"unsettled", c"unexcited", c"untrusted", c"lost"], verdict as usize)
}

/// Name of a coefficient: of `FLEXSPLINE_TERM_...`.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_term_name(term: u8) -> *const c_char {
    text(&[c"mean", c"wind-up", c"half-width", c"cosine", c"sine"], term as usize)
}
