//! Noise of the measurement: white, plus a slow wander (an Ornstein-Uhlenbeck process), and columns made white under
//! it.
//!
//! Neighbouring rows of a wandering measurement do not count as two. A Kalman filter of the wander turns the data, and
//! every column alike, into innovations of unit variance; least squares on those is generalised least squares on the
//! rows, and forty thousand correlated rows weigh what they are worth (n_eff).

use super::rows::{Rows, mean, parts, quantile, rms, robust_std};

/// White noise and wander.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// White, one standard deviation of a row, arcsec.
    pub white: f64,
    /// Wander, one standard deviation, arcsec.
    pub wander: f64,
    /// Correlation time of the wander, s.
    pub correlation_s: f64,
}

impl Noise {
    /// Both together, one standard deviation, arcsec.
    pub(crate) fn floor(&self) -> f64 {
        self.white.hypot(self.wander)
    }
}

/// Neighbouring rows averaged to one, and the averages made white.
#[derive(Clone, Debug)]
pub(crate) struct Whitener {
    /// Averages: rows of each, none across sessions.
    pub groups: Vec<std::ops::Range<usize>>,
    /// Rows to an average; fewer at the end of a session.
    pub stride: usize,
    /// Averages of each session.
    pub sessions: Vec<std::ops::Range<usize>>,
    /// The filter at each average.
    filter: Vec<FilterStep>,
}

/// One step of the filter: what is expected next is `keep` of what was expected now and `take` of what came.
#[derive(Clone, Copy, Debug)]
struct FilterStep {
    keep: f64,
    take: f64,
    /// Inverse standard deviation of the innovation.
    weight: f64,
    /// Share of what came that is white.
    white: f64,
}

/// Columns that are whitened together. *Guess*: eight double values fill the widest vector registers (512 bits).
const ABREAST: usize = 8;
/// Averages hide a column if they hold less than this share of it. *Guess*: averages over a fifth of a period hold
/// 0.94, over 0.36 of one 0.8.
const HIDDEN: f64 = 0.8;
/// White noise of a row whose flank is uncertain, in units of that of other rows. *Guess*: such a row then weighs a
/// millionth.
const UNCERTAIN_NOISE: f64 = 1e3;

impl Whitener {
    /// Averages of `stride` rows under `noise`; rows marked uncertain count next to nothing.
    pub fn new(rows: &Rows, uncertain: &[bool], stride: usize, noise: Noise) -> Whitener {
        let (mut groups, mut sessions) = (Vec::new(), Vec::new());
        for session in rows.sessions_used() {
            let from = groups.len();
            groups.extend(parts(&session, stride));
            sessions.push(from..groups.len());
        }
        let mut filter = Vec::with_capacity(groups.len());
        let power = noise.wander * noise.wander;
        for session in &sessions {
            let mut variance = power;
            for g in session.clone() {
                let rows_in = &groups[g];
                let doubtful = uncertain[rows_in.clone()].iter().any(|u| *u);
                let white = noise.white.max(1e-9) * if doubtful { UNCERTAIN_NOISE } else { 1.0 };
                let loud = if rows.jitters { rms(&rows.loudness[rows_in.clone()]) } else { 1.0 };
                let white = (white * loud).powi(2) / rows_in.len() as f64;
                let innovation = variance + white;
                let (gain, mut decay) = (variance / innovation, 0.0);
                let after = variance * (1.0 - gain);
                if g + 1 < session.end {
                    let dt = rows.time[groups[g + 1].start] - rows.time[rows_in.start];
                    decay = (-dt / noise.correlation_s).exp();
                    variance = decay * decay * after + power * (1.0 - decay * decay);
                }
                let (keep, take, weight) = (decay * (1.0 - gain), decay * gain, 1.0 / innovation.sqrt());
                filter.push(FilterStep { keep, take, weight, white: 1.0 - gain });
            }
        }
        Whitener { groups, stride: stride.max(1), sessions, filter }
    }

    /// Averages of `stride` rows under noise that is white alone, `white` arcsec in a row.
    pub fn plain(rows: &Rows, uncertain: &[bool], stride: usize, white: f64) -> Whitener {
        Whitener::new(rows, uncertain, stride, Noise { white, wander: 0.0, correlation_s: 1.0 })
    }

    /// Blocks that are left out one at a time: sessions, or quarters of the data where there are fewer than three.
    pub(crate) fn blocks(&self) -> Vec<std::ops::Range<usize>> {
        let sessions = &self.sessions;
        if sessions.len() >= 3 {
            return sessions.clone();
        }
        sessions
            .iter()
            .flat_map(|s| {
                let parts = 4;
                let len = s.len();
                (0..parts).map(move |p| s.start + len * p / parts..s.start + len * (p + 1) / parts)
            })
            .filter(|b| !b.is_empty())
            .collect()
    }

    /// Averages of a column.
    pub(crate) fn average(&self, column: &[f64]) -> Vec<f64> {
        let mut means = Vec::with_capacity(self.groups.len());
        for session in self.sessions.iter().filter(|session| !session.is_empty()) {
            let rows = &column[self.groups[session.start].start..self.groups[session.end - 1].end];
            means.extend(rows.chunks(self.stride).map(mean));
        }
        means
    }

    /// Whether averages take most of a column away.
    pub(crate) fn hides(&self, column: &[f64]) -> bool {
        rms(&self.average(column)) < HIDDEN * rms(column)
    }

    /// Averages that no uncertain row is part of.
    pub(crate) fn certain(&self, uncertain: &[bool]) -> Vec<bool> {
        self.groups.iter().map(|g| !uncertain[g.clone()].iter().any(|u| *u)).collect()
    }

    /// Values of averages back in the rows they are made of; 0 in rows of none.
    pub(crate) fn in_rows(&self, averaged: &[f64], rows: usize) -> Vec<f64> {
        let mut values = vec![0.0; rows];
        for (group, value) in self.groups.iter().zip(averaged) {
            values[group.clone()].fill(*value);
        }
        values
    }

    /// Innovations of averaged values, in units of their standard deviation.
    pub(crate) fn whiten_averaged(&self, averaged: &[f64]) -> Vec<f64> {
        self.whiten_abreast(&[averaged]).pop().unwrap_or_default()
    }

    /// Innovations of several columns of averaged values. Each value waits for the one before it, so columns go side by
    /// side.
    pub(crate) fn whiten_each(&self, averaged: &[Vec<f64>]) -> Vec<Vec<f64>> {
        averaged.chunks(ABREAST).flat_map(|columns| self.whiten_abreast(columns)).collect()
    }

    fn whiten_abreast(&self, averaged: &[impl AsRef<[f64]>]) -> Vec<Vec<f64>> {
        let count = self.filter.len();
        // Fewer than there are places: the first one stands in, and is dropped.
        let from: [&[f64]; ABREAST] =
            std::array::from_fn(|j| &averaged.get(j).unwrap_or(&averaged[0]).as_ref()[..count]);
        let mut white: [Vec<f64>; ABREAST] =
            std::array::from_fn(|j| if j < averaged.len() { vec![0.0; count] } else { Vec::new() });
        // Each session begins anew: nothing is kept past its last average.
        let mut expected = [0.0; ABREAST];
        for (g, step) in self.filter.iter().enumerate() {
            for j in 0..ABREAST {
                let value = from[j][g];
                if let Some(white) = white[j].get_mut(g) {
                    *white = (value - expected[j]) * step.weight;
                }
                expected[j] = step.keep * expected[j] + step.take * value;
            }
        }
        white.into_iter().take(averaged.len()).collect()
    }

    /// The filter's estimate of the wander in averaged values.
    pub(crate) fn followed(&self, averaged: &[f64]) -> Vec<f64> {
        let white = self.whiten_averaged(averaged).into_iter().zip(&self.filter);
        averaged.iter().zip(white).map(|(value, (white, step))| value - step.white * white / step.weight).collect()
    }

    /// Sum of the logarithms of the innovations' standard deviations.
    pub(crate) fn log_scale(&self) -> f64 {
        -self.filter.iter().map(|step| step.weight.ln()).sum::<f64>()
    }
}

/// White noise of rows, arcsec: from second differences, which no slow process and no smooth model reaches.
pub(crate) fn white_level(rows: &Rows, left: &[f64]) -> f64 {
    let mut differences = Vec::with_capacity(left.len());
    for session in rows.sessions_used() {
        for k in session.start + 2..session.end {
            let loud = |k: usize| rows.loudness[k] * rows.loudness[k];
            let louder = if rows.jitters { ((loud(k) + 4.0 * loud(k - 1) + loud(k - 2)) / 6.0).sqrt() } else { 1.0 };
            differences.push((left[k] - 2.0 * left[k - 1] + left[k - 2]).abs() / louder);
        }
    }
    // Their variance is six times that of a row; more where a line close to half the rate of rows swings them, but no
    // more than is there.
    let middle = quantile(rows.sessions_used().flatten().map(|k| left[k]), 0.5);
    let there = robust_std(rows.sessions_used().flatten().map(|k| left[k] - middle));
    // Rows that a coarse resolution rounds to the same value differ by nothing, and are off all the same.
    (robust_std(differences.into_iter()) / 6f64.sqrt()).min(there).max(rows.rounding).max(1e-3)
}
