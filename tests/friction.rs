//! Friction between the flanks makes a loop, costs torque against the load and gives it back when the load drives.
//!
//! ```text
//!   e ^   T = 50 N·m            |M_g| ^  T/95 (1 + losses)   lifting the load (backward)
//!     |  ~~~~~~~ backward             |  ------------------  T/95, no friction
//!     |  ~~~~~~~ forward              |  T/95 (1 - losses)   lowered by the load (forward)
//!     +-----------> psi               +-----------> psi
//! ```
//!
//! Loads: 50 N·m on the output, turning it forward; the generator turned forward, then backward; coefficient 0.1 and 0,
//! no drag on the output. References: without friction the state does not know where it came from; with it, the work
//! that generator and load do in a pitch is dissipated, and cannot be negative.
//! Physics wrong if this fails: friction that pushes instead of holding back, history that is lost or kept wrongly.

use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::motion::SettledPlace;
use flexspline_mechanics::stepping::SolverSettings;
use flexspline_tests::motion::{loaded, mean, mean_error, mean_generator_torque, mean_iterations, on, problem};

const TORQUE_N_M: f64 = 50.0;

/// One pitch forward and one backward, each after settling; mean error (arc-seconds) and generator torque (N m) of
/// each.
fn loop_of(kind: GeneratorKind, friction: f64, increments: usize) -> [(f64, f64); 2] {
    let mut drive = Drive::hhd_95();
    drive.flanks.friction_coefficient = friction;
    drive.output.drag_torque_n_m = 0.0;
    // With 48 points to an edge, as rollers have by default, the two-roller finds no equilibrium beyond 48.6 N·m when
    // the load comes on with friction at standstill.
    let settings = SolverSettings { bore_points: Some(16), ..on(MeshLevel::Standard) };
    let problem = problem(&drive, kind, settings);
    let mut run = loaded(&problem, TORQUE_N_M);
    let pitch = run.pitch();
    let describe = |way: &str, places: &[SettledPlace]| {
        let (error, torque) = (mean_error(places), mean_generator_torque(places));
        println!(
            "{kind}, friction {friction}, {way}: e {error:.4}\", generator {torque:.5} N·m, {:.1} iterations, at most \
             {}",
            mean_iterations(places),
            places.iter().map(|p| p.increment.iterations).max().unwrap()
        );
        (error, torque)
    };
    [1.0, -1.0].map(|sense| {
        let settling = run.turn_in(sense * pitch, increments).unwrap();
        let steady = run.turn_in(sense * pitch, increments).unwrap();
        let way = if sense > 0.0 { "forward" } else { "backward" };
        describe(&format!("{way}, settling"), &settling);
        describe(way, &steady)
    })
}

fn makes_a_loop(kind: GeneratorKind) {
    let [forward, backward] = loop_of(kind, 0.1, 5);
    let ideal = TORQUE_N_M / 95.0;
    let width = forward.0 - backward.0;
    // Work that goes in over a pitch of either sense, over the work of the load: -M_g / (T/95) forward is what comes
    // out.
    let lost_forward = 1.0 + forward.1 / ideal;
    let lost_backward = -backward.1 / ideal - 1.0;
    println!(
        "{kind}: loop {width:.4}\" wide; of the work of the load {:.3} % is lost forward, {:.3} % backward",
        100.0 * lost_forward,
        100.0 * lost_backward
    );
    assert!(width.abs() > 0.05, "{kind}: no loop ({width}\")");
    assert!(lost_forward > 0.0, "{kind}: driven by the load, the generator brakes with more than T/95");
    assert!(lost_backward > 0.0, "{kind}: lifting the load takes the generator less than T/95");
    assert!(lost_forward < 0.9 && lost_backward < 10.0, "{kind}: losses {lost_forward}, {lost_backward}");
}

#[test]
fn cam_makes_a_loop() {
    makes_a_loop(GeneratorKind::Cam);
}

#[test]
#[ignore = "long: tests/run slow"]
fn two_roller_makes_a_loop() {
    makes_a_loop(GeneratorKind::TwoRoller);
}

#[test]
fn without_friction_there_is_no_loop() {
    let [forward, backward] = loop_of(GeneratorKind::Cam, 0.0, 5);
    let width = forward.0 - backward.0;
    println!("cam, no friction: loop {width:.1e}\" wide");
    assert!(width.abs() <= 1e-3, "a loop of {width}\" without friction");
    assert!((mean([-forward.1, -backward.1]) / (TORQUE_N_M / 95.0) - 1.0).abs() <= 1e-3);
}

/// Lifting a load, teeth that slip wedge themselves in: friction raises the pressure that it follows. A tangent without
/// that coupling takes twice as many iterations, or runs out of them.
#[test]
fn lifting_the_rated_load_converges() {
    let mut drive = Drive::hhd_95();
    drive.flanks.friction_coefficient = 0.08;
    let problem = problem(&drive, GeneratorKind::Cam, on(MeshLevel::Coarse));
    let mut run = loaded(&problem, -200.0);
    let pitch = run.pitch();
    let settling = run.turn_in(pitch, 8).unwrap();
    let steady = run.turn_in(pitch, 8).unwrap();
    println!(
        "cam, friction 0.08, -200 N·m: e {:.3}\", {:.1} iterations settling, {:.1} settled",
        mean_error(&steady),
        mean_iterations(&settling),
        mean_iterations(&steady)
    );
    assert!(mean_iterations(&settling) < 20.0 && mean_iterations(&steady) < 6.0);
}
