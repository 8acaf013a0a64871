//! Requests of a page: one command of `flexspline` each, whose words are made here.
//!
//! A page sends numbers and names; the words of the command line are put together from them, each option and its value
//! as one word (`--set=generator.w0_mm=0.5`), with no shell. A value so cannot become an option, nor one word two.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::folder::{Folder, FolderError, is_plain};
use flexspline_base::output::quoted;
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;

/// Logs of one job, at most: a guess.
const MOST_LOGS: usize = 50;
/// Fields that a page changes at once, at most: there are some seventy (a bound above them).
const MOST_SETS: usize = 100;
/// Characters of a free value (columns, a list of numbers), at most: a guess; one number for each of 2000 teeth fits.
const LONGEST_VALUE: usize = 20_000;

/// Increments to a tooth pitch of a first look: the lower limit of what a settled pitch has.
const FIRST_LOOK: f64 = 8.0;

/// Why a request makes no command.
#[derive(Debug, Error)]
pub enum WorkError {
    /// A name that is none, or a file that is not there.
    #[error("{0}: {1}")]
    File(&'static str, FolderError),
    /// A value that is none.
    #[error("{what}: found {found:?}, allowed: {allowed}")]
    Value {
        /// Of what.
        what: &'static str,
        /// It.
        found: String,
        /// The values allowed.
        allowed: String,
    },
}

fn refuse<T>(what: &'static str, found: impl ToString, allowed: impl Into<String>) -> Result<T, WorkError> {
    let found: String = found.to_string().chars().take(80).collect();
    Err(WorkError::Value { what, found, allowed: allowed.into() })
}

/// A drive, as the bench of a drive has it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveAsked {
    /// A built-in drive, or a drive file of the folder.
    pub drive: String,
    /// Fields that differ, by path.
    #[serde(default)]
    pub sets: BTreeMap<String, String>,
}

/// Knowledge of a unit before it is measured: one of them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownOfUnit {
    /// The ratio alone.
    #[serde(default)]
    pub ratio: Option<f64>,
    /// A catalogue model of the folder.
    #[serde(default)]
    pub model: Option<String>,
    /// A folder of tables.
    #[serde(default)]
    pub tables: Option<String>,
}

/// A command.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "work", rename_all = "kebab-case", deny_unknown_fields)]
pub enum WorkAsked {
    /// Contents of log files.
    Look {
        /// The logs.
        files: Vec<String>,
    },
    /// Logs to the table of a unit.
    Calibrate {
        /// The logs.
        files: Vec<String>,
        /// `--columns`.
        columns: Option<String>,
        /// Knowledge of the unit.
        known: KnownOfUnit,
    },
    /// Difference of a log from the simulation, and its causes.
    Diagnose {
        /// The log.
        file: String,
        /// `--columns`.
        columns: Option<String>,
        /// Knowledge of the unit: a model or tables.
        known: KnownOfUnit,
        /// Causes that are not considered.
        #[serde(default)]
        without: Vec<String>,
    },
    /// Residual of a log with a table.
    Replay {
        /// The log.
        file: String,
        /// `--columns`.
        columns: Option<String>,
        /// The table image.
        table: String,
    },
    /// A pitch of contact FEM.
    Simulate {
        /// The drive.
        drive: DriveAsked,
        /// The generator.
        generator: GeneratorKind,
        /// Load at the output, N·m.
        torque_n_m: f64,
        /// How fine.
        mesh: MeshLevel,
    },
    /// Figures of a catalogue: backlash, K1 to K3, stresses.
    Sheet {
        /// The drive.
        drive: DriveAsked,
        /// The generator.
        generator: GeneratorKind,
    },
    /// Tables of a drive.
    Tables {
        /// The drive.
        drive: DriveAsked,
        /// The generator.
        generator: GeneratorKind,
        /// How fine.
        mesh: MeshLevel,
        /// Largest load, N·m, if not the usual one.
        #[serde(default)]
        torque_n_m: Option<f64>,
        /// Whether the data sheet of the drive's file completes them.
        #[serde(default)]
        complete: bool,
    },
    /// A table of samples of another program.
    Samples {
        /// The samples.
        file: String,
        /// The drive that they are of.
        drive: DriveAsked,
        /// The generator.
        generator: GeneratorKind,
    },
    /// Tables against fresh FEM.
    Validate {
        /// Folder of the tables.
        tables: String,
        /// The drive.
        drive: DriveAsked,
        /// The generator.
        generator: GeneratorKind,
    },
    /// Tables and their reader for firmware.
    Bundle {
        /// A table image, or a folder of them.
        tables: String,
    },
    /// A drive of a few numbers.
    New {
        /// The file, which is not there yet.
        file: String,
        /// Its subject.
        of: NewOf,
    },
}

/// Inputs of a new drive.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum NewOf {
    /// A size of a catalogue, `CSG-25-80`.
    Like(String),
    /// Teeth and module.
    Numbers {
        /// Teeth of the flexspline.
        teeth: u32,
        /// Module, mm.
        module_mm: f64,
    },
}

/// A command, ready to run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Words {
    /// Arguments of the program.
    pub arguments: Vec<String>,
    /// The file in the job's folder that takes what the command prints, if it is to be kept.
    pub printed_to: Option<&'static str>,
}

impl WorkAsked {
    /// Its name: that of the command.
    pub fn name(&self) -> &'static str {
        match self {
            WorkAsked::Look { .. } => "look",
            WorkAsked::Calibrate { .. } => "calibrate",
            WorkAsked::Diagnose { .. } => "diagnose",
            WorkAsked::Replay { .. } => "replay",
            WorkAsked::Simulate { .. } => "simulate",
            WorkAsked::Sheet { .. } => "sweep",
            WorkAsked::Tables { .. } | WorkAsked::Samples { .. } => "tables",
            WorkAsked::Validate { .. } => "validate",
            WorkAsked::Bundle { .. } => "bundle",
            WorkAsked::New { .. } => "new",
        }
    }

    /// Whether somebody waits for it with the page open: seconds, not minutes.
    pub fn is_short(&self) -> bool {
        !matches!(self, WorkAsked::Tables { .. } | WorkAsked::Validate { .. } | WorkAsked::Bundle { .. })
    }

    /// Its words, results going to the folder `out`.
    ///
    /// # Errors
    /// A name is no plain one, a file is not there, or a number is none.
    pub fn words(&self, folder: &Folder, out: &str) -> Result<Words, WorkError> {
        let mut words = CommandLine { folder, arguments: vec![self.name().to_owned()] };
        match self {
            WorkAsked::Look { files } => {
                words.logs(files)?;
                words.word("--json");
            }
            WorkAsked::Calibrate { files, columns, known } => {
                words.logs(files)?;
                words.word("--split");
                words.known(known, true)?;
                words.columns(columns)?;
            }
            WorkAsked::Diagnose { file, columns, known, without } => {
                words.file("file", file)?;
                words.known(known, false)?;
                for cause in without {
                    if without.len() > MOST_SETS || !cause.chars().all(|c| c.is_ascii_lowercase() || c == '_') {
                        return refuse("without", cause, "names of causes");
                    }
                    words.option("without", cause);
                }
                words.columns(columns)?;
            }
            WorkAsked::Replay { file, columns, table } => {
                words.file("file", file)?;
                words.file_option("tables", table)?;
                words.columns(columns)?;
            }
            WorkAsked::Simulate { drive, generator, torque_n_m, mesh } => {
                words.drive(drive)?;
                words.option("generator", generator);
                words.option("path", "pitch");
                words.number("torque-n-m", Some(*torque_n_m))?;
                words.option("mesh", mesh);
                if *mesh == MeshLevel::Coarse {
                    let teeth = words.read(drive)?.flexspline.teeth;
                    words.option("increment", std::f64::consts::TAU / f64::from(teeth) / FIRST_LOOK);
                }
            }
            WorkAsked::Sheet { drive, generator } => {
                words.sheet(drive)?;
                words.option("generator", generator);
                words.option("positions", 4);
            }
            WorkAsked::Tables { drive, generator, mesh, torque_n_m, complete } => {
                words.drive(drive)?;
                words.number("torque-n-m", *torque_n_m)?;
                words.option("generator", generator);
                words.option("mesh", mesh);
                if *complete {
                    words.word("--complete-from-data-sheet");
                }
            }
            WorkAsked::Samples { file, drive, generator } => {
                words.file_option("from-samples", file)?;
                words.drive(drive)?;
                words.option("generator", generator);
            }
            WorkAsked::Validate { tables, drive, generator } => {
                words.folder_option("tables", tables)?;
                words.drive(drive)?;
                words.option("generator", generator);
            }
            WorkAsked::Bundle { tables } => {
                if folder.file(tables).is_ok() {
                    words.file_option("tables", tables)?;
                } else {
                    words.folder_option("tables", tables)?;
                }
                words.word("--no-core");
                words.word("--archive");
                words.option("out", format!("{out}/flexspline"));
            }
            WorkAsked::New { file, of } => {
                if !is_plain(file) || !file.ends_with(".toml") {
                    return refuse("file", file, "a plain name that ends in .toml");
                }
                words.word(file);
                match of {
                    NewOf::Like(name) if is_plain(name) => words.option("like", name),
                    NewOf::Like(name) => return refuse("like", name, "SERIES-SIZE-RATIO, for instance CSG-25-80"),
                    NewOf::Numbers { teeth, module_mm } => {
                        words.option("teeth", teeth);
                        words.number("module", Some(*module_mm))?;
                    }
                }
            }
        }
        let printed_to = matches!(self, WorkAsked::Look { .. }).then_some("look.json");
        if !matches!(self, WorkAsked::Look { .. } | WorkAsked::Bundle { .. } | WorkAsked::New { .. }) {
            words.option("out", out);
        }
        Ok(Words { arguments: words.arguments, printed_to })
    }
}

/// The words of a command while they are put together.
struct CommandLine<'a> {
    folder: &'a Folder,
    arguments: Vec<String>,
}

impl CommandLine<'_> {
    fn word(&mut self, word: &str) {
        self.arguments.push(word.to_owned());
    }

    fn option(&mut self, name: &str, value: impl ToString) {
        self.arguments.push(format!("--{name}={}", value.to_string()));
    }

    fn number(&mut self, name: &'static str, value: Option<f64>) -> Result<(), WorkError> {
        match value {
            Some(number) if !number.is_finite() => return refuse(name, number, "a number"),
            Some(number) => self.option(name, number),
            None => {}
        }
        Ok(())
    }

    fn text(&mut self, name: &'static str, value: &str) -> Result<(), WorkError> {
        if value.len() > LONGEST_VALUE || value.chars().any(char::is_control) {
            return refuse(name, value, format!("at most {LONGEST_VALUE} characters on one line"));
        }
        self.option(name, value);
        Ok(())
    }

    fn file(&mut self, what: &'static str, name: &str) -> Result<(), WorkError> {
        self.folder.file(name).map_err(|error| WorkError::File(what, error))?;
        self.word(name);
        Ok(())
    }

    fn file_option(&mut self, what: &'static str, name: &str) -> Result<(), WorkError> {
        self.folder.file(name).map_err(|error| WorkError::File(what, error))?;
        self.option(what, name);
        Ok(())
    }

    fn folder_option(&mut self, what: &'static str, name: &str) -> Result<(), WorkError> {
        // The folder of the bench itself has tables too.
        if name != "." {
            self.folder.folder(name).map_err(|error| WorkError::File(what, error))?;
        }
        self.option(what, name);
        Ok(())
    }

    fn logs(&mut self, files: &[String]) -> Result<(), WorkError> {
        if files.is_empty() || files.len() > MOST_LOGS {
            return refuse("files", files.len(), format!("1 to {MOST_LOGS}"));
        }
        files.iter().try_for_each(|file| self.file("file", file))
    }

    fn known(&mut self, known: &KnownOfUnit, ratio_will_do: bool) -> Result<(), WorkError> {
        match known {
            KnownOfUnit { ratio: Some(ratio), model: None, tables: None } if ratio_will_do => {
                self.number("ratio", Some(*ratio))
            }
            KnownOfUnit { ratio: None, model: Some(model), tables: None } => self.file_option("model", model),
            KnownOfUnit { ratio: None, model: None, tables: Some(tables) } => self.folder_option("tables", tables),
            _ => refuse(
                "known",
                "none, or several",
                if ratio_will_do { "ratio, model or tables" } else { "model or tables" },
            ),
        }
    }

    fn columns(&mut self, columns: &Option<String>) -> Result<(), WorkError> {
        let columns = columns.iter().filter(|columns| !columns.is_empty());
        columns.into_iter().try_for_each(|columns| self.text("columns", columns))
    }

    fn drive_itself(&mut self, drive: &DriveAsked) -> Result<(), WorkError> {
        if Drive::built_in(&drive.drive).is_some() {
            self.option("drive", &drive.drive);
            return Ok(());
        }
        self.file_option("drive", &drive.drive)
    }

    fn sets<'s>(&mut self, sets: impl Iterator<Item = (&'s String, &'s String)>) -> Result<(), WorkError> {
        for (k, (path, value)) in sets.enumerate() {
            let plain = path.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '.' | '_'));
            if !plain || k >= MOST_SETS {
                return refuse("sets", path, format!("at most {MOST_SETS} fields of a drive"));
            }
            self.text("set", &format!("{path}={value}"))?;
        }
        Ok(())
    }

    fn drive(&mut self, drive: &DriveAsked) -> Result<(), WorkError> {
        self.drive_itself(drive)?;
        self.sets(drive.sets.iter())
    }

    /// The drive with its fields.
    fn read(&self, asked: &DriveAsked) -> Result<Drive, WorkError> {
        let sets: Vec<String> = asked.sets.iter().map(|(path, value)| format!("{path}={value}")).collect();
        let drive = crate::drive::read(self.folder, &asked.drive).map_err(|error| error.to_string());
        match drive.and_then(|d| d.with_sets(sets.iter().map(String::as_str)).map_err(|error| error.to_string())) {
            Ok(drive) => Ok(drive),
            Err(what) => refuse("drive", &asked.drive, format!("a drive that is whole: {what}")),
        }
    }

    /// A sweep of one variant: one field "varies" over the value that it has.
    fn sheet(&mut self, asked: &DriveAsked) -> Result<(), WorkError> {
        const FIELD: &str = "generator.w0_mm";
        let w0 = match asked.sets.get(FIELD) {
            Some(value) => value.clone(),
            None => self.read(asked)?.generator.w0_mm.to_string(),
        };
        self.text("vary", &format!("{FIELD}={w0}"))?;
        self.drive_itself(asked)?;
        self.sets(asked.sets.iter().filter(|(path, _)| *path != FIELD))
    }
}

/// The command for a terminal in the folder, which makes the same files.
pub fn shown(words: &Words, out: &str) -> String {
    let all = std::iter::once("flexspline".to_owned()).chain(words.arguments.iter().map(|word| quoted(word)));
    let line = all.collect::<Vec<_>>().join(" ");
    match words.printed_to {
        Some(file) => format!("{line} > {out}/{file}"),
        None => line,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder() -> (tempfile::TempDir, Folder) {
        let place = tempfile::tempdir().unwrap();
        std::fs::write(place.path().join("a.csv"), "x").unwrap();
        std::fs::write(place.path().join("nominal.toml"), "x").unwrap();
        std::fs::create_dir(place.path().join("out")).unwrap();
        let folder = Folder::new(place.path()).unwrap();
        (place, folder)
    }

    fn asked(json: &str) -> Result<Words, String> {
        let (_place, folder) = folder();
        let work: WorkAsked = serde_json::from_str(json).map_err(|error| error.to_string())?;
        work.words(&folder, "bench/x-1").map_err(|error| error.to_string())
    }

    #[test]
    fn a_request_is_one_command_line() {
        let words = asked(
            r#"{"work":"calibrate","files":["a.csv"],"known":{"ratio":-100},
                "columns":"generator=#1:turn,error=it's:arcsec"}"#,
        )
        .unwrap();
        assert_eq!(
            shown(&words, "bench/x-1"),
            "flexspline calibrate a.csv --split --ratio=-100 '--columns=generator=#1:turn,error=it'\\''s:arcsec' \
             --out=bench/x-1"
        );
        let words = asked(r#"{"work":"look","files":["a.csv"]}"#).unwrap();
        assert_eq!(shown(&words, "bench/x-1"), "flexspline look a.csv --json > bench/x-1/look.json");
        let words = asked(
            r#"{"work":"sheet","generator":"cam",
                "drive":{"drive":"HHD-95","sets":{"generator.w0_mm":"0.49","flexspline.width_mm":"20"}}}"#,
        )
        .unwrap();
        assert_eq!(
            words.arguments.join(" "),
            "sweep --vary=generator.w0_mm=0.49 --drive=HHD-95 --set=flexspline.width_mm=20 --generator=cam \
             --positions=4 --out=bench/x-1"
        );
    }

    /// Whatever stands in a value, it stays in the one word that it belongs to.
    #[test]
    fn no_value_becomes_an_option_or_a_file_outside() {
        for name in ["--out=/etc", "-v", "../a.csv", "/etc/passwd", "absent.csv", "", "a.csv --json", "$(x)"] {
            let found = asked(&format!(r#"{{"work":"look","files":[{name:?}]}}"#));
            assert!(found.is_err(), "{name}: {found:?}");
        }
        let columns = "x' --out=/ ; rm -rf /";
        let json = format!(r#"{{"work":"replay","file":"a.csv","table":"a.csv","columns":{columns:?}}}"#);
        let words = asked(&json).unwrap();
        assert_eq!(words.arguments.iter().filter(|word| word.starts_with("--out")).count(), 1);
        assert!(words.arguments.contains(&format!("--columns={columns}")));
        for bad in [
            r#"{"work":"shell","files":[]}"#,
            r#"{"work":"look","files":[]}"#,
            r#"{"work":"look","files":["a.csv"],"more":1}"#,
            r#"{"work":"new","file":"../x.toml","of":{"like":"CSG-25-80"}}"#,
            r#"{"work":"new","file":"x.toml","of":{"like":"--force"}}"#,
            r#"{"work":"simulate","drive":{"drive":"../x"},"generator":"cam","torque_n_m":1,"mesh":"coarse"}"#,
            r#"{"work":"samples","file":"a.csv","drive":{"drive":"HHD-95","sets":{"a --b":"1"}},"generator":"cam"}"#,
            r#"{"work":"diagnose","file":"a.csv","known":{"ratio":50}}"#,
            r#"{"work":"replay","file":"a.csv","table":"a.csv","columns":"a\nb"}"#,
        ] {
            assert!(asked(bad).is_err(), "{bad}");
        }
    }
}
