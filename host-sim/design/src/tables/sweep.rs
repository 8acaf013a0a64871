//! FEM sweeps that sample what a table holds: steady motion over one tooth pitch at every torque and temperature node.
//!
//! An ideal drive repeats every flexspline pitch (`2 pi / z_f` of generator angle), so one pitch says all. It is also
//! its own mirror image: backward motion under a torque T is the reflection of forward motion under −T, so only forward
//! motion is computed, and `e_backward(-psi, -T) = -e_forward(psi, T)` gives the other direction.
//!
//! Frictionless flanks leave nothing but the drag of the output to distinguish the directions: the flanks carry `T - d`
//! in forward and `T + d` in backward motion, and the state is an elastic one that depends on nothing else. So one
//! torque sign is enough too: from a forward state under T the backward one follows by the compliance c of the output,
//! `e_backward(psi, T) = e_forward(psi, T) + 2 d c`. The drag is small (0.02 N·m; the second order is below 0.05″).

use std::ops::ControlFlow;

use flexspline::Direction;
use flexspline_make::Sample;

use rayon::prelude::*;

use super::make::TableSettings;
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::motion::{Motion, settling_pitches};
use flexspline_mechanics::stepping::{Increment, Problem, SolveError, SolverSettings, State};

/// Samples to compute.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SweepPlan {
    /// Torque nodes, ascending, symmetric about zero, N m.
    pub torque_nodes_n_m: Vec<f32>,
    /// Temperature nodes, ascending, °C.
    pub temperature_nodes_c: Vec<f32>,
    /// Samples over one tooth pitch.
    pub positions: usize,
}

/// Share of the drag torque by which the nodes at either side of the jump lie away from it.
const JUMP_HALF_WIDTH: f64 = 0.05;

/// Share of the drag from which on it is at its limit: what is left is rounding.
const AT_ITS_LIMIT: f64 = 1.0 - 1e-6;

/// Nodes symmetric about zero: a nearly coincident pair at ± the drag torque, where the loaded flank changes, and
/// `steps` further nodes on each side up to `largest_n_m`, dense where wind-up is steep: node k of n at `(k/n)^3.2` of
/// the way. (On nodes like these the cubic of the core leaves below 0.6″ of curves that rise by 870″ as a root or a
/// tanh does.)
pub(super) fn symmetric_nodes(drag_n_m: f64, largest_n_m: f64, steps: usize) -> Vec<f32> {
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

/// Called after every increment, from any thread; may ask to stop.
pub(crate) type Observer<'a> = dyn Fn(SweepProgress) -> ControlFlow<()> + Sync + 'a;

/// Work of the solver.
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
pub(crate) struct TorqueSweep {
    /// Which generator.
    pub kind: GeneratorKind,
    /// Forward samples, computed, then backward samples, mirrored.
    pub samples: Vec<Sample>,
    /// Work spent.
    pub work: Work,
    /// Unknowns of the model.
    pub degrees_of_freedom: usize,
    /// Places over the turns of generator and output at which every torque of a sign was sampled; 0 for a drive that
    /// repeats from tooth to tooth.
    pub places: usize,
}

/// Why a sweep ended early.
#[derive(Debug, thiserror::Error)]
pub enum TorqueSweepError {
    /// The FEM failed, or the drive did not settle.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// The samples make no trial table.
    #[error(transparent)]
    Table(#[from] super::project::TableError),
    /// The observer asked to stop.
    #[error("stopped")]
    Stopped,
}

/// Samples torque nodes of a drive that repeats from tooth to tooth, at one temperature. Each node goes its way alone,
/// from a state under its load, so that they are computed side by side, and come out the same however many at once.
pub(crate) struct Sampler<'a> {
    positions: usize,
    temperature_c: f64,
    problem: Problem,
    /// The drive without load.
    pub unloaded: Loaded,
    observe: &'a Observer<'a>,
}

/// The drive under a load, before it settles.
#[derive(Debug, Clone)]
pub(crate) struct Loaded {
    pub torque: f32,
    state: State,
    last: Increment,
}

impl Loaded {
    fn of(motion: &Motion<'_>, torque: f32) -> Loaded {
        Loaded { torque, state: motion.state().clone(), last: motion.last().clone() }
    }
}

/// A torque node at one temperature.
#[derive(Debug, Clone)]
pub(crate) struct KnownNode {
    pub torque: f32,
    pub points: Vec<Computed>,
}

/// Counts the increment that a motion ends with, and reports it.
pub(super) fn report(
    observe: &Observer<'_>,
    motion: &Motion<'_>,
    temperature_c: f64,
    work: &mut Work,
) -> Result<(), TorqueSweepError> {
    let (iterations, torque_n_m) = (motion.last().iterations, motion.state().torque_n_m);
    work.count(motion.last());
    match observe(SweepProgress { iterations, torque_n_m, temperature_c }) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(TorqueSweepError::Stopped),
    }
}

impl<'a> Sampler<'a> {
    /// A sampler at a temperature.
    pub fn new(
        drive: &Drive,
        kind: GeneratorKind,
        positions: usize,
        temperature: f32,
        settings: SolverSettings,
        observe: &'a Observer<'a>,
    ) -> Result<Sampler<'a>, TorqueSweepError> {
        let temperature_c = f64::from(temperature);
        let problem = Problem::new(drive, kind, temperature_c, settings)?;
        let unloaded = Loaded::of(&Motion::deformed(&problem, 0.0)?, 0.0);
        Ok(Sampler { positions, temperature_c, problem, unloaded, observe })
    }

    fn report(&self, motion: &Motion<'_>, work: &mut Work) -> Result<(), TorqueSweepError> {
        report(self.observe, motion, self.temperature_c, work)
    }

    fn goes_on(&self, from: &Loaded) -> Motion<'_> {
        Motion::taken_over(&self.problem, from.state.clone(), from.last.clone())
    }

    /// Brings the load to a torque, from another.
    pub fn load(&self, from: &Loaded, torque: f32, work: &mut Work) -> Result<Loaded, TorqueSweepError> {
        let mut motion = self.goes_on(from);
        motion.load(f64::from(torque))?;
        self.report(&motion, work)?;
        Ok(Loaded::of(&motion, torque))
    }

    /// Samples every other position of a pitch in steady motion; then, if what these say asks for it, those between, a
    /// pitch further. Whether it did.
    pub fn sample(
        &self,
        loaded: &Loaded,
        asks: impl FnOnce(&[Computed]) -> bool,
        work: &mut Work,
    ) -> Result<(KnownNode, bool), TorqueSweepError> {
        let mut motion = self.goes_on(loaded);
        let step = motion.pitch() / self.positions as f64;
        while !self.in_motion(motion.last()) && motion.settle_on(step)? {
            self.report(&motion, work)?;
        }
        let others = self.positions.div_ceil(2);
        let mut points = vec![self.computed(&motion)];
        let mut asks = Some(asks);
        for k in 1..self.positions {
            if k == others && !asks.take().is_none_or(|asks| asks(&points)) {
                return Ok((KnownNode { torque: loaded.torque, points }, false));
            }
            let steps = if k == others && self.positions.is_multiple_of(2) { 3.0 } else { 2.0 };
            motion.turn(steps * step)?;
            self.report(&motion, work)?;
            points.push(self.computed(&motion));
        }
        Ok((KnownNode { torque: loaded.torque, points }, true))
    }

    /// Whether a load that came on has already left the drive as forward motion under it does: without friction only
    /// the drag of the output remembers the way, and a load that turns the output forward leaves it at its limit.
    fn in_motion(&self, last: &Increment) -> bool {
        let drive = &self.problem.drive;
        drive.flanks.friction_coefficient == 0.0 && last.drag_torque_n_m <= -AT_ITS_LIMIT * drive.output.drag_torque_n_m
    }

    fn computed(&self, motion: &Motion<'_>) -> Computed {
        let State { generator_rad, torque_n_m, .. } = *motion.state();
        let output_rad = self.problem.output_rad(motion.state());
        let (temperature_c, direction) = (self.temperature_c, Direction::Forward);
        let sample = Sample { generator_rad, torque_n_m, temperature_c, direction, output_rad };
        Computed { sample, compliance: motion.last().compliance_rad_per_n_m }
    }

    /// The drive under these loads, which are brought on one after the other.
    pub fn loaded(&self, torques: &[f32], work: &mut Work) -> Result<Vec<Loaded>, TorqueSweepError> {
        let mut from = self.unloaded.clone();
        let on = |torque: &f32| {
            from = self.load(&from, *torque, work)?;
            Ok(from.clone())
        };
        torques.iter().map(on).collect()
    }

    /// The nodes of these loads.
    pub fn nodes(&self, loaded: &[Loaded], work: &mut Work) -> Result<Vec<KnownNode>, TorqueSweepError> {
        let sampled = |loaded: &Loaded| {
            let mut work = Work::default();
            let (node, _) = self.sample(loaded, |_| true, &mut work)?;
            Ok((node, work))
        };
        let done = loaded.par_iter().with_max_len(1).map(sampled).collect::<Result<Vec<_>, TorqueSweepError>>()?;
        done.iter().for_each(|(_, more)| work.add(*more));
        Ok(done.into_iter().map(|(node, _)| node).collect())
    }
}

/// Runs the sweep of one generator. Torque of either sign comes on from light to heavy. Nodes that are `known` at the
/// first temperature, that of the `sampler`, are not computed again.
pub(crate) fn sweep(
    drive: &Drive,
    kind: GeneratorKind,
    plan: &SweepPlan,
    known: &[KnownNode],
    sampler: &Sampler<'_>,
    settings: SolverSettings,
) -> Result<TorqueSweep, TorqueSweepError> {
    let half = Half::of(drive);
    let drag_n_m = drive.output.drag_torque_n_m;
    let at = |sampler: &Sampler<'_>, known: &[KnownNode]| {
        let (mut nodes, mut work) = (known.to_vec(), Work::default());
        for mut torques in half.chains(plan, drag_n_m) {
            torques.retain(|torque| known.iter().all(|node| node.torque != *torque));
            let loaded = sampler.loaded(&torques, &mut work)?;
            nodes.extend(sampler.nodes(&loaded, &mut work)?);
        }
        nodes.sort_by(|a, b| a.torque.total_cmp(&b.torque));
        let points: Vec<Computed> = nodes.into_iter().flat_map(|node| node.points).collect();
        Ok((half.complete(&points, &sampler.problem.drive), work))
    };
    // Temperatures are independent of one another; they are put together in their order.
    let of_temperature = |(k, temperature): (usize, &f32)| match k {
        0 => at(sampler, known),
        _ => at(&Sampler::new(drive, kind, plan.positions, *temperature, settings, sampler.observe)?, &[]),
    };
    let parts = plan.temperature_nodes_c.par_iter().enumerate().map(of_temperature);
    let parts = parts.collect::<Result<Vec<_>, TorqueSweepError>>()?;
    let mut work = Work::default();
    parts.iter().for_each(|(_, more)| work.add(*more));
    let degrees_of_freedom = sampler.problem.degrees_of_freedom();
    let samples = parts.into_iter().flat_map(|(samples, _)| samples).collect();
    Ok(TorqueSweep { kind, samples, work, degrees_of_freedom, places: 0 })
}

/// Increments, about, that a sweep over N torque nodes on each side of zero takes, where so much is known at one
/// temperature: at each of them the load comes on, the drive settles and is sampled.
pub(super) fn planned_increments(drive: &Drive, settings: &TableSettings, nodes: usize, known: usize) -> usize {
    let sides = match Half::of(drive) {
        Half::Forward => 2,
        Half::ForwardLoaded => 1,
    };
    let settling = settling_pitches(drive.flanks.friction_coefficient) * settings.positions as f64;
    // The first position is where the drive has settled.
    let at_a_node = settling.ceil() as usize + settings.positions;
    (sides * nodes * settings.temperature_nodes_c.len()).saturating_sub(known) * at_a_node
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
    fn complete(self, points: &[Computed], drive: &Drive) -> Vec<Sample> {
        let drag_n_m = drive.output.drag_torque_n_m;
        let beside_fem = |torque_n_m: f64| drive.contact_wind_up_rad(torque_n_m);
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
                    let mut lags = Sample { torque_n_m: below, direction: Direction::Forward, ..mirror(&point.sample) };
                    lags.output_rad += beside_fem(first) + beside_fem(below);
                    let mut leads = point.carried(Direction::Backward, below, below + drag_n_m - lead);
                    leads.output_rad += beside_fem(below) - beside_fem(first);
                    samples.extend([lags, leads]);
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
    use flexspline_mechanics::mesh::MeshLevel;

    fn coarse(drive: &Drive, kind: GeneratorKind, positions: usize) -> Sampler<'static> {
        let settings = SolverSettings::fast(MeshLevel::Coarse);
        Sampler::new(drive, kind, positions, 20.0, settings, &|_| ControlFlow::Continue(())).unwrap()
    }

    /// Where a load has come on a frictionless drive stands as it does whenever it passes there; one with friction does
    /// not, and settles first.
    #[test]
    fn a_load_that_came_on_leaves_a_frictionless_drive_in_motion() {
        for kind in [GeneratorKind::Cam, GeneratorKind::TwoRoller] {
            let sampler = coarse(&Drive::hhd_95(), kind, 4);
            let loaded = sampler.load(&sampler.unloaded, 5.0, &mut Work::default()).unwrap();
            assert!(sampler.in_motion(&loaded.last));
            let mut motion = sampler.goes_on(&loaded);
            let at_once = motion.error_arcsec();
            motion.turn_in(motion.pitch(), 4).unwrap();
            let a_pitch_on = motion.error_arcsec();
            println!("{kind}: {at_once:.5} and {a_pitch_on:.5}");
            assert!((at_once - a_pitch_on).abs() < 1e-3, "{at_once} and {a_pitch_on}");
        }
        let mut rough = Drive::hhd_95();
        rough.flanks.friction_coefficient = 0.08;
        let sampler = coarse(&rough, GeneratorKind::Cam, 4);
        assert!(!sampler.in_motion(&sampler.load(&sampler.unloaded, 5.0, &mut Work::default()).unwrap().last));
    }

    /// The empirical wind-up is added to every sample by its own load, mirrored and carried ones too.
    #[test]
    fn samples_have_the_empirical_wind_up_of_their_load() {
        let plain = Drive::hhd_95();
        let winds_up = plain.with_set("output.contact_compliance=5.8").unwrap();
        let samples = |drive: &Drive| {
            let sampler = coarse(drive, GeneratorKind::Cam, 4);
            let loaded = sampler.loaded(&[0.021, 20.0], &mut Work::default()).unwrap();
            let nodes = sampler.nodes(&loaded, &mut Work::default()).unwrap();
            let points: Vec<Computed> = nodes.into_iter().flat_map(|node| node.points).collect();
            Half::of(drive).complete(&points, &sampler.problem.drive)
        };
        let (without, with) = (samples(&plain), samples(&winds_up));
        assert!(without.len() == 48 && with.len() == 48, "{}", with.len());
        for (a, b) in without.iter().zip(&with) {
            assert_eq!((a.torque_n_m, a.direction), (b.torque_n_m, b.direction));
            let (found, due) = (b.output_rad - a.output_rad, winds_up.contact_wind_up_rad(a.torque_n_m));
            assert!(due != 0.0 && (found - due).abs() < 1e-3 * due.abs(), "{a:?}: {found} and {due}");
        }
    }

    /// All phases of a pitch are sampled, once each, whether their number is even or odd; half of them if no more are
    /// asked for.
    #[test]
    fn every_phase_is_sampled_once() {
        for positions in [4, 5] {
            let sampler = coarse(&Drive::hhd_95(), GeneratorKind::Cam, positions);
            let loaded = sampler.load(&sampler.unloaded, 20.0, &mut Work::default()).unwrap();
            let step = sampler.goes_on(&loaded).pitch() / positions as f64;
            let phase = |point: &Computed| (point.sample.generator_rad / step).round() as usize % positions;
            let (node, whole) = sampler.sample(&loaded, |_| true, &mut Work::default()).unwrap();
            let mut phases: Vec<usize> = node.points.iter().map(phase).collect();
            phases.sort_unstable();
            assert!(whole && phases == (0..positions).collect::<Vec<_>>(), "{phases:?}");
            let (node, whole) = sampler.sample(&loaded, |_| false, &mut Work::default()).unwrap();
            let phases: Vec<usize> = node.points.iter().map(phase).collect();
            assert!(!whole && phases == (0..positions).step_by(2).collect::<Vec<_>>(), "{phases:?}");
        }
    }

    #[test]
    fn nodes_are_the_same_however_many_are_computed_at_once() {
        let sampler = coarse(&Drive::hhd_95(), GeneratorKind::Cam, 4);
        let loaded = sampler.loaded(&[1.0, 20.0, 50.0], &mut Work::default()).unwrap();
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let nodes = pool.install(|| sampler.nodes(&loaded, &mut Work::default())).unwrap();
            nodes.into_iter().flat_map(|node| node.points).map(|point| point.sample.output_rad).collect::<Vec<f64>>()
        };
        assert_eq!(with(1), with(3));
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
