//! One row of `results.csv`, and when a moving drive has settled.

use serde::Serialize;

use crate::stepping::State;

/// The drive after an increment; the fields are the columns of `results.csv`.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
    /// Whether the drive has been moving one way, under one load, for at least a flexspline tooth pitch and the output
    /// follows: start-up and clearance are behind it.
    pub settled: bool,
    /// Generator travel of the increment, rad, signed.
    #[serde(skip)]
    pub turn_rad: f64,
}

/// Motion since the last reversal or change of load or temperature.
#[derive(Debug, Clone, Default)]
pub(super) struct Motion {
    direction: f64,
    travelled_rad: f64,
    following: bool,
}

impl Motion {
    /// Goes from one state to the next. The output follows once it has moved at more than half its nominal rate: it
    /// stands while it crosses its clearance, then moves on.
    pub(super) fn go(&mut self, from: &State, to: &State, ratio: f64) {
        let turn = to.generator_rad - from.generator_rad;
        if turn == 0.0 || to.torque_n_m != from.torque_n_m || turn.signum() != self.direction {
            *self = Motion { direction: if turn == 0.0 { 0.0 } else { turn.signum() }, ..Motion::default() };
        }
        self.travelled_rad += turn.abs();
        self.following |= turn != 0.0 && (to.output_rad - from.output_rad) * ratio / turn > 0.5;
    }

    /// Whether start-up is over.
    pub(super) fn settled(&self, pitch_rad: f64) -> bool {
        self.following && self.travelled_rad > pitch_rad * (1.0 - 1e-9)
    }

    /// Travel since the last reversal, rad.
    pub(super) fn travelled_rad(&self) -> f64 {
        self.travelled_rad
    }
}
