//! What is true of a case, and what an oracle could know of it.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::{fs, io};

use crate::bench::Bench;
use crate::case::Case;
use crate::cause::Cause;
use crate::chance::Chance;
use crate::drive::{Drive, Unit};
use crate::effect::{Effect, Family, What};
use crate::laws::Ratchet;
use crate::laws::Setting;
use crate::rival;

/// One hidden effect, or a fault of the data.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Hidden {
    /// As the contract names it, or an effect outside.
    pub name: String,
    /// Size and shape, by name.
    pub numbers: BTreeMap<String, f64>,
    /// What it adds to the error beyond what base parameters take up, rms, the others present.
    pub rms_arcsec: f64,
    /// Distance from the best fit without it, standard deviations.
    pub d: f64,
    /// Times the limit of detection; above one it counts.
    pub over_limit: f64,
    /// Causes that these data cannot tell from it, with the distance left.
    pub look_alikes: BTreeMap<String, f64>,
    /// Parameters that a diagnosis may state with an interval, by the names of the README.
    pub parameters: BTreeMap<String, f64>,
}

impl Hidden {
    /// Detectable.
    pub fn counts(&self) -> bool {
        self.over_limit >= 1.0
    }

    /// Whether this name is right, or cannot be told from right.
    pub fn is_called(&self, name: &str) -> bool {
        self.name == name || self.look_alikes.contains_key(name)
    }
}

/// A case, told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// Directory of the data.
    pub name: String,
    /// Of the examination.
    pub seed: u64,
    /// Of the case.
    pub index: u64,
    /// null, single, compound, outside, fault, logger.
    pub kind: String,
    /// A to H, V, or logger.
    pub family: String,
    /// What the excitation lacks.
    pub poor: Vec<String>,
    /// What the bench of family E does beside the drive.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bench: Vec<String>,
    /// Hidden effects.
    pub hidden: Vec<Hidden>,
    /// All hidden effects together beyond what base parameters take up, rms.
    pub removable_rms_arcsec: f64,
    /// White noise, encoder steps and wander, rms.
    pub floor_arcsec: f64,
    /// White noise alone, rms.
    pub white_arcsec: f64,
    /// Between the extremes of the generator angle.
    pub turns: f64,
}

impl Truth {
    /// Asks the oracle.
    pub fn of(case: &Case) -> Self {
        let mut chance = Chance::new(case.seed, "oracle", case.index);
        let mut hidden = Vec::new();
        for (at, effect) in case.effects.iter().enumerate() {
            let mut rest = case.effects.clone();
            rest.remove(at);
            let mut bench = Bench::new(&case.drive, &case.unit, &case.motion, &case.sensors, &rest);
            let contribution = bench.signature(effect);
            let weight = bench.weigh(&contribution);
            let over_limit = weight.over_limit(case.sensors.white_arcsec);
            let mut look_alikes = BTreeMap::new();
            // A jump of teeth is like nothing else.
            if over_limit >= 1.0 && effect.what != What::Cause(Cause::Ratcheting) {
                for (rival, d) in rival::look_alikes(&mut bench, &case.drive, effect, &contribution, &mut chance) {
                    look_alikes.insert(rival.name().to_owned(), rounded(d));
                }
            }
            let spec = effect.what.spec(&case.drive);
            let mut numbers: BTreeMap<_, _> =
                spec.shape.iter().zip(&effect.shape).map(|((name, _), value)| ((*name).to_owned(), *value)).collect();
            numbers.insert(spec.size.to_owned(), effect.size);
            hidden.push(Hidden {
                name: effect.what.name().to_owned(),
                numbers,
                rms_arcsec: rounded(weight.rms_arcsec),
                d: rounded(weight.d),
                over_limit: rounded(over_limit),
                look_alikes,
                parameters: parameters(effect, case),
            });
        }
        if let Some(fault) = case.fault {
            hidden.push(Hidden { name: fault.name().to_owned(), over_limit: 1.0, ..Hidden::default() });
        }
        let removable_rms_arcsec = if case.effects.is_empty() {
            0.0
        } else {
            let mut bench = Bench::new(&case.drive, &case.unit, &case.motion, &case.sensors, &[]);
            let all = bench.signature_of(&case.effects);
            bench.weigh(&all).rms_arcsec
        };
        Self {
            name: case.name.clone(),
            seed: case.seed,
            index: case.index,
            kind: case.kind.name().to_owned(),
            family: format!("{:?}", case.family),
            poor: case.poor.iter().map(|poor| format!("{poor:?}")).collect(),
            bench: Vec::new(),
            hidden,
            removable_rms_arcsec: rounded(removable_rms_arcsec),
            floor_arcsec: rounded(case.sensors.all_arcsec(&case.drive)),
            white_arcsec: rounded(case.sensors.white_arcsec),
            turns: rounded(case.motion.turns()),
        }
    }

    /// An effect outside the library that a named cause fits as well.
    pub fn outside_looks_named(&self) -> bool {
        self.kind == "outside" && self.hidden.iter().any(|hidden| !hidden.look_alikes.is_empty())
    }
}

/// To four digits, as truth files hold it.
pub fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

/// Parameters whose definition the contract's units leave no choice in; those of families B and C only where their laws
/// have them.
fn parameters(effect: &Effect, case: &Case) -> BTreeMap<String, f64> {
    let What::Cause(cause) = effect.what else { return BTreeMap::new() };
    let (drive, unit): (&Drive, &Unit) = (&case.drive, &case.unit);
    let a = case.family == Family::A;
    let a_or_c = case.family != Family::B;
    let size = effect.size;
    let mut list: Vec<(&str, f64)> = Vec::new();
    match cause {
        Cause::StiffnessError if a => list.push(("stiffness_ratio", unit.stiffness * (1.0 + size))),
        Cause::BacklashGrowth if a => {
            list.push(("growth_arcsec", size + (unit.backlash - 1.0) * drive.backlash_arcsec));
        }
        Cause::Wear => list.push(("growth_arcsec", size)),
        Cause::SensorLatency if a => list.push(("delay_s", size)),
        Cause::OutputEncoderEccentricity => {
            list.push(("amplitude_arcsec", size));
            if a_or_c {
                list.push(("phase_rad", effect.shape[0]));
            }
        }
        Cause::GeneratorEncoderEccentricity => {
            list.push(("amplitude_arcsec", size));
            list.push(("generator_amplitude_arcsec", size * drive.ratio().abs()));
        }
        Cause::CircularSplineEccentricity | Cause::FlexsplineRunout | Cause::GravitySideLoad if a => {
            list.push(("amplitude_arcsec", size));
        }
        Cause::RatioError => list.push(("ratio_relative_error", size)),
        Cause::GravityTorque if a_or_c => list.push(("torque_n_m", size)),
        Cause::TorsionalHysteresis => list.push(("half_width_arcsec", size)),
        Cause::ThermalClearance if a => list.push(("clearance_arcsec_per_k", size)),
        Cause::ThermalStiffness if a => list.push(("stiffness_relative_per_k", size)),
        Cause::TorsionalResonance if a => {
            list.push(("frequency_hz", effect.shape[0]));
            list.push(("damping_ratio", effect.shape[1]));
        }
        Cause::Ratcheting => {
            let setting = Setting { drive, unit, motion: &case.motion };
            list.push(("jump_arcsec", Ratchet::new(size, effect.shape[0], case.family, setting).slipped_arcsec()));
        }
        _ => {}
    }
    list.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

/// BLAKE3 of all truths in the order of their names: printed before the first answer is read.
pub fn commitment(truths: &[Truth]) -> String {
    let mut sorted: Vec<&Truth> = truths.iter().collect();
    sorted.sort_by(|a, b| a.name.cmp(&b.name));
    let mut hasher = blake3::Hasher::new();
    for truth in sorted {
        hasher.update(truth.json().as_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

impl Truth {
    /// What was written.
    ///
    /// # Errors
    /// If there is no such file.
    pub fn read(path: &Path) -> io::Result<Self> {
        Ok(serde_json::from_str(&fs::read_to_string(path)?)?)
    }

    /// As it is written and hashed.
    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).expect("numbers and names") + "\n"
    }
}
