//! Least squares with a penalty by sums over folds: what a fit to all folds but one leaves in that one costs no pass
//! over the rows.

use flexspline_algebra::{Mat, cholesky};

use super::parts::{PartName, Scales, State, columns, weights};

/// A row to fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Row {
    pub at: State,
    /// Measured error, the mean of its log taken out, arcsec.
    pub measured_arcsec: f64,
    /// Residual of that with the prior, arcsec.
    pub left_arcsec: f64,
    /// Which fold it belongs to.
    pub fold: usize,
}

/// A part with its penalty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Chosen {
    pub part: PartName,
    pub penalty: f64,
}

/// Sums over the rows of a fold, or of a log.
#[derive(Debug, Clone)]
pub(super) struct Sums {
    /// Rows by their weights.
    rows: f64,
    /// Columns, and what the prior leaves.
    columns: Vec<f64>,
    left: f64,
    /// Products of columns with each other (lower triangle), of each with what is left, and the square of that.
    gram: Vec<f64>,
    right: Vec<f64>,
    square: f64,
}

impl Sums {
    pub fn new(width: usize) -> Sums {
        let (columns, right, gram) = (vec![0.0; width], vec![0.0; width], vec![0.0; width * width]);
        Sums { rows: 0.0, columns, left: 0.0, gram, right, square: 0.0 }
    }

    /// Adds a row that counts `weight` times.
    pub fn add(&mut self, x: &[f64], left: f64, weight: f64) {
        for (i, a) in x.iter().enumerate() {
            let a = weight * a;
            self.columns[i] += a;
            self.right[i] += a * left;
            let row = &mut self.gram[i * x.len()..];
            row.iter_mut().zip(&x[..=i]).for_each(|(sum, b)| *sum += a * b);
        }
        self.rows += weight;
        self.left += weight * left;
        self.square += weight * left * left;
    }

    /// Adds rows with the same zero.
    pub fn join(&mut self, other: &Sums) {
        let of = [(&mut self.columns, &other.columns), (&mut self.gram, &other.gram), (&mut self.right, &other.right)];
        of.into_iter().flat_map(|(a, b)| a.iter_mut().zip(b)).for_each(|(a, b)| *a += b);
        self.rows += other.rows;
        self.left += other.left;
        self.square += other.square;
    }

    /// The same where the zero is found in these rows.
    fn with_own_zero(mut self) -> Sums {
        let width = self.columns.len();
        for i in (0..width).filter(|_| self.rows > 0.0) {
            self.right[i] -= self.columns[i] * self.left / self.rows;
            for j in 0..=i {
                self.gram[i * width + j] -= self.columns[i] * self.columns[j] / self.rows;
            }
        }
        self.square -= if self.rows > 0.0 { self.left * self.left / self.rows } else { 0.0 };
        self
    }

    /// Adds the information on the coefficients, the zero of the rows not known.
    pub fn add_information(&self, to: &mut Mat) {
        let own = self.clone().with_own_zero();
        for (i, j) in (0..self.columns.len()).flat_map(|i| (0..=i).map(move |j| (i, j))) {
            to[(i, j)] += own.gram[i * self.columns.len() + j];
            to[(j, i)] = to[(i, j)];
        }
    }
}

/// All folds.
pub(super) struct Folds {
    parts: Vec<PartName>,
    /// First column of each part, and the end.
    begins: Vec<usize>,
    weights: Vec<f64>,
    sums: Vec<Sums>,
}

/// Diagonal that keeps a matrix definite where a column says nothing, of a row.
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
        let mut sums = vec![Sums::new(width); folds];
        let mut x = Vec::with_capacity(width);
        for row in rows {
            x.clear();
            x.resize(zeros, 0.0);
            if zeros > 0 {
                x[row.at.log] = 1.0;
            }
            parts.iter().for_each(|part| columns(*part, &row.at, scales, &mut x));
            sums[row.fold].add(&x, row.left_arcsec, 1.0);
        }
        if own_zero {
            sums = sums.into_iter().map(Sums::with_own_zero).collect();
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

    /// Residual of a fit to `folds` in another fold, arcsec².
    pub(crate) fn left_in(&self, fold: usize, folds: &[usize], chosen: &[Chosen]) -> f64 {
        self.fit(folds, chosen, &[]).map_or(f64::INFINITY, |coefficients| self.left(fold, chosen, &coefficients))
    }

    /// Residual of fits to all of `folds` but one in that one, summed over all, arcsec².
    pub fn left_out(&self, folds: &[usize], chosen: &[Chosen]) -> f64 {
        let others = |fold: usize| -> Vec<usize> { folds.iter().copied().filter(|other| *other != fold).collect() };
        folds.iter().map(|fold| self.left_in(*fold, &others(*fold), chosen)).sum()
    }
}
