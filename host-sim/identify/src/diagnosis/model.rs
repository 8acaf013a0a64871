//! A model: the nominal drive plus terms, each a law at given shape parameters, fitted by penalised generalised least
//! squares.
//!
//! Coefficients are solved exactly; shape parameters by Gauss-Newton around the best of the values tried first.
//! Nuisance columns get a prior in proportion to what the main columns of their law explain, found by iteration.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

use super::Fineness;
use super::candidate::{Acting, Among, Coefficients, Excitation, Law, Regressor, Tag, Tolerance, left_by};
use super::noise::Whitener;
use super::products::{Products, Set};
use super::rows::{combined, rms};
use crate::linear::{Gram, Prior, Solution, solve};

/// Data and nominal model, averaged and white.
pub(crate) struct Problem<'a> {
    /// What laws are evaluated on.
    pub on: Excitation<'a>,
    /// Rows whose flank is not known well.
    pub uncertain: Vec<bool>,
    /// Noise.
    pub whitener: Whitener,
    /// Averages that are used for sizes: no uncertain row in them.
    pub certain: Vec<bool>,
    /// Data less nominal prediction, averaged.
    pub data: Vec<f64>,
    /// `data`, whitened: one column.
    data_white: Set,
    /// Floating base columns, averaged.
    pub base: Vec<Vec<f64>>,
    /// `base`, whitened.
    base_white: Set,
    /// Rows to an average, noise and information weight.
    pub fineness: Fineness,
    /// Products of white columns; their blocks are left out one at a time: sessions, or quarters of the data where
    /// there are fewer than three.
    products: Products,
}

/// How much of a law is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Extent {
    /// All columns.
    Whole,
    /// The main ones.
    Bare,
    /// The columns of its lead.
    Lead,
}

impl<'a> Problem<'a> {
    /// Averages and whitens.
    pub fn new(on: Excitation<'a>, uncertain: &[bool], fineness: Fineness) -> Problem<'a> {
        let whitener = Whitener::new(on.rows, uncertain, fineness.stride, fineness.noise);
        let data = whitener.average(&on.left(&[]));
        let data_white = Set::new(vec![whitener.whiten_averaged(&data)]);
        let base: Vec<Vec<f64>> = on.base.floating.iter().map(|f| whitener.average(&f.values)).collect();
        let base_white = Set::new(whitener.whiten_each(&base));
        let certain = whitener.certain(uncertain);
        let uncertain = uncertain.to_vec();
        let products = Products::over(whitener.blocks());
        Problem { on, uncertain, whitener, certain, data, data_white, base, base_white, fineness, products }
    }

    /// Blocks of averages that are left out one at a time.
    pub(crate) fn blocks(&self) -> &[Range<usize>] {
        &self.products.blocks
    }

    /// Sets of white columns of a model, the data last.
    fn sets<'s>(&'s self, terms: &[&'s Term<'_>], further: impl IntoIterator<Item = &'s Set>) -> Vec<&'s Set> {
        let terms = terms.iter().map(|term| &term.white.columns);
        [&self.base_white].into_iter().chain(terms).chain(further).chain([&self.data_white]).collect()
    }

    /// White columns of a model, the data last.
    pub(crate) fn white_columns<'s>(&'s self, terms: &[&'s Term<'_>], further: Option<&'s Set>) -> Vec<&'s [f64]> {
        self.sets(terms, further).into_iter().flat_map(|set| set.iter()).map(Vec::as_slice).collect()
    }

    fn base_priors(&self) -> Vec<Prior> {
        self.on.base.floating.iter().map(|f| Prior { mean: 0.0, std: f.spread }).collect()
    }

    /// Root mean square over the averages without uncertain rows.
    pub(crate) fn certain_rms(&self, averaged: &[f64]) -> f64 {
        rms(&self.certain_of(averaged))
    }

    /// Values of the averages without uncertain rows.
    pub(crate) fn certain_of(&self, averaged: &[f64]) -> Vec<f64> {
        averaged.iter().zip(&self.certain).filter(|(_, certain)| **certain).map(|(value, _)| *value).collect()
    }
}

/// Columns of a law as rows give them.
fn columns(law: &Law, extent: Extent, on: &Excitation<'_>, places: &[f64]) -> Vec<Regressor> {
    let values = law.values(places);
    let mut columns = match extent {
        Extent::Lead => law.lead_columns(on, &values),
        Extent::Whole | Extent::Bare => law.columns(on, &values),
    };
    columns.retain(|c| extent == Extent::Whole || matches!(c.tolerance, Tolerance::Main(_)));
    columns
}

/// Columns made white, and what their coefficients may be.
#[derive(Clone, Debug)]
pub(crate) struct White {
    /// Columns.
    columns: Set,
    /// What coefficients may be.
    pub tolerances: Vec<Tolerance>,
    /// What the columns are.
    roles: Vec<Tag>,
    /// Root mean square of each averaged column.
    size: Vec<f64>,
}

impl White {
    /// Averages columns and makes them white; returns the averages as well.
    fn of(problem: &Problem<'_>, columns: Vec<Regressor>) -> (Vec<Vec<f64>>, White) {
        let averaged: Vec<Vec<f64>> = columns.iter().map(|c| problem.whitener.average(&c.values)).collect();
        let columns_white = Set::new(problem.whitener.whiten_each(&averaged));
        let size = averaged.iter().map(|c| rms(c)).collect();
        let tolerances = columns.iter().map(|c| c.tolerance).collect();
        let roles = columns.iter().map(|c| c.role).collect();
        (averaged, White { columns: columns_white, tolerances, roles, size })
    }

    /// Columns.
    pub fn len(&self) -> usize {
        self.columns.len()
    }

    /// Coefficients of these columns by what the columns are.
    fn by_role<'c>(&'c self, coefficients: &'c [f64]) -> Coefficients<'c> {
        Coefficients::new(&self.roles, coefficients).of_sizes(&self.size)
    }

    /// Priors, nuisance scaled to what the main columns explain with `coefficients`.
    fn priors(&self, coefficients: Option<&[f64]>) -> Vec<Prior> {
        let explained: f64 = match coefficients {
            None => FIRST_GUESS_ARCSEC,
            Some(c) => (0..self.len())
                .filter(|j| matches!(self.tolerances[*j], Tolerance::Main(_)))
                .map(|j| (c[j] * self.size[j]).powi(2))
                .sum::<f64>()
                .sqrt()
                .max(LEAST_ARCSEC),
        };
        self.tolerances
            .iter()
            .zip(&self.size)
            .map(|(tolerance, size)| match tolerance {
                Tolerance::Main(prior) => *prior,
                Tolerance::Nuisance(share) | Tolerance::Beside(share) => {
                    Prior { mean: 0.0, std: share * explained / size.max(1e-9) }
                }
            })
            .collect()
    }
}

/// A law at given places of its shape parameters, with its columns.
#[derive(Clone)]
pub(crate) struct Term<'l> {
    /// The law.
    pub law: &'l Law,
    /// Places of the shape parameters, 0 to 1.
    pub places: Vec<f64>,
    /// Columns, averaged.
    pub averaged: Arc<Vec<Vec<f64>>>,
    /// Columns, white.
    pub white: White,
    /// What freedom of the shape parameters costs: logarithm of the share of their range that the data leave (0 before
    /// refinement); less the odds against the law before any data.
    pub occam: f64,
    /// What other causes leave to it.
    among: Option<Arc<Among>>,
}

impl<'l> Term<'l> {
    /// Evaluates a law by itself.
    pub fn new(problem: &Problem<'_>, law: &'l Law, places: Vec<f64>) -> Term<'l> {
        Term::among(problem, law, places, None, Extent::Whole)
    }

    /// Only its main columns.
    pub(crate) fn main_only(&self, problem: &Problem<'_>) -> Term<'l> {
        Term::among(problem, self.law, self.places.clone(), self.among.clone(), Extent::Bare)
    }

    /// Evaluates a law on what other causes leave.
    fn among(
        problem: &Problem<'_>,
        law: &'l Law,
        places: Vec<f64>,
        among: Option<Arc<Among>>,
        extent: Extent,
    ) -> Term<'l> {
        let on = left_by(among.as_deref(), &problem.on);
        let (averaged, white) = White::of(problem, columns(law, extent, &on, &places));
        Term { law, places, averaged: Arc::new(averaged), white, occam: -law.search.odds_against, among }
    }

    /// This term with each normalised parameter moved, within its range and no farther than a step reaches.
    pub fn moved(&self, problem: &Problem<'_>, mut by: impl FnMut(usize) -> f64) -> Term<'l> {
        let places = self.places.iter().zip(&self.law.shapes).enumerate().map(|(k, (place, shape))| {
            let moved = place + by(k).clamp(-FARTHEST, FARTHEST);
            if shape.cyclic { moved.rem_euclid(1.0) } else { moved.clamp(0.0, 1.0) }
        });
        Term::among(problem, self.law, places.collect(), self.among.clone(), Extent::Whole)
    }

    /// Values of the shape parameters.
    pub fn values(&self) -> Vec<f64> {
        self.law.values(&self.places)
    }

    /// As a cause that acts on others.
    pub(super) fn acting(&self, coefficients: &[f64]) -> Acting<'l> {
        Acting {
            law: Cow::Borrowed(self.law),
            values: self.values(),
            roles: self.white.roles.clone(),
            coefficients: coefficients.to_vec(),
        }
    }

    /// Coefficients of its columns by what the columns are.
    pub(crate) fn by_role<'c>(&'c self, coefficients: &'c [f64]) -> Coefficients<'c> {
        self.white.by_role(coefficients)
    }

    /// Columns.
    pub fn len(&self) -> usize {
        self.white.len()
    }

    /// What the term adds to the error, averaged.
    pub(crate) fn contribution(&self, coefficients: &[f64]) -> Vec<f64> {
        let len = self.averaged.first().map_or(0, Vec::len);
        combined(len, self.averaged.iter().map(Vec::as_slice), coefficients)
    }
}

/// Parameters of the nominal model are held within this many standard deviations between units: what is beyond is a
/// discrepancy, however well the nominal model could follow it. *Guess*: of normal units one in a thousand lies beyond.
pub(crate) const TOLERANCE: f64 = 3.3;
/// Spread of a parameter that is held at its limit, in units of its tolerance. *Guess*: small enough to hold it, large
/// enough for the matrix.
const HELD: f64 = 1e-3;

/// Solves with the nominal model's parameters within their tolerance, and deviations of laws (`deviations` tells which
/// coefficients are some) within as many of theirs; returns the priors used as well.
pub(super) fn within_tolerance(
    gram: &Gram,
    mut priors: Vec<Prior>,
    problem: &Problem<'_>,
    deviations: &[bool],
) -> Option<(Solution, Vec<Prior>)> {
    let floating = &problem.on.base.floating;
    let held_at = |k: usize, prior: &Prior| match floating.get(k) {
        Some(f) => (f.spread < super::base::FREE).then_some(TOLERANCE * f.spread),
        None => deviations.get(k).is_some_and(|d| *d).then_some(TOLERANCE * prior.std),
    };
    let limits: Vec<Option<f64>> = priors.iter().enumerate().map(|(k, prior)| held_at(k, prior)).collect();
    let mut held = vec![false; priors.len()];
    for _ in 0..MOST_HOLDS {
        let solution = solve(gram, &priors, problem.fineness.worth)?;
        let mut beyond = false;
        for (k, limit) in limits.iter().enumerate() {
            let Some(limit) = limit.filter(|limit| !held[k] && solution.coefficients[k].abs() > *limit) else {
                continue;
            };
            priors[k] = Prior { mean: limit.copysign(solution.coefficients[k]), std: HELD * limit / TOLERANCE };
            held[k] = true;
            beyond = true;
        }
        if !beyond {
            return Some((solution, priors));
        }
    }
    Some((solve(gram, &priors, problem.fineness.worth)?, priors))
}

/// Times that parameters beyond their tolerance are held, at most. *Guess*: each time holds all that are beyond at
/// once, so few are needed.
const MOST_HOLDS: usize = 12;
/// A model is taken to explain this much before anything is known, arcsec. *Guess*: the order of magnitude of the
/// errors of a drive.
const FIRST_GUESS_ARCSEC: f64 = 10.0;
/// Nuisance is scaled to at least this, arcsec. *Guess*: smaller than what is named at all, 1.5 arcsec.
const LEAST_ARCSEC: f64 = 1.0;
/// Rounds of scaling the nuisance priors. *Guess*: from one to the next the scale hardly changes.
const ROUNDS: usize = 3;
/// Longest step of a normalised shape parameter. *Guess*: a fifth of its range, so that a linear model of the step
/// still holds.
const FARTHEST: f64 = 0.2;
/// Step of numerical derivatives, normalised shape parameters. *Guess*: far above round-off, far below where models
/// bend.
const STEP: f64 = 0.01;
/// Prior standard deviation of a normalised shape parameter about where it is. *Guess*: about that of an even
/// distribution over the range, 1/√12.
const PLACE_SPREAD: f64 = 0.3;
/// Above this share of the load scale the torque leaves no doubt about the flank. *Guess*: friction is a few per cent
/// of the load.
const LOADED: f64 = 0.3;
/// Directions in which a second displacement is tried. *Guess*: refinement reaches half a step to either side.
const DIRECTIONS: usize = 8;
/// Sizes at which it is tried: how far its normalised parameter is below the other's. *Guess*: hardly smaller, and
/// clearly.
const SMALLER: [f64; 2] = [0.05, 0.2];
/// Sizes at which one is tried under an eccentric generator, arcsec. *Guess*: a small and a usual one.
const BESIDE_ARCSEC: [f64; 2] = [5.0, 20.0];
/// A step that promises less evidence than this is not tried. *Guess*: far below what decides anything.
const LEAST_PROMISED: f64 = 0.1;
/// A step that gains less evidence than this is the last one. *Guess*: far below what decides anything.
const LEAST_STEP: f64 = 0.3;
/// Gauss-Newton steps at most. *Guess*: three or four converge, if any do.
const STEPS: usize = 6;

/// Share of two squares that the square of their product is where columns are one. *Guess*: beyond round-off.
const SAME: f64 = 1.0 - 1e-9;

/// How far a place may move.
const MOVE: Prior = Prior { mean: 0.0, std: PLACE_SPREAD };

/// A fixed set of terms, to which others are added for a trial.
pub(crate) struct Scaffold<'p, 'a, 't, 'l> {
    problem: &'p Problem<'a>,
    terms: Vec<&'t Term<'l>>,
    /// Terms that come before what is tried, where the order matters.
    ahead: usize,
    /// What the terms leave to a law that adds a load, or meets them in the zones of teeth, or not.
    left: [OnceLock<Option<Arc<Among>>>; 4],
}

/// Terms of laws (index) at places of their shape parameters, each on what the others leave to it.
pub(crate) fn terms_at<'l>(problem: &Problem<'_>, laws: &'l [Law], start: &[(usize, Vec<f64>)]) -> Vec<Term<'l>> {
    among_each_other(problem, start.iter().map(|(k, p)| Term::new(problem, &laws[*k], p.clone())).collect())
}

/// All terms but the one at `k`.
pub(super) fn but<T>(terms: &[T], k: usize) -> impl Iterator<Item = &T> {
    terms.iter().enumerate().filter(move |(j, _)| *j != k).map(|(_, term)| term)
}

/// The terms evaluated anew, each on what the others leave to it.
pub(crate) fn among_each_other<'l>(problem: &Problem<'_>, mut terms: Vec<Term<'l>>) -> Vec<Term<'l>> {
    let meet = |terms: &[Term<'l>]| terms.iter().any(|a| terms.iter().any(|b| a.law.acts_on(b.law)));
    // What acts on nothing here may still have been evaluated among what is no longer there.
    if !meet(&terms) && terms.iter().all(|t| t.among.is_none()) {
        return terms;
    }
    for k in 0..terms.len() {
        let scaffold = Scaffold::new(problem, but(&terms, k)).ahead(k);
        let (left, occam) = (scaffold.left_to(terms[k].law), terms[k].occam);
        if left.is_some() || terms[k].among.is_some() {
            let term = Term::among(problem, terms[k].law, terms[k].places.clone(), left, Extent::Whole);
            terms[k] = Term { occam, ..term };
        }
    }
    terms
}

/// A solved set of terms.
#[derive(Clone)]
pub(crate) struct Fit {
    /// Coefficients, evidence, covariance.
    pub solution: Solution,
    /// Where each term's coefficients begin; base first.
    pub starts: Vec<usize>,
    /// Priors used.
    pub priors: Vec<Prior>,
    /// Products behind it, the data last.
    pub gram: Gram,
}

impl Fit {
    /// Coefficients of term `k`.
    pub fn of(&self, k: usize) -> &[f64] {
        let end = self.starts.get(k + 1).copied().unwrap_or(self.solution.coefficients.len());
        &self.solution.coefficients[self.starts[k]..end]
    }

    /// Coefficients of the last term.
    pub fn last(&self) -> &[f64] {
        self.of(self.starts.len() - 1)
    }

    /// Coefficients of the base.
    pub fn base(&self) -> &[f64] {
        &self.solution.coefficients[..self.starts.first().copied().unwrap_or(self.solution.coefficients.len())]
    }
}

/// Places of the columns that are no main one of their term, and one of another.
fn owned_by_others(terms: &[&White], starts: &[usize], gram: &Gram) -> Vec<usize> {
    let columns = || {
        terms.iter().zip(starts).enumerate().flat_map(|(term, (white, start))| {
            let of = white.tolerances.iter().zip(*start..);
            of.map(move |(of, at)| (term, at, matches!(of, Tolerance::Main(_))))
        })
    };
    let is_one = |a: usize, b: usize| gram.at(a.max(b), a.min(b)).powi(2) > SAME * gram.at(a, a) * gram.at(b, b);
    let owned =
        |(term, at): (usize, usize)| columns().any(|(other, own, main)| main && other != term && is_one(at, own));
    columns().filter(|(term, at, main)| !main && owned((*term, *at))).map(|(_, at, _)| at).collect()
}

impl<'p, 'a, 't, 'l> Scaffold<'p, 'a, 't, 'l> {
    /// Of the base and some terms.
    pub fn new(problem: &'p Problem<'a>, terms: impl IntoIterator<Item = &'t Term<'l>>) -> Self {
        let terms: Vec<&Term<'l>> = terms.into_iter().collect();
        let ahead = terms.len();
        Scaffold { problem, terms, ahead, left: Default::default() }
    }

    /// What is tried has this many of the terms before it.
    pub fn ahead(mut self, ahead: usize) -> Self {
        self.ahead = ahead;
        self
    }

    /// A fit of the terms, and of `further` columns, without a block of the data; and the products of that block.
    pub fn without_block(&self, fit: &Fit, further: Option<&Set>, block: usize) -> Option<(Solution, Gram)> {
        let inside = self.problem.products.gram(&self.problem.sets(&self.terms, further), Some(block));
        let mut outside = fit.gram.clone();
        outside.add(&inside, -1.0);
        Some((solve(&outside, &fit.priors, self.problem.fineness.worth)?, inside))
    }

    /// A law among the terms.
    pub fn term<'n>(&self, law: &'n Law, places: Vec<f64>) -> Term<'n> {
        Term::among(self.problem, law, places, self.left_to(law), Extent::Whole)
    }

    /// White columns of a law among the terms.
    fn white(&self, law: &Law, extent: Extent, places: &[f64]) -> White {
        let among = self.left_to(law);
        let on = left_by(among.as_deref(), &self.problem.on);
        White::of(self.problem, columns(law, extent, &on, places)).1
    }

    /// The solution with a law tried at some places: with all its columns where it is `whole`, else with the main ones.
    pub(crate) fn trial(&self, law: &Law, places: &[f64], whole: bool) -> Option<Solution> {
        let extent = if whole { Extent::Whole } else { Extent::Bare };
        Some(self.fit_with(Some(&self.white(law, extent, places)), None)?.solution)
    }

    /// Whether a law changes what some of the terms do, and they do not change it.
    pub(crate) fn acted_on_by(&self, law: &Law) -> bool {
        self.terms.iter().any(|term| law.acts_on(term.law) && !law.meets(term.law))
    }

    /// What the terms leave to a law.
    fn left_to(&self, law: &Law) -> Option<Arc<Among>> {
        let kind = usize::from(law.is_load()) + 2 * usize::from(law.acts.meets_zones);
        let acts = |k: usize| self.terms[k].law.acts_on(law) && (k < self.ahead || !self.terms[k].law.meets(law));
        if !(0..self.terms.len()).any(acts) {
            return None;
        }
        let left = self.left[kind].get_or_init(|| {
            let fit = self.fit(None)?;
            let acting: Vec<Acting<'l>> =
                (0..self.terms.len()).filter(|k| acts(*k)).map(|k| self.terms[k].acting(fit.of(k))).collect();
            Among::of(&self.problem.on, &acting).map(Arc::new)
        });
        left.clone()
    }

    /// Fits the terms of the scaffold and one more.
    pub fn fit(&self, added: Option<&Term<'_>>) -> Option<Fit> {
        self.fit_with(added.map(|t| &t.white), None)
    }

    /// Fits this model with the moves of shape parameters after all other columns.
    fn fit_with(&self, added: Option<&White>, moves: Option<&Set>) -> Option<Fit> {
        let problem = self.problem;
        let further = added.map(|white| &white.columns).into_iter().chain(moves);
        let gram = problem.products.gram(&problem.sets(&self.terms, further), None);
        let mut starts = Vec::new();
        let mut at = problem.base_white.len();
        let all: Vec<&White> = self.terms.iter().map(|t| &t.white).chain(added).collect();
        for term in &all {
            starts.push(at);
            at += term.len();
        }
        let owned = owned_by_others(&all, &starts, &gram);
        let mut last: Option<(Solution, Vec<Prior>)> = None;
        for round in 0..ROUNDS {
            let mut priors = problem.base_priors();
            for (term, start) in all.iter().zip(&starts) {
                let known = last.as_ref().map(|(s, _)| &s.coefficients[*start..start + term.len()]);
                priors.extend(term.priors(known));
            }
            priors.extend(moves.iter().flat_map(|moves| moves.iter()).map(|_| MOVE));
            // A column has one owner: what is a cause of its own here is no deviation of another one.
            owned.iter().for_each(|k| priors[*k].std *= HELD);
            let mut deviations = vec![false; starts.first().copied().unwrap_or(0)];
            if round + 1 == ROUNDS {
                deviations
                    .extend(all.iter().flat_map(|t| t.tolerances.iter().map(|t| matches!(t, Tolerance::Nuisance(_)))));
            }
            last = Some(within_tolerance(&gram, priors, problem, &deviations)?);
            if all.iter().all(|t| t.tolerances.iter().all(|t| matches!(t, Tolerance::Main(_)))) {
                break;
            }
        }
        let (solution, priors) = last?;
        Some(Fit { solution, starts, priors, gram })
    }

    /// Places at which to begin with a law: those to be tried, or where its lead points.
    pub fn begin(&self, law: &Law) -> Vec<Vec<f64>> {
        let mut places = self.begin_alone(law);
        let Some([phase, size]) = law.displacement_at() else { return places };
        // Next to one that is there, another displacement may stand in any direction: together they are not what either
        // is alone.
        let met = self.terms.iter().find(|t| t.law.meets(law)).map(|t| (t, SMALLER));
        // Under an eccentric generator it shows as another order than alone: no lead points there. Both are pressed in
        // alike.
        let under = |t: &&&Term<'_>| t.law.acts.zones.is_some() && t.law.acts_on(law) && !t.law.meets(law);
        let lobes =
            self.terms.iter().find(under).map(|t| (t, BESIDE_ARCSEC.map(|arcsec| law.shapes[size].place(arcsec))));
        for (is_met, (other, sizes)) in [(true, met), (false, lobes)].into_iter().filter_map(|(a, b)| Some((a, b?))) {
            for (k, of) in (0..DIRECTIONS).flat_map(|k| sizes.map(|of| (k, of))) {
                let mut beside = law.places_like(other.law, &other.places);
                beside[phase] = k as f64 / DIRECTIONS as f64;
                beside[size] = if is_met { (beside[size] - of).max(0.0) } else { of };
                places.push(beside);
            }
        }
        places
    }

    fn begin_alone(&self, law: &Law) -> Vec<Vec<f64>> {
        let tried = law.tried();
        if law.search.lead.is_none() {
            return tried;
        }
        let problem = self.problem;
        let least = LOADED * problem.on.scales.load;
        let mask: Vec<bool> = problem
            .whitener
            .average(&problem.on.rows.torque)
            .iter()
            // A load decides which flank carries: its lead holds where the recorded one leaves no doubt about that.
            .map(|torque| !law.is_load() || torque.abs() > least)
            .collect();
        let some = mask.iter().filter(|m| **m).count() > mask.len() / 10;
        let masked = |set: &Set| {
            let of = |column: &Vec<f64>| -> Vec<f64> {
                column.iter().zip(&mask).map(|(v, m)| if *m || !some { *v } else { 0.0 }).collect()
            };
            Set::new(set.iter().map(of).collect())
        };
        let known: Vec<Set> = problem.sets(&self.terms, None).into_iter().map(masked).collect();
        let products = Products::over(std::iter::once(0..mask.len()).collect());
        let mut priors = problem.base_priors();
        priors.extend(self.terms.iter().flat_map(|t| t.white.priors(None)));
        tried
            .into_iter()
            .flat_map(|places| {
                let lead_columns = self.white(law, Extent::Lead, &places);
                let mut all = priors.clone();
                all.extend(lead_columns.priors(None));
                let new = masked(&lead_columns.columns);
                let mut sets: Vec<&Set> = known.iter().collect();
                sets.insert(known.len() - 1, &new);
                let solution = solve(&products.gram(&sets, None), &all, problem.fineness.worth);
                let found = solution.map(|s| {
                    law.beginnings(&law.values(&places), lead_columns.by_role(&s.coefficients[priors.len()..]))
                });
                found.unwrap_or_default().into_iter().map(|values| law.places(&values)).collect::<Vec<_>>()
            })
            .collect()
    }

    /// Columns (white) by which the prediction of `term` changes with each of its places.
    fn derivatives(&self, term: &Term<'_>, coefficients: &[f64]) -> Vec<Vec<f64>> {
        let problem = self.problem;
        let here = term.contribution(coefficients);
        let on = left_by(term.among.as_deref(), &problem.on);
        (0..term.places.len())
            .map(|i| {
                let mut places = term.places.clone();
                let cyclic = term.law.shapes[i].cyclic;
                let step = if cyclic || places[i] + STEP <= 1.0 { STEP } else { -STEP };
                places[i] += step;
                // Sums, averages and the whitening are linear: one column for all.
                let moved = columns(term.law, Extent::Whole, &on, &places);
                let there = combined(on.rows.len(), moved.iter().map(|column| column.values.as_slice()), coefficients);
                let mut change = problem.whitener.average(&there);
                change.iter_mut().zip(&here).for_each(|(there, here)| *there = (*there - here) / step);
                problem.whitener.whiten_averaged(&change)
            })
            .collect()
    }

    /// Moves the shape parameters of `term` to where the misfit is least, beside the terms of the scaffold.
    pub(crate) fn refine<'n>(&self, mut term: Term<'n>) -> Option<(Term<'n>, Fit)> {
        let mut fit = self.fit(Some(&term))?;
        if term.places.is_empty() {
            return Some((term, fit));
        }
        for _ in 0..STEPS {
            let coefficients = fit.of(fit.starts.len() - 1).to_vec();
            let free = self.fit_with(Some(&term.white), Some(&Set::new(self.derivatives(&term, &coefficients))))?;
            let moves = &free.solution.coefficients[fit.priors.len()..];
            let now = fit.solution.evidence;
            let promised = 0.5 * (fit.solution.misfit - free.solution.misfit);
            term.occam = (free.solution.evidence - now - promised).min(0.0) - term.law.search.odds_against;
            // The linear model of a step says what it can gain.
            if promised < LEAST_PROMISED {
                break;
            }
            let mut better = None;
            for shorter in [1.0, 0.4, 0.1] {
                let trial = term.moved(self.problem, |k| shorter * moves[k]);
                let trial_fit = self.fit(Some(&trial))?;
                if trial_fit.solution.evidence > fit.solution.evidence {
                    better = Some((trial, trial_fit));
                    break;
                }
            }
            let Some((trial, trial_fit)) = better else { break };
            let gain = trial_fit.solution.evidence - fit.solution.evidence;
            // The last step is a short one, and changes next to nothing of what freedom costs.
            (term, fit) = (Term { occam: term.occam, ..trial }, trial_fit);
            if gain < LEAST_STEP {
                break;
            }
        }
        Some((term, fit))
    }

    /// The fit of the scaffold's terms with all their shape parameters free to first order: for uncertainties. Returns
    /// the fit, whose last coefficients are moves of the shape parameters, term after term.
    pub(crate) fn linearised(&self) -> Option<(Fit, Set)> {
        let fit = self.fit(None)?;
        let terms = self.terms.iter().enumerate();
        let moves = Set::new(terms.flat_map(|(k, term)| self.derivatives(term, fit.of(k))).collect());
        Some((self.fit_with(None, Some(&moves))?, moves))
    }
}
