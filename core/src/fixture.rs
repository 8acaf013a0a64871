//! A drive whose error is known in closed form, for the tests: HHD-95 with drag, backlash, ripple and eccentricities.
//!
//! Own arithmetic in `f64`: shares nothing with the grid, the table or the projection.

use crate::drive::{Drive, FixedMember};
use crate::joint::Limits;
use crate::make::{Harmonics, MissingDirection, Plan, Sample, Workspace, make_image};
use crate::play::Direction;
use crate::table::{GeneratorKind, Provenance};
use core::f64::consts::TAU;
use std::vec::Vec;

pub const ARCSEC: f64 = TAU / 360.0 / 3600.0;

/// Limits of a joint at a thousand ticks a second.
pub const LIMITS: Limits = Limits {
    tick_s: 1e-3,
    rate_rad_s: 0.05,
    acceleration_rad_s2: 2.0,
    generator_rate_rad_s: 700.0,
    patience: 5,
    hold_rad: 0.0,
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

pub fn sample(generator_rad: f64, torque: f64, temperature: f64, direction: Direction, long: bool) -> Sample {
    Sample {
        generator_rad,
        torque_n_m: torque,
        temperature_c: temperature,
        direction,
        output_rad: generator_rad / 95.0 + error(generator_rad, torque, temperature, direction, long),
    }
}

/// Every node in both directions over one pitch; `long` adds 96 generator turns at one node, for the harmonics.
pub fn samples(long: bool) -> Vec<Sample> {
    let mut samples = Vec::new();
    for temperature in TEMPERATURES {
        for torque in TORQUES {
            for direction in [Direction::Forward, Direction::Backward] {
                for position in 0..16 {
                    let generator = 1.0 + PITCH * (position as f64 + 0.3) / 16.0;
                    samples.push(sample(generator, torque as f64, temperature as f64, direction, long));
                }
            }
        }
    }
    if long {
        for direction in [Direction::Forward, Direction::Backward] {
            for i in 0..3000 {
                samples.push(sample(TAU * 96.0 * i as f64 / 2999.0, 5.0, 20.0, direction, long));
            }
        }
    }
    samples
}

pub fn plan(long: bool) -> Plan<'static> {
    let curve = |orders, nodes| {
        if long { Harmonics { orders, nodes } } else { Harmonics::default() }
    };
    Plan {
        drive: drive(),
        torque_nodes_n_m: &TORQUES,
        temperature_nodes_c: &TEMPERATURES,
        ripple_nodes: 16,
        generator: curve(&[2, 4], 64),
        material: curve(&[2, 4], 64),
        output: curve(&[1], 32),
        missing_direction: MissingDirection::Refuse,
        negative_half_width_tolerance_rad: 0.01 * ARCSEC,
        deviation_limit_rad: 1.0 * ARCSEC,
    }
}

pub fn provenance() -> Provenance<'static> {
    Provenance {
        generator_kind: GeneratorKind::Cam,
        drive_hash: [0x5a; 32],
        tool_version: "flexspline 0.1.0",
        mesh_level: "closed form",
        solver_residual: 1e-9,
        torque_range_n_m: [-50.0, 50.0],
        temperature_range_c: [-40.0, 80.0],
        error_limit_rad: 0.02,
    }
}

/// A stand-in for BLAKE3 that reads every byte.
pub fn id(contents: &[u8]) -> [u8; 8] {
    let hash = contents
        .iter()
        .fold(0xcbf2_9ce4_8422_2325u64, |hash, &byte| (hash ^ byte as u64).wrapping_mul(0x0100_0000_01b3));
    hash.to_be_bytes()
}

/// Buffers large enough for a plan.
pub struct Buffers {
    numbers: Vec<f64>,
    marks: Vec<u64>,
    values: Vec<f32>,
}

impl Buffers {
    pub fn new(plan: &Plan<'_>) -> Self {
        Self {
            numbers: std::vec![f64::NAN; plan.numbers_len()],
            marks: std::vec![u64::MAX; plan.marks_len()],
            values: std::vec![f32::NAN; plan.values_len()],
        }
    }

    pub fn workspace(&mut self) -> Workspace<'_> {
        Workspace { numbers: &mut self.numbers, marks: &mut self.marks, values: &mut self.values }
    }
}

/// The image of the drive above. Under Miri, where the least squares take too long, the one that is kept.
pub fn image(long: bool) -> Vec<u8> {
    if cfg!(miri) { kept(long).to_vec() } else { make(long) }
}

fn make(long: bool) -> Vec<u8> {
    let plan = plan(long);
    let mut out = std::vec![0; plan.image_bytes()];
    let mut buffers = Buffers::new(&plan);
    let samples = samples(long);
    make_image(&plan, &provenance(), &samples, buffers.workspace(), &mut out, id).unwrap();
    out
}

/// Written by the test below, with FLEXSPLINE_KEEP_FIXTURES set.
fn kept(long: bool) -> &'static [u8] {
    if long { include_bytes!("fixtures/long.fxt") } else { include_bytes!("fixtures/short.fxt") }
}

#[test]
#[cfg_attr(miri, ignore = "makes the images")]
fn the_images_kept_for_miri_are_the_ones_made() {
    for (long, name) in [(false, "short"), (true, "long")] {
        let made = make(long);
        if std::env::var_os("FLEXSPLINE_KEEP_FIXTURES").is_some() {
            std::fs::write(std::format!("{}/src/fixtures/{name}.fxt", env!("CARGO_MANIFEST_DIR")), &made).unwrap();
        } else {
            assert!(
                kept(long) == made,
                "{name}.fxt is not what is made: run this test with FLEXSPLINE_KEEP_FIXTURES=1"
            );
        }
    }
}
