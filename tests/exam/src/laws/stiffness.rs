//! A spring that is not the catalogue's.

use super::{Law, Mesh, Now, Setting};
use crate::ARCSEC;
use crate::effect::Family;

/// What stiffness laws keep of the setting.
pub struct Own {
    drive: crate::drive::Drive,
    stiffness: f64,
}

/// Keeps what is needed.
pub fn own(setting: Setting) -> Own {
    Own { drive: setting.drive.clone(), stiffness: setting.unit.stiffness }
}

impl Own {
    fn wind_up(&self, load_n_m: f64) -> f64 {
        self.drive.wind_up_arcsec(load_n_m) / self.stiffness
    }
}

/// Stiffer as it is loaded.
pub struct Hardening {
    relative: f64,
    knee: f64,
    k: f64,
    rated_n_m: f64,
    family: Family,
}

impl Hardening {
    pub fn new(relative: f64, knee: f64, family: Family, setting: Setting) -> Self {
        Self {
            relative,
            knee,
            k: setting.drive.first_stiffness() * setting.unit.stiffness,
            rated_n_m: setting.drive.rated_n_m,
            family,
        }
    }
}

impl Law for Hardening {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        let load = now.load_n_m.abs();
        let linear = load / self.k;
        let x = match self.family {
            // T = k x + k3 x³ with k3 such that the cubic part is `relative` of k x where the linear spring has its
            // rated deflection; Newton from above.
            Family::A => {
                let full = self.rated_n_m / self.k;
                let k3 = self.relative * self.k / (full * full);
                let mut x = linear;
                for _ in 0..8 {
                    x -= (self.k * x + k3 * x * x * x - load) / (self.k + 3.0 * k3 * x * x);
                }
                x
            }
            // Three straight parts, as catalogues give them.
            Family::B => {
                let (t1, t2) = (self.knee * self.rated_n_m, 2.2 * self.knee * self.rated_n_m);
                let (k2, k3) = (self.k * (1.0 + 0.7 * self.relative), self.k * (1.0 + 1.1 * self.relative));
                load.min(t1) / self.k + (load.min(t2) - t1).max(0.0) / k2 + (load - t2).max(0.0) / k3
            }
            // Teeth enter one after another: the stiffness of the next N m is k (1 + r (1 - exp(-T / T_c))), which
            // integrates to x = (T + T_c ln(1 + r (1 - exp(-T / T_c)))) / (k (1 + r)) (derived here).
            Family::C => {
                let (r, enters_n_m) = (self.relative, 2.0 * self.knee * self.rated_n_m);
                let entered = 1.0 - (-load / enters_n_m).exp();
                (load + enters_n_m * (r * entered).ln_1p()) / (self.k * (1.0 + r))
            }
        };
        mesh.wind_up += ARCSEC * (x - linear).copysign(-now.load_n_m);
    }
}

/// A constant other than the catalogue's.
pub struct Error {
    /// True over nominal, minus one.
    pub size: f64,
    pub family: Family,
    pub setting: Own,
}

impl Law for Error {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        let give = 1.0 / (1.0 + self.size) - 1.0;
        let load = now.load_n_m;
        mesh.wind_up += give
            * match self.family {
                Family::A => self.setting.wind_up(load),
                // A soft part in series, slightly softer one way than the other.
                Family::B => self.setting.wind_up(load) * (1.0 + 0.06 * load.signum()),
                // It is the bearing under the generator that is not the catalogue's: rollers give way as F^0.9
                // (Palmgren 1959); the size is that at rated load.
                Family::C => {
                    let rated_n_m = self.setting.drive.rated_n_m;
                    self.setting.wind_up(rated_n_m) * (load.abs() / rated_n_m).powf(0.9).copysign(load)
                }
            };
    }
}

/// Stiffness that follows the temperature.
pub struct Thermal {
    /// Relative change per kelvin.
    pub size: f64,
    pub family: Family,
    pub setting: Own,
}

impl Law for Thermal {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        let warmer = now.temperature_c - 20.0;
        let ratio = match self.family {
            Family::A => 1.0 + self.size * warmer,
            // A polymer in the path: exponential.
            Family::B => (self.size * warmer * (1.0 - 0.003 * warmer)).exp(),
            // Two springs in series, one of which (0.7 of the compliance) follows the temperature.
            Family::C => {
                let follows = 0.7;
                1.0 / (1.0 - follows + follows / (1.0 + self.size / follows * warmer).max(0.25))
            }
        };
        mesh.wind_up += (1.0 / ratio.max(0.3) - 1.0) * self.setting.wind_up(now.load_n_m);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chance::Chance;
    use crate::drive::{Drive, Unit};
    use crate::motion::Motion;

    /// Wind-up of a law beyond the drive's own, arcsec.
    fn beyond(law: &mut dyn Law, now: Now) -> f64 {
        let mut mesh = Mesh::default();
        law.mesh(&now, &mut mesh);
        mesh.wind_up
    }

    fn drive() -> Drive {
        Drive { stiffness: vec![(0.0, 3e4)], ..Drive::draw(&mut Chance::new(1, "drive", 0)) }
    }

    #[test]
    fn teeth_that_enter_stiffen_from_k_to_what_the_size_says() {
        let drive = drive();
        let (unit, motion) = (Unit::nominal(&drive), Motion::default());
        let mut law = Hardening::new(0.5, 0.1, Family::C, Setting { drive: &drive, unit: &unit, motion: &motion });
        let mut stiffness = |load: f64| {
            let mut x = |load_n_m| {
                let wind_up = beyond(&mut law, Now { load_n_m, ..Now::default() });
                (wind_up + drive.wind_up_arcsec(load_n_m)) / ARCSEC
            };
            2e-3 / (x(load + 1e-3) - x(load - 1e-3))
        };
        let rated = drive.rated_n_m;
        assert!((stiffness(0.0) / 3e4 - 1.0).abs() < 1e-3);
        assert!((stiffness(2.0 * rated) / 4.5e4 - 1.0).abs() < 1e-3);
        // 1 - 1/e of it at the load of its scale; the same either way.
        let at_scale = 3e4 * (1.0 + 0.5 * (1.0 - (-1.0_f64).exp()));
        assert!((stiffness(0.2 * rated) / at_scale - 1.0).abs() < 1e-3);
        assert!((stiffness(-0.2 * rated) / at_scale - 1.0).abs() < 1e-3);
    }

    #[test]
    fn sizes_mean_the_same_in_every_family() {
        let drive = drive();
        let (unit, motion) = (Unit::nominal(&drive), Motion::default());
        let setting = Setting { drive: &drive, unit: &unit, motion: &motion };
        let free = drive.wind_up_arcsec(drive.rated_n_m);
        for family in Family::ALL {
            let mut error = Error { size: -0.2, family, setting: own(setting) };
            let mean = [1.0, -1.0]
                .map(|sense| {
                    let load_n_m = sense * drive.rated_n_m;
                    sense * beyond(&mut error, Now { load_n_m, temperature_c: 20.0, ..Now::default() })
                })
                .iter()
                .sum::<f64>()
                / 2.0;
            assert!((mean / free - 0.25).abs() < 1e-9, "{family:?}: {mean} of {free}");
            let mut thermal = Thermal { size: -2e-3, family, setting: own(setting) };
            let mut at = |temperature_c| {
                beyond(&mut thermal, Now { load_n_m: drive.rated_n_m, temperature_c, ..Now::default() }) / free
            };
            assert!(((at(21.0) - at(19.0)) / 2.0 - 2e-3).abs() < 2e-5, "{family:?}");
            // The hot side gives way more; 40 K of it by 8 %, more or less.
            assert!((0.05..0.13).contains(&at(60.0)), "{family:?}: {}", at(60.0));
        }
    }
}
