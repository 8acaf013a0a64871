//! Work next to the tick: a table received in chunks, events, records for the ground, an observer and what lies
//! ahead.

use super::names::*;
use super::{
    FlexsplineJoint, FlexsplineOutput, FlexsplineState, FlexsplineStatus, FlexsplineStore, Object, apart, bytes, clear,
    copied, get, get_mut, give, image_status, put, span, status, usable,
};
use core::mem::MaybeUninit;
use flexspline::{
    Flags, GeneratorAngle, Health, Joint, JointState, Mode, Output, OutputAngle, Quality, Store, Upload, UploadError,
};
use flexspline_estimation::{
    Disturbance, Inertias, Measured, Noise, Now, PREDICTOR_PARTS, PredictorState, TwoMassObserver,
};
use flexspline_telemetry::{Event, RECORD_BYTES, Record, Watch};

/// Bytes of a record of telemetry.
pub const FLEXSPLINE_RECORD_BYTES: usize = 52;
/// Numbers of a predictor.
pub const FLEXSPLINE_PREDICTOR_PARTS: usize = 34;
/// Eight-byte words of a [`FlexsplineUpload`].
pub const FLEXSPLINE_UPLOAD_WORDS: usize = 3;
/// Eight-byte words of a [`FlexsplineWatch`].
pub const FLEXSPLINE_WATCH_WORDS: usize = 6;
/// Eight-byte words of a [`FlexsplinePredictor`].
pub const FLEXSPLINE_PREDICTOR_WORDS: usize = 19;
/// Eight-byte words of a [`FlexsplineObserver`].
pub const FLEXSPLINE_OBSERVER_WORDS: usize = 4;

/// The mode changed: `mode_before`, `mode`.
pub const FLEXSPLINE_EVENT_MODE: u16 = 1;
/// The health of the table changed: `health_before`, `health`.
pub const FLEXSPLINE_EVENT_HEALTH: u16 = 2;
/// A page of one image is damaged and can be written again from the other: `damaged_image`, `damaged_page`.
pub const FLEXSPLINE_EVENT_PAGE_DAMAGED: u16 = 4;
/// The copies of the table disagreed in what was read.
pub const FLEXSPLINE_EVENT_TABLE_DOUBT: u16 = 8;
/// No correction can be made from now on.
pub const FLEXSPLINE_EVENT_FALLBACK: u16 = 16;
/// Corrections are made again.
pub const FLEXSPLINE_EVENT_RECOVERED: u16 = 32;
/// A tick came late: `missed_ticks`.
pub const FLEXSPLINE_EVENT_OVERRUN: u16 = 64;
/// The state was not whole.
pub const FLEXSPLINE_EVENT_STATE_TORN: u16 = 128;

/// How far a table on its way in has come.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineUpload {
    pub(super) opaque: [MaybeUninit<u64>; FLEXSPLINE_UPLOAD_WORDS],
}

/// Knows how the last tick was.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineWatch {
    pub(super) opaque: [MaybeUninit<u64>; FLEXSPLINE_WATCH_WORDS],
}

/// Two inertias and an observer of them: all that does not change while they run.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplinePredictor {
    pub(super) opaque: [MaybeUninit<u64>; FLEXSPLINE_PREDICTOR_WORDS],
}

/// State of an observer.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineObserver {
    pub(super) opaque: [MaybeUninit<u64>; FLEXSPLINE_OBSERVER_WORDS],
}

/// Events of a tick.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineEvents {
    /// Ticks missed since the start.
    pub missed_ticks: u32,
    /// `FLEXSPLINE_EVENT_...`; the fields below are only set with their event.
    pub events: u16,
    /// `FLEXSPLINE_MODE_...`.
    pub mode_before: u8,
    /// The mode now.
    pub mode: u8,
    /// `FLEXSPLINE_HEALTH_...`.
    pub health_before: u8,
    /// The health now.
    pub health: u8,
    /// 0 or 1.
    pub damaged_image: u8,
    /// That page.
    pub damaged_page: u8,
}

/// Measurements of a tick, for the observer.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct FlexsplineMeasured {
    /// Motor torque times the ratio in the tick before, N m.
    pub torque_n_m: f32,
    /// Motor speed over the ratio, rad/s.
    pub speed_rad_s: f32,
    /// Twist, rad: only used if the predictor was made with a noise for it.
    pub twist_rad: f32,
}

/// Estimates of an observer, to read.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineObserverReport {
    /// Twist of the drive, rad.
    pub twist_rad: f32,
    /// Speed of the load, rad/s.
    pub load_speed_rad_s: f32,
    /// Torque on the load, N m.
    pub load_torque_n_m: f32,
}

/// Where a prediction starts.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct FlexsplineNow {
    /// Generator angle, counts of 2^-32 turn.
    pub generator_counts: i64,
    /// Output angle as measured.
    pub measured_counts: i64,
    /// It lies within +- this, rad.
    pub measured_bound_rad: f32,
    /// Motor torque times the ratio from now on, N m; it can be off by +- `torque_off_n_m`.
    pub torque_n_m: f32,
    /// See `torque_n_m`.
    pub torque_off_n_m: f32,
    /// Change of the torque on the load in a tick, +- N m.
    pub load_change_n_m: f32,
    /// How far off the observer can be, +-: twist rad, speeds of motor and load rad/s, torque on the load N m.
    pub state_bound: [f32; 4],
    /// Ticks ahead.
    pub ticks: u16,
    /// 0 if there is no encoder at the output, else 1.
    pub has_measured: u8,
}

/// Where the output is expected.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineAhead {
    /// The output angle then, counts of 2^-32 turn.
    pub output_counts: i64,
    /// It lies within +- this, rad.
    pub bound_rad: f32,
    /// Turn of the load until then, rad.
    pub load_rad: f32,
    /// Turn of the motor until then, over the ratio, rad.
    pub motor_rad: f32,
    /// Twist then, rad.
    pub twist_rad: f32,
    /// `FLEXSPLINE_QUALITY_...`: the worse of now and then.
    pub quality: u8,
}

/// Two inertias, at the output.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct FlexsplineInertias {
    /// Motor, generator and what turns with them: their inertia times the square of the ratio, kg m^2.
    pub motor_kg_m2: f64,
    /// Load, kg m^2.
    pub load_kg_m2: f64,
    /// Torsional stiffness, N m/rad: the slope of the wind-up.
    pub stiffness_n_m_per_rad: f64,
    /// Damping beside it, N m s/rad.
    pub damping_n_m_s_per_rad: f64,
}

/// How much of what is measured and assumed can be trusted: standard deviations.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct FlexsplineNoise {
    /// Motor torque at the output, N m.
    pub torque_n_m: f64,
    /// Change of the torque on the load in a tick, N m.
    pub load_change_n_m: f64,
    /// Motor speed over the ratio as measured in one tick, rad/s.
    pub speed_rad_s: f64,
    /// Twist as measured, rad; of no matter without an encoder at the output.
    pub twist_rad: f64,
    /// 0 without an encoder at the output, else 1.
    pub has_twist: u8,
}

/// How far what is measured and assumed can be off: bounds, each +-.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct FlexsplineDisturbance {
    /// Motor torque at the output, N m.
    pub torque_n_m: f32,
    /// Change of the torque on the load in a tick, N m.
    pub load_change_n_m: f32,
    /// Motor speed over the ratio as measured, rad/s.
    pub speed_rad_s: f32,
    /// Twist as measured, rad; of no matter without an encoder at the output.
    pub twist_rad: f32,
}

/// Announced and received bytes.
#[derive(Clone, Copy)]
struct ReceptionProgress {
    announced: usize,
    received: usize,
}

const _: () = assert!(FLEXSPLINE_RECORD_BYTES == RECORD_BYTES && FLEXSPLINE_PREDICTOR_PARTS == PREDICTOR_PARTS);

pub(super) const fn quality_code(quality: Quality) -> u8 {
    match quality {
        Quality::InRange => FLEXSPLINE_QUALITY_IN_RANGE,
        Quality::Uncertain => FLEXSPLINE_QUALITY_UNCERTAIN,
        Quality::Extrapolated => FLEXSPLINE_QUALITY_EXTRAPOLATED,
        Quality::Disabled => FLEXSPLINE_QUALITY_DISABLED,
    }
}

pub(super) const fn health_code(health: Health) -> u8 {
    match health {
        Health::Sound => FLEXSPLINE_HEALTH_SOUND,
        Health::OneImage => FLEXSPLINE_HEALTH_ONE_IMAGE,
        Health::Lost => FLEXSPLINE_HEALTH_LOST,
        Health::Empty => FLEXSPLINE_HEALTH_EMPTY,
        Health::Torn => FLEXSPLINE_HEALTH_TORN,
    }
}

/// Back from its number.
pub(super) const fn quality_of(code: u8) -> Result<Quality, FlexsplineStatus> {
    Ok(match code {
        FLEXSPLINE_QUALITY_IN_RANGE => Quality::InRange,
        FLEXSPLINE_QUALITY_UNCERTAIN => Quality::Uncertain,
        FLEXSPLINE_QUALITY_EXTRAPOLATED => Quality::Extrapolated,
        FLEXSPLINE_QUALITY_DISABLED => Quality::Disabled,
        _ => return Err(FlexsplineStatus::Argument),
    })
}

/// Back from its number.
pub(super) const fn health_of(code: u8) -> Result<Health, FlexsplineStatus> {
    Ok(match code {
        FLEXSPLINE_HEALTH_SOUND => Health::Sound,
        FLEXSPLINE_HEALTH_ONE_IMAGE => Health::OneImage,
        FLEXSPLINE_HEALTH_LOST => Health::Lost,
        FLEXSPLINE_HEALTH_EMPTY => Health::Empty,
        FLEXSPLINE_HEALTH_TORN => Health::Torn,
        _ => return Err(FlexsplineStatus::Argument),
    })
}

/// Output of a tick, back from C.
pub(super) fn given(output: *const FlexsplineOutput) -> Result<Output, FlexsplineStatus> {
    let found = copied(output)?;
    Ok(Output {
        command: GeneratorAngle::from_counts(found.command_counts),
        output: OutputAngle::from_counts(found.output_counts),
        transmission_error_rad: found.transmission_error_rad,
        uncertainty_rad: found.uncertainty_rad,
        correction_rad: found.correction_rad,
        held_back_rad: found.held_back_rad,
        quality: quality_of(found.quality)?,
        flags: Flags::of_bits(found.flags),
    })
}

fn upload_status(error: UploadError) -> FlexsplineStatus {
    match error {
        UploadError::Buffer { .. } | UploadError::TooLong { .. } => FlexsplineStatus::TooLarge,
        UploadError::Order { .. } => FlexsplineStatus::Order,
        UploadError::Incomplete { .. } => FlexsplineStatus::Incomplete,
        UploadError::Image(error) => image_status(error),
    }
}

/// Begins to receive a table of the given length. The buffer is the caller's and is given with every call; it is no
/// image in use.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_upload_begin(upload: *mut FlexsplineUpload, announced: usize) -> FlexsplineStatus {
    status(put(upload, Object::Upload, ReceptionProgress { announced, received: 0 }))
}

/// Takes the bytes from `offset` on: `FLEXSPLINE_STATUS_ORDER` if they are not the next ones, which can still come.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_upload_chunk(
    upload: *mut FlexsplineUpload,
    buffer: *mut u8,
    buffer_bytes: usize,
    offset: usize,
    chunk: *const u8,
    chunk_bytes: usize,
) -> FlexsplineStatus {
    let take = || {
        usable(buffer)?;
        let chunk_read = bytes(chunk, chunk_bytes)?;
        let (upload_span, buffer_span) = (span(upload), (buffer as usize, buffer_bytes));
        apart([upload_span, buffer_span, (chunk as usize, chunk_bytes)])?;
        let progress: &mut ReceptionProgress = get_mut(upload, Object::Upload)?;
        if buffer_bytes > isize::MAX as usize {
            return Err(FlexsplineStatus::Argument);
        }
        // SAFETY: not null, apart from the other objects; the caller guarantees this length, and the bytes are
        // its own.
        let buffer = unsafe { core::slice::from_raw_parts_mut(buffer, buffer_bytes) };
        let mut resumed = Upload::resume(buffer, progress.announced, progress.received).map_err(upload_status)?;
        resumed.chunk(offset, chunk_read).map_err(upload_status)?;
        progress.received = resumed.received();
        Ok(())
    };
    status(take())
}

/// Checks a table of which all bytes came, in full, and reports its id; it can then be activated.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_upload_finish(
    upload: *const FlexsplineUpload,
    buffer: *const u8,
    buffer_bytes: usize,
    table_id: *mut [u8; 8],
) -> FlexsplineStatus {
    let finish = || {
        let image = bytes(buffer, buffer_bytes)?;
        apart([span(upload), (buffer as usize, buffer_bytes), span(table_id)])?;
        usable(table_id)?;
        let &ReceptionProgress { announced, received } = get(upload, Object::Upload)?;
        let id = Upload::check(image, announced, received).map_err(upload_status)?.id();
        // SAFETY: not null, apart from what is borrowed; the caller's.
        unsafe { table_id.write(id.0) };
        Ok(())
    };
    status(finish())
}

/// Begins to watch for events: off, without a table.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_watch_init(watch: *mut FlexsplineWatch) -> FlexsplineStatus {
    status(put(watch, Object::Watch, Watch::new()))
}

/// Reports the changes, after `flexspline_tick`; `output` is that tick's output.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_watch_see(
    watch: *mut FlexsplineWatch,
    state: *const FlexsplineState,
    store: *const FlexsplineStore,
    output: *const FlexsplineOutput,
    events: *mut FlexsplineEvents,
) -> FlexsplineStatus {
    let see = || {
        for written in [span(watch), span(events)] {
            for read in [span(state), span(store), span(output)] {
                apart([written, read])?;
            }
        }
        apart([span(watch), span(events)])?;
        usable(events)?;
        let given = given(output)?;
        let state: &JointState = get(state, Object::State)?;
        let store: &Store = get(store, Object::Store)?;
        let watch: &mut Watch = get_mut(watch, Object::Watch)?;
        let mut filled = FlexsplineEvents::default();
        for event in watch.see(state, store, &given).iter() {
            filled.events |= match event {
                Event::Mode { from, to } => {
                    (filled.mode_before, filled.mode) = (Mode::code(from) as u8, Mode::code(to) as u8);
                    FLEXSPLINE_EVENT_MODE
                }
                Event::Health { from, to } => {
                    (filled.health_before, filled.health) = (health_code(from), health_code(to));
                    FLEXSPLINE_EVENT_HEALTH
                }
                Event::PageDamaged { image, page } => {
                    (filled.damaged_image, filled.damaged_page) = (image as u8, page as u8);
                    FLEXSPLINE_EVENT_PAGE_DAMAGED
                }
                Event::TableDoubt => FLEXSPLINE_EVENT_TABLE_DOUBT,
                Event::Fallback => FLEXSPLINE_EVENT_FALLBACK,
                Event::Recovered => FLEXSPLINE_EVENT_RECOVERED,
                Event::Overrun { missed_ticks } => {
                    filled.missed_ticks = missed_ticks;
                    FLEXSPLINE_EVENT_OVERRUN
                }
                Event::StateTorn => FLEXSPLINE_EVENT_STATE_TORN,
            };
        }
        // SAFETY: not null, aligned, apart from what is borrowed; the caller's.
        unsafe { events.write(filled) };
        Ok(())
    };
    status(see())
}

/// Writes a record of telemetry of a tick: `FLEXSPLINE_RECORD_BYTES` bytes with a CRC-32. `number` and `lost` are the
/// caller's: of the record, and of those that it could not keep.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_record(
    tick: u32,
    number: u16,
    lost: u16,
    state: *const FlexsplineState,
    store: *const FlexsplineStore,
    output: *const FlexsplineOutput,
    record: *mut [u8; FLEXSPLINE_RECORD_BYTES],
) -> FlexsplineStatus {
    let write = || {
        for read in [span(state), span(store), span(output)] {
            apart([span(record), read])?;
        }
        usable(record)?;
        let given = given(output)?;
        let state: &JointState = get(state, Object::State)?;
        let store: &Store = get(store, Object::Store)?;
        let made = Record { number, lost, ..Record::of(tick, state, store, &given) };
        // SAFETY: not null, apart from what is borrowed; the caller owns this length.
        unsafe { record.write(made.encode()) };
        Ok(())
    };
    status(write())
}

/// Makes a predictor of its numbers, which the host discretised; `FLEXSPLINE_STATUS_ARGUMENT` if its observer does not
/// contract.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_predictor_init(
    predictor: *mut FlexsplinePredictor,
    parts: *const [f32; FLEXSPLINE_PREDICTOR_PARTS],
) -> FlexsplineStatus {
    let make = || {
        apart([span(predictor), span(parts)])?;
        let made = TwoMassObserver::from_parts(&copied(parts)?).map_err(|_| FlexsplineStatus::Argument)?;
        put(predictor, Object::Predictor, made)
    };
    status(make())
}

/// Makes a predictor of two inertias: discretises them over a tick and finds the gains of the observer, in double
/// precision. For the host, or for a start-up that has the time (some 20000 products of small matrices).
/// `FLEXSPLINE_STATUS_ARGUMENT` if a number is not finite and positive, or the observer does not contract.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_predictor_of(
    predictor: *mut FlexsplinePredictor,
    inertias: *const FlexsplineInertias,
    noise: *const FlexsplineNoise,
    tick_s: f64,
) -> FlexsplineStatus {
    let make = || {
        let (i, n) = (copied(inertias)?, copied(noise)?);
        usable(predictor)?;
        let inertias = Inertias {
            motor_kg_m2: i.motor_kg_m2,
            load_kg_m2: i.load_kg_m2,
            stiffness_n_m_per_rad: i.stiffness_n_m_per_rad,
            damping_n_m_s_per_rad: i.damping_n_m_s_per_rad,
        };
        let noise = Noise {
            torque_n_m: n.torque_n_m,
            load_change_n_m: n.load_change_n_m,
            speed_rad_s: n.speed_rad_s,
            twist_rad: (n.has_twist != 0).then_some(n.twist_rad),
        };
        let made = TwoMassObserver::new(inertias, noise, tick_s).map_err(|_| FlexsplineStatus::Argument)?;
        put(predictor, Object::Predictor, made)
    };
    status(make())
}

/// Reports the numbers of a predictor, for `flexspline_predictor_init` of the firmware.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_predictor_parts(
    predictor: *const FlexsplinePredictor,
    parts: *mut [f32; FLEXSPLINE_PREDICTOR_PARTS],
) -> FlexsplineStatus {
    let fill = || {
        apart([span(predictor), span(parts)])?;
        let predictor: &TwoMassObserver = get(predictor, Object::Predictor)?;
        give(parts, predictor.parts())
    };
    status(fill())
}

/// Reports the largest error of the observer while the disturbances stay within their bounds: twist rad, speeds of
/// motor and load rad/s, torque on the load N m; for `FlexsplineNow`. For the host or start-up: 10000 ticks in double
/// precision.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_predictor_state_bound(
    predictor: *const FlexsplinePredictor,
    disturbance: *const FlexsplineDisturbance,
    bound: *mut [f32; 4],
) -> FlexsplineStatus {
    let fill = || {
        clear(span(bound), [span(predictor), span(disturbance)])?;
        usable(bound)?;
        let FlexsplineDisturbance { torque_n_m, load_change_n_m, speed_rad_s, twist_rad } = copied(disturbance)?;
        let predictor: &TwoMassObserver = get(predictor, Object::Predictor)?;
        let disturbance = Disturbance { torque_n_m, load_change_n_m, speed_rad_s, twist_rad };
        give(bound, predictor.state_bound(&disturbance))
    };
    status(fill())
}

/// Makes an observer at rest, without load.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_observer_init(observer: *mut FlexsplineObserver) -> FlexsplineStatus {
    status(put(observer, Object::Observer, PredictorState::new()))
}

/// One tick of the observer. `FLEXSPLINE_STATUS_ARGUMENT` if a number that is used is not finite or beyond any drive,
/// and the estimate stays; `FLEXSPLINE_STATUS_NOT_INITIALISED` if an upset hit more than a word of observer or
/// predictor (one is mended): make them anew. The reported values are NaN then.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_observer_step(
    observer: *mut FlexsplineObserver,
    predictor: *const FlexsplinePredictor,
    measured: *const FlexsplineMeasured,
) -> FlexsplineStatus {
    let step = || {
        apart([span(observer), span(predictor)])?;
        let FlexsplineMeasured { torque_n_m, speed_rad_s, twist_rad } = copied(measured)?;
        let predictor: &TwoMassObserver = get(predictor, Object::Predictor)?;
        let observer: &mut PredictorState = get_mut(observer, Object::Observer)?;
        if observer.is_lost() || predictor.is_lost() {
            return Err(FlexsplineStatus::NotInitialised);
        }
        let used = predictor.step(observer, &Measured { torque_n_m, speed_rad_s, twist_rad });
        if used { Ok(()) } else { Err(FlexsplineStatus::Argument) }
    };
    status(step())
}

/// Reports the estimates of an observer.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_observer_report(
    observer: *const FlexsplineObserver,
    report: *mut FlexsplineObserverReport,
) -> FlexsplineStatus {
    let fill = || {
        apart([span(observer), span(report)])?;
        usable(report)?;
        let observer: &PredictorState = get(observer, Object::Observer)?;
        let filled = FlexsplineObserverReport {
            twist_rad: observer.twist_rad(),
            load_speed_rad_s: observer.load_speed_rad_s(),
            load_torque_n_m: observer.load_torque_n_m(),
        };
        // SAFETY: not null, aligned, apart from the observer; the caller's.
        unsafe { report.write(filled) };
        Ok(())
    };
    status(fill())
}

/// Predicts the output some ticks from now, with the table as the output map of the two inertias. The work
/// grows with the ticks; call it in a slow rate group. `FLEXSPLINE_STATUS_ARGUMENT` if a number of `now` is not finite.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_predict(
    predictor: *const FlexsplinePredictor,
    observer: *const FlexsplineObserver,
    joint: *const FlexsplineJoint,
    store: *const FlexsplineStore,
    state: *const FlexsplineState,
    now: *const FlexsplineNow,
    ahead: *mut FlexsplineAhead,
) -> FlexsplineStatus {
    let predict = || {
        for read in [span(predictor), span(observer), span(joint), span(store), span(state), span(now)] {
            apart([span(ahead), read])?;
        }
        usable(ahead)?;
        let from = copied(now)?;
        let predictor: &TwoMassObserver = get(predictor, Object::Predictor)?;
        let observer: &PredictorState = get(observer, Object::Observer)?;
        if observer.is_lost() || predictor.is_lost() {
            return Err(FlexsplineStatus::NotInitialised);
        }
        let numbers = [from.torque_n_m, from.torque_off_n_m, from.load_change_n_m];
        let bound = if from.has_measured != 0 { from.measured_bound_rad } else { 0.0 };
        if !numbers.iter().chain(&from.state_bound).chain([&bound]).all(|number| number.is_finite()) {
            return Err(FlexsplineStatus::Argument);
        }
        let joint: &Joint = get(joint, Object::Joint)?;
        let store: &Store = get(store, Object::Store)?;
        let state: &JointState = get(state, Object::State)?;
        let off = Disturbance {
            torque_n_m: from.torque_off_n_m,
            load_change_n_m: from.load_change_n_m,
            ..Disturbance::default()
        };
        let turned = predictor.ahead(observer, from.torque_n_m, from.ticks, from.state_bound, &off);
        let now = Now {
            generator: GeneratorAngle::from_counts(from.generator_counts),
            play: state.play(),
            measured: (from.has_measured != 0).then_some(OutputAngle::from_counts(from.measured_counts)),
            measured_bound_rad: from.measured_bound_rad,
        };
        let found = predictor.output_ahead(joint, store, observer, &turned, &now);
        let filled = FlexsplineAhead {
            output_counts: found.output.counts(),
            bound_rad: found.bound_rad,
            load_rad: turned.load_rad,
            motor_rad: turned.motor_rad,
            twist_rad: turned.twist_rad,
            quality: quality_code(found.quality),
        };
        // SAFETY: not null, aligned, apart from what is borrowed; the caller's.
        unsafe { ahead.write(filled) };
        Ok(())
    };
    status(predict())
}

#[cfg(test)]
mod tests;
