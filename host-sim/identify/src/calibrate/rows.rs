//! From sessions to rows that a steady model can be fitted to: direction, settled or not, folds.

use std::f64::consts::TAU;
use std::ops::Range;
use std::slice::from_ref;

use super::Model;
use super::folds::{Folds, Row};
use super::parts::{self, PartName, Scales, State, flank, width_of};
use super::prior::Prior;
use super::zero::OF_95_OF_BLOCKS;
use crate::measurement::{
    HELD, Recording, Session, TURNED_BACK_RAD, least_and_most, quantile_of, rates, sampled, turns, white_noise,
};
use crate::misfit::{about_mean, correlation};
use crate::residual::lasting_step;
use flexspline_base::statistics::mean;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::tables::{PARTS_OF_A_TURN, parts_between};

/// Folds that records are cut into: blocks of a tenth of each or so, which say what a table does beyond what it saw.
const BLOCKS: usize = 8;
/// Times that they go round in a record whose loads take longer than a block: passes at one load each.
const ROUNDS: usize = 4;
/// What a fold was recorded at is within what the others were by this share of all loads: beyond it no table is asked.
/// A guess.
const BEYOND_OTHERS: f64 = 0.1;
/// With this number of files each is a fold.
const ENOUGH_FILES: usize = 3;
/// Rows that are fitted, at most; of longer records every n-th.
pub(super) const MOST_ROWS: usize = 40_000;
/// A reversal is one if the generator goes back by this share of its usual step.
const TURNED_ROUND: f64 = 0.5;
/// The output has settled on a flank when the generator has turned by this multiple of the play.
const SETTLED: f64 = 1.5;

/// Turns of the motion that tell what the torque does there, at least. *Guess*.
const FEWEST_TURNS: f64 = 4.0;
/// Rows to either side of a turn that show it. *Guess*: friction changes over within some, and a load by little.
const BESIDE_A_TURN: Range<usize> = 2..10;
/// A load decides the flank if it is this number of standard deviations of its noise beyond what decides it. *Guess*.
const SURE: f64 = 3.0;
/// A load is changed at once where it goes by this share of the largest from one row to the next… *Guess*: a hundred
/// rows lead an arm through its load.
const SUDDEN: f64 = 0.01;
/// …and by this multiple of what it usually does, noise or swing. *Guess*: of 10⁵ rows no noise goes so far.
const FAR_FASTER: f64 = 6.0;

/// Rows of all files.
#[derive(Clone, Default)]
pub(super) struct Rows {
    pub rows: Vec<Row>,
    /// Session and load, N·m, of each row that was looked at, the unsettled ones among them.
    pub loads: Vec<(usize, f64)>,
    /// Means taken off the measured error and off the residual of each file, arcsec.
    measured_means_arcsec: Vec<f64>,
    pub means_arcsec: Vec<f64>,
    /// Whether each file is a fold; else the folds are blocks of each.
    pub by_file: bool,
}

/// States that the files have recorded.
#[derive(Clone, Default)]
pub(super) struct Recorded {
    pub scales: Scales,
    pub has_torque: bool,
    /// Whether no log has two loads, though the logs together do: then a load is as good as a zero.
    pub each_keeps_to_one_load: bool,
    /// Whether none of several sessions has two: then a load is as good as a zero unless the output kept its own.
    pub sessions_keep_to_one_load: bool,
    pub has_temperature: bool,
    /// Shares of the turns of generator and output with rows in them.
    pub generator_share: f64,
    pub output_share: f64,
    /// Parts of the output's turn between rows, a bit each.
    pub parts: u64,
    pub generator_turns: f64,
    /// Of the way of the generator, there and back.
    pub backward_share: f64,
    /// Noise of the torque from row to row, N·m.
    pub torque_noise_n_m: f64,
    /// Usual step of the generator, rad.
    pub step_rad: f64,
    /// Generator turns in steps that are short beside a tooth pitch.
    pub fine_turns: f64,
    pub temperature_c: f64,
    /// Whether each direction was driven at one pace.
    pub one_pace: bool,
    /// Step of the resolution of both angles at the output, rad; 0 where noise blurs it.
    pub coarse_rad: f64,
}

/// Standard deviation of the delay between two angles of which nothing is known, s: that of any two instants of the
/// time between rows, or of the cycle of a slow controller's task, 10 ms, where rows are slower. A guess.
pub(super) fn late_s(period_s: f64) -> f64 {
    /// A guess.
    const SLOW_TASK_S: f64 = 0.01;
    let apart_s = if period_s > 0.0 { period_s.min(SLOW_TASK_S) } else { SLOW_TASK_S };
    apart_s / 12.0_f64.sqrt()
}

impl Recorded {
    pub fn of(files: &[Recording], prior: &Prior<'_>) -> Recorded {
        let sessions = || files.iter().flat_map(|file| &file.sessions);
        let has_torque = sessions().all(|session| session.torque_n_m.is_some());
        let has_temperature = sessions().all(|session| session.temperature_c.is_some());
        let torque = least_and_most(sessions().flat_map(|s| s.torque_n_m.iter().flatten().copied()));
        let temperature = least_and_most(sessions().flat_map(|s| s.temperature_c.iter().flatten().copied()));
        let usual = prior.nominal.temperature_c;
        let angles = |scale: f64| sessions().flat_map(move |s| s.generator_rad.iter().map(move |psi| psi * scale));
        let generator = least_and_most(angles(1.0));
        let steps = sessions().flat_map(|s| s.generator_rad.windows(2).map(|p| p[1] - p[0]));
        let steps: Vec<f64> = steps.map(|step| step * prior.nominal.ratio.signum()).collect();
        let step_rad = quantile_of(&mut sampled(&steps.iter().map(|step| step.abs()).collect::<Vec<f64>>()), 0.9);
        // By the way and not by rows: one direction may be driven at another pace.
        let way = |of: &dyn Fn(&f64) -> bool| steps.iter().filter(|step| of(step)).map(|step| step.abs()).sum::<f64>();
        let (moved, backward) = (way(&|_| true), way(&|step| *step < 0.0));
        let fine_rad = TAU / (super::ROWS_OF_A_PITCH * prior.tooth_pitches());
        let fine_turns = way(&|step| step.abs() <= fine_rad * (1.0 + 1e-3)) / TAU;
        let most = torque.0.abs().max(torque.1.abs());
        let speeds = sessions().flat_map(|session| speeds_rad_s(session, prior.nominal.ratio));
        let speeds = sampled(&speeds.filter(|speed| speed.abs() > 0.0).collect::<Vec<f64>>());
        let paces = |of: &dyn Fn(f64) -> f64| {
            let mut some: Vec<f64> = speeds.iter().map(|speed| of(*speed)).filter(|pace| *pace > 0.0).collect();
            [0.1, 0.9].map(|share| quantile_of(&mut some, share))
        };
        let [_, fast] = paces(&f64::abs);
        // What a delay does by the pace, play does by the direction: each has to be driven at several, or one.
        let several = |[slow, fast]: [f64; 2]| fast > 0.0 && fast >= super::OTHER_PACE * slow;
        let one_pace = ![paces(&|speed| speed), paces(&|speed| -speed)].into_iter().any(several);
        let periods: Vec<f64> =
            sessions().filter_map(|s| s.time_s.as_ref()).flat_map(|t| t.windows(2).map(|p| p[1] - p[0])).collect();
        let period_s = quantile_of(&mut sampled(&periods), 0.5);
        let one_load = |sessions: &[Session]| {
            let loads = sessions.iter().flat_map(|session| session.torque_n_m.iter().flatten().copied());
            let (low, high) = least_and_most(loads);
            high - low < super::LEAST_FRICTION * most
        };
        let several = |count: usize| has_torque && count > 1;
        let output = || angles(1.0 / prior.nominal.ratio);
        let output_share = share_with_rows(without_rows(output(), PARTS_OF_A_TURN), PARTS_OF_A_TURN);
        // Nearer to a row no wave can come to zero.
        let near = output().flat_map(|of| [-1.0, 0.0, 1.0].map(|k| of + k * super::PERIOD_OF_THE_OUTPUT * TAU));
        let torque_noise_n_m = white_noise(sessions().filter_map(|session| session.torque_n_m.as_deref()));
        Recorded {
            torque_noise_n_m,
            scales: Scales {
                torque_n_m: if has_torque { [torque.0, torque.1] } else { [0.0; 2] },
                friction_n_m: prior.friction_n_m().max(if has_torque { super::LEAST_FRICTION * most } else { 0.0 }),
                temperature_c: if has_temperature { [temperature.0, temperature.1] } else { [usual; 2] },
                teeth: prior.tooth_pitches(),
                speed_rad_s: fast,
                late_s: late_s(period_s),
                unrecorded: without_rows(near, PARTS_OF_A_TURN),
            },
            coarse_rad: sessions().map(|session| session.coarse_rad).fold(0.0, f64::max),
            one_pace,
            has_torque,
            each_keeps_to_one_load: several(files.len()) && files.iter().all(|file| one_load(&file.sessions)),
            sessions_keep_to_one_load: several(sessions().count()) && sessions().all(|of| one_load(from_ref(of))),
            has_temperature,
            generator_share: share_with_rows(without_rows(angles(1.0), 24), 24),
            output_share,
            parts: parts_between(output()),
            generator_turns: (generator.1 - generator.0) / TAU,
            backward_share: if moved > 0.0 { backward / moved } else { 0.0 },
            step_rad,
            fine_turns,
            temperature_c: if has_temperature { f64::midpoint(temperature.0, temperature.1) } else { usual },
        }
    }

    /// Of some parts those that can be fitted to what was recorded.
    pub(crate) fn shown(&self, parts: impl IntoIterator<Item = PartName>, prior: &Prior<'_>) -> Vec<PartName> {
        parts.into_iter().filter(|part| self.lacks(*part, prior).is_none()).collect()
    }

    /// Whether the generator kept to one pace in each direction, or there is no time: there a delay and play are one.
    pub(crate) fn hides_a_delay(&self) -> bool {
        self.scales.speed_rad_s <= 0.0 || self.one_pace
    }

    /// Why a part cannot be fitted to what was recorded, if it cannot.
    pub(crate) fn lacks(&self, part: PartName, prior: &Prior<'_>) -> Option<String> {
        let [low, high] = self.scales.torque_n_m;
        let [cold, warm] = self.scales.temperature_c;
        // In an eighth of a turn of the output two waves in a turn gain a quarter of one on two in a turn against the
        // output: enough for folds left out to choose. A guess.
        let turns_to_tell = 0.125 * prior.nominal.ratio.abs();
        match part {
            PartName::WindUp if !self.has_torque => Some("no torque was recorded".to_owned()),
            PartName::WindUp if high - low < super::SAME_TORQUE * low.abs().max(high.abs()) || high <= low => {
                Some(format!("the torque keeps to {high:.3} N·m"))
            }
            PartName::WindUp if self.each_keeps_to_one_load => {
                Some("each log keeps to one load, which is as good as a zero of the output".to_owned())
            }
            PartName::Play if !(super::BOTH_WAYS..=1.0 - super::BOTH_WAYS).contains(&self.backward_share) => {
                Some(format!(
                    "{:.0} % of the motion is backward: one direction alone says nothing of the play",
                    100.0 * self.backward_share.abs()
                ))
            }
            PartName::GeneratorAngle if self.generator_share < super::MOST_OF_A_TURN => {
                Some(format!("{:.0} % of a generator turn was recorded", 100.0 * self.generator_share))
            }
            PartName::MaterialAngle if self.generator_turns < turns_to_tell => Some(format!(
                "{:.1} generator turns; {turns_to_tell:.1} tell it from the generator angle",
                self.generator_turns
            )),
            PartName::ToothPitch if prior.nominal.teeth.is_none() && prior.table.is_none() => {
                Some("the teeth are not known, the ratio alone is".to_owned())
            }
            PartName::ToothPitch if self.fine_turns < super::FINE_TURNS => {
                Some(format!("rows are {:.2} tooth pitches apart", self.step_rad * self.scales.teeth / TAU))
            }
            PartName::OutputAngle if self.output_share < super::PERIOD_OF_THE_OUTPUT => {
                Some(format!("{:.0} % of an output turn was recorded", 100.0 * self.output_share))
            }
            PartName::Temperature if !self.has_temperature => Some("no temperature was recorded".to_owned()),
            PartName::Temperature if warm - cold < super::ONE_TEMPERATURE_K => {
                Some(format!("the temperature varies by {:.1} K", warm - cold))
            }
            _ => None,
        }
    }
}

/// Half of what the torque changes by where the motion turns round, N·m; 0 where that is not certain.
pub(super) fn torque_by_way(files: &[Recording], ratio: f64) -> f64 {
    let of_session = |session: &Session| -> Vec<f64> {
        let (angle, torque) = (&session.generator_rad, session.torque_n_m.as_deref().unwrap_or_default());
        let turns = turns(angle, TURNED_BACK_RAD);
        let turned = turns.windows(2).enumerate().filter(|(_, w)| w[0].0 * w[1].0 < 0.0);
        let rise = |w: &[f64]| mean(&w[w.len() / 2..]) - mean(&w[..w.len() / 2]);
        let by_turn = turned.filter_map(|(k, w)| {
            let at = angle[..=k].iter().rposition(|psi| *psi == w[1].1)?;
            let before = torque.get(at.checked_sub(BESIDE_A_TURN.end)?..at - BESIDE_A_TURN.start)?;
            let after = torque.get(at + BESIDE_A_TURN.start + 1..=at + BESIDE_A_TURN.end)?;
            // A load that goes on at one rate does not change: the means are 13 rows apart, those of halves 4.
            let change = mean(after) - mean(before) - 13.0 / 8.0 * (rise(before) + rise(after));
            Some(0.5 * w[1].0 * ratio.signum() * change)
        });
        by_turn.collect()
    };
    let by_turn: Vec<f64> = files.iter().flat_map(|file| &file.sessions).flat_map(of_session).collect();
    let (by_way, count) = (mean(&by_turn), by_turn.len() as f64);
    let std = about_mean(&by_turn) / (count - 1.0).max(1.0).sqrt();
    if count >= FEWEST_TURNS && by_way > OF_95_OF_BLOCKS * std { by_way } else { 0.0 }
}

/// Speed of the output in each row, rad/s; 0 where no time says it.
pub(super) fn speeds_rad_s(session: &Session, ratio: f64) -> Vec<f64> {
    let Some(time) = &session.time_s else { return vec![0.0; session.len()] };
    let mut speeds = rates(std::slice::from_ref(&(0..session.len())), time, &session.generator_rad);
    speeds.iter_mut().for_each(|speed| *speed /= ratio);
    speeds
}

/// Which of the `parts` of a turn have no angles in them, a bit each.
fn without_rows(angles: impl Iterator<Item = f64>, parts: usize) -> u64 {
    let part = |angle: f64| (angle.rem_euclid(TAU) / TAU * parts as f64) as usize % parts;
    angles.fold((1 << parts) - 1, |without, angle| without & !(1 << part(angle)))
}

/// Share of the `parts` of a turn that have rows.
fn share_with_rows(without: u64, parts: usize) -> f64 {
    (parts - without.count_ones() as usize) as f64 / parts as f64
}

/// Of how many rows one is fitted, of a record of `total`. No whole number: such rows may all lie at the same few
/// angles.
pub fn one_in(total: usize) -> f64 {
    let every = total as f64 / MOST_ROWS as f64;
    if every > 1.0 { every + super::GOLDEN } else { 1.0 }
}

/// The rows on which a steady model can be judged: outside of the play of the prior.
pub(super) fn settled(files: &[Recording], prior: &Prior<'_>, recorded: &Recorded) -> Rows {
    let play_rad = prior.nominal.backlash_arcsec / ARCSEC_PER_RAD;
    let total: usize = files.iter().flat_map(|file| &file.sessions).map(Session::len).sum();
    let every = one_in(total);
    let mut all = Rows::default();
    let mut sessions = 0..;
    for (zero, file) in files.iter().enumerate() {
        let begin = all.rows.len();
        for (session, number) in file.sessions.iter().zip(sessions.by_ref()) {
            let settle_rad = SETTLED * play_rad * prior.nominal.ratio.abs();
            let mut ways = directions(session, prior.nominal.ratio, recorded.step_rad, settle_rad);
            held_by_load(&mut ways, session, recorded.scales.friction_n_m, settle_rad);
            let speeds = speeds_rad_s(session, prior.nominal.ratio);
            let thinned = (0..).map(|k| (f64::from(k) * every) as usize).take_while(|k| *k < session.len());
            for k in thinned {
                let at = |column: &Option<Vec<f64>>, usual: f64| column.as_ref().map_or(usual, |values| values[k]);
                let torque_n_m = if recorded.has_torque { at(&session.torque_n_m, 0.0) } else { 0.0 };
                all.loads.push((number, torque_n_m));
                let Some(way) = ways[k] else { continue };
                let generator_rad = session.generator_rad[k];
                let at = State {
                    generator_rad,
                    output_rad: generator_rad / prior.nominal.ratio,
                    torque_n_m,
                    temperature_c: at(&session.temperature_c, recorded.temperature_c),
                    way,
                    speed_rad_s: speeds[k],
                    log: zero,
                };
                let measured_arcsec = session.error_rad[k] * ARCSEC_PER_RAD;
                let (number, line) = (all.loads.len() - 1, session.line[k]);
                all.rows.push(Row { at, measured_arcsec, left_arcsec: 0.0, fold: 0, number, line });
            }
        }
        // Zeros of encoders are large numbers that squares do not like.
        let of_file = &mut all.rows[begin..];
        let mean = of_file.iter().map(|row| row.measured_arcsec).sum::<f64>() / of_file.len().max(1) as f64;
        of_file.iter_mut().for_each(|row| row.measured_arcsec -= mean);
        all.measured_means_arcsec.push(mean);
    }
    let by_file = (files.len() >= ENOUGH_FILES).then_some((true, 1));
    for (by_file, rounds) in by_file.into_iter().chain([(false, 1), (false, ROUNDS)]) {
        all.fold(by_file, rounds);
        if all.folds_are_within_each_other(&recorded.scales) {
            break;
        }
    }
    all.less(prior)
}

impl Rows {
    /// Makes folds: of files, or of the blocks that each file is cut into, which go round a number of times.
    fn fold(&mut self, by_file: bool, rounds: usize) {
        self.by_file = by_file;
        let mut of_file = vec![0; self.measured_means_arcsec.len()];
        self.rows.iter().for_each(|row| of_file[row.at.log] += 1);
        let mut before = vec![0; of_file.len()];
        for row in &mut self.rows {
            let block = before[row.at.log] * BLOCKS * rounds / of_file[row.at.log];
            before[row.at.log] += 1;
            row.fold = if by_file { row.at.log } else { block } % BLOCKS;
        }
    }

    /// Whether each fold was recorded at loads that the others were recorded at, too, and those without any one of
    /// them, as parts are chosen: what a fit says beyond is no measure of a table, which ends where the loads do.
    fn folds_are_within_each_other(&self, scales: &Scales) -> bool {
        let [low, high] = scales.torque_n_m;
        let beyond = BEYOND_OTHERS * (high - low);
        let loads =
            |fold: usize| least_and_most(self.rows.iter().filter(|row| row.fold == fold).map(|row| row.at.torque_n_m));
        let loads: Vec<(usize, (f64, f64))> =
            (0..BLOCKS).map(|fold| (fold, loads(fold))).filter(|(_, (low, high))| low <= high).collect();
        loads.iter().all(|(fold, own)| {
            loads.iter().filter(|(without, _)| without != fold).all(|(without, _)| {
                let rest = || loads.iter().filter(|(other, _)| other != fold && other != without);
                own.0 >= rest().map(|(_, of)| of.0).fold(f64::INFINITY, f64::min) - beyond
                    && own.1 <= rest().map(|(_, of)| of.1).fold(f64::NEG_INFINITY, f64::max) + beyond
            })
        })
    }

    /// Correlation of the load with what the first waves of the output make of it, 0 to 1.
    pub(crate) fn load_with_output_angle(&self) -> f64 {
        let of = |value: fn(&State) -> f64| self.rows.iter().map(|row| value(&row.at)).collect::<Vec<f64>>();
        correlation(&of(|at| at.torque_n_m), &[of(|_| 1.0), of(|at| at.output_rad.sin()), of(|at| at.output_rad.cos())])
    }

    /// Where an encoder lost its index, in what a model leaves, beside all `parts` that may be there and a delay of
    /// each log: the log, the line from which on the error has another zero, how far that is off, arcsec, and whether
    /// it has the one before again from the next session on.
    pub(crate) fn lost_index(&self, model: &Model, mut parts: Vec<PartName>) -> Option<(usize, (u64, f64, bool))> {
        let logs = self.means_arcsec.len();
        parts.extend((0..logs).map(PartName::ReadingDelay));
        // Rows that do not count, and the end of a session, keep those beside them apart.
        let session = |row: &Row| self.loads[row.number].0;
        let place = |row: &Row| row.number + session(row);
        let mut left = vec![None; place(self.rows.last()?) + 1];
        for row in &self.rows {
            left[place(row)] = Some(row.left_arcsec - model.adds_arcsec(&row.at));
        }
        let columns = || {
            let mut columns = vec![vec![0.0; left.len()]; logs + width_of(&parts)];
            for row in &self.rows {
                columns[row.at.log][place(row)] = 1.0;
                let of_parts = columns[logs..].iter_mut().zip(parts::row(&parts, &row.at, &model.scales));
                of_parts.for_each(|(column, value)| column[place(row)] = value);
            }
            columns
        };
        // A flank that changes is none, or one that friction lets go: neither lies among the rows about a step.
        let flank = |row: &Row| flank(&row.at, model.scales.friction_n_m);
        let most_n_m = self.loads.iter().fold(0.0, |most: f64, (_, load)| most.max(load.abs()));
        let held_n_m = HELD * most_n_m;
        let hold = |row: &Row| (session(row), row.at.way, flank(row), row.at.torque_n_m.abs() >= held_n_m);
        let (mut ends, mut ends_of_sessions) = (vec![0; logs], vec![0; session(self.rows.last()?) + 1]);
        for row in &self.rows {
            ends[row.at.log] = place(row) + 1;
            ends_of_sessions[session(row)] = place(row) + 1;
        }
        // Nor does a load that is changed at once: what the model has of the spring is not exact.
        let change = |a: &Row, b: &Row| (a.at.torque_n_m - b.at.torque_n_m).abs();
        let mut changes: Vec<f64> = self.rows.windows(2).map(|pair| change(&pair[0], &pair[1])).collect();
        let steady_n_m = (SUDDEN * most_n_m).max(FAR_FASTER * quantile_of(&mut changes, 0.5));
        let goes_on = |a: &Row, b: &Row| hold(a) == hold(b) && change(a, b) <= steady_n_m;
        let places = self.rows.chunk_by(goes_on).filter(|rows| hold(&rows[0]).3).flat_map(|rows| {
            let of = place(&rows[0])..place(&rows[rows.len() - 1]) + 1;
            let mut to = vec![ends[rows[0].at.log], ends_of_sessions[session(&rows[0])]];
            to.dedup();
            let steps = rows[1..].iter().map(place).flat_map(move |row| to.clone().into_iter().map(move |to| row..to));
            steps.map(move |rows| (rows, of.clone()))
        });
        let in_order: Vec<f64> = left.iter().flatten().copied().collect();
        let (at, size) = lasting_step(&left, columns, places, (white_noise([in_order.as_slice()]), 0.0))?;
        let row = self.rows.iter().find(|row| place(row) == at.start)?;
        Some((row.at.log, (row.line, size, at.end < ends[row.at.log])))
    }

    /// Those of some logs.
    pub(crate) fn of_logs(&self, logs: [usize; 2]) -> Rows {
        let rows = self.rows.iter().filter(|row| logs.contains(&row.at.log)).copied().collect();
        Rows { rows, ..self.clone() }
    }

    /// With blocks of each log for folds: what is a log's own is not seen in the others.
    pub(crate) fn in_blocks(mut self) -> Rows {
        if self.by_file {
            self.fold(false, ROUNDS);
        }
        self
    }

    /// Sums over their folds.
    pub(crate) fn folds_of(&self, parts: &[PartName], scales: &Scales) -> Folds {
        Folds::new(&self.rows, parts, scales, self.means_arcsec.len(), self.by_file)
    }

    /// Without the rows of which the noise of the torque leaves open on which flank they lie, where loads from
    /// `friction_n_m` on decide it.
    pub(crate) fn sure(mut self, friction_n_m: f64, recorded: &Recorded) -> Rows {
        self.rows.retain(|row| (row.at.torque_n_m.abs() - friction_n_m).abs() >= SURE * recorded.torque_noise_n_m);
        self
    }

    /// With what a prior says taken off what was measured, and the mean of each file off that.
    pub fn less(mut self, prior: &Prior<'_>) -> Rows {
        let mut sums = vec![(0.0, 0.0); self.measured_means_arcsec.len()];
        for row in &mut self.rows {
            row.left_arcsec = row.measured_arcsec - prior.steady_arcsec(&row.at);
            let (sum, count) = &mut sums[row.at.log];
            (*sum, *count) = (*sum + row.left_arcsec, *count + 1.0);
        }
        let means: Vec<f64> = sums.iter().map(|(sum, count)| sum / f64::max(*count, 1.0)).collect();
        self.rows.iter_mut().for_each(|row| row.left_arcsec -= means[row.at.log]);
        self.means_arcsec = self.measured_means_arcsec.iter().zip(&means).map(|(a, b)| a + b).collect();
        self
    }
}

/// Direction of the output in each row; `None` before the first motion, where it begins to turn back, and until the
/// play is through after a reversal.
fn directions(session: &Session, ratio: f64, step_rad: f64, settle_rad: f64) -> Vec<Option<f64>> {
    let angle = &session.generator_rad;
    let turns = turns(angle, TURNED_ROUND * step_rad);
    let settled = |(psi, (way, turned_at)): (&f64, &(f64, f64))| {
        (*way != 0.0 && (psi - turned_at).abs() >= settle_rad).then_some(way * ratio.signum())
    };
    let mut ways: Vec<Option<f64>> = angle.iter().zip(&turns).map(settled).collect();
    for (turned, pair) in turns.windows(2).enumerate().filter(|(_, pair)| pair[0].0 != pair[1].0) {
        (0..=turned).rev().take_while(|row| angle[*row] != pair[1].1).for_each(|row| ways[row] = None);
    }
    ways
}

/// Takes the direction off rows at no load that still lie on the flank where a load left them: until the play is
/// through.
fn held_by_load(ways: &mut [Option<f64>], session: &Session, friction_n_m: f64, settle_rad: f64) {
    let mut left_at = f64::NAN;
    let loads = session.generator_rad.iter().zip(session.torque_n_m.iter().flatten());
    for (way, (psi, torque)) in ways.iter_mut().zip(loads) {
        if torque.abs() > friction_n_m {
            left_at = *psi;
        } else if (psi - left_at).abs() < settle_rad {
            *way = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_output_settles_after_a_reversal() {
        let mut psi: Vec<f64> = vec![0.0; 5];
        psi.extend((1..=20).map(f64::from));
        psi.extend((0..15).map(|k| 19.0 - f64::from(k)));
        let session = Session { generator_rad: psi, error_rad: vec![0.0; 40], ..Session::default() };
        let ways = directions(&session, 100.0, 1.0, 3.0);
        assert_eq!(ways[..7], [None; 7]);
        assert_eq!((ways[7], ways[24], ways[25], ways[26], ways[27]), (Some(1.0), Some(1.0), None, None, Some(-1.0)));
        // An output that turns against the generator.
        assert_eq!(directions(&session, -100.0, 1.0, 3.0)[24], Some(-1.0));
        // Rows that have turned back by less than what says so.
        let session = Session { generator_rad: vec![0.0, 0.5, 1.0, 1.0, 0.995, 0.985, 0.9], ..Session::default() };
        let there = Some(1.0);
        assert_eq!(directions(&session, 100.0, 0.04, 0.0), [None, there, there, there, None, None, Some(-1.0)]);
    }
}
