//! Whether several logs are of one unit, read in one way.

use std::f64::consts::TAU;

use super::choose::PENALTIES;
use super::folds::{Chosen, Folds, Row};
use super::parts::{PartName, Scales, State};
use super::prior::Prior;
use super::rows::Rows;
use super::zero::{PhaseSearch, within};
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

/// The rows with each log for a fold with a zero of its own, and all parts with the least penalty.
fn by_log(rows: &Rows, parts: &[PartName], scales: &Scales) -> (Folds, Vec<Chosen>) {
    let by_log: Vec<Row> = rows.rows.iter().map(|row| Row { fold: row.at.log, ..*row }).collect();
    let chosen = parts.iter().map(|part| Chosen { part: *part, penalty: PENALTIES[0] }).collect();
    (Folds::new(&by_log, parts, scales, rows.means_arcsec.len(), true), chosen)
}

impl Agreement {
    /// Of two and more logs.
    pub fn of(rows: &Rows, parts: &[PartName], scales: &Scales) -> Option<Agreement> {
        let (folds, chosen) = by_log(rows, parts, scales);
        let all = folds.all();
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
/// this share of the rms of each log alone: else it is not the zero alone that differs. Guesses.
const TURNED_BACK: f64 = 0.8;
const AS_ALONE: f64 = 1.1;
/// Whole turns are told if without them this multiple of the squares is left, at least. *Guess*.
const OTHER_TURN: f64 = 1.2;
/// Logs that are turned, at most: pieces of one log with zeros of their own are many, and their generator is one.
/// *Guess*.
const MOST_LOGS: usize = 8;
/// Rows that an angle is looked for with, and steps over a generator turn, coarse ones and the fine ones in each: an
/// eighth of the wave of the highest order, and less.
const ROWS_OF_A_SEARCH: usize = 300;
const STEPS_OF_A_TURN: f64 = 48.0;
const FINE_STEPS: f64 = 8.0;

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
    if files.len() > MOST_LOGS || agreement.alone_arcsec.powi(2) >= TURNED_BACK * before * before {
        return None;
    }
    let (folds, chosen) = by_log(rows, parts, &model.scales);
    let first = Model { coefficients: folds.fit(&[0], &chosen, &[])?, chosen, scales: model.scales };
    let (ratio, says) = (prior.nominal.ratio, |at: &State| first.says_arcsec(at, prior));
    let in_a_turn = [PartName::OutputAngle, PartName::MaterialAngle].iter().all(|part| first.of(*part).is_none());
    let repeats = TAU * if in_a_turn && prior.table.is_none() { 1.0 } else { ratio.abs() };
    let step = TAU / STEPS_OF_A_TURN;
    let turned_by = |log: usize| {
        let of_log = rows.rows.iter().filter(move |row| row.at.log == log);
        let friction = model.scales.friction_n_m;
        let search = PhaseSearch::new(&says, ratio, (of_log, |row| row.measured_arcsec), friction, ROWS_OF_A_SEARCH);
        let coarse = search.found(repeats, step, step / FINE_STEPS);
        let [found, _] = search.close_to(coarse.zero_rad, step / FINE_STEPS);
        // A curve that hardly goes beyond a turn tells no turns.
        let in_a_turn = within(found, TAU);
        let tells_turns = search.squares(in_a_turn) > OTHER_TURN * search.squares(found);
        if tells_turns { within(found, repeats) } else { in_a_turn }
    };
    let turned: Vec<f64> = (0..files.len()).map(|log| if log == 0 { 0.0 } else { turned_by(log) }).collect();
    let mut rows = rows.clone();
    for row in &mut rows.rows {
        row.at.generator_rad -= turned[row.at.log];
        row.at.output_rad -= turned[row.at.log] / ratio;
    }
    let rows = rows.less(prior);
    let Agreement { alone_arcsec, together_arcsec: after, .. } = Agreement::of(&rows, parts, &model.scales)?;
    let is_near = after * after < TURNED_BACK * before * before && after < AS_ALONE * alone_arcsec;
    is_near.then(|| {
        let of = |(file, turned): (&Recording, &f64)| {
            let turns = if turned.abs() > TAU { format!(" ({:+.2} turns)", turned / TAU) } else { String::new() };
            format!("{:+.2} deg{turns} in {}", turned.to_degrees(), file.file)
        };
        let list: Vec<String> = files.iter().zip(&turned).skip(1).map(of).collect();
        format!(
            "the zero of the generator is not the same in all logs: against {} it reads {}; turned back they would \
             leave {after:.2} arcsec rms instead of {before:.2}. Home it in the same place before each log, or give \
             one log alone",
            files[0].file,
            list.join(", ")
        )
    })
}
