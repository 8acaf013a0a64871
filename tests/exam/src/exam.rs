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
use crate::question::Question;
use crate::score::{Judged, Scores, judge};
use crate::truth::{Truth, commitment};

/// How the examination runs.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Seed of all cases.
    pub seed: u64,
    /// How many.
    pub cases: u64,
    /// Which.
    pub draw: Draw,
    /// Program to examine and arguments before `diagnose`.
    pub program: Vec<String>,
    /// Diagnoses at a time.
    pub jobs: usize,
    /// Longest run of one, s.
    pub limit_s: f64,
    /// Where everything goes.
    pub out: PathBuf,
    /// Keep the data of cases that went wrong.
    pub keep: bool,
    /// Write the truth before the answers are there: for testing the examiner, never for examining.
    pub reveal: Option<PathBuf>,
    /// What the oracle said of these cases before, as `reveal` wrote it: for testing the examiner, never for examining.
    pub revealed: Option<PathBuf>,
}

/// What came of it.
#[derive(Debug, Serialize)]
pub struct Examination {
    /// Of the cases.
    pub seed: u64,
    /// Options that draw the same cases.
    pub options: String,
    /// BLAKE3 of the truths, known before the answers.
    pub commitment: String,
    /// Together.
    pub scores: Scores,
    /// One by one.
    pub cases: Vec<Judged>,
}

/// Examines.
///
/// # Errors
/// If files cannot be written.
pub fn run(settings: &Settings) -> io::Result<Examination> {
    let drawn = in_parallel(settings.jobs, (0..settings.cases).collect(), |index| match &settings.revealed {
        Some(dir) => Ok((Truth::read(&dir.join(format!("{}.json", Case::name(settings.seed, index))))?, None)),
        None => {
            let question = Question::draw(settings.seed, index, &settings.draw);
            Ok((question.truth(), question.kept()))
        }
    });
    let (truths, kept): (Vec<Truth>, Vec<_>) = drawn.into_iter().collect::<io::Result<Vec<_>>>()?.into_iter().unzip();
    let commitment = commitment(&truths);
    println!("seed {}{}", settings.seed, settings.draw.options());
    println!("truth of {} cases, BLAKE3 {commitment}", truths.len());
    if let Some(dir) = settings.reveal.as_ref().or(settings.revealed.as_ref()) {
        println!("NOT AN EXAMINATION: the truth lies open in {}", dir.display());
    }
    if let Some(dir) = &settings.reveal {
        write_truths(dir, &truths)?;
    }
    // In the order of their names, which is no order.
    let mut order: Vec<usize> = (0..truths.len()).collect();
    order.sort_by(|a, b| truths[*a].name.cmp(&truths[*b].name));
    let answers = in_parallel(settings.jobs, order, |at| (at, ask(settings, &truths[at], kept[at].as_ref())));
    let mut judged: Vec<Judged> = Vec::new();
    for (at, asked) in answers {
        let (answer, seconds) = asked?;
        let one = judge(&truths[at], &answer, seconds);
        if !(settings.keep && one.went_wrong()) {
            let _ = fs::remove_dir_all(settings.out.join("cases").join(&truths[at].name));
        }
        judged.push(one);
    }
    write_truths(&settings.out.join("truth"), &truths)?;
    let examination = Examination {
        seed: settings.seed,
        options: settings.draw.options(),
        commitment,
        scores: Scores::of(&judged),
        cases: judged,
    };
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
    let text = fs::read_to_string(path).map_err(|error| io::Error::other(format!("{}: {error}", path.display())))?;
    let written: Written =
        serde_json::from_str(&text).map_err(|error| io::Error::other(format!("{}: {error}", path.display())))?;
    Ok(written.cases)
}

fn write_truths(dir: &Path, truths: &[Truth]) -> io::Result<()> {
    fs::create_dir_all(dir)?;
    truths.iter().try_for_each(|truth| fs::write(dir.join(format!("{}.json", truth.name)), truth.json()))
}

/// Writes the data of a case, drawn again where it was not kept, and has it diagnosed.
fn ask(settings: &Settings, truth: &Truth, kept: Option<&Question>) -> io::Result<(Result<Answer, String>, f64)> {
    let name = &truth.name;
    let given = settings.out.join("cases").join(name);
    let answered = settings.out.join("answers").join(name);
    fs::create_dir_all(&given)?;
    fs::create_dir_all(&answered)?;
    {
        let again = kept.is_none().then(|| Question::draw(settings.seed, truth.index, &settings.draw));
        let question = kept.or(again.as_ref()).expect("one or the other");
        fs::write(given.join("data.csv"), question.data())?;
        fs::write(given.join("nominal.toml"), question.nominal_toml())?;
    }
    let mut command = Command::new(&settings.program[0]);
    command
        .args(&settings.program[1..])
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
    let ended = wait(&mut command, settings.limit_s);
    let seconds = start.elapsed().as_secs_f64();
    let answer = ended.and_then(|()| {
        let text = fs::read_to_string(answered.join("diagnosis.json")).map_err(|e| format!("diagnosis.json: {e}"))?;
        Answer::read(&text).map_err(|error| format!("diagnosis.json: {error}"))
    });
    Ok((answer, seconds))
}

fn wait(command: &mut Command, limit_s: f64) -> Result<(), String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let mut child = command.spawn().map_err(|error| format!("{name}: {error}"))?;
    let start = Instant::now();
    loop {
        match child.try_wait().map_err(|error| error.to_string())? {
            Some(status) if status.success() => return Ok(()),
            Some(status) => return Err(format!("{name}: {status}")),
            None if start.elapsed().as_secs_f64() > limit_s => {
                let _ = child.kill();
                let _ = child.wait();
                return Err(format!("{name}: not done after {limit_s} s"));
            }
            None => thread::sleep(Duration::from_millis(10)),
        }
    }
}

/// Does these things on so many threads; results in the order of the things.
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
