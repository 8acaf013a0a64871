//! `report.html`: what the page says is what the other files and the exit code say. How it looks and moves is for
//! `tests/run browser`.

use crate::bench_data::{ARCSEC, Bench};
use flexspline_tests::command::{Desk, names};
use serde_json::Value;

/// The JSON block of a page, as a program takes it out.
fn page(desk: &Desk, name: &str) -> (String, Value) {
    let html = desk.read(name);
    let (_, after) =
        html.split_once(r#"<script type="application/json" id="flexspline-report">"#).expect("a JSON block");
    let json = serde_json::from_str(after.split_once("</script>").unwrap().0).unwrap();
    (html, json)
}

const SHORT: &str = "--mesh coarse --temperatures-c 20 --most-nodes 14";

#[test]
#[ignore = "long: tests/run slow"]
fn the_page_of_tables_agrees_with_their_files() {
    let desk = Desk::new();
    desk.line(&format!("tables --generator cam {SHORT} --out made")).done();
    let (html, json) = page(&desk, "made/report.html");
    let table: Value = serde_json::from_str(&desk.read("made/cam.json")).unwrap();
    assert!(json["status"] == "caution" && json["remarks"][0].as_str().unwrap().contains("5 to 8 times stiffer"));
    assert_eq!(json["results"]["tables"][0]["table_id"], table["table_id"]);
    assert_eq!(json["results"]["tables"][0]["table"], table);
    assert_eq!(json["provenance"]["BLAKE3 of the drive"], table["drive_blake3"]);
    assert_eq!(json["provenance"]["Command"], table["command"]);
    // Fresh FEM of the same mesh, at points between the nodes: the bounds are the project's.
    let miss = json["results"]["tables"][0]["fresh_fem_max_arcsec"].as_f64().unwrap();
    println!("table against fresh FEM: {miss:.3}\"; page: {} kB", html.len() / 1000);
    assert!(miss > 0.0 && miss < 2.0, "{miss}");
    // The drive in motion has the load it says, and its eight frames.
    let motion = &json["animations"]["cam"];
    assert_eq!((motion["torque_n_m"].as_f64(), motion["rows"].as_array().unwrap().len()), (Some(100.0), 8));
    assert!(html.len() < 1_500_000);

    desk.line(&format!("tables --generator cam {SHORT} --no-report --out bare")).done();
    let files = names(&desk.path("bare"));
    assert!(files.len() == 5 && !files.contains(&"report.html".to_owned()), "{files:?}");
    let image = |folder: &str| std::fs::read(desk.path(folder).join("cam.fxt")).unwrap();
    assert_eq!(image("bare"), image("made"));
}

/// One pitch under load: the page has the figures of the summary, and the rows of the run are the drive in motion.
#[test]
#[ignore = "long: tests/run slow"]
fn the_page_of_a_settled_pitch_shows_its_rows_in_motion() {
    let desk = Desk::new();
    let line = "simulate --generator cam --mesh coarse --path pitch --torque-n-m 20 --stress";
    let run = desk.line(&format!("{line} --out made")).done();
    assert!(run.stdout.contains("made/report.html"), "{}", run.stdout);
    let (html, json) = page(&desk, "made/report.html");
    let summary: Value = serde_json::from_str(&desk.read("made/summary.json")).unwrap();
    assert_eq!((&json["status"], json["remarks"].as_array().map(Vec::len)), (&Value::from("caution"), Some(1)));
    assert_eq!(json["results"]["simulate"], summary);
    assert_eq!(json["provenance"]["Command"], summary["command"]);
    assert_eq!(json["provenance"]["BLAKE3 of the drive"], summary["drive_hash"]);
    let wind_up = summary["wind_up_arcsec"].as_f64().unwrap();
    assert!(html.contains(&format!("<strong><data class=\"error\" value=\"{wind_up}\"")), "no headline of {wind_up}");
    // The terminal's figures are in the table, with their units: a stress over three meshes, a torque.
    let stress = summary["stress"][0]["von_mises_mpa"].as_f64().unwrap();
    assert!(html.contains(&format!("Stress, root fillet</th><td>{stress:.1}\u{a0}MPa</td>")), "no {stress} MPa");
    assert!(html.contains("<td>20.00\u{a0}N·m</td>") && html.contains("over three meshes"));
    // The states that are shown are the rows of this run at the eighths of the pitch: every third.
    let motion = &json["animations"]["cam"];
    let column = |name: &str| -> Vec<f64> {
        let text = desk.read("made/results.csv");
        let at = text.lines().next().unwrap().split(',').position(|column| column == name).unwrap();
        let all = text.lines().skip(1).map(|line| line.split(',').nth(at).unwrap().parse().unwrap());
        all.skip(2).step_by(3).collect()
    };
    for name in ["error_arcsec", "generator_rad", "max_von_mises_mpa"] {
        let shown: Vec<f64> =
            motion["rows"].as_array().unwrap().iter().map(|row| row[name].as_f64().unwrap()).collect();
        assert_eq!(shown, column(name), "{name}");
    }
    for figure in ["drive", "ripple", "stress", "sharing", "contacts", "generator-torque"] {
        assert!(json["figures"][figure]["number"].as_u64().is_some_and(|n| n > 0), "{figure}");
    }
    // The error has three rows to one that is shown in motion; the load once more along a path would say nothing new.
    assert!(json["figures"]["error"]["number"].is_u64() && json["figures"]["map"].is_null());
    assert!(html.len() < 1_500_000);

    desk.line(&format!("{line} --no-report --out bare")).done();
    assert_eq!(names(&desk.path("bare")), ["results.csv", "summary.json"]);
}

/// A path that turns back and one whose torque comes and goes: a line to each way, solid and dashed, and what the teeth
/// bear.
#[test]
fn the_page_of_a_path_tells_its_ways_apart() {
    let desk = Desk::new();
    let rows = |points: &[(f64, f64)]| -> String {
        let lines = points.iter().map(|(angle, torque)| format!("{angle},{torque}\n"));
        format!("generator_rad,torque_n_m\n{}", lines.collect::<String>())
    };
    desk.write("there_and_back.csv", &rows(&[(0.0, 0.0), (0.02, 0.0), (0.04, 0.0), (0.02, 0.0), (0.0, 0.0)]));
    desk.write("loop.csv", &rows(&[(0.1, 0.0), (0.1, 5.0), (0.1, 10.0), (0.1, 5.0), (0.1, 0.0), (0.1, -5.0)]));
    let page_of = |path: &str| {
        desk.line(&format!("simulate --generator cam --mesh coarse --path {path}.csv --out {path}")).done();
        page(&desk, &format!("{path}/report.html")).1
    };
    let series = |json: &Value, figure: &str| -> Vec<(String, String)> {
        let series = json["figures"][figure]["charts"]["cam"]["series"].as_array().cloned().unwrap_or_default();
        let text = |of: &Value, key: &str| of[key].as_str().unwrap().to_owned();
        series.iter().map(|series| (text(series, "name"), text(series, "mark"))).collect()
    };
    let pair = |name: &str, mark: &str| (name.to_owned(), mark.to_owned());
    let there = page_of("there_and_back");
    assert_eq!(series(&there, "error"), [pair("forward", "line"), pair("backward", "dashed")]);
    assert!(there["figures"]["torsion"].is_null(), "its torque stands");
    let torsion = page_of("loop");
    assert_eq!(series(&torsion, "torsion"), [pair("torque growing", "line"), pair("torque falling", "dashed")]);
    assert!(torsion["figures"]["error"].is_null(), "its generator stands");
    for json in [&there, &torsion] {
        assert!(json["animations"].as_object().unwrap().is_empty());
        assert_eq!(json["figures"]["path-stress"]["x"]["quantity"], "whole", "{}", json["figures"]["path-stress"]["x"]);
        for figure in ["map", "path-stress", "contacts"] {
            assert!(json["figures"][figure]["number"].as_u64().is_some_and(|n| n > 0), "{figure}");
        }
    }
}

/// A drive with a data sheet, and one whose teeth interfere: both are on the page.
#[test]
fn the_page_of_a_simulation_has_data_sheet_and_cautions() {
    let desk = Desk::new();
    desk.write(
        "drive.toml",
        "base = \"HHD-95\"\n[data_sheet]\nsource = \"a catalogue\"\nt1_n_m = 5.0\nt2_n_m = 10.0\nrated_torque_n_m = \
         20.0\nk1_n_m_per_rad = 30e3\n",
    );
    let line = "simulate --drive drive.toml --generator cam --mesh coarse --path pitch --torque-n-m 20 --out made";
    desk.line(line).done();
    let (html, json) = page(&desk, "made/report.html");
    let sheet = &json["results"]["simulate"]["data_sheet"];
    let (stated, computed) = (&sheet["beside"][0]["stated"], sheet["sheet"]["k1_n_m_per_rad"].as_f64().unwrap());
    assert_eq!(stated.as_f64(), Some(30e3));
    assert!(html.contains("a catalogue and contact FEM; T1 5 T2 10 rated 20 N·m"));
    assert!(html.contains(&format!("K1, N·m/rad</th><td>30000</td><td>{computed:.0}</td>")), "{computed}");
    let binds = "simulate --generator cam --mesh coarse --path pitch --torque-n-m 20 --set \
                 circular_spline.profile_shift=2.95 --out binds";
    desk.line(binds).done();
    let (html, json) = page(&desk, "binds/report.html");
    assert_eq!(json["status"], "caution");
    assert!(html.contains("the teeth of the drawing interfere by 8.9 µm"), "{}", json["remarks"]);
}

/// Five torque nodes are too few for two rollers: the table is made, misses, and page, JSON and exit code say so.
#[test]
fn a_missed_bound_is_stamped_and_fails_the_command() {
    let desk = Desk::new();
    desk.line(
        "tables --generator two-roller --mesh coarse --temperatures-c 20 --most-nodes 5 --positions 4 --no-report \
         --out made",
    )
    .done();
    let run = desk.line("validate --tables made --mesh coarse --solver fast --temperatures 1 --torques 8 --out made");
    assert_eq!(run.code, 1, "{}", run.stderr);
    let (html, json) = page(&desk, "made/validation.html");
    assert_eq!(json["status"], "bound missed");
    assert!(html.contains(r#"<span class="stamp bound-missed">bound missed</span>"#));
    let validation: Value = serde_json::from_str(&desk.read("made/validation.json")).unwrap();
    let (said, found) = (&json["results"]["tables"][0]["validation"], &validation["tables"][0]);
    assert_eq!(said["max_arcsec"], found["max_arcsec"]);
    assert_eq!(said["status"], "bound missed");
    let remark = json["remarks"].as_array().unwrap().iter().any(|r| r.as_str().unwrap().contains("the bounds are"));
    assert!(remark, "{}", json["remarks"]);
}

/// The public example: what its page says is what diagnosis.json says, and it is stamped as what is left asks for.
#[test]
fn the_page_of_a_diagnosis_agrees_with_diagnosis_json() {
    let desk = Desk::new();
    let example = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/csf17_100");
    let map = "time=t_s:s,generator=wave_gen_turns:turn,error=error_arcsec:arcsec";
    let line = format!("diagnose {example}/error_vs_input.csv --model {example}/nominal.toml --columns {map}");
    desk.line(&format!("{line} --out made")).done();
    let (html, json) = page(&desk, "made/report.html");
    let diagnosis: Value = serde_json::from_str(&desk.read("made/diagnosis.json")).unwrap();
    for field in ["verdict", "causes", "residual", "held_out", "compensation", "unexplained"] {
        assert_eq!(json["results"]["diagnosis"][field], diagnosis[field], "{field}");
    }
    assert_eq!(json["results"]["data_faults"], diagnosis["data_faults"]);
    assert_eq!(json["provenance"]["Command"], diagnosis["command"]);
    let hash = json["provenance"][format!("BLAKE3 of {example}/error_vs_input.csv")].as_str().unwrap();
    assert_eq!(hash.len(), 64);
    let stamp = match diagnosis["finding"].as_str().unwrap() {
        "fault_found" => "fault found",
        "not_understood" => "not understood",
        _ => "good",
    };
    assert_eq!(json["status"], stamp);
    assert!(html.contains(&format!(r#"<span class="stamp {}">{stamp}</span>"#, stamp.replace(' ', "-"))));
    // The picture of the nominal model and of the same recalibrated are always there.
    let levels: Vec<&str> =
        json["choices"].as_array().unwrap().iter().map(|choice| choice["id"].as_str().unwrap()).collect();
    assert!(levels.starts_with(&["nominal", "recalibrated"]), "{levels:?}");
    assert_eq!(levels.contains(&"extended"), !diagnosis["causes"].as_array().unwrap().is_empty());
    for figure in ["over-generator", "orders-generator", "over-time"] {
        assert!(json["figures"][figure]["number"].as_u64().is_some_and(|n| n > 0), "{figure}");
    }
    desk.line(&format!("{line} --no-report --out bare")).done();
    let others: Vec<String> = names(&desk.path("made")).into_iter().filter(|name| name != "report.html").collect();
    assert_eq!(names(&desk.path("bare")), others);
}

/// A count that an encoder lost: found, put right, stamped, and reported with place and time.
#[test]
fn faults_of_the_data_are_stamped_on_the_page_of_a_diagnosis() {
    let desk = Desk::new();
    let mut bench = Bench::plain(6000, 1.0, 5);
    bench.output_rad[2700..].iter_mut().for_each(|angle| *angle += 61.0 * ARCSEC);
    desk.write("data.csv", &bench.csv());
    desk.write(
        "nominal.toml",
        "[drive]\nflexspline_teeth = 188\ncircular_spline_teeth = 190\n[nominal]\nstiffness_n_m_per_rad = \
         4.4e5\nbacklash_arcsec = 30.0\nfriction_torque_n_m = 1.0\n",
    );
    let printed = desk.line("diagnose data.csv --model nominal.toml --out made").done().stdout;
    // One line says what each table leaves, however many sessions there are.
    let left = printed.lines().filter(|line| line.contains("without a table") && line.contains("nominal"));
    assert_eq!(left.count(), 1, "{printed}");
    let (html, json) = page(&desk, "made/report.html");
    let stamps: Vec<&str> = [&json["status"]]
        .into_iter()
        .chain(json["also"].as_array().unwrap())
        .map(|status| status.as_str().unwrap())
        .collect();
    assert!(stamps.contains(&"data faults"), "{stamps:?}");
    assert!(html.contains(r#"<span class="stamp data-faults">data faults</span>"#));
    let remarks = json["remarks"].as_array().unwrap();
    assert!(remarks.iter().any(|r| r.as_str().unwrap().starts_with("Data fault: encoder index jump")), "{remarks:?}");
    assert!(html.contains(">27.00 s<"), "the time of the jump is not in the table");
    println!("{} kB for {} rows", html.len() / 1000, bench.rows());
    assert!(html.len() < 1_500_000);
}
