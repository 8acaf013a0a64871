//! Which coefficients are learnt, and how.

use core::fmt;

/// A coefficient in addition to the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Term {
    /// Offset of the mean error, rad.
    Mean,
    /// Wind-up, rad/(N·m).
    WindUp,
    /// Half-width of the play, rad.
    HalfWidth,
    /// Cosine with N periods in a generator turn, rad.
    Cos(u8),
    /// Sine with N periods in a generator turn, rad.
    Sin(u8),
}

/// A coefficient to be estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficient {
    /// Which.
    pub term: Term,
    /// It stays within ± this: rad, or rad/(N·m); above 0, 0.05 at most.
    pub limit: f32,
    /// Standard deviation that it is expected to have at first, and never exceeds: same unit, above 0.
    pub initial_std: f32,
}

/// Settings of an [`OnlineCalibration`](crate::OnlineCalibration).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptSettings<const N: usize> {
    /// The coefficients.
    pub coefficients: [Coefficient; N],
    /// Standard deviation of one measurement, rad at the output: its noise and what the table missed of its samples.
    pub noise_rad: f32,
    /// Measurements after which what was learnt in their direction is forgotten: 1 to 10⁶.
    pub memory_measurements: f32,
    /// Standard deviations beyond which an innovation is an outlier: 1 to 100.
    pub gate: f32,
    /// Way at the output after a reversal that is left out in addition to four times the limit of the half-width,
    /// rad: elastic hysteresis; 0 to 0.05.
    pub settle_rad: f32,
    /// Torque beyond which the wind-up's share grows no more, N·m.
    pub torque_limit_n_m: f32,
}

/// Which setting cannot be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptError {
    /// Name of the setting.
    pub name: &'static str,
    /// Value found.
    pub found: f32,
}

impl fmt::Display for AdaptError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}: not within its range", self.name, self.found)
    }
}

impl core::error::Error for AdaptError {}

/// Why saved bytes are no state of this adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdaptRestoreError {
    /// Fewer bytes than this number of coefficients takes.
    Short {
        /// Bytes found.
        found: usize,
        /// Bytes that they take.
        needed: usize,
    },
    /// Not of this version.
    Version {
        /// The first bytes; `FXA` and 2 are read.
        found: [u8; 4],
    },
    /// The CRC-32 does not match: damaged, or not written to the end.
    Crc,
    /// Learnt with another table.
    OtherTable,
    /// Learnt by a joint with other settings, or by another unit.
    OtherJoint,
    /// Saved with other coefficients.
    OtherCoefficients,
    /// Numbers that no adapter can have saved.
    Impossible,
}

impl fmt::Display for AdaptRestoreError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Short { found, needed } => write!(f, "{found} bytes of a saved learner, {needed} are needed"),
            Self::Version { found } => write!(f, "a saved learner begins with {found:02x?}, FXA and 2 are read"),
            Self::Crc => f.write_str("the saved learner is damaged"),
            Self::OtherTable => f.write_str("the coefficients were learnt with another table"),
            Self::OtherJoint => f.write_str("the coefficients were learnt by another joint"),
            Self::OtherCoefficients => f.write_str("other coefficients were saved"),
            Self::Impossible => f.write_str("no adapter can have saved this state"),
        }
    }
}

impl core::error::Error for AdaptRestoreError {}
