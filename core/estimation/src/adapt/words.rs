//! Settings and state as words under a sum.

use super::state::{AdaptCounters, AdaptState, Learning};
use super::{OnlineCalibration, Term};
use flexspline::shared::words;

words!([const N: usize] OnlineCalibration<N> {
    terms, limits, first, per_noise, noise_counts, forget, gate, per_window, settle, half_limit, torque_limit, sum,
    owner,
});
words!([const N: usize] AdaptState<N> {
    x, d, u, learning, counters, generator, contact, has_contact, touched, side, run, consistency,
});
words!([] AdaptCounters {
    used, quiet, outliers, outliers_in_a_row, unsettled, unexcited, untrusted, limited, restarts,
});

impl Term {
    pub(super) const fn code(self) -> u32 {
        match self {
            Self::Mean => 0,
            Self::WindUp => 1,
            Self::HalfWidth => 2,
            Self::Cos(order) => 3 | (order as u32) << 8,
            Self::Sin(order) => 4 | (order as u32) << 8,
        }
    }

    /// Back from its code; settings are checked before they are used, so no other number comes here.
    pub(super) const fn of_code(code: u32) -> Self {
        let order = (code >> 8) as u8;
        match code as u8 {
            0 => Self::Mean,
            1 => Self::WindUp,
            2 => Self::HalfWidth,
            3 => Self::Cos(order),
            _ => Self::Sin(order),
        }
    }
}

impl Learning {
    /// By definition [`Self::Off`], and what was learnt is lost; nobody has switched it since.
    pub(super) const LOST: u32 = 3;

    pub(super) const fn code(self) -> u32 {
        self as u32
    }

    /// Back from its code.
    pub(super) const fn of_code(code: u32) -> Self {
        match code {
            1 => Self::Frozen,
            2 => Self::On,
            _ => Self::Off,
        }
    }
}

impl<const N: usize> OnlineCalibration<N> {
    /// A state for one that is lost: nothing learnt, off until it is switched, and counted.
    pub(crate) fn begin_again(&self) -> AdaptState<N> {
        let counters = AdaptCounters { restarts: 1, ..AdaptCounters::default() };
        AdaptState { counters, learning: Learning::LOST, ..self.start() }
    }
}
