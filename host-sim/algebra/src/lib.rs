//! Factors and products of matrices (faer) and Fourier transforms (realfft), for `f64` alone.
//!
//! Both libraries are generic: a crate that calls them compiles them. They are called here and nowhere else, so that a
//! change of the simulation does not compile them again.
#![forbid(unsafe_code)]

mod dense;
mod fourier;
mod sparse;

pub use dense::{CholeskyFactor, Mat, MatRef, cholesky, eigen, product};
pub use fourier::{Complex, spectrum};
pub use sparse::SparseCholesky;

use thiserror::Error;

/// The matrix has a direction of no or negative stiffness.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("the matrix is not positive definite")]
pub struct NotPositiveDefinite;
