//! What the core leaves of the pointing error in rows that took no part in a fit: without a table, with the nominal
//! one, with the one that a calibration makes of the other rows, and with the one of the causes found in them.
//!
//! The core itself predicts each row from generator angle, torque and temperature, as it does on board. The zero of the
//! encoder is found over the sessions of the fit, once, and taken from the others; where the bench sets it anew, over
//! those that share it, or in the session held out itself. What a cause of the output's encoder adds is taken off
//! first: the joint stands right where its encoder reads wrong.

use flexspline::{Prediction, Table};
use serde::Serialize;

use super::sampled::ExtendedTables;
use crate::calibrate::{LEAST_GAIN, Prior, calibrated_table};
use crate::causes::{CauseName, OF_THE_OUTPUT_ENCODER};
use crate::diagnosis::{Compensation, Extended, Series};
use crate::measurement::{Recording, Session, least_and_most, rms};
use crate::replay::by_core;
use flexspline_base::units::ARCSEC_PER_RAD;

/// With fewer sessions than this, each is cut into parts …
const FEWEST_SESSIONS: usize = 3;
/// … of which every third is held out: what is asked of a table lies between what it was made from. *Guess*, as the
/// blocks of a calibration.
const PARTS: usize = 9;

/// A cause that is not in a table.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct NotApplied {
    /// The cause.
    pub cause: CauseName,
    /// Why.
    pub reason: &'static str,
}

/// Which table is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TableKind {
    /// That of the causes found.
    Extended,
    /// That of a calibration.
    Calibrated,
    /// None.
    #[default]
    None,
}

/// What compensation leaves in sessions that took no part in the fit.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Evaluation {
    /// What is left over the sessions held out.
    #[serde(flatten)]
    pub left: Compensation,
    /// Causes that are in the extended tables.
    pub applied: Vec<CauseName>,
    /// Causes that are not, and why.
    pub not_applied: Vec<NotApplied>,
    /// Why a table could not be made of the sessions learnt from.
    #[serde(skip)]
    pub not_made: Vec<String>,
}

impl Evaluation {
    /// Tables that leave less than none, and less than this share of the squares that the nominal one leaves; the best
    /// first, with what they leave, arcsec rms. That of the causes comes first unless the calibrated one is better by
    /// what counts as a gain: it holds beyond the rows.
    pub(crate) fn tables_that_gain(&self, most_of_nominal: f64) -> Vec<(TableKind, f64)> {
        let less = |left: f64, than: f64| left * left < (1.0 - LEAST_GAIN) * than * than;
        let (none, nominal) = (self.left.rms_uncompensated_arcsec, self.left.rms_nominal_tables_arcsec);
        let gains = |left: &f64| less(*left, none) && left * left < most_of_nominal * nominal * nominal;
        let extended = Some(self.left.rms_extended_tables_arcsec).filter(gains).filter(|_| !self.applied.is_empty());
        let calibrated = self.left.rms_calibrated_table_arcsec.filter(gains);
        let swapped = extended.zip(calibrated).is_some_and(|(extended, calibrated)| less(calibrated, extended));
        let [first, second] =
            [extended.map(|left| (TableKind::Extended, left)), calibrated.map(|left| (TableKind::Calibrated, left))];
        if swapped { [second, first] } else { [first, second] }.into_iter().flatten().collect()
    }

    /// What is left with each table, for a reader.
    pub(crate) fn words(&self) -> String {
        let or_none = |left: Option<f64>| left.map_or("no table".to_owned(), |left| format!("{left:.2}"));
        let left = self.left;
        let extended = Some(left.rms_extended_tables_arcsec).filter(|_| !self.applied.is_empty());
        let mut text = format!(
            "left in rows left out of the fit, arcsec rms: {:.2} without a table, {:.2} nominal, {} calibrated, {} of \
             the causes",
            left.rms_uncompensated_arcsec,
            left.rms_nominal_tables_arcsec,
            or_none(left.rms_calibrated_table_arcsec),
            or_none(extended)
        );
        if self.not_applied.iter().any(|cause| cause.reason == OF_THE_OUTPUT_ENCODER) {
            text += "; these are without the error found in the output's encoder, which calibrated.fxt of `calibrate` \
                     has, for readings as they are";
        }
        let stay = self.not_applied.iter().filter(|cause| cause.reason != OF_THE_OUTPUT_ENCODER);
        stay.for_each(|of| text += &format!("; with {}, which no table has: it stays", of.cause.as_str()));
        self.not_made.iter().for_each(|why| text += &format!("; {why}"));
        text
    }
}

/// Cuts sessions into those to learn from (true) and those held out: every second one; with fewer than three sessions,
/// or where none of these has a load between those learnt from, every third of their parts.
pub fn split(sessions: &[Session]) -> (Vec<Session>, Vec<bool>) {
    let used: Vec<bool> = (0..sessions.len()).map(|k| k % 2 == 0).collect();
    if sessions.len() >= FEWEST_SESSIONS && within_loads(sessions, &used).contains(&true) {
        return (sessions.to_vec(), used);
    }
    let part = |session: &Session, k: usize| {
        let rows = [k, k + 1].map(|k| session.len() * k / PARTS);
        Session { own_zero: session.own_zero && k == 0, ..session.part(rows[0]..rows[1]) }
    };
    let parts = sessions.iter().flat_map(|session| (0..PARTS).map(|k| (part(session, k), k % 3 != 1)));
    parts.filter(|(part, _)| !part.is_empty()).unzip()
}

/// Measured less predicted by the core, arcsec, row by row.
pub fn left_by_core(table: &Table<'_>, session: &Session, temperature_c: f64) -> Vec<f64> {
    let said = by_core(table, session.states(temperature_c));
    let left = |(error, said): (&f64, Prediction)| (error - f64::from(said.transmission_error_rad)) * ARCSEC_PER_RAD;
    session.error_rad.iter().zip(said).map(left).collect()
}

/// Fits the causes, and the parts of a calibration, to the sessions to learn from, makes tables of what was found, and
/// runs the core over the others. `found` is the model fitted to all; `recording` is without what was known before,
/// `measured` with it, as the tables and the prior of the calibration are.
pub fn evaluate(
    [recording, measured]: [&Recording; 2],
    (found, causes): (&Extended, &[CauseName]),
    tables: &ExtendedTables<'_>,
    prior: &Prior<'_>,
) -> Evaluation {
    let (sessions, used) = split(&recording.sessions);
    let (nominal, mut evaluation) = (tables.nominal, Evaluation::default());
    let fit = || found.fit_to(&sessions, &used, nominal, tables.table);
    let fitted = if causes.is_empty() { None } else { Some(fit()) };
    let fitted = fitted.and_then(|fitted| fitted.map_err(|why| evaluation.not_made.push(why.to_string())).ok());
    let fitted = fitted.as_ref();
    let series = fitted.unwrap_or(found).predict(&sessions, nominal, tables.table);
    let mut sessions = if std::ptr::eq(recording, measured) { sessions } else { split(&measured.sessions).0 };
    for cause in causes {
        let found = fitted.and_then(|fitted| fitted.causes().iter().position(|found| found.name() == *cause));
        let at_output = found.zip(fitted).is_some_and(|(k, fitted)| fitted.causes()[k].at_output());
        match tables.left_out(*cause, at_output) {
            Some(reason) => {
                evaluation.not_applied.push(NotApplied { cause: *cause, reason });
                if let Some(k) = found.filter(|_| reason == OF_THE_OUTPUT_ENCODER) {
                    less(&mut sessions, series.iter().map(|series| &series.cause_arcsec[k]));
                }
            }
            None if found.is_some() => evaluation.applied.push(*cause),
            None => {
                let reason = "the sessions learnt from do not show it";
                evaluation.not_applied.push(NotApplied { cause: *cause, reason });
            }
        }
    }
    let by_table = |table: &Table<'_>| -> Vec<Vec<f64>> {
        sessions.iter().map(|session| left_by_core(table, session, nominal.temperature_c)).collect()
    };
    let by_image = |image: Vec<u8>| Table::check(&image).ok().map(|table| by_table(&table));
    let none = sessions.iter().map(|session| session.error_rad.iter().map(|e| e * ARCSEC_PER_RAD).collect());
    let none: Vec<Vec<f64>> = none.collect();
    let learnt = sessions.iter().zip(&used).filter(|(_, used)| **used).map(|(session, _)| session.clone());
    let learnt = [measured.with_sessions(learnt.collect())];
    let with_causes = fitted.filter(|_| !evaluation.applied.is_empty());
    let ((by_nominal, extended), calibrated) = rayon::join(
        || {
            let by_nominal = match tables.table {
                Some(table) => Some(by_table(table)),
                None => tables.nominal(fitted.or(Some(found))).ok().and_then(|made| by_image(made.image)),
            };
            (by_nominal, with_causes.map(|fitted| tables.extended(fitted)))
        },
        || calibrated_table(&learnt, prior),
    );
    // A model that makes no table predicts all the same.
    let by_nominal = by_nominal.unwrap_or_else(|| {
        let left = |(none, series): (&Vec<f64>, &Series)| {
            none.iter().zip(&series.nominal_arcsec).map(|(a, b)| a - b).collect()
        };
        none.iter().zip(&series).map(left).collect()
    });
    let by_extended = match extended.transpose() {
        Ok(made) => made.and_then(|made| by_image(made.image)),
        Err(why) => {
            evaluation.applied.clear();
            evaluation.not_made.push(why.to_string());
            None
        }
    };
    let by_calibrated = match calibrated {
        Ok(made) => by_image(made.image),
        Err(why) => {
            evaluation.not_made.extend(why.to_string().lines().next().map(str::to_owned));
            None
        }
    };
    let own: Vec<bool> = sessions.iter().map(|session| session.own_zero).collect();
    let counts = within_loads(&sessions, &used);
    let held = |left: Vec<Vec<f64>>| {
        let rows = without_zero(left, &used, &own).into_iter().flatten().zip(&counts);
        rms(&rows.filter(|(_, counts)| **counts).map(|(left, _)| left).collect::<Vec<f64>>())
    };
    let by_extended = by_extended.unwrap_or_else(|| by_nominal.clone());
    evaluation.left = Compensation {
        rms_uncompensated_arcsec: held(none),
        rms_nominal_tables_arcsec: held(by_nominal),
        rms_calibrated_table_arcsec: by_calibrated.map(held),
        rms_extended_tables_arcsec: held(by_extended),
    };
    evaluation
}

/// Which rows of all sessions are held out under a load between those learnt from: no table holds more.
fn within_loads(sessions: &[Session], used: &[bool]) -> Vec<bool> {
    let loads =
        || sessions.iter().zip(used).map(|(session, used)| (session.states(0.0).map(|[_, load, _]| load), *used));
    let (low, high) = least_and_most(loads().filter(|(_, used)| *used).flat_map(|(loads, _)| loads));
    loads().flat_map(|(loads, used)| loads.map(move |load| !used && (low..=high).contains(&load))).collect()
}

/// Takes what something adds off the error of each session, arcsec.
pub(crate) fn less<'a>(sessions: &mut [Session], added_arcsec: impl Iterator<Item = &'a Vec<f64>>) {
    for (session, added) in sessions.iter_mut().zip(added_arcsec) {
        session.error_rad.iter_mut().zip(added).for_each(|(error, added)| *error -= added / ARCSEC_PER_RAD);
    }
}

/// Takes the zero away: of sessions that share one, from each that has its `own` on, the mean over those learnt from,
/// or over all of them where nothing was learnt from any.
pub(crate) fn without_zero(mut left: Vec<Vec<f64>>, used: &[bool], own: &[bool]) -> Vec<Vec<f64>> {
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
    fn every_second_session_or_every_third_part_is_held_out() {
        let (parts, used) = split(&[session(9), session(6), session(3)]);
        assert_eq!((parts.len(), used), (3, vec![true, false, true]));
        let (parts, used) = split(&[session(18), session(9)]);
        assert_eq!(used, [true, false, true].repeat(6));
        assert_eq!(parts.iter().map(Session::len).collect::<Vec<_>>(), [[2; 9], [1; 9]].concat());
        // A load in each of which the others say nothing.
        let loaded = |load: f64| Session { torque_n_m: Some(vec![load; 9]), ..session(9) };
        assert_eq!(split(&[loaded(5.0), loaded(-5.0), loaded(2.0), loaded(-2.0)]).0.len(), 36);
        assert_eq!(split(&[loaded(5.0), loaded(2.0), loaded(-5.0), loaded(-2.0)]).0.len(), 4);
        assert_eq!(parts[1].generator_rad, [2.0, 3.0]);
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
    fn the_table_that_leaves_least_in_rows_left_out_is_the_one() {
        use TableKind::{Calibrated, Extended};
        let of = |[none, nominal, extended]: [f64; 3], calibrated: Option<f64>, applied: &[CauseName]| {
            let left = Compensation {
                rms_uncompensated_arcsec: none,
                rms_nominal_tables_arcsec: nominal,
                rms_calibrated_table_arcsec: calibrated,
                rms_extended_tables_arcsec: extended,
            };
            let evaluation = Evaluation { left, applied: applied.to_vec(), ..Evaluation::default() };
            let gain = |nominal| evaluation.tables_that_gain(nominal).into_iter().map(|(kind, _)| kind).collect();
            [1.0 - LEAST_GAIN, 1.0 / (1.0 - LEAST_GAIN)].map(|nominal| -> Vec<TableKind> { gain(nominal) })
        };
        let both = |kinds: &[TableKind]| [kinds.to_vec(), kinds.to_vec()];
        let cause = [CauseName::BacklashGrowth];
        assert_eq!(of([9.0, 5.0, 3.0], Some(3.001), &cause), both(&[Extended, Calibrated]));
        assert_eq!(of([9.0, 5.0, 3.0], Some(2.0), &cause), both(&[Calibrated, Extended]));
        assert_eq!(of([9.0, 5.0, 5.0], Some(2.0), &[]), both(&[Calibrated]));
        assert_eq!(of([9.0, 5.0, 3.0], None, &cause), both(&[Extended]));
        assert_eq!(of([3.0, 5.0, 4.0], Some(3.1), &cause), both(&[]));
        // As good as a nominal table, which is there, and as a nominal model, which is no table.
        assert_eq!(of([9.0, 5.0, 5.0], Some(5.01), &[]), [vec![], vec![Calibrated]]);
    }
}
