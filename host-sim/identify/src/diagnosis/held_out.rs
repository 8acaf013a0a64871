//! Gain on sessions that took no part in the fit: each session predicted by a fit to the others, without any offset of
//! its own unless the bench sets its zero anew in each. Which causes are fitted was chosen on all sessions.

use super::model::{Fit, Problem, Scaffold, Term};
use super::products::Set;
use super::report::HeldOut;
use super::rows::mean;

/// Errors of prediction in blocks left out.
pub(crate) struct Evaluated {
    /// All causes together.
    pub total: HeldOut,
    /// Share of the squared error before that each term removes.
    pub gains: Vec<f64>,
    /// Share of the rms that the others leave that each term takes.
    pub gains_beside: Vec<f64>,
}

/// Leaves out one session after another.
#[must_use]
pub fn evaluate(problem: &Problem<'_>, terms: &[&Term<'_>]) -> Evaluated {
    let zero = own_zero(problem, terms);
    let square = |terms: &[&Term<'_>], linearised: bool| left_out(problem, terms, linearised, zero).unwrap_or(f64::NAN);
    let before = square(&[], false);
    let after = if terms.is_empty() { before } else { square(terms, true) };
    let without = |k: usize| {
        let others: Vec<&Term<'_>> = terms.iter().enumerate().filter(|(j, _)| *j != k).map(|(_, t)| *t).collect();
        square(&others, false)
    };
    let without: Vec<f64> = (0..terms.len()).map(without).collect();
    let gains = without.iter().map(|without| (without - after) / before.max(1e-12)).collect();
    let gains_beside = without.iter().map(|without| 1.0 - (after / without.max(1e-12)).sqrt()).collect();
    let rms = |square: f64| if square.is_finite() { square.sqrt() } else { 0.0 };
    let total = HeldOut { rms_before_arcsec: rms(before), rms_after_arcsec: rms(after) };
    Evaluated { total, gains, gains_beside }
}

/// Whether the bench sets the zero of a session, which is then found in the session itself: a model with these terms
/// says so, or sessions are known to have their own.
pub(super) fn own_zero(problem: &Problem<'_>, terms: &[&Term<'_>]) -> bool {
    !problem.on.rows.zeros.is_empty() || terms.iter().any(|term| term.law.is_zero_of_sessions())
}

/// Mean squared error of prediction, arcsec², over averages without uncertain rows. With `anew` the shape parameters
/// are found without the session as well, by a step of Gauss-Newton where that tells the others better.
fn left_out(problem: &Problem<'_>, terms: &[&Term<'_>], anew: bool, own_zero: bool) -> Option<f64> {
    let scaffold = Scaffold::new(problem, terms.to_vec());
    let fit = scaffold.fit(None)?;
    let free = if anew && terms.iter().any(|t| !t.places.is_empty()) { Some(scaffold.linearised()?) } else { None };
    let (mut sum, mut count) = (0.0, 0usize);
    for (k, block) in problem.blocks().iter().enumerate() {
        let without = |fit: &Fit, terms: &[&Term<'_>], moves: Option<&Set>| {
            fit.without(&problem.gram(terms, moves, Some(k)), problem.worth)
        };
        let solution = without(&fit, terms, None)?;
        let mut best = (solution, None);
        if let Some((free, moves)) = &free {
            let to_first_order = without(free, terms, Some(moves))?;
            let moved = moved(problem, terms, &to_first_order.coefficients[fit.priors.len()..]);
            let there: Vec<&Term<'_>> = moved.iter().collect();
            let solution = without(&Scaffold::new(problem, there.clone()).fit(None)?, &there, None)?;
            if solution.misfit < best.0.misfit {
                best = (solution, Some(moved));
            }
        }
        let (solution, moved) = &best;
        let there = moved.as_ref().map_or_else(|| terms.to_vec(), |moved| moved.iter().collect());
        let columns: Vec<&Vec<f64>> = problem.base.iter().chain(there.iter().flat_map(|t| t.averaged.iter())).collect();
        let left: Vec<f64> = block
            .clone()
            .filter(|g| problem.certain[*g])
            .map(|g| {
                let predicted: f64 = columns.iter().zip(&solution.coefficients).map(|(column, c)| c * column[g]).sum();
                problem.data[g] - predicted
            })
            .collect();
        let own = if own_zero { mean(&left) } else { 0.0 };
        sum += left.iter().map(|left| (left - own).powi(2)).sum::<f64>();
        count += left.len();
    }
    Some(sum / count.max(1) as f64)
}

/// Terms with their shape parameters moved, one after another.
fn moved<'l>(problem: &Problem<'_>, terms: &[&Term<'l>], moves: &[f64]) -> Vec<Term<'l>> {
    let mut moves = moves.iter();
    terms.iter().map(|term| term.moved(problem, |_| *moves.next().unwrap_or(&0.0))).collect()
}
