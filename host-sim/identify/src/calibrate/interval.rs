//! How well the fitted parts are known: the information matrix, the noise that the rows show, an interval for each
//! node.
//!
//! The rows `x c + zero + noise` have the information `G = Σ x xᵀ`, the zero of each file taken out. With the penalty
//! `Λ` of the fit the coefficients have the covariance `σ² κ (G + Λ)⁻¹`; `κ` says how much more the mean of many rows
//! varies than white noise would let it (drift, jitter, what no part has). The penalty pulls the coefficients by
//! `−(G + Λ)⁻¹ Λ c`; the square of that is added.

use std::f64::consts::{PI, TAU};

use flexspline_algebra::{Mat, cholesky};
use serde::Serialize;

use super::Model;
use super::folds::{Chosen, FLOOR, Row};
use super::parts::{GENERATOR_ORDERS, PartName, Scales, State, columns, weights};
use crate::measurement::{median_of, white_noise};

/// Standard deviations of an interval that holds 95 %.
pub(super) const OF_95: f64 = 1.96;
/// Rows are close if the highest order turns by no more than this from one to the next: an eighth of its wave.
const CLOSE_RAD: f64 = PI / 4.0;
/// Rows that hang together are looked for in stretches of these lengths, as long as there are so many stretches.
const STRETCHES: [usize; 8] = [4, 8, 16, 32, 64, 128, 256, 512];
const FEWEST_STRETCHES: usize = 20;

/// Sums over rows that share a zero.
#[derive(Debug, Clone, Default)]
pub(super) struct Information {
    width: usize,
    rows: f64,
    sum: Vec<f64>,
    square: Vec<f64>,
}

impl Information {
    pub fn new(width: usize) -> Information {
        Information { width, rows: 0.0, sum: vec![0.0; width], square: vec![0.0; width * width] }
    }

    /// Adds a row that counts `weight` times.
    pub fn add(&mut self, x: &[f64], weight: f64) {
        self.rows += weight;
        for (i, a) in x.iter().enumerate() {
            self.sum[i] += weight * a;
            for (j, b) in x.iter().enumerate().take(i + 1) {
                self.square[i * self.width + j] += weight * a * b;
            }
        }
    }

    /// Adds rows with the same zero.
    pub fn join(&mut self, other: &Information) {
        self.rows += other.rows;
        self.sum.iter_mut().zip(&other.sum).for_each(|(a, b)| *a += b);
        self.square.iter_mut().zip(&other.square).for_each(|(a, b)| *a += b);
    }

    pub(crate) fn rows(&self) -> f64 {
        self.rows
    }

    /// The information on the coefficients where the zero is not known.
    fn add_without_zero(&self, to: &mut Mat) {
        if self.rows <= 0.0 {
            return;
        }
        for i in 0..self.width {
            for j in 0..=i {
                let value = self.square[i * self.width + j] - self.sum[i] * self.sum[j] / self.rows;
                to[(i, j)] += value;
                if i != j {
                    to[(j, i)] += value;
                }
            }
        }
    }
}

/// The inverse of the information with the penalties, of noise one: covariance of the coefficients.
pub(super) fn covariance(groups: &[Information], chosen: &[Chosen], rows: f64) -> Option<Mat> {
    let penalties: Vec<f64> = chosen
        .iter()
        .flat_map(|c| weights(c.part).into_iter().map(|weight| (c.penalty * weight + FLOOR) * rows))
        .collect();
    let width = penalties.len();
    let mut gram = Mat::zeros(width, width);
    groups.iter().for_each(|group| group.add_without_zero(&mut gram));
    penalties.iter().enumerate().for_each(|(i, penalty)| gram[(i, i)] += penalty);
    let mut one = Mat::zeros(width, width);
    (0..width).for_each(|i| one[(i, i)] = 1.0);
    Some(cholesky(gram.as_ref()).ok()?.solve(one.as_ref()))
}

/// Variance of `x c`, of noise one.
pub(super) fn variance(covariance: &Mat, x: &[f64]) -> f64 {
    let mut sum = 0.0;
    for (i, a) in x.iter().enumerate().filter(|(_, a)| **a != 0.0) {
        sum += a * x.iter().enumerate().map(|(j, b)| covariance[(i, j)] * b).sum::<f64>();
    }
    sum.max(0.0)
}

/// How many columns some parts have.
pub(super) fn width_of(chosen: &[Chosen]) -> usize {
    chosen.iter().map(|chosen| weights(chosen.part).len()).sum()
}

/// All columns of some parts in a state.
pub(super) fn row(chosen: &[Chosen], at: &State, scales: &Scales) -> Vec<f64> {
    let mut x = Vec::new();
    chosen.iter().for_each(|chosen| columns(chosen.part, at, scales, &mut x));
    x
}

/// What the rows show of noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Noise {
    /// What the model leaves of the rows that it was fitted to, arcsec rms.
    pub rms_arcsec: f64,
    /// Of that the noise of single rows; 0 where rows are so far apart that what no part has changes from row to row as
    /// well.
    pub white_arcsec: f64,
    /// How much more the mean of many rows varies than if all of it did: 1 or more.
    pub hangs_together: f64,
}

impl Noise {
    /// From what is left of the rows of each file, in order, and the generator's usual step between them.
    pub fn of(left: &[Vec<f64>], coefficients: usize, step_rad: f64) -> Noise {
        let rows: usize = left.iter().map(Vec::len).sum();
        let squares: f64 = left.iter().flatten().map(|e| e * e).sum();
        let variance = squares / rows.saturating_sub(coefficients).max(1) as f64;
        let mut most = 1.0_f64;
        for length in STRETCHES {
            let means: Vec<f64> = left
                .iter()
                .flat_map(|file| file.chunks_exact(length))
                .map(|part| part.iter().sum::<f64>() / length as f64)
                .collect();
            if means.len() >= FEWEST_STRETCHES && variance > 0.0 {
                let of_means = means.iter().map(|mean| mean * mean).sum::<f64>() / means.len() as f64;
                most = most.max(length as f64 * of_means / variance);
            }
        }
        let close = step_rad * f64::from(GENERATOR_ORDERS) <= CLOSE_RAD;
        let white = if close { white_noise(left.iter().map(Vec::as_slice)).min(variance.sqrt()) } else { 0.0 };
        Noise { rms_arcsec: variance.sqrt(), white_arcsec: white, hangs_together: most }
    }

    /// Variance that stands for a row where many are fitted, arcsec².
    pub(crate) fn of_a_row(&self) -> f64 {
        self.rms_arcsec * self.rms_arcsec * self.hangs_together
    }

    /// What is not from row to row and stays at each place, arcsec: drift, and what no part has.
    pub fn beside_white_arcsec(&self) -> f64 {
        (self.rms_arcsec.powi(2) - self.white_arcsec.powi(2)).max(0.0).sqrt()
    }
}

/// A node of a curve with the half width of the interval that holds it with 95 %.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Node {
    /// Part.
    pub part: &'static str,
    /// Which angle, torque or temperature.
    pub of: &'static str,
    /// Its value: deg, N·m or °C.
    pub at: f64,
    /// The curve there, arcsec; absent of a plan.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value_arcsec: Option<f64>,
    /// Half width, arcsec.
    pub half_width_arcsec: f64,
}

/// Where the nodes of a part lie: what it is, its value, the state, and the coefficients of the part there.
pub(super) fn nodes_of(part: PartName, scales: &Scales) -> Vec<(&'static str, f64, Vec<f64>)> {
    let [low, high] = scales.torque_n_m;
    let [cold, warm] = scales.temperature_c;
    let middle = State {
        generator_rad: 0.0,
        output_rad: 0.0,
        torque_n_m: 0.0,
        temperature_c: f64::midpoint(cold, warm),
        way: 1.0,
        speed_rad_s: 0.0,
    };
    let turn = |count: usize| (0..count).map(move |k| TAU * k as f64 / count as f64);
    let states: Vec<(&'static str, f64, State)> = match part {
        PartName::WindUp => (0..9)
            .map(|k| low + (high - low) * f64::from(k) / 8.0)
            .map(|torque| ("torque_n_m", torque, State { torque_n_m: torque, ..middle }))
            .collect(),
        PartName::Play => [low, 0.0, high]
            .into_iter()
            .map(|torque| ("torque_n_m", torque, State { torque_n_m: torque, ..middle }))
            .collect(),
        PartName::GeneratorAngle => {
            turn(16).map(|psi| ("generator_deg", psi.to_degrees(), State { generator_rad: psi, ..middle })).collect()
        }
        PartName::MaterialAngle => turn(16)
            .map(|psi| ("generator_against_output_deg", psi.to_degrees(), State { generator_rad: psi, ..middle }))
            .collect(),
        PartName::ToothPitch => turn(8)
            .map(|phase| {
                ("share_of_pitch_deg", phase.to_degrees(), State { generator_rad: phase / scales.teeth, ..middle })
            })
            .collect(),
        PartName::OutputAngle => {
            turn(24).map(|out| ("output_deg", out.to_degrees(), State { output_rad: out, ..middle })).collect()
        }
        // Under the largest load: without one a temperature moves little but the zero.
        PartName::Temperature => [cold, warm]
            .into_iter()
            .map(|temperature_c| {
                let torque_n_m = if high.abs() >= low.abs() { high } else { low };
                ("temperature_c", temperature_c, State { temperature_c, torque_n_m, ..middle })
            })
            .collect(),
        PartName::ReadingDelay => Vec::new(),
    };
    states
        .into_iter()
        .map(|(of, at, state)| {
            let mut x = Vec::new();
            columns(part, &state, scales, &mut x);
            if part == PartName::Temperature {
                // The zero is the encoder's as much as the drive's.
                x[0] = 0.0;
            }
            (of, at, x)
        })
        .collect()
}

/// The half widths of all nodes of some parts, from the covariance of noise one and the variance of a row; in the order
/// of the parts.
pub(super) fn widths(
    chosen: &[Chosen],
    scales: &Scales,
    covariance: &Mat,
    of_a_row: f64,
    adds: &dyn Fn(&[f64]) -> f64,
) -> Vec<Node> {
    let all = width_of(chosen);
    let mut begin = 0;
    let mut nodes = Vec::new();
    for one in chosen {
        let width = weights(one.part).len();
        for (of, at, part) in nodes_of(one.part, scales) {
            let mut x = vec![0.0; all];
            x[begin..begin + width].copy_from_slice(&part);
            let half = OF_95 * (of_a_row * variance(covariance, &x) + adds(&x).powi(2)).sqrt();
            nodes.push(Node { part: one.part.as_str(), of, at, value_arcsec: None, half_width_arcsec: half });
        }
        begin += width;
    }
    nodes
}

/// Usual step of the generator from row to row, rad.
fn usual_step(rows: &[Row]) -> f64 {
    let mut steps: Vec<f64> =
        rows.windows(2).map(|pair| (pair[1].at.generator_rad - pair[0].at.generator_rad).abs()).collect();
    if steps.is_empty() { 0.0 } else { median_of(&mut steps) }
}

/// How well a fitted model is known.
#[derive(Debug, Clone)]
pub struct Known {
    model: Model,
    covariance: Mat,
    /// How far the penalty pulls the coefficients.
    pulled: Vec<f64>,
    /// What the rows show of noise.
    pub noise: Noise,
}

impl Known {
    /// From the rows of the fit.
    pub(super) fn of(rows: &[Row], model: &Model, files: usize) -> Option<Known> {
        let width = model.coefficients.len();
        let mut groups = vec![Information::new(width); files];
        let mut left = vec![Vec::new(); files];
        for at in rows {
            groups[at.zero].add(&row(&model.chosen, &at.at, &model.scales), 1.0);
            left[at.zero].push(at.left_arcsec - model.adds_arcsec(&at.at));
        }
        for file in &mut left {
            let mean = file.iter().sum::<f64>() / file.len().max(1) as f64;
            file.iter_mut().for_each(|value| *value -= mean);
        }
        let count = rows.len() as f64;
        let covariance = covariance(&groups, &model.chosen, count)?;
        let weighted: Vec<f64> = model
            .chosen
            .iter()
            .flat_map(|c| weights(c.part).into_iter().map(|weight| c.penalty * weight * count))
            .zip(&model.coefficients)
            .map(|(penalty, coefficient)| penalty * coefficient)
            .collect();
        let pulled = (0..width).map(|i| (0..width).map(|j| covariance[(i, j)] * weighted[j]).sum::<f64>()).collect();
        Some(Known {
            model: model.clone(),
            covariance,
            pulled,
            noise: Noise::of(&left, width + files, usual_step(rows)),
        })
    }

    /// Half width of the interval that holds, with 95 %, what the table has at a state against the true error there,
    /// arcsec, but for one zero of all.
    #[must_use]
    pub fn half_width_arcsec(&self, at: &State) -> f64 {
        let x = row(&self.model.chosen, at, &self.model.scales);
        let pulled: f64 = x.iter().zip(&self.pulled).map(|(x, pulled)| x * pulled).sum();
        let beside = self.noise.beside_white_arcsec();
        OF_95 * (self.noise.of_a_row() * variance(&self.covariance, &x) + pulled * pulled + beside * beside).sqrt()
    }

    /// Standard deviation of a coefficient, arcsec.
    pub(super) fn std_arcsec(&self, coefficient: usize) -> f64 {
        let variance = self.noise.of_a_row() * self.covariance[(coefficient, coefficient)];
        (variance + self.pulled[coefficient].powi(2)).sqrt()
    }

    /// Every node of every part.
    pub(super) fn nodes(&self) -> Vec<Node> {
        let Model { chosen, scales, coefficients } = &self.model;
        let pulled = |x: &[f64]| x.iter().zip(&self.pulled).map(|(x, pulled)| x * pulled).sum::<f64>();
        let mut nodes = widths(chosen, scales, &self.covariance, self.noise.of_a_row(), &pulled);
        let mut begin = 0;
        let mut values = Vec::new();
        for one in chosen {
            let width = weights(one.part).len();
            for (_, _, x) in nodes_of(one.part, scales) {
                values.push(x.iter().zip(&coefficients[begin..begin + width]).map(|(x, c)| x * c).sum::<f64>());
            }
            begin += width;
        }
        nodes.iter_mut().zip(values).for_each(|(node, value)| node.value_arcsec = Some(value));
        nodes
    }
}

/// States spread evenly over what a table is to hold: angles, torques, temperatures, both directions.
pub(super) fn spread(scales: &Scales, ratio: f64, output_rad: [f64; 2], count: usize) -> Vec<State> {
    // Multiples of the powers of a root of x⁵ = x + 1, which fill a cube evenly.
    let root = 1.167_303_978_261_418_7_f64;
    let share = |k: usize, power: i32| (0.5 + k as f64 / root.powi(power)).fract();
    let between = |[low, high]: [f64; 2], share: f64| low + (high - low) * share;
    (1..=count)
        .map(|k| {
            let output = between(output_rad, share(k, 1));
            State {
                // Phases of generator and teeth are as good as free of the output's angle.
                generator_rad: output * ratio + PI * share(k, 4),
                output_rad: output,
                torque_n_m: between(scales.torque_n_m, share(k, 2)),
                temperature_c: between(scales.temperature_c, share(k, 3)),
                way: if k % 2 == 0 { 1.0 } else { -1.0 },
                speed_rad_s: 0.0,
            }
        })
        .collect()
}
