//! How far a single slice of a pair of teeth gives way beyond the rest of its face: what levels a load along the face.

use super::matrix::Symmetric;
use super::ribs::add_sector;
use crate::drive::{Drive, Side};
use crate::fem::material::PlaneStrain;
use crate::mesh::{MeshError, MeshLevel, WheelMesh};

/// Normal approach of a pair of flanks by the deformation of the two wheels, for 1 N per mm of face width: mm²/N.
///
/// Plane FEM of one pitch of each wheel, all teeth loaded alike by a uniform pressure over the flank, held where the
/// drive holds them, at the bore and at the outer circle. Solid elements give way as much (4.4e-5 for HHD-95 on every
/// mesh): `tests/run peers`. In a ring that is much thicker than the face is wide, what lies deep moves with the
/// neighbouring slices, and this is an upper bound.
pub(crate) fn pair_compliance(drive: &Drive) -> Result<f64, MeshError> {
    let plain = Drive { as_built: Default::default(), ..drive.clone() };
    let material = PlaneStrain::new(drive.material.youngs_modulus_mpa, drive.material.poissons_ratio);
    let flexspline = WheelMesh::flexspline(&plain, MeshLevel::Coarse)?;
    let circular_spline = WheelMesh::circular_spline(&plain, MeshLevel::Coarse)?;
    let bore_mm = plain.flexspline.bore_radius_mm() + EDGE_MM;
    let outer_mm = plain.circular_spline.outer_radius_mm - EDGE_MM;
    Ok(tooth_compliance(&flexspline, &material, |r| r < bore_mm)
        + tooth_compliance(&circular_spline, &material, |r| r > outer_mm))
}

/// Nodes this close to the bore or the outer circle lie on it.
const EDGE_MM: f64 = 1e-6;

/// Work of a uniform pressure on the plus flank of every tooth, 1 N/mm in all on each.
fn tooth_compliance(mesh: &WheelMesh, material: &PlaneStrain, held: impl Fn(f64) -> bool) -> f64 {
    let own = mesh.nodes_per_sector;
    let mut matrix = Symmetric::zeros(2 * own);
    add_sector(&mut matrix, mesh, material, |_| [const { Vec::new() }; 2]);
    let holds = |n: usize| held(mesh.nodes[n][0].hypot(mesh.nodes[n][1]));
    let fixed: Vec<usize> = (0..own).filter(|n| holds(*n)).flat_map(|n| [2 * n, 2 * n + 1]).collect();
    matrix.work_of(&flank_load(mesh), &fixed)
}

/// Forces of a uniform pressure on the plus flank of sector 0, normal to each edge, of 1 N/mm in all.
fn flank_load(mesh: &WheelMesh) -> Vec<f64> {
    let mut load = vec![0.0; 2 * mesh.nodes_per_sector];
    let nodes = &mesh.flanks[Side::Plus.index()].nodes;
    let mut length = 0.0;
    for edge in nodes.windows(3).step_by(2) {
        let [a, b] = [edge[0], edge[2]].map(|n| mesh.nodes[n as usize]);
        let along = [b[0] - a[0], b[1] - a[1]];
        length += along[0].hypot(along[1]);
        for (node, simpson) in edge.iter().zip([1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0]) {
            let k = 2 * *node as usize;
            load[k] -= simpson * along[1];
            load[k + 1] += simpson * along[0];
        }
    }
    load.iter_mut().for_each(|f| *f /= length);
    load
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ISO 6336-1 gives 14 N/(mm µm) as the largest stiffness of a pair of steel spur teeth of usual proportions, the
    /// load at the tip of one; stub teeth like these, loaded over the whole flank, are stiffer, but of that order.
    #[test]
    fn a_pair_of_teeth_gives_way_as_pairs_of_gears_do() {
        let drive = Drive::hhd_95();
        let stiffness = 1e-3 / pair_compliance(&drive).unwrap();
        println!("{stiffness} N/(mm µm)");
        assert!((14.0..60.0).contains(&stiffness), "{stiffness} N/(mm µm)");
        // As soft as its steel.
        let mut soft = drive.clone();
        soft.material.youngs_modulus_mpa *= 0.5;
        assert!((2e-3 / pair_compliance(&soft).unwrap() / stiffness - 1.0).abs() < 1e-9);
    }
}
