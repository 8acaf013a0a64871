//! The fitted model as a table: sampled in steady motion where the table has its nodes.

use std::f64::consts::TAU;

use flexspline::{Direction, Table};
use flexspline_make::grid::{MAX_CLAMPED_NODES, jump_intervals};
use flexspline_make::{Harmonics, MissingDirection, Plan, Sample};

use super::parts::{GENERATOR_ORDERS, OUTPUT_ORDERS, PartName, State, TOOTH_ORDERS};
use super::prior::Prior;
use super::rows::Recorded;
use super::zero::steady;
use super::{CalibrationError, Model};
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::tables::{
    MadeTable, TableError, accepted, dead_zone_n_m, from_plan, places_that_tell_apart, refined,
};

/// Torque nodes that the choice starts with, evenly over the torques recorded.
const FIRST_TORQUE_NODES: usize = 5;
/// A torque node is put in where the table misses the model by more than this, arcsec: a tenth of what the best
/// encoders resolve.
const MISS_ARCSEC: f64 = 0.05;
/// No node is put in nearer to another than this many times the width of the widest jump, which would be none any more.
const CLEAR_OF_NODES: f64 = 9.0;
/// Half the width of the jump at the friction, of the friction; and how near to it no other node may lie, of the
/// friction and of the range.
pub(crate) const JUMP_HALF_WIDTH: f64 = 0.002;
const CLEAR_OF_JUMP: [f64; 2] = [0.2, 0.02];
/// Nodes over a tooth pitch.
pub(crate) const RIPPLE_NODES: usize = 8;
/// Places where nodes other than the first are sampled: enough for a curve over the pitch.
const FEW_PLACES: usize = 16;
/// Places over a turn of the output, at least and at most.
const PLACES: [usize; 2] = [151, 2003];
/// Orders that are to be told apart stay apart by so much where the places fold them.
pub(crate) const APART: f64 = 0.9;
/// Half-width (rad) below zero that is taken for rounding.
const NEGATIVE_HALF_WIDTH_RAD: f64 = 1e-7;
/// Orders of curves.
const ORDERS: [u16; 8] = [1, 2, 3, 4, 5, 6, 7, 8];

/// Makes the table.
pub(super) fn make(prior: &Prior<'_>, model: &Model, recorded: &Recorded) -> Result<MadeTable, CalibrationError> {
    let drive = prior.core_drive()?;
    let temperatures = temperature_nodes(prior, recorded);
    let has = |part| model.of(part).is_some();
    let curve = |there: bool, orders: &'static [u16]| Harmonics::of(if there { orders } else { &[] });
    let from_table = prior.table.is_some();
    let waves = from_table || !prior.nominal.harmonics.is_empty();
    let ripple = has(PartName::ToothPitch) || from_table;
    let of_nodes = |torques: &[f32]| {
        let plan = Plan {
            drive,
            torque_nodes_n_m: torques,
            temperature_nodes_c: &temperatures,
            ripple_nodes: if ripple { RIPPLE_NODES } else { 0 },
            generator: curve(waves || has(PartName::GeneratorAngle), &ORDERS[..usize::from(GENERATOR_ORDERS)]),
            material: curve(waves || has(PartName::MaterialAngle), &ORDERS[..usize::from(GENERATOR_ORDERS)]),
            output: curve(from_table || has(PartName::OutputAngle), &ORDERS[..usize::from(OUTPUT_ORDERS)]),
            missing_direction: MissingDirection::Refuse,
            negative_half_width_tolerance_rad: NEGATIVE_HALF_WIDTH_RAD,
            deviation_limit_rad: f64::from(flexspline::Table::MAX_ERROR_RAD),
        };
        let samples = samples(prior, model, recorded.scales.teeth, torques, &temperatures);
        from_plan(&prior.drive, prior.hash, prior.kind, &plan, &samples, ("logs of one unit", prior.parts(recorded)))
    };
    let first = first_torque_nodes(prior, model, recorded);
    let jumps = jump_intervals(first.len(), |node| first[node]);
    let intervals = first.windows(2).map(|pair| [pair[0], pair[1]]).enumerate();
    let (jumps, open): (Vec<_>, Vec<_>) = intervals.partition(|(k, _)| jumps >> k & 1 == 1);
    let open = open.into_iter().map(|(_, interval)| interval).collect();
    let widest = jumps.into_iter().map(|(_, [low, high])| f64::from(high - low)).fold(0.0, f64::max);
    let chosen = refined(first, open, MAX_CLAMPED_NODES, MISS_ARCSEC, |nodes, middles| {
        let trial = accepted(of_nodes(nodes))?;
        let miss = |middle: &f32| {
            let near = nodes.iter().any(|node| f64::from(node - middle).abs() < CLEAR_OF_NODES * widest);
            if near { 0.0 } else { misses(trial.as_ref(), prior, model, *middle, &temperatures) }
        };
        Ok::<_, TableError>(middles.iter().map(miss).collect())
    })?;
    Ok(of_nodes(&chosen.nodes)?)
}

/// How far a trial table misses the model under a load, in the mean over the places at which other than the first node
/// are sampled, arcsec: the ripple about the mean is the nodes' own.
fn misses(trial: Option<&MadeTable>, prior: &Prior<'_>, model: &Model, torque: f32, temperatures: &[f32]) -> f64 {
    let Some(table) = trial.and_then(|made| Table::check(&made.image).ok()) else { return f64::INFINITY };
    let mut worst = 0.0_f64;
    for &temperature in temperatures {
        for way in [1.0, -1.0] {
            let ratio = prior.nominal.ratio;
            let places = few_places(ratio, model.scales.teeth).map(|psi| state(ratio, psi, [torque, temperature], way));
            let sum: f64 = places.map(|at| steady(&table, &at, 0.0) - model.says_arcsec(&at, prior)).sum();
            worst = worst.max(sum.abs() / FEW_PLACES as f64);
        }
    }
    worst
}

/// Steady motion under a load and at a temperature.
fn state(ratio: f64, generator_rad: f64, [torque, temperature]: [f32; 2], way: f64) -> State {
    let (torque_n_m, temperature_c) = (f64::from(torque), f64::from(temperature));
    State { generator_rad, output_rad: generator_rad / ratio, torque_n_m, temperature_c, way, ..State::default() }
}

/// Nodes of temperature: what was recorded, or those of the table that was there before.
fn temperature_nodes(prior: &Prior<'_>, recorded: &Recorded) -> Vec<f32> {
    let [cold, warm] = recorded.scales.temperature_c;
    match prior.table {
        Some(table) => table.temperature_nodes_c().collect(),
        None if recorded.has_temperature && warm - cold > super::ONE_TEMPERATURE_K => vec![cold as f32, warm as f32],
        None => vec![recorded.temperature_c as f32],
    }
}

/// Torque nodes that the choice starts with: even ones, or those of the table that was there before; about each jump
/// two.
fn first_torque_nodes(prior: &Prior<'_>, model: &Model, recorded: &Recorded) -> Vec<f32> {
    let [low, high] = match prior.table {
        Some(table) => table.torque_range_n_m().map(f64::from),
        None => recorded.scales.torque_n_m,
    };
    let friction = recorded.scales.friction_n_m;
    // Of a load that is as good as a zero nobody knows the wind-up.
    let unknown = recorded.each_keeps_to_one_load && prior.nominal.wind_up_arcsec(1.0) == 0.0;
    let mut nodes: Vec<f64> = match prior.table {
        Some(table) => table.torque_nodes_n_m().map(f64::from).collect(),
        None if unknown || !recorded.has_torque || high - low <= super::SAME_TORQUE * low.abs().max(high.abs()) => {
            return vec![f64::midpoint(low, high) as f32];
        }
        None => {
            (0..FIRST_TORQUE_NODES).map(|k| low + (high - low) * k as f64 / (FIRST_TORQUE_NODES - 1) as f64).collect()
        }
    };
    let clear = (CLEAR_OF_JUMP[0] * friction).max(CLEAR_OF_JUMP[1] * (high - low)).min(0.9 * friction);
    // Its own jumps stay where they are; beside another dead zone they are none.
    let own = prior.table.is_some_and(|table| friction <= dead_zone_n_m(table));
    let play = prior.nominal.backlash_arcsec > 0.0 || model.of(PartName::Play).is_some();
    if !own && play && friction > 0.0 {
        let jumps: Vec<f64> = [-friction, friction].into_iter().filter(|at| *at > low && *at < high).collect();
        let half = JUMP_HALF_WIDTH * friction;
        let of_table = prior.table.is_some();
        nodes.retain(|node| {
            !(of_table && node.abs() < friction) && jumps.iter().all(|jump| (node - jump).abs() > clear)
        });
        nodes.extend(jumps.iter().flat_map(|jump| [jump - half, jump + half]));
    }
    // Beyond the loads recorded nothing grows further: a corner.
    let corners = recorded.scales.torque_n_m.into_iter().filter(|_| recorded.has_torque);
    for corner in corners.filter(|at| *at > low && *at < high) {
        if nodes.len() < MAX_CLAMPED_NODES && nodes.iter().all(|node| (node - corner).abs() > clear) {
            nodes.push(corner);
        }
    }
    nodes.sort_by(f64::total_cmp);
    let mut nodes: Vec<f32> = nodes.into_iter().map(|node| node as f32).collect();
    nodes.dedup();
    nodes
}

/// Places spread over the pitch and over a turn of the output: the largest error of a table is that of a load at an
/// angle.
fn few_places(ratio: f64, teeth: f64) -> impl Iterator<Item = f64> {
    let pitches = (teeth * ratio.abs() / FEW_PLACES as f64).round();
    (0..FEW_PLACES).map(move |k| TAU / teeth * (k as f64 / FEW_PLACES as f64 + pitches * k as f64))
}

/// Steady motion both ways: over a whole turn of the output at one node, at a few places at the others.
fn samples(prior: &Prior<'_>, model: &Model, teeth: f64, torques: &[f32], temperatures: &[f32]) -> Vec<Sample> {
    let ratio = prior.nominal.ratio;
    let count = places(ratio, teeth);
    let whole_turn: Vec<f64> = (0..count).map(|k| k as f64 * TAU * ratio.abs() / count as f64).collect();
    let few: Vec<f64> = few_places(ratio, teeth).collect();
    let middle = torques.len() / 2;
    let mut samples = Vec::new();
    for (warm, &temperature) in temperatures.iter().enumerate() {
        for (load, &torque) in torques.iter().enumerate() {
            let angles = if warm == 0 && load == middle { &whole_turn } else { &few };
            for (way, direction) in [(1.0, Direction::Forward), (-1.0, Direction::Backward)] {
                for &generator_rad in angles {
                    let at = state(ratio, generator_rad, [torque, temperature], way);
                    let State { torque_n_m, temperature_c, .. } = at;
                    let output_rad = at.output_rad + model.says_arcsec(&at, prior) / ARCSEC_PER_RAD;
                    samples.push(Sample { generator_rad, torque_n_m, temperature_c, direction, output_rad });
                }
            }
        }
    }
    samples
}

/// Places over a turn of the output on which no order of the generator, of the generator against the output, of the
/// output or of the mesh folds onto another: a prime.
fn places(ratio: f64, teeth: f64) -> usize {
    let against = (ratio - 1.0).abs();
    let waves = (1..=GENERATOR_ORDERS).flat_map(|k| [ratio.abs(), against].map(|turns| f64::from(k) * turns));
    let output = (1..=OUTPUT_ORDERS).map(f64::from);
    let mesh = (1..=TOOTH_ORDERS).map(|k| f64::from(k) * teeth * ratio.abs());
    let orders: Vec<f64> = waves.chain(output).chain(mesh).chain([0.0]).collect();
    places_that_tell_apart(&orders, PLACES, APART)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_tell_the_orders_of_common_ratios_apart() {
        for ratio in [30.0, 50.0, 80.0, 95.0, -94.0, 100.0, -100.0, 101.0, 121.0, 160.0, -160.0, 320.0] {
            let teeth = 2.0 * f64::abs(ratio);
            assert!(places(ratio, teeth) < PLACES[1], "{ratio}: {}", places(ratio, teeth));
        }
    }
}
