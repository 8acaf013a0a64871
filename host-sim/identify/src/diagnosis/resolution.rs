//! How many neighbouring rows are averaged to one. Averages make a diagnosis quick, and hide what changes from row to
//! row: the tooth mesh, at z periods per generator turn. So the differences that averaging would throw away are looked
//! at first, for the laws that live in them; where one shows, every row is kept.

use rayon::prelude::*;

use super::candidate::{Excitation, Law, Tolerance};
use super::noise::Whitener;
use super::rows::{Rows, combined, rms, robust_std};
use crate::least_squares::Normal;

/// Rows whose mean is taken from each of them, to see what is fast. *Guess*: what passes within a few rows is fast.
const TOGETHER: usize = 5;
/// A column of which the detail holds less than this share is not fast. *Guess*: a tenth of its power.
const IN_DETAIL: f64 = 0.3;
/// Evidence for a fast model from which every row is kept. *Guess*: above the 6 that name a cause, as it costs time.
const LEAST_EVIDENCE: f64 = 10.0;
/// Values farther out than this many standard deviations are neither noise nor waves. *Guess*: no normal row in a
/// million.
const OUTLIER: f64 = 5.0;

/// What laws explain, row by row, arcsec, that averages of `stride` rows would hide and the data hold: then every row
/// is needed. Rows marked uncertain are not looked at; `explained` is what is explained already, row by row, arcsec
/// (nothing if it is empty).
pub(crate) fn hidden_by_averages(
    on: &Excitation<'_>,
    laws: &[Law],
    uncertain: &[bool],
    stride: usize,
    explained: &[f64],
) -> Option<Vec<f64>> {
    if stride == 1 {
        return None;
    }
    let left = on.left(explained);
    let averages = Whitener::plain(on.rows, uncertain, stride, 1.0);
    laws.par_iter()
        .filter(|law| law.named() && law.shapes.is_empty())
        .filter_map(|law| hidden(on, law, &averages))
        .find_map_first(|main| explained_in_detail(on.rows, &main, &left, uncertain))
}

/// The main columns of a law, if averages hide all of them.
fn hidden(on: &Excitation<'_>, law: &Law, averages: &Whitener) -> Option<Vec<Vec<f64>>> {
    let columns = law.columns(on, &[]).into_iter();
    let main: Vec<Vec<f64>> = columns.filter(|c| matches!(c.tolerance, Tolerance::Main(_))).map(|c| c.values).collect();
    (!main.is_empty() && main.iter().all(|column| averages.hides(column))).then_some(main)
}

/// What is left of each row less the mean of the rows around it: nothing of a straight line.
fn detail(rows: &Rows, column: &[f64]) -> Vec<f64> {
    let half = TOGETHER / 2;
    let mut detail = vec![0.0; column.len()];
    for session in rows.sessions_used() {
        for k in session.start + half..session.end.saturating_sub(half) {
            detail[k] = column[k] - column[k - half..=k + half].iter().sum::<f64>() / TOGETHER as f64;
        }
    }
    detail
}

/// The columns fitted to the detail of the data, as what they explain in the rows; nothing where the evidence is short.
fn explained_in_detail(rows: &Rows, columns: &[Vec<f64>], left: &[f64], uncertain: &[bool]) -> Option<Vec<f64>> {
    let data = detail(rows, left);
    let usable =
        |k: usize| !uncertain[k.saturating_sub(TOGETHER / 2)..(k + TOGETHER / 2 + 1).min(left.len())].contains(&true);
    let spread = robust_std((0..data.len()).filter(|k| usable(*k)).map(|k| data[k]));
    let counts: Vec<bool> = (0..data.len()).map(|k| usable(k) && data[k].abs() < OUTLIER * spread).collect();
    let used = counts.iter().filter(|counts| **counts).count();
    let counted = |detail: Vec<f64>| -> Vec<f64> {
        detail.into_iter().zip(&counts).map(|(value, counts)| if *counts { value } else { 0.0 }).collect()
    };
    let details: Vec<Vec<f64>> = columns.iter().map(|column| counted(detail(rows, column))).collect();
    if details.iter().zip(columns).any(|(fine, column)| rms(fine) < IN_DETAIL * rms(column))
        || used < 20 * columns.len()
    {
        return None;
    }
    let data = counted(data);
    let fit = Normal::of(columns.len(), data.len(), |k, row| {
        row.iter_mut().zip(&details).for_each(|(cell, fine)| *cell = fine[k]);
        (data[k], 1.0)
    })?;
    // Schwarz: what the fit gains in likelihood, less the gain of that number of free columns from noise.
    let n = used as f64;
    let evidence = 0.5 * n * (fit.square / fit.misfit().max(1e-300)).ln() - 0.5 * columns.len() as f64 * n.ln();
    if evidence < LEAST_EVIDENCE {
        return None;
    }
    Some(combined(left.len(), columns.iter().map(Vec::as_slice), &fit.values()))
}
