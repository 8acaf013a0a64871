//! Flights of a joint with mass: scenarios with a name or from a file, on units built from the contact FEM of the four
//! generators.
//!
//! The moving parts are in `flexspline-motion`; here scenarios are read, units made, and results put into numbers.

mod built_in;
mod error;
mod file;
mod own;
mod results;

use flexspline_motion::flight::{Flight, JOINTS, JointUnit, fly_watched};
use flexspline_motion::gear::SampledSpring;
use flexspline_motion::scenario::{Scenario, TableKnown};

use crate::plant_map::GearMap;
use flexspline_design::tables::core_drive;
use flexspline_mechanics::drive::{Drive, GeneratorKind};

pub use built_in::{SCENARIOS, built_in};
pub use error::FlyError;
pub use file::{example, read};
pub use own::{OwnDrive, OwnTableError, gear_at};
pub use results::{ByController, LEAST_DISTANCE, LEAST_PHASE_MARGIN_DEG, Results, Row, results, settles_in, spectrum};

/// A scenario, and what flies it.
#[derive(Debug, Clone, PartialEq)]
pub struct Flown {
    /// Which generator the drive has.
    pub kind: GeneratorKind,
    /// The scenario.
    pub scenario: Scenario,
    /// The drive of a table that is flown in the place of HHD-95.
    pub own: Option<OwnDrive>,
}

/// A unit of HHD-95 with this generator at a temperature: wind-up, clearance and ripple of the contact FEM, and what
/// was built otherwise.
///
/// # Panics
/// Never: the core knows these teeth.
pub fn unit(kind: GeneratorKind, temperature_c: f64) -> JointUnit {
    let map = GearMap::of(kind);
    let (teeth, wind_up) = (map.teeth, map.at(temperature_c));
    let law = |phase: f64, flank: f64| wind_up.elastic_error_rad(phase * std::f64::consts::TAU / teeth, flank, 1.0);
    let drive = core_drive(&Drive::hhd_95()).expect("the core knows the teeth of HHD-95");
    JointUnit::of_spring(drive, SampledSpring::of_law(teeth, map.largest_n_m, law))
}

impl Flown {
    /// Flies it.
    ///
    /// # Errors
    /// [`FlyError::Load`], [`FlyError::Flight`].
    pub fn fly(&self) -> Result<Flight, FlyError> {
        self.fly_watched(&|| {})
    }

    /// Seconds that all its joints fly, together.
    pub fn seconds_of_all(&self) -> usize {
        JOINTS * self.scenario.seconds() as usize
    }

    /// Flies it; `each_second` is called for each second that one of its joints flew.
    ///
    /// # Errors
    /// [`FlyError::Load`], [`FlyError::Flight`].
    pub fn fly_watched(&self, each_second: &(dyn Fn() + Sync)) -> Result<Flight, FlyError> {
        self.carries()?;
        let (scenario, known) = (&self.scenario, self.scenario.table);
        let Some(own) = &self.own else {
            return Ok(fly_watched(scenario, &unit(self.kind, scenario.temperature_c), None, each_second)?);
        };
        // What else it may know is sampled from the unit.
        let image = (known == TableKnown::Nominal).then(|| own.image.clone());
        Ok(fly_watched(scenario, &own.unit, image, each_second)?)
    }

    /// The drive of the table with these bytes in the place of HHD-95.
    ///
    /// # Errors
    /// [`FlyError::Table`]: no table, or no gear at the scenario's temperature.
    pub fn with_table(self, image: &[u8]) -> Result<Self, FlyError> {
        let own = OwnDrive::new(image, self.scenario.temperature_c)?;
        Ok(Flown { kind: own.kind, own: Some(own), ..self })
    }

    /// Whether its drive carries its load.
    ///
    /// # Errors
    /// [`FlyError::Load`].
    pub fn carries(&self) -> Result<(), FlyError> {
        let largest_n_m = self.scenario.largest_n_m();
        let (most_n_m, of) = match &self.own {
            Some(own) => (own.largest_n_m, "this table".to_owned()),
            None => (self.kind.rated_torque_n_m(), format!("a {} generator", self.kind)),
        };
        if largest_n_m > most_n_m {
            return Err(FlyError::Load { largest_n_m, most_n_m, of });
        }
        Ok(())
    }
}
