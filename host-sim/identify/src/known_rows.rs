//! Rows of a drive of which a model or a table is known, with what the diagnosis says of the sign of their torque and
//! of angles in degrees, which no ratio shows.

use std::f64::consts::TAU;

use flexspline::Table;

use crate::diagnosis::channels::{check_degrees, check_torque};
use crate::least_squares::Normal;
use crate::measurement::{
    ColumnMap, FEWEST_ROWS, FaultName, MeasuredError, Quantity, Recording, Refusal, Session, least_and_most,
    parse_at_least,
};
use crate::nominal::Nominal;
use flexspline_base::statistics::mean;
use flexspline_base::units::ARCSEC_PER_RAD;

/// Fewest rows that a table is played over. *Source*: one has no mean to be about.
pub(crate) const FEW: usize = 2;

/// Reads rows of a drive with this model, and the table that takes its place where there is one: `bytes` of a file
/// called `file`.
///
/// # Errors
/// They cannot be read.
pub fn parse_known(
    file: &str,
    bytes: impl Into<Vec<u8>>,
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

/// Generator turns in degrees that tell waves from drift. *Guess*.
const MANY_TURNS: f64 = 10.0;
/// The reading that is meant leaves less than this share of the squares that the other leaves. *Guess*.
const LEAVES: f64 = 0.5;
/// Rows that are looked at, about.
const LOOKED_AT: usize = 20_000;

/// Refuses angles that are in degrees where radians are read, which no ratio shows: the error repeats in each turn of
/// the generator in degrees and not in radians. A unit that the mapping says is believed.
fn check_waves(read: &Recording, columns: &ColumnMap, ratio: f64) -> Result<(), MeasuredError> {
    let (generator, said) = columns.column(Quantity::Generator);
    let degree = 1f64.to_radians();
    let (from, to) = least_and_most(read.sessions.iter().flat_map(|session| session.generator_rad.iter().copied()));
    if said || (to - from) * degree < MANY_TURNS * TAU {
        return Ok(());
    }
    let rows = read.sessions.iter().flat_map(|session| {
        let zero = mean(&session.error_rad);
        session.states(0.0).zip(&session.error_rad).map(move |([psi, torque, _], error)| [psi, torque, error - zero])
    });
    let count: usize = read.sessions.iter().map(Session::len).sum();
    let rows: Vec<[f64; 3]> = rows.step_by(count.div_ceil(LOOKED_AT).max(1)).collect();
    // Load, and waves of the output in either unit, as many as a table has, and of the generator in one.
    let left = |unit: f64| {
        let fit = Normal::of(22, rows.len(), |k, row| {
            let [psi, torque, error] = rows[k];
            let waves = [(psi / ratio, 6), (degree * psi / ratio, 2), (unit * psi, 2)].into_iter();
            let orders = waves.flat_map(|(angle, most)| (1..=most).map(move |order| f64::from(order) * angle));
            row[1] = torque;
            let pairs = row[2..].chunks_exact_mut(2);
            pairs.zip(orders).for_each(|(pair, angle)| (pair[0], pair[1]) = angle.sin_cos());
            (error, 1.0)
        });
        fit.map(|fit| fit.misfit())
    };
    let Some((radians, degrees)) = left(1.0).zip(left(degree)).filter(|(rad, deg)| *deg < LEAVES * rad) else {
        return Ok(());
    };
    let output = columns.column(Quantity::Output).0;
    let rms = |squares: f64| (squares / rows.len() as f64).sqrt() * ARCSEC_PER_RAD;
    let seen = format!(
        "with load and waves of the output, waves of {generator} to 2 pi have a residual of {:.0} arcsec rms, to \
         360 {:.0}",
        rms(radians),
        rms(degrees)
    );
    let why = "angles in degrees read as radians";
    let readings = vec![
        format!("--columns generator={generator}:deg,output={output}:deg"),
        format!("--columns generator={generator}:rad,output={output}:rad if they are not"),
    ];
    Err(MeasuredError::of_file(&read.file, &Refusal::OtherReading { seen, why, readings }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesize::catalogue_drive;

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

    /// With the ratio alone the waves of the generator show degrees; a unit that is given is believed, and radians are
    /// read.
    #[test]
    fn degrees_are_refused_by_the_waves_of_the_generator() {
        let log = |unit: f64| {
            let mut text = "generator_rad,output_rad,torque_n_m\n".to_owned();
            for k in 0..9000 {
                let psi = 0.08 * f64::from(k);
                let load = 20.0 * (0.004 * f64::from(k)).sin();
                let error = 15.0 * (2.0 * psi).sin() + 60.0 * (psi / 100.0).cos() + 2.0 * load;
                text += &format!("{},{},{load}\n", unit * psi, unit * (psi / 100.0 + error / ARCSEC_PER_RAD));
            }
            text
        };
        let nominal = crate::calibrate::Prior::of_ratio(100.0, flexspline_mechanics::drive::GeneratorKind::Cam).nominal;
        let read = |map: &str, unit: f64| {
            let map = if map.is_empty() { ColumnMap::default() } else { ColumnMap::parse(map).unwrap() };
            parse_known("m.csv", log(unit).as_bytes(), &map, &nominal, None).map_err(|error| error.to_string())
        };
        assert!(read("", 1.0).is_ok());
        let refused = read("", 1f64.to_degrees()).unwrap_err();
        assert!(refused.contains("degrees") && refused.contains("generator=generator_rad:deg"), "{refused}");
        let given = "generator=generator_rad:deg,output=output_rad:deg,torque=torque_n_m:N.m";
        assert!(read(given, 1f64.to_degrees()).is_ok());
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
