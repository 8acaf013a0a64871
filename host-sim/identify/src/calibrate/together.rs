//! Whether several logs are of one unit, read in one way.

use super::choose::PENALTIES;
use super::folds::{Chosen, Folds, Row};
use super::parts::{PartName, Scales};
use super::rows::Rows;
use crate::measurement::Recording;

/// Logs do not agree if fits to each alone leave less than this share of what one fit to all leaves, rms. A guess.
const ALONE: f64 = 0.3;

/// What fits of all parts leave in several logs, arcsec rms, the zero of the output free in each.
pub(super) struct Agreement {
    /// Each log with a fit of its own.
    alone_arcsec: f64,
    /// All with one.
    together_arcsec: f64,
    /// Without this log the others agree.
    odd: Option<usize>,
}

impl Agreement {
    /// Of two and more logs.
    pub fn of(rows: &Rows, parts: &[PartName], scales: &Scales) -> Option<Agreement> {
        let by_log: Vec<Row> = rows.rows.iter().map(|row| Row { fold: row.zero, ..*row }).collect();
        let folds = Folds::new(&by_log, parts, scales, rows.means_arcsec.len(), true);
        let all = folds.all();
        let chosen: Vec<Chosen> = parts.iter().map(|part| Chosen { part: *part, penalty: PENALTIES[0] }).collect();
        let rms = |of: &[usize], squares: f64| (squares / folds.rows(of)).sqrt();
        let alone = |of: &[usize]| rms(of, of.iter().map(|log| folds.left_in(*log, &[*log], &chosen)).sum());
        let together = |of: &[usize]| rms(of, of.iter().map(|log| folds.left_in(*log, of, &chosen)).sum());
        if all.len() < 2 {
            return None;
        }
        let mut found = Agreement { alone_arcsec: alone(&all), together_arcsec: together(&all), odd: None };
        if !found.agree() && all.len() > 2 {
            let others = |odd: usize| all.iter().copied().filter(|log| *log != odd).collect::<Vec<_>>();
            found.odd = all
                .iter()
                .map(|odd| (*odd, others(*odd)))
                .filter(|(_, others)| alone(others) >= ALONE * together(others))
                .min_by(|(_, a), (_, b)| together(a).total_cmp(&together(b)))
                .map(|(odd, _)| odd);
        }
        Some(found)
    }

    fn agree(&self) -> bool {
        self.alone_arcsec >= ALONE * self.together_arcsec
    }

    /// What is said where they do not.
    pub fn note(&self, files: &[Recording]) -> Option<String> {
        let odd = self.odd.and_then(|odd| files.get(odd));
        let odd = odd.map_or_else(String::new, |odd| format!(" in {}, without which the others agree", odd.file));
        (!self.agree()).then(|| {
            format!(
                "the logs do not agree: each alone is fitted to {:.2} arcsec rms, all together to {:.2}; another zero \
                 of the generator, or another unit or sign of a column{odd}? Home the encoders in the same place \
                 before each log, see `flexspline look`, or give one log alone",
                self.alone_arcsec, self.together_arcsec
            )
        })
    }
}
