//! Reports.
pub mod animation;
pub mod pack;
