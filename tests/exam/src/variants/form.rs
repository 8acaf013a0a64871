//! Parts of forms: numbers that are drawn and written down, profiles around a wheel, ways of warmth.

use std::f64::consts::TAU;

use crate::ARCSEC;
use crate::chance::Chance;
use crate::drive::Drive;
use crate::hides::Hides;
use crate::profile::Profile;
use crate::train::{Adds, Memory, Now};

/// Adds to what is read and to where the teeth stand: size, instant, memory.
pub type Add = Box<dyn Fn(f64, &Now, &mut Memory, &mut Adds)>;
/// Arcsec beyond the wind-up of the unit: size, wind-up of the unit, load over the rated torque, instant, memory.
pub type WindUp = Box<dyn Fn(f64, f64, f64, &Now, &mut Memory) -> f64>;

/// One physical form of a cause with its numbers.
pub struct Form {
    /// At each instant, before the teeth are placed.
    pub add: Add,
    pub wind_up: WindUp,
    pub numbers: Vec<(&'static str, f64)>,
}

impl Form {
    /// Of a cause that the spring does not know.
    pub fn adds(add: impl Fn(f64, &Now, &mut Memory, &mut Adds) + 'static) -> Self {
        Self { add: Box::new(add), wind_up: Box::new(|_, _, _, _, _| 0.0), numbers: Vec::new() }
    }

    /// Of the spring alone.
    pub fn winds(wind_up: impl Fn(f64, f64, f64, &Now, &mut Memory) -> f64 + 'static) -> Self {
        Self { add: Box::new(|_, _, _, _| ()), wind_up: Box::new(wind_up), numbers: Vec::new() }
    }
}

/// Drive and run of a form.
#[derive(Debug, Clone, Copy)]
pub struct Setting {
    /// Generator turns per output turn, signed.
    pub ratio: f64,
    /// Teeth that the generator passes in a turn.
    pub mesh_order: f64,
    /// A tooth at the output.
    pub pitch_arcsec: f64,
    pub rated_arcsec: f64,
    /// Path of the generator in all sessions.
    pub way_rad: f64,
}

impl Setting {
    pub fn of(drive: &Drive, way_rad: f64) -> Self {
        Self {
            ratio: drive.ratio(),
            mesh_order: drive.mesh_order(),
            pitch_arcsec: TAU / drive.output_teeth() * ARCSEC,
            rated_arcsec: drive.wind_up_arcsec(drive.rated_n_m),
            way_rad,
        }
    }
}

/// Draws the numbers of a form and writes them down.
pub struct Numbers {
    chance: Chance,
    drawn: Vec<(&'static str, f64)>,
}

impl Numbers {
    /// Those of what is hidden: its shape is their seed.
    pub fn of(one: &Hides) -> Self {
        let chance = Chance::new(one.shape[0].to_bits() ^ one.shape[1].to_bits().rotate_left(17), "variant", 0);
        Self { chance, drawn: Vec::new() }
    }

    fn note(&mut self, name: &'static str, value: f64) -> f64 {
        self.drawn.push((name, value));
        value
    }

    pub fn log(&mut self, name: &'static str, low: f64, high: f64) -> f64 {
        let value = self.chance.log_uniform(low, high);
        self.note(name, value)
    }

    pub fn flat(&mut self, name: &'static str, low: f64, high: f64) -> f64 {
        let value = self.chance.uniform(low, high);
        self.note(name, value)
    }

    pub fn phase(&mut self, name: &'static str) -> f64 {
        let value = self.chance.phase();
        self.note(name, value)
    }

    /// One of two, 0 or 1.
    pub fn side(&mut self, name: &'static str) -> usize {
        let value = self.chance.below(2);
        self.note(name, value as f64);
        value
    }

    /// Draws that are not written down.
    pub fn unwritten<T>(&mut self, draw: impl FnOnce(&mut Self) -> T) -> T {
        let count = self.drawn.len();
        let value = draw(self);
        self.drawn.truncate(count);
        value
    }

    pub fn any_phase(&mut self) -> f64 {
        self.chance.phase()
    }

    pub fn normal(&mut self) -> f64 {
        self.chance.normal()
    }

    pub fn drawn(self) -> Vec<(&'static str, f64)> {
        self.drawn
    }
}

/// A sine with shares of its second and third harmonic, as eccentric parts show it.
pub fn wave(n: &mut Numbers, most: f64) -> Profile {
    let (second, third) = (n.log("second_share", 0.1 * most, most), n.log("third_share", 0.05 * most, 0.6 * most));
    Profile::of(&[(1.0, 1.0, 0.0), (2.0, second, n.any_phase()), (3.0, third, n.any_phase())])
}

/// Falls with the load from 1: half at `half`, the steeper the higher `power`.
pub fn fades(load: f64, half: f64, power: f64) -> f64 {
    1.0 / (1.0 + (load.abs() / half).powf(power))
}

/// Way in which a part follows the temperature of the column.
pub const PATHS: [&str; 5] = ["one_lag", "two_lags", "own_heat", "quicker_heating", "housing"];

/// Temperature (°C) of a part, which holds the first three numbers and the last one of the memory. Called once a step.
pub fn warmth(path: &'static str, n: &mut Numbers) -> impl Fn(&Now, &mut Memory) -> f64 + use<> {
    let quick = n.log("lag_s", 6.0, 90.0);
    let slow = n.log("slow_lag_s", 60.0, 900.0);
    let share = n.flat("slow_share", 0.2, 0.8);
    let rise_k = if path == "own_heat" { n.log("own_heat_k", 1.0, 10.0) } else { 0.0 };
    move |now, memory| {
        // Time of the last step, so moved that nought says: not yet.
        let stamp = now.time_s + 1e6;
        let first = memory[5] == 0.0;
        let step = (stamp - memory[5]).max(0.0);
        memory[5] = stamp;
        if first {
            (memory[0], memory[1], memory[2]) = (now.column_c, now.column_c, 0.0);
            return now.column_c;
        }
        let goes = |lag: f64| 1.0 - (-step / lag).exp();
        let lag = if path == "quicker_heating" && now.column_c < memory[0] { slow } else { quick };
        memory[0] += (now.column_c - memory[0]) * goes(lag);
        memory[1] += (now.column_c - memory[1]) * goes(slow);
        // Losses as speed and load.
        let loss = (now.speed_rad_s.abs() / 15.0) * (0.3 + now.load.abs());
        memory[2] += (rise_k * loss - memory[2]) * goes(slow);
        match path {
            "two_lags" => (1.0 - share) * memory[0] + share * memory[1],
            "own_heat" => memory[0] + memory[2],
            "housing" => memory[1],
            _ => memory[0],
        }
    }
}
