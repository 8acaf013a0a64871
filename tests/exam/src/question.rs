//! One question of an examination, whichever plant it comes from: the truth, and the files that the diagnosis is given.

use crate::case::{Case, Draw};
use crate::fresh::Fresh;
use crate::truth::Truth;

/// What the diagnosis is given.
#[derive(Debug, Clone, PartialEq)]
pub struct Files {
    /// `data.csv`.
    pub data: String,
    /// `nominal.toml`.
    pub nominal: String,
}

/// The truth of the case of this seed and index.
pub fn truth(seed: u64, index: u64, draw: &Draw) -> Truth {
    if draw.is_fresh() {
        Fresh::draw(seed, index, draw).truth(Case::name(seed, index))
    } else {
        Truth::of(&Case::draw(seed, index, draw))
    }
}

/// Its files.
pub fn files(seed: u64, index: u64, draw: &Draw) -> Files {
    if draw.is_fresh() {
        let case = Fresh::draw(seed, index, draw);
        Files { data: case.data(), nominal: case.nominal_toml() }
    } else {
        let case = Case::draw(seed, index, draw);
        Files { data: case.data(), nominal: case.drive.nominal_toml() }
    }
}
