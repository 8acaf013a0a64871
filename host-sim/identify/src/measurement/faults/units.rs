//! Units, signs and columns taken for others.
//!
//! No size is changed by how well it fits. Angles that contradict the ratio, which is the user's word, are refused with
//! the mapping that mends them; columns that are exchanged are put right. A torque or a temperature that cannot be in
//! the unit given is left out, with the units that it may have and how to say them.

use std::f64::consts::TAU;

use super::{Findings, LineFit, extent};
use crate::measurement::Refusal;
use crate::measurement::columns::{MappedColumn, Quantity, Reading, Unit};
use crate::measurement::fault::{FaultName, Treatment};
use crate::measurement::gear::Gear;
use crate::measurement::log::{FEWEST_ROWS, Log};
use crate::measurement::rollover::begins_anew;
use flexspline_base::robust::{least_and_most, median_of, quantile_of, sampled};

/// The output must have turned by this angle, by the generator or by itself, before the ratio is judged, rad. *Source*:
/// derived, twenty times two arc-minutes of clearance move the ratio by 5 % at most; the clearance is a guess.
const ENOUGH_MOTION_RAD: f64 = 20.0 * 120.0 / 206_265.0;
/// A ratio this near to one that a mistake gives is that mistake. *Source*: derived, less than half of the 4.6 %
/// between degrees for arc-minutes (60) and radians for degrees (57.3).
const SAME: f64 = 0.02;
/// A ratio within these factors of the right one is left to the diagnosis, as an error of the ratio; beyond, it is
/// another gear. *Guess*: ratios of a series of gears are 20 % apart or more.
const RATIO_ERROR: [f64; 2] = [0.8, 1.25];
/// The wheel that is fixed changes the ratio by one: it is judged once the output has turned this far, rad, as
/// clearance does not hide it then. *Guess*: at a ratio of 100 the difference is 7 arc-minutes.
const SHOWS_THE_WHEEL_RAD: f64 = 0.2;
/// A ratio is that of the other wheel within this share. *Guess*: a tenth of the difference at a ratio of 100.
const OTHER_WHEEL: f64 = 1e-3;
/// Errors that spread (robust, rad) by more than the first or by less than the second are not errors of a drive in the
/// unit given. *Guess*: ten degrees, and a thousandth of an arc-second.
const SPREADS_RAD: [f64; 2] = [0.174_5, 1e-3 / 206_265.0];
/// Temperatures at which a drive exists, °C. *Guess*: cryogenic benches stop at −180, lubricants before 180.
const TEMPERATURES_C: [f64; 2] = [-180.0, 180.0];

/// Finds units that cannot be those given; an error says what has to be decided.
pub(in crate::measurement) fn check(
    log: &mut Log,
    columns: &[MappedColumn],
    gear: &Gear,
    findings: &mut Findings,
) -> Result<(), Refusal> {
    torque(log, columns, gear, findings)?;
    temperature(log, columns, findings);
    if log.output_or_error() == Quantity::Output {
        ratio(log, columns, gear, findings)
    } else {
        error_size(log, columns)
    }
}

/// Reports a unit, a sign or a column that was taken for another.
fn mismatch(log: &Log, channel: Option<Quantity>, treatment: Treatment, what: String, findings: &mut Findings) {
    findings.add(log.fault(FaultName::UnitMismatch, 0..log.len()), channel, treatment, |_| what);
}

/// The name of a column and the unit given.
fn column(columns: &[MappedColumn], quantity: Quantity) -> (&str, Unit) {
    let column = columns.iter().find(|column| column.quantity == quantity);
    column.map_or((quantity.name(), quantity.default_column().1), |column| (&column.name, column.reading.plain_unit()))
}

/// Units without a gain in which the values of a column lie within `allowed`, as `value` does in the unit given; and
/// how to say them.
fn may_be(value: f64, quantity: Quantity, columns: &[MappedColumn], allowed: impl Fn(f64) -> bool) -> Option<String> {
    let (column, unit) = column(columns, quantity);
    let (_, inside) = quantity.default_column();
    let number = (value - unit.zero()) / unit.factor();
    let plain = |other: &Unit| !matches!(other, Unit::Ampere | Unit::Milliampere | Unit::Volt);
    let all = quantity.family().units().filter(plain).map(|other| (other, Reading::of(other).value(number)));
    let may_be: Vec<(Unit, f64)> = all.filter(|(_, value)| allowed(*value)).collect();
    let (first, _) = may_be.first()?;
    let read: Vec<String> = may_be.iter().map(|(unit, value)| format!("{unit} ({value:.4} {inside})")).collect();
    let read = read.join(" or ");
    Some(format!("; its size does not say in which; it may be in {read}: --columns {quantity}={column}:{first}"))
}

/// A torque beyond what a drive bears is in another unit, and is not used.
fn torque(log: &mut Log, columns: &[MappedColumn], gear: &Gear, findings: &mut Findings) -> Result<(), Refusal> {
    let said = columns.iter().any(|column| column.quantity == Quantity::Torque && column.said);
    let limit = if said { Gear::LARGEST_TORQUE_N_M } else { gear.plausible_torque_n_m };
    let Some(values) = log.get(Quantity::Torque) else { return Ok(()) };
    let mut sizes: Vec<f64> = sampled(values).into_iter().filter(|t| t.is_finite()).map(f64::abs).collect();
    let size = quantile_of(&mut sizes, 0.95);
    if size <= limit {
        return Ok(());
    }
    let say_it = may_be(size, Quantity::Torque, columns, |torque| torque <= limit);
    let say_it = say_it.ok_or_else(|| {
        Refusal(format!("torque: found {size:e} N·m in a twentieth of the rows, allowed: at most {limit:e} N·m"))
    })?;
    let what = format!(
        "torque of {size:.0} N·m, where {limit:.0} N·m is the most: it is in another unit, and is not used{say_it}"
    );
    log.take(Quantity::Torque);
    mismatch(log, Some(Quantity::Torque), Treatment::Masked, what, findings);
    Ok(())
}

/// A temperature at which no drive exists is in another unit, and is not used.
fn temperature(log: &mut Log, columns: &[MappedColumn], findings: &mut Findings) {
    let Some(values) = log.get(Quantity::Temperature) else { return };
    let mut some: Vec<f64> = sampled(values).into_iter().filter(|t| t.is_finite()).collect();
    let median = median_of(&mut some);
    let exists = |celsius: f64| (TEMPERATURES_C[0]..=TEMPERATURES_C[1]).contains(&celsius);
    if exists(median) {
        return;
    }
    let say_it = may_be(median, Quantity::Temperature, columns, exists).unwrap_or_default();
    let what = format!("a temperature of {median:.1} degrees C is not plausible: it is not used{say_it}");
    log.take(Quantity::Temperature);
    mismatch(log, Some(Quantity::Temperature), Treatment::Masked, what, findings);
}

/// Turns of the output for each of the generator, and how far the output went.
///
/// The farthest two rows of each session give the ratio that clearance moves least; the median over pieces of the
/// sessions stands in where a jump has moved one of the two.
fn slope(log: &Log) -> Option<(f64, f64, f64)> {
    let (generator, output) = (log.get(Quantity::Generator)?, log.get(Quantity::Output)?);
    let mut whole: Option<(f64, f64)> = None;
    let mut pieces: Vec<(f64, f64)> = Vec::new();
    for rows in log.sessions() {
        if let Some(found) = extent(generator, output, rows.clone())
            && whole.is_none_or(|(psi, _)| found.0 > psi)
        {
            whole = Some(found);
        }
        let size = (rows.len() / 32).max(2);
        let ends = |start: usize| start..(start + size).min(rows.end);
        pieces.extend(rows.clone().step_by(size).filter_map(|start| extent(generator, output, ends(start))));
    }
    let (psi, delta) = whole.filter(|(psi, _)| *psi > 0.0)?;
    // An output that stands still says nothing of the ratio, unless it always does.
    if pieces.iter().any(|(_, delta)| *delta != 0.0) {
        pieces.retain(|(_, delta)| *delta != 0.0);
    }
    let median = typical_slope(pieces);
    let slope = if (delta / psi - median).abs() <= 0.1 * median.abs() { delta / psi } else { median };
    let travel = least_and_most(output.iter().copied());
    Some((slope, psi, travel.1 - travel.0))
}

/// The slope that half of all motion falls short of: a generator that froze and leaps on is one piece of many, however
/// far it leaps.
fn typical_slope(mut pieces: Vec<(f64, f64)>) -> f64 {
    pieces.retain(|(psi, _)| *psi > 0.0);
    pieces.sort_by(|a, b| (a.1 / a.0).total_cmp(&(b.1 / b.0)));
    let half = 0.5 * pieces.iter().map(|(psi, _)| psi).sum::<f64>();
    let mut passed = 0.0;
    let middle = pieces.iter().find(|(psi, _)| {
        passed += psi;
        passed >= half
    });
    middle.map_or(0.0, |(psi, delta)| delta / psi)
}

fn ratio(log: &mut Log, columns: &[MappedColumn], gear: &Gear, findings: &mut Findings) -> Result<(), Refusal> {
    let Some((slope, psi, travel)) = slope(log) else {
        findings.notes.push("the generator stands still: nothing that turns with it can be seen".to_owned());
        return Ok(());
    };
    // One for a drive with the ratio given.
    let found = slope * gear.ratio;
    if (RATIO_ERROR[0]..=RATIO_ERROR[1]).contains(&found) {
        return Ok(());
    }
    let expected = (psi / gear.ratio).abs();
    if expected < ENOUGH_MOTION_RAD && travel < ENOUGH_MOTION_RAD {
        findings.notes.push("too little motion to judge units by the ratio".to_owned());
        return Ok(());
    }
    let [(generator, _), (output, output_unit)] =
        [Quantity::Generator, Quantity::Output].map(|channel| column(columns, channel));
    let seen = format!(
        "{output} moves by {slope:.6} of {generator}, where the ratio {} asks for {:.6}",
        gear.ratio,
        1.0 / gear.ratio
    );
    if (found / gear.ratio.powi(2) - 1.0).abs() <= 2.5 * SAME {
        let what = format!("{seen}: the two columns are exchanged, and were put right");
        mismatch(log, None, Treatment::Repaired, what, findings);
        if let (Some(a), Some(b)) = (log.take(Quantity::Generator), log.take(Quantity::Output)) {
            log.put(Quantity::Generator, b);
            log.put(Quantity::Output, a);
        }
        return Ok(());
    }
    if let Some(other) = gear.other_wheel_ratio
        && travel > SHOWS_THE_WHEEL_RAD
        && (slope * other - 1.0).abs() <= OTHER_WHEEL
    {
        return Err(Refusal(format!(
            "{seen}: that is the ratio {other} of the same teeth with the other wheel fixed; allowed: the wheel that \
             is fixed in the drive measured"
        )));
    }
    if (found + 1.0).abs() <= 0.1 {
        let readings = vec![format!("--columns output={output}:-{output_unit}"), format!("the ratio {}", -gear.ratio)];
        return Err(other_reading(&seen, "the output counts the other way", &readings));
    }
    // A column in a unit other than the one given, by the ratio or by the turn after which it begins anew.
    let mut readings = Vec::new();
    for channel in [Quantity::Generator, Quantity::Output] {
        let (name, given) = column(columns, channel);
        for unit in Unit::ANGLES.into_iter().filter(|unit| *unit != given) {
            let scale = unit.factor() / given.factor();
            let ratio = if channel == Quantity::Generator { scale } else { scale.recip() };
            let within = |values: &[f64]| begins_anew(values, &[TAU / scale], false, None).is_some();
            if (found / ratio - 1.0).abs() <= SAME || log.get(channel).is_some_and(within) {
                readings.push(format!("--columns {channel}={name}:{unit}"));
            }
        }
    }
    if !readings.is_empty() {
        let why = "one of the two is in another unit, and no size says which for certain";
        return Err(other_reading(&seen, why, &readings));
    }
    Err(Refusal(if slope == 0.0 || (found.abs() < 0.05 && travel < ENOUGH_MOTION_RAD) {
        format!(
            "{output} does not follow: {generator} turns by {psi:.3} rad, {output} by {travel:.6} rad; allowed: an \
             output that turns"
        )
    } else {
        format!(
            "{seen}; allowed: within a factor of {} of it. Are columns, units ({}) and ratio right? They are mapped \
             with --columns generator=NAME:UNIT,output=NAME:UNIT",
            RATIO_ERROR[1],
            angles()
        )
    }))
}

/// The refusal of a reading, with the readings that are allowed.
pub(crate) fn other_reading(seen: &str, why: &str, readings: &[String]) -> Refusal {
    Refusal(format!("{seen}: {why}; allowed: {}", readings.join(", or ")))
}

/// The units of angles that one may take for another.
fn angles() -> String {
    Unit::ANGLES.map(Unit::name).join(", ")
}

/// Whether recorded errors have the size of errors.
fn error_size(log: &Log, columns: &[MappedColumn]) -> Result<(), Refusal> {
    let (Some(error), Some(generator)) = (log.get(Quantity::Error), log.get(Quantity::Generator)) else {
        return Ok(());
    };
    // Of fewer rows a straight line leaves nothing.
    if error.len() < FEWEST_ROWS {
        return Ok(());
    }
    // Freed of a straight line in the generator angle, which a wrong ratio gives.
    let step = error.len().div_ceil(20_000);
    let some: Vec<(f64, f64)> = generator.iter().copied().zip(error.iter().copied()).step_by(step).collect();
    let mut left: Vec<f64> = LineFit::of(&some).residual.iter().map(|left| left.abs()).collect();
    let spread = quantile_of(&mut left, 0.75);
    let (column, given) = column(columns, Quantity::Error);
    if spread > SPREADS_RAD[0] || (spread > 0.0 && spread < SPREADS_RAD[1]) {
        return Err(Refusal(format!(
            "{column}: found errors of {:e} {given}, allowed: between a thousandth of an arc-second and ten degrees. \
             Is its unit ({}) right? It is mapped with --columns error=NAME:UNIT",
            spread / given.factor(),
            angles()
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::typical_slope;
    use crate::measurement::{ColumnMap, FaultName, Gear, Quantity, Recording, Treatment, parse};

    /// A drive of ratio 50 to and fro under a load in N·m at a temperature in °C, each times and plus something; angles
    /// in radians times some number.
    fn read(columns: &str, torque: f64, celsius: f64, angles: [f64; 2]) -> Result<Recording, String> {
        read_of(&Gear::of_ratio(50.0), columns, torque, celsius, angles)
    }

    fn read_of(gear: &Gear, columns: &str, torque: f64, celsius: f64, angles: [f64; 2]) -> Result<Recording, String> {
        let mut text = "time_s,generator_rad,output_rad,torque_n_m,temperature_c\n".to_owned();
        for k in 0..1200 {
            let x = f64::from(k);
            let psi = 40.0 * (0.01 * x).sin();
            let load = 30.0 * (0.004 * x).sin();
            let output = psi / 50.0 + load / 3e4 + 2e-5 * (2.0 * psi).sin();
            let fields =
                [0.01 * x, angles[0] * psi, angles[1] * output, torque * load, 21.0 + 0.3 * (0.01 * x).sin() + celsius];
            text += &(fields.map(|field| format!("{field:.9}")).join(",") + "\n");
        }
        let map = ColumnMap::of_options(columns, None, None).unwrap();
        parse("m.csv", text.as_bytes(), &map, gear).map_err(|error| error.to_string())
    }

    /// The channel of the unit fault, what was done, and what is said.
    fn unit_fault(recording: &Recording) -> Option<(Option<Quantity>, Treatment, &str)> {
        let fault = recording.faults.iter().find(|fault| fault.name == FaultName::UnitMismatch)?;
        Some((fault.channel, fault.treatment, fault.what.as_str()))
    }

    #[test]
    fn a_torque_is_converted_on_the_word_of_the_user_alone() {
        // 30 N·m in mN·m and in N·cm of a very large drive: beyond what any drive bears, and not used.
        for (scale, units) in [(1e3, "mN.m (30.0000 N.m)"), (2e3, "N.cm (600.0000 N.m)")] {
            let found = read("", scale, 0.0, [1.0; 2]).unwrap();
            let (channel, treatment, what) = unit_fault(&found).unwrap();
            assert_eq!((channel, treatment), (Some(Quantity::Torque), Treatment::Masked));
            assert!(found.sessions[0].torque_n_m.is_none());
            assert!(what.contains("--columns torque=torque_n_m:N.cm"), "{what}");
            assert!(what.contains(units.split_once(' ').unwrap().0), "{what}");
        }
        let said = read("torque=torque_n_m:mN.m", 1e3, 0.0, [1.0; 2]).unwrap();
        assert_eq!(unit_fault(&said), None);
        let torque = said.sessions[0].torque_n_m.as_ref().unwrap();
        assert!((torque[392] - 30.0).abs() < 0.01, "{}", torque[392]);
        // One that a drive may bear stays as it is, however soft the drive then looks.
        let soft = read("", 0.112_985, 0.0, [1.0; 2]).unwrap();
        assert_eq!(unit_fault(&soft), None);
        assert!((soft.sessions[0].torque_n_m.as_ref().unwrap()[392] - 3.389_55).abs() < 1e-3);
        assert!(read("", 1e7, 0.0, [1.0; 2]).unwrap_err().contains("at most 1e4"));
        // 30 N·m in N·cm, where the drive would wind up by 5.7 degrees: asked, and believed where it is said.
        let gear = crate::nominal::Nominal::from_toml("n.toml", &crate::nominal::Nominal::template(98, 100)).unwrap();
        let gear = Gear { ratio: 50.0, plausible_torque_n_m: gear.gear().plausible_torque_n_m, ..Gear::of_ratio(50.0) };
        assert!((300.0..3000.0).contains(&gear.plausible_torque_n_m), "{}", gear.plausible_torque_n_m);
        let found = read_of(&gear, "", 100.0, 0.0, [1.0; 2]).unwrap();
        assert!(unit_fault(&found).unwrap().2.contains("--columns torque=torque_n_m:N.cm"));
        assert!(found.sessions[0].torque_n_m.is_none());
        assert_eq!(unit_fault(&read_of(&gear, "torque=torque_n_m:N.m", 100.0, 0.0, [1.0; 2]).unwrap()), None);
        assert_eq!(unit_fault(&read_of(&gear, "", 1.0, 0.0, [1.0; 2]).unwrap()), None);
    }

    #[test]
    fn a_temperature_is_converted_on_the_word_of_the_user_alone() {
        for (off, unit) in [(273.15, ":K"), (600.0, "")] {
            let found = read("", 1.0, off, [1.0; 2]).unwrap();
            let (channel, treatment, what) = unit_fault(&found).unwrap();
            assert_eq!((channel, treatment), (Some(Quantity::Temperature), Treatment::Masked));
            assert!(found.sessions[0].temperature_c.is_none());
            assert!(what.contains("is not used") && what.contains("temperature_c:K") == (unit == ":K"), "{what}");
        }
        let said = read("temperature=temperature_c:K", 1.0, 273.15, [1.0; 2]).unwrap();
        assert_eq!(unit_fault(&said), None);
        assert!((said.sessions[0].temperature_c.as_ref().unwrap()[0] - 21.0).abs() < 1e-6);
    }

    #[test]
    fn an_angle_in_another_unit_is_refused_with_the_mapping_that_mends_it() {
        let deg = 1f64.to_degrees();
        let said = read("", 1.0, 0.0, [deg, 1.0]).unwrap_err();
        assert!(said.ends_with("for certain; allowed: --columns generator=generator_rad:deg"), "{said}");
        assert_eq!(unit_fault(&read("generator=generator_rad:deg", 1.0, 0.0, [deg, 1.0]).unwrap()), None);
        let said = read("", 1.0, 0.0, [1.0, -1.0]).unwrap_err();
        assert!(said.ends_with("allowed: --columns output=output_rad:-rad, or the ratio -50"), "{said}");
        // Both are in degrees, one is said to be in radians; or both are in radians, and one is said to be in degrees:
        // no ratio decides which.
        for (angles, columns) in [
            ([deg; 2], "generator=generator_rad:rad,output=output_rad:deg"),
            ([1.0; 2], "generator=generator_rad:deg,output=output_rad:rad"),
        ] {
            let said = read(columns, 1.0, 0.0, angles).unwrap_err();
            assert!(said.contains("no size says which") && said.contains("generator=generator_rad:"), "{said}");
            assert!(said.contains("or --columns output=output_rad:"), "{said}");
        }
    }

    #[test]
    fn one_leap_of_a_generator_that_froze_does_not_change_the_ratio() {
        // Slow pieces of a drive of ratio 80, and the piece in which it leaps by more than six of them together.
        let mut pieces = vec![(10.0, 0.125); 20];
        pieces.push((70.0, 0.05));
        assert_eq!(typical_slope(pieces), 0.0125);
        assert_eq!(typical_slope(vec![(0.0, 0.0)]), 0.0);
    }
}
