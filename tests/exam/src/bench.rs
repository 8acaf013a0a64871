//! The oracle: what could be known at best from these data. It has the plant, the size of the noise and the spread of
//! units, and asks how far an effect stands out once every base parameter has been allowed to float.

use crate::drive::{
    BACKLASH_SPREAD, Drive, FRICTION_SPREAD, HARMONIC_SPREAD, PHASE_SPREAD_RAD, STIFFNESS_SPREAD, Unit,
};
use crate::effect::Effect;
use crate::motion::Motion;
use crate::noise::{Sensors, Whitening};
use crate::plant;

/// Rows of the thinned run on which the oracle works.
const ROWS: usize = 9000;

/// A run on which effects are weighed.
pub struct Bench<'a> {
    drive: &'a Drive,
    unit: &'a Unit,
    /// All rows.
    rows: Motion,
    /// Every `thin`th.
    thinned: Motion,
    thin: usize,
    /// Effects that are there besides.
    rest: Vec<Effect>,
    rest_arcsec: Vec<f64>,
    rest_fast_arcsec: Option<Vec<f64>>,
    scales: Scales,
}

/// What contributions are weighed on: the noise, and what may float beside them.
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
    /// What the base parameters do not take up within two standard deviations of their spread, rms.
    pub rms_arcsec: f64,
}

/// Contribution that counts as there: DIAGNOSIS §3.
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

impl<'a> Bench<'a> {
    /// A bench for this run with these effects present besides the one to be weighed.
    pub fn new(drive: &'a Drive, unit: &'a Unit, motion: &Motion, sensors: &Sensors, rest: &[Effect]) -> Self {
        let rows = motion.at_rows();
        let thin = rows.time_s.len().div_ceil(ROWS);
        let thinned = rows.every(thin);
        // A thinned row stands for its neighbours: the white noise of their mean.
        let white = sensors.floor_arcsec(drive) / (thin as f64).sqrt();
        let whitening = Whitening::new(&thinned, white, sensors.wander_arcsec, sensors.wander_s);
        let mut bench = Self {
            drive,
            unit,
            rows,
            thinned,
            thin,
            rest: rest.to_vec(),
            rest_arcsec: Vec::new(),
            rest_fast_arcsec: None,
            scales: Scales::new(whitening, Vec::new()),
        };
        bench.rest_arcsec = bench.errors(unit, rest, false);
        let floating = bench.floating_base().into_iter().chain(bench.floating_rest()).collect();
        bench.scales = Scales::new(bench.scales.whitening, floating);
        bench
    }

    fn errors(&self, unit: &Unit, effects: &[Effect], fast: bool) -> Vec<f64> {
        if fast || effects.iter().any(|effect| effect.what.is_fast()) {
            let errors = plant::run(self.drive, unit, &self.rows, effects).error_arcsec;
            self.rows.picks(self.thin).into_iter().map(|at| errors[at]).collect()
        } else {
            plant::run(self.drive, unit, &self.thinned, effects).error_arcsec
        }
    }

    /// Base parameters, each by one standard deviation of its spread.
    fn floating_base(&self) -> Vec<(Vec<f64>, f64)> {
        let mut floating = vec![(vec![1.0; self.rest_arcsec.len()], FREE)];
        let mut units = vec![
            Unit { stiffness: self.unit.stiffness + STIFFNESS_SPREAD, ..self.unit.clone() },
            Unit { backlash: self.unit.backlash + BACKLASH_SPREAD, ..self.unit.clone() },
            Unit { friction: self.unit.friction + FRICTION_SPREAD, ..self.unit.clone() },
        ];
        for at in 0..self.unit.harmonics.len() {
            let mut louder = self.unit.clone();
            louder.harmonics[at].0 += HARMONIC_SPREAD;
            let mut shifted = self.unit.clone();
            shifted.harmonics[at].1 += PHASE_SPREAD_RAD;
            units.extend([louder, shifted]);
        }
        for unit in units {
            let moved = self.errors(&unit, &self.rest, false);
            floating.push((difference(&moved, &self.rest_arcsec), SPREAD));
        }
        floating
    }

    /// Numbers of the effects that are there besides: free.
    fn floating_rest(&self) -> Vec<(Vec<f64>, f64)> {
        let mut floating = Vec::new();
        for at in 0..self.rest.len() {
            for moved in tangents(&self.rest[at], self.drive) {
                let mut effects = self.rest.clone();
                effects[at] = moved;
                let moved = self.errors(self.unit, &effects, false);
                let column = difference(&moved, &self.rest_arcsec);
                if column.iter().any(|x| x.abs() > 1e-9) {
                    floating.push((column, 1e-6));
                }
            }
        }
        floating
    }

    /// Angles between the axes of the housing and those of gravity, either way: none, and those of the run.
    pub fn orientations_rad(&self) -> Vec<f64> {
        let mut all = vec![0.0];
        for turned in self.rows.orientation_rad.iter().flat_map(|o| [*o, -o]) {
            if all.iter().all(|known| (turned - known).abs() > 1e-6) {
                all.push(turned);
            }
        }
        all
    }

    /// What an effect adds to the error at the thinned rows.
    pub fn signature(&mut self, effect: &Effect) -> Vec<f64> {
        self.signature_of(std::slice::from_ref(effect))
    }

    /// What several effects add together.
    pub fn signature_of(&mut self, effects: &[Effect]) -> Vec<f64> {
        let mut all = self.rest.clone();
        all.extend_from_slice(effects);
        let any_fast = |effects: &[Effect]| effects.iter().any(|effect| effect.what.is_fast());
        let fast = any_fast(effects) && !any_fast(&self.rest);
        if fast && self.rest_fast_arcsec.is_none() {
            self.rest_fast_arcsec = Some(self.errors(self.unit, &self.rest, true));
        }
        let with = self.errors(self.unit, &all, false);
        difference(
            &with,
            if fast { self.rest_fast_arcsec.as_ref().unwrap_or(&self.rest_arcsec) } else { &self.rest_arcsec },
        )
    }

    /// Weighs a contribution against the base parameters.
    pub fn weigh(&self, contribution: &[f64]) -> Weight {
        self.scales.weigh(contribution)
    }

    /// The same with further columns that may take it up freely; also their coefficients.
    pub fn weigh_beside(&self, contribution: &[f64], beside: &[(Vec<f64>, f64)]) -> (Weight, Vec<f64>) {
        self.scales.weigh_beside(contribution, beside)
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

    /// Weighs a contribution against the base parameters.
    pub fn weigh(&self, contribution: &[f64]) -> Weight {
        self.weigh_beside(contribution, &[]).0
    }

    /// The same with further columns that may take it up freely; also their coefficients. `damping` holds each against
    /// its scale.
    pub fn weigh_beside(&self, contribution: &[f64], beside: &[(Vec<f64>, f64)]) -> (Weight, Vec<f64>) {
        let target = self.whitening.apply(contribution);
        let own = self.whitened.len();
        // Rows of the lower triangle.
        let (mut gram, mut right) = (self.gram.clone(), products(&self.whitened, &target));
        let mut added: Vec<Vec<f64>> = vec![];
        for (column, damping) in beside {
            added.push(self.whitening.apply(column));
            let column = &added[added.len() - 1];
            let mut row = products(&self.whitened, column);
            row.extend(products(&added, column));
            if let Some(diagonal) = row.last_mut() {
                *diagonal += damping.max(1e-9 * *diagonal + 1e-12);
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
            return (Weight { d: square.sqrt(), rms_arcsec: rms(contribution) }, vec![0.0; beside.len()]);
        };
        let d = (square - dot(&right, &solution)).max(0.0).sqrt();
        let coefficients: Vec<f64> = solution.iter().zip(&scale).map(|(x, s)| x * s).collect();
        // A unit beyond its spread is a discrepancy, though a recalibration would take it up.
        let within = coefficients.iter().zip(self.prior.iter().map(Some).chain(std::iter::repeat(None)));
        let within = within.map(|(x, prior)| if prior == Some(&SPREAD) { x.clamp(-2.0, 2.0) } else { *x });
        let mut left = contribution.to_vec();
        for (column, coefficient) in self.nuisance.iter().chain(beside.iter().map(|(column, _)| column)).zip(within) {
            for (value, x) in left.iter_mut().zip(column) {
                *value -= coefficient * x;
            }
        }
        (Weight { d, rms_arcsec: rms(&left) }, coefficients[own..].to_vec())
    }
}

/// Effects that differ from this one by a small step of one number.
pub fn tangents(effect: &Effect, drive: &Drive) -> Vec<Effect> {
    let spec = effect.what.spec(drive);
    let mut moved = vec![effect.sized(effect.size * 1.05)];
    for (at, (_, range)) in spec.shape.iter().enumerate() {
        let step = range.step(effect.shape[at]);
        if step != 0.0 {
            let mut other = effect.clone();
            other.shape[at] = range.held(effect.shape[at] + step);
            if other.shape[at] == effect.shape[at] {
                other.shape[at] = range.held(effect.shape[at] - step);
            }
            moved.push(other);
        }
    }
    moved
}

/// Element by element.
pub fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// Root of the mean square.
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Eight sums beside each other, so that the processor has no need to wait for one.
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
