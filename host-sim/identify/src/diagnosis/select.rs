//! Which causes: forward by evidence, each held against all others and against deviations without a name; then
//! backward. A cause has to earn its place four times: evidence, size, size against the misfit of the other laws,
//! sessions it was not fitted to.

use std::collections::{HashMap, HashSet};

use rayon::prelude::*;

use super::candidate::{Coefficients, Law, Tag, Tolerance};
use super::held_out::own_zero;
use super::model::{Fit, Problem, Scaffold, Term, among_each_other, but};
use super::thresholds::selection::*;
use super::trace::{Gate, Judged, Stage, Trace, passed};
use crate::linear::Solution;

/// Rounds at most. *Guess*: three causes and three unnamed deviations are taken in one by one, and some are dropped
/// again.
const MOST_ROUNDS: usize = 10;
/// Number of the best candidates that are refitted jointly, … *Guess*: it bounds the time.
const CONTENDERS: usize = 3;
/// … those whose gain is at least this share of what the best gains. *Guess*: what others have taken of a candidate is
/// no more than that.
const CONTENDS: f64 = 0.6;
/// Models that are refined in each round. *Guess*: it bounds the time; the right one is among the first few.
const REFINED: usize = 9;
/// Best starting points that are kept each time that a model is tried. *Guess*: the second one for a wheel that has two
/// sizes.
const NOTED: usize = 2;
/// Models that are refined in each round on all rows, of those that came close on a sample. *Guess*: it bounds the
/// time.
const REFINED_AGAIN: usize = 4;

/// A selection and its fit.
#[derive(Clone)]
pub(crate) struct Selected<'l> {
    /// Terms.
    pub terms: Vec<Term<'l>>,
    /// Their fit.
    pub fit: Fit,
}

impl<'l> Selected<'l> {
    /// These terms, fitted.
    pub fn of(problem: &Problem<'_>, terms: Vec<Term<'l>>) -> Option<Selected<'l>> {
        let fit = Scaffold::new(problem, &terms).fit(None)?;
        Some(Selected { terms, fit })
    }

    /// Evidence, less what the freedom of the term that came last costs.
    fn evidence(&self) -> f64 {
        self.fit.solution.evidence + self.newest().occam
    }

    /// The term that came last.
    fn newest(&self) -> &Term<'l> {
        &self.terms[self.terms.len() - 1]
    }

    /// Whether all terms make sense.
    fn is_sound(&self) -> bool {
        self.terms.iter().enumerate().all(|(k, term)| sound(term, self.fit.of(k)))
    }

    /// Prediction beside the nominal one, averaged.
    pub fn predicted(&self, problem: &Problem<'_>) -> Vec<f64> {
        let columns = problem.base.iter().chain(self.terms.iter().flat_map(|term| term.averaged.iter()));
        super::rows::combined(problem.data.len(), columns.map(Vec::as_slice), &self.fit.solution.coefficients)
    }

    /// The selection without term `k`, the others as they are then, fitted.
    pub fn without(&self, problem: &Problem<'_>, k: usize) -> Option<Selected<'l>> {
        let mut others = self.terms.clone();
        let gone = others.remove(k);
        if others.iter().any(|t| gone.law.acts_on(t.law)) {
            others = among_each_other(problem, others);
        }
        Selected::of(problem, others)
    }
}

/// How a term stands in a selection.
#[derive(Clone, Debug)]
pub(crate) struct Standing {
    /// Gain of evidence over the selection without it.
    pub evidence: f64,
    /// Root mean square of what it adds, arcsec; for what is there at times only, the larger of that and 0.4 of its 97
    /// % quantile.
    pub size: f64,
    /// Root mean square of what nothing else can take over, arcsec.
    pub alone: f64,
    /// Relative change of the prediction error of sessions left out (negative: better without it).
    pub left_out: f64,
}

/// Whether a fitted term makes sense.
pub(super) fn sound(term: &Term<'_>, coefficients: &[f64]) -> bool {
    passed(&sense(term, coefficients))
}

/// Whether a fitted term makes sense: its signs, and the size of its deviations.
fn sense(term: &Term<'_>, coefficients: &[f64]) -> [Judged; 2] {
    // Root mean squares of what it adds by some of its columns, arcsec.
    let part = |of: fn(&Tolerance) -> bool| -> f64 {
        let only: Vec<f64> =
            term.white.tolerances.iter().zip(coefficients).map(|(t, c)| if of(t) { *c } else { 0.0 }).collect();
        super::rows::rms(&term.contribution(&only))
    };
    let (main, nuisance) = (part(|t| matches!(t, Tolerance::Main(_))), part(|t| matches!(t, Tolerance::Nuisance(_))));
    let most = term.law.wrong.most_nuisance;
    let physical = term.law.physical(&term.values(), term.by_role(coefficients));
    [
        Judged::plain(Gate::Sense, physical),
        Judged { passed: nuisance <= most * main, ..Judged::below(Gate::Deviations, nuisance / main, most) },
    ]
}

/// Sizes this far apart on the scale of a shape parameter, from least to largest, are begun with both. *Guess*: a tenth
/// of the range, on a logarithmic scale.
const ANOTHER_SIZE: f64 = 0.1;

/// The places of those tried, with what each is worth, that a law is refined from: the best, and for a wheel beside its
/// place the best of another size. Small ones leave clearance and large ones none, and no refinement goes from one to
/// the other.
pub(super) fn begun(law: &Law, mut tried: Vec<(f64, Vec<f64>)>) -> Vec<Vec<f64>> {
    tried.sort_by(|a, b| b.0.total_cmp(&a.0));
    let size = law.displacement_at().filter(|_| law.acts.meets_zones).map(|[_, size]| size);
    let mut begun: Vec<Vec<f64>> = Vec::new();
    for (_, places) in tried {
        let other = |first: &Vec<f64>| size.is_some_and(|size| (places[size] - first[size]).abs() > ANOTHER_SIZE);
        if begun.first().is_none_or(other) {
            begun.push(places);
        }
        if begun.len() == 2 {
            break;
        }
    }
    begun
}

/// Which laws a search tries, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scope {
    /// All of them, wherever they may begin.
    Everything,
    /// Those that came close on a sample of the rows, from where they were there.
    CameClose,
}

/// What a search has found out about laws, whether it chose them or not.
#[derive(Default)]
pub(crate) struct Bests {
    /// Where they were at their best, each time that they were tried at all places.
    tried: HashMap<u64, Vec<Vec<f64>>>,
    /// Where those came to that were refined and came close, the latest first.
    close: HashMap<u64, Vec<Vec<f64>>>,
}

impl Bests {
    /// Notes the best of those tried, with what each is worth.
    fn note(&mut self, law: &Law, tried: &[(f64, Vec<f64>)]) {
        let mut best: Vec<&(f64, Vec<f64>)> = tried.iter().collect();
        best.sort_by(|a, b| b.0.total_cmp(&a.0));
        let known = self.tried.entry(law.id).or_default();
        for (_, places) in best.into_iter().take(NOTED) {
            if !known.contains(places) {
                known.push(places.clone());
            }
        }
    }

    /// Notes a refined term that came close.
    fn came_close(&mut self, term: &Term<'_>) {
        let known = self.close.entry(term.law.id).or_default();
        known.retain(|places| *places != term.places);
        known.insert(0, term.places.clone());
        known.truncate(NOTED);
    }

    /// Places to begin with a law that takes the place of a term: where it was at its best beside all terms so far or
    /// before, and where its lead points now.
    pub fn begin(&self, scaffold: &Scaffold<'_, '_, '_, '_>, law: &Law) -> Vec<Vec<f64>> {
        match self.tried.get(&law.id).filter(|_| law.search.lead.is_none()) {
            Some(known) => known.clone(),
            None => scaffold.begin(law),
        }
    }
}

/// Evidence of each law together with the terms of a scaffold, not refined, at the places that `begin` gives.
fn tried(
    scaffold: &Scaffold<'_, '_, '_, '_>,
    laws: &[&Law],
    begin: impl Fn(&Law) -> Vec<Vec<f64>> + Sync,
) -> Vec<Vec<(f64, Vec<f64>)>> {
    let at = |law: &Law, places: Vec<f64>| {
        let evidence = scaffold.trial(law, &places, law.search.whole)?.evidence;
        evidence.is_finite().then_some((evidence, places))
    };
    let of = |law: &&Law| begin(law).into_par_iter().with_max_len(4).filter_map(|places| at(law, places)).collect();
    laws.par_iter().with_max_len(1).map(of).collect()
}

/// The strongest laws (`most` of them) at the best of the places tried, best evidence first, not refined; and the
/// others with the gates that they came to.
fn best_tried<'l>(
    scaffold: &Scaffold<'_, '_, '_, 'l>,
    laws: &[&'l Law],
    tried: Vec<Vec<(f64, Vec<f64>)>>,
    most: usize,
) -> (Vec<Term<'l>>, Vec<Dropped<'l>>) {
    let begun: Vec<(&'l Law, Vec<f64>)> = laws
        .iter()
        .zip(tried)
        .flat_map(|(law, tried)| begun(law, tried).into_iter().map(|places| (*law, places)))
        .collect();
    let mut found: Vec<(f64, &'l Law, Vec<f64>)> = begun
        .into_par_iter()
        .with_max_len(1)
        .filter_map(|(law, places)| {
            let evidence = scaffold.trial(law, &places, true)?.evidence;
            evidence.is_finite().then_some((evidence, law, places))
        })
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut terms, mut refused) = (Vec::new(), Vec::new());
    for law in laws.iter().filter(|law| found.iter().all(|(_, other, _)| other.id != law.id)) {
        refused.push((*law, vec![Judged::plain(Gate::Refined, false)]));
    }
    let mut counted = HashSet::new();
    let mut least = f64::INFINITY;
    for (evidence, law, places) in found {
        let too_late = || vec![Judged { passed: false, ..Judged::above(Gate::Refined, evidence, least) }];
        if counted.len() > most {
            refused.push((law, too_late()));
            continue;
        }
        let term = scaffold.term(law, places);
        // Where a lead points is only near; what changes other terms may make sense where they have settled.
        let open = law.search.lead.is_some() || scaffold.acted_on_by(law);
        let fit = if open { None } else { Some(scaffold.fit(Some(&term))) };
        let refused_for = fit.map_or_else(Vec::new, |fit| match fit {
            Some(fit) => sense(&term, fit.last()).to_vec(),
            None => vec![Judged::plain(Gate::Refined, false)],
        });
        if passed(&refused_for) {
            counted.insert(law.id);
        } else if law.shapes.is_empty() || !counted.is_empty() {
            // What tells the data better than all these may make sense at places nearby; others do not.
            refused.push((law, refused_for));
            continue;
        }
        if counted.len() > most {
            refused.push((law, too_late()));
            continue;
        }
        least = evidence;
        terms.push(term);
    }
    (terms, refused)
}

/// What each term adds that the others cannot, and what it is worth on sessions left out.
pub(crate) fn standings(problem: &Problem<'_>, selected: &Selected<'_>) -> Vec<Standing> {
    (0..selected.terms.len()).map(|k| standing(problem, selected, k)).collect()
}

/// What term `k` adds that the others cannot, and its gain on sessions left out.
pub(super) fn standing(problem: &Problem<'_>, selected: &Selected<'_>, k: usize) -> Standing {
    let term = &selected.terms[k];
    let Some(without) = selected.without(problem, k) else {
        return Standing { evidence: f64::INFINITY, size: f64::INFINITY, alone: f64::INFINITY, left_out: 1.0 };
    };
    let evidence = selected.fit.solution.evidence + term.occam - without.fit.solution.evidence;
    let alone = size_of(problem, &less(&selected.predicted(problem), &without.predicted(problem)));
    // At one load throughout, the zero of the encoder takes all of it.
    let own = about_mean(problem, term.contribution(selected.fit.of(k)));
    if term.law.acts.tolerance_of.is_some() {
        // Without it the base goes to its limit: what is beyond that is alone, all of it counts.
        return Standing { evidence, size: size_of(problem, &own), alone, left_out: 1.0 };
    }
    let mut left_out = left_out_gain(problem, &selected.terms, &without.terms);
    if left_out <= 0.0 {
        // Its deviations may not reach to other sessions, where the law itself does.
        let with_bare = [&without.terms[..], &[term.main_only(problem)]].concat();
        left_out = left_out.max(left_out_gain(problem, &with_bare, &without.terms));
    }
    let mut size = (TAKEN_OVER * alone).min(size_of(problem, &own)).max(alone);
    if term.law.acts.in_crossings {
        size = size.max(super::rows::rms(&own).min(IN_CROSSINGS * size));
    }
    Standing { evidence, size, alone, left_out }
}

/// Less the mean: the zero of the encoder takes it.
pub(super) fn about_mean(problem: &Problem<'_>, mut values: Vec<f64>) -> Vec<f64> {
    let certain = problem.certain_of(&values);
    let mean = certain.iter().sum::<f64>() / certain.len().max(1) as f64;
    values.iter_mut().for_each(|v| *v -= mean);
    values
}

/// Size of an addition to the prediction.
pub fn size_of(problem: &Problem<'_>, added: &[f64]) -> f64 {
    let used = problem.certain_of(added);
    let high = super::rows::quantile(used.iter().map(|v| v.abs()), 0.97);
    super::rows::rms(&used).max(0.4 * high)
}

/// One prediction less another.
pub(super) fn less(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// Gain of squared innovations in blocks left out, by having all `terms` instead of `fewer`.
fn left_out_gain(problem: &Problem<'_>, terms: &[Term<'_>], fewer: &[Term<'_>]) -> f64 {
    // Nobody foretells a zero that the bench sets in each session: there it is found in the block itself. The first
    // column is the zero.
    let own = own_zero(problem, terms);
    let misfit = |terms: &[Term<'_>]| -> Option<f64> {
        let scaffold = Scaffold::new(problem, terms);
        let fit = scaffold.fit(None)?;
        let of_block = |block| {
            let (Solution { coefficients: c, .. }, inside) = scaffold.without_block(&fit, None, block)?;
            Some(if own { inside.first_free().left_by(&c[1..]) } else { inside.left_by(&c) })
        };
        (0..problem.blocks().len()).map(of_block).sum()
    };
    match (misfit(terms), misfit(fewer)) {
        (Some(with), Some(without)) => (without - with) * problem.fineness.worth,
        _ => 0.0,
    }
}

/// Whether a base parameter has left its tolerance far enough for `law` to be named; none for a law that is no base
/// parameter.
pub(super) fn tolerance(problem: &Problem<'_>, fit: &Fit, law: &Law) -> Option<Judged> {
    let name = law.acts.tolerance_of?;
    let floating = &problem.on.base.floating;
    let Some(at) = floating.iter().position(|f| f.name == name) else {
        // Not floating at all: any change is one.
        return Some(Judged::plain(Gate::Tolerance, true));
    };
    let change = fit.solution.coefficients[at];
    let z = change / floating[at].spread;
    let physical = law.physical(&[], Coefficients::new(&[Tag::SIZE], &[change]));
    // On the wrong side it counts as far below as it has gone there.
    Some(Judged::above(Gate::Tolerance, if physical { z.abs() } else { -z.abs() }, OUT_OF_TOLERANCE))
}

/// Least size of anything that counts, arcsec, at this white noise.
pub(crate) fn least_size(white: f64) -> f64 {
    LEAST_ARCSEC.max(LEAST_OF_NOISE * white)
}

/// The gates that a law comes to, whatever the ones before say. `least` is the least size that counts, `misfit` what
/// the laws of the other terms may be wrong by, `strongest` the largest size, all arcsec.
fn gates(law: &Law, standing: &Standing, least: f64, misfit: f64, strongest: f64) -> Vec<Judged> {
    let share = if law.named() { LEAST_OF_MISFIT } else { LEAST_UNNAMED_OF_MISFIT };
    let evidence = if law.acts.tolerance_of.is_some() { LEAST_GAIN } else { LEAST_EVIDENCE };
    let mut size = Judged::above(Gate::Size, standing.size, least);
    if !size.passed && law.named() {
        let least = (LEAST_IF_CLEAR * least).max(LEAST_OF_STRONGEST * strongest);
        size = Judged::above(Gate::SizeIfClear, standing.size, least);
    }
    let left_out = standing.left_out > 0.0 || !law.wrong.foretells;
    vec![
        Judged::above(Gate::Evidence, standing.evidence, evidence),
        size,
        Judged::above(Gate::Alone, standing.alone, share * misfit),
        Judged { passed: left_out, ..Judged::above(Gate::LeftOut, standing.left_out, 0.0) },
    ]
}

/// The largest size of those that may be wrong at all: a jump of teeth is counted.
fn strongest(terms: &[Term<'_>], standings: &[Standing]) -> f64 {
    terms.iter().zip(standings).filter(|(t, _)| t.law.wrong.misfit > 0.0).map(|(_, s)| s.size).fold(0.0, f64::max)
}

/// By how much the laws of terms may be wrong as something that `law` describes, arcsec.
pub(super) fn misfit_as<'t, 'l: 't>(law: &Law, terms: impl IntoIterator<Item = (&'t Term<'l>, &'t Standing)>) -> f64 {
    terms.into_iter().map(|(term, standing)| standing.size * term.law.misfit_as(law)).fold(0.0, f64::max)
}

/// Refines each term with the others held, if there are others.
pub(super) fn settle<'l>(problem: &Problem<'_>, selected: Selected<'l>) -> Option<Selected<'l>> {
    if selected.terms.len() < 2 { Some(selected) } else { settle_each(problem, selected, false) }
}

/// Refines each term with the others held, a single term too. Where one has gone that they were refined with (`anew`),
/// those with a lead begin where it points now, too, and the best is kept.
pub(super) fn settle_each<'l>(problem: &Problem<'_>, selected: Selected<'l>, anew: bool) -> Option<Selected<'l>> {
    let mut terms = among_each_other(problem, selected.terms);
    for k in (0..terms.len()).filter(|k| !terms[*k].places.is_empty()).collect::<Vec<_>>() {
        let scaffold = Scaffold::new(problem, but(&terms, k)).ahead(k);
        let law = terms[k].law;
        let begun = if anew && law.search.lead.is_some() { scaffold.begin(law) } else { Vec::new() };
        let begun = begun.into_iter().map(|places| scaffold.term(law, places));
        let refined = [terms[k].clone()].into_iter().chain(begun).filter_map(|term| scaffold.refine(term));
        // Less what the freedom of the term costs.
        let evidence = |(term, fit): &(Term<'_>, Fit)| fit.solution.evidence + term.occam;
        if let Some((term, _)) = refined.max_by(|a, b| evidence(a).total_cmp(&evidence(b))) {
            terms[k] = term;
        }
    }
    Selected::of(problem, among_each_other(problem, terms))
}

/// The gates that a term has to pass to keep its place; `least` is the least size that counts, arcsec.
pub(super) fn earns(
    problem: &Problem<'_>,
    selected: &Selected<'_>,
    standings: &[Standing],
    k: usize,
    least: f64,
) -> Vec<Judged> {
    let law = selected.terms[k].law;
    let mut all = sense(&selected.terms[k], selected.fit.of(k)).to_vec();
    if law.acts.tolerance_of.is_some() {
        let out = selected.without(problem, k).and_then(|without| tolerance(problem, &without.fit, law));
        all.push(out.unwrap_or(Judged::plain(Gate::Tolerance, false)));
    }
    let others = selected.terms.iter().zip(standings).enumerate().filter(|(j, _)| *j != k).map(|(_, other)| other);
    let misfit = misfit_as(law, others);
    all.extend(gates(law, &standings[k], least, misfit, strongest(&selected.terms, standings)));
    all
}

/// A law that was dropped before it was compared, and what it was asked.
type Dropped<'l> = (&'l Law, Vec<Judged>);
/// A selection that has grown by a term, and the evidence that it gains.
type Grown<'l> = (f64, Selected<'l>);

/// The search for causes among laws.
pub(crate) struct Chooser<'c, 'a, 'l> {
    /// Data and nominal model.
    pub problem: &'c Problem<'a>,
    /// What may be chosen.
    pub laws: &'l [Law],
    /// Least size that counts, arcsec.
    pub least: f64,
    /// Where laws were at their best.
    pub bests: &'c mut Bests,
    /// Which laws are tried, and where.
    pub scope: Scope,
    /// Every decision.
    pub trace: &'c mut Trace,
}

impl<'l> Chooser<'_, '_, 'l> {
    /// Chooses causes, beginning with some terms.
    pub fn select(mut self, start: Vec<Term<'l>>) -> Option<Selected<'l>> {
        let problem = self.problem;
        let mut selected = Selected::of(problem, start)?;
        if !selected.terms.is_empty() {
            // They were found in other noise, and in rows that some of them have put in doubt since.
            selected = self.backward(settle_each(problem, selected, false)?)?;
        }
        let mut seen = HashSet::new();
        for _ in 0..MOST_ROUNDS {
            let Some(next) = self.forward(&selected) else { break };
            selected = self.backward(settle(problem, next)?)?;
            let mut causes: Vec<String> = selected.terms.iter().map(|t| t.law.label.to_string()).collect();
            causes.sort_unstable();
            if !seen.insert(causes.join("+")) {
                break;
            }
        }
        Some(selected)
    }

    /// Takes in one more term, if one earns its place.
    fn forward(&mut self, selected: &Selected<'l>) -> Option<Selected<'l>> {
        let (problem, everything) = (self.problem, self.scope == Scope::Everything);
        self.trace.round += 1;
        let named = selected.terms.iter().filter(|t| t.law.named()).count();
        let unnamed = selected.terms.len() - named;
        let mut open: Vec<&Law> = Vec::new();
        for law in self.laws.iter().filter(|law| everything || self.bests.close.contains_key(&law.id)) {
            if selected.terms.iter().any(|t| t.law.label == law.label) {
                continue;
            }
            let (chosen, most) = if law.named() { (named, MOST_CAUSES) } else { (unnamed, MOST_UNNAMED) };
            let room = Judged::below(Gate::Room, chosen as f64, most as f64);
            let gates: Vec<Judged> = [room].into_iter().chain(tolerance(problem, &selected.fit, law)).collect();
            if passed(&gates) {
                open.push(law);
            } else {
                self.trace.decided(Stage::Tried, law.label, None, gates);
            }
        }
        let scaffold = Scaffold::new(problem, &selected.terms);
        let (tried, most) = if everything {
            let tried = tried(&scaffold, &open, |law| scaffold.begin(law));
            open.iter().zip(&tried).for_each(|(law, tried)| self.bests.note(law, tried));
            (tried, REFINED)
        } else {
            (tried(&scaffold, &open, |law| self.bests.close.get(&law.id).cloned().unwrap_or_default()), REFINED_AGAIN)
        };
        let (found, refused) = best_tried(&scaffold, &open, tried, most);
        for (law, gates) in refused {
            self.trace.decided(Stage::Tried, law.label, None, gates);
        }
        let before = selected.fit.solution.evidence;
        let refine = |term: Term<'l>| -> Result<Grown<'l>, Dropped<'l>> {
            let law = term.law;
            let Some((refined, fit)) = scaffold.refine(term) else {
                return Err((law, vec![Judged::plain(Gate::Gain, false)]));
            };
            let sense = sense(&refined, fit.last());
            if !passed(&sense) && !scaffold.acted_on_by(law) {
                return Err((law, sense.to_vec()));
            }
            let mut next = Selected { terms: [&selected.terms[..], &[refined]].concat(), fit };
            if !passed(&sense) {
                // What changes others was refined with what they do without it.
                let settled = settle(problem, next).filter(Selected::is_sound);
                next = settled.ok_or_else(|| (law, sense.to_vec()))?;
            }
            Ok((next.evidence() - before, next))
        };
        let refined: Vec<_> = found.into_par_iter().with_max_len(1).map(refine).collect();
        let mut grown: Vec<Grown<'l>> = Vec::new();
        for outcome in refined {
            match outcome {
                Ok(next) => grown.push(next),
                Err((law, gates)) => self.trace.decided(Stage::Forward, law.label, None, gates),
            }
        }
        for (_, next) in grown.iter().filter(|(gain, _)| everything && *gain > CLOSE_GAIN) {
            self.bests.came_close(next.newest());
        }
        contenders_settled(problem, &mut grown, before);
        // Something with a name goes before something without unless that is clearly better.
        let best_named = grown.iter().filter(|(_, next)| next.newest().law.named()).max_by(|a, b| a.0.total_cmp(&b.0));
        // It has to be ahead by more than the law of the cause may be wrong by.
        let wrong = best_named.map_or(0.0, |(_, next)| next.newest().law.wrong.misfit.powi(2));
        let ahead = |(gain, next): &Grown<'l>| {
            gain - if next.newest().law.named() { 0.0 } else { UNNAMED_AHEAD.max(wrong * gain) }
        };
        grown.sort_by(|a, b| ahead(b).total_cmp(&ahead(a)));
        let standings = standings(problem, selected);
        let strongest = strongest(&selected.terms, &standings);
        let mut grown = grown.into_iter().peekable();
        while let Some((gain, next)) = grown.next_if(|(gain, _)| *gain >= LEAST_GAIN) {
            let term = next.newest();
            let standing = standing(problem, &next, next.terms.len() - 1);
            let misfit = misfit_as(term.law, selected.terms.iter().zip(&standings));
            let gates = gates(term.law, &standing, self.least, misfit, strongest);
            let passes = passed(&gates);
            self.trace.decided(Stage::Forward, term.law.label, None, gates);
            if passes {
                for (less, other) in grown {
                    let other = other.newest();
                    if everything && less > gain - CLOSE_BEHIND {
                        self.bests.came_close(other);
                    }
                    let behind = Judged { passed: false, ..Judged::above(Gate::First, less, gain) };
                    self.trace.decided(Stage::Forward, other.law.label, Some(term.law.label), vec![behind]);
                }
                return Some(next);
            }
        }
        for (gain, next) in grown {
            let gates = vec![Judged::above(Gate::Gain, gain, LEAST_GAIN)];
            self.trace.decided(Stage::Forward, next.newest().law.label, None, gates);
        }
        None
    }

    /// Drops what no longer earns its place, weakest first.
    fn backward(&mut self, mut selected: Selected<'l>) -> Option<Selected<'l>> {
        let problem = self.problem;
        while !selected.terms.is_empty() {
            let standings = standings(problem, &selected);
            let weakest = (0..selected.terms.len())
                .map(|k| (k, earns(problem, &selected, &standings, k, self.least)))
                .filter(|(_, gates)| !passed(gates))
                .min_by(|(a, _), (b, _)| standings[*a].evidence.total_cmp(&standings[*b].evidence));
            let Some((k, gates)) = weakest else { break };
            let gone = selected.terms.remove(k);
            self.trace.decided(Stage::Backward, gone.law.label, None, gates);
            selected = settle_each(problem, Selected::of(problem, selected.terms)?, true)?;
        }
        Some(selected)
    }
}

/// The best by name of selections that have grown by a term, and those close to it, settle before they are compared:
/// what they were refined with has taken some of what is there, which is not the same share of each. Gains are over
/// `before`.
fn contenders_settled<'l>(problem: &Problem<'_>, grown: &mut [Grown<'l>], before: f64) {
    let mut named: Vec<&mut Grown<'l>> = grown.iter_mut().filter(|(_, next)| next.newest().law.named()).collect();
    named.sort_by(|a, b| b.0.total_cmp(&a.0));
    let least = named.first().map_or(f64::INFINITY, |(best, _)| (CONTENDS * best).max(LEAST_EVIDENCE));
    named.truncate(CONTENDERS);
    named.retain(|(gain, next)| *gain >= least && but(&next.terms, next.terms.len() - 1).any(|t| !t.places.is_empty()));
    if named.len() < 2 {
        return;
    }
    named.into_par_iter().with_max_len(1).for_each(|grown| {
        if let Some(settled) = settle(problem, grown.1.clone()) {
            *grown = (settled.evidence() - before, settled);
        }
    });
}
