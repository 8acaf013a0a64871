//! An antenna pointed by every controller at once, each with its own motor and drive, under one sky.

use flexspline::{Drive, Mode, Overrun, Table};

use super::controllers::{BySign, ByTorque, Compensated, Told, Uncompensated};
use super::profile::{Moment, TICK_S};
use super::score::Scores;
use super::servo::{SERVO, Servo};
use super::{Lane, Noise, Plant, Sensors, THERMOMETER_TICKS, ahead};

/// Controllers, in the order of the results.
pub const CONTROLLERS: [&str; 5] =
    ["uncompensated", "sign of velocity", "the same at mean load", "torque and sign", "core"];
/// The core among them.
pub const CORE: usize = 4;

/// The target is given this much early, because the command takes about so long to be carried out, s.
pub const LEAD_S: f64 = 0.0;
/// Time at the beginning that is not scored, s: all start where they are, the core without knowing its play.
pub const START_UP_S: f64 = 0.25;
/// What the limiter holds back less than this is not worth mentioning, rad: 0.1″.
pub const HELD_BACK_RAD: f32 = 5e-7;

/// An antenna in flight.
pub struct Antenna<'a, P> {
    lanes: [Lane<P>; 5],
    uncompensated: Uncompensated,
    by_sign: [BySign; 2],
    by_torque: ByTorque<'a>,
    /// The core.
    pub core: Compensated<'a>,
    sensors: Sensors,
    noise: Noise,
    ratio: f64,
    tick: u32,
    scores: [Scores; 5],
}

/// One tick of all.
#[derive(Clone, Copy, Debug)]
pub struct Pointing {
    /// Output less target, rad.
    pub errors_rad: [f64; 5],
    /// Whether the core's limiter holds its correction back.
    pub held_back: bool,
}

impl<'a, P: Plant> Antenna<'a, P> {
    /// At rest with a table and a plant for each controller; `None` if the table cannot be flown. `mean_torque_n_m` is the mean
    /// of the load to come.
    pub fn new(image: &'a [u8], plants: [P; 5], largest_n_m: f64, mean_torque_n_m: f64, first_c: f64) -> Option<Self> {
        let table = Table::check(image).ok()?;
        let drive: Drive = *table.drive();
        let sensors = Sensors::for_range(largest_n_m);
        let mut core =
            Compensated::new(image, drive, sensors.temperature(first_c), Overrun::FadeOut { ticks: 50 }).ok()?;
        core.request(Mode::Tracking);
        let sign = |torque: f64| BySign::new(&table, torque as f32, 20.0);
        Some(Self {
            lanes: plants.map(|plant| Lane::new(plant, Servo::new(SERVO))),
            uncompensated: Uncompensated::new(drive),
            by_sign: [sign(0.0)?, sign(mean_torque_n_m)?],
            by_torque: ByTorque::new(table),
            core,
            sensors,
            noise: Noise::new(5),
            ratio: drive.exact_ratio(),
            tick: 0,
            scores: [Scores::default(); 5],
        })
    }

    /// One tick: where all outputs are now, and on to the next.
    pub fn tick(&mut self, now: &Moment) -> Pointing {
        let errors_rad: [f64; 5] = core::array::from_fn(|k| self.lanes[k].output_rad() - now.target_rad);
        if self.tick.is_multiple_of(THERMOMETER_TICKS) {
            let shown = self.sensors.temperature(now.temperature_c);
            self.core.set_temperature(shown);
            self.by_torque.set_temperature(shown);
            for lane in &mut self.lanes {
                lane.plant.set_temperature(now.temperature_c);
            }
        }
        let (target, noise) = (ahead(now, LEAD_S), self.noise.part());
        for (k, lane) in self.lanes.iter_mut().enumerate() {
            let told = Told {
                generator: Some(lane.encoder()),
                target,
                rate_rad_s: now.rate_rad_s,
                torque_n_m: self.sensors.torque(noise, lane.plant.carried_n_m(now.torque_n_m)),
                missed_ticks: 0,
            };
            let command = match k {
                0 => self.uncompensated.tick(&told),
                1 | 2 => self.by_sign[k - 1].tick(&told),
                3 => self.by_torque.tick(&told),
                _ => self.core.tick(&told),
            };
            lane.go(command, now.torque_n_m, self.ratio);
        }
        let held_back = self.core.held_back(HELD_BACK_RAD);
        if f64::from(self.tick) * TICK_S >= START_UP_S {
            for (scores, error) in self.scores.iter_mut().zip(errors_rad) {
                scores.add(error, now.steady, held_back);
            }
        }
        self.tick += 1;
        Pointing { errors_rad, held_back }
    }

    /// What the output of a controller's drive does, and its motor.
    pub fn lane(&self, controller: usize) -> &Lane<P> {
        &self.lanes[controller]
    }

    /// Errors so far, by controller.
    pub fn scores(&self) -> &[Scores; 5] {
        &self.scores
    }
}
