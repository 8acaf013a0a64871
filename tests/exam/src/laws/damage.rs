//! A damaged tooth, and teeth that jumped.

use super::{Law, Mesh, Now, Setting};
use crate::ARCSEC;
use crate::effect::Family;
use crate::teeth::{pulse, wrapped};
use std::f64::consts::{PI, TAU};

/// One tooth of one wheel gives no support on one flank.
pub struct DamagedTooth {
    amplitude: f64,
    position: f64,
    circular_spline: bool,
    flank: f64,
    half_width: f64,
    family: Family,
    rated_n_m: f64,
}

impl DamagedTooth {
    pub fn new(size: f64, shape: &[f64], family: Family, setting: Setting) -> Self {
        Self {
            amplitude: size,
            position: shape[0],
            circular_spline: shape[1] > 0.5,
            flank: 1.0_f64.copysign(shape[2]),
            half_width: shape[3],
            family,
            rated_n_m: setting.drive.rated_n_m,
        }
    }
}

impl Law for DamagedTooth {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        let zone = if self.circular_spline { now.on_circular_spline_rad } else { now.on_flexspline_rad };
        for at in 0..2 {
            let angle = zone + PI * at as f64 - self.position;
            match self.family {
                // A gap: the zone touches later, and the load must press the other zone in before it shows.
                Family::A => {
                    let gap = self.amplitude * pulse(angle, self.half_width);
                    if self.flank > 0.0 {
                        mesh.zones.upper[at] += gap;
                    } else {
                        mesh.zones.lower[at] -= gap;
                    }
                }
                // Springs side by side, one missing: deflection grows with the load and with its weight in the zone.
                Family::B => {
                    if now.load_n_m * self.flank > 0.0 {
                        let weight = 0.3 * pulse(angle, 1.2 * self.half_width).powf(1.4);
                        let give = weight / (1.0 - weight) / (0.3 / 0.7);
                        mesh.wind_up += self.amplitude * give * now.load_n_m / self.rated_n_m;
                    }
                }
                // Teeth enter over a gap that grows with the square of the distance from the middle of the zone, so its
                // force is as δ^(3/2), its width as δ^(1/2). The missing tooth carried (1 - distance²/width²) δ, the
                // zone is as stiff as δ^(1/2): both the pulse and its width grow with the root of δ, the cube root of
                // the load (derived here).
                Family::C => {
                    let root = (now.load_n_m * self.flank / self.rated_n_m).max(0.0).cbrt();
                    let distance = wrapped(angle).abs() / (self.half_width * root.max(1e-3));
                    mesh.wind_up += self.flank * self.amplitude * root * (1.0 - distance * distance).max(0.0);
                }
            }
        }
    }
}

/// Teeth jumped under the largest load of the middle of the run.
pub struct Ratchet {
    at: usize,
    second: usize,
    jump_arcsec: f64,
    family: Family,
    jumped: f64,
    /// Travel of the generator since the teeth began to climb, rad, and its last angle.
    climbed: (f64, Option<f64>),
}

impl Ratchet {
    pub fn new(teeth: f64, when: f64, family: Family, setting: Setting) -> Self {
        let torque = &setting.motion.torque_n_m;
        let count = torque.len();
        let highest = |from: f64, to: f64| {
            let (from, to) = ((from * count as f64) as usize, (to * count as f64) as usize);
            (from..to).max_by(|a, b| torque[*a].abs().total_cmp(&torque[*b].abs())).unwrap_or(from)
        };
        let at = highest(when - 0.05, when + 0.05);
        let second = if family == Family::B { highest(when + 0.06, when + 0.16) } else { usize::MAX };
        let jump_arcsec = teeth * (TAU / setting.drive.output_teeth() * ARCSEC).copysign(torque[at]);
        Self { at, second, jump_arcsec, family, jumped: 0.0, climbed: (0.0, None) }
    }

    /// All jumps together, with the sign of the load that forced them.
    pub fn slipped_arcsec(&self) -> f64 {
        self.jump_arcsec * if self.second == usize::MAX { 1.0 } else { 2.0 }
    }
}

impl Law for Ratchet {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        let jumps = f64::from(u8::from(now.at >= self.at)) + f64::from(u8::from(now.at >= self.second));
        let aim = jumps * self.jump_arcsec;
        match self.family {
            Family::A => self.jumped = aim,
            // The teeth slide into the next space.
            Family::B => self.jumped += (aim - self.jumped) * (1.0 - (-now.step_s / 0.01).exp()),
            // The teeth of one lobe climb, and the next lobe takes the others over: done in half a turn of the
            // generator.
            Family::C => {
                let (travel, last) = &mut self.climbed;
                if now.at >= self.at {
                    *travel += (now.generator_rad - last.unwrap_or(now.generator_rad)).abs();
                }
                *last = Some(now.generator_rad);
                self.jumped = aim * (0.5 - 0.5 * travel.min(PI).cos());
            }
        }
        mesh.driven += self.jumped;
    }
}
