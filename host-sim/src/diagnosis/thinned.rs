//! A sample of the rows, on which causes are searched for. What a search finds there is settled and judged on all rows.
//!
//! The sample is made of stretches of neighbouring rows, so that tooth mesh, play and ringing are in it as they are in the rows. One
//! stretch is taken out of every few, at a place that no period of the drive follows.

use std::sync::Arc;

use super::averaged::Averaged;
use super::base::{Base, Floating};
use super::candidate::Excitation;
use super::model::Problem;
use super::noise::{Noise, Whitener};
use super::rows::{Rows, parts};

/// Rows of a sample, about.
const ROWS: usize = 10_000;
/// Fewer rows than this many samples are not worth one.
const LEAST_RATIO: usize = 2;
/// Rows of a stretch: about a turn of the generator where a thousand rows make ten.
const STRETCH: usize = 96;
/// The fractional part of the golden ratio: its multiples are spread evenly, whatever their number (Weyl).
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// The sample, with the nominal model over it.
pub struct Thinned {
    rows: Rows,
    base: Base,
    /// Rows taken.
    kept: Vec<usize>,
    /// Share of the rows that the sample is.
    pub share: f64,
}

impl Thinned {
    /// A sample, of which `stride` rows at a time are averaged; none where there are few rows.
    #[must_use]
    pub fn of(on: &Excitation<'_>, stride: usize) -> Option<Thinned> {
        let ratio = on.rows.count_used().div_ceil(ROWS);
        if ratio < LEAST_RATIO {
            return None;
        }
        let (mut kept, mut sessions) = (Vec::new(), Vec::new());
        let mut place = 0.0f64;
        for session in &on.rows.sessions {
            let from = kept.len();
            // Short sessions have a stretch as well.
            let stretch = STRETCH.min(session.len().div_ceil(ratio)).next_multiple_of(stride.max(1));
            for part in parts(session, ratio * stretch) {
                place = (place + GOLDEN).fract();
                let room = part.len().saturating_sub(stretch);
                let begin = part.start + (place * (room + 1) as f64) as usize;
                kept.extend(begin..(begin + stretch).min(part.end));
            }
            sessions.push(from..kept.len());
        }
        let of = |column: &[f64]| -> Vec<f64> { kept.iter().map(|k| column[*k]).collect() };
        let rows = on.rows.each(sessions, of);
        let share = rows.count_used() as f64 / on.rows.count_used() as f64;
        let floating = on.base.floating.iter().map(|f| Floating { values: of(&f.values), ..f.clone() });
        let base = Base {
            floating: floating.collect(),
            uncertain: kept.iter().map(|k| on.base.uncertain[*k]).collect(),
            ..on.base.each(of)
        };
        Some(Thinned { rows, base, kept, share })
    }

    /// The excitation of the sample, with nothing that other causes change.
    #[must_use]
    pub fn excitation<'a>(&'a self, on: &Excitation<'a>) -> Excitation<'a> {
        Excitation { rows: &self.rows, base: &self.base, ..*on }
    }
}

/// The sample as models are fitted to it.
pub struct Sample<'a> {
    on: Excitation<'a>,
    uncertain: Vec<bool>,
    stride: usize,
    averaged: Option<Arc<Averaged>>,
}

impl<'a> Sample<'a> {
    /// The sample where these of all rows are uncertain, averaged as it was made for.
    #[must_use]
    pub fn new(on: &Excitation<'a>, thinned: &'a Thinned, uncertain: &[bool], stride: usize) -> Sample<'a> {
        let on = thinned.excitation(on);
        let averaged = Averaged::of(&on, stride).map(Arc::new);
        Sample { on, uncertain: thinned.kept.iter().map(|k| uncertain[*k]).collect(), stride, averaged }
    }

    /// The sample under this noise.
    #[must_use]
    pub fn problem(&self, noise: Noise, worth: f64) -> Problem<'_> {
        let whitener = Whitener::new(self.on.rows, &self.uncertain, self.stride, noise);
        Problem::new(&self.on, &self.uncertain, whitener, worth, self.averaged.clone())
    }
}
