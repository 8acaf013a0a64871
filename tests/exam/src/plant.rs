//! The plant: steps through a run and says what the two encoders would read without noise.

use crate::ARCSEC;
use crate::cause::Cause;
use crate::drive::{Drive, Fixed, Unit};
use crate::effect::{Effect, Family, What};
use crate::laws::{self, Law, Mesh, Now, Setting};
use crate::motion::{Motion, hermite};
use crate::outside;

/// Readings at the rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Readings {
    /// Generator encoder.
    pub generator_rad: Vec<f64>,
    /// Output encoder.
    pub output_rad: Vec<f64>,
    /// Output reading less generator reading over the ratio: what the diagnosis has to explain, without noise.
    pub error_arcsec: Vec<f64>,
}

/// Time in which a free-running clock falls behind by one cycle of the bus, s.
const BEAT_S: f64 = 7.3;

/// Runs the plant.
pub fn run(drive: &Drive, unit: &Unit, motion: &Motion, effects: &[Effect]) -> Readings {
    let setting = Setting { drive, unit, motion };
    let mut laws: Vec<Box<dyn Law>> = effects
        .iter()
        .map(|effect| match effect.what {
            What::Cause(_) => laws::build(effect, setting),
            What::Outside(_) => outside::build(effect, setting),
        })
        .collect();
    let count = motion.time_s.len();
    let ratio = drive.ratio();
    let clearance = drive.backlash_arcsec * unit.backlash;
    let friction = drive.friction_torque_n_m * unit.friction;
    let lines: Vec<_> = drive
        .harmonics
        .iter()
        .zip(&unit.harmonics)
        .map(|(line, (scale, shift))| (line.order, line.amplitude_arcsec * scale, line.phase_rad + shift))
        .collect();
    let press_per_n_m = ARCSEC / (drive.first_stiffness() * unit.stiffness * unit.tooth_stiffness);
    let (first, last) = (motion.time_s[0], motion.time_s[count - 1]);

    let mut deviation = vec![0.0; count];
    let mut generator_reading = vec![0.0; count];
    // Position at which the output rests inside the clearance.
    let mut rest: Option<f64> = None;
    let mut output_rad = motion.generator_rad[0] / ratio;
    let mut flank = 0.0;
    let mut sessions = motion.session_start.iter().copied().peekable();
    for at in 0..count {
        let starts = sessions.next_if_eq(&at).is_some();
        let generator_rad = motion.generator_rad[at];
        let exact = generator_rad / ratio * ARCSEC;
        let (on_flexspline_rad, on_circular_spline_rad) = match drive.fixed {
            Fixed::Flexspline => (generator_rad, generator_rad - output_rad),
            Fixed::CircularSpline => (generator_rad - output_rad, generator_rad),
        };
        let mut now = Now {
            step_s: motion.step_s,
            gap_s: starts.then(|| if at == 0 { 0.0 } else { motion.time_s[at] - motion.time_s[at - 1] }),
            at,
            time_s: motion.time_s[at],
            elapsed: (motion.time_s[at] - first) / (last - first),
            generator_rad,
            speed_rad_s: motion.speed_rad_s[at],
            output_rad,
            driven_arcsec: exact,
            on_flexspline_rad,
            on_circular_spline_rad,
            torque_n_m: motion.torque_n_m[at],
            load_n_m: motion.torque_n_m[at],
            temperature_c: motion.temperature_c[at],
            orientation_rad: motion.orientation_rad[at],
            flank,
        };
        let unseen: f64 = laws.iter_mut().map(|law| law.load(&now)).sum();
        now.load_n_m += unseen;
        let load = now.load_n_m;

        let mut mesh = Mesh { clearance, ..Mesh::default() };
        for (order, amplitude, phase) in &lines {
            mesh.driven += amplitude * (order * generator_rad + phase).sin();
        }
        for law in &mut laws {
            law.mesh(&now, &mut mesh);
        }
        let (low, high) = mesh.zones.limits(mesh.clearance.max(0.0), load * press_per_n_m, unit.family);
        let driven = exact + mesh.driven;
        let held = rest.map_or(driven, |rest| rest.clamp(driven + low, driven + high));
        let position = if load > friction {
            driven + high
        } else if load < -friction {
            driven + low
        } else {
            held
        };
        flank = if position >= driven + high - 1e-9 {
            1.0
        } else if position <= driven + low + 1e-9 {
            -1.0
        } else {
            0.0
        };
        rest = Some(position);
        let mut moved = position - exact + drive.wind_up_arcsec(load) / unit.stiffness + mesh.wind_up;
        for law in &mut laws {
            moved += law.output(&now, moved);
        }
        output_rad = (exact + moved) / ARCSEC;
        now.output_rad = output_rad;
        let mut read = moved + unit.offset_arcsec;
        for law in &mut laws {
            read += law.reading(&now, moved);
            generator_reading[at] += law.generator_reading(&now);
        }
        deviation[at] = read;
    }

    let delays: Vec<_> = effects.iter().filter(|effect| effect.what == What::Cause(Cause::SensorLatency)).collect();
    let rows = motion.picks(motion.stride);
    let mut readings = Readings {
        generator_rad: Vec::with_capacity(rows.len()),
        output_rad: Vec::with_capacity(rows.len()),
        error_arcsec: Vec::with_capacity(rows.len()),
    };
    let mut begins = 0;
    for at in rows {
        if motion.session_start.binary_search(&at).is_ok() {
            begins = at;
        }
        let elapsed = (motion.time_s[at] - first) / (last - first);
        let delay_s: f64 = delays
            .iter()
            .map(|effect| match effect.family {
                Family::A => effect.size,
                // The clocks drift apart as well.
                Family::B => effect.size * (1.0 + effect.shape[0] * (2.0 * elapsed - 1.0)),
                // Two clocks that run free: the age of a reading sweeps through the cycle of the bus, again and again.
                Family::C => effect.size * (1.0 + effect.shape[0] * (2.0 * (motion.time_s[at] / BEAT_S).fract() - 1.0)),
            })
            .sum();
        // Positive: the output's reading is old; negative: the generator's.
        let (mut output, mut generator) = (
            deviation[at] + motion.generator_rad[at] / ratio * ARCSEC,
            motion.generator_rad[at] + generator_reading[at],
        );
        if delay_s != 0.0 {
            let (angle, read, own) = earlier(motion, &deviation, &generator_reading, at, begins, delay_s.abs());
            if delay_s > 0.0 {
                output = read + angle / ratio * ARCSEC;
            } else {
                generator = angle + own;
            }
        }
        readings.generator_rad.push(generator);
        readings.output_rad.push(output / ARCSEC);
        readings.error_arcsec.push(output - generator / ratio * ARCSEC);
    }
    readings
}

/// Generator angle, deviation of the output and error of the generator's reading some time before a point; before the
/// session began the drive turned at its first speed.
fn earlier(motion: &Motion, deviation: &[f64], own: &[f64], at: usize, begins: usize, by_s: f64) -> (f64, f64, f64) {
    let back = by_s / motion.step_s;
    let whole = back.ceil() as usize;
    if at < begins + whole {
        return (motion.generator_rad[at] - motion.speed_rad_s[at] * by_s, deviation[at], own[at]);
    }
    let (from, x) = (at - whole, whole as f64 - back);
    let mix = |values: &[f64]| values[from] + x * (values[from + 1] - values[from]);
    (hermite(motion, from, x).0, mix(deviation), mix(own))
}

#[cfg(test)]
mod tests;
