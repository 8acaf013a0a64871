//! `report.html`, for the commands that write one. The page of another command that stands in the folder is kept under
//! another name.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use flexspline::Table;
use rayon::prelude::*;

use super::{Context, Failure, say};
use flexspline_base::output::Outputs;
use flexspline_design::tables::TableInfo;
use flexspline_design::tables::validate::Validation;
use flexspline_identify::diagnosis::report::Diagnosis;
use flexspline_identify::diagnosis::{Extended, WrittenTable};
use flexspline_identify::measurement::Recording;
use flexspline_identify::nominal::Nominal;
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::{Method, SolverSettings};
use flexspline_report::animation::{Animation, AnimationError, animate};
use flexspline_report::diagnosis_report::{self, DiagnosisSources};
use flexspline_report::page::{Page, WrittenPage};
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
            let made = animate(drive, *kind, *torque_n_m, solver, &mut || ControlFlow::Continue(()));
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            progress.set(done, shown.len(), &format!("{kind} in motion"));
            made
        })
        .collect()
}

/// The page of a diagnosis; `inputs` are the files it was made from.
pub(super) fn diagnosis<'p>(
    context: &Context,
    inputs: impl IntoIterator<Item = Option<&'p Path>>,
    recording: &Recording,
    nominal: &Nominal,
    table: Option<&Table<'_>>,
    diagnosis: &Diagnosis,
    (extended, written): (&Extended, &WrittenTable),
) -> Page {
    let hashed = |path: &Path| {
        let bytes = std::fs::read(path).ok()?;
        Some((format!("BLAKE3 of {}", path.display()), blake3::hash(&bytes).to_string()))
    };
    let mut inputs: Vec<(String, String)> = inputs.into_iter().flatten().filter_map(hashed).collect();
    inputs.extend(table.map(|table| ("table_id".to_owned(), table.id().to_string())));
    let series = extended.predict(&recording.sessions, nominal, table);
    let (levels, parts) = diagnosis_report::levels_and_parts(&series, extended, diagnosis);
    let command = &context.command;
    diagnosis_report::page(DiagnosisSources {
        recording,
        nominal,
        diagnosis,
        table: written,
        levels,
        parts,
        command,
        inputs,
    })
}

/// The page of every command.
const PAGE: &str = "report.html";

/// Says, before there is much work, what becomes of a page that stands where the command `name` is to write one: that
/// of another command is kept under another name, that of the same command is replaced. Of another drive than this that
/// is said, too.
pub(super) fn before(context: &Context, out: &Path, name: &str, drive: Option<&Drive>) {
    if let Some(words) = fate(&out.join(PAGE), name, drive).filter(|_| !context.quiet()) {
        say::talk(&format!("remark: {words}"));
    }
}

/// Note on the fate of a page, where one is needed.
fn fate(path: &Path, name: &str, drive: Option<&Drive>) -> Option<String> {
    let html = std::fs::read_to_string(path).ok()?;
    let found = path.display();
    let Some(written) = WrittenPage::of(&html) else {
        return Some(format!(
            "{found} is none of our pages; once there is a new one it is kept as {}",
            kept(path, None).display()
        ));
    };
    if written.command != name {
        let kept = kept(path, Some(&written));
        let WrittenPage { command, title, .. } = written;
        return Some(format!(
            "{found} is the page of `{command}` ({title}); once there is a new one it is kept as {}",
            kept.display()
        ));
    }
    let other = drive.is_some_and(|drive| !written.names(&blake3::Hash::from(drive.hash()).to_hex()));
    other.then(|| {
        format!("{found} is the page of another drive ({}); it is replaced: --out names another folder", written.title)
    })
}

/// Where the page of another command, or a page that is none of ours, is kept.
fn kept(path: &Path, written: Option<&WrittenPage>) -> PathBuf {
    let of = written.map_or("other", |written| written.command.as_str());
    let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or("report");
    path.with_file_name(format!("{stem}-{of}.html"))
}

/// Writes the page; a failure that it is stamped with is that of the command.
pub(super) fn write(page: &Page, out: &Path, outputs: &mut Outputs) -> Result<(), Failure> {
    write_to(page, &out.join(PAGE), outputs)
}

/// Writes the page to a file. One of another command that stands there is kept.
pub(super) fn write_to(page: &Page, path: &Path, outputs: &mut Outputs) -> Result<(), Failure> {
    let html = page.html().map_err(|error| Failure::Failed(format!("{}: {error}", path.display())))?;
    if let Ok(standing) = std::fs::read(path) {
        let written = WrittenPage::of(&String::from_utf8_lossy(&standing));
        if written.as_ref().is_none_or(|written| written.command != page.command_name) {
            outputs.file(&kept(path, written.as_ref()), |file| file.write_all(&standing))?;
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A page as far as it says whose it is.
    fn of(command: &str, drive: &Drive) -> String {
        let hash = blake3::Hash::from(drive.hash()).to_hex();
        let provenance = serde_json::json!({ "drive_hash": *hash });
        let title = format!("Page of {}", drive.name);
        let json = serde_json::json!({ "report": command, "title": title, "provenance": provenance });
        format!("<script type=\"application/json\" id=\"flexspline-report\">{json}</script>")
    }

    #[test]
    fn a_page_of_another_command_or_drive_is_not_replaced_without_a_word() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(PAGE);
        let (drive, other) = (Drive::hhd_95(), Drive::built_in("CUP-95").unwrap());
        assert_eq!(fate(&path, "sweep", Some(&drive)), None);
        std::fs::write(&path, of("sweep", &drive)).unwrap();
        assert_eq!(fate(&path, "sweep", Some(&drive)), None);
        assert_eq!(fate(&path, "sweep", None), None);
        let replaced = fate(&path, "sweep", Some(&other)).unwrap();
        assert!(replaced.contains("of another drive (Page of HHD-95); it is replaced"), "{replaced}");
        let kept = fate(&path, "simulate", Some(&drive)).unwrap();
        assert!(kept.contains("the page of `sweep` (Page of HHD-95)") && kept.ends_with("report-sweep.html"), "{kept}");
        std::fs::write(&path, "<p>mine").unwrap();
        assert!(fate(&path, "sweep", Some(&drive)).unwrap().ends_with("report-other.html"));
    }
}
