//! A program of a few lines of shell stands for `flexspline`: it looks, or takes long.
#![cfg(unix)]

use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::time::Instant;

use super::*;

/// `look` prints and says something; `tables` says how far it is, makes an unfinished file, and clears it away when it
/// is asked to end; `validate` takes no notice of that.
const PROGRAM: &str = r#"#!/bin/sh
case "$1" in
look) echo '{"rows": 3}'; echo 'note: three rows' >&2 ;;
tables) for word in "$@"; do case "$word" in --out=*) out=${word#--out=} ;; esac; done
    trap 'rm -f "$out/.part-x"; exit 1' TERM
    touch "$out/.part-x"; echo 'progress: 3/24 cam: turning' >&2; sleep 30 & wait ;;
validate) trap '' TERM; sleep 30 ;;
new) sleep 30 ;;
*) echo 'error: no' >&2; exit 2 ;;
esac
"#;

struct Bench {
    place: tempfile::TempDir,
    folder: Arc<Folder>,
    jobs: Arc<Jobs>,
}

fn program(place: &Path) -> PathBuf {
    let program = place.join("flexspline.sh");
    if !program.exists() {
        fs::write(&program, PROGRAM).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    }
    program
}

impl Bench {
    fn new() -> Bench {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("a.csv"), "x").unwrap();
        let folder = Arc::new(Folder::new(place.path()).unwrap());
        let jobs = Jobs::new(folder.clone(), program(place.path()), Some(1));
        Bench { place, folder, jobs }
    }

    fn until(&self, id: u64, state: JobStatus) -> JobRecord {
        let from = Instant::now();
        loop {
            let job = self.jobs.job(id).unwrap();
            if job.state == state {
                return job;
            }
            assert!(from.elapsed() < Duration::from_secs(20), "{job:?}");
            thread::sleep(Duration::from_millis(5));
        }
    }
}

fn look() -> WorkAsked {
    WorkAsked::Look { files: vec!["a.csv".to_owned()] }
}

fn long(work: &str) -> WorkAsked {
    let drive = r#"{"drive":"HHD-95"}"#;
    let json = match work {
        "tables" => format!(r#"{{"work":"tables","drive":{drive},"generator":"cam","mesh":"coarse"}}"#),
        _ => format!(r#"{{"work":"validate","tables":".","drive":{drive},"generator":"cam"}}"#),
    };
    serde_json::from_str(&json).unwrap()
}

#[test]
fn what_a_command_prints_and_says_is_kept() {
    let bench = Bench::new();
    let id = bench.jobs.add(look()).unwrap().id;
    let job = bench.until(id, JobStatus::Done);
    assert_eq!(bench.folder.read(&format!("{}/look.json", job.out), None).unwrap(), b"{\"rows\": 3}\n");
    assert_eq!(job.said, ["note: three rows"]);
    assert_eq!(job.command, format!("flexspline look a.csv --json > bench/look-{id}/look.json"));
    assert!(job.wall_ms.is_some() && job.exit_code == Some(0));
}

#[test]
fn a_command_that_fails_says_why() {
    let bench = Bench::new();
    let work = WorkAsked::Replay { file: "a.csv".into(), columns: None, table: "a.csv".into() };
    let id = bench.jobs.add(work).unwrap().id;
    let job = bench.until(id, JobStatus::Failed);
    assert_eq!((job.exit_code, job.said.as_slice()), (Some(2), ["error: no".to_owned()].as_slice()));
}

#[test]
fn two_short_jobs_and_one_long_one_run_at_a_time_where_there_are_two_cores() {
    let Bench { place, folder, .. } = Bench::new();
    let jobs = Jobs::new(folder.clone(), program(place.path()), None);
    let short = |file: &str| {
        serde_json::from_str(&format!(r#"{{"work":"new","file":"{file}","of":{{"like":"CSG-25-80"}}}}"#)).unwrap()
    };
    let ids = [short("a.toml"), short("b.toml"), short("c.toml"), long("tables"), long("tables")]
        .map(|work| jobs.add(work).unwrap().id);
    let cores = thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let expected =
        [true, cores > 1, false, true, false].map(|runs| if runs { JobStatus::Running } else { JobStatus::Waiting });
    let bench = Bench { place, folder, jobs };
    for (id, state) in ids.iter().zip(expected) {
        bench.until(*id, state);
    }
    assert_eq!(ids.map(|id| bench.jobs.job(id).unwrap().state), expected);
    bench.jobs.end();
}

/// Long work does not stand in the way of short work; of each line one runs at a time.
#[test]
fn one_of_each_line_runs_at_a_time_and_says_how_far_it_is() {
    let bench = Bench::new();
    let first = bench.jobs.add(long("tables")).unwrap().id;
    let second = bench.jobs.add(long("tables")).unwrap().id;
    bench.until(first, JobStatus::Running);
    let quick = bench.jobs.add(look()).unwrap().id;
    bench.until(quick, JobStatus::Done);
    assert_eq!(bench.jobs.job(second).unwrap().state, JobStatus::Waiting);
    let from = Instant::now();
    let wanted = JobProgress { done: 3, of: 24, note: "cam: turning".to_owned() };
    while bench.jobs.job(first).unwrap().progress.as_ref() != Some(&wanted) {
        assert!(from.elapsed() < Duration::from_secs(20));
        thread::sleep(Duration::from_millis(5));
    }
    bench.jobs.end();
}

#[test]
fn a_job_ends_within_a_second_wherever_it_is_and_leaves_nothing_unfinished() {
    let bench = Bench::new();
    for work in ["tables", "validate"] {
        let id = bench.jobs.add(long(work)).unwrap().id;
        let behind = bench.jobs.add(long(work)).unwrap().id;
        bench.until(id, JobStatus::Running);
        // It has set its trap.
        thread::sleep(Duration::from_millis(300));
        let pid = bench.jobs.job(id).unwrap().pid.unwrap();
        assert!(bench.jobs.cancel(behind));
        assert_eq!(bench.jobs.job(behind).unwrap().state, JobStatus::Cancelled);
        let from = Instant::now();
        assert!(bench.jobs.cancel(id));
        let job = bench.until(id, JobStatus::Cancelled);
        assert!(from.elapsed() < Duration::from_secs(1), "{work}: {:?}", from.elapsed());
        assert!(!Path::new(&format!("/proc/{pid}")).exists(), "{work} goes on");
        assert!(!bench.place.path().join(&job.out).join(".part-x").exists());
        assert!(!bench.jobs.cancel(id), "there is nothing more to end");
    }
}

#[test]
fn a_server_that_starts_again_finds_what_was_finished_and_ends_what_was_not() {
    let bench = Bench::new();
    let done = bench.jobs.add(look()).unwrap().id;
    bench.until(done, JobStatus::Done);
    let cut = bench.jobs.add(long("tables")).unwrap().id;
    bench.until(cut, JobStatus::Running);
    thread::sleep(Duration::from_millis(300));
    let pid = bench.jobs.job(cut).unwrap().pid.unwrap();
    // The server is gone without a word: nothing of it is asked any more, and its records are as it left them.
    let again = Jobs::new(bench.folder.clone(), program(bench.place.path()), Some(1));
    assert_eq!(again.job(done).unwrap().state, JobStatus::Done);
    let job = again.job(cut).unwrap();
    assert_eq!((job.state, job.said.len()), (JobStatus::Interrupted, 1));
    let from = Instant::now();
    // A process that has ended is a zombie of this one until it is waited for.
    let runs = || fs::read_to_string(format!("/proc/{pid}/stat")).is_ok_and(|stat| !stat.contains(") Z "));
    while cfg!(target_os = "linux") && runs() {
        assert!(from.elapsed() < Duration::from_secs(5), "the orphan goes on");
        thread::sleep(Duration::from_millis(5));
    }
    let next = again.add(look()).unwrap().id;
    assert!(next > cut, "numbers are not given twice");
}

#[test]
fn records_that_are_not_of_this_folder_or_no_records_are_left_alone() {
    let bench = Bench::new();
    let done = bench.jobs.add(look()).unwrap().id;
    let job = bench.until(done, JobStatus::Done);
    let record = |out: &str, text: &str| {
        let place = bench.place.path().join("bench").join(out);
        fs::create_dir_all(&place).unwrap();
        fs::write(place.join("job.json"), text).unwrap();
    };
    let text = serde_json::to_string(&job).unwrap();
    record("look-77", &text);
    record("look-78", &text.replace(&job.out, "../elsewhere"));
    record("look-79", "{");
    std::os::unix::fs::symlink("/etc", bench.place.path().join("bench/look-80")).unwrap();
    let again = Jobs::new(bench.folder.clone(), program(bench.place.path()), Some(1));
    assert_eq!(again.seen().jobs.len(), 1);
}

/// In the folder of a process nobody makes files, root neither.
#[cfg(target_os = "linux")]
#[test]
fn a_folder_where_nobody_may_write_takes_no_job() {
    let place = tempfile::tempdir().unwrap();
    let jobs = Jobs::new(Arc::new(Folder::new(Path::new("/proc/self")).unwrap()), program(place.path()), None);
    let work = WorkAsked::Look { files: vec!["status".to_owned()] };
    let added = jobs.add(work);
    assert!(matches!(&added, Err(JobError::Folder(why)) if why.contains("bench/look-1")), "{added:?}");
    assert!(jobs.seen().jobs.is_empty());
}
