//! The gear of families D and E: where the teeth let the hub of the output rest, and the spring behind the hub.
//!
//! Order of the parts: generator, teeth with clearance, hub with friction against the housing, spring, flange, torque
//! sensor, load. A positive load turns the output forward. The teeth of two zones, half a turn of the generator apart,
//! hold the hub between a lower and an upper limit. Each zone has limits of its own; they share by a sum of
//! exponentials, as many teeth with spread gaps do: nearly the tighter zone alone without load, nearly the mean of both
//! under load.

use std::f64::consts::{PI, TAU};

use crate::ARCSEC;
use crate::cause::Cause;
use crate::chance::Chance;
use crate::drive::{Drive, Fixed, Unit};
use crate::hides::{Hides, Stranger, Thing};
use crate::profile::Profile;

/// Which laws.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Laws {
    D,
    E,
}

/// The drive at one instant.
#[derive(Debug, Clone, Copy, Default)]
pub struct Place {
    pub time_s: f64,
    /// Share of the path of the generator that is done, 0..1.
    pub done: f64,
    pub session: usize,
    pub generator_rad: f64,
    pub output_rad: f64,
    /// Torque in the spring, N m, positive forward.
    pub torque_n_m: f64,
    pub temperature_c: f64,
    /// Of the housing, which follows more slowly, °C.
    pub housing_c: f64,
    pub orientation_rad: f64,
}

/// The gear with what is hidden in it.
pub struct Gear<'a> {
    pub drive: &'a Drive,
    pub unit: &'a Unit,
    laws: Laws,
    pub hidden: &'a [Hides],
    /// Position error around a wheel, of each hidden effect that is one.
    profiles: Vec<Profile>,
    /// Lines of the unit: order, amplitude, phase.
    lines: Vec<(f64, f64, f64)>,
    /// Deflection and torque at the corners of the catalogue's spring.
    corners: Vec<(f64, f64)>,
    ratio: f64,
}

const PROFILE: usize = 2048;

impl<'a> Gear<'a> {
    pub fn new(drive: &'a Drive, unit: &'a Unit, laws: Laws, hidden: &'a [Hides]) -> Self {
        let lines = drive.harmonics.iter().zip(&unit.harmonics);
        let lines =
            lines.map(|(h, (scale, shift))| (h.order, h.amplitude_arcsec * scale, h.phase_rad + shift)).collect();
        let corners = drive.stiffness.iter().map(|(torque, _)| (drive.wind_up_arcsec(*torque), *torque)).collect();
        let profiles = hidden.iter().map(|one| profile(one, laws)).collect();
        Self { drive, unit, laws, hidden, profiles, lines, corners, ratio: drive.ratio() }
    }

    /// Motion of the teeth by the catalogue's lines on top of the exact ratio, arcsec, and its slope, arcsec/rad.
    pub fn lines(&self, generator_rad: f64) -> (f64, f64) {
        self.lines.iter().fold((0.0, 0.0), |(sum, slope), (order, amplitude, phase)| {
            let (sin, cos) = (order * generator_rad + phase).sin_cos();
            (sum + amplitude * sin, slope + amplitude * order * cos)
        })
    }

    /// Lowest and highest position of the hub relative to generator angle over ratio, arcsec.
    pub fn limits(&self, at: &Place) -> (f64, f64) {
        let (mut middle, mut half) =
            (self.lines(at.generator_rad).0, 0.5 * self.drive.backlash_arcsec * self.unit.backlash);
        let (mut upper, mut lower) = ([0.0; 2], [0.0; 2]);
        let [on_flexspline, on_circular] = self.drive.wheels_rad(at.generator_rad, at.output_rad);
        let flank = if self.drive.fixed == Fixed::Flexspline { 1.0 } else { -1.0 };
        let rated = self.drive.rated_n_m;
        for (one, profile) in self.hidden.iter().zip(&self.profiles) {
            let (size, phase) = (one.size, one.phase(0));
            // An axis aside: each zone meets it with the other sign.
            let mut aside = |x: f64, size: f64, angle_rad: f64| {
                for (zone, sign) in [1.0, -1.0].into_iter().enumerate() {
                    upper[zone] += sign * size * (x + flank * angle_rad).sin();
                    lower[zone] += sign * size * (x - flank * angle_rad).sin();
                }
            };
            // The rim of family E gives way to a side force, as a spring of its own does.
            let (size_aside, angle) = match self.laws {
                Laws::D => (size, 0.38),
                Laws::E => (size / (1.0 + (at.torque_n_m / (1.5 * rated)).powi(2)), 0.46),
            };
            match one.thing {
                Thing::Cause(Cause::CircularSplineEccentricity) => aside(on_circular - phase, size_aside, angle),
                Thing::Cause(Cause::FlexsplineRunout) => aside(on_flexspline - phase, size_aside, angle),
                Thing::Cause(Cause::GravitySideLoad) => {
                    aside(at.generator_rad + at.orientation_rad - phase, size_aside, angle);
                }
                Thing::Cause(Cause::CircularSplineOvality) => {
                    // A ring that bends without stretching turns its teeth by half of what it moves them out.
                    let two = 2.0 * on_circular + phase;
                    middle += 0.5 * size * two.sin();
                    half += size * angle.tan() * two.cos();
                    if self.laws == Laws::D {
                        // Pressed into a square flange.
                        half += 0.12 * size * angle.tan() * (4.0 * on_circular + one.phase(1)).cos();
                    }
                }
                Thing::Cause(Cause::FlexsplinePitchError | Cause::CircularSplinePitchError) => {
                    let flexspline = one.thing == Thing::Cause(Cause::FlexsplinePitchError);
                    let (x, sign) = if flexspline { (on_flexspline, 1.0) } else { (on_circular, -1.0) };
                    for (zone, x) in [x, x + PI].into_iter().enumerate() {
                        let moved = sign * size * profile.at(x);
                        upper[zone] += moved;
                        lower[zone] += moved;
                    }
                }
                Thing::Cause(Cause::GeneratorEccentricity) => {
                    // One lobe is deeper, so its zone is tight on both flanks and shows the first order of either
                    // wheel.
                    let deeper = match self.laws {
                        Laws::D => 0.7 * size,
                        Laws::E => 0.7 * size * (-at.torque_n_m.abs() / (0.6 * rated)).exp(),
                    };
                    let share = 0.25 + 0.5 * one.shape[2];
                    let odd = size
                        * (share * (on_flexspline + phase).sin() + (1.0 - share) * (on_circular + one.phase(1)).sin());
                    for (zone, sign) in [1.0, -1.0].into_iter().enumerate() {
                        upper[zone] += sign * (odd - deeper);
                        lower[zone] += sign * (odd + deeper);
                    }
                }
                Thing::Cause(Cause::CamFormError) => {
                    let mesh = self.drive.mesh_order() * at.generator_rad;
                    let less = 1.0 / (1.0 + (at.torque_n_m / rated).powi(2));
                    middle += size * less * ((mesh + phase).sin() + 0.25 * (2.0 * mesh + one.phase(1)).sin());
                    half += size;
                }
                Thing::Cause(Cause::DamagedTooth) => {
                    let x = if one.shape[1] < 0.5 { on_flexspline } else { on_circular };
                    let bearing = if one.shape[2] < 0.5 { 1.0 } else { -1.0 };
                    let load = (bearing * at.torque_n_m / (0.4 * rated)).clamp(0.0, 1.0);
                    for x in [x, x + PI] {
                        let near = wrapped(x - phase) / (0.2 + 0.2 * one.shape[3]);
                        // The neighbours take over: the hub gives way by so much on the flank that carries.
                        middle += bearing * size * load * (-2.0 * near * near).exp();
                    }
                }
                Thing::Cause(Cause::BacklashGrowth) => {
                    let uneven = if self.laws == Laws::E { 0.15 * (on_circular + phase).cos() } else { 0.0 };
                    half += 0.5 * size * (1.0 + uneven);
                }
                Thing::Cause(Cause::Wear) => {
                    half += 0.5
                        * size
                        * match self.laws {
                            // Quick at first, as the root of the path: conforming flanks.
                            Laws::D => at.done.powf(0.6),
                            // Half of it while the drive runs between recordings.
                            Laws::E => 0.5 * at.done + 0.1 * at.session as f64,
                        };
                }
                Thing::Cause(Cause::ThermalClearance) => {
                    // The housing opens the circular spline; the generator, which follows the teeth, closes the
                    // clearance.
                    let warmer = match self.laws {
                        Laws::D => 1.4 * (at.housing_c - 20.0) - 0.4 * (at.temperature_c - 20.0),
                        Laws::E => at.housing_c - 20.0,
                    };
                    half += 0.5 * size * warmer;
                }
                Thing::Cause(Cause::Ratcheting) => {
                    let pitch = TAU / self.drive.output_teeth() * ARCSEC;
                    let start = 0.3 + 0.4 * one.shape[0];
                    let over = match self.laws {
                        // Climbed while the wave passes: a thousandth of the run.
                        Laws::D => ((at.done - start) / 1e-3).clamp(0.0, 1.0),
                        Laws::E => f64::from(u8::from(at.done > start)),
                    };
                    middle += if one.shape[1] < 0.5 { 1.0 } else { -1.0 } * pitch * over;
                }
                Thing::Stranger(Stranger::SpurStage) => {
                    let order = 2.6 + 1.8 * one.shape[1] + 0.013;
                    middle += size
                        * ((order * at.generator_rad + phase).sin() + 0.3 * (2.0 * order * at.generator_rad).sin());
                }
                _ => {}
            }
        }
        // Teeth that bear are pressed in by an eighth of the wind-up.
        let press = self.drive.wind_up_arcsec(at.torque_n_m) / 8.0;
        let high = middle + half + shared(upper, press.max(0.0));
        let low = middle - half - shared([-lower[0], -lower[1]], (-press).max(0.0));
        if low > high { (0.5 * (low + high), 0.5 * (low + high)) } else { (low, high) }
    }

    /// Factor on the stiffness of the spring.
    fn stiffer(&self, at: &Place, deflection_arcsec: f64) -> f64 {
        let mut factor = self.unit.stiffness;
        let full = self.drive.wind_up_arcsec(self.drive.rated_n_m);
        for one in self.hidden {
            match one.thing {
                Thing::Cause(Cause::StiffnessError) => factor *= 1.0 + one.size,
                Thing::Cause(Cause::StiffnessHardening) => {
                    let x = (deflection_arcsec / full).abs().min(2.0);
                    factor *= match self.laws {
                        // A cubic spring.
                        Laws::D => 1.0 + one.size * x * x,
                        // Soft around zero: joints that seat themselves.
                        Laws::E => 1.0 + one.size * (1.0 - (-x / (0.15 + 0.3 * one.shape[0])).exp()),
                    };
                }
                Thing::Cause(Cause::ThermalStiffness) => {
                    let warmer = at.temperature_c - 20.0;
                    factor *= match self.laws {
                        Laws::D => 1.0 + one.size * warmer,
                        Laws::E => (one.size * warmer).exp(),
                    };
                }
                _ => {}
            }
        }
        factor.max(0.1)
    }

    /// Torque of the spring at a deflection (output ahead of the hub positive), N m.
    pub fn torque(&self, deflection_arcsec: f64, at: &Place) -> f64 {
        // The catalogue's deflection is the torque's over the factor, so the spring is read at the stretched
        // deflection.
        let x = (deflection_arcsec * self.stiffer(at, deflection_arcsec)).abs();
        let part = self.corners.iter().rposition(|(from, _)| *from <= x).unwrap_or(0);
        let (from, torque) = self.corners[part];
        (torque + (x - from) / ARCSEC * self.drive.stiffness[part].1).copysign(deflection_arcsec)
    }

    pub fn wind_up(&self, torque_n_m: f64, at: &Place) -> f64 {
        let mut x = self.drive.wind_up_arcsec(torque_n_m) / self.unit.stiffness;
        for _ in 0..30 {
            let next = self.drive.wind_up_arcsec(torque_n_m) / self.stiffer(at, x);
            let step = next - x;
            x += 0.7 * step;
            if step.abs() < 1e-9 {
                break;
            }
        }
        x
    }

    /// Torque on the flange before the sensor, N m.
    pub fn unseen(&self, at: &Place, output_speed_rad_s: f64) -> f64 {
        let mut sum = 0.0;
        for one in self.hidden {
            sum += match one.thing {
                Thing::Cause(Cause::GravityTorque) => {
                    one.size * (at.output_rad + at.orientation_rad + one.phase(0)).sin()
                }
                Thing::Cause(Cause::LubricantViscosity) => {
                    // Grease after Herschel and Bulkley (1926), thinner as it warms.
                    let rate = (self.ratio * output_speed_rad_s / 8.0).abs();
                    let colder = (-0.035 * (at.temperature_c - 20.0)).exp();
                    -one.size
                        * colder
                        * (0.25 * (rate / 0.02).tanh() + 0.75 * rate.powf(0.6))
                        * output_speed_rad_s.signum()
                }
                Thing::Stranger(Stranger::CableSpring) => {
                    let pull = self.drive.first_stiffness() * one.size / ARCSEC;
                    let from = wrapped(at.output_rad - one.phase(0));
                    -pull * (from.abs() - 0.5).max(0.0).copysign(from)
                }
                _ => 0.0,
            };
        }
        sum
    }

    pub fn output_reading(&self, output_rad: f64) -> f64 {
        let mut reading = output_rad;
        for one in self.hidden {
            match one.thing {
                // A disc whose centre is off the axis, read by one head.
                Thing::Cause(Cause::OutputEncoderEccentricity) => {
                    let e = one.size / ARCSEC;
                    let (sin, cos) = (output_rad + one.phase(0)).sin_cos();
                    reading += (e * sin).atan2(1.0 + e * cos);
                }
                Thing::Stranger(Stranger::PolygonFaces) => {
                    let faces = [24.0, 36.0][usize::from(one.shape[0] < 0.5)];
                    let face = (output_rad / TAU * faces).floor().rem_euclid(faces);
                    let mut chance = Chance::new((1e9 * one.shape[1]) as u64, "face", face as u64);
                    reading += one.size * chance.normal() / ARCSEC;
                }
                Thing::Stranger(Stranger::IndexTable) => {
                    let third = (3.0 * output_rad + one.phase(0)).sin();
                    reading += one.size * (third + 0.6 * (5.0 * output_rad + one.phase(1)).sin()) / ARCSEC;
                }
                _ => {}
            }
        }
        reading
    }

    pub fn generator_reading(&self, generator_rad: f64) -> f64 {
        let mut reading = generator_rad;
        for one in self.hidden {
            match one.thing {
                Thing::Cause(Cause::GeneratorEncoderEccentricity) => {
                    let e = one.size / ARCSEC * self.ratio.abs();
                    let (sin, cos) = (generator_rad + one.phase(0)).sin_cos();
                    reading += (e * sin).atan2(1.0 + e * cos);
                }
                // Another count per turn than the catalogue says.
                Thing::Cause(Cause::RatioError) => reading -= one.size * generator_rad,
                _ => {}
            }
        }
        reading
    }

    pub fn size_of(&self, thing: Thing) -> Option<&Hides> {
        self.hidden.iter().find(|one| one.thing == thing)
    }
}

/// Where the hub rests on two zones that stop it at these positions, without half the clearance.
fn shared(limits: [f64; 2], press_arcsec: f64) -> f64 {
    let spread = 0.4 + 0.6 * press_arcsec;
    let [a, b] = limits;
    let least = a.min(b);
    least - spread * (0.5 * ((-(a - least) / spread).exp() + (-(b - least) / spread).exp())).ln()
}

/// The angle in -π..π.
fn wrapped(angle_rad: f64) -> f64 {
    angle_rad - TAU * (angle_rad / TAU).round()
}

/// Teeth out of place around a wheel, averaged over the engaged arc, for a size of one.
fn profile(one: &Hides, laws: Laws) -> Profile {
    if !matches!(one.thing, Thing::Cause(Cause::FlexsplinePitchError | Cause::CircularSplinePitchError)) {
        return Profile::new(Vec::new());
    }
    let mut chance = Chance::new((1e9 * one.shape[1]) as u64, "teeth", 0);
    match laws {
        // Hobbed: two waves of the machine's table lead, the others fall as the square of their order.
        Laws::D => {
            let lines: Vec<(f64, f64, f64)> = (1..=12)
                .map(|k| {
                    let k = f64::from(k);
                    let own = if k == 2.0 { 1.0 } else { 0.5 * chance.normal() / (k * k) };
                    let arc = 0.17 * k;
                    (k, own * arc.sin() / arc, chance.phase())
                })
                .collect();
            Profile::sines(&lines, PROFILE)
        }
        // Cut in two passes by an indexing head that gained in each: a saw-tooth twice around, and one of another
        // height once.
        Laws::E => {
            let (start, uneven) = (one.shape[0], 0.3 + 0.4 * one.shape[2]);
            let raw: Vec<f64> = (0..PROFILE)
                .map(|at| {
                    let x = at as f64 / PROFILE as f64 + start;
                    2.0 * ((2.0 * x).rem_euclid(1.0) - 0.5) + uneven * (x.rem_euclid(1.0) - 0.5)
                })
                .collect();
            let arc = PROFILE / 30;
            let mean = |at: usize| (0..arc).map(|by| raw[(at + by) % PROFILE]).sum::<f64>() / arc as f64;
            Profile::new((0..PROFILE).map(mean).collect())
        }
    }
}
