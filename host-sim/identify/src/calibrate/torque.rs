//! How good a torque from the wind-up would be: in rows that took no part in the fit. With a hysteresis by load where
//! that gains.

use std::path::Path;

use flexspline::Table;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::folds::Folds;
use super::parts::{PartName, State, WIND_UP_DEGREE};
use super::prior::Prior;
use super::reading::DELAY;
use super::rows::Rows;
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
/// Torques at which springs slip, of the largest recorded: from half of it, as a loop of a spring that slips later is
/// not closed, each half of the one before. *Guess*.
const SLIPS: [f64; 5] = [0.5, 0.25, 0.125, 1.0 / 16.0, 1.0 / 32.0];
/// Zero of a session, way of a spring per N·m, and bend of the wind-up, before rows say anything, arcsec: far beyond
/// any. *Guess*.
const ANY_ARCSEC: f64 = 1e4;
/// Weight of a row left out: a session that has no others takes its zero from them. *Guess*.
const LEFT_OUT: f64 = 1e-6;

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
    /// all rows, with what loads and angles add that were not recorded together.
    pub half_width_arcsec: f64,
    /// The same for who reads with the table alone, as the core does.
    #[serde(default)]
    pub half_width_alone_arcsec: f64,
    /// Hysteresis that the torques are read with, if they are better with one: no table holds it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hysteresis: Option<Hysteresis>,
}

/// Springs.
const SPRINGS: usize = SLIPS.len();

/// A fit to all folds but one: zeros of the sessions, arcsec, the model, and what it does not have.
type FitWithout<'m> = (Vec<f64>, &'m Model, Hysteresis);

/// Torques at which the springs slip, N·m.
fn widths_of(model: &Model) -> [f64; SPRINGS] {
    SLIPS.map(|share| share * model.scales.most_torque())
}

/// Products of the sessions, of what the springs hold, and of powers of the load with what a model leaves of some rows,
/// all but those of a fold.
fn sums(rows: &Rows, fold: Option<usize>, model: &Model) -> Gram {
    let sessions = rows.loads.last().map_or(0, |(session, _)| session + 1);
    let mut gram = Gram::none(sessions + SPRINGS + WIND_UP_DEGREE + 1);
    let mut x = vec![0.0; gram.size];
    let (mut held, mut settled) = (HeldTorques::default(), rows.rows.iter().peekable());
    for (number, (session, torque_n_m)) in rows.loads.iter().enumerate() {
        held.begin(*session);
        held.follow(*torque_n_m, widths_of(model));
        let Some(row) = settled.next_if(|row| row.number == number) else { continue };
        x[..sessions].fill(0.0);
        x[*session] = 1.0;
        x[sessions..][..SPRINGS].copy_from_slice(&held.by_spring);
        let load = row.at.torque_n_m / model.scales.most_torque();
        (1..).zip(&mut x[sessions + SPRINGS..]).for_each(|(power, x)| *x = load.powi(power));
        x[gram.size - 1] = row.left_arcsec - model.adds_arcsec(&row.at);
        gram.add_row(&x, if Some(row.fold) == fold { LEFT_OUT } else { 1.0 });
    }
    gram.among(&(0..gram.size).collect::<Vec<usize>>())
}

/// Zeros of the sessions and hysteresis by such products: by so many of the springs, those that slip last, and so many
/// powers of the load. The output lags: a spring with which it would lead gets nothing.
fn hysteresis_in((gram, model): &(Gram, Model), [springs, powers]: [usize; 2]) -> Option<FitWithout<'_>> {
    let sessions = gram.size - SPRINGS - WIND_UP_DEGREE - 1;
    let mut priors = vec![linear::Prior { mean: 0.0, std: ANY_ARCSEC }; gram.size - 1];
    let (held, by_load) = priors[sessions..].split_at_mut(SPRINGS);
    held[springs..].iter_mut().chain(&mut by_load[powers..]).for_each(|prior| prior.std = 0.0);
    loop {
        let mut zeros = solve(gram, &priors, 1.0)?.coefficients;
        let leads = (sessions..sessions + SPRINGS).filter(|k| priors[*k].std > 0.0 && zeros[*k] > 0.0);
        if let Some(most) = leads.max_by(|a, b| zeros[*a].total_cmp(&zeros[*b])) {
            priors[most].std = 0.0;
            continue;
        }
        let most_n_m = model.scales.most_torque();
        let gains: Vec<f64> = zeros.split_off(sessions).iter().map(|arcsec| arcsec / ARCSEC_PER_RAD).collect();
        let springs = widths_of(model).into_iter().zip(&gains);
        let springs = springs.map(|(width_n_m, gain)| SlipSpring { width_n_m, gain_rad_per_n_m: gain.min(0.0) });
        let by_load = (1..).zip(&gains[SPRINGS..]).map(|(power, gain)| gain / most_n_m.powi(power));
        let hysteresis = Hysteresis { springs: springs.collect(), by_load: by_load.collect() };
        return Some((zeros, model, hysteresis));
    }
}

/// What `calibration.json` says that the table does not.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default)]
pub struct CalibrationFile {
    pub(crate) torque_from_wind_up: Option<WindUpTorque>,
    pub(crate) load_with_output_angle: Option<f64>,
    pub(crate) half_width_as_recorded_arcsec: f64,
    pub(crate) half_width_arcsec: f64,
    pub(crate) readings: Vec<Value>,
    pub(crate) table_id: String,
}

impl CalibrationFile {
    /// Of the file in the folder of a table, if that is of this table.
    pub fn read(file: &Path, table: &Table<'_>) -> Option<Self> {
        let text = std::fs::read_to_string(file.with_file_name("calibration.json")).ok()?;
        let read: CalibrationFile = serde_json::from_str(&text).ok()?;
        (read.table_id == table.id().to_string()).then_some(read)
    }

    /// Whether a delay between the readings was taken out of its rows.
    pub(crate) fn has_delay(&self) -> bool {
        self.readings.iter().any(|reading| reading["name"] == DELAY)
    }
}

impl WindUpTorque {
    /// None where nothing winds up under the load: play alone does not say a torque.
    pub(super) fn of(rows: &Rows, folds: &Folds, model: &Model, prior: &Prior<'_>) -> Option<Self> {
        let [low, high] = model.scales.torque_n_m;
        let per_n_m = (model.under_arcsec(high, prior) - model.under_arcsec(low, prior)) / (high - low);
        let springs = prior.nominal.stiffness.iter().any(|[_, n_m_per_rad]| n_m_per_rad.is_finite());
        if per_n_m.is_nan() || per_n_m <= 0.0 || !(springs || model.of(PartName::WindUp).is_some()) {
            return None;
        }
        let all = folds.all();
        let without = |fold: Option<usize>| {
            let others: Vec<usize> = all.iter().copied().filter(|other| Some(*other) != fold).collect();
            let mut zeros = folds.fit(&others, &model.chosen, &[])?;
            let coefficients = zeros.split_off(zeros.len() - model.coefficients.len());
            let model = Model { coefficients, ..model.clone() };
            Some((sums(rows, fold, &model), model))
        };
        let models = (0..=*all.last()?).map(|fold| without(Some(fold))).collect::<Option<Vec<_>>>()?;
        let judged = |by: [usize; 2], half_width_arcsec: f64| {
            let fits = models.iter().map(|of| hysteresis_in(of, by)).collect::<Option<Vec<_>>>()?;
            Some((by, Self::judged(rows, &fits, half_width_arcsec / per_n_m, prior)))
        };
        let (_, alone) = judged([0, 0], 0.0)?;
        let tried = (0..=SPRINGS).into_par_iter();
        let tried = tried.flat_map_iter(|springs| [1, WIND_UP_DEGREE].map(|powers| [springs, powers]));
        let tried = tried.filter_map(|by| judged(by, alone.half_width_arcsec));
        let (by, best) = tried.min_by(|(_, a), (_, b)| a.rms_n_m.total_cmp(&b.rms_n_m))?;
        let (_, best) = judged(by, best.half_width_arcsec)?;
        if best.rms_n_m.powi(2) >= (1.0 - LEAST_GAIN) * alone.rms_n_m.powi(2) {
            return Some(alone);
        }
        let of_all = without(None)?;
        let (.., mut hysteresis) = hysteresis_in(&of_all, by)?;
        hysteresis.springs.retain(|of| -of.gain_rad_per_n_m * of.width_n_m * ARCSEC_PER_RAD > ROUNDING_ARCSEC);
        Some(Self { hysteresis: Some(hysteresis), half_width_alone_arcsec: alone.half_width_arcsec, ..best })
    }

    /// With intervals wide enough for all rows as they are read by a table: those inside the play, and after a reversal
    /// of the load, among them, and for what the table is off `beyond` that, arcsec, under loads and at angles that
    /// were not recorded together.
    pub(super) fn over_all(self, files: &[Recording], (table, temperature_c): (&Table<'_>, f64), beyond: f64) -> Self {
        let rows: Vec<_> = measured_rows(files.iter().flat_map(|file| &file.sessions), temperature_c).collect();
        let of_all = |hysteresis: &Hysteresis, half_arcsec: f64| {
            let half_rad = half_arcsec / ARCSEC_PER_RAD;
            let mut needs = along(table, &rows, hysteresis, |curve, row, error| {
                curve.next([row.generator_rad, error, row.temperature_c, half_rad, row.torque_n_m])[3]
            });
            half_arcsec.max(quantile_of(&mut needs, INSIDE) * ARCSEC_PER_RAD).hypot(beyond)
        };
        let half_width_alone_arcsec = of_all(&Hysteresis::default(), self.half_width_alone_arcsec);
        let with = self.hysteresis.as_ref().map(|hysteresis| of_all(hysteresis, self.half_width_arcsec));
        Self { half_width_arcsec: with.unwrap_or(half_width_alone_arcsec), half_width_alone_arcsec, ..self }
    }

    /// Of fits, each without the fold of its place. Springs go by torques found, by those recorded between flanks.
    fn judged(rows: &Rows, fits: &[FitWithout<'_>], half_width_n_m: f64, prior: &Prior<'_>) -> Self {
        let (mut off, mut left) = (Vec::new(), Vec::new());
        let mut now = HeldTorques { half_width_n_m, ..HeldTorques::default() };
        let mut settled = rows.rows.iter().peekable();
        for (number, (session, known_n_m)) in rows.loads.iter().enumerate() {
            now.begin(*session);
            let (mut torque, mut fold) = (*known_n_m, 0);
            if let Some(row) = settled.next_if(|row| row.number == number) {
                let (zeros, model, hysteresis) = &fits[row.fold];
                let says = |torque_n_m: f64| {
                    model.says_arcsec(&State { torque_n_m, ..row.at }, prior)
                        + ARCSEC_PER_RAD * hysteresis.error_rad(&now, torque_n_m)
                };
                let error = prior.steady_arcsec(&row.at) + row.left_arcsec - zeros[*session];
                (torque, fold) = (load_of(says, model.scales.torque_n_m, error), row.fold);
                off.push(torque - known_n_m);
                left.push((fold, (error - says(*known_n_m)).abs()));
            }
            now.follow(torque, fits[fold].2.springs.iter().map(|spring| spring.width_n_m));
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
            half_width_alone_arcsec: mean(&half_widths),
            hysteresis: None,
        }
    }
}
