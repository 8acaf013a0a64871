//! Rows of a drive of which a model or a table is known, with what the diagnosis says of the sign of their torque and
//! of angles in degrees, which no ratio shows.

use flexspline::Table;

use crate::diagnosis::channels::{check_degrees, check_torque};
use crate::measurement::{ColumnMap, FEWEST_ROWS, FaultName, MeasuredError, Recording, Session, parse_at_least};
use crate::nominal::Nominal;

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
    check_degrees(&mut read, columns, nominal)?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesize::catalogue_drive;
    use flexspline_base::units::ARCSEC_PER_RAD;

    /// A model shows that a torque counts the other way, which is put right, also where each session keeps to one load;
    /// without a model it does not show.
    #[test]
    fn a_turned_torque_is_put_right() {
        let nominal = catalogue_drive();
        let log = |torque: f64, keeps: bool| {
            let mut random = fastrand::Rng::with_seed(3);
            let mut flank = 1.0;
            let mut text = "time_s,generator_rad,output_rad,torque_n_m\n".to_owned();
            for k in 0..6000 {
                let (t, psi) = (0.01 * f64::from(k) + 100.0 * f64::from(k / 1500), 0.05 * f64::from(k));
                let swings = 25.0 * (0.9 * t).sin() + 6.0 * (2.3 * t).cos();
                let load = if keeps { [-24.0, 12.0, 24.0, -12.0][k as usize / 1500] } else { swings };
                if load.abs() > nominal.friction_torque_n_m {
                    flank = load.signum();
                }
                let noise = 2.0 * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0);
                let play = 0.5 * nominal.backlash_arcsec * flank;
                let error = nominal.harmonics_arcsec(psi) + nominal.wind_up_arcsec(load) + play + noise;
                let output = psi / nominal.ratio + error / ARCSEC_PER_RAD;
                text += &format!("{t:.2},{psi},{output},{}\n", torque * load);
            }
            text
        };
        let map = ColumnMap::default();
        let known = |log: String| parse_known("m.csv", log.as_bytes(), &map, &nominal, None).unwrap();
        for keeps in [false, true] {
            let right = known(log(1.0, keeps));
            assert_eq!(right.faults, []);
            let by_ratio = |log: &str| parse_at_least(FEW, "m.csv", log.as_bytes(), &map, &nominal.gear()).unwrap();
            let turned = log(-1.0, keeps);
            assert_eq!(by_ratio(&turned).faults, []);
            let read = known(turned);
            assert!(read.faults.len() == 1 && read.faults[0].what.contains("turned round"), "{:?}", read.faults);
            let (a, b) = (&read.sessions[0], &right.sessions[0]);
            assert!(a.error_rad == b.error_rad && a.torque_n_m == b.torque_n_m);
        }
    }

    /// With the ratio alone the waves of the generator show degrees; without any, an error too large is asked about. A
    /// unit that is given is believed, and radians are read.
    #[test]
    fn degrees_are_refused_by_the_waves_of_the_generator_and_asked_about_without() {
        let log = |unit: f64, wave: f64| {
            let mut text = "generator_rad,output_rad,torque_n_m\n".to_owned();
            for k in 0..9000 {
                let psi = 0.08 * f64::from(k);
                let load = 20.0 * (0.004 * f64::from(k)).sin();
                let error = wave * (2.0 * psi).sin() + 60.0 * (psi / 100.0).cos() + 2.0 * load;
                text += &format!("{},{},{load}\n", unit * psi, unit * (psi / 100.0 + error / ARCSEC_PER_RAD));
            }
            text
        };
        let nominal = crate::calibrate::Prior::of_ratio(100.0, flexspline_mechanics::drive::GeneratorKind::Cam).nominal;
        let read = |map: &str, unit: f64, wave: f64| {
            let map = if map.is_empty() { ColumnMap::default() } else { ColumnMap::parse(map).unwrap() };
            let read = parse_known("m.csv", log(unit, wave).as_bytes(), &map, &nominal, None);
            read.map(|read| read.notes.join("; ")).map_err(|error| error.to_string())
        };
        for wave in [15.0, 0.0] {
            assert!(!read("", 1.0, wave).unwrap().contains("degrees"));
        }
        let refused = read("", 1f64.to_degrees(), 15.0).unwrap_err();
        assert!(refused.contains("degrees") && refused.contains("generator=generator_rad:deg"), "{refused}");
        let given = "generator=generator_rad:deg,output=output_rad:deg,torque=torque_n_m:N.m";
        assert!(read(given, 1f64.to_degrees(), 15.0).is_ok());
        let asked = read("", 1f64.to_degrees(), 0.0).unwrap();
        for reading in ["generator=generator_rad:deg,output=output_rad:deg", "generator=generator_rad:rad"] {
            assert!(asked.contains("in degrees") && asked.contains(reading), "{asked}");
        }
        assert!(!read(given, 1f64.to_degrees(), 0.0).unwrap().contains("degrees"));
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
