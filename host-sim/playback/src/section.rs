//! What a table says at one load, both directions: what another's lookup can be given.

use std::f64::consts::TAU;

use flexspline::{Direction, GeneratorAngle, Table};

/// Both directions of the output.
pub const BOTH: [Direction; 2] = [Direction::Forward, Direction::Backward];

/// +1 forward, −1 backward.
pub(super) fn sign(direction: Direction) -> f64 {
    f64::from(direction.sign())
}

/// A point of a section.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// Generator angle, rad.
    pub generator_rad: f64,
    /// The same through the ratio: where the output should be, rad.
    pub led_rad: f64,
    /// Direction of the output.
    pub direction: Direction,
    /// Output error, rad.
    pub error_rad: f64,
}

/// A table at one load and temperature, in steady motion.
#[derive(Clone, Copy)]
pub struct Section<'a> {
    table: &'a Table<'a>,
    torque_n_m: f32,
    temperature_c: f32,
}

impl<'a> Section<'a> {
    /// The table at this load (N·m) and temperature (°C), both finite.
    pub fn new(table: &'a Table<'a>, torque_n_m: f64, temperature_c: f64) -> Section<'a> {
        Section { table, torque_n_m: torque_n_m as f32, temperature_c: temperature_c as f32 }
    }

    /// Generator turns to an output turn, negative where they turn against each other.
    pub fn ratio(&self) -> f64 {
        self.table.drive().exact_ratio()
    }

    /// Output turns after which everything repeats: those that take a whole number of generator turns.
    pub(crate) fn period_turns(&self) -> u32 {
        let waves = self.table.drive().circular_spline_teeth() - self.table.drive().flexspline_teeth();
        let turns = |count: &u32| (self.ratio() * f64::from(*count)).fract().abs() < 1e-9;
        (1..u32::from(waves)).find(turns).unwrap_or(u32::from(waves))
    }

    /// Steady output error, rad.
    pub fn error_rad(&self, generator_rad: f64, direction: Direction) -> f64 {
        let generator = GeneratorAngle::from_rad(generator_rad).unwrap_or(GeneratorAngle::ZERO);
        let error = self.table.steady_error_rad(generator, self.torque_n_m, self.temperature_c, direction);
        f64::from(error.unwrap_or(0.0))
    }

    /// `count` points evenly over a travel of the output (rad), or over the whole period, in each of the directions.
    /// With a prime count no order of the drive divides it, so that each is sampled at all its phases.
    pub fn samples(&self, travel: Option<[f64; 2]>, count: u32, directions: &[Direction]) -> Vec<Sample> {
        let [from, to] = travel.unwrap_or([0.0, TAU * f64::from(self.period_turns())]);
        let at = |k: u32| from + (to - from) * f64::from(k) / f64::from(count);
        let of = |direction: Direction| {
            (0..count).map(move |k| {
                let led_rad = at(k);
                let generator_rad = led_rad * self.ratio();
                Sample { generator_rad, led_rad, direction, error_rad: self.error_rad(generator_rad, direction) }
            })
        };
        directions.iter().flat_map(|direction| of(*direction)).collect()
    }

    /// Order per generator turn, up to 32, that holds most of these samples, and its amplitude in rad.
    pub(crate) fn strongest_order(&self, samples: &[Sample]) -> (u32, f64) {
        let count = samples.len().max(1) as f64;
        let mean = samples.iter().map(|sample| sample.error_rad).sum::<f64>() / count;
        let amplitude = |order: u32| {
            let (mut c, mut s) = (0.0, 0.0);
            for sample in samples {
                let (sine, cosine) = (f64::from(order) * sample.generator_rad).sin_cos();
                c += (sample.error_rad - mean) * cosine;
                s += (sample.error_rad - mean) * sine;
            }
            2.0 / count * c.hypot(s)
        };
        (1..=32)
            .map(|order| (order, amplitude(order)))
            .fold((1, 0.0), |best, next| if next.1 > best.1 { next } else { best })
    }
}
