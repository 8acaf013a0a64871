//! What is wrong with a drive: one message per problem, each with its place, field, value found and what is allowed.

use std::fmt;

/// A drive that is refused. Its text is one line per problem.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", lines(.problems))]
pub struct DriveError {
    /// Every problem found, in the order of the fields; never empty.
    pub problems: Vec<Problem>,
}

/// One reason to refuse a drive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// File and line (`drive.toml:12`), or `--set`; empty for a drive made in a program.
    pub place: String,
    /// Path of the field as it stands in the file, `flexspline.teeth`; empty if no field is to blame.
    pub field: String,
    /// The value found and what is allowed, or what does not fit.
    pub what: String,
}

impl Problem {
    /// A problem of `field`, its place not known yet.
    pub fn of(field: &str, what: impl Into<String>) -> Self {
        Problem { place: String::new(), field: field.to_owned(), what: what.into() }
    }
}

impl From<Problem> for DriveError {
    fn from(problem: Problem) -> Self {
        DriveError { problems: vec![problem] }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for part in [&self.place, &self.field] {
            if !part.is_empty() {
                write!(f, "{part}: ")?;
            }
        }
        f.write_str(&self.what)
    }
}

fn lines(problems: &[Problem]) -> String {
    problems.iter().map(Problem::to_string).collect::<Vec<_>>().join("\n")
}
