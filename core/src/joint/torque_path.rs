//! Which torque a table is asked with, and how a reading becomes it.
//!
//! A drive is twisted by the torque that its flanks carry, the torque *in the mesh*. A table is made in steady motion
//! under a torque on the load `T`, with the drag `d_t` that its drive had then: in the mesh was `T − d_t` moving
//! forward, `T + d_t` backward. So a joint wants
//! ```text
//! T = M + d_t·direction,    M = torque on the load − drag·direction − inertia·acceleration
//! ```
//! with the drag of *this* unit. Where the load is less than the drag, a torque on the load given as it is picks the
//! wrong flank.
//!
//! | from | is | what it needs |
//! |---|---|---|
//! | a model of gravity and wind, a known load | on the load | drag; less inertia times the *target*'s acceleration |
//! | a torque sensor at the drive, twist of two encoders | in the mesh | drag, for reversals; a low-pass: below |
//! | motor current times ratio, less friction and motor inertia | in the mesh | likewise, and a friction model |
//!
//! At a reversal the drag turns over, and the torque in the mesh leaps by twice of it. A sensor behind a low-pass shows
//! that late, and near zero load not at all, where the leap is below its noise: so what is behind the low-pass is the
//! torque on the load, from either reading, and the drag comes off it by the direction.
//!
//! A torque in the mesh is moved by the compensation itself: the motor turns to make up for the wind-up, the load's
//! inertia resists, and that is a torque in the mesh again. That loop is closed on +1, and above the resonance of the
//! load on the held motor only the low-pass keeps it from ringing. `flexspline_motion::loops` finds the widest one that
//! keeps a margin; a torque on the load has no such loop.
//!
//! A reading is refused (NaN, and the tick keeps its correction) where it is no number, beyond the sensor, too far from
//! the last one that was believed, or, if that is asked for, the same for too long. Settings and state are kept under
//! one sum ([`whole`](../../whole.rs)): where an upset hit one word it is mended in the next tick.

use core::f64::consts::TAU;

use super::limits::{LEAST_TICK_S, SettingError, checked};
use crate::num;
use crate::play::Direction;
use crate::whole::{Sealed, sum_of, words};

/// Where a torque was measured, N·m, positive where it turns the output forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TorqueReading {
    /// On the load: what gravity, wind and the like do to it.
    OnLoad(f32),
    /// In the mesh: what the flanks carry.
    InMesh(f32),
}

/// Settings of the processing of a torque reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueSettings {
    /// Time from tick to tick, s.
    pub tick_s: f32,
    /// Corner of the low-pass, Hz: of the first order.
    pub bandwidth_hz: f32,
    /// Coulomb drag of the output of this unit, N·m, whichever torque is read; 0 or more.
    pub drag_n_m: f32,
    /// Coulomb drag that the table was made with, N·m; 0 or more.
    pub table_drag_n_m: f32,
    /// A torque in the mesh below this changes the flank only where the direction changes, N·m: some three times the
    /// peak of the noise behind the low-pass, and for a torque read in the mesh a fifth of the drag. 0 or more.
    pub hold_n_m: f32,
    /// After a torque read in the mesh has changed the flank it does not change it again for so long, s: the correction
    /// crosses the play then, and what its own motion makes of the torque has to die away. Some periods of the servo's
    /// position loop; 0 or more.
    pub settle_s: f32,
    /// Largest reading that the sensor can have, N·m; a larger one is forgotten as one that is not finite. Above 0.
    pub largest_n_m: f32,
}

/// From a reading to the torque that a table is asked with.
///
/// Where an upset hit more of it than can be mended every tick gives NaN, until the path is made anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TorquePath {
    path: Sealed<PathState>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PathState {
    /// Bits of drag, drag of the table, hold, largest reading, the share of a reading that a tick believes, and the
    /// largest change from one reading to the next.
    set: [u32; 6],
    /// Bits of the torque on the load behind the low-pass; NaN before the first.
    behind: u32,
    /// Bits of the last reading that was believed, NaN before the first, and of the last that was not, or that too.
    believed: u32,
    doubted: u32,
    /// Ticks between changes of the flank, and since the last, in the upper half.
    settle: u32,
    /// Ticks for which a reading may be the same, 0 for any number, and for which it was, in the upper half.
    frozen: u32,
    /// Ticks without a reading that was believed since the last one.
    gap: u32,
    /// Readings in a row that were not believed, in the upper half; flags.
    marks: u32,
}
words!([] PathState { set, behind, believed, doubted, settle, frozen, gap, marks });

/// Readings in a row near each other that are not believed where they begin too far from the last one: the third is. A
/// spike of one or two ticks is none of the torque, and a step that is one comes two ticks late. A guess.
const DOUBTED: u32 = 2;
/// A reading that changes by more than this share of the largest in a tick, and twice the drag, is too far where no
/// other limit is set: of a sinusoid from end to end of the sensor that is a fortieth of the rate of ticks. A guess.
const JUMP_SHARE: f32 = 0.25;

/// The upper half of a word.
const fn upper(word: u32) -> u32 {
    word >> 16
}

/// Two halves, each held at its largest value.
const fn halves(low: u32, high: u32) -> u32 {
    const MOST: u32 = u16::MAX as u32;
    (if low > MOST { MOST } else { low }) | (if high > MOST { MOST } else { high }) << 16
}

/// The flank that carried last is the one of negative torques.
const NEGATIVE: u32 = 1;
/// There was a tick, and the direction in it was backward.
const SEEN: u32 = 2;
const BACKWARD: u32 = 4;
const FLAGS: u32 = 0xffff;

impl TorquePath {
    /// A path that has seen nothing yet.
    ///
    /// # Errors
    /// [`SettingError`]: a time, bandwidth or largest reading that is not finite and positive, a drag, a hold or a
    /// time to settle that is not finite or below 0; a bandwidth of which a tick sees less than 1e-7, or a
    /// largest reading below 1e-6 N·m.
    pub const fn new(settings: TorqueSettings) -> Result<Self, SettingError> {
        let TorqueSettings { tick_s, bandwidth_hz, drag_n_m, table_drag_n_m, hold_n_m, settle_s, largest_n_m } =
            settings;
        tried!(checked("tick_s", tick_s, tick_s as f64, [LEAST_TICK_S, 1e3]));
        tried!(checked("bandwidth_hz", bandwidth_hz, bandwidth_hz as f64, [0.0, 1e9]));
        // Zero is allowed, so one more is judged.
        tried!(checked("drag_n_m", drag_n_m, drag_n_m as f64 + 1.0, [1.0, 1e9]));
        tried!(checked("table_drag_n_m", table_drag_n_m, table_drag_n_m as f64 + 1.0, [1.0, 1e9]));
        tried!(checked("hold_n_m", hold_n_m, hold_n_m as f64 + 1.0, [1.0, 1e9]));
        tried!(checked("settle_s", settle_s, settle_s as f64 + 1.0, [1.0, 1e6]));
        tried!(checked("largest_n_m", largest_n_m, largest_n_m as f64, [LEAST_N_M, 1e9]));
        let along = TAU * bandwidth_hz as f64 * tick_s as f64;
        // Less is lost in the rounding of what it is added to.
        tried!(checked("bandwidth_hz", bandwidth_hz, along, [1e-7, f64::MAX]));
        let share = (along / (1.0 + along)) as f32;
        // To the next whole tick, but for rounding, and no more than a count holds.
        let settle = (settle_s as f64 / tick_s as f64 + 0.999) as u16;
        let jump = JUMP_SHARE * largest_n_m + 2.0 * drag_n_m;
        let set = [
            drag_n_m.to_bits(),
            table_drag_n_m.to_bits(),
            hold_n_m.to_bits(),
            largest_n_m.to_bits(),
            share.to_bits(),
            jump.to_bits(),
        ];
        let none = f32::NAN.to_bits();
        // Long enough ago that the flank may change.
        let settle = halves(settle as u32, u32::MAX);
        Ok(PathState { set, behind: none, believed: none, doubted: none, settle, frozen: 0, gap: 0, marks: 0 }.sealed())
    }

    /// With other limits of what a sensor can read: the largest change from one tick to the next, N·m (above 0; a
    /// reading that changes by more is believed once three in a row are near each other), and the number of ticks after
    /// which a reading that stays the same to the last bit is frozen (0 for never: what comes from a model may stand
    /// still, a sensor has noise).
    ///
    /// # Errors
    /// [`SettingError`]: a change that is not finite or below 1e-6 N·m, or a path that is lost to an upset.
    pub fn with_sensor(self, jump_n_m: f32, frozen_ticks: u16) -> Result<Self, SettingError> {
        checked("jump_n_m", jump_n_m, jump_n_m as f64, [LEAST_N_M, 1e9])?;
        let mut path = self.path.open().ok_or(SettingError { name: "path", found: f32::NAN })?;
        let [.., jump] = &mut path.set;
        *jump = jump_n_m.to_bits();
        path.frozen = halves(frozen_ticks as u32, 0);
        Ok(path.sealed())
    }

    /// Whether an upset hit more of it than can be mended: make it anew.
    #[must_use]
    pub fn is_damaged(&self) -> bool {
        self.path.open().is_none()
    }

    /// One tick: a reading, and the direction in which the output moves or moved last; what to give to
    /// [`Input::torque_n_m`](crate::Input::torque_n_m). A reading that is not finite, larger than the sensor's largest,
    /// frozen, or too far from the last one, gives NaN and is forgotten.
    #[must_use]
    pub fn tick(&mut self, reading: TorqueReading, direction: Direction) -> f32 {
        let Some(mut path) = self.path.open() else { return f32::NAN };
        let torque = path.tick(reading, direction);
        *self = path.sealed();
        torque
    }
}

/// Least size of the largest reading and of the largest change of one, N·m: what is below is no joint's. A guess.
const LEAST_N_M: f64 = 1e-6;

impl PathState {
    const fn sealed(self) -> TorquePath {
        let Self { set: [a, b, c, d, e, f], behind, believed, doubted, settle, frozen, gap, marks } = self;
        TorquePath {
            path: Sealed::of(self, sum_of(&[a, b, c, d, e, f, behind, believed, doubted, settle, frozen, gap, marks])),
        }
    }

    /// Whether a reading within the sensor is to be believed.
    fn believes(&mut self, read: f32, jump_n_m: f32) -> bool {
        let (believed, doubted) = (f32::from_bits(self.believed), f32::from_bits(self.doubted));
        let near = |other: f32| num::finite(other) && (read - other).abs() <= jump_n_m;
        let same = if read.to_bits() == self.doubted { upper(self.frozen).saturating_add(1) } else { 0 };
        let most = self.frozen & FLAGS;
        self.frozen = halves(most, same);
        let first = !num::finite(believed);
        let number = if near(believed) || first {
            0
        } else if near(doubted) {
            upper(self.marks).saturating_add(1)
        } else {
            1
        };
        self.doubted = read.to_bits();
        // Those that are believed count from there.
        let soon = number > 0 && number <= DOUBTED;
        self.marks = halves(self.marks & FLAGS, if soon { number } else { 0 });
        let believes = !soon && (most == 0 || same < most);
        self.believed = if believes { read.to_bits() } else { self.believed };
        believes
    }

    fn tick(&mut self, reading: TorqueReading, direction: Direction) -> f32 {
        let [drag_n_m, table_drag_n_m, hold_n_m, largest_n_m, share, jump_n_m] = self.set.map(f32::from_bits);
        let behind = f32::from_bits(self.behind);
        let flank = if self.marks & NEGATIVE == 0 { 1.0 } else { -1.0 };
        let backward = direction == Direction::Backward;
        let turned_back = self.marks & SEEN == 0 || (self.marks & BACKWARD != 0) != backward;
        let way = if backward { -1.0 } else { 1.0 };
        let drag = way * drag_n_m;
        // Kept as a torque on the load, which a reversal does not change: the one in the mesh leaps there by twice the
        // drag.
        let (read, on_load, in_mesh) = match reading {
            TorqueReading::OnLoad(torque) => (torque, torque, false),
            TorqueReading::InMesh(torque) => (torque, torque + drag, true),
        };
        // Nothing that is not a number is within.
        if !(-largest_n_m..=largest_n_m).contains(&read) || !self.believes(read, jump_n_m) {
            self.gap = self.gap.saturating_add(1);
            return f32::NAN;
        }
        // Over a gap the low-pass goes on by all the time that went.
        let gap = self.gap as f32;
        let share = (1.0 + gap) * share / (1.0 + gap * share);
        self.gap = 0;
        let late = behind + share * (on_load - behind);
        let behind = if behind.is_finite() { late } else { on_load };
        let mesh = behind - drag;
        let size = if mesh < 0.0 { -mesh } else { mesh };
        let carries = if mesh < 0.0 { -1.0 } else { 1.0 };
        // Where the motion turns back the drag decides the flank, however small the torque.
        let decided = turned_back || (size >= hold_n_m && (!in_mesh || upper(self.settle) >= self.settle & FLAGS));
        let changes = decided && carries != flank;
        let flank = if changes { carries } else { flank };
        let since = if changes && !turned_back { 0 } else { upper(self.settle).saturating_add(1) };
        self.settle = halves(self.settle & FLAGS, since);
        self.behind = behind.to_bits();
        let sides = [(flank < 0.0, NEGATIVE), (true, SEEN), (backward, BACKWARD)];
        self.marks = sides.iter().fold(0, |flags, (there, flag)| if *there { flags | flag } else { flags });
        flank * size + way * table_drag_n_m
    }
}

bits_of!(TorquePath { path });

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: TorqueSettings = TorqueSettings {
        tick_s: 1e-3,
        bandwidth_hz: 5.0,
        drag_n_m: 0.5,
        table_drag_n_m: 0.02,
        hold_n_m: 0.1,
        settle_s: 0.25,
        largest_n_m: 100.0,
    };

    #[test]
    fn a_load_below_the_drag_rests_on_the_flank_that_carries() {
        let mut path = TorquePath::new(SETTINGS).unwrap();
        let load = TorqueReading::OnLoad(0.3);
        // Forward the mesh pushes the load on with 0.2, backward it holds 0.8.
        assert!((path.tick(load, Direction::Forward) - (-0.2 + 0.02)).abs() < 1e-6);
        assert!((path.tick(load, Direction::Backward) - (0.8 - 0.02)).abs() < 1e-6);
        let mut path = TorquePath::new(SETTINGS).unwrap();
        assert!((path.tick(TorqueReading::InMesh(-0.2), Direction::Forward) - (-0.2 + 0.02)).abs() < 1e-6);
    }

    #[test]
    fn noise_about_zero_does_not_change_the_flank() {
        let mut path = TorquePath::new(TorqueSettings { drag_n_m: 0.0, bandwidth_hz: 1e6, ..SETTINGS }).unwrap();
        assert!(path.tick(TorqueReading::OnLoad(-1.0), Direction::Forward) < -0.9);
        for k in 0..50 {
            let noise = if k % 2 == 0 { 0.09 } else { -0.09 };
            assert!(path.tick(TorqueReading::OnLoad(noise), Direction::Forward) < 0.0);
        }
        assert!(path.tick(TorqueReading::OnLoad(0.11), Direction::Forward) > 0.1);
    }

    /// A slow low-pass has heard nothing of the reversal yet, and the hold is wider than what is left.
    #[test]
    fn at_a_reversal_the_drag_tells_the_flank_of_a_torque_read_in_the_mesh() {
        let mut path = TorquePath::new(TorqueSettings { hold_n_m: 0.3, ..SETTINGS }).unwrap();
        // 0.3 on the load: −0.2 in the mesh forward, 0.8 backward.
        for _ in 0..10 {
            assert!((path.tick(TorqueReading::InMesh(-0.2), Direction::Forward) - (-0.2 + 0.02)).abs() < 1e-6);
        }
        assert!((path.tick(TorqueReading::InMesh(-0.2), Direction::Backward) - (0.8 - 0.02)).abs() < 0.04);
        for _ in 0..300 {
            let _ = path.tick(TorqueReading::InMesh(0.8), Direction::Backward);
        }
        let turned = path.tick(TorqueReading::InMesh(0.8), Direction::Forward);
        assert!((turned - (-0.2 + 0.02)).abs() < 0.04, "{turned}");
        // And then noise does not change it.
        assert!(path.tick(TorqueReading::InMesh(10.0), Direction::Forward) < 0.0);
    }

    #[test]
    fn the_low_pass_is_of_the_first_order_and_starts_where_it_reads() {
        let mut path = TorquePath::new(TorqueSettings { drag_n_m: 0.0, table_drag_n_m: 0.0, ..SETTINGS }).unwrap();
        assert_eq!(path.tick(TorqueReading::InMesh(2.0), Direction::Forward), 2.0);
        let mut last = 0.0;
        // One time constant: 32 ms.
        for _ in 0..32 {
            last = path.tick(TorqueReading::InMesh(3.0), Direction::Forward);
        }
        assert!((last - 2.63).abs() < 0.02, "{last}");
        assert!(path.tick(TorqueReading::InMesh(f32::NAN), Direction::Forward).is_nan());
        assert!((path.tick(TorqueReading::InMesh(3.0), Direction::Forward) - last).abs() < 0.03);
    }

    #[test]
    fn settings_that_make_no_sense_are_named() {
        let named = |settings| TorquePath::new(settings).unwrap_err().name;
        assert_eq!(named(TorqueSettings { bandwidth_hz: 0.0, ..SETTINGS }), "bandwidth_hz");
        assert_eq!(named(TorqueSettings { drag_n_m: -0.1, ..SETTINGS }), "drag_n_m");
        assert_eq!(named(TorqueSettings { hold_n_m: f32::NAN, ..SETTINGS }), "hold_n_m");
        assert_eq!(named(TorqueSettings { settle_s: -1.0, ..SETTINGS }), "settle_s");
        assert_eq!(named(TorqueSettings { largest_n_m: 0.0, ..SETTINGS }), "largest_n_m");
        assert_eq!(named(TorqueSettings { largest_n_m: 1e-40, ..SETTINGS }), "largest_n_m");
        assert_eq!(named(TorqueSettings { bandwidth_hz: 1e-40, ..SETTINGS }), "bandwidth_hz");
        assert_eq!(named(TorqueSettings { tick_s: 1e-40, ..SETTINGS }), "tick_s");
        let path = TorquePath::new(SETTINGS).unwrap();
        assert_eq!(path.with_sensor(1e-40, 5).unwrap_err().name, "jump_n_m");
        assert_eq!(path.with_sensor(f32::NAN, 5).unwrap_err().name, "jump_n_m");
        assert!(TorquePath::new(TorqueSettings { hold_n_m: 0.0, ..SETTINGS }).is_ok());
    }

    /// The torque that the correction's own way across the play causes does not turn it back; a reversal of the
    /// motion does.
    #[test]
    fn a_flank_that_a_reading_changed_stays_until_its_correction_has_settled() {
        let mut path = TorquePath::new(TorqueSettings { bandwidth_hz: 1e6, ..SETTINGS }).unwrap();
        let mut flank = |torque: f32, direction| path.tick(TorqueReading::InMesh(torque), direction).signum();
        assert_eq!(flank(-0.4, Direction::Forward), -1.0);
        assert_eq!(flank(3.0, Direction::Forward), 1.0);
        for _ in 0..250 {
            assert_eq!(flank(-3.0, Direction::Forward), 1.0);
        }
        assert_eq!(flank(-3.0, Direction::Forward), -1.0);
        assert_eq!(flank(3.0, Direction::Forward), -1.0);
        assert_eq!(flank(3.0, Direction::Backward), 1.0);
    }

    #[test]
    fn a_reading_beyond_the_sensor_is_forgotten() {
        let mut path = TorquePath::new(SETTINGS).unwrap();
        let before = path.tick(TorqueReading::OnLoad(2.0), Direction::Forward);
        for wrong in [100.1, -1e6, f32::MAX, f32::INFINITY, f32::NAN] {
            assert!(path.tick(TorqueReading::OnLoad(wrong), Direction::Forward).is_nan());
            assert_eq!(path.tick(TorqueReading::OnLoad(2.0), Direction::Forward), before);
        }
    }

    #[test]
    fn no_single_bit_of_a_torque_path_gives_another_torque() {
        use crate::upset::Upset;
        let mut sound = TorquePath::new(TorqueSettings { bandwidth_hz: 1.0, ..SETTINGS }).unwrap();
        for _ in 0..10 {
            let _ = sound.tick(TorqueReading::OnLoad(2.0), Direction::Forward);
        }
        for bit in 0..sound.bits() {
            let (mut hit, mut twin, mut name) = (sound, sound, std::string::String::new());
            hit.flip(bit, &mut name);
            for torque in [2.0, 2.5, -2.0] {
                let reading = TorqueReading::OnLoad(torque);
                let found = hit.tick(reading, Direction::Forward);
                assert_eq!(found, twin.tick(reading, Direction::Forward), "{name} {bit}");
            }
            assert_eq!(hit, twin);
            // Two bits of two words cannot be mended: nothing is said any more.
            let mut lost = sound;
            lost.flip(bit, &mut name);
            lost.flip((bit + 40) % sound.bits(), &mut name);
            assert!(lost.is_damaged() && lost.tick(TorqueReading::OnLoad(2.0), Direction::Forward).is_nan(), "{bit}");
        }
    }

    /// A thousand ticks a second for twenty seconds, a light load on one flank and noise, and one reading of a hundred
    /// that is a spike.
    #[test]
    fn spikes_of_a_sensor_change_no_flank() {
        for (place, jump) in
            [(TorqueReading::OnLoad as fn(f32) -> TorqueReading, None), (TorqueReading::InMesh, Some(5.0))]
        {
            let mut path = TorquePath::new(TorqueSettings { settle_s: 0.02, ..SETTINGS }).unwrap();
            if let Some(jump) = jump {
                path = path.with_sensor(jump, 0).unwrap();
            }
            let (mut changes, mut refused, mut last) = (0, 0, f32::NAN);
            for tick in 0..20_000u32 {
                let noise = 0.02 * ((tick * 37 % 21) as f32 - 10.0) / 10.0;
                let spike = if tick % 100 == 50 { if tick % 200 == 50 { -90.0 } else { 90.0 } } else { 0.0 };
                let torque = path.tick(place(1.5 + noise + spike), Direction::Forward);
                refused += u32::from(torque.is_nan());
                changes += u32::from(torque * last < 0.0);
                last = if torque.is_nan() { last } else { torque };
            }
            assert_eq!((changes, refused), (0, 200));
        }
        // A step that stays is the torque, two ticks late.
        let mut path = TorquePath::new(TorqueSettings { bandwidth_hz: 1e6, drag_n_m: 0.0, ..SETTINGS }).unwrap();
        let mut tick = |torque| path.tick(TorqueReading::OnLoad(torque), Direction::Forward);
        assert!(tick(1.0) > 0.9 && tick(80.0).is_nan() && tick(81.0).is_nan());
        assert!((tick(82.0) - 82.02).abs() < 0.05 && (tick(83.0) - 83.02).abs() < 0.05);
        // Spikes in a row that are not near each other are none.
        for k in 0..20 {
            assert!(tick(if k % 2 == 0 { -90.0 } else { 20.0 }).is_nan());
        }
        assert!(tick(83.0) > 82.0);
    }

    /// A ramp with readings missing: afterwards the low-pass is where it would be, to what the ramp did meanwhile.
    #[test]
    fn over_a_gap_the_low_pass_goes_on() {
        for missing in [1, 5, 20, 100] {
            let mut path = TorquePath::new(TorqueSettings { drag_n_m: 0.0, ..SETTINGS }).unwrap();
            let mut whole = path;
            let (mut found, mut expected) = (0.0, 0.0);
            for tick in 0..400u32 {
                let torque = 2.0 + 0.02 * tick as f32;
                expected = whole.tick(TorqueReading::OnLoad(torque), Direction::Forward);
                let lost = (200..200 + missing).contains(&tick);
                let reading = TorqueReading::OnLoad(if lost { f32::NAN } else { torque });
                found = path.tick(reading, Direction::Forward);
                assert_eq!(found.is_nan(), lost);
                if tick == 200 + missing {
                    // Without what went meanwhile it would be off by 0.02 N·m for each tick.
                    assert!((found - expected).abs() < 0.25, "{missing}: {found} {expected}");
                }
            }
            assert!((found - expected).abs() < 0.02);
        }
    }

    #[test]
    fn a_reading_that_stands_still_is_frozen() {
        let mut path = TorquePath::new(SETTINGS).unwrap().with_sensor(25.0, 10).unwrap();
        let mut tick = |torque| path.tick(TorqueReading::OnLoad(torque), Direction::Forward).is_nan();
        assert!((0..10).all(|_| !tick(2.0)) && (0..1000).all(|_| tick(2.0)));
        assert!(!tick(2.001) && (0..1000).all(|k| !tick(2.0 + (k % 2) as f32)));
        // And where nobody asked for it a model may stand still.
        let mut model = TorquePath::new(SETTINGS).unwrap();
        assert!((0..100_000).all(|_| !model.tick(TorqueReading::OnLoad(2.0), Direction::Forward).is_nan()));
    }
}
