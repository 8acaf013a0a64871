//! `flexspline validate`: tables against fresh FEM, through the core.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use clap::Args;
use flexspline::Table;
use rayon::prelude::*;
use serde::Serialize;

use super::context::{Context, image_file, quoted, table_of};
use super::names::GeneratorNames;
use super::{Failure, bad_file, report, say};
use flexspline_base::output::Outputs;
use flexspline_design::tables::MissingSpring;
use flexspline_design::tables::validate::{
    MAX_BOUND_ARCSEC, RMS_BOUND_ARCSEC, ValidateError, Validation, ValidationSettings, check_drive, validate,
};
use flexspline_mechanics::drive::GeneratorKind;
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::{Method, SolverSettings};

/// Compare tables with new FEM runs at points that were not used to make them
///
/// Torques, temperatures, directions and positions are drawn between the nodes of each table. The FEM settles the drive
/// there, and the table is read by the code that firmware links. One run is reversed through the backlash. Exit code 1
/// if a table differs from the FEM by more than 0.5 arcsec rms or 2 arcsec at any point. The table of a drive with
/// imperfections is checked over whole turns, and may differ in addition by 1.5 times its own stated error. Of a table
/// that a data sheet completed, what the sheet added is added to the FEM: its JSON says what.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline validate --tables out
  flexspline validate --tables out --generator cam --torques 24 --seed 7")]
pub(super) struct Validate {
    /// Folder with <G>.fxt files written by `tables`
    #[arg(long, value_name = "DIR")]
    tables: PathBuf,
    /// Wave generator: two-roller, four-roller, double-disc, cam, or all in the folder
    #[arg(short, long, value_name = "G", default_value = "all")]
    generator: GeneratorNames,
    /// Number of torques per table, 2 to 1000
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u16).range(2..=1000))]
    torques: u16,
    /// Number of positions per torque, 1 to 100
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..=100))]
    positions: u16,
    /// Number of temperatures per table, 1 to 100
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..=100))]
    temperatures: u16,
    /// Random seed of these points
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Mesh of the new FEM runs: coarse, standard or fine
    #[arg(long, value_name = "LEVEL", default_value = "standard")]
    mesh: MeshLevel,
    /// Solver of the new FEM runs: reference or fast
    #[arg(long, value_name = "SOLVER", default_value = "reference")]
    solver: Method,
    /// Do not write report.html (validation.html if the page of the tables is in the same folder), which takes a FEM
    /// run over one more tooth pitch for each generator
    #[arg(long)]
    no_report: bool,
}

/// `validation.json`.
#[derive(Serialize)]
struct ValidationReport {
    schema_version: u32,
    status: &'static str,
    rms_bound_arcsec: f64,
    max_bound_arcsec: f64,
    drive: String,
    drive_blake3: String,
    mesh: String,
    seed: u64,
    command: String,
    tables: Vec<Validation>,
}

/// A data sheet's addition to a table, which the FEM does not have: stated in the JSON next to the image.
fn added_spring(path: &Path, table: &Table<'_>) -> Result<Option<MissingSpring>, Failure> {
    if table.sheet_scatter().is_none() {
        return Ok(None);
    }
    let json = path.with_extension("json");
    let written = std::fs::read(&json).ok().and_then(|bytes| serde_json::from_slice::<serde_json::Value>(&bytes).ok());
    let written = written.filter(|written| written["table_id"] == table.id().to_string());
    let spring = written.and_then(|mut written| serde_json::from_value(written["completed"]["spring"].take()).ok());
    spring.map(Some).ok_or_else(|| {
        let (path, json) = (path.display(), json.display());
        Failure::BadInput(format!(
            "{path}: a data sheet completed this table, and what it added is in {json}, which is missing or of another \
             table; allowed: both files as `flexspline tables` wrote them"
        ))
    })
}

impl Validate {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let drive = context.drive()?;
        let images = self.images()?;
        let checked = images.iter().map(|(path, image)| {
            let table = table_of(path, image)?;
            let kind = check_drive(&drive, &table).map_err(bad_file(path))?;
            Ok((kind, table, added_spring(path, &table)?))
        });
        let checked = checked.collect::<Result<Vec<_>, Failure>>()?;
        let out = context.out()?;
        let settings = ValidationSettings {
            torques: usize::from(self.torques),
            temperatures: usize::from(self.temperatures),
            positions: usize::from(self.positions),
            seed: self.seed,
            solver: SolverSettings { method: self.solver, mesh: self.mesh, ..SolverSettings::default() },
            spring: None,
        };
        let progress = Mutex::new((context.progress("validate"), vec![(0, 0); checked.len()]));
        let tables = checked
            .par_iter()
            .enumerate()
            .map(|(k, (kind, table, spring))| {
                let settings = ValidationSettings { spring: *spring, ..settings };
                validate(&drive, table, &settings, &mut |done, total| {
                    if let Ok(mut guard) = progress.lock() {
                        let (bar, counts) = &mut *guard;
                        counts[k] = (done, total);
                        let done = counts.iter().map(|c| c.0).sum();
                        let guess = counts.iter().map(|c| c.1.max(total)).sum();
                        bar.set(done, guess, kind.name());
                    }
                })
                .map_err(|error| {
                    let what = format!("{}: {error}", images[k].0.display());
                    match error {
                        ValidateError::OtherDrive { .. } | ValidateError::UnknownGenerator => Failure::BadInput(what),
                        _ => Failure::Failed(what),
                    }
                })
            })
            .collect::<Result<Vec<Validation>, Failure>>()?;
        let passed = tables.iter().all(|table| table.status == "passed");
        let report = ValidationReport {
            schema_version: 1,
            status: if passed { "passed" } else { "bound missed" },
            rms_bound_arcsec: RMS_BOUND_ARCSEC,
            max_bound_arcsec: MAX_BOUND_ARCSEC,
            drive: drive.name.clone(),
            drive_blake3: blake3::Hash::from(drive.hash()).to_hex().to_string(),
            mesh: self.mesh.to_string(),
            seed: self.seed,
            command: context.command.clone(),
            tables,
        };
        drop(progress);
        let mut outputs = Outputs::new();
        outputs.json(&out.join("validation.json"), &report)?;
        if !self.no_report {
            let hashed = |(path, image): &(PathBuf, Vec<u8>)| {
                (format!("BLAKE3 of {}", path.display()), blake3::hash(image).to_hex().to_string())
            };
            let fresh = format!("{} solver, {} mesh, seed {}", self.solver, self.mesh, self.seed);
            let inputs = images.iter().map(hashed).chain([("Fresh FEM".to_owned(), fresh)]).collect();
            let known =
                checked.iter().zip(&report.tables).map(|((kind, table, _), found)| (*kind, *table, None, Some(found)));
            let page = report::of_tables(context, (&drive, self.mesh), "validate", inputs, known.collect());
            report::write_to(&page, &page_path(out, &self.tables), &mut outputs)?;
        }
        outputs.finish()?;
        context.print(&report, || {
            let tables = quoted(&self.tables.display().to_string());
            let next = format!("diagnose DATA.csv --tables {tables} --generator {}", report.tables[0].generator);
            let next = if passed { say::next(&[context.next(&next)]) } else { String::new() };
            let page = (!self.no_report).then(|| page_path(out, &self.tables));
            text(&report, out, page.as_deref()) + &next
        })?;
        if passed {
            Ok(())
        } else {
            let missed = report.tables.iter().find(|table| table.status != "passed");
            let [rms, max] = missed
                .map_or([RMS_BOUND_ARCSEC, MAX_BOUND_ARCSEC], |table| [table.rms_bound_arcsec, table.max_bound_arcsec]);
            let rounded = |x: f64| (x * 1e3).round() / 1e3;
            Err(Failure::Failed(format!(
                "a table misses fresh FEM by more than {} arcsec rms or {} arcsec; see validation.json",
                rounded(rms),
                rounded(max)
            )))
        }
    }

    /// The images in the folder.
    fn images(&self) -> Result<Vec<(PathBuf, Vec<u8>)>, Failure> {
        let wanted = self.generator.0.as_slice();
        let path = |kind: &GeneratorKind| self.tables.join(format!("{kind}.fxt"));
        let present: Vec<PathBuf> = wanted.iter().map(path).filter(|p| p.exists() || wanted.len() == 1).collect();
        if present.is_empty() {
            return Err(Failure::BadInput(format!(
                "--tables: found no <generator>.fxt in {}; allowed: a folder that `flexspline tables` wrote",
                self.tables.display()
            )));
        }
        present.into_iter().map(|path| image_file(&path).map(|bytes| (path, bytes))).collect()
    }
}

/// Where the page goes: not over that of the tables, where both have one folder.
fn page_path(out: &Path, tables: &Path) -> PathBuf {
    let same = || Some(out.canonicalize().ok()? == tables.canonicalize().ok()?);
    out.join(if same() == Some(true) { "validation.html" } else { "report.html" })
}

fn text(report: &ValidationReport, out: &Path, page: Option<&Path>) -> String {
    let mut text = String::from(
        "generator    table_id          points  rms\"    max\"    reversal rms\"  max\"    without table, rms\"\n",
    );
    for t in &report.tables {
        text.push_str(&format!(
            "{:<12} {:<17} {:>6}  {:<6.3}  {:<6.3}  {:<13.3}  {:<6.3}  {:<8.2}  {}\n",
            t.generator,
            t.table_id,
            t.points.len(),
            t.rms_arcsec,
            t.max_arcsec,
            t.reversal_rms_arcsec,
            t.reversal_max_arcsec,
            t.uncompensated_rms_arcsec,
            t.status
        ));
    }
    text.push_str(&format!("wrote {}", out.join("validation.json").display()));
    if let Some(page) = page {
        text.push_str(&format!(" and {}, for any browser", page.display()));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_of_the_tables_is_not_written_over() {
        let folder = std::env::temp_dir().join(format!("flexspline-validate-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("tables")).unwrap();
        let tables = folder.join("tables");
        assert_eq!(page_path(&tables.join("../tables"), &tables).file_name().unwrap(), "validation.html");
        assert_eq!(page_path(&folder, &tables), folder.join("report.html"));
        assert_eq!(page_path(&folder, &folder.join("nowhere")), folder.join("report.html"));
        std::fs::remove_dir_all(folder).unwrap();
    }
}
