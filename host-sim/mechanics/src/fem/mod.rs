//! Finite elements: the element and its material; sparse linear algebra of the whole drive: pattern, assembly
//! positions, Cholesky factor with a dense border.

mod border;
mod cholesky;
pub mod element;
pub mod material;
mod pattern;

pub use border::{Border, BorderedSystem, Factor};
pub(crate) use border::{dot, largest};
pub use cholesky::Cholesky;
pub use pattern::{PackedPositions, Pattern};
