//! The documentation is true where a machine can check: every command on its pages runs, every Rust block compiles,
//! every drive and nominal file in it is read, links and pictures exist, and so do the commands and options that the
//! text names.
//!
//! Pages are all Markdown files of the project. What a fence is marked with says what is done with it:
//!
//! ```text
//! sh             run, block after block, in a copy of the project of each page's own, by the program that was built
//! sh slow        only parsed here; run by `cargo test -- --ignored` (`tests/run slow`)
//! sh firmware    run by `tests/run firmware`, which has to name the page; likewise `sh PART` of a file of tests/parts
//! python         run by the tests of `tests/run python`: only on its page
//! rust           compiled and run as a documentation test: `tests/lib.rs` has to hold the page
//! toml           a drive, or a nominal model if it has [nominal]; `toml cargo` is neither
//! ```
//!
//! Commands that no test runs are in [`NOT_RUN`], with the reason. Any other command fails here.

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use flexspline_identify::extension::Model;
use flexspline_mechanics::drive::Drive;
use flexspline_tests::command::flexspline;
use flexspline_tests::long;

/// Commands that are not run from a page: how they begin, and why.
const NOT_RUN: [(&str, &str); 11] = [
    ("tests/run", "runs this test; its parts are checked by name"),
    ("git clone", "needs the network"),
    ("rustup ", "changes the toolchains of whoever runs the tests"),
    ("cargo install ", "needs the network"),
    ("cargo test ", "is what runs this test"),
    ("cargo doc ", "tests/run site builds the documentation"),
    ("cargo mutants ", "hours"),
    ("cargo build ", "tests/run builds what is built here"),
    ("flexspline-exam ", "minutes to hours: tests/run exam"),
    ("target/release/flexspline-exam ", "likewise"),
    ("prettier ", "tests/run browser checks what it would do"),
];
/// Programs beside ours that a block may call.
const HELPERS: [&str; 10] = ["cd", "cp", "cmp", "mkdir", "cat", "head", "awk", "ls", "rm", "python3"];
/// Parts of `tests/run` that run blocks marked with their name.
const PARTS: [&str; 6] = ["firmware", "bundle", "c_interface", "sweep", "fmu", "python"];
/// The page whose Python is run, by the tests of `host-sim/python`.
const PYTHON: &str = "docs/how-to/python.md";
/// Pictures of examples are small, bytes.
const LARGEST_PICTURE: u64 = 150_000;
/// Lines of an example's page, of 100 columns: a screen and a half.
const LONGEST_EXAMPLE: usize = 80;

/// A fenced block.
#[derive(Debug, Clone)]
struct Block {
    line: usize,
    language: String,
    mark: String,
    text: String,
}

/// A Markdown file.
struct Page {
    /// From the top of the project.
    name: PathBuf,
    blocks: Vec<Block>,
    /// The text between them, line by line with its number.
    prose: Vec<(usize, String)>,
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

fn markdown(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            let left_out = ["target", "out", "node_modules", "corpus", "vendor"].contains(&name.as_str());
            if !left_out && !name.starts_with('.') {
                markdown(&path, found);
            }
        } else if name.ends_with(".md") {
            found.push(path);
        }
    }
}

fn pages() -> Vec<Page> {
    let mut files = Vec::new();
    markdown(root(), &mut files);
    files.into_iter().map(|file| page(&file)).collect()
}

fn page(file: &Path) -> Page {
    let (mut blocks, mut prose, mut open) = (Vec::new(), Vec::new(), None::<Block>);
    for (index, line) in fs::read_to_string(file).unwrap().lines().enumerate() {
        match (line.trim_start().strip_prefix("```"), &mut open) {
            (Some(info), None) => {
                let (language, mark) = info.trim().split_once(' ').unwrap_or((info.trim(), ""));
                let (language, mark) = (language.to_owned(), mark.to_owned());
                open = Some(Block { line: index + 1, language, mark, text: String::new() });
            }
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (None, Some(block)) => block.text += &format!("{line}\n"),
            (None, None) => prose.push((index + 1, line.to_owned())),
        }
    }
    assert!(open.is_none(), "{}: a fence is not closed", file.display());
    Page { name: file.strip_prefix(root()).unwrap().to_owned(), blocks, prose }
}

impl Page {
    fn at(&self, line: usize) -> String {
        format!("{}:{line}", self.name.display())
    }

    fn shell(&self) -> impl Iterator<Item = &Block> {
        self.blocks.iter().filter(|block| block.language == "sh")
    }
}

/// Check of a page's command.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Ours,
    Helper,
    NotRun,
}

/// Logical lines of a block and what they are.
fn commands(text: &str) -> Result<Vec<(String, Kind)>, String> {
    let joined = text.replace("\\\n", " ");
    let lines = joined.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "));
    lines
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .map(|line| {
            let word = line.split(' ').next().unwrap_or_default();
            let kind = if word == "flexspline" || line.starts_with("cargo run --release -- ") {
                Kind::Ours
            } else if HELPERS.contains(&word) {
                Kind::Helper
            } else if NOT_RUN.iter().any(|(begins, _)| line.starts_with(begins)) {
                Kind::NotRun
            } else {
                return Err(format!("no test runs `{line}`"));
            };
            Ok((line, kind))
        })
        .collect()
}

/// A copy of the project to run in, with our program in the place of cargo's.
struct Copy {
    folder: tempfile::TempDir,
    /// Commands are only parsed.
    parse: bool,
}

fn copied(from: &Path, to: &Path) {
    fs::create_dir(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let to = to.join(entry.file_name());
        if entry.file_name() == "target" {
            // Of an example that was built in its own folder.
        } else if entry.path().is_dir() {
            copied(&entry.path(), &to);
        } else {
            fs::copy(entry.path(), to).unwrap();
        }
    }
}

impl Copy {
    fn new(parse: bool) -> Copy {
        let folder = tempfile::tempdir().unwrap();
        let (project, programs) = (folder.path().join("project"), folder.path().join("programs"));
        fs::create_dir(&project).unwrap();
        fs::create_dir(&programs).unwrap();
        for entry in fs::read_dir(root()).unwrap() {
            let entry = entry.unwrap();
            let name = entry.file_name();
            match name.to_str().unwrap() {
                "out" | "target" | ".git" => {}
                // Examples may write beside themselves.
                "examples" => copied(&entry.path(), &project.join(name)),
                _ => symlink(entry.path(), project.join(name)).unwrap(),
            }
        }
        let help = if parse { " --help > /dev/null" } else { "" };
        let ours = format!("#!/bin/sh\nexec '{}' \"$@\"{help}\n", flexspline().display());
        let cargo = "#!/bin/sh\n[ \"$1 $2 $3\" = 'run --release --' ] || exit 99\nshift 3\nexec flexspline \"$@\"\n";
        for (name, script) in [("flexspline", ours.as_str()), ("cargo", cargo)] {
            fs::write(programs.join(name), script).unwrap();
            fs::set_permissions(programs.join(name), fs::Permissions::from_mode(0o755)).unwrap();
        }
        Copy { folder, parse }
    }

    /// Runs commands as they stand; the error says which and what it said.
    fn run(&self, commands: &[(String, Kind)]) -> Result<(), String> {
        let wanted = commands.iter().filter(|(_, kind)| match kind {
            Kind::Ours => true,
            Kind::Helper => !self.parse,
            Kind::NotRun => false,
        });
        let script: String = wanted.map(|(line, _)| format!("{line}\n")).collect();
        let path = format!("{}:/usr/bin:/bin", self.folder.path().join("programs").display());
        let output = Command::new("sh")
            .args(["-e", "-c", &script])
            .current_dir(self.folder.path().join("project"))
            .env("PATH", path)
            .stdin(Stdio::null())
            .output()
            .unwrap();
        let said = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let ending = || format!("{}\n{script}{}{}", output.status, said(&output.stdout), said(&output.stderr));
        output.status.success().then_some(()).ok_or_else(ending)
    }
}

/// Blocks that are slow are parsed alone, and run in the long form.
#[test]
#[ignore = "long: tests/run slow"]
fn every_command_of_a_page_runs() {
    let mut wrong = Vec::new();
    for page in pages().iter().filter(|page| page.shell().next().is_some()) {
        let [copy, parser] = [false, true].map(Copy::new);
        for block in page.shell().filter(|block| !PARTS.contains(&block.mark.as_str())) {
            let clock = std::time::Instant::now();
            let desk = if block.mark == "slow" && !long() { &parser } else { &copy };
            if let Err(error) = commands(&block.text).and_then(|commands| desk.run(&commands)) {
                wrong.push(format!("{}: {error}", page.at(block.line)));
            }
            println!("{:6.1} s {} {}", clock.elapsed().as_secs_f64(), page.at(block.line), block.mark);
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

/// The first commands that the README gives to each reader run as they stand after its block: they are spans in a
/// table, of which [`commands_and_options_in_the_text_exist`] reads the names alone. What serves does not end: its
/// options are parsed.
#[test]
fn first_commands_of_the_readme_run() {
    let page = page(&root().join("README.md"));
    let [copy, parser] = [false, true].map(Copy::new);
    for block in page.shell() {
        copy.run(&commands(&block.text).unwrap()).unwrap();
    }
    let lines = page.prose.iter().skip_while(|(_, line)| line != "## Who are you?").skip(1);
    let rows = lines.take_while(|(_, line)| !line.starts_with('#')).filter(|(_, line)| line.starts_with('|'));
    let mut ran = 0;
    for (line, span) in rows.flat_map(|(line, text)| spans(text).map(move |span| (line, span))) {
        let desk = if span.starts_with("flexspline serve") { &parser } else { &copy };
        let done = commands(span).and_then(|commands| desk.run(&commands));
        assert_eq!(done, Ok(()), "{}: `{span}`", page.at(*line));
        ran += 1;
    }
    assert_eq!(ran, 6);
}

/// `tests/run` with its parts.
fn runner() -> String {
    let parts = fs::read_dir(root().join("tests/parts")).unwrap().map(|entry| entry.unwrap().path());
    let files = parts.chain([root().join("tests/run")]);
    files.map(|file| fs::read_to_string(file).unwrap()).collect()
}

#[test]
fn every_block_says_what_it_is() {
    let lib = fs::read_to_string(root().join("tests/lib.rs")).unwrap();
    let runner = runner();
    let mut wrong = Vec::new();
    for page in pages() {
        let name = page.name.to_str().unwrap();
        for block in &page.blocks {
            let said = match (block.language.as_str(), block.mark.as_str()) {
                ("sh", "" | "slow") | ("text" | "math" | "json" | "c" | "csv" | "diff", "") => Ok(()),
                ("sh", part) if PARTS.contains(&part) => {
                    let runs = format!("page {name} {part}");
                    runner.contains(&runs).then_some(()).ok_or(format!("tests/run does not hold `{runs}`"))
                }
                ("rust", "") => {
                    let held = format!("include_str!(\"../{name}\")");
                    lib.contains(&held).then_some(()).ok_or(format!("tests/lib.rs does not hold {held}"))
                }
                ("python", "") => (name == PYTHON).then_some(()).ok_or(format!("only those of {PYTHON} are run")),
                ("toml", "cargo") => Ok(()),
                ("toml", "") => read_toml(name, &block.text),
                (language, mark) => Err(format!("`{language} {mark}` is no kind of block")),
            };
            if let Err(error) = said {
                wrong.push(format!("{}: {error}", page.at(block.line)));
            }
            if language_is_run(block) {
                let named = |(line, _): &(String, Kind)| line.starts_with("tests/run").then(|| line.clone());
                for line in commands(&block.text).into_iter().flatten().filter_map(|command| named(&command)) {
                    for word in line.split(" #").next().unwrap().split(' ').skip(1).filter(|word| !word.is_empty()) {
                        let part = root().join("tests/parts").join(word).is_file();
                        let part = part || ["--long", "--changed", "nightly"].contains(&word);
                        if !part {
                            wrong.push(format!("{}: tests/run has no part {word}", page.at(block.line)));
                        }
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

fn language_is_run(block: &Block) -> bool {
    block.language == "sh" && !PARTS.contains(&block.mark.as_str())
}

/// A drive, or a catalogue's model, extended or not.
fn read_toml(name: &str, text: &str) -> Result<(), String> {
    let read = if text.contains("[nominal") {
        Model::from_toml(name, text).map(|_| ())
    } else {
        Drive::from_toml(name, text).map(|_| ())
    };
    read.map_err(|error| error.to_string())
}

#[test]
fn every_file_of_an_example_is_read() {
    let mut read = 0;
    for folder in examples() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.display().to_string();
            if path.extension().is_some_and(|kind| kind == "toml") && !name.ends_with("Cargo.toml") {
                read_toml(&name, &fs::read_to_string(&path).unwrap()).unwrap();
                read += 1;
            }
        }
    }
    assert!(read >= 3, "{read} files");
}

/// Folders with an example in them.
fn examples() -> Vec<PathBuf> {
    let folders = fs::read_dir(root().join("examples")).unwrap().map(|entry| entry.unwrap().path());
    folders.filter(|path| path.join("README.md").exists()).collect()
}

#[test]
fn every_example_has_a_page_of_one_screen_and_a_small_picture() {
    let examples = examples();
    assert!(examples.len() >= 5, "{examples:?}");
    for folder in examples {
        let page = page(&folder.join("README.md"));
        let name = page.name.display();
        let lines = page.prose.len() + page.blocks.iter().map(|block| block.text.lines().count() + 2).sum::<usize>();
        assert!(lines <= LONGEST_EXAMPLE, "{name}: {lines} lines");
        assert!(page.shell().next().is_some(), "{name}: no command");
        let pictures: Vec<PathBuf> = links(&page)
            .into_iter()
            .filter(|link| link.target.ends_with(".png"))
            .map(|link| folder.join(&link.target))
            .collect();
        assert!(!pictures.is_empty(), "{name}: no picture");
        for picture in pictures {
            let bytes = fs::metadata(&picture).unwrap().len();
            assert!(bytes <= LARGEST_PICTURE, "{}: {bytes} bytes", picture.display());
        }
    }
}

/// A link of a page.
struct Link {
    line: usize,
    target: String,
}

fn links(page: &Page) -> Vec<Link> {
    let mut found = Vec::new();
    for (line, text) in &page.prose {
        let mut from = 0;
        while let Some(at) = text[from..].find("](") {
            let target = text[from + at + 2..].split(')').next().unwrap_or_default().to_owned();
            found.push(Link { line: *line, target });
            from += at + 2;
        }
    }
    found
}

/// The anchors that GitHub gives the headings of a page.
fn anchors(file: &Path) -> BTreeSet<String> {
    let page = page(file);
    let headings = page.prose.iter().filter_map(|(_, line)| line.strip_prefix('#'));
    headings
        .map(|heading| {
            let heading = heading.trim_start_matches('#').trim().to_lowercase();
            let kept = heading.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
            kept.map(|c| if c == ' ' { '-' } else { c }).collect()
        })
        .collect()
}

/// Links lead somewhere.
#[test]
fn links_lead_somewhere() {
    let mut wrong = Vec::new();
    for page in pages() {
        for link in links(&page) {
            if link.target.contains("://") || link.target.starts_with("mailto:") {
                continue;
            }
            let (path, anchor) = link.target.split_once('#').unwrap_or((&link.target, ""));
            let this = root().join(&page.name);
            let file = if path.is_empty() { this } else { this.parent().unwrap().join(path) };
            let place = page.at(link.line);
            if !file.exists() {
                wrong.push(format!("{place}: {} does not exist", link.target));
            } else if !anchor.is_empty() && !anchors(&file).contains(anchor) {
                wrong.push(format!("{place}: {} has no heading #{anchor}", file.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Spans of code in a line.
fn spans(line: &str) -> impl Iterator<Item = &str> {
    line.split('`').skip(1).step_by(2)
}

/// Commands and options that the text names are there.
#[test]
fn commands_and_options_in_the_text_exist() {
    let help = |args: &[&str]| {
        let output = Command::new(flexspline()).args(args).arg("-h").output().unwrap();
        assert!(output.status.success(), "{args:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let top = help(&[]);
    let (listed, _) = top.split_once("Common options:").unwrap();
    let commands: BTreeSet<&str> = listed
        .lines()
        .filter(|l| l.starts_with("  ") && !l.starts_with("   ") && !l.starts_with("  flexspline "))
        .filter_map(|l| l.split_whitespace().next())
        .collect();
    assert!(commands.contains("tables") && commands.contains("diagnose"), "{commands:?}");
    let mut known = fs::read_to_string(root().join("tests/run")).unwrap();
    for command in commands.iter().filter(|command| **command != "help") {
        known += &help(&[command]);
    }
    for step in ["plan", "run", "reduce"] {
        known += &help(&["sweep", step]);
    }
    let mut wrong = Vec::new();
    // What changed is not what is: the change log is history.
    for page in pages().iter().filter(|page| page.name != Path::new("CHANGELOG.md")) {
        let ours = page.name == Path::new("README.md")
            || page.name == Path::new("ARCHITECTURE.md")
            || page.name.starts_with("docs")
            || page.name.starts_with("examples");
        for (line, text) in &page.prose {
            for span in spans(text) {
                let word = span.strip_prefix("flexspline ").and_then(|rest| rest.split(' ').next()).unwrap_or("");
                if !word.is_empty() && word.chars().all(|c| c.is_ascii_lowercase()) && !commands.contains(word) {
                    wrong.push(format!("{}: `{span}`: no command {word}", page.at(*line)));
                }
                let others = ["cargo ", "probe-rs ", "prettier "].iter().any(|program| span.starts_with(program));
                let options = span.split([' ', '=']).filter(|word| word.starts_with("--") && word.len() > 2);
                for option in options.filter(|_| ours && !others) {
                    if !known.contains(option) {
                        wrong.push(format!("{}: `{span}`: no option {option}", page.at(*line)));
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
