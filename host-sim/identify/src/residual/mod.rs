//! The picture before the verdict: what a residual (measured less model) looks like, before anybody says why.
//!
//! Its orders over the angle of each wheel with their uncertainty. Everything is in arc-seconds at the output, angles
//! in radians, and can be written as JSON.
//!
//! Three angles matter in a strain wave gear. The contact passes the flexspline once in a generator turn (ψ), the
//! circular spline once in ψ−δ, which is 94/95 of it for a ratio of 95, and whatever sits on the output turns with δ.

mod orders;
mod rows;
mod spectrum;

pub use orders::{Line, NamedOrder, harmonics, named_orders};
pub use rows::{Axis, SizeMismatch};
pub use spectrum::{OrderSpectrum, Peak, order_spectrum};
pub(crate) use spectrum::{is_no_noise, strongest};

use std::ops::Range;

use rayon::prelude::*;
use serde::Serialize;

use crate::diagnosis::rows::Rows;
use crate::least_squares::{FreeSpan, dot};
use crate::measurement::rms;
use flexspline_base::statistics::mean;
use rows::centred_by_direction;

/// The picture of a residual.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Picture {
    /// Rows.
    pub rows: usize,
    /// Root mean square about zero, arcsec.
    pub rms_arcsec: f64,
    /// Orders in ψ, ψ−δ and δ.
    pub spectra: Vec<OrderSpectrum>,
}

impl Picture {
    /// The picture of a residual over the rows of a drive with this ratio: arcsec, one value for each row.
    ///
    /// # Errors
    /// There are more values than rows, or fewer.
    pub fn of(rows: &Rows, residual_arcsec: &[f64], ratio: f64) -> Result<Picture, SizeMismatch> {
        let (found, needed) = (residual_arcsec.len(), rows.len());
        if found != needed {
            return Err(SizeMismatch { found, needed });
        }
        let centred = centred_by_direction(rows, residual_arcsec);
        let spectrum = |axis: Axis| order_spectrum(axis, &axis.angles(rows), &centred, ratio);
        let spectra = Axis::ALL.into_par_iter().map(spectrum).collect();
        Ok(Picture { rows: needed, rms_arcsec: rms(residual_arcsec), spectra })
    }
}

/// Rows to either side of a step that are looked at. *Guess*: means of a quarter of the noise of a row.
const BESIDE_A_STEP: usize = 16;
/// They are among so many rows. *Guess*: a flank is open for some dozen.
const CLOSE_BY: usize = 64;
/// A step within one row is this many standard deviations of the white noise. *Guess*: one more than the five by which
/// causes are separated.
const SEEN: f64 = 6.0;
/// What is seen of a step close by and what happens in one row agree within this share. *Guess*: clearance that is
/// crossed, or ripple, differs by all of it.
const AGREES: f64 = 0.4;
/// What lasts is this share of what is seen close by, and the other way round. *Guess*: of a flank that comes back
/// nothing lasts; columns may take a third of a step.
const OF_NEAR: f64 = 0.5;
/// Places that are held against the columns, at most: the largest close by. *Guess*: one in sixteen is right.
const MOST_PLACES: usize = 16;

/// It is this many standard deviations. *Guess*: what is left is not all noise, for which five would do.
const LASTS: f64 = 8.0;
/// Correlation of successive rows, at most. *Guess*: a hundredth of them counts.
const MOST_GOES_ON: f64 = 0.98;
/// Rows to a batch. *Guess*: eight times those about a step, so that wander is in it.
const BATCH: usize = 8 * BESIDE_A_STEP;

/// The rows behind a step within one row that takes most of what a fit of `columns` leaves of successive rows, `None`
/// of one that does not count, to where it stays, and its size, close by. `places` are looked at: the rows to which
/// each step stays, and those about it that nothing else parts. It is larger than `least` and noise, of which `white`
/// is white.
pub(crate) fn lasting_step(
    left: &[Option<f64>],
    columns: impl FnOnce() -> Vec<Vec<f64>>,
    places: impl Iterator<Item = (Range<usize>, Range<usize>)>,
    (white, least): (f64, f64),
) -> Option<(Range<usize>, f64)> {
    // Close by, where no smooth column follows: change from row to row, and of the mean.
    let beside = |left: &[Option<f64>], row: usize, of: &Range<usize>| {
        let behind = left[row..of.end.min(row + CLOSE_BY)].iter().flatten();
        let before = left[row.saturating_sub(CLOSE_BY).max(of.start)..row].iter().rev().flatten();
        let jump = left[row]? - before.clone().next()?;
        let [behind, before]: [Vec<f64>; 2] =
            [behind.take(BESIDE_A_STEP).copied().collect(), before.take(BESIDE_A_STEP).copied().collect()];
        let enough = behind.len().min(before.len()) >= BESIDE_A_STEP / 2;
        enough.then(|| (jump, mean(&behind) - mean(&before)))
    };
    let near = |(stays, of): (Range<usize>, Range<usize>)| {
        let (jump, near) = beside(left, stays.start, &of)?;
        let sharp = (jump - near).abs() < AGREES * near.abs() + 4.0 * white;
        (sharp && near.abs() > (1.0 - AGREES) * least.max(SEEN * white)).then_some((stays, of, near))
    };
    let mut close_by: Vec<(Range<usize>, Range<usize>, f64)> = places.filter_map(near).collect();
    close_by.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
    let mut apart: Vec<(Range<usize>, Range<usize>, f64)> = Vec::new();
    for step in close_by {
        let other = |of: &Range<usize>| of.start == step.0.start || of.start.abs_diff(step.0.start) >= BESIDE_A_STEP;
        if apart.len() < MOST_PLACES && apart.iter().all(|(of, ..)| other(of)) {
            apart.push(step);
        }
    }
    if apart.is_empty() {
        return None;
    }
    let counting = |values: Vec<f64>| -> Vec<f64> {
        values.into_iter().zip(left).map(|(value, left)| left.map_or(0.0, |_| value)).collect()
    };
    let span = FreeSpan::default().beyond(columns().into_iter().map(counting));
    let freed = span.freed(left.iter().map(|left| left.unwrap_or(0.0)).collect());
    let step = |(rows, of, near): &(Range<usize>, Range<usize>, f64)| {
        let of_step = (0..left.len()).map(|k| f64::from(u8::from(rows.contains(&k)))).collect();
        let of_step = span.freed(counting(of_step));
        let square = dot(&of_step, &of_step);
        let size = dot(&of_step, &freed) / square;
        let stays = (OF_NEAR..=1.0 / OF_NEAR).contains(&(size / near)) && size.abs() > least.max(SEEN * white);
        let is_one = stays && 2.0 * square >= BESIDE_A_STEP as f64;
        is_one.then_some((size * size * square, (rows.clone(), of.clone()), size, of_step))
    };
    let found = apart.iter().filter_map(step);
    let (gain, (rows, of), size, of_step) = found.max_by(|a, b| a.0.total_cmp(&b.0))?;
    // What is left besides is worth fewer rows where it goes on from row to row, by the correlation of successive ones
    // or by the means of batches (Flegal and Jones, Ann. Stat. 38, 1034, 2010): below white noise wander hides from
    // that, in few batches from these.
    let besides: Vec<f64> = freed.iter().zip(of_step).map(|(freed, of_step)| freed - size * of_step).collect();
    let (own, next) = (dot(&besides, &besides), dot(&besides[1..], &besides[..besides.len() - 1]));
    let goes_on = if own > 0.0 { (next / own).clamp(0.0, MOST_GOES_ON) } else { 0.0 };
    let batches = besides.chunks(BATCH).map(|batch| batch.iter().sum::<f64>().powi(2)).sum::<f64>();
    let variance = batches.max(own * (1.0 + goes_on) / (1.0 - goes_on)) / left.iter().flatten().count() as f64;
    let besides: Vec<Option<f64>> =
        besides.into_iter().zip(left).map(|(besides, left)| left.map(|_| besides)).collect();
    let size = size + beside(&besides, rows.start, &of)?.1;
    (gain > LASTS * LASTS * variance).then_some((rows, size))
}
