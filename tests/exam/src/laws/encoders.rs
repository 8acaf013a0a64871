//! What the encoders read wrongly: discs off their axis, scale.

use super::{Law, Now};
use crate::ARCSEC;
use crate::effect::Family;
use std::f64::consts::FRAC_PI_3;

/// A disc off its axis at the output.
pub struct OutputEncoder {
    pub amplitude: f64,
    pub phase: f64,
    pub family: Family,
}

impl Law for OutputEncoder {
    fn reading(&mut self, now: &Now, _: f64) -> f64 {
        let x = now.output_rad + self.phase;
        match self.family {
            Family::A => self.amplitude * x.sin(),
            // The head reads a disc that is off its axis and slightly bent.
            Family::B => {
                let e = self.amplitude / ARCSEC;
                ARCSEC * (e * x.sin()).atan2(1.0 + e * x.cos()) + 0.05 * self.amplitude * (2.0 * x + 0.6).sin()
            }
            // The hub of the disc is drawn to three lobes by its screws.
            Family::C => self.amplitude * (x.sin() + 0.06 * (3.0 * x + 0.9).sin()),
        }
    }
}

/// A disc off its axis at the generator.
pub struct GeneratorEncoder {
    pub amplitude_rad: f64,
    pub phase: f64,
    pub family: Family,
}

impl Law for GeneratorEncoder {
    fn generator_reading(&mut self, now: &Now) -> f64 {
        let x = now.generator_rad + self.phase;
        match self.family {
            Family::A => self.amplitude_rad * x.sin(),
            Family::B => {
                (self.amplitude_rad * x.sin()).atan2(1.0 + self.amplitude_rad * x.cos())
                    + 0.07 * self.amplitude_rad * (2.0 * x - 0.4).sin()
            }
            // Two heads a third of a turn apart, where room left none opposite: their mean keeps half of the disc's
            // first harmonic, which is `amplitude_rad`, and of its second (derived here).
            Family::C => {
                let disc = 2.0 * self.amplitude_rad;
                let head = |at: f64| (disc * at.sin()).atan2(1.0 + disc * at.cos());
                0.5 * (head(x - FRAC_PI_3) + head(x + FRAC_PI_3))
            }
        }
    }
}

/// Another ratio than the catalogue's, or another scale of the output encoder.
pub struct Ratio {
    pub relative: f64,
    pub family: Family,
    /// Where the counting began: output angle, arcsec, of family A; generator angle, rad, of family C.
    pub start: Option<f64>,
}

impl Law for Ratio {
    fn reading(&mut self, now: &Now, deviation_arcsec: f64) -> f64 {
        let exact = now.driven_arcsec;
        match self.family {
            Family::A => self.relative * (exact - *self.start.get_or_insert(exact)),
            Family::B => self.relative * (exact + deviation_arcsec),
            Family::C => 0.0,
        }
    }

    /// A generator encoder with another count per turn: its own column is stretched, and every line with it.
    fn generator_reading(&mut self, now: &Now) -> f64 {
        match self.family {
            Family::A | Family::B => 0.0,
            Family::C => -self.relative * (now.generator_rad - *self.start.get_or_insert(now.generator_rad)),
        }
    }
}

/// No law of its own.
pub struct Nothing;

impl Law for Nothing {}
