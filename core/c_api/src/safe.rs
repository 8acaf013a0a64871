//! Protection of a tick's inputs: a test of the sensors at start-up, saved springs that belong to a joint, mending
//! in a slow group.

use super::learn::FlexsplineSlip;
use super::{
    FlexsplineJoint, FlexsplineStatus, FlexsplineStore, Object, apart, clear, copied, get, get_mut, give, put, span,
    status, usable,
};
use core::mem::MaybeUninit;
use flexspline::{GeneratorAngle, Implausible, Joint, OutputAngle, Readings, StartUp, StartUpSettings, Store};

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

/// How far the motor moves, and what is expected of it.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct FlexsplineStartUpSettings {
    /// Way of the generator, there and back, rad. At the output it must be ten times `output_error_rad` at least, and
    /// half a turn at most.
    pub way_rad: f32,
    /// Error of the output in one move, rad: twice the error that the table states is enough.
    pub output_error_rad: f32,
    /// Coulomb drag of the output that a torque in the mesh turns over by, N m; it may be wrong by three times. Above
    /// 0.
    pub drag_n_m: f32,
    /// Ticks for each way, 8 or more; the last half of each is for the servo to settle.
    pub ticks: u16,
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
    settings: *const FlexsplineStartUpSettings,
) -> FlexsplineStatus {
    let make = || {
        apart([span(start_up), span(joint)])?;
        let s = copied(settings)?;
        let joint: &Joint = get(joint, Object::Joint)?;
        let settings = StartUpSettings {
            way_rad: s.way_rad,
            ticks: s.ticks,
            output_error_rad: s.output_error_rad,
            drag_n_m: s.drag_n_m,
        };
        let made = StartUp::new(joint, GeneratorAngle::from_counts(generator_counts), &settings);
        put(start_up, Object::StartUp, made.map_err(|_| FlexsplineStatus::Argument)?)
    };
    status(make())
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
    let take = || {
        apart([span(start_up), span(step)])?;
        usable(step)?;
        let r = copied(readings)?;
        let start_up: &mut StartUp = get_mut(start_up, Object::StartUp)?;
        let readings = Readings {
            generator: (r.has_generator != 0).then_some(GeneratorAngle::from_counts(r.generator_counts)),
            output: (r.has_output != 0).then_some(OutputAngle::from_counts(r.output_counts)),
            torque_n_m: (r.has_torque != 0).then_some(r.torque_n_m),
        };
        let found = start_up.step(&readings);
        give(
            step,
            FlexsplineStartUpStep {
                command_counts: found.command.counts(),
                implausible: found.found.map_or(0, Implausible::bits),
                is_done: found.found.is_some() as u8,
            },
        )
    };
    status(take())
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
    let save = || {
        clear(span(written), [span(joint), span(store)])?;
        clear((saved as usize, saved_bytes), [span(joint), span(store)])?;
        let owner =
            flexspline::shared::owner(get::<_, Joint>(joint, Object::Joint)?, get::<_, Store>(store, Object::Store)?);
        super::learn::save_slip(slip, owner, saved, saved_bytes, written)
    };
    status(save())
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
    let restore = || {
        clear(span(slip), [span(joint), span(store)])?;
        let owner =
            flexspline::shared::owner(get::<_, Joint>(joint, Object::Joint)?, get::<_, Store>(store, Object::Store)?);
        super::learn::restore_slip(slip, owner, saved, saved_bytes)
    };
    status(restore())
}
