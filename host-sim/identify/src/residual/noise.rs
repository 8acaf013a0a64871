//! The noise under a residual: its white part, the part that remembers, and how many independent rows there are.

use flexspline_algebra::{spectrum, values_of};
use serde::Serialize;

use super::orders::Line;
use crate::diagnosis::rows::Rows;
use crate::measurement::{median_and_std, sampled, white_noise};

/// The sum of correlations is taken up to this many times itself (Sokal's window).
const WINDOW: f64 = 6.0;

/// Noise of a residual.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ResidualNoise {
    /// Standard deviation of the part that changes from row to row, arcsec.
    pub white_arcsec: f64,
    /// Robust standard deviation of the rest, lines and means by direction taken out: wander, and what is not
    /// explained, arcsec.
    pub correlated_arcsec: f64,
    /// Rows after which that is forgotten: sum of the correlations of both signs of the lag.
    pub decorrelation_rows: f64,
    /// Rows over that: how many independent rows there are.
    pub independent_rows: f64,
}

/// `lines` are sines of the generator angle that are taken out first.
pub(super) fn of(rows: &Rows, centred: &[f64], lines: &[Line]) -> ResidualNoise {
    let white = white_noise(rows.sessions.iter().map(|session| &centred[session.clone()]));
    let mut left: Vec<f64> = centred
        .iter()
        .zip(&rows.generator)
        .map(|(value, psi)| value - lines.iter().map(|line| line.at(*psi)).sum::<f64>())
        .collect();
    let spread = median_and_std(&mut sampled(&left)).1;
    // What lies far out counts as much as the border: single pulses are not memory.
    left.iter_mut().for_each(|value| *value = value.clamp(-4.0 * spread, 4.0 * spread));
    let length = correlation_length(&left);
    let n = left.len() as f64;
    ResidualNoise {
        white_arcsec: white,
        correlated_arcsec: (spread * spread - white * white).max(0.0).sqrt(),
        decorrelation_rows: length,
        independent_rows: n / length,
    }
}

/// Sum of the correlations over all lags, at least 1.
fn correlation_length(values: &[f64]) -> f64 {
    // A long record is judged by its first two million rows.
    let values = &values[..values.len().min(1 << 21)];
    let n = values.len();
    if n < 8 {
        return 1.0;
    }
    let mean = values.iter().sum::<f64>() / n as f64;
    let length = (2 * n).next_power_of_two();
    let mut padded = vec![0.0; length];
    padded.iter_mut().zip(values).for_each(|(padded, value)| *padded = value - mean);
    let mut sums = spectrum(&mut padded);
    sums.iter_mut().for_each(|sum| *sum = (sum.re * sum.re + sum.im * sum.im).into());
    let padded = values_of(&mut sums, length);
    if padded[0] <= 0.0 {
        return 1.0;
    }
    let mut length = 1.0;
    for lag in 1..n / 2 {
        length += 2.0 * padded[lag] / padded[0];
        if lag as f64 >= WINDOW * length.max(1.0) * 0.5 {
            break;
        }
    }
    length.max(1.0)
}
