//! The examiner examined: answers whose scores are known beforehand.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::LazyLock;

use serde_json::Value;

/// So many cases are of all kinds.
const ALL_KINDS: &str = "25";

/// Runs an examination of a mock; its rates as (right, of) by name.
fn examine(dir: &Path, mock: &[&str], more: &[&str]) -> (Value, bool) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_flexspline-exam"));
    command.args(["run", "--seed", "21", "--diagnoser", env!("CARGO_BIN_EXE_flexspline-exam-mock")]);
    for argument in mock {
        command.arg(format!("--diagnoser-arg={argument}"));
    }
    let output = command.args(more).arg("--out").arg(dir).output().unwrap();
    let text = fs::read_to_string(dir.join("exam.json")).unwrap();
    (serde_json::from_str(&text).unwrap(), output.status.success())
}

/// Where the truth of these cases lies open once [`KNOWING`] is there.
const OPEN: &str = concat!(env!("CARGO_TARGET_TMPDIR"), "/open");

/// One that knows the truth, on as many cases as hold enough below the limit of detection; and whether it passed.
static KNOWING: LazyLock<(Value, bool)> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    let bounds = ["--at-least", "first_name=0.97", "--at-most", "null_named=0.01", "--removed", "0.97", "--strict"];
    let more = [&["--cases", "30", "--reveal", OPEN], &bounds[..]].concat();
    examine(dir.path(), &["--manner", "truth", "--truth", OPEN], &more)
});

/// Runs an examination of a mock on the first of these cases: to ask the oracle of each again would take a minute.
fn examine_again(dir: &Path, mock: &[&str], more: &[&str]) -> (Value, bool) {
    LazyLock::force(&KNOWING);
    examine(dir, mock, &[&["--cases", ALL_KINDS, "--revealed", OPEN], more].concat())
}

fn share(exam: &Value, name: &str) -> (u64, u64) {
    let rates = exam["scores"]["rates"].as_array().unwrap();
    let rate = &rates.iter().find(|rate| rate[0] == name).unwrap()[1];
    (rate["right"].as_u64().unwrap(), rate["of"].as_u64().unwrap())
}

fn all(exam: &Value, name: &str) {
    let (right, of) = share(exam, name);
    assert!(of > 0 && right == of, "{name}: {right}/{of}");
}

fn none(exam: &Value, name: &str) {
    let (right, of) = share(exam, name);
    assert!(of > 0 && right == 0, "{name}: {right}/{of}");
}

#[test]
fn one_that_knows_the_truth_scores_everything() {
    let (exam, passed) = &*KNOWING;
    assert!(passed);
    for name in [
        "first_name",
        "first_name_strict",
        "exact",
        "compound_first",
        "compound_exact",
        "compound_recall",
        "coverage_95",
    ] {
        all(exam, name);
    }
    all(exam, "outside_unknown");
    for name in ["false_name", "null_named", "null_not_none", "outside_named", "below_limit_misnamed", "failed"] {
        none(exam, name);
    }
    assert!((exam["scores"]["removed_mean"][0].as_f64().unwrap() - 1.0).abs() < 1e-6);
    assert_eq!(exam["scores"]["brier"], 0.0);
}

#[test]
fn faults_of_the_data_are_drawn_and_counted_when_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    let open = dir.path().join("open").display().to_string();
    let knows = ["--manner", "truth", "--truth", &open];
    // Each fault twice.
    let faults = ["--cases", "12", "--kind", "fault"];
    let (exam, _) = examine(dir.path(), &knows, &[&faults[..], &["--reveal", &open]].concat());
    all(&exam, "fault_named");
    none(&exam, "fault_blamed_on_a_cause");
    let (exam, _) = examine(dir.path(), &["--manner", "always"], &[&faults[..], &["--revealed", &open]].concat());
    none(&exam, "fault_named");
    all(&exam, "fault_blamed_on_a_cause");
}

#[test]
fn a_plant_of_its_own_is_scored_by_the_same_rules() {
    let dir = tempfile::tempdir().unwrap();
    let open = dir.path().join("open").display().to_string();
    let bench = ["--cases", "20", "--family", "e"];
    let knows = ["--manner", "truth", "--truth", &open];
    let (exam, _) = examine(dir.path(), &knows, &[&bench[..], &["--reveal", &open]].concat());
    for name in ["first_name", "first_name_family_e", "first_name_strict", "exact", "compound_exact", "outside_unknown"]
    {
        all(&exam, name);
    }
    for name in ["false_name", "null_named", "outside_named", "failed"] {
        none(&exam, name);
    }
    // Its names are stated as certain and are right, so one level holds all of them.
    let levels = exam["scores"]["reliability"]["levels"].as_array().unwrap();
    assert_eq!(levels.len(), 1);
    let right = &levels[0]["right"];
    assert!(right["of"].as_u64().unwrap() >= 12 && right["of"] == right["right"], "{right}");
    assert_eq!(exam["scores"]["families"][0][0], "E");
    let (exam, _) = examine(dir.path(), &["--manner", "always"], &[&bench[..], &["--revealed", &open]].concat());
    all(&exam, "null_named");
    all(&exam, "outside_named");
    assert!(exam["scores"]["reliability"]["levels"][0]["right"]["right"].as_u64().unwrap() < 5);
}

#[test]
fn runs_are_gathered_into_the_scores_of_all_their_cases() {
    let dir = tempfile::tempdir().unwrap();
    let parts = ["null", "outside"].map(|kind| {
        let part = dir.path().join(kind);
        let (exam, _) = examine(&part, &["--manner", "always"], &["--cases", "3", "--kind", kind]);
        (part, exam["scores"]["reliability"]["levels"][0]["right"]["of"].as_u64().unwrap())
    });
    let out = Command::new(env!("CARGO_BIN_EXE_flexspline-exam"))
        .arg("gather")
        .args(parts.iter().map(|(part, _)| part))
        .arg("--out")
        .arg(dir.path())
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let scores = fs::read_to_string(dir.path().join("gathered.json")).unwrap();
    let scores: Value = serde_json::from_str(&scores).unwrap();
    assert_eq!(scores["cases"], 6);
    assert_eq!(scores["reliability"]["levels"][0]["right"]["of"], parts[0].1 + parts[1].1);
}

#[test]
fn faults_of_loggers_are_told_or_blamed_on_a_cause() {
    let dir = tempfile::tempdir().unwrap();
    let open = dir.path().join("open").display().to_string();
    let faults = ["--cases", "3", "--kind", "logger"];
    let knows = ["--manner", "truth", "--truth", &open];
    let (exam, _) = examine(dir.path(), &knows, &[&faults[..], &["--reveal", &open]].concat());
    all(&exam, "logger_told");
    none(&exam, "logger_named");
    // A skew of the reads is a delay by another name: naming that misleads nobody.
    let skew = ["--manner", "always", "--cause", "sensor_latency"];
    let (exam, _) = examine(dir.path(), &skew, &["--cases", "1", "--kind", "logger", "--fault", "read_skew"]);
    all(&exam, "logger_named");
    all(&exam, "logger_told");
    none(&exam, "logger_misled");
    let (exam, _) = examine(dir.path(), &["--manner", "always"], &["--cases", "1", "--kind", "logger"]);
    all(&exam, "logger_misled");
    none(&exam, "logger_told");
}

#[test]
fn one_that_never_names_anything_finds_and_misnames_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let (exam, passed) = examine_again(dir.path(), &["--manner", "none"], &["--at-least", "first_name=0.9"]);
    assert!(!passed, "a bound far off is missed");
    for name in [
        "first_name",
        "exact",
        "compound_exact",
        "null_named",
        "null_not_none",
        "outside_named",
        "outside_unknown",
        "false_name",
    ] {
        none(&exam, name);
    }
}

#[test]
fn one_that_always_names_wear_is_right_on_wear_alone() {
    let dir = tempfile::tempdir().unwrap();
    let (exam, passed) = examine_again(dir.path(), &["--manner", "always"], &["--at-most", "null_named=0.5"]);
    assert!(!passed);
    for name in ["null_named", "null_not_none", "outside_named"] {
        all(&exam, name);
    }
    for case in exam["cases"].as_array().unwrap().iter().filter(|case| case["kind"] == "single") {
        if let Some(strict) = case["first_strict"].as_bool() {
            assert_eq!(strict, case["hidden"][0][0] == "wear", "{case}");
        }
    }
    let (dir, case) =
        (tempfile::tempdir().unwrap(), ["--cases", "5", "--kind", "single", "--cause", "wear", "--clear", "--rich"]);
    let (exam, _) = examine(dir.path(), &["--manner", "always"], &case);
    all(&exam, "first_name");
}

#[test]
fn one_that_crashes_fails_every_case() {
    let dir = tempfile::tempdir().unwrap();
    let (exam, _) = examine_again(dir.path(), &["--manner", "truth", "--truth", "/nowhere"], &[]);
    all(&exam, "failed");
    none(&exam, "first_name");
}

#[test]
fn the_truth_is_where_the_commitment_says_and_one_case_can_be_written_again() {
    let dir = tempfile::tempdir().unwrap();
    let (exam, _) = examine(dir.path(), &["--manner", "none"], &["--cases", "6", "--keep"]);
    let mut files: Vec<_> =
        std::fs::read_dir(dir.path().join("truth")).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let mut hasher = blake3::Hasher::new();
    for file in &files {
        hasher.update(&std::fs::read(file).unwrap());
    }
    assert_eq!(exam["commitment"], hasher.finalize().to_hex().to_string());

    let missed = exam["cases"].as_array().unwrap().iter().find(|case| case["first"] == false).unwrap();
    let (name, index) = (missed["name"].as_str().unwrap(), missed["index"].to_string());
    let one = dir.path().join("one");
    let status = Command::new(env!("CARGO_BIN_EXE_flexspline-exam"))
        .args(["case", "--seed", "21", "--index", &index, "--out"])
        .arg(&one)
        .output()
        .unwrap()
        .status;
    assert!(status.success());
    let read = |path: std::path::PathBuf| std::fs::read(path).unwrap();
    let kept = dir.path().join("cases").join(name);
    assert!(read(one.join("data.csv")) == read(kept.join("data.csv")));
    assert!(read(one.join("nominal.toml")) == read(kept.join("nominal.toml")));
    assert!(read(one.join("truth.json")) == read(dir.path().join("truth").join(format!("{name}.json"))));
}
