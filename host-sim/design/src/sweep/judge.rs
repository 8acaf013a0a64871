//! Constraints and targets on figures, and the Pareto front.

use std::ops::RangeInclusive;
use std::str::FromStr;

use thiserror::Error;

use super::plan::{PlanError, VariantPlan};
use super::run::{RunStatus, VariantRow};
use super::vary::is_error_of_making;
use flexspline_base::suggest::did_you_mean;
use flexspline_mechanics::drive::{GeneratorKind, RigidMesh};

/// Default targets of data sheets: small error, stiff, low stress.
const USUAL: [(&str, Sense); 3] =
    [("kinematic_error_pp_arcsec", Sense::Least), ("k2_n_m_per_rad", Sense::Most), ("root_fillet_mpa", Sense::Least)];

/// Backlash from which on teeth play, arcsec. A guess: below it they are preloaded beyond what a solution is good to.
const LEAST_BACKLASH_ARCSEC: f64 = -0.1;

/// Angles nearer than this are equal, arcsec, and the next target decides: what a finer mesh moves the output of HHD-95
/// by at 50 N·m, with each generator. *Source*: `tests/independence.rs`, printed in `docs/evidence/simulation.md`.
const SETTLED_ARCSEC: [f64; GeneratorKind::ALL.len()] = [0.16, 0.07, 0.02, 0.03];

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

/// Whether less or more of a figure is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sense {
    /// Less is better.
    Least,
    /// More is better.
    Most,
}

impl Sense {
    /// A figure, as far as a mesh settles it, turned so that less is better; a missing one is worst.
    pub fn cost(self, figure: &str, value: f64, kind: GeneratorKind) -> f64 {
        let step = SETTLED_ARCSEC[kind as usize];
        let value = if figure.ends_with("_arcsec") { step * (value / step).round() } else { value };
        let cost = if self == Sense::Least { value } else { -value };
        if cost.is_nan() { f64::INFINITY } else { cost }
    }
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
        let wrong = |what: String| Err(PlanError::BadInput(what));
        let known = plan.figures();
        let targets = self.targets.iter().map(|(name, _)| ("--least, --most", name));
        for (option, name) in self.constraints.iter().map(|kept| ("--keep", &kept.figure)).chain(targets) {
            if !known.contains(&name.as_str()) {
                let (known, hint) = (known.join(", "), did_you_mean("; ", name, known.iter().copied()));
                return wrong(format!("{option}: figure {name:?} is not known; allowed: {known}{hint}"));
            }
        }
        let is_twice = |k: &usize| self.targets[..*k].iter().any(|(name, _)| *name == self.targets[*k].0);
        if let Some(k) = (1..self.targets.len()).find(is_twice) {
            let name = &self.targets[k].0;
            return wrong(format!("--least, --most: found {name} twice, allowed: each figure once"));
        }
        if plan.is_of_tolerances() && !self.targets.is_empty() {
            let why = "nobody chooses among drives drawn from tolerances";
            return wrong(format!("--least, --most: allowed with --vary; {why}"));
        }
        if !plan.is_of_tolerances() && self.targets.is_empty() {
            self.targets = USUAL.map(|(name, sense)| (name.to_owned(), sense)).to_vec();
        }
        Ok(self)
    }

    /// Costs of a row in each target.
    fn costs(&self, plan: &VariantPlan, row: &VariantRow) -> Vec<f64> {
        let cost =
            |(name, sense): &(String, Sense)| Some(sense.cost(name, row.figures[plan.figure(name)?], row.generator));
        self.targets.iter().filter_map(cost).collect()
    }

    /// Whether the backlash of a variant is below zero: its teeth are preloaded, or did not settle.
    pub fn is_preloaded(plan: &VariantPlan, row: &VariantRow) -> bool {
        let backlash = plan.figure("backlash_arcsec").filter(|_| !plan.is_of_tolerances());
        backlash.is_some_and(|figure| row.figures[figure] < LEAST_BACKLASH_ARCSEC)
    }

    /// Marks the rows that meet: they converged, their rigid teeth clear one another where that was looked at, their
    /// teeth play, and they keep to every constraint. Of these it marks the Pareto front. Rows are compared with those
    /// that have the same manufacturing errors, which nobody chooses.
    pub(super) fn mark(&self, plan: &VariantPlan, rows: &mut [VariantRow]) {
        let least_gap_um = -1e3 * RigidMesh::TOUCHES_MM;
        let clears = plan.figure("rigid_gap_um").map(|gap| (gap, least_gap_um..=f64::INFINITY));
        let kept =
            self.constraints.iter().filter_map(|kept| Some((plan.figure(&kept.figure)?, kept.least..=kept.most)));
        let kept: Vec<(usize, RangeInclusive<f64>)> = clears.into_iter().chain(kept).collect();
        for row in rows.iter_mut() {
            let keeps = |(figure, range): &(usize, RangeInclusive<f64>)| range.contains(&row.figures[*figure]);
            let sound = row.status == RunStatus::Converged && !Judge::is_preloaded(plan, row);
            row.meets = sound && kept.iter().all(keeps);
        }
        let costs: Vec<Vec<f64>> = rows.iter().map(|row| self.costs(plan, row)).collect();
        let errors: Vec<usize> = (0..plan.columns.len()).filter(|k| is_error_of_making(&plan.columns[*k])).collect();
        let beats = |a: usize, b: usize| {
            let [made, other] = [a, b].map(|k| &plan.variants[rows[k].variant]);
            rows[a].meets
                && costs[a] != costs[b]
                && costs[a].iter().zip(&costs[b]).all(|(a, b)| a <= b)
                && errors.iter().all(|k| made[*k] == other[*k])
        };
        let is_best = |k: usize| rows[k].meets && !costs[k].is_empty() && !(0..rows.len()).any(|other| beats(other, k));
        let best: Vec<bool> = (0..rows.len()).map(is_best).collect();
        rows.iter_mut().zip(best).for_each(|(row, best)| row.is_front = best);
    }

    /// The Pareto front of marked rows, best in the first target first, then in the next.
    pub fn front<'r>(&self, plan: &VariantPlan, rows: impl IntoIterator<Item = &'r VariantRow>) -> Vec<&'r VariantRow> {
        let mut front: Vec<&VariantRow> = rows.into_iter().filter(|row| row.is_front).collect();
        front.sort_by(|a, b| self.costs(plan, a).partial_cmp(&self.costs(plan, b)).expect("no cost is NaN"));
        front
    }
}
