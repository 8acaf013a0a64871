//! Rows of a drive of which a model or a table is known, with what the diagnosis says of the sign of their torque and
//! of angles in degrees, which no ratio shows.

use std::f64::consts::TAU;
use std::path::Path;

use flexspline::Table;

use crate::diagnosis::channels::{check_degrees, check_torque};
use crate::least_squares::Normal;
use crate::measurement::{
    ColumnMap, FEWEST_ROWS, FaultName, MeasuredError, Quantity, Recording, Refusal, Session, bytes_of, least_and_most,
    parse_at_least,
};
use crate::nominal::Nominal;
use flexspline_base::robust::mean;

/// Fewest rows that a table is played over. *Source*: one has no mean to be about.
pub(crate) const FEW: usize = 2;

/// Reads a file of rows of a drive with this model, and the table that takes its place where there is one.
///
/// # Errors
/// It cannot be read.
pub fn read_known(
    path: &Path,
    columns: &ColumnMap,
    nominal: &Nominal,
    table: Option<&Table<'_>>,
) -> Result<Recording, MeasuredError> {
    let (file, bytes) = bytes_of(path)?;
    parse_known(&file, &bytes, columns, nominal, table)
}

/// The same of rows that stand in memory.
///
/// # Errors
/// They cannot be read.
pub fn parse_known(
    file: &str,
    bytes: &[u8],
    columns: &ColumnMap,
    nominal: &Nominal,
    table: Option<&Table<'_>>,
) -> Result<Recording, MeasuredError> {
    let mut read = parse_at_least(FEW, file, bytes, columns, &nominal.gear())?;
    if read.sessions.iter().map(Session::len).sum::<usize>() < FEWEST_ROWS {
        return Ok(read);
    }
    check_degrees(&read, columns, nominal, table)?;
    check_waves(&read, columns, nominal.ratio)?;
    let torques: Vec<_> = read.sessions.iter().map(|session| session.torque_n_m.clone()).collect();
    let before = read.faults.len();
    check_torque(&mut read, nominal, table);
    if read.faults[before..].iter().any(|fault| fault.name != FaultName::TorqueSign) {
        read.sessions.iter_mut().zip(torques).for_each(|(session, torque)| session.torque_n_m = torque);
        let doubts = read.faults.drain(before..);
        let notes = doubts.map(|fault| format!("`diagnose` doubts the torque, which stays here: {}", fault.what));
        read.notes.extend(notes);
    }
    Ok(read)
}

/// Waves of the output that are no waves of the generator in degrees: as a table has them.
const OUTPUT_ORDERS: usize = 6;
/// Generator turns in degrees that tell waves from drift. *Guess*.
const MANY_TURNS: f64 = 10.0;
/// Share of the squares that the waves of the generator take in the reading that is meant, at least, and in the other,
/// at most. *Guesses*.
const REPEATS: [f64; 2] = [0.5, 0.1];
/// Rows that are looked at, about.
const LOOKED_AT: usize = 20_000;

/// Refuses angles that are in degrees where radians are read, which no ratio shows: the error repeats in each turn of
/// the generator in degrees and not in radians. A unit that the mapping says is believed.
fn check_waves(read: &Recording, columns: &ColumnMap, ratio: f64) -> Result<(), MeasuredError> {
    let (generator, said) = columns.column(Quantity::Generator);
    let of_degrees = 1f64.to_radians();
    let angles = || read.sessions.iter().flat_map(|session| session.generator_rad.iter().copied());
    let (from, to) = least_and_most(angles());
    if said || (to - from) * of_degrees < MANY_TURNS * TAU {
        return Ok(());
    }
    let every = read.sessions.iter().map(Session::len).sum::<usize>().div_ceil(LOOKED_AT).max(1);
    let rows = read.sessions.iter().flat_map(|session| {
        let zero = mean(&session.error_rad);
        session.states(0.0).zip(&session.error_rad).map(move |([psi, torque, _], error)| [psi, torque, error - zero])
    });
    let rows: Vec<[f64; 3]> = rows.step_by(every).collect();
    let waves = |psi: f64, orders: usize, row: &mut [f64]| {
        let values = (1..=orders).flat_map(|order| <[f64; 2]>::from((order as f64 * psi).sin_cos()));
        row.iter_mut().zip(values).for_each(|(place, value)| *place = value);
    };
    // Of the generator in radians (1), in degrees, or none.
    let left = |unit: Option<f64>| {
        let width = 2 + 2 * OUTPUT_ORDERS + 4 + if unit.is_some() { 4 } else { 0 };
        let fit = Normal::of(width, rows.len(), |k, row| {
            let [psi, torque, error] = rows[k];
            row[1] = torque;
            waves(psi / ratio, OUTPUT_ORDERS, &mut row[2..]);
            waves(of_degrees * psi / ratio, 2, &mut row[2 + 2 * OUTPUT_ORDERS..]);
            if let Some(unit) = unit {
                waves(unit * psi, 2, &mut row[6 + 2 * OUTPUT_ORDERS..]);
            }
            (error, 1.0)
        })?;
        Some(fit.sound(rows.len())?.misfit())
    };
    let (Some(none), Some(radians), Some(degrees)) = (left(None), left(Some(1.0)), left(Some(of_degrees))) else {
        return Ok(());
    };
    let [in_radians, in_degrees] = [radians, degrees].map(|left| 1.0 - left / none.max(f64::MIN_POSITIVE));
    if in_degrees < REPEATS[0] || in_radians > REPEATS[1] {
        return Ok(());
    }
    let output = columns.column(Quantity::Output).0;
    let seen = format!(
        "{generator}: waves of one and two to 2 pi of it take {:.0} % of the error that loads and the output leave, to \
         360 of it {:.0} %",
        100.0 * in_radians,
        100.0 * in_degrees
    );
    let readings = vec![
        format!("--columns generator={generator}:deg,output={output}:deg"),
        format!("generator={generator}:rad if they are not"),
    ];
    let why = "angles in degrees read as radians";
    Err(MeasuredError::of_file(&read.file, &Refusal::OtherReading { seen, why, readings }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesize::catalogue_drive;
    use flexspline_base::units::ARCSEC_PER_RAD;

    /// A model shows that angles are in degrees, which is refused, and that a torque counts the other way, which is put
    /// right; without one neither shows.
    #[test]
    fn angles_in_degrees_are_refused_and_a_turned_torque_is_put_right() {
        let nominal = catalogue_drive();
        let log = |angle: f64, torque: f64| {
            let mut random = fastrand::Rng::with_seed(3);
            let mut flank = 1.0;
            let mut text = "time_s,generator_rad,output_rad,torque_n_m\n".to_owned();
            for k in 0..6000 {
                let (t, psi) = (0.01 * f64::from(k), 0.05 * f64::from(k));
                let load = 25.0 * (0.9 * t).sin() + 6.0 * (2.3 * t).cos();
                if load.abs() > nominal.friction_torque_n_m {
                    flank = load.signum();
                }
                let noise = 2.0 * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0);
                let play = 0.5 * nominal.backlash_arcsec * flank;
                let error = nominal.harmonics_arcsec(psi) + nominal.wind_up_arcsec(load) + play + noise;
                let output = psi / nominal.ratio + error / ARCSEC_PER_RAD;
                text += &format!("{t:.2},{},{},{}\n", angle * psi, angle * output, torque * load);
            }
            text
        };
        let map = ColumnMap::default();
        let known = |log: String| parse_known("m.csv", log.as_bytes(), &map, &nominal, None).unwrap();
        let right = known(log(1.0, 1.0));
        assert_eq!(right.faults, []);
        let by_ratio = |log: &str| parse_at_least(FEW, "m.csv", log.as_bytes(), &map, &nominal.gear()).unwrap();
        let degrees = log(1f64.to_degrees(), 1.0);
        assert_eq!(by_ratio(&degrees).faults, []);
        let refused = parse_known("m.csv", degrees.as_bytes(), &map, &nominal, None).unwrap_err().to_string();
        assert!(refused.contains("angles in degrees"), "{refused}");
        let turned = log(1.0, -1.0);
        assert_eq!(by_ratio(&turned).faults, []);
        let read = known(turned);
        assert!(read.faults.len() == 1 && read.faults[0].what.contains("turned round"), "{:?}", read.faults);
        let (a, b) = (&read.sessions[0], &right.sessions[0]);
        assert!(a.error_rad == b.error_rad && a.torque_n_m == b.torque_n_m);
    }

    /// Of thirty rows six have a time of their own in their order.
    #[test]
    fn rows_that_are_too_few_for_a_diagnosis_are_read() {
        let row = |k: u32| {
            format!("{},{},{}\n", f64::from(37 * k * k % 101) / 60.0, 0.3 * f64::from(k), 0.3 * f64::from(k) / 100.0)
        };
        let log = "time_s,generator_rad,output_rad\n".to_owned() + &(0..30).map(row).collect::<String>();
        let read = parse_known("m.csv", log.as_bytes(), &ColumnMap::default(), &catalogue_drive(), None).unwrap();
        assert!(read.sessions.iter().map(Session::len).sum::<usize>() < FEWEST_ROWS, "{:?}", read.faults);
    }
}
