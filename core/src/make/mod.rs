//! From samples to a table: weighted least squares onto the grid, without heap.
//!
//! A sample is one point of steady motion: generator angle, torque, temperature, direction, output angle. Its error
//! `e = output − generator/ratio` is a linear function of the unknowns
//!
//! ```text
//! e = Σ wθτ·wᵢ·c±[θ][τ][i]  +  Σ vθτ·D[θ][τ]  +  Σ aₖ·cos(k·phase) + bₖ·sin(k·phase)
//! ```
//!
//! with the same weights (torque, temperature, tooth phase) as the control step uses, one set of ripple coefficients `c±`
//! for each direction, and harmonics of ψ, ψ − δ and δ. D, the average of `(c₋ + c₊)/2` over the pitch, counts again with the
//! weights `v` of what its cubic adds to a straight line between torque nodes; they are zero at the nodes. All are fitted
//! together by conjugate gradients on the normal equations, scaled by their diagonal. Then centre `(c₋ + c₊)/2` and
//! half-width `(c₋ − c₊)/2` give D, R and H, h.
//!
//! # Between torque nodes
//! The slope of D at a torque node is that of a polynomial through D at the nodes around it, never across a jump. Wind-up that
//! starts steeply at a jump and saturates wants nodes close together there. In a piece of five nodes or more between a jump
//! and an end of the axis the polynomial is a quartic in `√(|τ − τⱼ| + w/4)`, τⱼ the node at the jump and w the interval
//! after it: exact for parabolas, close for roots. In other pieces it is a parabola through three nodes.
//!
//! Largest interpolation error, as part of the rise from 0 to 50 N·m, with nodes at 0.021, 0.12, 0.35, 0.9, 2, 4, 8, 15,
//! 28, 50 N·m, and in the last row at 0.021, 0.12, 0.4, 1.2, 3, 6.5, 12, 20, 33, 50 N·m:
//!
//! | | τ^0.45 to τ^0.6 | τ/(τ + 30) | 1 − exp(−τ/20) | tanh(τ/25) |
//! |---|---|---|---|---|
//! | straight lines | 9.1e-3 | 1.8e-2 | 2.4e-2 | 3.1e-2 |
//! | slopes of parabolas | 5.1e-3 | 9.9e-3 | 1.4e-2 | 1.9e-2 |
//! | slopes of quartics in the root | 7.3e-4 | 1.1e-3 | 2.4e-4 | 6.1e-3 |
//! | the same, other nodes | 6.9e-4 | 4.3e-4 | 3.2e-4 | 6.6e-4 |
//!
//! [`make_image`] then reads the finished image with the code of the control step at every sample and records the worst
//! and the rms deviation in it: that bound includes interpolation, quantisation and single precision.
//!
//! What samples cannot determine is an error that names the node, never a guess. Samples strictly inside a torque jump
//! say nothing about either side of it; they are left out and counted.
//!
//! ```
//! use flexspline::make::{Harmonics, MissingDirection, Plan, Sample, Workspace, make_image};
//! use flexspline::{Direction, Drive, FixedMember, GeneratorKind, Provenance, Table};
//!
//! let plan = Plan {
//!     drive: Drive::new(188, 190, FixedMember::Flexspline).unwrap(),
//!     torque_nodes_n_m: &[-20.0, 20.0],
//!     temperature_nodes_c: &[20.0],
//!     ripple_nodes: 8,
//!     generator: Harmonics::default(),
//!     material: Harmonics::default(),
//!     output: Harmonics::default(),
//!     missing_direction: MissingDirection::Refuse,
//!     negative_half_width_tolerance_rad: 5e-8,
//!     deviation_limit_rad: 5e-6,
//! };
//! # let provenance = Provenance {
//! #     generator_kind: GeneratorKind::Cam, drive_hash: [0; 32], tool_version: "doc", mesh_level: "none",
//! #     solver_residual: 0.0, torque_range_n_m: [-20.0, 20.0], temperature_range_c: [0.0, 40.0],
//! #     error_limit_rad: 0.02,
//! # };
//! // One tooth pitch at every node, both ways: wind-up, a lag of 1e-4 rad, and a ripple.
//! let mut samples = Vec::new();
//! for torque_n_m in [-20.0, 20.0] {
//!     for (direction, lag_rad) in [(Direction::Forward, 1e-4), (Direction::Backward, -1e-4)] {
//!         for position in 0..8 {
//!             let generator_rad = position as f64 / 8.0 * std::f64::consts::TAU / 188.0;
//!             let error_rad = torque_n_m / 3e4 - lag_rad + 1e-6 * (188.0 * generator_rad).sin();
//!             let output_rad = generator_rad / 95.0 + error_rad;
//!             samples.push(Sample { generator_rad, torque_n_m, temperature_c: 20.0, direction, output_rad });
//!         }
//!     }
//! }
//! let (mut numbers, mut marks) = (vec![0.0; plan.numbers_len()], vec![0; plan.marks_len()]);
//! let (mut values, mut image) = (vec![0.0; plan.values_len()], vec![0; plan.image_bytes()]);
//! let workspace = Workspace { numbers: &mut numbers, marks: &mut marks, values: &mut values };
//! let hash = |_contents: &[u8]| [0; 8]; // the first 8 bytes of BLAKE3
//! let fit = make_image(&plan, &provenance, &samples, workspace, &mut image, hash).unwrap();
//! assert!(fit.worst_rad < 4e-9);
//! assert!(Table::check(&image).is_ok());
//! ```
//!
//! Memory is the caller's: [`Plan::numbers_len`], [`Plan::marks_len`] and [`Plan::values_len`]. A pass over the samples
//! takes one sine and cosine for each harmonic and some 50 multiplications for each sample; well-spread samples need
//! 10 to 30 passes. Uses libm: not for the control step.
#![allow(clippy::arithmetic_side_effects)] // Sizes are limited to small node counts before they are multiplied.

use crate::angle::GeneratorAngle;
use crate::drive::Drive;
use crate::error::{Field, ImageError};
use crate::play::Direction;
use crate::table::grid::{
    self, MAX_CLAMPED_NODES, MAX_HALVINGS, MAX_PERIODIC_NODES, MIN_PERIODIC_NODES, PeriodicAxis, Place,
};
use crate::table::windup::{self, STENCIL, Slopes};
use crate::table::{
    MAX_AXIS_VALUE, MAX_ERROR_RAD, MAX_RIPPLE_NODES, MAX_TEMPERATURE_NODES, Provenance, Table, TableData, WriteError,
    counted, image_bytes, write_image,
};
use core::f64::consts::TAU;
use core::fmt;

/// Most harmonics of one of ψ, ψ − δ, δ.
pub const MAX_HARMONICS: usize = 8;
/// Nodes a curve needs for each period of its highest harmonic: keeps the interpolation error below 6e-4 of it.
pub const NODES_PER_PERIOD: usize = 16;

/// Conjugate gradients stop at this residual relative to the right-hand side: 1e-12 of 0.05 rad is far below 0.01″.
const RELATIVE_RESIDUAL: f64 = 1e-12;
/// Passes over the samples before giving up; 10 to 30 are usual.
const MAX_PASSES: u32 = 500;
/// A harmonic needs this part of its period, or of its beat with another, to be told apart. Below 1, because samples spread
/// over a period end one step short of it.
const PERIOD_NEEDED: f64 = 0.95;
/// A ripple coefficient is determined if its samples weigh at least this part of the average coefficient's.
const WEIGHT_NEEDED: f64 = 0.15;

/// One point of steady motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Generator angle ψ relative to the fixed member, rad.
    pub generator_rad: f64,
    /// Load torque at the output, N·m, positive when it turns the output forward.
    pub torque_n_m: f64,
    /// Temperature, °C.
    pub temperature_c: f64,
    /// Direction in which the *output* moves: that of the generator if the flexspline is fixed, else against it.
    pub direction: Direction,
    /// Output angle δ relative to the fixed member, rad.
    pub output_rad: f64,
}

/// The half-width of the play where samples of one direction only exist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MissingDirection {
    /// Such a node is an error.
    Refuse,
    /// Use this half-width, rad.
    HalfWidth {
        /// Half-width, ≥ 0.
        rad: f64,
    },
}

impl MissingDirection {
    /// The half-width to use; 0 where the node is an error.
    const fn half_width_rad(self) -> f64 {
        match self {
            Self::Refuse => 0.0,
            Self::HalfWidth { rad } => rad,
        }
    }
}

/// One periodic curve of the table: its nodes, and the harmonics fitted onto it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Harmonics<'a> {
    /// Orders per period, each at least 1; empty leaves the curve out.
    pub orders: &'a [u16],
    /// Nodes of the curve, at least [`NODES_PER_PERIOD`] times the highest order; 0 if there are no orders.
    pub nodes: usize,
}

/// What table to make of the samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan<'a> {
    /// Tooth counts and fixed member.
    pub drive: Drive,
    /// Torque nodes, N·m, strictly increasing; two nearly coincident ones hold a jump. Between them D is a cubic.
    pub torque_nodes_n_m: &'a [f32],
    /// Temperature nodes, °C, strictly increasing.
    pub temperature_nodes_c: &'a [f32],
    /// Nodes over one tooth pitch, 0 for none; needs samples at as many different positions.
    pub ripple_nodes: usize,
    /// A over the generator angle ψ.
    pub generator: Harmonics<'a>,
    /// B over the material phase ψ − δ.
    pub material: Harmonics<'a>,
    /// C over the output angle δ.
    pub output: Harmonics<'a>,
    /// What to do where one direction was not sampled.
    pub missing_direction: MissingDirection,
    /// A half-width below zero by no more than this, rad, is noise and set to zero; more is an error.
    pub negative_half_width_tolerance_rad: f64,
    /// A sample that the table misses by more than this, rad, is an error.
    pub deviation_limit_rad: f64,
}

/// Scratch memory of a projection; contents do not matter. Larger is allowed.
#[derive(Debug)]
pub struct Workspace<'w> {
    /// [`Plan::numbers_len`] numbers.
    pub numbers: &'w mut [f64],
    /// [`Plan::marks_len`] marks.
    pub marks: &'w mut [u64],
    /// [`Plan::values_len`] numbers; the table before it becomes an image.
    pub values: &'w mut [f32],
}

/// How well the finished image reproduces the samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Length of the image.
    pub image_bytes: usize,
    /// Largest deviation, rad.
    pub worst_rad: f64,
    /// The sample with the largest deviation.
    pub worst_sample: usize,
    /// Root mean square deviation, rad.
    pub rms_rad: f64,
    /// Samples used.
    pub used: usize,
    /// Samples left out because they lie inside a torque jump.
    pub inside_jumps: usize,
}

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
    /// The samples span too few generator turns to tell the harmonics from each other and from a constant.
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
    /// The table misses a sample by more than the limit: samples contradict each other, or an effect has no place in the plan.
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
                "sample {sample}: output is {error_rad} rad from generator/ratio, at most {MAX_ERROR_RAD} is allowed; \
                 check ratio, units and zero"
            ),
            Self::MissingNode { temperature, torque } => {
                write!(f, "no samples at temperature node {temperature}, torque node {torque}")
            }
            Self::MissingDirection { temperature, torque, direction } => {
                write!(f, "no {direction:?} samples at temperature node {temperature}, torque node {torque}")
            }
            Self::TooFewPositions { temperature, torque, direction, found, needed } => write!(
                f,
                "{direction:?} samples at temperature node {temperature}, torque node {torque}: {found} usable positions \
                 in the tooth pitch, {needed} evenly spread ones are needed"
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

/// One equation: its non-zero coefficients.
struct Row {
    error_rad: f64,
    /// Unknowns of the ripple around the sample, and their weights.
    ripple: [(usize, f64); 12],
    /// Cosine and sine of every harmonic; the first `2·harmonics` count.
    harmonics: [f64; 6 * MAX_HARMONICS],
    bend: Bend,
}

/// What the cubic of D adds to the straight line between two torque nodes, per unit of D.
#[derive(Clone, Copy, Debug, Default)]
struct Bend {
    /// The first torque node, and the weights from there on.
    first: usize,
    weights: [f64; STENCIL + 1],
    /// First record of each temperature, and its share.
    temperatures: [(usize, f64); 2],
}

impl Bend {
    fn for_each(&self, mut visit: impl FnMut(usize, f64)) {
        for (start, share) in self.temperatures {
            for (torque, weight) in (self.first..).zip(self.weights) {
                if weight != 0.0 && share != 0.0 {
                    visit(start + torque, weight * share);
                }
            }
        }
    }

    /// The sum over D of each record.
    fn of(&self, means: &[f64]) -> f64 {
        let mut sum = 0.0;
        self.for_each(|record, weight| sum += weight * means.get(record).copied().unwrap_or(0.0));
        sum
    }
}

impl<'a> Plan<'a> {
    fn records(&self) -> usize {
        self.torque_nodes_n_m.len().saturating_mul(self.temperature_nodes_c.len())
    }

    /// Ripple coefficients of a record and direction; one constant if there is no ripple.
    fn coefficients(&self) -> usize {
        self.ripple_nodes.max(1)
    }

    /// Unknowns of one direction.
    fn block(&self) -> usize {
        self.records().saturating_mul(self.coefficients())
    }

    fn harmonics(&self) -> usize {
        [self.generator, self.material, self.output].iter().map(|part| part.orders.len()).sum()
    }

    fn unknowns(&self) -> usize {
        self.block().saturating_add(self.harmonics()).saturating_mul(2)
    }

    /// Length of [`Workspace::numbers`].
    #[must_use]
    pub fn numbers_len(&self) -> usize {
        self.unknowns().saturating_mul(5).saturating_add(self.records().saturating_mul(2))
    }

    /// Length of [`Workspace::marks`].
    #[must_use]
    pub fn marks_len(&self) -> usize {
        self.records().saturating_mul(2)
    }

    /// Length of [`Workspace::values`].
    #[must_use]
    pub fn values_len(&self) -> usize {
        let curves = self.generator.nodes.saturating_add(self.material.nodes).saturating_add(self.output.nodes);
        let ripple = self.records().saturating_mul(self.ripple_nodes).saturating_mul(2);
        self.records().saturating_mul(2).saturating_add(ripple).saturating_add(curves)
    }

    /// Length of the image.
    #[must_use]
    pub fn image_bytes(&self) -> usize {
        image_bytes(
            self.torque_nodes_n_m.len(),
            self.temperature_nodes_c.len(),
            self.ripple_nodes,
            [self.generator.nodes, self.material.nodes, self.output.nodes],
        )
    }

    /// `(curve, its harmonics, periods in a generator turn)`.
    fn curves(&self) -> [(Field, Harmonics<'a>, f64); 3] {
        let output = 1.0 / self.drive.exact_ratio();
        [
            (Field::GeneratorCurve, self.generator, 1.0),
            (Field::MaterialCurve, self.material, 1.0 - output),
            (Field::OutputCurve, self.output, output),
        ]
    }

    fn check(&self) -> Result<(), ProjectError> {
        counted(Field::TorqueNodes, self.torque_nodes_n_m.len(), 1, MAX_CLAMPED_NODES)?;
        counted(Field::TemperatureNodes, self.temperature_nodes_c.len(), 1, MAX_TEMPERATURE_NODES)?;
        counted(Field::RippleNodes, self.ripple_nodes, MIN_PERIODIC_NODES, MAX_RIPPLE_NODES)?;
        check_axis(Field::TorqueNodes, self.torque_nodes_n_m)?;
        check_axis(Field::TemperatureNodes, self.temperature_nodes_c)?;
        for (curve, harmonics, _) in self.curves() {
            counted(curve, harmonics.nodes, MIN_PERIODIC_NODES, MAX_PERIODIC_NODES)?;
            for (number, &order) in harmonics.orders.iter().enumerate() {
                let fits = order >= 1 && (order as usize).saturating_mul(NODES_PER_PERIOD) <= harmonics.nodes;
                if !fits || number >= MAX_HARMONICS {
                    return Err(ProjectError::Order { curve, order, nodes: harmonics.nodes });
                }
            }
        }
        for (name, found) in [
            ("half-width for a missing direction", self.missing_direction.half_width_rad()),
            ("tolerance of a negative half-width", self.negative_half_width_tolerance_rad),
            ("deviation limit", self.deviation_limit_rad),
        ] {
            if found.is_nan() || found < 0.0 {
                return Err(ProjectError::Setting { name, found });
            }
        }
        Ok(())
    }

    fn check_sample(&self, index: usize, sample: &Sample) -> Result<(), ProjectError> {
        let numbers = [sample.generator_rad, sample.torque_n_m, sample.temperature_c, sample.output_rad];
        if !numbers.iter().all(|number| number.is_finite()) || GeneratorAngle::from_rad(sample.generator_rad).is_none()
        {
            return Err(ProjectError::SampleNotFinite { sample: index });
        }
        for (axis, nodes, found) in [
            (Field::TorqueNodes, self.torque_nodes_n_m, sample.torque_n_m),
            (Field::TemperatureNodes, self.temperature_nodes_c, sample.temperature_c),
        ] {
            let outside = |edge: Option<&f32>, sign: f32| edge.is_some_and(|edge| (found as f32 - edge) * sign > 0.0);
            if nodes.len() > 1 && (outside(nodes.first(), -1.0) || outside(nodes.last(), 1.0)) {
                return Err(ProjectError::SampleOutside { sample: index, axis, found });
            }
        }
        let error_rad = self.error_rad(sample);
        if error_rad.abs() > MAX_ERROR_RAD as f64 {
            return Err(ProjectError::SampleImplausible { sample: index, error_rad });
        }
        Ok(())
    }

    fn error_rad(&self, sample: &Sample) -> f64 {
        sample.output_rad - sample.generator_rad / self.drive.exact_ratio()
    }

    fn place(nodes: &[f32], value: f64) -> Place {
        grid::locate_clamped::<MAX_HALVINGS>(nodes.len(), |i| nodes.get(i).copied().unwrap_or(0.0), value as f32)
    }

    /// Whether the torque lies strictly inside a jump.
    fn inside_jump(&self, sample: &Sample, jumps: u64) -> bool {
        let place = Self::place(self.torque_nodes_n_m, sample.torque_n_m);
        place.weight > 0.0 && place.weight < 1.0 && (jumps >> place.below) & 1 == 1
    }

    fn jumps(&self) -> u64 {
        grid::jump_intervals(self.torque_nodes_n_m.len(), |i| self.torque_nodes_n_m.get(i).copied().unwrap_or(0.0))
    }

    /// Samples that say something about a node, with their index.
    fn used<'s>(&self, samples: &'s [Sample]) -> impl Iterator<Item = (usize, &'s Sample)> + use<'s, '_, 'a> {
        let jumps = self.jumps();
        samples.iter().enumerate().filter(move |(_, sample)| !self.inside_jump(sample, jumps))
    }

    /// The records around a sample and their weights.
    fn corners(&self, sample: &Sample) -> [(usize, f64); 4] {
        let torque = Self::place(self.torque_nodes_n_m, sample.torque_n_m);
        let temperature = Self::place(self.temperature_nodes_c, sample.temperature_c);
        let record = |temperature: usize, torque: usize| temperature * self.torque_nodes_n_m.len() + torque;
        let (high, hot) = (torque.weight as f64, temperature.weight as f64);
        [
            (record(temperature.below, torque.below), (1.0 - hot) * (1.0 - high)),
            (record(temperature.below, torque.above), (1.0 - hot) * high),
            (record(temperature.above, torque.below), hot * (1.0 - high)),
            (record(temperature.above, torque.above), hot * high),
        ]
    }

    fn bend(&self, sample: &Sample, slopes: &Slopes) -> Bend {
        let torque = Self::place(self.torque_nodes_n_m, sample.torque_n_m);
        if torque.weight <= 0.0 || torque.weight >= 1.0 {
            return Bend::default();
        }
        let node = |node: usize| self.torque_nodes_n_m.get(node).copied().unwrap_or(0.0);
        let (low, high) = (slopes.at(torque.below), slopes.at(torque.above));
        let mut bend = Bend { first: low.first.min(high.first), ..Bend::default() };
        let mut add = |node: usize, value: f64| add(&mut bend.weights, node - bend.first, value);
        let width = node(torque.above) - node(torque.below);
        let [rise, below, above] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .map(|unit| windup::bend(torque.weight, width, unit) as f64);
        add(torque.above, rise);
        add(torque.below, -rise);
        for (slope, part) in [(low, below), (high, above)] {
            (slope.first..).zip(slope.weights).for_each(|(node, weight)| add(node, part * weight));
        }
        let temperature = Self::place(self.temperature_nodes_c, sample.temperature_c);
        let (start, hot) = (|node: usize| node * self.torque_nodes_n_m.len(), temperature.weight as f64);
        bend.temperatures = [(start(temperature.below), 1.0 - hot), (start(temperature.above), hot)];
        bend
    }

    fn row(&self, sample: &Sample, slopes: &Slopes) -> Row {
        let generator = GeneratorAngle::from_rad(sample.generator_rad).unwrap_or_default();
        let phases = self.drive.phases(generator, self.drive.nominal_output(generator));
        let mut row = Row {
            error_rad: self.error_rad(sample),
            ripple: [(0, 0.0); 12],
            harmonics: [0.0; 6 * MAX_HARMONICS],
            bend: self.bend(sample, slopes),
        };
        let (nodes, weights) = match PeriodicAxis::new(self.ripple_nodes) {
            Some(axis) if !axis.is_empty() => {
                let cell = axis.locate(phases.tooth);
                (axis.around(cell), cell.weights())
            }
            _ => ([0; 3], [1.0, 0.0, 0.0]),
        };
        let first = direction_number(sample.direction) * self.block();
        let pairs = self.corners(sample).into_iter().flat_map(|(record, weight)| {
            let base = first + record * self.coefficients();
            nodes.into_iter().zip(weights).map(move |(node, share)| (base + node, weight * share as f64))
        });
        row.ripple.iter_mut().zip(pairs).for_each(|(to, from)| *to = from);
        let parts =
            [(self.generator, phases.generator), (self.material, phases.material), (self.output, phases.output)];
        let angles = parts.iter().flat_map(|(part, phase)| {
            part.orders.iter().map(|&order| phase.wrapping_mul(order as u32) as f64 * (TAU / 4_294_967_296.0))
        });
        for (pair, angle) in row.harmonics.chunks_exact_mut(2).zip(angles) {
            let (sine, cosine) = libm::sincos(angle);
            pair.iter_mut().zip([cosine, sine]).for_each(|(to, from)| *to = from);
        }
        row
    }

    fn check_coverage(&self, samples: &[Sample]) -> Result<(), ProjectError> {
        let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
        for sample in samples {
            first = first.min(sample.generator_rad);
            last = last.max(sample.generator_rad);
        }
        let found_turns = (last - first) / TAU;
        let curves = self.curves();
        let frequencies = || {
            let harmonics = curves
                .iter()
                .flat_map(|(_, part, periods)| part.orders.iter().map(move |&order| order as f64 * periods));
            harmonics.chain([0.0]).enumerate()
        };
        // The closest two of all frequencies, a constant included, beat with the longest period.
        let mut closest = f64::INFINITY;
        for (i, one) in frequencies() {
            for (j, other) in frequencies() {
                if i < j {
                    closest = closest.min((one.abs() - other.abs()).abs());
                }
            }
        }
        let needed_turns = if closest < 1e-9 { f64::INFINITY } else { PERIOD_NEEDED / closest };
        if found_turns >= needed_turns { Ok(()) } else { Err(ProjectError::Coverage { needed_turns, found_turns }) }
    }

    /// Whether every ripple coefficient has the samples it needs; `diagonal` is that of the normal equations.
    fn check_positions(&self, diagonal: &[f64], marks: &[u64]) -> Result<(), ProjectError> {
        let count = self.coefficients();
        for record in 0..self.records() {
            let (temperature, torque) =
                (record / self.torque_nodes_n_m.len().max(1), record % self.torque_nodes_n_m.len().max(1));
            let mut sampled = 0;
            for direction in [Direction::Forward, Direction::Backward] {
                let node = direction_number(direction) * self.records() + record;
                let weights = diagonal.get(node * count..(node + 1) * count).unwrap_or_default();
                let total: f64 = weights.iter().sum();
                if total <= 0.0 {
                    continue;
                }
                sampled += 1;
                let enough = WEIGHT_NEEDED * total / count as f64;
                let gaps = weights.iter().filter(|weight| **weight < enough).count() as u32;
                let positions = marks.get(node).map_or(0, |mark| mark.count_ones());
                let needed = count as u32;
                if positions < needed || gaps > 0 {
                    let found = positions.min(needed.saturating_sub(gaps));
                    return Err(ProjectError::TooFewPositions { temperature, torque, direction, found, needed });
                }
            }
            if sampled == 0 {
                return Err(ProjectError::MissingNode { temperature, torque });
            }
            let missing = [Direction::Forward, Direction::Backward].into_iter().find(|&direction| {
                let node = direction_number(direction) * self.records() + record;
                diagonal.get(node * count).is_none_or(|weight| *weight <= 0.0)
            });
            if let (Some(direction), MissingDirection::Refuse) = (missing, self.missing_direction) {
                return Err(ProjectError::MissingDirection { temperature, torque, direction });
            }
        }
        Ok(())
    }
}

const fn direction_number(direction: Direction) -> usize {
    match direction {
        Direction::Forward => 0,
        Direction::Backward => 1,
    }
}

fn check_axis(field: Field, nodes: &[f32]) -> Result<(), ImageError> {
    let mut before = f32::NEG_INFINITY;
    for (index, &node) in nodes.iter().enumerate() {
        if !node.is_finite() {
            return Err(ImageError::NotFinite { field, index });
        }
        if node.abs() > MAX_AXIS_VALUE {
            let (least, most) = (-MAX_AXIS_VALUE, MAX_AXIS_VALUE);
            return Err(ImageError::OutOfRange { field, found: node, least, most });
        }
        if node <= before {
            return Err(ImageError::NotIncreasing { field, index });
        }
        before = node;
    }
    Ok(())
}

/// Takes `needed` elements off the front of a workspace part.
fn take<'w, T>(rest: &mut &'w mut [T], part: &'static str, needed: usize) -> Result<&'w mut [T], ProjectError> {
    let found = rest.len();
    let whole = core::mem::take(rest);
    let (here, left) = whole.split_at_mut_checked(needed).ok_or(ProjectError::Workspace { part, needed, found })?;
    *rest = left;
    Ok(here)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Fits the plan's table to the samples; deviations are left 0, [`make_image`] finds them.
///
/// # Errors
/// [`ProjectError`]: a plan that makes no table, samples outside it, or unknowns that the samples do not determine.
pub fn project<'a>(
    plan: &Plan<'a>,
    samples: &[Sample],
    workspace: Workspace<'a>,
) -> Result<TableData<'a>, ProjectError> {
    plan.check()?;
    if samples.is_empty() {
        return Err(ProjectError::NoSamples);
    }
    samples.iter().enumerate().try_for_each(|(index, sample)| plan.check_sample(index, sample))?;
    plan.check_coverage(samples)?;

    let unknowns = plan.unknowns();
    let (mut numbers, mut marks, mut values) = (workspace.numbers, workspace.marks, workspace.values);
    if numbers.len() < plan.numbers_len() {
        let (needed, found) = (plan.numbers_len(), numbers.len());
        return Err(ProjectError::Workspace { part: "numbers", needed, found });
    }
    let marks = take(&mut marks, "marks", plan.marks_len())?;
    let values = take(&mut values, "values", plan.values_len())?;
    let solution = take(&mut numbers, "numbers", unknowns)?;
    let mut vector = || take(&mut numbers, "numbers", unknowns);
    let (diagonal, residual, search, product) = (vector()?, vector()?, vector()?, vector()?);
    let mut by_record = || take(&mut numbers, "numbers", plan.records());
    let system = System { diagonal, residual, search, product, means: by_record()?, pulls: by_record()? };

    solve(plan, samples, solution, marks, system)?;
    lay_out(plan, solution, marks, values)
}

/// Vectors of the conjugate gradients.
struct System<'w> {
    diagonal: &'w mut [f64],
    residual: &'w mut [f64],
    search: &'w mut [f64],
    product: &'w mut [f64],
    /// D of each record.
    means: &'w mut [f64],
    /// What each D gathers, before its coefficients share it.
    pulls: &'w mut [f64],
}

/// Which directions were sampled at a record, from the marks of [`solve`].
#[derive(Clone, Copy)]
struct Sampled<'m> {
    records: usize,
    marks: &'m [u64],
}

impl Sampled<'_> {
    fn is(self, direction: Direction, record: usize) -> bool {
        self.marks.get(direction_number(direction) * self.records + record).is_some_and(|mark| *mark != 0)
    }

    /// Share of the average coefficient of each direction in D, and the sign of the half-width given that D has besides.
    fn shares(self, record: usize) -> ([(Direction, f64); 2], f64) {
        let (forward, backward, sign) =
            match (self.is(Direction::Forward, record), self.is(Direction::Backward, record)) {
                (true, false) => (1.0, 0.0, 1.0),
                (false, true) => (0.0, 1.0, -1.0),
                _ => (0.5, 0.5, 0.0),
            };
        ([(Direction::Forward, forward), (Direction::Backward, backward)], sign)
    }
}

impl Plan<'_> {
    /// Coefficients of one record and direction.
    fn range(&self, direction: Direction, record: usize) -> core::ops::Range<usize> {
        let first = direction_number(direction) * self.block() + record * self.coefficients();
        first..first + self.coefficients()
    }

    /// D of each record, without the half-width given for missing directions.
    fn gather_means(&self, sampled: Sampled<'_>, unknowns: &[f64], means: &mut [f64]) {
        for (record, mean) in means.iter_mut().enumerate() {
            let average = |direction| {
                let values = unknowns.get(self.range(direction, record)).unwrap_or_default();
                values.iter().sum::<f64>() / self.coefficients() as f64
            };
            *mean = sampled.shares(record).0.into_iter().map(|(direction, share)| share * average(direction)).sum();
        }
    }

    /// The transpose of [`Self::gather_means`].
    fn spread_pulls(&self, sampled: Sampled<'_>, pulls: &[f64], unknowns: &mut [f64]) {
        for (record, pull) in pulls.iter().enumerate() {
            for (direction, share) in sampled.shares(record).0 {
                let part = share * pull / self.coefficients() as f64;
                let values = unknowns.get_mut(self.range(direction, record)).unwrap_or_default();
                values.iter_mut().for_each(|value| *value += part);
            }
        }
    }
}

/// Least squares by conjugate gradients on the normal equations, scaled by their diagonal.
fn solve(
    plan: &Plan<'_>,
    samples: &[Sample],
    solution: &mut [f64],
    marks: &mut [u64],
    system: System<'_>,
) -> Result<(), ProjectError> {
    let System { diagonal, residual, search, product, means, pulls } = system;
    let slopes = &Slopes::new(plan.torque_nodes_n_m);
    solution.fill(0.0);
    diagonal.fill(0.0);
    residual.fill(0.0);
    marks.fill(0);
    // The diagonal leaves the bend out: it scales the equations and counts the samples of a coefficient.
    for (_, sample) in plan.used(samples) {
        let row = plan.row(sample, slopes);
        for_each_entry(plan, &row, |unknown, value| add(diagonal, unknown, value * value));
        let generator = GeneratorAngle::from_rad(sample.generator_rad).unwrap_or_default();
        let tooth = generator.fraction().wrapping_mul(plan.drive.ripple_order() as u32);
        for (record, weight) in plan.corners(sample) {
            let node = direction_number(sample.direction) * plan.records() + record;
            if let Some(mark) = marks.get_mut(node).filter(|_| weight >= 0.25) {
                *mark |= 1 << (tooth >> 26);
            }
        }
    }
    plan.check_positions(diagonal, marks)?;
    let sampled = Sampled { records: plan.records(), marks };

    // What is known of D before: the half-width given for a missing direction.
    let given = plan.missing_direction.half_width_rad();
    means.iter_mut().enumerate().for_each(|(record, mean)| *mean = given * sampled.shares(record).1);
    pulls.fill(0.0);
    for (_, sample) in plan.used(samples) {
        let row = plan.row(sample, slopes);
        let wanted = row.error_rad - row.bend.of(means);
        for_each_entry(plan, &row, |unknown, value| add(residual, unknown, value * wanted));
        row.bend.for_each(|record, weight| add(pulls, record, weight * wanted));
    }
    plan.spread_pulls(sampled, pulls, residual);

    // Unknowns without samples have an empty row: they stay zero, and `lay_out` fills them.
    let scaled = |value: f64, diagonal: f64| {
        if diagonal > 0.0 { value / diagonal } else { 0.0 }
    };
    for ((search, residual), diagonal) in search.iter_mut().zip(&*residual).zip(&*diagonal) {
        *search = scaled(*residual, *diagonal);
    }
    let mut size = dot(residual, search);
    let start = size;
    let mut passes = 0;
    while size > RELATIVE_RESIDUAL * RELATIVE_RESIDUAL * start {
        if passes == MAX_PASSES {
            return Err(ProjectError::NotConverged { passes, residual: libm::sqrt(size / start) });
        }
        passes += 1;
        product.fill(0.0);
        pulls.fill(0.0);
        plan.gather_means(sampled, search, means);
        for (_, sample) in plan.used(samples) {
            let row = plan.row(sample, slopes);
            let mut along = row.bend.of(means);
            for_each_entry(plan, &row, |unknown, value| {
                along += value * search.get(unknown).copied().unwrap_or(0.0);
            });
            for_each_entry(plan, &row, |unknown, value| add(product, unknown, value * along));
            row.bend.for_each(|record, weight| add(pulls, record, weight * along));
        }
        plan.spread_pulls(sampled, pulls, product);
        let step = size / dot(search, product);
        for ((solution, residual), (search, product)) in
            solution.iter_mut().zip(residual.iter_mut()).zip(search.iter().zip(&*product))
        {
            *solution += step * search;
            *residual -= step * product;
        }
        let before = size;
        size =
            residual.iter().zip(&*diagonal).map(|(&residual, &diagonal)| residual * scaled(residual, diagonal)).sum();
        for ((search, residual), diagonal) in search.iter_mut().zip(&*residual).zip(&*diagonal) {
            *search = scaled(*residual, *diagonal) + size / before * *search;
        }
    }
    Ok(())
}

fn for_each_entry(plan: &Plan<'_>, row: &Row, mut visit: impl FnMut(usize, f64)) {
    row.ripple.iter().filter(|(_, weight)| *weight != 0.0).for_each(|&(unknown, weight)| visit(unknown, weight));
    let first = 2 * plan.block();
    let count = 2 * plan.harmonics();
    row.harmonics.iter().take(count).enumerate().for_each(|(number, &value)| visit(first + number, value));
}

fn add(vector: &mut [f64], index: usize, value: f64) {
    if let Some(element) = vector.get_mut(index) {
        *element += value;
    }
}

/// From coefficients of both directions to centre and half-width, and from harmonics to curves.
fn lay_out<'a>(
    plan: &Plan<'a>,
    solution: &mut [f64],
    marks: &[u64],
    values: &'a mut [f32],
) -> Result<TableData<'a>, ProjectError> {
    let (records, count) = (plan.records(), plan.coefficients());
    let ripples = records * plan.ripple_nodes;
    let mut values = values;
    let mean_rad = take(&mut values, "values", records)?;
    let half_width_rad = take(&mut values, "values", records)?;
    let mean_ripple_rad = take(&mut values, "values", ripples)?;
    let half_width_ripple_rad = take(&mut values, "values", ripples)?;
    let (both, harmonics) = solution.split_at_mut_checked(2 * plan.block()).unwrap_or_default();
    let (forward, backward) = both.split_at_mut_checked(plan.block()).unwrap_or_default();
    let sampled = Sampled { records, marks };
    let one_sided = plan.missing_direction.half_width_rad();
    let means = mean_rad.iter_mut().zip(half_width_rad.iter_mut());
    for (record, (mean, half_width)) in means.enumerate() {
        let range = record * count..(record + 1) * count;
        let forward = forward.get_mut(range.clone()).unwrap_or_default();
        let backward = backward.get_mut(range).unwrap_or_default();
        match (sampled.is(Direction::Forward, record), sampled.is(Direction::Backward, record)) {
            (true, false) => backward.iter_mut().zip(&*forward).for_each(|(b, f)| *b = f + 2.0 * one_sided),
            (false, true) => forward.iter_mut().zip(&*backward).for_each(|(f, b)| *f = b - 2.0 * one_sided),
            _ => {}
        }
        // From here on `forward` holds the centre and `backward` the half-width.
        let mut least = f64::INFINITY;
        for (forward, backward) in forward.iter_mut().zip(backward.iter_mut()) {
            (*forward, *backward) = (0.5 * (*backward + *forward), 0.5 * (*backward - *forward));
            least = least.min(*backward);
            *backward = backward.max(0.0);
        }
        if least < -plan.negative_half_width_tolerance_rad {
            let torque_nodes = plan.torque_nodes_n_m.len().max(1);
            return Err(ProjectError::NegativeHalfWidth {
                temperature: record / torque_nodes,
                torque: record % torque_nodes,
                found_rad: least,
                tolerance_rad: plan.negative_half_width_tolerance_rad,
            });
        }
        let average = |values: &[f64]| values.iter().sum::<f64>() / count as f64;
        let (centre, half) = (average(forward), average(backward));
        (*mean, *half_width) = (centre as f32, half as f32);
        let range = record * plan.ripple_nodes..(record + 1) * plan.ripple_nodes;
        for (ripple, from, middle) in
            [(&mut *mean_ripple_rad, &*forward, centre), (&mut *half_width_ripple_rad, &*backward, half)]
        {
            let ripple = ripple.get_mut(range.clone()).unwrap_or_default();
            ripple.iter_mut().zip(from).for_each(|(to, from)| *to = (from - middle) as f32);
        }
    }
    let mut harmonics = &*harmonics;
    let mut curve = |part: Harmonics<'_>| {
        let (mine, rest) = harmonics.split_at_checked(2 * part.orders.len()).unwrap_or_default();
        harmonics = rest;
        let curve = take(&mut values, "values", part.nodes)?;
        spread_harmonics(part.orders, mine, curve);
        Ok::<&'a [f32], ProjectError>(curve)
    };
    Ok(TableData {
        generator_curve_rad: curve(plan.generator)?,
        material_curve_rad: curve(plan.material)?,
        output_curve_rad: curve(plan.output)?,
        drive: plan.drive,
        torque_nodes_n_m: plan.torque_nodes_n_m,
        temperature_nodes_c: plan.temperature_nodes_c,
        ripple_nodes: plan.ripple_nodes,
        mean_rad,
        half_width_rad,
        mean_ripple_rad,
        half_width_ripple_rad,
        projection_worst_rad: 0.0,
        projection_rms_rad: 0.0,
    })
}

/// Coefficients of the spline that passes through `Σ aₖ·cos(k·phase) + bₖ·sin(k·phase)` at every node.
///
/// A spline with coefficients `cos(k·xᵢ)`, node spacing `s`, has `(3 + cos ks)/4·cos(k·xᵢ)` at its nodes.
fn spread_harmonics(orders: &[u16], amplitudes: &[f64], curve: &mut [f32]) {
    let spacing = TAU / curve.len().max(1) as f64;
    for (node, value) in curve.iter_mut().enumerate() {
        let mut sum = 0.0;
        for (&order, pair) in orders.iter().zip(amplitudes.chunks_exact(2)) {
            let gain = 4.0 / (3.0 + libm::cos(order as f64 * spacing));
            let (sine, cosine) = libm::sincos(order as f64 * spacing * node as f64);
            sum += gain * dot(pair, &[cosine, sine]);
        }
        *value = sum as f32;
    }
}

/// Deviation of an accepted table from samples, read with the code of the control step.
///
/// The samples are those of a [`project`]; ones the table cannot place are left out.
#[must_use]
pub fn measure(table: &Table<'_>, plan: &Plan<'_>, samples: &[Sample]) -> Fit {
    let mut fit = Fit {
        image_bytes: table.image().len(),
        worst_rad: 0.0,
        worst_sample: 0,
        rms_rad: 0.0,
        used: 0,
        inside_jumps: 0,
    };
    let mut squares = 0.0;
    for (index, sample) in plan.used(samples) {
        let Some(generator) = GeneratorAngle::from_rad(sample.generator_rad) else {
            continue;
        };
        let (torque, temperature) = (sample.torque_n_m as f32, sample.temperature_c as f32);
        let Some(error) = table.steady_error_rad(generator, torque, temperature, sample.direction) else {
            continue;
        };
        let deviation = (error as f64 - plan.error_rad(sample)).abs();
        fit.used += 1;
        squares += deviation * deviation;
        if deviation > fit.worst_rad {
            (fit.worst_rad, fit.worst_sample) = (deviation, index);
        }
    }
    fit.rms_rad = libm::sqrt(squares / fit.used.max(1) as f64);
    fit.inside_jumps = samples.len() - fit.used;
    fit
}

/// Makes the image of the plan's table from samples, in `out`, with the deviations it has from them inside.
///
/// `id` as in [`write_image`].
///
/// # Errors
/// As [`project`] and [`write_image`]; [`ProjectError::Deviation`] if a sample is missed by more than the plan allows.
pub fn make_image<'a>(
    plan: &Plan<'a>,
    provenance: &Provenance<'_>,
    samples: &[Sample],
    workspace: Workspace<'a>,
    out: &mut [u8],
    id: impl FnOnce(&[u8]) -> [u8; 8],
) -> Result<Fit, ProjectError> {
    let mut data = project(plan, samples, workspace)?;
    let bytes = write_image(&data, provenance, out, |_| [0; 8])?;
    let fit = measure(&Table::check(out.get(..bytes).unwrap_or_default())?, plan, samples);
    if fit.worst_rad.is_nan() || fit.worst_rad > plan.deviation_limit_rad {
        let (sample, found_rad) = (fit.worst_sample, fit.worst_rad);
        return Err(ProjectError::Deviation { sample, found_rad, limit_rad: plan.deviation_limit_rad });
    }
    // Rounded up: single precision may not make a bound smaller than it is.
    (data.projection_worst_rad, data.projection_rms_rad) =
        ((fit.worst_rad as f32).next_up(), (fit.rms_rad as f32).min(fit.worst_rad as f32));
    write_image(&data, provenance, out, id)?;
    Ok(fit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{self, ARCSEC, Buffers, PITCH};
    use std::vec;
    use std::vec::Vec;

    fn make(plan: &Plan<'_>, samples: &[Sample]) -> Result<(Fit, Vec<u8>), ProjectError> {
        let mut buffers = Buffers::new(plan);
        let mut out = vec![0; plan.image_bytes()];
        let fit = make_image(plan, &fixture::provenance(), samples, buffers.workspace(), &mut out, fixture::id)?;
        Ok((fit, out))
    }

    /// Largest deviation from the closed form at points that made no table, arc-seconds.
    fn worst_elsewhere(image: &[u8], long: bool) -> f64 {
        let table = Table::check(image).unwrap();
        let mut worst: f64 = 0.0;
        for i in 0..20_000 {
            let part = |k: f64| (i as f64 * k).rem_euclid(1.0);
            let turns = if long { 96.0 } else { 1.0 / 188.0 };
            let generator = TAU * turns * part(0.618_033_988);
            let torque = -49.0 + 98.0 * part(0.754_877_666);
            if (torque.abs() - 1.5).abs() < 0.02 {
                continue;
            }
            let temperature = -40.0 + 120.0 * part(0.569_840_291);
            for direction in [Direction::Forward, Direction::Backward] {
                let angle = GeneratorAngle::from_rad(generator).unwrap();
                let found = table.steady_error_rad(angle, torque as f32, temperature as f32, direction).unwrap();
                let truth = fixture::error(generator, torque, temperature, direction, long);
                worst = worst.max((found as f64 - truth).abs() / ARCSEC);
            }
        }
        worst
    }

    #[test]
    fn one_pitch_recovers_ripple_wind_up_and_both_sides_of_the_jumps() {
        let (fit, image) = make(&fixture::plan(false), &fixture::samples(false)).unwrap();
        assert!(fit.worst_rad < 0.002 * ARCSEC, "{} arcsec", fit.worst_rad / ARCSEC);
        assert!(fit.rms_rad > 0.0 && fit.rms_rad < fit.worst_rad);
        assert_eq!((fit.used, fit.inside_jumps), (3 * 11 * 2 * 16, 0));
        let worst = worst_elsewhere(&image, false);
        assert!(worst < 0.01, "{worst} arcsec");
        let table = Table::check(&image).unwrap();
        assert!(table.projection_worst_rad() as f64 >= fit.worst_rad);
        assert!((table.projection_worst_rad() as f64 - fit.worst_rad) < 1e-14);
        assert!((0..11).filter(|&node| table.is_torque_jump(node)).eq([3, 6]));
    }

    #[test]
    fn full_turns_separate_both_families_of_harmonics() {
        let (fit, image) = make(&fixture::plan(true), &fixture::samples(true)).unwrap();
        assert!(fit.worst_rad < 0.009 * ARCSEC, "{} arcsec", fit.worst_rad / ARCSEC);
        let worst = worst_elsewhere(&image, true);
        assert!(worst < 0.01, "{worst} arcsec");
    }

    #[test]
    fn samples_off_the_torque_nodes_recover_the_table_too() {
        let mut samples = fixture::samples(false);
        samples.retain(|sample| sample.torque_n_m.abs() != 20.0);
        for direction in [Direction::Forward, Direction::Backward] {
            for i in 0..2000 {
                let part = |k: f64| (i as f64 * k).rem_euclid(1.0);
                let torque = 5.0 + 45.0 * part(0.754_877_666);
                let temperature = -40.0 + 120.0 * part(0.569_840_291);
                for torque in [torque, -torque] {
                    samples.push(fixture::sample(PITCH * part(0.618), torque, temperature, direction, false));
                }
            }
        }
        let (_, image) = make(&fixture::plan(false), &samples).unwrap();
        let worst = worst_elsewhere(&image, false);
        assert!(worst < 0.01, "{worst} arcsec");
    }

    /// A drive with curved wind-up, one parabola beyond each jump, and a half-width of 3″.
    mod curved {
        use super::*;

        pub const TORQUES: [f32; 12] = [-50.0, -20.0, -8.0, -3.0, -1.51, -1.49, 1.49, 1.51, 3.0, 8.0, 20.0, 50.0];

        pub fn error(generator_rad: f64, torque: f64, temperature: f64, direction: Direction) -> f64 {
            let (load, warm) = (torque.abs(), 1.0 + 1.0e-3 * temperature);
            let wind_up = if load > 1.5 { torque.signum() * (30.0 + load * (20.0 - 0.2 * load)) } else { 5.0 * torque };
            let ripple = 0.3 * (188.0 * generator_rad).cos();
            (warm * wind_up + ripple - 3.0 * direction.sign() as f64) * ARCSEC
        }

        pub fn plan() -> Plan<'static> {
            Plan { torque_nodes_n_m: &TORQUES, ..fixture::plan(false) }
        }

        /// Places spread over everything but the jumps; none on a torque node.
        pub fn places(count: usize) -> impl Iterator<Item = Sample> {
            (0..count).filter_map(|i| {
                let part = |k: f64| (i as f64 * k).rem_euclid(1.0);
                let torque_n_m = (100.0 * part(0.754_877_666) - 50.0) * part(0.618_033_988);
                let (generator_rad, temperature_c) = (PITCH * part(0.414_213_56), 120.0 * part(0.569_840_291) - 40.0);
                let direction = if part(0.302_775_6) < 0.5 { Direction::Forward } else { Direction::Backward };
                let output_rad = generator_rad / 95.0 + error(generator_rad, torque_n_m, temperature_c, direction);
                let outside = (torque_n_m.abs() - 1.5).abs() > 0.02;
                outside.then_some(Sample { generator_rad, torque_n_m, temperature_c, direction, output_rad })
            })
        }

        /// Samples at the nodes of one direction.
        pub fn at_nodes(direction: Direction) -> impl Iterator<Item = Sample> {
            let nodes =
                fixture::TEMPERATURES.into_iter().flat_map(|hot| TORQUES.map(|torque| (hot as f64, torque as f64)));
            nodes.flat_map(move |(temperature_c, torque_n_m)| {
                (0..16).map(move |position| {
                    let generator_rad = PITCH * (position as f64 + 0.4) / 16.0;
                    let output_rad = generator_rad / 95.0 + error(generator_rad, torque_n_m, temperature_c, direction);
                    Sample { generator_rad, torque_n_m, temperature_c, direction, output_rad }
                })
            })
        }

        pub fn worst_elsewhere(image: &[u8]) -> f64 {
            let table = Table::check(image).unwrap();
            places(31_000).skip(11_000).fold(0.0, |worst: f64, place| {
                let angle = GeneratorAngle::from_rad(place.generator_rad).unwrap();
                let (torque, temperature) = (place.torque_n_m as f32, place.temperature_c as f32);
                [Direction::Forward, Direction::Backward].into_iter().fold(worst, |worst, direction| {
                    let found = table.steady_error_rad(angle, torque, temperature, direction).unwrap() as f64;
                    let truth = error(place.generator_rad, place.torque_n_m, place.temperature_c, direction);
                    worst.max((found - truth).abs() / ARCSEC)
                })
            })
        }
    }

    #[test]
    fn curved_wind_up_is_recovered_from_samples_between_the_nodes() {
        // The inner nodes of the jumps get samples of their own: little else lies there.
        let inner = |direction| curved::at_nodes(direction).filter(|sample| sample.torque_n_m.abs() < 1.55);
        let mut samples: Vec<Sample> = curved::places(11_000).collect();
        samples.extend(inner(Direction::Forward).chain(inner(Direction::Backward)));
        let (fit, image) = make(&curved::plan(), &samples).unwrap();
        assert!(fit.worst_rad < 0.005 * ARCSEC, "{} arcsec", fit.worst_rad / ARCSEC);
        let worst = curved::worst_elsewhere(&image);
        assert!(worst < 0.01, "{worst} arcsec");
    }

    #[test]
    fn curved_wind_up_is_recovered_from_samples_at_the_nodes() {
        let samples: Vec<Sample> =
            curved::at_nodes(Direction::Forward).chain(curved::at_nodes(Direction::Backward)).collect();
        let (_, image) = make(&curved::plan(), &samples).unwrap();
        let worst = curved::worst_elsewhere(&image);
        assert!(worst < 0.01, "{worst} arcsec");
    }

    #[test]
    fn a_missing_direction_between_the_nodes_counts_with_the_half_width_given() {
        let mut plan = curved::plan();
        plan.missing_direction = MissingDirection::HalfWidth { rad: 3.0 * ARCSEC };
        for present in [Direction::Forward, Direction::Backward] {
            // The nodes at ±8 have samples of the other direction from one side, those at ±20 and ±50 have none.
            let kept = |sample: &Sample| sample.direction == present || sample.torque_n_m.abs() < 7.9;
            let nodes = curved::at_nodes(Direction::Forward).chain(curved::at_nodes(Direction::Backward));
            let samples: Vec<Sample> = curved::places(11_000).chain(nodes).filter(kept).collect();
            let (fit, image) = make(&plan, &samples).unwrap();
            assert!(fit.worst_rad < 0.005 * ARCSEC, "{} arcsec", fit.worst_rad / ARCSEC);
            let worst = curved::worst_elsewhere(&image);
            assert!(worst < 0.01, "{worst} arcsec");
        }
    }

    #[test]
    fn samples_inside_a_jump_are_left_out_and_counted() {
        let mut samples = fixture::samples(false);
        let mut inside = fixture::sample(0.1, 1.5, 20.0, Direction::Forward, false);
        inside.output_rad += 20.0 * ARCSEC;
        samples.push(inside);
        let (fit, image) = make(&fixture::plan(false), &samples).unwrap();
        assert_eq!(fit.inside_jumps, 1);
        assert!(worst_elsewhere(&image, false) < 0.01);
    }

    #[test]
    fn a_missing_direction_is_named_or_filled_with_the_half_width_given() {
        let mut samples = fixture::samples(false);
        samples.retain(|s| !(s.torque_n_m == 20.0 && s.temperature_c == 80.0 && s.direction == Direction::Backward));
        let mut plan = fixture::plan(false);
        let expected = ProjectError::MissingDirection { temperature: 2, torque: 9, direction: Direction::Backward };
        assert_eq!(make(&plan, &samples).unwrap_err(), expected);

        plan.missing_direction = MissingDirection::HalfWidth { rad: 3.0 * ARCSEC };
        let (_, image) = make(&plan, &samples).unwrap();
        let table = Table::check(&image).unwrap();
        let generator = GeneratorAngle::from_rad(0.01).unwrap();
        let at = |direction| table.steady_error_rad(generator, 20.0, 80.0, direction).unwrap() as f64;
        let width = at(Direction::Backward) - at(Direction::Forward);
        assert!((width - 6.0 * ARCSEC).abs() < 0.001 * ARCSEC, "{} arcsec", width / ARCSEC);
        let truth = fixture::error(0.01, 20.0, 80.0, Direction::Forward, false);
        assert!((at(Direction::Forward) - truth).abs() < 0.005 * ARCSEC);
    }

    #[test]
    fn too_few_samples_are_refused_by_node() {
        let plan = fixture::plan(false);
        let mut samples = fixture::samples(false);
        samples.retain(|s| !(s.torque_n_m == -5.0 && s.temperature_c == 20.0));
        assert_eq!(make(&plan, &samples).unwrap_err(), ProjectError::MissingNode { temperature: 1, torque: 2 });

        let mut thinned = fixture::samples(false);
        let mut number = 0;
        thinned.retain(|s| {
            let here = s.torque_n_m == 0.0 && s.temperature_c == -40.0 && s.direction == Direction::Forward;
            number += usize::from(here);
            !here || number % 2 == 0
        });
        let found = make(&plan, &thinned).unwrap_err();
        let expected = ProjectError::TooFewPositions {
            temperature: 0,
            torque: 5,
            direction: Direction::Forward,
            found: 8,
            needed: 16,
        };
        assert_eq!(found, expected);
        // The same eight positions twice over are still eight.
        let repeated: Vec<Sample> = thinned.iter().chain(&thinned).copied().collect();
        assert!(matches!(make(&plan, &repeated), Err(ProjectError::TooFewPositions { found: 8, .. })));
        // All sixteen in one half of the pitch leave a gap.
        let mut bunched = fixture::samples(false);
        for s in &mut bunched {
            let position = (s.generator_rad - 1.0) / 2.0;
            *s = fixture::sample(1.0 + position, s.torque_n_m, s.temperature_c, s.direction, false);
        }
        assert!(matches!(make(&plan, &bunched), Err(ProjectError::TooFewPositions { .. })));
        assert_eq!(make(&plan, &[]).unwrap_err(), ProjectError::NoSamples);
    }

    #[test]
    fn harmonics_need_the_turns_that_separate_them() {
        let mut samples = fixture::samples(true);
        samples.retain(|s| s.generator_rad < TAU * 40.0);
        let mut plan = fixture::plan(true);
        plan.output = Harmonics::default();
        let Err(ProjectError::Coverage { needed_turns, found_turns }) = make(&plan, &samples) else { panic!() };
        assert!((needed_turns - 0.95 * 47.5).abs() < 1e-9, "{needed_turns}");
        assert!((39.0..40.0).contains(&found_turns), "{found_turns}");

        plan.output = Harmonics { orders: &[95], nodes: 128 };
        assert!(matches!(make(&plan, &samples), Err(ProjectError::Order { order: 95, .. })));
    }

    #[test]
    fn bad_samples_are_named() {
        let plan = fixture::plan(false);
        let with = |change: fn(&mut Sample)| {
            let mut samples = fixture::samples(false);
            change(&mut samples[7]);
            make(&plan, &samples).unwrap_err()
        };
        assert_eq!(with(|s| s.output_rad = f64::NAN), ProjectError::SampleNotFinite { sample: 7 });
        assert_eq!(with(|s| s.generator_rad = 1e300), ProjectError::SampleNotFinite { sample: 7 });
        let expected = ProjectError::SampleOutside { sample: 7, axis: Field::TorqueNodes, found: 51.0 };
        assert_eq!(with(|s| s.torque_n_m = 51.0), expected);
        let expected = ProjectError::SampleOutside { sample: 7, axis: Field::TemperatureNodes, found: -41.0 };
        assert_eq!(with(|s| s.temperature_c = -41.0), expected);
        // An output angle in degrees.
        assert!(matches!(with(|s| s.output_rad *= 57.3), ProjectError::SampleImplausible { sample: 7, .. }));
    }

    #[test]
    fn samples_that_contradict_each_other_are_refused() {
        let mut samples = fixture::samples(false);
        let mut again = samples[40];
        again.output_rad += 0.2 * ARCSEC;
        samples.push(again);
        let mut plan = fixture::plan(false);
        plan.deviation_limit_rad = 0.05 * ARCSEC;
        let found = make(&plan, &samples).unwrap_err();
        let ProjectError::Deviation { sample, found_rad, .. } = found else { panic!("{found}") };
        assert!(sample == 40 || sample == samples.len() - 1, "{sample}");
        assert!((found_rad - 0.1 * ARCSEC).abs() < 0.01 * ARCSEC, "{found}");
    }

    #[test]
    fn exchanged_directions_are_refused() {
        let mut samples = fixture::samples(false);
        for s in &mut samples {
            s.direction = match s.direction {
                Direction::Forward => Direction::Backward,
                Direction::Backward => Direction::Forward,
            };
        }
        let found = make(&fixture::plan(false), &samples).unwrap_err();
        assert!(matches!(found, ProjectError::NegativeHalfWidth { temperature: 0, torque: 0, .. }), "{found}");
    }

    #[test]
    fn a_half_width_of_zero_survives_quantisation() {
        let mut plan = fixture::plan(false);
        plan.negative_half_width_tolerance_rad = 0.2 * ARCSEC;
        let mut samples = fixture::samples(false);
        for s in &mut samples {
            let other = |direction| fixture::error(s.generator_rad, s.torque_n_m, s.temperature_c, direction, false);
            // Only the ripple of the half-width is left, on a half-width that just stays above zero.
            let half = 0.1 * ARCSEC * (1.0 + (188.0 * s.generator_rad).sin());
            let centre = 0.5 * (other(Direction::Forward) + other(Direction::Backward));
            s.output_rad = s.generator_rad / 95.0 + centre - s.direction.sign() as f64 * half;
        }
        let (fit, _) = make(&plan, &samples).unwrap();
        assert!(fit.worst_rad < 0.005 * ARCSEC, "{} arcsec", fit.worst_rad / ARCSEC);
    }

    #[test]
    fn plans_and_workspaces_that_do_not_fit_are_refused() {
        let samples = fixture::samples(false);
        let refused = |change: fn(&mut Plan<'static>)| {
            let mut plan = fixture::plan(false);
            change(&mut plan);
            make(&plan, &samples).unwrap_err()
        };
        assert!(matches!(
            refused(|p| p.torque_nodes_n_m = &[1.0, 1.0]),
            ProjectError::Write(WriteError::Refused(ImageError::NotIncreasing { index: 1, .. }))
        ));
        assert!(matches!(
            refused(|p| p.ripple_nodes = 33),
            ProjectError::Write(WriteError::Refused(ImageError::Count { field: Field::RippleNodes, found: 33, .. }))
        ));
        assert!(matches!(refused(|p| p.deviation_limit_rad = f64::NAN), ProjectError::Setting { .. }));
        assert!(matches!(
            refused(|p| p.generator = Harmonics { orders: &[2, 9], nodes: 64 }),
            ProjectError::Order { order: 9, nodes: 64, .. }
        ));

        let plan = fixture::plan(false);
        let mut buffers = Buffers::new(&plan);
        let mut out = vec![0; plan.image_bytes()];
        for part in ["numbers", "marks", "values"] {
            let Workspace { mut numbers, mut marks, mut values } = buffers.workspace();
            match part {
                "numbers" => numbers = numbers.split_last_mut().unwrap().1,
                "marks" => marks = marks.split_last_mut().unwrap().1,
                _ => values = values.split_last_mut().unwrap().1,
            }
            let workspace = Workspace { numbers, marks, values };
            let found = make_image(&plan, &fixture::provenance(), &samples, workspace, &mut out, fixture::id);
            assert!(matches!(found, Err(ProjectError::Workspace { part: named, .. }) if named == part), "{found:?}");
        }
    }
}
