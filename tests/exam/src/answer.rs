//! `diagnosis.json`, as the contract has it.

use serde::Deserialize;
use std::collections::BTreeMap;

use crate::logger::LoggerFault;

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct Estimate {
    pub value: f64,
    #[serde(default)]
    pub std: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Named {
    pub name: String,
    #[serde(default)]
    pub confidence: f64,
    #[serde(default)]
    pub parameters: BTreeMap<String, Estimate>,
    /// At most three that the data cannot tell from it.
    #[serde(default)]
    pub look_alikes: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct DataFault {
    pub name: String,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct HeldOut {
    pub rms_before_arcsec: f64,
    pub rms_after_arcsec: f64,
}

/// The answer to one case.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Answer {
    /// none, explained, partly_explained or unknown.
    pub verdict: String,
    #[serde(default)]
    pub causes: Vec<Named>,
    #[serde(default)]
    pub data_faults: Vec<DataFault>,
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

    /// The answer that a refusal gives, exit code 2: another ratio, both named; or units, with the mapping that mends
    /// this fault of the logger.
    pub fn of_refusal(fault: Option<LoggerFault>, ended: &str, said: &str) -> Option<Self> {
        let names_both = said.contains("ratio: found ") && said.contains(", but the generator turns ");
        let mended = |fault: &LoggerFault| fault.refused_with().iter().any(|mapping| said.contains(mapping));
        let name = if names_both { "ratio_mismatch" } else { fault.filter(mended)?.name() };
        ended.ends_with("exit status: 2").then(|| Self {
            verdict: "unknown".into(),
            causes: Vec::new(),
            data_faults: vec![DataFault { name: name.into() }],
            held_out: None,
        })
    }
}
