//! Sparse Cholesky factor with a reusable symbolic part.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

use crate::NotPositiveDefinite;

/// `A = L Lᵀ` of a symmetric positive definite matrix, of which the lower triangle is stored column by column: the rows
/// of column `j` are `rows[column_starts[j]..column_starts[j + 1]]`, ascending.
pub struct SparseCholesky {
    symbolic: SymbolicCholesky<u32>,
    factor: Vec<f64>,
    memory: MemBuffer,
}

impl SparseCholesky {
    /// Right-hand sides of one solve, at most.
    pub(crate) const MOST_COLUMNS: usize = 8;

    /// Orders and analyses the pattern; the factor itself comes from [`SparseCholesky::factorise`].
    ///
    /// # Panics
    /// If the pattern is none, or the factor does not fit in memory.
    pub fn new(column_starts: &[u32], rows: &[u32]) -> SparseCholesky {
        let n = column_starts.len() - 1;
        let structure = SymbolicSparseColMatRef::new_checked(n, n, column_starts, None, rows);
        let symbolic = factorize_symbolic_cholesky(
            structure,
            Side::Lower,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams::default(),
        )
        .expect("the factor fits in memory");
        let factor = vec![0.0; symbolic.len_val()];
        // One buffer serves the factorisation and every solve.
        let scratch = symbolic
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default())
            .or(symbolic.solve_in_place_scratch::<f64>(Self::MOST_COLUMNS, Par::Seq));
        SparseCholesky { symbolic, factor, memory: MemBuffer::new(scratch) }
    }

    /// Computes the factor of the matrix with these values, on the pattern that was analysed.
    ///
    /// # Errors
    /// If the matrix is not positive definite.
    pub fn factorise(
        &mut self,
        column_starts: &[u32],
        rows: &[u32],
        values: &[f64],
    ) -> Result<(), NotPositiveDefinite> {
        let n = column_starts.len() - 1;
        let structure = SymbolicSparseColMatRef::new_checked(n, n, column_starts, None, rows);
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

    /// Solves in place, columns one after the other.
    ///
    /// # Panics
    /// If there are more than `SparseCholesky::MOST_COLUMNS` of them.
    pub fn solve(&mut self, right_hand_sides: &mut [f64], columns: usize) {
        assert!(columns <= Self::MOST_COLUMNS, "the work space is sized for {} right-hand sides", Self::MOST_COLUMNS);
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
