//! Faults of the data themselves, on a drive that has none: to be named before any physics is blamed.

use serde::{Serialize, Serializer};

use crate::ARCSEC;
use crate::chance::Chance;

/// One fault, as the contract names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The output encoder loses counts once; everything after is shifted.
    EncoderIndexJump,
    /// A reading stands still for seconds while the drive moves.
    FrozenChannel,
    /// Readings are missing here and there.
    MissingSamples,
    /// Time goes back.
    ClockError,
    /// Single readings far off.
    Outliers,
    /// Degrees under a header that says rad, or kelvin under one that says °C.
    UnitMismatch,
}

impl Fault {
    /// All.
    pub const ALL: &[Self] = &[
        Self::EncoderIndexJump,
        Self::FrozenChannel,
        Self::MissingSamples,
        Self::ClockError,
        Self::Outliers,
        Self::UnitMismatch,
    ];

    /// In `diagnosis.json`.
    pub fn name(self) -> &'static str {
        match self {
            Self::EncoderIndexJump => "encoder_index_jump",
            Self::FrozenChannel => "frozen_channel",
            Self::MissingSamples => "missing_samples",
            Self::ClockError => "clock_error",
            Self::Outliers => "outliers",
            Self::UnitMismatch => "unit_mismatch",
        }
    }

    /// Spoils the rows: time, generator, output, torque, temperature, orientation.
    pub fn spoil(self, rows: &mut [[f64; 6]], row_s: f64, noise_arcsec: f64, chance: &mut Chance) {
        let count = rows.len();
        let somewhere = count / 5 + chance.below(3 * count / 5);
        match self {
            Self::EncoderIndexJump => {
                let jump = chance.sign() * chance.log_uniform(12.0, 60.0) * noise_arcsec / ARCSEC;
                rows[somewhere..].iter_mut().for_each(|row| row[2] += jump);
            }
            Self::FrozenChannel => {
                // Where it moves at all.
                let from = (somewhere..count - 1).find(|at| (rows[at + 1][1] - rows[*at][1]).abs() > 0.5 * row_s);
                let from = from.unwrap_or(somewhere);
                let lasts = (chance.uniform(1.5, 5.0) / row_s) as usize;
                let channel = *chance.of(&[1, 2]);
                let held = rows[from][channel];
                rows[from..(from + lasts).min(count)].iter_mut().for_each(|row| row[channel] = held);
            }
            Self::MissingSamples => {
                for _ in 0..40 + chance.below(100) {
                    let (at, channel) = (chance.below(count - 8), 1 + chance.below(2));
                    let lasts = 1 + chance.below(6);
                    rows[at..at + lasts].iter_mut().for_each(|row| row[channel] = f64::NAN);
                }
            }
            Self::ClockError => {
                let back_s = chance.uniform(0.3, 4.0);
                rows[somewhere..].iter_mut().for_each(|row| row[0] -= back_s);
            }
            Self::Outliers => {
                for _ in 0..20 + chance.below(60) {
                    let off = chance.sign() * chance.log_uniform(60.0, 2000.0) * noise_arcsec / ARCSEC;
                    rows[chance.below(count)][2] += off;
                }
            }
            Self::UnitMismatch => match chance.below(3) {
                0 => rows.iter_mut().for_each(|row| row[2] = row[2].to_degrees()),
                1 => rows.iter_mut().for_each(|row| row[1] = row[1].to_degrees()),
                _ => rows.iter_mut().for_each(|row| row[4] += 273.15),
            },
        }
    }
}

impl Serialize for Fault {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_fault_shows_in_the_rows_and_nowhere_before() {
        for &fault in Fault::ALL {
            let clean: Vec<[f64; 6]> =
                (0..4000).map(|at| f64::from(at) * 0.01).map(|t| [t, 5.0 * t, 0.05 * t, 1.0, 20.0, 0.0]).collect();
            let mut rows = clean.clone();
            fault.spoil(&mut rows, 0.01, 2.0, &mut Chance::new(1, fault.name(), 0));
            let changed = rows.iter().zip(&clean).filter(|(a, b)| a.map(f64::to_bits) != b.map(f64::to_bits)).count();
            assert!(changed >= 20, "{}: {changed}", fault.name());
            let backwards = rows.windows(2).any(|pair| pair[1][0] <= pair[0][0]);
            assert_eq!(backwards, fault == Fault::ClockError, "{}", fault.name());
            let missing = rows.iter().flatten().any(|x| x.is_nan());
            assert_eq!(missing, fault == Fault::MissingSamples, "{}", fault.name());
        }
    }
}
