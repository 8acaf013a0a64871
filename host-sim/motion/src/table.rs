//! A compensation table sampled from a gear at rest: what a drive's table, an extended or a calibrated one knows of it.

use core::f64::consts::TAU;

use flexspline::make::{
    Harmonics, MissingDirection, NODES_PER_PERIOD, Plan, ProjectError, Sample, Workspace, make_image,
};
use flexspline::{Direction, Drive, GeneratorKind, MAX_ERROR_RAD, Provenance};

use super::gear::Gear;
use super::servo::Noise;

/// Nodes on each side of the dead zone, and how they crowd towards it: node k of n at `(k/n)^CROWDING` of the way.
const STEPS: usize = 12;
const CROWDING: f64 = 3.2;
/// Half the width of the pair of nodes that holds the jump at the drag, of the drag.
const JUMP_HALF_WIDTH: f64 = 0.05;
/// Nodes over a tooth pitch, and places on a pitch at nodes other than the first.
const RIPPLE_NODES: usize = 8;
const PLACES: usize = 16;
/// Places over the output turn at one node: a prime, so that no order folds onto another.
const PLACES_OF_A_TURN: usize = 997;
/// Orders of curves.
const ORDERS: [u16; 4] = [1, 2, 3, 4];
const OUTPUT_ORDERS: [u16; 2] = [1, 2];

/// What is sampled.
#[derive(Clone, Copy, Debug)]
pub struct Sampling {
    /// Largest torque on the load, N·m.
    pub largest_n_m: f64,
    /// Coulomb drag of the output, N·m.
    pub drag_n_m: f64,
    /// Temperature, °C.
    pub temperature_c: f64,
    /// Noise of each sample, rad rms.
    pub noise_rad: f64,
}

/// The image of a table.
///
/// # Errors
/// [`ProjectError`].
pub fn image(gear: &Gear, drive: Drive, sampling: &Sampling) -> Result<Vec<u8>, ProjectError> {
    let torques = torques(sampling);
    let temperatures = [sampling.temperature_c as f32];
    let curve = |orders: &'static [u16]| {
        let highest = usize::from(orders.iter().copied().max().unwrap_or(1));
        if gear.lines.is_empty() {
            Harmonics::default()
        } else {
            Harmonics { orders, nodes: NODES_PER_PERIOD * highest }
        }
    };
    let plan = Plan {
        drive,
        torque_nodes_n_m: &torques,
        temperature_nodes_c: &temperatures,
        ripple_nodes: RIPPLE_NODES,
        generator: curve(&ORDERS),
        material: curve(&ORDERS),
        output: curve(&OUTPUT_ORDERS),
        missing_direction: MissingDirection::Refuse,
        negative_half_width_tolerance_rad: 1e-4,
        deviation_limit_rad: f64::from(MAX_ERROR_RAD),
    };
    let samples = samples(gear, sampling, &torques);
    let mut numbers = vec![0.0; plan.numbers_len()];
    let mut marks = vec![0; plan.marks_len()];
    let mut values = vec![0.0; plan.values_len()];
    let mut image = vec![0; plan.image_bytes()];
    let workspace = Workspace { numbers: &mut numbers, marks: &mut marks, values: &mut values };
    let error = |sample: &Sample| (sample.output_rad - sample.generator_rad / gear.ratio).abs();
    let largest = samples.iter().map(error).fold(0.0, f64::max);
    let provenance = Provenance {
        generator_kind: GeneratorKind::Cam,
        drive_hash: [0; 32],
        tool_version: "flexspline motion",
        mesh_level: "gear",
        solver_residual: 0.0,
        torque_range_n_m: [torques[0], torques[torques.len() - 1]],
        temperature_range_c: [temperatures[0]; 2],
        error_limit_rad: (1.5 * largest + 1e-4).min(f64::from(MAX_ERROR_RAD)) as f32,
    };
    let fit = make_image(&plan, &provenance, &samples, workspace, &mut image, |_| [0; 8])?;
    image.truncate(fit.image_bytes);
    Ok(image)
}

fn torques(sampling: &Sampling) -> Vec<f32> {
    let Sampling { largest_n_m, drag_n_m, .. } = *sampling;
    let half = JUMP_HALF_WIDTH * drag_n_m;
    let first = drag_n_m + half;
    let mut positive = vec![drag_n_m - half, first];
    positive.extend((1..=STEPS).map(|k| {
        let share = libm::pow(k as f64 / STEPS as f64, CROWDING);
        first + ((largest_n_m - first) * share).max(40.0 * half * k as f64)
    }));
    positive.iter().rev().map(|t| -t).chain(positive.iter().copied()).map(|t| t as f32).collect()
}

/// Steady motion both ways: over a turn of the output at one node, at a few places at the others.
fn samples(gear: &Gear, sampling: &Sampling, torques: &[f32]) -> Vec<Sample> {
    let mut noise = Noise::new(77);
    let turn = TAU * gear.ratio;
    let whole = |k: usize| k as f64 * turn / PLACES_OF_A_TURN as f64;
    // Spread over the pitch and over the turn.
    let few = |k: usize| TAU / 188.0 * (k as f64 / PLACES as f64 + 571.0 * k as f64);
    let mut samples = Vec::new();
    for (node, &torque) in torques.iter().enumerate() {
        let places: Vec<f64> = if node == torques.len() - 4 && !gear.lines.is_empty() {
            (0..PLACES_OF_A_TURN).map(whole).collect()
        } else {
            (0..PLACES).map(few).collect()
        };
        for (direction, way) in [(Direction::Forward, 1.0), (Direction::Backward, -1.0)] {
            let torque_n_m = f64::from(torque);
            let mesh_n_m = torque_n_m - way * sampling.drag_n_m;
            for &generator_rad in &places {
                let error = gear.error_under_rad(generator_rad, mesh_n_m, mesh_n_m);
                let output_rad = generator_rad / gear.ratio + error + sampling.noise_rad * noise.normal();
                samples.push(Sample {
                    generator_rad,
                    torque_n_m,
                    temperature_c: sampling.temperature_c,
                    direction,
                    output_rad,
                });
            }
        }
    }
    samples
}
