//! A small importer of FMI 2.0: unzips an FMU, loads its library for Linux, and calls it as C does, with its own
//! declarations.

use std::cell::Cell;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use flate2::read::DeflateDecoder;
use libloading::{Library, Symbol};
use rawzip::ZipArchive;

pub const OK: c_int = 0;
pub const WARNING: c_int = 1;
pub const DISCARD: c_int = 2;
pub const ERROR: c_int = 3;

/// All functions of the standard.
pub const FUNCTIONS: [&str; 44] = [
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
];

/// Any function with a component, as far as its arguments are no real numbers.
pub type Any = unsafe extern "C" fn(*mut c_void, usize, usize, usize, usize, usize, usize) -> c_int;

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

/// An FMU, unzipped and loaded.
pub struct Imported {
    pub folder: PathBuf,
    pub xml: String,
    library: Library,
}

impl Imported {
    /// From a file, into a folder.
    pub fn new(fmu: &Path, folder: &Path) -> Imported {
        let bytes = fs::read(fmu).unwrap();
        let zip = ZipArchive::from_slice(&bytes).unwrap();
        for entry in zip.entries() {
            let entry = entry.unwrap();
            let file = folder.join(entry.file_path().try_normalize().unwrap().as_ref());
            let packed = zip.get_entry(entry.wayfinder()).unwrap();
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            let mut content = packed.verifying_reader(DeflateDecoder::new(packed.data()));
            io::copy(&mut content, &mut File::create(file).unwrap()).unwrap();
        }
        let xml = fs::read_to_string(folder.join("modelDescription.xml")).unwrap();
        let identifier = attribute(&xml, "modelIdentifier");
        assert_eq!(attribute(&xml, "fmiVersion"), "2.0");
        let library = folder.join("binaries/linux64").join(format!("{identifier}.so"));
        let library = unsafe { Library::new(library) }.unwrap();
        Imported { folder: folder.to_owned(), xml, library }
    }

    /// A function by its name without `fmi2`.
    pub fn function<T>(&self, name: &str) -> Symbol<'_, T> {
        let name = format!("fmi2{name}");
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
        attribute(&self.xml, "guid")
    }

    /// The URI of the resources.
    pub fn location(&self) -> String {
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
        let instantiate = self.function::<Instantiate>("Instantiate");
        let component = unsafe { instantiate(name.as_ptr(), kind, guid.as_ptr(), location.as_ptr(), &callbacks, 0, 0) };
        if component.is_null() {
            Err(log.into_inner().unwrap())
        } else {
            Ok(Instance { of: self, component, log, time: Cell::new(0.0) })
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
}

impl Drop for Instance<'_> {
    fn drop(&mut self) {
        let free = self.of.function::<unsafe extern "C" fn(*mut c_void)>("FreeInstance");
        unsafe { free(self.component) }
    }
}

impl Instance<'_> {
    /// Messages so far.
    pub fn log(&self) -> Vec<Line> {
        self.log.lock().unwrap().clone()
    }

    /// A function without arguments.
    pub fn call(&self, name: &str) -> c_int {
        unsafe { self.of.function::<unsafe extern "C" fn(*mut c_void) -> c_int>(name)(self.component) }
    }

    /// Begins the initialisation.
    pub fn enter(&self) -> c_int {
        self.call("EnterInitializationMode")
    }

    pub fn set_up(&self, stop: Option<f64>) -> c_int {
        type SetUp = unsafe extern "C" fn(*mut c_void, c_int, f64, f64, c_int, f64) -> c_int;
        let set_up = self.of.function::<SetUp>("SetupExperiment");
        unsafe { set_up(self.component, 0, 0.0, 0.0, stop.is_some().into(), stop.unwrap_or(0.0)) }
    }

    /// Sets a variable, of whichever type it is.
    pub fn set(&self, name: &str, value: f64) {
        assert_eq!(self.try_set(name, value), OK, "{name}: {:?}", self.log());
    }

    pub fn try_set(&self, name: &str, value: f64) -> c_int {
        match self.of.line(name) {
            line if line.contains("<Real") => self.put("SetReal", name, value),
            line if line.contains("<Boolean") => self.put("SetBoolean", name, value as c_int),
            _ => self.put("SetInteger", name, value as c_int),
        }
    }

    /// Sets a value of a type.
    fn put<T>(&self, function: &str, name: &str, value: T) -> c_int {
        type Set<T> = unsafe extern "C" fn(*mut c_void, *const u32, usize, *const T) -> c_int;
        let reference = self.of.reference(name);
        unsafe { self.of.function::<Set<T>>(function)(self.component, &reference, 1, &value) }
    }

    fn take<T: Default>(&self, function: &str, name: &str) -> T {
        type Get<T> = unsafe extern "C" fn(*mut c_void, *const u32, usize, *mut T) -> c_int;
        let (reference, mut value) = (self.of.reference(name), T::default());
        let status = unsafe { self.of.function::<Get<T>>(function)(self.component, &reference, 1, &mut value) };
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
        type Get = unsafe extern "C" fn(*mut c_void, *const u32, usize, *mut f64) -> c_int;
        let get = self.of.function::<Get>("GetReal");
        unsafe { get(self.component, references.as_ptr(), references.len(), values.as_mut_ptr()) }
    }

    /// Reads an integer, a choice or a truth.
    pub fn number(&self, name: &str) -> c_int {
        self.take(if self.of.line(name).contains("<Boolean") { "GetBoolean" } else { "GetInteger" }, name)
    }

    pub fn text(&self, name: &str) -> String {
        let value = self.take::<usize>("GetString", name);
        unsafe { CStr::from_ptr(std::ptr::with_exposed_provenance(value)) }.to_str().unwrap().to_owned()
    }

    /// The derivative of an input for the next step.
    pub fn slope(&self, name: &str, value: f64) {
        type Set = unsafe extern "C" fn(*mut c_void, *const u32, usize, *const c_int, *const f64) -> c_int;
        let set = self.of.function::<Set>("SetRealInputDerivatives");
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
        type Step = unsafe extern "C" fn(*mut c_void, f64, f64, c_int) -> c_int;
        unsafe { self.of.function::<Step>("DoStep")(self.component, from, seconds, 1) }
    }
}
