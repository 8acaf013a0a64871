//! The sensors: noise, slow wander, steps of both encoders; and the whitening that makes fits over such noise exact.

use serde::Serialize;
use std::fmt::Write;

use crate::ARCSEC;
use crate::chance::Chance;
use crate::drive::Drive;
use crate::motion::Motion;
use crate::plant::Readings;

/// What the sensors add.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Sensors {
    /// White noise of the output reading, standard deviation.
    pub white_arcsec: f64,
    /// Slow wander (Ornstein-Uhlenbeck), standard deviation.
    pub wander_arcsec: f64,
    /// Its correlation time.
    pub wander_s: f64,
    /// Step of the output encoder.
    pub output_step_rad: f64,
    /// Step of the generator encoder.
    pub generator_step_rad: f64,
    /// Noise of the torque reading.
    pub torque_n_m: f64,
    /// Noise of the temperature reading.
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

    /// White noise and wander together.
    pub fn all_arcsec(&self, drive: &Drive) -> f64 {
        self.floor_arcsec(drive).hypot(self.wander_arcsec)
    }

    /// Rows as the sensors give them: time, generator, output, torque, temperature, orientation.
    pub fn rows(&self, motion: &Motion, readings: &Readings, chance: &mut Chance) -> Vec<[f64; 6]> {
        let mut wander = self.wander_arcsec * chance.normal();
        let row_s = motion.step_s * motion.stride as f64;
        let stepped = |value: f64, step: f64| (value / step).round() * step;
        let mut last_s = motion.time_s[0];
        let picks = motion.picks(motion.stride).into_iter().enumerate();
        picks
            .map(|(row, at)| {
                let since = (motion.time_s[at] - last_s).max(row_s);
                last_s = motion.time_s[at];
                let keeps = (-since / self.wander_s).exp();
                wander = wander * keeps + self.wander_arcsec * (1.0 - keeps * keeps).sqrt() * chance.normal();
                let noise = wander + self.white_arcsec * chance.normal();
                [
                    motion.time_s[at],
                    stepped(readings.generator_rad[row], self.generator_step_rad),
                    stepped(readings.output_rad[row] + noise / ARCSEC, self.output_step_rad),
                    motion.torque_n_m[at] + self.torque_n_m * chance.normal(),
                    motion.temperature_c[at] + self.temperature_c * chance.normal(),
                    motion.orientation_rad[at],
                ]
            })
            .collect()
    }
}

/// `data.csv`: a header and these rows; what is not finite stays empty.
pub fn csv(rows: &[[f64; 6]], orientation_known: bool) -> String {
    let columns = ["time_s", "generator_rad", "output_rad", "torque_n_m", "temperature_c", "orientation_rad"];
    let told = if orientation_known { 6 } else { 5 };
    let mut text = String::with_capacity(rows.len() * 64 + 100);
    text.push_str(&columns[..told].join(","));
    text.push('\n');
    for row in rows {
        for (value, digits) in row[..told].iter().zip([5, 7, 10, 4, 2, 4]) {
            if value.is_finite() {
                let _ = write!(text, "{value:.digits$}");
            }
            text.push(',');
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
    pub fn new(motion: &Motion, white: f64, wander: f64, wander_s: f64) -> Self {
        let keeps = (-motion.step_s / wander_s).exp();
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
        Self { keeps, gain: p / (p + r), scale: 1.0 / (p + r).sqrt(), session_start: motion.session_start.clone() }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whitened_noise_is_white_and_of_variance_one() {
        let motion = Motion { step_s: 0.01, session_start: vec![0], ..Motion::default() };
        let whitening = Whitening::new(&motion, 2.0, 1.0, 3.0);
        let mut chance = Chance::new(1, "noise", 0);
        let keeps = (-0.01_f64 / 3.0).exp();
        let mut wander = 0.0;
        let column: Vec<f64> = (0..200_000)
            .map(|_| {
                wander = keeps * wander + (1.0 - keeps * keeps).sqrt() * chance.normal();
                wander + 2.0 * chance.normal()
            })
            .collect();
        let white = whitening.apply(&column);
        let mean_of =
            |lag: usize| white.iter().zip(&white[lag..]).map(|(a, b)| a * b).sum::<f64>() / white.len() as f64;
        assert!((mean_of(0) - 1.0).abs() < 0.02, "{}", mean_of(0));
        for lag in [1, 2, 10, 100] {
            assert!(mean_of(lag).abs() < 0.012, "lag {lag}: {}", mean_of(lag));
        }
    }
}
