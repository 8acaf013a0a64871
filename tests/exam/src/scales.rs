//! How far a contribution stands out of the noise once other columns have been allowed to take up what they can.

use crate::noise::Whitening;

/// Scales for contributions: the noise, and the columns that may float.
pub struct Scales {
    whitening: Whitening,
    nuisance: Vec<Vec<f64>>,
    whitened: Vec<Vec<f64>>,
    /// Products of the whitened columns with one another, the prior on the diagonal.
    gram: Vec<Vec<f64>>,
    /// Weight of the prior of each nuisance column.
    prior: Vec<f64>,
}

/// Weight of the prior of a base parameter in units of its spread.
pub const SPREAD: f64 = 1.0;
/// Weight of the prior of what is free.
pub const FREE: f64 = 1e-9;

/// How an effect stands out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weight {
    /// Distance from the best fit without it, in standard deviations of the noise.
    pub d: f64,
    /// Part that the base parameters do not take up within two standard deviations of their spread, rms.
    pub rms_arcsec: f64,
}

/// Smallest contribution that counts as there, rms.
pub fn least_rms_arcsec(white_arcsec: f64) -> f64 {
    f64::max(1.5, 0.3 * white_arcsec)
}

/// Distance in standard deviations beyond which an effect counts as there, and two effects as apart.
pub const LEAST_D: f64 = 5.0;

impl Weight {
    /// Over the limit of detection: above one counts as detectable.
    pub fn over_limit(&self, white_arcsec: f64) -> f64 {
        (self.rms_arcsec / least_rms_arcsec(white_arcsec)).min(self.d / LEAST_D)
    }
}

impl Scales {
    /// Scales for noise of this kind, with columns that float and the weight of the prior of each.
    pub fn new(whitening: Whitening, floating: Vec<(Vec<f64>, f64)>) -> Self {
        let (nuisance, prior): (Vec<_>, Vec<_>) = floating.into_iter().unzip();
        let whitened: Vec<Vec<f64>> = nuisance.iter().map(|column: &Vec<f64>| whitening.apply(column)).collect();
        let mut gram = vec![];
        for (at, column) in whitened.iter().enumerate() {
            gram.push(products(&whitened[..=at], column));
            gram[at][at] += prior[at];
        }
        Self { whitening, nuisance, whitened, gram, prior }
    }

    pub fn weigh(&self, contribution: &[f64]) -> Weight {
        self.weigh_with(contribution, &[])
    }

    /// The same with further columns that may take it up freely.
    pub fn weigh_with(&self, contribution: &[f64], further: &[Vec<f64>]) -> Weight {
        let target = self.whitening.apply(contribution);
        // Rows of the lower triangle.
        let (mut gram, mut right) = (self.gram.clone(), products(&self.whitened, &target));
        let mut added: Vec<Vec<f64>> = vec![];
        for column in further {
            added.push(self.whitening.apply(column));
            let column = &added[added.len() - 1];
            let mut row = products(&self.whitened, column);
            row.extend(products(&added, column));
            if let Some(diagonal) = row.last_mut() {
                *diagonal += 1e-9 * *diagonal + 1e-12;
            }
            gram.push(row);
            right.push(dot(column, &target));
        }
        let scale: Vec<f64> = gram.iter().enumerate().map(|(at, row)| row[at].sqrt().recip()).collect();
        for (i, row) in gram.iter_mut().enumerate() {
            row.iter_mut().zip(&scale).for_each(|(value, s)| *value *= s * scale[i]);
            row[i] += 1e-10;
        }
        right.iter_mut().zip(&scale).for_each(|(value, s)| *value *= s);
        let square = dot(&target, &target);
        let Some(solution) = solved(gram, &right) else {
            return Weight { d: square.sqrt(), rms_arcsec: rms(contribution) };
        };
        let d = (square - dot(&right, &solution)).max(0.0).sqrt();
        let coefficients: Vec<f64> = solution.iter().zip(&scale).map(|(x, s)| x * s).collect();
        // A unit beyond its spread is a discrepancy, though a recalibration would take it up.
        let within = coefficients.iter().zip(self.prior.iter().map(Some).chain(std::iter::repeat(None)));
        let within = within.map(|(x, prior)| if prior == Some(&SPREAD) { x.clamp(-2.0, 2.0) } else { *x });
        let mut left = contribution.to_vec();
        for (column, coefficient) in self.nuisance.iter().chain(further).zip(within) {
            for (value, x) in left.iter_mut().zip(column) {
                *value -= coefficient * x;
            }
        }
        Weight { d, rms_arcsec: rms(&left) }
    }
}

pub fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Eight sums in parallel, so that the processor has no need to wait for one.
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut sums = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}

fn products(columns: &[Vec<f64>], with: &[f64]) -> Vec<f64> {
    columns.iter().map(|column| dot(column, with)).collect()
}

/// `A⁻¹ b` of a symmetric matrix by the rows of its lower triangle; `None` if it is not positive definite.
fn solved(mut lower: Vec<Vec<f64>>, right: &[f64]) -> Option<Vec<f64>> {
    let mut x = right.to_vec();
    for i in 0..lower.len() {
        for j in 0..=i {
            let left = lower[i][j] - dot(&lower[i][..j], &lower[j][..j]);
            lower[i][j] = if i > j { left / lower[j][j] } else { Some(left.sqrt()).filter(|root| *root > 0.0)? };
        }
        x[i] = (x[i] - dot(&lower[i][..i], &x[..i])) / lower[i][i];
    }
    for i in (0..x.len()).rev() {
        let below: f64 = (i + 1..x.len()).map(|k| lower[k][i] * x[k]).sum();
        x[i] = (x[i] - below) / lower[i][i];
    }
    Some(x)
}
