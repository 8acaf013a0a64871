//! `defmt::Format` of what estimators say, with numbers of the core in it.

use crate::{Adapted, PredictorError, Slip};
use defmt::{Format, Formatter, write};

impl Format for Adapted {
    fn format(&self, f: Formatter<'_>) {
        let Self { adjustment, uncertainty_rad, verdict } = self;
        let [mean, half_width] = [adjustment.mean_counts(), adjustment.half_width_counts()];
        write!(f, "mean {=i32} half-width {=i32} counts ±{=f32} rad, {}", mean, half_width, uncertainty_rad, verdict);
    }
}

impl Format for Slip {
    fn format(&self, f: Formatter<'_>) {
        write!(f, "{=f32} ±{=f32} rad", self.error_rad, self.uncertainty_rad);
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
