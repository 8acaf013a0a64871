//! Dense kernels for fronts of some tens of unknowns, column-major, lower triangle.
//!
//! At this size the calls of a general library cost as much as the arithmetic; these loops are compiled for the vector
//! unit that the machine has (pulp).

use pulp::{Arch, NullaryFnOnce};

/// Kernels compiled for this machine.
#[derive(Debug, Clone, Copy)]
pub struct DenseKernels(Arch);

impl Default for DenseKernels {
    fn default() -> Self {
        DenseKernels(Arch::new())
    }
}

impl DenseKernels {
    /// Eliminates the first `p` unknowns of a symmetric m x m front whose pivot block has the given sign (+1 or −1
    /// definite):
    ///
    /// ```text
    ///   [ A  B^T ]    sign A = L L^T,  P = B L^-T:    [ L              ]
    ///   [ B   C  ] ->                                 [ P  C - sign P P^T ]
    /// ```
    ///
    /// False when the pivot block does not have that sign.
    #[must_use]
    pub(crate) fn eliminate(self, front: &mut [f64], m: usize, p: usize, sign: f64) -> bool {
        assert!(front.len() >= m * m && p <= m);
        self.0.dispatch(Eliminate { front, m, p, sign })
    }

    /// Solves with an eliminated panel (the first p columns of the front): `x` becomes `L^-1 x`, `rest` loses
    /// `sign P L^-1 x`. As everywhere below W right-hand sides lie beside one another: what is read of a matrix serves
    /// for all of them.
    pub fn forward<const W: usize>(
        self,
        panel: &[f64],
        [m, p]: [usize; 2],
        sign: f64,
        x: &mut [[f64; W]],
        rest: &mut [[f64; W]],
    ) {
        assert!(panel.len() >= m * p && x.len() == p && rest.len() == m - p);
        self.0.dispatch(Forward { panel, m, p, sign, x, rest });
    }

    /// The other way: `x` (as [`DenseKernels::forward`] left it) becomes the solution, `rest` being solved.
    pub fn backward<const W: usize>(
        self,
        panel: &[f64],
        [m, p]: [usize; 2],
        sign: f64,
        x: &mut [[f64; W]],
        rest: &[[f64; W]],
    ) {
        assert!(panel.len() >= m * p && x.len() == p && rest.len() == m - p);
        self.0.dispatch(Backward { panel, m, p, sign, x, rest });
    }

    /// `y += sign A x` for a column-major matrix with `y.len()` rows.
    pub fn multiply_add<const W: usize>(self, a: &[f64], x: &[[f64; W]], sign: f64, y: &mut [[f64; W]]) {
        assert!(a.len() >= y.len() * x.len());
        self.0.dispatch(Multiply { a, x, sign, y });
    }

    /// `y += sign A^T x` for a column-major matrix with `x.len()` rows.
    pub(crate) fn multiply_transposed_add<const W: usize>(
        self,
        a: &[f64],
        x: &[[f64; W]],
        sign: f64,
        y: &mut [[f64; W]],
    ) {
        assert!(a.len() >= x.len() * y.len());
        self.0.dispatch(MultiplyTransposed { a, x, sign, y });
    }
}

/// One right-hand side.
#[inline]
pub fn one(x: &[f64]) -> &[[f64; 1]] {
    x.as_chunks().0
}

/// The same, to write.
#[inline]
pub fn one_mut(x: &mut [f64]) -> &mut [[f64; 1]] {
    x.as_chunks_mut().0
}

/// A kernel as a value: the calls of a closure are not always inlined, and then not compiled for the vector unit.
macro_rules! kernel {
    ($name:ident $(<$sides:ident>)? { $($field:ident: $type:ty),* } -> $output:ty, $body:block) => {
        struct $name<'a $(, const $sides: usize)?> {
            $($field: $type),*
        }

        impl<$(const $sides: usize)?> NullaryFnOnce for $name<'_ $(, $sides)?> {
            type Output = $output;

            #[inline(always)]
            fn call(self) -> $output {
                let $name { $($field),* } = self;
                $body
            }
        }
    };
}

kernel!(Eliminate { front: &'a mut [f64], m: usize, p: usize, sign: f64 } -> bool, { eliminate(front, m, p, sign) });

kernel!(Forward<W> {
    panel: &'a [f64], m: usize, p: usize, sign: f64, x: &'a mut [[f64; W]], rest: &'a mut [[f64; W]]
} -> (), {
    for k in 0..p {
        let column = &panel[k * m..(k + 1) * m];
        let y = x[k].map(|x| x / column[k]);
        x[k] = y;
        subtract_sides(&mut x[k + 1..], &column[k + 1..p], y);
        subtract_sides(rest, &column[p..], y.map(|y| sign * y));
    }
});

kernel!(Backward<W> {
    panel: &'a [f64], m: usize, p: usize, sign: f64, x: &'a mut [[f64; W]], rest: &'a [[f64; W]]
} -> (), {
    for k in (0..p).rev() {
        let column = &panel[k * m..(k + 1) * m];
        let known = dot_sides(&column[p..], rest);
        // x holds the unsigned forward result from k up to here, the solution beyond.
        let later = dot_sides(&column[k + 1..p], &x[k + 1..]);
        for w in 0..W {
            x[k][w] = (sign * (x[k][w] - known[w]) - later[w]) / column[k];
        }
    }
});

kernel!(Multiply<W> { a: &'a [f64], x: &'a [[f64; W]], sign: f64, y: &'a mut [[f64; W]] } -> (), {
    for (column, x) in a.chunks_exact(y.len().max(1)).zip(x) {
        subtract_sides(y, column, x.map(|x| -sign * x));
    }
});

kernel!(MultiplyTransposed<W> { a: &'a [f64], x: &'a [[f64; W]], sign: f64, y: &'a mut [[f64; W]] } -> (), {
    for (column, y) in a.chunks_exact(x.len().max(1)).zip(y) {
        let product = dot_sides(column, x);
        for w in 0..W {
            y[w] += sign * product[w];
        }
    }
});

#[inline(always)]
fn subtract(y: &mut [f64], x: &[f64], factor: f64) {
    for (y, x) in y.iter_mut().zip(x) {
        *y = x.mul_add(-factor, *y);
    }
}

#[inline(always)]
fn subtract_sides<const W: usize>(y: &mut [[f64; W]], x: &[f64], factor: [f64; W]) {
    for (y, x) in y.iter_mut().zip(x) {
        for w in 0..W {
            y[w] = x.mul_add(-factor[w], y[w]);
        }
    }
}

/// Dot products of a column with W right-hand sides in eight strands, which a vector unit can keep apart.
#[inline(always)]
fn dot_sides<const W: usize>(a: &[f64], b: &[[f64; W]]) -> [f64; W] {
    let mut strands = [[0.0; W]; 8];
    let (mut a8, mut b8) = (a.chunks_exact(8), b.chunks_exact(8));
    for (a, b) in (&mut a8).zip(&mut b8) {
        for i in 0..8 {
            for w in 0..W {
                strands[i][w] = a[i].mul_add(b[i][w], strands[i][w]);
            }
        }
    }
    let mut sum = [0.0; W];
    for (a, b) in a8.remainder().iter().zip(b8.remainder()) {
        for w in 0..W {
            sum[w] += a * b[w];
        }
    }
    for w in 0..W {
        sum[w] += strands.iter().map(|strand| strand[w]).sum::<f64>();
    }
    sum
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
        // The columns behind, four at a time where that is possible; what falls above the diagonal is never read.
        let mut j = k + width;
        while j < m {
            let s = if j < p { 1.0 } else { sign };
            let (before, after) = f.split_at_mut(j * m);
            let source = |i: usize| &before[(k + i) * m + j..(k + i + 1) * m];
            if width == 4 && j + 4 <= m && (j >= p || j + 4 <= p) {
                let (t0, after) = after.split_at_mut(m);
                let (t1, after) = after.split_at_mut(m);
                let (t2, after) = after.split_at_mut(m);
                let sources = [source(0), source(1), source(2), source(3)];
                let factors = [0, 1, 2, 3].map(|q| sources.map(|c| -s * c[q]));
                let [s0, s1, s2, s3] = sources;
                update(&mut t0[j..], &mut t1[j..], &mut t2[j..], &mut after[j..m], s0, s1, s2, s3, &factors);
                j += 4;
            } else {
                let column = &mut after[j..m];
                for i in 0..width {
                    let a = source(i);
                    subtract(column, a, s * a[0]);
                }
                j += 1;
            }
        }
        k += width;
    }
    true
}

/// `t_q += sum_i factors[q][i] s_i`, four columns of four: each value read serves four times.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // slices of their own, so that the compiler knows them apart
fn update(
    t0: &mut [f64],
    t1: &mut [f64],
    t2: &mut [f64],
    t3: &mut [f64],
    s0: &[f64],
    s1: &[f64],
    s2: &[f64],
    s3: &[f64],
    factors: &[[f64; 4]; 4],
) {
    let n = t0.len();
    let (t1, t2, t3) = (&mut t1[..n], &mut t2[..n], &mut t3[..n]);
    let (s0, s1, s2, s3) = (&s0[..n], &s1[..n], &s2[..n], &s3[..n]);
    for r in 0..n {
        let s = [s0[r], s1[r], s2[r], s3[r]];
        let sum = |q: usize, t: f64| {
            let f = &factors[q];
            s[3].mul_add(f[3], s[2].mul_add(f[2], s[1].mul_add(f[1], s[0].mul_add(f[0], t))))
        };
        t0[r] = sum(0, t0[r]);
        t1[r] = sum(1, t1[r]);
        t2[r] = sum(2, t2[r]);
        t3[r] = sum(3, t3[r]);
    }
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
        let kernels = DenseKernels::default();
        for (n, p, sign) in [(1, 1, 1.0), (7, 3, 1.0), (7, 3, -1.0), (67, 30, 1.0), (60, 18, 1.0), (44, 9, -1.0)] {
            let a = quasi_definite(n, p, sign);
            let b: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
            let mut front = a.clone();
            assert!(kernels.eliminate(&mut front, n, p, sign));
            let (mut first, mut rest) = (b[..p].to_vec(), b[p..].to_vec());
            kernels.forward(&front, [n, p], sign, one_mut(&mut first), one_mut(&mut rest));
            // What remains is a positive definite system of its own.
            let q = n - p;
            let mut c: Vec<f64> = (0..q * q).map(|k| front[p + k % q + (p + k / q) * n]).collect();
            if q > 0 {
                assert!(kernels.eliminate(&mut c, q, q, 1.0));
                kernels.forward(&c, [q, q], 1.0, one_mut(&mut rest), &mut []);
                kernels.backward(&c, [q, q], 1.0, one_mut(&mut rest), &[]);
            }
            kernels.backward(&front, [n, p], sign, one_mut(&mut first), one(&rest));
            let x: Vec<f64> = first.into_iter().chain(rest).collect();
            for i in 0..n {
                let ax: f64 = (0..n).map(|j| a[i + j * n] * x[j]).sum();
                assert!((ax - b[i]).abs() < 1e-12, "row {i} of {n}: {ax} against {}", b[i]);
            }
        }
    }

    #[test]
    fn a_pivot_of_the_wrong_sign_is_refused() {
        let kernels = DenseKernels::default();
        assert!(!kernels.eliminate(&mut quasi_definite(9, 9, 1.0), 9, 9, -1.0));
        assert!(!kernels.eliminate(&mut quasi_definite(9, 4, -1.0), 9, 4, 1.0));
        assert!(!kernels.eliminate(&mut [f64::NAN; 4], 2, 2, 1.0));
    }

    #[test]
    fn products_are_products() {
        let kernels = DenseKernels::default();
        let a: Vec<f64> = (0..13 * 5).map(|i| (i as f64 * 0.7).cos()).collect();
        let x: Vec<f64> = (0..5).map(f64::from).collect();
        let mut y = vec![1.0; 13];
        kernels.multiply_add(&a, one(&x), 2.0, one_mut(&mut y));
        let mut z = vec![0.5; 5];
        kernels.multiply_transposed_add(&a, one(&y), -1.0, one_mut(&mut z));
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
