//! Units of angle in which results are reported. Everything inside is in radians, and in the units that a name carries.
//!
//! All of them are definitions: a turn is 2π rad and 360°, a degree 60′, an arc-minute 60″ (SI Brochure, 9th edition,
//! table 8).

use std::f64::consts::PI;

/// Arc-seconds in a radian: half a turn is 180 · 3600″ and π rad.
pub const ARCSEC_PER_RAD: f64 = 180.0 * 3600.0 / PI;
/// Arc-minutes in a radian: half a turn is 180 · 60′ and π rad.
pub const ARCMIN_PER_RAD: f64 = 180.0 * 60.0 / PI;
/// Arc-seconds in a turn.
pub const ARCSEC_PER_TURN: f64 = 360.0 * 3600.0;
