//! The effects that can be asked for by name: parameters with unit, meaning, range and default.
//!
//! Names and conventions are those of `diagnosis.json`: amplitudes in arc-seconds are at the output; `amplitude_um` is
//! a displacement along the normal of the flanks for eccentricities (over the base radius), along the pitch circle for
//! pitch errors.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};
use thiserror::Error;

use super::Sizes;
use super::data_fault::{DataFault, FAULTS};
use crate::causes::spec::CauseSpec;
use crate::causes::{CauseName, Factor, ParameterName, ParameterName as Name, ParameterSpec, Usual};
use crate::diagnosis::rows::Rows;
use crate::nominal::Nominal;
use flexspline_base::suggest::did_you_mean;
use flexspline_base::units::{ARCSEC_PER_RAD, ARCSEC_PER_TURN};

/// An effect that can be asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Definition {
    /// Its name, snake case.
    pub name: &'static str,
    /// The cause of the library that it is; none of a fault of the data.
    pub cause: Option<CauseName>,
    /// In words.
    pub meaning: &'static str,
    /// Its parameters.
    pub parameters: &'static [ParameterSpec],
    /// Two forms of the same, and the factor from the first to the second.
    twins: &'static [(ParameterName, ParameterName, Factor)],
}

impl Definition {
    fn of_cause(cause: CauseName) -> Definition {
        let CauseSpec { name, does: meaning, parameters, twins, .. } = *cause.spec();
        Definition { name, cause: Some(cause), meaning, parameters, twins }
    }

    fn of_fault(fault: &DataFault) -> Definition {
        let DataFault { name, meaning, parameters, .. } = *fault;
        Definition { name: name.as_str(), cause: None, meaning, parameters, twins: &[] }
    }
}

/// Parameters that came to effects later, none of which is drawn: they take no number, so that a seed goes on making
/// the same noise.
const CAME_LATER: [ParameterName; 1] = [ParameterName::DeeperArcsec];

/// Everything that can be asked for: the causes of the library, then data faults.
pub fn effects() -> Vec<Definition> {
    let causes = CauseName::ALL.iter().map(|cause| Definition::of_cause(*cause));
    causes.chain(FAULTS.iter().map(Definition::of_fault)).collect()
}

/// An effect with the values of its parameters: those given, and once completed all.
#[derive(Clone, Debug, PartialEq)]
pub struct Effect {
    /// Its description.
    pub definition: Definition,
    /// Values of its parameters.
    values: BTreeMap<ParameterName, f64>,
}

impl Serialize for Effect {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        struct Values<'a>(&'a Effect);
        impl Serialize for Values<'_> {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                let value = |of: &ParameterSpec| Some((of.name, self.0.given(of.name)?));
                serializer.collect_map(self.0.definition.parameters.iter().filter_map(value))
            }
        }
        let mut map = serializer.serialize_map(Some(2))?;
        map.serialize_entry("name", self.definition.name)?;
        map.serialize_entry("parameters", &Values(self))?;
        map.end()
    }
}

/// An effect that cannot be asked for, or not with this parameter: the text found and what is allowed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct EffectError(String);

impl EffectError {
    /// Of a drive that is known by its ratio alone.
    fn no_teeth() -> EffectError {
        EffectError("the model gives a ratio and no teeth; this effect needs them".to_owned())
    }

    /// A name that is none of those `allowed`, with the one that may be meant.
    pub(crate) fn unknown(what: &str, found: &str, allowed: &[&str]) -> EffectError {
        let hint = did_you_mean("; ", found, allowed.iter().copied());
        let allowed = if allowed.is_empty() { "no parameter".to_owned() } else { allowed.join(", ") };
        EffectError(format!("{what}\"{found}\"{hint}; allowed: {allowed}"))
    }
}

/// Reads `NAME` or `NAME:param=value,...`.
///
/// # Errors
/// The text found and what is allowed, with a suggestion for a name that is nearly one.
pub fn parse(text: &str) -> Result<Effect, EffectError> {
    let (name, rest) = text.split_once(':').unwrap_or((text, ""));
    let all = effects();
    let Some(definition) = all.iter().find(|effect| effect.name == name) else {
        return Err(EffectError::unknown("found ", name, &all.iter().map(|effect| effect.name).collect::<Vec<_>>()));
    };
    let mut effect = Effect::of(*definition);
    for part in rest.split(',').filter(|part| !part.trim().is_empty()) {
        let no_value = || EffectError(format!("{name}: found \"{part}\"; allowed: parameter=value"));
        let (key, value) = part.split_once('=').ok_or_else(no_value)?;
        effect.set(key.trim(), value.trim())?;
    }
    match definition.twins.iter().find(|(a, b, _)| effect.given(*a).is_some() && effect.given(*b).is_some()) {
        Some((a, b, _)) => Err(EffectError(format!("{name}: {a} and {b} say the same; give one of them"))),
        None => Ok(effect),
    }
}

impl Effect {
    /// The effect with no parameter given.
    fn of(definition: Definition) -> Effect {
        Effect { definition, values: BTreeMap::new() }
    }

    /// A cause with the values of some of its parameters, each brought into its range.
    ///
    /// # Errors
    /// A value that is no number, or none of a count.
    pub(crate) fn of_cause(
        cause: CauseName,
        value: impl Fn(ParameterName) -> Option<f64>,
    ) -> Result<Effect, EffectError> {
        let mut effect = Effect::of(Definition::of_cause(cause));
        for parameter in effect.definition.parameters {
            let [low, high] = parameter.range;
            if let Some(value) = value(parameter.name).map(|value| value.clamp(low, high)) {
                effect.put(parameter, Some(value), &format!("{value:?}"))?;
            }
        }
        Ok(effect)
    }

    fn set(&mut self, key: &str, text: &str) -> Result<(), EffectError> {
        let (effect, parameters) = (self.definition.name, self.definition.parameters);
        let Some(parameter) = parameters.iter().find(|parameter| parameter.name.as_str() == key) else {
            let allowed: Vec<&str> = parameters.iter().map(|parameter| parameter.name.as_str()).collect();
            return Err(EffectError::unknown(&format!("{effect}: found parameter "), key, &allowed));
        };
        if self.given(parameter.name).is_some() {
            return Err(EffectError(format!("{effect}: {} is given twice", parameter.name)));
        }
        let word = parameter.words.iter().position(|word| *word == text).map(|k| k as f64);
        self.put(parameter, word.or_else(|| text.parse().ok()), text)
    }

    /// Sets a parameter to what was `found`, if that is allowed.
    fn put(&mut self, parameter: &ParameterSpec, value: Option<f64>, found: &str) -> Result<(), EffectError> {
        let [low, high] = parameter.range;
        let whole = !parameter.words.is_empty() || [Name::Harmonic, Name::Tooth].contains(&parameter.name);
        let allowed = |value: &f64| *value >= low && *value <= high && (!whole || value.fract() == 0.0);
        let refused = || self.refused(parameter.name, found, &parameter.allowed());
        self.values.insert(parameter.name, value.filter(allowed).ok_or_else(refused)?);
        Ok(())
    }

    /// A value that is out of range, or does not fit the data.
    fn refused(&self, parameter: ParameterName, found: &str, allowed: &str) -> EffectError {
        EffectError(format!("{}: {parameter}: found {found}, allowed: {allowed}", self.definition.name))
    }

    /// The value of a parameter, if it has one.
    pub fn given(&self, name: ParameterName) -> Option<f64> {
        self.values.get(&name).copied()
    }

    /// The value of a parameter of a completed effect.
    pub(super) fn value(&self, name: ParameterName) -> f64 {
        self.given(name).expect("a completed effect has all its parameters")
    }

    /// The effect with every parameter.
    pub(super) fn completed(&self, setting: &Setting<'_>, random: &mut fastrand::Rng) -> Result<Effect, EffectError> {
        let mut complete = self.clone();
        let Definition { parameters, twins, .. } = self.definition;
        for parameter in parameters {
            let drawn = if CAME_LATER.contains(&parameter.name) { 0.0 } else { random.f64() };
            // Which of two forms was given decides; the other follows below.
            let is_first_of_given = twins.iter().any(|(a, b, _)| *a == parameter.name && self.given(*b).is_some());
            if self.given(parameter.name).is_some() || is_first_of_given {
                continue;
            }
            let value = match parameter.usual {
                Usual::Value(value) => value,
                Usual::OfLoad(share) => share * setting.load_n_m,
                Usual::Drawn(low, high) => low + (high - low) * drawn,
                Usual::Instant(low, high) => setting.instant(low + (high - low) * drawn),
                Usual::ToothPitch => {
                    ARCSEC_PER_TURN / f64::from(setting.nominal.teeth.ok_or_else(EffectError::no_teeth)?.of_output())
                }
                Usual::Follows => continue,
            };
            complete.values.insert(parameter.name, value);
        }
        for (a, b, factor) in twins {
            let factor = setting.factor(*factor, &complete)?;
            match (complete.given(*a), complete.given(*b)) {
                (Some(first), None) => complete.values.insert(*b, first * factor),
                (None, Some(second)) => complete.values.insert(*a, second / factor),
                _ => None,
            };
        }
        let [first, last] = setting.span();
        if let Some(time) = complete.given(Name::TimeS).filter(|time| !(*time > first && *time < last)) {
            let allowed = format!("within the data, {first:.2} to {last:.2}");
            return Err(self.refused(Name::TimeS, &time.to_string(), &allowed));
        }
        if let (Some(tooth), Some(wheel)) = (self.given(Name::Tooth), complete.given(Name::Wheel)) {
            let teeth = setting.teeth(wheel)?;
            if tooth >= teeth {
                return Err(self.refused(Name::Tooth, &tooth.to_string(), &format!("0 to {}", teeth - 1.0)));
            }
        }
        Ok(complete)
    }
}

/// Flank angle by which the radius of an oval opens its spaces, rad: about that where teeth of HHD-95 bear. *Guess*.
const OVAL_FLANK_RAD: f64 = 0.4;

/// Sources that complete parameters.
pub(super) struct Setting<'a> {
    nominal: &'a Nominal,
    sizes: Sizes,
    time_s: &'a [f64],
    /// Largest torque, N·m.
    pub load_n_m: f64,
}

impl<'a> Setting<'a> {
    /// A drive over rows.
    pub(super) fn new(nominal: &'a Nominal, sizes: Sizes, rows: &'a Rows) -> Setting<'a> {
        let load_n_m = rows.torque.iter().fold(1e-9, |most: f64, torque| most.max(torque.abs()));
        Setting { nominal, sizes, time_s: &rows.time, load_n_m }
    }

    fn span(&self) -> [f64; 2] {
        [self.time_s.first(), self.time_s.last()].map(|time| time.copied().unwrap_or(0.0))
    }

    /// The time at a share of the rows: between sessions nothing happens.
    fn instant(&self, share: f64) -> f64 {
        self.time_s.get((share * self.time_s.len() as f64) as usize).copied().unwrap_or(0.0)
    }

    fn teeth(&self, wheel: f64) -> Result<f64, EffectError> {
        let teeth = self.nominal.teeth.ok_or_else(EffectError::no_teeth)?;
        Ok(f64::from(if wheel == 0.0 { teeth.flexspline } else { teeth.circular_spline }))
    }

    fn factor(&self, factor: Factor, effect: &Effect) -> Result<f64, EffectError> {
        let along = |radius_mm: f64| 1e-3 / radius_mm * ARCSEC_PER_RAD;
        Ok(match factor {
            Factor::AlongNormal => along(self.sizes.base_radius_mm),
            Factor::AlongPitch => along(self.sizes.pitch_radius_mm),
            // Half of it moves the teeth along the ring, and its radius opens them by the tangent of the flank angle.
            Factor::Oval => 0.5f64.hypot(OVAL_FLANK_RAD.tan()) * along(self.sizes.pitch_radius_mm),
            Factor::Tooth => TAU / self.teeth(effect.given(Name::Wheel).unwrap_or(0.0))?,
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
            assert_eq!(parse(effect.name).unwrap().definition, effect);
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
            let error = parse(text).unwrap_err().to_string();
            assert!(error.contains(message), "{text}: {error}");
        }
        assert_eq!(parse("damaged_tooth:wheel=circular_spline").unwrap().given(ParameterName::Wheel), Some(1.0));
    }
}
