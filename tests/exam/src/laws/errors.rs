//! Errors of form and position: wheels, lobes, encoders, ratio.

use super::{Law, Mesh, Now, Setting};
use crate::ARCSEC;
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
}

impl Law for Displaced {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        let zone = match self.wheel {
            Axis::CircularSpline => now.on_circular_spline_rad,
            Axis::Flexspline => now.on_flexspline_rad,
            Axis::Gravity => now.generator_rad + now.orientation_rad,
        };
        let amplitude = self.amplitude / (1.0 + now.load_n_m.abs() / self.centring_n_m);
        mesh.zones.displace(zone - self.phase, amplitude, self.pressure_angle_rad);
        if let Some(phase) = self.wall {
            mesh.driven += 0.15 * self.amplitude * (2.0 * zone + phase).sin();
        }
    }
}

/// A circular spline bent to an oval without stretching: half the radial motion goes along the teeth, and where its spaces are
/// displaced forward the output lags.
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

/// An eccentric generator: one lobe deeper than the other, so that the first harmonics of both wheels, which equal sharing
/// cancels, come through until the load brings both zones in.
pub struct Lobes {
    lobe: f64,
    flexspline: (f64, f64),
    circular_spline: (f64, f64),
    family: Family,
}

impl Lobes {
    pub fn new(size: f64, shape: &[f64], family: Family) -> Self {
        let teeth = size * shape[3];
        Self {
            lobe: size,
            flexspline: (teeth * shape[2], shape[0]),
            circular_spline: (teeth * (1.0 - shape[2]), shape[1]),
            family,
        }
    }
}

impl Law for Lobes {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        let position = self.flexspline.0 * (now.on_flexspline_rad + self.flexspline.1).cos()
            - self.circular_spline.0 * (now.on_circular_spline_rad + self.circular_spline.1).cos();
        // The second harmonic of real teeth is not touched by which lobe carries.
        let deeper = if self.family == Family::A { self.lobe } else { 1.15 * self.lobe };
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
        }
    }
}

/// A disc off its axis at the output.
pub struct OutputEncoder {
    pub amplitude: f64,
    pub phase: f64,
    pub family: Family,
}

impl Law for OutputEncoder {
    fn reading(&mut self, now: &Now, _: f64) -> f64 {
        let x = now.output_rad + self.phase;
        match self.family {
            Family::A => self.amplitude * x.sin(),
            // The head reads a disc that is off its axis and slightly bent.
            Family::B => {
                let e = self.amplitude / ARCSEC;
                ARCSEC * (e * x.sin()).atan2(1.0 + e * x.cos()) + 0.05 * self.amplitude * (2.0 * x + 0.6).sin()
            }
        }
    }
}

/// A disc off its axis at the generator.
pub struct GeneratorEncoder {
    pub amplitude_rad: f64,
    pub phase: f64,
    pub family: Family,
}

impl Law for GeneratorEncoder {
    fn generator_reading(&mut self, now: &Now) -> f64 {
        let x = now.generator_rad + self.phase;
        match self.family {
            Family::A => self.amplitude_rad * x.sin(),
            Family::B => {
                (self.amplitude_rad * x.sin()).atan2(1.0 + self.amplitude_rad * x.cos())
                    + 0.07 * self.amplitude_rad * (2.0 * x - 0.4).sin()
            }
        }
    }
}

/// Another ratio than the catalogue's, or another scale of the output encoder.
pub struct Ratio {
    pub relative: f64,
    pub family: Family,
    pub start: Option<f64>,
}

impl Law for Ratio {
    fn reading(&mut self, now: &Now, deviation_arcsec: f64) -> f64 {
        let exact = now.driven_arcsec;
        match self.family {
            Family::A => self.relative * (exact - *self.start.get_or_insert(exact)),
            Family::B => self.relative * (exact + deviation_arcsec),
        }
    }
}

/// No law of its own.
pub struct Nothing;

impl Law for Nothing {}
