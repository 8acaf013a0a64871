//! Settings and state as words under a sum.

use super::state::{AdaptCounters, AdaptState, Learning};
use super::{Adapter, Term};
use crate::angle::{GeneratorAngle, OutputAngle};
use crate::whole::{Words, add, words};

impl Words for Term {
    fn sum(&self, sum: u64) -> u64 {
        add(sum, self.code())
    }

    fn each(&mut self, see: &mut dyn FnMut(u32) -> u32) {
        *self = Self::of_code(see(self.code())).unwrap_or(*self);
    }
}

impl Words for Learning {
    fn sum(&self, sum: u64) -> u64 {
        add(sum, self.code())
    }

    fn each(&mut self, see: &mut dyn FnMut(u32) -> u32) {
        *self = Self::of_code(see(self.code())).unwrap_or(*self);
    }
}

impl Words for Option<OutputAngle> {
    fn sum(&self, sum: u64) -> u64 {
        let angle = self.unwrap_or_default();
        add(angle.counts().sum(sum), self.is_some() as u32)
    }

    fn each(&mut self, see: &mut dyn FnMut(u32) -> u32) {
        let mut counts = self.unwrap_or_default().counts();
        counts.each(see);
        let is_some = see(self.is_some() as u32);
        *self = (is_some & 1 != 0).then_some(OutputAngle::from_counts(counts));
    }
}

macro_rules! words_of_angles {
    ($($angle:ty),*) => {$(
        impl Words for $angle {
            fn sum(&self, sum: u64) -> u64 {
                self.counts().sum(sum)
            }

            fn each(&mut self, see: &mut dyn FnMut(u32) -> u32) {
                let mut counts = self.counts();
                counts.each(see);
                *self = Self::from_counts(counts);
            }
        }
    )*};
}
words_of_angles!(GeneratorAngle, OutputAngle);

words!([const N: usize] Adapter<N> {
    terms, limits, first, per_noise, noise_counts, forget, gate, per_window, settle, half_limit, torque_limit, sum,
    owner,
});
words!([const N: usize] AdaptState<N> {
    x, d, u, learning, counters, generator, contact, touched, side, run, consistency,
});
words!([] AdaptCounters {
    used, quiet, outliers, outliers_in_a_row, unsettled, unexcited, untrusted, limited, restarts,
});

impl Term {
    const fn code(self) -> u32 {
        match self {
            Self::Mean => 0,
            Self::WindUp => 1,
            Self::HalfWidth => 2,
            Self::Cos(order) => 3 | (order as u32) << 8,
            Self::Sin(order) => 4 | (order as u32) << 8,
        }
    }

    const fn of_code(code: u32) -> Option<Self> {
        let order = (code >> 8) as u8;
        match code & !0xff00 {
            0 if order == 0 => Some(Self::Mean),
            1 if order == 0 => Some(Self::WindUp),
            2 if order == 0 => Some(Self::HalfWidth),
            3 => Some(Self::Cos(order)),
            4 => Some(Self::Sin(order)),
            _ => None,
        }
    }
}

impl Learning {
    const fn code(self) -> u32 {
        match self {
            Self::Off => 0,
            Self::Frozen => 1,
            Self::On => 2,
        }
    }

    const fn of_code(code: u32) -> Option<Self> {
        match code {
            0 => Some(Self::Off),
            1 => Some(Self::Frozen),
            2 => Some(Self::On),
            _ => None,
        }
    }
}

impl<const N: usize> Adapter<N> {
    /// A state for one that is lost: nothing learnt, off, and counted.
    pub(in crate::joint) fn begin_again(&self) -> AdaptState<N> {
        let counters = AdaptCounters { restarts: 1, ..AdaptCounters::default() };
        AdaptState { counters, ..self.start() }
    }
}

#[cfg(test)]
mod upset {
    use super::*;
    use crate::upset::{Upset, upsets};
    use std::string::String;

    macro_rules! codes {
        ($($code:ty),*) => {$(
            /// Bits of the number that it is kept as; what is none stays as it was.
            impl Upset for $code {
                fn bits(&self) -> usize {
                    32
                }

                fn flip(&mut self, bit: usize, _: &mut String) {
                    *self = Self::of_code(self.code() ^ 1 << bit).unwrap_or(*self);
                }
            }
        )*};
    }
    codes!(Term, Learning);

    upsets!([const N: usize] Adapter<N> {
        terms, limits, first, per_noise, noise_counts, forget, gate, per_window, settle, half_limit, torque_limit, sum,
    owner,
    });
    upsets!([const N: usize] AdaptState<N> {
        x, d, u, learning, counters, generator, contact, touched, side, run, consistency,
    });
    upsets!(AdaptCounters {
        used,
        quiet,
        outliers,
        outliers_in_a_row,
        unsettled,
        unexcited,
        untrusted,
        limited,
        restarts,
    });
}
