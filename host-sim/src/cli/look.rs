//! `flexspline look`: what is in log files, and the mapping to read them with.

use std::path::PathBuf;

use clap::Args;

use super::context::{Context, quoted};
use super::{Failure, bad_input, say};
use flexspline_identify::look::{Looked, look, text};
use flexspline_identify::measurement::{bytes_of, raw};

/// Inspect log files of a bench: columns, units, ratio, torque, time, coverage; propose the mapping to read them with
///
/// Reads text files with one row per instant, separated by commas, semicolons, tabs, bars or blanks, with decimal point
/// or comma, with or without column names. Several files are sessions of one bench. Nothing is written.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline look bench.log
  flexspline look monday.csv tuesday.csv --json")]
pub(super) struct Look {
    /// Log files
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
}

impl Look {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        context.refuse_drive("logs say which drive they are of by their rows")?;
        let files = self
            .files
            .iter()
            .map(|file| bytes_of(file).and_then(|(file, bytes)| raw::parse(&file, bytes)))
            .collect::<Result<Vec<_>, _>>();
        let files = files.map_err(bad_input)?;
        let looked = look(&files).map_err(bad_input)?;
        context.print(&looked, || text(&looked) + &say::next(&self.next(&looked)))
    }

    /// Suggested next commands.
    fn next(&self, looked: &Looked) -> Vec<String> {
        let Some(columns) = &looked.columns_option else { return Vec::new() };
        let files: Vec<String> = self.files.iter().map(|file| quoted(&file.display().to_string())).collect();
        let ratio = looked.ratio_proposed.map_or("RATIO".to_owned(), |ratio| ratio.to_string());
        let with = |command: &str, files: &[String]| {
            format!("flexspline {command} {} --ratio {ratio} --columns {}", files.join(" "), quoted(columns))
        };
        vec![with("calibrate", &files), with("diagnose", &files[..1])]
    }
}
