//! `report.html`, for the commands that write one. The page of another command that stands in the folder is kept under
//! another name.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use flexspline::Table;
use rayon::prelude::*;

use super::{Context, Failure};
use flexspline_base::output::Outputs;
use flexspline_design::tables::TableInfo;
use flexspline_design::tables::validate::Validation;
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::{Method, SolverSettings};
use flexspline_report::animation::{Animation, AnimationError, animate};
use flexspline_report::page::{Page, command_of};
use flexspline_report::{DriveSources, DriveSubject, drive_report, shown_torque_n_m};

/// The page of tables of a drive; with each table, its record if it was made just now, or how it did against fresh FEM.
/// The drives are shown in motion at half of what their tables span.
pub(super) fn of_tables(
    context: &Context,
    (drive, mesh): (&Drive, MeshLevel),
    command_name: &'static str,
    inputs: Vec<(String, String)>,
    known: Vec<(GeneratorKind, Table<'_>, Option<&TableInfo>, Option<&Validation>)>,
) -> Page {
    let shown: Vec<(GeneratorKind, f64)> =
        known.iter().map(|(kind, table, ..)| (*kind, shown_torque_n_m(table))).collect();
    let solver = SolverSettings { mesh, ..SolverSettings::default() };
    let subjects = known.into_iter().zip(in_motion(context, drive, &shown, solver));
    let subjects = subjects.map(|((kind, table, info, validation), animation)| DriveSubject {
        kind,
        table,
        info,
        validation,
        animation,
    });
    let (command, subjects) = (context.command.as_str(), subjects.collect());
    let page = drive_report(DriveSources { drive, command_name, command, inputs, subjects });
    Page { title: context.titled(&page.title), ..page }
}

/// Drives in motion, each under its load (N·m), by the fast solver. One that cannot be shown is said on the page.
pub(super) fn in_motion(
    context: &Context,
    drive: &Drive,
    shown: &[(GeneratorKind, f64)],
    settings: SolverSettings,
) -> Vec<Result<Animation, AnimationError>> {
    let (progress, done) = (context.progress("report"), AtomicUsize::new(0));
    let solver = SolverSettings { method: Method::Fast, ..settings };
    shown
        .par_iter()
        .map(|(kind, torque_n_m)| {
            let made = animate(drive, *kind, *torque_n_m, solver);
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            progress.set(done, shown.len(), &format!("{kind} in motion"));
            made
        })
        .collect()
}

/// The page of every command.
const PAGE: &str = "report.html";

/// Writes the page; a failure that it is stamped with is that of the command.
pub(super) fn write(page: &Page, out: &Path, outputs: &mut Outputs) -> Result<(), Failure> {
    write_to(page, &out.join(PAGE), outputs)
}

/// Writes the page to a file. One of another command that stands there is kept.
pub(super) fn write_to(page: &Page, path: &Path, outputs: &mut Outputs) -> Result<(), Failure> {
    let html = page.html().map_err(|error| Failure::Failed(format!("{}: {error}", path.display())))?;
    if let Ok(standing) = std::fs::read(path) {
        let written_by = command_of(&String::from_utf8_lossy(&standing)).unwrap_or_else(|| "other".to_owned());
        if written_by != page.command_name {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            let kept = path.with_file_name(format!("{stem}-{written_by}.html"));
            outputs.file(&kept, |file| file.write_all(&standing))?;
        }
    }
    outputs.file(path, |file| file.write_all(html.as_bytes()))?;
    Ok(())
}

/// The failure that a page is stamped with.
pub(super) fn stamped(page: &Page, out: &Path) -> Result<(), Failure> {
    if !page.status.is_failure() {
        return Ok(());
    }
    Err(Failure::Failed(format!(
        "{}: {}; see {}",
        page.status.name(),
        page.remarks.join(" "),
        out.join("report.html").display()
    )))
}
