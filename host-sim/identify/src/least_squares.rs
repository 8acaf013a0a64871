//! Least squares of few columns by their normal equations.

use flexspline_algebra::{Mat, cholesky};

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
        let mut products = vec![0.0; width * width];
        let (mut right, mut square, mut row) = (vec![0.0; width], 0.0, vec![1.0; width]);
        for k in 0..rows {
            let (value, weight) = put(k, &mut row);
            for a in 0..width {
                right[a] += weight * row[a] * value;
                for b in 0..=a {
                    products[a * width + b] += weight * row[a] * row[b];
                }
            }
            square += weight * value * value;
        }
        let matrix = Mat::from_fn(width, width, |a, b| products[a.max(b) * width + a.min(b)]);
        Some(Normal { inverse: cholesky(matrix.as_ref()).ok()?.inverse(), right, square })
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
