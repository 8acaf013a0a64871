//! Effects that can be hidden in made-up data.

use std::f64::consts::{PI, TAU};

use super::excitation::Excitation;
use crate::nominal::Nominal;
use crate::tables::ARCSEC_PER_RAD;

/// Causes of the library that can be hidden.
pub const CAUSES: [&str; 24] = [
    "circular_spline_eccentricity",
    "flexspline_runout",
    "circular_spline_ovality",
    "flexspline_pitch_error",
    "circular_spline_pitch_error",
    "generator_eccentricity",
    "cam_form_error",
    "damaged_tooth",
    "backlash_growth",
    "wear",
    "stiffness_hardening",
    "stiffness_error",
    "torsional_hysteresis",
    "thermal_clearance",
    "thermal_stiffness",
    "lubricant_viscosity",
    "gravity_torque",
    "gravity_side_load",
    "torsional_resonance",
    "output_encoder_eccentricity",
    "generator_encoder_eccentricity",
    "sensor_latency",
    "ratio_error",
    "ratcheting",
];

/// Effects that are in no library.
pub const STRANGE: [&str; 8] = [
    "sensor_offset_with_temperature",
    "line_of_order_7",
    "line_of_order_10.37",
    "line_in_time",
    "creep",
    "oldham_lash",
    "torque_cross_talk",
    "settling",
];

/// An effect with its size and phase.
#[derive(Clone, Debug)]
pub struct Effect {
    /// Name.
    pub name: String,
    /// Amplitude at the output, arcsec; for the rest what the name says.
    pub size: f64,
    /// Phase, rad, or a second number between 0 and 2π.
    pub phase: f64,
    /// A number between 0 and 1 for what else the law needs.
    pub other: f64,
}

impl Effect {
    /// Draws an effect of a visible size.
    #[must_use]
    pub fn draw(name: &str, random: &mut fastrand::Rng) -> Effect {
        let mut between = |low: f64, high: f64| low * (high / low).powf(random.f64());
        let size = match name {
            "thermal_clearance" => between(0.5, 2.0),
            "thermal_stiffness" => between(0.002, 0.008),
            "stiffness_error" => between(0.15, 0.4),
            "backlash_growth" => between(0.25, 1.2),
            "gravity_torque" => between(3.0, 25.0),
            "torsional_resonance" => between(3.0, 25.0),
            "sensor_latency" => between(0.6, 8.0),
            "ratio_error" => between(3.0, 100.0),
            "ratcheting" => 1.0,
            "wear" | "damaged_tooth" => between(15.0, 60.0),
            _ => between(5.0, 40.0),
        };
        Effect { name: name.to_owned(), size, phase: TAU * random.f64(), other: random.f64() }
    }

    /// Torque that the torque column does not hold.
    pub fn add_torque(&self, nominal: &Nominal, on: &Excitation, torque: &mut [f64]) {
        if self.name == "gravity_torque" {
            for k in 0..torque.len() {
                torque[k] += self.size * (on.generator[k] / nominal.ratio + on.orientation[k] + self.phase).sin();
            }
        }
    }

    /// Adds what the effect does to the error, arcsec.
    pub fn add_error(
        &self,
        nominal: &Nominal,
        on: &Excitation,
        torque: &[f64],
        law: u8,
        error: &mut [f64],
        random: &mut fastrand::Rng,
    ) {
        let n = error.len();
        let (size, phase, other) = (self.size, self.phase, self.other);
        let changed = law == 1;
        let top = torque.iter().fold(1e-9, |m: f64, t| m.max(t.abs()));
        let psi = |k: usize| on.generator[k];
        let delta = |k: usize| on.generator[k] / nominal.ratio;
        let theta = |k: usize| psi(k) - delta(k);
        let side = |k: usize| if torque[k] >= 0.0 { 1.0 } else { -1.0 };
        let speed = |k: usize| {
            let session = on.sessions.iter().find(|s| s.contains(&k)).expect("every row has a session");
            let (a, b) = (k.max(session.start + 1) - 1, (k + 1).min(session.end - 1));
            (psi(b) - psi(a)) / (on.time[b] - on.time[a])
        };
        let half_load = top * (0.1 + 0.5 * other);
        let fade = |k: usize| {
            let x = torque[k].abs() / half_load;
            if changed { (-0.7 * x).exp() * 0.8 + 0.2 } else { 1.0 / (1.0 + x) }
        };
        // 0.424 of e/(r cos a) is the second order.
        let rectified = |angle: f64, k: usize| {
            let s = (angle - phase + 0.36 * side(k)).sin();
            let shape = if changed { (s * s + 0.03).sqrt() } else { s.abs() };
            -side(k) * size / 0.424 * shape * fade(k)
        };
        match self.name.as_str() {
            "circular_spline_eccentricity" => (0..n).for_each(|k| error[k] += rectified(theta(k), k)),
            "flexspline_runout" => (0..n).for_each(|k| error[k] += rectified(psi(k), k)),
            "gravity_side_load" => (0..n).for_each(|k| error[k] += rectified(psi(k) + on.orientation[k], k)),
            "circular_spline_ovality" => (0..n).for_each(|k| {
                let more = if changed { 1.0 + 0.15 * side(k) } else { 1.0 };
                error[k] += more * size * (2.0 * theta(k) + phase).cos();
            }),
            "flexspline_pitch_error" | "circular_spline_pitch_error" => {
                let orders: Vec<(f64, f64, f64)> = [2.0, 1.0, 3.0, 4.0]
                    .into_iter()
                    .enumerate()
                    .map(|(j, o)| {
                        let a = if j == 0 { 1.0 } else { (0.2 + 0.4 * random.f64()) * if changed { 1.3 } else { 1.0 } };
                        (o, size * a, TAU * random.f64())
                    })
                    .collect();
                let fs = self.name.starts_with("flex");
                for k in 0..n {
                    let x = if fs { psi(k) } else { theta(k) };
                    error[k] += orders.iter().map(|(o, a, p)| a * (o * x + p).cos()).sum::<f64>();
                }
            }
            "generator_eccentricity" => (0..n).for_each(|k| {
                let one = (psi(k) + phase).cos() + if changed { 0.3 } else { 0.7 } * (theta(k) + 2.0 * phase).cos();
                error[k] += size * fade(k) * one;
            }),
            "cam_form_error" => (0..n).for_each(|k| {
                let mesh = (188.0 * psi(k) + phase + 0.4 * side(k)).cos();
                let lobes = (4.0 * psi(k) + 2.0 * phase).cos() + 0.5 * (6.0 * psi(k) + 3.0 * phase).cos();
                let share = if changed { 0.4 } else { 0.8 };
                error[k] += size * ((1.0 - share) * mesh + share * lobes) * (1.0 + 0.2 * torque[k].abs() / top);
            }),
            "damaged_tooth" => {
                let width = 0.06 + 0.2 * other;
                let fs = phase > PI;
                for k in 0..n {
                    let x = if fs { psi(k) } else { theta(k) };
                    let away = (x - phase + 0.5 * PI).rem_euclid(PI) - 0.5 * PI;
                    let pulse = if changed {
                        (1.0 - (away / (1.6 * width)).abs()).max(0.0)
                    } else {
                        (-0.5 * (away / width).powi(2)).exp()
                    };
                    let load = if changed { torque[k].abs() / top } else { (torque[k].abs() / top).sqrt() };
                    // One flank is damaged.
                    if torque[k] > 0.0 || other > 0.7 {
                        error[k] -= side(k) * size * pulse * load;
                    }
                }
            }
            // Play and torque carry these.
            "wear" | "backlash_growth" | "thermal_clearance" | "gravity_torque" => {}
            "stiffness_hardening" => (0..n).for_each(|k| {
                let u: f64 = torque[k] / top;
                error[k] -= size * u.signum() * if changed { (u.abs() - 0.3).max(0.0) * 1.4 } else { u.abs().powi(3) };
            }),
            "stiffness_error" => (0..n).for_each(|k| error[k] += size * nominal.wind_up_arcsec(torque[k])),
            "thermal_stiffness" => (0..n).for_each(|k| {
                let dt = on.temperature[k] - nominal.temperature_c;
                let factor = if changed { (1.3 * size * dt).exp() - 1.0 } else { size * dt };
                error[k] += factor * nominal.wind_up_arcsec(torque[k]);
            }),
            "torsional_hysteresis" => {
                let yields = top * (0.08 + 0.3 * other);
                for session in &on.sessions {
                    let mut z = 0.0;
                    let mut zs = [0.0; 4];
                    for k in session.clone() {
                        let step = if k > session.start { torque[k] - torque[k - 1] } else { torque[k] };
                        if changed {
                            // Bouc-Wen at a fiftieth of the step.
                            for _ in 0..50 {
                                let d = step / 50.0 / yields;
                                z += d - 0.5 * d.abs() * z - 0.5 * d * f64::abs(z);
                            }
                            error[k] -= size * z;
                        } else {
                            for (j, z) in zs.iter_mut().enumerate() {
                                let slip = yields * (0.4 + 0.5 * j as f64);
                                *z = f64::clamp(*z + step, -slip, slip);
                                error[k] -= size * *z / slip / 4.0;
                            }
                        }
                    }
                }
            }
            "lubricant_viscosity" => {
                let fastest = (0..n).map(|k| speed(k).abs()).fold(1e-9, f64::max);
                for k in 0..n {
                    let t = on.temperature[k];
                    let thick = if changed {
                        // Vogel, 1 at 20 °C.
                        (420.0 / (t + 110.0) - 420.0 / 130.0).exp()
                    } else {
                        (-0.035 * (t - 20.0)).exp()
                    };
                    let power = if changed { 0.9 } else { 2.0 / 3.0 };
                    let w = speed(k);
                    error[k] -= 0.5 * size * (w / fastest).abs().powf(power) * w.signum() * thick.powf(power.max(0.7));
                }
            }
            "torsional_resonance" => {
                // Load on the drive's spring, forty steps to a row.
                let (omega, zeta) = (TAU * size, if changed { 0.15 } else { 0.02 + 0.06 * other });
                let driven: Vec<f64> = error.to_vec();
                for session in &on.sessions {
                    let first = session.start;
                    let (mut x, mut v) = (driven[first], 0.0);
                    for k in first + 1..session.end {
                        let dt = (on.time[k] - on.time[k - 1]) / 40.0;
                        for j in 0..40 {
                            let u = driven[k - 1] + (driven[k] - driven[k - 1]) * (f64::from(j) + 0.5) / 40.0;
                            let slope = (driven[k] - driven[k - 1]) / (40.0 * dt);
                            let a =
                                omega * omega * (u - x) - 2.0 * zeta * omega * (v - if changed { 0.0 } else { slope });
                            v += a * dt;
                            x += v * dt;
                        }
                        error[k] = x;
                    }
                }
            }
            "output_encoder_eccentricity" => (0..n).for_each(|k| {
                let x = delta(k) + phase;
                error[k] += size * (x.sin() + if changed { 0.1 * (2.0 * x + 1.0).sin() } else { 0.0 });
            }),
            "generator_encoder_eccentricity" => (0..n).for_each(|k| {
                let x = psi(k) + phase;
                error[k] += 0.4 * size * (x.sin() + if changed { 0.1 * (2.0 * x + 1.0).sin() } else { 0.0 });
            }),
            "sensor_latency" => (0..n).for_each(|k| {
                error[k] -= size * 1e-3 * speed(k) / nominal.ratio * ARCSEC_PER_RAD;
            }),
            "ratio_error" => (0..n).for_each(|k| error[k] += size * 1e-6 * delta(k) * ARCSEC_PER_RAD * 3.0),
            "ratcheting" => {
                let at = (n as f64 * (0.2 + 0.6 * other)) as usize;
                let pitch = 1_296_000.0 / 190.0;
                error[at..].iter_mut().for_each(|e| *e -= pitch * if phase > 4.0 { 2.0 } else { 1.0 });
            }
            "sensor_offset_with_temperature" => {
                (0..n).for_each(|k| error[k] += size / 25.0 * (on.temperature[k] - 20.0));
            }
            "line_of_order_7" => (0..n).for_each(|k| error[k] += size * (7.0 * psi(k) + phase).sin()),
            "line_of_order_10.37" => (0..n).for_each(|k| error[k] += size * (10.37 * psi(k) + phase).sin()),
            "line_in_time" => (0..n).for_each(|k| error[k] += size * (TAU * (0.3 + 3.0 * other) * on.time[k]).sin()),
            "creep" => {
                for session in &on.sessions {
                    for k in session.clone() {
                        error[k] += size * (1.0 + on.time[k] - on.time[session.start]).ln() / 2.0;
                    }
                }
            }
            "oldham_lash" => (0..n).for_each(|k| error[k] += size * speed(k).signum()),
            "torque_cross_talk" => (0..n).for_each(|k| error[k] += size * (torque[k] / top).powi(2)),
            "settling" => {
                for session in &on.sessions {
                    for k in session.clone() {
                        error[k] += 2.0 * size * (-(on.time[k] - on.time[session.start]) / (8.0 + 20.0 * other)).exp();
                    }
                }
            }
            other => unreachable!("no effect {other}"),
        }
    }
}

/// Half the clearance in each row, with what widens it.
pub(super) fn half_backlash(nominal: &Nominal, on: &Excitation, effects: &[Effect], unit: f64, law: u8) -> Vec<f64> {
    let n = on.time.len();
    let mut half = vec![0.5 * nominal.backlash_arcsec * unit; n];
    for effect in effects {
        match effect.name.as_str() {
            "backlash_growth" => half.iter_mut().for_each(|h| *h += 0.5 * nominal.backlash_arcsec * effect.size),
            "wear" => {
                let mut travel = vec![0.0; n];
                for session in &on.sessions {
                    for k in session.clone() {
                        let step = if k > session.start { (on.generator[k] - on.generator[k - 1]).abs() } else { 0.0 };
                        let load = if law == 1 { 0.3 + on.torque[k].abs() / 50.0 } else { 1.0 };
                        travel[k] = if k > 0 { travel[k - 1] } else { 0.0 } + step * load;
                    }
                }
                let all = travel[n - 1].max(1e-9);
                for k in 0..n {
                    half[k] += 0.5 * effect.size * travel[k] / all;
                }
            }
            "thermal_clearance" => {
                let lag = if law == 1 { 20.0 } else { 0.01 };
                for session in &on.sessions {
                    let mut felt = on.temperature[session.start];
                    for k in session.clone() {
                        let dt = if k > session.start { on.time[k] - on.time[k - 1] } else { 0.0 };
                        felt += (on.temperature[k] - felt) * (dt / lag).min(1.0);
                        half[k] -= 0.5 * effect.size * (felt - nominal.temperature_c);
                    }
                }
            }
            _ => {}
        }
    }
    half.iter_mut().for_each(|h| *h = h.max(0.0));
    half
}
