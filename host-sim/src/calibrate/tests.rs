//! Units made up here, with parts that are known, by laws of their own.

use flexspline::Table;

use super::folds::Row;
use super::*;
use crate::drive::GeneratorKind;
use crate::measurement::Session;
use crate::nominal::Harmonic;
use crate::units::ARCSEC_PER_RAD;

const RATIO: f64 = 101.0;

/// Noise of two arc-seconds, normal enough.
fn noise(random: &mut fastrand::Rng) -> f64 {
    2.0 * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0)
}

/// A recording of one session: to and fro through 1.2 output turns under a load that swings, with an error by `law` (arcsec) of generator
/// angle, output angle, torque and direction.
fn recording(seed: u64, law: impl Fn(f64, f64, f64, f64) -> f64) -> Recording {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut session = Session { torque_n_m: Some(Vec::new()), ..Session::default() };
    let rows = 4000;
    for k in 0..rows {
        let forward = k < rows / 2;
        let psi = 0.38 * if forward { k as f64 } else { (rows - 1 - k) as f64 };
        let torque = 30.0 * (k as f64 / 61.0 + seed as f64).sin();
        let way = if forward { 1.0 } else { -1.0 };
        let error = law(psi, psi / RATIO, torque, way) + noise(&mut random);
        session.line.push(k as u64);
        session.generator_rad.push(psi);
        session.error_rad.push((error + 5000.0) / ARCSEC_PER_RAD);
        session.torque_n_m.as_mut().unwrap().push(torque);
    }
    Recording {
        file: format!("{seed}.log"),
        rows,
        sessions: vec![session],
        faults: Vec::new(),
        tooth_steps: Vec::new(),
        notes: Vec::new(),
        unusable: None,
    }
}

fn kept(calibration: &Calibration) -> Vec<&'static str> {
    calibration.parts.iter().filter(|part| part.kept).map(|part| part.name).collect()
}

#[test]
fn parts_that_a_unit_has_are_found_and_the_core_takes_them_out() {
    let law = |psi: f64, out: f64, torque: f64, way: f64| {
        25.0 * (2.0 * psi + 0.3).sin() + 120.0 * (out - 0.7).cos() + 1.5 * torque + 4e-4 * torque.powi(3) - 12.0 * way
    };
    let prior = Prior::of_ratio(RATIO, GeneratorKind::Cam);
    let made = calibrate(&[recording(1, law)], &prior).unwrap();
    let c = &made.calibration;
    assert_eq!(kept(c), ["wind_up", "play", "generator_angle", "output_angle"], "{:#?}", c.parts);
    // The noise is 2 arcsec.
    assert!(c.held_out.rms_after_arcsec < 2.2 && c.held_out.rms_before_arcsec > 90.0, "{:?}", c.held_out);
    assert!(c.core.rms_after_arcsec < 2.6, "{:?}", c.core);
    assert!(c.projection_rms_arcsec < 0.1, "{}", c.projection_rms_arcsec);
    // Another log of the same unit, which nobody has fitted, through the image.
    let other = recording(5, law);
    let table = Table::check(&made.table.image).unwrap();
    let left = left_by_core(&table, &other.sessions[0], 20.0);
    let mean = left.iter().sum::<f64>() / left.len() as f64;
    let rms = (left.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / left.len() as f64).sqrt();
    assert!(rms < 2.7, "{rms}");
    // With what is true known before, little is left to fit.
    let mut known = Prior::of_ratio(RATIO, GeneratorKind::Cam);
    known.nominal.harmonics.push(crate::nominal::Harmonic {
        order_per_generator_turn: 2.0,
        amplitude_arcsec: 25.0,
        phase_rad: 0.3,
    });
    let made = calibrate(&[recording(1, law)], &known).unwrap();
    assert_eq!(kept(&made.calibration), ["wind_up", "play", "output_angle"]);
    assert!(made.calibration.core.rms_after_arcsec < 2.6, "{:?}", made.calibration.core);
}

#[test]
fn noise_makes_no_table_and_lone_parts_no_others() {
    let prior = Prior::of_ratio(RATIO, GeneratorKind::Cam);
    for seed in 0..6 {
        let nothing = calibrate(&[recording(seed, |_, _, _, _| 0.0)], &prior);
        assert!(matches!(nothing, Err(CalibrationError::NothingGained(_))), "seed {seed}");
        let one = calibrate(&[recording(seed, |psi, _, _, _| 8.0 * (2.0 * psi).sin())], &prior).unwrap();
        assert_eq!(kept(&one.calibration), ["generator_angle"], "seed {seed}");
    }
}

#[test]
fn files_are_left_out_whole_each_with_its_zero() {
    let law = |_: f64, out: f64, torque: f64, _: f64| 60.0 * out.cos() + 2.0 * torque;
    let mut files: Vec<Recording> = (0..4).map(|seed| recording(seed, law)).collect();
    files[2].sessions[0].error_rad.iter_mut().for_each(|error| *error += 0.3);
    let made = calibrate(&files, &Prior::of_ratio(RATIO, GeneratorKind::Cam)).unwrap();
    let c = &made.calibration;
    assert_eq!((c.left_out, c.folds), ("files", 4));
    assert!(c.held_out.rms_after_arcsec < 2.2, "{:?}", c.held_out);
    assert!(c.core.rms_after_arcsec < 2.2, "{:?}", c.core);
}

/// A model of another drive has a wave that no part can take out: with a part that gains it still leaves more than no table.
#[test]
fn a_table_that_loses_to_none_is_not_made() {
    let files: Vec<Recording> = (0..4).map(|seed| recording(seed, |_, out, _, _| 60.0 * out.cos())).collect();
    let mut prior = Prior::of_ratio(RATIO, GeneratorKind::Cam);
    let other = Harmonic { order_per_generator_turn: 13.37, amplitude_arcsec: 300.0, phase_rad: 0.4 };
    prior.nominal.harmonics.push(other);
    let refused = calibrate(&files, &prior).err().map(|error| error.to_string()).unwrap_or_default();
    assert!(refused.starts_with("what was known before is further off"), "{refused}");
    prior.nominal.harmonics[0].amplitude_arcsec = 10.0;
    let made = calibrate(&files, &prior).unwrap();
    assert!(kept(&made.calibration).contains(&"output_angle"), "{:?}", made.calibration.parts);
}

#[test]
fn what_was_not_recorded_is_not_fitted() {
    let mut short = recording(3, |psi, _, _, _| 20.0 * (2.0 * psi).sin());
    let session = &mut short.sessions[0];
    session.line.truncate(500);
    session.generator_rad.truncate(500);
    session.error_rad.truncate(500);
    session.torque_n_m = None;
    let made = calibrate(&[short], &Prior::of_ratio(RATIO, GeneratorKind::Cam)).unwrap();
    let says = |name: &str| made.calibration.parts.iter().find(|part| part.name == name).unwrap().clone();
    for (name, why) in [
        ("wind_up", "no torque"),
        ("play", "one direction"),
        ("material_angle", "generator turns"),
        ("tooth_pitch", "teeth are not known"),
        ("output_angle", "of an output turn"),
        ("temperature", "no temperature"),
    ] {
        let part = says(name);
        assert!(!part.kept && part.held_out_gain.is_none() && part.why.contains(why), "{part:?}");
    }
    assert!(says("generator_angle").kept);
    let table = Table::check(&made.table.image).unwrap();
    assert_eq!(table.torque_range_n_m(), [0.0, 0.0]);
}

#[test]
fn a_sum_over_folds_is_the_fit_to_the_rows() {
    let scales = Scales { torque_n_m: [0.0; 2], friction_n_m: 0.0, temperature_c: [20.0; 2], teeth: 200.0 };
    let rows: Vec<Row> = (0..200)
        .map(|k| {
            let psi = 0.1 * f64::from(k);
            let at =
                State { generator_rad: psi, output_rad: psi / 101.0, torque_n_m: 0.0, temperature_c: 20.0, way: 1.0 };
            Row { at, left_arcsec: 7.0 * psi.sin() + 3.0, zero: 0, fold: k as usize / 50 }
        })
        .collect();
    let folds = Folds::new(&rows, &[PartName::GeneratorAngle], &scales, 1, false);
    assert_eq!(path(&folds, &folds.all())[1][0].part, PartName::GeneratorAngle);
    let chosen = [Chosen { part: PartName::GeneratorAngle, penalty: 1e-9 }];
    let fitted = folds.fit(&folds.all(), &chosen).unwrap();
    assert!((fitted[0] - 3.0).abs() < 1e-4 && (fitted[1] - 7.0).abs() < 1e-4, "{fitted:?}");
    assert!(folds.left_out(&folds.all(), &chosen) < 1e-4);
    // Without the part its sine is left, about a zero that others found.
    let alone = folds.left_out(&folds.all(), &[]);
    assert!(alone > 200.0 * 20.0 && alone < 200.0 * 35.0, "{alone}");
}
