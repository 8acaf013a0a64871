//! Linker script, tables, and the closed-form table of full size.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::{env, fs};

use flexspline::{Direction, Drive, FixedMember, GeneratorKind};
use flexspline_estimation::{Inertias, Noise, TwoMassObserver};
use flexspline_make::{Harmonics, MissingDirection, Plan, Provenance, Sample, Workspace, make_image};

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    let here = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let memory = here.join("../../memory.x");
    fs::copy(&memory, out.join("memory.x")).expect("memory.x at the top of the project");
    println!("cargo:rerun-if-changed={}", memory.display());
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    // Functions of one alignment stand together: the padding between them does not depend on the order of modules.
    println!("cargo:rustc-link-arg-bins=--sort-section=alignment");
    println!("cargo:rerun-if-changed=build.rs");
    write_full_table(&out.join("full.fxt"));
    write_predictor(&out.join("predictor.rs"));
    // The tables of the four generators, made by `flexspline tables`; tests/run does that.
    let tables =
        env::var("FLEXSPLINE_TABLES").expect("FLEXSPLINE_TABLES names the folder of the tables; see tests/run");
    println!("cargo:rustc-env=FLEXSPLINE_TABLES={tables}");
    println!("cargo:rerun-if-env-changed=FLEXSPLINE_TABLES");
    println!("cargo:rerun-if-changed={tables}");
}

/// Two inertias at the output of HHD-95, discretised here, checked on board; with a measured twist.
fn write_predictor(path: &Path) {
    let inertias =
        Inertias { motor_kg_m2: 1.0, load_kg_m2: 3.0, stiffness_n_m_per_rad: 3.0e4, damping_n_m_s_per_rad: 20.0 };
    let noise = Noise { torque_n_m: 0.5, load_change_n_m: 0.2, speed_rad_s: 1e-4, twist_rad: Some(1e-6) };
    let predictor = TwoMassObserver::new(inertias, noise, 1e-3).expect("it contracts");
    fs::write(path, format!("{:?}", predictor.parts())).expect("OUT_DIR is writable");
}

/// 25 torques, 3 temperatures, 8 ripple nodes and harmonics of all three angles.
fn write_full_table(path: &Path) {
    let torques: Vec<f32> = {
        let side = [1.51f32, 2.0, 3.0, 4.5, 6.5, 9.0, 13.0, 18.0, 25.0, 33.0, 50.0];
        let middle = [-1.49f32, 0.0, 1.49];
        side.iter().rev().map(|t| -t).chain(middle).chain(side).collect()
    };
    let temperatures = [-40.0f32, 20.0, 80.0];
    let drive = Drive::new(188, 190, FixedMember::Flexspline).expect("HHD-95");
    let curve = |orders: &'static [u16]| Harmonics { orders, nodes: 64 };
    let plan = Plan {
        drive,
        torque_nodes_n_m: &torques,
        temperature_nodes_c: &temperatures,
        ripple_nodes: 8,
        generator: curve(&[2, 4]),
        material: curve(&[2, 4]),
        output: Harmonics { orders: &[1], nodes: 16 },
        missing_direction: MissingDirection::Refuse,
        negative_half_width_tolerance_rad: 1e-7,
        deviation_limit_rad: 5e-6,
    };
    let arcsec = TAU / 360.0 / 3600.0;
    let sample = |generator_rad: f64, torque: f32, temperature: f32, direction: Direction| {
        let (sign, load) = (f64::from(direction.sign()), f64::from(torque));
        let flank = load - 1.5 * sign;
        let warm = 1.0 + 1e-3 * (f64::from(temperature) - 20.0);
        let ripple =
            (0.5 + 0.02 * load.abs()) * (188.0 * generator_rad).cos() - 0.1 * sign * (188.0 * generator_rad).sin();
        let (material, output) = (generator_rad * 94.0 / 95.0, generator_rad / 95.0);
        let slow = 20.0 * (2.0 * generator_rad).cos() + 3.0 * (4.0 * generator_rad).sin()
            - 12.0 * (2.0 * material).cos()
            + 2.0 * (4.0 * material).sin()
            + 8.0 * output.sin();
        let error = warm * (flank / 3.0e4 + flank.signum() * 30.0 * arcsec) + (ripple + slow) * arcsec;
        Sample {
            generator_rad,
            torque_n_m: load,
            temperature_c: f64::from(temperature),
            direction,
            output_rad: output + error,
        }
    };
    let mut samples = Vec::new();
    for direction in [Direction::Forward, Direction::Backward] {
        for &temperature in &temperatures {
            for &torque in &torques {
                for position in 0..8 {
                    let generator = 1.0 + TAU / 188.0 * (f64::from(position) + 0.3) / 8.0;
                    samples.push(sample(generator, torque, temperature, direction));
                }
            }
        }
        samples.extend((0..3000).map(|i| sample(TAU * 96.0 * f64::from(i) / 2999.0, 2.0, 20.0, direction)));
    }
    let provenance = Provenance {
        generator_kind: GeneratorKind::Other,
        drive_hash: [0; 32],
        tool_version: "firmware build script",
        mesh_level: "closed form",
        solver_residual: 0.0,
        torque_range_n_m: [-50.0, 50.0],
        temperature_range_c: [-40.0, 80.0],
        error_limit_rad: 0.02,
    };
    let (mut numbers, mut marks) = (vec![0.0; plan.numbers_len()], vec![0; plan.marks_len()]);
    let (mut values, mut image) = (vec![0.0; plan.values_len()], vec![0; plan.image_bytes()]);
    let workspace = Workspace { numbers: &mut numbers, marks: &mut marks, values: &mut values };
    let fit = make_image(&plan, &provenance, &samples, workspace, &mut image, |_| *b"fullsize")
        .expect("samples of a closed form");
    image.truncate(fit.image_bytes);
    fs::write(path, image).expect("OUT_DIR is writable");
}
