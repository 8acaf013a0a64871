//! Sparse Cholesky factor of a [`Pattern`].

use flexspline_algebra::{NotPositiveDefinite, SparseCholesky};

use super::border::Factor;
use super::pattern::Pattern;

/// `A = L Lᵀ` of a symmetric positive definite matrix on a [`Pattern`].
pub struct Cholesky(SparseCholesky);

impl Cholesky {
    /// Orders and analyses the pattern; the factor itself comes from [`Cholesky::factorise`].
    pub fn new(pattern: &Pattern) -> Cholesky {
        Cholesky(SparseCholesky::new(&pattern.column_starts, &pattern.rows))
    }

    /// Computes the factor of the matrix with these values.
    pub fn factorise(&mut self, pattern: &Pattern, values: &[f64]) -> Result<(), NotPositiveDefinite> {
        self.0.factorise(&pattern.column_starts, &pattern.rows, values)
    }
}

impl Factor for Cholesky {
    fn solve(&mut self, right_hand_sides: &mut [f64], columns: usize) {
        self.0.solve(right_hand_sides, columns);
    }
}
