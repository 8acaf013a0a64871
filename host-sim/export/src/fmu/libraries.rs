//! The libraries that go into an FMU: named, in a program that was released, or where cargo puts them.

use std::path::{Path, PathBuf};
use std::{fs, io};

use super::FmuExportError;
use crate::shipped::shipped;

/// A platform (section 2.3): its folder, name and ending of its library, and the first bytes of such a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Platform {
    /// Folder of `binaries`.
    pub folder: &'static str,
    /// Ending.
    pub extension: &'static str,
    /// As cargo calls it.
    pub file: &'static str,
    /// Name of cargo's target.
    target: &'static str,
    magic: &'static [u8],
}

/// Those that a library may be for; all of 64 bits.
const PLATFORMS: [Platform; 3] = [
    Platform {
        folder: "linux64",
        extension: "so",
        file: "libflexspline_fmu.so",
        target: "x86_64-unknown-linux-gnu",
        // ELF of 64 bits, little-endian.
        magic: b"\x7fELF\x02\x01",
    },
    Platform {
        folder: "win64",
        extension: "dll",
        file: "flexspline_fmu.dll",
        target: "x86_64-pc-windows-gnu",
        magic: b"MZ",
    },
    Platform {
        folder: "darwin64",
        extension: "dylib",
        file: "libflexspline_fmu.dylib",
        target: "x86_64-apple-darwin",
        magic: b"\xcf\xfa\xed\xfe",
    },
];

/// Machine of an ELF file: where it stands, and that of x86-64.
const ELF_MACHINE: (usize, [u8; 2]) = (18, [62, 0]);

/// A library and its platform.
#[derive(Debug, Clone)]
pub struct Library {
    /// Where it runs.
    pub platform: &'static Platform,
    /// Where it was found.
    pub file: PathBuf,
    /// Itself.
    pub bytes: Vec<u8>,
}

/// The libraries of these files, one for each platform; without any, those in a program that was
/// released, or where a build has them.
///
/// # Errors
/// A file that is none, or what to do where there is none at all.
pub fn find_libraries(named: &[PathBuf]) -> Result<Vec<Library>, FmuExportError> {
    let mut libraries: Vec<Library> = Vec::new();
    for file in named {
        let library = read(file)?;
        if let Some(other) = libraries.iter().find(|other| other.platform == library.platform) {
            let files = [other.file.clone(), file.clone()];
            return Err(FmuExportError::TwoLibraries { files, folder: library.platform.folder });
        }
        libraries.push(library);
    }
    if !named.is_empty() {
        return Ok(libraries);
    }
    let program = std::env::current_exe().and_then(fs::canonicalize).unwrap_or_default();
    let beside = program.parent().unwrap_or(Path::new("."));
    for platform in &PLATFORMS {
        let in_program =
            shipped(platform.file).and_then(|bytes| checked(Path::new(platform.file), bytes.to_vec()).ok());
        // One that does not fit is left out: it is of an earlier build.
        let of_build = || places(beside, platform).into_iter().find_map(|file| read(&file).ok());
        libraries.extend(in_program.or_else(of_build));
    }
    if libraries.is_empty() {
        return Err(FmuExportError::Missing { built: PLATFORMS[0].file });
    }
    Ok(libraries)
}

/// Where a build has the library of a platform, the likeliest to be new first.
fn places(beside: &Path, platform: &Platform) -> Vec<PathBuf> {
    let Platform { file, target, .. } = platform;
    // Cargo has in `deps` what it built along with the program.
    let mut places = vec![beside.join("deps").join(file), beside.join(file)];
    // Cargo's folder of another target.
    if let (Some(profile), Some(targets)) = (beside.file_name(), beside.parent()) {
        places.push(targets.join(target).join(profile).join(file));
        places.push(targets.join(target).join("release").join(file));
    }
    places
}

fn read(file: &Path) -> Result<Library, FmuExportError> {
    let refuse = |error: io::Error| FmuExportError::NoLibrary { file: file.to_owned(), why: error.to_string() };
    checked(file, fs::read(file).map_err(refuse)?)
}

/// A library of a platform, if these are the bytes of one.
fn checked(file: &Path, bytes: Vec<u8>) -> Result<Library, FmuExportError> {
    let refuse = |why: &str| FmuExportError::NoLibrary { file: file.to_owned(), why: why.to_owned() };
    let platform = PLATFORMS.iter().find(|platform| bytes.starts_with(platform.magic));
    let platform = platform.ok_or_else(|| refuse("no library of Linux, Windows or macOS with 64 bits"))?;
    let (at, machine) = ELF_MACHINE;
    if platform.extension == "so" && bytes.get(at..at + 2) != Some(&machine) {
        return Err(refuse("a library of another processor; linux64 is x86-64"));
    }
    let mark = flexspline_fmu::MARK.as_bytes();
    if !bytes.windows(mark.len()).any(|window| window == mark) {
        return Err(refuse(&format!("no library for FMUs of this version (\"{}\")", flexspline_fmu::MARK)));
    }
    Ok(Library { platform, file: file.to_owned(), bytes })
}
