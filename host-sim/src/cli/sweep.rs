//! `flexspline sweep`: variants of a drive, and drives drawn from tolerances.

use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args, Subcommand};
use serde_json::json;

use super::context::quoted;
use super::names::GeneratorNames;
use super::{Context, Failure, report, say};
use flexspline_base::output::Outputs;
use flexspline_design::cautions::Caution;
use flexspline_design::data_sheet::{FIGURES, FigureOf};
use flexspline_design::sweep::{
    Constraint, EXAMPLE, Judge, NUMBER, OfGenerator, PlanError, PlanSettings, Ran, ReducedSweep, RunStatus, Sense,
    Shard, Tolerances, VariantPlan, VariantRow, Vary, is_error_of_making, reduce, run,
};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_report::page::{Headline, Page};
use flexspline_report::sweep_report::{self, SweepSources};

/// Compute many variants of a drive, or drives drawn from tolerances
///
/// With --vary each variant is deformed by each generator, loaded and turned by a tooth pitch, by contact FEM:
/// backlash, lost motion, stiffness K1, K2, K3, wind-up, transmission error, stresses. A drive with imperfections is
/// computed at one place of its turns. With --tolerances drives are drawn from a file of tolerances, and their error
/// over a turn of the output is computed by influence kernels of the drive as drawn.
///
/// `plan` writes plan.csv (one variant a line) and plan.json. `run` computes a shard of the variants into results/: it
/// can run anywhere, in any order and more than once, and goes on after the rows that are there. `reduce` reports
/// the Pareto front, scatter, quantiles and rank correlations: sweep.csv, sweep.json and report.html. Without a step,
/// all three are done in --out.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
// Nobody chooses among drives drawn from tolerances.
#[command(mut_arg("least", |arg| arg.conflicts_with("tolerances")))]
#[command(mut_arg("most", |arg| arg.conflicts_with("tolerances")))]
#[command(after_help = format!("\
Examples:
  flexspline sweep -g cam --vary flexspline.rim_thickness_mm=1.2..2.6:8
  flexspline sweep --vary generator.w0_mm=0.46..0.5 --draws 50 --keep backlash_arcsec=30..70
  flexspline sweep --example > tolerances.toml
  flexspline sweep plan --tolerances tolerances.toml --draws 10000 --out campaign
  flexspline sweep run campaign --shard 3/20
  flexspline sweep reduce campaign

Figures of --vary:
{}
T1 and T2, where the ranges of stiffness end, are those of the drive's [data_sheet], or 21 and 72 %
of the largest load. Figures of --tolerances are in the columns of results/.", figures()))]
pub(super) struct SweepCommand {
    #[command(subcommand)]
    step: Option<SweepStep>,
    #[command(flatten)]
    plan: PlanCommand,
    #[command(flatten)]
    judged: JudgeOptions,
}

#[derive(Debug, Subcommand)]
enum SweepStep {
    Plan(PlanCommand),
    /// Compute a shard of the variants of a plan
    Run {
        /// Folder of the sweep
        #[arg(value_name = "DIR")]
        folder: PathBuf,
        /// The shard I of N shards, I from 1 [default: all variants]
        #[arg(long, value_name = "I/N")]
        shard: Option<Shard>,
    },
    /// Reduce the results to sweep.csv, sweep.json and report.html
    Reduce {
        /// Folder of the sweep
        #[arg(value_name = "DIR")]
        folder: PathBuf,
        /// Accept missing results
        #[arg(long)]
        partial: bool,
        #[command(flatten)]
        judged: JudgeOptions,
    },
}

/// Write plan.csv, one variant a line, and plan.json
#[derive(Debug, Args)]
#[command(group(ArgGroup::new("variants").required(true).args(["vary", "tolerances", "example"])))]
struct PlanCommand {
    /// A field and its values: PATH=FROM..TO (5 values), PATH=FROM..TO:N, or PATH=VALUE,VALUE,...; repeat for more
    /// fields
    #[arg(long, value_name = "PATH=VALUES", allow_hyphen_values = true)]
    vary: Vec<Vary>,
    /// File of tolerances, which drives are drawn from
    #[arg(long, value_name = "FILE", requires = "draws")]
    tolerances: Option<PathBuf>,
    /// Print a commented file of tolerances
    #[arg(long)]
    example: bool,
    /// Number of variants that are drawn, a Latin hypercube [default: every combination of the values of --vary]
    #[arg(long, value_name = "N")]
    draws: Option<usize>,
    /// Random seed of what is drawn
    #[arg(long, value_name = "N", default_value_t = 1, requires = "draws")]
    seed: u64,
    /// Wave generator of --vary: two-roller, four-roller, double-disc, cam, or all
    #[arg(short, long, value_name = "G", default_value = "all", conflicts_with = "tolerances")]
    generator: GeneratorNames,
    /// Largest load of --vary, N·m [default: the rated torque of the drive's [data_sheet]; else the largest torque of a
    /// table of that generator: 200; four-roller 100, two-roller 20; by the size of the drive]
    #[arg(long, value_name = "T", allow_negative_numbers = true, conflicts_with = "tolerances")]
    torque_n_m: Option<f64>,
    /// Positions over the tooth pitch of --vary, 4 to 32: fewer take less time, and resolve less of the error
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = clap::value_parser!(u8).range(4..=32))]
    #[arg(conflicts_with = "tolerances")]
    positions: u8,
    /// Mesh: coarse, standard or fine
    #[arg(long, value_name = "LEVEL", default_value = "coarse")]
    mesh: MeshLevel,
}

#[derive(Debug, Args)]
struct JudgeOptions {
    /// A constraint, FIGURE=LEAST..MOST, either end may be left out [default: teeth that clear one another]
    #[arg(long, value_name = "FIGURE=RANGE", allow_hyphen_values = true)]
    keep: Vec<Constraint>,
    /// A figure of which less is better [default: kinematic_error_pp_arcsec, root_fillet_mpa]
    #[arg(long, value_name = "FIGURE")]
    least: Vec<String>,
    /// A figure of which more is better [default: k2_n_m_per_rad]
    #[arg(long, value_name = "FIGURE")]
    most: Vec<String>,
}

/// The names of the figures of a data sheet, three on a line.
fn figures() -> String {
    let line = |names: &[FigureOf]| names.iter().map(|(name, _)| format!("  {name:<32}")).collect::<String>();
    FIGURES.chunks(3).map(|names| line(names).trim_end().to_owned()).collect::<Vec<_>>().join("\n")
}

impl From<PlanError> for Failure {
    fn from(error: PlanError) -> Failure {
        match error {
            PlanError::Failed(what) => Failure::Failed(what),
            PlanError::Output(error) => error.into(),
            PlanError::BadInput(what) => Failure::BadInput(what),
        }
    }
}

impl SweepCommand {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let plan = match &self.step {
            Some(SweepStep::Run { folder, shard }) => {
                let plan = opened(context, folder)?;
                let Ran { there, computed } = computed(context, &plan, folder, shard.unwrap_or(Shard::WHOLE))?;
                let hash = &plan.hash;
                let report = json!({ "schema_version": 1, "plan": hash, "there": there, "computed": computed });
                return context.print(&report, || {
                    let spent = context.spent().in_words();
                    format!("plan {hash}: {computed} runs computed, {there} there already, in {spent}")
                });
            }
            Some(SweepStep::Reduce { folder, partial, judged }) => {
                let plan = opened(context, folder)?;
                let judge = judged.judge(&plan)?;
                return reduced(context, &plan, folder, &judge, Some(*partial));
            }
            Some(SweepStep::Plan(plan)) => plan,
            None => &self.plan,
        };
        if plan.example {
            let example = json!({ "schema_version": 1, "tolerances": EXAMPLE });
            return context.print_data(&example, || EXAMPLE.trim_end().to_owned());
        }
        if self.step.is_some() {
            return plan.run(context);
        }
        let out = context.out_for_plan(NUMBER)?;
        let plan = plan.made(context)?;
        let judge = self.judged.judge(&plan)?;
        let plan = plan.write(out)?;
        computed(context, &plan, out, Shard::WHOLE)?;
        reduced(context, &plan, out, &judge, None)
    }
}

impl PlanCommand {
    fn run(&self, context: &Context) -> Result<(), Failure> {
        let out = context.out_for_plan(NUMBER)?;
        let plan = self.made(context)?.write(out)?;
        let (variants, drive) = (plan.variants.len(), plan.drive.name.as_str());
        let planned = json!({
            "schema_version": 1, "plan": &plan.hash, "drive": drive, "variants": variants, "columns": &plan.columns,
        });
        context.print(&planned, || {
            let folder = quoted(&out.display().to_string());
            let what = format!(
                "plan {}: {variants} variants of {drive}\nwrote plan.csv and plan.json to {}/ in {}",
                plan.hash,
                out.display(),
                context.spent().in_words()
            );
            what + &say::next(&["run", "reduce"].map(|step| format!("flexspline sweep {step} {folder}")))
        })
    }

    fn made(&self, context: &Context) -> Result<VariantPlan, Failure> {
        let settings = PlanSettings { draws: self.draws, seed: self.seed, mesh: self.mesh };
        let Some(file) = &self.tolerances else {
            let drive = context.drive()?;
            if let Some(torque) = self.torque_n_m.filter(|torque| !(*torque > 0.0 && torque.is_finite())) {
                return Err(Failure::BadInput(format!("--torque-n-m: found {torque}, allowed: above 0")));
            }
            if let Some(field) = self.vary.iter().find(|field| context.set_to(&field.path).is_some()) {
                return Err(Failure::BadInput(format!(
                    "--set {0}: found it with --vary {0}, which contradicts it; give one of the two",
                    field.path
                )));
            }
            let (stated, at) = (context.stated()?, (self.torque_n_m, usize::from(self.positions)));
            let kinds = &self.generator.0;
            return Ok(VariantPlan::of_fields(&drive, stated.as_ref(), &self.vary, kinds, at, settings)?);
        };
        if context.has_drive() {
            return Err(Failure::BadInput("--drive: found it with a file of tolerances, which names the drive".into()));
        }
        let name = file.display().to_string();
        let text = std::fs::read_to_string(file).map_err(|error| Failure::BadInput(format!("{name}: {error}")))?;
        let tolerances = Tolerances::read(&name, &text, |drive| {
            let near = file.parent().unwrap_or(Path::new("")).join(drive);
            let called = if near.is_file() { near.display().to_string() } else { drive.to_owned() };
            context.drive_called("drive", &called).map_err(|failure| match failure {
                Failure::BadInput(what) | Failure::Failed(what) => what.trim_start_matches("drive: ").to_owned(),
            })
        })?;
        let progress = context.progress("plan");
        let progress = |done, of, what: &str| progress.set(done, of, what);
        Ok(VariantPlan::of_tolerances(&tolerances, settings, &progress)?)
    }
}

impl JudgeOptions {
    fn judge(&self, plan: &VariantPlan) -> Result<Judge, Failure> {
        let named = |names: &[String], sense| names.iter().map(|name| (name.clone(), sense)).collect::<Vec<_>>();
        let targets = [named(&self.least, Sense::Least), named(&self.most, Sense::Most)].concat();
        Ok(Judge { constraints: self.keep.clone(), targets }.of(plan)?)
    }
}

/// The plan of a folder, which has its own drive and output folder.
fn opened(context: &Context, folder: &Path) -> Result<VariantPlan, Failure> {
    if let Some(option) = context.changes_the_drive().or(context.has_out().then_some("--out")) {
        return Err(Failure::BadInput(format!("{option}: found it with a plan, which has its own; plan anew")));
    }
    Ok(VariantPlan::read(folder)?)
}

fn computed(context: &Context, plan: &VariantPlan, folder: &Path, shard: Shard) -> Result<Ran, Failure> {
    let progress = context.progress("sweep");
    let ran = run(plan, folder, shard, &|done, of, row| {
        let name = format!("variant {} {}", row.variant + 1, row.generator);
        if context.verbose() {
            progress.line(&format!("{name} [{}]: {}", plan.variants[row.variant].join(", "), row.status.name()));
        }
        progress.set(done, of, &name);
    })?;
    Ok(ran)
}

/// Writes sweep.csv, sweep.json and report.html; `partial` of a plan that was read, which has a drive of its own.
fn reduced(
    context: &Context,
    plan: &VariantPlan,
    folder: &Path,
    judge: &Judge,
    partial: Option<bool>,
) -> Result<(), Failure> {
    let sweep = reduce(plan, folder, judge, partial.unwrap_or(false))?;
    let remarks = remarks(plan, &sweep);
    let sources = SweepSources { plan, command: &context.command, judge, sweep: &sweep, remarks: &remarks };
    let page = sweep_report::page(&sources);
    let page = Page { title: context.titled(&page.title), ..page };
    let csv = sweep.csv(plan)?;
    let mut outputs = Outputs::new();
    outputs.file(&folder.join("sweep.csv"), |file| file.write_all(&csv))?;
    outputs.json(&folder.join("sweep.json"), &sweep)?;
    report::write(&page, folder, &mut outputs)?;
    outputs.finish()?;
    context.print(&sweep, || {
        let ReducedSweep { drive, converged, failed, refused, meet, rows, .. } = &sweep;
        let runs = rows.len();
        let mut text = format!(
            "{drive}: {runs} runs; {converged} converged, {failed} failed, {refused} refused; {meet} meet the \
             constraints\n"
        );
        text.extend(remarks.iter().map(|remark| format!("remark: {remark}\n")));
        for Headline { choice, answer, .. } in &page.headlines {
            text += &format!("{}{answer}\n", choice.as_ref().map_or_else(String::new, |of| format!("{of}: ")));
        }
        let (folder, spent) = (folder.display(), context.spent().in_words());
        text += &format!("wrote sweep.csv, sweep.json and report.html to {folder}/ in {spent}");
        let front = judge.front(plan, &sweep.rows);
        let next =
            front.first().filter(|_| partial.is_none()).map(|VariantRow { generator: kind, variant, .. }| {
                let choices = plan.sets(*variant).into_iter().filter(|set| !is_error_of_making(set));
                let sets: String = choices.map(|set| format!(" --set {}", quoted(&set))).collect();
                context.next(&format!("tables --generator {kind}{sets}"))
            });
        text + &say::next(next.as_slice())
    })?;
    if sweep.converged == 0 {
        let why = sweep.rows.iter().map(|row| row.why.as_str()).find(|why| !why.is_empty()).unwrap_or_default();
        return Err(Failure::Failed(format!("no variant converged; the first: {why}")));
    }
    Ok(())
}

/// Remarks on the results.
fn remarks(plan: &VariantPlan, sweep: &ReducedSweep) -> Vec<String> {
    let mut remarks = Vec::new();
    if sweep.missing > 0 {
        remarks.push(format!("PARTIAL: {} of {} runs are missing", sweep.missing, sweep.missing + sweep.rows.len()));
    }
    for (status, count, what) in
        [(RunStatus::Failed, sweep.failed, "did not converge"), (RunStatus::Refused, sweep.refused, "make no drive")]
    {
        if let Some(first) = sweep.rows.iter().find(|row| row.status == status) {
            remarks.push(format!("{count} runs {what}; the first, variant {}: {}", first.variant + 1, first.why));
        }
    }
    if !plan.is_of_tolerances() {
        remarks.extend(Caution::of_stiffness(&plan.drive).map(|caution| caution.words));
    }
    let errors: Vec<&str> = plan.columns.iter().map(String::as_str).filter(|path| is_error_of_making(path)).collect();
    if !plan.is_of_tolerances() && !errors.is_empty() {
        remarks.push(format!(
            "{} is no choice: variants are compared with those that have the same manufacturing errors, at one place \
             of a turn; --tolerances, and tables, take whole turns",
            errors.join(", ")
        ));
    }
    let runs = |of: &dyn Fn(&VariantRow) -> bool| sweep.rows.iter().filter(|row| of(row)).count();
    let sum = |of: fn(&OfGenerator) -> usize| sweep.generators.iter().map(of).sum::<usize>();
    for (count, what) in [
        (runs(&|row| row.meets && !row.cautions.is_empty()), "runs that meet the constraints have a caution"),
        (
            runs(&|row| Judge::is_preloaded(plan, row)),
            "runs have a backlash below zero: teeth that are preloaded, or did not settle; none is among the best",
        ),
        (
            sum(|of| of.beyond_kernels),
            "drives have axes further apart than the kernels reach; their errors are extrapolated",
        ),
        (sum(|of| of.play_closed), "drives have no play at some place; lost motion there is the wind-up alone"),
    ] {
        if count > 0 {
            remarks.push(format!("{count} {what}"));
        }
    }
    remarks
}
