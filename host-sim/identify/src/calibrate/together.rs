//! Whether several logs are of one unit, read in one way, and where their generators start.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::Model;
use super::folds::{Chosen, Folds, LEAST_GAIN, PENALTIES, Row};
use super::interval::OF_95;
use super::parts::{PartName, Scales, State};
use super::prior::Prior;
use super::reading::Reading;
use super::rows::{Recorded, Rows};
use super::zero::{PhaseSearch, thinned, within};
use crate::measurement::Recording;
use flexspline_base::robust::dot;
use flexspline_base::units::ARCSEC_PER_RAD;

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

/// A generator that is turned back by what its waves say has to leave less than this share of the squares, … *Guess*.
const TURNED_BACK: f64 = 0.8;
/// … and, of what all logs together leave beyond each alone, no more than this share: else it is not the zero alone
/// that differs. *Guess*.
const BEYOND_ALONE: f64 = 0.25;
/// Whole turns are told if without them this multiple of the squares is left, at least. *Guess*.
const OTHER_TURN: f64 = 1.2;
/// Logs that are turned, at most: pieces of one log with zeros of their own are many, and their generator is one.
/// *Guess*.
const MOST_LOGS: usize = 8;
/// Rows that an angle is looked for with, and found with, and steps over a generator turn, coarse ones and the fine
/// ones in each: an eighth of the wave of the highest order, and less. *Guesses*.
const ROWS_OF_A_SEARCH: usize = 300;
const FOUND_WITH: usize = 3000;
const STEPS_OF_A_TURN: f64 = 48.0;
const FINE_STEPS: f64 = 8.0;
/// An output that is off by this, rad, has another zero, or its generator has: beyond clearance and wind-up. *Guess*.
const OTHER_ZERO_RAD: f64 = 1500.0 / ARCSEC_PER_RAD;
/// Fits to the output's angles that find a zero: the first with the waves where they are not. *Guess*.
const FITS_TO_THE_OUTPUT: usize = 2;

/// Name of the reading of a zero.
pub(super) const ZERO: &str = "zero";

/// Where the generator of a log starts, against the first log.
struct Start {
    /// Generator angle of the log where that of the first is zero, rad, with its standard deviation; none if the log
    /// does not tell it.
    zero_rad: Option<[f64; 2]>,
    /// Whole turns of the output that it reads more than the first.
    output_turns: f64,
}

/// Where the generators of several logs start.
pub(super) struct Starts(Vec<Start>);

impl Starts {
    /// Of two logs and more, if one starts elsewhere than the first.
    ///
    /// An output that reads absolutely says where the generator was: the ratio times what it is off. Whether it reads
    /// so is seen by what a fit to both logs leaves; else the waves say what they can.
    pub(super) fn of(rows: &Rows, recorded: &Recorded, prior: &Prior<'_>, files: &[Recording]) -> Option<Starts> {
        let parts = recorded.shown(PartName::ALL, prior);
        let pair = |log: usize| {
            let (rows, one_file) = (rows.of_logs([0, log]), files[log].file == files[0].file);
            LogPair { rows, log, one_file, parts: &parts, scales: &recorded.scales, prior }
        };
        let begins = |log: usize| files[log].sessions.first().map_or(0.0, |session| session.zero_off_rad);
        let first = Start { zero_rad: Some([0.0; 2]), output_turns: 0.0 };
        let logs = if files.len() > MOST_LOGS { 1 } else { files.len() };
        let others = (1..logs).into_par_iter().map(|log| pair(log).start(begins(log) - begins(0)));
        let mut all: Vec<Start> = others.collect();
        all.insert(0, first);
        let elsewhere = |start: &Start| start.output_turns != 0.0 || start.zero_rad.is_none_or(|[zero, _]| zero != 0.0);
        all.iter().any(elsewhere).then_some(Starts(all))
    }

    /// The logs on the zero of the first, without those that do not tell theirs.
    pub(super) fn on_one(&self, files: Vec<Recording>, ratio: f64) -> Vec<Recording> {
        let turned = |(mut file, start): (Recording, &Start)| {
            let [zero, _] = start.zero_rad?;
            file.sessions.iter_mut().for_each(|session| session.turn_generator(zero, ratio));
            Some(file)
        };
        files.into_iter().zip(&self.0).filter_map(turned).collect()
    }

    /// The zeros, deg of the generator.
    pub(super) fn readings(&self, files: &[Recording]) -> Vec<Reading> {
        Reading::of_logs(ZERO, files, self.0.iter().map(|start| Some(start.zero_rad?.map(f64::to_degrees))))
    }

    /// Notes on them.
    pub(super) fn notes(&self, files: &[Recording]) -> Vec<String> {
        let name = |log: usize| files[log].file.as_str();
        let others = || (1..).zip(&self.0[1..]);
        let zeros = others().filter_map(|(log, start)| Some((log, start.zero_rad.filter(|[zero, _]| *zero != 0.0)?)));
        let zeros = zeros.map(|(log, [zero, std])| {
            let turns = if zero.abs() > TAU { format!(" ({:+.2} turns)", zero / TAU) } else { String::new() };
            format!("{:+.2} ± {:.2} deg{turns} in {}", zero.to_degrees(), OF_95 * std.to_degrees(), name(log))
        });
        let zeros: Vec<String> = zeros.collect();
        let put = format!(
            "the zero of the generator is not the same in all logs: against {} it reads {}; they are put on that of \
             the first",
            name(0),
            zeros.join(", ")
        );
        let turns = others().filter(|(_, start)| start.output_turns != 0.0).map(|(log, start)| {
            format!("the output reads {:+.0} turns more in {} than in {}", start.output_turns, name(log), name(0))
        });
        let untold = others().filter(|(_, start)| start.zero_rad.is_none()).map(|(log, _)| {
            format!(
                "{} is left out: its generator starts elsewhere than that of {}, and neither the output nor the waves \
                 say where; home it in the same place, or record more of its turn",
                name(log),
                name(0)
            )
        });
        (!zeros.is_empty()).then_some(put).into_iter().chain(turns).chain(untold).collect()
    }
}

/// The rows of the first log and of another.
struct LogPair<'a> {
    rows: Rows,
    log: usize,
    /// Whether both are of one file: then the generator hardly counts whole turns anew.
    one_file: bool,
    parts: &'a [PartName],
    scales: &'a Scales,
    prior: &'a Prior<'a>,
}

impl LogPair<'_> {
    /// With the generator of the other turned back, and the angle of the output, which is the generator's over the
    /// ratio.
    fn turned(&self, zero_rad: f64) -> Rows {
        let mut rows = self.rows.clone();
        for row in rows.rows.iter_mut().filter(|row| row.at.log == self.log) {
            row.at.generator_rad -= zero_rad;
            row.at.output_rad -= zero_rad / self.prior.nominal.ratio;
        }
        rows.less(self.prior)
    }

    fn agreement(&self, zero_rad: f64) -> Option<Agreement> {
        Agreement::of(&self.turned(zero_rad), self.parts, self.scales)
    }

    /// By how much the output of the other reads more than a fit to both says, rad.
    fn output_off(&self, zero_rad: f64) -> Option<f64> {
        let rows = self.turned(zero_rad);
        let folds = Folds::new(&rows.rows, self.parts, self.scales, rows.means_arcsec.len(), false);
        let chosen: Vec<Chosen> = self.parts.iter().map(|part| Chosen { part: *part, penalty: PENALTIES[0] }).collect();
        let zeros = folds.fit(&folds.all(), &chosen, &[])?;
        let zero = |log: usize| rows.means_arcsec[log] + zeros[log];
        Some((zero(self.log) - zero(0)) / ARCSEC_PER_RAD)
    }

    /// Where the other starts; `off_rad` was taken off its output when it was read.
    fn start(&self, off_rad: f64) -> Start {
        let ratio = self.prior.nominal.ratio;
        let means = &self.rows.means_arcsec;
        let mut off = off_rad + (means[self.log] - means[0]) / ARCSEC_PER_RAD;
        let turns = |off: f64| ((off - within(off, TAU)) / TAU).round();
        let elsewhere = within(off, TAU).abs() > OTHER_ZERO_RAD;
        let same = Start { zero_rad: Some([0.0; 2]), output_turns: if elsewhere { 0.0 } else { turns(off) } };
        let Some(stands) = self.agreement(0.0) else { return same };
        let squares = |agreement: &Agreement| agreement.together_arcsec.powi(2);
        // All together never leave less than each alone, whichever way they are turned.
        let alone = stands.alone_arcsec.powi(2);
        let may_gain = |share: f64| alone < share * squares(&stands);
        let left = |zero: &f64| self.agreement(*zero).map_or(f64::INFINITY, |turned| squares(&turned));
        let gains = |left: f64, share: f64| {
            left < share * squares(&stands) && left - alone < BEYOND_ALONE * (squares(&stands) - alone)
        };
        if !may_gain(1.0 - LEAST_GAIN) {
            return same;
        }
        for _ in 0..FITS_TO_THE_OUTPUT {
            let Some(by_fit) = self.output_off(-ratio * within(off, TAU)) else { return same };
            off = off_rad + by_fit;
        }
        let step = TAU / STEPS_OF_A_TURN / FINE_STEPS;
        let by_output = -ratio * within(off, TAU);
        let left_by_output = if by_output.abs() > step { left(&by_output) } else { f64::INFINITY };
        let absolute = gains(left_by_output, 1.0 - LEAST_GAIN);
        let by_waves = || self.by_waves().filter(|zero| gains(left(zero), TURNED_BACK));
        let found = absolute.then_some(by_output).or_else(|| may_gain(TURNED_BACK).then(by_waves).flatten());
        let found = found.and_then(|zero| self.search(FOUND_WITH, |search| search.close_to(zero, step)));
        // As it stands is what nobody would turn: it is told where turning it leaves more.
        let untold = elsewhere && may_gain(TURNED_BACK) && left_by_output < squares(&stands);
        match found {
            Some(zero) if absolute => Start { zero_rad: Some(zero), output_turns: turns(off) },
            None if untold => Start { zero_rad: None, ..same },
            zero => Start { zero_rad: zero.or(same.zero_rad), ..same },
        }
    }

    /// Lays the other log against a fit to the first.
    fn search<T>(&self, most: usize, of: impl FnOnce(&PhaseSearch<'_>) -> T) -> Option<T> {
        let (folds, chosen) = by_log(&self.rows, self.parts, self.scales);
        let first = Model { coefficients: folds.fit(&[0], &chosen, &[])?, chosen, scales: *self.scales };
        let rows = thinned(self.rows.rows.iter().filter(|row| row.at.log == self.log), most);
        let columns: Vec<Vec<f64>> = rows.iter().map(|row| first.columns(&row.at)).collect();
        let says = |zero: f64| {
            let turned = first.turned(zero, self.prior.nominal.ratio);
            let prior = |at: State| self.prior.steady_arcsec(&State { generator_rad: at.generator_rad - zero, ..at });
            rows.iter().zip(&columns).map(|(row, columns)| prior(row.at) + dot(columns, &turned)).collect()
        };
        Some(of(&PhaseSearch::new(&says, &rows, self.scales.friction_n_m)))
    }

    /// The zero of the other that the waves say.
    fn by_waves(&self) -> Option<f64> {
        let in_a_turn = [PartName::OutputAngle, PartName::MaterialAngle].iter().all(|part| !self.parts.contains(part));
        let repeats = TAU * if in_a_turn && self.prior.table.is_none() { 1.0 } else { self.prior.nominal.ratio.abs() };
        let step = TAU / STEPS_OF_A_TURN;
        self.search(ROWS_OF_A_SEARCH, |search| {
            let (coarse, _) = search.found(repeats, step, step / FINE_STEPS);
            let [found, _] = search.close_to(coarse, step / FINE_STEPS);
            // A curve that hardly goes beyond a turn tells no turns.
            let in_a_turn = within(found, TAU);
            let tells_turns = !self.one_file && search.squares(in_a_turn) > OTHER_TURN * search.squares(found);
            if tells_turns { within(found, repeats) } else { in_a_turn }
        })
    }
}
