//! Gain on sessions that took no part in the fit: each session predicted by a fit to the others, without any offset of
//! its own unless the bench sets its zero anew in each. Which causes are fitted was chosen on all sessions.

use super::model::{Problem, Scaffold, Term, but};
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
pub fn evaluate(problem: &Problem<'_>, terms: &[Term<'_>]) -> Evaluated {
    let zero = own_zero(problem, terms);
    let square = |terms: Vec<&Term<'_>>, anew| left_out(problem, &terms, anew, zero).unwrap_or(f64::NAN);
    let before = square(Vec::new(), false);
    let after = if terms.is_empty() { before } else { square(terms.iter().collect(), true) };
    let without: Vec<f64> = (0..terms.len()).map(|k| square(but(terms, k).collect(), false)).collect();
    let gains = without.iter().map(|without| (without - after) / before.max(1e-12)).collect();
    let gains_beside = without.iter().map(|without| 1.0 - (after / without.max(1e-12)).sqrt()).collect();
    let rms = |square: f64| if square.is_finite() { square.sqrt() } else { 0.0 };
    let total = HeldOut { rms_before_arcsec: rms(before), rms_after_arcsec: rms(after) };
    Evaluated { total, gains, gains_beside }
}

/// Whether the bench sets the zero of a session, which is then found in the session itself: a model with these terms
/// says so, or sessions are known to have their own.
pub(super) fn own_zero(problem: &Problem<'_>, terms: &[Term<'_>]) -> bool {
    !problem.on.rows.zeros.is_empty() || terms.iter().any(|term| term.law.is_zero_of_sessions())
}

/// Mean squared error of prediction, arcsec², over averages without uncertain rows. With `anew` the shape parameters
/// are found without the session as well, by a step of Gauss-Newton where that tells the others better.
fn left_out(problem: &Problem<'_>, terms: &[&Term<'_>], anew: bool, own_zero: bool) -> Option<f64> {
    let scaffold = Scaffold::new(problem, terms.iter().copied());
    let fit = scaffold.fit(None)?;
    let free = if anew && terms.iter().any(|t| !t.places.is_empty()) { Some(scaffold.linearised()?) } else { None };
    let (mut sum, mut count) = (0.0, 0usize);
    for (k, block) in problem.blocks().iter().enumerate() {
        let mut best = (scaffold.without_block(&fit, None, k)?.0, None);
        if let Some((free, moves)) = &free {
            let (to_first_order, _) = scaffold.without_block(free, Some(moves), k)?;
            let moved = moved(problem, terms, &to_first_order.coefficients[fit.priors.len()..]);
            let there = Scaffold::new(problem, &moved);
            let (solution, _) = there.without_block(&there.fit(None)?, None, k)?;
            if solution.misfit < best.0.misfit {
                best = (solution, Some(moved));
            }
        }
        let (solution, moved) = &best;
        let there = moved.as_ref().map_or_else(|| terms.to_vec(), |moved| moved.iter().collect());
        let columns: Vec<&Vec<f64>> = problem.base.iter().chain(there.iter().flat_map(|t| t.averaged.iter())).collect();
        let predicted =
            |g: usize| columns.iter().zip(&solution.coefficients).map(|(column, c)| c * column[g]).sum::<f64>();
        let certain = block.clone().filter(|g| problem.certain[*g]);
        let left: Vec<f64> = certain.map(|g| problem.data[g] - predicted(g)).collect();
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
