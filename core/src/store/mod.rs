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

mod upload;

pub use upload::{Upload, UploadError};

use crate::crc::{CRC_START, crc_word};
use crate::drive::Drive;
use crate::error::ImageError;
use crate::num;
use crate::table::{
    Doubt, Memory, NODE_WORDS, OperatingPoint, PAGE_BYTES, Plan, Table, TableId, TorquePlace, Words, f32_at, grid,
    halves, page_intact, ripple_row, word, word_at, words_from,
};
use core::fmt;

/// Largest copy that fits into a [`Store`], words: 72 for the axes, curves, and for each torque node 3 and its ripple.
pub const STORE_WORDS: usize = 1024;
/// Most pages of an image that a [`Store`] takes, 8 KiB: one bit for each.
pub const STORE_PAGES: usize = 32;
/// Words that a read may take from the last place on.
const SLACK: usize = 8;
const PAGE_WORDS: usize = PAGE_BYTES / 4;
/// A copy starts with the torque axis; what comes before it in an image is in the store otherwise.
const FIRST: usize = word::TORQUE_NODES;

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

/// Writes a page of `good` over the same page of `damaged`, and its checksum, and tells whether it did: not if the page of `good` is
/// damaged too. Both are whole images of the same table. Then tell the store: [`Store::mended`].
#[must_use]
pub fn mend_page(damaged: &mut [u8], good: &[u8], page: usize) -> bool {
    let body_bytes = (word_at(good.as_chunks::<4>().0, word::BODY) as usize).saturating_mul(4);
    if damaged.len() != good.len() || !page_intact(good, body_bytes, page) {
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

/// What a step needs besides the copies, and where the words of the copies come from. What must not change unnoticed: all of it is
/// summed up.
///
/// A copy holds the words of an image from the torque axis on, but nodes and records at one temperature only.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
struct Source {
    plan: Plan,
    torque_range: [f32; 2],
    /// The way from the lower temperature node to the next, 0 to 1.
    warm: f32,
    /// The last torque interval, and whether the temperature is within the range.
    last_torque: u16,
    temperature_in_range: u16,
    /// Words of the copies in use, and of them before the nodes and before the records.
    used: u16,
    nodes_from: u16,
    records_from: u16,
    /// Words from one record to the next.
    record: u16,
    /// How much further in an image nodes and records are at the lower of the two temperatures, and steps to the next.
    nodes_ahead: u16,
    records_ahead: u16,
    node_plane: u16,
    record_plane: u16,
}

impl Source {
    /// Of all numbers: what must not change unnoticed.
    #[inline(never)]
    fn sum(&self) -> u32 {
        let Plan { ripple_nodes, ripple_unit, ripple_cells, curves, limit, iterations, hold, cell_width, play_ripple } =
            self.plan;
        let ([a, b, c], [least, most]) = (curves, self.torque_range.map(f32::to_bits));
        let plan = [
            ripple_nodes,
            ripple_unit,
            ripple_cells as u32,
            a,
            b,
            c,
            limit as u32,
            iterations,
            hold as u32,
            cell_width.to_bits(),
            play_ripple as u32,
        ];
        let own = [
            least,
            most,
            self.warm.to_bits(),
            // Neighbours: read as one word.
            self.last_torque as u32 | (self.temperature_in_range as u32) << 16,
            self.used as u32 | (self.nodes_from as u32) << 16,
            self.records_from as u32 | (self.record as u32) << 16,
            self.nodes_ahead as u32 | (self.records_ahead as u32) << 16,
            self.node_plane as u32 | (self.record_plane as u32) << 16,
        ];
        plan.into_iter().chain(own).fold(0x5a5a_5a5a, u32::wrapping_add)
    }
}

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

/// One copy: words, lowest byte first.
#[repr(align(8))]
#[derive(Clone, Debug, PartialEq, Eq)]
struct Copied([[u8; 4]; STORE_WORDS + SLACK]);

/// Whether an image passes; on a stack of its own.
#[inline(never)]
fn is_table(words: Words<'_>) -> bool {
    Table::check(words.as_flattened()).is_ok()
}

impl Copied {
    const EMPTY: Self = Self([[0; 4]; STORE_WORDS + SLACK]);

    // Places of an accepted table are below; the masks show that to the compiler.

    #[inline(always)]
    fn words<const N: usize>(&self, at: usize) -> [u32; N] {
        let words = self.0.get(at & (STORE_WORDS - 1)..).and_then(|words| words.first_chunk::<N>());
        words.map_or([0; N], |words| words.map(u32::from_le_bytes))
    }

    #[inline(always)]
    fn halves<const N: usize>(&self, at: usize) -> [u32; N] {
        words_from(self.0.as_flattened(), (at & (2 * STORE_WORDS - 1)).wrapping_mul(2))
    }

    #[inline(always)]
    fn set(&mut self, at: usize, value: u32) {
        if let Some(word) = self.0.get_mut(at & (STORE_WORDS - 1)) {
            *word = value.to_le_bytes();
        }
    }
}

/// Adds to the doubt what two copies disagree in; the first.
#[inline(always)]
fn agreed<const N: usize>(first: [u32; N], second: [u32; N], doubt: &mut Doubt) -> [u32; N] {
    for (a, b) in first.into_iter().zip(second) {
        doubt.0 |= a ^ b;
    }
    first
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

impl Source {
    /// Of an accepted table, without temperature.
    fn new(table: &Table<'_>) -> Self {
        let at = |place: usize| word_at(table.words, place);
        let number = |place: usize| f32::from_bits(at(place));
        let first = word::CELL_WIDTH;
        let [_, last_torque] = halves(at(first.wrapping_add(1)));
        let [_, nodes] = halves(at(first.wrapping_add(2)));
        let [_, record] = halves(at(first.wrapping_add(4)));
        let nodes_from = nodes.wrapping_sub(FIRST);
        // A torque node alone is stored twice, its ripple once.
        let torque_nodes = table.torque_nodes_n_m().len();
        let records_from = nodes_from.wrapping_add(torque_nodes.max(2).wrapping_mul(NODE_WORDS));
        let records = torque_nodes.wrapping_mul(ripple_row(table.ripple_axis().len()));
        let mut plan = table.plan;
        plan.curves = plan.curves.map(|curve| if curve >> 16 == 0 { 0 } else { curve.wrapping_sub(FIRST as u32) });
        plan.play_ripple = table.play_ripple_counts();
        Self {
            plan,
            torque_range: [number(word::TORQUE_RANGE), number(word::TORQUE_RANGE.wrapping_add(1))],
            last_torque: last_torque as u16,
            used: records_from.wrapping_add(records) as u16,
            nodes_from: nodes_from as u16,
            records_from: records_from as u16,
            record: record as u16,
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{self, ARCSEC};
    use crate::{
        Adjustment, Flags, GeneratorAngle, Input, Joint, JointState, Limits, Mode, Output, OutputAngle, Overrun,
        PlayState, Quality,
    };
    use std::sync::LazyLock;
    use std::vec::Vec;

    static IMAGE: LazyLock<Vec<u8>> = LazyLock::new(|| fixture::image(true));

    fn joint() -> Joint {
        let limits = Limits { rate_rad_s: 0.1, acceleration_rad_s2: 20.0, ..fixture::LIMITS };
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
            Input {
                generator: Some(self.generator),
                target,
                torque_n_m: self.torque,
                missed_ticks: 0,
                adjustment: Adjustment::default(),
            }
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
            moved.tend(&images, Doubt(0), true);
        }
        assert!(moved.first == still.first && moved.second == still.second);
        assert!(!moved.set_temperature(&images, f32::NAN));
        assert_eq!((moved.counters().passes, moved.counters().words_skipped), (1, 0));
        // Beyond the range the edge holds and is marked.
        assert!(moved.set_temperature(&images, 81.0));
        let point = moved.locate(5.0, 0, 0);
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
                if mend_page(&mut images[image], &good, page) {
                    hit.mended(image, page);
                }
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
        let before = store.first.clone();
        store.set_temperature(&images, 21.0);
        store.set_temperature(&images, 20.0);
        for _ in 0..store.used_words() {
            store.tend(&images, Doubt(0), true);
        }
        assert!(store.first == before && store.counters().words_skipped == 0);
        assert!(mend_page(&mut damaged, &IMAGE, 3));
        assert_eq!(damaged, *IMAGE);
        // Not from a page that is damaged itself, nor beyond the last, nor for an image of another size.
        let mut bad = IMAGE.clone();
        bad[800] ^= 1;
        for (good, page) in [(&bad[..], 3), (&IMAGE[..], 99), (&IMAGE[4..], 3)] {
            assert!(!mend_page(&mut damaged, good, page));
            assert_eq!(damaged, *IMAGE);
        }
        let images = Images::new(&damaged, &IMAGE);
        store.check_images(&images, 2 * IMAGE.len() / 4 + 128);
        assert_eq!((store.health(), store.damaged_page()), (Health::Sound, None));
    }

    #[test]
    fn a_page_damaged_in_both_images_is_lost_and_the_copies_stay() {
        let (mut first, mut second) = (IMAGE.clone(), IMAGE.clone());
        (first[1000], second[1001]) = (first[1000] ^ 4, second[1001] ^ 4);
        let mut store = active(20.0);
        let before = (store.first.clone(), store.second.clone());
        let images = Images::new(&first, &second);
        store.check_images(&images, 2 * IMAGE.len() / 4 + 128);
        assert_eq!((store.health(), store.damaged_page()), (Health::Lost, None));
        assert!(store.set_temperature(&images, 60.0));
        for _ in 0..store.used_words() {
            store.tend(&images, Doubt(0), true);
        }
        assert!(store.counters().words_skipped > 0);
        let kept = (0..store.used_words()).filter(|&i| store.first.0[i] == before.0.0[i]).count();
        assert!(kept > 64, "{kept}");
        assert!(store.first == store.second);
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
        assert!(mend_page(&mut images[0], &good, 3));
        store.mended(0, 3);
        assert_eq!((store.health(), store.damaged_page()), (Health::Sound, None));
        let before = store.first.clone();
        (768..1024).step_by(4).for_each(|at| images[1][at] ^= 0x40);
        for _ in 0..store.used_words() {
            store.tend(&Images::new(&images[0], &images[1]), Doubt(0), true);
        }
        assert!(store.first == before);
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
        crate::table::reseal(&mut other);
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
        let changes: [fn(&mut Source); 13] = [
            |s| s.plan.ripple_cells ^= 1 << 11,
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
            |s| s.temperature_in_range ^= 1,
            |s| s.plan.ripple_nodes ^= 4,
        ];
        for (number, change) in changes.into_iter().enumerate() {
            let mut store = sound.clone();
            change(&mut store.source);
            let found = joint().tick(&images, &mut store, &mut JointState::new(), &Motion::new(3).next());
            assert!(found.flags.contains(Flags::TABLE_DOUBT), "{number}");
        }
        let feed: [fn(&mut Source); 6] = [
            |s| s.warm += 0.25,
            |s| s.nodes_from ^= 64,
            |s| s.node_plane ^= 1,
            |s| s.nodes_ahead ^= 1,
            |s| s.record_plane ^= 4,
            |s| s.used ^= 64,
        ];
        for (number, change) in feed.into_iter().enumerate() {
            let mut store = sound.clone();
            change(&mut store.source);
            for _ in 0..1000 {
                let whole = store.locate(5.0, 0, 0).whole;
                assert!(!whole && !store.set_temperature(&images, 30.0));
                store.tend(&images, Doubt(0), whole);
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
            let input = Input {
                generator: Some(generator),
                target,
                torque_n_m: 5.0,
                missed_ticks: 0,
                adjustment: Adjustment::default(),
            };
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
