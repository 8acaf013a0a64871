//! An output that hangs in the clearance: the load has changed its side, but hardly exceeds friction, and does not move
//! the output to the other flank yet.

use std::ops::Range;

use super::base::rows_of_crossing;
use super::candidate::Excitation;
use super::rows::Rows;

/// The load has changed its side, and the flank with it, once it was this many times friction there: until then the
/// output may hang in the clearance, as what hardly exceeds friction hardly moves a load behind it. *Chosen*: of joints
/// in motion, one clean and one worn, hung at 1.36 and 1.45 times.
const CARRIES: f64 = 2.0;
/// Or once it is beyond friction for so long, s. *Guess*: those hung for 0.3 and 1.3 s.
const HANGS_S: f64 = 3.0;
/// The output is this share of half the clearance short of the flank, at least, where it hangs. *Chosen*: those joints
/// hung at 0.9 to 2 times, by what was explained when other causes still stood in for it.
const SHORT: f64 = 0.6;
/// A clearance shows where that is at least this multiple of the noise of a row. *Guess*.
const BEYOND_NOISE: f64 = 3.0;

/// Rows in which the output hangs in the clearance, as it stays far short of what causes and base explain beside the
/// nominal prediction. The noise of a row is `white`, arcsec.
pub(crate) fn hanging(on: &Excitation<'_>, explained: &[f64], white: f64) -> Vec<bool> {
    let rows = on.rows;
    let mut hanging = vec![false; rows.len()];
    let least = SHORT * on.base.half_backlash;
    if least < BEYOND_NOISE * white {
        return hanging;
    }
    let left = on.left(explained);
    for session in &rows.sessions {
        for MayHang { rows: event, side } in may_hang(rows, session, on.nominal.friction_torque_n_m) {
            let short = |k: &usize| left[*k] * side > least;
            let Some(last) = event.clone().rev().find(short) else { continue };
            let over = event.start..last + 1;
            // Most of them: a row far behind that was read wrong is no output that hangs so long.
            if 2 * over.clone().filter(short).count() > over.len() {
                hanging[over.start..(over.end + rows_of_crossing(rows)).min(session.end)].fill(true);
            }
        }
    }
    hanging
}

/// Rows one after another in which the output may hang.
#[derive(Debug, PartialEq)]
struct MayHang {
    rows: Range<usize>,
    /// Side on which the load carried before: its sign.
    side: f64,
}

/// Rows of a session from a change of the load's side on until it has been so large, or so long, that it must have
/// moved the output.
fn may_hang(rows: &Rows, session: &Range<usize>, friction_n_m: f64) -> Vec<MayHang> {
    let mut events: Vec<MayHang> = Vec::new();
    // The load's side, and since when it has been there while the output may still be on the other.
    let (mut now, mut since): (f64, Option<f64>) = (0.0, None);
    for k in session.clone().filter(|k| rows.torque[*k].abs() > friction_n_m) {
        let torque = rows.torque[k];
        if torque * now <= 0.0 {
            since = (now != 0.0).then_some(rows.time[k]);
            now = torque.signum();
        }
        since = since.filter(|since| torque.abs() < CARRIES * friction_n_m && rows.time[k] - since < HANGS_S);
        if since.is_some() {
            match events.last_mut() {
                Some(event) if event.rows.end == k && event.side == -now => event.rows.end = k + 1,
                _ => events.push(MayHang { rows: k..k + 1, side: -now }),
            }
        }
    }
    events
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::Session;
    use crate::synthesize::catalogue_drive;

    fn rows_of(times_friction: &[f64], period_s: f64) -> Rows {
        let nominal = catalogue_drive();
        let session = Session {
            line: (0..times_friction.len() as u64).collect(),
            generator_rad: (0..times_friction.len()).map(|k| 0.1 * k as f64).collect(),
            error_rad: vec![0.0; times_friction.len()],
            time_s: Some((0..times_friction.len()).map(|k| period_s * k as f64).collect()),
            torque_n_m: Some(times_friction.iter().map(|times| times * nominal.friction_torque_n_m).collect()),
            ..Session::default()
        };
        Rows::new(&[session], &nominal)
    }

    #[test]
    fn a_load_that_hardly_exceeds_friction_may_leave_the_output_in_the_clearance() {
        let nominal = catalogue_drive();
        let events = |times_friction: &[f64], period_s: f64| {
            let rows = rows_of(times_friction, period_s);
            may_hang(&rows, &rows.sessions[0], nominal.friction_torque_n_m)
        };
        let event = |rows: Range<usize>, side: f64| MayHang { rows, side };
        assert_eq!(events(&[9.0, 1.5, -0.5, -1.5, -1.5, -2.5, -1.5], 0.01), [event(3..5, 1.0)]);
        // Back to a side that it may have left.
        assert_eq!(events(&[9.0, -1.5, 1.5, 9.0, -9.0], 0.01), [event(1..2, 1.0), event(2..3, -1.0)]);
        // Beyond friction for long.
        assert_eq!(events(&[9.0, -1.5, -1.5, -1.5], 2.0), [event(1..3, 1.0)]);
        assert_eq!(events(&[1.5, 1.5, 1.5, 1.5], 0.01), []);
        assert_eq!(events(&[-9.0, -0.5, 0.5, -1.5, -2.5], 0.01), []);
    }
}
