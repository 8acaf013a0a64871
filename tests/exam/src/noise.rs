//! The sensors: noise, slow wander, steps of both encoders; and the whitening that makes fits over such noise exact.

use std::fmt::Write;

use crate::ARCSEC;
use crate::chance::Chance;
use crate::drive::Drive;
use crate::record::Record;

/// Noise and steps of the sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensors {
    /// White noise of the output reading, standard deviation.
    pub white_arcsec: f64,
    /// Slow wander (Ornstein-Uhlenbeck), standard deviation.
    pub wander_arcsec: f64,
    pub wander_s: f64,
    pub output_step_rad: f64,
    pub generator_step_rad: f64,
    pub torque_n_m: f64,
    pub temperature_c: f64,
}

impl Sensors {
    /// Draws a set: 1 to 5 arcsec of white noise, encoders of 20 to 24 and 17 to 19 bit.
    pub fn draw(drive: &Drive, chance: &mut Chance) -> Self {
        let white_arcsec = chance.log_uniform(1.0, 5.0);
        let step = |bits: usize| std::f64::consts::TAU / f64::from(1 << bits);
        Self {
            white_arcsec,
            wander_arcsec: chance.uniform(0.1, 0.35) * white_arcsec,
            wander_s: chance.log_uniform(5.0, 40.0),
            output_step_rad: step(20 + chance.below(5)),
            generator_step_rad: step(17 + chance.below(3)),
            torque_n_m: chance.uniform(2e-4, 1e-3) * drive.rated_n_m,
            temperature_c: chance.uniform(0.02, 0.1),
        }
    }

    /// Standard deviation of all that is white in the error: noise, steps of both encoders, torque noise through the
    /// wind-up.
    pub fn floor_arcsec(&self, drive: &Drive) -> f64 {
        let output = self.output_step_rad * ARCSEC / 12.0_f64.sqrt();
        let generator = self.generator_step_rad * ARCSEC / drive.ratio().abs() / 12.0_f64.sqrt();
        let torque = self.torque_n_m / drive.first_stiffness() * ARCSEC;
        [self.white_arcsec, output, generator, torque].iter().map(|x| x * x).sum::<f64>().sqrt()
    }

    /// Rows as the sensors give them: time, generator, output, torque, temperature, orientation.
    pub fn rows(&self, run: &Record, chance: &mut Chance) -> Vec<[f64; 6]> {
        let mut wander = self.wander_arcsec * chance.normal();
        let stepped = |value: f64, step: f64| (value / step).round() * step;
        let mut last_s = run.time_s[0];
        (0..run.time_s.len())
            .map(|at| {
                let since = (run.time_s[at] - last_s).max(run.step_s);
                last_s = run.time_s[at];
                let keeps = (-since / self.wander_s).exp();
                wander = wander * keeps + self.wander_arcsec * (1.0 - keeps * keeps).sqrt() * chance.normal();
                let noise = wander + self.white_arcsec * chance.normal();
                [
                    run.time_s[at],
                    stepped(run.generator_read_rad[at], self.generator_step_rad),
                    stepped(run.output_read_rad[at] + noise / ARCSEC, self.output_step_rad),
                    run.torque_n_m[at] + self.torque_n_m * chance.normal(),
                    run.temperature_c[at] + self.temperature_c * chance.normal(),
                    run.orientation_rad[at],
                ]
            })
            .collect()
    }
}

/// `data.csv`: a header and these rows.
pub fn csv(rows: &[[f64; 6]], orientation_known: bool) -> String {
    let columns = ["time_s", "generator_rad", "output_rad", "torque_n_m", "temperature_c", "orientation_rad"];
    let columns_known = if orientation_known { 6 } else { 5 };
    let mut text = String::with_capacity(rows.len() * 64 + 100);
    text.push_str(&columns[..columns_known].join(","));
    text.push('\n');
    for row in rows {
        for (value, digits) in row[..columns_known].iter().zip([5, 7, 10, 4, 2, 4]) {
            let _ = write!(text, "{value:.digits$},");
        }
        text.pop();
        text.push('\n');
    }
    text
}

/// Turns noise of this kind into white noise of variance one (steady Kalman filter of the wander), session by session.
#[derive(Debug, Clone)]
pub struct Whitening {
    keeps: f64,
    gain: f64,
    scale: f64,
    session_start: Vec<usize>,
}

impl Whitening {
    /// For rows of a thinned run: white noise of `white` and wander of `wander`, correlated over `wander_s`.
    pub fn new(run: &Record, white: f64, wander: f64, wander_s: f64) -> Self {
        let keeps = (-run.step_s / wander_s).exp();
        let (r, q) = (white * white, wander * wander * (1.0 - keeps * keeps));
        // Steady variance of the predicted wander.
        let mut p = wander * wander;
        for _ in 0..10_000 {
            let next = keeps * keeps * p * r / (p + r) + q;
            if (next - p).abs() < 1e-14 * p {
                break;
            }
            p = next;
        }
        Self { keeps, gain: p / (p + r), scale: 1.0 / (p + r).sqrt(), session_start: run.session_start.clone() }
    }

    /// The innovations of a column.
    pub fn apply(&self, column: &[f64]) -> Vec<f64> {
        let mut starts = self.session_start.iter().copied().peekable();
        let mut expected = 0.0;
        column
            .iter()
            .enumerate()
            .map(|(at, value)| {
                if starts.next_if_eq(&at).is_some() {
                    expected = 0.0;
                }
                let new = value - expected;
                expected = self.keeps * (expected + self.gain * new);
                new * self.scale
            })
            .collect()
    }
}
