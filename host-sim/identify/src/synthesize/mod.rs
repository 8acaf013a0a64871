//! Made-up measurements of a drive with known effects: for the command `synthesize` and for tests.
//!
//! A cause is hidden by the law that the diagnosis fits: what is found may be held against what was hidden, parameter
//! by parameter. Data whose laws are others are those of the examination (`tests/exam`).
//!
//! * [`effects`]: the effects by name, their parameters with units, ranges and defaults; [`parse`] reads
//!   `NAME:param=value,...`.
//! * [`MotionPlan`]: how the drive is driven, made up; [`completed`] takes it from measured sessions.
//! * [`DrawnUnit`]: what one drive has that its drawing has not.
//! * [`synthesize`]: all of it to sessions, and what is true of them.

mod catalogue;
mod data_fault;
mod excitation;

pub use catalogue::{Definition, Effect, EffectError, effects, parse};
pub use data_fault::to_csv;
pub use excitation::{MotionPlan, completed, within_temperatures};

use flexspline::Table;
use flexspline_mechanics::drive::Drive;
use serde::Serialize;

use catalogue::Setting;

use crate::causes::CauseName;
use crate::diagnosis::base::{Base, PlayLaw};
use crate::diagnosis::candidate::{Acting, Excitation, LawUnits, Simulated, added};
use crate::diagnosis::rows::{Rows, add_scaled};
use crate::measurement::Session;
use crate::nominal::Nominal;
use flexspline_base::units::{ARCSEC_PER_RAD, ARCSEC_PER_TURN};

/// How noisy the sensors are.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Sensors {
    /// White noise, arcsec.
    #[serde(rename = "noise_arcsec")]
    pub white_arcsec: f64,
    /// Wander, arcsec rms.
    pub wander_arcsec: f64,
    /// Time scale of the wander, s.
    #[serde(skip)]
    pub wander_s: f64,
    /// Resolution of the output encoder, bits to a turn.
    pub encoder_bits: u32,
}

impl Sensors {
    /// Sensors without noise, whose wander, if there is any, takes some seconds. *Guess*.
    pub const USUAL: Sensors = Sensors { white_arcsec: 0.0, wander_arcsec: 0.0, wander_s: 12.0, encoder_bits: 22 };
}

/// Rows of a made-up run per second. *Guess*.
pub const RATE_HZ: f64 = 100.0;

/// White noise of the torque sensor, of the largest torque. *Guess*.
const TORQUE_NOISE: f64 = 5e-4;
/// White noise of the thermometer, K. *Guess*.
const TEMPERATURE_NOISE_K: f64 = 0.02;
/// How the flank of a made-up drive changes below friction.
const PLAY: PlayLaw = PlayLaw::Pushed;
/// Units beyond this many standard deviations are not sold. *Guess*.
const WORST_UNIT: f64 = 2.5;

/// A catalogue drive to hide effects in.
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

/// Size of the drive, where amplitudes are given in micrometres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sizes {
    /// Radius of the pitch circle, mm: an arc on it turns the output.
    pub pitch_radius_mm: f64,
    /// Radius of the base circle, mm: a displacement along the normal of a flank turns the output.
    pub base_radius_mm: f64,
}

impl Sizes {
    /// Those of a drive.
    pub fn of(drive: &Drive) -> Sizes {
        let wheel = &drive.circular_spline;
        Sizes { pitch_radius_mm: wheel.pitch_radius_mm(), base_radius_mm: wheel.base_radius_mm() }
    }
}

/// One unit: its deviations from the drawing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DrawnUnit {
    /// Wind-up over nominal.
    #[serde(rename = "wind_up_over_nominal")]
    pub wind_up: f64,
    /// Clearance over nominal.
    #[serde(rename = "clearance_over_nominal")]
    pub clearance: f64,
    /// The drive with these factors, and harmonics of its own.
    #[serde(skip)]
    drive: Nominal,
    /// Zero of the output encoder, arcsec.
    pub zero_arcsec: f64,
}

impl DrawnUnit {
    /// The drawing.
    pub fn nominal(nominal: &Nominal) -> DrawnUnit {
        DrawnUnit { wind_up: 1.0, clearance: 1.0, drive: nominal.clone(), zero_arcsec: 0.0 }
    }

    /// Draws a unit.
    pub fn draw(nominal: &Nominal, random: &mut fastrand::Rng) -> DrawnUnit {
        let spread = nominal.spread;
        let mut limited = || gauss(random).clamp(-WORST_UNIT, WORST_UNIT);
        let wind_up = 1.0 + spread.stiffness * limited();
        let clearance = 1.0 + spread.backlash * limited();
        let mut drive = nominal.clone();
        drive.stiffness.iter_mut().for_each(|[_, k]| *k /= wind_up);
        drive.backlash_arcsec *= clearance;
        for harmonic in &mut drive.harmonics {
            harmonic.amplitude_arcsec *= 1.0 + spread.harmonic * limited();
            harmonic.phase_rad += spread.harmonic_phase_rad * 0.5 * limited();
        }
        DrawnUnit { wind_up, clearance, drive, zero_arcsec: 200.0 * (random.f64() - 0.5) }
    }
}

/// A number of the normal distribution.
fn gauss(random: &mut fastrand::Rng) -> f64 {
    let (u, v) = (random.f64().max(1e-12), random.f64());
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// A made-up measurement.
#[derive(Clone, Debug)]
pub struct Synthesized {
    /// Rows, as the sensors read them, data faults not yet in them.
    pub sessions: Vec<Session>,
    /// The effects with the value of every parameter, in the order given.
    pub effects: Vec<Effect>,
}

/// Sum of the causes among completed effects in the error of a drive on these rows, arcsec.
fn added_by(effects: &[Effect], rows: &Rows, drive: &Nominal, base: &Base, sizes: Sizes) -> Vec<f64> {
    let scales = LawUnits::new(rows, sizes.pitch_radius_mm, Vec::new());
    let on = Excitation::new(rows, drive, base, &scales);
    let causes = effects.iter().filter_map(|effect| Some((effect, effect.definition.cause?)));
    let simulated = |(effect, cause): (&Effect, CauseName)| (cause.spec().simulated)(&on, &|name| effect.value(name));
    let causes: Vec<Simulated> = causes.map(simulated).collect();
    let acting: Vec<Acting<'_>> = causes.iter().map(|cause| cause.acting(&on)).collect();
    let mut sum = vec![0.0; rows.len()];
    added(&on, &acting).iter().for_each(|part| add_scaled(&mut sum, part, 1.0));
    sum
}

/// Sum of the `chosen` effects in the error of a drive in motion like that of `sessions`, row by row, arcsec.
/// Parameters that are not given take their default; nothing is drawn.
///
/// # Errors
/// As [`synthesize`].
pub(crate) fn added_arcsec(
    nominal: &Nominal,
    sizes: Sizes,
    chosen: &[Effect],
    sessions: &[Session],
) -> Result<Vec<f64>, EffectError> {
    let rows = Rows::new(sessions, nominal);
    let setting = Setting::new(nominal, sizes, &rows);
    let mut same = fastrand::Rng::with_seed(0);
    let effects = chosen.iter().map(|effect| effect.completed(&setting, &mut same)).collect::<Result<Vec<_>, _>>()?;
    let base = Base::with_play(&rows, nominal, None, PLAY);
    Ok(added_by(&effects, &rows, nominal, &base, sizes))
}

/// Measures a drive with `chosen` effects, in motion like that of `sessions`, which have all columns: the output
/// encoder as `sensors` say, and a torque sensor and a thermometer with a little noise. A `table` made by FEM takes the
/// place of the nominal prediction.
///
/// # Errors
/// A parameter that does not fit the motion, such as a time outside it.
pub fn synthesize(
    (nominal, table): (&Nominal, Option<&Table<'_>>),
    sizes: Sizes,
    chosen: &[Effect],
    mut sessions: Vec<Session>,
    sensors: &Sensors,
    unit: &DrawnUnit,
    random: &mut fastrand::Rng,
) -> Result<Synthesized, EffectError> {
    let rows = Rows::new(&sessions, nominal);
    let setting = Setting::new(nominal, sizes, &rows);
    let load_n_m = setting.load_n_m;
    let effects = chosen.iter().map(|effect| effect.completed(&setting, random)).collect::<Result<Vec<_>, _>>()?;
    let mut base = Base::with_play(&rows, &unit.drive, None, PLAY);
    if table.is_some() {
        // The table has the nominal play and wind-up; those of the unit add to it what they are more.
        let [by_table, by_model] = [table, None].map(|table| Base::with_play(&rows, nominal, table, PLAY).prediction);
        let more = by_table.iter().zip(&by_model).map(|(table, model)| table - model);
        base.prediction.iter_mut().zip(more).for_each(|(unit, more)| *unit += more);
    }
    let added = added_by(&effects, &rows, &unit.drive, &base, sizes);
    let mut error = base.prediction.iter().zip(added).map(|(nominal, added)| nominal + added + unit.zero_arcsec);
    let step_rad = ARCSEC_PER_TURN / 2f64.powi(sensors.encoder_bits as i32) / ARCSEC_PER_RAD;
    for session in &mut sessions {
        let noise = noise(session.time_s.as_deref().unwrap_or(&[]), sensors, random);
        let read = session.generator_rad.iter().zip(error.by_ref().zip(noise)).map(|(generator, (error, noise))| {
            // The encoder counts the output angle, not the error.
            let nominal = generator / nominal.ratio;
            ((nominal + (error + noise) / ARCSEC_PER_RAD) / step_rad).round() * step_rad - nominal
        });
        session.error_rad = read.collect();
    }
    // No sensor repeats a value to the last digit, even while what it measures stands.
    for session in &mut sessions {
        session.torque_n_m.iter_mut().flatten().for_each(|t| *t += TORQUE_NOISE * load_n_m * gauss(random));
        session.temperature_c.iter_mut().flatten().for_each(|t| *t += TEMPERATURE_NOISE_K * gauss(random));
    }
    Ok(Synthesized { sessions, effects })
}

/// White noise and wander at these times, arcsec: slow sines of random phase.
fn noise(time_s: &[f64], sensors: &Sensors, random: &mut fastrand::Rng) -> Vec<f64> {
    let waves: Vec<(f64, f64)> = (0..4)
        .map(|_| (std::f64::consts::TAU / (sensors.wander_s * (1.0 + 5.0 * random.f64())), 6.3 * random.f64()))
        .collect();
    let at = |time: &f64| {
        let slow: f64 = waves.iter().map(|(w, p)| (w * time + p).sin()).sum::<f64>() / 2f64.sqrt();
        sensors.white_arcsec * gauss(random) + sensors.wander_arcsec * slow
    };
    time_s.iter().map(at).collect()
}
