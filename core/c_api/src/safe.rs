//! Protection of a tick's inputs: a test of the sensors at start-up, saved springs that belong to a joint, mending
//! in a slow group.

use super::*;
use flexspline::{Implausible, Readings, StartUp, StartUpSettings, StartUpStep, shared};

// The same in C: cbindgen renames it.
pub use flexspline::StartUpSettings as FlexsplineStartUpSettings;

/// Eight-byte words of a [`FlexsplineStartUp`].
pub const FLEXSPLINE_START_UP_WORDS: usize = 32;

/// The generator's encoder gave no sample.
pub const FLEXSPLINE_IMPLAUSIBLE_GENERATOR_LOST: u16 = 1;
/// It did not move.
pub const FLEXSPLINE_IMPLAUSIBLE_GENERATOR_STILL: u16 = 2;
/// It moved the other way.
pub const FLEXSPLINE_IMPLAUSIBLE_GENERATOR_SIGN: u16 = 4;
/// It moved by another way: counts in a turn, unit, or a motor that does not follow.
pub const FLEXSPLINE_IMPLAUSIBLE_GENERATOR_RATIO: u16 = 8;
/// The output did not move.
pub const FLEXSPLINE_IMPLAUSIBLE_OUTPUT_STILL: u16 = 16;
/// It moved the other way.
pub const FLEXSPLINE_IMPLAUSIBLE_OUTPUT_SIGN: u16 = 32;
/// It moved by another way than the ratio says: unit, ratio, or the member that is fixed.
pub const FLEXSPLINE_IMPLAUSIBLE_OUTPUT_RATIO: u16 = 64;
/// The torque did not change with the direction.
pub const FLEXSPLINE_IMPLAUSIBLE_TORQUE_STILL: u16 = 128;
/// It changed the other way.
pub const FLEXSPLINE_IMPLAUSIBLE_TORQUE_SIGN: u16 = 256;
/// It changed by less than a third or more than three times what the drag says: a unit.
pub const FLEXSPLINE_IMPLAUSIBLE_TORQUE_RATIO: u16 = 512;
/// A reading came and went, or was no number.
pub const FLEXSPLINE_IMPLAUSIBLE_LOST: u16 = 1024;

/// A test of the sensors under way.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineStartUp {
    pub(super) opaque: [MaybeUninit<u64>; FLEXSPLINE_START_UP_WORDS],
}

/// Sensor readings in a tick of the test. Angles are counts of 2^-32 turn.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineReadings {
    /// The generator's encoder.
    pub generator_counts: i64,
    /// An encoder at the output.
    pub output_counts: i64,
    /// A torque that is measured in the mesh, N m. (One on the load says nothing about a motion.)
    pub torque_n_m: f32,
    /// 1 if there is a sample of the generator, else 0; likewise below.
    pub has_generator: u8,
    /// Of the output.
    pub has_output: u8,
    /// Of the torque.
    pub has_torque: u8,
}

/// Command and result of a tick of the test.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineStartUpStep {
    /// Generator angle to command, counts of 2^-32 turn.
    pub command_counts: i64,
    /// `FLEXSPLINE_IMPLAUSIBLE_...` once it is done: 0 if every sensor says what it must.
    pub implausible: u16,
    /// 1 with the last tick of the test, else 0.
    pub is_done: u8,
}

/// Begins a test of the sensors that moves the generator from where it is and back, before the first tick.
/// `FLEXSPLINE_STATUS_ARGUMENT` if a number is not finite, the way too short to decide or too long, or the ticks too
/// few.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_start_up_init(
    start_up: *mut FlexsplineStartUp,
    joint: *const FlexsplineJoint,
    generator_counts: i64,
    settings: *const StartUpSettings,
) -> FlexsplineStatus {
    status(|| {
        apart([span(start_up), span(joint)])?;
        let generator = GeneratorAngle::from_counts(generator_counts);
        let made = StartUp::new(joint_of(joint)?, generator, &copied(settings)?);
        put(start_up, Object::StartUp, made.map_err(|_| FlexsplineStatus::Argument)?)
    })
}

/// One tick of the test: what the sensors say, with the command of the tick before; what to command now, and with the
/// last one what was found. Where something is implausible do not let the joint correct: its numbers are not what they
/// are taken for.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_start_up_step(
    start_up: *mut FlexsplineStartUp,
    readings: *const FlexsplineReadings,
    step: *mut FlexsplineStartUpStep,
) -> FlexsplineStatus {
    answer(step, [span(start_up), span(readings)], || {
        let r = copied(readings)?;
        let start_up: &mut StartUp = get_mut(start_up, Object::StartUp)?;
        let StartUpStep { command, found } = start_up.step(&Readings {
            generator: (r.has_generator != 0).then_some(GeneratorAngle::from_counts(r.generator_counts)),
            output: (r.has_output != 0).then_some(OutputAngle::from_counts(r.output_counts)),
            torque_n_m: (r.has_torque != 0).then_some(r.torque_n_m),
        });
        Ok(FlexsplineStartUpStep {
            command_counts: command.counts(),
            implausible: found.map_or(0, Implausible::bits),
            is_done: found.is_some() as u8,
        })
    })
}

/// As `flexspline_slip_save`, with joint and table: the bytes are restored for the same ones alone.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_slip_save_for(
    slip: *const FlexsplineSlip,
    joint: *const FlexsplineJoint,
    store: *const FlexsplineStore,
    saved: *mut u8,
    saved_bytes: usize,
    written: *mut usize,
) -> FlexsplineStatus {
    answer(written, [span(slip), span(joint), span(store), (saved as usize, saved_bytes)], || {
        clear((saved as usize, saved_bytes), [span(joint), span(store)])?;
        save_slip(slip, shared::owner(joint_of(joint)?, store_of(store)?), saved, saved_bytes)
    })
}

/// As `flexspline_slip_restore`, of bytes that the same springs saved for the same joint with the same table:
/// `FLEXSPLINE_STATUS_OTHER_TABLE` or `FLEXSPLINE_STATUS_OTHER_JOINT` (or other springs) if not.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_slip_restore_for(
    slip: *mut FlexsplineSlip,
    joint: *const FlexsplineJoint,
    store: *const FlexsplineStore,
    saved: *const u8,
    saved_bytes: usize,
) -> FlexsplineStatus {
    status(|| {
        clear(span(slip), [span(joint), span(store)])?;
        restore_slip(slip, shared::owner(joint_of(joint)?, store_of(store)?), saved, saved_bytes)
    })
}
