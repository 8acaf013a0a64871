//! How the residual moves within each session.

use serde::Serialize;

use super::rows::Rows;
use crate::measurement::{median_and_std, median_of};

/// Stretches that a session is parted into at most.
const STRETCHES: usize = 24;
/// Fewest rows of a stretch.
const FEWEST: usize = 16;

/// Some rows in a row.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Stretch {
    /// Time of its middle row, s; the number of that row where time was not recorded.
    pub at: f64,
    /// Median, arcsec.
    pub median_arcsec: f64,
    /// Robust standard deviation, arcsec.
    pub spread_arcsec: f64,
}

/// How a session moves.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SessionDrift {
    /// Session, from 0.
    pub session: usize,
    /// `s`, or `rows` where time was not recorded.
    pub unit: &'static str,
    /// Stretches in order.
    pub stretches: Vec<Stretch>,
    /// Change from begin to end along the median of all slopes between two stretches (Theil and Sen), arcsec.
    pub change_arcsec: f64,
    /// Its standard deviation, from the stretches' distances from that line, arcsec.
    pub change_std_arcsec: f64,
}

pub(super) fn of(rows: &Rows) -> Vec<SessionDrift> {
    let mut all = Vec::new();
    for (number, session) in rows.sessions.iter().enumerate() {
        let values = &rows.value[rows.starts[number]..rows.starts[number + 1]];
        let size = (values.len().div_ceil(STRETCHES)).max(FEWEST);
        let stretches: Vec<Stretch> = values
            .chunks(size)
            .enumerate()
            .filter(|(_, part)| 2 * part.len() >= size)
            .map(|(k, part)| {
                let row = k * size + part.len() / 2;
                let (median_arcsec, spread_arcsec) = median_and_std(&mut part.to_vec());
                let at = session.time_s.as_ref().map_or(row as f64, |time| time[row]);
                Stretch { at, median_arcsec, spread_arcsec }
            })
            .collect();
        let unit = if session.time_s.is_some() { "s" } else { "rows" };
        let (change_arcsec, change_std_arcsec) = change(&stretches);
        all.push(SessionDrift { session: number, unit, stretches, change_arcsec, change_std_arcsec });
    }
    all
}

fn change(stretches: &[Stretch]) -> (f64, f64) {
    let (Some(first), Some(last)) = (stretches.first(), stretches.last()) else { return (0.0, 0.0) };
    let span = last.at - first.at;
    if stretches.len() < 3 || span <= 0.0 {
        return (0.0, 0.0);
    }
    let mut slopes = Vec::new();
    for (k, a) in stretches.iter().enumerate() {
        for b in &stretches[k + 1..] {
            if b.at > a.at {
                slopes.push((b.median_arcsec - a.median_arcsec) / (b.at - a.at));
            }
        }
    }
    let slope = median_of(&mut slopes);
    let mut left: Vec<f64> = stretches.iter().map(|s| s.median_arcsec - slope * s.at).collect();
    let (_, scatter) = median_and_std(&mut left);
    let n = stretches.len() as f64;
    // Points evenly spread over a span s have a variance of s²/12.
    (slope * span, scatter * (12.0 / n).sqrt())
}
