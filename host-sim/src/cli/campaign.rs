//! `flexspline campaign`: tolerances, thousands of drives on any engine.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use clap::{Args, Subcommand, ValueHint};
use serde::Serialize;

use super::context::quoted;
use super::{Context, Failure, names, report, say};
use flexspline_base::output::{Outputs, prepare_folder, write_whole};
use flexspline_design::campaign::{
    Became, Campaign, EXAMPLE, JUDGED, OfGenerator, Plan, PlanError, PlanSettings, Quantile, ReduceError, SHARED,
    ShardError, ShardState, Tolerances, look, plan, reduce, run_shard, worst_path,
};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_report::campaign_report;

/// Simulate thousands of drives drawn from tolerances and report which tolerance to tighten first
///
/// `plan` reads the tolerances, computes the drive as drawn by contact FEM (influence kernels and the effect of each
/// dimension) and writes plan.json. `run` computes one shard of the drives. Shards can run anywhere, in any order and
/// more than once: the results are the same to the bit. `reduce` reports quantiles, exceedance probabilities, variance
/// shares, the benefit of halving each tolerance and the error that tables leave, and writes the worst drives as files.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline campaign plan --example > tolerances.toml
  flexspline campaign plan tolerances.toml --drives 10000 --shards 20 --out campaign
  flexspline campaign run campaign --shard 7
  flexspline campaign run campaign --shard all
  flexspline campaign reduce campaign

Every shard that is there and sound is skipped; a damaged one is computed anew.")]
pub(super) struct CampaignCommand {
    #[command(subcommand)]
    step: CampaignStep,
}

#[derive(Debug, Subcommand)]
enum CampaignStep {
    Plan(PlanCommand),
    Run(RunCommand),
    Reduce(ReduceCommand),
}

/// Read tolerances, compute the drive as drawn, and write plan.json
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline campaign plan --example > tolerances.toml
  flexspline campaign plan tolerances.toml --drives 10000 --shards 20 --fem 200 --out campaign")]
struct PlanCommand {
    /// File of tolerances
    #[arg(value_name = "TOL.toml", value_hint = ValueHint::FilePath, required_unless_present = "example")]
    tolerances: Option<PathBuf>,
    /// Print a commented file of tolerances
    #[arg(long, conflicts_with = "tolerances")]
    example: bool,
    /// Number of drives, up to 65536
    #[arg(long, value_name = "N", default_value_t = 10_000)]
    drives: u32,
    /// Number of shards
    #[arg(long, value_name = "S", default_value_t = 20)]
    shards: u32,
    /// Number of drives, from the first on, that are also computed by FEM to check the kernels
    #[arg(long, value_name = "M", default_value_t = 0)]
    fem: u32,
    /// Positions over an output turn at which the FEM computes them
    #[arg(long, value_name = "P", default_value_t = 23)]
    fem_places: u32,
    /// Mesh: coarse, standard or fine
    #[arg(long, value_name = "LEVEL", default_value = "coarse", value_parser = names::mesh(), hide_possible_values = true)]
    mesh: MeshLevel,
}

/// Compute a shard of a plan's drives
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline campaign run campaign --shard 7
  flexspline campaign run campaign --shard all --threads 2")]
struct RunCommand {
    /// Folder of the campaign
    #[arg(value_name = "DIR", value_hint = ValueHint::DirPath)]
    folder: PathBuf,
    /// Number of the shard, from 0, or all of them
    #[arg(long, value_name = "I|all")]
    shard: Which,
}

/// Reduce the shards to campaign.json and report.html, in the folder of the campaign
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline campaign reduce campaign
  flexspline campaign reduce campaign --partial")]
struct ReduceCommand {
    /// Folder of the campaign
    #[arg(value_name = "DIR", value_hint = ValueHint::DirPath)]
    folder: PathBuf,
    /// Accept a campaign with missing shards
    #[arg(long)]
    partial: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Which {
    One(u32),
    All,
}

impl FromStr for Which {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Which, Self::Err> {
        if text == "all" {
            return Ok(Which::All);
        }
        text.parse().map(Which::One).map_err(|_| "allowed: a number from 0, or all")
    }
}

impl CampaignCommand {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        match &self.step {
            CampaignStep::Plan(step) => step.run(context),
            CampaignStep::Run(step) => step.run(context),
            CampaignStep::Reduce(step) => step.run(context),
        }
    }
}

fn of_plan(error: PlanError) -> Failure {
    match error {
        PlanError::Failed(what) => Failure::Failed(what),
        refused => Failure::BadInput(refused.to_string()),
    }
}

/// A plan that is there already; the drive is the plan's.
fn opened(context: &Context, folder: &Path) -> Result<(Plan, [u8; 32]), Failure> {
    if let Some(option) = context.changes_the_drive() {
        return Err(Failure::BadInput(format!("{option}: found it beside a plan, which has its own drive; plan anew")));
    }
    Plan::read(folder).map_err(of_plan)
}

fn short(hash: &[u8; 32]) -> String {
    blake3::Hash::from_bytes(*hash).to_hex().as_str()[..16].to_owned()
}

/// What `plan --json` prints.
#[derive(Serialize)]
struct PlanReport<'a> {
    schema_version: u32,
    plan_hash: String,
    drive: &'a str,
    drives: u32,
    shards: u32,
    fem_drives: u32,
    tolerances: Vec<&'a str>,
    wall_s: f64,
}

/// What `plan --example --json` prints.
#[derive(Serialize)]
struct Example {
    schema_version: u32,
    tolerances: &'static str,
}

impl PlanCommand {
    fn run(&self, context: &Context) -> Result<(), Failure> {
        let clock = Instant::now();
        let Some(file) = &self.tolerances else {
            return context
                .print_data(&Example { schema_version: 1, tolerances: EXAMPLE }, || EXAMPLE.trim_end().to_owned());
        };
        if context.has_drive() {
            return Err(Failure::BadInput(
                "--drive: found it beside a file of tolerances, which names the drive".into(),
            ));
        }
        let name = file.display().to_string();
        let text = std::fs::read_to_string(file).map_err(|error| Failure::BadInput(format!("{name}: {error}")))?;
        let tolerances = Tolerances::read(&name, &text, |drive| {
            let beside = file.parent().unwrap_or(Path::new("")).join(drive);
            let called = if beside.is_file() { beside.display().to_string() } else { drive.to_owned() };
            context.drive_called("drive", &called).map_err(|failure| match failure {
                Failure::BadInput(what) | Failure::Failed(what) => what.trim_start_matches("drive: ").to_owned(),
            })
        })
        .map_err(of_plan)?;
        let out = context.out()?;
        let settings = PlanSettings {
            drives: self.drives,
            shards: self.shards,
            fem_drives: self.fem,
            fem_places: self.fem_places,
            mesh: self.mesh,
        };
        let progress = Mutex::new(context.progress("plan"));
        let made = plan(&tolerances, settings, &|done, of, what| {
            if let Ok(mut bar) = progress.lock() {
                bar.set(done, of, what);
            }
        })
        .map_err(of_plan)?;
        drop(progress);
        let text = made.text();
        let hash = *blake3::hash(text.as_bytes()).as_bytes();
        let path = Plan::path(out);
        keeps_other_shards(out, &text)?;
        prepare_folder(&out.join("shards"))?;
        write_whole(&path, |to| to.write_all(text.as_bytes()))?;
        let told = PlanReport {
            schema_version: 1,
            plan_hash: short(&hash),
            drive: &tolerances.drive.name,
            drives: made.drives,
            shards: made.shards,
            fem_drives: made.fem_drives,
            tolerances: made.tolerances.iter().map(|t| t.name.as_str()).collect(),
            wall_s: clock.elapsed().as_secs_f64(),
        };
        context.print(&told, || {
            let folder = quoted(&out.display().to_string());
            format!(
                "plan {}: {} of {}, {}, {}, {} by FEM\nwrote {} in {}",
                told.plan_hash,
                counted(told.drives as usize, "drive"),
                told.drive,
                counted(told.tolerances.len(), "tolerance"),
                counted(told.shards as usize, "shard"),
                counted(told.fem_drives as usize, "drive"),
                path.display(),
                context.spent().in_words()
            ) + &say::next(&[
                format!("flexspline campaign run {folder} --shard all"),
                format!("flexspline campaign reduce {folder}"),
            ])
        })
    }
}

/// A folder with shards of another plan keeps that plan.
fn keeps_other_shards(out: &Path, text: &str) -> Result<(), Failure> {
    let Ok(other) = std::fs::read_to_string(Plan::path(out)) else { return Ok(()) };
    let count = std::fs::read_dir(out.join("shards")).map_or(0, Iterator::count);
    if other == text || count == 0 {
        return Ok(());
    }
    Err(Failure::BadInput(format!(
        "--out: found {}, which holds {count} shards of another plan; give another folder, or remove it",
        out.display()
    )))
}

/// What `run --json` prints.
#[derive(Serialize)]
struct Ran {
    schema_version: u32,
    plan_hash: String,
    computed: Vec<u32>,
    redone: Vec<u32>,
    there: Vec<u32>,
    wall_s: f64,
}

impl RunCommand {
    fn run(&self, context: &Context) -> Result<(), Failure> {
        let clock = Instant::now();
        let (plan, hash) = opened(context, &self.folder)?;
        let wanted: Vec<u32> = match self.shard {
            Which::All => (0..plan.shards).collect(),
            Which::One(shard) if shard < plan.shards => vec![shard],
            Which::One(shard) => {
                let most = plan.shards - 1;
                return Err(Failure::BadInput(format!("--shard: found {shard}, allowed: 0 to {most}, or all")));
            }
        };
        prepare_folder(&self.folder.join("shards"))?;
        let models = plan.models();
        let progress = Mutex::new(context.progress("campaign"));
        let of: usize = wanted.iter().map(|shard| plan.drives_of(*shard).count()).sum();
        let done = AtomicUsize::new(0);
        let mut ran = Ran {
            schema_version: 1,
            plan_hash: short(&hash),
            computed: Vec::new(),
            redone: Vec::new(),
            there: Vec::new(),
            wall_s: 0.0,
        };
        for shard in wanted {
            if let ShardState::Damaged(why) = look(&plan, &hash, &self.folder, shard) {
                say::talk(&format!("shard {shard}: {why}; computed anew"));
            }
            let told = || {
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                if let Ok(mut bar) = progress.lock() {
                    bar.set(done, of, &format!("shard {shard}"));
                }
            };
            let became = run_shard(&plan, &hash, &models, &self.folder, shard, &told).map_err(|error| match error {
                ShardError::Foreign { .. } | ShardError::Plan(_) => Failure::BadInput(error.to_string()),
                ShardError::Output(_) => Failure::Failed(error.to_string()),
            })?;
            match became {
                Became::There => {
                    done.fetch_add(plan.drives_of(shard).count(), Ordering::Relaxed);
                    ran.there.push(shard);
                }
                Became::Computed => ran.computed.push(shard),
                Became::Redone => ran.redone.push(shard),
            }
        }
        drop(progress);
        ran.wall_s = clock.elapsed().as_secs_f64();
        context.print(&ran, || {
            format!(
                "plan {}: {} computed, {} computed anew, {} there already, in {}",
                ran.plan_hash,
                counted(ran.computed.len(), "shard"),
                ran.redone.len(),
                ran.there.len(),
                context.spent().in_words()
            )
        })
    }
}

/// `campaign.json`, and what `reduce --json` prints.
#[derive(Serialize)]
struct Reduced<'a> {
    schema_version: u32,
    tool_version: &'static str,
    plan_hash: String,
    drive: &'a str,
    partial: bool,
    torque_n_m: f64,
    temperature_c: f64,
    tolerances: &'a [flexspline_design::campaign::Tolerance],
    #[serde(flatten)]
    campaign: &'a Campaign,
}

impl ReduceCommand {
    fn run(&self, context: &Context) -> Result<(), Failure> {
        let (plan, hash) = opened(context, &self.folder)?;
        let out = if context.has_out() { context.out()?.to_owned() } else { self.folder.clone() };
        report::before(context, &out, "campaign", None);
        let campaign = reduce(&plan, &hash, &self.folder, self.partial).map_err(|error| match error {
            ReduceError::Incomplete(what) => Failure::Failed(what),
            ReduceError::Foreign(what) => Failure::BadInput(what),
        })?;
        let drive = plan.drive().map_err(|error| Failure::BadInput(error.to_string()))?;
        let told = Reduced {
            schema_version: 1,
            tool_version: env!("CARGO_PKG_VERSION"),
            plan_hash: short(&hash),
            drive: &drive.name,
            partial: !campaign.missing.is_empty(),
            torque_n_m: plan.torques_n_m[0],
            temperature_c: plan.temperature_c,
            tolerances: &plan.tolerances,
            campaign: &campaign,
        };
        let page = campaign_report::page(campaign_report::CampaignSources {
            plan: &plan,
            plan_hash: &told.plan_hash,
            drive: &drive,
            command: &context.command,
            campaign: &campaign,
        });
        let mut outputs = Outputs::new();
        outputs.json(&out.join("campaign.json"), &told)?;
        report::write(&page, &out, &mut outputs)?;
        for of in &campaign.generators {
            for worst in &of.worst {
                let path = worst_path(&out, of.generator, worst);
                prepare_folder(path.parent().unwrap_or(&out))?;
                outputs.file(&path, |file| file.write_all(worst.toml.as_bytes()))?;
            }
        }
        outputs.finish()?;
        context.print(&told, || {
            let mut text = String::new();
            if told.partial {
                let _ = writeln!(text, "PARTIAL: {} of {} drives", campaign.drives, campaign.planned);
            }
            for of in &campaign.generators {
                text += &lines(of);
            }
            let _ = write!(text, "wrote campaign.json, report.html and worst/ to {}/", out.display());
            let worst = campaign.generators.iter().find_map(|of| of.worst.first().map(|w| (of.generator, w)));
            let next = worst.map(|(kind, worst)| {
                let file = quoted(&worst_path(&out, kind, worst).display().to_string());
                format!("flexspline simulate --generator {kind} --drive {file} --path turn")
            });
            text + &say::next(&next.into_iter().collect::<Vec<_>>())
        })
    }
}

/// So many of something.
fn counted(count: usize, of: &str) -> String {
    format!("{count} {of}{}", if count == 1 { "" } else { "s" })
}

/// The interval of a quantile, or which end the drives do not have.
fn interval(of: &Quantile) -> String {
    let needed = of.drives_for_both_ends;
    match (of.low, of.high) {
        (Some(low), Some(high)) => format!("{low:.3} to {high:.3}"),
        (Some(low), None) => format!("{low:.3} and more; no upper bound, {needed} drives have one"),
        (None, Some(high)) => format!("{high:.3} and less; no lower bound, {needed} drives have one"),
        (None, None) => format!("no bounds, {needed} drives have them"),
    }
}

/// What is said of one generator.
fn lines(of: &OfGenerator) -> String {
    let mut text = format!("{}\n", of.generator);
    for name in [
        "error_pp_arcsec",
        "lost_motion_arcsec",
        "no_table_rms_arcsec",
        "nominal_table_rms_arcsec",
        "unit_table_rms_arcsec",
    ] {
        let Some(figure) = of.figures.iter().find(|figure| figure.figure == name) else { continue };
        let at = |share: f64| figure.quantiles.iter().find(|q| q.share == share).map_or(f64::NAN, |q| q.value);
        let judged = figure.quantiles.iter().find(|q| q.share == JUDGED);
        let _ = writeln!(
            text,
            "  {name:<26} half of the drives below {:.3}, 95 % below {:.3} ({})",
            at(0.5),
            at(JUDGED),
            judged.map_or_else(String::new, interval)
        );
    }
    for exceeded in &of.exceeded {
        let (value, low, high) = (100.0 * exceeded.of.value, 100.0 * exceeded.of.low, 100.0 * exceeded.of.high);
        let _ = writeln!(text, "  P(error > {}\") = {value:.3} % ({low:.3} to {high:.3})", exceeded.above);
    }
    if of.play_closed > 0 {
        let _ = writeln!(
            text,
            "  no play is left somewhere on {} by kernels; there lost motion is the wind-up alone",
            counted(of.play_closed, "drive")
        );
    }
    for figure in SHARED {
        let Some(first) = of.tighten.iter().find(|tightened| tightened.figure == figure) else { continue };
        let _ = writeln!(
            text,
            "  for {figure} tighten first: {}; halved, 95 % of {} are below {:.3} instead of {:.3}",
            first.tolerance,
            counted(first.drives, "drive"),
            first.after_arcsec,
            first.before_arcsec
        );
    }
    if let Some(fem) = &of.fem {
        if fem.figures.is_empty() {
            let _ = writeln!(
                text,
                "  {} by FEM: too few for a correlation, {} are needed; largest difference {:.3} of error_pp_arcsec \
                 by kernels",
                counted(fem.drives, "drive"),
                fem.drives_needed,
                fem.largest_difference_arcsec
            );
        }
        for figure in &fem.figures {
            let _ = writeln!(
                text,
                "  {} by FEM ({} drives, correlation {:.3}): mean {:.3} ({:.3} to {:.3}), by kernels {:.3}",
                figure.figure,
                fem.drives,
                figure.correlation,
                figure.controlled.value,
                figure.controlled.low,
                figure.controlled.high,
                figure.kernels_mean
            );
        }
    }
    text
}
