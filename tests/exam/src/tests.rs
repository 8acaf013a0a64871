//! The examiner examined: answers whose scores are known beforehand, seeds that repeat cases, a sealed truth.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::sync::LazyLock;

use crate::answer::{Answer, DataFault, Estimate, HeldOut, Named};
use crate::case::{Case, Draw, Family, Kind};
use crate::exam::{self, Settings};
use crate::logger::LoggerFault;
use crate::rate::Rate;
use crate::score::{Gathered, Judged, judge, reliability};
use crate::truth::{Truth, commitment};

/// Cases of all kinds: a block of families D, E, G and H in turn, and faults of loggers.
static TRUTHS: LazyLock<Vec<Truth>> = LazyLock::new(|| {
    let logger = Draw { kind: Some(Kind::Logger), ..Draw::default() };
    let loggers = [1, 4].map(|index| Case::draw(21, index, &logger).truth());
    (0..20).map(|index| Case::draw(21, index, &Draw::default()).truth()).chain(loggers).collect()
});

fn answer(verdict: &str, names: &[&str]) -> Answer {
    let named = |name: &&str| Named {
        name: (*name).to_owned(),
        confidence: 1.0,
        parameters: BTreeMap::new(),
        look_alikes: Vec::new(),
    };
    let causes = names.iter().map(named).collect();
    Answer { verdict: verdict.to_owned(), causes, data_faults: Vec::new(), held_out: None }
}

/// Names all that counts, with its parameters, and removes all that is removable.
fn perfect(truth: &Truth) -> Answer {
    let counted: Vec<_> = truth.hidden.iter().filter(|hidden| hidden.counts()).collect();
    let names: Vec<&str> = counted.iter().map(|hidden| hidden.name.as_str()).collect();
    let mut answer = match truth.kind.as_str() {
        "outside" => answer("unknown", &[]),
        "logger" => answer("none", &[]),
        _ => answer(if names.is_empty() { "none" } else { "explained" }, &names),
    };
    for (cause, hidden) in answer.causes.iter_mut().zip(&counted) {
        let stated = |value: &f64| Estimate { value: *value, std: Some(1e-6 + 0.01 * value.abs()) };
        cause.parameters = hidden.parameters.iter().map(|(name, value)| (name.clone(), stated(value))).collect();
    }
    if truth.kind == "logger" {
        answer.data_faults = names.iter().map(|name| DataFault { name: (*name).to_owned() }).collect();
    }
    let before = truth.floor_arcsec.hypot(truth.removable_rms_arcsec);
    answer.held_out = Some(HeldOut { rms_before_arcsec: before, rms_after_arcsec: truth.floor_arcsec });
    answer
}

fn scores(of: impl Fn(&Truth) -> Result<Answer, String>) -> Gathered {
    Gathered::of(&TRUTHS.iter().map(|truth| judge(truth, &of(truth), 0.0)).collect::<Vec<_>>())
}

#[track_caller]
fn all(scores: &Gathered, names: &[&str]) {
    for name in names {
        let Rate { right, of } = scores.all.rate(name);
        assert!(of > 0 && right == of, "{name}: {right}/{of}");
    }
}

#[track_caller]
fn none(scores: &Gathered, names: &[&str]) {
    for name in names {
        let Rate { right, of } = scores.all.rate(name);
        assert!(of > 0 && right == 0, "{name}: {right}/{of}");
    }
}

#[test]
#[ignore = "long: tests/run slow"]
fn scores_are_those_that_an_answer_deserves() {
    // One that knows the truth.
    let known = scores(|truth| Ok(perfect(truth)));
    all(&known, &["first_name", "first_name_strict", "exact", "exact_near", "exact_far", "found_near", "found_far"]);
    all(&known, &["compound_first", "compound_exact", "compound_recall", "coverage_95", "removed_half"]);
    all(&known, &["outside_unknown", "logger_told"]);
    none(&known, &["false_name", "null_named", "null_not_none", "outside_named", "logger_named", "failed"]);
    assert!((known.all.removed_mean - 1.0).abs() < 1e-6);
    // Its names are stated as certain and are right, so one level holds all of them.
    let [level] = known.all.reliability.as_slice() else { panic!("{:?}", known.all.reliability) };
    assert_eq!(level.right.right, level.right.of);
    assert_eq!(known.families.keys().collect::<Vec<_>>(), ["D", "E", "G", "H", "logger"]);
    // One that never names anything.
    let silent = scores(|_| Ok(answer("none", &[])));
    none(&silent, &["first_name", "exact", "compound_exact", "outside_unknown", "logger_told", "removed_half"]);
    none(&silent, &["null_named", "null_not_none", "outside_named", "false_name", "failed"]);
    // One that crashes.
    let crashed = scores(|_| Err("crashed".to_owned()));
    all(&crashed, &["failed"]);
    none(&crashed, &["first_name", "compound_exact", "outside_unknown"]);
    // One that always names wear.
    let wear = scores(|_| Ok(answer("explained", &["wear"])));
    all(&wear, &["null_named", "null_not_none", "outside_named", "logger_named", "logger_misled"]);
    let with = |wear: bool| TRUTHS.iter().filter(move |t| t.kind == "single" && (t.hidden[0].name == "wear") == wear);
    let strict = wear.all.rate("first_name_strict");
    assert_eq!(strict, Rate { right: with(true).count(), of: with(true).count() + with(false).count() });
    let like = with(false).filter(|truth| truth.hidden[0].look_alikes.contains_key("wear")).count();
    assert_eq!(wear.all.rate("first_name").right, strict.right + like);
}

/// A delay is a skew of the reads by another name: who says it misleads nobody.
#[test]
fn a_fault_by_another_name_misleads_nobody() {
    let skew = TRUTHS.iter().find(|truth| truth.hidden.iter().any(|hidden| hidden.name == "read_skew")).unwrap();
    let judged = judge(skew, &Ok(answer("explained", &["sensor_latency"])), 0.0);
    let asked = |rate| judged.asked(rate).collect::<Vec<_>>();
    assert_eq!([asked("logger_named"), asked("logger_told"), asked("logger_misled")], [[true], [true], [false]]);
}

/// A refusal answers where it names the mapping that mends the file, and where no size may be changed unasked.
#[test]
fn a_refusal_that_mends_the_file_reports_the_fault() {
    use LoggerFault::{DegreesAsRad, MillisecondsAsSeconds, OutputSign, Stalls};
    let answers = |fault, code, said: &str| {
        Answer::of_refusal(Some(fault), &format!("flexspline: exit status: {code}"), said).is_some()
    };
    for (fault, said) in [
        (DegreesAsRad, "error: data.csv: ...; allowed: --columns output=output_rad:deg"),
        (OutputSign, "error: data.csv: ...; allowed: --columns output=output_rad:-rad, or the ratio -95"),
        (MillisecondsAsSeconds, "error: data.csv: ...; allowed: --columns time=time_s:ms, or time=time_s:s"),
    ] {
        assert!(answers(fault, 2, said), "{said}");
        assert!(!answers(fault, 2, "error: data.csv: units?"), "without the mapping");
        assert!(!answers(fault, 1, said), "a failed run");
        assert!(!answers(Stalls, 2, said), "a file that is to be read");
    }
}

#[test]
fn a_confidence_falls_into_one_level() {
    let names = [(0.25, true), (1.0 / 3.0, false), (0.5, true), (0.5, false), (0.97, true), (0.9, false), (0.99, true)];
    let names = names.map(|(confidence, right)| crate::score::Said {
        name: "wear".into(),
        confidence,
        right,
        alike: true,
        listed: right,
    });
    let levels = reliability(&names);
    let counts: Vec<_> = levels.iter().map(|level| (level.right.right, level.right.of, level.alike.right)).collect();
    assert_eq!(counts, [(1, 1, 1), (0, 1, 1), (1, 2, 2), (1, 2, 2), (1, 1, 1)]);
    assert!((levels[3].stated - 0.935).abs() < 1e-12);
}

#[test]
#[ignore = "long: tests/run slow"]
fn a_seed_repeats_a_case_and_the_data_hold_no_truth() {
    let family = |family| Draw { family: Some(family), ..Draw::default() };
    let draws = [Family::D, Family::E, Family::G, Family::H].map(family);
    for draw in draws.into_iter().chain([Draw { kind: Some(Kind::Logger), ..Draw::default() }]) {
        let drawn = |seed| {
            let case = Case::draw(seed, 3, &draw);
            ([case.data(), case.nominal_toml(), case.truth().json()], case.truth())
        };
        let (files, truth) = drawn(4);
        assert!(files == drawn(4).0, "{draw:?}");
        // Every plant draws by the one generator.
        assert!(draw.family != Some(Family::D) || files[0] != drawn(5).0[0]);
        let [data, nominal, sealed] = files;
        for hidden in truth.hidden {
            assert!(sealed.contains(&hidden.name) && ![&data, &nominal].iter().any(|file| file.contains(&hidden.name)));
        }
        assert!(data.starts_with("time_s,generator_rad,output_rad,torque_n_m,temperature_c"));
    }
}

/// A run of null cases with a program of this script.
fn run(out: &Path, script: &str) -> exam::Examination {
    run_of(out, script, Draw { family: Some(Family::E), kind: Some(Kind::Null), ..Draw::default() })
}

fn run_of(out: &Path, script: &str, draw: Draw) -> exam::Examination {
    fs::create_dir_all(out).unwrap();
    let program = out.join("diagnoser");
    fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    let (diagnoser, out) = (program.display().to_string(), out.to_owned());
    exam::run(&Settings { seed: Some(21), cases: 3, draw, diagnoser, jobs: 2, out }).unwrap()
}

#[test]
fn a_run_that_ends_at_another_ratio_answers_where_the_ratio_is_wrong_alone() {
    let desk = tempfile::tempdir().unwrap();
    let refused = |ratio: &str, fault: Option<LoggerFault>, folder: &str| {
        let kind = Some(if fault.is_some() { Kind::Logger } else { Kind::Null });
        let draw = Draw { kind, fault, ..Draw::default() };
        run_of(&desk.path().join(folder), &format!("echo 'data.csv: {ratio}' >&2\nexit 2"), draw).scores
    };
    let both = "ratio: found 100, but the generator turns 101.00 times for one turn of the output; allowed: 101";
    let right = refused(both, Some(LoggerFault::RatioOffByOne), "right");
    none(&right, &["failed", "logger_misled"]);
    all(&right, &["logger_told"]);
    all(&refused(both, None, "sound"), &["failed"]);
    all(&refused("ratio: found 100", Some(LoggerFault::RatioOffByOne), "one"), &["failed"]);
}

#[test]
fn the_truth_is_sealed_and_runs_are_gathered() {
    let desk = tempfile::tempdir().unwrap();
    let silent = r#"echo '{ "verdict": "none" }' > "$6/diagnosis.json""#;
    let sealed =
        format!("[ -e \"$(dirname \"$2\")/../../truth\" ] && exit 1\n[ -s \"$2\" ] && [ -s \"$4\" ] && {silent}");
    let (good, bad) = (desk.path().join("good"), desk.path().join("bad"));
    let examination = run(&good, &sealed);
    none(&examination.scores, &["failed", "null_named"]);
    all(&run(&bad, "exit 1").scores, &["failed"]);

    let draw = Draw { family: Some(Family::E), kind: Some(Kind::Null), ..Draw::default() };
    let truths: Vec<Truth> = (0..3).map(|index| Case::draw(21, index, &draw).truth()).collect();
    assert_eq!(examination.commitment, commitment(&truths));
    for truth in &truths {
        assert_eq!(fs::read_to_string(good.join(format!("truth/{}.json", truth.name))).unwrap(), truth.json());
    }
    assert_eq!(fs::read_dir(good.join("cases")).unwrap().count(), 0, "data are taken away");

    let cases: Vec<Judged> =
        [&good, &bad].iter().flat_map(|run| exam::cases(&run.join("exam.json")).unwrap()).collect();
    assert_eq!(Gathered::of(&cases).all.rate("failed"), Rate { right: 3, of: 6 });
    assert!(exam::cases(&desk.path().join("exam.json")).unwrap_err().to_string().contains("exam.json"));
}
