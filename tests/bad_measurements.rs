//! Damaged, odd and mistaken files, given to `flexspline diagnose` as a user gives them: each ends in one clear
//! message, exit code 2 and nothing written, or in a fault of the data with its name and a verdict that blames no
//! physics.
//!
//! The drive is healthy throughout: it does what its nominal model says, within noise. Whatever is named is the fault
//! of the file.

use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};
use std::fs;
use std::path::Path;
use std::time::Instant;

use crate::bench_data::{ARCSEC, Bench, RATIO, normal, scaled, shifted};
use flexspline_tests::command::Desk;
use serde_json::Value;

const TEETH: &str = "flexspline_teeth = 188\ncircular_spline_teeth = 190\nfixed = \"flexspline\"\n";
const MODEL: &str = "[drive]\nflexspline_teeth = 188\ncircular_spline_teeth = 190\nfixed = \
                     \"flexspline\"\n[nominal]\nstiffness_n_m_per_rad = 30000.0\nbacklash_arcsec = \
                     40.0\nfriction_torque_n_m = 1.0\ntemperature_c = \
                     20.0\n[[nominal.harmonic]]\norder_per_generator_turn = 2.0\namplitude_arcsec = 12.0\nphase_rad = \
                     0.4\n[nominal.unit_to_unit]\nstiffness = 0.03\nbacklash = 0.05\nharmonic = 0.2\n";

/// A drive that does what `MODEL` says: to and fro, a load that changes sign.
fn healthy(rows: usize) -> Bench {
    let mut random = fastrand::Rng::with_seed(11);
    let mut b = Bench { torque_n_m: Some(Vec::new()), temperature_c: Some(Vec::new()), ..Bench::default() };
    let (mut psi, mut flank) = (0.3_f64, 1.0_f64);
    for k in 0..rows {
        let time = 0.01 * k as f64;
        let share = (time / 40.0).fract();
        psi += if share < 0.55 { 0.06 } else { -0.047 };
        let torque = 25.0 * (TAU * time / 7.3).sin() + 6.0 * (TAU * time / 2.9).cos();
        if torque.abs() > 1.0 {
            flank = torque.signum();
        }
        let error =
            12.0 * (2.0 * psi + 0.4).sin() + 20.0 * flank + torque / 30_000.0 / ARCSEC + 1.5 * normal(&mut random);
        b.time_s.push(time);
        b.generator_rad.push(psi);
        b.output_rad.push(psi / RATIO + error * ARCSEC);
        b.torque_n_m.as_mut().unwrap().push(torque + 0.02 * normal(&mut random));
        b.temperature_c.as_mut().unwrap().push(20.0 + 0.5 * (TAU * time / 60.0).sin() + 0.02 * normal(&mut random));
    }
    b
}

const ROWS: usize = 6000;

/// The healthy drive with its columns changed.
fn changed(change: impl Fn(&mut Bench)) -> Vec<u8> {
    let mut bench = healthy(ROWS);
    change(&mut bench);
    bench.csv().into()
}

/// The healthy drive with the lines of its file changed; line 0 is the header.
fn edited(change: impl Fn(usize, &str) -> String) -> Vec<u8> {
    healthy(ROWS).csv().lines().enumerate().map(|(k, line)| change(k, line)).collect::<String>().into()
}

/// Required end of a run over a file.
#[derive(Clone, Copy, PartialEq)]
enum Ends {
    /// One message that says all this; exit code 2, nothing written.
    Refused(&'static [&'static str]),
    /// These faults, in any order, no others, and no physics.
    Faults(&'static [&'static str]),
    /// The data alone do not identify a fault: a discrepancy without a name.
    Abstains,
    /// This fault, and nothing can be said of the unit.
    Unusable(&'static str),
    /// This fault, and what the channel that is left out would explain is a discrepancy without a name.
    LeftOut(&'static str),
}
use Ends::{Abstains, Faults, LeftOut, Refused, Unusable};

/// Fault of a run's end, if any.
fn judged(desk: &Desk, options: &str, ends: &Ends, messages: &mut BTreeSet<String>) -> Result<(), String> {
    let out = desk.path("out");
    let _ = fs::remove_dir_all(&out);
    let run = desk.line(&format!("diagnose {options} --out out -q"));
    match ends {
        Refused(said) => {
            let message = run.stderr.trim_end();
            if run.code != 2 {
                return Err(format!("exit code {}: {message}", run.code));
            }
            if out.exists() || !run.stdout.is_empty() {
                return Err(format!("something was written: {}", run.stdout));
            }
            if let Some(missing) = said.iter().find(|said| !message.contains(**said)) {
                return Err(format!("said {message:?}, without {missing:?}"));
            }
            if message.contains("panicked") || !message.starts_with("error: ") {
                return Err(message.to_owned());
            }
            messages.insert(message.to_owned());
        }
        Faults(_) | Abstains | Unusable(_) | LeftOut(_) => {
            let (due, verdict, finding) = match ends {
                Faults(due) => (due.to_vec(), "none", "nothing_found"),
                Unusable(due) => (vec![*due], "unknown", "data_unusable"),
                LeftOut(due) => (vec![*due], "unknown", "not_understood"),
                _ => (Vec::new(), "unknown", "not_understood"),
            };
            if run.code != 0 {
                return Err(format!("exit code {}: {}", run.code, run.stderr));
            }
            let json: Value = serde_json::from_str(&desk.read("out/diagnosis.json")).map_err(|e| e.to_string())?;
            let faults = json["data_faults"].as_array().unwrap();
            let found: BTreeSet<&str> = faults.iter().map(|fault| fault["name"].as_str().unwrap()).collect();
            if found != due.iter().copied().collect() {
                return Err(format!("faults {faults:?}, notes {}", json["notes"]));
            }
            let causes: Vec<&Value> = json["causes"].as_array().unwrap().iter().map(|cause| &cause["name"]).collect();
            if faults.iter().any(|fault| fault["advice"].as_str().is_none_or(str::is_empty)) {
                return Err(format!("no advice: {faults:?}"));
            }
            if !causes.is_empty() || json["verdict"] != verdict || json["finding"] != finding {
                return Err(format!("verdict {}, causes {causes:?}, {}", json["verdict"], json["unexplained"]));
            }
            if !Path::new(&desk.path("out/report.html")).exists() {
                return Err("no report.html".into());
            }
            let page = desk.read("out/report.html");
            if page.contains(r#"class="stamp data-faults""#) == due.is_empty() {
                return Err("the page is not stamped as the faults are".into());
            }
        }
    }
    Ok(())
}

fn all_judged(desk: &Desk, cases: &[(&str, String, Ends)], prepare: impl Fn(usize)) {
    let mut messages = BTreeSet::new();
    let mut refused = 0;
    let wrong: Vec<String> = cases
        .iter()
        .enumerate()
        .filter_map(|(k, (name, options, ends))| {
            prepare(k);
            refused += usize::from(matches!(ends, Refused(_)));
            judged(desk, options, ends, &mut messages).err().map(|what| format!("{name}: {what}"))
        })
        .collect();
    println!("{} files, {refused} refused with {} messages", cases.len(), messages.len());
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), cases.len(), wrong.join("\n"));
    assert_eq!(messages.len(), refused, "two mistakes got the same message: {messages:#?}");
}

/// Only damage that the reader alone does not judge; what it refuses or names stands in `tests/measured_data.rs`.
#[test]
fn damage_that_the_reader_alone_does_not_judge_is_refused_or_named_and_no_physics_blamed() {
    let good = healthy(ROWS).csv();
    let rows = |n: usize| good.lines().take(n + 1).collect::<Vec<_>>().join("\n") + "\n";
    let deg = 180.0 / PI;
    let files: Vec<(&str, Vec<u8>, Ends)> = vec![
        ("sound", good.clone().into(), Faults(&[])),
        ("empty", Vec::new(), Refused(&["data.csv:1: ", "no header"])),
        ("too few rows to diagnose", rows(120).into(), Refused(&["data.csv", "120", "200"])),
        (
            "mixed separators",
            edited(|k, line| if k > 3000 { line.replace(',', ";") } else { line.to_owned() } + "\n"),
            Refused(&["data.csv:3002: "]),
        ),
        (
            "the generator of another drive",
            changed(|b| {
                let mut r = fastrand::Rng::with_seed(2);
                b.generator_rad.iter_mut().for_each(|a| *a = 40.0 * r.f64());
            }),
            Refused(&["data.csv"]),
        ),
        ("no time", edited(|_, line| line.split_once(',').unwrap().1.to_owned() + "\n"), Faults(&[])),
        ("torque in mN.m", changed(|b| scaled(b.torque(), 1e3)), LeftOut("unit_mismatch")),
        (
            "both angles in degrees",
            changed(|b| {
                scaled(&mut b.generator_rad, deg);
                scaled(&mut b.output_rad, deg);
            }),
            Refused(&["angles in degrees", "--columns generator=generator_rad:deg,output=output_rad:deg"]),
        ),
        ("torque turned round", changed(|b| scaled(b.torque(), -1.0)), Faults(&["torque_sign"])),
        ("torque of the motor", changed(|b| scaled(b.torque(), 1.0 / RATIO)), Unusable("unit_mismatch")),
        ("torque whose zero is off", changed(|b| shifted(b.torque(), 0.8)), Faults(&["torque_zero"])),
        (
            "torque in steps of a twentieth of its range",
            changed(|b| b.torque().iter_mut().for_each(|t| *t = (*t / 1.5).round() * 1.5)),
            Faults(&["quantisation"]),
        ),
        (
            "torque that saturates",
            changed(|b| b.torque().iter_mut().for_each(|t| *t = t.clamp(-15.0, 15.0))),
            Faults(&["frozen_channel"]),
        ),
        (
            "torque of another drive",
            changed(|b| {
                let time = b.time_s.clone();
                let other = |t: f64| 24.0 * (TAU * t / 3.7).sin();
                b.torque().iter_mut().zip(time).for_each(|(torque, t)| *torque = other(t));
            }),
            Unusable("torque_scale"),
        ),
        (
            "a counter that begins anew after a break",
            changed(|b| {
                shifted(&mut b.time_s[2500..], 600.0);
                shifted(&mut b.generator_rad[2500..], 7.0 * TAU);
            }),
            Faults(&["counter_restart"]),
        ),
        (
            "a register of 16 bit that wraps",
            changed(|b| {
                b.generator_rad.iter_mut().for_each(|a| *a = (*a + 8.0 * TAU).rem_euclid(16.0 * TAU) - 8.0 * TAU);
            }),
            Faults(&["position_jump"]),
        ),
        (
            "another zero after a break",
            changed(|b| {
                shifted(&mut b.time_s[2500..], 600.0);
                shifted(&mut b.output_rad[2500..], 0.0123);
            }),
            Faults(&["position_jump"]),
        ),
        (
            "two files joined without a time, the generator within one turn",
            {
                let mut bench = healthy(ROWS);
                let on = 0.4 * TAU * RATIO;
                shifted(&mut bench.generator_rad[3000..], on);
                shifted(&mut bench.output_rad[3000..], on / RATIO);
                bench.generator_rad.iter_mut().for_each(|a| *a = a.rem_euclid(TAU));
                let without = |line: &str| line.split_once(',').unwrap().1.to_owned() + "\n";
                bench.csv().lines().map(without).collect::<String>().into()
            },
            Faults(&[]),
        ),
        (
            "a logger that stands still after every 50 rows and counts on",
            edited(|k, line| {
                let (block, row) = (k / 54, k % 54);
                if k > 0 && row >= 50 {
                    return String::new();
                }
                let counted = format!("{:.6}", 0.01 * (50 * block + row) as f64);
                if k == 0 { format!("{line}\n") } else { format!("{counted},{}\n", line.split_once(',').unwrap().1) }
            }),
            Faults(&["stalls"]),
        ),
        (
            "time backwards",
            edited(|k, line| {
                format!("{line}\n").replacen(
                    &format!("{:.6}", 0.01 * (k as f64 - 1.0)),
                    &format!("{:.6}", 60.0 - 0.01 * k as f64),
                    usize::from(k > 0),
                )
            }),
            Faults(&["clock_error"]),
        ),
        (
            "spikes in three rows of a hundred",
            changed(|b| {
                let mut random = fastrand::Rng::with_seed(8);
                for k in (5..5990).filter(|_| random.f64() < 0.03).collect::<Vec<_>>() {
                    b.output_rad[k] += if random.bool() { 90.0 } else { -90.0 } * ARCSEC;
                }
            }),
            Faults(&["outliers"]),
        ),
        (
            "a zero that drifts",
            changed(|b| (0..b.rows()).for_each(|k| b.output_rad[k] += 0.008 * k as f64 * ARCSEC)),
            Faults(&["drift"]),
        ),
        ("torque dead", changed(|b| b.torque().fill(0.0)), Abstains),
    ];
    // Wrong mappings, and the right one, of a torque in mN.m.
    let torque_in_mnm = changed(|b| scaled(b.torque(), 1e3));
    let mapped = [
        ("a mapped column that is not there", "generator=psi:rad", Refused(&["psi"])),
        ("a mapped unit that is none", "generator=generator_rad:grad", Refused(&["--columns", "grad"])),
        ("a mapped quantity that is none", "motor=generator_rad:rad", Refused(&["--columns", "motor"])),
        ("a mapping without columns", "generator", Refused(&["--columns", "\"generator\""])),
        ("torque in mN.m, said", "torque=torque_n_m:mN.m", Faults(&[])),
    ];
    let desk = Desk::new();
    desk.write("nominal.toml", MODEL);
    let (mut cases, mut contents) = (Vec::new(), Vec::new());
    for (name, content, ends) in files {
        cases.push((name, "data.csv --model nominal.toml".to_owned(), ends));
        contents.push(content);
    }
    for (name, columns, ends) in mapped {
        cases.push((name, format!("data.csv --model nominal.toml --columns {columns}"), ends));
        contents.push(torque_in_mnm.clone());
    }
    all_judged(&desk, &cases, |k| fs::write(desk.path("data.csv"), &contents[k]).unwrap());
}

#[test]
fn every_field_of_the_nominal_model_is_checked() {
    let cases: [(&str, &str, &'static [&'static str]); 31] = [
        (MODEL, "", &["drive"]),
        ("[drive]", "[drive", &["wrong.toml:1"]),
        ("[drive]", "[nominally]", &["nominally"]),
        (&MODEL[MODEL.find("[nominal]").unwrap()..], "", &["nominal"]),
        ("backlash_arcsec", "backlash_arcmin", &["wrong.toml:7", "backlash_arcmin"]),
        ("= 188", "= 18", &["wrong.toml:2", "flexspline_teeth", "found 18", "20 to 2000"]),
        ("= 188", "= -188", &["wrong.toml:2", "-188"]),
        ("= 188", "= \"many\"", &["wrong.toml:2", "many"]),
        ("= 190", "= 188", &["wrong.toml:3", "circular_spline_teeth", "found 188"]),
        ("= 190", "= 288", &["wrong.toml:3", "found 288"]),
        ("circular_spline_teeth = 190\n", "", &["expected flexspline_teeth and circular_spline_teeth"]),
        ("\"flexspline\"", "\"housing\"", &["wrong.toml:4", "housing"]),
        ("fixed = \"flexspline\"", "ratio = 95.0", &["ratio alone"]),
        (TEETH, "ratio = 0\n", &["wrong.toml:2", "drive.ratio", "found 0"]),
        (TEETH, "ratio = nan\n", &["drive.ratio", "nan"]),
        ("30000.0", "0.0", &["wrong.toml:6", "stiffness_n_m_per_rad", "0.0"]),
        ("30000.0", "-1.0", &["wrong.toml:6", "-1.0"]),
        ("30000.0", "[[1.0, 30000.0]]", &["wrong.toml:6", "torques from 0 upward", "[1.0"]),
        ("30000.0", "[[0.0, 3e4], [9.0, 3e4], [5.0, 3e4]]", &["wrong.toml:6", "5.0"]),
        ("30000.0", "\"stiff\"", &["wrong.toml:6", "N·m/rad"]),
        ("= 40.0", "= -40.0", &["wrong.toml:7", "backlash_arcsec", "-40"]),
        ("= 40.0", "= inf", &["wrong.toml:7", "inf"]),
        ("torque_n_m = 1.0", "torque_n_m = -1.0", &["wrong.toml:8", "friction_torque_n_m"]),
        ("temperature_c = 20.0", "temperature_c = -300.0", &["wrong.toml:9", "temperature_c", "-300"]),
        ("generator_turn = 2.0", "generator_turn = 0", &["wrong.toml:11", "harmonic[0].order_per_generator_turn"]),
        ("amplitude_arcsec = 12.0", "amplitude_arcsec = nan", &["wrong.toml:12", "amplitude_arcsec"]),
        ("phase_rad = 0.4", "phase_rad = 1e6", &["wrong.toml:13", "phase_rad", "1000000"]),
        ("phase_rad = 0.4\n", "", &["wrong.toml", "phase_rad"]),
        ("stiffness = 0.03", "stiffness = 3", &["wrong.toml:15", "unit_to_unit.stiffness", "found 3"]),
        ("backlash = 0.05", "backlash = -0.05", &["wrong.toml:16", "unit_to_unit.backlash"]),
        ("harmonic = 0.2", "harmonic = nan", &["wrong.toml:17", "unit_to_unit.harmonic"]),
    ];
    let desk = Desk::new();
    desk.write("data.csv", &healthy(ROWS).csv());
    let change = |k: usize| {
        assert!(MODEL.contains(cases[k].0), "{}", cases[k].0);
        desk.write("wrong.toml", &MODEL.replacen(cases[k].0, cases[k].1, 1));
    };
    let refused = cases.map(|(_, to, said)| (to, "data.csv --model wrong.toml".to_owned(), Refused(said)));
    all_judged(&desk, &refused, change);
}

#[test]
fn files_and_tables_that_are_not_what_they_are_taken_for_are_refused() {
    let desk = Desk::new();
    desk.write("data.csv", &healthy(ROWS).csv());
    desk.write("nominal.toml", MODEL);
    fs::write(desk.path("binary.toml"), [0, 159, 146, 150]).unwrap();
    fs::create_dir(desk.path("folder")).unwrap();
    fs::create_dir(desk.path("models")).unwrap();
    fs::create_dir(desk.path("damaged")).unwrap();
    fs::write(desk.path("damaged/cam.fxt"), b"no table").unwrap();
    let case =
        |name: &'static str, options: &str, said: &'static [&'static str]| (name, options.to_owned(), Refused(said));
    let cases = [
        case("no data", "missing.csv --model nominal.toml", &["missing.csv"]),
        case("a folder as data", "folder --model nominal.toml", &["folder"]),
        case("no model", "data.csv --model missing.toml", &["missing.toml"]),
        case("a folder as model", "data.csv --model models", &["models: "]),
        case("a binary model", "data.csv --model binary.toml", &["binary.toml"]),
        case("data as model", "data.csv --model data.csv", &["data.csv:1"]),
        case("neither model nor tables", "data.csv", &["--model"]),
        case("model and tables", "data.csv --model nominal.toml --tables damaged", &["--tables"]),
        case("no tables there", "data.csv --tables folder", &["cam.fxt"]),
        case("a damaged table", "data.csv --tables damaged", &["damaged/cam.fxt"]),
        case("a generator that is none", "data.csv --tables damaged --generator triangle", &["triangle"]),
    ];
    all_judged(&desk, &cases, |_| ());
}

/// Data of other gears than that of the model: 188 and 190 teeth with the circular spline the output.
#[test]
fn a_gear_that_the_data_are_not_of_is_refused_or_named_as_its_ratio() {
    let desk = Desk::new();
    desk.write("nominal.toml", MODEL);
    let measured = |ratio: f64| {
        let mut bench = healthy(ROWS);
        for (output, generator) in bench.output_rad.iter_mut().zip(&bench.generator_rad) {
            *output += generator / ratio - generator / RATIO;
        }
        desk.write("data.csv", &bench.csv());
        desk.line("diagnose data.csv --model nominal.toml --out out -q")
    };
    let half = measured(50.0);
    assert!(half.code == 2 && half.stderr.contains("the ratio 95 asks for"), "{} {}", half.code, half.stderr);
    let other_wheel = measured(-94.0);
    assert!(other_wheel.code == 2, "{} {}", other_wheel.code, other_wheel.stderr);
    assert!(
        other_wheel.stderr.contains("the ratio -94 of the same teeth with the other wheel fixed"),
        "{}",
        other_wheel.stderr
    );
    assert!(!desk.path("out").exists());
    // A neighbour in the catalogue is a drive of this kind: the run ends with both ratios all the same.
    let neighbour = measured(100.0);
    let named =
        neighbour.stderr.contains("error: data.csv: ratio: found 95") && neighbour.stderr.contains("allowed: 100");
    assert!(neighbour.code == 2 && named, "{} {}", neighbour.code, neighbour.stderr);
    assert!(!desk.path("out").exists());
    // An error of the ratio that no other whole one explains is a cause.
    measured(95.2).done();
    let json: Value = serde_json::from_str(&desk.read("out/diagnosis.json")).unwrap();
    let causes: Vec<&Value> = json["causes"].as_array().unwrap().iter().map(|cause| &cause["name"]).collect();
    assert_eq!(causes, ["ratio_error"], "{json}");
    let error = json["causes"][0]["parameters"]["ratio_relative_error"]["value"].as_f64().unwrap();
    assert!((error - (95.0 / 95.2 - 1.0)).abs() < 1e-4, "{error}");
}

/// Writes the healthy drive over and over, as one long record.
fn long(desk: &Desk, rows: usize) -> f64 {
    use std::io::Write;
    let mut file = std::io::BufWriter::new(fs::File::create(desk.path("data.csv")).unwrap());
    let bench = healthy(200_000.min(rows));
    let n = bench.rows();
    writeln!(file, "time_s,generator_rad,output_rad,torque_n_m,temperature_c").unwrap();
    for k in 0..rows {
        let (part, row) = ((k / n) as f64, k % n);
        // The next part goes on where the one before it stood, in angle and in time.
        let (turned, carried) = (bench.generator_rad[n - 1] - bench.generator_rad[0], part);
        let psi = bench.generator_rad[row] + carried * (turned / TAU).round() * TAU;
        let error = bench.output_rad[row] - bench.generator_rad[row] / RATIO;
        writeln!(
            file,
            "{:.3},{:.7},{:.10},{:.3},{:.2}",
            0.01 * k as f64,
            psi,
            psi / RATIO + error,
            bench.torque_n_m.as_ref().unwrap()[row],
            bench.temperature_c.as_ref().unwrap()[row]
        )
        .unwrap();
    }
    drop(file);
    desk.write("nominal.toml", MODEL);
    let begun = Instant::now();
    let run = desk.line("diagnose data.csv --model nominal.toml --out out -q").done();
    assert_eq!(run.stdout, "");
    let json: Value = serde_json::from_str(&desk.read("out/diagnosis.json")).unwrap();
    let found = ["causes", "data_faults"].map(|list| json[list].as_array().unwrap().len());
    assert_eq!((json["verdict"].as_str(), found), (Some("none"), [0; 2]), "{json}");
    let page = fs::metadata(desk.path("out/report.html")).unwrap().len();
    assert!(page <= 1_500_000, "{page} bytes");
    begun.elapsed().as_secs_f64()
}

#[test]
#[ignore = "long: tests/run slow"]
fn two_hundred_thousand_rows() {
    println!("{:.1} s", long(&Desk::new(), 200_000));
}

/// More than a diagnosis reads at once.
#[test]
#[ignore = "a minute of a processor, 115 MB of text"]
fn two_million_rows() {
    println!("{:.1} s", long(&Desk::new(), 2_000_000));
}
