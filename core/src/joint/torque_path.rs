//! Which torque a table is asked with, and how a reading becomes it.
//!
//! What twists a drive is the torque that its flanks carry, the torque *in the mesh*. A table is made in steady motion under a torque on
//! the load `T`, with the drag `d_t` that its drive had then: in the mesh was `T − d_t` moving forward, `T + d_t` backward. So a joint wants
//! ```text
//! T = M + d_t·direction,    M = torque on the load − drag·direction − inertia·acceleration
//! ```
//! with the drag of *this* unit. Where the load is less than the drag, a torque on the load given as it is picks the wrong flank.
//!
//! | from | is | what it needs |
//! |---|---|---|
//! | a model of gravity and wind, a known load | on the load | drag; take inertia times the acceleration of the *target* off it |
//! | a torque sensor between drive and load, twist of two encoders | in the mesh | drag, for where the motion turns back; a low-pass: below |
//! | the motor's current times ratio, less friction, less inertia of the motor | in the mesh | likewise, and a model of the friction |
//!
//! At a reversal the drag turns over, and the torque in the mesh leaps by twice of it. A sensor behind a low-pass tells that late, and near zero load
//! not at all, where the leap is below its noise: so what is behind the low-pass is the torque on the load, from either reading, and the drag comes
//! off it by the direction.
//!
//! A torque in the mesh is moved by the compensation itself: the motor turns to make up for the wind-up, the load's inertia resists, and that is a
//! torque in the mesh again. That loop is closed on +1, and above the resonance of the load on the held motor only the
//! low-pass keeps it from ringing. `flexspline_motion::loops` finds the widest one that keeps a margin; a torque on the
//! load has no such loop.

use core::f64::consts::TAU;

use super::limits::{SettingError, checked};
use crate::play::Direction;

/// Where a torque was measured, N·m, positive where it turns the output forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TorqueReading {
    /// On the load: what gravity, wind and the like do to it.
    OnLoad(f32),
    /// In the mesh: what the flanks carry.
    InMesh(f32),
}

/// What a reading goes through.
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
    /// A torque in the mesh below this changes the flank only where the direction changes, N·m: some three times the peak of the noise behind the
    /// low-pass, and for a torque read in the mesh a fifth of the drag. 0 or more.
    pub hold_n_m: f32,
    /// After a torque read in the mesh has changed the flank it does not change it again for so long, s: the correction crosses the play then, and
    /// what its own motion makes of the torque has to die away. Some periods of the servo's position loop; 0 or more.
    pub settle_s: f32,
    /// Largest reading that the sensor can have, N·m; a larger one is forgotten as one that is not finite. Above 0.
    pub largest_n_m: f32,
}

/// From a reading to the torque that a table is asked with.
///
/// It holds a check over all of itself. Where an upset hit it every tick gives NaN, until the path is made anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TorquePath {
    /// Bits of drag, drag of the table, hold, largest reading, and the share of a reading that a tick believes.
    set: [u32; 5],
    /// Bits of the torque on the load behind the low-pass; NaN before the first.
    behind: u32,
    /// Ticks between changes of the flank, and since the last.
    settle: u16,
    since: u16,
    /// Flags, and above them the check.
    marks: u32,
}

/// The flank that carried last is the one of negative torques.
const NEGATIVE: u32 = 1;
/// There was a tick, and the direction in it was backward.
const SEEN: u32 = 2;
const BACKWARD: u32 = 4;
const FLAGS: u32 = 0xff;

impl TorquePath {
    /// A path that has seen nothing yet.
    ///
    /// # Errors
    /// [`SettingError`]: a time, bandwidth or largest reading that is not finite and positive, a drag, a hold or a time to settle that is not finite or
    /// below 0.
    pub const fn new(settings: TorqueSettings) -> Result<Self, SettingError> {
        let TorqueSettings { tick_s, bandwidth_hz, drag_n_m, table_drag_n_m, hold_n_m, settle_s, largest_n_m } =
            settings;
        if let Err(error) = checked("tick_s", tick_s, tick_s as f64, [0.0, 1e3]) {
            return Err(error);
        }
        if let Err(error) = checked("bandwidth_hz", bandwidth_hz, bandwidth_hz as f64, [0.0, 1e9]) {
            return Err(error);
        }
        // Zero is allowed, so one more is judged.
        if let Err(error) = checked("drag_n_m", drag_n_m, drag_n_m as f64 + 1.0, [1.0, 1e9]) {
            return Err(error);
        }
        if let Err(error) = checked("table_drag_n_m", table_drag_n_m, table_drag_n_m as f64 + 1.0, [1.0, 1e9]) {
            return Err(error);
        }
        if let Err(error) = checked("hold_n_m", hold_n_m, hold_n_m as f64 + 1.0, [1.0, 1e9]) {
            return Err(error);
        }
        if let Err(error) = checked("settle_s", settle_s, settle_s as f64 + 1.0, [1.0, 1e6]) {
            return Err(error);
        }
        if let Err(error) = checked("largest_n_m", largest_n_m, largest_n_m as f64, [0.0, 1e9]) {
            return Err(error);
        }
        let along = TAU * bandwidth_hz as f64 * tick_s as f64;
        let share = (along / (1.0 + along)) as f32;
        // To the next whole tick, but for rounding, and no more than a count holds.
        let settle = (settle_s as f64 / tick_s as f64 + 0.999) as u16;
        let set =
            [drag_n_m.to_bits(), table_drag_n_m.to_bits(), hold_n_m.to_bits(), largest_n_m.to_bits(), share.to_bits()];
        // Long enough ago that the flank may change.
        let path = Self { set, behind: f32::NAN.to_bits(), settle, since: u16::MAX, marks: 0 };
        Ok(path.sealed(0))
    }

    /// What changes from tick to tick, for a simulation that goes on from here.
    #[cfg(any(test, feature = "std"))]
    #[must_use]
    pub const fn kept(&self) -> [u32; 3] {
        [self.behind, self.since as u32, self.marks & FLAGS]
    }

    /// Goes on from what [`Self::kept`] gave.
    #[cfg(any(test, feature = "std"))]
    pub const fn go_on(&mut self, [behind, since, flags]: [u32; 3]) {
        self.behind = behind;
        self.since = since as u16;
        *self = self.sealed(flags);
    }

    /// With these flags, and the check over it all.
    const fn sealed(self, flags: u32) -> Self {
        let mut path = self;
        path.marks = flags & FLAGS;
        path.marks |= path.check();
        path
    }

    /// Over all but itself: each step turns what differs into what differs.
    const fn check(&self) -> u32 {
        const fn with(sum: u32, word: u32) -> u32 {
            (sum ^ word).wrapping_mul(0x9e37_79b1).rotate_left(13)
        }
        let [a, b, c, d, e] = self.set;
        let ticks = (self.settle as u32) << 16 | self.since as u32;
        let sum = with(with(with(with(with(0x5eed_0001, a), b), c), d), e);
        with(with(with(sum, self.behind), ticks), self.marks & FLAGS) & !FLAGS
    }

    /// Whether it was hit by an upset: make it anew.
    #[must_use]
    pub const fn is_damaged(&self) -> bool {
        self.marks & !FLAGS != self.check()
    }

    /// One tick: a reading, and the direction in which the output moves or moved last; what to give to
    /// [`Input::torque_n_m`](crate::Input::torque_n_m). A reading that is not finite, or larger than the sensor's largest, gives NaN and is forgotten.
    #[must_use]
    pub fn tick(&mut self, reading: TorqueReading, direction: Direction) -> f32 {
        if self.is_damaged() {
            return f32::NAN;
        }
        let [drag_n_m, table_drag_n_m, hold_n_m, largest_n_m, share] = self.set.map(f32::from_bits);
        let behind = f32::from_bits(self.behind);
        let flank = if self.marks & NEGATIVE == 0 { 1.0 } else { -1.0 };
        let backward = direction == Direction::Backward;
        let turned_back = self.marks & SEEN == 0 || (self.marks & BACKWARD != 0) != backward;
        let way = if backward { -1.0 } else { 1.0 };
        let drag = way * drag_n_m;
        // Kept as a torque on the load, which a reversal does not change: the one in the mesh leaps there by twice the drag.
        let (read, on_load, in_mesh) = match reading {
            TorqueReading::OnLoad(torque) => (torque, torque, false),
            TorqueReading::InMesh(torque) => (torque, torque + drag, true),
        };
        // Nothing that is not a number is within.
        if !(-largest_n_m..=largest_n_m).contains(&read) {
            return f32::NAN;
        }
        let late = behind + share * (on_load - behind);
        let behind = if behind.is_finite() { late } else { on_load };
        let mesh = behind - drag;
        let size = if mesh < 0.0 { -mesh } else { mesh };
        let carries = if mesh < 0.0 { -1.0 } else { 1.0 };
        // Where the motion turns back the drag tells the flank, however small the torque.
        let told = turned_back || (size >= hold_n_m && (!in_mesh || self.since >= self.settle));
        let changes = told && carries != flank;
        let flank = if changes { carries } else { flank };
        self.since = if changes && !turned_back { 0 } else { self.since.saturating_add(1) };
        self.behind = behind.to_bits();
        let sides = [(flank < 0.0, NEGATIVE), (true, SEEN), (backward, BACKWARD)];
        *self = self.sealed(sides.iter().fold(0, |flags, (there, flag)| if *there { flags | flag } else { flags }));
        flank * size + way * table_drag_n_m
    }
}

#[cfg(test)]
crate::upset::upsets!(TorquePath { set, behind, settle, since, marks });

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
        assert!((path.tick(TorqueReading::InMesh(3.0), Direction::Forward) - last).abs() < 0.02);
    }

    #[test]
    fn settings_that_make_no_sense_are_named() {
        let named = |settings| TorquePath::new(settings).unwrap_err().name;
        assert_eq!(named(TorqueSettings { bandwidth_hz: 0.0, ..SETTINGS }), "bandwidth_hz");
        assert_eq!(named(TorqueSettings { drag_n_m: -0.1, ..SETTINGS }), "drag_n_m");
        assert_eq!(named(TorqueSettings { hold_n_m: f32::NAN, ..SETTINGS }), "hold_n_m");
        assert_eq!(named(TorqueSettings { settle_s: -1.0, ..SETTINGS }), "settle_s");
        assert_eq!(named(TorqueSettings { largest_n_m: 0.0, ..SETTINGS }), "largest_n_m");
        assert!(TorquePath::new(TorqueSettings { hold_n_m: 0.0, ..SETTINGS }).is_ok());
    }

    /// What the correction's own way across the play makes of the torque does not turn it back; a reversal of the motion does.
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
    fn no_single_bit_turned_gives_a_torque() {
        use crate::upset::Upset;
        let mut sound = TorquePath::new(TorqueSettings { bandwidth_hz: 1.0, ..SETTINGS }).unwrap();
        for _ in 0..10 {
            let _ = sound.tick(TorqueReading::OnLoad(2.0), Direction::Forward);
        }
        for bit in 0..sound.bits() {
            let (mut hit, mut name) = (sound, std::string::String::new());
            hit.flip(bit, &mut name);
            for _ in 0..3 {
                let found = hit.tick(TorqueReading::OnLoad(2.0), Direction::Forward);
                assert!(found.is_nan() && hit.is_damaged(), "{name} {bit}: {found}");
            }
        }
    }
}
