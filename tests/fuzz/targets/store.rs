#![cfg_attr(fuzzing, no_main)]
//! See `flexspline_fuzz::store`.

#[cfg(fuzzing)]
libfuzzer_sys::fuzz_target!(|data: &[u8]| flexspline_fuzz::store::run(data));

#[cfg(not(fuzzing))]
fn main() {}
