//! Claims that cross the crates, one file for each.
//!
//! `cargo test --release --test claims as_built` runs one of them.

mod bench_data;

mod as_built;
mod backlash_and_dwell;
mod bad_input;
mod bad_measurements;
mod bundle;
mod c_header;
mod calibrated_drives;
mod calibration;
mod cli;
mod cli_files;
mod cli_terminal;
mod completed_from_data_sheet;
mod contact_patch;
mod docs_commands;
mod element_patch_and_rates;
mod encoder_or_gear;
mod fast_equals_reference;
mod fem_causes;
mod fmu;
mod friction;
mod fxt_format;
mod independence;
mod joint_in_motion;
mod measured_data;
mod mirror_symmetry;
mod one_pitch_periodicity;
mod plant_maps;
mod playback;
mod real_data;
mod report;
mod reproduce;
mod residual_picture;
mod ring_under_each_generator;
mod sweep;
mod synthesize_and_extend;
mod tables_against_fresh_fem;
mod temperature;
mod tips_under_load;
mod to_csv;
mod verdict_says_why;
mod wind_up_ranking;
