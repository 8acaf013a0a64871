//! Errors around a wheel.

use std::f64::consts::TAU;

/// A periodic error around a wheel, by points of a turn between which it is straight.
pub struct Profile(Vec<f64>);

impl Profile {
    /// By points of a turn.
    pub fn new(points: Vec<f64>) -> Self {
        Self(points)
    }

    /// Sum of sines at these points of a turn: order, amplitude, phase.
    pub fn sines(lines: &[(f64, f64, f64)], points: usize) -> Self {
        let at = |point: usize| {
            let angle = point as f64 / points as f64 * TAU;
            lines.iter().map(|(order, amplitude, phase)| amplitude * (order * angle + phase).sin()).sum()
        };
        Self((0..points).map(at).collect())
    }

    /// At an angle.
    pub fn at(&self, angle_rad: f64) -> f64 {
        let points = self.0.len();
        let place = (angle_rad / TAU).rem_euclid(1.0) * points as f64;
        let (from, part) = (place as usize % points, place.fract());
        self.0[from] + part * (self.0[(from + 1) % points] - self.0[from])
    }
}
