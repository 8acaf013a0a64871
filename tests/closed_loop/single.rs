//! One joint with the core alone, and whatever goes wrong with it.

use flexspline::{Drive, Mode, Output, Overrun};

use flexspline_sim::closed_loop::flight::antenna::{HELD_BACK_RAD, START_UP_S, SlowGroups};
use flexspline_sim::closed_loop::flight::controllers::{ByCore, StartError, Wanted};
use flexspline_sim::closed_loop::flight::profile::ProfileMoment;
use flexspline_sim::closed_loop::flight::score::Scores;
use flexspline_sim::closed_loop::flight::{JointSensors, Lane, Noise, RigidPlant, ahead};

/// One tick of it.
#[derive(Debug, Clone, Copy)]
pub struct Step {
    /// Output less target at the beginning of the tick, rad.
    pub error_rad: f64,
    /// What the joint said; `None` if it was not called in this tick.
    pub out: Option<Output>,
}

/// A joint in flight.
pub struct Single<'a, P> {
    /// Motor and drive.
    pub lane: Lane<P>,
    /// The core.
    pub core: ByCore<'a>,
    /// Errors so far.
    pub scores: Scores,
    drive: Drive,
    groups: SlowGroups,
    sensors: JointSensors,
    noise: Noise,
    tick: u32,
    command: flexspline::GeneratorAngle,
}

impl<'a, P: RigidPlant> Single<'a, P> {
    /// At rest, tracking.
    ///
    /// # Errors
    /// [`StartError`].
    pub fn new(
        images: [&'a [u8]; 2],
        drive: Drive,
        plant: P,
        largest_n_m: f64,
        first_c: f64,
        overrun: Overrun,
    ) -> Result<Self, StartError> {
        let sensors = JointSensors::for_range(largest_n_m);
        let mut core = ByCore::new(images, drive, sensors.temperature(first_c), overrun)?;
        core.request(Mode::Tracking);
        let groups = SlowGroups::staggered(0).unwrap_or_else(|| unreachable!("number 0 is below 20"));
        let lane = Lane::new(plant);
        let command = lane.encoder();
        Ok(Self {
            lane,
            core,
            scores: Scores::default(),
            drive,
            groups,
            sensors,
            noise: Noise::new(5),
            tick: 0,
            command,
        })
    }

    /// One tick. `disturb` may change what the joint is told, and says whether it is called at all; if not, the last
    /// command stands.
    pub fn tick(&mut self, now: &ProfileMoment, disturb: impl FnOnce(&mut Wanted, &mut ByCore<'a>) -> bool) -> Step {
        let error_rad = self.lane.output_rad() - now.target_rad;
        let shown_n_m = self.sensors.torque(self.noise.part(), now.torque_n_m);
        let mut told = Wanted {
            generator: Some(self.lane.encoder()),
            target: ahead(now, 0.0),
            rate_rad_s: now.rate_rad_s,
            torque_n_m: shown_n_m,
            missed_ticks: 0,
        };
        let called = disturb(&mut told, &mut self.core);
        if called {
            self.command = self.core.tick(&told);
        }
        self.lane.go(self.command, shown_n_m, now.torque_n_m, self.drive.exact_ratio());
        if called && self.groups.thermometer.is_due(self.tick) {
            self.core.set_temperature(self.sensors.temperature(now.temperature_c));
        }
        if self.groups.thermometer.is_due(self.tick) {
            self.lane.plant.set_temperature(now.temperature_c);
        }
        if called && self.groups.images.is_due(self.tick) {
            self.core.check_images();
        }
        if now.time_s >= START_UP_S {
            self.scores.add(error_rad, now.steady, self.core.held_back(HELD_BACK_RAD));
        }
        self.tick += 1;
        Step { error_rad, out: if called { self.core.out } else { None } }
    }
}
