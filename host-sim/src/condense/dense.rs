//! Dense kernels for fronts of some tens of unknowns, column-major, lower triangle.
//!
//! At this size the calls of a general library cost as much as the arithmetic; these loops are compiled for the vector unit
//! that the machine has (pulp).

use pulp::Arch;

/// Kernels compiled for this machine.
#[derive(Debug, Clone, Copy)]
pub struct Kernels(Arch);

impl Default for Kernels {
    fn default() -> Self {
        Kernels(Arch::new())
    }
}

impl Kernels {
    /// Eliminates the first `p` unknowns of a symmetric m x m front whose pivot block has the given sign (+1 or −1 definite):
    ///
    /// ```text
    ///   [ A  B^T ]    sign A = L L^T,  P = B L^-T:    [ L              ]
    ///   [ B   C  ] ->                                 [ P  C - sign P P^T ]
    /// ```
    ///
    /// False when the pivot block does not have that sign.
    #[must_use]
    pub fn eliminate(self, front: &mut [f64], m: usize, p: usize, sign: f64) -> bool {
        assert!(front.len() >= m * m && p <= m);
        self.0.dispatch(
            #[inline(always)]
            || eliminate(front, m, p, sign),
        )
    }

    /// Solves with an eliminated panel (the first p columns of the front): `x` becomes `L^-1 x`, `rest` loses
    /// `sign P L^-1 x`.
    pub fn forward(self, panel: &[f64], m: usize, p: usize, sign: f64, x: &mut [f64], rest: &mut [f64]) {
        assert!(panel.len() >= m * p && x.len() == p && rest.len() == m - p);
        self.0.dispatch(
            #[inline(always)]
            || {
                for k in 0..p {
                    let column = &panel[k * m..(k + 1) * m];
                    let y = x[k] / column[k];
                    x[k] = y;
                    subtract(&mut x[k + 1..], &column[k + 1..p], y);
                    subtract(rest, &column[p..], sign * y);
                }
            },
        );
    }

    /// The other way: `x` (as [`Kernels::forward`] left it) becomes the solution, `rest` being solved.
    pub fn backward(self, panel: &[f64], m: usize, p: usize, sign: f64, x: &mut [f64], rest: &[f64]) {
        assert!(panel.len() >= m * p && x.len() == p && rest.len() == m - p);
        self.0.dispatch(
            #[inline(always)]
            || {
                for k in (0..p).rev() {
                    let column = &panel[k * m..(k + 1) * m];
                    let known = dot(&column[p..], rest);
                    // x holds the unsigned forward result from k up to here, the solution beyond.
                    let later = dot(&column[k + 1..p], &x[k + 1..]);
                    x[k] = (sign * (x[k] - known) - later) / column[k];
                }
            },
        );
    }

    /// `y += sign A x` for a column-major matrix with `y.len()` rows.
    pub fn multiply_add(self, a: &[f64], x: &[f64], sign: f64, y: &mut [f64]) {
        let rows = y.len();
        assert!(a.len() >= rows * x.len());
        self.0.dispatch(
            #[inline(always)]
            || {
                for (column, x) in a.chunks_exact(rows.max(1)).zip(x) {
                    subtract(y, column, -sign * x);
                }
            },
        );
    }

    /// `y += sign A^T x` for a column-major matrix with `x.len()` rows.
    pub fn multiply_transposed_add(self, a: &[f64], x: &[f64], sign: f64, y: &mut [f64]) {
        let rows = x.len();
        assert!(a.len() >= rows * y.len());
        self.0.dispatch(
            #[inline(always)]
            || {
                for (column, y) in a.chunks_exact(rows.max(1)).zip(y) {
                    *y += sign * dot(column, x);
                }
            },
        );
    }
}

#[inline(always)]
fn subtract(y: &mut [f64], x: &[f64], factor: f64) {
    for (y, x) in y.iter_mut().zip(x) {
        *y -= factor * x;
    }
}

/// Dot product in eight strands, which a vector unit can keep apart.
#[inline(always)]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut strands = [0.0; 8];
    let (mut a8, mut b8) = (a.chunks_exact(8), b.chunks_exact(8));
    for (a, b) in (&mut a8).zip(&mut b8) {
        for i in 0..8 {
            strands[i] += a[i] * b[i];
        }
    }
    let tail: f64 = a8.remainder().iter().zip(b8.remainder()).map(|(a, b)| a * b).sum();
    strands.iter().sum::<f64>() + tail
}

#[inline(always)]
fn eliminate(f: &mut [f64], m: usize, p: usize, sign: f64) -> bool {
    if sign < 0.0 {
        for k in 0..p {
            f[k * m + k..k * m + p].iter_mut().for_each(|x| *x = -*x);
        }
    }
    let mut k = 0;
    while k < p {
        let width = (p - k).min(4);
        for c in k..k + width {
            let (before, column) = f.split_at_mut(c * m);
            let column = &mut column[c..m];
            for b in k..c {
                let other = &before[b * m + c..(b + 1) * m];
                subtract(column, other, other[0]);
            }
            let pivot = column[0];
            if !(pivot > 0.0 && pivot.is_finite()) {
                return false;
            }
            let scale = 1.0 / pivot.sqrt();
            column.iter_mut().for_each(|x| *x *= scale);
        }
        for j in k + width..m {
            let s = if j < p { 1.0 } else { sign };
            let (before, column) = f.split_at_mut(j * m);
            let column = &mut column[j..m];
            let source = |i: usize| &before[(k + i) * m + j..(k + i + 1) * m];
            if width == 4 {
                let (a, b, c, d) = (source(0), source(1), source(2), source(3));
                let (fa, fb, fc, fd) = (s * a[0], s * b[0], s * c[0], s * d[0]);
                for ((((x, a), b), c), d) in column.iter_mut().zip(a).zip(b).zip(c).zip(d) {
                    *x -= (fa * a + fb * b) + (fc * c + fd * d);
                }
            } else {
                for i in 0..width {
                    let a = source(i);
                    subtract(column, a, s * a[0]);
                }
            }
        }
        k += width;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quasi_definite(n: usize, p: usize, sign: f64) -> Vec<f64> {
        let mut rng = fastrand::Rng::with_seed(n as u64);
        let mut a = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                let x = rng.f64() - 0.5;
                let x = if i == j { (x + n as f64) * if i < p { sign } else { 1.0 } } else { x };
                (a[i + j * n], a[j + i * n]) = (x, x);
            }
        }
        a
    }

    #[test]
    fn elimination_and_solution_agree_with_the_product() {
        let kernels = Kernels::default();
        for (n, p, sign) in [(1, 1, 1.0), (7, 3, 1.0), (7, 3, -1.0), (67, 30, 1.0), (60, 18, 1.0), (44, 9, -1.0)] {
            let a = quasi_definite(n, p, sign);
            let b: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
            let mut front = a.clone();
            assert!(kernels.eliminate(&mut front, n, p, sign));
            let (mut first, mut rest) = (b[..p].to_vec(), b[p..].to_vec());
            kernels.forward(&front, n, p, sign, &mut first, &mut rest);
            // What remains is a positive definite system of its own.
            let q = n - p;
            let mut c: Vec<f64> = (0..q * q).map(|k| front[p + k % q + (p + k / q) * n]).collect();
            if q > 0 {
                assert!(kernels.eliminate(&mut c, q, q, 1.0));
                kernels.forward(&c, q, q, 1.0, &mut rest, &mut []);
                kernels.backward(&c, q, q, 1.0, &mut rest, &[]);
            }
            kernels.backward(&front, n, p, sign, &mut first, &rest);
            let x: Vec<f64> = first.into_iter().chain(rest).collect();
            for i in 0..n {
                let ax: f64 = (0..n).map(|j| a[i + j * n] * x[j]).sum();
                assert!((ax - b[i]).abs() < 1e-12, "row {i} of {n}: {ax} against {}", b[i]);
            }
        }
    }

    #[test]
    fn a_pivot_of_the_wrong_sign_is_refused() {
        let kernels = Kernels::default();
        assert!(!kernels.eliminate(&mut quasi_definite(9, 9, 1.0), 9, 9, -1.0));
        assert!(!kernels.eliminate(&mut quasi_definite(9, 4, -1.0), 9, 4, 1.0));
        assert!(!kernels.eliminate(&mut [f64::NAN; 4], 2, 2, 1.0));
    }

    #[test]
    fn products_are_products() {
        let kernels = Kernels::default();
        let a: Vec<f64> = (0..13 * 5).map(|i| (i as f64 * 0.7).cos()).collect();
        let x: Vec<f64> = (0..5).map(f64::from).collect();
        let mut y = vec![1.0; 13];
        kernels.multiply_add(&a, &x, 2.0, &mut y);
        let mut z = vec![0.5; 5];
        kernels.multiply_transposed_add(&a, &y, -1.0, &mut z);
        for i in 0..13 {
            let expected = 1.0 + 2.0 * (0..5).map(|j| a[i + 13 * j] * x[j]).sum::<f64>();
            assert!((y[i] - expected).abs() < 1e-13);
        }
        for j in 0..5 {
            let expected = 0.5 - (0..13).map(|i| a[i + 13 * j] * y[i]).sum::<f64>();
            assert!((z[j] - expected).abs() < 1e-13);
        }
    }
}
