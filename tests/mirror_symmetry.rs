//! A perfect drive run backwards under the opposite load is its own mirror image.
//!
//! ```text
//!          tooth 0 in space 0, on the major axis at psi = 0
//!                    _|_
//!        -psi  <--- / | \ --->  +psi          e(-psi, -T) = -e(psi, T)
//!         -T       ---+---       +T
//! ```
//!
//! Loads: T = 0 (drag of 0.02 N·m only) and T = 20 N·m, each run from psi = 0 forwards, and its mirror image backwards.
//! Reference: zero for the sum of the two errors. Coarse mesh: the symmetry
//! is one of the mesh at any density.
//! Physics wrong if this fails: flanks of the two sides treated differently, a sign, a mesh that is not its mirror
//! image.

use flexspline_mechanics::drive::GeneratorKind;
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::motion::SettledPlace;
use flexspline_tests::motion::{hhd_95, loaded};

fn mirrors(kind: GeneratorKind) {
    let problem = hhd_95(kind, MeshLevel::Coarse);
    for torque_n_m in [0.0, 20.0] {
        let go = |sense: f64| -> Vec<SettledPlace> {
            let mut run = loaded(&problem, sense * torque_n_m);
            // Not commensurate with the pitch: every phase of the mesh cycle is met.
            run.turn_in(sense * 1.7 * run.pitch(), 6).unwrap()
        };
        let (forwards, backwards) = (go(1.0), go(-1.0));
        let worst =
            forwards.iter().zip(&backwards).map(|(a, b)| (a.error_arcsec + b.error_arcsec).abs()).fold(0.0, f64::max);
        let largest = forwards.iter().map(|s| s.error_arcsec.abs()).fold(0.0, f64::max);
        println!("{kind} {torque_n_m} N·m: e(-psi, -T) + e(psi, T) up to {worst:.1e}\" (e up to {largest:.2}\")");
        assert!(worst <= 0.01, "{kind}, {torque_n_m} N·m: mirror images differ by {worst}\"");
        assert!(largest > 10.0, "{kind}, {torque_n_m} N·m: nothing moved ({largest}\")");
    }
}

#[test]
#[ignore = "long: tests/run slow"]
fn the_other_generators() {
    [GeneratorKind::Cam, GeneratorKind::DoubleDisc, GeneratorKind::FourRoller].into_iter().for_each(mirrors);
}

#[test]
fn two_roller() {
    mirrors(GeneratorKind::TwoRoller);
}
