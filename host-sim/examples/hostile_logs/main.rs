//! Files that nobody means, read by `look`, `calibrate`, `diagnose` and `replay`:
//! `hostile_logs COUNT [FIRST_SEED [PROGRAM RUNS]]`
//!
//! File `k` is a pure function of the seed `FIRST_SEED + k` (`made.rs`). Each is read in this program by the functions
//! behind the four commands. None may panic or take ten seconds of a processor, and what is refused says why. RUNS of
//! them go through PROGRAM, the command itself, too: it ends with 0, 1 or 2, with a message on stderr where it is not
//! 0, as the functions did here, and leaves nothing half-written.
//!
//! The screen has how each command ended, how often, and the slowest file. It ends with 1 if anything was wrong; each
//! line of that has the seed: `hostile_logs 1 SEED` does it again, and `hostile_logs write SEED FILE` writes the file.

mod made;

use std::any::Any;
use std::collections::BTreeMap;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use flexspline::Table;
use flexspline_identify::calibrate::{Prior, calibrate};
use flexspline_identify::diagnosis::{PipelineError, Settings, Subject, diagnose_rows, parse_rows};
use flexspline_identify::extension::Model;
use flexspline_identify::look::look;
use flexspline_identify::measurement::{ColumnMap, parse, raw};
use flexspline_identify::replay::{read, replay};
use flexspline_mechanics::drive::{Drive, GeneratorKind};

use made::{MODEL, RATIO};

/// Processor time that a file may take, s.
const MOST_S: f64 = 10.0;
/// A file that stands still on a busy machine is given up after this, s.
const GIVEN_UP_S: f64 = 300.0;
const COMMANDS: [&str; 4] = ["look", "calibrate", "diagnose", "replay"];

/// How a command ends: code and message.
type End = (u8, String);

/// What files are held against.
struct Bench {
    subject: Subject<'static>,
    prior: Prior<'static>,
    image: Vec<u8>,
}

impl Bench {
    fn new() -> Result<Bench, String> {
        let model = Model::from_toml("model.toml", MODEL).map_err(|error| error.to_string())?;
        let subject = Subject::of_model(model, Drive::hhd_95(), GeneratorKind::Cam);
        let prior = Prior::of_ratio(RATIO, GeneratorKind::Cam);
        let mut text = "time_s,generator_rad,error_arcsec\n".to_owned();
        for k in 0..4000_u32 {
            let psi = 0.05 * f64::from(if k < 2000 { k } else { 4000 - k });
            let noise = f64::from(k * 7919 % 1000) / 1000.0;
            text += &format!("{},{psi},{}\n", 0.01 * f64::from(k), 20.0 * (2.0 * psi + 0.4).sin() + noise);
        }
        let log = parse("own.csv", text.as_bytes(), &ColumnMap::default(), &prior.nominal.gear());
        let made = calibrate(&[log.map_err(|error| error.to_string())?], &prior).map_err(|error| error.to_string())?;
        Ok(Bench { subject, prior, image: made.table.image })
    }

    /// The ends of all commands on a file.
    fn run(&self, bytes: &[u8], doing: impl Fn(usize)) -> [End; 4] {
        let all: [&dyn Fn() -> End; 4] =
            [&|| self.look(bytes), &|| self.calibrate(bytes), &|| self.diagnose(bytes), &|| self.replay(bytes)];
        std::array::from_fn(|k| {
            doing(k);
            catch_unwind(AssertUnwindSafe(all[k])).unwrap_or_else(|panic| (101, words(&*panic)))
        })
    }

    fn look(&self, bytes: &[u8]) -> End {
        let file = match raw::parse("log.csv", bytes) {
            Ok(file) => file,
            Err(error) => return (2, error.to_string()),
        };
        let looked = match look(&[file]) {
            Ok(looked) => looked,
            Err(error) => return (2, error.to_string()),
        };
        if let Some(columns) = &looked.columns_option {
            // What is proposed is understood.
            if let Err(error) = ColumnMap::parse(columns) {
                return (101, format!("proposes {columns}: {error}"));
            }
        }
        (0, "looked".to_owned())
    }

    fn calibrate(&self, bytes: &[u8]) -> End {
        let log = match parse("log.csv", bytes, &ColumnMap::default(), &self.prior.nominal.gear()) {
            Ok(log) => log,
            Err(error) => return (2, error.to_string()),
        };
        match calibrate(&[log], &self.prior) {
            Ok(made) if Table::check(&made.table.image).is_ok() => (0, "table".to_owned()),
            Ok(_) => (101, "the table is none".to_owned()),
            Err(error) => (if error.is_bad_input() { 2 } else { 1 }, error.to_string()),
        }
    }

    fn diagnose(&self, bytes: &[u8]) -> End {
        let refused = |error: PipelineError| (if error.is_bad_input() { 2 } else { 1 }, error.to_string());
        let options = Settings::default();
        let recording = match parse_rows("log.csv", bytes, &ColumnMap::default(), &self.subject) {
            Ok(recording) => recording,
            Err(error) => return refused(error),
        };
        let done = match diagnose_rows(recording, &self.subject, &options, |_, _, _| {}) {
            Ok(done) => done,
            Err(error) => return refused(error),
        };
        match done.extend(&self.subject) {
            Ok(made) => match serde_json::to_string(&done.file(&made.extension, "")) {
                Ok(_) => (0, done.diagnosis.finding.words().to_owned()),
                Err(error) => (101, error.to_string()),
            },
            Err(error) => refused(error),
        }
    }

    fn replay(&self, bytes: &[u8]) -> End {
        let table = match Table::check(&self.image) {
            Ok(table) => table,
            Err(error) => return (101, error.to_string()),
        };
        match read("log.csv", bytes, &ColumnMap::default(), &table, 20.0, true) {
            Ok(read) => {
                let (replayed, summary) = replay(&table, &read.rows, None);
                let whole = replayed.len() == read.rows.len() && summary.rows == read.rows.len();
                (if whole { 0 } else { 101 }, "replayed".to_owned())
            }
            Err(error) => (2, error.to_string()),
        }
    }
}

/// What a panic says.
fn words(panic: &(dyn Any + Send)) -> String {
    let text =
        panic.downcast_ref::<String>().cloned().or_else(|| panic.downcast_ref::<&str>().map(|s| (*s).to_owned()));
    text.unwrap_or_else(|| "a panic".to_owned())
}

/// Processor time of a thread of this process so far, s; nothing where the system does not say it.
fn processor_s(thread: &str) -> Option<f64> {
    let text = fs::read_to_string(format!("/proc/self/task/{thread}/schedstat")).ok()?;
    text.split_whitespace().next()?.parse::<f64>().ok().map(|ns| 1e-9 * ns)
}

/// The number of this thread.
fn this_thread() -> String {
    let link = fs::read_link("/proc/thread-self").unwrap_or_default();
    link.file_name().and_then(|name| name.to_str()).unwrap_or_default().to_owned()
}

/// A file at work: its seed, the command, and when it began, on the clock and on the processor.
struct AtWork {
    seed: u64,
    command: usize,
    begun: Instant,
    processor_s: Option<f64>,
    thread: String,
}

impl AtWork {
    /// What it has taken, s.
    fn taken_s(&self) -> f64 {
        let clock_s = self.begun.elapsed().as_secs_f64();
        match (processor_s(&self.thread), self.processor_s) {
            (Some(now), Some(then)) if clock_s < GIVEN_UP_S => now - then,
            _ => clock_s,
        }
    }
}

#[derive(Default)]
struct Score {
    ends: BTreeMap<(usize, u8, String), u64>,
    slowest: (f64, u64),
    total_s: f64,
    wrong: Vec<String>,
}

/// Tries the files of some seeds; the score, or the seed that does not end.
fn tried(bench: &Bench, seeds: std::ops::Range<u64>) -> Result<Score, String> {
    let threads = thread::available_parallelism().map_or(1, usize::from);
    let next = AtomicU64::new(seeds.start);
    let score = Mutex::new(Score::default());
    let at_work: Vec<Mutex<Option<AtWork>>> = (0..threads).map(|_| Mutex::new(None)).collect();
    let lock = |place: usize| at_work[place].lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    thread::scope(|scope| {
        let workers: Vec<_> = (0..threads)
            .map(|place| {
                let (next, score) = (&next, &score);
                scope.spawn(move || {
                    // All of a file on one thread, whose time is its own.
                    let Ok(pool) = rayon::ThreadPoolBuilder::new().num_threads(1).build() else { return };
                    pool.install(|| {
                        let thread = this_thread();
                        loop {
                            let seed = next.fetch_add(1, Ordering::Relaxed);
                            if seed >= seeds.end {
                                break;
                            }
                            let bytes = made::log(seed);
                            let begins = |command| AtWork {
                                seed,
                                command,
                                begun: Instant::now(),
                                processor_s: processor_s(&thread),
                                thread: thread.clone(),
                            };
                            *lock(place) = Some(begins(0));
                            let ends = bench.run(&bytes, |command| {
                                if let Some(at) = lock(place).as_mut() {
                                    at.command = command;
                                }
                            });
                            let taken_s = lock(place).take().map_or(0.0, |at| at.taken_s());
                            let mut score = score.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                            score.note(seed, &ends, taken_s);
                        }
                    });
                })
            })
            .collect();
        while !workers.iter().all(thread::ScopedJoinHandle::is_finished) {
            thread::sleep(Duration::from_millis(50));
            for place in 0..threads {
                if let Some(at) = lock(place).as_ref().filter(|at| at.taken_s() > MOST_S) {
                    // A thread cannot be ended: the program is.
                    println!("WRONG seed {}: {} takes more than {MOST_S} s", at.seed, COMMANDS[at.command]);
                    std::process::exit(1);
                }
            }
        }
        Ok::<(), String>(())
    })?;
    score.into_inner().map_err(|error| error.to_string())
}

impl Score {
    fn note(&mut self, seed: u64, ends: &[End; 4], taken_s: f64) {
        self.total_s += taken_s;
        if taken_s > self.slowest.0 {
            self.slowest = (taken_s, seed);
        }
        for (command, (code, what)) in ends.iter().enumerate() {
            if *code > 2 || what.trim().is_empty() {
                self.wrong.push(format!("WRONG seed {seed}: {} ends with {code}: {what}", COMMANDS[command]));
            }
            let of = if *code == 0 { what.clone() } else { String::new() };
            *self.ends.entry((command, *code, of)).or_default() += 1;
        }
    }
}

/// The file of a seed through the program: what is wrong with how it ends.
fn by_the_program(program: &Path, bench: &Bench, seed: u64) -> Result<Vec<String>, std::io::Error> {
    let folder = tempfile::tempdir()?;
    let desk = folder.path();
    let bytes = made::log(seed);
    fs::write(desk.join("log.csv"), &bytes)?;
    fs::write(desk.join("model.toml"), MODEL)?;
    fs::write(desk.join("own.fxt"), &bench.image)?;
    let due = bench.run(&bytes, |_| {});
    let lines: [(&str, &[&str]); 4] = [
        ("look log.csv", &[]),
        (
            "calibrate log.csv --ratio=-94 --out calibrate",
            &["calibrated.fxt", "calibrated.h", "calibrated.rs", "calibration.json", "report.html"],
        ),
        ("diagnose log.csv --model model.toml --out diagnose", &["diagnosis.json", "report.html"]),
        ("replay log.csv --tables own.fxt --out replay", &["replay.csv", "summary.json"]),
    ];
    let mut wrong = Vec::new();
    for ((line, files), (code_due, what_due)) in lines.iter().zip(due) {
        let stderr = fs::File::create(desk.join("stderr"))?;
        let mut run = Command::new(program)
            .args(line.split_whitespace())
            .current_dir(desk)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(stderr)
            .spawn()?;
        let begun = Instant::now();
        let code = loop {
            if let Some(status) = run.try_wait()? {
                break status.code();
            }
            if begun.elapsed().as_secs_f64() > GIVEN_UP_S {
                run.kill()?;
                run.wait()?;
                break None;
            }
            thread::sleep(Duration::from_millis(5));
        };
        let mut say = |what: String| wrong.push(format!("WRONG seed {seed}: flexspline {line}: {what}"));
        let said = fs::read_to_string(desk.join("stderr"))?;
        if code != Some(i32::from(code_due)) {
            say(format!("ends with {code:?}, and its functions with {code_due} ({what_due}): {said}"));
        }
        if code != Some(0) && said.trim().is_empty() {
            say("says nothing".to_owned());
        }
        let out = desk.join(line.split_whitespace().next().unwrap_or_default());
        let there: Vec<String> = fs::read_dir(&out)
            .map(|entries| entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect())
            .unwrap_or_default();
        let missing = files.iter().any(|file| !there.iter().any(|name| name == file));
        if (code == Some(0) && missing)
            || (code != Some(0) && !there.is_empty())
            || there.iter().any(|name| name.starts_with('.'))
        {
            say(format!("leaves {there:?}"));
        }
        for name in there.iter().filter(|name| name.ends_with(".json")) {
            if serde_json::from_slice::<serde_json::Value>(&fs::read(out.join(name))?).is_err() {
                say(format!("{name} is no JSON"));
            }
        }
    }
    Ok(wrong)
}

fn main() -> ExitCode {
    match run(&std::env::args().skip(1).collect::<Vec<_>>()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(what) => {
            eprintln!("hostile_logs: {what}");
            ExitCode::from(2)
        }
    }
}

fn run(args: &[String]) -> Result<bool, String> {
    let number = |text: &String| text.parse::<u64>().map_err(|_| format!("found {text}, allowed: a whole number"));
    if let [write, seed, file] = args
        && write == "write"
    {
        return fs::write(file, made::log(number(seed)?)).map(|()| true).map_err(|error| error.to_string());
    }
    let (count, first) = (args.first().map_or(Ok(2000), number)?, args.get(1).map_or(Ok(1), number)?);
    let bench = Bench::new()?;
    // Panics are caught and said with their seed; where they come from is said here.
    std::panic::set_hook(Box::new(|info| println!("panic: {}", info.to_string().replace('\n', " "))));
    let Score { ends, slowest, total_s, mut wrong } = tried(&bench, first..first + count)?;
    if let (Some(program), Some(runs)) = (args.get(2), args.get(3)) {
        for seed in first..first + number(runs)?.min(count) {
            wrong.extend(by_the_program(Path::new(program), &bench, seed).map_err(|error| error.to_string())?);
        }
    }
    for ((command, code, what), times) in ends {
        println!("{:<9} {code} {times:>7} {what}", COMMANDS[command]);
    }
    println!(
        "{count} files from seed {first}: {total_s:.1} s of processors, the slowest {:.2} s (seed {})",
        slowest.0, slowest.1
    );
    wrong.iter().for_each(|what| println!("{what}"));
    Ok(wrong.is_empty())
}
