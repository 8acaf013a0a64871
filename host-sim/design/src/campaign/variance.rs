//! Shares of the variance of a figure: Sobol indices of first order and total, by pick and freeze.
//!
//! Two independent points `A` and `B`, and `A` with one tolerance of `B`, each a drive by kernels; first order after
//! Saltelli (2010), total after Jansen (1999). Replicates, each scrambled on its own, give the intervals. Size and
//! phase of a tolerance, or all its teeth, are one.

use rayon::prelude::*;
use serde::Serialize;

use super::draw::{Draw, Drawn, drawn};
use super::tolerance::Tolerance;
use flexspline_base::statistics::{Interval, mean, of_replicates};

/// Replicates.
const REPLICATES: u32 = 8;

/// Share of one tolerance.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Share {
    /// The tolerance.
    pub tolerance: String,
    /// Share of the variance that it makes alone.
    pub first: Interval,
    /// Share that it has part in, with others too.
    pub total: Interval,
}

/// Shares of each of some figures, in the order that `figures` gives them; `points` of every replicate.
pub(crate) fn shares(
    tolerances: &[Tolerance],
    teeth: [u32; 2],
    hash: &[u8; 32],
    points: u32,
    figures: &(dyn Fn(&Drawn) -> Vec<f64> + Sync),
) -> Vec<Vec<Share>> {
    let count = tolerances.len();
    let of = |replicate: u32, i: u32| -> Vec<Vec<f64>> {
        // Stream 0 is that of the campaign's drives.
        let draw = Draw::stream(hash, 1 + replicate);
        let (a, b) = (draw.point_from(count, i, 0), draw.point_from(count, i, 2 * count as u32));
        let mixed = (0..count).map(|t| a.with(t, &b));
        [a.clone(), b.clone()]
            .into_iter()
            .chain(mixed)
            .map(|point| figures(&drawn(tolerances, teeth, &point)))
            .collect()
    };
    let jobs: Vec<(u32, u32)> = (0..REPLICATES).flat_map(|r| (0..points).map(move |i| (r, i))).collect();
    let all: Vec<Vec<Vec<f64>>> = jobs.par_iter().map(|(r, i)| of(*r, *i)).collect();
    let figures = all.first().map_or(0, |rows| rows[0].len());
    (0..figures)
        .map(|f| {
            (0..count)
                .map(|t| {
                    let replicates: Vec<[f64; 2]> =
                        all.chunks_exact(points as usize).map(|rows| of_replicate(rows, t, f)).collect();
                    let by = |k: usize| of_replicates(&replicates.iter().map(|r| r[k]).collect::<Vec<f64>>());
                    Share { tolerance: tolerances[t].name.clone(), first: by(0), total: by(1) }
                })
                .collect()
        })
        .collect()
}

/// First-order and total share of tolerance `t` in figure `f`.
fn of_replicate(rows: &[Vec<Vec<f64>>], t: usize, f: usize) -> [f64; 2] {
    let both: Vec<f64> = rows.iter().flat_map(|row| [row[0][f], row[1][f]]).collect();
    let middle = mean(&both);
    let variance = mean(&both.iter().map(|x| (x - middle) * (x - middle)).collect::<Vec<f64>>());
    if variance <= 0.0 {
        return [0.0; 2];
    }
    let sum = |of: &dyn Fn(f64, f64, f64) -> f64| {
        mean(
            &rows
                .iter()
                .map(|row| of(row[0][f] - middle, row[1][f] - middle, row[2 + t][f] - middle))
                .collect::<Vec<f64>>(),
        )
    };
    let first = sum(&|a, b, mixed| b * (mixed - a)) / variance;
    let total = 0.5 * sum(&|a, _, mixed| (a - mixed) * (a - mixed)) / variance;
    [first, total]
}
