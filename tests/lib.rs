//! Helpers shared by the claim tests: a drive taken through a path ([`motion`]), and the command as a user runs it
//! ([`command`]). Rust blocks of the documentation are compiled and run as tests of this crate.

/// Random draws of a claim: `short`, or `long` in `tests/run --long`; as many as `FLEXSPLINE_SEEDS` says, where it is
/// set.
pub fn seeds(short: u64, long: u64) -> u64 {
    let asked = std::env::var("FLEXSPLINE_SEEDS").ok().and_then(|n| n.parse().ok());
    asked.unwrap_or(if std::env::var_os("FLEXSPLINE_LONG").is_some() { long } else { short })
}

pub mod command;
pub mod motion;

/// Pages with Rust in them; `tests/docs_commands.rs` sees that none is missing.
#[cfg(doctest)]
mod pages {
    #[doc = include_str!("../docs/how-to/firmware_in_rust.md")]
    struct FirmwareInRust;
}
