//! Why rows that were read are refused as a whole.

use thiserror::Error;

use super::columns::Quantity;
use super::unit::Unit;

/// Why rows say nothing of a drive, or not which drive.
#[derive(Debug, Clone, PartialEq, Error)]
pub(crate) enum Refusal {
    #[error("ratio: found {0}, allowed: a finite number other than zero")]
    NoRatio(f64),
    #[error("{rows} rows have all that is needed; at least {fewest} must ({recorded})")]
    TooFew { rows: usize, fewest: usize, recorded: String },
    #[error("generator and {0} keep one value throughout; at least one of them must change")]
    NothingMoves(Quantity),
    #[error("torque: found {size:e} N·m in a twentieth of the rows, allowed: at most {limit:e} N·m")]
    Torque { size: f64, limit: f64 },
    #[error(
        "{seen}: that is the ratio {ratio} of the same teeth with the other wheel fixed; allowed: the wheel that is \
         fixed in the drive measured"
    )]
    OtherWheel { seen: String, ratio: f64 },
    #[error("{seen}: {why}; allowed: {}", .readings.join(", or "))]
    OtherReading { seen: String, why: &'static str, readings: Vec<String> },
    #[error(
        "{column}: {rows} rows {period:.3} s apart, {hours:.1} hours in which the generator hardly exceeds {speed:.3} \
         rad/s and turns round over many rows: milliseconds rather than seconds; allowed: --columns time={column}:ms, \
         or time={column}:s if the motor creeps"
    )]
    Milliseconds { column: String, rows: usize, period: f64, hours: f64, speed: f64 },
    #[error(
        "{output} does not follow: {generator} turns by {turned:.3} rad, {output} by {followed:.6} rad; allowed: an \
         output that turns"
    )]
    OutputStands { generator: String, output: String, turned: f64, followed: f64 },
    #[error(
        "{seen}; allowed: within a factor of {factor} of it. Are columns, units ({}) and ratio right? They are mapped \
         with --columns generator=NAME:UNIT,output=NAME:UNIT",
        angles()
    )]
    OtherRatio { seen: String, factor: f64 },
    #[error(
        "{column}: found errors of {found:e} {unit}, allowed: between a thousandth of an arc-second and ten degrees. \
         Is its unit ({}) right? It is mapped with --columns error=NAME:UNIT",
        angles()
    )]
    SizeOfErrors { column: String, found: f64, unit: Unit },
    #[error("the {channel} keeps one value over {frozen} of {rows} rows; allowed: at most half of them")]
    Frozen { channel: Quantity, frozen: usize, rows: usize },
}

/// The units of angles that one may take for another.
fn angles() -> String {
    Unit::ANGLES.map(Unit::name).join(", ")
}
