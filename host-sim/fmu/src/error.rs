//! Errors of an FMU's resources, of the values of its variables, and of a state to go on from.

use flexspline::{ActivateError, ImageError, SettingError};
use flexspline_motion::flight::FlightError;

use crate::resources::TABLE_FILE;

/// Why an FMU cannot be made, stepped, or taken up again.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FmuError {
    /// A file of the resources, or its folder.
    #[error("{file}: {what}")]
    File {
        /// Its name or path, of a text file with the line.
        file: String,
        /// The fault.
        what: String,
    },
    /// The table.
    #[error("{TABLE_FILE}: {0}")]
    Table(#[from] ImageError),
    /// The resource location names no folder here.
    #[error("resource location: found \"{uri}\"{why}, allowed: file:///folder")]
    Location {
        /// The value found.
        uri: String,
        /// Why it names none.
        why: &'static str,
    },
    /// The description belongs to another FMU.
    #[error("guid: found \"{found}\", allowed: {allowed}")]
    Guid {
        /// That of the description.
        found: String,
        /// That of the resources.
        allowed: String,
    },
    /// The value of a variable.
    #[error("{name}: found {found}, allowed: {allowed}")]
    Value {
        /// Which variable.
        name: &'static str,
        /// Its value.
        found: f64,
        /// The values allowed.
        allowed: &'static str,
    },
    /// A setting that the core refuses.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// The core does not take the table at this temperature.
    #[error("temperature {temperature_c}: {error}")]
    Activate {
        /// °C.
        temperature_c: f32,
        /// Why not.
        error: ActivateError,
    },
    /// The joint cannot be flown.
    #[error(transparent)]
    Flight(#[from] FlightError),
    /// The numbers of the joint are no longer finite.
    #[error("the joint runs away")]
    RunsAway,
}
