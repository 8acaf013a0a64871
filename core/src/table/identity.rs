//! Whether an image is the one of its id: BLAKE3 of its body, in steps of one block.
//!
//! Checksums detect accidental damage; the id also detects an image that was changed and sealed again. BLAKE3 as its
//! specification has it, without key, for at most [`MOST_CHUNKS`] chunks of 1024 bytes: what is finished is kept as a
//! stack of roots of whole trees, one for each bit of their number.

use super::TableId;
use super::image::{ID_OFFSET, Laid};
use core::mem::size_of;

const BLOCK_BYTES: usize = 64;
const BLOCKS_OF_CHUNK: usize = 16;
/// 65 536 bytes: far more than an image has.
const MOST_CHUNKS: usize = 64;
/// Roots of whole trees below that many chunks.
const TREES: usize = 6;

const CHUNK_START: u32 = 1;
const CHUNK_END: u32 = 2;
const PARENT: u32 = 4;
const ROOT: u32 = 8;

const START: [u32; 8] =
    [0x6a09_e667, 0xbb67_ae85, 0x3c6e_f372, 0xa54f_f53a, 0x510e_527f, 0x9b05_688c, 0x1f83_d9ab, 0x5be0_cd19];

/// Where the words of a block go from round to round.
const ORDER: [usize; 16] = [2, 6, 3, 10, 7, 0, 4, 13, 1, 11, 12, 5, 9, 14, 15, 8];

/// Result of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Identity {
    /// There is more to take in.
    Hashing,
    /// The image is the one of this id.
    Same(TableId),
    /// It is not: this is what its contents have.
    Other(TableId),
}

/// Takes an image in, block by block: holds nothing of it, so give the same with every step.
///
/// An upset of it between two steps ends in [`Identity::Other`], or changes nothing: ask once more before an image is
/// given up.
#[derive(Clone, Copy, Debug)]
pub struct IdentityCheck {
    /// Blocks of the body that were taken in.
    block: usize,
    /// Of the chunk under way; of what ends with it, while that is joined.
    top: [u32; 8],
    /// How far the chunk that has ended is joined with the trees before it.
    joined: Option<usize>,
    trees: [[u32; 8]; TREES],
}

impl Default for IdentityCheck {
    fn default() -> Self {
        Self::new()
    }
}

impl IdentityCheck {
    /// Of nothing yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { block: 0, top: START, joined: None, trees: [[0; 8]; TREES] }
    }

    /// Takes in one block of 64 bytes, or joins two trees, in at most 2000 instructions on a Cortex-M4F. After the last
    /// it says whether the image is the one of the id in it, and begins anew. An image that is not as long as it says
    /// is [`Identity::Other`].
    pub fn step(&mut self, image: &[u8]) -> Identity {
        let most = MOST_CHUNKS.saturating_mul(BLOCKS_OF_CHUNK).saturating_mul(BLOCK_BYTES);
        let Some(Laid { body, id }) = Laid::of(image).filter(|laid| laid.body.len() <= most) else {
            *self = Self::new();
            return Identity::Other(TableId::default());
        };
        let blocks = body.len().div_ceil(BLOCK_BYTES);
        let ended = match self.joined {
            None => self.take(body, blocks),
            Some(level) => self.join(level, self.block >= blocks),
        };
        if !ended {
            return Identity::Hashing;
        }
        let mut found = TableId::default();
        let [a, b, ..] = self.top;
        for (to, from) in found.0.iter_mut().zip([a, b].map(u32::to_le_bytes).as_flattened()) {
            *to = *from;
        }
        *self = Self::new();
        if found == id { Identity::Same(found) } else { Identity::Other(found) }
    }

    /// Takes in a block; true if it was all.
    fn take(&mut self, body: &[u8], blocks: usize) -> bool {
        let start = self.block.saturating_mul(BLOCK_BYTES);
        let mut bytes = [0; BLOCK_BYTES];
        let part = body.get(start..).unwrap_or_default();
        for (to, from) in bytes.iter_mut().zip(part) {
            *to = *from;
        }
        if start == 0 {
            // Hashed with zeros where the id is.
            bytes.iter_mut().skip(ID_OFFSET).take(size_of::<TableId>()).for_each(|byte| *byte = 0);
        }
        let (number, of_chunk) = (self.block / BLOCKS_OF_CHUNK, self.block % BLOCKS_OF_CHUNK);
        self.block = self.block.saturating_add(1);
        let last = self.block >= blocks;
        let ends = last || self.block.is_multiple_of(BLOCKS_OF_CHUNK);
        let only = last && number == 0;
        let flags = if of_chunk == 0 { CHUNK_START } else { 0 }
            | if ends { CHUNK_END } else { 0 }
            | if only { ROOT } else { 0 };
        let length = part.len().min(BLOCK_BYTES) as u32;
        self.top = compress(&self.top, &words(&bytes), number as u32, length, flags);
        self.joined = (ends && !only).then_some(0);
        only
    }

    /// Joins the chunk that has ended with a tree before it: with those of its size, and after the last chunk with all.
    /// True if that was all.
    fn join(&mut self, level: usize, last: bool) -> bool {
        let before = self.block.saturating_sub(1) / BLOCKS_OF_CHUNK;
        let left = before.checked_shr(level as u32).unwrap_or(0);
        if last && left == 0 {
            // Beyond the last tree: only an upset leads here, and it ends here.
            return true;
        }
        self.joined = Some(level.saturating_add(1));
        if left & 1 != 0 {
            let tree = self.trees.get(level).copied().unwrap_or_default();
            let mut block = [0; 16];
            for (to, from) in block.iter_mut().zip([tree, self.top].as_flattened()) {
                *to = *from;
            }
            let root = last && left == 1;
            let flags = PARENT | if root { ROOT } else { 0 };
            self.top = compress(&START, &block, 0, BLOCK_BYTES as u32, flags);
            return root;
        }
        if !last {
            if let Some(tree) = self.trees.get_mut(level) {
                *tree = self.top;
            }
            (self.top, self.joined) = (START, None);
        }
        false
    }
}

fn words(bytes: &[u8; BLOCK_BYTES]) -> [u32; 16] {
    let mut words = [0; 16];
    for (to, from) in words.iter_mut().zip(bytes.as_chunks::<4>().0) {
        *to = u32::from_le_bytes(*from);
    }
    words
}

/// The compression of BLAKE3: a chaining value and a block to the next.
fn compress(chain: &[u32; 8], block: &[u32; 16], chunk: u32, length: u32, flags: u32) -> [u32; 8] {
    let [a, b, c, d, e, f, g, h] = *chain;
    let [i, j, k, l, ..] = START;
    let mut v = [a, b, c, d, e, f, g, h, i, j, k, l, chunk, 0, length, flags];
    let mut m = *block;
    for _ in 0..7 {
        round(&mut v, &m);
        m = ORDER.map(|from| m.get(from).copied().unwrap_or(0));
    }
    let mut out = [0; 8];
    for (to, (low, high)) in out.iter_mut().zip(v.iter().zip(v.iter().skip(8))) {
        *to = low ^ high;
    }
    out
}

/// Four columns, then four diagonals.
#[inline(never)]
fn round(v: &mut [u32; 16], m: &[u32; 16]) {
    let [m0, m1, m2, m3, m4, m5, m6, m7, m8, m9, m10, m11, m12, m13, m14, m15] = *m;
    let [v0, v1, v2, v3, v4, v5, v6, v7, v8, v9, v10, v11, v12, v13, v14, v15] = *v;
    let [v0, v4, v8, v12] = mix([v0, v4, v8, v12], m0, m1);
    let [v1, v5, v9, v13] = mix([v1, v5, v9, v13], m2, m3);
    let [v2, v6, v10, v14] = mix([v2, v6, v10, v14], m4, m5);
    let [v3, v7, v11, v15] = mix([v3, v7, v11, v15], m6, m7);
    let [v0, v5, v10, v15] = mix([v0, v5, v10, v15], m8, m9);
    let [v1, v6, v11, v12] = mix([v1, v6, v11, v12], m10, m11);
    let [v2, v7, v8, v13] = mix([v2, v7, v8, v13], m12, m13);
    let [v3, v4, v9, v14] = mix([v3, v4, v9, v14], m14, m15);
    *v = [v0, v1, v2, v3, v4, v5, v6, v7, v8, v9, v10, v11, v12, v13, v14, v15];
}

#[inline(always)]
const fn mix([a, b, c, d]: [u32; 4], x: u32, y: u32) -> [u32; 4] {
    let a = a.wrapping_add(b).wrapping_add(x);
    let d = (d ^ a).rotate_right(16);
    let c = c.wrapping_add(d);
    let b = (b ^ c).rotate_right(12);
    let a = a.wrapping_add(b).wrapping_add(y);
    let d = (d ^ a).rotate_right(8);
    let c = c.wrapping_add(d);
    let b = (b ^ c).rotate_right(7);
    [a, b, c, d]
}

bits_of!(IdentityCheck { block, top, joined, trees });

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;
    use crate::table::Table;
    use crate::upset::Upset;
    use std::vec::Vec;

    /// The hash that `Table::hashed` is to have, by the crate of the authors of BLAKE3.
    fn expected(image: &[u8]) -> TableId {
        let table = Table::check(image).unwrap();
        let mut id = TableId::default();
        id.0.copy_from_slice(&blake3::hash(&table.hashed().concat()).as_bytes()[..8]);
        id
    }

    fn found(image: &[u8]) -> Identity {
        let mut check = IdentityCheck::new();
        (0..5000).map(|_| check.step(image)).find(|found| *found != Identity::Hashing).unwrap()
    }

    /// An image whose body states this length in words.
    fn sized(words: u32) -> Vec<u8> {
        let mut image: Vec<u8> = (0..4 * words + 100).map(|i| (i.wrapping_mul(i) / 7) as u8).collect();
        image[196..200].copy_from_slice(&words.to_le_bytes());
        image
    }

    #[test]
    #[cfg_attr(miri, ignore = "the crate of the authors has machine code")]
    fn an_image_is_known_by_its_hash() {
        for long in [false, true] {
            let mut image = fixture::image(long);
            let real = expected(&image);
            // The fixture's id is no BLAKE3.
            assert_eq!(found(&image), Identity::Other(real));
            image[ID_OFFSET..ID_OFFSET + 8].copy_from_slice(&real.0);
            assert_eq!(found(&image), Identity::Same(real));
            for at in [0, 30, 60, 700, 1023, 1024, image.len() / 2] {
                image[at] ^= 16;
                assert!(matches!(found(&image), Identity::Other(other) if other != real), "{at}");
                image[at] ^= 16;
            }
        }
    }

    /// Bodies of one to 64 chunks, with ends inside and at the end of blocks and chunks.
    #[test]
    #[cfg_attr(miri, ignore = "the crate of the authors has machine code")]
    fn bodies_of_every_length_are_hashed_as_the_authors_do() {
        for words in (64..3000).step_by(61).chain([255, 256, 257, 512, 768, 1024, 1792, 4096, 16_383, 16_384]) {
            let image = sized(words);
            let mut body = image[..4 * words as usize].to_vec();
            body[ID_OFFSET..ID_OFFSET + 8].fill(0);
            let hash = blake3::hash(&body);
            let Identity::Other(id) = found(&image) else { panic!("{words}") };
            assert_eq!(id.0, hash.as_bytes()[..8], "{words}");
        }
    }

    /// Every bit of what is kept from step to step, at blocks within a chunk, at its end and among joins: an answer
    /// comes, no later than as if all began anew; an image that is not the one of its id is never taken for it.
    #[test]
    #[cfg_attr(miri, ignore = "takes too long")]
    fn an_upset_of_the_check_never_makes_another_image_the_one_of_its_id() {
        let mut own = fixture::image(true);
        let Identity::Other(real) = found(&own) else { panic!("a fixture has no BLAKE3") };
        own[ID_OFFSET..ID_OFFSET + 8].copy_from_slice(&real.0);
        let mut other = own.clone();
        other[3000] ^= 4;
        let (mut steps, mut whole) = (0, IdentityCheck::new());
        while whole.step(&own) == Identity::Hashing {
            steps += 1;
        }
        let (mut torn, mut harmless) = (0, 0);
        for image in [&own, &other] {
            let mut check = IdentityCheck::new();
            for step in 0..steps {
                if step % 13 == 0 || check.joined.is_some() {
                    for bit in 0..check.bits() {
                        let mut hit = check;
                        hit.flip(bit, &mut std::string::String::new());
                        let found = (0..2 * steps + 200).map(|_| hit.step(image)).find(|f| *f != Identity::Hashing);
                        match found {
                            Some(Identity::Same(_)) if image == &own => harmless += 1,
                            Some(Identity::Other(_)) => torn += 1,
                            _ => panic!("step {step}, bit {bit}: {found:?}"),
                        }
                    }
                }
                assert_eq!(check.step(image), Identity::Hashing);
            }
        }
        assert!(torn > 10_000 && harmless > 100, "{torn} {harmless}");
    }

    #[test]
    fn what_has_no_body_is_not_the_one_of_its_id() {
        let none = Identity::Other(TableId::default());
        assert_eq!([found(&[]), found(&[0; 300]), found(&sized(16_385))], [none; 3]);
        let mut cut = sized(2000);
        cut.truncate(4000);
        assert_eq!(found(&cut), none);
    }
}
