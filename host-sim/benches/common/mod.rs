//! What the benchmarks share: CPU time as the measure, and drives in steady motion.
#![allow(dead_code, reason = "each benchmark takes what it needs")]

use std::time::Duration;

use cpu_time::ProcessTime;
use criterion::Criterion;
use criterion::measurement::{Measurement, ValueFormatter, WallTime};
use flexspline_sim::drive::{Drive, GeneratorKind};
use flexspline_sim::stepping::{Effort, Method, Problem, Solver, SolverSettings, State};

/// One increment of the generator, rad.
pub const STEP_RAD: f64 = 0.01;
/// Increments before anything is timed: the predictor then knows states of more than 14 tooth pitches of HHD-95, and three of
/// them at almost the phase of the next.
pub const SETTLING: usize = 50;

/// CPU time of all threads of the process: what others run on the machine does not count.
pub struct CpuTime;

impl Measurement for CpuTime {
    type Intermediate = ProcessTime;
    type Value = Duration;

    fn start(&self) -> ProcessTime {
        ProcessTime::now()
    }

    fn end(&self, start: ProcessTime) -> Duration {
        start.elapsed()
    }

    fn add(&self, a: &Duration, b: &Duration) -> Duration {
        *a + *b
    }

    fn zero(&self) -> Duration {
        Duration::ZERO
    }

    fn to_f64(&self, value: &Duration) -> f64 {
        value.as_nanos() as f64
    }

    fn formatter(&self) -> &dyn ValueFormatter {
        WallTime.formatter()
    }
}

/// Criterion that measures CPU time, and keeps its own short: ten samples need no pictures and few resamples.
pub fn criterion() -> Criterion<CpuTime> {
    Criterion::default().with_measurement(CpuTime).without_plots().nresamples(5_000)
}

/// HHD-95 at reference temperature.
pub fn problem(kind: GeneratorKind, method: Method) -> Problem {
    let drive = Drive::hhd_95();
    let settings = SolverSettings { method, ..SolverSettings::default() };
    Problem::new(&drive, kind, drive.temperature.reference_c, settings).expect("HHD-95 is sound")
}

/// A drive that turns forward under a load. Every increment is a new one: the solver remembers where it was, and one that is
/// repeated would be predicted by its own answer.
pub struct Motion<'p> {
    pub solver: Solver<'p>,
    pub state: State,
    pub step_rad: f64,
    /// Newton iterations and increments since [`Motion::reset`].
    pub iterations: usize,
    pub increments: usize,
    /// Flanks and bore edges in contact, last increment.
    pub contacts: [usize; 2],
}

impl<'p> Motion<'p> {
    /// Deformed, loaded, and turned by `increments`.
    pub fn new(problem: &'p Problem, torque_n_m: f64, step_rad: f64, increments: usize) -> Motion<'p> {
        let mut solver = Solver::new(problem);
        let (mut state, _) = solver.deform(0.0).expect("the drive deforms");
        if torque_n_m != 0.0 {
            state = solver.increment(&state, 0.0, torque_n_m).expect("the load comes on").0;
        }
        Motion::settled(solver, state, step_rad, increments)
    }

    /// The same for the reference solver, which takes over from the fast one: deforming and loading the drive by itself takes it
    /// longer than all that is timed here.
    pub fn taken_over(problem: &'p Problem, torque_n_m: f64, step_rad: f64, increments: usize) -> Motion<'p> {
        let fast = self::problem(problem.kind, Method::Fast);
        let before = Motion::new(&fast, torque_n_m, step_rad, 5);
        let state = fast.whole_state(&before.state).into_owned();
        Motion::settled(Solver::new(problem), state, step_rad, increments)
    }

    fn settled(solver: Solver<'p>, state: State, step_rad: f64, increments: usize) -> Motion<'p> {
        let mut motion = Motion { solver, state, step_rad, iterations: 0, increments: 0, contacts: [0; 2] };
        (0..increments).for_each(|_| motion.advance());
        motion.reset();
        motion
    }

    /// One increment.
    pub fn advance(&mut self) {
        let to = self.state.generator_rad + self.step_rad;
        let (next, increment) =
            self.solver.increment(&self.state, to, self.state.torque_n_m).expect("steady motion goes on");
        self.state = next;
        self.increments += 1;
        self.iterations += increment.iterations;
        self.contacts = [increment.flank_contacts, increment.generator_contacts];
    }

    /// Counts and effort from here on.
    pub fn reset(&mut self) {
        (self.iterations, self.increments, self.solver.effort) = (0, 0, Effort::default());
    }
}
