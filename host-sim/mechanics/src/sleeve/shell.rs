//! A thin circular cylindrical shell, one Fourier harmonic around it at a time.
//!
//! With `u = U(x) cos n theta` along the axis, `v = V(x) sin n theta` around it and `w = W(x) cos n theta` outward the
//! theory of Sanders and Koiter has
//!
//! ```text
//!   eps_x = U'    eps_t = (n V + W)/R      gamma = V' - n U/R
//!   kap_x = -W''  kap_t = (n² W + n V)/R²  tau   = 2 n W'/R + 3 V'/(2R) + n U/(2R²)
//! ```
//!
//! and the energy (2 pi for pi where n = 0)
//!
//! ```text
//!   ½ pi R ∫ C (eps_x² + eps_t² + 2 nu eps_x eps_t + ½(1-nu) gamma²)
//!          + D (kap_x² + kap_t² + 2 nu kap_x kap_t + ½(1-nu) tau²) dx,   C = E t/(1-nu²),  D = C t²/12.
//! ```
//!
//! Rigid motions have no energy in it: Donnell's theory, which has not, bends a ring with n⁴ for (n² - 1)², 78 % too
//! stiff at n = 2. Along the axis U, V and W are cubic Hermite polynomials on each element; the integrals are exact.
//!
//! Sources: J. L. Sanders, An improved first-approximation theory for thin shells, NASA TR R-24 (1959); W. T. Koiter, A
//! consistent first approximation in the general theory of thin elastic shells (1960).

use std::f64::consts::PI;

/// Unknowns of a node: U, V, W, and their slopes along the axis. Where two walls of different thickness meet, U, V, W
/// and W' go through; U' and V' jump.
pub(super) const U: usize = 0;
pub(super) const V: usize = 1;
pub(super) const W: usize = 2;
pub(super) const SLOPE: usize = 3;
pub(super) const U_SLOPE: usize = 4;
pub(super) const V_SLOPE: usize = 5;
pub(super) const NODE: usize = 6;

/// Elements per decay length `sqrt(R t)` of an edge disturbance, and per `R/n`, over which a short wave dies away: with
/// these twice as many change no stiffness by 3e-4 up to n = 24 (a test).
const ELEMENTS_PER_DECAY: f64 = 4.0;
const ELEMENTS_PER_WAVE: f64 = 2.0;

/// Stiffening of a wall in addition to its thickness: factors on the membrane stiffness along the axis, and on the
/// bending stiffness along the axis and around it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ribs {
    /// On C along the axis.
    pub membrane_axial: f64,
    /// On D along the axis.
    pub bending_axial: f64,
    /// On D around the axis.
    pub bending_around: f64,
}

impl Ribs {
    /// A smooth wall.
    pub(crate) const NONE: Ribs = Ribs { membrane_axial: 1.0, bending_axial: 1.0, bending_around: 1.0 };
}

/// A cylindrical wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shell {
    /// Radius of its middle surface, mm.
    pub radius_mm: f64,
    /// Wall, mm.
    pub thickness_mm: f64,
    /// Young's modulus, MPa.
    pub youngs_modulus_mpa: f64,
    /// Poisson's ratio.
    pub poissons_ratio: f64,
    /// Stiffening of the wall.
    pub ribs: Ribs,
}

/// Gauss points and weights on -1..1 that integrate polynomials to degree seven: products of cubics are of degree six.
pub(super) const GAUSS: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    (-0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
];

/// Half the circumference, or all of it: the integral of `cos² n theta`.
pub(super) fn around(n: u32) -> f64 {
    if n == 0 { 2.0 * PI } else { PI }
}

/// Cubic Hermite functions at `s` of 0..1 on a length: for value and slope at either end their values, first and second
/// derivatives.
pub(super) fn hermite(s: f64, length: f64) -> [[f64; 4]; 3] {
    let (s2, s3, h) = (s * s, s * s * s, length);
    [
        [1.0 - 3.0 * s2 + 2.0 * s3, h * (s - 2.0 * s2 + s3), 3.0 * s2 - 2.0 * s3, h * (s3 - s2)],
        [(6.0 * s2 - 6.0 * s) / h, 1.0 - 4.0 * s + 3.0 * s2, (6.0 * s - 6.0 * s2) / h, 3.0 * s2 - 2.0 * s],
        [(12.0 * s - 6.0) / (h * h), (6.0 * s - 4.0) / h, (6.0 - 12.0 * s) / (h * h), (6.0 * s - 2.0) / h],
    ]
}

/// Unknowns of an element: those of its two nodes.
pub(super) type ElementMatrix = [[f64; 2 * NODE]; 2 * NODE];

/// A row that takes value and slope of one displacement, at both nodes of an element, to a number.
pub(super) fn row(weights: [f64; 4], value: usize, slope: usize) -> [f64; 2 * NODE] {
    let mut row = [0.0; 2 * NODE];
    for (weight, at) in weights.into_iter().zip([value, slope, NODE + value, NODE + slope]) {
        row[at] = weight;
    }
    row
}

/// `a x + b y` and so on.
pub(super) fn sum<const N: usize>(parts: &[(f64, &[f64; N])]) -> [f64; N] {
    std::array::from_fn(|i| parts.iter().map(|(factor, row)| factor * row[i]).sum())
}

/// Adds the energy of the strains `[along, around, shear]` of stiffness `[along, around, along with around, shear]` to
/// a matrix.
pub(super) fn add_energy<const N: usize>(to: &mut [[f64; N]; N], strains: &[[f64; N]; 3], stiffness: [f64; 4]) {
    let [along, around, coupling, shear] = stiffness;
    let [x, t, g] = strains;
    for i in 0..N {
        for j in 0..N {
            to[i][j] += along * x[i] * x[j]
                + around * t[i] * t[j]
                + coupling * (x[i] * t[j] + t[i] * x[j])
                + shear * g[i] * g[j];
        }
    }
}

impl Shell {
    /// Membrane stiffness C, N/mm.
    pub(super) fn membrane(&self) -> f64 {
        self.youngs_modulus_mpa * self.thickness_mm / (1.0 - self.poissons_ratio * self.poissons_ratio)
    }

    /// Bending stiffness D, N mm.
    pub(super) fn bending(&self) -> f64 {
        self.membrane() * self.thickness_mm * self.thickness_mm / 12.0
    }

    /// How many elements a length needs at harmonic n.
    pub(super) fn elements(&self, length_mm: f64, n: u32) -> usize {
        let decay = (self.radius_mm * self.thickness_mm).sqrt() / ELEMENTS_PER_DECAY;
        let wave = self.radius_mm / f64::from(n.max(1)) / ELEMENTS_PER_WAVE;
        ((length_mm / decay.min(wave)).ceil() as usize).max(2)
    }

    /// Stiffness of an element at harmonic n: energy `½ q^T K q` of its two nodes.
    pub(super) fn element(&self, length_mm: f64, n: u32) -> ElementMatrix {
        let (r, nu, order) = (self.radius_mm, self.poissons_ratio, f64::from(n));
        let (membrane, bending, ribs) = (self.membrane(), self.bending(), self.ribs);
        let shear = 0.5 * (1.0 - nu);
        let mut matrix = [[0.0; 2 * NODE]; 2 * NODE];
        for (at, weight) in GAUSS {
            let [value, first, second] = hermite(0.5 * (1.0 + at), length_mm);
            let (u, u1) = (row(value, U, U_SLOPE), row(first, U, U_SLOPE));
            let (v, v1) = (row(value, V, V_SLOPE), row(first, V, V_SLOPE));
            let (w, w1, w2) = (row(value, W, SLOPE), row(first, W, SLOPE), row(second, W, SLOPE));
            let strains = [u1, sum(&[(order / r, &v), (1.0 / r, &w)]), sum(&[(1.0, &v1), (-order / r, &u)])];
            let curvatures = [
                sum(&[(-1.0, &w2)]),
                sum(&[(order * order / (r * r), &w), (order / (r * r), &v)]),
                sum(&[(2.0 * order / r, &w1), (1.5 / r, &v1), (0.5 * order / (r * r), &u)]),
            ];
            let area = around(n) * r * 0.5 * length_mm * weight;
            let c = area * membrane;
            add_energy(&mut matrix, &strains, [c * ribs.membrane_axial, c, c * nu, c * shear]);
            let d = area * bending;
            let stiffness = [d * ribs.bending_axial, d * ribs.bending_around, d * nu, d * shear];
            add_energy(&mut matrix, &curvatures, stiffness);
        }
        matrix
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wall() -> Shell {
        Shell {
            radius_mm: 47.275,
            thickness_mm: 0.7,
            youngs_modulus_mpa: 206_000.0,
            poissons_ratio: 0.3,
            ribs: Ribs { membrane_axial: 1.3, bending_axial: 2.0, bending_around: 1.2 },
        }
    }

    fn energy(k: &ElementMatrix, q: &[f64; 2 * NODE]) -> f64 {
        let row = |row: &[f64; 2 * NODE]| row.iter().zip(q).map(|(a, b)| a * b).sum::<f64>();
        0.5 * k.iter().zip(q).map(|(r, x)| row(r) * x).sum::<f64>()
    }

    #[test]
    fn an_element_is_symmetric() {
        for n in [0, 1, 2, 7] {
            let k = wall().element(2.0, n);
            let largest = k.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
            for i in 0..2 * NODE {
                for j in 0..i {
                    assert!((k[i][j] - k[j][i]).abs() < 1e-14 * largest, "n {n}: {i}, {j}");
                }
            }
        }
    }

    /// Moved along, turned around (n = 0), moved across and tilted (n = 1) no shell has energy; nor has a cone of two
    /// walls membrane energy, `W = x`, `V = -x/n`, `U = -R/n²`.
    #[test]
    fn rigid_motions_have_no_energy() {
        let (h, r) = (2.0, wall().radius_mm);
        // U, V, W, W', U', V' at x = 0 and x = h.
        let bodies: [(u32, [f64; 2 * NODE]); 4] = [
            (0, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            (0, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]),
            (1, [0.0, -1.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0, 0.0]),
            (1, [-r, 0.0, 0.0, 1.0, 0.0, -1.0, -r, -h, h, 1.0, 0.0, -1.0]),
        ];
        for (n, motion) in bodies {
            let k = wall().element(h, n);
            let stiff = motion.iter().zip(0..).map(|(q, i)| k[i][i] * q * q).sum::<f64>();
            let left = energy(&k, &motion);
            assert!(left.abs() < 1e-12 * stiff, "n {n}: {left} of {stiff}");
        }
        // Without its bending the cone would have none: a tenth of the wall leaves a thousandth of the energy.
        let cone = |n: f64| [-r / (n * n), 0.0, 0.0, 1.0, 0.0, -1.0 / n, -r / (n * n), -h / n, h, 1.0, 0.0, -1.0 / n];
        let of = |thickness_mm: f64| energy(&Shell { thickness_mm, ..wall() }.element(h, 2), &cone(2.0));
        assert!((of(0.07) / of(0.7) / 1e-3 - 1.0).abs() < 1e-6, "{} {}", of(0.07), of(0.7));
    }

    /// A ring that becomes oval without stretching: `½ pi D h ((n² - 1)/R²)² R` for W = 1.
    #[test]
    fn an_oval_ring_bends_as_a_ring() {
        let (h, n) = (3.0, 2.0);
        let mut oval = [0.0; 2 * NODE];
        for node in [0, NODE] {
            (oval[node + W], oval[node + V]) = (1.0, -1.0 / n);
        }
        let r = wall().radius_mm;
        let expected =
            0.5 * PI * r * h * wall().bending() * wall().ribs.bending_around * ((n * n - 1.0) / (r * r)).powi(2);
        let found = energy(&wall().element(h, 2), &oval);
        assert!((found / expected - 1.0).abs() < 1e-8, "{found} {expected}");
    }

    /// Navier: simply supported, L 100 mm, pressure `cos 2 theta sin(pi x/L)` of 1 MPa. The amplitude is the solution
    /// of three equations, computed apart from this program.
    #[test]
    fn navier_is_met() {
        let (length, elements, n) = (100.0, 40, 2);
        let shell = Shell { ribs: Ribs::NONE, ..wall() };
        let h = length / elements as f64;
        let element = shell.element(h, n);
        let mut matrix = super::super::matrix::Symmetric::zeros((elements + 1) * NODE);
        let mut load = vec![0.0; (elements + 1) * NODE];
        for k in 0..elements {
            matrix.add_at(&element, std::array::from_fn(|i| k * NODE + i));
            for (at, weight) in GAUSS {
                let s = 0.5 * (1.0 + at);
                let pressure = (PI * (k as f64 + s) * h / length).sin();
                let w = row(hermite(s, h)[0], W, SLOPE);
                for (i, part) in w.iter().enumerate() {
                    load[k * NODE + i] += around(n) * shell.radius_mm * 0.5 * h * weight * pressure * part;
                }
            }
        }
        // By symmetry about the middle the amplitude there is the work of the load over the load's own measure: with
        // the exact shape sin, `load^T x = W integral(sin²)`.
        let held = [V, W, elements * NODE + V, elements * NODE + W];
        let work = matrix.work_of(&load, &held);
        let amplitude = work / (around(n) * shell.radius_mm * 0.5 * length);
        assert!((amplitude / 0.122_168_988_8 - 1.0).abs() < 1e-6, "{amplitude}");
    }
}
