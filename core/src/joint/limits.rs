//! Limits of one joint, and what it cannot be set to.

use core::fmt;

/// A setting that a joint refuses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SettingError {
    /// Which setting.
    pub name: &'static str,
    /// Value found.
    pub found: f32,
}

impl fmt::Display for SettingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} = {}: must be finite and above zero (deadband_rad: or zero), and neither beyond what one tick can do \
             nor too small to matter in it",
            self.name, self.found
        )
    }
}

impl core::error::Error for SettingError {}

/// Limits of one joint, in units of its output and of seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Time from tick to tick, s.
    pub tick_s: f32,
    /// Fastest correction at the output, rad/s.
    pub rate_rad_s: f32,
    /// Largest acceleration of the correction at the output, rad/s²; it brakes with half of that.
    pub acceleration_rad_s2: f32,
    /// Fastest generator, rad/s: what moves faster from tick to tick, those missed counted, is a glitch. Its
    /// acceleration is limited by
    /// [`Joint::with_generator_acceleration`](crate::Joint::with_generator_acceleration).
    pub generator_rate_rad_s: f32,
    /// Ticks for which a glitch is not believed, and for which the last correction is kept where none can be made.
    pub debounce_ticks: u16,
    /// A target that is no further from the output than this is reached on the flank that bears already, rad; 0 for
    /// none.
    ///
    /// Else noise of the encoder, or of a target that stands, changes the flank to and fro, which crosses the whole
    /// play each time. It costs up to this much where a motion turns back by less. Some three times the peak of the
    /// noise at the output is enough.
    pub deadband_rad: f32,
}

/// Least tick, s: no loop closes ten million times a second. A guess.
pub(super) const LEAST_TICK_S: f64 = 1e-7;

/// A positive, finite number of counts, at least `least`.
pub(super) const fn checked(
    name: &'static str,
    found: f32,
    counts: f64,
    [least, most]: [f64; 2],
) -> Result<f32, SettingError> {
    if counts > 0.0 && counts >= least && counts <= most {
        Ok(counts as f32)
    } else {
        Err(SettingError { name, found })
    }
}
