//! Properties that the numbers of a column show by themselves.

use std::f64::consts::TAU;

use crate::measurement::reader::Cells;
use crate::measurement::{Anew, Unit, begins_anew, least_and_most, registers};

/// Values that are looked at for steps and resolution, at most.
const LOOKED_AT: usize = 50_000;

/// Properties of a column.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Facts {
    /// Numbers, without what is missing.
    pub finite: usize,
    pub least: f64,
    pub most: f64,
    /// Smallest change from row to row that is not zero.
    pub step: f64,
    /// Whether all numbers are whole, and written without decimals.
    pub whole: bool,
    /// Whether it never falls.
    pub rises: bool,
    /// The number after which it begins anew, if it does.
    pub anew: Option<Anew>,
}

impl Facts {
    pub fn of(column: &Cells) -> Facts {
        let values: Vec<f64> = column.values.iter().copied().filter(|value| value.is_finite()).collect();
        let (least, most) = least_and_most(values.iter().copied());
        let some = &values[..values.len().min(LOOKED_AT)];
        let steps: Vec<f64> = some.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let whole = !column.decimals && !values.is_empty() && values.iter().all(|value| value.fract() == 0.0);
        Facts {
            finite: values.len(),
            least,
            most,
            step: steps.iter().map(|step| step.abs()).filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min),
            whole,
            rises: steps.iter().all(|step| *step >= 0.0),
            anew: begins_anew(&column.values, &turns().collect::<Vec<_>>(), whole, None),
        }
    }

    /// Whether it keeps one value.
    pub(crate) fn constant(&self) -> bool {
        self.most <= self.least
    }
}

/// Spans that a column may begin anew after: the turn in each unit of angle, and registers of counts.
fn turns() -> impl Iterator<Item = f64> {
    Unit::ANGLES.into_iter().map(|unit| TAU / unit.factor()).chain(registers())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::continued;

    fn facts(values: impl IntoIterator<Item = f64>) -> Facts {
        Facts::of(&Cells { values: values.into_iter().collect(), ..Cells::default() })
    }

    #[test]
    fn wraps_are_seen_and_undone() {
        for turn in [360.0, std::f64::consts::TAU, 1.0, 4096.0] {
            let wrapped: Vec<f64> = (0..500).map(|k| (0.031 * turn * f64::from(k)).rem_euclid(turn)).collect();
            let anew = facts(wrapped.clone()).anew;
            assert!((anew.unwrap().span / turn - 1.0).abs() < 1e-12, "{anew:?}");
            let mut whole = wrapped;
            continued(&mut whole, anew.unwrap().span);
            assert!((whole[499] - 0.031 * turn * 499.0).abs() < 1e-6 * turn);
        }
        assert_eq!(facts((0..500).map(f64::from)).anew, None);
    }

    #[test]
    fn facts_are_those_of_the_numbers() {
        let f = facts((0..100).map(|k| if k % 4 == 0 { f64::from(k) } else { f64::NAN }));
        assert_eq!((f.finite, f.step, f.whole, f.rises), (25, 4.0, true, true));
        assert!(facts([2.0; 20]).constant());
    }
}
