//! The command line: arguments to settings, results to files and to the terminal. One file for each command.
//!
//! The work of a command is a library function that knows nothing of the command line. Here options are read and
//! checked, the function is called, and its result is written and shown. Data goes to stdout, talk to stderr.

mod bundle;
mod calibrate;
mod context;
mod diagnose;
mod drive;
mod export;
mod export_fmu;
mod export_playback;
mod fly;
mod kernels;
mod logs;
mod look;
mod made;
mod names;
mod new;
mod replay;
mod report;
mod reproduce;
mod say;
#[cfg(feature = "serve")]
mod serve;
mod simulate;
mod sleeve;
mod stop;
mod sweep;
mod synthesize;
mod tables;
mod validate;

use std::ffi::OsString;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::error::{ContextKind, ContextValue};
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};

use context::Context;
use flexspline_base::output::{OutputError, remove_empty_folders, replaces_none_kept};

/// How a command ended; the number is the exit code of the process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Done.
    Done = 0,
    /// The run failed: no convergence, a bound missed, stopped by the user.
    Failed = 1,
    /// Bad input or usage.
    BadInput = 2,
}

impl From<Outcome> for ExitCode {
    fn from(outcome: Outcome) -> ExitCode {
        ExitCode::from(outcome as u8)
    }
}

/// Why a command ended without a result: one message for stderr.
#[derive(Debug)]
enum Failure {
    /// The user has to change something.
    BadInput(String),
    /// The input is sound and the run failed.
    Failed(String),
}

/// Bad input as a library says it.
fn bad_input(error: impl std::fmt::Display) -> Failure {
    Failure::BadInput(error.to_string())
}

/// Bad input in a file.
fn bad_file<E: std::fmt::Display>(file: &std::path::Path) -> impl Fn(E) -> Failure + '_ {
    move |error| {
        let said = error.to_string();
        // In the words of a system it is a directory, or denied.
        let why = if file.is_dir() && !said.contains("folder") { "found a folder; allowed: a file" } else { &said };
        Failure::BadInput(format!("{}: {why}", file.display()))
    }
}

/// The number of an option, from the least to the largest that it may be.
fn within(option: &str, found: f64, least: f64, most: f64) -> Result<f64, Failure> {
    if (least..=most).contains(&found) {
        return Ok(found);
    }
    Err(Failure::BadInput(format!("{option}: found {found}; allowed: {least} to {most}")))
}

impl From<OutputError> for Failure {
    fn from(error: OutputError) -> Failure {
        match error.source.kind() {
            // In the place of an input.
            std::io::ErrorKind::InvalidInput => Failure::BadInput(error.to_string()),
            _ => Failure::Failed(error.to_string()),
        }
    }
}

/// Simulates strain wave (harmonic) drives by contact FEM, makes tables that correct their errors, and finds the causes
/// of error in measured drives
#[derive(Debug, Parser)]
#[command(name = "flexspline", version, propagate_version = true, max_term_width = 100)]
#[command(after_help = "\
flexspline COMMAND --help says more of a command, with examples.
Angles are radians, torques N·m, temperatures degrees C, sizes mm or um as the name says; errors are
arc-seconds at the output, positive where it leads. A positive torque turns the output forward.
Exit codes: 0 done; 1 the run failed (no convergence, a bound missed, stopped); 2 bad input.")]
struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: CliCommand,
}

/// Commands by what they are used for.
const GROUPS: [(&str, &[(&str, &str)]); 4] = [
    (
        "Simulate",
        &[
            ("simulate", "run the drive along a path: kinematic error, backlash, wind-up, stress"),
            ("sleeve", "the sleeve or cup in three dimensions: stiffness by harmonic, tilt, torsion"),
            ("sweep", "many variants of a drive, or drives drawn from tolerances"),
            ("fly", "a joint with mass in closed loop, with and without compensation"),
            ("export", "the mesh, the outlines, a CalculiX deck or an FMU, for other programs"),
            ("reproduce", "the paper's protocol for all four generators, compared with its results"),
        ],
    ),
    (
        "Make tables",
        &[
            ("tables", "compensation tables for firmware, from FEM or from samples; kernels for diagnose"),
            ("validate", "compare tables with new FEM runs at other points"),
            ("bundle", "tables, a C99 reader and the core, for your firmware's build"),
        ],
    ),
    (
        "Measured data",
        &[
            ("look", "inspect log files and propose how to read them"),
            ("diagnose", "find what the simulation gets wrong in measured data, and the cause"),
            ("calibrate", "make the table of one unit from its logs, whatever the cause of its error"),
            ("replay", "the residual of a measured error after a table"),
            ("synthesize", "synthetic measurements with effects of your choice, to try diagnose on"),
        ],
    ),
    (
        "Files and set-up",
        &[
            ("serve", "the bench in a browser: logs, drives and tables to look at and change"),
            ("new", "a commented drive file, or a catalogue model, to edit"),
            ("drive", "print a drive, or check its teeth for interference"),
            ("help", "this page, or that of a command"),
        ],
    ),
];

/// The shortest way to a result, for the first page.
const USUAL_PATH: [(&str, &str); 3] = [
    ("flexspline new drive.toml", "your drive, to edit; without it HHD-95"),
    ("flexspline tables --drive drive.toml", "FEM, two minutes of processor: tables and report.html in out/"),
    ("flexspline validate --tables out --drive drive.toml", "compare them with new FEM runs"),
];

/// The drive where none is named.
const USUAL_DRIVE: &str = "HHD-95";

/// Commands that left, and what to type now.
const RENAMED: [(&str, &str); 5] = [
    ("campaign", "flexspline sweep"),
    ("study", "flexspline sweep"),
    ("kernels", "flexspline tables --kernels"),
    ("man", "flexspline help COMMAND"),
    ("completions", "flexspline help COMMAND"),
];
/// Formats of `export` that left; each has a script in examples/playback.
const SCRIPTED: [&str; 7] = ["beckhoff", "eqmod", "linuxcnc", "moteus", "odrive", "onstepx", "ros2"];

/// One line for a command or a format that left and that the command line was refused for.
fn renamed(error: &clap::Error) -> Option<String> {
    let text = |kind: ContextKind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.as_str()),
        _ => None,
    };
    if let Some(command) = text(ContextKind::InvalidSubcommand) {
        let (old, new) = RENAMED.iter().find(|(old, _)| *old == command)?;
        return Some(format!("{old} is no more; type {new}"));
    }
    // The argument reads `--format <FORMAT>`.
    let format = text(ContextKind::InvalidValue).filter(|format| SCRIPTED.contains(format))?;
    text(ContextKind::InvalidArg).filter(|argument| argument.starts_with("--format "))?;
    let new = format!("--format csv --tables FILE.fxt, then examples/playback/{format}.py");
    Some(format!("--format {format} is no more; type {new}"))
}

/// The definition of the command line.
fn command() -> clap::Command {
    let header = *clap::builder::Styles::styled().get_header();
    let literal = *clap::builder::Styles::styled().get_literal();
    let all = Cli::command();
    let mut page =
        format!("{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{header}The usual path:{header:#}\n");
    for (words, what) in USUAL_PATH {
        let _ = writeln!(page, "  {literal}{words:<53}{literal:#}{what}");
    }
    for (title, commands) in GROUPS {
        let _ = writeln!(page, "\n{header}{title}:{header:#}");
        for (name, what) in commands.iter().filter(|(name, _)| *name == "help" || all.find_subcommand(name).is_some()) {
            let _ = writeln!(page, "  {literal}{name:<13}{literal:#}{what}");
        }
    }
    let _ = write!(page, "\n{header}Common options:{header:#}\n{{options}}{{after-help}}");
    all.help_template(page)
}

/// Reads a command line.
fn parse(args: impl IntoIterator<Item = impl Into<OsString> + Clone>) -> Result<Cli, clap::Error> {
    let mut matches = command().try_get_matches_from(args)?;
    Cli::from_arg_matches_mut(&mut matches)
}

/// The commands with their options, each run by the function `run` of these.
macro_rules! commands {
    ($($(#[$only:meta])? $name:ident($options:ty),)+) => {
        #[derive(Debug, Subcommand)]
        enum CliCommand {
            $($(#[$only])? $name($options),)+
        }

        impl CliCommand {
            fn run(&self, context: &Context) -> Result<(), Failure> {
                match self {
                    $($(#[$only])? CliCommand::$name(command) => command.run(context),)+
                }
            }
        }
    };
}

commands! {
    Simulate(simulate::Simulate),
    Sleeve(sleeve::SleeveCommand),
    Sweep(Box<sweep::SweepCommand>),
    Drive(drive::DriveCommand),
    Fly(fly::Fly),
    Export(Box<export::Export>),
    Tables(tables::Tables),
    Validate(validate::Validate),
    Bundle(bundle::BundleCommand),
    Calibrate(calibrate::Calibrate),
    Replay(replay::Replay),
    Synthesize(synthesize::Synthesize),
    Look(look::Look),
    Diagnose(diagnose::Diagnose),
    Reproduce(reproduce::Reproduce),
    New(new::New),
    #[cfg(feature = "serve")]
    Serve(serve::Serve),
}

/// Options of every command.
#[derive(Debug, Args)]
#[command(next_help_heading = "Common options")]
struct Common {
    /// Drive file, or the name of a built-in drive: HHD-95 (ideal), HHD-95-typical (friction, compliances,
    /// tolerances), CUP-95 (a cup), HHD-95-hermetic (a closed sleeve), HHD-95-plane (no third dimension), S-95
    /// (S-shaped teeth)
    #[arg(long, global = true, value_name = "FILE|NAME", default_value = USUAL_DRIVE)]
    drive: String,
    /// Override fields of the drive, for instance flanks.friction_coefficient=0.08; several with commas, or repeated
    #[arg(long = "set", global = true, value_name = "PATH=VALUE")]
    sets: Vec<String>,
    /// Folder for output files, made if it does not exist [default: out]
    #[arg(long, global = true, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the result as one JSON object, and nothing else, on stdout
    #[arg(long, global = true)]
    json: bool,
    /// Threads to use; default: one for each core
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Print no progress and no summary
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Print more: a line for every increment
    #[arg(short, long, global = true)]
    verbose: bool,
}

/// Runs the command line `args`, whose first item is the name of the program.
pub fn run(args: impl IntoIterator<Item = impl Into<OsString>>) -> Outcome {
    let args: Vec<OsString> = args.into_iter().map(Into::into).collect();
    let cli = match parse(&args) {
        Ok(cli) => cli,
        Err(help_or_error) => {
            if let Some(message) = renamed(&help_or_error) {
                return ended(Failure::BadInput(message));
            }
            let printed = help_or_error.print();
            return match say::written(printed) {
                _ if help_or_error.use_stderr() => Outcome::BadInput,
                Ok(()) => Outcome::Done,
                Err(failure) => ended(failure),
            };
        }
    };
    let context = Context::new(cli.common, &args);
    stop::end_cleanly_on_signals();
    match context.with_threads(|| cli.command.keep_inputs(&context).and_then(|()| cli.command.run(&context))) {
        Ok(()) => Outcome::Done,
        Err(failure) => ended(failure),
    }
}

/// Says why there is no result, and leaves no folder that was made for it.
fn ended(failure: Failure) -> Outcome {
    remove_empty_folders();
    let (message, outcome) = match failure {
        Failure::BadInput(message) => (message, Outcome::BadInput),
        Failure::Failed(message) => (message, Outcome::Failed),
    };
    say::error(&message);
    outcome
}

impl CliCommand {
    /// Keeps the files that the command line names from being replaced. What is known to be written in the place of one
    /// is refused before any work is done, all else where it is written.
    fn keep_inputs(&self, context: &Context) -> Result<(), Failure> {
        if let CliCommand::New(_) = self {
            // It names the file that it writes.
            return Ok(());
        }
        context.keep_files_named();
        let mut places = self.writes().iter().map(|name| context.out_path().join(name));
        places.try_for_each(|place| replaces_none_kept(&place)).map_err(Failure::from)
    }

    /// Files that it writes whatever is asked of it, of commands that may read one of such a name.
    fn writes(&self) -> &'static [&'static str] {
        match self {
            CliCommand::Simulate(_) => &["results.csv", "summary.json"],
            CliCommand::Calibrate(_) => &["calibrated.fxt", "calibration.json"],
            CliCommand::Diagnose(_) => &["diagnosis.json"],
            CliCommand::Replay(_) => &["replay.csv", "summary.json"],
            CliCommand::Synthesize(_) => &["data.csv", "truth.json"],
            _ => &[],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_of_the_command_line_is_consistent() {
        command().debug_assert();
    }

    #[test]
    fn a_name_that_left_says_what_to_type() {
        let scripts = SCRIPTED.map(|format| (format!("export --format {format}"), format!("playback/{format}.py")));
        let commands = RENAMED.map(|(old, new)| (old.to_owned(), new.to_owned()));
        for (line, new) in commands.into_iter().chain(scripts) {
            let error = parse(format!("flexspline {line}").split(' ')).unwrap_err();
            let said = renamed(&error).unwrap_or_else(|| panic!("{line}: {error}"));
            let old = line.trim_start_matches("export ");
            assert!(said.contains(old) && said.contains(&new) && said.lines().count() == 1, "{said}");
        }
        for line in ["flexspline tabels", "flexspline export --format vtx", "flexspline export --formt odrive"] {
            assert_eq!(renamed(&parse(line.split(' ')).unwrap_err()), None, "{line}");
        }
    }

    /// Every command but `help`.
    fn commands() -> Vec<clap::Command> {
        command().get_subcommands().filter(|c| c.get_name() != "help").cloned().collect()
    }

    #[test]
    fn every_command_teaches_by_an_example_that_it_accepts() {
        for command in commands() {
            let help = command.get_after_help().unwrap_or_else(|| panic!("{} has no example", command.get_name()));
            let help = help.to_string();
            let examples: Vec<&str> = help.lines().map(str::trim).filter(|l| l.starts_with("flexspline ")).collect();
            assert!(!examples.is_empty(), "{} has no example", command.get_name());
            let longest = help.lines().map(|line| line.chars().count()).max();
            assert!(longest <= Some(100), "{}: a line of {longest:?} letters is broken", command.get_name());
            for example in examples {
                let words = example.split(['>', '|']).next().unwrap().split_whitespace();
                assert!(parse(words).is_ok(), "{example}");
            }
        }
    }

    #[test]
    fn the_first_page_names_every_command_once_and_shows_a_path_that_is_accepted() {
        let page = command().render_help().to_string();
        for name in commands().iter().map(clap::Command::get_name).chain(["help"]) {
            let groups = GROUPS.iter().flat_map(|(_, commands)| commands.iter());
            assert_eq!(groups.filter(|(known, _)| *known == name).count(), 1, "{name} in the groups");
            let lines = page.lines().filter(|line| line.starts_with(&format!("  {name} ")));
            assert_eq!(lines.count(), 1, "{name} on the first page:\n{page}");
        }
        for (words, _) in USUAL_PATH {
            assert!(page.contains(words) && parse(words.split(' ')).is_ok(), "{words}");
        }
        assert!(page.lines().all(|line| line.chars().count() <= 120), "{page}");
    }

    #[test]
    fn every_option_says_what_it_is_and_its_default_where_it_has_one() {
        for command in commands() {
            for arg in command.get_arguments().filter(|arg| !["help", "version"].contains(&arg.get_id().as_str())) {
                let (name, id) = (command.get_name(), arg.get_id());
                let help = arg.get_help().unwrap_or_else(|| panic!("{name} {id} says nothing")).to_string();
                let stated = !arg.get_default_values().is_empty() || help.contains("default");
                let needs_none = arg.is_required_set() || !arg.get_action().takes_values() || arg.is_positional();
                // Without these there is no file, no limit, nothing to change.
                let absent = [
                    "sets",
                    "vary",
                    "tolerances",
                    "effects",
                    "model",
                    "tables",
                    "like",
                    "from_samples",
                    "half_width_arcsec",
                    "seed",
                    "explain",
                    "ratio",
                    "teeth",
                    "module",
                    "generator",
                    "data",
                ];
                assert!(stated || needs_none || absent.contains(&id.as_str()), "{name} {id} states no default: {help}");
            }
        }
    }
}
