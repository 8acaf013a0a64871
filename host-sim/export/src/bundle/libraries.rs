//! The core as static libraries: where they lie, or how they are built.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use thiserror::Error;

use crate::shipped::shipped;

/// The C interface of the libraries.
pub(crate) const HEADER: &str = include_str!("../../shipped/flexspline.h");

/// Targets of Rust that a bundle knows, and what they are.
pub const TARGETS: [(&str, &str); 8] = [
    ("thumbv6m-none-eabi", "Cortex-M0, M0+"),
    ("thumbv7m-none-eabi", "Cortex-M3"),
    ("thumbv7em-none-eabi", "Cortex-M4, M7 without floating point in registers"),
    ("thumbv7em-none-eabihf", "Cortex-M4F, M7F"),
    ("thumbv8m.main-none-eabihf", "Cortex-M33F, M55"),
    ("riscv32imac-unknown-none-elf", "RISC-V, 32 bits, without floating point"),
    ("riscv64gc-unknown-none-elf", "RISC-V, 64 bits"),
    ("x86_64-unknown-linux-gnu", "Linux on a PC"),
];

const ARCHIVE: &str = "libflexspline.a";

/// A static library.
#[derive(Debug)]
pub struct BundleLibrary {
    /// Its target.
    pub target: String,
    /// Its contents.
    pub archive: Vec<u8>,
}

/// Why a library cannot be had.
#[derive(Debug, Error)]
pub enum LibraryError {
    /// A file that is there and is none.
    #[error("{}: {why}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Description of the fault.
        why: String,
    },
    /// Nowhere to be found, and why it cannot be built.
    #[error("{target}: {why}")]
    Missing {
        /// The target.
        target: String,
        /// Remedy.
        why: String,
    },
    /// The build failed.
    #[error("{target}: cargo could not build it:\n{log}")]
    Build {
        /// The target.
        target: String,
        /// Last output.
        log: String,
    },
}

/// Where libraries are looked for.
#[derive(Debug)]
pub enum Places {
    /// A folder that was named: it holds `<target>/libflexspline.a`.
    Named(PathBuf),
    /// In this program, if it was released, or built from the checkout around the current folder, if there is one.
    Own(Option<PathBuf>),
}

impl Places {
    /// A folder that was named, or what this program has.
    pub fn new(named: Option<&Path>) -> Places {
        let here = std::env::current_dir().unwrap_or_default();
        let checkout = || here.ancestors().find(|folder| is_checkout(folder)).map(Path::to_owned);
        named.map_or_else(|| Places::Own(checkout()), |named| Places::Named(named.to_owned()))
    }

    /// The library of a target that is at hand; `None` if it would have to be built.
    ///
    /// # Errors
    /// It is at hand and is none; it cannot be had at all.
    pub fn find(&self, target: &str) -> Result<Option<BundleLibrary>, LibraryError> {
        if let Places::Named(folder) = self {
            let path = folder.join(target).join(ARCHIVE);
            if path.exists() {
                return read(target, &path).map(Some);
            }
        } else if let Some(archive) = shipped(&format!("{target}.a")) {
            return Ok(Some(BundleLibrary { target: target.to_owned(), archive: archive.to_vec() }));
        }
        self.can_build(target).map(|_| None)
    }

    /// The checkout, if cargo is there and has the target.
    fn can_build(&self, target: &str) -> Result<&Path, LibraryError> {
        let missing = |why: String| LibraryError::Missing { target: target.to_owned(), why };
        let checkout = match self {
            Places::Named(folder) => return Err(missing(format!("no {target}/{ARCHIVE} in {}", folder.display()))),
            Places::Own(checkout) => checkout.as_deref().ok_or_else(|| {
                missing(
                    "not in this program, and no checkout of the sources here to build it; a release has the \
                     libraries, --libraries names a folder of them"
                        .to_owned(),
                )
            })?,
        };
        let header = fs::read_to_string(checkout.join("core/include/flexspline.h")).unwrap_or_default();
        if header != HEADER {
            return Err(missing(format!(
                "the sources in {} have another C interface than this program; build the program of the same sources",
                checkout.display()
            )));
        }
        let asked =
            Command::new("rustc").args(["--print", "target-libdir", "--target", target]).current_dir(checkout).output();
        let folder = match asked {
            Ok(output) if output.status.success() => String::from_utf8_lossy(&output.stdout).trim().to_owned(),
            Ok(output) => return Err(missing(String::from_utf8_lossy(&output.stderr).trim().to_owned())),
            Err(error) => {
                return Err(missing(format!("rustc cannot be run ({error}); install Rust from https://rustup.rs")));
            }
        };
        let installed = fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
        if installed {
            Ok(checkout)
        } else {
            Err(missing(format!("the Rust target is not installed: rustup target add {target}")))
        }
    }

    /// Builds the library of a target from the checkout.
    ///
    /// # Errors
    /// Output of cargo.
    pub fn build(&self, target: &str) -> Result<BundleLibrary, LibraryError> {
        let checkout = self.can_build(target)?;
        let folder =
            std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| checkout.join("target"), PathBuf::from).join("bundle");
        let folder = std::path::absolute(&folder).unwrap_or(folder);
        // Without an operating system the library is one piece with no panic path; with one it has the panic handler of
        // the standard library.
        let lto = if target.contains("-none-") { "fat" } else { "off" };
        let output = Command::new("cargo")
            .args(["rustc", "--release", "-p", "flexspline-c", "--target", target])
            .args(["--crate-type", "staticlib", "--target-dir"])
            .arg(&folder)
            .envs([("CARGO_PROFILE_RELEASE_PANIC", "abort"), ("CARGO_PROFILE_RELEASE_LTO", lto)])
            .envs([("CARGO_PROFILE_RELEASE_CODEGEN_UNITS", "1"), ("CARGO_PROFILE_RELEASE_DEBUG", "false")])
            .current_dir(checkout)
            .stdin(Stdio::null())
            .output();
        let failed = |log: String| LibraryError::Build { target: target.to_owned(), log };
        let output = output.map_err(|error| failed(error.to_string()))?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr);
            let last = said.lines().rev().take(12).collect::<Vec<_>>();
            return Err(failed(last.into_iter().rev().collect::<Vec<_>>().join("\n")));
        }
        read(target, &folder.join(target).join("release").join("libflexspline_c.a"))
    }
}

/// Whether the sources of the core are in this folder.
fn is_checkout(folder: &Path) -> bool {
    fs::read_to_string(folder.join("core/Cargo.toml")).is_ok_and(|text| text.contains("name = \"flexspline\"\n"))
}

/// A file that is a static library of the core.
fn read(target: &str, path: &Path) -> Result<BundleLibrary, LibraryError> {
    let wrong = |why: String| LibraryError::File { path: path.to_owned(), why };
    let archive = fs::read(path).map_err(|error| wrong(error.to_string()))?;
    if !archive.starts_with(b"!<arch>\n") {
        return Err(wrong("is no static library (ar archive)".to_owned()));
    }
    let symbol = b"flexspline_tick";
    if !archive.windows(symbol.len()).any(|window| window == symbol) {
        return Err(wrong("is not the core with its C interface: it has no flexspline_tick".to_owned()));
    }
    Ok(BundleLibrary { target: target.to_owned(), archive })
}
