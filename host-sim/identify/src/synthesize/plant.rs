//! The drive that is measured: nominal error, play and wind-up, with what hidden effects do to load and clearance.

use flexspline::{GeneratorAngle, PlayState, Table};

use super::excitation::Excitation;
use super::law::{Law, Now};
use crate::nominal::Nominal;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::tables::dead_zone_n_m;

/// The nominal drive: a catalogue's model, or a table made by FEM and read by the core, whose wind-up and clearance
/// then stand in the model.
#[derive(Clone, Copy, Debug)]
pub struct Plant<'a> {
    /// Ratio, wind-up, clearance; without a table the whole prediction.
    pub nominal: &'a Nominal,
    /// Prediction of the FEM.
    pub table: Option<&'a Table<'a>>,
}

/// What one unit has that the drawing has not: factors and shifts.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// Wind-up over nominal.
    pub wind_up: f64,
    /// Clearance over nominal.
    pub clearance: f64,
    /// Amplitude over nominal and shift of the phase (rad) of each harmonic.
    pub harmonics: Vec<(f64, f64)>,
    /// Zero of the output encoder, arcsec.
    pub zero_arcsec: f64,
}

/// Units beyond this many standard deviations are not sold.
const WORST_UNIT: f64 = 2.5;

impl Unit {
    /// The drawing.
    #[must_use]
    pub fn nominal(nominal: &Nominal) -> Unit {
        Unit { wind_up: 1.0, clearance: 1.0, harmonics: vec![(1.0, 0.0); nominal.harmonics.len()], zero_arcsec: 0.0 }
    }

    /// Draws a unit.
    #[must_use]
    pub fn draw(nominal: &Nominal, random: &mut fastrand::Rng) -> Unit {
        let spread = nominal.spread;
        let mut limited = || gauss(random).clamp(-WORST_UNIT, WORST_UNIT);
        let wind_up = 1.0 + spread.stiffness * limited();
        let clearance = 1.0 + spread.backlash * limited();
        let harmonics = nominal
            .harmonics
            .iter()
            .map(|_| (1.0 + spread.harmonic * limited(), spread.harmonic_phase_rad * 0.5 * limited()))
            .collect();
        Unit { wind_up, clearance, harmonics, zero_arcsec: 200.0 * (random.f64() - 0.5) }
    }
}

/// A number of the normal distribution.
pub(super) fn gauss(random: &mut fastrand::Rng) -> f64 {
    let (u, v) = (random.f64().max(1e-12), random.f64());
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

impl Plant<'_> {
    /// Torque on the flanks, N·m: the load and what the torque column does not hold.
    pub(super) fn flank_torque(&self, on: &Excitation, laws: &[Law]) -> Vec<f64> {
        let mut torque = on.torque.clone();
        for law in laws {
            law.add_torque(self.nominal, on, &mut torque);
        }
        torque
    }

    /// Error without sensors and before `laws` have added to it, arcsec. Below the friction of a model the output
    /// stands until the generator has used up the clearance and pushes it; or, if not `pushed`, its error stands.
    pub(super) fn error(
        &self,
        on: &Excitation,
        torque: &[f64],
        laws: &[Law],
        unit: &Unit,
        (changed, pushed): (bool, bool),
    ) -> Vec<f64> {
        let n = on.time.len();
        let nominal_half = 0.5 * self.nominal.backlash_arcsec;
        let mut half = vec![nominal_half * unit.clearance; n];
        for law in laws {
            law.add_half_clearance(self.nominal, on, changed, &mut half);
        }
        half.iter_mut().for_each(|h| *h = h.max(0.0));
        let mut error = vec![0.0; n];
        let friction = self.table.map_or(self.nominal.friction_torque_n_m, dead_zone_n_m);
        for session in &on.sessions {
            let mut play = PlayState::unknown();
            let (mut side, mut last) = (0.0, 0.0);
            for k in session.clone() {
                let psi = on.generator[k];
                let x = psi / self.nominal.ratio * ARCSEC_PER_RAD;
                let moved = if k > session.start { x - last } else { 0.0 };
                last = x;
                if torque[k].abs() > friction {
                    side = half[k] * torque[k].signum();
                } else if pushed {
                    side = f64::clamp(side - moved, -half[k], half[k]);
                } else {
                    side = f64::clamp(side, -half[k], half[k]);
                }
                let wind_up = self.nominal.wind_up_arcsec(torque[k]);
                error[k] = unit.zero_arcsec
                    + match self.table {
                        // The table has the nominal play and wind-up; the unit and the effects add to them.
                        Some(table) => {
                            let generator = GeneratorAngle::from_rad(psi).unwrap_or(GeneratorAngle::ZERO);
                            let said = table.forward(&mut play, generator, torque[k] as f32, on.temperature[k] as f32);
                            let share = if half[k] > 0.0 { side / half[k] } else { 0.0 };
                            f64::from(said.transmission_error_rad) * ARCSEC_PER_RAD
                                + share * (half[k] - nominal_half)
                                + (unit.wind_up - 1.0) * wind_up
                        }
                        None => self.kinematic_arcsec(psi, unit) + side + unit.wind_up * wind_up,
                    };
            }
        }
        error
    }

    fn kinematic_arcsec(&self, psi: f64, unit: &Unit) -> f64 {
        let waves = self.nominal.harmonics.iter().zip(&unit.harmonics);
        waves
            .map(|(h, (a, shift))| {
                a * h.amplitude_arcsec * (h.order_per_generator_turn * psi + h.phase_rad + shift).sin()
            })
            .sum()
    }

    /// Adds what `laws` do, in the order in which they act.
    pub(super) fn add_laws(&self, on: &Excitation, torque: &[f64], laws: &[Law], changed: bool, error: &mut [f64]) {
        let now = Now { plant: self, on, torque, changed };
        for law in laws {
            law.add_error(&now, error);
        }
    }
}
