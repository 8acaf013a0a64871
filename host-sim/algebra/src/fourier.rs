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
