//! How good a torque from the wind-up would be: in rows that took no part in the fit. With a hysteresis by load where
//! that gains.

use std::path::Path;

use flexspline::Table;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::folds::{Folds, Row};
use super::parts::State;
use super::prior::Prior;
use super::rows::{FoldKind, Rows};
use super::{LEAST_GAIN, Model, ROUNDING_ARCSEC};
use crate::linear::{self, Gram, solve};
use crate::measurement::{Recording, quantile_of};
use crate::replay::measured_rows;
use crate::wind_up::{HeldTorques, Hysteresis, along, load_of};
use flexspline_base::robust::rms;
use flexspline_base::statistics::mean;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::tables::SlipSpring;

/// Share of the rows whose interval is to hold their torque, by definition.
pub(crate) const INSIDE: f64 = 0.95;
/// Torques at which springs slip, of the largest recorded: each twice the one before, up to half, as a loop of a spring
/// that slips later is not closed. *Guess*.
const SLIPS: [f64; 5] = [1.0 / 32.0, 1.0 / 16.0, 0.125, 0.25, 0.5];
/// What a spring holds at most before rows say anything, arcsec: far beyond any, so that rows decide. *Guess*.
const ANY_ARCSEC: f64 = 1e4;

/// Torque from the wind-up against that recorded, rows in steady motion, each by a fit without its fold.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WindUpTorque {
    /// Difference, N·m rms.
    pub rms_n_m: f64,
    /// Its mean, N·m.
    pub bias_n_m: f64,
    /// Share of the rows whose torque lies inside its interval.
    pub inside: f64,
    /// Rows.
    pub rows: usize,
    /// Half width of the error that the intervals are of, arcsec: where 95 of 100 rows of the other folds lie, and of
    /// all rows.
    pub half_width_arcsec: f64,
    /// Hysteresis that the torques are read with, if they are better with one: no table holds it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hysteresis: Option<Hysteresis>,
}

/// A number for each spring.
type Held = [f64; SLIPS.len()];

/// A fit to all folds but one: zeros of the logs, the model, and what goes in addition.
type FitWithout = (Vec<f64>, Model, Hysteresis);

/// What the springs hold in each row by the torque recorded, over what each can.
fn held_by(rows: &[Row], widths_n_m: Held) -> Vec<Held> {
    let (mut held, mut log) = (HeldTorques::default(), 0);
    let of_row = |row: &Row| {
        if row.at.log != log {
            (held, log) = (HeldTorques::default(), row.at.log);
        }
        held.follow(row.at.torque_n_m, widths_n_m);
        std::array::from_fn(|k| held.by_spring[k] / widths_n_m[k])
    };
    rows.iter().map(of_row).collect()
}

/// Hysteresis in what a model leaves of some rows, each log with a zero of its own. The output lags: a spring with
/// which it would lead gets nothing.
fn hysteresis_in(
    rows: &[Row],
    held: &[Held],
    widths_n_m: Held,
    left: impl Fn(&Row) -> Option<f64>,
) -> Option<Hysteresis> {
    const SPRINGS: usize = SLIPS.len();
    let logs = rows.iter().map(|row| row.at.log + 1).max()?;
    let most_n_m = widths_n_m[SPRINGS - 1] / SLIPS[SPRINGS - 1];
    let mut gram = Gram::none(logs + SPRINGS + 2);
    let mut x = vec![0.0; gram.size];
    for (row, held) in rows.iter().zip(held) {
        let Some(left) = left(row) else { continue };
        x[..logs].fill(0.0);
        x[row.at.log] = 1.0;
        x[logs] = row.at.torque_n_m / most_n_m;
        x[logs + 1..][..SPRINGS].copy_from_slice(held);
        x[logs + 1 + SPRINGS] = left;
        gram.add_row(&x, 1.0);
    }
    let gram = gram.among(&(0..gram.size).collect::<Vec<usize>>());
    let mut priors = vec![linear::Prior { mean: 0.0, std: ANY_ARCSEC }; gram.size - 1];
    let gain = |arcsec: f64, n_m: f64| arcsec / ARCSEC_PER_RAD / n_m;
    loop {
        let found = solve(&gram, &priors, 1.0)?.coefficients;
        let leads = (logs + 1..found.len()).filter(|k| priors[*k].std > 0.0 && found[*k] > 0.0);
        if let Some(most) = leads.max_by(|a, b| found[*a].total_cmp(&found[*b])) {
            priors[most].std = 0.0;
            continue;
        }
        let springs = widths_n_m.iter().zip(&found[logs + 1..]);
        let springs =
            springs.map(|(of, arcsec)| SlipSpring { width_n_m: *of, gain_rad_per_n_m: gain(*arcsec, *of).min(0.0) });
        return Some(Hysteresis { gain_rad_per_n_m: gain(found[logs], most_n_m), springs: springs.collect() });
    }
}

impl WindUpTorque {
    /// Of `calibration.json` in the folder of a table, if that is of this table.
    #[must_use]
    pub fn beside(file: &Path, table: &Table<'_>) -> Option<Self> {
        let text = std::fs::read_to_string(file.with_file_name("calibration.json")).ok()?;
        let mut calibration: Value = serde_json::from_str(&text).ok()?;
        let is_of_table = calibration["table_id"] == table.id().to_string();
        serde_json::from_value(calibration["torque_from_wind_up"].take()).ok().filter(|_| is_of_table)
    }

    /// None where the output does not give way to the load.
    pub(super) fn of(rows: &Rows, folds: &Folds, model: &Model, prior: &Prior<'_>) -> Option<Self> {
        let range @ [low, high] = model.scales.torque_n_m;
        if model.under_arcsec(high, prior) <= model.under_arcsec(low, prior) {
            return None;
        }
        let all = folds.all();
        let widths_n_m = SLIPS.map(|share| share * low.abs().max(high.abs()));
        let held = held_by(&rows.rows, widths_n_m);
        let fit_without = |fold: Option<usize>, springs: bool| -> Option<FitWithout> {
            let others: Vec<usize> = all.iter().copied().filter(|other| Some(*other) != fold).collect();
            let mut zeros = folds.fit(&others, &model.chosen, &[])?;
            let coefficients = zeros.split_off(zeros.len() - model.coefficients.len());
            let model = Model { coefficients, ..model.clone() };
            let left = |row: &Row| (Some(row.fold) != fold).then(|| row.left_arcsec - model.adds_arcsec(&row.at));
            let hysteresis =
                if springs { hysteresis_in(&rows.rows, &held, widths_n_m, left)? } else { Hysteresis::default() };
            Some((zeros, model, hysteresis))
        };
        let judged = |springs: bool| {
            let fits = (0..=*all.last()?).map(|fold| fit_without(Some(fold), springs)).collect::<Option<Vec<_>>>()?;
            Some(Self::judged(rows, &held, &fits, range, prior))
        };
        let without = judged(false)?;
        let gains = |with: &Self| with.rms_n_m.powi(2) < (1.0 - LEAST_GAIN) * without.rms_n_m.powi(2);
        let Some(with) = judged(true).filter(gains) else { return Some(without) };
        let (.., mut hysteresis) = fit_without(None, true)?;
        let holds_arcsec = |of: &SlipSpring| -of.gain_rad_per_n_m * of.width_n_m * ARCSEC_PER_RAD;
        hysteresis.springs.retain(|spring| holds_arcsec(spring) > ROUNDING_ARCSEC);
        Some(Self { hysteresis: Some(hysteresis), ..with })
    }

    /// With intervals wide enough for all rows as they are read by a table: those inside the play, and after a reversal
    /// of the load, among them.
    pub(super) fn over_all(self, files: &[Recording], table: &Table<'_>, temperature_c: f64) -> Self {
        let rows: Vec<_> = measured_rows(files.iter().flat_map(|file| &file.sessions), temperature_c).collect();
        let hysteresis = self.hysteresis.clone().unwrap_or_default();
        let needs = along(table, &rows, &hysteresis, |curve, row, error_rad| curve.needs(row, error_rad)[1]);
        let mut needs: Vec<f64> = needs.into_iter().filter(|needs| needs.is_finite()).collect();
        let of_all_arcsec = quantile_of(&mut needs, INSIDE) * ARCSEC_PER_RAD;
        Self { half_width_arcsec: self.half_width_arcsec.max(of_all_arcsec), ..self }
    }

    /// Of fits, each without the fold of its place, in the order of the rows: springs go by the torques found.
    fn judged(rows: &Rows, held: &[Held], fits: &[FitWithout], range: [f64; 2], prior: &Prior<'_>) -> Self {
        // A log that was left out whole has its zero from nowhere else.
        let own_zero = |log: usize| {
            let of_log = rows.rows.iter().zip(held).filter(|(row, _)| row.at.log == log);
            let left = of_log.map(|(row, held)| {
                let (_, model, hysteresis) = &fits[row.fold];
                let springs = hysteresis.springs.iter().zip(held);
                let springs = springs.map(|(of, share)| of.gain_rad_per_n_m * of.width_n_m * share).sum::<f64>();
                let of_load = hysteresis.gain_rad_per_n_m * row.at.torque_n_m + springs;
                row.left_arcsec - model.adds_arcsec(&row.at) - ARCSEC_PER_RAD * of_load
            });
            mean(&left.collect::<Vec<f64>>())
        };
        let own_zeros: Vec<f64> = match rows.folds {
            FoldKind::Files => (0..rows.means_arcsec.len()).map(own_zero).collect(),
            FoldKind::Blocks => Vec::new(),
        };
        let (mut off, mut left) = (Vec::new(), Vec::new());
        let (mut now, mut log) = (HeldTorques::default(), 0);
        for row in &rows.rows {
            if row.at.log != log {
                (now, log) = (HeldTorques::default(), row.at.log);
            }
            let (zeros, model, hysteresis) = &fits[row.fold];
            let says = |torque_n_m: f64| {
                model.says_arcsec(&State { torque_n_m, ..row.at }, prior)
                    + ARCSEC_PER_RAD * hysteresis.error_rad(&now, torque_n_m)
            };
            let zero = own_zeros.get(log).unwrap_or_else(|| &zeros[log]);
            let error = prior.steady_arcsec(&row.at) + row.left_arcsec - zero;
            let torque = load_of(says, range, error);
            off.push(torque - row.at.torque_n_m);
            left.push((row.fold, (error - says(row.at.torque_n_m)).abs()));
            now.follow(torque, hysteresis.springs.iter().map(|spring| spring.width_n_m));
        }
        let half_width = |fold: usize| {
            let others = left.iter().filter(|(other, _)| *other != fold);
            quantile_of(&mut others.map(|(_, left)| *left).collect::<Vec<f64>>(), INSIDE)
        };
        let half_widths: Vec<f64> = (0..fits.len()).map(half_width).collect();
        // The error rises with the torque: one is inside its interval where the other is.
        let inside = left.iter().filter(|(fold, left)| *left <= half_widths[*fold]).count();
        Self {
            rms_n_m: rms(&off),
            bias_n_m: mean(&off),
            inside: inside as f64 / off.len().max(1) as f64,
            rows: off.len(),
            half_width_arcsec: mean(&half_widths),
            hysteresis: None,
        }
    }
}
