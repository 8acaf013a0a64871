//! Task of a joint, its parts, and the knowledge of them.

use core::f64::consts::TAU;

use super::legs::Walk;
pub use super::legs::{Leg, Moment};
use super::noise::NoiseSource;
use super::servo::ServoSettings;

/// Torques on the load from outside, N·m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Constant part, N·m.
    pub bias_n_m: f64,
    /// A slow swing: amplitude, and Hz.
    pub swing: [f64; 2],
    /// Gusts: rms, and the corner of their spectrum (first order), Hz.
    pub gust: [f64; 2],
    /// Steps up and down, as a wheel over stones: size, and period in s.
    pub step: [f64; 2],
    /// Weight times arm, and the output angle where it pulls forward most, rad.
    pub gravity: [f64; 2],
}

/// From what the torque is known in flight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TorqueKnown {
    /// On the load, from a model or a sensor there: with noise.
    #[default]
    OnLoad,
    /// In the mesh, from a sensor between drive and load: with noise.
    InMesh,
    /// From the motor's current, through a model of the friction.
    Current,
    /// Not at all: the mean of the load.
    Not,
}

impl TorqueKnown {
    /// All of them in order, by their names in files and results.
    pub const NAMES: [(&'static str, TorqueKnown); 4] = [
        ("on_load", TorqueKnown::OnLoad),
        ("in_mesh", TorqueKnown::InMesh),
        ("current", TorqueKnown::Current),
        ("none", TorqueKnown::Not),
    ];
}

/// Knowledge of the unit in the table of the joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TableKnown {
    /// The drive as designed.
    #[default]
    Nominal,
    /// The drive as designed, and the lines of the unit as a diagnosis finds them: 5 % too small (guess).
    Extended,
    /// The unit, sampled at rest with noise.
    Calibrated,
}

impl TableKnown {
    /// All of them, by their names in files and results.
    pub const NAMES: [(&'static str, TableKnown); 3] =
        [("nominal", TableKnown::Nominal), ("extended", TableKnown::Extended), ("calibrated", TableKnown::Calibrated)];
}

/// Everything.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scenario {
    /// Its name.
    pub name: String,
    /// Its legs.
    pub legs: Vec<Leg>,
    /// Acceleration between legs, rad/s².
    pub acceleration_rad_s2: f64,
    /// Torque on the load.
    pub load: Load,
    /// Inertia of the load, kg·m².
    pub load_kg_m2: f64,
    /// Coulomb drag of the output, N·m.
    pub drag_n_m: f64,
    /// Part of critical damping of the twist, at the stiffness under the largest load (guess: 0.02).
    pub damping: f64,
    /// Temperature of the drive at the beginning, °C.
    pub temperature_c: f64,
    /// Warming of its lubricant, K/s: the friction on the motor's side goes with it.
    pub warming_k_s: f64,
    /// The servo.
    pub servo: ServoSettings,
    /// Times the friction of eRob80 that there is on the motor's side; 0 for none.
    pub friction: f64,
    /// Share of the friction on the motor's side fed forward to the servo, by the sign of the target's rate.
    pub friction_known: f64,
    /// Share of a torque known on the load fed forward to the servo: what weight and wind will ask of the motor.
    /// No other torque is fed forward, as that would close a loop.
    pub load_fed_forward: f64,
    /// From what the torque is known.
    pub torque: TorqueKnown,
    /// Noise of the torque, N·m rms.
    pub torque_noise_n_m: f64,
    /// Knowledge of the table.
    pub table: TableKnown,
    /// Start of the numbers that look random.
    pub seed: u32,
}

/// Slowest low-pass of a torque known on the load, Hz (guess).
const LEAST_HZ: f64 = 1.0;

impl Scenario {
    /// A joint of the size of HHD-95 at room temperature whose load and unit are known, without legs and load.
    pub fn usual(name: &str) -> Scenario {
        Scenario {
            name: name.to_owned(),
            acceleration_rad_s2: 0.05,
            load_kg_m2: 3.0,
            drag_n_m: 0.5,
            damping: 0.02,
            temperature_c: 20.0,
            servo: ServoSettings::HHD_95,
            friction: 1.0,
            friction_known: 0.8,
            load_fed_forward: 1.0,
            torque: TorqueKnown::OnLoad,
            torque_noise_n_m: 0.05,
            table: TableKnown::Calibrated,
            seed: 1,
            ..Scenario::default()
        }
    }

    /// Time of the whole flight, s.
    pub fn seconds(&self) -> f64 {
        self.legs.iter().map(|leg| leg.seconds).sum()
    }

    /// Temperature of the drive at a time, °C.
    pub fn temperature_at_c(&self, time_s: f64) -> f64 {
        self.temperature_c + self.warming_k_s * time_s
    }

    /// Largest torque on the load that is to be expected, N·m.
    pub fn largest_n_m(&self) -> f64 {
        let Load { bias_n_m, swing, gust, step, gravity } = self.load;
        bias_n_m.abs()
            + swing[0].abs()
            + 4.0 * gust[0]
            + step[0].abs()
            + gravity[0].abs()
            + self.load_kg_m2 * self.acceleration_rad_s2
    }

    /// Corner of the low-pass with which a torque known on the load is best fed forward, Hz: between what is late
    /// behind it and the noise that passes it.
    ///
    /// Gusts, and steps for which chance is taken, wander: their mean square change in a tick against the noise gives
    /// the gain of a stationary Kalman filter (R. E. Kalman, "A new approach to linear filtering and prediction
    /// problems", J. Basic Eng. 82, 1960). What swings changes evenly: there the corner is where the lag is as large as
    /// the noise. 1 Hz at least, as weather changes, and `widest_hz` at most.
    pub fn best_low_pass_hz(&self, widest_hz: f64) -> f64 {
        let Load { swing, gust, step, gravity, .. } = self.load;
        let tick_s = self.servo.tick_s;
        let noise = self.torque_noise_n_m;
        if noise == 0.0 {
            return widest_hz;
        }
        let blown = 2.0 * gust[0] * gust[0] * (1.0 - libm::exp(-TAU * gust[1] * tick_s));
        // Up by twice the step, and down again, in each period.
        let stepped = if step[1] > 0.0 { 8.0 * step[0] * step[0] * tick_s / step[1] } else { 0.0 };
        let wander = (blown + stepped) / (noise * noise);
        // Of gain²/(1 − gain) = wander; and what a low-pass of that gain turns in a tick.
        let gain = 0.5 * ((wander * (wander + 4.0)).sqrt() - wander);
        let wandering_hz = gain / (1.0 - gain).max(1e-9) / (TAU * tick_s);
        let fastest = self.legs.iter().map(|leg| leg.rate_rad_s.abs()).fold(0.0, f64::max);
        let slope = (TAU * swing[1] * swing[0].abs()).max(fastest * gravity[0].abs());
        // Lag slope/(2π f), noise √(π f tick).
        let swinging_hz = libm::cbrt((slope / (TAU * noise)).powi(2) / (0.5 * TAU * tick_s));
        wandering_hz.max(swinging_hz).clamp(LEAST_HZ.min(widest_hz), widest_hz)
    }

    /// How fast a torque on the load wanders that nobody knows, N²·m²/s, and its variance about the mean at most,
    /// N²·m².
    pub(crate) fn load_wanders(&self) -> (f64, f64) {
        let Load { swing, gust, step, gravity, .. } = self.load;
        let square = |value: f64| value * value;
        let stepped = if step[1] > 0.0 { 8.0 * square(step[0]) / step[1] } else { 0.0 };
        let rate = 2.0 * square(gust[0]) * TAU * gust[1] + square(swing[0]) * TAU * swing[1] + stepped;
        // A swing spends most of its time at its ends, and steps all.
        (rate, square(gust[0]) + square(swing[0]) + square(step[0]) + square(gravity[0]))
    }

    /// Mean of the torque on the load as far as it is known before, N·m.
    pub fn mean_n_m(&self) -> f64 {
        self.load.bias_n_m
    }

    /// Target at every tick.
    pub fn moments(&self) -> Moments<'_> {
        Moments {
            scenario: self,
            noise: NoiseSource::new(self.seed ^ 0x5bd1),
            gust: 0.0,
            walk: Walk::default(),
            outside_n_m: self.load.bias_n_m,
        }
    }
}

/// The moments of a flight, in order.
#[derive(Clone, Debug)]
pub struct Moments<'s> {
    scenario: &'s Scenario,
    noise: NoiseSource,
    gust: f64,
    walk: Walk,
    outside_n_m: f64,
}

impl Moments<'_> {
    /// Torque from outside at the end of the tick.
    fn outside(&mut self) -> f64 {
        let Load { bias_n_m, swing, gust, step, .. } = self.scenario.load;
        let tick_s = self.scenario.servo.tick_s;
        let time_s = f64::from(self.walk.tick) * tick_s;
        let share = 1.0 - libm::exp(-TAU * gust[1] * tick_s);
        // The noise behind the low-pass has the rms asked for.
        let drive = gust[0] * ((2.0 - share) / share).sqrt() * self.noise.normal();
        self.gust += if gust[0] > 0.0 { share * (drive - self.gust) } else { 0.0 };
        let stepped = if step[1] > 0.0 {
            // Up and down within a hundredth of the period.
            let at = libm::sin(TAU * time_s / step[1]) * (100.0 / TAU);
            step[0] * at.clamp(-1.0, 1.0)
        } else {
            0.0
        };
        bias_n_m + swing[0] * libm::sin(TAU * swing[1] * time_s) + self.gust + stepped
    }
}

impl Iterator for Moments<'_> {
    type Item = Moment;

    fn next(&mut self) -> Option<Moment> {
        let Scenario { legs, acceleration_rad_s2, servo, .. } = self.scenario;
        let moment = self.walk.next(legs, *acceleration_rad_s2, servo.tick_s)?;
        let before = self.outside_n_m;
        self.outside_n_m = self.outside();
        Some(Moment { outside_n_m: [before, self.outside_n_m], ..moment })
    }
}
