//! The command `flexspline`.
#![forbid(unsafe_code)]
// Comments of options are help texts, which no page shows.
#![allow(rustdoc::broken_intra_doc_links, rustdoc::invalid_html_tags)]

mod cli;

fn main() -> std::process::ExitCode {
    cli::run(std::env::args_os()).into()
}
