//! The effects that can be asked for by name: parameters with unit, meaning, range and default.
//!
//! Names and conventions are those of `diagnosis.json`: amplitudes in arc-seconds are at the output; `amplitude_um` is
//! a displacement along the normal of the flanks for eccentricities (over the base radius), along the pitch circle for
//! pitch errors.

use std::f64::consts::TAU;

use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};

use super::Sizes;
use super::excitation::Excitation;
use super::law::OVAL_FLANK_RAD;
use crate::causes::{
    CauseName, Factor, Parameter, ParameterName, ParameterName as Name, TIME, Usual, Usual::Value, number,
};
use crate::measurement::FaultName;
use crate::nominal::{Fixed, Nominal};
use flexspline_base::suggest::did_you_mean;
use flexspline_base::units::ARCSEC_PER_RAD;

/// An effect that can be hidden in data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hidden {
    /// A cause of the library.
    Cause(CauseName),
    /// A fault of the data, not of the drive or its sensors.
    Fault(FaultName),
}

/// An effect that can be asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Definition {
    /// Its description.
    pub what: Hidden,
    /// In words.
    pub meaning: &'static str,
    /// Its parameters.
    pub parameters: &'static [Parameter],
    /// Two forms of the same, and the factor from the first to the second.
    twins: &'static [(ParameterName, ParameterName, Factor)],
}

impl Definition {
    /// Its name, snake case.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self.what {
            Hidden::Cause(cause) => cause.as_str(),
            Hidden::Fault(fault) => fault.as_str(),
        }
    }

    /// Whether it is a fault of the data.
    #[must_use]
    pub const fn is_fault(&self) -> bool {
        matches!(self.what, Hidden::Fault(_))
    }

    fn of_cause(cause: CauseName) -> Definition {
        Definition {
            what: Hidden::Cause(cause),
            meaning: cause.spec().meaning,
            parameters: cause.spec().parameters,
            twins: cause.spec().twins,
        }
    }

    const fn of_fault(fault: FaultName, meaning: &'static str, parameters: &'static [Parameter]) -> Definition {
        Definition { what: Hidden::Fault(fault), meaning, parameters, twins: &[] }
    }
}

const CHANNELS: &[&str] = &["generator", "output", "torque", "temperature"];

/// The faults of the data in the order of lists.
const FAULTS: [Definition; 16] = [
    Definition::of_fault(
        FaultName::EncoderIndexJump,
        "the count of the output encoder is off from an instant on",
        &[number(Name::SizeArcsec, "of the jump", -1e5, 1e5, Value(60.0)), TIME],
    ),
    Definition::of_fault(
        FaultName::FrozenChannel,
        "a channel repeats one value",
        &[
            Parameter { words: CHANNELS, ..number(Name::Channel, "which one", 0.0, 3.0, Value(1.0)) },
            TIME,
            number(Name::DurationS, "how long", 0.0, 1e6, Value(3.0)),
        ],
    ),
    Definition::of_fault(
        FaultName::MissingSamples,
        "rows without an output angle",
        &[number(Name::Share, "of the rows", 0.0, 0.5, Value(0.02))],
    ),
    Definition::of_fault(
        FaultName::ClockError,
        "time runs back",
        &[number(Name::StepS, "by which", 1e-4, 1e4, Value(0.5)), TIME],
    ),
    Definition::of_fault(
        FaultName::Outliers,
        "single rows far off",
        &[
            number(Name::Share, "of the rows", 0.0, 0.1, Value(0.002)),
            number(Name::SizeArcsec, "of the largest", 0.0, 1e6, Value(600.0)),
        ],
    ),
    Definition::of_fault(FaultName::UnitMismatch, "the output angle is in degrees and says radians", &[]),
    Definition::of_fault(
        FaultName::Quantisation,
        "a coarse output encoder",
        &[number(Name::StepArcsec, "its step", 0.0, 1e5, Value(30.0))],
    ),
    Definition::of_fault(
        FaultName::Drift,
        "a zero that moves with time",
        &[number(Name::ArcsecPerHour, "how fast", -1e6, 1e6, Value(300.0))],
    ),
    Definition::of_fault(
        FaultName::ReadJitter,
        "the two angles are not read at one instant",
        &[number(Name::JitterMs, "scatter of the time between them", 0.0, 100.0, Value(0.5))],
    ),
    Definition::of_fault(
        FaultName::Stalls,
        "the logger stands still now and then, and its time counts on",
        &[
            number(Name::EveryRows, "after this number of rows", 2.0, 1e5, Value(50.0)),
            number(Name::DurationS, "for so long", 0.0, 1e3, Value(0.05)),
        ],
    ),
    Definition::of_fault(
        FaultName::CounterRestart,
        "the count of the generator begins anew in the sessions after the first",
        &[number(Name::Turns, "off by", -1e5, 1e5, Value(7.0))],
    ),
    Definition::of_fault(FaultName::TorqueSign, "the torque has the wrong sign", &[]),
    Definition::of_fault(
        FaultName::TorqueScale,
        "the torque is in another unit, or of another shaft",
        &[number(Name::Factor, "of all values", -1e6, 1e6, Value(0.01))],
    ),
    Definition::of_fault(
        FaultName::TorqueZero,
        "the torque reads a load where there is none",
        &[number(Name::TorqueNM, "what it reads then", -1e6, 1e6, Value(0.8))],
    ),
    Definition::of_fault(
        FaultName::PositionJump,
        "the generator's angle leaps by whole turns",
        &[number(Name::Turns, "by how many", -1e5, 1e5, Value(16.0)), TIME],
    ),
    Definition::of_fault(
        FaultName::AveragedRows,
        "each row is the mean of those about it",
        &[number(Name::DurationS, "over so long", 0.0, 10.0, Value(0.06))],
    ),
];

/// Parameters that came to effects later, none of which is drawn: they take no number, so that a seed goes on making
/// the same noise.
const CAME_LATER: [ParameterName; 1] = [ParameterName::DeeperArcsec];

/// Everything that can be asked for: the causes of the library, then data faults.
#[must_use]
pub fn effects() -> Vec<Definition> {
    let causes = CauseName::ALL.iter().map(|cause| Definition::of_cause(*cause));
    causes.chain(FAULTS).collect()
}

/// An effect with the values of its parameters: those given, and once completed all.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// Its description.
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
        map.serialize_entry("name", self.definition.name())?;
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
    let Some(definition) = all.iter().find(|effect| effect.name() == name) else {
        let names: Vec<&str> = all.iter().map(Definition::name).collect();
        return Err(format!(
            "found \"{name}\"{}; allowed: {}",
            did_you_mean("; ", name, names.iter().copied()),
            names.join(", ")
        ));
    };
    let mut chosen = Chosen { definition: *definition, values: vec![None; definition.parameters.len()] };
    for part in rest.split(',').filter(|part| !part.trim().is_empty()) {
        let (key, value) =
            part.split_once('=').ok_or_else(|| format!("{name}: found \"{part}\"; allowed: parameter=value"))?;
        chosen.set(key.trim(), value.trim())?;
    }
    for (a, b, _) in definition.twins {
        if chosen.given(*a).is_some() && chosen.given(*b).is_some() {
            return Err(format!("{name}: {a} and {b} say the same; give one of them"));
        }
    }
    Ok(chosen)
}

impl Chosen {
    fn set(&mut self, key: &str, text: &str) -> Result<(), String> {
        let name = self.definition.name();
        let Some(place) = self.definition.parameters.iter().position(|parameter| parameter.name.as_str() == key) else {
            let names: Vec<&str> = self.definition.parameters.iter().map(|parameter| parameter.name.as_str()).collect();
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
        let whole =
            !parameter.words.is_empty() || [ParameterName::Harmonic, ParameterName::Tooth].contains(&parameter.name);
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
    pub fn given(&self, name: ParameterName) -> Option<f64> {
        let place = self.definition.parameters.iter().position(|parameter| parameter.name == name)?;
        self.values[place]
    }

    /// The value of a parameter of a completed effect.
    pub(super) fn value(&self, name: ParameterName) -> f64 {
        self.given(name).expect("a completed effect has all its parameters")
    }

    /// The effect with every parameter.
    pub(super) fn completed(&self, setting: &Setting<'_>, random: &mut fastrand::Rng) -> Result<Chosen, String> {
        let mut complete = self.clone();
        let definition = self.definition;
        let place = |name: ParameterName| {
            definition.parameters.iter().position(|p| p.name == name).expect("twins are parameters")
        };
        for (k, parameter) in definition.parameters.iter().enumerate() {
            let drawn = if CAME_LATER.contains(&parameter.name) { 0.0 } else { random.f64() };
            if complete.values[k].is_some() {
                continue;
            }
            // Which of two forms was given decides; the other follows below.
            let is_first_of_given =
                definition.twins.iter().any(|(a, b, _)| *a == parameter.name && self.given(*b).is_some());
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
        for (a, b, factor) in definition.twins {
            let factor = setting.factor(*factor, &complete)?;
            let (a, b) = (place(*a), place(*b));
            match (complete.values[a], complete.values[b]) {
                (Some(first), None) => complete.values[b] = Some(first * factor),
                (None, Some(second)) => complete.values[a] = Some(second / factor),
                _ => {}
            }
        }
        if let Some(time) = complete.given(ParameterName::TimeS) {
            let (first, last) = setting.span();
            if !(time > first && time < last) {
                let name = definition.name();
                return Err(format!("{name}: time_s: found {time}, allowed: within the data, {first:.2} to {last:.2}"));
            }
        }
        if let (Some(tooth), Some(wheel)) = (self.given(ParameterName::Tooth), complete.given(ParameterName::Wheel)) {
            let teeth = setting.teeth(wheel)?;
            if tooth >= teeth {
                return Err(format!("damaged_tooth: tooth: found {tooth}, allowed: 0 to {}", teeth - 1.0));
            }
        }
        Ok(complete)
    }
}

/// Sources that complete parameters.
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

    pub(crate) fn mean_speed_rad_s(&self) -> f64 {
        let speeds = self.on.speeds();
        (speeds.iter().map(|w| w.abs()).sum::<f64>() / speeds.len().max(1) as f64).max(1e-9)
    }

    fn teeth(&self, wheel: f64) -> Result<f64, String> {
        let teeth = self.nominal.teeth.ok_or("the model gives a ratio and no teeth; this effect needs them")?;
        Ok(f64::from(if wheel == 0.0 { teeth.flexspline } else { teeth.circular_spline }))
    }

    fn tooth_pitch_arcsec(&self) -> Result<f64, String> {
        let fixed = self.nominal.teeth.map(|teeth| teeth.fixed);
        Ok(flexspline_base::units::ARCSEC_PER_TURN
            / self.teeth(if fixed == Some(Fixed::CircularSpline) { 0.0 } else { 1.0 })?)
    }

    fn factor(&self, factor: Factor, effect: &Chosen) -> Result<f64, String> {
        let along = |radius_mm: f64| 1e-3 / radius_mm * ARCSEC_PER_RAD;
        Ok(match factor {
            Factor::AlongNormal => along(self.sizes.base_radius_mm),
            Factor::AlongPitch => along(self.sizes.pitch_radius_mm),
            // Half of it moves the teeth along the ring, and its radius opens them by the tangent of the flank angle.
            Factor::Oval => 0.5f64.hypot(OVAL_FLANK_RAD.tan()) * along(self.sizes.pitch_radius_mm),
            Factor::Tooth => TAU / self.teeth(effect.given(ParameterName::Wheel).unwrap_or(0.0))?,
            Factor::Ratio => self.nominal.ratio.abs(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cause_and_every_fault_can_be_asked_for_by_its_name() {
        for effect in effects() {
            assert_eq!(parse(effect.name()).unwrap().definition, effect);
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
        assert_eq!(parse("damaged_tooth:wheel=circular_spline").unwrap().given(ParameterName::Wheel), Some(1.0));
    }
}
