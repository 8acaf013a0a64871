//! Which torque a tick is given, how old it is, and the rate that goes with a command.

use super::*;
use flexspline::{Aged, TorquePath, TorqueReading, TorqueSettings};

/// Eight-byte words of a [`FlexsplineTorquePath`].
pub const FLEXSPLINE_TORQUE_PATH_WORDS: usize = 8;
/// Eight-byte words of a [`FlexsplineAged`].
pub const FLEXSPLINE_AGED_WORDS: usize = 4;

/// The torque is that on the load: what gravity, wind and the like do to it. Inertia times the acceleration of the
/// target comes off what the tick gives, unless that inertia torque is the larger: while a target speeds up from a
/// light load the flank does not change.
pub const FLEXSPLINE_TORQUE_ON_LOAD: u8 = 0;
/// The torque is that in the mesh: of a sensor between drive and load, of the twist, or of the motor's current less its
/// friction.
pub const FLEXSPLINE_TORQUE_IN_MESH: u8 = 1;

/// From a reading of torque to the one that a tick is given.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineTorquePath {
    pub(super) opaque: [MaybeUninit<u64>; FLEXSPLINE_TORQUE_PATH_WORDS],
}

/// A measurement with its age.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineAged {
    pub(super) opaque: [MaybeUninit<u64>; FLEXSPLINE_AGED_WORDS],
}

/// Settings of the processing of a torque reading.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct FlexsplineTorqueSettings {
    /// Time from tick to tick, s.
    pub tick_s: f32,
    /// Corner of the low-pass, Hz: of the first order.
    pub bandwidth_hz: f32,
    /// Coulomb drag of the output of this unit, N m, whichever torque is read; 0 or more.
    pub drag_n_m: f32,
    /// Coulomb drag that the table was made with, N m; 0 or more.
    pub table_drag_n_m: f32,
    /// A torque in the mesh below this changes the flank only where the direction changes, N m: some three times the
    /// peak of the noise behind the low-pass, and for a torque read in the mesh a fifth of the drag. 0 or more.
    pub hold_n_m: f32,
}

/// The direction of a sign: what is 0 is none.
pub(super) fn direction_of(sign: i8) -> Result<Direction, FlexsplineStatus> {
    match sign {
        1 => Ok(Direction::Forward),
        -1 => Ok(Direction::Backward),
        _ => Err(FlexsplineStatus::Argument),
    }
}

/// Largest accepted reading where none is given, N m.
const ANY_N_M: f32 = 1e9;

/// Makes a path that has seen nothing yet; `FLEXSPLINE_STATUS_ARGUMENT` if a time or bandwidth is not finite and
/// positive, or a drag or hold not finite or below 0. A torque in the mesh may change the flank in any tick, and any
/// reading is believed: `flexspline_torque_init_sensor` says more.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_torque_init(
    path: *mut FlexsplineTorquePath,
    settings: *const FlexsplineTorqueSettings,
) -> FlexsplineStatus {
    flexspline_torque_init_sensor(path, settings, 0.0, ANY_N_M)
}

/// As `flexspline_torque_init`, with what is known of sensor and servo. After a torque read in the mesh has changed the
/// flank it does not change it again for `settle_s`, s (some periods of the servo's position loop, 0 or more): the
/// correction crosses the play then, and what its own motion makes of the torque has to die away. A reading beyond
/// `largest_n_m`, N m (above 0), is forgotten as one that is not finite.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_torque_init_sensor(
    path: *mut FlexsplineTorquePath,
    settings: *const FlexsplineTorqueSettings,
    settle_s: f32,
    largest_n_m: f32,
) -> FlexsplineStatus {
    status(|| {
        let s = copied(settings)?;
        let settings = TorqueSettings {
            tick_s: s.tick_s,
            bandwidth_hz: s.bandwidth_hz,
            drag_n_m: s.drag_n_m,
            table_drag_n_m: s.table_drag_n_m,
            hold_n_m: s.hold_n_m,
            settle_s,
            largest_n_m,
        };
        put(path, Object::TorquePath, TorquePath::new(settings).map_err(|_| FlexsplineStatus::Argument)?)
    })
}

/// One tick: a reading, N m, positive where it turns the output forward, where it was measured
/// (`FLEXSPLINE_TORQUE_...`), and the direction in which the output moves or moved last, +1 or -1; what to give to
/// `FlexsplineInput`. A reading that is not finite, larger than the sensor's largest, frozen, or too far from the last
/// one gives NaN and is forgotten. `FLEXSPLINE_STATUS_NOT_INITIALISED` where an upset hit more than a word of it (one
/// is mended): make the path anew.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_torque_tick(
    path: *mut FlexsplineTorquePath,
    place: u8,
    reading_n_m: f32,
    direction: i8,
    torque_n_m: *mut f32,
) -> FlexsplineStatus {
    answer(torque_n_m, [span(path)], || {
        let path: &mut TorquePath = get_mut(path, Object::TorquePath)?;
        let reading = match place {
            FLEXSPLINE_TORQUE_ON_LOAD => TorqueReading::OnLoad(reading_n_m),
            FLEXSPLINE_TORQUE_IN_MESH => TorqueReading::InMesh(reading_n_m),
            _ => return Err(FlexsplineStatus::Argument),
        };
        let torque = path.tick(reading, direction_of(direction)?);
        // A damaged path gives NaN, and a sound one is not looked at twice.
        if torque.is_nan() && path.is_damaged() { Err(FlexsplineStatus::NotInitialised) } else { Ok(torque) }
    })
}

/// Other limits of what a sensor can read, after `flexspline_torque_init_sensor`: the largest change from one tick to
/// the next, N m (a quarter of the largest reading and twice the drag without this call; a reading that changes by more
/// is believed once three in a row are near each other), and the number of ticks after which a reading that stays the
/// same to the last bit is frozen (0 for never, as without this call: what comes from a model may stand still, a sensor
/// has noise). `FLEXSPLINE_STATUS_ARGUMENT` if the change is not finite or below 1e-6 N m.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_torque_set_sensor(
    path: *mut FlexsplineTorquePath,
    jump_n_m: f32,
    frozen_ticks: u16,
) -> FlexsplineStatus {
    status(|| {
        let path: &mut TorquePath = get_mut(path, Object::TorquePath)?;
        if path.is_damaged() {
            return Err(FlexsplineStatus::NotInitialised);
        }
        *path = path.with_sensor(jump_n_m, frozen_ticks).map_err(|_| FlexsplineStatus::Argument)?;
        Ok(())
    })
}

/// Nothing measured yet; what is older than `most_ticks` is not used.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_aged_init(aged: *mut FlexsplineAged, most_ticks: u16) -> FlexsplineStatus {
    status(|| put(aged, Object::Aged, Aged::new(most_ticks)))
}

/// One tick: what was measured in it, if anything (`has_measured` 1, else 0); the value to use, or NaN where it is too
/// old, or was hit by an upset. A tick takes NaN as torque: it keeps its correction for `patience` ticks, then fades it
/// out.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_aged_tick(
    aged: *mut FlexsplineAged,
    has_measured: u8,
    measured: f32,
    value: *mut f32,
) -> FlexsplineStatus {
    answer(value, [span(aged)], || {
        let aged: &mut Aged = get_mut(aged, Object::Aged)?;
        Ok(aged.tick((has_measured != 0).then_some(measured)))
    })
}

/// 1 if there is no value that may be used, else 0: ask for the sensor.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_aged_is_stale(aged: *const FlexsplineAged, is_stale: *mut u8) -> FlexsplineStatus {
    answer(is_stale, [span(aged)], || Ok(get::<_, Aged>(aged, Object::Aged)?.is_stale() as u8))
}

/// Rate at which the generator has to turn so that the output moves at `rate_rad_s`, rad/s: the nominal one and what
/// the error adds, along the way of the target over `ahead_s` (some ticks, above 0). For the speed loop of a servo; it
/// cannot feed a torque back. NaN where the table gives nothing. Two inverse solutions: for a tick that has the time,
/// or every few ticks.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_rate_ahead(
    joint: *const FlexsplineJoint,
    store: *const FlexsplineStore,
    target_counts: i64,
    rate_rad_s: f32,
    torque_n_m: f32,
    ahead_s: f32,
    generator_rate_rad_s: *mut f32,
) -> FlexsplineStatus {
    answer(generator_rate_rad_s, [span(joint), span(store)], || {
        let (joint, store) = (joint_of(joint)?, store_of(store)?);
        if !(ahead_s > 0.0 && ahead_s.is_finite() && rate_rad_s.is_finite()) {
            return Err(FlexsplineStatus::Argument);
        }
        Ok(joint.rate_ahead(store, OutputAngle::from_counts(target_counts), rate_rad_s, torque_n_m, ahead_s))
    })
}

/// How the generator has to move so that the output moves as it shall.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineMotionAhead {
    /// Its rate, rad/s.
    pub rate_rad_s: f32,
    /// Its acceleration, rad/s^2.
    pub acceleration_rad_s2: f32,
}

/// As `flexspline_rate_ahead`, with the acceleration that goes with it: what the error's curvature adds along the way
/// of the target, and what a target asks for that itself accelerates by `acceleration_rad_s2`. Inertia of motor and
/// generator times it goes to the motor's current; the load's inertia times `acceleration_rad_s2` over the ratio comes
/// on top. Both are NaN where the table gives nothing. Three inverse solutions.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_motion_ahead(
    joint: *const FlexsplineJoint,
    store: *const FlexsplineStore,
    target_counts: i64,
    rate_rad_s: f32,
    acceleration_rad_s2: f32,
    torque_n_m: f32,
    ahead_s: f32,
    ahead: *mut FlexsplineMotionAhead,
) -> FlexsplineStatus {
    answer(ahead, [span(joint), span(store)], || {
        let (joint, store) = (joint_of(joint)?, store_of(store)?);
        if !(ahead_s > 0.0 && ahead_s.is_finite() && rate_rad_s.is_finite() && acceleration_rad_s2.is_finite()) {
            return Err(FlexsplineStatus::Argument);
        }
        let (target, rates) = (OutputAngle::from_counts(target_counts), [rate_rad_s, acceleration_rad_s2]);
        let [rate_rad_s, acceleration_rad_s2] = joint.motion_ahead(store, target, rates, torque_n_m, ahead_s);
        Ok(FlexsplineMotionAhead { rate_rad_s, acceleration_rad_s2 })
    })
}
