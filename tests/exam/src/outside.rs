//! Effects that no cause of the contract explains: naming one is wrong, `unknown` is right.

use serde::{Serialize, Serializer};
use std::f64::consts::TAU;

use crate::chance::Chance;
use crate::effect::{Effect, Range, Spec, What};
use crate::laws::{Law, Mesh, Now, Setting};
use crate::teeth::wrapped;

macro_rules! outside {
    ($($variant:ident $name:literal),* $(,)?) => {
        /// One effect outside the library.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[allow(missing_docs, reason = "the names say it")]
        pub enum Outside { $($variant),* }

        impl Outside {
            /// All.
            pub const ALL: &[Self] = &[$(Self::$variant),*];

            /// In truth files.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),* }
            }
        }
    };
}

outside! {
    OldhamDeadZone "oldham_dead_zone",
    EncoderInterpolation "encoder_interpolation",
    MotorCogging "motor_cogging",
    BearingCage "bearing_cage",
    LogTimeCreep "log_time_creep",
    SensorOffsetWithTemperature "sensor_offset_with_temperature",
    TiltUnderMoment "tilt_under_moment",
    MisalignedShaft "misaligned_shaft",
    BeltStage "belt_stage",
    MainsLine "mains_line",
    RandomTelegraph "random_telegraph",
    SquareWaveInTime "square_wave_in_time",
    RemountedSensor "remounted_sensor",
    VibrationBursts "vibration_bursts",
}

/// Effects that do to the readings what a cause of the contract does, by the name of that cause: a shaft askew before
/// an encoder and the encoder itself askew are one second order. That name is right, any other wrong.
pub const ALSO_CALLED: [(&str, &str); 1] = [("misaligned_shaft", "output_encoder_tilt")];

impl Serialize for Outside {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl Outside {
    /// Amplitude at the output and shape.
    pub fn spec(self) -> Spec {
        use Range::{Linear, Log, Phase, Seed};
        let shape: &[(&str, Range)] = match self {
            Self::OldhamDeadZone => &[],
            Self::EncoderInterpolation => &[("lines", Log(180.0, 2400.0)), ("phase_rad", Phase)],
            Self::MotorCogging => &[("pole_pairs", Linear(4.0, 11.0)), ("phase_rad", Phase)],
            Self::BearingCage => &[("balls", Linear(15.0, 32.0)), ("phase_rad", Phase), ("cage", Linear(0.43, 0.47))],
            Self::LogTimeCreep => &[],
            Self::SensorOffsetWithTemperature => &[],
            Self::TiltUnderMoment => &[("phase_rad", Phase)],
            Self::MisalignedShaft => &[("phase_rad", Phase)],
            Self::BeltStage => &[("phase_rad", Phase)],
            Self::MainsLine => &[("frequency_hz", Linear(49.7, 49.95)), ("phase_rad", Phase)],
            Self::RandomTelegraph => &[("hold_s", Log(4.0, 25.0)), ("profile", Seed)],
            Self::SquareWaveInTime => &[("period_s", Log(5.0, 30.0)), ("phase_rad", Phase)],
            Self::RemountedSensor => &[("profile", Seed)],
            Self::VibrationBursts => &[("frequency_hz", Log(6.0, 22.0)), ("profile", Seed)],
        };
        Spec { size: "amplitude_arcsec", range: (0.5, 60.0), signed: false, shape: shape.to_vec() }
    }

    /// True where a row of the data is too long a step.
    pub fn is_fast(self) -> bool {
        matches!(self, Self::MainsLine | Self::VibrationBursts)
    }
}

/// The law of an effect outside the library.
///
/// # Panics
/// If the effect is a named cause.
pub fn build(effect: &Effect, setting: Setting) -> Box<dyn Law> {
    let What::Outside(kind) = effect.what else { panic!("{effect:?} is a named cause") };
    Box::new(Stranger {
        kind,
        size: effect.size,
        shape: effect.shape.clone(),
        ratio: setting.drive.ratio(),
        rated_n_m: setting.drive.rated_n_m,
        held: None,
        states: [0.0; 6],
        begun: false,
        chance: Chance::new(effect.shape.last().map_or(0, |seed| *seed as u64), "outside", 0),
        until_s: f64::NEG_INFINITY,
    })
}

struct Stranger {
    kind: Outside,
    size: f64,
    shape: Vec<f64>,
    ratio: f64,
    rated_n_m: f64,
    /// Angle of the driven half of a coupling.
    held: Option<f64>,
    states: [f64; 6],
    begun: bool,
    chance: Chance,
    until_s: f64,
}

/// Relaxation times of the creep, evenly in the logarithm: their sum grows as log time (s).
const CREEP_S: [f64; 6] = [0.7, 2.2, 7.0, 22.0, 70.0, 220.0];

impl Law for Stranger {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        match self.kind {
            // The generator is driven through a slot: its angle lags by half the lash each way (5 to 18", Harmonic
            // Drive HFUS-2A manual, table 24.5).
            Outside::OldhamDeadZone => {
                let lash = self.size * self.ratio.abs() / crate::ARCSEC;
                let angle = now.generator_rad;
                let held = self.held.get_or_insert(angle);
                *held = held.clamp(angle - lash, angle + lash);
                mesh.driven += (*held - angle) / self.ratio * crate::ARCSEC;
            }
            Outside::BeltStage => mesh.driven += self.size * (2.25 * now.generator_rad + self.shape[0]).sin(),
            Outside::MotorCogging => {
                let order = 6.0 * self.shape[0].floor();
                mesh.driven += self.size * (order * now.generator_rad + self.shape[1]).sin();
            }
            Outside::LogTimeCreep => {
                let since = now.gap_s.unwrap_or(now.step_s);
                let load = now.load_n_m / self.rated_n_m;
                for (state, lasts) in self.states.iter_mut().zip(CREEP_S) {
                    if !self.begun {
                        *state = load;
                    }
                    *state += (load - *state) * (1.0 - (-since / lasts).exp());
                }
                self.begun = true;
                mesh.wind_up += self.size * (self.states.iter().sum::<f64>() / 6.0 - load);
            }
            Outside::TiltUnderMoment => {
                mesh.driven += self.size * now.load_n_m / self.rated_n_m * (3.0 * now.output_rad + self.shape[0]).sin();
            }
            _ => {}
        }
    }

    fn reading(&mut self, now: &Now, _: f64) -> f64 {
        match self.kind {
            Outside::EncoderInterpolation => {
                let x = self.shape[0].round() * now.output_rad + self.shape[1];
                self.size * (x.cos() + 0.3 * (2.0 * x).sin())
            }
            // Balls of the output bearing pass with the cage, which slips a little.
            Outside::BearingCage => {
                let order = self.shape[0].floor() * self.shape[2];
                self.size * (order * now.output_rad * (1.0 + 0.004 * now.elapsed) + self.shape[1]).sin()
            }
            Outside::SensorOffsetWithTemperature => self.size * (now.temperature_c - 20.0) / 40.0,
            // A third body behind a universal joint: second order of the output.
            Outside::MisalignedShaft => self.size * (2.0 * now.output_rad + self.shape[0]).sin(),
            Outside::MainsLine => self.size * (TAU * self.shape[0] * now.time_s + self.shape[1]).sin(),
            Outside::RandomTelegraph => {
                if now.time_s >= self.until_s {
                    self.until_s = now.time_s - self.shape[0] * self.chance.uniform(1e-6, 1.0).ln();
                    self.states[0] = if self.states[0] > 0.0 { -1.0 } else { 1.0 };
                }
                self.size * self.states[0]
            }
            Outside::SquareWaveInTime => self.size * wrapped(TAU * now.time_s / self.shape[0] + self.shape[1]).signum(),
            Outside::RemountedSensor => {
                if now.gap_s.is_some() {
                    self.states[0] = self.chance.normal();
                }
                self.size * self.states[0]
            }
            Outside::VibrationBursts => {
                if now.time_s >= self.until_s {
                    self.states[0] = now.time_s;
                    self.until_s = now.time_s + self.chance.uniform(3.0, 12.0);
                    self.states[1] = self.chance.phase();
                }
                let since = now.time_s - self.states[0];
                self.size * 2.0 * (-since / 1.2).exp() * (TAU * self.shape[0] * since + self.states[1]).sin()
            }
            _ => 0.0,
        }
    }
}
