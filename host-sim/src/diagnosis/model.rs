//! A model: the nominal drive plus terms, each a law at given shape parameters, fitted by penalised generalised least squares.
//!
//! Coefficients are solved exactly; shape parameters by Gauss-Newton around the best of the values tried first. Nuisance columns
//! get a prior in proportion to what the main columns of their law explain, found by iteration.

use super::candidate::{Excitation, Law, Tolerance};
use super::linear::{Gram, Prior, Solution, products, solve};
use super::noise::Whitener;
use super::rows::rms;

/// Data and nominal model, averaged and white.
pub struct Problem<'a> {
    /// What laws are evaluated on.
    pub on: &'a Excitation<'a>,
    /// Rows whose flank is not known well.
    pub uncertain: Vec<bool>,
    /// Noise.
    pub whitener: Whitener,
    /// Averages that are used for sizes: no uncertain row in them.
    pub certain: Vec<bool>,
    /// Data less nominal prediction, averaged.
    pub data: Vec<f64>,
    /// The same, white.
    pub data_white: Vec<f64>,
    /// Floating base columns, averaged.
    pub base: Vec<Vec<f64>>,
    /// The same, white.
    pub base_white: Vec<Vec<f64>>,
    /// Worth of the information, at most 1.
    pub worth: f64,
}

impl<'a> Problem<'a> {
    /// Averages and whitens.
    #[must_use]
    pub fn new(on: &'a Excitation<'a>, uncertain: &[bool], whitener: Whitener, worth: f64) -> Problem<'a> {
        let rows: Vec<f64> = on.rows.error.iter().zip(&on.base.prediction).map(|(e, p)| e - p).collect();
        let data = whitener.average(&rows);
        let data_white = whitener.whiten_averaged(&data);
        let base: Vec<Vec<f64>> = on.base.floating.iter().map(|f| whitener.average(&f.values)).collect();
        let base_white = base.iter().map(|column| whitener.whiten_averaged(column)).collect();
        let certain = whitener.certain(uncertain);
        Problem { on, uncertain: uncertain.to_vec(), whitener, certain, data, data_white, base, base_white, worth }
    }

    fn base_priors(&self) -> Vec<Prior> {
        self.on.base.floating.iter().map(|f| Prior { mean: 0.0, std: f.spread }).collect()
    }

    /// Root mean square over the averages without uncertain rows.
    #[must_use]
    pub fn certain_rms(&self, averaged: &[f64]) -> f64 {
        let used: Vec<f64> = averaged.iter().zip(&self.certain).filter(|(_, c)| **c).map(|(v, _)| *v).collect();
        rms(&used)
    }
}

/// A law at given places of its shape parameters, with its columns.
#[derive(Clone)]
pub struct Term<'l> {
    /// The law.
    pub law: &'l Law,
    /// Places of the shape parameters, 0 to 1.
    pub places: Vec<f64>,
    /// Columns, averaged.
    pub averaged: Vec<Vec<f64>>,
    /// Columns, white.
    pub white: Vec<Vec<f64>>,
    /// What coefficients may be.
    pub tolerances: Vec<Tolerance>,
    /// Root mean square of each averaged column.
    size: Vec<f64>,
    /// What freedom of the shape parameters costs: logarithm of the share of their range that the data leave (0 before refinement).
    pub occam: f64,
}

impl<'l> Term<'l> {
    /// Evaluates a law.
    #[must_use]
    pub fn new(problem: &Problem<'_>, law: &'l Law, places: Vec<f64>) -> Term<'l> {
        let columns = (law.columns)(problem.on, &law.values(&places));
        let averaged: Vec<Vec<f64>> = columns.iter().map(|c| problem.whitener.average(&c.values)).collect();
        let white = averaged.iter().map(|c| problem.whitener.whiten_averaged(c)).collect();
        let size = averaged.iter().map(|c| rms(c)).collect();
        Term {
            law,
            places,
            averaged,
            white,
            tolerances: columns.iter().map(|c| c.tolerance).collect(),
            size,
            occam: 0.0,
        }
    }

    /// Only its main columns.
    #[must_use]
    pub fn main_only(mut self) -> Term<'l> {
        let keep: Vec<bool> = self.tolerances.iter().map(|t| matches!(t, Tolerance::Main(_))).collect();
        let mut at = keep.iter();
        self.averaged.retain(|_| *at.next().unwrap_or(&true));
        let mut at = keep.iter();
        self.white.retain(|_| *at.next().unwrap_or(&true));
        let mut at = keep.iter();
        self.size.retain(|_| *at.next().unwrap_or(&true));
        self.tolerances.retain(|t| matches!(t, Tolerance::Main(_)));
        self
    }

    /// Columns.
    #[must_use]
    pub fn len(&self) -> usize {
        self.white.len()
    }

    /// Whether the law gave no column.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.white.is_empty()
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
                Tolerance::Nuisance(share) | Tolerance::Beside(share) | Tolerance::History(share) => {
                    Prior { mean: 0.0, std: share * explained / size.max(1e-9) }
                }
            })
            .collect()
    }

    /// What the term adds to the error, averaged.
    #[must_use]
    pub fn contribution(&self, coefficients: &[f64]) -> Vec<f64> {
        let mut sum = vec![0.0; self.averaged.first().map_or(0, Vec::len)];
        for (column, c) in self.averaged.iter().zip(coefficients) {
            for (s, v) in sum.iter_mut().zip(column) {
                *s += c * v;
            }
        }
        sum
    }
}

/// Parameters of the nominal model are held within this many standard deviations between units: what is beyond is a discrepancy, however
/// well the nominal model could follow it.
pub const TOLERANCE: f64 = 3.3;
/// Spread of a parameter that is held at its limit, in units of its tolerance.
const HELD: f64 = 1e-3;

/// Solves with the nominal model's parameters within their tolerance; returns the priors used as well.
pub(super) fn within_tolerance(
    gram: &Gram,
    mut priors: Vec<Prior>,
    problem: &Problem<'_>,
) -> Option<(Solution, Vec<Prior>)> {
    let floating = &problem.on.base.floating;
    let mut held = vec![false; floating.len()];
    loop {
        let solution = solve(gram, &priors, problem.worth)?;
        let mut beyond = false;
        for (k, f) in floating.iter().enumerate() {
            let limit = TOLERANCE * f.spread;
            if !held[k] && f.spread < super::base::FREE && solution.coefficients[k].abs() > limit {
                priors[k] = Prior { mean: limit.copysign(solution.coefficients[k]), std: HELD * f.spread };
                held[k] = true;
                beyond = true;
            }
        }
        if !beyond {
            return Some((solution, priors));
        }
    }
}

/// What a law is taken to explain before anything is known, arcsec.
const FIRST_GUESS_ARCSEC: f64 = 10.0;
/// Nuisance is scaled to at least this, arcsec.
const LEAST_ARCSEC: f64 = 1.0;
/// Rounds of scaling the nuisance priors.
const ROUNDS: usize = 3;
/// Step of numerical derivatives, in places.
const STEP: f64 = 0.01;
/// Spread of a shape parameter about where it is, in places.
const PLACE_SPREAD: f64 = 0.3;
/// Torques above this share of the load scale leave no doubt about the flank.
const LOADED: f64 = 0.3;
/// Gauss-Newton steps at most.
const STEPS: usize = 6;

/// Products of a fixed set of terms, to which others are added for a trial.
pub struct Scaffold<'p, 'a, 't, 'l> {
    problem: &'p Problem<'a>,
    terms: Vec<&'t Term<'l>>,
    gram: Gram,
}

/// A solved set of terms.
#[derive(Clone)]
pub struct Fit {
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
    #[must_use]
    pub fn of(&self, k: usize) -> &[f64] {
        let end = self.starts.get(k + 1).copied().unwrap_or(self.solution.coefficients.len());
        &self.solution.coefficients[self.starts[k]..end]
    }

    /// The same columns and priors fitted without a block of the data, whose products are `inside`.
    #[must_use]
    pub fn without(&self, inside: &Gram, worth: f64) -> Option<Solution> {
        let mut outside = self.gram.clone();
        outside.add(inside, -1.0);
        solve(&outside, &self.priors, worth)
    }

    /// Coefficients of the base.
    #[must_use]
    pub fn base(&self) -> &[f64] {
        &self.solution.coefficients[..self.starts.first().copied().unwrap_or(self.solution.coefficients.len())]
    }
}

/// The white columns that a fit has the products of: base, terms, further ones, the data last.
pub fn white_columns<'c>(problem: &'c Problem<'_>, terms: &[&'c Term<'_>], further: &'c [Vec<f64>]) -> Vec<&'c [f64]> {
    let terms = terms.iter().flat_map(|t| &t.white);
    problem.base_white.iter().chain(terms).chain(further).chain([&problem.data_white]).map(Vec::as_slice).collect()
}

impl<'p, 'a, 't, 'l> Scaffold<'p, 'a, 't, 'l> {
    /// Products of the base and some terms.
    #[must_use]
    pub fn new(problem: &'p Problem<'a>, terms: Vec<&'t Term<'l>>) -> Self {
        let gram = Gram::of(&white_columns(problem, &terms, &[]), 0..problem.data_white.len());
        Scaffold { problem, terms, gram }
    }

    /// Fits the terms of the scaffold and `added` ones.
    #[must_use]
    pub fn fit(&self, added: &[&Term<'_>]) -> Option<Fit> {
        let (fit, _) = self.fit_with(added, &[])?;
        Some(fit)
    }

    /// The same with further columns, each with its prior, after all others; returns their coefficients.
    fn fit_with(&self, added: &[&Term<'_>], further: &[(Vec<f64>, Prior)]) -> Option<(Fit, Vec<f64>)> {
        let problem = self.problem;
        let old = self.gram.size - 1;
        let new: Vec<&[f64]> = added
            .iter()
            .flat_map(|t| &t.white)
            .map(Vec::as_slice)
            .chain(further.iter().map(|(column, _)| column.as_slice()))
            .collect();
        // Those before, the data, and the new ones up to each itself.
        let mut all = white_columns(problem, &self.terms, &[]);
        all.extend(&new);
        let meeting = products(&new, &all, 0..problem.data_white.len(), false);
        let size = old + new.len() + 1;
        let mut gram = Gram { size, products: vec![0.0; size * size] };
        let mut put = |i: usize, j: usize, value: f64| {
            gram.products[i * size + j] = value;
            gram.products[j * size + i] = value;
        };
        for i in 0..old {
            for j in 0..=i {
                put(i, j, self.gram.at(i, j));
            }
            put(i, size - 1, self.gram.at(i, old));
        }
        put(size - 1, size - 1, self.gram.at(old, old));
        for (a, of) in meeting.chunks_exact(all.len()).enumerate() {
            for (j, product) in of[..old].iter().enumerate() {
                put(old + a, j, *product);
            }
            put(old + a, size - 1, of[old]);
            for (b, product) in of[old + 1..=old + 1 + a].iter().enumerate() {
                put(old + a, old + b, *product);
            }
        }
        let mut starts = Vec::new();
        let mut at = problem.base_white.len();
        let all: Vec<&Term<'_>> = self.terms.iter().map(|t| *t as &Term<'_>).chain(added.iter().copied()).collect();
        for term in &all {
            starts.push(at);
            at += term.len();
        }
        let mut last: Option<(Solution, Vec<Prior>)> = None;
        for _ in 0..ROUNDS {
            let mut priors = problem.base_priors();
            for (term, start) in all.iter().zip(&starts) {
                let known = last.as_ref().map(|(s, _)| &s.coefficients[*start..start + term.len()]);
                priors.extend(term.priors(known));
            }
            priors.extend(further.iter().map(|(_, prior)| *prior));
            last = Some(within_tolerance(&gram, priors, problem)?);
            if all.iter().all(|t| t.tolerances.iter().all(|t| matches!(t, Tolerance::Main(_)))) {
                break;
            }
        }
        let (solution, priors) = last?;
        let extra = solution.coefficients[at..].to_vec();
        Some((Fit { solution, starts, priors, gram }, extra))
    }

    /// Places at which to begin with a law: those to be tried, or where its lead points.
    #[must_use]
    pub fn begin(&self, law: &Law) -> Vec<Vec<f64>> {
        let tried = law.tried();
        let Some(lead) = &law.lead else { return tried };
        let problem = self.problem;
        let least = LOADED * problem.on.scales.load;
        let mask: Vec<bool> = problem
            .whitener
            .average(&problem.on.rows.torque)
            .iter()
            .map(|torque| !lead.loaded_only || torque.abs() > least)
            .collect();
        let some = mask.iter().filter(|m| **m).count() > mask.len() / 10;
        let masked = |column: &[f64]| -> Vec<f64> {
            column.iter().zip(&mask).map(|(v, m)| if *m || !some { *v } else { 0.0 }).collect()
        };
        let mut known: Vec<Vec<f64>> = problem.base_white.iter().map(|c| masked(c)).collect();
        known.extend(self.terms.iter().flat_map(|t| &t.white).map(|c| masked(c)));
        let mut priors = problem.base_priors();
        priors.extend(self.terms.iter().flat_map(|t| t.priors(None)));
        let data = masked(&problem.data_white);
        tried
            .into_iter()
            .filter_map(|places| {
                let values = law.values(&places);
                let columns = (lead.columns)(problem.on, &values);
                let mut all = priors.clone();
                let mut white = known.clone();
                for column in &columns {
                    white.push(masked(&problem.whitener.whiten(&column.values)));
                    if let Tolerance::Main(prior) = column.tolerance {
                        all.push(prior);
                    }
                }
                white.push(data.clone());
                let views: Vec<&[f64]> = white.iter().map(Vec::as_slice).collect();
                let solution = solve(&Gram::of(&views, 0..data.len()), &all, problem.worth)?;
                let c = &solution.coefficients[priors.len()..];
                Some(law.places(&(lead.shape)(&values, c)))
            })
            .collect()
    }

    /// Columns (white) by which the prediction of `term` changes with each of its places, and how far the place may move.
    fn derivatives(&self, term: &Term<'_>, coefficients: &[f64]) -> Vec<(Vec<f64>, Prior)> {
        (0..term.places.len())
            .map(|i| {
                let mut places = term.places.clone();
                let cyclic = term.law.shapes[i].cyclic;
                let step = if cyclic || places[i] + STEP <= 1.0 { STEP } else { -STEP };
                places[i] += step;
                let moved = Term::new(self.problem, term.law, places);
                let mut change = vec![0.0; self.problem.data_white.len()];
                for ((there, here), c) in moved.white.iter().zip(&term.white).zip(coefficients) {
                    let factor = c / step;
                    for (d, (a, b)) in change.iter_mut().zip(there.iter().zip(here)) {
                        *d += factor * (a - b);
                    }
                }
                (change, Prior { mean: 0.0, std: PLACE_SPREAD })
            })
            .collect()
    }

    /// Moves the shape parameters of `term` to where the misfit is least, beside the terms of the scaffold.
    #[must_use]
    pub fn refine<'n>(&self, mut term: Term<'n>) -> Option<(Term<'n>, Fit)> {
        let mut fit = self.fit(&[&term])?;
        if term.places.is_empty() {
            return Some((term, fit));
        }
        for _ in 0..STEPS {
            let coefficients = fit.of(fit.starts.len() - 1).to_vec();
            let (_, moves) = self.fit_with(&[&term], &self.derivatives(&term, &coefficients))?;
            let mut better = None;
            for shorter in [1.0, 0.4, 0.1] {
                let places: Vec<f64> = term
                    .places
                    .iter()
                    .zip(&moves)
                    .zip(&term.law.shapes)
                    .map(|((place, by), shape)| {
                        let moved = place + (shorter * by).clamp(-0.2, 0.2);
                        if shape.cyclic { moved.rem_euclid(1.0) } else { moved.clamp(0.0, 1.0) }
                    })
                    .collect();
                let trial = Term::new(self.problem, term.law, places);
                let trial_fit = self.fit(&[&trial])?;
                if trial_fit.solution.evidence > fit.solution.evidence {
                    better = Some((trial, trial_fit));
                    break;
                }
            }
            let Some((trial, trial_fit)) = better else { break };
            let gain = trial_fit.solution.evidence - fit.solution.evidence;
            (term, fit) = (trial, trial_fit);
            if gain < 0.3 {
                break;
            }
        }
        let coefficients = fit.of(fit.starts.len() - 1).to_vec();
        let (free, _) = self.fit_with(&[&term], &self.derivatives(&term, &coefficients))?;
        term.occam = (free.solution.evidence - fit.solution.evidence).min(0.0);
        Some((term, fit))
    }

    /// The fit of the scaffold's terms with all their shape parameters free to first order: for uncertainties. Returns the fit, whose
    /// last coefficients are moves of the shape parameters, term after term.
    #[must_use]
    pub fn linearised(&self) -> Option<(Fit, Vec<Vec<f64>>)> {
        let fit = self.fit(&[])?;
        let mut further = Vec::new();
        for (k, term) in self.terms.iter().enumerate() {
            further.extend(self.derivatives(term, fit.of(k)));
        }
        let (fit, _) = self.fit_with(&[], &further)?;
        Some((fit, further.into_iter().map(|(column, _)| column).collect()))
    }
}
