//! Effects of a chosen size hidden in sessions, in two forms of each law: for the tests of the diagnosis.

use std::f64::consts::{PI, TAU};

use super::law::{Angle, Encoder, Law, Now, largest};
use super::plant::{Plant, Unit};
use super::{Excitation, Plan, Sensors, Setting, Sizes, add_noise, into_sessions, parse};
use crate::causes::{CauseName, ParameterName};
use crate::measurement::Session;
use crate::nominal::Nominal;
use flexspline_base::units::ARCSEC_PER_TURN;

/// Share of `e / (r cos a)` that the second order of the rectified sine has: `4 / 3 pi`.
const SECOND_OF_RECTIFIED: f64 = 0.424;

/// Resolution of the output encoder, arcsec.
const STEP_ARCSEC: f64 = 0.3;

/// Sizes of the drive, for laws that are stated in micrometres.
const SIZES: Sizes = Sizes { pitch_radius_mm: 48.7, base_radius_mm: 44.6 };

/// Effects that are in no library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Strange {
    /// The zero of the output encoder follows the temperature.
    SensorOffsetWithTemperature,
    /// A line at an order that no part of the drive makes.
    LineOfOrder10_37,
    /// The error creeps with the logarithm of time.
    Creep,
    /// The encoder feels the square of the torque.
    TorqueCrossTalk,
}

impl Strange {
    /// Adds it to the error, arcsec.
    pub(super) fn add_error(self, now: &Now<'_>, [size, phase]: [f64; 2], error: &mut [f64]) {
        let on = now.on;
        let since = |k: usize| {
            let session = on.sessions.iter().find(|s| s.contains(&k)).expect("every row has a session");
            on.time[k] - on.time[session.start]
        };
        let top = largest(now.torque);
        for (k, error) in error.iter_mut().enumerate() {
            *error += match self {
                Strange::SensorOffsetWithTemperature => size / 25.0 * (on.temperature[k] - 20.0),
                Strange::LineOfOrder10_37 => size * (10.37 * on.generator[k] + phase).sin(),
                Strange::Creep => size * (1.0 + since(k)).ln() / 2.0,
                Strange::TorqueCrossTalk => size * (now.torque[k] / top).powi(2),
            };
        }
    }
}

/// The hidden effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// A cause of the library.
    Cause(CauseName),
    /// Something else.
    Strange(Strange),
}

impl From<CauseName> for What {
    fn from(cause: CauseName) -> What {
        What::Cause(cause)
    }
}

impl From<Strange> for What {
    fn from(strange: Strange) -> What {
        What::Strange(strange)
    }
}

/// An effect with its size and phase.
#[derive(Clone, Debug)]
pub(crate) struct Effect {
    /// Its description.
    pub what: What,
    /// Amplitude at the output, arcsec; for the rest what the name says.
    pub size: f64,
    /// Phase, rad, or a second number between 0 and 2π.
    pub phase: f64,
    /// A number between 0 and 1 for what else the law needs.
    pub other: f64,
}

impl Effect {
    /// The law with its numbers, under a torque on the flanks that is known but for this effect.
    pub(super) fn law(
        &self,
        plant: &Plant<'_>,
        on: &Excitation,
        torque: &[f64],
        changed: bool,
        random: &mut fastrand::Rng,
    ) -> Law {
        let (size, phase, other) = (self.size, self.phase, self.other);
        let top = largest(torque);
        let half_load_n_m = top * (0.1 + 0.5 * other);
        let displaced = |angle| Law::Displaced {
            angle,
            amplitude: size / SECOND_OF_RECTIFIED,
            direction_rad: phase,
            half_load_n_m,
        };
        let cause = match self.what {
            What::Cause(cause) => cause,
            What::Strange(name) => return Law::Strange { name, size, phase },
        };
        match cause {
            CauseName::CircularSplineEccentricity => displaced(Angle::CircularSpline),
            CauseName::FlexsplineRunout => displaced(Angle::Flexspline),
            CauseName::GravitySideLoad => displaced(Angle::Gravity),
            CauseName::CircularSplineOvality => Law::Oval { amplitude: size, phase_rad: phase, radial: 0.0 },
            CauseName::FlexsplinePitchError | CauseName::CircularSplinePitchError => {
                let lines = [2.0, 1.0, 3.0, 4.0]
                    .into_iter()
                    .enumerate()
                    .map(|(j, o)| {
                        let a = if j == 0 { 1.0 } else { (0.2 + 0.4 * random.f64()) * if changed { 1.3 } else { 1.0 } };
                        (o, size * a, TAU * random.f64())
                    })
                    .collect();
                let angle =
                    if cause == CauseName::FlexsplinePitchError { Angle::Flexspline } else { Angle::CircularSpline };
                Law::Pitch { angle, lines }
            }
            CauseName::GeneratorEccentricity => {
                Law::Lobes { amplitude: size, phase_rad: phase, deeper: 2.0 * size, half_load_n_m }
            }
            CauseName::CamFormError => Law::CamForm { amplitude: size, phase_rad: phase },
            CauseName::DamagedTooth => Law::Damage {
                angle: if phase > PI { Angle::Flexspline } else { Angle::CircularSpline },
                amplitude: size,
                place_rad: phase,
                half_width_rad: 0.06 + 0.2 * other,
                both_flanks: other > 0.7,
            },
            CauseName::BacklashGrowth => Law::Wider { growth: size * plant.nominal.backlash_arcsec },
            CauseName::ThermalClearance => Law::Breathing { per_k: -size, lag_s: if changed { 20.0 } else { 0.01 } },
            CauseName::StiffnessHardening => Law::Hardening { at_full_load: size, exponent: 3.0, full_load_n_m: top },
            CauseName::StiffnessError => Law::Softer { relative: size },
            CauseName::ThermalStiffness => Law::SofterWarm { relative_per_k: size },
            CauseName::TorsionalHysteresis => Law::Slip { half_width: size, slip_n_m: top * (0.08 + 0.3 * other) },
            CauseName::LubricantViscosity => Law::DragLag { largest: 0.5 * size },
            CauseName::TorsionalResonance => {
                Law::Resonance { frequency_hz: size, damping_ratio: if changed { 0.15 } else { 0.02 + 0.06 * other } }
            }
            CauseName::GeneratorEncoderEccentricity => {
                Law::Disc { encoder: Encoder::Generator, amplitude: 0.4 * size, phase_rad: phase }
            }
            CauseName::SensorLatency => Law::Latency { delay_s: size * 1e-3 },
            CauseName::RatioError => Law::Ratio { relative: 3e-6 * size },
            CauseName::Ratcheting => Law::Jump {
                row: (torque.len() as f64 * (0.2 + 0.6 * other)) as usize,
                by: -ARCSEC_PER_TURN / f64::from(plant.nominal.teeth_or_of_two_waves().of_output())
                    * if phase > 4.0 { 2.0 } else { 1.0 },
            },
            cause => self.as_asked_for(cause, plant, on),
        }
    }

    /// The law that the command `synthesize` makes of a cause, with this size and place and otherwise its usual
    /// parameters. Tests that want more of a cause give it an arm of its own above.
    fn as_asked_for(&self, cause: CauseName, plant: &Plant<'_>, on: &Excitation) -> Law {
        let mut chosen = parse(cause.as_str()).expect("a cause can be asked for");
        let size = cause
            .spec()
            .parameters
            .iter()
            .map(|parameter| parameter.name)
            .min_by_key(|name| *name != ParameterName::AmplitudeArcsec)
            .expect("a cause has a parameter");
        for (parameter, value) in cause.spec().parameters.iter().zip(&mut chosen.values) {
            *value = match parameter.name {
                name if name == size => Some(self.size),
                ParameterName::AngleRad | ParameterName::PhaseRad => Some(self.phase),
                _ => None,
            };
        }
        let setting = Setting { nominal: plant.nominal, sizes: SIZES, on, load_n_m: largest(&on.torque) };
        let complete =
            chosen.completed(&setting, &mut fastrand::Rng::with_seed(0)).expect("usual parameters fit any excitation");
        Law::of(cause, &complete, &setting)
    }
}

/// Sessions of a drive with `effects`; `law` 0 or 1 picks the form of each law.
#[must_use]
pub(crate) fn measure(
    nominal: &Nominal,
    effects: &[Effect],
    plan: &Plan,
    sensors: &Sensors,
    law: u8,
    random: &mut fastrand::Rng,
) -> Vec<Session> {
    let changed = law == 1;
    let plant = Plant { nominal, table: None };
    let on = plan.excite(random);
    let unit = Unit::draw(nominal, random);
    let unbalanced: Vec<Law> = effects
        .iter()
        .filter(|effect| effect.what == What::Cause(CauseName::GravityTorque))
        .map(|effect| effect.law(&plant, &on, &on.torque, changed, random))
        .collect();
    let torque = plant.flank_torque(&on, &unbalanced);
    let laws: Vec<Law> = effects.iter().map(|effect| effect.law(&plant, &on, &torque, changed, random)).collect();
    let mut error = plant.error(&on, &torque, &laws, &unit, (changed, changed));
    plant.add_laws(&on, &torque, &laws, changed, &mut error);
    add_noise(&on, sensors, &mut error, random);
    error.iter_mut().for_each(|e| *e = (*e / STEP_ARCSEC).round() * STEP_ARCSEC);
    into_sessions(&on, &error)
}
