//! What the closed loop on the host and the programs on the target share: the flight, all of it but the tables.
//!
//! `no_std`, deterministic and without a transcendental function of the machine, so that both give the same numbers to
//! the last bit: `tests/firmware` includes this folder.
//!
//! In every tick, at the same time: the output is where the plant has it, and its distance from the target is scored;
//! encoder, torque sensor and thermometer are read; the controller commands a generator angle; the servo sets the
//! torque of the motor; motor and plant go on to the next tick.

pub mod antenna;
pub mod controllers;
pub mod gear;
pub mod motor;
pub mod profile;

pub use crate::noise::Noise;
pub use crate::score;

use flexspline::{GeneratorAngle, OutputAngle};
use motor::Motor;
use profile::ProfileMoment;

/// What the output is carried by.
pub trait RigidPlant {
    /// The generator and the torque on the load go on by a tick; the output angle then, rad.
    fn go(&mut self, generator_rad: f64, torque_n_m: f64) -> f64;

    /// Torque that the drive carries, N·m, under this torque on the load: what the motor feels over the ratio.
    fn carried_n_m(&self, torque_n_m: f64) -> f64;

    /// The temperature of the drive, °C.
    fn set_temperature(&mut self, temperature_c: f64);
}

impl RigidPlant for gear::DenseGear<'_> {
    fn go(&mut self, generator_rad: f64, torque_n_m: f64) -> f64 {
        gear::DenseGear::go(self, generator_rad, torque_n_m)
    }

    fn carried_n_m(&self, torque_n_m: f64) -> f64 {
        torque_n_m
    }

    fn set_temperature(&mut self, temperature_c: f64) {
        gear::DenseGear::set_temperature(self, temperature_c);
    }
}

/// Torque sensor and thermometer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSensors {
    /// Resolution of the torque sensor, N·m.
    pub torque_step_n_m: f64,
    /// Noise of the torque sensor: evenly between ± this, N·m.
    pub torque_noise_n_m: f64,
    /// A torque that shows less than this is taken for none, N·m. What noise makes of no load would throw the output
    /// from one side of the clearance to the other, in the model only.
    pub torque_dead_zone_n_m: f64,
    /// Resolution of the thermometer, K.
    pub temperature_step_k: f64,
}

impl JointSensors {
    /// Of the usual kind for a table up to this torque: 14 bits over ± the range, noise of one step, quarters of a
    /// degree.
    pub fn for_range(largest_n_m: f64) -> Self {
        let step = 2.0 * largest_n_m / 16_384.0;
        Self {
            torque_step_n_m: step,
            torque_noise_n_m: step,
            torque_dead_zone_n_m: 1.5 * step,
            temperature_step_k: 0.25,
        }
    }

    /// What the torque sensor shows.
    pub fn torque(&self, noise: f64, torque_n_m: f64) -> f32 {
        let shown = stepped(torque_n_m + self.torque_noise_n_m * noise, self.torque_step_n_m);
        if shown.abs() < self.torque_dead_zone_n_m { 0.0 } else { shown as f32 }
    }

    /// What the thermometer shows.
    pub fn temperature(&self, temperature_c: f64) -> f32 {
        stepped(temperature_c, self.temperature_step_k) as f32
    }
}

fn stepped(value: f64, step: f64) -> f64 {
    libm::floor(value / step + 0.5) * step
}

/// A drive with its motor, somewhere on its way.
#[derive(Clone, Debug)]
pub struct Lane<P> {
    /// The drive.
    pub plant: P,
    /// The motor.
    pub motor: Motor,
    output_rad: f64,
}

impl<P: RigidPlant> Lane<P> {
    /// At rest at zero.
    pub fn new(plant: P) -> Self {
        Self { plant, motor: Motor::default(), output_rad: 0.0 }
    }

    /// Where the output is, rad.
    pub fn output_rad(&self) -> f64 {
        self.output_rad
    }

    /// What the encoder shows.
    pub fn encoder(&self) -> GeneratorAngle {
        self.motor.encoder()
    }

    /// To the next tick with this command; the torque sensor shows the one, at the end of the tick the load has the
    /// other.
    pub fn go(&mut self, command: GeneratorAngle, shown_n_m: f32, torque_n_m: f64, ratio: f64) {
        self.motor.control(command, -f64::from(shown_n_m) / ratio);
        self.motor.turn(self.plant.carried_n_m(torque_n_m) / ratio);
        self.output_rad = self.plant.go(self.motor.angle_rad(), torque_n_m);
    }
}

/// Where the output shall be this much later.
pub fn ahead(moment: &ProfileMoment, seconds: f64) -> OutputAngle {
    let target = moment.target_rad + (moment.rate_rad_s + 0.5 * moment.acceleration_rad_s2 * seconds) * seconds;
    OutputAngle::from_rad(target).unwrap_or(OutputAngle::ZERO)
}
