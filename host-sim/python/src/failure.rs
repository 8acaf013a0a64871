//! Why there is no result, as Python exceptions with the one message that the command prints.

use std::fmt::Display;

use pyo3::PyErr;

/// The exceptions of `flexspline._errors`; they have two bases each, which only Python can say.
mod exceptions {
    pyo3::import_exception!(flexspline._errors, BadInput);
    pyo3::import_exception!(flexspline._errors, NotConverged);
    pyo3::import_exception!(flexspline._errors, NothingGained);
}

/// Why there is no result.
pub enum PythonFailure {
    /// The input is to blame.
    BadInput(String),
    /// The run is.
    NotConverged(String),
    /// The logs make no table that is better than none.
    NothingGained(String),
}

impl PythonFailure {
    /// The fault of the input.
    pub fn bad(what: impl Display) -> PythonFailure {
        PythonFailure::BadInput(what.to_string())
    }

    /// A run that failed, or its input.
    pub fn of(what: impl Display, is_bad_input: bool) -> PythonFailure {
        if is_bad_input { PythonFailure::bad(what) } else { PythonFailure::NotConverged(what.to_string()) }
    }
}

impl From<PythonFailure> for PyErr {
    fn from(failure: PythonFailure) -> PyErr {
        match failure {
            PythonFailure::BadInput(what) => exceptions::BadInput::new_err(with_arguments(&what)),
            PythonFailure::NotConverged(what) => exceptions::NotConverged::new_err(with_arguments(&what)),
            PythonFailure::NothingGained(what) => exceptions::NothingGained::new_err(with_arguments(&what)),
        }
    }
}

/// A message with the names of arguments where it speaks of options of the command: `--node-tolerance-arcsec` is
/// `node_tolerance_arcsec`.
fn with_arguments(message: &str) -> String {
    let mut text = String::with_capacity(message.len());
    let mut rest = message;
    while let Some(at) = rest.find("--") {
        let (before, option) = rest.split_at(at);
        text += before;
        let name = &option[2..];
        let end = name.find(|c: char| !(c.is_ascii_lowercase() || c == '-')).unwrap_or(name.len());
        text += &match &name[..end] {
            "rate" => "rate_hz".to_owned(),
            name => name.replace('-', "_"),
        };
        rest = &name[end..];
    }
    text + rest
}

/// An exception about the input.
pub fn bad(what: impl Display) -> PyErr {
    PythonFailure::bad(what).into()
}
