//! CRC-32 (ISO-HDLC, that of zlib): of images and their pages, of records, of what is saved across a reset.

/// Its table for bytes is in flash.
static CRC: crc::Crc<u32, crc::Table<1>> = crc::Crc::<u32, crc::Table<1>>::new(&crc::CRC_32_ISO_HDLC);

/// CRC-32 (ISO-HDLC), 5.3 instructions a byte on a Cortex-M4.
pub fn crc32(bytes: &[u8]) -> u32 {
    !crc_bytes(CRC_START, bytes)
}

/// Writes words, lowest byte first, and behind them the CRC-32 of all before; nothing where there is no room for that.
pub fn seal(bytes: &mut [u8], words: impl IntoIterator<Item = u32>) {
    let Some((contents, crc)) = bytes.split_last_chunk_mut::<4>() else { return };
    for (to, from) in contents.as_chunks_mut::<4>().0.iter_mut().zip(words) {
        *to = from.to_le_bytes();
    }
    *crc = crc32(contents).to_le_bytes();
}

/// The words that [`seal`] wrote, one with each call, then zeros; `None` if the CRC-32 is another.
pub(crate) fn unseal(bytes: &[u8]) -> Option<impl FnMut() -> u32> {
    let (contents, crc) = bytes.split_last_chunk::<4>()?;
    let mut words = contents.as_chunks::<4>().0.iter();
    let whole = u32::from_le_bytes(*crc) == crc32(contents);
    whole.then_some(move || words.next().map_or(0, |word| u32::from_le_bytes(*word)))
}

/// Before the first byte of a CRC-32.
pub(crate) const CRC_START: u32 = 0xffff_ffff;

/// CRC-32 over some more bytes; before the last inversion.
#[inline(never)]
pub(crate) fn crc_bytes(crc: u32, bytes: &[u8]) -> u32 {
    let mut digest = CRC.digest_with_initial(crc.reverse_bits());
    digest.update(bytes);
    !digest.finalize()
}

/// CRC-32 over one more word, lowest byte first; before the last inversion.
#[inline(always)]
pub(crate) fn crc_word(crc: u32, word: u32) -> u32 {
    let mut digest = CRC.digest_with_initial(crc.reverse_bits());
    digest.update(&word.to_le_bytes());
    !digest.finalize()
}
