//! The equation that a sample gives: its unknowns and their weights.

use super::plan::{MAX_HARMONICS, Plan, Sample, direction_number};
use crate::slopes::{STENCIL, Slopes};
use core::f64::consts::TAU;
use flexspline::GeneratorAngle;
use flexspline::shared::grid::PeriodicAxis;
use flexspline::shared::windup;

/// One equation: its non-zero coefficients.
pub(super) struct SampleRow {
    pub error_rad: f64,
    /// Unknowns of the ripple around the sample, and their weights.
    pub ripple: [(usize, f64); 12],
    /// Cosine and sine of every harmonic; the first `2·harmonics` count.
    pub harmonics: [f64; 6 * MAX_HARMONICS],
    pub bend: Bend,
}

/// Contribution of the cubic of D on top of the straight line between two torque nodes, per unit of D.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Bend {
    /// The first torque node, and the weights from there on.
    first: usize,
    weights: [f64; STENCIL + 1],
    /// First record of each temperature, and its share.
    temperatures: [(usize, f64); 2],
}

impl Bend {
    pub fn for_each(&self, mut visit: impl FnMut(usize, f64)) {
        for (start, share) in self.temperatures {
            for (torque, weight) in (self.first..).zip(self.weights) {
                if weight != 0.0 && share != 0.0 {
                    visit(start + torque, weight * share);
                }
            }
        }
    }

    /// The sum over D of each record.
    pub fn of(&self, means: &[f64]) -> f64 {
        let mut sum = 0.0;
        self.for_each(|record, weight| sum += weight * means.get(record).copied().unwrap_or(0.0));
        sum
    }
}

impl Plan<'_> {
    fn bend(&self, sample: &Sample, slopes: &Slopes) -> Bend {
        let torque = Self::place(self.torque_nodes_n_m, sample.torque_n_m);
        if torque.weight <= 0.0 || torque.weight >= 1.0 {
            return Bend::default();
        }
        let node = |node: usize| self.torque_nodes_n_m.get(node).copied().unwrap_or(0.0);
        let (low, high) = (slopes.at(torque.below), slopes.at(torque.above));
        let mut bend = Bend { first: low.first.min(high.first), ..Bend::default() };
        let mut add = |node: usize, value: f64| add(&mut bend.weights, node - bend.first, value);
        let width = node(torque.above) - node(torque.below);
        let [rise, below, above] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .map(|unit| windup::bend(torque.weight, width, unit) as f64);
        add(torque.above, rise);
        add(torque.below, -rise);
        for (slope, part) in [(low, below), (high, above)] {
            (slope.first..).zip(slope.weights).for_each(|(node, weight)| add(node, part * weight));
        }
        let temperature = Self::place(self.temperature_nodes_c, sample.temperature_c);
        let (start, hot) = (|node: usize| node * self.torque_nodes_n_m.len(), temperature.weight as f64);
        bend.temperatures = [(start(temperature.below), 1.0 - hot), (start(temperature.above), hot)];
        bend
    }

    /// The equation of a sample; `kept` has its cosines and sines from the first time on, NaN before.
    pub(super) fn row(&self, sample: &Sample, slopes: &Slopes, kept: Option<&mut [f64]>) -> SampleRow {
        let generator = GeneratorAngle::from_rad(sample.generator_rad).unwrap_or_default();
        let phases = self.drive.phases(generator, self.drive.nominal_output(generator));
        let mut row = SampleRow {
            error_rad: self.error_rad(sample),
            ripple: [(0, 0.0); 12],
            harmonics: [0.0; 6 * MAX_HARMONICS],
            bend: self.bend(sample, slopes),
        };
        let (nodes, weights) = match PeriodicAxis::new(self.ripple_nodes) {
            Some(axis) if !axis.is_empty() => {
                let cell = axis.locate(phases.tooth);
                (axis.around(cell), cell.weights())
            }
            _ => ([0; 3], [1.0, 0.0, 0.0]),
        };
        let first = direction_number(sample.direction) * self.block();
        let pairs = self.corners(sample).into_iter().flat_map(|(record, weight)| {
            let base = first + record * self.coefficients();
            nodes.into_iter().zip(weights).map(move |(node, share)| (base + node, weight * share as f64))
        });
        row.ripple.iter_mut().zip(pairs).for_each(|(to, from)| *to = from);
        if let Some(kept) = kept.as_deref().filter(|kept| kept.first().is_some_and(|value| !value.is_nan())) {
            row.harmonics.iter_mut().zip(kept).for_each(|(to, from)| *to = *from);
            return row;
        }
        let parts =
            [(self.generator, phases.generator), (self.material, phases.material), (self.output, phases.output)];
        let angles = parts.iter().flat_map(|(part, phase)| {
            part.orders.iter().map(|&order| phase.wrapping_mul(order as u32) as f64 * (TAU / 4_294_967_296.0))
        });
        for (pair, angle) in row.harmonics.chunks_exact_mut(2).zip(angles) {
            let (sine, cosine) = libm::sincos(angle);
            pair.iter_mut().zip([cosine, sine]).for_each(|(to, from)| *to = from);
        }
        kept.into_iter().flatten().zip(row.harmonics).for_each(|(to, from)| *to = from);
        row
    }
}

pub(super) fn for_each_entry(plan: &Plan<'_>, row: &SampleRow, mut visit: impl FnMut(usize, f64)) {
    row.ripple.iter().filter(|(_, weight)| *weight != 0.0).for_each(|&(unknown, weight)| visit(unknown, weight));
    let first = 2 * plan.block();
    let count = 2 * plan.harmonics();
    row.harmonics.iter().take(count).enumerate().for_each(|(number, &value)| visit(first + number, value));
}

pub(super) fn add(vector: &mut [f64], index: usize, value: f64) {
    if let Some(element) = vector.get_mut(index) {
        *element += value;
    }
}
