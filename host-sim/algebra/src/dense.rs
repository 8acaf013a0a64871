//! Dense matrices.

use faer::Side;
use faer::linalg::solvers::{Llt, Solve};

use crate::NotPositiveDefinite;

/// A matrix, columns one after the other.
pub type Mat = faer::Mat<f64>;
/// A matrix or a part of one.
pub type MatRef<'a> = faer::MatRef<'a, f64>;

/// `A = L Lᵀ` of a symmetric positive definite matrix.
#[derive(Clone, Debug)]
pub struct CholeskyFactor(Llt<f64>);

/// Factor of a symmetric matrix, of which the lower triangle is read.
///
/// # Errors
/// If the matrix is not positive definite.
pub fn cholesky(matrix: MatRef<'_>) -> Result<CholeskyFactor, NotPositiveDefinite> {
    matrix.llt(Side::Lower).map(CholeskyFactor).map_err(|_| NotPositiveDefinite)
}

impl CholeskyFactor {
    /// `A⁻¹ B`.
    pub fn solve(&self, right_hand_sides: MatRef<'_>) -> Mat {
        self.0.solve(right_hand_sides)
    }

    /// `ln |A|`.
    pub fn log_determinant(&self) -> f64 {
        self.0.L().diagonal().column_vector().iter().map(|pivot| 2.0 * pivot.ln()).sum()
    }

    /// `A⁻¹`.
    pub fn inverse(&self) -> Mat {
        let size = self.0.L().nrows();
        self.0.solve(Mat::identity(size, size))
    }
}

/// Eigenvalues of a symmetric matrix, of which the lower triangle is read, and its eigenvectors, the columns of a
/// matrix; nothing where they are not found.
pub fn eigen(matrix: MatRef<'_>) -> Option<(Vec<f64>, Mat)> {
    let found = matrix.self_adjoint_eigen(Side::Lower).ok()?;
    Some((found.S().column_vector().iter().copied().collect(), found.U().to_owned()))
}

/// `A B`.
pub fn product(a: MatRef<'_>, b: MatRef<'_>) -> Mat {
    a * b
}
