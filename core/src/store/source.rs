//! Data of a table that a step needs in addition to the copies, and the source of the copies' words.

use super::PAGE_WORDS;
use crate::num;
use crate::table::{
    NODE_WORDS, PointPlan, Table, Words, blend_halves, blend_number, f32_at, grid, halves, ripple_row, word, word_at,
};
use crate::whole::{pair, same, sums};

/// A copy starts with the torque axis; what comes before it in an image is in the store otherwise.
const FIRST: usize = word::TORQUE_NODES;

/// Data that a step needs in addition to the copies, and the source of the copies' words: kept twice, with sums over
/// each.
///
/// A copy holds the words of an image from the torque axis on, but nodes and records at one temperature only.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub(super) struct ImageSource {
    pub plan: PointPlan,
    pub torque_range: [f32; 2],
    /// The way from the lower temperature node to the next, 0 to 1.
    pub warm: f32,
    /// The last torque interval, and [`ACTIVE`] and its like.
    pub last_torque: u16,
    pub marks: u16,
    /// Words of the copies in use, and of them before the nodes and before the records.
    pub used: u16,
    pub nodes_from: u16,
    pub records_from: u16,
    /// Words from one record to the next.
    pub record: u16,
    /// How much further in an image nodes and records are at the lower of the two temperatures, and steps to the next.
    pub nodes_ahead: u16,
    pub records_ahead: u16,
    pub node_plane: u16,
    pub record_plane: u16,
    /// Words of the body of an image, and where its last word is: the CRC-32 of all before, by which the image is known
    /// again.
    pub body: u16,
    pub seal_at: u16,
    pub seal: u32,
    /// [`Drive::word`](crate::Drive::word) of the drive that the table is for.
    pub drive: u32,
}

/// Where an image has what depends on the temperature: its range, last intervals, nodes, records.
const PLACES: [usize; 4] = [word::TEMPERATURE_RANGE, word::CELL_WIDTH + 1, word::CELL_WIDTH + 2, word::CELL_WIDTH + 3];

/// Whether two images agree on it, and on the temperature axis.
pub(super) fn agree_on_temperature(first: Words<'_>, second: Words<'_>) -> bool {
    let axis = word::TEMPERATURE_NODES..word::CURVES;
    let end = word::TEMPERATURE_RANGE.wrapping_add(1);
    PLACES.into_iter().chain([end]).chain(axis).all(|i| word_at(first, i) == word_at(second, i))
}

/// The temperature is within the range.
pub(super) const IN_RANGE: u16 = 1;
/// A table was activated.
pub(super) const ACTIVE: u16 = 2;
/// The store's data on the table was lost: neither copy of this was whole.
pub(super) const TORN: u16 = 4;

impl ImageSource {
    /// Without a table.
    pub const EMPTY: Self = Self {
        plan: PointPlan {
            ripple_nodes: 0,
            ripple_unit: 0,
            ripple_cells: 0,
            curves: [0; 3],
            limit: 0,
            iterations: 0,
            hold: 0,
            cell_width: 0.0,
            play_ripple: 0,
        },
        torque_range: [0.0; 2],
        warm: 0.0,
        last_torque: 0,
        marks: 0,
        used: 0,
        nodes_from: 0,
        records_from: 0,
        record: 0,
        nodes_ahead: 0,
        records_ahead: 0,
        node_plane: 0,
        record_plane: 0,
        body: 0,
        seal_at: 0,
        seal: 0,
        drive: 0,
    };

    /// Sums over all of it; of zeros they are zeros, so that a store without a table is all zeros.
    #[inline(never)]
    pub const fn sums(&self) -> u64 {
        let PointPlan {
            ripple_nodes,
            ripple_unit,
            ripple_cells,
            curves,
            limit,
            iterations,
            hold,
            cell_width,
            play_ripple,
        } = self.plan;
        let ([a, b, c], [least, most]) = (curves, self.torque_range);
        sums!(
            [0; 2];
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
            least.to_bits(),
            most.to_bits(),
            self.warm.to_bits(),
            // Neighbours: read as one word.
            self.last_torque as u32 | (self.marks as u32) << 16,
            self.used as u32 | (self.nodes_from as u32) << 16,
            self.records_from as u32 | (self.record as u32) << 16,
            self.nodes_ahead as u32 | (self.records_ahead as u32) << 16,
            self.node_plane as u32 | (self.record_plane as u32) << 16,
            self.body as u32 | (self.seal_at as u32) << 16,
            self.seal,
            self.drive,
        )
    }

    /// This source at a temperature that is finite, of the words of an image.
    pub fn at_temperature(self, words: Words<'_>, temperature_c: f32) -> Self {
        let [range_at, last_at, nodes_at, records_at] = PLACES;
        let number = |i: usize| f32_at(words, i);
        let range = [number(range_at), number(range_at.wrapping_add(1))];
        let temperature = num::within(temperature_c, range);
        let [last_temperature, _] = halves(word_at(words, last_at));
        let node = |i: usize| number(word::TEMPERATURE_NODES.wrapping_add(i));
        let plane = grid::search([4, 2, 1], node, temperature).min(last_temperature);
        let (cold, hot) = (node(plane), node(plane.wrapping_add(1)));
        let [node_plane, nodes] = halves(word_at(words, nodes_at));
        let [record_plane, records] = halves(word_at(words, records_at));
        let ahead = |start: usize, step: usize, from: u16| {
            (start.wrapping_add(plane.wrapping_mul(step)) as u16).wrapping_sub(from)
        };
        Self {
            nodes_ahead: ahead(nodes, node_plane, self.nodes_from),
            node_plane: node_plane as u16,
            records_ahead: ahead(records, record_plane, self.records_from),
            record_plane: record_plane as u16,
            warm: (temperature - cold) / (hot - cold),
            marks: self.marks & !IN_RANGE | if temperature == temperature_c { IN_RANGE } else { 0 },
            ..self
        }
    }

    pub const fn sealed(self) -> SealedSource {
        SealedSource { source: self, sums: pair(self.sums()) }
    }

    /// Of an accepted table, without temperature.
    pub fn new(table: &Table<'_>) -> Self {
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
        let body = at(word::BODY) as usize;
        let seal_at = body.wrapping_add(table.page_count());
        let mut plan = table.plan;
        plan.curves = plan.curves.map(|curve| if curve >> 16 == 0 { 0 } else { curve.wrapping_sub(FIRST as u32) });
        plan.play_ripple = table.play_ripple;
        Self {
            plan,
            torque_range: [number(word::TORQUE_RANGE), number(word::TORQUE_RANGE.wrapping_add(1))],
            last_torque: last_torque as u16,
            used: records_from.wrapping_add(records) as u16,
            nodes_from: nodes_from as u16,
            records_from: records_from as u16,
            record: record as u16,
            marks: ACTIVE,
            body: body as u16,
            seal_at: seal_at as u16,
            seal: word_at(table.image.as_chunks::<4>().0, seal_at),
            drive: table.drive().word(),
            ..Self::EMPTY
        }
    }
}

/// A word of the copies, made anew.
#[derive(Clone, Copy)]
pub(super) struct Fresh {
    pub value: u32,
    /// There is something to make it of.
    pub usable: bool,
}

/// Whether any of two images, or both, are not those that were activated; one that is given twice is not.
#[derive(Clone, Copy)]
pub(super) struct Strangers {
    pub any: bool,
    pub all: bool,
}

impl Strangers {
    pub const NONE: Self = Self { any: false, all: false };
}

impl ImageSource {
    /// A word of the images, and whether it can be used: both have it, or one has it in a page that is not known to be
    /// damaged.
    ///
    /// By its own page: beside a damaged page of one image another page of the other may be damaged, and not found yet.
    /// Beside a stranger no image is believed alone.
    #[inline(never)]
    fn believed(images: &[Words<'_>; 2], at: usize, strangers: Strangers, damaged: [u32; 2]) -> (u32, bool) {
        let [a, b] = images.map(|words| word_at(words, at));
        let page = 1u32.wrapping_shl((at / PAGE_WORDS) as u32);
        let [bad_a, bad_b] = damaged.map(|pages| pages & page != 0);
        let usable = ((a == b) & !strangers.all) | ((bad_a ^ bad_b) & !strangers.any);
        (if bad_a { b } else { a }, usable)
    }

    /// A word of the copies, made anew of the images; `damaged` are their pages that are known to be, a bit each.
    #[inline(always)]
    pub fn fresh(&self, images: &[Words<'_>; 2], at: u32, strangers: Strangers, damaged: [u32; 2]) -> Fresh {
        let (ahead, step, is_number) = (FIRST as u16, 0, false);
        let is_node = at >= self.nodes_from as u32;
        let (ahead, step, is_number) =
            if is_node { (self.nodes_ahead, self.node_plane, true) } else { (ahead, step, is_number) };
        let is_record = at >= self.records_from as u32;
        let (ahead, step, is_number) =
            if is_record { (self.records_ahead, self.record_plane, false) } else { (ahead, step, is_number) };
        let cold = at.wrapping_add(ahead as u32) as usize;
        let hot = cold.wrapping_add(step as usize);
        let (cold, cold_usable) = Self::believed(images, cold, strangers, damaged);
        let (hot, hot_usable) = Self::believed(images, hot, strangers, damaged);
        let usable = cold_usable & hot_usable;

        // Both are made every time: a branch would save one of them now and then.
        let number = blend_number(cold, hot, self.warm);
        let pair = blend_halves(cold, hot, (self.warm * 16_384.0) as i32);
        let value = pair ^ (pair ^ number) & (is_number as u32).wrapping_neg();
        Fresh { value, usable }
    }
}

/// A source with its sums.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SealedSource {
    pub source: ImageSource,
    pub sums: [u32; 2],
}

impl SealedSource {
    /// Without a table: all zeros.
    pub const EMPTY: Self = Self { source: ImageSource::EMPTY, sums: [0; 2] };

    #[inline(always)]
    pub const fn is_whole(&self) -> bool {
        same(pair(self.source.sums()), self.sums)
    }
}

bits_of!(ImageSource {
    plan,
    torque_range,
    warm,
    last_torque,
    marks,
    used,
    nodes_from,
    records_from,
    record,
    nodes_ahead,
    records_ahead,
    node_plane,
    record_plane,
    body,
    seal_at,
    seal,
    drive,
});
bits_of!(SealedSource { source, sums });
