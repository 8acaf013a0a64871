//! The command `flexspline`.
fn main() {}
