//! The command line: arguments to settings, results to files and to the terminal. One file for each command.
//!
//! What a command computes is a library function that knows nothing of the command line. Here options are read and
//! checked, the function is called, and its result is written and shown. Data goes to stdout, talk to stderr.

mod context;
mod diagnose;
mod drive;
mod export;
mod kernels;
mod replay;
mod report;
mod reproduce;
mod simulate;
mod synthesize;
mod tables;
mod validate;

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};

use crate::output::OutputError;
use context::Context;

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

impl From<OutputError> for Failure {
    fn from(error: OutputError) -> Failure {
        Failure::Failed(error.to_string())
    }
}

/// Simulates strain wave (harmonic) drives: kinematic error, backlash and wind-up by contact FEM.
#[derive(Debug, Parser)]
#[command(name = "flexspline", version, propagate_version = true, max_term_width = 100)]
#[command(after_help = "\
Examples:
  flexspline tables
  flexspline validate --tables out
  flexspline simulate --generator cam --path pitch --torque-n-m 50
  flexspline drive > my-drive.toml
  flexspline drive --check --drive my-drive.toml

Exit codes: 0 done, 1 the run failed (no convergence, a bound missed), 2 bad input or usage.
Angles are radians, torques N.m, temperatures degrees C; errors are arc-seconds at the output.")]
struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Simulate(simulate::Simulate),
    Drive(drive::DriveCommand),
    Export(export::Export),
    Tables(tables::Tables),
    Kernels(kernels::KernelsCommand),
    Validate(validate::Validate),
    Replay(replay::Replay),
    Synthesize(synthesize::Synthesize),
    Diagnose(diagnose::Diagnose),
    Reproduce(reproduce::Reproduce),
}

/// Options of every command.
#[derive(Debug, Args)]
struct Common {
    /// Drive file, or the name of a built-in drive: HHD-95 (ideal) or HHD-95-typical (friction, compliances, tolerances)
    #[arg(long, global = true, value_name = "FILE|NAME", default_value = "HHD-95", help_heading = "Common options")]
    drive: String,
    /// Override one field of the drive, for instance flanks.friction_coefficient=0.08; may be repeated
    #[arg(long = "set", global = true, value_name = "PATH=VALUE", help_heading = "Common options")]
    sets: Vec<String>,
    /// Folder for output files, made if it does not exist
    #[arg(long, global = true, value_name = "DIR", default_value = "out", help_heading = "Common options")]
    out: PathBuf,
    /// Print the result as one JSON object, and nothing else, on stdout
    #[arg(long, global = true, help_heading = "Common options")]
    json: bool,
    /// Threads to use; default: one for each core
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), help_heading = "Common options")]
    threads: Option<u16>,
    /// No progress and no summary
    #[arg(short, long, global = true, conflicts_with = "verbose", help_heading = "Common options")]
    quiet: bool,
    /// Say more: a line for every increment
    #[arg(short, long, global = true, help_heading = "Common options")]
    verbose: bool,
}

/// Runs the command line `args`, whose first item is the name of the program.
pub fn run(args: impl IntoIterator<Item = impl Into<OsString>>) -> Outcome {
    let args: Vec<OsString> = args.into_iter().map(Into::into).collect();
    let cli = match Cli::try_parse_from(&args) {
        Ok(cli) => cli,
        Err(help_or_error) => {
            // A closed pipe is no reason to fail.
            let _ = help_or_error.print();
            return if help_or_error.use_stderr() { Outcome::BadInput } else { Outcome::Done };
        }
    };
    let context = Context::new(cli.common, &args);
    match context.with_threads(|| cli.command.run(&context)) {
        Ok(()) => Outcome::Done,
        Err(Failure::BadInput(message)) => {
            eprintln!("error: {message}");
            Outcome::BadInput
        }
        Err(Failure::Failed(message)) => {
            eprintln!("error: {message}");
            Outcome::Failed
        }
    }
}

impl Command {
    fn run(&self, context: &Context) -> Result<(), Failure> {
        match self {
            Command::Simulate(command) => command.run(context),
            Command::Drive(command) => command.run(context),
            Command::Export(command) => command.run(context),
            Command::Tables(command) => command.run(context),
            Command::Kernels(command) => command.run(context),
            Command::Validate(command) => command.run(context),
            Command::Replay(command) => command.run(context),
            Command::Synthesize(command) => command.run(context),
            Command::Diagnose(command) => command.run(context),
            Command::Reproduce(command) => command.run(context),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definition_of_the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_command_teaches_by_an_example_that_it_accepts() {
        for command in Cli::command().get_subcommands().filter(|c| c.get_name() != "help") {
            let help = command.get_after_help().unwrap_or_else(|| panic!("{} has no example", command.get_name()));
            let help = help.to_string();
            let examples: Vec<&str> = help.lines().map(str::trim).filter(|l| l.starts_with("flexspline ")).collect();
            assert!(!examples.is_empty(), "{} has no example", command.get_name());
            for example in examples {
                let words = example.split(" > ").next().unwrap().split(' ');
                assert!(Cli::try_parse_from(words).is_ok(), "{example}");
            }
        }
    }
}
