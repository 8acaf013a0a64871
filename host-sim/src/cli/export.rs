//! `flexspline export`: the deformed mesh, the outlines or the whole problem, for other programs.

use std::path::PathBuf;

use clap::builder::ArgPredicate;
use clap::{Arg, Args, ValueEnum};
use serde::Serialize;

use super::context::quoted;
use super::export_fmu::FmuOptions;
use super::export_playback::PlaybackOptions;
use super::simulate::{ModelOptions, refused_or_failed, show, watched};
use super::{Context, Failure, bad_input, say};
use flexspline_base::output::{OutputError, Outputs, write_whole};
use flexspline_design::simulate::{Observation, Path, PathPoint};
use flexspline_export::{Deck, DeckSettings, SleeveDeck, outlines, write_vtu, write_whole_flexspline};
use flexspline_mechanics::drive::Drive;
use flexspline_mechanics::stepping::Problem;

/// Intervals to a piece of a tooth outline, of 0.01 to 0.1 mm in all.
const POINTS_PER_PIECE: usize = 24;

/// Largest rotation increment of a deck, rad: the generator moves along the chord, which at half of this makes it 60 µm
/// smaller on the way.
const LARGEST_STEP_RAD: f64 = 0.1;

/// Export a mesh, outlines, a deck, or a table for other programs
///
/// vtu: both wheels deformed and loaded at one generator angle, with displacement and von Mises stress, for ParaView;
/// for a drive with a three-dimensional sleeve also the whole flexspline, <G>-3d.vtu.
/// csv: the outlines of tooth, space and generator, undeformed, each in its own frame; with --tables the playback of
/// that table at one load, playback.csv: output angle and the correction to be added to it, for a controller's own
/// lookup. The residual is reported on the table's own model and on the data of a unit (--data). Scripts make of it
/// what LinuxCNC, Beckhoff, moteus, OnStepX and others read: docs/how-to/export_to_controllers.md.
/// inp: the undeformed mesh with contact, holding and load as a deck for CalculiX and Abaqus, which deforms, loads and
/// turns the drive; mm, N, MPa, a slice of 1 mm. For a drive with a three-dimensional sleeve (CUP-95): the flexspline
/// alone, in solids, under w0.
/// fmu: a table (--tables), or a joint with mass, for simulators that import FMI 2.0 co-simulation:
/// docs/how-to/fmu.md.
/// cfs, fprime: the image of a table (--tables) as a cFS table or as F Prime parameters, for the core to play.
#[derive(Debug, Args)]
#[command(
    mut_args(beside_tables),
    after_help = "\
Examples:
  flexspline export --format vtu --generator two-roller --torque-n-m 20
  flexspline export --format csv --generator double-disc --out drawings
  flexspline export --format fmu --tables out/cam.fxt
  flexspline export --format fmu --tables out/cam.fxt --model joint --scenario camera
  flexspline export --format csv --tables out/calibrated.fxt --torque-n-m 12 --data bench.csv
  flexspline export --format cfs --tables out/cam.fxt --table-name JOINT.TABLE
  flexspline export --format inp --generator cam --torque-n-m 50 --set output.drag_torque_n_m=0

The last one is run by: OMP_NUM_THREADS=1 ccx out/cam. It prints to out/cam.dat, at the end of each
step, the output angle (node set OUTPUT, first component, rad), the displacements of the bore (BORE)
and the stresses of the elements along it (BORE_ROW)."
)]
pub(super) struct Export {
    #[command(flatten)]
    model: ModelOptions,
    /// What to write
    #[arg(long, value_enum)]
    format: Format,
    /// Table image: fmu, cfs, fprime, and csv for a playback; --torque-n-m and --temperature-c select the section of
    /// the table [default: the middle of its range]
    #[arg(long, value_name = "FILE.fxt")]
    tables: Option<PathBuf>,
    #[command(flatten)]
    playback: PlaybackOptions,
    #[command(flatten)]
    fmu: FmuOptions,
    /// Generator angle of the mesh, rad [default: 0]
    #[arg(long, value_name = "RAD", allow_negative_numbers = true)]
    generator_rad: Option<f64>,
    /// Rotation increments, one step of the deck each [default: 10]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=10_000), help_heading = "Deck")]
    increments: Option<u32>,
    /// Size of each increment, rad; negative turns the generator backward [default: 0.01]
    #[arg(long, value_name = "RAD", allow_negative_numbers = true, help_heading = "Deck")]
    step_rad: Option<f64>,
    /// Load of an additional last step, N·m, for the wind-up between two loads [default: no such step]
    #[arg(long, value_name = "T", allow_negative_numbers = true, help_heading = "Deck")]
    last_torque_n_m: Option<f64>,
}

/// Formats of a drive's mesh alone, and of a table alone; csv is of either.
const OF_A_MESH: [&str; 2] = ["vtu", "inp"];
const OF_A_TABLE: [&str; 3] = ["fmu", "cfs", "fprime"];

/// With a table or a scenario there is no mesh: what is of the mesh alone is refused, and no generator is asked for.
fn beside_tables(arg: Arg) -> Arg {
    let others = ["tables", "scenario"];
    match arg.get_id().as_str() {
        "generator" => arg
            .required(false)
            .required_if_eq_any(OF_A_MESH.map(|format| ("format", format)))
            .default_value_if("tables", ArgPredicate::IsPresent, "cam")
            .default_value_ifs(OF_A_TABLE.map(|format| ("format", ArgPredicate::Equals(format.into()), Some("cam"))))
            .conflicts_with_all(others),
        "columns" | "rate" | "torque_constant" => arg.requires("data"),
        "mesh" | "solver" | "flank_penalty" | "bore_penalty" | "max_iterations" | "generator_rad" => {
            arg.conflicts_with_all(others)
        }
        _ => arg,
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Format {
    /// Deformed mesh: <G>.vtu, and <G>-3d.vtu of a sleeve in three dimensions
    Vtu,
    /// Outlines: <G>-outlines.csv; of a table (--tables) its playback: playback.csv
    Csv,
    /// The playback of a table: `csv` with `--tables`.
    #[value(skip)]
    #[serde(rename = "csv")]
    Playback,
    /// CalculiX and Abaqus deck: <G>.inp, or sleeve.inp in three dimensions
    Inp,
    /// FMU for co-simulation: flexspline_compensation.fmu, or flexspline_joint.fmu
    Fmu,
    /// The core's image as a cFS table: flexspline.tbl and its sources
    Cfs,
    /// The core's image as F Prime parameters: flexspline_prm.json, flexspline.fpp
    Fprime,
}

impl Format {
    /// As `--format` takes it.
    fn name(self) -> String {
        match self.to_possible_value() {
            Some(value) => value.get_name().to_owned(),
            None => "csv of a table".to_owned(),
        }
    }
}

/// An option, whether it is given, and the formats that have a use for it.
pub(super) type Given = (&'static str, bool, &'static [Format]);

/// Result with `--json`.
#[derive(Serialize)]
struct ExportReport {
    schema_version: u32,
    written: Vec<PathBuf>,
}

impl Export {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let format = match self.format {
            Format::Csv if self.tables.is_some() => Format::Playback,
            format => format,
        };
        self.check(format)?;
        let written = match format {
            Format::Vtu => self.mesh(context)?,
            Format::Csv => vec![self.outlines(context)?],
            Format::Inp => vec![self.deck(context)?],
            Format::Fmu => return self.fmu.run(context, self.tables.as_deref()),
            Format::Playback | Format::Cfs | Format::Fprime => {
                let load = [self.model.torque_n_m, self.model.temperature_c];
                return self.playback.run(context, format, self.tables.as_deref(), load);
            }
        };
        let all: Vec<String> = written.iter().map(|file| file.display().to_string()).collect();
        let shown = quoted(&all[all.len() - 1]);
        let next = match format {
            Format::Vtu => vec![format!("paraview {shown}")],
            Format::Inp => vec![format!("OMP_NUM_THREADS=1 ccx {}", shown.trim_end_matches(".inp"))],
            _ => Vec::new(),
        };
        let text = format!("wrote {}{}", all.join(", "), say::next(&next));
        context.print(&ExportReport { schema_version: 1, written }, || text)
    }

    /// Its own options and those of an FMU.
    fn given(&self) -> [Given; 8] {
        use Format::{Cfs, Fmu, Fprime, Inp, Playback, Vtu};
        let loads: &[_] = &[Vtu, Inp, Playback, Cfs, Fprime];
        [
            ("--tables", self.tables.is_some(), &[Playback, Fmu, Cfs, Fprime][..]),
            ("--generator-rad", self.generator_rad.is_some(), &[Vtu]),
            ("--torque-n-m", self.model.torque_n_m.is_some(), loads),
            ("--temperature-c", self.model.temperature_c.is_some(), loads),
            ("--increments", self.increments.is_some(), &[Inp]),
            ("--step-rad", self.step_rad.is_some(), &[Inp]),
            ("--last-torque-n-m", self.last_torque_n_m.is_some(), &[Inp]),
            (self.fmu.given().unwrap_or_default(), self.fmu.given().is_some(), &[Fmu]),
        ]
    }

    /// Refuses options that the format has no use for, and numbers out of range.
    fn check(&self, format: Format) -> Result<(), Failure> {
        let mut options = self.given().into_iter().chain(self.playback.given());
        if let Some((option, _, used)) = options.find(|(_, given, used)| *given && !used.contains(&format)) {
            let used: Vec<String> = used.iter().map(|format| format.name()).collect();
            return Err(Failure::BadInput(format!(
                "{option}: --format {} has no use for it; allowed with --format {}",
                self.format.name(),
                used.join(", ")
            )));
        }
        if let Some(step_rad) = self.step_rad.filter(|step| !(step.abs() > 0.0 && step.abs() <= LARGEST_STEP_RAD)) {
            return Err(Failure::BadInput(format!(
                "--step-rad: found {step_rad}; allowed: up to {LARGEST_STEP_RAD} rad either way, and not 0"
            )));
        }
        if let Some(torque) = self.last_torque_n_m.filter(|torque| !torque.is_finite()) {
            return Err(Failure::BadInput(format!(
                "--last-torque-n-m: found {torque}; allowed: a finite number of N·m"
            )));
        }
        Ok(())
    }

    fn mesh(&self, context: &Context) -> Result<Vec<PathBuf>, Failure> {
        let drive = context.drive()?;
        let generator_rad = self.generator_rad.unwrap_or(0.0);
        let point = PathPoint { generator_rad, ..PathPoint::default() };
        let settings = self.model.settings(Path::Points(vec![point]));
        settings.check(&drive).map_err(bad_input)?;
        let file = context.out()?.join(format!("{}.vtu", self.model.generator));
        let whole = drive.sleeve.is_shell().then(|| file.with_file_name(format!("{}-3d.vtu", self.model.generator)));
        let write = |now: &Observation| -> Result<(), OutputError> {
            write_whole(&file, |out| write_vtu(out, now.problem, now.state))?;
            let Some(whole) = &whole else { return Ok(()) };
            write_whole(whole, |out| write_whole_flexspline(out, now.problem, now.state))
        };
        let progress = context.progress(self.model.generator.name());
        let run = watched(&drive, &settings, |now| {
            show(&progress, now);
            if now.row.is_some() { write(now) } else { Ok(()) }
        })?;
        run.map_err(refused_or_failed)?;
        Ok(std::iter::once(file.clone()).chain(whole.clone()).collect())
    }

    fn deck(&self, context: &Context) -> Result<PathBuf, Failure> {
        let drive = context.drive()?;
        if drive.sleeve.is_shell() {
            return self.sleeve_deck(context, &drive);
        }
        let settings = self.model.settings(Path::Points(vec![PathPoint::default()]));
        settings.check(&drive).map_err(bad_input)?;
        let temperature_c = settings.temperature_c.unwrap_or(drive.temperature.reference_c);
        let problem = Problem::new(&drive, self.model.generator, temperature_c, settings.solver).map_err(bad_input)?;
        let path = DeckSettings {
            torque_n_m: settings.torque_n_m,
            last_torque_n_m: self.last_torque_n_m,
            increments: self.increments.unwrap_or(10) as usize,
            step_rad: self.step_rad.unwrap_or(0.01),
        };
        let deck = Deck::new(&problem, path).map_err(bad_input)?;
        let file = context.out()?.join(format!("{}.inp", self.model.generator));
        write_whole(&file, |out| deck.write(out))?;
        Ok(file)
    }

    /// The flexspline of a drive with a sleeve of shells, alone and in three dimensions.
    fn sleeve_deck(&self, context: &Context, drive: &Drive) -> Result<PathBuf, Failure> {
        let of_the_plane = |(_, given, used): &Given| *given && used.contains(&Format::Inp);
        if let Some((option, ..)) = self.given().into_iter().find(of_the_plane) {
            return Err(Failure::BadInput(format!(
                "{option}: the deck of a sleeve is the flexspline alone, under w0; allowed with a plane drive (--set \
                 sleeve.kind=springs)"
            )));
        }
        let deck = SleeveDeck::new(drive).map_err(bad_input)?;
        let file = context.out()?.join("sleeve.inp");
        write_whole(&file, |out| deck.write(out))?;
        Ok(file)
    }

    fn outlines(&self, context: &Context) -> Result<PathBuf, Failure> {
        let drive = context.drive()?;
        let points = outlines(&drive, self.model.generator, POINTS_PER_PIECE).map_err(bad_input)?;
        let file = context.out()?.join(format!("{}-outlines.csv", self.model.generator));
        let mut outputs = Outputs::new();
        outputs.csv(&file, &points)?;
        outputs.finish()?;
        Ok(file)
    }
}
