//! Helpers of every part: units, statistics, rows of CSV, TOML read with its lines, files written
//! whole.
#![forbid(unsafe_code)]

pub mod csv_rows;
pub mod figures;
pub mod output;
pub mod progress;
pub mod robust;
pub mod spent;
pub mod statistics;
pub mod suggest;
pub mod toml_file;
pub mod units;
