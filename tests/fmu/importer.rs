//! A small importer of FMI 2.0 and FMI 3.0: unzips an FMU, loads its library for Linux, and calls it as C does, with declarations
//! of its own.

use std::cell::Cell;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::ptr::null;
use std::sync::Mutex;

use libloading::{Library, Symbol};
use zip::ZipArchive;

pub const OK: c_int = 0;
pub const WARNING: c_int = 1;
pub const DISCARD: c_int = 2;
pub const ERROR: c_int = 3;

/// All functions of both standards.
pub const FUNCTIONS: [&str; 119] = [
    "fmi2CancelStep",
    "fmi2CompletedIntegratorStep",
    "fmi2DeSerializeFMUstate",
    "fmi2DoStep",
    "fmi2EnterContinuousTimeMode",
    "fmi2EnterEventMode",
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
    "fmi2FreeFMUstate",
    "fmi2FreeInstance",
    "fmi2GetBoolean",
    "fmi2GetBooleanStatus",
    "fmi2GetContinuousStates",
    "fmi2GetDerivatives",
    "fmi2GetDirectionalDerivative",
    "fmi2GetEventIndicators",
    "fmi2GetFMUstate",
    "fmi2GetInteger",
    "fmi2GetIntegerStatus",
    "fmi2GetNominalsOfContinuousStates",
    "fmi2GetReal",
    "fmi2GetRealOutputDerivatives",
    "fmi2GetRealStatus",
    "fmi2GetStatus",
    "fmi2GetString",
    "fmi2GetStringStatus",
    "fmi2GetTypesPlatform",
    "fmi2GetVersion",
    "fmi2Instantiate",
    "fmi2NewDiscreteStates",
    "fmi2Reset",
    "fmi2SerializeFMUstate",
    "fmi2SerializedFMUstateSize",
    "fmi2SetBoolean",
    "fmi2SetContinuousStates",
    "fmi2SetDebugLogging",
    "fmi2SetFMUstate",
    "fmi2SetInteger",
    "fmi2SetReal",
    "fmi2SetRealInputDerivatives",
    "fmi2SetString",
    "fmi2SetTime",
    "fmi2SetupExperiment",
    "fmi2Terminate",
    "fmi3ActivateModelPartition",
    "fmi3CompletedIntegratorStep",
    "fmi3DeserializeFMUState",
    "fmi3DoStep",
    "fmi3EnterConfigurationMode",
    "fmi3EnterContinuousTimeMode",
    "fmi3EnterEventMode",
    "fmi3EnterInitializationMode",
    "fmi3EnterStepMode",
    "fmi3EvaluateDiscreteStates",
    "fmi3ExitConfigurationMode",
    "fmi3ExitInitializationMode",
    "fmi3FreeFMUState",
    "fmi3FreeInstance",
    "fmi3GetAdjointDerivative",
    "fmi3GetBinary",
    "fmi3GetBoolean",
    "fmi3GetClock",
    "fmi3GetContinuousStateDerivatives",
    "fmi3GetContinuousStates",
    "fmi3GetDirectionalDerivative",
    "fmi3GetEventIndicators",
    "fmi3GetFMUState",
    "fmi3GetFloat32",
    "fmi3GetFloat64",
    "fmi3GetInt16",
    "fmi3GetInt32",
    "fmi3GetInt64",
    "fmi3GetInt8",
    "fmi3GetIntervalDecimal",
    "fmi3GetIntervalFraction",
    "fmi3GetNominalsOfContinuousStates",
    "fmi3GetNumberOfContinuousStates",
    "fmi3GetNumberOfEventIndicators",
    "fmi3GetNumberOfVariableDependencies",
    "fmi3GetOutputDerivatives",
    "fmi3GetShiftDecimal",
    "fmi3GetShiftFraction",
    "fmi3GetString",
    "fmi3GetUInt16",
    "fmi3GetUInt32",
    "fmi3GetUInt64",
    "fmi3GetUInt8",
    "fmi3GetVariableDependencies",
    "fmi3GetVersion",
    "fmi3InstantiateCoSimulation",
    "fmi3InstantiateModelExchange",
    "fmi3InstantiateScheduledExecution",
    "fmi3Reset",
    "fmi3SerializeFMUState",
    "fmi3SerializedFMUStateSize",
    "fmi3SetBinary",
    "fmi3SetBoolean",
    "fmi3SetClock",
    "fmi3SetContinuousStates",
    "fmi3SetDebugLogging",
    "fmi3SetFMUState",
    "fmi3SetFloat32",
    "fmi3SetFloat64",
    "fmi3SetInt16",
    "fmi3SetInt32",
    "fmi3SetInt64",
    "fmi3SetInt8",
    "fmi3SetIntervalDecimal",
    "fmi3SetIntervalFraction",
    "fmi3SetShiftDecimal",
    "fmi3SetShiftFraction",
    "fmi3SetString",
    "fmi3SetTime",
    "fmi3SetUInt16",
    "fmi3SetUInt32",
    "fmi3SetUInt64",
    "fmi3SetUInt8",
    "fmi3Terminate",
    "fmi3UpdateDiscreteStates",
];

/// Any function with a component, as far as its arguments are no real numbers.
pub type Any = unsafe extern "C" fn(*mut c_void, usize, usize, usize, usize, usize, usize) -> c_int;
/// `fmi3LogMessageCallback`.
pub type LogMessage = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);

/// `fmi2CallbackFunctions`.
#[repr(C)]
pub struct Callbacks {
    logger: unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char),
    allocate: Option<unsafe extern "C" fn(usize, usize) -> *mut c_void>,
    free: Option<unsafe extern "C" fn(*mut c_void)>,
    finished: Option<unsafe extern "C" fn(*mut c_void, c_int)>,
    environment: *const Mutex<Vec<Line>>,
}

/// A line of the log.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    pub instance: String,
    pub status: c_int,
    pub category: String,
    pub message: String,
}

/// No argument follows the message, so it is read as what `printf` makes of it.
unsafe extern "C" fn logger(
    environment: *mut c_void,
    instance: *const c_char,
    status: c_int,
    category: *const c_char,
    message: *const c_char,
) {
    let text = |pointer| unsafe { CStr::from_ptr(pointer) }.to_str().unwrap().to_owned();
    let line = Line {
        instance: text(instance),
        status,
        category: text(category),
        message: text(message).replace("%%", "%").replace("##", "#"),
    };
    unsafe { &*(environment as *const Mutex<Vec<Line>>) }.lock().unwrap().push(line);
}

/// `fmi3LogMessageCallback`: without name and `printf`.
unsafe extern "C" fn log_message(
    environment: *mut c_void,
    status: c_int,
    category: *const c_char,
    message: *const c_char,
) {
    let text = |pointer| unsafe { CStr::from_ptr(pointer) }.to_str().unwrap().to_owned();
    let line =
        Line { instance: String::new(), status, category: text(category), message: text(message).replace("##", "#") };
    unsafe { &*(environment as *const Mutex<Vec<Line>>) }.lock().unwrap().push(line);
}

/// An FMU, unzipped and loaded.
pub struct Imported {
    pub folder: PathBuf,
    pub xml: String,
    /// FMI 3.0.
    pub three: bool,
    library: Library,
}

impl Imported {
    /// From a file, into a folder.
    pub fn new(fmu: &Path, folder: &Path) -> Imported {
        let mut zip = ZipArchive::new(File::open(fmu).unwrap()).unwrap();
        zip.extract(folder).unwrap();
        let xml = fs::read_to_string(folder.join("modelDescription.xml")).unwrap();
        let identifier = attribute(&xml, "modelIdentifier");
        let three = attribute(&xml, "fmiVersion") == "3.0";
        let platform = if three { "x86_64-linux" } else { "linux64" };
        let library = folder.join("binaries").join(platform).join(format!("{identifier}.so"));
        let library = unsafe { Library::new(library) }.unwrap();
        Imported { folder: folder.to_owned(), xml, three, library }
    }

    /// A function by its name of FMI 2.0, without `fmi2`, or its name of FMI 3.0, without `fmi3`.
    pub fn function<T>(&self, names: [&str; 2]) -> Symbol<'_, T> {
        let name = format!("fmi{}{}", if self.three { 3 } else { 2 }, names[usize::from(self.three)]);
        unsafe { self.library.get(name.as_bytes()) }.unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// A function that may have arguments behind those that are named.
    pub fn any(&self, name: &str) -> Symbol<'_, Any> {
        unsafe { self.library.get(name.as_bytes()) }.unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// The line that describes a variable.
    fn line(&self, name: &str) -> &str {
        let line = self.xml.lines().find(|line| line.contains(&format!(" name=\"{name}\" valueReference=")));
        line.unwrap_or_else(|| panic!("no variable {name}"))
    }

    /// Value reference of a variable.
    pub fn reference(&self, name: &str) -> u32 {
        attribute(self.line(name), "valueReference").parse().unwrap()
    }

    pub fn guid(&self) -> String {
        attribute(&self.xml, if self.three { "instantiationToken" } else { "guid" })
    }

    /// The resources: a URI, or a path.
    pub fn location(&self) -> String {
        if self.three {
            return format!("{}/resources/", self.folder.display());
        }
        format!("file://{}/resources", self.folder.display().to_string().replace('%', "%25").replace(' ', "%20"))
    }

    /// An instance in the state after it is made.
    pub fn instance(&self, name: &str) -> Instance<'_> {
        self.instance_with(name, 1, &self.guid(), &self.location()).unwrap_or_else(|log| panic!("{log:?}"))
    }

    /// An instance of what is said, or the log of why not.
    pub fn instance_with(
        &self,
        name: &str,
        kind: c_int,
        guid: &str,
        location: &str,
    ) -> Result<Instance<'_>, Vec<Line>> {
        let log = Box::new(Mutex::new(Vec::new()));
        let callbacks = Callbacks { logger, allocate: None, free: None, finished: None, environment: &*log };
        let text = |text: &str| CString::new(text).unwrap();
        let (name, guid, location) = (text(name), text(guid), text(location));
        type Instantiate = unsafe extern "C" fn(
            *const c_char,
            c_int,
            *const c_char,
            *const c_char,
            *const Callbacks,
            c_int,
            c_int,
        ) -> *mut c_void;
        type InstantiateThree = unsafe extern "C" fn(
            *const c_char,
            *const c_char,
            *const c_char,
            u8,
            u8,
            u8,
            u8,
            *const u32,
            usize,
            *const Mutex<Vec<Line>>,
            LogMessage,
            *const c_void,
        ) -> *mut c_void;
        let component = if self.three {
            let instantiate = self.function::<InstantiateThree>(["", "InstantiateCoSimulation"]);
            let environment = &raw const *log;
            let [name, guid, location] = [&name, &guid, &location].map(|text| text.as_ptr());
            // What is no kind of FMI 2.0 stands for events.
            let events = u8::from(kind > 1);
            unsafe { instantiate(name, guid, location, 0, 1, events, 1, null(), 0, environment, log_message, null()) }
        } else {
            let instantiate = self.function::<Instantiate>(["Instantiate", ""]);
            unsafe { instantiate(name.as_ptr(), kind, guid.as_ptr(), location.as_ptr(), &callbacks, 0, 0) }
        };
        if component.is_null() {
            Err(log.into_inner().unwrap())
        } else {
            Ok(Instance { of: self, component, log, time: Cell::new(0.0), stop: Cell::new(None) })
        }
    }

    /// An instance that is ready to step from 0 s, with these parameters and first inputs.
    pub fn ready(&self, name: &str, set: &[(&str, f64)]) -> Instance<'_> {
        let instance = self.instance(name);
        assert_eq!(instance.set_up(None), OK);
        for (name, value) in set {
            instance.set(name, *value);
        }
        assert_eq!(instance.enter(), OK);
        assert_eq!(instance.call("ExitInitializationMode"), OK, "{:?}", instance.log());
        instance
    }
}

/// Value of the first attribute of a name.
pub fn attribute(text: &str, name: &str) -> String {
    let from = text.split(&format!(" {name}=\"")).nth(1).unwrap_or_else(|| panic!("no {name} in {text}"));
    from.split('"').next().unwrap().to_owned()
}

/// An instance, freed at the end.
pub struct Instance<'a> {
    pub of: &'a Imported,
    pub component: *mut c_void,
    log: Box<Mutex<Vec<Line>>>,
    pub time: Cell<f64>,
    stop: Cell<Option<f64>>,
}

impl Drop for Instance<'_> {
    fn drop(&mut self) {
        let free = self.of.function::<unsafe extern "C" fn(*mut c_void)>(["FreeInstance"; 2]);
        unsafe { free(self.component) }
    }
}

impl Instance<'_> {
    /// What was logged so far.
    pub fn log(&self) -> Vec<Line> {
        self.log.lock().unwrap().clone()
    }

    /// A function without arguments.
    pub fn call(&self, name: &str) -> c_int {
        unsafe { self.of.function::<unsafe extern "C" fn(*mut c_void) -> c_int>([name; 2])(self.component) }
    }

    /// Begins the initialisation; FMI 3.0 takes the time of the experiment there.
    pub fn enter(&self) -> c_int {
        type Enter = unsafe extern "C" fn(*mut c_void, u8, f64, f64, u8, f64) -> c_int;
        let enter = self.of.function::<Enter>(["EnterInitializationMode"; 2]);
        let stop = self.stop.get();
        unsafe { enter(self.component, 0, 0.0, 0.0, stop.is_some().into(), stop.unwrap_or(0.0)) }
    }

    pub fn set_up(&self, stop: Option<f64>) -> c_int {
        self.stop.set(stop);
        if self.of.three {
            return OK;
        }
        type SetUp = unsafe extern "C" fn(*mut c_void, c_int, f64, f64, c_int, f64) -> c_int;
        let set_up = self.of.function::<SetUp>(["SetupExperiment", ""]);
        unsafe { set_up(self.component, 0, 0.0, 0.0, stop.is_some().into(), stop.unwrap_or(0.0)) }
    }

    /// Sets a variable, of whichever type it is.
    pub fn set(&self, name: &str, value: f64) {
        assert_eq!(self.try_set(name, value), OK, "{name}: {:?}", self.log());
    }

    pub fn try_set(&self, name: &str, value: f64) -> c_int {
        match self.of.line(name) {
            line if line.contains("<Real") || line.contains("<Float64") => {
                self.put(["SetReal", "SetFloat64"], name, value)
            }
            line if line.contains("<Boolean") && self.of.three => self.put(["", "SetBoolean"], name, value as u8),
            line if line.contains("<Boolean") => self.put(["SetBoolean", ""], name, value as c_int),
            line if line.contains("<Enumeration") && self.of.three => self.put(["", "SetInt64"], name, value as i64),
            _ => self.put(["SetInteger", "SetInt32"], name, value as c_int),
        }
    }

    /// A value of a type; FMI 2.0 does not look at the second count.
    fn put<T>(&self, function: [&str; 2], name: &str, value: T) -> c_int {
        type Set<T> = unsafe extern "C" fn(*mut c_void, *const u32, usize, *const T, usize) -> c_int;
        let reference = self.of.reference(name);
        unsafe { self.of.function::<Set<T>>(function)(self.component, &reference, 1, &value, 1) }
    }

    fn take<T: Default>(&self, function: [&str; 2], name: &str) -> T {
        type Get<T> = unsafe extern "C" fn(*mut c_void, *const u32, usize, *mut T, usize) -> c_int;
        let (reference, mut value) = (self.of.reference(name), T::default());
        let get = self.of.function::<Get<T>>(function);
        let status = unsafe { get(self.component, &reference, 1, &mut value, 1) };
        assert_eq!(status, OK, "{name}: {:?}", self.log());
        value
    }

    /// Reads real variables.
    pub fn reals<const N: usize>(&self, names: [&str; N]) -> [f64; N] {
        let references = names.map(|name| self.of.reference(name));
        let mut values = [f64::NAN; N];
        assert_eq!(self.get_reals(&references, &mut values), OK, "{:?}", self.log());
        values
    }

    pub fn get_reals(&self, references: &[u32], values: &mut [f64]) -> c_int {
        type Get = unsafe extern "C" fn(*mut c_void, *const u32, usize, *mut f64, usize) -> c_int;
        let get = self.of.function::<Get>(["GetReal", "GetFloat64"]);
        unsafe { get(self.component, references.as_ptr(), references.len(), values.as_mut_ptr(), values.len()) }
    }

    /// Reads an integer, a choice or a truth.
    pub fn number(&self, name: &str) -> c_int {
        match self.of.line(name) {
            line if line.contains("<Boolean") && self.of.three => self.take::<u8>(["", "GetBoolean"], name).into(),
            line if line.contains("<Boolean") => self.take(["GetBoolean", ""], name),
            line if line.contains("<Enumeration") && self.of.three => self.take::<i64>(["", "GetInt64"], name) as c_int,
            _ => self.take(["GetInteger", "GetInt32"], name),
        }
    }

    pub fn text(&self, name: &str) -> String {
        let value = self.take::<usize>(["GetString"; 2], name);
        unsafe { CStr::from_ptr(std::ptr::with_exposed_provenance(value)) }.to_str().unwrap().to_owned()
    }

    /// The derivative of an input for the next step.
    pub fn slope(&self, name: &str, value: f64) {
        type Set = unsafe extern "C" fn(*mut c_void, *const u32, usize, *const c_int, *const f64) -> c_int;
        let set = self.of.function::<Set>(["SetRealInputDerivatives", ""]);
        let reference = self.of.reference(name);
        assert_eq!(unsafe { set(self.component, &reference, 1, &1, &value) }, OK, "{:?}", self.log());
    }

    /// A step from where the last one ended.
    pub fn step(&self, seconds: f64) -> c_int {
        let status = self.step_from(self.time.get(), seconds);
        if status == OK {
            self.time.set(self.time.get() + seconds);
        }
        status
    }

    pub fn step_from(&self, from: f64, seconds: f64) -> c_int {
        type Step = unsafe extern "C" fn(*mut c_void, f64, f64, c_int, *mut u8, *mut u8, *mut u8, *mut f64) -> c_int;
        let ([mut event, mut end, mut early], mut at) = ([2_u8; 3], f64::NAN);
        let step = self.of.function::<Step>(["DoStep"; 2]);
        let status = unsafe { step(self.component, from, seconds, 1, &mut event, &mut end, &mut early, &mut at) };
        if self.of.three {
            assert_eq!([event, end, early], [0; 3]);
            assert!(at == if status == OK { from + seconds } else { self.time.get() }, "{at}");
        }
        status
    }

    /// Its state, in a place that holds one already or null.
    pub fn state(&self, place: &mut *mut c_void) -> c_int {
        type Get = unsafe extern "C" fn(*mut c_void, *mut *mut c_void) -> c_int;
        unsafe { self.of.function::<Get>(["GetFMUstate", "GetFMUState"])(self.component, place) }
    }

    pub fn set_state(&self, state: *mut c_void) -> c_int {
        unsafe {
            self.of.function::<unsafe extern "C" fn(*mut c_void, *mut c_void) -> c_int>(["SetFMUstate", "SetFMUState"])(
                self.component,
                state,
            )
        }
    }

    pub fn free_state(&self, state: &mut *mut c_void) -> c_int {
        type Free = unsafe extern "C" fn(*mut c_void, *mut *mut c_void) -> c_int;
        unsafe { self.of.function::<Free>(["FreeFMUstate", "FreeFMUState"])(self.component, state) }
    }

    pub fn serialised(&self, state: *mut c_void) -> Vec<u8> {
        type Size = unsafe extern "C" fn(*mut c_void, *mut c_void, *mut usize) -> c_int;
        type Serialise = unsafe extern "C" fn(*mut c_void, *mut c_void, *mut u8, usize) -> c_int;
        let mut size = 0;
        assert_eq!(
            unsafe {
                self.of.function::<Size>(["SerializedFMUstateSize", "SerializedFMUStateSize"])(
                    self.component,
                    state,
                    &mut size,
                )
            },
            OK
        );
        let mut bytes = vec![0; size];
        let serialise = self.of.function::<Serialise>(["SerializeFMUstate", "SerializeFMUState"]);
        assert_eq!(unsafe { serialise(self.component, state, bytes.as_mut_ptr(), size - 1) }, ERROR);
        assert_eq!(unsafe { serialise(self.component, state, bytes.as_mut_ptr(), size) }, OK);
        bytes
    }

    pub fn deserialised(&self, bytes: &[u8], place: &mut *mut c_void) -> c_int {
        type DeSerialise = unsafe extern "C" fn(*mut c_void, *const u8, usize, *mut *mut c_void) -> c_int;
        let function = self.of.function::<DeSerialise>(["DeSerializeFMUstate", "DeserializeFMUState"]);
        unsafe { function(self.component, bytes.as_ptr(), bytes.len(), place) }
    }
}
