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

use crate::drive::Drive;
use crate::error::ImageError;
use crate::grid;
use crate::image::{CRC, PAGE_BYTES};
use crate::table::{
    self, Doubt, Memory, NODE_WORDS, OperatingPoint, Plan, Table, TableId, TorquePlace, Words, f32_at, halves, word,
    word_at,
};
use core::fmt;

/// Largest copy that fits into a [`Store`], words: torque axis 64, curves, and for each torque node 3 and its ripple.
pub const STORE_WORDS: usize = 1024;
/// Most pages of an image that a [`Store`] takes, 8 KiB: one bit for each.
pub const STORE_PAGES: usize = 32;
/// Words that a read may take from the last place on.
const SLACK: usize = 8;
const PAGE_WORDS: usize = PAGE_BYTES / 4;
/// Torque axis of a copy.
const AXIS_WORDS: usize = 64;

/// What the store has seen since it was made; counters wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Ticks in which a step read words that differ between the copies.
    pub doubtful_ticks: u32,
    /// Words of the copies that were found to differ when they were made anew.
    pub words_mended: u32,
    /// Words that were not made anew because the images differ and neither page is known to be the intact one.
    pub words_skipped: u32,
    /// Pages of an image found damaged.
    pub pages_damaged: u32,
    /// Passes over both copies.
    pub passes: u32,
}

/// How the table in the store is, as far as it is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Health {
    /// Nothing is known to be wrong.
    Sound,
    /// A page of one image is damaged.
    OneImage,
    /// A page is damaged in both images: only a new table helps.
    Lost,
    /// No table was activated.
    Empty,
}

/// Why a table was not activated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ActivateError {
    /// Neither image is a table; this is wrong with the first.
    Image(ImageError),
    /// The table needs more than the store has.
    TooLarge {
        /// Words needed; [`STORE_WORDS`] are there.
        needed: usize,
    },
    /// The image has more pages than the store can tell apart.
    TooManyPages {
        /// Pages found; [`STORE_PAGES`] are allowed.
        found: usize,
    },
    /// Each image is a table, and they differ: words of two tables would be mixed.
    TwoTables,
    /// The table is for other tooth counts or another fixed member.
    OtherDrive,
}

impl fmt::Display for ActivateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Image(error) => error.fmt(f),
            Self::TooLarge { needed } => write!(f, "the table needs {needed} words, the store has {STORE_WORDS}"),
            Self::TooManyPages { found } => write!(f, "the image has {found} pages, a store takes {STORE_PAGES}"),
            Self::TwoTables => f.write_str("the images are two different tables"),
            Self::OtherDrive => f.write_str("the table is for another drive"),
        }
    }
}

impl core::error::Error for ActivateError {}

/// Two images of one table, read where they lie. Made anew for every call: it holds nothing but where they are.
#[derive(Clone, Copy, Debug)]
pub struct Images<'a> {
    words: [Words<'a>; 2],
}

impl<'a> Images<'a> {
    /// Two images. The same one twice is allowed, and protects only the copies.
    #[must_use]
    pub const fn new(first: &'a [u8], second: &'a [u8]) -> Self {
        Self { words: [first.as_chunks::<4>().0, second.as_chunks::<4>().0] }
    }

    #[inline(always)]
    fn at(&self, place: usize) -> [u32; 2] {
        let [first, second] = self.words;
        [word_at(first, place), word_at(second, place)]
    }
}

/// Writes a page of `good` over the same page of `damaged`, and its checksum. Both are whole images of the same table. If the page
/// of `good` is intact the store may be told: [`Store::mended`].
pub fn mend_page(damaged: &mut [u8], good: &[u8], page: usize) {
    let body = word_at(good.as_chunks::<4>().0, word::BODY) as usize;
    let sum = body.saturating_add(page).saturating_mul(4);
    let start = page.saturating_mul(PAGE_BYTES);
    let end = start.saturating_add(PAGE_BYTES).min(body.saturating_mul(4));
    for range in [start..end, sum..sum.saturating_add(4)] {
        if let (Some(to), Some(from)) = (damaged.get_mut(range.clone()), good.get(range)) {
            to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
        }
    }
}

/// Where the words of the copies come from, and how warm it is. What must not change unnoticed: all of it is summed up.
#[derive(Clone, Copy, Debug, Default)]
struct Source {
    plan: Plan,
    torque_range: [f32; 2],
    last_torque: u32,
    /// Words of the copies in use, and of them before the first record.
    used: u32,
    records_from: u32,
    /// Words of a record: node and ripple.
    record: u32,
    /// Places in the image, and steps from one temperature to the next.
    nodes: u32,
    node_plane: u32,
    ripples: u32,
    ripple_plane: u32,
    body: u32,
    /// The lower of the two temperature nodes, the way to the next in 1 and in 2⁻¹⁴, and whether that is within the range.
    plane: u32,
    warm: f32,
    warm_q14: u32,
    temperature_in_range: bool,
}

/// Numbers that must not change unnoticed, summed up.
#[inline(always)]
fn sum<const N: usize>(numbers: [u32; N]) -> u32 {
    numbers.into_iter().fold(0x5a5a_5a5a, u32::wrapping_add)
}

impl Source {
    /// Of what a step uses.
    #[inline(always)]
    fn step_sum(&self) -> u32 {
        let Plan { ripple_nodes, ripple_unit, curves, limit, iterations, hold, cell_width } = self.plan;
        let ([a, b, c], [least, most]) = (curves, self.torque_range.map(f32::to_bits));
        let plan = [ripple_nodes, ripple_unit, a, b, c, limit as u32, iterations, hold as u32, cell_width.to_bits()];
        let own = [least, most, self.last_torque, self.records_from, self.record, self.temperature_in_range as u32];
        sum(plan).wrapping_add(sum(own))
    }

    /// Of what the making anew uses besides.
    #[inline(always)]
    fn feed_sum(&self) -> u32 {
        sum([
            self.used,
            self.records_from,
            self.record,
            self.nodes,
            self.node_plane,
            self.ripples,
            self.ripple_plane,
            self.plane,
            self.warm.to_bits(),
            self.warm_q14,
        ])
    }
}

/// Where the making anew is.
#[derive(Clone, Copy, Debug, Default)]
struct Cursor {
    at: u32,
    /// Torque node, and word of its record.
    node: u32,
    word: u32,
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

/// Before the first byte of a CRC-32.
const CRC_START: u32 = 0xffff_ffff;

type Copied = [u32; STORE_WORDS + SLACK];

/// Two copies of a table at the temperature of the drive: 8.1 KiB, and 0.2 KiB beside.
#[derive(Clone, Debug)]
pub struct Store {
    first: Copied,
    second: Copied,
    source: Source,
    step_sum: u32,
    feed_sum: u32,
    cursor: Cursor,
    scrub: Scrub,
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
    fn words<const N: usize>(&self, at: usize, doubt: &mut Doubt) -> [u32; N] {
        // Places of an accepted table are below; the mask shows that to the compiler.
        let at = at & (STORE_WORDS - 1);
        let first = self.first.get(at..).and_then(|words| words.first_chunk::<N>()).copied().unwrap_or([0; N]);
        let second = self.second.get(at..).and_then(|words| words.first_chunk::<N>()).copied().unwrap_or([0; N]);
        for (a, b) in first.into_iter().zip(second) {
            doubt.0 |= a ^ b;
        }
        first
    }
}

#[inline(always)]
fn copied(copy: &Copied, at: usize) -> u32 {
    copy.get(at & (STORE_WORDS - 1)).copied().unwrap_or(0)
}

#[inline(always)]
fn set(copy: &mut Copied, at: usize, value: u32) {
    if let Some(word) = copy.get_mut(at & (STORE_WORDS - 1)) {
        *word = value;
    }
}

impl Store {
    /// A store without a table: every step goes without correction.
    #[must_use]
    pub const fn new() -> Self {
        let plan =
            Plan { ripple_nodes: 0, ripple_unit: 0, curves: [0; 3], limit: 0, iterations: 0, hold: 0, cell_width: 1.0 };
        let source = Source {
            plan,
            torque_range: [0.0; 2],
            last_torque: 0,
            used: 0,
            records_from: 0,
            record: 0,
            nodes: 0,
            node_plane: 0,
            ripples: 0,
            ripple_plane: 0,
            body: 0,
            plane: 0,
            warm: 0.0,
            warm_q14: 0,
            temperature_in_range: false,
        };
        Self {
            first: [0; STORE_WORDS + SLACK],
            second: [0; STORE_WORDS + SLACK],
            source,
            step_sum: 0,
            feed_sum: 0,
            cursor: Cursor { at: 0, node: 0, word: 0 },
            scrub: Scrub { second: false, page: 0, word: 0, crc: CRC_START, damaged: [0; 2] },
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
        let [first, second] = images.words.map(|words| Table::check(words.as_flattened()));
        let table = match (first, second) {
            (Ok(first), Ok(second)) if first.image != second.image => return Err(ActivateError::TwoTables),
            (Ok(table), _) | (Err(_), Ok(table)) => table,
            (Err(error), Err(_)) => return Err(ActivateError::Image(error)),
        };
        if table.drive() != drive {
            return Err(ActivateError::OtherDrive);
        }
        let source = Source::new(&table);
        if source.used as usize > STORE_WORDS {
            return Err(ActivateError::TooLarge { needed: source.used as usize });
        }
        if table.page_count() > STORE_PAGES {
            return Err(ActivateError::TooManyPages { found: table.page_count() });
        }
        let counters = self.counters;
        *self = Self { source, counters, active: true, ..Self::new() };
        let images = Images { words: [table.words; 2] };
        self.set_temperature(&images, temperature_c);
        for _ in 0..self.source.used {
            self.renew(&images);
        }
        self.counters = counters;
        self.cursor = Cursor::default();
        Ok(table.id())
    }

    /// The temperature that the copies follow, °C, within one pass. Call it in a slow rate group; false, and nothing changes, if it
    /// is not finite or the images disagree about the temperature nodes.
    pub fn set_temperature(&mut self, images: &Images<'_>, temperature_c: f32) -> bool {
        let [first, second] = images.words;
        let nodes = word::TEMPERATURE_RANGE..word::TEMPERATURE_RANGE.wrapping_add(2);
        let axis = word::TEMPERATURE_NODES..word::CURVES;
        let last = word::CELL_WIDTH.wrapping_add(1);
        let same = nodes.chain(axis).chain(last..last.wrapping_add(1)).all(|i| word_at(first, i) == word_at(second, i));
        if !same || !temperature_c.is_finite() {
            return false;
        }
        let number = |i: usize| f32_at(first, i);
        let range = [number(word::TEMPERATURE_RANGE), number(word::TEMPERATURE_RANGE.wrapping_add(1))];
        let temperature = table::within(temperature_c, range);
        let [last_temperature, _] = halves(word_at(first, last));
        let node = |i: usize| number(word::TEMPERATURE_NODES.wrapping_add(i));
        let plane = grid::search_8(node, temperature).min(last_temperature);
        let (cold, hot) = (node(plane), node(plane.wrapping_add(1)));
        let warm = (temperature - cold) / (hot - cold);
        let source = Source {
            plane: plane as u32,
            warm,
            warm_q14: (warm * 16_384.0) as u32,
            temperature_in_range: temperature == temperature_c,
            ..self.source
        };
        self.source = source;
        self.step_sum = source.step_sum();
        self.feed_sum = source.feed_sum();
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

    /// To be told after [`mend_page`]: this page of image 0 or 1 is as good as the other's again. Until the page is checked anew, the
    /// other would be believed in any case, also when it is hit itself. Only if the page that was copied is intact
    /// ([`Table::is_page_intact`]): else it is not known any more that both are damaged.
    pub const fn mended(&mut self, image: usize, page: usize) {
        let [first, second] = self.scrub.damaged;
        let sound = !1u32.wrapping_shl(page as u32);
        self.scrub.damaged = if image == 0 { [first & sound, second] } else { [first, second & sound] };
    }

    /// Flips bits of one word of one copy, as radiation does: for campaigns. Copies are 0 and 1.
    pub fn upset(&mut self, copy: usize, word: usize, mask: u32) {
        let copy = if copy == 0 { &mut self.first } else { &mut self.second };
        if let Some(word) = copy.get_mut(word) {
            *word ^= mask;
        }
    }

    /// Words of a copy that are in use.
    #[must_use]
    pub const fn used_words(&self) -> usize {
        self.source.used as usize
    }

    /// Locates a torque. The same work for all values.
    #[inline(always)]
    pub(crate) fn locate(&self, torque_n_m: f32) -> OperatingPoint {
        let mut doubt = Doubt(self.source.step_sum() ^ self.step_sum);
        let source = &self.source;
        let torque = table::within(torque_n_m, source.torque_range);
        let start = |i: usize| f32::from_bits(self.first.get(i).copied().unwrap_or(0));
        let interval = grid::search_64(start, torque).min(source.last_torque as usize);
        let [low, high] = self.words(interval, &mut doubt).map(f32::from_bits);
        // A search that was led astray ends in an interval that does not hold the torque (but for an axis of one node).
        let astray = (torque < low) & (high < f32::MAX) | (torque > high);
        doubt.0 |= astray as u32;
        let at = (source.records_from as usize).wrapping_add(interval.wrapping_mul(source.record as usize));
        let here: [u32; NODE_WORDS] = self.words(at, &mut doubt);
        let next: [u32; NODE_WORDS] = self.words(at.wrapping_add(source.record as usize), &mut doubt);
        let [_, _, flagged] = here;
        let width = high - low;
        let place = TorquePlace { weight: (torque - low) / width, width, jump: flagged & 1 != 0 };
        let around = [here, next].map(|node| node.map(f32::from_bits));
        let records = [at.wrapping_add(NODE_WORDS), source.record as usize, 0];
        let marks = (table::finite(torque_n_m) & self.active, (torque == torque_n_m) & source.temperature_in_range);
        OperatingPoint::new(place, around, 0.0, records, source.plan, marks, doubt)
    }

    /// One tick of making anew and of checking.
    #[inline(never)]
    pub(crate) fn tend(&mut self, images: &Images<'_>, doubt: Doubt) {
        self.counters.doubtful_ticks = self.counters.doubtful_ticks.wrapping_add(!doubt.none() as u32);
        self.renew(images);
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
    fn renew(&mut self, images: &Images<'_>) {
        let source = &self.source;
        let Cursor { at, node, word } = self.cursor;
        let (is_record, is_node) = (at >= source.records_from, word < NODE_WORDS as u32);
        let ripple = source.record.wrapping_sub(NODE_WORDS as u32);
        let in_node = source.nodes.wrapping_add(node.wrapping_mul(NODE_WORDS as u32)).wrapping_add(word);
        let in_ripple =
            source.ripples.wrapping_add(node.wrapping_mul(ripple)).wrapping_add(word.wrapping_sub(NODE_WORDS as u32));
        // Before the records, the torque axis and, beyond the temperatures, the curves.
        let skip = if at < AXIS_WORDS as u32 { word::TORQUE_NODES } else { word::CURVES - AXIS_WORDS } as u32;
        let (from, step) = if is_node { (in_node, source.node_plane) } else { (in_ripple, source.ripple_plane) };
        let (from, step) = if is_record { (from, step) } else { (at.wrapping_add(skip), 0) };
        let cold = from.wrapping_add(source.plane.wrapping_mul(step)) as usize;
        let hot = cold.wrapping_add(step as usize);
        let [cold_a, cold_b] = images.at(cold);
        let [hot_a, hot_b] = images.at(hot);

        let [damaged_a, damaged_b] = self.scrub.damaged;
        let pages = 1u32.wrapping_shl((cold / PAGE_WORDS) as u32) | 1u32.wrapping_shl((hot / PAGE_WORDS) as u32);
        let (bad_a, bad_b) = (damaged_a & pages != 0, damaged_b & pages != 0);
        let differ = (cold_a ^ cold_b) | (hot_a ^ hot_b) != 0;
        let (cold, hot) = if bad_a { (cold_b, hot_b) } else { (cold_a, hot_a) };
        let usable = (!differ | (bad_a != bad_b)) & (source.feed_sum() == self.feed_sum) & self.active;

        let (f, g) = (f32::from_bits(cold), f32::from_bits(hot));
        let number = (f + source.warm * (g - f)).to_bits();
        // The last bit of H is a mark.
        let number = if word == 2 { number & !1 | cold & 1 } else { number };
        let blend = |cold: i32, hot: i32| {
            cold.wrapping_add(hot.wrapping_sub(cold).wrapping_mul(source.warm_q14 as i32).wrapping_add(8192) >> 14)
        };
        let low = blend(cold as i16 as i32, hot as i16 as i32) as u32 & 0xffff;
        let high = (blend(cold as i32 >> 16, hot as i32 >> 16) as u32) << 16;
        // Both are made every time: a branch would save one of them now and then.
        let pair = core::hint::black_box(low | high);
        let blended = if is_node { number } else { pair };
        let value = if is_record { blended } else { cold };

        let place = at as usize;
        let (a, b) = (copied(&self.first, place), copied(&self.second, place));
        let (new_a, new_b) = if usable { (value, value) } else { (a, b) };
        set(&mut self.first, place, new_a);
        set(&mut self.second, place, new_b);
        self.counters.words_mended = self.counters.words_mended.wrapping_add(((a != b) & usable) as u32);
        self.counters.words_skipped = self.counters.words_skipped.wrapping_add(!usable as u32);

        let next = word.wrapping_add(1);
        let full = next >= source.record;
        let ended = at.wrapping_add(1) >= source.used;
        let next_node = if full { node.wrapping_add(1) } else { node };
        let next_word = if full { 0 } else { next };
        self.cursor = Cursor {
            at: if ended { 0 } else { at.wrapping_add(1) },
            node: if ended | !is_record { 0 } else { next_node },
            word: if ended | !is_record { 0 } else { next_word },
        };
        self.counters.passes = self.counters.passes.wrapping_add(ended as u32);
    }

    /// Takes one word of an image into the CRC-32 of its page.
    #[inline(always)]
    fn check(&mut self, images: &Images<'_>) {
        let Scrub { second, page, word, crc, damaged: [damaged_a, damaged_b] } = self.scrub;
        let body = self.source.body;
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

impl Source {
    /// Of an accepted table, without temperature.
    fn new(table: &Table<'_>) -> Self {
        let at = |place: usize| word_at(table.words, place);
        let number = |place: usize| f32::from_bits(at(place));
        let first = word::CELL_WIDTH;
        let [_, last_torque] = halves(at(first.wrapping_add(1)));
        let [node_plane, nodes] = halves(at(first.wrapping_add(2)));
        let [ripple_plane, ripples] = halves(at(first.wrapping_add(3)));
        let ripple = table.ripple_axis().stored_len();
        let record = NODE_WORDS.wrapping_add(ripple);
        let records_from = AXIS_WORDS.wrapping_add(nodes.wrapping_sub(word::CURVES));
        // A torque node alone is stored twice, its ripple once.
        let torque_nodes = table.torque_nodes_n_m().len().max(2);
        let mut plan = table.plan();
        // The curves follow the torque axis.
        plan.curves = plan.curves.map(|curve| curve.wrapping_sub((word::CURVES - AXIS_WORDS) as u32));
        Self {
            plan,
            torque_range: [number(word::TORQUE_RANGE), number(word::TORQUE_RANGE.wrapping_add(1))],
            last_torque: last_torque as u32,
            used: records_from.wrapping_add(torque_nodes.wrapping_mul(record)) as u32,
            records_from: records_from as u32,
            record: record as u32,
            nodes: nodes as u32,
            node_plane: node_plane as u32,
            ripples: ripples as u32,
            ripple_plane: ripple_plane as u32,
            body: at(word::BODY),
            ..Self::default()
        }
    }
}

/// CRC-32 over one more word, lowest byte first; before the last inversion.
#[inline(always)]
fn crc_word(crc: u32, word: u32) -> u32 {
    let mut digest = CRC.digest_with_initial(crc.reverse_bits());
    digest.update(&word.to_le_bytes());
    !digest.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{self, ARCSEC};
    use crate::{
        Flags, GeneratorAngle, Input, Joint, JointState, Limits, Mode, Output, OutputAngle, Overrun, PlayState, Quality,
    };
    use std::sync::LazyLock;
    use std::vec::Vec;

    static IMAGE: LazyLock<Vec<u8>> = LazyLock::new(|| fixture::image(true));

    fn joint() -> Joint {
        let limits = Limits {
            tick_s: 1e-3,
            rate_rad_s: 0.1,
            acceleration_rad_s2: 20.0,
            generator_rate_rad_s: 700.0,
            patience: 5,
        };
        Joint::new(fixture::drive(), limits, Overrun::SkipAndCount).unwrap()
    }

    fn active(temperature_c: f32) -> Store {
        let mut store = Store::new();
        let images = Images::new(&IMAGE, &IMAGE);
        assert_eq!(
            store.activate(&images, &fixture::drive(), temperature_c).map(|id| id.0),
            Ok(fixture::id(&unnamed()))
        );
        store
    }

    /// The body with the id zero.
    fn unnamed() -> Vec<u8> {
        let table = Table::check(&IMAGE).unwrap();
        let mut body = IMAGE[..table.body_bytes].to_vec();
        body[48..56].fill(0);
        body
    }

    /// Numbers that look random, the same in every run.
    struct Mixed(u64);

    impl Mixed {
        fn next(&mut self) -> u64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            z ^ (z >> 31)
        }

        fn below(&mut self, limit: usize) -> usize {
            (self.next() % limit as u64) as usize
        }

        /// −1 to 1.
        fn part(&mut self) -> f64 {
            (self.next() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        }
    }

    /// A motion with reversals over all torques.
    struct Motion {
        mixed: Mixed,
        generator: GeneratorAngle,
        speed: f64,
        torque: f32,
    }

    impl Motion {
        fn new(seed: u64) -> Self {
            Self { mixed: Mixed(seed), generator: GeneratorAngle::ZERO, speed: 0.0, torque: 0.0 }
        }

        fn next(&mut self) -> Input {
            if self.mixed.below(50) == 0 {
                self.speed = 0.3 * self.mixed.part();
                self.torque = (50.0 * self.mixed.part()) as f32;
            }
            self.generator = self.generator.offset_rad(self.speed as f32);
            let target = fixture::drive().nominal_output(self.generator).offset_rad(1e-4 * self.mixed.part() as f32);
            Input { generator: Some(self.generator), target, torque_n_m: self.torque, missed_ticks: 0 }
        }
    }

    fn unlike(a: &Output, b: &Output) -> bool {
        let flagged = |out: &Output| out.flags.contains(Flags::NOT_CORRECTED) && out.quality == Quality::Disabled;
        a != b && !flagged(a)
    }

    #[test]
    fn the_copies_say_what_the_table_says() {
        for temperature in [-40.0, -11.0, 20.0, 33.3, 80.0] {
            let (mut store, table) = (active(temperature), Table::check(&IMAGE).unwrap());
            let images = Images::new(&IMAGE, &IMAGE);
            let (mut state, mut play) = (JointState::new(), PlayState::unknown());
            let mut motion = Motion::new(1);
            for _ in 0..5000 {
                let input = motion.next();
                let found = joint().tick(&images, &mut store, &mut state, &input);
                let expected = table.forward(&mut play, motion.generator, input.torque_n_m, temperature);
                let off = (found.transmission_error_rad - expected.transmission_error_rad).abs() as f64;
                // The ripple is rounded once more, to its unit.
                assert!(off < 0.004 * ARCSEC, "{} arcsec at {temperature}", off / ARCSEC);
            }
        }
    }

    #[test]
    fn the_copies_follow_the_temperature_within_a_pass() {
        let (mut moved, still) = (active(-40.0), active(55.0));
        let images = Images::new(&IMAGE, &IMAGE);
        assert!(moved.set_temperature(&images, 55.0));
        assert_ne!(moved.first, still.first);
        for _ in 0..moved.used_words() {
            moved.tend(&images, Doubt(0));
        }
        assert_eq!((moved.first, moved.second), (still.first, still.second));
        assert!(!moved.set_temperature(&images, f32::NAN));
        assert_eq!((moved.counters().passes, moved.counters().words_skipped), (1, 0));
        // Beyond the range the edge holds and is marked.
        assert!(moved.set_temperature(&images, 81.0));
        let point = moved.locate(5.0);
        assert_eq!(point.quality(true, true), Quality::Extrapolated);
    }

    #[test]
    fn every_bit_of_what_a_step_reads_is_compared() {
        let sound = active(20.0);
        let images = Images::new(&IMAGE, &IMAGE);
        let input = Motion::new(3).next();
        let reference = joint().tick(&images, &mut sound.clone(), &mut JointState::new(), &input);
        let mut noticed = 0;
        for word in 0..sound.used_words() {
            for (copy, bit) in [(0, word % 32), (1, (word + 7) % 32)] {
                let mut store = sound.clone();
                store.upset(copy, word, 1 << bit);
                let found = joint().tick(&images, &mut store, &mut JointState::new(), &input);
                assert!(!unlike(&found, &reference), "copy {copy} word {word} bit {bit}");
                noticed += usize::from(found.flags.contains(Flags::TABLE_DOUBT));
            }
        }
        // Two nodes, three of each, and the ripple and curves around two phases, in both copies.
        assert!(noticed > 2 * (2 + 6 + 2 * 3 + 2 * 9), "{noticed}");
    }

    /// Random flips in copies and images while the loop runs: every output either equals that of a joint without upsets or says
    /// that it is not to be used. Returns flips, ticks in doubt, words mended, pages found damaged.
    fn campaign(flips: usize, seed: u64) -> [usize; 4] {
        let (mut sound, mut hit) = (active(20.0), active(20.0));
        let mut images = [IMAGE.clone(), IMAGE.clone()];
        let (mut state, mut motion, mut mixed) = (JointState::new(), Motion::new(seed), Mixed(seed ^ 0xabcd));
        state.request(Mode::Tracking).unwrap();
        let (mut done, mut flagged) = (0, 0);
        while done < flips {
            // Single bits, neighbours, whole words, bursts over words.
            let used = hit.used_words();
            let word = mixed.below(used);
            let mask = match mixed.below(4) {
                0 | 1 => 1 << mixed.below(32),
                2 => 3u32.rotate_left(mixed.below(32) as u32),
                _ => mixed.next() as u32 | 1,
            };
            match mixed.below(8) {
                0 => {
                    let (image, at) = (mixed.below(2), mixed.below(IMAGE.len()));
                    images[image][at] ^= 1 << mixed.below(8);
                }
                1 => (0..4).for_each(|i| hit.upset(mixed.below(2), (word + i) % used, mask.rotate_left(i as u32))),
                _ => hit.upset(mixed.below(2), word, mask),
            }
            done += mask.count_ones() as usize;
            let input = motion.next();
            let mut copy = state;
            let both = Images::new(&IMAGE, &IMAGE);
            let expected = joint().tick(&both, &mut sound, &mut state, &input);
            let seen = Images::new(&images[0], &images[1]);
            let found = joint().tick(&seen, &mut hit, &mut copy, &input);
            assert!(!unlike(&found, &expected), "after {done} flips: {found:?} {expected:?}");
            flagged += usize::from(found.flags.contains(Flags::TABLE_DOUBT));
            hit.check_images(&seen, 64);
            if let Some((image, page)) = hit.damaged_page() {
                let good = images[1 - image].clone();
                mend_page(&mut images[image], &good, page);
            }
            if hit.health() == Health::Lost {
                // What firmware would do: send the table again.
                images = [IMAGE.clone(), IMAGE.clone()];
                hit.activate(&Images::new(&images[0], &images[1]), &fixture::drive(), 20.0).unwrap();
            }
        }
        let counters = hit.counters();
        [done, flagged, counters.words_mended as usize, counters.pages_damaged as usize]
    }

    #[test]
    fn no_upset_is_used() {
        let [flips, flagged, mended, pages] = campaign(30_000, 1);
        assert!(flips >= 30_000 && flagged > 100 && mended > 500 && pages > 50, "{flagged} {mended} {pages}");
    }

    #[test]
    #[ignore = "a million flips"]
    fn no_upset_of_a_million_is_used() {
        let mut sum = [0; 4];
        for seed in 2..6 {
            let found = campaign(300_000, seed);
            sum.iter_mut().zip(found).for_each(|(sum, found)| *sum += found);
        }
        let [flips, flagged, mended, pages] = sum;
        std::println!(
            "{flips} flips: {flagged} ticks in doubt, {mended} words mended, {pages} pages of images found damaged"
        );
    }

    #[test]
    fn a_damaged_page_of_one_image_is_named_and_mended() {
        let mut damaged = IMAGE.clone();
        damaged[1000] ^= 4;
        let mut store = active(20.0);
        let images = Images::new(&damaged, &IMAGE);
        store.check_images(&images, 2 * IMAGE.len() / 4 + 128);
        assert_eq!((store.health(), store.damaged_page()), (Health::OneImage, Some((0, 3))));
        // Meanwhile the copies are made from the other.
        let before = store.first;
        store.set_temperature(&images, 21.0);
        store.set_temperature(&images, 20.0);
        for _ in 0..store.used_words() {
            store.tend(&images, Doubt(0));
        }
        assert_eq!((store.first, store.counters().words_skipped), (before, 0));
        mend_page(&mut damaged, &IMAGE, 3);
        assert_eq!(damaged, *IMAGE);
        let images = Images::new(&damaged, &IMAGE);
        store.check_images(&images, 2 * IMAGE.len() / 4 + 128);
        assert_eq!((store.health(), store.damaged_page()), (Health::Sound, None));
    }

    #[test]
    fn a_page_damaged_in_both_images_is_lost_and_the_copies_stay() {
        let (mut first, mut second) = (IMAGE.clone(), IMAGE.clone());
        (first[1000], second[1001]) = (first[1000] ^ 4, second[1001] ^ 4);
        let mut store = active(20.0);
        let before = (store.first, store.second);
        let images = Images::new(&first, &second);
        store.check_images(&images, 2 * IMAGE.len() / 4 + 128);
        assert_eq!((store.health(), store.damaged_page()), (Health::Lost, None));
        assert!(store.set_temperature(&images, 60.0));
        for _ in 0..store.used_words() {
            store.tend(&images, Doubt(0));
        }
        assert!(store.counters().words_skipped > 0);
        let kept = (0..store.used_words()).filter(|&i| store.first[i] == before.0[i]).count();
        assert!(kept > 64, "{kept}");
        assert!(store.first[..] == store.second[..]);
    }

    #[test]
    fn what_is_no_table_of_this_drive_is_not_activated() {
        let mut damaged = IMAGE.clone();
        damaged[2000] ^= 1;
        let drive = fixture::drive();
        let mut store = Store::new();
        assert_eq!(store.health(), Health::Empty);
        let nothing = joint().tick(&Images::new(&[], &[]), &mut store, &mut JointState::new(), &Motion::new(1).next());
        assert_eq!((nothing.quality, nothing.correction_rad), (Quality::Disabled, 0.0));
        let refused = store.activate(&Images::new(&damaged, &damaged), &drive, 20.0);
        assert!(matches!(refused, Err(ActivateError::Image(ImageError::Crc { .. }))), "{refused:?}");
        let other = Drive::new(190, 192, drive.fixed()).unwrap();
        let refused = store.activate(&Images::new(&IMAGE, &IMAGE), &other, 20.0);
        assert_eq!(refused, Err(ActivateError::OtherDrive));
        assert_eq!(store.health(), Health::Empty);
        // One image is enough.
        assert!(store.activate(&Images::new(&damaged, &IMAGE), &drive, 20.0).is_ok());
        assert_eq!(store.first, active(20.0).first);
    }

    /// Found by a fuzzer: page 3 of one image is damaged, found, and written again; then the same page of the other is hit.
    #[test]
    fn after_a_page_is_mended_the_other_image_is_no_longer_believed_alone() {
        let mut images = [IMAGE.clone(), IMAGE.clone()];
        images[0][1000] ^= 4;
        let mut store = active(20.0);
        store.check_images(&Images::new(&images[0], &images[1]), 2 * IMAGE.len() / 4 + 128);
        assert_eq!(store.damaged_page(), Some((0, 3)));
        let good = images[1].clone();
        mend_page(&mut images[0], &good, 3);
        store.mended(0, 3);
        assert_eq!((store.health(), store.damaged_page()), (Health::Sound, None));
        let before = store.first;
        (768..1024).step_by(4).for_each(|at| images[1][at] ^= 0x40);
        for _ in 0..store.used_words() {
            store.tend(&Images::new(&images[0], &images[1]), Doubt(0));
        }
        assert_eq!(store.first, before);
        assert!(store.counters().words_skipped > 0);
    }

    /// With a bit for each page modulo 32, damage of page 33 of one image would have been looked for in page 1 of the other.
    #[test]
    fn an_image_with_more_pages_than_bits_is_not_activated() {
        let torque: Vec<f32> = (0..40).map(|i| i as f32).collect();
        let zeros = std::vec![0.0; 40 * 3 * 16];
        let data = crate::TableData {
            drive: fixture::drive(),
            torque_nodes_n_m: &torque,
            temperature_nodes_c: &[-40.0, 20.0, 80.0],
            ripple_nodes: 16,
            mean_rad: &zeros[..120],
            half_width_rad: &zeros[..120],
            mean_ripple_rad: &zeros,
            half_width_ripple_rad: &zeros,
            generator_curve_rad: &[],
            material_curve_rad: &[],
            output_curve_rad: &[],
            projection_worst_rad: 0.0,
            projection_rms_rad: 0.0,
        };
        let provenance = crate::Provenance { torque_range_n_m: [0.0, 39.0], ..fixture::provenance() };
        let mut image = std::vec![0; crate::image_bytes(40, 3, 16, [0; 3])];
        crate::write_image(&data, &provenance, &mut image, fixture::id).unwrap();
        let pages = Table::check(&image).unwrap().page_count();
        assert!(pages > STORE_PAGES && 64 + 40 * 22 <= STORE_WORDS, "{pages}");
        let refused = Store::new().activate(&Images::new(&image, &image), &fixture::drive(), 20.0);
        assert_eq!(refused, Err(ActivateError::TooManyPages { found: pages }));
    }

    /// Words that both have would follow the temperature, the others not.
    #[test]
    fn two_tables_are_not_activated_as_one() {
        let mut other = IMAGE.clone();
        // Another drive description: a table all the same.
        other[16] ^= 1;
        crate::image::reseal(&mut other);
        assert!(Table::check(&other).is_ok());
        let mut store = active(20.0);
        let refused = store.activate(&Images::new(&other, &IMAGE), &fixture::drive(), 60.0);
        assert_eq!(refused, Err(ActivateError::TwoTables));
        assert_eq!(store.first, active(20.0).first);
    }

    #[test]
    fn a_changed_plan_is_noticed() {
        let sound = active(20.0);
        let images = Images::new(&IMAGE, &IMAGE);
        let changes: [fn(&mut Source); 12] = [
            |s| s.plan.ripple_unit ^= 1 << 9,
            |s| s.plan.curves[1] ^= 1,
            |s| s.plan.limit ^= 1 << 20,
            |s| s.plan.iterations ^= 2,
            |s| s.plan.hold ^= 1 << 4,
            |s| s.plan.cell_width = -s.plan.cell_width,
            |s| s.torque_range[0] *= 2.0,
            |s| s.last_torque ^= 1,
            |s| s.records_from ^= 8,
            |s| s.record ^= 1,
            |s| s.temperature_in_range ^= true,
            |s| s.plan.ripple_nodes ^= 4,
        ];
        for (number, change) in changes.into_iter().enumerate() {
            let mut store = sound.clone();
            change(&mut store.source);
            let found = joint().tick(&images, &mut store, &mut JointState::new(), &Motion::new(3).next());
            assert!(found.flags.contains(Flags::TABLE_DOUBT), "{number}");
        }
        let feed: [fn(&mut Source); 6] = [
            |s| s.warm *= 0.5,
            |s| s.warm_q14 ^= 64,
            |s| s.plane ^= 1,
            |s| s.nodes ^= 1,
            |s| s.ripple_plane ^= 4,
            |s| s.used ^= 64,
        ];
        for (number, change) in feed.into_iter().enumerate() {
            let mut store = sound.clone();
            change(&mut store.source);
            for _ in 0..1000 {
                store.tend(&images, Doubt(0));
            }
            assert_eq!(store.first, sound.first, "{number}");
        }
    }

    #[test]
    fn targets_are_met_as_by_the_table_in_place() {
        let (mut store, images) = (active(20.0), Images::new(&IMAGE, &IMAGE));
        let mut state = JointState::new();
        state.request(Mode::Tracking).unwrap();
        let mut generator = GeneratorAngle::ZERO;
        let mut worst: f64 = 0.0;
        for i in 0..20_000i32 {
            let place = if (i / 4000) % 2 == 0 { i % 4000 } else { 4000 - i % 4000 };
            let target = OutputAngle::from_rad(1e-3 + place as f64 * 1.0e-5).unwrap();
            let input = Input { generator: Some(generator), target, torque_n_m: 5.0, missed_ticks: 0 };
            let found = joint().tick(&images, &mut store, &mut state, &input);
            // The generator goes where it is told; a while after a reversal the correction has caught up.
            generator = found.command;
            if i > 200 && i % 4000 > 200 {
                let mut play = *state.play();
                let table = Table::check(&IMAGE).unwrap();
                let there = table.forward(&mut play, generator, 5.0, 20.0);
                worst = worst.max(there.output.minus_rad(target).abs() as f64);
            }
        }
        assert!(worst < 0.01 * ARCSEC, "{} arcsec", worst / ARCSEC);
    }
}
