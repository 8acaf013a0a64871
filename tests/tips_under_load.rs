//! Tips that clash under load: reported by the run that has them, and not there in a drive that `new` makes.

use flexspline_tests::command::Desk;

/// A size of a catalogue whose teeth, as the proportions of HHD-95 have them, clear one another when rigid and clash
/// under the rated load in a cup and on balls. `new` says so, lowers the tips, and what it makes runs clean; with the
/// tips as drawn `simulate` reports first of all where they bear.
#[test]
#[ignore = "long: tests/run slow"]
fn what_new_proposes_runs_without_tips_that_clash() {
    let desk = Desk::new();
    let run = |drive: &str, set: &str| {
        let path = "--generator cam --path pitch --torque-n-m 31 --mesh coarse --no-report --increment 0.004";
        desk.line(&format!("simulate {path} --drive {drive} --out {drive}-out{set}")).done()
    };
    let json = desk.line("new drive.toml --like CSG-17-100 --json").done().json();
    let lowered_mm = json["under_load"]["tips_lowered_mm"].as_f64().unwrap();
    assert!(lowered_mm > 0.01 && json["under_load"]["tip_contact"].is_null(), "{json}");
    // Without the sheet the path runs alone.
    let file = desk.read("drive.toml");
    desk.write("alone.toml", file.split("\n[data_sheet]").next().unwrap());
    let text = run("alone.toml", "").stdout;
    assert!(!text.contains("caution"), "{text}");
    let tip_mm = |text: &str| -> f64 {
        let of_flexspline = text.split("[flexspline]").nth(1).unwrap();
        let line = of_flexspline.lines().find(|line| line.starts_with("tip_radius_mm")).unwrap();
        line.split(['=', '#']).nth(1).unwrap().trim().parse().unwrap()
    };
    let drawn_mm = tip_mm(&file) + lowered_mm;
    let text = run("alone.toml", &format!(" --set flexspline.tip_radius_mm={drawn_mm:.4}")).stdout;
    println!("{text}");
    let first = text.lines().nth(1).unwrap();
    assert!(first.starts_with("caution: tips bear on one another") && first.contains("lower flexspline.tip_radius_mm"));
    assert!(text.contains("of tips that bear outside the mesh"), "{text}");
    let summary: serde_json::Value = serde_json::from_str(&desk.read("alone.toml-out/summary.json")).unwrap();
    assert_eq!(summary["cautions"][0]["figure"], "tip_contact");
    let share: f64 = summary["zones"].as_array().unwrap().iter().map(|zone| zone["share"].as_f64().unwrap()).sum();
    assert!((share - 1.0).abs() < 1e-9, "{share}");
}
