//! The subject of a law: a cause of the library, or a deviation that has no name in it.

use std::fmt;

use crate::causes::{CauseName, Kin};
use crate::measurement::FaultName;

/// The subject of a law.
#[derive(Clone, Copy, Debug)]
pub enum Label {
    /// A cause of the library.
    Cause(CauseName),
    /// A deviation without a cause: a line at any order.
    Line {
        /// The turn or the time that its order is counted in.
        per: Per,
        /// Periods in that.
        order: f64,
    },
    /// A deviation without a cause, in the words of a report.
    Like(&'static str),
    /// A fault of the data, from some time of a session on, s.
    Fault {
        /// Its name.
        name: FaultName,
        /// The session, from 0.
        session: usize,
        /// Since its begin.
        since_s: f64,
    },
}

/// The turn or the time that the order of a line is counted in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Per {
    /// A turn of the generator.
    GeneratorTurn,
    /// A turn of the output.
    OutputTurn,
    /// A second.
    Second,
}

impl fmt::Display for Label {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (order, per) = match self {
            Label::Cause(cause) => return cause.fmt(f),
            Label::Like(text) => return f.pad(text),
            Label::Fault { name, session, since_s } => {
                return f.pad(&format!("{} from {since_s} s of session {} on", name.as_str(), session + 1));
            }
            Label::Line { per: Per::GeneratorTurn, order } => (order, "generator turn"),
            Label::Line { per: Per::OutputTurn, order } => (order, "output turn"),
            Label::Line { per: Per::Second, order } => (order, "second"),
        };
        f.pad(&format!("line of {order:.4} per {per}"))
    }
}

impl PartialEq for Label {
    /// Those that read the same are the same: so lines of nearly the same order.
    fn eq(&self, other: &Label) -> bool {
        self.to_string() == other.to_string()
    }
}

impl From<CauseName> for Label {
    fn from(cause: CauseName) -> Label {
        Label::Cause(cause)
    }
}

impl From<&'static str> for Label {
    fn from(like: &'static str) -> Label {
        Label::Like(like)
    }
}

impl Label {
    /// The cause, if it is one.
    pub const fn cause(self) -> Option<CauseName> {
        match self {
            Label::Cause(cause) => Some(cause),
            Label::Line { .. } | Label::Like(_) | Label::Fault { .. } => None,
        }
    }

    /// The laws that its misfit resembles.
    pub(super) fn kin(self) -> Kin {
        self.cause().map_or(Kin::Unlike, |cause| cause.spec().kin)
    }
}
