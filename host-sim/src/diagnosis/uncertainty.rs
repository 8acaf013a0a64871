//! Parameters of the causes with their uncertainty: Laplace's approximation, shape parameters included, on the information the
//! rows are worth; spread over sessions left out where that is larger.

use std::collections::BTreeMap;

use super::linear::Gram;
use super::model::{Fit, Problem, Scaffold, Term, white_columns};
use super::report::Parameter;
use super::select::{Selected, blocks};

/// Step of numerical derivatives, standard deviations.
const STEP: f64 = 0.1;

/// A parameter is no longer determined where its standard deviation grows by this factor.
const UNDETERMINED: f64 = 100.0;

/// Stretches of the data whose misfits are taken as independent, in each session.
const STRETCHES: usize = 12;

/// Covariance by the misfit of stretches of the data (a sandwich): holds where the wander is not what it was taken for.
fn stretched(problem: &Problem<'_>, fit: &Fit, white: &[&[f64]]) -> Vec<f64> {
    let n = fit.priors.len();
    let c = &fit.solution.coefficients;
    let mut meat = vec![0.0; n * n];
    for session in &problem.whitener.sessions {
        let len = session.len();
        for part in 0..STRETCHES {
            let block = session.start + len * part / STRETCHES..session.start + len * (part + 1) / STRETCHES;
            let gram = Gram::of(white, block);
            let score: Vec<f64> = (0..n)
                .map(|i| problem.worth * (gram.at(i, n) - (0..n).map(|j| gram.at(i, j) * c[j]).sum::<f64>()))
                .collect();
            for i in 0..n {
                for j in 0..n {
                    meat[i * n + j] += score[i] * score[j];
                }
            }
        }
    }
    let bread = fit.solution.covariance();
    let times = |a: &[f64], b: &[f64]| -> Vec<f64> {
        let mut product = vec![0.0; n * n];
        for i in 0..n {
            for k in 0..n {
                for j in 0..n {
                    product[i * n + j] += a[i * n + k] * b[k * n + j];
                }
            }
        }
        product
    };
    times(&times(&bread, &meat), &bread)
}

/// Parameters of each term.
#[must_use]
pub fn parameters(problem: &Problem<'_>, selected: &Selected<'_>) -> Vec<BTreeMap<&'static str, Parameter>> {
    let terms: Vec<&Term<'_>> = selected.terms.iter().collect();
    let empty = || selected.terms.iter().map(|_| BTreeMap::new()).collect();
    let scaffold = Scaffold::new(problem, terms.clone());
    let Some((fit, moves)) = scaffold.linearised() else { return empty() };
    let n = fit.priors.len();
    // Jackknife over blocks: shifts of all coefficients when a block is left out.
    let white = white_columns(problem, &terms, &moves);
    let shifts: Vec<(Vec<f64>, Vec<f64>)> = blocks(problem)
        .into_iter()
        .filter_map(|block| {
            let solved = fit.without(&Gram::of(&white, block), problem.worth)?;
            let moved = solved.coefficients.iter().zip(&fit.solution.coefficients).map(|(a, b)| a - b).collect();
            Some((moved, solved.covariance()))
        })
        .collect();
    let covariance = fit.solution.covariance();
    let by_stretches = stretched(problem, &fit, &white);
    let mut place = n - moves.len();
    let mut all = Vec::new();
    for (k, term) in selected.terms.iter().enumerate() {
        let coefficients = selected.fit.of(k);
        let value = |c: &[f64], places: &[f64]| (term.law.parameters)(problem.on, &term.law.values(places), c);
        let at = value(coefficients, &term.places);
        let (start, dimension) = (fit.starts[k], coefficients.len() + term.places.len());
        let index: Vec<usize> =
            (0..coefficients.len()).map(|j| start + j).chain((0..term.places.len()).map(|j| place + j)).collect();
        place += term.places.len();
        let mut slopes = vec![vec![0.0; dimension]; at.len()];
        for j in 0..dimension {
            let std = covariance[index[j] * n + index[j]].max(0.0).sqrt();
            let step = (STEP * std).max(1e-9);
            let (mut c, mut p) = (coefficients.to_vec(), term.places.clone());
            if j < c.len() {
                c[j] += step;
            } else {
                let i = j - c.len();
                p[i] += if term.law.shapes[i].cyclic || p[i] + step <= 1.0 { step } else { -step };
            }
            let sign = if j >= c.len() && p[j - c.len()] < term.places[j - c.len()] { -1.0 } else { 1.0 };
            for (slope, (new, old)) in slopes.iter_mut().zip(value(&c, &p).iter().zip(&at)) {
                let mut change = new.1 - old.1;
                if old.0 == "phase_rad" || old.0 == "angle_rad" {
                    change = (change + std::f64::consts::FRAC_PI_2).rem_euclid(std::f64::consts::PI)
                        - std::f64::consts::FRAC_PI_2;
                }
                slope[j] = sign * change / step;
            }
        }
        let mut named = BTreeMap::new();
        for ((name, value), slope) in at.into_iter().zip(&slopes) {
            let spread = |covariance: &[f64]| -> f64 {
                (0..dimension)
                    .flat_map(|i| (0..dimension).map(move |j| (i, j)))
                    .map(|(i, j)| slope[i] * slope[j] * covariance[index[i] * n + index[j]])
                    .sum()
            };
            let laplace = spread(&covariance).max(spread(&by_stretches));
            // A session without which the rest says nothing of the parameter, such as the one after a jump, is no repetition.
            let moved: Vec<f64> = shifts
                .iter()
                .filter(|(_, without)| spread(without) < UNDETERMINED * UNDETERMINED * laplace)
                .map(|(s, _)| (0..dimension).map(|j| slope[j] * s[index[j]]).sum::<f64>())
                .collect();
            let count = moved.len().max(1) as f64;
            let mean = moved.iter().sum::<f64>() / count;
            let jackknife = (count - 1.0) / count * moved.iter().map(|m| (m - mean).powi(2)).sum::<f64>();
            let angle = name.ends_with("phase_rad") || name == "angle_rad";
            let counted = ["harmonic", "tooth", "wheel", "events"].contains(&name);
            let scale = if angle {
                1.0
            } else if counted {
                0.0
            } else {
                value.abs()
            };
            named.insert(
                name,
                Parameter { value, std: laplace.max(0.0).max(jackknife).sqrt().hypot(term.law.doubt * scale) },
            );
        }
        all.push(named);
    }
    all
}
