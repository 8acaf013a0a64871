//! One simulation: calls that an importer may make in each state, its values, its time.
//!
//! States and calls are those of sections 2.1.6 to 2.1.8 and 4.2.4 of FMI 2.0. A call that is not allowed is refused:
//! it returns an error with a line in the log, and nothing changes. A model that cannot go on ends in
//! [`FmiState::Failed`].
//!
//! A model has ticks of a fixed time. A communication step does all ticks that end within it; the rest of the step is
//! carried over to the next. An input holds from the point at which it was set on, or changes with the derivative that
//! was given for the step.

use std::ffi::{CStr, CString};

use crate::FmuError;
use crate::compensation::{self, CompensationModel};
use crate::joint::{self, MovingJoint};
use crate::resources::Resources;
use crate::variables::{FmiRole, FmiType, ModelKind, Variable};

/// `fmi2Status`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(i32)]
pub enum FmiStatus {
    /// Done.
    Ok = 0,
    /// Done, with a remark in the log.
    Warning = 1,
    /// Not available.
    Discard = 2,
    /// Refused, or the model cannot go on.
    Error = 3,
}

/// Where in its life an instance is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FmiState {
    /// Made, or reset.
    Instantiated,
    /// Between the calls that enter and exit the initialisation.
    Initializing,
    /// Ready for the next step.
    Stepping,
    /// A step failed: only to be reset or freed.
    Failed,
    /// At its end.
    Terminated,
}

impl FmiState {
    const ALL: [FmiState; 5] =
        [FmiState::Instantiated, FmiState::Initializing, FmiState::Stepping, FmiState::Failed, FmiState::Terminated];

    const fn name(self) -> &'static str {
        match self {
            FmiState::Instantiated => "instantiated",
            FmiState::Initializing => "initialization mode",
            FmiState::Stepping => "step complete",
            FmiState::Failed => "step failed",
            FmiState::Terminated => "terminated",
        }
    }
}

/// Categories of the log, as `modelDescription.xml` lists them: errors, warnings, and what happened.
pub const CATEGORIES: [&str; 3] = ["logStatusError", "logStatusWarning", "logEvents"];

/// Takes a line: status, category, text.
pub type Log = Box<dyn Fn(FmiStatus, &str, &str) + Send>;

/// The values of a tick.
pub struct Inputs<'a> {
    values: &'a [f64],
    slopes: &'a [f64],
    begins_s: f64,
    ends_s: f64,
}

impl Inputs<'_> {
    /// A value at the beginning of the tick.
    pub fn start(&self, place: usize) -> f64 {
        self.at(place, self.begins_s)
    }

    /// A value at the end of the tick.
    pub fn end(&self, place: usize) -> f64 {
        self.at(place, self.ends_s)
    }

    fn at(&self, place: usize, since_s: f64) -> f64 {
        // A value of which no derivative was given is left as it is, infinite or not a number too.
        if self.slopes[place] == 0.0 { self.values[place] } else { self.values[place] + self.slopes[place] * since_s }
    }
}

/// A model that is simulated.
pub trait Model: Send {
    /// Time of a tick, s.
    fn tick_s(&self, values: &[f64]) -> f64;

    /// One tick: outputs go where they are among the values.
    ///
    /// # Errors
    /// Why the model cannot go on.
    fn tick(&mut self, at: &Inputs<'_>, outputs: &mut [f64], says: &mut dyn FnMut(String)) -> Result<(), FmuError>;
}

fn made(resources: &Resources, values: &[f64]) -> Result<Box<dyn Model>, FmuError> {
    Ok(match resources.kind {
        ModelKind::Compensation => Box::new(CompensationModel::new(resources, values)?),
        ModelKind::Joint => Box::new(MovingJoint::new(resources, values)?),
    })
}

/// A tick that ends this part of a tick after the step still belongs to it: communication points are sums of rounded
/// numbers.
const SLACK: f64 = 1e-3;
/// Most ticks in one communication step: a slip in the unit of time is an error, and does not run for hours. *Guess*.
const MOST_TICKS: f64 = 1e8;

/// One simulation.
pub struct Instance {
    resources: Resources,
    log: Log,
    logging: [bool; CATEGORIES.len()],
    state: FmiState,
    values: Vec<f64>,
    slopes: Vec<f64>,
    model: Option<Box<dyn Model>>,
    set_up: bool,
    start_s: f64,
    /// Infinity for none.
    stop_s: f64,
    time_s: f64,
    ticks: u64,
    table_id: CString,
}

impl Instance {
    /// Of resources; with `logging` all categories of the log are on.
    pub fn new(resources: Resources, log: Log, logging: bool) -> Self {
        let values = resources.starts.clone();
        Self {
            slopes: vec![0.0; values.len()],
            values,
            table_id: CString::new(resources.table_id.to_string()).unwrap_or_default(),
            resources,
            log,
            logging: [logging; CATEGORIES.len()],
            state: FmiState::Instantiated,
            model: None,
            set_up: false,
            start_s: 0.0,
            stop_s: f64::INFINITY,
            time_s: 0.0,
            ticks: 0,
        }
    }

    /// Says in the log that something is refused.
    pub fn refuse(&self, what: &str) -> FmiStatus {
        (self.log)(FmiStatus::Error, CATEGORIES[0], what);
        FmiStatus::Error
    }

    fn warn(&self, what: &str) -> FmiStatus {
        (self.log)(FmiStatus::Warning, CATEGORIES[1], what);
        FmiStatus::Warning
    }

    fn expect(&self, call: &str, allowed: &[FmiState]) -> Result<(), FmiStatus> {
        if allowed.contains(&self.state) {
            return Ok(());
        }
        let names: Vec<&str> = allowed.iter().map(|state| state.name()).collect();
        Err(self.refuse(&format!(
            "{call}: called in the state \"{}\", allowed: {}",
            self.state.name(),
            names.join(", ")
        )))
    }

    /// All categories, or those named.
    pub(crate) fn set_logging(&mut self, call: &str, on: bool, categories: &[&str]) -> FmiStatus {
        let unknown = categories.iter().find(|category| !CATEGORIES.contains(category));
        if let Some(unknown) = unknown {
            let allowed = CATEGORIES.join(", ");
            return self.refuse(&format!("{call}: found category \"{unknown}\", allowed: {allowed}"));
        }
        for (name, logged) in CATEGORIES.iter().zip(&mut self.logging) {
            if categories.is_empty() || categories.contains(name) {
                *logged = on;
            }
        }
        FmiStatus::Ok
    }

    /// `fmi2SetupExperiment`.
    pub fn set_up(&mut self, call: &str, start_s: f64, stop_s: Option<f64>) -> Result<(), FmiStatus> {
        self.expect(call, &[FmiState::Instantiated])?;
        if !start_s.is_finite() || stop_s.is_some_and(|stop_s| !(stop_s >= start_s && stop_s.is_finite())) {
            let stop = stop_s.map_or(String::new(), |stop_s| format!(" to {stop_s}"));
            return Err(self.refuse(&format!("{call}: found {start_s}{stop} s, allowed: finite, in order")));
        }
        self.set_up = true;
        (self.start_s, self.stop_s, self.time_s) = (start_s, stop_s.unwrap_or(f64::INFINITY), start_s);
        Ok(())
    }

    /// Begins the initialisation.
    pub(crate) fn enter_initialization(&mut self, call: &str) -> Result<(), FmiStatus> {
        self.expect(call, &[FmiState::Instantiated])?;
        self.state = FmiState::Initializing;
        if self.set_up {
            return Ok(());
        }
        Err(self.warn(&format!("{call}: fmi2SetupExperiment was not called; the start is at 0 s")))
    }

    /// The model is made of the parameters.
    pub(crate) fn exit_initialization(&mut self, call: &str) -> Result<(), FmiStatus> {
        self.expect(call, &[FmiState::Initializing])?;
        self.model =
            Some(made(&self.resources, &self.values).map_err(|error| self.refuse(&format!("{call}: {error}")))?);
        self.start_outputs();
        self.ticks = 0;
        self.state = FmiState::Stepping;
        if self.logging[2] {
            (self.log)(FmiStatus::Ok, CATEGORIES[2], &format!("initialised; {}", crate::MARK));
        }
        Ok(())
    }

    fn start_outputs(&mut self) {
        let variables = self.resources.kind.variables().iter().zip(&mut self.values);
        variables.filter(|(variable, _)| variable.is_output()).for_each(|(_, value)| *value = 0.0);
        match self.resources.kind {
            ModelKind::Compensation => compensation::initial(&mut self.values),
            ModelKind::Joint => joint::initial(&mut self.values),
        }
    }

    /// Ends the simulation.
    pub(crate) fn terminate(&mut self, call: &str) -> Result<(), FmiStatus> {
        self.expect(call, &[FmiState::Stepping, FmiState::Failed])?;
        self.state = FmiState::Terminated;
        Ok(())
    }

    /// As after it was made, with all start values.
    pub fn reset(&mut self) {
        self.values.clone_from(&self.resources.starts);
        self.slopes.fill(0.0);
        self.model = None;
        self.set_up = false;
        (self.start_s, self.stop_s, self.time_s, self.ticks) = (0.0, f64::INFINITY, 0.0, 0);
        self.state = FmiState::Instantiated;
    }

    /// Refuses to read before the initialisation.
    fn expect_readable(&self, call: &str) -> Result<(), FmiStatus> {
        self.expect(call, &FmiState::ALL[1..])
    }

    /// Reads values of a type.
    pub fn get(&mut self, call: &str, like: fn(FmiType) -> bool, references: &[u32]) -> Result<Vec<f64>, FmiStatus> {
        self.expect_readable(call)?;
        if self.state == FmiState::Initializing {
            self.start_outputs();
        }
        references
            .iter()
            .map(|&reference| self.variable(call, like, reference).map(|_| self.values[reference as usize]))
            .collect()
    }

    /// Reads the only text that there is.
    pub(crate) fn get_text(&self, call: &str, reference: u32) -> Result<&CStr, FmiStatus> {
        self.expect_readable(call)?;
        self.variable(call, |kind| kind == FmiType::Text, reference).map(|_| self.table_id.as_c_str())
    }

    /// Sets values of a type: all of them, or none.
    pub fn set(&mut self, call: &str, like: fn(FmiType) -> bool, set: &[(u32, f64)]) -> Result<(), FmiStatus> {
        self.expect(call, &[FmiState::Instantiated, FmiState::Initializing, FmiState::Stepping])?;
        for &(reference, value) in set {
            let variable = self.variable(call, like, reference)?;
            let now = match variable.role {
                FmiRole::Input | FmiRole::Tunable => true,
                FmiRole::Parameter => self.state != FmiState::Stepping,
                FmiRole::Output | FmiRole::Motion | FmiRole::Constant => false,
            };
            if !now {
                let why = if variable.role == FmiRole::Parameter { "after the initialisation" } else { "at all" };
                return Err(self.refuse(&format!("{call}: {} cannot be set {why}", variable.name)));
            }
            if !variable.allows(value) {
                let (name, [least, most]) = (variable.name, variable.bounds());
                return Err(self.refuse(&format!("{call}: {name}: found {value}, allowed: {least} to {most}")));
            }
        }
        for &(reference, value) in set {
            self.values[reference as usize] = value;
        }
        Ok(())
    }

    /// A variable of a type.
    fn variable(&self, call: &str, like: fn(FmiType) -> bool, reference: u32) -> Result<&'static Variable, FmiStatus> {
        let variables = self.resources.kind.variables();
        let what = match variables.get(reference as usize) {
            Some(variable) if like(variable.kind) => return Ok(variable),
            Some(variable) => format!("{} (value reference {reference}) is of another type", variable.name),
            None => format!("found value reference {reference}, allowed: 0 to {}", variables.len() - 1),
        };
        Err(self.refuse(&format!("{call}: {what}")))
    }

    /// `fmi2SetRealInputDerivatives`: of the first order, for the next step.
    pub(crate) fn set_slopes(&mut self, call: &str, set: &[(u32, i32, f64)]) -> Result<(), FmiStatus> {
        self.expect(call, &[FmiState::Instantiated, FmiState::Initializing, FmiState::Stepping])?;
        for &(reference, order, value) in set {
            let variable = self.variable(call, |_| true, reference)?;
            if variable.role != FmiRole::Input || order != 1 || !value.is_finite() {
                let what = format!("{call}: {}: found order {order}, {value}, allowed: inputs, order 1", variable.name);
                return Err(self.refuse(&what));
            }
        }
        for &(reference, _, value) in set {
            self.slopes[reference as usize] = value;
        }
        Ok(())
    }

    /// All ticks that end within it.
    pub fn step(&mut self, call: &str, from_s: f64, step_s: f64) -> Result<(), FmiStatus> {
        self.expect(call, &[FmiState::Stepping])?;
        let Some(mut model) = self.model.take() else { return Err(self.refuse(&format!("{call}: no model"))) };
        let done = self.ticked(call, model.as_mut(), from_s, step_s);
        self.model = Some(model);
        done
    }

    fn ticked(&mut self, call: &str, model: &mut dyn Model, from_s: f64, step_s: f64) -> Result<(), FmiStatus> {
        let tick_s = model.tick_s(&self.values);
        let slack_s = SLACK * tick_s + 1e-12 * from_s.abs();
        let to_s = from_s + step_s;
        if !(step_s > 0.0 && to_s.is_finite()) {
            return Err(self.refuse(&format!("{call}: found a step of {step_s} s from {from_s} s, allowed: above 0")));
        }
        if (from_s - self.time_s).abs() > slack_s {
            return Err(self.refuse(&format!("{call}: found a step from {from_s} s, allowed: from {} s", self.time_s)));
        }
        // Section 2.1.6: not beyond a stop time that was stated.
        if to_s > self.stop_s + slack_s {
            return Err(self.refuse(&format!("{call}: found a step to {to_s} s, allowed: to {} s", self.stop_s)));
        }
        let due = ((to_s - self.start_s) / tick_s + SLACK).floor();
        if due - self.ticks as f64 > MOST_TICKS {
            return Err(self
                .refuse(&format!("{call}: found a step of {step_s} s, allowed: {MOST_TICKS:e} ticks of {tick_s} s")));
        }
        while (self.ticks as f64) < due {
            let begins_s = self.start_s + self.ticks as f64 * tick_s - from_s;
            let inputs = self.values.clone();
            let at = Inputs {
                values: &inputs,
                slopes: &self.slopes,
                // What began in the step before has the inputs of this one.
                begins_s: begins_s.max(0.0),
                ends_s: (begins_s + tick_s).max(0.0),
            };
            let mut said = Vec::new();
            let ticked = model.tick(&at, &mut self.values, &mut |what| said.push(what));
            for what in said {
                self.warn(&what);
            }
            if let Err(error) = ticked {
                self.state = FmiState::Failed;
                return Err(self.refuse(&format!("{call}: at {:.6} s: {error}", from_s + begins_s)));
            }
            self.ticks += 1;
        }
        self.slopes.fill(0.0);
        self.time_s = to_s;
        Ok(())
    }

    /// It cannot be trusted any more.
    pub fn fail(&mut self) {
        self.state = FmiState::Failed;
    }
}
