//! Contact FEM of strain wave (harmonic) drives, and the compensation tables made from it.
#![forbid(unsafe_code)]

pub mod causes;
pub mod cli;
pub mod closed_loop;
pub mod condense;
pub mod contact;
pub mod diagnosis;
pub mod drive;
pub mod export;
pub mod extension;
pub mod fem;
pub mod kernels;
pub mod measurement;
pub mod mesh;
pub mod motion;
pub mod nominal;
pub mod output;
pub mod progress;
pub mod reference;
pub mod report;
pub mod reproduce;
pub mod residual;
pub mod simulate;
pub mod stepping;
pub mod suggest;
pub mod synthesize;
pub mod tables;
pub mod toml_file;
pub mod units;
