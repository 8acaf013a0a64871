//! The loops that close over a joint, in the frequency domain: the servo's own, and that of a torque fed back through
//! the compensation.
//!
//! With motor `J_m`, load `J_l`, stiffness `K`, damping `c` of the twist, all at the output, and `P` from motor torque
//! to motor angle:
//! ```text
//! P   = (J_l s² + c s + K) / (s²·(J_m J_l s² + (J_m + J_l)(c s + K)))
//! L_s = P·C                                     the servo, closed on −1
//! H   = P·C_r/(1 + P·C)                         command to motor angle
//! L   = g·LP·H·J_l s²·(1 + c s/K)/(J_l s² + c s + K)   mesh torque through the compensation, closed on +1
//! ```
//! The mesh carries what the load's inertia asks for, the compensation turns the motor by torque/K to make up for the
//! wind-up, and that asks the inertia for more: above `√(K/J_l)` the mesh torque is in phase with the motor's own
//! swing. Whatever comes from a torque *on* the load instead (wind, gravity, a model) has no such loop.

use core::f64::consts::{PI, TAU};

use num_complex::Complex64;

use super::servo::ServoSettings;

const ONE: Complex64 = Complex64::new(1.0, 0.0);

// By libm, which gives the same bits on every machine.
fn size(z: Complex64) -> f64 {
    libm::hypot(z.re, z.im)
}

fn angle(z: Complex64) -> f64 {
    libm::atan2(z.im, z.re)
}

/// `exp(−j·x)`.
fn late(x: f64) -> Complex64 {
    let (s, c) = libm::sincos(x);
    Complex64::new(c, -s)
}

/// Motor, load and what is between, at the output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoMasses {
    /// Motor and generator times the square of the ratio, kg·m².
    pub motor_kg_m2: f64,
    /// Load, kg·m².
    pub load_kg_m2: f64,
    /// Stiffness, N·m/rad.
    pub stiffness: f64,
    /// Damping over stiffness, s.
    pub damping_s: f64,
    /// Generator over output.
    pub ratio: f64,
}

/// How a torque gets into the command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopTorquePath {
    /// Share of the wind-up that is compensated; more than 1 where the table is softer than the drive.
    pub gain: f64,
    /// Corner of the low-pass of first order, Hz.
    pub bandwidth_hz: f64,
    /// Time from the torque to the command, s: sensor and bus.
    pub late_s: f64,
    /// Whether the rate of the corrected command is fed forward to the speed loop.
    pub rate_fed_forward: bool,
}

/// How far a loop is from its limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margin {
    /// Whether it is stable.
    pub stable: bool,
    /// Least distance of the loop from the point that it must not go round.
    pub distance: f64,
    /// Frequency there, Hz.
    pub at_hz: f64,
}

/// An open loop at a frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenLoop {
    /// Frequency, Hz.
    pub hz: f64,
    /// Real part.
    pub real: f64,
    /// Imaginary part.
    pub imaginary: f64,
}

impl OpenLoop {
    /// Its size: 1 at a crossover.
    pub fn size(&self) -> f64 {
        libm::hypot(self.real, self.imaginary)
    }

    /// Its phase, degrees, from −360 to 0: −180 with a size of 1 is the point that it must not go round.
    pub fn phase_deg(&self) -> f64 {
        let degrees = libm::atan2(self.imaginary, self.real) * 360.0 / TAU;
        if degrees > 0.0 { degrees - 360.0 } else { degrees }
    }
}

/// Frequencies looked at: from, and how many in a factor of ten.
const FROM_HZ: f64 = 0.01;
const IN_TEN: f64 = 1000.0;

impl TwoMasses {
    /// Resonance with the motor held, Hz: where the mesh torque goes from against to with the motor's swing.
    pub(crate) fn locked_hz(&self) -> f64 {
        (self.stiffness / self.load_kg_m2).sqrt() / TAU
    }

    /// Resonance with the motor free, Hz.
    pub fn free_hz(&self) -> f64 {
        (self.stiffness * (1.0 / self.load_kg_m2 + 1.0 / self.motor_kg_m2)).sqrt() / TAU
    }

    /// Motor torque to motor angle.
    fn plant(&self, w: f64) -> Complex64 {
        let TwoMasses { motor_kg_m2: motor, load_kg_m2: load, stiffness, damping_s, .. } = *self;
        let spring = Complex64::new(stiffness, stiffness * damping_s * w);
        let above = spring + Complex64::new(-load * w * w, 0.0);
        let below = (spring * (motor + load) + Complex64::new(-motor * load * w * w, 0.0)) * (-w * w);
        above / below
    }

    /// Motor angle to the torque that the compensation turns into angle again, over the stiffness.
    fn carried(&self, w: f64) -> Complex64 {
        let TwoMasses { load_kg_m2: load, stiffness, damping_s, .. } = *self;
        let spring = Complex64::new(stiffness, stiffness * damping_s * w);
        let inertia = Complex64::new(-load * w * w, 0.0);
        inertia * spring * (1.0 / stiffness) / (spring + inertia)
    }

    /// Margin of the servo.
    pub fn servo(&self, servo: &ServoSettings) -> Margin {
        let l = |w: f64| self.plant(w) * control(servo, self.ratio, w, true).0;
        // L is infinite at zero: looked at from where it is large. Two integrals and more bring the phase there.
        let distance = |w: f64| ONE + l(w);
        margin(servo, distance)
    }

    /// The open loop of the servo over frequency.
    pub fn servo_loop(&self, servo: &ServoSettings) -> impl Iterator<Item = OpenLoop> + use<> {
        let (joint, servo) = (*self, *servo);
        frequencies(&servo).map(move |hz| {
            let open = joint.plant(TAU * hz) * control(&servo, joint.ratio, TAU * hz, true).0;
            OpenLoop { hz, real: open.re, imaginary: open.im }
        })
    }

    /// Phase margin of the servo, degrees, and where, Hz: the least at all crossings.
    pub fn phase_margin_deg(&self, servo: &ServoSettings) -> [f64; 2] {
        let mut least = [f64::INFINITY, 0.0];
        let mut before = f64::INFINITY;
        for f in frequencies(servo) {
            let l = self.plant(TAU * f) * control(servo, self.ratio, TAU * f, true).0;
            if (before - 1.0) * (size(l) - 1.0) <= 0.0 {
                let angle = (angle(l) - PI).rem_euclid(TAU);
                let found = angle.min(TAU - angle) * 360.0 / TAU;
                if found < least[0] {
                    least = [found, f];
                }
            }
            before = size(l);
        }
        least
    }

    /// Command to motor angle.
    fn follows(&self, servo: &ServoSettings, rate_fed_forward: bool, w: f64) -> Complex64 {
        let (back, command) = control(servo, self.ratio, w, rate_fed_forward);
        let plant = self.plant(w);
        plant * command / (ONE + plant * back)
    }

    /// The loop of the mesh torque through the compensation, at an angular frequency.
    fn returned(&self, servo: &ServoSettings, path: &LoopTorquePath, w: f64) -> Complex64 {
        let low_pass = ONE / Complex64::new(1.0, w / (TAU * path.bandwidth_hz));
        let h = self.follows(servo, path.rate_fed_forward, w);
        let late = late(w * (path.late_s + servo.tick_s));
        low_pass * h * late * self.carried(w) * path.gain
    }

    /// Margin of the mesh torque's loop: its distance from +1, around a servo that is stable itself.
    pub fn torque_loop(&self, servo: &ServoSettings, path: &LoopTorquePath) -> Margin {
        margin(servo, |w| ONE - self.returned(servo, path, w))
    }

    /// The widest low-pass (Hz) with which the mesh torque's loop is stable at this distance from +1, up to the most
    /// that is asked for, with a drive that is stiffer or softer by a part; that of a table which does not know it.
    ///
    /// `None` if there is none: then the servo by itself is about to ring, and only a torque on the load may be
    /// compensated. Found by halving: a wider low-pass only ever brings the loop's resonance, which is its nearest
    /// point, closer.
    pub fn widest_hz(
        &self,
        servo: &ServoSettings,
        path: &LoopTorquePath,
        [distance, unknown]: [f64; 2],
        most_hz: f64,
    ) -> Option<f64> {
        let keeps = |bandwidth_hz: f64| {
            [1.0 - unknown, 1.0, 1.0 + unknown].iter().all(|wrong| {
                let unit = TwoMasses { stiffness: self.stiffness * wrong, ..*self };
                let margin =
                    unit.torque_loop(servo, &LoopTorquePath { bandwidth_hz, gain: path.gain * wrong, ..*path });
                margin.stable && margin.distance >= distance
            })
        };
        if keeps(most_hz) {
            return Some(most_hz);
        }
        if !keeps(FROM_HZ) {
            return None;
        }
        let (mut low, mut high) = (FROM_HZ, most_hz);
        for _ in 0..12 {
            let middle = (low * high).sqrt();
            if keeps(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(low)
    }
}

/// The controller, motor angle to torque at the output and command to it, with sampling, holding and lateness.
fn control(servo: &ServoSettings, ratio: f64, w: f64, rate_fed_forward: bool) -> (Complex64, Complex64) {
    let ServoSettings { tick_s, steps, late_steps, inertia_kg_m2, position_hz, speed_hz, integral_hz, .. } = *servo;
    let s = Complex64::new(0.0, w);
    let gain = TAU * speed_hz * inertia_kg_m2 * ratio * ratio;
    // Held over a tick.
    let half = 0.5 * w * tick_s;
    let held = late(half) * (if half == 0.0 { 1.0 } else { libm::sin(half) / half });
    let late = late(w * tick_s * late_steps as f64 / steps as f64);
    let differences = held * s;
    let integral = ONE + Complex64::new(TAU * integral_hz, 0.0) / s;
    let drive = held * late * integral * gain;
    let position = Complex64::new(TAU * position_hz, 0.0);
    let forward = if rate_fed_forward { position + differences } else { position };
    (drive * (position + differences), drive * forward)
}

fn frequencies(servo: &ServoSettings) -> impl Iterator<Item = f64> + use<> {
    let most = 0.5 / servo.tick_s;
    let count = (libm::log10(most / FROM_HZ) * IN_TEN) as usize;
    (0..=count).map(move |k| FROM_HZ * libm::pow(10.0, k as f64 / IN_TEN))
}

/// Least size of a return difference, and whether it turns around zero: by how much its phase has turned from low
/// frequencies to half of the sampling frequency, where it must be back to what its ends are.
fn margin(servo: &ServoSettings, difference: impl Fn(f64) -> Complex64) -> Margin {
    let (mut least, mut at_hz) = (f64::INFINITY, 0.0);
    let mut turned = 0.0;
    let mut before: Option<Complex64> = None;
    let mut first = ONE;
    for f in frequencies(servo) {
        let now = difference(TAU * f);
        match before {
            Some(before) => turned += angle(now / before),
            None => first = now,
        }
        before = Some(now);
        if size(now) < least {
            (least, at_hz) = (size(now), f);
        }
    }
    // Integrals in the loop begin with their own phase: what it turns by, if it goes round nothing, is from there to
    // the end.
    let last = before.unwrap_or(ONE);
    let begins = if size(first) > 100.0 { -1.5 * PI } else { angle(first) };
    let stable = (turned - (angle(last) - begins)).abs() < PI;
    Margin { stable, distance: least, at_hz }
}
