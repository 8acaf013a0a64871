//! Residual with the causes in the model: spectral lines and slow motion that noise does not make.

use std::borrow::Cow;
use std::f64::consts::PI;

use flexspline_algebra::spectrum;

use super::candidate::{Acting, Law, Per, together};
use super::model::{Problem, Scaffold, Term};
use super::noise::{Noise, Whitener};
use super::report::Unexplained;
use super::rows::{Rows, combined};
use super::select::{self, Selected, less};
use super::thresholds::remainder::*;
use crate::measurement::least_and_most;

/// A line in the spectrum of the residual.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectralLine {
    /// Turn or second in which its periods are counted.
    pub per: Per,
    /// Periods in one.
    pub order: f64,
    /// Power in units of what white noise has on average.
    pub power: f64,
}

/// The part of the error that base and terms explain in addition to the nominal prediction, row by row, arcsec.
#[must_use]
pub(crate) fn explained(problem: &Problem<'_>, selected: &Selected<'_>) -> Vec<f64> {
    let on = problem.on;
    let causes: Vec<Acting<'_>> =
        selected.terms.iter().enumerate().map(|(k, term)| term.acting(selected.fit.of(k))).collect();
    let of_causes = together(on, &causes);
    let floating = on.base.floating.iter().map(|floating| floating.values.as_slice());
    let columns = floating.chain(of_causes.iter().flatten().map(|column| column.values.as_slice()));
    combined(on.rows.len(), columns, &selected.fit.solution.coefficients)
}

/// Innovations of every row, in units of their standard deviation; 0 where the flank is uncertain.
#[must_use]
pub(crate) fn every_row(problem: &Problem<'_>, selected: &Selected<'_>, noise: Noise) -> Vec<f64> {
    let on = problem.on;
    let left = on.left(&explained(problem, selected));
    let whitener = Whitener::new(on.rows, &problem.uncertain, 1, noise);
    let mut white = whitener.in_rows(&whitener.whiten(&left), on.rows.len());
    for (value, uncertain) in white.iter_mut().zip(&problem.uncertain) {
        *value = if *uncertain { 0.0 } else { value.clamp(-6.0, 6.0) };
    }
    white
}

/// The strongest line in the innovations of every row, by generator angle and by time.
///
/// Innovations are laid on an even grid of the angle (all sessions, both directions) or of time and transformed; a grid
/// place that was visited often counts often, as in a periodogram at uneven places.
#[must_use]
pub(crate) fn lines(problem: &Problem<'_>, innovations: &[f64], highest_order: f64) -> Vec<SpectralLine> {
    let rows = problem.on.rows;
    let strongest = |per: Per, lowest: f64, highest: f64, cell: Option<f64>| {
        let (places, unit) = places(rows, per);
        let found = strongest(&places, innovations, lowest / unit, highest / unit, cell);
        found.map(|(frequency, power)| SpectralLine { per, order: frequency * unit, power })
    };
    let by_angle = strongest(Per::GeneratorTurn, 0.0, highest_order, None);
    let in_time = || strongest(Per::Second, SLOWEST_LINE_HZ, 0.5 / rows.period, Some(0.5 * rows.period));
    by_angle.into_iter().chain(rows.recorded.time.then(in_time).flatten()).collect()
}

/// The angle (rad) or time (s) of each row in which a line repeats, and one turn or second of it.
fn places(rows: &Rows, per: Per) -> (Cow<'_, [f64]>, f64) {
    match per {
        Per::Second => (Cow::Owned(time_without_gaps(rows)), 1.0),
        Per::GeneratorTurn => (Cow::Borrowed(&rows.generator), 2.0 * PI),
        Per::OutputTurn => (Cow::Borrowed(&rows.output), 2.0 * PI),
    }
}

/// Time of all sessions one after the other: gaps would only make a transform long.
fn time_without_gaps(rows: &Rows) -> Vec<f64> {
    let (mut time, mut begin) = (rows.since.clone(), 0.0);
    for session in rows.sessions.iter().filter(|session| !session.is_empty()) {
        time[session.clone()].iter_mut().for_each(|since| *since += begin);
        begin = time[session.end - 1] + 1.0;
    }
    time
}

/// Frequencies tried between two of a spectrum. *Guess*: the nearest is a sixteenth of a place off at most, which costs
/// 0.3 % of the power.
const PARTS: i32 = 8;

/// A line as it is in each row: between two places of the spectrum, in cells that it turns through, it is up to half as
/// strong there.
#[must_use]
pub(crate) fn at_its_places(rows: &Rows, innovations: &[f64], line: &SpectralLine) -> SpectralLine {
    let (places, per) = places(rows, line.per);
    let (low, high) = least_and_most(places.iter().copied());
    let total: f64 = innovations.iter().map(|v| v * v).sum();
    let at = |part: i32| -> SpectralLine {
        // The spectrum has two places to a period over all rows.
        let order = line.order + per * f64::from(part) / f64::from(PARTS) / (2.0 * (high - low).max(f64::MIN_POSITIVE));
        let [mut cosine, mut sine] = [0.0; 2];
        for (x, v) in places.iter().zip(innovations) {
            let (s, c) = (2.0 * PI * order / per * (x - low)).sin_cos();
            cosine += v * c;
            sine += v * s;
        }
        SpectralLine { order, power: (cosine * cosine + sine * sine) / total.max(1e-30), ..line.clone() }
    };
    (-PARTS / 2..=PARTS / 2).map(at).max_by(|a, b| a.power.total_cmp(&b.power)).unwrap_or_else(|| line.clone())
}

/// Whether averaging the rows takes most of a line away.
#[must_use]
pub(crate) fn averaged_away(problem: &Problem<'_>, line: &SpectralLine) -> bool {
    let (places, per) = places(problem.on.rows, line.per);
    let wave: Vec<f64> = places.iter().map(|x| (2.0 * PI * line.order / per * x).cos()).collect();
    problem.whitener.hides(&wave)
}

/// Residual that goes as a free function of a measured quantity, largest first.
#[must_use]
pub(crate) fn of_maps(problem: &Problem<'_>, selected: &Selected<'_>, maps: &[Law], white: f64) -> Vec<Unexplained> {
    use rayon::prelude::*;
    let scaffold = Scaffold::new(problem, &selected.terms);
    let mut found: Vec<Unexplained> = maps
        .par_iter()
        .filter_map(|law| {
            let term = Term::new(problem, law, Vec::new());
            let fit = scaffold.fit(Some(&term))?;
            if fit.solution.evidence - selected.fit.solution.evidence <= LEAST_EVIDENCE {
                return None;
            }
            let mut terms = selected.terms.clone();
            terms.push(term);
            let standing = select::standing(problem, &Selected { terms, fit }, selected.terms.len());
            let there = standing.evidence > LEAST_EVIDENCE
                && standing.left_out > LEAST_EVIDENCE
                && standing.size > select::least_size(white);
            there.then(|| Unexplained { looks_like: law.label.to_string(), size_arcsec: standing.size })
        })
        .collect();
    found.sort_by(|a, b| b.size_arcsec.total_cmp(&a.size_arcsec));
    found.truncate(1);
    found
}

/// Slow motion that is too large for noise, or too orderly.
#[must_use]
pub(crate) fn beyond_noise(problem: &Problem<'_>, selected: &Selected<'_>, noise: Noise) -> Vec<Unexplained> {
    let left = left(problem, selected);
    let wander = problem.whitener.followed(&left);
    let size = problem.certain_rms(&wander);
    let restless = problem.worth < LEAST_WORTH && noise.wander > noise.white;
    // The largest and fastest wander that is tried: what is there is larger or faster still.
    let restless = restless || noise.wander >= super::prepare::MOST_WANDER * noise.white;
    if restless || size > MOST_WANDER_ARCSEC.max(MOST_WANDER_OF_WHITE * noise.white) {
        vec![Unexplained { looks_like: "slow motion".into(), size_arcsec: size }]
    } else {
        Vec::new()
    }
}

/// Cells of a grid at most: a power of two. *Guess*: it bounds memory and time; 262 144 cells take 2 MiB.
const MOST_CELLS: usize = 1 << 18;

/// Frequency (per unit of `places`) and power of the strongest line from `lowest` to `highest`. Places that are even
/// are laid on a grid of this `cell` (a part of their distance), which loses nothing of what is fast.
fn strongest(places: &[f64], values: &[f64], lowest: f64, highest: f64, cell: Option<f64>) -> Option<(f64, f64)> {
    let (low, high) = least_and_most(places.iter().copied());
    let span = high - low;
    if !(span > 0.0 && highest > 0.0) {
        return None;
    }
    let size = (span * highest * 4.0).clamp(64.0, MOST_CELLS as f64) as usize;
    let even = cell.filter(|cell| span / cell < 0.5 * MOST_CELLS as f64);
    let size = even.map_or(size, |cell| (2.0 * span / cell) as usize).next_power_of_two();
    let step = even.unwrap_or(span / (size as f64 * 0.5));
    let mut on_grid = vec![0.0; size];
    for (x, v) in places.iter().zip(values) {
        let at = ((x - low) / step + 1e-6) as usize;
        on_grid[at.min(size - 1)] += v;
    }
    let spectrum = spectrum(&mut on_grid);
    let total: f64 = values.iter().map(|v| v * v).sum();
    let upto = ((highest * step * size as f64) as usize).min(size / 2);
    let from = ((lowest * step * size as f64).ceil() as usize).max(1);
    (from..upto)
        .map(|k| (k as f64 / (size as f64 * step), spectrum[k].norm_sqr() / total.max(1e-30)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Power that a line of white noise reaches once in about 10⁵ spectra of this many rows.
#[must_use]
pub(crate) fn line_limit(rows: usize) -> f64 {
    (rows as f64 * 4.0).ln() + 12.0
}

/// Data less everything explained, averaged, arcsec.
#[must_use]
pub fn left(problem: &Problem<'_>, selected: &Selected<'_>) -> Vec<f64> {
    less(&problem.data, &selected.predicted(problem))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_at_uneven_places_is_found_where_it_is() {
        let places: Vec<f64> = (0..4000).map(|k| 0.05 * f64::from(k) + 0.02 * f64::from(k % 7)).collect();
        let values: Vec<f64> = places.iter().map(|x| (2.0 * PI * 0.731 * x).cos()).collect();
        let (frequency, power) = strongest(&places, &values, 0.0, 2.0, None).unwrap();
        assert!((frequency - 0.731).abs() < 0.005, "{frequency}");
        assert!(power > 1000.0, "{power}");
    }
}
