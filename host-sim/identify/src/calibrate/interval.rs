//! How well the fitted parts are known: the information matrix, the noise that the rows show, an interval for each
//! node.
//!
//! The rows `x c + zero + noise` have the information `G = Σ x xᵀ`, the zero of each file taken out. With `P` for the
//! covariance of `c` before the rows say anything, from the size that each part turned out to have, `c` has the
//! covariance `V = σ² κ (G + σ² κ P⁻¹)⁻¹` after them, about a mean that is off the fit by `d = (G + σ² κ P⁻¹)⁻¹ (Xᵀ r −
//! σ² κ P⁻¹ ĉ)` for what the fit `ĉ` leaves, `r`. An interval is that of `V + d dᵀ`. `κ` says how much more the mean of
//! many rows varies than white noise would let it (drift, jitter, what no part has). Where rows tell, `P` does not
//! matter; where they leave parts to be traded for one another (few loads, a load that goes with the angle), what is
//! left open is as wide as `P`. The delay between the angles of each log is a column as well: it goes with play where
//! the pace is one.

use std::f64::consts::{PI, TAU};

use flexspline_base::robust::{dot, rms};
use serde::Serialize;

use super::Model;
use super::folds::{FLOOR, Row};
use super::parts::{
    GENERATOR_ORDERS, PartName, Scales, State, columns, expected_arcsec, place, row, usual_arcsec, weights, width_of,
};
use crate::linear::{Gram, Prior, Solution, solve};
use crate::measurement::{median_of, white_noise};

/// Standard deviations of an interval that holds 95 %.
pub(crate) const OF_95: f64 = 1.96;
/// Rows are close if the highest order turns by no more than this from one to the next: an eighth of its wave.
const CLOSE_RAD: f64 = PI / 4.0;
/// Rows that hang together are looked for in stretches of these lengths, as long as there are this many stretches.
const STRETCHES: [usize; 8] = [4, 8, 16, 32, 64, 128, 256, 512];
const FEWEST_STRETCHES: usize = 20;
/// A stretch over this many steps of a resolution averages them out. A guess.
const STEPS_OF_A_STRETCH: f64 = 4.0;

/// Standard deviation of a coefficient that nothing is known of, arcsec. *Guess*: a thousand turns.
const UNKNOWN_ARCSEC: f64 = 1e9;

/// Knowledge of a coefficient before the rows, for the variance of a row.
fn before(mean: f64, precision: f64, of_a_row: f64) -> Prior {
    Prior { mean, std: (of_a_row * (precision + FLOOR)).sqrt().recip().min(UNKNOWN_ARCSEC) }
}

/// The coefficients after the rows of groups whose first column, their zero, is free in each.
fn after(groups: &[Gram], priors: &[Prior]) -> Option<Solution> {
    let mut all = Gram::none(priors.len() + 1);
    groups.iter().for_each(|group| all.add(&group.first_free(), 1.0));
    solve(&all, priors, 1.0)
}

/// Covariance of the coefficients of a drive that nobody has measured after these rows, arcsec², row by row, for the
/// variance of a row.
pub(super) fn planned_covariance(
    groups: &[Gram],
    parts: &[PartName],
    scales: &Scales,
    of_a_row: f64,
) -> Option<Vec<f64>> {
    let known = |part: &PartName| {
        let usual = usual_arcsec(*part, scales).powi(2);
        weights(*part).into_iter().map(move |weight| before(0.0, weight / usual, of_a_row))
    };
    let priors: Vec<Prior> = parts.iter().flat_map(known).collect();
    Some(after(groups, &priors)?.covariance().into_iter().map(|of_one| of_a_row * of_one).collect())
}

/// Variance of `x c`.
pub(super) fn variance(covariance: &[f64], x: &[f64]) -> f64 {
    let rows = covariance.chunks_exact(x.len().max(1));
    rows.zip(x).filter(|(_, a)| **a != 0.0).map(|(row, a)| a * dot(row, x)).sum::<f64>().max(0.0)
}

/// All columns of some parts in a state as a row of a group: one for its zero first, the value last.
pub(super) fn row_of_group(parts: &[PartName], at: &State, scales: &Scales, value: f64) -> Vec<f64> {
    [vec![1.0], row(parts, at, scales), vec![value]].concat()
}

/// Noise of the rows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RowNoise {
    /// Residual of the rows that it was fitted to, arcsec rms.
    pub rms_arcsec: f64,
    /// Of that the noise of single rows; 0 where rows are so far apart that what no part has changes from row to row as
    /// well.
    pub white_arcsec: f64,
    /// How much more the mean of many rows varies than if all of it did: 1 or more.
    pub hangs_together: f64,
}

impl RowNoise {
    /// From what is left of the rows of each file, in order, and the generator's usual step between them;
    /// `rows_of_a_step` of them pass while an angle stays within one step of its resolution.
    pub fn of(left: &[Vec<f64>], coefficients: usize, step_rad: f64, rows_of_a_step: f64) -> RowNoise {
        let rows: usize = left.iter().map(Vec::len).sum();
        let squares: f64 = left.iter().flatten().map(|e| e * e).sum();
        let variance = squares / rows.saturating_sub(coefficients).max(1) as f64;
        let mut most = 1.0_f64;
        // The part that neighbouring stretches have in common is no noise of single rows, nor of the steps of a
        // resolution where they are longer than those; and it stays at its place.
        let mut common = 0.0_f64;
        for length in STRETCHES {
            let means: Vec<f64> = left
                .iter()
                .flat_map(|file| file.chunks_exact(length))
                .map(|part| part.iter().sum::<f64>() / length as f64)
                .collect();
            if means.len() >= FEWEST_STRETCHES && variance > 0.0 {
                let of_means = means.iter().map(|mean| mean * mean).sum::<f64>() / means.len() as f64;
                most = most.max(length as f64 * of_means / variance);
                if length as f64 >= STEPS_OF_A_STRETCH * rows_of_a_step {
                    let products = means.windows(2).map(|pair| pair[0] * pair[1]);
                    common = common.max(products.sum::<f64>() / (means.len() - 1) as f64);
                }
            }
        }
        let close = step_rad * f64::from(GENERATOR_ORDERS) <= CLOSE_RAD;
        let most_white = (variance - common).max(0.0).sqrt();
        let white = if close { white_noise(left.iter().map(Vec::as_slice)).min(most_white) } else { 0.0 };
        RowNoise { rms_arcsec: variance.sqrt(), white_arcsec: white, hangs_together: most }
    }

    /// Variance that stands for a row where many are fitted, arcsec².
    pub(crate) fn of_a_row(&self) -> f64 {
        self.rms_arcsec * self.rms_arcsec * self.hangs_together
    }

    /// Noise that stays at each place, arcsec: drift, and errors of no part.
    pub fn lasting_arcsec(&self) -> f64 {
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

/// The nodes of a part: which quantity, its value, and the coefficients of the part there.
fn nodes_of(part: PartName, scales: &Scales) -> Vec<(&'static str, f64, Vec<f64>)> {
    let ([low, high], [cold, warm]) = (scales.torque_n_m, scales.temperature_c);
    let middle = State { temperature_c: f64::midpoint(cold, warm), way: 1.0, ..State::default() };
    let over = |of: &'static str, values: Vec<f64>, state: &dyn Fn(f64) -> State| {
        let node = |value: f64| {
            let mut x = Vec::new();
            columns(part, &state(value), scales, &mut x);
            if part == PartName::Temperature {
                // The zero is the encoder's as much as the drive's.
                x[0] = 0.0;
            }
            (of, if of.ends_with("_deg") { value.to_degrees() } else { value }, x)
        };
        values.into_iter().map(node).collect()
    };
    let turn = |count: usize| (0..count).map(|k| TAU * k as f64 / count as f64).collect();
    let torque = |torque_n_m: f64| State { torque_n_m, ..middle };
    let generator = |generator_rad: f64| State { generator_rad, ..middle };
    match part {
        PartName::WindUp => {
            over("torque_n_m", (0..9).map(|k| low + (high - low) * f64::from(k) / 8.0).collect(), &torque)
        }
        PartName::Play => over("torque_n_m", vec![low, 0.0, high], &torque),
        PartName::GeneratorAngle => over("generator_deg", turn(16), &generator),
        PartName::MaterialAngle => over("generator_against_output_deg", turn(16), &generator),
        PartName::ToothPitch => over("share_of_pitch_deg", turn(8), &|share| generator(share / scales.teeth)),
        PartName::OutputAngle => over("output_deg", turn(24), &|output_rad| State { output_rad, ..middle }),
        // Under the largest load: without one a temperature moves little but the zero.
        PartName::Temperature => {
            let largest = torque(if high.abs() >= low.abs() { high } else { low });
            over("temperature_c", vec![cold, warm], &|temperature_c| State { temperature_c, ..largest })
        }
        PartName::ReadingDelay(_) | PartName::WavesByLoad | PartName::WavesByFlank => Vec::new(),
    }
}

/// The half widths of all nodes of some parts, from the covariance; in the order of the parts.
pub(super) fn widths(parts: &[PartName], scales: &Scales, covariance: &[f64], model: Option<&Model>) -> Vec<Node> {
    let all = width_of(parts);
    let mut begin = 0;
    let mut nodes = Vec::new();
    for one in parts {
        let width = weights(*one).len();
        for (of, at, part) in nodes_of(*one, scales) {
            let mut x = vec![0.0; all];
            x[begin..begin + width].copy_from_slice(&part);
            let half = OF_95 * variance(covariance, &x).sqrt();
            let value_arcsec =
                model.map(|model| dot(&part, model.of(*one).map_or(&[][..], |of| &model.coefficients[of])));
            nodes.push(Node { part: one.as_str(), of, at, value_arcsec, half_width_arcsec: half });
        }
        begin += width;
    }
    nodes
}

/// Usual step of an angle from row to row, rad.
fn usual_step(rows: &[Row], angle: fn(&State) -> f64) -> f64 {
    let mut steps: Vec<f64> = rows.windows(2).map(|pair| (angle(&pair[1].at) - angle(&pair[0].at)).abs()).collect();
    if steps.is_empty() { 0.0 } else { median_of(&mut steps) }
}

/// Residual of the rows of each log about its mean, arcsec, and the noise in it.
pub(super) fn left_by(rows: &[Row], model: &Model, logs: usize, coarse_rad: f64) -> (Vec<Vec<f64>>, RowNoise) {
    let mut left = vec![Vec::new(); logs];
    rows.iter().for_each(|at| left[at.at.log].push(at.left_arcsec - model.adds_arcsec(&at.at)));
    for file in &mut left {
        let mean = file.iter().sum::<f64>() / file.len().max(1) as f64;
        file.iter_mut().for_each(|value| *value -= mean);
    }
    let step_rad = usual_step(rows, |at| at.output_rad);
    let rows_of_a_step = if step_rad > 0.0 { coarse_rad / step_rad } else { 0.0 };
    let fitted = model.coefficients.len() + logs;
    let noise = RowNoise::of(&left, fitted, usual_step(rows, |at| at.generator_rad), rows_of_a_step);
    (left, noise)
}

/// How well a fitted model is known.
#[derive(Debug, Clone)]
pub struct ModelUncertainty {
    model: Model,
    /// The parts of the model, and the delay of each log.
    parts: Vec<PartName>,
    /// Of what the fit misses in their coefficients, arcsec².
    covariance: Vec<f64>,
    /// Mean of their columns over the rows: an error that is the same in all of them is the zero of the output.
    means: Vec<f64>,
    /// Error that stays at each place, arcsec: drift, and errors of no part, as large as where rows took no part in the
    /// fit.
    pub(super) of_no_part_arcsec: f64,
    /// Noise of the rows.
    pub noise: RowNoise,
}

impl ModelUncertainty {
    /// From the rows of the fit, of logs with these delays as numbers of their columns, which `rows` are without unless
    /// the model has them; `coarse_rad` is the step of the resolution at the output, and `left_out_arcsec` what fits
    /// leave in rows that were left out of them. Parts of `beside` are known to no less than the standard deviation
    /// given with them, arcsec, before the rows; those that the model does not have are zero in it.
    pub(super) fn of(
        rows: &[Row],
        (model, beside): (&Model, &[(PartName, f64)]),
        delays: &[f64],
        coarse_rad: f64,
        left_out_arcsec: f64,
    ) -> Option<ModelUncertainty> {
        let (scales, logs) = (&model.scales, delays.len());
        let (left, noise) = left_by(rows, model, logs, coarse_rad);
        let in_table = model.chosen.iter().filter(|chosen| !matches!(chosen.part, PartName::ReadingDelay(_)));
        let mut parts: Vec<PartName> = in_table.map(|chosen| chosen.part).collect();
        let of_a_row = noise.of_a_row();
        // About what was fitted: what the rows would still move, and how far they leave it open.
        let mut priors: Vec<Prior> = Vec::new();
        for part in &parts {
            let of_part = model.of(*part).map_or(&[][..], |of| &model.coefficients[of]);
            let open = beside.iter().find(|(other, _)| other == part).map_or(0.0, |(_, arcsec)| *arcsec);
            let expected = expected_arcsec(*part, scales, of_part).max(open).powi(2).max(f64::MIN_POSITIVE);
            let known = of_part.iter().zip(weights(*part));
            priors.extend(known.map(|(fitted, weight)| before(-fitted, weight / expected, of_a_row)));
        }
        for (part, arcsec) in beside.iter().filter(|(part, _)| model.of(*part).is_none()) {
            parts.push(*part);
            let weights = weights(*part).into_iter();
            priors.extend(weights.map(|weight| before(0.0, f64::max(weight, 1.0) / arcsec.powi(2), of_a_row)));
        }
        if scales.speed_rad_s > 0.0 {
            for (log, delay) in delays.iter().enumerate() {
                let part = PartName::ReadingDelay(log);
                parts.push(part);
                let fitted = model.of(part).map_or(*delay, |of| model.coefficients[of.start]);
                priors.push(before(-fitted, expected_arcsec(part, scales, &[]).powi(-2), of_a_row));
            }
        }
        let mut groups = vec![Gram::none(priors.len() + 2); logs];
        let mut of_logs: Vec<_> = left.iter().map(|left| left.iter()).collect();
        let mut means = vec![0.0; priors.len()];
        for at in rows {
            let left = of_logs[at.at.log].next().copied().unwrap_or_default();
            let row = row_of_group(&parts, &at.at, scales, left);
            groups[at.at.log].add_row(&row, 1.0);
            means.iter_mut().zip(&row[1..]).for_each(|(mean, value)| *mean += value / rows.len() as f64);
        }
        let after = after(&groups, &priors)?;
        let off = &after.coefficients;
        let pairs = off.iter().flat_map(|a| off.iter().map(move |b| a * b));
        let covariance = after.covariance().iter().zip(pairs).map(|(of_one, pair)| of_a_row * of_one + pair).collect();
        let everywhere = RowNoise { rms_arcsec: noise.rms_arcsec.max(left_out_arcsec), ..noise };
        let of_no_part_arcsec = everywhere.lasting_arcsec();
        Some(ModelUncertainty { model: model.clone(), parts, covariance, means, of_no_part_arcsec, noise })
    }

    /// Half width of the interval that holds, with 95 %, what the table has at a state against the true error there,
    /// arcsec, but for one zero of all, which makes the mean over the rows right. At a speed the error is that of its
    /// log, which has a delay; without one, that of both angles at one instant.
    pub fn half_width_arcsec(&self, at: &State) -> f64 {
        OF_95 * (self.variance_of(at, |_| true) + self.of_no_part_arcsec.powi(2)).sqrt()
    }

    /// Variance of the sum of some coefficients at a state, about its mean over the rows, arcsec².
    pub(super) fn variance_of(&self, at: &State, has: impl Fn(usize) -> bool) -> f64 {
        let mut x = row(&self.parts, at, &self.model.scales);
        let columns = x.iter_mut().zip(&self.means).enumerate();
        columns.for_each(|(k, (x, mean))| *x = if has(k) { *x - mean } else { 0.0 });
        variance(&self.covariance, &x)
    }

    /// Mean square root of the half widths at some states, arcsec.
    pub(super) fn mean_half_width_arcsec(&self, states: impl Iterator<Item = State>) -> f64 {
        rms(&states.map(|at| self.half_width_arcsec(&at)).collect::<Vec<f64>>())
    }

    /// Standard deviation of a coefficient of a part.
    pub(super) fn std_of(&self, part: PartName, coefficient: usize) -> Option<f64> {
        let place = place(self.parts.iter().copied(), part)?.start + coefficient;
        Some(self.covariance[place * width_of(&self.parts) + place].sqrt())
    }

    /// Every node of every part.
    pub(super) fn nodes(&self) -> Vec<Node> {
        widths(&self.parts, &self.model.scales, &self.covariance, Some(&self.model))
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
                ..State::default()
            }
        })
        .collect()
}
