//! `flexspline export --format fmu`: a table, or a joint with mass, for simulators that import FMI 2.0.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::context::image_file;
use super::{Context, Failure, bad_input, fly};
use flexspline_base::output::write_whole;
use flexspline_export::fmu::{Fmu, FmuExportError, compensation, find_libraries, joint};

/// The scenario of a joint where none is named.
const USUAL_SCENARIO: &str = "antenna";

/// The version of the standard.
const FMI: &str = "2.0";

/// Options of this format.
#[derive(Debug, Args)]
pub(super) struct FmuOptions {
    /// What the FMU simulates: compensation (the core over its table) or joint (motor, servo, drive and load) [default:
    /// compensation]
    #[arg(long, value_parser = ["compensation", "joint"], value_name = "MODEL", help_heading = "FMU")]
    #[arg(hide_possible_values = true)]
    model: Option<String>,
    /// Masses, friction, servo and expected load of a joint: antenna, rover, camera, telescope, or a TOML file
    /// [default: antenna]
    #[arg(long, value_name = "SCENARIO", help_heading = "FMU")]
    scenario: Option<String>,
    /// Library of flexspline-fmu to pack, repeatable for several platforms [default: those next to this program]
    #[arg(long, value_name = "FILE", help_heading = "FMU")]
    library: Vec<PathBuf>,
}

/// Result with `--json`.
#[derive(Serialize)]
struct FmuReport {
    schema_version: u32,
    written: Vec<PathBuf>,
    model: &'static str,
    fmi: &'static str,
    guid: String,
    table_id: String,
    platforms: Vec<&'static str>,
}

impl FmuOptions {
    /// The first of its options that is given.
    pub(super) fn given(&self) -> Option<&'static str> {
        let given = [
            ("--model", self.model.is_some()),
            ("--scenario", self.scenario.is_some()),
            ("--library", !self.library.is_empty()),
        ];
        given.into_iter().find(|(_, given)| *given).map(|(option, _)| option)
    }

    pub(super) fn run(&self, context: &Context, tables: Option<&Path>) -> Result<(), Failure> {
        context.refuse_drive("an FMU has the drive of its table; allowed: --tables FILE.fxt")?;
        let fmu = self.fmu(tables)?;
        let libraries = find_libraries(&self.library).map_err(bad_input)?;
        let resources = fmu.resources();
        let file = context.out()?.join(format!("{}.fmu", resources.kind.identifier()));
        write_whole(&file, |out| fmu.write(out, &libraries))?;
        let platforms: Vec<&str> = libraries.iter().map(|library| library.platform.folder).collect();
        let text = format!(
            "wrote {}: FMI {FMI}, {} with table {}, for {}",
            file.display(),
            resources.kind.name(),
            resources.table_id,
            platforms.join(", ")
        );
        let exported = FmuReport {
            schema_version: 1,
            written: vec![file],
            model: resources.kind.name(),
            fmi: FMI,
            guid: resources.guid.clone(),
            table_id: resources.table_id.to_string(),
            platforms,
        };
        context.print(&exported, || text)
    }

    fn fmu(&self, tables: Option<&Path>) -> Result<Fmu, Failure> {
        let image = tables.map(image_file).transpose()?;
        let of_table = |error: FmuExportError| {
            let file = tables.map_or("scenario".to_owned(), |file| file.display().to_string());
            Failure::BadInput(format!("{file}: {error}"))
        };
        if self.model.as_deref() == Some("joint") {
            let flown = fly::scenario(self.scenario.as_deref().unwrap_or(USUAL_SCENARIO))?;
            return joint(&flown, image).map_err(of_table);
        }
        if self.scenario.is_some() {
            return Err(bad_input("--scenario: the compensation alone has no mass; allowed with --model joint"));
        }
        let missing = "--tables: missing; needed for the compensation: an image as flexspline tables writes it";
        compensation(image.ok_or_else(|| bad_input(missing))?).map_err(of_table)
    }
}
