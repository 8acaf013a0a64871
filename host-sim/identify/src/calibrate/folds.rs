//! Least squares with a penalty by sums over folds: what a fit to all folds but one leaves in that one costs no pass
//! over the rows.

use flexspline_algebra::{Mat, cholesky};

use super::parts::{PartName, Scales, State, columns, weights};

/// A row to fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Row {
    pub at: State,
    /// What the prior leaves, arcsec.
    pub left_arcsec: f64,
    /// Which encoder zero, and which fold it belongs to.
    pub zero: usize,
    pub fold: usize,
}

/// A part with its penalty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Chosen {
    pub part: PartName,
    pub penalty: f64,
}

/// Sums over the rows of a fold.
struct Sums {
    gram: Vec<f64>,
    right: Vec<f64>,
    square: f64,
    rows: f64,
}

/// All folds.
pub(super) struct Folds {
    parts: Vec<PartName>,
    /// First column of each part, and the end.
    begins: Vec<usize>,
    weights: Vec<f64>,
    sums: Vec<Sums>,
}

/// What keeps a matrix definite where a column says nothing, of a row.
pub(super) const FLOOR: f64 = 1e-9;

impl Folds {
    /// Sums of all parts that may be fitted. With `own_zero` each fold has a zero of its own, found in it; else `zeros`
    /// of them are shared.
    pub fn new(rows: &[Row], parts: &[PartName], scales: &Scales, zeros: usize, own_zero: bool) -> Folds {
        let zeros = if own_zero { 0 } else { zeros };
        let (mut begins, mut all) = (Vec::new(), vec![0.0; zeros]);
        for part in parts {
            begins.push(all.len());
            all.extend(weights(*part));
        }
        begins.push(all.len());
        let width = all.len();
        let folds = rows.iter().map(|row| row.fold + 1).max().unwrap_or(0);
        let empty = || Sums { gram: vec![0.0; width * width], right: vec![0.0; width], square: 0.0, rows: 0.0 };
        let mut sums: Vec<Sums> = (0..folds).map(|_| empty()).collect();
        let mut means = vec![(vec![0.0; width], 0.0); folds];
        let mut x = Vec::with_capacity(width);
        for row in rows {
            x.clear();
            x.resize(zeros, 0.0);
            if zeros > 0 {
                x[row.zero] = 1.0;
            }
            parts.iter().for_each(|part| columns(*part, &row.at, scales, &mut x));
            let (sum, (mean, left)) = (&mut sums[row.fold], &mut means[row.fold]);
            for (i, a) in x.iter().enumerate() {
                sum.right[i] += a * row.left_arcsec;
                mean[i] += a;
                for (j, b) in x.iter().enumerate().take(i + 1) {
                    sum.gram[i * width + j] += a * b;
                }
            }
            sum.square += row.left_arcsec * row.left_arcsec;
            *left += row.left_arcsec;
            sum.rows += 1.0;
        }
        if own_zero {
            for (sum, (mean, left)) in sums.iter_mut().zip(&means).filter(|(sum, _)| sum.rows > 0.0) {
                for (i, a) in mean.iter().enumerate() {
                    sum.right[i] -= a * left / sum.rows;
                    for (j, b) in mean.iter().enumerate().take(i + 1) {
                        sum.gram[i * width + j] -= a * b / sum.rows;
                    }
                }
                sum.square -= left * left / sum.rows;
            }
        }
        Folds { parts: parts.to_vec(), begins, weights: all, sums }
    }

    pub fn parts(&self) -> &[PartName] {
        &self.parts
    }

    /// Folds that hold rows.
    pub fn all(&self) -> Vec<usize> {
        (0..self.sums.len()).filter(|fold| self.sums[*fold].rows > 0.0).collect()
    }

    /// Rows in some folds.
    pub fn rows(&self, folds: &[usize]) -> f64 {
        folds.iter().map(|fold| self.sums[*fold].rows).sum()
    }

    /// The columns of the parts chosen, those of the zeros first.
    fn places(&self, chosen: &[Chosen]) -> Vec<usize> {
        let of = |part: PartName| self.parts.iter().position(|other| *other == part);
        let zeros = 0..self.begins[0];
        let mut places: Vec<usize> = zeros.collect();
        for at in chosen.iter().filter_map(|chosen| of(chosen.part)) {
            places.extend(self.begins[at]..self.begins[at + 1]);
        }
        places
    }

    /// Coefficients of the zeros, then of each part chosen, fitted to some folds; those in `held`, counted without the
    /// zeros, keep the value given there, and the others are the best with them.
    pub fn fit(&self, folds: &[usize], chosen: &[Chosen], held: &[(usize, f64)]) -> Option<Vec<f64>> {
        let places = self.places(chosen);
        if places.is_empty() {
            return Some(Vec::new());
        }
        let width = self.weights.len();
        let rows = self.rows(folds);
        let penalty_of = |place: usize| {
            let at = self.begins.iter().rposition(|begin| *begin <= place)?;
            let part = self.parts.get(at)?;
            chosen.iter().find(|chosen| chosen.part == *part).map(|chosen| chosen.penalty)
        };
        let mut gram = Mat::zeros(places.len(), places.len());
        let mut right = Mat::zeros(places.len(), 1);
        for (i, a) in places.iter().enumerate() {
            for (j, b) in places.iter().enumerate().take(i + 1) {
                let (high, low) = (*a.max(b), *a.min(b));
                let sum: f64 = folds.iter().map(|fold| self.sums[*fold].gram[high * width + low]).sum();
                gram[(i, j)] = sum;
                gram[(j, i)] = sum;
            }
            let penalty = penalty_of(*a).unwrap_or(0.0) * self.weights[*a];
            gram[(i, i)] += (penalty + FLOOR) * rows;
            right[(i, 0)] = folds.iter().map(|fold| self.sums[*fold].right[*a]).sum();
        }
        for &(coefficient, value) in held {
            let of = self.begins[0] + coefficient;
            for i in 0..places.len() {
                right[(i, 0)] -= gram[(i, of)] * value;
                (gram[(i, of)], gram[(of, i)]) = (0.0, 0.0);
            }
            (gram[(of, of)], right[(of, 0)]) = (1.0, value);
        }
        let solved = cholesky(gram.as_ref()).ok()?.solve(right.as_ref());
        Some((0..places.len()).map(|i| solved[(i, 0)]).collect())
    }

    /// Coefficients of the parts chosen, fitted to all folds, some of them held.
    pub(crate) fn coefficients(&self, chosen: &[Chosen], held: &[(usize, f64)]) -> Option<Vec<f64>> {
        Some(self.fit(&self.all(), chosen, held)?.split_off(self.begins[0]))
    }

    /// Sum of squares, arcsec², that these coefficients leave in a fold.
    fn left(&self, fold: usize, chosen: &[Chosen], coefficients: &[f64]) -> f64 {
        let (places, width, sums) = (self.places(chosen), self.weights.len(), &self.sums[fold]);
        let mut left = sums.square;
        for (i, (a, ca)) in places.iter().zip(coefficients).enumerate() {
            left -= 2.0 * ca * sums.right[*a];
            for (j, (b, cb)) in places.iter().zip(coefficients).enumerate().take(i + 1) {
                let (high, low) = (*a.max(b), *a.min(b));
                left += if i == j { 1.0 } else { 2.0 } * ca * cb * sums.gram[high * width + low];
            }
        }
        left.max(0.0)
    }

    /// What a fit to `folds` leaves in another fold, arcsec².
    pub(crate) fn left_in(&self, fold: usize, folds: &[usize], chosen: &[Chosen]) -> f64 {
        self.fit(folds, chosen, &[]).map_or(f64::INFINITY, |coefficients| self.left(fold, chosen, &coefficients))
    }

    /// What fits to all of `folds` but one leave in that one, summed over all, arcsec².
    pub fn left_out(&self, folds: &[usize], chosen: &[Chosen]) -> f64 {
        let others = |fold: usize| -> Vec<usize> { folds.iter().copied().filter(|other| *other != fold).collect() };
        folds.iter().map(|fold| self.left_in(*fold, &others(*fold), chosen)).sum()
    }
}
