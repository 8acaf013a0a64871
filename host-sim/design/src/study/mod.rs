//! Variants of a drive side by side: which fields vary, what a catalogue would print of each variant, which of them
//! meet the constraints, which are best, and what each field does.

mod asked;
mod effects;
mod estimate;
mod judge;
mod surface;
mod trust;
mod vary;

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use rayon::prelude::*;
use serde::Serialize;
use thiserror::Error;

use crate::cautions::{Caution, rigid_gap_um, room_as_built_arcsec};
use crate::data_sheet::{DataSheet, Loads, data_sheet};
use crate::stated::Stated;
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::stepping::SolverSettings;

pub use asked::{Asked, Miss, Nearest, asked, nearest};
pub use effects::{StudyEffect, effects, is_idle};
pub(crate) use estimate::computed_first;
pub use judge::{Constraint, JudgeError, Sense, StudyTarget, figure};
pub use trust::Trust;
pub use vary::{VariedValues, Vary, VaryError, grid, is_error_of_making};

/// Fields that vary at once, at most.
pub(crate) const MOST_FIELDS: usize = 32;
/// Variants of a study, at most.
pub(crate) const MOST_VARIANTS: usize = 100_000;

/// The figure whose search ends at the largest load.
pub const LAST_STABLE: &str = "last_stable_n_m";

/// What to study.
#[derive(Debug, Clone, PartialEq)]
pub struct StudySettings {
    /// The fields that vary, and over what.
    pub vary: Vec<Vary>,
    /// So many variants spread over all ranges at once; without it every combination of their values.
    pub spread: Option<u32>,
    /// Which spread.
    pub seed: u32,
    /// The generators.
    pub generators: Vec<GeneratorKind>,
    /// Largest load, N·m; by default that of the data sheet, or what a table of that generator spans.
    pub torque_n_m: Option<f64>,
    /// What a data sheet says of the drive: without a largest load its T1, T2 and rated torque are the loads.
    pub stated: Option<Stated>,
    /// Positions over a tooth pitch, 4 or more.
    pub positions: usize,
    /// What a variant has to keep to.
    pub constraints: Vec<Constraint>,
    /// What makes a variant better than another.
    pub targets: Vec<StudyTarget>,
    /// Every variant is computed, however many there are.
    pub compute_all: bool,
    /// The numerical method.
    pub solver: SolverSettings,
}

impl StudySettings {
    /// Whether every variant has the same loads; those that a table spans by default go with the size of the drive.
    fn has_fixed_loads(&self) -> bool {
        self.torque_n_m.is_some() || self.stated.as_ref().is_some_and(Stated::has_loads)
    }

    /// The largest load of the data sheet, N·m, where it is beyond what a table of this generator spans by default. A
    /// catalogue rates its own generator, a cam: rollers, which leave the rim unsupported, may find no equilibrium
    /// there.
    pub fn sheet_beyond_table_n_m(&self, drive: &Drive, kind: GeneratorKind) -> Option<f64> {
        let by_sheet = self.torque_n_m.is_none() && self.has_fixed_loads();
        let largest_n_m = self.loads(drive, kind).largest_n_m;
        (by_sheet && largest_n_m > Stated::rated_n_m(self.stated.as_ref(), drive, kind)).then_some(largest_n_m)
    }

    /// The loads of a variant.
    fn loads(&self, drive: &Drive, kind: GeneratorKind) -> Loads {
        let spanned_n_m = drive.rated_torque_n_m(kind);
        match (self.torque_n_m, &self.stated) {
            (Some(largest_n_m), _) => Loads::up_to(largest_n_m),
            (None, Some(stated)) => stated.loads(spanned_n_m),
            (None, None) => Loads::up_to(spanned_n_m),
        }
    }
}

/// A study that cannot be begun, or was stopped.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum StudyError {
    /// Nothing varies, or too much.
    #[error("--vary: found {found}, allowed: 1 to {MOST_FIELDS} different fields")]
    Fields {
        /// What was found.
        found: String,
    },
    /// Too many variants.
    #[error("--vary: found {found} variants, allowed: 1 to {MOST_VARIANTS}; fewer values, or --variants N")]
    Variants {
        /// How many.
        found: usize,
    },
    /// A value that a field takes twice.
    #[error(
        "--vary {path}: found the value {value} twice, allowed: each once; a field that does not vary goes with --set \
         {path}={value}"
    )]
    Twice {
        /// The field.
        path: String,
        /// The value.
        value: String,
    },
    /// A last stable load beyond the largest load.
    #[error(
        "--keep {constraint}: the largest load of any variant with the {generator} generator is {largest_n_m} N.m, \
         where the search for it ends; allowed: a least value up to that, or a larger --torque-n-m"
    )]
    BeyondLoad {
        /// The constraint.
        constraint: String,
        /// The generator.
        generator: GeneratorKind,
        /// Where the search ends.
        largest_n_m: f64,
    },
    /// No value of a field makes a drive, whatever the others are.
    #[error("--vary {path}: no value of it makes a drive: {why}")]
    NoDrive {
        /// The field.
        path: String,
        /// Why its first value is refused.
        why: String,
    },
    /// The observer asked to stop.
    #[error("stopped")]
    Stopped,
}

/// How a run of one variant ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RunStatus {
    /// All figures are there.
    Converged,
    /// No equilibrium from some load on: the figures until then are there.
    Failed,
    /// Its fields make no drive.
    Refused,
}

impl RunStatus {
    /// As in the files.
    pub fn name(self) -> &'static str {
        match self {
            RunStatus::Converged => "converged",
            RunStatus::Failed => "failed",
            RunStatus::Refused => "refused",
        }
    }
}

/// Where the figures of a run are from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Basis {
    /// Contact FEM of this variant.
    Computed,
    /// The drawing of this variant and, for all that takes FEM, a surface through the variants that were computed
    /// ([`Trust`]).
    Estimated,
}

impl Basis {
    /// As in the files.
    pub fn name(self) -> &'static str {
        match self {
            Basis::Computed => "computed",
            Basis::Estimated => "estimated",
        }
    }
}

/// A variant with one generator.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StudyRun {
    /// Number of the variant, from 1.
    pub variant: usize,
    /// The generator.
    pub generator: GeneratorKind,
    /// Values of the fields that vary, in their order.
    pub values: Vec<String>,
    /// How the run ended.
    pub status: RunStatus,
    /// Where its figures are from. What is estimated counts as converged as the computed variant nearest to it did.
    pub basis: Basis,
    /// Why, where it did not converge.
    pub why: Option<String>,
    /// What has to be known of a drive that converged before it is built.
    pub cautions: Vec<Caution>,
    /// The loads of the sheet; missing of a drive that was refused.
    pub loads: Option<Loads>,
    /// What a catalogue would print. A last stable load that is the largest of the study is a bound: it may bear more.
    pub sheet: DataSheet,
    /// Whether it converged, its teeth clear one another, and every constraint is kept.
    pub meets: bool,
    /// Whether it meets, and nothing that meets beats it in every target, of this generator.
    pub front: bool,
}

impl StudyRun {
    /// Whether another variant has the same errors of making, at these places among the values.
    pub(crate) fn made_as(&self, other: &StudyRun, errors: &[usize]) -> bool {
        errors.iter().all(|k| self.values[*k] == other.values[*k])
    }

    /// Whether it bears the largest load of the study: its last stable load is a bound, and no figure of its own. A run
    /// that failed may have borne it, too, before the turn over a tooth pitch; an estimate of one that failed does not
    /// say.
    pub fn bears_all(&self) -> bool {
        let bears = |last: f64| self.loads.is_some_and(|loads| last >= loads.largest_n_m);
        match self.status {
            RunStatus::Converged => true,
            RunStatus::Failed => self.basis == Basis::Computed && self.sheet.last_stable_n_m.is_some_and(bears),
            RunStatus::Refused => false,
        }
    }
}

/// What a study gives.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Study {
    /// The fields that vary.
    pub fields: Vec<String>,
    /// Every variant with every generator, by variant, then by generator.
    pub runs: Vec<StudyRun>,
    /// How far estimated figures can be trusted, by generator and figure; nothing where all are computed.
    pub trust: Vec<Trust>,
}

impl Study {
    /// What nothing beats of a generator, best in the first target first. Where errors of making vary, those made as
    /// the first variant come first, then those made as the next: between them there is no better.
    pub fn front(&self, generator: GeneratorKind, targets: &[StudyTarget]) -> Vec<&StudyRun> {
        let mut front: Vec<&StudyRun> =
            self.runs.iter().filter(|run| run.generator == generator && run.front).collect();
        let errors = errors_of_making(&self.fields);
        let made = |run: &StudyRun| errors.iter().map(|k| run.values[*k].clone()).collect::<Vec<String>>();
        let mut first_made = HashMap::new();
        for (k, run) in self.runs.iter().enumerate() {
            first_made.entry(made(run)).or_insert(k);
        }
        let cost = |run: &StudyRun| targets.first().map_or(0.0, |first| first.cost(&run.sheet));
        front.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
        front.sort_by_cached_key(|run| first_made.get(&made(run)));
        front
    }
}

/// The places of the fields that are errors of making.
pub fn errors_of_making(fields: &[impl AsRef<str>]) -> Vec<usize> {
    (0..fields.len()).filter(|k| is_error_of_making(fields[*k].as_ref())).collect()
}

/// Told after every run: how many are done, of how many, and the last. May ask to stop.
pub(crate) type Observer<'a> = dyn Fn(usize, usize, &StudyRun) -> ControlFlow<()> + Sync + 'a;

/// Runs every variant of `drive` with every generator. The result does not depend on threads.
///
/// # Errors
/// Nothing varies, too much varies, a field can take none of its values, or the observer stopped it. A variant that
/// fails or is refused is a row of the result.
pub fn study(drive: &Drive, settings: &StudySettings, observer: &Observer<'_>) -> Result<Study, StudyError> {
    let variants = variants(drive, settings)?;
    let paths: Vec<&str> = settings.vary.iter().map(|field| field.path.as_str()).collect();
    let jobs: Vec<Job> =
        (0..variants.len()).flat_map(|variant| settings.generators.iter().map(move |kind| (variant, *kind))).collect();
    let several = Several { drive, settings, paths: &paths, variants: &variants, observer, done: AtomicUsize::new(0) };
    let (runs, trust) = if settings.compute_all || variants.len() <= computed_first(paths.len()) {
        (several.run(&jobs, jobs.len(), Several::computed)?, Vec::new())
    } else {
        let run = |jobs: &[Job], of: usize, basis: Basis| match basis {
            Basis::Computed => several.run(jobs, of, Several::computed),
            Basis::Estimated => several.run(jobs, of, Several::drawn),
        };
        estimate::some_computed(settings, &variants, &jobs, &run)?
    };
    // A bound is no estimate.
    let trust = trust.into_iter().filter(|trust| trust.figure != LAST_STABLE).collect();
    let mut study = Study { fields: paths.iter().map(|path| (*path).to_owned()).collect(), runs, trust };
    judge::judge(&mut study.runs, &settings.constraints, &settings.targets, &errors_of_making(&paths));
    Ok(study)
}

/// A variant, by its number from 0, with a generator.
type Job = (usize, GeneratorKind);

/// Many runs of one study.
struct Several<'a> {
    drive: &'a Drive,
    settings: &'a StudySettings,
    paths: &'a [&'a str],
    variants: &'a [Vec<String>],
    observer: &'a Observer<'a>,
    done: AtomicUsize,
}

impl Several<'_> {
    /// Runs these, in their order, as `one` does; the observer is told that there will be about `of` in all.
    fn run(&self, jobs: &[Job], of: usize, one: fn(&Self, Job) -> StudyRun) -> Result<Vec<StudyRun>, StudyError> {
        let stopped = AtomicBool::new(false);
        let runs: Vec<StudyRun> = jobs
            .par_iter()
            .with_max_len(1)
            .filter_map(|&job| {
                if stopped.load(Ordering::Relaxed) {
                    return None;
                }
                let run = one(self, job);
                let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
                if (self.observer)(done, of.max(done), &run).is_break() {
                    stopped.store(true, Ordering::Relaxed);
                }
                Some(run)
            })
            .collect();
        if runs.len() < jobs.len() { Err(StudyError::Stopped) } else { Ok(runs) }
    }

    /// A variant as its fields make it, or refused, without figures.
    fn begun(&self, (variant, generator): Job) -> (StudyRun, Option<Drive>) {
        let values = &self.variants[variant];
        let made = varied(self.drive, self.paths, values, generator);
        let run = StudyRun {
            variant: variant + 1,
            generator,
            values: values.clone(),
            status: RunStatus::Refused,
            basis: Basis::Computed,
            why: made.as_ref().err().map(ToString::to_string),
            cautions: Vec::new(),
            loads: made.as_ref().ok().map(|drive| self.settings.loads(drive, generator)),
            sheet: DataSheet::default(),
            meets: false,
            front: false,
        };
        (run, made.ok())
    }

    /// A variant by contact FEM.
    fn computed(&self, job: Job) -> StudyRun {
        let (mut run, drive) = self.begun(job);
        let (Some(drive), Some(loads)) = (drive, run.loads) else { return run };
        let StudySettings { positions, solver, .. } = *self.settings;
        let (sheet, done) = data_sheet(&drive, job.1, drive.temperature.reference_c, loads, positions, solver);
        (run.sheet, run.cautions) = (sheet, sheet.looked().cautions());
        match done {
            Ok(()) => run.status = RunStatus::Converged,
            Err(error) => {
                run.status = if error.is_bad_input() { RunStatus::Refused } else { RunStatus::Failed };
                run.why = Some(error.to_string());
            }
        }
        run
    }

    /// A variant by its drawing alone.
    fn drawn(&self, job: Job) -> StudyRun {
        let (mut run, drive) = self.begun(job);
        if let Some(drive) = drive {
            (run.status, run.basis) = (RunStatus::Converged, Basis::Estimated);
            run.sheet.rigid_gap_um = rigid_gap_um(&drive, job.1);
            run.sheet.room_as_built_arcsec = room_as_built_arcsec(&drive, job.1);
        }
        run
    }
}

fn variants(drive: &Drive, settings: &StudySettings) -> Result<Vec<Vec<String>>, StudyError> {
    let vary = &settings.vary;
    if !(1..=MOST_FIELDS).contains(&vary.len()) {
        return Err(StudyError::Fields { found: format!("{} of them", vary.len()) });
    }
    if let Some(twice) = vary.iter().enumerate().find_map(|(k, a)| vary[..k].iter().find(|b| a.path == b.path)) {
        return Err(StudyError::Fields { found: format!("{} twice", twice.path) });
    }
    if let Some((field, value)) = vary.iter().find_map(|field| Some((field, field.repeated()?))) {
        return Err(StudyError::Twice { path: field.path.clone(), value });
    }
    let count = match settings.spread {
        Some(count) => count as usize,
        None => vary.iter().map(|field| field.grid().len()).fold(1, usize::saturating_mul),
    };
    if !(1..=MOST_VARIANTS).contains(&count) {
        return Err(StudyError::Variants { found: count });
    }
    let variants = match settings.spread {
        Some(count) => vary::spread(vary, count, settings.seed),
        None => vary::grid(vary),
    };
    // A field that does not exist, or a range that makes no drive, is told before anything is computed. Fields may be
    // possible together that are not alone.
    let paths: Vec<&str> = vary.iter().map(|field| field.path.as_str()).collect();
    // With none of the generators.
    let refused = |paths: &[&str], values: &[String]| {
        let mut why = settings.generators.iter().map(|kind| varied(drive, paths, values, *kind).err());
        why.try_fold(None, |first, why| why.map(|why| first.or(Some(why)))).flatten()
    };
    if variants.iter().all(|values| refused(&paths, values).is_some()) {
        for (k, path) in paths.iter().enumerate() {
            let alone = |values: &Vec<String>| refused(&paths[k..=k], &values[k..=k]);
            if variants.iter().all(|values| alone(values).is_some()) {
                let why = alone(&variants[0]).map_or_else(String::new, |error| error.to_string());
                return Err(StudyError::NoDrive { path: (*path).to_owned(), why });
            }
        }
    }
    for kept in settings.constraints.iter().filter(|kept| kept.figure == LAST_STABLE) {
        for kind in &settings.generators {
            let largest_n_m = largest_of_all(drive, settings, &paths, &variants, *kind);
            if let Some(largest_n_m) = largest_n_m.filter(|largest| *largest < kept.least) {
                return Err(StudyError::BeyondLoad { constraint: kept.to_string(), generator: *kind, largest_n_m });
            }
        }
    }
    Ok(variants)
}

/// The largest load of any variant that makes a drive, N·m.
fn largest_of_all(
    drive: &Drive,
    settings: &StudySettings,
    paths: &[&str],
    variants: &[Vec<String>],
    kind: GeneratorKind,
) -> Option<f64> {
    let largest_n_m = |drive: &Drive| settings.loads(drive, kind).largest_n_m;
    if settings.has_fixed_loads() {
        return Some(largest_n_m(drive));
    }
    let made = variants.par_iter().filter_map(|values| varied(drive, paths, values, kind).ok());
    made.map(|drive| largest_n_m(&drive)).reduce_with(f64::max)
}

/// A variant, as it has to be for one generator.
fn varied(
    drive: &Drive,
    paths: &[&str],
    values: &[String],
    kind: GeneratorKind,
) -> Result<Drive, flexspline_mechanics::drive::DriveError> {
    let sets: Vec<String> = paths.iter().zip(values).map(|(path, value)| format!("{path}={value}")).collect();
    drive.with_sets_for(&[kind], sets.iter().map(String::as_str))
}

#[cfg(test)]
mod tests;
