//! How far estimated figures can be trusted, in the figure's own unit: what they are off by in the middle, beside how
//! far variants differ.
//!
//! Root mean squares, and percents of a mean, are ruled by a few variants with large values. Here both are medians: of
//! what a surface is off by where it leaves out a computed variant, and of how far the computed variants lie from the
//! one in their middle. Where the first is as large as the second an estimate says no more than "as the middle one".

use serde::Serialize;

use flexspline_base::robust::median_of;
use flexspline_mechanics::drive::GeneratorKind;

/// How far estimates of a figure can be trusted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Trust {
    /// The generator.
    pub generator: GeneratorKind,
    /// The figure.
    pub figure: &'static str,
    /// Computed variants that the surface goes through, each left out in turn.
    pub runs: usize,
    /// Root mean square of computed less estimated, in the unit of the figure.
    pub rms: f64,
    /// The largest such difference.
    pub largest: f64,
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
    /// Of the values of computed variants, and what each is off by where it is left out.
    pub(super) fn new(generator: GeneratorKind, figure: &'static str, values: &[f64], left_out: &[f64]) -> Trust {
        let median_off = median_of(&mut left_out.iter().map(|off| off.abs()).collect::<Vec<f64>>());
        let middle = median_of(&mut values.to_vec());
        let spread = median_of(&mut values.iter().map(|value| (value - middle).abs()).collect::<Vec<f64>>());
        let share = match (spread > 0.0, median_off > 0.0) {
            (true, _) => Some(100.0 * median_off / spread),
            (false, false) => Some(0.0),
            (false, true) => None,
        };
        let useless = share.is_none_or(|share| share >= 100.0);
        let rms = (left_out.iter().map(|off| off * off).sum::<f64>() / left_out.len() as f64).sqrt();
        let largest = left_out.iter().fold(0.0, |most: f64, off| if off.abs() > most.abs() { *off } else { most });
        let runs = values.len();
        Trust { generator, figure, runs, rms, largest, median_off, spread, share_of_spread_percent: share, useless }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn what_is_left_out_is_told_by_its_root_mean_square_and_its_largest() {
        let off = Trust::new(GeneratorKind::Cam, "backlash_arcsec", &[10.0, 20.0, -30.0], &[1.0, -2.0, 2.0]);
        assert_eq!((off.runs, off.rms, off.largest), (3, 3.0f64.sqrt(), -2.0));
    }
}
