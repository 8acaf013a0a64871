//! A plane ring-shaped plate across the end of a tube, one Fourier harmonic at a time: a bottom, or a flexible flange.
//!
//! In polar coordinates, with `u_r = P cos n theta`, `u_t = Q sin n theta` in its plane and the deflection
//! `Z cos n theta` along the axis, Kirchhoff's plate has
//!
//! ```text
//!   eps_r = P'     eps_t = (P + n Q)/r         gamma = Q' - Q/r - n P/r
//!   kap_r = Z''    kap_t = Z'/r - n² Z/r²      tau   = -2 n (Z'/r - Z/r²)
//! ```
//!
//! and the energy of [`super::shell`]. The right angle between plate and tube stays one: `Z' = -W'`.

use super::matrix::Symmetric;
use super::shell::{GAUSS, NODE, SLOPE, Shell, U, U_SLOPE, V, V_SLOPE, W, add_energy, around, hermite, row, sum};
use super::tube::Edge;

/// Elements from edge to edge, their radii growing by equal factors. Twice as many change a full disc by less than 1e-5
/// (a test).
const ELEMENTS: usize = 48;
/// Radius of the hole that stands for the centre of a full disc, relative to its edge.
const CENTRE: f64 = 1e-3;

/// A plate between the edge of a tube and another radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plate {
    /// Material, thickness, and the radius at which it meets the tube.
    pub wall: Shell,
    /// Where it ends.
    pub to: PlateEdge,
}

/// The edge of a plate that is not the tube's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlateEdge {
    /// There is none: the plate is a full disc.
    Centre,
    /// Clamped at this radius (mm), on a hub inside or a flange outside.
    Clamped(f64),
}

impl Plate {
    /// Stiffness of the edge that the tube holds, in the tube's U, V, W and slope.
    pub(super) fn rim(&self, n: u32) -> Edge {
        let from = self.wall.radius_mm;
        let (to, held) = match self.to {
            PlateEdge::Centre => (CENTRE * from, false),
            PlateEdge::Clamped(radius) => (radius, true),
        };
        // From the far edge to the tube.
        let radius = |k: usize| to * (from / to).powf(k as f64 / ELEMENTS as f64);
        let mut beyond = Symmetric::zeros(NODE);
        for k in 0..ELEMENTS {
            let element = self.element(radius(k), radius(k + 1), n);
            let mut front = Symmetric::zeros(2 * NODE);
            front.add_at(&element, std::array::from_fn(|i| i));
            front.add_at(&beyond.array::<NODE>(), std::array::from_fn(|i| i));
            let fixed: &[usize] = if held && k == 0 { &[U, V, W, SLOPE] } else { &[] };
            beyond = front.condensed(&std::array::from_fn::<usize, NODE, _>(|i| NODE + i), fixed);
        }
        let edge = beyond.condensed(&[U, V, W, SLOPE], &[]);
        // Z' = -W'.
        let sign = |i: usize| if i == SLOPE { -1.0 } else { 1.0 };
        std::array::from_fn(|i| std::array::from_fn(|j| sign(i) * sign(j) * edge.at(i, j)))
    }

    /// Stiffness of the ring between two radii. Unknowns as of a shell: U is Z, V is Q, W is P, SLOPE is Z', U_SLOPE is
    /// P'.
    fn element(&self, inner: f64, outer: f64, n: u32) -> [[f64; 2 * NODE]; 2 * NODE] {
        let (nu, order, length) = (self.wall.poissons_ratio, f64::from(n), outer - inner);
        let shear = 0.5 * (1.0 - nu);
        let mut matrix = [[0.0; 2 * NODE]; 2 * NODE];
        for (at, weight) in GAUSS {
            let s = 0.5 * (1.0 + at);
            let r = inner + s * length;
            let [value, first, second] = hermite(s, length);
            let (z, z1, z2) = (row(value, U, SLOPE), row(first, U, SLOPE), row(second, U, SLOPE));
            let (q, q1) = (row(value, V, V_SLOPE), row(first, V, V_SLOPE));
            let (p, p1) = (row(value, W, U_SLOPE), row(first, W, U_SLOPE));
            let strains =
                [p1, sum(&[(1.0 / r, &p), (order / r, &q)]), sum(&[(1.0, &q1), (-1.0 / r, &q), (-order / r, &p)])];
            let curvatures = [
                z2,
                sum(&[(1.0 / r, &z1), (-order * order / (r * r), &z)]),
                sum(&[(-2.0 * order / r, &z1), (2.0 * order / (r * r), &z)]),
            ];
            let area = around(n) * r * 0.5 * length.abs() * weight;
            let c = area * self.wall.membrane();
            add_energy(&mut matrix, &strains, [c, c, c * nu, c * shear]);
            let d = area * self.wall.bending();
            add_energy(&mut matrix, &curvatures, [d, d, d * nu, d * shear]);
        }
        matrix
    }
}

#[cfg(test)]
mod tests {
    use super::super::shell::Ribs;
    use super::*;
    use std::f64::consts::PI;

    fn plate(to: PlateEdge) -> Plate {
        let wall = Shell {
            radius_mm: 47.275,
            thickness_mm: 2.0,
            youngs_modulus_mpa: 206_000.0,
            poissons_ratio: 0.3,
            ribs: Ribs::NONE,
        };
        Plate { wall, to }
    }

    /// A full disc, n = 2. In its plane the two displacements follow from the complex potentials `A z³` and `B z` of
    /// Kolosov, `2G u_r = (kappa - 3) A r³ - B r`, `2G u_t = (kappa + 3) A r³ + B r`, with the edge stresses
    /// `s_r = -B`, `s_rt = 6 A r² + B` (plane stress). Its deflection is `a r² + b r⁴`.
    #[test]
    fn a_full_disc_is_as_stiff_as_the_closed_form() {
        let edge = plate(PlateEdge::Centre).rim(2);
        let Shell { radius_mm: r, thickness_mm: t, youngs_modulus_mpa: e, poissons_ratio: nu, .. } =
            plate(PlateEdge::Centre).wall;
        let g = e / (2.0 * (1.0 + nu));
        let kappa = (3.0 - nu) / (1.0 + nu);
        // W = 1, V = 0 at the edge.
        let (p, q) = ((kappa - 3.0) * r.powi(3) / (2.0 * g), (kappa + 3.0) * r.powi(3) / (2.0 * g));
        let (b_w, b_v) = (-r / (2.0 * g), r / (2.0 * g));
        let determinant = p * b_v - b_w * q;
        let (a, b) = (b_v / determinant, -q / determinant);
        assert!((edge[W][W] / (PI * r * t * -b) - 1.0).abs() < 1e-4, "{}", edge[W][W]);
        assert!((edge[V][W] / (PI * r * t * (6.0 * a * r * r + b)) - 1.0).abs() < 1e-4, "{}", edge[V][W]);
        // Z = 1, Z' = 0 at the edge: a = 2/r², b = -1/r⁴; edge force of Kirchhoff -D[(lap)' - (1-nu) n² (w/r² - w'/r)/r
        // ...].
        let d = e * t.powi(3) / (12.0 * (1.0 - nu * nu));
        let (a, b) = (2.0 / (r * r), -1.0 / r.powi(4));
        // w = a r² + b r⁴: lap w = 12 b r² cos; (lap)' = 24 b r; (w'/r - w/r²)' ... of the twist: (a + 3 b r²) -> n²
        // (p-1) r^(p-3).
        let force = d * (-24.0 * b * r + 4.0 * (1.0 - nu) * (a / r + 3.0 * b * r));
        assert!((edge[U][U] / (PI * r * force) - 1.0).abs() < 1e-4, "{} {}", edge[U][U], PI * r * force);
        assert!((edge[U][SLOPE] - edge[SLOPE][U]).abs() < 1e-6 * edge[SLOPE][SLOPE]);
    }

    /// A ring clamped outside and pulled along the axis, n = 0: Roark's formula for an annular plate is the closed form
    /// of `w = c1 + c2 ln r + c3 r² + c4 r² ln r`, solved here for its four edge conditions.
    #[test]
    fn a_ring_that_is_clamped_outside_holds_along_the_axis() {
        let outer: f64 = 62.275;
        let ring = plate(PlateEdge::Clamped(outer));
        let edge = ring.rim(0);
        let (r, d) = (ring.wall.radius_mm, ring.wall.bending());
        // w(r) = 1, w'(r) = 0, w(outer) = w'(outer) = 0; Q = 4 D c4 / r... the force is 2 pi r Q = 8 pi D c4.
        let rows =
            [r, outer].map(|x| [[1.0, x.ln(), x * x, x * x * x.ln()], [0.0, 1.0 / x, 2.0 * x, 2.0 * x * x.ln() + x]]);
        let mut a = [rows[0][0], rows[0][1], rows[1][0], rows[1][1]];
        let mut b = [1.0, 0.0, 0.0, 0.0];
        for k in 0..4 {
            let pivot = (k..4).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())).unwrap();
            a.swap(k, pivot);
            b.swap(k, pivot);
            for i in (0..4).filter(|i| *i != k) {
                let factor = a[i][k] / a[k][k];
                (0..4).for_each(|j| a[i][j] -= factor * a[k][j]);
                b[i] -= factor * b[k];
            }
        }
        let force = (8.0 * PI * d * b[3] / a[3][3]).abs();
        assert!((edge[U][U] / force - 1.0).abs() < 1e-3, "{} {force}", edge[U][U]);
    }
}
