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
            // Andrade 1930: ln η = E / (R T).
            Family::C => {
                let kelvin = temperature_c + 273.15;
                (self.steepness * 1950.0 * (1.0 / kelvin - 1.0 / 293.15)).exp()
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

/// Sense of dry friction, smooth through standstill: presliding of bearings (Armstrong-Hélouvry 1991).
fn rubs(speed_rad_s: f64) -> f64 {
    (speed_rad_s / 0.05).tanh()
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
            // Stribeck 1902: the film grows with viscosity times speed; what is too thin to part the surfaces rubs.
            Family::C => {
                let film = self.viscosity(now.temperature_c) * speed;
                film + 0.3 * (-film.abs() / 0.15).exp() * rubs(now.speed_rad_s)
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
    /// Sense of the output relative to the generator.
    pub sense: f64,
}

impl Law for Unbalance {
    fn load(&mut self, now: &Now) -> f64 {
        let x = now.output_rad + now.orientation_rad + self.phase;
        match self.family {
            Family::A => self.torque_n_m * x.sin(),
            // The arm sags: the lever shortens as it lies level.
            Family::B => self.torque_n_m * (x + 0.08 * x.sin()).sin(),
            // The bearing of the arm carries its weight and rubs: friction times its radius is 0.04 of the lever.
            Family::C => self.torque_n_m * (x.sin() - 0.04 * self.sense * rubs(now.speed_rad_s)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cold_oil_drags_a_few_times_as_much() {
        for family in Family::ALL {
            let mut drag = Drag { drag_n_m: 1.0, steepness: 1.0, family, sense: 1.0 };
            let mut at = |c, speed| -drag.load(&Now { temperature_c: c, speed_rad_s: speed, ..Now::default() });
            let ratio = at(-40.0, 10.0) / at(20.0, 10.0);
            assert!((2.5..11.0).contains(&ratio), "{family:?}: {ratio}");
            assert!((at(20.0, 10.0) - 1.0).abs() < 0.01 && at(20.0, -10.0) < 0.0);
        }
    }

    /// Dry friction at the slowest, a film at speed, and a valley between (Stribeck 1902).
    #[test]
    fn a_film_grows_between_rubbing_and_dragging() {
        let mut drag = Drag { drag_n_m: 1.0, steepness: 1.0, family: Family::C, sense: 1.0 };
        let mut at = |speed| -drag.load(&Now { temperature_c: 20.0, speed_rad_s: speed, ..Now::default() });
        let (slowest, slow, fast) = (at(0.2), at(2.0), at(10.0));
        assert!(slowest > 0.25 && slow < slowest && slow < 0.3 && fast > 0.9, "{slowest} {slow} {fast}");
        assert_eq!(at(-2.0), -slow);
        assert_eq!(at(0.0), 0.0);
    }

    #[test]
    fn the_bearing_of_the_arm_works_against_the_motion() {
        for sense in [1.0, -1.0] {
            let mut arm = Unbalance { torque_n_m: 10.0, phase: 0.3, family: Family::C, sense };
            let mut at = |speed| arm.load(&Now { output_rad: 0.5, speed_rad_s: speed, ..Now::default() });
            let (up, down) = (at(3.0), at(-3.0));
            assert!((0.5 * (up + down) - 10.0 * 0.8_f64.sin()).abs() < 1e-9);
            assert!((sense * (down - up) - 0.8).abs() < 1e-6, "{up} {down}");
        }
    }
}
