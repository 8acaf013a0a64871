//! The C header that is checked in is the one that cbindgen makes of the C interface.

use std::fs;
use std::path::Path;

#[test]
fn the_header_is_up_to_date() {
    let core = Path::new(env!("CARGO_MANIFEST_DIR")).join("../core");
    let config = cbindgen::Config::from_file(core.join("cbindgen.toml")).unwrap();
    let mut made = Vec::new();
    let mut builder = cbindgen::Builder::new()
        .with_config(config)
        .with_src(core.join("src/c_api.rs"));
    for file in ["names", "encoder", "torque", "ask", "learn", "telemetry", "beside"] {
        builder = builder.with_src(core.join(format!("src/c_api/{file}.rs")));
    }
    builder
        .generate()
        .expect("cbindgen reads the C interface")
        .write(&mut made);
    let made = String::from_utf8(made).unwrap();
    let kept = fs::read_to_string(core.join("include/flexspline.h")).unwrap();
    let line = made.lines().zip(kept.lines()).position(|(made, kept)| made != kept);
    assert!(
        made == kept,
        "core/include/flexspline.h differs from what cbindgen makes, from line {}; the header it should be:\n{made}",
        line.map_or(made.lines().count().min(kept.lines().count()), |line| line + 1)
    );
}
