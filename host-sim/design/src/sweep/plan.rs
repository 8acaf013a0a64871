//! The plan of a sweep: `plan.csv` holds the variants, one a line, and `plan.json` how they are computed.

use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::draw::{draw, sets};
use super::model::{self, KernelModel, Response};
use super::respond::respond;
use super::tolerance::Tolerances;
use super::vary::{Vary, filling, grid};
use crate::data_sheet::{self, Loads};
use crate::kernels::Kernels;
use crate::stated::Stated;
use flexspline_base::output::{OutputError, Outputs};
use flexspline_mechanics::drive::{Drive, DriveError, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::SolverSettings;

/// Version of `plan.json`.
const SCHEMA: u32 = 1;
/// Fields that vary at once, at most.
const MOST_FIELDS: usize = 32;
/// Variants of a sweep, at most.
const MOST_VARIANTS: usize = 100_000;
/// Drives drawn from tolerances, at least.
const LEAST_DRAWS: usize = 8;
/// First column of `plan.csv`.
pub const NUMBER: &str = "variant";
/// Loads of a data sheet, the first columns of its results.
const LOADS: [&str; 3] = ["t1_n_m", "t2_n_m", "largest_n_m"];

/// Why a sweep is not planned, run or reduced.
#[derive(Debug, Error)]
pub enum PlanError {
    /// The user has to change something.
    #[error("{0}")]
    BadInput(String),
    /// The computation failed, or results are missing.
    #[error("{0}")]
    Failed(String),
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// Called with the steps done, all steps, and a note.
pub type SweepProgress<'a> = dyn Fn(usize, usize, &str) + Sync + 'a;

/// Options of both kinds of plans.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlanSettings {
    /// Variants drawn; without it every combination of the values.
    pub draws: Option<usize>,
    /// Random seed of what is drawn.
    pub seed: u64,
    /// Mesh of all FEM.
    pub mesh: MeshLevel,
}

/// A plan.
#[derive(Debug, Clone, PartialEq)]
pub struct VariantPlan {
    /// The drive whose fields vary.
    pub drive: Drive,
    /// `[data_sheet]` of the drive.
    stated: Option<Stated>,
    /// The generators.
    pub generators: Vec<GeneratorKind>,
    pub(super) mesh: MeshLevel,
    pub(super) by: HowComputed,
    /// Fields that each variant sets.
    pub columns: Vec<String>,
    /// Values of the fields, by variant.
    pub variants: Vec<Vec<String>>,
    /// BLAKE3 of both files, its first 16 digits.
    pub hash: String,
}

/// `plan.json`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Recipe {
    schema_version: u32,
    /// Version of the program; another version computes other figures.
    tool_version: String,
    /// The drive as a file, with its `[data_sheet]`.
    drive_toml: String,
    generators: Vec<GeneratorKind>,
    mesh: MeshLevel,
    by: HowComputed,
}

/// How a variant is computed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum HowComputed {
    /// Its data sheet, by contact FEM.
    Sheet {
        /// Largest load, N·m; by default that of the data sheet of the drive, or of its size.
        torque_n_m: Option<f64>,
        /// Positions over a tooth pitch.
        positions: usize,
    },
    /// Its error over a turn of the output, by kernels.
    Kernels {
        /// The load, and the light load of lost motion, N·m.
        torques_n_m: [f64; 2],
        /// Influence kernels of the drive as drawn.
        kernels: Box<Kernels>,
        /// Response to uniform changes.
        response: Response,
    },
}

impl VariantPlan {
    /// A plan of fields that vary; variants have their data sheets computed, up to `torque_n_m` if it is given.
    ///
    /// # Errors
    /// No field, a field or a value twice, too many variants, or a field none of whose values makes a drive.
    pub fn of_fields(
        drive: &Drive,
        stated: Option<&Stated>,
        vary: &[Vary],
        generators: &[GeneratorKind],
        (torque_n_m, positions): (Option<f64>, usize),
        settings: PlanSettings,
    ) -> Result<VariantPlan, PlanError> {
        let wrong = |what: String| Err(PlanError::BadInput(what));
        let fields =
            |found: String| wrong(format!("--vary: found {found}, allowed: 1 to {MOST_FIELDS} different fields"));
        if !(1..=MOST_FIELDS).contains(&vary.len()) {
            return fields(format!("{} of them", vary.len()));
        }
        if let Some(k) = (1..vary.len()).find(|k| vary[..*k].iter().any(|b| vary[*k].path == b.path)) {
            return fields(format!("{} twice", vary[k].path));
        }
        if let Some((Vary { path, .. }, value)) = vary.iter().find_map(|field| Some((field, field.repeated()?))) {
            return wrong(format!(
                "--vary {path}: found the value {value} twice, allowed: each once; a field that does not vary goes \
                 with --set {path}={value}"
            ));
        }
        let of_grid = || vary.iter().map(|field| field.values.len()).fold(1, usize::saturating_mul);
        let count = settings.draws.unwrap_or_else(of_grid);
        if !(1..=MOST_VARIANTS).contains(&count) {
            return wrong(format!(
                "--vary: found {count} variants, allowed: 1 to {MOST_VARIANTS}; fewer values, or --draws N"
            ));
        }
        let variants = settings.draws.map_or_else(|| grid(vary), |count| filling(vary, count, settings.seed));
        let by = HowComputed::Sheet { torque_n_m, positions };
        let columns = vary.iter().map(|field| field.path.clone()).collect();
        VariantPlan::new((drive, stated), generators, (columns, variants), by, settings.mesh).makes_drives("--vary")
    }

    /// Refuses a plan none of whose variants makes a drive, before anything is computed; `from` has its fields.
    fn makes_drives(self, from: &str) -> Result<VariantPlan, PlanError> {
        let plan = &self;
        let of_variant = |k: usize| plan.generators.iter().map(move |kind| plan.drive_of(k, *kind));
        let mut drives = (0..plan.variants.len()).flat_map(of_variant);
        match drives.next() {
            Some(Err(why)) if drives.all(|drive| drive.is_err()) => {
                Err(PlanError::BadInput(format!("{from}: no variant makes a drive; the first: {why}")))
            }
            _ => Ok(self),
        }
    }

    /// A plan of drives drawn from tolerances: influence kernels and responses by FEM.
    ///
    /// # Errors
    /// An option is out of bounds, the middle of the tolerances makes no drive, or the FEM finds no equilibrium.
    pub fn of_tolerances(
        of: &Tolerances,
        settings: PlanSettings,
        progress: &SweepProgress<'_>,
    ) -> Result<VariantPlan, PlanError> {
        let draws = settings.draws.unwrap_or_default();
        if !(LEAST_DRAWS..=MOST_VARIANTS).contains(&draws) {
            return Err(PlanError::BadInput(format!(
                "--draws: found {draws}, allowed: {LEAST_DRAWS} to {MOST_VARIANTS}"
            )));
        }
        let drawn = draw(&of.list, draws, settings.seed);
        let split = |set: String| set.split_once('=').map(|(path, value)| (path.to_owned(), value.to_owned()));
        let lines = drawn.iter().map(|one| sets(&of.list, one).into_iter().filter_map(split).unzip());
        let (columns, variants): (Vec<Vec<String>>, Vec<Vec<String>>) = lines.unzip();
        let columns = columns.into_iter().next().unwrap_or_default();
        let by = respond(of, SolverSettings::fast(settings.mesh), progress)?;
        Ok(VariantPlan::new((&of.drive, None), &[of.generator], (columns, variants), by, settings.mesh))
    }

    pub(super) fn new(
        (drive, stated): (&Drive, Option<&Stated>),
        generators: &[GeneratorKind],
        (columns, variants): (Vec<String>, Vec<Vec<String>>),
        by: HowComputed,
        mesh: MeshLevel,
    ) -> VariantPlan {
        let (drive, stated, generators) = (drive.clone(), stated.cloned(), generators.to_vec());
        VariantPlan { drive, stated, generators, mesh, by, columns, variants, hash: String::new() }
    }

    /// The assignments PATH=VALUE of variant `k`, from 0.
    pub fn sets(&self, k: usize) -> Vec<String> {
        self.columns.iter().zip(&self.variants[k]).map(|(path, value)| format!("{path}={value}")).collect()
    }

    /// Variant `k`, from 0, as a drive with this generator.
    ///
    /// # Errors
    /// Its values make no drive.
    pub(super) fn drive_of(&self, k: usize, kind: GeneratorKind) -> Result<Drive, DriveError> {
        self.drive.with_sets_for(&[kind], self.sets(k).iter().map(String::as_str))
    }

    /// Names of the figures, in the order of the columns of results.
    pub fn figures(&self) -> Vec<&'static str> {
        match self.by {
            HowComputed::Sheet { .. } => {
                LOADS.into_iter().chain(data_sheet::FIGURES.iter().map(|(name, _)| *name)).collect()
            }
            HowComputed::Kernels { .. } => model::FIGURES.to_vec(),
        }
    }

    /// The place of a figure in a row.
    pub fn figure(&self, name: &str) -> Option<usize> {
        self.figures().iter().position(|known| *known == name)
    }

    /// Whether drives are drawn from tolerances.
    pub fn is_of_tolerances(&self) -> bool {
        matches!(self.by, HowComputed::Kernels { .. })
    }

    /// The model of a plan of tolerances; none of a plan of fields.
    pub(super) fn model(&self) -> Option<KernelModel> {
        let HowComputed::Kernels { torques_n_m, kernels, response } = &self.by else { return None };
        Some(KernelModel::new(kernels, response.clone(), *torques_n_m))
    }

    /// Distance of the axes that the kernels reach, µm.
    pub(super) fn reach_um(&self) -> f64 {
        let HowComputed::Kernels { kernels, .. } = &self.by else { return f64::INFINITY };
        kernels.eccentric.sizes_um.last().copied().unwrap_or(f64::INFINITY)
    }

    /// The loads of the data sheet of a variant.
    pub(super) fn loads(&self, drive: &Drive, kind: GeneratorKind, torque_n_m: Option<f64>) -> Loads {
        let of_size_n_m = drive.rated_torque_n_m(kind);
        match &self.stated {
            Some(stated) if torque_n_m.is_none() => stated.loads(of_size_n_m),
            _ => Loads::up_to(torque_n_m.unwrap_or(of_size_n_m)),
        }
    }

    /// The contents of both files.
    fn texts(&self) -> Result<[Vec<u8>; 2], PlanError> {
        let recipe = Recipe {
            schema_version: SCHEMA,
            tool_version: env!("CARGO_PKG_VERSION").to_owned(),
            drive_toml: self.drive.to_toml() + &self.stated.as_ref().map_or_else(String::new, Stated::to_toml),
            generators: self.generators.clone(),
            mesh: self.mesh,
            by: self.by.clone(),
        };
        let mut json = serde_json::to_vec(&recipe).map_err(|error| PlanError::Failed(format!("plan: {error}")))?;
        json.push(b'\n');
        let line = |first: String, cells: &[String]| [&[first], cells].concat();
        let lines = self.variants.iter().enumerate().map(|(k, values)| line((k + 1).to_string(), values));
        Ok([csv_of([line(NUMBER.to_owned(), &self.columns)].into_iter().chain(lines))?, json])
    }

    /// Writes both files, and reads them as every shard will. A folder with results of another plan keeps them.
    ///
    /// # Errors
    /// The folder holds results of another plan, or cannot be written.
    pub fn write(&self, folder: &Path) -> Result<VariantPlan, PlanError> {
        let paths = ["plan.csv", "plan.json"].map(|name| folder.join(name));
        let texts = self.texts()?;
        let is_same = paths.iter().zip(&texts).all(|(path, text)| fs::read(path).is_ok_and(|there| there == *text));
        let count = fs::read_dir(folder.join("results")).map_or(0, Iterator::count);
        if !is_same && count > 0 {
            return Err(PlanError::BadInput(format!(
                "--out: found {}, which holds {count} files of results of another plan; give another folder, or \
                 remove it",
                folder.display()
            )));
        }
        let mut outputs = Outputs::new();
        for (path, text) in paths.iter().zip(&texts) {
            outputs.file(path, |file| file.write_all(text))?;
        }
        outputs.finish()?;
        VariantPlan::read(folder)
    }

    /// Reads the plan of a folder.
    ///
    /// # Errors
    /// There is none, it is not sound, or another version of the program made it: file, line and what is wrong.
    pub fn read(folder: &Path) -> Result<VariantPlan, PlanError> {
        let [csv, json] = ["plan.csv", "plan.json"].map(|name| folder.join(name));
        let text_of = |path: &Path| {
            let hint = "`flexspline sweep plan ... --out DIR` writes one";
            fs::read_to_string(path)
                .map_err(|error| PlanError::BadInput(format!("{}: {error}; {hint}", path.display())))
        };
        let (csv_text, json_text) = (text_of(&csv)?, text_of(&json)?);
        let wrong = |what: String| PlanError::BadInput(format!("{}: {what}", json.display()));
        let recipe: Recipe = serde_json::from_str(&json_text).map_err(|error| wrong(error.to_string()))?;
        if (recipe.schema_version, recipe.tool_version.as_str()) != (SCHEMA, env!("CARGO_PKG_VERSION")) {
            return Err(wrong(format!(
                "made by version {}, allowed: {}, which is running; plan anew",
                recipe.tool_version,
                env!("CARGO_PKG_VERSION")
            )));
        }
        let drive = Drive::from_toml("drive_toml", &recipe.drive_toml).map_err(|error| wrong(error.to_string()))?;
        let stated = Stated::of_file("drive_toml", &recipe.drive_toml).map_err(|error| wrong(error.to_string()))?;
        if let HowComputed::Kernels { kernels, response, .. } = &recipe.by {
            kernels.check().map_err(|problem| wrong(problem.to_string()))?;
            if recipe.generators.len() != 1 || !response.fits() {
                return Err(wrong("not one generator, or no response; plan anew".to_owned()));
            }
        }
        let (columns, variants) = variants_of(&csv, &csv_text)?;
        let mut hasher = blake3::Hasher::new();
        hasher.update(json_text.as_bytes()).update(csv_text.as_bytes());
        let hash = hasher.finalize().to_hex().as_str()[..16].to_owned();
        let Recipe { generators, mesh, by, .. } = recipe;
        let plan = VariantPlan { drive, stated, generators, mesh, by, columns, variants, hash };
        plan.makes_drives(&csv.display().to_string())
    }
}

/// Records as lines of CSV.
pub(super) fn csv_of(records: impl IntoIterator<Item = Vec<String>>) -> Result<Vec<u8>, PlanError> {
    let failed = |error: csv::Error| PlanError::Failed(format!("CSV: {error}"));
    let mut to = csv::Writer::from_writer(Vec::new());
    records.into_iter().try_for_each(|record| to.write_record(record)).map_err(failed)?;
    to.into_inner().map_err(|error| failed(error.into_error().into()))
}

/// Columns and variants of `plan.csv`.
fn variants_of(file: &Path, text: &str) -> Result<(Vec<String>, Vec<Vec<String>>), PlanError> {
    let wrong = |what: String| Err(PlanError::BadInput(format!("{}:{what}", file.display())));
    let reader = csv::ReaderBuilder::new().has_headers(false).from_reader(text.as_bytes());
    let records = match reader.into_records().collect::<Result<Vec<csv::StringRecord>, csv::Error>>() {
        Ok(records) => records,
        Err(error) => return wrong(format!(" {error}")),
    };
    let mut lines = records.iter().map(|line| line.iter().map(str::to_owned).collect::<Vec<String>>());
    let header = lines.next().unwrap_or_default();
    if header.first().is_none_or(|first| first != NUMBER) || header.len() < 2 {
        return wrong(format!("1: found {header:?}, allowed: {NUMBER}, then fields of the drive"));
    }
    let variants: Vec<Vec<String>> = lines.collect();
    let is_wrong = |k: &usize| *k >= MOST_VARIANTS || variants[*k][0] != (k + 1).to_string();
    if let Some(k) = (0..variants.len()).find(is_wrong) {
        let (line, found) = (records[k + 1].position().map_or(0, csv::Position::line), &variants[k][0]);
        return wrong(format!("{line}: {NUMBER}: found {found:?}, allowed: 1, 2, 3 and so on, up to {MOST_VARIANTS}"));
    }
    if variants.is_empty() {
        return wrong(" found no variant, allowed: one a line".to_owned());
    }
    Ok((header[1..].to_vec(), variants.into_iter().map(|line| line[1..].to_vec()).collect()))
}
