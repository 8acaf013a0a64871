#![cfg_attr(fuzzing, no_main)]
//! See `flexspline_fuzz::saved`.

#[cfg(fuzzing)]
libfuzzer_sys::fuzz_target!(|data: &[u8]| flexspline_fuzz::saved::run(data));

#[cfg(not(fuzzing))]
fn main() {}
