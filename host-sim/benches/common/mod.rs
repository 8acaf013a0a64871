//! What the benchmarks share: CPU time as the measure, and drives in steady motion.
#![allow(dead_code, reason = "each benchmark takes what it needs")]

use std::time::Duration;

use cpu_time::ProcessTime;
use criterion::Criterion;
use criterion::measurement::{Measurement, ValueFormatter, WallTime};
use flexspline_sim::drive::{Drive, GeneratorKind};
use flexspline_sim::motion::Motion;
use flexspline_sim::stepping::{Method, Problem, SolverSettings};

/// One increment of the generator, rad.
pub const STEP_RAD: f64 = 0.01;
/// Increments before anything is timed: the predictor then knows states of more than 14 tooth pitches of HHD-95, and
/// three of them at almost the phase of the next.
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

/// A drive that turns forward under a load. Every increment is a new one: the solver remembers where it was, and one
/// that is repeated would be predicted by its own answer.
pub struct Run<'p> {
    pub motion: Motion<'p>,
    pub step_rad: f64,
    /// Newton iterations and increments since [`Run::reset`].
    pub iterations: usize,
    pub increments: usize,
    /// Flanks and bore edges in contact, last increment.
    pub contacts: [usize; 2],
}

impl<'p> Run<'p> {
    /// Deformed, loaded, and turned by `increments`.
    pub fn new(problem: &'p Problem, torque_n_m: f64, step_rad: f64, increments: usize) -> Run<'p> {
        let mut motion = Motion::deformed(problem, 0.0).expect("the drive deforms");
        if torque_n_m != 0.0 {
            motion.load(torque_n_m).expect("the load comes on");
        }
        Run::settled(motion, step_rad, increments)
    }

    /// The same for the reference solver, which takes over from the fast one: deforming and loading the drive by itself
    /// takes it longer than all that is timed here.
    pub fn taken_over(problem: &'p Problem, torque_n_m: f64, step_rad: f64, increments: usize) -> Run<'p> {
        let fast = self::problem(problem.kind, Method::Fast);
        let before = Run::new(&fast, torque_n_m, step_rad, 5).motion;
        let state = fast.whole_state(before.state()).into_owned();
        Run::settled(Motion::taken_over(problem, state, before.last().clone()), step_rad, increments)
    }

    fn settled(motion: Motion<'p>, step_rad: f64, increments: usize) -> Run<'p> {
        let mut run = Run { motion, step_rad, iterations: 0, increments: 0, contacts: [0; 2] };
        (0..increments).for_each(|_| run.advance());
        run.reset();
        run
    }

    /// One increment.
    pub fn advance(&mut self) {
        self.motion.turn(self.step_rad).expect("steady motion goes on");
        let increment = self.motion.last();
        self.increments += 1;
        self.iterations += increment.iterations;
        self.contacts = [increment.flank_contacts, increment.generator_contacts];
    }

    /// Counts and effort from here on.
    pub fn reset(&mut self) {
        (self.iterations, self.increments) = (0, 0);
        self.motion.take_effort();
    }
}
