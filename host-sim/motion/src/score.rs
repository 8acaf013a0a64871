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

    /// Root mean square of errors in rad, arcsec.
    pub fn rms_arcsec(&self) -> f64 {
        self.rms() * ARCSEC_PER_RAD
    }

    /// Largest of errors in rad, arcsec.
    pub fn max_arcsec(&self) -> f64 {
        self.largest * ARCSEC_PER_RAD
    }

    /// How many.
    pub fn count(&self) -> u32 {
        self.count
    }
}

/// Errors of one controller over a flight.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scores {
    /// All ticks.
    pub whole: Score,
    /// All ticks but those in which the core's limiter held its correction back.
    pub free: Score,
    /// Steady tracking.
    pub steady: Score,
    /// Steady tracking but those ticks.
    pub steady_free: Score,
}

impl Scores {
    /// Takes one more tick in.
    pub fn add(&mut self, error_rad: f64, steady: bool, held_back: bool) {
        self.whole.add(error_rad);
        if !held_back {
            self.free.add(error_rad);
        }
        if steady {
            self.steady.add(error_rad);
            if !held_back {
                self.steady_free.add(error_rad);
            }
        }
    }
}
