//! Dense kernels for fronts of some tens of unknowns, column-major, lower triangle.
//!
//! At this size the calls of a general library cost as much as the arithmetic; these loops are compiled for the vector
//! unit that the machine has (pulp).

use pulp::{Scalar, Simd, WithSimd};

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
    ($name:ident $(<$sides:ident>)? { $($field:ident: $type:ty),* } -> $output:ty, |$simd:ident| $body:expr) => {
        pub(crate) struct $name<'a $(, const $sides: usize)?> {
            $(pub(crate) $field: $type),*
        }

        impl<$(const $sides: usize)?> WithSimd for $name<'_ $(, $sides)?> {
            type Output = $output;

            #[inline(always)]
            fn with_simd<S: Simd>(self, $simd: S) -> $output {
                let $name { $($field),* } = self;
                $body
            }
        }
    };
}
pub(crate) use kernel;

// Eliminates the first unknowns of a symmetric m x m front whose pivot block has the given sign (+1 or −1 definite):
//
//   [ A  B^T ]    sign A = L L^T,  P = B L^-T:    [ L              ]
//   [ B   C  ] ->                                 [ P  C - sign P P^T ]
//
// False when the pivot block does not have that sign. `panel` has the columns that are eliminated, `rest` the others.
kernel!(Eliminate { panel: &'a mut [f64], rest: &'a mut [f64], m: usize, sign: f64 } -> bool, |simd| {
    assert!(panel.len() + rest.len() == m * m && panel.len().is_multiple_of(m));
    let p = panel.len() / m;
    let negate = |part: &mut [f64]| part.iter_mut().for_each(|x| *x = -*x);
    if sign < 0.0 {
        (0..p).for_each(|k| negate(&mut panel[k * m + k..k * m + p]));
        negate(rest);
    }
    // Rows from j on in whole vectors, which begin above the diagonal where need be: what lies there is never read.
    let above = |j: usize| m.checked_sub((m - j).next_multiple_of(8)).unwrap_or(j);
    for j in (0..p).step_by(4).chain((p..m).step_by(4)) {
        let end = (j + 4).min(if j < p { p } else { m });
        let (solved, others) = panel.split_at_mut(j.min(p) * m);
        let columns = if j < p { &mut others[..(end - j) * m] } else { &mut rest[(j - p) * m..(end - p) * m] };
        if end == j + 4 {
            subtract_products::<S, 4>(simd, solved, columns, m, [j, above(j)]);
        } else {
            for (column, j) in columns.chunks_exact_mut(m).zip(j..) {
                subtract_products::<S, 1>(simd, solved, column, m, [j, above(j)]);
            }
        }
        for c in j..end.min(p) {
            let (before, column) = columns.split_at_mut((c - j) * m);
            for other in before.chunks_exact(m) {
                subtract_sides(one_mut(&mut column[above(c)..m]), &other[above(c)..], [other[c]]);
            }
            let pivot = column[c];
            if !(pivot > 0.0 && pivot.is_finite()) {
                return false;
            }
            let scale = 1.0 / pivot.sqrt();
            column[above(c)..m].iter_mut().for_each(|x| *x *= scale);
        }
    }
    if sign < 0.0 {
        negate(rest);
    }
    true
});

// Solves with an eliminated panel (the first columns of the front): `x` becomes `L^-1 x`, `rest` loses
// `sign P L^-1 x`. As everywhere below W right-hand sides lie beside one another: what is read of a matrix serves for
// all of them.
kernel!(Forward<W> {
    panel: &'a [f64], sign: f64, x: &'a mut [[f64; W]], rest: &'a mut [[f64; W]]
} -> (), |simd| {
    let (p, m) = (x.len(), x.len() + rest.len());
    assert!(panel.len() >= m * p);
    for k in (0..p).step_by(4) {
        let end = (k + 4).min(p);
        for c in k..end {
            let column = &panel[c * m..(c + 1) * m];
            x[c] = x[c].map(|x| x / column[c]);
            let y = x[c];
            subtract_sides(&mut x[c + 1..end], &column[c + 1..end], y);
        }
        let (solved, later) = x.split_at_mut(end);
        subtract_columns(simd, later, &panel[k * m..end * m], m, end, &solved[k..], 1.0);
    }
    subtract_columns(simd, rest, panel, m, p, x, sign);
});

// The other way: `x` (as `Forward` left it) becomes the solution, `rest` being solved.
kernel!(Backward<W> {
    panel: &'a [f64], sign: f64, x: &'a mut [[f64; W]], rest: &'a [[f64; W]]
} -> (), |_simd| {
    let (p, m) = (x.len(), x.len() + rest.len());
    assert!(panel.len() >= m * p);
    for k in (0..p).rev() {
        let column = &panel[k * m..(k + 1) * m];
        let known = dot_sides(&column[p..], rest);
        // x holds the unsigned forward result from k up to here, the solution beyond.
        let later = dot_sides(&column[k + 1..p], &x[k + 1..]);
        let forward = x[k];
        x[k] = std::array::from_fn(|w| (sign * (forward[w] - known[w]) - later[w]) / column[k]);
    }
});

// `y += sign A x` for a column-major matrix with `y.len()` rows.
kernel!(Multiply<W> { a: &'a [f64], x: &'a [[f64; W]], sign: f64, y: &'a mut [[f64; W]] } -> (), |simd| {
    assert!(a.len() >= y.len() * x.len());
    let m = y.len();
    subtract_columns(simd, y, a, m, 0, x, -sign);
});

// `y += sign A^T x` for a column-major matrix with `x.len()` rows.
kernel!(MultiplyTransposed<W> { a: &'a [f64], x: &'a [[f64; W]], sign: f64, y: &'a mut [[f64; W]] } -> (), |_simd| {
    assert!(a.len() >= y.len() * x.len());
    for (column, y) in a.chunks_exact(x.len().max(1)).zip(y) {
        let product = dot_sides(column, x);
        for w in 0..W {
            y[w] += sign * product[w];
        }
    }
});

/// Takes `sum_k solved_k solved_k[j + q]` from column q of Q, rows from `row` on; all columns have m rows.
#[inline(always)]
fn subtract_products<S: Simd, const Q: usize>(simd: S, solved: &[f64], columns: &mut [f64], m: usize, at: [usize; 2]) {
    let at = subtract_tiles::<S, Q, 2>(simd, solved, columns, m, at);
    let at = subtract_tiles::<S, Q, 1>(simd, solved, columns, m, at);
    subtract_tiles::<Scalar, Q, 1>(Scalar::new(), solved, columns, m, at);
}

/// The same for as many rows at a time as V vectors have, which stay in registers; where it ends.
#[inline(always)]
fn subtract_tiles<S: Simd, const Q: usize, const V: usize>(
    simd: S,
    solved: &[f64],
    columns: &mut [f64],
    m: usize,
    [j, mut row]: [usize; 2],
) -> [usize; 2] {
    while row + V * S::F64_LANES <= m {
        let rows = row..row + V * S::F64_LANES;
        let mut sums = [[simd.splat_f64s(0.0); V]; Q];
        for (sums, column) in sums.iter_mut().zip(columns.chunks_exact(m)) {
            sums.copy_from_slice(S::as_simd_f64s(&column[rows.clone()]).0);
        }
        for source in solved.chunks_exact(m) {
            let values = S::as_simd_f64s(&source[rows.clone()]).0;
            for (sums, by) in sums.iter_mut().zip(&source[j..j + Q]) {
                let by = simd.splat_f64s(-by);
                sums.iter_mut().zip(values).for_each(|(sum, value)| *sum = simd.mul_add_f64s(*value, by, *sum));
            }
        }
        for (sums, column) in sums.iter().zip(columns.chunks_exact_mut(m)) {
            S::as_mut_simd_f64s(&mut column[rows.clone()]).0.copy_from_slice(sums);
        }
        row = rows.end;
    }
    [j, row]
}

/// `y -= sign A x` for the rows of a column-major matrix (m rows) from `first` on.
#[inline(always)]
fn subtract_columns<S: Simd, const W: usize>(
    simd: S,
    y: &mut [[f64; W]],
    a: &[f64],
    m: usize,
    first: usize,
    x: &[[f64; W]],
    sign: f64,
) {
    if W > 1 {
        let (eights, others) = y.as_chunks_mut::<8>();
        let (fours, ones) = others.as_chunks_mut::<4>();
        let [after_eights, after_fours] = [first + 8 * eights.len(), first + 8 * eights.len() + 4 * fours.len()];
        subtract_rows(eights, a, [m, first], x, sign);
        subtract_rows(fours, a, [m, after_eights], x, sign);
        return subtract_rows(ones.as_chunks_mut::<1>().0, a, [m, after_fours], x, sign);
    }
    let y = y.as_flattened_mut();
    let rows = y.len();
    let column = |k: usize| &a[k * m + first..][..rows];
    let (fours, others) = x.as_flattened().as_chunks::<4>();
    for (k, x) in fours.iter().enumerate() {
        subtract_four(simd, y, [0, 1, 2, 3].map(|i| column(4 * k + i)), x.map(|x| sign * x));
    }
    for (k, x) in others.iter().enumerate() {
        subtract_sides(one_mut(y), column(4 * fours.len() + k), [sign * x]);
    }
}

/// The same for several right-hand sides: R rows at a time, which stay in registers while all columns pass.
#[inline(always)]
fn subtract_rows<const R: usize, const W: usize>(
    tiles: &mut [[[f64; W]; R]],
    a: &[f64],
    [m, first]: [usize; 2],
    x: &[[f64; W]],
    sign: f64,
) {
    for (tile, first) in tiles.iter_mut().zip((first..).step_by(R)) {
        let mut sums = *tile;
        for (x, column) in x.iter().zip(a[first..].chunks(m)) {
            let column = &column[..R];
            for r in 0..R {
                for w in 0..W {
                    sums[r][w] = column[r].mul_add(-(sign * x[w]), sums[r][w]);
                }
            }
        }
        *tile = sums;
    }
}

/// `y -= sum_i factors[i] columns[i]`, as many rows as fill vectors at once: what is read and written of y serves all
/// four.
#[inline(always)]
fn subtract_four<S: Simd>(simd: S, y: &mut [f64], columns: [&[f64]; 4], factors: [f64; 4]) {
    let (vectors, rest) = S::as_mut_simd_f64s(y);
    let [a, b, c, d] = columns.map(|column| S::as_simd_f64s(column));
    let by = factors.map(|f| simd.splat_f64s(-f));
    for ((((y, a), b), c), d) in vectors.iter_mut().zip(a.0).zip(b.0).zip(c.0).zip(d.0) {
        let sum = simd.mul_add_f64s(*b, by[1], simd.mul_add_f64s(*a, by[0], *y));
        *y = simd.mul_add_f64s(*d, by[3], simd.mul_add_f64s(*c, by[2], sum));
    }
    for ((((y, a), b), c), d) in rest.iter_mut().zip(a.1).zip(b.1).zip(c.1).zip(d.1) {
        let sum = b.mul_add(-factors[1], a.mul_add(-factors[0], *y));
        *y = d.mul_add(-factors[3], c.mul_add(-factors[2], sum));
    }
}

/// `y += x`.
#[inline(always)]
pub(super) fn add<S: Simd>(simd: S, y: &mut [f64], x: &[f64]) {
    let (vectors, rest) = S::as_mut_simd_f64s(y);
    let (x, last) = S::as_simd_f64s(x);
    vectors.iter_mut().zip(x).for_each(|(y, x)| *y = simd.add_f64s(*y, *x));
    rest.iter_mut().zip(last).for_each(|(y, x)| *y += x);
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

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::Arch;

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
        let arch = Arch::new();
        for (n, p, sign) in [(1, 1, 1.0), (7, 3, 1.0), (7, 3, -1.0), (67, 30, 1.0), (60, 18, 1.0), (44, 9, -1.0)] {
            let a = quasi_definite(n, p, sign);
            let b: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
            let mut front = a.clone();
            let (panel, rest) = front.split_at_mut(n * p);
            assert!(arch.dispatch(Eliminate { panel, rest, m: n, sign }));
            let (mut first, mut rest) = (b[..p].to_vec(), b[p..].to_vec());
            arch.dispatch(Forward { panel: &front, sign, x: one_mut(&mut first), rest: one_mut(&mut rest) });
            // What remains is a positive definite system of its own.
            let q = n - p;
            let mut c: Vec<f64> = (0..q * q).map(|k| front[p + k % q + (p + k / q) * n]).collect();
            if q > 0 {
                assert!(arch.dispatch(Eliminate { panel: &mut c, rest: &mut [], m: q, sign: 1.0 }));
                arch.dispatch(Forward { panel: &c, sign: 1.0, x: one_mut(&mut rest), rest: &mut [] });
                arch.dispatch(Backward { panel: &c, sign: 1.0, x: one_mut(&mut rest), rest: &[] });
            }
            arch.dispatch(Backward { panel: &front, sign, x: one_mut(&mut first), rest: one(&rest) });
            let x: Vec<f64> = first.into_iter().chain(rest).collect();
            for i in 0..n {
                let ax: f64 = (0..n).map(|j| a[i + j * n] * x[j]).sum();
                assert!((ax - b[i]).abs() < 1e-12, "row {i} of {n}: {ax} against {}", b[i]);
            }
        }
    }

    #[test]
    fn a_pivot_of_the_wrong_sign_is_refused() {
        let arch = Arch::new();
        assert!(!arch.dispatch(Eliminate { panel: &mut quasi_definite(9, 9, 1.0), rest: &mut [], m: 9, sign: -1.0 }));
        let mut front = quasi_definite(9, 4, -1.0);
        let (panel, rest) = front.split_at_mut(9 * 4);
        assert!(!arch.dispatch(Eliminate { panel, rest, m: 9, sign: 1.0 }));
        assert!(!arch.dispatch(Eliminate { panel: &mut [f64::NAN; 4], rest: &mut [], m: 2, sign: 1.0 }));
    }

    #[test]
    fn products_are_products() {
        let arch = Arch::new();
        let a: Vec<f64> = (0..13 * 5).map(|i| (i as f64 * 0.7).cos()).collect();
        let x: Vec<f64> = (0..5).map(f64::from).collect();
        let mut y = vec![1.0; 13];
        arch.dispatch(Multiply { a: &a, x: one(&x), sign: 2.0, y: one_mut(&mut y) });
        let mut z = vec![0.5; 5];
        arch.dispatch(MultiplyTransposed { a: &a, x: one(&y), sign: -1.0, y: one_mut(&mut z) });
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
