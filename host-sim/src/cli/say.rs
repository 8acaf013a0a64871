//! Output to the terminal: data and results to stdout, talk to stderr, colour only where somebody looks.
//!
//! Colour is for a terminal; `NO_COLOR` takes it away, `CLICOLOR_FORCE` puts it into a pipe too
//! (<https://bixense.com/clicolors>). A reader that has gone, as behind `| head`, is no error; a full disk is.

use std::io::{self, ErrorKind, Write};

use anstyle::{AnsiColor, Style};

use super::Failure;
use flexspline_base::suggest::MARKS;

/// As clap has it for what is wrong.
const ERROR: Style = AnsiColor::Red.on_default().bold();
/// As clap has it for what is right instead.
const HINT: Style = AnsiColor::Green.on_default();

/// Prints data on stdout, with a line end.
pub(super) fn data(text: &str) -> Result<(), Failure> {
    written(writeln!(anstream::stdout(), "{}", text.trim_end_matches('\n')).and_then(|()| io::stdout().flush()))
}

/// Prints a result on stdout, what to type next in colour.
pub(super) fn result(text: &str) -> Result<(), Failure> {
    let styled = |line: &str| match line.strip_prefix(NEXT) {
        Some(next) => format!("{NEXT}{HINT}{next}{HINT:#}\n"),
        None => format!("{line}\n"),
    };
    data(&text.trim_end().lines().map(styled).collect::<String>())
}

/// The beginning of a line that says what to type next.
pub(super) const NEXT: &str = "next: ";

/// Lines that say what to type next.
pub(super) fn next(commands: &[String]) -> String {
    commands.iter().map(|command| format!("\n{NEXT}{command}")).collect()
}

/// Says something on stderr beside the result.
pub(super) fn talk(text: &str) {
    // Nobody is left to inform if this fails.
    let _ = writeln!(anstream::stderr(), "{text}");
}

/// Says on stderr why the command ends.
pub(super) fn error(message: &str) {
    // Nobody is left to inform if this fails.
    let _ = writeln!(anstream::stderr(), "{ERROR}error:{ERROR:#} {}", suggestions_styled(message));
}

fn suggestions_styled(message: &str) -> String {
    let [begin, end] = MARKS;
    let mut rest = message;
    let mut text = String::new();
    while let Some(at) = rest.find(begin) {
        let Some(length) = rest[at..].find(end) else { break };
        let (before, suggestion) = (&rest[..at], &rest[at..at + length + end.len()]);
        text += &format!("{before}{HINT}{suggestion}{HINT:#}");
        rest = &rest[at + length + end.len()..];
    }
    text + rest
}

/// Whether standard output took what was written.
pub(super) fn written(result: io::Result<()>) -> Result<(), Failure> {
    match result {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::Failed(format!("cannot write to standard output: {error}")))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_suggestion_of_a_message_is_marked_and_nothing_else_changes() {
        let message = "a: unknown key; did you mean `b`?; allowed: b\nc: did you mean `d.e`? did you mean `";
        let styled = suggestions_styled(message);
        assert_eq!(styled.matches("\u{1b}[32m").count(), 2);
        assert!(styled.contains("\u{1b}[32mdid you mean `d.e`?\u{1b}[0m did you mean `"));
        assert_eq!(anstream::adapter::strip_str(&styled).to_string(), message);
    }
}
