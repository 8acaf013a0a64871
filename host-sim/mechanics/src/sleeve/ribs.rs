//! Contribution of the teeth to the stiffness of the rim under them: along the axis they are ribs, around it they
//! stiffen their roots.

use super::matrix::Symmetric;
use super::shell::Ribs;
use crate::drive::{Drive, DriveError, ToothFlank};
use crate::fem::element::linear_stiffness;
use crate::fem::material::PlaneStrain;
use crate::mesh::{MeshError, MeshLevel, WheelMesh, rotate};

/// Slices of a tooth from root to tip. Twice as many change its second moment by less than 1e-4.
const SLICES: usize = 200;

impl Ribs {
    /// The teeth of a drive on its rim.
    ///
    /// Along the axis a tooth is a straight rib of its own cross-section: it carries its area, and its second moment
    /// about the common centroid, in addition to the wall's. Around the axis the toothed rim bends like a smooth one
    /// that is stiffer; by how much is asked of plane FEM of one tooth pitch in pure bending.
    pub fn of_teeth(drive: &Drive) -> Result<Ribs, MeshError> {
        let wheel = &drive.flexspline;
        let wall = wheel.rim_thickness_mm;
        let pitch = 2.0 * std::f64::consts::PI * wheel.neutral_radius_mm() / f64::from(wheel.teeth);
        let [area, first, second] = tooth_moments(drive)?;
        // Per pitch, about the middle of the wall; then about the centroid of both.
        let total = pitch * wall + area;
        let about_middle = pitch * wall.powi(3) / 12.0 + second;
        Ok(Ribs {
            membrane_axial: total / (pitch * wall),
            bending_axial: (about_middle - first * first / total) / (pitch * wall.powi(3) / 12.0),
            bending_around: bending_around(drive)?,
        })
    }
}

/// Area of a tooth above the root circle (mm²) and its first and second moments about the middle of the rim.
fn tooth_moments(drive: &Drive) -> Result<[f64; 3], DriveError> {
    let wheel = &drive.flexspline;
    let outline = ToothFlank::external(drive)?;
    let (root, tip) = outline.root_and_tip_radius();
    let slice = (tip - root) / SLICES as f64;
    let mut moments = [0.0; 3];
    for k in 0..SLICES {
        let radius = root + (k as f64 + 0.5) * slice;
        let half_angle = outline.angle_at_radius(radius).unwrap_or(0.0);
        let area = 2.0 * half_angle * radius * slice;
        let above = radius - wheel.neutral_radius_mm();
        moments[0] += area;
        moments[1] += area * above;
        moments[2] += area * (above * above + slice * slice / 12.0);
    }
    Ok(moments)
}

/// Adds the small-strain stiffness of sector 0 of a mesh. The nodes on its far face move as those on the near one,
/// turned by a pitch, and by the unknowns and weights that `beyond` gives for a node of the far face in each direction.
pub(super) fn add_sector(
    to: &mut Symmetric,
    mesh: &WheelMesh,
    material: &PlaneStrain,
    beyond: impl Fn([f64; 2]) -> [Vec<(usize, f64)>; 2],
) {
    let own = mesh.nodes_per_sector;
    let [along, across] = [[1.0, 0.0], [0.0, 1.0]].map(|axis| rotate(axis, mesh.pitch().sin_cos()));
    for (element, points) in mesh.elements.iter().zip(&mesh.gauss).take(mesh.elements_per_sector) {
        // Each displacement of a node by the unknowns that it follows.
        let follows = |&node: &u32| {
            let node = node as usize;
            if node < own {
                return [vec![(2 * node, 1.0)], vec![(2 * node + 1, 1.0)]];
            }
            let near = 2 * (node - own);
            let more = beyond(mesh.nodes[node]);
            [0, 1].map(|k| [&[(near, along[k]), (near + 1, across[k])], more[k].as_slice()].concat())
        };
        let follows: Vec<Vec<(usize, f64)>> = element.iter().flat_map(follows).collect();
        to.add_following(&linear_stiffness(points, material), &follows);
    }
}

/// Bending stiffness of the toothed rim around the axis, relative to that of the smooth one.
///
/// One sector of the mesh; its far face moves as the near one, turned by a pitch, and in addition as a rigid body: by a
/// translation that is free and a rotation, whose stiffness is asked for.
fn bending_around(drive: &Drive) -> Result<f64, MeshError> {
    let plain = Drive { as_built: Default::default(), ..drive.clone() };
    let mesh = WheelMesh::flexspline(&plain, MeshLevel::Coarse)?;
    let material = PlaneStrain::new(drive.material.youngs_modulus_mpa, drive.material.poissons_ratio);
    let own = mesh.nodes_per_sector;
    let rigid = 2 * own;
    let mut matrix = Symmetric::zeros(rigid + 3);
    add_sector(&mut matrix, &mesh, &material, |[x, y]| [0, 1].map(|k| vec![(rigid + k, 1.0), (rigid + 2, [-y, x][k])]));
    let rotation = matrix.condensed(&[rigid + 2], &[]).at(0, 0);
    let (wall, radius) = (drive.flexspline.rim_thickness_mm, drive.flexspline.neutral_radius_mm());
    let smooth = drive.material.plane_strain_modulus_mpa() * wall.powi(3) / 12.0;
    Ok(rotation * mesh.pitch() * radius / smooth)
}

#[cfg(test)]
mod tests {
    use super::super::model::Flexspline3d;
    use super::*;

    /// Area and moments of a tooth by Green's theorem on the corners of its outline.
    #[test]
    fn moments_are_those_of_the_outline() {
        let drive = Drive::hhd_95();
        let outline = ToothFlank::external(&drive).unwrap();
        let (root, middle) = (drive.flexspline.root_radius_mm, drive.flexspline.neutral_radius_mm());
        // In polar coordinates the wall is straight: x is r angle, y is r - R.
        let mut corners: Vec<[f64; 2]> = outline.pieces()[1..]
            .iter()
            .flat_map(|piece| (0..400).map(|k| piece.point(f64::from(k) / 399.0)))
            .map(|[x, y]| [y.atan2(x) * x.hypot(y), x.hypot(y) - middle])
            .collect();
        corners.insert(0, [0.0, root - middle]);
        let mut moments = [0.0; 3];
        for pair in corners.windows(2) {
            let ([x0, y0], [x1, y1]) = (pair[0], pair[1]);
            // Integrals of x dy, x y dy, x y² dy along a straight line, doubled for the other side.
            let (mean, dy) = (0.5 * (y0 + y1), y1 - y0);
            let x = 0.5 * (x0 + x1);
            moments[0] += 2.0 * x * dy;
            moments[1] += 2.0 * x * mean * dy;
            moments[2] += 2.0 * x * mean * mean * dy;
        }
        for (found, expected) in tooth_moments(&drive).unwrap().into_iter().zip(moments) {
            assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
        }
    }

    /// Solid elements with ribs in CalculiX are met to 2 % by membrane x 1.44 and bending x 4.2 along the axis and x
    /// 1.245 around: rectangles five ninths of a pitch wide, and plane FEM. Real teeth taper; the stiffness of the band
    /// hardly feels it.
    #[test]
    fn teeth_stiffen_the_rim_as_ribs_of_solid_elements() {
        let found = Ribs::of_teeth(&Drive::hhd_95()).unwrap();
        assert!((found.bending_around / 1.245 - 1.0).abs() < 0.002, "{found:?}");
        assert!((found.membrane_axial / 1.44 - 1.0).abs() < 0.03, "{found:?}");
        let hermetic = Drive::hhd_95().with_set("sleeve.kind=hermetic").unwrap();
        let teeth = Flexspline3d::of(&hermetic, true).unwrap();
        let mut rectangles = teeth.clone();
        rectangles.rim.ribs = Ribs { membrane_axial: 1.44, bending_axial: 4.2, bending_around: 1.245 };
        let smooth = Flexspline3d::of(&hermetic, false).unwrap();
        let stiffness = |rim: &Flexspline3d, n: u32| rim.harmonic(n).k_band_n_per_mm;
        for n in [2, 4, 6, 8] {
            let apart = stiffness(&teeth, n) / stiffness(&rectangles, n) - 1.0;
            let added = stiffness(&teeth, n) / stiffness(&smooth, n) - 1.0;
            assert!(apart.abs() < 3e-3 && added > 5.0 * apart.abs(), "n {n}: {apart} of {added}");
        }
    }

    /// The factors of a rib do not depend on its size.
    #[test]
    fn ribs_do_not_depend_on_the_scale() {
        let small = Drive::hhd_95();
        let mut large = small.clone();
        let f = &mut large.flexspline;
        for length in [
            &mut f.module_mm,
            &mut f.root_radius_mm,
            &mut f.tip_radius_mm,
            &mut f.rim_thickness_mm,
            &mut f.root_fillet_mm,
            &mut f.tip_rounding_mm,
        ] {
            *length *= 2.0;
        }
        let [a, b] = [&small, &large].map(|drive| Ribs::of_teeth(drive).unwrap());
        assert!((a.membrane_axial - b.membrane_axial).abs() < 1e-9, "{a:?} {b:?}");
        assert!((a.bending_axial - b.bending_axial).abs() < 1e-9);
        assert!((a.bending_around - b.bending_around).abs() < 1e-7);
    }
}
