//! Drives for the claims, and means over places on their way.

use flexspline_mechanics::drive::{DamagedFlank, DamagedTooth, Drive, GeneratorKind, Harmonic, Wheel};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::motion::{Motion, SettledPlace};
use flexspline_mechanics::stepping::{Method, Problem, SolverSettings};

/// Default settings on a mesh, with the solver that has every node of it.
pub fn reference(mesh: MeshLevel) -> SolverSettings {
    SolverSettings { mesh, ..SolverSettings::default() }
}

/// Default settings on a mesh, with the fast solver: `fast_equals_reference` holds it against the other.
pub fn on(mesh: MeshLevel) -> SolverSettings {
    SolverSettings { mesh, method: Method::Fast, ..SolverSettings::default() }
}

/// HHD-95 with a generator at its reference temperature.
pub fn hhd_95(kind: GeneratorKind, mesh: MeshLevel) -> Problem {
    problem(&Drive::hhd_95(), kind, on(mesh))
}

/// A drive with a generator at its reference temperature.
pub fn problem(drive: &Drive, kind: GeneratorKind, settings: SolverSettings) -> Problem {
    Problem::new(drive, kind, drive.temperature.reference_c, settings).unwrap_or_else(|error| panic!("{kind}: {error}"))
}

/// HHD-95 with every imperfection there is, each of a few micrometres.
pub fn imperfect() -> Drive {
    let mut drive = Drive::hhd_95();
    let built = &mut drive.as_built;
    built.circular_spline_eccentricity_um = 2.0;
    built.circular_spline_eccentricity_phase_deg = 50.0;
    built.circular_spline_ovality_um = 2.0;
    built.circular_spline_ovality_phase_deg = 25.0;
    built.circular_spline_pitch_harmonics = vec![Harmonic { order: 3, amplitude_um: 1.5, phase_deg: 12.0 }];
    built.circular_spline_pitch_error_um = (0..190).map(|k| 0.5 * (1.9 * f64::from(k)).sin()).collect();
    built.circular_spline_offset_um = 2.0;
    built.circular_spline_offset_direction_deg = -70.0;
    built.flexspline_runout_um = 1.5;
    built.flexspline_runout_phase_deg = 100.0;
    built.flexspline_pitch_harmonics = vec![Harmonic { order: 2, amplitude_um: 2.0, phase_deg: 30.0 }];
    built.flexspline_pitch_error_um = (0..188).map(|k| 0.5 * (2.3 * f64::from(k)).cos()).collect();
    built.rim_thickness_harmonics = vec![Harmonic { order: 3, amplitude_um: 3.0, phase_deg: -40.0 }];
    built.generator_eccentricity_um = 3.0;
    built.generator_eccentricity_phase_deg = 20.0;
    built.generator_lobe_asymmetry_um = 2.0;
    built.cam_form_harmonics = vec![Harmonic { order: 5, amplitude_um: 1.0, phase_deg: 8.0 }];
    built.flexspline_wear_um = 1.0;
    built.circular_spline_wear_um = 1.5;
    built.damaged_teeth = vec![
        DamagedTooth { wheel: Wheel::Flexspline, tooth: 2, flank: DamagedFlank::Minus, depth_um: 2.0 },
        DamagedTooth { wheel: Wheel::CircularSpline, tooth: 187, flank: DamagedFlank::Both, depth_um: 2.0 },
    ];
    built.generator_warmer_k = 2.0;
    built.circular_spline_warmer_k = -3.0;
    drive
}

/// Mean of some numbers.
pub fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        sum += value;
        count += 1.0;
    }
    sum / count
}

/// Largest minus least of some numbers.
pub fn range(values: impl IntoIterator<Item = f64> + Clone) -> f64 {
    values.clone().into_iter().fold(f64::NEG_INFINITY, f64::max) - values.into_iter().fold(f64::INFINITY, f64::min)
}

/// The drive deformed with its generator at zero, and a load on its output.
pub fn loaded(problem: &Problem, torque_n_m: f64) -> Motion<'_> {
    let mut motion = deformed(problem);
    motion.load(torque_n_m).unwrap_or_else(|error| panic!("{}: {error}", problem.kind));
    motion
}

/// The drive deformed with its generator at zero, without load.
pub fn deformed(problem: &Problem) -> Motion<'_> {
    Motion::deformed(problem, 0.0).unwrap_or_else(|error| panic!("{}: {error}", problem.kind))
}

/// Mean error of a stretch, arc-seconds.
pub fn mean_error(places: &[SettledPlace]) -> f64 {
    mean(places.iter().map(|place| place.error_arcsec))
}

/// Mean generator torque of a stretch, N m.
pub fn mean_generator_torque(places: &[SettledPlace]) -> f64 {
    mean(places.iter().map(|place| place.increment.generator_torque_n_m))
}

/// Mean Newton iterations of a stretch.
pub fn mean_iterations(places: &[SettledPlace]) -> f64 {
    mean(places.iter().map(|place| place.increment.iterations as f64))
}
