//! Fourier transforms of real values.

use realfft::RealFftPlanner;
pub use realfft::num_complex::Complex;

/// `Σ values[n] exp(-2πi k n / N)` for `k` from 0 to `N / 2`; the values are lost.
#[must_use]
pub fn spectrum(values: &mut [f64]) -> Vec<Complex<f64>> {
    let transform = RealFftPlanner::new().plan_fft_forward(values.len());
    let mut sums = transform.make_output_vec();
    // The lengths are those of the plan, the only thing that can be wrong.
    transform.process(values, &mut sums).expect("lengths are those of the plan");
    sums
}

/// Back from the [`spectrum`] of `length` values, times their number; the spectrum is lost. The imaginary parts at zero
/// and, for an even length, at the end belong to no real values and are left out.
#[must_use]
pub fn values_of(sums: &mut [Complex<f64>], length: usize) -> Vec<f64> {
    let transform = RealFftPlanner::new().plan_fft_inverse(length);
    let mut values = transform.make_output_vec();
    sums[0].im = 0.0;
    if length.is_multiple_of(2) {
        sums[length / 2].im = 0.0;
    }
    transform.process(sums, &mut values).expect("lengths are those of the plan");
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_wave_stands_where_it_belongs_and_comes_back() {
        for length in [48_usize, 75] {
            let wave: Vec<f64> =
                (0..length).map(|n| 0.5 + 3.0 * (TAU * 7.0 * n as f64 / length as f64).sin()).collect();
            let mut sums = spectrum(&mut wave.clone());
            for (k, sum) in sums.iter().enumerate() {
                let due = match k {
                    0 => Complex::new(0.5, 0.0),
                    7 => Complex::new(0.0, -1.5),
                    _ => Complex::default(),
                };
                assert!((sum / length as f64 - due).norm() < 1e-13, "{length}, {k}: {sum}");
            }
            let back = values_of(&mut sums, length);
            assert!(wave.iter().zip(&back).all(|(a, b)| (a - b / length as f64).abs() < 1e-13));
        }
    }
}
