//! Made-up measurements of a drive with known effects: for tests of the diagnosis and for the command `synthesize`.
//!
//! The plant here shares no law with the candidates of the diagnosis: each effect comes in two forms of its own (the
//! second with a changed law, for tests), at a finer step where it has a state, under sensors with white noise and a
//! wander of another kind than the one the diagnosis assumes.
//!
//! * [`effects`]: the effects by name, their parameters with units, ranges and defaults; [`parse`] reads
//!   `NAME:param=value,...`.
//! * [`Plant`]: nominal drive (a table made by FEM, or a catalogue's model) and the [`Unit`] measured.
//! * [`Excitation`]: how it is driven, made up by a [`Plan`] or taken from measured sessions.
//! * [`synthesize`]: all of it to sessions, and what is true of them.

mod catalogue;
mod data_fault;
#[cfg(test)]
mod effect;
mod excitation;
mod law;
mod plant;

pub use catalogue::{Chosen, Definition, Hidden, effects, parse};
pub use data_fault::to_csv;
#[cfg(test)]
pub(crate) use effect::{Effect, Strange, What, measure};
pub use excitation::{Excitation, Plan, Richness};
pub use plant::{Plant, Unit};

use catalogue::Setting;
use law::Law;

use crate::measurement::Session;
use crate::nominal::Nominal;
use flexspline_base::units::ARCSEC_PER_RAD;
use plant::gauss;

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

/// White noise of the torque sensor, of the largest torque, and of the thermometer, K.
const TORQUE_NOISE: f64 = 5e-4;
const TEMPERATURE_NOISE_K: f64 = 0.02;

/// A catalogue drive to hide effects in.
#[must_use]
pub fn catalogue_drive() -> Nominal {
    Nominal::from_toml(
        "built in",
        "[drive]\nflexspline_teeth = 188\ncircular_spline_teeth = 190\n[nominal]\nstiffness_n_m_per_rad = \
         30000.0\nbacklash_arcsec = 60.0\nfriction_torque_n_m = 1.5\n[[nominal.harmonic]]\norder_per_generator_turn = \
         2.0\namplitude_arcsec = 10.0\nphase_rad = 0.4\n[[nominal.harmonic]]\norder_per_generator_turn = \
         4.0\namplitude_arcsec = 3.0\nphase_rad = 1.1\n",
    )
    .expect("the built-in text is valid")
}

/// Adds white noise and wander: slow sines of random phase.
fn add_noise(on: &Excitation, sensors: &Sensors, error: &mut [f64], random: &mut fastrand::Rng) {
    for session in &on.sessions {
        let waves: Vec<(f64, f64)> = (0..4)
            .map(|_| (std::f64::consts::TAU / (sensors.wander_s * (1.0 + 5.0 * random.f64())), 6.3 * random.f64()))
            .collect();
        for k in session.clone() {
            let slow: f64 = waves.iter().map(|(w, p)| (w * on.time[k] + p).sin()).sum::<f64>() / 2f64.sqrt();
            error[k] += sensors.white_arcsec * gauss(random) + sensors.wander_arcsec * slow;
        }
    }
}

/// Sessions of an excitation with the error, arcsec.
fn into_sessions(on: &Excitation, error: &[f64]) -> Vec<Session> {
    on.sessions
        .iter()
        .map(|s| Session {
            line: s.clone().map(|k| k as u64 + 2).collect(),
            time_s: Some(on.time[s.clone()].to_vec()),
            generator_rad: on.generator[s.clone()].to_vec(),
            error_rad: error[s.clone()].iter().map(|e| e / ARCSEC_PER_RAD).collect(),
            torque_n_m: Some(on.torque[s.clone()].to_vec()),
            temperature_c: Some(on.temperature[s.clone()].to_vec()),
            orientation_rad: Some(on.orientation[s.clone()].to_vec()),
            ..Session::default()
        })
        .collect()
}

/// Size of the drive, where amplitudes are given in micrometres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sizes {
    /// Radius of the pitch circle, mm: an arc on it turns the output.
    pub pitch_radius_mm: f64,
    /// Radius of the base circle, mm: a displacement along the normal of a flank turns the output.
    pub base_radius_mm: f64,
}

/// A made-up measurement.
#[derive(Clone, Debug)]
pub struct Synthesized {
    /// Rows, as the sensors read them, data faults not yet in them.
    pub sessions: Vec<Session>,
    /// The unit that was measured.
    pub unit: Unit,
    /// The effects with the value of every parameter, in the order given.
    pub effects: Vec<Chosen>,
}

/// The law of a completed effect; a fault of the data has none.
fn law_of(effect: &Chosen, setting: &Setting<'_>) -> Option<Law> {
    match effect.definition.what {
        Hidden::Cause(cause) => Some(Law::of(cause, effect, setting)),
        Hidden::Fault(_) => None,
    }
}

/// What `chosen` effects add to the error of a nominal drive under an excitation, without sensors, row by row, arcsec.
/// Parameters that are not given take their default; nothing is drawn.
///
/// # Errors
/// As [`synthesize`].
pub(crate) fn added_arcsec(
    plant: &Plant<'_>,
    sizes: Sizes,
    chosen: &[Chosen],
    on: &Excitation,
) -> Result<Vec<f64>, String> {
    let setting = Setting { nominal: plant.nominal, sizes, on, load_n_m: law::largest(&on.torque) };
    let mut same = fastrand::Rng::with_seed(0);
    let effects = chosen.iter().map(|effect| effect.completed(&setting, &mut same)).collect::<Result<Vec<_>, _>>()?;
    let mut laws: Vec<Law> = effects.iter().filter_map(|effect| law_of(effect, &setting)).collect();
    laws.sort_by_key(Law::stage);
    let unit = Unit::nominal(plant.nominal);
    let error = |laws: &[Law]| {
        let torque = plant.flank_torque(on, laws);
        let mut error = plant.error(on, &torque, laws, &unit, (false, true));
        plant.add_laws(on, &torque, laws, false, &mut error);
        error
    };
    Ok(error(&laws).iter().zip(error(&[])).map(|(with, without)| with - without).collect())
}

/// Measures a drive with `chosen` effects: the output encoder as `sensors` say, and a torque sensor and a thermometer
/// with a little noise. `encoder_bits` is the resolution of the output encoder, bits to a turn.
///
/// # Errors
/// A parameter that does not fit the excitation, such as a time outside it.
pub fn synthesize(
    plant: &Plant<'_>,
    sizes: Sizes,
    chosen: &[Chosen],
    on: &Excitation,
    (sensors, encoder_bits): (&Sensors, u32),
    unit: Unit,
    random: &mut fastrand::Rng,
) -> Result<Synthesized, String> {
    let setting = Setting { nominal: plant.nominal, sizes, on, load_n_m: law::largest(&on.torque) };
    let effects = chosen.iter().map(|effect| effect.completed(&setting, random)).collect::<Result<Vec<_>, _>>()?;
    let mut laws: Vec<Law> = effects.iter().filter_map(|effect| law_of(effect, &setting)).collect();
    laws.sort_by_key(Law::stage);
    let torque = plant.flank_torque(on, &laws);
    let mut error = plant.error(on, &torque, &laws, &unit, (false, true));
    plant.add_laws(on, &torque, &laws, false, &mut error);
    add_noise(on, sensors, &mut error, random);
    // The encoder counts the output angle, not the error.
    let step = flexspline_base::units::ARCSEC_PER_TURN / 2f64.powi(encoder_bits as i32);
    for (error, generator) in error.iter_mut().zip(&on.generator) {
        let nominal = generator / plant.nominal.ratio * ARCSEC_PER_RAD;
        *error = ((nominal + *error) / step).round() * step - nominal;
    }
    let mut sessions = into_sessions(on, &error);
    // No sensor repeats a value to the last digit, even while what it measures stands.
    for session in &mut sessions {
        let load = TORQUE_NOISE * setting.load_n_m;
        session.torque_n_m.iter_mut().flatten().for_each(|t| *t += load * gauss(random));
        session.temperature_c.iter_mut().flatten().for_each(|t| *t += TEMPERATURE_NOISE_K * gauss(random));
    }
    Ok(Synthesized { sessions, unit, effects })
}
