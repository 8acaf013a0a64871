//! FEM sweeps that sample what a table holds: steady motion over one tooth pitch at every torque and temperature node.
//!
//! An ideal drive repeats every flexspline pitch (`2 pi / z_f` of generator angle), so one pitch says all. It is also
//! its own mirror image: backward motion under a torque T is the reflection of forward motion under −T, so only forward
//! motion is computed, and `e_backward(-psi, -T) = -e_forward(psi, T)` gives the other direction.
//!
//! Frictionless flanks leave nothing but the drag of the output to tell the directions apart: the flanks carry `T - d`
//! in forward and `T + d` in backward motion, and the state is an elastic one that depends on nothing else. So one
//! torque sign is enough too: from a forward state under T the backward one follows by the compliance c of the output,
//! `e_backward(psi, T) = e_forward(psi, T) + 2 d c`. The drag is small (0.02 N.m; the second order is below 0.05″).

use std::ops::ControlFlow;

use flexspline::Direction;
use flexspline::make::Sample;

use rayon::prelude::*;

use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::motion::{Motion, settling_pitches};
use flexspline_mechanics::stepping::{Increment, Problem, SolveError, SolverSettings};

/// What to sample.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepPlan {
    /// Torque nodes, ascending, symmetric about zero, N m.
    pub torque_nodes_n_m: Vec<f32>,
    /// Temperature nodes, ascending, °C.
    pub temperature_nodes_c: Vec<f32>,
    /// Samples over one tooth pitch.
    pub positions: usize,
}

/// Share of the drag torque by which the nodes at either side of the jump lie away from it.
const JUMP_HALF_WIDTH: f64 = 0.05;

impl SweepPlan {
    /// The default: one pair of nodes at each end of the dead zone of the drag, from there nine steps to the rated
    /// torque of the generator; eight positions; the ends of the operating temperatures, between which wind-up is
    /// linear to 0.05″, because Young's modulus is.
    pub fn for_generator(drive: &Drive, kind: GeneratorKind) -> SweepPlan {
        let temperature = &drive.temperature;
        SweepPlan {
            torque_nodes_n_m: symmetric_nodes(drive.output.drag_torque_n_m, drive.rated_torque_n_m(kind), 9),
            temperature_nodes_c: [temperature.minimum_c, temperature.maximum_c].map(|t| t as f32).to_vec(),
            positions: 8,
        }
    }
}

/// Nodes symmetric about zero: a nearly coincident pair at ± the drag torque, where the loaded flank changes, and
/// `steps` further nodes on each side up to `largest_n_m`, dense where wind-up is steep: node k of n at `(k/n)^3.2` of
/// the way. (On nodes like these the cubic of the core leaves below 0.6″ of curves that rise by 870″ as a root or a
/// tanh does.)
pub fn symmetric_nodes(drag_n_m: f64, largest_n_m: f64, steps: usize) -> Vec<f32> {
    const CROWDING: f64 = 3.2;
    let half = JUMP_HALF_WIDTH * drag_n_m;
    let first = drag_n_m + half;
    // The interval next to the jump must dwarf it, or it is not known for a jump.
    let least = 40.0 * half;
    let mut positive = vec![drag_n_m - half, first];
    positive.extend(
        (1..=steps).map(|k| first + ((largest_n_m - first) * (k as f64 / steps as f64).powf(CROWDING)).max(least)),
    );
    positive.iter().rev().map(|t| -t).chain(positive.iter().copied()).map(|t| t as f32).collect()
}

/// Progress of a sweep.
#[derive(Debug, Clone, Copy)]
pub struct SweepProgress {
    /// Newton iterations of the last increment.
    pub iterations: usize,
    /// Torque of the last increment, N m.
    pub torque_n_m: f64,
    /// Temperature of the last increment, °C.
    pub temperature_c: f64,
}

/// Told of every increment, from any thread; may ask to stop.
pub(crate) type Observer<'a> = dyn Fn(SweepProgress) -> ControlFlow<()> + Sync + 'a;

/// What solving took.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Work {
    /// Increments solved by FEM.
    pub increments: usize,
    /// Newton iterations.
    pub iterations: usize,
    /// Largest residual, relative to the contact forces.
    pub worst_residual: f64,
    /// Largest pressure between flanks, MPa.
    pub peak_flank_pressure_mpa: f64,
}

impl Work {
    /// One more increment.
    pub(super) fn count(&mut self, increment: &Increment) {
        self.add(Work {
            increments: 1,
            iterations: increment.iterations,
            worst_residual: increment.residual,
            peak_flank_pressure_mpa: increment.peak_pressure_mpa[0],
        });
    }

    /// Other work beside this.
    pub(super) fn add(&mut self, other: Work) {
        self.increments += other.increments;
        self.iterations += other.iterations;
        self.worst_residual = self.worst_residual.max(other.worst_residual);
        self.peak_flank_pressure_mpa = self.peak_flank_pressure_mpa.max(other.peak_flank_pressure_mpa);
    }
}

/// Samples of a sweep and how they came about.
#[derive(Debug, Clone)]
pub(crate) struct Sweep {
    /// Which generator.
    pub kind: GeneratorKind,
    /// Forward samples, computed, then backward samples, mirrored.
    pub samples: Vec<Sample>,
    /// What it took.
    pub work: Work,
    /// Unknowns of the model.
    pub degrees_of_freedom: usize,
    /// Places over the turns of generator and output at which every torque of a sign was sampled; 0 for a drive that
    /// repeats from tooth to tooth.
    pub places: usize,
}

/// Why a sweep ended early.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// The FEM failed, or the drive did not settle.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// The samples make no trial table.
    #[error(transparent)]
    Table(#[from] super::project::TableError),
    /// One tooth pitch in one direction does not say all of the drive.
    #[error(
        "{field}: one tooth pitch in one direction does not say all of this drive; allowed: an ideal drive, uniform \
         wear (flexspline_wear_um, circular_spline_wear_um) and temperature differences (generator_warmer_k, \
         circular_spline_warmer_k); others are swept over whole turns (sweep_turns)"
    )]
    NotUniform {
        /// The field of the drive.
        field: &'static str,
    },
    /// The observer asked to stop.
    #[error("stopped")]
    Stopped,
}

/// Refuses a drive of which a sweep would see a part.
fn check_uniform(drive: &Drive) -> Result<(), SweepError> {
    drive.as_built.first_not_uniform().map_or(Ok(()), |field| Err(SweepError::NotUniform { field }))
}

/// Runs the sweep of one generator; torque of either sign is a chain of its own, from light to heavy. Nodes that are
/// `known` are not computed again.
pub(crate) fn sweep(
    drive: &Drive,
    kind: GeneratorKind,
    plan: &SweepPlan,
    known: &[KnownNode],
    settings: SolverSettings,
    observe: &Observer,
) -> Result<Sweep, SweepError> {
    check_uniform(drive)?;
    let half = Half::of(drive);
    // Temperatures are independent of one another; they are put together in their order.
    let parts = plan
        .temperature_nodes_c
        .par_iter()
        .map(|&temperature| {
            let problem = Problem::new(drive, kind, f64::from(temperature), settings)?;
            let mut motion = Motion::deformed(&problem, 0.0)?;
            let unloaded = motion.state().clone();
            let mut chain = SweepChain::new(plan, f64::from(temperature), observe);
            for torques in half.chains(plan, drive.output.drag_torque_n_m) {
                motion.go_back(unloaded.clone());
                for torque in torques {
                    let reused = known.iter().find(|k| k.torque == torque && k.temperature == temperature);
                    match reused {
                        Some(known) => chain.points.extend(known.points.iter().copied()),
                        None => chain.sample(&mut motion, torque)?,
                    }
                }
            }
            Ok(Sweep {
                kind,
                samples: half.complete(&chain.points, drive.output.drag_torque_n_m),
                work: chain.work,
                degrees_of_freedom: problem.degrees_of_freedom(),
                places: 0,
            })
        })
        .collect::<Result<Vec<Sweep>, SweepError>>()?;
    let joined = parts.into_iter().reduce(|mut all, part| {
        all.samples.extend(part.samples);
        all.work.add(part.work);
        all
    });
    Ok(joined.expect("a plan has temperatures"))
}

/// Increments that a sweep over so many torque nodes on each side of zero takes, about, where so many are known at one
/// temperature: at each of them the load comes on, the drive settles and is sampled.
pub(super) fn planned_increments(drive: &Drive, plan: &SweepPlan, nodes: usize, known: usize) -> usize {
    let sides = match Half::of(drive) {
        Half::Forward => 2,
        Half::ForwardLoaded => 1,
    };
    let settling =
        (settling_pitches(drive.flanks.friction_coefficient) * plan.positions as f64).ceil().max(1.0) as usize;
    let at_a_node = 1 + settling + plan.positions;
    (sides * nodes * plan.temperature_nodes_c.len()).saturating_sub(known) * at_a_node
}

/// Which part of the plane of torque and direction is computed; the rest follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Half {
    /// Forward motion at every torque.
    Forward,
    /// Forward motion at torques above the drag: all that frictionless flanks need.
    ForwardLoaded,
}

impl Half {
    fn of(drive: &Drive) -> Half {
        if drive.flanks.friction_coefficient > 0.0 { Half::Forward } else { Half::ForwardLoaded }
    }

    /// Torques to compute, each sign from light to heavy.
    fn chains(self, plan: &SweepPlan, drag_n_m: f64) -> Vec<Vec<f32>> {
        let nodes = &plan.torque_nodes_n_m;
        let positive = nodes.iter().copied().filter(|t| f64::from(*t) > drag_n_m).collect();
        match self {
            Half::ForwardLoaded => vec![positive],
            Half::Forward => {
                let below = nodes.iter().rev().copied().filter(|t| f64::from(*t) < 0.0).collect();
                vec![below, nodes.iter().copied().filter(|t| *t > 0.0).collect()]
            }
        }
    }

    /// All samples: those computed and those that follow.
    fn complete(self, points: &[Computed], drag_n_m: f64) -> Vec<Sample> {
        let mut samples: Vec<Sample> = points.iter().map(|point| point.sample).collect();
        if self == Half::ForwardLoaded {
            for point in points {
                let sample = point.sample;
                samples.push(point.carried(Direction::Backward, sample.torque_n_m, 2.0 * drag_n_m));
            }
            // The node below the jump: light lag under forward motion, the mirror image of the light lead above it.
            if let Some(first) = points.iter().map(|point| point.sample.torque_n_m).reduce(f64::min) {
                let below = f64::from((2.0 * drag_n_m - first) as f32);
                for point in points.iter().filter(|point| point.sample.torque_n_m == first) {
                    let lead = first - drag_n_m;
                    samples.push(Sample { torque_n_m: below, direction: Direction::Forward, ..mirror(&point.sample) });
                    samples.push(point.carried(Direction::Backward, below, below + drag_n_m - lead));
                }
            }
        }
        let mirrored: Vec<Sample> = samples.iter().map(mirror).collect();
        samples.extend(mirrored);
        samples
    }
}

/// A point of steady motion as the FEM gave it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Computed {
    /// The sample.
    pub sample: Sample,
    /// Compliance of the output there, rad/(N m).
    compliance: f64,
}

impl Computed {
    /// The elastic state under `more` load on the flanks.
    fn carried(&self, direction: Direction, torque_n_m: f64, more_n_m: f64) -> Sample {
        let output_rad = self.sample.output_rad + more_n_m * self.compliance;
        Sample { direction, torque_n_m, output_rad, ..self.sample }
    }
}

/// Points of one node that are there already.
#[derive(Debug, Clone)]
pub(crate) struct KnownNode {
    pub(crate) torque: f32,
    pub(crate) temperature: f32,
    pub(crate) points: Vec<Computed>,
}

/// Samples at one torque after the other, the drive moving on forward.
pub(crate) struct SweepChain<'a> {
    plan: &'a SweepPlan,
    temperature_c: f64,
    observe: &'a Observer<'a>,
    points: Vec<Computed>,
    pub(super) work: Work,
}

impl<'a> SweepChain<'a> {
    /// A chain at one temperature.
    pub fn new(plan: &'a SweepPlan, temperature_c: f64, observe: &'a Observer<'a>) -> Self {
        SweepChain { plan, temperature_c, observe, points: Vec::new(), work: Work::default() }
    }

    /// The points so far, which are then forgotten.
    pub(crate) fn take_points(&mut self) -> Vec<Computed> {
        std::mem::take(&mut self.points)
    }

    fn told(&mut self, motion: &Motion<'_>) -> Result<(), SweepError> {
        let (iterations, torque_n_m) = (motion.last().iterations, motion.state().torque_n_m);
        self.work.count(motion.last());
        match (self.observe)(SweepProgress { iterations, torque_n_m, temperature_c: self.temperature_c }) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(SweepError::Stopped),
        }
    }

    /// Brings the load on, settles, and samples one pitch.
    pub fn sample(&mut self, motion: &mut Motion<'_>, torque: f32) -> Result<(), SweepError> {
        let torque_n_m = f64::from(torque);
        let step = motion.pitch() / self.plan.positions as f64;
        motion.load(torque_n_m)?;
        self.told(motion)?;
        while motion.settle_on(step)? {
            self.told(motion)?;
        }
        for _ in 0..self.plan.positions {
            motion.turn(step)?;
            self.told(motion)?;
            let sample = Sample {
                generator_rad: motion.state().generator_rad,
                torque_n_m,
                temperature_c: self.temperature_c,
                direction: Direction::Forward,
                output_rad: motion.state().output_rad,
            };
            self.points.push(Computed { sample, compliance: motion.last().compliance_rad_per_n_m });
        }
        Ok(())
    }
}

/// The mirror image of a sample of a mirror-symmetric drive.
pub(crate) fn mirror(sample: &Sample) -> Sample {
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
    fn a_drive_that_does_not_repeat_is_not_swept() {
        let mut drive = Drive::hhd_95();
        drive.as_built.circular_spline_eccentricity_um = 1.0;
        let kind = GeneratorKind::Cam;
        let plan = SweepPlan::for_generator(&drive, kind);
        let swept = sweep(&drive, kind, &plan, &[], SolverSettings::default(), &|_| ControlFlow::Continue(()));
        let message = swept.unwrap_err().to_string();
        assert!(message.starts_with("as_built.circular_spline_eccentricity_um: "), "{message}");
    }

    #[test]
    fn torque_nodes_are_symmetric_and_rise_to_the_largest() {
        let nodes = symmetric_nodes(0.02, 50.0, 9);
        assert_eq!(nodes.len(), 22);
        assert!(nodes.windows(2).all(|w| w[0] < w[1]));
        assert!(nodes.iter().zip(nodes.iter().rev()).all(|(a, b)| *a == -*b));
        assert_eq!(nodes[21], 50.0);
        // The pairs at the drag torque stand out: their neighbours are at least eight times as wide.
        let width = |k: usize| nodes[k + 1] - nodes[k];
        assert!((f64::from(nodes[11]) - 0.019).abs() < 1e-6 && (f64::from(nodes[12]) - 0.021).abs() < 1e-6);
        assert!(width(10) > 8.0 * width(11) && width(12) > 8.0 * width(11));
    }
}
