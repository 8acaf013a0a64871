//! Wind-up under load ranks the generators, and the torques and the work balance.
//!
//! ```text
//!   T = 50 N·m on the output          e ^        two-roller            M_g = -T/95 on the mean of a pitch:
//!       ___                             |      four-roller             what the load puts in comes out
//!      /   \  ) T                       |    double-disc               at the generator
//!     | (o) | )                         |  cam
//!      \___/  M_g                       +-----------------> T
//! ```
//!
//! Standard mesh, no friction, rigid sleeve and bearing. One pitch to settle, one pitch measured.
//! References: ranking cam < double disc < four-roller < two-roller (loads against a rim that is held less and less);
//! virtual work: mean generator torque = -T/95 (frictionless; 2 pi/188 of generator angle gives 2 pi/188/95 of output).
//! The energy stored is the same after a pitch, so the work of the generator and of the load over the pitch cancel.
//! Physics wrong if this fails: contact forces that do not follow from the gaps, moments that do not balance.

use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_mechanics::drive::GeneratorKind;
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_tests::motion::{hhd_95, loaded, mean_error, mean_generator_torque};

const TORQUE_N_M: f64 = 50.0;

/// Increments in a pitch. The torque of a roller also has a small false part that repeats with the edges of the mesh,
/// eight to a pitch: thirteen increments meet the edges at thirteen phases, eight would meet them at one.
fn increments(kind: GeneratorKind) -> usize {
    match kind {
        GeneratorKind::Cam | GeneratorKind::DoubleDisc => 7,
        GeneratorKind::FourRoller | GeneratorKind::TwoRoller => 13,
    }
}

/// Mean error of a pitch under load, arc-seconds; torques and work balance in it.
fn balanced_error(kind: GeneratorKind) -> f64 {
    let problem = hhd_95(kind, MeshLevel::Standard);
    let mut run = loaded(&problem, TORQUE_N_M);
    let pitch = run.pitch();
    run.turn_in(pitch, 4).unwrap();
    let from = run.state().output_rad;
    let samples = run.turn_in(pitch, increments(kind)).unwrap();
    let output_turn = run.state().output_rad - from;
    let torque = mean_generator_torque(&samples);
    // The drag of the output takes its part of the load.
    let drag = samples[0].increment.drag_torque_n_m;
    let expected = -(TORQUE_N_M + drag) / 95.0;
    assert!((torque / expected - 1.0).abs() <= 1e-3, "{kind}: mean generator torque {torque}, expected {expected}");

    let unbalanced = samples
        .iter()
        .map(|s| (s.increment.flank_torque_n_m + s.increment.drag_torque_n_m + TORQUE_N_M).abs() / TORQUE_N_M)
        .fold(0.0, f64::max);
    assert!(unbalanced <= 1e-6, "{kind}: torque on the output is off by {unbalanced} of the load");

    let by_generator = torque * pitch;
    let by_load = (TORQUE_N_M + drag) * output_turn;
    assert!(((by_generator + by_load) / by_load).abs() <= 1e-3, "{kind}: work {by_generator} and {by_load}");
    assert!((output_turn * ARCSEC_PER_RAD - pitch / 95.0 * ARCSEC_PER_RAD).abs() < 1e-3);
    mean_error(&samples)
}

#[test]
fn all_balance_and_the_cam_is_stiffest_and_the_two_roller_softest() {
    let order = [GeneratorKind::Cam, GeneratorKind::DoubleDisc, GeneratorKind::FourRoller, GeneratorKind::TwoRoller];
    let errors = order.map(balanced_error);
    for k in 1..4 {
        assert!(errors[k] > 1.5 * errors[k - 1], "{} {}\", {} {}\"", order[k - 1], errors[k - 1], order[k], errors[k]);
    }
}
