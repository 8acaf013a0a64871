//! A sum of 64 bits over words that must not change unnoticed: of what a tick reads and keeps.
//!
//! Word after word `s ← (s mod 2³²)·f + ⌊s/2³²⌋ + word`, at the end once more without a word: a step of a generator that multiplies with carry, one
//! instruction of a Cortex-M4 (`umaal`) beside the one that fetches the word. Modulo the prime `p = 2³²·f − 1` that is `s ← s·2⁻³² + word`: a
//! difference in a word is multiplied with every step, by another factor for each place, so two differences cancel only if
//! their ratio modulo p, near 2⁶⁴, is a power of 2³² that fits the distance of their words. No two bits of 24 words and their sum
//! do, nor a column of neighbours (tests below). Words that are all zeros, or all ones, do not pass where the sum begins with
//! [`SUMS_START`]. A cyclic check of the same words would take six times the instructions.
//!
//! What is summed up is a call of its own for each structure: inlined, the compiler moves the words to the stack and back.

/// The sums of words: so that a constant can be made of them, and nothing is a loop.
macro_rules! sums {
    ($start:expr; $($word:expr),* $(,)?) => {{
        let [mut low, mut high]: [u32; 2] = $start;
        $(
            let word: u32 = $word;
            // Fits: (2³² − 1)² + 2·(2³² − 1) = 2⁶⁴ − 1. One instruction, umaal.
            let next = (low as u64).wrapping_mul($crate::whole::FACTOR as u64).wrapping_add(high as u64).wrapping_add(word as u64);
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

    #[test]
    fn wiped_memory_does_not_pass() {
        for value in [0, u32::MAX] {
            assert!(!same(of(&[value; 24]), [value; 2]));
        }
    }
}
