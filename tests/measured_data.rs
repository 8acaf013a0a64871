//! Measured data, damaged in every way that is known: each file ends in a clear error or in a fault with its name, and
//! what is physics is not taken for a fault.

use crate::bench_data::{ARCSEC, Bench, RATIO, normal, scaled, shifted};
use flexspline::Table;
use flexspline_identify::calibrate::{CalibrationError, Prior, calibrate};
use flexspline_identify::measurement::{ColumnMap, Fault, FaultName, Gear, MeasuredError, Recording, Treatment, parse};
use flexspline_identify::replay;
use flexspline_mechanics::drive::GeneratorKind;
use flexspline_tests::seeds;

fn gear() -> Gear {
    Gear::of_teeth(188, 190, true)
}

fn read(text: &[u8]) -> Result<Recording, MeasuredError> {
    parse("m.csv", text, &ColumnMap::default(), &gear())
}

/// Faults that a calibration by the ratio alone reports.
fn faults_by_ratio(bench: &Bench) -> Result<Vec<Fault>, CalibrationError> {
    let made = calibrate(&[read(bench.csv().as_bytes()).unwrap()], &Prior::of_ratio(RATIO, GeneratorKind::Cam))?;
    Ok(made.calibration.data_faults)
}

fn names(recording: &Recording) -> Vec<FaultName> {
    names_of(&recording.faults)
}

fn names_of(faults: &[Fault]) -> Vec<FaultName> {
    let mut names: Vec<FaultName> = faults.iter().map(|fault| fault.name).collect();
    names.sort();
    names.dedup();
    names
}

#[test]
fn clean_data_has_no_fault() {
    let bench = Bench::plain(6000, 1.0, 3);
    let read = read(bench.csv().as_bytes()).unwrap();
    assert_eq!(read.faults, []);
    assert_eq!(read.sessions.len(), 1);
    let session = &read.sessions[0];
    assert_eq!(session.len(), 6000);
    assert_eq!((session.line[0], session.line[5999]), (2, 6001));
    for row in [0, 777, 5999] {
        let error = bench.output_rad[row] - bench.generator_rad[row] / RATIO;
        assert!((session.error_rad[row] - error).abs() < 1e-9);
        assert!((session.output_rad(RATIO)[row] - bench.output_rad[row]).abs() < 1e-10);
    }
}

/// False alarms over many drives with backlash, hysteresis, resonance, damaged teeth, wear, heat, latency, gravity and
/// the rest.
#[test]
fn physics_is_not_taken_for_a_fault_of_the_data() {
    let seeds = seeds(100, 300);
    let mut alarms = Vec::new();
    for seed in 0..seeds {
        let (bench, said) = Bench::drawn(5000, seed);
        let read = read(bench.csv().as_bytes()).unwrap_or_else(|error| panic!("seed {seed} {said:?}: {error}"));
        if !read.faults.is_empty() {
            let what: Vec<_> = read.faults.iter().map(|fault| &fault.what).collect();
            alarms.push(format!("seed {seed} {said:?}: {what:?}"));
        }
    }
    println!("{} false alarms in {seeds}", alarms.len());
    assert!(alarms.len() as f64 <= 0.01 * seeds as f64, "{} in {seeds}:\n{}", alarms.len(), alarms.join("\n"));
}

/// Friction holds a flank until the load is worth a few percent of its largest; then the clearance is crossed within a
/// row, while the wind-up still creeps after the load.
#[test]
fn a_flank_that_friction_lets_go_is_no_lost_index() {
    for seed in 20..20 + seeds(8, 30) {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut bench = Bench { torque_n_m: Some(Vec::new()), ..Bench::default() };
        let (mut psi, mut flank, mut crept, mut time) = (0.0, 1.0_f64, 0.0, 0.0);
        let (pace, period, let_go) =
            (0.004 + 0.01 * random.f64(), 80.0 + 80.0 * random.f64(), 0.6 + 1.2 * random.f64());
        for k in 0..15_000 {
            if k % 3000 == 0 {
                time += 400.0;
                flank = if random.bool() { 1.0 } else { -1.0 };
            }
            time += 0.01;
            psi += if k % 5000 < 3500 { pace } else { -pace };
            let torque: f64 =
                30.0 * (std::f64::consts::TAU * time / period).sin() * (0.3 + 0.7 * (k % 3000) as f64 / 3e3);
            if torque.abs() > let_go {
                flank = torque.signum();
            }
            crept += (torque - crept) * 0.01 / 40.0;
            let error =
                3.0 * torque + 4.0 * crept + 28.0 * flank + 12.0 * (2.0 * psi).sin() + 1.2 * normal(&mut random);
            bench.time_s.push(time);
            bench.generator_rad.push(psi);
            bench.output_rad.push(psi / RATIO + error * ARCSEC);
            bench.torque_n_m.as_mut().unwrap().push(torque + 0.04 * normal(&mut random));
        }
        let faults = faults_by_ratio(&bench).unwrap();
        assert!(!names_of(&faults).contains(&EncoderIndexJump), "seed {seed}: {faults:?}");
    }
}

/// Under a generator that stands, an output that leaves by a tooth pitch has ratcheted; one that moves on slowly is a
/// frozen generator.
#[test]
fn a_generator_that_stands_while_teeth_skip_is_not_frozen() {
    let pitch = std::f64::consts::TAU / 190.0;
    let stands = |slides: usize| {
        let mut bench = Bench::plain(6000, 1.0, 3);
        let still = bench.generator_rad[1500];
        bench.generator_rad[1500..1700].fill(still);
        for k in 1500..6000 {
            bench.output_rad[k] -= pitch * ((k as f64 - 1580.0) / slides as f64).clamp(0.0, 1.0);
        }
        for k in 1500..1700 {
            bench.output_rad[k] += (still - bench.generator_rad[1499] - 0.05 * (k as f64 - 1499.0)) / RATIO;
        }
        names(&read(bench.csv().as_bytes()).unwrap())
    };
    assert!(!stands(4).contains(&FaultName::FrozenChannel), "{:?}", stands(4));
    assert!(stands(110).contains(&FaultName::FrozenChannel), "{:?}", stands(110));
}

/// Required end of a run over a damaged file.
enum Ends {
    /// An error that says all this.
    Error(&'static [&'static str]),
    /// These faults and no others, in order of their names.
    Faults(&'static [FaultName]),
}

use Ends::{Error, Faults};
use FaultName::{ClockError, EncoderIndexJump, FrozenChannel, MissingSamples, Outliers, Quantisation, UnitMismatch};

/// The plain drive with some rows of its file changed: number of the row from 0, its fields.
fn edited(change: impl Fn(usize, &mut Vec<String>)) -> Vec<u8> {
    let text = Bench::plain(4000, 1.0, 5).csv();
    let mut lines = text.lines();
    let mut edited = format!("{}\n", lines.next().unwrap());
    for (row, line) in lines.enumerate() {
        let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        change(row, &mut fields);
        if !fields.is_empty() {
            edited.push_str(&fields.join(","));
            edited.push('\n');
        }
    }
    edited.into()
}

/// The plain drive with the fields of line 9 changed.
fn in_line_9(change: impl Fn(&mut Vec<String>)) -> Vec<u8> {
    edited(|row, fields| {
        if row == 7 {
            change(fields)
        }
    })
}

/// The plain drive with this text in a column of every 400th row.
fn now_and_then(column: usize, text: &str) -> Vec<u8> {
    edited(|row, fields| {
        if row % 400 == 7 {
            fields[column] = text.into()
        }
    })
}

/// The plain drive with its columns changed.
fn changed(change: impl Fn(&mut Bench)) -> Vec<u8> {
    let mut bench = Bench::plain(4000, 1.0, 5);
    change(&mut bench);
    bench.csv().into()
}

/// Rows in which a channel keeps the value that it has in the first of them.
fn frozen(values: &mut [f64], rows: std::ops::Range<usize>) {
    let value = values[rows.start];
    values[rows].fill(value);
}

#[test]
fn every_damaged_file_ends_in_a_clear_error_or_a_named_fault() {
    const TIME: usize = 0;
    const GENERATOR: usize = 1;
    const OUTPUT: usize = 2;
    const TORQUE: usize = 3;
    const TEMPERATURE: usize = 4;
    let good = Bench::plain(4000, 1.0, 5).csv();
    let header = "time_s,generator_rad,output_rad,torque_n_m,temperature_c\n";
    let rows = |n: usize| good.lines().take(n + 1).collect::<Vec<_>>().join("\n") + "\n";
    let angles_alone = |line: &str| line.split(',').collect::<Vec<_>>()[1..3].join(",") + "\n";
    let deg = 180.0 / std::f64::consts::PI;
    let cases: Vec<(&str, Vec<u8>, Ends)> = vec![
        // Files that are no table.
        ("empty", Vec::new(), Error(&["m.csv:1: ", "no header"])),
        ("blank lines", b"\n\n  \n".to_vec(), Error(&["no header"])),
        ("header only", header.into(), Error(&["m.csv:1: ", "no rows", "at least 16"])),
        ("one row", rows(1).into(), Error(&["1 row after", "at least 16"])),
        ("two rows", rows(2).into(), Error(&["2 rows after", "at least 16"])),
        ("binary", (0..=255_u8).cycle().take(4000).collect(), Error(&["binary"])),
        ("header not UTF-8", b"generator_rad,output_rad,\xB0C\n1,2,3\n".to_vec(), Error(&["m.csv:1: ", "1 row after"])),
        // Columns.
        ("semicolons", good.replace(',', ";").into(), Faults(&[])),
        ("decimal commas", good.replace(',', ";").replace('.', ",").into(), Faults(&[])),
        ("tabs", good.replace(',', "\t").into(), Faults(&[])),
        (
            "no generator",
            good.replacen("generator_rad", "motor", 1).into(),
            Error(&["column generator_rad is missing", "found: time_s, motor", "--columns"]),
        ),
        (
            "no output",
            good.replacen("output_rad", "load", 1).into(),
            Error(&["neither column output_rad nor error_arcsec", "--columns"]),
        ),
        (
            "generator twice",
            good.replacen("torque_n_m", "generator_rad", 1).into(),
            Error(&["m.csv:1: column generator_rad is there twice"]),
        ),
        ("a line of units", good.replacen('\n', "\ns,rad,rad,Nm,degC\n", 1).into(), Faults(&[])),
        (
            "a huge number",
            in_line_9(|f| f[GENERATOR] = "1e300".into()),
            Error(&["m.csv:9: generator_rad: found \"1e300\"", "at most 1e9"]),
        ),
        ("a short row", in_line_9(|f| f.truncate(2)), Error(&["m.csv:9: 2 fields, but output_rad is field 3"])),
        ("a long row", in_line_9(|f| f.push("5.5".into())), Error(&["m.csv:9: 6 fields, but the header has 5"])),
        ("two rows in one", in_line_9(|f| f.extend(f.clone())), Error(&["m.csv:9: 10 fields"])),
        // Nothing to see.
        (
            "constant",
            changed(|b| {
                b.generator_rad.fill(1.0);
                b.output_rad.fill(0.01);
            }),
            Error(&["generator and output keep one value"]),
        ),
        ("output stands", changed(|b| b.output_rad.fill(0.01)), Error(&["output_rad does not follow"])),
        (
            "output frozen in most rows",
            changed(|b| frozen(&mut b.output_rad, 1000..3900)),
            Error(&["the output keeps one value over 29", "at most half"]),
        ),
        ("nothing but NaN", edited(|_, f| f[OUTPUT] = "NaN".into()), Error(&["0 rows have all that is needed"])),
        ("another ratio", changed(|b| scaled(&mut b.output_rad, 7.7)), Error(&["within a factor of 1.25", "ratio"])),
        ("torque of a ship", changed(|b| scaled(b.torque(), 1e6)), Error(&["torque: found", "at most 1e4"])),
        // Harmless.
        (
            "byte order mark, CRLF, comments, quotes",
            format!("\u{feff}# bench 7\n{}", good.replacen("\n", "\n# start\n", 1))
                .replace('\n', "\r\n")
                .replacen("output_rad", "\"output_rad\"", 1)
                .into(),
            Faults(&[]),
        ),
        ("commas at the end of rows", edited(|_, f| f.push(String::new())), Faults(&[])),
        (
            "a column of notes in Latin-1",
            {
                let mut bytes = Vec::new();
                for (k, line) in good.lines().enumerate() {
                    bytes.extend(line.bytes());
                    bytes.extend(if k == 0 { &b",note\n"[..] } else { b",\xB0C \n" });
                }
                bytes
            },
            Faults(&[]),
        ),
        ("no time, no torque", good.lines().map(angles_alone).collect::<String>().into(), Faults(&[])),
        (
            "constant temperature and torque",
            changed(|b| {
                b.torque().fill(0.0);
                b.temperature().fill(20.0);
            }),
            Faults(&[]),
        ),
        (
            "wrapped angles",
            changed(|b| {
                b.generator_rad.iter_mut().for_each(|a| *a = a.rem_euclid(std::f64::consts::TAU));
                b.output_rad.iter_mut().for_each(|a| *a = a.rem_euclid(std::f64::consts::TAU));
            }),
            Faults(&[]),
        ),
        ("a break of a minute", changed(|b| shifted(&mut b.time_s[2000..], 60.0)), Faults(&[])),
        // Missing.
        ("NaN", now_and_then(OUTPUT, "NaN"), Faults(&[MissingSamples])),
        ("inf", now_and_then(OUTPUT, "-inf"), Faults(&[MissingSamples])),
        ("empty fields", now_and_then(TORQUE, ""), Faults(&[MissingSamples])),
        ("n/a", now_and_then(TEMPERATURE, "n/a"), Faults(&[MissingSamples])),
        (
            // Every third row would be a channel that is recorded more slowly.
            "torque missing in most rows, without order",
            edited(|k, f| {
                if k * k % 7 > 1 {
                    f[TORQUE] = String::new()
                }
            }),
            Faults(&[MissingSamples]),
        ),
        ("time missing here and there", now_and_then(TIME, ""), Faults(&[MissingSamples])),
        (
            "rows lost",
            edited(|k, f| {
                if k % 400 < 4 {
                    f.clear()
                }
            }),
            Faults(&[MissingSamples]),
        ),
        ("last line broken off", good[..good.len() - 30].to_owned().into(), Faults(&[MissingSamples])),
        // Clock.
        (
            "rows repeated",
            {
                let mut text = String::new();
                for (k, line) in good.lines().enumerate() {
                    (0..if k % 300 == 50 { 2 } else { 1 }).for_each(|_| text.push_str(&format!("{line}\n")));
                }
                text.into()
            },
            Faults(&[ClockError]),
        ),
        (
            "rows out of order",
            {
                let mut lines: Vec<&str> = good.lines().collect();
                lines.swap(500, 501);
                lines.swap(1500, 1501);
                (lines.join("\n") + "\n").into()
            },
            Faults(&[ClockError]),
        ),
        ("clock set back", changed(|b| shifted(&mut b.time_s[2000..], -15.0)), Faults(&[ClockError])),
        ("one stamp from another day", changed(|b| b.time_s[2000] += 86_400.0), Faults(&[ClockError])),
        ("a clock that jumps ahead is a break", changed(|b| shifted(&mut b.time_s[2200..], 5.0)), Faults(&[])),
        (
            "clock of a fifth of a second",
            changed(|b| b.time_s.iter_mut().for_each(|t| *t = (*t * 5.0).floor() / 5.0)),
            Faults(&[ClockError]),
        ),
        (
            "stamps that jitter",
            changed(|b| {
                let mut random = fastrand::Rng::with_seed(3);
                b.time_s.iter_mut().for_each(|t| *t += 0.004 * (random.f64() - 0.5));
            }),
            Faults(&[ClockError]),
        ),
        ("time stands", changed(|b| b.time_s.fill(7.0)), Faults(&[ClockError])),
        ("time in nanoseconds", changed(|b| scaled(&mut b.time_s, 1e9)), Faults(&[ClockError])),
        // Units.
        (
            "generator in degrees",
            changed(|b| scaled(&mut b.generator_rad, deg)),
            Error(&["asks for", "--columns generator=generator_rad:deg"]),
        ),
        (
            "generator in turns",
            changed(|b| scaled(&mut b.generator_rad, deg / 360.0)),
            Error(&["--columns generator=generator_rad:turn"]),
        ),
        (
            "generator wrapped at 360",
            changed(|b| b.generator_rad.iter_mut().for_each(|a| *a = (*a * deg).rem_euclid(360.0))),
            Error(&["--columns generator=generator_rad:deg"]),
        ),
        ("output in degrees", changed(|b| scaled(&mut b.output_rad, deg)), Error(&["--columns output=output_rad:deg"])),
        (
            "output in arc-seconds",
            changed(|b| scaled(&mut b.output_rad, 1.0 / ARCSEC)),
            Error(&["--columns output=output_rad:arcsec"]),
        ),
        (
            "columns exchanged",
            good.replacen("generator_rad,output_rad", "output_rad,generator_rad", 1).into(),
            Faults(&[UnitMismatch]),
        ),
        (
            "output counts backwards",
            changed(|b| scaled(&mut b.output_rad, -1.0)),
            Error(&["the output counts the other way", "--columns output=output_rad:-rad, or the ratio -95"]),
        ),
        ("torque in mN.m", changed(|b| scaled(b.torque(), 1e3)), Faults(&[UnitMismatch])),
        ("temperature in kelvin", changed(|b| shifted(b.temperature(), 273.15)), Faults(&[UnitMismatch])),
        // Encoders.
        ("output frozen", changed(|b| frozen(&mut b.output_rad, 1500..1620)), Faults(&[FrozenChannel])),
        ("generator frozen", changed(|b| frozen(&mut b.generator_rad, 600..720)), Faults(&[FrozenChannel])),
        ("torque frozen", changed(|b| frozen(b.torque(), 1500..1800)), Faults(&[FrozenChannel])),
        ("temperature frozen", changed(|b| frozen(b.temperature(), 1500..1800)), Faults(&[FrozenChannel])),
        (
            "spikes of the output",
            changed(|b| (100..3900).step_by(331).for_each(|k| b.output_rad[k] += 60.0 * ARCSEC)),
            Faults(&[Outliers]),
        ),
        (
            "spikes of the torque",
            changed(|b| (100..3900).step_by(331).for_each(|k| b.torque()[k] += 25.0)),
            Faults(&[Outliers]),
        ),
        (
            "a coarse output encoder",
            changed(|b| b.output_rad.iter_mut().for_each(|a| *a = (*a / (12.0 * ARCSEC)).round() * 12.0 * ARCSEC)),
            Faults(&[Quantisation]),
        ),
        (
            "a coarse generator encoder",
            changed(|b| b.generator_rad.iter_mut().for_each(|a| *a = (*a / 0.005).round() * 0.005)),
            Faults(&[Quantisation]),
        ),
        // Two at once.
        (
            "NaN, kelvin",
            changed(|b| {
                shifted(b.temperature(), 273.15);
                b.output_rad[77] = f64::NAN;
            }),
            Faults(&[MissingSamples, UnitMismatch]),
        ),
    ];
    let mut wrong = Vec::new();
    for (name, bytes, ends) in &cases {
        let read = read(bytes);
        match (ends, &read) {
            (Error(said), Err(error)) => {
                let text = error.to_string();
                if !text.starts_with("m.csv") || !said.iter().all(|said| text.contains(said)) || text.contains('\n') {
                    wrong.push(format!("{name}: said {text:?}, wanted {said:?}"));
                }
            }
            (Faults(due), Ok(recording)) => {
                if names(recording) != *due {
                    let found: Vec<_> = recording.faults.iter().map(|fault| (fault.name, &fault.what)).collect();
                    wrong.push(format!("{name}: found {found:?}, wanted {due:?}, notes {:?}", recording.notes));
                }
            }
            (Error(said), Ok(recording)) => {
                wrong.push(format!("{name}: accepted, {:?}, wanted {said:?}", recording.faults))
            }
            (Faults(due), Err(error)) => wrong.push(format!("{name}: {error}, wanted {due:?}")),
        }
    }
    println!("{} damaged files", cases.len());
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), cases.len(), wrong.join("\n"));
}

#[test]
fn what_is_repaired_is_as_it_was_and_its_place_is_said() {
    let clean = read(Bench::plain(4000, 1.0, 5).csv().as_bytes()).unwrap();
    let clean = &clean.sessions[0];
    // Units: the same data as with the right ones.
    for (name, text) in [
        (
            "exchanged",
            Bench::plain(4000, 1.0, 5).csv().replacen("generator_rad,output_rad", "output_rad,generator_rad", 1).into(),
        ),
        ("wrapped", changed(|b| b.generator_rad.iter_mut().for_each(|a| *a = a.rem_euclid(std::f64::consts::TAU)))),
    ] {
        let session = &read(&text).unwrap().sessions[0];
        for row in [0, 1234, 3999] {
            assert!((session.generator_rad[row] - clean.generator_rad[row]).abs() < 1e-6, "{name}");
            assert!((session.error_rad[row] - clean.error_rad[row]).abs() < 0.01 * ARCSEC, "{name}");
            let warm =
                |session: &flexspline_identify::measurement::Session| session.temperature_c.as_ref().unwrap()[row];
            assert!((warm(session) - warm(clean)).abs() < 1e-4, "{name}");
        }
    }
    // What its size alone says of a unit converts nothing: the column is left out, and all else is as it was.
    let kelvin = read(&changed(|b| shifted(b.temperature(), 273.15))).unwrap();
    assert!(kelvin.sessions[0].temperature_c.is_none() && kelvin.sessions[0].error_rad == clean.error_rad);
    assert!(kelvin.faults[0].what.contains("temperature=temperature_c:K"), "{:?}", kelvin.faults);
    // Frozen rows are left out, by their lines.
    let frozen = read(&changed(|b| frozen(&mut b.output_rad, 1500..1620))).unwrap();
    assert_eq!((frozen.faults[0].first_line, frozen.faults[0].rows, frozen.sessions[0].len()), (1502, 120, 3880));
    assert_eq!(frozen.sessions[0].line[1500], 1622);
}

/// By ratio and teeth alone, in what a calibration leaves: line, size, and the table of the same unit without it.
#[test]
fn a_lost_index_is_found_where_it_is_and_costs_the_table_nothing() {
    let calibrated = |text: &[u8]| {
        let mut prior = Prior::of_ratio(95.0, GeneratorKind::Cam);
        prior.nominal.teeth = Some(prior.nominal.teeth_or_of_two_waves());
        let made = calibrate(&[read(text).unwrap()], &prior).unwrap();
        (made.calibration.held_out.rms_after_arcsec, made.calibration.data_faults, made.table.image)
    };
    let (sound, none, image) = calibrated(&changed(|_| {}));
    assert_eq!(none, []);
    let replayed = |text: &[u8]| {
        let table = Table::check(&image).unwrap();
        let rows = replay::read("m.csv", text, &ColumnMap::default(), &table, 20.0, true).unwrap();
        replay::replay(&table, &rows.rows, None).1.rms_residual_arcsec
    };
    let pitch_arcsec = std::f64::consts::TAU / 190.0 / ARCSEC;
    for steps in [&[(1700, 53.0)][..], &[(900, -31.0), (2600, 400.0)], &[(1700, -2.0 * pitch_arcsec)]] {
        let text = changed(|b| steps.iter().for_each(|(row, size)| shifted(&mut b.output_rad[*row..], size * ARCSEC)));
        let (left, faults, _) = calibrated(&text);
        let found: Vec<(u64, f64)> = faults.iter().map(|of| (of.first_line, of.size_arcsec.unwrap())).collect();
        assert_eq!(names_of(&faults), [EncoderIndexJump], "{faults:?}");
        assert!(faults.iter().all(|of| of.treatment == Treatment::Repaired && of.time_s.is_some()), "{faults:?}");
        assert_eq!(found.len(), steps.len(), "{found:?}");
        for (row, size) in steps {
            let close = |of: &(u64, f64)| of.0 == *row as u64 + 2 && (of.1 - size).abs() < 3.0 + 0.1 * size.abs();
            assert!(found.iter().any(close), "{found:?}");
        }
        assert!(faults.iter().all(|of| of.what.contains("skipped by -2") == (steps[0].1 < -1e3)), "{faults:?}");
        assert!(left < 1.05 * sound, "{left} for {sound}");
        let [with, without] = [replayed(&text), replayed(&changed(|_| {}))];
        assert!(with < 1.1 * without, "{with} for {without}");
    }
    // That of the generator, 0.03 rad: before it is taken out it keeps parts from being chosen.
    let (_, faults, _) = calibrated(&changed(|b| shifted(&mut b.generator_rad[1700..], 0.03)));
    let [lost] = &faults[..] else { panic!("{faults:?}") };
    let off = lost.size_arcsec.unwrap() + 0.03 / 95.0 / ARCSEC;
    assert!((lost.name, lost.first_line) == (EncoderIndexJump, 1702) && off.abs() < 6.0, "{lost:?}");
}

#[test]
fn a_sound_drive_loses_no_index() {
    let mut alarms = Vec::new();
    let seeds = seeds(30, 120);
    for seed in 80..80 + seeds {
        let (bench, said) = Bench::drawn(5000, seed);
        let Ok(faults) = faults_by_ratio(&bench) else { continue };
        let lost = faults.into_iter().find(|fault| fault.name == EncoderIndexJump);
        alarms.extend(lost.map(|fault| format!("seed {seed} {said:?}: {}", fault.what)));
    }
    assert!(alarms.len() as f64 <= 0.01 * seeds as f64, "{} in {seeds}:\n{}", alarms.len(), alarms.join("\n"));
}

/// There and back once, without a rest: the play looks like a step at the only turn. A table of the way there has none,
/// and its replay shows the error of that.
#[test]
fn the_play_of_a_single_turn_is_no_lost_index() {
    for seed in 0..3 {
        let mut random = fastrand::Rng::with_seed(seed);
        let (mut there_and_back, mut psi) = (Bench::default(), 0.0_f64);
        for k in 0..4200 {
            let pace = 0.314 * ((2100.0 - f64::from(k)) / 21.0).clamp(-1.0, 1.0);
            psi += pace;
            let error = 18.0 * (2.0 * psi).cos() - 17.6 * pace.signum() + 1.5 * normal(&mut random);
            there_and_back.time_s.push(0.05 * f64::from(k));
            there_and_back.generator_rad.push(psi);
            there_and_back.output_rad.push(psi / RATIO + error * ARCSEC);
        }
        assert_eq!(faults_by_ratio(&there_and_back).unwrap(), [], "seed {seed}");
        let text = there_and_back.csv();
        let there = read(text.split_inclusive('\n').take(2001).collect::<String>().as_bytes()).unwrap();
        let image = calibrate(&[there], &Prior::of_ratio(RATIO, GeneratorKind::Cam)).unwrap().table.image;
        let table = Table::check(&image).unwrap();
        let rows = replay::read("m.csv", text, &ColumnMap::default(), &table, 20.0, true).unwrap();
        assert!(rows.faults.is_empty() && replay::replay(&table, &rows.rows, None).1.rms_residual_arcsec > 15.0);
    }
}

/// Loads that go from level to level within .6 s, in motion and at rest, on a spring with knees, play and drag.
#[test]
fn a_load_that_is_changed_at_once_is_no_lost_index() {
    let spring = |load: f64| {
        let past = |knee: f64| load.signum() * (load.abs() - knee).max(0.0);
        10.3 * load - 2.4 * past(12.0) - 1.1 * past(20.0) + 30.0 * (load / 0.3).tanh()
    };
    for seed in 0..6 {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut bench = Bench { torque_n_m: Some(Vec::new()), ..Bench::default() };
        let levels: Vec<f64> =
            (0..60).map(|_| 30.0 * random.choice([-1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0]).unwrap()).collect();
        let (mut psi, mut before, mut way) = (0.0_f64, 0.0, 1.0_f64);
        for k in 0..20_000 {
            let (leg, row) = (k / 2500, (k % 2500) as f64);
            let pace = 0.32 * (row / 40.0).min((2300.0 - row) / 40.0).clamp(0.0, 1.0);
            psi += if leg % 2 == 0 { pace } else { -pace };
            let (at, since) = (k / 350, (k % 350) as f64);
            let [from, to] = [levels[at], levels[at + 1]];
            let load = from + (to - from) * ((since - 320.0) / 30.0).max(0.0);
            // Friction slips after two arc-seconds.
            let moved = psi / RATIO / ARCSEC + spring(load);
            way = (way + 0.5 * (moved - before)).clamp(-1.0, 1.0);
            before = moved;
            let error = spring(load - 0.6 * way) + 20.0 * (2.0 * psi).sin() + 0.5 * normal(&mut random);
            bench.time_s.push(0.02 * k as f64 + 400.0 * (k / 5000) as f64);
            bench.generator_rad.push(psi);
            bench.output_rad.push(psi / RATIO + error * ARCSEC);
            bench.torque_n_m.as_mut().unwrap().push(load + 0.05 * normal(&mut random));
        }
        assert_eq!(faults_by_ratio(&bench).unwrap(), [], "seed {seed}");
    }
}

/// Back and forth at six paces: angles read two milliseconds apart lie off by another amount on each way.
#[test]
fn a_delay_of_the_rows_is_no_lost_index() {
    for seed in 0..4 {
        let log = |late_s: f64| {
            let mut random = fastrand::Rng::with_seed(seed);
            let (mut bench, mut psi, mut pace) = (Bench { torque_n_m: Some(Vec::new()), ..Bench::default() }, 0.0, 0.0);
            let paces: Vec<f64> = [1.0, -1.0].repeat(3).iter().map(|way| way * (5.0 + 9.0 * random.f64())).collect();
            for k in 0..9000 {
                pace += (paces[k / 1500] - pace) / 8.0;
                psi += 0.02 * pace;
                let torque: f64 = 20.0 * (k as f64 / 300.0 + seed as f64).sin();
                let drive = 9.0 * torque + 20.0 * (torque.signum() + (2.0 * psi).sin()) + 1.5 * normal(&mut random);
                bench.time_s.push(0.02 * k as f64);
                bench.generator_rad.push(psi);
                bench.output_rad.push((psi - late_s * pace) / RATIO + drive * ARCSEC);
                bench.torque_n_m.as_mut().unwrap().push(torque);
            }
            bench.csv()
        };
        let prior = Prior::of_ratio(RATIO, GeneratorKind::Cam);
        let image = calibrate(&[read(log(0.0).as_bytes()).unwrap()], &prior).unwrap().table.image;
        let table = Table::check(&image).unwrap();
        let rows = replay::read("m.csv", log(0.002), &ColumnMap::default(), &table, 20.0, true).unwrap();
        assert!(rows.faults.is_empty(), "seed {seed}: {:?}", rows.faults);
    }
}

#[test]
fn teeth_that_slide_twice_are_no_lost_index() {
    let pitch = std::f64::consts::TAU / 190.0;
    let slide = |rows: usize| pitch * (1.0 - (-(rows as f64) / 8.0).exp());
    let text = changed(|b| {
        for k in 0..b.rows() {
            b.output_rad[k] -= slide(k.saturating_sub(1500)) + slide(k.saturating_sub(2500));
        }
    });
    let read = read(&text).unwrap();
    assert_eq!(names(&read), []);
    let left = read.sessions[0].error_rad[3900] - read.sessions[0].error_rad[100];
    assert!((left + 2.0 * pitch).abs() < 100.0 * ARCSEC, "both are still there");
}

#[test]
fn teeth_that_slip_between_two_recordings_are_no_other_zero() {
    let pitch = std::f64::consts::TAU / 190.0;
    let text = changed(|b| {
        for k in 0..b.rows() {
            b.time_s[k] += 2.0 * (k / 400) as f64;
            b.output_rad[k] -= if k >= 1600 { 2.0 * pitch } else { 0.0 };
        }
    });
    let read = read(&text).unwrap();
    assert_eq!(names(&read), []);
    let left = read.sessions[9].error_rad[200] - read.sessions[0].error_rad[200];
    assert!((left + 2.0 * pitch).abs() < 100.0 * ARCSEC, "the slip is still there: {left}");
}

#[test]
fn a_generator_that_turns_half_way_round_between_rows_is_counted_by_the_output() {
    let bench = Bench::plain(4000, 1.0, 5);
    let mut fast = bench.clone();
    // Every 70th row: 3.5 rad forward, 3.06 back.
    for values in [&mut fast.time_s, &mut fast.generator_rad, &mut fast.output_rad] {
        *values = values.iter().copied().step_by(70).collect();
    }
    (fast.torque_n_m, fast.temperature_c) = (None, None);
    let due = fast.generator_rad.clone();
    fast.generator_rad.iter_mut().for_each(|a| *a = a.rem_euclid(std::f64::consts::TAU));
    let read = read(fast.csv().as_bytes()).unwrap();
    assert!(read.notes.iter().any(|note| note.contains("counted by the output")), "{:?}", read.notes);
    for (found, due) in read.sessions[0].generator_rad.iter().zip(&due) {
        assert!((found - due).abs() < 1e-6, "{found} {due}");
    }
}

#[test]
fn sessions_of_one_row_and_of_many_are_kept_apart() {
    let text = changed(|b| {
        shifted(&mut b.time_s[1000..], 60.0);
        shifted(&mut b.time_s[1001..], 60.0);
        // Ten periods are no gap, eleven are.
        shifted(&mut b.time_s[2000..], 0.089);
        shifted(&mut b.time_s[3000..], 0.095);
        shifted(&mut b.generator_rad[3000..], 0.5);
        shifted(&mut b.output_rad[3000..], 0.5 / RATIO);
    });
    let read = read(&text).unwrap();
    let lengths: Vec<usize> = read.sessions.iter().map(|session| session.len()).collect();
    assert_eq!(lengths, [1000, 1, 1999, 1000]);
    assert_eq!(read.sessions[2].line[0], 1003);
}

#[test]
fn columns_are_mapped_and_wrong_mappings_say_so() {
    let map = ColumnMap::parse("generator=turns:turn,error=e:arcmin,time=t:ms,temperature=T:K").unwrap();
    let mut text = "T,e,turns,t\n".to_owned();
    let mut random = fastrand::Rng::with_seed(1);
    for k in 0..500 {
        text.push_str(&format!(
            "{},{},{},{}\n",
            293.15,
            0.5 * (0.1 * f64::from(k)).sin() + 0.01 * normal(&mut random),
            f64::from(k) * 0.01,
            k * 5
        ));
    }
    let read = parse("m.csv", text.as_bytes(), &map, &gear()).unwrap();
    let session = &read.sessions[0];
    assert_eq!(read.faults, []);
    assert!((session.generator_rad[100] - std::f64::consts::TAU).abs() < 1e-12);
    assert!((session.time_s.as_ref().unwrap()[100] - 0.5).abs() < 1e-12);
    assert!((session.temperature_c.as_ref().unwrap()[0] - 20.0).abs() < 1e-9);
    assert!(session.error_rad.iter().all(|e| e.abs() < 35.0 * ARCSEC));
    let missing = ColumnMap::parse("generator=psi:deg,error=e").unwrap();
    let error = parse("m.csv", text.as_bytes(), &missing, &gear()).unwrap_err().to_string();
    assert!(error.contains("column psi is missing, which --columns gives for generator"), "{error}");
    let wrong = ColumnMap::parse("generator=turns:turn,error=e:turn").unwrap();
    let error = parse("m.csv", text.as_bytes(), &wrong, &gear()).unwrap_err().to_string();
    assert!(error.contains("e: found errors of") && error.contains("ten degrees"), "{error}");
    let error = parse("m.csv", text.as_bytes(), &map, &Gear::of_ratio(0.0)).unwrap_err().to_string();
    assert!(error.contains("ratio: found 0"), "{error}");
}
