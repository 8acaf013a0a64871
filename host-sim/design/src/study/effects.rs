//! What each field does to a figure: a straight line through all variants at once.

use std::collections::BTreeMap;

use flexspline_algebra::{Mat, cholesky};
use serde::Serialize;

use super::{Basis, Study, StudyRun, figure};
use crate::data_sheet::{DataSheet, FIGURES};
use flexspline_mechanics::drive::GeneratorKind;

/// Least variants for each coefficient of the line.
const VARIANTS_PER_COEFFICIENT: usize = 2;
/// A change of a figure below this share of its largest size is none: round-off.
const NO_CHANGE: f64 = 1e-9;

/// What the fields do to a figure, of one generator.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StudyEffect {
    /// The generator.
    pub generator: GeneratorKind,
    /// The figure.
    pub figure: &'static str,
    /// Its change from the least to the largest value of each field, the others held, in the order of the fields;
    /// missing for a field of words or of one value.
    pub change: Vec<Option<f64>>,
    /// Share of the scatter of the figure that these lines explain: 1 where all is straight and adds up.
    pub straight: f64,
}

/// The effects of all fields on a figure, by least squares over the variants that have it; none where these are too
/// few.
pub fn effects(study: &Study, generator: GeneratorKind, name: &'static str) -> Option<StudyEffect> {
    let (_, of) = figure(name).ok()?;
    let runs: Vec<(&StudyRun, f64)> = study
        .runs
        .iter()
        .filter(|run| run.generator == generator)
        .filter_map(|run| Some((run, of(&run.sheet)?)))
        .collect();
    let numbers = |field: usize| -> Option<Vec<f64>> {
        let values: Option<Vec<f64>> = runs.iter().map(|(run, _)| run.values[field].parse().ok()).collect();
        let values = values?;
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        (high > low).then(|| values.iter().map(|value| (value - low) / (high - low)).collect())
    };
    let columns: Vec<Option<Vec<f64>>> = (0..study.fields.len()).map(numbers).collect();
    let used: Vec<&Vec<f64>> = columns.iter().flatten().collect();
    if used.is_empty() || runs.len() < VARIANTS_PER_COEFFICIENT * (1 + used.len()) {
        return None;
    }
    let y: Vec<f64> = runs.iter().map(|(_, value)| *value).collect();
    let (slopes, straight) = least_squares(&used, &y)?;
    let mut slopes = slopes.into_iter();
    let change = columns.iter().map(|column| column.as_ref().and_then(|_| slopes.next())).collect();
    Some(StudyEffect { generator, figure: name, change, straight })
}

/// Whether the field number `field` changes no figure of a generator: of computed runs that differ in this field alone,
/// all figures are the same, and so is how the runs ended. Where none differ in it alone, as when variants are spread,
/// all runs have to be the same. A slope would not do: a figure that is even in a field that varies about zero has
/// none.
pub fn is_idle(study: &Study, generator: GeneratorKind, field: usize) -> bool {
    let computed = |run: &&StudyRun| run.generator == generator && run.basis == Basis::Computed;
    let runs: Vec<&StudyRun> = study.runs.iter().filter(computed).collect();
    let mut alike: BTreeMap<Vec<&str>, Vec<&StudyRun>> = BTreeMap::new();
    for run in &runs {
        let others = run.values.iter().enumerate().filter(|(k, _)| *k != field).map(|(_, value)| value.as_str());
        alike.entry(others.collect()).or_default().push(run);
    }
    let mut groups: Vec<Vec<&StudyRun>> = alike.into_values().filter(|group| group.len() > 1).collect();
    if groups.is_empty() {
        groups.push(runs);
    }
    // Runs without figures say nothing of what a field does.
    let tells = |run: &&StudyRun| FIGURES.iter().any(|(_, of)| of(&run.sheet).is_some());
    groups.iter().any(|group| group.len() > 1 && group.iter().all(tells))
        && groups.iter().all(|group| are_the_same(group))
}

/// Whether all of these ended in the same way with the same figures.
fn are_the_same(runs: &[&StudyRun]) -> bool {
    let same = |of: fn(&DataSheet) -> Option<f64>| {
        let values: Vec<f64> = runs.iter().filter_map(|run| of(&run.sheet)).collect();
        let [low, high] = [
            values.iter().copied().fold(f64::INFINITY, f64::min),
            values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        ];
        values.is_empty() || (values.len() == runs.len() && high - low <= NO_CHANGE * high.abs().max(low.abs()))
    };
    runs.iter().all(|run| run.status == runs[0].status) && FIGURES.iter().all(|(_, of)| same(*of))
}

/// Slopes of `y` over the columns, with a constant beside them, and the share of its scatter that they explain.
fn least_squares(columns: &[&Vec<f64>], y: &[f64]) -> Option<(Vec<f64>, f64)> {
    let centred = |values: &[f64]| -> Vec<f64> {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter().map(|value| value - mean).collect()
    };
    let x: Vec<Vec<f64>> = columns.iter().map(|column| centred(column)).collect();
    let y = centred(y);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let normal = Mat::from_fn(x.len(), x.len(), |i, j| dot(&x[i], &x[j]));
    let right = Mat::from_fn(x.len(), 1, |i, _| dot(&x[i], &y));
    let solved = cholesky(normal.as_ref()).ok()?.solve(right.as_ref());
    let slopes: Vec<f64> = (0..x.len()).map(|i| solved[(i, 0)]).collect();
    let left: f64 = (0..y.len())
        .map(|k| (y[k] - x.iter().zip(&slopes).map(|(column, slope)| column[k] * slope).sum::<f64>()).powi(2))
        .sum();
    let all = dot(&y, &y);
    Some((slopes, if all > 0.0 { 1.0 - left / all } else { 1.0 }))
}
