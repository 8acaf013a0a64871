//! What belongs to the reading and not to the drive: the delay between the two angles, and the zero of each log.

use serde::Serialize;

use super::choose::PENALTIES;
use super::folds::{Chosen, Row};
use super::interval::{Known, OF_95};
use super::parts::PartName;
use super::rows::{Recorded, Rows, speed_rad_s};
use super::{CalibrationError, Model, Prior, fit};
use crate::extension::left_by_core;
use crate::measurement::Recording;
use flexspline::Table;
use flexspline_base::units::ARCSEC_PER_RAD;

/// A number of the reading, fitted beside the parts of the table and not held by it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reading {
    /// `delay` (s, positive where the output is read after the generator) or `offset` (arcsec, of the output).
    pub name: &'static str,
    /// The log, of an offset.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Value.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
}

/// A delay between the readings of the two angles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ReadingDelay {
    /// By how much the output is read after the generator, s; negative where it is read before it.
    pub delay_s: f64,
    /// Half width of the interval that holds it with 95 %, s.
    pub half_width_s: f64,
    /// Error of all rows as measured, the delay among it, arcsec rms.
    pub rms_before_arcsec: f64,
    /// What the core leaves of the rows as measured: it does not know the delay. Arcsec rms.
    pub rms_after_arcsec: f64,
}

/// The delay with the standard deviation of it, s.
#[derive(Debug, Clone, Copy)]
pub(super) struct Delay {
    pub by_s: f64,
    std_s: f64,
}

impl Delay {
    /// The delay that tells what was left out better than play and all other parts do; none where they do as well.
    pub fn of(rows: &Rows, prior: &Prior<'_>, recorded: &Recorded) -> Result<Option<Delay>, CalibrationError> {
        if recorded.lacks(PartName::ReadingDelay, prior).is_some() {
            return Ok(None);
        }
        let rows = rows.clone().sure(recorded.scales.friction_n_m, recorded).less(prior);
        let fitted = fit(rows, prior, recorded, PartName::ALL.into_iter().chain([PartName::ReadingDelay]), &[])?;
        let Some(of) = fitted.model.of(PartName::ReadingDelay) else { return Ok(None) };
        // Play goes nearly as the delay does: as much of it as a penalty holds back, the delay would take up.
        let chosen: Vec<Chosen> =
            fitted.model.chosen.iter().map(|chosen| Chosen { penalty: PENALTIES[0], ..*chosen }).collect();
        let Some(coefficients) = fitted.folds.coefficients(&chosen) else { return Ok(None) };
        let model = Model { chosen, coefficients, ..fitted.model };
        let known = Known::of(&fitted.rows.rows, &model, fitted.rows.means_arcsec.len());
        // The column is the speed over its scale.
        let s_of_arcsec = 1.0 / ARCSEC_PER_RAD / recorded.scales.speed_rad_s;
        let std = known.map_or(f64::INFINITY, |known| known.std_arcsec(of.start));
        Ok(Some(Delay { by_s: -model.coefficients[of.start] * s_of_arcsec, std_s: std * s_of_arcsec }))
    }

    /// Logs with both angles as they are at one instant.
    pub fn taken_out(self, files: &[Recording], ratio: f64) -> Vec<Recording> {
        let mut files = files.to_vec();
        for session in files.iter_mut().flat_map(|file| &mut file.sessions) {
            let speeds: Vec<f64> = (0..session.len()).map(|k| speed_rad_s(session, k, ratio)).collect();
            session.error_rad.iter_mut().zip(speeds).for_each(|(error, speed)| *error += self.by_s * speed);
        }
        files
    }

    pub fn reading(self) -> Reading {
        Reading { name: "delay", file: None, value: self.by_s, std: self.std_s }
    }

    /// What it does to the rows of these logs, in which it is, beside this table.
    pub fn shown(self, files: &[Recording], table: &Table<'_>, recorded: &Recorded) -> ReadingDelay {
        let ByCore { rms_before_arcsec, rms_after_arcsec, .. } = ByCore::of(files, table, recorded);
        ReadingDelay { delay_s: self.by_s, half_width_s: OF_95 * self.std_s, rms_before_arcsec, rms_after_arcsec }
    }
}

impl ReadingDelay {
    /// What is said of it.
    #[must_use]
    pub fn note(&self) -> String {
        let (late, early) = if self.delay_s > 0.0 { ("output", "generator") } else { ("generator", "output") };
        format!(
            "the {late} is read {:.3} ± {:.3} ms after the {early}: what that does goes with the speed, which no table \
             knows, so the table is fitted without it. Over all rows as measured {:.2} arcsec rms, {:.2} with the table \
             and the delay still there; read both at one instant, or tell the controller of the delay",
            1e3 * self.delay_s.abs(),
            1e3 * self.half_width_s,
            self.rms_before_arcsec,
            self.rms_after_arcsec
        )
    }
}

/// What a delay would do that these rows cannot tell from play, arcsec of play for a millisecond; none where they tell
/// it, or have no time.
pub(super) fn play_of_a_millisecond(rows: &[Row], recorded: &Recorded, prior: &Prior<'_>) -> Option<f64> {
    let hidden = recorded.scales.speed_rad_s > 0.0 && recorded.lacks(PartName::ReadingDelay, prior).is_some();
    if !hidden || recorded.lacks(PartName::Play, prior).is_some() {
        return None;
    }
    let mean = rows.iter().map(|row| row.at.speed_rad_s.abs()).sum::<f64>() / rows.len().max(1) as f64;
    Some(2e-3 * mean * ARCSEC_PER_RAD)
}

/// The core with the finished table over the whole logs, reversals among them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ByCore {
    /// Each file's zero taken out, and a delay between the readings.
    pub rms_before_arcsec: f64,
    /// What the core leaves.
    pub rms_after_arcsec: f64,
    /// Rows.
    pub rows: usize,
}

impl ByCore {
    pub(super) fn of(files: &[Recording], table: &Table<'_>, recorded: &Recorded) -> ByCore {
        let (mut before, mut after, mut rows) = (0.0, 0.0, 0);
        for file in files {
            let about = |values: Vec<f64>| {
                let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
                values.iter().map(|value| (value - mean).powi(2)).sum::<f64>()
            };
            let measured: Vec<f64> = file
                .sessions
                .iter()
                .flat_map(|session| session.error_rad.iter().map(|rad| rad * ARCSEC_PER_RAD))
                .collect();
            let left = file.sessions.iter().flat_map(|session| left_by_core(table, session, recorded.temperature_c));
            rows += measured.len();
            before += about(measured);
            after += about(left.collect());
        }
        let rms = |squares: f64| (squares / rows.max(1) as f64).sqrt();
        ByCore { rms_before_arcsec: rms(before), rms_after_arcsec: rms(after), rows }
    }
}
