//! A sweep of drives drawn from tolerances: shards that are killed and resumed give the bytes of one run,
//! and the input that matters is found; a sweep of a field finds a known optimum.
//!
//! References: the uninterrupted run; the FEM of drives with the same deviations; the influence kernels, by which a
//! second harmonic of 4 µm outweighs one of 0.2 µm. Physics wrong if this fails: a sign, a phase, a wheel taken for the
//! other, or a load of the kernels that is not that of the sweep.

use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use flexspline_tests::command::{Desk, Output};

#[test]
fn sweep_shards_killed_and_resumed_have_the_bytes_of_one_run() {
    let desk = Desk::new();
    desk.write("teeth.toml", include_str!("../examples/sweep/teeth.toml"));
    for folder in ["one", "two"] {
        desk.line(&format!("sweep plan --tolerances teeth.toml --draws 1000 --out {folder}")).done();
    }
    assert_eq!(desk.read("one/plan.csv"), desk.read("two/plan.csv"));
    desk.line("sweep run one").done();
    desk.line("sweep run two --shard 2/2").done();
    // Killed once it has written a row.
    let rows = desk.path("two/results/0001-of-0002.csv");
    let mut killed = desk.command(&["sweep", "run", "two", "--shard", "1/2", "--threads", "1", "-q"]).spawn().unwrap();
    let begun = Instant::now();
    while fs::read_to_string(&rows).map_or(0, |text| text.lines().count()) < 2 {
        assert!(begun.elapsed() < Duration::from_secs(60), "no row in a minute");
        std::thread::sleep(Duration::from_millis(1));
    }
    killed.kill().unwrap();
    assert!(!killed.wait().unwrap().success());
    // Stopped once it has written a row more: it says that rows stand.
    let lines = || fs::read_to_string(&rows).unwrap().lines().count();
    let there = lines();
    let mut stopped = desk.command(&["sweep", "run", "two", "--shard", "1/2", "--threads", "1", "-q"]);
    let stopped = stopped.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    while lines() <= there {
        assert!(begun.elapsed() < Duration::from_secs(60), "no row in a minute");
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(Command::new("kill").args(["-INT", &stopped.id().to_string()]).status().unwrap().success());
    let stopped = Output::of(stopped.wait_with_output().unwrap());
    assert_eq!((stopped.code, stopped.stderr.as_str()), (1, "error: stopped; what was written is whole\n"));
    let left = fs::read_to_string(&rows).unwrap();
    assert!(left.ends_with('\n') && left.lines().count() < 501, "{} lines", left.lines().count());
    let again = desk.line("sweep run two --shard 1/2 --json").done().json();
    assert!(again["there"].as_u64().unwrap() > 0 && again["computed"].as_u64().unwrap() > 0, "{again}");
    for folder in ["one", "two"] {
        desk.line(&format!("sweep reduce {folder}")).done();
    }
    assert_eq!(desk.read("one/sweep.csv"), desk.read("two/sweep.csv"));
    assert_eq!(desk.read("one/sweep.json"), desk.read("two/sweep.json"));
    let whole = desk.read("one/results/0001-of-0001.csv");
    let second = desk.read("two/results/0002-of-0002.csv");
    let both = fs::read_to_string(&rows).unwrap() + second.split_once('\n').unwrap().1;
    assert_eq!(whole, both);
    // Plans of two commands have files of one name.
    desk.line("calibrate --plan --ratio 101 --minutes 5 --out bench").done();
    let plans = ["one/plan.csv", "bench/plan.csv"].map(|file| desk.read(file));
    for line in [
        "calibrate --plan --ratio 101 --minutes 5 --out one",
        "sweep plan --tolerances teeth.toml --draws 1000 --out bench",
        "sweep --vary flexspline.rim_thickness_mm=1.4,1.5 --out bench",
    ] {
        desk.refused(line, "plan.csv, a plan of another command");
    }
    assert_eq!(["one/plan.csv", "bench/plan.csv"].map(|file| desk.read(file)), plans);
}

#[test]
fn the_rank_correlation_of_a_sweep_finds_the_tolerance_that_matters() {
    let desk = Desk::new();
    let harmonic = |of: &str, limit: f64| {
        format!(
            "[[tolerance]]\nfield = \"as_built.{of}_pitch_harmonics\"\norder = 2\n\
             distribution = \"uniform\"\nlimits = [0.0, {limit}]\n"
        )
    };
    let tolerances = format!("torque_n_m = 50.0\n{}{}", harmonic("flexspline", 0.2), harmonic("circular_spline", 4.0));
    desk.write("t.toml", &tolerances);
    let swept = desk.line("sweep --tolerances t.toml --draws 100 --json").done().json();
    let ranks = swept["generators"][0]["ranks"].as_array().unwrap();
    let of_error: Vec<_> = ranks.iter().filter(|rank| rank["figure"] == "error_pp_arcsec").collect();
    println!("{of_error:?}");
    assert_eq!(of_error[0]["input"], "as_built.circular_spline_pitch_harmonics, order 2");
    assert!(of_error[0]["correlation"].as_f64().unwrap() > 0.95 && of_error[1]["correlation"].as_f64().unwrap() < 0.5);
}

/// A thicker rim has a larger K1 under two rollers and a larger pressure on them: either target has a known optimum.
#[test]
fn a_sweep_of_a_field_finds_the_known_optimum() {
    let desk = Desk::new();
    let vary = "sweep -g two-roller --vary flexspline.rim_thickness_mm=1.4..2.2:3 --positions 4 --most k1_n_m_per_rad";
    let run = desk.line(&format!("{vary} --out out --json")).done();
    let front = &run.json()["generators"][0]["front"];
    assert_eq!(front, &serde_json::json!([3]));
    let less = "sweep reduce out --least peak_generator_pressure_mpa --json";
    assert_eq!(desk.line(less).done().json()["generators"][0]["front"], serde_json::json!([1]));
    for former in ["study --vary generator.w0_mm=0.5", "campaign plan t.toml"] {
        assert_eq!(desk.refused(former, "flexspline sweep").lines().count(), 1, "{former}");
    }
}
