//! Errors of form and position of the wheels.

use super::{Law, Mesh, Now};
use crate::chance::Chance;
use crate::drive::Fixed;
use crate::effect::Family;
use crate::teeth::Profile;
use std::f64::consts::PI;

/// The body in which a displacement of the axis stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Axis {
    /// Turns with the circular spline.
    CircularSpline,
    /// Turns with the flexspline.
    Flexspline,
    /// Follows gravity in the housing.
    Gravity,
}

/// One wheel runs out of true, or its axis is pushed aside.
pub struct Displaced {
    pub wheel: Axis,
    pub amplitude: f64,
    pub phase: f64,
    pub pressure_angle_rad: f64,
    /// Phase of a wall of uneven thickness (second harmonic, 0.15 of the amplitude).
    pub wall: Option<f64>,
    /// Load at which a compliant rim has halved the displacement.
    pub centring_n_m: f64,
    /// What a floating generator follows.
    pub float: Float,
}

/// A generator on an Oldham coupling gives way across its major axis and takes up a share of what stands there; along
/// the axis the lobes hold it. The load clamps the coupling. Floating generators reduce eccentric errors (Jia et al.
/// 2021); the form is derived here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Float {
    /// Share that is taken up without load.
    pub share: f64,
    /// Load at which 1/e of it is left.
    pub clamps_n_m: f64,
}

impl Float {
    /// A generator that is held.
    pub const HELD: Self = Self { share: 0.0, clamps_n_m: f64::INFINITY };

    /// Displacement (arcsec) and pressure angle (rad) that the teeth see: the part along the teeth is less, the part
    /// that opens them as before.
    fn seen(self, amplitude: f64, pressure_angle_rad: f64, load_n_m: f64) -> (f64, f64) {
        let (open, along) = pressure_angle_rad.sin_cos();
        let along = along * (1.0 - self.share * (-load_n_m.abs() / self.clamps_n_m).exp());
        (amplitude * along.hypot(open), open.atan2(along))
    }
}

impl Law for Displaced {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        let zone = match self.wheel {
            Axis::CircularSpline => now.on_circular_spline_rad,
            Axis::Flexspline => now.on_flexspline_rad,
            Axis::Gravity => now.generator_rad + now.orientation_rad,
        };
        let amplitude = self.amplitude / (1.0 + now.load_n_m.abs() / self.centring_n_m);
        let (amplitude, pressure_angle_rad) = self.float.seen(amplitude, self.pressure_angle_rad, now.load_n_m);
        mesh.zones.displace(zone - self.phase, amplitude, pressure_angle_rad);
        if let Some(phase) = self.wall {
            mesh.driven += 0.15 * self.amplitude * (2.0 * zone + phase).sin();
        }
    }
}

/// A circular spline bent to an oval without stretching: half the radial motion goes along the teeth, and where its
/// spaces are displaced forward the output lags.
pub struct Oval {
    pub amplitude: f64,
    pub phase: f64,
    pub pressure_angle_rad: f64,
    pub family: Family,
}

impl Law for Oval {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        let x = now.on_circular_spline_rad;
        let two = 2.0 * x + self.phase;
        let (along, out) = match self.family {
            Family::A => (-0.5 * two.sin(), two.cos()),
            // Bolted at a few points: the fourth harmonic too.
            Family::B => {
                let four = 4.0 * x + 1.7 * self.phase;
                (-0.5 * two.sin() - 0.25 * 0.2 * four.sin(), two.cos() + 0.2 * four.cos())
            }
            // Six bolts, and three of them tighter: sixth harmonic, and a third that the two zones see with opposite
            // signs.
            Family::C => {
                let (three, six) = (3.0 * x + 1.3 * self.phase, 6.0 * x + 2.1 * self.phase);
                let (along, out) = (-0.15 / 3.0 * three.sin(), 0.15 * three.cos());
                let out = self.pressure_angle_rad.tan() * out;
                for (zone, sign) in [self.amplitude, -self.amplitude].into_iter().enumerate() {
                    mesh.zones.upper[zone] += sign * (out - along);
                    mesh.zones.lower[zone] -= sign * (out + along);
                }
                (-0.5 * two.sin() - 0.12 / 6.0 * six.sin(), two.cos() + 0.12 * six.cos())
            }
        };
        mesh.driven -= self.amplitude * along;
        mesh.zones.open(self.amplitude * self.pressure_angle_rad.tan() * out);
    }
}

/// Teeth out of place around a wheel.
pub struct Pitch {
    wheel: Fixed,
    profile: Profile,
}

impl Pitch {
    pub fn new(wheel: Fixed, size: f64, shape: &[f64], family: Family) -> Self {
        let profile = match family {
            Family::A => Profile::new(
                [(1.0, shape[2] * size, shape[1]), (2.0, size, shape[0]), (4.0, shape[4] * size, shape[3])],
                0.20,
            ),
            // A closed random walk of the single pitches, led by the second harmonic of the machine that cut them.
            Family::B => {
                let mut chance = Chance::new(shape[5] as u64, "profile", 0);
                let mut lines = vec![(2.0, 0.85 * size, shape[0])];
                for k in 1..=24 {
                    let k = f64::from(k);
                    lines.push((k, 0.5 * size * chance.normal() / k, chance.phase()));
                }
                Profile::new(lines, 0.14)
            }
            // An indexing head: its own errors at orders one and two, and teeth out of place independently of each
            // other, which is a flat spectrum; the teeth in the middle of the arc carry the most.
            Family::C => {
                let mut chance = Chance::new(shape[5] as u64, "indexed", 0);
                let mut lines = vec![(1.0, shape[2] * size, shape[1]), (2.0, size, shape[0])];
                lines.extend((3..=40).map(|k| (f64::from(k), 0.09 * size * chance.normal(), chance.phase())));
                Profile::carried_by_the_middle(lines, 0.24)
            }
        };
        Self { wheel, profile }
    }
}

impl Law for Pitch {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        let (zone, sign) = match self.wheel {
            Fixed::Flexspline => (now.on_flexspline_rad, 1.0),
            Fixed::CircularSpline => (now.on_circular_spline_rad, -1.0),
        };
        mesh.zones.shift(0, sign * self.profile.at(zone));
        mesh.zones.shift(1, sign * self.profile.at(zone + PI));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_generator_that_floats_takes_up_what_stands_across_it_until_the_load_clamps_it() {
        let float = Float { share: 0.3, clamps_n_m: 10.0 };
        let along = |load_n_m| {
            let (amplitude, angle) = float.seen(20.0, 0.4, load_n_m);
            assert!((amplitude * angle.sin() - 20.0 * 0.4_f64.sin()).abs() < 1e-9, "what opens the teeth stays");
            amplitude * angle.cos() / 0.4_f64.cos()
        };
        assert!((along(0.0) - 14.0).abs() < 1e-9);
        assert!((along(-10.0) - 20.0 * (1.0 - 0.3 * (-1.0_f64).exp())).abs() < 1e-9);
        assert!((along(200.0) - 20.0).abs() < 1e-6);
        let held = Float::HELD.seen(20.0, -0.4, 5.0);
        assert!((held.0 - 20.0).abs() < 1e-12 && (held.1 + 0.4).abs() < 1e-12);
    }
}
