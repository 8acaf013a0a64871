//! Single bits of everything that lives from tick to tick, by the name of the field they are in: for campaigns of
//! upsets.
//!
//! [`upsets!`] takes a structure apart without `..`, so a new field that is not listed does not compile.

#![allow(clippy::arithmetic_side_effects, clippy::indexing_slicing)] // Tests.

use crate::angle::{GeneratorAngle, OutputAngle};
use std::string::String;

/// Something whose bits can flip.
pub trait Upset {
    /// How many bits it has.
    fn bits(&self) -> usize;
    /// Flips one of them; adds the names on the way to it to the path.
    fn flip(&mut self, bit: usize, path: &mut String);
}

macro_rules! numbers {
    ($($number:ty),*) => {$(
        impl Upset for $number {
            fn bits(&self) -> usize {
                <$number>::BITS as usize
            }

            fn flip(&mut self, bit: usize, _: &mut String) {
                *self ^= 1 << bit;
            }
        }
    )*};
}
numbers!(u8, u16, u32, u64, usize, i32, i64);

impl Upset for bool {
    fn bits(&self) -> usize {
        1
    }

    fn flip(&mut self, _: usize, _: &mut String) {
        *self = !*self;
    }
}

/// The mark that there is something, then all of it: zeros if there was nothing.
impl<T: Upset + Default> Upset for Option<T> {
    fn bits(&self) -> usize {
        1 + self.as_ref().map_or(0, Upset::bits)
    }

    fn flip(&mut self, bit: usize, path: &mut String) {
        *self = match self.take() {
            None => Some(T::default()),
            Some(_) if bit == 0 => None,
            Some(mut kept) => {
                kept.flip(bit - 1, path);
                Some(kept)
            }
        };
    }
}

impl Upset for f32 {
    fn bits(&self) -> usize {
        32
    }

    fn flip(&mut self, bit: usize, _: &mut String) {
        *self = f32::from_bits(self.to_bits() ^ 1 << bit);
    }
}

macro_rules! angles {
    ($($angle:ty),*) => {$(
        impl Upset for $angle {
            fn bits(&self) -> usize {
                64
            }

            fn flip(&mut self, bit: usize, _: &mut String) {
                *self = Self::from_counts(self.counts() ^ 1 << bit);
            }
        }
    )*};
}
angles!(GeneratorAngle, OutputAngle);

impl Upset for crate::TableId {
    fn bits(&self) -> usize {
        64
    }

    fn flip(&mut self, bit: usize, _: &mut String) {
        self.0[bit / 8] ^= 1 << (bit % 8);
    }
}

impl<T> Upset for core::marker::PhantomData<T> {
    fn bits(&self) -> usize {
        0
    }

    fn flip(&mut self, _: usize, _: &mut String) {}
}

/// Reported only.
impl Upset for crate::GeneratorKind {
    fn bits(&self) -> usize {
        0
    }

    fn flip(&mut self, _: usize, _: &mut String) {}
}

impl<T: Upset, const N: usize> Upset for [T; N] {
    fn bits(&self) -> usize {
        self.iter().map(Upset::bits).sum()
    }

    fn flip(&mut self, mut bit: usize, path: &mut String) {
        for part in self {
            if bit < part.bits() {
                return part.flip(bit, path);
            }
            bit -= part.bits();
        }
    }
}

#[doc(hidden)]
#[macro_export]
macro_rules! upsets {
    ([$($generic:tt)*] $type:ty { $($field:ident),* $(,)? }) => {
        #[allow(clippy::arithmetic_side_effects)] // Of bits below those of the whole.
        impl<$($generic)*> $crate::testing::Upset for $type {
            fn bits(&self) -> usize {
                let Self { $($field),* } = self;
                [$($crate::testing::Upset::bits($field)),*].into_iter().sum()
            }

            fn flip(&mut self, mut bit: usize, path: &mut $crate::testing::String) {
                let Self { $($field),* } = self;
                $(
                    if bit < $crate::testing::Upset::bits($field) {
                        path.push('.');
                        path.push_str(stringify!($field));
                        return $crate::testing::Upset::flip($field, bit, path);
                    }
                    bit -= $crate::testing::Upset::bits($field);
                )*
                let _ = bit;
            }
        }
    };
    ($type:ty { $($field:ident),* $(,)? }) => {
        $crate::upsets!([] $type { $($field),* });
    };
}
pub use upsets;
