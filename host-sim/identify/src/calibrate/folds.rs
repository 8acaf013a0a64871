//! Least squares with a penalty by sums over folds: what a fit to all folds but one leaves in that one costs no pass
//! over the rows.

use std::f64::consts::TAU;

use super::parts::{OUTPUT_ORDERS, PartName, Scales, State, columns, output_slopes, weights};
use crate::linear::{Gram, Prior, solve};

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

/// All folds.
pub(super) struct Folds {
    pub parts: Vec<PartName>,
    /// First column of each part, and the end.
    begins: Vec<usize>,
    weights: Vec<f64>,
    /// Rows in each fold, and the products of its columns.
    rows: Vec<f64>,
    sums: Vec<Gram>,
    /// Of a row: the slopes of the curve over the output where nothing was recorded.
    slopes: Gram,
}

/// Precision that keeps a matrix definite where a column says nothing, of a row.
pub(super) const FLOOR: f64 = 1e-9;

/// Penalty of the square of a slope, per rad², where nothing was recorded: the curve over the output then goes nearly
/// straight from one end of what was recorded to the other, where free waves swing. Chosen on made encoders of one and
/// two waves, a fifth to 41 % of a turn recorded: a tenth of it swings as free waves do, ten times as much bends the
/// ends.
const STRAIGHT: f64 = 1e-3;
/// Two periods of the highest wave: over a narrower gap the values and slopes at its ends hold the waves. Derived.
const HELD_GAP_RAD: f64 = 2.0 * TAU / OUTPUT_ORDERS as f64;
/// Places at which the slope is asked for.
const PLACES: usize = 72;

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
        let folds = rows.iter().map(|row| row.fold + 1).max().unwrap_or(0);
        // One, the columns, and the value.
        let mut sums = vec![Gram::none(all.len() + 2); folds];
        let mut x = Vec::with_capacity(all.len() + 2);
        for row in rows {
            x.clear();
            x.push(1.0);
            x.extend((0..zeros).map(|log| f64::from(log == row.at.log)));
            parts.iter().for_each(|part| columns(*part, &row.at, scales, &mut x));
            x.push(row.left_arcsec);
            sums[row.fold].add_row(&x, 1.0);
        }
        let rows = sums.iter().map(|sum| sum.at(0, 0)).collect();
        let columns: Vec<usize> = (1..all.len() + 2).collect();
        sums.iter_mut().for_each(|sum| *sum = if own_zero { sum.first_free() } else { sum.among(&columns) });
        let mut slopes = Gram::none(all.len() + 1);
        let [begin, width] = scales.output_gap_rad;
        let curve = parts.iter().position(|part| *part == PartName::OutputAngle).filter(|_| width > HELD_GAP_RAD);
        for (at, k) in curve.into_iter().flat_map(|at| (0..PLACES).map(move |k| (at, k))) {
            let mut x = vec![0.0; all.len() + 1];
            let place = begin + width * (k as f64 + 0.5) / PLACES as f64;
            x[begins[at]..begins[at + 1]].copy_from_slice(&output_slopes(place));
            slopes.add_row(&x, STRAIGHT * width / TAU / PLACES as f64);
        }
        Folds { parts: parts.to_vec(), begins, weights: all, rows, sums, slopes }
    }

    /// Folds that hold rows.
    pub fn all(&self) -> Vec<usize> {
        (0..self.rows.len()).filter(|fold| self.rows[*fold] > 0.0).collect()
    }

    /// Rows in some folds.
    pub fn rows(&self, folds: &[usize]) -> f64 {
        folds.iter().map(|fold| self.rows[*fold]).sum()
    }

    /// The columns of the zeros, of the parts chosen, and the value; the penalties of all but the last.
    fn places(&self, chosen: &[Chosen]) -> (Vec<usize>, Vec<f64>) {
        let (mut places, mut penalties): (Vec<usize>, Vec<f64>) = (0..self.begins[0]).map(|zero| (zero, 0.0)).unzip();
        for chosen in chosen {
            let Some(at) = self.parts.iter().position(|part| *part == chosen.part) else { continue };
            let columns = self.begins[at]..self.begins[at + 1];
            penalties.extend(self.weights[columns.clone()].iter().map(|weight| chosen.penalty * weight));
            places.extend(columns);
        }
        places.push(self.weights.len());
        (places, penalties)
    }

    /// Coefficients of the zeros, then of each part chosen, fitted to some folds; those in `held`, counted without the
    /// zeros, keep the value given there, and the others are the best with them.
    pub fn fit(&self, folds: &[usize], chosen: &[Chosen], held: &[(usize, f64)]) -> Option<Vec<f64>> {
        let ((places, penalties), rows) = (self.places(chosen), self.rows(folds));
        let mut gram = Gram::none(places.len());
        folds.iter().for_each(|fold| gram.add_among(&self.sums[*fold], &places));
        gram.add(&self.slopes.among(&places), rows);
        let prior = |penalty: &f64| Prior { mean: 0.0, std: ((penalty + FLOOR) * rows).sqrt().recip() };
        let mut priors: Vec<Prior> = penalties.iter().map(prior).collect();
        for &(coefficient, mean) in held {
            priors[self.begins[0] + coefficient] = Prior { mean, std: 0.0 };
        }
        Some(solve(&gram, &priors, 1.0)?.coefficients)
    }

    /// Coefficients of the parts chosen, fitted to all folds, some of them held.
    pub(crate) fn coefficients(&self, chosen: &[Chosen], held: &[(usize, f64)]) -> Option<Vec<f64>> {
        Some(self.fit(&self.all(), chosen, held)?.split_off(self.begins[0]))
    }

    /// Residual of a fit to `folds` in another fold, arcsec².
    pub(crate) fn left_in(&self, fold: usize, folds: &[usize], chosen: &[Chosen]) -> f64 {
        let left = |coefficients: Vec<f64>| self.sums[fold].among(&self.places(chosen).0).left_by(&coefficients);
        self.fit(folds, chosen, &[]).map_or(f64::INFINITY, left)
    }

    /// Residual of fits to all of `folds` but one in that one, summed over all, arcsec².
    pub fn left_out(&self, folds: &[usize], chosen: &[Chosen]) -> f64 {
        let others = |fold: usize| -> Vec<usize> { folds.iter().copied().filter(|other| *other != fold).collect() };
        folds.iter().map(|fold| self.left_in(*fold, &others(*fold), chosen)).sum()
    }
}
