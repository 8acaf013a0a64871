//! `flexspline diagnose`: what the simulation gets wrong in measured data, and why.

use std::path::{Path, PathBuf};

use clap::Args;
use flexspline::Table;
use serde::Serialize;

use super::context::Context;
use super::{Failure, report};
use crate::diagnosis::report::Diagnosis;
use crate::diagnosis::{Settings, diagnose_extended};
use crate::measurement::{ColumnMap, Fault, Gear, Recording, read};
use crate::nominal::{Fixed, Nominal};
use crate::output::write_json;

/// Find what the simulation gets wrong in measured data, name the cause, measure what the extension gains
///
/// Reads a CSV with a generator angle and an output angle (or error_arcsec), if wanted time_s, torque_n_m, temperature_c and
/// orientation_rad; writes diagnosis.json. The nominal model is a catalogue's (--model) or that of a table (--tables).
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline diagnose measured.csv --model nominal.toml
  flexspline diagnose measured.csv --tables out --generator cam")]
pub(super) struct Diagnose {
    /// Measured rows
    #[arg(value_name = "DATA.csv")]
    data: PathBuf,
    /// Nominal model from the catalogue
    #[arg(long, value_name = "nominal.toml", conflicts_with = "tables", required_unless_present = "tables")]
    model: Option<PathBuf>,
    /// Folder of tables made by `flexspline tables`
    #[arg(long, value_name = "DIR")]
    tables: Option<PathBuf>,
    /// Generator whose table is used
    #[arg(long, value_name = "G", default_value = "cam", requires = "tables")]
    generator: String,
    /// Names and units of columns, for instance generator=wave_gen_turns:turn,error=error_arcsec:arcsec
    #[arg(long, value_name = "MAP", default_value = "")]
    columns: String,
    /// Do not write report.html
    #[arg(long)]
    no_report: bool,
}

/// `diagnosis.json`: the diagnosis and the faults of the data.
#[derive(Serialize)]
struct Written<'a> {
    #[serde(flatten)]
    diagnosis: &'a Diagnosis,
    data_faults: &'a [Fault],
    notes: &'a [String],
    command: &'a str,
}

impl Diagnose {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let map = if self.columns.is_empty() { Ok(ColumnMap::default()) } else { ColumnMap::parse(&self.columns) };
        let map = map.map_err(|error| Failure::BadInput(format!("--columns: {error}")))?;
        let image;
        let (nominal, table) = match (&self.model, &self.tables) {
            (Some(model), _) => {
                let text = std::fs::read_to_string(model)
                    .map_err(|error| Failure::BadInput(format!("{}: {error}", model.display())))?;
                let nominal = Nominal::from_toml(&model.display().to_string(), &text)
                    .map_err(|error| Failure::BadInput(error.to_string()))?;
                (nominal, None)
            }
            (None, Some(folder)) => {
                let path = folder.join(format!("{}.fxt", self.generator));
                image =
                    std::fs::read(&path).map_err(|error| Failure::BadInput(format!("{}: {error}", path.display())))?;
                let table =
                    Table::check(&image).map_err(|error| Failure::BadInput(format!("{}: {error}", path.display())))?;
                (Nominal::of_table(&table), Some(table))
            }
            (None, None) => return Err(Failure::BadInput("expected --model or --tables".into())),
        };
        let gear = match nominal.teeth {
            Some(teeth) => Gear::of_teeth(teeth.flexspline, teeth.circular_spline, teeth.fixed == Fixed::Flexspline),
            None => Gear::of_ratio(nominal.ratio),
        };
        let recording = read(&self.data, &map, &gear).map_err(|error| Failure::BadInput(error.to_string()))?;
        let settings = Settings { verbose: context.verbose(), ..Settings::default() };
        let mut progress = context.progress("diagnose");
        let (diagnosis, extended) =
            diagnose_extended(&recording.sessions, &nominal, table.as_ref(), &settings, |done, of, what| {
                progress.set(done, of, what);
            })
            .map_err(|error| Failure::BadInput(format!("{}: {error}", self.data.display())))?;
        drop(progress);
        let written = Written {
            diagnosis: &diagnosis,
            data_faults: &recording.faults,
            notes: &recording.notes,
            command: &context.command,
        };
        let out = context.out()?;
        write_json(&out.join("diagnosis.json"), &written)?;
        if !self.no_report {
            let inputs = [Some(self.data.as_path()), self.model.as_deref()];
            let page = report::diagnosis(context, inputs, &recording, &nominal, table.as_ref(), &diagnosis, &extended);
            report::write(&page, out)?;
        }
        context.print(&written, || text(&recording, &diagnosis, out))
    }
}

fn text(recording: &Recording, diagnosis: &Diagnosis, out: &Path) -> String {
    let mut text = format!("{}: {} rows, {} sessions\n", recording.file, recording.rows, recording.sessions.len());
    for fault in &recording.faults {
        text += &format!("data fault: {}\n", fault.what);
    }
    text += &diagnosis.text();
    text + &format!("wrote {}", out.join("diagnosis.json").display())
}
