//! How the residual moves within each session.

use std::ops::Range;

use serde::Serialize;

use super::rows::ResidualRows;
use crate::diagnosis::rows::parts;
use crate::measurement::median_and_std;

/// Stretches that a session is parted into at most.
const STRETCHES: usize = 24;
/// Fewest rows of a stretch.
const FEWEST: usize = 16;

/// Some rows in a row.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Stretch {
    /// Time of its middle row, s; the number of that row, of all, where time was not recorded.
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
    /// Stretches in order.
    pub stretches: Vec<Stretch>,
}

pub(super) fn of(residual: &ResidualRows<'_>) -> Vec<SessionDrift> {
    let of_session = |(number, session): (usize, &Range<usize>)| {
        let size = session.len().div_ceil(STRETCHES).max(FEWEST);
        let whole = parts(session, size).filter(|part| 2 * part.len() >= size);
        let stretch = |part: Range<usize>| {
            let (median_arcsec, spread_arcsec) = median_and_std(&mut residual.value[part.clone()].to_vec());
            Stretch { at: residual.rows.time[part.start + part.len() / 2], median_arcsec, spread_arcsec }
        };
        SessionDrift { session: number, stretches: whole.map(stretch).collect() }
    };
    residual.rows.sessions.iter().enumerate().map(of_session).collect()
}
