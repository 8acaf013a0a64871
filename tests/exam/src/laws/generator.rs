//! A generator off its axis, or of another form.

use super::{Law, Mesh, Now, Setting};
use crate::effect::Family;

/// An eccentric generator: one lobe deeper than the other, so that the first harmonics of both wheels, which equal
/// sharing cancels, come through until the load brings both zones in.
pub struct Lobes {
    lobe: f64,
    flexspline: (f64, f64),
    circular_spline: (f64, f64),
    /// Third harmonic of either wheel over its first.
    third: f64,
    family: Family,
}

impl Lobes {
    pub fn new(size: f64, shape: &[f64], family: Family) -> Self {
        let teeth = size * shape[3];
        Self {
            lobe: size,
            flexspline: (teeth * shape[2], shape[0]),
            circular_spline: (teeth * (1.0 - shape[2]), shape[1]),
            // Wheels held in three jaws when they were cut: what one lobe brings out is every odd harmonic.
            third: if family == Family::C { 0.25 } else { 0.0 },
            family,
        }
    }
}

impl Law for Lobes {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        let odd = |(amplitude, phase): (f64, f64), zone: f64| {
            amplitude * ((zone + phase).cos() + self.third * (3.0 * zone + 2.0 * phase).cos())
        };
        let position =
            odd(self.flexspline, now.on_flexspline_rad) - odd(self.circular_spline, now.on_circular_spline_rad);
        // The second harmonic of real teeth is not touched by which lobe carries.
        let deeper = if self.family == Family::B { 1.15 * self.lobe } else { self.lobe };
        for (zone, sign) in [1.0, -1.0].into_iter().enumerate() {
            mesh.zones.upper[zone] += sign * (position - deeper);
            mesh.zones.lower[zone] += sign * (position + deeper);
        }
    }
}

/// A cam of wrong form meshes with every tooth in the same way: a line at the tooth number of the standing wheel.
pub struct CamForm {
    amplitude: f64,
    phase: f64,
    flank_phase: f64,
    order: f64,
    rated_n_m: f64,
    family: Family,
    flank: f64,
}

impl CamForm {
    pub fn new(size: f64, shape: &[f64], family: Family, setting: Setting) -> Self {
        Self {
            amplitude: size,
            phase: shape[0],
            flank_phase: shape[1],
            order: setting.drive.mesh_order(),
            rated_n_m: setting.drive.rated_n_m,
            family,
            flank: 1.0,
        }
    }
}

impl Law for CamForm {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        if now.flank != 0.0 {
            self.flank = now.flank;
        }
        let x = self.order * now.generator_rad + self.phase + self.flank * self.flank_phase;
        let load = now.load_n_m.abs() / self.rated_n_m;
        match self.family {
            Family::A => mesh.driven += self.amplitude * x.sin() / (1.0 + 0.3 * load),
            Family::B => {
                mesh.driven += self.amplitude * (x.sin() + 0.35 * (2.0 * x + 0.8).sin()) * (1.0 - 0.2 * load.min(1.0));
                mesh.clearance += 0.5 * self.amplitude;
            }
            // Each tooth hands over to the next along a parabola (Litvin and Fuentes 2004), here by its first four
            // harmonics; lobes too proud narrow the clearance, and the teeth level out as (load)^(2/3) (Hertz 1882).
            Family::C => {
                let parabola: f64 = (1..=4).map(f64::from).map(|k| (k * x).cos() / (k * k)).sum();
                mesh.driven += self.amplitude * parabola / (1.0 + 0.4 * load.cbrt().powi(2));
                mesh.clearance -= 0.4 * self.amplitude;
            }
        }
    }
}
