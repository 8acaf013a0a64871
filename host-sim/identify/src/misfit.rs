//! Reasons why a table leaves much of measured rows: the torque counts the other way, the load at each angle is another
//! than when the table was made, or the two angles are not of one instant. Each is held against the rows by what the
//! table would leave with it.

use flexspline::Table;

use super::replay::{MeasuredRow, by_core};
use crate::calibrate::TURNS_WITH_THE_OUTPUT;
use crate::least_squares::FreeSpan;
use flexspline_base::units::ARCSEC_PER_RAD;

/// Rows that are looked at, about.
const LOOKED_AT: usize = 2000;
/// A reason has to leave less than this share of what the table leaves as the rows stand. *Guess*.
pub(crate) const LEAVES: f64 = 0.7;

/// What a table would leave of rows, arcsec rms: with the torque's sign turned; with another spring and another first
/// wave of the output; and, where the table is of rows whose delay was taken out, without a delay; each where that is
/// clearly less than the table leaves as they stand, and than they have without it, as a table that still takes nothing
/// is no table of these rows. Another spring is asked where the load goes with the output's angle: a table of rows in
/// one posture has the one for the other.
pub(crate) fn explained(table: &Table<'_>, rows: &[MeasuredRow], has_delay: bool) -> [Option<f64>; 3] {
    let every = rows.len().div_ceil(LOOKED_AT).max(1);
    // The pace, also without a time: what the generator turns from row to row.
    let turned = |k: usize| match rows.get(k + 1) {
        Some(next) if has_delay && next.session == rows[k].session => next.generator_rad - rows[k].generator_rad,
        _ => 0.0,
    };
    let pace: Vec<f64> = (0..rows.len()).step_by(every).map(turned).collect();
    let rows: Vec<&MeasuredRow> = rows.iter().step_by(every).collect();
    let residual = |sign: f64| -> Vec<f64> {
        let states = rows.iter().map(|row| [row.generator_rad, sign * row.torque_n_m, row.temperature_c]);
        let said = by_core(table, states).map(|said| f64::from(said.transmission_error_rad) * ARCSEC_PER_RAD);
        rows.iter().zip(said).map(|(row, said)| row.error_arcsec - said).collect()
    };
    let column = |of: &dyn Fn(&MeasuredRow) -> f64| rows.iter().map(|row| of(row)).collect::<Vec<f64>>();
    let ratio = table.drive().exact_ratio();
    let wave = |of: fn(f64) -> f64| column(&|row| of(row.generator_rad / ratio));
    let (as_it_stands, torque) = (residual(1.0), column(&|row| row.torque_n_m));
    let waves = [wave(|_| 1.0), wave(f64::sin), wave(f64::cos)];
    let goes_with_angle = correlation(&torque, &waves) > TURNS_WITH_THE_OUTPUT;
    let without_delay = FreeSpan::default().beyond([waves[0].clone(), pace.clone()]).freed(as_it_stands.clone());
    let span = FreeSpan::default().beyond(waves.into_iter().chain([torque, pace]));
    let other_load = span.freed(without_delay.clone());
    let most = about_mean(&column(&|row| row.error_arcsec));
    let clearly_less =
        |left: &[f64], than: &[f64]| Some(about_mean(left)).filter(|left| *left < LEAVES * about_mean(than).min(most));
    [
        clearly_less(&residual(-1.0), &as_it_stands),
        clearly_less(&other_load, &without_delay).filter(|_| goes_with_angle),
        clearly_less(&without_delay, &as_it_stands),
    ]
}

/// Correlation of a load with what waves make of it, a constant among them, 0 to 1.
pub(crate) fn correlation(load: &[f64], waves: &[Vec<f64>]) -> f64 {
    let beside = FreeSpan::default().beyond(waves.to_vec()).freed(load.to_vec());
    (1.0 - (about_mean(&beside) / about_mean(load)).powi(2)).max(0.0).sqrt()
}

/// Root mean square about the mean.
pub(super) fn about_mean(values: &[f64]) -> f64 {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline::{GeneratorAngle, PlayState};
    use flexspline_design::tables::{SampleOptions, from_samples, samples};
    use flexspline_mechanics::drive::{Drive, GeneratorKind};

    /// Rows of the drive of a table, loaded there and back, whose torque counts the other way; as it should; and none;
    /// and whose error goes with the speed.
    #[test]
    fn a_torque_of_the_wrong_sign_and_a_delay_are_reported_and_no_other() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/firmware/samples/cam.samples.csv");
        let bytes = std::fs::read(file).unwrap();
        let read = samples::parse("cam", &bytes).unwrap();
        let options = SampleOptions::default();
        let made = from_samples(&Drive::hhd_95(), GeneratorKind::Cam, &read, "cam", &bytes, options).unwrap();
        let table = Table::check(&made.image).unwrap();
        let rows = |load_n_m: f64, sign: f64, late: f64| -> Vec<MeasuredRow> {
            let mut play = PlayState::unknown();
            let mut generator_rad = 0.0;
            let row = |k: u32| {
                let turned = 0.3 + 0.2 * (0.02 * f64::from(k)).sin();
                generator_rad += turned;
                let torque_n_m = load_n_m * (0.01 * f64::from(k)).sin();
                let generator = GeneratorAngle::from_rad(generator_rad).unwrap();
                let said = table.forward(&mut play, generator, torque_n_m as f32, 20.0);
                let error_arcsec = f64::from(said.transmission_error_rad) * ARCSEC_PER_RAD + late * turned;
                MeasuredRow {
                    generator_rad,
                    error_arcsec,
                    torque_n_m: sign * torque_n_m,
                    temperature_c: 20.0,
                    session: 0,
                }
            };
            (0..1500).map(row).collect()
        };
        let torque_turned = |rows: Vec<MeasuredRow>| explained(&table, &rows, false)[0];
        assert!(torque_turned(rows(100.0, -1.0, 0.0)).is_some_and(|left| left < 1.0));
        assert_eq!(torque_turned(rows(100.0, 1.0, 0.0)), None);
        assert_eq!(torque_turned(rows(0.0, -1.0, 0.0)), None);
        let late = rows(100.0, 1.0, 90.0);
        assert!(matches!(explained(&table, &late, true), [None, None, Some(left)] if left < 2.0));
        assert_eq!(explained(&table, &late, false), [None; 3]);
    }

    /// An arm whose load is the wave of its eccentric encoder: the table has a spring that is not there, and in another
    /// posture the torque's sign explains the rows as the load does. Both are named, and that it is worse than none.
    /// Without a load the rows say nothing of that, but the calibration does.
    #[test]
    fn another_posture_is_a_reason_as_good_as_a_sign() {
        use crate::calibrate::{Prior, calibrate};
        use crate::measurement::{ColumnMap, Gear, parse};
        use crate::replay::{read, replay};
        let log = |posture: f64, load: f64| {
            let mut text = "generator_rad,output_rad,torque_n_m\n".to_owned();
            for k in 0..6000 {
                let psi = 0.06 * f64::from(if k < 3000 { k } else { 6000 - k });
                let torque = load * (psi / 50.0 + posture).sin();
                let error = 15.0 * (2.0 * psi).sin() + 60.0 * (psi / 50.0).cos();
                text += &format!("{psi},{},{torque}\n", psi / 50.0 + error / ARCSEC_PER_RAD);
            }
            text
        };
        let upright = std::f64::consts::FRAC_PI_2;
        let learnt =
            parse("a.csv", log(upright, 25.0).as_bytes(), &ColumnMap::default(), &Gear::of_ratio(50.0)).unwrap();
        let made = calibrate(&[learnt], &Prior::of_ratio(50.0, GeneratorKind::Cam)).unwrap();
        let table = Table::check(&made.table.image).unwrap();
        let said = |log: String| {
            let rows = read("b.csv", log.as_bytes(), &ColumnMap::default(), &table, 20.0, true).unwrap().rows;
            let written = serde_json::to_value(&made.calibration).unwrap();
            replay(&table, &rows, serde_json::from_value(written).unwrap()).1.remarks.join("\n")
        };
        let same = said(log(upright, 25.0));
        assert!(!same.contains("posture") && !same.contains("calibrated on"), "{same}");
        let none = said(log(upright, 0.0));
        assert!(none.contains("under other loads, or none") && !none.contains("generator zero"), "{none}");
        let other = said(log(upright + 2.8, 25.0));
        for what in ["another posture or payload", "wrong sign", "worse than none", "several reasons"] {
            assert!(other.contains(what), "{other}");
        }
    }
}
