//! The copies in memory of what a step reads.

use crate::table::{Doubt, words_from};

/// Most eight-byte words of a [`Store`](crate::Store): what `FLEXSPLINE_STORE_WORDS` says where the crate is
/// compiled, or the bound of any table: 1024 words of each copy.
pub const STORE_ROOM: usize = match option_env!("FLEXSPLINE_STORE_WORDS") {
    Some(text) => match usize::from_str_radix(text, 10) {
        Ok(words @ 49..=1072) => words,
        _ => panic!("FLEXSPLINE_STORE_WORDS is a number from 49 to 1072"),
    },
    None => 1072,
};
/// Those that hold no word of a table: 40 for what is known of it and the mark of C, and [`SLACK`], by definition.
pub const BESIDE: usize = 40 + SLACK;
/// Largest copy that fits into a store, words: 72 for the axes, curves, and for each torque node 3 and its ripple.
pub const STORE_WORDS: usize = STORE_ROOM - BESIDE;
/// Places of an accepted table are below; in a store for any table this shows that bound to the compiler.
const MASK: usize = STORE_WORDS.next_power_of_two() - 1;
/// Words that a read may take from the last place on.
pub(super) const SLACK: usize = 8;

/// One copy: words, lowest byte first.
#[repr(align(8))]
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Copied(pub [[u8; 4]; STORE_WORDS + SLACK]);

impl Copied {
    pub const EMPTY: Self = Self([[0; 4]; STORE_WORDS + SLACK]);

    #[inline(always)]
    pub fn words<const N: usize>(&self, at: usize) -> [u32; N] {
        let words = self.0.get(at & MASK..).and_then(|words| words.first_chunk::<N>());
        words.map_or([0; N], |words| words.map(u32::from_le_bytes))
    }

    #[inline(always)]
    pub fn halves<const N: usize>(&self, at: usize) -> [u32; N] {
        words_from(self.0.as_flattened(), (at & (2 * MASK + 1)).wrapping_mul(2))
    }

    /// Writes a word, if there is a place for it.
    #[inline(always)]
    pub fn set(&mut self, at: usize, value: u32) {
        if let Some(word) = self.0.get_mut(at) {
            *word = value.to_le_bytes();
        }
    }
}

/// Adds to the doubt what two copies disagree in; the first.
#[inline(always)]
pub(super) fn agreed<const N: usize>(first: [u32; N], second: [u32; N], doubt: &mut Doubt) -> [u32; N] {
    for (a, b) in first.into_iter().zip(second) {
        doubt.0 |= a ^ b;
    }
    first
}

#[cfg(any(test, feature = "testing"))]
#[allow(clippy::arithmetic_side_effects, clippy::indexing_slicing)] // Of a bit of the copy.
impl crate::upset::Upset for Copied {
    fn bits(&self) -> usize {
        32 * self.0.len()
    }

    fn flip(&mut self, bit: usize, _: &mut std::string::String) {
        self.0[bit / 32][bit / 8 % 4] ^= 1 << (bit % 8);
    }
}
