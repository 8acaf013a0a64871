//! Loads that the torque column does not tell.

use super::{Law, Now};
use crate::effect::Family;

/// Drag of the lubricant on the moving output.
pub struct Drag {
    /// At 20 °C and a generator speed of 10 rad/s.
    pub drag_n_m: f64,
    /// Of the temperature law.
    pub steepness: f64,
    pub family: Family,
    /// Sense of the output relative to the generator.
    pub sense: f64,
}

impl Drag {
    /// Viscosity over that at 20 °C: four- to eightfold at -40 °C with a steepness of one.
    fn viscosity(&self, temperature_c: f64) -> f64 {
        match self.family {
            // Vogel: ln ν = B / (T + C).
            Family::A => (self.steepness * 210.0 * (1.0 / (temperature_c + 100.0) - 1.0 / 120.0)).exp(),
            // Walther: log log (ν + 0.7) linear in log T; base viscosity 90 mm²/s.
            Family::B => {
                let nu = |c: f64| {
                    let slope = 2.0 * self.steepness;
                    10.0_f64.powf((90.7_f64.log10().log10() - slope * ((c + 273.15) / 293.15).log10()).exp_10())
                };
                (nu(temperature_c) / nu(20.0)).max(1e-3)
            }
        }
    }
}

trait Exp10 {
    fn exp_10(self) -> f64;
}

impl Exp10 for f64 {
    fn exp_10(self) -> f64 {
        10.0_f64.powf(self)
    }
}

impl Law for Drag {
    fn load(&mut self, now: &Now) -> f64 {
        let speed = now.speed_rad_s / 10.0;
        let grade = match self.family {
            Family::A => self.viscosity(now.temperature_c) * speed,
            // (ν n)^(2/3), smooth through standstill.
            Family::B => {
                let x = self.viscosity(now.temperature_c) * speed;
                x / (x * x + 1e-4).powf(1.0 / 6.0)
            }
        };
        -self.sense * self.drag_n_m * grade
    }
}

/// A load whose centre of gravity is off the axis.
pub struct Unbalance {
    pub torque_n_m: f64,
    pub phase: f64,
    pub family: Family,
}

impl Law for Unbalance {
    fn load(&mut self, now: &Now) -> f64 {
        let x = now.output_rad + now.orientation_rad + self.phase;
        match self.family {
            Family::A => self.torque_n_m * x.sin(),
            // The arm sags: the lever shortens as it lies level.
            Family::B => self.torque_n_m * (x + 0.08 * x.sin()).sin(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cold_oil_drags_a_few_times_as_much() {
        for family in [Family::A, Family::B] {
            let mut drag = Drag { drag_n_m: 1.0, steepness: 1.0, family, sense: 1.0 };
            let mut at = |c, speed| -drag.load(&Now { temperature_c: c, speed_rad_s: speed, ..Now::default() });
            let ratio = at(-40.0, 10.0) / at(20.0, 10.0);
            assert!((2.5..11.0).contains(&ratio), "{family:?}: {ratio}");
            assert!((at(20.0, 10.0) - 1.0).abs() < 0.01 && at(20.0, -10.0) < 0.0);
        }
    }
}
