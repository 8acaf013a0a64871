//! How a drive is driven and loaded while it is measured.

use std::ops::Range;

use crate::measurement::{Session, rates};

/// How much the data can tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Richness {
    /// Several temperatures, torques of all shapes, both directions, more than an output turn in all, orientations.
    Rich,
    /// One temperature.
    OneTemperature,
    /// Constant torque, never through zero.
    ConstantTorque,
    /// One direction.
    OneDirection,
    /// Fewer than 40 generator turns.
    FewTurns,
    /// Slow, one orientation.
    Slow,
}

/// Plan of a measurement.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// Sessions.
    pub sessions: usize,
    /// Rows of each.
    pub rows: usize,
    /// Rows per second.
    pub rate_hz: f64,
    /// Largest generator speed, rad/s.
    pub speed_rad_s: f64,
    /// Largest torque, N·m.
    pub torque_n_m: f64,
    /// The missing conditions.
    pub richness: Richness,
}

/// Motion, load and surroundings, row by row.
#[derive(Clone, Debug, Default)]
pub struct Excitation {
    /// Rows of each session.
    pub sessions: Vec<Range<usize>>,
    /// Time, s.
    pub time: Vec<f64>,
    /// Generator angle, rad.
    pub generator: Vec<f64>,
    /// Load torque, N·m.
    pub torque: Vec<f64>,
    /// Temperature, °C.
    pub temperature: Vec<f64>,
    /// Orientation, rad.
    pub orientation: Vec<f64>,
}

impl Excitation {
    /// Generator speed in each row, rad/s.
    pub(super) fn speeds(&self) -> Vec<f64> {
        rates(&self.sessions, &self.time, &self.generator)
    }

    /// That of measured sessions. What was not recorded is taken as rows `1 / rate_hz` apart, no load, the nominal
    /// temperature and no turn against gravity.
    #[must_use]
    pub fn of_sessions(sessions: &[Session], rate_hz: f64, temperature_c: f64) -> Excitation {
        let mut all = Excitation::default();
        for session in sessions.iter().filter(|session| session.len() > 1) {
            let (from, n) = (all.time.len(), session.len());
            let or = |column: &Option<Vec<f64>>, usual: f64| column.clone().unwrap_or_else(|| vec![usual; n]);
            match &session.time_s {
                Some(time) => all.time.extend(time),
                None => {
                    // A session begins a while after the one before.
                    let begin = all.time.last().map_or(0.0, |last| last + 100.0 / rate_hz);
                    all.time.extend((0..n).map(|k| begin + k as f64 / rate_hz));
                }
            }
            all.generator.extend(&session.generator_rad);
            all.torque.extend(or(&session.torque_n_m, 0.0));
            all.temperature.extend(or(&session.temperature_c, temperature_c));
            all.orientation.extend(or(&session.orientation_rad, 0.0));
            all.sessions.push(from..from + n);
        }
        all
    }

    /// Stretches the temperatures of a made-up run onto a range, °C.
    pub fn within_temperatures(&mut self, [low, high]: [f64; 2]) {
        let [from, to] = MADE_UP_C;
        for t in &mut self.temperature {
            *t = (low + (*t - from) / (to - from) * (high - low)).clamp(low, high);
        }
    }
}

/// Temperatures of a made-up run, °C.
const MADE_UP_C: [f64; 2] = [-43.0, 63.0];

impl Plan {
    /// Makes up a run.
    #[must_use]
    pub fn excite(&self, random: &mut fastrand::Rng) -> Excitation {
        let mut all = Excitation::default();
        let mut clock = 0.0;
        let dt = 1.0 / self.rate_hz;
        let few = self.richness == Richness::FewTurns;
        let mut temperatures = [-35.0, 55.0, 20.0, -10.0, 38.0, 5.0];
        random.shuffle(&mut temperatures);
        let speed_scale = if self.richness == Richness::Slow {
            0.15
        } else if few {
            0.1
        } else {
            1.0
        };
        let orientations = random.bool() && self.richness != Richness::Slow;
        for s in 0..self.sessions {
            let from = all.time.len();
            let mut psi = if few { 0.3 * random.f64() } else { 600.0 * (random.f64() - 0.5) };
            let shape = (s + random.usize(0..5)) % 5;
            let amplitude = self.torque_n_m * (0.4 + 0.6 * random.f64());
            let period = 4.0 + 16.0 * random.f64();
            let (start, drift) = (temperatures[s % 6] + 6.0 * (random.f64() - 0.5), 10.0 * (random.f64() - 0.5));
            let orientation = if orientations { std::f64::consts::FRAC_PI_2 * random.usize(0..4) as f64 } else { 0.0 };
            let (mut target, mut speed, mut hold) = (0.0, 0.0, 0.0);
            let (mut step_torque, mut step_until, mut walk) = (0.0, 0.0, 0.0);
            for k in 0..self.rows {
                let t = k as f64 * dt;
                if t >= hold {
                    hold = t + 3.0 + 10.0 * random.f64();
                    let sign = if self.richness == Richness::OneDirection || random.f64() < 0.6 { 1.0 } else { -1.0 };
                    target = sign * self.speed_rad_s * speed_scale * (0.15 + 0.85 * random.f64());
                }
                speed += (target - speed) * (dt / 0.15);
                psi += speed * dt;
                if t >= step_until {
                    step_until = t + 2.0 + 5.0 * random.f64();
                    step_torque = amplitude * (2.0 * random.f64() - 1.0);
                }
                walk += -walk * dt / 3.0 + amplitude * 0.9 * (2.0 * dt / 3.0).sqrt() * (random.f64() - 0.5) * 3.4;
                let phase = t / period;
                let torque = match (self.richness, shape) {
                    (Richness::ConstantTorque, _) => amplitude,
                    (_, 0) => amplitude * (std::f64::consts::TAU * phase).sin(),
                    (_, 1) => amplitude * (4.0 * ((phase + 0.25).rem_euclid(1.0) - 0.5).abs() - 1.0),
                    (_, 2) => step_torque,
                    (_, 3) => walk.clamp(-self.torque_n_m, self.torque_n_m),
                    _ => {
                        amplitude
                            * (0.6 + 0.4 * (std::f64::consts::TAU * phase).sin())
                            * if s % 2 == 0 { 1.0 } else { -1.0 }
                    }
                };
                all.time.push(clock + t);
                all.generator.push(psi);
                all.torque.push(torque);
                let share = t / (self.rows as f64 * dt);
                all.temperature.push(if self.richness == Richness::OneTemperature {
                    20.0
                } else {
                    start + drift * share
                });
                all.orientation.push(orientation);
            }
            clock += self.rows as f64 * dt + 300.0 + 3000.0 * random.f64();
            all.sessions.push(from..all.time.len());
        }
        all
    }
}
