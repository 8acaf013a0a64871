//! The functions of FMI 2.0 (section 2.1.1: a library exports them by these names), and nothing but pointers.
//!
//! A component is a number that is looked up, and never a pointer that is followed: a call with one that was freed, or
//! that never was, is refused. Pointers to arrays and strings are read as the standard says they are, null pointers are
//! refused. No panic gets out.

use std::collections::BTreeMap;
use std::ffi::{CStr, CString, c_char, c_int, c_uint, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError, TryLockError};

use crate::instance::{CATEGORIES, FmiStatus, Instance, Log};
use crate::resources::{Resources, folder_of};
use crate::variables::FmiType;

/// `fmi2Component`.
pub type Component = *mut c_void;
/// Value references.
pub type References = *const c_uint;
type Strings = *const *const c_char;
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

const OK: c_int = FmiStatus::Ok as c_int;
const DISCARD: c_int = FmiStatus::Discard as c_int;
const ERROR: c_int = FmiStatus::Error as c_int;
const CO_SIMULATION: c_int = 1;

type Shared = Arc<Mutex<Instance>>;
static INSTANCES: Mutex<BTreeMap<usize, Shared>> = Mutex::new(BTreeMap::new());
/// The next number of a component, spaced as pointers are.
static NEXT: AtomicUsize = AtomicUsize::new(0x1000);

fn instances() -> std::sync::MutexGuard<'static, BTreeMap<usize, Shared>> {
    INSTANCES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A text; `None` for a null pointer, or if it is no UTF-8.
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
/// Null, or of `count` values.
unsafe fn list<'a, T>(pointer: *const T, count: usize) -> Option<&'a [T]> {
    match count {
        0 => Some(&[]),
        _ if pointer.is_null() => None,
        _ => Some(unsafe { std::slice::from_raw_parts(pointer, count) }),
    }
}

/// A list that is written; `None` if it is null and not empty.
///
/// # Safety
/// Null, or of `count` values that nobody else reads or writes.
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

/// A call with neither pointers nor a result.
fn plain(component: Component, call: impl FnOnce(&mut Instance) -> Result<(), FmiStatus>) -> c_int {
    with(component, |instance| status(call(instance)))
}

/// A call with pointers; `None` where one is null that must not be.
fn pointed(component: Component, name: &str, call: impl FnOnce(&mut Instance) -> Option<c_int>) -> c_int {
    with(component, |instance| {
        call(instance).unwrap_or_else(|| {
            let what = format!("{name}: found a null pointer, allowed: an array of the length given");
            instance.refuse(&what) as c_int
        })
    })
}

fn lacking(component: Component, call: &str) -> c_int {
    let what = format!(
        "{call}: not in this FMU: co-simulation without events, states to go back to, dependencies and derivatives"
    );
    with(component, |instance| instance.refuse(&what) as c_int)
}

fn is_real(kind: FmiType) -> bool {
    matches!(kind, FmiType::Real(_))
}

/// An enumeration is read and set as an integer (section 2.1.7).
fn is_integer(kind: FmiType) -> bool {
    matches!(kind, FmiType::Integer | FmiType::Choice(_))
}

fn is_boolean(kind: FmiType) -> bool {
    kind == FmiType::Boolean
}

/// Reads numbers: variables that are of the type `is`, as numbers of C.
unsafe fn read<T>(
    component: Component,
    call: &str,
    (of, n, to): (References, usize, *mut T),
    is: fn(FmiType) -> bool,
    number: fn(f64) -> T,
) -> c_int {
    pointed(component, call, |instance| {
        let (of, to) = unsafe { (list(of, n)?, list_mut(to, n)?) };
        Some(status(instance.get(call, is, of).map(|found| {
            to.iter_mut().zip(found).for_each(|(to, value)| *to = number(value));
        })))
    })
}

/// Sets numbers.
unsafe fn write<T: Copy>(
    component: Component,
    call: &str,
    (of, n, from): (References, usize, *const T),
    is: fn(FmiType) -> bool,
    value: fn(T) -> f64,
) -> c_int {
    pointed(component, call, |instance| {
        let (of, from) = unsafe { (list(of, n)?, list(from, n)?) };
        let set: Vec<(u32, f64)> = of.iter().copied().zip(from.iter().map(|number| value(*number))).collect();
        Some(status(instance.set(call, is, &set)))
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

/// `fmi2Instantiate`: null, with a line in the log, if there is no such model or what is asked for is refused.
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
    let texts = [instance_name, guid, resource_location].map(|pointer| unsafe { text(pointer) });
    let made = catch_unwind(AssertUnwindSafe(|| {
        let log = log_of(logger, environment, texts[0].unwrap_or_default());
        let made = match texts {
            _ if fmu_type != CO_SIMULATION => Err("found model exchange, allowed: co-simulation".to_owned()),
            [None | Some(""), ..] => Err("found no instance name, allowed: not empty".to_owned()),
            [_, Some(guid), Some(location)] => {
                folder_of(location).and_then(|folder| Resources::read(&folder, guid)).map_err(|error| error.to_string())
            }
            _ => Err("found no GUID, or no place of the resources, allowed: both".to_owned()),
        };
        match made {
            Ok(resources) => Some(Instance::new(resources, log, logging_on != 0)),
            Err(why) => {
                log(FmiStatus::Error, CATEGORIES[0], &format!("fmi2Instantiate: {why}"));
                None
            }
        }
    }));
    let Ok(Some(instance)) = made else { return std::ptr::null_mut() };
    let number = NEXT.fetch_add(16, Ordering::Relaxed);
    instances().insert(number, Arc::new(Mutex::new(instance)));
    std::ptr::without_provenance_mut(number)
}

/// A log that goes to the importer. Characters that mean something to `printf`, or to the standard (section 2.1.5: `#`
/// begins a reference to a variable), are doubled.
fn log_of(logger: Option<Logger>, environment: *mut c_void, name: &str) -> Log {
    let environment = environment.expose_provenance();
    let name = CString::new(name).unwrap_or_default();
    Box::new(move |status, category, message| {
        let Some(logger) = logger else { return };
        let message = message.replace('\0', "").replace('%', "%%").replace('#', "##");
        if let (Ok(category), Ok(message)) = (CString::new(category), CString::new(message)) {
            let environment = std::ptr::with_exposed_provenance_mut(environment);
            // The importer's function, with its own environment, as it gave them with the call.
            unsafe { logger(environment, name.as_ptr(), status as c_int, category.as_ptr(), message.as_ptr()) }
        }
    })
}

/// `fmi2FreeInstance`: nothing happens to one that is not there.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2FreeInstance(component: Component) {
    let _ = catch_unwind(AssertUnwindSafe(|| {
        let freed = instances().remove(&component.addr());
        drop(freed);
    }));
}

/// Functions that have a component and return a status, by name, arguments and what they do; `$call` is the name.
macro_rules! functions {
    ($component:ident, $call:ident; $($name:ident($($argument:ident: $of:ty),*) => $does:expr;)+) => {$(
        #[doc = concat!("`", stringify!($name), "`.")]
        ///
        /// # Safety
        /// Texts end with a zero byte, lists are as long as is said, and each place that is not null can be written to.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name($component: Component $(, $argument: $of)*) -> c_int {
            // Not every function names itself or follows a pointer.
            #[allow(unused_variables)]
            let $call = stringify!($name);
            #[allow(unused_unsafe)]
            unsafe { $does }
        }
    )+};
}

functions! { component, call;
    // All categories of the log, or those named.
    fmi2SetDebugLogging(on: c_int, n: usize, categories: Strings) => pointed(component, call, |instance| {
        let names: Option<Vec<&str>> = list(categories, n)?.iter().map(|pointer| text(*pointer)).collect();
        Some(instance.set_logging(call, on != 0, &names?) as c_int)
    });
    // A tolerance has no use where steps are fixed.
    fmi2SetupExperiment(_tolerates: c_int, _tolerance: f64, start_s: f64, stops: c_int, stop_s: f64) =>
        plain(component, |instance| instance.set_up(call, start_s, (stops != 0).then_some(stop_s)));
    fmi2EnterInitializationMode() => plain(component, |instance| instance.enter_initialization(call));
    fmi2ExitInitializationMode() => plain(component, |instance| instance.exit_initialization(call));
    fmi2Terminate() => plain(component, |instance| instance.terminate(call));
    fmi2Reset() => plain(component, |instance| { instance.reset(); Ok(()) });
    fmi2GetReal(of: References, n: usize, to: *mut f64) => read(component, call, (of, n, to), is_real, |value| value);
    fmi2GetInteger(of: References, n: usize, to: *mut c_int) =>
        read(component, call, (of, n, to), is_integer, |value| value as c_int);
    fmi2GetBoolean(of: References, n: usize, to: *mut c_int) =>
        read(component, call, (of, n, to), is_boolean, |value| value as c_int);
    // Texts are valid until the instance is freed.
    fmi2GetString(of: References, n: usize, to: *mut *const c_char) => pointed(component, call, |instance| {
        let mut texts = list(of, n)?.iter().zip(list_mut(to, n)?);
        Some(status(texts.try_for_each(|(of, to)| instance.get_text(call, *of).map(|text| *to = text.as_ptr()))))
    });
    fmi2SetReal(of: References, n: usize, from: *const f64) =>
        write(component, call, (of, n, from), is_real, |number| number);
    fmi2SetInteger(of: References, n: usize, from: *const c_int) =>
        write(component, call, (of, n, from), is_integer, f64::from);
    fmi2SetBoolean(of: References, n: usize, from: *const c_int) =>
        write(component, call, (of, n, from), is_boolean, |number| f64::from(u8::from(number != 0)));
    // No text can be set: constants are refused by the same rule as any other, whatever the value.
    fmi2SetString(of: References, n: usize, _from: Strings) => pointed(component, call, |instance| {
        let set: Vec<(u32, f64)> = list(of, n)?.iter().map(|of| (*of, 0.0)).collect();
        Some(status(instance.set(call, |kind| kind == FmiType::Text, &set)))
    });
    fmi2SetRealInputDerivatives(of: References, n: usize, orders: *const c_int, values: *const f64) =>
        pointed(component, call, |instance| {
            let set = list(of, n)?.iter().zip(list(orders, n)?).zip(list(values, n)?);
            let set = set.map(|((of, order), value)| (*of, *order, *value));
            Some(status(instance.set_slopes(call, &set.collect::<Vec<(u32, i32, f64)>>())))
        });
    fmi2DoStep(from_s: f64, step_s: f64, _no_set_prior: c_int) =>
        plain(component, |instance| instance.step(call, from_s, step_s));

    // Section 4.2.3: asked after a step that is pending or discarded, and there is none; so no status is available.
    fmi2GetStatus(_kind: c_int, _to: *mut c_int) => with(component, |_| DISCARD);
    fmi2GetRealStatus(_kind: c_int, _to: *mut f64) => with(component, |_| DISCARD);
    fmi2GetIntegerStatus(_kind: c_int, _to: *mut c_int) => with(component, |_| DISCARD);
    fmi2GetBooleanStatus(_kind: c_int, _to: *mut c_int) => with(component, |_| DISCARD);
    fmi2GetStringStatus(_kind: c_int, _to: *mut *const c_char) => with(component, |_| DISCARD);

    fmi2CancelStep() => lacking(component, call);
    fmi2GetFMUstate(_state: *mut *mut c_void) => lacking(component, call);
    fmi2SetFMUstate(_state: *mut c_void) => lacking(component, call);
    fmi2FreeFMUstate(_state: *mut *mut c_void) => lacking(component, call);
    fmi2SerializedFMUstateSize(_state: *mut c_void, _size: *mut usize) => lacking(component, call);
    fmi2SerializeFMUstate(_state: *mut c_void, _to: *mut u8, _size: usize) => lacking(component, call);
    fmi2DeSerializeFMUstate(_from: *const u8, _size: usize, _state: *mut *mut c_void) => lacking(component, call);
    fmi2GetDirectionalDerivative(_of: References, _n: usize, _by: References, _m: usize, _change: *const f64,
        _to: *mut f64) => lacking(component, call);
    fmi2GetRealOutputDerivatives(_of: References, _n: usize, _orders: *const c_int, _to: *mut f64) =>
        lacking(component, call);
    // Model exchange (section 3.2).
    fmi2EnterEventMode() => lacking(component, call);
    fmi2NewDiscreteStates(_info: *mut c_void) => lacking(component, call);
    fmi2EnterContinuousTimeMode() => lacking(component, call);
    fmi2CompletedIntegratorStep(_no_set_prior: c_int, _enter: *mut c_int, _end: *mut c_int) =>
        lacking(component, call);
    fmi2SetTime(_time_s: f64) => lacking(component, call);
    fmi2SetContinuousStates(_states: *const f64, _n: usize) => lacking(component, call);
    fmi2GetDerivatives(_to: *mut f64, _n: usize) => lacking(component, call);
    fmi2GetEventIndicators(_to: *mut f64, _n: usize) => lacking(component, call);
    fmi2GetContinuousStates(_to: *mut f64, _n: usize) => lacking(component, call);
    fmi2GetNominalsOfContinuousStates(_to: *mut f64, _n: usize) => lacking(component, call);
}
