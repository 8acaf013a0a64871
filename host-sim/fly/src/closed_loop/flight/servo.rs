//! Motor, its encoder, and the position servo that turns the generator where it is told.
//!
//! A position loop with the command's rate and acceleration fed forward, a speed loop with integral part inside, the
//! torque of the motor limited, the load as the torque sensor shows it fed forward; an encoder of so many bits. The
//! drive is felt as the flank torque over the ratio.

use core::f64::consts::TAU;
use flexspline::GeneratorAngle;

use super::profile::TICK_S;

/// What a servo is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoSettings {
    /// Inertia of motor and generator, kg·m².
    pub inertia_kg_m2: f64,
    /// Viscous friction of motor and generator, N·m·s/rad.
    pub viscous_n_m_s: f64,
    /// Largest torque of the motor, N·m.
    pub largest_torque_n_m: f64,
    /// Bandwidth of the position loop, Hz.
    pub position_hz: f64,
    /// Bandwidth of the speed loop, Hz.
    pub speed_hz: f64,
    /// Corner of the integral part of the speed loop, Hz.
    pub integral_hz: f64,
    /// Bits of the encoder in one turn of the motor.
    pub encoder_bits: u32,
}

/// A motor of the size that turns HHD-95.
pub const SERVO: ServoSettings = ServoSettings {
    inertia_kg_m2: 1.1e-4,
    viscous_n_m_s: 1e-4,
    largest_torque_n_m: 4.0,
    position_hz: 25.0,
    speed_hz: 100.0,
    integral_hz: 10.0,
    encoder_bits: 20,
};

/// A motor with its servo.
#[derive(Clone, Debug)]
pub struct Servo {
    settings: ServoSettings,
    angle_rad: f64,
    rate_rad_s: f64,
    torque_n_m: f64,
    integral_n_m: f64,
    /// What was measured and commanded in the tick before.
    measured: GeneratorAngle,
    commanded: GeneratorAngle,
    pace_rad_s: f64,
}

impl Servo {
    /// At rest at zero.
    pub fn new(settings: ServoSettings) -> Self {
        Self {
            settings,
            angle_rad: 0.0,
            rate_rad_s: 0.0,
            torque_n_m: 0.0,
            integral_n_m: 0.0,
            measured: GeneratorAngle::ZERO,
            commanded: GeneratorAngle::ZERO,
            pace_rad_s: 0.0,
        }
    }

    /// True generator angle, rad.
    pub fn angle_rad(&self) -> f64 {
        self.angle_rad
    }

    /// True speed of the generator, rad/s.
    pub fn rate_rad_s(&self) -> f64 {
        self.rate_rad_s
    }

    /// Torque of the motor in the tick before, N·m.
    pub fn torque_n_m(&self) -> f64 {
        self.torque_n_m
    }

    /// What the encoder shows.
    pub fn encoder(&self) -> GeneratorAngle {
        let steps = f64::from(1u32 << self.settings.encoder_bits);
        let step = libm::floor(self.angle_rad * (steps / TAU) + 0.5) as i64;
        GeneratorAngle::from_counts(step << (32 - self.settings.encoder_bits))
    }

    /// The torque of the motor for the tick that begins, from the encoder and the command; `against_n_m` is what the
    /// load is known to ask of the motor.
    pub fn control(&mut self, command: GeneratorAngle, against_n_m: f64) {
        let ServoSettings { inertia_kg_m2, largest_torque_n_m, position_hz, speed_hz, integral_hz, .. } = self.settings;
        let measured = self.encoder();
        let speed = angle_rad(measured.minus_counts(self.measured)) / TICK_S;
        let pace = angle_rad(command.minus_counts(self.commanded)) / TICK_S;
        let wanted = pace + TAU * position_hz * angle_rad(command.minus_counts(measured));
        let gain = TAU * speed_hz * inertia_kg_m2;
        let asked = gain * (wanted - speed)
            + self.integral_n_m
            + inertia_kg_m2 * (pace - self.pace_rad_s) / TICK_S
            + against_n_m;
        self.torque_n_m = asked.clamp(-largest_torque_n_m, largest_torque_n_m);
        if self.torque_n_m == asked {
            self.integral_n_m += gain * TAU * integral_hz * TICK_S * (wanted - speed);
        }
        (self.measured, self.commanded, self.pace_rad_s) = (measured, command, pace);
    }

    /// The motor moves on for a time while the drive pulls at it with this flank torque over the ratio, N·m.
    pub fn turn(&mut self, seconds: f64, pull_n_m: f64) {
        let ServoSettings { inertia_kg_m2, viscous_n_m_s, .. } = self.settings;
        let acceleration = (self.torque_n_m + pull_n_m - viscous_n_m_s * self.rate_rad_s) / inertia_kg_m2;
        self.angle_rad += (self.rate_rad_s + 0.5 * acceleration * seconds) * seconds;
        self.rate_rad_s += acceleration * seconds;
    }
}

/// Counts of an angle as radians.
fn angle_rad(counts: i64) -> f64 {
    counts as f64 * (TAU / 4_294_967_296.0)
}
