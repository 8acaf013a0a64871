//! A rover of several joints in one loop: each with its table, motor and drive, in an order that never changes, the
//! slow groups of each in ticks of their own. `host-sim/examples/closed_loop.rs` compiles it for the host as well.

use core::fmt;

use flexspline::{Mode, Overrun, Table};

use crate::flight::antenna::{HELD_BACK_RAD, START_UP_S, SlowGroups};
use crate::flight::controllers::{ByCore, Uncompensated, Wanted};
use crate::flight::profile::ProfileMoment;
use crate::flight::score::Scores;
use crate::flight::{JointSensors, Lane, Noise, RigidPlant, ahead};

/// A joint: the core's motor and drive, and beside it one that turns at the nominal ratio.
pub struct RoverJoint<'a, P> {
    name: &'a str,
    core: ByCore<'a>,
    lane: Lane<P>,
    nominal: Uncompensated,
    nominal_lane: Lane<P>,
    groups: SlowGroups,
    sensors: JointSensors,
    noise: Noise,
    ratio: f64,
    scores: Scores,
    nominal_scores: Scores,
    checks: u32,
    readings: u32,
}

impl<'a, P: RigidPlant + Clone> RoverJoint<'a, P> {
    /// Joint `number` at rest; `None` if its table cannot be flown.
    pub fn new(
        number: u32,
        name: &'a str,
        images: [&'a [u8]; 2],
        plant: P,
        largest_n_m: f64,
        first_c: f64,
    ) -> Option<Self> {
        let [image, _] = images;
        let drive = *Table::check(image).ok()?.drive();
        let sensors = JointSensors::for_range(largest_n_m);
        let mut core = ByCore::new(images, drive, sensors.temperature(first_c), Overrun::SkipAndCount).ok()?;
        core.request(Mode::Tracking);
        let lane = Lane::new(plant);
        Some(Self {
            name,
            core,
            nominal_lane: lane.clone(),
            lane,
            nominal: Uncompensated::new(drive),
            groups: SlowGroups::staggered(number)?,
            sensors,
            noise: Noise::new(number),
            ratio: drive.exact_ratio(),
            scores: Scores::default(),
            nominal_scores: Scores::default(),
            checks: 0,
            readings: 0,
        })
    }

    /// One tick.
    pub fn tick(&mut self, tick: u32, now: &ProfileMoment) {
        let target = ahead(now, 0.0);
        let torque_n_m = self.sensors.torque(self.noise.part(), now.torque_n_m);
        let error_rad = self.lane.output_rad() - now.target_rad;
        let nominal_error_rad = self.nominal_lane.output_rad() - now.target_rad;
        let generator = Some(self.lane.encoder());
        let told = Wanted { generator, target, rate_rad_s: now.rate_rad_s, torque_n_m, missed_ticks: 0 };
        let command = self.core.tick(&told);
        self.lane.go(command, torque_n_m, now.torque_n_m, self.ratio);
        self.nominal_lane.go(self.nominal.tick(&told), torque_n_m, now.torque_n_m, self.ratio);
        if self.groups.thermometer.is_due(tick) {
            self.readings += 1;
            self.core.set_temperature(self.sensors.temperature(now.temperature_c));
            self.lane.plant.set_temperature(now.temperature_c);
            self.nominal_lane.plant.set_temperature(now.temperature_c);
        }
        if self.groups.images.is_due(tick) {
            self.checks += 1;
            self.core.check_images();
        }
        if now.time_s >= START_UP_S {
            let held_back = self.core.held_back(HELD_BACK_RAD);
            self.scores.add(error_rad, now.steady, held_back);
            self.nominal_scores.add(nominal_error_rad, now.steady, held_back);
        }
    }

    /// How many times better than at the nominal ratio.
    pub fn gain(&self) -> f64 {
        self.nominal_scores.whole.rms_arcsec() / self.scores.whole.rms_arcsec()
    }

    /// Results in a line, the same on every machine.
    ///
    /// # Errors
    /// Those of `to`.
    pub fn write(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        let [nominal, core] = [self.nominal_scores, self.scores].map(|scores| scores.whole);
        writeln!(
            to,
            "rover {:11} uncompensated {:9.3} {:9.3}, core {:9.3} {:9.3} arcsec rms, max; {} readings, {} checks, \
             missed {}",
            self.name,
            nominal.rms_arcsec(),
            nominal.max_arcsec(),
            core.rms_arcsec(),
            core.max_arcsec(),
            self.readings,
            self.checks,
            self.core.state.missed_ticks()
        )
    }
}
