//! What is wrong with data, as opposed to the drive.

use serde::Serialize;

use super::columns::Quantity;

/// Name of a data fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultName {
    /// The count of an encoder is off by a constant from some instant on.
    EncoderIndexJump,
    /// A channel repeats one value while it should change.
    FrozenChannel,
    /// Values or rows that were not recorded.
    MissingSamples,
    /// Time that runs back, stands, jumps or jitters.
    ClockError,
    /// Single rows that neither the rows before nor those after bear out.
    Outliers,
    /// A unit, a sign or a column taken for another.
    UnitMismatch,
    /// A resolution too coarse for the noise to blur it.
    Quantisation,
    /// A zero that moves with time, the same in every state of the drive.
    Drift,
}

impl FaultName {
    /// Its name in files, snake case.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            FaultName::EncoderIndexJump => "encoder_index_jump",
            FaultName::FrozenChannel => "frozen_channel",
            FaultName::MissingSamples => "missing_samples",
            FaultName::ClockError => "clock_error",
            FaultName::Outliers => "outliers",
            FaultName::UnitMismatch => "unit_mismatch",
            FaultName::Quantisation => "quantisation",
            FaultName::Drift => "drift",
        }
    }
}

/// What was done about a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Treatment {
    /// Undone: the values used are not those of the file.
    Repaired,
    /// The rows, or the whole channel, are left out.
    Masked,
    /// Nothing: the values are used as they are.
    Kept,
}

/// A fault of the data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fault {
    /// Its name.
    pub name: FaultName,
    /// The channel, if one is to blame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channel: Option<Quantity>,
    /// When it begins, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_s: Option<f64>,
    /// When it ends, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub until_s: Option<f64>,
    /// First line concerned.
    pub first_line: u64,
    /// Last line concerned.
    pub last_line: u64,
    /// Rows concerned; where rows are missing, how many.
    pub rows: u64,
    /// Size at the output, arcsec: of a jump signed, else of the largest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_arcsec: Option<f64>,
    /// What was done.
    pub treatment: Treatment,
    /// One sentence for a reader.
    pub what: String,
}

/// A lasting step of the error that is a whole number of tooth pitches: the drive has ratcheted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ToothStep {
    /// Session, from 0.
    pub session: usize,
    /// First row of the session after the step.
    pub row: usize,
    /// Line of that row.
    pub line: u64,
    /// When, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_s: Option<f64>,
    /// Size, arcsec at the output; positive: the output has gained on the generator.
    pub size_arcsec: f64,
    /// Tooth pitches, with the sign of the size.
    pub pitches: i32,
}
