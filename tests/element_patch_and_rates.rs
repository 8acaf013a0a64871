//! The element passes the patch test, turns without stress, and converges as theory says.
//!
//! ```text
//!   +-----+------+        patch: distorted, with curved edges; affine displacement prescribed on the outside
//!   |  \  |  .'  |                must come out inside, exactly
//!   +---'-+-'----+
//!   |   . |  \   |        Lame: quarter ring a = 1, b = 2, displaced as under internal pressure;
//!   +--'--+---'--+                h, h/2, h/4, h/8: displacement error ~ h^3 (L2), energy error ~ h^4
//! ```
//!
//! Material: E = 206 000 MPa, nu = 0.3, plane strain. References: affine fields; Lame's thick cylinder, u_r = C r + D /
//! r (Timoshenko and Goodier, Theory of Elasticity, art. 28); a priori estimates for quadratic elements (Ciarlet, The
//! Finite Element Method for Elliptic Problems, th. 3.2.5). Physics wrong if this fails: gradients, Jacobian,
//! integration rule, a strain that does not vanish under rotation.

use flexspline_mechanics::fem::element::{
    GaussPoint, PACKED, add_tangent_and_force, cauchy_stress, gauss_points, linear_stiffness, shape, shape_gradient,
};
use flexspline_mechanics::fem::material::PlaneStrain;
use flexspline_mechanics::fem::{Cholesky, Factor, Pattern};

type Point = [f64; 2];

fn steel() -> PlaneStrain {
    PlaneStrain::new(206_000.0, 0.3)
}

/// A mesh of 8-node elements mapped from the unit square.
struct Mesh {
    nodes: Vec<Point>,
    elements: Vec<[u32; 8]>,
    gauss: Vec<[GaussPoint; 4]>,
    boundary: Vec<bool>,
}

impl Mesh {
    /// `n` by `n` elements; `map` takes grid coordinates in [0, 1]² to the plane.
    fn new(n: usize, map: impl Fn(Point) -> Point) -> Mesh {
        let side = 2 * n + 1;
        let mut number = vec![None; side * side];
        let (mut nodes, mut boundary) = (Vec::new(), Vec::new());
        for j in 0..side {
            for i in 0..side {
                if i % 2 == 1 && j % 2 == 1 {
                    continue; // centre of an element
                }
                number[j * side + i] = Some(nodes.len() as u32);
                nodes.push(map([i as f64 / (2 * n) as f64, j as f64 / (2 * n) as f64]));
                boundary.push(i == 0 || j == 0 || i == side - 1 || j == side - 1);
            }
        }
        let at = |i: usize, j: usize| number[j * side + i].unwrap();
        let elements: Vec<[u32; 8]> = (0..n * n)
            .map(|e| {
                let (i, j) = (2 * (e % n), 2 * (e / n));
                [
                    at(i, j),
                    at(i + 2, j),
                    at(i + 2, j + 2),
                    at(i, j + 2),
                    at(i + 1, j),
                    at(i + 2, j + 1),
                    at(i + 1, j + 2),
                    at(i, j + 1),
                ]
            })
            .collect();
        let gauss = elements.iter().map(|e| gauss_points(&e.map(|n| nodes[n as usize])).unwrap()).collect();
        Mesh { nodes, elements, gauss, boundary }
    }

    fn local(&self, element: usize, u: &[f64]) -> [f64; 16] {
        std::array::from_fn(|i| u[2 * self.elements[element][i / 2] as usize + i % 2])
    }

    /// Linear solution with `field` prescribed on the boundary.
    fn solve(&self, field: impl Fn(Point) -> Point) -> Vec<f64> {
        let mut u: Vec<f64> = self.nodes.iter().flat_map(|x| field(*x)).collect();
        let mut free = 0;
        let index: Vec<Option<u32>> = self
            .boundary
            .iter()
            .map(|held| {
                (!held).then(|| {
                    free += 1;
                    free - 1
                })
            })
            .collect();
        for (node, held) in self.boundary.iter().enumerate() {
            if !held {
                u[2 * node] = 0.0;
                u[2 * node + 1] = 0.0;
            }
        }
        let groups: Vec<Vec<u32>> =
            self.elements.iter().map(|e| e.iter().filter_map(|n| index[*n as usize]).collect()).collect();
        let pattern = Pattern::new(free as usize, groups.iter().map(Vec::as_slice), std::iter::empty());
        let mut values = vec![0.0; pattern.stored()];
        let mut force = vec![0.0; pattern.unknowns()];
        for (e, nodes) in self.elements.iter().enumerate() {
            let packed = linear_stiffness(&self.gauss[e], &steel());
            pattern.positions(&nodes.map(|n| index[n as usize])).scatter(&packed, &mut values);
            let local = self.local(e, &u);
            for i in 0..16 {
                let Some(row) = index[nodes[i / 2] as usize] else { continue };
                let k = |i: usize, j: usize| packed[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)];
                force[2 * row as usize + i % 2] -= (0..16).map(|j| k(i, j) * local[j]).sum::<f64>();
            }
        }
        let mut factor = Cholesky::new(&pattern);
        factor.factorise(&pattern, &values).unwrap();
        factor.solve(&mut force, 1);
        for (node, index) in index.iter().enumerate() {
            if let Some(k) = index {
                u[2 * node] = force[2 * *k as usize];
                u[2 * node + 1] = force[2 * *k as usize + 1];
            }
        }
        u
    }

    /// L2 norm of the error of the displacement, by the 4 x 4 rule.
    fn error(&self, u: &[f64], exact: impl Fn(Point) -> Point) -> f64 {
        let rule = flexspline_mechanics::contact::gauss_legendre(4);
        let mut sum = 0.0;
        for (e, nodes) in self.elements.iter().enumerate() {
            let local = self.local(e, u);
            for (xi, wx) in &rule {
                for (eta, wy) in &rule {
                    let (n, d) = (shape(*xi, *eta), shape_gradient(*xi, *eta));
                    let (mut x, mut v, mut j) = ([0.0; 2], [0.0; 2], [[0.0; 2]; 2]);
                    for a in 0..8 {
                        let p = self.nodes[nodes[a] as usize];
                        for k in 0..2 {
                            x[k] += n[a] * p[k];
                            v[k] += n[a] * local[2 * a + k];
                            j[k][0] += d[a][0] * p[k];
                            j[k][1] += d[a][1] * p[k];
                        }
                    }
                    let w = exact(x);
                    let area = wx * wy * (j[0][0] * j[1][1] - j[0][1] * j[1][0]);
                    sum += area * ((v[0] - w[0]).powi(2) + (v[1] - w[1]).powi(2));
                }
            }
        }
        sum.sqrt()
    }
}

/// A square bent out of shape: no element is a parallelogram and every edge is curved.
fn distorted([x, y]: Point) -> Point {
    [x + 0.06 * (5.0 * y + 2.0 * x).sin(), y + 0.05 * (4.0 * x - 1.0).cos() + 0.04 * x * y]
}

#[test]
fn an_affine_field_comes_out_exactly() {
    let mesh = Mesh::new(3, distorted);
    let affine = |[x, y]: Point| [1e-4 + 2e-3 * x - 7e-4 * y, -3e-4 + 5e-4 * x + 1.1e-3 * y];
    let u = mesh.solve(affine);
    let worst = mesh
        .nodes
        .iter()
        .enumerate()
        .flat_map(|(n, x)| {
            let exact = affine(*x);
            [(u[2 * n] - exact[0]).abs(), (u[2 * n + 1] - exact[1]).abs()]
        })
        .fold(0.0, f64::max);
    println!("patch test, small strain: displacement off by {:.1e} of the largest", worst / 2e-3);
    assert!(worst <= 1e-10 * 2e-3, "an affine field is off by {worst}");
}

/// Large strain: under a homogeneous deformation the inner nodes are in equilibrium and the stress is the same
/// everywhere.
#[test]
fn a_large_homogeneous_deformation_is_in_equilibrium() {
    let mesh = Mesh::new(3, distorted);
    let deformation = [[0.12, 0.31], [-0.2, -0.07]];
    let u: Vec<f64> = mesh
        .nodes
        .iter()
        .flat_map(|x| [0, 1].map(|i: usize| deformation[i][0] * x[0] + deformation[i][1] * x[1]))
        .collect();
    let mut force = vec![0.0; u.len()];
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for (e, nodes) in mesh.elements.iter().enumerate() {
        let mut local = [0.0; 16];
        add_tangent_and_force(&mesh.gauss[e], &steel(), &mesh.local(e, &u), &mut [0.0; PACKED], &mut local);
        for i in 0..16 {
            force[2 * nodes[i / 2] as usize + i % 2] += local[i];
        }
        for stress in mesh.gauss[e].each_ref().map(|point| cauchy_stress(point, &steel(), &mesh.local(e, &u))) {
            for k in 0..3 {
                low[k] = low[k].min(stress[k]);
                high[k] = high[k].max(stress[k]);
            }
        }
    }
    let scale = force.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
    let inside = (0..mesh.nodes.len())
        .filter(|n| !mesh.boundary[*n])
        .flat_map(|n| [force[2 * n].abs(), force[2 * n + 1].abs()])
        .fold(0.0, f64::max);
    let spread = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max) / high[0].abs();
    println!("patch test, large strain: inner forces {:.1e} of the outer, stress even to {spread:.1e}", inside / scale);
    assert!(inside <= 1e-10 * scale && spread <= 1e-10);
}

#[test]
fn a_rigid_motion_is_free_of_stress() {
    let mesh = Mesh::new(3, distorted);
    let mut worst = 0.0_f64;
    for angle in [0.01_f64, 1.0, -2.5] {
        let (s, c) = angle.sin_cos();
        let u: Vec<f64> = mesh
            .nodes
            .iter()
            .flat_map(|x| [c * x[0] - s * x[1] - x[0] + 0.7, s * x[0] + c * x[1] - x[1] - 0.3])
            .collect();
        for e in 0..mesh.elements.len() {
            let mut force = [0.0; 16];
            add_tangent_and_force(&mesh.gauss[e], &steel(), &mesh.local(e, &u), &mut [0.0; PACKED], &mut force);
            worst = force.iter().fold(worst, |m, f| m.max(f.abs()));
        }
    }
    println!("rigid motion: forces up to {:.1e} of E times 1 mm", worst / 206_000.0);
    assert!(worst <= 1e-10 * 206_000.0);
}

#[test]
fn the_thick_ring_converges_with_the_third_power_of_the_element() {
    let lame = |[x, y]: Point| {
        let r2 = x * x + y * y;
        let radial = 4e-4 + 2.5e-3 / r2;
        [radial * x, radial * y]
    };
    let quarter = |[s, t]: Point| {
        let (r, angle) = (1.0 + s, std::f64::consts::FRAC_PI_2 * t);
        [r * angle.cos(), r * angle.sin()]
    };
    let (a, b) = (4e-4, 2.5e-3);
    let (lambda, mu) = (steel().lambda, steel().mu);
    // u_r = A r + B / r: strains A - B/r^2 and A + B/r^2, energy density 2 (lambda + mu) A^2 + 2 mu B^2 / r^4.
    let exact_energy =
        std::f64::consts::FRAC_PI_2 * (2.0 * (lambda + mu) * a * a * 1.5 + 2.0 * mu * b * b * (1.0 - 0.25) / 2.0);
    let mut before: Option<(f64, f64)> = None;
    let mut rates = Vec::new();
    for n in [2, 4, 8, 16] {
        let mesh = Mesh::new(n, quarter);
        let u = mesh.solve(lame);
        let displacement = mesh.error(&u, lame);
        // Small-strain energy: half of u K u.
        let energy: f64 = (0..mesh.elements.len())
            .map(|e| {
                let packed = linear_stiffness(&mesh.gauss[e], &steel());
                let local = mesh.local(e, &u);
                let mut sum = 0.0;
                for i in 0..16 {
                    for j in 0..i {
                        sum += packed[i * (i + 1) / 2 + j] * local[i] * local[j];
                    }
                    sum += 0.5 * packed[i * (i + 1) / 2 + i] * local[i] * local[i];
                }
                sum
            })
            .sum();
        let energy = (energy / exact_energy - 1.0).abs();
        // The linear solution, made small, also balances the forces of the full, non-linear element.
        let small: Vec<f64> = u.iter().map(|x| 1e-4 * x).collect();
        let mut force = vec![0.0; u.len()];
        for (e, nodes) in mesh.elements.iter().enumerate() {
            let mut local = [0.0; 16];
            add_tangent_and_force(&mesh.gauss[e], &steel(), &mesh.local(e, &small), &mut [0.0; PACKED], &mut local);
            for i in 0..16 {
                force[2 * nodes[i / 2] as usize + i % 2] += local[i];
            }
        }
        let largest = force.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
        for node in (0..mesh.nodes.len()).filter(|n| !mesh.boundary[*n]) {
            let left = force[2 * node].hypot(force[2 * node + 1]) / largest;
            assert!(left < 1e-5, "node {node} is out of balance by {left} of the largest force");
        }
        if let Some((displacement_before, energy_before)) = before {
            let rate = [f64::log2(displacement_before / displacement), f64::log2(energy_before / energy)];
            println!(
                "Lame ring, {n} x {n}: displacement error {displacement:.2e} (rate {:.2}), energy error {energy:.2e} \
                 (rate {:.2})",
                rate[0], rate[1]
            );
            rates.push(rate);
        }
        before = Some((displacement, energy));
    }
    let [displacement_rate, energy_rate] = rates[rates.len() - 1];
    assert!((2.7..4.3).contains(&displacement_rate), "displacement error falls as h^{displacement_rate}");
    assert!((3.6..5.0).contains(&energy_rate), "energy error falls as h^{energy_rate}");
    let (displacement, energy) = before.unwrap();
    assert!(displacement < 2e-8 && energy < 1e-6, "finest mesh: {displacement} mm, {energy}");
}
