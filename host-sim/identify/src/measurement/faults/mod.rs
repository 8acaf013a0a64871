//! Faults of data, found before any physics is blamed. One file for each kind, its thresholds at its head.
//!
//! Two grades: what cannot go on is an error with one message; all else is a [`Fault`] that is named, and repaired or
//! left out.
//!
//! | found | done |
//! |---|---|
//! | no table, no such column, text for a number, a row too short or too long | error |
//! | under 16 rows, nothing moves, more than half frozen | error |
//! | torque, temperature, orientation or time missing in up to 10 rows in a row | filled by a straight line |
//! | an angle missing, a longer hole, a last line that breaks off | rows left out |
//! | a channel other than the angles missing in over half of the rows | channel left out |
//! | rows missing, by steps of time | named |
//! | rows out of order or repeated | rows left out |
//! | clock set back | new session |
//! | clock too coarse, stamps that jitter while the motion does not | rows spaced evenly |
//! | a unit or sign of the angles that the ratio contradicts | error |
//! | generator and output exchanged | put right |
//! | a torque or a temperature that cannot be in the unit given | left out, with the units that it may be in |
//! | output or generator frozen | rows left out |
//! | torque frozen | rows left out, or channel |
//! | torque repeated, one value in this many rows | a straight line between the new ones |
//! | angle repeated so | rows that repeat it left out |
//! | temperature frozen | straight line, or channel left out |
//! | single rows out | rows left out (torque, temperature: mended) |
//! | the logger stands still while its time counts on | time made anew from the motion |
//! | an angle leaps by whole motor turns, in a row or between sessions | turns taken out |
//! | another zero from a session on | the zero of that session is fitted on its own |
//! | angles read at different instants | rows weigh what their speed leaves of them; rows read far apart left out |
//! | index jump | step taken out |
//! | coarse resolution of an angle or of the torque, implausible time | named |

pub(super) mod clock;
pub(super) mod frozen;
pub(super) mod held;
pub(super) mod leaps;
pub(super) mod missing;
pub(super) mod outliers;
pub(super) mod reads;
pub(super) mod resolution;
pub(super) mod stalls;
pub(super) mod units;

use std::ops::Range;

use super::fault::{Fault, FaultName, Treatment};
use super::gear::Gear;
use super::log::Log;
use super::{Quantity, Session};
use flexspline_base::robust::median_of;

/// An arcsecond, rad: 1/648 000 of half a turn, by definition.
const ARCSEC: f64 = std::f64::consts::PI / 648_000.0;
/// The widest clearance of a drive, worn ones included, rad at the output. *Guess*: ten arc-minutes, where drives of
/// catalogues have one or two of lost motion.
const WIDEST_CLEARANCE_RAD: f64 = 600.0 * ARCSEC;

/// Load of this share of its largest holds the drive on one flank. *Guess*: above the friction of most drives.
pub(crate) const HELD: f64 = 0.1;

/// The findings of the checks so far.
#[derive(Debug, Default)]
pub(super) struct Findings {
    pub faults: Vec<Fault>,
    pub notes: Vec<String>,
    /// Whether the time is refused because it looks like milliseconds.
    pub milliseconds: bool,
}

impl Findings {
    /// Adds a fault, if there is one: its channel, the remedy, and a sentence on both; `what` may say more of it.
    pub(super) fn add(
        &mut self,
        fault: Option<Fault>,
        channel: impl Into<Option<Quantity>>,
        treatment: Treatment,
        what: impl FnOnce(&mut Fault) -> String,
    ) {
        let Some(mut fault) = fault else { return };
        (fault.channel, fault.treatment) = (channel.into(), treatment);
        fault.what = what(&mut fault);
        self.faults.push(fault);
    }
}

/// A fault of all rows, to be completed; nothing without rows.
pub(crate) fn throughout(sessions: &[Session], name: FaultName) -> Option<Fault> {
    let rows = sessions.iter().flat_map(|session| {
        let time = |row: usize| session.time_s.as_ref().map(|time| time[row]);
        session.line.iter().enumerate().map(move |(row, line)| (*line, time(row)))
    });
    Fault::of_rows(name, rows)
}

/// Rows of a series, as a flag for each.
fn marked(count: usize, rows: impl IntoIterator<Item = usize>) -> Vec<bool> {
    let mut marked = vec![false; count];
    rows.into_iter().for_each(|row| marked[row] = true);
    marked
}

/// The usual one of distances of rows, two at least, if this share of them is `near` it.
fn rhythm(mut distances: Vec<f64>, share: f64, near: impl Fn(f64, f64) -> bool) -> Option<usize> {
    let every = median_of(&mut distances).round();
    let regular = distances.iter().filter(|distance| near(**distance, every)).count();
    (every >= 2.0 && regular as f64 >= share * distances.len() as f64).then_some(every as usize)
}

/// Puts a straight line between the values of two rows.
fn straight(values: &mut [f64], from: usize, to: usize) {
    let (low, high) = (values[from], values[to]);
    for row in from + 1..to {
        values[row] = low + (row - from) as f64 / (to - from) as f64 * (high - low);
    }
}

/// Adds steps to a series, each from its row on, times `scale`.
fn add_steps(values: &mut [f64], steps: &[(usize, f64)], scale: f64) {
    let (mut next, mut sum) = (steps.iter().peekable(), 0.0);
    for (row, value) in values.iter_mut().enumerate() {
        sum += next.next_if(|(at, _)| *at == row).map_or(0.0, |(_, by)| *by);
        *value += scale * sum;
    }
}

/// Largest torque of either sign, N·m; 0 where none was recorded.
fn largest_torque(log: &Log) -> f64 {
    farthest(log.of(Quantity::Torque).iter().copied()).abs()
}

/// The value that is farthest from zero; 0 of none.
fn farthest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |a, b| if b.abs() > a.abs() { b } else { a })
}

/// Median of some rows of a series.
fn level(values: &[f64], rows: Range<usize>) -> f64 {
    median_of(&mut values[rows].to_vec())
}

/// By how much an angle and what follows it change between the rows in which the angle is least and largest.
fn extent(angle: &[f64], follower: &[f64], rows: Range<usize>) -> Option<(f64, f64)> {
    let by = |a: &usize, b: &usize| angle[*a].total_cmp(&angle[*b]);
    let (low, high) = (rows.clone().min_by(by)?, rows.max_by(by)?);
    Some((angle[high] - angle[low], follower[high] - follower[low]))
}

/// A straight line through points.
pub(crate) struct LineFit {
    /// 0 where all points have one abscissa.
    pub(crate) slope: f64,
    /// Sum of the squares of the abscissas about their mean.
    pub(crate) square: f64,
    /// How far each point is off the line.
    pub(crate) residual: Vec<f64>,
}

impl LineFit {
    pub(crate) fn of(points: &[(f64, f64)]) -> LineFit {
        let n = points.len() as f64;
        let (mx, my) = points.iter().fold((0.0, 0.0), |m, p| (m.0 + p.0 / n, m.1 + p.1 / n));
        let about = |p: &(f64, f64)| (p.0 - mx, p.1 - my);
        let (square, product) = points.iter().map(about).fold((0.0, 0.0), |s, (x, y)| (s.0 + x * x, s.1 + x * y));
        let slope = if square > 0.0 { product / square } else { 0.0 };
        LineFit { slope, square, residual: points.iter().map(about).map(|(x, y)| y - slope * x).collect() }
    }
}

/// The tooth pitches that an angle at the output is, if it is a whole number of them but for this share of a pitch, or
/// this angle.
pub(crate) fn whole_pitches(angle_rad: f64, gear: &Gear, share: f64, but_rad: f64) -> Option<f64> {
    let pitch = gear.tooth_pitch_rad?;
    let pitches = (angle_rad / pitch).round();
    (pitches != 0.0 && (angle_rad - pitches * pitch).abs() < but_rad.max(share * pitch)).then_some(pitches)
}
