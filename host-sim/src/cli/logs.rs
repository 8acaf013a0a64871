//! How the columns of a log are read: options of every command that reads measured rows.

use clap::Args;

use super::{Failure, bad_input};
use flexspline_identify::measurement::ColumnMap;

/// Columns, rate and torque constant.
#[derive(Debug, Args)]
pub(super) struct LogOptions {
    /// Names and units of columns that are not called time_s, generator_rad, output_rad, error_arcsec, torque_n_m,
    /// temperature_c, orientation_rad: generator=wave_gen_turns:turn,error=error_arcsec:arcsec; by number, with sign
    /// and gain: generator=#1:count/16777216,torque=#4:-N.m. Units: rad, deg, gon, turn, arcmin, arcsec, mrad, count/N,
    /// s, ms, us, ns, min, h, iso, N.m, N.cm, N.mm, mN.m, kN.m, lbf.in, lbf.ft, kgf.cm, kgf.m, ozf.in, A*K, mA*K, V*K,
    /// C, K, F; `flexspline look FILE` proposes the mapping [default: these names]
    #[arg(long, value_name = "MAP", default_value = "", hide_default_value = true)]
    columns: String,
    /// Rows in a second, Hz, where a file has no time [default: no time]
    #[arg(long, value_name = "HZ")]
    pub(super) rate: Option<f64>,
    /// Torque at the output for an ampere, N.m, where the torque column is a current in A or mA [default: none]
    #[arg(long, value_name = "K", allow_negative_numbers = true)]
    torque_constant: Option<f64>,
}

impl LogOptions {
    /// The mapping that they say.
    pub(super) fn map(&self) -> Result<ColumnMap, Failure> {
        ColumnMap::of_options(&self.columns, self.rate, self.torque_constant).map_err(bad_input)
    }
}
