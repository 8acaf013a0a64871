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

use super::model::{KernelModel, Response};
use super::plan::{HowComputed, PlanError, VariantPlan};
use crate::data_sheet::{FIGURES, data_sheet};
use flexspline_base::output::OutputError;
use flexspline_mechanics::drive::{Drive, GeneratorKind};

/// First columns of results.
const BEFORE: [&str; 4] = ["plan", "variant", "generator", "status"];
/// Last columns of results.
const AFTER: [&str; 2] = ["why", "cautions"];

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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
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
        match self {
            RunStatus::Converged => "converged",
            RunStatus::Failed => "failed",
            RunStatus::Refused => "refused",
        }
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
}

impl VariantRow {
    fn line(&self, plan: &VariantPlan) -> io::Result<Vec<u8>> {
        let head = [plan.hash.clone(), (self.variant + 1).to_string(), self.generator.to_string()];
        let figures = self.figures.iter().map(|x| if x.is_finite() { x.to_string() } else { String::new() });
        let tail = [&self.why, &self.cautions].map(|words| words.replace(['\n', '\r'], " "));
        let status = [self.status.name().to_owned()];
        let mut to = csv::Writer::from_writer(Vec::new());
        to.write_record(head.into_iter().chain(status).chain(figures).chain(tail)).map_err(io::Error::other)?;
        to.into_inner().map_err(|error| io::Error::other(error.to_string()))
    }

    /// Reads a row; none where it is not whole.
    fn read(record: &csv::StringRecord, plan: &VariantPlan) -> Option<VariantRow> {
        let cell = |k: usize| record.get(k);
        let variant = cell(1)?.parse::<usize>().ok()?.checked_sub(1).filter(|k| *k < plan.variants.len())?;
        let generator = cell(2)?.parse().ok().filter(|kind| plan.generators.contains(kind))?;
        let status = RunStatus::ALL.into_iter().find(|status| Some(status.name()) == cell(3))?;
        let count = record.len().checked_sub(BEFORE.len() + AFTER.len())?;
        let number = |text: &str| if text.is_empty() { Some(f64::NAN) } else { text.parse().ok() };
        let figures: Option<Vec<f64>> = record.iter().skip(BEFORE.len()).take(count).map(number).collect();
        let [why, cautions] = [0, 1].map(|k| cell(BEFORE.len() + count + k).unwrap_or_default().to_owned());
        let figures = figures.filter(|figures| figures.len() == plan.figures().len())?;
        Some(VariantRow { variant, generator, status, figures, why, cautions })
    }
}

/// The whole rows at the beginning of a file of results, and where they end.
///
/// # Errors
/// It holds rows of another plan, or is no file of results.
pub(super) fn rows_of(path: &Path, text: &[u8], plan: &VariantPlan) -> Result<(Vec<VariantRow>, u64), PlanError> {
    let foreign = |what: &str| {
        PlanError::BadInput(format!("{}: {what}; remove it, or run the sweep in another folder", path.display()))
    };
    // What follows the last end of a line was cut off.
    let whole = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
    let mut reader = csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(&text[..whole]);
    let (mut rows, mut end, header) = (Vec::new(), 0, header(plan));
    let mut record = csv::StringRecord::new();
    while matches!(reader.read_record(&mut record), Ok(true)) {
        if end == 0 {
            if record != header {
                return Err(foreign("no results of this plan"));
            }
        } else if record.get(0) != Some(&plan.hash) && record.len() == header.len() {
            let theirs = record.get(0).unwrap_or_default();
            return Err(foreign(&format!("results of the plan {theirs:.16}, and this one is {}", plan.hash)));
        } else {
            let Some(row) = VariantRow::read(&record, plan) else { break };
            rows.push(row);
        }
        end = reader.position().byte();
    }
    Ok((rows, end))
}

/// Columns of a file of results.
fn header(plan: &VariantPlan) -> Vec<&'static str> {
    BEFORE.into_iter().chain(plan.figures()).chain(AFTER).collect()
}

/// Computes variants of a plan.
struct Evaluator<'a> {
    plan: &'a VariantPlan,
    models: Vec<KernelModel>,
}

impl Evaluator<'_> {
    fn new(plan: &VariantPlan) -> Evaluator<'_> {
        let models = match plan.by() {
            HowComputed::Sheet { .. } => Vec::new(),
            HowComputed::Kernels { torques_n_m, of, .. } => {
                of.iter().map(|one| KernelModel::new(&one.kernels, one.response.clone(), *torques_n_m)).collect()
            }
        };
        Evaluator { plan, models }
    }

    fn row(&self, variant: usize, g: usize) -> VariantRow {
        let generator = self.plan.generators[g];
        let figures = vec![f64::NAN; self.plan.figures().len()];
        let (why, cautions) = (String::new(), String::new());
        let mut row = VariantRow { variant, generator, status: RunStatus::Refused, figures, why, cautions };
        match self.plan.drive_of(variant, generator) {
            Ok(drive) => match self.plan.by() {
                HowComputed::Sheet { torque_n_m, positions } => self.sheet(&drive, *torque_n_m, *positions, &mut row),
                HowComputed::Kernels { of, .. } => self.kernels(&drive, &of[g].response, &self.models[g], &mut row),
            },
            Err(error) => row.why = error.to_string(),
        }
        row
    }

    fn sheet(&self, drive: &Drive, torque_n_m: Option<f64>, positions: usize, row: &mut VariantRow) {
        let loads = self.plan.loads(drive, row.generator, torque_n_m);
        let temperature_c = drive.temperature.reference_c;
        let (mut sheet, done) = data_sheet(drive, row.generator, temperature_c, loads, positions, self.plan.solver());
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

    fn kernels(&self, drive: &Drive, response: &Response, model: &KernelModel, row: &mut VariantRow) {
        let column = |field: &str| self.plan.columns.iter().position(|column| column == field);
        let mut values = Vec::new();
        for parabola in &response.parabolas {
            // A field that the plan no longer sets is that of the middle drive.
            let Some(k) = column(&parabola.field) else {
                values.push(parabola.at[1]);
                continue;
            };
            let text = &self.plan.variants[row.variant][k];
            match text.parse() {
                Ok(value) => values.push(value),
                Err(_) => {
                    row.why = format!("{}: found {text:?}, allowed: a number", parabola.field);
                    return;
                }
            }
        }
        row.status = RunStatus::Converged;
        row.figures = model.figures(&drive.as_built, &values);
    }
}

/// A file of results that rows are appended to, in their order.
struct Journal<'a> {
    plan: &'a VariantPlan,
    file: File,
    next: usize,
    waiting: BTreeMap<usize, VariantRow>,
}

impl Journal<'_> {
    /// Takes a row, and writes all that are next.
    fn take(&mut self, place: usize, row: VariantRow) -> io::Result<()> {
        self.waiting.insert(place, row);
        while let Some(row) = self.waiting.remove(&self.next) {
            self.file.write_all(&row.line(self.plan)?)?;
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
/// There are fewer variants than shards, the file holds rows of another plan, or it cannot be written.
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
    let path = shard.path(folder);
    let failed = |source: io::Error| PlanError::Output(OutputError { path: path.clone(), source });
    fs::create_dir_all(folder.join("results")).map_err(failed)?;
    let open = || OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
    let mut file = open().map_err(failed)?;
    // An engine may run the shard of a worker that only seems lost a second time: it waits, and has nothing to do.
    file.lock().map_err(failed)?;
    let mut text = Vec::new();
    file.read_to_end(&mut text).map_err(failed)?;
    let jobs: Vec<(usize, usize)> = (variants * (shard.number - 1) / shard.of..variants * shard.number / shard.of)
        .flat_map(|variant| (0..generators).map(move |g| (variant, g)))
        .collect();
    let (rows, mut end) = rows_of(&path, &text, plan)?;
    let expected =
        |row: &VariantRow, (variant, g): (usize, usize)| (row.variant, row.generator) == (variant, plan.generators[g]);
    let there = rows.len();
    if there > jobs.len() || rows.iter().zip(&jobs).any(|(row, job)| !expected(row, *job)) {
        return Err(PlanError::BadInput(format!("{}: not the rows of this shard; remove it", path.display())));
    }
    if end == 0 {
        let line = header(plan).join(",") + "\n";
        file.rewind().and_then(|()| file.write_all(line.as_bytes())).map_err(failed)?;
        end = line.len() as u64;
    }
    file.set_len(end).and_then(|()| file.seek(SeekFrom::Start(end))).map_err(failed)?;
    let evaluator = Evaluator::new(plan);
    let journal = Mutex::new(Journal { plan, file, next: there, waiting: BTreeMap::new() });
    let missing = (there..jobs.len()).collect::<Vec<usize>>().into_iter();
    missing.par_bridge().try_for_each(|place| {
        let row = evaluator.row(jobs[place].0, jobs[place].1);
        let mut journal = journal.lock().unwrap_or_else(PoisonError::into_inner);
        done(journal.next + journal.waiting.len() + 1, jobs.len(), &row);
        journal.take(place, row).map_err(failed)
    })?;
    let journal = journal.into_inner().unwrap_or_else(PoisonError::into_inner);
    journal.file.sync_all().map_err(failed)?;
    Ok(Ran { there, computed: jobs.len() - there })
}
