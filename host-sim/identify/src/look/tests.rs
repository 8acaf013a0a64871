//! Odd files, as loggers, robots and spreadsheets write them: each is read right by the mapping proposed (or one that a
//! user who knows the bench would give), or ends in one clear error.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use super::{Looked, Role, TimeKind, look, text};
use crate::measurement::raw;
use crate::measurement::{ColumnMap, Gear, Recording, parse};

const RATIO: f64 = 101.0;
const ROWS: usize = 1500;
const ARCSEC: f64 = TAU / 1_296_000.0;

/// What the bench did.
struct Truth {
    time_s: Vec<f64>,
    generator_rad: Vec<f64>,
    output_rad: Vec<f64>,
    torque_n_m: Vec<f64>,
    temperature_c: Vec<f64>,
}

/// Two thirds of the rows forward, the rest back, under a load that swings.
fn truth() -> Truth {
    let mut random = fastrand::Rng::with_seed(7);
    let mut t = Truth {
        time_s: Vec::new(),
        generator_rad: Vec::new(),
        output_rad: Vec::new(),
        torque_n_m: Vec::new(),
        temperature_c: Vec::new(),
    };
    let mut psi = 0.4;
    for k in 0..ROWS {
        let x = k as f64;
        psi += if 3 * k < 2 * ROWS { 0.62 } else { -0.55 };
        let torque = 25.0 * (x / 97.0).sin();
        let error = 300.0 * (psi / RATIO).sin() + 20.0 * (2.0 * psi).sin() + torque / 3e4 / ARCSEC;
        t.time_s.push(0.004 * x + 2e-4 * (random.f64() - 0.5));
        t.generator_rad.push(psi);
        t.output_rad.push(psi / RATIO + error * ARCSEC);
        t.torque_n_m.push(torque);
        t.temperature_c.push(21.0 + 3.0 * (x / 400.0).sin());
    }
    t
}

/// A file: a first line, and a row for each instant, with fields by their texts.
fn file(header: &str, separator: &str, fields: impl Fn(&Truth, usize) -> Vec<String>) -> String {
    let truth = truth();
    let mut text = header.to_owned();
    for k in 0..ROWS {
        let _ = writeln!(text, "{}", fields(&truth, k).join(separator));
    }
    text
}

/// The bytes of a [`file`].
fn log(header: &str, separator: &str, fields: impl Fn(&Truth, usize) -> Vec<String>) -> Vec<u8> {
    file(header, separator, fields).into_bytes()
}

/// Time, generator and output in radians, torque.
fn plain(t: &Truth, k: usize) -> Vec<String> {
    vec![
        format!("{:.5}", t.time_s[k]),
        format!("{:.7}", t.generator_rad[k]),
        format!("{:.9}", t.output_rad[k]),
        format!("{:.4}", t.torque_n_m[k]),
    ]
}

fn degrees(t: &Truth, k: usize) -> Vec<String> {
    let mut fields = plain(t, k);
    fields[1] = format!("{:.5}", t.generator_rad[k].to_degrees());
    fields[2] = format!("{:.7}", t.output_rad[k].to_degrees());
    fields
}

fn gon(t: &Truth, k: usize) -> Vec<String> {
    let mut fields = plain(t, k);
    fields[1] = format!("{:.5}", t.generator_rad[k] / TAU * 400.0);
    fields[2] = format!("{:.7}", t.output_rad[k] / TAU * 400.0);
    fields[3] = format!("{:.1}", 1000.0 * t.torque_n_m[k]);
    fields
}

fn counts(angle: f64, of_a_turn: f64) -> String {
    format!("{:.0}", angle / TAU * of_a_turn)
}

fn encoder_counts(t: &Truth, k: usize) -> Vec<String> {
    let mut fields = plain(t, k);
    fields[1] = counts(t.generator_rad[k] + 100.0, 16_777_216.0);
    fields[2] = counts(t.output_rad[k] + 2.5, 16_777_216.0);
    fields
}

/// The motor in counts, 4096 a turn, as a counter shows them.
fn counter(shown: impl Fn(f64) -> f64) -> String {
    file("time,motor,load,torque\n", ",", |t, k| {
        let count = (t.generator_rad[k] / TAU * 4096.0).round();
        with(plain(t, k), 1, format!("{:.0}", shown(count)))
    })
}

fn commas(fields: Vec<String>) -> Vec<String> {
    fields.into_iter().map(|field| field.replace('.', ",")).collect()
}

fn with(mut fields: Vec<String>, place: usize, field: String) -> Vec<String> {
    fields[place] = field;
    fields
}

const COUNTER: &str = "time=time:s,generator=motor:count/4096,output=load:rad,torque=torque:N.m";

/// What a file must end in.
enum Ends {
    /// Read by the mapping that `look` proposes.
    Proposed,
    /// Read by this mapping.
    By(&'static str),
    /// As [`Ends::By`], without a torque.
    NoTorque(&'static str),
    /// Refused by this mapping (or the names of this project), with an error that says all this.
    Refused(&'static str, &'static [&'static str]),
    /// Not even looked at.
    NoTable(&'static [&'static str]),
}
use Ends::{By, NoTable, NoTorque, Proposed, Refused};

fn cases() -> Vec<(&'static str, Vec<u8>, Ends)> {
    let gear = |text: String| text.into_bytes();
    let day = |t: &Truth, k: usize, from: f64| {
        let s = (1e4 * (t.time_s[k] + from)).floor() / 1e4;
        format!("{:02.0}:{:02.0}:{:07.4}", (s / 3600.0).floor() % 24.0, (s / 60.0).floor() % 60.0, s % 60.0)
    };
    vec![
        ("this project's", log("time_s,generator_rad,output_rad,torque_n_m\n", ",", plain), Proposed),
        ("gon and N.mm in brackets", log("time_s,motor [gon],load [gon],torque [Nmm]\n", ",", gon), Proposed),
        ("gon and N.mm below", log("time,motor,load,torque\ns,gon,gon,N.mm\n", ",", gon), Proposed),
        (
            "an unknown unit below",
            log("time,motor,load,torque\ns,rad,rad,rpm\n", ",", plain),
            Refused(
                "generator=motor,output=load,torque=torque",
                &["column torque: found the unit \"rpm\", allowed: N.m"],
            ),
        ),
        ("semicolons", log("time;motor;load;torque\n", ";", plain), Proposed),
        ("decimal commas", log("Zeit;Motor;Abtrieb;Drehmoment\n", ";", |t, k| commas(plain(t, k))), Proposed),
        ("tabs", log("time\tmotor\tload\ttorque\n", "\t", plain), Proposed),
        ("tabs, decimal commas", log("t\tmotor\tload\tNm\n", "\t", |t, k| commas(plain(t, k))), Proposed),
        ("bars", log("time|motor|load|torque\n", "|", plain), Proposed),
        ("blanks", log("  time    motor  load torque\n", "    ", plain), Proposed),
        (
            "quotes",
            log("\"time\";\"motor\";\"load\";\"torque\"\n", ";", |t, k| {
                commas(plain(t, k)).into_iter().map(|f| format!("\"{f}\"")).collect()
            }),
            Proposed,
        ),
        (
            "a preamble and units",
            log("Logger 7\nBench;4\n\nZeit;Motor;Abtrieb;Moment\n[s];[°];[°];[Nm]\n", ";", |t, k| {
                commas(degrees(t, k))
            }),
            Proposed,
        ),
        ("units in brackets", log("t [s],motor [deg],link [deg],torque [Nm]\n", ",", degrees), Proposed),
        ("a byte order mark", gear(format!("\u{feff}{}", file("time;motor;load;torque\n", ";", plain))), Proposed),
        ("CRLF", gear(file("time;motor;load;torque\n", ";", plain).replace('\n', "\r\n")), Proposed),
        ("names as a comment", log("# bench 4\n# time motor load torque\n", " ", plain), Proposed),
        ("no names", log("", ",", plain), By("time=#1:s,generator=#2:rad,output=#3:rad,torque=#4:N.m")),
        ("no names, blanks", log("", " ", plain), NoTorque("generator=2,output=3")),
        (
            "counts",
            log("time,motor_inc,load_inc,torque\n", ",", encoder_counts),
            By("time=time:s,generator=motor_inc:count/2^24,output=load_inc:count/16777216,torque=torque:Nm"),
        ),
        (
            "counts next to an angle",
            log("time,motor_inc,load_inc,torque,joint_angle\n", ",", |t, k| {
                let mut fields = encoder_counts(t, k);
                fields.push(format!("{:.8}", t.output_rad[k]));
                fields
            }),
            Proposed,
        ),
        (
            "a counter of 16 bits",
            gear(counter(|count| (count as i64).rem_euclid(65_536) as f64 - 32_768.0)),
            By("time=time:s,generator=motor:count/4096,output=load:rad,torque=torque:N.m"),
        ),
        ("a counter of 16 bits, without a word", gear(counter(|count| count.rem_euclid(65_536.0))), By(COUNTER)),
        ("a counter that begins anew at 32767", gear(counter(|count| count.rem_euclid(32_767.0))), By(COUNTER)),
        ("a counter that begins anew at 32766", gear(counter(|count| count.rem_euclid(32_766.0))), By(COUNTER)),
        (
            "a counter set to zero at 32767 and at -32767",
            gear(counter(|count| (count - 200_000.0) % 32_767.0)),
            By(COUNTER),
        ),
        ("a counter of 10000", gear(counter(|count| count.rem_euclid(10_000.0))), By(COUNTER)),
        (
            "angles within one turn",
            log("time,motor_deg,load_deg,torque\n", ",", |t, k| {
                let wrapped = |angle: f64| format!("{:.7}", angle.to_degrees().rem_euclid(360.0));
                let fields = with(plain(t, k), 1, wrapped(t.generator_rad[k]));
                with(fields, 2, wrapped(t.output_rad[k] + 1.0))
            }),
            Proposed,
        ),
        (
            "torque the other way round",
            log("time,motor,load,torque\n", ",", |t, k| with(plain(t, k), 3, format!("{:.4}", -t.torque_n_m[k]))),
            Proposed,
        ),
        (
            "a current",
            log("time,motor,load,current_mA\n", ",", |t, k| {
                with(plain(t, k), 3, format!("{:.2}", 1000.0 * t.torque_n_m[k] / 3.5))
            }),
            By("time=time:s,generator=motor:rad,output=load:rad,torque=current_mA:mA*0.0035"),
        ),
        (
            "newton centimetres, milliseconds, milliradians",
            log("ms,motor,load,torque\n", ",", |t, k| {
                vec![
                    format!("{:.2}", 1e3 * t.time_s[k]),
                    format!("{:.5}", 1e3 * t.generator_rad[k]),
                    format!("{:.6}", 1e3 * t.output_rad[k]),
                    format!("{:.2}", 100.0 * t.torque_n_m[k]),
                ]
            }),
            By("time=ms:ms,generator=motor:mrad,output=load:mrad,torque=torque:N.cm"),
        ),
        (
            "dates",
            log("Timestamp;motor;load;torque\n", ";", |t, k| {
                with(plain(t, k), 0, format!("2026-11-22 {}", day(t, k, 50_000.0)))
            }),
            Proposed,
        ),
        (
            "time of day across midnight",
            log("time,motor,load,torque\n", ",", |t, k| with(plain(t, k), 0, day(t, k, 86_397.0))),
            Proposed,
        ),
        (
            "milliseconds since 1970",
            log("timestamp,motor,load,torque\n", ",", |t, k| {
                with(plain(t, k), 0, format!("{:.1}", 1e3 * (1.795e9 + t.time_s[k])))
            }),
            Proposed,
        ),
        (
            "a slower torque",
            log("time,motor,load,torque\n", ",", |t, k| {
                let fields = plain(t, k);
                if k % 10 == 0 { fields } else { with(fields, 3, String::new()) }
            }),
            Proposed,
        ),
        (
            "an error instead of the output",
            log("t_s,wave_gen_turns,error_arcsec\n", ",", |t, k| {
                let error = (t.output_rad[k] - t.generator_rad[k] / RATIO) / ARCSEC;
                vec![format!("{:.5}", t.time_s[k]), format!("{:.7}", t.generator_rad[k] / TAU), format!("{error:.4}")]
            }),
            NoTorque("time=t_s:s,generator=wave_gen_turns:turn,error=error_arcsec:arcsec"),
        ),
        (
            "words and empty columns",
            log("time;motor;load;torque;state;\n", ";", |t, k| {
                let mut fields = plain(t, k);
                fields.extend(["run".to_owned(), String::new()]);
                fields
            }),
            Proposed,
        ),
        (
            "names that the mapping cannot hold",
            log("t,motor: enc,load: enc,torque\n", ",", degrees),
            By("time=#1:s,generator=#2:deg,output=#3:deg,torque=#4:N.m"),
        ),
        (
            "counts with a gain and an offset",
            log("time,motor,load,torque\n", ",", |t, k| {
                let fields = with(plain(t, k), 2, counts(t.output_rad[k] + 2.5, 16_777_216.0));
                with(fields, 3, format!("{:.5}", (t.torque_n_m[k] + 4.0) / 20.0))
            }),
            By("time=time:s,generator=motor:rad,output=load:count/2^24-0.25,torque=torque:V*20-4"),
        ),
        // Damaged, or not said enough.
        ("a header alone", b"time_s,generator_rad,output_rad\n".to_vec(), NoTable(&["no rows of numbers"])),
        (
            "a header alone, read",
            b"time_s,generator_rad,output_rad\n".to_vec(),
            Refused("", &["log.txt:1: no rows after the header; at least 16"]),
        ),
        (
            "a guide log",
            b"PHD2 version 2.6.13 [Linux], Log version 2.5. Log enabled at 2026-11-01 20:00:00\n".to_vec(),
            NoTable(&["guide log", "flexspline calibrate FILE --ratio N"]),
        ),
        (
            "a guide log without frames",
            b"PHD2 version 2.6.13 [Linux], Log version 2.5. Log enabled at 2026-11-01 20:00:00\n".to_vec(),
            Refused("", &["log.txt:1: 0 guided frames"]),
        ),
        (
            "a current without a torque constant",
            log("time,motor,load,torque\n", ",", plain),
            Refused("generator=motor:rad,output=load:rad,torque=torque:mA", &["--torque-constant"]),
        ),
        (
            "counts without a number",
            log("time,motor,load,torque\n", ",", plain),
            Refused("generator=motor:count,output=load:rad", &["counts make a turn"]),
        ),
        ("nothing", Vec::new(), NoTable(&["log.txt:1: ", "no rows of numbers"])),
        ("prose", b"Measured on Tuesday.\nAll went well.\n".to_vec(), NoTable(&["no rows of numbers"])),
        ("a workbook", b"PK\x03\x04\x14\0".to_vec(), NoTable(&["workbook", "save it as CSV"])),
        ("binary", (0..=255_u8).cycle().take(5000).collect(), NoTable(&["binary"])),
        (
            "ten rows",
            gear(file("a;b;c;d\n", ";", plain).lines().take(11).collect::<Vec<_>>().join("\n")),
            NoTable(&["10 rows", "16"]),
        ),
        (
            "names of others",
            log("t;m;l;x\n", ";", plain),
            Refused("", &["column generator_rad is missing", "flexspline look"]),
        ),
        ("no names, no mapping", log("", ";", plain), Refused("", &["first line has numbers", "generator=#1"])),
        (
            "a separator that changes",
            gear({
                let text = file("time;motor;load;torque\n", ";", plain);
                let (a, b) = text.split_at(text.find("\n5.8").unwrap() + 1);
                a.to_owned() + &b.replace(';', ",")
            }),
            Refused("generator=motor:rad,output=load:rad", &["log.txt:14", "1 fields, but motor is field 2"]),
        ),
        (
            "a word for a number",
            log("time;motor;load;torque\n", ";", |t, k| {
                if k == 700 { with(plain(t, k), 2, "ERR".to_owned()) } else { plain(t, k) }
            }),
            Refused("generator=motor:rad,output=load:rad", &["log.txt:702: load: found \"ERR\""]),
        ),
        (
            "another gear",
            log("time;motor;load;torque\n", ";", |t, k| with(plain(t, k), 2, format!("{:.7}", 1.9 * t.output_rad[k]))),
            Refused("generator=motor:rad,output=load:rad", &["ratio", "--columns"]),
        ),
        (
            "a column number that is not there",
            log("", ";", plain),
            Refused("generator=#2:rad,output=#9:rad", &["column #9 is missing", "the 4 columns"]),
        ),
    ]
}

fn looked_at(bytes: &[u8]) -> Result<Looked, String> {
    let raw = raw::parse("log.txt", bytes).map_err(|error| error.to_string())?;
    look(&[raw]).map_err(|error| error.to_string())
}

fn read(bytes: &[u8], columns: &str) -> Result<Recording, String> {
    let map = ColumnMap::of_options(columns, None, None).map_err(|error| error.to_string())?;
    parse("log.txt", bytes, &map, &Gear::of_ratio(RATIO)).map_err(|error| error.to_string())
}

/// Largest difference from the truth, each freed of its mean.
fn off(read: &[f64], truth: &[f64]) -> f64 {
    assert_eq!(read.len(), truth.len());
    let n = read.len() as f64;
    let mean = read.iter().zip(truth).map(|(a, b)| a - b).sum::<f64>() / n;
    read.iter().zip(truth).map(|(a, b)| (a - b - mean).abs()).fold(0.0, f64::max)
}

/// Whether what was read is what the bench did.
fn right(recording: &Recording, with_torque: bool) -> Result<(), String> {
    let truth = truth();
    if recording.sessions.len() != 1 || recording.sessions[0].len() != ROWS {
        let rows: Vec<usize> = recording.sessions.iter().map(super::super::measurement::Session::len).collect();
        return Err(format!("sessions of {rows:?} rows; {:?}", recording.faults));
    }
    let session = &recording.sessions[0];
    let generator = off(&session.generator_rad, &truth.generator_rad);
    let output = off(&session.output_rad(RATIO), &truth.output_rad);
    // 4096 counts resolve 1.5e-3 rad.
    if generator > 1.6e-3 || output > 2e-5 {
        return Err(format!("generator off by {generator:e}, output by {output:e} rad"));
    }
    if let Some(time) = &session.time_s
        && off(time, &truth.time_s) > 3e-4
    {
        return Err(format!("time off by {} s", off(time, &truth.time_s)));
    }
    match &session.torque_n_m {
        Some(torque) if with_torque => {
            // A straight line between values ten rows apart, held behind the last of them.
            let off = torque.iter().zip(&truth.torque_n_m).take(ROWS - 10);
            let off = off.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            if off > 0.1 { Err(format!("torque off by {off} N·m")) } else { Ok(()) }
        }
        None if !with_torque => Ok(()),
        found => Err(format!("torque {}", if found.is_some() { "read" } else { "missing" })),
    }
}

#[test]
fn a_cell_that_is_no_number_does_not_hide_a_last_line_that_breaks_off() {
    let high = |t: &Truth, k| if k == 20 { with(plain(t, k), 3, "high".to_owned()) } else { plain(t, k) };
    let text = file("time_s,generator_rad,output_rad,torque_n_m\n", ",", high) + "6.000,1.0";
    let looked = looked_at(text.as_bytes()).unwrap();
    for said in ["found \"high\"", "the last line breaks off: it is left out"] {
        assert!(looked.notes.iter().any(|note| note.contains(said)), "{said}: {:?}", looked.notes);
    }
    assert_eq!(looked.columns_option, None);
}

#[test]
fn odd_files_are_read_right_or_end_in_one_clear_error() {
    let cases = cases();
    assert!(cases.len() >= 40, "{}", cases.len());
    let mut wrong = Vec::new();
    let mut messages = std::collections::BTreeSet::new();
    let mut refused = 0;
    for (name, bytes, ends) in &cases {
        let outcome = match ends {
            Proposed => looked_at(bytes).and_then(|looked| {
                let columns = looked.columns_option.clone().ok_or_else(|| text(&looked))?;
                read(bytes, &columns)
                    .and_then(|recording| right(&recording, true))
                    .map_err(|what| format!("by {columns}: {what}\n{}", text(&looked)))
            }),
            By(map) => looked_at(bytes).and_then(|_| read(bytes, map)).and_then(|recording| right(&recording, true)),
            NoTorque(map) => {
                looked_at(bytes).and_then(|_| read(bytes, map)).and_then(|recording| right(&recording, false))
            }
            Refused(_, said) | NoTable(said) => {
                refused += 1;
                let outcome = match ends {
                    Refused(map, _) => read(bytes, map).map(|_| ()),
                    _ => looked_at(bytes).map(|_| ()),
                };
                match outcome {
                    Ok(()) => Err("was read".to_owned()),
                    Err(message) => {
                        messages.insert(message.clone());
                        let missing = said.iter().find(|said| !message.contains(**said));
                        missing.map_or(Ok(()), |missing| Err(format!("said {message:?}, without {missing:?}")))
                    }
                }
            }
        };
        if let Err(what) = outcome {
            wrong.push(format!("{name}: {what}"));
        }
    }
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), cases.len(), wrong.join("\n"));
    // "nothing", "prose" and a header alone say the same of different lines.
    assert!(messages.len() + 2 >= refused, "two mistakes got the same message: {messages:#?}");
}

/// Damaged files of which the rest is read: each row that is left is that of its line.
#[test]
fn what_is_left_of_a_damaged_file_is_right() {
    const MAP: &str = "time=time:s,generator=motor:rad,output=load:rad,torque=torque:N.m";
    let truth = truth();
    let whole = file("time;motor;load;torque\n", ";", plain);
    let broken: Vec<&str> = whole.lines().collect();
    let holes = |from: usize, to: usize, text: &'static str| {
        file("time;motor;load;torque\n", ";", move |t, k| {
            if (from..to).contains(&k) { with(plain(t, k), 2, text.to_owned()) } else { plain(t, k) }
        })
    };
    for (name, text, fewest, fault) in [
        ("cut off in its last line", broken[..1401].join("\n") + "\n5.6;8", 1400, "missing_samples"),
        ("a run of NaN", holes(600, 640, "NaN"), ROWS - 40, "missing_samples"),
        ("a run of nothing", holes(600, 640, ""), ROWS - 40, "missing_samples"),
        ("names once more", [&broken[..700], &broken[..1], &broken[700..]].concat().join("\n"), ROWS, ""),
    ] {
        let recording = read(text.as_bytes(), MAP).unwrap_or_else(|error| panic!("{name}: {error}"));
        let rows: usize = recording.sessions.iter().map(crate::measurement::Session::len).sum();
        assert!(rows >= fewest && rows <= ROWS, "{name}: {rows} rows");
        let reported = recording.faults.iter().any(|found| found.name.as_str() == fault);
        assert!(reported || fault.is_empty(), "{name}: {:?}", recording.faults);
        for session in &recording.sessions {
            let output = session.output_rad(RATIO);
            for k in 0..session.len() {
                let line = session.line[k] as usize;
                let of = line - 2 - usize::from(name.starts_with("names") && line > 700);
                // A straight line through what was not recorded is a filled row.
                let filled = (600..640).contains(&of) && name.starts_with("a run");
                let off = (session.generator_rad[k] - truth.generator_rad[of]).abs();
                assert!(
                    off < 1e-6 && (filled || (output[k] - truth.output_rad[of]).abs() < 1e-8),
                    "{name}: line {line}"
                );
            }
        }
    }
    // Time that is counted where the file has none.
    let text = file("motor;load\n", ";", |t, k| plain(t, k)[1..3].to_vec());
    let map = ColumnMap::of_options("generator=motor:rad,output=load:rad", Some(250.0), None).unwrap();
    let counted = parse("log.txt", text.as_bytes(), &map, &Gear::of_ratio(RATIO)).unwrap();
    let time = counted.sessions[0].time_s.as_ref().unwrap();
    assert!((time[ROWS - 1] - time[0] - 0.004 * (ROWS - 1) as f64).abs() < 1e-9);
    assert!(counted.notes.iter().any(|note| note.contains("250 rows in a second")), "{:?}", counted.notes);
    // A torque constant as an option of its own.
    let text = file("time,motor,load,current\n", ",", |t, k| {
        with(plain(t, k), 3, format!("{:.2}", 1e3 * t.torque_n_m[k] / 3.5))
    });
    let map = "time=time:s,generator=motor:rad,output=load:rad,torque=current:mA";
    let map = ColumnMap::of_options(map, None, Some(3.5)).unwrap();
    let with_torque = parse("log.txt", text.as_bytes(), &map, &Gear::of_ratio(RATIO)).unwrap();
    right(&with_torque, true).unwrap();
}

#[test]
fn what_is_found_is_said() {
    let bytes = file("time,motor_inc,load_inc,torque,joint_angle,temp\n", ",", |t, k| {
        let mut fields = encoder_counts(t, k);
        fields[3] = format!("{:.4}", -t.torque_n_m[k]);
        fields.push(format!("{:.8}", t.output_rad[k]));
        fields.push(format!("{:.2}", t.temperature_c[k]));
        fields
    });
    let looked = looked_at(bytes.as_bytes()).unwrap();
    let by_role = |role: Role| looked.columns.iter().find(|column| column.used && column.role == role).unwrap();
    assert_eq!(by_role(Role::Generator).counts_per_turn, Some(16_777_216.0));
    assert_eq!(by_role(Role::Output).name, "load_inc");
    assert_eq!(by_role(Role::Torque).unit.as_deref(), Some("-N.m"));
    assert_eq!(looked.ratio_proposed, Some(101.0));
    assert!((looked.ratio_found.unwrap() - 101.0).abs() < 0.5);
    assert_eq!(looked.time, TimeKind::Measured);
    let coverage = looked.coverage.as_ref().unwrap();
    assert!(coverage.directions[0] > 0.6 && coverage.directions[1] > 0.3 && coverage.temperature_c.is_some());
    assert!((coverage.generator_turns - 0.62 * 1000.0 / TAU).abs() < 0.2, "{}", coverage.generator_turns);
    assert!(text(&looked).contains("ratio: ") && text(&looked).contains("% backward"));
    // Time that is counted; files of one form are sessions.
    let counted =
        file("time,motor,load,torque\n", ",", |t, k| with(plain(t, k), 0, format!("{:.3}", 0.004 * k as f64)));
    let raw = raw::parse("a.csv", counted.as_bytes()).unwrap();
    let two = look(&[raw.clone(), raw::RawFile { file: "b.csv".to_owned(), ..raw.clone() }]).unwrap();
    assert_eq!((two.sessions, two.time, two.rows), (2, TimeKind::Counted, 2 * ROWS));
    let other = raw::parse("c.csv", file("time,motor,load,x\n", ",", plain).as_bytes()).unwrap();
    assert!(look(&[raw, other]).unwrap_err().to_string().contains("logs of one form"));
}

/// A file of columns that are called so, each a function of the bench and the row.
type Columns<'a> = [(&'a str, &'a dyn Fn(&Truth, usize) -> String)];

fn columns_of(columns: &Columns<'_>, names: bool) -> String {
    let header = columns.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(",") + "\n";
    file(if names { &header } else { "" }, ",", |t, k| columns.iter().map(|(_, of)| of(t, k)).collect())
}

/// Names of generator, output and torque that are proposed.
fn proposed(looked: &Looked) -> [Option<&str>; 3] {
    [Role::Generator, Role::Output, Role::Torque].map(|role| {
        looked.columns.iter().find(|column| column.used && column.role == role).map(|column| column.name.as_str())
    })
}

/// A motor torque that a robot computes from that of the joint makes a straighter line than two encoders; it is a
/// torque by its name and its unit, and without either it swings about zero where a motor turns on.
#[test]
fn names_and_units_go_before_the_straightest_line() {
    let time = |t: &Truth, k: usize| format!("{:.4}", t.time_s[k]);
    let motor = |t: &Truth, k: usize| format!("{:.7}", t.generator_rad[k]);
    let output = |t: &Truth, k: usize| format!("{:.9}", t.output_rad[k]);
    let wanted = |t: &Truth, k: usize| format!("{:.9}", t.generator_rad[k] / RATIO);
    let load = |t: &Truth, k: usize| format!("{:.4}", t.torque_n_m[k]);
    let of_motor = |t: &Truth, k: usize| format!("{:.6}", t.torque_n_m[k] / 100.0);
    let (motor_deg, output_deg) = (
        |t: &Truth, k: usize| format!("{:.5}", t.generator_rad[k].to_degrees()),
        |t: &Truth, k: usize| format!("{:.7}", t.output_rad[k].to_degrees()),
    );
    let cases: [(&str, &Columns<'_>, bool, [Option<&str>; 3]); 5] = [
        (
            "an array of positions and efforts",
            &[
                ("%time", &time),
                ("field.position0", &motor),
                ("field.position1", &output),
                ("field.effort0", &of_motor),
                ("field.effort1", &load),
            ],
            true,
            [Some("field.position0"), Some("field.position1"), Some("field.effort1")],
        ),
        (
            "no names",
            &[("", &time), ("", &of_motor), ("", &load), ("", &motor), ("", &output)],
            false,
            [Some("#4"), Some("#5"), None],
        ),
        (
            "axes of a controller",
            &[
                ("Axis1.Torque", &of_motor),
                ("Axis2.Torque", &load),
                ("Axis2.SetPos", &wanted),
                ("Axis1.ActPos", &motor),
                ("Axis2.ActPos", &output),
                ("Time", &time),
            ],
            true,
            [Some("Axis1.ActPos"), Some("Axis2.ActPos"), Some("Axis2.Torque")],
        ),
        (
            "units alone",
            &[
                ("Kanal A [s]", &time),
                ("Kanal B [Nm]", &of_motor),
                ("Kanal C [Nm]", &load),
                ("Kanal D [deg]", &motor_deg),
                ("Kanal E [deg]", &output_deg),
            ],
            true,
            [Some("Kanal D [deg]"), Some("Kanal E [deg]"), Some("Kanal C [Nm]")],
        ),
        (
            "a motor that is driven by steps, of which the command alone is known",
            &[("t", &time), ("motor_setpoint", &motor), ("joint_pos", &output), ("effort", &load)],
            true,
            [Some("motor_setpoint"), Some("joint_pos"), Some("effort")],
        ),
    ];
    for (name, columns, names, due) in cases {
        let looked = looked_at(columns_of(columns, names).as_bytes()).unwrap();
        assert_eq!(proposed(&looked), due, "{name}: {}", text(&looked));
        assert_eq!(looked.ratio_proposed, Some(101.0), "{name}: {}", text(&looked));
        if !names {
            // Both are printed.
            let note = looked.notes.iter().find(|note| note.contains("may be generator and output as well")).unwrap();
            assert!(note.starts_with("columns #3 and #2 may be"), "{note}");
            assert!(note.contains(", --columns generator=#3:rad,output=#2:rad; "), "{note}");
            let sure = |place: usize| looked.columns[place].confidence;
            assert!(sure(3) <= 0.5 && sure(4) <= 0.5, "a guess with a rival is not sure");
        }
    }
}

/// A robot logs all its joints: what is proposed is of one joint, the others are named.
#[test]
fn the_columns_of_one_joint_are_proposed_together() {
    // Each joint follows the same way with its own travel, as a planner makes them; the torque of the first is the
    // straightest of all lines.
    let reach = |joint: usize| [1.0, 0.7, 0.4][joint - 1];
    for motor in ["encoder_motorinc", "motor_position"] {
        let mut header = "Timestamp".to_owned();
        for joint in 1..=3 {
            let _ = write!(
                header,
                ",target_joint_torque_{joint},joint_torque_current_{joint},{motor}_{joint},encoder_loadinc_{joint},\
                 target_joint_angles_{joint}"
            );
        }
        let text_of = file(&(header + "\n"), ",", |t, k| {
            let mut fields = vec![format!("{:.4}", t.time_s[k])];
            for joint in 1..=3 {
                let (psi, way) = (reach(joint) * t.generator_rad[k], reach(joint) * t.output_rad[k]);
                let own = way + 40.0 * ARCSEC * (37.0 * way + joint as f64).sin();
                fields.push(format!("{:.5}", psi / 50.0));
                fields.push(format!("{:.4}", t.torque_n_m[k] * joint as f64));
                fields.push(counts(psi, 16_777_216.0));
                fields.push(counts(own, 16_777_216.0));
                fields.push(format!("{:.7}", psi / RATIO));
            }
            fields
        });
        let looked = looked_at(text_of.as_bytes()).unwrap();
        let [generator, output, torque] = proposed(&looked).map(|name| name.unwrap_or_default().to_owned());
        assert!(generator.starts_with(motor) && output.starts_with("encoder_loadinc"), "{}", text(&looked));
        let joint = |name: &str| name.rsplit_once('_').unwrap().1.to_owned();
        assert!(joint(&generator) == joint(&output) && joint(&output) == joint(&torque), "{}", text(&looked));
        assert!(torque.starts_with("joint_torque_current"), "what was measured: {}", text(&looked));
        assert!((looked.ratio_found.unwrap() - 101.0).abs() < 0.5, "{}", text(&looked));
        // What is missing is said, not that nothing is known.
        let angles = format!("generator={generator}:count/COUNTS,output={output}:count/COUNTS");
        let due = format!("--columns time=Timestamp:s,torque={torque}:N.m,{angles}");
        let asked = looked.notes.iter().any(|note| note.ends_with(&due));
        assert!(looked.columns_option.is_none() && asked, "{}", text(&looked));
        // The other two joints, and no pair of two joints.
        let rivals = looked.notes.iter().filter_map(|note| note.split_once(" may be generator and output as well"));
        let rivals: Vec<(&str, &str)> = rivals.filter_map(|(columns, _)| columns.split_once(" and ")).collect();
        assert_eq!(rivals.len(), 2, "{:?}", looked.notes);
        assert!(rivals.iter().all(|(generator, output)| joint(generator) == joint(output)), "{rivals:?}");
    }
}

/// Counts of a turn that the file does not say are asked; a size is no proof.
#[test]
fn counts_that_the_file_does_not_say_are_asked() {
    let looked = looked_at(counter(|count| count.rem_euclid(32_767.0)).as_bytes()).unwrap();
    assert_eq!((looked.columns[1].counts_per_turn, looked.ratio_proposed, &looked.columns_option), (None, None, &None));
    assert!(
        looked.columns[1].why.iter().any(|why| why.contains("begins anew after 32767 (")),
        "{:?}",
        looked.columns[1]
    );
    assert!(looked.columns[1].confidence < 0.7, "{:?}", looked.columns[1]);
    let due = "--columns time=time:s,generator=motor:count/COUNTS,output=load:rad,torque=torque:N.m";
    assert!(looked.notes.iter().any(|note| note.ends_with(due)), "{}", text(&looked));
    // The counts of a register are not those of the other encoder where the ratio is none.
    let registers = file("time,motor,load,torque\n", ",", |t, k| {
        let motor = (t.generator_rad[k] / TAU * 16_384.0).round().rem_euclid(16_384.0);
        with(with(plain(t, k), 1, format!("{motor:.0}")), 2, counts(t.output_rad[k] + 2.5, 1_048_576.0))
    });
    let looked = looked_at(registers.as_bytes()).unwrap();
    let due = "--columns time=time:s,generator=motor:count/16384,output=load:count/COUNTS,torque=torque:N.m";
    assert!(looked.notes.iter().any(|note| note.ends_with(due)), "{}", text(&looked));
    // So are those of an output whose name says that it is an angle, and no more.
    let angles = file("time,motor_counts,axis_counts,torque\n", ",", |t, k| {
        let [motor, axis] =
            [(t.generator_rad[k], 16_384.0), (t.output_rad[k], 16_777_216.0)].map(|(a, n)| counts(a, n));
        with(with(plain(t, k), 1, motor), 2, axis)
    });
    let looked = looked_at(angles.as_bytes()).unwrap();
    let due = "generator=motor_counts:count/COUNTS,torque=torque:N.m,output=axis_counts:count/COUNTS";
    assert!(looked.notes.iter().any(|note| note.ends_with(due)), "{}", text(&looked));
    // So are units that are written and not known, and no size is assumed.
    let looked = looked_at(file("time_s,motor [foo],load [foo],torque [Nmx]\n", ",", plain).as_bytes()).unwrap();
    assert!(looked.columns_option.is_none() && looked.columns[1..].iter().all(|column| column.unit.is_none()));
    let due = "--columns time=time_s:s,generator=motor [foo]:UNIT,output=load [foo]:UNIT,torque=torque [Nmx]:UNIT";
    assert!(looked.notes.iter().any(|note| note.ends_with(due)), "{}", text(&looked));
    let due = "column 4, torque: found the unit \"Nmx\", allowed: N.m, N.cm, N.mm, ";
    assert!(looked.notes.iter().any(|note| note.starts_with(due)), "{}", text(&looked));
}

#[test]
fn a_unit_that_the_rows_contradict_is_asked_with_the_columns_by_their_names() {
    const NAMES: &str = "time_s,generator_rad,output_rad,torque_n_m\n";
    let degrees = file(NAMES, ",", |t, k| with(plain(t, k), 2, format!("{:.7}", t.output_rad[k].to_degrees())));
    let looked = looked_at(degrees.as_bytes()).unwrap();
    assert_eq!(looked.columns_option, None);
    let asked = "--columns generator=generator_rad:rad,output=output_rad:UNIT";
    assert!(looked.notes.iter().any(|note| note.ends_with(asked)), "{:?}", looked.notes);
    // A motor to and fro within minutes, its milliseconds called seconds.
    let mut creeps = NAMES.to_owned();
    for k in 0..ROWS {
        let psi = 100.0 * (k as f64 / 200.0).sin();
        let _ = writeln!(creeps, "{},{psi:.6},{:.8},0", 20 * k, psi / RATIO + 20.0 * ARCSEC * (2.0 * psi).sin());
    }
    let looked = looked_at(creeps.as_bytes()).unwrap();
    assert_eq!(looked.columns_option, None);
    let note = looked.notes.iter().find(|note| note.contains("milliseconds rather than seconds")).unwrap();
    assert!(note.contains("; then --columns time=time_s:ms,generator=generator_rad:rad"), "{note}");
    assert!(!note.contains("time=time_s:s,"), "{note}");
}

#[test]
fn a_line_of_names_begins_a_session_where_no_time_says_when() {
    let parts = |names: &str, from: usize| {
        let rows = file(names, ",", |t, k| plain(t, k)[from..].to_vec());
        let (header, rows) = rows.split_once('\n').unwrap();
        let half = rows.match_indices('\n').nth(ROWS / 2).unwrap().0 + 1;
        format!("{header}\n{}{header}\n{}", &rows[..half], &rows[half..])
    };
    let sessions = |text: String| read(text.as_bytes(), "").unwrap().sessions.len();
    assert_eq!(sessions(parts("generator_rad,output_rad,torque_n_m\n", 1)), 2);
    assert_eq!(sessions(parts("time_s,generator_rad,output_rad,torque_n_m\n", 0)), 1);
}
