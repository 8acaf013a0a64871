//! Work next to the tick: a table received in chunks, events, records for the ground, an observer and what lies
//! ahead.

use super::*;
use flexspline::{Upload, UploadError};
use flexspline_estimation::{
    Disturbance, Inertias, Measured, Noise, Now, PREDICTOR_PARTS, PredictorState, TwoMassObserver,
};
use flexspline_telemetry::{Event, RECORD_BYTES, Record, Watch};

// The same in C: cbindgen renames them.
pub use flexspline_estimation::{
    Disturbance as FlexsplineDisturbance, Inertias as FlexsplineInertias, Measured as FlexsplineMeasured,
};

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

/// Announced and received bytes.
#[derive(Clone, Copy)]
struct ReceptionProgress {
    announced: usize,
    received: usize,
}

const _: () = assert!(FLEXSPLINE_RECORD_BYTES == RECORD_BYTES && FLEXSPLINE_PREDICTOR_PARTS == PREDICTOR_PARTS);

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
        quality: Quality::from_code(found.quality).ok_or(FlexsplineStatus::Argument)?,
        flags: Flags::of_bits(found.flags),
    })
}

fn predictor_of<'a>(predictor: *const FlexsplinePredictor) -> Result<&'a TwoMassObserver, FlexsplineStatus> {
    get(predictor, Object::Predictor)
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
    status(|| put(upload, Object::Upload, ReceptionProgress { announced, received: 0 }))
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
    status(|| {
        apart([span(upload), (buffer as usize, buffer_bytes), (chunk as usize, chunk_bytes)])?;
        let (buffer, chunk) = (bytes_mut(buffer, buffer_bytes)?, bytes(chunk, chunk_bytes)?);
        let progress: &mut ReceptionProgress = get_mut(upload, Object::Upload)?;
        let mut resumed = Upload::resume(buffer, progress.announced, progress.received).map_err(upload_status)?;
        resumed.chunk(offset, chunk).map_err(upload_status)?;
        progress.received = resumed.received();
        Ok(())
    })
}

/// Checks a table of which all bytes came, in full, and reports its id; it can then be activated.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_upload_finish(
    upload: *const FlexsplineUpload,
    buffer: *const u8,
    buffer_bytes: usize,
    table_id: *mut [u8; 8],
) -> FlexsplineStatus {
    answer(table_id, [span(upload), (buffer as usize, buffer_bytes)], || {
        apart([span(upload), (buffer as usize, buffer_bytes)])?;
        let &ReceptionProgress { announced, received } = get(upload, Object::Upload)?;
        let found = Upload::check(bytes(buffer, buffer_bytes)?, announced, received).map_err(upload_status)?;
        Ok(found.id().0)
    })
}

/// Begins to watch for events: off, without a table.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_watch_init(watch: *mut FlexsplineWatch) -> FlexsplineStatus {
    status(|| put(watch, Object::Watch, Watch::new()))
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
    answer(events, [span(watch), span(state), span(store), span(output)], || {
        clear(span(watch), [span(state), span(store), span(output)])?;
        let given = given(output)?;
        let watch: &mut Watch = get_mut(watch, Object::Watch)?;
        let mut filled = FlexsplineEvents::default();
        for event in watch.see(state_of(state)?, store_of(store)?, &given).iter() {
            filled.events |= match event {
                Event::Mode { from, to } => {
                    (filled.mode_before, filled.mode) = (Mode::code(from) as u8, Mode::code(to) as u8);
                    FLEXSPLINE_EVENT_MODE
                }
                Event::Health { from, to } => {
                    (filled.health_before, filled.health) = (from.code(), to.code());
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
        Ok(filled)
    })
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
    answer(record, [span(state), span(store), span(output)], || {
        let made = Record::of(tick, state_of(state)?, store_of(store)?, &given(output)?);
        Ok(Record { number, lost, ..made }.encode())
    })
}

/// Makes a predictor of its numbers, which the host discretised; `FLEXSPLINE_STATUS_ARGUMENT` if its observer does not
/// contract.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_predictor_init(
    predictor: *mut FlexsplinePredictor,
    parts: *const [f32; FLEXSPLINE_PREDICTOR_PARTS],
) -> FlexsplineStatus {
    status(|| {
        apart([span(predictor), span(parts)])?;
        let made = TwoMassObserver::from_parts(&copied(parts)?).map_err(|_| FlexsplineStatus::Argument)?;
        put(predictor, Object::Predictor, made)
    })
}

/// Makes a predictor of two inertias: discretises them over a tick and finds the gains of the observer, in double
/// precision. For the host, or for a start-up that has the time (some 20000 products of small matrices).
/// `FLEXSPLINE_STATUS_ARGUMENT` if a number is not finite and positive, or the observer does not contract.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_predictor_of(
    predictor: *mut FlexsplinePredictor,
    inertias: *const Inertias,
    noise: *const FlexsplineNoise,
    tick_s: f64,
) -> FlexsplineStatus {
    status(|| {
        let n = copied(noise)?;
        let noise = Noise {
            torque_n_m: n.torque_n_m,
            load_change_n_m: n.load_change_n_m,
            speed_rad_s: n.speed_rad_s,
            twist_rad: (n.has_twist != 0).then_some(n.twist_rad),
        };
        let made = TwoMassObserver::new(copied(inertias)?, noise, tick_s).map_err(|_| FlexsplineStatus::Argument)?;
        put(predictor, Object::Predictor, made)
    })
}

/// Reports the numbers of a predictor, for `flexspline_predictor_init` of the firmware.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_predictor_parts(
    predictor: *const FlexsplinePredictor,
    parts: *mut [f32; FLEXSPLINE_PREDICTOR_PARTS],
) -> FlexsplineStatus {
    answer(parts, [span(predictor)], || Ok(predictor_of(predictor)?.parts()))
}

/// Reports the largest error of the observer while the disturbances stay within their bounds: twist rad, speeds of
/// motor and load rad/s, torque on the load N m; for `FlexsplineNow`. For the host or start-up: 10000 ticks in double
/// precision.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_predictor_state_bound(
    predictor: *const FlexsplinePredictor,
    disturbance: *const Disturbance,
    bound: *mut [f32; 4],
) -> FlexsplineStatus {
    answer(bound, [span(predictor), span(disturbance)], || {
        Ok(predictor_of(predictor)?.state_bound(&copied(disturbance)?))
    })
}

/// Makes an observer at rest, without load.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_observer_init(observer: *mut FlexsplineObserver) -> FlexsplineStatus {
    status(|| put(observer, Object::Observer, PredictorState::new()))
}

/// One tick of the observer. `FLEXSPLINE_STATUS_ARGUMENT` if a number that is used is not finite or beyond any drive,
/// and the estimate stays; `FLEXSPLINE_STATUS_NOT_INITIALISED` if an upset hit more than a word of observer or
/// predictor (one is mended): make them anew. The reported values are NaN then.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_observer_step(
    observer: *mut FlexsplineObserver,
    predictor: *const FlexsplinePredictor,
    measured: *const Measured,
) -> FlexsplineStatus {
    status(|| {
        apart([span(observer), span(predictor)])?;
        let measured = copied(measured)?;
        let predictor = predictor_of(predictor)?;
        let observer: &mut PredictorState = get_mut(observer, Object::Observer)?;
        if observer.is_lost() || predictor.is_lost() {
            return Err(FlexsplineStatus::NotInitialised);
        }
        if predictor.step(observer, &measured) { Ok(()) } else { Err(FlexsplineStatus::Argument) }
    })
}

/// Reports the estimates of an observer.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_observer_report(
    observer: *const FlexsplineObserver,
    report: *mut FlexsplineObserverReport,
) -> FlexsplineStatus {
    answer(report, [span(observer)], || {
        let observer: &PredictorState = get(observer, Object::Observer)?;
        Ok(FlexsplineObserverReport {
            twist_rad: observer.twist_rad(),
            load_speed_rad_s: observer.load_speed_rad_s(),
            load_torque_n_m: observer.load_torque_n_m(),
        })
    })
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
    let read = [span(predictor), span(observer), span(joint), span(store), span(state), span(now)];
    answer(ahead, read, || {
        let from = copied(now)?;
        let (predictor, observer) = (predictor_of(predictor)?, get::<_, PredictorState>(observer, Object::Observer)?);
        if observer.is_lost() || predictor.is_lost() {
            return Err(FlexsplineStatus::NotInitialised);
        }
        let numbers = [from.torque_n_m, from.torque_off_n_m, from.load_change_n_m];
        let bound = if from.has_measured != 0 { from.measured_bound_rad } else { 0.0 };
        if !numbers.iter().chain(&from.state_bound).chain([&bound]).all(|number| number.is_finite()) {
            return Err(FlexsplineStatus::Argument);
        }
        let (joint, store, state) = (joint_of(joint)?, store_of(store)?, state_of(state)?);
        let (torque_n_m, load_change_n_m) = (from.torque_off_n_m, from.load_change_n_m);
        let off = Disturbance { torque_n_m, load_change_n_m, ..Disturbance::default() };
        let turned = predictor.ahead(observer, from.torque_n_m, from.ticks, from.state_bound, &off);
        let now = Now {
            generator: GeneratorAngle::from_counts(from.generator_counts),
            play: state.play(),
            measured: (from.has_measured != 0).then_some(OutputAngle::from_counts(from.measured_counts)),
            measured_bound_rad: from.measured_bound_rad,
        };
        let found = predictor.output_ahead(joint, store, observer, &turned, &now);
        Ok(FlexsplineAhead {
            output_counts: found.output.counts(),
            bound_rad: found.bound_rad,
            load_rad: turned.load_rad,
            motor_rad: turned.motor_rad,
            twist_rad: turned.twist_rad,
            quality: found.quality.code(),
        })
    })
}

#[cfg(test)]
mod tests;
