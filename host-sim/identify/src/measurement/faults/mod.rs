//! What is wrong with data, found before any physics is blamed. One file for each kind, its thresholds at its head.
//!
//! Two grades: what cannot go on is an error with one message; all else is a [`Fault`] that is named, and repaired or
//! left out.
//!
//! | found | done |
//! |---|---|
//! | no table, no such column, text for a number, a row too short or too long | error |
//! | under 16 rows, nothing moves, more than half frozen, units that are ambiguous | error |
//! | torque, temperature, orientation or time missing in up to 10 rows in a row | filled by a straight line |
//! | an angle missing, a longer hole, a last line that breaks off | rows left out |
//! | a channel other than the angles missing in over half of the rows | channel left out |
//! | rows missing, by steps of time | named |
//! | rows out of order or repeated | rows left out |
//! | clock set back | new session |
//! | clock too coarse, stamps that jitter while the motion does not | rows spaced evenly |
//! | a unit, sign or exchange of the angles that the ratio or a turn proves | converted |
//! | a torque or a temperature that cannot be in the unit given | left out, with the units that it may be in |
//! | output or generator frozen | rows left out |
//! | torque frozen | rows left out, or channel |
//! | torque repeated, one value in this many rows | a straight line between the new ones |
//! | angle repeated so | rows that repeat it left out |
//! | temperature frozen | straight line, or channel left out |
//! | torque in coarse steps | read off where it goes from one to the next |
//! | single rows out | rows left out (torque, temperature: mended) |
//! | the logger stands still while its time counts on | time made anew from the motion |
//! | an angle leaps by whole motor turns, in a row or between sessions | turns taken out |
//! | another zero from a session on | the zero of that session is fitted on its own |
//! | angles read at different instants | rows weigh what their speed leaves of them; rows read far apart left out |
//! | index jump | step taken out |
//! | drift | straight line in time taken out |
//! | coarse resolution, implausible time | named |

pub(super) mod clock;
pub(super) mod coarse_torque;
pub(super) mod drift;
pub(super) mod frozen;
pub(super) mod held;
pub(super) mod lattice;
pub(super) mod leaps;
pub(super) mod missing;
pub(super) mod outliers;
pub(super) mod reads;
pub(super) mod resolution;
pub(super) mod stalls;
mod state;
pub(super) mod steps;
pub(super) mod units;
pub(super) mod wrap;

use std::ops::Range;

use super::Session;
use super::fault::{Fault, FaultName, ToothStep};
use super::gear::Gear;
use super::log::Log;

/// An arcsecond, rad: 1/648 000 of half a turn, by definition.
const ARCSEC: f64 = std::f64::consts::PI / 648_000.0;

/// What the checks have found so far.
#[derive(Debug, Default)]
pub(super) struct Findings {
    pub faults: Vec<Fault>,
    pub tooth_steps: Vec<ToothStep>,
    pub notes: Vec<String>,
}

/// A fault from row `first` to row `last` of a log, to be completed.
fn span(log: &Log, name: FaultName, first: usize, last: usize) -> Fault {
    Fault {
        time_s: log.time_at(first),
        until_s: log.time_at(last),
        ..Fault::new(name, [log.line[first], log.line[last]], (last - first + 1) as u64)
    }
}

/// A fault in some rows (at least one) of a session, to be completed.
fn of_rows(session: &Session, name: FaultName, rows: Range<usize>) -> Fault {
    let last = rows.end - 1;
    let time = |row: usize| session.time_s.as_ref().map(|time| time[row]);
    Fault {
        time_s: time(rows.start),
        until_s: time(last),
        ..Fault::new(name, [session.line[rows.start], session.line[last]], rows.len() as u64)
    }
}

/// A fault of all rows, to be completed; nothing without rows.
pub(crate) fn throughout(sessions: &[Session], name: FaultName) -> Option<Fault> {
    let (first, last) = (sessions.first()?, sessions.last()?);
    let whole = of_rows(last, name, 0..last.len());
    let rows = sessions.iter().map(|session| session.len() as u64).sum();
    Some(Fault { last_line: whole.last_line, until_s: whole.until_s, rows, ..of_rows(first, name, 0..first.len()) })
}

/// Whether an angle at the output is a whole number of tooth pitches, but for this share of a pitch.
fn whole_pitches(angle_rad: f64, gear: &Gear, share: f64) -> bool {
    gear.tooth_pitch_rad.is_some_and(|pitch| {
        let pitches = (angle_rad / pitch).round();
        pitches != 0.0 && (angle_rad - pitches * pitch).abs() < share * pitch
    })
}
