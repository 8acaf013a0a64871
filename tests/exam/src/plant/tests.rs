//! The plant against its own claims: the nominal model where nothing is hidden, convergence in the step, and each
//! effect at the orders that theory gives it.

use super::*;
use crate::bench::rms;
use crate::chance::Chance;
use crate::motion::Poor;
use crate::outside::Outside;
use std::f64::consts::TAU;

mod family_c;

/// Nominal output as the format of nominal.toml describes it, written once more and differently: error at each point.
fn nominal(drive: &Drive, motion: &Motion) -> Vec<f64> {
    let half = 0.5 * drive.backlash_arcsec;
    let mut at_rest: Option<f64> = None;
    (0..motion.time_s.len())
        .map(|at| {
            let (psi, load) = (motion.generator_rad[at], motion.torque_n_m[at]);
            let lines: f64 =
                drive.harmonics.iter().map(|h| h.amplitude_arcsec * (h.order_per(psi) + h.phase_rad).sin()).sum();
            let teeth = psi / drive.ratio() * ARCSEC + lines;
            let mut position = at_rest.unwrap_or(teeth);
            if load.abs() > drive.friction_torque_n_m {
                position = teeth + half * load.signum();
            }
            position = position.min(teeth + half).max(teeth - half);
            at_rest = Some(position);
            position - psi / drive.ratio() * ARCSEC + drive.wind_up_arcsec(load)
        })
        .collect()
}

impl crate::drive::Harmonic {
    fn order_per(&self, psi: f64) -> f64 {
        self.order * psi
    }
}

fn setting(index: u64, poor: &[Poor]) -> (Drive, Motion) {
    let mut chance = Chance::new(11, "plant", index);
    let drive = Drive::draw(&mut chance);
    let motion = Motion::draw(&drive, poor, &mut chance);
    (drive, motion)
}

#[test]
fn a_nominal_unit_follows_the_nominal_model() {
    for index in 0..8 {
        let (drive, motion) = setting(index, &[]);
        let error = run(&drive, &Unit::nominal(&drive), &motion, &[]).error_arcsec;
        let expected = nominal(&drive, &motion);
        let expected: Vec<f64> = motion.picks(motion.stride).into_iter().map(|at| expected[at]).collect();
        let worst = error.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-6, "case {index}: {worst} arcsec");
    }
}

#[test]
fn a_unit_within_its_spread_deviates_by_no_more_than_the_spread_allows() {
    for index in 0..8 {
        let (drive, motion) = setting(index, &[]);
        let unit = Unit { offset_arcsec: 0.0, ..Unit::draw(&drive, Family::A, &mut Chance::new(11, "unit", index)) };
        let error = run(&drive, &unit, &motion, &[]).error_arcsec;
        let nominal = run(&drive, &Unit::nominal(&drive), &motion, &[]).error_arcsec;
        let deviation: Vec<f64> = error.iter().zip(&nominal).map(|(a, b)| a - b).collect();
        let lines: f64 = drive.harmonics.iter().map(|h| (0.55 * h.amplitude_arcsec).powi(2)).sum();
        let allowed = 2.5 * 0.03 * drive.wind_up_arcsec(drive.rated_n_m)
            + 2.5 * 0.05 * 0.5 * drive.backlash_arcsec
            + lines.sqrt();
        let spread = rms(&deviation);
        assert!(spread > 0.02 && spread < allowed, "case {index}: {spread} of {allowed}");
    }
}

/// A step four times finer moves no reading by more than 0.1 arcsec where flanks do not change, for every effect.
#[test]
fn the_step_has_converged() {
    let (drive, motion) = setting(3, &[Poor::Short]);
    let fine = motion.refined(4);
    let everything = Cause::ALL.iter().map(|c| What::Cause(*c)).chain(Outside::ALL.iter().map(|o| What::Outside(*o)));
    for what in everything {
        // Random in time or jumping: no step to converge in.
        if let What::Cause(Cause::Ratcheting) | What::Outside(Outside::RandomTelegraph | Outside::VibrationBursts) =
            what
        {
            continue;
        }
        for family in Family::ALL {
            let unit = Unit { family, ..Unit::nominal(&drive) };
            let mut effect = Effect::draw(what, family, &drive, &mut Chance::new(4, what.name(), 0));
            let (low, high) = what.spec(&drive).range;
            effect.size = (low * high).sqrt().copysign(effect.size);
            let coarse = run(&drive, &unit, &motion, &[effect.clone()]).error_arcsec;
            let better = run(&drive, &unit, &fine, &[effect]).error_arcsec;
            let mut apart: Vec<f64> = coarse.iter().zip(&better).map(|(a, b)| (a - b).abs()).collect();
            apart.sort_by(f64::total_cmp);
            let at = |share: f64| apart[(share * (apart.len() - 1) as f64) as usize];
            // Where a flank changes between two points, the finer step sees it earlier: a few rows.
            println!(
                "{:<34} {family:?} median {:.4} 99 % {:.4} largest {:.3}",
                what.name(),
                at(0.5),
                at(0.99),
                at(1.0)
            );
            assert!(at(0.99) < 0.1, "{} {family:?}: {} arcsec", what.name(), at(0.99));
        }
    }
}

/// A steady run of many turns, loaded forward: orders can be read off.
fn steady(turns: f64, torque_n_m: f64) -> Motion {
    let count = 60_000;
    let speed = 4.0;
    let step_s = turns * TAU / speed / f64::from(count);
    let of = |value: f64| vec![value; count as usize];
    Motion {
        step_s,
        stride: 1,
        time_s: (0..count).map(|at| f64::from(at) * step_s).collect(),
        generator_rad: (0..count).map(|at| f64::from(at) * step_s * speed).collect(),
        speed_rad_s: of(speed),
        torque_n_m: of(torque_n_m),
        temperature_c: of(20.0),
        orientation_rad: of(0.0),
        session_start: vec![0],
        orientation_known: true,
    }
}

/// Amplitude of a line over the generator angle.
fn line(motion: &Motion, error: &[f64], order: f64) -> f64 {
    let mut sum = (0.0, 0.0);
    let mean = error.iter().sum::<f64>() / error.len() as f64;
    for (psi, e) in motion.generator_rad.iter().zip(error) {
        let (s, c) = (order * psi).sin_cos();
        sum = (sum.0 + (e - mean) * s, sum.1 + (e - mean) * c);
    }
    2.0 * sum.0.hypot(sum.1) / error.len() as f64
}

fn hhd() -> Drive {
    let (mut drive, _) = setting(0, &[Poor::Short]);
    (drive.flexspline_teeth, drive.circular_spline_teeth, drive.fixed) = (188, 190, Fixed::Flexspline);
    drive.stiffness = vec![(0.0, 3e4)];
    drive.backlash_arcsec = 60.0;
    drive.friction_torque_n_m = 1.0;
    drive.rated_n_m = 25.0;
    drive.harmonics.clear();
    drive
}

#[test]
fn each_effect_stands_at_its_order() {
    let moving = 94.0 / 95.0;
    // Cause, orders where it stands, orders where it does not, load.
    let table: &[(Cause, &[f64], &[f64], f64)] = &[
        (Cause::CircularSplineEccentricity, &[2.0 * moving, 4.0 * moving], &[2.0, 1.0, moving], 1.5),
        (Cause::FlexsplineRunout, &[2.0, 4.0], &[2.0 * moving, 1.0], 1.5),
        (Cause::GravitySideLoad, &[2.0, 4.0], &[2.0 * moving, 1.0], 1.5),
        (Cause::CircularSplineOvality, &[2.0 * moving], &[2.0, moving], 20.0),
        (Cause::FlexsplinePitchError, &[2.0], &[2.0 * moving], 20.0),
        (Cause::CircularSplinePitchError, &[2.0 * moving], &[2.0], 20.0),
        (Cause::GeneratorEccentricity, &[1.0, moving], &[0.5, 1.0 / 95.0], 1.5),
        (Cause::CamFormError, &[188.0], &[2.0, 190.0], 20.0),
        (Cause::OutputEncoderEccentricity, &[1.0 / 95.0], &[1.0, 2.0], 20.0),
        (Cause::GeneratorEncoderEccentricity, &[1.0], &[moving], 20.0),
        (Cause::GravityTorque, &[1.0 / 95.0], &[1.0, 2.0], 20.0),
    ];
    let drive = hhd();
    for (cause, stands, stands_not, torque) in table {
        for family in Family::ALL {
            let motion = steady(190.0, *torque);
            let unit = Unit { family, ..Unit::nominal(&drive) };
            let mut effect = Effect::draw(What::Cause(*cause), family, &drive, &mut Chance::new(2, "orders", 1));
            effect.size = if *cause == Cause::GravityTorque { 5.0 } else { 20.0 };
            let error = run(&drive, &unit, &motion, &[effect]).error_arcsec;
            for order in *stands {
                let found = line(&motion, &error, *order);
                assert!(found > 0.7, "{} {family:?}: {found} at order {order}", cause.name());
            }
            for order in *stands_not {
                let found = line(&motion, &error, *order);
                assert!(found < 0.25, "{} {family:?}: {found} at order {order}", cause.name());
            }
        }
    }
}

/// Closed form: eccentricity of 10 µm on 48.7 mm, one flank, light load: 19.5" at order two and 3.9" at four.
#[test]
fn ten_micrometres_of_eccentricity() {
    // Wide enough that the flanks do not clash.
    let drive = Drive { backlash_arcsec: 200.0, ..hhd() };
    let motion = steady(95.0, 1.01);
    let amplitude = 0.010 / 48.7 / 24.4_f64.to_radians().cos() * ARCSEC;
    let effect = Effect {
        what: What::Cause(Cause::CircularSplineEccentricity),
        family: Family::A,
        size: amplitude,
        shape: vec![0.3],
    };
    let unit = Unit { tooth_stiffness: 1e6, ..Unit::nominal(&drive) };
    let error = run(&drive, &unit, &motion, &[effect]).error_arcsec;
    let (two, four) = (line(&motion, &error, 2.0 * 94.0 / 95.0), line(&motion, &error, 4.0 * 94.0 / 95.0));
    assert!((two - 19.5).abs() < 0.5 && (four - 3.9).abs() < 0.2, "{two} {four}");
}

#[test]
fn an_eccentric_generator_fades_under_load() {
    let drive = hhd();
    // Family A: gone once both zones are in. The others share more and more.
    for (family, left) in [(Family::A, 0.1), (Family::B, 0.96), (Family::C, 0.35)] {
        let effect = Effect {
            what: What::Cause(Cause::GeneratorEccentricity),
            family,
            size: 10.0,
            shape: vec![0.3, 1.0, 0.5, 0.7],
        };
        let unit = Unit { family, ..Unit::nominal(&drive) };
        let at_load = |torque| {
            let motion = steady(95.0, torque);
            line(&motion, &run(&drive, &unit, &motion, std::slice::from_ref(&effect)).error_arcsec, 1.0)
        };
        let (light, loaded) = (at_load(1.5), at_load(24.0));
        assert!(light > 3.0 && loaded < left * light, "{family:?}: {light} {loaded}");
    }
}

#[test]
fn a_delay_is_the_output_speed_times_the_delay() {
    let drive = hhd();
    let motion = steady(20.0, 20.0);
    let error_at = |size| {
        let effect = Effect { what: What::Cause(Cause::SensorLatency), family: Family::A, size, shape: vec![0.0] };
        run(&drive, &Unit::nominal(&drive), &motion, &[effect]).error_arcsec[30_000]
    };
    // The output's reading is old by τ, so it stands back by its speed times τ.
    let expected = 4.0 / 95.0 * 1e-3 * ARCSEC;
    assert!((error_at(0.0) - error_at(1e-3) - expected).abs() < 1e-3);
    assert!((error_at(-1e-3) - error_at(0.0) - expected).abs() < 1e-3);
}

/// By so many pitches of the output wheel, and not before they jump.
#[test]
fn teeth_jump_by_whole_pitches_of_the_output_wheel() {
    let (drive, motion) = setting(2, &[]);
    for (family, pitches) in [(Family::A, 1.0), (Family::B, 2.0), (Family::C, 1.0)] {
        let effect = Effect { what: What::Cause(Cause::Ratcheting), family, size: 1.0, shape: vec![0.5] };
        let unit = Unit { family, ..Unit::nominal(&drive) };
        let (with, without) =
            (run(&drive, &unit, &motion, &[effect]).error_arcsec, run(&drive, &unit, &motion, &[]).error_arcsec);
        let pitch = TAU / drive.output_teeth() * ARCSEC;
        assert_eq!(with[0], without[0]);
        let last = with.len() - 1;
        let jumped = (with[last] - without[last]).abs();
        assert!((jumped - pitches * pitch).abs() < drive.backlash_arcsec + 1.0, "{family:?}: {jumped} of {pitch}");
    }
}

/// Of what is given at once, nothing is there before: every law of every family starts and stays finite, and a size of
/// next to nothing does next to nothing.
#[test]
fn a_vanishing_size_does_nothing() {
    let (drive, motion) = setting(5, &[Poor::Short]);
    for family in Family::ALL {
        let unit = Unit { family, ..Unit::nominal(&drive) };
        let without = run(&drive, &unit, &motion, &[]).error_arcsec;
        for cause in Cause::ALL.iter().copied().filter(|cause| *cause != Cause::Ratcheting) {
            let mut effect = Effect::draw(What::Cause(cause), family, &drive, &mut Chance::new(6, cause.name(), 0));
            let added = |effect: &Effect| {
                let with = run(&drive, &unit, &motion, std::slice::from_ref(effect)).error_arcsec;
                assert!(with.iter().all(|error| error.is_finite()), "{} {family:?}", cause.name());
                rms(&with.iter().zip(&without).map(|(a, b)| a - b).collect::<Vec<_>>())
            };
            let (low, high) = What::Cause(cause).spec(&drive).range;
            effect.size = high.copysign(effect.size);
            let most = added(&effect);
            effect.size = (1e-4 * low).copysign(effect.size);
            let least = added(&effect);
            assert!(most > 1.0 && least < 2e-2, "{} {family:?}: {least} {most}", cause.name());
        }
    }
}
