//! A compensation table sampled from a gear at rest: what a drive's table, an extended or a calibrated one knows of it.
//! And the other way round, the gear that a table describes.

use core::f64::consts::TAU;

use flexspline::{Direction, Drive, GeneratorAngle, GeneratorKind, Table};
use flexspline_make::{Harmonics, MissingDirection, Plan, ProjectError, Provenance, Sample, Workspace, make_image};

use super::gear::{Gear, GearLine, SampledSpring, Spring};
use super::noise::NoiseSource;

/// Nodes on each side of the dead zone, and how they crowd towards it: node k of n at `(k/n)^CROWDING` of the way.
const STEPS: usize = 12;
const CROWDING: f64 = 3.2;
/// Half the width of the pair of nodes that holds the jump at the drag, of the drag.
const JUMP_HALF_WIDTH: f64 = 0.05;
/// Nodes over a tooth pitch, and places on a pitch at nodes other than the first.
const RIPPLE_NODES: usize = 8;
const PLACES: usize = 64;
/// Places over the output turn at one node: a prime, so that no order folds onto another.
const PLACES_OF_A_TURN: usize = 997;
/// Orders of curves.
const ORDERS: [u16; 4] = [1, 2, 3, 4];
const OUTPUT_ORDERS: [u16; 2] = [1, 2];

/// Orders looked for in a table: of the generator, of its angle to the output, of the output.
const FOUND_ORDERS: [i32; 3] = [8, 8, 4];
/// Places over whole turns of the output at which they are looked for: a prime above what any of them turns by, with
/// their ripple.
const FOUND_PLACES: i32 = 8009;
/// Smaller lines than this are rounding of the table, rad: 0.002″.
const SMALLEST_LINE_RAD: f64 = 1e-8;

/// The sampled drive.
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

/// The image of a table; `id` makes its id of what is hashed for it.
///
/// # Errors
/// [`ProjectError`].
pub fn image(
    gear: &Gear,
    drive: Drive,
    sampling: &Sampling,
    id: impl FnOnce(&[u8]) -> [u8; 8],
) -> Result<Vec<u8>, ProjectError> {
    let torques = torques(sampling);
    let temperatures = [sampling.temperature_c as f32];
    let curve = |orders: &'static [u16]| Harmonics::of(if gear.lines.is_empty() { &[] } else { orders });
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
        deviation_limit_rad: f64::from(Table::MAX_ERROR_RAD),
    };
    let samples = samples(gear, sampling, &torques);
    let mut numbers = vec![0.0; plan.numbers_len() + plan.kept_len(samples.len())];
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
        error_limit_rad: (1.5 * largest + 1e-4).min(f64::from(Table::MAX_ERROR_RAD)) as f32,
    };
    let fit = make_image(&plan, &provenance, &samples, workspace, &mut image, id)?;
    image.truncate(fit.image_bytes);
    Ok(image)
}

/// The gear that a table describes at a temperature: with a load on it at rest it is where the table says that steady
/// motion ends on the flank which carries the load.
///
/// The table was made with a drag `drag_n_m`: what it has for backward motion under a load `T` is a flank that carries
/// `T + drag`. `None` if the table gives nothing at this temperature.
pub fn gear_of(table: &Table<'_>, temperature_c: f64, drag_n_m: f64) -> Option<Gear> {
    let ratio = table.drive().exact_ratio();
    let at = |generator_rad: f64, flank_n_m: f64| {
        let generator = GeneratorAngle::from_rad(generator_rad)?;
        let torque = (flank_n_m - drag_n_m).max(0.0) as f32;
        table.steady_error_rad(generator, torque, temperature_c as f32, Direction::Backward).map(f64::from)
    };
    let [_, largest] = table.torque_range_n_m().map(f64::from);
    at(0.0, largest)?;
    let lines = lines(table, |generator_rad| at(generator_rad, 0.5 * largest).unwrap_or(0.0));
    let mut gear =
        Gear { ratio, lines, spring: Spring::Cubic { half_clearance_rad: 0.0, stiffness: 0.0, hardening: 0.0 } };
    let teeth = f64::from(table.drive().ripple_order());
    let law = |phase: f64, flank_n_m: f64| {
        let generator_rad = TAU / teeth * phase;
        let [of_lines, ..] = gear.error(generator_rad, generator_rad / ratio);
        at(generator_rad, flank_n_m).unwrap_or(0.0) - of_lines
    };
    let spring = Spring::Sampled(Box::new(SampledSpring::of_law(teeth, largest, law)));
    gear.spring = spring;
    Some(gear)
}

/// Lines of an error over as many turns of the output as make all orders whole.
fn lines(table: &Table<'_>, error: impl Fn(f64) -> f64) -> Vec<GearLine> {
    let drive = table.drive();
    let ratio = drive.exact_ratio();
    let waves = i32::from(drive.circular_spline_teeth() - drive.flexspline_teeth());
    let sweep = TAU * f64::from(waves);
    let places: Vec<f64> = (0..FOUND_PLACES).map(|k| sweep * ratio * f64::from(k) / f64::from(FOUND_PLACES)).collect();
    let errors: Vec<f64> = places.iter().map(|&generator_rad| error(generator_rad)).collect();
    let [generator, material, output] = FOUND_ORDERS;
    let orders =
        (1..=generator).map(|k| (k, 0)).chain((1..=material).map(|k| (k, -k))).chain((1..=output).map(|k| (0, k)));
    let line = |(generator, output): (i32, i32)| {
        let (generator, output) = (f64::from(generator), f64::from(output));
        let (mut sine, mut cosine) = (0.0, 0.0);
        for (psi, error) in places.iter().zip(&errors) {
            let (s, c) = libm::sincos(generator * psi + output * psi / ratio);
            sine += error * s;
            cosine += error * c;
        }
        let scale = 2.0 / f64::from(FOUND_PLACES);
        let amplitude_rad = scale * libm::hypot(sine, cosine);
        GearLine { generator, output, amplitude_rad, phase_rad: libm::atan2(cosine, sine) }
    };
    orders.map(line).filter(|line| line.amplitude_rad > SMALLEST_LINE_RAD).collect()
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
    let mut noise = NoiseSource::new(77);
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

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline::FixedMember;

    /// A gear with a ripple and lines, its table, and the gear of that.
    #[test]
    fn the_gear_of_a_table_is_the_one_that_it_was_made_of() {
        let law = |phase: f64, flank: f64| {
            1.5e-4 + 3e-6 * flank + 4e-5 * flank / (1.0 + 0.2 * flank) + 2e-6 * libm::cos(TAU * phase + 0.3)
        };
        let line = |generator: f64, output: f64, amplitude_rad: f64, phase_rad: f64| GearLine {
            generator,
            output,
            amplitude_rad,
            phase_rad,
        };
        let lines = vec![line(2.0, 0.0, 4e-5, 0.3), line(4.0, -4.0, 2e-5, 1.0), line(0.0, 1.0, 5e-5, -2.0)];
        let gear =
            Gear { ratio: 95.0, lines, spring: Spring::Sampled(Box::new(SampledSpring::of_law(188.0, 60.0, law))) };
        let drive = Drive::new(188, 190, FixedMember::Flexspline).unwrap();
        let sampling = Sampling { largest_n_m: 50.0, drag_n_m: 0.02, temperature_c: 20.0, noise_rad: 0.0 };
        let image = image(&gear, drive, &sampling, |_| [0; 8]).unwrap();
        let found = gear_of(&Table::check(&image).unwrap(), 20.0, 0.02).unwrap();
        let (mut worst, mut most) = (0.0_f64, 0.0_f64);
        for k in 0..500 {
            let generator_rad = 7.3 * f64::from(k);
            for mesh_n_m in [-40.0, -3.0, -0.5, 0.5, 8.0, 45.0] {
                let [made, found] = [&gear, &found].map(|gear| gear.error_under_rad(generator_rad, mesh_n_m, mesh_n_m));
                worst = worst.max((found - made).abs());
                most = most.max(made.abs());
            }
        }
        println!("off by {:.3}\" of {:.0}\"", worst * 206_264.8, most * 206_264.8);
        // What a table of these nodes leaves: a curve of eight nodes in a period, and the wind-up between two nodes of
        // torque.
        assert!(worst < 2e-7, "{worst}");
    }
}
