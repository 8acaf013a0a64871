//! Travelling-wave predictor: the deformation turns with the generator.
//!
//! Node k of sector j is the rotated image of node k of sector 0, so the displacement of a node in polar components is a
//! periodic function of the sector alone. Turning the wave by a fraction of a pitch is interpolation of that function.

use crate::mesh::WheelMesh;

/// Displacements of a wheel with the wave turned by `angle_rad` relative to the wheel.
pub fn turn_field(mesh: &WheelMesh, field: &[f64], angle_rad: f64) -> Vec<f64> {
    let shift = angle_rad / mesh.pitch();
    let whole = shift.floor();
    let weights = lagrange6(shift - whole);
    let per_sector = mesh.nodes_per_sector;
    let teeth = mesh.teeth as isize;
    let turns: Vec<(f64, f64)> = (0..mesh.teeth).map(|j| mesh.sector_angle(j).sin_cos()).collect();
    let mut turned = vec![0.0; field.len()];
    for sector in 0..mesh.teeth {
        let (sin, cos) = turns[sector];
        // Value at sector - shift, from six sectors around it.
        let sources: [usize; 6] =
            std::array::from_fn(|i| (sector as isize - whole as isize - 1 + 3 - i as isize).rem_euclid(teeth) as usize);
        for k in 0..per_sector {
            let mut local = [0.0; 2];
            for (source, weight) in sources.iter().zip(&weights) {
                let (s, c) = turns[*source];
                let n = 2 * (source * per_sector + k);
                local[0] += weight * (c * field[n] + s * field[n + 1]);
                local[1] += weight * (c * field[n + 1] - s * field[n]);
            }
            let n = 2 * (sector * per_sector + k);
            turned[n] = cos * local[0] - sin * local[1];
            turned[n + 1] = sin * local[0] + cos * local[1];
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
