//! The effects that can be asked for by name: parameters with unit, meaning, range and default.
//!
//! Names and conventions are those of `diagnosis.json`: amplitudes in arc-seconds are at the output; `amplitude_um` is a displacement
//! along the normal of the flanks for eccentricities (over the base radius), along the pitch circle for pitch errors.

use std::f64::consts::TAU;

use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};

use super::Sizes;
use super::excitation::Excitation;
use super::law::{Angle, Encoder, Law};
use crate::nominal::{Fixed, Nominal};
use crate::suggest::did_you_mean;
use crate::units::ARCSEC_PER_RAD;

/// Value of a parameter that is not given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Usual {
    /// Always this.
    Value(f64),
    /// This share of the largest torque of the data.
    OfLoad(f64),
    /// Drawn evenly between two numbers.
    Drawn(f64, f64),
    /// A time drawn between two shares of the data.
    Instant(f64, f64),
    /// One tooth pitch of the wheel that turns.
    ToothPitch,
    /// Follows from the other form in which the same may be given.
    Follows,
}

/// A parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Name; the unit is its end.
    pub name: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// Allowed values, both ends with them.
    pub range: [f64; 2],
    /// Value if it is not given.
    pub usual: Usual,
    /// Words that may stand for 0, 1, 2, ...; none for a number.
    pub words: &'static [&'static str],
}

/// How one form of a parameter follows from another.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Factor {
    /// Arcsec for a micrometre along the normal of the flanks.
    AlongNormal,
    /// Arcsec for a micrometre along the pitch circle.
    AlongPitch,
    /// Arcsec for a micrometre of a ring that is pressed to an oval and keeps its length.
    Oval,
    /// Radians for a tooth of the wheel.
    Tooth,
    /// Arcsec at the generator for one at the output.
    Ratio,
}

/// An effect that can be asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Definition {
    /// Name, snake case.
    pub name: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// A fault of the data, not of the drive or its sensors.
    pub fault: bool,
    /// Its parameters.
    pub parameters: Vec<Parameter>,
    /// Two forms of the same, and the factor from the first to the second.
    twins: Vec<(&'static str, &'static str, Factor)>,
}

const fn number(name: &'static str, meaning: &'static str, low: f64, high: f64, usual: Usual) -> Parameter {
    Parameter { name, meaning, range: [low, high], usual, words: &[] }
}

const fn phase(meaning: &'static str) -> Parameter {
    number("phase_rad", meaning, -TAU, TAU, Usual::Drawn(0.0, TAU))
}

const fn microns(meaning: &'static str, usual: f64) -> Parameter {
    number("amplitude_um", meaning, 0.0, 100.0, Usual::Value(usual))
}

const ARCSECONDS: Parameter = number("amplitude_arcsec", "the same at the output", 0.0, 1000.0, Usual::Follows);
const HALF_LOAD: Parameter =
    number("half_load_n_m", "load at which more teeth have halved it", 0.01, 1e6, Usual::OfLoad(0.35));
const TIME: Parameter = number("time_s", "when", -1e9, 1e12, Usual::Instant(0.3, 0.7));
/// Flank angle by which the radius of an oval opens its spaces, rad: where teeth of HHD-95 bear.
const OVAL_FLANK_RAD: f64 = 0.4;
const WHEELS: &[&str] = &["flexspline", "circular_spline"];
const CHANNELS: &[&str] = &["generator", "output", "torque", "temperature"];

/// Everything that can be asked for: the 24 causes of the library, then data faults.
#[must_use]
pub fn effects() -> Vec<Definition> {
    use Factor::{AlongNormal, AlongPitch, Oval, Ratio, Tooth};
    use Usual::{Follows, OfLoad, ToothPitch, Value};
    type Twins = &'static [(&'static str, &'static str, Factor)];
    let cause = |name, meaning, parameters: &[Parameter], twins: Twins| Definition {
        name,
        meaning,
        fault: false,
        parameters: parameters.to_vec(),
        twins: twins.to_vec(),
    };
    let fault = |name, meaning, parameters: &[Parameter]| Definition {
        name,
        meaning,
        fault: true,
        parameters: parameters.to_vec(),
        twins: Vec::new(),
    };
    let displaced: Twins = &[("amplitude_um", "amplitude_arcsec", AlongNormal)];
    let pitch: Twins = &[("amplitude_um", "amplitude_arcsec", AlongPitch)];
    let harmonic = number("harmonic", "waves around the wheel", 1.0, 12.0, Value(2.0));
    vec![
        cause(
            "circular_spline_eccentricity",
            "toothing of the circular spline beside the axis it turns about",
            &[microns("how far", 10.0), ARCSECONDS, phase("whereto, on the circular spline"), HALF_LOAD],
            displaced,
        ),
        cause(
            "flexspline_runout",
            "toothing of the flexspline beside the axis of its bore",
            &[microns("how far", 10.0), ARCSECONDS, phase("whereto, on the flexspline"), HALF_LOAD],
            displaced,
        ),
        cause(
            "circular_spline_ovality",
            "circular spline pressed to an oval that keeps its length",
            &[microns("of the radius", 8.0), ARCSECONDS, phase("angle of a crest of what both flanks have alike")],
            &[("amplitude_um", "amplitude_arcsec", Oval)],
        ),
        cause(
            "flexspline_pitch_error",
            "cumulative pitch error of the flexspline",
            &[microns("along the pitch", 5.0), ARCSECONDS, harmonic, phase("angle of a crest of the error")],
            pitch,
        ),
        cause(
            "circular_spline_pitch_error",
            "cumulative pitch error of the circular spline",
            &[microns("along the pitch", 5.0), ARCSECONDS, harmonic, phase("angle of a crest of the error")],
            pitch,
        ),
        cause(
            "generator_eccentricity",
            "generator beside its axis: one lobe carries more",
            &[microns("how far", 5.0), ARCSECONDS, phase("whereto, on the generator"), HALF_LOAD],
            pitch,
        ),
        cause(
            "cam_form_error",
            "form error of the generator",
            &[microns("of the error it makes", 3.0), ARCSECONDS, phase("of the form")],
            pitch,
        ),
        cause(
            "damaged_tooth",
            "a tooth that lacks material",
            &[
                number("depth_um", "depth that lacks, along the normal", 0.0, 500.0, Value(10.0)),
                number("amplitude_arcsec", "the same at the output, under the largest load", 0.0, 3000.0, Follows),
                Parameter { words: WHEELS, ..number("wheel", "0 flexspline, 1 circular spline", 0.0, 1.0, Value(0.0)) },
                number("tooth", "which one, from 0", 0.0, 2000.0, Value(40.0)),
                number("angle_rad", "the same as an angle on the wheel", -TAU, TAU, Follows),
                number("width_rad", "half the arc over which it is felt", 0.02, 0.6, Value(0.15)),
            ],
            &[("depth_um", "amplitude_arcsec", AlongNormal), ("tooth", "angle_rad", Tooth)],
        ),
        cause(
            "backlash_growth",
            "a wider clearance throughout",
            &[number("growth_arcsec", "whole width over nominal", 0.0, 10_000.0, Value(40.0))],
            &[],
        ),
        cause(
            "wear",
            "a clearance that widens with travel",
            &[number("growth_arcsec", "whole width, first row to last", 0.0, 10_000.0, Value(40.0))],
            &[],
        ),
        cause(
            "stiffness_hardening",
            "stiffer the higher the load",
            &[
                number(
                    "hardening_arcsec",
                    "by which the wind-up falls short at the full load",
                    0.0,
                    1000.0,
                    Value(20.0),
                ),
                number("hardening_exponent", "of the torque", 1.2, 8.0, Value(3.0)),
                number("full_load_n_m", "the torque at which it is stated", 1e-3, 1e6, OfLoad(1.0)),
            ],
            &[],
        ),
        cause(
            "stiffness_error",
            "another stiffness than nominal",
            &[number("stiffness_ratio", "true over nominal", 0.05, 20.0, Value(0.8))],
            &[],
        ),
        cause(
            "torsional_hysteresis",
            "springs that slip: the output lags the torque",
            &[
                number(
                    "half_width_arcsec",
                    "half the opening of the large loop at zero torque",
                    0.0,
                    1000.0,
                    Value(15.0),
                ),
                number("slip_torque_n_m", "at which the middle spring slips", 1e-3, 1e6, OfLoad(0.2)),
            ],
            &[],
        ),
        cause(
            "thermal_clearance",
            "a clearance that follows the temperature",
            &[
                number("clearance_arcsec_per_k", "whole width, wider when warm", -50.0, 50.0, Value(-1.0)),
                number("lag_s", "with which it follows", 0.0, 1e5, Value(0.0)),
            ],
            &[],
        ),
        cause(
            "thermal_stiffness",
            "a stiffness that follows the temperature",
            &[number("stiffness_relative_per_k", "of the stiffness", -0.02, 0.02, Value(-0.004))],
            &[],
        ),
        cause(
            "lubricant_viscosity",
            "drag of the lubricant on the output, that the torque column does not hold",
            &[
                number("drag_n_m", "at the mean speed and the nominal temperature", 0.0, 1e5, OfLoad(0.1)),
                number("speed_exponent", "of the speed", 0.2, 1.2, Value(2.0 / 3.0)),
                number("relative_drag_per_k", "of the drag", -0.15, 0.0, Value(-0.035)),
            ],
            &[],
        ),
        cause(
            "gravity_torque",
            "an unbalanced load that the torque column does not hold",
            &[number("torque_n_m", "m g l", 0.0, 1e5, OfLoad(0.2)), phase("of sin(output + orientation + phase)")],
            &[],
        ),
        cause(
            "gravity_side_load",
            "weight that pushes the circular spline aside",
            &[microns("how far", 10.0), ARCSECONDS, phase("whereto, against gravity"), HALF_LOAD],
            displaced,
        ),
        cause(
            "torsional_resonance",
            "the load's inertia on the drive's spring",
            &[
                number("frequency_hz", "of the free oscillation", 0.1, 1000.0, Value(8.0)),
                number("damping_ratio", "of critical damping", 0.001, 0.9, Value(0.03)),
            ],
            &[],
        ),
        cause(
            "output_encoder_eccentricity",
            "disc of the output encoder off its axis",
            &[number("amplitude_arcsec", "at the output", 0.0, 10_000.0, Value(20.0)), phase("of sin(output + phase)")],
            &[],
        ),
        cause(
            "generator_encoder_eccentricity",
            "disc of the generator's encoder off its axis",
            &[
                number("amplitude_arcsec", "at the output", 0.0, 1000.0, Value(10.0)),
                number("generator_amplitude_arcsec", "the same at the generator", 0.0, 1e5, Follows),
                phase("of sin(generator + phase)"),
            ],
            &[("amplitude_arcsec", "generator_amplitude_arcsec", Ratio)],
        ),
        cause(
            "sensor_latency",
            "the output's reading is older than the generator's",
            &[number("delay_s", "positive: the output's is older", -0.1, 0.1, Value(0.002))],
            &[],
        ),
        cause(
            "ratio_error",
            "an error in proportion to the output angle",
            &[number("ratio_relative_error", "of the output angle", -0.01, 0.01, Value(1e-4))],
            &[],
        ),
        cause(
            "ratcheting",
            "teeth that skip",
            &[number("jump_arcsec", "of the output, whole teeth", -1e5, 1e5, ToothPitch), TIME],
            &[],
        ),
        fault(
            "encoder_index_jump",
            "the count of the output encoder is off from an instant on",
            &[number("size_arcsec", "of the jump", -1e5, 1e5, Value(60.0)), TIME],
        ),
        fault(
            "frozen_channel",
            "a channel repeats one value",
            &[
                Parameter { words: CHANNELS, ..number("channel", "which one", 0.0, 3.0, Value(1.0)) },
                TIME,
                number("duration_s", "how long", 0.0, 1e6, Value(3.0)),
            ],
        ),
        fault(
            "missing_samples",
            "rows without an output angle",
            &[number("share", "of the rows", 0.0, 0.5, Value(0.02))],
        ),
        fault("clock_error", "time runs back", &[number("step_s", "by which", 1e-4, 1e4, Value(0.5)), TIME]),
        fault(
            "outliers",
            "single rows far off",
            &[
                number("share", "of the rows", 0.0, 0.1, Value(0.002)),
                number("size_arcsec", "of the largest", 0.0, 1e6, Value(600.0)),
            ],
        ),
        fault("unit_mismatch", "the output angle is in degrees and says radians", &[]),
        fault("quantisation", "a coarse output encoder", &[number("step_arcsec", "its step", 0.0, 1e5, Value(30.0))]),
        fault(
            "drift",
            "a zero that moves with time",
            &[number("arcsec_per_hour", "how fast", -1e6, 1e6, Value(300.0))],
        ),
    ]
}

/// An effect with the values of its parameters: those given, and once completed all.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// What it is.
    pub definition: Definition,
    /// Value of each parameter.
    pub values: Vec<Option<f64>>,
}

impl Serialize for Chosen {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        struct Values<'a>(&'a Chosen);
        impl Serialize for Values<'_> {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.collect_map(
                    self.0
                        .definition
                        .parameters
                        .iter()
                        .zip(&self.0.values)
                        .filter_map(|(parameter, value)| Some((parameter.name, (*value)?))),
                )
            }
        }
        let mut map = serializer.serialize_map(Some(2))?;
        map.serialize_entry("name", self.definition.name)?;
        map.serialize_entry("parameters", &Values(self))?;
        map.end()
    }
}

/// Reads `NAME` or `NAME:param=value,...`.
///
/// # Errors
/// What was found and what is allowed, with a suggestion for a name that is nearly one.
pub fn parse(text: &str) -> Result<Chosen, String> {
    let (name, rest) = text.split_once(':').unwrap_or((text, ""));
    let all = effects();
    let Some(definition) = all.iter().find(|effect| effect.name == name) else {
        let names: Vec<&str> = all.iter().map(|effect| effect.name).collect();
        return Err(format!(
            "found \"{name}\"{}; allowed: {}",
            did_you_mean("; ", name, names.iter().copied()),
            names.join(", ")
        ));
    };
    let mut chosen = Chosen { definition: definition.clone(), values: vec![None; definition.parameters.len()] };
    for part in rest.split(',').filter(|part| !part.trim().is_empty()) {
        let (key, value) =
            part.split_once('=').ok_or_else(|| format!("{name}: found \"{part}\"; allowed: parameter=value"))?;
        chosen.set(key.trim(), value.trim())?;
    }
    for (a, b, _) in &definition.twins {
        if chosen.given(a).is_some() && chosen.given(b).is_some() {
            return Err(format!("{name}: {a} and {b} say the same; give one of them"));
        }
    }
    Ok(chosen)
}

impl Chosen {
    fn set(&mut self, key: &str, text: &str) -> Result<(), String> {
        let name = self.definition.name;
        let Some(place) = self.definition.parameters.iter().position(|parameter| parameter.name == key) else {
            let names: Vec<&str> = self.definition.parameters.iter().map(|parameter| parameter.name).collect();
            let allowed = if names.is_empty() { "no parameter".to_owned() } else { names.join(", ") };
            let hint = did_you_mean("; ", key, names);
            return Err(format!("{name}: found parameter \"{key}\"{hint}; allowed: {allowed}"));
        };
        let parameter = self.definition.parameters[place];
        if self.values[place].is_some() {
            return Err(format!("{name}: {key} is given twice"));
        }
        let word = parameter.words.iter().position(|word| *word == text).map(|k| k as f64);
        let value = word.or_else(|| text.parse().ok());
        let [low, high] = parameter.range;
        let whole = !parameter.words.is_empty() || ["harmonic", "tooth"].contains(&parameter.name);
        match value {
            Some(value) if value >= low && value <= high && (!whole || value.fract() == 0.0) => {
                self.values[place] = Some(value);
                Ok(())
            }
            _ => Err(format!("{name}: {key}: found {text}, allowed: {}", parameter.allowed())),
        }
    }

    /// The value of a parameter, if it has one.
    #[must_use]
    pub fn given(&self, name: &str) -> Option<f64> {
        let place = self.definition.parameters.iter().position(|parameter| parameter.name == name)?;
        self.values[place]
    }

    /// The value of a parameter of a completed effect.
    pub(super) fn value(&self, name: &str) -> f64 {
        self.given(name).expect("a completed effect has all its parameters")
    }

    /// The effect with every parameter.
    pub(super) fn completed(&self, setting: &Setting<'_>, random: &mut fastrand::Rng) -> Result<Chosen, String> {
        let mut complete = self.clone();
        let definition = &self.definition;
        let place =
            |name: &str| definition.parameters.iter().position(|p| p.name == name).expect("twins are parameters");
        for (k, parameter) in definition.parameters.iter().enumerate() {
            let drawn = random.f64();
            if complete.values[k].is_some() {
                continue;
            }
            // Which of two forms was given decides; the other follows below.
            let is_first_of_given =
                definition.twins.iter().any(|(a, b, _)| *a == parameter.name && self.given(b).is_some());
            if is_first_of_given {
                continue;
            }
            complete.values[k] = match parameter.usual {
                Usual::Value(value) => Some(value),
                Usual::OfLoad(share) => Some(share * setting.load_n_m),
                Usual::Drawn(low, high) => Some(low + (high - low) * drawn),
                Usual::Instant(low, high) => Some(setting.instant(low + (high - low) * drawn)),
                Usual::ToothPitch => Some(setting.tooth_pitch_arcsec()?),
                Usual::Follows => None,
            };
        }
        for (a, b, factor) in &definition.twins {
            let factor = setting.factor(*factor, &complete)?;
            let (a, b) = (place(a), place(b));
            match (complete.values[a], complete.values[b]) {
                (Some(first), None) => complete.values[b] = Some(first * factor),
                (None, Some(second)) => complete.values[a] = Some(second / factor),
                _ => {}
            }
        }
        if let Some(time) = complete.given("time_s") {
            let (first, last) = setting.span();
            if !(time > first && time < last) {
                let name = definition.name;
                return Err(format!("{name}: time_s: found {time}, allowed: within the data, {first:.2} to {last:.2}"));
            }
        }
        if let (Some(tooth), Some(wheel)) = (self.given("tooth"), complete.given("wheel")) {
            let teeth = setting.teeth(wheel)?;
            if tooth >= teeth {
                return Err(format!("damaged_tooth: tooth: found {tooth}, allowed: 0 to {}", teeth - 1.0));
            }
        }
        Ok(complete)
    }

    /// The law of a completed effect; a fault of the data has none.
    pub(super) fn law(&self, setting: &Setting<'_>) -> Option<Law> {
        let v = |name: &str| self.value(name);
        let phase = || self.value("phase_rad");
        let displaced = |angle| Law::Displaced {
            angle,
            amplitude: v("amplitude_arcsec"),
            direction_rad: phase(),
            half_load_n_m: v("half_load_n_m"),
        };
        let pitch =
            |angle| Law::Pitch { angle, lines: vec![(v("harmonic"), v("amplitude_arcsec"), -v("harmonic") * phase())] };
        Some(match self.definition.name {
            "circular_spline_eccentricity" => displaced(Angle::CircularSpline),
            "flexspline_runout" => displaced(Angle::Flexspline),
            "gravity_side_load" => displaced(Angle::Gravity),
            "circular_spline_ovality" => Law::Oval {
                amplitude: v("amplitude_arcsec"),
                phase_rad: -2.0 * phase(),
                radial: 2.0 * OVAL_FLANK_RAD.tan(),
            },
            "flexspline_pitch_error" => pitch(Angle::Flexspline),
            "circular_spline_pitch_error" => pitch(Angle::CircularSpline),
            "generator_eccentricity" => {
                Law::Lobes { amplitude: v("amplitude_arcsec"), phase_rad: -phase(), half_load_n_m: v("half_load_n_m") }
            }
            "cam_form_error" => Law::CamForm { amplitude: v("amplitude_arcsec"), phase_rad: phase() },
            "damaged_tooth" => Law::Damage {
                angle: if v("wheel") == 0.0 { Angle::Flexspline } else { Angle::CircularSpline },
                amplitude: v("amplitude_arcsec"),
                place_rad: v("angle_rad"),
                half_width_rad: v("width_rad"),
                both_flanks: false,
            },
            "backlash_growth" => Law::Wider { growth: v("growth_arcsec") },
            "wear" => Law::Wear { growth: v("growth_arcsec") },
            "stiffness_hardening" => Law::Hardening {
                at_full_load: v("hardening_arcsec"),
                exponent: v("hardening_exponent"),
                full_load_n_m: v("full_load_n_m"),
            },
            "stiffness_error" => Law::Softer { relative: 1.0 / v("stiffness_ratio") - 1.0 },
            "torsional_hysteresis" => Law::Slip {
                half_width: v("half_width_arcsec"),
                // Four springs slip at 0.4, 0.9, 1.4 and 1.9 of this.
                slip_n_m: v("slip_torque_n_m") / 1.15,
            },
            "thermal_clearance" => Law::Breathing { per_k: v("clearance_arcsec_per_k"), lag_s: v("lag_s") },
            "thermal_stiffness" => Law::SofterWarm { relative_per_k: -v("stiffness_relative_per_k") },
            "lubricant_viscosity" => Law::Drag {
                drag_n_m: v("drag_n_m"),
                speed_rad_s: setting.mean_speed_rad_s(),
                speed_exponent: v("speed_exponent"),
                per_k: -v("relative_drag_per_k"),
            },
            "gravity_torque" => Law::Unbalance { torque_n_m: v("torque_n_m"), phase_rad: phase() },
            "torsional_resonance" => {
                Law::Resonance { frequency_hz: v("frequency_hz"), damping_ratio: v("damping_ratio") }
            }
            "output_encoder_eccentricity" => {
                Law::Disc { encoder: Encoder::Output, amplitude: v("amplitude_arcsec"), phase_rad: phase() }
            }
            "generator_encoder_eccentricity" => {
                Law::Disc { encoder: Encoder::Generator, amplitude: v("amplitude_arcsec"), phase_rad: phase() }
            }
            "sensor_latency" => Law::Latency { delay_s: v("delay_s") },
            "ratio_error" => Law::Ratio { relative: v("ratio_relative_error") },
            "ratcheting" => {
                Law::Jump { row: setting.on.time.partition_point(|t| *t < v("time_s")), by: v("jump_arcsec") }
            }
            _ => return None,
        })
    }
}

impl Parameter {
    /// Allowed values, in words.
    #[must_use]
    pub fn allowed(&self) -> String {
        let [low, high] = self.range;
        let words = self.words.join(", ");
        if words.is_empty() { format!("{low} to {high}") } else { format!("{words} (or {low} to {high})") }
    }
}

/// What parameters are completed by.
pub(super) struct Setting<'a> {
    pub nominal: &'a Nominal,
    pub sizes: Sizes,
    pub on: &'a Excitation,
    /// Largest torque, N·m.
    pub load_n_m: f64,
}

impl Setting<'_> {
    fn span(&self) -> (f64, f64) {
        let time = &self.on.time;
        (time.first().copied().unwrap_or(0.0), time.last().copied().unwrap_or(0.0))
    }

    /// The time at a share of the rows: between sessions nothing happens.
    fn instant(&self, share: f64) -> f64 {
        let time = &self.on.time;
        time.get((share * time.len() as f64) as usize).copied().unwrap_or(0.0)
    }

    fn mean_speed_rad_s(&self) -> f64 {
        let speeds = self.on.speeds();
        (speeds.iter().map(|w| w.abs()).sum::<f64>() / speeds.len().max(1) as f64).max(1e-9)
    }

    fn teeth(&self, wheel: f64) -> Result<f64, String> {
        let teeth = self.nominal.teeth.ok_or("the model gives a ratio and no teeth; this effect needs them")?;
        Ok(f64::from(if wheel == 0.0 { teeth.flexspline } else { teeth.circular_spline }))
    }

    fn tooth_pitch_arcsec(&self) -> Result<f64, String> {
        let fixed = self.nominal.teeth.map(|teeth| teeth.fixed);
        Ok(crate::units::ARCSEC_PER_TURN / self.teeth(if fixed == Some(Fixed::CircularSpline) { 0.0 } else { 1.0 })?)
    }

    fn factor(&self, factor: Factor, effect: &Chosen) -> Result<f64, String> {
        let along = |radius_mm: f64| 1e-3 / radius_mm * ARCSEC_PER_RAD;
        Ok(match factor {
            Factor::AlongNormal => along(self.sizes.base_radius_mm),
            Factor::AlongPitch => along(self.sizes.pitch_radius_mm),
            // Half of it moves the teeth along the ring, and its radius opens them by the tangent of the flank angle.
            Factor::Oval => 0.5f64.hypot(OVAL_FLANK_RAD.tan()) * along(self.sizes.pitch_radius_mm),
            Factor::Tooth => TAU / self.teeth(effect.given("wheel").unwrap_or(0.0))?,
            Factor::Ratio => self.nominal.ratio.abs(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::CAUSES;
    use super::*;

    #[test]
    fn every_cause_of_the_library_can_be_asked_for() {
        let all = effects();
        let mut causes: Vec<&str> = all.iter().filter(|effect| !effect.fault).map(|effect| effect.name).collect();
        let mut known = CAUSES.to_vec();
        causes.sort_unstable();
        known.sort_unstable();
        assert_eq!(causes, known);
        for effect in &all {
            for parameter in &effect.parameters {
                let [low, high] = parameter.range;
                if let Usual::Value(value) = parameter.usual {
                    assert!((low..=high).contains(&value), "{} {}", effect.name, parameter.name);
                }
            }
        }
    }

    #[test]
    fn what_is_wrong_with_an_effect_is_said() {
        for (text, message) in [
            (
                "circular_spline_ecentricity",
                "; did you mean `circular_spline_eccentricity`?; allowed: circular_spline_",
            ),
            ("zzz", "found \"zzz\"; allowed: "),
            (
                "wear:growth=3",
                "wear: found parameter \"growth\"; did you mean `growth_arcsec`?; allowed: growth_arcsec",
            ),
            ("wear:growth_arcsec=-3", "wear: growth_arcsec: found -3, allowed: 0 to 10000"),
            ("wear:growth_arcsec=nan", "wear: growth_arcsec: found nan, allowed"),
            ("wear:growth_arcsec=wide", "wear: growth_arcsec: found wide, allowed"),
            ("wear:growth_arcsec", "wear: found \"growth_arcsec\"; allowed: parameter=value"),
            ("wear:growth_arcsec=3,growth_arcsec=4", "wear: growth_arcsec is given twice"),
            ("flexspline_runout:amplitude_um=3,amplitude_arcsec=4", "amplitude_um and amplitude_arcsec say the same"),
            ("flexspline_pitch_error:harmonic=2.5", "harmonic: found 2.5"),
            ("damaged_tooth:wheel=cam", "wheel: found cam, allowed: flexspline, circular_spline (or 0 to 1)"),
            ("unit_mismatch:x=1", "allowed: no parameter"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(message), "{text}: {error}");
        }
        assert_eq!(parse("damaged_tooth:wheel=circular_spline").unwrap().given("wheel"), Some(1.0));
    }
}
