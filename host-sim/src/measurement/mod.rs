//! Measured data: rows of a drive at work, in sessions.
//!
//! Angles are radians, torque N·m, temperature °C, time s; `error` is output less generator over ratio, rad at the output. All
//! columns of a session have the same length; what was not recorded is `None`.

/// Rows without a gap, in order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Session {
    /// Line of the file that each row came from.
    pub line: Vec<u64>,
    /// Time, s.
    pub time_s: Option<Vec<f64>>,
    /// Generator angle, rad, unwrapped.
    pub generator_rad: Vec<f64>,
    /// Output angle less generator over ratio, rad.
    pub error_rad: Vec<f64>,
    /// Load torque at the output, N·m.
    pub torque_n_m: Option<Vec<f64>>,
    /// Temperature, °C.
    pub temperature_c: Option<Vec<f64>>,
    /// Angle of the drive against gravity about its axis, rad.
    pub orientation_rad: Option<Vec<f64>>,
}

impl Session {
    /// Rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.generator_rad.len()
    }

    /// Whether there are no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.generator_rad.is_empty()
    }
}
