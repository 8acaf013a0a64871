//! Little-endian words of an image, read where they lie.

/// Little-endian words of an image, read where they lie.
pub(crate) type Words<'a> = &'a [[u8; 4]];

/// Word `index` as a number; 0 beyond the end, which an accepted table never reaches.
pub(crate) fn f32_at(words: Words<'_>, index: usize) -> f32 {
    f32::from_bits(word_at(words, index))
}

/// Word `index`; 0 beyond the end.
pub(crate) fn word_at(words: Words<'_>, index: usize) -> u32 {
    words.get(index).map_or(0, |word| u32::from_le_bytes(*word))
}

/// `N` words from this byte on.
#[inline(always)]
pub(crate) fn words_from<const N: usize>(bytes: &[u8], at: usize) -> [u32; N] {
    let found = bytes.get(at..).and_then(|bytes| bytes.as_chunks::<4>().0.first_chunk::<N>());
    found.map_or([0; N], |words| words.map(u32::from_le_bytes))
}

/// The high and the low half of a word.
#[inline(always)]
pub(crate) const fn halves(word: u32) -> [usize; 2] {
    [(word >> 16) as usize, (word & 0xffff) as usize]
}
