//! `flexspline calibrate`: logs of one unit to its table.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args, ValueHint};
use flexspline::Table;

use super::context::{Context, quoted, table_image};
use super::logs::LogOptions;
use super::{Failure, names, report, say};
use crate::calibrate::{Calibrated, Calibration, CalibrationError, Prior, calibrate};
use crate::drive::GeneratorKind;
use crate::extension::Model;
use crate::measurement::read;
use crate::nominal::Nominal;
use crate::output::Outputs;
use crate::report::calibration_report;
use crate::tables::{c_header, rust_source};

/// Make the table of one unit from its logs, whatever the cause of its error
///
/// Takes what a nominal model or a table says from what was measured, and fits what remains by smooth parts: wind-up by torque, play by
/// direction, curves over generator, tooth and output angle, temperature. A part is kept if it gains in files, sessions or blocks
/// that were left out. Writes calibrated.fxt, .h and .rs, calibration.json and report.html.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("known").required(true).args(["tables", "model", "ratio"]))]
#[command(after_help = "\
Examples:
  flexspline calibrate bench.log --ratio 101 --columns generator=#1:turn,output=#2:deg
  flexspline calibrate monday.csv tuesday.csv --model nominal.toml --out unit7
  flexspline calibrate measured.csv --tables out --generator cam")]
pub(super) struct Calibrate {
    /// Logs of one unit; several files are sessions, each with a zero of its own
    #[arg(value_name = "LOG", value_hint = ValueHint::FilePath, required = true)]
    logs: Vec<PathBuf>,
    /// Folder of tables made by `flexspline tables`: the one of --generator is known before
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    tables: Option<PathBuf>,
    /// Nominal model from the catalogue that is known before
    #[arg(long, value_name = "nominal.toml", value_hint = ValueHint::FilePath)]
    model: Option<PathBuf>,
    /// Generator turns to one of the output, negative if they turn opposite ways, where nothing more is known
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    ratio: Option<f64>,
    /// Wave generator that the table is marked with: two-roller, four-roller, double-disc or cam
    #[arg(long, value_name = "G", default_value = "cam", value_parser = names::generator(), hide_possible_values = true)]
    generator: GeneratorKind,
    #[command(flatten)]
    columns: LogOptions,
    /// Do not write report.html
    #[arg(long)]
    no_report: bool,
}

impl Calibrate {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let map = self.columns.map()?;
        let image = self.tables.as_ref().map(|folder| table_image(folder, self.generator)).transpose()?;
        let table = match &image {
            Some((file, bytes)) => {
                Some(Table::check(bytes).map_err(|error| Failure::BadInput(format!("{}: {error}", file.display())))?)
            }
            None => None,
        };
        let prior = self.prior(table.as_ref())?;
        let gear = prior.nominal.gear();
        let files = self.logs.iter().map(|file| read(file, &map, &gear)).collect::<Result<Vec<_>, _>>();
        let files = files.map_err(|error| Failure::BadInput(error.to_string()))?;
        let out = context.out()?;
        let mut made = calibrate(&files, &prior).map_err(|error| self.failed(&error))?;
        made.calibration.command.clone_from(&context.command);
        made.table.info.command.clone_from(&context.command);
        let mut outputs = Outputs::new();
        let mut put = |name: &str, content: &[u8]| outputs.file(&out.join(name), |file| file.write_all(content));
        put("calibrated.fxt", &made.table.image)?;
        put("calibrated.h", c_header(&made.table).as_bytes())?;
        put("calibrated.rs", rust_source(&made.table).as_bytes())?;
        outputs.json(&out.join("calibration.json"), &made.calibration)?;
        if !self.no_report {
            report::write(&calibration_report::page(&made), out, &mut outputs)?;
        }
        outputs.finish()?;
        context.print(&made.calibration, || text(&made, out, !self.no_report) + &say::next(&self.next(out)))
    }

    /// What went wrong, with the files where the error does not name one.
    fn failed(&self, error: &CalibrationError) -> Failure {
        let files: Vec<String> = self.logs.iter().map(|file| file.display().to_string()).collect();
        let what = match error {
            CalibrationError::Measured(_) | CalibrationError::Known(_) => error.to_string(),
            _ => format!("{}: {error}", files.join(", ")),
        };
        if error.is_bad_input() { Failure::BadInput(what) } else { Failure::Failed(what) }
    }

    fn prior<'t>(&self, table: Option<&'t Table<'t>>) -> Result<Prior<'t>, Failure> {
        if let Some(table) = table {
            let drive = format!("table {}", table.id());
            let hash = *blake3::hash(table.image()).as_bytes();
            return Ok(Prior {
                nominal: Nominal::of_table(table),
                table: Some(table),
                drive,
                hash,
                kind: self.generator,
            });
        }
        if let Some(path) = &self.model {
            let model = Model::read(path).map_err(|error| Failure::BadInput(error.to_string()))?;
            if !model.causes.is_empty() {
                let what = "found [[extension.cause]], allowed: a nominal model without causes; what they are is fitted here anew";
                return Err(Failure::BadInput(format!("{}: {what}", path.display())));
            }
            let bytes =
                std::fs::read(path).map_err(|error| Failure::BadInput(format!("{}: {error}", path.display())))?;
            let (drive, hash) = (path.display().to_string(), *blake3::hash(&bytes).as_bytes());
            return Ok(Prior { nominal: model.nominal, table: None, drive, hash, kind: self.generator });
        }
        let ratio = self.ratio.unwrap_or_default();
        if !(ratio.is_finite() && ratio.abs() >= 2.0 && ratio.abs() <= 1e4) {
            return Err(Failure::BadInput(format!("--ratio: found {ratio}, allowed: 2 to 10000, or negative")));
        }
        Ok(Prior::of_ratio(ratio, self.generator))
    }

    /// How the table is tried on another log.
    fn next(&self, out: &Path) -> Vec<String> {
        let table = quoted(&out.join("calibrated.fxt").display().to_string());
        vec![format!("flexspline replay --tables {table} ANOTHER.log")]
    }
}

fn text(made: &Calibrated, out: &Path, with_page: bool) -> String {
    let Calibration { held_out, core, parts, .. } = &made.calibration;
    let c = &made.calibration;
    let mut text = format!(
        "{}: {} rows, {} in steady motion; {} {} left out in turn\n",
        c.files.join(", "),
        c.rows,
        c.rows_fitted,
        c.folds,
        c.left_out
    );
    for fault in &c.data_faults {
        let _ = writeln!(text, "data fault: {}", fault.what);
    }
    for note in &c.notes {
        let _ = writeln!(text, "note: {note}");
    }
    for part in parts {
        let size = part.size_arcsec.map_or(String::new(), |size| format!(", {size:.1} arcsec"));
        let gain = part.held_out_gain.map_or("    –".to_owned(), |gain| format!("{:>5.1}", 100.0 * gain));
        let kept = if part.kept { "kept   " } else { "refused" };
        let _ = writeln!(text, "  {:<16} {kept} {gain} %{size}  {}", part.name, part.why);
    }
    let removed = 100.0 * (1.0 - held_out.rms_after_arcsec / held_out.rms_before_arcsec);
    let _ = writeln!(
        text,
        "where nothing was fitted, arcsec rms: {:.2} as measured, {:.2} with what was known, {:.2} with the table ({removed:.1} % less)",
        held_out.rms_before_arcsec, held_out.rms_prior_arcsec, held_out.rms_after_arcsec
    );
    let _ = writeln!(
        text,
        "the core over all rows, reversals among them: {:.2} as measured, {:.2} with the table {}",
        core.rms_before_arcsec, core.rms_after_arcsec, c.table_id
    );
    let mut files = vec!["calibrated.fxt", "calibrated.h", "calibrated.rs", "calibration.json"];
    files.extend(with_page.then_some("report.html (for any browser)"));
    text + &format!("wrote to {}/: {}", out.display(), files.join(", "))
}
