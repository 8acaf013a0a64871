//! Many variants: those that cover all ranges by contact FEM, and those that nothing beats; the others by a surface through these.
//!
//! 1. Of each generator [`computed_first`] variants are computed: each the one that is furthest from those before it.
//! 2. Of every other variant the drawing is looked at: whether its fields make a drive, and whether its teeth clear. Where the computed variant
//!    nearest to it found no equilibrium it is computed, too. All other figures are estimated ([`Surface`]).
//! 3. What nothing beats and is estimated is computed, and the surfaces are made anew, [`ROUNDS`] times and [`MOST_OF_FRONT`] variants at most.
//! 4. What the surfaces are off by where they leave out a computed variant is told by generator and figure.

use std::collections::BTreeMap;

use serde::Serialize;

use super::surface::Surface;
use super::{Basis, Job, Run, RunStatus, Several, StudyError, Target, judge};
use crate::data_sheet::{DataSheet, FIGURES};
use crate::drive::GeneratorKind;

/// Variants of each generator that are computed first, at least, and for each field and one more. Guesses: 48 with four generators take a
/// minute and a half on two cores.
const COMPUTED: usize = 48;
const COMPUTED_PER_FIELD: usize = 12;
/// Variants of each generator that are computed because nothing beats them, at most. A guess: more than a designer looks at.
const MOST_OF_FRONT: usize = 12;
/// Times that the front is looked at anew: what was computed may fall behind, and others come to the front.
const ROUNDS: usize = 3;
/// Figures that the drawing says, and need no estimate.
const OF_THE_DRAWING: [&str; 2] = ["rigid_gap_um", "room_as_built_arcsec"];

/// Variants of a study of so many fields that are computed first; of no more all are.
pub fn computed_first(fields: usize) -> usize {
    COMPUTED.max(COMPUTED_PER_FIELD * (1 + fields))
}

/// What estimated figures of a generator are off by.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Off {
    /// The generator.
    pub generator: GeneratorKind,
    /// The figure.
    pub figure: &'static str,
    /// Variants that were computed, each left out in turn.
    pub runs: usize,
    /// Root mean square of computed less estimated, in the unit of the figure.
    pub rms: f64,
    /// The largest such difference.
    pub largest: f64,
    /// `rms` over the mean size of the figure, percent.
    pub rms_percent: f64,
}

/// All runs, as many of them computed as matter, and what the estimates are off by.
pub(super) fn some_computed(several: &Several<'_>, jobs: &[Job]) -> Result<(Vec<Run>, Vec<Off>), StudyError> {
    let settings = several.settings;
    let kinds = settings.generators.len();
    let places = places(several.variants);
    let first = computed_first(several.paths.len());
    let expected = jobs.len() + kinds * (first + MOST_OF_FRONT);

    let mut runs = several.run(jobs, expected, Several::drawn)?;
    let covering = furthest_first(&places, first);
    let chosen: Vec<usize> =
        (0..jobs.len()).filter(|k| covering.contains(&jobs[*k].0) && is_estimated(&runs[*k])).collect();
    compute(several, &mut runs, jobs, &chosen, expected)?;
    let doubtful: Vec<usize> = (0..jobs.len())
        .filter(|k| is_estimated(&runs[*k]) && nearest_failed(&runs, jobs, &places, &chosen, *k))
        .collect();
    compute(several, &mut runs, jobs, &doubtful, expected)?;

    let mut spent: BTreeMap<GeneratorKind, usize> = BTreeMap::new();
    let mut off = estimate(several, &mut runs, jobs, &places);
    for _ in 0..ROUNDS {
        judge::judge(&mut runs, &settings.constraints, &settings.targets);
        let on_front = |kind: &GeneratorKind| {
            let front: Vec<usize> = (0..runs.len())
                .filter(|k| runs[*k].generator == *kind && runs[*k].front && is_estimated(&runs[*k]))
                .collect();
            let room = MOST_OF_FRONT - spent.get(kind).copied().unwrap_or(0);
            best_first(&front, &runs, &settings.targets).into_iter().take(room).collect::<Vec<usize>>()
        };
        let next: Vec<usize> = settings.generators.iter().flat_map(on_front).collect();
        if next.is_empty() {
            break;
        }
        next.iter().for_each(|k| *spent.entry(runs[*k].generator).or_default() += 1);
        compute(several, &mut runs, jobs, &next, expected)?;
        off = estimate(several, &mut runs, jobs, &places);
    }
    Ok((runs, off))
}

fn is_estimated(run: &Run) -> bool {
    run.basis == Basis::Estimated
}

fn is_known(run: &Run) -> bool {
    run.basis == Basis::Computed && run.status == RunStatus::Converged
}

/// Where each variant stands: numbers over their range, 0 to 1; of words one coordinate for each of them.
fn places(variants: &[Vec<String>]) -> Vec<Vec<f64>> {
    let mut places = vec![Vec::new(); variants.len()];
    for field in 0..variants[0].len() {
        let column: Vec<&str> = variants.iter().map(|values| values[field].as_str()).collect();
        match column.iter().map(|value| value.parse::<f64>().ok()).collect::<Option<Vec<f64>>>() {
            Some(numbers) => {
                let low = numbers.iter().copied().fold(f64::INFINITY, f64::min);
                let high = numbers.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let range = if high > low { high - low } else { 1.0 };
                places.iter_mut().zip(&numbers).for_each(|(place, number)| place.push((number - low) / range));
            }
            None => {
                let mut words = column.clone();
                words.sort_unstable();
                words.dedup();
                for (place, value) in places.iter_mut().zip(&column) {
                    place.extend(words.iter().map(|word| f64::from(u8::from(word == value))));
                }
            }
        }
    }
    places
}

fn square(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// So many different places, each the one furthest from those before it; the first is the one nearest to the middle of all ranges.
fn furthest_first(places: &[Vec<f64>], count: usize) -> Vec<usize> {
    let middle = vec![0.5; places[0].len()];
    let first = (0..places.len()).min_by(|a, b| square(&places[*a], &middle).total_cmp(&square(&places[*b], &middle)));
    let mut chosen: Vec<usize> = first.into_iter().collect();
    let mut apart = vec![f64::INFINITY; places.len()];
    while chosen.len() < count.min(places.len()) {
        let last = &places[chosen[chosen.len() - 1]];
        apart.iter_mut().zip(places).for_each(|(apart, place)| *apart = apart.min(square(place, last)));
        let next = (0..places.len()).max_by(|a, b| apart[*a].total_cmp(&apart[*b]));
        // What is left stands where others do.
        let Some(next) = next.filter(|next| apart[*next] > 0.0) else { break };
        chosen.push(next);
    }
    chosen
}

/// Whether that of the computed runs of the same generator which is nearest to run `k` found no equilibrium; or none was computed.
fn nearest_failed(runs: &[Run], jobs: &[Job], places: &[Vec<f64>], computed: &[usize], k: usize) -> bool {
    let apart = |other: usize| square(&places[jobs[other].0], &places[jobs[k].0]);
    let same = computed.iter().copied().filter(|other| runs[*other].generator == runs[k].generator);
    let nearest = same.min_by(|a, b| apart(*a).total_cmp(&apart(*b)));
    nearest.is_none_or(|nearest| !is_known(&runs[nearest]))
}

/// Computes these, in their places.
fn compute(
    several: &Several<'_>,
    runs: &mut [Run],
    jobs: &[Job],
    which: &[usize],
    of: usize,
) -> Result<(), StudyError> {
    let again: Vec<Job> = which.iter().map(|k| jobs[*k]).collect();
    for (k, run) in which.iter().zip(several.run(&again, of, Several::computed)?) {
        runs[*k] = run;
    }
    Ok(())
}

/// The best of these in each target, then the second in each, and so on.
fn best_first(all: &[usize], runs: &[Run], targets: &[Target]) -> Vec<usize> {
    let ranked = targets.iter().map(|target| {
        let mut order = all.to_vec();
        order.sort_by(|a, b| target.cost(&runs[*a].sheet).total_cmp(&target.cost(&runs[*b].sheet)));
        order
    });
    let ranked: Vec<Vec<usize>> = ranked.collect();
    let mut found = Vec::new();
    for k in (0..all.len()).flat_map(|place| ranked.iter().map(move |order| order[place])) {
        if !found.contains(&k) {
            found.push(k);
        }
    }
    found
}

/// Fills in what is estimated; what that is off by.
fn estimate(several: &Several<'_>, runs: &mut [Run], jobs: &[Job], places: &[Vec<f64>]) -> Vec<Off> {
    let mut off = Vec::new();
    for kind in &several.settings.generators {
        let known: Vec<usize> =
            (0..runs.len()).filter(|k| runs[*k].generator == *kind && is_known(&runs[*k])).collect();
        let surfaces = FIGURES.map(|(name, of)| {
            let points = |k: &usize| Some((places[jobs[*k].0].clone(), of(&runs[*k].sheet)?));
            let (points, values): (Vec<Vec<f64>>, Vec<f64>) = known.iter().filter_map(points).unzip();
            let surface = Surface::through(points, &values).filter(|_| !OF_THE_DRAWING.contains(&name))?;
            off.push(told(*kind, name, &values, &surface.left_out));
            Some(surface)
        });
        let estimated = |run: &Run| run.generator == *kind && is_estimated(run);
        for (run, (variant, _)) in runs.iter_mut().zip(jobs).filter(|(run, _)| estimated(run)) {
            let drawn = run.sheet;
            let figure = |f: usize| match &surfaces[f] {
                Some(surface) => Some(surface.at(&places[*variant])),
                None => FIGURES[f].1(&drawn).filter(|_| OF_THE_DRAWING.contains(&FIGURES[f].0)),
            };
            run.sheet = DataSheet::of_figures(std::array::from_fn(figure));
            run.cautions = run.sheet.looked().cautions();
        }
    }
    off
}

fn told(generator: GeneratorKind, figure: &'static str, values: &[f64], left_out: &[f64]) -> Off {
    let count = values.len() as f64;
    let rms = (left_out.iter().map(|x| x * x).sum::<f64>() / count).sqrt();
    let size = values.iter().map(|value| value.abs()).sum::<f64>() / count;
    Off {
        generator,
        figure,
        runs: values.len(),
        rms,
        largest: left_out.iter().fold(0.0, |most: f64, x| if x.abs() > most.abs() { *x } else { most }),
        rms_percent: if size > 0.0 { 100.0 * rms / size } else { 0.0 },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::Sense;
    use crate::study::tests::made_up;

    /// A grid's corners come before what lies between them, and every place comes once.
    #[test]
    fn what_is_furthest_covers_the_ranges() {
        let values: Vec<Vec<String>> =
            (0..81).map(|k| vec![(10 + k / 9).to_string(), format!("{}", 0.1 * f64::from(k % 9))]).collect();
        let places = places(&values);
        assert!(places[0] == [0.0, 0.0] && places[80] == [1.0, 1.0]);
        let chosen = furthest_first(&places, 9);
        assert_eq!(places[chosen[0]], [0.5, 0.5]);
        let mut corners = chosen[1..5].to_vec();
        corners.sort_unstable();
        assert_eq!(corners, [0, 8, 72, 80]);
        let mut all = furthest_first(&places, 100);
        all.sort_unstable();
        assert_eq!(all, (0..81).collect::<Vec<_>>());
    }

    #[test]
    fn words_stand_apart_from_one_another() {
        let values: Vec<Vec<String>> = ["cup", "hat", "cup"].iter().map(|word| vec![(*word).to_owned()]).collect();
        assert_eq!(places(&values), [[1.0, 0.0], [0.0, 1.0], [1.0, 0.0]]);
    }

    #[test]
    fn beside_a_variant_that_failed_nothing_is_estimated() {
        let places = [0.0, 0.1, 0.9, 1.0].map(|x| vec![x]);
        let jobs: Vec<Job> = (0..4).map(|k| (k, GeneratorKind::Cam)).collect();
        let mut runs: Vec<Run> = (0..4).map(|k| made_up(k, 0.0, 1.0, 1.0)).collect();
        runs[3].status = RunStatus::Failed;
        let failed = |k: usize| nearest_failed(&runs, &jobs, &places, &[0, 3], k);
        assert!(!failed(1) && failed(2));
        assert!(nearest_failed(&runs, &jobs, &places, &[], 1));
    }

    #[test]
    fn the_best_in_each_target_comes_before_the_second_in_any() {
        let runs: Vec<Run> = [(1.0, 400.0), (2.0, 300.0), (3.0, 200.0), (4.0, 100.0)]
            .map(|(error, stress)| made_up(1, 0.0, error, stress))
            .to_vec();
        let targets =
            ["kinematic_error_pp_arcsec", "max_von_mises_mpa"].map(|name| Target::new(name, Sense::Least).unwrap());
        assert_eq!(best_first(&[0, 1, 2, 3], &runs, &targets), [0, 3, 1, 2]);
        assert_eq!(best_first(&[2, 1], &runs, &targets), [1, 2]);
    }

    #[test]
    fn what_is_left_out_is_told_by_its_root_mean_square_and_its_largest() {
        let off = told(GeneratorKind::Cam, "backlash_arcsec", &[10.0, 20.0, -30.0], &[1.0, -2.0, 2.0]);
        assert_eq!((off.runs, off.rms, off.largest), (3, 3.0f64.sqrt(), -2.0));
        assert!((off.rms_percent - 100.0 * 3f64.sqrt() / 20.0).abs() < 1e-12);
    }
}
