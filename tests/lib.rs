//! Helpers shared by the claim tests: a drive taken through a path ([`motion`]), and the command as a user runs it
//! ([`command`]). Rust blocks of the documentation are compiled and run as tests of this crate.

pub mod command;
pub mod motion;

/// Pages with Rust in them; `tests/docs_commands.rs` sees that none is missing.
#[cfg(doctest)]
mod pages {
    #[doc = include_str!("../README.md")]
    struct Readme;
}
