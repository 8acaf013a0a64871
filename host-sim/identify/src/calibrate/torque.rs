//! How good a torque from the wind-up would be: in rows that took no part in the fit.

use serde::Serialize;

use super::folds::{Folds, Row};
use super::parts::State;
use super::prior::Prior;
use super::rows::{FoldKind, Rows};
use super::{Model, ROWS_OF_A_WIDTH};
use crate::measurement::quantile_of;
use crate::wind_up::load_of;
use flexspline_base::robust::rms;
use flexspline_base::statistics::mean;

/// Share of the rows whose interval is to hold their torque, by definition.
pub(crate) const INSIDE: f64 = 0.95;

/// Torque from the wind-up against that recorded, rows in steady motion, each by a fit without its fold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WindUpTorque {
    /// Difference, N·m rms.
    pub rms_n_m: f64,
    /// Its mean, N·m.
    pub bias_n_m: f64,
    /// Share of the rows whose torque lies inside its interval.
    pub inside: f64,
    /// Rows.
    pub rows: usize,
    /// Half width of the error that the intervals are of, arcsec: where 95 of 100 rows of the other folds lie.
    pub half_width_arcsec: f64,
}

/// A row that was left out of a fit.
struct LeftOut<'a> {
    row: &'a Row,
    model: &'a Model,
    /// What the fit leaves of it, arcsec.
    left_arcsec: f64,
}

impl WindUpTorque {
    /// None where the output does not give way to the load.
    pub(super) fn of(rows: &Rows, folds: &Folds, model: &Model, prior: &Prior<'_>) -> Option<Self> {
        let range @ [low, high] = model.scales.torque_n_m;
        if model.under_arcsec(high, prior) <= model.under_arcsec(low, prior) {
            return None;
        }
        let all = folds.all();
        let fit_without = |fold: usize| {
            let others: Vec<usize> = all.iter().copied().filter(|other| *other != fold).collect();
            let mut zeros = folds.fit(&others, &model.chosen, &[])?;
            let coefficients = zeros.split_off(zeros.len() - model.coefficients.len());
            Some((fold, zeros, Model { coefficients, ..model.clone() }))
        };
        let fits = all.iter().map(|fold| fit_without(*fold)).collect::<Option<Vec<_>>>()?;
        let every = rows.rows.len().div_ceil(ROWS_OF_A_WIDTH).max(1);
        let mut left_out: Vec<LeftOut<'_>> = Vec::new();
        for (fold, zeros, model) in &fits {
            let of_fold = rows.rows.iter().step_by(every).filter(|row| row.fold == *fold);
            let left = |row: &Row| row.left_arcsec - model.adds_arcsec(&row.at);
            // A log that was left out whole has its zero from nowhere else.
            let own = |log: usize| mean(&of_fold.clone().filter(|row| row.at.log == log).map(left).collect::<Vec<_>>());
            let zeros: Vec<f64> = match rows.folds {
                FoldKind::Files => (0..rows.means_arcsec.len()).map(own).collect(),
                FoldKind::Blocks => zeros.clone(),
            };
            let left_out_of = |row| LeftOut { row, model, left_arcsec: left(row) - zeros[row.at.log] };
            left_out.extend(of_fold.clone().map(left_out_of));
        }
        let half_width = |fold: usize| {
            let others = left_out.iter().filter(|left| left.row.fold != fold);
            quantile_of(&mut others.map(|left| left.left_arcsec.abs()).collect::<Vec<f64>>(), INSIDE)
        };
        let half_widths: Vec<(usize, f64)> = all.iter().map(|fold| (*fold, half_width(*fold))).collect();
        let (mut off, mut inside) = (Vec::new(), 0.0);
        for (fold, half_width) in &half_widths {
            for LeftOut { row, model, left_arcsec } in left_out.iter().filter(|left| left.row.fold == *fold) {
                let says = |torque_n_m: f64| model.says_arcsec(&State { torque_n_m, ..row.at }, prior);
                let recorded = row.at.torque_n_m;
                let error = says(recorded) + left_arcsec;
                off.push(load_of(says, range, error) - recorded);
                let [least, most] = [-half_width, *half_width].map(|by| load_of(says, range, error + by));
                inside += f64::from((least..=most).contains(&recorded));
            }
        }
        Some(WindUpTorque {
            rms_n_m: rms(&off),
            bias_n_m: mean(&off),
            inside: inside / off.len().max(1) as f64,
            rows: off.len(),
            half_width_arcsec: mean(&half_widths.iter().map(|(_, half_width)| *half_width).collect::<Vec<f64>>()),
        })
    }
}
