//! The checksums of an image: one of each page, one of all.

use super::layout::{CRC_BYTES, DERIVED_WORDS, ID_OFFSET, PAGE_BYTES};
use crate::crc::crc32;
use crate::error::ImageError;
use crate::table::Table;

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

/// Stores what follows from the bounds of the numbers.
pub(super) fn derive(image: &mut [u8], body_bytes: usize) -> Result<(), ImageError> {
    seal(image, body_bytes);
    let derived = Table::found(image)?.derived();
    for (word, value) in DERIVED_WORDS.into_iter().zip(derived) {
        let place = image.as_chunks_mut::<4>().0.get_mut(word);
        place.into_iter().for_each(|bytes| *bytes = value.to_le_bytes());
    }
    Ok(())
}

/// Completes an image whose body is written: what follows from its numbers, the id, which is found from the body with
/// the id zero, and every checksum.
///
/// # Errors
/// [`ImageError`] of the first number that no table has.
pub fn complete(image: &mut [u8], body_bytes: usize, id: impl FnOnce(&[u8]) -> [u8; 8]) -> Result<(), ImageError> {
    derive(image, body_bytes)?;
    let id = id(image.get(..body_bytes).unwrap_or_default());
    if let Some(place) = image.get_mut(ID_OFFSET..).and_then(|rest| rest.first_chunk_mut::<8>()) {
        *place = id;
    }
    seal(image, body_bytes);
    Ok(())
}

/// Makes every checksum of an image right that states its body, whatever is in it.
#[cfg(any(test, feature = "testing"))]
pub fn reseal(image: &mut [u8]) {
    let body_bytes = crate::table::word_at(image.as_chunks::<4>().0, super::word::BODY) as usize;
    let body_bytes = body_bytes.saturating_mul(4);
    if body_bytes < image.len() {
        let _ = derive(image, body_bytes);
        seal(image, body_bytes);
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
