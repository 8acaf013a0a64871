//! The C interfaces, [`fmi2`] and [`fmi3`]: lists of the functions of each standard, over calls that are here once.
//!
//! A component is a number that is looked up, and never a pointer that is followed: a call with one that was freed, or
//! that never was, is refused. Pointers to arrays and strings are read as the standards say they are, null pointers are
//! refused. No panic gets out.

pub mod fmi2;
pub mod fmi3;

use std::collections::BTreeMap;
use std::ffi::{CStr, CString, c_char, c_int, c_uint, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError, TryLockError};

use crate::FmiVersion;
use crate::instance::{CATEGORIES, FmiStatus, Instance, Log};
use crate::resources::folder_of;
use crate::variables::Kind;

/// `fmi2Component`, `fmi3Instance`.
pub type Component = *mut c_void;
/// `fmi2FMUstate`, `fmi3FMUState`.
pub type FmuState = *mut c_void;
/// Value references.
pub type References = *const c_uint;

const OK: c_int = FmiStatus::Ok as c_int;
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

/// Functions that have a component and return a status, by name, arguments and what they do; `$call` is the name.
macro_rules! functions {
    ($component:ident, $call:ident; $($name:ident($($argument:ident: $of:ty),*) => $does:expr;)+) => {$(
        #[doc = concat!("`", stringify!($name), "`.")]
        ///
        /// # Safety
        /// Texts end with a zero byte, lists are as long as is said, and each place that is not null can be written to.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name($component: Component $(, $argument: $of)*) -> c_int {
            // What a function does need neither tell its name nor follow a pointer.
            #[allow(unused_variables)]
            let $call = stringify!($name);
            #[allow(unused_unsafe)]
            unsafe { $does }
        }
    )+};
}
use functions;

fn lacking(component: Component, call: &str) -> c_int {
    let what = format!("{call}: not in this FMU: co-simulation without events, clocks, dependencies and derivatives");
    with(component, |instance| instance.refuse(&what) as c_int)
}

/// A call with neither pointers nor a result.
fn plain(component: Component, call: impl FnOnce(&mut Instance) -> Result<(), FmiStatus>) -> c_int {
    with(component, |instance| status(call(instance)))
}

/// A log that goes to the importer. Characters that mean something to it are doubled.
fn log_to(doubled: &'static [&'static str], send: impl Fn(FmiStatus, &CStr, &CStr) + Send + 'static) -> Log {
    Box::new(move |status, category, message| {
        let message = message.replace('\0', "");
        let message = doubled.iter().fold(message, |message, letter| message.replace(letter, &letter.repeat(2)));
        if let (Ok(category), Ok(message)) = (CString::new(category), CString::new(message)) {
            send(status, &category, &message);
        }
    })
}

/// An instance of name, GUID and resources; null with a line in the log if there is none such, or if what is asked for
/// is refused.
///
/// # Safety
/// Null, or strings that end with a zero byte.
unsafe fn instantiate(
    (version, call): (FmiVersion, &str),
    texts: [*const c_char; 3],
    (log, logging): (Log, bool),
    refused: Option<&str>,
) -> Component {
    let made = catch_unwind(AssertUnwindSafe(|| {
        let made = match (refused, texts.map(|pointer| unsafe { text(pointer) })) {
            (Some(why), _) => Err((log, why.to_owned())),
            (_, [None | Some(""), ..]) => Err((log, "found no instance name, allowed: not empty".to_owned())),
            (_, [_, Some(guid), Some(location)]) => match folder_of(location) {
                Ok(folder) => {
                    Instance::new(&folder, guid, version, log, logging).map_err(|(log, error)| (log, error.to_string()))
                }
                Err(error) => Err((log, error.to_string())),
            },
            _ => Err((log, "found no GUID or token, or no place of the resources, allowed: both".to_owned())),
        };
        made.map_err(|(log, why)| log(FmiStatus::Error, CATEGORIES[0], &format!("{call}: {why}"))).ok()
    }));
    let Ok(Some(instance)) = made else { return std::ptr::null_mut() };
    let number = next_number();
    instances().insert(number, Arc::new(Mutex::new(instance)));
    std::ptr::without_provenance_mut(number)
}

/// Nothing happens to one that is not there.
fn free(component: Component) {
    let _ = catch_unwind(AssertUnwindSafe(|| {
        let freed = instances().remove(&component.addr());
        drop(freed);
    }));
}

/// All categories of the log, or those named.
unsafe fn set_logging(
    component: Component,
    call: &str,
    on: bool,
    count: usize,
    categories: *const *const c_char,
) -> c_int {
    with(component, |instance| {
        let Some(pointers) = (unsafe { list(categories, count) }) else { return null(instance, call) };
        let names: Option<Vec<&str>> = pointers.iter().map(|pointer| unsafe { text(*pointer) }).collect();
        match names {
            Some(names) => instance.set_logging(call, on, &names) as c_int,
            None => null(instance, call),
        }
    })
}

/// A number of C.
trait Number: Copy {
    fn of(value: f64) -> Self;
    fn value(self) -> f64;
}
macro_rules! numbers {
    ($($of:ty)+) => {$(
        impl Number for $of {
            fn of(value: f64) -> Self {
                value as $of
            }
            fn value(self) -> f64 {
                self as f64
            }
        }
    )+};
}
numbers! { f32 f64 i8 u8 i16 u16 i32 u32 i64 u64 }

/// References and as many values, or the refusal of the call.
macro_rules! lists {
    ($instance:ident, $call:ident, ($of:ident, $count:ident), $values:expr, $given:expr) => {{
        if $count != $given {
            let what = format!("{}: found {} value references, {} values, allowed: as many", $call, $count, $given);
            return $instance.refuse(&what) as c_int;
        }
        let (Some(of), Some(values)) = (unsafe { (list($of, $count), $values) }) else { return null($instance, $call) };
        (of, values)
    }};
}

/// Reads numbers of a type.
unsafe fn read<T: Number>(
    component: Component,
    call: &str,
    like: fn(Kind) -> bool,
    (of, count): (References, usize),
    (to, given): (*mut T, usize),
) -> c_int {
    with(component, |instance| {
        let (of, to) = lists!(instance, call, (of, count), list_mut(to, given), given);
        status(instance.get(call, like, of).map(|found| {
            to.iter_mut().zip(found).for_each(|(to, value)| *to = T::of(value));
        }))
    })
}

/// Sets numbers of a type; any number but 0 is true.
unsafe fn write<T: Number>(
    component: Component,
    call: &str,
    like: fn(Kind) -> bool,
    (of, count): (References, usize),
    (from, given): (*const T, usize),
) -> c_int {
    with(component, |instance| {
        let (of, from) = lists!(instance, call, (of, count), list(from, given), given);
        let truth = |value: f64| if like(Kind::Boolean) { f64::from(u8::from(value != 0.0)) } else { value };
        let set: Vec<(u32, f64)> = of.iter().copied().zip(from.iter().map(|value| truth(value.value()))).collect();
        status(instance.set(call, like, &set))
    })
}

/// Reads texts, valid until the instance is freed.
unsafe fn read_texts(
    component: Component,
    call: &str,
    (of, count): (References, usize),
    (to, given): (*mut *const c_char, usize),
) -> c_int {
    with(component, |instance| {
        let (of, to) = lists!(instance, call, (of, count), list_mut(to, given), given);
        let mut texts = of.iter().zip(to);
        status(texts.try_for_each(|(of, to)| instance.get_text(call, *of).map(|text| *to = text.as_ptr())))
    })
}

/// No text can be set: constants are refused by the same rule as any other, whatever the value.
unsafe fn write_texts(component: Component, call: &str, of: References, count: usize) -> c_int {
    with(component, |instance| {
        let Some(of) = (unsafe { list(of, count) }) else { return null(instance, call) };
        let set: Vec<(u32, f64)> = of.iter().map(|of| (*of, 0.0)).collect();
        status(instance.set(call, |kind| kind == Kind::Text, &set))
    })
}

fn is_real(kind: Kind) -> bool {
    matches!(kind, Kind::Real(_))
}

fn is_boolean(kind: Kind) -> bool {
    kind == Kind::Boolean
}

fn unknown(instance: &Instance, call: &str) -> c_int {
    instance.refuse(&format!("{call}: found no state of this instance")) as c_int
}

/// Keeps bytes in a place, over the state that is there if it is one of this instance.
unsafe fn keep(instance: &mut Instance, state: *mut FmuState, bytes: Vec<u8>) -> c_int {
    let there = unsafe { *state }.addr();
    let number = if instance.kept(there).is_some() { there } else { next_number() };
    instance.keep(number, bytes);
    unsafe { *state = std::ptr::without_provenance_mut(number) };
    OK
}

unsafe fn get_state(component: Component, call: &str, state: *mut FmuState) -> c_int {
    with(component, |instance| {
        if state.is_null() {
            return null(instance, call);
        }
        let bytes = instance.bytes();
        unsafe { keep(instance, state, bytes) }
    })
}

fn set_state(component: Component, call: &str, state: FmuState) -> c_int {
    with(component, |instance| {
        let Some(bytes) = instance.kept(state.addr()).cloned() else { return unknown(instance, call) };
        match instance.go_on_from(&bytes) {
            Ok(()) => OK,
            Err(error) => instance.refuse(&format!("{call}: found {error}")) as c_int,
        }
    })
}

/// The place is null afterwards; null is left as it is.
unsafe fn free_state(component: Component, call: &str, state: *mut FmuState) -> c_int {
    with(component, |instance| {
        if state.is_null() || unsafe { *state }.is_null() {
            return OK;
        }
        if !instance.forget(unsafe { *state }.addr()) {
            return unknown(instance, call);
        }
        unsafe { *state = std::ptr::null_mut() };
        OK
    })
}

unsafe fn state_size(component: Component, call: &str, state: FmuState, size: *mut usize) -> c_int {
    with(component, |instance| {
        let Some(bytes) = instance.kept(state.addr()).map(Vec::len) else { return unknown(instance, call) };
        if size.is_null() {
            return null(instance, call);
        }
        unsafe { *size = bytes };
        OK
    })
}

unsafe fn serialize(component: Component, call: &str, state: FmuState, to: *mut u8, size: usize) -> c_int {
    with(component, |instance| {
        let Some(bytes) = instance.kept(state.addr()) else { return unknown(instance, call) };
        if size < bytes.len() {
            let what = format!("{call}: found room for {size} bytes, allowed: {} at least", bytes.len());
            return instance.refuse(&what) as c_int;
        }
        let Some(room) = (unsafe { list_mut(to, bytes.len()) }) else { return null(instance, call) };
        room.copy_from_slice(bytes);
        OK
    })
}

unsafe fn deserialize(component: Component, call: &str, from: *const u8, size: usize, state: *mut FmuState) -> c_int {
    with(component, |instance| {
        let Some(bytes) = (unsafe { list(from, size) }).filter(|_| !state.is_null()) else {
            return null(instance, call);
        };
        match instance.check(bytes) {
            Ok(()) => unsafe { keep(instance, state, bytes.to_vec()) },
            Err(error) => instance.refuse(&format!("{call}: found {error}")) as c_int,
        }
    })
}
