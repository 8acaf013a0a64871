//! Checking an image: every number, and what the table can give at most, before any of it is used.

use super::header::{check_envelope, check_identity};
use super::layout::{
    CRC_BYTES, DERIVED_WORDS, ImageLayout, MAX_AXIS_VALUE, MAX_ERROR_RAD, MAX_RIPPLE_NODES, MAX_TEMPERATURE_NODES,
    NODE_WORDS, PAGE_BYTES, UNITS_PER_COUNT, cell_width, counted, image_bytes, limit_counts, word,
};
use super::sums::{page_of, page_sum};
use crate::angle::RAD_PER_COUNT;
use crate::crc::{CRC_START, crc_bytes};
use crate::drive::Drive;
use crate::error::{Field, ImageError};
use crate::num::{self, larger};
use crate::table::bounds::{Bounds, HOLD_COUNTS, InverseBound, MAX_INVERSE_ERROR_RAD};
use crate::table::grid::{self, MAX_CLAMPED_NODES, MAX_PERIODIC_NODES, MIN_PERIODIC_NODES, PeriodicAxis};
use crate::table::words::{Words, f32_at, word_at};
use crate::table::{GeneratorKind, Table};
use core::f64::consts::TAU;

/// Half-widths may miss zero by this, counts, and the ripple unit: rounding.
const HALF_WIDTH_ROUNDING_COUNTS: f64 = 3.0;
/// The error of a flank may lie so far below what it was at a smaller torque, rad, 10″: noise of a table that was
/// measured, and cubics that swing. Chosen; the tables of the four generators never fall at their nodes, and swing by
/// 5e-6 between them.
const FALL_RAD: f32 = 5.0e-5;
/// The softest drive that is believed, rad/N·m. Chosen: a hundred times the compliance of size 5 in catalogues (some
/// 1e-2), five hundred times the steepest place in a table of contact FEM (two-roller at no load, 5e-4; with friction
/// learnt 1.9e-3).
const MAX_COMPLIANCE_RAD_PER_N_M: f32 = 1.0;
/// Largest ripple unit for each count of a cell: a ripple of 15.9 cells.
const MAX_UNITS_PER_CELL: f32 = 255.0;
/// How far B-spline weights of 15 bits can be off, times the largest step between coefficients: one unit for the place
/// in the cell and one for each of the two weights that are rounded.
const WEIGHT_ROUNDING: f32 = 3.0 / 32_768.0;

#[inline(never)]
fn finite(field: Field, index: usize, value: f32) -> Result<f32, ImageError> {
    if value.is_finite() { Ok(value) } else { Err(ImageError::NotFinite { field, index }) }
}

#[inline(never)]
fn in_range(field: Field, index: usize, found: f32, least: f32, most: f32) -> Result<f32, ImageError> {
    finite(field, index, found)?;
    if found >= least && found <= most { Ok(found) } else { Err(ImageError::OutOfRange { field, found, least, most }) }
}

/// Whether a word is what it must be.
#[inline(never)]
fn derived_is(words: Words<'_>, at: usize, value: u32) -> Result<(), ImageError> {
    if word_at(words, at) == value { Ok(()) } else { Err(ImageError::Derived { offset: at.saturating_mul(4) }) }
}

/// A range must lie inside the axis; an axis of one node holds wherever its maker says.
#[inline(never)]
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

/// Half word `index` of a record.
#[inline(never)]
fn half_at(record: Words<'_>, index: usize) -> i16 {
    let word = word_at(record, index / 2);
    (if index.is_multiple_of(2) { word } else { word >> 16 }) as i16
}

/// Counts in radians.
fn rad(counts: f32) -> f32 {
    counts * RAD_PER_COUNT
}

/// How much of an image a step of a check goes over: bytes of a checksum, numbers of a curve or a record, nodes.
const STEP_BYTES: usize = PAGE_BYTES / 2;
const STEP_NUMBERS: usize = 12;
const STEP_NODES: usize = 4;

numbered! {
    /// Stages of a check, in this order.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    enum CheckStage {
        Envelope,
        Crc,
        Identity,
        Pages,
        Places,
        TorqueAxis,
        TemperatureAxis,
        Unit,
        Jumps,
        Nodes,
        /// Of a record: closed, and how far it narrows the play; then how far each of its two ripples goes.
        Closed,
        Narrowest,
        Forward,
        Backward,
        Curves,
        CurvesClosed,
        Bounds,
        Rise,
        Inverse,
        /// Words that follow from the bounds.
        Derived,
        Done,
    }
}

/// Facts of an image once its sizes are known.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ImageFacts {
    body_bytes: usize,
    drive: Drive,
    generator_kind: GeneratorKind,
    torque_nodes: usize,
    temperature_nodes: usize,
    ripple: PeriodicAxis,
    /// Width of a cell of the ripple at the output, counts.
    cell_width: f32,
    curve_nodes: [usize; 3],
    layout: ImageLayout,
    /// Intervals of the torque axis that are jumps.
    jumps: u64,
    bounds: Bounds,
    inverse: InverseBound,
    /// Largest narrowing of the play by the ripple, twice, ripple units.
    narrowest: i32,
}

/// A check of an image, step by step: holds nothing of the image, which is given with every step.
///
/// A step takes at most 2000 instructions on a Cortex-M4F, held by `tests/run firmware`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ImageCheck {
    /// Number of the stage: an upset may leave one that there is not.
    stage: u32,
    /// Where in the stage, and where in the part that is looked at there.
    at: usize,
    within: usize,
    crc: u32,
    facts: ImageFacts,
    /// Torque, D, slope of D and H of the node before.
    before: Option<[f32; 4]>,
    /// The largest D − H and D + H below the node.
    highest: [f32; 2],
    /// Coefficient, step and value of a closed curve, as far as it was looked at.
    most: [f32; 3],
    /// The narrowest play of a record.
    least: f32,
}

impl ImageCheck {
    pub const NEW: Self = Self {
        stage: CheckStage::Envelope as u32,
        at: 0,
        within: 0,
        crc: CRC_START,
        facts: ImageFacts::NONE,
        before: None,
        highest: [f32::NEG_INFINITY; 2],
        most: [0.0; 3],
        least: 0.0,
    };

    /// A step; true after the last. The first check that fails ends it.
    ///
    /// # Errors
    /// The first check that fails, in the order of [`ImageError`].
    #[inline(never)]
    pub fn step(&mut self, image: &[u8]) -> Result<bool, ImageError> {
        if self.is_done() {
            return Ok(true);
        }
        let next = match self.stage() {
            CheckStage::Envelope => {
                check_envelope(image)?;
                Some(CheckStage::Crc)
            }
            CheckStage::Crc => self.crc(image)?.then_some(CheckStage::Identity),
            CheckStage::Identity => {
                self.facts = ImageFacts::of(image)?;
                Some(CheckStage::Pages)
            }
            CheckStage::Pages => self.page(image)?.then_some(CheckStage::Places),
            _ => self.numbers(image)?,
        };
        if let Some(next) = next {
            self.stage = next as u32;
            (self.at, self.within) = (0, 0);
        }
        Ok(self.is_done())
    }

    const fn is_done(&self) -> bool {
        self.stage == CheckStage::Done as u32
    }

    /// The stage; the first for one that there is not, and then the checksum does not match.
    fn stage(&self) -> CheckStage {
        CheckStage::numbered(self.stage).unwrap_or(CheckStage::Envelope)
    }

    /// A step among the numbers; the next stage if this one has ended.
    fn numbers(&mut self, image: &[u8]) -> Result<Option<CheckStage>, ImageError> {
        let words = image.get(..self.facts.body_bytes).unwrap_or_default().as_chunks::<4>().0;
        let records = self.facts.torque_nodes.saturating_mul(self.facts.temperature_nodes);
        Ok(match self.stage() {
            CheckStage::Places => {
                self.facts.check_places(image, words)?;
                Some(CheckStage::TorqueAxis)
            }
            CheckStage::TorqueAxis => {
                let nodes = self.facts.torque_nodes;
                self.axis(Field::TorqueNodes, words, word::TORQUE_NODES, nodes, MAX_CLAMPED_NODES)?
                    .then_some(CheckStage::TemperatureAxis)
            }
            CheckStage::TemperatureAxis => {
                let (nodes, slots) = (self.facts.temperature_nodes, MAX_TEMPERATURE_NODES);
                let ended = self.axis(Field::TemperatureNodes, words, word::TEMPERATURE_NODES, nodes, slots)?;
                if ended {
                    self.facts.check_ranges(image, words)?;
                }
                ended.then_some(CheckStage::Unit)
            }
            CheckStage::Unit => {
                // So that the ripple in cells, and in counts, fits the integers of a step.
                let most = self.facts.cell_width.abs() * MAX_UNITS_PER_CELL;
                let most = if self.facts.ripple.is_empty() || most > i32::MAX as f32 { i32::MAX as f32 } else { most };
                in_range(Field::MeanRipple, 0, word_at(words, word::RIPPLE_UNIT) as f32, 0.0, most)?;
                Some(CheckStage::Jumps)
            }
            CheckStage::Jumps => {
                let node = |i: usize| f32_at(words, word::TORQUE_NODES.saturating_add(i));
                let (from, to) = (self.at, self.at.saturating_add(STEP_NUMBERS).min(self.facts.torque_nodes));
                for i in from..to {
                    let jump = grid::jump_at(i, self.facts.torque_nodes, node);
                    self.facts.jumps |= (jump as u64).wrapping_shl(i as u32);
                }
                self.at = to;
                (to >= self.facts.torque_nodes).then_some(CheckStage::Nodes)
            }
            CheckStage::Nodes => {
                for _ in 0..STEP_NODES {
                    if self.at < records {
                        self.node(words)?;
                        self.at = self.at.saturating_add(1);
                    }
                }
                (self.at >= records).then_some(if self.facts.ripple.is_empty() {
                    CheckStage::Curves
                } else {
                    CheckStage::Closed
                })
            }
            CheckStage::Closed => {
                if self.closed(words)? {
                    self.next_part(CheckStage::Narrowest);
                }
                None
            }
            CheckStage::Narrowest => {
                if self.narrowest(words)? {
                    self.next_part(CheckStage::Forward);
                }
                None
            }
            CheckStage::Forward => {
                if self.ripple(words) {
                    self.next_part(CheckStage::Backward);
                }
                None
            }
            CheckStage::Backward => {
                let ended = self.ripple(words);
                if ended {
                    self.next_part(CheckStage::Closed);
                    self.at = self.at.saturating_add(1);
                }
                (ended && self.at >= records).then_some(CheckStage::Curves)
            }
            CheckStage::Curves => self.curve(words)?,
            CheckStage::CurvesClosed => self.curve_closed(words)?,
            CheckStage::Bounds => {
                self.facts.check_bounds(image)?;
                Some(CheckStage::Rise)
            }
            CheckStage::Rise => {
                for _ in 0..STEP_NODES {
                    if self.at < records {
                        self.rise(words)?;
                        self.at = self.at.saturating_add(1);
                    }
                }
                (self.at >= records).then_some(CheckStage::Inverse)
            }
            CheckStage::Inverse => {
                self.facts.check_inverse()?;
                Some(CheckStage::Derived)
            }
            _ => {
                for (at, value) in DERIVED_WORDS.into_iter().zip(self.facts.derived()) {
                    derived_is(words, at, value)?;
                }
                Some(CheckStage::Done)
            }
        })
    }

    /// Goes on with another part of the same record.
    fn next_part(&mut self, stage: CheckStage) {
        self.stage = stage as u32;
        self.within = 0;
    }

    /// Takes some bytes into the CRC-32 of all, and compares it after the last.
    fn crc(&mut self, image: &[u8]) -> Result<bool, ImageError> {
        let too_short = ImageError::TooShort { found: image.len(), needed: CRC_BYTES };
        let (before, sum) = image.split_last_chunk::<CRC_BYTES>().ok_or(too_short)?;
        let end = self.at.saturating_add(STEP_BYTES).min(before.len());
        self.crc = crc_bytes(self.crc, before.get(self.at..end).unwrap_or_default());
        self.at = end;
        let (stated, computed) = (u32::from_le_bytes(*sum), !self.crc);
        let ended = end >= before.len();
        if ended && stated != computed {
            return Err(ImageError::Crc { stated, computed });
        }
        Ok(ended)
    }

    /// Takes some bytes into the CRC-32 of a page, and compares it after its last; true after the last page.
    fn page(&mut self, image: &[u8]) -> Result<bool, ImageError> {
        let body_bytes = self.facts.body_bytes;
        let error = ImageError::PageCrc { page: self.at };
        let page = page_of(image, body_bytes, self.at).ok_or(error)?;
        let end = self.within.saturating_add(STEP_BYTES).min(page.len());
        let before = if self.within == 0 { CRC_START } else { self.crc };
        self.crc = crc_bytes(before, page.get(self.within..end).unwrap_or_default());
        self.within = end;
        if end < page.len() {
            return Ok(false);
        }
        if page_sum(image, body_bytes, self.at) != Some(!self.crc) {
            return Err(error);
        }
        (self.at, self.within) = (self.at.saturating_add(1), 0);
        Ok(self.at >= body_bytes.div_ceil(PAGE_BYTES))
    }

    /// Some nodes of an axis: they increase, and what follows is padding.
    fn axis(
        &mut self,
        field: Field,
        words: Words<'_>,
        first: usize,
        nodes: usize,
        slots: usize,
    ) -> Result<bool, ImageError> {
        let end = self.at.saturating_add(STEP_NUMBERS).min(slots);
        for index in self.at..end {
            let at = first.saturating_add(index);
            if index >= nodes {
                derived_is(words, at, f32::MAX.to_bits())?;
                continue;
            }
            let node = in_range(field, index, f32_at(words, at), -MAX_AXIS_VALUE, MAX_AXIS_VALUE)?;
            if index > 0 && node <= f32_at(words, at.saturating_sub(1)) {
                return Err(ImageError::NotIncreasing { field, index });
            }
        }
        self.at = end;
        Ok(end >= slots)
    }

    /// Range of D and H at a node, and between it and the one before: linear interpolation between temperatures
    /// stays within them, a cubic within its Bernstein coefficients.
    #[inline(never)]
    fn node(&mut self, words: Words<'_>) -> Result<(), ImageError> {
        let most = num::counts(MAX_ERROR_RAD as f64) as f32;
        let index = self.at;
        let node = index.checked_rem(self.facts.torque_nodes).unwrap_or(0);
        let at = self.facts.node_at(index);
        let number = |i: usize| f32_at(words, at.saturating_add(i));
        let mean = in_range(Field::Mean, index, number(0), -most, most)?;
        let slope = finite(Field::MeanSlope, index, number(1))?;
        let half = in_range(Field::HalfWidth, index, number(2), 0.0, most)?;
        if number(2).to_bits() & 1 != grid::is_jump(self.facts.jumps, node) as u32 {
            return Err(ImageError::Derived { offset: at.saturating_add(2).saturating_mul(4) });
        }
        if self.facts.torque_nodes == 1 {
            for word in 0..NODE_WORDS {
                derived_is(words, at.saturating_add(NODE_WORDS).saturating_add(word), number(word).to_bits())?;
            }
            // Nowhere to go with it.
            in_range(Field::MeanSlope, index, slope, 0.0, 0.0)?;
        }
        let torque = f32_at(words, word::TORQUE_NODES.saturating_add(node));
        let bounds = &mut self.facts.bounds;
        bounds.error_rad = larger(bounds.error_rad, rad(mean.abs() + half));
        let below = self.before.filter(|_| node > 0 && !grid::is_jump(self.facts.jumps, node.saturating_sub(1)));
        if let Some([torque_below, mean_below, slope_below, half_below]) = below {
            let third = (torque - torque_below) / 3.0;
            let inner = larger((mean_below + slope_below * third).abs(), (mean - slope * third).abs());
            let inner = if inner.is_finite() { inner } else { f32::INFINITY };
            bounds.error_rad = larger(bounds.error_rad, rad(inner + larger(half, half_below)));
        }
        self.before = Some([torque, mean, slope, half]);
        Ok(())
    }

    /// Whether the error of both flanks, D − H and D + H, grows with the load up to this node, and no faster than a
    /// drive can.
    ///
    /// From node to node, and where there is no jump from each control point of the cubic to the next: a cubic with
    /// rising control points rises.
    #[inline(never)]
    fn rise(&mut self, words: Words<'_>) -> Result<(), ImageError> {
        let torque = self.at.checked_rem(self.facts.torque_nodes).unwrap_or(0);
        let temperature = self.at.checked_div(self.facts.torque_nodes).unwrap_or(0);
        if torque == 0 {
            self.highest = [f32::NEG_INFINITY; 2];
            return Ok(());
        }
        let jumps = self.facts.jumps;
        let pitch_rad = TAU as f32 / self.facts.drive.circular_spline_teeth() as f32;
        // Between two jumps the load is within the drag and the flanks let go: a table that was sampled one way falls
        // there by its play.
        let [first, last] = [jumps.trailing_zeros() as usize, 63_usize.saturating_sub(jumps.leading_zeros() as usize)];
        let below = torque.saturating_sub(1);
        let [low, high] = [self.at.saturating_sub(1), self.at].map(|index| {
            let at = self.facts.node_at(index);
            [0, 1, 2].map(|i: usize| rad(f32_at(words, at.saturating_add(i))))
        });
        let [from, to] = [below, torque].map(|node| f32_at(words, word::TORQUE_NODES.saturating_add(node)));
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
        for (highest, side) in self.highest.iter_mut().zip([-1.0, 1.0]) {
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
        Ok(())
    }

    /// Whether some of a record, of both directions, repeat the nodes they must; true after the last.
    fn closed(&mut self, words: Words<'_>) -> Result<bool, ImageError> {
        let record = self.facts.record(words, self.at);
        let length = self.facts.layout.record;
        let end = self.within.saturating_add(STEP_NUMBERS).min(length.saturating_mul(2));
        for index in self.within..end {
            let first = if index < length { 0 } else { length };
            let node = self.facts.ripple.stored_node(index.saturating_sub(first)).saturating_add(1);
            if half_at(record, index) != half_at(record, first.saturating_add(node)) {
                return Err(ImageError::NotClosed { field: Field::MeanRipple, index });
            }
        }
        self.within = end;
        self.least = f32_at(words, self.facts.node_at(self.at).saturating_add(2));
        Ok(end >= length.saturating_mul(2))
    }

    /// Whether a record leaves no negative half-width; true after the last of its numbers.
    fn narrowest(&mut self, words: Words<'_>) -> Result<bool, ImageError> {
        let record = self.facts.record(words, self.at);
        let unit = self.facts.unit(words);
        let half = f32_at(words, self.facts.node_at(self.at).saturating_add(2));
        let stored = self.facts.ripple.stored_len();
        let end = self.within.saturating_add(STEP_NUMBERS).min(stored);
        for i in self.within..end {
            let [forward, backward] =
                [i, i.saturating_add(self.facts.layout.record)].map(|i| half_at(record, i) as i32);
            let narrower = forward.wrapping_sub(backward);
            self.facts.narrowest = if narrower > self.facts.narrowest { narrower } else { self.facts.narrowest };
            let wider = 0.5 * (backward as f32 * unit - forward as f32 * unit);
            let play = half + wider;
            self.least = if play < self.least { play } else { self.least };
        }
        self.within = end;
        if end >= stored && self.least < -(HALF_WIDTH_ROUNDING_COUNTS as f32 + unit) {
            let torque = self.at.checked_rem(self.facts.torque_nodes).unwrap_or(0);
            let temperature = self.at.checked_div(self.facts.torque_nodes).unwrap_or(0);
            return Err(ImageError::NegativeHalfWidth { temperature, torque, found_rad: rad(self.least) });
        }
        Ok(end >= stored)
    }

    /// Adds what some of the ripple of one direction can give: steady motion follows forward or backward. True after
    /// the last.
    fn ripple(&mut self, words: Words<'_>) -> bool {
        let ended = self.extremes(words, self.facts.ripple.stored_len());
        if ended {
            let [largest, steepest, reached] = self.most;
            self.most = [0.0; 3];
            let cells_per_rad = self.facts.ripple.len() as f32 * self.facts.drive.tooth_periods().abs() / TAU as f32;
            let bounds = &mut self.facts.bounds;
            bounds.periodic_rad = larger(bounds.periodic_rad, largest);
            bounds.slope = larger(bounds.slope, steepest * cells_per_rad);
            bounds.ripple_cells = larger(bounds.ripple_cells, reached * cells_per_rad);
            bounds.rounding_rad = larger(bounds.rounding_rad, WEIGHT_ROUNDING * steepest);
        }
        ended
    }

    /// Coefficient `i` of the closed curve that is looked at, rad.
    #[inline(never)]
    fn number(&self, words: Words<'_>, i: usize) -> f32 {
        let first = match self.stage() {
            CheckStage::Forward => 0,
            CheckStage::Backward => self.facts.layout.record,
            _ => {
                let at = self.facts.layout.curves.get(self.at).copied().unwrap_or(0);
                return curve_rad(words, at.saturating_add(i));
            }
        };
        rad(half_at(self.facts.record(words, self.at), first.saturating_add(i)) as f32 * self.facts.unit(words))
    }

    /// Largest values of a closed B-spline: coefficient, slope per node spacing, value. Coefficients bound values too,
    /// and are simpler to blend; values show how far the curve really goes. Some of it; true after the last.
    #[inline(never)]
    fn extremes(&mut self, words: Words<'_>, stored: usize) -> bool {
        let last = stored.saturating_sub(2);
        let end = self.within.saturating_add(STEP_NUMBERS).min(last);
        let [mut a, mut b] = [0, 1].map(|next: usize| self.number(words, self.within.saturating_add(next)));
        for i in self.within..end {
            let [largest, steepest, reached] = self.most;
            let c = self.number(words, i.saturating_add(2));
            // A parabola from (a + b)/2 to (b + c)/2; its top, if inside, where the slope b − a + t·(a − 2b + c)
            // vanishes.
            let turn = (a - b) / (a - 2.0 * b + c);
            let top = 0.5 * (a + b) + 0.5 * turn * (b - a);
            let top = if turn > 0.0 && turn < 1.0 { top.abs() } else { 0.0 };
            self.most = [
                larger(largest, a.abs()),
                larger(steepest, (b - a).abs()),
                larger(reached, larger(top, 0.5 * (a + b).abs())),
            ];
            (a, b) = (b, c);
        }
        self.within = end;
        end >= last
    }

    /// Some numbers of one of A, B, C: in range; after the last its closing.
    fn curve(&mut self, words: Words<'_>) -> Result<Option<CheckStage>, ImageError> {
        let Some((field, at, stored)) = self.facts.curve(self.at) else { return Ok(Some(CheckStage::Bounds)) };
        let end = self.within.saturating_add(STEP_NUMBERS).min(stored);
        for index in self.within..end {
            in_range(field, index, curve_rad(words, at.saturating_add(index)), -MAX_ERROR_RAD, MAX_ERROR_RAD)?;
        }
        self.within = end;
        if end >= stored {
            self.next_part(CheckStage::CurvesClosed);
        }
        Ok(None)
    }

    /// Whether it is closed, and, some at a time, what it can give.
    fn curve_closed(&mut self, words: Words<'_>) -> Result<Option<CheckStage>, ImageError> {
        let Some((field, at, stored)) = self.facts.curve(self.at) else { return Ok(Some(CheckStage::Bounds)) };
        let nodes = stored.saturating_sub(3);
        if self.within == 0 && stored > 0 {
            let curve = words.get(at..).unwrap_or_default();
            // Node i is stored at position i + 1: only the first and the last two repeat another.
            for (index, node) in [(0, nodes), (nodes.saturating_add(1), 1), (nodes.saturating_add(2), 2)] {
                if curve.get(index) != curve.get(node) {
                    return Err(ImageError::NotClosed { field, index });
                }
            }
        }
        if self.extremes(words, stored) {
            self.facts.add_curve(self.at, self.most);
            self.most = [0.0; 3];
            self.next_part(CheckStage::Curves);
            self.at = self.at.saturating_add(1);
        }
        Ok(None)
    }
}

/// A coefficient of A, B, C.
fn curve_rad(words: Words<'_>, at: usize) -> f32 {
    rad(word_at(words, at) as i32 as f32 * 0.5)
}

impl ImageFacts {
    /// Nothing known yet.
    const NONE: Self = Self {
        body_bytes: 0,
        drive: Drive::SMALLEST,
        generator_kind: GeneratorKind::Other,
        torque_nodes: 0,
        temperature_nodes: 0,
        ripple: PeriodicAxis::NONE,
        cell_width: 1.0,
        curve_nodes: [0; 3],
        layout: ImageLayout::NONE,
        jumps: 0,
        bounds: Bounds::NONE,
        inverse: InverseBound::NONE,
        narrowest: 0,
    };

    /// Target and sizes of an image.
    fn of(image: &[u8]) -> Result<Self, ImageError> {
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
        let layout = ImageLayout::new(torque_nodes, temperature_nodes, ripple_nodes, curve_nodes);
        Ok(Self {
            body_bytes: layout.end.saturating_mul(4),
            drive,
            generator_kind,
            torque_nodes,
            temperature_nodes,
            ripple: PeriodicAxis::new(ripple_nodes).ok_or(size)?,
            cell_width: cell_width(&drive, ripple_nodes),
            curve_nodes,
            layout,
            ..Self::NONE
        })
    }

    /// Where everything is, the error limit, and what follows from it.
    fn check_places(&self, image: &[u8], words: Words<'_>) -> Result<(), ImageError> {
        let plan = self.layout.plan(self.torque_nodes, self.temperature_nodes, self.ripple.len(), self.curve_nodes);
        derived_is(words, word::BODY, self.layout.end as u32)?;
        derived_is(words, word::CELL_WIDTH, self.cell_width.to_bits())?;
        for (at, value) in (word::CELL_WIDTH.saturating_add(1)..).zip(plan) {
            derived_is(words, at, value)?;
        }
        let stated = check_envelope(image)?.f32(152);
        let limit = in_range(Field::ErrorLimit, 0, stated, f32::MIN_POSITIVE, MAX_ERROR_RAD)?;
        derived_is(words, word::RIPPLE_UNIT.saturating_add(1), limit_counts(limit))
    }

    /// The ranges of both axes, and how well the table was made.
    fn check_ranges(&self, image: &[u8], words: Words<'_>) -> Result<(), ImageError> {
        let header = check_envelope(image)?;
        check_range(Field::TorqueRange, words, word::TORQUE_RANGE, word::TORQUE_NODES, self.torque_nodes)?;
        let (range, nodes) = (word::TEMPERATURE_RANGE, word::TEMPERATURE_NODES);
        check_range(Field::TemperatureRange, words, range, nodes, self.temperature_nodes)?;
        in_range(Field::SolverResidual, 0, header.f32(124), 0.0, f32::MAX)?;
        in_range(Field::ProjectionWorst, 0, header.f32(128), 0.0, MAX_ERROR_RAD)?;
        in_range(Field::ProjectionRms, 0, header.f32(132), 0.0, header.f32(128))?;
        Ok(())
    }

    /// Where node `index`, over all temperatures, starts.
    fn node_at(&self, index: usize) -> usize {
        let step = if self.torque_nodes > 1 { NODE_WORDS } else { NODE_WORDS.saturating_mul(2) };
        self.layout.nodes.saturating_add(index.saturating_mul(step))
    }

    /// A record, over all temperatures.
    fn record<'w>(&self, words: Words<'w>, index: usize) -> Words<'w> {
        let first = self.layout.records.saturating_add(index.saturating_mul(self.layout.record));
        words.get(first..first.saturating_add(self.layout.record)).unwrap_or_default()
    }

    /// The ripple unit, counts.
    fn unit(&self, words: Words<'_>) -> f32 {
        word_at(words, word::RIPPLE_UNIT) as f32 * (1.0 / UNITS_PER_COUNT as f32)
    }

    /// Field, place and stored numbers of one of A, B, C.
    fn curve(&self, index: usize) -> Option<(Field, usize, usize)> {
        let fields = [Field::GeneratorCurve, Field::MaterialCurve, Field::OutputCurve];
        let axis = PeriodicAxis::new(*self.curve_nodes.get(index)?).unwrap_or_default();
        Some((*fields.get(index)?, *self.layout.curves.get(index)?, axis.stored_len()))
    }

    /// Adds what one of A, B, C can give to what the nodes and records can.
    fn add_curve(&mut self, index: usize, [largest, steepest, _]: [f32; 3]) {
        let ratio = self.drive.ratio();
        // Periods in an output turn.
        let periods = [ratio, ratio - 1.0, 1.0].get(index).copied().unwrap_or(0.0);
        let nodes = self.curve_nodes.get(index).copied().unwrap_or(0);
        let bounds = &mut self.bounds;
        if index == 0 {
            bounds.error_rad += bounds.periodic_rad;
        }
        let slope = steepest * nodes as f32 * periods.abs() / TAU as f32;
        // Two readings, which may lie on both sides of a step.
        bounds.rounding_rad += 2.0 * WEIGHT_ROUNDING * steepest;
        bounds.error_rad += largest;
        bounds.periodic_rad += largest;
        bounds.slope += slope;
        bounds.curve_slope += slope;
    }

    /// Whether the table gives no more than it states, and has an inverse.
    fn check_bounds(&self, image: &[u8]) -> Result<(), ImageError> {
        let (found_rad, allowed_rad) = (self.bounds.error_rad, check_envelope(image)?.f32(152));
        if found_rad.is_nan() || found_rad > allowed_rad {
            return Err(ImageError::ErrorBound { found_rad, allowed_rad });
        }
        let found = self.bounds.slope;
        if found.is_nan() || found >= 1.0 {
            return Err(ImageError::Slope { found });
        }
        Ok(())
    }

    fn check_inverse(&mut self) -> Result<(), ImageError> {
        let cell_rad = rad(self.cell_width.abs());
        self.inverse = self.bounds.inverse(if self.ripple.is_empty() { f32::INFINITY } else { cell_rad });
        let left_rad = self.inverse.error_rad;
        if left_rad.is_nan() || left_rad > MAX_INVERSE_ERROR_RAD {
            return Err(ImageError::Inverse { left_rad });
        }
        Ok(())
    }

    /// Values of [`DERIVED_WORDS`].
    pub(super) fn derived(&self) -> [u32; 2] {
        let hold = num::counts(self.inverse.error_rad as f64) as i32;
        [self.inverse.iterations as u32, hold.saturating_add(HOLD_COUNTS) as u32]
    }

    /// The table of an image that passed.
    fn table<'a>(&self, image: &'a [u8]) -> Table<'a> {
        let words = image.get(..self.body_bytes).unwrap_or_default().as_chunks::<4>().0;
        // Half of it in counts of 2¹⁹ units, rounded up, and two for the rounding of the ripple.
        let narrowest = (self.narrowest.unsigned_abs() as u64).wrapping_mul(word_at(words, word::RIPPLE_UNIT) as u64);
        let counts = ((narrowest >> 20) as i32).saturating_add(3);
        Table {
            image,
            words,
            body_bytes: self.body_bytes,
            drive: self.drive,
            generator_kind: self.generator_kind,
            torque_nodes: self.torque_nodes,
            temperature_nodes: self.temperature_nodes,
            ripple: self.ripple,
            bounds: self.bounds,
            inverse: self.inverse,
            plan: Table::plan_in(words),
            play_ripple: if self.ripple.is_empty() { 0 } else { counts },
        }
    }
}

impl ImageCheck {
    /// The table of the image that was given with every step, once the last is done.
    pub fn table<'a>(&self, image: &'a [u8]) -> Option<Table<'a>> {
        self.is_done().then(|| self.facts.table(image))
    }
}

impl<'a> Table<'a> {
    /// Checks an image and gives the table in it. Nothing of an image can be used before.
    ///
    /// Verified: length, magic, version, byte order, CRC-32 of the whole and of every page, texts, tooth counts, node
    /// counts; every number finite; axes strictly increasing; half-width of the play ≥ 0 everywhere; torque intervals
    /// that meet at their nodes; wind-up that grows with the load on both flanks, and no faster than a drive can; the
    /// largest error the table can give within its stated limit and `MAX_ERROR_RAD`; `|ratio·de/dψ| < 1` everywhere,
    /// so that the inverse exists, and how it converges; periodic parts closed at the wrap; every offset, unit and
    /// bound that follows from other numbers.
    ///
    /// Bounds hold for every input, not only at nodes: a B-spline stays within its coefficients, and what the cubic of
    /// the wind-up departs from the straight line between two nodes counts in full.
    ///
    /// All at once; [`Store::begin`](crate::Store::begin) does the same step by step.
    ///
    /// # Errors
    /// The first check that fails, in the order of [`ImageError`].
    pub fn check(image: &'a [u8]) -> Result<Self, ImageError> {
        let mut check = ImageCheck::NEW;
        while !check.step(image)? {}
        // What is done has found everything.
        check.table(image).ok_or(ImageError::Magic)
    }

    /// [`Self::check`] but for the words that follow from the bounds.
    pub(super) fn found(image: &'a [u8]) -> Result<ImageFacts, ImageError> {
        let mut check = ImageCheck::NEW;
        while check.stage() != CheckStage::Derived {
            check.step(image)?;
        }
        Ok(check.facts)
    }
}

bits_of!(ImageCheck { stage, at, within, crc, facts, before, highest, most, least });
bits_of!(ImageFacts {
    body_bytes,
    drive,
    generator_kind,
    torque_nodes,
    temperature_nodes,
    ripple,
    cell_width,
    curve_nodes,
    layout,
    jumps,
    bounds,
    inverse,
    narrowest,
});

#[cfg(test)]
mod tests {
    use super::CheckStage;

    #[test]
    fn stages_are_found_by_their_number() {
        assert!((0..).zip(CheckStage::ALL).all(|(number, stage)| stage as u32 == number));
        assert_eq!(CheckStage::ALL.last(), Some(&CheckStage::Done));
    }
}
