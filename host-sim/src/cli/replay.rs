//! `flexspline replay`: the core over measured rows.

use std::path::{Path, PathBuf};

use clap::Args;
use flexspline::Table;

use super::context::{Context, image_file, quoted, table_of};
use super::logs::LogOptions;
use super::{Failure, bad_input, say};
use flexspline_base::output::Outputs;
use flexspline_identify::calibrate::CalibrationFile;
use flexspline_identify::measurement::bytes_of;
use flexspline_identify::replay::{ReplaySummary, RowsRead, read, replay};
use flexspline_mechanics::drive::GeneratorKind;

/// Run the core over measured rows, open loop, and show the residual
///
/// Reads a table image and a CSV with generator_rad and output_rad (or error_arcsec), optionally torque_n_m and
/// temperature_c, or a log with other columns (--columns). Writes replay.csv, with prediction, residual and quality of
/// each row, and summary.json.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline replay --tables out/cam.fxt measured.csv
  flexspline replay --tables out/calibrated.fxt bench.log --columns generator=#2:turn,output=#3:deg")]
pub(super) struct Replay {
    /// Table image, as `flexspline tables` writes it
    #[arg(long, value_name = "FILE.fxt")]
    tables: PathBuf,
    /// Measured rows: CSV with generator_rad (rad), output_rad (rad) or error_arcsec, and if wanted torque_n_m,
    /// temperature_c
    #[arg(value_name = "DATA.csv")]
    data: PathBuf,
    #[command(flatten)]
    logs: LogOptions,
    /// Temperature where the data has none, degrees C
    #[arg(long, value_name = "T", default_value_t = 20.0, allow_negative_numbers = true)]
    temperature_c: f64,
}

impl Replay {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        context.refuse_drive("the drive is that of the table; allowed: --tables FILE.fxt")?;
        let image = image_file(&self.tables)?;
        let table = table_of(&self.tables, &image)?;
        // Found out before the rows are read.
        context.out()?;
        let RowsRead { rows, faults, notes } = measured(&self.data, &self.logs, &table, self.temperature_c, true)?;
        let (replayed, mut summary) = replay(&table, &rows, CalibrationFile::read(&self.tables, &table));
        (summary.data_faults, summary.notes) = (faults, notes);
        summary.command.clone_from(&context.command);
        let out = context.out()?;
        let mut outputs = Outputs::new();
        outputs.csv(&out.join("replay.csv"), &replayed)?;
        outputs.json(&out.join("summary.json"), &summary)?;
        outputs.finish()?;
        context.print(&summary, || text(&summary, out) + &say::next(&self.next(context)))
    }

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

/// The rows of a log, checked as those of a diagnosis; `on_zero` as [`read`] takes it.
pub(super) fn measured(
    data: &Path,
    logs: &LogOptions,
    table: &Table<'_>,
    temperature_c: f64,
    on_zero: bool,
) -> Result<RowsRead, Failure> {
    let (file, bytes) = bytes_of(data).map_err(bad_input)?;
    read(&file, bytes, &logs.map()?, table, temperature_c, on_zero).map_err(bad_input)
}

fn text(summary: &ReplaySummary, out: &std::path::Path) -> String {
    let faults = summary.data_faults.iter().map(|fault| format!("data fault: {}\n", fault.what));
    let notes = summary.notes.iter().map(|note| format!("note: {note}\n"));
    let remarks = summary.remarks.iter().map(|remark| format!("remark: {remark}\n"));
    let remarks: String = faults.chain(notes).chain(remarks).collect();
    let figures = [
        ("error as measured, rms", summary.rms_measured_arcsec),
        ("residual with the table, rms", summary.rms_residual_arcsec),
        ("residual with the table, largest", summary.max_residual_arcsec),
        ("offset of the output, removed", summary.mean_residual_arcsec),
    ];
    let figures: String = figures.iter().map(|(name, value)| format!("  {name:<34}{value:>12.3} arcsec\n")).collect();
    format!(
        "table {}, {} rows, {}\n{remarks}{figures}wrote {} and {}",
        summary.table_id,
        summary.rows,
        summary.status,
        out.join("replay.csv").display(),
        out.join("summary.json").display()
    )
}
