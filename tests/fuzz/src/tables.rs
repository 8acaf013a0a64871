//! Tables to start from: of fixed numbers, and of any numbers that the writer takes.

use crate::Choices;
use flexspline::{Drive, FixedMember, GeneratorKind};
use flexspline_make::{Provenance, TableData, WriteError, image_bytes, write_image};
use std::sync::LazyLock;

/// Numbers of a table, owned.
#[derive(Debug)]
pub struct Numbers {
    drive: Drive,
    torque: Vec<f32>,
    temperature: Vec<f32>,
    ripple_nodes: usize,
    mean: Vec<f32>,
    half: Vec<f32>,
    mean_ripple: Vec<f32>,
    half_ripple: Vec<f32>,
    curves: [Vec<f32>; 3],
    error_limit_rad: f32,
}

impl Numbers {
    /// Their image.
    ///
    /// # Errors
    /// Result of the writer.
    pub fn image(&self) -> Result<Vec<u8>, WriteError> {
        let [generator, material, output] = &self.curves;
        let ends = |axis: &[f32]| [axis.first().copied().unwrap_or(0.0), axis.last().copied().unwrap_or(0.0)];
        let data = TableData {
            drive: self.drive,
            torque_nodes_n_m: &self.torque,
            temperature_nodes_c: &self.temperature,
            ripple_nodes: self.ripple_nodes,
            mean_rad: &self.mean,
            half_width_rad: &self.half,
            mean_ripple_rad: &self.mean_ripple,
            half_width_ripple_rad: &self.half_ripple,
            generator_curve_rad: generator,
            material_curve_rad: material,
            output_curve_rad: output,
            projection_worst_rad: 0.0,
            projection_rms_rad: 0.0,
        };
        let provenance = Provenance {
            generator_kind: GeneratorKind::Other,
            drive_hash: [7; 32],
            tool_version: "fuzz",
            mesh_level: "none",
            solver_residual: 0.0,
            torque_range_n_m: ends(&self.torque),
            temperature_range_c: ends(&self.temperature),
            error_limit_rad: self.error_limit_rad,
        };
        let curves = self.curves.each_ref().map(Vec::len);
        let mut image = vec![0; image_bytes(self.torque.len(), self.temperature.len(), self.ripple_nodes, curves)];
        write_image(&data, &provenance, &mut image, |_| *b"fuzzfuzz")?;
        Ok(image)
    }

    /// Closed form: stiffness with play that changes sides at ±1.5 N·m, ripple, one harmonic to each curve.
    fn closed_form(drive: Drive, torque: &[f32], temperature: &[f32], ripple_nodes: usize, curves: [usize; 3]) -> Self {
        let records: Vec<[f32; 2]> = temperature.iter().flat_map(|&c| torque.iter().map(move |&t| [c, t])).collect();
        let warm = |c: f32| 1.0 + 1e-3 * (c - 20.0);
        let inside = |t: f32| t.abs() < 1.5;
        let side = |t: f32| if inside(t) { 0.0 } else { t.signum() };
        let wave =
            |nodes: usize, i: usize, shift: f64| (std::f64::consts::TAU * i as f64 / nodes as f64 + shift).sin() as f32;
        let ripple = |amplitude: f32, shift: f64| {
            records
                .iter()
                .flat_map(|_| (0..ripple_nodes).map(move |i| amplitude * wave(ripple_nodes, i, shift)))
                .collect()
        };
        let curve = |nodes: usize, amplitude: f32| (0..nodes).map(|i| amplitude * wave(nodes, 2 * i, 0.4)).collect();
        let [a, b, c] = curves;
        // What the ratio is made for: the slope of a curve over the generator counts ratio times.
        let gentle = 95.0 / drive.ratio().abs().max(95.0);
        Self {
            drive,
            torque: torque.to_vec(),
            temperature: temperature.to_vec(),
            ripple_nodes,
            mean: records.iter().map(|&[c, t]| warm(c) * (t / 3.0e4 + 1.4e-4 * side(t))).collect(),
            half: records.iter().map(|&[c, t]| warm(c) * if inside(t) { 1.9e-4 } else { 5e-5 }).collect(),
            mean_ripple: ripple(1.5e-6, 0.3),
            half_ripple: ripple(0.5e-6, -1.0),
            curves: [curve(a, 6e-5 * gentle), curve(b, 4e-5 * gentle), curve(c, 1e-4)],
            error_limit_rad: 0.02,
        }
    }

    /// Of anything, mostly of what the writer takes.
    pub fn any(choices: &mut Choices<'_>) -> Option<Self> {
        let drive = match choices.below(6) {
            0 => drive(190, 192, FixedMember::CircularSpline),
            1 => drive(1, 2, FixedMember::Flexspline),
            2 => drive(200, 203, FixedMember::CircularSpline),
            3 => drive(32_768, 65_535, FixedMember::Flexspline),
            4 => {
                let fixed = if choices.any() { FixedMember::Flexspline } else { FixedMember::CircularSpline };
                Drive::new(choices.any(), choices.any(), fixed).ok()?
            }
            _ => drive(188, 190, FixedMember::Flexspline),
        };
        let mut axis = |most: usize, scale: f64| {
            let mut nodes: Vec<f32> = (0..=choices.below(most)).map(|_| (scale * choices.part()) as f32).collect();
            if choices.below(3) == 0 {
                // A jump above the first.
                let next = nodes[0] + 0.01;
                nodes.push(next);
            }
            nodes.sort_by(f32::total_cmp);
            nodes.dedup();
            nodes
        };
        let (torque, temperature) = (axis(12, 60.0), axis(3, 90.0));
        let ripple_nodes = [0, 4, 5, 8, 16, 32][choices.below(6)];
        let records = torque.len() * temperature.len();
        // One scale for each part, small ones more often.
        let mut values = |count: usize, least: f64| -> Vec<f32> {
            let scale = 0.06 * 10f64.powi(-(choices.below(9) as i32));
            (0..count).map(|_| (scale * choices.part().max(least)) as f32).collect()
        };
        let (mut mean, half) = (values(records, -1.0), values(records, 0.0));
        // Rising with the load, or most would be refused.
        mean.chunks_mut(torque.len()).for_each(|mean| mean.sort_by(f32::total_cmp));
        let (mean_ripple, half_ripple) = (values(records * ripple_nodes, -1.0), values(records * ripple_nodes, -1.0));
        let counts = [0, 0, 4, 5, 9, 16, 64, 128];
        let (a, b, c) = (choices.below(8), choices.below(8), choices.below(8));
        let mut curve = |nodes: usize| {
            let scale = 0.06 * 10f64.powi(-(choices.below(9) as i32));
            (0..nodes).map(|_| (scale * choices.part()) as f32).collect()
        };
        let curves = [curve(counts[a]), curve(counts[b]), curve(counts[c])];
        let error_limit_rad = if choices.any() { 0.05 } else { choices.wild() };
        Some(Self {
            drive,
            torque,
            temperature,
            ripple_nodes,
            mean,
            half,
            mean_ripple,
            half_ripple,
            curves,
            error_limit_rad,
        })
    }
}

fn drive(flexspline: u16, circular_spline: u16, fixed: FixedMember) -> Drive {
    Drive::new(flexspline, circular_spline, fixed).expect("fewer teeth on the flexspline")
}

/// Torque nodes with jumps at ±1.5 N·m.
const JUMPS: [f32; 11] = [-50.0, -20.0, -5.0, -1.51, -1.49, 0.0, 1.49, 1.51, 5.0, 20.0, 50.0];

/// Images to start from: one node; every part and two temperatures; jumps; the circular spline fixed; more pages than a
/// store takes; a ratio of thirds.
pub static BASES: LazyLock<[Vec<u8>; 6]> = LazyLock::new(|| {
    let hhd_95 = drive(188, 190, FixedMember::Flexspline);
    let many: Vec<f32> = (-12..=12).map(|i| 4.0 * i as f32).collect();
    let warm: Vec<f32> = (0..8).map(|i| -40.0 + 20.0 * i as f32).collect();
    let form = Numbers::closed_form;
    [
        form(hhd_95, &[0.0], &[20.0], 0, [0; 3]),
        form(hhd_95, &[-4.0, 4.0], &[0.0, 40.0], 8, [4, 0, 5]),
        form(hhd_95, &JUMPS, &[-40.0, 20.0, 80.0], 16, [16, 16, 8]),
        form(drive(190, 192, FixedMember::CircularSpline), &JUMPS, &[20.0], 4, [0, 32, 0]),
        form(hhd_95, &many, &warm, 8, [16, 8, 8]),
        form(drive(200, 203, FixedMember::Flexspline), &JUMPS, &[0.0, 50.0], 8, [8, 8, 8]),
    ]
    .map(|numbers| numbers.image().expect("a table of a closed form"))
});

/// One of those that a store takes.
pub fn flying(choices: &mut Choices<'_>) -> &'static Vec<u8> {
    &BASES[[0, 1, 2, 3, 5][choices.below(5)]]
}

/// Torques and temperatures that the base images hold for.
pub fn hostile_axis(choices: &mut Choices<'_>, nodes: &[f32]) -> f32 {
    let node = nodes.get(choices.below(nodes.len().max(1))).copied().unwrap_or(0.0);
    match choices.below(6) {
        0 => choices.wild(),
        1 => node,
        2 => node.next_up(),
        3 => node.next_down(),
        _ => {
            let (low, high) = (nodes.first().copied().unwrap_or(0.0), nodes.last().copied().unwrap_or(0.0));
            low + (high - low) * (0.5 + 0.5 * choices.part()) as f32
        }
    }
}
