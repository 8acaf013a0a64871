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

macro_rules! kinds {
    ($([$($generic:ident)*] $kind:ty: $bits:expr, |$value:ident, $bit:pat_param| $flip:expr;)*) => {$(
        impl<$($generic)*> Upset for $kind {
            fn bits(&self) -> usize {
                $bits
            }

            fn flip(&mut self, $bit: usize, _: &mut String) {
                let $value = self;
                $flip
            }
        }
    )*};
}
kinds! {
    [] u8: 8, |number, bit| *number ^= 1 << bit;
    [] u16: 16, |number, bit| *number ^= 1 << bit;
    [] u32: 32, |number, bit| *number ^= 1 << bit;
    [] u64: 64, |number, bit| *number ^= 1 << bit;
    [] usize: usize::BITS as usize, |number, bit| *number ^= 1 << bit;
    [] i32: 32, |number, bit| *number ^= 1 << bit;
    [] i64: 64, |number, bit| *number ^= 1 << bit;
    [] f32: 32, |number, bit| *number = f32::from_bits(number.to_bits() ^ 1 << bit);
    [] bool: 1, |flag, _| *flag = !*flag;
    [] GeneratorAngle: 64, |angle, bit| *angle = GeneratorAngle::from_counts(angle.counts() ^ 1 << bit);
    [] OutputAngle: 64, |angle, bit| *angle = OutputAngle::from_counts(angle.counts() ^ 1 << bit);
    [] crate::TableId: 64, |id, bit| id.0[bit / 8] ^= 1 << (bit % 8);
    [T] core::marker::PhantomData<T>: 0, |_none, _| ();
    // Reported only.
    [] crate::GeneratorKind: 0, |_kind, _| ();
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
