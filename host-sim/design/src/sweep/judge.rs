//! Constraints and targets on figures, and the Pareto front.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

use super::plan::{PlanError, VariantPlan};
use super::run::{RunStatus, VariantRow};
use super::vary::is_error_of_making;
use flexspline_base::suggest::did_you_mean;
use flexspline_mechanics::drive::RigidMesh;

/// Default targets of data sheets: small error, stiff, low stress.
const USUAL: [(&str, Sense); 3] =
    [("kinematic_error_pp_arcsec", Sense::Least), ("k2_n_m_per_rad", Sense::Most), ("root_fillet_mpa", Sense::Least)];

/// A range that a figure has to keep to.
#[derive(Debug, Clone, PartialEq)]
pub struct Constraint {
    /// The figure.
    pub figure: String,
    /// Its least value.
    pub least: f64,
    /// Its largest value.
    pub most: f64,
}

/// Text that is no constraint.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("found {0:?}, allowed: FIGURE=LEAST..MOST, either end may be left out")]
pub struct ConstraintError(String);

impl FromStr for Constraint {
    type Err = ConstraintError;

    fn from_str(text: &str) -> Result<Constraint, ConstraintError> {
        let wrong = || ConstraintError(text.to_owned());
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
        Ok(Constraint { figure: name.trim().to_owned(), least, most })
    }
}

/// As `--keep` takes it.
impl fmt::Display for Constraint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let end = |value: f64| if value.is_finite() { value.to_string() } else { String::new() };
        write!(f, "{}={}..{}", self.figure, end(self.least), end(self.most))
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

/// Constraints and targets.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Judge {
    /// Ranges that figures have to keep to.
    pub constraints: Vec<Constraint>,
    /// Figures that make a variant better.
    pub targets: Vec<(String, Sense)>,
}

impl Judge {
    /// The judge of a plan: with the default targets where none is given, of a plan of fields.
    ///
    /// # Errors
    /// A figure that variants of the plan do not have, a target given twice, or targets of drives within tolerances.
    pub fn of(mut self, plan: &VariantPlan) -> Result<Judge, PlanError> {
        let known = plan.figures();
        let targets = self.targets.iter().map(|(name, _)| ("--least, --most", name));
        for (option, name) in self.constraints.iter().map(|kept| ("--keep", &kept.figure)).chain(targets) {
            if !known.contains(&name.as_str()) {
                return Err(PlanError::BadInput(format!(
                    "{option}: figure {name:?} is not known; allowed: {}{}",
                    known.join(", "),
                    did_you_mean("; ", name, known.iter().copied())
                )));
            }
        }
        let is_twice = |k: &usize| self.targets[..*k].iter().any(|(name, _)| *name == self.targets[*k].0);
        if let Some(k) = (1..self.targets.len()).find(is_twice) {
            return Err(PlanError::BadInput(format!(
                "--least, --most: found {} twice, allowed: each figure once",
                self.targets[k].0
            )));
        }
        if plan.is_of_tolerances() && !self.targets.is_empty() {
            let what = "--least, --most: allowed with --vary; nobody chooses among drives drawn from tolerances";
            return Err(PlanError::BadInput(what.to_owned()));
        }
        if !plan.is_of_tolerances() && self.targets.is_empty() {
            self.targets = USUAL.map(|(name, sense)| (name.to_owned(), sense)).to_vec();
        }
        Ok(self)
    }

    /// Whether each row converged, has rigid teeth that clear one another, and meets every constraint.
    pub(super) fn meet(&self, plan: &VariantPlan, rows: &[VariantRow]) -> Vec<bool> {
        let kept: Vec<(Option<usize>, &Constraint)> =
            self.constraints.iter().map(|kept| (plan.figure(&kept.figure), kept)).collect();
        let keeps = |row: &VariantRow, (figure, kept): &(Option<usize>, &Constraint)| {
            figure.is_some_and(|figure| (kept.least..=kept.most).contains(&row.figures[figure]))
        };
        let is_sound = |row: &VariantRow| row.status == RunStatus::Converged && clears(plan, row);
        rows.iter().map(|row| is_sound(row) && kept.iter().all(|kept| keeps(row, kept))).collect()
    }

    /// The Pareto front of each generator: rows that meet, and that no other row that meets beats. Rows are compared
    /// with those that have the same manufacturing errors, which nobody chooses.
    pub(super) fn front(&self, plan: &VariantPlan, rows: &[VariantRow], meet: &[bool]) -> Vec<bool> {
        let errors: Vec<usize> = (0..plan.columns.len()).filter(|k| is_error_of_making(&plan.columns[*k])).collect();
        let made = |row: &VariantRow| errors.iter().map(|k| &plan.variants[row.variant][*k]).collect::<Vec<_>>();
        let alike = |a: &VariantRow, b: &VariantRow| a.generator == b.generator && made(a) == made(b);
        let targets: Vec<(usize, Sense)> =
            self.targets.iter().filter_map(|(name, sense)| Some((plan.figure(name)?, *sense))).collect();
        let costs = |row: &VariantRow| targets.iter().map(|(k, sense)| cost(row.figures[*k], *sense)).collect();
        let costs: Vec<Vec<f64>> = rows.iter().map(costs).collect();
        let beats = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| a <= b) && a.iter().zip(b).any(|(a, b)| a < b);
        let beaten =
            |k: usize| (0..rows.len()).any(|o| meet[o] && beats(&costs[o], &costs[k]) && alike(&rows[o], &rows[k]));
        (0..rows.len()).map(|k| meet[k] && !targets.is_empty() && !beaten(k)).collect()
    }
}

/// A figure, turned so that less is better; a missing one is worst.
pub(super) fn cost(value: f64, sense: Sense) -> f64 {
    match sense {
        _ if value.is_nan() => f64::INFINITY,
        Sense::Least => value,
        Sense::Most => -value,
    }
}

/// Whether the rigid teeth clear one another, where that was looked at.
fn clears(plan: &VariantPlan, row: &VariantRow) -> bool {
    plan.figure("rigid_gap_um").is_none_or(|gap| row.figures[gap] >= -1e3 * RigidMesh::TOUCHES_MM)
}
