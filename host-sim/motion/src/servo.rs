//! The servo as drives have it: a position loop around a speed loop around the current, sampled, late, with an encoder
//! of a number of counts.

use core::f64::consts::TAU;

use flexspline::GeneratorAngle;

use crate::noise::NoiseSource;

/// Parameters of a servo; bandwidths of a rigid motor alone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ServoSettings {
    /// Time from tick to tick, s.
    pub tick_s: f64,
    /// Steps of the plant in a tick.
    pub steps: usize,
    /// Steps of the plant from a sample to the current that it asks for: computing, bus, current loop.
    pub late_steps: usize,
    /// Inertia that it is tuned for, kg·m² at the motor.
    pub inertia_kg_m2: f64,
    /// Largest torque, N·m at the motor.
    pub largest_n_m: f64,
    /// Position loop, Hz.
    pub position_hz: f64,
    /// Speed loop, Hz.
    pub speed_hz: f64,
    /// Corner of the integral part of the speed loop, Hz.
    pub integral_hz: f64,
    /// Bits of the encoder in a motor turn.
    pub encoder_bits: u32,
    /// The encoder is read up to so much too late, evenly spread, s.
    pub jitter_s: f64,
    /// Noise of the torque from the motor's current, N·m at the motor, rms.
    pub current_noise_n_m: f64,
}

impl ServoSettings {
    /// Of the size of HHD-95's motor, at 1 kHz, 0.2 ms late: 17 bits, tuned for the motor alone at a speed loop that
    /// the load's resonance leaves a margin.
    pub const HHD_95: ServoSettings = ServoSettings {
        tick_s: 1e-3,
        steps: 5,
        late_steps: 1,
        inertia_kg_m2: 1.1e-4,
        largest_n_m: 4.0,
        position_hz: 6.0,
        speed_hz: 50.0,
        integral_hz: 3.0,
        encoder_bits: 17,
        jitter_s: 5e-6,
        current_noise_n_m: 1e-3,
    };
}

/// Target of the servo in a tick.
#[derive(Clone, Copy, Debug)]
pub struct ServoCommand {
    /// Where the generator shall be.
    pub command: GeneratorAngle,
    /// Its rate, fed forward, rad/s of the generator.
    pub rate_rad_s: f64,
    /// Its acceleration, fed forward, rad/s².
    pub acceleration_rad_s2: f64,
    /// Torque that friction and load are expected to take, fed forward, N·m at the motor.
    pub torque_n_m: f64,
    /// The way (1 or −1) in which the target starts to move in this tick, where the load is in that torque; else 0. The
    /// integral part is made anew then: at rest it may hold the friction either way.
    pub starts: f64,
}

/// A motor with its servo and its encoder.
#[derive(Clone, Debug)]
pub struct Servo {
    /// Its parameters.
    pub settings: ServoSettings,
    pub(crate) ratio: f64,
    pub(crate) noise: NoiseSource,
    pub(crate) torque_n_m: f64,
    pub(crate) next_n_m: f64,
    pub(crate) integral_n_m: f64,
    pub(crate) shown: GeneratorAngle,
    pub(crate) before: GeneratorAngle,
}

impl Servo {
    /// At rest at zero, on a drive of a ratio.
    pub fn new(settings: ServoSettings, ratio: f64, seed: u32) -> Self {
        Self {
            settings,
            ratio,
            noise: NoiseSource::new(seed),
            torque_n_m: 0.0,
            next_n_m: 0.0,
            integral_n_m: 0.0,
            shown: GeneratorAngle::ZERO,
            before: GeneratorAngle::ZERO,
        }
    }

    /// Reading of the encoder, rad at the output.
    pub fn encoder(&self, angle_rad: f64) -> GeneratorAngle {
        let bits = self.settings.encoder_bits;
        let steps = f64::from(1u32 << bits);
        let counts = libm::floor(angle_rad * self.ratio * (steps / TAU) + 0.5) as i64;
        GeneratorAngle::from_counts(counts << (32 - bits))
    }

    /// Reads the encoder where the motor is, rad at the output, at its speed, rad/s: once in each tick, first of all.
    pub fn read(&mut self, angle_rad: f64, rate_rad_s: f64) -> GeneratorAngle {
        let late = self.settings.jitter_s * 0.5 * (1.0 + self.noise.part());
        self.before = self.shown;
        self.shown = self.encoder(angle_rad - late * rate_rad_s);
        self.shown
    }

    /// Motor torque times ratio from its current, N·m at the output, of the tick before.
    pub fn current_n_m(&mut self) -> f64 {
        self.ratio * (self.torque_n_m + self.settings.current_noise_n_m * self.noise.normal())
    }

    /// Torque that the motor gives, N·m at the motor.
    pub fn motor_n_m(&self) -> f64 {
        self.torque_n_m
    }

    /// Speed of the motor over the ratio as the encoder shows it, rad/s.
    pub fn rate_rad_s(&self) -> f64 {
        angle_rad(self.shown.minus_counts(self.before)) / self.settings.tick_s / self.ratio
    }

    /// Whether the motor gives all it has.
    pub fn saturated(&self) -> bool {
        self.next_n_m.abs() >= self.settings.largest_n_m
    }

    /// Asks for a current, from what the encoder showed last; it flows from [`Self::give`] on.
    pub fn control(&mut self, asked: &ServoCommand) {
        let ServoSettings { tick_s, inertia_kg_m2, largest_n_m, position_hz, speed_hz, integral_hz, .. } =
            self.settings;
        // What was asked for before and has not come is late by a tick.
        self.torque_n_m = self.next_n_m;
        if asked.starts != 0.0 {
            // The motor gives what is expected, or what it gave at rest if that is more.
            let more = asked.starts * (self.next_n_m - asked.torque_n_m);
            self.integral_n_m = asked.starts * more.max(0.0);
        }
        let speed = self.rate_rad_s() * self.ratio;
        let wanted = asked.rate_rad_s + TAU * position_hz * angle_rad(asked.command.minus_counts(self.shown));
        let gain = TAU * speed_hz * inertia_kg_m2;
        let torque =
            gain * (wanted - speed) + self.integral_n_m + inertia_kg_m2 * asked.acceleration_rad_s2 + asked.torque_n_m;
        self.next_n_m = torque.clamp(-largest_n_m, largest_n_m);
        if self.next_n_m == torque {
            self.integral_n_m += gain * TAU * integral_hz * tick_s * (wanted - speed);
        }
    }

    /// The current that was asked for flows.
    pub fn give(&mut self) {
        self.torque_n_m = self.next_n_m;
    }
}

/// Counts of an angle as radians.
pub(crate) fn angle_rad(counts: i64) -> f64 {
    counts as f64 * (TAU / 4_294_967_296.0)
}
