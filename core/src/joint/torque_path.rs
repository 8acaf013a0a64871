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
//! | a torque sensor between drive and load, twist of two encoders | in the mesh | a low-pass: below |
//! | the motor's current times ratio, less friction, less inertia of the motor | in the mesh | likewise, and a model of the friction |
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
    /// Coulomb drag of the output of this unit, N·m; 0 or more.
    pub drag_n_m: f32,
    /// Coulomb drag that the table was made with, N·m; 0 or more.
    pub table_drag_n_m: f32,
    /// A torque in the mesh below this does not change the flank, N·m: some three times the peak of the noise. 0 or more.
    pub hold_n_m: f32,
}

/// From a reading to the torque that a table is asked with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorquePath {
    settings: TorqueSettings,
    share: f32,
    /// The reading behind the low-pass; NaN before the first.
    behind: f32,
    /// The flank that carried last: 1 or −1.
    flank: f32,
}

impl TorquePath {
    /// A path that has seen nothing yet.
    ///
    /// # Errors
    /// [`SettingError`]: a time or bandwidth that is not finite and positive, a drag or a hold that is not finite or below 0.
    pub const fn new(settings: TorqueSettings) -> Result<Self, SettingError> {
        let TorqueSettings { tick_s, bandwidth_hz, drag_n_m, table_drag_n_m, hold_n_m } = settings;
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
        let turned = TAU * bandwidth_hz as f64 * tick_s as f64;
        let share = (turned / (1.0 + turned)) as f32;
        Ok(Self { settings, share, behind: f32::NAN, flank: 1.0 })
    }

    /// What changes from tick to tick, for a simulation that goes on from here.
    #[cfg(any(test, feature = "std"))]
    #[must_use]
    pub const fn kept(&self) -> [f32; 2] {
        [self.behind, self.flank]
    }

    /// Goes on from what [`Self::kept`] gave.
    #[cfg(any(test, feature = "std"))]
    pub const fn go_on(&mut self, [behind, flank]: [f32; 2]) {
        self.behind = behind;
        self.flank = flank;
    }

    /// One tick: a reading, and the direction in which the output moves or moved last; what to give to
    /// [`Input::torque_n_m`](crate::Input::torque_n_m). A reading that is not finite gives NaN and is forgotten.
    #[must_use]
    pub fn tick(&mut self, reading: TorqueReading, direction: Direction) -> f32 {
        let TorqueSettings { drag_n_m, table_drag_n_m, hold_n_m, .. } = self.settings;
        let (read, drag) = match reading {
            TorqueReading::OnLoad(torque) => (torque, drag_n_m),
            TorqueReading::InMesh(torque) => (torque, 0.0),
        };
        if !read.is_finite() {
            return f32::NAN;
        }
        self.behind = if self.behind.is_finite() { self.behind + self.share * (read - self.behind) } else { read };
        let way = match direction {
            Direction::Forward => 1.0,
            Direction::Backward => -1.0,
        };
        let mesh = self.behind - way * drag;
        let size = if mesh < 0.0 { -mesh } else { mesh };
        if size >= hold_n_m {
            self.flank = if mesh < 0.0 { -1.0 } else { 1.0 };
        }
        self.flank * size + way * table_drag_n_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: TorqueSettings =
        TorqueSettings { tick_s: 1e-3, bandwidth_hz: 5.0, drag_n_m: 0.5, table_drag_n_m: 0.02, hold_n_m: 0.1 };

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
        assert!(TorquePath::new(TorqueSettings { hold_n_m: 0.0, ..SETTINGS }).is_ok());
    }
}
