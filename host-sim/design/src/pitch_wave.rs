//! The error over a tooth pitch from a few places of it: a smooth periodic wave is known better by the sum of sines
//! through its samples than by the largest and smallest of them.

use std::f64::consts::TAU;

use flexspline_base::robust::least_and_most;

/// Places between two samples at which the wave is looked at. The highest wave that samples resolve goes up and down
/// between two of them: its crest is then found to `1 - cos(pi / 64)`, a thousandth of it.
const BETWEEN: usize = 32;

/// Largest less smallest of the wave of least order through samples at equal steps over one period.
///
/// Waves of more than half as many orders as there are samples pass for lower ones, here as in the samples.
pub(crate) fn peak_to_peak(samples: &[f64]) -> f64 {
    let count = samples.len();
    let waves: Vec<[f64; 2]> = (0..=count / 2)
        .map(|order| {
            // A wave of half as many orders as samples has one phase alone, and counts once.
            let twice = if order == 0 || 2 * order == count { 1.0 } else { 2.0 };
            samples.iter().enumerate().fold([0.0; 2], |[c, s], (k, value)| {
                let (sin, cos) = (TAU * ((order * k) % count) as f64 / count as f64).sin_cos();
                let part = twice * value / count as f64;
                [c + part * cos, s + part * sin]
            })
        })
        .collect();
    let places = BETWEEN * count;
    let at = |place: usize| -> f64 {
        let wave = |(order, [c, s]): (usize, &[f64; 2])| {
            let (sin, cos) = (TAU * ((order * place) % places) as f64 / places as f64).sin_cos();
            c * cos + s * sin
        };
        // The mean is no part of a difference.
        waves.iter().enumerate().skip(1).map(wave).sum()
    };
    let (low, high) = least_and_most((0..places).map(at));
    if count == 0 { 0.0 } else { high - low }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampled(count: usize, from: f64, wave: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..count).map(|k| wave(from + TAU * k as f64 / count as f64)).collect()
    }

    /// A closed form, wherever the samples begin: `cos x + a cos 2x` with a below 1/4 has its ends at 0 and π, and goes
    /// 2 from one to the other.
    #[test]
    fn the_ends_of_a_wave_are_found_between_its_samples() {
        for from in [0.0, 0.1, 0.3, 0.39] {
            let samples = sampled(8, from, |x| 7.0 + x.cos() + 0.2 * (2.0 * x).cos());
            let raw =
                samples.iter().copied().fold(f64::MIN, f64::max) - samples.iter().copied().fold(f64::MAX, f64::min);
            assert!((peak_to_peak(&samples) - 2.0).abs() < 2e-3, "{from}: {}", peak_to_peak(&samples));
            assert!(from == 0.0 || raw < 2.0 - 1e-3, "{from}: {raw}");
        }
        let odd = sampled(7, 0.2, |x| 3.0 * (3.0 * x).sin());
        assert!((peak_to_peak(&odd) - 6.0).abs() < 6e-3, "{}", peak_to_peak(&odd));
    }

    #[test]
    fn what_stands_has_no_wave() {
        assert!(peak_to_peak(&[5.0; 8]).abs() < 1e-12 && peak_to_peak(&[3.0]).abs() < 1e-12);
        assert_eq!(peak_to_peak(&[]), 0.0);
    }
}
