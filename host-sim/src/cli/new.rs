//! `flexspline new`: a file to start from, with every field explained.

use std::path::PathBuf;

use clap::{Args, ValueEnum, ValueHint};
use serde::Serialize;

use super::context::quoted;
use super::{Context, Failure, say};
use crate::nominal::Nominal;
use crate::output::write_whole;

/// Write a commented drive file, or a catalogue model, to edit
///
/// A drive file (the default) has every size, stiffness and imperfection of a drive for the FEM, each with its unit, meaning, sign and
/// allowed range; as it stands it is the drive that it was made from. A catalogue model (a file with "nominal" in its name, or
/// --kind nominal) has the few numbers that a catalogue gives, for `diagnose --model` and `synthesize --model`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline new drive.toml
  flexspline new drive.toml --from HHD-95-typical --set generator.w0_mm=0.49
  flexspline new nominal.toml")]
pub(super) struct New {
    /// The file to write
    #[arg(value_name = "FILE", value_hint = ValueHint::FilePath)]
    file: PathBuf,
    /// What to write [default: nominal if the file is called so, else drive]
    #[arg(long, value_enum)]
    kind: Option<Kind>,
    /// The drive to start from, a built-in one or a file; the same as --drive [default: HHD-95]
    #[arg(long, value_name = "FILE|NAME", value_hint = ValueHint::FilePath)]
    from: Option<String>,
    /// Replace the file if it is there
    #[arg(long)]
    force: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
enum Kind {
    /// A drive for the FEM
    Drive,
    /// A drive as its catalogue has it, without FEM
    Nominal,
}

/// Result with `--json`.
#[derive(Serialize)]
struct Written {
    schema_version: u32,
    kind: Kind,
    written: Vec<PathBuf>,
    /// Of the drive that a drive file holds.
    #[serde(skip_serializing_if = "Option::is_none")]
    drive_hash: Option<String>,
    /// Commands to type next.
    next: Vec<String>,
}

impl New {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let drive = match &self.from {
            Some(name) if context.has_drive() => {
                let what = format!("--from: found {name:?} beside --drive, which says the same; give one of the two");
                return Err(Failure::BadInput(what));
            }
            Some(name) => context.drive_called("--from", name)?,
            None => context.drive()?,
        };
        self.check()?;
        let shown = self.file.display().to_string();
        let file = quoted(&shown);
        let kind = self.kind.unwrap_or_else(|| self.kind_by_name());
        let (text, drive_hash, next) = match kind {
            Kind::Drive => {
                let hash = blake3::Hash::from_bytes(drive.hash()).to_hex().to_string();
                let next =
                    [format!("flexspline drive --check --drive {file}"), format!("flexspline tables --drive {file}")];
                (drive.to_toml(), Some(hash), next)
            }
            Kind::Nominal => {
                let next = [
                    format!("flexspline synthesize --model {file} --effect circular_spline_eccentricity --out try"),
                    format!("flexspline diagnose try/data.csv --model {file} --out try"),
                ];
                (Nominal::template(drive.flexspline.teeth, drive.circular_spline.teeth), None, next)
            }
        };
        write_whole(&self.file, |out| out.write_all(text.as_bytes()))
            .map_err(|error| Failure::BadInput(error.to_string()))?;
        let written =
            Written { schema_version: 1, kind, written: vec![self.file.clone()], drive_hash, next: next.to_vec() };
        context.print(&written, || {
            let what = match kind {
                Kind::Drive => format!("the drive {}, every field explained", drive.name),
                Kind::Nominal => "a catalogue model: put in the numbers of your drive".to_owned(),
            };
            format!("wrote {shown}: {what}{}", say::next(&written.next))
        })
    }

    fn kind_by_name(&self) -> Kind {
        let name = self.file.file_name().map(|name| name.to_string_lossy().to_lowercase()).unwrap_or_default();
        if name.contains("nominal") { Kind::Nominal } else { Kind::Drive }
    }

    /// Refuses a place where nothing may be written.
    fn check(&self) -> Result<(), Failure> {
        let shown = self.file.display();
        let refuse = |what: &str| Err(Failure::BadInput(format!("{shown}: {what}")));
        if self.file.is_dir() {
            return refuse("is a folder; allowed: the name of a file");
        }
        if self.file.symlink_metadata().is_ok() && !self.force {
            return refuse("is there already; give another name, or --force to replace it");
        }
        match self.file.parent() {
            Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => {
                refuse(&format!("there is no folder {}", folder.display()))
            }
            _ => Ok(()),
        }
    }
}
