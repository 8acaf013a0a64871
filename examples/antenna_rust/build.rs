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
    fs::copy(top.join("memory.x"), out.join("memory.x")).expect("memory.x at the top of the project");
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rerun-if-changed={}", image.display());
    println!("cargo:rerun-if-changed={}", top.join("memory.x").display());
    println!("cargo:rerun-if-env-changed=FLEXSPLINE_TABLES");
}
