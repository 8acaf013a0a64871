//! Helpers shared by the claim tests: a drive taken through a path ([`motion`]), and the command as a user runs it
//! ([`command`]).

pub mod command;
pub mod motion;
