//! The page of requirements: every one has an id of its own and a test, and every test that is named exists.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn top() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn rust_files(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path()) {
        if entry.is_dir() {
            rust_files(&entry, files);
        } else if entry.extension().is_some_and(|extension| extension == "rs") {
            files.push(entry);
        }
    }
}

/// Names of functions under `#[test]`.
fn tests() -> BTreeSet<String> {
    let mut files = Vec::new();
    rust_files(&top().join("core"), &mut files);
    let mut names = BTreeSet::new();
    for file in files {
        let text = fs::read_to_string(file).expect("source");
        for after in text.split("#[test]").skip(1) {
            let name = after.split("fn ").nth(1).and_then(|rest| rest.split('(').next());
            names.insert(name.expect("a function").to_owned());
        }
    }
    names
}

/// Faults of a page, given the existing tests and checks.
fn faults(page: &str, tests: &BTreeSet<String>, run: &str) -> Vec<String> {
    let (mut ids, mut faults) = (BTreeSet::new(), Vec::new());
    for row in page.lines().filter(|line| line.starts_with("| C-")) {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let &[_, id, _, named, _] = &cells[..] else {
            faults.push(format!("three columns: {row}"));
            continue;
        };
        if !ids.insert(id) {
            faults.push(format!("{id} is there twice"));
        }
        let names: Vec<&str> = named.split(", ").filter(|name| !name.is_empty()).collect();
        if names.is_empty() {
            faults.push(format!("{id} has no test"));
        }
        for name in names {
            let test = name.trim_matches('`');
            let check = name.strip_prefix('"').map(|rest| rest.trim_end_matches('"'));
            let exists = check.map_or(tests.contains(test), |check| run.contains(check));
            if !exists {
                faults.push(format!("{id}: {name} does not exist"));
            }
        }
    }
    let rows = page.lines().filter(|line| line.starts_with("| ") && line.matches('|').count() == 6);
    for row in rows.skip(1) {
        let requirement = row.split('|').nth(4).expect("a column").trim();
        for id in requirement.split(", ").filter(|id| id.starts_with("C-")) {
            if !ids.contains(id) {
                faults.push(format!("no requirement {id}: {row}"));
            }
        }
    }
    if ids.is_empty() {
        faults.push("no requirement".to_owned());
    }
    faults
}

#[test]
fn every_requirement_has_tests_that_exist() {
    let page = read("docs/requirements.md");
    let parts = ["firmware", "proofs", "bundle", "c99"].map(|part| read(&format!("tests/parts/{part}")));
    let run = parts.concat() + &read("tests/proofs/contracts.txt");
    assert_eq!(faults(&page, &tests(), &run), Vec::<String>::new());
    assert!(page.lines().filter(|line| line.starts_with("| C-")).count() > 40);
}

fn read(path: &str) -> String {
    fs::read_to_string(top().join(path)).expect("a file of the project")
}

/// Words between backticks.
fn spans(cell: &str) -> impl Iterator<Item = &str> {
    cell.split('`').skip(1).step_by(2)
}

/// Rows of the auditor's page that name a function of Rust or C99, or a requirement, that is none.
fn lost_steps(page: &str) -> Vec<String> {
    let (requirements, reader) = (read("docs/requirements.md"), read("core/c99/flexspline_table.c"));
    let definitions: Vec<&str> = reader.lines().filter(|line| line.starts_with(char::is_alphabetic)).collect();
    let known = |row: &&str| {
        let &[_, rust, c99, _, ids, _] = &row.split('|').collect::<Vec<_>>()[..] else { return false };
        let mut names = spans(rust);
        let (file, function) = (names.next().unwrap_or_default(), names.next().unwrap_or_default());
        let source = fs::read_to_string(top().join("core/src").join(file)).unwrap_or_default();
        let mut ids = ids.trim().split(", ");
        ["(", "<"].iter().any(|after| source.contains(&format!("fn {function}{after}")))
            && spans(c99).all(|name| definitions.iter().any(|line| line.contains(&format!(" {name}("))))
            && ids.all(|id| requirements.contains(&format!("| {id} |")))
    };
    page.lines().filter(|line| line.contains(".rs`] `")).filter(|row| !known(row)).map(str::to_owned).collect()
}

#[test]
fn every_step_of_the_tick_is_a_function_of_its_file() {
    let page = read("docs/reference/tick.md");
    assert_eq!(lost_steps(&page), Vec::<String>::new());
    assert!(page.lines().filter(|line| line.contains(".rs`] `")).count() > 18);
    assert!(lost_steps("| [`play.rs`] `follow` | `play_update` | x | C-16 |").is_empty());
    for row in [
        "| [`play.rs`] `fly` | `play_update` | x | C-16 |",
        "| [`player.rs`] `follow` | `play_update` | x | C-16 |",
        "| [`play.rs`] `follow` | `play_updated` | x | C-16 |",
        "| [`play.rs`] `follow` | `play_update` | x | C-00 |",
    ] {
        assert_eq!(lost_steps(row), [row]);
    }
}

#[test]
fn costs_of_a_tick_are_those_that_are_checked() {
    let (page, budget) = (read("docs/reference/tick.md"), read("tests/firmware/budget"));
    let bounds: BTreeSet<&str> =
        budget.lines().filter_map(|line| line.split_once(' ')).map(|(_, bound)| bound).collect();
    let (_, costs) = page.split_once("## What it costs").expect("the chapter");
    let numbers: Vec<&str> =
        costs.split(['|', '\n']).map(str::trim).filter(|cell| cell.parse::<u32>().is_ok()).collect();
    assert!(numbers.len() > 15);
    assert_eq!(numbers.iter().filter(|number| !bounds.contains(*number)).collect::<Vec<_>>(), Vec::<&&str>::new());
}

#[test]
fn a_page_with_faults_is_refused() {
    let tests = BTreeSet::from(["one".to_owned()]);
    let refused = |page: &str| faults(page, &tests, "check \"bits and ticks\" x");
    assert_eq!(refused("| C-1 | does | `one`, \"bits\" |"), Vec::<String>::new());
    assert_eq!(refused("| C-1 | does | `two` |"), ["C-1: `two` does not exist"]);
    assert_eq!(refused("| C-1 | does | \"bytes\" |"), ["C-1: \"bytes\" does not exist"]);
    assert_eq!(refused("| C-1 | does |  |"), ["C-1 has no test"]);
    assert_eq!(refused("| C-1 | does | `one` |\n| C-1 | too | `one` |"), ["C-1 is there twice"]);
    let effects = "| C-1 | does | `one` |\n| a | b | c | d | e |\n| f | g | h | C-2 | i |";
    assert_eq!(refused(effects), ["no requirement C-2: | f | g | h | C-2 | i |"]);
    assert_eq!(refused(""), ["no requirement"]);
}
