//! What is hidden in a case: a law, its size and its shape.

use serde::{Deserialize, Serialize};

use crate::cause::Cause;
use crate::chance::Chance;
use crate::drive::Drive;
use crate::outside::Outside;

/// Three sets of constitutive laws for the same causes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, clap::ValueEnum)]
pub enum Family {
    /// The plainer textbook law.
    A,
    /// Another law for the same physics.
    B,
    /// A third, from another part of the literature.
    C,
}

impl Family {
    /// All.
    pub const ALL: [Self; 3] = [Self::A, Self::B, Self::C];
}

/// A cause that has a name in the contract, or an effect that has none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(untagged)]
pub enum What {
    /// In the library of causes.
    Cause(Cause),
    /// Outside of it.
    Outside(Outside),
}

impl What {
    /// The name, snake case.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cause(cause) => cause.name(),
            Self::Outside(outside) => outside.name(),
        }
    }

    /// What describes it.
    pub fn spec(self, drive: &Drive) -> Spec {
        match self {
            Self::Cause(cause) => cause.spec(drive),
            Self::Outside(outside) => outside.spec(),
        }
    }

    /// True where a row of the data is too long a step for the law.
    pub fn is_fast(self) -> bool {
        match self {
            Self::Cause(cause) => cause == Cause::TorsionalResonance,
            Self::Outside(outside) => outside.is_fast(),
        }
    }
}

/// How a number of a law is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Range {
    /// 0..2π.
    Phase,
    /// Uniform.
    Linear(f64, f64),
    /// Uniform in the logarithm.
    Log(f64, f64),
    /// A seed of a profile.
    Seed,
}

impl Range {
    /// A draw.
    pub fn draw(self, chance: &mut Chance) -> f64 {
        match self {
            Self::Phase => chance.phase(),
            Self::Linear(low, high) => chance.uniform(low, high),
            Self::Log(low, high) => chance.log_uniform(low, high),
            Self::Seed => chance.below(1 << 30) as f64,
        }
    }

    /// Step for a derivative, and the value held inside the range.
    pub fn step(self, value: f64) -> f64 {
        match self {
            Self::Phase => 0.02,
            Self::Linear(low, high) => 0.01 * (high - low),
            Self::Log(..) => 0.02 * value,
            Self::Seed => 0.0,
        }
    }

    /// The value held inside.
    pub fn held(self, value: f64) -> f64 {
        match self {
            Self::Linear(low, high) | Self::Log(low, high) => value.clamp(low, high),
            Self::Phase | Self::Seed => value,
        }
    }
}

/// Numbers of a law.
#[derive(Debug, Clone)]
pub struct Spec {
    /// Name of the size, with its unit.
    pub size: &'static str,
    /// Smallest and largest size that a drive can show.
    pub range: (f64, f64),
    /// Either sign occurs.
    pub signed: bool,
    /// Name and range of the other numbers.
    pub shape: Vec<(&'static str, Range)>,
}

/// One hidden effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    /// Which.
    pub what: What,
    /// With whose law.
    pub family: Family,
    /// In the unit that the spec names.
    pub size: f64,
    /// In the order of the spec.
    pub shape: Vec<f64>,
}

impl Effect {
    /// Draws one with a size from its range.
    pub fn draw(what: What, family: Family, drive: &Drive, chance: &mut Chance) -> Self {
        let spec = what.spec(drive);
        let sign = if spec.signed { chance.sign() } else { 1.0 };
        Self {
            what,
            family,
            size: sign * chance.log_uniform(spec.range.0, spec.range.1),
            shape: spec.shape.iter().map(|(_, range)| range.draw(chance)).collect(),
        }
    }

    /// The same with another size.
    pub fn sized(&self, size: f64) -> Self {
        Self { size, ..self.clone() }
    }
}
