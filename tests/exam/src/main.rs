//! Examines `flexspline diagnose` from outside: measured-looking data from plants of its own, the truth kept apart and
//! committed to beforehand, and scores with intervals.
//!
//! Nothing here is linked with the simulator or shares a model with the diagnosis; what they have in common is the
//! written contract: column names, `nominal.toml`, names of causes, `diagnosis.json`.

mod answer;
mod arm;
mod case;
mod cause;
mod chance;
mod drive;
mod exam;
mod gear;
mod gimbal;
mod hides;
mod joint;
mod logger;
mod metrology;
mod noise;
mod oracle;
mod profile;
mod rate;
mod record;
mod scales;
mod score;
#[cfg(test)]
mod tests;
mod train;
mod truth;

use clap::{Args, Parser, Subcommand};
use std::fs;
use std::io;
use std::path::PathBuf;
use std::process::ExitCode;

use case::{Case, Draw};
use exam::Settings;
use score::{Gathered, RATES, Scores};

/// Arc-seconds in a radian.
const ARCSEC: f64 = 180.0 * 3600.0 / std::f64::consts::PI;

/// Examines `flexspline diagnose` on data from plants of its own.
#[derive(Parser)]
struct Cli {
    #[command(subcommand)]
    command: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Draw cases, have them diagnosed, score
    Run(Run),
    /// Put runs together, each a directory of `run`, and score all their cases: `gathered.json` and the table
    Gather(Gather),
    /// Write one case: data, nominal model, truth
    Case(One),
}

#[derive(Args)]
struct Run {
    #[command(flatten)]
    settings: Settings,
    #[command(flatten)]
    bounds: Bounds,
}

/// Bounds that fail the run. A bound is missed where its side of the 95 % interval lies beyond it, so that few cases
/// fail only what is surely wrong; `--strict` takes the bare share.
#[derive(Args)]
struct Bounds {
    /// At least this share: `NAME=SHARE`, a rate of the table; repeat for more
    #[arg(long, value_parser = bound, value_name = "NAME=SHARE")]
    at_least: Vec<(String, f64)>,
    /// At most this share
    #[arg(long, value_parser = bound, value_name = "NAME=SHARE")]
    at_most: Vec<(String, f64)>,
    /// Without regard for the number of cases
    #[arg(long)]
    strict: bool,
}

fn bound(text: &str) -> Result<(String, f64), String> {
    let (name, share) = text.split_once('=').ok_or("NAME=SHARE")?;
    let share: f64 = share.parse().map_err(|_| format!("`{share}` is no number"))?;
    if !RATES.contains(&name) {
        return Err(format!("`{name}` is no rate; allowed: {}", RATES.join(", ")));
    }
    if (0.0..=1.0).contains(&share) { Ok((name.to_owned(), share)) } else { Err(format!("{share} is not within 0..1")) }
}

impl Bounds {
    /// Prints what was missed; whether all hold.
    fn hold(&self, scores: &Scores) -> bool {
        let mut missed = 0;
        let both = self.at_least.iter().map(|d| (d, true)).chain(self.at_most.iter().map(|d| (d, false)));
        for ((name, bound), least) in both {
            let rate = scores.rate(name);
            let (low, high) = if self.strict { (rate.share(), rate.share()) } else { rate.interval() };
            if rate.of > 0 && (least && high < *bound || !least && low > *bound) {
                println!("MISSED {name}: {rate}, asked {} {bound}", if least { "at least" } else { "at most" });
                missed += 1;
            }
        }
        missed == 0
    }
}

#[derive(Args)]
struct Gather {
    /// Directories of runs
    #[arg(required = true)]
    runs: Vec<PathBuf>,
    /// Directory for `gathered.json`
    #[arg(long, default_value = "out/exam")]
    out: PathBuf,
    #[command(flatten)]
    bounds: Bounds,
}

#[derive(Args)]
struct One {
    /// Seed of the examination
    #[arg(long)]
    seed: u64,
    /// Index of the case
    #[arg(long)]
    index: u64,
    /// Directory
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    draw: Draw,
}

fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Task::Run(options) => run(&options),
        Task::Gather(options) => gather(&options),
        Task::Case(options) => one(&options).map(|()| true),
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn run(options: &Run) -> io::Result<bool> {
    let settings = &options.settings;
    let examination = exam::run(settings)?;
    println!("\n{}", examination.scores.table());
    println!(
        "went wrong (write one out: case --seed {} --index I --out DIR{}):",
        examination.seed, examination.options
    );
    for case in examination.cases.iter().filter(|case| case.went_wrong()) {
        let hidden: Vec<_> = case.hidden.iter().map(|(name, over)| format!("{name} ×{over:.1}")).collect();
        println!(
            "  index {:<4} {} {:<9} {:<60} said {} [{}] faults [{}] {}",
            case.index,
            case.family,
            case.kind,
            hidden.join(" + "),
            case.verdict,
            case.named.join(", "),
            case.faults.join(", "),
            case.bench.join(" "),
        );
    }
    println!("all cases: {}", settings.out.join("exam.json").display());
    Ok(options.bounds.hold(&examination.scores.all))
}

fn gather(options: &Gather) -> io::Result<bool> {
    let mut cases = Vec::new();
    for run in &options.runs {
        cases.extend(exam::cases(&run.join("exam.json"))?);
    }
    let scores = Gathered::of(&cases);
    println!("{}", scores.table());
    fs::create_dir_all(&options.out)?;
    let file = options.out.join("gathered.json");
    fs::write(&file, serde_json::to_string_pretty(&scores)?)?;
    println!("all scores: {}", file.display());
    Ok(options.bounds.hold(&scores.all))
}

fn one(options: &One) -> io::Result<()> {
    fs::create_dir_all(&options.out)?;
    let case = Case::draw(options.seed, options.index, &options.draw);
    let truth = case.truth().json();
    for (name, text) in [("data.csv", &case.data()), ("nominal.toml", &case.nominal_toml()), ("truth.json", &truth)] {
        fs::write(options.out.join(name), text)?;
    }
    print!("{truth}");
    Ok(())
}
