//! The command among other programs: stopped by a signal, behind a pipe, on a full disk, on a terminal and not on one.
#![cfg(unix)]

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use flexspline_tests::command::{Desk, Output, flexspline, names, samples};

/// Every file below a folder, hidden ones too, with its content; folders end in a slash.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).into_iter().flatten().map(Result::unwrap) {
        let name = entry.file_name().into_string().unwrap();
        if entry.path().is_dir() {
            all.extend(contents(&entry.path()).into_iter().map(|(inner, text)| (format!("{name}/{inner}"), text)));
            all.insert(name + "/", Vec::new());
        } else {
            all.insert(name, fs::read(entry.path()).unwrap());
        }
    }
    all
}

/// Of the processor, by all its threads so far, to a hundredth of a second.
fn processor_time(child: &Child) -> Duration {
    let stat = fs::read_to_string(format!("/proc/{}/stat", child.id())).unwrap();
    // Fields 14 and 15, counted from the third, which follows the name of the program.
    let fields: Vec<&str> = stat[stat.rfind(')').unwrap() + 2..].split(' ').collect();
    let ticks: u64 = fields[11..13].iter().map(|field| field.parse::<u64>().unwrap()).sum();
    Duration::from_millis(10 * ticks)
}

/// Output of a quiet command, and the processor time of all its threads.
fn ended(mut child: Child) -> (Output, Duration) {
    let (mut stdout, mut stderr) = (Vec::new(), Vec::new());
    child.stdout.take().unwrap().read_to_end(&mut stdout).unwrap();
    child.stderr.take().unwrap().read_to_end(&mut stderr).unwrap();
    // It has closed its output; until it is waited for, its whole time stands in /proc.
    sleep(Duration::from_millis(50));
    let worked = processor_time(&child);
    let status = child.wait().unwrap();
    (Output::of(std::process::Output { status, stdout, stderr }), worked)
}

fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill").args([name, &child.id().to_string()]).status().unwrap();
    assert!(sent.success(), "it had ended before it was sent {name}");
}

/// Starts a command, sends it a signal once it works, and checks that it soon works no more, by the processor, and
/// leaves the folder as it found it.
#[track_caller]
fn stopped(desk: &Desk, line: &str, working: Duration, signals: &[&str]) {
    let before = contents(&desk.path("."));
    let words: Vec<&str> = line.split(' ').collect();
    let child = desk.command(&words).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    sleep(working);
    let before_signal = processor_time(&child);
    for name in signals {
        signal(&child, name);
    }
    let (output, worked) = ended(child);
    let took = worked.saturating_sub(before_signal);
    println!("{line}: worked {} ms more after {}", took.as_millis(), signals.join(", "));
    assert_eq!(output.code, 1, "{line}: {}", output.stderr);
    assert!(output.stdout.is_empty(), "{line}: {}", output.stdout);
    assert!(output.stderr.ends_with("error: stopped; nothing was written\n"), "{line}: {}", output.stderr);
    assert!(took < Duration::from_secs(1), "{line}: {took:?}");
    let after = contents(&desk.path("."));
    assert!(before == after, "{line}: {:?} became {:?}", before.keys(), after.keys());
}

const WORKING: Duration = Duration::from_millis(600);

#[test]
fn a_stopped_simulation_leaves_the_folder_as_it_was() {
    let desk = Desk::new();
    // Where there was no folder there is none; one increment of the reference solver on the fine mesh takes longer than
    // this.
    stopped(&desk, "simulate --generator cam --mesh fine --solver reference --frames", WORKING, &["-INT"]);
    desk.write("path.csv", "generator_rad\n0\n0.01\n");
    desk.line("simulate --generator cam --mesh coarse --path path.csv --frames").done();
    assert_eq!(names(&desk.path("out")), ["frames", "report.html", "results.csv", "summary.json"]);
    // With frames in a hidden folder.
    let run = "simulate --generator double-disc --mesh coarse --frames --path paper";
    stopped(&desk, run, Duration::from_millis(1500), &["-INT"]);
    stopped(&desk, run, WORKING, &["-TERM"]);
    stopped(&desk, run, WORKING, &["-INT", "-INT", "-TERM"]);
}

#[test]
fn stopped_tables_kernels_and_validations_leave_the_folder_as_it_was() {
    let desk = Desk::new();
    fs::create_dir(desk.path("out")).unwrap();
    desk.write("out/cam.fxt", "an older table");
    stopped(&desk, "tables --generator all", WORKING, &["-INT"]);
    stopped(&desk, "tables --generator cam --mesh fine --out new/folder", WORKING, &["-TERM"]);
    stopped(&desk, "tables --kernels --generator cam", WORKING, &["-INT"]);
    stopped(&desk, "synthesize --effect wear", WORKING, &["-INT"]);
    desk.write("samples.csv", &samples(&[0]));
    desk.line("tables --generator cam --from-samples samples.csv --no-report").done();
    stopped(&desk, "validate --tables out", WORKING, &["-INT"]);
}

#[test]
fn a_stopped_diagnosis_leaves_the_folder_as_it_was() {
    let desk = Desk::new();
    desk.line("new nominal.toml").done();
    let effects = "--effect circular_spline_eccentricity --effect torsional_hysteresis --effect thermal_stiffness";
    desk.line(&format!("synthesize --model nominal.toml {effects} --seed 5 --rows 20000")).done();
    desk.write("out/diagnosis.json", "{}");
    stopped(&desk, "diagnose out/data.csv --model nominal.toml", Duration::from_millis(900), &["-INT"]);
    stopped(&desk, "diagnose out/data.csv --model nominal.toml", Duration::from_millis(1800), &["-TERM"]);
}

/// Ten minutes without a word look like a program that hangs: into a pipe goes a line every ten seconds, but none where
/// quiet was asked for.
#[test]
#[ignore = "long: tests/run slow"]
fn long_work_into_a_pipe_says_how_far_it_is() {
    let said = |quiet: &str| {
        let desk = Desk::new();
        let line = format!("simulate --generator cam --mesh fine --solver reference --path turn{quiet}");
        let words: Vec<&str> = line.split(' ').collect();
        let mut child = desk.command(&words).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut stderr = BufReader::new(child.stderr.take().unwrap());
        let mut said = String::new();
        if quiet.is_empty() {
            stderr.read_line(&mut said).unwrap();
        } else {
            sleep(Duration::from_secs(11));
        }
        signal(&child, "-TERM");
        stderr.read_to_string(&mut said).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(1));
        said
    };
    let lines = said("");
    assert!(lines.starts_with("cam") && lines.contains("10 s so far") && lines.lines().count() == 2, "{lines}");
    assert_eq!(said(" -q"), "error: stopped; nothing was written\n");
}

#[test]
fn a_run_that_was_started_to_outlive_its_terminal_does() {
    let desk = Desk::new();
    let run = "exec \"$0\" simulate --generator double-disc --mesh coarse --path paper -q";
    let started = |before: &str| {
        let mut bash = Command::new("bash");
        bash.args(["-c", &format!("{before} {run}")]).arg(flexspline()).current_dir(desk.path("."));
        let child = bash.stderr(Stdio::piped()).spawn().unwrap();
        sleep(WORKING);
        signal(&child, "-HUP");
        child.wait_with_output().unwrap().status.code()
    };
    // As `nohup` starts it.
    assert_eq!(started("trap '' HUP;"), Some(0));
    assert_eq!(names(&desk.path("out")), ["report.html", "results.csv", "summary.json"]);
    // And one that was not, unless this very test was started so.
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap_or("0");
    if ignored.trim().ends_with(['0', '2', '4', '6', '8', 'a', 'c', 'e']) {
        assert_eq!(started(""), Some(1));
    }
}

#[test]
fn a_closed_pipe_is_no_error() {
    let desk = Desk::new();
    desk.write("path.csv", "generator_rad\n0\n");
    let run = "simulate --generator cam --mesh coarse --path path.csv -v";
    for line in ["drive", "drive --json", "--help", "synthesize --list", "help tables", run] {
        let words: Vec<&str> = line.split(' ').collect();
        let mut child = desk.command(&words).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        // Nobody reads what it writes.
        drop((child.stdout.take(), child.stderr.take()));
        assert_eq!(child.wait().unwrap().code(), Some(0), "{line}");
    }
    assert_eq!(names(&desk.path("out")), ["report.html", "results.csv", "summary.json"]);
}

#[test]
fn a_full_disk_is_one_clear_error() {
    let desk = Desk::new();
    let full = || fs::File::options().write(true).open("/dev/full").unwrap();
    for line in ["drive", "drive --json", "--help", "help", "export --format csv --generator cam"] {
        let words: Vec<&str> = line.split(' ').collect();
        let run = Output::of(desk.command(&words).stdout(full()).output().unwrap());
        assert_eq!(run.code, 1, "{line}: {}", run.stderr);
        assert!(
            run.stderr.starts_with("error: cannot write to standard output: No space left"),
            "{line}: {}",
            run.stderr
        );
        assert_eq!(run.stderr.lines().count(), 1, "{line}: {}", run.stderr);
    }
    fs::remove_dir_all(desk.path("out")).unwrap();
    // Files that may have one kilobyte.
    let limited = "trap '' XFSZ; ulimit -f 1; exec \"$0\" export --format csv --generator cam";
    let mut bash = Command::new("bash");
    let run = Output::of(bash.args(["-c", limited]).arg(flexspline()).current_dir(desk.path(".")).output().unwrap());
    assert_eq!(run.code, 1, "{}", run.stderr);
    assert!(run.stderr.starts_with("error: cannot write out/cam-outlines.csv: File too large"), "{}", run.stderr);
    assert_eq!(names(&desk.path(".")), [""; 0], "the folder that was made for it is gone too");
}

/// Of the processor: the work of these commands takes ten times as long, but that of the diagnosis.
const AT_ONCE: Duration = Duration::from_secs(6);

#[test]
fn a_folder_that_cannot_be_written_is_found_out_before_the_work() {
    let desk = Desk::new();
    desk.line("new nominal.toml").done();
    desk.line("synthesize --model nominal.toml --seed 5 --rows 20000 --out data").done();
    let before = contents(&desk.path("."));
    for line in [
        "tables",
        "tables --kernels",
        "simulate --generator cam --mesh fine",
        "synthesize --effect wear",
        "diagnose data/data.csv --model nominal.toml",
        "export --generator cam --format vtu --mesh fine",
    ] {
        // Not even root makes a folder there.
        let line = format!("{line} --out /proc/flexspline");
        let words: Vec<&str> = line.split(' ').collect();
        let (run, worked) = ended(desk.command(&words).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap());
        assert_eq!(run.code, 2, "{line}: {}", run.stderr);
        assert!(run.stderr.starts_with("error: --out: cannot write /proc/flexspline: "), "{line}: {}", run.stderr);
        assert!(worked < AT_ONCE, "{line} worked {worked:?} before it said so");
    }
    assert!(before == contents(&desk.path(".")));
}

/// Colours and the like begin so.
const ESCAPE: char = '\u{1b}';

#[test]
fn colour_is_for_terminals_and_for_who_asks() {
    let desk = Desk::new();
    let wrong = ["drive", "--set", "flexspline.teth=3"];
    for args in [&wrong[..], &["simulate"], &["--help"], &["new", "a.toml", "--force"]] {
        let said = |variables: &[(&str, &str)]| {
            let mut command = desk.command(args);
            command.env_remove("NO_COLOR").env_remove("CLICOLOR_FORCE").env_remove("CLICOLOR");
            let run = Output::of(command.envs(variables.iter().copied()).output().unwrap());
            run.stdout + &run.stderr
        };
        assert!(!said(&[]).contains(ESCAPE), "{args:?} in a pipe");
        assert!(said(&[("CLICOLOR_FORCE", "1")]).contains(ESCAPE), "{args:?} with CLICOLOR_FORCE");
        assert!(!said(&[("NO_COLOR", "1")]).contains(ESCAPE), "{args:?} with NO_COLOR");
    }
    let forced = desk.command(&wrong).env_remove("NO_COLOR").env("CLICOLOR_FORCE", "1").output().unwrap();
    let forced = String::from_utf8(forced.stderr).unwrap();
    assert!(
        forced.contains("\u{1b}[31m") && forced.contains("\u{1b}[32mdid you mean `flexspline.teeth`?\u{1b}[0m"),
        "{forced:?}"
    );
    // JSON is data whoever asks for colour.
    let json = desk.command(&["drive", "--json"]).env("CLICOLOR_FORCE", "1").output().unwrap();
    Output::of(json).json();
}

/// Terminal output of a command, or nothing where there is no `script` to make one.
fn on_a_terminal(desk: &Desk, line: &str, variables: &[(&str, &str)]) -> Option<String> {
    let mut script = Command::new("script");
    script.args(["-qec", line, "/dev/null"]).current_dir(desk.path(".")).stdin(Stdio::null());
    script.env("TERM", "xterm").env_remove("NO_COLOR").env_remove("CLICOLOR_FORCE").envs(variables.iter().copied());
    let output = script.output().ok()?;
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}

#[test]
#[ignore = "long: tests/run slow"]
fn a_terminal_sees_colour_and_how_long_it_will_take() {
    let desk = Desk::new();
    let program = flexspline().display();
    let wrong = format!("{program} drive --set flexspline.teth=3");
    let Some(shown) = on_a_terminal(&desk, &wrong, &[]) else {
        println!("there is no `script` here: not tested");
        return;
    };
    assert!(shown.contains("\u{1b}[31m") && shown.contains("did you mean `flexspline.teeth`?"), "{shown:?}");
    let plain = on_a_terminal(&desk, &wrong, &[("NO_COLOR", "1")]).unwrap();
    assert!(!plain.contains(ESCAPE) && plain.contains("did you mean"), "{plain:?}");
    desk.line("new nominal.toml").done();
    desk.line("synthesize --model nominal.toml --effect wear --seed 5 --rows 20000 --out data").done();
    for (line, time) in [
        ("tables --generator cam", " left"),
        ("simulate --generator cam --solver reference", " left"),
        ("tables --kernels --generator cam", " left"),
        ("diagnose data/data.csv --model nominal.toml", " so far"),
    ] {
        let mut shown = String::new();
        // A busy machine needs longer before it can say.
        for seconds in ["2.2", "3", "4.5", "6", "8", "12", "30"] {
            shown = on_a_terminal(&desk, &format!("timeout -s INT {seconds} {program} {line}"), &[]).unwrap();
            if shown.contains(time) {
                break;
            }
        }
        assert!(shown.contains(time), "{line} shows no time: {shown:?}");
        // The bar goes before the last word.
        let (_, end) = shown.rsplit_once("\u{1b}[2K").unwrap();
        assert!(end.contains("stopped; nothing was written") && !end.contains(" left"), "{line}: {end:?}");
    }
}
