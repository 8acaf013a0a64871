//! Our solvers along the path of the deck.

use std::time::Duration;

use flexspline_mechanics::fem::element::cauchy_stress;
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Method, Problem, State};
use rustix::time::{ClockId, clock_gettime};

/// Our solvers, the one that the others are measured against first.
pub const SOLVERS: [Method; 2] = [Method::Reference, Method::Fast];

/// Where the drive is taken: generator angle (rad) and load (N m).
pub type Stop = (f64, f64);

/// The states at the stops, on all nodes, and the processor time that each took.
pub struct Journey {
    /// One for each stop.
    pub states: Vec<State>,
    /// Median over the repetitions.
    pub cpu: Vec<Duration>,
}

/// Processor time of all threads of this process so far.
fn processor_time() -> Duration {
    clock_gettime(ClockId::ProcessCPUTime).try_into().expect("a time that is not negative")
}

/// Takes the drive through the stops, `repeat` times over from a new start, for the sake of the time.
pub fn journey(problem: &Problem, stops: &[Stop], repeat: usize) -> Result<Journey, String> {
    let mut states = Vec::new();
    let mut cpu = vec![Vec::new(); stops.len()];
    for _ in 0..repeat {
        states.clear();
        let mut motion = Motion::deformed(problem, stops[0].0).map_err(|error| error.to_string())?;
        for ((generator_rad, torque_n_m), cpu) in stops.iter().zip(&mut cpu) {
            let begun = processor_time();
            motion.to(*generator_rad, *torque_n_m).map_err(|error| error.to_string())?;
            cpu.push(processor_time() - begun);
            states.push(problem.whole_state(motion.state()).into_owned());
        }
    }
    let median = |mut times: Vec<Duration>| {
        times.sort();
        times[times.len() / 2]
    };
    Ok(Journey { states, cpu: cpu.into_iter().map(median).collect() })
}

/// Processor time (s) of an increment in a run: from the stop `start` on, the generator turned `increments` times by
/// `step_rad` under its load. The first of them know nothing of the motion yet and cost most.
pub fn run_cpu_s(problem: &Problem, start: Stop, step_rad: f64, increments: usize) -> Result<f64, String> {
    let mut motion = Motion::deformed(problem, start.0).map_err(|error| error.to_string())?;
    motion.load(start.1).map_err(|error| error.to_string())?;
    let begun = processor_time();
    motion.turn_in(step_rad * increments as f64, increments).map_err(|error| error.to_string())?;
    Ok((processor_time() - begun).as_secs_f64() / increments as f64)
}

/// Displacement of a node of the flexspline, mm.
pub fn displacement(state: &State, node: usize) -> [f64; 2] {
    [state.u[2 * node], state.u[2 * node + 1]]
}

/// Cauchy stress `[s11, s22, s12]` (MPa) at the integration points of an element of the flexspline, in the order of
/// CalculiX: along xi first, then along eta.
pub fn stress(problem: &Problem, state: &State, element: usize) -> [[f64; 3]; 4] {
    let mut u = [0.0; 16];
    for (a, &n) in problem.flexspline.elements[element].iter().enumerate() {
        [u[2 * a], u[2 * a + 1]] = displacement(state, n as usize);
    }
    let stress = |point| cauchy_stress(point, &problem.material, &u);
    let [a, b, c, d] = problem.flexspline.gauss[element].each_ref().map(stress);
    [a, b, d, c]
}
