//! Effects drawn at random, for tests of the diagnosis.

use std::f64::consts::{PI, TAU};

use super::law::{Angle, Encoder, Law, SECOND_OF_RECTIFIED, largest};
use super::plant::Plant;
use crate::units::ARCSEC_PER_TURN;

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

    /// The law with its numbers, under a torque on the flanks that is known but for this effect.
    pub(super) fn law(&self, plant: &Plant<'_>, torque: &[f64], changed: bool, random: &mut fastrand::Rng) -> Law {
        let (size, phase, other) = (self.size, self.phase, self.other);
        let top = largest(torque);
        let half_load_n_m = top * (0.1 + 0.5 * other);
        let displaced = |angle| Law::Displaced {
            angle,
            amplitude: size / SECOND_OF_RECTIFIED,
            direction_rad: phase,
            half_load_n_m,
        };
        match self.name.as_str() {
            "circular_spline_eccentricity" => displaced(Angle::CircularSpline),
            "flexspline_runout" => displaced(Angle::Flexspline),
            "gravity_side_load" => displaced(Angle::Gravity),
            "circular_spline_ovality" => Law::Oval { amplitude: size, phase_rad: phase, radial: 0.0 },
            "flexspline_pitch_error" | "circular_spline_pitch_error" => {
                let lines = [2.0, 1.0, 3.0, 4.0]
                    .into_iter()
                    .enumerate()
                    .map(|(j, o)| {
                        let a = if j == 0 { 1.0 } else { (0.2 + 0.4 * random.f64()) * if changed { 1.3 } else { 1.0 } };
                        (o, size * a, TAU * random.f64())
                    })
                    .collect();
                let angle = if self.name.starts_with("flex") { Angle::Flexspline } else { Angle::CircularSpline };
                Law::Pitch { angle, lines }
            }
            "generator_eccentricity" => Law::Lobes { amplitude: size, phase_rad: phase, half_load_n_m },
            "cam_form_error" => Law::CamForm { amplitude: size, phase_rad: phase },
            "damaged_tooth" => Law::Damage {
                angle: if phase > PI { Angle::Flexspline } else { Angle::CircularSpline },
                amplitude: size,
                place_rad: phase,
                half_width_rad: 0.06 + 0.2 * other,
                both_flanks: other > 0.7,
            },
            "wear" => Law::Wear { growth: size },
            "backlash_growth" => Law::Wider { growth: size * plant.nominal.backlash_arcsec },
            "thermal_clearance" => Law::Breathing { per_k: -size, lag_s: if changed { 20.0 } else { 0.01 } },
            "gravity_torque" => Law::Unbalance { torque_n_m: size, phase_rad: phase },
            "stiffness_hardening" => Law::Hardening { at_full_load: size, exponent: 3.0, full_load_n_m: top },
            "stiffness_error" => Law::Softer { relative: size },
            "thermal_stiffness" => Law::SofterWarm { relative_per_k: size },
            "torsional_hysteresis" => Law::Slip { half_width: size, slip_n_m: top * (0.08 + 0.3 * other) },
            "lubricant_viscosity" => Law::DragLag { largest: 0.5 * size },
            "torsional_resonance" => {
                Law::Resonance { frequency_hz: size, damping_ratio: if changed { 0.15 } else { 0.02 + 0.06 * other } }
            }
            "output_encoder_eccentricity" => Law::Disc { encoder: Encoder::Output, amplitude: size, phase_rad: phase },
            "generator_encoder_eccentricity" => {
                Law::Disc { encoder: Encoder::Generator, amplitude: 0.4 * size, phase_rad: phase }
            }
            "sensor_latency" => Law::Latency { delay_s: size * 1e-3 },
            "ratio_error" => Law::Ratio { relative: 3e-6 * size },
            "ratcheting" => Law::Jump {
                row: (torque.len() as f64 * (0.2 + 0.6 * other)) as usize,
                by: -ARCSEC_PER_TURN / f64::from(plant.nominal.teeth_or_of_two_waves().of_output())
                    * if phase > 4.0 { 2.0 } else { 1.0 },
            },
            name => Law::Strange { name: name.to_owned(), size, phase, other },
        }
    }
}
