//! What belongs to the reading and not to the drive: the delay between the two angles, and the zero of each log.

use serde::Serialize;

use super::choose::{LEAST_GAIN, PENALTIES, path, pruned};
use super::folds::{Chosen, Row};
use super::interval::{Known, OF_95};
use super::parts::PartName;
use super::rows::{Recorded, Rows, settled, speed_rad_s};
use super::{Model, Prior};
use crate::extension::left_by_core;
use crate::measurement::Recording;
use flexspline::Table;
use flexspline_base::units::ARCSEC_PER_RAD;

/// A number of the reading, fitted beside the parts of the table and not held by it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reading {
    /// `delay` (s, positive where the output of a row is older than its generator) or `offset` (arcsec, of the output).
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
    /// By how much the output of a row is older than its generator, s; negative where the generator is the older.
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
    /// The delay, if it tells what was left out better than play and all other parts do; `rows` of the files
    /// lie outside of a play of `play_rad`, and what tells the delay outside of that which is found, too.
    pub fn of(
        files: &[Recording],
        rows: &Rows,
        prior: &Prior<'_>,
        recorded: &Recorded,
        play_rad: f64,
    ) -> Option<Delay> {
        if recorded.lacks(PartName::ReadingDelay, prior).is_some() {
            return None;
        }
        let (found, model) = Delay::beside(rows.clone(), prior, recorded)?;
        let further_rad = model.play_arcsec() / ARCSEC_PER_RAD;
        if further_rad <= 0.0 {
            return Some(found);
        }
        // Now that the play is known, without the rows inside it.
        Delay::beside(settled(files, prior, recorded, play_rad + further_rad), prior, recorded).map(|(found, _)| found)
    }

    /// The delay beside the parts of these rows, with those parts.
    fn beside(rows: Rows, prior: &Prior<'_>, recorded: &Recorded) -> Option<(Delay, Model)> {
        let rows = rows.sure(recorded.scales.friction_n_m, recorded).less(prior);
        let parts = recorded.shown(PartName::ALL.into_iter().chain([PartName::ReadingDelay]), prior);
        let folds = rows.folds_of(&parts, &recorded.scales);
        let all = folds.all();
        let chosen = pruned(&folds, &all, path(&folds, &all).pop()?);
        // Play goes nearly as the delay does: it is there, or the delay would take it up, and where the two oppose each
        // other neither gains alone. As much of it as a penalty holds back, the delay would take up as well.
        let free = |part: PartName| Chosen { part, penalty: PENALTIES[0] };
        let is_beside = |part: &PartName| {
            *part == PartName::Play || *part != PartName::ReadingDelay && chosen.iter().any(|other| other.part == *part)
        };
        let mut chosen: Vec<Chosen> = parts.iter().copied().filter(is_beside).map(free).collect();
        let without = folds.left_out(&all, &chosen);
        chosen.push(free(PartName::ReadingDelay));
        if folds.left_out(&all, &chosen) > without * (1.0 - LEAST_GAIN) {
            return None;
        }
        let model = Model { coefficients: folds.coefficients(&chosen, &[])?, chosen, scales: recorded.scales };
        let of = model.of(PartName::ReadingDelay)?;
        // The column is the speed over its scale.
        let s_of_arcsec = 1.0 / ARCSEC_PER_RAD / recorded.scales.speed_rad_s;
        let std = Known::of(&rows.rows, &model, rows.means_arcsec.len())?.std_arcsec(of.start);
        let delay = Delay { by_s: -model.coefficients[of.start] * s_of_arcsec, std_s: std * s_of_arcsec };
        Some((delay, model))
    }

    /// Logs with both angles as they are at one instant.
    pub(crate) fn taken_out(self, files: &[Recording], ratio: f64) -> Vec<Recording> {
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
    pub(crate) fn shown(self, files: &[Recording], table: &Table<'_>, recorded: &Recorded) -> ReadingDelay {
        let ByCore { rms_before_arcsec, rms_after_arcsec, .. } = ByCore::of(files, table, recorded);
        ReadingDelay { delay_s: self.by_s, half_width_s: OF_95 * self.std_s, rms_before_arcsec, rms_after_arcsec }
    }
}

impl ReadingDelay {
    /// What is said of it.
    #[must_use]
    pub(crate) fn note(&self) -> String {
        let (old, new) = if self.delay_s > 0.0 { ("output", "generator") } else { ("generator", "output") };
        format!(
            "in each row the {old} is {:.3} ± {:.3} ms older than the {new}: what that does goes with the speed, which \
             no table knows, so the table is fitted without it. Over all rows as measured {:.2} arcsec rms, {:.2} with \
             the table and the delay still there; read both at one instant, or tell the controller of the delay",
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
