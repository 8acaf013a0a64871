//! A deviation of the geometry, hidden in contact FEM, is named and measured with nothing but the ideal drive's table
//! and kernels.
//!
//! ```text
//!   as-built drive --FEM--> output at 40 generator angles, six loads each, + noise --> diagnose
//!   ideal drive --FEM--> table, kernels --> diagnose
//! ```
//!
//! HHD-95 with the cam, coarse mesh. The run is one that a bench can do: turn the generator to a place, step the load,
//! read, go on; four sessions over 50 turns of the generator, so that what is locked to the flexspline (order 2) and to
//! the circular spline (2 * 94/95) come apart. White noise of 0.5". The hidden drive is solved afresh, with finite
//! deviations and contacts that open; the diagnosis has first-order kernels and the eccentricities of other sizes and
//! places. Physics wrong if this fails: a kernel's sign, phase, wheel or dependence on load; a signature that another
//! cause can imitate.

use std::f64::consts::{PI, TAU};
use std::sync::{Arc, OnceLock};

use flexspline::Table;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::kernels::{KernelPlan, Kernels, make};
use flexspline_identify::diagnosis::{Diagnosis, Verdict};
use flexspline_identify::diagnosis::{Settings, diagnose};
use flexspline_identify::measurement::Session;
use flexspline_identify::nominal::Nominal;
use flexspline_mechanics::drive::{AsBuilt, Drive, GeneratorKind, Harmonic};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Problem, SolverSettings};
use flexspline_tests::command::Desk;
use flexspline_tests::long;
use rayon::prelude::*;

const NOISE_ARCSEC: f64 = 0.5;
const SESSIONS: usize = 4;
const PLACES: usize = 10;
const LOADS: [f64; 3] = [4.0, 15.0, 50.0];

/// Relative error allowed of a size. Pitch errors and ovals are known by kernels of first order. What an eccentricity
/// does bends sharply where it has eaten up the clearance (7 to 9 um here), and the sizes between those of the kernels
/// are known by a straight line.
const LINEAR: f64 = 0.05;
const ECCENTRIC: f64 = 0.25;

/// Table and kernels of the ideal drive.
pub(crate) fn known() -> &'static (Vec<u8>, Arc<Kernels>) {
    static KNOWN: OnceLock<(Vec<u8>, Arc<Kernels>)> = OnceLock::new();
    KNOWN.get_or_init(|| {
        let desk = Desk::new();
        desk.line(
            "tables --generator cam --mesh coarse --temperatures-c 20 --positions 8 --most-nodes 14 --no-report --out \
             made",
        )
        .done();
        let plan = KernelPlan {
            torques_n_m: vec![2.0, 10.0, 60.0],
            sizes_um: vec![5.5, 8.0, 12.0],
            // The drives that these names identify are those of the long form.
            directions: if long() { 19 } else { 10 },
            ..KernelPlan::for_generator(GeneratorKind::Cam)
        };
        let kernels =
            make(&Drive::hhd_95(), GeneratorKind::Cam, &plan, SolverSettings::fast(MeshLevel::Coarse), &|_| ());
        (std::fs::read(desk.path("made/cam.fxt")).unwrap(), Arc::new(kernels.unwrap()))
    })
}

/// Bench recording of the drive with a deviation.
fn measured(change: impl Fn(&mut AsBuilt), seed: u64) -> Vec<Session> {
    let mut drive = Drive::hhd_95();
    change(&mut drive.as_built);
    let problem = Problem::new(
        &drive,
        GeneratorKind::Cam,
        drive.temperature.reference_c,
        SolverSettings::fast(MeshLevel::Coarse),
    )
    .unwrap();
    // Places: 1.27 turns apart, at any phase of the teeth.
    let angles: Vec<f64> = (0..SESSIONS * PLACES).map(|k| 1.27 * TAU * k as f64).collect();
    let errors: Vec<Vec<f64>> = angles
        .par_iter()
        .map(|psi| {
            [1.0, -1.0]
                .into_iter()
                .flat_map(|sign| {
                    let mut motion = Motion::deformed_or_turned_in(&problem, *psi).unwrap();
                    LOADS.map(|load| {
                        motion.load(sign * load).unwrap();
                        motion.error_rad()
                    })
                })
                .collect()
        })
        .collect();
    let mut random = fastrand::Rng::with_seed(seed);
    let mut noise = || {
        let (u, v) = (random.f64().max(1e-12), random.f64());
        NOISE_ARCSEC / ARCSEC_PER_RAD * (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
    };
    (0..SESSIONS)
        .map(|session| {
            let places = session * PLACES..(session + 1) * PLACES;
            let torque: Vec<f64> = LOADS.iter().copied().chain(LOADS.map(|t| -t)).collect();
            let rows = PLACES * torque.len();
            Session {
                line: (0..rows).map(|k| (session * rows + k + 2) as u64).collect(),
                time_s: Some((0..rows).map(|k| 1e5 * session as f64 + 20.0 * k as f64).collect()),
                generator_rad: places.clone().flat_map(|p| vec![angles[p]; torque.len()]).collect(),
                error_rad: places.clone().flat_map(|p| errors[p].clone()).map(|e| e + noise()).collect(),
                torque_n_m: Some(places.clone().flat_map(|_| torque.clone()).collect()),
                temperature_c: Some(vec![20.0; rows]),
                ..Session::default()
            }
        })
        .collect()
}

fn diagnosed(change: impl Fn(&mut AsBuilt), seed: u64) -> Diagnosis {
    let (image, kernels) = known();
    let table = Table::check(image).unwrap();
    let nominal = Nominal { kernels: Some(Arc::clone(kernels)), ..Nominal::of_table(&table) };
    diagnose(&measured(change, seed), &nominal, Some(&table), &Settings::default(), |_, _, _| {}).unwrap().0
}

/// The cause is named alone and first, and its size and phase are right.
fn found(change: impl Fn(&mut AsBuilt), seed: u64, cause: &str, [size_um, within]: [f64; 2], phase: Option<f64>) {
    let diagnosis = diagnosed(change, seed);
    println!("{cause}, {size_um} um:\n{}", diagnosis.text());
    let names: Vec<&str> = diagnosis.causes.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, [cause]);
    let parameter = |name: &str| diagnosis.causes[0].parameters[name].value;
    let size = parameter("amplitude_um");
    assert!((size / size_um - 1.0).abs() < within, "{size} um of {size_um}");
    if let Some(phase) = phase {
        // An angle on a body that two lobes see: modulo half a turn.
        let off = (parameter("phase_rad") - phase + 0.5 * PI).rem_euclid(PI) - 0.5 * PI;
        assert!(off.abs() < 0.12, "{off} rad beside {phase}");
    }
    assert!(diagnosis.held_out.rms_after_arcsec < 0.4 * diagnosis.held_out.rms_before_arcsec);
}

fn second(amplitude_um: f64, phase: f64) -> Vec<Harmonic> {
    vec![Harmonic { order: 2, amplitude_um, phase_deg: phase.to_degrees() }]
}

#[test]
#[ignore = "40 s of a processor: no other cause is named on drives with one deviation, always asked"]
fn an_ideal_drive_has_no_cause() {
    let diagnosis = diagnosed(|_| {}, 1);
    assert_eq!((diagnosis.verdict, diagnosis.causes.len()), (Verdict::None, 0), "{}", diagnosis.text());
}

#[test]
#[ignore = "a minute of a processor: a drive that does not repeat, by FEM"]
fn an_eccentric_circular_spline_is_told_and_measured() {
    let eccentric = |b: &mut AsBuilt| {
        b.circular_spline_eccentricity_um = 8.0;
        b.circular_spline_eccentricity_phase_deg = 0.9f64.to_degrees();
    };
    found(eccentric, 2, "circular_spline_eccentricity", [8.0, ECCENTRIC], Some(0.9));
}

#[test]
#[ignore = "half a minute of a processor: two more drives by FEM"]
fn a_runout_of_the_flexspline_and_pitch_errors_of_the_circular_spline_are_told_and_measured() {
    let runout = |b: &mut AsBuilt| {
        b.flexspline_runout_um = 6.0;
        b.flexspline_runout_phase_deg = 2.0f64.to_degrees();
    };
    found(runout, 3, "flexspline_runout", [6.0, ECCENTRIC], Some(2.0));
    found(
        |b| b.circular_spline_pitch_harmonics = second(3.0, 1.1),
        5,
        "circular_spline_pitch_error",
        [3.0, LINEAR],
        Some(1.1),
    );
}

/// Assumption on the two zones of teeth where no kernels are at hand, compared with contact FEM: below the
/// clearance and where both flanks bind (7 to 9 um here eat it up).
#[test]
#[ignore = "half a minute of a processor: two more drives by FEM"]
fn an_eccentric_circular_spline_is_told_without_kernels_before_and_after_its_flanks_bind() {
    let table = Table::check(&known().0).unwrap();
    for (size_um, seed) in [(4.0, 12), (14.0, 13)] {
        let eccentric = |b: &mut AsBuilt| {
            b.circular_spline_eccentricity_um = size_um;
            b.circular_spline_eccentricity_phase_deg = 0.9f64.to_degrees();
        };
        let sessions = measured(eccentric, seed);
        let diagnosis =
            diagnose(&sessions, &Nominal::of_table(&table), Some(&table), &Settings::default(), |_, _, _| {})
                .unwrap()
                .0;
        println!("{size_um} um without kernels:\n{}", diagnosis.text());
        let names: Vec<&str> = diagnosis.causes.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["circular_spline_eccentricity"]);
        // Found when this was written: 4.03 of 4 um, 14.4 of 14 um.
        let size = diagnosis.causes[0].parameters["amplitude_um"].value;
        assert!((size / size_um - 1.0).abs() < 0.1, "{size} um of {size_um}");
        let held = diagnosis.held_out;
        assert!(held.rms_after_arcsec < 0.5 * held.rms_before_arcsec, "{held:?}");
    }
}

#[test]
#[ignore = "long: tests/run slow"]
fn pitch_errors_of_the_flexspline_and_an_oval_are_told_apart_and_measured() {
    found(|b| b.flexspline_pitch_harmonics = second(4.0, 0.6), 4, "flexspline_pitch_error", [4.0, LINEAR], Some(0.6));
    let oval = |b: &mut AsBuilt| {
        b.circular_spline_ovality_um = 6.0;
        b.circular_spline_ovality_phase_deg = 0.4f64.to_degrees();
    };
    found(oval, 6, "circular_spline_ovality", [6.0, LINEAR], Some(0.4));
}
