//! How far estimated figures can be trusted, in the figure's own unit: what they are off by in the middle, beside how far variants differ.
//!
//! Root mean squares, and percents of a mean, are ruled by a few variants with large values. Here both are medians: of what a surface is off by
//! where it leaves out a computed variant, and of how far the computed variants lie from the one in their middle. Where the first is
//! as large as the second an estimate says no more than "as the middle one".

use std::collections::BTreeSet;

use rayon::prelude::*;
use serde::Serialize;

use super::estimate::furthest_first;
use super::surface::Surface;
use super::{Basis, Run, RunStatus, Study, figure};
use crate::drive::GeneratorKind;

/// Computed variants that a surface is made through here, at most, as for the estimates themselves.
const MOST_POINTS: usize = 160;

/// How far estimates of a figure can be trusted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Trust {
    /// The generator.
    pub generator: GeneratorKind,
    /// The figure.
    pub figure: &'static str,
    /// Median size of what estimates are off by, in the unit of the figure.
    pub median_off: f64,
    /// Median distance of computed variants from the one in their middle, in the unit of the figure.
    pub spread: f64,
    /// The first over the second, percent; 0 where all variants have the same value and are estimated so.
    pub share_of_spread_percent: Option<f64>,
    /// Whether the middle value is as good an estimate: then these rank nothing.
    pub useless: bool,
}

impl Trust {
    fn new(generator: GeneratorKind, figure: &'static str, values: &[f64], left_out: &[f64]) -> Trust {
        let median_off = median(left_out.iter().map(|off| off.abs()).collect());
        let middle = median(values.to_vec());
        let spread = median(values.iter().map(|value| (value - middle).abs()).collect());
        let share = match (spread > 0.0, median_off > 0.0) {
            (true, _) => Some(100.0 * median_off / spread),
            (false, false) => Some(0.0),
            (false, true) => None,
        };
        let useless = share.is_none_or(|share| share >= 100.0);
        Trust { generator, figure, median_off, spread, share_of_spread_percent: share, useless }
    }
}

/// How far the estimates of a study can be trusted, by generator and figure; nothing where all is computed.
pub(super) fn trust(study: &Study) -> Vec<Trust> {
    let places = places(&study.runs);
    let one = |off: &super::Off| {
        let (_, of) = figure(off.figure).ok()?;
        let known: Vec<(&Vec<f64>, f64)> = study
            .runs
            .iter()
            .zip(&places)
            .filter(|(run, _)| run.generator == off.generator && run.basis == Basis::Computed)
            .filter(|(run, _)| run.status == RunStatus::Converged)
            .filter_map(|(run, place)| Some((place, of(&run.sheet)?)))
            .collect();
        let all: Vec<Vec<f64>> = known.iter().map(|(place, _)| (*place).clone()).collect();
        let (points, values): (Vec<Vec<f64>>, Vec<f64>) =
            furthest_first(&all, MOST_POINTS).into_iter().map(|k| (all[k].clone(), known[k].1)).unzip();
        let surface = Surface::through(points, &values)?;
        Some(Trust::new(off.generator, off.figure, &values, &surface.left_out))
    };
    study.off.par_iter().filter_map(one).collect()
}

/// Where every run stands: each number over its range, each word by a coordinate of its own.
fn places(runs: &[Run]) -> Vec<Vec<f64>> {
    let fields = runs.first().map_or(0, |run| run.values.len());
    let mut places = vec![Vec::new(); runs.len()];
    for field in 0..fields {
        let numbers: Option<Vec<f64>> = runs.iter().map(|run| run.values[field].parse().ok()).collect();
        if let Some(numbers) = numbers {
            let low = numbers.iter().copied().fold(f64::INFINITY, f64::min);
            let span = numbers.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low;
            let scale = if span > 0.0 { span.recip() } else { 0.0 };
            places.iter_mut().zip(&numbers).for_each(|(place, number)| place.push(scale * (number - low)));
            continue;
        }
        let words: BTreeSet<&str> = runs.iter().map(|run| run.values[field].as_str()).collect();
        for (place, run) in places.iter_mut().zip(runs) {
            place.extend(words.iter().map(|word| f64::from(u8::from(*word == run.values[field]))));
        }
    }
    places
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => 0.0,
        n if n.is_multiple_of(2) => 0.5 * (values[middle - 1] + values[middle]),
        _ => values[middle],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::Off;
    use crate::study::tests::made_up;

    /// A few large values rule mean and root mean square, and change neither median.
    #[test]
    fn large_values_do_not_hide_what_the_others_are_off_by() {
        let values: Vec<f64> = (0..21).map(|k| if k < 2 { 500.0 } else { f64::from(k) }).collect();
        let left_out: Vec<f64> = values.iter().map(|value| if *value > 100.0 { 90.0 } else { -2.0 }).collect();
        let trust = Trust::new(GeneratorKind::Cam, "backlash_arcsec", &values, &left_out);
        assert_eq!((trust.median_off, trust.spread, trust.useless), (2.0, 5.0, false));
        assert_eq!(trust.share_of_spread_percent, Some(40.0));
    }

    #[test]
    fn estimates_that_the_middle_value_beats_are_said_to_be_useless() {
        let trust = |values: &[f64], off: &[f64]| Trust::new(GeneratorKind::Cam, "k1_n_m_per_rad", values, off);
        assert!(trust(&[1.0, 2.0, 3.0], &[1.0, -1.0, 1.0]).useless);
        assert!(!trust(&[1.0, 2.0, 3.0], &[0.9, -0.9, 0.9]).useless);
        // What is the same everywhere is estimated so, or not at all.
        assert_eq!(trust(&[2.0; 3], &[0.0; 3]).share_of_spread_percent, Some(0.0));
        let none = trust(&[2.0; 3], &[0.1; 3]);
        assert!(none.useless && none.share_of_spread_percent.is_none());
    }

    /// A smooth figure is foretold well, noise is not.
    #[test]
    fn a_smooth_figure_is_trusted_and_noise_is_not() {
        let mut random = fastrand::Rng::with_seed(3);
        let mut runs: Vec<Run> = (0..60)
            .map(|k| {
                let x = f64::from(k) / 59.0;
                made_up(k as usize + 1, x, 1.0 + random.f64(), 200.0 + 50.0 * (2.0 * x).sin())
            })
            .collect();
        runs[7].basis = Basis::Estimated;
        let off = ["kinematic_error_pp_arcsec", "max_von_mises_mpa"].map(|figure| Off {
            generator: GeneratorKind::Cam,
            figure,
            runs: 59,
            rms: 0.0,
            largest: 0.0,
            rms_percent: 0.0,
        });
        let study = Study { fields: vec!["a".into()], runs, off: off.to_vec() };
        let told = trust(&study);
        assert!(told[0].share_of_spread_percent > Some(60.0), "{told:?}");
        assert!(told[1].share_of_spread_percent < Some(1.0) && !told[1].useless, "{told:?}");
    }
}
