//! The command `flexspline`; everything is in [`flexspline_sim::cli`].

fn main() -> std::process::ExitCode {
    flexspline_sim::cli::run(std::env::args_os()).into()
}
