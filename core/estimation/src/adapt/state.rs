//! Learnt state, and counts of the measurements.

use super::consistency::Consistency;
use flexspline::{GeneratorAngle, OutputAngle};

/// Whether measurements change anything.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Learning {
    /// The adjustment is zero; what was learnt is kept. The start.
    #[default]
    Off,
    /// The learnt coefficients are used and stay as they are.
    Frozen,
    /// Measurements are used.
    On,
}

/// Verdict on a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Verdict {
    /// There was none, or nothing is to be learnt.
    Idle,
    /// Used.
    Used,
    /// Within what is not known anyway: it says nothing.
    Quiet,
    /// Beyond the gate.
    Outlier,
    /// Too soon after a reversal.
    Unsettled,
    /// No coefficient changes the output enough here to be seen in the noise.
    Unexcited,
    /// The tick itself was not to be trusted: sample lost or not believed, torque out of range or not finite, table in
    /// doubt.
    Untrusted,
    /// Learnt coefficients or settings are lost to an upset: nothing is added.
    Lost,
}

/// How many measurements of each [`Verdict`], and what else happened; all stop at their largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AdaptCounters {
    /// [`Verdict::Used`].
    pub used: u32,
    /// [`Verdict::Quiet`].
    pub quiet: u32,
    /// [`Verdict::Outlier`].
    pub outliers: u32,
    /// Outliers in a row until now: many say that the output encoder or its zero is not what it was.
    pub outliers_in_a_row: u32,
    /// [`Verdict::Unsettled`].
    pub unsettled: u32,
    /// [`Verdict::Unexcited`].
    pub unexcited: u32,
    /// [`Verdict::Untrusted`].
    pub untrusted: u32,
    /// Coefficients held at their limit, once for each and each measurement.
    pub limited: u32,
    /// Starts with the first variances: measurements contradicted what was learnt for a window, or, from zero, the
    /// state was hit by an upset.
    pub restarts: u32,
}

/// Learnt state. Coefficients in units of their limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptState<const N: usize> {
    pub(super) x: [f32; N],
    pub(super) d: [f32; N],
    /// Columns above the diagonal, which is 1.
    pub(super) u: [[f32; N]; N],
    /// The code of [`Learning`]: every pattern of bits is a number.
    pub(super) learning: u32,
    pub(super) counters: AdaptCounters,
    pub(super) generator: GeneratorAngle,
    /// Where contact was last, if `has_contact` is not 0.
    pub(super) contact: OutputAngle,
    pub(super) has_contact: u32,
    /// Nominal output where the play last moved, the side in contact there, and the way it moved to that side.
    pub(super) touched: OutputAngle,
    pub(super) side: i32,
    pub(super) run: i32,
    pub(super) consistency: Consistency,
}

impl<const N: usize> AdaptState<N> {
    /// Whether measurements are used.
    #[must_use]
    pub const fn learning(&self) -> Learning {
        Learning::of_code(self.learning)
    }

    /// Switches it, from the next update on.
    pub const fn set_learning(&mut self, learning: Learning) {
        self.learning = learning.code();
    }

    /// Counts of the measurements by verdict.
    #[must_use]
    pub const fn counters(&self) -> AdaptCounters {
        self.counters
    }

    /// Whether it is what updates leave.
    pub(super) fn is_sound(&self) -> bool {
        self.x.iter().all(|x| x.abs() <= 1.0)
            && self.d.iter().all(|d| *d >= 0.0 && *d < 1e6)
            && self.u.as_flattened().iter().all(|u| u.is_finite())
            && self.consistency.is_sound()
    }

    /// The diagonal of `U·D·Uᵀ`.
    pub(super) fn variances(&self) -> [f32; N] {
        let mut variances = self.d;
        for (j, (column, d)) in self.u.iter().zip(self.d).enumerate() {
            variances.iter_mut().zip(column).take(j).for_each(|(variance, u)| *variance += d * u * u);
        }
        variances
    }
}

impl AdaptCounters {
    pub(super) fn note(&mut self, verdict: Verdict) {
        let one = |counter: &mut u32| *counter = counter.saturating_add(1);
        match verdict {
            Verdict::Idle | Verdict::Lost => return,
            Verdict::Used => one(&mut self.used),
            Verdict::Quiet => one(&mut self.quiet),
            Verdict::Outlier => one(&mut self.outliers),
            Verdict::Unsettled => one(&mut self.unsettled),
            Verdict::Unexcited => one(&mut self.unexcited),
            Verdict::Untrusted => one(&mut self.untrusted),
        }
        match verdict {
            Verdict::Outlier => one(&mut self.outliers_in_a_row),
            Verdict::Used | Verdict::Quiet => self.outliers_in_a_row = 0,
            _ => {}
        }
    }
}
