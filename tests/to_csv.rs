//! Files of other programs through `examples/to_csv.py` and the one reader: what was written there is read here.
//!
//! Parquet, MATLAB, TDMS and MCAP are written by the Python packages that bench programs write them with, in an
//! environment of their own under `target/`; where these packages cannot be had, the test says so and ends.
//! Wrong if this fails: a series under another name, a row lost, a clock in another unit.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use flexspline_identify::measurement::{ColumnMap, Gear, Recording, parse};
use flexspline_tests::command::Desk;

const RATIO: f64 = 101.0;
const ROWS: usize = 400;
const PACKAGES: [&str; 4] = ["pyarrow", "scipy", "nptdms", "mcap"];

/// Writes the same rows in all four forms, and what must not be converted.
const WRITER: &str = r#"
import json
import numpy as np, pyarrow as pa, pyarrow.parquet, scipy.io, nptdms
from mcap.writer import Writer

rows, ratio = 400, 101.0
k = np.arange(rows)
time = 0.02 * k
motor = 0.3 * k
joint = motor / ratio + 1e-4 * np.sin(2 * motor)
load = 12.0 * np.sin(k / 40.0)
series = {"time_s": time, "motor": motor, "joint": joint, "load": load}
pa.parquet.write_table(pa.table(series), "log.parquet")
scipy.io.savemat("log.mat", {"bench": np.stack([time, motor, joint, load], axis=1), "name": "unit 7"})
with nptdms.TdmsWriter("log.tdms") as writer:
    step = {"wf_increment": 0.02, "wf_start_offset": 0.0}
    writer.write_segment([nptdms.ChannelObject("bench", name, series[name], properties=step)
                          for name in ("motor", "joint", "load")])
with open("log.mcap", "wb") as file:
    writer = Writer(file)
    writer.start()
    schema = writer.register_schema(name="state", encoding="jsonschema", data=b"{}")
    channel = writer.register_channel(topic="/axis", message_encoding="json", schema_id=schema)
    for i in range(rows):
        at = int(round(1e9 * (1000.0 + time[i])))
        data = json.dumps({"motor": motor[i], "joint": joint[i], "load": load[i]}).encode()
        writer.add_message(channel_id=channel, log_time=at, publish_time=at, data=data)
    writer.finish()
scipy.io.savemat("uneven.mat", {"a": np.arange(5.0), "b": np.arange(6.0)})
"#;

/// The interpreter of an environment with the packages, or why there is none.
fn python() -> Result<PathBuf, String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/to_csv_python");
    let interpreter = folder.join("bin/python");
    let has_all = || {
        let imports = "import pyarrow, scipy.io, nptdms, mcap.writer";
        Command::new(&interpreter).args(["-c", imports]).output().is_ok_and(|output| output.status.success())
    };
    let ran = |command: &mut Command| match command.output() {
        Ok(output) if output.status.success() => Ok(()),
        Ok(output) => Err(String::from_utf8_lossy(&output.stderr).trim().to_owned()),
        Err(error) => Err(error.to_string()),
    };
    if !has_all() {
        ran(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
        ran(Command::new(&interpreter).args(["-m", "pip", "install", "--quiet"]).args(PACKAGES))?;
    }
    if has_all() { Ok(interpreter) } else { Err(format!("{} cannot be imported", PACKAGES.join(", "))) }
}

fn converted(python: &Path, desk: &Desk, arguments: &[&str]) -> Output {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/to_csv.py");
    Command::new(python).arg(script).args(arguments).current_dir(desk.path("")).output().unwrap()
}

/// Rows as they were written: angles in rad, error by its law, torque, times 0.02 s apart.
fn right(recording: &Recording) {
    assert_eq!((recording.sessions.len(), recording.sessions[0].len()), (1, ROWS), "{:?}", recording.faults);
    let session = &recording.sessions[0];
    for k in 0..ROWS {
        let motor = 0.3 * k as f64;
        let off = session.generator_rad[k] - session.generator_rad[0] - motor;
        let error = session.error_rad[k] - session.error_rad[0] - 1e-4 * (2.0 * motor).sin();
        let torque = session.torque_n_m.as_ref().unwrap()[k] - 12.0 * (k as f64 / 40.0).sin();
        let time = session.time_s.as_ref().unwrap();
        let late = time[k] - time[0] - 0.02 * k as f64;
        assert!(off.abs() < 1e-9 && error.abs() < 1e-9 && torque.abs() < 1e-9 && late.abs() < 1e-6, "row {k}");
    }
}

#[test]
#[ignore = "long: tests/run slow"]
fn files_of_other_programs_are_read_through_the_converter() {
    let python = match python() {
        Ok(python) => python,
        Err(why) => {
            println!("left out, the Python packages {} cannot be had: {why}", PACKAGES.join(", "));
            return;
        }
    };
    let desk = Desk::new();
    desk.write("write.py", WRITER);
    let wrote = Command::new(&python).arg("write.py").current_dir(desk.path("")).output().unwrap();
    assert!(wrote.status.success(), "{}", String::from_utf8_lossy(&wrote.stderr));
    for (file, columns) in [
        ("log.parquet", "time=time_s:s,generator=motor:rad,output=joint:rad,torque=load:N.m"),
        ("log.mat", "time=bench_1:s,generator=bench_2:rad,output=bench_3:rad,torque=bench_4:N.m"),
        ("log.tdms", "time=time_s:s,generator=bench.motor:rad,output=bench.joint:rad,torque=bench.load:N.m"),
        ("log.mcap", "time=time_s:s,generator=axis.motor:rad,output=axis.joint:rad,torque=axis.load:N.m"),
    ] {
        let output = converted(&python, &desk, &[file]);
        assert!(output.status.success(), "{file}: {}", String::from_utf8_lossy(&output.stderr));
        let map = ColumnMap::parse(columns).unwrap();
        let recording = parse(file, &output.stdout[..], &map, &Gear::of_ratio(RATIO));
        right(&recording.unwrap_or_else(|error| panic!("{error}")));
        // As it stands the reader names the way.
        if !file.ends_with("mcap") {
            let bytes = std::fs::read(desk.path(file)).unwrap();
            let refused = parse(file, &bytes[..], &ColumnMap::default(), &Gear::of_ratio(RATIO)).unwrap_err();
            assert!(refused.to_string().contains("CSV"), "{refused}");
        }
    }
    // Two series picked, in that order; what cannot be one table is refused in one line.
    let output = converted(&python, &desk, &["log.parquet", "--only", "joint,motor"]);
    assert!(output.stdout.starts_with(b"joint,motor\n"));
    for (arguments, said) in [
        (&["uneven.mat"][..], "a 5, b 6"),
        (&["log.parquet", "--only", "torque"], "there are: time_s, motor, joint, load"),
        (&["write.py"], "found .py, allowed: .parquet, .mat, .tdms, .mcap"),
    ] {
        let output = converted(&python, &desk, arguments);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && stderr.contains(said) && stderr.lines().count() == 1, "{stderr}");
    }
}
