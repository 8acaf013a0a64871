//! Least squares with a penalty by sums over folds: what a fit to all folds but one leaves in that one costs no pass
//! over the rows. Which parts a unit has, and how smooth they are, is chosen by it.

use std::cell::RefCell;
use std::collections::HashMap;
use std::f64::consts::TAU;

use rayon::prelude::*;

use super::parts::{PartName, Scales, State, columns, weights};
use crate::linear::{Gram, Prior, solve};
use flexspline_design::tables::PARTS_OF_A_TURN;

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
    /// Its place among the loads of all rows that were looked at, and its line in the file.
    pub number: usize,
    pub line: u64,
}

/// A part with its penalty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Chosen {
    pub part: PartName,
    pub penalty: f64,
}

/// Folds, and places of parts with the bits of their penalties.
type Asked = (Vec<usize>, Vec<(Option<usize>, u64)>);

/// All folds.
pub(super) struct Folds {
    pub parts: Vec<PartName>,
    /// First column of each part, and the end.
    begins: Vec<usize>,
    weights: Vec<f64>,
    /// Rows in each fold, and the products of its columns.
    rows: Vec<f64>,
    sums: Vec<Gram>,
    /// Of a row: the curve over the output where nothing was recorded, as good as zero.
    unrecorded: Gram,
    /// What [`Folds::left_out`] found for folds, and parts with their penalties.
    found: RefCell<HashMap<Asked, f64>>,
}

/// Penalties that are tried, of a column's mean square. Below the least of them a curve is free to run away where
/// nothing was recorded: with a tenth of it the first eighth of the record of `examples/lara8` is missed by 120
/// arc-seconds by the others, with it by 25.
pub(super) const PENALTIES: [f64; 4] = [1e-4, 1e-3, 1e-2, 1e-1];
/// A part is kept if it takes at least this share of the squares left without it: one per cent of the error. Chosen on
/// the two records of `examples/`.
pub(crate) const LEAST_GAIN: f64 = 0.02;

/// Precision that keeps a matrix definite where a column says nothing, of a row.
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
        let folds = rows.iter().map(|row| row.fold + 1).max().unwrap_or(0);
        // One, the columns, and the value.
        let of_fold = |fold: usize| {
            let mut sum = Gram::none(all.len() + 2);
            let mut x = Vec::with_capacity(all.len() + 2);
            for row in rows.iter().filter(|row| row.fold == fold) {
                x.clear();
                x.push(1.0);
                x.extend((0..zeros).map(|log| f64::from(log == row.at.log)));
                parts.iter().for_each(|part| columns(*part, &row.at, scales, &mut x));
                x.push(row.left_arcsec);
                sum.add_row(&x, 1.0);
            }
            sum
        };
        let mut sums: Vec<Gram> = (0..folds).into_par_iter().map(of_fold).collect();
        let rows = sums.iter().map(|sum| sum.at(0, 0)).collect();
        let columns: Vec<usize> = (1..all.len() + 2).collect();
        sums.iter_mut().for_each(|sum| *sum = if own_zero { sum.first_free() } else { sum.among(&columns) });
        let unrecorded = unrecorded(parts, scales, &begins);
        Folds { parts: parts.to_vec(), begins, weights: all, rows, sums, unrecorded, found: RefCell::default() }
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
        gram.add(&self.unrecorded.among(&places), rows);
        folds.iter().for_each(|fold| gram.add(&self.sums[*fold].among(&places), 1.0));
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
        let of = |chosen: &Chosen| (self.parts.iter().position(|part| *part == chosen.part), chosen.penalty.to_bits());
        let mut parts: Vec<_> = chosen.iter().map(of).collect();
        parts.sort_unstable();
        // The choice asks again for what it has tried.
        let mut found = self.found.borrow_mut();
        *found.entry((folds.to_vec(), parts)).or_insert_with(|| {
            let others = |fold: usize| -> Vec<usize> { folds.iter().copied().filter(|other| *other != fold).collect() };
            folds.iter().map(|fold| self.left_in(*fold, &others(*fold), chosen)).sum()
        })
    }

    /// Parts chosen one after another, the best first, as long as each gains: none, the first, the first two, and so
    /// on.
    pub(super) fn path(&self, of: &[usize]) -> Vec<Vec<Chosen>> {
        let mut all = vec![Vec::new()];
        let mut chosen: Vec<Chosen> = Vec::new();
        let mut left = self.left_out(of, &chosen);
        loop {
            let open = self.parts.iter().filter(|part| chosen.iter().all(|chosen| chosen.part != **part));
            let tried = open.map(|part| self.best_penalty(of, &chosen, *part));
            let best = tried.min_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, with)| *with <= left * (1.0 - LEAST_GAIN));
            let Some((best, _)) = best else { return all };
            chosen.push(best);
            left = self.tuned(of, &mut chosen);
            all.push(chosen.clone());
        }
    }

    /// A further part with the penalty that leaves least.
    pub(super) fn best_penalty(&self, of: &[usize], chosen: &[Chosen], part: PartName) -> (Chosen, f64) {
        let with = |penalty: f64| {
            let further = Chosen { part, penalty };
            (further, self.left_out(of, &[chosen, &[further]].concat()))
        };
        let tried = PENALTIES.into_iter().map(with);
        tried.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((Chosen { part, penalty: 0.0 }, f64::INFINITY))
    }

    /// Sets each penalty anew beside the others; gives what is left.
    fn tuned(&self, of: &[usize], chosen: &mut [Chosen]) -> f64 {
        let mut left = self.left_out(of, chosen);
        for place in 0..chosen.len() {
            let others: Vec<Chosen> = (0..chosen.len()).filter(|k| *k != place).map(|k| chosen[k]).collect();
            (chosen[place], left) = self.best_penalty(of, &others, chosen[place].part);
        }
        left
    }

    /// Squares that the choice and the fit, both made without a fold, leave in that fold, summed over all folds,
    /// arcsec²: with no part at most, with one, and so on.
    pub(super) fn nested(&self) -> Vec<f64> {
        let all = self.all();
        let mut left = vec![0.0; self.parts.len() + 1];
        for fold in &all {
            let others: Vec<usize> = all.iter().copied().filter(|other| other != fold).collect();
            let path = self.path(&others);
            let mut last = 0.0;
            for (most, left) in left.iter_mut().enumerate() {
                if let Some(chosen) = path.get(most) {
                    last = self.left_in(*fold, &others, chosen);
                }
                *left += last;
            }
        }
        left
    }
}

/// Products of the curve over the output in parts of its turn far from rows, for each row there is: they count as if
/// zero had been recorded there, as often as rows were recorded elsewhere. Waves that are fitted to a part of the turn
/// swing in the rest of it.
fn unrecorded(parts: &[PartName], scales: &Scales, begins: &[usize]) -> Gram {
    let width = begins.last().copied().unwrap_or(0);
    let mut gram = Gram::none(width + 1);
    let Some(curve) = parts.iter().position(|part| *part == PartName::OutputAngle) else { return gram };
    let weight = 1.0 / (PARTS_OF_A_TURN - scales.unrecorded.count_ones() as usize).max(1) as f64;
    let mut x = Vec::with_capacity(width + 1);
    for part in (0..PARTS_OF_A_TURN).filter(|part| scales.unrecorded >> part & 1 == 1) {
        let output_rad = TAU * (part as f64 + 0.5) / PARTS_OF_A_TURN as f64;
        x.clear();
        x.resize(begins[curve], 0.0);
        columns(PartName::OutputAngle, &State { output_rad, ..State::default() }, scales, &mut x);
        x.resize(width + 1, 0.0);
        gram.add_row(&x, weight);
    }
    gram
}
