//! Learning with its settings and its state each under a sum ([`Sealed`]): where an upset hit one word
//! of them it is mended in the next update. Settings that are lost add nothing ([`Verdict::Lost`]); what was
//! learnt and is lost begins anew from zero, off, and is counted ([`AdaptCounters::restarts`]). What it adds is bounded
//! by the limits of the coefficients, whatever the state.

use crate::adapt::{
    self, AdaptCounters, AdaptError, AdaptRestoreError, AdaptSettings, Adapted, Learning, Seen, Verdict,
};
use flexspline::shared::Sealed;
use flexspline::{Adjustment, Joint, Store};

/// Estimates `N` coefficients: all that does not change while it runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnlineCalibration<const N: usize> {
    adapter: Sealed<adapt::OnlineCalibration<N>>,
}

/// Learnt state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptState<const N: usize> {
    learnt: Sealed<adapt::AdaptState<N>>,
}

impl<const N: usize> OnlineCalibration<N> {
    /// Checks the settings. The coefficients are of this joint, with the table that is in use now: saved states carry
    /// both, and are restored only where they belong.
    ///
    /// `unit` distinguishes joints with the same settings and the same table, such as the wheels of a rover; 0 if there
    /// is one. Without a table there is no owner. Make it anew after another table was activated, and [`Self::reset`]
    /// the state: what was learnt belongs to the table before.
    ///
    /// # Errors
    /// [`AdaptError`] names the first that is out of its range.
    pub fn new(settings: &AdaptSettings<N>, joint: &Joint, store: &Store, unit: u32) -> Result<Self, AdaptError> {
        Ok(Self::of_first(settings, N)?.owned_by(joint, store, unit))
    }

    /// An adapter of the first N coefficients, of nobody: those after them (`NO_COEFFICIENT`) change no bit of what
    /// these come to, and are in no sum and no saved state.
    #[doc(hidden)]
    pub fn of_first(settings: &AdaptSettings<N>, used: usize) -> Result<Self, AdaptError> {
        adapt::OnlineCalibration::of_first(settings, used).map(|adapter| Self { adapter: Sealed::new(adapter) })
    }

    /// Makes the settings whole, where they lie in memory and an upset hit a word of them; false if they are lost, and
    /// the adapter has to be made anew. For a slow rate group: until then each update mends a copy.
    pub fn mend(&mut self) -> bool {
        self.adapter.mend()
    }

    /// Whether the settings are lost to an upset that cannot be mended.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        !self.adapter.is_whole() && self.adapter.open().is_none()
    }

    /// A state in which nothing is learnt yet, [`Learning::Off`].
    #[must_use]
    pub fn start(&self) -> AdaptState<N> {
        let start = self.adapter.with(adapt::OnlineCalibration::start);
        AdaptState { learnt: Sealed::new(start.unwrap_or_else(|| self.adapter.kept().start())) }
    }

    /// Forgets what was learnt; counters and [`Learning`] stay. The joint's limiter takes the adjustment out.
    pub fn reset(&self, state: &mut AdaptState<N>) {
        self.on(state, adapt::OnlineCalibration::reset);
    }

    /// One tick: follows the play, learns from the measurement if there is one, and returns the addition in the next
    /// tick.
    ///
    /// Call it every tick, in order, also without a measurement. Nothing that comes in can make the adjustment exceed
    /// the limits or be undefined. No search, no loop that depends on data: on a Cortex-M4F a tick with a measurement
    /// that is used takes 2480 instructions for five coefficients, whatever the values, and one without at most 1051
    /// (counted by `tests/firmware`).
    pub fn update(&self, state: &mut AdaptState<N>, seen: &Seen<'_>) -> Adapted {
        let uncertainty_rad = Adjustment::MAX_RAD;
        let adjustment = Adjustment::default().with_uncertainty(uncertainty_rad);
        let nothing = Adapted { adjustment, uncertainty_rad, verdict: Verdict::Lost };
        self.on(state, |adapter, learnt| adapter.update(learnt, seen)).unwrap_or(nothing)
    }

    /// Settings and state, mended; where the state is lost it begins anew, where the settings are nothing is done.
    fn on<R>(
        &self,
        state: &mut AdaptState<N>,
        act: impl Fn(&adapt::OnlineCalibration<N>, &mut adapt::AdaptState<N>) -> R,
    ) -> Option<R> {
        self.adapter
            .with(|adapter| {
                let done = state.learnt.change(|learnt| act(adapter, learnt));
                done.or_else(|| {
                    state.learnt.close(adapter.begin_again());
                    state.learnt.change(|learnt| act(adapter, learnt))
                })
            })
            .flatten()
    }

    /// The coefficients in the order of the settings, and their standard deviations: rad, or rad/(N·m). NaN if settings
    /// or state are lost.
    #[must_use]
    pub fn coefficients(&self, state: &AdaptState<N>) -> [(f32, f32); N] {
        let look = |adapter: &adapt::OnlineCalibration<N>| state.learnt.with(|learnt| adapter.coefficients(learnt));
        self.adapter.with(look).flatten().unwrap_or([(f32::NAN, f32::NAN); N])
    }

    /// The same of another owner.
    #[doc(hidden)]
    #[must_use]
    pub fn owned_by(self, joint: &Joint, store: &Store, unit: u32) -> Self {
        let owned = self.adapter.open().map(|adapter| adapter.owned_by(joint, store, unit));
        owned.map_or(self, |adapter| Self { adapter: Sealed::new(adapter) })
    }

    /// Whether it has another owner than `other`.
    #[doc(hidden)]
    #[must_use]
    pub fn has_other_owner(&self, other: &Self) -> bool {
        self.adapter.kept().has_other_owner(other.adapter.kept())
    }

    /// Writes what was learnt, with a CRC-32, for storage across a reset: the first
    /// [`saved_adapt_bytes`](crate::saved_adapt_bytes)`(N)` bytes. `None` if there are fewer, or settings or state are
    /// lost.
    ///
    /// | bytes | what, little endian |
    /// |---|---|
    /// | 4 | `FXA`, version 2 |
    /// | 8 | id of the table, as [`Self::new`] found it; else zeros |
    /// | 8, 4 | sums of the joint's settings, number of the unit; else zeros |
    /// | 4 | sum of the settings |
    /// | 4·N | coefficients in units of their limits, `f32` |
    /// | 4·N | `D`, `f32` |
    /// | 2·N·(N−1) | `U` above its diagonal, by columns, `f32` |
    /// | 4 | CRC-32 of all before |
    pub fn save(&self, state: &AdaptState<N>, bytes: &mut [u8]) -> Option<usize> {
        self.save_first(state, N, bytes)
    }

    /// The same for the first N coefficients.
    #[doc(hidden)]
    pub fn save_first(&self, state: &AdaptState<N>, used: usize, bytes: &mut [u8]) -> Option<usize> {
        let save =
            |adapter: &adapt::OnlineCalibration<N>| state.learnt.with(|learnt| adapter.save_first(learnt, used, bytes));
        self.adapter.with(save).flatten().flatten()
    }

    /// A state from [`Self::save`], in [`Learning::Off`], of the same coefficients and the same owner.
    ///
    /// Nobody knows what happened meanwhile. Until measurements agree, the stated variance has half of the prior one,
    /// and half of the evidence that is needed otherwise starts it anew.
    ///
    /// # Errors
    /// [`AdaptRestoreError`] says why the bytes are no state of this adapter; one that is lost has other coefficients.
    pub fn restore(&self, bytes: &[u8]) -> Result<AdaptState<N>, AdaptRestoreError> {
        self.restore_first(N, bytes)
    }

    /// The same for the first N coefficients.
    #[doc(hidden)]
    pub fn restore_first(&self, used: usize, bytes: &[u8]) -> Result<AdaptState<N>, AdaptRestoreError> {
        let found = self.adapter.with(|adapter| adapter.restore_first(used, bytes));
        let learnt = found.ok_or(AdaptRestoreError::OtherCoefficients)??;
        Ok(AdaptState { learnt: Sealed::new(learnt) })
    }
}

impl<const N: usize> AdaptState<N> {
    /// Whether measurements are used; [`Learning::Off`] where the state is lost.
    #[must_use]
    pub fn learning(&self) -> Learning {
        self.learnt.with(adapt::AdaptState::learning).unwrap_or_default()
    }

    /// Switches it, from the next update on. A state that is lost stays so, until an update begins anew.
    pub fn set_learning(&mut self, learning: Learning) {
        let _ = self.learnt.change(|learnt| learnt.set_learning(learning));
    }

    /// Counts of the measurements by verdict; where the state is lost, a start anew and nothing else.
    #[must_use]
    pub fn counters(&self) -> AdaptCounters {
        let lost = AdaptCounters { restarts: 1, ..AdaptCounters::default() };
        self.learnt.with(adapt::AdaptState::counters).unwrap_or(lost)
    }

    /// Whether it is lost to an upset that cannot be mended: the next update begins anew, off.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.learnt.open().is_none()
    }
}

#[cfg(any(test, feature = "testing"))]
flexspline::testing::upsets!([const N: usize] OnlineCalibration<N> { adapter });
#[cfg(any(test, feature = "testing"))]
flexspline::testing::upsets!([const N: usize] AdaptState<N> { learnt });
