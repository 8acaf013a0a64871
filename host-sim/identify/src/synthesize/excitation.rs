//! How a drive is driven and loaded while it is measured: sessions without an error yet.

use std::f64::consts::{FRAC_PI_2, TAU};

use crate::measurement::Session;

/// Motion of a measurement at several temperatures, under torques of all shapes, both ways, in several orientations.
#[derive(Clone, Copy, Debug)]
pub struct MotionPlan {
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
}

/// Motion like that of measured sessions, all columns there. What was not recorded is taken as rows `1 / rate_hz`
/// apart, no load, the nominal temperature and no turn against gravity. A session of one row has no motion.
pub fn completed(sessions: &[Session], rate_hz: f64, temperature_c: f64) -> Vec<Session> {
    // A session without time begins a while after the one before.
    let mut begin = 0.0;
    let moving = sessions.iter().filter(|session| session.len() > 1);
    moving
        .map(|session| {
            let n = session.len();
            let or = |column: &Option<Vec<f64>>, usual: f64| column.clone().unwrap_or_else(|| vec![usual; n]);
            let counted = || (0..n).map(|k| begin + k as f64 / rate_hz).collect();
            let time: Vec<f64> = session.time_s.clone().unwrap_or_else(counted);
            begin = time.last().map_or(0.0, |last| last + 100.0 / rate_hz);
            let others = [
                or(&session.torque_n_m, 0.0),
                or(&session.temperature_c, temperature_c),
                or(&session.orientation_rad, 0.0),
            ];
            Session::imagined(time, session.generator_rad.clone(), others)
        })
        .collect()
}

/// Stretches the temperatures of a made-up run onto a range, °C.
pub fn within_temperatures(sessions: &mut [Session], [low, high]: [f64; 2]) {
    let [from, to] = MADE_UP_C;
    for t in sessions.iter_mut().filter_map(|session| session.temperature_c.as_mut()).flatten() {
        *t = (low + (*t - from) / (to - from) * (high - low)).clamp(low, high);
    }
}

/// Temperatures of a made-up run, °C.
const MADE_UP_C: [f64; 2] = [-43.0, 63.0];

impl MotionPlan {
    /// Makes up a run.
    pub fn excite(&self, random: &mut fastrand::Rng) -> Vec<Session> {
        let mut clock = 0.0;
        let dt = 1.0 / self.rate_hz;
        let mut temperatures = [-35.0, 55.0, 20.0, -10.0, 38.0, 5.0];
        random.shuffle(&mut temperatures);
        let orientations = random.bool();
        let mut sessions = Vec::with_capacity(self.sessions);
        for s in 0..self.sessions {
            let mut psi = 600.0 * (random.f64() - 0.5);
            let shape = (s + random.usize(0..5)) % 5;
            let amplitude = self.torque_n_m * (0.4 + 0.6 * random.f64());
            let period = 4.0 + 16.0 * random.f64();
            let (start, drift) = (temperatures[s % 6] + 6.0 * (random.f64() - 0.5), 10.0 * (random.f64() - 0.5));
            let orientation = if orientations { FRAC_PI_2 * random.usize(0..4) as f64 } else { 0.0 };
            let (mut target, mut speed, mut hold) = (0.0, 0.0, 0.0);
            let (mut step_torque, mut step_until, mut walk) = (0.0, 0.0, 0.0);
            let [mut time, mut generator, mut torques, mut temperature] = [const { Vec::new() }; 4];
            for k in 0..self.rows {
                let t = k as f64 * dt;
                if t >= hold {
                    hold = t + 3.0 + 10.0 * random.f64();
                    let sign = if random.f64() < 0.6 { 1.0 } else { -1.0 };
                    target = sign * self.speed_rad_s * (0.15 + 0.85 * random.f64());
                }
                speed += (target - speed) * (dt / 0.15);
                psi += speed * dt;
                if t >= step_until {
                    step_until = t + 2.0 + 5.0 * random.f64();
                    step_torque = amplitude * (2.0 * random.f64() - 1.0);
                }
                walk += -walk * dt / 3.0 + amplitude * 0.9 * (2.0 * dt / 3.0).sqrt() * (random.f64() - 0.5) * 3.4;
                let phase = t / period;
                torques.push(match shape {
                    0 => amplitude * (TAU * phase).sin(),
                    1 => amplitude * (4.0 * ((phase + 0.25).rem_euclid(1.0) - 0.5).abs() - 1.0),
                    2 => step_torque,
                    3 => walk.clamp(-self.torque_n_m, self.torque_n_m),
                    _ => amplitude * (0.6 + 0.4 * (TAU * phase).sin()) * if s % 2 == 0 { 1.0 } else { -1.0 },
                });
                time.push(clock + t);
                generator.push(psi);
                temperature.push(start + drift * (t / (self.rows as f64 * dt)));
            }
            clock += self.rows as f64 * dt + 300.0 + 3000.0 * random.f64();
            let orientations = vec![orientation; self.rows];
            sessions.push(Session::imagined(time, generator, [torques, temperature, orientations]));
        }
        sessions
    }
}
