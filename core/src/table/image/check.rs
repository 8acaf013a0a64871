//! Checking an image: every number, and what the table can give at most, before any of it is used.

use super::header::{check_envelope, check_identity};
use super::layout::{
    DERIVED_WORDS, Layout, MAX_AXIS_VALUE, MAX_ERROR_RAD, MAX_RIPPLE_NODES, MAX_TEMPERATURE_NODES, NODE_WORDS,
    PAGE_BYTES, UNITS_PER_COUNT, cell_width, counted, image_bytes, limit_counts, word,
};
use super::sums::page_intact;
use crate::angle::RAD_PER_COUNT;
use crate::error::{Field, ImageError};
use crate::num::{self, larger};
use crate::table::bounds::{Bounds, HOLD_COUNTS, InverseBound, MAX_INVERSE_ERROR_RAD};
use crate::table::grid::{self, MAX_CLAMPED_NODES, MAX_PERIODIC_NODES, MIN_PERIODIC_NODES, PeriodicAxis};
use crate::table::words::{Words, f32_at, halves, word_at};
use crate::table::{GeneratorKind, Table};
use core::f64::consts::TAU;

/// Half-widths may miss zero by this, counts, and the ripple unit: rounding.
const HALF_WIDTH_ROUNDING_COUNTS: f64 = 3.0;
/// The error of a flank may lie so far below what it was at a smaller torque, rad, 10″: noise of a table that was measured, and cubics
/// that swing. Chosen; the tables of the four generators never fall at their nodes, and swing by 5e-6 between them.
const FALL_RAD: f32 = 5.0e-5;
/// The softest drive that is believed, rad/N·m. Chosen: a hundred times the compliance of size 5 in catalogues (some 1e-2), five hundred
/// times the steepest place in a table of contact FEM (two-roller at no load, 5e-4; with friction learnt 1.9e-3).
const MAX_COMPLIANCE_RAD_PER_N_M: f32 = 1.0;
/// Largest ripple unit for each count of a cell: a ripple of 15.9 cells.
const MAX_UNITS_PER_CELL: f32 = 255.0;
/// How far B-spline weights of 15 bits can be off, times the largest step between coefficients: one unit for the place in the
/// cell and one for each of the two weights that are rounded.
const WEIGHT_ROUNDING: f32 = 3.0 / 32_768.0;

fn finite(field: Field, index: usize, value: f32) -> Result<f32, ImageError> {
    if value.is_finite() { Ok(value) } else { Err(ImageError::NotFinite { field, index }) }
}

fn in_range(field: Field, index: usize, found: f32, least: f32, most: f32) -> Result<f32, ImageError> {
    finite(field, index, found)?;
    if found >= least && found <= most { Ok(found) } else { Err(ImageError::OutOfRange { field, found, least, most }) }
}

/// The nodes increase and what follows is padding.
fn check_axis(field: Field, words: Words<'_>, first: usize, nodes: usize, slots: usize) -> Result<(), ImageError> {
    let mut before = f32::NEG_INFINITY;
    for index in 0..slots {
        let at = first.saturating_add(index);
        if index >= nodes {
            derived_is(words, at, f32::MAX.to_bits())?;
            continue;
        }
        let node = in_range(field, index, f32_at(words, at), -MAX_AXIS_VALUE, MAX_AXIS_VALUE)?;
        if node <= before {
            return Err(ImageError::NotIncreasing { field, index });
        }
        before = node;
    }
    Ok(())
}

/// Whether a word is what it must be.
fn derived_is(words: Words<'_>, at: usize, value: u32) -> Result<(), ImageError> {
    if word_at(words, at) == value { Ok(()) } else { Err(ImageError::Derived { offset: at.saturating_mul(4) }) }
}

/// A range must lie inside the axis; an axis of one node holds wherever its maker says.
fn check_range(field: Field, words: Words<'_>, at: usize, first: usize, nodes: usize) -> Result<(), ImageError> {
    let [least, most] = [0, 1].map(|end: usize| f32_at(words, at.saturating_add(end)));
    let (mut from, mut to) = (-MAX_AXIS_VALUE, MAX_AXIS_VALUE);
    if nodes > 1 {
        (from, to) = (f32_at(words, first), f32_at(words, first.saturating_add(nodes).saturating_sub(1)));
    }
    in_range(field, 0, least, from, to)?;
    in_range(field, 1, most, least, to)?;
    Ok(())
}

/// What a closed B-spline has at most: coefficient, slope per node spacing, value. Coefficients bound values too, and are simpler
/// to blend; values tell how far the curve really goes.
fn extremes(stored: usize, value: impl Fn(usize) -> f32) -> [f32; 3] {
    let mut most = [0.0; 3];
    for i in 0..stored.saturating_sub(2) {
        let [largest, steepest, reached] = most;
        let (a, b, c) = (value(i), value(i.saturating_add(1)), value(i.saturating_add(2)));
        // A parabola from (a + b)/2 to (b + c)/2; its top, if inside, where the slope b − a + t·(a − 2b + c) vanishes.
        let turn = (a - b) / (a - 2.0 * b + c);
        let top = 0.5 * (a + b) + 0.5 * turn * (b - a);
        let top = if turn > 0.0 && turn < 1.0 { top.abs() } else { 0.0 };
        most = [
            larger(largest, a.abs()),
            larger(steepest, (b - a).abs()),
            larger(reached, larger(top, 0.5 * (a + b).abs())),
        ];
    }
    most
}

/// Half word `index` of a record.
#[inline(never)]
fn half_at(record: Words<'_>, index: usize) -> i16 {
    let word = word_at(record, index / 2);
    (if index.is_multiple_of(2) { word } else { word >> 16 }) as i16
}

/// Whether the three repeated words of a stored curve equal the nodes they repeat.
fn check_closed(field: Field, axis: PeriodicAxis, words: Words<'_>) -> Result<(), ImageError> {
    let word = |position: usize| words.get(position);
    for index in 0..axis.stored_len() {
        // Node i is stored at position i + 1.
        if word(index) != word(axis.stored_node(index).saturating_add(1)) {
            return Err(ImageError::NotClosed { field, index });
        }
    }
    Ok(())
}

/// Counts in radians.
fn rad(counts: f32) -> f32 {
    counts * RAD_PER_COUNT
}

impl<'a> Table<'a> {
    /// Checks an image and gives the table in it. Nothing of an image can be used before.
    ///
    /// Verified: length, magic, version, byte order, CRC-32 of the whole and of every page, texts, tooth counts, node
    /// counts; every number finite; axes strictly increasing; half-width of the play ≥ 0 everywhere; torque intervals that
    /// meet at their nodes; wind-up that grows with the load on both flanks, and no faster than a drive can; the largest error the table can give within its stated limit and [`MAX_ERROR_RAD`];
    /// `|ratio·de/dψ| < 1` everywhere, so that the inverse exists, and how it converges; periodic parts closed at the wrap;
    /// every offset, unit and bound that follows from other numbers.
    ///
    /// Bounds hold for every input, not only at nodes: a B-spline stays within its coefficients, and what the cubic of the
    /// wind-up departs from the straight line between two nodes counts in full.
    ///
    /// Two passes over the image and its CRC-32 twice, once per upload, not in the step.
    ///
    /// # Errors
    /// The first check that fails, in the order of [`ImageError`].
    pub fn check(image: &'a [u8]) -> Result<Self, ImageError> {
        let table = Self::parse(image)?;
        for (at, value) in DERIVED_WORDS.into_iter().zip(table.derived()) {
            derived_is(table.words, at, value)?;
        }
        Ok(table)
    }

    /// [`Self::check`] but for the words that follow from the bounds.
    pub(super) fn parse(image: &'a [u8]) -> Result<Self, ImageError> {
        let header = check_envelope(image)?;
        let drive = check_identity(header)?;
        let generator_kind =
            GeneratorKind::from_code(header.u8(104)).ok_or(ImageError::GeneratorKind { found: header.u8(104) })?;
        let count = |offset: usize, field, least, most| {
            counted(field, header.u8(offset) as usize, least, most).map(usize::from)
        };
        let torque_nodes = count(110, Field::TorqueNodes, 1, MAX_CLAMPED_NODES)?;
        let temperature_nodes = count(111, Field::TemperatureNodes, 1, MAX_TEMPERATURE_NODES)?;
        let ripple_nodes = count(112, Field::RippleNodes, MIN_PERIODIC_NODES, MAX_RIPPLE_NODES)?;
        let curve_nodes = [
            count(113, Field::GeneratorCurve, MIN_PERIODIC_NODES, MAX_PERIODIC_NODES)?,
            count(114, Field::MaterialCurve, MIN_PERIODIC_NODES, MAX_PERIODIC_NODES)?,
            count(115, Field::OutputCurve, MIN_PERIODIC_NODES, MAX_PERIODIC_NODES)?,
        ];
        let needed = image_bytes(torque_nodes, temperature_nodes, ripple_nodes, curve_nodes);
        let size = ImageError::Size { needed, found: image.len() };
        if needed != image.len() {
            return Err(size);
        }
        let layout = Layout::new(torque_nodes, temperature_nodes, ripple_nodes, curve_nodes);
        let body_bytes = layout.end.saturating_mul(4);
        if let Some(page) = (0..body_bytes.div_ceil(PAGE_BYTES)).find(|&page| !page_intact(image, body_bytes, page)) {
            return Err(ImageError::PageCrc { page });
        }
        let (words, _) = image.get(..body_bytes).ok_or(size)?.as_chunks::<4>();
        let plan = layout.plan(torque_nodes, temperature_nodes, ripple_nodes, curve_nodes);
        derived_is(words, word::BODY, layout.end as u32)?;
        derived_is(words, word::CELL_WIDTH, cell_width(&drive, ripple_nodes).to_bits())?;
        for (at, value) in (word::CELL_WIDTH.saturating_add(1)..).zip(plan) {
            derived_is(words, at, value)?;
        }
        let limit = in_range(Field::ErrorLimit, 0, header.f32(152), f32::MIN_POSITIVE, MAX_ERROR_RAD)?;
        derived_is(words, word::RIPPLE_UNIT.saturating_add(1), limit_counts(limit))?;
        check_axis(Field::TorqueNodes, words, word::TORQUE_NODES, torque_nodes, MAX_CLAMPED_NODES)?;
        let slots = MAX_TEMPERATURE_NODES;
        check_axis(Field::TemperatureNodes, words, word::TEMPERATURE_NODES, temperature_nodes, slots)?;
        check_range(Field::TorqueRange, words, word::TORQUE_RANGE, word::TORQUE_NODES, torque_nodes)?;
        let (range, nodes) = (word::TEMPERATURE_RANGE, word::TEMPERATURE_NODES);
        check_range(Field::TemperatureRange, words, range, nodes, temperature_nodes)?;
        in_range(Field::SolverResidual, 0, header.f32(124), 0.0, f32::MAX)?;
        in_range(Field::ProjectionWorst, 0, header.f32(128), 0.0, MAX_ERROR_RAD)?;
        in_range(Field::ProjectionRms, 0, header.f32(132), 0.0, header.f32(128))?;
        let mut table = Self {
            image,
            words,
            body_bytes,
            drive,
            generator_kind,
            torque_nodes,
            temperature_nodes,
            ripple: PeriodicAxis::new(ripple_nodes).ok_or(size)?,
            bounds: Bounds::default(),
            inverse: InverseBound::default(),
            plan: Table::plan_in(words),
        };
        table.bounds = table.check_bounds(&layout, curve_nodes)?;
        table.check_rise(&layout)?;
        let cell_rad = rad(cell_width(&drive, ripple_nodes).abs());
        table.inverse = table.bounds.inverse(if ripple_nodes == 0 { f32::INFINITY } else { cell_rad });
        let left_rad = table.inverse.error_rad;
        if left_rad.is_nan() || left_rad > MAX_INVERSE_ERROR_RAD {
            return Err(ImageError::Inverse { left_rad });
        }
        Ok(table)
    }

    /// Values of [`DERIVED_WORDS`].
    pub(super) fn derived(&self) -> [u32; 2] {
        let hold = num::counts(self.inverse.error_rad as f64) as i32;
        [self.inverse.iterations as u32, hold.saturating_add(HOLD_COUNTS) as u32]
    }

    fn check_bounds(&self, layout: &Layout, curve_nodes: [usize; 3]) -> Result<Bounds, ImageError> {
        let mut bounds = Bounds::default();
        // So that the ripple in cells, and in counts, fits the integers of a step.
        let most = cell_width(&self.drive, self.ripple.len()).abs() * MAX_UNITS_PER_CELL;
        let most = if self.ripple.is_empty() || most > i32::MAX as f32 { i32::MAX as f32 } else { most };
        in_range(Field::MeanRipple, 0, word_at(self.words, word::RIPPLE_UNIT) as f32, 0.0, most)?;
        self.check_nodes(layout, &mut bounds)?;
        self.check_records(layout, &mut bounds)?;
        bounds.error_rad += bounds.periodic_rad;
        let ratio = self.drive.ratio();
        let curves = [(Field::GeneratorCurve, ratio), (Field::MaterialCurve, ratio - 1.0), (Field::OutputCurve, 1.0)];
        for (((field, periods), at), nodes) in curves.into_iter().zip(layout.curves).zip(curve_nodes) {
            self.add_curve(&mut bounds, field, at, nodes, periods)?;
        }
        let limit = self.error_limit_rad();
        if bounds.error_rad.is_nan() || bounds.error_rad > limit {
            return Err(ImageError::ErrorBound { found_rad: bounds.error_rad, allowed_rad: limit });
        }
        if bounds.slope.is_nan() || bounds.slope >= 1.0 {
            return Err(ImageError::Slope { found: bounds.slope });
        }
        Ok(bounds)
    }

    /// Adds what a curve of A, B, C can give; `periods` of it in one output turn.
    fn add_curve(
        &self,
        bounds: &mut Bounds,
        field: Field,
        at: usize,
        nodes: usize,
        periods: f32,
    ) -> Result<(), ImageError> {
        let axis = PeriodicAxis::new(nodes).unwrap_or_default();
        let value = |i: usize| rad(word_at(self.words, at.saturating_add(i)) as i32 as f32 * 0.5);
        for index in 0..axis.stored_len() {
            in_range(field, index, value(index), -MAX_ERROR_RAD, MAX_ERROR_RAD)?;
        }
        check_closed(field, axis, self.words.get(at..).unwrap_or_default())?;
        let [largest, steepest, _] = extremes(axis.stored_len(), value);
        let slope = steepest * nodes as f32 * periods.abs() / TAU as f32;
        // Two readings, which may lie on both sides of a step.
        bounds.rounding_rad += 2.0 * WEIGHT_ROUNDING * steepest;
        bounds.error_rad += largest;
        bounds.periodic_rad += largest;
        bounds.slope += slope;
        bounds.curve_slope += slope;
        Ok(())
    }

    /// Where node `index`, over all temperatures, starts.
    fn node_at(&self, layout: &Layout, index: usize) -> usize {
        let step = if self.torque_nodes > 1 { NODE_WORDS } else { NODE_WORDS.saturating_mul(2) };
        layout.nodes.saturating_add(index.saturating_mul(step))
    }

    /// What D and H can give: linear interpolation between temperatures stays within them, a cubic within its Bernstein
    /// coefficients.
    fn check_nodes(&self, layout: &Layout, bounds: &mut Bounds) -> Result<(), ImageError> {
        let jumps = self.torque_jumps();
        let most = num::counts(MAX_ERROR_RAD as f64) as f32;
        // Torque, D, slope of D and H of the node before.
        let mut before: Option<[f32; 4]> = None;
        for index in 0..self.torque_nodes.saturating_mul(self.temperature_nodes) {
            let node = index.checked_rem(self.torque_nodes).unwrap_or(0);
            let at = self.node_at(layout, index);
            let number = |i: usize| f32_at(self.words, at.saturating_add(i));
            let mean = in_range(Field::Mean, index, number(0), -most, most)?;
            let slope = finite(Field::MeanSlope, index, number(1))?;
            let half = in_range(Field::HalfWidth, index, number(2), 0.0, most)?;
            if number(2).to_bits() & 1 != grid::is_jump(jumps, node) as u32 {
                return Err(ImageError::Derived { offset: at.saturating_add(2).saturating_mul(4) });
            }
            if self.torque_nodes == 1 {
                for word in 0..NODE_WORDS {
                    derived_is(self.words, at.saturating_add(NODE_WORDS).saturating_add(word), number(word).to_bits())?;
                }
                // Nowhere to go with it.
                in_range(Field::MeanSlope, index, slope, 0.0, 0.0)?;
            }
            let torque = f32_at(self.words, word::TORQUE_NODES.saturating_add(node));
            bounds.error_rad = larger(bounds.error_rad, rad(mean.abs() + half));
            let below = before.filter(|_| node > 0 && !grid::is_jump(jumps, node.saturating_sub(1)));
            if let Some([torque_below, mean_below, slope_below, half_below]) = below {
                let third = (torque - torque_below) / 3.0;
                let inner = larger((mean_below + slope_below * third).abs(), (mean - slope * third).abs());
                let inner = if inner.is_finite() { inner } else { f32::INFINITY };
                bounds.error_rad = larger(bounds.error_rad, rad(inner + larger(half, half_below)));
            }
            before = Some([torque, mean, slope, half]);
        }
        Ok(())
    }

    /// Whether the error of both flanks, D − H and D + H, grows with the load, and no faster than a drive can.
    ///
    /// From node to node, and where there is no jump from each control point of the cubic to the next: a cubic with rising control points rises.
    fn check_rise(&self, layout: &Layout) -> Result<(), ImageError> {
        let jumps = self.torque_jumps();
        let pitch_rad = TAU as f32 / self.drive.circular_spline_teeth() as f32;
        // Between two jumps the load is within the drag and the flanks let go: a table that was sampled one way falls there by its play.
        let [first, last] = [jumps.trailing_zeros() as usize, 63_usize.saturating_sub(jumps.leading_zeros() as usize)];
        for temperature in 0..self.temperature_nodes {
            // Of D − H and D + H.
            let mut highest = [f32::NEG_INFINITY; 2];
            for torque in 1..self.torque_nodes {
                let below = torque.saturating_sub(1);
                let [low, high] = [below, torque].map(|node| {
                    let index = temperature.saturating_mul(self.torque_nodes).saturating_add(node);
                    let at = self.node_at(layout, index);
                    [0, 1, 2].map(|i: usize| rad(f32_at(self.words, at.saturating_add(i))))
                });
                let [from, to] =
                    [below, torque].map(|node| f32_at(self.words, word::TORQUE_NODES.saturating_add(node)));
                let (width, jump) = (to - from, grid::is_jump(jumps, below));
                let ([mean_low, slope_low, half_low], [mean_high, slope_high, half_high]) = (low, high);
                let (rise, widening) = (mean_high - mean_low, half_high - half_low);
                let third = width / 3.0;
                let (parts, widening) = if jump {
                    ([rise; 3], widening)
                } else {
                    ([slope_low * third, rise - (slope_low + slope_high) * third, slope_high * third], widening / 3.0)
                };
                let allowed_rad = if jump { 0.5 * pitch_rad } else { MAX_COMPLIANCE_RAD_PER_N_M * third };
                let [a, b, c] = parts;
                let most = larger(larger(a, b), c) + widening.abs();
                let mut least = -larger(larger(-a, -b), -c) - widening.abs();
                for (highest, side) in highest.iter_mut().zip([-1.0, 1.0]) {
                    *highest = larger(*highest, mean_low + side * half_low);
                    let below = mean_high + side * half_high - *highest;
                    least = if below < least { below } else { least };
                }
                let lets_go = first < below && below < last && !jump;
                let fall_rad = if lets_go { 0.5 * pitch_rad } else { FALL_RAD };
                if least < -fall_rad {
                    return Err(ImageError::Falls { temperature, torque, found_rad: least });
                }
                if most > allowed_rad + FALL_RAD {
                    return Err(ImageError::Steep { temperature, torque, found_rad: most, allowed_rad });
                }
            }
        }
        Ok(())
    }

    /// What R and h can give, and that they leave no negative half-width.
    fn check_records(&self, layout: &Layout, bounds: &mut Bounds) -> Result<(), ImageError> {
        let nodes = self.ripple.len();
        let unit = (word_at(self.words, word::RIPPLE_UNIT) as f64 / UNITS_PER_COUNT) as f32;
        let cells_per_rad = nodes as f32 * self.drive.tooth_periods().abs() / TAU as f32;
        for index in 0..self.torque_nodes.saturating_mul(self.temperature_nodes) {
            let first = layout.records.saturating_add(index.saturating_mul(layout.record));
            let record = self.words.get(first..first.saturating_add(layout.record)).unwrap_or_default();
            let value = |i: usize| half_at(record, i);
            for index in 0..layout.record.saturating_mul(2) {
                let node = self.ripple.stored_node(index.checked_rem(layout.record).unwrap_or(0)).saturating_add(1);
                let first = if index < layout.record { 0 } else { layout.record };
                if value(index) != value(first.saturating_add(node)) {
                    return Err(ImageError::NotClosed { field: Field::MeanRipple, index });
                }
            }
            let ripple = |i: usize| [i, i.saturating_add(layout.record)].map(|i| value(i) as f32 * unit);
            let torque = index.checked_rem(self.torque_nodes).unwrap_or(0);
            let temperature = index.checked_div(self.torque_nodes).unwrap_or(0);
            let half = f32_at(self.words, self.node_at(layout, index).saturating_add(2));
            let least = (0..self.ripple.stored_len()).fold(half, |least, i| {
                let [forward, backward] = ripple(i);
                least.min(half + 0.5 * (backward - forward))
            });
            if least < -(HALF_WIDTH_ROUNDING_COUNTS as f32 + unit) {
                return Err(ImageError::NegativeHalfWidth { temperature, torque, found_rad: rad(least) });
            }
            // Steady motion follows forward or backward.
            for first in [0, layout.record] {
                let way = |i: usize| rad(value(first.saturating_add(i)) as f32 * unit);
                let [largest, steepest, reached] = extremes(self.ripple.stored_len(), way);
                bounds.periodic_rad = larger(bounds.periodic_rad, largest);
                bounds.slope = larger(bounds.slope, steepest * cells_per_rad);
                bounds.ripple_cells = larger(bounds.ripple_cells, reached * cells_per_rad);
                bounds.rounding_rad = larger(bounds.rounding_rad, WEIGHT_ROUNDING * steepest);
            }
        }
        Ok(())
    }

    /// How far the ripple takes the half-width of the play below H at most, counts, rounded up.
    pub(crate) fn play_ripple_counts(&self) -> i32 {
        let layout = Layout::new(self.torque_nodes, self.temperature_nodes, self.ripple.len(), [0; 3]);
        let [_, first] = halves(word_at(self.words, word::CELL_WIDTH.saturating_add(3)));
        let words = layout.record.saturating_mul(self.torque_nodes).saturating_mul(self.temperature_nodes);
        let records = self.words.get(first..first.saturating_add(words)).unwrap_or_default();
        let mut narrowest = 0;
        for record in records.chunks_exact(layout.record.max(1)) {
            for i in 0..record.len() {
                let [forward, backward] = [i, i.saturating_add(record.len())].map(|i| half_at(record, i) as i32);
                let narrower = forward.wrapping_sub(backward);
                narrowest = if narrower > narrowest { narrower } else { narrowest };
            }
        }
        let narrowest = narrowest.unsigned_abs() as u64;
        // Half of it in counts of 2¹⁹ units, rounded up, and two for the rounding of the ripple.
        let counts = narrowest.wrapping_mul(word_at(self.words, word::RIPPLE_UNIT) as u64) >> 20;
        if self.ripple.is_empty() { 0 } else { (counts as i32).saturating_add(3) }
    }
}
