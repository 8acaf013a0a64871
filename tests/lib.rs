//! Helpers shared by the claim tests: a drive taken through a path ([`motion`]), and the command as a user runs it
//! ([`command`]). Rust blocks of the documentation are compiled and run as tests of this crate.

/// Whether this is `tests/run --long`, in which claims are tested with all that they are about.
pub fn long() -> bool {
    std::env::var_os("FLEXSPLINE_LONG").is_some()
}

/// Random draws of a claim: `short_form`, or `long_form` in `tests/run --long`; as many as `FLEXSPLINE_SEEDS` says,
/// where it is set.
pub fn seeds(short_form: u64, long_form: u64) -> u64 {
    let asked = std::env::var("FLEXSPLINE_SEEDS").ok().and_then(|n| n.parse().ok());
    asked.unwrap_or(if long() { long_form } else { short_form })
}

pub mod command;
pub mod motion;

/// Pages with Rust in them; `tests/docs_commands.rs` sees that none is missing.
#[cfg(doctest)]
mod pages {
    #[doc = include_str!("../docs/how-to/firmware_in_rust.md")]
    struct FirmwareInRust;
}
