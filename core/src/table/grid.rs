//! Where table node *i* sits. The only definition: the projection, the image check and the control step all call it.
//!
//! * Periodic axis, `n` nodes: node *i* sits at *i/n* of a period, for a phase in 2⁻³² of the period.
//! * Clamped axis: strictly increasing nodes of any spacing; beyond its ends the end value holds. Two nodes may nearly
//!   coincide to represent a jump between them.
//!
//! Curves on a periodic axis are uniform quadratic B-splines, `curve(t) = Σ wᵢ(t)·cᵢ` over the three nodes around `t`.
//! The weights are never negative and add up to one, so a curve stays between its smallest and largest coefficient, its
//! slope below `n·max|cᵢ₊₁ − cᵢ|` and its second derivative at most `n²·max|cᵢ₊₁ − 2cᵢ + cᵢ₋₁|` per period: the image
//! check bounds every value a curve can take from its coefficients alone. Value and slope are continuous across cells
//! and across the wrap. Coefficients are not curve values: at a node the curve is `(cᵢ₋₁ + 6cᵢ + cᵢ₊₁)/8`.
//!
//! Interpolation error for a harmonic with `m` nodes to its period, `h = 2π/m`: `h³·(1 + h²/3)/122` of its amplitude
//! (asserted in the tests): 5.1e-4 for 16 nodes, 4.6e-3 for 8, 5.6e-2 for 4. (A cubic would have a quarter of that for
//! a third more reading; what is read is also compared between two copies, and that is most of a control step.)

/// Most nodes a clamped axis may have.
pub const MAX_CLAMPED_NODES: usize = 1 << MAX_HALVINGS;
/// Comparisons that find a place among [`MAX_CLAMPED_NODES`].
pub const MAX_HALVINGS: u32 = 6;
/// Fewest nodes of a periodic axis that is present.
pub const MIN_PERIODIC_NODES: usize = 4;
/// Most nodes of a periodic axis.
pub const MAX_PERIODIC_NODES: usize = 128;

/// A place on a periodic axis: a cell that reaches half a spacing to either side of a node, and how far into it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cell {
    /// The node in the middle; the number of nodes for the first half of the first cell, beyond the wrap. Also where
    /// the three coefficients around the place start in a stored curve ([`PeriodicAxis::stored_node`]).
    pub node: usize,
    /// How far from the start of the cell, in 2⁻³² of the spacing.
    pub fraction: u32,
}

impl Cell {
    /// Where `phase` lies among `nodes`.
    pub(crate) const fn at(nodes: u32, phase: u32) -> Self {
        let scaled = (phase as u64).wrapping_mul(nodes as u64).wrapping_add(1 << 31);
        Self { node: (scaled >> 32) as usize, fraction: scaled as u32 }
    }

    /// B-spline weights of the three nodes around the place, each ≥ 0, together 1 to 1.2e-7.
    #[must_use]
    pub fn weights(self) -> [f32; 3] {
        let t = self.fraction as f32 * (1.0 / 4_294_967_296.0);
        let s = 1.0 - t;
        [0.5 * s * s, 0.5 + s * t, 0.5 * t * t]
    }

    /// These weights in 2⁻¹⁵, each within 3 units, together exactly 2¹⁵: for the integers of the control step.
    #[must_use]
    pub const fn weights_q15(self) -> [i32; 3] {
        let t = self.fraction >> 17;
        let s = 0x8000u32.wrapping_sub(t);
        let (first, last) = (s.wrapping_mul(s) >> 16, t.wrapping_mul(t) >> 16);
        [first as i32, 0x8000u32.wrapping_sub(first).wrapping_sub(last) as i32, last as i32]
    }
}

/// Nodes spread evenly over one period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PeriodicAxis {
    nodes: u8,
}

impl PeriodicAxis {
    /// An axis that is absent.
    pub(crate) const NONE: Self = Self { nodes: 0 };

    /// An axis of `nodes` nodes; `None` unless 0 (absent) or 4 to 128.
    #[must_use]
    pub fn new(nodes: usize) -> Option<Self> {
        let allowed = nodes == 0 || (MIN_PERIODIC_NODES..=MAX_PERIODIC_NODES).contains(&nodes);
        if allowed { Some(Self { nodes: nodes as u8 }) } else { None }
    }

    /// Number of nodes; 0 for a part that is absent.
    #[must_use]
    pub const fn len(self) -> usize {
        self.nodes as usize
    }

    /// Whether the part is absent.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.nodes == 0
    }

    /// Where `phase` lies. One 32×32 multiplication, no division, no loop over data.
    #[must_use]
    pub const fn locate(self, phase: u32) -> Cell {
        Cell::at(self.nodes as u32, phase)
    }

    /// The three nodes around a place, in the order of the weights.
    #[must_use]
    pub fn around(self, cell: Cell) -> [usize; 3] {
        [0, 1, 2].map(|step| self.stored_node(cell.node.saturating_add(step)))
    }

    /// Length of a stored curve: its nodes and three repeated, so that the three around any place are neighbours.
    #[must_use]
    pub const fn stored_len(self) -> usize {
        if self.nodes == 0 { 0 } else { self.len().saturating_add(3) }
    }

    /// The node at position `position` of a stored curve: the last node, all nodes, the first two.
    #[must_use]
    pub fn stored_node(self, position: usize) -> usize {
        position.saturating_add(self.len()).saturating_sub(1).checked_rem(self.len()).unwrap_or(0)
    }
}

bits_of!(PeriodicAxis { nodes });

/// A place on a clamped axis: between node `below` and node `above`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ClampedCell {
    /// The node at or below.
    pub below: usize,
    /// The next node; the same one if the axis has only one.
    pub above: usize,
    /// Weight of `above`, 0 to 1; `below` has the rest.
    pub weight: f32,
}

/// Finds `value` among `len` increasing nodes, at most 2 to the power of `HALVINGS`.
///
/// Always `HALVINGS` comparisons, whatever the data; the weight costs one division. NaN is placed at the first node.
pub fn locate_clamped<const HALVINGS: u32>(len: usize, node: impl Fn(usize) -> f32, value: f32) -> ClampedCell {
    let last_interval = len.saturating_sub(2);
    let mut below = 0usize;
    let mut step = 1usize << HALVINGS;
    for _ in 0..HALVINGS {
        step >>= 1;
        let candidate = below.wrapping_add(step);
        if candidate <= last_interval && node(candidate) <= value {
            below = candidate;
        }
    }
    let above = if len > 1 { below.wrapping_add(1) } else { below };
    let (low, high) = (node(below), node(above));
    let along = (value - low) / (high - low);
    // Also takes the NaN of an axis with one node, and of a NaN value, to 0.
    // (Comparisons, not `min` and `max`: those are library calls on a Cortex-M4F.)
    let positive = if along > 0.0 { along } else { 0.0 };
    let weight = if positive < 1.0 { positive } else { 1.0 };
    ClampedCell { below, above, weight: if above == below { 0.0 } else { weight } }
}

/// The interval that holds `value` among starts padded with a larger number to twice the first of `steps`, which halve
/// down to 1: the last start at or below it, or the first.
///
/// One comparison for each step, whatever the data. As [`locate_clamped`] finds it, for the control step.
pub(crate) fn search<const N: usize>(steps: [usize; N], start: impl Fn(usize) -> f32, value: f32) -> usize {
    steps.into_iter().fold(0, |found, step| if start(found | step) <= value { found | step } else { found })
}

/// An interval is a jump when both neighbours (or the only one) are at least this many times as wide.
pub const JUMP_RATIO: f32 = 8.0;

/// Which intervals of a clamped axis are jumps; bit *i* stands for the interval above node *i*.
///
/// Decided once, when a table is accepted.
pub fn jump_intervals(len: usize, node: impl Fn(usize) -> f32) -> u64 {
    let intervals = len.saturating_sub(1).min(MAX_CLAMPED_NODES);
    (0..intervals).fold(0, |jumps, i| jumps | (jump_at(i, len, &node) as u64).checked_shl(i as u32).unwrap_or(0))
}

/// Whether the interval above node `i` of this number of nodes is one of them.
pub(crate) fn jump_at(i: usize, len: usize, node: impl Fn(usize) -> f32) -> bool {
    let width = |i: usize| node(i.saturating_add(1)) - node(i);
    let intervals = len.saturating_sub(1).min(MAX_CLAMPED_NODES);
    let own = width(i) * JUMP_RATIO;
    let left_wide = i == 0 || width(i.saturating_sub(1)) >= own;
    let right_wide = i.saturating_add(1) == intervals || width(i.saturating_add(1)) >= own;
    i < intervals && intervals > 1 && left_wide && right_wide
}

/// Whether bit `node` of [`jump_intervals`] is set.
pub fn is_jump(jumps: u64, node: usize) -> bool {
    u32::try_from(node).ok().and_then(|bit| jumps.checked_shr(bit)).is_some_and(|bits| bits & 1 == 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn evaluate(axis: PeriodicAxis, coefficients: &[f64], phase: u32) -> f64 {
        let cell = axis.locate(phase);
        axis.around(cell).iter().zip(cell.weights()).map(|(&node, weight)| coefficients[node] * weight as f64).sum()
    }

    #[test]
    fn every_node_is_found_where_it_is_said_to_sit() {
        for n in 4..=MAX_PERIODIC_NODES {
            let axis = PeriodicAxis::new(n).unwrap();
            for node in 0..n {
                // The middle of its cell, rounded up.
                let phase = ((node as u64) << 32).div_ceil(n as u64) as u32;
                let cell = axis.locate(phase);
                assert_eq!(axis.around(cell)[1], node, "{n} nodes");
                assert!((cell.weights()[1] - 0.75).abs() < 1e-6 && (cell.weights()[0] - 0.125).abs() < 1e-6);
                let far = phase.wrapping_add((u32::MAX / n as u32) / 2 + n as u32);
                assert_eq!(axis.around(axis.locate(far))[1], (node + 1) % n, "{n} nodes, half a cell on");
            }
        }
    }

    #[test]
    fn a_harmonic_is_interpolated_to_the_stated_error() {
        use core::f64::consts::TAU;
        for (n, order) in [(16, 1), (16, 2), (8, 1), (64, 3), (8, 2)] {
            let axis = PeriodicAxis::new(n).unwrap();
            let step = TAU * order as f64 / n as f64;
            let gain = 4.0 / (3.0 + step.cos());
            let coefficients: Vec<f64> = (0..n).map(|i| gain * (step * i as f64).cos()).collect();
            let mut worst: f64 = 0.0;
            for i in 0..10_000u32 {
                let phase = i.wrapping_mul(429_497);
                let exact = (TAU * order as f64 * phase as f64 / 4_294_967_296.0).cos();
                worst = worst.max((evaluate(axis, &coefficients, phase) - exact).abs());
            }
            let stated = step.powi(3) * (1.0 + step * step / 3.0) / 122.0;
            assert!(worst < 1.05 * stated + 2e-7, "{n} nodes, order {order}: {worst:e} > {stated:e}");
            assert!(worst > 0.9 * stated, "the stated error is far too large: {worst:e} {stated:e}");
        }
    }

    #[test]
    fn a_curve_is_smooth_across_the_wrap() {
        let axis = PeriodicAxis::new(5).unwrap();
        let coefficients = [1.0, -2.0, 0.5, 3.0, -1.0];
        let at_wrap = evaluate(axis, &coefficients, 0);
        assert!((evaluate(axis, &coefficients, u32::MAX) - at_wrap).abs() < 1e-6);
        let h = 1 << 20;
        let slope_after = evaluate(axis, &coefficients, h) - at_wrap;
        let slope_before = at_wrap - evaluate(axis, &coefficients, h.wrapping_neg());
        assert!((slope_after - slope_before).abs() < 0.02 * slope_after.abs(), "{slope_before} {slope_after}");
    }

    #[test]
    fn nearly_coincident_nodes_are_jumps_and_ordinary_spacing_is_not() {
        let nodes = [-10.0, -1.001, -0.999, 0.0, 0.999, 1.001, 10.0];
        assert_eq!(jump_intervals(nodes.len(), |i| nodes[i]), 0b01_0010);
        let geometric = [0.0, 1.0, 2.0, 4.0, 10.0, 50.0];
        assert_eq!(jump_intervals(geometric.len(), |i| geometric[i]), 0);
        assert_eq!(jump_intervals(2, |i| geometric[i]), 0);
        assert_eq!(jump_intervals(1, |i| geometric[i]), 0);
        // What lies beyond the last node is no interval, however narrow.
        let beyond = [0.0, 10.0, 20.0, 20.1, 30.0];
        assert!(!jump_at(2, 3, |i| beyond[i]) && jump_at(2, 5, |i| beyond[i]));
    }

    #[test]
    fn sizes_outside_the_limits_have_no_axis() {
        for n in [1, 2, 3, 129, 256, 260] {
            assert_eq!(PeriodicAxis::new(n), None);
        }
        assert!(PeriodicAxis::new(0).unwrap().is_empty());
        let _ = PeriodicAxis::new(0).unwrap().locate(u32::MAX);
    }

    proptest! {
        #[test]
        fn weights_are_a_partition_of_unity(phase in any::<u32>(), n in 4usize..=128) {
            let axis = PeriodicAxis::new(n).unwrap();
            let cell = axis.locate(phase);
            let coarse = cell.weights_q15();
            prop_assert_eq!(coarse.iter().sum::<i32>(), 32_768);
            for (coarse, fine) in coarse.into_iter().zip(cell.weights()) {
                prop_assert!(
                    coarse >= 0 && (coarse as f32 - fine * 32_768.0).abs() <= 3.0, "{} {}", coarse, fine * 32_768.0,
                );
            }
            prop_assert!(cell.weights().iter().all(|&w| (0.0..=0.75).contains(&w)), "{:?}", cell);
            prop_assert!((cell.weights().iter().sum::<f32>() - 1.0).abs() < 3e-7);
            prop_assert!(axis.around(cell).iter().all(|&i| i < n));
        }

        #[test]
        fn a_place_reproduces_the_value_it_was_asked_for(
            mut nodes in prop::collection::vec(-100.0f32..100.0, 1..=MAX_CLAMPED_NODES), value in -120.0f32..120.0,
        ) {
            nodes.sort_by(f32::total_cmp);
            nodes.dedup();
            let place = locate_clamped::<MAX_HALVINGS>(nodes.len(), |i| nodes[i], value);
            let found = nodes[place.below] * (1.0 - place.weight) + nodes[place.above] * place.weight;
            let clamped = value.clamp(nodes[0], nodes[nodes.len() - 1]);
            prop_assert!((found - clamped).abs() < 1e-4, "{} {}", found, clamped);
            let inside = nodes[place.below] <= clamped && clamped <= nodes[place.above];
            prop_assert!(inside);
            let start = |i: usize| nodes.get(i).copied().unwrap_or(f32::MAX);
            let step = search([32, 16, 8, 4, 2, 1], start, clamped).min(nodes.len().saturating_sub(2));
            prop_assert_eq!(step, place.below);
            if nodes.len() <= 8 {
                prop_assert_eq!(search([4, 2, 1], start, clamped).min(nodes.len().saturating_sub(2)), place.below);
            }
        }
    }
}
