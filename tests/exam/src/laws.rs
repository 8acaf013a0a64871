//! The laws of the named causes, three for each. Sources stand in the README of this crate.

mod damage;
mod encoders;
mod generator;
mod hysteresis;
mod load;
mod mode;
mod stiffness;
mod wheels;
mod width;

use crate::ARCSEC;
use crate::cause::Cause;
use crate::drive::{Drive, Fixed, Unit};
use crate::effect::{Effect, Family, What};
use crate::motion::Motion;
use crate::teeth::Zones;

pub(crate) use damage::Ratchet;

/// The plant at one instant, as a law sees it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Now {
    /// Step to this instant, s.
    pub step_s: f64,
    /// Seconds without motion before this instant, where a session begins.
    pub gap_s: Option<f64>,
    /// Index of the point.
    pub at: usize,
    /// Time, s.
    pub time_s: f64,
    /// Share of the time from the first to the last point.
    pub elapsed: f64,
    /// Generator angle, rad.
    pub generator_rad: f64,
    /// Its speed, rad/s.
    pub speed_rad_s: f64,
    /// Output angle, rad.
    pub output_rad: f64,
    /// Output angle that the teeth ask for, arcsec; it turns with the generator.
    pub driven_arcsec: f64,
    /// Angle of the first zone on the flexspline, rad.
    pub on_flexspline_rad: f64,
    /// Angle of the first zone on the circular spline, rad.
    pub on_circular_spline_rad: f64,
    /// Load that the torque column tells, N m.
    pub torque_n_m: f64,
    /// Load with all that it does not tell, N m.
    pub load_n_m: f64,
    /// Temperature, °C.
    pub temperature_c: f64,
    /// Of the housing, rad.
    pub orientation_rad: f64,
    /// Flank in contact at the last instant: +1 forward, -1 backward, 0 neither.
    pub flank: f64,
}

/// What laws add to the mesh.
#[derive(Debug, Clone, Copy, Default)]
pub struct Mesh {
    /// Wider clearance, arcsec.
    pub clearance: f64,
    /// Where the zones touch.
    pub zones: Zones,
    /// Motion of the driven position, arcsec.
    pub driven: f64,
    /// Wind-up beyond the unit's own, arcsec.
    pub wind_up: f64,
}

/// One effect at work. Called once in each step, in the order of the methods.
pub trait Law {
    /// Load beyond the torque column, N m.
    fn load(&mut self, _now: &Now) -> f64 {
        0.0
    }

    /// What it does between generator and output.
    fn mesh(&mut self, _now: &Now, _mesh: &mut Mesh) {}

    /// What it adds to the motion of the output, from the output's deviation from the exact ratio, arcsec.
    fn output(&mut self, _now: &Now, _deviation_arcsec: f64) -> f64 {
        0.0
    }

    /// What it adds to the output's reading, arcsec.
    fn reading(&mut self, _now: &Now, _deviation_arcsec: f64) -> f64 {
        0.0
    }

    /// What it adds to the generator's reading, rad.
    fn generator_reading(&mut self, _now: &Now) -> f64 {
        0.0
    }
}

/// What laws are made from.
#[derive(Debug, Clone, Copy)]
pub struct Setting<'a> {
    /// Catalogue.
    pub drive: &'a Drive,
    /// Bench.
    pub unit: &'a Unit,
    /// Run.
    pub motion: &'a Motion,
}

impl Setting<'_> {
    /// Deflection of one N m at the unit's first stiffness, arcsec.
    pub fn compliance(&self) -> f64 {
        ARCSEC / (self.drive.first_stiffness() * self.unit.stiffness)
    }
}

/// The law of a named cause.
///
/// # Panics
/// If the effect is outside the library.
pub fn build(effect: &Effect, setting: Setting) -> Box<dyn Law> {
    let What::Cause(cause) = effect.what else { panic!("{effect:?} has no law here") };
    let Effect { family, size, ref shape, .. } = *effect;
    let pressure_angle_rad = match family {
        Family::A => 24.4_f64,
        Family::B => 20.5,
        Family::C => 22.7,
    }
    .to_radians();
    // Where the flexspline turns, a load that turns it forward rests on the other flank of the circular spline.
    let pressure_angle_rad =
        if setting.drive.fixed == Fixed::Flexspline { pressure_angle_rad } else { -pressure_angle_rad };
    let rated_n_m = setting.drive.rated_n_m;
    let displaced = |wheel| wheels::Displaced {
        wheel,
        amplitude: size,
        phase: shape[0],
        pressure_angle_rad,
        wall: if wheel == wheels::Axis::Flexspline && family == Family::B { Some(shape[1]) } else { None },
        centring_n_m: if family == Family::B { 3.0 * rated_n_m } else { f64::INFINITY },
        float: match family {
            Family::A | Family::B => wheels::Float::HELD,
            Family::C => wheels::Float { share: 0.3, clamps_n_m: 0.4 * rated_n_m },
        },
    };
    match cause {
        Cause::CircularSplineEccentricity => Box::new(displaced(wheels::Axis::CircularSpline)),
        Cause::FlexsplineRunout => Box::new(displaced(wheels::Axis::Flexspline)),
        Cause::GravitySideLoad => Box::new(displaced(wheels::Axis::Gravity)),
        Cause::CircularSplineOvality => {
            Box::new(wheels::Oval { amplitude: size, phase: shape[0], pressure_angle_rad, family })
        }
        Cause::FlexsplinePitchError => Box::new(wheels::Pitch::new(Fixed::Flexspline, size, shape, family)),
        Cause::CircularSplinePitchError => Box::new(wheels::Pitch::new(Fixed::CircularSpline, size, shape, family)),
        Cause::GeneratorEccentricity => Box::new(generator::Lobes::new(size, shape, family)),
        Cause::CamFormError => Box::new(generator::CamForm::new(size, shape, family, setting)),
        Cause::DamagedTooth => Box::new(damage::DamagedTooth::new(size, shape, family, setting)),
        Cause::BacklashGrowth => Box::new(width::Growth { size, phase: shape[0], family }),
        Cause::Wear => Box::new(width::Wear::new(size, shape[0], family, setting)),
        Cause::ThermalClearance => Box::new(width::ThermalClearance::new(size, shape[0], family)),
        Cause::StiffnessHardening => Box::new(stiffness::Hardening::new(size, shape[0], family, setting)),
        Cause::StiffnessError => Box::new(stiffness::Error { size, family, setting: stiffness::own(setting) }),
        Cause::ThermalStiffness => Box::new(stiffness::Thermal { size, family, setting: stiffness::own(setting) }),
        Cause::TorsionalHysteresis => match family {
            Family::A => Box::new(hysteresis::MaxwellSlip::new(size, shape[0], setting)),
            Family::B => Box::new(hysteresis::BoucWen::new(size, shape[0], setting)),
            Family::C => Box::new(hysteresis::PartialSlip::new(size, shape[0], setting)),
        },
        Cause::LubricantViscosity => {
            Box::new(load::Drag { drag_n_m: size, steepness: shape[0], family, sense: setting.drive.ratio().signum() })
        }
        Cause::GravityTorque => Box::new(load::Unbalance {
            torque_n_m: size,
            phase: shape[0],
            family,
            sense: setting.drive.ratio().signum(),
        }),
        Cause::TorsionalResonance => Box::new(mode::Mode::new(size, shape[0], shape[1], family)),
        Cause::OutputEncoderEccentricity => {
            Box::new(encoders::OutputEncoder { amplitude: size, phase: shape[0], family })
        }
        Cause::GeneratorEncoderEccentricity => Box::new(encoders::GeneratorEncoder {
            amplitude_rad: size / ARCSEC * setting.drive.ratio().abs(),
            phase: shape[0],
            family,
        }),
        // A delay acts on the readings as a whole: see the plant.
        Cause::SensorLatency => Box::new(encoders::Nothing),
        Cause::RatioError => Box::new(encoders::Ratio { relative: size, family, start: None }),
        Cause::Ratcheting => Box::new(Ratchet::new(size, shape[0], family, setting)),
    }
}
