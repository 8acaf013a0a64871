//! The command as a user runs it: the real program in a folder of its own.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use serde_json::Value;
use tempfile::TempDir;

/// The command `flexspline`: the one that `FLEXSPLINE_PROGRAM` names, or built in the profile that the tests were built
/// in (their folder `PROFILE/deps` has its name), with the features that the whole workspace asks for.
pub fn flexspline() -> &'static Path {
    static BINARY: OnceLock<PathBuf> = OnceLock::new();
    BINARY.get_or_init(|| {
        if let Some(built) = std::env::var_os("FLEXSPLINE_PROGRAM") {
            return built.into();
        }
        let tests = std::env::current_exe().expect("the tests have a path");
        let profile = match tests.ancestors().nth(2).and_then(|folder| folder.file_name()?.to_str()) {
            Some("debug") | None => "dev",
            Some(profile) => profile,
        };
        let built = Command::new(env!("CARGO"))
            .args(["build", "--workspace", "--bin", "flexspline", "--profile", profile])
            .arg("--message-format=json-render-diagnostics")
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .expect("cargo can be run");
        let log = String::from_utf8_lossy(&built.stderr);
        assert!(built.status.success(), "the command does not build:\n{log}");
        let messages = serde_json::Deserializer::from_slice(&built.stdout);
        messages
            .into_iter::<serde_json::Value>()
            .map(|message| message.expect("cargo writes JSON"))
            .find_map(|message| Some(PathBuf::from(message["executable"].as_str()?)))
            .expect("cargo names the program it built")
    })
}

/// A folder of its own to run in.
pub struct Desk(TempDir);

impl Desk {
    /// An empty folder, removed at the end.
    #[allow(clippy::new_without_default)]
    pub fn new() -> Desk {
        Desk(tempfile::tempdir().unwrap())
    }

    /// Path of a file in it.
    pub fn path(&self, name: &str) -> std::path::PathBuf {
        self.0.path().join(name)
    }

    /// Writes a file.
    pub fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    /// Reads a file.
    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    /// The command with these arguments, to be run in the folder.
    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(flexspline());
        command.args(args).current_dir(self.0.path()).stdin(Stdio::null());
        command
    }

    /// Runs the command with these arguments.
    pub fn run(&self, args: &[&str]) -> Output {
        Output::of(self.command(args).output().unwrap())
    }

    /// Runs a line of words.
    pub fn line(&self, line: &str) -> Output {
        self.run(&line.split_whitespace().collect::<Vec<_>>())
    }

    /// Runs a line that must be refused with these words; the whole message.
    #[track_caller]
    pub fn refused(&self, line: &str, said: &str) -> String {
        let run = self.line(line);
        assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{line}: {}", run.stderr);
        assert!(run.stderr.contains(said), "{line}\n  said   {}\n  wanted {said}", run.stderr);
        run.stderr
    }
}

/// Samples of a pitch under these loads, there and back, that make a table without FEM.
pub fn samples(torques_n_m: &[i32]) -> String {
    let mut text = "generator_rad,torque_n_m,temperature_c,direction,output_rad\n".to_owned();
    for (torque, direction) in torques_n_m.iter().flat_map(|torque| [(torque, 1), (torque, -1)]) {
        for k in 0..8 {
            let psi = f64::from(k) * 0.033_421_2 / 8.0;
            text += &format!("{psi},{torque},20,{direction},{}\n", psi / 95.0 - 1e-4 * f64::from(direction));
        }
    }
    text
}

/// Everything in a folder, hidden files too, in order.
pub fn names(folder: &Path) -> Vec<String> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Output of a run of the command, and its end.
pub struct Output {
    /// Exit code.
    pub code: i32,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl Output {
    /// From a finished process.
    pub fn of(output: std::process::Output) -> Output {
        Output {
            code: output.status.code().expect("the program ended by itself"),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// The same, which must have ended well.
    #[track_caller]
    pub fn done(self) -> Output {
        assert_eq!(self.code, 0, "{}", self.stderr);
        self
    }

    /// Standard output as one JSON value.
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout)
            .unwrap_or_else(|error| panic!("stdout is not one JSON value ({error}): {}", self.stdout))
    }
}
