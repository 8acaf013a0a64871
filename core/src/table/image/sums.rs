//! The checksums of an image: one of each page, one of all.

use super::layout::{CRC_BYTES, PAGE_BYTES};
use crate::crc::crc32;

/// Computes and stores every checksum of an image whose body is complete.
pub(super) fn seal(image: &mut [u8], body_bytes: usize) {
    let Some((body, sums)) = image.split_at_mut_checked(body_bytes) else {
        return;
    };
    let (sums, _) = sums.as_chunks_mut::<CRC_BYTES>();
    for (sum, page) in sums.iter_mut().zip(body.chunks(PAGE_BYTES)) {
        *sum = crc32(page).to_le_bytes();
    }
    if let Some((before, last)) = image.split_last_chunk_mut::<CRC_BYTES>() {
        *last = crc32(before).to_le_bytes();
    }
}

pub(super) fn page_of(image: &[u8], body_bytes: usize, page: usize) -> Option<&[u8]> {
    image.get(..body_bytes)?.chunks(PAGE_BYTES).nth(page)
}

/// The checksum that is stated for a page.
pub(super) fn page_sum(image: &[u8], body_bytes: usize, page: usize) -> Option<u32> {
    let sums = image.get(body_bytes..)?.as_chunks::<CRC_BYTES>().0;
    sums.get(page).copied().map(u32::from_le_bytes)
}

pub(crate) fn page_intact(image: &[u8], body_bytes: usize, page: usize) -> bool {
    match (page_of(image, body_bytes, page), page_sum(image, body_bytes, page)) {
        (Some(bytes), Some(sum)) => crc32(bytes) == sum,
        _ => false,
    }
}
