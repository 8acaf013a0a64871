//! CRC-32 (ISO-HDLC, that of zlib): of images and their pages, of records, of what is saved across a reset.

/// Its table for bytes is in flash.
static CRC: crc::Crc<u32, crc::Table<1>> = crc::Crc::<u32, crc::Table<1>>::new(&crc::CRC_32_ISO_HDLC);

/// CRC-32 (ISO-HDLC), 5.3 instructions a byte on a Cortex-M4.
pub(crate) fn crc32(bytes: &[u8]) -> u32 {
    !crc_bytes(CRC_START, bytes)
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
