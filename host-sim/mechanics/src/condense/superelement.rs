//! Static condensation of one cell (Guyan 1965; exact for static loads on the nodes that are kept).
//!
//! With the nodes that go (i) and those that are kept (r)
//!
//! ```text
//!   [ K_ii  K_ir ] [ u_i ]   [  0  ]        K = K_rr - K_ri K_ii^-1 K_ir
//!   [ K_ri  K_rr ] [ u_r ] = [ f_r ]        u_i = -K_ii^-1 K_ir u_r
//! ```
//!
//! Nodes that the housing holds have prescribed displacements; they push on the kept ones with a constant force.

use flexspline_algebra::{Mat, cholesky, product};

use crate::fem::element::{linear_stiffness, packed_index};
use crate::fem::material::PlaneStrain;
use crate::mesh::{WheelMesh, rotate};

/// The nodes of a cell, by number in the mesh of the wheel.
#[derive(Debug, Clone, Default)]
pub struct CellNodes {
    /// Nodes kept, in order: flanks, bore, first face, second face.
    pub kept: Vec<u32>,
    /// How many of these are on the flanks.
    pub flank: usize,
    /// How many are on the bore, between the faces.
    pub bore: usize,
    /// How many are on each face.
    pub face: usize,
    /// Nodes that the housing holds.
    pub held: Vec<u32>,
    /// Elements.
    pub elements: Vec<usize>,
    /// Angle of the frame of the cell, rad.
    pub angle: f64,
}

/// A condensed cell, in its frame. Dense matrices in mm and N per mm of width.
#[derive(Debug, Clone)]
pub struct Superelement {
    /// Positions of the kept nodes in the frame of the cell, from the middle of its faces.
    pub position: Vec<[f64; 2]>,
    /// Unknowns on flanks, bore, and one face.
    pub unknowns: [usize; 3],
    /// Stiffness of the kept nodes.
    pub stiffness: Mat,
    /// Force of the kept nodes on the cell that holds them at rest while the held nodes are displaced by 1 mm outwards.
    pub seat: Mat,
    /// Nodes that go, by number in the mesh.
    interior: Vec<u32>,
    /// Their positions, as those of the kept nodes.
    interior_position: Vec<[f64; 2]>,
    /// Their displacements for displacements of the kept nodes, and for the held nodes displaced outwards.
    recovery: Mat,
    seat_recovery: Mat,
}

impl Superelement {
    /// Condenses a cell.
    pub fn new(mesh: &WheelMesh, material: &PlaneStrain, cell: &CellNodes) -> Superelement {
        const ABSENT: usize = usize::MAX;
        let mut interior: Vec<u32> = cell.elements.iter().flat_map(|&e| mesh.elements[e]).collect();
        interior.sort_unstable();
        interior.dedup();
        interior.retain(|n| !cell.kept.contains(n) && !cell.held.contains(n));
        let mut place = vec![ABSENT; mesh.nodes.len()];
        for (k, &n) in interior.iter().chain(&cell.held).chain(&cell.kept).enumerate() {
            place[n as usize] = k;
        }
        let (ni, nh, nr) = (2 * interior.len(), 2 * cell.held.len(), 2 * cell.kept.len());
        let mut k = Mat::zeros(ni + nh + nr, ni + nh + nr);
        let to_cell = (-cell.angle).sin_cos();
        for &e in &cell.elements {
            // The tangent at rest is isotropic: rotate it block by block into the frame of the cell.
            let packed = linear_stiffness(&mesh.gauss[e], material);
            let entry = |i: usize, j: usize| packed[packed_index(i, j)];
            for (a, &na) in mesh.elements[e].iter().enumerate() {
                for (b, &nb) in mesh.elements[e].iter().enumerate() {
                    let columns: [[f64; 2]; 2] = std::array::from_fn(|j| {
                        rotate([entry(2 * a, 2 * b + j), entry(2 * a + 1, 2 * b + j)], to_cell)
                    });
                    for i in 0..2 {
                        let [x, y] = rotate([columns[0][i], columns[1][i]], to_cell);
                        k[(2 * place[na as usize] + i, 2 * place[nb as usize])] += x;
                        k[(2 * place[na as usize] + i, 2 * place[nb as usize] + 1)] += y;
                    }
                }
            }
        }
        let in_frame = |n: &u32| rotate(mesh.nodes[*n as usize], to_cell);
        // Held nodes displaced by 1 mm outwards.
        let mut outward = Mat::zeros(nh, 1);
        for (h, n) in cell.held.iter().enumerate() {
            let x = in_frame(n);
            let r = x[0].hypot(x[1]);
            outward[(2 * h, 0)] = x[0] / r;
            outward[(2 * h + 1, 0)] = x[1] / r;
        }
        let block = |r: usize, rows: usize, c: usize, columns: usize| k.as_ref().submatrix(r, c, rows, columns);
        let factor = cholesky(block(0, ni, 0, ni)).expect("a cell held at its kept nodes is stiff");
        let recovery = factor.solve((-block(0, ni, ni + nh, nr)).as_ref());
        let seat_recovery = factor.solve((-product(block(0, ni, ni, nh), outward.as_ref())).as_ref());
        let stiffness = block(ni + nh, nr, ni + nh, nr) + product(block(ni + nh, nr, 0, ni), recovery.as_ref());
        let seat = product(block(ni + nh, nr, ni, nh), outward.as_ref())
            + product(block(ni + nh, nr, 0, ni), seat_recovery.as_ref());
        // Exactly symmetric, or factors and forces part company at round-off.
        let stiffness = Mat::from_fn(nr, nr, |i, j| 0.5 * (stiffness[(i, j)] + stiffness[(j, i)]));

        let faces = cell.flank + cell.bore;
        let middle = cell.kept[faces..].iter().map(in_frame).fold([0.0; 2], |m, x| [m[0] + x[0], m[1] + x[1]]);
        let middle = middle.map(|m| m / (2 * cell.face) as f64);
        let from_middle = |n: &u32| {
            let x = in_frame(n);
            [x[0] - middle[0], x[1] - middle[1]]
        };
        let position = cell.kept.iter().map(from_middle).collect();
        let interior_position = interior.iter().map(from_middle).collect();
        Superelement {
            position,
            unknowns: [2 * cell.flank, 2 * cell.bore, 2 * cell.face],
            stiffness,
            seat,
            interior,
            interior_position,
            recovery,
            seat_recovery,
        }
    }

    /// Number of unknowns kept.
    pub fn kept(&self) -> usize {
        self.stiffness.nrows()
    }

    /// Nodes that were condensed away, by number in the mesh, in the cell that was condensed; and their positions.
    pub(crate) fn interior(&self) -> (&[u32], &[[f64; 2]]) {
        (&self.interior, &self.interior_position)
    }

    /// Displacements of the interior nodes, in the frame of the cell, for displacements `kept` and a seat moved by
    /// `seat_mm`.
    pub(crate) fn recover(&self, kept: &[f64], seat_mm: f64) -> Vec<f64> {
        let mut out: Vec<f64> = (0..self.recovery.nrows()).map(|i| seat_mm * self.seat_recovery[(i, 0)]).collect();
        for (j, x) in kept.iter().enumerate() {
            for (u, t) in out.iter_mut().zip(self.recovery.col(j).iter()) {
                *u += t * x;
            }
        }
        out
    }
}
