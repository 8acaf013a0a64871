//! `flexspline simulate`: a quasi-static contact FEM run along a generator path.

use std::fmt::Write;
use std::ops::ControlFlow;
use std::path::Path as FilePath;

use clap::Args;
use flexspline::Direction;

use super::{Context, Failure, bad_input, report, say};
use flexspline_base::figures;
use flexspline_base::output::{OutputError, Outputs, WholeFolder, write_whole};
use flexspline_base::progress::Progress;
use flexspline_design::cautions::{Caution, add_stress};
use flexspline_design::data_sheet::wind_up_parts;
use flexspline_design::simulate::{
    Observation, Path, PathPoint, Phase, PlaceStress, SimulateError, Simulation, SimulationSettings, Summary,
    read_path, simulate, stress_by_place,
};
use flexspline_design::stated::{SheetBeside, Stated, beside};
use flexspline_export::{VtuFrame, write_pvd, write_vtu};
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::{Method, SolveError, SolverSettings};
use flexspline_report::page::Page;
use flexspline_report::{MotionSeen, simulation_report};

/// The rows of a run that ended on its way.
const PARTIAL: &str = "results.partial.csv";

/// Simulate the drive along a generator path by contact FEM
///
/// Writes results.csv (one row to each increment), summary.json (kinematic error, backlash, wind-up, stress) and
/// report.html, a page with these figures, the error along the path, how the teeth share the load and, where the path
/// settles for a tooth pitch, the drive in motion, into the output folder, and frames/ with --frames. The drive is
/// deformed, then loaded, then turned.
///
/// Where no equilibrium is found the last one is reported, with its load and wind-up, and the rows so far are in
/// results.partial.csv: those of the path, or of the loads that came on. Finer steps have been tried then.
///
/// Where the drive's file has a [data_sheet] its figures stand next to those computed, with their ratio
/// (docs/how-to/design.md).
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline simulate --generator cam --path pitch --torque-n-m 50
  flexspline simulate --generator double-disc --path paper --mesh coarse --out disc
  flexspline simulate --generator cam --path pitch --torque-n-m 50 --stress
  flexspline simulate --generator cam --path pitch --set flanks.friction_coefficient=0.08 --json

A path FILE is a CSV with a column generator_rad and, if wanted, torque_n_m and temperature_c: one
increment, or more where the solver needs them, and one result row for each of its rows. The drive
is deformed where the first row says.")]
pub(super) struct Simulate {
    #[command(flatten)]
    model: ModelOptions,
    /// Where the generator goes: paper (+1 rad, then -2 rad), pitch (settled, then one flexspline tooth pitch), turn
    /// (settled, then one turn), or a CSV file
    #[arg(long, value_name = "paper|pitch|turn|FILE", default_value = "paper")]
    path: String,
    /// Largest increment of the generator, rad [default: 0.01 on paper, 1/24 of a tooth pitch on pitch, 1/8 on turn]
    #[arg(long, value_name = "RAD", allow_negative_numbers = true)]
    increment: Option<f64>,
    /// Which way pitch and turn go [default: forward]
    #[arg(long, value_parser = ["forward", "backward"])]
    direction: Option<String>,
    /// Look for the ratcheting torque of the [data_sheet], up to the stated one; up to a minute more
    #[arg(long)]
    ratcheting: bool,
    /// Stress in root fillet, on bore and flank over three meshes, with its interval, and the safety of steel against
    /// fatigue; some seconds more
    #[arg(long)]
    stress: bool,
    /// With --stress: turns of the generator that the flexspline is to bear [default: any number]
    #[arg(long, value_name = "N", requires = "stress", value_parser = clap::value_parser!(u64).range(1..))]
    turns: Option<u64>,
    /// Write the deformed mesh of every row to frames/, for ParaView
    #[arg(long)]
    frames: bool,
    /// Do not write report.html
    #[arg(long)]
    no_report: bool,
}

/// Problem and method of every command that solves.
#[derive(Debug, Args)]
pub(super) struct ModelOptions {
    /// Wave generator: two-roller, four-roller, double-disc or cam
    #[arg(long, value_name = "G")]
    pub(super) generator: GeneratorKind,
    /// Load torque on the output, N·m; positive turns it forward [default: 0]
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub(super) torque_n_m: Option<f64>,
    /// Temperature, degrees C [default: the drive's reference temperature]
    #[arg(long, value_name = "C", allow_negative_numbers = true)]
    pub(super) temperature_c: Option<f64>,
    /// Mesh: coarse, standard or fine
    #[arg(long, value_name = "LEVEL", default_value = "standard")]
    pub(super) mesh: MeshLevel,
    /// Solver: fast condenses the teeth onto the nodes that touch something, reference keeps every node; they agree to
    /// 0.1 arcsec
    #[arg(long, value_name = "SOLVER", default_value = "fast")]
    pub(super) solver: Method,
    /// Contact penalty on the flanks, N/mm^3; the pressure reported is found from the forces and does not depend on
    /// it
    #[arg(
        long, value_name = "K", default_value_t = SolverSettings::default().flank_penalty,
        allow_negative_numbers = true, help_heading = "Numerical method"
    )]
    flank_penalty: f64,
    /// Contact penalty on the bore, N/mm^3 [default: 1e7 under rollers, 1e6 under discs and cam]
    #[arg(long, value_name = "K", allow_negative_numbers = true, help_heading = "Numerical method")]
    bore_penalty: Option<f64>,
    /// Newton iterations before an increment is halved
    #[arg(
        long, value_name = "N", default_value_t = SolverSettings::default().max_iterations,
        help_heading = "Numerical method"
    )]
    max_iterations: usize,
}

impl ModelOptions {
    /// Settings of a run along a path.
    pub(super) fn settings(&self, path: Path) -> SimulationSettings {
        SimulationSettings {
            torque_n_m: self.torque_n_m.unwrap_or(0.0),
            temperature_c: self.temperature_c,
            solver: SolverSettings {
                method: self.solver,
                mesh: self.mesh,
                flank_penalty: self.flank_penalty,
                bore_penalty: self.bore_penalty,
                max_iterations: self.max_iterations,
                ..SolverSettings::default()
            },
            ..SimulationSettings::new(self.generator, path)
        }
    }
}

impl Simulate {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let drive = context.drive()?;
        let settings = self.settings(&drive)?;
        settings.check(&drive).map_err(bad_input)?;
        let out = context.out()?;

        let mut frames = if self.frames { Some(Frames::new(&out.join("frames"))?) } else { None };
        let progress = context.progress(settings.generator.name());
        let mut seen = (!self.no_report).then(|| MotionSeen::new(&drive));
        let run = || {
            let run = watched(&drive, &settings, |now| {
                if context.verbose() {
                    progress.line(&line(now));
                }
                show(&progress, now);
                if let Some(seen) = &mut seen {
                    seen.add(now);
                }
                match (&mut frames, now.row) {
                    (Some(frames), Some(row)) => frames.add(row.step, now),
                    _ => Ok(()),
                }
            });
            progress.set(1, 1, "figures of the data sheet");
            run
        };
        let (stated, temperature_c) = (context.stated()?, settings.temperature_c);
        let temperature_c = temperature_c.unwrap_or(drive.temperature.reference_c);
        // Stiffness hardly depends on the mesh: K1 to K3 of CSG-25-80 by 0.1 %.
        let mesh = if self.ratcheting { settings.solver.mesh } else { MeshLevel::Coarse };
        let coarse = SolverSettings { mesh, ..settings.solver };
        let beside =
            |stated| beside(&drive, settings.generator, temperature_c, stated, coarse, self.ratcheting, [0.0; 3]);
        let (run, sheet) = rayon::join(run, || stated.as_ref().map(beside));
        drop(progress);
        let mut simulation = match run? {
            Ok(simulation) => simulation,
            Err(error) => return Err(self.failed(context, out, error)),
        };
        simulation.summary.command = context.command.clone();
        if self.stress {
            let _bar = context.progress("stress on three meshes");
            simulation.summary.stress = stress(&drive, &settings, &simulation, self.turns)?;
            add_stress(&mut simulation.summary.cautions, &simulation.summary.stress);
        }
        simulation.summary.data_sheet = sheet;
        let summary = &mut simulation.summary;
        if let Some(torque_n_m) = summary.torque_n_m.filter(|_| summary.wind_up_arcsec.is_some())
            && drive.output.contact_compliance > 0.0
        {
            // Without cup and balls preloaded teeth may find no equilibrium: then there are no parts to show.
            let parts = wind_up_parts(&drive, settings.generator, temperature_c, torque_n_m, coarse);
            summary.wind_up_parts = parts.unwrap_or_default();
        }
        let sheet = simulation.summary.data_sheet.as_ref();
        Stated::retain(sheet.map(|sheet| &sheet.stated), &mut simulation.summary.cautions);
        let largest = simulation.rows.iter().map(|row| row.torque_n_m.abs()).fold(0.0, f64::max);
        simulation.summary.cautions.extend(stated.and_then(|of| of.load_caution(&drive, settings.generator, largest)));
        simulation.summary.cautions.extend(sheet.and_then(SheetBeside::caution));

        // Data sheet and stress took their time, too.
        let spent = context.spent();
        (simulation.summary.wall_s, simulation.summary.processor_s) = (spent.wall_s, spent.processor_s);

        let (has_frames, has_page) = (frames.is_some(), seen.is_some());
        let mut outputs = Outputs::new();
        outputs.csv(&out.join("results.csv"), &simulation.rows)?;
        outputs.json(&out.join("summary.json"), &simulation.summary)?;
        if let Some(seen) = seen {
            let page = simulation_report(&drive, settings.generator, &simulation, seen)
                .map_err(|error| Failure::Failed(format!("report.html: {error}")))?;
            let page = Page { title: context.titled(&page.title), ..page };
            report::write(&page, out, &mut outputs)?;
        }
        if let Some(frames) = frames {
            outputs.folder(frames.finish()?);
        }
        outputs.finish()?;
        // What an earlier run left when it ended on its way is not of this one.
        let _ = std::fs::remove_file(out.join(PARTIAL));
        context.print(&simulation.summary, || {
            let next = if simulation.summary.cautions.iter().any(Caution::rules_out_tables) {
                "\nno table is of use with these cautions: change the drive or the load first".to_owned()
            } else {
                say::next(&[context.next(&format!("tables --generator {}", settings.generator))])
            };
            text(&simulation.summary, out, has_frames, has_page).trim_end().to_owned() + &next
        })
    }

    /// Why there are no results; the rows so far are written.
    fn failed(&self, context: &Context, out: &FilePath, error: SimulateError) -> Failure {
        let of_solver = match &error {
            SimulateError::Solve(of_solver) => Some(of_solver),
            SimulateError::Unfinished(unfinished) => Some(&unfinished.error),
            _ => None,
        };
        if let (true, Some(residuals)) = (context.verbose(), of_solver.and_then(SolveError::residuals)) {
            say::talk(&format!("relative residual by iteration: {residuals}"));
        }
        let SimulateError::Unfinished(unfinished) = &error else { return refused_or_failed(error) };
        let path = out.join(PARTIAL);
        let mut outputs = Outputs::new();
        if let Err(error) = outputs.csv(&path, &unfinished.rows).and_then(|()| outputs.finish()) {
            return error.into();
        }
        let rows = unfinished.rows.len();
        Failure::Failed(format!(
            "{error}; wrote the {rows} row{} so far to {}",
            if rows == 1 { "" } else { "s" },
            path.display()
        ))
    }

    fn settings(&self, drive: &Drive) -> Result<SimulationSettings, Failure> {
        let path = match Path::built_in(&self.path) {
            Some(path) => path,
            None => Path::Points(self.read_path(drive)?),
        };
        if self.direction.is_some() && !matches!(path, Path::Pitch | Path::Turn) {
            return Err(Failure::BadInput(
                "--direction: the path has its own; allowed with --path pitch and turn".into(),
            ));
        }
        let direction =
            if self.direction.as_deref() == Some("backward") { Direction::Backward } else { Direction::Forward };
        Ok(SimulationSettings { increment_rad: self.increment, direction, ..self.model.settings(path) })
    }

    fn read_path(&self, drive: &Drive) -> Result<Vec<PathPoint>, Failure> {
        let name = &self.path;
        let text = std::fs::read_to_string(name).map_err(|error| {
            Failure::BadInput(format!(
                "--path: found {name:?}, which cannot be read as a file ({error}); allowed: paper, pitch, turn or a \
                 CSV file"
            ))
        })?;
        let temperatures_c = drive.temperature.minimum_c..=drive.temperature.maximum_c;
        let points = read_path(name, &text, temperatures_c).map_err(bad_input)?;
        let twice = [
            ("--torque-n-m", "torque_n_m", self.model.torque_n_m, points[0].torque_n_m),
            ("--temperature-c", "temperature_c", self.model.temperature_c, points[0].temperature_c),
        ];
        for (option, column, given, in_file) in twice {
            if let (Some(given), Some(_)) = (given, in_file) {
                return Err(Failure::BadInput(format!(
                    "{option}: found {given}, but {name} has a column {column}; give one of the two"
                )));
            }
        }
        Ok(points)
    }
}

/// A run, as far as `each` has written what it is to write on the way.
pub(super) fn watched(
    drive: &Drive,
    settings: &SimulationSettings,
    mut each: impl FnMut(&Observation) -> Result<(), OutputError>,
) -> Result<Result<Simulation, SimulateError>, OutputError> {
    let mut lost = Ok(());
    let run = simulate(drive, settings, &mut |now| {
        lost = each(now);
        if lost.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    lost.map(|()| run)
}

/// Stress by place where and under what the nodal one of the run was largest.
pub(super) fn stress(
    drive: &Drive,
    settings: &SimulationSettings,
    simulation: &Simulation,
    turns: Option<u64>,
) -> Result<Vec<PlaceStress>, Failure> {
    let step = simulation.summary.max_von_mises_step;
    let Some(row) = simulation.rows.iter().find(|row| row.step == step) else { return Ok(Vec::new()) };
    let at = (row.generator_rad, row.torque_n_m);
    stress_by_place(drive, settings.generator, row.temperature_c, at, settings.solver, turns)
        .map_err(|error| Failure::Failed(format!("--stress: {error}")))
}

/// Bad input or failed run.
pub(super) fn refused_or_failed(error: SimulateError) -> Failure {
    if error.is_bad_input() { bad_input(error) } else { Failure::Failed(error.to_string()) }
}

/// Moves the progress bar.
pub(super) fn show(progress: &Progress, now: &Observation) {
    progress.set(now.done, now.total, &format!("{}, {} iterations", phase(now.phase), now.iterations));
}

fn phase(phase: Phase) -> &'static str {
    match phase {
        Phase::Deforming => "deforming",
        Phase::Touching => "touching",
        Phase::Loading => "loading",
        Phase::Settling => "settling",
        Phase::ChangingTemperature => "changing temperature",
        Phase::Following => "turning",
    }
}

/// An increment in one line.
fn line(now: &Observation) -> String {
    let state = now.state;
    let error = now.problem.error_rad(state).to_degrees() * 3600.0;
    format!(
        "{:<20} {:>5}/{}  generator {:+.6} rad  load {:+.3} N·m  error {error:+.4}\"  {} iterations",
        phase(now.phase),
        now.done,
        now.total,
        state.generator_rad,
        state.torque_n_m,
        now.iterations
    )
}

/// The folder of frames while it fills.
struct Frames {
    folder: WholeFolder,
    list: Vec<VtuFrame>,
}

impl Frames {
    fn new(target: &FilePath) -> Result<Frames, OutputError> {
        Ok(Frames { folder: WholeFolder::new(target)?, list: Vec::new() })
    }

    fn add(&mut self, step: usize, now: &Observation) -> Result<(), OutputError> {
        let file = format!("frame-{step:05}.vtu");
        write_whole(&self.folder.path().join(&file), |out| write_vtu(out, now.problem, now.state))?;
        self.list.push(VtuFrame { step, file });
        Ok(())
    }

    /// The folder, complete.
    fn finish(self) -> Result<WholeFolder, OutputError> {
        write_whole(&self.folder.path().join("frames.pvd"), |out| write_pvd(out, &self.list))?;
        Ok(self.folder)
    }
}

/// The summary for reading.
fn text(summary: &Summary, out: &FilePath, has_frames: bool, has_page: bool) -> String {
    let mut text = format!(
        "{} with {} generator, path {}, {} mesh, {} degrees of freedom\n",
        summary.drive, summary.generator, summary.path, summary.mesh, summary.degrees_of_freedom
    );
    // Where the figures are not those of the teeth in mesh, that comes first.
    let is_first = |caution: &&Caution| ["tip_contact", "stiffness"].contains(&caution.figure);
    for caution in summary.cautions.iter().filter(is_first) {
        let _ = writeln!(text, "caution: {}", caution.words);
    }
    text += &figures::lines(&summary.figures());
    text += &summary.data_sheet.as_ref().map(SheetBeside::text).unwrap_or_default();
    for caution in summary.cautions.iter().filter(|caution| !is_first(caution)) {
        let _ = writeln!(text, "caution: {}", caution.words);
    }
    let _ = writeln!(
        text,
        "{} increments, {} iterations; wrote {}, {}{}{}",
        summary.increments,
        summary.iterations,
        out.join("results.csv").display(),
        out.join("summary.json").display(),
        if has_frames { format!(", {}", out.join("frames/frames.pvd").display()) } else { String::new() },
        if has_page { format!(", {} (for any browser)", out.join("report.html").display()) } else { String::new() }
    );
    text
}
