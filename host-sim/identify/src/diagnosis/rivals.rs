//! Every rival refitted in the place of each cause named: what the data cannot tell apart is said.

use rayon::prelude::*;

use super::Search;
use super::candidate::Law;
use super::model::{Problem, Scaffold, Term, among_each_other};
use super::select::{Selected, begun, less, settle, size_of, sound};
use super::thresholds::rivals::*;
use super::trace::{Gate, Judged};
use crate::causes::CauseName;

/// A rival in the place of a cause.
#[derive(Clone)]
pub(crate) struct RefittedCause<'l> {
    /// Its name.
    pub cause: CauseName,
    /// Rise of the misfit, in units in which 25 is five standard deviations.
    pub misfit: f64,
    /// Rise up to which the data cannot tell it from the cause.
    least: f64,
    /// Whether both predict the same.
    same: bool,
    /// The law that it is, and where.
    law: &'l Law,
    places: Vec<f64>,
}

impl RefittedCause<'_> {
    /// Whether the data cannot tell it from the cause.
    pub(crate) fn alike(&self) -> bool {
        self.misfit < self.least || self.same
    }

    /// Whether the data distinguish the cause from it.
    pub(crate) fn told_apart(&self) -> Judged {
        Judged { passed: !self.alike(), ..Judged::above(Gate::ToldApart, self.misfit, self.least) }
    }

    /// Whether it explains the data better in the place of the cause.
    pub(crate) fn as_rival(&self) -> Judged {
        Judged::below(Gate::AsRival, self.misfit, -TOLD_APART)
    }
}

/// A sample of the rows on which rivals are looked at first, and its share of all rows.
pub(crate) type OnSample<'a> = Option<(Problem<'a>, f64)>;

/// Rivals of term `k`, whose contribution is `size` arcsec rms, closest first. With a sample only those that are near
/// there are refitted to all rows.
pub(super) fn rivals<'l>(
    Search { problem, laws, bests, .. }: &'l Search<'_>,
    sample: &OnSample<'_>,
    selected: &Selected<'_>,
    (k, size): (usize, f64),
) -> Vec<RefittedCause<'l>> {
    let open: Vec<&Law> =
        laws.iter().filter(|law| law.named() && selected.terms.iter().all(|t| t.law.label != law.label)).collect();
    let begin = |scaffold: &Scaffold<'_, '_, '_, '_>, law: &Law| bests.begin(scaffold, law);
    let of_sample = sample.as_ref().and_then(|(sample, share)| {
        let terms = selected.terms.iter().map(|t| Term::new(sample, t.law, t.places.clone())).collect();
        let terms = among_each_other(sample, terms);
        let there = Selected::of(sample, terms)?;
        Some((refitted(sample, &open, &there, begin, (k, size)), *share))
    });
    let mut rivals: Vec<RefittedCause<'l>> = match of_sample {
        None => refitted(problem, &open, selected, begin, (k, size)),
        Some((mut found, share)) => {
            found.iter_mut().for_each(|found| found.misfit /= share);
            let (near, far): (Vec<RefittedCause<'l>>, Vec<RefittedCause<'l>>) =
                found.into_iter().partition(|found| found.misfit < NEAR);
            let near_laws: Vec<&Law> = near.iter().map(|found| found.law).collect();
            let from_there = |_: &Scaffold<'_, '_, '_, '_>, law: &Law| -> Vec<Vec<f64>> {
                near.iter().filter(|found| found.law.id == law.id).map(|found| found.places.clone()).collect()
            };
            let near = refitted(problem, &near_laws, selected, from_there, (k, size));
            near.into_iter().chain(far).collect()
        }
    };
    rivals.sort_by(|a, b| a.misfit.total_cmp(&b.misfit));
    let mut seen = std::collections::HashSet::new();
    rivals.retain(|r| seen.insert(r.cause));
    rivals
}

/// Laws refitted in the place of term `k`, from where `begin` says.
fn refitted<'l>(
    problem: &Problem<'_>,
    open: &[&'l Law],
    selected: &Selected<'_>,
    begin: impl Fn(&Scaffold<'_, '_, '_, '_>, &Law) -> Vec<Vec<f64>> + Sync,
    (k, size): (usize, f64),
) -> Vec<RefittedCause<'l>> {
    let Some(others) = selected.without(problem, k).map(|without| without.terms) else { return Vec::new() };
    let scaffold = Scaffold::new(problem, &others);
    let now = selected.predicted(problem);
    let of_tolerance = selected.terms[k].law.acts.tolerance_of.is_some();
    // Where more is left than noise, as much may hide in any rival: rises count against what is left.
    let left = selected.fit.solution.misfit / (problem.fineness.worth * problem.data.len().max(1) as f64);
    open.par_iter()
        .with_max_len(1)
        .filter_map(|law| {
            let tried: Vec<(f64, Vec<f64>)> = begin(&scaffold, law)
                .into_iter()
                .filter_map(|places| Some((-scaffold.trial(law, &places, law.search.whole)?.misfit, places)))
                .collect();
            let best = tried.iter().fold(f64::NEG_INFINITY, |best: f64, (worth, _)| best.max(*worth));
            // Far away already: no refinement brings it back; farther for what a lead only points at.
            let far = if law.search.lead.is_none() { 1.0 } else { FARTHER };
            if -best > far * (3.0 * selected.fit.solution.misfit + 3000.0) {
                return None;
            }
            let (term, fit) = begun(law, tried)
                .into_iter()
                .filter_map(|places| scaffold.refine(scaffold.term(law, places)))
                .min_by(|a, b| a.1.solution.misfit.total_cmp(&b.1.solution.misfit))?;
            if !sound(&term, fit.last()) {
                return None;
            }
            let rise = |of: &Selected<'_>| (of.fit.solution.misfit - selected.fit.solution.misfit) / left.max(1.0);
            let places = term.places.clone();
            let with = Selected { terms: [&others[..], &[term]].concat(), fit };
            // The others were refined beside the cause: beside a rival that is close they may be otherwise.
            let near = (TOLD_APART..SETTLED_BELOW).contains(&rise(&with));
            let settled = near.then(|| settle(problem, with.clone())).flatten().unwrap_or(with);
            let apart = size_of(problem, &less(&now, &settled.predicted(problem)));
            // A base parameter out of its tolerance takes the place of any rival: there all predict the same, and the
            // misfit alone decides, which has the tolerance in it.
            let same = !of_tolerance && apart < SAME_ARCSEC.max(SAME_SHARE * size);
            let least = if of_tolerance { OUT_OF_TOLERANCE_APART } else { TOLD_APART };
            Some(RefittedCause { cause: law.cause()?, misfit: rise(&settled), least, same, law, places })
        })
        .collect()
}
