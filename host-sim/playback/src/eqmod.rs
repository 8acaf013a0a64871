//! EQMOD (EQASCOM) periodic error correction: the file that `Import` of PEC.bas reads, the rates that `CalcRates` makes
//! of it, and `PEC_Timer`, which plays one a second and looks for its place once a worm turn.
//!
//! The file holds the error; EQMOD differences it, takes the mean rate out and rounds each rate to what the mount's
//! divider gives, with the remainder carried on. A tick lies anywhere in its second, so a rate begins half a second
//! late on average: the fit is made for that, and the playback is started so.

use std::f64::consts::TAU;
use std::fmt::Write;

use flexspline::Direction;

use super::hats::Hats;
use super::track::{Track, wanted_in_time};
use super::{FIT_POINTS, Origin, Player, Refusal, Section, Written, mean, rms};
use flexspline_base::units::ARCSEC_PER_RAD;

/// `SID_RATE`, arcsec/s.
const SIDEREAL: f64 = 15.041_067;
/// `SPSD`, seconds in a sidereal day.
const DAY_S: f64 = 86_164.090_5;
/// `ARCSECS_PER_360DEGREES`.
const CIRCLE: f64 = 1_296_000.0;
/// Default of `MAX_RATEADJUST`, arcsec/s.
const MOST_RATE: f64 = 3.0;
/// Ticks of an output turn at most: at the lowest rate there are 107 634.
const MOST_TICKS: u32 = 110_000;
/// Worm periods that are taken, s: VB integers hold the upper one, and below the lower nothing is resolved (a guess).
const PERIODS: std::ops::RangeInclusive<u32> = 30..=32_000;
/// Where in its second the first tick of a playback lies.
const FIRST_TICK_S: f64 = 0.5;

/// Places in a worm turn at which another zero is tried.
const ZEROS: u32 = 8;
/// A zero that leaves less than this share is told: a guess of what is worth a new alignment.
const CLEARLY_BETTER: f64 = 0.7;
/// Every so many points of the fit judge a zero: prime, so that no order of the drive divides what is left.
const JUDGE_EVERY: usize = 31;

/// The mount as EQMOD knows it.
#[derive(Debug, Clone, Copy)]
pub struct Mount {
    /// `gTot_RA`: motor steps of an output turn.
    pub steps_a_turn: f64,
    /// `gTrackFactorRA`: arcsec/s that a divider of 1 would give.
    pub track_factor: f64,
    /// The mount's step counter where the generator stands at its zero.
    pub motor_zero: i64,
}

/// A curve and its playback.
#[derive(Debug, Clone)]
pub struct Eqmod {
    period: usize,
    worm_steps: u32,
    /// Error at each second, arcsec, and the motor position there.
    curve: Vec<(f64, u32)>,
    track: Track,
    /// Another zero that does clearly better, and what both leave on the table's model, arcsec rms.
    better: Option<(i64, [f64; 2])>,
}

impl Eqmod {
    /// Fits a curve for tracking in this direction.
    pub fn fit(section: &Section<'_>, direction: Direction, mount: Mount) -> Result<Eqmod, Refusal> {
        let worm_steps = (mount.steps_a_turn / section.ratio().abs()).round();
        let period = (DAY_S * worm_steps / mount.steps_a_turn + 0.5).floor();
        if !(f64::from(*PERIODS.start())..=f64::from(*PERIODS.end())).contains(&period) {
            return Err(Refusal::Impossible(format!(
                "a generator turn takes {period:.0} s at the sidereal rate; EQMOD plays worm periods of {} to {} s",
                PERIODS.start(),
                PERIODS.end()
            )));
        }
        let period = period as usize;
        let samples = section.samples(None, FIT_POINTS, &[direction]);
        // In seconds of the file: `period` of them are a turn, though they may be some thousandths of one off.
        let second = TAU / section.ratio().abs() / period as f64;
        let mut hats = Hats::new(period, FIRST_TICK_S, 1.0, true);
        for (time, value) in wanted_in_time(section, &samples, direction) {
            hats.add(time / second, value * ARCSEC_PER_RAD);
        }
        let corrections = hats.solve();
        // `Import` takes out the line from the first to the last value; a curve that ends as it began is left as it is.
        let slope = (corrections[period - 1] - corrections[0]) / (period - 1) as f64;
        let value = |k: usize| ((-corrections[k] + slope * k as f64) * 1e4).round() / 1e4;
        // The counter starts anew once a worm turn, and where in the curve that falls is a matter of the zero.
        let with_zero = |motor_zero: i64| {
            let mount = Mount { motor_zero, ..mount };
            let motor = |k: usize| {
                let steps = (SIDEREAL * k as f64 * mount.steps_a_turn / CIRCLE) as i64 + motor_zero;
                steps.rem_euclid(worm_steps as i64) as u32
            };
            let curve: Vec<(f64, u32)> = (0..period).map(|k| (value(k), motor(k))).collect();
            let track = Track::new(direction, Playback::import(&curve, worm_steps, mount).run(mount));
            let left: Vec<f64> = samples
                .iter()
                .step_by(JUDGE_EVERY)
                .map(|sample| (sample.error_rad + track.at(sample.led_rad)) * ARCSEC_PER_RAD)
                .collect();
            (rms(&left, mean(left.iter().copied())), curve, track)
        };
        let (left, curve, track) = with_zero(mount.motor_zero);
        let others = (0..ZEROS).map(|k| (worm_steps * f64::from(k) / f64::from(ZEROS)) as i64);
        let best = others.map(|zero| (zero, with_zero(zero).0)).min_by(|one, other| one.1.total_cmp(&other.1));
        let better = best.filter(|(_, best)| *best < CLEARLY_BETTER * left).map(|(zero, best)| (zero, [left, best]));
        Ok(Eqmod { period, worm_steps: worm_steps as u32, curve, track, better })
    }
}

/// What EQMOD makes of a file.
struct Playback {
    worm_steps: f64,
    /// Rates, arcsec/s, sidereal included.
    rates: Vec<f64>,
    /// Motor position at each.
    positions: Vec<f64>,
}

/// `Mod` of Visual Basic: of the nearest whole numbers, halves to the even one.
fn vb_mod(value: f64, modulus: f64) -> f64 {
    value.round_ties_even() % modulus.round_ties_even()
}

impl Playback {
    /// `Import` and `CalcRates`, on the northern hemisphere, gain 1 and threshold 0.
    fn import(curve: &[(f64, u32)], worm_steps: f64, mount: Mount) -> Playback {
        let period = curve.len();
        let drift = (curve[period - 1].0 - curve[0].0) / (period + 1) as f64;
        let signal: Vec<f64> = curve.iter().enumerate().map(|(k, (value, _))| value - k as f64 * drift).collect();
        let mut rates = vec![0.0; period];
        for k in 1..period {
            rates[k] = signal[k - 1] - signal[k];
        }
        rates[0] = (rates[period - 1] + rates[1]) / 2.0;
        let mean = rates.iter().sum::<f64>() / period as f64;
        rates.iter_mut().for_each(|rate| *rate -= mean);
        let mut remainder = 0.0;
        for _ in 0..3 {
            for rate in &mut rates {
                let wanted = SIDEREAL + *rate + remainder;
                let given = mount.track_factor / (mount.track_factor / wanted + 0.5).floor();
                remainder = wanted - given;
                *rate = given - SIDEREAL;
            }
        }
        rates.iter_mut().for_each(|rate| *rate += SIDEREAL);
        let mut positions = vec![f64::from(curve[0].1)];
        for rate in &rates[..period - 1] {
            let moved = mount.steps_a_turn / (CIRCLE / rate);
            positions.push(vb_mod(positions[positions.len() - 1] + moved, worm_steps));
        }
        Playback { worm_steps, rates, positions }
    }

    /// `GetIdx`: the place whose position is next in front of the motor, searched from `index`.
    fn place(&self, mut index: usize, motor: f64) -> usize {
        let period = self.rates.len();
        let motor = if motor > self.worm_steps { vb_mod(motor, self.worm_steps) } else { motor };
        if motor > self.positions[index] {
            for _ in 0..period {
                index = (index + 1) % period;
                if motor <= self.positions[index] {
                    break;
                }
            }
            return index;
        }
        for _ in 0..period {
            if motor >= self.positions[index] {
                break;
            }
            index = (index + period - 1) % period;
        }
        (index + 1) % period
    }

    /// `PEC_Timer` for an output turn: where the motor has led the output to and what of that was added, rad.
    fn run(&self, mount: Mount) -> Vec<[f64; 2]> {
        let period = self.rates.len();
        let steps_a_arcsec = mount.steps_a_turn / CIRCLE;
        // From before the zero on, so that at the zero it has its stride.
        let mut led = -SIDEREAL * FIRST_TICK_S;
        let start = led;
        let motor = |led: f64| {
            // The counter of a mount never goes below zero here: a worm turn more is the same place.
            (led * steps_a_arcsec + mount.motor_zero as f64).floor().rem_euclid(self.worm_steps)
        };
        let mut index = self.place(0, motor(led));
        let mut since = 0;
        let mut knots = vec![[led, 0.0]];
        for tick in 1..=MOST_TICKS {
            let rate = self.rates[index].clamp(SIDEREAL - MOST_RATE, SIDEREAL + MOST_RATE);
            led += rate;
            knots.push([led, led - start - SIDEREAL * f64::from(tick)]);
            if led >= CIRCLE {
                break;
            }
            index = (index + 1) % period;
            since += 1;
            if since >= period {
                since = 0;
                index = self.place(index, motor(led));
            }
        }
        knots.iter().map(|knot| knot.map(|arcsec| arcsec / ARCSEC_PER_RAD)).collect()
    }
}

impl Player for Eqmod {
    fn correction_rad(&self, led_rad: f64, _: Direction) -> f64 {
        self.track.at(led_rad)
    }

    fn directions(&self) -> &[Direction] {
        self.track.directions()
    }

    fn points(&self) -> String {
        format!("{} seconds to a generator turn", self.period)
    }

    fn files(&self, origin: &Origin) -> Vec<Written> {
        // The first line is skipped whatever it is.
        let mut text = String::new();
        for line in origin.lines("error of the output along the tracking, actual less nominal, arcsec") {
            let _ = writeln!(text, "# {line}");
        }
        let _ = writeln!(text, "!WormPeriod={}\n!StepsPerWorm={}", self.period, self.worm_steps);
        let _ = writeln!(text, "# time - motor - smoothed PE");
        for (k, (error, motor)) in self.curve.iter().enumerate() {
            let _ = writeln!(text, "{k} {motor} {error:.4}");
        }
        vec![Written::text("eqmod_pec.txt", text)]
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = vec![
            format!("EQMOD's own worm has to be {} steps; PEC gain 1, threshold 0, phase 0", self.worm_steps),
            format!(
                "a rate that is {:.3} arcsec an output turn off is left to guiding; the mount's own divider makes one \
                 too",
                self.track.drift_arcsec()
            ),
        ];
        notes.extend(self.better.map(|(zero, [left, best])| {
            format!(
                "this --motor-zero has the counter of a worm turn start anew where EQMOD loses its place, and leaves \
                 {left:.2} arcsec rms on the table's own model; --motor-zero {zero} would leave {best:.2}: set the \
                 mount's counter so"
            )
        }));
        notes
    }
}
