//! A clearance of another width: grown, wearing, or following the temperature.

use super::{Law, Mesh, Now, Setting};
use crate::effect::Family;

/// Wider from the first row to the last.
pub struct Growth {
    pub size: f64,
    pub phase: f64,
    pub family: Family,
}

impl Law for Growth {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        mesh.clearance += match self.family {
            Family::A => self.size,
            // Uneven around the circular spline.
            Family::B => self.size * (1.0 + 0.1 * (2.0 * now.on_circular_spline_rad + self.phase).sin()),
        };
    }
}

/// Wider with use.
pub struct Wear {
    size: f64,
    running_in: f64,
    family: Family,
    ratio: f64,
    all_work: f64,
    work: f64,
}

impl Wear {
    pub fn new(size: f64, running_in: f64, family: Family, setting: Setting) -> Self {
        let (motion, ratio) = (setting.motion, setting.drive.ratio().abs());
        let all_work = motion.torque_n_m.iter().zip(&motion.speed_rad_s).map(|(t, v)| rate(*t, *v, ratio)).sum::<f64>()
            * motion.step_s;
        Self { size, running_in, family, ratio, all_work: all_work.max(1e-12), work: 0.0 }
    }
}

/// Work of the load on the sliding teeth, W; a tenth of a N m is there without load.
fn rate(torque_n_m: f64, speed_rad_s: f64, ratio: f64) -> f64 {
    (torque_n_m.abs() + 0.1) * speed_rad_s.abs() / ratio
}

impl Law for Wear {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        self.work += rate(now.torque_n_m, now.speed_rad_s, self.ratio) * now.step_s;
        let done = match self.family {
            // Archard: depth as the work done.
            Family::A => self.work / self.all_work,
            // Running in, then steady, while the drive goes on turning between the recordings.
            Family::B => {
                let t = now.elapsed;
                let quick = |t: f64| 1.0 - (-t / self.running_in).exp();
                0.6 * quick(t) / quick(1.0) + 0.4 * t
            }
        };
        mesh.clearance += self.size * done;
    }
}

/// Wider or narrower with temperature.
pub struct ThermalClearance {
    per_k: f64,
    lag_s: f64,
    family: Family,
    slow_c: Option<f64>,
}

impl ThermalClearance {
    pub fn new(per_k: f64, lag_s: f64, family: Family) -> Self {
        Self { per_k, lag_s, family, slow_c: None }
    }
}

impl Law for ThermalClearance {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        let warmer = now.temperature_c - 20.0;
        let slow = self.slow_c.get_or_insert(now.temperature_c);
        let since = now.gap_s.unwrap_or(now.step_s);
        *slow += (now.temperature_c - *slow) * (1.0 - (-since / self.lag_s).exp());
        mesh.clearance += match self.family {
            Family::A => self.per_k * warmer,
            // The generator warms first; the housing, of another metal, follows.
            Family::B => self.per_k * (0.6 * (*slow - 20.0) + 0.4 * warmer + 0.8 * (now.temperature_c - *slow)),
        };
    }
}
