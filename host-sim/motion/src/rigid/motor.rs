//! The motor of a drive without mass: it turns the generator where its servo tells it, and feels the flank torque over
//! the ratio. The servo is that of any joint ([`crate::servo`]); its current comes at once.

use flexspline::GeneratorAngle;

use super::profile::TICK_S;
use crate::servo::{Asked, Servo, ServoSettings, angle_rad};

/// For a motor of the size that turns HHD-95.
pub const SERVO: ServoSettings = ServoSettings {
    tick_s: TICK_S,
    steps: 1,
    late_steps: 0,
    inertia_kg_m2: 1.1e-4,
    largest_n_m: 4.0,
    position_hz: 25.0,
    speed_hz: 100.0,
    integral_hz: 10.0,
    encoder_bits: 20,
    jitter_s: 0.0,
    current_noise_n_m: 0.0,
};
/// Viscous friction of motor and generator, N·m·s/rad (guess).
const VISCOUS_N_M_S: f64 = 1e-4;

/// A motor with its servo.
#[derive(Clone, Debug)]
pub struct Motor {
    servo: Servo,
    angle_rad: f64,
    rate_rad_s: f64,
    /// What was commanded in the tick before, and how fast that moved, rad/s.
    commanded: GeneratorAngle,
    pace_rad_s: f64,
}

impl Default for Motor {
    /// At rest at zero.
    fn default() -> Self {
        let servo = Servo::new(SERVO, 1.0, 0);
        Self { servo, angle_rad: 0.0, rate_rad_s: 0.0, commanded: GeneratorAngle::ZERO, pace_rad_s: 0.0 }
    }
}

impl Motor {
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
        self.servo.motor_n_m()
    }

    /// What the encoder shows.
    pub fn encoder(&self) -> GeneratorAngle {
        self.servo.encoder(self.angle_rad)
    }

    /// The torque of the motor for the tick that begins, from the encoder and the command, which is fed forward by its
    /// rate and acceleration; `against_n_m` is what the load is known to ask of the motor.
    pub fn control(&mut self, command: GeneratorAngle, against_n_m: f64) {
        self.servo.read(self.angle_rad, self.rate_rad_s);
        let rate_rad_s = angle_rad(command.minus_counts(self.commanded)) / TICK_S;
        let acceleration_rad_s2 = (rate_rad_s - self.pace_rad_s) / TICK_S;
        let asked = Asked { command, rate_rad_s, acceleration_rad_s2, torque_n_m: against_n_m, starts: 0.0 };
        self.servo.control(&asked);
        self.servo.give();
        (self.commanded, self.pace_rad_s) = (command, rate_rad_s);
    }

    /// The motor moves on for a tick while the drive pulls at it with this flank torque over the ratio, N·m.
    pub fn turn(&mut self, pull_n_m: f64) {
        let pushed_n_m = self.torque_n_m() + pull_n_m - VISCOUS_N_M_S * self.rate_rad_s;
        let acceleration = pushed_n_m / SERVO.inertia_kg_m2;
        self.angle_rad += (self.rate_rad_s + 0.5 * acceleration * TICK_S) * TICK_S;
        self.rate_rad_s += acceleration * TICK_S;
    }
}
