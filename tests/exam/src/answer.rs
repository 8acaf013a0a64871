//! `diagnosis.json`, as the contract has it.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A value with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Best value.
    pub value: f64,
    /// Standard deviation, if stated.
    #[serde(default)]
    pub std: Option<f64>,
}

/// One cause that was named.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Named {
    /// Snake case.
    pub name: String,
    /// 0..1.
    #[serde(default)]
    pub confidence: f64,
    /// By name.
    #[serde(default)]
    pub parameters: BTreeMap<String, Estimate>,
    /// At most three that the data cannot tell from it.
    #[serde(default)]
    pub look_alikes: Vec<String>,
}

/// One fault of the data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DataFault {
    /// Snake case.
    pub name: String,
}

/// Root mean square before and after.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// Of the nominal model.
    pub rms_before_arcsec: f64,
    /// Of the extended model.
    pub rms_after_arcsec: f64,
}

/// The answer to one case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// none, explained, partly_explained or unknown.
    pub verdict: String,
    /// Strongest first.
    #[serde(default)]
    pub causes: Vec<Named>,
    /// What is wrong with the data.
    #[serde(default)]
    pub data_faults: Vec<DataFault>,
    /// On data that took no part.
    #[serde(default)]
    pub held_out: Option<HeldOut>,
}

impl Answer {
    /// Reads one.
    ///
    /// # Errors
    /// If it is no such JSON, or its verdict is none of the four.
    pub fn read(text: &str) -> Result<Self, String> {
        let answer: Self = serde_json::from_str(text).map_err(|error| error.to_string())?;
        if !["none", "explained", "partly_explained", "unknown"].contains(&answer.verdict.as_str()) {
            return Err(format!("verdict `{}`: none, explained, partly_explained or unknown", answer.verdict));
        }
        Ok(answer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_of_the_contract_is_read() {
        let text = r#"{ "verdict": "explained",
            "causes": [ { "name": "circular_spline_eccentricity", "confidence": 0.97,
                "parameters": { "amplitude_um": { "value": 9.8, "std": 0.4 } }, "held_out_gain": 0.61, "look_alikes": ["wear"] } ],
            "data_faults": [ { "name": "encoder_index_jump", "time_s": 41.2, "size_arcsec": 53.0 } ],
            "residual": { "rms_before_arcsec": 0, "rms_after_arcsec": 0, "noise_floor_arcsec": 0, "unexplained_fraction": 0 },
            "held_out": { "rms_before_arcsec": 4, "rms_after_arcsec": 1 }, "next_experiment": null }"#;
        let answer = Answer::read(text).unwrap();
        assert_eq!(answer.causes[0].parameters["amplitude_um"], Estimate { value: 9.8, std: Some(0.4) });
        assert_eq!(answer.held_out.unwrap().rms_after_arcsec, 1.0);
        assert!(Answer::read(&text.replace("explained", "perhaps")).is_err());
    }
}
