#![cfg_attr(fuzzing, no_main)]
//! See `flexspline_fuzz::runtime`.

#[cfg(fuzzing)]
libfuzzer_sys::fuzz_target!(|data: &[u8]| flexspline_fuzz::runtime::run(data));

#[cfg(not(fuzzing))]
fn main() {}
