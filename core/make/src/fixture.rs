//! Samples of the drive of [`flexspline::testing::fixture`], and a plan of its table.

use crate::{Harmonics, MissingDirection, Plan, Provenance, Sample, Workspace, make_image};
use core::f64::consts::TAU;
pub use flexspline::testing::fixture::{ARCSEC, PITCH, TEMPERATURES, TORQUES, drive, error, id};
use flexspline::{Direction, GeneratorKind, Table};
use std::vec::Vec;

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

/// Buffers large enough for a plan.
pub struct Buffers {
    pub numbers: Vec<f64>,
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

/// The images that the tests of the other crates use are the ones made here, and are written with
/// FLEXSPLINE_KEEP_FIXTURES set. The steep one has a wave in a generator turn, and takes more iterations for it.
#[test]
fn the_images_kept_are_the_ones_made() {
    for (name, long, steep_rad) in [("short", false, 0.0), ("long", true, 0.0), ("steep", true, 0.0025)] {
        let mut plan = plan(long);
        let mut samples = samples(long);
        if steep_rad > 0.0 {
            plan.generator.orders = &[1, 2, 4];
            samples.iter_mut().for_each(|sample| sample.output_rad += steep_rad * sample.generator_rad.sin());
        }
        let mut made = std::vec![0; plan.image_bytes()];
        let mut buffers = Buffers::new(&plan);
        make_image(&plan, &provenance(), &samples, buffers.workspace(), &mut made, id).unwrap();
        let iterations = Table::check(&made).unwrap().inverse_iterations();
        assert_eq!(iterations > 8, name == "steep", "{name}: {iterations}");
        let path = std::format!("{}/../src/fixtures/{name}.fxt", env!("CARGO_MANIFEST_DIR"));
        if std::env::var_os("FLEXSPLINE_KEEP_FIXTURES").is_some() {
            std::fs::write(path, &made).unwrap();
        } else {
            let kept = std::fs::read(path).unwrap();
            assert!(kept == made, "{name}.fxt is not what is made: run this test with FLEXSPLINE_KEEP_FIXTURES=1");
        }
    }
}
