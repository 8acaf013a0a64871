//! Takes libraries into the program: the files of the folder that `FLEXSPLINE_LIBRARIES` names, none without it.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    println!("cargo::rerun-if-env-changed=FLEXSPLINE_LIBRARIES");
    let folder = env::var_os("FLEXSPLINE_LIBRARIES").map(PathBuf::from);
    let files = folder.into_iter().flat_map(|folder| {
        println!("cargo::rerun-if-changed={}", folder.display());
        fs::read_dir(folder).expect("FLEXSPLINE_LIBRARIES names a folder").map(|file| file.expect("a file").path())
    });
    let list: String =
        files.map(|file| format!("({:?}, include_bytes!({file:?})),\n", file.file_name().unwrap())).collect();
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::write(out.join("shipped.rs"), format!("&[{list}]")).expect("OUT_DIR can be written");
}
