//! What an antenna is asked to do, and what the weather does to it: target, load torque and temperature, tick by tick.
//!
//! The target is made of legs of constant rate, joined by constant acceleration. The load is a bias (gravity), a slow
//! swing (wind, or gravity as the dish turns) and a gust, and crosses zero again and again; in the calm it vanishes, so
//! that the output may rest anywhere in its play. Temperature drifts evenly from first to last.

use core::f64::consts::TAU;

use crate::legs::{Aim, Leg, Walk};

/// Time from tick to tick, s.
pub const TICK_S: f64 = 1e-3;
/// Rate of the stars, rad/s.
pub const SIDEREAL_RAD_S: f64 = 7.292_115e-5;
/// Faster than this is a slew, rad/s.
pub const FASTEST_TRACKING_RAD_S: f64 = 6e-3;

/// A torque on the load, as shares of the largest torque of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weather {
    /// What is always there.
    pub bias: f64,
    /// Amplitude of the swing.
    pub swing: f64,
    /// Its frequency, Hz.
    pub swing_hz: f64,
    /// Amplitude of the gust.
    pub gust: f64,
    /// Its frequency, Hz.
    pub gust_hz: f64,
    /// From when until when there is no load, s; one second before and after it fades and rises.
    pub calm_s: [f64; 2],
}

/// A flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Its legs.
    pub legs: &'static [Leg],
    /// Acceleration of the target between legs, rad/s².
    pub acceleration_rad_s2: f64,
    /// What pulls at the output.
    pub load: Weather,
    /// Temperature at the beginning and at the end, °C.
    pub temperature_c: [f64; 2],
}

const fn leg(seconds: f64, rate_rad_s: f64) -> Leg {
    Leg { seconds, rate_rad_s }
}

/// Two minutes: slews of 1.1 °/s, stars, satellites at 0.06 and 0.3 °/s, eight reversals, three dwells, a calm of 22 s.
pub const ANTENNA: Profile = Profile {
    legs: &[
        leg(3.0, 0.0),
        leg(6.0, 0.02),
        leg(20.0, SIDEREAL_RAD_S),
        leg(8.0, 1e-3),
        leg(8.0, -1e-3),
        leg(15.0, -SIDEREAL_RAD_S),
        leg(4.0, 0.0),
        leg(5.0, -0.02),
        leg(4.0, 5e-3),
        leg(4.0, -5e-3),
        // The calm.
        leg(6.0, 2e-4),
        leg(6.0, -2e-4),
        leg(4.0, 0.0),
        leg(6.0, SIDEREAL_RAD_S),
        // The wind again.
        leg(10.0, 1e-3),
        leg(8.0, -SIDEREAL_RAD_S),
        leg(3.0, 0.0),
    ],
    acceleration_rad_s2: 0.05,
    load: Weather { bias: 0.1, swing: 0.65, swing_hz: 0.05, gust: 0.1, gust_hz: 0.7, calm_s: [77.0, 99.0] },
    temperature_c: [0.0, 40.0],
};

/// The antenna's flight in a sixth of the time, for an emulated target and for contact FEM in the loop: a slew, stars,
/// a satellite, four reversals, a calm.
pub const BRIEF: Profile = Profile {
    legs: &[
        leg(0.5, 0.0),
        leg(1.5, 0.02),
        leg(5.0, SIDEREAL_RAD_S),
        leg(2.0, 1e-3),
        leg(2.0, -1e-3),
        // The calm.
        leg(2.5, -2e-4),
        leg(2.5, SIDEREAL_RAD_S),
        // The wind again.
        leg(3.0, -SIDEREAL_RAD_S),
        leg(1.0, 0.0),
    ],
    load: Weather { swing_hz: 0.25, gust_hz: 2.0, calm_s: [11.5, 15.5], ..ANTENNA.load },
    ..ANTENNA
};

/// What is asked for at one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProfileMoment {
    /// Time, s.
    pub time_s: f64,
    /// Target of the output, rad.
    pub target_rad: f64,
    /// Its rate, rad/s.
    pub rate_rad_s: f64,
    /// Its acceleration, rad/s².
    pub acceleration_rad_s2: f64,
    /// Torque on the load, N·m, positive forward.
    pub torque_n_m: f64,
    /// Temperature of the drive, °C.
    pub temperature_c: f64,
    /// Whether the target tracks: slower than a slew, not standing, and at this rate for half a second.
    pub steady: bool,
}

impl Profile {
    /// Time of the whole flight, s.
    pub fn seconds(&self) -> f64 {
        self.legs.iter().map(|leg| leg.seconds).sum()
    }

    /// Ticks of the whole flight.
    pub fn ticks(&self) -> u32 {
        libm::round(self.seconds() / TICK_S) as u32
    }

    /// What is asked for at every tick, under loads up to `largest_n_m`.
    pub fn moments(&self, largest_n_m: f64) -> ProfileMoments<'_> {
        ProfileMoments { profile: self, largest_n_m, seconds: self.seconds(), walk: Walk::default() }
    }

    /// Mean of the torque over the flight, N·m.
    pub fn mean_torque_n_m(&self, largest_n_m: f64) -> f64 {
        let mut sum = 0.0;
        for moment in self.moments(largest_n_m) {
            sum += moment.torque_n_m;
        }
        sum / f64::from(self.ticks())
    }

    /// Torque on the load as a share of the largest.
    fn load_share(&self, time_s: f64) -> f64 {
        let Weather { bias, swing, swing_hz, gust, gust_hz, calm_s: [begins, ends] } = self.load;
        let outside = if time_s < begins { begins - time_s } else { time_s - ends };
        let strength = smooth(outside);
        strength * (bias + swing * libm::sin(TAU * swing_hz * time_s) + gust * libm::sin(TAU * gust_hz * time_s))
    }
}

/// From 0 at 0 to 1 at 1 without a corner.
fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// The moments of a flight, in order.
#[derive(Clone, Debug)]
pub struct ProfileMoments<'p> {
    profile: &'p Profile,
    largest_n_m: f64,
    seconds: f64,
    walk: Walk,
}

impl Iterator for ProfileMoments<'_> {
    type Item = ProfileMoment;

    fn next(&mut self) -> Option<ProfileMoment> {
        let Profile { legs, acceleration_rad_s2, temperature_c: [first, last], .. } = *self.profile;
        let aim = self.walk.next(legs, acceleration_rad_s2, TICK_S)?;
        let Aim { time_s, target_rad, rate_rad_s, acceleration_rad_s2, steady } = aim;
        Some(ProfileMoment {
            time_s,
            target_rad,
            rate_rad_s,
            acceleration_rad_s2,
            torque_n_m: self.largest_n_m * self.profile.load_share(time_s),
            temperature_c: first + (last - first) * time_s / self.seconds,
            steady: steady && rate_rad_s.abs() <= FASTEST_TRACKING_RAD_S,
        })
    }
}
