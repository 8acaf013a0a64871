//! `report.html`, for the commands that write one.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Mutex;

use flexspline::Table;
use rayon::prelude::*;

use super::{Context, Failure};
use crate::diagnosis::Extended;
use crate::diagnosis::report::Diagnosis;
use crate::drive::{Drive, GeneratorKind};
use crate::measurement::Recording;
use crate::nominal::Nominal;
use crate::output::Outputs;
use crate::report::animation::{Animation, AnimationError, animate};
use crate::report::diagnosis_report::{self, Sources};
use crate::report::page::Page;
use crate::report::shown_torque_n_m;
use crate::stepping::{Method, SolverSettings};

/// The drives of tables in motion, each at half of what its table spans.
pub(super) fn animations(
    context: &Context,
    drive: &Drive,
    tables: &[(GeneratorKind, Table<'_>)],
    settings: SolverSettings,
) -> Vec<Result<Animation, AnimationError>> {
    let shown: Vec<(GeneratorKind, f64)> =
        tables.iter().map(|(kind, table)| (*kind, shown_torque_n_m(table))).collect();
    in_motion(context, drive, &shown, settings)
}

/// Drives in motion, each under its load (N·m), by the fast solver. One that cannot be shown is said on the page.
pub(super) fn in_motion(
    context: &Context,
    drive: &Drive,
    shown: &[(GeneratorKind, f64)],
    settings: SolverSettings,
) -> Vec<Result<Animation, AnimationError>> {
    let progress = Mutex::new((context.progress("report"), 0));
    let solver = SolverSettings { method: Method::Fast, ..settings };
    shown
        .par_iter()
        .map(|(kind, torque_n_m)| {
            let made = animate(drive, *kind, *torque_n_m, solver, &mut || ControlFlow::Continue(()));
            if let Ok(mut guard) = progress.lock() {
                guard.1 += 1;
                let done = guard.1;
                guard.0.set(done, shown.len(), &format!("{kind} in motion"));
            }
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
    extended: &Extended,
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
    diagnosis_report::page(Sources { recording, nominal, diagnosis, levels, parts, command, inputs })
}

/// Writes the page; a failure that it is stamped with is that of the command.
pub(super) fn write(page: &Page, out: &Path, outputs: &mut Outputs) -> Result<(), Failure> {
    write_to(page, &out.join("report.html"), outputs)
}

/// Writes the page to a file.
pub(super) fn write_to(page: &Page, path: &Path, outputs: &mut Outputs) -> Result<(), Failure> {
    let html = page.html().map_err(|error| Failure::Failed(format!("{}: {error}", path.display())))?;
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
