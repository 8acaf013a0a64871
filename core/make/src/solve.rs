//! Least squares over all samples, by conjugate gradients.

use super::equations::{add, for_each_entry};
use super::error::ProjectError;
use super::plan::{Plan, Sample, direction_number};
use crate::slopes::Slopes;
use flexspline::{Direction, GeneratorAngle};

/// Conjugate gradients stop at this residual relative to the right-hand side: 1e-12 of 0.05 rad is far below 0.01″.
const RELATIVE_RESIDUAL: f64 = 1e-12;
/// Passes over the samples before giving up; 10 to 30 are usual.
const MAX_PASSES: u32 = 500;

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Vectors of the conjugate gradients.
pub(super) struct System<'w> {
    pub diagonal: &'w mut [f64],
    pub residual: &'w mut [f64],
    pub search: &'w mut [f64],
    pub product: &'w mut [f64],
    /// D of each record.
    pub means: &'w mut [f64],
    /// Sum for each D, before its coefficients share it.
    pub pulls: &'w mut [f64],
    /// Cosines and sines of as many samples as there is room for.
    pub kept: &'w mut [f64],
}

/// Which directions were sampled at a record, from the marks of [`solve`].
#[derive(Clone, Copy)]
pub(super) struct SampledNodes<'m> {
    pub records: usize,
    pub marks: &'m [u64],
}

impl SampledNodes<'_> {
    pub fn is(self, direction: Direction, record: usize) -> bool {
        self.marks.get(direction_number(direction) * self.records + record).is_some_and(|mark| *mark != 0)
    }

    /// Share of the average coefficient of each direction in D, and the sign of the half-width given that D has
    /// besides.
    fn shares(self, record: usize) -> ([(Direction, f64); 2], f64) {
        let (forward, backward, sign) =
            match (self.is(Direction::Forward, record), self.is(Direction::Backward, record)) {
                (true, false) => (1.0, 0.0, 1.0),
                (false, true) => (0.0, 1.0, -1.0),
                _ => (0.5, 0.5, 0.0),
            };
        ([(Direction::Forward, forward), (Direction::Backward, backward)], sign)
    }
}

impl Plan<'_> {
    /// Coefficients of one record and direction.
    fn range(&self, direction: Direction, record: usize) -> core::ops::Range<usize> {
        let first = direction_number(direction) * self.block() + record * self.coefficients();
        first..first + self.coefficients()
    }

    /// D of each record, without the half-width given for missing directions.
    fn gather_means(&self, sampled: SampledNodes<'_>, unknowns: &[f64], means: &mut [f64]) {
        for (record, mean) in means.iter_mut().enumerate() {
            let average = |direction| {
                let values = unknowns.get(self.range(direction, record)).unwrap_or_default();
                values.iter().sum::<f64>() / self.coefficients() as f64
            };
            *mean = sampled.shares(record).0.into_iter().map(|(direction, share)| share * average(direction)).sum();
        }
    }

    /// The transpose of [`Self::gather_means`].
    fn spread_pulls(&self, sampled: SampledNodes<'_>, pulls: &[f64], unknowns: &mut [f64]) {
        for (record, pull) in pulls.iter().enumerate() {
            for (direction, share) in sampled.shares(record).0 {
                let part = share * pull / self.coefficients() as f64;
                let values = unknowns.get_mut(self.range(direction, record)).unwrap_or_default();
                values.iter_mut().for_each(|value| *value += part);
            }
        }
    }
}

/// Least squares by conjugate gradients on the normal equations, scaled by their diagonal.
pub(super) fn solve(
    plan: &Plan<'_>,
    samples: &[Sample],
    solution: &mut [f64],
    marks: &mut [u64],
    system: System<'_>,
) -> Result<(), ProjectError> {
    let System { diagonal, residual, search, product, means, pulls, kept } = system;
    let (slopes, width) = (&Slopes::new(plan.torque_nodes_n_m), 2 * plan.harmonics());
    kept.fill(f64::NAN);
    let mut row_of =
        |index: usize, sample: &Sample| plan.row(sample, slopes, kept.get_mut(index * width..(index + 1) * width));
    solution.fill(0.0);
    diagonal.fill(0.0);
    residual.fill(0.0);
    marks.fill(0);
    // The diagonal leaves the bend out: it scales the equations and counts the samples of a coefficient.
    for (index, sample) in plan.used(samples) {
        let row = row_of(index, sample);
        for_each_entry(plan, &row, |unknown, value| add(diagonal, unknown, value * value));
        let generator = GeneratorAngle::from_rad(sample.generator_rad).unwrap_or_default();
        let tooth = generator.fraction().wrapping_mul(plan.drive.ripple_order() as u32);
        for (record, weight) in plan.corners(sample) {
            let node = direction_number(sample.direction) * plan.records() + record;
            if let Some(mark) = marks.get_mut(node).filter(|_| weight >= 0.25) {
                *mark |= 1 << (tooth >> 26);
            }
        }
    }
    plan.check_positions(diagonal, marks)?;
    let sampled = SampledNodes { records: plan.records(), marks };

    // What is known of D before: the half-width given for a missing direction.
    let given = plan.missing_direction.half_width_rad();
    means.iter_mut().enumerate().for_each(|(record, mean)| *mean = given * sampled.shares(record).1);
    pulls.fill(0.0);
    for (index, sample) in plan.used(samples) {
        let row = row_of(index, sample);
        let wanted = row.error_rad - row.bend.of(means);
        for_each_entry(plan, &row, |unknown, value| add(residual, unknown, value * wanted));
        row.bend.for_each(|record, weight| add(pulls, record, weight * wanted));
    }
    plan.spread_pulls(sampled, pulls, residual);

    // Unknowns without samples have an empty row: they stay zero, and `lay_out` fills them.
    let scaled = |value: f64, diagonal: f64| {
        if diagonal > 0.0 { value / diagonal } else { 0.0 }
    };
    for ((search, residual), diagonal) in search.iter_mut().zip(&*residual).zip(&*diagonal) {
        *search = scaled(*residual, *diagonal);
    }
    let mut size = dot(residual, search);
    let start = size;
    let mut passes = 0;
    while size > RELATIVE_RESIDUAL * RELATIVE_RESIDUAL * start {
        if passes == MAX_PASSES {
            return Err(ProjectError::NotConverged { passes, residual: libm::sqrt(size / start) });
        }
        passes += 1;
        product.fill(0.0);
        pulls.fill(0.0);
        plan.gather_means(sampled, search, means);
        for (index, sample) in plan.used(samples) {
            let row = row_of(index, sample);
            let mut along = row.bend.of(means);
            for_each_entry(plan, &row, |unknown, value| {
                along += value * search.get(unknown).copied().unwrap_or(0.0);
            });
            for_each_entry(plan, &row, |unknown, value| add(product, unknown, value * along));
            row.bend.for_each(|record, weight| add(pulls, record, weight * along));
        }
        plan.spread_pulls(sampled, pulls, product);
        let step = size / dot(search, product);
        for ((solution, residual), (search, product)) in
            solution.iter_mut().zip(residual.iter_mut()).zip(search.iter().zip(&*product))
        {
            *solution += step * search;
            *residual -= step * product;
        }
        let before = size;
        size =
            residual.iter().zip(&*diagonal).map(|(&residual, &diagonal)| residual * scaled(residual, diagonal)).sum();
        for ((search, residual), diagonal) in search.iter_mut().zip(&*residual).zip(&*diagonal) {
            *search = scaled(*residual, *diagonal) + size / before * *search;
        }
    }
    Ok(())
}
