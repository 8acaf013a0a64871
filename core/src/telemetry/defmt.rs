//! `defmt::Format` of what is worth a log, for the types whose files know nothing of logs.

use crate::drive::FixedMember;
use crate::error::{DriveError, Field, ImageError};
use crate::joint::{Adapted, Adjustment, Flags, Mode, ModeError, Output, PredictorError, SettingError, Slip};
use crate::play::{Direction, PlayState};
use crate::store::{ActivateError, Counters, Health, UploadError};
use crate::table::{GeneratorKind, Quality, TableId};
use defmt::{Format, Formatter, write};

/// Enums whose variants hold nothing, by name.
macro_rules! by_name {
    ($($name:ident { $($variant:ident $text:tt),* $(,)? })*) => {$(
        impl Format for $name {
            fn format(&self, f: Formatter<'_>) {
                match self {
                    $(Self::$variant => write!(f, $text),)*
                }
            }
        }
    )*};
}

by_name! {
    Quality { InRange "in range", Uncertain "uncertain", Extrapolated "extrapolated", Disabled "disabled" }
    Mode { Off "off", Tracking "tracking", Hold "hold", Safe "safe" }
    Health { Sound "sound", OneImage "one image", Lost "lost", Empty "empty", Torn "torn" }
    Direction { Forward "forward", Backward "backward" }
    FixedMember { Flexspline "flexspline", CircularSpline "circular spline" }
    GeneratorKind {
        Other "other", TwoRoller "two roller", FourRoller "four roller", DoubleDisc "double disc", Cam "cam",
    }
    Field {
        ToolVersion "tool version", MeshLevel "mesh level",
        TorqueNodes "torque nodes", TemperatureNodes "temperature nodes",
        RippleNodes "ripple nodes", GeneratorCurve "generator curve",
        MaterialCurve "material curve", OutputCurve "output curve", Mean "mean",
        HalfWidth "half width", MeanSlope "mean slope", MeanRipple "mean ripple", HalfWidthRipple "half width ripple",
        SolverResidual "solver residual", ProjectionWorst "projection worst", ProjectionRms "projection rms",
        TorqueRange "torque range",
        TemperatureRange "temperature range", ErrorLimit "error limit",
    }
}

impl Format for Flags {
    fn format(&self, f: Formatter<'_>) {
        let flags = [
            (Flags::SAMPLE_LOST, "sample lost "),
            (Flags::GLITCH, "glitch "),
            (Flags::OVERRUN, "overrun "),
            (Flags::HELD_BACK, "held back "),
            (Flags::NOT_CORRECTED, "not corrected "),
            (Flags::TABLE_DOUBT, "table in doubt "),
            (Flags::STATE_TORN, "state torn "),
        ];
        write!(f, "{=u16:#b} ", self.bits());
        for (flag, name) in flags {
            if self.contains(flag) {
                write!(f, "{=str}", name);
            }
        }
    }
}

impl Format for Counters {
    fn format(&self, f: Formatter<'_>) {
        let Self { doubtful_ticks, words_mended, words_skipped, pages_damaged, passes } = *self;
        write!(
            f,
            "{=u32} ticks in doubt, {=u32} words mended, {=u32} skipped, {=u32} pages damaged, {=u32} passes",
            doubtful_ticks, words_mended, words_skipped, pages_damaged, passes
        );
    }
}

impl Format for Adjustment {
    fn format(&self, f: Formatter<'_>) {
        let [mean, half_width] = [self.mean_counts(), self.half_width_counts()];
        write!(f, "mean {=i32} half-width {=i32} counts ±{=f32} rad", mean, half_width, self.uncertainty_rad());
    }
}

impl Format for Adapted {
    fn format(&self, f: Formatter<'_>) {
        write!(f, "{} ±{=f32} rad, {}", self.adjustment, self.uncertainty_rad, self.verdict);
    }
}

impl Format for Slip {
    fn format(&self, f: Formatter<'_>) {
        write!(f, "{=f32} ±{=f32} rad", self.error_rad, self.uncertainty_rad);
    }
}

impl Format for PlayState {
    fn format(&self, f: Formatter<'_>) {
        write!(f, "offset {=f32} ±{=f32} rad", self.offset_rad(), self.uncertainty_rad());
    }
}

impl Format for Output {
    fn format(&self, f: Formatter<'_>) {
        write!(
            f,
            "output {=i64} counts, error {=f32} ±{=f32}, correction {=f32}, held back {=f32} rad, {}, flags {}",
            self.output.counts(),
            self.transmission_error_rad,
            self.uncertainty_rad,
            self.correction_rad,
            self.held_back_rad,
            self.quality,
            self.flags
        );
    }
}

impl Format for TableId {
    fn format(&self, f: Formatter<'_>) {
        write!(f, "{=[u8; 8]:02x}", self.0);
    }
}

impl Format for ModeError {
    fn format(&self, f: Formatter<'_>) {
        write!(f, "no transition from {} to {}", self.from, self.to);
    }
}

impl Format for SettingError {
    fn format(&self, f: Formatter<'_>) {
        write!(f, "{=str} = {=f32}: not a setting", self.name, self.found);
    }
}

impl Format for DriveError {
    fn format(&self, f: Formatter<'_>) {
        write!(f, "{=u16} and {=u16} teeth make no drive", self.flexspline_teeth, self.circular_spline_teeth);
    }
}

impl Format for PredictorError {
    fn format(&self, f: Formatter<'_>) {
        match *self {
            Self::Setting { name, found } => write!(f, "{=str} = {=f64}: not a setting", name, found),
            Self::Observer { factor } => write!(f, "the observer's error grows to {=f32} times", factor),
        }
    }
}

impl Format for ActivateError {
    fn format(&self, f: Formatter<'_>) {
        match *self {
            Self::Image(error) => write!(f, "{}", error),
            Self::TooLarge { needed } => write!(f, "the table needs {=usize} words", needed),
            Self::TooManyPages { found } => write!(f, "the image has {=usize} pages", found),
            Self::TwoTables => write!(f, "the images are two different tables"),
            Self::OtherDrive => write!(f, "the table is for another drive"),
            Self::Temperature { .. } => write!(f, "the temperature is not a number within the range of numbers"),
            Self::SameImage => write!(f, "one image is given twice"),
            Self::Torn => write!(f, "what was kept of an activation is not whole: begin again"),
        }
    }
}

impl Format for UploadError {
    fn format(&self, f: Formatter<'_>) {
        match *self {
            Self::Buffer { announced, found } => {
                write!(f, "{=usize} bytes announced, room for {=usize}", announced, found)
            }
            Self::Order { expected, found } => write!(f, "chunk at {=usize}, {=usize} is next", found, expected),
            Self::TooLong { announced, found } => write!(f, "{=usize} bytes, {=usize} announced", found, announced),
            Self::Incomplete { announced, found } => write!(f, "{=usize} bytes of {=usize}", found, announced),
            Self::Image(error) => write!(f, "{}", error),
        }
    }
}

impl Format for ImageError {
    fn format(&self, f: Formatter<'_>) {
        match *self {
            Self::TooShort { found, needed } => write!(f, "{=usize} bytes, at least {=usize} needed", found, needed),
            Self::Magic => write!(f, "not a table image"),
            Self::Version { found, allowed } => write!(f, "version {=u16}, {=u16} is read", found, allowed),
            Self::ByteOrder { found } => write!(f, "byte order mark {=u16:#x}", found),
            Self::Length { stated, found } => write!(f, "{=usize} bytes stated, {=usize} found", stated, found),
            Self::Crc { stated, computed } => write!(f, "CRC {=u32:#x} stated, {=u32:#x} computed", stated, computed),
            Self::PageCrc { page } => write!(f, "CRC of page {=usize}", page),
            Self::Reserved { offset } => write!(f, "reserved byte at {=usize} not zero", offset),
            Self::Text { field } => write!(f, "text of {}", field),
            Self::GeneratorKind { found } => write!(f, "generator kind {=u8}", found),
            Self::FixedMember { found } => write!(f, "fixed member {=u8}", found),
            Self::Teeth(error) => write!(f, "{}", error),
            Self::Count { field, found, least, most } => {
                write!(f, "{=usize} of {}, {=usize} to {=usize} allowed", found, field, least, most);
            }
            Self::Size { needed, found } => write!(f, "counts need {=usize} bytes, {=usize} found", needed, found),
            Self::NotFinite { field, index } => write!(f, "{} {=usize} not finite", field, index),
            Self::NotIncreasing { field, index } => write!(f, "{} {=usize} not increasing", field, index),
            Self::NotClosed { field, index } => write!(f, "{} {=usize} not closed", field, index),
            Self::Derived { offset } => write!(f, "number at {=usize} does not follow", offset),
            Self::OutOfRange { field, found, least, most } => {
                write!(f, "{} {=f32}, {=f32} to {=f32} allowed", field, found, least, most);
            }
            Self::NegativeHalfWidth { temperature, torque, found_rad } => {
                write!(f, "half-width {=f32} rad at nodes {=usize}, {=usize}", found_rad, temperature, torque);
            }
            Self::ErrorBound { found_rad, allowed_rad } => {
                write!(f, "error up to {=f32}, {=f32} rad allowed", found_rad, allowed_rad);
            }
            Self::Slope { found } => write!(f, "slope {=f32}", found),
            Self::Falls { temperature, torque, found_rad } => {
                write!(
                    f,
                    "falls by {=f32} rad to torque node {=usize} at temperature {=usize}",
                    found_rad, torque, temperature
                )
            }
            Self::Steep { temperature, torque, found_rad, allowed_rad } => write!(
                f,
                "rises by {=f32} rad of {=f32} allowed to torque node {=usize} at temperature {=usize}",
                found_rad, allowed_rad, torque, temperature
            ),
            Self::Inverse { left_rad } => write!(f, "inverse leaves {=f32} rad", left_rad),
        }
    }
}
