//! Why there is no FMU.

use std::path::PathBuf;

use flexspline::ImageError;
use flexspline_fly::fly::OwnTableError;
use flexspline_fmu::FmuError;
use flexspline_motion::flight::FlightError;

/// Tables, scenarios and libraries that make no FMU.
#[derive(Debug, thiserror::Error)]
pub enum FmuExportError {
    /// The table.
    #[error(transparent)]
    Table(#[from] ImageError),
    /// The drive that the table describes.
    #[error(transparent)]
    Drive(#[from] OwnTableError),
    /// The scenario's table.
    #[error(transparent)]
    Flight(#[from] FlightError),
    /// The error of the FMU itself.
    #[error(transparent)]
    Resources(#[from] FmuError),
    /// A file that is no library of an FMU.
    #[error("{}: {why}; allowed: a library that cargo built of flexspline-fmu", file.display())]
    NoLibrary {
        /// The file.
        file: PathBuf,
        /// Actual contents.
        why: String,
    },
    /// Two libraries for one platform.
    #[error("--library: found {} and {}, both for {folder}; allowed: one", files[0].display(), files[1].display())]
    TwoLibraries {
        /// Both files.
        files: [PathBuf; 2],
        /// The platform's folder in an FMU.
        folder: &'static str,
    },
    /// No library was found.
    #[error(
        "found no library for an FMU in this program or beside it; a program of a release has it inside. In a checkout \
         run: cargo build --release -p flexspline-fmu, and give --library target/release/{built}"
    )]
    Missing {
        /// The file that a build makes.
        built: &'static str,
    },
}
