//! The functions of FMI 2.0 (section 2.1.1: a library exports them by these names).

use std::ffi::{CString, c_char, c_int, c_void};

use super::*;

/// `fmi2CallbackLogger`: environment, name of the instance, status, category, message in the form of `printf`, its
/// arguments.
pub type Logger = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);

/// `fmi2CallbackFunctions` (section 2.1.5).
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Callbacks {
    /// Takes a line of the log.
    pub logger: Option<Logger>,
    /// Not used.
    pub allocate_memory: Option<unsafe extern "C" fn(usize, usize) -> *mut c_void>,
    /// Not used.
    pub free_memory: Option<unsafe extern "C" fn(*mut c_void)>,
    /// Not used: steps are done when the call returns.
    pub step_finished: Option<unsafe extern "C" fn(*mut c_void, c_int)>,
    /// Passed on to the logger.
    pub environment: *mut c_void,
}

const CO_SIMULATION: c_int = 1;
const DISCARD: c_int = FmiStatus::Discard as c_int;

/// What is asked of `fmi2Get…Status` (section 4.2.3).
const LAST_SUCCESSFUL_TIME: c_int = 2;
const TERMINATED: c_int = 3;

/// `fmi2GetTypesPlatform`: the usual types.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

/// `fmi2GetVersion`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

/// `fmi2Instantiate`: null if there is no such model, with a line in the log.
///
/// # Safety
/// Strings end with a zero byte; `callbacks` are valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2Instantiate(
    instance_name: *const c_char,
    fmu_type: c_int,
    guid: *const c_char,
    resource_location: *const c_char,
    callbacks: *const Callbacks,
    _visible: c_int,
    logging_on: c_int,
) -> Component {
    if callbacks.is_null() {
        return std::ptr::null_mut();
    }
    let Callbacks { logger, environment, .. } = unsafe { *callbacks };
    let environment = environment.expose_provenance();
    let name = CString::new(unsafe { text(instance_name) }.unwrap_or_default()).unwrap_or_default();
    // What means something to `printf`, or to the standard (section 2.1.5: `#` begins a reference to a variable).
    let log = log_to(&["%", "#"], move |status, category, message| {
        let Some(logger) = logger else { return };
        let environment = std::ptr::with_exposed_provenance_mut(environment);
        // The importer's function, with its own environment, as it was given them here.
        unsafe { logger(environment, name.as_ptr(), status as c_int, category.as_ptr(), message.as_ptr()) }
    });
    let refused = (fmu_type != CO_SIMULATION).then_some("found model exchange, allowed: co-simulation");
    let texts = [instance_name, guid, resource_location];
    unsafe { instantiate((FmiVersion::Two, "fmi2Instantiate"), texts, (log, logging_on != 0), refused) }
}

/// `fmi2FreeInstance`: nothing happens to one that is not there.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2FreeInstance(component: Component) {
    free(component);
}

/// An enumeration is read and set as an integer (section 2.1.7).
fn is_integer(kind: Kind) -> bool {
    matches!(kind, Kind::Integer | Kind::Choice(_))
}

/// A place is written to where the kind of status that is asked for is there; else the question is discarded.
unsafe fn answer<T>(component: Component, call: &str, known: bool, to: *mut T, value: fn(&Instance) -> T) -> c_int {
    with(component, |instance| match known {
        _ if to.is_null() => null(instance, call),
        true => {
            unsafe { *to = value(instance) };
            OK
        }
        false => DISCARD,
    })
}

type Strings = *const *const c_char;

functions! { component, call;
    fmi2SetDebugLogging(on: c_int, count: usize, categories: Strings) =>
        set_logging(component, call, on != 0, count, categories);
    // A tolerance has no use where steps are fixed.
    fmi2SetupExperiment(_tolerates: c_int, _tolerance: f64, start_s: f64, stops: c_int, stop_s: f64) =>
        plain(component, |instance| instance.set_up(call, start_s, (stops != 0).then_some(stop_s)));
    fmi2EnterInitializationMode() => plain(component, |instance| instance.enter_initialization(call));
    fmi2ExitInitializationMode() => plain(component, |instance| instance.exit_initialization(call));
    fmi2Terminate() => plain(component, |instance| instance.terminate(call));
    fmi2Reset() => plain(component, |instance| { instance.reset(); Ok(()) });
    fmi2GetReal(of: References, n: usize, to: *mut f64) => read(component, call, is_real, (of, n), (to, n));
    fmi2GetInteger(of: References, n: usize, to: *mut c_int) => read(component, call, is_integer, (of, n), (to, n));
    fmi2GetBoolean(of: References, n: usize, to: *mut c_int) => read(component, call, is_boolean, (of, n), (to, n));
    fmi2GetString(of: References, n: usize, to: *mut *const c_char) => read_texts(component, call, (of, n), (to, n));
    fmi2SetReal(of: References, n: usize, from: *const f64) => write(component, call, is_real, (of, n), (from, n));
    fmi2SetInteger(of: References, n: usize, from: *const c_int) =>
        write(component, call, is_integer, (of, n), (from, n));
    fmi2SetBoolean(of: References, n: usize, from: *const c_int) =>
        write(component, call, is_boolean, (of, n), (from, n));
    fmi2SetString(of: References, n: usize, _from: Strings) => write_texts(component, call, of, n);
    fmi2GetFMUstate(state: *mut FmuState) => get_state(component, call, state);
    fmi2SetFMUstate(state: FmuState) => set_state(component, call, state);
    fmi2FreeFMUstate(state: *mut FmuState) => free_state(component, call, state);
    fmi2SerializedFMUstateSize(state: FmuState, size: *mut usize) => state_size(component, call, state, size);
    fmi2SerializeFMUstate(state: FmuState, to: *mut u8, size: usize) => serialize(component, call, state, to, size);
    fmi2DeSerializeFMUstate(from: *const u8, size: usize, state: *mut FmuState) =>
        deserialize(component, call, from, size, state);
    fmi2SetRealInputDerivatives(of: References, n: usize, orders: *const c_int, values: *const f64) =>
        with(component, |instance| {
            let (Some(of), Some(orders), Some(values)) = (list(of, n), list(orders, n), list(values, n)) else {
                return null(instance, call);
            };
            let set = of.iter().zip(orders).zip(values).map(|((of, order), value)| (*of, *order, *value));
            status(instance.set_slopes(call, &set.collect::<Vec<(u32, i32, f64)>>()))
        });
    fmi2DoStep(from_s: f64, step_s: f64, _no_set_prior: c_int) =>
        plain(component, |instance| instance.step(call, from_s, step_s));

    // Steps are done when their call returns, none is pending, and the model never ends by itself.
    fmi2GetStatus(_kind: c_int, _to: *mut c_int) => with(component, |_| DISCARD);
    fmi2GetRealStatus(kind: c_int, to: *mut f64) =>
        answer(component, call, kind == LAST_SUCCESSFUL_TIME, to, Instance::time_s);
    fmi2GetIntegerStatus(_kind: c_int, _to: *mut c_int) => with(component, |_| DISCARD);
    fmi2GetBooleanStatus(kind: c_int, to: *mut c_int) => answer(component, call, kind == TERMINATED, to, |_| 0);
    fmi2GetStringStatus(_kind: c_int, _to: *mut *const c_char) => with(component, |_| DISCARD);

    fmi2CancelStep() => lacking(component, call);
    fmi2GetDirectionalDerivative(_of: References, _n: usize, _by: References, _m: usize, _change: *const f64,
        _to: *mut f64) => lacking(component, call);
    fmi2GetRealOutputDerivatives(_of: References, _n: usize, _orders: *const c_int, _to: *mut f64) =>
        lacking(component, call);
    // Model exchange (section 3.2).
    fmi2EnterEventMode() => lacking(component, call);
    fmi2NewDiscreteStates(_info: *mut c_void) => lacking(component, call);
    fmi2EnterContinuousTimeMode() => lacking(component, call);
    fmi2CompletedIntegratorStep(_no_set_prior: c_int, _enter: *mut c_int, _end: *mut c_int) => lacking(component, call);
    fmi2SetTime(_time_s: f64) => lacking(component, call);
    fmi2SetContinuousStates(_states: *const f64, _n: usize) => lacking(component, call);
    fmi2GetDerivatives(_to: *mut f64, _n: usize) => lacking(component, call);
    fmi2GetEventIndicators(_to: *mut f64, _n: usize) => lacking(component, call);
    fmi2GetContinuousStates(_to: *mut f64, _n: usize) => lacking(component, call);
    fmi2GetNominalsOfContinuousStates(_to: *mut f64, _n: usize) => lacking(component, call);
}
