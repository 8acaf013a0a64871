//! Sparse linear algebra of the whole drive: pattern, assembly positions, Cholesky factor with a dense border.

mod border;
mod cholesky;
mod pattern;

pub use border::{Border, BorderedSystem, Factor};
pub use cholesky::{Cholesky, NotPositiveDefinite};
pub use pattern::{BlockPosition, ElementPositions, Pattern};
