//! What the laws of the third family have of their own.

use super::*;

fn unit_c(drive: &Drive) -> Unit {
    Unit { family: Family::C, ..Unit::nominal(drive) }
}

/// What an effect of the third family adds to each row.
fn added(drive: &Drive, motion: &Motion, cause: Cause, size: f64, shape: &[f64]) -> Vec<f64> {
    let effect = Effect { what: What::Cause(cause), family: Family::C, size, shape: shape.to_vec() };
    let unit = unit_c(drive);
    let with = run(drive, &unit, motion, &[effect]).error_arcsec;
    with.iter().zip(run(drive, &unit, motion, &[]).error_arcsec).map(|(with, without)| with - without).collect()
}

/// A missing tooth of the flexspline: two pulses in each turn of the generator, on the loaded flank alone, higher and
/// wider with the cube root of the load.
#[test]
fn a_missing_tooth_shows_wider_under_load() {
    let drive = hhd();
    let missing = |torque, flank| {
        let motion = steady(1.0, torque);
        let pulse = added(&drive, &motion, Cause::DamagedTooth, 50.0, &[1.0, 0.0, flank, 0.3]);
        let height = pulse.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let share = pulse.iter().filter(|x| x.abs() > 1e-6).count() as f64 / pulse.len() as f64;
        (height, share, pulse.iter().sum::<f64>())
    };
    let (full, eighth) = (missing(25.0, 1.0), missing(25.0 / 8.0, 1.0));
    assert!((full.0 - 50.0).abs() < 0.1 && (eighth.0 - 25.0).abs() < 0.1, "{full:?} {eighth:?}");
    assert!((full.1 - 1.2 / TAU).abs() < 2e-3 && (eighth.1 - 0.6 / TAU).abs() < 2e-3, "{full:?} {eighth:?}");
    assert_eq!(missing(-25.0, 1.0).0, 0.0);
    assert!(full.2 > 0.0 && missing(-25.0, -1.0).2 < 0.0, "the output gives way to the load");
}

/// Even orders alone, less than where the generator is held and one zone carries, and still less where the load brings
/// in the other.
#[test]
fn a_displaced_axis_is_rectified_and_shared() {
    let drive = hhd();
    let lines_at = |torque| {
        let motion = steady(95.0, torque);
        let error = added(&drive, &motion, Cause::CircularSplineEccentricity, 20.0, &[0.3]);
        [1.0, 2.0, 3.0, 4.0].map(|order| line(&motion, &error, order * 94.0 / 95.0))
    };
    let (light, loaded) = (lines_at(1.01), lines_at(24.0));
    // Held and alone the first zone would show 0.424 of 20".
    assert!((4.0..8.4).contains(&light[1]) && light[3] > 0.7 && light[0] < 0.05 && light[2] < 0.05, "{light:?}");
    // What is left is mean - half + the gain of the load.
    assert!(loaded[1] < 0.7 * light[1] && loaded[3] < 0.7 * light[3], "{light:?} {loaded:?}");
}

/// Six bolts, three of them tighter: half of the radial second harmonic along the teeth, a sixth of the sixth, and the
/// flank's share of what opens; the third is not seen where both zones carry.
#[test]
fn bolts_leave_a_sixth_harmonic_and_hide_the_third() {
    let drive = hhd();
    let motion = steady(95.0, 24.0);
    let error = added(&drive, &motion, Cause::CircularSplineOvality, 20.0, &[0.3]);
    let at = |order: f64| line(&motion, &error, order * 94.0 / 95.0);
    let opens = 22.7_f64.to_radians().tan();
    assert!((at(2.0) - 20.0 * opens.hypot(0.5)).abs() < 0.2, "{}", at(2.0));
    assert!((at(6.0) - 20.0 * 0.12 * opens.hypot(1.0 / 6.0)).abs() < 0.1, "{}", at(6.0));
    assert!(at(3.0) < 0.02, "{}", at(3.0));
}

/// Teeth that hand over along a parabola: lines at the tooth number and its multiples, as one over the square.
#[test]
fn handover_along_a_parabola_has_lines_as_one_over_the_square() {
    let drive = hhd();
    let motion = steady(20.0, 20.0);
    let error = added(&drive, &motion, Cause::CamFormError, 10.0, &[0.3, 0.5]);
    let at = |multiple: f64| line(&motion, &error, 188.0 * multiple);
    for multiple in [2.0, 3.0, 4.0] {
        assert!((at(1.0) / at(multiple) / (multiple * multiple) - 1.0).abs() < 0.05, "{} {}", at(1.0), at(multiple));
    }
}

/// Teeth that are out of place independently of each other: many lines, none beyond what the arc averages.
#[test]
fn an_indexing_head_leaves_many_small_lines() {
    let drive = hhd();
    let motion = steady(95.0, 20.0);
    let shape = [0.3, 1.0, 0.3, 0.0, 0.0, 77.0];
    let error = added(&drive, &motion, Cause::FlexsplinePitchError, 20.0, &shape);
    let two = line(&motion, &error, 2.0);
    let even: Vec<f64> = (2..12).map(|k| line(&motion, &error, f64::from(2 * k))).collect();
    assert!((15.0..20.5).contains(&two), "{two}");
    assert!(
        even.iter().filter(|line| **line > 0.2).count() > 3 && even.iter().all(|line| *line < 0.35 * two),
        "{even:?}"
    );
    // Nothing is left of the 36th and beyond.
    assert!(line(&motion, &error, 38.0) < 0.1);
}

/// The age of a reading has the mean that is stated and sweeps to both sides of it.
#[test]
fn the_age_of_a_reading_sweeps_around_its_mean() {
    let drive = hhd();
    let motion = steady(40.0, 20.0);
    let late = added(&drive, &motion, Cause::SensorLatency, 1e-3, &[0.5]);
    let expected = 4.0 / 95.0 * 1e-3 * ARCSEC;
    // Whole beats.
    let beat = (BEAT_S / motion.step_s).round() as usize;
    let beats = &late[beat..8 * beat];
    let mean = beats.iter().sum::<f64>() / beats.len() as f64;
    assert!((mean + expected).abs() < 0.01 * expected, "{mean} {expected}");
    let (least, most) = beats.iter().fold((0.0, f64::MIN), |(a, b): (f64, f64), x| (a.min(*x), b.max(*x)));
    assert!((least + 1.5 * expected).abs() < 0.01 && (most + 0.5 * expected).abs() < 0.01, "{least} {most}");
}

/// Another count per turn of the generator's encoder: its column is stretched, and the error grows with the angle.
#[test]
fn a_wrong_count_per_turn_stretches_the_generator_column() {
    let drive = hhd();
    let motion = steady(95.0, 20.0);
    let effect = Effect { what: What::Cause(Cause::RatioError), family: Family::C, size: 1e-4, shape: vec![] };
    let readings = run(&drive, &unit_c(&drive), &motion, &[effect]);
    let last = readings.generator_rad.len() - 1;
    let turned = motion.generator_rad[last];
    assert!((readings.generator_rad[last] / turned - (1.0 - 1e-4)).abs() < 1e-12);
    let grown = readings.error_arcsec[last] - readings.error_arcsec[0];
    assert!((grown - 1e-4 * turned / 95.0 * ARCSEC).abs() < 1e-6, "{grown}");
}

/// Two heads a third of a turn apart read half of the disc's eccentricity: an almost pure sine of the stated amplitude.
#[test]
fn two_heads_a_third_of_a_turn_apart_leave_a_sine() {
    let drive = hhd();
    let motion = steady(95.0, 20.0);
    let error = added(&drive, &motion, Cause::GeneratorEncoderEccentricity, 20.0, &[0.4]);
    assert!((line(&motion, &error, 1.0) - 20.0).abs() < 0.05);
    // The disc is off by twice the amplitude at the generator, whose square over four is left.
    let at_generator = 20.0 * 95.0 / ARCSEC;
    assert!((line(&motion, &error, 2.0) - 20.0 * at_generator).abs() < 0.01);
}

/// The climb of the teeth takes half a turn of the generator and has no step in it.
#[test]
fn teeth_climb_in_half_a_turn() {
    let drive = hhd();
    let motion = steady(20.0, 20.0);
    let climb = added(&drive, &motion, Cause::Ratcheting, 1.0, &[0.5]);
    let pitch = TAU / 190.0 * ARCSEC;
    let begins = climb.iter().position(|x| x.abs() > 1e-6).unwrap();
    let ends = climb.iter().position(|x| (x - pitch).abs() < 1e-6).unwrap();
    let turned = motion.generator_rad[ends] - motion.generator_rad[begins];
    assert!((turned - std::f64::consts::PI).abs() < 0.05, "{turned}");
    assert!(climb.windows(2).all(|pair| pair[1] - pair[0] > -1e-6 && pair[1] - pair[0] < 0.01 * pitch));
}

/// Growth that is uneven around the flexspline: less than its full width without load, all of it where both zones
/// share.
#[test]
fn the_tighter_zone_holds_where_one_side_is_worn_more() {
    let drive = hhd();
    let width = |torque: f64| {
        let motion = |torque| steady(20.0, torque);
        let mean = |motion: &Motion| {
            let all = added(&drive, motion, Cause::BacklashGrowth, 60.0, &[0.3]);
            all.iter().sum::<f64>() / all.len() as f64
        };
        mean(&motion(torque)) - mean(&motion(-torque))
    };
    let (light, loaded) = (width(1.01), width(24.0));
    assert!(light > 50.0 && light < 59.0 && loaded > light && loaded < 60.0, "{light} {loaded}");
}
