//! The functions of FMI 3.0 (section 2.2.2: a library exports them by these names).
//!
//! A truth is a byte, any but 0 is true.

use std::ffi::{c_char, c_int, c_void};

use super::*;

/// `fmi3LogMessageCallback`: environment, status, category, message.
pub type Logger = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);
/// Another callback, which is not used.
pub type NotUsed = Option<unsafe extern "C" fn()>;

/// `fmi3GetVersion`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

/// The log of an importer; `#` begins a reference to a variable.
fn log_of(environment: *mut c_void, logger: Option<Logger>) -> Log {
    let environment = environment.expose_provenance();
    log_to(&["#"], move |status, category, message| {
        let Some(logger) = logger else { return };
        let environment = std::ptr::with_exposed_provenance_mut(environment);
        // The importer's function, with its own environment, as it gave them when the instance was made.
        unsafe { logger(environment, status as c_int, category.as_ptr(), message.as_ptr()) }
    })
}

/// `fmi3InstantiateCoSimulation`: null if there is no such model, with a line in the log. Early returns and
/// intermediate updates may be allowed; there are none.
///
/// # Safety
/// Strings end with a zero byte; the logger is one, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateCoSimulation(
    instance_name: *const c_char,
    token: *const c_char,
    resource_path: *const c_char,
    _visible: u8,
    logging_on: u8,
    event_mode_used: u8,
    _early_return_allowed: u8,
    _intermediate: References,
    _intermediate_count: usize,
    environment: *mut c_void,
    logger: Option<Logger>,
    _intermediate_update: NotUsed,
) -> Component {
    let log = (log_of(environment, logger), logging_on != 0);
    let refused = (event_mode_used != 0).then_some("found eventModeUsed, allowed: false, as hasEventMode is");
    let texts = [instance_name, token, resource_path];
    unsafe { instantiate((FmiVersion::Three, "fmi3InstantiateCoSimulation"), texts, log, refused) }
}

/// Null, with a line in the log.
fn only_co_simulation(call: &str, log: Log) -> Component {
    let refused = Some("not in this FMU, allowed: co-simulation");
    unsafe { instantiate((FmiVersion::Three, call), [std::ptr::null(); 3], (log, true), refused) }
}

/// `fmi3InstantiateModelExchange`: null, with a line in the log.
///
/// # Safety
/// The logger is one, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateModelExchange(
    _instance_name: *const c_char,
    _token: *const c_char,
    _resource_path: *const c_char,
    _visible: u8,
    _logging_on: u8,
    environment: *mut c_void,
    logger: Option<Logger>,
) -> Component {
    only_co_simulation("fmi3InstantiateModelExchange", log_of(environment, logger))
}

/// `fmi3InstantiateScheduledExecution`: null, with a line in the log.
///
/// # Safety
/// The logger is one, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateScheduledExecution(
    _instance_name: *const c_char,
    _token: *const c_char,
    _resource_path: *const c_char,
    _visible: u8,
    _logging_on: u8,
    environment: *mut c_void,
    logger: Option<Logger>,
    _clock_update: NotUsed,
    _lock_preemption: NotUsed,
    _unlock_preemption: NotUsed,
) -> Component {
    only_co_simulation("fmi3InstantiateScheduledExecution", log_of(environment, logger))
}

/// `fmi3FreeInstance`: nothing happens to one that is not there.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3FreeInstance(component: Component) {
    free(component);
}

fn is_integer(kind: Kind) -> bool {
    kind == Kind::Integer
}

/// An enumeration is read and set as an integer of 64 bits (section 2.2.7.2).
fn is_choice(kind: Kind) -> bool {
    matches!(kind, Kind::Choice(_))
}

/// Types that no variable has.
fn none(_kind: Kind) -> bool {
    false
}

type Strings = *const *const c_char;
/// Places of truths.
type Truths = *mut u8;
/// Whole numbers of clocks.
type Counts = *const u64;

/// Functions that read and set numbers, by their type and what variables have it.
macro_rules! typed {
    ($($get:ident $set:ident $of:ty: $like:ident;)+) => {
        functions! { component, call;
            $(
                $get(of: References, n: usize, to: *mut $of, m: usize) =>
                    read(component, call, $like, (of, n), (to, m));
                $set(of: References, n: usize, from: *const $of, m: usize) =>
                    write(component, call, $like, (of, n), (from, m));
            )+
        }
    };
}
typed! {
    fmi3GetFloat32 fmi3SetFloat32 f32: none;
    fmi3GetFloat64 fmi3SetFloat64 f64: is_real;
    fmi3GetInt8 fmi3SetInt8 i8: none;
    fmi3GetUInt8 fmi3SetUInt8 u8: none;
    fmi3GetInt16 fmi3SetInt16 i16: none;
    fmi3GetUInt16 fmi3SetUInt16 u16: none;
    fmi3GetInt32 fmi3SetInt32 i32: is_integer;
    fmi3GetUInt32 fmi3SetUInt32 u32: none;
    fmi3GetInt64 fmi3SetInt64 i64: is_choice;
    fmi3GetUInt64 fmi3SetUInt64 u64: none;
    fmi3GetBoolean fmi3SetBoolean u8: is_boolean;
}

functions! { component, call;
    fmi3SetDebugLogging(on: u8, count: usize, categories: Strings) =>
        set_logging(component, call, on != 0, count, categories);
    fmi3EnterInitializationMode(_tolerates: u8, _tolerance: f64, start_s: f64, stops: u8, stop_s: f64) =>
        plain(component, |instance| {
            instance.set_up(call, start_s, (stops != 0).then_some(stop_s))?;
            instance.enter_initialization(call)
        });
    fmi3ExitInitializationMode() => plain(component, |instance| instance.exit_initialization(call));
    fmi3Terminate() => plain(component, |instance| instance.terminate(call));
    fmi3Reset() => plain(component, |instance| { instance.reset(); Ok(()) });
    fmi3DoStep(from_s: f64, step_s: f64, _no_set_prior: u8, event: Truths, end: Truths, early: Truths,
        at_s: *mut f64) =>
        with(component, |instance| {
            if at_s.is_null() || [event, end, early].iter().any(|place| place.is_null()) {
                return null(instance, call);
            }
            let done = status(instance.step(call, from_s, step_s));
            (*event, *end, *early, *at_s) = (0, 0, 0, instance.time_s());
            done
        });

    fmi3GetString(of: References, n: usize, to: *mut *const c_char, m: usize) =>
        read_texts(component, call, (of, n), (to, m));
    fmi3SetString(of: References, n: usize, _to: Strings, _m: usize) => write_texts(component, call, of, n);

    fmi3GetFMUState(state: *mut FmuState) => get_state(component, call, state);
    fmi3SetFMUState(state: FmuState) => set_state(component, call, state);
    fmi3FreeFMUState(state: *mut FmuState) => free_state(component, call, state);
    fmi3SerializedFMUStateSize(state: FmuState, size: *mut usize) => state_size(component, call, state, size);
    fmi3SerializeFMUState(state: FmuState, to: *mut u8, size: usize) => serialize(component, call, state, to, size);
    fmi3DeserializeFMUState(from: *const u8, size: usize, state: *mut FmuState) =>
        deserialize(component, call, from, size, state);

    // No binaries, clocks, structural parameters, dependencies and derivatives.
    fmi3GetBinary(_of: References, _n: usize, _sizes: *mut usize, _to: *mut *const u8, _m: usize) =>
        lacking(component, call);
    fmi3SetBinary(_of: References, _n: usize, _sizes: *const usize, _to: *const *const u8, _m: usize) =>
        lacking(component, call);
    fmi3GetClock(_of: References, _n: usize, _to: Truths) => lacking(component, call);
    fmi3SetClock(_of: References, _n: usize, _to: *const u8) => lacking(component, call);
    fmi3GetIntervalDecimal(_of: References, _n: usize, _to: *mut f64, _kinds: *mut c_int) => lacking(component, call);
    fmi3GetIntervalFraction(_of: References, _n: usize, _to: *mut u64, _per: *mut u64, _kinds: *mut c_int) =>
        lacking(component, call);
    fmi3GetShiftDecimal(_of: References, _n: usize, _to: *mut f64) => lacking(component, call);
    fmi3GetShiftFraction(_of: References, _n: usize, _to: *mut u64, _per: *mut u64) => lacking(component, call);
    fmi3SetIntervalDecimal(_of: References, _n: usize, _to: *const f64) => lacking(component, call);
    fmi3SetIntervalFraction(_of: References, _n: usize, _to: Counts, _per: Counts) => lacking(component, call);
    fmi3SetShiftDecimal(_of: References, _n: usize, _to: *const f64) => lacking(component, call);
    fmi3SetShiftFraction(_of: References, _n: usize, _to: Counts, _per: Counts) => lacking(component, call);
    fmi3EnterConfigurationMode() => lacking(component, call);
    fmi3ExitConfigurationMode() => lacking(component, call);
    fmi3GetNumberOfVariableDependencies(_of: c_uint, _count: *mut usize) => lacking(component, call);
    fmi3GetVariableDependencies(_of: c_uint, _at: *mut usize, _on: *mut c_uint, _on_at: *mut usize, _kinds: *mut c_int,
        _n: usize) => lacking(component, call);
    fmi3GetDirectionalDerivative(_of: References, _n: usize, _by: References, _m: usize, _seed: *const f64,
        _seeds: usize, _to: *mut f64, _count: usize) => lacking(component, call);
    fmi3GetAdjointDerivative(_of: References, _n: usize, _by: References, _m: usize, _seed: *const f64,
        _seeds: usize, _to: *mut f64, _count: usize) => lacking(component, call);
    fmi3GetOutputDerivatives(_of: References, _n: usize, _orders: *const i32, _to: *mut f64, _m: usize) =>
        lacking(component, call);
    // No events (hasEventMode is false), model exchange and scheduled execution.
    fmi3EnterEventMode() => lacking(component, call);
    fmi3EnterStepMode() => lacking(component, call);
    fmi3EvaluateDiscreteStates() => lacking(component, call);
    fmi3UpdateDiscreteStates(_again: Truths, _end: Truths, _nominals: Truths, _values: Truths, _is_next: Truths,
        _next_s: *mut f64) => lacking(component, call);
    fmi3EnterContinuousTimeMode() => lacking(component, call);
    fmi3CompletedIntegratorStep(_no_set_prior: u8, _enter: Truths, _end: Truths) => lacking(component, call);
    fmi3SetTime(_time_s: f64) => lacking(component, call);
    fmi3SetContinuousStates(_states: *const f64, _n: usize) => lacking(component, call);
    fmi3GetContinuousStateDerivatives(_to: *mut f64, _n: usize) => lacking(component, call);
    fmi3GetEventIndicators(_to: *mut f64, _n: usize) => lacking(component, call);
    fmi3GetContinuousStates(_to: *mut f64, _n: usize) => lacking(component, call);
    fmi3GetNominalsOfContinuousStates(_to: *mut f64, _n: usize) => lacking(component, call);
    fmi3GetNumberOfEventIndicators(_to: *mut usize) => lacking(component, call);
    fmi3GetNumberOfContinuousStates(_to: *mut usize) => lacking(component, call);
    fmi3ActivateModelPartition(_clock: c_uint, _at_s: f64) => lacking(component, call);
}
