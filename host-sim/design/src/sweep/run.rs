//! Computes variants and notes each as a row of a file in `results/`.
//!
//! A shard is a range of variants with a file of its own. Rows are appended in the order of the variants, one write
//! each, so that a process that is killed leaves whole rows; the next run of the shard goes on after them. A row holds
//! the hash of its plan.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;
use serde::Serialize;

use super::model::{KernelModel, Parabola};
use super::plan::{HowComputed, PlanError, VariantPlan, csv_of};
use crate::data_sheet::{FIGURES, data_sheet};
use flexspline_base::output::{OutputError, note_appended};
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::stepping::SolverSettings;

/// First columns of results.
const BEFORE: [&str; 4] = ["plan", "variant", "generator", "status"];
/// Last columns of results.
const AFTER: [&str; 2] = ["why", "cautions"];

/// Figures that differ by this share are one result: FEM on another kind of processor rounds otherwise. A guess.
const SAME: f64 = 1e-6;

/// One of several shards, `I/N`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Its number, from 1.
    pub number: usize,
    /// All shards.
    pub of: usize,
}

impl Shard {
    /// All variants.
    pub const WHOLE: Shard = Shard { number: 1, of: 1 };

    /// Its file in the folder of a sweep.
    pub fn path(self, folder: &Path) -> PathBuf {
        folder.join("results").join(format!("{:04}-of-{:04}.csv", self.number, self.of))
    }
}

impl FromStr for Shard {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Shard, Self::Err> {
        let parts = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
        let shard = parts.map(|(number, of)| Shard { number, of });
        shard.filter(|shard| (1..=shard.of).contains(&shard.number)).ok_or("allowed: I/N, I from 1 to N")
    }
}

/// How the computation of a variant ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunStatus {
    /// All figures are there.
    Converged,
    /// No equilibrium from some load on: the figures until then are there.
    Failed,
    /// Its values make no drive.
    Refused,
}

impl RunStatus {
    const ALL: [RunStatus; 3] = [RunStatus::Converged, RunStatus::Failed, RunStatus::Refused];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        ["converged", "failed", "refused"][self as usize]
    }
}

/// A variant with a generator, computed.
#[derive(Debug, Clone, PartialEq)]
pub struct VariantRow {
    /// The variant, from 0.
    pub variant: usize,
    /// The generator.
    pub generator: GeneratorKind,
    /// How the computation ended.
    pub status: RunStatus,
    /// Figures in the order of [`VariantPlan::figures`]; not a number where missing.
    pub figures: Vec<f64>,
    /// The reason where it did not converge.
    pub why: String,
    /// Warnings on the drive of a variant that converged.
    pub cautions: String,
    /// Whether it meets the constraints; marked by the reduction.
    pub meets: bool,
    /// Whether it is Pareto-optimal; marked by the reduction.
    pub is_front: bool,
}

impl VariantRow {
    /// A row without figures, of values that make no drive until it is computed.
    pub(super) fn empty(plan: &VariantPlan, variant: usize, generator: GeneratorKind) -> VariantRow {
        VariantRow {
            variant,
            generator,
            status: RunStatus::Refused,
            figures: vec![f64::NAN; plan.figures().len()],
            why: String::new(),
            cautions: String::new(),
            meets: false,
            is_front: false,
        }
    }

    /// The figures as cells; a missing one is empty.
    pub(super) fn cells(&self) -> Vec<String> {
        self.figures.iter().map(|x| if x.is_finite() { x.to_string() } else { String::new() }).collect()
    }

    /// Whether both are one result, computed on one machine or on two.
    fn agrees_with(&self, other: &VariantRow) -> bool {
        let near = |(a, b): (&f64, &f64)| (a.is_nan() && b.is_nan()) || (a - b).abs() <= SAME * a.abs().max(b.abs());
        self.status == other.status && self.figures.iter().zip(&other.figures).all(near)
    }

    fn line(&self, plan: &VariantPlan) -> Result<Vec<u8>, PlanError> {
        let (number, generator) = ((self.variant + 1).to_string(), self.generator.to_string());
        let head = [plan.hash.clone(), number, generator, self.status.name().to_owned()];
        let tail = [&self.why, &self.cautions].map(|words| words.replace(['\n', '\r'], " "));
        csv_of([[&head[..], &self.cells(), &tail].concat()])
    }

    /// Reads a row; none where it is not whole.
    fn read(record: &csv::StringRecord, plan: &VariantPlan) -> Option<VariantRow> {
        let cell = |k: usize| record.get(k);
        let variant = cell(1)?.parse::<usize>().ok()?.checked_sub(1).filter(|k| *k < plan.variants.len())?;
        let generator = cell(2)?.parse().ok().filter(|kind| plan.generators.contains(kind))?;
        let status = RunStatus::ALL.into_iter().find(|status| Some(status.name()) == cell(3))?;
        let end = record.len().checked_sub(AFTER.len())?;
        let number = |text: &str| if text.is_empty() { Some(f64::NAN) } else { text.parse().ok() };
        let figures: Option<Vec<f64>> = (BEFORE.len()..end).map(|k| number(cell(k)?)).collect();
        let figures = figures.filter(|figures| figures.len() == plan.figures().len())?;
        let [why, cautions] = [0, 1].map(|k| cell(end + k).unwrap_or_default().to_owned());
        Some(VariantRow { status, figures, why, cautions, ..VariantRow::empty(plan, variant, generator) })
    }
}

/// The whole rows at the beginning of a file of results, and where they end.
///
/// # Errors
/// It holds rows of another plan, or is no file of results.
pub(super) fn rows_of(path: &Path, text: &[u8], plan: &VariantPlan) -> Result<(Vec<VariantRow>, u64), PlanError> {
    let foreign = |what: &str| foreign(path, what);
    // What follows the last end of a line was cut off.
    let end = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
    let reader = csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(&text[..end]);
    let mut records = reader.into_records().map(|record| record.map_err(|error| foreign(&error.to_string())));
    if records.next().transpose()?.is_some_and(|first| first != header(plan)) {
        return Err(foreign("no results of this plan"));
    }
    let read = |record: csv::StringRecord| match record.get(0) {
        Some(hash) if hash != plan.hash => {
            Err(foreign(&format!("results of the plan {hash:.16}, and this one is {}", plan.hash)))
        }
        _ => VariantRow::read(&record, plan).ok_or_else(|| foreign("a row that is none of this plan")),
    };
    Ok((records.map(|record| read(record?)).collect::<Result<Vec<VariantRow>, PlanError>>()?, end as u64))
}

/// Rows of all files of results, by variant, then by the place of the generator in the plan.
///
/// # Errors
/// A file is not of this plan, cannot be read, or has another result of a run than a file before it.
pub(super) fn results_in(plan: &VariantPlan, folder: &Path) -> Result<BTreeMap<(usize, usize), VariantRow>, PlanError> {
    let entries = fs::read_dir(folder.join("results")).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut paths: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|end| end == "csv")).collect();
    paths.sort();
    let mut found: BTreeMap<(usize, usize), VariantRow> = BTreeMap::new();
    for path in &paths {
        let text = fs::read(path).map_err(|error| PlanError::Failed(format!("{}: {error}", path.display())))?;
        for row in rows_of(path, &text, plan)?.0 {
            let g = plan.generators.iter().position(|kind| *kind == row.generator).unwrap_or_default();
            let first = found.entry((row.variant, g)).or_insert_with(|| row.clone());
            if !first.agrees_with(&row) {
                let (number, generator) = (row.variant + 1, row.generator);
                return Err(foreign(
                    path,
                    &format!("another result of variant {number} with {generator} than a line or a file before it"),
                ));
            }
        }
    }
    Ok(found)
}

/// A file of results that does not belong to the others.
fn foreign(path: &Path, what: &str) -> PlanError {
    PlanError::BadInput(format!("{}: {what}; remove it, or run the sweep in another folder", path.display()))
}

/// Columns of a file of results.
fn header(plan: &VariantPlan) -> Vec<&'static str> {
    BEFORE.into_iter().chain(plan.figures()).chain(AFTER).collect()
}

/// Computes a variant; `model` is that of its generator, of a plan of tolerances.
fn computed(plan: &VariantPlan, variant: usize, generator: GeneratorKind, model: Option<&KernelModel>) -> VariantRow {
    let mut row = VariantRow::empty(plan, variant, generator);
    match (plan.drive_of(variant, generator), model) {
        (Err(error), _) => row.why = error.to_string(),
        (Ok(drive), None) => by_sheet(plan, &drive, &mut row),
        (Ok(drive), Some(model)) => by_kernels(plan, &drive, model, &mut row),
    }
    row
}

fn by_sheet(plan: &VariantPlan, drive: &Drive, row: &mut VariantRow) {
    let HowComputed::Sheet { torque_n_m, positions } = plan.by else { return };
    let loads = plan.loads(drive, row.generator, torque_n_m);
    let (at_c, settings) = (drive.temperature.reference_c, SolverSettings::fast(plan.mesh));
    let (mut sheet, done) = data_sheet(drive, row.generator, at_c, loads, positions, settings);
    match done {
        Ok(()) => {
            row.status = RunStatus::Converged;
            // The search for it ends at the largest load.
            sheet.last_stable_n_m = Some(loads.largest_n_m);
        }
        Err(error) => {
            row.status = if error.is_bad_input() { RunStatus::Refused } else { RunStatus::Failed };
            row.why = error.to_string();
        }
    }
    let cautions = sheet.looked().cautions();
    row.cautions = cautions.iter().map(|caution| caution.words.as_str()).collect::<Vec<_>>().join("; ");
    let figures = FIGURES.iter().map(|(_, of)| of(&sheet).unwrap_or(f64::NAN));
    row.figures = [loads.t1_n_m, loads.t2_n_m, loads.largest_n_m].into_iter().chain(figures).collect();
}

fn by_kernels(plan: &VariantPlan, drive: &Drive, model: &KernelModel, row: &mut VariantRow) {
    let mut values = Vec::new();
    for Parabola { field, at, .. } in &model.response.parabolas {
        let cell = plan.columns.iter().position(|column| column == field).map(|k| &plan.variants[row.variant][k]);
        // A field that the plan no longer sets is that of the middle drive.
        match cell.map_or(Ok(at[1]), |text| text.parse()) {
            Ok(value) => values.push(value),
            Err(_) => {
                row.why = format!("{field}: found {:?}, allowed: a number", cell.map_or("", String::as_str));
                return;
            }
        }
    }
    row.status = RunStatus::Converged;
    row.figures = model.figures(&drive.as_built, &values);
}

/// A file of results that rows are appended to, in their order.
struct Journal {
    file: File,
    next: usize,
    /// Lines that were computed before the one that is next.
    waiting: BTreeMap<usize, Vec<u8>>,
}

impl Journal {
    /// Takes a line, and writes all that are next.
    fn take(&mut self, place: usize, line: Vec<u8>) -> io::Result<()> {
        self.waiting.insert(place, line);
        while let Some(line) = self.waiting.remove(&self.next) {
            self.file.write_all(&line)?;
            self.next += 1;
        }
        Ok(())
    }
}

/// Rows of a shard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Ran {
    /// Found in its file.
    pub there: usize,
    /// Computed now.
    pub computed: usize,
}

/// Computes what is missing of a shard; `done` is called with the rows done, all rows, and the last row.
///
/// # Errors
/// There are fewer variants than shards, a file of results is of another plan, or the shard cannot be written.
pub fn run(
    plan: &VariantPlan,
    folder: &Path,
    shard: Shard,
    done: &(dyn Fn(usize, usize, &VariantRow) + Sync),
) -> Result<Ran, PlanError> {
    let (variants, generators) = (plan.variants.len(), plan.generators.len());
    if shard.of > variants {
        return Err(PlanError::BadInput(format!(
            "--shard: found {} shards, allowed: up to {variants}, the number of variants",
            shard.of
        )));
    }
    // Of a plan that was changed since, before anything is computed.
    results_in(plan, folder)?;
    let path = shard.path(folder);
    let failed = |source: io::Error| PlanError::Output(OutputError { path: path.clone(), source });
    fs::create_dir_all(folder.join("results")).map_err(failed)?;
    let open = || OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
    let mut file = open().map_err(failed)?;
    // An engine may run the shard of a worker that only seems lost a second time: it waits, and has nothing to do.
    file.lock().map_err(failed)?;
    let mut text = Vec::new();
    file.read_to_end(&mut text).map_err(failed)?;
    // A run is a variant with a generator, by variant and then by generator.
    let [from, to] = [shard.number - 1, shard.number].map(|number| variants * number / shard.of * generators);
    let run_at = |place: usize| (place / generators, plan.generators[place % generators]);
    let (rows, end) = rows_of(&path, &text, plan)?;
    let next = from + rows.len();
    if next > to || !rows.iter().zip(from..).all(|(row, place)| (row.variant, row.generator) == run_at(place)) {
        return Err(PlanError::BadInput(format!("{}: not the rows of this shard; remove it", path.display())));
    }
    file.set_len(end).and_then(|()| file.seek(SeekFrom::End(0))).map_err(failed)?;
    if end == 0 {
        file.write_all((header(plan).join(",") + "\n").as_bytes()).map_err(failed)?;
    }
    note_appended();
    let model = plan.model();
    let journal = Mutex::new(Journal { file, next, waiting: BTreeMap::new() });
    (next..to).collect::<Vec<_>>().into_iter().par_bridge().try_for_each(|place| {
        let (variant, generator) = run_at(place);
        let row = computed(plan, variant, generator, model.as_ref());
        let line = row.line(plan)?;
        let mut journal = journal.lock().unwrap_or_else(PoisonError::into_inner);
        done(journal.next + journal.waiting.len() + 1 - from, to - from, &row);
        journal.take(place, line).map_err(failed)
    })?;
    let journal = journal.into_inner().unwrap_or_else(PoisonError::into_inner);
    journal.file.sync_all().map_err(failed)?;
    Ok(Ran { there: rows.len(), computed: to - next })
}
