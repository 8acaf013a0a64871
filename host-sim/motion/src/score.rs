//! How far something was from where it should be.

/// Arc-seconds in a radian.
pub const ARCSEC_PER_RAD: f64 = 206_264.806_247_096_36;

/// Root mean square and largest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Score {
    squares: f64,
    largest: f64,
    count: u32,
}

impl Score {
    /// Takes one more in.
    pub fn add(&mut self, value: f64) {
        self.squares += value * value;
        self.largest = self.largest.max(value.abs());
        self.count += 1;
    }

    /// Root mean square; 0 of none.
    pub fn rms(&self) -> f64 {
        if self.count == 0 { 0.0 } else { libm::sqrt(self.squares / f64::from(self.count)) }
    }

    /// Root mean square; not a number of none.
    pub fn rms_if_any(&self) -> f64 {
        if self.count == 0 { f64::NAN } else { self.rms() }
    }

    /// Largest.
    pub fn largest(&self) -> f64 {
        self.largest
    }

    /// How many.
    pub fn count(&self) -> u32 {
        self.count
    }
}
