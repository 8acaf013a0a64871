//! `report.html`: what the page says is what the other files and the exit code say. How it looks and moves is for
//! `tests/run browser`.

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
fn the_page_of_tables_agrees_with_their_files() {
    let desk = Desk::new();
    desk.line(&format!("tables --generator cam {SHORT} --out made")).done();
    let (html, json) = page(&desk, "made/report.html");
    let table: Value = serde_json::from_str(&desk.read("made/cam.json")).unwrap();
    assert_eq!(json["status"], "good");
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

/// Five torque nodes are too few for two rollers: the table is made, misses, and page, JSON and exit code say so.
#[test]
fn a_missed_bound_is_stamped_and_fails_the_command() {
    let desk = Desk::new();
    desk.line("tables --generator two-roller --mesh coarse --temperatures-c 20 --most-nodes 5 --positions 4 --no-report --out made")
        .done();
    let run = desk.line("validate --tables made --mesh coarse --solver fast --temperatures 1 --torques 8 --out made");
    assert_eq!(run.code, 1, "{}", run.stderr);
    let (html, json) = page(&desk, "made/report.html");
    assert_eq!(json["status"], "bound missed");
    assert!(html.contains(r#"<span class="stamp bound-missed">bound missed</span>"#));
    let validation: Value = serde_json::from_str(&desk.read("made/validation.json")).unwrap();
    let (said, found) = (&json["results"]["tables"][0]["validation"], &validation["tables"][0]);
    assert_eq!(said["max_arcsec"], found["max_arcsec"]);
    assert_eq!(said["status"], "bound missed");
    let remark = json["remarks"].as_array().unwrap().iter().any(|r| r.as_str().unwrap().contains("the bounds are"));
    assert!(remark, "{}", json["remarks"]);
}
