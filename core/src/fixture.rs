//! A drive whose error is known in closed form, for the tests: HHD-95 with drag, backlash, ripple and eccentricities.
//!
//! Own arithmetic in `f64`: shares nothing with the grid, the table or the projection.

#![allow(missing_docs, clippy::arithmetic_side_effects, clippy::indexing_slicing, clippy::unwrap_used)] // Tests.

use crate::drive::{Drive, FixedMember};
use crate::joint::Limits;
use crate::play::Direction;
use core::f64::consts::TAU;
use std::vec::Vec;

pub const ARCSEC: f64 = TAU / 360.0 / 3600.0;

/// Limits of a joint at a thousand ticks a second.
pub const LIMITS: Limits = Limits {
    tick_s: 1e-3,
    rate_rad_s: 0.05,
    acceleration_rad_s2: 2.0,
    generator_rate_rad_s: 700.0,
    debounce_ticks: 5,
    deadband_rad: 0.0,
};
pub const PITCH: f64 = TAU / 188.0;

/// Jumps at ±the drag torque of 1.5 N·m.
pub const TORQUES: [f32; 11] = [-50.0, -20.0, -5.0, -1.51, -1.49, 0.0, 1.49, 1.51, 5.0, 20.0, 50.0];
pub const TEMPERATURES: [f32; 3] = [-40.0, 20.0, 80.0];
const DRAG_N_M: f64 = 1.5;
const STIFFNESS: f64 = 3.0e4;
const HALF_BACKLASH: f64 = 30.0 * ARCSEC;

pub fn drive() -> Drive {
    Drive::new(188, 190, FixedMember::Flexspline).unwrap()
}

/// Linear interpolation of `value` at the nodes around `at`, clamped.
fn between(nodes: &[f32], at: f64, value: impl Fn(f64) -> f64) -> f64 {
    let nodes: Vec<f64> = nodes.iter().map(|&node| node as f64).collect();
    let at = at.clamp(nodes[0], nodes[nodes.len() - 1]);
    let above = nodes.iter().position(|&node| node >= at).unwrap().max(1);
    let (low, high) = (nodes[above - 1], nodes[above]);
    let share = (at - low) / (high - low);
    value(low) * (1.0 - share) + value(high) * share
}

/// Error at a node: the flanks carry the torque less the drag, the clearance adds its half on their side.
fn at_node(generator_rad: f64, torque: f64, temperature: f64, direction: Direction) -> f64 {
    let sign = direction.sign() as f64;
    let load = torque - sign * DRAG_N_M;
    let warm = 1.0 + 1.0e-3 * (temperature - 20.0);
    let pitch = 188.0 * generator_rad;
    let ripple = (0.2 + 0.01 * torque.abs()) * (pitch + 0.3).cos() + 0.02 * (2.0 * pitch).sin();
    let half_ripple = 0.1 * (pitch - 1.0).sin();
    warm * (load / STIFFNESS + load.signum() * HALF_BACKLASH) + (ripple - sign * half_ripple) * ARCSEC
}

/// Orders 2 and 4 of ψ and ψ·94/95, order 1 of δ.
pub fn harmonics(generator_rad: f64) -> f64 {
    let material = generator_rad * 94.0 / 95.0;
    let output = generator_rad / 95.0;
    ARCSEC
        * (20.0 * (2.0 * generator_rad + 0.7).cos() + 4.0 * (4.0 * generator_rad).sin() - 15.0 * (2.0 * material).cos()
            + 3.0 * (4.0 * material - 0.5).cos()
            + 10.0 * (output + 1.0).sin())
}

/// The error in steady motion, rad.
pub fn error(generator_rad: f64, torque: f64, temperature: f64, direction: Direction, long: bool) -> f64 {
    let base = between(&TEMPERATURES, temperature, |temperature| {
        between(&TORQUES, torque, |torque| at_node(generator_rad, torque, temperature, direction))
    });
    base + if long { harmonics(generator_rad) } else { 0.0 }
}

/// A stand-in for BLAKE3 that reads every byte.
pub fn id(contents: &[u8]) -> [u8; 8] {
    let hash = contents
        .iter()
        .fold(0xcbf2_9ce4_8422_2325u64, |hash, &byte| (hash ^ byte as u64).wrapping_mul(0x0100_0000_01b3));
    hash.to_be_bytes()
}

/// The image of the drive above, as `flexspline-make` makes it of samples. Its test sees that it does.
pub fn image(long: bool) -> Vec<u8> {
    let kept: &[u8] = if long { include_bytes!("fixtures/long.fxt") } else { include_bytes!("fixtures/short.fxt") };
    kept.to_vec()
}

#[cfg(test)]
pub fn provenance() -> crate::write::Provenance<'static> {
    crate::write::Provenance {
        generator_kind: crate::GeneratorKind::Cam,
        drive_hash: [0x5a; 32],
        tool_version: "flexspline 0.1.0",
        mesh_level: "closed form",
        solver_residual: 1e-9,
        torque_range_n_m: [-50.0, 50.0],
        temperature_range_c: [-40.0, 80.0],
        error_limit_rad: 0.02,
    }
}

/// A table of D, with a half-width of 1e-6 and a ripple of zeros.
#[cfg(test)]
pub fn image_of(torques: &[f32], mean_rad: &[f32], temperatures: &[f32], ripple_nodes: usize) -> Vec<u8> {
    let zeros = std::vec![0.0; mean_rad.len() * ripple_nodes];
    let data = crate::write::TableData {
        drive: drive(),
        torque_nodes_n_m: torques,
        temperature_nodes_c: temperatures,
        ripple_nodes,
        mean_rad,
        half_width_rad: &std::vec![1.0e-6; mean_rad.len()],
        mean_ripple_rad: &zeros,
        half_width_ripple_rad: &zeros,
        generator_curve_rad: &[],
        material_curve_rad: &[],
        output_curve_rad: &[],
        projection_worst_rad: 0.0,
        projection_rms_rad: 0.0,
    };
    let ends = |axis: &[f32]| [axis[0], axis[axis.len() - 1]];
    let provenance = crate::write::Provenance {
        torque_range_n_m: ends(torques),
        temperature_range_c: ends(temperatures),
        error_limit_rad: 0.05,
        ..provenance()
    };
    let mut image = std::vec![0; crate::table::image_bytes(torques.len(), temperatures.len(), ripple_nodes, [0; 3])];
    crate::write::write_image(&data, &provenance, &mut image, id).unwrap();
    image
}
