//! `flexspline replay`: the core over measured rows.

use std::path::PathBuf;

use clap::{Args, ValueHint};
use flexspline::Table;

use super::context::{Context, quoted};
use super::{Failure, say};
use crate::drive::GeneratorKind;
use crate::output::Outputs;
use crate::tables::replay::{ReplaySummary, parse, replay};

/// Run the core over measured rows, open loop, and show what it leaves
///
/// Reads a table image and a CSV with generator_rad and output_rad (or error_arcsec), optionally torque_n_m and
/// temperature_c; writes replay.csv, one row for each with the prediction, the residual and its quality, and summary.json.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  flexspline replay --tables out/cam.fxt measured.csv")]
pub(super) struct Replay {
    /// Table image, as `flexspline tables` writes it
    #[arg(long, value_name = "FILE.fxt", value_hint = ValueHint::FilePath)]
    tables: PathBuf,
    /// Measured rows: CSV with generator_rad (rad), output_rad (rad) or error_arcsec, and if wanted torque_n_m, temperature_c
    #[arg(value_name = "DATA.csv", value_hint = ValueHint::FilePath)]
    data: PathBuf,
    /// Temperature where the data has none, degrees C
    #[arg(long, value_name = "T", default_value_t = 20.0, allow_negative_numbers = true)]
    temperature_c: f64,
}

impl Replay {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let read = |path: &PathBuf| {
            std::fs::read(path).map_err(|error| Failure::BadInput(format!("{}: {error}", path.display())))
        };
        let image = read(&self.tables)?;
        let table =
            Table::check(&image).map_err(|error| Failure::BadInput(format!("{}: {error}", self.tables.display())))?;
        let bytes = read(&self.data)?;
        let ratio = table.drive().exact_ratio();
        // Found out before the rows are read.
        context.out()?;
        let rows = parse(&self.data.display().to_string(), &bytes, ratio, self.temperature_c)
            .map_err(|error| Failure::BadInput(error.to_string()))?;
        let (replayed, mut summary) = replay(&table, &rows);
        summary.command.clone_from(&context.command);
        let out = context.out()?;
        let mut outputs = Outputs::new();
        outputs.csv(&out.join("replay.csv"), &replayed)?;
        outputs.json(&out.join("summary.json"), &summary)?;
        outputs.finish()?;
        context.print(&summary, || text(&summary, out) + &say::next(&self.next(context)))
    }
}

impl Replay {
    /// Where a diagnosis of the same data begins, if the image lies as `tables` writes it.
    fn next(&self, context: &Context) -> Vec<String> {
        let generator =
            self.tables.file_name().and_then(|name| name.to_str()).and_then(|name| name.strip_suffix(".fxt"));
        let Some(kind) = generator.and_then(|name| name.parse::<GeneratorKind>().ok()) else { return Vec::new() };
        let folder = self.tables.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.map_or(".".to_owned(), |folder| folder.display().to_string());
        let data = quoted(&self.data.display().to_string());
        vec![context.next(&format!("diagnose {data} --tables {} --generator {kind}", quoted(&folder)))]
    }
}

fn text(summary: &ReplaySummary, out: &std::path::Path) -> String {
    format!(
        "table {}, {} rows, {}\n  error as measured, rms              {:>12.3} arcsec\n  left by the table, rms             {:>12.3} \
         arcsec\n  left by the table, largest         {:>12.3} arcsec\n  zero of the output, taken out      {:>12.3} arcsec\nwrote {} \
         and {}",
        summary.table_id,
        summary.rows,
        summary.status,
        summary.rms_measured_arcsec,
        summary.rms_residual_arcsec,
        summary.max_residual_arcsec,
        summary.mean_residual_arcsec,
        out.join("replay.csv").display(),
        out.join("summary.json").display()
    )
}
