//! Files that nobody means, given to `look`, `calibrate`, `diagnose` and `replay`:
//! `hostile_logs COUNT FIRST_SEED PROGRAM`
//!
//! File `k` is a pure function of the seed `FIRST_SEED + k` (`made.rs`), and PROGRAM the command itself. On none of
//! them it may panic or take ten seconds of a processor; it ends with 0, 1 or 2, with a message on stderr where that is
//! not 0, and leaves nothing half-written.
//!
//! The screen has how each command ended, how often, and the slowest file. It ends with 1 if anything was wrong; each
//! line of that has the seed: `hostile_logs 1 SEED PROGRAM` does it again, and `hostile_logs write SEED FILE` writes
//! the file.

mod made;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};
use std::time::Instant;

use flexspline::Table;
use flexspline_identify::measurement::ColumnMap;
use rayon::prelude::*;
use serde_json::Value;

use made::MODEL;

/// Runs a command with at most ten seconds of a processor; one that stands still is given up after 300 s.
const LIMITED: &str = "ulimit -t 10; exec timeout 300 \"$@\"";
/// Commands, and what each leaves in the folder of its name.
const COMMANDS: [(&str, &[&str]); 4] = [
    ("look log.csv --json", &[]),
    (
        "calibrate log.csv --ratio=-94 --out calibrate",
        &["calibrated.fxt", "calibrated.h", "calibrated.rs", "calibration.json", "report.html"],
    ),
    ("diagnose log.csv --model model.toml --out diagnose", &["diagnosis.json", "report.html"]),
    ("replay log.csv --tables own.fxt --out replay", &["replay.csv", "summary.json"]),
];

/// What came of a file.
struct Tried {
    seed: u64,
    /// Command, code, and what was found where that is 0.
    ends: Vec<(&'static str, i32, String)>,
    wrong: Vec<String>,
    taken_s: f64,
}

/// A run of the program in a folder: its code, or nothing if it was ended; what it printed, and what it said.
fn run(program: &Path, line: &str, desk: &Path) -> Result<(Option<i32>, Vec<u8>, String), String> {
    let mut limited = Command::new("sh");
    limited.args(["-c", LIMITED, "sh"]).arg(program).args(line.split_whitespace());
    // A file has one thread, and there are as many files at a time as processors.
    let limited = limited.current_dir(desk).env("RAYON_NUM_THREADS", "1").stdin(Stdio::null());
    let done = limited.output().map_err(|error| format!("{}: {error}", program.display()))?;
    Ok((done.status.code(), done.stdout, String::from_utf8_lossy(&done.stderr).into_owned()))
}

/// A table for `replay`, made by the program.
fn table(program: &Path) -> Result<Vec<u8>, String> {
    let mut text = "time_s,generator_rad,error_arcsec\n".to_owned();
    for k in 0..4000_u32 {
        let psi = 0.05 * f64::from(if k < 2000 { k } else { 4000 - k });
        let noise = f64::from(k * 7919 % 1000) / 1000.0;
        text += &format!("{},{psi},{}\n", 0.01 * f64::from(k), 20.0 * (2.0 * psi + 0.4).sin() + noise);
    }
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    fs::write(folder.path().join("own.csv"), text).map_err(|error| error.to_string())?;
    let (_, _, said) = run(program, "calibrate own.csv --ratio=-94 --no-report --out own", folder.path())?;
    fs::read(folder.path().join("own/calibrated.fxt")).map_err(|error| format!("own.csv: {error}: {said}"))
}

/// What a command found that ended well, or what is wrong with what it left.
fn found(command: &str, out: &Path, printed: &[u8]) -> Result<String, String> {
    let read = |name: &str| fs::read(out.join(name)).map_err(|error| format!("{name}: {error}"));
    let json = |bytes: &[u8]| serde_json::from_slice::<Value>(bytes).map_err(|error| format!("no JSON: {error}"));
    match command {
        "look" => {
            // What is proposed is understood.
            let looked = json(printed)?;
            let columns = looked["columns_option"].as_str().map_or(Ok(None), |text| ColumnMap::parse(text).map(Some));
            columns.map(|_| "looked".to_owned()).map_err(|error| format!("proposes {looked}: {error}"))
        }
        "calibrate" => {
            json(&read("calibration.json")?)?;
            let image = read("calibrated.fxt")?;
            Table::check(&image).map(|_| "table".to_owned()).map_err(|error| format!("the table is none: {error}"))
        }
        "diagnose" => Ok(json(&read("diagnosis.json")?)?["finding"].to_string()),
        _ => {
            let lines = read("replay.csv")?.iter().filter(|byte| **byte == b'\n').count();
            let rows = json(&read("summary.json")?)?["rows"].as_u64();
            (rows.map(|rows| rows as usize + 1) == Some(lines))
                .then(|| "replayed".to_owned())
                .ok_or(format!("{lines} lines of {rows:?} rows"))
        }
    }
}

/// The file of a seed through all commands.
fn tried(program: &Path, table: &[u8], seed: u64) -> Result<Tried, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let desk = folder.path();
    for (name, bytes) in [("log.csv", &*made::log(seed)), ("model.toml", MODEL.as_bytes()), ("own.fxt", table)] {
        fs::write(desk.join(name), bytes).map_err(|error| format!("{name}: {error}"))?;
    }
    let begun = Instant::now();
    let mut tried = Tried { seed, ends: Vec::new(), wrong: Vec::new(), taken_s: 0.0 };
    for (line, files) in COMMANDS {
        let (code, printed, said) = run(program, line, desk)?;
        let command = line.split(' ').next().unwrap_or_default();
        let out = desk.join(command);
        let entries = fs::read_dir(&out).into_iter().flatten().flatten();
        let there: Vec<String> = entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        let missing = files.iter().any(|file| !there.iter().any(|name| name == file));
        let end = match code {
            // A generator that stands under a load that goes round makes no table.
            Some(0) if there == ["torque_loop.json"] => Ok("torque loop".to_owned()),
            Some(0) if missing || there.iter().any(|name| name.starts_with('.')) => Err(format!("leaves {there:?}")),
            Some(0) => found(command, &out, &printed),
            Some(1 | 2) if !there.is_empty() => Err(format!("leaves {there:?}")),
            Some(1 | 2) if said.trim().is_empty() => Err("says nothing".to_owned()),
            Some(1 | 2) => Ok(String::new()),
            code => Err(format!("ends with {code:?}: {said}")),
        };
        match (end, code) {
            (Ok(what), Some(code)) => tried.ends.push((command, code, what)),
            (what, _) => tried.wrong.push(format!("WRONG seed {seed}: flexspline {line}: {what:?}")),
        }
    }
    tried.taken_s = begun.elapsed().as_secs_f64();
    Ok(tried)
}

fn main() -> ExitCode {
    match all(&std::env::args().skip(1).collect::<Vec<_>>()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(what) => {
            eprintln!("hostile_logs: {what}");
            ExitCode::from(2)
        }
    }
}

fn all(args: &[String]) -> Result<bool, String> {
    let number = |text: &String| text.parse::<u64>().map_err(|_| format!("found {text}, allowed: a whole number"));
    if let [write, seed, file] = args
        && write == "write"
    {
        return fs::write(file, made::log(number(seed)?)).map(|()| true).map_err(|error| error.to_string());
    }
    let [count, first, program] = args else { return Err("COUNT FIRST_SEED PROGRAM".to_owned()) };
    let (count, first, program) = (number(count)?, number(first)?, Path::new(program));
    let table = table(program)?;
    let all: Result<Vec<Tried>, String> =
        (first..first + count).into_par_iter().map(|seed| tried(program, &table, seed)).collect();
    let (mut ends, mut slowest, mut total_s) = (BTreeMap::<_, u64>::new(), (0.0, first), 0.0);
    let mut wrong = Vec::new();
    for file in all? {
        total_s += file.taken_s;
        if file.taken_s > slowest.0 {
            slowest = (file.taken_s, file.seed);
        }
        file.ends.into_iter().for_each(|end| *ends.entry(end).or_default() += 1);
        wrong.extend(file.wrong);
    }
    for ((command, code, what), times) in ends {
        println!("{command:<9} {code} {times:>7} {what}");
    }
    println!("{count} files from seed {first}: {total_s:.1} s, the slowest {:.2} s (seed {})", slowest.0, slowest.1);
    wrong.iter().for_each(|what| println!("{what}"));
    Ok(wrong.is_empty())
}
