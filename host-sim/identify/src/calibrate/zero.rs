//! Where the zeros are: a table says its error from the generator's angle, and only whoever knows where that is zero
//! can use it.
//!
//! The phase of a table against a log is the one with which it leaves least of what was measured; load and direction,
//! which no phase changes, are fitted beside it. Its interval is that of blocks of the log left out in turn.

use std::f64::consts::TAU;

use flexspline::{Direction, GeneratorAngle, Table};
use serde::Serialize;

use super::GOLDEN;
use super::folds::Row;
use super::parts::{State, flank};
use super::rows::Rows;
use crate::least_squares::{FreeSpan, jackknife};
use crate::measurement::median_of;
use flexspline_base::robust::dot;
use flexspline_base::units::ARCSEC_PER_RAD;

/// Rows that a phase is looked for with, and found with.
const LOOKED_AT: usize = 1500;
const FOUND_WITH: usize = 6000;
/// Steps over a generator turn, and over a tooth pitch.
const STEPS_OF_A_TURN: usize = 48;
const STEPS_OF_A_PITCH: usize = 24;
/// Steps down from a place to the least, at most. *Guess*: wide play and wind-up move an output by some.
const MOST_STEPS: usize = 24;
/// Best places of the coarse search that are looked at closely.
const CLOSELY: usize = 4;
/// A table repeats if its error does to this, arcsec.
const REPEATS_ARCSEC: f64 = 0.05;
/// The phase is known if the best leaves so much less than the usual one, and than the best of those elsewhere, of the
/// squares. Guesses.
const LEAST_GAIN: f64 = 0.02;
const LEAST_BEFORE_SECOND: f64 = 0.005;
/// Blocks left out in turn, and the half width of 95 % in standard deviations of their number.
pub(super) const BLOCKS: usize = 8;
pub(super) const OF_95_OF_BLOCKS: f64 = 2.365;

/// Phase of a table against logs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Alignment {
    /// Generator angle of the logs where the table's is zero, deg, within half of `repeats_deg` of zero.
    pub generator_zero_deg: f64,
    /// Half width of the interval that holds it with 95 %, deg.
    pub generator_half_width_deg: f64,
    /// The table's error is the same after this angle, degrees of the generator: a tooth pitch of an ideal drive, turns
    /// of one as built.
    pub repeats_deg: f64,
    /// Residual of the table with the zeros of the logs taken for its own, arcsec rms.
    pub left_before_arcsec: f64,
    /// With the phase found.
    pub left_after_arcsec: f64,
    /// With the whole turns next to it, which no wave of the generator tells.
    #[serde(skip)]
    pub left_by_turns_arcsec: f64,
    /// Whether these logs tell it; then it is used.
    pub told: bool,
    /// Whether the output, which reads absolutely, says the turn.
    #[serde(skip)]
    pub by_output: bool,
    /// Why, or why not.
    pub why: String,
}

/// Turns that leave less than this share more than the best are as likely. *Guess*.
const AS_LIKELY: f64 = 1.05;
/// An output reads absolutely if it says the zero of the generator to this much of it, rad. *Guess*: play and wind-up
/// move it by less, and a zero set at will comes so close once in some dozen.
const ABSOLUTE_RAD: f64 = 180.0 / ARCSEC_PER_RAD;

/// Error of the table in steady motion, arcsec.
pub(crate) fn steady(table: &Table<'_>, at: &State, zero_rad: f64) -> f64 {
    let direction = if at.way < 0.0 { Direction::Backward } else { Direction::Forward };
    let generator = GeneratorAngle::from_rad(at.generator_rad - zero_rad).unwrap_or(GeneratorAngle::ZERO);
    let error = table.steady_error_rad(generator, at.torque_n_m as f32, at.temperature_c as f32, direction);
    error.map_or(0.0, |rad| f64::from(rad) * ARCSEC_PER_RAD)
}

/// Generator angle after which a table repeats, at half its largest load, rad.
fn repeats(table: &Table<'_>) -> f64 {
    let drive = table.drive();
    let ratio = drive.exact_ratio().abs();
    let pitch = TAU / f64::from(drive.ripple_order());
    let ([low, high], [least, most]) = (table.temperature_range_c(), table.torque_range_n_m());
    let half_n_m = 0.5 * if most.abs() >= least.abs() { most } else { least };
    let loaded = State {
        torque_n_m: f64::from(half_n_m),
        temperature_c: f64::from(f32::midpoint(low, high)),
        way: 1.0,
        ..State::default()
    };
    let differs = |by: f64| {
        (0..400)
            .map(|k| {
                let at = State { generator_rad: TAU * ratio * (f64::from(k) * GOLDEN).fract(), ..loaded };
                let turned = State { generator_rad: at.generator_rad + by, ..at };
                (steady(table, &turned, 0.0) - steady(table, &at, 0.0)).abs()
            })
            .fold(0.0, f64::max)
    };
    [pitch, TAU].into_iter().find(|by| differs(*by) < REPEATS_ARCSEC).unwrap_or(TAU * ratio)
}

/// Rows against a curve that goes with the angle of the generator; what no phase changes (the zero of each log, load,
/// direction) is projected out.
pub(super) struct PhaseSearch<'a> {
    /// The curve at the rows, arcsec, where the generator's angle is taken off by this, rad.
    says: &'a dyn Fn(f64) -> Vec<f64>,
    values: Vec<f64>,
    basis: FreeSpan,
}

/// About `most` of the rows.
pub(super) fn thinned<'r>(rows: impl Iterator<Item = &'r Row> + Clone, most: usize) -> Vec<&'r Row> {
    let every = rows.clone().count().div_ceil(most).max(1);
    rows.step_by(every).collect()
}

impl<'a> PhaseSearch<'a> {
    /// Of these rows.
    pub(super) fn new(says: &'a dyn Fn(f64) -> Vec<f64>, rows: &[&Row], friction_n_m: f64) -> PhaseSearch<'a> {
        let logs = rows.iter().map(|row| row.at.log + 1).max().unwrap_or(0);
        let heaviest = rows.iter().map(|row| row.at.torque_n_m.abs()).fold(1e-9, f64::max);
        let column = |of: &dyn Fn(&State) -> f64| rows.iter().map(|row| of(&row.at)).collect::<Vec<f64>>();
        let zeros = (0..logs).map(|log| column(&|at| f64::from(at.log == log)));
        let others = [
            column(&|at| at.torque_n_m / heaviest),
            column(&|at| (at.torque_n_m / heaviest).powi(3)),
            column(&|at| at.way),
            column(&|at| flank(at, friction_n_m)),
        ];
        let basis = FreeSpan::default().beyond(zeros.chain(others));
        PhaseSearch { says, values: rows.iter().map(|row| row.measured_arcsec).collect(), basis }
    }

    /// Residual with a phase, arcsec.
    fn left(&self, zero_rad: f64) -> Vec<f64> {
        let says = (self.says)(zero_rad);
        self.basis.freed(self.values.iter().zip(says).map(|(value, says)| value - says).collect())
    }

    /// Their sum of squares, arcsec².
    pub(super) fn squares(&self, zero_rad: f64) -> f64 {
        let left = self.left(zero_rad);
        dot(&left, &left)
    }

    /// The phase that leaves least, of those within the angle after which the curve repeats: in coarse steps, then in
    /// fine ones about the best places. Rad, and the squares that it leaves, arcsec², with the median of those of all
    /// places tried and the least of those elsewhere.
    pub(super) fn found(&self, repeats: f64, coarse_step: f64, fine_step: f64) -> (f64, [f64; 3]) {
        let count = (repeats / coarse_step).round() as usize;
        let mut tried: Vec<(f64, f64)> =
            (0..count).map(|k| k as f64 * coarse_step).map(|zero| (self.squares(zero), zero)).collect();
        let usual = median_of(&mut tried.iter().map(|(squares, _)| *squares).collect::<Vec<f64>>());
        tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        let around = (coarse_step / fine_step).ceil() as i32;
        let close = |place: &(f64, f64)| {
            let place = place.1;
            (-around..=around).map(move |k| place + f64::from(k) * fine_step)
        };
        let close = tried.iter().take(CLOSELY).flat_map(close).map(|zero| (self.squares(zero), zero));
        let (least, zero_rad) = close.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 0.0));
        let apart = |zero: f64| within(zero - zero_rad, repeats).abs();
        let elsewhere = tried.iter().filter(|(_, zero)| apart(*zero) > 2.0 * coarse_step).map(|(squares, _)| *squares);
        (zero_rad, [least, usual, elsewhere.fold(f64::INFINITY, f64::min)])
    }

    /// The least of the parabola through what a phase and its neighbours a `step` away leave, rad, and its standard
    /// deviation by blocks of the rows left out in turn; from `zero_rad` down to where no neighbour leaves less.
    pub(super) fn close_to(&self, mut zero_rad: f64, step: f64) -> [f64; 2] {
        let at = |zero_rad: f64| [-1.0, 0.0, 1.0].map(|k| self.left(zero_rad + k * step));
        let mut three = at(zero_rad);
        for _ in 0..MOST_STEPS {
            let [before, here, after] = three.each_ref().map(|left| dot(left, left));
            if here <= before.min(after) {
                break;
            }
            zero_rad += if before < after { -step } else { step };
            three = at(zero_rad);
        }
        let without = |begin: usize, end: usize| {
            vertex(three.each_ref().map(|left| dot(left, left) - dot(&left[begin..end], &left[begin..end])))
        };
        let (rows, size) = (self.values.len(), self.values.len().div_ceil(BLOCKS).max(1));
        let blocks: Vec<f64> = (0..rows).step_by(size).map(|begin| without(begin, (begin + size).min(rows))).collect();
        [zero_rad + without(0, 0) * step, jackknife(&blocks) * step]
    }
}

/// An angle within half of a period of zero.
pub(super) fn within(angle: f64, period: f64) -> f64 {
    (angle + 0.5 * period).rem_euclid(period) - 0.5 * period
}

/// Where the parabola through three neighbours is least, in steps from the middle.
fn vertex([before, at, after]: [f64; 3]) -> f64 {
    let curve = before - 2.0 * at + after;
    if curve > 0.0 { (0.5 * (before - after) / curve).clamp(-1.0, 1.0) } else { 0.0 }
}

/// Residual of the prior with a zero for each log, and with what load and direction may add, arcsec rms.
pub(super) fn left_beside_load(rows: &Rows, friction_n_m: f64) -> f64 {
    let some = thinned(rows.rows.iter(), FOUND_WITH);
    let prior = |_: f64| some.iter().map(|row| row.measured_arcsec - row.left_arcsec).collect::<Vec<f64>>();
    (PhaseSearch::new(&prior, &some, friction_n_m).squares(0.0) / some.len().max(1) as f64).sqrt()
}

/// Finds the phase of a table against logs.
pub(super) fn align(table: &Table<'_>, rows: &Rows, friction_n_m: f64) -> Alignment {
    let [looked_at, found_with] = [LOOKED_AT, FOUND_WITH].map(|most| thinned(rows.rows.iter(), most));
    let says = |rows: &[&Row], zero: f64| rows.iter().map(|row| steady(table, &row.at, zero)).collect::<Vec<f64>>();
    let (of_some, of_all) = (|zero| says(&looked_at, zero), |zero| says(&found_with, zero));
    let repeats = repeats(table);
    let pitch = TAU / f64::from(table.drive().ripple_order());
    let fine_step = pitch / STEPS_OF_A_PITCH as f64;
    let coarse_step = if repeats <= pitch * 1.001 { fine_step } else { TAU / STEPS_OF_A_TURN as f64 };
    let some = PhaseSearch::new(&of_some, &looked_at, friction_n_m);
    let (best, [least, usual, second]) = some.found(repeats, coarse_step, fine_step);
    let all = PhaseSearch::new(&of_all, &found_with, friction_n_m);
    let step = if least < usual * (1.0 - LEAST_GAIN) { fine_step } else { coarse_step };
    let [zero, std] = all.close_to(best, step);
    let rms = |zero: f64| (all.squares(zero) / found_with.len() as f64).sqrt();
    // Turns that leave about as little are one to the rows: an output that reads absolutely says which.
    let ratio = table.drive().exact_ratio();
    let said = -ratio * rows.means_arcsec.first().copied().unwrap_or(0.0) / ARCSEC_PER_RAD;
    let by_output = zero + TAU * ((said - zero) / TAU).round();
    let reads = (said - by_output).abs() < ABSOLUTE_RAD * ratio.abs() && rms(by_output) < AS_LIKELY * rms(zero);
    let zero = if reads { by_output } else { zero };
    let gain = 1.0 - least / usual.max(f64::MIN_POSITIVE);
    let flat = gain < LEAST_GAIN;
    let doubtful = !flat && second < least * (1.0 + LEAST_BEFORE_SECOND);
    let takes =
        format!("the best phase explains {:.1} % of the variance that remains with the usual one", 100.0 * gain);
    let why = if flat {
        format!("{takes}; {:.0} % are asked for", 100.0 * LEAST_GAIN)
    } else if doubtful {
        "another phase is as good".to_owned()
    } else {
        takes
    };
    Alignment {
        generator_zero_deg: within(zero, repeats).to_degrees(),
        generator_half_width_deg: (OF_95_OF_BLOCKS * std).to_degrees(),
        repeats_deg: repeats.to_degrees(),
        left_before_arcsec: rms(0.0),
        left_after_arcsec: rms(zero),
        left_by_turns_arcsec: rms(TAU * (zero / TAU).round()),
        told: !flat && !doubtful,
        by_output: reads,
        why,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From where a search begins many steps away: it ends at the least, and is not sure to nothing.
    #[test]
    fn a_search_goes_down_to_the_least() {
        let mut random = fastrand::Rng::with_seed(6);
        let wave = |generator_rad: f64, zero: f64| 20.0 * (2.0 * (generator_rad - zero)).sin();
        let rows = [(); 2000].map(|()| {
            let at = State { generator_rad: 700.0 * random.f64(), way: 1.0, ..State::default() };
            let measured_arcsec = wave(at.generator_rad, 0.3) + 4.0 * (random.f64() - 0.5);
            Row { at, measured_arcsec, left_arcsec: 0.0, fold: 0, number: 0, line: 0 }
        });
        let says = |zero: f64| rows.iter().map(|row| wave(row.at.generator_rad, zero)).collect();
        let [zero, std] = PhaseSearch::new(&says, &rows.each_ref(), 1.0).close_to(0.14, 0.01);
        assert!((zero - 0.3).abs() < 4.0 * std && (1e-4..5e-3).contains(&std), "{zero} ± {std}");
    }
}
