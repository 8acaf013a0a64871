//! The functions of FMI 2.0 (section 2.1.1: a library exports them by these names), with our own declarations of its
//! types.
//!
//! A component is a number that is looked up, and never a pointer that is followed: a call with one that was freed, or
//! that never was, is refused. Pointers to arrays and strings are read as the standard says they are, null pointers are
//! refused. No panic gets out.

use std::collections::BTreeMap;
use std::ffi::{CStr, CString, c_char, c_int, c_uint, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError, TryLockError};

use crate::instance::{FmiStatus, Instance, Log};
use crate::resources::folder_of;
use crate::variables::Kind;

/// `fmi2Component`.
pub type Component = *mut c_void;
/// `fmi2FMUstate`.
pub type FmuState = *mut c_void;

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
const OK: c_int = FmiStatus::Ok as c_int;
const DISCARD: c_int = FmiStatus::Discard as c_int;
const ERROR: c_int = FmiStatus::Error as c_int;

type Shared = Arc<Mutex<Instance>>;
static INSTANCES: Mutex<BTreeMap<usize, Shared>> = Mutex::new(BTreeMap::new());
/// The next number of a component or a state, with a distance as pointers have it.
static NEXT: AtomicUsize = AtomicUsize::new(0x1000);

fn next_number() -> usize {
    NEXT.fetch_add(16, Ordering::Relaxed)
}

fn instances() -> std::sync::MutexGuard<'static, BTreeMap<usize, Shared>> {
    INSTANCES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A text; `None` if there is none, or no UTF-8.
///
/// # Safety
/// Null, or a string that ends with a zero byte.
unsafe fn text<'a>(pointer: *const c_char) -> Option<&'a str> {
    if pointer.is_null() {
        return None;
    }
    unsafe { CStr::from_ptr(pointer) }.to_str().ok()
}

/// A list that is read; `None` if it is null and not empty.
///
/// # Safety
/// Null, or so many.
unsafe fn list<'a, T>(pointer: *const T, count: usize) -> Option<&'a [T]> {
    match count {
        0 => Some(&[]),
        _ if pointer.is_null() => None,
        _ => Some(unsafe { std::slice::from_raw_parts(pointer, count) }),
    }
}

/// A list that is written.
///
/// # Safety
/// Null, or so many, and nobody else has them.
unsafe fn list_mut<'a, T>(pointer: *mut T, count: usize) -> Option<&'a mut [T]> {
    match count {
        0 => Some(&mut []),
        _ if pointer.is_null() => None,
        _ => Some(unsafe { std::slice::from_raw_parts_mut(pointer, count) }),
    }
}

/// Calls with the instance of a component. One that is in a call already, from a callback or another thread, is
/// refused.
fn with(component: Component, call: impl FnOnce(&mut Instance) -> c_int) -> c_int {
    let done = catch_unwind(AssertUnwindSafe(|| {
        let shared = instances().get(&component.addr()).cloned();
        let Some(shared) = shared else { return ERROR };
        let mut instance = match shared.try_lock() {
            Ok(instance) => instance,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return ERROR,
        };
        catch_unwind(AssertUnwindSafe(|| call(&mut instance))).unwrap_or_else(|_| {
            instance.fail();
            instance.refuse("an error in the FMU itself; the simulation cannot go on") as c_int
        })
    }));
    done.unwrap_or(ERROR)
}

fn status(done: Result<(), FmiStatus>) -> c_int {
    done.map_or_else(|status| status as c_int, |()| OK)
}

fn null(instance: &Instance, call: &str) -> c_int {
    instance.refuse(&format!("{call}: found a null pointer, allowed: an array of the length given")) as c_int
}

fn lacking(component: Component, call: &str) -> c_int {
    with(component, |instance| {
        instance.refuse(&format!("{call}: this FMU is for co-simulation and does not have it")) as c_int
    })
}

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

/// `fmi2SetDebugLogging`.
///
/// # Safety
/// `categories` are so many strings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetDebugLogging(
    component: Component,
    logging_on: c_int,
    count: usize,
    categories: *const *const c_char,
) -> c_int {
    with(component, |instance| {
        let Some(pointers) = (unsafe { list(categories, count) }) else { return null(instance, "fmi2SetDebugLogging") };
        let names: Option<Vec<&str>> = pointers.iter().map(|pointer| unsafe { text(*pointer) }).collect();
        match names {
            Some(names) => instance.set_logging(logging_on != 0, &names) as c_int,
            None => null(instance, "fmi2SetDebugLogging"),
        }
    })
}

/// A log that goes to the importer, or nowhere. What means something to `printf`, or to the standard (section 2.1.5:
/// `#` begins a reference to a variable), is doubled.
fn log_to(Callbacks { logger, environment, .. }: Callbacks, name: CString) -> Log {
    let environment = environment.expose_provenance();
    Box::new(move |status, category, message| {
        let Some(logger) = logger else { return };
        let message = message.replace('\0', "").replace('%', "%%").replace('#', "##");
        let (Ok(category), Ok(message)) = (CString::new(category), CString::new(message)) else { return };
        let environment = std::ptr::with_exposed_provenance_mut(environment);
        // The importer's function, with its own environment, as `fmi2Instantiate` was given them.
        unsafe { logger(environment, name.as_ptr(), status as c_int, category.as_ptr(), message.as_ptr()) }
    })
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
    let made = catch_unwind(|| {
        if callbacks.is_null() {
            return None;
        }
        let callbacks = unsafe { *callbacks };
        let name = unsafe { text(instance_name) }.unwrap_or_default();
        let log = log_to(callbacks, CString::new(name).unwrap_or_default());
        let refuse =
            |log: &Log, what: &str| log(FmiStatus::Error, "logStatusError", &format!("fmi2Instantiate: {what}"));
        if name.is_empty() {
            refuse(&log, "found no instance name, allowed: one that is not empty");
            return None;
        }
        if fmu_type != CO_SIMULATION {
            refuse(&log, "found model exchange, allowed: co-simulation");
            return None;
        }
        let (Some(guid), Some(location)) = (unsafe { text(guid) }, unsafe { text(resource_location) }) else {
            refuse(&log, "found no GUID or no resource location, allowed: both");
            return None;
        };
        let folder = match folder_of(location) {
            Ok(folder) => folder,
            Err(error) => {
                refuse(&log, &error.to_string());
                return None;
            }
        };
        match Instance::new(&folder, guid, log, logging_on != 0) {
            Ok(instance) => Some(instance),
            Err((log, error)) => {
                refuse(&log, &error.to_string());
                None
            }
        }
    });
    let Ok(Some(instance)) = made else { return std::ptr::null_mut() };
    let number = next_number();
    instances().insert(number, Arc::new(Mutex::new(instance)));
    std::ptr::without_provenance_mut(number)
}

/// `fmi2FreeInstance`: nothing happens to one that is not there.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2FreeInstance(component: Component) {
    let _ = catch_unwind(AssertUnwindSafe(|| {
        let freed = instances().remove(&component.addr());
        drop(freed);
    }));
}

/// `fmi2SetupExperiment`; a tolerance has no use where steps are fixed.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetupExperiment(
    component: Component,
    _tolerance_defined: c_int,
    _tolerance: f64,
    start_s: f64,
    stop_defined: c_int,
    stop_s: f64,
) -> c_int {
    with(component, |instance| status(instance.set_up(start_s, (stop_defined != 0).then_some(stop_s))))
}

/// `fmi2EnterInitializationMode`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2EnterInitializationMode(component: Component) -> c_int {
    with(component, |instance| status(instance.enter_initialization()))
}

/// `fmi2ExitInitializationMode`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2ExitInitializationMode(component: Component) -> c_int {
    with(component, |instance| status(instance.exit_initialization()))
}

/// `fmi2Terminate`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2Terminate(component: Component) -> c_int {
    with(component, |instance| status(instance.terminate()))
}

/// `fmi2Reset`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2Reset(component: Component) -> c_int {
    with(component, |instance| {
        instance.reset();
        OK
    })
}

/// Reads numbers of a type.
///
/// # Safety
/// So many references and values.
unsafe fn read<T>(
    component: Component,
    call: &'static str,
    like: fn(Kind) -> bool,
    references: *const c_uint,
    count: usize,
    values: *mut T,
    from: fn(f64) -> T,
) -> c_int {
    with(component, |instance| {
        let (Some(references), Some(values)) = (unsafe { list(references, count) }, unsafe { list_mut(values, count) })
        else {
            return null(instance, call);
        };
        match instance.get(call, like, references) {
            Ok(found) => {
                values.iter_mut().zip(found).for_each(|(to, value)| *to = from(value));
                OK
            }
            Err(status) => status as c_int,
        }
    })
}

/// Sets numbers of a type.
///
/// # Safety
/// So many references and values.
unsafe fn write<T: Copy>(
    component: Component,
    call: &'static str,
    like: fn(Kind) -> bool,
    references: *const c_uint,
    count: usize,
    values: *const T,
    to: fn(T) -> f64,
) -> c_int {
    with(component, |instance| {
        let (Some(references), Some(values)) = (unsafe { list(references, count) }, unsafe { list(values, count) })
        else {
            return null(instance, call);
        };
        let set: Vec<(u32, f64)> = references.iter().copied().zip(values.iter().map(|value| to(*value))).collect();
        status(instance.set(call, like, &set))
    })
}

fn is_real(kind: Kind) -> bool {
    matches!(kind, Kind::Real(_))
}

/// An enumeration is read and set as an integer (section 2.1.7).
fn is_integer(kind: Kind) -> bool {
    matches!(kind, Kind::Integer | Kind::Choice(_))
}

fn is_boolean(kind: Kind) -> bool {
    kind == Kind::Boolean
}

/// `fmi2GetReal`.
///
/// # Safety
/// So many references and values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetReal(
    component: Component,
    references: *const c_uint,
    count: usize,
    values: *mut f64,
) -> c_int {
    unsafe { read(component, "fmi2GetReal", is_real, references, count, values, |value| value) }
}

/// `fmi2GetInteger`.
///
/// # Safety
/// So many references and values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetInteger(
    component: Component,
    references: *const c_uint,
    count: usize,
    values: *mut c_int,
) -> c_int {
    unsafe { read(component, "fmi2GetInteger", is_integer, references, count, values, |value| value as c_int) }
}

/// `fmi2GetBoolean`.
///
/// # Safety
/// So many references and values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetBoolean(
    component: Component,
    references: *const c_uint,
    count: usize,
    values: *mut c_int,
) -> c_int {
    unsafe {
        read(component, "fmi2GetBoolean", is_boolean, references, count, values, |value| c_int::from(value != 0.0))
    }
}

/// `fmi2GetString`: valid until the instance is freed.
///
/// # Safety
/// So many references and values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetString(
    component: Component,
    references: *const c_uint,
    count: usize,
    values: *mut *const c_char,
) -> c_int {
    let call = "fmi2GetString";
    with(component, |instance| {
        let (Some(references), Some(values)) = (unsafe { list(references, count) }, unsafe { list_mut(values, count) })
        else {
            return null(instance, call);
        };
        for (to, reference) in values.iter_mut().zip(references) {
            match instance.get_text(call, *reference) {
                Ok(text) => *to = text.as_ptr(),
                Err(status) => return status as c_int,
            }
        }
        OK
    })
}

/// `fmi2SetReal`.
///
/// # Safety
/// So many references and values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetReal(
    component: Component,
    references: *const c_uint,
    count: usize,
    values: *const f64,
) -> c_int {
    unsafe { write(component, "fmi2SetReal", is_real, references, count, values, |value| value) }
}

/// `fmi2SetInteger`.
///
/// # Safety
/// So many references and values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetInteger(
    component: Component,
    references: *const c_uint,
    count: usize,
    values: *const c_int,
) -> c_int {
    unsafe { write(component, "fmi2SetInteger", is_integer, references, count, values, f64::from) }
}

/// `fmi2SetBoolean`.
///
/// # Safety
/// So many references and values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetBoolean(
    component: Component,
    references: *const c_uint,
    count: usize,
    values: *const c_int,
) -> c_int {
    // Any number but 0 is true.
    let truth = |value: c_int| f64::from(u8::from(value != 0));
    unsafe { write(component, "fmi2SetBoolean", is_boolean, references, count, values, truth) }
}

/// `fmi2SetString`: no text can be set.
///
/// # Safety
/// So many references.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetString(
    component: Component,
    references: *const c_uint,
    count: usize,
    _values: *const *const c_char,
) -> c_int {
    // Constants are refused by the same rule as any other; their value does not matter.
    let zeros = vec![0.0; if references.is_null() { 0 } else { count }];
    let kind = |kind: Kind| kind == Kind::Text;
    let zeros = if references.is_null() { std::ptr::null() } else { zeros.as_ptr() };
    unsafe { write(component, "fmi2SetString", kind, references, count, zeros, |value: f64| value) }
}

/// `fmi2GetFMUstate`.
///
/// # Safety
/// `state` is a place for it; what is there is null or a state of this instance.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetFMUstate(component: Component, state: *mut FmuState) -> c_int {
    with(component, |instance| {
        if state.is_null() {
            return null(instance, "fmi2GetFMUstate");
        }
        let there = unsafe { *state }.addr();
        let number = if instance.kept(there).is_some() { there } else { next_number() };
        instance.keep(number);
        unsafe { *state = std::ptr::without_provenance_mut(number) };
        OK
    })
}

fn unknown(instance: &Instance, call: &str) -> c_int {
    instance.refuse(&format!("{call}: found no state of this instance")) as c_int
}

/// `fmi2SetFMUstate`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetFMUstate(component: Component, state: FmuState) -> c_int {
    with(component, |instance| {
        let Some(bytes) = instance.kept(state.addr()).cloned() else { return unknown(instance, "fmi2SetFMUstate") };
        match instance.go_on_from(&bytes) {
            Ok(()) => OK,
            Err(error) => instance.refuse(&format!("fmi2SetFMUstate: found {error}")) as c_int,
        }
    })
}

/// `fmi2FreeFMUstate`: the place is null afterwards; null is left as it is.
///
/// # Safety
/// Null, or a place with null or a state of this instance.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2FreeFMUstate(component: Component, state: *mut FmuState) -> c_int {
    with(component, |instance| {
        if state.is_null() || unsafe { *state }.is_null() {
            return OK;
        }
        if !instance.forget(unsafe { *state }.addr()) {
            return unknown(instance, "fmi2FreeFMUstate");
        }
        unsafe { *state = std::ptr::null_mut() };
        OK
    })
}

/// `fmi2SerializedFMUstateSize`.
///
/// # Safety
/// `size` is a place for it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SerializedFMUstateSize(component: Component, state: FmuState, size: *mut usize) -> c_int {
    with(component, |instance| {
        let Some(bytes) = instance.kept(state.addr()).map(Vec::len) else {
            return unknown(instance, "fmi2SerializedFMUstateSize");
        };
        if size.is_null() {
            return null(instance, "fmi2SerializedFMUstateSize");
        }
        unsafe { *size = bytes };
        OK
    })
}

/// `fmi2SerializeFMUstate`.
///
/// # Safety
/// So many bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SerializeFMUstate(
    component: Component,
    state: FmuState,
    serialized: *mut c_char,
    size: usize,
) -> c_int {
    let call = "fmi2SerializeFMUstate";
    with(component, |instance| {
        let Some(bytes) = instance.kept(state.addr()) else { return unknown(instance, call) };
        if size < bytes.len() {
            let what = format!("{call}: found room for {size} bytes, allowed: {} at least", bytes.len());
            return instance.refuse(&what) as c_int;
        }
        let Some(room) = (unsafe { list_mut(serialized.cast::<u8>(), bytes.len()) }) else {
            return null(instance, call);
        };
        room.copy_from_slice(bytes);
        OK
    })
}

/// `fmi2DeSerializeFMUstate`.
///
/// # Safety
/// So many bytes, and a place for the state; what is there is null or a state of this instance.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2DeSerializeFMUstate(
    component: Component,
    serialized: *const c_char,
    size: usize,
    state: *mut FmuState,
) -> c_int {
    let call = "fmi2DeSerializeFMUstate";
    with(component, |instance| {
        let Some(bytes) = (unsafe { list(serialized.cast::<u8>(), size) }).filter(|_| !state.is_null()) else {
            return null(instance, call);
        };
        if let Err(error) = instance.check(bytes) {
            return instance.refuse(&format!("{call}: found {error}")) as c_int;
        }
        let there = unsafe { *state }.addr();
        let number = if instance.kept(there).is_some() { there } else { next_number() };
        instance.keep_bytes(number, bytes.to_vec());
        unsafe { *state = std::ptr::without_provenance_mut(number) };
        OK
    })
}

/// `fmi2GetDirectionalDerivative`: not provided.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetDirectionalDerivative(
    component: Component,
    _unknowns: *const c_uint,
    _unknown_count: usize,
    _knowns: *const c_uint,
    _known_count: usize,
    _known_changes: *const f64,
    _unknown_changes: *mut f64,
) -> c_int {
    with(component, |instance| {
        instance.refuse("fmi2GetDirectionalDerivative: providesDirectionalDerivative is false") as c_int
    })
}

/// `fmi2SetRealInputDerivatives`.
///
/// # Safety
/// So many references, orders and values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetRealInputDerivatives(
    component: Component,
    references: *const c_uint,
    count: usize,
    orders: *const c_int,
    values: *const f64,
) -> c_int {
    with(component, |instance| {
        let lists = unsafe { (list(references, count), list(orders, count), list(values, count)) };
        let (Some(references), Some(orders), Some(values)) = lists else {
            return null(instance, "fmi2SetRealInputDerivatives");
        };
        let set: Vec<(u32, i32, f64)> = references
            .iter()
            .zip(orders)
            .zip(values)
            .map(|((reference, order), value)| (*reference, *order, *value))
            .collect();
        status(instance.set_slopes(&set))
    })
}

/// `fmi2GetRealOutputDerivatives`: there are none.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetRealOutputDerivatives(
    component: Component,
    _references: *const c_uint,
    _count: usize,
    _orders: *const c_int,
    _values: *mut f64,
) -> c_int {
    with(component, |instance| instance.refuse("fmi2GetRealOutputDerivatives: maxOutputDerivativeOrder is 0") as c_int)
}

/// `fmi2DoStep`.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2DoStep(component: Component, from_s: f64, step_s: f64, _no_set_prior: c_int) -> c_int {
    with(component, |instance| status(instance.step(from_s, step_s)))
}

/// `fmi2CancelStep`: a step is done when its call returns.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2CancelStep(component: Component) -> c_int {
    with(component, |instance| {
        instance.refuse("fmi2CancelStep: no step is under way; canRunAsynchronuously is false") as c_int
    })
}

/// What is asked of `fmi2Get…Status` (section 4.2.3).
const LAST_SUCCESSFUL_TIME: c_int = 2;
const TERMINATED: c_int = 3;

/// What is not there is discarded: steps are done when their call returns, and none is pending.
fn not_there(component: Component) -> c_int {
    with(component, |_| DISCARD)
}

/// `fmi2GetStatus`: nothing is pending.
///
/// # Safety
/// A place for the value.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetStatus(component: Component, _kind: c_int, _value: *mut c_int) -> c_int {
    not_there(component)
}

/// `fmi2GetRealStatus`: the end of the last step that succeeded.
///
/// # Safety
/// A place for the value.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetRealStatus(component: Component, kind: c_int, value: *mut f64) -> c_int {
    with(component, |instance| {
        if value.is_null() {
            return null(instance, "fmi2GetRealStatus");
        }
        if kind != LAST_SUCCESSFUL_TIME {
            return DISCARD;
        }
        unsafe { *value = instance.time_s() };
        OK
    })
}

/// `fmi2GetIntegerStatus`: there is none.
///
/// # Safety
/// A place for the value.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetIntegerStatus(component: Component, _kind: c_int, _value: *mut c_int) -> c_int {
    not_there(component)
}

/// `fmi2GetBooleanStatus`: the model never ends by itself.
///
/// # Safety
/// A place for the value.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetBooleanStatus(component: Component, kind: c_int, value: *mut c_int) -> c_int {
    with(component, |instance| {
        if value.is_null() {
            return null(instance, "fmi2GetBooleanStatus");
        }
        if kind != TERMINATED {
            return DISCARD;
        }
        unsafe { *value = 0 };
        OK
    })
}

/// `fmi2GetStringStatus`: there is none.
///
/// # Safety
/// A place for the value.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetStringStatus(component: Component, _kind: c_int, _value: *mut *const c_char) -> c_int {
    not_there(component)
}

/// `fmi2EventInfo` (section 3.2.2); nothing is written to it.
#[repr(C)]
#[derive(Debug)]
pub struct EventInfo {
    new_discrete_states_needed: c_int,
    terminate_simulation: c_int,
    nominals_of_continuous_states_changed: c_int,
    values_of_continuous_states_changed: c_int,
    next_event_time_defined: c_int,
    next_event_time: f64,
}

/// Functions for model exchange (section 3.2), which this library does not have.
macro_rules! lacking {
    ($($name:ident($($argument:ident: $of:ty),*);)+) => {$(
        #[doc = concat!("`", stringify!($name), "`: not for co-simulation.")]
        #[unsafe(no_mangle)]
        pub extern "C" fn $name(component: Component $(, $argument: $of)*) -> c_int {
            $(let _ = $argument;)*
            lacking(component, stringify!($name))
        }
    )+};
}
lacking! {
    fmi2EnterEventMode();
    fmi2NewDiscreteStates(info: *mut EventInfo);
    fmi2EnterContinuousTimeMode();
    fmi2CompletedIntegratorStep(no_set_prior: c_int, enter_event_mode: *mut c_int, terminate: *mut c_int);
    fmi2SetTime(time_s: f64);
    fmi2SetContinuousStates(states: *const f64, count: usize);
    fmi2GetDerivatives(derivatives: *mut f64, count: usize);
    fmi2GetEventIndicators(indicators: *mut f64, count: usize);
    fmi2GetContinuousStates(states: *mut f64, count: usize);
    fmi2GetNominalsOfContinuousStates(nominals: *mut f64, count: usize);
}
