//! Dense matrices.

use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::solvers::{Llt, Solve};
use faer::{Accum, Par, Side};

use crate::NotPositiveDefinite;

/// A matrix, columns one after the other.
pub type Mat = faer::Mat<f64>;
/// A matrix or a part of one.
pub type MatRef<'a> = faer::MatRef<'a, f64>;

/// `A = L Lᵀ` of a symmetric positive definite matrix.
pub struct Factor(Llt<f64>);

/// Factor of a symmetric matrix, of which the lower triangle is read.
///
/// # Errors
/// If the matrix is not positive definite.
pub fn cholesky(matrix: MatRef<'_>) -> Result<Factor, NotPositiveDefinite> {
    matrix.llt(Side::Lower).map(Factor).map_err(|_| NotPositiveDefinite)
}

impl Factor {
    /// The factor itself, lower triangular.
    #[must_use]
    pub fn lower(&self) -> MatRef<'_> {
        self.0.L()
    }

    /// `A⁻¹ B`.
    #[must_use]
    pub fn solve(&self, right_hand_sides: MatRef<'_>) -> Mat {
        self.0.solve(right_hand_sides)
    }

    /// `A⁻¹`.
    #[must_use]
    pub fn inverse(&self) -> Mat {
        let size = self.0.L().nrows();
        self.0.solve(Mat::identity(size, size))
    }
}

/// `A B`.
#[must_use]
pub fn product(a: MatRef<'_>, b: MatRef<'_>) -> Mat {
    a * b
}

/// Lower triangle of `A B`, which the caller knows to be symmetric; above it, zeros.
#[must_use]
pub fn lower_of_product(a: MatRef<'_>, b: MatRef<'_>) -> Mat {
    let mut lower = Mat::zeros(a.nrows(), b.ncols());
    let (half, whole) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
    triangular::matmul(&mut lower, half, Accum::Replace, a, whole, b, whole, 1.0, Par::Seq);
    lower
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Entries that look random, and twice as many rows as columns.
    fn tall(columns: usize) -> Mat {
        let mut random = fastrand::Rng::with_seed(3);
        Mat::from_fn(2 * columns, columns, |_, _| random.f64() - 0.5)
    }

    #[test]
    fn a_factor_solves_what_it_was_made_of() {
        let a = tall(30);
        let square = product(a.transpose(), a.as_ref());
        let factor = cholesky(square.as_ref()).unwrap();
        let identity = product(square.as_ref(), factor.inverse().as_ref());
        let solved = product(square.as_ref(), factor.solve(a.transpose()).as_ref());
        for i in 0..30 {
            for j in 0..30 {
                assert!((identity[(i, j)] - f64::from(u8::from(i == j))).abs() < 1e-12);
                assert!((solved[(i, j)] - a[(j, i)]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn what_is_not_positive_definite_is_refused() {
        let flat = Mat::from_fn(3, 3, |_, _| 1.0);
        let negative = Mat::from_fn(3, 3, |i, j| if i == j { -1.0 } else { 0.0 });
        assert_eq!(cholesky(negative.as_ref()).err(), Some(NotPositiveDefinite));
        assert_eq!(cholesky(flat.as_ref()).err(), Some(NotPositiveDefinite));
    }

    #[test]
    fn the_lower_triangle_is_that_of_the_product() {
        let a = tall(20);
        let (whole, lower) = (product(a.transpose(), a.as_ref()), lower_of_product(a.transpose(), a.as_ref()));
        for i in 0..20 {
            for j in 0..20 {
                let due = if j <= i { whole[(i, j)] } else { 0.0 };
                assert!((lower[(i, j)] - due).abs() < 1e-12);
            }
        }
    }
}
