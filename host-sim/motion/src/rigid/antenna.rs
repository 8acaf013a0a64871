//! An antenna pointed by every controller at once, each with its own motor and drive, under one sky.

use core::fmt;

use flexspline::{Drive, Flags, Measured, Mode, Overrun, Predictor, PredictorState, RateGroup, Table};

use super::controllers::{ByCore, BySign, ByTorque, Uncompensated, Wanted};
use super::profile::{ProfileMoment, TICK_S};
use super::score::Scores;
use super::{JointSensors, Lane, RigidPlant, ahead};
use crate::noise::Noise;

/// Controllers, in the order of the results.
pub const CONTROLLERS: [&str; 5] =
    ["uncompensated", "sign of velocity", "the same, mean load", "torque and sign", "core"];
/// The core among them.
pub const CORE: usize = 4;

/// The target is given this much early, because the command takes about so long to be carried out, s.
pub const LEAD_S: f64 = 0.0;
/// Time at the beginning that is not scored, s: all start where they are, the core off and without knowing its play.
pub const START_UP_S: f64 = 0.25;
/// Ticks for which the core stays off.
const OFF_TICKS: u32 = 20;
/// What the limiter holds back less than this is not worth mentioning, rad: 0.1″.
pub const HELD_BACK_RAD: f32 = 5e-7;

/// Flags of the core, in the order in which they are counted.
pub const FLAGS: [(&str, Flags); 7] = [
    ("sample lost", Flags::SAMPLE_LOST),
    ("glitch", Flags::GLITCH),
    ("overrun", Flags::OVERRUN),
    ("held back", Flags::HELD_BACK),
    ("not corrected", Flags::NOT_CORRECTED),
    ("table doubt", Flags::TABLE_DOUBT),
    ("state torn", Flags::STATE_TORN),
];

/// What runs slower than the tick: thermometer, and the check of the images between.
#[derive(Clone, Copy, Debug)]
pub struct SlowGroups {
    /// The thermometer is read.
    pub thermometer: RateGroup,
    /// A slice of the images is checked.
    pub images: RateGroup,
}

impl SlowGroups {
    /// Every 100th and every 20th tick, for joint `number` of at most 20 in ticks of its own.
    pub const fn staggered(number: u32) -> Option<Self> {
        match (RateGroup::new(100, 5 * number), RateGroup::new(20, number)) {
            (Some(thermometer), Some(images)) => Some(Self { thermometer, images }),
            _ => None,
        }
    }
}

/// An antenna in flight.
pub struct Antenna<'a, P> {
    lanes: [Lane<P>; 5],
    uncompensated: Uncompensated,
    by_sign: [BySign; 2],
    by_torque: ByTorque<'a>,
    /// The core.
    pub core: ByCore<'a>,
    groups: SlowGroups,
    sensors: JointSensors,
    noise: Noise,
    ratio: f64,
    tick: u32,
    scores: [Scores; 5],
    flags: [u32; FLAGS.len()],
    digest: u64,
}

/// One tick of all.
#[derive(Clone, Copy, Debug)]
pub struct Pointing {
    /// Output less target, rad.
    pub errors_rad: [f64; 5],
    /// Whether the core's limiter holds its correction back.
    pub held_back: bool,
}

impl<'a, P: RigidPlant> Antenna<'a, P> {
    /// At rest with a table and a plant for each controller; `None` if the table cannot be flown. `mean_torque_n_m` is
    /// the mean of the load to come.
    pub fn new(
        images: [&'a [u8]; 2],
        plants: [P; 5],
        largest_n_m: f64,
        mean_torque_n_m: f64,
        first_c: f64,
    ) -> Option<Self> {
        let [image, _] = images;
        let table = Table::check(image).ok()?;
        let drive: Drive = *table.drive();
        let sensors = JointSensors::for_range(largest_n_m);
        let overrun = Overrun::FadeOut { ticks: 50 };
        let sign = |torque: f64| BySign::new(&table, torque as f32, 20.0);
        Some(Self {
            lanes: plants.map(Lane::new),
            uncompensated: Uncompensated::new(drive),
            by_sign: [sign(0.0)?, sign(mean_torque_n_m)?],
            by_torque: ByTorque::new(table),
            core: ByCore::new(images, drive, sensors.temperature(first_c), overrun).ok()?,
            groups: SlowGroups::staggered(0)?,
            sensors,
            noise: Noise::new(5),
            ratio: drive.exact_ratio(),
            tick: 0,
            scores: [Scores::default(); 5],
            flags: [0; FLAGS.len()],
            digest: 0xcbf2_9ce4_8422_2325,
        })
    }

    /// One tick: where all outputs are now, and on to the next.
    pub fn tick(&mut self, now: &ProfileMoment) -> Pointing {
        let errors_rad: [f64; 5] = core::array::from_fn(|k| self.lanes[k].output_rad() - now.target_rad);
        if self.tick == OFF_TICKS {
            self.core.request(Mode::Tracking);
        }
        let (target, noise) = (ahead(now, LEAD_S), self.noise.part());
        for (k, lane) in self.lanes.iter_mut().enumerate() {
            let told = Wanted {
                generator: Some(lane.encoder()),
                target,
                rate_rad_s: now.rate_rad_s,
                torque_n_m: self.sensors.torque(noise, now.torque_n_m),
                missed_ticks: 0,
            };
            let command = match k {
                0 => self.uncompensated.tick(&told),
                1 | 2 => self.by_sign[k - 1].tick(&told),
                3 => self.by_torque.tick(&told),
                _ => self.core.tick(&told),
            };
            lane.go(command, told.torque_n_m, now.torque_n_m, self.ratio);
        }
        if self.groups.thermometer.is_due(self.tick) {
            let shown = self.sensors.temperature(now.temperature_c);
            self.core.set_temperature(shown);
            self.by_torque.set_temperature(shown);
            for lane in &mut self.lanes {
                lane.plant.set_temperature(now.temperature_c);
            }
        }
        if self.groups.images.is_due(self.tick) {
            self.core.check_images();
        }
        let held_back = self.core.held_back(HELD_BACK_RAD);
        self.count(now, &errors_rad, held_back);
        self.tick += 1;
        Pointing { errors_rad, held_back }
    }

    fn count(&mut self, now: &ProfileMoment, errors_rad: &[f64; 5], held_back: bool) {
        for (count, (_, flag)) in self.flags.iter_mut().zip(FLAGS) {
            *count += u32::from(self.core.out.is_some_and(|out| out.flags.contains(flag)));
        }
        for (scores, error) in self.scores.iter_mut().zip(errors_rad) {
            self.digest = (self.digest ^ error.to_bits()).wrapping_mul(0x0100_0000_01b3);
            if f64::from(self.tick) * TICK_S >= START_UP_S {
                scores.add(*error, now.steady, held_back);
            }
        }
    }

    /// What the output of a controller's drive does, and its motor.
    pub fn lane(&self, controller: usize) -> &Lane<P> {
        &self.lanes[controller]
    }

    /// Errors so far, by controller.
    pub fn scores(&self) -> &[Scores; 5] {
        &self.scores
    }

    /// How often each of [`FLAGS`] was set.
    pub fn flags(&self) -> &[u32; FLAGS.len()] {
        &self.flags
    }

    /// Results in lines, the same on every machine: for each controller rms and largest error in arcsec over all, over
    /// steady tracking, and both without the ticks in which the core was held back; counts; a digest of every bit of
    /// every error.
    ///
    /// # Errors
    /// Those of `to`.
    pub fn write(&self, name: &str, to: &mut dyn fmt::Write) -> fmt::Result {
        for (controller, scores) in CONTROLLERS.iter().zip(&self.scores) {
            write!(to, "{name:11} {controller:20}")?;
            for score in [scores.whole, scores.steady, scores.free, scores.steady_free] {
                write!(to, " {:9.3} {:9.3}", score.rms_arcsec(), score.max_arcsec())?;
            }
            writeln!(to)?;
        }
        write!(to, "{name:11} ticks {}, missed {}", self.tick, self.core.state.missed_ticks())?;
        for (count, (flag, _)) in self.flags.iter().zip(FLAGS) {
            write!(to, ", {flag} {count}")?;
        }
        writeln!(to, ", digest {:016x}", self.digest)
    }
}

/// The observer of a joint, fed with what its motor does.
pub struct Observer {
    predictor: Predictor,
    /// What it estimates.
    pub state: PredictorState,
}

impl Observer {
    /// From a predictor.
    pub fn new(predictor: Predictor) -> Self {
        Self { predictor, state: PredictorState::default() }
    }

    /// One tick: the motor's torque and speed, carried to the output.
    pub fn tick<P>(&mut self, lane: &Lane<P>, ratio: f64) {
        let measured = Measured {
            torque_n_m: (lane.motor.torque_n_m() * ratio) as f32,
            speed_rad_s: (lane.motor.rate_rad_s() / ratio) as f32,
            twist_rad: 0.0,
        };
        self.predictor.step(&mut self.state, &measured);
    }

    /// The predictor.
    pub fn predictor(&self) -> &Predictor {
        &self.predictor
    }
}

/// What the columns of [`Antenna::write`] are.
pub const COLUMNS: &str = "generator   controller           whole rms\"     max\"  steady rms\"    max\"   not held \
                           rms\"  max\" steady rms\"    max\"";
