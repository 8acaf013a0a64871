//! What is left when the causes are in: lines, steps and slow motion that noise does not make.

use std::f64::consts::PI;

use super::model::{Problem, Term};
use super::select::Selected;

/// A line found in what is left.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// What it is counted against: `generator turn` or `second`.
    pub unit: &'static str,
    /// Periods per unit.
    pub order: f64,
    /// Power in units of what white noise has on average.
    pub power: f64,
}

/// Innovations of the data under a selection.
#[must_use]
pub fn innovations(problem: &Problem<'_>, selected: &Selected<'_>) -> Vec<f64> {
    let mut left = problem.data_white.clone();
    let columns = problem.base_white.iter().chain(selected.terms.iter().flat_map(|t| &t.white));
    for (column, c) in columns.zip(&selected.fit.solution.coefficients) {
        for (l, v) in left.iter_mut().zip(column) {
            *l -= c * v;
        }
    }
    left
}

/// The strongest line in the innovations, by generator angle and by time.
///
/// Innovations are laid on an even grid of the angle (all sessions, both directions) or of time and transformed; a grid place
/// that was visited often counts often, as in a periodogram at uneven places.
#[must_use]
pub fn lines(problem: &Problem<'_>, innovations: &[f64], highest_order: f64) -> Vec<Line> {
    let rows = problem.on.rows;
    let mut found = Vec::new();
    let angle = problem.whitener.average(&rows.generator);
    found.extend(strongest(&angle, innovations, highest_order / (2.0 * PI)).map(|(f, power)| Line {
        unit: "generator turn",
        order: f * 2.0 * PI,
        power,
    }));
    if rows.recorded.time {
        // Gaps between sessions would only make the transform long.
        let mut time = problem.whitener.average(&rows.time);
        let mut shift = 0.0;
        for session in &problem.whitener.sessions {
            let first = time[session.start];
            let last = time[session.end - 1];
            for t in &mut time[session.clone()] {
                *t += shift - first;
            }
            shift += last - first + 1.0;
        }
        let step = (shift / time.len().max(1) as f64).max(1e-9);
        found.extend(strongest(&time, innovations, 0.45 / step).map(|(f, power)| Line {
            unit: "second",
            order: f,
            power,
        }));
    }
    found
}

/// Frequency (per unit of `places`) and power of the strongest line up to `highest`.
fn strongest(places: &[f64], values: &[f64], highest: f64) -> Option<(f64, f64)> {
    let (low, high) = places.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
    let span = high - low;
    if !(span > 0.0 && highest > 0.0) {
        return None;
    }
    let wanted = (span * highest * 4.0).clamp(64.0, 262_144.0);
    let size = (wanted as usize).next_power_of_two().min(1 << 18);
    let step = span / (size as f64 * 0.5);
    let mut re = vec![0.0; size];
    let mut im = vec![0.0; size];
    for (x, v) in places.iter().zip(values) {
        let at = ((x - low) / step) as usize;
        re[at.min(size - 1)] += v;
    }
    transform(&mut re, &mut im);
    let total: f64 = values.iter().map(|v| v * v).sum();
    let upto = ((highest * step * size as f64) as usize).min(size / 2);
    (1..upto)
        .map(|k| (k as f64 / (size as f64 * step), (re[k] * re[k] + im[k] * im[k]) / total.max(1e-30)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Fourier transform in place, size a power of two (Cooley & Tukey 1965).
fn transform(re: &mut [f64], im: &mut [f64]) {
    let n = re.len();
    let mut j = 0;
    for i in 1..n {
        let mut bit = n >> 1;
        while j & bit != 0 {
            j ^= bit;
            bit >>= 1;
        }
        j |= bit;
        if i < j {
            re.swap(i, j);
            im.swap(i, j);
        }
    }
    let mut len = 2;
    while len <= n {
        let turn = -2.0 * PI / len as f64;
        let twiddles: Vec<(f64, f64)> = (0..len / 2).map(|k| ((turn * k as f64).cos(), (turn * k as f64).sin())).collect();
        for start in (0..n).step_by(len) {
            for (k, (c, s)) in twiddles.iter().enumerate() {
                let (a, b) = (start + k, start + k + len / 2);
                let (x, y) = (re[b] * c - im[b] * s, re[b] * s + im[b] * c);
                (re[b], im[b]) = (re[a] - x, im[a] - y);
                (re[a], im[a]) = (re[a] + x, im[a] + y);
            }
        }
        len *= 2;
    }
}

/// Power that a line of white noise reaches once in about 10⁵ spectra of these data.
#[must_use]
pub fn line_limit(problem: &Problem<'_>) -> f64 {
    (problem.data.len() as f64 * 4.0).ln() + 12.0
}

/// Averages at which the level of what is left changes at once, with the height in arcsec, strongest first.
#[must_use]
pub fn steps(problem: &Problem<'_>, left: &[f64], white: f64) -> Vec<(usize, f64)> {
    let mut found: Vec<(usize, f64)> = Vec::new();
    let window = 40usize;
    for session in &problem.whitener.sessions {
        if session.len() < 4 * window {
            continue;
        }
        let mut best: Option<(usize, f64)> = None;
        for k in session.start + window..session.end - window {
            let mean = |r: std::ops::Range<usize>| left[r].iter().sum::<f64>() / window as f64;
            let height = mean(k..k + window) - mean(k - window..k);
            if best.is_none_or(|(_, h)| height.abs() > h.abs()) {
                best = Some((k, height));
            }
        }
        found.extend(best);
    }
    found.retain(|(_, height)| height.abs() > 3.0 * white.max(1.0));
    found.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    found
}

/// Data less everything explained, averaged, arcsec.
#[must_use]
pub fn left(problem: &Problem<'_>, selected: &Selected<'_>) -> Vec<f64> {
    let terms: Vec<&Term<'_>> = selected.terms.iter().collect();
    let predicted = super::select::predicted(problem, &terms, &selected.fit);
    problem.data.iter().zip(&predicted).map(|(d, p)| d - p).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_at_uneven_places_is_found_where_it_is() {
        let places: Vec<f64> = (0..4000).map(|k| 0.05 * f64::from(k) + 0.02 * f64::from(k % 7)).collect();
        let values: Vec<f64> = places.iter().map(|x| (2.0 * PI * 0.731 * x).cos()).collect();
        let (frequency, power) = strongest(&places, &values, 2.0).unwrap();
        assert!((frequency - 0.731).abs() < 0.005, "{frequency}");
        assert!(power > 1000.0, "{power}");
    }
}
