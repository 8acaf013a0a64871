//! The core in the loop with a simulated joint: without mass ([`closed_loop`]) and with it ([`fly`]).
#![forbid(unsafe_code)]

pub mod closed_loop;
pub mod fly;
