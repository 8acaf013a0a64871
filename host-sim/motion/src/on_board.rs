//! A tick of a joint in firmware, from reading to command: the torque's path, rate and acceleration ahead,
//! the joint. And a flight as a tape of the inputs of firmware, so that it can be flown again where nothing else runs.
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
    #[must_use]
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
#[must_use]
pub fn passes_slowly(drive: &Drive, rate_rad_s: f32, tick_s: f32) -> bool {
    const TICKS: f32 = 6.0;
    let pitches = rate_rad_s.abs() * drive.ratio().abs() * f32::from(drive.ripple_order()) / core::f32::consts::TAU;
    pitches * tick_s * TICKS <= 1.0
}

/// Bytes of the settings, and of a tick's inputs, on a tape.
pub const SETTINGS_BYTES: usize = 4 * 15;
/// See there.
pub const TOLD_BYTES: usize = 8 + 8 + 4 * 4 + 4;

impl OnBoardSettings {
    /// For a tape, little endian.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; SETTINGS_BYTES] {
        let (l, t) = (&self.limits, &self.torque);
        let numbers = [
            l.tick_s,
            l.rate_rad_s,
            l.acceleration_rad_s2,
            l.generator_rate_rad_s,
            f32::from(l.debounce_ticks),
            l.deadband_rad,
            t.bandwidth_hz,
            t.drag_n_m,
            t.table_drag_n_m,
            t.hold_n_m,
            t.settle_s,
            t.largest_n_m,
            self.expected_n_m,
            self.ahead_s,
            self.temperature_c,
        ];
        let mut bytes = [0; SETTINGS_BYTES];
        for (to, number) in bytes.chunks_exact_mut(4).zip(numbers) {
            to.copy_from_slice(&number.to_le_bytes());
        }
        bytes
    }

    /// Of a tape.
    #[must_use]
    pub fn of_bytes(bytes: &[u8; SETTINGS_BYTES]) -> Self {
        let mut numbers = bytes.as_chunks::<4>().0.iter().map(|number| f32::from_le_bytes(*number));
        let mut next = || numbers.next().unwrap_or_default();
        let limits = Limits {
            tick_s: next(),
            rate_rad_s: next(),
            acceleration_rad_s2: next(),
            generator_rate_rad_s: next(),
            debounce_ticks: next() as u16,
            deadband_rad: next(),
        };
        let torque = TorqueSettings {
            tick_s: limits.tick_s,
            bandwidth_hz: next(),
            drag_n_m: next(),
            table_drag_n_m: next(),
            hold_n_m: next(),
            settle_s: next(),
            largest_n_m: next(),
        };
        Self { limits, torque, expected_n_m: next(), ahead_s: next(), temperature_c: next() }
    }
}

impl OnBoardInput {
    /// For a tape, little endian.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; TOLD_BYTES] {
        let (in_mesh, read) = match self.reading {
            TorqueReading::OnLoad(torque) => (0, torque),
            TorqueReading::InMesh(torque) => (1, torque),
        };
        let [rate, acceleration] = self.motion;
        let mut bytes = [0; TOLD_BYTES];
        let (angles, rest) = bytes.split_at_mut(16);
        let (numbers, marks) = rest.split_at_mut(16);
        let counts = [self.generator.counts(), self.target.counts()];
        for (to, counts) in angles.chunks_exact_mut(8).zip(counts) {
            to.copy_from_slice(&counts.to_le_bytes());
        }
        for (to, number) in numbers.chunks_exact_mut(4).zip([rate, acceleration, read, self.inertia_n_m]) {
            to.copy_from_slice(&number.to_le_bytes());
        }
        marks.copy_from_slice(&[u8::from(self.direction == Direction::Backward), in_mesh, 0, 0]);
        bytes
    }

    /// Of a tape.
    #[must_use]
    pub fn of_bytes(bytes: &[u8; TOLD_BYTES]) -> Self {
        let words = bytes.as_chunks::<4>().0;
        let number = |k: usize| f32::from_le_bytes(words.get(k).copied().unwrap_or_default());
        let half = |k: usize| i64::from(u32::from_le_bytes(words.get(k).copied().unwrap_or_default()));
        let counts = |k: usize| half(k) | half(k + 1) << 32;
        let [backward, in_mesh, ..] = words.last().copied().unwrap_or_default();
        let read = number(6);
        Self {
            generator: GeneratorAngle::from_counts(counts(0)),
            target: OutputAngle::from_counts(counts(2)),
            motion: [number(4), number(5)],
            direction: if backward == 1 { Direction::Backward } else { Direction::Forward },
            reading: if in_mesh == 1 { TorqueReading::InMesh(read) } else { TorqueReading::OnLoad(read) },
            inertia_n_m: number(7),
        }
    }
}

/// All bits of what a tick gives into a running hash (FNV-1a, by words).
#[must_use]
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
