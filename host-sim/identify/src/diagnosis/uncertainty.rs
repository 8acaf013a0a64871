//! Parameters of the causes with their uncertainty: Laplace's approximation, shape parameters included, on the
//! information the rows are worth; spread over sessions left out where that is larger.

use std::collections::BTreeMap;

use super::model::{Fit, Problem, Scaffold, Term};
use super::report::Parameter;
use super::rows::combined;
use super::select::Selected;
use super::thresholds::verdict::{INTERVAL, KNOWN_BESIDE};
use crate::causes::{Kind, ParameterName};
use crate::least_squares::dot;
use flexspline_base::robust;

/// Step of numerical derivatives, standard deviations. *Guess*: models are straight within a tenth of it.
const STEP: f64 = 0.1;

/// A parameter is no longer determined where its standard deviation grows by this factor. *Guess*: the rest of the data
/// then holds a ten-thousandth of the information on it.
const UNDETERMINED: f64 = 100.0;

/// A block has information on a parameter if leaving it out adds this share to the variance; a smaller one is
/// round-off. *Guess*: far above the 1e-16 of a double, far below any block that counts.
const LEAST_TOLD: f64 = 1e-6;

/// Stretches of the data whose misfits are taken as independent, in each session. *Guess*: with several sessions enough
/// for a covariance, each longer than the drift remembers.
const STRETCHES: usize = 12;

/// Covariance by the misfit of stretches of the data (a sandwich): holds where the wander is not what it was taken for.
fn stretched(problem: &Problem<'_>, fit: &Fit, white: &[&[f64]]) -> Vec<f64> {
    let n = fit.priors.len();
    let data = white[n];
    let explained = combined(data.len(), white[..n].iter().copied(), &fit.solution.coefficients);
    let left: Vec<f64> = data.iter().zip(explained).map(|(data, explained)| data - explained).collect();
    let bread = fit.solution.covariance();
    let mut sandwich = vec![0.0; n * n];
    for session in &problem.whitener.sessions {
        let len = session.len();
        for part in 0..STRETCHES {
            let block = session.start + len * part / STRETCHES..session.start + len * (part + 1) / STRETCHES;
            let score: Vec<f64> = white[..n]
                .iter()
                .map(|c| problem.fineness.worth * dot(&c[block.clone()], &left[block.clone()]))
                .collect();
            let moved: Vec<f64> = bread.chunks_exact(n).map(|row| dot(row, &score)).collect();
            sandwich.iter_mut().zip(outer(&moved)).for_each(|(sum, product)| *sum += product);
        }
    }
    sandwich
}

/// How well a term is known.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// Its parameters.
    pub parameters: BTreeMap<&'static str, Parameter>,
    /// What it adds to the prediction, in units of the uncertainty of that (both as lengths in the whitened data).
    pub times_its_doubt: f64,
    /// The best known of its sizes, in standard deviations, which count noise by what is left beyond it.
    pub size_told: f64,
    /// How well it is told from zero: that, or all that it adds where this is known well and zero is outside the
    /// interval of the size. What its own columns make of one another, as where a wave with the load and one without
    /// are the same at one load, is no doubt that it is there.
    pub told_from_zero: f64,
}

/// A size that is known exactly counts as this many times its standard deviation. *Guess*: beyond all limits for
/// standard deviations.
const EXACTLY: f64 = 1e3;

/// How far the coefficients and moves of one term may be off.
struct TermCovariance {
    /// Covariance by Laplace's approximation, and by stretches of the data; row by row.
    covariances: [Vec<f64>; 2],
    /// What of Laplace's covariance noise makes; the rest is the spread between units and what laws may be wrong by.
    by_noise: Vec<f64>,
    /// Shift of each when a block of the data is left out, and the covariance then.
    shifts: Vec<(Vec<f64>, Vec<f64>)>,
}

impl TermCovariance {
    /// Variance of a quadratic form, row by row: the largest of Laplace's, that by stretches, and that of a jackknife.
    /// A jackknife holds for blocks that tell alike much; of others it counts only up to what Laplace's variance lacks.
    fn of(&self, form: &[f64]) -> f64 {
        let (within, jackknife, lacking) = self.parts(form);
        within.max(jackknife.min(lacking))
    }

    /// The same where the noise is `beyond` times what it was taken for. What blocks of the data tell of themselves
    /// holds as it is: they have what is beyond noise in them.
    fn beyond_noise(&self, form: &[f64], beyond: f64) -> f64 {
        let laplace = robust::dot(form, &self.covariances[0])
            + (beyond * beyond - 1.0) * robust::dot(form, &self.by_noise).max(0.0);
        self.of(form).max(laplace)
    }

    /// Variances: within the blocks, by the jackknife, and what Laplace's lacks.
    fn parts(&self, form: &[f64]) -> (f64, f64, f64) {
        let trace = |covariance: &[f64]| robust::dot(form, covariance);
        let [laplace, stretched] = &self.covariances;
        let within = trace(laplace).max(trace(stretched)).max(0.0);
        // A session without which the rest says nothing of it, such as the one after a jump, is no repetition.
        let repeated =
            || self.shifts.iter().filter(|(_, without)| trace(without) < UNDETERMINED * UNDETERMINED * within);
        let shifts: Vec<&Vec<f64>> = repeated().map(|(shift, _)| shift).collect();
        let count = shifts.len().max(1) as f64;
        let mean: Vec<f64> =
            (0..form.len().isqrt()).map(|i| shifts.iter().map(|s| s[i]).sum::<f64>() / count).collect();
        let from_mean = |shift: &[f64]| -> Vec<f64> { shift.iter().zip(&mean).map(|(s, m)| s - m).collect() };
        let shifted: f64 = shifts.iter().map(|shift| trace(&outer(&from_mean(shift)))).sum();
        let jackknife = (count - 1.0) / count * shifted;
        // Where one block says more than the others, the rest is less sure without it, and may shift by as much as
        // that. What the blocks shift against what they may is what Laplace's variance lacks. Of blocks that were
        // driven alike it comes to the jackknife.
        let against: Vec<[f64; 2]> = repeated()
            .map(|(shift, without)| [trace(&outer(shift)), trace(without) - trace(laplace)])
            .filter(|[_, may]| *may > LEAST_TOLD * trace(laplace))
            .collect();
        let lacking = if against.is_empty() { jackknife } else { trace(laplace) * beyond_what_may(&against) };
        (within, jackknife, lacking)
    }
}

/// By what factor squares of shifts are larger than they may be, from both of each block. The mean of the blocks' own
/// factors: each is one draw of chance, and in the sums a block that says most is the only one, which by chance may
/// shift by next to nothing. That of the sums where it is larger.
fn beyond_what_may(against: &[[f64; 2]]) -> f64 {
    let all = |of: usize| against.iter().map(|block| block[of]).sum::<f64>();
    let each = against.iter().map(|[shifted, may]| shifted / may).sum::<f64>() / against.len() as f64;
    each.max(all(0) / all(1))
}

/// Products of each with each, row by row.
fn outer(values: &[f64]) -> Vec<f64> {
    values.iter().flat_map(|a| values.iter().map(move |b| a * b)).collect()
}

/// What noise makes of Laplace's covariance C: C − C P C, with the information P that the priors hold.
fn by_noise(fit: &Fit, covariance: &[f64]) -> Vec<f64> {
    let n = fit.priors.len();
    let mut of_noise = covariance.to_vec();
    for (k, prior) in fit.priors.iter().enumerate() {
        let information = prior.std.powi(-2);
        let products = outer(&covariance[k * n..(k + 1) * n]);
        of_noise.iter_mut().zip(products).for_each(|(of_noise, product)| *of_noise -= information * product);
    }
    of_noise
}

/// How well each term is known, where `beyond` times the noise is left.
pub fn known(problem: &Problem<'_>, selected: &Selected<'_>, beyond: f64) -> Vec<Known> {
    let terms: Vec<&Term<'_>> = selected.terms.iter().collect();
    let scaffold = Scaffold::new(problem, &selected.terms);
    let Some((fit, moves)) = scaffold.linearised() else { return vec![Known::default(); terms.len()] };
    let n = fit.priors.len();
    let left_out: Vec<(Vec<f64>, Vec<f64>)> = (0..problem.blocks().len())
        .filter_map(|block| {
            let (solved, _) = scaffold.without_block(&fit, Some(&moves), block)?;
            let moved = solved.coefficients.iter().zip(&fit.solution.coefficients).map(|(a, b)| a - b).collect();
            Some((moved, solved.covariance()))
        })
        .collect();
    let covariance = fit.solution.covariance();
    let of_noise = by_noise(&fit, &covariance);
    let by_stretches = stretched(problem, &fit, &problem.white_columns(&terms, Some(&moves)));
    let mut place = n - moves.len();
    let mut all = Vec::new();
    for (k, term) in terms.into_iter().enumerate() {
        let coefficients = selected.fit.of(k);
        let index: Vec<usize> =
            (fit.starts[k]..fit.starts[k] + coefficients.len()).chain(place..place + term.places.len()).collect();
        place += term.places.len();
        let block = |square: &[f64]| -> Vec<f64> {
            index.iter().flat_map(|i| index.iter().map(move |j| square[i * n + j])).collect()
        };
        let spread = TermCovariance {
            covariances: [block(&covariance), block(&by_stretches)],
            by_noise: block(&of_noise),
            shifts: left_out
                .iter()
                .map(|(shift, without)| (index.iter().map(|i| shift[*i]).collect(), block(without)))
                .collect(),
        };
        let products: Vec<f64> = index.iter().flat_map(|i| index.iter().map(|j| fit.gram.at(*i, *j))).collect();
        let mut adds = coefficients.to_vec();
        adds.resize(index.len(), 0.0);
        let adds: f64 = robust::dot(&outer(&adds), &products);
        let (parameters, size_told) = parameters(problem, term, coefficients, &spread, beyond);
        let times = |variance: f64| (adds / variance.max(1e-30)).sqrt();
        let all_told = times(spread.beyond_noise(&products, beyond));
        let (within, jackknife, _) = spread.parts(&products);
        all.push(Known {
            parameters,
            // With all of the jackknife: this is for what stands beside something that is not understood.
            times_its_doubt: times(within.max(jackknife)),
            size_told,
            told_from_zero: if size_told > INTERVAL && all_told > KNOWN_BESIDE {
                all_told.max(size_told)
            } else {
                size_told
            },
        });
    }
    all
}

/// Parameters of a term with their standard deviations, and how well its best known size is told from zero where
/// `beyond` times the noise is left.
fn parameters(
    problem: &Problem<'_>,
    term: &Term<'_>,
    coefficients: &[f64],
    spread: &TermCovariance,
    beyond: f64,
) -> (BTreeMap<&'static str, Parameter>, f64) {
    let value = |c: &[f64], places: &[f64]| term.law.parameters(&problem.on, &term.law.values(places), term.by_role(c));
    let at = value(coefficients, &term.places);
    let dimension = coefficients.len() + term.places.len();
    let mut slopes = vec![vec![0.0; dimension]; at.len()];
    for j in 0..dimension {
        let std = spread.covariances[0][j * dimension + j].max(0.0).sqrt();
        let step = (STEP * std).max(1e-9);
        let (mut c, mut p) = (coefficients.to_vec(), term.places.clone());
        let by = match j.checked_sub(c.len()) {
            Some(i) if !term.law.shapes[i].cyclic && p[i] + step > 1.0 => -step,
            _ => step,
        };
        c.iter_mut().chain(&mut p).skip(j).take(1).for_each(|value| *value += by);
        for (slope, (new, old)) in slopes.iter_mut().zip(value(&c, &p).iter().zip(&at)) {
            let mut change = new.1 - old.1;
            if old.0.kind() == Kind::Angle {
                change = (change + std::f64::consts::FRAC_PI_2).rem_euclid(std::f64::consts::PI)
                    - std::f64::consts::FRAC_PI_2;
            }
            slope[j] = change / by;
        }
    }
    let (mut parameters, mut told): (_, Option<f64>) = (BTreeMap::new(), None);
    for ((name, value), slope) in at.into_iter().zip(&slopes) {
        let scale = match name.kind() {
            Kind::Angle => 1.0,
            Kind::Count => 0.0,
            Kind::Size | Kind::Other => value.abs(),
        };
        let with_doubt = |variance: f64| variance.sqrt().hypot(term.law.wrong.doubt * scale);
        let form = outer(slope);
        parameters.insert(name.as_str(), Parameter { value, std: with_doubt(spread.of(&form)) });
        if name.kind() == Kind::Size {
            let without = if name == ParameterName::StiffnessRatio { 1.0 } else { 0.0 };
            let times = (value - without).abs() / with_doubt(spread.beyond_noise(&form, beyond)).max(1e-30);
            told = Some(told.map_or(times, |told| told.max(times)));
        }
    }
    (parameters, told.map_or(EXACTLY, |told| told.min(EXACTLY)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_beyond_noise_widens_what_noise_makes_and_not_what_units_differ_by() {
        let spread = |noise: f64, units: f64| TermCovariance {
            covariances: [vec![noise * noise + units * units], vec![0.0]],
            by_noise: vec![noise * noise],
            shifts: Vec::new(),
        };
        let widened = |noise: f64, units: f64| spread(noise, units).beyond_noise(&[1.0], 3.0);
        assert!((widened(0.0, 2.0) - 4.0).abs() < 1e-12);
        assert!((widened(2.0, 0.0) - 36.0).abs() < 1e-12);
        assert!((widened(1.0, 2.0) - 13.0).abs() < 1e-12);
        // What stretches of the data tell of themselves has it in already.
        let stretched =
            TermCovariance { covariances: [vec![1.0], vec![25.0]], by_noise: vec![1.0], shifts: Vec::new() };
        assert!((stretched.beyond_noise(&[1.0], 3.0) - 25.0).abs() < 1e-12);
    }

    #[test]
    fn a_block_that_tells_most_and_shifts_by_nothing_hides_not_what_the_others_shift() {
        // As much as they may.
        assert_eq!(beyond_what_may(&[[1.0, 1.0], [1.0, 1.0], [100.0, 100.0]]), 1.0);
        assert!(beyond_what_may(&[[4.0, 1.0], [4.0, 1.0], [0.0, 100.0]]) > 2.0);
        assert!(beyond_what_may(&[[1.0, 1.0], [1.0, 1.0], [400.0, 100.0]]) > 3.5);
    }
}
