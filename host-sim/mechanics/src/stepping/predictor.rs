//! Travelling-wave predictor: the deformation turns with the generator.
//!
//! Node k of sector j is the rotated image of node k of sector 0, so the displacement of a node in polar components is
//! a periodic function of the sector alone. Turning the wave by a fraction of a pitch is interpolation of that
//! function.

use crate::mesh::{WheelMesh, rotate};

/// Displacements of a wheel with the wave turned by `angle_rad` relative to the wheel.
pub(crate) fn turn_field(mesh: &WheelMesh, field: &[f64], angle_rad: f64) -> Vec<f64> {
    let shift = angle_rad / mesh.pitch();
    let whole = shift.floor();
    let weights = lagrange6(shift - whole);
    let per_sector = mesh.nodes_per_sector;
    let teeth = mesh.teeth as isize;
    let turns: Vec<(f64, f64)> = (0..mesh.teeth).map(|j| mesh.sector_angle(j).sin_cos()).collect();
    let mut turned = vec![0.0; field.len()];
    for sector in 0..mesh.teeth {
        // Value at sector - shift, from six sectors around it.
        let sources: [usize; 6] =
            std::array::from_fn(|i| (sector as isize - whole as isize - 1 + 3 - i as isize).rem_euclid(teeth) as usize);
        for k in 0..per_sector {
            let mut local = [0.0; 2];
            for (source, weight) in sources.iter().zip(&weights) {
                let (s, c) = turns[*source];
                let n = 2 * (source * per_sector + k);
                let [x, y] = rotate([field[n], field[n + 1]], (-s, c));
                local[0] += weight * x;
                local[1] += weight * y;
            }
            let n = 2 * (sector * per_sector + k);
            [turned[n], turned[n + 1]] = rotate(local, turns[sector]);
        }
    }
    turned
}

/// Weights of six equally spaced samples, the target lying `fraction` of the way from the fourth back to the third.
///
/// Samples stand at sectors +2, +1, 0, −1, −2, −3 relative to the floor; the target at −fraction.
fn lagrange6(fraction: f64) -> [f64; 6] {
    let nodes = [2.0, 1.0, 0.0, -1.0, -2.0, -3.0];
    let x = -fraction;
    std::array::from_fn(|i| (0..6).filter(|&j| j != i).map(|j| (x - nodes[j]) / (nodes[i] - nodes[j])).product())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;
    use crate::mesh::MeshLevel;

    /// A wave of two lobes with its crest at `crest`: radial `cos 2(phi - crest)`, circumferential
    /// `-sin 2(phi - crest) / 2`.
    fn wave(mesh: &WheelMesh, crest: f64) -> Vec<f64> {
        mesh.nodes
            .iter()
            .flat_map(|x| {
                let phi = x[1].atan2(x[0]);
                let (w, v) = ((2.0 * (phi - crest)).cos(), -0.5 * (2.0 * (phi - crest)).sin());
                let (s, c) = phi.sin_cos();
                [w * c - v * s, w * s + v * c]
            })
            .collect()
    }

    fn apart(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn a_smooth_wave_turns_with_the_generator() {
        let mesh = WheelMesh::flexspline(&Drive::hhd_95(), MeshLevel::Coarse).unwrap();
        for angle in [0.3 * mesh.pitch(), -0.5 * mesh.pitch(), 4.71 * mesh.pitch(), 2.0] {
            let off = apart(&turn_field(&mesh, &wave(&mesh, 0.1), angle), &wave(&mesh, 0.1 + angle));
            // Sixth-order interpolation of 94 samples to a wavelength.
            assert!(off < 1e-8, "turned by {angle}: {off}");
        }
    }

    #[test]
    fn whole_pitches_are_exact_for_any_field() {
        let mesh = WheelMesh::flexspline(&Drive::hhd_95(), MeshLevel::Coarse).unwrap();
        let field: Vec<f64> = (0..2 * mesh.nodes.len()).map(|i| (1.7 * i as f64).sin()).collect();
        for teeth in [1_isize, -3, 188] {
            let turned = turn_field(&mesh, &field, teeth as f64 * mesh.pitch());
            let (sin, cos) = (teeth as f64 * mesh.pitch()).sin_cos();
            let n = mesh.nodes_per_sector;
            for node in 0..mesh.nodes.len() {
                let to = (node as isize + teeth * n as isize).rem_euclid(mesh.nodes.len() as isize) as usize;
                let (x, y) = (field[2 * node], field[2 * node + 1]);
                let off = (turned[2 * to] - cos * x + sin * y).abs() + (turned[2 * to + 1] - sin * x - cos * y).abs();
                assert!(off < 1e-11, "{teeth} pitches: {off}");
            }
        }
    }

    #[test]
    fn turning_there_and_back_returns() {
        let mesh = WheelMesh::circular_spline(&Drive::hhd_95(), MeshLevel::Coarse).unwrap();
        let field = wave(&mesh, 0.0);
        let back = turn_field(&mesh, &turn_field(&mesh, &field, 0.37 * mesh.pitch()), -0.37 * mesh.pitch());
        assert!(apart(&back, &field) < 1e-8);
    }
}
