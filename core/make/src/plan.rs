//! Specification of the table to make, its samples, and the node that a sample belongs to.

use super::error::ProjectError;
use flexspline::shared::grid::{
    self, ClampedCell, MAX_CLAMPED_NODES, MAX_HALVINGS, MAX_PERIODIC_NODES, MIN_PERIODIC_NODES,
};
use flexspline::shared::image::{MAX_AXIS_VALUE, counted};
use flexspline::shared::image::{MAX_RIPPLE_NODES, MAX_TEMPERATURE_NODES, image_bytes};
use flexspline::{Direction, Drive, Field, GeneratorAngle, ImageError, Table};

/// Most harmonics of one of ψ, ψ − δ, δ.
pub const MAX_HARMONICS: usize = 8;
/// Nodes a curve needs for each period of its highest harmonic: keeps the interpolation error below 6e-4 of it.
pub const NODES_PER_PERIOD: usize = 16;

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
    pub(super) const fn half_width_rad(self) -> f64 {
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

impl<'a> Harmonics<'a> {
    /// These orders, on as few nodes as they need.
    #[must_use]
    pub fn of(orders: &'a [u16]) -> Self {
        let highest = orders.iter().fold(0, |highest, order| usize::from(*order).max(highest));
        Self { orders, nodes: highest.saturating_mul(NODES_PER_PERIOD) }
    }
}

/// Specification of the table to make of the samples.
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
    /// Treatment of a direction that was not sampled.
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

impl<'a> Plan<'a> {
    pub(super) fn records(&self) -> usize {
        self.torque_nodes_n_m.len().saturating_mul(self.temperature_nodes_c.len())
    }

    /// Ripple coefficients of a record and direction; one constant if there is no ripple.
    pub(super) fn coefficients(&self) -> usize {
        self.ripple_nodes.max(1)
    }

    /// Unknowns of one direction.
    pub(super) fn block(&self) -> usize {
        self.records().saturating_mul(self.coefficients())
    }

    pub(super) fn harmonics(&self) -> usize {
        [self.generator, self.material, self.output].iter().map(|part| part.orders.len()).sum()
    }

    pub(super) fn unknowns(&self) -> usize {
        self.block().saturating_add(self.harmonics()).saturating_mul(2)
    }

    /// Length of [`Workspace::numbers`].
    #[must_use]
    pub fn numbers_len(&self) -> usize {
        self.unknowns().saturating_mul(5).saturating_add(self.records().saturating_mul(2))
    }

    /// How much longer [`Workspace::numbers`] has to be to keep the cosines and sines of this many samples.
    #[must_use]
    pub fn kept_len(&self, samples: usize) -> usize {
        self.harmonics().saturating_mul(2).saturating_mul(samples)
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
    pub(super) fn curves(&self) -> [(Field, Harmonics<'a>, f64); 3] {
        let output = 1.0 / self.drive.exact_ratio();
        [
            (Field::GeneratorCurve, self.generator, 1.0),
            (Field::MaterialCurve, self.material, 1.0 - output),
            (Field::OutputCurve, self.output, output),
        ]
    }

    pub(super) fn check(&self) -> Result<(), ProjectError> {
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

    pub(super) fn check_sample(&self, index: usize, sample: &Sample) -> Result<(), ProjectError> {
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
        if error_rad.abs() > Table::MAX_ERROR_RAD as f64 {
            return Err(ProjectError::SampleImplausible { sample: index, error_rad });
        }
        Ok(())
    }

    pub(super) fn error_rad(&self, sample: &Sample) -> f64 {
        sample.output_rad - sample.generator_rad / self.drive.exact_ratio()
    }

    pub(super) fn place(nodes: &[f32], value: f64) -> ClampedCell {
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
    pub(super) fn used<'s>(
        &self,
        samples: &'s [Sample],
    ) -> impl Iterator<Item = (usize, &'s Sample)> + use<'s, '_, 'a> {
        let jumps = self.jumps();
        samples.iter().enumerate().filter(move |(_, sample)| !self.inside_jump(sample, jumps))
    }

    /// The records around a sample and their weights.
    pub(super) fn corners(&self, sample: &Sample) -> [(usize, f64); 4] {
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
}

pub(super) const fn direction_number(direction: Direction) -> usize {
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
pub(super) fn take<'w, T>(
    rest: &mut &'w mut [T],
    part: &'static str,
    needed: usize,
) -> Result<&'w mut [T], ProjectError> {
    let found = rest.len();
    let whole = core::mem::take(rest);
    let (here, left) = whole.split_at_mut_checked(needed).ok_or(ProjectError::Workspace { part, needed, found })?;
    *rest = left;
    Ok(here)
}
