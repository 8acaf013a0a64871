use super::*;
use crate::WriteError;
use crate::fixture::{self, ARCSEC, Buffers, PITCH};
use core::f64::consts::TAU;
use flexspline::{Direction, Field, ImageError};
use std::vec;
use std::vec::Vec;

fn make(plan: &Plan<'_>, samples: &[Sample]) -> Result<(Fit, Vec<u8>), ProjectError> {
    let mut buffers = Buffers::new(plan);
    let mut out = vec![0; plan.image_bytes()];
    let fit = make_image(plan, &fixture::provenance(), samples, buffers.workspace(), &mut out, fixture::id)?;
    Ok((fit, out))
}

/// Largest deviation from the closed form at points that made no table, arc-seconds.
fn worst_elsewhere(image: &[u8], long: bool) -> f64 {
    let table = Table::check(image).unwrap();
    let mut worst: f64 = 0.0;
    for i in 0..20_000 {
        let part = |k: f64| (i as f64 * k).rem_euclid(1.0);
        let turns = if long { 96.0 } else { 1.0 / 188.0 };
        let generator = TAU * turns * part(0.618_033_988);
        let torque = -49.0 + 98.0 * part(0.754_877_666);
        if (torque.abs() - 1.5).abs() < 0.02 {
            continue;
        }
        let temperature = -40.0 + 120.0 * part(0.569_840_291);
        for direction in [Direction::Forward, Direction::Backward] {
            let angle = GeneratorAngle::from_rad(generator).unwrap();
            let found = table.steady_error_rad(angle, torque as f32, temperature as f32, direction).unwrap();
            let truth = fixture::error(generator, torque, temperature, direction, long);
            worst = worst.max((found as f64 - truth).abs() / ARCSEC);
        }
    }
    worst
}

#[test]
fn one_pitch_recovers_ripple_wind_up_and_both_sides_of_the_jumps() {
    let (fit, image) = make(&fixture::plan(false), &fixture::samples(false)).unwrap();
    assert!(fit.worst_rad < 0.002 * ARCSEC, "{} arcsec", fit.worst_rad / ARCSEC);
    assert!(fit.rms_rad > 0.0 && fit.rms_rad < fit.worst_rad);
    assert_eq!((fit.used, fit.inside_jumps), (3 * 11 * 2 * 16, 0));
    let worst = worst_elsewhere(&image, false);
    assert!(worst < 0.01, "{worst} arcsec");
    let table = Table::check(&image).unwrap();
    assert!(table.projection_worst_rad() as f64 >= fit.worst_rad);
    assert!((table.projection_worst_rad() as f64 - fit.worst_rad) < 1e-14);
    assert!((0..11).filter(|&node| table.is_torque_jump(node)).eq([3, 6]));
}

#[test]
fn full_turns_separate_both_families_of_harmonics() {
    let (fit, image) = make(&fixture::plan(true), &fixture::samples(true)).unwrap();
    assert!(fit.worst_rad < 0.009 * ARCSEC, "{} arcsec", fit.worst_rad / ARCSEC);
    let worst = worst_elsewhere(&image, true);
    assert!(worst < 0.01, "{worst} arcsec");
}

#[test]
fn samples_off_the_torque_nodes_recover_the_table_too() {
    let mut samples = fixture::samples(false);
    samples.retain(|sample| sample.torque_n_m.abs() != 20.0);
    for direction in [Direction::Forward, Direction::Backward] {
        for i in 0..2000 {
            let part = |k: f64| (i as f64 * k).rem_euclid(1.0);
            let torque = 5.0 + 45.0 * part(0.754_877_666);
            let temperature = -40.0 + 120.0 * part(0.569_840_291);
            for torque in [torque, -torque] {
                samples.push(fixture::sample(PITCH * part(0.618), torque, temperature, direction, false));
            }
        }
    }
    let (_, image) = make(&fixture::plan(false), &samples).unwrap();
    let worst = worst_elsewhere(&image, false);
    assert!(worst < 0.01, "{worst} arcsec");
}

/// A drive with curved wind-up, one parabola beyond each jump, and a half-width of 3″.
mod curved {
    use super::*;

    pub const TORQUES: [f32; 12] = [-50.0, -20.0, -8.0, -3.0, -1.51, -1.49, 1.49, 1.51, 3.0, 8.0, 20.0, 50.0];

    pub fn error(generator_rad: f64, torque: f64, temperature: f64, direction: Direction) -> f64 {
        let (load, warm) = (torque.abs(), 1.0 + 1.0e-3 * temperature);
        let wind_up = if load > 1.5 { torque.signum() * (30.0 + load * (20.0 - 0.2 * load)) } else { 5.0 * torque };
        let ripple = 0.3 * (188.0 * generator_rad).cos();
        (warm * wind_up + ripple - 3.0 * direction.sign() as f64) * ARCSEC
    }

    pub fn plan() -> Plan<'static> {
        Plan { torque_nodes_n_m: &TORQUES, ..fixture::plan(false) }
    }

    /// Places spread over everything but the jumps; none on a torque node.
    pub fn places(count: usize) -> impl Iterator<Item = Sample> {
        (0..count).filter_map(|i| {
            let part = |k: f64| (i as f64 * k).rem_euclid(1.0);
            let torque_n_m = (100.0 * part(0.754_877_666) - 50.0) * part(0.618_033_988);
            let (generator_rad, temperature_c) = (PITCH * part(0.414_213_56), 120.0 * part(0.569_840_291) - 40.0);
            let direction = if part(0.302_775_6) < 0.5 { Direction::Forward } else { Direction::Backward };
            let output_rad = generator_rad / 95.0 + error(generator_rad, torque_n_m, temperature_c, direction);
            let outside = (torque_n_m.abs() - 1.5).abs() > 0.02;
            outside.then_some(Sample { generator_rad, torque_n_m, temperature_c, direction, output_rad })
        })
    }

    /// Samples at the nodes of one direction.
    pub fn at_nodes(direction: Direction) -> impl Iterator<Item = Sample> {
        let nodes = fixture::TEMPERATURES.into_iter().flat_map(|hot| TORQUES.map(|torque| (hot as f64, torque as f64)));
        nodes.flat_map(move |(temperature_c, torque_n_m)| {
            (0..16).map(move |position| {
                let generator_rad = PITCH * (position as f64 + 0.4) / 16.0;
                let output_rad = generator_rad / 95.0 + error(generator_rad, torque_n_m, temperature_c, direction);
                Sample { generator_rad, torque_n_m, temperature_c, direction, output_rad }
            })
        })
    }

    pub fn worst_elsewhere(image: &[u8]) -> f64 {
        let table = Table::check(image).unwrap();
        places(31_000).skip(11_000).fold(0.0, |worst: f64, place| {
            let angle = GeneratorAngle::from_rad(place.generator_rad).unwrap();
            let (torque, temperature) = (place.torque_n_m as f32, place.temperature_c as f32);
            [Direction::Forward, Direction::Backward].into_iter().fold(worst, |worst, direction| {
                let found = table.steady_error_rad(angle, torque, temperature, direction).unwrap() as f64;
                let truth = error(place.generator_rad, place.torque_n_m, place.temperature_c, direction);
                worst.max((found - truth).abs() / ARCSEC)
            })
        })
    }
}

#[test]
fn curved_wind_up_is_recovered_from_samples_between_the_nodes() {
    // The inner nodes of the jumps get samples of their own: little else lies there.
    let inner = |direction| curved::at_nodes(direction).filter(|sample| sample.torque_n_m.abs() < 1.55);
    let mut samples: Vec<Sample> = curved::places(11_000).collect();
    samples.extend(inner(Direction::Forward).chain(inner(Direction::Backward)));
    let (fit, image) = make(&curved::plan(), &samples).unwrap();
    assert!(fit.worst_rad < 0.005 * ARCSEC, "{} arcsec", fit.worst_rad / ARCSEC);
    let worst = curved::worst_elsewhere(&image);
    assert!(worst < 0.01, "{worst} arcsec");
}

#[test]
fn curved_wind_up_is_recovered_from_samples_at_the_nodes() {
    let samples: Vec<Sample> =
        curved::at_nodes(Direction::Forward).chain(curved::at_nodes(Direction::Backward)).collect();
    let (_, image) = make(&curved::plan(), &samples).unwrap();
    let worst = curved::worst_elsewhere(&image);
    assert!(worst < 0.01, "{worst} arcsec");
}

#[test]
fn a_missing_direction_between_the_nodes_counts_with_the_half_width_given() {
    let mut plan = curved::plan();
    plan.missing_direction = MissingDirection::HalfWidth { rad: 3.0 * ARCSEC };
    for present in [Direction::Forward, Direction::Backward] {
        // The nodes at ±8 have samples of the other direction from one side, those at ±20 and ±50 have none.
        let kept = |sample: &Sample| sample.direction == present || sample.torque_n_m.abs() < 7.9;
        let nodes = curved::at_nodes(Direction::Forward).chain(curved::at_nodes(Direction::Backward));
        let samples: Vec<Sample> = curved::places(11_000).chain(nodes).filter(kept).collect();
        let (fit, image) = make(&plan, &samples).unwrap();
        assert!(fit.worst_rad < 0.005 * ARCSEC, "{} arcsec", fit.worst_rad / ARCSEC);
        let worst = curved::worst_elsewhere(&image);
        assert!(worst < 0.01, "{worst} arcsec");
    }
}

#[test]
fn samples_inside_a_jump_are_left_out_and_counted() {
    let mut samples = fixture::samples(false);
    let mut inside = fixture::sample(0.1, 1.5, 20.0, Direction::Forward, false);
    inside.output_rad += 20.0 * ARCSEC;
    samples.push(inside);
    let (fit, image) = make(&fixture::plan(false), &samples).unwrap();
    assert_eq!(fit.inside_jumps, 1);
    assert!(worst_elsewhere(&image, false) < 0.01);
}

#[test]
fn a_missing_direction_is_named_or_filled_with_the_half_width_given() {
    let mut samples = fixture::samples(false);
    samples.retain(|s| !(s.torque_n_m == 20.0 && s.temperature_c == 80.0 && s.direction == Direction::Backward));
    let mut plan = fixture::plan(false);
    let expected = ProjectError::MissingDirection { temperature: 2, torque: 9, direction: Direction::Backward };
    assert_eq!(make(&plan, &samples).unwrap_err(), expected);

    plan.missing_direction = MissingDirection::HalfWidth { rad: 3.0 * ARCSEC };
    let (_, image) = make(&plan, &samples).unwrap();
    let table = Table::check(&image).unwrap();
    let generator = GeneratorAngle::from_rad(0.01).unwrap();
    let at = |direction| table.steady_error_rad(generator, 20.0, 80.0, direction).unwrap() as f64;
    let width = at(Direction::Backward) - at(Direction::Forward);
    assert!((width - 6.0 * ARCSEC).abs() < 0.001 * ARCSEC, "{} arcsec", width / ARCSEC);
    let truth = fixture::error(0.01, 20.0, 80.0, Direction::Forward, false);
    assert!((at(Direction::Forward) - truth).abs() < 0.005 * ARCSEC);
}

#[test]
fn too_few_samples_are_refused_by_node() {
    let plan = fixture::plan(false);
    let mut samples = fixture::samples(false);
    samples.retain(|s| !(s.torque_n_m == -5.0 && s.temperature_c == 20.0));
    assert_eq!(make(&plan, &samples).unwrap_err(), ProjectError::MissingNode { temperature: 1, torque: 2 });

    let mut thinned = fixture::samples(false);
    let mut number = 0;
    thinned.retain(|s| {
        let here = s.torque_n_m == 0.0 && s.temperature_c == -40.0 && s.direction == Direction::Forward;
        number += usize::from(here);
        !here || number % 2 == 0
    });
    let found = make(&plan, &thinned).unwrap_err();
    let expected = ProjectError::TooFewPositions {
        temperature: 0,
        torque: 5,
        direction: Direction::Forward,
        found: 8,
        needed: 16,
    };
    assert_eq!(found, expected);
    // The same eight positions twice over are still eight.
    let repeated: Vec<Sample> = thinned.iter().chain(&thinned).copied().collect();
    assert!(matches!(make(&plan, &repeated), Err(ProjectError::TooFewPositions { found: 8, .. })));
    // All sixteen in one half of the pitch leave a gap.
    let mut bunched = fixture::samples(false);
    for s in &mut bunched {
        let position = (s.generator_rad - 1.0) / 2.0;
        *s = fixture::sample(1.0 + position, s.torque_n_m, s.temperature_c, s.direction, false);
    }
    assert!(matches!(make(&plan, &bunched), Err(ProjectError::TooFewPositions { .. })));
    assert_eq!(make(&plan, &[]).unwrap_err(), ProjectError::NoSamples);
}

#[test]
fn harmonics_need_the_turns_that_separate_them() {
    let mut samples = fixture::samples(true);
    samples.retain(|s| s.generator_rad < TAU * 40.0);
    let mut plan = fixture::plan(true);
    plan.output = Harmonics::default();
    let Err(ProjectError::Coverage { needed_turns, found_turns }) = make(&plan, &samples) else { panic!() };
    assert!((needed_turns - 0.95 * 47.5).abs() < 1e-9, "{needed_turns}");
    assert!((39.0..40.0).contains(&found_turns), "{found_turns}");

    plan.output = Harmonics { orders: &[95], nodes: 128 };
    assert!(matches!(make(&plan, &samples), Err(ProjectError::Order { order: 95, .. })));
}

#[test]
fn bad_samples_are_named() {
    let plan = fixture::plan(false);
    let with = |change: fn(&mut Sample)| {
        let mut samples = fixture::samples(false);
        change(&mut samples[7]);
        make(&plan, &samples).unwrap_err()
    };
    assert_eq!(with(|s| s.output_rad = f64::NAN), ProjectError::SampleNotFinite { sample: 7 });
    assert_eq!(with(|s| s.generator_rad = 1e300), ProjectError::SampleNotFinite { sample: 7 });
    let expected = ProjectError::SampleOutside { sample: 7, axis: Field::TorqueNodes, found: 51.0 };
    assert_eq!(with(|s| s.torque_n_m = 51.0), expected);
    let expected = ProjectError::SampleOutside { sample: 7, axis: Field::TemperatureNodes, found: -41.0 };
    assert_eq!(with(|s| s.temperature_c = -41.0), expected);
    // An output angle in degrees.
    assert!(matches!(with(|s| s.output_rad *= 57.3), ProjectError::SampleImplausible { sample: 7, .. }));
}

#[test]
fn samples_that_contradict_each_other_are_refused() {
    let mut samples = fixture::samples(false);
    let mut again = samples[40];
    again.output_rad += 0.2 * ARCSEC;
    samples.push(again);
    let mut plan = fixture::plan(false);
    plan.deviation_limit_rad = 0.05 * ARCSEC;
    let found = make(&plan, &samples).unwrap_err();
    let ProjectError::Deviation { sample, found_rad, .. } = found else { panic!("{found}") };
    assert!(sample == 40 || sample == samples.len() - 1, "{sample}");
    assert!((found_rad - 0.1 * ARCSEC).abs() < 0.01 * ARCSEC, "{found}");
}

#[test]
fn exchanged_directions_are_refused() {
    let mut samples = fixture::samples(false);
    for s in &mut samples {
        s.direction = match s.direction {
            Direction::Forward => Direction::Backward,
            Direction::Backward => Direction::Forward,
        };
    }
    let found = make(&fixture::plan(false), &samples).unwrap_err();
    assert!(matches!(found, ProjectError::NegativeHalfWidth { temperature: 0, torque: 0, .. }), "{found}");
}

#[test]
fn a_half_width_of_zero_survives_quantisation() {
    let mut plan = fixture::plan(false);
    plan.negative_half_width_tolerance_rad = 0.2 * ARCSEC;
    let mut samples = fixture::samples(false);
    for s in &mut samples {
        let other = |direction| fixture::error(s.generator_rad, s.torque_n_m, s.temperature_c, direction, false);
        // Only the ripple of the half-width is left, on a half-width that just stays above zero.
        let half = 0.1 * ARCSEC * (1.0 + (188.0 * s.generator_rad).sin());
        let centre = 0.5 * (other(Direction::Forward) + other(Direction::Backward));
        s.output_rad = s.generator_rad / 95.0 + centre - s.direction.sign() as f64 * half;
    }
    let (fit, _) = make(&plan, &samples).unwrap();
    assert!(fit.worst_rad < 0.005 * ARCSEC, "{} arcsec", fit.worst_rad / ARCSEC);
}

#[test]
fn plans_and_workspaces_that_do_not_fit_are_refused() {
    let samples = fixture::samples(false);
    let refused = |change: fn(&mut Plan<'static>)| {
        let mut plan = fixture::plan(false);
        change(&mut plan);
        make(&plan, &samples).unwrap_err()
    };
    assert!(matches!(
        refused(|p| p.torque_nodes_n_m = &[1.0, 1.0]),
        ProjectError::Write(WriteError::Refused(ImageError::NotIncreasing { index: 1, .. }))
    ));
    assert!(matches!(
        refused(|p| p.ripple_nodes = 33),
        ProjectError::Write(WriteError::Refused(ImageError::Count { field: Field::RippleNodes, found: 33, .. }))
    ));
    assert!(matches!(refused(|p| p.deviation_limit_rad = f64::NAN), ProjectError::Setting { .. }));
    assert!(matches!(
        refused(|p| p.generator = Harmonics { orders: &[2, 9], nodes: 64 }),
        ProjectError::Order { order: 9, nodes: 64, .. }
    ));

    let plan = fixture::plan(false);
    let mut buffers = Buffers::new(&plan);
    let mut out = vec![0; plan.image_bytes()];
    for part in ["numbers", "marks", "values"] {
        let Workspace { mut numbers, mut marks, mut values } = buffers.workspace();
        match part {
            "numbers" => numbers = numbers.split_last_mut().unwrap().1,
            "marks" => marks = marks.split_last_mut().unwrap().1,
            _ => values = values.split_last_mut().unwrap().1,
        }
        let workspace = Workspace { numbers, marks, values };
        let found = make_image(&plan, &fixture::provenance(), &samples, workspace, &mut out, fixture::id);
        assert!(matches!(found, Err(ProjectError::Workspace { part: named, .. }) if named == part), "{found:?}");
    }
}

/// Room for the cosines and sines of none, some or all of the samples.
#[test]
fn what_is_kept_of_the_samples_changes_no_bit() {
    let (plan, samples) = (fixture::plan(true), fixture::samples(true));
    let [none, some, all] = [0, samples.len() / 2, samples.len()].map(|kept| {
        let mut buffers = Buffers::new(&plan);
        buffers.numbers.resize(plan.numbers_len() + plan.kept_len(kept), 0.5);
        let mut image = vec![0; plan.image_bytes()];
        make_image(&plan, &fixture::provenance(), &samples, buffers.workspace(), &mut image, fixture::id).unwrap();
        image
    });
    assert!(plan.kept_len(1) > 0 && none == some && some == all);
}
