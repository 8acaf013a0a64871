//! A shard: some of the drives of a plan, in one Parquet file.
//!
//! Columns `drive` and `generator` (whole numbers from 0), what was drawn (a column for each tolerance, and one for its
//! phase), the figures by kernels, and those by FEM, which are not a number where there are none. The file's metadata
//! hold the hash of the plan, the number of the shard, of its rows, and a BLAKE3 of all columns. A file is written
//! whole, under another name, and then renamed.

use std::fs::{self, File};
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{Compression, Encoding, Repetition, Type as PhysicalType};
use parquet::column::reader::ColumnReader;
use parquet::column::writer::ColumnWriter;
use parquet::data_type::{DoubleType, Int32Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use rayon::prelude::*;
use thiserror::Error;

use super::by_fem::{self, FEM_FIGURES};
use super::draw::Draw;
use super::model::{FIGURES, Model};
use super::plan::Plan;
use flexspline_base::output::{OutputError, write_whole};

/// Keys of the metadata.
const HASH: &str = "flexspline.plan_hash";
const SHARD: &str = "flexspline.shard";
const ROWS: &str = "flexspline.rows";
const CHECKSUM: &str = "flexspline.blake3";

/// The rows of a shard, column by column.
#[derive(Debug, Clone, PartialEq)]
pub struct Shard {
    /// Number of the drive.
    pub drive: Vec<i32>,
    /// Number of the generator.
    pub generator: Vec<i32>,
    /// The other columns: what was drawn, phases, figures by kernels and by FEM.
    pub columns: Vec<Vec<f64>>,
}

/// What stands where a shard should.
#[derive(Debug)]
pub enum ShardState {
    /// Nothing.
    Missing,
    /// The shard.
    Valid(Shard),
    /// A file that is not whole, and why.
    Damaged(String),
    /// A sound file of another plan or another shard, and which.
    Foreign(String),
}

/// Why a shard was not written.
#[derive(Debug, Error)]
pub enum ShardError {
    /// A file of another plan stands in its place.
    #[error("{}: {what}; it was left as it is: remove it, or run the campaign in another folder", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// Whose it is.
        what: String,
    },
    /// It cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The plan's drive is none.
    #[error("{0}")]
    Plan(String),
}

/// What became of a shard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Became {
    /// It was there already, and sound.
    There,
    /// It was computed.
    Computed,
    /// A damaged file was replaced.
    Redone,
}

/// Its file in a campaign's folder.
pub fn path(folder: &Path, shard: u32) -> PathBuf {
    folder.join("shards").join(format!("{shard:04}.parquet"))
}

/// The first two columns.
pub(crate) const OWN_COLUMNS: [&str; 2] = ["drive", "generator"];

/// Names of all columns but the first two.
pub(crate) fn column_names(plan: &Plan) -> Vec<String> {
    let values = plan.tolerances.iter().map(|t| t.name.clone());
    let phases = plan.tolerances.iter().filter_map(|t| t.phase_column());
    let figures = FIGURES.iter().chain(&FEM_FIGURES).map(|name| (*name).to_owned());
    values.chain(phases).chain(figures).collect()
}

/// Computes a shard unless it is there; `redo` computes and replaces one that is damaged.
///
/// # Errors
/// A shard of another plan is in its place, or it cannot be written.
pub fn run_shard(
    plan: &Plan,
    hash: &[u8; 32],
    models: &[Model],
    folder: &Path,
    shard: u32,
    told: &(dyn Fn() + Sync),
) -> Result<Became, ShardError> {
    let path = path(folder, shard);
    let became = match look(plan, hash, folder, shard) {
        ShardState::Valid(_) => return Ok(Became::There),
        ShardState::Foreign(what) => return Err(ShardError::Foreign { path, what }),
        ShardState::Damaged(_) => Became::Redone,
        ShardState::Missing => Became::Computed,
    };
    let rows = compute(plan, hash, models, shard, told)?;
    let bytes = encode(plan, hash, shard, &rows)
        .map_err(|error| ShardError::Output(OutputError { path: path.clone(), source: io::Error::other(error) }))?;
    write_whole(&path, |file| file.write_all(&bytes))?;
    Ok(became)
}

fn compute(
    plan: &Plan,
    hash: &[u8; 32],
    models: &[Model],
    shard: u32,
    told: &(dyn Fn() + Sync),
) -> Result<Shard, ShardError> {
    let drawn_as = plan.drive().map_err(|error| ShardError::Plan(error.to_string()))?;
    let draw = Draw::of_plan(hash);
    let drives: Vec<u32> = plan.drives_of(shard).collect();
    let rows: Vec<Vec<Vec<f64>>> = drives
        .par_iter()
        .with_max_len(1)
        .map(|i| {
            let drawn = draw.drive(&plan.tolerances, plan.teeth(), *i);
            let built = (*i < plan.fem_drives).then(|| drawn.drive(&drawn_as, &plan.tolerances).ok()).flatten();
            let rows = models.iter().enumerate().map(|(g, model)| {
                let phases = plan.tolerances.iter().zip(&drawn.phases_deg).filter(|(t, _)| t.acts.has_phase());
                let mut row: Vec<f64> = drawn.values.iter().copied().chain(phases.map(|(_, phase)| *phase)).collect();
                row.extend(model.figures(&drawn));
                // A drive that the FEM cannot deform or load is one without figures of it; `reduce` counts them.
                let by_fem = built
                    .as_ref()
                    .and_then(|drive| by_fem::figures(drive, plan.conditions(g), model.fem_angles_rad()).ok());
                row.extend(by_fem.unwrap_or([f64::NAN; FEM_FIGURES.len()]));
                row
            });
            let rows = rows.collect();
            told();
            rows
        })
        .collect();
    let generators = models.len();
    let each = || drives.iter().flat_map(|i| (0..generators).map(move |g| (*i as i32, g as i32)));
    let count = column_names(plan).len();
    Ok(Shard {
        drive: each().map(|(i, _)| i).collect(),
        generator: each().map(|(_, g)| g).collect(),
        columns: (0..count).map(|c| rows.iter().flatten().map(|row| row[c]).collect()).collect(),
    })
}

impl Shard {
    /// BLAKE3 of all columns, little-endian, one after the other.
    fn checksum(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        for whole in [&self.drive, &self.generator] {
            for x in whole {
                hasher.update(&x.to_le_bytes());
            }
        }
        for column in &self.columns {
            for x in column {
                hasher.update(&x.to_bits().to_le_bytes());
            }
        }
        hasher.finalize().to_hex().to_string()
    }
}

fn hex(hash: &[u8; 32]) -> String {
    blake3::Hash::from_bytes(*hash).to_hex().to_string()
}

fn encode(plan: &Plan, hash: &[u8; 32], shard: u32, rows: &Shard) -> Result<Vec<u8>, ParquetError> {
    let field = |name: &str, physical| {
        Type::primitive_type_builder(name, physical).with_repetition(Repetition::REQUIRED).build().map(Arc::new)
    };
    let mut fields = vec![field(OWN_COLUMNS[0], PhysicalType::INT32)?, field(OWN_COLUMNS[1], PhysicalType::INT32)?];
    for name in column_names(plan) {
        fields.push(field(&name, PhysicalType::DOUBLE)?);
    }
    let schema = Arc::new(Type::group_type_builder("campaign").with_fields(fields).build()?);
    let says = |key: &str, value: String| KeyValue::new(key.to_owned(), value);
    let metadata = vec![
        says(HASH, hex(hash)),
        says(SHARD, shard.to_string()),
        says(ROWS, rows.drive.len().to_string()),
        says(CHECKSUM, rows.checksum()),
    ];
    let properties = WriterProperties::builder()
        .set_compression(Compression::UNCOMPRESSED)
        .set_dictionary_enabled(false)
        .set_encoding(Encoding::PLAIN)
        .set_statistics_enabled(EnabledStatistics::None)
        .set_key_value_metadata(Some(metadata))
        .build();
    let mut bytes = Vec::new();
    let mut writer = SerializedFileWriter::new(&mut bytes, schema, Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    let mut whole = [&rows.drive, &rows.generator].into_iter();
    let mut real = rows.columns.iter();
    while let Some(mut column) = group.next_column()? {
        match column.untyped() {
            ColumnWriter::Int32ColumnWriter(_) => {
                column.typed::<Int32Type>().write_batch(whole.next().map_or(&[][..], |c| c), None, None)?;
            }
            _ => {
                column.typed::<DoubleType>().write_batch(real.next().map_or(&[][..], |c| c), None, None)?;
            }
        }
        column.close()?;
    }
    group.close()?;
    writer.close()?;
    Ok(bytes)
}

/// What stands where a shard should.
pub fn look(plan: &Plan, hash: &[u8; 32], folder: &Path, shard: u32) -> ShardState {
    let path = path(folder, shard);
    let file = match File::open(&path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return ShardState::Missing,
        Err(error) => return ShardState::Damaged(error.to_string()),
    };
    // A reader of Parquet may panic over bytes that are none: that is a damaged file, too.
    match catch_unwind(AssertUnwindSafe(|| decode(plan, hash, shard, file))) {
        Ok(Ok(state)) => state,
        Ok(Err(error)) => ShardState::Damaged(format!("damaged: {error}")),
        Err(_) => ShardState::Damaged("damaged: it cannot be read".to_owned()),
    }
}

fn decode(plan: &Plan, hash: &[u8; 32], shard: u32, file: File) -> Result<ShardState, ParquetError> {
    let reader = SerializedFileReader::new(file)?;
    let metadata = reader.metadata().file_metadata().key_value_metadata().cloned().unwrap_or_default();
    let said = |key: &str| metadata.iter().find(|one| one.key == key).and_then(|one| one.value.clone());
    let Some(theirs) = said(HASH) else {
        return Ok(ShardState::Foreign("no shard of a campaign".to_owned()));
    };
    if theirs != hex(hash) {
        return Ok(ShardState::Foreign(format!(
            "a shard of the plan {:.16}…, and this one is {:.16}…",
            theirs,
            hex(hash)
        )));
    }
    if said(SHARD) != Some(shard.to_string()) {
        let number = said(SHARD).unwrap_or_default();
        return Ok(ShardState::Foreign(format!("shard {number} under the name of shard {shard}")));
    }
    let expected = plan.drives_of(shard).count() * plan.generators.len();
    let mut rows = Shard { drive: Vec::new(), generator: Vec::new(), columns: Vec::new() };
    let damaged = |what: &str| Ok(ShardState::Damaged(format!("damaged: {what}")));
    if reader.num_row_groups() != 1 || said(ROWS) != Some(expected.to_string()) {
        return damaged("not as many rows as the plan says");
    }
    let group = reader.get_row_group(0)?;
    if group.num_columns() != 2 + column_names(plan).len() {
        return damaged("not the columns that the plan says");
    }
    for k in 0..group.num_columns() {
        match group.get_column_reader(k)? {
            ColumnReader::Int32ColumnReader(mut column) if k < 2 => {
                let into = if k == 0 { &mut rows.drive } else { &mut rows.generator };
                column.read_records(expected, None, None, into)?;
            }
            ColumnReader::DoubleColumnReader(mut column) if k >= 2 => {
                let mut values = Vec::with_capacity(expected);
                column.read_records(expected, None, None, &mut values)?;
                rows.columns.push(values);
            }
            _ => return damaged("not the columns that the plan says"),
        }
    }
    let whole = rows.drive.len() == expected && rows.generator.len() == expected;
    if !whole || rows.columns.iter().any(|column| column.len() != expected) {
        return damaged("not as many rows as the plan says");
    }
    if said(CHECKSUM) != Some(rows.checksum()) {
        return damaged("its checksum is not that of its rows");
    }
    Ok(ShardState::Valid(rows))
}

/// Files in the folder of shards that are none of this plan's.
pub(crate) fn strangers(plan: &Plan, folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder.join("shards")) else { return Vec::new() };
    let known: Vec<PathBuf> = (0..plan.shards).map(|shard| path(folder, shard)).collect();
    let is_parquet = |path: &PathBuf| path.extension().is_some_and(|end| end == "parquet");
    let mut found: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(is_parquet)
        .filter(|path| !known.contains(path))
        .collect();
    found.sort();
    found
}
