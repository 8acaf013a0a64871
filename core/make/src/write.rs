//! Writing an image: numbers become counts and units, and what is written is checked as a reader does.

use crate::slopes::Slopes;
use core::fmt;
use flexspline::shared::grid::{self, MAX_CLAMPED_NODES, MAX_PERIODIC_NODES, MIN_PERIODIC_NODES, PeriodicAxis};
use flexspline::shared::image::{
    BYTE_ORDER_MARK, MAGIC, MAX_RIPPLE_NODES, MAX_TEMPERATURE_NODES, RESERVED, TEXT_BYTES, UNITS_PER_COUNT, cell_width,
    complete, counted, image_bytes, limit_counts, plan_of, ripple_row,
};
use flexspline::shared::num;
use flexspline::{Drive, Field, FixedMember, GeneratorKind, ImageError, Table};

/// Origin of a table and its range of validity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Provenance<'a> {
    /// Kind of wave generator.
    pub generator_kind: GeneratorKind,
    /// BLAKE3 of the drive description.
    pub drive_hash: [u8; 32],
    /// Program and version, at most 24 printable ASCII characters.
    pub tool_version: &'a str,
    /// Mesh or data the samples came from, at most 24 printable ASCII characters.
    pub mesh_level: &'a str,
    /// Relative residual the solver reached, ≥ 0; 0 for measured samples.
    pub solver_residual: f32,
    /// Torques the table holds for, N·m; inside the torque nodes unless there is only one.
    pub torque_range_n_m: [f32; 2],
    /// Temperatures the table holds for, °C; inside the temperature nodes unless there is only one.
    pub temperature_range_c: [f32; 2],
    /// Largest |error| the table may give, rad, above 0 and at most [`Table::MAX_ERROR_RAD`].
    pub error_limit_rad: f32,
}

/// The numbers of a table. All angles are radians at the output; curves and ripple are B-spline coefficients
/// ([`grid`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableData<'a> {
    /// Tooth counts and fixed member.
    pub drive: Drive,
    /// Torque nodes, N·m, strictly increasing.
    pub torque_nodes_n_m: &'a [f32],
    /// Temperature nodes, °C, strictly increasing.
    pub temperature_nodes_c: &'a [f32],
    /// Nodes over one tooth pitch; 0 for no ripple.
    pub ripple_nodes: usize,
    /// D, `[temperature][torque]`; its slopes follow from it ([`crate::project`]).
    pub mean_rad: &'a [f32],
    /// H, `[temperature][torque]`, ≥ 0.
    pub half_width_rad: &'a [f32],
    /// R, `[temperature][torque][ripple node]`.
    pub mean_ripple_rad: &'a [f32],
    /// h, `[temperature][torque][ripple node]`, `H + h ≥ 0`.
    pub half_width_ripple_rad: &'a [f32],
    /// A over the generator angle; empty if absent.
    pub generator_curve_rad: &'a [f32],
    /// B over the material phase; empty if absent.
    pub material_curve_rad: &'a [f32],
    /// C over the output angle; empty if absent.
    pub output_curve_rad: &'a [f32],
    /// Largest deviation from the samples, rad.
    pub projection_worst_rad: f32,
    /// Root mean square deviation from the samples, rad.
    pub projection_rms_rad: f32,
}

/// Why no image was written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WriteError {
    /// The buffer does not hold the image.
    BufferTooSmall {
        /// Bytes needed.
        needed: usize,
        /// Bytes given.
        found: usize,
    },
    /// An array does not have the length that the axes give.
    Shape {
        /// Which array.
        field: Field,
        /// Numbers found.
        found: usize,
        /// Numbers needed.
        needed: usize,
    },
    /// A text is too long.
    TextTooLong {
        /// Which text.
        field: Field,
        /// Bytes found; [`TEXT_BYTES`] are allowed.
        found: usize,
    },
    /// The reader would refuse the image.
    Refused(ImageError),
}

impl fmt::Display for WriteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::BufferTooSmall { needed, found } => {
                write!(f, "the image needs {needed} bytes, the buffer has {found}")
            }
            Self::Shape { field, found, needed } => {
                write!(f, "{field}: {found} numbers where the axes need {needed}")
            }
            Self::TextTooLong { field, found } => {
                write!(f, "{field}: {found} bytes, at most {TEXT_BYTES} are allowed")
            }
            Self::Refused(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for WriteError {}

impl From<ImageError> for WriteError {
    fn from(error: ImageError) -> Self {
        Self::Refused(error)
    }
}

/// Fills a buffer from the front; what does not fit is only counted.
struct ImageWriter<'o> {
    rest: &'o mut [u8],
    needed: usize,
}

impl<'o> ImageWriter<'o> {
    fn put(&mut self, bytes: &[u8]) {
        self.needed = self.needed.saturating_add(bytes.len());
        let room = bytes.len().min(self.rest.len());
        let (here, rest) = core::mem::take(&mut self.rest).split_at_mut_checked(room).unwrap_or_default();
        here.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        self.rest = rest;
    }

    fn put_numbers(&mut self, numbers: &[f32]) {
        numbers.iter().for_each(|number| self.put(&number.to_le_bytes()));
    }

    fn put_text(&mut self, text: &str) {
        let padding = [0u8; TEXT_BYTES];
        self.put(text.as_bytes());
        self.put(padding.get(text.len()..).unwrap_or_default());
    }
}

/// The one place where numbers become integers: to nearest.
pub(crate) fn quantise(value: f64) -> i32 {
    (value + if value < 0.0 { -0.5 } else { 0.5 }) as i32
}

fn check_finite(field: Field, values: &[f32]) -> Result<(), WriteError> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(ImageError::NotFinite { field, index }.into()),
        None => Ok(()),
    }
}

fn needs(field: Field, values: &[f32], needed: usize) -> Result<(), WriteError> {
    if values.len() == needed { Ok(()) } else { Err(WriteError::Shape { field, found: values.len(), needed }) }
}

impl TableData<'_> {
    fn check_shapes(&self) -> Result<(), WriteError> {
        let records = self.torque_nodes_n_m.len().saturating_mul(self.temperature_nodes_c.len());
        let ripples = records.saturating_mul(self.ripple_nodes);
        needs(Field::Mean, self.mean_rad, records)?;
        needs(Field::HalfWidth, self.half_width_rad, records)?;
        needs(Field::MeanRipple, self.mean_ripple_rad, ripples)?;
        needs(Field::HalfWidthRipple, self.half_width_ripple_rad, ripples)
    }

    /// Node counts as the header holds them: torque, temperature, ripple, A, B, C.
    fn counts(&self) -> Result<[u8; 6], ImageError> {
        let curve = |field, values: &[f32]| counted(field, values.len(), MIN_PERIODIC_NODES, MAX_PERIODIC_NODES);
        Ok([
            counted(Field::TorqueNodes, self.torque_nodes_n_m.len(), 1, MAX_CLAMPED_NODES)?,
            counted(Field::TemperatureNodes, self.temperature_nodes_c.len(), 1, MAX_TEMPERATURE_NODES)?,
            counted(Field::RippleNodes, self.ripple_nodes, MIN_PERIODIC_NODES, MAX_RIPPLE_NODES)?,
            curve(Field::GeneratorCurve, self.generator_curve_rad)?,
            curve(Field::MaterialCurve, self.material_curve_rad)?,
            curve(Field::OutputCurve, self.output_curve_rad)?,
        ])
    }

    /// The unit in which the largest ripple of either direction is 32767, rounded up.
    fn ripple_unit(&self) -> u32 {
        let pairs = self.mean_ripple_rad.iter().zip(self.half_width_ripple_rad);
        let largest = pairs.fold(0.0f64, |most, (r, h)| most.max((*r as f64).abs() + (*h as f64).abs()));
        let unit = num::counts(largest) / i16::MAX as f64 * UNITS_PER_COUNT;
        let whole = unit as u32;
        if unit > whole as f64 { whole.saturating_add(1) } else { whole }
    }

    fn put_nodes(&self, out: &mut ImageWriter<'_>) {
        let slopes = &Slopes::new(self.torque_nodes_n_m);
        let nodes = self.torque_nodes_n_m;
        let jumps = grid::jump_intervals(nodes.len(), |i| nodes.get(i).copied().unwrap_or(0.0));
        let torques = nodes.len().max(1);
        for (means, halves) in self.mean_rad.chunks_exact(torques).zip(self.half_width_rad.chunks_exact(torques)) {
            for (node, (mean, half)) in means.iter().zip(halves).enumerate() {
                let slope = slopes.at(node).of(means);
                let half = (num::counts(*half as f64) as f32).to_bits() & !1 | grid::is_jump(jumps, node) as u32;
                for _ in 0..if nodes.len() == 1 { 2 } else { 1 } {
                    out.put_numbers(&[*mean as f64, slope].map(|rad| num::counts(rad) as f32));
                    out.put(&half.to_le_bytes());
                }
            }
        }
    }

    fn put_records(&self, out: &mut ImageWriter<'_>, unit: u32) {
        let Some(axis) = PeriodicAxis::new(self.ripple_nodes).filter(|axis| !axis.is_empty()) else { return };
        let units = |rad: f64| if unit == 0 { 0 } else { quantise(num::counts(rad) * UNITS_PER_COUNT / unit as f64) };
        let mean_ripples = self.mean_ripple_rad.chunks_exact(axis.len());
        for (mean, half) in mean_ripples.zip(self.half_width_ripple_rad.chunks_exact(axis.len())) {
            for side in [-1.0, 1.0] {
                for position in 0..ripple_row(axis.len()) {
                    let value = |ripple: &[f32]| ripple.get(axis.stored_node(position)).copied().unwrap_or(0.0) as f64;
                    out.put(&(units(value(mean) + side * value(half)) as i16).to_le_bytes());
                }
            }
        }
    }
}

/// Writes the image of a table to the front of `out` and returns its length.
///
/// `id` gets the body of the image with the table id zero and returns the first eight bytes of its BLAKE3 hash.
/// The image written has passed [`Table::check`].
///
/// # Errors
/// [`WriteError`] if the arrays do not fit the axes or the buffer, or if the reader would refuse the table.
pub fn write_image(
    data: &TableData<'_>,
    provenance: &Provenance<'_>,
    out: &mut [u8],
    id: impl FnOnce(&[u8]) -> [u8; 8],
) -> Result<usize, WriteError> {
    data.check_shapes()?;
    let counts = data.counts()?;
    for (field, text) in [(Field::ToolVersion, provenance.tool_version), (Field::MeshLevel, provenance.mesh_level)] {
        if text.len() > TEXT_BYTES {
            return Err(WriteError::TextTooLong { field, found: text.len() });
        }
    }
    let curves = [data.generator_curve_rad, data.material_curve_rad, data.output_curve_rad];
    let needed = image_bytes(
        data.torque_nodes_n_m.len(),
        data.temperature_nodes_c.len(),
        data.ripple_nodes,
        curves.map(<[f32]>::len),
    );
    let found = out.len();
    let image = out.get_mut(..needed).ok_or(WriteError::BufferTooSmall { needed, found })?;
    check_finite(Field::MeanRipple, data.mean_ripple_rad)?;
    check_finite(Field::HalfWidthRipple, data.half_width_ripple_rad)?;
    let ripple_unit = data.ripple_unit();
    let nodes = (data.torque_nodes_n_m.len(), data.temperature_nodes_c.len(), data.ripple_nodes);
    let curve_nodes = curves.map(<[f32]>::len);
    let (plan, body_words) = plan_of(nodes.0, nodes.1, nodes.2, curve_nodes);

    let mut writer = ImageWriter { rest: image, needed: 0 };
    writer.put(&MAGIC);
    writer.put(&Table::FORMAT_VERSION.to_le_bytes());
    writer.put(&BYTE_ORDER_MARK.to_le_bytes());
    writer.put(&(needed as u32).to_le_bytes());
    writer.put(&provenance.drive_hash);
    writer.put(&[0; 8]);
    writer.put_text(provenance.tool_version);
    writer.put_text(provenance.mesh_level);
    let fixed = match data.drive.fixed() {
        FixedMember::Flexspline => 0,
        FixedMember::CircularSpline => 1,
    };
    writer.put(&[provenance.generator_kind.code(), fixed]);
    writer.put(&data.drive.flexspline_teeth().to_le_bytes());
    writer.put(&data.drive.circular_spline_teeth().to_le_bytes());
    writer.put(&counts);
    writer.put(&ripple_unit.to_le_bytes());
    writer.put(&limit_counts(provenance.error_limit_rad).to_le_bytes());
    writer.put_numbers(&[provenance.solver_residual, data.projection_worst_rad, data.projection_rms_rad]);
    writer.put_numbers(&provenance.torque_range_n_m);
    writer.put_numbers(&provenance.temperature_range_c);
    writer.put_numbers(&[provenance.error_limit_rad, cell_width(&data.drive, nodes.2)]);
    plan.iter().for_each(|word| writer.put(&word.to_le_bytes()));
    // The inverse follows from the bounds, which are found in the finished image.
    writer.put(&[0; 8]);
    writer.put(&body_words.to_le_bytes());
    writer.put(&[0; RESERVED.end - RESERVED.start]);
    for (axis, slots) in
        [data.torque_nodes_n_m, data.temperature_nodes_c].into_iter().zip([MAX_CLAMPED_NODES, MAX_TEMPERATURE_NODES])
    {
        writer.put_numbers(axis);
        (axis.len()..slots).for_each(|_| writer.put_numbers(&[f32::MAX]));
    }
    for (field, curve) in [Field::GeneratorCurve, Field::MaterialCurve, Field::OutputCurve].into_iter().zip(curves) {
        check_finite(field, curve)?;
        let axis = PeriodicAxis::new(curve.len()).unwrap_or_default();
        for position in 0..axis.stored_len() {
            let value = curve.get(axis.stored_node(position)).copied().unwrap_or(0.0);
            writer.put(&quantise(2.0 * num::counts(value as f64)).to_le_bytes());
        }
    }
    data.put_nodes(&mut writer);
    data.put_records(&mut writer, ripple_unit);

    let body_bytes = writer.needed;
    complete(image, body_bytes, id)?;
    Table::check(image)?;
    Ok(needed)
}
