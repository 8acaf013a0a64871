//! The extended model: the nominal drive recalibrated, plus the causes with the values found, to be evaluated on any
//! rows.
//!
//! [`Extended::fit_to`] learns from some of the sessions alone, so that what it says of the others was not seen by it.

use std::borrow::Cow;
use std::collections::BTreeMap;

use flexspline::Table;
use serde::{Deserialize, Serialize};

use super::base::{Base, PlayLaw};
use super::candidate::{Acting, Excitation, Law, LawUnits, Tag, added};
use super::model::{Problem, Scaffold, Term, among_each_other};
use super::prepare::Jump;
use super::report::Parameter;
use super::rows::{Rows, add_scaled};
use super::select::{Selected, less, settle_each};
use super::{DiagnosisError, Fineness, prepare, uncertainty};
use crate::causes::{CauseName, ParameterName};
use crate::measurement::Session;
use crate::nominal::Nominal;

/// A cause as it was found.
pub struct FittedCause {
    name: CauseName,
    acting: Acting<'static>,
    /// Parameters with their uncertainty, as in [`super::report::Cause`].
    pub parameters: BTreeMap<&'static str, Parameter>,
}

impl FittedCause {
    /// Its name.
    pub fn name(&self) -> CauseName {
        self.name
    }

    /// Whether it is the encoder of the output that reads wrong.
    pub(crate) fn at_output(&self) -> bool {
        self.parameters.get(ParameterName::Encoder.as_str()).is_some_and(|encoder| encoder.value == 1.0)
    }
}

/// The model of a cause as it was fitted, to be evaluated on other recordings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FittedLaw {
    /// A hash of the parameters that it belongs to.
    pub(crate) of: String,
    /// Which of the models of its cause it is.
    variant: String,
    /// How the flank was found to change below friction.
    play: PlayLaw,
    /// Stiffness at the least torque of the nominal model that it was fitted with, N·m/rad: that of the file is
    /// recalibrated.
    stiffness_n_m_per_rad: f64,
    /// Backlash of that nominal model, arcsec.
    backlash_arcsec: f64,
    /// Values of its shape parameters.
    shape: Vec<f64>,
    /// Coefficients of its columns.
    coefficients: Vec<f64>,
    /// Jumps of the error in its data: when one begins, has half its height, and is over, s; its height, arcsec.
    #[serde(default)]
    jumps: Vec<[f64; 4]>,
    /// Units of the coefficients, without the jumps.
    scales: LawUnits,
}

/// What causes as they were fitted add to the error of each session, arcsec, in the order of the causes; nothing where
/// such a model cannot be evaluated on these sessions.
///
/// Causes of one fit act on each other as they did in it.
pub fn added_by(fitted: &[(CauseName, &FittedLaw)], sessions: &[Session], nominal: &Nominal) -> Option<Vec<Vec<f64>>> {
    let rows = Rows::new(sessions, nominal);
    let mut sum = vec![0.0; rows.len()];
    let of_one_fit = |(_, a): &(CauseName, &FittedLaw), (_, b): &(CauseName, &FittedLaw)| {
        let nominal = |fit: &FittedLaw| (fit.play, fit.stiffness_n_m_per_rad, fit.backlash_arcsec);
        a.scales == b.scales && a.jumps == b.jumps && nominal(a) == nominal(b)
    };
    for causes in fitted.chunk_by(of_one_fit) {
        let (_, first) = causes.first()?;
        let nominal = first.nominal(nominal);
        let base = Base::with_play(&rows, &nominal, None, first.play);
        let jump = |&[begin, half, over, height_arcsec]: &[f64; 4]| Jump { time_s: [begin, half, over], height_arcsec };
        let scales = LawUnits { jumps: first.jumps.iter().map(jump).collect(), ..first.scales.clone() };
        let on = Excitation::new(&rows, &nominal, &base, &scales);
        let laws: Vec<Law> = causes.iter().flat_map(|(name, _)| (name.spec().laws)(&on)).collect();
        let acting = causes.iter().map(|(name, fit)| fit.acting(*name, &on, &laws)).collect::<Option<Vec<_>>>()?;
        added(&on, &acting).iter().for_each(|part| add_scaled(&mut sum, part, 1.0));
    }
    Some(rows.sessions.iter().map(|session| sum[session.clone()].to_vec()).collect())
}

/// What a nominal model, or a table in its place, predicts for each session, arcsec, with the play as it was `found`.
pub(crate) fn nominal_arcsec(
    sessions: &[Session],
    nominal: &Nominal,
    table: Option<&Table<'_>>,
    found: Option<&Extended>,
) -> Vec<Vec<f64>> {
    let rows = Rows::new(sessions, nominal);
    let base = Base::with_play(&rows, nominal, table, found.map_or(PlayLaw::Held, |found| found.play));
    rows.sessions.iter().map(|session| base.prediction[session.clone()].to_vec()).collect()
}

impl FittedLaw {
    /// The nominal model that it was fitted with, made of the recalibrated one.
    fn nominal(&self, recalibrated: &Nominal) -> Nominal {
        let mut nominal = Nominal { backlash_arcsec: self.backlash_arcsec, ..recalibrated.clone() };
        let factor = nominal.stiffness.first().map_or(1.0, |[_, now]| self.stiffness_n_m_per_rad / now);
        nominal.stiffness.iter_mut().for_each(|[_, k]| *k *= factor);
        nominal
    }

    /// The model among `laws`, if it is there with the same shape parameters and columns.
    fn acting<'l>(&self, cause: CauseName, on: &Excitation<'_>, laws: &'l [Law]) -> Option<Acting<'l>> {
        let law = laws.iter().find(|law| law.is(cause) && law.variant == self.variant)?;
        if law.shapes.len() != self.shape.len() {
            return None;
        }
        let roles: Vec<Tag> = law.columns(on, &self.shape).iter().map(|column| column.role).collect();
        (roles.len() == self.coefficients.len()).then(|| Acting {
            law: Cow::Borrowed(law),
            values: self.shape.clone(),
            roles,
            coefficients: self.coefficients.clone(),
        })
    }
}

/// The nominal model recalibrated, and with causes.
pub struct Extended {
    play: PlayLaw,
    scales: LawUnits,
    /// Names of what floated, with the coefficients alone and beside the causes.
    floating: Vec<String>,
    recalibrated: Vec<f64>,
    base: Vec<f64>,
    causes: Vec<FittedCause>,
    /// How finely rows were looked at, and their noise.
    pub fineness: Fineness,
}

/// Predictions for the rows of one session, arcsec at the output, with what was measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Measured error.
    pub measured_arcsec: Vec<f64>,
    /// Nominal model as it stands.
    pub nominal_arcsec: Vec<f64>,
    /// Nominal model with its parameters recalibrated within the unit-to-unit spread.
    pub recalibrated_arcsec: Vec<f64>,
    /// Nominal model recalibrated beside the causes, plus the causes.
    pub extended_arcsec: Vec<f64>,
    /// What each cause adds, in the order of [`Extended::causes`].
    pub cause_arcsec: Vec<Vec<f64>>,
    /// Rows whose flank is not known well: the clearance is being crossed, or the torque is around friction.
    pub flank_uncertain: Vec<bool>,
}

impl Series {
    /// Measured less a prediction, arcsec.
    pub fn less(&self, predicted: &[f64]) -> Vec<f64> {
        less(&self.measured_arcsec, predicted)
    }
}

impl Extended {
    /// This model refitted to the sessions that are `used`, from where its causes are; of the others only the history
    /// counts (time, travel).
    ///
    /// # Errors
    /// As [`super::diagnose`].
    pub(crate) fn fit_to(
        &self,
        sessions: &[Session],
        used: &[bool],
        nominal: &Nominal,
        table: Option<&Table<'_>>,
    ) -> Result<Extended, DiagnosisError> {
        let rows = Rows::new(sessions, nominal).learning_from(used);
        super::check(&rows)?;
        let base = Base::with_play(&rows, nominal, table, self.play);
        let on = Excitation::new(&rows, nominal, &base, &self.scales);
        let problem = Problem::new(on, &prepare::uncertain(&on, &[], &[]), self.fineness);
        let acting = self.causes.iter().map(|cause| &cause.acting);
        let terms = acting.map(|of| Term::new(&problem, &of.law, of.law.places(&of.values))).collect();
        let settled = Selected::of(&problem, among_each_other(&problem, terms))
            .and_then(|selected| settle_each(&problem, selected, false))
            .ok_or(DiagnosisError::NotFinite)?;
        Extended::of(&problem, &settled).ok_or(DiagnosisError::NotFinite)
    }

    /// What was selected, and the nominal model alone.
    pub(super) fn of(problem: &Problem<'_>, selected: &Selected<'_>) -> Option<Extended> {
        let alone = Scaffold::new(problem, Vec::new()).fit(None)?;
        let known = uncertainty::known(problem, selected, 1.0);
        let cause = |(k, known): (usize, uncertainty::Known)| {
            let term = &selected.terms[k];
            let Acting { values, roles, coefficients, .. } = term.acting(selected.fit.of(k));
            let acting = Acting { law: Cow::Owned(term.law.clone()), values, roles, coefficients };
            Some(FittedCause { name: term.law.cause()?, acting, parameters: known.parameters })
        };
        let floating = problem.on.base.floating.iter().map(|floating| floating.name.clone());
        Some(Extended {
            play: problem.on.base.law,
            scales: problem.on.scales.clone(),
            floating: floating.collect(),
            recalibrated: alone.solution.coefficients,
            base: selected.fit.base().to_vec(),
            causes: known.into_iter().enumerate().filter_map(cause).collect(),
            fineness: problem.fineness,
        })
    }

    /// Causes of the model.
    pub fn causes(&self) -> &[FittedCause] {
        &self.causes
    }

    /// The model of a cause, fitted with `nominal`, to be evaluated on other recordings; `of` is the hash of its
    /// parameters.
    pub(crate) fn fitted_law(&self, name: CauseName, nominal: &Nominal, of: String) -> Option<FittedLaw> {
        let cause = &self.causes.iter().find(|cause| cause.name == name)?.acting;
        let jump = |Jump { time_s: [begin, half, over], height_arcsec }: &Jump| [*begin, *half, *over, *height_arcsec];
        Some(FittedLaw {
            of,
            variant: cause.law.variant.to_string(),
            shape: cause.values.clone(),
            coefficients: cause.coefficients.clone(),
            jumps: self.scales.jumps.iter().map(jump).collect(),
            scales: LawUnits { jumps: Vec::new(), ..self.scales.clone() },
            play: self.play,
            stiffness_n_m_per_rad: nominal.stiffness.first().map_or(0.0, |[_, k]| *k),
            backlash_arcsec: nominal.backlash_arcsec,
        })
    }

    /// What was found as a prediction on the rows of `sessions`, which need not be those of the fit: one series for
    /// each.
    pub fn predict(&self, sessions: &[Session], nominal: &Nominal, table: Option<&Table<'_>>) -> Vec<Series> {
        let rows = Rows::new(sessions, nominal);
        if rows.is_empty() {
            return vec![Series::default(); sessions.len()];
        }
        let base = Base::with_play(&rows, nominal, table, self.play);
        let on = Excitation::new(&rows, nominal, &base, &self.scales);
        let (recalibrated, extended, parts) = self.rows(&on);
        rows.sessions
            .iter()
            .map(|s| Series {
                measured_arcsec: rows.error[s.clone()].to_vec(),
                nominal_arcsec: base.prediction[s.clone()].to_vec(),
                recalibrated_arcsec: recalibrated[s.clone()].to_vec(),
                extended_arcsec: extended[s.clone()].to_vec(),
                cause_arcsec: parts.iter().map(|part| part[s.clone()].to_vec()).collect(),
                flank_uncertain: base.uncertain[s.clone()].to_vec(),
            })
            .collect()
    }

    /// Recalibrated, extended, and each cause, row by row.
    pub(super) fn rows(&self, on: &Excitation<'_>) -> (Vec<f64>, Vec<f64>, Vec<Vec<f64>>) {
        let (mut recalibrated, mut extended) = (on.base.prediction.clone(), on.base.prediction.clone());
        let mut known = self.floating.iter().zip(self.recalibrated.iter().zip(&self.base));
        for floating in &on.base.floating {
            // The order is the same, but rows may lack what others have, such as a change of flank.
            let mut rest = known.clone();
            let Some((_, (alone, beside))) = rest.find(|(name, _)| **name == floating.name) else { continue };
            known = rest;
            add_scaled(&mut recalibrated, &floating.values, *alone);
            add_scaled(&mut extended, &floating.values, *beside);
        }
        let causes: Vec<Acting<'_>> = self.causes.iter().map(|cause| cause.acting.clone()).collect();
        let parts = added(on, &causes);
        parts.iter().for_each(|part| add_scaled(&mut extended, part, 1.0));
        (recalibrated, extended, parts)
    }
}
