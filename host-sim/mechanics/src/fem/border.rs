//! Solution of a sparse symmetric system with a few dense rows and columns.
//!
//! ```text
//!   [ A    B ] [ x ]   [ f ]        A n x n sparse, factorised; B n x m; D m x m; m some tens at most
//!   [ B^T  D ] [ z ] = [ g ]
//! ```
//!
//! by block elimination: `(D - B^T A^-1 B) z = g - B^T A^-1 f`, then `x = A^-1 f - A^-1 B z`. The output angle, the
//! mean rotation of the bore and other quantities that couple with many nodes at once enter as borders and leave A
//! sparse.

/// Right-hand sides that a factor takes at once.
const MOST_COLUMNS: usize = 8;

/// A factorised matrix that solves.
pub trait Factor {
    /// Solves in place for `count` right-hand sides, one after the other in `columns`; at most eight.
    fn solve(&mut self, columns: &mut [f64], count: usize);
}

/// Dense columns B and corner D of a bordered matrix.
#[derive(Debug, Clone)]
pub struct Border {
    /// Columns of B, one after the other.
    pub columns: Vec<f64>,
    /// D by rows.
    pub corner: Vec<f64>,
    /// Number of columns m.
    pub width: usize,
}

impl Border {
    /// A border of zeros.
    pub fn zeros(unknowns: usize, width: usize) -> Border {
        Border { columns: vec![0.0; unknowns * width], corner: vec![0.0; width * width], width }
    }

    /// Column k of B.
    pub(crate) fn column_mut(&mut self, k: usize) -> &mut [f64] {
        let n = self.columns.len() / self.width;
        &mut self.columns[k * n..(k + 1) * n]
    }
}

/// A border eliminated with the factor of its sparse part, ready to solve with that factor.
#[derive(Debug, Clone)]
pub struct BorderedSystem {
    /// The entries of each column of B, which is empty but for a few nodes of each sector.
    columns: Vec<Vec<(usize, f64)>>,
    /// `A^-1 B`.
    solved: Vec<f64>,
    /// `D - B^T A^-1 B`.
    schur: Vec<f64>,
}

/// Sum of products, one after the other.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// The same with a column of few entries.
fn dot_sparse(column: &[(usize, f64)], x: &[f64]) -> f64 {
    column.iter().map(|(k, c)| c * x[*k]).sum()
}

/// Largest magnitude, found in strands that a vector unit can keep apart.
pub(crate) fn largest(x: &[f64]) -> f64 {
    let (eights, rest) = x.as_chunks::<8>();
    let mut most = [0.0_f64; 8];
    eights.iter().for_each(|eight| most.iter_mut().zip(eight).for_each(|(m, x)| *m = m.max(x.abs())));
    most.iter().chain(rest).fold(0.0, |m, x| m.max(x.abs()))
}

impl BorderedSystem {
    /// Eliminates the sparse part, and solves with it for `f` on the way: what a factor reads serves both. Beside the
    /// system `A^-1 f`, which `complete` takes.
    pub fn new(factor: &mut (impl Factor + ?Sized), border: &Border, f: &[f64]) -> (Self, Vec<f64>) {
        let m = border.width;
        let n = border.columns.len() / m;
        let mut solved = [&border.columns, f].concat();
        for columns in solved.chunks_mut(MOST_COLUMNS * n) {
            factor.solve(columns, columns.len() / n);
        }
        let f = solved.split_off(m * n);
        let mut schur = border.corner.clone();
        let entries = |column: &[f64]| column.iter().copied().enumerate().filter(|(_, c)| *c != 0.0).collect();
        let columns: Vec<Vec<(usize, f64)>> = border.columns.chunks_exact(n).map(entries).collect();
        for (row, column) in schur.chunks_exact_mut(m).zip(&columns) {
            for (entry, solved) in row.iter_mut().zip(solved.chunks_exact(n)) {
                *entry -= dot_sparse(column, solved);
            }
        }
        (BorderedSystem { columns, solved, schur }, f)
    }

    /// Solves in place, with the factor it was made with: `f` becomes x, `g` becomes z. False when the small system is
    /// singular.
    pub(crate) fn solve(&self, factor: &mut (impl Factor + ?Sized), f: &mut [f64], g: &mut [f64]) -> bool {
        factor.solve(f, 1);
        self.complete(f, g)
    }

    /// Solves in place from `A^-1 f` in place of f.
    pub(crate) fn complete(&self, f: &mut [f64], g: &mut [f64]) -> bool {
        let n = f.len();
        for (gi, column) in g.iter_mut().zip(&self.columns) {
            *gi -= dot_sparse(column, f);
        }
        if !self.solve_border(g) {
            return false;
        }
        for (k, z) in g.iter().enumerate() {
            for (x, s) in f.iter_mut().zip(&self.solved[k * n..(k + 1) * n]) {
                *x -= s * z;
            }
        }
        true
    }

    /// z alone, for f = 0, in place of g.
    pub(crate) fn solve_border(&self, g: &mut [f64]) -> bool {
        solve_dense(&mut self.schur.clone(), g, self.columns.len())
    }
}

/// Gaussian elimination with row pivoting on scaled rows; false when singular.
fn solve_dense(a: &mut [f64], b: &mut [f64], n: usize) -> bool {
    for i in 0..n {
        let scale = a[i * n..(i + 1) * n].iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        if scale == 0.0 || !scale.is_finite() {
            return false;
        }
        a[i * n..(i + 1) * n].iter_mut().for_each(|x| *x /= scale);
        b[i] /= scale;
    }
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| a[i * n + k].abs().total_cmp(&a[j * n + k].abs())).unwrap_or(k);
        if a[pivot * n + k].abs() < 1e-14 {
            return false;
        }
        if pivot != k {
            for j in 0..n {
                a.swap(k * n + j, pivot * n + j);
            }
            b.swap(k, pivot);
        }
        for i in k + 1..n {
            let factor = a[i * n + k] / a[k * n + k];
            for j in k..n {
                a[i * n + j] -= factor * a[k * n + j];
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        for j in k + 1..n {
            b[k] -= a[k * n + j] * b[j];
        }
        b[k] /= a[k * n + k];
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::{Cholesky, Pattern};

    #[test]
    fn bordered_system_is_solved() {
        let groups = [vec![0_u32, 1], vec![1, 2]];
        let pattern = Pattern::new(3, groups.iter().map(Vec::as_slice), std::iter::empty());
        let mut values: Vec<f64> = (0..pattern.stored()).map(|i| 0.3 * (i as f64).sin()).collect();
        for start in &pattern.column_starts[..6] {
            values[*start as usize] += 4.0;
        }
        let mut factor = Cholesky::new(&pattern);
        factor.factorise(&pattern, &values).unwrap();
        let mut border = Border::zeros(6, 2);
        for i in 0..12 {
            border.columns[i] = (i as f64 * 1.3).cos();
        }
        border.corner = vec![0.0, 0.5, 0.5, -1.0];
        let f: Vec<f64> = (0..6).map(|i| f64::from(i) - 2.0).collect();
        let g = [0.7, -0.2];
        let (mut x, mut z) = (f.clone(), g);
        let (system, mut at_once) = BorderedSystem::new(&mut factor, &border, &f);
        assert!(system.solve(&mut factor, &mut x, &mut z));
        assert!(system.complete(&mut at_once, &mut g.clone()) && at_once == x);
        let mut residual = f.iter().map(|v| -v).collect::<Vec<_>>();
        pattern.multiply_add(&values, &x, &mut residual);
        for k in 0..2 {
            for i in 0..6 {
                residual[i] += border.columns[k * 6 + i] * z[k];
            }
        }
        assert!(residual.iter().all(|r| r.abs() < 1e-13), "{residual:?}");
        for i in 0..2 {
            let r = dot(&border.columns[i * 6..(i + 1) * 6], &x)
                + border.corner[i * 2] * z[0]
                + border.corner[i * 2 + 1] * z[1]
                - g[i];
            assert!(r.abs() < 1e-13);
        }
    }

    #[test]
    fn an_indefinite_matrix_is_refused() {
        let groups = [vec![0_u32, 1]];
        let pattern = Pattern::new(2, groups.iter().map(Vec::as_slice), std::iter::empty());
        let mut values = vec![0.0; pattern.stored()];
        for (unknown, start) in pattern.column_starts[..4].iter().enumerate() {
            values[*start as usize] = if unknown < 2 { 1.0 } else { -1.0 };
        }
        assert!(Cholesky::new(&pattern).factorise(&pattern, &values).is_err());
    }
}
