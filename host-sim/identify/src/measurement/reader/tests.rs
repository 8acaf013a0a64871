//! Files as other people's loggers, robots, scopes and spreadsheets write them: each is read right by the mapping that
//! `look` proposes, or ends in one clear error that `look` and the reader of measurements share.
//!
//! The bench is one of 600 rows: a motor that turns 7.5 turns forth and back, a joint behind a ratio of 100, a load.

use std::fmt::Write as _;

use crate::look::{Looked, look, text};
use crate::measurement::{ColumnMap, Gear, Recording, parse, raw};

/// Ratio of the made-up joint. *Guess*: a round one; any would do.
const RATIO: f64 = 100.0;
/// Rows of the made-up log. *Guess*: at [`STEP_S`] they take the motor 7.5 turns forth and back.
const ROWS: usize = 600;
/// Time from row to row, s. *Guess*: an ordinary one; any would do.
const STEP_S: f64 = 0.05;
/// Arcseconds in a degree, by definition.
const ARCSEC_PER_DEG: f64 = 3600.0;

/// The motor's angle at a time, deg.
fn motor(time_s: f64) -> f64 {
    let half = 0.5 * ROWS as f64 * STEP_S;
    180.0 * (half - (time_s - half).abs())
}

/// The error of the joint, deg.
fn error(time_s: f64) -> f64 {
    (25.0 * (motor(time_s) / RATIO).to_radians().sin() + 6.0 * (2.0 * motor(time_s)).to_radians().sin())
        / ARCSEC_PER_DEG
        + torque(time_s) / 3e4_f64.to_radians() * 1e-3
}

fn joint(time_s: f64) -> f64 {
    motor(time_s) / RATIO + error(time_s)
}

fn torque(time_s: f64) -> f64 {
    5.0 * (0.4 * time_s).sin()
}

/// A row: time, motor, joint, torque.
fn plain(k: usize) -> Vec<String> {
    let t = STEP_S * k as f64;
    vec![format!("{t:.3}"), format!("{:.5}", motor(t)), format!("{:.8}", joint(t)), format!("{:.4}", torque(t))]
}

fn with(place: usize, of: impl Fn(usize, &str) -> String) -> impl Fn(usize) -> Vec<String> {
    move |k| {
        let mut fields = plain(k);
        fields[place] = of(k, &fields[place]);
        fields
    }
}

/// The bytes of a [`file`].
fn log(above: &str, separator: &str, fields: impl Fn(usize) -> Vec<String>) -> Vec<u8> {
    file(above, separator, fields).into_bytes()
}

/// A file: what stands above, and rows.
fn file(above: &str, separator: &str, fields: impl Fn(usize) -> Vec<String>) -> String {
    (0..ROWS).fold(above.to_owned(), |text, k| text + &fields(k).join(separator) + "\n")
}

const NAMES: &str = "time_s,motor_deg,joint_deg,torque_Nm\n";
const TIMED: &str = "Time,Motor (deg),Joint (deg),Torque (Nm)\n";

fn csv() -> String {
    file(NAMES, ",", plain)
}

fn decimal_commas(k: usize) -> Vec<String> {
    plain(k).iter().map(|field| field.replace('.', ",")).collect()
}

/// The digits of a number in groups of three.
fn grouped(text: &str, group: &str, decimal: &str) -> String {
    let (sign, digits) = text.strip_prefix('-').map_or(("", text), |rest| ("-", rest));
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let mut out = String::new();
    for (k, digit) in whole.chars().enumerate() {
        if k > 0 && (whole.len() - k) % 3 == 0 {
            out += group;
        }
        out.push(digit);
    }
    format!("{sign}{out}{decimal}{fraction}")
}

/// The clock of the wall some seconds after an instant of the day.
fn clock(from_s: f64, k: usize) -> String {
    let s = from_s + STEP_S * k as f64;
    format!("{:02}:{:02}:{:06.3}", (s / 3600.0) as u32 % 24, (s / 60.0) as u32 % 60, s % 60.0)
}

fn half_day(from_s: f64, k: usize) -> String {
    let s = from_s + STEP_S * k as f64;
    let hour = (s / 3600.0) as u32 % 24;
    format!(
        "{:02}:{:02}:{:06.3} {}",
        (hour + 11) % 12 + 1,
        (s / 60.0) as u32 % 60,
        s % 60.0,
        if hour < 12 { "AM" } else { "PM" }
    )
}

/// What a file must end in.
enum Ends {
    /// Read by the mapping proposed: at least this number of rows, and a note or a fault that says this.
    Read(usize, &'static str),
    /// Nothing is proposed, and a note says this; the reader refuses the file with the same words.
    Blocked(&'static str),
    /// Neither looks at it, with these words.
    Refused(&'static str),
}
use Ends::{Blocked, Read, Refused};

fn cases() -> Vec<(&'static str, Vec<u8>, Ends)> {
    let latin = |text: &str| -> Vec<u8> { text.chars().map(|c| u8::try_from(u32::from(c)).unwrap_or(b'?')).collect() };
    let wide = |text: &str, mark: bool, little: bool| -> Vec<u8> {
        let units = mark.then_some(0xFEFF).into_iter().chain(text.encode_utf16());
        units.flat_map(|unit| if little { unit.to_le_bytes() } else { unit.to_be_bytes() }).collect()
    };
    let lines = |text: String, change: &dyn Fn(&mut Vec<String>)| -> Vec<u8> {
        let mut all: Vec<String> = text.lines().map(str::to_owned).collect();
        change(&mut all);
        all.join("\n").into_bytes()
    };
    // The file whose rows have a column changed.
    let column = |place: usize, of: fn(usize, &str) -> String| log(NAMES, ",", with(place, of));
    // Time in whole seconds and in parts of a second.
    let parted = |unit: &str, parts: u64| {
        log(&format!("time_s,time_{unit},motor_deg,joint_deg,torque_Nm\n"), ",", |k| {
            let time = parts / 20 * k as u64;
            [vec![(1_700_000_000 + time / parts).to_string(), (time % parts).to_string()], plain(k)[1..].to_vec()]
                .concat()
        })
    };
    let german = "Zeit;Motorwinkel;Abtriebswinkel;Moment\ns;deg;deg;N.m\n";
    let scope = |own: f64| {
        let above = "Name\tScope Project\nFile\tC:\\bench.svdx\nEndTime\t133000000300000000\t25 May 2025\n\n\
             Name\tMotor.ActPos\tName\tJoint.ActPos\tName\tJoint.Torque\n\
             SymbolComment\t\tSymbolComment\t\tSymbolComment\t\n\
             Data-Type\tREAL64\tData-Type\tREAL64\tData-Type\tREAL64\n\
             SampleTime[ms]\t50\tSampleTime[ms]\t50\tSampleTime[ms]\t50\n\
             VariableSize\t8\tVariableSize\t8\tVariableSize\t8\n\
             Offset\t0\tOffset\t0\tOffset\t0\n\n";
        file(above, "\t", move |k| {
            let t = STEP_S * k as f64;
            let at = |shift: f64| format!("{:.1}", 1e3 * (t + shift));
            vec![
                at(0.0),
                format!("{:.5}", motor(t)),
                at(own),
                format!("{:.8}", joint(t + own)),
                at(2.0 * own),
                format!("{:.4}", torque(t + 2.0 * own)),
            ]
        })
    };
    let own_stamps = {
        let mut text = NAMES.to_owned();
        for k in 0..ROWS {
            let t = STEP_S * k as f64;
            let _ = writeln!(text, "{t:.3},{:.5},,", motor(t));
            if k % 10 == 0 {
                let _ = writeln!(text, "{:.3},,,{:.4}", t + 0.003, torque(t + 0.003));
            }
            let _ = writeln!(text, "{:.3},,{:.8},", t + 0.017, joint(t + 0.017));
        }
        text
    };
    let one_value = |separator: &str, names: [&str; 3]| {
        let mut text = String::new();
        for k in 0..ROWS {
            let t = STEP_S * k as f64;
            for (name, after, value) in [
                (names[0], 0.0, motor(t)),
                (names[1], 0.0005, joint(t + 0.0005)),
                (names[2], 0.0007, torque(t + 0.0007)),
            ] {
                let s = 52_000.0 + t + after;
                let stamp = format!(
                    "2025-05-04{separator}{:02}:{:02}:{:09.6}",
                    (s / 3600.0) as u32,
                    (s / 60.0) as u32 % 60,
                    s % 60.0
                );
                let _ = writeln!(text, "{name}{separator}{stamp}{separator}{value:.8}");
            }
        }
        text
    };
    let reordered = |line: usize, header: &str| {
        lines(csv(), &|all| {
            for row in &mut all[line..] {
                let fields: Vec<&str> = row.split(',').collect();
                *row = [fields[0], fields[3], fields[1], fields[2]].join(",");
            }
            all.insert(line, header.to_owned());
        })
    };
    let holes = |from: usize, zeros: usize| {
        let mut bytes = csv().into_bytes();
        bytes.splice(from..from, vec![0; zeros]);
        bytes
    };
    vec![
        // Encodings and line ends.
        ("UTF-16, little-endian", wide(&csv(), true, true), Read(ROWS, "UTF-16")),
        ("UTF-16, big-endian", wide(&csv(), true, false), Read(ROWS, "UTF-16")),
        ("UTF-16 without a mark", wide(&csv(), false, false), Refused("binary")),
        (
            "Latin-1",
            latin(&file("Zeit [s];Motor [°];Abtrieb [°];Moment [Nm]\n", ";", plain)),
            Read(ROWS, "Windows-1252"),
        ),
        ("CR alone", csv().replace('\n', "\r").into(), Read(ROWS, "CR alone")),
        ("CR alone, tabs", csv().replace(',', "\t").replace('\n', "\r").into(), Read(ROWS, "CR alone")),
        // Headers.
        (
            "names, units, objects",
            log(&format!("{german};axis-3;axis-3;axis-3\n"), ";", decimal_commas),
            Read(ROWS, "neither names nor units"),
        ),
        (
            "names, objects, units",
            log("Zeit;Motor;Abtrieb;Moment\nMP 1;MP 2;MP 3;MP 4\ns;deg;deg;Nm\n", ";", decimal_commas),
            Read(ROWS, ""),
        ),
        (
            "objects above names and units",
            log("Bench 4;left;left;left\nZeit;Motor;Abtrieb;Moment\ns;deg;deg;Nm\n", ";", decimal_commas),
            Read(ROWS, ""),
        ),
        (
            "settings below the names",
            log(&format!("{NAMES}Scale,1,1,1\nOffset,0,0,0\n"), ",", plain),
            Read(ROWS, "Scale"),
        ),
        ("a scope, one clock", scope(0.0).into(), Refused("a time column of its own")),
        ("a scope, a clock for each channel", scope(0.011).into(), Refused("pd.merge_asof")),
        (
            "a time before each channel",
            log("time1,motor_deg,time2,joint_deg\n", ",", |k| {
                let t = STEP_S * k as f64 + 0.02;
                [plain(k)[..2].to_vec(), vec![format!("{t:.3}"), format!("{:.8}", joint(t))]].concat()
            }),
            Refused("a time column of its own"),
        ),
        // Lines that are no rows.
        (
            "a summary",
            (csv() + "Min,0.0,0.0,-5.0\nMax,2700,27,5\nMean,1350,13.5,0.5\n").into(),
            Read(ROWS, "lines 602 to 604"),
        ),
        ("a last word", (csv() + "END OF FILE\n").into(), Read(ROWS, "END OF FILE")),
        (
            "a summary after blank lines",
            (file("Zeit;Motor;Abtrieb;Moment\ns;deg;deg;Nm\n", ";", decimal_commas)
                + "\n\nMittelwert;1350,0;13,5;0,5\n")
                .into(),
            Read(ROWS, "Mittelwert"),
        ),
        (
            "columns in another order midway",
            reordered(301, "time_s,torque_Nm,motor_deg,joint_deg"),
            Refused("second line of names"),
        ),
        (
            "a preamble and the names once more",
            lines(csv(), &|all| {
                all.splice(301..301, ["Logger started anew".to_owned(), NAMES.trim().to_owned()]);
            }),
            Read(ROWS, "repeated once"),
        ),
        ("other names midway", reordered(301, "hour,left,right,up"), Refused("second line of names")),
        // Times.
        ("AM and PM", log(TIMED, ",", with(0, |k, _| format!("05/04/2025 {}", half_day(43_190.0, k)))), Read(ROWS, "")),
        (
            "AM and PM, no date",
            log("Time;Motor (deg);Joint (deg);Torque (Nm)\n", ";", with(0, |k, _| half_day(43_190.0, k))),
            Read(ROWS, ""),
        ),
        (
            "date, clock and half of the day apart",
            log("Date Time Half Motor Joint Torque\n", " ", |k| {
                let half = half_day(43_190.0, k);
                [vec!["05/04/2025".to_owned(), half], plain(k)[1..].to_vec()].concat()
            }),
            Read(ROWS, "pd.to_datetime"),
        ),
        (
            "date and clock apart",
            log("Date,Time,Motor (deg),Joint (deg),Torque (Nm)\n", ",", |k| {
                [vec!["2025-05-04".to_owned(), clock(50_000.0, k)], plain(k)[1..].to_vec()].concat()
            }),
            Read(ROWS, "pd.to_datetime"),
        ),
        (
            "across midnight with a date apart",
            log("Date,Time,Motor (deg),Joint (deg),Torque (Nm)\n", ",", |k| {
                let date = if STEP_S * (k as f64) < 10.0 { "31.12.2025" } else { "01.01.2026" };
                [vec![date.to_owned(), clock(86_390.0, k)], plain(k)[1..].to_vec()].concat()
            }),
            Read(ROWS, "pd.to_datetime"),
        ),
        (
            "names of months",
            log(TIMED, ",", with(0, |k, _| format!("25-May-2025 {}", clock(50_000.0, k)))),
            Read(ROWS, ""),
        ),
        (
            "days of a spreadsheet",
            log(
                NAMES.replace("time_s", "Time").as_str(),
                ",",
                with(0, |k, _| format!("{:.10}", 45_781.5 + STEP_S * k as f64 / 86_400.0)),
            ),
            Read(ROWS, ""),
        ),
        (
            "days of a spreadsheet, decimal commas",
            log("Zeit;Motor;Abtrieb;Moment\n", ";", |k| {
                let mut fields = decimal_commas(k);
                fields[0] = format!("{:.10}", 45_781.5 + STEP_S * k as f64 / 86_400.0).replace('.', ",");
                fields
            }),
            Read(ROWS, ""),
        ),
        ("seconds and nanoseconds", parted("ns", 1_000_000_000), Blocked("df[SECONDS] + df[PARTS] / 1e9")),
        ("seconds and microseconds", parted("us", 1_000_000), Blocked("df[SECONDS] + df[PARTS] / 1e6")),
        ("newest first", lines(csv(), &|all| all[1..].reverse()), Read(ROWS, "turned round")),
        (
            "newest first, dates",
            lines(file(TIMED, ",", with(0, |k, _| format!("2025-05-04 {}", clock(5e4, k)))), &|all| all[1..].reverse()),
            Read(ROWS, "turned round"),
        ),
        (
            "unsorted",
            lines(csv(), &|all| all[1..].chunks_mut(3).for_each(|some| some.rotate_left(1))),
            Read(ROWS, "sorted"),
        ),
        (
            "each row twice",
            lines(csv(), &|all| *all = all.iter().flat_map(|line| [line.clone(), line.clone()]).skip(1).collect()),
            Read(ROWS, "repeat the row before"),
        ),
        // Numbers.
        (
            "thousands in quotes",
            column(1, |_, text| format!("\"{}\"", grouped(text, ",", "."))),
            Blocked("found \"1,008.00000\" (376 more in this column)"),
        ),
        (
            "thousands behind apostrophes",
            column(1, |_, text| grouped(text, "'", ".")),
            Blocked("found \"1'008.00000\""),
        ),
        (
            "decimal commas, comma and blank between",
            log("time_s, motor_deg, joint_deg, torque_Nm\n", ", ", decimal_commas),
            Refused("with a point, not with a comma"),
        ),
        ("decimal commas between commas", log(NAMES, ",", decimal_commas), Refused("with a point, not with a comma")),
        (
            "Fortran",
            log("  time_s  motor_deg joint_deg torque_Nm\n", "  ", |k| {
                plain(k).iter().map(|f| format!("{f}D+00")).collect()
            }),
            Refused("no rows of numbers"),
        ),
        ("a true minus", column(3, |_, text| text.replace('-', "\u{2212}")), Blocked("found \"\u{2212}")),
        (
            "units in cells",
            log(NAMES, ",", |k| {
                plain(k).iter().zip(["s", "deg", "deg", "N.m"]).map(|(f, unit)| format!("{f} {unit}")).collect()
            }),
            Refused("found \"0."),
        ),
        (
            "beyond the range",
            column(3, |k, text| match k % 100 {
                5 => "OVER".into(),
                8 => "+9.9E+37".into(),
                _ => text.into(),
            }),
            Read(ROWS, "beyond the range"),
        ),
        (
            "beyond the range, an angle",
            column(2, |k, text| if k == 77 { "-OL".into() } else { text.into() }),
            Read(ROWS - 1, "beyond the range"),
        ),
        ("a word", column(2, |k, text| if k == 77 { "high".into() } else { text.into() }), Blocked("found \"high\"")),
        (
            "words for the torque",
            column(3, |k, text| if k % 50 == 7 { "err".into() } else { text.into() }),
            Blocked("found \"err\" (11 more in this column)"),
        ),
        // Names that are not those of the columns.
        (
            "one name less than columns, as R writes names of rows",
            log("\"time_s\" \"motor_deg\" \"joint_deg\" \"torque_Nm\"\n", " ", |k| {
                [vec![format!("\"{}\"", k + 1)], plain(k)].concat()
            }),
            Refused("5 fields, but the header has 4; each column has a name"),
        ),
        (
            "decimal commas between commas, zeros at the end cut",
            log(NAMES, ",", |k| {
                let cut = |f: &String| f.trim_end_matches('0').trim_end_matches('.').replace('.', ",");
                plain(k).iter().map(cut).collect()
            }),
            Refused("with a point, not with a comma"),
        ),
        (
            "a quote that nothing closes",
            csv().replacen("\n3", "\n\"3", 1).into(),
            Refused("a quote that nothing closes"),
        ),
        (
            "a last column that begins later",
            log(NAMES, ",", |k| plain(k)[..if k < 50 { 3 } else { 4 }].to_vec()),
            Blocked("3 fields, but torque_Nm is field 4"),
        ),
        // Zero bytes.
        ("a hole of zeros", holes(9000, 512), Read(ROWS - 1, "zero bytes stand in 1 line")),
        ("zeros at the end", [csv().as_bytes(), &[0; 5000]].concat(), Read(ROWS, "zero bytes stand in 1 line")),
        // Rows.
        ("each channel at its own instants", own_stamps.into(), Blocked("never recorded in one row")),
        (
            "one value a line",
            one_value(" ", ["BENCH:MOTOR-PosAct", "BENCH:JOINT-PosAct", "BENCH:JOINT-Torque"]).into(),
            Refused("value of one channel"),
        ),
        (
            "one value a line, semicolons",
            one_value(";", ["motor_pos", "joint_pos", "joint_torque"]).into(),
            Refused("value of one channel"),
        ),
    ]
}

fn looked_at(bytes: &[u8]) -> Result<Looked, String> {
    let file = raw::parse("log.txt", bytes).map_err(|error| error.to_string())?;
    look(&[file]).map_err(|error| error.to_string())
}

fn read(bytes: &[u8], columns: &str) -> Result<Recording, String> {
    let map = ColumnMap::parse(columns).map_err(|error| error.to_string())?;
    parse("log.txt", bytes, &map, &Gear::of_ratio(RATIO)).map_err(|error| error.to_string())
}

/// Whether what was read is what the bench did, its first row among it or not.
fn right(recording: &Recording, rows: usize) -> Result<(), String> {
    right_from(recording, rows, 0.0).or_else(|what| right_from(recording, rows, STEP_S).map_err(|_| what))
}

/// The same where the first row left is of this time, s.
fn right_from(recording: &Recording, rows: usize, begins_s: f64) -> Result<(), String> {
    let found: usize = recording.sessions.iter().map(|session| session.generator_rad.len()).sum();
    if found < rows || recording.sessions.len() != 1 {
        return Err(format!("{} sessions, {found} rows: {:?}", recording.sessions.len(), recording.faults));
    }
    let session = &recording.sessions[0];
    let time = session.time_s.as_ref().ok_or("no time")?;
    let half = 0.5 * ROWS as f64 * STEP_S;
    let offset = |values: &[f64], due: &dyn Fn(f64) -> f64| values[10] - due(begins_s + time[10] - time[0]);
    let (turn, zero) = (
        offset(&session.generator_rad, &|t| motor(t).to_radians()),
        offset(&session.error_rad, &|t| error(t).to_radians()),
    );
    for (row, t) in time.iter().map(|t| begins_s + t - time[0]).enumerate() {
        // A curve through values about the reversal does not hold its corner.
        if (t - half).abs() < 0.3 {
            continue;
        }
        let motor_off = session.generator_rad[row] - motor(t).to_radians() - turn;
        let error_off = session.error_rad[row] - error(t).to_radians() - zero;
        if motor_off.abs() > 1e-3 || error_off.abs() > 1e-5 {
            return Err(format!(
                "row {row}, {t} s: motor off by {motor_off}, error by {error_off} rad; {:?}",
                recording.faults
            ));
        }
    }
    Ok(())
}

#[test]
fn files_of_strangers_are_read_right_or_refused_in_the_same_words() {
    let cases = cases();
    let mut wrong = Vec::new();
    for (name, bytes, ends) in &cases {
        let outcome = match ends {
            Read(rows, said) => looked_at(bytes).and_then(|looked| {
                let columns = looked.columns_option.clone().ok_or_else(|| text(&looked))?;
                // Where no unit is written, radians are proposed; whoever knows the bench says degrees.
                let columns = columns.replace(":rad", ":deg");
                let recording = read(bytes, &columns).map_err(|what| format!("by {columns}: {what}"))?;
                right(&recording, *rows).map_err(|what| format!("by {columns}: {what}\n{}", text(&looked)))?;
                let faults = recording.faults.iter().map(|fault| fault.what.clone()).collect();
                let notes = [looked.notes, recording.notes, faults].concat().join("\n");
                if notes.contains(said) { Ok(()) } else { Err(format!("without {said:?}: {notes}")) }
            }),
            Blocked(said) => looked_at(bytes).and_then(|looked| {
                let notes = looked.notes.join("\n");
                let refused =
                    read(bytes, "time=time_s:s,generator=motor_deg:deg,output=joint_deg:deg,torque=torque_Nm:N.m");
                match refused {
                    Err(what) if what.contains(said) && notes.contains(said) && looked.columns_option.is_none() => {
                        Ok(())
                    }
                    other => Err(format!("{:?}, {notes}, {:?}", other.err(), looked.columns_option)),
                }
            }),
            Refused(said) => match (looked_at(bytes), read(bytes, "generator=motor_deg:deg,output=joint_deg:deg")) {
                (Err(a), Err(b)) if a.contains(said) && b.contains(said) => Ok(()),
                (a, b) => Err(format!("{:?}, {:?}", a.err(), b.err())),
            },
        };
        if let Err(what) = outcome {
            wrong.push(format!("{name}: {what}"));
        }
    }
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), cases.len(), wrong.join("\n\n"));
}

#[test]
fn a_word_that_is_no_unit_among_units_is_refused_as_that_of_its_column() {
    let file = b"Zeit;Motor;Abtrieb;Moment\ns;Grad;Grad;Nm\n0,0;1,5;0,1;0,5\n0,1;2,5;0,2;0,5\n";
    let refused = read(file, "generator=Motor,output=Abtrieb").unwrap_err();
    assert!(refused.contains("column Motor: found the unit \"Grad\""), "{refused}");
}
