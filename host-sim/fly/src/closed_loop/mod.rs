//! The core in a closed loop with the simulated drive: what it gains in pointing.
//!
//! The plant is contact FEM at points that made no table ([`map::DenseMap`]), read with a law of play of its own
//! ([`flight::gear`]); `tests/closed_loop/` flies the FEM itself, and joints that something goes wrong with. What has
//! mass is flown by
//! [`crate::fly`]. Everything that flies is in [`flight`], which `tests/firmware` compiles for the target as well: the
//! joint's tick is the very same code in both.

pub mod map;

pub use flexspline_motion::rigid as flight;

use std::path::Path;

use serde::Serialize;

use flexspline_base::output::{OutputError, write_csv};
use flexspline_base::units::ARCSEC_PER_RAD;
use flight::RigidPlant;
use flight::antenna::{Antenna, CORE, Pointing};
use flight::profile::{Profile, ProfileMoment};

/// One tick of a flight, as a report draws it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FlightRow {
    /// Time, s.
    pub time_s: f64,
    /// Target of the output, rad.
    pub target_rad: f64,
    /// Its rate, rad/s.
    pub target_rate_rad_s: f64,
    /// Torque on the load, N·m.
    pub torque_n_m: f64,
    /// Temperature of the drive, °C.
    pub temperature_c: f64,
    /// Output less target without compensation, arcsec.
    pub uncompensated_arcsec: f64,
    /// With the kinematic error by sign of velocity, at no load.
    pub sign_of_velocity_arcsec: f64,
    /// With the kinematic error by sign of velocity, recorded at the mean load.
    pub sign_of_velocity_mean_load_arcsec: f64,
    /// With the whole table by torque and sign of velocity.
    pub torque_and_sign_arcsec: f64,
    /// With the core.
    pub core_arcsec: f64,
    /// The correction of the core, arcsec at the output.
    pub core_correction_arcsec: f64,
    /// Whether its limiter held it back.
    pub held_back: bool,
}

/// Flies a profile to its end with every controller. `None` if the table cannot be flown; `observe` sees every tick.
pub fn fly<'a, P: RigidPlant>(
    images: [&'a [u8]; 2],
    plants: [P; 5],
    profile: &Profile,
    largest_n_m: f64,
    observe: &mut dyn FnMut(FlightRow),
) -> Option<Antenna<'a, P>> {
    let [first_c, _] = profile.temperature_c;
    let mut antenna = Antenna::new(images, plants, largest_n_m, profile.mean_torque_n_m(largest_n_m), first_c)?;
    for moment in profile.moments(largest_n_m) {
        let pointing = antenna.tick(&moment);
        observe(row(&moment, &pointing, &antenna));
    }
    Some(antenna)
}

fn row<P: RigidPlant>(moment: &ProfileMoment, pointing: &Pointing, antenna: &Antenna<'_, P>) -> FlightRow {
    let errors = pointing.errors_rad.map(|error| error * ARCSEC_PER_RAD);
    FlightRow {
        time_s: moment.time_s,
        target_rad: moment.target_rad,
        target_rate_rad_s: moment.rate_rad_s,
        torque_n_m: moment.torque_n_m,
        temperature_c: moment.temperature_c,
        uncompensated_arcsec: errors[0],
        sign_of_velocity_arcsec: errors[1],
        sign_of_velocity_mean_load_arcsec: errors[2],
        torque_and_sign_arcsec: errors[3],
        core_arcsec: errors[CORE],
        core_correction_arcsec: antenna.core.out.map_or(0.0, |out| f64::from(out.correction_rad) * ARCSEC_PER_RAD),
        held_back: pointing.held_back,
    }
}

/// Writes every `nth` row of a flight.
///
/// # Errors
/// [`OutputError`].
pub fn write_flight(path: &Path, rows: &[FlightRow], nth: usize) -> Result<(), OutputError> {
    write_csv(path, rows.iter().step_by(nth.max(1)))
}
