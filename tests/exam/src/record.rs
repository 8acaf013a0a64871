//! Rows of a bench with the readings of its encoders without noise.

use std::f64::consts::TAU;

use crate::ARCSEC;

/// One row.
pub struct Row {
    pub time_s: f64,
    /// True angle of the generator at the stamp of the row.
    pub generator_rad: f64,
    pub speed_rad_s: f64,
    /// As the sensor feels it; positive where it turns the output forward.
    pub torque_n_m: f64,
    pub temperature_c: f64,
    /// Angle by which the housing is turned about its axis.
    pub orientation_rad: f64,
}

/// A run in columns.
#[derive(Debug, Clone, Default)]
pub struct Record {
    /// Between rows.
    pub step_s: f64,
    pub time_s: Vec<f64>,
    pub generator_rad: Vec<f64>,
    pub speed_rad_s: Vec<f64>,
    pub torque_n_m: Vec<f64>,
    pub temperature_c: Vec<f64>,
    pub orientation_rad: Vec<f64>,
    /// First row of each session.
    pub session_start: Vec<usize>,
    /// Whether `data.csv` has the orientation.
    pub orientation_known: bool,
    /// Readings of the two encoders.
    pub generator_read_rad: Vec<f64>,
    pub output_read_rad: Vec<f64>,
}

impl Record {
    pub fn new(step_s: f64, orientation_known: bool) -> Self {
        Self { step_s, orientation_known, ..Self::default() }
    }

    /// The next row begins a session.
    pub fn begin_session(&mut self) {
        self.session_start.push(self.time_s.len());
    }

    pub fn push(&mut self, row: &Row) {
        self.time_s.push(row.time_s);
        self.generator_rad.push(row.generator_rad);
        self.speed_rad_s.push(row.speed_rad_s);
        self.torque_n_m.push(row.torque_n_m);
        self.temperature_c.push(row.temperature_c);
        self.orientation_rad.push(row.orientation_rad);
    }

    /// Output reading less generator reading over the ratio, arcsec: what a diagnosis has to explain.
    pub fn error_arcsec(&self, ratio: f64) -> Vec<f64> {
        let pairs = self.output_read_rad.iter().zip(&self.generator_read_rad);
        pairs.map(|(out, psi)| (out - psi / ratio) * ARCSEC).collect()
    }

    /// Every `n`th row, counted anew in each session.
    pub fn picks(&self, n: usize) -> Vec<usize> {
        let ends = self.session_start[1..].iter().copied().chain([self.time_s.len()]);
        self.session_start.iter().zip(ends).flat_map(|(&start, end)| (start..end).step_by(n)).collect()
    }

    /// These rows of every `n`th, without readings.
    pub fn thinned(&self, n: usize, picks: &[usize]) -> Self {
        let mut thin = Self::new(self.step_s * n as f64, self.orientation_known);
        for &at in picks {
            if self.session_start.contains(&at) {
                thin.begin_session();
            }
            thin.push(&Row {
                time_s: self.time_s[at],
                generator_rad: self.generator_rad[at],
                speed_rad_s: self.speed_rad_s[at],
                torque_n_m: self.torque_n_m[at],
                temperature_c: self.temperature_c[at],
                orientation_rad: self.orientation_rad[at],
            });
        }
        thin
    }

    /// Generator turns between the extremes of its angle.
    pub fn turns(&self) -> f64 {
        let high = self.generator_rad.iter().copied().fold(f64::MIN, f64::max);
        let low = self.generator_rad.iter().copied().fold(f64::MAX, f64::min);
        (high - low) / TAU
    }
}
