//! `flexspline tables`: FEM sweeps, or samples from elsewhere, to compensation tables.

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Mutex;

use clap::Args;
use flexspline::Table;
use rayon::prelude::*;
use serde::Serialize;

use super::context::{Context, quoted};
use super::names::GeneratorNames;
use super::new::New;
use super::simulate::{refused_or_failed, stress};
use super::{Failure, bad_input, kernels, report, say, within};
use flexspline_base::output::Outputs;
use flexspline_base::spent::Spent;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::catalogue;
use flexspline_design::cautions::add_stress;
use flexspline_design::simulate::{Path, PlaceStress, SimulationSettings, simulate};
use flexspline_design::stated::{Stated, TWO_SETS_OF_K, beside};
use flexspline_design::tables::sweep::SweepProgress;
use flexspline_design::tables::{
    CompletionError, MadeTable, MakeError, SampleOptions, SheetStiffness, Source, TableInfo, TableProgress,
    TableSettings, c_header, from_samples, make, rust_source, samples,
};
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::{Method, SolverSettings};
use flexspline_report::page::Page;

/// Make compensation tables: from FEM sweeps of the drive, or from samples of another program or a bench
///
/// For each generator the drive is swept by contact FEM over one tooth pitch at every torque and temperature node (a
/// drive with imperfections also at places spread over the turns of generator and output), and the samples are
/// projected onto the table by the code that also runs on board. Written are <G>.fxt (the image that firmware reads in
/// place), <G>.json (what made it and how good it is), <G>.rs and <G>.h (the same bytes as source), and
/// <G>.samples.csv; and report.html, a page with the drive in motion that any browser opens.
///
/// With --kernels, influence kernels in place of tables: the response of the output, by contact FEM of the ideal drive,
/// to one micrometre on any flexspline tooth, any circular-spline space and any point of the generator, for loads up
/// to the rated one, and to an eccentric circular spline. Written is <G>.kernels.json; `diagnose --tables` uses it for
/// the signatures of geometric causes if it lies in the folder of the table.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline tables
  flexspline tables --generator cam --drive my-drive.toml --out tables
  flexspline tables --generator cam --from-samples bench.csv
  flexspline tables --generator cam --mesh coarse --stress
  flexspline tables --generator cam --like CSF-25-100 --complete-from-data-sheet
  flexspline tables --generator double-disc --positions 12 --node-tolerance-arcsec 0.2
  flexspline tables --kernels --generator cam --mesh coarse

Sample files have the columns generator_rad, torque_n_m, temperature_c, direction (1 or -1) and
output_rad.")]
pub(super) struct Tables {
    /// Wave generator: two-roller, four-roller, double-disc, cam, or all
    #[arg(short, long, value_name = "G", default_value = "all")]
    generator: GeneratorNames,
    /// Make the table from this file of samples instead of FEM; needs one --generator
    #[arg(long, value_name = "FILE.csv")]
    from_samples: Option<PathBuf>,
    /// Half-width of the play in arcsec where a sample file has one direction only
    #[arg(long, value_name = "ARCSEC", requires = "from_samples", allow_negative_numbers = true)]
    half_width_arcsec: Option<f64>,
    /// Largest torque, N·m [default: 200; four-roller 100, two-roller 20; by the size of the drive;
    /// of a cam with a [data_sheet] the rated torque]
    #[arg(long, value_name = "T", conflicts_with = "from_samples", allow_negative_numbers = true)]
    torque_n_m: Option<f64>,
    /// Torque nodes on each side of zero, at most, in addition to the pair at the drag torque; 5 to 30
    /// [default: 28; with imperfections 12]
    #[arg(long, value_name = "N", conflicts_with = "from_samples")]
    #[arg(value_parser = clap::value_parser!(u8).range(5..=30))]
    most_nodes: Option<u8>,
    /// Add a torque node where the table misses the FEM by more than this, arcsec [default: 0.6; with imperfections 2]
    #[arg(long, value_name = "ARCSEC", conflicts_with = "from_samples", allow_negative_numbers = true)]
    node_tolerance_arcsec: Option<f64>,
    /// Samples over one tooth pitch, 4 to 32
    #[arg(long, value_name = "N", default_value_t = 8, conflicts_with = "from_samples")]
    #[arg(value_parser = clap::value_parser!(u8).range(4..=32))]
    positions: u8,
    /// Temperature nodes, degrees C [default: the ends of the operating range]
    #[arg(
        long,
        value_name = "T,T,...",
        value_delimiter = ',',
        conflicts_with = "from_samples",
        allow_hyphen_values = true
    )]
    temperatures_c: Option<Vec<f64>>,
    /// Mesh: coarse, standard or fine
    #[arg(long, value_name = "LEVEL", default_value = "standard", conflicts_with = "from_samples")]
    mesh: MeshLevel,
    /// Solver: fast or reference
    #[arg(long, value_name = "SOLVER", default_value = "fast", conflicts_with = "from_samples")]
    solver: Method,
    /// Stress in root fillet, on bore and flank under the largest load, over three meshes, with its interval; takes one
    /// more pitch and three meshes for each generator
    #[arg(long, conflicts_with = "from_samples")]
    stress: bool,
    /// Add to the FEM what it lacks of the stiffness in [data_sheet] (T1, T2, K1, K2, K3) as a spring in series, and of
    /// the hysteresis loss as springs that slip; marked in all files, and drive-completed.toml written next to them
    #[arg(long, conflicts_with = "from_samples")]
    complete_from_data_sheet: bool,
    /// Instead of --drive: a drive like a size of a catalogue, as `new --like` makes it, with its data sheet
    #[arg(long, value_name = "NAME", requires = "complete_from_data_sheet")]
    like: Option<String>,
    /// Do not write report.html, which takes a FEM run over one more tooth pitch for each generator
    #[arg(long)]
    no_report: bool,
    /// Influence kernels in place of tables, for diagnose; minutes for each generator
    #[arg(
        long,
        conflicts_with_all = ["from_samples", "torque_n_m", "most_nodes", "node_tolerance_arcsec", "positions",
            "temperatures_c", "stress", "complete_from_data_sheet", "no_report"]
    )]
    kernels: bool,
}

/// The drive's file next to tables that a data sheet completed.
const COMPLETED_DRIVE: &str = "drive-completed.toml";

/// Report that `--json` prints.
#[derive(Serialize)]
struct TablesReport<'a> {
    schema_version: u32,
    status: &'static str,
    /// Generators without a table.
    failed: Vec<String>,
    tables: Vec<&'a TableInfo>,
    /// On the clock, and of the processor, s.
    wall_s: f64,
    processor_s: Option<f64>,
}

impl Tables {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let generators = self.generator.0.as_slice();
        if self.kernels {
            let settings = SolverSettings { method: self.solver, mesh: self.mesh, ..SolverSettings::default() };
            return kernels::run(context, generators, settings);
        }
        let (mut drive, stated) = match &self.like {
            Some(_) if context.has_drive() => {
                return Err(Failure::BadInput("--like: found it beside --drive; give one of the two".to_owned()));
            }
            Some(name) => New::like(context, name, generators)?,
            None => (context.drive()?, context.stated()?),
        };
        let sheet = self.sheet(stated.as_ref())?;
        if sheet.is_some() {
            // The sheet has all that is missing; the regularity over sheets would be added to it.
            drive.output.contact_compliance = 0.0;
        }
        let tried = match &self.from_samples {
            Some(file) => vec![self.project(&drive, generators, file)],
            None => self.sweep(context, &drive, generators, stated.as_ref(), sheet.as_ref())?,
        };
        // One generator that fails takes no other's table away.
        let (mut made, mut failed) = (Vec::new(), Vec::new());
        for (kind, table) in generators.iter().zip(tried) {
            match table {
                Ok(table) => made.push(table),
                Err(failure) => failed.push((kind, failure)),
            }
        }
        let beyond = |kind| stated.as_ref().and_then(|of| of.load_caution(&drive, kind, self.torque_n_m?));
        if made.is_empty() {
            let (kind, failure) = failed.swap_remove(0);
            return Err(match (failure, beyond(*kind)) {
                (Failure::Failed(why), Some(caution)) => Failure::Failed(format!("{why}; {}", caution.words)),
                (failure, _) => failure,
            });
        }
        for MadeTable { kind, info, .. } in &mut made {
            Stated::retain(stated.as_ref(), &mut info.cautions);
            info.cautions.extend(beyond(*kind));
        }
        if let (Some(stated), None) = (&stated, &self.from_samples) {
            let settings = SolverSettings { method: self.solver, mesh: self.mesh, ..SolverSettings::default() };
            made.par_iter_mut().for_each(|table| {
                let added = table.info.completed.as_ref().map_or([0.0; 3], |of| of.spring.compliance_rad_per_n_m);
                let sheet = beside(&drive, table.kind, drive.temperature.reference_c, stated, settings, false, added);
                table.info.cautions.extend(sheet.caution());
                table.info.data_sheet = Some(sheet);
            });
        }
        if let Some(stated) = &stated {
            made.iter_mut().for_each(|table| table.info.remarks.extend(table.info.short_of_sheet(stated)));
        }
        if self.stress {
            // Stress that is not found takes no table away.
            made.par_iter_mut().for_each(|table| match self.stress_of(&drive, table) {
                Ok(stress) => {
                    add_stress(&mut table.info.cautions, &stress);
                    table.info.stress = stress;
                }
                Err(Failure::BadInput(why) | Failure::Failed(why)) => table.info.no_stress = Some(why),
            });
        }
        let out = context.out()?;
        let mut outputs = Outputs::new();
        for table in &mut made {
            table.info.command.clone_from(&context.command);
            let path = |ending: &str| out.join(format!("{}.{ending}", table.kind));
            outputs.file(&path("fxt"), |file| file.write_all(&table.image))?;
            outputs.json(&path("json"), &table.info)?;
            outputs.file(&path("rs"), |file| file.write_all(rust_source(table).as_bytes()))?;
            outputs.file(&path("h"), |file| file.write_all(c_header(table).as_bytes()))?;
            if let Some(samples) = &table.fem_samples() {
                outputs.file(&path("samples.csv"), |file| file.write_all(samples::to_csv(samples).as_bytes()))?;
            }
        }
        let completed =
            stated.as_ref().filter(|_| sheet.is_some()).map(|stated| completed_drive(&drive, stated, &made));
        let completed_path = out.join(COMPLETED_DRIVE);
        if let Some(text) = &completed {
            outputs.file(&completed_path, |file| file.write_all(text.as_bytes()))?;
        }
        let page = if self.no_report { None } else { Some(self.page(context, &drive, &made)?) };
        if let Some(page) = &page {
            report::write(page, out, &mut outputs)?;
        }
        outputs.finish()?;
        let spent = context.spent();
        let report = TablesReport {
            schema_version: 1,
            failed: failed.iter().map(|(kind, _)| kind.to_string()).collect(),
            status: page.as_ref().filter(|page| page.status.is_failure()).map_or("made", |page| page.status.name()),
            tables: made.iter().map(|table| &table.info).collect(),
            wall_s: spent.wall_s,
            processor_s: spent.processor_s,
        };
        context.print(&report, || {
            let tables = quoted(&out.display().to_string());
            let next = format!("validate --tables {tables}");
            let next = if generators.len() == 1 { format!("{next} --generator {}", generators[0]) } else { next };
            let next = match &completed {
                Some(_) => format!("flexspline {next} --drive {}", quoted(&completed_path.display().to_string())),
                None => context.next(&next),
            };
            text(&report, out, page.is_some()) + &say::next(&[next])
        })?;
        if !failed.is_empty() {
            let why = |(kind, failure): &(&GeneratorKind, Failure)| match failure {
                Failure::BadInput(why) | Failure::Failed(why) => format!("no table of {kind}: {why}"),
            };
            let whys: Vec<String> = failed.iter().map(why).collect();
            return Err(Failure::Failed(format!("{}; what was made is written", whys.join("; "))));
        }
        page.map_or(Ok(()), |page| report::stamped(&page, out))
    }

    /// Stress by place where the nodal one is largest over a tooth pitch under the largest load of the table.
    fn stress_of(&self, drive: &Drive, table: &MadeTable) -> Result<Vec<PlaceStress>, Failure> {
        let settings = SimulationSettings {
            torque_n_m: table.info.torque_nodes_n_m.iter().copied().map(f64::from).fold(0.0, f64::max),
            solver: SolverSettings { method: self.solver, mesh: self.mesh, ..SolverSettings::default() },
            // Stress needs no more places.
            increment_rad: Some(std::f64::consts::TAU / f64::from(drive.flexspline.teeth) / 8.0),
            ..SimulationSettings::new(table.kind, Path::Pitch)
        };
        let run = simulate(drive, &settings, &mut |_| ControlFlow::Continue(())).map_err(refused_or_failed)?;
        stress(drive, &settings, &run, None)
    }

    /// The report.
    fn page(&self, context: &Context, drive: &Drive, made: &[MadeTable]) -> Result<Page, Failure> {
        let known = made.iter().map(|made| {
            let table = Table::check(&made.image).map_err(|error| Failure::Failed(error.to_string()))?;
            Ok((made.kind, table, Some(&made.info), None))
        });
        let inputs = made.iter().filter_map(|table| match &table.info.source {
            Source::File { name, blake3 } => Some((format!("BLAKE3 of {name}"), blake3.clone())),
            Source::Fem { .. } => None,
        });
        let known = known.collect::<Result<Vec<_>, Failure>>()?;
        Ok(report::of_tables(context, (drive, self.mesh), "tables", inputs.collect(), known))
    }

    fn project(&self, drive: &Drive, generators: &[GeneratorKind], file: &PathBuf) -> Result<MadeTable, Failure> {
        let &[kind] = generators else {
            return Err(Failure::BadInput(
                "--from-samples: a sample file is of one generator; name it with --generator".into(),
            ));
        };
        let half = self.half_width_arcsec.map(|half| within("--half-width-arcsec", half, 0.0, 3600.0)).transpose()?;
        let options =
            SampleOptions { half_width_rad: half.map(|half| half / ARCSEC_PER_RAD), ..SampleOptions::default() };
        let bad = |message: String| Failure::BadInput(message);
        let read = samples::read(file).map_err(|e| bad(e.to_string()))?;
        let bytes = std::fs::read(file).map_err(|e| bad(format!("{}: {e}", file.display())))?;
        let name = file.display().to_string();
        from_samples(drive, kind, &read, &name, &bytes, options).map_err(|e| bad(format!("{name}: {e}")))
    }

    /// The data sheet that completes the tables, where it is asked for, here or in the drive's file.
    fn sheet(&self, stated: Option<&Stated>) -> Result<Option<SheetStiffness>, Failure> {
        let by_file = stated.is_some_and(|stated| stated.completes_model == Some(true));
        if self.from_samples.is_some() || !(self.complete_from_data_sheet || by_file) {
            return Ok(None);
        }
        let no_sheet = || CompletionError::NoSheet { sizes: catalogue::sizes_in_words() };
        let sheet = stated.ok_or_else(no_sheet).and_then(SheetStiffness::of);
        sheet.map(Some).map_err(bad_input)
    }

    fn settings(
        &self,
        drive: &Drive,
        kind: GeneratorKind,
        stated: Option<&Stated>,
        sheet: Option<&SheetStiffness>,
    ) -> Result<TableSettings, Failure> {
        let mut settings = TableSettings::for_generator(drive, kind);
        settings.sheet = sheet.cloned();
        settings.solver = SolverSettings { method: self.solver, mesh: self.mesh, ..settings.solver };
        settings.positions = usize::from(self.positions);
        let choice = &mut settings.torque_nodes;
        choice.largest_n_m = self.torque_n_m.unwrap_or_else(|| Stated::rated_n_m(stated, drive, kind));
        choice.most = self.most_nodes.map_or(choice.most, usize::from);
        choice.tolerance_arcsec = self.node_tolerance_arcsec.unwrap_or(choice.tolerance_arcsec);
        if let Some(temperatures) = &self.temperatures_c {
            settings.temperature_nodes_c = temperatures.iter().map(|t| *t as f32).collect();
            settings.temperature_nodes_c.sort_by(f32::total_cmp);
            settings.temperature_nodes_c.dedup();
        }
        settings.check(drive).map_err(|error| match error {
            MakeError::Setting { setting, found, allowed } => {
                Failure::BadInput(format!("--{}: found {found}; allowed: {allowed}", setting.replace('_', "-")))
            }
            error => Failure::BadInput(error.to_string()),
        })?;
        Ok(settings)
    }

    fn sweep(
        &self,
        context: &Context,
        drive: &Drive,
        generators: &[GeneratorKind],
        stated: Option<&Stated>,
        sheet: Option<&SheetStiffness>,
    ) -> Result<Vec<Result<MadeTable, Failure>>, Failure> {
        let wanted = generators
            .iter()
            .map(|kind| Ok((*kind, self.settings(drive, *kind, stated, sheet)?)))
            .collect::<Result<Vec<_>, Failure>>()?;
        // Before there is much work.
        context.out()?;
        Ok(by_fem(context, drive, &wanted))
    }
}

/// The drive's file with the sheet that completed its tables, and what was added as comments: tables made of it are
/// completed again.
fn completed_drive(drive: &Drive, stated: &Stated, made: &[MadeTable]) -> String {
    let stated = Stated { completes_model: Some(true), ..stated.clone() };
    let added = made.iter().filter_map(|table| Some(table.info.completed.as_ref()?.to_toml(&table.info.generator)));
    drive.to_toml() + &stated.to_toml() + &added.collect::<String>()
}

/// Tables by FEM, several at once, with one bar for all of them.
fn by_fem(
    context: &Context,
    drive: &Drive,
    wanted: &[(GeneratorKind, TableSettings)],
) -> Vec<Result<MadeTable, Failure>> {
    // What has not begun is expected too, or what is left would grow when it does.
    let tables: Vec<[usize; 2]> = wanted.iter().map(|(_, settings)| [0, settings.most_increments(drive)]).collect();
    let progress = Mutex::new((context.progress("tables"), tables));
    wanted
        .par_iter()
        .enumerate()
        .map(|(k, (kind, settings))| {
            let observe = |now: TableProgress| {
                if let Ok(mut guard) = progress.lock() {
                    let (bar, tables) = &mut *guard;
                    tables[k] = [tables[k][0] + 1, now.expected];
                    let [done, expected] = [0, 1].map(|of: usize| tables.iter().map(|table| table[of]).sum::<usize>());
                    let SweepProgress { torque_n_m, temperature_c, iterations } = now.last;
                    let note = format!("{kind} {torque_n_m:+.3} N·m {temperature_c:+.0} °C, {iterations} iterations");
                    if context.verbose() {
                        bar.line(&format!("{done:>5}/{expected}  {note}"));
                    }
                    bar.set(done, expected, &note);
                }
                ControlFlow::Continue(())
            };
            let made = make(drive, *kind, settings, &observe);
            made.map_err(
                |error| if error.is_bad_input() { bad_input(error) } else { Failure::Failed(error.to_string()) },
            )
        })
        .collect()
}

/// A table made by FEM now on the coarse mesh, else with the command's defaults.
pub(super) fn coarse_table(context: &Context, drive: &Drive, kind: GeneratorKind) -> Result<MadeTable, Failure> {
    let mut settings = TableSettings::for_generator(drive, kind);
    settings.solver.mesh = MeshLevel::Coarse;
    by_fem(context, drive, &[(kind, settings)]).remove(0)
}

fn text(report: &TablesReport<'_>, out: &std::path::Path, with_page: bool) -> String {
    let mut text = String::from(
        "generator    table_id          bytes  torque N·m   backlash\"  wind-up\" at the ends   slope  worst \
         deviation\"\n",
    );
    for info in &report.tables {
        let [first, last] = [info.torque_nodes_n_m[0], info.torque_nodes_n_m[info.torque_nodes_n_m.len() - 1]];
        text.push_str(&format!(
            "{:<12} {:<17} {:>5}  {:>4} .. {:<4} {:>9.2}  {:>9.2} .. {:<8.2} {:>7.4}  {:.4}\n",
            info.generator,
            info.table_id,
            info.image_bytes,
            first,
            last,
            info.backlash_arcsec,
            info.wind_up_arcsec[0],
            info.wind_up_arcsec[1],
            info.slope_bound,
            info.projection_worst_arcsec,
        ));
    }
    let stiff: Vec<_> = report.tables.iter().filter_map(|info| Some((info, info.stiffness?))).collect();
    if !stiff.is_empty() {
        text.push_str("stiffness    K1 to T1                K2 to T2                K3 above, N·m/rad\n");
    }
    for (info, k) in stiff {
        text.push_str(&format!(
            "{:<12} {:>8.3e} to {:<7.4} {:>8.3e} to {:<7.4} {:>8.3e}\n",
            info.generator, k.k1_n_m_per_rad, k.loads.t1_n_m, k.k2_n_m_per_rad, k.loads.t2_n_m, k.k3_n_m_per_rad
        ));
    }
    for info in report.tables.iter().filter(|info| info.torque_nodes_resolved == Some(false)) {
        text.push_str(&format!(
            "{}: the torque nodes ran out before the table met the FEM everywhere; see --most-nodes, --torque-n-m\n",
            info.generator
        ));
    }
    for sheet in report.tables.iter().filter_map(|info| info.data_sheet.as_ref()) {
        text += &sheet.text();
    }
    if report.tables.iter().any(|info| info.stiffness.is_some() && info.data_sheet.is_some()) {
        let _ = writeln!(text, "  {TWO_SETS_OF_K}");
    }
    for info in &report.tables {
        for remark in &info.remarks {
            let _ = writeln!(text, "{}: remark: {remark}", info.generator);
        }
    }
    for info in &report.tables {
        for stress in &info.stress {
            let [low, high] = stress.interval_mpa;
            text.push_str(&format!(
                "{:<12} stress under the largest load, {:<14} {:>8.1} MPa, {low:.0} to {high:.0}, over three meshes\n",
                info.generator,
                stress.place.in_words(),
                stress.von_mises_mpa
            ));
        }
    }
    for info in &report.tables {
        for caution in &info.cautions {
            text.push_str(&format!("{}: caution: {}\n", info.generator, caution.words));
        }
        if let Some(why) = &info.no_stress {
            text.push_str(&format!("{}: caution: no stress over three meshes: {why}\n", info.generator));
        }
    }
    for (info, turns) in report.tables.iter().filter_map(|info| Some((info, info.turns.as_ref()?))) {
        text.push_str(&format!("{}: {}\n", info.generator, turns.remark));
    }
    text.push_str(&format!(
        "wrote {} table{}{} to {}/ in {}",
        report.tables.len(),
        if report.tables.len() == 1 { "" } else { "s" },
        if with_page { " and report.html (for any browser)" } else { "" },
        out.display(),
        Spent { wall_s: report.wall_s, processor_s: report.processor_s }.in_words()
    ));
    text
}
