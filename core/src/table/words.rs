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

/// A number between two temperatures, `warm` from the colder to the hotter; its last bit is that of the colder: in H a
/// mark, in the others too small to matter.
#[inline(always)]
pub(crate) fn blend_number(cold: u32, hot: u32, warm: f32) -> u32 {
    let (below, above) = (f32::from_bits(cold), f32::from_bits(hot));
    (below + warm * (above - below)).to_bits() & !1 | cold & 1
}

/// The same of both halves of a word, each rounded; `hotter` in 2⁻¹⁴.
#[inline(always)]
pub(crate) fn blend_halves(cold: u32, hot: u32, hotter: i32) -> u32 {
    let blend = |cold: i32, hot: i32| {
        cold.wrapping_add(hot.wrapping_sub(cold).wrapping_mul(hotter).wrapping_add(8192) >> 14) as u32
    };
    let low = blend(cold as i16 as i32, hot as i16 as i32) & 0xffff;
    blend(cold as i32 >> 16, hot as i32 >> 16) << 16 | low
}

/// The high and the low half of a word.
#[inline(always)]
pub(crate) const fn halves(word: u32) -> [usize; 2] {
    [(word >> 16) as usize, (word & 0xffff) as usize]
}
