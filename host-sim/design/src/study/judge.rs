//! Which variants keep to the constraints, and which of those nothing beats.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

use super::{RunStatus, StudyRun};
use crate::data_sheet::{DataSheet, FIGURES, FigureOf};
use flexspline_base::suggest::did_you_mean;
use flexspline_mechanics::drive::RigidMesh;

/// A figure by name.
///
/// # Errors
/// There is none of that name.
pub fn figure(name: &str) -> Result<FigureOf, JudgeError> {
    FIGURES.into_iter().find(|(known, _)| *known == name).ok_or_else(|| JudgeError::Figure {
        found: name.to_owned(),
        hint: did_you_mean("; ", name, FIGURES.map(|(known, _)| known)),
    })
}

/// A constraint or target that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum JudgeError {
    /// No such figure.
    #[error("figure {found:?} is not known; allowed: {}{hint}", FIGURES.map(|(name, _)| name).join(", "))]
    Figure {
        /// What was found.
        found: String,
        /// What may be meant.
        hint: String,
    },
    /// Not a range.
    #[error("found {found:?}, allowed: FIGURE=LEAST..MOST, either end may be left out")]
    Range {
        /// What was found.
        found: String,
    },
}

/// A range that a figure has to keep to.
#[derive(Debug, Clone, PartialEq)]
pub struct Constraint {
    /// The figure.
    pub figure: &'static str,
    /// Its least value.
    pub least: f64,
    /// Its largest value.
    pub most: f64,
}

impl FromStr for Constraint {
    type Err = JudgeError;

    fn from_str(text: &str) -> Result<Constraint, JudgeError> {
        let wrong = || JudgeError::Range { found: text.to_owned() };
        let (name, range) = text.split_once('=').ok_or_else(wrong)?;
        let (least, most) = range.split_once("..").ok_or_else(wrong)?;
        let end = |text: &str, open: f64| match text.trim() {
            "" => Ok(open),
            number => number.parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(wrong),
        };
        let (least, most) = (end(least, f64::NEG_INFINITY)?, end(most, f64::INFINITY)?);
        if least > most || (least.is_infinite() && most.is_infinite()) {
            return Err(wrong());
        }
        Ok(Constraint { figure: figure(name.trim())?.0, least, most })
    }
}

/// As `--keep` takes it.
impl fmt::Display for Constraint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let end = |value: f64| if value.is_finite() { value.to_string() } else { String::new() };
        write!(f, "{}={}..{}", self.figure, end(self.least), end(self.most))
    }
}

impl Constraint {
    /// The figure of a sheet.
    pub(super) fn value(&self, sheet: &DataSheet) -> Option<f64> {
        figure(self.figure).ok().and_then(|(_, of)| of(sheet))
    }

    /// By how much a sheet misses the range, in the unit of the figure, 0 within it; none where it does not have the
    /// figure.
    pub(super) fn lacks(&self, sheet: &DataSheet) -> Option<f64> {
        self.value(sheet).map(|value| (self.least - value).max(value - self.most).max(0.0))
    }

    pub(super) fn keeps(&self, sheet: &DataSheet) -> bool {
        self.lacks(sheet) == Some(0.0)
    }
}

/// Whether less or more of a figure is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sense {
    /// Less is better.
    Least,
    /// More is better.
    Most,
}

/// What makes a variant better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StudyTarget {
    /// The figure.
    pub figure: &'static str,
    /// Which way.
    pub sense: Sense,
}

impl StudyTarget {
    /// A target by the name of its figure.
    ///
    /// # Errors
    /// There is no figure of that name.
    pub fn new(name: &str, sense: Sense) -> Result<StudyTarget, JudgeError> {
        Ok(StudyTarget { figure: figure(name)?.0, sense })
    }

    /// The figure, turned so that less is better.
    pub fn cost(&self, sheet: &DataSheet) -> f64 {
        let value = figure(self.figure).ok().and_then(|(_, of)| of(sheet)).unwrap_or(f64::NAN);
        if self.sense == Sense::Least { value } else { -value }
    }
}

/// Whether the rigid teeth of a sheet clear one another.
pub(super) fn clears(sheet: &DataSheet) -> bool {
    sheet.rigid_gap_um.is_some_and(|gap| gap >= -1e3 * RigidMesh::TOUCHES_MM)
}

/// Marks what meets the constraints, and of each generator what nothing that meets them beats (Pareto's front).
///
/// Variants are compared with those made alike: `errors` are the places of the fields that are errors of making among
/// the values. A variant is no better for what was made worse of it.
///
/// What converged bears the largest load of the study. That is where the search ends, known of every such run, and
/// nothing to estimate.
pub(super) fn judge(runs: &mut [StudyRun], constraints: &[Constraint], targets: &[StudyTarget], errors: &[usize]) {
    for run in runs.iter_mut() {
        if let (true, Some(loads)) = (run.bears_all(), run.loads) {
            run.sheet.last_stable_n_m = Some(loads.largest_n_m);
        }
        run.meets = run.status == RunStatus::Converged
            && clears(&run.sheet)
            && constraints.iter().all(|constraint| constraint.keeps(&run.sheet));
    }
    let costs: Vec<Option<Vec<f64>>> = runs
        .iter()
        .map(|run| run.meets.then(|| targets.iter().map(|target| target.cost(&run.sheet)).collect()))
        .collect();
    let beats = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| a <= b) && a.iter().zip(b).any(|(a, b)| a < b);
    for k in 0..runs.len() {
        let Some(mine) = &costs[k] else { continue };
        let beaten = (0..runs.len()).any(|other| {
            runs[other].generator == runs[k].generator
                && runs[other].made_as(&runs[k], errors)
                && costs[other].as_ref().is_some_and(|theirs| beats(theirs, mine))
        });
        runs[k].front = !beaten;
    }
}
