//! A drive all of one steel only feels its modulus; warming part of it changes the backlash.
//!
//! ```text
//!   all warm: every length x s, E x f          e(T', warm) = e(T, cold)   with T' = f s^3 T
//!   flexspline and generator warm: teeth grow into the spaces, b falls by 2 alpha tan(a) per kelvin
//! ```
//!
//! Loads: 20 N·m at 20 C against f s^3 20 N·m at 70 C, the penalties scaled as a stiffness per area; no load for the
//! backlash. References: similarity of elasticity (angles are the same when stress over E is); geometry of the flank at
//! the pressure angle of about 24.7 degrees, -0.034 to -0.037'/K for 11.5e-6/K.
//! Physics wrong if this fails: a length that does not expand, a generator fitted to the warm flexspline, thermal
//! stress where there is none.

use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::{Problem, SolverSettings};
use flexspline_tests::motion::{deformed, loaded, mean_error, on};

#[test]
fn a_warm_drive_is_the_cold_one_under_a_similar_load() {
    [GeneratorKind::Cam, GeneratorKind::DoubleDisc].into_iter().for_each(similar);
}

fn similar(kind: GeneratorKind) {
    let cold = Drive::hhd_95();
    let (warm_c, torque_n_m) = (70.0, 20.0);
    let rise = warm_c - cold.temperature.reference_c;
    let s = 1.0 + cold.temperature.flexspline_expansion_per_k * rise;
    let f = 1.0 + cold.temperature.youngs_modulus_per_k * rise;
    let settings = on(MeshLevel::Coarse);
    let settings = |factor: f64| SolverSettings {
        bore_penalty: Some(factor * settings.bore_penalty(kind)),
        flank_penalty: factor * settings.flank_penalty,
        ..settings
    };
    let mut warm = cold.clone();
    warm.output.drag_torque_n_m *= f * s.powi(3);
    let sweep = |drive: &Drive, temperature_c: f64, settings: SolverSettings, torque_n_m: f64| {
        let problem = Problem::new(drive, kind, temperature_c, settings).unwrap();
        let mut run = loaded(&problem, torque_n_m);
        run.turn_in(run.pitch(), 3).unwrap();
        mean_error(&run.turn_in(run.pitch(), 3).unwrap())
    };
    let at_cold = sweep(&cold, 20.0, settings(1.0), torque_n_m);
    let at_warm = sweep(&warm, warm_c, settings(f / s), f * s.powi(3) * torque_n_m);
    let same_torque = sweep(&cold, warm_c, settings(1.0), torque_n_m);
    println!(
        "{kind}: {at_cold:.5}\" at 20 C, {at_warm:.5}\" at {warm_c} C with the similar load, {same_torque:.5}\" with \
         the same"
    );
    assert!((at_warm - at_cold).abs() <= 1e-3, "{kind}: {at_cold}\" cold, {at_warm}\" warm under the similar load");
    // With the same torque the warm drive is the cold one under a load greater by the fall of E.
    let more = sweep(&cold, 20.0, settings(1.0), torque_n_m / (f * s.powi(3)));
    println!("{kind}: {more:.5}\" at 20 C with {:.4} N·m", torque_n_m / (f * s.powi(3)));
    assert!((same_torque - more).abs() <= 0.005, "{kind}: {same_torque}\" warm, {more}\" with more load");
    assert!(same_torque > at_cold + 0.05);
}

#[test]
fn a_warm_flexspline_takes_the_backlash() {
    let mut drive = Drive::hhd_95();
    drive.temperature.circular_spline_expansion_per_k = 0.0;
    drive.temperature.housing_expansion_per_k = 0.0;
    let backlash = |temperature_c: f64| {
        let problem = Problem::new(&drive, GeneratorKind::Cam, temperature_c, on(MeshLevel::Standard)).unwrap();
        let mut run = deformed(&problem);
        run.turn_in(run.pitch(), 3).unwrap();
        -2.0 * mean_error(&run.turn_in(run.pitch(), 4).unwrap()) / 60.0
    };
    let [cold, middle, warm] = [10.0, 20.0, 30.0].map(backlash);
    let per_k = (warm - cold) / 20.0;
    println!("cam: backlash {cold:.4}' at 10 C, {middle:.4}' at 20 C, {warm:.4}' at 30 C: {per_k:.5}'/K");
    assert!((-0.0375..=-0.0335).contains(&per_k), "{per_k}'/K");
    assert!((cold + warm - 2.0 * middle).abs() < 0.01, "not linear: {cold} {middle} {warm}");
}

#[test]
fn warming_everything_leaves_the_backlash() {
    let drive = Drive::hhd_95();
    let [cold, warm] = [-40.0, 70.0].map(|temperature_c| {
        let problem = Problem::new(&drive, GeneratorKind::Cam, temperature_c, on(MeshLevel::Coarse)).unwrap();
        let mut run = deformed(&problem);
        run.turn_in(run.pitch(), 3).unwrap();
        mean_error(&run.turn_in(run.pitch(), 3).unwrap())
    });
    println!("cam: lag {cold:.5}\" at -40 C, {warm:.5}\" at 70 C");
    assert!((cold - warm).abs() < 0.01);
}
