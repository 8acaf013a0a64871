#![cfg_attr(fuzzing, no_main)]
//! See `flexspline_fuzz::upload`.

#[cfg(fuzzing)]
libfuzzer_sys::fuzz_target!(|data: &[u8]| flexspline_fuzz::upload::run(data));

#[cfg(not(fuzzing))]
fn main() {}
