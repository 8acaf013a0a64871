//! Geometry to table to core and back: a table made by the command agrees with fresh FEM at points that made none of
//! it, and the same samples through `--from-samples` give the same table.
//!
//! Short form: coarse mesh, one temperature, cam and double disc. Bounds are those of the project: 0.5″ rms, 2″ at
//! most.

use std::fs;

use flexspline::{Direction, GeneratorAngle, Table};
use flexspline_tests::command::{Desk, names};
use flexspline_tests::long;
use serde_json::{Value, json};

const SHORT: &str = "--mesh coarse --temperatures-c 20 --positions 8 --most-nodes 14";

fn json(desk: &Desk, name: &str) -> Value {
    serde_json::from_str(&desk.read(name)).unwrap()
}

#[test]
#[ignore = "long: tests/run slow"]
fn tables_hold_between_their_nodes_and_across_a_reversal() {
    let desk = Desk::new();
    for generator in ["cam", "double-disc"] {
        desk.line(&format!("tables --generator {generator} {SHORT} --out made")).done();
    }
    let expected: Vec<String> = ["cam", "double-disc"]
        .iter()
        .flat_map(|g| ["fxt", "h", "json", "rs", "samples.csv"].map(|e| format!("{g}.{e}")))
        .chain(["report.html".to_owned()])
        .collect();
    assert_eq!(names(&desk.path("made")), expected);

    // The long form has the solver that the tables are not made by; `fast_equals_reference` compares both.
    let solver = if long() { "reference" } else { "fast" };
    let points = "--temperatures 1 --torques 8 --positions 3";
    desk.line(&format!("validate --tables made --mesh coarse --solver {solver} {points} --out made")).done();
    let validation = json(&desk, "made/validation.json");
    assert_eq!(validation["status"], "passed");
    for table in validation["tables"].as_array().unwrap() {
        let [rms, max] = ["rms_arcsec", "max_arcsec"].map(|k| table[k].as_f64().unwrap());
        let points = table["points"].as_array().unwrap().len();
        println!("{}: rms {rms:.3}\", max {max:.3}\" at {points} points", table["generator"]);
        assert!(rms <= 0.5 && max <= 2.0 && points >= 8 * 3 + 10, "{table}");
        // The table earns its place: without it the error is the backlash and the wind-up.
        assert!(table["uncompensated_rms_arcsec"].as_f64().unwrap() > 20.0);
    }

    // What the files say of themselves agrees.
    let image = fs::read(desk.path("made/cam.fxt")).unwrap();
    let table = Table::check(&image).unwrap();
    let id = table.id().to_string();
    assert_eq!(json(&desk, "made/cam.json")["table_id"], id.as_str());
    assert_eq!(&id, &validation["tables"][1]["table_id"].as_str().unwrap().to_owned());
    let bytes: Vec<String> = image.iter().map(|b| format!("0x{b:02x}")).collect();
    for source in ["made/cam.rs", "made/cam.h"] {
        let text = desk.read(source);
        assert!(text.contains(&id), "{source} does not name the table");
        let body = &text[text.find(['[', '{']).unwrap()..];
        let found: Vec<&str> = body.split(|c: char| !c.is_alphanumeric()).filter(|w| w.starts_with("0x")).collect();
        assert_eq!(found, bytes, "{source} holds other bytes than the image");
    }

    // The mean backlash of the cam drive, as the FEM has it.
    let backlash = |psi: f64| {
        let at = |d| f64::from(table.steady_error_rad(GeneratorAngle::from_rad(psi).unwrap(), 0.0, 20.0, d).unwrap());
        (at(Direction::Backward) - at(Direction::Forward)) * 180.0 * 60.0 / std::f64::consts::PI
    };
    let mean = (0..64).map(|k| backlash(0.033_421_2 * f64::from(k) / 64.0)).sum::<f64>() / 64.0;
    println!("cam: mean backlash in the table {mean:.4}'");
    assert!((mean - 0.987).abs() < 0.02, "{mean}");

    // The samples of this FEM through the door for other programs.
    desk.line("tables --generator cam --from-samples made/cam.samples.csv --out again").done();
    let again = fs::read(desk.path("again/cam.fxt")).unwrap();
    let again = Table::check(&again).unwrap();
    for k in 0..200 {
        let psi = GeneratorAngle::from_rad(0.01 * f64::from(k)).unwrap();
        let torque = -190.0 + 1.9 * k as f32;
        for direction in [Direction::Forward, Direction::Backward] {
            let [a, b] = [&table, &again].map(|t| t.steady_error_rad(psi, torque, 20.0, direction).unwrap());
            assert!((a - b).abs() < 5e-9, "at {torque} N·m: {a} and {b}");
        }
    }

    // Measured rows, here simulated ones, replayed: all but the start is explained.
    desk.line("simulate --generator cam --mesh coarse --path pitch --torque-n-m 30 --out run").done();
    desk.line("replay --tables made/cam.fxt run/results.csv --out replayed").done();
    let summary = json(&desk, "replayed/summary.json");
    assert_eq!(summary["torque_counts_from"], "no load");
    let left = summary["max_residual_arcsec"].as_f64().unwrap();
    println!("replay at 30 N·m: largest residual {left:.3}\"");
    assert!(left < 0.5 && summary["mean_residual_arcsec"].as_f64().unwrap().abs() < 1.0, "{summary}");
    assert_eq!(summary["remarks"], json!([]));
}

/// Work is shared out to threads by generator and temperature; what comes out does not know of it.
#[test]
#[ignore = "long: tests/run slow"]
fn tables_do_not_depend_on_the_number_of_threads() {
    let desk = Desk::new();
    // Of half the teeth of HHD-95, in half the time.
    desk.line("new small.toml --teeth 100 --module 0.5").done();
    let line = "tables --drive small.toml --generator cam --mesh coarse --positions 4 --most-nodes 6 --temperatures-c \
                -20,20,60";
    let others = if long() { &["with-2", "with-3"][..] } else { &["with-3"] };
    for threads in ["with-1"].iter().chain(others).map(|folder| &folder[5..]) {
        desk.line(&format!("{line} --threads {threads} --out with-{threads}")).done();
    }
    for file in ["cam.fxt", "cam.samples.csv"] {
        let one = fs::read(desk.path("with-1").join(file)).unwrap();
        for other in others {
            assert_eq!(one, fs::read(desk.path(other).join(file)).unwrap(), "{file}");
        }
    }
}
