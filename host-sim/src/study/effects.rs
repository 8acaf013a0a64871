//! What each field does to a figure: a straight line through all variants at once.

use flexspline_algebra::{Mat, cholesky};
use serde::Serialize;

use super::{Run, Study, figure};
use crate::drive::GeneratorKind;

/// Least variants for each coefficient of the line.
const VARIANTS_PER_COEFFICIENT: usize = 2;

/// What the fields do to a figure, of one generator.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    /// The generator.
    pub generator: GeneratorKind,
    /// The figure.
    pub figure: &'static str,
    /// Its change from the least to the largest value of each field, the others held, in the order of the fields; missing for a
    /// field of words or of one value.
    pub change: Vec<Option<f64>>,
    /// Share of the scatter of the figure that these lines explain: 1 where all is straight and adds up.
    pub straight: f64,
}

/// The effects of all fields on a figure, by least squares over the variants that have it; none where these are too few.
pub fn effects(study: &Study, generator: GeneratorKind, name: &'static str) -> Option<Effect> {
    let (_, of) = figure(name).ok()?;
    let runs: Vec<(&Run, f64)> = study
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
    Some(Effect { generator, figure: name, change, straight })
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
