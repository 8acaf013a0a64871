//! Von Mises stress of both wheels, recovered from a converged state.
//!
//! Cauchy stress at the 2 x 2 integration points, where the 8-node element is most accurate; carried to its nodes by
//! the bilinear field through them; averaged, component by component, over the elements that meet in a node; then the
//! invariant. Averaging components rather than invariants keeps the stress of a smooth field smooth and does not bias
//! the peak upwards.
//!
//! Plane strain: the axial stress `nu (s11 + s22)` takes part. Contact pressure acts on edges and is resolved only as
//! finely as the mesh: [`flexspline_mechanics::stepping::Increment::peak_pressure_mpa`] is the better number for it.
//!
//! The circular spline is recovered in the frame that turns with it; the invariant does not see the turn.

use super::places::largest_of;
use flexspline_mechanics::fem::element::nodal_stress;
use flexspline_mechanics::fem::material::PlaneStrain;
use flexspline_mechanics::mesh::{WheelKind, WheelMesh};
use flexspline_mechanics::stepping::{Problem, State};

/// Von Mises stress (MPa) at every node of a wheel.
pub fn nodal_von_mises(mesh: &WheelMesh, material: &PlaneStrain, field: &[f64]) -> Vec<f64> {
    nodal_stress((&mesh.elements, &mesh.gauss), material, field).into_iter().map(|s| material.von_mises(s)).collect()
}

/// The most stressed node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PeakStress {
    /// Which wheel.
    pub wheel: WheelKind,
    /// Its node, by number in the mesh.
    pub node: usize,
    /// Where the node is now, global frame, mm.
    pub position_mm: [f64; 2],
    /// Von Mises stress, MPa.
    pub von_mises_mpa: f64,
    /// Largest stress of the flexspline in the root fillets (by the strain of their surface), on the bore and on the
    /// flanks (nodal), MPa.
    pub by_place_mpa: [f64; 3],
}

/// The most stressed node of the whole drive.
pub fn peak_stress(problem: &Problem, state: &State) -> PeakStress {
    let state = &*problem.whole_state(state);
    let nodal = |mesh: &WheelMesh, field: &[f64]| nodal_von_mises(mesh, &problem.material, field);
    let most =
        |nodal: &[f64]| nodal.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).expect("a mesh has nodes");
    let of_flexspline = nodal(&problem.flexspline, &state.u);
    let (fs, fs_stress) = most(&of_flexspline);
    let (cs, cs_stress) = most(&nodal(&problem.circular_spline, &state.v));
    let by_place_mpa =
        largest_of(&problem.flexspline, &problem.material, &state.u, &of_flexspline).map(|(stress, _)| stress);
    if fs_stress >= cs_stress {
        let [x, y] = problem.flexspline.nodes[fs];
        PeakStress {
            wheel: WheelKind::Flexspline,
            node: fs,
            position_mm: [x + state.u[2 * fs], y + state.u[2 * fs + 1]],
            von_mises_mpa: fs_stress,
            by_place_mpa,
        }
    } else {
        let [x, y] = problem.circular_spline.nodes[cs];
        let (sin, cos) = state.output_rad.sin_cos();
        let (x, y) = (x + state.v[2 * cs], y + state.v[2 * cs + 1]);
        PeakStress {
            wheel: WheelKind::CircularSpline,
            node: cs,
            position_mm: [cos * x - sin * y, sin * x + cos * y],
            von_mises_mpa: cs_stress,
            by_place_mpa,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_mechanics::drive::{Drive, GeneratorKind};
    use flexspline_mechanics::mesh::MeshLevel;
    use flexspline_mechanics::stepping::{Solver, SolverSettings};

    const STEEL: (f64, f64) = (206_000.0, 0.3);

    fn steel() -> PlaneStrain {
        PlaneStrain::new(STEEL.0, STEEL.1)
    }

    fn field_of(mesh: &WheelMesh, u: impl Fn([f64; 2]) -> [f64; 2]) -> Vec<f64> {
        mesh.nodes.iter().flat_map(|x| u(*x)).collect()
    }

    #[test]
    fn a_uniform_strain_gives_the_stress_of_hooke_at_every_node_of_both_wheels() {
        let drive = Drive::hhd_95();
        for mesh in [
            WheelMesh::flexspline(&drive, MeshLevel::Coarse).unwrap(),
            WheelMesh::circular_spline(&drive, MeshLevel::Coarse).unwrap(),
        ] {
            let strain = 1e-6;
            let field = field_of(&mesh, |x| [strain * x[0], 0.0]);
            let stress = nodal_stress((&mesh.elements, &mesh.gauss), &steel(), &field);
            let (lambda, mu) = (steel().lambda, steel().mu);
            let expected = [(lambda + 2.0 * mu) * strain, lambda * strain, 0.0];
            for found in stress {
                for (f, e) in found.iter().zip(expected) {
                    assert!((f - e).abs() < 1e-5 * expected[0], "{found:?}, expected {expected:?}");
                }
            }
        }
    }

    #[test]
    fn a_rigid_turn_of_any_size_is_free_of_stress() {
        let mesh = WheelMesh::flexspline(&Drive::hhd_95(), MeshLevel::Coarse).unwrap();
        let (s, c) = 2.1_f64.sin_cos();
        let turned = field_of(&mesh, |x| [c * x[0] - s * x[1] - x[0] + 0.3, s * x[0] + c * x[1] - x[1]]);
        let peak = nodal_von_mises(&mesh, &steel(), &turned).into_iter().fold(0.0, f64::max);
        assert!(peak < 1e-6, "{peak} MPa");
    }

    /// Lamé's ring under a radial stretch of its bore is not exactly representable, so it shows the recovery at work:
    /// `u = b r + d / r` has hoop and radial stress `2 (lambda + mu) b ± 2 mu d / r²`.
    #[test]
    fn nodal_stress_of_lames_ring_is_that_of_the_closed_form() {
        let mesh = WheelMesh::circular_spline(&Drive::hhd_95(), MeshLevel::Fine).unwrap();
        let (b, d) = (1e-6, 5e-3);
        let field = field_of(&mesh, |x| {
            let r2 = x[0] * x[0] + x[1] * x[1];
            [(b + d / r2) * x[0], (b + d / r2) * x[1]]
        });
        let material = steel();
        for (x, found) in mesh.nodes.iter().zip(nodal_von_mises(&mesh, &material, &field)) {
            let r2 = x[0] * x[0] + x[1] * x[1];
            let mean = 2.0 * (material.lambda + material.mu) * b;
            let difference = 2.0 * material.mu * d / r2;
            let expected = material.von_mises([mean - difference, mean + difference, 0.0]);
            assert!((found / expected - 1.0).abs() < 2e-3, "{found} MPa, expected {expected} at {x:?}");
        }
    }

    /// Bending of the rim over two rollers is what stresses the drive: in the flexspline, under a roller. The smooth
    /// ring alone bends to 130 MPa at its fibres; the roots of the teeth concentrate that, by less than three.
    #[test]
    fn the_two_roller_drive_is_stressed_most_in_the_flexspline_on_the_major_axis() {
        let settings = SolverSettings { mesh: MeshLevel::Coarse, ..Default::default() };
        let drive = Drive::hhd_95();
        let problem = Problem::new(&drive, GeneratorKind::TwoRoller, 20.0, settings).unwrap();
        let (state, _) = Solver::new(&problem).deform(0.0).unwrap();
        let peak = peak_stress(&problem, &state);
        assert_eq!(peak.wheel, WheelKind::Flexspline);
        let angle = peak.position_mm[1].atan2(peak.position_mm[0].abs()).abs();
        assert!(angle < 0.05, "at {angle} rad from the major axis");
        assert!((130.0..400.0).contains(&peak.von_mises_mpa), "{} MPa", peak.von_mises_mpa);
    }
}
