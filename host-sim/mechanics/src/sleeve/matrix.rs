//! Small dense symmetric matrices, and their condensation.

use crate::fem::element::packed_index;

/// Size of a pivot, relative to its diagonal entry at the start, below which the unknown carries nothing: it
/// moves without force (a rigid body's motion). Round-off of a few hundred eliminations leaves 1e-13.
const NO_STIFFNESS: f64 = 1e-11;

/// A symmetric matrix, stored whole by rows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Symmetric {
    size: usize,
    entries: Vec<f64>,
}

impl Symmetric {
    pub fn zeros(size: usize) -> Self {
        Symmetric { size, entries: vec![0.0; size * size] }
    }

    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.entries[i * self.size + j]
    }

    /// The first rows and columns.
    pub fn array<const N: usize>(&self) -> [[f64; N]; N] {
        std::array::from_fn(|i| std::array::from_fn(|j| self.at(i, j)))
    }

    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        self.entries[i * self.size + j] += value;
    }

    /// Adds the stiffness of an element, packed, whose displacements each follow unknowns here, by weights.
    pub(crate) fn add_following(&mut self, stiffness: &[f64], follows: &[Vec<(usize, f64)>]) {
        for (i, row) in follows.iter().enumerate() {
            for (j, column) in follows.iter().enumerate() {
                let value = stiffness[packed_index(i, j)];
                for (a, weight) in row {
                    for (b, other) in column {
                        self.add(*a, *b, value * weight * other);
                    }
                }
            }
        }
    }

    /// Adds a smaller matrix whose unknown k is `at[k]` here.
    pub(crate) fn add_at<const N: usize>(&mut self, part: &[[f64; N]; N], at: [usize; N]) {
        for (row, &i) in part.iter().zip(&at) {
            for (value, &j) in row.iter().zip(&at) {
                self.add(i, j, *value);
            }
        }
    }

    /// The energy `½ x^T K x` in unknowns y with `x_i = sum_k basis[k][i] y_k`.
    pub(crate) fn in_basis(&self, basis: &[Vec<f64>]) -> Symmetric {
        let times = |x: &[f64]| -> Vec<f64> {
            self.entries.chunks_exact(self.size).map(|row| row.iter().zip(x).map(|(a, b)| a * b).sum()).collect()
        };
        let mut reduced = Symmetric::zeros(basis.len());
        for (j, column) in basis.iter().enumerate() {
            let forces = times(column);
            for (i, other) in basis.iter().enumerate() {
                reduced.add(i, j, other.iter().zip(&forces).map(|(a, b)| a * b).sum());
            }
        }
        reduced
    }

    /// Condensed matrix of the unknowns `keep`, where those of `fixed` are held and all others move freely.
    pub(crate) fn condensed(&self, keep: &[usize], fixed: &[usize]) -> Symmetric {
        let n = self.size;
        let mut a = self.entries.clone();
        let mut active: Vec<usize> = (0..n).filter(|i| !fixed.contains(i)).collect();
        let eliminated: Vec<usize> = active.iter().copied().filter(|i| !keep.contains(i)).collect();
        for p in eliminated {
            active.retain(|i| *i != p);
            let pivot = a[p * n + p];
            if pivot <= NO_STIFFNESS * self.at(p, p) {
                continue;
            }
            for &i in &active {
                let factor = a[i * n + p] / pivot;
                if factor != 0.0 {
                    for &j in &active {
                        a[i * n + j] -= factor * a[p * n + j];
                    }
                }
            }
        }
        let mut left = Symmetric::zeros(keep.len());
        for (i, from) in keep.iter().enumerate() {
            for (j, to) in keep.iter().enumerate() {
                left.add(i, j, a[from * n + to]);
            }
        }
        left
    }
}

impl Symmetric {
    /// All unknowns where some are known and no load acts on the others.
    pub(crate) fn solved(&self, known: &[(usize, f64)]) -> Vec<f64> {
        let n = self.size;
        let mut x = vec![0.0; n];
        let mut is_known = vec![false; n];
        for &(i, value) in known {
            (x[i], is_known[i]) = (value, true);
        }
        let free: Vec<usize> = (0..n).filter(|i| !is_known[*i]).collect();
        let mut a = self.entries.clone();
        let mut load: Vec<f64> =
            (0..n).map(|i| -known.iter().map(|(k, value)| self.at(i, *k) * value).sum::<f64>()).collect();
        for (at, &p) in free.iter().enumerate() {
            let pivot = a[p * n + p];
            if pivot <= NO_STIFFNESS * self.at(p, p) {
                continue;
            }
            for &i in &free[at + 1..] {
                let factor = a[i * n + p] / pivot;
                if factor != 0.0 {
                    for &j in &free[at..] {
                        a[i * n + j] -= factor * a[p * n + j];
                    }
                    load[i] -= factor * load[p];
                }
            }
        }
        for (at, &p) in free.iter().enumerate().rev() {
            let pivot = a[p * n + p];
            if pivot > NO_STIFFNESS * self.at(p, p) {
                let beyond: f64 = free[at + 1..].iter().map(|&j| a[p * n + j] * x[j]).sum();
                x[p] = (load[p] - beyond) / pivot;
            }
        }
        x
    }

    /// Work `f^T K^-1 f` of a load, some unknowns held.
    pub(crate) fn work_of(&self, load: &[f64], held: &[usize]) -> f64 {
        // One unknown more, that carries the load: K x = f z with z = 1 leaves -f^T K^-1 f on its diagonal.
        let n = self.size;
        let mut bordered = Symmetric::zeros(n + 1);
        for i in 0..n {
            for j in 0..n {
                bordered.add(i, j, self.at(i, j));
            }
            bordered.add(i, n, -load[i]);
            bordered.add(n, i, -load[i]);
        }
        -bordered.condensed(&[n], held).at(0, 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain of springs 1 - 2 - 3 - 4 of stiffness 2, 3, 6.
    fn chain() -> Symmetric {
        let mut chain = Symmetric::zeros(4);
        for (k, stiffness) in [2.0, 3.0, 6.0].into_iter().enumerate() {
            chain.add_at(&[[stiffness, -stiffness], [-stiffness, stiffness]], [k, k + 1]);
        }
        chain
    }

    #[test]
    fn springs_in_a_row_add_their_compliances() {
        let end = chain().condensed(&[3], &[0]);
        assert!((end.at(0, 0) - 1.0).abs() < 1e-14, "1/2 + 1/3 + 1/6 = 1");
    }

    #[test]
    fn what_is_pulled_moves_along() {
        let moved = chain().solved(&[(0, 0.0), (3, 1.0)]);
        for (found, expected) in moved.iter().zip([0.0, 0.5, 0.5 + 1.0 / 3.0, 1.0]) {
            assert!((found - expected).abs() < 1e-14, "{moved:?}");
        }
        // One end alone takes all along.
        assert!(chain().solved(&[(0, 2.0)]).iter().all(|x| (x - 2.0).abs() < 1e-14));
    }

    #[test]
    fn what_nothing_holds_carries_nothing() {
        let free = chain().condensed(&[3], &[]);
        assert!(free.at(0, 0).abs() < 1e-12);
        // All of it moved as one body.
        let moved = chain().in_basis(&[vec![1.0; 4], vec![0.0, 1.0, 2.0, 3.0]]);
        assert!(moved.at(0, 0).abs() < 1e-14 && (moved.at(1, 1) - 11.0).abs() < 1e-14);
    }
}
