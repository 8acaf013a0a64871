//! What a step needs of a table besides the copies, and where the words of the copies come from.

use crate::table::{NODE_WORDS, Plan, Table, halves, ripple_row, word, word_at};

/// A copy starts with the torque axis; what comes before it in an image is in the store otherwise.
pub(super) const FIRST: usize = word::TORQUE_NODES;

/// What a step needs besides the copies, and where the words of the copies come from. What must not change unnoticed: all of it is
/// summed up.
///
/// A copy holds the words of an image from the torque axis on, but nodes and records at one temperature only.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub(super) struct Source {
    pub plan: Plan,
    pub torque_range: [f32; 2],
    /// The way from the lower temperature node to the next, 0 to 1.
    pub warm: f32,
    /// The last torque interval, and whether the temperature is within the range.
    pub last_torque: u16,
    pub temperature_in_range: u16,
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
}

impl Source {
    /// Of all numbers: what must not change unnoticed.
    #[inline(never)]
    pub fn sum(&self) -> u32 {
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
