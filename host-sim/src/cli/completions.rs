//! `flexspline completions`: what a shell needs to complete commands, options and names.

use clap::Args;
use clap_complete::Shell;
use serde::Serialize;

use super::{Context, Failure};

/// Print a script that lets the shell complete commands, options and names
///
/// The script is of this version of the program: write it anew after an update.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline completions bash > ~/.local/share/bash-completion/completions/flexspline
  flexspline completions zsh > ~/.zfunc/_flexspline
  flexspline completions fish > ~/.config/fish/completions/flexspline.fish
  flexspline completions powershell >> $PROFILE

For zsh the folder has to be in its path: fpath+=~/.zfunc before compinit in ~/.zshrc. A new shell
then completes; in bash this one does too after: source <(flexspline completions bash)")]
pub(super) struct Completions {
    /// The shell
    #[arg(value_name = "SHELL", value_enum)]
    shell: Shell,
}

/// Result with `--json`.
#[derive(Serialize)]
struct Script {
    schema_version: u32,
    shell: String,
    script: String,
}

impl Completions {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut super::command(), "flexspline", &mut script);
        let script = String::from_utf8(script).map_err(|error| Failure::Failed(error.to_string()))?;
        let script = Script { schema_version: 1, shell: self.shell.to_string(), script };
        context.print_data(&script, || script.script.clone())
    }
}
