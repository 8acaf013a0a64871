//! `defmt::Format` of what is worth a log, for the types of the core, which knows nothing of logs.

use crate::{Event, Record};
use defmt::{Format, Formatter, write};
use flexspline::{
    ActivateError, Adjustment, Counters, Direction, DriveError, Field, FixedMember, Flags, GeneratorKind, Health,
    ImageError, Mode, ModeError, Output, PlayState, Quality, SettingError, TableId, UploadError,
};

/// Something of the core to log: `defmt::info!("{}", Logged(&output))`.
#[derive(Clone, Copy, Debug)]
pub struct Logged<'a, T>(pub &'a T);

/// Enums whose variants hold nothing, by name.
macro_rules! by_name {
    ($($name:ident { $($variant:ident $text:tt),* $(,)? })*) => {$(
        impl Format for Logged<'_, $name> {
            fn format(&self, f: Formatter<'_>) {
                match self.0 {
                    $($name::$variant => write!(f, $text),)*
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

impl Format for Logged<'_, Flags> {
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
        write!(f, "{=u16:#b} ", self.0.bits());
        for (flag, name) in flags {
            if self.0.contains(flag) {
                write!(f, "{=str}", name);
            }
        }
    }
}

impl Format for Logged<'_, Counters> {
    fn format(&self, f: Formatter<'_>) {
        let Counters { doubtful_ticks, words_mended, words_skipped, pages_damaged, passes } = *self.0;
        write!(
            f,
            "{=u32} ticks in doubt, {=u32} words mended, {=u32} skipped, {=u32} pages damaged, {=u32} passes",
            doubtful_ticks, words_mended, words_skipped, pages_damaged, passes
        );
    }
}

impl Format for Logged<'_, Adjustment> {
    fn format(&self, f: Formatter<'_>) {
        let [mean, half_width] = [self.0.mean_counts(), self.0.half_width_counts()];
        write!(f, "mean {=i32} half-width {=i32} counts ±{=f32} rad", mean, half_width, self.0.uncertainty_rad());
    }
}

impl Format for Logged<'_, PlayState> {
    fn format(&self, f: Formatter<'_>) {
        write!(f, "offset {=f32} ±{=f32} rad", self.0.offset_rad(), self.0.uncertainty_rad());
    }
}

impl Format for Logged<'_, Output> {
    fn format(&self, f: Formatter<'_>) {
        write!(
            f,
            "output {=i64} counts, error {=f32} ±{=f32}, correction {=f32}, held back {=f32} rad, {}, flags {}",
            self.0.output.counts(),
            self.0.transmission_error_rad,
            self.0.uncertainty_rad,
            self.0.correction_rad,
            self.0.held_back_rad,
            Logged(&self.0.quality),
            Logged(&self.0.flags)
        );
    }
}

impl Format for Logged<'_, TableId> {
    fn format(&self, f: Formatter<'_>) {
        write!(f, "{=[u8; 8]:02x}", self.0.0);
    }
}

impl Format for Logged<'_, ModeError> {
    fn format(&self, f: Formatter<'_>) {
        write!(f, "no transition from {} to {}", Logged(&self.0.from), Logged(&self.0.to));
    }
}

impl Format for Logged<'_, SettingError> {
    fn format(&self, f: Formatter<'_>) {
        write!(f, "{=str} = {=f32}: not a setting", self.0.name, self.0.found);
    }
}

impl Format for Logged<'_, DriveError> {
    fn format(&self, f: Formatter<'_>) {
        write!(f, "{=u16} and {=u16} teeth make no drive", self.0.flexspline_teeth, self.0.circular_spline_teeth);
    }
}

impl Format for Logged<'_, ActivateError> {
    fn format(&self, f: Formatter<'_>) {
        match *self.0 {
            ActivateError::Image(error) => write!(f, "{}", Logged(&error)),
            ActivateError::TooLarge { needed } => write!(f, "the table needs {=usize} words", needed),
            ActivateError::TooManyPages { found } => write!(f, "the image has {=usize} pages", found),
            ActivateError::TwoTables => write!(f, "the images are two different tables"),
            ActivateError::OtherDrive => write!(f, "the table is for another drive"),
            ActivateError::Temperature { .. } => {
                write!(f, "the temperature is not a number within the range of numbers")
            }
            ActivateError::SameImage => write!(f, "one image is given twice"),
            ActivateError::Torn => write!(f, "what was kept of an activation is not whole: begin again"),
        }
    }
}

impl Format for Logged<'_, UploadError> {
    fn format(&self, f: Formatter<'_>) {
        match *self.0 {
            UploadError::Buffer { announced, found } => {
                write!(f, "{=usize} bytes announced, room for {=usize}", announced, found)
            }
            UploadError::Order { expected, found } => write!(f, "chunk at {=usize}, {=usize} is next", found, expected),
            UploadError::TooLong { announced, found } => {
                write!(f, "{=usize} bytes, {=usize} announced", found, announced)
            }
            UploadError::Incomplete { announced, found } => write!(f, "{=usize} bytes of {=usize}", found, announced),
            UploadError::Image(error) => write!(f, "{}", Logged(&error)),
        }
    }
}

impl Format for Logged<'_, ImageError> {
    fn format(&self, f: Formatter<'_>) {
        match *self.0 {
            ImageError::TooShort { found, needed } => {
                write!(f, "{=usize} bytes, at least {=usize} needed", found, needed)
            }
            ImageError::Magic => write!(f, "not a table image"),
            ImageError::Version { found, allowed } => write!(f, "version {=u16}, {=u16} is read", found, allowed),
            ImageError::ByteOrder { found } => write!(f, "byte order mark {=u16:#x}", found),
            ImageError::Length { stated, found } => write!(f, "{=usize} bytes stated, {=usize} found", stated, found),
            ImageError::Crc { stated, computed } => {
                write!(f, "CRC {=u32:#x} stated, {=u32:#x} computed", stated, computed)
            }
            ImageError::PageCrc { page } => write!(f, "CRC of page {=usize}", page),
            ImageError::Reserved { offset } => write!(f, "reserved byte at {=usize} not zero", offset),
            ImageError::Text { field } => write!(f, "text of {}", Logged(&field)),
            ImageError::GeneratorKind { found } => write!(f, "generator kind {=u8}", found),
            ImageError::FixedMember { found } => write!(f, "fixed member {=u8}", found),
            ImageError::Teeth(error) => write!(f, "{}", Logged(&error)),
            ImageError::Count { field, found, least, most } => {
                write!(f, "{=usize} of {}, {=usize} to {=usize} allowed", found, Logged(&field), least, most);
            }
            ImageError::Size { needed, found } => {
                write!(f, "counts need {=usize} bytes, {=usize} found", needed, found)
            }
            ImageError::NotFinite { field, index } => write!(f, "{} {=usize} not finite", Logged(&field), index),
            ImageError::NotIncreasing { field, index } => {
                write!(f, "{} {=usize} not increasing", Logged(&field), index)
            }
            ImageError::NotClosed { field, index } => write!(f, "{} {=usize} not closed", Logged(&field), index),
            ImageError::Derived { offset } => write!(f, "number at {=usize} does not follow", offset),
            ImageError::OutOfRange { field, found, least, most } => {
                write!(f, "{} {=f32}, {=f32} to {=f32} allowed", Logged(&field), found, least, most);
            }
            ImageError::NegativeHalfWidth { temperature, torque, found_rad } => {
                write!(f, "half-width {=f32} rad at nodes {=usize}, {=usize}", found_rad, temperature, torque);
            }
            ImageError::ErrorBound { found_rad, allowed_rad } => {
                write!(f, "error up to {=f32}, {=f32} rad allowed", found_rad, allowed_rad);
            }
            ImageError::Slope { found } => write!(f, "slope {=f32}", found),
            ImageError::Falls { temperature, torque, found_rad } => {
                write!(
                    f,
                    "falls by {=f32} rad to torque node {=usize} at temperature {=usize}",
                    found_rad, torque, temperature
                )
            }
            ImageError::Steep { temperature, torque, found_rad, allowed_rad } => write!(
                f,
                "rises by {=f32} rad of {=f32} allowed to torque node {=usize} at temperature {=usize}",
                found_rad, allowed_rad, torque, temperature
            ),
            ImageError::Inverse { left_rad } => write!(f, "inverse leaves {=f32} rad", left_rad),
        }
    }
}

impl Format for Event {
    fn format(&self, f: Formatter<'_>) {
        match self {
            Self::Mode { from, to } => write!(f, "Mode {{ from: {}, to: {} }}", Logged(from), Logged(to)),
            Self::Health { from, to } => write!(f, "Health {{ from: {}, to: {} }}", Logged(from), Logged(to)),
            Self::PageDamaged { image, page } => {
                write!(f, "PageDamaged {{ image: {=usize}, page: {=usize} }}", image, page)
            }
            Self::TableDoubt => write!(f, "TableDoubt"),
            Self::Fallback => write!(f, "Fallback"),
            Self::Recovered => write!(f, "Recovered"),
            Self::Overrun { missed_ticks } => write!(f, "Overrun {{ missed_ticks: {=u32} }}", missed_ticks),
            Self::StateTorn => write!(f, "StateTorn"),
        }
    }
}

impl Format for Record {
    fn format(&self, f: Formatter<'_>) {
        write!(
            f,
            "Record {{ number: {=u16}, lost: {=u16}, tick: {=u32}, quality: {}, mode: {}, health: {}, \
             flags: {=u16}, missed_ticks: {=u16}, output_counts: {=i64}, transmission_error_rad: {=f32}, \
             uncertainty_rad: {=f32}, correction_rad: {=f32}, held_back_rad: {=f32}, doubtful_ticks: \
             {=u16}, words_mended: {=u16}, words_skipped: {=u16}, pages_damaged: {=u16} }}",
            self.number,
            self.lost,
            self.tick,
            Logged(&self.quality),
            Logged(&self.mode),
            Logged(&self.health),
            self.flags,
            self.missed_ticks,
            self.output_counts,
            self.transmission_error_rad,
            self.uncertainty_rad,
            self.correction_rad,
            self.held_back_rad,
            self.doubtful_ticks,
            self.words_mended,
            self.words_skipped,
            self.pages_damaged
        );
    }
}
