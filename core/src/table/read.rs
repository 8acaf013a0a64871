//! A table at a located point: its curves, its ripple, the play they make, and the generator angle that meets an
//! output.

use super::Table;
use super::grid::{self, Cell};
use super::image::{NODE_WORDS, word};
use super::memory::{CELL, Doubt, Memory};
use super::point::{OperatingPoint, TorquePlace};
use super::words::{blend_number, f32_at, halves};
use crate::drive::Phases;
use crate::num::{finite, sqrt, within};

/// Centre and half-width of the play at a generator position, counts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Play {
    pub centre: i32,
    pub half: i32,
    /// Inside what an accepted table can give.
    pub sane: bool,
}

/// `a·b/2³²`, rounded down.
#[inline(always)]
const fn mul_high(a: i32, b: i32) -> i32 {
    ((a as i64).wrapping_mul(b as i64) >> 32) as i32
}

/// `Σ coefficients·weights/2¹⁶`, for weights in 2⁻¹⁵.
#[inline(always)]
const fn weighed([a, b, c]: [i32; 3], [first, second, third]: [i32; 3]) -> i32 {
    mul_high(a, first << 16).wrapping_add(mul_high(b, second << 16)).wrapping_add(mul_high(c, third << 16))
}

/// Locates a torque (N·m) and temperature (°C). The same work for all values; those that are not finite give the lower
/// end of the range and are marked.
pub(crate) fn locate(table: &Table<'_>, torque_n_m: f32, temperature_c: f32) -> OperatingPoint {
    let mut doubt = Doubt::default();
    let [torque_least, torque_most, least, most] = table.words(word::TORQUE_RANGE, &mut doubt).map(f32::from_bits);
    let torque = within(torque_n_m, [torque_least, torque_most]);
    let [last, nodes, records, steps] = table.words(word::CELL_WIDTH.wrapping_add(1), &mut doubt);
    let [last_temperature, last_torque] = halves(last);
    let [node_plane, nodes] = halves(nodes);
    let [record_plane, records] = halves(records);
    let [_, record_step] = halves(steps);

    let number = |i: usize| f32_at(table.words, i);
    let interval =
        grid::search([32, 16, 8, 4, 2, 1], |i| number(word::TORQUE_NODES.wrapping_add(i)), torque).min(last_torque);
    let [low, high] = table.words(word::TORQUE_NODES.wrapping_add(interval), &mut doubt).map(f32::from_bits);
    let temperature = within(temperature_c, [least, most]);
    let plane =
        grid::search([4, 2, 1], |i| number(word::TEMPERATURE_NODES.wrapping_add(i)), temperature).min(last_temperature);
    let [cold, hot] = table.words(word::TEMPERATURE_NODES.wrapping_add(plane), &mut doubt).map(f32::from_bits);
    let warm = (temperature - cold) / (hot - cold);

    let at = nodes.wrapping_add(plane.wrapping_mul(node_plane)).wrapping_add(interval.wrapping_mul(NODE_WORDS));
    let here: [u32; 2 * NODE_WORDS] = table.words(at, &mut doubt);
    let there: [u32; 2 * NODE_WORDS] = table.words(at.wrapping_add(node_plane), &mut doubt);
    let [_, _, flagged, ..] = here;
    let blend = |cold: u32, hot: u32| f32::from_bits(blend_number(cold, hot, warm));
    let [c0, c1, c2, c3, c4, c5] = here;
    let [h0, h1, h2, h3, h4, h5] = there;
    let around = [[blend(c0, h0), blend(c1, h1), blend(c2, h2)], [blend(c3, h3), blend(c4, h4), blend(c5, h5)]];
    let width = high - low;
    // 0 in the endless width that an axis of one node has. The last bit of H shows whether the interval above is a
    // jump.
    let place = TorquePlace { weight: (torque - low) / width, width, jump: flagged & 1 != 0 };
    let first_record =
        records.wrapping_add(plane.wrapping_mul(record_plane)).wrapping_add(interval.wrapping_mul(record_step));
    let marks = (finite(torque_n_m) & finite(temperature_c), (torque == torque_n_m) & (temperature == temperature_c));
    let rows = [first_record, first_record.wrapping_add(record_step)].map(|words: usize| words.wrapping_mul(2));
    let hotter = (record_plane.wrapping_mul(2), (warm * 16_384.0) as i32);
    OperatingPoint::new(place, around, rows, hotter, marks, doubt)
}

impl Table<'_> {
    /// Locates a torque (N·m) and temperature (°C); `None` if either is not finite.
    #[must_use]
    pub fn at(&self, torque_n_m: f32, temperature_c: f32) -> Option<OperatingPoint> {
        Some(locate(self, torque_n_m, temperature_c)).filter(|point| point.finite)
    }
}

#[inline(always)]
const fn low(word: u32) -> i32 {
    word as i16 as i32
}

#[inline(always)]
const fn high(word: u32) -> i32 {
    word as i32 >> 16
}

/// A + B + C at these phases, counts.
#[inline(never)]
pub(crate) fn curves_at<M: Memory>(memory: &M, phases: Phases, doubt: &mut Doubt) -> i32 {
    let mut sum = 0i32;
    for (curve, phase) in memory.plan().curves.into_iter().zip([phases.generator, phases.material, phases.output]) {
        let [nodes, at] = halves(curve);
        // The same way for every call with this table: it has the curve or not.
        if nodes > 0 {
            let cell = Cell::at(nodes as u32, phase);
            let coefficients = memory.words(at.wrapping_add(cell.node), doubt).map(|word| word as i32);
            // Coefficients in half counts make up for the weights in half units.
            sum = sum.wrapping_add(weighed(coefficients, cell.weights_q15()));
        }
    }
    sum
}

/// The ripple of forward and of backward motion at this phase of the tooth pitch, counts.
#[inline(always)]
fn ripple_at<M: Memory>(memory: &M, point: &OperatingPoint, tooth: u32, doubt: &mut Doubt) -> (i32, i32) {
    let plan = memory.plan();
    let cell = Cell::at(plan.ripple_nodes, tooth);
    let [before, at, after] = cell.weights_q15().map(|weight| weight as i16 as i32);
    let backward_row = plan.row();
    let (mut forward, mut backward) = (0i32, 0i32);
    for (row, share) in point.rows.into_iter().zip(point.shares) {
        let first = row.wrapping_add(cell.node);
        for (sum, place) in [(&mut forward, first), (&mut backward, first.wrapping_add(backward_row))] {
            let [a, b] = memory.halves(place, point.hotter, doubt);
            // |Σ| ≤ 2¹⁵·2¹⁵: the weights add up to 2¹⁵; 2¹³ of it to a unit.
            let own = low(a).wrapping_mul(before).wrapping_add(high(a).wrapping_mul(at));
            let own = own.wrapping_add(low(b).wrapping_mul(after));
            *sum = sum.wrapping_add(mul_high(own, share));
        }
    }
    (mul_high(forward, plan.ripple_unit as i32), mul_high(backward, plan.ripple_unit as i32))
}

/// Centre and half-width of the play at a located point and these phases. The same work for all phases.
#[inline(always)]
pub(crate) fn play_at<M: Memory>(memory: &M, point: &OperatingPoint, phases: Phases, doubt: &mut Doubt) -> Play {
    let plan = memory.plan();
    let (mut centre, mut half) = (point.mean, point.half_width);
    if plan.ripple_nodes > 0 {
        let (forward, backward) = ripple_at(memory, point, phases.tooth, doubt);
        centre = centre.wrapping_add(forward.wrapping_add(backward) >> 1);
        half = half.wrapping_add(backward.wrapping_sub(forward) >> 1);
    }
    if plan.has_curves() {
        centre = centre.wrapping_add(curves_at(memory, phases, doubt));
    }
    // Not negative but for rounding: the image check bounds it.
    let half = if half < 0 { 0 } else { half };
    Play { centre, half, sane: point.allows(plan, centre, half) }
}

/// How far from a place the solution of `x + ripple(x) = place` is, 2⁻²⁴ cells. The same work for all places.
///
/// `tooth` is the phase at a guess that is `ahead` of the place, 2⁻²⁴ cells. Within a cell of the guess the answer is
/// exact: in the cell around the node next to the guess, or that before or after it, whichever has the solution between
/// its ends, it is the root of a parabola. `x + ripple` grows steadily, so what is further away is at least the end of
/// these that is given.
#[inline(always)]
pub(crate) fn to_solution<M: Memory>(
    memory: &M,
    point: &OperatingPoint,
    (tooth, ahead): (u32, i32),
    backward: bool,
    doubt: &mut Doubt,
) -> i32 {
    let plan = memory.plan();
    let cell = Cell::at(plan.ripple_nodes, tooth);
    let node = if cell.node == 0 { plan.ripple_nodes as usize } else { cell.node };
    let row_of_side = plan.row() & (backward as usize).wrapping_neg();
    // Two nodes before and two after, which a stored ripple has for all but the first.
    let first = node.wrapping_sub(1).wrapping_add(row_of_side);
    let mut sums = [0i32; 5];
    for (row, share) in point.rows.into_iter().zip(point.shares) {
        let [a, b, c] = memory.halves(row.wrapping_add(first), point.hotter, doubt);
        for (sum, ripple) in sums.iter_mut().zip([low(a), high(a), low(b), high(b), low(c)]) {
            *sum = sum.wrapping_add(ripple.wrapping_mul(share >> 16));
        }
    }
    let cells = sums.map(|sum| mul_high(sum, plan.ripple_cells));
    let [_, b, c, d, _] = cells;
    // All from here on in 2⁻²⁴ cells from the node: the place, and what is missing at either end of the cell.
    let place = ((cell.fraction ^ 0x8000_0000) as i32 >> 8).wrapping_sub(ahead);
    let missing = |a: i32, b: i32| (a.wrapping_add(b) >> 1).wrapping_sub(place);
    // 0 the cell before, 1 that of the node, 2 the one after. An index, not choices: the compiler makes branches of
    // choices.
    let which = (missing(b, c) <= CELL / 2) as usize;
    let which = which.wrapping_add((missing(c, d) <= -CELL / 2) as usize);
    let [a, b, c] = cells.get(which..).and_then(|cells| cells.first_chunk::<3>()).copied().unwrap_or([0; 3]);
    let start = (which as i32).wrapping_mul(CELL).wrapping_sub(CELL / 2 * 3);
    let start = start.wrapping_sub(place);
    // missing + t·linear + t²·bend/2 = 0 from the start of the cell on.
    let linear = CELL.wrapping_add(b.wrapping_sub(a)) as f32;
    let bend = a.wrapping_sub(b).wrapping_add(c.wrapping_sub(b)) as f32;
    let missing = (a.wrapping_add(b) >> 1).wrapping_add(start) as f32;
    let twice = missing + missing;
    let root = twice / (linear + sqrt::<3>(linear * linear - bend * twice));
    let along = (root * -(CELL as f32)) as i32;
    let along = if along > 0 { along } else { 0 };
    let along = if along < CELL { along } else { CELL };
    start.wrapping_add(along)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{Drive, FixedMember};
    use crate::table::{PointPlan, ripple_row};
    use proptest::prelude::*;
    use std::vec::Vec;

    /// A record of one ripple for both torques.
    struct Record {
        halves: Vec<i16>,
        plan: PointPlan,
    }

    impl Memory for Record {
        fn plan(&self) -> &PointPlan {
            &self.plan
        }

        fn words<const N: usize>(&self, _: usize, _: &mut Doubt) -> [u32; N] {
            [0; N]
        }

        fn halves<const N: usize>(&self, at: usize, _: (usize, i32), _: &mut Doubt) -> [u32; N] {
            let half = |i: usize| self.halves.get(at + i).map_or(0, |half| *half as u16 as u32);
            core::array::from_fn(|i| half(2 * i) | half(2 * i + 1) << 16)
        }
    }

    /// The ripple in cells at a place in cells.
    fn ripple(cells: &[f64], place: f64) -> f64 {
        let node = (place + 0.5).floor();
        let (t, n) = (place + 0.5 - node, cells.len() as f64);
        let at = |i: f64| cells[i.rem_euclid(n) as usize];
        let (a, b, c) = (at(node - 1.0), at(node), at(node + 1.0));
        0.5 * a * (1.0 - t) * (1.0 - t) + b * (0.5 + t * (1.0 - t)) + 0.5 * c * t * t
    }

    proptest! {
        /// Within a cell of the guess the root is exact; what is further away is approached by a cell at least.
        #[test]
        fn a_solution_is_found_in_the_cells_around_a_guess(
            steps in prop::collection::vec(-0.95f64..0.95, 4..=32), size in 0.01f64..1.0,
            place in 0.0f64..1.0, off in -3.0f64..3.0, reversed: bool, weight in 0.0f32..1.0,
        ) {
            // Coefficients whose steps are below a cell, so that place + ripple grows.
            let n = steps.len();
            let mean = steps.iter().sum::<f64>() / n as f64;
            let mut cells: Vec<f64> = Vec::new();
            let mut sum = 0.0;
            for step in &steps {
                sum += (step - mean) * size / (1.0 + mean.abs());
                cells.push(sum);
            }
            let largest = cells.iter().fold(1e-3, |most: f64, c| most.max(c.abs()));
            prop_assume!(largest < 15.0);
            let fixed = if reversed { FixedMember::CircularSpline } else { FixedMember::Flexspline };
            let width = Drive::new(188, 190, fixed).unwrap().tooth_periods().recip() / n as f32 * 4_294_967_296.0;
            // Units that the largest coefficient has 32767 of, signed like the ratio.
            let unit = (largest * width.abs() as f64 * 524_288.0 / 32_766.0) as u32;
            let row = ripple_row(n);
            let half = |position: usize| {
                let cell = cells[(position + n - 1) % n] * width.signum() as f64;
                (cell * width.abs() as f64 * 524_288.0 / unit as f64).round() as i16
            };
            let mut halves = std::vec![0x7abc; row];
            halves.extend((0..row).map(half));
            let plan = PointPlan {
                ripple_nodes: n as u32,
                ripple_cells: (unit as f64 * 8_388_608.0 / width as f64) as i32,
                cell_width: width,
                ..PointPlan::default()
            };
            let record = Record { halves, plan };
            let place_of = TorquePlace { weight, width: 1.0, jump: false };
            let point = OperatingPoint::new(place_of, [[0.0; 3]; 2], [0; 2], (0, 0), (true, true), Doubt(0));

            // Where x + ripple(x) = place: by bisection.
            let place = place * n as f64;
            let (mut low, mut high) = (place - 2.0 * largest - 1.0, place + 2.0 * largest + 1.0);
            for _ in 0..60 {
                let x = 0.5 * (low + high);
                if x + ripple(&cells, x) > place { high = x } else { low = x }
            }
            let guess = low + off;
            let phase = ((guess / n as f64).rem_euclid(1.0) * 4_294_967_296.0) as u32;
            let ahead = ((guess - place) * CELL as f64) as i32;
            let found = to_solution(&record, &point, (phase, ahead), true, &mut Doubt(0)) as f64 / CELL as f64 + place;
            if off.abs() < 0.999 {
                // Rounding of coefficients, seen through the slope of x + ripple.
                let step = |i: usize| (cells[(i + 1) % n] - cells[i]).abs();
                let slope = 1.0 - (0..n).fold(0.0, |most: f64, i| most.max(step(i)));
                let allowed = (largest / 16_000.0 + 2e-6) / slope + 1e-6;
                prop_assert!((found - low).abs() < allowed, "{} {} of {}, {}", found, low, place, allowed);
            } else {
                prop_assert!(
                    (found - low).abs() < off.abs() - 0.95 && (found - low) * off >= -1e-2, "{} {}", found - low, off,
                );
            }
        }
    }
}
