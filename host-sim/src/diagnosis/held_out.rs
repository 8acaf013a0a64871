//! Gain on sessions that took no part: each session predicted by a fit to the others, without any offset of its own.

use flexspline::Table;
use rayon::prelude::*;

use super::candidate::{Excitation, Scales};
use super::linear::{Gram, solve};
use super::model::{Problem, Scaffold, Term};
use super::report::HeldOut;
use super::select::blocks;
use super::{Search, Settings};

/// Errors of prediction in blocks left out.
pub struct Evaluated {
    /// All causes together.
    pub total: HeldOut,
    /// Share of the squared error before that each term removes.
    pub gains: Vec<f64>,
}

/// Folds of sessions that are left out together.
const FOLDS: usize = 3;

/// Leaves out a third of the sessions after another; on the others the causes are chosen and fitted anew, so that the sessions left out
/// have no part in either. `None` with fewer than three sessions.
///
/// An extension that does worse there than the recalibrated nominal model is no extension: then both figures are those of the latter.
#[must_use]
pub fn nested(problem: &Problem<'_>, table: Option<&Table<'_>>, settings: &Settings, causes: bool) -> Option<HeldOut> {
    let on = problem.on;
    let (sessions, groups) = (&on.rows.sessions, &problem.whitener);
    let folds = sessions.len().min(FOLDS);
    if on.rows.used.iter().filter(|used| **used).count() < 3 {
        return None;
    }
    let settings = Settings { averages: settings.averages / FOLDS, verbose: false, ..*settings };
    let squares: Vec<[f64; 3]> = (0..folds)
        .into_par_iter()
        .filter_map(|fold| {
            let learning: Vec<bool> = (0..sessions.len()).map(|k| on.rows.used[k] && k % folds != fold).collect();
            let rows = on.rows.clone().learning_from(&learning);
            super::check(&rows).ok()?;
            let (mut base, jumps) = super::prepare::base(&rows, on.nominal, table);
            base.waves = on.base.waves.clone();
            let scales = Scales { jumps, ..on.scales.clone() };
            let on = Excitation { rows: &rows, nominal: on.nominal, base: &base, scales: &scales };
            let extended = if causes {
                Search::new(&on, &settings).ok()?.extended()?
            } else {
                Search::empty(&on, &settings).extended()?
            };
            let (before, after, _) = extended.rows(&on);
            let left = |predicted: Vec<f64>| -> Vec<f64> {
                groups.average(&rows.error.iter().zip(&predicted).map(|(e, p)| e - p).collect::<Vec<f64>>())
            };
            let (before, after) = (left(before), left(after));
            let mut sums = [0.0; 3];
            let used = on.rows.sessions.iter().enumerate().filter(|(k, _)| problem.on.rows.used[*k]);
            for ((k, _), part) in used.zip(&groups.sessions) {
                for g in part.clone().filter(|g| k % folds == fold && problem.certain[*g]) {
                    sums[0] += before[g] * before[g];
                    sums[1] += after[g] * after[g];
                    sums[2] += 1.0;
                }
            }
            Some(sums)
        })
        .collect();
    let sum = |k: usize| squares.iter().map(|s| s[k]).sum::<f64>();
    let rms = |k: usize| (sum(k) / sum(2)).sqrt();
    (sum(2) > 0.0).then(|| HeldOut { rms_before_arcsec: rms(0), rms_after_arcsec: rms(1).min(rms(0)) })
}

/// Leaves out one session after another.
#[must_use]
pub fn evaluate(problem: &Problem<'_>, terms: &[&Term<'_>]) -> Evaluated {
    let square = |terms: &[&Term<'_>], linearised: bool| left_out(problem, terms, linearised).unwrap_or(f64::NAN);
    let before = square(&[], false);
    let after = if terms.is_empty() { before } else { square(terms, true) };
    let gains = (0..terms.len())
        .map(|k| {
            let others: Vec<&Term<'_>> = terms.iter().enumerate().filter(|(j, _)| *j != k).map(|(_, t)| *t).collect();
            (square(&others, false) - after) / before.max(1e-12)
        })
        .collect();
    let rms = |square: f64| if square.is_finite() { square.sqrt() } else { 0.0 };
    Evaluated { total: HeldOut { rms_before_arcsec: rms(before), rms_after_arcsec: rms(after) }, gains }
}

/// Mean squared error of prediction, arcsec², over averages without uncertain rows. With `linearised` the shape parameters are
/// found anew without the session as well, to first order.
fn left_out(problem: &Problem<'_>, terms: &[&Term<'_>], linearised: bool) -> Option<f64> {
    let scaffold = Scaffold::new(problem, terms.to_vec());
    let (fit, moves) = if linearised { scaffold.linearised()? } else { (scaffold.fit(&[])?, Vec::new()) };
    let white: Vec<&[f64]> = problem
        .base_white
        .iter()
        .chain(terms.iter().flat_map(|t| &t.white))
        .chain(&moves)
        .chain([&problem.data_white])
        .map(Vec::as_slice)
        .collect();
    let columns: Vec<&Vec<f64>> = problem.base.iter().chain(terms.iter().flat_map(|t| &t.averaged)).collect();
    let (mut sum, mut count) = (0.0, 0usize);
    for block in blocks(problem) {
        let mut outside = fit.gram.clone();
        outside.add(&Gram::of(&white, block.clone()), -1.0);
        let c = solve(&outside, &fit.priors, problem.worth)?.coefficients;
        for g in block.filter(|g| problem.certain[*g]) {
            let predicted: f64 = columns.iter().zip(&c).map(|(column, c)| c * column[g]).sum();
            sum += (problem.data[g] - predicted).powi(2);
            count += 1;
        }
    }
    Some(sum / count.max(1) as f64)
}
