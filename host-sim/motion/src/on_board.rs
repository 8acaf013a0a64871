//! A tick of a joint in firmware, from reading to command: the torque's path, rate and acceleration ahead,
//! the joint. And what a flight gave in a few lines, to be compared where it is flown again.
//! `no_std`: the firmware of `tests/firmware` is made of this file.

use flexspline::{
    Adjustment, Direction, Drive, GeneratorAngle, Images, Input, Joint, JointState, Limits, Mode, Output, OutputAngle,
    Overrun, SettingError, Store, TorquePath, TorqueReading, TorqueSettings,
};

/// Settings of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnBoardSettings {
    /// Limits of the correction.
    pub limits: Limits,
    /// Path of a torque reading.
    pub torque: TorqueSettings,
    /// Torque on the load that is expected at the beginning, N·m.
    pub expected_n_m: f32,
    /// Rate and acceleration are taken along the way over this time, s.
    pub ahead_s: f32,
    /// Temperature, °C.
    pub temperature_c: f32,
}

/// Inputs of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnBoardInput {
    /// Generator as measured.
    pub generator: GeneratorAngle,
    /// Where the output shall be.
    pub target: OutputAngle,
    /// Rate (rad/s) and acceleration (rad/s²) of that.
    pub motion: [f32; 2],
    /// The way in which it moves or moved last.
    pub direction: Direction,
    /// Torque as it was read.
    pub reading: TorqueReading,
    /// Torque for the load's inertia along the target, N·m: inertia times its acceleration. A torque in the
    /// mesh has it in it.
    pub inertia_n_m: f32,
}

/// Outputs of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnBoardOutput {
    /// Of the joint.
    pub out: Output,
    /// The torque that it was asked with, N·m.
    pub torque_n_m: f32,
    /// Rate and acceleration for the servo, rad/s and rad/s².
    pub ahead: [f32; 2],
}

/// A joint on board, tracking from the first tick on.
#[derive(Debug)]
pub struct OnBoard {
    /// Its settings.
    pub joint: Joint,
    /// State.
    pub state: JointState,
    /// The torque's way in.
    pub path: TorquePath,
    tick_s: f32,
    ahead_s: f32,
}

impl OnBoard {
    /// At rest, nothing seen.
    ///
    /// # Errors
    /// [`SettingError`].
    pub fn new(drive: Drive, settings: &OnBoardSettings) -> Result<Self, SettingError> {
        let mut path = TorquePath::new(settings.torque)?;
        // A low-pass that takes minutes starts from what is expected, not from a joint that carries nothing yet.
        let _ = path.tick(TorqueReading::OnLoad(settings.expected_n_m), Direction::Forward);
        let mut state = JointState::new();
        // From off that is always allowed.
        let _ = state.request(Mode::Tracking);
        let joint = Joint::new(drive, settings.limits, Overrun::SkipAndCount)?;
        Ok(Self { joint, state, path, tick_s: settings.limits.tick_s, ahead_s: settings.ahead_s })
    }

    /// One tick.
    pub fn tick(&mut self, images: &Images<'_>, store: &mut Store, input: &OnBoardInput) -> OnBoardOutput {
        let torque_n_m = self.torque_n_m(input);
        let [ahead_rate, mut ahead_acceleration] =
            self.joint.motion_ahead(store, input.target, input.motion, torque_n_m, self.ahead_s);
        let [rate, acceleration] = input.motion;
        if !passes_slowly(self.joint.drive(), rate, self.tick_s) {
            ahead_acceleration = ahead_rate / rate * acceleration;
        }
        let input = Input {
            generator: Some(input.generator),
            target: input.target,
            torque_n_m,
            missed_ticks: 0,
            adjustment: Adjustment::default(),
        };
        let ahead = [ahead_rate, ahead_acceleration];
        OnBoardOutput { out: self.joint.tick(images, store, &mut self.state, &input), torque_n_m, ahead }
    }

    /// The torque that a table is asked with. A torque on the load has the load's inertia taken off, unless that is the
    /// larger of both: while a target speeds up the flank does not change, as the play is not crossed by then.
    fn torque_n_m(&mut self, input: &OnBoardInput) -> f32 {
        let torque_n_m = self.path.tick(input.reading, input.direction);
        match input.reading {
            TorqueReading::OnLoad(_) if torque_n_m.abs() > input.inertia_n_m.abs() => torque_n_m - input.inertia_n_m,
            _ => torque_n_m,
        }
    }
}

/// Whether tooth pitches pass so slowly at a rate of the output that their acceleration may be fed forward: six ticks
/// or more for each. What comes a tick late is then less than 60° behind, and takes off more than it adds; faster ones
/// excite the resonance.
pub fn passes_slowly(drive: &Drive, rate_rad_s: f32, tick_s: f32) -> bool {
    const TICKS: f32 = 6.0;
    let pitches = rate_rad_s.abs() * drive.ratio().abs() * f32::from(drive.ripple_order()) / core::f32::consts::TAU;
    pitches * tick_s * TICKS <= 1.0
}

/// All bits of what a tick gives into a running hash (FNV-1a, by words).
pub fn hashed(hash: u64, given: &OnBoardOutput) -> u64 {
    let OnBoardOutput { out, torque_n_m, ahead: [rate, acceleration] } = given;
    let words = [
        out.command.counts() as u64,
        out.output.counts() as u64,
        u64::from(out.correction_rad.to_bits()) << 32 | u64::from(out.held_back_rad.to_bits()),
        u64::from(out.uncertainty_rad.to_bits()) << 32 | u64::from(out.flags.bits()),
        u64::from(rate.to_bits()) << 32 | u64::from(acceleration.to_bits()),
        u64::from(torque_n_m.to_bits()),
    ];
    words.iter().fold(hash, |hash, word| (hash ^ word).wrapping_mul(0x0100_0000_01b3))
}

/// Begin of [`hashed`].
pub const HASH_START: u64 = 0xcbf2_9ce4_8422_2325;
/// Ticks from line to line of what is compared.
pub const LINE_TICKS: usize = 500;

/// A line of what is compared: of the tick's command, torque and feed-forward, and the hash over everything so far.
///
/// # Errors
/// Of what is written to.
pub fn line(to: &mut impl core::fmt::Write, tick: usize, given: &OnBoardOutput, hash: u64) -> core::fmt::Result {
    let [rate_rad_s, acceleration_rad_s2] = given.ahead;
    writeln!(
        to,
        "{tick} {} {:08x} {:08x} {:08x} {hash:016x}",
        given.out.command.counts(),
        given.torque_n_m.to_bits(),
        rate_rad_s.to_bits(),
        acceleration_rad_s2.to_bits()
    )
}
