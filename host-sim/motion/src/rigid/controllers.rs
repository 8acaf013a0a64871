//! Ways to command the generator so that the output comes to its target. All get the same target, servo and limits.
//!
//! * [`Uncompensated`]: target times ratio.
//! * [`BySign`]: what motion controllers do: the kinematic error over the generator angle, one curve for each sign of
//!   the commanded velocity, recorded at one load and temperature. It knows the backlash between its curves and the
//!   ripple; it knows nothing of a torque that changes, and takes up the whole backlash whenever the command turns
//!   around.
//! * [`ByTorque`]: the whole table of torque and temperature, again for the sign of the commanded velocity: without a
//!   state of the play. No controller that we know does this; it tells apart what the torque gains and what the play
//!   gains.
//! * [`ByCore`]: the core.

use core::f64::consts::TAU;
use flexspline::{
    ActivateError, Adjustment, Approach, Direction, Drive, Flags, GeneratorAngle, Images, Input, Joint, JointState,
    Limits, Mode, Output, OutputAngle, Overrun, Quality, SettingError, Store, Table,
};

use super::profile::TICK_S;

/// Limits of every correction, suited to the servo: a step of 60″ overshoots by 1″ and has settled after 18 ms; with
/// four times the acceleration it overshoots by 19″, and the output, carried too far, stays there until the target has
/// come by.
pub const LIMITS: Limits = Limits {
    tick_s: TICK_S as f32,
    rate_rad_s: 0.05,
    acceleration_rad_s2: 5.0,
    generator_rate_rad_s: 600.0,
    patience: 5,
    // The target is guarded outside of the core.
    hold_rad: 0.0,
};

/// What a controller is told in a tick.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    /// Generator angle of the encoder.
    pub generator: Option<GeneratorAngle>,
    /// Where the output shall be when the command has been carried out.
    pub target: OutputAngle,
    /// Its rate, rad/s.
    pub rate_rad_s: f64,
    /// Torque on the load as measured, N·m.
    pub torque_n_m: f32,
    /// Ticks missed since the last.
    pub missed_ticks: u16,
}

/// The sign of the commanded velocity; standing still keeps the last.
fn direction_of(rate_rad_s: f64, last: Direction) -> Direction {
    if rate_rad_s > 0.0 {
        Direction::Forward
    } else if rate_rad_s < 0.0 {
        Direction::Backward
    } else {
        last
    }
}

/// Target times ratio.
#[derive(Clone, Debug)]
pub struct Uncompensated {
    drive: Drive,
}

impl Uncompensated {
    /// For a drive.
    pub fn new(drive: Drive) -> Self {
        Self { drive }
    }

    /// One tick.
    pub fn tick(&mut self, told: &Wanted) -> GeneratorAngle {
        self.drive.nominal_generator(told.target)
    }
}

/// Moves a correction towards its goal within [`LIMITS`], as the core's limiter does its own: as fast as it can be
/// stopped there in whole ticks, braking with half of the acceleration.
#[derive(Clone, Debug, Default)]
pub struct Limiter {
    at_rad: f64,
    speed_rad_s: f64,
    /// What was asked for last.
    goal_rad: f64,
}

impl Limiter {
    /// One tick.
    pub fn go(&mut self, goal_rad: f64) -> f64 {
        let (rate, step) = (f64::from(LIMITS.rate_rad_s), f64::from(LIMITS.acceleration_rad_s2) * TICK_S);
        self.goal_rad = goal_rad;
        let lag = (goal_rad - self.at_rad) / TICK_S;
        let (away, braking) = (lag.abs(), 0.5 * step);
        let ticks = libm::floor(0.5 * (libm::sqrt(1.0 + 8.0 * away / braking) - 1.0));
        let stoppable = (away + 0.5 * braking * ticks * (ticks + 1.0)) / (ticks + 1.0);
        let wanted = libm::copysign(stoppable, lag);
        self.speed_rad_s = wanted.clamp(self.speed_rad_s - step, self.speed_rad_s + step).clamp(-rate, rate);
        self.at_rad += self.speed_rad_s * TICK_S;
        self.at_rad
    }
}

/// Points of a curve over one flexspline pitch.
const CURVE: usize = 64;

/// Kinematic error over the generator angle for each sign of the commanded velocity.
#[derive(Clone, Debug)]
pub struct BySign {
    drive: Drive,
    /// Forward and backward, rad.
    curves: [[f32; CURVE]; 2],
    direction: Direction,
    limiter: Limiter,
}

impl BySign {
    /// The curves of a table at one load and temperature; `None` if the table gives nothing there.
    pub fn new(table: &Table<'_>, torque_n_m: f32, temperature_c: f32) -> Option<Self> {
        let drive = *table.drive();
        let mut curves = [[0.0; CURVE]; 2];
        for (curve, direction) in curves.iter_mut().zip([Direction::Forward, Direction::Backward]) {
            for (k, error) in curve.iter_mut().enumerate() {
                let pitch = TAU / f64::from(drive.ripple_order());
                let generator = GeneratorAngle::from_rad(pitch * k as f64 / CURVE as f64)?;
                *error = table.steady_error_rad(generator, torque_n_m, temperature_c, direction)?;
            }
        }
        Some(Self { drive, curves, direction: Direction::Forward, limiter: Limiter::default() })
    }

    /// One tick.
    pub fn tick(&mut self, told: &Wanted) -> GeneratorAngle {
        self.direction = direction_of(told.rate_rad_s, self.direction);
        let [forward, backward] = &self.curves;
        let curve = if self.direction == Direction::Forward { forward } else { backward };
        // Where the generator will be with the correction that there is.
        let near = self.drive.nominal_generator(told.target.offset_rad(-self.limiter.goal_rad as f32));
        let phase = near.fraction().wrapping_mul(u32::from(self.drive.ripple_order()));
        let place = f64::from(phase) * (CURVE as f64 / 4_294_967_296.0);
        let first = place as usize % CURVE;
        let share = place - first as f64;
        let [a, b] = [curve[first], curve[(first + 1) % CURVE]].map(f64::from);
        let error = self.limiter.go(a + share * (b - a));
        self.drive.nominal_generator(told.target.offset_rad(-error as f32))
    }
}

/// The table of torque and temperature for the sign of the commanded velocity.
#[derive(Clone, Debug)]
pub struct ByTorque<'a> {
    table: Table<'a>,
    direction: Direction,
    limiter: Limiter,
    temperature_c: f32,
}

impl<'a> ByTorque<'a> {
    /// For a table.
    pub fn new(table: Table<'a>) -> Self {
        Self { table, direction: Direction::Forward, limiter: Limiter::default(), temperature_c: 20.0 }
    }

    /// What the thermometer shows, °C.
    pub fn set_temperature(&mut self, temperature_c: f32) {
        self.temperature_c = temperature_c;
    }

    /// One tick.
    pub fn tick(&mut self, told: &Wanted) -> GeneratorAngle {
        self.direction = direction_of(told.rate_rad_s, self.direction);
        let approach = Approach::Moving(self.direction);
        let command = self.table.inverse(told.target, told.torque_n_m, self.temperature_c, approach);
        let error = self.limiter.go(f64::from(command.predicted_error_rad));
        self.table.drive().nominal_generator(told.target.offset_rad(-error as f32))
    }
}

/// An output estimated to be nearer to its target than this, or beyond it, is taken for on its way, rad: 0.04″.
const ON_ITS_WAY_RAD: f32 = 2e-7;
/// An output further beyond its target than this is asked back, whatever the target's velocity, rad: 20″.
const TOO_FAR_RAD: f32 = 1e-4;

/// The core: store, joint and its state.
///
/// The core goes forward if the target is ahead of where it estimates the output, backward if behind. A servo that
/// tracks is now ahead, now behind, by less than an arc-second, and each time the whole play would be asked for. So the
/// target that the core is given is at least 0.04″ ahead of the output in the direction of the commanded velocity, and
/// what was added is taken off the command again.
pub struct ByCore<'a> {
    joint: Joint,
    images: Images<'a>,
    generator: GeneratorAngle,
    direction: Direction,
    /// The store of the tables.
    pub store: Store,
    /// The state of the joint.
    pub state: JointState,
    /// Of the last tick.
    pub out: Option<Output>,
}

/// Why there is no core to fly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StartError {
    /// The table.
    Table(ActivateError),
    /// The limits.
    Limits(SettingError),
}

impl<'a> ByCore<'a> {
    /// With a table, twice, at its temperature, off.
    ///
    /// # Errors
    /// [`StartError`].
    pub fn new(images: [&'a [u8]; 2], drive: Drive, temperature_c: f32, overrun: Overrun) -> Result<Self, StartError> {
        let joint = Joint::new(drive, LIMITS, overrun).map_err(StartError::Limits)?;
        let [first, second] = images;
        let images = Images::new(first, second);
        let mut store = Store::new();
        store.activate(&images, &drive, temperature_c).map_err(StartError::Table)?;
        Ok(Self {
            joint,
            images,
            generator: GeneratorAngle::ZERO,
            direction: Direction::Forward,
            store,
            state: JointState::new(),
            out: None,
        })
    }

    /// Saves the state and restores it, as over a reset; false, and nothing changes, if it is refused.
    pub fn reset_to_saved(&mut self) -> bool {
        let saved = self.state.save(&self.joint, &self.store);
        let Ok(restored) = JointState::restore(&saved, &self.joint, &self.store) else { return false };
        self.state = restored;
        true
    }

    /// From the next tick on.
    pub fn request(&mut self, mode: Mode) {
        // Off to tracking to hold: every transition of these programs is legal.
        let _ = self.state.request(mode);
    }

    /// What the thermometer shows, °C.
    pub fn set_temperature(&mut self, temperature_c: f32) {
        self.store.set_temperature(&self.images, temperature_c);
    }

    /// A slice of the check of the images.
    pub fn check_images(&mut self) {
        self.store.check_images(&self.images, 16);
    }

    /// How far the target is put ahead, counts of the output.
    fn put_ahead(&mut self, told: &Wanted) -> i64 {
        self.direction = direction_of(told.rate_rad_s, self.direction);
        self.generator = told.generator.unwrap_or(self.generator);
        let mut play = *self.state.play();
        let now = self.joint.forward(&self.store, &mut play, self.generator, told.torque_n_m);
        let sign = self.direction.sign();
        let ahead = told.target.minus_rad(now.output) * sign;
        if now.quality == Quality::Disabled || !(-TOO_FAR_RAD..ON_ITS_WAY_RAD).contains(&ahead) {
            return 0;
        }
        now.output.offset_rad(sign * ON_ITS_WAY_RAD).minus_counts(told.target)
    }

    /// One tick.
    pub fn tick(&mut self, told: &Wanted) -> GeneratorAngle {
        let more = self.put_ahead(told);
        let input = Input {
            generator: told.generator,
            target: told.target.offset_counts(more),
            torque_n_m: told.torque_n_m,
            missed_ticks: told.missed_ticks,
            adjustment: Adjustment::default(),
        };
        let out = self.joint.tick(&self.images, &mut self.store, &mut self.state, &input);
        self.out = Some(out);
        let more = self.joint.drive().nominal_generator(OutputAngle::from_counts(more));
        out.command.offset_counts(more.counts().wrapping_neg())
    }

    /// Whether the limiter held the correction back in the last tick by more than it matters, rad.
    pub fn held_back(&self, than_rad: f32) -> bool {
        self.out.is_some_and(|out| out.flags.contains(Flags::HELD_BACK) && out.held_back_rad.abs() > than_rad)
    }

    /// Whether the last tick was not in range.
    pub fn quality(&self) -> Quality {
        self.out.map_or(Quality::Disabled, |out| out.quality)
    }
}
