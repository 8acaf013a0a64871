//! Which parts a unit has, and how smooth they are: by what fits leave in folds that they did not see.

use super::folds::{Chosen, Folds};
use super::parts::PartName;

/// Penalties that are tried, of a column's mean square. Below the least of them a curve is free to run away where
/// nothing was recorded: with a tenth of it the first eighth of the record of `examples/lara8` is missed by 120
/// arc-seconds by the others, with it by 25.
pub(super) const PENALTIES: [f64; 4] = [1e-4, 1e-3, 1e-2, 1e-1];
/// A part is kept if it takes at least this share of the squares left without it: one per cent of the error. Chosen on
/// the two records of `examples/`.
pub(crate) const LEAST_GAIN: f64 = 0.02;

/// Parts chosen one after another, the best first, as long as each gains: none, the first, the first two, and so on.
pub(super) fn path(folds: &Folds, of: &[usize]) -> Vec<Vec<Chosen>> {
    let mut all = vec![Vec::new()];
    let mut chosen: Vec<Chosen> = Vec::new();
    let mut left = folds.left_out(of, &chosen);
    loop {
        let open = folds.parts.iter().filter(|part| chosen.iter().all(|chosen| chosen.part != **part));
        let tried = open.map(|part| best_penalty(folds, of, &chosen, *part));
        let best = tried.min_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, with)| *with <= left * (1.0 - LEAST_GAIN));
        let Some((best, _)) = best else { return all };
        chosen.push(best);
        left = tuned(folds, of, &mut chosen);
        all.push(chosen.clone());
    }
}

/// A further part with the penalty that leaves least.
pub(super) fn best_penalty(folds: &Folds, of: &[usize], chosen: &[Chosen], part: PartName) -> (Chosen, f64) {
    let with = |penalty: f64| {
        let further = Chosen { part, penalty };
        (further, folds.left_out(of, &[chosen, &[further]].concat()))
    };
    let tried = PENALTIES.into_iter().map(with);
    tried.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((Chosen { part, penalty: 0.0 }, f64::INFINITY))
}

/// Sets each penalty anew beside the others; gives what is left.
fn tuned(folds: &Folds, of: &[usize], chosen: &mut [Chosen]) -> f64 {
    let mut left = folds.left_out(of, chosen);
    for place in 0..chosen.len() {
        let others: Vec<Chosen> = (0..chosen.len()).filter(|k| *k != place).map(|k| chosen[k]).collect();
        (chosen[place], left) = best_penalty(folds, of, &others, chosen[place].part);
    }
    left
}

/// Squares that the choice and the fit, both made without a fold, leave in that fold, summed over all folds, arcsec²:
/// with no part at most, with one, and so on.
pub(super) fn nested(folds: &Folds) -> Vec<f64> {
    let all = folds.all();
    let mut left = vec![0.0; folds.parts.len() + 1];
    for fold in &all {
        let others: Vec<usize> = all.iter().copied().filter(|other| other != fold).collect();
        let path = path(folds, &others);
        let mut last = 0.0;
        for (most, left) in left.iter_mut().enumerate() {
            if let Some(chosen) = path.get(most) {
                last = folds.left_in(*fold, &others, chosen);
            }
            *left += last;
        }
    }
    left
}
