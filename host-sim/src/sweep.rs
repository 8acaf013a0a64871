//! FEM sweeps that sample what a table holds: steady motion over one tooth pitch at every torque and temperature node.
//!
//! An ideal drive repeats every flexspline pitch (PHYSICS of the mesh: `2 pi / z_f` of generator angle), so one pitch says
//! all. It is also its own mirror image: backward motion under a torque T is the reflection of forward motion under −T, so
//! only forward motion is computed, and `e_backward(-psi, -T) = -e_forward(psi, T)` gives the other direction.

use std::f64::consts::TAU;
use std::ops::ControlFlow;

use flexspline::Direction;
use flexspline::precompute::Sample;

use crate::drive::{Drive, GeneratorKind};
use crate::stepping::{Problem, SolveError, Solver, SolverSettings, State};

/// What to sample.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepPlan {
    /// Torque nodes, ascending, symmetric about zero, N m.
    pub torque_nodes_n_m: Vec<f32>,
    /// Temperature nodes, ascending, °C.
    pub temperature_nodes_c: Vec<f32>,
    /// Samples over one tooth pitch.
    pub positions: usize,
    /// Pitches of forward motion before the first sample after a change of torque or temperature, at least one increment.
    pub settling_pitches: f64,
}

/// Share of the drag torque by which the nodes at either side of the jump lie away from it.
const JUMP_HALF_WIDTH: f64 = 0.05;

impl SweepPlan {
    /// The default: one pair of nodes at each end of the dead zone of the drag, from there geometric steps to the rated
    /// torque of the generator, three temperatures over the operating range, eight positions.
    pub fn for_generator(drive: &Drive, kind: GeneratorKind) -> SweepPlan {
        let temperature = &drive.temperature;
        SweepPlan {
            torque_nodes_n_m: torque_nodes(drive.output.drag_torque_n_m, rated_torque_n_m(kind), 8),
            temperature_nodes_c: [temperature.minimum_c, temperature.reference_c, temperature.maximum_c]
                .map(|t| t as f32)
                .to_vec(),
            positions: 8,
            settling_pitches: if drive.flanks.friction_coefficient > 0.0 { 2.0 } else { 0.125 },
        }
    }

    /// Converged increments that are sampled.
    pub fn sampled_increments(&self) -> usize {
        self.torque_nodes_n_m.len() * self.temperature_nodes_c.len() * self.positions
    }

    /// Increments in all, settling included: what progress counts.
    pub fn increments(&self) -> usize {
        let states = self.torque_nodes_n_m.len() * self.temperature_nodes_c.len();
        states * (self.positions + self.settling_increments() + 1)
    }

    fn settling_increments(&self) -> usize {
        ((self.settling_pitches * self.positions as f64).ceil() as usize).max(1)
    }
}

/// Torque up to which the model of a generator holds with the rim of HHD-95: rollers leave the rim unsupported.
pub fn rated_torque_n_m(kind: GeneratorKind) -> f64 {
    match kind {
        GeneratorKind::TwoRoller => 50.0,
        GeneratorKind::FourRoller => 100.0,
        GeneratorKind::DoubleDisc | GeneratorKind::Cam => 200.0,
    }
}

/// Nodes symmetric about zero: a nearly coincident pair at ± the drag torque, where the loaded flank changes, and `steps`
/// further nodes on each side, whose spacing grows geometrically up to `largest_n_m`.
pub fn torque_nodes(drag_n_m: f64, largest_n_m: f64, steps: usize) -> Vec<f32> {
    let half = JUMP_HALF_WIDTH * drag_n_m;
    let first = drag_n_m + half;
    // Distances from the jump: d, d q, d q^2, ... with the first as wide as twice the drag, so that the jump stands out.
    let start = (2.0 * drag_n_m).max(largest_n_m / 1e3);
    let ratio = ((largest_n_m - first) / start).powf(1.0 / (steps as f64 - 1.0));
    let mut positive = vec![drag_n_m - half, first];
    positive.extend((0..steps).map(|k| first + start * ratio.powi(k as i32)));
    if let Some(last) = positive.last_mut() {
        *last = largest_n_m;
    }
    positive.iter().rev().map(|t| -t).chain(positive.iter().copied()).map(|t| t as f32).collect()
}

/// Pitches within which the output must follow the generator.
const MOST_SETTLING_PITCHES: usize = 10;

/// Progress of a sweep.
#[derive(Debug, Clone, Copy)]
pub struct SweepProgress {
    /// Increments done.
    pub done: usize,
    /// Increments in all.
    pub total: usize,
    /// Newton iterations of the last increment.
    pub iterations: usize,
    /// Torque of the last increment, N m.
    pub torque_n_m: f64,
    /// Temperature of the last increment, °C.
    pub temperature_c: f64,
}

/// Samples of a sweep and how they came about.
#[derive(Debug, Clone)]
pub struct Sweep {
    /// Which generator.
    pub kind: GeneratorKind,
    /// Forward samples, computed, then backward samples, mirrored.
    pub samples: Vec<Sample>,
    /// Increments solved by FEM.
    pub increments: usize,
    /// Newton iterations.
    pub iterations: usize,
    /// Largest residual, relative to the contact forces.
    pub worst_residual: f64,
    /// Unknowns of the model.
    pub degrees_of_freedom: usize,
}

/// Why a sweep ended early.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// The FEM failed.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// The output does not follow.
    #[error("under {torque_n_m} N.m the output does not follow the generator within {pitches} tooth pitches")]
    NeverMoves {
        /// Load, N m.
        torque_n_m: f64,
        /// Travel of the generator.
        pitches: usize,
    },
    /// The observer asked to stop.
    #[error("stopped")]
    Stopped,
}

/// Runs the sweep of one generator; torque of either sign is a chain of its own, from light to heavy.
pub fn sweep(
    drive: &Drive,
    kind: GeneratorKind,
    plan: &SweepPlan,
    settings: SolverSettings,
    observe: &mut dyn FnMut(SweepProgress) -> ControlFlow<()>,
) -> Result<Sweep, SweepError> {
    let mut result = Sweep {
        kind,
        samples: Vec::with_capacity(2 * plan.sampled_increments()),
        increments: 0,
        iterations: 0,
        worst_residual: 0.0,
        degrees_of_freedom: 0,
    };
    let pitch = TAU / f64::from(drive.flexspline.teeth);
    let step = pitch / plan.positions as f64;
    let (negative, positive): (Vec<f32>, Vec<f32>) = plan.torque_nodes_n_m.iter().partition(|t| **t < 0.0);
    for &temperature in &plan.temperature_nodes_c {
        let problem = Problem::new(drive, kind, f64::from(temperature), settings)?;
        result.degrees_of_freedom = problem.degrees_of_freedom();
        let mut solver = Solver::new(&problem);
        let (unloaded, _) = solver.deform(0.0)?;
        for chain in [negative.iter().rev().copied().collect::<Vec<_>>(), positive.clone()] {
            let mut state = unloaded.clone();
            for torque in chain {
                let mut advance = |state: &State, turn: f64| -> Result<State, SweepError> {
                    let (next, increment) = solver.increment(state, state.generator_rad + turn, f64::from(torque))?;
                    result.increments += 1;
                    result.iterations += increment.iterations;
                    result.worst_residual = result.worst_residual.max(increment.residual);
                    let progress = SweepProgress {
                        done: result.increments,
                        total: plan.increments(),
                        iterations: increment.iterations,
                        torque_n_m: f64::from(torque),
                        temperature_c: f64::from(temperature),
                    };
                    match observe(progress) {
                        ControlFlow::Continue(()) => Ok(next),
                        ControlFlow::Break(()) => Err(SweepError::Stopped),
                    }
                };
                state = advance(&state, 0.0)?;
                // Under a load below the drag the output stands still until the clearance is crossed.
                let mut settled = 0;
                while settled < plan.settling_increments() || state.output_rate < 0.5 / drive.ratio() {
                    state = advance(&state, step)?;
                    settled += 1;
                    if settled > MOST_SETTLING_PITCHES * plan.positions {
                        return Err(SweepError::NeverMoves {
                            torque_n_m: f64::from(torque),
                            pitches: MOST_SETTLING_PITCHES,
                        });
                    }
                }
                for _ in 0..plan.positions {
                    state = advance(&state, step)?;
                    result.samples.push(Sample {
                        generator_rad: state.generator_rad,
                        torque_n_m: f64::from(torque),
                        temperature_c: f64::from(temperature),
                        direction: Direction::Forward,
                        output_rad: state.output_rad,
                    });
                }
            }
        }
    }
    let mirrored: Vec<Sample> = result.samples.iter().map(mirror).collect();
    result.samples.extend(mirrored);
    Ok(result)
}

/// The mirror image of a sample of a mirror-symmetric drive.
fn mirror(sample: &Sample) -> Sample {
    Sample {
        generator_rad: -sample.generator_rad,
        torque_n_m: -sample.torque_n_m,
        temperature_c: sample.temperature_c,
        direction: match sample.direction {
            Direction::Forward => Direction::Backward,
            Direction::Backward => Direction::Forward,
        },
        output_rad: -sample.output_rad,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torque_nodes_are_symmetric_and_rise_to_the_largest() {
        let nodes = torque_nodes(0.02, 50.0, 8);
        assert_eq!(nodes.len(), 20);
        assert!(nodes.windows(2).all(|w| w[0] < w[1]));
        assert!(nodes.iter().zip(nodes.iter().rev()).all(|(a, b)| *a == -*b));
        assert_eq!(nodes[19], 50.0);
        // The pairs at the drag torque stand out: their neighbours are at least eight times as wide.
        let width = |k: usize| nodes[k + 1] - nodes[k];
        assert!(width(9) > 8.0 * width(10) && width(11) > 8.0 * width(10));
    }
}
