//! FEM sweeps of a drive that does not repeat from tooth to tooth: every imperfection of [`crate::drive::AsBuilt`] but uniform
//! wear and temperature.
//!
//! What such a drive does beyond the same drive without them depends on where generator and output stand in their turns. It is
//! geometry: friction has little part in it, and without friction contact converges several times faster. So two sweeps are put
//! together:
//!
//! * the drive without the imperfections, over one tooth pitch at every node, as [`crate::sweep`] does it;
//! * the *deviation*, the output with the imperfections less the output without, both frictionless, at a few loads of either
//!   sign, from many places. At each place the drive is deformed and then goes from load to load, at a few tooth
//!   phases. The places cover the turn of the generator and the turn of the output as evenly as so few points can (the additive
//!   recurrence of the plastic number), so that harmonics of ψ, δ and ψ − δ do not pass for one another.
//!
//! The samples are those of the first sweep, each at every place whose tooth phase is its own, with the deviation there added
//! (between loads linear in the root of the load).
//!
//! The table has one curve for each of the angles, the same at every load. What of the deviation changes with the load (an
//! eccentricity is felt less where more teeth share it), or depends on two angles at once, stays as a difference that the table
//! states; what the putting together misses is seen by `validate`.

use std::collections::HashMap;
use std::f64::consts::TAU;
use std::ops::ControlFlow;

use flexspline::Direction;
use flexspline::precompute::Sample;
use rayon::prelude::*;

use crate::drive::{Drive, GeneratorKind};
use crate::stepping::{Problem, Solver, SolverSettings, State};
use crate::sweep::{KnownNode, Observer, Sweep, SweepError, SweepPlan, SweepProgress, sweep};

/// Places of generator and output for each sign of the load.
const PLACES: usize = 24;
/// Samples of a load at a place.
const SAMPLES: usize = 3;
/// Loads of each sign.
const LEVELS: usize = 4;
/// Drag under which the deviation is looked at, N m: that of the ideal drive.
const SMOOTH_DRAG_N_M: f64 = 0.02;
/// The plastic number: `p³ = p + 1`.
const PLASTIC: f64 = 1.324_717_957_244_746;

/// Increments that the deviation takes, about.
pub fn deviation_increments() -> usize {
    2 * PLACES * LEVELS * SAMPLES
}

/// Output with imperfections less output without.
#[derive(Debug, Clone, Copy)]
struct Deviation {
    generator_rad: f64,
    /// Tooth phase, in positions of a pitch.
    phase: usize,
    /// One for each load, light to heavy, rad.
    rad: [f64; LEVELS],
}

/// Runs the sweep of one generator at the torque and temperature nodes of the plan. Nodes that are `known` (of the drive without
/// the imperfections) are not computed again.
pub fn sweep_turns(
    drive: &Drive,
    kind: GeneratorKind,
    plan: &SweepPlan,
    known: &[KnownNode],
    settings: SolverSettings,
    observe: &Observer,
) -> Result<Sweep, SweepError> {
    let repeating = Drive { as_built: drive.as_built.uniform_part(), ..drive.clone() };
    let mut whole = sweep(&repeating, kind, plan, known, settings, observe)?;

    let levels = levels(plan, drive.output.drag_torque_n_m);
    let temperature_c = drive.temperature.reference_c;
    let smooth = |drive: &Drive| {
        let mut smooth = drive.clone();
        smooth.flanks.friction_coefficient = 0.0;
        smooth.output.drag_torque_n_m = SMOOTH_DRAG_N_M;
        smooth
    };
    let without = {
        let nodes = levels.iter().rev().map(|t| -t).chain(levels).collect();
        let plan = SweepPlan {
            torque_nodes_n_m: nodes,
            temperature_nodes_c: vec![temperature_c as f32],
            settling_pitches: 0.0,
            ..plan.clone()
        };
        sweep(&smooth(&repeating), kind, &plan, &[], settings, observe)?
    };
    let lattice = Lattice::new(drive, plan.positions);
    let reference: HashMap<(u64, usize), f64> = without
        .samples
        .iter()
        .filter(|s| s.direction == Direction::Forward)
        .map(|s| {
            ((s.torque_n_m.to_bits(), lattice.phase(s.generator_rad)), s.output_rad - s.generator_rad / drive.ratio())
        })
        .collect();

    let problem = Problem::new(&smooth(drive), kind, temperature_c, settings)?;
    let runs: Vec<(usize, f64)> = (0..PLACES).flat_map(|place| [(place, 1.0), (place, -1.0)]).collect();
    let done = runs
        .par_iter()
        .map(|&(place, sign)| {
            let mut run =
                Run { drive, lattice, temperature_c, observe, increments: 0, iterations: 0, worst_residual: 0.0 };
            let start = lattice.place(drive, 2 * place + usize::from(sign < 0.0));
            let found = run.deviations(&problem, start, levels.map(|t| sign * f64::from(t)), &reference)?;
            Ok((sign, found, run.increments, run.iterations, run.worst_residual))
        })
        .collect::<Result<Vec<_>, SweepError>>()?;

    let (mut pushed, mut pulled) = (Vec::new(), Vec::new());
    whole.increments += without.increments;
    whole.iterations += without.iterations;
    for (sign, mut found, increments, iterations, worst_residual) in done {
        if sign > 0.0 { &mut pushed } else { &mut pulled }.append(&mut found);
        whole.increments += increments;
        whole.iterations += iterations;
        whole.worst_residual = whole.worst_residual.max(worst_residual);
    }
    for (n, l) in [("+", &pushed), ("-", &pulled)] { for d in l.iter() { eprintln!("DEV {n} {} {} {:?}", d.generator_rad, d.phase, d.rad.map(|r| r*206265.0)); } }
    whole.samples = put_together(drive, &whole.samples, &levels, lattice, [&pushed, &pulled]);
    Ok(whole)
}

/// Loads at which the deviation is looked at, light to heavy, evenly in their roots: torque nodes above the drag.
fn levels(plan: &SweepPlan, drag_n_m: f64) -> [f32; LEVELS] {
    let nodes: Vec<f32> = plan.torque_nodes_n_m.iter().copied().filter(|t| f64::from(*t) > drag_n_m).collect();
    let (first, last) = (nodes[0].sqrt(), nodes[nodes.len() - 1].sqrt());
    let mut levels = [0.0; LEVELS];
    for (k, level) in levels.iter_mut().enumerate() {
        *level = (first + (last - first) * k as f32 / (LEVELS - 1) as f32).powi(2);
    }
    levels
}

/// The generator angles of a sweep: whole parts of a tooth pitch.
#[derive(Debug, Clone, Copy)]
struct Lattice {
    positions: usize,
    /// Parts in a step: three, or the next that comes by every part in turn.
    stride: usize,
    part_rad: f64,
}

impl Lattice {
    fn new(drive: &Drive, positions: usize) -> Lattice {
        let common = |mut a: usize, mut b: usize| {
            while b > 0 {
                (a, b) = (b, a % b);
            }
            a
        };
        let stride = [3, 5, 7].into_iter().find(|n| common(*n, positions) == 1).unwrap_or(1);
        Lattice { positions, stride, part_rad: TAU / f64::from(drive.flexspline.teeth) / positions as f64 }
    }

    fn phase(self, generator_rad: f64) -> usize {
        (generator_rad / self.part_rad).round().rem_euclid(self.positions as f64) as usize
    }

    /// Generator angle of place `k`: evenly spread over one turn of the output and one turn of the generator.
    fn place(self, drive: &Drive, k: usize) -> f64 {
        let number = (k + 1) as f64;
        let (output, generator) = ((number / PLASTIC).fract(), (number / (PLASTIC * PLASTIC)).fract());
        let turns = (output * drive.ratio().abs()).floor();
        ((turns + generator) * TAU / self.part_rad).round() * self.part_rad
    }
}

/// One place, from load to load.
struct Run<'a> {
    drive: &'a Drive,
    lattice: Lattice,
    temperature_c: f64,
    observe: &'a Observer<'a>,
    increments: usize,
    iterations: usize,
    worst_residual: f64,
}

impl Run<'_> {
    fn advance(
        &mut self,
        solver: &mut Solver<'_>,
        state: &State,
        turn: f64,
        torque_n_m: f64,
    ) -> Result<State, SweepError> {
        let (next, increment) = solver.increment(state, state.generator_rad + turn, torque_n_m)?;
        self.increments += 1;
        self.iterations += increment.iterations;
        self.worst_residual = self.worst_residual.max(increment.residual);
        let progress =
            SweepProgress { iterations: increment.iterations, torque_n_m, temperature_c: self.temperature_c };
        match (self.observe)(progress) {
            ControlFlow::Continue(()) => Ok(next),
            ControlFlow::Break(()) => Err(SweepError::Stopped),
        }
    }

    /// The deviation at a few tooth phases from `start` on, under one load after the other. Every second load is gone through
    /// backward: without friction the state is an elastic one that does not know where it came from.
    fn deviations(
        &mut self,
        problem: &Problem,
        start: f64,
        torques: [f64; LEVELS],
        reference: &HashMap<(u64, usize), f64>,
    ) -> Result<Vec<Deviation>, SweepError> {
        let mut solver = Solver::new(problem);
        let step = self.lattice.stride as f64 * self.lattice.part_rad;
        let mut found: Vec<Deviation> = (0..SAMPLES)
            .map(|k| start + k as f64 * step)
            .map(|psi| Deviation { generator_rad: psi, phase: self.lattice.phase(psi), rad: [0.0; LEVELS] })
            .collect();
        let mut state = solver.deform(start)?.0;
        for (level, &torque_n_m) in torques.iter().enumerate() {
            state = self.advance(&mut solver, &state, 0.0, torque_n_m)?;
            for deviation in &mut found {
                let turn = deviation.generator_rad - state.generator_rad;
                if turn != 0.0 {
                    state = self.advance(&mut solver, &state, turn, torque_n_m)?;
                }
                let error = state.output_rad - state.generator_rad / self.drive.ratio();
                let key = (torque_n_m.to_bits(), deviation.phase);
                deviation.rad[level] = error - reference.get(&key).expect("the sweep without has every phase");
            }
            found.reverse();
        }
        Ok(found)
    }
}

/// Samples of the drive without imperfections, each at the places of its tooth phase, with the deviation there.
fn put_together(
    drive: &Drive,
    samples: &[Sample],
    levels: &[f32; LEVELS],
    lattice: Lattice,
    deviations: [&[Deviation]; 2],
) -> Vec<Sample> {
    let drag_n_m = drive.output.drag_torque_n_m;
    let mut all = Vec::new();
    for sample in samples {
        let flank_n_m = sample.torque_n_m - f64::from(sample.direction.sign()) * drag_n_m;
        let there = deviations[usize::from(flank_n_m < 0.0)];
        let error = sample.output_rad - sample.generator_rad / drive.ratio();
        for place in there.iter().filter(|place| place.phase == lattice.phase(sample.generator_rad)) {
            let generator_rad = place.generator_rad;
            let output_rad = generator_rad / drive.ratio() + error + between(levels, &place.rad, flank_n_m.abs());
            all.push(Sample { generator_rad, output_rad, ..*sample });
        }
    }
    all
}

/// Value at a load, linear in its root; beyond the levels that of the nearest.
fn between(levels: &[f32; LEVELS], values: &[f64; LEVELS], load_n_m: f64) -> f64 {
    let [first, .., last] = levels.map(|t| f64::from(t).sqrt());
    let along = ((load_n_m.sqrt() - first) / (last - first)).clamp(0.0, 1.0) * (LEVELS - 1) as f64;
    let below = (along as usize).min(LEVELS - 2);
    values[below] + (along - below as f64) * (values[below + 1] - values[below])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_tell_the_three_angles_apart() {
        let drive = Drive::hhd_95();
        let lattice = Lattice::new(&drive, 8);
        let places: Vec<f64> = (0..2 * PLACES).map(|k| lattice.place(&drive, k)).collect();
        assert!(places.iter().all(|p| (0.0..=TAU * 95.0).contains(p)));
        // Orders of ψ, ψ − δ and δ up to those of a table are nearly orthogonal over the places of either sign.
        let orders = |psi: f64| {
            let delta = psi / 95.0;
            let generator = (1..=4).map(move |n| f64::from(n) * psi);
            let material = (1..=4).map(move |n| f64::from(n) * (psi - delta));
            generator.chain(material).chain((1..=2).map(move |n| f64::from(n) * delta)).collect::<Vec<f64>>()
        };
        for of_sign in [0, 1] {
            for (a, b) in (0..10).flat_map(|a| (0..a).map(move |b| (a, b))) {
                let mean = |sign: f64| {
                    let phases = places.iter().skip(of_sign).step_by(2).map(|p| orders(*p)[a] + sign * orders(*p)[b]);
                    let (c, s) = phases.fold((0.0, 0.0), |(c, s), phase| (c + phase.cos(), s + phase.sin()));
                    f64::hypot(c, s) / PLACES as f64
                };
                assert!(mean(1.0) < 0.4 && mean(-1.0) < 0.4, "orders {a}, {b}: {} {}", mean(1.0), mean(-1.0));
            }
        }
    }

    #[test]
    fn steps_come_by_every_phase() {
        for positions in 4..=32 {
            let lattice = Lattice::new(&Drive::hhd_95(), positions);
            let step = lattice.stride as f64 * lattice.part_rad;
            let mut phases: Vec<usize> = (0..positions).map(|k| lattice.phase(k as f64 * step - 7.0 * step)).collect();
            phases.sort_unstable();
            assert_eq!(phases, (0..positions).collect::<Vec<usize>>());
        }
    }

    #[test]
    fn between_loads_the_deviation_goes_with_the_root() {
        let (levels, values) = ([1.0, 4.0, 9.0, 16.0], [10.0, 20.0, 0.0, 4.0]);
        for (load, expected) in [(0.1, 10.0), (1.0, 10.0), (2.25, 15.0), (6.25, 10.0), (16.0, 4.0), (50.0, 4.0)] {
            assert!((between(&levels, &values, load) - expected).abs() < 1e-12, "{load}");
        }
    }
}
