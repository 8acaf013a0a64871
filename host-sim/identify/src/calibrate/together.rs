//! Whether several logs are of one unit, read in one way.

use super::choose::PENALTIES;
use super::folds::{Chosen, Folds, Row};
use super::parts::{PartName, Scales, State};
use super::prior::Prior;
use super::rows::Rows;
use super::{Model, SAME_TORQUE};
use crate::measurement::{Recording, least_and_most};

/// Logs do not agree if fits to each alone leave less than this share of what one fit to all leaves, rms. A guess.
const ALONE: f64 = 0.3;

/// Residual of fits of all parts in several logs, arcsec rms, the zero of the output free in each.
pub(super) struct Agreement {
    /// Each log with a fit of its own.
    alone_arcsec: f64,
    /// All with one.
    together_arcsec: f64,
    /// Without this log the others agree.
    odd: Option<usize>,
}

impl Agreement {
    /// Of two and more logs.
    pub fn of(rows: &Rows, parts: &[PartName], scales: &Scales) -> Option<Agreement> {
        let by_log: Vec<Row> = rows.rows.iter().map(|row| Row { fold: row.at.log, ..*row }).collect();
        let folds = Folds::new(&by_log, parts, scales, rows.means_arcsec.len(), true);
        let all = folds.all();
        let chosen: Vec<Chosen> = parts.iter().map(|part| Chosen { part: *part, penalty: PENALTIES[0] }).collect();
        let rms = |of: &[usize], squares: f64| (squares / folds.rows(of)).sqrt();
        let alone = |of: &[usize]| rms(of, of.iter().map(|log| folds.left_in(*log, &[*log], &chosen)).sum());
        let together = |of: &[usize]| rms(of, of.iter().map(|log| folds.left_in(*log, of, &chosen)).sum());
        if all.len() < 2 {
            return None;
        }
        let mut found = Agreement { alone_arcsec: alone(&all), together_arcsec: together(&all), odd: None };
        if !found.agree() && all.len() > 2 {
            let others = |odd: usize| all.iter().copied().filter(|log| *log != odd).collect::<Vec<_>>();
            found.odd = all
                .iter()
                .map(|odd| (*odd, others(*odd)))
                .filter(|(_, others)| alone(others) >= ALONE * together(others))
                .min_by(|(_, a), (_, b)| together(a).total_cmp(&together(b)))
                .map(|(odd, _)| odd);
        }
        Some(found)
    }

    fn agree(&self) -> bool {
        self.alone_arcsec >= ALONE * self.together_arcsec
    }

    /// Note where they do not.
    pub(crate) fn note(&self, files: &[Recording]) -> Option<String> {
        let odd = self.odd.and_then(|odd| files.get(odd));
        let odd = odd.map_or_else(String::new, |odd| format!(" in {}, without which the others agree", odd.file));
        (!self.agree()).then(|| {
            format!(
                "the logs do not agree: each alone is fitted to {:.2} arcsec rms, all together to {:.2}; another zero \
                 of the generator, or another unit or sign of a column{odd}? Home the encoders in the same place \
                 before each log, see `flexspline look`, or give one log alone",
                self.alone_arcsec, self.together_arcsec
            )
        })
    }
}

/// The straight wind-up of one log is this multiple of that of another: beyond what a spring of teeth stiffens by from
/// light loads to heavy ones, 1.8 times in the catalogue (K1 to K3 of CSF-25-100). A guess.
const OTHER_SLOPE: f64 = 3.0;

/// Says of logs whose loads wind the drive up unlike: one curve fits them all where their loads are others, as one is
/// in another unit.
pub(super) fn loads_unlike(rows: &Rows, model: &Model, prior: &Prior<'_>, files: &[Recording]) -> Option<String> {
    let most = model.scales.torque_n_m.iter().fold(0.0, |most: f64, load| most.max(load.abs()));
    let slopes = (0..files.len()).filter_map(|log| {
        let of_log = rows.rows.iter().filter(|row| row.at.log == log).map(|row| row.at.torque_n_m);
        let (low, high) = least_and_most(of_log);
        let slope = (model.under_arcsec(high, prior) - model.under_arcsec(low, prior)) / (high - low);
        (high - low > SAME_TORQUE * most && slope > 0.0).then_some((log, slope))
    });
    let slopes: Vec<(usize, f64)> = slopes.collect();
    let (soft, stiff) =
        (slopes.iter().max_by(|a, b| a.1.total_cmp(&b.1))?, slopes.iter().min_by(|a, b| a.1.total_cmp(&b.1))?);
    (soft.1 > OTHER_SLOPE * stiff.1).then(|| {
        format!(
            "the loads of the logs do not agree: {:.3} arcsec for a newton-metre in {}, {:.3} in {}, {:.1} times less; \
             is the torque of one in another unit? See `flexspline look`, or give one log alone",
            soft.1,
            files[soft.0].file,
            stiff.1,
            files[stiff.0].file,
            soft.1 / stiff.1
        )
    })
}

/// A generator that is turned back by what is found has to leave less than this share of the squares, and no more than
/// the first share of the rms of each log alone: else it is not the zero alone that differs, up to the second the curve
/// of another unit. Guesses.
const TURNED_BACK: f64 = 0.8;
const AS_ALONE: [f64; 2] = [1.1, 1.3];
/// Times that the angle is looked for anew, as the curve that all logs share goes with it.
const TURNS: usize = 4;
/// Step of the generator that slopes are taken over, rad: a small part of a tooth pitch.
const STEP_RAD: f64 = 1e-3;

/// Says of logs that agree so far as `agreement` says whose generators have unlike zeros, and by how much.
pub(super) fn generators_turned(
    agreement: &Agreement,
    rows: &Rows,
    (parts, model): (&[PartName], &Model),
    prior: &Prior<'_>,
    files: &[Recording],
) -> Option<String> {
    let before = agreement.together_arcsec;
    // All together never leave less than each alone, whichever way they are turned.
    if agreement.alone_arcsec.powi(2) >= TURNED_BACK * before * before {
        return None;
    }
    let chosen: Vec<Chosen> = parts.iter().map(|part| Chosen { part: *part, penalty: PENALTIES[0] }).collect();
    let (mut turned, mut rows) = (vec![0.0; files.len()], rows.clone());
    for _ in 0..TURNS {
        let folds = rows.folds_of(parts, &model.scales);
        let coefficients = folds.coefficients(&chosen, &[])?;
        let fitted = Model { chosen: chosen.clone(), coefficients, scales: model.scales };
        let by = angles_off(&rows, &fitted, prior, files.len());
        turned.iter_mut().zip(&by).for_each(|(turned, by)| *turned += by);
        for row in &mut rows.rows {
            row.at.generator_rad -= by[row.at.log];
            row.at.output_rad -= by[row.at.log] / prior.nominal.ratio;
        }
        rows = rows.less(prior);
    }
    let Agreement { alone_arcsec, together_arcsec: after, .. } = Agreement::of(&rows, parts, &model.scales)?;
    let is_near = after * after < TURNED_BACK * before * before && after < AS_ALONE[1] * alone_arcsec;
    is_near.then(|| {
        let of = |(file, turned): (&Recording, &f64)| format!("{:+.2} deg in {}", turned.to_degrees(), file.file);
        let list: Vec<String> = files.iter().zip(&turned).skip(1).map(of).collect();
        if after >= AS_ALONE[0] * alone_arcsec {
            return format!(
                "the logs look like those of unlike units, or of one that has changed: all together are fitted to \
                 {before:.2} arcsec rms, with each generator turned as fits best to {after:.2}, each alone to \
                 {alone_arcsec:.2}; is one of {} another unit?",
                files.iter().map(|file| file.file.as_str()).collect::<Vec<_>>().join(", ")
            );
        }
        format!(
            "the zero of the generator is not the same in all logs: against {} it reads {}; turned back they would \
             leave {after:.2} arcsec rms instead of {before:.2}. Home it in the same place before each log, or give \
             one log alone",
            files[0].file,
            list.join(", ")
        )
    })
}

/// By how much the generator of each log is turned against that of the first, rad, to first order.
fn angles_off(rows: &Rows, model: &Model, prior: &Prior<'_>, logs: usize) -> Vec<f64> {
    let turned = |at: &State, by: f64| State {
        generator_rad: at.generator_rad + by,
        output_rad: at.output_rad + by / prior.nominal.ratio,
        ..*at
    };
    let mut sums = vec![[0.0; 5]; logs];
    for row in &rows.rows {
        let says = |by: f64| model.says_arcsec(&turned(&row.at, by), prior);
        let slope = (says(STEP_RAD) - says(-STEP_RAD)) / (2.0 * STEP_RAD);
        let left = row.left_arcsec - model.adds_arcsec(&row.at);
        let of_row = [1.0, slope, left, slope * slope, slope * left];
        sums[row.at.log].iter_mut().zip(of_row).for_each(|(sum, of_row)| *sum += of_row);
    }
    // The slope of what is left over that of the curve, each less its mean over the log.
    let off = |[rows, slope, left, square, product]: &[f64; 5]| {
        let (variance, along) = (square - slope * slope / rows, product - slope * left / rows);
        if variance > 0.0 { -along / variance } else { 0.0 }
    };
    let first = sums.first().map_or(0.0, off);
    sums.iter().map(|sum| off(sum) - first).collect()
}
