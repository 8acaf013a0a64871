//! The table that a joint flies with: two images, and from them two copies at the temperature of the drive.
//!
//! The images lie where the firmware has them, in flash or in memory, and are read in place. Of what a step needs, the
//! store holds two copies in memory, blended to one temperature. What a step reads it reads in both copies; if they
//! differ, they are made anew in that tick.
//!
//! In a slower rate group [`Store::check_images`] makes word by word of both copies anew from both images, so that
//! nothing stays wrong for longer than a pass, and the copies follow the temperature; and it goes over the CRC-32 of
//! the pages of both images. A word that differs between the images is taken from the one whose page is intact, or not
//! at all. A page that is damaged in one image is named, so that the firmware writes it again from the other
//! ([`Store::damaged_page`], [`Images::mend_page`]); one that is damaged in both is lost, the copies stay as they were,
//! and the health says so. The work is the same in every tick, whatever is found.
//!
//! A new table comes in chunks ([`crate::Upload`]). It is checked in full, and filled in, in short steps between ticks
//! ([`Store::begin`], [`Activation`]), or at once where nothing waits ([`Store::activate`]).

mod activation;
mod copies;
mod health;
mod images;
mod source;
#[cfg(test)]
mod tests;
mod upload;

pub use activation::{Activation, Progress};
pub use health::{ActivateError, Counters, Health};
pub use images::Images;
pub use upload::{Upload, UploadError};

use crate::crc::{CRC_START, crc_word};
use crate::drive::Drive;
use crate::num;
use crate::table::{
    Doubt, Memory, NODE_WORDS, OperatingPoint, PAGE_BYTES, PointPlan, Table, TableId, TorquePlace, grid, word_at,
};
use copies::{BESIDE, Copied, SLACK, STORE_ROOM, STORE_WORDS, agreed};
use core::iter::once;
use health::STORE_PAGES;
use source::{ACTIVE, Fresh, IN_RANGE, ImageSource, SealedSource, Strangers, TORN};

/// Words of a page.
const PAGE_WORDS: usize = PAGE_BYTES / 4;

/// Where the checking of the images is. An upset of it makes a page look damaged until it is checked again.
#[derive(Clone, Copy, Debug)]
struct Scrub {
    second: u32,
    page: u32,
    word: u32,
    /// Exclusive or with what a CRC-32 begins with.
    crc: u32,
}

impl Scrub {
    const START: Self = Self { second: 0, page: 0, word: 0, crc: 0 };
}

/// Pages found damaged, one bit each, of both images; once more, turned, so that an upset of it is noticed. All zeros
/// for none.
#[derive(Clone, Copy, Debug)]
struct Damaged {
    pages: [u32; 2],
    again: [u32; 2],
}

impl Damaged {
    const NONE: Self = Self::of([0; 2]);

    #[inline(always)]
    const fn of(pages: [u32; 2]) -> Self {
        let [first, second] = pages;
        Self { pages, again: [first.rotate_left(16), second.rotate_left(16)] }
    }

    /// The pages; none where they are not whole, so that words that differ are left as they are.
    #[inline(always)]
    const fn pages(&self) -> [u32; 2] {
        let ([a, b], [c, d]) = (self.pages, self.again);
        let whole = (a.rotate_left(16) ^ c) | (b.rotate_left(16) ^ d) == 0;
        let mask = (whole as u32).wrapping_neg();
        [a & mask, b & mask]
    }
}

/// Two copies of a table at the temperature of the drive, for any table: 8.1 KiB, and 0.3 KiB beside.
///
/// Where all tables of a firmware are smaller, `FLEXSPLINE_STORE_WORDS` in the environment of cargo (as in `[env]` of
/// `.cargo/config.toml`) says how many words of 8 bytes a store takes: [`Self::room_for`] the largest of them.
///
/// Joints of one table and temperature share a store: their ticks borrow it one after another, the slow group runs once
/// for all. Each then takes a [`JointState`](crate::JointState) of 184 bytes, and its settings where they are not a
/// constant.
#[derive(Clone, Debug)]
pub struct Store {
    first: Copied,
    second: Copied,
    source: [SealedSource; 2],
    /// The word that is made anew next; any that is in use is as good.
    next: u32,
    scrub: Scrub,
    damaged: Damaged,
    counters: Counters,
    id: [TableId; 2],
}

impl Default for Store {
    fn default() -> Self {
        Self::new()
    }
}

impl Memory for Store {
    #[inline(always)]
    fn plan(&self) -> &PointPlan {
        &self.source().plan
    }

    #[inline(always)]
    fn words<const N: usize>(&self, at: usize, doubt: &mut Doubt) -> [u32; N] {
        agreed(self.first.words(at), self.second.words(at), doubt)
    }

    #[inline(always)]
    fn halves<const N: usize>(&self, at: usize, _: (usize, i32), doubt: &mut Doubt) -> [u32; N] {
        agreed(self.first.halves(at), self.second.halves(at), doubt)
    }
}

impl Store {
    /// Most words of a table that it holds.
    pub const WORDS: usize = STORE_WORDS;
    /// Most eight-byte words that it takes.
    pub const ROOM: usize = STORE_ROOM;
    /// Most pages of an image that it watches.
    pub const PAGES: usize = STORE_PAGES;

    /// [`Self::ROOM`] of a store that holds this table and no larger one.
    #[must_use]
    pub fn room_for(table: &Table<'_>) -> usize {
        (ImageSource::new(table).used as usize).saturating_add(BESIDE)
    }

    /// A store without a table, all zeros: every step goes without correction.
    ///
    /// In a static it takes no room in flash and none of the stack.
    #[must_use]
    #[inline(always)]
    pub const fn new() -> Self {
        Self {
            first: Copied::EMPTY,
            second: Copied::EMPTY,
            source: [SealedSource::EMPTY; 2],
            next: 0,
            scrub: Scrub::START,
            damaged: Damaged::NONE,
            counters: Counters { doubtful_ticks: 0, words_mended: 0, words_skipped: 0, pages_damaged: 0, passes: 0 },
            id: [TableId([0; 8]); 2],
        }
    }

    #[inline(always)]
    const fn source(&self) -> &ImageSource {
        let [first, _] = &self.source;
        &first.source
    }

    /// The id of the table in use; zeros if there is none, or if its two copies disagree.
    #[must_use]
    pub fn id(&self) -> TableId {
        let [first, second] = self.id;
        if first == second { first } else { TableId::default() }
    }

    /// Begins to check the images and to fill the copies from them, at this temperature: step by step, between ticks.
    ///
    /// At least one image must pass [`Table::check`](crate::Table::check); if the other does not, it is damaged and
    /// will be named; if it is another table, neither is taken. They must lie at two places: one image given twice
    /// would be believed against the copies wherever it is hit.
    ///
    /// # Errors
    /// [`ActivateError::Temperature`]; every other with the step that finds it.
    pub fn begin(drive: &Drive, temperature_c: f32) -> Result<Activation, ActivateError> {
        if !temperature_c.is_finite() {
            return Err(ActivateError::Temperature { found_c: temperature_c });
        }
        Ok(Activation::new(*drive, temperature_c))
    }

    /// All of [`Self::begin`] and its steps in one call, some hundred thousand instructions; the table is used from the
    /// next tick on.
    ///
    /// # Errors
    /// [`ActivateError`]; the table in use stays, and goes on only if its images stay too.
    #[inline(never)]
    pub fn activate(
        &mut self,
        images: &Images<'_>,
        drive: &Drive,
        temperature_c: f32,
    ) -> Result<TableId, ActivateError> {
        let mut activation = Self::begin(drive, temperature_c)?;
        loop {
            if let Progress::Done(id) = activation.step(self, images)? {
                return Ok(id);
            }
        }
    }

    /// The temperature that the copies follow, °C, within one pass. Call it in a slow rate group; false, and nothing
    /// changes, if it is not finite, the images disagree about where what is or are not those that were activated, or
    /// there is no table.
    pub fn set_temperature(&mut self, images: &Images<'_>, temperature_c: f32) -> bool {
        self.mend_source();
        let source = *self.source();
        let [first, second] = images.words;
        let known = images.at(source.seal_at as usize) == [source.seal; 2];
        if !temperature_c.is_finite() || !self.is_active() || !known || !source::agree_on_temperature(first, second) {
            return false;
        }
        self.source = [source.at_temperature(first, temperature_c).sealed(); 2];
        true
    }

    /// Takes what is known of the table from the copy that is whole; if neither is, there is no table any more.
    /// Whether anything was to be done.
    fn mend_source(&mut self) -> bool {
        let [first, second] = self.source.map(|sealed| sealed.is_whole());
        let [one, other] = self.source;
        self.source = match (first, second) {
            (true, true) if one.sums == other.sums => return false,
            (true, _) => [one; 2],
            (false, true) => [other; 2],
            (false, false) => [ImageSource { marks: TORN, ..ImageSource::EMPTY }.sealed(); 2],
        };
        true
    }

    /// Mends what a tick at this torque reads: what is known of the table, and words that differ between the copies.
    /// Whether anything was to be done.
    pub(crate) fn mend(&mut self, images: &Images<'_>, torque_n_m: f32) -> bool {
        let mut found = self.mend_source();
        let ImageSource { nodes_from, records_from, record, last_torque, torque_range, .. } = *self.source();
        found |= self.mend_words(images, 0, nodes_from as usize);
        // The axis is whole now.
        let interval = self.interval(num::within(torque_n_m, torque_range), last_torque as usize);
        let nodes = (nodes_from as usize).wrapping_add(interval.wrapping_mul(NODE_WORDS));
        found |= self.mend_words(images, nodes, 2 * NODE_WORDS);
        let record = record as usize;
        let records = (records_from as usize).wrapping_add(interval.wrapping_mul(record));
        // A record alone is read with what follows it.
        found |= self.mend_words(images, records, record.wrapping_mul(2).wrapping_add(SLACK));
        self.counters.doubtful_ticks = self.counters.doubtful_ticks.wrapping_add(1);
        found
    }

    /// Makes those of these words anew that differ between the copies.
    fn mend_words(&mut self, images: &Images<'_>, from: usize, words: usize) -> bool {
        let mut found = false;
        let used = self.source().used as usize;
        // What is read beyond the last record is zero.
        let end = used.wrapping_add(SLACK);
        let (from, to) = (from.min(end), from.wrapping_add(words).min(end));
        let strangers = self.strangers(images);
        for place in from..to {
            let ([a], [b]) = (self.first.words::<1>(place), self.second.words::<1>(place));
            if a == b {
                continue;
            }
            found = true;
            let fresh = self.source().fresh(&images.words, place as u32, strangers, self.damaged.pages());
            let fresh = if place < used { fresh } else { Fresh { value: 0, usable: true } };
            self.count(fresh.usable);
            if fresh.usable {
                self.first.set(place, fresh.value);
                self.second.set(place, fresh.value);
            }
        }
        found
    }

    /// Counts so far.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// How the table is.
    #[must_use]
    pub const fn health(&self) -> Health {
        let [first, second] = self.damaged.pages();
        let marks = self.source().marks;
        match (marks & ACTIVE != 0, first & second, first | second) {
            (false, ..) if marks & TORN != 0 => Health::Torn,
            (false, ..) => Health::Empty,
            (true, 0, 0) => Health::Sound,
            (true, 0, _) => Health::OneImage,
            _ => Health::Lost,
        }
    }

    /// A page that is damaged in one image and not known to be so in the other: image (0 or 1) and page, to be written
    /// again.
    #[must_use]
    pub fn damaged_page(&self) -> Option<(usize, usize)> {
        let [first, second] = self.damaged.pages();
        [first & !second, second & !first]
            .into_iter()
            .enumerate()
            .find_map(|(image, pages)| (pages != 0).then_some((image, pages.trailing_zeros() as usize)))
    }

    /// To be called when [`Images::mend_page`], or what writes flash in its place, has written this page of image 0 or
    /// 1 again from an intact one. Without it the other image would be believed alone until the page is checked anew,
    /// also when it is hit itself.
    pub const fn mended(&mut self, image: usize, page: usize) {
        let [first, second] = self.damaged.pages();
        let sound = !1u32.wrapping_shl(page as u32);
        self.damaged = Damaged::of(if image == 0 { [first & sound, second] } else { [first, second & sound] });
        // A check under way has words of before in it, and would find the page damaged.
        if self.scrub.page as usize == page && self.scrub.second & 1 == image as u32 {
            self.scrub = Scrub { word: 0, crc: 0, ..self.scrub };
        }
    }

    /// Flips bits of one word of one copy, as radiation does: for campaigns. Copies are 0 and 1.
    pub fn upset(&mut self, copy: usize, word: usize, mask: u32) {
        let copy = if copy == 0 { &mut self.first } else { &mut self.second };
        if let Some(word) = copy.0.get_mut(word) {
            *word = (u32::from_le_bytes(*word) ^ mask).to_le_bytes();
        }
    }

    /// Words of a copy that are in use.
    #[must_use]
    pub const fn used_words(&self) -> usize {
        self.source().used as usize
    }

    /// Whether the table is for this drive.
    #[inline(always)]
    pub(crate) const fn is_for(&self, drive: &Drive) -> bool {
        self.source().drive == drive.word()
    }

    /// Whether there is a table, and it is for another drive.
    #[inline(always)]
    pub(crate) const fn is_for_another(&self, drive: &Drive) -> bool {
        self.is_active() & !self.is_for(drive)
    }

    #[inline(always)]
    const fn is_active(&self) -> bool {
        self.source().marks & ACTIVE != 0
    }

    /// Locates a torque where nobody else asks whether what is known of the table is whole.
    #[inline(always)]
    pub(crate) fn locate_whole(&self, torque_n_m: f32) -> OperatingPoint {
        let mut point = self.locate(torque_n_m, 0, 0);
        let [first, _] = &self.source;
        point.doubt.0 |= !first.is_whole() as u32;
        point
    }

    /// The interval of the torque axis that holds a torque.
    #[inline(always)]
    fn interval(&self, torque: f32, last: usize) -> usize {
        let start = |i: usize| f32::from_bits(u32::from_le_bytes(self.first.0.get(i).copied().unwrap_or([0; 4])));
        grid::search([32, 16, 8, 4, 2, 1], start, torque).min(last)
    }

    /// Locates a torque, with this added to D and H, counts ([`OperatingPoint::adjusted`]). The same work for all
    /// values.
    #[inline(always)]
    pub(crate) fn locate(&self, torque_n_m: f32, mean: i32, half_width: i32) -> OperatingPoint {
        let source = self.source();
        let torque = num::within(torque_n_m, source.torque_range);
        let interval = self.interval(torque, source.last_torque as usize);
        let at = (source.nodes_from as usize).wrapping_add(interval.wrapping_mul(NODE_WORDS));
        let mut doubt = Doubt(0);
        let [low, high] = self.words(interval, &mut doubt).map(f32::from_bits);
        let [below @ .., a, b, c] = self.words::<6>(at, &mut doubt).map(f32::from_bits);
        let width = high - low;
        let [_, _, half] = below;
        let place = TorquePlace { weight: (torque - low) / width, width, jump: half.to_bits() & 1 != 0 };
        let around = [below, [a, b, c]];
        let first = (source.records_from as usize).wrapping_add(interval.wrapping_mul(source.record as usize));
        let rows = [first, first.wrapping_add(source.record as usize)].map(|words: usize| words.wrapping_mul(2));
        let (active, in_range) = (source.marks & ACTIVE != 0, source.marks & IN_RANGE != 0);
        let marks = (num::finite(torque_n_m) & active, (torque == torque_n_m) & in_range);
        OperatingPoint::new(place, around, rows, (0, 0), marks, doubt).adjusted(&source.plan, mean, half_width)
    }

    /// Torques that the table holds for, N·m.
    pub(crate) const fn torque_range(&self) -> [f32; 2] {
        self.source().torque_range
    }

    /// Both ends of a range of torques, and between them the nodes that lie within, upwards: each with what the copies
    /// disagree in.
    pub(crate) fn torques(&self, [least, most]: [f32; 2]) -> impl Iterator<Item = (f32, Doubt)> {
        let nodes = (self.source().last_torque as usize).min(grid::MAX_CLAMPED_NODES).wrapping_add(2);
        let between = (0..nodes).map(move |node: usize| {
            let mut doubt = Doubt(0);
            let [torque] = self.words(node, &mut doubt).map(f32::from_bits);
            (torque, doubt)
        });
        let within = between.filter(move |(torque, doubt)| (least < *torque && *torque < most) || !doubt.none());
        once((least, Doubt(0))).chain(within).chain(once((most, Doubt(0))))
    }

    /// Images that are not to be used: not those that were activated, or both the same.
    #[inline(always)]
    fn strangers(&self, images: &Images<'_>) -> Strangers {
        let ImageSource { seal, seal_at, .. } = *self.source();
        let [first, second] = images.at(seal_at as usize).map(|found| found != seal);
        let once = images.is_one();
        Strangers { any: first | second | once, all: first & second | once }
    }

    /// Whether the store's data on the table is whole, and whether an image is not the one that was activated: to be
    /// read after everything else that a tick reads.
    #[inline(always)]
    pub(crate) fn table_status(&self, images: &Images<'_>) -> (bool, bool) {
        let strangers = self.strangers(images);
        let [sealed, _] = &self.source;
        (sealed.is_whole(), self.is_active() & strangers.any)
    }

    /// Makes a word of both copies anew from both images.
    fn renew(&mut self, images: &Images<'_>, strangers: Strangers) {
        let used = self.source().used as u32;
        let at = if self.next < used { self.next } else { 0 };
        let fresh = self.source().fresh(&images.words, at, strangers, self.damaged.pages());
        let place = at as usize;
        let ([a], [b]) = (self.first.words::<1>(place), self.second.words::<1>(place));
        if fresh.usable {
            self.first.set(place, fresh.value);
            self.second.set(place, fresh.value);
        }
        self.next = at.wrapping_add(1);
        self.counters.passes = self.counters.passes.wrapping_add((at.wrapping_add(1) >= used) as u32);
        if (a != b) | !fresh.usable {
            self.count(fresh.usable);
        }
    }

    /// Counts what seldom happens.
    #[cold]
    #[inline(never)]
    fn count(&mut self, mended: bool) {
        let counter = if mended { &mut self.counters.words_mended } else { &mut self.counters.words_skipped };
        *counter = counter.wrapping_add(1);
    }

    /// Takes `words` words of the images into the CRC-32 of their pages: shows which of two images is damaged, and
    /// finds what both have. Makes as many words of the copies anew. Call it in a slow rate group, the same number each
    /// time: a word takes at most 734 instructions, and with 16 words every 100 ms the copies follow the temperature
    /// within 6.4 s where the store is full.
    pub fn check_images(&mut self, images: &Images<'_>, words: usize) {
        self.mend_source();
        let strangers = self.strangers(images);
        for _ in 0..words {
            self.check(images);
            self.renew(images, strangers);
        }
    }

    /// Takes one word of an image into the CRC-32 of its page.
    #[inline(always)]
    fn check(&mut self, images: &Images<'_>) {
        let Scrub { second, page, word, crc } = self.scrub;
        let (body, of_second) = (self.source().body as u32, second & 1 != 0);
        let start = page.wrapping_mul(PAGE_WORDS as u32);
        let left = body.wrapping_sub(start);
        let length = if left < PAGE_WORDS as u32 { left } else { PAGE_WORDS as u32 };
        let [a, b] = images.at(start.wrapping_add(word) as usize);
        let crc = crc_word(crc ^ CRC_START, if of_second { b } else { a });
        let [sum_a, sum_b] = images.at(body.wrapping_add(page) as usize);
        let intact = !crc == if of_second { sum_b } else { sum_a };

        let ended = word.wrapping_add(1) >= length;
        let last = ended & (start.wrapping_add(PAGE_WORDS as u32) >= body);
        let bit = if ended { 1u32.wrapping_shl(page) } else { 0 };
        let found = if intact { 0 } else { bit };
        let next_page = if ended { page.wrapping_add(1) } else { page };
        self.scrub = Scrub {
            second: second ^ last as u32,
            page: if last { 0 } else { next_page },
            word: if ended { 0 } else { word.wrapping_add(1) },
            crc: if ended { 0 } else { crc ^ CRC_START },
        };
        let [damaged_a, damaged_b] = self.damaged.pages();
        let pages =
            if of_second { [damaged_a, damaged_b & !bit | found] } else { [damaged_a & !bit | found, damaged_b] };
        self.damaged = Damaged::of(pages);
        if found != 0 {
            self.check_other(images, page, !of_second);
        }
        self.counters.pages_damaged = self.counters.pages_damaged.wrapping_add((found != 0) as u32);
    }
}

impl Store {
    /// A page was found damaged: before the other image is believed alone, the same page of it is checked at once.
    #[cold]
    #[inline(never)]
    fn check_other(&mut self, images: &Images<'_>, page: u32, second: bool) {
        let body = self.source().body as usize;
        let start = (page as usize).wrapping_mul(PAGE_WORDS);
        let end = start.wrapping_add(PAGE_WORDS).min(body);
        let [a, b] = images.words;
        let words = if second { b } else { a };
        let crc = (start..end).fold(CRC_START, |crc, at| crc_word(crc, word_at(words, at)));
        if !crc != word_at(words, body.wrapping_add(page as usize)) {
            let [a, b] = self.damaged.pages();
            let bit = 1u32.wrapping_shl(page);
            self.damaged = Damaged::of(if second { [a, b | bit] } else { [a | bit, b] });
        }
    }
}

#[cfg(test)]
impl Store {
    /// Bits of what is known of the table, both copies.
    pub(crate) fn source_bits(&self) -> usize {
        crate::upset::Upset::bits(&self.source)
    }

    /// Flips one of them.
    pub(crate) fn flip_source(&mut self, bit: usize) {
        crate::upset::Upset::flip(&mut self.source, bit, &mut std::string::String::new());
    }
}

#[cfg(any(test, feature = "testing"))]
impl Store {
    /// Whether everything but the counters is the same.
    #[doc(hidden)]
    #[must_use]
    pub fn is_like(&self, other: &Self) -> bool {
        let rest = |store: &Self| (store.next, store.scrub.second, store.scrub.page, store.scrub.word, store.scrub.crc);
        let (same_source, same_id) = (self.source == other.source, self.id == other.id);
        let damaged = |store: &Self| (store.damaged.pages, store.damaged.again);
        let same_rest = rest(self) == rest(other) && damaged(self) == damaged(other);
        same_source && same_id && same_rest && self.first == other.first && self.second == other.second
    }
}

bits_of!(Store { first, second, source, next, scrub, damaged, counters, id });
bits_of!(Scrub { second, page, word, crc });
bits_of!(Damaged { pages, again });
