//! Diagnosers that are no diagnosers, to test the examiner: one that never names anything, one that always names the
//! same, and one that reads the truth.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use clap::{Parser, ValueEnum};
use flexspline_exam::truth::Truth;
use serde_json::{Value, json};

#[derive(Clone, Copy, ValueEnum)]
enum Manner {
    None,
    Always,
    Truth,
}

/// Answers without looking at the data.
#[derive(Parser)]
struct Cli {
    /// How
    #[arg(long)]
    manner: Manner,
    /// Cause that `always` names
    #[arg(long, default_value = "wear")]
    cause: String,
    /// Where `truth` reads
    #[arg(long)]
    truth: Option<PathBuf>,
    /// Only `diagnose`
    command: String,
    /// Data
    data: PathBuf,
    #[arg(long)]
    model: PathBuf,
    #[arg(long)]
    out: PathBuf,
}

fn main() -> Result<(), Box<dyn Error>> {
    let cli = Cli::parse();
    let named = |name: &str| json!({ "name": name, "confidence": 1.0, "parameters": {}, "look_alikes": [] });
    let answer = match cli.manner {
        Manner::None => json!({ "verdict": "none", "causes": [] }),
        Manner::Always => json!({ "verdict": "explained", "causes": [named(&cli.cause)] }),
        Manner::Truth => truthful(&cli.truth.ok_or("--truth DIR")?, &cli.data)?,
    };
    fs::write(cli.out.join("diagnosis.json"), serde_json::to_string_pretty(&answer)?)?;
    Ok(())
}

fn truthful(dir: &Path, data: &Path) -> Result<Value, Box<dyn Error>> {
    let case = data.parent().and_then(Path::file_name).ok_or("data without a directory")?;
    let truth: Truth = serde_json::from_str(&fs::read_to_string(dir.join(case).with_extension("json"))?)?;
    let (outside, fault) = (truth.kind == "outside", truth.kind == "fault" || truth.kind == "logger");
    let counted: Vec<_> = truth.hidden.iter().filter(|hidden| hidden.counts()).collect();
    let causes: Vec<Value> = counted
        .iter()
        .filter(|_| !outside && !fault)
        .map(|hidden| {
            let parameters: serde_json::Map<_, _> = hidden
                .parameters
                .iter()
                .map(|(name, value)| (name.clone(), json!({ "value": value, "std": 1e-6 + 0.01 * value.abs() })))
                .collect();
            json!({ "name": hidden.name, "confidence": 1.0, "parameters": parameters, "look_alikes": [] })
        })
        .collect();
    let faults: Vec<Value> = counted.iter().filter(|_| fault).map(|hidden| json!({ "name": hidden.name })).collect();
    let verdict = match (counted.is_empty() || fault, outside) {
        (true, _) => "none",
        (false, true) => "unknown",
        (false, false) => "explained",
    };
    let before = truth.floor_arcsec.hypot(truth.removable_rms_arcsec);
    let after = if outside { before } else { truth.floor_arcsec };
    Ok(json!({ "verdict": verdict, "causes": causes, "data_faults": faults,
               "held_out": { "rms_before_arcsec": before, "rms_after_arcsec": after } }))
}
