//! What the core leaves of the pointing error: without tables, with nominal ones, with extended ones, over sessions
//! that took no part in the fit.
//!
//! The core itself predicts each row from generator angle, torque and temperature, as it does on board. The zero of the
//! encoder is found over the sessions of the fit, once, and taken from the others; where the bench sets it anew, over
//! those that share it, or in the session held out itself.

use flexspline::{GeneratorAngle, PlayState, Table};
use serde::Serialize;

use super::sampled::ExtendedTables;
use crate::causes::CauseName;
use crate::diagnosis::{DiagnosisError, Extended, Settings};
use crate::measurement::{Session, rms};
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::tables::TableError;
use flexspline_mechanics::drive::DriveError;

/// Extended tables are written if they improve on the nominal ones in at least this share of the sessions held out.
pub const LEAST_SHARE_IMPROVED: f64 = 2.0 / 3.0;
/// With fewer sessions than this, the last third of each is held out.
const FEWEST_SESSIONS: usize = 3;

/// A session held out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Compensated {
    /// Which one, from 0.
    pub session: usize,
    /// Rows.
    pub rows: usize,
    /// Without tables, arcsec rms.
    pub rms_uncompensated_arcsec: f64,
    /// Corrected with nominal tables.
    pub rms_nominal_tables_arcsec: f64,
    /// Corrected with extended tables.
    pub rms_extended_tables_arcsec: f64,
}

/// A cause that is not in a table.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct NotApplied {
    /// The cause.
    pub cause: CauseName,
    /// Why.
    pub reason: &'static str,
}

/// What compensation leaves in sessions that took no part in the fit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// Without tables, arcsec rms over the sessions held out.
    pub rms_uncompensated_arcsec: f64,
    /// Corrected by the core with nominal tables.
    pub rms_nominal_tables_arcsec: f64,
    /// Corrected by the core with tables of the model extended on the other sessions.
    pub rms_extended_tables_arcsec: f64,
    /// Each session held out.
    pub sessions: Vec<Compensated>,
    /// In how many of them the extended tables are better than the nominal ones.
    pub improved: usize,
    /// Causes that are in the extended tables.
    pub applied: Vec<CauseName>,
    /// Causes that are not, and why.
    pub not_applied: Vec<NotApplied>,
}

impl Evaluation {
    /// Whether extended tables are worth writing; if not, why.
    ///
    /// # Errors
    /// The reason.
    pub(crate) fn worth_writing(&self) -> Result<(), NotWorthWriting> {
        if self.applied.is_empty() {
            return Err(NotWorthWriting::NoCause);
        }
        let (improved, sessions) = (self.improved, self.sessions.len());
        if improved as f64 / sessions.max(1) as f64 + 1e-9 < LEAST_SHARE_IMPROVED {
            return Err(NotWorthWriting::TooFewImproved { improved, sessions });
        }
        Ok(())
    }
}

/// Why extended tables are not written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum NotWorthWriting {
    /// They would be the nominal ones.
    #[error("no cause found has a place in a table")]
    NoCause,
    /// They are no better than the nominal ones.
    #[error("they are better in {improved} of {sessions} sessions held out; two of three are asked for")]
    TooFewImproved {
        /// Sessions in which they are better.
        improved: usize,
        /// Sessions held out.
        sessions: usize,
    },
}

/// Cuts sessions into those to learn from (true) and those held out: every second one; with fewer than three sessions
/// the last third of each.
#[must_use]
pub fn split(sessions: &[Session]) -> (Vec<Session>, Vec<bool>) {
    if sessions.len() >= FEWEST_SESSIONS {
        return (sessions.to_vec(), (0..sessions.len()).map(|k| k % 2 == 0).collect());
    }
    let (mut parts, mut used) = (Vec::new(), Vec::new());
    for session in sessions {
        let at = session.len() * 2 / 3;
        parts.extend([
            session.part(0..at),
            Session { own_zero: session.own_zero && at == 0, ..session.part(at..session.len()) },
        ]);
        used.extend([true, false]);
    }
    (parts, used)
}

/// Measured less predicted by the core, arcsec, row by row.
#[must_use]
pub fn left_by_core(table: &Table<'_>, session: &Session, temperature_c: f64) -> Vec<f64> {
    let mut play = PlayState::unknown();
    let at = |column: &Option<Vec<f64>>, k: usize, usual: f64| column.as_ref().map_or(usual, |values| values[k]);
    (0..session.len())
        .map(|k| {
            let generator = GeneratorAngle::from_rad(session.generator_rad[k]).unwrap_or(GeneratorAngle::ZERO);
            let torque = at(&session.torque_n_m, k, 0.0) as f32;
            let said = table.forward(&mut play, generator, torque, at(&session.temperature_c, k, temperature_c) as f32);
            (session.error_rad[k] - f64::from(said.transmission_error_rad)) * ARCSEC_PER_RAD
        })
        .collect()
}

/// Why compensation could not be evaluated.
#[derive(Debug, thiserror::Error)]
pub enum EvaluationError {
    /// The sessions to learn from allow no fit.
    #[error(transparent)]
    Fit(#[from] DiagnosisError),
    /// The model makes no table.
    #[error(transparent)]
    Table(#[from] TableError),
    /// No table was made otherwise.
    #[error(transparent)]
    Remake(RemakeError),
}

/// Why no table of the extended drive was made by FEM.
#[derive(Debug, thiserror::Error)]
pub enum RemakeError {
    /// The causes make no drive.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// The caller, who makes the table, failed or was stopped.
    #[error(transparent)]
    Make(#[from] Box<dyn std::error::Error + Send + Sync>),
}

/// Makes the image of a table of an extended model by other means than sampling it, if it can.
pub type Remake<'a> = dyn Fn(&Extended) -> Result<Option<Vec<u8>>, RemakeError> + 'a;

/// Fits the causes to the sessions to learn from, makes tables of what was found, and runs the core over the others.
///
/// # Errors
/// Too few rows to learn from; a model that makes no table.
pub fn evaluate(
    sessions: &[Session],
    causes: &[CauseName],
    tables: &ExtendedTables<'_>,
    settings: &Settings,
    remake: Option<&Remake<'_>>,
) -> Result<Evaluation, EvaluationError> {
    let (sessions, used) = split(sessions);
    let nominal = tables.nominal;
    let fitted = Extended::fit_to(&sessions, &used, nominal, tables.table, causes, settings)?;
    let nominal_image = match tables.table {
        Some(_) => None,
        None => Some(tables.nominal(&fitted)?.image),
    };
    let mut applied = Vec::new();
    let mut not_applied = Vec::new();
    for cause in causes {
        let found = fitted.causes().iter().find(|found| found.name() == *cause);
        match tables.left_out(*cause, found) {
            Some(reason) => not_applied.push(NotApplied { cause: *cause, reason }),
            None if found.is_some() => applied.push(*cause),
            None => {
                let reason = "the sessions learnt from do not show it";
                not_applied.push(NotApplied { cause: *cause, reason });
            }
        }
    }
    let mut extended_image = None;
    if !applied.is_empty() {
        extended_image = remake.map_or(Ok(None), |remake| remake(&fitted)).map_err(EvaluationError::Remake)?;
        if extended_image.is_none() {
            extended_image = Some(tables.extended(&fitted)?.image);
        }
    }
    let check = |image: &Option<Vec<u8>>| -> Result<Option<Vec<Vec<f64>>>, TableError> {
        let Some(image) = image else { return Ok(None) };
        let table = Table::check(image).map_err(|error| TableError::Project(error.into()))?;
        Ok(Some(sessions.iter().map(|s| left_by_core(&table, s, nominal.temperature_c)).collect()))
    };
    let none: Vec<Vec<f64>> =
        sessions.iter().map(|s| s.error_rad.iter().map(|e| e * ARCSEC_PER_RAD).collect()).collect();
    let by_nominal: Vec<Vec<f64>> = match (tables.table, check(&nominal_image)?) {
        (Some(table), _) => sessions.iter().map(|s| left_by_core(table, s, nominal.temperature_c)).collect(),
        (None, Some(left)) => left,
        (None, None) => none.clone(),
    };
    let by_extended = check(&extended_image)?.unwrap_or_else(|| by_nominal.clone());
    let own: Vec<bool> = sessions.iter().map(|session| session.own_zero).collect();
    let [none, by_nominal, by_extended] = [none, by_nominal, by_extended].map(|left| without_zero(left, &used, &own));
    let held: Vec<usize> = (0..sessions.len()).filter(|k| !used[*k] && !sessions[*k].is_empty()).collect();
    let sessions: Vec<Compensated> = held
        .iter()
        .map(|&k| Compensated {
            session: k,
            rows: sessions[k].len(),
            rms_uncompensated_arcsec: rms(&none[k]),
            rms_nominal_tables_arcsec: rms(&by_nominal[k]),
            rms_extended_tables_arcsec: rms(&by_extended[k]),
        })
        .collect();
    let over_all = |left: &[Vec<f64>]| rms(&held.iter().flat_map(|k| left[*k].iter().copied()).collect::<Vec<f64>>());
    Ok(Evaluation {
        rms_uncompensated_arcsec: over_all(&none),
        rms_nominal_tables_arcsec: over_all(&by_nominal),
        rms_extended_tables_arcsec: over_all(&by_extended),
        improved: sessions.iter().filter(|s| s.rms_extended_tables_arcsec < s.rms_nominal_tables_arcsec).count(),
        sessions,
        applied,
        not_applied,
    })
}

/// Takes the zero away: of sessions that share one, from each that has its `own` on, the mean over those learnt from,
/// or over all of them where nothing was learnt from any.
fn without_zero(mut left: Vec<Vec<f64>>, used: &[bool], own: &[bool]) -> Vec<Vec<f64>> {
    let starts = (0..left.len()).filter(|k| *k == 0 || own[*k]).chain([left.len()]).collect::<Vec<usize>>();
    for sharing in starts.windows(2).map(|at| at[0]..at[1]) {
        let learns = used[sharing.clone()].contains(&true);
        let of = || sharing.clone().filter(|k| used[*k] || !learns).flat_map(|k| &left[k]);
        let zero = of().sum::<f64>() / of().count().max(1) as f64;
        left[sharing].iter_mut().flatten().for_each(|value| *value -= zero);
    }
    left
}

#[cfg(test)]
mod tests {
    use super::*;

    fn session(rows: usize) -> Session {
        Session {
            line: (0..rows as u64).collect(),
            generator_rad: (0..rows).map(|k| k as f64).collect(),
            error_rad: (0..rows).map(|k| 1e-6 * k as f64).collect(),
            ..Session::default()
        }
    }

    #[test]
    fn every_second_session_or_the_last_third_is_held_out() {
        let (parts, used) = split(&[session(9), session(6), session(3)]);
        assert_eq!((parts.len(), used), (3, vec![true, false, true]));
        let (parts, used) = split(&[session(9), session(6)]);
        assert_eq!(used, [true, false, true, false]);
        assert_eq!(parts.iter().map(Session::len).collect::<Vec<_>>(), [6, 3, 4, 2]);
        assert_eq!(parts[1].generator_rad, [6.0, 7.0, 8.0]);
    }

    #[test]
    fn the_zero_is_that_of_the_sessions_learnt_from() {
        let left = without_zero(vec![vec![1.0, 3.0], vec![10.0, 12.0]], &[true, false], &[false; 2]);
        assert_eq!(left, [[-1.0, 1.0], [8.0, 10.0]]);
    }

    #[test]
    fn a_zero_that_the_bench_sets_anew_is_that_of_the_session_itself_or_of_those_that_share_it() {
        let left = || vec![vec![1.0, 3.0], vec![310.0, 312.0], vec![20.0, 22.0], vec![25.0, 27.0]];
        let used = [true, false, true, false];
        assert_eq!(without_zero(left(), &used, &[false, true, true, false])[1], [-1.0, 1.0]);
        assert_eq!(without_zero(left(), &used, &[false, true, true, false])[3], [4.0, 6.0], "shares the third's");
    }

    #[test]
    fn tables_that_improve_too_few_sessions_are_not_worth_writing() {
        let one = |better: bool| Compensated {
            session: 0,
            rows: 1,
            rms_uncompensated_arcsec: 3.0,
            rms_nominal_tables_arcsec: 2.0,
            rms_extended_tables_arcsec: if better { 1.0 } else { 2.5 },
        };
        let with = |better: &[bool], applied: &[CauseName]| Evaluation {
            rms_uncompensated_arcsec: 0.0,
            rms_nominal_tables_arcsec: 0.0,
            rms_extended_tables_arcsec: 0.0,
            sessions: better.iter().map(|b| one(*b)).collect(),
            improved: better.iter().filter(|b| **b).count(),
            applied: applied.to_vec(),
            not_applied: Vec::new(),
        };
        let cause = [CauseName::BacklashGrowth];
        assert!(with(&[true, true, false], &cause).worth_writing().is_ok());
        assert!(with(&[true, false], &cause).worth_writing().unwrap_err().to_string().contains("better in 1 of 2"));
        assert!(with(&[true, true], &[]).worth_writing() == Err(NotWorthWriting::NoCause));
    }
}
