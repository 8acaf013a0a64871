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
            // T = k x + k3 x³ with k3 such that the cubic part is `relative` of k x where the linear spring has its rated
            // deflection; Newton from above.
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
        let give = match self.family {
            Family::A => 1.0 / (1.0 + self.size) - 1.0,
            // A soft part in series, slightly softer one way than the other.
            Family::B => (1.0 / (1.0 + self.size) - 1.0) * (1.0 + 0.06 * now.load_n_m.signum()),
        };
        mesh.wind_up += give * self.setting.wind_up(now.load_n_m);
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
        };
        mesh.wind_up += (1.0 / ratio.max(0.3) - 1.0) * self.setting.wind_up(now.load_n_m);
    }
}
