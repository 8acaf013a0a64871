//! A mixed trajectory, the same on every machine: what the target does is compared with what the host does, bit by bit.

use flexspline::{
    Adjustment, Drive, FixedMember, GeneratorAngle, Images, Input, Joint, JointState, Limits, Mode, Output,
    OutputAngle, Overrun, Store,
};

/// The joint of all programs: HHD-95, a thousand ticks a second.
pub const JOINT: Joint = {
    let Ok(drive) = Drive::new(188, 190, FixedMember::Flexspline) else { panic!() };
    let limits = Limits {
        tick_s: 1e-3,
        rate_rad_s: 0.05,
        acceleration_rad_s2: 5.0,
        generator_rate_rad_s: 600.0,
        debounce_ticks: 5,
        deadband_rad: 0.0,
    };
    let Ok(joint) = Joint::new(drive, limits, Overrun::FadeOut { ticks: 50 }) else { panic!() };
    joint
};

/// Numbers that look random, the same in every run.
pub struct Mixed(pub u32);

impl Mixed {
    /// 32 bits.
    pub fn number(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9);
        let mut x = self.0;
        x = (x ^ (x >> 16)).wrapping_mul(0x85eb_ca6b);
        x = (x ^ (x >> 13)).wrapping_mul(0xc2b2_ae35);
        x ^ (x >> 16)
    }

    /// Between −1 and 1.
    pub fn part(&mut self) -> f32 {
        (self.number() >> 8) as f32 * (2.0 / 16_777_216.0) - 1.0
    }
}

/// Motion with reversals, torques beyond the table, lost samples, late ticks, and now and then no torque.
pub struct Trajectory {
    mixed: Mixed,
    generator: GeneratorAngle,
    output: OutputAngle,
    speed: i32,
    torque_n_m: f32,
}

impl Trajectory {
    /// From zero.
    pub const fn new(seed: u32) -> Self {
        Self {
            mixed: Mixed(seed),
            generator: GeneratorAngle::ZERO,
            output: OutputAngle::ZERO,
            speed: 0,
            torque_n_m: 0.0,
        }
    }

    /// The next tick's input.
    pub fn input(&mut self) -> Input {
        if self.mixed.number().is_multiple_of(64) {
            self.speed = (self.mixed.number() as i32) >> 8;
            self.torque_n_m = 60.0 * self.mixed.part();
        }
        self.generator = self.generator.offset_counts(i64::from(self.speed));
        let event = self.mixed.number() % 1024;
        Input {
            generator: if event == 0 { None } else { Some(self.generator) },
            target: self.output.offset_rad(1e-3 * self.mixed.part()),
            torque_n_m: if event == 1 { f32::NAN } else { self.torque_n_m },
            missed_ticks: (event == 2) as u16,
            adjustment: Adjustment::default(),
        }
    }

    /// Records the output of the joint.
    pub fn saw(&mut self, out: &Output) {
        self.output = out.output;
    }
}

/// All bits of an output into a running hash (FNV-1a).
pub fn hash(hash: u64, out: &Output) -> u64 {
    let numbers = [out.transmission_error_rad, out.uncertainty_rad, out.correction_rad, out.held_back_rad];
    let mut words = [0u64; 8];
    words[0] = out.command.counts() as u64;
    words[1] = out.output.counts() as u64;
    words[2..6].iter_mut().zip(numbers).for_each(|(word, number)| *word = u64::from(number.to_bits()));
    words[6] = out.quality as u64;
    words[7] = u64::from(out.flags.bits());
    words.iter().fold(hash, |hash, word| (hash ^ word).wrapping_mul(0x0100_0000_01b3))
}

/// The hash after a number of ticks with a table, given twice; 0 if the table is refused.
pub fn run([first, second]: [&[u8]; 2], store: &mut Store, ticks: u32) -> u64 {
    let images = Images::new(first, second);
    if store.activate(&images, JOINT.drive(), 21.0).is_err() {
        return 0;
    }
    let mut state = JointState::new();
    let _ = state.request(Mode::Tracking);
    let mut trajectory = Trajectory::new(7);
    let mut sum = 0xcbf2_9ce4_8422_2325;
    for tick in 0..ticks {
        if tick.is_multiple_of(1000) {
            store.set_temperature(&images, 20.0 + 60.0 * trajectory.mixed.part());
        }
        let out = JOINT.tick(&images, store, &mut state, &trajectory.input());
        trajectory.saw(&out);
        sum = hash(sum, &out);
    }
    sum
}
