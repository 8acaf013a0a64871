//! Made-up measurements of a drive with known effects: for tests of the diagnosis and for the command `synthesize`.
//!
//! The plant here shares no law with the candidates of the diagnosis: each effect comes in two forms of its own (the second with a
//! changed law), at a finer step where it has a state, under sensors with white noise and a wander of another kind than the one
//! the diagnosis assumes.

mod effect;
mod excitation;

pub use effect::{CAUSES, Effect, STRANGE};
pub use excitation::{Excitation, Plan, Richness};

use crate::measurement::Session;
use crate::nominal::Nominal;
use crate::tables::ARCSEC_PER_RAD;

/// How noisy the sensors are.
#[derive(Clone, Copy, Debug)]
pub struct Sensors {
    /// White noise, arcsec.
    pub white_arcsec: f64,
    /// Wander, arcsec rms.
    pub wander_arcsec: f64,
    /// Time scale of the wander, s.
    pub wander_s: f64,
}

/// A catalogue drive to hide effects in.
#[must_use]
pub fn catalogue_drive() -> Nominal {
    Nominal::from_toml(
        "built in",
        "[drive]\nflexspline_teeth = 188\ncircular_spline_teeth = 190\n[nominal]\nstiffness_n_m_per_rad = 30000.0\n\
         backlash_arcsec = 60.0\nfriction_torque_n_m = 1.5\n[[nominal.harmonic]]\norder_per_generator_turn = 2.0\n\
         amplitude_arcsec = 10.0\nphase_rad = 0.4\n[[nominal.harmonic]]\norder_per_generator_turn = 4.0\n\
         amplitude_arcsec = 3.0\nphase_rad = 1.1\n",
    )
    .expect("the built-in text is valid")
}

/// Sessions of a drive with `effects`; `law` 0 or 1 picks the form of each law.
#[must_use]
pub fn measure(
    nominal: &Nominal,
    effects: &[Effect],
    plan: &Plan,
    sensors: &Sensors,
    law: u8,
    random: &mut fastrand::Rng,
) -> Vec<Session> {
    let excitation = plan.excite(random);
    let gauss = |random: &mut fastrand::Rng| {
        let (u, v) = (random.f64().max(1e-12), random.f64());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    };
    let limited = |random: &mut fastrand::Rng| gauss(random).clamp(-2.5, 2.5);
    let spread = nominal.spread;
    let stiffness = 1.0 + spread.stiffness * limited(random);
    let backlash = 1.0 + spread.backlash * limited(random);
    let harmonics: Vec<(f64, f64)> = nominal
        .harmonics
        .iter()
        .map(|_| (1.0 + spread.harmonic * limited(random), spread.harmonic * 0.5 * limited(random)))
        .collect();
    let zero = 200.0 * (random.f64() - 0.5);
    let n = excitation.time.len();
    let mut error = vec![0.0; n];
    // Torque on the flanks, with what the torque column does not hold.
    let mut torque = excitation.torque.clone();
    for effect in effects {
        effect.add_torque(nominal, &excitation, &mut torque);
    }
    let half = effect::half_backlash(nominal, &excitation, effects, backlash, law);
    for session in &excitation.sessions {
        let mut side = 0.0;
        let mut last = 0.0;
        for k in session.clone() {
            let psi = excitation.generator[k];
            let x = psi / nominal.ratio * ARCSEC_PER_RAD;
            let moved = if k > session.start { x - last } else { 0.0 };
            last = x;
            if torque[k].abs() > nominal.friction_torque_n_m {
                side = half[k] * torque[k].signum();
            } else if law == 0 {
                side = f64::clamp(side, -half[k], half[k]);
            } else {
                side = f64::clamp(side - moved, -half[k], half[k]);
            }
            let kinematic: f64 = nominal
                .harmonics
                .iter()
                .zip(&harmonics)
                .map(|(h, (a, shift))| {
                    a * h.amplitude_arcsec * (h.order_per_generator_turn * psi + h.phase_rad + shift).sin()
                })
                .sum();
            error[k] = zero + kinematic + side + stiffness * nominal.wind_up_arcsec(torque[k]);
        }
    }
    for effect in effects {
        effect.add_error(nominal, &excitation, &torque, law, &mut error, random);
    }
    for session in &excitation.sessions {
        // Wander: slow sines of random phase and a second-order random walk.
        let waves: Vec<(f64, f64)> = (0..4)
            .map(|_| (std::f64::consts::TAU / (sensors.wander_s * (1.0 + 5.0 * random.f64())), 6.3 * random.f64()))
            .collect();
        for k in session.clone() {
            let slow: f64 = waves.iter().map(|(w, p)| (w * excitation.time[k] + p).sin()).sum::<f64>() / 2f64.sqrt();
            error[k] += sensors.white_arcsec * gauss(random) + sensors.wander_arcsec * slow;
            error[k] = (error[k] / 0.3).round() * 0.3;
        }
    }
    excitation
        .sessions
        .iter()
        .map(|s| Session {
            line: s.clone().map(|k| k as u64 + 2).collect(),
            time_s: Some(excitation.time[s.clone()].to_vec()),
            generator_rad: excitation.generator[s.clone()].to_vec(),
            error_rad: error[s.clone()].iter().map(|e| e / ARCSEC_PER_RAD).collect(),
            torque_n_m: Some(excitation.torque[s.clone()].to_vec()),
            temperature_c: Some(excitation.temperature[s.clone()].to_vec()),
            orientation_rad: Some(excitation.orientation[s.clone()].to_vec()),
        })
        .collect()
}
