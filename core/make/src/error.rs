//! Why samples make no table.

use crate::WriteError;
use core::fmt;
use flexspline::{Direction, Field, ImageError, Table};

/// Why samples make no table. Node numbers count from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ProjectError {
    /// A part of the workspace is too small.
    Workspace {
        /// Which part.
        part: &'static str,
        /// Length needed.
        needed: usize,
        /// Length found.
        found: usize,
    },
    /// A setting of the plan is not finite or negative.
    Setting {
        /// Which setting.
        name: &'static str,
        /// Value found.
        found: f64,
    },
    /// There are no samples.
    NoSamples,
    /// A number of this sample is not finite, or an angle is beyond ±2³¹ turns.
    SampleNotFinite {
        /// Index of the sample.
        sample: usize,
    },
    /// This sample lies outside the nodes of an axis.
    SampleOutside {
        /// Index of the sample.
        sample: usize,
        /// Which axis.
        axis: Field,
        /// Value found.
        found: f64,
    },
    /// The error of this sample is larger than any table may hold: wrong ratio, units or zero?
    SampleImplausible {
        /// Index of the sample.
        sample: usize,
        /// Its error, rad.
        error_rad: f64,
    },
    /// No sample of either direction at this node.
    MissingNode {
        /// Temperature node.
        temperature: usize,
        /// Torque node.
        torque: usize,
    },
    /// No sample of this direction at this node, and no half-width given for it.
    MissingDirection {
        /// Temperature node.
        temperature: usize,
        /// Torque node.
        torque: usize,
        /// The direction without samples.
        direction: Direction,
    },
    /// Too few different positions inside the tooth pitch, or a gap among them.
    TooFewPositions {
        /// Temperature node.
        temperature: usize,
        /// Torque node.
        torque: usize,
        /// Direction.
        direction: Direction,
        /// Positions found that count.
        found: u32,
        /// Positions needed, evenly spread.
        needed: u32,
    },
    /// An order that its curve cannot hold: below 1, too many, or too few nodes for it.
    Order {
        /// Which curve.
        curve: Field,
        /// Order found.
        order: u16,
        /// Nodes of the curve.
        nodes: usize,
    },
    /// The samples span too few generator turns to distinguish the harmonics from each other and from a constant.
    Coverage {
        /// Generator turns needed; infinite if two harmonics are the same.
        needed_turns: f64,
        /// Generator turns between the first and the last sample.
        found_turns: f64,
    },
    /// Backward motion lies below forward motion by more than the tolerance: the output would lead.
    NegativeHalfWidth {
        /// Temperature node.
        temperature: usize,
        /// Torque node.
        torque: usize,
        /// Half-width found, rad.
        found_rad: f64,
        /// Tolerance, rad.
        tolerance_rad: f64,
    },
    /// The equations were not solved: the samples hardly determine some unknown.
    NotConverged {
        /// Passes over the samples.
        passes: u32,
        /// Relative residual reached.
        residual: f64,
    },
    /// The table misses a sample by more than the limit: samples contradict each other, or an effect has no place in
    /// the plan.
    Deviation {
        /// Index of the sample.
        sample: usize,
        /// Deviation, rad.
        found_rad: f64,
        /// Limit, rad.
        limit_rad: f64,
    },
    /// The table found cannot be written.
    Write(WriteError),
}

impl fmt::Display for ProjectError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Workspace { part, needed, found } => write!(f, "workspace: {needed} {part} needed, {found} given"),
            Self::Setting { name, found } => {
                write!(f, "{name} = {found}: must be finite and not negative")
            }
            Self::NoSamples => f.write_str("no samples"),
            Self::SampleNotFinite { sample } => {
                write!(f, "sample {sample}: a number is not finite")
            }
            Self::SampleOutside { sample, axis, found } => {
                write!(f, "sample {sample}: {found} lies outside the {axis}")
            }
            Self::SampleImplausible { sample, error_rad } => write!(
                f,
                "sample {sample}: output is {error_rad} rad from generator/ratio, at most {} is allowed; \
                 check ratio, units and zero",
                Table::MAX_ERROR_RAD
            ),
            Self::MissingNode { temperature, torque } => {
                write!(f, "no samples at temperature node {temperature}, torque node {torque}")
            }
            Self::MissingDirection { temperature, torque, direction } => {
                write!(f, "no {direction:?} samples at temperature node {temperature}, torque node {torque}")
            }
            Self::TooFewPositions { temperature, torque, direction, found, needed } => write!(
                f,
                "{direction:?} samples at temperature node {temperature}, torque node {torque}: {found} usable \
                 positions in the tooth pitch, {needed} evenly spread ones are needed"
            ),
            Self::Order { curve, order, nodes } => write!(f, "{curve}: order {order} does not fit on {nodes} nodes"),
            Self::Coverage { needed_turns, found_turns } => {
                write!(f, "the samples span {found_turns} generator turns, the harmonics need {needed_turns}")
            }
            Self::NegativeHalfWidth { temperature, torque, found_rad, tolerance_rad } => write!(
                f,
                "half-width of the play {found_rad} rad at temperature node {temperature}, torque node {torque}, \
                 tolerance {tolerance_rad}: are the directions exchanged?"
            ),
            Self::NotConverged { passes, residual } => {
                write!(f, "least squares: relative residual {residual:e} after {passes} passes")
            }
            Self::Deviation { sample, found_rad, limit_rad } => {
                write!(f, "the table misses sample {sample} by {found_rad} rad, the limit is {limit_rad}")
            }
            Self::Write(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for ProjectError {}

impl From<WriteError> for ProjectError {
    fn from(error: WriteError) -> Self {
        Self::Write(error)
    }
}

impl From<ImageError> for ProjectError {
    fn from(error: ImageError) -> Self {
        Self::Write(WriteError::Refused(error))
    }
}
