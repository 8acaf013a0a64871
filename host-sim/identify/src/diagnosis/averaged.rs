//! Rows averaged before laws are evaluated on them. A law that changes little from one row to the next says the same of
//! an average as the average of what it says of the rows, and is evaluated on a third or a tenth of them.

use std::ops::Range;

use super::base::Base;
use super::candidate::Excitation;
use super::noise::Whitener;
use super::rows::{Rows, mean, parts, quantile};

/// Highest order per generator turn of a column that smooth models have. *Guess*: eccentric wheels have columns up to
/// the sixth order; what is higher is small.
const HIGHEST_ORDER: f64 = 6.0;
/// A wave that turns by this much of its period (rad) within an average loses 2 % of its amplitude. *Source*: derived,
/// sin(x/2) / (x/2); that 2 % do no harm is a guess.
const MOST_TURNED_RAD: f64 = 0.7;
/// Share of the averages in which the generator turns no farther than that. *Guess*: one fast average in fifty moves no
/// fit.
const SLOW_SHARE: f64 = 0.98;

/// Averages of n neighbouring rows, with the nominal model over them.
#[derive(Clone, Debug)]
pub(crate) struct Averaged {
    rows: Rows,
    base: Base,
    /// Rows to an average.
    pub stride: usize,
    /// Rows in each average.
    counts: Vec<f64>,
    /// First row of each average.
    firsts: Vec<usize>,
}

impl Averaged {
    /// Averages of `stride` rows, none across sessions; nothing where rows are taken one by one, or move too far within
    /// an average.
    #[must_use]
    pub fn of(on: &Excitation<'_>, stride: usize) -> Option<Averaged> {
        if stride < 2 {
            return None;
        }
        let from = on.rows;
        let (mut groups, mut sessions) = (Vec::new(), Vec::new());
        for session in &from.sessions {
            let first = groups.len();
            groups.extend(parts(session, stride));
            sessions.push(first..groups.len());
        }
        let turned = groups.iter().map(|g| (from.generator[g.end - 1] - from.generator[g.start]).abs());
        if HIGHEST_ORDER * quantile(turned, SLOW_SHARE) > MOST_TURNED_RAD {
            return None;
        }
        let mean = |column: &[f64]| -> Vec<f64> { groups.iter().map(|group| mean(&column[group.clone()])).collect() };
        let rows = Rows { period: from.period * stride as f64, ..from.each(sessions, mean) };
        let base = on.base.each(mean);
        let counts = groups.iter().map(|group| group.len() as f64).collect();
        let firsts = groups.iter().map(|group| group.start).collect();
        Some(Averaged { rows, base, stride, counts, firsts })
    }

    /// The averages that each group of rows consists of. Groups hold whole averages.
    #[must_use]
    pub(crate) fn in_groups(&self, groups: &[Range<usize>]) -> Vec<Range<usize>> {
        let from = |row: usize| self.firsts.partition_point(|first| *first < row);
        groups.iter().map(|group| from(group.start)..from(group.end)).collect()
    }

    /// Means of a column of averages over groups of them.
    #[must_use]
    pub(crate) fn means(&self, column: &[f64], groups: &[Range<usize>]) -> Vec<f64> {
        let of = |group: &Range<usize>| {
            if group.len() == 1 {
                return column[group.start];
            }
            let (values, counts) = (&column[group.clone()], &self.counts[group.clone()]);
            values.iter().zip(counts).map(|(v, n)| v * n).sum::<f64>() / counts.iter().sum::<f64>()
        };
        groups.iter().map(of).collect()
    }
}

/// What laws are evaluated on: smooth ones on averages, if there are any, all others on rows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Grain {
    /// The averages, and those that each group of the whitener consists of.
    averaged: Option<(Averaged, Vec<Range<usize>>)>,
}

impl Grain {
    /// Smooth laws are evaluated on `averaged`, if there is any.
    #[must_use]
    pub fn new(averaged: Option<Averaged>, whitener: &Whitener) -> Grain {
        let with_groups = |averaged: Averaged| {
            let groups = averaged.in_groups(&whitener.groups);
            (averaged, groups)
        };
        Grain { averaged: averaged.map(with_groups) }
    }

    /// What a law is evaluated on.
    #[must_use]
    pub(crate) fn excitation<'a>(&'a self, smooth: bool, on: &Excitation<'a>) -> Excitation<'a> {
        match &self.averaged {
            Some((averaged, _)) if smooth => on.over(&averaged.rows, &averaged.base),
            _ => *on,
        }
    }

    /// A column of a law, evaluated on what [`Grain::excitation`] gives, averaged over the groups of the whitener.
    #[must_use]
    pub(crate) fn average(&self, smooth: bool, whitener: &Whitener, column: &[f64]) -> Vec<f64> {
        match &self.averaged {
            Some((averaged, groups)) if smooth => averaged.means(column, groups),
            _ => whitener.average(column),
        }
    }
}
