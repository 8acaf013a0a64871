//! A sample of the rows, on which causes are searched for. What a search finds there is settled and judged on all rows.
//!
//! The sample is made of stretches of neighbouring rows, so that tooth mesh, play and ringing are in it as they are in
//! the rows. One stretch is taken out of every few, at a place that no period of the drive follows.

use super::Fineness;
use super::base::{Base, Floating};
use super::candidate::Excitation;
use super::model::Problem;
use super::rows::{Rows, parts};

/// Rows of a sample, about. *Guess*: enough for three causes with some dozen columns.
const ROWS: usize = 10_000;
/// A sample is taken where rows over [`ROWS`], rounded up, come to this at least. *Guess*: fewer rows need no sample.
const LEAST_RATIO: usize = 2;
/// Rows of a stretch: about a turn of the generator where a thousand rows make ten. *Guess*.
const STRETCH: usize = 96;
/// Fractional part of the golden ratio, (√5 − 1) / 2 by definition: its multiples are spread evenly, whatever their
/// number (Weyl).
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// The sample, with the nominal model over it.
pub(crate) struct Thinned {
    pub rows: Rows,
    pub base: Base,
    /// Rows taken.
    kept: Vec<usize>,
    /// Share of the rows that the sample is.
    pub share: f64,
}

impl Thinned {
    /// A sample, of which `stride` rows at a time are averaged; none where there are few rows.
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

    /// The sample as models are fitted to it, where these of all rows are uncertain.
    pub fn problem<'a>(&'a self, on: &Excitation<'a>, uncertain: &[bool], fineness: Fineness) -> Problem<'a> {
        let uncertain: Vec<bool> = self.kept.iter().map(|k| uncertain[*k]).collect();
        Problem::new(on.over(&self.rows, &self.base), &uncertain, fineness)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnosis::LawUnits;
    use crate::measurement::Session;
    use crate::synthesize::catalogue_drive;

    fn turning(rows: usize) -> Session {
        Session {
            line: (0..rows as u64).collect(),
            time_s: Some((0..rows).map(|k| 0.01 * k as f64).collect()),
            generator_rad: (0..rows).map(|k| 0.07 * k as f64).collect(),
            error_rad: (0..rows).map(|k| 1e-6 * (k % 17) as f64).collect(),
            ..Session::default()
        }
    }

    fn sampled(sessions: &[Session], stride: usize, look: impl FnOnce(&Rows, Option<Thinned>)) {
        let nominal = catalogue_drive();
        let rows = Rows::new(sessions, &nominal);
        let base = Base::new(&rows, &nominal, None);
        let scales = LawUnits::new(&rows, 48.7, Vec::new());
        let on = Excitation::new(&rows, &nominal, &base, &scales);
        look(&rows, Thinned::of(&on, stride));
    }

    #[test]
    fn a_sample_is_whole_averages_of_neighbouring_rows_from_all_over_every_session() {
        let stride = 5;
        sampled(&[turning(30_000), turning(900), turning(12_345)], stride, |rows, thinned| {
            let thinned = thinned.unwrap();
            assert!((0.2..0.3).contains(&thinned.share), "{}", thinned.share);
            for (session, of) in thinned.rows.sessions.iter().zip(&rows.sessions) {
                let share = session.len() as f64 / of.len() as f64;
                assert!((0.15..0.35).contains(&share), "{share} of {of:?}");
                for part in parts(session, stride) {
                    let kept = &thinned.kept[part];
                    assert!(kept.windows(2).all(|pair| pair[1] == pair[0] + 1) && of.contains(&kept[0]), "{kept:?}");
                }
            }
            for (k, row) in thinned.kept.iter().enumerate() {
                assert_eq!(thinned.rows.generator[k], rows.generator[*row]);
                assert_eq!(thinned.rows.travel[k], rows.travel[*row]);
            }
            // No phase of the generator is left out: 16 parts of a turn have about as many rows.
            let mut of_part = [0usize; 16];
            for psi in &thinned.rows.generator {
                of_part[(psi.rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU * 16.0) as usize % 16] += 1;
            }
            let usual = thinned.kept.len() / 16;
            assert!(of_part.iter().all(|n| (usual / 2..2 * usual).contains(n)), "{of_part:?}");
        });
    }

    #[test]
    fn few_rows_are_all_searched() {
        sampled(&[turning(9_000)], 1, |_, thinned| assert!(thinned.is_none()));
    }
}
