//! Many variants: those that cover all ranges by contact FEM, and those that nothing beats; the others by a surface
//! through these.
//!
//! 1. Of each generator [`computed_first`] variants are computed: each the one that is furthest from those before it.
//! 2. Of every other variant the drawing is looked at: whether its fields make a drive, and whether its teeth clear.
//!    Where the computed variant nearest to it found no equilibrium it is computed, too. All other figures are
//!    estimated ([`Surface`]).
//! 3. What nothing beats and is estimated is computed, and the surfaces are made anew, [`ROUNDS`] times and
//!    [`MOST_OF_FRONT`] variants at most.
//! 4. What the surfaces are off by where they leave out a computed variant is told by generator and figure.
//!
//! A surface goes through [`MOST_POINTS`] computed variants at most: of more, those that cover best where the computed
//! ones stand.

use std::collections::BTreeMap;

use super::surface::Surface;
use super::trust::Trust;
use super::{Basis, Job, RunStatus, StudyError, StudyRun, StudySettings, StudyTarget, is_error_of_making, judge};
use crate::data_sheet::{DataSheet, FIGURES};
use flexspline_mechanics::drive::GeneratorKind;

/// Variants of each generator that are computed first, at least, and for each field and one more. Guesses. With these a
/// study of 200 variants of two fields and four generators computes 227 of 800 runs (docs/reference/commands.md, "200
/// variants"); each takes 0.3 to 0.8 s of processor.
const COMPUTED: usize = 48;
const COMPUTED_PER_FIELD: usize = 12;
/// Variants of each generator that are computed because nothing beats them, at most. A guess: more than a designer
/// looks at.
const MOST_OF_FRONT: usize = 12;
/// Times that the front is looked at anew: what was computed may fall behind, and others come to the front.
const ROUNDS: usize = 3;
/// Computed variants that a surface goes through, at most. More are computed where many found no equilibrium, and the
/// time of a surface grows with the cube of their number: of eight coordinates 0.16 s with 160 points, 1.9 s with 400,
/// and there is one for each figure, generator and round. A study of twelve fields computes 156 first.
const MOST_POINTS: usize = 160;
/// Figures that the drawing says, and need no estimate.
const OF_THE_DRAWING: [&str; 2] = ["rigid_gap_um", "room_as_built_arcsec"];

/// Variants of a study of so many fields that are computed first; of no more all are.
pub(crate) fn computed_first(fields: usize) -> usize {
    COMPUTED.max(COMPUTED_PER_FIELD * (1 + fields))
}

/// Makes these runs, in their order, by contact FEM or by the drawing alone; it is told how many there will be in all,
/// about.
pub(super) type Make<'a> = dyn Fn(&[Job], usize, Basis) -> Result<Vec<StudyRun>, StudyError> + 'a;

/// All runs, in the order of `jobs`, as many of them computed as matter, and what the estimates are off by.
pub(super) fn some_computed(
    settings: &StudySettings,
    variants: &[Vec<String>],
    jobs: &[Job],
    make: &Make<'_>,
) -> Result<(Vec<StudyRun>, Vec<Trust>), StudyError> {
    let StudySettings { generators, targets, .. } = settings;
    let places = places(variants);
    let errors: Vec<usize> = (0..settings.vary.len()).filter(|k| is_error_of_making(&settings.vary[*k].path)).collect();
    let first = computed_first(settings.vary.len());
    let expected = jobs.len() + generators.len() * (first + MOST_OF_FRONT);
    // Computes these, in their places.
    let compute = |runs: &mut [StudyRun], which: &[usize]| -> Result<(), StudyError> {
        let again: Vec<Job> = which.iter().map(|k| jobs[*k]).collect();
        let made = make(&again, expected, Basis::Computed)?;
        which.iter().zip(made).for_each(|(k, run)| runs[*k] = run);
        Ok(())
    };

    let mut runs = make(jobs, expected, Basis::Estimated)?;
    let covering = furthest_first(&places, first);
    let chosen: Vec<usize> =
        (0..jobs.len()).filter(|k| covering.contains(&jobs[*k].0) && is_estimated(&runs[*k])).collect();
    compute(&mut runs, &chosen)?;
    let doubtful: Vec<usize> = (0..jobs.len())
        .filter(|k| is_estimated(&runs[*k]) && nearest_failed(&runs, jobs, &places, &chosen, *k))
        .collect();
    compute(&mut runs, &doubtful)?;

    let mut spent: BTreeMap<GeneratorKind, usize> = BTreeMap::new();
    let mut trust = estimate(generators, &mut runs, jobs, &places);
    for _ in 0..ROUNDS {
        judge::judge(&mut runs, &settings.constraints, targets, &errors);
        let on_front = |kind: &GeneratorKind| {
            let front: Vec<usize> = (0..runs.len())
                .filter(|k| runs[*k].generator == *kind && runs[*k].front && is_estimated(&runs[*k]))
                .collect();
            let room = MOST_OF_FRONT - spent.get(kind).copied().unwrap_or(0);
            best_first(&front, &runs, targets).into_iter().take(room).collect::<Vec<usize>>()
        };
        let next: Vec<usize> = generators.iter().flat_map(on_front).collect();
        if next.is_empty() {
            break;
        }
        next.iter().for_each(|k| *spent.entry(runs[*k].generator).or_default() += 1);
        compute(&mut runs, &next)?;
        trust = estimate(generators, &mut runs, jobs, &places);
    }
    Ok((runs, trust))
}

fn is_estimated(run: &StudyRun) -> bool {
    run.basis == Basis::Estimated
}

fn is_known(run: &StudyRun) -> bool {
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

/// So many different places, each the one furthest from those before it; the first is the one nearest to the middle of
/// all ranges.
pub(super) fn furthest_first(places: &[Vec<f64>], count: usize) -> Vec<usize> {
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

/// Whether that of the computed runs of the same generator which is nearest to run `k` found no equilibrium; or none
/// was computed.
fn nearest_failed(runs: &[StudyRun], jobs: &[Job], places: &[Vec<f64>], computed: &[usize], k: usize) -> bool {
    let apart = |other: usize| square(&places[jobs[other].0], &places[jobs[k].0]);
    let same = computed.iter().copied().filter(|other| runs[*other].generator == runs[k].generator);
    let nearest = same.min_by(|a, b| apart(*a).total_cmp(&apart(*b)));
    nearest.is_none_or(|nearest| !is_known(&runs[nearest]))
}

/// The best of these in each target, then the second in each, and so on.
fn best_first(all: &[usize], runs: &[StudyRun], targets: &[StudyTarget]) -> Vec<usize> {
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

/// Of these runs, as many as a surface goes through: where there are too many, those that cover best where they all
/// stand.
fn thinned(known: Vec<usize>, jobs: &[Job], places: &[Vec<f64>]) -> Vec<usize> {
    if known.len() <= MOST_POINTS {
        return known;
    }
    let stand: Vec<Vec<f64>> = known.iter().map(|k| places[jobs[*k].0].clone()).collect();
    furthest_first(&stand, MOST_POINTS).into_iter().map(|chosen| known[chosen]).collect()
}

/// Fills in what is estimated; what that is off by.
fn estimate(generators: &[GeneratorKind], runs: &mut [StudyRun], jobs: &[Job], places: &[Vec<f64>]) -> Vec<Trust> {
    let mut trust = Vec::new();
    for kind in generators {
        let known = (0..runs.len()).filter(|k| runs[*k].generator == *kind && is_known(&runs[*k])).collect();
        let known = thinned(known, jobs, places);
        let surfaces = FIGURES.map(|(name, of)| {
            if OF_THE_DRAWING.contains(&name) {
                return None;
            }
            let points = |k: &usize| Some((places[jobs[*k].0].clone(), of(&runs[*k].sheet)?));
            let (points, values): (Vec<Vec<f64>>, Vec<f64>) = known.iter().filter_map(points).unzip();
            let surface = Surface::through(points, &values)?;
            trust.push(Trust::new(*kind, name, &values, &surface.left_out));
            Some(surface)
        });
        let estimated = |run: &StudyRun| run.generator == *kind && is_estimated(run);
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
    trust
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    use crate::study::Sense;
    use crate::study::tests::{made_up, settings};

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
        let mut runs: Vec<StudyRun> = (0..4).map(|k| made_up(k, 0.0, 1.0, 1.0)).collect();
        runs[3].status = RunStatus::Failed;
        let failed = |k: usize| nearest_failed(&runs, &jobs, &places, &[0, 3], k);
        assert!(!failed(1) && failed(2));
        assert!(nearest_failed(&runs, &jobs, &places, &[], 1));
    }

    /// Places along each side of a made-up study.
    const SIDE: usize = 14;

    /// A made-up study of two fields, 14 places of each, where the drawing of a variant says nothing but that its teeth
    /// clear. Each generator has a front of its own, small or large, and one of them fails in one corner.
    struct MadeUp {
        settings: StudySettings,
        variants: Vec<Vec<String>>,
        jobs: Vec<Job>,
        /// What was computed, in the order of the calls.
        computed: RefCell<Vec<Job>>,
    }

    impl MadeUp {
        fn new() -> MadeUp {
            let generators = vec![GeneratorKind::Cam, GeneratorKind::TwoRoller, GeneratorKind::DoubleDisc];
            let targets = ["kinematic_error_pp_arcsec", "max_von_mises_mpa"];
            let settings = StudySettings {
                targets: targets.map(|name| StudyTarget::new(name, Sense::Least).unwrap()).to_vec(),
                generators: generators.clone(),
                ..settings(&["flexspline.rim_thickness_mm=0..1", "generator.w0_mm=0..1"])
            };
            let at = |k: usize| (k as f64 / (SIDE - 1) as f64).to_string();
            let variants: Vec<Vec<String>> = (0..SIDE * SIDE).map(|k| vec![at(k / SIDE), at(k % SIDE)]).collect();
            let jobs =
                (0..variants.len()).flat_map(|k| generators.iter().map(move |kind| (k, *kind))).collect::<Vec<Job>>();
            MadeUp { settings, variants, jobs, computed: RefCell::default() }
        }

        /// Error and stress of a variant.
        fn figures((variant, generator): Job) -> [f64; 2] {
            let [x, y] = [variant / SIDE, variant % SIDE].map(|k| k as f64 / (SIDE - 1) as f64);
            match generator {
                // The less of one, the more of the other, everywhere: nothing beats anything.
                GeneratorKind::TwoRoller => [1.0 + (2.0 * x).sin() + y, 300.0 - 50.0 * ((2.0 * x).sin() + y)],
                // Both are least at one place that is none of those computed first.
                _ => [1.0, 200.0].map(|size| size * (1.0 + (x - 0.7).powi(2) + (y - 0.3).powi(2) + 0.2 * x * y)),
            }
        }

        fn fails((variant, generator): Job) -> bool {
            generator == GeneratorKind::DoubleDisc && variant == SIDE * SIDE - 1
        }

        fn make(&self, jobs: &[Job], basis: Basis) -> Vec<StudyRun> {
            let one = |job: &Job| {
                let [error, stress] = MadeUp::figures(*job);
                let mut run = made_up(job.0 + 1, 0.0, error, stress);
                (run.generator, run.basis) = (job.1, basis);
                match basis {
                    Basis::Estimated => run.sheet = DataSheet { rigid_gap_um: Some(1.0), ..DataSheet::default() },
                    Basis::Computed if MadeUp::fails(*job) => run.status = RunStatus::Failed,
                    Basis::Computed => {}
                }
                run
            };
            if basis == Basis::Computed {
                self.computed.borrow_mut().extend(jobs);
            }
            jobs.iter().map(one).collect()
        }

        /// All runs, judged.
        fn studied(&self) -> (Vec<StudyRun>, Vec<Trust>) {
            let make = |jobs: &[Job], _, basis| Ok(self.make(jobs, basis));
            let (mut runs, trust) = some_computed(&self.settings, &self.variants, &self.jobs, &make).unwrap();
            judge::judge(&mut runs, &[], &self.settings.targets, &[]);
            (runs, trust)
        }
    }

    #[test]
    fn runs_stand_in_the_order_of_the_jobs_and_none_is_computed_twice() {
        let of = MadeUp::new();
        let (runs, trust) = of.studied();
        assert!(runs.iter().map(|run| (run.variant - 1, run.generator)).eq(of.jobs.iter().copied()));
        let mut computed = of.computed.borrow().clone();
        let basis_computed = of.jobs.iter().zip(&runs).filter(|(_, run)| !is_estimated(run)).map(|(job, _)| *job);
        computed.sort_unstable();
        let mut told: Vec<Job> = basis_computed.collect();
        told.sort_unstable();
        assert_eq!(computed, told);
        // Error and stress of each generator, off by little, and no figure of the drawing.
        let names: Vec<&str> = trust.iter().map(|trust| trust.figure).collect();
        assert_eq!(names, ["kinematic_error_pp_arcsec", "max_von_mises_mpa"].repeat(3));
        for (job, run) in of.jobs.iter().zip(&runs).filter(|(_, run)| is_estimated(run)) {
            let [error, stress] = MadeUp::figures(*job);
            let [told_error, told_stress] = [run.sheet.kinematic_error_pp_arcsec, run.sheet.max_von_mises_mpa];
            assert!((told_error.unwrap() / error - 1.0).abs() < 0.02, "{job:?}: {told_error:?}, {error}");
            assert!((told_stress.unwrap() / stress - 1.0).abs() < 0.02, "{job:?}: {told_stress:?}, {stress}");
        }
    }

    #[test]
    fn a_front_is_computed_and_of_a_large_one_as_many_variants_as_are_allowed() {
        let of = MadeUp::new();
        let (runs, _) = of.studied();
        let computed = |kind| of.computed.borrow().iter().filter(|job| job.1 == kind).count();
        // One variant is best in both, and the surface finds it.
        let best = |kind| {
            (0..SIDE * SIDE).min_by(|a, b| MadeUp::figures((*a, kind))[0].total_cmp(&MadeUp::figures((*b, kind))[0]))
        };
        let front: Vec<&StudyRun> =
            runs.iter().filter(|run| run.generator == GeneratorKind::Cam && run.front).collect();
        assert!(front.len() == 1 && front[0].basis == Basis::Computed, "{front:?}");
        assert_eq!(Some(front[0].variant - 1), best(GeneratorKind::Cam));
        let after_the_first = computed(GeneratorKind::Cam) - computed_first(2);
        assert!((1..MOST_OF_FRONT).contains(&after_the_first), "{after_the_first}");
        assert_eq!(computed(GeneratorKind::TwoRoller), computed_first(2) + MOST_OF_FRONT);
    }

    /// The last corner is among the first that are computed. Its neighbours are not: they are estimated where it
    /// converged.
    #[test]
    fn what_stands_beside_a_variant_that_failed_is_computed() {
        let of = MadeUp::new();
        let (runs, _) = of.studied();
        let at = |x: usize, y: usize, kind| {
            let job = (x * SIDE + y, kind);
            &runs[of.jobs.iter().position(|other| *other == job).unwrap()]
        };
        let last = SIDE - 1;
        assert_eq!(at(last, last, GeneratorKind::DoubleDisc).status, RunStatus::Failed);
        for (x, y) in [(last - 1, last), (last, last - 1), (last - 1, last - 1)] {
            assert_eq!(at(x, y, GeneratorKind::Cam).basis, Basis::Estimated);
            assert_eq!(at(x, y, GeneratorKind::DoubleDisc).basis, Basis::Computed);
        }
    }

    /// 400 variants are computed, some of them between others.
    #[test]
    fn a_surface_goes_through_so_many_points_and_no_more() {
        let variants: Vec<Vec<String>> = (0..500).map(|k| vec![k.to_string()]).collect();
        let places = places(&variants);
        let jobs: Vec<Job> = (0..500).map(|k| (k, GeneratorKind::Cam)).collect();
        let error = |k: usize| 2.0 + (0.01 * k as f64).sin();
        let mut runs: Vec<StudyRun> = (0..500).map(|k| made_up(k + 1, 0.0, error(k), 100.0)).collect();
        // All variants between 100 and 199 are estimated: the surface has to come from both sides.
        for run in &mut runs[100..200] {
            (run.basis, run.sheet) = (Basis::Estimated, DataSheet::default());
        }
        let trust = estimate(&[GeneratorKind::Cam], &mut runs, &jobs, &places);
        assert!(trust.len() == 2 && trust.iter().all(|trust| trust.runs == MOST_POINTS), "{trust:?}");
        let worst = |k: usize| (runs[k].sheet.kinematic_error_pp_arcsec.unwrap() - error(k)).abs();
        let worst = (100..200).map(worst).fold(0.0, f64::max);
        assert!(worst < 0.01, "{worst}");
    }

    #[test]
    fn the_best_in_each_target_comes_before_the_second_in_any() {
        let runs: Vec<StudyRun> = [(1.0, 400.0), (2.0, 300.0), (3.0, 200.0), (4.0, 100.0)]
            .map(|(error, stress)| made_up(1, 0.0, error, stress))
            .to_vec();
        let targets = ["kinematic_error_pp_arcsec", "max_von_mises_mpa"]
            .map(|name| StudyTarget::new(name, Sense::Least).unwrap());
        assert_eq!(best_first(&[0, 1, 2, 3], &runs, &targets), [0, 3, 1, 2]);
        assert_eq!(best_first(&[2, 1], &runs, &targets), [1, 2]);
    }
}
