//! One row of `results.csv`.

use serde::Serialize;

use super::zones::TipContact;
use flexspline_mechanics::stepping::Face;

/// The drive after an increment; the fields are the columns of `results.csv`.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Row {
    /// Place in the path.
    pub step: usize,
    /// Generator angle, rad.
    pub generator_rad: f64,
    /// Output angle, rad.
    pub output_rad: f64,
    /// Output angle minus generator angle over ratio, arc-seconds; positive when the output leads.
    pub error_arcsec: f64,
    /// Load torque, N m; positive turns the output forward.
    pub torque_n_m: f64,
    /// Tooth flanks that carry load.
    pub flank_contacts: usize,
    /// Bore edges that the generator touches.
    pub generator_contacts: usize,
    /// Largest von Mises stress of both wheels, MPa, averaged at nodes.
    pub max_von_mises_mpa: f64,
    /// Newton iterations, those of a change of temperature before it included.
    pub iterations: usize,
    /// Temperature, °C.
    pub temperature_c: f64,
    /// Torque of the generator on the flexspline, N m; positive turns it forward.
    pub generator_torque_n_m: f64,
    /// Drag on the output, N m; against its motion.
    pub drag_torque_n_m: f64,
    /// Load, drag and flanks on the output together, N m: what equilibrium leaves.
    pub torque_balance_n_m: f64,
    /// Largest pressure between flanks, MPa.
    pub peak_flank_pressure_mpa: f64,
    /// Largest pressure between generator and bore, MPa.
    pub peak_generator_pressure_mpa: f64,
    /// Residual force relative to the largest contact force.
    pub residual: f64,
    /// Whether the drive has settled since the last reversal or change of load or temperature, by the rule of
    /// [`flexspline_mechanics::motion`]: the output follows, and friction between the flanks has had two tooth pitches.
    pub settled: bool,
    /// The teeth along their face, and how the load lies along it.
    #[serde(skip)]
    pub face: Face,
    /// Force of the generator along its major axis on the half of the rim at 0°, outward, N.
    #[serde(skip)]
    pub lobe_force_n: f64,
    /// Contact of tips outside the main zones, under a load that exceeds the drag.
    #[serde(skip)]
    pub tips: Option<TipContact>,
    /// Generator travel of the increment, rad, signed.
    #[serde(skip)]
    pub turn_rad: f64,
}

impl Row {
    /// Whether load and temperature are those of another row.
    pub(super) fn has_load_of(&self, other: &Row) -> bool {
        self.torque_n_m == other.torque_n_m && self.temperature_c == other.temperature_c
    }
}
