//! What the drive goes through: sessions of generator motion, load, temperature and orientation, on a step finer than
//! the rows of the data.

use serde::Serialize;
use std::f64::consts::{PI, TAU};

use crate::chance::Chance;
use crate::drive::Drive;

/// Ways in which a run can be poor in what it excites.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Poor {
    /// One load throughout.
    ConstantTorque,
    /// One temperature throughout.
    OneTemperature,
    /// The generator never turns back.
    OneDirection,
    /// Less than half an output turn: orders of the two wheels do not part.
    FewTurns,
    /// Slow tracking alone.
    SlowOnly,
    /// No load beyond friction.
    Unloaded,
    /// A few thousand rows.
    Short,
}

impl Poor {
    /// All.
    pub const ALL: &[Self] = &[
        Self::ConstantTorque,
        Self::OneTemperature,
        Self::OneDirection,
        Self::FewTurns,
        Self::SlowOnly,
        Self::Unloaded,
        Self::Short,
    ];
}

/// How the load runs within a session.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Shape {
    Constant,
    Steps,
    Sine,
    Triangle,
    Wind,
}

/// What the generator does for a while.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Segment {
    Turn(f64),
    Chirp { speed: f64, from_hz: f64, to_hz: f64 },
    Reversals { speed: f64, period_s: f64 },
}

/// The run, point by point.
#[derive(Debug, Clone, Default)]
pub struct Motion {
    /// Between points.
    pub step_s: f64,
    /// Points per row of the data.
    pub stride: usize,
    /// Time; gaps between sessions.
    pub time_s: Vec<f64>,
    /// Generator angle, true.
    pub generator_rad: Vec<f64>,
    /// Its speed.
    pub speed_rad_s: Vec<f64>,
    /// Load at the output, positive forward.
    pub torque_n_m: Vec<f64>,
    /// Of the drive.
    pub temperature_c: Vec<f64>,
    /// Angle by which the housing is turned about its axis, for each point; gravity then stands at minus that angle in
    /// the axes of the housing.
    pub orientation_rad: Vec<f64>,
    /// First point of each session.
    pub session_start: Vec<usize>,
    /// Whether the data tell the orientation.
    pub orientation_known: bool,
}

impl Motion {
    /// Draws a run.
    pub fn draw(drive: &Drive, poor: &[Poor], chance: &mut Chance) -> Self {
        let is = |kind| poor.contains(&kind);
        let rate_hz: f64 = *chance.of(&[100.0, 125.0, 200.0]);
        let stride = match rate_hz as u32 {
            100 => 5,
            125 => 4,
            _ => 3,
        };
        let sessions = if is(Poor::Short) { 2 + chance.below(2) } else { 5 + chance.below(2) };
        let (fewest, more) = match rate_hz as u32 {
            _ if is(Poor::Short) => (3000, 4000),
            100 => (25_000, 15_000),
            125 => (28_000, 16_000),
            _ => (36_000, 12_000),
        };
        let rows = fewest + chance.below(more);
        let mut motion = Self { step_s: 1.0 / (rate_hz * stride as f64), stride, ..Self::default() };

        let mut shapes = vec![Shape::Steps, Shape::Triangle, Shape::Sine, Shape::Wind, Shape::Constant];
        chance.shuffle(&mut shapes);
        shapes.push(*chance.of(&[Shape::Steps, Shape::Triangle, Shape::Wind]));
        let constant = chance.sign() * chance.uniform(0.3, 1.0) * drive.rated_n_m;

        let mut bases: Vec<f64> =
            (0..sessions).map(|at| -35.0 + 90.0 * (at as f64 + chance.uniform(0.1, 0.9)) / sessions as f64).collect();
        chance.shuffle(&mut bases);
        let one_temperature = chance.uniform(-20.0, 45.0);

        let mut orientations = vec![chance.of(&[0.0, 0.5 * PI, PI]).to_owned(); sessions];
        motion.orientation_known = true;
        match chance.below(3) {
            0 => motion.orientation_known = false,
            1 => {}
            _ => {
                let (start, turn) = (chance.below(4), *chance.of(&[1, 2]));
                for (at, orientation) in orientations.iter_mut().enumerate() {
                    *orientation = 0.5 * PI * ((start + turn * (at % 3)) % 4) as f64;
                }
            }
        }

        let sense = chance.sign();
        let directions = [1.0, -1.0, 1.0, 1.0, -1.0, -1.0];
        let mut time_s = 0.0;
        let mut angle_rad = chance.uniform(-200.0, 200.0);
        for session in 0..sessions {
            let count = rows / sessions * stride;
            let seconds = count as f64 * motion.step_s;
            motion.session_start.push(motion.time_s.len());
            let sense = if is(Poor::OneDirection) { sense } else { sense * directions[session] };
            let speeds = speeds(count, motion.step_s, seconds, sense, poor, chance);
            let torques = if is(Poor::Unloaded) {
                (0..count).map(|_| 0.0).collect()
            } else if is(Poor::ConstantTorque) {
                vec![constant; count]
            } else {
                torques(shapes[session], count, motion.step_s, drive.rated_n_m, chance)
            };
            let (start_c, drift_c, settle_s) =
                (bases[session], chance.sign() * chance.uniform(4.0, 14.0), chance.uniform(30.0, 120.0));
            for at in 0..count {
                let t = at as f64 * motion.step_s;
                let temperature = if is(Poor::OneTemperature) {
                    one_temperature
                } else {
                    // The drive follows its surroundings through two lags.
                    let slow = 1.0 - (-t / settle_s).exp();
                    let quick = 1.0 - (-t / (0.2 * settle_s)).exp();
                    (start_c + drift_c * (1.25 * slow - 0.25 * quick)).clamp(-40.0, 60.0)
                };
                angle_rad += speeds[at] * motion.step_s;
                motion.time_s.push(time_s + t);
                motion.generator_rad.push(angle_rad);
                motion.speed_rad_s.push(speeds[at]);
                motion.torque_n_m.push(torques[at]);
                motion.temperature_c.push(temperature);
                motion.orientation_rad.push(orientations[session]);
            }
            time_s += seconds + chance.log_uniform(60.0, 7200.0).round();
            if !is(Poor::FewTurns) && !is(Poor::SlowOnly) {
                angle_rad += if is(Poor::OneDirection) { sense } else { 1.0 } * chance.uniform(0.0, 10.0);
            }
        }
        motion
    }

    /// The points of the rows alone.
    pub fn at_rows(&self) -> Self {
        self.every(self.stride)
    }

    /// Every `n`th point of each session, as a run of its own with one point per row.
    pub fn every(&self, n: usize) -> Self {
        let mut thin = Self {
            step_s: self.step_s * n as f64,
            stride: 1,
            orientation_known: self.orientation_known,
            ..Self::default()
        };
        for at in self.picks(n) {
            if self.session_start.contains(&at) {
                thin.session_start.push(thin.time_s.len());
            }
            thin.time_s.push(self.time_s[at]);
            thin.generator_rad.push(self.generator_rad[at]);
            thin.speed_rad_s.push(self.speed_rad_s[at]);
            thin.torque_n_m.push(self.torque_n_m[at]);
            thin.temperature_c.push(self.temperature_c[at]);
            thin.orientation_rad.push(self.orientation_rad[at]);
        }
        thin
    }

    /// Every `n`th point, anew in each session.
    pub fn picks(&self, n: usize) -> Vec<usize> {
        let mut ends = self.session_start[1..].to_vec();
        ends.push(self.time_s.len());
        self.session_start.iter().zip(ends).flat_map(|(&start, end)| (start..end).step_by(n)).collect()
    }

    /// The same run on a step `n` times finer, angle and speed interpolated (cubic), the rest linear.
    pub fn refined(&self, n: usize) -> Self {
        let mut fine = Self {
            step_s: self.step_s / n as f64,
            stride: self.stride * n,
            orientation_known: self.orientation_known,
            ..Self::default()
        };
        for at in 0..self.time_s.len() {
            let starts = self.session_start.contains(&at);
            if starts {
                fine.session_start.push(fine.time_s.len());
            }
            let next = if at + 1 == self.time_s.len() || self.session_start.contains(&(at + 1)) { at } else { at + 1 };
            for part in 0..n {
                let x = part as f64 / n as f64;
                let mix = |values: &[f64]| values[at] + x * (values[next] - values[at]);
                let (angle, speed) = if next == at {
                    let held = self.speed_rad_s[at];
                    (self.generator_rad[at] + held * x * self.step_s, held)
                } else {
                    hermite(self, at, x)
                };
                fine.time_s.push(self.time_s[at] + x * self.step_s);
                fine.generator_rad.push(angle);
                fine.speed_rad_s.push(speed);
                fine.torque_n_m.push(mix(&self.torque_n_m));
                fine.temperature_c.push(mix(&self.temperature_c));
                fine.orientation_rad.push(self.orientation_rad[at]);
            }
        }
        fine
    }

    /// Distance between the extremes of the generator angle, turns.
    pub fn turns(&self) -> f64 {
        let high = self.generator_rad.iter().copied().fold(f64::MIN, f64::max);
        let low = self.generator_rad.iter().copied().fold(f64::MAX, f64::min);
        (high - low) / TAU
    }
}

/// Angle and speed between point `at` and the next.
pub fn hermite(motion: &Motion, at: usize, x: f64) -> (f64, f64) {
    let h = motion.step_s;
    let (a, b) = (motion.generator_rad[at], motion.generator_rad[at + 1]);
    let (u, v) = (motion.speed_rad_s[at] * h, motion.speed_rad_s[at + 1] * h);
    let d = b - a;
    let angle = a + x * (u + x * ((3.0 * d - 2.0 * u - v) + x * (u + v - 2.0 * d)));
    let speed = (u + x * (2.0 * (3.0 * d - 2.0 * u - v) + 3.0 * x * (u + v - 2.0 * d))) / h;
    (angle, speed)
}

/// Speed of the generator through a session: one long slew, then other things, with limited acceleration.
fn speeds(count: usize, step_s: f64, seconds: f64, sense: f64, poor: &[Poor], chance: &mut Chance) -> Vec<f64> {
    let is = |kind| poor.contains(&kind);
    // Two such slews in a row pass a whole output turn.
    let slew_rad_s = f64::max(chance.uniform(6.0, 19.0), TAU * chance.uniform(55.0, 70.0) / (0.47 * seconds).max(8.0));
    let mut plan = vec![(0.47 * seconds, Segment::Turn(sense * slew_rad_s))];
    let mut rest = vec![
        Segment::Turn(chance.sign() * chance.uniform(0.05, 0.4)),
        Segment::Turn(0.0),
        Segment::Chirp { speed: chance.uniform(2.0, 6.0), from_hz: 0.1, to_hz: chance.uniform(0.8, 2.0) },
        Segment::Reversals { speed: chance.uniform(1.0, 6.0), period_s: chance.uniform(1.0, 4.0) },
        Segment::Turn(-sense * chance.uniform(1.0, 5.0)),
        Segment::Turn(sense * chance.uniform(0.3, 2.0)),
    ];
    let weights = [0.2, 0.07, 0.2, 0.2, 0.18, 0.15];
    let mut shares: Vec<f64> = weights.iter().map(|w| w * 0.53 * seconds).collect();
    for pair in (1..rest.len()).rev() {
        let with = chance.below(pair + 1);
        rest.swap(pair, with);
        shares.swap(pair, with);
    }
    plan.extend(shares.into_iter().zip(rest));
    if is(Poor::SlowOnly) {
        plan = (0..4).map(|_| (0.26 * seconds, Segment::Turn(chance.sign() * chance.uniform(0.05, 0.5)))).collect();
    }
    let scale = if is(Poor::FewTurns) { 0.07 } else { 1.0 };

    let mut speeds = Vec::with_capacity(count);
    let (mut limited, mut smooth) = (0.0_f64, 0.0_f64);
    let (mut segment, mut since) = (0, 0.0);
    for _ in 0..count {
        if since > plan[segment].0 && segment + 1 < plan.len() {
            segment += 1;
            since = 0.0;
        }
        let (lasts, what) = plan[segment];
        let mut wanted = scale
            * match what {
                Segment::Turn(speed) => speed,
                Segment::Chirp { speed, from_hz, to_hz } => {
                    let x = since / lasts;
                    speed * (TAU * since * (from_hz + 0.5 * (to_hz - from_hz) * x)).sin()
                }
                Segment::Reversals { speed, period_s } => {
                    if (since / period_s).fract() < 0.5 {
                        speed
                    } else {
                        -speed
                    }
                }
            };
        if is(Poor::OneDirection) {
            wanted = sense * wanted.abs();
        }
        limited += (wanted - limited).clamp(-30.0 * step_s, 30.0 * step_s);
        smooth += (limited - smooth) * (step_s / 0.04);
        speeds.push(smooth);
        since += step_s;
    }
    speeds
}

/// Load through a session.
fn torques(shape: Shape, count: usize, step_s: f64, rated: f64, chance: &mut Chance) -> Vec<f64> {
    let mut torques = Vec::with_capacity(count);
    let sign = chance.sign();
    let (mean, swing) = (chance.uniform(-0.3, 0.3) * rated, chance.uniform(0.5, 0.7) * rated);
    let (period_s, phase) = (chance.uniform(6.0, 25.0), chance.phase());
    let level = sign * chance.uniform(0.25, 1.0) * rated;
    let gust_s = chance.uniform(1.0, 6.0);
    let mut hold_s = 0.0;
    let (mut wanted, mut now, mut gust) = (0.0, 0.0, 0.0);
    for at in 0..count {
        let t = at as f64 * step_s;
        let value = match shape {
            Shape::Constant => level,
            Shape::Steps => {
                if t >= hold_s {
                    wanted = chance.uniform(-1.0, 1.0) * rated;
                    hold_s = t + chance.uniform(2.0, 8.0);
                    if at == 0 {
                        now = wanted;
                    }
                }
                now += (wanted - now).clamp(-25.0 * rated * step_s, 25.0 * rated * step_s);
                now
            }
            Shape::Sine => mean + swing * (TAU * t / period_s + phase).sin(),
            Shape::Triangle => {
                let x = (t / period_s + phase / TAU).fract();
                rated * (1.0 - 4.0 * (x - 0.5).abs()) * 0.95
            }
            Shape::Wind => {
                gust += -gust * step_s / gust_s + (2.0 * step_s / gust_s).sqrt() * chance.normal();
                now += (gust - now) * step_s / 0.25;
                (mean + 0.35 * rated * now).clamp(-rated, rated)
            }
        };
        torques.push(value);
    }
    torques
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(poor: &[Poor], index: u64) -> (Drive, Motion) {
        let mut chance = Chance::new(5, "motion", index);
        let drive = Drive::draw(&mut chance);
        let motion = Motion::draw(&drive, poor, &mut chance);
        (drive, motion)
    }

    #[test]
    fn a_rich_run_covers_what_separates_causes() {
        for index in 0..10 {
            let (drive, motion) = run(&[], index);
            let rows = motion.time_s.len() / motion.stride;
            assert!((24_900..48_100).contains(&rows));
            assert!(motion.turns() > 95.0, "{} turns", motion.turns());
            let t = &motion.torque_n_m;
            assert!(t.iter().any(|t| *t > 0.7 * drive.rated_n_m) && t.iter().any(|t| *t < -0.7 * drive.rated_n_m));
            let c = &motion.temperature_c;
            assert!(c.iter().any(|c| *c > 30.0) && c.iter().any(|c| *c < -12.0));
            for (at, &start) in motion.session_start.iter().enumerate().skip(1) {
                assert!(motion.time_s[start] - motion.time_s[start - 1] > 10.0 * motion.step_s * 5.0, "session {at}");
            }
        }
    }

    #[test]
    fn poor_runs_are_poor() {
        assert!(run(&[Poor::FewTurns], 0).1.turns() < 47.0);
        assert!(run(&[Poor::SlowOnly], 1).1.speed_rad_s.iter().all(|v| v.abs() < 0.51));
        let one_way = run(&[Poor::OneDirection], 2).1.speed_rad_s;
        assert!(one_way.iter().all(|v| *v >= -1e-9) || one_way.iter().all(|v| *v <= 1e-9));
        let constant = run(&[Poor::ConstantTorque], 3).1.torque_n_m;
        assert!(constant.iter().all(|t| *t == constant[0]));
    }

    #[test]
    fn thinning_a_refined_run_gives_the_run() {
        let (_, motion) = run(&[Poor::Short], 4);
        let back = motion.refined(3).every(3);
        assert_eq!(back.session_start, motion.session_start);
        let worst =
            back.generator_rad.iter().zip(&motion.generator_rad).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-12);
    }
}
