//! Sines of given orders by least squares, and the orders that a strain wave gear has by its teeth.

use serde::Serialize;

use super::rows::Axis;
use crate::least_squares::Normal;

/// An order that a part of the drive makes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NamedOrder {
    /// The angle whose turn it is counted in.
    pub axis: Axis,
    /// Waves in a turn of that angle.
    pub harmonic: u32,
    /// Waves in a generator turn.
    pub per_generator_turn: f64,
}

/// Highest harmonic that is named.
const NAMED: u32 = 8;

/// Orders that parts of a drive with this ratio make: harmonics 1 to 8 of each.
pub fn named_orders(ratio: f64) -> Vec<NamedOrder> {
    let of = |axis: Axis| {
        let turns = axis.turns_per_generator_turn(ratio).abs();
        (1..=NAMED).map(move |harmonic| NamedOrder { axis, harmonic, per_generator_turn: f64::from(harmonic) * turns })
    };
    Axis::ALL.into_iter().flat_map(of).collect()
}

/// A sine `amplitude * sin(order * angle + phase)`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Line {
    /// Waves in a turn of the angle.
    pub order: f64,
    /// Amplitude, in the unit of the data.
    pub amplitude: f64,
    /// Phase, rad, −π to π.
    pub phase_rad: f64,
    /// Standard deviation of the amplitude if the noise is white.
    pub amplitude_std: f64,
    /// The same over that of a sine that stands alone in evenly spread rows: how much the orders and the places of the
    /// rows confuse each other.
    pub confusion: f64,
}

/// A constant and sines of these orders that fit `y` over `angle` (rad) best, all together.
/// `None` if the data cannot tell the orders apart, or are too few.
pub fn harmonics(angle: &[f64], y: &[f64], orders: &[f64]) -> Option<(f64, Vec<Line>)> {
    let (n, width) = (angle.len().min(y.len()), 1 + 2 * orders.len());
    let put = |k: usize, row: &mut [f64]| {
        for (place, order) in orders.iter().enumerate() {
            (row[1 + 2 * place], row[2 + 2 * place]) = (order * angle[k]).sin_cos();
        }
        (y[k], 1.0)
    };
    let fit = (n > width).then(|| Normal::of(width, n, put)).flatten()?.sound(n)?;
    let value = fit.values();
    // Standard deviation of the noise in a row.
    let noise = (fit.misfit() / (n - width) as f64).sqrt();
    let line = |(place, order): (usize, &f64)| {
        let k = 1 + 2 * place;
        let unit = (0.5 * (fit.inverse[(k, k)] + fit.inverse[(k + 1, k + 1)])).sqrt();
        Line {
            order: *order,
            amplitude: value[k].hypot(value[k + 1]),
            phase_rad: value[k + 1].atan2(value[k]),
            amplitude_std: unit * noise,
            confusion: unit * (n as f64 / 2.0).sqrt(),
        }
    };
    Some((value[0], orders.iter().enumerate().map(line).collect()))
}

/// Values at angles (rad) without a constant and lines.
pub(super) fn without(angle: &[f64], value: &[f64], (constant, lines): &(f64, Vec<Line>)) -> Vec<f64> {
    let said = |angle: f64| constant + lines.iter().map(|line| line.at(angle)).sum::<f64>();
    angle.iter().zip(value).map(|(angle, value)| value - said(*angle)).collect()
}

impl Line {
    /// Its value at an angle, rad.
    pub fn at(&self, angle: f64) -> f64 {
        self.amplitude * (self.order * angle + self.phase_rad).sin()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_are_recovered_with_phase_and_offset() {
        let angle: Vec<f64> = (0..400).map(|k| f64::from(k) * 0.11).collect();
        let y: Vec<f64> =
            angle.iter().map(|x| 3.0 + 5.0 * (2.0 * x + 0.7).sin() + 1.5 * (3.3 * x - 2.0).sin()).collect();
        let (constant, lines) = harmonics(&angle, &y, &[2.0, 3.3]).unwrap();
        assert!((constant - 3.0).abs() < 1e-9);
        assert!((lines[0].amplitude - 5.0).abs() < 1e-9 && (lines[0].phase_rad - 0.7).abs() < 1e-9);
        assert!((lines[1].amplitude - 1.5).abs() < 1e-9 && (lines[1].phase_rad + 2.0).abs() < 1e-9);
        assert!((lines[0].at(0.3) - 5.0 * 1.3_f64.sin()).abs() < 1e-9);
    }

    #[test]
    fn orders_that_the_data_cannot_tell_apart_are_refused() {
        let angle: Vec<f64> = (0..400).map(|k| f64::from(k) * 1e-4).collect();
        assert_eq!(harmonics(&angle, &angle, &[2.0, 2.0 * 94.0 / 95.0]), None);
        assert_eq!(harmonics(&angle[..3], &angle[..3], &[2.0]), None);
    }

    #[test]
    fn the_standard_deviation_is_that_of_repeated_trials() {
        let angle: Vec<f64> = (0..300).map(|k| f64::from(k) * 0.13).collect();
        let mut random = fastrand::Rng::with_seed(9);
        let (mut sum, mut said) = (0.0, 0.0);
        for _ in 0..300 {
            let noise = || (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
            let y: Vec<f64> = angle
                .iter()
                .map(|x| 10.0 * (2.0 * x).sin())
                .zip(std::iter::repeat_with(noise))
                .map(|(y, n)| y + n)
                .collect();
            let (_, lines) = harmonics(&angle, &y, &[2.0]).unwrap();
            sum += (lines[0].amplitude - 10.0).powi(2);
            said += lines[0].amplitude_std / 300.0;
        }
        let std = (sum / 300.0).sqrt();
        assert!((said / std - 1.0).abs() < 0.12, "said {said}, seen {std}");
    }
}
