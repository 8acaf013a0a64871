//! `flexspline-exam run`: examines a diagnosis. `flexspline-exam case`: one case of an examination with its truth.

use clap::{Args, Parser, Subcommand};
use std::fmt::Write;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use flexspline_exam::case::{Case, Draw};
use flexspline_exam::chance::Chance;
use flexspline_exam::exam::{self, Settings};
use flexspline_exam::plant;
use flexspline_exam::question::Question;
use flexspline_exam::score::Scores;

/// Examines `flexspline diagnose` on data from a plant of its own.
#[derive(Parser)]
struct Cli {
    #[command(subcommand)]
    command: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Draw cases, have them diagnosed, score
    Run(Run),
    /// Put runs together, each a directory of `run`, and score all their cases: `exam.json` and the table
    Gather(Gather),
    /// Write one case: data, nominal model, truth, and each part of the error for plots
    Case(One),
}

#[derive(Args)]
struct Run {
    /// How many cases
    #[arg(long, default_value_t = 50)]
    cases: u64,
    /// Seed [default: fresh from the operating system, printed]
    #[arg(long)]
    seed: Option<u64>,
    /// Program to examine
    #[arg(long, default_value = "flexspline")]
    diagnoser: String,
    /// Argument of that program before `diagnose`; repeat for more
    #[arg(long, allow_hyphen_values = true)]
    diagnoser_arg: Vec<String>,
    /// Diagnoses at a time
    #[arg(long, default_value_t = 2)]
    jobs: usize,
    /// Longest diagnosis, s
    #[arg(long, default_value_t = 300.0)]
    limit_s: f64,
    /// Directory for data, answers, and afterwards the truth and the scores
    #[arg(long, default_value = "out/exam")]
    out: PathBuf,
    /// Keep the data of cases that went wrong
    #[arg(long)]
    keep: bool,
    /// Write the truth here before asking: for testing the examiner alone
    #[arg(long, value_name = "DIR")]
    reveal: Option<PathBuf>,
    /// Take the truth of these cases from here: for testing the examiner alone
    #[arg(long, value_name = "DIR", conflicts_with = "reveal")]
    revealed: Option<PathBuf>,
    #[command(flatten)]
    draw: Draw,
    #[command(flatten)]
    demands: Demands,
}

/// Bounds that fail the run. A bound is missed where its side of the 95 % interval lies beyond it, so that few cases
/// fail only what is surely wrong; `--strict` takes the bare share.
#[derive(Args)]
struct Demands {
    /// At least this share: `NAME=SHARE`, a rate of the table; repeat for more
    #[arg(long, value_parser = demand, value_name = "NAME=SHARE")]
    at_least: Vec<(String, f64)>,
    /// At most this share
    #[arg(long, value_parser = demand, value_name = "NAME=SHARE")]
    at_most: Vec<(String, f64)>,
    /// At least this mean share of the removable held-out variance (two standard errors allowed)
    #[arg(long)]
    removed: Option<f64>,
    /// Without regard for the number of cases
    #[arg(long)]
    strict: bool,
}

fn demand(text: &str) -> Result<(String, f64), String> {
    let (name, share) = text.split_once('=').ok_or("NAME=SHARE")?;
    let share: f64 = share.parse().map_err(|_| format!("`{share}` is no number"))?;
    if (0.0..=1.0).contains(&share) { Ok((name.to_owned(), share)) } else { Err(format!("{share} is not within 0..1")) }
}

impl Demands {
    fn missed(&self, scores: &Scores) -> Vec<String> {
        let mut missed = Vec::new();
        let both = self.at_least.iter().map(|d| (d, true)).chain(self.at_most.iter().map(|d| (d, false)));
        for ((name, bound), least) in both {
            let Some(rate) = scores.rate(name) else {
                missed.push(format!("no rate `{name}`"));
                continue;
            };
            let (low, high) = if self.strict { (rate.share(), rate.share()) } else { rate.interval() };
            if rate.of > 0 && (least && high < *bound || !least && low > *bound) {
                missed.push(format!("{name}: {rate}, asked {} {bound}", if least { "at least" } else { "at most" }));
            }
        }
        if let Some(bound) = self.removed {
            let (mean, error) = scores.removed_mean;
            if mean + if self.strict { 0.0 } else { 2.0 * error } < bound {
                missed.push(format!("removable variance removed: {mean:.3} ± {error:.3}, asked at least {bound}"));
            }
        }
        missed
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
    demands: Demands,
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
        Task::Run(options) => run(options),
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

fn run(options: Run) -> io::Result<bool> {
    options.draw.check().map_err(io::Error::other)?;
    let mut program = vec![options.diagnoser];
    program.extend(options.diagnoser_arg);
    let settings = Settings {
        seed: options.seed.unwrap_or_else(Chance::fresh_seed),
        cases: options.cases,
        draw: options.draw,
        program,
        jobs: options.jobs,
        limit_s: options.limit_s,
        out: options.out,
        keep: options.keep,
        reveal: options.reveal,
        revealed: options.revealed,
    };
    let examination = exam::run(&settings)?;
    println!("\n{}", examination.scores.table());
    let wrong: Vec<_> = examination.cases.iter().filter(|case| case.went_wrong()).collect();
    if !wrong.is_empty() {
        println!(
            "went wrong (write one out: case --seed {} --index I --out DIR{}):",
            settings.seed,
            settings.draw.options()
        );
        for case in wrong {
            let hidden: Vec<_> = case.hidden.iter().map(|(name, over)| format!("{name} ×{over:.1}")).collect();
            println!(
                "  index {:<4} {} {} {:<9} {:<60} said {} [{}] faults [{}] {} {}",
                case.index,
                case.name,
                case.family,
                case.kind,
                hidden.join(" + "),
                case.verdict,
                case.named.join(", "),
                case.faults.join(", "),
                case.poor.join(" "),
                case.bench.join(" "),
            );
        }
    }
    println!("all cases: {}", settings.out.join("exam.json").display());
    let missed = options.demands.missed(&examination.scores);
    for line in &missed {
        println!("MISSED {line}");
    }
    Ok(missed.is_empty())
}

fn gather(options: &Gather) -> io::Result<bool> {
    let mut cases = Vec::new();
    for run in &options.runs {
        cases.extend(exam::cases(&run.join("exam.json"))?);
    }
    let scores = Scores::of(&cases);
    println!("{}", scores.table());
    fs::create_dir_all(&options.out)?;
    let told = options.out.join("gathered.json");
    fs::write(&told, serde_json::to_string_pretty(&scores)?)?;
    println!("all scores: {}", told.display());
    let missed = options.demands.missed(&scores);
    missed.iter().for_each(|line| println!("MISSED {line}"));
    Ok(missed.is_empty())
}

fn one(options: &One) -> io::Result<()> {
    options.draw.check().map_err(io::Error::other)?;
    fs::create_dir_all(&options.out)?;
    let write = |name: &str, text: String| fs::write(options.out.join(name), text);
    let question = Question::draw(options.seed, options.index, &options.draw);
    write("data.csv", question.data())?;
    write("nominal.toml", question.nominal_toml())?;
    write("truth.json", question.truth().json())?;
    let of_parts = match &question {
        Question::Case(case) => parts(case),
        Question::Fresh(case, _) => case.parts(),
    };
    write("parts.csv", of_parts)?;
    print!("{}", fs::read_to_string(Path::new(&options.out).join("truth.json"))?);
    Ok(())
}

/// The error without noise, that of the unit without what is hidden, and what each hidden effect adds to the others.
fn parts(case: &Case) -> String {
    let run = |effects: &[_]| plant::run(&case.drive, &case.unit, &case.motion, effects).error_arcsec;
    let all = case.readings();
    let base = run(&[]);
    let mut header = String::from("time_s,generator_rad,torque_n_m,temperature_c,error_arcsec,unit_arcsec");
    let mut added = Vec::new();
    for (at, effect) in case.effects.iter().enumerate() {
        let _ = write!(header, ",{}", effect.what.name());
        let mut rest = case.effects.clone();
        rest.remove(at);
        added.push(run(&rest));
    }
    let mut text = header + "\n";
    for (row, at) in case.motion.picks(case.motion.stride).into_iter().enumerate() {
        let _ = write!(
            text,
            "{:.5},{:.7},{:.4},{:.2},{:.4},{:.4}",
            case.motion.time_s[at],
            all.generator_rad[row],
            case.motion.torque_n_m[at],
            case.motion.temperature_c[at],
            all.error_arcsec[row],
            base[row]
        );
        for without in &added {
            let _ = write!(text, ",{:.4}", all.error_arcsec[row] - without[row]);
        }
        text.push('\n');
    }
    text
}
