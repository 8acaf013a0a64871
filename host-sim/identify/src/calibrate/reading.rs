//! Effects of the reading, not of the drive: the delay between the two angles, and the zero of each log.

use serde::Serialize;

use super::folds::{Chosen, LEAST_GAIN, PENALTIES, Row};
use super::interval::{ModelUncertainty, OF_95, left_by};
use super::parts::{PartName, Scales, expected_arcsec};
use super::rows::{Recorded, Rows, speeds_rad_s};
use super::{Model, Prior};
use crate::extension::left_by_core;
use crate::measurement::{Recording, Session};
use crate::misfit::about_mean;
use flexspline::Table;
use flexspline_base::units::ARCSEC_PER_RAD;

/// A delay is not told from play if its standard deviation is more than this share of that before the rows. *Guess*.
const UNTOLD: f64 = 0.25;

/// Name of the reading of a delay.
pub(super) const DELAY: &str = "delay";
/// Name of the zero of the output.
pub(super) const OFFSET: &str = "offset";

/// A number of the reading, fitted with the parts of the table and not held by it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reading {
    /// `delay` (s, positive where the output of a row is older than its generator), `offset` (arcsec, output less
    /// generator over ratio less the table's error, mean over the file) or `zero` (deg of the generator, where that of
    /// the first log is zero).
    pub name: &'static str,
    /// The log.
    pub file: String,
    /// Value.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
}

impl Reading {
    /// One of each log that has it: its value and standard deviation.
    pub(super) fn of_logs(
        name: &'static str,
        files: &[Recording],
        found: impl Iterator<Item = Option<[f64; 2]>>,
    ) -> Vec<Reading> {
        let reading = |(file, found): (&Recording, Option<[f64; 2]>)| {
            let [value, std] = found?;
            Some(Reading { name, file: file.file.clone(), value, std })
        };
        files.iter().zip(found).filter_map(reading).collect()
    }
}

/// The delay of each log with its standard deviation, s; `None` of a log that shows none.
#[derive(Debug, Clone)]
pub(super) struct Delays(Vec<Option<[f64; 2]>>);

impl Delays {
    /// The delays, if rows that were left out are fitted better with them than with play and all other parts alone.
    pub(crate) fn of(rows: Rows, prior: &Prior<'_>, recorded: &Recorded) -> Option<Delays> {
        if recorded.scales.speed_rad_s <= 0.0 {
            return None;
        }
        let rows = rows.in_blocks();
        let (logs, scales) = (rows.means_arcsec.len(), recorded.scales);
        let delays: Vec<PartName> = (0..logs).map(PartName::ReadingDelay).collect();
        let parts = recorded.shown(PartName::ALL.into_iter().chain(delays.iter().copied()), prior);
        let folds = rows.folds_of(&parts, &scales);
        let all = folds.all();
        let gainful = folds.path(&all).pop()?;
        // Play goes nearly as a delay does: it is there, or the delay would take it up, and where the two oppose each
        // other neither gains alone. What rows do not tell apart is shared as either is to be expected. At one pace all
        // is play, but an output that leads: no play does that.
        let hidden = recorded.hides_a_delay();
        let has = |part: &PartName| gainful.iter().any(|other| other.part == *part);
        let in_table = |part: &PartName| match part {
            PartName::Play => !hidden,
            PartName::ReadingDelay(_) => false,
            part => has(part),
        };
        let free = |part: PartName| Chosen { part, penalty: PENALTIES[0] };
        let mut chosen: Vec<Chosen> = parts.iter().copied().filter(in_table).map(free).collect();
        let parts_alone = chosen.len();
        chosen.extend(delays.iter().copied().map(free));
        let model = |chosen: &[Chosen]| {
            Some(Model { coefficients: folds.coefficients(chosen, &[])?, chosen: chosen.to_vec(), scales })
        };
        let none = vec![0.0; logs];
        let known = |model: &Model| ModelUncertainty::of(&rows.rows, (model, &[]), &none, recorded.coarse_rad, 0.0);
        // Of noise as large as the delays make it they would be held back.
        let (_, noise) = left_by(&rows.rows, &model(&chosen)?, logs, recorded.coarse_rad);
        let of_a_row = noise.of_a_row() / rows.rows.len() as f64;
        for chosen in &mut chosen {
            if matches!(chosen.part, PartName::Play | PartName::ReadingDelay(_)) {
                chosen.penalty = of_a_row / expected_arcsec(chosen.part, &scales, &[]).powi(2);
            }
        }
        let with_all = model(&chosen)?;
        let of_all = known(&with_all)?;
        let left = folds.left_out(&all, &chosen);
        let is_told = |delay: &Chosen| {
            let PartName::ReadingDelay(_) = delay.part else { return true };
            let (Some(of), Some(std)) = (with_all.of(delay.part), of_all.std_of(delay.part, 0)) else { return false };
            let value = with_all.coefficients[of.start];
            let others: Vec<Chosen> = chosen.iter().copied().filter(|other| other != delay).collect();
            // A share of a log in all rows is no larger the more logs there are.
            let gains = left < folds.left_out(&all, &others) * (1.0 - LEAST_GAIN / logs as f64);
            if hidden {
                return gains && value > OF_95 * std;
            }
            let untold = std > UNTOLD * expected_arcsec(delay.part, &scales, &[]);
            value.abs() > OF_95 * std && (gains || untold)
        };
        let chosen: Vec<Chosen> = chosen.iter().copied().filter(is_told).collect();
        if chosen.len() == parts_alone {
            return None;
        }
        let model = model(&chosen)?;
        let known = known(&model)?;
        // The column is the speed over its scale.
        let s_of_arcsec = 1.0 / ARCSEC_PER_RAD / scales.speed_rad_s;
        let found = delays.iter().map(|delay| {
            let by = -model.coefficients[model.of(*delay)?.start];
            // At one pace it leads by no less, but any play may hide more of it.
            let std_s = known.std_of(*delay, 0)? * s_of_arcsec;
            Some([by * s_of_arcsec, if hidden { std_s.hypot(scales.late_s) } else { std_s }])
        });
        Some(Delays(found.collect()))
    }

    /// Puts both angles of logs as they are at one instant.
    pub(crate) fn take_out(&self, files: &mut [Recording], ratio: f64) {
        for (file, delay) in files.iter_mut().zip(&self.0) {
            let by_s = delay.map_or(0.0, |[by_s, _]| by_s);
            for session in &mut file.sessions {
                let speeds = speeds_rad_s(session, ratio);
                session.error_rad.iter_mut().zip(speeds).for_each(|(error, speed)| *error += by_s * speed);
            }
        }
    }

    /// As numbers of their columns; 0 of a log that shows none.
    pub(crate) fn of_columns(&self, scales: &Scales) -> Vec<f64> {
        let column =
            |delay: &Option<[f64; 2]>| delay.map_or(0.0, |[by_s, _]| -by_s * scales.speed_rad_s * ARCSEC_PER_RAD);
        self.0.iter().map(column).collect()
    }

    /// Those of the logs that show one.
    pub(crate) fn readings(&self, files: &[Recording]) -> Vec<Reading> {
        Reading::of_logs(DELAY, files, self.0.iter().copied())
    }
}

/// Note on the delays among the readings of some logs, if there is one.
pub(super) fn delay_note(readings: &[Reading], logs: usize) -> Option<String> {
    let of_log = |reading: &Reading| {
        let (old, new) = if reading.value > 0.0 { ("output", "generator") } else { ("generator", "output") };
        let file = if logs > 1 { format!(" of {}", reading.file) } else { String::new() };
        format!(
            "in each row{file} the {old} is {:.3} ± {:.3} ms older than the {new}",
            1e3 * reading.value.abs(),
            1e3 * OF_95 * reading.std
        )
    };
    let delays: Vec<String> = readings.iter().filter(|reading| reading.name == DELAY).map(of_log).collect();
    (!delays.is_empty()).then(|| {
        format!(
            "{}: the effect grows with the speed, which no table knows, so the table is fitted without it; read both \
             at one instant, or give the controller the delay; a drag that grows with the speed does the same",
            delays.join("; ")
        )
    })
}

/// What a delay would do that these rows cannot tell from play, arcsec of play for a millisecond; none where they tell
/// it, or have no time.
pub(super) fn play_of_a_millisecond(rows: &[Row], recorded: &Recorded, prior: &Prior<'_>) -> Option<f64> {
    let hidden = recorded.scales.speed_rad_s > 0.0 && recorded.hides_a_delay();
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
    /// Residual with the core.
    pub rms_after_arcsec: f64,
    /// Rows.
    pub rows: usize,
}

impl ByCore {
    pub(super) fn of(files: &[Recording], table: &Table<'_>, recorded: &Recorded) -> ByCore {
        let (mut before, mut after, mut rows) = (0.0, 0.0, 0);
        let squares = |values: Vec<f64>| about_mean(&values).powi(2) * values.len() as f64;
        for file in files {
            let errors = file.sessions.iter().flat_map(|session| &session.error_rad);
            let left = file.sessions.iter().flat_map(|session| left_by_core(table, session, recorded.temperature_c));
            rows += file.sessions.iter().map(Session::len).sum::<usize>();
            before += squares(errors.map(|rad| rad * ARCSEC_PER_RAD).collect());
            after += squares(left.collect());
        }
        let rms = |squares: f64| (squares / rows.max(1) as f64).sqrt();
        ByCore { rms_before_arcsec: rms(before), rms_after_arcsec: rms(after), rows }
    }
}
