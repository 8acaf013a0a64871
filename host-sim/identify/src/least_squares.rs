//! Least squares of few columns by their normal equations, projections off free columns, the jackknife.

use crate::linear::Gram;
use flexspline_algebra::{Mat, cholesky};
use flexspline_base::robust::rms;
use flexspline_base::statistics::mean;

/// Normal equations of least squares, with their inverse.
pub(crate) struct Normal {
    /// Inverse of the products of the columns.
    pub inverse: Mat,
    /// Products of the columns with the values, and of the values with themselves.
    pub right: Vec<f64>,
    pub square: f64,
}

impl Normal {
    /// Of `rows` rows of as many columns as `width` says; `put` puts the columns of a row in their places, and gives
    /// its value and its weight.
    pub fn of(width: usize, rows: usize, mut put: impl FnMut(usize, &mut [f64]) -> (f64, f64)) -> Option<Normal> {
        let (mut gram, mut row) = (Gram::none(width + 1), vec![1.0; width + 1]);
        for k in 0..rows {
            let (value, weight) = put(k, &mut row[..width]);
            row[width] = value;
            gram.add_row(&row, weight);
        }
        let matrix = Mat::from_fn(width, width, |a, b| gram.at(a.max(b), a.min(b)));
        let right = (0..width).map(|a| gram.at(width, a)).collect();
        Some(Normal { inverse: cholesky(matrix.as_ref()).ok()?.inverse(), right, square: gram.at(width, width) })
    }

    /// Unless a variance has grown a million times by the other columns, which is no answer.
    pub fn sound(self, rows: usize) -> Option<Normal> {
        let sound = |a: usize| self.inverse[(a, a)].is_finite() && self.inverse[(a, a)] * (rows as f64) < 1e6;
        (0..self.right.len()).all(sound).then_some(self)
    }

    /// Coefficients of the columns.
    pub fn values(&self) -> Vec<f64> {
        let of = |a: usize| self.right.iter().enumerate().map(|(b, right)| self.inverse[(a, b)] * right).sum();
        (0..self.right.len()).map(of).collect()
    }

    /// Sum of squares that the columns leave.
    pub fn misfit(&self) -> f64 {
        (self.square - self.values().iter().zip(&self.right).map(|(value, right)| value * right).sum::<f64>()).max(0.0)
    }
}

/// An orthonormal basis of columns: what a fit leaves free.
#[derive(Clone, Default)]
pub(crate) struct FreeSpan(Vec<Vec<f64>>);

impl FreeSpan {
    /// An orthonormal basis of what columns have beyond this one.
    pub(crate) fn beyond(&self, columns: impl IntoIterator<Item = Vec<f64>>) -> FreeSpan {
        let mut span = FreeSpan::default();
        for column in columns {
            let free = span.freed(self.freed(column.clone()));
            let norm = free.iter().map(|v| v * v).sum::<f64>().sqrt();
            // Else it is round-off of the column.
            if norm > 1e-6 * rms(&column) * (column.len() as f64).sqrt() {
                span.0.push(free.into_iter().map(|v| v / norm).collect());
            }
        }
        span
    }

    /// The part of a column that is orthogonal to the basis.
    pub(crate) fn freed(&self, mut column: Vec<f64>) -> Vec<f64> {
        for free in &self.0 {
            let share = dot(&column, free);
            add_scaled(&mut column, free, -share);
        }
        column
    }
}

/// Sum of columns of this length, each times its coefficient.
pub(crate) fn combined<'c>(len: usize, columns: impl IntoIterator<Item = &'c [f64]>, coefficients: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; len];
    columns.into_iter().zip(coefficients).for_each(|(column, c)| add_scaled(&mut sum, column, *c));
    sum
}

/// Adds a column times a coefficient.
pub(crate) fn add_scaled(sum: &mut [f64], column: &[f64], coefficient: f64) {
    sum.iter_mut().zip(column).for_each(|(sum, value)| *sum += coefficient * value);
}

/// Standard deviation of a value, from the values without one block of the rows at a time (jackknife).
pub(crate) fn jackknife(without: &[f64]) -> f64 {
    let (blocks, middle) = (without.len() as f64, mean(without));
    ((blocks - 1.0) / blocks * without.iter().map(|value| (value - middle).powi(2)).sum::<f64>()).sqrt()
}

/// Sum of products, in eight sums side by side.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a_eights, a_rest) = a.as_chunks::<8>();
    let (b_eights, b_rest) = b.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (x, y) in a_eights.iter().zip(b_eights) {
        for j in 0..8 {
            sums[j] += x[j] * y[j];
        }
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum::<f64>()
}
