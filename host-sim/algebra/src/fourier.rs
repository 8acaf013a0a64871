//! Fourier transforms of real values.

use std::sync::{LazyLock, Mutex, PoisonError};

use realfft::RealFftPlanner;
pub use realfft::num_complex::Complex;

/// Keeps its plans: one of four million values takes as long as two transforms by it.
static PLANNER: LazyLock<Mutex<RealFftPlanner<f64>>> = LazyLock::new(|| Mutex::new(RealFftPlanner::new()));

/// `Σ values[n] exp(-2πi k n / N)` for `k` from 0 to `N / 2`; the values are lost.
pub fn spectrum(values: &mut [f64]) -> Vec<Complex<f64>> {
    let transform = PLANNER.lock().unwrap_or_else(PoisonError::into_inner).plan_fft_forward(values.len());
    let mut sums = transform.make_output_vec();
    // The lengths are those of the plan, the only thing that can be wrong.
    transform.process(values, &mut sums).expect("lengths are those of the plan");
    sums
}
