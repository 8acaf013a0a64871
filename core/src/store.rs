//! The table in two copies: compared as they are read, scrubbed a slice each tick, repaired from each other.
//!
//! What a step reads it reads in both copies; if they differ, the step makes no use of it and says so ([`Health`]). Meanwhile a
//! scrubber takes one word each tick: the CRC-32 of a page in the first copy, then in the second; a page that is intact in one
//! copy only is written back to the other, word by word. A page that a step found in doubt is taken next. A page that is intact
//! in neither copy is lost: steps that read what differs in it fall back, until a new table is activated.
//!
//! Every tick does the same work, whatever it finds.
//!
//! A new table comes in chunks into a buffer of the caller ([`Upload`]) and is checked in full; the table in use stays until
//! [`Store::activate`] is called between two ticks.

use crate::drive::Drive;
use crate::image::{CRC, PAGE_BYTES};
use crate::table::{Doubt, Memory, Table, TableId, word};
use core::fmt;

/// Largest image that fits into a [`Store`], bytes.
pub const STORE_BYTES: usize = 8192;
const WORDS: usize = STORE_BYTES / 4;
/// Words that a read may take from the last place on.
const SLACK: usize = 16;
const PAGE_WORDS: usize = PAGE_BYTES / 4;
/// Most pages, with room for their checksums.
const MAX_PAGES: usize = WORDS / PAGE_WORDS;

/// What the store has seen since it was made; counters wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Ticks in which a step read words that differ between the copies.
    pub doubtful_ticks: u32,
    /// Pages written back from the other copy.
    pub pages_repaired: u32,
    /// Times a page was found damaged in both copies.
    pub pages_lost: u32,
    /// Passes over the whole table.
    pub passes: u32,
}

/// How the table in the store is, as far as it is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Health {
    /// Nothing is known to be wrong.
    Sound,
    /// A page of one copy is damaged and is being repaired.
    Repairing,
    /// A page is damaged in both copies: only a new table helps.
    Lost,
    /// No table was activated.
    Empty,
}

/// Why a table was not activated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ActivateError {
    /// The image is larger than the store.
    TooLarge {
        /// Bytes found; [`STORE_BYTES`] are allowed.
        found: usize,
    },
    /// The table is for other tooth counts or another fixed member.
    OtherDrive,
}

impl fmt::Display for ActivateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooLarge { found } => write!(f, "the image has {found} bytes, at most {STORE_BYTES} are allowed"),
            Self::OtherDrive => f.write_str("the table is for another drive"),
        }
    }
}

impl core::error::Error for ActivateError {}

/// What the scrubber does with a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    First,
    Second,
    Mend,
}

#[derive(Clone, Copy, Debug)]
struct Scrub {
    page: u32,
    word: u32,
    crc: u32,
    phase: Phase,
    /// Whether the first copy of the page is intact; in `Mend` the copy to write from.
    first_intact: bool,
    /// The page to take next, if not [`NO_PAGE`].
    wanted: u32,
}

const NO_PAGE: u32 = u32::MAX;
const START: Scrub = Scrub { page: 0, word: 0, crc: CRC_START, phase: Phase::First, first_intact: false, wanted: NO_PAGE };
/// Before the first byte of a CRC-32.
const CRC_START: u32 = 0xffff_ffff;

type Copied = [u32; WORDS + SLACK];

/// Two copies of a table, 16.2 KiB.
#[derive(Clone, Debug)]
pub struct Store {
    first: Copied,
    second: Copied,
    scrub: Scrub,
    counters: Counters,
    health: Health,
}

impl Default for Store {
    fn default() -> Self {
        Self::new()
    }
}

impl Memory for Store {
    #[inline(always)]
    fn words<const N: usize>(&self, at: usize, doubt: &mut Doubt) -> [u32; N] {
        // Places of an accepted table are below; the mask shows that to the compiler.
        let at = at & (WORDS - 1);
        let first = self.first.get(at..).and_then(|words| words.first_chunk::<N>()).copied().unwrap_or([0; N]);
        let second = self.second.get(at..).and_then(|words| words.first_chunk::<N>()).copied().unwrap_or([0; N]);
        for (a, b) in first.into_iter().zip(second) {
            doubt.bits |= a ^ b;
        }
        first
    }

    #[inline(always)]
    fn probe(&self, at: usize) -> u32 {
        copied(&self.first, at & (WORDS - 1))
    }
}

#[inline(always)]
fn copied(copy: &Copied, at: usize) -> u32 {
    copy.get(at).copied().unwrap_or(0)
}

impl Store {
    /// A store without a table: every step falls back.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            first: [0; WORDS + SLACK],
            second: [0; WORDS + SLACK],
            scrub: START,
            counters: Counters { doubtful_ticks: 0, pages_repaired: 0, pages_lost: 0, passes: 0 },
            health: Health::Empty,
        }
    }

    /// Puts a table into both copies; it is used from the next tick on. Some 25 000 instructions for 8 KiB.
    ///
    /// A table was checked when it was made; here that it fits, and that it is for this drive.
    ///
    /// # Errors
    /// [`ActivateError`]; the table in use stays.
    pub fn activate(&mut self, table: &Table<'_>, drive: &Drive) -> Result<TableId, ActivateError> {
        let (words, _) = table.image().as_chunks::<4>();
        if words.len() > WORDS {
            return Err(ActivateError::TooLarge { found: table.image().len() });
        }
        if table.drive() != drive {
            return Err(ActivateError::OtherDrive);
        }
        for (place, (a, b)) in self.first.iter_mut().zip(self.second.iter_mut()).enumerate() {
            let word = words.get(place).map_or(0, |word| u32::from_le_bytes(*word));
            (*a, *b) = (word, word);
        }
        self.scrub = START;
        self.health = Health::Sound;
        Ok(table.id())
    }

    /// What was seen so far.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// How the table is.
    #[must_use]
    pub const fn health(&self) -> Health {
        self.health
    }

    /// The table id in the first copy; `None` without a table.
    #[must_use]
    pub fn id(&self) -> Option<TableId> {
        let [a, b, c, d] = copied(&self.first, 12).to_le_bytes();
        let [e, f, g, h] = copied(&self.first, 13).to_le_bytes();
        if self.health == Health::Empty { None } else { Some(TableId([a, b, c, d, e, f, g, h])) }
    }

    /// Flips bits of one word of one copy, as radiation does: for tests and campaigns. Copies are 0 and 1; words beyond the
    /// last are left.
    pub fn upset(&mut self, copy: usize, word: usize, mask: u32) {
        let copy = if copy == 0 { &mut self.first } else { &mut self.second };
        if let Some(word) = copy.get_mut(word) {
            *word ^= mask;
        }
    }

    /// Words of one copy that hold a table: what [`Self::upset`] can reach and steps or the scrubber read.
    #[must_use]
    pub fn used_words(&self) -> usize {
        let body = copied(&self.first, word::BODY) as usize;
        body.saturating_add(body.div_ceil(PAGE_WORDS))
    }

    /// One tick of the scrubber; `doubt` is what the step of this tick read.
    #[inline(always)]
    pub(crate) fn scrub(&mut self, doubt: Doubt, suspects: [usize; 4]) {
        let Scrub { page, word, crc, phase, first_intact, wanted } = self.scrub;
        let doubtful = !doubt.none();
        self.counters.doubtful_ticks = self.counters.doubtful_ticks.wrapping_add(doubtful as u32);
        // The places that a step reads, in turn.
        let turn = self.counters.doubtful_ticks as usize % suspects.len();
        let suspect = suspects.get(turn).copied().unwrap_or(0);
        let wanted = if doubtful { (suspect / PAGE_WORDS) as u32 } else { wanted };

        // Where the page ends, from the body's length in the copy that is looked at.
        let second = phase == Phase::Second;
        let looked_at = |a: u32, b: u32| if second { b } else { a };
        let body = looked_at(copied(&self.first, word::BODY), copied(&self.second, word::BODY)) as usize;
        let body = if body < WORDS { body } else { WORDS - 1 };
        let start = page as usize * PAGE_WORDS & (WORDS - 1);
        let left = body.wrapping_sub(start);
        let length = if left < PAGE_WORDS { left } else { PAGE_WORDS };
        let at = start.wrapping_add(word as usize) & (WORDS - 1);
        let sum_at = body.wrapping_add(page as usize) & (WORDS - 1);

        let (a, b) = (copied(&self.first, at), copied(&self.second, at));
        let crc = crc_word(crc, looked_at(a, b));
        // Written back whether it differs or not: the same work.
        let mending = phase == Phase::Mend;
        let (a, b) = if mending { if first_intact { (a, a) } else { (b, b) } } else { (a, b) };
        set(&mut self.first, at, a);
        set(&mut self.second, at, b);
        let (sum_a, sum_b) = (copied(&self.first, sum_at), copied(&self.second, sum_at));
        let intact = looked_at(sum_a, sum_b) == !crc;

        let next = word.wrapping_add(1);
        let ended = next as usize >= length;
        let after_second = ended & second;
        let mended = ended & mending;
        let (mend, lost) = (after_second & (intact != first_intact), after_second & !intact & !first_intact);
        let (sum_a, sum_b) = if mended { if first_intact { (sum_a, sum_a) } else { (sum_b, sum_b) } } else { (sum_a, sum_b) };
        set(&mut self.first, sum_at, sum_a);
        set(&mut self.second, sum_at, sum_b);

        let done = (after_second & !mend) | mended;
        let last = start.wrapping_add(PAGE_WORDS) >= body;
        let following = if last { 0 } else { page.wrapping_add(1) };
        let following = if wanted == NO_PAGE { following } else { wanted & (MAX_PAGES as u32 - 1) };
        let after_end = if mend {
            Phase::Mend
        } else if done {
            Phase::First
        } else {
            Phase::Second
        };
        self.scrub = Scrub {
            page: if done { following } else { page },
            word: if ended { 0 } else { next },
            crc: if ended { CRC_START } else { crc },
            phase: if ended { after_end } else { phase },
            first_intact: if ended & (phase == Phase::First) { intact } else { first_intact },
            wanted: if done { NO_PAGE } else { wanted },
        };
        self.counters.pages_repaired = self.counters.pages_repaired.wrapping_add(mended as u32);
        self.counters.pages_lost = self.counters.pages_lost.wrapping_add(lost as u32);
        self.counters.passes = self.counters.passes.wrapping_add((done & last) as u32);
        let health = if lost { Health::Lost } else { self.health };
        let health = if mend & (health == Health::Sound) { Health::Repairing } else { health };
        self.health = if mended & (health == Health::Repairing) { Health::Sound } else { health };
    }
}

#[inline(always)]
fn set(copy: &mut Copied, at: usize, value: u32) {
    if let Some(word) = copy.get_mut(at) {
        *word = value;
    }
}

/// CRC-32 over one more word, lowest byte first; before the last inversion.
#[inline(always)]
fn crc_word(crc: u32, word: u32) -> u32 {
    let mut digest = CRC.digest_with_initial(crc.reverse_bits());
    digest.update(&word.to_le_bytes());
    !digest.finalize()
}
