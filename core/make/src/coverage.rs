//! Whether samples determine every unknown.

use super::error::ProjectError;
use super::plan::{MissingDirection, Plan, Sample, direction_number};
use core::f64::consts::TAU;
use flexspline::Direction;

/// A harmonic needs this part of its period, or of its beat with another, to be distinguishable. Below 1, because
/// samples spread over a period end one step short of it.
const PERIOD_NEEDED: f64 = 0.95;
/// A ripple coefficient is determined if its samples weigh at least this part of the average coefficient's.
const WEIGHT_NEEDED: f64 = 0.15;

impl Plan<'_> {
    pub(super) fn check_coverage(&self, samples: &[Sample]) -> Result<(), ProjectError> {
        let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
        for sample in samples {
            first = first.min(sample.generator_rad);
            last = last.max(sample.generator_rad);
        }
        let found_turns = (last - first) / TAU;
        let curves = self.curves();
        let frequencies = || {
            let harmonics = curves
                .iter()
                .flat_map(|(_, part, periods)| part.orders.iter().map(move |&order| order as f64 * periods));
            harmonics.chain([0.0]).enumerate()
        };
        // The closest two of all frequencies, a constant included, beat with the longest period.
        let mut closest = f64::INFINITY;
        for (i, one) in frequencies() {
            for (j, other) in frequencies() {
                if i < j {
                    closest = closest.min((one.abs() - other.abs()).abs());
                }
            }
        }
        let needed_turns = if closest < 1e-9 { f64::INFINITY } else { PERIOD_NEEDED / closest };
        if found_turns >= needed_turns { Ok(()) } else { Err(ProjectError::Coverage { needed_turns, found_turns }) }
    }

    /// Whether every ripple coefficient has the samples it needs; `diagonal` is that of the normal equations.
    pub(super) fn check_positions(&self, diagonal: &[f64], marks: &[u64]) -> Result<(), ProjectError> {
        let count = self.coefficients();
        for record in 0..self.records() {
            let (temperature, torque) =
                (record / self.torque_nodes_n_m.len().max(1), record % self.torque_nodes_n_m.len().max(1));
            let mut sampled = 0;
            for direction in [Direction::Forward, Direction::Backward] {
                let node = direction_number(direction) * self.records() + record;
                let weights = diagonal.get(node * count..(node + 1) * count).unwrap_or_default();
                let total: f64 = weights.iter().sum();
                if total <= 0.0 {
                    continue;
                }
                sampled += 1;
                let enough = WEIGHT_NEEDED * total / count as f64;
                let gaps = weights.iter().filter(|weight| **weight < enough).count() as u32;
                let positions = marks.get(node).map_or(0, |mark| mark.count_ones());
                let needed = count as u32;
                if positions < needed || gaps > 0 {
                    let found = positions.min(needed.saturating_sub(gaps));
                    return Err(ProjectError::TooFewPositions { temperature, torque, direction, found, needed });
                }
            }
            if sampled == 0 {
                return Err(ProjectError::MissingNode { temperature, torque });
            }
            let missing = [Direction::Forward, Direction::Backward].into_iter().find(|&direction| {
                let node = direction_number(direction) * self.records() + record;
                diagonal.get(node * count).is_none_or(|weight| *weight <= 0.0)
            });
            if let (Some(direction), MissingDirection::Refuse) = (missing, self.missing_direction) {
                return Err(ProjectError::MissingDirection { temperature, torque, direction });
            }
        }
        Ok(())
    }
}
