//! `flexspline man`: manual pages.

use std::path::PathBuf;

use clap::Args;
use clap_mangen::Man;
use serde::Serialize;

use super::{Context, Failure, say};
use flexspline_base::output::Outputs;
use flexspline_base::suggest::did_you_mean;

/// Print a manual page, or write all of them
///
/// Without --out one page goes to standard output. With --out DIR the folder gets flexspline.1 and flexspline-COMMAND.1
/// of every command; a folder called man1 within one that `manpath` names is where `man flexspline` looks.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline man | man -l -
  flexspline man diagnose | man -l -
  flexspline man --out ~/.local/share/man/man1")]
pub(super) struct ManPages {
    /// The command that the page is of [default: flexspline itself]
    #[arg(value_name = "COMMAND")]
    command: Option<String>,
}

/// Result with `--json`.
#[derive(Serialize)]
struct Pages {
    schema_version: u32,
    /// Files, with `--out`.
    written: Vec<PathBuf>,
    /// The page, without.
    #[serde(skip_serializing_if = "Option::is_none")]
    page: Option<String>,
}

impl ManPages {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let mut pages = pages()?;
        if let Some(name) = &self.command {
            let names: Vec<String> = pages.iter().filter_map(|(name, _)| Some(command_of(name)?.to_owned())).collect();
            if !names.contains(name) {
                let hint = did_you_mean("; ", name, names.iter().map(String::as_str));
                return Err(Failure::BadInput(format!("COMMAND: found {name:?}, allowed: {}{hint}", names.join(", "))));
            }
            pages.retain(|(file, _)| command_of(file) == Some(name));
        }
        if !context.has_out() {
            let page = pages.swap_remove(0).1;
            let pages = Pages { schema_version: 1, written: Vec::new(), page: Some(page) };
            return context.print_data(&pages, || pages.page.clone().unwrap_or_default());
        }
        let out = context.out()?;
        let mut outputs = Outputs::new();
        let mut written = Vec::new();
        for (name, page) in &pages {
            let path = out.join(name);
            outputs.file(&path, |file| file.write_all(page.as_bytes()))?;
            written.push(path);
        }
        outputs.finish()?;
        let first = written[0].display().to_string();
        let text = format!("wrote {} pages to {}", written.len(), out.display());
        context.print(&Pages { schema_version: 1, written, page: None }, || {
            text + &say::next(&[format!("man -l {}", super::context::quoted(&first))])
        })
    }
}

/// The command in the name of a page; none in that of the program.
fn command_of(file: &str) -> Option<&str> {
    file.strip_prefix("flexspline-")?.strip_suffix(".1")
}

/// File name and text of every page, that of the program first.
fn pages() -> Result<Vec<(String, String)>, Failure> {
    let mut program = super::command().disable_help_subcommand(true);
    program.build();
    let commands: Vec<clap::Command> = program.get_subcommands().cloned().collect();
    std::iter::once(program)
        .chain(commands)
        .map(|command| {
            let page = Man::new(command);
            let mut text = Vec::new();
            page.render(&mut text).map_err(|error| Failure::Failed(error.to_string()))?;
            let text = String::from_utf8(text).map_err(|error| Failure::Failed(error.to_string()))?;
            Ok((page.get_filename(), as_written(&text)))
        })
        .collect()
}

/// A page with the program in its title, and with what help has behind the options line by line, as help has it.
fn as_written(page: &str) -> String {
    let (head, rest) = page.split_once(".SH EXTRA\n").unwrap_or((page, ""));
    let (extra, foot) = match rest.find(".SH ") {
        Some(at) => rest.split_at(at),
        None => (rest, ""),
    };
    let titled = |line: &str| match line.strip_prefix(".TH ").and_then(|title| title.split(' ').next()) {
        Some(name) => format!(".TH {name} 1 \"\" \"flexspline {}\" \"flexspline\"\n", env!("CARGO_PKG_VERSION")),
        None => format!("{line}\n"),
    };
    let head: String = head.lines().map(titled).collect();
    let heading = if extra.starts_with("Example") { "EXAMPLES" } else { "NOTES" };
    let extra = extra.trim_start_matches("Examples:\n").trim_start_matches("Example:\n").trim_end();
    format!("{head}.SH {heading}\n.nf\n{extra}\n.fi\n{foot}")
}
