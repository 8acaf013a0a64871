//! One question of an examination, whichever plant it comes from.

use crate::case::{Case, Draw};
use crate::fresh::Fresh;
use crate::truth::Truth;

/// A case of one of the plants. Few are held at a time.
#[allow(clippy::large_enum_variant, reason = "few are held at a time")]
pub enum Question {
    /// Families A, B, C.
    Case(Case),
    /// Families D to H and V, and faults of loggers, under the name that says nothing.
    Fresh(Fresh, String),
}

impl Question {
    /// The question of this seed and index.
    pub fn draw(seed: u64, index: u64, draw: &Draw) -> Self {
        if draw.is_fresh() {
            Self::Fresh(Fresh::draw(seed, index, draw), Case::name(seed, index))
        } else {
            Self::Case(Case::draw(seed, index, draw))
        }
    }

    /// What is small enough to be held until it is asked: a case of the first families holds its whole run, and is drawn
    /// in a moment; one of the others takes a second or two, as the oracle has a hand in it.
    pub fn kept(self) -> Option<Self> {
        matches!(self, Self::Fresh(..)).then_some(self)
    }

    /// The truth.
    pub fn truth(&self) -> Truth {
        match self {
            Self::Case(case) => Truth::of(case),
            Self::Fresh(case, name) => case.truth(name.clone()),
        }
    }

    /// `data.csv` that the diagnosis is given.
    pub fn data(&self) -> String {
        match self {
            Self::Case(case) => case.data(),
            Self::Fresh(case, _) => case.data(),
        }
    }

    /// `nominal.toml` that the diagnosis is given.
    pub fn nominal_toml(&self) -> String {
        match self {
            Self::Case(case) => case.drive.nominal_toml(),
            Self::Fresh(case, _) => case.nominal_toml(),
        }
    }
}
