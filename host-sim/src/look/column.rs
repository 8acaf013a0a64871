//! What the numbers of a column show by themselves.

use crate::measurement::raw::RawColumn;
use crate::measurement::{least_and_most, median_of, sampled};

/// Values that are looked at for steps and resolution, at most.
const LOOKED_AT: usize = 50_000;
/// A column that begins anew covers this share of its turn, and steps by more than half of it.
const COVERED: f64 = 0.75;

/// What a column shows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Facts {
    /// Numbers, without what is missing.
    pub finite: usize,
    pub least: f64,
    pub most: f64,
    /// Smallest change from row to row that is not zero.
    pub step: f64,
    /// Whether all numbers are whole.
    pub whole: bool,
    /// Whether it never falls.
    pub rises: bool,
    /// Share of the rows that repeat the one before.
    pub repeats: f64,
    /// Median of the change from row to row over the range: small for what moves smoothly.
    pub roughness: f64,
    /// One value in so many rows, where most are empty.
    pub every: usize,
    /// The number after which it begins anew, if it does.
    pub wraps_at: Option<f64>,
}

impl Facts {
    pub fn of(column: &RawColumn) -> Facts {
        let values: Vec<f64> = column.values.iter().copied().filter(|value| value.is_finite()).collect();
        let (least, most) = least_and_most(values.iter().copied());
        let some = &values[..values.len().min(LOOKED_AT)];
        let steps: Vec<f64> = some.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let range = most - least;
        let moved: Vec<f64> = steps.iter().map(|step| step.abs()).filter(|step| *step > 0.0).collect();
        let count = steps.len().max(1) as f64;
        Facts {
            finite: values.len(),
            least,
            most,
            step: moved.iter().copied().fold(f64::INFINITY, f64::min),
            whole: !values.is_empty() && values.iter().all(|value| value.fract() == 0.0),
            rises: steps.iter().all(|step| *step >= 0.0),
            repeats: 1.0 - moved.len() as f64 / count,
            roughness: if range > 0.0 && !moved.is_empty() { median_of(&mut sampled(&moved)) / range } else { 0.0 },
            every: if values.is_empty() {
                0
            } else {
                (column.values.len() as f64 / values.len() as f64).round() as usize
            },
            wraps_at: wraps_at(&steps, range, least),
        }
    }

    /// Whether it keeps one value.
    pub fn constant(&self) -> bool {
        self.most <= self.least
    }
}

/// Turns that a column may begin anew after: those of the units of angle, and powers of two of counts.
fn turns() -> impl Iterator<Item = f64> {
    let units = [1.0, std::f64::consts::TAU, 360.0, 21_600.0, 1_296_000.0];
    units.into_iter().chain((8..=32).map(|bits| 2f64.powi(bits)))
}

fn wraps_at(steps: &[f64], range: f64, least: f64) -> Option<f64> {
    let turn = turns().find(|turn| range <= turn * (1.0 + 1e-6) && range >= COVERED * turn)?;
    // Anew at zero, or from plus to minus one half.
    let placed = least >= -1e-6 * turn || least >= -0.5 * turn * (1.0 + 1e-6);
    let anew = steps.iter().filter(|step| step.abs() > 0.5 * turn).count();
    (placed && anew > 0).then_some(turn)
}

/// Values made continuous where they begin anew after `turn`; what is missing stays so.
pub(super) fn unwrapped(values: &[f64], turn: Option<f64>) -> Vec<f64> {
    let Some(turn) = turn else { return values.to_vec() };
    let mut last = f64::NAN;
    values
        .iter()
        .map(|value| {
            if !value.is_finite() {
                return *value;
            }
            let near = if last.is_finite() { value - turn * ((value - last) / turn).round() } else { *value };
            last = near;
            near
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facts(values: impl IntoIterator<Item = f64>) -> Facts {
        Facts::of(&RawColumn { values: values.into_iter().collect(), ..RawColumn::default() })
    }

    #[test]
    fn wraps_are_seen_and_undone() {
        for turn in [360.0, std::f64::consts::TAU, 1.0, 4096.0] {
            let wrapped: Vec<f64> = (0..500).map(|k| (0.031 * turn * f64::from(k)).rem_euclid(turn)).collect();
            assert_eq!(facts(wrapped.clone()).wraps_at, Some(turn));
            let whole = unwrapped(&wrapped, Some(turn));
            assert!((whole[499] - 0.031 * turn * 499.0).abs() < 1e-6 * turn);
        }
        assert_eq!(facts((0..500).map(f64::from)).wraps_at, None);
    }

    #[test]
    fn facts_are_those_of_the_numbers() {
        let f = facts((0..100).map(|k| if k % 4 == 0 { f64::from(k) } else { f64::NAN }));
        assert_eq!((f.finite, f.every, f.step, f.whole, f.rises), (25, 4, 4.0, true, true));
        assert!(facts([2.0; 20]).constant());
    }
}
