//! Two images of one table, and how a page of one is written again from the other.

use crate::crc::crc32;
use crate::table::{PAGE_BYTES, Words, page_intact, word, word_at};

/// Two images of one table, read where they lie. Made anew for every call: it holds nothing but where they are.
#[derive(Clone, Copy, Debug)]
pub struct Images<'a> {
    pub(super) words: [Words<'a>; 2],
}

impl<'a> Images<'a> {
    /// Two images, at two places: the same one twice is not activated, and a tick that is given it does not make the
    /// copies anew.
    #[must_use]
    pub const fn new(first: &'a [u8], second: &'a [u8]) -> Self {
        Self { words: [first.as_chunks::<4>().0, second.as_chunks::<4>().0] }
    }

    /// Whether both begin at the same place.
    #[inline(always)]
    pub(super) fn is_one(&self) -> bool {
        let [first, second] = self.words;
        core::ptr::eq(first.as_ptr(), second.as_ptr())
    }

    /// Whether they share memory.
    pub(super) fn overlap(&self) -> bool {
        let [first, second] = self.words.map(<[_]>::as_ptr_range);
        first.start < second.end && second.start < first.end
    }

    /// Writes a page of `good` over the same page of `damaged`, and its checksum, and returns whether it did: not if
    /// the page of `good` is damaged too. Both are whole images of the same table. The page after the last is the
    /// CRC-32 of the whole image, by which a store knows it ([`Flags::OTHER_IMAGES`](crate::Flags::OTHER_IMAGES)). Then
    /// notify the store: [`Store::mended`](crate::Store::mended).
    #[must_use]
    pub fn mend_page(damaged: &mut [u8], good: &[u8], page: usize) -> bool {
        let body_bytes = (word_at(good.as_chunks::<4>().0, word::BODY) as usize).saturating_mul(4);
        let last = body_bytes.div_ceil(PAGE_BYTES);
        let intact = if page == last { whole_intact(good) } else { page_intact(good, body_bytes, page) };
        if damaged.len() != good.len() || !intact {
            return false;
        }
        let sum = body_bytes.saturating_add(page.saturating_mul(4));
        let start = page.saturating_mul(PAGE_BYTES);
        let end = start.saturating_add(PAGE_BYTES).min(body_bytes);
        for range in [start..end, sum..sum.saturating_add(4)] {
            if let (Some(to), Some(from)) = (damaged.get_mut(range.clone()), good.get(range)) {
                to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
            }
        }
        true
    }

    #[inline(always)]
    pub(super) fn at(&self, place: usize) -> [u32; 2] {
        let [first, second] = self.words;
        [word_at(first, place), word_at(second, place)]
    }
}

/// Whether the CRC-32 of all before is at the end.
fn whole_intact(image: &[u8]) -> bool {
    image.split_last_chunk::<4>().is_some_and(|(before, sum)| crc32(before) == u32::from_le_bytes(*sum))
}
