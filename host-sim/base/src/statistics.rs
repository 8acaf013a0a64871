//! Figures of samples, each with its interval.

use serde::Serialize;

/// Intervals hold with this probability.
pub(crate) const CONFIDENCE: f64 = 0.95;
/// A quantile.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quantile {
    /// Share of the drives below.
    pub share: f64,
    /// The value.
    pub value: f64,
    /// Lower end of its interval by order statistics; nothing where the sample is too small to have one.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
    /// Drives that have both ends.
    pub drives_for_both_ends: usize,
}

/// Cumulative standard normal distribution.
pub fn normal_cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x * std::f64::consts::FRAC_1_SQRT_2)
}

/// Its inverse, for 0 < p < 1: algorithm AS 241 (Wichura 1988, PPND16), 1e-16 relative.
pub fn normal_quantile(p: f64) -> f64 {
    let poly = |c: &[f64; 8], r: f64| c.iter().rev().fold(0.0, |sum, c| sum * r + c);
    let q = p - 0.5;
    if q.abs() <= 0.425 {
        let r = 0.180_625 - q * q;
        return q * poly(&A, r) / poly(&B, r);
    }
    let r = (-libm::log(if q < 0.0 { p } else { 1.0 - p })).sqrt();
    let size = if r <= 5.0 { poly(&C, r - 1.6) / poly(&D, r - 1.6) } else { poly(&E, r - 5.0) / poly(&F, r - 5.0) };
    if q < 0.0 { -size } else { size }
}

const A: [f64; 8] = [
    3.387_132_872_796_366_5,
    1.331_416_678_917_843_8e2,
    1.971_590_950_306_551_3e3,
    1.373_169_376_550_946e4,
    4.592_195_393_154_987e4,
    6.726_577_092_700_87e4,
    3.343_057_558_358_813e4,
    2.509_080_928_730_122_7e3,
];
const B: [f64; 8] = [
    1.0,
    4.231_333_070_160_091e1,
    6.871_870_074_920_579e2,
    5.394_196_021_424_751e3,
    2.121_379_430_158_659_7e4,
    3.930_789_580_009_271e4,
    2.872_908_573_572_194_3e4,
    5.226_495_278_852_545e3,
];
const C: [f64; 8] = [
    1.423_437_110_749_683_5,
    4.630_337_846_156_546,
    5.769_497_221_460_691,
    3.647_848_324_763_204_5,
    1.270_458_252_452_368_4,
    2.417_807_251_774_506e-1,
    2.272_384_498_926_918_4e-2,
    7.745_450_142_783_414e-4,
];
const D: [f64; 8] = [
    1.0,
    2.053_191_626_637_759,
    1.676_384_830_183_803_8,
    6.897_673_349_851e-1,
    1.481_039_764_274_800_8e-1,
    1.519_866_656_361_645_7e-2,
    5.475_938_084_995_345e-4,
    1.050_750_071_644_416_9e-9,
];
const E: [f64; 8] = [
    6.657_904_643_501_103,
    5.463_784_911_164_114,
    1.784_826_539_917_291_3,
    2.965_605_718_285_048_7e-1,
    2.653_218_952_657_612_4e-2,
    1.242_660_947_388_078_4e-3,
    2.711_555_568_743_487_6e-5,
    2.010_334_399_292_288_1e-7,
];
const F: [f64; 8] = [
    1.0,
    5.998_322_065_558_88e-1,
    1.369_298_809_227_358e-1,
    1.487_536_129_085_061_5e-2,
    7.868_691_311_456_133e-4,
    1.846_318_317_510_054_8e-5,
    1.421_511_758_316_446e-7,
    2.044_263_103_389_939_8e-15,
];

/// Mean of some numbers.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Standard deviation of a sample, about its mean.
pub fn std_dev(values: &[f64]) -> f64 {
    let middle = mean(values);
    let squares: f64 = values.iter().map(|x| (x - middle) * (x - middle)).sum();
    (squares / (values.len() as f64 - 1.0).max(1.0)).sqrt()
}

/// Correlation of two samples; nothing where one of them does not scatter.
pub fn correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let (ma, mb) = (mean(a), mean(b));
    let product: f64 = a.iter().zip(b).map(|(x, y)| (x - ma) * (y - mb)).sum();
    let scale = std_dev(a) * std_dev(b) * (a.len() as f64 - 1.0);
    (scale > 0.0).then(|| product / scale)
}

/// The quantile of a sorted sample, with the interval of its order statistics: ranks between which a binomial variable
/// lies with a probability of 0.95. Points of a Latin hypercube scatter less than independent ones, so that it then
/// holds more often.
pub fn quantile(sorted: &[f64], share: f64) -> Quantile {
    let n = sorted.len();
    let rank = (share * n as f64).ceil() as usize;
    // P(B <= k) by the recurrence of the binomial terms, from the logarithm of the first.
    let (mut low, mut high) = (0, n + 1);
    let tail = 0.5 * (1.0 - CONFIDENCE);
    let (ln_p, ln_q) = (libm::log(share), libm::log1p(-share));
    let mut ln_term = n as f64 * ln_q;
    let mut below = 0.0;
    for k in 0..=n {
        below += libm::exp(ln_term);
        if below <= tail {
            low = k + 1;
        }
        if below >= 1.0 - tail {
            high = k + 1;
            break;
        }
        ln_term += libm::log((n - k) as f64 / (k + 1) as f64) + ln_p - ln_q;
    }
    // Rank 0 and rank n + 1 are no drive's: the end is where no drive of the sample has to be.
    let end = |rank: usize| rank.checked_sub(1).and_then(|k| sorted.get(k).copied());
    let drives_for_both_ends = (libm::log(tail) / ln_p.max(ln_q)).ceil() as usize;
    Quantile { share, value: sorted[rank.clamp(1, n) - 1], low: end(low), high: end(high), drives_for_both_ends }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_is_the_inverse() {
        for p in [1e-12, 1e-7, 0.01, 0.07, 0.08, 0.3, 0.5, 0.6, 0.93, 0.999, 1.0 - 1e-9] {
            let back = normal_cdf(normal_quantile(p));
            assert!((back / p - 1.0).abs() < 1e-12 || (back - p).abs() < 1e-15, "{p}: {back}");
        }
        assert!((normal_quantile(0.975) - 1.959_963_984_540_054).abs() < 1e-14);
    }

    /// Ranks by hand: of 100 numbers the median lies between the 40th and the 61st (Conover, Practical Nonparametric
    /// Statistics).
    #[test]
    fn ranks_of_a_median_are_those_of_the_books() {
        let sorted: Vec<f64> = (1..=100).map(f64::from).collect();
        let median = quantile(&sorted, 0.5);
        assert_eq!((median.value, median.low, median.high), (50.0, Some(40.0), Some(61.0)));
    }

    /// The largest of n is above the 95 % value with 1 - 0.95^n: of 8 it bounds nothing, of 72 it does with 97.5 %.
    #[test]
    fn a_sample_that_is_too_small_bounds_nothing() {
        let of = |n: u32, share| quantile(&(1..=n).map(f64::from).collect::<Vec<f64>>(), share);
        let few = of(8, 0.95);
        assert_eq!((few.value, few.high, few.drives_for_both_ends), (8.0, None, 72));
        assert!(few.low.is_some(), "{few:?}");
        assert!(of(71, 0.95).high.is_none() && of(72, 0.95).high == Some(72.0));
        assert!(of(71, 0.05).low.is_none() && of(72, 0.05).low == Some(1.0));
        assert_eq!((of(5, 0.5).low, of(5, 0.5).high, of(6, 0.5).low), (None, None, Some(1.0)));
    }
}
