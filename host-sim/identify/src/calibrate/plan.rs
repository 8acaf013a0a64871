//! Plan of a recording: the motion that informs most about the parts in the time there is, found from the same columns
//! that the fit uses.
//!
//! Passes that a bench can make (over the whole travel there and back at one load; a few slow generator turns) are
//! added one after the other, each time the one that lowers the expected variance of the table, over all that it is to
//! hold, most for its time. The expected accuracy is that of the information matrix of all of them, for the noise that
//! is assumed.

use std::f64::consts::TAU;

use serde::Serialize;

use super::interval::{Node, RowNoise, planned_covariance, row_of_group, spread, widths};
use super::parts::{PartName, Scales, State, place, weights, width_of};
use super::rows::{MOST_ROWS, Recorded, late_s};
use super::{CalibrationError, GOLDEN, LEAST_FRICTION, ONE_TEMPERATURE_K, OTHER_PACE, Prior, ROWS_OF_A_PITCH};
use crate::linear::Gram;
use crate::measurement::least_and_most;

/// Beyond what any bench or catalogue of these drives has, so a slip of the pen: generator, load and temperature.
/// Guesses.
const FASTEST_RPM: f64 = 2e4;
const LOADS_N_M: [f64; 2] = [-1e5, 1e5];
const TEMPERATURES_C: [f64; 2] = [-200.0, 300.0];
/// Loads at which passes are made, where there is a load.
const LOADS: usize = 11;
/// Slow generator turns, and the places of the travel at which they are made.
const SLOW_TURNS: f64 = 2.0;
const SLOW_PLACES: usize = 4;
/// Standing at each turning point, s, so that the reversal is seen.
const REST_S: f64 = 1.0;
/// States that the accuracy is asked for at, and rows that stand for a pass.
const ASKED: usize = 1500;
const ROWS_OF_A_PASS: usize = 500;
/// A slower pass is not worth its own kind below this share of the speed.
const SLOWER: f64 = 0.7;
/// Speed of the slower passes over the whole travel, which tell a delay between the readings from play, of the fastest.
/// *Guess*: far enough apart for rows of a tenth to tell it, and not twice as long and more for nothing.
const OTHER_PACE_SHARE: f64 = 0.5;
/// Slowest that a pass is made to spread its rows, of the fastest; speeds that are tried; and places of a turn that
/// rows would come back to.
const SLOWEST_TO_SPREAD: f64 = 0.9;
const SPEEDS: usize = 101;
const PLACES_OF_A_TURN: u32 = 24;
/// Passes of a plan that nobody would drive by hand. *Guess*.
const MOST_PASSES: usize = 5000;

/// Limits of the bench, and the range that the table is to hold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bench {
    /// Time, minutes.
    pub minutes: f64,
    /// Rows in a second.
    pub rate_hz: f64,
    /// Fastest generator, rpm.
    pub speed_rpm: f64,
    /// Least and largest load, N·m; both the same where it cannot be changed.
    pub torque_n_m: [f64; 2],
    /// Lowest and highest temperature, °C.
    pub temperature_c: [f64; 2],
    /// Travel of the output, deg.
    pub output_deg: [f64; 2],
    /// Noise of the error from row to row, arcsec.
    pub noise_arcsec: f64,
    /// Wander of the sensors, arcsec, and its time scale, s.
    pub wander_arcsec: f64,
    /// See above.
    pub wander_s: f64,
}

impl Default for Bench {
    fn default() -> Bench {
        Bench {
            minutes: 60.0,
            rate_hz: 100.0,
            speed_rpm: 60.0,
            torque_n_m: [0.0; 2],
            temperature_c: [20.0; 2],
            output_deg: [0.0, 360.0],
            noise_arcsec: 1.0,
            wander_arcsec: 0.5,
            wander_s: 20.0,
        }
    }
}

impl Bench {
    /// Its fault, if any.
    pub fn problem(&self) -> Option<String> {
        let length = [self.output_deg[1] - self.output_deg[0]];
        let any = [f64::NEG_INFINITY, f64::INFINITY];
        let within: [(&str, &[f64], [f64; 2]); 9] = [
            ("--minutes", &[self.minutes], [1.0, 1e5]),
            ("--rate", &[self.rate_hz], [0.1, 1e6]),
            ("--speed-rpm", &[self.speed_rpm], [1e-3, FASTEST_RPM]),
            ("--noise-arcsec", &[self.noise_arcsec], [1e-3, 1e4]),
            ("--wander-arcsec", &[self.wander_arcsec], [0.0, 1e4]),
            ("--load-n-m", &self.torque_n_m, LOADS_N_M),
            ("--temperatures-c", &self.temperature_c, TEMPERATURES_C),
            ("--travel-deg", &self.output_deg, any),
            ("--travel-deg (its length)", &length, [1.0, 3.6e4]),
        ];
        within.into_iter().find_map(|(name, values, [low, high])| {
            if let [from, to] = values
                && !(from.is_finite() && to.is_finite() && from <= to)
            {
                return Some(format!("{name}: found {from} and {to}, allowed: the lower first"));
            }
            let bad = values.iter().find(|value| !(low..=high).contains(*value))?;
            Some(format!("{name}: found {bad}, allowed: {low} to {high}"))
        })
    }

    /// The noise that it is expected to have, of rows as many as are fitted.
    fn noise(&self) -> RowNoise {
        let (white, wander) = (self.noise_arcsec.powi(2), self.wander_arcsec.powi(2));
        let rows_in_a_wander = 2.0 * self.wander_s * self.rate_fitted_hz();
        RowNoise {
            rms_arcsec: (white + wander).sqrt(),
            white_arcsec: self.noise_arcsec,
            hangs_together: (white + wander * (1.0 + rows_in_a_wander)) / (white + wander),
        }
    }

    /// Rows in a second that are fitted: longer records are thinned.
    fn rate_fitted_hz(&self) -> f64 {
        self.rate_hz.min(MOST_ROWS as f64 / (60.0 * self.minutes))
    }
}

/// A pass: from one angle to the other and back, at one load.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pass {
    /// Number of the log, from 1: one for each temperature.
    pub log: usize,
    /// When it begins in its log, s, and how long it takes.
    pub begin_s: f64,
    /// See above.
    pub duration_s: f64,
    /// From this output angle, deg, to that one, and back.
    pub from_output_deg: f64,
    /// See above.
    pub to_output_deg: f64,
    /// The same of the generator, turns.
    pub from_generator_turn: f64,
    /// See above.
    pub to_generator_turn: f64,
    /// Speed of the generator, rpm.
    pub speed_rpm: f64,
    /// Load, N·m.
    pub torque_n_m: f64,
    /// Temperature, °C.
    pub temperature_c: f64,
}

/// `plan.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Planned {
    /// Version of this object.
    pub schema_version: u32,
    /// The drive.
    pub drive: String,
    /// Generator turns for one of the output.
    pub ratio: f64,
    /// Limits of the bench.
    pub bench: Bench,
    /// The noise that the accuracy holds for.
    pub noise: RowNoise,
    /// The recordings.
    pub passes: Vec<Pass>,
    /// Time that they take, minutes.
    pub minutes: f64,
    /// Expected error of the table's parts over all that it is to hold, arcsec rms: of sensors' noise alone.
    pub expected_rms_arcsec: f64,
    /// Half widths expected at the nodes.
    pub nodes: Vec<Node>,
    /// Parts that this bench cannot tell, and why.
    pub cannot: Vec<String>,
    /// Command line, once known.
    pub command: String,
}

/// Plans what to record of a drive.
///
/// # Errors
/// A bench with numbers out of range, or with no time for a single pass.
pub fn plan(prior: &Prior<'_>, bench: &Bench) -> Result<Planned, CalibrationError> {
    prior.core_drive()?;
    if let Some(problem) = bench.problem() {
        return Err(CalibrationError::Known(problem));
    }
    let [low, high] = bench.torque_n_m;
    let scales = Scales {
        torque_n_m: bench.torque_n_m,
        friction_n_m: prior.friction_n_m().max(LEAST_FRICTION * low.abs().max(high.abs())),
        temperature_c: bench.temperature_c,
        teeth: prior.tooth_pitches(),
        speed_rad_s: bench.speed_rpm / 60.0 * TAU / prior.nominal.ratio.abs(),
        late_s: late_s(1.0 / bench.rate_hz),
        unrecorded: 0,
    };
    let ratio = prior.nominal.ratio;
    let recorded = recordable(prior, bench, scales);
    let mut chosen = recorded.shown(PartName::ALL, prior);
    let mut cannot: Vec<String> = PartName::ALL.iter().filter_map(|part| lacks(*part, &recorded, prior)).collect();
    let logs = temperatures(bench).len();
    chosen.extend((0..logs).map(PartName::ReadingDelay));
    let candidates = candidates(prior, bench, &scales, &chosen);
    let noise = bench.noise();

    let mut known = vec![Gram::none(width_of(&chosen) + 2); logs];
    let travel = bench.output_deg.map(f64::to_radians);
    let moment = asked(&scales, ratio, travel, &chosen);
    let mean_variance = |covariance: &[f64]| {
        let width = moment.size - 1;
        let pairs = (0..width).flat_map(|i| (0..width).map(move |j| (i, j)));
        pairs.map(|(i, j)| moment.at(i, j) * covariance[i * width + j]).sum::<f64>().max(0.0)
    };
    let of = |known: &[Gram]| {
        let covariance = planned_covariance(known, &chosen, &scales, noise.of_a_row());
        covariance.ok_or(CalibrationError::Known("the information matrix is singular".to_owned()))
    };

    let mut now = of(&known)?;
    let (mut left_s, mut taken) = (60.0 * bench.minutes, Vec::new());
    while taken.len() < MOST_PASSES {
        let uncertain = mean_variance(&now);
        let mut best: Option<(f64, usize, Vec<f64>)> = None;
        // The ends of the loads first, as a table ends where they do; then each load and temperature once before one is
        // repeated: the parts do not know all that they do.
        let news = |pass: &Pass| {
            let new_load = taken.iter().all(|taken: &Pass| taken.torque_n_m != pass.torque_n_m);
            let new_temperature = taken.iter().all(|taken| taken.temperature_c != pass.temperature_c);
            let is_an_end = bench.torque_n_m.contains(&pass.torque_n_m);
            (new_load && is_an_end, usize::from(new_load) + usize::from(new_temperature))
        };
        let fitting = || candidates.iter().enumerate().filter(|(_, (pass, _))| pass.duration_s <= left_s);
        let most = fitting().map(|(_, (pass, _))| news(pass)).max();
        for (k, (pass, information)) in fitting().filter(|(_, (pass, _))| Some(news(pass)) == most) {
            let mut with = known.clone();
            with[pass.log - 1].add(information, 1.0);
            let then = of(&with)?;
            let gain = (uncertain - mean_variance(&then)) / pass.duration_s;
            if best.as_ref().is_none_or(|(most, ..)| gain > *most) {
                best = Some((gain, k, then));
            }
        }
        let Some((_, k, then)) = best else { break };
        let (pass, information) = &candidates[k];
        known[pass.log - 1].add(information, 1.0);
        left_s -= pass.duration_s;
        taken.push(*pass);
        now = then;
    }
    if taken.len() == MOST_PASSES {
        let hours = bench.minutes / 60.0;
        return Err(CalibrationError::Known(format!(
            "--minutes: found {}: in {hours:.0} hours there is time for {MOST_PASSES} passes and more; allowed: less \
             time",
            bench.minutes
        )));
    }
    if taken.is_empty() {
        let shortest = candidates.iter().map(|(pass, _)| pass.duration_s).fold(f64::INFINITY, f64::min) / 60.0;
        return Err(CalibrationError::Known(format!(
            "--minutes: found {}, allowed: {shortest:.1} or more, the time of one pass there and back at {} rpm",
            bench.minutes, bench.speed_rpm
        )));
    }
    let nodes = widths(&chosen, &scales, &now, None);
    // Cold first; at each temperature in the order in which they tell most, so that a log that is broken off is worth
    // most.
    let (mut passes, mut ends_s) = (taken, vec![0.0; logs]);
    passes.sort_by_key(|pass| pass.log);
    for pass in &mut passes {
        pass.begin_s = ends_s[pass.log - 1];
        ends_s[pass.log - 1] += pass.duration_s;
    }
    if chosen.contains(&PartName::WindUp) {
        let mut loads: Vec<f64> = passes.iter().map(|pass| pass.torque_n_m).collect();
        loads.sort_by(f64::total_cmp);
        loads.dedup();
        let wind_up = nodes.iter().filter(|node| node.part == PartName::WindUp.as_str());
        let widest = wind_up.map(|node| node.half_width_arcsec).fold(0.0, f64::max);
        if loads.len() < weights(PartName::WindUp).len() {
            cannot.push(format!(
                "wind_up: the time is enough for {} loads alone, and between them it is known to ±{widest:.0} arcsec; \
                 give more minutes, a faster generator or less travel",
                loads.len()
            ));
        }
    }
    let paces = least_and_most(passes.iter().map(|pass| pass.speed_rpm));
    if paces.1 < OTHER_PACE * paces.0 {
        cannot
            .push("reading_delay: the time is enough for one pace alone, at which a delay looks like play".to_owned());
    }
    Ok(Planned {
        schema_version: 1,
        drive: prior.drive.clone(),
        ratio,
        bench: bench.clone(),
        noise,
        minutes: passes.iter().map(|pass| pass.duration_s).sum::<f64>() / 60.0,
        passes,
        expected_rms_arcsec: mean_variance(&now).sqrt(),
        nodes,
        cannot,
        command: String::new(),
    })
}

/// Target of the plan: the mean of `x xᵀ` over all that it is to hold, about the mean of `x`, as what is the same
/// everywhere is the zero of the encoder.
fn asked(scales: &Scales, ratio: f64, travel: [f64; 2], chosen: &[PartName]) -> Gram {
    let mut moment = Gram::none(width_of(chosen) + 2);
    // The zero by temperature: logs of one temperature each cannot tell it from the encoder's.
    let zero = place(chosen.iter().copied(), PartName::Temperature).map(|place| 1 + place.start);
    for at in spread(scales, ratio, travel, ASKED) {
        let mut row = row_of_group(chosen, &at, scales, 0.0);
        zero.into_iter().for_each(|zero| row[zero] = 0.0);
        moment.add_row(&row, 1.0 / ASKED as f64);
    }
    moment.first_free()
}

/// What a bench can record in all the time there is.
fn recordable(prior: &Prior<'_>, bench: &Bench, scales: Scales) -> Recorded {
    let turns = (bench.output_deg[1] - bench.output_deg[0]) / 360.0;
    let generator_turns = turns * prior.nominal.ratio.abs();
    Recorded {
        scales,
        has_torque: true,
        has_temperature: true,
        generator_share: generator_turns.min(1.0),
        output_share: turns.min(1.0),
        generator_turns,
        backward_share: 0.5,
        fine_turns: SLOW_TURNS,
        ..Recorded::default()
    }
}

/// Why a bench cannot tell a part, and the option that changes it.
fn lacks(part: PartName, recorded: &Recorded, prior: &Prior<'_>) -> Option<String> {
    let option = match part {
        PartName::WindUp => ": give the range of the load, --load-n-m LOW,HIGH",
        PartName::Temperature => ": give the range, --temperatures-c LOW,HIGH",
        _ => "",
    };
    recorded.lacks(part, prior).map(|why| format!("{}: {why}{option}", part.as_str()))
}

/// Temperatures that are recorded.
fn temperatures(bench: &Bench) -> Vec<f64> {
    let [cold, warm] = bench.temperature_c;
    let middle = f64::midpoint(cold, warm);
    if warm - cold < ONE_TEMPERATURE_K { vec![middle] } else { vec![cold, middle, warm] }
}

/// Loads of passes, evenly, so that what no part has is seen between them, and none.
fn loads([low, high]: [f64; 2]) -> Vec<f64> {
    if high <= low {
        return vec![low];
    }
    let most = (LOADS - 1) as f64;
    let place = |k: usize| low + (high - low) * k as f64 / most;
    let mut loads: Vec<f64> = (0..LOADS).map(place).collect();
    let close = 0.05 * (high - low);
    if low < 0.0 && high > 0.0 && loads.iter().all(|load| load.abs() > close) {
        loads.push(0.0);
    }
    // What is meant is none.
    loads.iter_mut().filter(|load| load.abs() < 1e-9 * (high - low)).for_each(|load| *load = 0.0);
    loads
}

/// A speed at which rows do not come back to the same few places of the generator's turn: the one, of those not much
/// slower than the fastest, whose turns from row to row stay farthest from every fraction with a small denominator.
fn spreading_rpm(fastest: f64, rate_hz: f64) -> f64 {
    let turns_of_a_row = |rpm: f64| rpm / 60.0 / rate_hz;
    if turns_of_a_row(fastest) * f64::from(PLACES_OF_A_TURN) < 1.0 {
        return fastest;
    }
    let apart = |rpm: f64| {
        let off = |q: u32| {
            let turns = f64::from(q) * turns_of_a_row(rpm);
            (turns - turns.round()).abs()
        };
        (1..=PLACES_OF_A_TURN).map(off).fold(f64::INFINITY, f64::min)
    };
    let step = (1.0 - SLOWEST_TO_SPREAD) / (SPEEDS - 1) as f64;
    let speeds = (0..SPEEDS).map(|k| fastest * (1.0 - step * k as f64));
    speeds.max_by(|a, b| apart(*a).total_cmp(&apart(*b))).unwrap_or(fastest)
}

/// The passes that may be made, each with the sums of its rows.
fn candidates(prior: &Prior<'_>, bench: &Bench, scales: &Scales, chosen: &[PartName]) -> Vec<(Pass, Gram)> {
    let ratio = prior.nominal.ratio;
    let [begin, end] = bench.output_deg;
    let by_teeth = chosen.contains(&PartName::ToothPitch);
    // So slow that the curve over a pitch has its rows.
    let slow_rpm = 60.0 * bench.rate_hz / (ROWS_OF_A_PITCH * scales.teeth);
    let slow = by_teeth && slow_rpm < SLOWER * bench.speed_rpm;
    let slow_deg = 360.0 * SLOW_TURNS / ratio.abs();
    let paces = [1.0, OTHER_PACE_SHARE].map(|share| spreading_rpm(share * bench.speed_rpm, bench.rate_hz));
    let mut ways = paces.map(|rpm| (begin, end, rpm)).to_vec();
    if slow && slow_deg < end - begin {
        let step = (end - begin - slow_deg) / (SLOW_PLACES - 1) as f64;
        ways.extend((0..SLOW_PLACES).map(|k| (begin + step * k as f64, begin + step * k as f64 + slow_deg, slow_rpm)));
    }
    let mut all = Vec::new();
    for (warmth, temperature_c) in temperatures(bench).into_iter().enumerate() {
        for torque_n_m in loads(bench.torque_n_m) {
            for &(from, to, speed_rpm) in &ways {
                let turns = (to - from) / 360.0 * ratio.abs();
                let moving_s = 2.0 * turns / speed_rpm * 60.0;
                let duration_s = moving_s + 2.0 * REST_S;
                let speed_rad_s = speed_rpm / 60.0 * TAU / ratio.abs();
                let weight = moving_s * bench.rate_fitted_hz() / ROWS_OF_A_PASS as f64;
                let mut information = Gram::none(width_of(chosen) + 2);
                for k in 0..ROWS_OF_A_PASS {
                    let way = if k % 2 == 0 { 1.0 } else { -1.0 };
                    let share = (k as f64 + 0.5) / ROWS_OF_A_PASS as f64;
                    let output_rad = (from + (to - from) * share).to_radians();
                    // Not all at one phase of generator and teeth.
                    let generator_rad = output_rad * ratio
                        + TAU * (k as f64 * GOLDEN).fract() * (ratio.abs() / ROWS_OF_A_PASS as f64).min(1.0);
                    let at = State {
                        generator_rad,
                        output_rad,
                        torque_n_m,
                        temperature_c,
                        way,
                        speed_rad_s: way * speed_rad_s,
                        log: warmth,
                    };
                    information.add_row(&row_of_group(chosen, &at, scales, 0.0), weight);
                }
                let pass = Pass {
                    log: warmth + 1,
                    begin_s: 0.0,
                    duration_s,
                    from_output_deg: from,
                    to_output_deg: to,
                    from_generator_turn: from / 360.0 * ratio,
                    to_generator_turn: to / 360.0 * ratio,
                    speed_rpm,
                    torque_n_m,
                    temperature_c,
                };
                all.push((pass, information));
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_a_pass_are_spread_over_the_turn() {
        let places = |rpm: f64, rate: f64| {
            let mut places: Vec<f64> = (0..200).map(|k| (f64::from(k) * rpm / 60.0 / rate).fract()).collect();
            places.sort_by(f64::total_cmp);
            places.push(places[0] + 1.0);
            places.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max)
        };
        // A fifth of a turn from row to row, half a turn, and a whole one.
        for rate in [5.0, 2.0, 1.0] {
            let rpm = spreading_rpm(60.0, rate);
            assert!((54.0..=60.0).contains(&rpm) && places(60.0, rate) > 0.1, "{rpm}");
            assert!(places(rpm, rate) < 0.05, "{rpm} at {rate}: {}", places(rpm, rate));
        }
        assert_eq!(spreading_rpm(60.0, 100.0), 60.0);
    }
}
