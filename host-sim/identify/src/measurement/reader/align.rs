//! Channels that are recorded each at its own instants, laid on the instants of one of them.

use flexspline_base::robust::{least_and_most, median_of, sampled};

/// Two channels are never recorded together if they share fewer rows than this share of those of the rarer
/// one. *Guess*.
const TOGETHER: f64 = 0.1;
/// Values farther apart than so many of a channel's usual distances have a gap between them.
const GAP: f64 = 4.0;
/// Fewest values of a channel.
const FEWEST: usize = 16;
/// An angle moves at a pace if it does by this share of its usual one: what jitters at rest does not turn
/// round. *Guess*.
const AT_PACE: f64 = 0.25;
/// An angle that moves by more than this share of all that it goes through begins anew there.
const BEGINS_ANEW: f64 = 0.5;

/// Whether two channels are hardly ever recorded in one row though either has values.
pub(crate) fn apart(a: &[f64], b: &[f64]) -> bool {
    let count = |values: &[f64]| values.iter().filter(|value| value.is_finite()).count();
    let rarer = count(a).min(count(b));
    let both = a.iter().zip(b).filter(|(a, b)| a.is_finite() && b.is_finite()).count();
    rarer >= FEWEST && (both as f64) < TOGETHER * rarer as f64
}

/// A channel at these instants: cubic between four values that follow one another, straight beside a gap, nothing in
/// one. Gives the largest distance to a value of its own, in the unit of the instants. An angle that turns round
/// between two values has nothing there: how far it went is not recorded.
pub fn at(instants: &[f64], own: &[f64], values: &[f64], is_angle: bool) -> (Vec<f64>, f64) {
    let mut known: Vec<(f64, f64)> = own
        .iter()
        .copied()
        .zip(values.iter().copied())
        .filter(|(t, value)| t.is_finite() && value.is_finite())
        .collect();
    known.sort_by(|a, b| a.0.total_cmp(&b.0));
    known.dedup_by(|a, b| a.0 == b.0);
    if known.len() < 2 {
        return (vec![f64::NAN; instants.len()], 0.0);
    }
    let steps: Vec<f64> = known.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    let gap = GAP * median_of(&mut sampled(&steps));
    let (least, most) = least_and_most(known.iter().map(|(_, value)| *value));
    let jump = BEGINS_ANEW * (most - least);
    let follows = |k: usize| {
        known.get(k + 1).is_some_and(|next| next.0 - known[k].0 <= gap && (next.1 - known[k].1).abs() <= jump)
    };
    let paces: Vec<f64> = known.windows(2).map(|pair| (pair[1].1 - pair[0].1) / (pair[1].0 - pair[0].0)).collect();
    let moves = AT_PACE * median_of(&mut sampled(&paces.iter().map(|pace| pace.abs()).collect::<Vec<_>>()));
    let turns_round = |k: usize| {
        let (before, after) = (k.checked_sub(1).map(|k| paces[k]), paces.get(k + 1));
        matches!((before, after), (Some(before), Some(after))
            if before * after < 0.0 && before.abs() > moves && after.abs() > moves)
    };
    let mut farthest: f64 = 0.0;
    let aligned = instants
        .iter()
        .map(|instant| {
            let next = known.partition_point(|(t, _)| t <= instant);
            let Some(k) = next.checked_sub(1) else { return f64::NAN };
            if known[k].0 == *instant {
                return known[k].1;
            }
            if !follows(k) || (is_angle && turns_round(k)) {
                return f64::NAN;
            }
            farthest = farthest.max((instant - known[k].0).min(known[k + 1].0 - instant));
            let slope = |a: usize, b: usize| (known[b].1 - known[a].1) / (known[b].0 - known[a].0);
            let before = if k > 0 && follows(k - 1) { slope(k - 1, k + 1) } else { slope(k, k + 1) };
            let after = if follows(k + 1) { slope(k, k + 2) } else { slope(k, k + 1) };
            let step = known[k + 1].0 - known[k].0;
            let s = (instant - known[k].0) / step;
            // Hermite's cubic through two values with the slopes of their neighbours (Catmull-Rom).
            let (s2, s3) = (s * s, s * s * s);
            (2.0 * s3 - 3.0 * s2 + 1.0) * known[k].1
                + (s3 - 2.0 * s2 + s) * step * before
                + (3.0 * s2 - 2.0 * s3) * known[k + 1].1
                + (s3 - s2) * step * after
        })
        .collect();
    (aligned, farthest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_is_laid_on_the_instants_of_another() {
        let t = |k: usize| 0.05 * k as f64;
        let own: Vec<f64> = (0..400).map(|k| t(k) + 0.017).collect();
        let wave = |t: f64| (1.3 * t).sin() + 0.2 * t;
        let values: Vec<f64> = own.iter().map(|t| wave(*t)).collect();
        let instants: Vec<f64> = (0..400).map(t).collect();
        let (aligned, farthest) = at(&instants, &own, &values, false);
        assert!(aligned[0].is_nan() && (farthest - 0.017).abs() < 1e-9);
        let off = (1..400).map(|k| (aligned[k] - wave(t(k))).abs()).fold(0.0, f64::max);
        // The cubic's error is h^3 f''' / (9 sqrt 3) at most where its slopes are off: 3e-5 of 2.2; the straight line's
        // is 5e-4.
        assert!(off < 3e-4, "{off}");
        // Nothing in a gap, nor where the channel begins anew.
        let gap: Vec<f64> = own.iter().map(|t| if *t > 10.0 { t + 5.0 } else { *t }).collect();
        let (aligned, _) = at(&[12.0], &gap, &values, false);
        assert!(aligned[0].is_nan());
        let wrapped: Vec<f64> = own.iter().map(|t| (0.1 * t).rem_euclid(1.0)).collect();
        let (aligned, _) = at(&instants, &own, &wrapped, true);
        assert!(aligned.iter().skip(1).all(|value| value.is_nan() || (-0.001..1.001).contains(value)));
    }

    #[test]
    fn where_an_angle_turns_round_nothing_is_made_up() {
        let own: Vec<f64> = (0..100).map(|k| 0.1 * f64::from(k)).collect();
        let values: Vec<f64> = own.iter().map(|t| 5.0 - (t - 5.03).abs()).collect();
        let instants: Vec<f64> = own.iter().map(|t| t + 0.04).collect();
        let (angle, _) = at(&instants, &own, &values, true);
        // Two about the reversal, and the one behind the last value.
        assert_eq!(angle.iter().filter(|value| value.is_nan()).count(), 3);
        assert!(angle[50].is_nan() && !at(&instants, &own, &values, false).0[50].is_nan());
    }

    #[test]
    fn channels_of_one_row_are_not_apart() {
        let some = |of: usize| -> Vec<f64> { (0..100).map(|k| if k % 3 == of { 1.0 } else { f64::NAN }).collect() };
        assert!(apart(&some(0), &some(1)));
        assert!(!apart(&some(0), &some(0)));
        assert!(!apart(&some(0), &[f64::NAN; 100]));
    }
}
