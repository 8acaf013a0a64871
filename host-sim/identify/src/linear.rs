//! Linear least squares with Gaussian priors: solution, penalised misfit, evidence, covariance.
//!
//! With whitened data y, columns X, prior mean m and precision P: `A = XᵀX + P`, `b = Xᵀy + P m`,
//! `J = |y|² + mᵀP m − bᵀA⁻¹b`, and `ln evidence = −J/2 − ln|A|/2 + ln|P|/2` but for what all models share.

use std::ops::Range;
use std::sync::LazyLock;

use flexspline_algebra::{CholeskyFactor, Mat, cholesky};
use pulp::{Arch, Simd, WithSimd};

use crate::least_squares::dot;

/// Symmetric products of columns, the data last.
#[derive(Clone, Debug, Default)]
pub(crate) struct Gram {
    /// Columns and the data.
    pub size: usize,
    /// Row by row.
    pub products: Vec<f64>,
}

impl Gram {
    /// Of no rows.
    pub fn none(size: usize) -> Gram {
        Gram { size, products: vec![0.0; size * size] }
    }

    /// Adds a row, the value last, that counts `weight` times: to the lower triangle.
    pub fn add_row(&mut self, row: &[f64], weight: f64) {
        for (i, (products, a)) in self.products.chunks_exact_mut(self.size).zip(row).enumerate() {
            products.iter_mut().zip(&row[..=i]).for_each(|(sum, b)| *sum += weight * a * b);
        }
    }

    /// Of some of the columns; the lower triangle is read.
    pub fn among(&self, places: &[usize]) -> Gram {
        let mut products = Vec::with_capacity(places.len() * places.len());
        for i in places {
            products.extend(places.iter().map(|j| self.at(*i.max(j), *i.min(j))));
        }
        Gram { size: places.len(), products }
    }

    /// Without the first column, whose coefficient is free in these rows; the lower triangle is read.
    pub fn first_free(&self) -> Gram {
        let mut own = self.clone();
        if self.at(0, 0) > 0.0 {
            let first: Vec<f64> = (0..self.size).map(|k| self.at(k, 0)).collect();
            own.add_row(&first, -1.0 / self.at(0, 0));
        }
        own.among(&(1..self.size).collect::<Vec<usize>>())
    }

    /// Sum of squares that the columns leave with these coefficients.
    pub fn left_by(&self, coefficients: &[f64]) -> f64 {
        let all: Vec<f64> = coefficients.iter().copied().chain([-1.0]).collect();
        let rows = self.products.chunks_exact(self.size);
        rows.zip(&all).map(|(products, c)| c * dot(products, &all)).sum::<f64>().max(0.0)
    }

    /// Products of `columns`, whose last is the data, over a range of rows.
    pub fn of(columns: &[&[f64]], range: Range<usize>) -> Gram {
        Gram { size: columns.len(), products: products(columns, columns, range, true) }
    }

    /// Product of two columns.
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.products[i * self.size + j]
    }

    /// Adds another one, times a factor.
    pub fn add(&mut self, other: &Gram, factor: f64) {
        for (a, b) in self.products.iter_mut().zip(&other.products) {
            *a += factor * b;
        }
    }
}

/// Products of each column of `a` with each of `b` over a range of rows, row by row of the result; `own` where both are
/// the same columns.
///
/// Rows are taken in blocks that stay in the cache while all pairs meet, with the widest registers that the machine
/// has.
pub(crate) fn products(a: &[&[f64]], b: &[&[f64]], range: Range<usize>, own: bool) -> Vec<f64> {
    static ARCH: LazyLock<Arch> = LazyLock::new(Arch::new);
    let mut sums = vec![0.0; a.len() * b.len()];
    let mut from = range.start;
    while from < range.end {
        let rows = from..(from + BLOCK_ROWS).min(range.end);
        from = rows.end;
        ARCH.dispatch(Block { a, b, rows, lower: own, sums: &mut sums });
    }
    for (i, j) in (0..a.len()).flat_map(|i| (0..i).map(move |j| (i, j))).filter(|_| own) {
        sums[j * a.len() + i] = sums[i * a.len() + j];
    }
    sums
}

/// Rows of a block: 2 KiB of each column. *Guess*: columns of some dozen fit the first cache of 32 KiB; it changes the
/// time alone.
const BLOCK_ROWS: usize = 256;
/// Columns of `b` that a few of `a` meet at a time. *Guess*: their sums stay in registers; it changes the time alone.
const ABREAST: usize = 4;

struct Block<'c> {
    a: &'c [&'c [f64]],
    b: &'c [&'c [f64]],
    rows: Range<usize>,
    lower: bool,
    sums: &'c mut [f64],
}

impl Block<'_> {
    /// Products of `FEW` columns of `a`, from one on, with all of `b`: what is loaded of `b` serves each of them.
    #[inline(always)]
    fn meet<const FEW: usize, S: Simd>(&mut self, simd: S, from: usize) {
        let width = self.b.len();
        let eights = S::as_simd_f64s(&self.a[from][self.rows.clone()]).0.len();
        let mine: [_; FEW] = std::array::from_fn(|i| S::as_simd_f64s(&self.a[from + i][self.rows.clone()]));
        let x = mine.map(|(x, _)| &x[..eights]);
        let upto = if self.lower { (from + FEW).min(width) } else { width };
        for (at, others) in self.b[..upto].chunks(ABREAST).enumerate() {
            // Fewer than four: the first one stands in, and is not written.
            let other = |j: usize| &others.get(j).unwrap_or(&others[0])[self.rows.clone()];
            let split: [_; ABREAST] = std::array::from_fn(|j| S::as_simd_f64s(other(j)));
            let y = split.map(|(y, _)| &y[..eights]);
            let mut sums = [[simd.splat_f64s(0.0); ABREAST]; FEW];
            for k in 0..eights {
                for i in 0..FEW {
                    for j in 0..ABREAST {
                        sums[i][j] = simd.mul_add_f64s(x[i][k], y[j][k], sums[i][j]);
                    }
                }
            }
            for i in 0..FEW {
                let wanted = if self.lower { (from + i + 1).min(width) } else { width };
                for j in (0..others.len()).take_while(|j| at * ABREAST + j < wanted) {
                    let rest: f64 = mine[i].1.iter().zip(split[j].1).map(|(x, y)| x * y).sum();
                    self.sums[(from + i) * width + at * ABREAST + j] += simd.reduce_sum_f64s(sums[i][j]) + rest;
                }
            }
        }
    }
}

impl WithSimd for Block<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let fours = self.a.len() - self.a.len() % 4;
        for from in (0..fours).step_by(4) {
            self.meet::<4, S>(simd, from);
        }
        for from in fours..self.a.len() {
            self.meet::<1, S>(simd, from);
        }
    }
}

/// Prior of a coefficient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub std: f64,
}

/// A solved problem.
#[derive(Clone, Debug)]
pub(crate) struct Solution {
    /// Coefficients.
    pub coefficients: Vec<f64>,
    /// Penalised misfit J.
    pub misfit: f64,
    /// Logarithm of the evidence.
    pub evidence: f64,
    /// Factor of `A` in units of the priors.
    factor: CholeskyFactor,
    /// Standard deviations of the priors.
    scale: Vec<f64>,
}

impl Solution {
    /// Covariance of the coefficients, row by row.
    pub(crate) fn covariance(&self) -> Vec<f64> {
        let (inverse, scale) = (self.factor.inverse(), &self.scale);
        let row = |i: usize| (0..scale.len()).map(move |j| (i, j));
        (0..scale.len()).flat_map(row).map(|(i, j)| inverse[(i, j)] * scale[i] * scale[j]).collect()
    }
}

/// Solves with priors. `worth` scales all information in the data: below 1 where the noise is not as white as it was
/// taken for.
///
/// `None` if the products are not finite.
pub(crate) fn solve(gram: &Gram, priors: &[Prior], worth: f64) -> Option<Solution> {
    let n = priors.len();
    debug_assert_eq!(gram.size, n + 1);
    // In units of the prior: diagonal at least 1, well scaled whatever the columns are.
    let s: Vec<f64> = priors.iter().map(|p| p.std.max(1e-12)).collect();
    let shift: Vec<f64> = priors.iter().map(|p| p.mean).collect();
    let across: Vec<f64> = (0..n).map(|i| (0..n).map(|j| gram.at(i, j) * shift[j]).sum()).collect();
    let shifted: f64 = (0..n).map(|i| shift[i] * (across[i] - 2.0 * gram.at(i, n))).sum();
    let one = |i: usize, j: usize| f64::from(u8::from(i == j));
    let a = Mat::from_fn(n, n, |i, j| worth * s[i] * s[j] * gram.at(i, j) + one(i, j));
    let b = Mat::from_fn(n, 1, |i, _| worth * s[i] * (gram.at(i, n) - across[i]));
    let factor = cholesky(a.as_ref()).ok()?;
    let z = factor.solve(b.as_ref());
    let explained: f64 = (0..n).map(|i| b[(i, 0)] * z[(i, 0)]).sum();
    let coefficients = (0..n).map(|i| shift[i] + s[i] * z[(i, 0)]).collect();
    let misfit = worth * (gram.at(n, n) + shifted) - explained;
    let evidence = -0.5 * misfit - 0.5 * factor.log_determinant();
    evidence.is_finite().then_some(Solution { coefficients, misfit, evidence, factor, scale: s })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_coefficient_is_the_weighted_mean_of_prior_and_data() {
        let (x, y) = ([1.0, 1.0, 2.0], [2.0, 1.0, 5.0]);
        let gram = Gram::of(&[&x, &y], 0..3);
        let prior = Prior { mean: 0.5, std: 0.7 };
        let solution = solve(&gram, &[prior], 1.0).unwrap();
        let precision = 6.0 + 1.0 / 0.49;
        let value = (13.0 + 0.5 / 0.49) / precision;
        assert!((solution.coefficients[0] - value).abs() < 1e-12);
        assert!((solution.covariance()[0] - 1.0 / precision).abs() < 1e-12);
        let misfit = |c: f64| -> f64 {
            x.iter().zip(&y).map(|(x, y)| (y - c * x).powi(2)).sum::<f64>() + ((c - 0.5) / 0.7).powi(2)
        };
        assert!((solution.misfit - misfit(value)).abs() < 1e-12);
        // The evidence is the density of y under y ~ N(x m, 1 + x xᵀ s²): by Sylvester |1 + 6 s²|.
        let evidence = -0.5 * misfit(value) - 0.5 * (1.0f64 + 6.0 * 0.49).ln();
        assert!((solution.evidence - evidence).abs() < 1e-12);
    }
}
