//! Whether measurements agree with what was learnt, over windows: what lets an estimate that is wrong recover.
//!
//! A Kalman filter with a gate believes its own covariance. If a sensor was wrong while it learnt, a right measurement
//! is an outlier afterwards, for ever. So each measurement is judged under three hypotheses, with `ν₁` its innovation
//! with the coefficients, `ν₀` without them, both in units of the stated noise, `r` the measured ratio of the
//! innovations' variance to the expected one, and `P₀` the covariance of the settings:
//!
//! ```text
//! learnt:  S₁ = r + hᵀP h,    q₁ = ν₁²/S₁        what was learnt holds
//! anew:    S₀ = r + hᵀP₀h,    q₀ = ν₀²/S₀        it does not; coefficients are anything that was expected at first
//! sensor:  ν₀² > gate²·(1 + hᵀP₀h)               the measurement is impossible, whatever the coefficients are
//! ```
//!
//! * **Sensor.** While more than half of the measurements of a window are impossible, none is used: a sensor that is
//!   frozen or has the wrong sign passes by the right value now and then.
//! * **Anew.** The evidence for a start from the prior is Page's cumulative sum of the logarithm of the likelihood
//!   ratio,
//!
//!   ```text
//!   e ← max(0, e + [q₁]₂₅ − [q₀]₆ − [ln S₀/S₁]₁₂),      start anew at e = 8·W
//!   ```
//!
//!   with `[·]ₘ` bounded by `m`: one measurement has a bounded part in it, and a burst of outliers shorter than W/3
//!   does nothing. Then the covariance is P₀ again, and the next measurements correct the coefficients in their
//!   direction; others stay. As soon as there is evidence, the stated variance has its share of the prior one:
//!   `(e/8W)·hᵀP₀h`.
//! * **Noise.** `r ← r·(1 + ([q₁]₄ − 0.92)/10W)`, Huber's M-estimate of scale as a recursion. It is the noise of the
//!   filter, so that a sensor that is worse than stated is neither believed too much nor locked out, and what exceeds 1
//!   of it is model error, by so much the stated variance is larger.
//! * **Worth.** `w ← w + ([ν₁²/r]₂₅ − [ν₀²/r]₂₅ − w)/W`: above 0 the table alone does better than the table with the
//!   coefficients; then these fade towards 0 by `min(w, 1)/W` with each measurement.
//!
//! Sources: E. S. Page, *Continuous inspection schemes*, Biometrika 41 (1954), 100-115, the sum; R. K. Mehra, *On the
//! identification of variances and adaptive Kalman filtering*, IEEE Trans. AC-15 (1970), 175-184, the noise from the
//! innovations; P. J. Huber, *Robust Statistics* (1981), ch. 5, its bounded form; G. C. Goodwin, H. Elliott and E. K.
//! Teoh, *Deterministic convergence of a self-tuning regulator with covariance resetting*, IEE Proc. D 130 (1983), 6-8,
//! the start from the first covariance.

use flexspline::shared::num;

/// Part of the memory that a window is, and its limits, measurements. Guesses: a tenth is long enough that bursts of
/// bad measurements do nothing, and short enough that an estimate recovers within the memory; a thousand measurements
/// are evidence enough.
const WINDOW: (f32, [f32; 2]) = (0.1, [10.0, 1000.0]);
/// Most that one measurement says against what was learnt: five standard deviations. Guess.
const MOST: f32 = 25.0;
/// Most that it says against the prior, and most that a wide prior costs: together less than [`MOST`], so that
/// measurements which contradict what was learnt are evidence for a start anew whatever the prior is.
const MOST_ANEW: f32 = 6.0;
const MOST_COST: f32 = 12.0;
/// Most that one measurement is taken for noise, and the mean of what is bounded by it of the square of a normal
/// number: a quarter of the measurements may be outliers before the noise is.
const MOST_NOISE: f32 = 4.0;
const MEAN_NOISE: f32 = 0.920_5;
/// Evidence for a start anew in each measurement of a window, on average. At least 7 is what a contradicted one has, 16
/// is usual.
const EVIDENCE: f32 = 8.0;
/// The noise adapts over this number of windows: slower than what was learnt is found to be wrong, or that would be
/// taken for noise. Guess.
const NOISE_WINDOWS: f32 = 10.0;
/// Limits of the variance of the innovations over the expected one: up to ten times the stated noise. Guesses.
const NOISE: [f32; 2] = [0.5, 100.0];

/// Statistics of windows of measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Consistency {
    /// Variance of the innovations over the expected one.
    noise: f32,
    /// Evidence for a start anew, in parts of what is enough: 0 to 1.
    anew: f32,
    /// Mean square of innovations with the coefficients less that without, in units of the noise.
    worse: f32,
    /// Share of measurements that were impossible.
    impossible: f32,
}

flexspline::shared::words!([] Consistency { noise, anew, worse, impossible });

/// One measurement as both hypotheses see it: squares of innovations, and their expected spreads, in units of the
/// stated noise.
#[derive(Clone, Copy, Debug)]
pub(super) struct HypothesisErrors {
    pub with: f32,
    pub without: f32,
    /// The noise, of which this is stated.
    pub noise: f32,
    pub stated: f32,
    /// `hᵀP h` and `hᵀP₀h`.
    pub learnt: f32,
    pub prior: f32,
}

/// Consequence of a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Judgement {
    /// The sensor is not to be believed.
    Sensor,
    /// The learnt coefficients are no longer valid.
    Anew,
    /// Coefficients fade by this factor.
    Fade(f32),
}

/// 1/W of a memory of 1/`forget` measurements.
pub(super) fn per_window(forget: f32) -> f32 {
    let (share, limits) = WINDOW;
    1.0 / num::within(share / forget, limits)
}

/// `ln x` of a number from 1 on, to 0.06: the bits of a float are a straight line between powers of two.
fn logarithm(x: f32) -> f32 {
    const PER_BIT: f32 = core::f32::consts::LN_2 / 8_388_608.0;
    (x.to_bits() as i32).saturating_sub(0x3f80_0000) as f32 * PER_BIT
}

fn at_most(value: f32, most: f32) -> f32 {
    if value < most { value } else { most }
}

impl Consistency {
    pub(super) const NEW: Self = Self { noise: 1.0, anew: 0.0, worse: 0.0, impossible: 0.0 };
    /// Of coefficients that come from a saved state: nobody knows what happened meanwhile.
    pub(super) const RESTORED: Self = Self { anew: 0.5, ..Self::NEW };

    /// Whether updates can have left it.
    pub(super) fn is_sound(&self) -> bool {
        let within = |value: f32, [least, most]: [f32; 2]| value >= least && value <= most;
        within(self.noise, NOISE)
            && within(self.anew, [0.0, 1.0])
            && within(self.worse, [-MOST, MOST])
            && within(self.impossible, [0.0, 1.0])
    }

    /// Noise variance of a measurement over the stated one, never less than that.
    pub(super) fn noise(&self) -> f32 {
        num::larger(self.noise, 1.0)
    }

    /// Increase of the stated variance, in units of the stated noise, for this prior.
    pub(super) fn doubt(&self, prior: f32) -> f32 {
        self.noise() - 1.0 + self.anew * prior
    }

    /// Judges one measurement. `gate` is the square of the setting.
    pub(super) fn judge(&mut self, seen: &HypothesisErrors, gate: f32, per_window: f32) -> Judgement {
        let impossible = seen.without > gate * (seen.stated + seen.prior);
        self.impossible += (if impossible { 1.0 } else { 0.0 } - self.impossible) * per_window;
        if impossible || self.impossible > 0.5 {
            return Judgement::Sensor;
        }
        let (spread, prior_spread) = (seen.noise + seen.learnt, seen.noise + seen.prior);
        let learnt = at_most(seen.with / spread, MOST);
        let cost = num::within(logarithm(prior_spread / spread), [0.0, MOST_COST]);
        let evidence = learnt - at_most(seen.without / prior_spread, MOST_ANEW) - cost;
        self.anew = num::larger(self.anew + evidence * (per_window * (1.0 / EVIDENCE)), 0.0);
        let taken = at_most(learnt, MOST_NOISE) - MEAN_NOISE;
        self.noise = num::within(self.noise * (1.0 + taken * (per_window / NOISE_WINDOWS)), NOISE);
        let bounded = |square: f32| at_most(square / seen.noise, MOST);
        self.worse += (bounded(seen.with) - bounded(seen.without) - self.worse) * per_window;
        if self.anew >= 1.0 {
            (self.anew, self.worse) = (0.0, 0.0);
            return Judgement::Anew;
        }
        Judgement::Fade(1.0 - num::within(self.worse, [0.0, 1.0]) * per_window)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_are_near_enough() {
        for i in 0..4000 {
            let x = (i as f32 * 0.005).exp();
            assert!((logarithm(x) - x.ln()).abs() < 0.06, "{x}");
        }
    }
}
