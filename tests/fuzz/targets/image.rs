#![cfg_attr(fuzzing, no_main)]
//! See `flexspline_fuzz::image`.

#[cfg(fuzzing)]
libfuzzer_sys::fuzz_target!(|data: &[u8]| flexspline_fuzz::image::run(data));

#[cfg(not(fuzzing))]
fn main() {}
