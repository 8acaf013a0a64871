//! Sparse Cholesky factor with a reusable symbolic part (faer).

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};
use thiserror::Error;

use super::border::Factor;
use super::pattern::Pattern;

/// The matrix has a direction of no or negative stiffness.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("the stiffness matrix is not positive definite")]
pub struct NotPositiveDefinite;

/// `A = L L^T` of a symmetric positive definite matrix on a [`Pattern`].
pub struct Cholesky {
    symbolic: SymbolicCholesky<u32>,
    factor: Vec<f64>,
    memory: MemBuffer,
}

impl Cholesky {
    /// Orders and analyses the pattern; the factor itself comes from [`Cholesky::factorise`].
    pub fn new(pattern: &Pattern) -> Cholesky {
        let n = pattern.unknowns();
        let structure = SymbolicSparseColMatRef::new_checked(n, n, &pattern.column_starts, None, &pattern.rows);
        let symbolic = factorize_symbolic_cholesky(
            structure,
            Side::Lower,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams::default(),
        )
        .expect("the factor fits in memory");
        let factor = vec![0.0; symbolic.len_val()];
        // One buffer serves the factorisation and solves with up to eight right-hand sides.
        let scratch = symbolic
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default())
            .or(symbolic.solve_in_place_scratch::<f64>(8, Par::Seq));
        Cholesky { symbolic, factor, memory: MemBuffer::new(scratch) }
    }

    /// Computes the factor of the matrix with these values.
    pub fn factorise(&mut self, pattern: &Pattern, values: &[f64]) -> Result<(), NotPositiveDefinite> {
        let n = pattern.unknowns();
        // The pattern was checked when it was analysed.
        let structure = SymbolicSparseColMatRef::new_checked(n, n, &pattern.column_starts, None, &pattern.rows);
        let matrix = SparseColMatRef::new(structure, values);
        self.symbolic
            .factorize_numeric_llt::<f64>(
                &mut self.factor,
                matrix,
                Side::Lower,
                Default::default(),
                Par::Seq,
                MemStack::new(&mut self.memory),
                Default::default(),
            )
            .map(|_| ())
            .map_err(|_| NotPositiveDefinite)
    }
}

impl Factor for Cholesky {
    fn solve(&mut self, right_hand_sides: &mut [f64], columns: usize) {
        assert!(columns <= 8, "the work space is sized for eight right-hand sides");
        let rows = right_hand_sides.len() / columns;
        let matrix = MatMut::from_column_major_slice_mut(right_hand_sides, rows, columns);
        LltRef::<'_, u32, f64>::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
            Conj::No,
            matrix,
            Par::Seq,
            MemStack::new(&mut self.memory),
        );
    }
}
