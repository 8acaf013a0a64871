//! The core in the loop with a simulated joint that has mass ([`fly`]), and the wind-up of its built-in drives
//! ([`plant_map`]).
#![forbid(unsafe_code)]

pub mod fly;
pub mod plant_map;
