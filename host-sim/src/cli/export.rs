//! `flexspline export`: the deformed mesh or the outlines, for other programs.

use std::ops::ControlFlow;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::simulate::{ModelOptions, refused_or_failed, show};
use super::{Context, Failure};
use crate::export::{outlines, write_vtu};
use crate::output::{OutputError, write_csv, write_whole};
use crate::simulate::{Path, PathPoint, simulate};

/// Intervals to a piece of a tooth outline, of 0.01 to 0.1 mm in all.
const POINTS_PER_PIECE: usize = 24;

/// Export the deformed mesh or the outlines for other programs
///
/// vtu: both wheels deformed and loaded at one generator angle, with displacement and von Mises stress, for ParaView.
/// csv: the outlines of tooth, space and generator, undeformed, each in its own frame.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline export --format vtu --generator two-roller --torque-n-m 20
  flexspline export --format csv --generator double-disc --out drawings")]
pub(super) struct Export {
    #[command(flatten)]
    model: ModelOptions,
    /// What to write
    #[arg(long, value_enum)]
    format: Format,
    /// Generator angle of the mesh, rad [default: 0]
    #[arg(long, value_name = "RAD", allow_negative_numbers = true)]
    generator_rad: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Deformed mesh: <G>.vtu
    Vtu,
    /// Outlines: <G>-outlines.csv
    Csv,
}

/// Result with `--json`.
#[derive(Serialize)]
struct Exported {
    schema_version: u32,
    written: Vec<PathBuf>,
}

impl Export {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let written = match self.format {
            Format::Vtu => self.mesh(context)?,
            Format::Csv => self.outlines(context)?,
        };
        let text = format!("wrote {}", written.display());
        context.print(&Exported { schema_version: 1, written: vec![written] }, || text)
    }

    fn mesh(&self, context: &Context) -> Result<PathBuf, Failure> {
        let drive = context.drive()?;
        let generator_rad = self.generator_rad.unwrap_or(0.0);
        let point = PathPoint { generator_rad, ..PathPoint::default() };
        let settings = self.model.settings(Path::Points(vec![point]));
        settings.check(&drive).map_err(|error| Failure::BadInput(error.to_string()))?;
        let file = context.out()?.join(format!("{}.vtu", self.model.generator));
        let mut progress = context.progress(self.model.generator.name());
        let interrupted = context.watch_interrupt();
        let mut lost: Option<OutputError> = None;
        let run = simulate(&drive, &settings, &mut |now| {
            show(&mut progress, now);
            if interrupted() {
                return ControlFlow::Break(());
            }
            if now.row.is_some()
                && let Err(error) = write_whole(&file, |out| write_vtu(out, now.problem, now.state))
            {
                lost = Some(error);
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        });
        if let Some(error) = lost {
            return Err(error.into());
        }
        run.map_err(refused_or_failed)?;
        Ok(file)
    }

    fn outlines(&self, context: &Context) -> Result<PathBuf, Failure> {
        let loads = [
            ("--generator-rad", self.generator_rad),
            ("--torque-n-m", self.model.torque_n_m),
            ("--temperature-c", self.model.temperature_c),
        ];
        if let Some((option, _)) = loads.into_iter().find(|(_, value)| value.is_some()) {
            return Err(Failure::BadInput(format!(
                "{option}: outlines are undeformed, at reference temperature; allowed with --format vtu"
            )));
        }
        let drive = context.drive()?;
        let points = outlines(&drive, self.model.generator, POINTS_PER_PIECE)
            .map_err(|error| Failure::BadInput(error.to_string()))?;
        let file = context.out()?.join(format!("{}-outlines.csv", self.model.generator));
        write_csv(&file, &points)?;
        Ok(file)
    }
}
