//! Perfect drives under faults of loggers: `logger_faults COUNT SEED FILE.csv [TABLES [FAULT]]`
//!
//! Record i of a fault is a pure function of the seed, the fault and i: a drive of a catalogue's model or of a table
//! made by FEM, which is what its model says within the spread between units; a bench that moves and loads it; and a
//! logger with one thing wrong, made as loggers make it. None of it may yield a cause, as nothing is wrong with the
//! drive, and the fault is to be told by its name.
//!
//! For each fault the screen has of how many records a cause was named, the fault was told, the drive was not
//! understood or could not be read. The rows go to the file. TABLES is a folder of tables made by `flexspline tables`
//! from the drive built in; without it, or with `-`, all drives are of models. With a FAULT there is only that one, and
//! its logs and models are left beside the file.
//!
//! It ends with 1 if a cause was named in more than 3 % of all records, or if fewer than nine in ten of the faults were
//! told.

mod bench;
mod chance;
mod logger;

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;
use std::time::Instant;

use bench::{Bench, Drive};
use chance::Chance;
use flexspline_sim::diagnosis::{Diagnosed, Options, Subject, diagnose_rows, parse_rows};
use flexspline_sim::drive::{Drive as Drawing, GeneratorKind};
use flexspline_sim::extension::Model;
use flexspline_sim::kernels::Kernels;
use flexspline_sim::measurement::ColumnMap;
use logger::{Log, Wrong, log};
use rayon::prelude::*;

/// Share of the faults that have to be told, and of the records in which a cause may be named: none should, and 2 of
/// 112 were when this was written.
const TOLD: f64 = 0.9;
const MAY_BE_NAMED: f64 = 0.03;

/// Teeth of flexspline and circular spline, the wheel that stands, stiffness N·m/rad, backlash arcsec, friction N·m,
/// harmonics (order, arcsec), rated load N·m: drives of a catalogue's kind, not of any catalogue.
type Catalogue = (u32, u32, &'static str, f64, f64, f64, &'static [[f64; 2]], f64);
const CATALOGUE: [Catalogue; 4] = [
    (188, 190, "flexspline", 30_000.0, 60.0, 1.5, &[[2.0, 10.0], [4.0, 3.0]], 60.0),
    (200, 202, "circular_spline", 16_000.0, 25.0, 0.8, &[[2.0, 14.0]], 30.0),
    (200, 202, "flexspline", 52_000.0, 40.0, 2.0, &[[2.0, 8.0], [4.0, 4.0], [6.0, 1.5]], 90.0),
    (100, 102, "circular_spline", 9_000.0, 90.0, 0.6, &[[2.0, 25.0], [4.0, 5.0]], 15.0),
];

/// `nominal.toml` of a drive.
fn model_text((flexspline, circular, fixed, stiffness, backlash, friction, harmonics, _): Catalogue) -> String {
    let mut text = format!(
        "[drive]\nflexspline_teeth = {flexspline}\ncircular_spline_teeth = {circular}\nfixed = \
         \"{fixed}\"\n[nominal]\nstiffness_n_m_per_rad = {stiffness:.1}\nbacklash_arcsec = \
         {backlash:.1}\nfriction_torque_n_m = {friction:.1}\n"
    );
    for (number, [order, amplitude]) in harmonics.iter().enumerate() {
        let _ = write!(
            text,
            "[[nominal.harmonic]]\norder_per_generator_turn = {order:.1}\namplitude_arcsec = \
             {amplitude:.1}\nphase_rad = {:.1}\n",
            0.4 + 0.7 * number as f64
        );
    }
    text
}

/// The image of a table, and the kernels beside it.
type Image = (GeneratorKind, Vec<u8>, Option<Kernels>);

/// Images of the tables of a folder, with their kernels where they stand beside them.
fn tables(folder: &Path) -> Result<Vec<Image>, String> {
    let mut found = Vec::new();
    for kind in GeneratorKind::ALL {
        let Ok(image) = std::fs::read(folder.join(format!("{kind}.fxt"))) else { continue };
        let kernels = std::fs::read_to_string(folder.join(format!("{kind}.kernels.json"))).ok();
        let kernels = kernels.map(|text| Kernels::from_json(&text)).transpose();
        found.push((kind, image, kernels.map_err(|problem| problem.to_string())?));
    }
    if found.is_empty() {
        return Err(format!(
            "{}: found no table, allowed: a folder of tables made by `flexspline tables`",
            folder.display()
        ));
    }
    Ok(found)
}

fn drives(images: &[Image]) -> Result<Vec<Drive<'_>>, String> {
    let mut drives = Vec::new();
    for of in CATALOGUE {
        let name = format!("{}-{}-{}", of.0, of.1, of.2);
        let model = Model::from_toml(&name, &model_text(of)).map_err(|error| error.to_string())?;
        let subject = Subject::of_model(model, Drawing::hhd_95(), GeneratorKind::Cam);
        drives.push(Drive { name, subject, rated_n_m: of.7 });
    }
    for (kind, image, kernels) in images {
        let subject = Subject::of_table(image, Drawing::hhd_95(), *kind).map_err(|error| error.to_string())?;
        let range = subject.table.as_ref().map_or([0.0; 2], flexspline::Table::torque_range_n_m);
        let rated_n_m = f64::from(range[1].min(-range[0]));
        let subject = match kernels {
            Some(kernels) => subject.with_kernels(kernels.clone()).map_err(|error| error.to_string())?,
            None => subject,
        };
        drives.push(Drive { name: format!("table-{kind}"), subject, rated_n_m });
    }
    Ok(drives)
}

/// What became of a record.
struct Outcome {
    wrong: Wrong,
    number: u64,
    /// What the record is.
    record: String,
    size: String,
    /// Causes named, but the fault by another name.
    causes: Vec<String>,
    /// Faults of the data that were named.
    faults: Vec<String>,
    told: bool,
    finding: String,
    left: String,
    seconds: f64,
}

/// Drawn anew, so often at most, where the rows cannot show what is wrong.
const DRAWS: u64 = 400;

/// A drive, how it is measured, and what the logger makes of it.
fn drawn<'d, 't>(drives: &'d [Drive<'t>], seed: u64, wrong: Wrong, number: u64) -> (&'d Drive<'t>, Bench, Log) {
    let mut attempt = 0;
    loop {
        let mut chance = Chance::new(seed, &wrong.name(), number + 1000 * attempt);
        let drive = chance.of(drives);
        let mut bench = Bench::drawn(drive, &mut chance);
        if matches!(wrong, Wrong::CounterRestarts | Wrong::Drift) {
            bench.in_sessions(&mut chance);
        }
        if wrong == Wrong::SlowFlanks {
            bench.with_slow_flanks(&mut chance);
        }
        let truths = bench.run(drive, wrong.ratio_off(drive), &mut chance);
        let log = log(wrong, &bench, drive, &truths, &mut chance);
        attempt += 1;
        if log.shows || attempt == DRAWS {
            return (drive, bench, log);
        }
    }
}

fn run(drives: &[Drive<'_>], seed: u64, wrong: Wrong, number: u64, keep: Option<&Path>) -> Outcome {
    let clock = Instant::now();
    let (drive, bench, log) = drawn(drives, seed, wrong, number);
    let csv = log.csv();
    if let Some(folder) = keep {
        let path = folder.join(format!("{}-{number}.csv", wrong.name()));
        if let Err(error) = std::fs::write(&path, &csv) {
            eprintln!("{}: {error}", path.display());
        }
    }
    let record = format!(
        "{}; {} x {} rows at {} Hz; {}; {}; {:.1} rad/s; {:.0} N.m; {:.1} arcsec",
        drive.name,
        bench.sessions,
        bench.rows,
        bench.rate_hz,
        bench.motion,
        bench.load,
        bench.speed_rad_s,
        bench.load_n_m,
        bench.noise_arcsec
    );
    let mut outcome = Outcome {
        wrong,
        number,
        record,
        size: log.size.clone(),
        causes: Vec::new(),
        faults: Vec::new(),
        told: false,
        finding: String::new(),
        left: String::new(),
        seconds: 0.0,
    };
    let map = ColumnMap::default();
    let done = parse_rows("log.csv", csv.as_bytes(), &map, &drive.subject)
        .and_then(|recording| diagnose_rows(recording, &drive.subject, &Options::default(), |_, _, _| {}));
    match done {
        Err(error) => outcome.finding = format!("error: {error}"),
        Ok(done) => outcome.read(&done, log.missing),
    }
    outcome.seconds = clock.elapsed().as_secs_f64();
    outcome
}

impl Outcome {
    fn read(&mut self, done: &Diagnosed, missing: usize) {
        let diagnosis = &done.diagnosis;
        for fault in &done.recording.faults {
            // More than are missing is no way to tell it.
            let too_many = fault.name.as_str() == "missing_samples" && fault.rows as usize > missing + missing / 10 + 1;
            self.faults.push(format!("{}{}", fault.name.as_str(), if too_many { " of too many rows" } else { "" }));
        }
        if diagnosis.ratio_proposed.is_some() {
            self.faults.push("ratio_proposed".to_owned());
        }
        for cause in &diagnosis.causes {
            let name = cause.name.as_str();
            if name == self.wrong.same_as()
                || cause.look_alikes.iter().any(|alike| alike.as_str() == self.wrong.same_as())
            {
                self.faults.push(name.to_owned());
            } else {
                self.causes.push(format!("{name} {:.0} % {:.1}\"", 100.0 * cause.confidence, cause.size_arcsec));
            }
        }
        self.finding = diagnosis.finding.words().to_owned();
        let left = diagnosis.unexplained.iter().map(|left| format!("{} {:.1}\"", left.looks_like, left.size_arcsec));
        self.left = left.collect::<Vec<_>>().join("; ");
        let told_as = self.wrong.told_as();
        let as_is = |fault: &String| {
            told_as.contains(&fault.as_str()) || (!self.wrong.same_as().is_empty() && fault == self.wrong.same_as())
        };
        self.told = told_as.is_empty() || self.faults.iter().any(as_is);
    }

    fn csv(&self) -> String {
        let quoted = |text: &str| format!("\"{}\"", text.replace('"', "''"));
        [
            self.wrong.name(),
            self.number.to_string(),
            quoted(&self.record),
            quoted(&self.size),
            quoted(&self.causes.join("; ")),
            quoted(&self.faults.join("; ")),
            self.told.to_string(),
            quoted(&self.finding),
            quoted(&self.left),
            format!("{:.2}", self.seconds),
        ]
        .join(",")
    }
}

const HEADER: &str = "fault,number,record,size,causes,faults_named,told,finding,left,seconds\n";

/// What became of some records.
#[derive(Clone, Copy, Default)]
struct Sums {
    records: usize,
    named: usize,
    /// Of the records that can tell what is wrong.
    told: usize,
    tell: usize,
}

/// Numbers of one fault, and a line of them for the screen.
fn summed(wrong: Wrong, of: &[&Outcome]) -> (String, Sums) {
    let count = |is: &dyn Fn(&Outcome) -> bool| of.iter().filter(|outcome| is(outcome)).count();
    let finding = |words: &str| count(&|outcome| outcome.finding.starts_with(words));
    let tells = !wrong.told_as().is_empty();
    let sums = Sums {
        records: of.len(),
        named: count(&|outcome| !outcome.causes.is_empty()),
        told: if tells { count(&|outcome| outcome.told) } else { 0 },
        tell: if tells { of.len() } else { 0 },
    };
    let line = format!(
        "{:<20} {:>6} {:>12} {:>6} {:>15} {:>9} {:>6}",
        wrong.name(),
        sums.records,
        sums.named,
        if tells { sums.told.to_string() } else { "-".to_owned() },
        finding("not understood"),
        finding("data not usable"),
        finding("error"),
    );
    (line, sums)
}

fn run_all(arguments: &[String]) -> Result<bool, String> {
    let usage = "logger_faults COUNT SEED FILE.csv [TABLES [FAULT]]";
    let whole = |text: &String| text.parse::<u64>().map_err(|_| format!("found \"{text}\", allowed: {usage}"));
    let ([count, seed, file], rest) = arguments.split_first_chunk::<3>().ok_or_else(|| format!("allowed: {usage}"))?;
    let (count, seed, file) = (whole(count)?, whole(seed)?, PathBuf::from(file));
    let images = match rest.first().map(String::as_str) {
        None | Some("-") => Vec::new(),
        Some(folder) => tables(Path::new(folder))?,
    };
    let drives = drives(&images)?;
    let all: Vec<Wrong> = match rest.get(1) {
        None => Wrong::ALL.to_vec(),
        Some(name) => {
            let known = Wrong::ALL.map(Wrong::name).join(", ");
            let wrong = Wrong::ALL.into_iter().find(|wrong| wrong.name() == *name);
            vec![wrong.ok_or_else(|| format!("found the fault \"{name}\", allowed: {known}"))?]
        }
    };
    let keep = (rest.len() > 1).then(|| file.parent().unwrap_or(Path::new(".")).to_owned());
    if let Some(folder) = &keep {
        for of in CATALOGUE {
            let path = folder.join(format!("{}-{}-{}.toml", of.0, of.1, of.2));
            std::fs::write(&path, model_text(of)).map_err(|error| format!("{}: {error}", path.display()))?;
        }
    }
    let unwritable = |error: std::io::Error| format!("{}: {error}", file.display());
    // Row by row, so that what is done stands in the file, whatever comes after.
    let rows = Mutex::new(std::fs::File::create(&file).map_err(unwritable)?);
    let put = |text: &str| rows.lock().map_or(Ok(()), |mut rows| rows.write_all(text.as_bytes())).map_err(unwritable);
    put(HEADER)?;
    let cases: Vec<(Wrong, u64)> =
        (0..count).flat_map(|number| all.iter().map(move |wrong| (*wrong, number))).collect();
    let outcomes: Vec<Outcome> = cases
        .par_iter()
        .map(|(wrong, number)| {
            let outcome = run(&drives, seed, *wrong, *number, keep.as_deref());
            put(&(outcome.csv() + "\n")).map(|()| outcome)
        })
        .collect::<Result<_, _>>()?;
    println!(
        "{:<20} {:>6} {:>12} {:>6} {:>15} {:>9} {:>6}",
        "fault", "drives", "cause named", "told", "not understood", "unusable", "error"
    );
    let mut all_sums = Sums::default();
    for wrong in all {
        let of: Vec<&Outcome> = outcomes.iter().filter(|outcome| outcome.wrong == wrong).collect();
        let (line, sums) = summed(wrong, &of);
        println!("{line}");
        all_sums.records += sums.records;
        all_sums.named += sums.named;
        all_sums.told += sums.told;
        all_sums.tell += sums.tell;
    }
    let Sums { records, named, told, tell } = all_sums;
    println!("a cause named in {named} of {records}, the fault told in {told} of {tell}");
    Ok(named as f64 <= MAY_BE_NAMED * records as f64 && told as f64 >= TOLD * tell as f64)
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run_all(&arguments) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(what) => {
            eprintln!("logger_faults: {what}");
            ExitCode::from(2)
        }
    }
}
