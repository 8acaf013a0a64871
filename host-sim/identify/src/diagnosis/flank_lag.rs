//! How long the output takes to its other flank, found where the flank changes and nowhere else: a lag that is known to
//! first order alone leaves of one of 10 ms what passes for a hysteresis.

use std::ops::Range;

use super::base::{FLANK_S, WIDER};
use super::rows::Rows;
use super::thresholds::rivals::TOLD_APART;
use crate::least_squares::FreeSpan;
use flexspline_base::robust::dot;

/// Each lag that is tried is this many times the one before, from [`FLANK_S`] on. *Guess*: two to an octave.
const LONGER: f64 = std::f64::consts::SQRT_2;
/// The longest lag that a change of flank has, s. *Guess*: a load behind a clearance takes some milliseconds, and what
/// takes longer swings.
const LONGEST_S: f64 = 0.06;
/// Rows this long before a change of flank count for the lag, s. *Guess*: they only have to show where the error was.
const BEFORE_S: f64 = 0.05;
/// Rows this long after a change of flank count for the lag, s. *Guess*: five of the longest lags.
const AFTER_S: f64 = 0.3;
/// The lag explains a way of this width, in units of the nominal clearance, … *Guess*: as drives have it.
const WAY: Range<f64> = 0.5..WIDER;
/// … and this share of all that moves there beyond noise: a load that swings to and fro leaves most of it. *Guess*.
const LEAST_SHARE: f64 = 0.5;

/// The lag, s, with which the output follows a change of flank; [`FLANK_S`] where the rows tell no other. `left` is the
/// error less what is predicted with `flank`, arcsec.
pub(super) fn flank_lag(rows: &Rows, left: &[f64], flank: &[f64], half_backlash: f64) -> f64 {
    let windows = windows(rows, flank);
    let data = straightened(left, &windows);
    let all = dot(&data, &data);
    let gain = |lag_s: f64| -> (f64, f64) {
        let column = straightened(&behind(rows, flank, half_backlash, lag_s), &windows);
        let (along, square) = (dot(&column, &data), dot(&column, &column).max(f64::MIN_POSITIVE));
        (along * along / square, along / square)
    };
    let (usual, _) = gain(FLANK_S);
    let longer = std::iter::successors(Some(FLANK_S * LONGER), |lag| Some(lag * LONGER));
    // One beyond the longest is tried as well: where that explains the rows best, what they show is no lag of a flank.
    let tried = longer.take_while(|lag| *lag <= LONGEST_S * LONGER).map(|lag| (lag, gain(lag)));
    let Some((lag_s, (best, way))) = tried.max_by(|a, b| a.1.0.total_cmp(&b.1.0)) else { return FLANK_S };
    // From row to row the lag hardly moves: there the noise is.
    let noise = 0.5 * data.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum::<f64>();
    let variance = (all - best) / data.len().max(1) as f64;
    let clear = best - usual > TOLD_APART * variance && best > LEAST_SHARE * (all - noise);
    if clear && lag_s <= LONGEST_S && WAY.contains(&way) { lag_s } else { FLANK_S }
}

/// What the error lacks as the output follows a change of flank with a lag, arcsec.
pub(super) fn behind(rows: &Rows, flank: &[f64], half_backlash: f64, lag_s: f64) -> Vec<f64> {
    let reached = rows.lagged(flank, lag_s, false).into_iter().zip(flank);
    reached.map(|(reached, flank)| half_backlash * (reached - flank)).collect()
}

/// Rows about each change from one flank to the other, none of them twice.
fn windows(rows: &Rows, flank: &[f64]) -> Vec<Range<usize>> {
    let mut windows: Vec<Range<usize>> = Vec::new();
    for session in rows.sessions_used() {
        let mut from = session.start;
        let mut changes = Vec::new();
        let mut side = 0.0;
        for k in session.clone().filter(|k| flank[*k] != 0.0) {
            // Also through a row in the middle of the clearance.
            if flank[k] * side < 0.0 {
                changes.push(k);
            }
            side = flank[k];
        }
        changes.push(session.end);
        for pair in changes.windows(2) {
            let (change, next) = (pair[0], pair[1]);
            let begins = (from..change).find(|k| rows.time[change] - rows.time[*k] <= BEFORE_S).unwrap_or(change);
            let ends = (change..next).find(|k| rows.time[*k] - rows.time[change] > AFTER_S).unwrap_or(next);
            windows.push(begins..ends);
            from = ends;
        }
    }
    windows
}

/// Values of windows less the straight line in each.
fn straightened(values: &[f64], windows: &[Range<usize>]) -> Vec<f64> {
    let straight = |window: &Range<usize>| {
        let line = [vec![1.0; window.len()], (0..window.len()).map(|k| k as f64).collect()];
        FreeSpan::default().beyond(line).freed(values[window.clone()].to_vec())
    };
    windows.iter().flat_map(straight).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A session of a row a millisecond, and its flanks.
    fn turned_over(flank: impl Fn(usize) -> f64) -> (Rows, Vec<f64>) {
        let count = 8000;
        let time: Vec<f64> = (0..count).map(|k| 1e-3 * k as f64).collect();
        let rows = Rows {
            sessions: std::iter::once(0..count).collect(),
            used: vec![true],
            error: vec![0.0; count],
            generator: vec![0.0; count],
            time,
            ..Rows::default()
        };
        (rows, (0..count).map(flank).collect())
    }

    #[test]
    fn a_lag_is_found_where_the_flank_changes_up_to_the_longest() {
        let (rows, flank) = turned_over(|k| if k % 1000 < 500 { 1.0 } else { -1.0 });
        for (lag_s, found_s) in [(0.02, 0.02), (0.055, 0.0566), (0.08, FLANK_S)] {
            let found = flank_lag(&rows, &behind(&rows, &flank, 30.0, lag_s), &flank, 30.0);
            assert!((found - found_s).abs() < 1e-3, "{found} for {lag_s}");
        }
    }

    #[test]
    fn a_change_of_flank_through_the_middle_is_one() {
        let (rows, flank) = turned_over(|k| [1.0, 0.0, -1.0][usize::from(k >= 3000) + usize::from(k >= 3001)]);
        let found = windows(&rows, &flank);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].contains(&3001), "{found:?}");
    }
}
