//! The 8-node quadrilateral in plane strain, geometrically non-linear (total Lagrangian), 2 x 2 integration points.
//!
//! ```text
//!   3---6---2        nodes counter-clockwise, corners first; edge i runs from corner i to corner i+1
//!   |       |        through midside node 4+i
//!   7       5
//!   |       |        eta
//!   0---4---1        |_ xi
//! ```
//!
//! Two points in each direction bend right: three stiffen the toothed rim by 0.8 % at 45 elements a tooth. The single
//! spurious mode of one element cannot travel through a mesh of two or more.
//!
//! With `g_a` the reference gradient of shape function a and `h_a = F g_a`, the material tangent of an isotropic
//! St Venant-Kirchhoff solid is
//!
//! `K_ab = sum w [ lambda h_a h_b^T + mu h_b h_a^T + mu (g_a . g_b) F F^T + (g_a . S g_b) I ]`,
//!
//! which needs no strain-displacement matrix (Belytschko, Liu, Moran, Nonlinear Finite Elements, 4.9, specialised).
//! Everything is per unit width: forces N/mm, stiffness N/mm per mm.

use pulp::{Arch, Simd, WithSimd};

use crate::condense::kernel;
use crate::fem::material::PlaneStrain;

/// Length of the packed lower triangle of a 16 x 16 element matrix: entry (i, j <= i) sits at `i (i+1)/2 + j`.
pub const PACKED: usize = 136;

/// Place of entry (i, j), or of its mirror image, in a packed lower triangle.
#[inline]
pub fn packed_index(i: usize, j: usize) -> usize {
    let (row, column) = if i >= j { (i, j) } else { (j, i) };
    row * (row + 1) / 2 + column
}

/// Reference gradients and weight of one integration point.
#[derive(Debug, Clone, Copy)]
pub struct GaussPoint {
    /// `dN_a/dX`, 1/mm.
    pub gradient: [[f64; 2]; 8],
    /// Area represented by the point, mm² (weight times Jacobian).
    pub area: f64,
}

/// An element whose mapping folds over: the Jacobian at an integration point is not positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoldedElement {
    /// The Jacobian found, mm².
    pub jacobian: f64,
}

/// Shape functions at `(xi, eta)` in [-1, 1]².
pub fn shape(xi: f64, eta: f64) -> [f64; 8] {
    let corner = |a: f64, b: f64| 0.25 * (1.0 + a * xi) * (1.0 + b * eta) * (a * xi + b * eta - 1.0);
    [
        corner(-1.0, -1.0),
        corner(1.0, -1.0),
        corner(1.0, 1.0),
        corner(-1.0, 1.0),
        0.5 * (1.0 - xi * xi) * (1.0 - eta),
        0.5 * (1.0 + xi) * (1.0 - eta * eta),
        0.5 * (1.0 - xi * xi) * (1.0 + eta),
        0.5 * (1.0 - xi) * (1.0 - eta * eta),
    ]
}

/// Derivatives of the shape functions with respect to `(xi, eta)`.
pub fn shape_gradient(xi: f64, eta: f64) -> [[f64; 2]; 8] {
    let corner = |a: f64, b: f64| {
        [0.25 * a * (1.0 + b * eta) * (2.0 * a * xi + b * eta), 0.25 * b * (1.0 + a * xi) * (a * xi + 2.0 * b * eta)]
    };
    [
        corner(-1.0, -1.0),
        corner(1.0, -1.0),
        corner(1.0, 1.0),
        corner(-1.0, 1.0),
        [-xi * (1.0 - eta), -0.5 * (1.0 - xi * xi)],
        [0.5 * (1.0 - eta * eta), -eta * (1.0 + xi)],
        [-xi * (1.0 + eta), 0.5 * (1.0 - xi * xi)],
        [-0.5 * (1.0 - eta * eta), -eta * (1.0 - xi)],
    ]
}

/// Shape functions of the three nodes of an edge (start, middle, end) at `xi` in [-1, 1].
#[inline]
pub fn edge_shape(xi: f64) -> [f64; 3] {
    [0.5 * xi * (xi - 1.0), 1.0 - xi * xi, 0.5 * xi * (xi + 1.0)]
}

/// Derivatives of [`edge_shape`] with respect to `xi`.
#[inline]
pub(crate) fn edge_shape_derivative(xi: f64) -> [f64; 3] {
    [xi - 0.5, -2.0 * xi, xi + 0.5]
}

/// The four points of the 2 x 2 rule, all of weight 1.
pub(crate) fn integration_points() -> [[f64; 2]; 4] {
    let a = 1.0 / 3.0_f64.sqrt();
    [[-a, -a], [a, -a], [a, a], [-a, a]]
}

/// Reference gradients and areas of an element with nodes at `coordinates` (mm).
pub fn gauss_points(coordinates: &[[f64; 2]; 8]) -> Result<[GaussPoint; 4], FoldedElement> {
    let mut points = [GaussPoint { gradient: [[0.0; 2]; 8], area: 0.0 }; 4];
    for (point, [xi, eta]) in points.iter_mut().zip(integration_points()) {
        let local = shape_gradient(xi, eta);
        let mut jacobian = [[0.0; 2]; 2]; // [i][j] = dX_i / dxi_j
        for (x, d) in coordinates.iter().zip(&local) {
            for i in 0..2 {
                for j in 0..2 {
                    jacobian[i][j] += x[i] * d[j];
                }
            }
        }
        let determinant = jacobian[0][0] * jacobian[1][1] - jacobian[0][1] * jacobian[1][0];
        if determinant.is_nan() || determinant <= 0.0 {
            return Err(FoldedElement { jacobian: determinant });
        }
        for (g, d) in point.gradient.iter_mut().zip(&local) {
            *g = [
                (jacobian[1][1] * d[0] - jacobian[1][0] * d[1]) / determinant,
                (jacobian[0][0] * d[1] - jacobian[0][1] * d[0]) / determinant,
            ];
        }
        point.area = determinant;
    }
    Ok(points)
}

/// Deformation gradient `[F11, F12, F21, F22]` at an integration point.
#[inline(always)]
fn deformation_gradient(point: &GaussPoint, u: &[f64; 16]) -> [f64; 4] {
    let mut f = [1.0, 0.0, 0.0, 1.0];
    for (a, g) in point.gradient.iter().enumerate() {
        f[0] += u[2 * a] * g[0];
        f[1] += u[2 * a] * g[1];
        f[2] += u[2 * a + 1] * g[0];
        f[3] += u[2 * a + 1] * g[1];
    }
    f
}

/// Green-Lagrange strain `[E11, E22, E12]` of a deformation gradient.
#[inline(always)]
fn green_strain(f: [f64; 4]) -> [f64; 3] {
    let [f11, f12, f21, f22] = f;
    [0.5 * (f11 * f11 + f21 * f21 - 1.0), 0.5 * (f12 * f12 + f22 * f22 - 1.0), 0.5 * (f11 * f12 + f21 * f22)]
}

/// Tangent stiffness, packed lower triangle, added to `stiffness`; the internal force is added to `force`.
#[inline]
pub fn add_tangent_and_force(
    points: &[GaussPoint; 4],
    material: &PlaneStrain,
    u: &[f64; 16],
    stiffness: &mut [f64; PACKED],
    force: &mut [f64; 16],
) {
    for point in points {
        let f = deformation_gradient(point, u);
        let s = material.stress(green_strain(f));
        let w = point.area;
        let (wl, wm) = (w * material.lambda, w * material.mu);
        // F F^T, scaled.
        let b11 = wm * (f[0] * f[0] + f[1] * f[1]);
        let b12 = wm * (f[0] * f[2] + f[1] * f[3]);
        let b22 = wm * (f[2] * f[2] + f[3] * f[3]);
        let mut h = [[0.0; 2]; 8];
        let mut sg = [[0.0; 2]; 8];
        for a in 0..8 {
            let g = point.gradient[a];
            h[a] = [f[0] * g[0] + f[1] * g[1], f[2] * g[0] + f[3] * g[1]];
            sg[a] = [w * (s[0] * g[0] + s[2] * g[1]), w * (s[2] * g[0] + s[1] * g[1])];
            // Internal force: F S g.
            force[2 * a] += f[0] * sg[a][0] + f[1] * sg[a][1];
            force[2 * a + 1] += f[2] * sg[a][0] + f[3] * sg[a][1];
        }
        for a in 0..8 {
            let (ha, ga) = (h[a], point.gradient[a]);
            let (lx, ly) = (wl * ha[0], wl * ha[1]);
            let (mx, my) = (wm * ha[0], wm * ha[1]);
            let row_x = a * (2 * a + 1); // start of packed row 2a
            let row_y = row_x + 2 * a + 1; // start of packed row 2a + 1
            for b in 0..=a {
                let (hb, gb) = (h[b], point.gradient[b]);
                let gg = ga[0] * gb[0] + ga[1] * gb[1];
                let geometric = ga[0] * sg[b][0] + ga[1] * sg[b][1];
                stiffness[row_x + 2 * b] += lx * hb[0] + mx * hb[0] + gg * b11 + geometric;
                if b < a {
                    stiffness[row_x + 2 * b + 1] += lx * hb[1] + my * hb[0] + gg * b12;
                }
                stiffness[row_y + 2 * b] += ly * hb[0] + mx * hb[1] + gg * b12;
                stiffness[row_y + 2 * b + 1] += ly * hb[1] + my * hb[1] + gg * b22 + geometric;
            }
        }
    }
}

/// Small-strain stiffness (the tangent at rest), packed lower triangle.
pub fn linear_stiffness(points: &[GaussPoint; 4], material: &PlaneStrain) -> [f64; PACKED] {
    let mut stiffness = [0.0; PACKED];
    add_tangent_and_force(points, material, &[0.0; 16], &mut stiffness, &mut [0.0; 16]);
    stiffness
}

/// Cauchy stress `[s11, s22, s12]` (MPa) at each node of a mesh with nodal displacements `field` (x and y of each
/// node): that of the integration points carried to the nodes of their element by the bilinear field through them,
/// averaged over the elements that meet in a node.
pub fn nodal_stress(
    (elements, gauss): (&[[u32; 8]], &[[GaussPoint; 4]]),
    material: &PlaneStrain,
    field: &[f64],
) -> Vec<[f64; 3]> {
    // The fourth number counts the elements.
    let mut sums = vec![[0.0; 4]; field.len() / 2];
    Arch::new().dispatch(AddStress { elements, gauss, material, field, sums: &mut sums });
    sums.into_iter().map(|[s11, s22, s12, count]| [s11 / count, s22 / count, s12 / count]).collect()
}

// Adds the stress of each element to that of its nodes, in the order of the elements.
kernel!(AddStress {
    elements: &'a [[u32; 8]], gauss: &'a [[GaussPoint; 4]], material: &'a PlaneStrain, field: &'a [f64],
    sums: &'a mut [[f64; 4]]
} -> (), |_simd| {
    for (element, points) in elements.iter().zip(gauss) {
        let u = std::array::from_fn(|i| field[2 * element[i / 2] as usize + i % 2]);
        let at_points = [0, 1, 2, 3].map(|k| cauchy_stress(&points[k], material, &u));
        for (n, stress) in element.iter().zip(extrapolate_to_nodes(&at_points)) {
            sums[*n as usize].iter_mut().zip(stress).for_each(|(sum, s)| *sum += s);
        }
    }
});

/// Cauchy stress `[s11, s22, s12]` (MPa) at an integration point.
#[inline(always)]
pub fn cauchy_stress(point: &GaussPoint, material: &PlaneStrain, u: &[f64; 16]) -> [f64; 3] {
    let f = deformation_gradient(point, u);
    let [s11, s22, s12] = material.stress(green_strain(f));
    let j = f[0] * f[3] - f[1] * f[2];
    // sigma = F S F^T / J
    let fs = [f[0] * s11 + f[1] * s12, f[0] * s12 + f[1] * s22, f[2] * s11 + f[3] * s12, f[2] * s12 + f[3] * s22];
    [(fs[0] * f[0] + fs[1] * f[1]) / j, (fs[2] * f[2] + fs[3] * f[3]) / j, (fs[0] * f[2] + fs[1] * f[3]) / j]
}

/// Values at the four integration points carried to the eight nodes by the bilinear field through them, and one.
#[inline(always)]
fn extrapolate_to_nodes(values: &[[f64; 3]; 4]) -> [[f64; 4]; 8] {
    let r = 3.0_f64.sqrt();
    let at = |[xi, eta]: [f64; 2]| {
        let of = |k: usize| {
            0.25 * (values[0][k] * (1.0 - r * xi) * (1.0 - r * eta)
                + values[1][k] * (1.0 + r * xi) * (1.0 - r * eta)
                + values[2][k] * (1.0 + r * xi) * (1.0 + r * eta)
                + values[3][k] * (1.0 - r * xi) * (1.0 + r * eta))
        };
        [of(0), of(1), of(2), 1.0]
    };
    // Corners, then the middles of the edges.
    [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]].map(at)
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEEL: PlaneStrain = PlaneStrain { lambda: 118_846.15, mu: 79_230.77 };

    /// A distorted element with curved edges.
    fn distorted() -> [[f64; 2]; 8] {
        [[0.0, 0.0], [1.1, -0.1], [1.3, 0.9], [-0.1, 1.2], [0.5, -0.12], [1.25, 0.42], [0.62, 1.1], [-0.09, 0.6]]
    }

    fn some_displacement() -> [f64; 16] {
        std::array::from_fn(|i| 0.02 * ((i as f64) * 1.7).sin())
    }

    #[test]
    fn shape_functions_are_nodal_and_sum_to_one() {
        let nodes = [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.], [0., -1.], [1., 0.], [0., 1.], [-1., 0.]];
        for (a, [xi, eta]) in nodes.iter().enumerate() {
            for (b, n) in shape(*xi, *eta).iter().enumerate() {
                assert!((n - f64::from(u8::from(a == b))).abs() < 1e-15);
            }
        }
        assert!((shape(0.3, -0.7).iter().sum::<f64>() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn shape_gradient_agrees_with_differences() {
        let (xi, eta, step) = (0.31, -0.67, 1e-6);
        let g = shape_gradient(xi, eta);
        for a in 0..8 {
            let dx = (shape(xi + step, eta)[a] - shape(xi - step, eta)[a]) / (2.0 * step);
            let dy = (shape(xi, eta + step)[a] - shape(xi, eta - step)[a]) / (2.0 * step);
            assert!((g[a][0] - dx).abs() < 1e-9 && (g[a][1] - dy).abs() < 1e-9);
        }
    }

    fn force(points: &[GaussPoint; 4], u: &[f64; 16]) -> [f64; 16] {
        let mut force = [0.0; 16];
        add_tangent_and_force(points, &STEEL, u, &mut [0.0; PACKED], &mut force);
        force
    }

    /// Strain energy (N mm per mm of width) of the displacements `u`.
    fn strain_energy(points: &[GaussPoint; 4], material: &PlaneStrain, u: &[f64; 16]) -> f64 {
        points
            .iter()
            .map(|point| {
                let e = green_strain(deformation_gradient(point, u));
                let s = material.stress(e);
                0.5 * point.area * (s[0] * e[0] + s[1] * e[1] + 2.0 * s[2] * e[2])
            })
            .sum()
    }

    #[test]
    fn a_rigid_motion_stores_no_energy() {
        let (points, x) = (gauss_points(&distorted()).unwrap(), distorted());
        for (s, c) in [0.01_f64, 1.0, -2.5].map(f64::sin_cos) {
            let moved = x.map(|[x, y]| [c * x - s * y - x + 0.7, s * x + c * y - y - 0.3]);
            let energy = strain_energy(&points, &STEEL, &std::array::from_fn(|i| moved[i / 2][i % 2]));
            assert!(energy < 1e-20 * 206_000.0, "turned by {s}, {c}: energy {energy}");
        }
    }

    #[test]
    fn force_is_the_gradient_of_the_energy_and_tangent_that_of_the_force() {
        let points = gauss_points(&distorted()).unwrap();
        let u = some_displacement();
        let (mut k, mut f) = ([0.0; PACKED], [0.0; 16]);
        add_tangent_and_force(&points, &STEEL, &u, &mut k, &mut f);
        let step = 1e-6;
        for i in 0..16 {
            let (mut up, mut down) = (u, u);
            up[i] += step;
            down[i] -= step;
            let slope = (strain_energy(&points, &STEEL, &up) - strain_energy(&points, &STEEL, &down)) / (2.0 * step);
            assert!((slope - f[i]).abs() < 1e-5 * STEEL.mu, "force {i}: {slope} against {}", f[i]);
            let [f_up, f_down] = [up, down].map(|u| force(&points, &u));
            for j in 0..=i {
                let slope = (f_up[j] - f_down[j]) / (2.0 * step);
                assert!((slope - k[i * (i + 1) / 2 + j]).abs() < 1e-5 * STEEL.mu, "tangent {i},{j}");
            }
        }
    }

    #[test]
    fn a_folded_element_is_refused() {
        let mut nodes = distorted();
        nodes.swap(1, 3);
        assert!(gauss_points(&nodes).is_err());
    }
}
