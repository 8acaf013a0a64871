//! The fitted model as a table: sampled in steady motion where the table has its nodes.

use std::f64::consts::TAU;

use flexspline::Direction;
use flexspline::make::{Harmonics, MissingDirection, NODES_PER_PERIOD, Plan, Sample};

use super::parts::{GENERATOR_ORDERS, OUTPUT_ORDERS, PartName, State, TOOTH_ORDERS};
use super::prior::Prior;
use super::rows::Recorded;
use super::{CalibrationError, Model};
use crate::tables::{MadeTable, Source, from_plan, places_that_tell_apart};
use crate::units::ARCSEC_PER_RAD;

/// Nodes over the torques recorded; the wind-up is a polynomial of the sixth degree there.
const TORQUE_NODES: usize = 13;
/// Half the width of the jump at the friction, of the friction; and how near to it no other node may lie, of the friction and of the range.
const JUMP_HALF_WIDTH: f64 = 0.002;
const CLEAR_OF_JUMP: [f64; 2] = [0.2, 0.02];
/// Nodes over a tooth pitch.
const RIPPLE_NODES: usize = 8;
/// Places where nodes other than the first are sampled: enough for a curve over the pitch.
const FEW_PLACES: usize = 16;
/// Places over a turn of the output, at least and at most.
const PLACES: [usize; 2] = [151, 2003];
/// Orders that are to be told apart stay apart by so much where the places fold them.
const APART: f64 = 0.9;
/// Half-width (rad) below zero that is taken for rounding.
const NEGATIVE_HALF_WIDTH_RAD: f64 = 1e-7;
/// Orders of curves.
const ORDERS: [u16; 8] = [1, 2, 3, 4, 5, 6, 7, 8];

/// Makes the table.
pub(super) fn make(prior: &Prior<'_>, model: &Model, recorded: &Recorded) -> Result<MadeTable, CalibrationError> {
    let drive = prior.core_drive().map_err(CalibrationError::Known)?;
    let (torques, temperatures) = nodes(prior, model, recorded);
    let has = |part| model.chosen.iter().any(|chosen| chosen.part == part);
    let curve = |there: bool, orders: &'static [u16]| {
        let highest = usize::from(orders.iter().copied().max().unwrap_or(1));
        if there { Harmonics { orders, nodes: NODES_PER_PERIOD * highest } } else { Harmonics::default() }
    };
    let from_table = prior.table.is_some();
    let waves = from_table || !prior.nominal.harmonics.is_empty();
    let ripple = has(PartName::ToothPitch) || from_table;
    let plan = Plan {
        drive,
        torque_nodes_n_m: &torques,
        temperature_nodes_c: &temperatures,
        ripple_nodes: if ripple { RIPPLE_NODES } else { 0 },
        generator: curve(waves || has(PartName::GeneratorAngle), &ORDERS[..usize::from(GENERATOR_ORDERS)]),
        material: curve(waves || has(PartName::MaterialAngle), &ORDERS[..usize::from(GENERATOR_ORDERS)]),
        output: curve(from_table || has(PartName::OutputAngle), &ORDERS[..usize::from(OUTPUT_ORDERS)]),
        missing_direction: MissingDirection::Refuse,
        negative_half_width_tolerance_rad: NEGATIVE_HALF_WIDTH_RAD,
        deviation_limit_rad: f64::from(flexspline::MAX_ERROR_RAD),
    };
    let samples = samples(prior, model, recorded.scales.teeth, &torques, &temperatures);
    let source = Source::File {
        name: "logs of one unit".to_owned(),
        blake3: blake3::Hash::from(prior.hash).to_hex().to_string(),
    };
    Ok(from_plan(&prior.drive, prior.hash, prior.kind, &plan, &samples, source)?)
}

/// Nodes of torque and temperature: what was recorded, or those of the table that was there before.
fn nodes(prior: &Prior<'_>, model: &Model, recorded: &Recorded) -> (Vec<f32>, Vec<f32>) {
    let [cold, warm] = recorded.scales.temperature_c;
    let temperatures = match prior.table {
        Some(table) => table.temperature_nodes_c().collect(),
        None if recorded.has_temperature && warm - cold > super::ONE_TEMPERATURE_K => vec![cold as f32, warm as f32],
        None => vec![recorded.temperature_c as f32],
    };
    let [low, high] = match prior.table {
        Some(table) => table.torque_range_n_m().map(f64::from),
        None => recorded.scales.torque_n_m,
    };
    let friction = recorded.scales.friction_n_m;
    let even: Vec<f64> = match prior.table {
        // Those inside the dead zone of these logs are its own jump.
        Some(table) => table.torque_nodes_n_m().map(f64::from).filter(|node| node.abs() >= friction).collect(),
        None if !recorded.has_torque || high - low <= super::SAME_TORQUE * low.abs().max(high.abs()) => {
            return (vec![f64::midpoint(low, high) as f32], temperatures);
        }
        None => (0..TORQUE_NODES).map(|k| low + (high - low) * k as f64 / (TORQUE_NODES - 1) as f64).collect(),
    };
    let play = prior.nominal.backlash_arcsec > 0.0 || model.chosen.iter().any(|chosen| chosen.part == PartName::Play);
    let jumps: Vec<f64> =
        [-friction, friction].into_iter().filter(|at| play && friction > 0.0 && *at > low && *at < high).collect();
    let clear = (CLEAR_OF_JUMP[0] * friction).max(CLEAR_OF_JUMP[1] * (high - low)).min(0.9 * friction);
    let half = JUMP_HALF_WIDTH * friction;
    let mut all: Vec<f64> =
        even.into_iter().filter(|node| jumps.iter().all(|jump| (node - jump).abs() > clear)).collect();
    all.extend(jumps.iter().flat_map(|jump| [jump - half, jump + half]));
    all.sort_by(f64::total_cmp);
    let mut all: Vec<f32> = all.into_iter().map(|node| node as f32).collect();
    all.dedup();
    (all, temperatures)
}

/// Steady motion both ways: over a whole turn of the output at one node, at a few places at the others.
fn samples(prior: &Prior<'_>, model: &Model, teeth: f64, torques: &[f32], temperatures: &[f32]) -> Vec<Sample> {
    let ratio = prior.nominal.ratio;
    let count = places(ratio, teeth);
    let whole_turn: Vec<f64> = (0..count).map(|k| k as f64 * TAU * ratio.abs() / count as f64).collect();
    // Spread over the pitch and over the turn.
    let few: Vec<f64> =
        (0..FEW_PLACES).map(|k| TAU / teeth * (k as f64 / FEW_PLACES as f64 + 7.0 * k as f64)).collect();
    let middle = torques.len() / 2;
    let mut samples = Vec::new();
    for (warm, &temperature) in temperatures.iter().enumerate() {
        for (load, &torque) in torques.iter().enumerate() {
            let angles = if warm == 0 && load == middle { &whole_turn } else { &few };
            for (direction, way) in [(Direction::Forward, 1.0), (Direction::Backward, -1.0)] {
                for &generator_rad in angles {
                    let (torque_n_m, temperature_c) = (f64::from(torque), f64::from(temperature));
                    let output_rad = generator_rad / ratio;
                    let at = State { generator_rad, output_rad, torque_n_m, temperature_c, way };
                    let error = prior.steady_arcsec(&at) + model.adds_arcsec(&at);
                    let output_rad = output_rad + error / ARCSEC_PER_RAD;
                    samples.push(Sample { generator_rad, torque_n_m, temperature_c, direction, output_rad });
                }
            }
        }
    }
    samples
}

/// Places over a turn of the output on which no order of the generator, of the generator against the output, of the output or of the mesh
/// folds onto another: a prime.
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
