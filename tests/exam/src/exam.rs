//! The examination: draws cases, commits to the truth, has each diagnosed by another process, and scores.

use std::collections::VecDeque;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::thread;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::answer::Answer;
use crate::case::{Case, Draw};
use crate::chance::Chance;
use crate::score::{Gathered, Judged, judge};
use crate::truth::{Truth, commitment};

/// Longest diagnosis, s.
const LIMIT_S: f64 = 300.0;

/// How the examination runs.
#[derive(clap::Args)]
pub struct Settings {
    /// How many cases
    #[arg(long, default_value_t = 50)]
    pub cases: u64,
    /// Seed [default: fresh from the operating system, printed]
    #[arg(long)]
    pub seed: Option<u64>,
    /// Program to examine
    #[arg(long, default_value = "flexspline")]
    pub diagnoser: String,
    /// Diagnoses at a time
    #[arg(long, default_value_t = 2)]
    pub jobs: usize,
    /// Directory for answers, and afterwards the truth and the scores
    #[arg(long, default_value = "out/exam")]
    pub out: PathBuf,
    #[command(flatten)]
    pub draw: Draw,
}

/// A run with its scores.
#[derive(Serialize)]
pub struct Examination {
    pub seed: u64,
    /// Options that draw the same cases.
    pub options: String,
    /// BLAKE3 of the truths, known before the answers.
    pub commitment: String,
    pub scores: Gathered,
    pub cases: Vec<Judged>,
}

/// Examines.
///
/// # Errors
/// If files cannot be written.
pub fn run(settings: &Settings) -> io::Result<Examination> {
    let seed = settings.seed.unwrap_or_else(Chance::fresh_seed);
    let options = settings.draw.options();
    let draw = |index| {
        let case = Case::draw(seed, index, &settings.draw);
        (case.truth(), case)
    };
    let (truths, cases): (Vec<_>, Vec<_>) =
        in_parallel(settings.jobs, (0..settings.cases).collect(), draw).into_iter().unzip();
    let commitment = commitment(&truths);
    println!("seed {seed}{options}");
    println!("truth of {} cases, BLAKE3 {commitment}", truths.len());
    // In the order of their names, which is no order.
    let mut order: Vec<usize> = (0..truths.len()).collect();
    order.sort_by(|a, b| truths[*a].name.cmp(&truths[*b].name));
    let judged = in_parallel(settings.jobs, order, |at| {
        let (answer, seconds) = ask(settings, &cases[at], &truths[at])?;
        Ok(judge(&truths[at], &answer, seconds))
    });
    let cases = judged.into_iter().collect::<io::Result<Vec<Judged>>>()?;
    let folder = settings.out.join("truth");
    fs::create_dir_all(&folder)?;
    truths.iter().try_for_each(|truth| fs::write(folder.join(format!("{}.json", truth.name)), truth.json()))?;
    let examination = Examination { seed, options, commitment, scores: Gathered::of(&cases), cases };
    fs::write(settings.out.join("exam.json"), serde_json::to_string_pretty(&examination)?)?;
    Ok(examination)
}

/// The cases of a run that was written.
///
/// # Errors
/// If there is no such file, or it holds no run.
pub fn cases(path: &Path) -> io::Result<Vec<Judged>> {
    #[derive(Deserialize)]
    struct Written {
        cases: Vec<Judged>,
    }
    let wrong = |error: &dyn std::fmt::Display| io::Error::other(format!("{}: {error}", path.display()));
    let text = fs::read_to_string(path).map_err(|error| wrong(&error))?;
    let written: Written = serde_json::from_str(&text).map_err(|error| wrong(&error))?;
    Ok(written.cases)
}

/// Writes the data of a case, has it diagnosed, and takes the data away.
fn ask(settings: &Settings, case: &Case, truth: &Truth) -> io::Result<(Result<Answer, String>, f64)> {
    let given = settings.out.join("cases").join(&truth.name);
    let answered = settings.out.join("answers").join(&truth.name);
    fs::create_dir_all(&given)?;
    fs::create_dir_all(&answered)?;
    fs::write(given.join("data.csv"), case.data())?;
    fs::write(given.join("nominal.toml"), case.nominal_toml())?;
    let mut command = Command::new(&settings.diagnoser);
    command
        .arg("diagnose")
        .arg(given.join("data.csv"))
        .arg("--model")
        .arg(given.join("nominal.toml"))
        .arg("--out")
        .arg(&answered)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(fs::File::create(answered.join("stderr.txt"))?);
    let start = Instant::now();
    let ended = wait(&mut command);
    let seconds = start.elapsed().as_secs_f64();
    let read = |file: &str| fs::read_to_string(answered.join(file)).map_err(|error| format!("{file}: {error}"));
    let answer = match ended {
        Ok(()) => read("diagnosis.json")
            .and_then(|text| Answer::read(&text).map_err(|error| format!("diagnosis.json: {error}"))),
        // A run that ends at the ratio or the units has no diagnosis.json: right where these are what is wrong.
        Err(error) => {
            let said = read("stderr.txt").unwrap_or_default();
            let of_refusal = Answer::of_refusal(case.fault, &error, &said);
            of_refusal.filter(|answer| truth.accepts(answer)).ok_or(error)
        }
    };
    fs::remove_dir_all(&given)?;
    Ok((answer, seconds))
}

fn wait(command: &mut Command) -> Result<(), String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let mut child = command.spawn().map_err(|error| format!("{name}: {error}"))?;
    let start = Instant::now();
    loop {
        match child.try_wait().map_err(|error| error.to_string())? {
            Some(status) if status.success() => return Ok(()),
            Some(status) => return Err(format!("{name}: {status}")),
            None if start.elapsed().as_secs_f64() > LIMIT_S => {
                let _ = child.kill();
                let _ = child.wait();
                return Err(format!("{name}: not done after {LIMIT_S} s"));
            }
            None => thread::sleep(Duration::from_millis(10)),
        }
    }
}

/// Does the work on these threads; results in the order of the things.
fn in_parallel<T: Send, R: Send>(threads: usize, things: Vec<T>, work: impl Fn(T) -> R + Sync) -> Vec<R> {
    let results: Mutex<Vec<(usize, R)>> = Mutex::new(Vec::with_capacity(things.len()));
    let queue: Mutex<VecDeque<(usize, T)>> = Mutex::new(things.into_iter().enumerate().collect());
    thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(|| {
                loop {
                    let Some((at, thing)) = queue.lock().expect("no panic holds it").pop_front() else { break };
                    let result = work(thing);
                    results.lock().expect("no panic holds it").push((at, result));
                }
            });
        }
    });
    let mut results = results.into_inner().expect("no panic holds it");
    results.sort_by_key(|(at, _)| *at);
    results.into_iter().map(|(_, result)| result).collect()
}
