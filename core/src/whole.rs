//! Two sums over words that must not change unnoticed: of what a tick reads and keeps.
//!
//! The first takes the words one after another by exclusive or, turned by five bits from word to word; the second takes the first in the
//! same way, turned by six. Whatever happens to one word changes both. Two bits cancel in the first only if their columns differ by
//! five for each word from one to the other; the second then still has what the first had in between, a bit in a column of its own for each of
//! these words, up to 32 of them: no structure has so many. An odd number of bits never cancels. Words
//! that are all zeros, or all ones, do not pass where the sums begin with [`SUMS_START`]. A cyclic check of the same words would take
//! four times the instructions. As the second takes the first, each word is needed once: two sums beside each other are made one after
//! the other by the compiler, with the words on the stack meanwhile.
//!
//! What is summed up is a call of its own for each structure: inlined, the compiler moves the words to the stack and back.

/// The sums of words: so that a constant can be made of them, and nothing is a loop.
macro_rules! sums {
    ($start:expr; $($word:expr),* $(,)?) => {{
        let [mut fives, mut sixes]: [u32; 2] = $start;
        $(
            let word: u32 = $word;
            fives = fives.rotate_left(5) ^ word;
            sixes = sixes.rotate_left(6) ^ fives;
        )*
        // Not in the columns of the last word. As one number: two are given back in memory.
        (sixes.rotate_left(13) as u64) << 32 | fives as u64
    }};
}
pub(crate) use sums;

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
