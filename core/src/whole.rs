//! A sum of 64 bits over words that must not change unnoticed: of what a tick reads and keeps.
//!
//! Word after word `s ← (s mod 2³²)·f + ⌊s/2³²⌋ + word`, at the end once more without a word: a step of a generator
//! that multiplies with carry, one instruction of a Cortex-M4 (`umaal`) beside the one that fetches the word. Modulo
//! the prime `p = 2³²·f − 1` that is `s ← s·2⁻³² + word`: a difference in a word is multiplied with every step, by
//! another factor for each place, so two differences cancel only if their ratio modulo p, near 2⁶⁴, is a power of 2³²
//! that fits the distance of their words. No two bits of 24 words and their sum do, nor a column of neighbours (tests
//! below). Words that are all zeros, or all ones, do not pass where the sum begins with
//! [`SUMS_START`]. A cyclic check of the same words would take six times the instructions.
//!
//! The sum is a call of its own for each structure: inlined, the compiler moves the words to the stack and
//! back.
//!
//! # One sum, and what it mends
//! [`Sealed`] keeps a value with its sum: settings and states of all that feeds a tick. Because the sum is linear
//! modulo p, the difference between the sum that is kept and the sum that is found, multiplied by 2³² once for each
//! word behind a place, is what that word has to change by. If that is a change of neighbouring bits of one word
//! ([`BURST_BITS`]), the word is mended and the sum taken again; it must then be equal. So a value with one sum
//! survives what a value with two copies survives, as long as one word was hit, for 8 bytes instead of its own size.
//! Anything else is reported and not used.

use crate::angle::{GeneratorAngle, OutputAngle};

/// The sums of words: so that a constant can be made of them, and nothing is a loop.
macro_rules! sums {
    ($start:expr; $($word:expr),* $(,)?) => {{
        let [mut low, mut high]: [u32; 2] = $start;
        $(
            let word: u32 = $word;
            // Fits: (2³² − 1)² + 2·(2³² − 1) = 2⁶⁴ − 1. One instruction, umaal.
            let product = (low as u64).wrapping_mul($crate::whole::FACTOR as u64);
            let next = product.wrapping_add(high as u64).wrapping_add(word as u64);
            (low, high) = (next as u32, (next >> 32) as u32);
        )*
        // The last word too goes through all columns.
        (low as u64).wrapping_mul($crate::whole::FACTOR as u64).wrapping_add(high as u64)
    }};
}
pub(crate) use sums;

/// 2³² times this, less one, is a prime.
pub(crate) const FACTOR: u32 = 4_294_957_665;

/// Before the first word.
pub(crate) const SUMS_START: [u32; 2] = [0x5a69_96a5, 0x1b87_3593];

/// The low and the high word.
#[inline(always)]
pub(crate) const fn low(value: i64) -> u32 {
    value as u32
}

/// See [`low`].
#[inline(always)]
pub(crate) const fn high(value: i64) -> u32 {
    (value >> 32) as u32
}

/// Sums as they are kept.
#[inline(always)]
pub(crate) const fn pair(sums: u64) -> [u32; 2] {
    [sums as u32, (sums >> 32) as u32]
}

/// Whether two pairs of sums are the same.
#[inline(always)]
pub(crate) const fn same([a, b]: [u32; 2], [c, d]: [u32; 2]) -> bool {
    ((a ^ c) | (b ^ d)) == 0
}

/// The sum before the first word.
pub const START: u64 = SUMS_START[0] as u64 | (SUMS_START[1] as u64) << 32;

/// A sum with one more word.
#[inline(always)]
pub const fn add(sum: u64, word: u32) -> u64 {
    // Fits: (2³² − 1)² + 2·(2³² − 1) = 2⁶⁴ − 1.
    (sum as u32 as u64).wrapping_mul(FACTOR as u64).wrapping_add(sum >> 32).wrapping_add(word as u64)
}

/// The sum of a few words, as a constant.
pub const fn sum_of(mut words: &[u32]) -> u64 {
    let mut sum = START;
    while let [word, rest @ ..] = words {
        sum = add(sum, *word);
        words = rest;
    }
    add(sum, 0)
}

/// Something that is kept as words under one sum.
pub trait Words: Copy {
    /// Goes on with a sum over its words, in order.
    fn sum(&self, sum: u64) -> u64;
    /// Shows every word in the same order, and takes what is to stand in its place.
    fn each(&mut self, see: &mut dyn FnMut(u32) -> u32);
}

macro_rules! words_of {
    ($($number:ty: $to:expr, $back:expr;)*) => {$(
        impl Words for $number {
            #[inline(always)]
            fn sum(&self, sum: u64) -> u64 {
                add(sum, $to(*self))
            }

            fn each(&mut self, see: &mut dyn FnMut(u32) -> u32) {
                *self = $back(see($to(*self)));
            }
        }
    )*};
}
words_of! {
    u32: |word: u32| word, |word: u32| word;
    i32: |number: i32| number as u32, |word: u32| word as i32;
    f32: f32::to_bits, f32::from_bits;
}

impl Words for i64 {
    #[inline(always)]
    fn sum(&self, sum: u64) -> u64 {
        add(add(sum, low(*self)), high(*self))
    }

    fn each(&mut self, see: &mut dyn FnMut(u32) -> u32) {
        let (low, high) = (see(low(*self)), see(high(*self)));
        *self = (high as i64) << 32 | low as i64;
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

impl<T: Words, const N: usize> Words for [T; N] {
    #[inline(always)]
    fn sum(&self, sum: u64) -> u64 {
        self.iter().fold(sum, |sum, part| part.sum(sum))
    }

    fn each(&mut self, see: &mut dyn FnMut(u32) -> u32) {
        self.iter_mut().for_each(|part| part.each(see));
    }
}

/// The words of a structure: those of its fields, in this order. Takes it apart without `..`, so that no field is left
/// out.
#[doc(hidden)]
#[macro_export]
macro_rules! words {
    ([$($generic:tt)*] $type:ty { $($field:ident),* $(,)? }) => {
        impl<$($generic)*> $crate::shared::Words for $type {
            #[inline(always)]
            fn sum(&self, sum: u64) -> u64 {
                let Self { $($field),* } = self;
                $(let sum = $crate::shared::Words::sum($field, sum);)*
                sum
            }

            fn each(&mut self, see: &mut dyn FnMut(u32) -> u32) {
                let Self { $($field),* } = self;
                $($crate::shared::Words::each($field, see);)*
            }
        }
    };
}
pub use words;

/// Most neighbouring bits of a word, or of the sum, of which a change is mended: cells that one particle flips lie next
/// to each other. The bound is a guess. Each bit more doubles the number of changes that may be mistaken for one: 2¹³
/// of 2⁶⁴ for every word.
const BURST_BITS: u32 = 8;

/// Whether these are neighbouring bits, as many as are mended.
const fn is_burst(changed: u64) -> bool {
    changed.wrapping_shr(changed.trailing_zeros()) >> BURST_BITS == 0
}

/// The factor in as many bits as the sum has.
const WIDE_FACTOR: u64 = FACTOR as u64;

/// `2³²·f − 1`, a prime.
const PRIME: u64 = (WIDE_FACTOR << 32).wrapping_sub(1);

/// `s·2⁻³²` modulo the prime.
const fn shorter(s: u64) -> u64 {
    reduced(add(s, 0))
}

/// `s·2³²` modulo the prime: a step back.
const fn longer(s: u64) -> u64 {
    // Division by f = 2³² − d without a call of 900 bytes: h·2³² + l = h·f + (h·d + l), and once more for the sum in
    // brackets, which leaves a rest below 2f.
    const SHORT: u64 = (1u64 << 32).wrapping_sub(WIDE_FACTOR);
    let rest = (s >> 32).wrapping_mul(SHORT).wrapping_add(s as u32 as u64);
    let quotient = (s >> 32).wrapping_add(rest >> 32);
    let rest = (rest >> 32).wrapping_mul(SHORT).wrapping_add(rest as u32 as u64);
    let over = (rest >= WIDE_FACTOR) as u64;
    quotient.wrapping_add(over) | rest.wrapping_sub(over.wrapping_mul(WIDE_FACTOR)) << 32
}

const fn reduced(s: u64) -> u64 {
    if s >= PRIME { s.wrapping_sub(PRIME) } else { s }
}

/// A value under a sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sealed<T> {
    kept: T,
    sums: [u32; 2],
}

impl<T> Sealed<T> {
    /// A value with its sum, for constants: that of all its words.
    pub const fn of(kept: T, sum: u64) -> Self {
        Self { kept, sums: pair(sum) }
    }

    /// The kept value, checked or not.
    pub const fn kept(&self) -> &T {
        &self.kept
    }
}

impl<T: Words> Sealed<T> {
    /// A value with its sum.
    #[inline(always)]
    pub fn new(kept: T) -> Self {
        Self { sums: pair(Self::found(&kept)), kept }
    }

    #[inline(never)]
    fn found(kept: &T) -> u64 {
        add(kept.sum(START), 0)
    }

    /// Whether nothing changed since it was kept.
    #[inline(always)]
    pub fn is_whole(&self) -> bool {
        same(pair(Self::found(&self.kept)), self.sums)
    }

    /// The kept value, mended if it has to be; `None` if it is lost.
    #[inline(always)]
    pub fn open(&self) -> Option<T> {
        self.with(|kept| *kept)
    }

    /// Looks at what is kept, mended if it has to be; `None` if it is lost.
    #[inline(always)]
    pub fn with<R>(&self, look: impl FnOnce(&T) -> R) -> Option<R> {
        let mended;
        let kept = if self.is_whole() {
            &self.kept
        } else {
            mended = self.mended()?;
            &mended
        };
        Some(look(kept))
    }

    /// Changes what is kept, where it lies, mended if it has to be; `None`, and nothing is changed, if it is lost.
    #[inline(always)]
    pub fn change<R>(&mut self, change: impl FnOnce(&mut T) -> R) -> Option<R> {
        if !self.is_whole() {
            self.kept = self.mended()?;
        }
        let result = change(&mut self.kept);
        self.sums = pair(Self::found(&self.kept));
        Some(result)
    }

    /// Keeps another value.
    #[inline(always)]
    pub fn close(&mut self, kept: T) {
        *self = Self::new(kept);
    }

    /// Makes it whole; false if it is lost.
    pub fn mend(&mut self) -> bool {
        let found = self.open();
        if let Some(kept) = found {
            self.close(kept);
        }
        found.is_some()
    }

    /// The value before neighbouring bits of one of its words, or of its sum, changed.
    #[cold]
    #[inline(never)]
    fn mended(&self) -> Option<T> {
        let mut kept = self.kept;
        let [low, high] = self.sums;
        let mut mending = Mending::new(low as u64 | (high as u64) << 32, Self::found(&kept));
        kept.each(&mut |word| mending.back(word));
        kept.each(&mut |word| mending.on(word));
        mending.is_done().then_some(kept)
    }
}

/// Restores the word of which neighbouring bits changed: word after word, first back, then on. Calls of all types, as
/// they divide and are rarely made.
struct Mending {
    wanted: u64,
    /// What a word at this place has to change by.
    missing: u64,
    sum: u64,
}

impl Mending {
    /// From the sum that is wanted and the one that was found. Where neighbouring bits of the sum itself changed, no
    /// word is missed.
    #[inline(never)]
    fn new(wanted: u64, found: u64) -> Self {
        let (one, other) = (reduced(wanted), reduced(found));
        let missing = if one >= other { one.wrapping_sub(other) } else { PRIME.wrapping_sub(other.wrapping_sub(one)) };
        if is_burst(wanted ^ found) {
            return Self { wanted: found, missing: 0, sum: START };
        }
        Self { wanted, missing, sum: START }
    }

    /// A word that is stepped back over: what is missing went through a step for each word, and the last.
    #[inline(never)]
    fn back(&mut self, word: u32) -> u32 {
        self.missing = longer(self.missing);
        word
    }

    /// A word, restored if it is the one.
    #[inline(never)]
    fn on(&mut self, word: u32) -> u32 {
        let word = restored(word, self.missing);
        self.missing = shorter(self.missing);
        self.sum = add(self.sum, word);
        word
    }

    /// Whether all words together have the sum.
    fn is_done(&self) -> bool {
        add(self.sum, 0) == self.wanted
    }
}

/// A word changed by what the sum misses, if that is a change of neighbouring bits; else as it is.
#[inline(never)]
fn restored(word: u32, missing: u64) -> u32 {
    let less = PRIME.wrapping_sub(missing);
    let better = if missing >> 32 == 0 { word.checked_add(missing as u32) } else { None };
    let better = if less >> 32 == 0 { word.checked_sub(less as u32) } else { better };
    better.filter(|better| is_burst((better ^ word) as u64)).unwrap_or(word)
}

#[cfg(any(test, feature = "testing"))]
#[allow(clippy::arithmetic_side_effects)] // A shift by less than 32.
impl<T: Words> crate::upset::Upset for Sealed<T> {
    fn bits(&self) -> usize {
        let (mut kept, mut words) = (self.kept, 0usize);
        kept.each(&mut |word| {
            words = words.wrapping_add(1);
            word
        });
        words.wrapping_mul(32).wrapping_add(self.sums.bits())
    }

    fn flip(&mut self, mut bit: usize, path: &mut std::string::String) {
        self.kept.each(&mut |word| {
            let flipped = if bit < 32 { word ^ 1 << bit } else { word };
            bit = bit.wrapping_sub(32);
            flipped
        });
        // Beyond the words it is one of the sum; within them it is below 0 now.
        if bit < 64 {
            self.sums.flip(bit, path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(words: &[u32; 24]) -> [u32; 2] {
        let [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u, v, w, x] = *words;
        pair(sums!(SUMS_START; a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u, v, w, x))
    }

    /// Every pair of bits of 24 words and their sums, with words of all zeros, all ones and mixed: 1.1 million pairs.
    #[test]
    fn no_two_bits_cancel() {
        let mixed = core::array::from_fn(|i| (i as u32).wrapping_mul(0x9e37_79b9) ^ 0x1234_5678);
        for words in [[0; 24], [u32::MAX; 24], mixed] {
            let sums = of(&words);
            for one in 0..26 * 32 {
                for other in 0..=one {
                    let (mut hit, mut kept) = (words, sums);
                    for bit in [one, other] {
                        match bit / 32 {
                            word @ 0..24 => hit[word] ^= 1 << (bit % 32),
                            sum => kept[sum - 24] ^= 1 << (bit % 32),
                        }
                    }
                    assert_eq!(same(of(&hit), kept), one == other, "{one} {other}");
                }
            }
        }
    }

    /// The same bit of any words in a row and of both sums.
    #[test]
    fn no_column_cancels() {
        let words: [u32; 24] = core::array::from_fn(|i| (i as u32).wrapping_mul(0x9e37_79b9) ^ 0x1234_5678);
        for bit in 0..32 {
            for first in 0..24 {
                for last in first..24 {
                    let (mut hit, mut sums) = (words, of(&words));
                    hit[first..=last].iter_mut().for_each(|word| *word ^= 1 << bit);
                    assert!(!same(of(&hit), sums), "{bit} {first} {last}");
                    sums = sums.map(|sum| sum ^ 1 << bit);
                    assert!(!same(of(&hit), sums), "{bit} {first} {last} and the sums");
                }
            }
        }
    }

    fn mixed() -> [u32; 24] {
        core::array::from_fn(|i| (i as u32).wrapping_mul(0x9e37_79b9) ^ 0x1234_5678)
    }

    #[test]
    fn one_sum_is_the_same_however_it_is_taken() {
        let words = mixed();
        assert_eq!(pair(sum_of(&words)), of(&words));
        assert_eq!(Sealed::new(words), Sealed::of(words, sum_of(&words)));
        assert_eq!(Sealed::<[u32; 0]>::new([]), Sealed::of([], sum_of(&[])));
        let ends = [0, 1, WIDE_FACTOR - 1, WIDE_FACTOR, 0xffff_ffff, 1 << 32, PRIME - 1, 0x1234_5678_9abc_def0];
        let spread = (0..10_000u64).map(|i| reduced(i.wrapping_mul(0x9e37_79b9_7f4a_7c15)));
        for s in ends.into_iter().chain(spread) {
            assert_eq!((shorter(longer(s)), longer(shorter(s))), (s, s));
            assert_eq!(longer(s), (s / WIDE_FACTOR) | (s % WIDE_FACTOR) << 32);
        }
    }

    /// Every change of neighbouring bits, of every word and of the sum, with words of all zeros, all ones and mixed.
    #[test]
    fn what_hit_one_word_is_mended() {
        for words in [[0; 24], [u32::MAX; 24], mixed()] {
            let sealed = Sealed::new(words);
            assert!(sealed.is_whole() && sealed.open() == Some(words));
            for bit in 0..26 * 32 {
                // One bit, and all changes of up to eight that begin with it and stay in its word.
                for more in (1..1u32 << BURST_BITS).step_by(2).filter(|more| more.leading_zeros() >= bit as u32 % 32) {
                    let mut hit = sealed;
                    let by = more << (bit % 32);
                    match bit / 32 {
                        word @ 0..24 => hit.kept[word] ^= by,
                        sum => hit.sums[sum - 24] ^= by,
                    }
                    assert!(!hit.is_whole() && hit.open() == Some(words), "{bit} {more:b}");
                    assert!(hit.mend() && hit == sealed);
                }
            }
        }
    }

    /// Two words, each bit of one with each bit of the other; and a word hit beyond what is mended.
    #[test]
    fn what_hit_two_words_is_lost() {
        let sealed = Sealed::new(mixed());
        for one in 0..26 * 32 {
            for other in 0..one / 32 * 32 {
                let mut hit = sealed;
                for bit in [one, other] {
                    match bit / 32 {
                        word @ 0..24 => hit.kept[word] ^= 1 << (bit % 32),
                        sum => hit.sums[sum - 24] ^= 1 << (bit % 32),
                    }
                }
                // Neighbours on either side of the border of the two words of the sum are one change.
                let neighbours = one / 32 == 25 && other / 32 == 24 && one - other < BURST_BITS as usize;
                assert_eq!(hit.open().is_some(), neighbours, "{one} {other}");
            }
        }
        let mut hit = sealed;
        hit.kept[5] ^= 0x101;
        assert_eq!((hit.open(), hit.mend()), (None, false));
    }

    #[test]
    fn wiped_memory_does_not_pass() {
        for value in [0, u32::MAX] {
            assert!(!same(of(&[value; 24]), [value; 2]));
        }
    }
}
