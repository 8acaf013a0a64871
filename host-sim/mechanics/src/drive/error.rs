//! Errors of a drive: one message per problem, each with its place, field, value found and allowed values.

use super::spec::Drive;
use crate::toml_file::{Problem, lines};
use std::fmt::Display;

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

/// What does not go together in a drive.
pub(super) struct Misfits<'a> {
    pub drive: &'a Drive,
    pub problems: Vec<Problem>,
}

impl Misfits<'_> {
    /// Refuses the value of a field unless `holds`; `why` says what is allowed. Returns `holds`.
    pub fn require(&mut self, holds: bool, field: &str, why: impl Display) -> bool {
        if !holds {
            let listed = self.drive.fields().into_iter().find(|listed| listed.path == field);
            let found = listed.and_then(|listed| listed.value).expect("the path of a field with one value");
            self.problems.push(Problem::of(field, format!("found {found}{why}")));
        }
        holds
    }
}
