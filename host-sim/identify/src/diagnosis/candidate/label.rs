//! The subject of a law: a cause of the library, or a deviation that has no name in it.

use std::fmt;

use crate::causes::{CauseName, Kin};

/// The subject of a law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Label {
    /// A cause of the library.
    Cause(CauseName),
    /// Something that has no cause in the library.
    Deviation(Deviation),
}

/// A deviation without a cause.
#[derive(Clone, Copy, Debug)]
pub enum Deviation {
    /// A line at any order.
    Line {
        /// What it is counted against.
        per: Per,
        /// Periods in that.
        order: f64,
    },
    /// What it looks like.
    Like(&'static str),
}

/// What a line is counted against.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Per {
    /// A turn of the generator.
    GeneratorTurn,
    /// A turn of the output.
    OutputTurn,
    /// A second.
    Second,
}

impl fmt::Display for Per {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Per::GeneratorTurn => "generator turn",
            Per::OutputTurn => "output turn",
            Per::Second => "second",
        })
    }
}

impl PartialEq for Deviation {
    /// Lines whose orders read the same are the same line.
    fn eq(&self, other: &Deviation) -> bool {
        match (self, other) {
            (Deviation::Line { per: a, .. }, Deviation::Line { per: b, .. }) => {
                a == b && self.to_string() == other.to_string()
            }
            (Deviation::Like(a), Deviation::Like(b)) => a == b,
            (Deviation::Line { .. }, Deviation::Like(_)) | (Deviation::Like(_), Deviation::Line { .. }) => false,
        }
    }
}

impl fmt::Display for Deviation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Deviation::Line { per, order } => f.pad(&format!("line of {order:.4} per {per}")),
            Deviation::Like(text) => f.pad(text),
        }
    }
}

impl fmt::Display for Label {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Label::Cause(cause) => cause.fmt(f),
            Label::Deviation(deviation) => deviation.fmt(f),
        }
    }
}

impl From<CauseName> for Label {
    fn from(cause: CauseName) -> Label {
        Label::Cause(cause)
    }
}

impl From<&'static str> for Label {
    fn from(like: &'static str) -> Label {
        Label::Deviation(Deviation::Like(like))
    }
}

impl Label {
    /// The cause, if it is one.
    #[must_use]
    pub const fn cause(self) -> Option<CauseName> {
        match self {
            Label::Cause(cause) => Some(cause),
            Label::Deviation(_) => None,
        }
    }

    /// What its misfit may be taken for.
    pub(super) fn kin(self) -> Kin {
        match self {
            Label::Cause(cause) => cause.spec().kin,
            Label::Deviation(_) => Kin::Unlike,
        }
    }
}
