//! Robust statistics: medians, spreads that outliers do not move, white noise under a signal.

/// From the median of absolute deviations of a normal distribution to its standard deviation, 1/Φ⁻¹(3/4).
pub const MAD_TO_STD: f64 = 1.482_602_218_505_602;

/// Rows that a statistic of a long series is taken from at most.
const ENOUGH: usize = 200_000;

/// Least and largest of some values; plus and minus infinity of none.
pub fn least_and_most(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    values.into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| (a.min(value), b.max(value)))
}

/// Root mean square.
pub fn rms(values: &[f64]) -> f64 {
    // The sum of nothing is -0.
    ((0.0 + values.iter().map(|v| v * v).sum::<f64>()) / values.len().max(1) as f64).sqrt()
}

/// Sum of the products of two series, in their order.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The quantile `q` (0 to 1) of `values`, which are reordered; 0 of none.
pub fn quantile_of(values: &mut [f64], q: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let place = ((values.len() - 1) as f64 * q).round() as usize;
    *values.select_nth_unstable_by(place, f64::total_cmp).1
}

/// The median of `values`, which are reordered; 0 of none.
pub fn median_of(values: &mut [f64]) -> f64 {
    if values.len().is_multiple_of(2) && !values.is_empty() {
        let upper = values.len() / 2;
        let (below, middle, _) = values.select_nth_unstable_by(upper, f64::total_cmp);
        let lower = below.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        return 0.5 * (lower + *middle);
    }
    quantile_of(values, 0.5)
}

/// Median and robust standard deviation (1.4826 times the median absolute deviation) of `values`, which are
/// overwritten.
pub fn median_and_std(values: &mut [f64]) -> (f64, f64) {
    let median = median_of(values);
    for value in values.iter_mut() {
        *value = (*value - median).abs();
    }
    (median, MAD_TO_STD * median_of(values))
}

/// At most 200 000 of the values, evenly spread.
pub fn sampled(values: &[f64]) -> Vec<f64> {
    values.iter().copied().step_by(values.len().div_ceil(ENOUGH).max(1)).collect()
}

/// Standard deviation of the white part of the noise of `series`, taken in order: what differences of neighbours leave,
/// order 1 to 4, each freed of a polynomial of one degree more; the least of them, since a signal that is smooth from
/// row to row only adds.
pub fn white_noise<'a>(series: impl IntoIterator<Item = &'a [f64]>) -> f64 {
    let mut differences: [Vec<f64>; 4] = Default::default();
    for rows in series {
        // Whole stretches of rows, since differences need neighbours.
        let stretch = 2_000;
        let stretches = rows.len().div_ceil(stretch);
        for part in rows.chunks(stretch).step_by(stretches.div_ceil(ENOUGH / stretch).max(1)) {
            let mut d = part.to_vec();
            for of_order in &mut differences {
                for k in 1..d.len() {
                    d[k - 1] = d[k] - d[k - 1];
                }
                d.pop();
                of_order.extend_from_slice(&d);
            }
        }
    }
    // The variance of a difference of order k is that of the noise times the binomial (2k over k).
    let gains = [2.0_f64, 6.0, 20.0, 70.0];
    let mut least = f64::INFINITY;
    for (of_order, gain) in differences.iter_mut().zip(gains) {
        if of_order.len() >= 8 {
            for value in of_order.iter_mut() {
                *value = value.abs();
            }
            let mut std = MAD_TO_STD * median_of(of_order);
            if std == 0.0 {
                // More than half do not change at all: a coarse lattice. The mean square shows how often they do.
                let most = of_order.len() * 99 / 100;
                of_order.select_nth_unstable_by(most, f64::total_cmp);
                std = (of_order[..most].iter().map(|d| d * d).sum::<f64>() / most.max(1) as f64).sqrt();
            }
            least = least.min(std / gain.sqrt());
        }
    }
    if least.is_finite() { least } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normal deviates of unit variance.
    fn normal(random: &mut fastrand::Rng) -> f64 {
        (0..12).map(|_| random.f64()).sum::<f64>() - 6.0
    }

    #[test]
    fn medians_and_quantiles() {
        assert_eq!(median_of(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median_of(&mut [4.0, 3.0, 1.0, 2.0]), 2.5);
        assert_eq!(quantile_of(&mut [4.0, 3.0, 1.0, 2.0], 1.0), 4.0);
        assert_eq!(median_of(&mut []), 0.0);
    }

    #[test]
    fn white_noise_is_found_under_a_signal_a_hundred_times_larger_and_outliers() {
        let mut random = fastrand::Rng::with_seed(4);
        let series: Vec<f64> = (0..20_000)
            .map(|k| {
                let spike = if k % 97 == 0 { 1e4 } else { 0.0 };
                300.0 * (f64::from(k) * 0.02).sin() + 3.0 * normal(&mut random) + spike
            })
            .collect();
        let std = white_noise([series.as_slice()]);
        assert!((std - 3.0).abs() < 0.25, "{std}");
    }

    #[test]
    fn a_smooth_signal_has_next_to_no_noise() {
        let series: Vec<f64> = (0..5_000).map(|k| 300.0 * (f64::from(k) * 0.02).sin()).collect();
        assert!(white_noise([series.as_slice()]) < 1e-5);
    }
}
