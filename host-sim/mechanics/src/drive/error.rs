//! Errors of a drive: one message per problem, each with its place, field, value found and allowed values.

use crate::toml_file::{Problem, lines};

/// A drive that is refused. Its text is one line per problem.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", lines(.problems))]
pub struct DriveError {
    /// Every problem found, in the order of the fields; never empty.
    pub problems: Vec<Problem>,
}

impl From<Problem> for DriveError {
    fn from(problem: Problem) -> Self {
        DriveError { problems: vec![problem] }
    }
}
