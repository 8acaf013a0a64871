//! Counters that overflow at a power of two of counts, made continuous.
//!
//! An angle that begins anew after a turn is found later, in radians. Here it is the counter of some bits that begins anew, after a
//! number of turns or a part of one.

use super::columns::{Column, Quantity, Unit};
use super::log::Log;
use super::robust::least_and_most;

/// Counters have so many bits.
const BITS: std::ops::RangeInclusive<i32> = 8..=32;
/// A counter that overflowed has been through this share of its range.
const COVERED: f64 = 0.9;
/// Steps up to this share of the range are told from an overflow.
const UNAMBIGUOUS: f64 = 0.4;

/// Makes counters of angles continuous where they overflow and the steps between leave no doubt.
pub(super) fn undo(log: &mut Log, columns: &[Column], notes: &mut Vec<String>) {
    for column in columns {
        let angle = matches!(column.quantity, Quantity::Generator | Quantity::Output | Quantity::Orientation);
        if !angle || column.reading.unit != Unit::Count {
            continue;
        }
        let count_rad = (column.reading.gain * column.unit.factor()).abs();
        let Some(values) = log.get_mut(column.quantity) else { continue };
        let Some((bits, times)) = overflow(values, count_rad) else { continue };
        let range = 2f64.powi(bits) * count_rad;
        // One turn is for the check of wrapped angles, which the other angle helps.
        if (range / std::f64::consts::TAU - 1.0).abs() < 1e-9 {
            continue;
        }
        let mut last = f64::NAN;
        for value in values.iter_mut().filter(|value| value.is_finite()) {
            if last.is_finite() {
                *value -= range * ((*value - last) / range).round();
            }
            last = *value;
        }
        notes
            .push(format!("{} begins anew after 2^{bits} counts ({times} times): it was made continuous", column.name));
    }
}

/// The bits of a counter that overflows, and how often.
fn overflow(values: &[f64], count_rad: f64) -> Option<(i32, usize)> {
    let finite: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    let (least, most) = least_and_most(finite.iter().copied());
    let counts = (most - least) / count_rad;
    // The number of bits follows from the range: the smallest power of two that holds it.
    let bits = BITS.into_iter().find(|bits| counts <= 2f64.powi(*bits))?;
    let range = 2f64.powi(bits) * count_rad;
    if counts < COVERED * 2f64.powi(bits) {
        return None;
    }
    let steps = || finite.windows(2).map(|pair| pair[1] - pair[0]);
    let times = steps().filter(|step| step.abs() > 0.5 * range).count();
    let largest = steps().map(|step| (step - range * (step / range).round()).abs()).fold(0.0, f64::max);
    (times > 0 && largest <= UNAMBIGUOUS * range).then_some((bits, times))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_overflow_is_told_from_a_jump() {
        let count = std::f64::consts::TAU / 4096.0;
        let sweep = |step: i64| -> Vec<f64> {
            (0..2000i64).map(|k| ((k * step + 40_000) % 65_536 - 32_768) as f64 * count).collect()
        };
        assert_eq!(overflow(&sweep(1000), count), Some((16, 31)));
        // Too fast to tell which way.
        assert_eq!(overflow(&sweep(30_000), count), None);
        // A jump of half the range is no overflow.
        let jump: Vec<f64> = (0..2000).map(|k| if k < 1000 { 0.0 } else { 33_000.0 * count }).collect();
        assert_eq!(overflow(&jump, count), None);
        let steady: Vec<f64> = (0..2000).map(|k| 32.0 * f64::from(k) * count).collect();
        assert_eq!(overflow(&steady, count), None);
    }
}
