//! Context of every command: the drive, the output folder, the terminal, the request to stop.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use serde::Serialize;

use flexspline::{Identity, IdentityCheck, Table};

use super::{Common, Failure, bad_file, bad_input, say};
pub(super) use flexspline_base::output::quoted;
use flexspline_base::output::{keep, prepare_folder};
use flexspline_base::progress::Progress;
use flexspline_base::spent::{Spent, Stopwatch};
use flexspline_base::suggest::{likeliest, question};
use flexspline_design::stated::Stated;
use flexspline_mechanics::drive::{Drive, GeneratorKind};

/// Folder for output files where none is given.
const OUT: &str = "out";

/// The common options, at work.
pub(super) struct Context {
    common: Common,
    /// The command line as it was given.
    pub(super) command: String,
    args: Vec<OsString>,
    clock: Stopwatch,
}

impl Context {
    pub(super) fn new(common: Common, args: &[OsString]) -> Context {
        let words = args.iter().skip(1).map(|arg| quoted(&arg.to_string_lossy()));
        let command = ["flexspline".to_owned()].into_iter().chain(words).collect::<Vec<_>>().join(" ");
        Context { common, command, args: args.to_vec(), clock: Stopwatch::start() }
    }

    /// Keeps the files that the command line names from being replaced.
    pub(super) fn keep_files_named(&self) {
        let words = self.args.iter().skip(1).map(|arg| arg.to_string_lossy());
        for word in words {
            let value = word.strip_prefix("--").and_then(|option| Some(option.split_once('=')?.1));
            let path = Path::new(value.unwrap_or(&word));
            if path.is_file() {
                keep(path);
            }
        }
    }

    /// Runs `work` on as many threads as were asked for.
    pub(super) fn with_threads<R: Send>(&self, work: impl FnOnce() -> Result<R, Failure> + Send) -> Result<R, Failure> {
        let threads = self.common.threads.map_or(0, usize::from);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|error| Failure::Failed(format!("cannot start {threads} threads: {error}")))?;
        pool.install(work)
    }

    /// The drive of `--drive` with every `--set`.
    pub(super) fn drive(&self) -> Result<Drive, Failure> {
        self.drive_called("--drive", &self.common.drive)
    }

    /// A drive file or a built-in drive, as the option says, with every `--set`.
    pub(super) fn drive_called(&self, option: &str, name: &str) -> Result<Drive, Failure> {
        let drive = match Drive::built_in(name) {
            Some(drive) => drive,
            None => {
                let text = std::fs::read_to_string(name).map_err(|error| {
                    let known = Drive::BUILT_IN.join(", ");
                    let meant = likeliest(name, Drive::BUILT_IN).map(str::to_owned).or_else(|| file_like(name));
                    let hint = meant.map_or_else(String::new, |meant| format!("; {}", question(&meant)));
                    Failure::BadInput(format!(
                        "{option}: found {name:?}, which cannot be read as a file ({error}); allowed: a drive file, \
                         or one of the built-in drives {known}{hint}"
                    ))
                })?;
                let drive = Drive::from_toml(name, &text).map_err(bad_input)?;
                Stated::of_file(name, &text).map_err(bad_input)?;
                drive
            }
        };
        self.with_sets(drive)
    }

    /// A drive with every `--set`.
    pub(super) fn with_sets(&self, drive: Drive) -> Result<Drive, Failure> {
        drive.with_sets(self.common.sets.iter().map(String::as_str)).map_err(bad_input)
    }

    /// Whether a drive other than the usual one was asked for.
    pub(super) fn has_drive(&self) -> bool {
        self.common.drive != super::USUAL_DRIVE
    }

    /// The option that asks for another drive than the usual one, if there is one.
    pub(super) fn changes_the_drive(&self) -> Option<&'static str> {
        let by_set = || (!self.common.sets.is_empty()).then_some("--set");
        if self.has_drive() { Some("--drive") } else { by_set() }
    }

    /// Refuses --drive and --set with a command that has no use for them; `why` says where the drive is.
    pub(super) fn refuse_drive(&self, why: &str) -> Result<(), Failure> {
        self.changes_the_drive().map_or(Ok(()), |option| Err(Failure::BadInput(format!("{option}: {why}"))))
    }

    /// A title of the drive, and that it is not as its file or its name has it.
    pub(super) fn titled(&self, title: &str) -> String {
        match Drive::fields_set(self.common.sets.iter().map(String::as_str)) {
            0 => title.to_owned(),
            1 => format!("{title}, with 1 field changed"),
            count => format!("{title}, with {count} fields changed"),
        }
    }

    /// The last value that `--set` gives to this field.
    pub(super) fn set_to(&self, path: &str) -> Option<&str> {
        let assignments = self.common.sets.iter().flat_map(|set| set.split(','));
        let values = assignments.filter_map(|set| set.split_once('=')).filter(|(set, _)| set.trim() == path);
        values.map(|(_, value)| value.trim().trim_matches('"')).next_back()
    }

    /// A command to type next, of the same drive.
    pub(super) fn next(&self, words: &str) -> String {
        let mut command = format!("flexspline {words}");
        if self.has_drive() {
            command += &format!(" --drive {}", quoted(&self.common.drive));
        }
        for set in &self.common.sets {
            command += &format!(" --set {}", quoted(set));
        }
        command
    }

    /// Name and text of the file of `--drive`; nothing for a built-in drive.
    pub(super) fn drive_file(&self) -> Option<(&str, String)> {
        let name = self.common.drive.as_str();
        if Drive::built_in(name).is_some() {
            return None;
        }
        std::fs::read_to_string(name).ok().map(|text| (name, text))
    }

    /// Data sheet of the drive of `--drive`, where its file has one.
    pub(super) fn stated(&self) -> Result<Option<Stated>, Failure> {
        let Some((name, text)) = self.drive_file() else { return Ok(None) };
        Stated::of_file(name, &text).map_err(bad_input)
    }

    /// The output folder, which can be written to.
    pub(super) fn out(&self) -> Result<&Path, Failure> {
        let out = self.out_path();
        prepare_folder(out).map_err(|error| Failure::BadInput(format!("--out: {error}")))?;
        Ok(out)
    }

    /// The output folder for a plan whose plan.csv begins with the column `first`; refuses one with another plan.
    pub(super) fn out_for_plan(&self, first: &str) -> Result<&Path, Failure> {
        let plan = self.out_path().join("plan.csv");
        if std::fs::read_to_string(&plan).is_ok_and(|text| text.split(',').next() != Some(first)) {
            let what =
                format!("found {}, a plan of another command; give another folder, or remove it", plan.display());
            return Err(Failure::BadInput(format!("--out: {what}")));
        }
        self.out()
    }

    /// The output folder, whether it is there or not.
    pub(super) fn out_path(&self) -> &Path {
        self.common.out.as_deref().unwrap_or(Path::new(OUT))
    }

    /// Whether an output folder was given.
    pub(super) fn has_out(&self) -> bool {
        self.common.out.is_some()
    }

    /// A progress bar for work called `title`.
    pub(super) fn progress(&self, title: &str) -> Progress {
        Progress::new(title, self.common.quiet)
    }

    /// Time and processor time of the command so far.
    pub(super) fn spent(&self) -> Spent {
        self.clock.spent()
    }

    pub(super) fn quiet(&self) -> bool {
        self.common.quiet
    }

    pub(super) fn verbose(&self) -> bool {
        self.common.verbose
    }

    /// Prints data that the command is for: as JSON if that was asked for, else as they are.
    pub(super) fn print_data(&self, result: &impl Serialize, data: impl FnOnce() -> String) -> Result<(), Failure> {
        if self.common.json { self.print(result, String::new) } else { say::data(&data()) }
    }

    /// Prints the result: as JSON if that was asked for, else as text unless quiet.
    pub(super) fn print(&self, result: &impl Serialize, text: impl FnOnce() -> String) -> Result<(), Failure> {
        if self.common.json {
            let json = serde_json::to_string_pretty(result)
                .map_err(|error| Failure::Failed(format!("cannot print the result: {error}")))?;
            say::data(&json)
        } else if !self.common.quiet {
            say::result(&text())
        } else {
            Ok(())
        }
    }
}

/// The table of a generator in a folder that `flexspline tables` wrote: its file and its bytes, not looked at yet.
pub(super) fn table_image(folder: &Path, generator: GeneratorKind) -> Result<(PathBuf, Vec<u8>), Failure> {
    let path = folder.join(format!("{generator}.fxt"));
    if folder.is_file() {
        let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let kind =
            folder.file_stem().and_then(|stem| stem.to_str()).and_then(|stem| stem.parse::<GeneratorKind>().ok());
        let option = kind.map_or_else(String::new, |kind| format!(" --generator {kind}"));
        return Err(Failure::BadInput(format!(
            "--tables: found the file {}; allowed: a folder that `flexspline tables` wrote, here --tables {}{option}",
            folder.display(),
            quoted(&parent.display().to_string())
        )));
    }
    if path.is_file() {
        return image_file(&path).map(|bytes| (path, bytes));
    }
    let there = |kind: &GeneratorKind| folder.join(format!("{kind}.fxt")).exists();
    let others: Vec<&str> = GeneratorKind::ALL.iter().filter(|kind| there(kind)).map(|kind| kind.name()).collect();
    Err(Failure::BadInput(match others.as_slice() {
        [] => format!(
            "--tables: found no {generator}.fxt in {}; allowed: a folder that `flexspline tables` wrote",
            folder.display()
        ),
        names => format!(
            "{}: not there; the folder holds the tables of {}: --generator {}",
            path.display(),
            names.join(", "),
            names[0]
        ),
    }))
}

/// The bytes of an image, sound or not; one that is sound but not of its id, as the identity is found in flight, is
/// refused here.
pub(super) fn image_file(path: &Path) -> Result<Vec<u8>, Failure> {
    if path.is_dir() {
        return Err(bad_file(path)("found a folder; allowed: a table image, FILE.fxt"));
    }
    keep(path);
    let bytes = std::fs::read(path).map_err(bad_file(path))?;
    if let Ok(table) = Table::check(&bytes) {
        let mut check = IdentityCheck::new();
        let found = loop {
            match check.step(&bytes) {
                Identity::Hashing => {}
                Identity::Same(id) | Identity::Other(id) => break id,
            }
        };
        if found != table.id() {
            return Err(bad_file(path)(format!(
                "its contents have the id {found}, and it says {}: it was changed after it was made; make it anew",
                table.id()
            )));
        }
    }
    Ok(bytes)
}

/// The table in the image of this file.
pub(super) fn table_of<'a>(path: &Path, image: &'a [u8]) -> Result<Table<'a>, Failure> {
    Table::check(image).map_err(bad_file(path))
}

/// A drive file in the folder of the one that is not there, with a name like it.
fn file_like(name: &str) -> Option<String> {
    let path = Path::new(name);
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let entries = std::fs::read_dir(folder.unwrap_or(Path::new("."))).ok()?;
    let names: Vec<String> = entries
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| name.ends_with(".toml"))
        .collect();
    let like = likeliest(path.file_name()?.to_str()?, names.iter().map(String::as_str))?;
    Some(folder.map_or_else(|| like.to_owned(), |folder| folder.join(like).display().to_string()))
}
