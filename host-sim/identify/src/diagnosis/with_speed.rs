//! How the amplitude of a line of the generator's angle goes with the speed. Wheels and encoders make the same wave at
//! every speed; what a torque of the motor shakes, or a load that swings, makes more of it the nearer its frequency
//! comes to that of the load on its spring. Less of it in fast motion speaks against no encoder: a reading that is
//! averaged, or whose instant scatters, smears its lines.

use std::ops::Range;

use super::candidate::{Label, Per};
use super::channels::BLOCKS;
use super::model::Problem;
use super::remainder::explained;
use super::rows::quantile;
use super::select::Selected;
use super::uncertainty::Known;
use crate::causes::{CauseName, ParameterName};
use crate::least_squares::{Normal, jackknife};

/// Slow rows are this share of those in motion, … *Guess*: the slowest third.
const SLOW: f64 = 0.35;
/// … and fast rows those above this share of them; … *Guess*: the fastest third.
const FAST: f64 = 0.65;
/// … in motion are those above this share of the speed that a twentieth of the rows exceed; … *Guess*: slower rows are
/// starts and ends of a motion.
const IN_MOTION: f64 = 0.05;
/// … and these have to turn this multiple as fast as those, on the median. *Guess*.
const APART: f64 = 1.5;
/// Fewest rows of either. *Guess*: the least that a diagnosis needs as well.
const FEWEST: usize = 200;
/// Amplitudes differ from this number of their standard deviations on, five as between rivals, … *Source*.
const CERTAIN: f64 = 5.0;
/// … and by this factor: models of wheels and encoders hold to a few tenths. *Guess*.
const CLEARLY: f64 = 1.4;

/// Amplitudes of a line at two speeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WithSpeed {
    /// Median speeds of slow and fast rows, rad/s of the generator.
    pub speeds: [f64; 2],
    /// Amplitudes there, arcsec, …
    pub amplitudes: [f64; 2],
    /// … with their standard deviation.
    pub stds: [f64; 2],
}

impl WithSpeed {
    /// By how many standard deviations the amplitude grows, negative where it fades; 0 where it changes by less than
    /// laws hold to.
    pub(crate) fn grows_by(&self) -> f64 {
        let [slow, fast] = self.amplitudes;
        let clear = slow.max(fast) > CLEARLY * slow.min(fast);
        if clear { (fast - slow) / self.stds[0].hypot(self.stds[1]).max(1e-30) } else { 0.0 }
    }

    fn changes(&self) -> bool {
        self.grows_by().abs() > CERTAIN
    }

    /// In words, for a line that has no name.
    fn words(&self) -> String {
        let ([slow, fast], [at_slow, at_fast]) = (self.speeds, self.amplitudes);
        let sizes = format!("{at_slow:.1} arcsec at {slow:.1} rad/s of the generator, {at_fast:.1} at {fast:.1}");
        match (self.changes(), self.grows_by() > 0.0) {
            (true, true) => format!(
                ", which grows with the speed ({sizes}): what the motor's torque or the load shakes, not what is out \
                 of shape"
            ),
            (true, false) => format!(", which fades with the speed ({sizes})"),
            (false, _) => format!(", the same at every speed ({sizes})"),
        }
    }
}

/// Largest growth that is none, in standard deviations.
pub(super) const NO_GROWTH: f64 = CERTAIN;

/// The order of the generator's angle that a term without a name, or a cause that is one line of it, stands for.
pub(super) fn order_of(label: Label, known: Option<&Known>) -> Option<f64> {
    match label {
        Label::Line { per: Per::GeneratorTurn, order } if order >= 1.0 => Some(order),
        Label::Cause(CauseName::GeneratorEncoderTilt) => Some(2.0),
        Label::Cause(CauseName::EncoderSubdivision) => {
            let of = |name: ParameterName| known?.parameters.get(name.as_str()).map(|parameter| parameter.value);
            (of(ParameterName::Encoder) == Some(0.0)).then(|| of(ParameterName::Harmonic)).flatten()
        }
        Label::Cause(_) | Label::Line { .. } | Label::Like(_) | Label::Fault { .. } => None,
    }
}

/// The line of term `k` of a model, of this order, at two speeds; without a term what is left is looked at. Nothing
/// where the speeds tell nothing.
pub(super) fn with_speed(
    problem: &Problem<'_>,
    selected: &Selected<'_>,
    term: Option<usize>,
    order: f64,
) -> Option<WithSpeed> {
    let rows = problem.on.rows;
    let mut others = selected.clone();
    if let Some(k) = term {
        let from = others.fit.starts[k];
        others.fit.solution.coefficients[from..from + selected.terms[k].len()].fill(0.0);
    }
    let left = problem.on.left(&explained(problem, &others));
    let used: Vec<usize> = rows.sessions_used().flatten().filter(|k| !problem.uncertain[*k]).collect();
    let speed = |k: usize| rows.speed[k].abs();
    let least = IN_MOTION * quantile(used.iter().map(|k| speed(*k)), 0.95);
    let moving: Vec<usize> = used.into_iter().filter(|k| speed(*k) > least).collect();
    let [slow, fast] = [SLOW, FAST].map(|share| quantile(moving.iter().map(|k| speed(*k)), share));
    let groups: [Vec<usize>; 2] = [
        moving.iter().copied().filter(|k| speed(*k) <= slow).collect(),
        moving.iter().copied().filter(|k| speed(*k) >= fast).collect(),
    ];
    let speeds = groups.each_ref().map(|group| quantile(group.iter().map(|k| speed(*k)), 0.5));
    if groups.iter().any(|group| group.len() < FEWEST) || speeds[1] < APART * speeds[0] {
        return None;
    }
    let [at_slow, at_fast] = groups.map(|group| amplitude(&group, |k| order * rows.generator[k], |k| left[k]));
    let ((slow, slow_std), (fast, fast_std)) = (at_slow?, at_fast?);
    Some(WithSpeed { speeds, amplitudes: [slow, fast], stds: [slow_std, fast_std] })
}

/// Amplitude of the wave of an angle in values of some rows, with its standard deviation: least squares, the mean free.
/// The deviation is that of blocks of neighbouring rows left out in turn: wander and other lines are alike from row to
/// row.
fn amplitude(rows: &[usize], angle: impl Fn(usize) -> f64, value: impl Fn(usize) -> f64) -> Option<(f64, f64)> {
    let wave = |k: &usize| [1.0, angle(*k).cos(), angle(*k).sin(), value(*k)];
    let waves: Vec<[f64; 4]> = rows.iter().map(wave).collect();
    let (count, block) = (waves.len(), waves.len().div_ceil(BLOCKS));
    let without = |out: Range<usize>| {
        let fit = Normal::of(3, count, |k, row| {
            row.copy_from_slice(&waves[k][..3]);
            (waves[k][3], f64::from(u8::from(!out.contains(&k))))
        })?;
        let [_, cosine, sine] = fit.values()[..] else { return None };
        // Rows that see too little of the wave do not tell its two parts.
        let inverse = &fit.inverse;
        let doubt = inverse[(1, 1)] * inverse[(2, 2)] - inverse[(1, 2)].powi(2);
        (doubt * (count as f64).powi(2) <= 4e2).then(|| cosine.hypot(sine))
    };
    let others: Option<Vec<f64>> = (0..count).step_by(block).map(|from| without(from..from + block)).collect();
    Some((without(0..0)?, jackknife(&others?)))
}

/// Sentences on spectral lines of the generator angle, with their names: of terms of a model, and of lines that
/// averages hide.
pub(super) fn words(
    problem: &Problem<'_>,
    selected: &Selected<'_>,
    known: &[Known],
    hidden: &[Label],
) -> Vec<(String, String)> {
    let of_terms = selected.terms.iter().enumerate().map(|(k, term)| (term.law.label, Some(k)));
    let all = of_terms.chain(hidden.iter().map(|label| (*label, None)));
    all.filter_map(|(label, term)| {
        let order = order_of(label, term.and_then(|k| known.get(k)))?;
        Some((label.to_string(), with_speed(problem, selected, term, order)?.words()))
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_amplitude_of_a_wave_is_found_at_any_rows_with_its_doubt() {
        let mut random = fastrand::Rng::with_seed(2);
        let noise: Vec<f64> = (0..4000).map(|_| (0..12).map(|_| random.f64()).sum::<f64>() - 6.0).collect();
        let angle = |k: usize| 0.37 * k as f64;
        let rows: Vec<usize> = (0..4000).filter(|k| k % 3 != 1).collect();
        let (found, std) = amplitude(&rows, angle, |k| 7.0 + 3.0 * (angle(k) + 0.6).sin() + noise[k]).unwrap();
        assert!((found - 3.0).abs() < 4.0 * std && (0.02..0.04).contains(&std), "{found} ± {std}");
        assert_eq!(amplitude(&rows, |_| 1.0, |k| noise[k]), None, "no wave is seen at one angle");
    }

    #[test]
    fn a_line_close_by_counts_as_doubt() {
        let rows: Vec<usize> = (0..24_000).collect();
        let angle = |k: usize| 0.37 * k as f64;
        // Out of step with the wave by four turns over all rows.
        let other = |k: usize| (angle(k) + std::f64::consts::TAU * 4.0 * k as f64 / 24_000.0).sin();
        let (found, std) = amplitude(&rows, angle, |k| 3.0 * angle(k).sin() + other(k)).unwrap();
        // White noise of that size would leave 0.007.
        assert!((found - 3.0).abs() < 3.0 * std && (0.05..0.3).contains(&std), "{found} ± {std}");
    }

    #[test]
    fn a_change_counts_beyond_what_laws_hold_to() {
        let of = |amplitudes| WithSpeed { speeds: [1.0, 9.0], amplitudes, stds: [0.1, 0.1] };
        assert!(of([1.0, 4.0]).changes() && of([4.0, 1.0]).changes());
        assert!(of([1.0, 4.0]).grows_by() > NO_GROWTH && of([4.0, 1.0]).grows_by() < 0.0, "fading refuses no encoder");
        assert!(!of([4.0, 5.0]).changes() && !of([0.1, 0.4]).changes());
        assert!(of([1.0, 4.0]).words().contains("grows") && of([4.0, 1.0]).words().contains("fades"));
    }
}
