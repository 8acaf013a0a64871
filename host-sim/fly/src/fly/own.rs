//! The drive that a table describes, flown in the place of HHD-95.

use flexspline::{Direction, GeneratorAngle, ImageError, Table};
use flexspline_design::tables::{empirical_percent, generator_of};
use flexspline_mechanics::drive::GeneratorKind;
use flexspline_motion::flight::{JointUnit, TABLE_DRAG_N_M};
use flexspline_motion::gear::Gear;
use flexspline_motion::table::gear_of;

/// Why a table gives no drive that moves.
#[derive(Debug, thiserror::Error)]
pub enum OwnTableError {
    /// The bytes are no table.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A joint turns the circular spline.
    #[error("found a drive whose circular spline is fixed; allowed for a joint: the flexspline fixed")]
    FixedMember,
    /// The table does not reach the scenario's temperature.
    #[error("temperature_c of the scenario: found {found_c}, allowed with this table: {coldest_c} to {warmest_c}")]
    Temperature {
        /// That of the scenario, °C.
        found_c: f64,
        /// Lower end of the table, °C.
        coldest_c: f64,
        /// Upper end of the table, °C.
        warmest_c: f64,
    },
    /// A table whose error does not grow with the load: it was made of too few samples to be a spring.
    #[error("the table has no wind-up from {from_n_m} to {to_n_m} N·m; allowed for a joint: a drive that gives way")]
    Rigid {
        /// Half of its largest torque, N·m.
        from_n_m: f64,
        /// Its largest torque, N·m.
        to_n_m: f64,
    },
    /// A table without a value under load.
    #[error("the table gives nothing")]
    NoGear,
}

/// The gear that a table describes at a temperature, °C.
///
/// # Errors
/// [`OwnTableError`].
pub fn gear_at(table: &Table<'_>, temperature_c: f64) -> Result<Gear, OwnTableError> {
    if table.drive().exact_ratio() < 0.0 {
        return Err(OwnTableError::FixedMember);
    }
    let [coldest_c, warmest_c] = table.temperature_range_c().map(f64::from);
    if !(coldest_c..=warmest_c).contains(&temperature_c) {
        return Err(OwnTableError::Temperature { found_c: temperature_c, coldest_c, warmest_c });
    }
    let to_n_m = f64::from(table.torque_range_n_m()[1]);
    let from_n_m = 0.5 * to_n_m;
    let error = |torque_n_m: f64| {
        let (torque, temperature) = (torque_n_m as f32, temperature_c as f32);
        table.steady_error_rad(GeneratorAngle::default(), torque, temperature, Direction::Backward)
    };
    let winds_up = error(from_n_m).zip(error(to_n_m)).ok_or(OwnTableError::NoGear)?;
    if winds_up.1 <= winds_up.0 {
        return Err(OwnTableError::Rigid { from_n_m, to_n_m });
    }
    gear_of(table, temperature_c, TABLE_DRAG_N_M).ok_or(OwnTableError::NoGear)
}

/// Drive of a table at one temperature, for a flight.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnDrive {
    /// The bytes of the table.
    pub(super) image: Vec<u8>,
    /// The generator that it is of.
    pub(super) kind: GeneratorKind,
    /// As the table says, and built with the errors that every unit here has.
    pub(super) unit: JointUnit,
    /// Largest torque that the table has, N·m.
    pub(super) largest_n_m: f64,
    /// Percent of its wind-up that are empirical.
    pub(super) empirical_percent: Option<f64>,
}

impl OwnDrive {
    pub(super) fn new(image: &[u8], temperature_c: f64) -> Result<Self, OwnTableError> {
        let table = Table::check(image)?;
        Ok(Self {
            image: image.to_vec(),
            kind: generator_of(&table).ok_or(OwnTableError::NoGear)?,
            unit: JointUnit::of_gear(*table.drive(), gear_at(&table, temperature_c)?),
            largest_n_m: f64::from(table.torque_range_n_m()[1]),
            empirical_percent: empirical_percent(&table),
        })
    }
}
