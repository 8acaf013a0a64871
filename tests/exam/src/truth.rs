//! The truth of a case with the verdict of the oracle.

use serde::Serialize;
use std::collections::BTreeMap;

use crate::answer::Answer;

/// One hidden effect, or a fault of the logger.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Hidden {
    /// As the contract names it, or an effect outside of it.
    pub name: String,
    /// Size and shape, by name.
    pub numbers: BTreeMap<String, f64>,
    /// Part of the error that base parameters do not take up, rms, the others present.
    pub rms_arcsec: f64,
    /// Distance from the best fit without it, standard deviations.
    pub d: f64,
    /// Times the limit of detection; from one on it counts.
    pub over_limit: f64,
    /// Causes that these data cannot tell from it, with the distance left.
    pub look_alikes: BTreeMap<String, f64>,
    /// Parameters that a diagnosis may state with an interval.
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

/// As it is sealed and, after the answers, written.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Truth {
    /// Directory of the data.
    pub name: String,
    pub seed: u64,
    pub index: u64,
    /// null, single, compound, outside, logger.
    pub kind: String,
    /// D, E, G, H or logger.
    pub family: String,
    /// No case lacks excitation any more; files keep the field.
    pub poor: [(); 0],
    /// Habits of the bench of family E.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bench: Vec<String>,
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
    /// As it is written and hashed.
    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).expect("numbers and names") + "\n"
    }

    /// Whether the faults of the data in an answer are what is hidden.
    pub fn accepts(&self, answer: &Answer) -> bool {
        answer.data_faults.iter().all(|fault| self.hidden.iter().any(|hidden| hidden.is_called(&fault.name)))
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
