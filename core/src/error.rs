//! Errors of a drive or an image, as small `Copy` values that name the field and the value found.

use core::fmt;

/// Tooth counts that make no drive: `1 ≤ flexspline_teeth < circular_spline_teeth ≤ 2·flexspline_teeth` is required.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveError {
    /// Flexspline teeth found.
    pub flexspline_teeth: u16,
    /// Circular spline teeth found.
    pub circular_spline_teeth: u16,
}

impl fmt::Display for DriveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} flexspline teeth and {} circular spline teeth: the flexspline needs at least one, fewer than the \
             circular spline and at least half as many",
            self.flexspline_teeth, self.circular_spline_teeth
        )
    }
}

impl core::error::Error for DriveError {}

macro_rules! fields {
    ($($(#[$doc:meta])* $field:ident: $name:literal,)*) => {
        /// A field of a table or its image.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Field {
            $($(#[$doc])* $field,)*
        }

        impl fmt::Display for Field {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(match self {
                    $(Self::$field => $name,)*
                })
            }
        }
    };
}

fields! {
    /// The text that names the program that made the table.
    ToolVersion: "tool version",
    /// The text that names the mesh.
    MeshLevel: "mesh level",
    /// Torque nodes, N·m.
    TorqueNodes: "torque nodes",
    /// Temperature nodes, °C.
    TemperatureNodes: "temperature nodes",
    /// Nodes over one tooth pitch.
    RippleNodes: "ripple nodes",
    /// Curve over the generator angle ψ, rad.
    GeneratorCurve: "curve over the generator angle",
    /// Curve over the material phase ψ − δ, rad.
    MaterialCurve: "curve over the material phase",
    /// Curve over the output angle δ, rad.
    OutputCurve: "curve over the output angle",
    /// Mean error (wind-up) at a torque and temperature, rad.
    Mean: "mean error",
    /// Mean half-width of the play, rad.
    HalfWidth: "half-width of the play",
    /// Slope of the mean error over the torque, counts/(N·m).
    MeanSlope: "slope of the mean error",
    /// Ripple of the mean over one tooth pitch, rad.
    MeanRipple: "ripple of the mean",
    /// Ripple of the half-width over one tooth pitch, rad.
    HalfWidthRipple: "ripple of the half-width",
    /// Residual the solver reached.
    SolverResidual: "solver residual",
    /// Largest deviation of the table from the samples, rad.
    ProjectionWorst: "worst projection error",
    /// Root mean square deviation of the table from the samples, rad.
    ProjectionRms: "rms projection error",
    /// Torques the table holds for, N·m.
    TorqueRange: "torque range",
    /// Temperatures the table holds for, °C.
    TemperatureRange: "temperature range",
    /// Largest error the table may give, rad.
    ErrorLimit: "error limit",
}

/// Why an image is refused. The first check that fails is reported: the envelope (length, magic, byte order, version,
/// CRC-32), what it is for, sizes, pages, and last the numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ImageError {
    /// Fewer bytes than a header and its checksums.
    TooShort {
        /// Bytes found.
        found: usize,
        /// Fewest bytes an image can have.
        needed: usize,
    },
    /// Not a table image.
    Magic,
    /// A format version this program does not read.
    Version {
        /// Version found.
        found: u16,
        /// Version read.
        allowed: u16,
    },
    /// Bytes were swapped on the way.
    ByteOrder {
        /// Mark found.
        found: u16,
    },
    /// The stated length differs from the bytes given.
    Length {
        /// Length in the header, bytes.
        stated: usize,
        /// Bytes found.
        found: usize,
    },
    /// The CRC-32 of the whole image does not match.
    Crc {
        /// In the image.
        stated: u32,
        /// Computed.
        computed: u32,
    },
    /// The CRC-32 of one 256-byte page does not match.
    PageCrc {
        /// Page number.
        page: usize,
    },
    /// Reserved bytes are not zero.
    Reserved {
        /// Offset in the image.
        offset: usize,
    },
    /// A text is not printable ASCII padded with zeros.
    Text {
        /// Which text.
        field: Field,
    },
    /// Unknown kind of wave generator.
    GeneratorKind {
        /// Code found.
        found: u8,
    },
    /// Unknown fixed member.
    FixedMember {
        /// Code found.
        found: u8,
    },
    /// Tooth counts that make no drive.
    Teeth(DriveError),
    /// A number of nodes outside its limits.
    Count {
        /// Which nodes.
        field: Field,
        /// Number found.
        found: usize,
        /// Fewest allowed (periodic parts may also have none).
        least: usize,
        /// Most allowed.
        most: usize,
    },
    /// The stated counts and the length do not fit together.
    Size {
        /// Bytes the counts need.
        needed: usize,
        /// Bytes found.
        found: usize,
    },
    /// NaN or infinite.
    NotFinite {
        /// Which field.
        field: Field,
        /// Index inside the field.
        index: usize,
    },
    /// Axis nodes that do not increase strictly.
    NotIncreasing {
        /// Which axis.
        field: Field,
        /// First node not above the one before.
        index: usize,
    },
    /// A repeated node at the ends of a periodic curve differs from the node it repeats.
    NotClosed {
        /// Which curve; both ripples of a record count as ripple of the mean.
        field: Field,
        /// Position in the stored curve.
        index: usize,
    },
    /// A number that follows from others does not: an offset, a unit, a bound or padding.
    Derived {
        /// Offset in the image, bytes.
        offset: usize,
    },
    /// A value outside its limits.
    OutOfRange {
        /// Which field.
        field: Field,
        /// Value found.
        found: f32,
        /// Smallest allowed.
        least: f32,
        /// Largest allowed.
        most: f32,
    },
    /// The play would have a negative width.
    NegativeHalfWidth {
        /// Temperature node.
        temperature: usize,
        /// Torque node.
        torque: usize,
        /// Smallest half-width there, rad.
        found_rad: f32,
    },
    /// The table can give a larger error than it states as its limit.
    ErrorBound {
        /// Largest error it can give, rad.
        found_rad: f32,
        /// Its limit, rad.
        allowed_rad: f32,
    },
    /// |ratio·de/dψ| reaches 1: the output would not follow the generator one to one, and the inverse may not exist.
    Slope {
        /// Bound of the slope found; below 1 is allowed.
        found: f32,
    },
    /// The error on one flank falls while the load grows. No drive gives way against its load; the torque may have the
    /// wrong sign.
    Falls {
        /// Temperature node.
        temperature: usize,
        /// Torque node above.
        torque: usize,
        /// The change of the error, or a part of it that the slopes at the nodes make, rad.
        found_rad: f32,
    },
    /// The error on one flank grows faster with the load than that of any drive, or a jump is higher than half a tooth
    /// pitch.
    Steep {
        /// Temperature node.
        temperature: usize,
        /// Torque node above.
        torque: usize,
        /// The change of the error, or a part of it that the slopes at the nodes make, rad.
        found_rad: f32,
        /// The most that is allowed, rad.
        allowed_rad: f32,
    },
    /// The inverse does not come close enough in the iterations that a step may take.
    Inverse {
        /// Error left, rad at the output; at most [`Table::MAX_INVERSE_ERROR_RAD`](crate::Table::MAX_INVERSE_ERROR_RAD)
        /// is allowed.
        left_rad: f32,
    },
}

impl fmt::Display for ImageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooShort { found, needed } => {
                write!(f, "{found} bytes, an image has at least {needed}")
            }
            Self::Magic => f.write_str("not a table image (first eight bytes)"),
            Self::Version { found, allowed } => {
                write!(f, "format version {found}, this program reads {allowed}")
            }
            Self::ByteOrder { found } => {
                write!(f, "byte order mark {found:#06x} instead of 0xfeff")
            }
            Self::Length { stated, found } => {
                write!(f, "the header states {stated} bytes, {found} were given")
            }
            Self::Crc { stated, computed } => {
                write!(f, "CRC-32 {computed:#010x}, the image states {stated:#010x}")
            }
            Self::PageCrc { page } => write!(f, "CRC-32 of page {page} does not match"),
            Self::Reserved { offset } => write!(f, "reserved byte at offset {offset} is not zero"),
            Self::Text { field } => write!(f, "{field}: not printable ASCII padded with zeros"),
            Self::GeneratorKind { found } => write!(f, "unknown wave generator kind {found}"),
            Self::FixedMember { found } => write!(f, "unknown fixed member {found}"),
            Self::Teeth(error) => error.fmt(f),
            Self::Count { field, found, least, most } => {
                write!(f, "{field}: {found}, allowed are {least} to {most}")
            }
            Self::Size { needed, found } => write!(f, "the node counts need {needed} bytes, the image has {found}"),
            Self::NotFinite { field, index } => write!(f, "{field}: number {index} is not finite"),
            Self::NotIncreasing { field, index } => {
                write!(f, "{field}: node {index} is not above the one before it")
            }
            Self::NotClosed { field, index } => {
                write!(f, "{field}: does not close, at stored value {index}")
            }
            Self::Derived { offset } => write!(f, "the word at offset {offset} does not follow from the others"),
            Self::OutOfRange { field, found, least, most } => {
                write!(f, "{field}: {found}, allowed are {least} to {most}")
            }
            Self::NegativeHalfWidth { temperature, torque, found_rad } => write!(
                f,
                "half-width of the play {found_rad} rad at temperature node {temperature}, torque node {torque}: \
                 below zero"
            ),
            Self::ErrorBound { found_rad, allowed_rad } => {
                write!(f, "the table can give an error of {found_rad} rad, its limit is {allowed_rad}")
            }
            Self::Falls { temperature, torque, found_rad } => write!(
                f,
                "the error of a flank falls by {} rad up to torque node {torque} at temperature node {temperature}: \
                 it must grow with the load, which is positive where it turns the output forward",
                -found_rad
            ),
            Self::Steep { temperature, torque, found_rad, allowed_rad } => write!(
                f,
                "the error of a flank grows by {found_rad} rad up to torque node {torque} at temperature node \
                 {temperature}, allowed are {allowed_rad}"
            ),
            Self::Inverse { left_rad } => write!(f, "the inverse is left with an error of {left_rad} rad"),
            Self::Slope { found } => write!(f, "slope bound |ratio*de/dpsi| = {found}, allowed is below 1"),
        }
    }
}

impl core::error::Error for ImageError {}
