#![cfg_attr(fuzzing, no_main)]
//! See `flexspline_fuzz::c_interface`.

#[cfg(fuzzing)]
libfuzzer_sys::fuzz_target!(|data: &[u8]| flexspline_fuzz::c_interface::run(data));

#[cfg(not(fuzzing))]
fn main() {}
