//! `flexspline drive`: the drive as a commented file, and whether its teeth clear one another.

use std::fmt::Write;

use clap::Args;
use rayon::prelude::*;
use serde::Serialize;

use super::{Context, Failure, bad_input, say};
use flexspline_base::units::{ARCMIN_PER_RAD, ARCSEC_PER_RAD};
use flexspline_mechanics::drive::{Drive, GeneratorKind, MeshReport, RigidMesh};

/// Print the drive as a commented TOML file, or check whether its teeth clear one another
///
/// The file that it prints is complete, says of every field what it is, its unit, its sign and what is allowed, and can
/// be read back with --drive (`flexspline new` writes it to a file); a file of one's own may be shorter, with base =
/// "HHD-95" and the fields that differ. --check looks for rigid teeth that interfere: gaps in um, backlash in arcmin
/// and ripple in arcsec at the output.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline drive > my-drive.toml
  flexspline drive --check --set generator.w0_mm=0.49")]
pub(super) struct DriveCommand {
    /// Check the rigid teeth over the whole mesh cycle under each of the four generators; exit code 1 if any interfere
    #[arg(long)]
    check: bool,
}

/// Result with `--json`.
#[derive(Serialize)]
struct DriveResult<'a> {
    schema_version: u32,
    drive_hash: String,
    drive: &'a Drive,
    /// Of the four generators, with `--check`.
    #[serde(skip_serializing_if = "Option::is_none")]
    mesh: Option<Vec<MeshReport>>,
}

impl DriveCommand {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let drive = context.drive()?;
        let mesh = if self.check { Some(mesh_reports(&drive)?) } else { None };
        let result = DriveResult {
            schema_version: 1,
            drive_hash: blake3::Hash::from_bytes(drive.hash()).to_hex().to_string(),
            drive: &drive,
            mesh,
        };
        let Some(reports) = &result.mesh else {
            return context.print_data(&result, || drive.to_toml());
        };
        let binding = reports.iter().filter(|report| !report.interferences.is_empty());
        let interfering: Vec<&str> = binding.map(|report| report.generator.name()).collect();
        context.print(&result, || {
            let next = if interfering.is_empty() { say::next(&[context.next("tables")]) } else { String::new() };
            table(&drive, reports).trim_end().to_owned() + &next
        })?;
        if interfering.is_empty() {
            Ok(())
        } else {
            Err(Failure::Failed(format!("teeth interfere with {}", interfering.join(", "))))
        }
    }
}

fn mesh_reports(drive: &Drive) -> Result<Vec<MeshReport>, Failure> {
    GeneratorKind::ALL
        .into_par_iter()
        .map(|kind| {
            let mesh = RigidMesh::new(drive, kind).map_err(bad_input)?;
            mesh.report(kind).ok_or_else(|| {
                Failure::Failed(format!(
                    "the teeth never meet with the {kind} generator: the tip of the flexspline does not reach past \
                     the tips of the circular spline"
                ))
            })
        })
        .collect()
}

fn table(drive: &Drive, reports: &[MeshReport]) -> String {
    let mut text = format!("{}: rigid teeth over the whole mesh cycle\n", drive.name);
    let _ =
        writeln!(text, "{:<12} {:>13} {:>16} {:>16}", "generator", "least gap µm", "backlash arcmin", "ripple arcsec");
    for report in reports {
        let _ = writeln!(
            text,
            "{:<12} {:>13.2} {:>16.3} {:>16.2}",
            report.generator,
            1e3 * report.least.gap_mm,
            report.backlash_rad * ARCMIN_PER_RAD,
            report.ripple_rad * ARCSEC_PER_RAD,
        );
    }
    if drive.flanks.preload_um != 0.0 {
        let _ = writeln!(
            text,
            "without flanks.preload_um = {}, by which flanks overlap on purpose",
            drive.flanks.preload_um
        );
    }
    for report in reports {
        for place in &report.interferences {
            let _ = writeln!(text, "{}: {place}", report.generator);
        }
    }
    text
}
