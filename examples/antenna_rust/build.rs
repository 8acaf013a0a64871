//! Memory of the target for the linker, and where the table is.

use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    // What `flexspline tables` wrote, or another folder.
    let tables = env::var_os("FLEXSPLINE_TABLES").map_or(top.join("out"), PathBuf::from);
    let image = tables.join("cam.fxt");
    fs::copy(&image, out.join("cam.fxt")).unwrap_or_else(|error| panic!("{}: {error}; see README.md", image.display()));
    // That of the board in QEMU, or of another one.
    let memory = env::var_os("FLEXSPLINE_MEMORY").map_or(top.join("memory.x"), PathBuf::from);
    fs::copy(&memory, out.join("memory.x")).unwrap_or_else(|error| panic!("{}: {error}", memory.display()));
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rerun-if-changed={}", image.display());
    println!("cargo:rerun-if-changed={}", memory.display());
    println!("cargo:rerun-if-env-changed=FLEXSPLINE_TABLES");
    println!("cargo:rerun-if-env-changed=FLEXSPLINE_MEMORY");
}
