//! The table that a joint flies with: two images, and from them two copies at the temperature of the drive.
//!
//! The images lie where the firmware has them, in flash or in memory, and are read in place. Of what a step needs, the store
//! holds two copies in memory, blended to one temperature. Each tick
//!
//! * what the step reads it reads in both copies; if they differ, the step makes no use of it and says so;
//! * one word of both copies is made anew from both images, so that nothing stays wrong for longer than a pass, and the copies
//!   follow the temperature.
//!
//! In a slower rate group [`Store::check_images`] goes over the CRC-32 of the pages of both images. A word that differs between the images is taken from the one whose page is intact, or not at all. A page that is damaged in
//! one image is named, so that the firmware writes it again from the other ([`Store::damaged_page`], [`mend_page`]); one that is
//! damaged in both is lost, the copies stay as they were, and the health says so. The work is the same in every tick, whatever is
//! found.
//!
//! A new table comes in chunks ([`crate::Upload`]) and is checked in full; the one in use stays until [`Store::activate`] is
//! called between two ticks.

mod copies;
mod health;
mod images;
mod source;
#[cfg(test)]
mod tests;
mod upload;

pub use copies::STORE_WORDS;
pub use health::{ActivateError, Counters, Health, STORE_PAGES};
pub use images::{Images, mend_page};
pub use upload::{Upload, UploadError};

use crate::crc::{CRC_START, crc_word};
use crate::drive::Drive;
use crate::num;
use crate::table::{
    Doubt, Memory, NODE_WORDS, OperatingPoint, PAGE_BYTES, Plan, Table, TableId, TorquePlace, Words, f32_at, grid,
    halves, word, word_at,
};
use copies::{Copied, agreed};
use source::{FIRST, Source};

const PAGE_WORDS: usize = PAGE_BYTES / 4;

/// What became of a word that was to be made anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Word {
    /// The copies agreed.
    Kept,
    Mended,
    /// There is nothing to make it of.
    Skipped,
}

/// Where the checking of the images is.
#[derive(Clone, Copy, Debug)]
struct Scrub {
    second: bool,
    page: u32,
    word: u32,
    crc: u32,
    /// Pages found damaged, one bit each.
    damaged: [u32; 2],
}

impl Scrub {
    const START: Self = Self { second: false, page: 0, word: 0, crc: CRC_START, damaged: [0; 2] };
}

/// Whether an image passes; on a stack of its own.
#[inline(never)]
fn is_table(words: Words<'_>) -> bool {
    Table::check(words.as_flattened()).is_ok()
}

/// Two copies of a table at the temperature of the drive: 8.1 KiB, and 0.2 KiB beside.
#[derive(Clone, Debug)]
pub struct Store {
    first: Copied,
    second: Copied,
    source: Source,
    sum: u32,
    /// The word that is made anew next.
    next: u32,
    scrub: Scrub,
    /// Words of the body of an image.
    body: u32,
    counters: Counters,
    active: bool,
}

impl Default for Store {
    fn default() -> Self {
        Self::new()
    }
}

impl Memory for Store {
    const ROWS: usize = 2;

    #[inline(always)]
    fn plan(&self) -> &Plan {
        &self.source.plan
    }

    #[inline(always)]
    fn words<const N: usize>(&self, at: usize, doubt: &mut Doubt) -> [u32; N] {
        agreed(self.first.words(at), self.second.words(at), doubt)
    }

    #[inline(always)]
    fn halves<const N: usize>(&self, at: usize, doubt: &mut Doubt) -> [u32; N] {
        agreed(self.first.halves(at), self.second.halves(at), doubt)
    }
}

impl Store {
    /// A store without a table: every step goes without correction.
    #[must_use]
    pub const fn new() -> Self {
        let plan = Plan {
            ripple_nodes: 0,
            ripple_unit: 0,
            ripple_cells: 0,
            curves: [0; 3],
            limit: 0,
            iterations: 0,
            hold: 0,
            cell_width: 1.0,
            play_ripple: 0,
        };
        let source = Source {
            plan,
            torque_range: [0.0; 2],
            last_torque: 0,
            used: 0,
            nodes_from: 0,
            records_from: 0,
            record: 0,
            nodes_ahead: 0,
            node_plane: 0,
            records_ahead: 0,
            record_plane: 0,
            warm: 0.0,
            temperature_in_range: 0,
        };
        Self {
            first: Copied::EMPTY,
            second: Copied::EMPTY,
            source,
            sum: 0,
            next: 0,
            scrub: Scrub::START,
            body: 0,
            counters: Counters { doubtful_ticks: 0, words_mended: 0, words_skipped: 0, pages_damaged: 0, passes: 0 },
            active: false,
        }
    }

    /// Checks the images and fills the copies from them, at this temperature; used from the next tick on.
    ///
    /// At least one image must pass [`Table::check`]; if the other does not, it is damaged and will be named; if it is another
    /// table, neither is taken. Takes as long as the
    /// check and some 80 instructions for each word: between two ticks only if there is time for that.
    ///
    /// # Errors
    /// [`ActivateError`]; the table in use stays, and goes on only if its images stay too.
    pub fn activate(
        &mut self,
        images: &Images<'_>,
        drive: &Drive,
        temperature_c: f32,
    ) -> Result<TableId, ActivateError> {
        let [first, second] = images.words;
        // Only where the images differ is the second a question.
        if first != second && is_table(first) && is_table(second) {
            return Err(ActivateError::TwoTables);
        }
        let table = Table::check(first.as_flattened())
            .or_else(|error| Table::check(second.as_flattened()).map_err(|_| error))
            .map_err(ActivateError::Image)?;
        if table.drive() != drive {
            return Err(ActivateError::OtherDrive);
        }
        let source = Source::new(&table);
        let body = word_at(table.words, word::BODY);
        if source.used as usize > STORE_WORDS {
            return Err(ActivateError::TooLarge { needed: source.used as usize });
        }
        if table.page_count() > STORE_PAGES {
            return Err(ActivateError::TooManyPages { found: table.page_count() });
        }
        let counters = self.counters;
        // Field by field: a whole store would be made on the stack first.
        for copy in [&mut self.first, &mut self.second] {
            copy.0.fill([0; 4]);
        }
        self.source = source;
        self.sum = source.sum();
        self.next = 0;
        self.scrub = Scrub::START;
        self.body = body;
        self.active = true;
        let images = Images { words: [table.words; 2] };
        self.set_temperature(&images, temperature_c);
        for _ in 0..self.source.used {
            self.tend(&images, Doubt::default(), true);
        }
        self.counters = counters;
        Ok(table.id())
    }

    /// The temperature that the copies follow, °C, within one pass. Call it in a slow rate group; false, and nothing changes, if it
    /// is not finite, the images disagree about where what is, or the store is not whole.
    pub fn set_temperature(&mut self, images: &Images<'_>, temperature_c: f32) -> bool {
        let [first, second] = images.words;
        let range_at = word::TEMPERATURE_RANGE;
        let axis = word::TEMPERATURE_NODES..word::CURVES;
        // Last intervals, nodes, records.
        let [last_at, nodes_at, records_at] = [1, 2, 3].map(|i: usize| word::CELL_WIDTH.wrapping_add(i));
        let read = [range_at, range_at.wrapping_add(1), last_at, nodes_at, records_at].into_iter().chain(axis);
        let same = read.into_iter().all(|i| word_at(first, i) == word_at(second, i));
        if !same || !temperature_c.is_finite() || self.source.sum() != self.sum {
            return false;
        }
        let number = |i: usize| f32_at(first, i);
        let range = [number(range_at), number(range_at.wrapping_add(1))];
        let temperature = num::within(temperature_c, range);
        let [last_temperature, _] = halves(word_at(first, last_at));
        let node = |i: usize| number(word::TEMPERATURE_NODES.wrapping_add(i));
        let plane = grid::search_8(node, temperature).min(last_temperature);
        let (cold, hot) = (node(plane), node(plane.wrapping_add(1)));
        let [node_plane, nodes] = halves(word_at(first, nodes_at));
        let [record_plane, records] = halves(word_at(first, records_at));
        let ahead = |start: usize, step: usize, from: u16| {
            (start.wrapping_add(plane.wrapping_mul(step)) as u16).wrapping_sub(from)
        };
        let source = Source {
            nodes_ahead: ahead(nodes, node_plane, self.source.nodes_from),
            node_plane: node_plane as u16,
            records_ahead: ahead(records, record_plane, self.source.records_from),
            record_plane: record_plane as u16,
            warm: (temperature - cold) / (hot - cold),
            temperature_in_range: (temperature == temperature_c) as u16,
            ..self.source
        };
        self.source = source;
        self.sum = source.sum();
        true
    }

    /// What was seen so far.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// How the table is.
    #[must_use]
    pub const fn health(&self) -> Health {
        let [first, second] = self.scrub.damaged;
        match (self.active, first & second, first | second) {
            (false, ..) => Health::Empty,
            (true, 0, 0) => Health::Sound,
            (true, 0, _) => Health::OneImage,
            _ => Health::Lost,
        }
    }

    /// A page that is damaged in one image and not known to be so in the other: image (0 or 1) and page, to be written again.
    #[must_use]
    pub fn damaged_page(&self) -> Option<(usize, usize)> {
        let [first, second] = self.scrub.damaged;
        [first & !second, second & !first]
            .into_iter()
            .enumerate()
            .find_map(|(image, pages)| (pages != 0).then_some((image, pages.trailing_zeros() as usize)))
    }

    /// To be told when [`mend_page`], or what writes flash in its place, has written this page of image 0 or 1 again from an intact
    /// one. Without it the other image would be believed alone until the page is checked anew, also when it is hit itself.
    pub const fn mended(&mut self, image: usize, page: usize) {
        let [first, second] = self.scrub.damaged;
        let sound = !1u32.wrapping_shl(page as u32);
        self.scrub.damaged = if image == 0 { [first & sound, second] } else { [first, second & sound] };
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
        self.source.used as usize
    }

    /// Locates a torque, with this added to D and H, counts ([`OperatingPoint::adjusted`]). The same work for all values.
    ///
    /// A call of its own, as the other parts of a tick: all in one function, more is moved to the stack and back than calls cost.
    #[inline(never)]
    pub(crate) fn locate(&self, torque_n_m: f32, mean: i32, half_width: i32) -> OperatingPoint {
        self.locate_here(torque_n_m, mean, half_width)
    }

    /// The same, where nothing else is done.
    #[inline(always)]
    pub(crate) fn locate_here(&self, torque_n_m: f32, mean: i32, half_width: i32) -> OperatingPoint {
        let source = &self.source;
        let changed = source.sum() ^ self.sum;
        let torque = num::within(torque_n_m, source.torque_range);
        let start = |i: usize| f32::from_bits(u32::from_le_bytes(self.first.0.get(i).copied().unwrap_or([0; 4])));
        let interval = grid::search_64(start, torque).min(source.last_torque as usize);
        let at = (source.nodes_from as usize).wrapping_add(interval.wrapping_mul(NODE_WORDS));
        let mut doubt = Doubt(changed);
        let [low, high] = self.words(interval, &mut doubt).map(f32::from_bits);
        let [below @ .., a, b, c] = self.words::<6>(at, &mut doubt).map(f32::from_bits);
        let width = high - low;
        let [_, _, half] = below;
        let place = TorquePlace { weight: (torque - low) / width, width, jump: half.to_bits() & 1 != 0 };
        let around = [below, [a, b, c]];
        let first = (source.records_from as usize).wrapping_add(interval.wrapping_mul(source.record as usize));
        let rows = [first, source.record as usize, 0].map(|words: usize| words.wrapping_mul(2));
        let marks =
            (num::finite(torque_n_m) & self.active, (torque == torque_n_m) & (source.temperature_in_range != 0));
        let mut point = OperatingPoint::new(place, around, 0.0, rows, marks, doubt);
        point.whole = changed == 0;
        point.adjusted(&source.plan, mean, half_width)
    }

    /// One tick of making anew; `whole` if what is known of the table is.
    #[inline(never)]
    pub(crate) fn tend(&mut self, images: &Images<'_>, doubt: Doubt, whole: bool) {
        let seldom = self.renew(images, whole);
        if !doubt.none() | (seldom != Word::Kept) {
            self.count(doubt, seldom);
        }
    }

    /// Counts what seldom happens.
    #[cold]
    #[inline(never)]
    fn count(&mut self, doubt: Doubt, word: Word) {
        let counters = &mut self.counters;
        counters.doubtful_ticks = counters.doubtful_ticks.wrapping_add(!doubt.none() as u32);
        counters.words_mended = counters.words_mended.wrapping_add((word == Word::Mended) as u32);
        counters.words_skipped = counters.words_skipped.wrapping_add((word == Word::Skipped) as u32);
    }

    /// Takes `words` words of the images into the CRC-32 of their pages: tells which of two images is damaged, and finds what both
    /// have. Call it in a slow rate group, the same number each time.
    pub fn check_images(&mut self, images: &Images<'_>, words: usize) {
        for _ in 0..words {
            self.check(images);
        }
    }

    /// Makes one word of both copies anew.
    #[inline(always)]
    fn renew(&mut self, images: &Images<'_>, whole: bool) -> Word {
        let source = &self.source;
        let at = self.next;
        let (ahead, step, is_number) = (FIRST as u16, 0, false);
        let is_node = at >= source.nodes_from as u32;
        let (ahead, step, is_number) =
            if is_node { (source.nodes_ahead, source.node_plane, true) } else { (ahead, step, is_number) };
        let is_record = at >= source.records_from as u32;
        let (ahead, step, is_number) =
            if is_record { (source.records_ahead, source.record_plane, false) } else { (ahead, step, is_number) };
        let cold = at.wrapping_add(ahead as u32) as usize;
        let hot = cold.wrapping_add(step as usize);
        let [cold_a, cold_b] = images.at(cold);
        let [hot_a, hot_b] = images.at(hot);

        let [damaged_a, damaged_b] = self.scrub.damaged;
        let pages = 1u32.wrapping_shl((cold / PAGE_WORDS) as u32) | 1u32.wrapping_shl((hot / PAGE_WORDS) as u32);
        let (bad_a, bad_b) = (damaged_a & pages != 0, damaged_b & pages != 0);
        let differ = (cold_a ^ cold_b) | (hot_a ^ hot_b) != 0;
        let (cold, hot) = if bad_a { (cold_b, hot_b) } else { (cold_a, hot_a) };
        let usable = (!differ | (bad_a != bad_b)) & whole;

        // Both are made every time: a branch would save one of them now and then.
        let (f, g) = (f32::from_bits(cold), f32::from_bits(hot));
        // The last bit of H is a mark, and of the others too small to matter.
        let number = (f + source.warm * (g - f)).to_bits() & !1 | cold & 1;
        let hotter = (source.warm * 16_384.0) as i32;
        let colder = 16_384i32.wrapping_sub(hotter);
        let blend = |cold: i32, hot: i32| {
            let cold = (cold as i16 as i32).wrapping_mul(colder as i16 as i32);
            let hot = (hot as i16 as i32).wrapping_mul(hotter as i16 as i32);
            cold.wrapping_add(hot).wrapping_add(8192) >> 14
        };
        let low = blend(cold as i32, hot as i32) as u32 & 0xffff;
        let pair = (blend(cold as i32 >> 16, hot as i32 >> 16) as u32) << 16 | low;
        let mask = (is_number as u32).wrapping_neg();
        let value = pair ^ (pair ^ number) & mask;

        let place = at as usize;
        let ([a], [b]) = (self.first.words(place), self.second.words(place));
        let (new_a, new_b) = if usable { (value, value) } else { (a, b) };
        self.first.set(place, new_a);
        self.second.set(place, new_b);
        let next = at.wrapping_add(1);
        let ended = next >= source.used as u32;
        self.next = if ended { 0 } else { next };
        self.counters.passes = self.counters.passes.wrapping_add(ended as u32);
        let mended = if a == b { Word::Kept } else { Word::Mended };
        if usable { mended } else { Word::Skipped }
    }

    /// Takes one word of an image into the CRC-32 of its page.
    #[inline(always)]
    fn check(&mut self, images: &Images<'_>) {
        let Scrub { second, page, word, crc, damaged: [damaged_a, damaged_b] } = self.scrub;
        let body = self.body;
        let start = page.wrapping_mul(PAGE_WORDS as u32);
        let left = body.wrapping_sub(start);
        let length = if left < PAGE_WORDS as u32 { left } else { PAGE_WORDS as u32 };
        let [a, b] = images.at(start.wrapping_add(word) as usize);
        let crc = crc_word(crc, if second { b } else { a });
        let [sum_a, sum_b] = images.at(body.wrapping_add(page) as usize);
        let intact = !crc == if second { sum_b } else { sum_a };

        let ended = word.wrapping_add(1) >= length;
        let last = ended & (start.wrapping_add(PAGE_WORDS as u32) >= body);
        let bit = if ended { 1u32.wrapping_shl(page) } else { 0 };
        let found = if intact { 0 } else { bit };
        let next_page = if ended { page.wrapping_add(1) } else { page };
        self.scrub = Scrub {
            second: second ^ last,
            page: if last { 0 } else { next_page },
            word: if ended { 0 } else { word.wrapping_add(1) },
            crc: if ended { CRC_START } else { crc },
            damaged: if second { [damaged_a, damaged_b & !bit | found] } else { [damaged_a & !bit | found, damaged_b] },
        };
        self.counters.pages_damaged = self.counters.pages_damaged.wrapping_add((found != 0) as u32);
    }
}
