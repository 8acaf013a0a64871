//! Linear equations that hold a deck's wheels as ours are held.
//!
//! The mean rotation of the bore and its mean displacement are sums over all its nodes. One equation with all of them
//! would fill the matrix: eliminating one unknown by 3000 others couples each of these with each. Running sums say the
//! same with short equations: for sector k
//!
//! `sum over its edges of weight . u  =  t_k - t_(k-1)`,  `t_0 = 0`,
//!
//! so that the last t is the sum over the whole bore. Weights along an edge are Simpson's (1, 4, 1)/6.

use super::{Equation, EquationTerm};
use flexspline_mechanics::mesh::WheelMesh;

/// The three sums.
const SUMS: usize = 3;

/// Running sums over the bore.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct BoreSums {
    /// For each sector the equations of its three partial sums. Node numbers of `bore_node` and `sum_node`.
    pub equations: Vec<Equation>,
    /// Edges summed over: a sum divided by this is a mean.
    pub edges: usize,
}

/// Equations between the nodes of the bore and one helper node for each running sum: `sum_node(sector, which)` with
/// `which` 0 the rotation times the bore radius (mm), 1 and 2 the displacement in x and y (mm), each in its first
/// degree of freedom; `None` stands for a sum that is held at zero.
pub(super) fn bore_sums(
    mesh: &WheelMesh,
    bore_node: impl Fn(usize) -> usize,
    sum_node: impl Fn(usize, usize) -> Option<usize>,
) -> BoreSums {
    let mut equations = Vec::new();
    for sector in 0..mesh.teeth {
        // Columns: x and y of each node of the sector's edges in turn.
        let mut nodes: Vec<usize> = Vec::new();
        let mut weights: Vec<f64> = Vec::new();
        for edge in &mesh.base_edges {
            for (n, simpson) in mesh.edge_nodes(sector, edge).into_iter().zip([1.0, 4.0, 1.0]) {
                if nodes.last() == Some(&n) {
                    *weights.last_mut().expect("as many weights as nodes") += simpson / 6.0;
                } else {
                    nodes.push(n);
                    weights.push(simpson / 6.0);
                }
            }
        }
        let mut rows = [const { Vec::new() }; SUMS];
        for (&n, weight) in nodes.iter().zip(&weights) {
            let [x, y] = mesh.nodes[n];
            let r = x.hypot(y);
            rows[0].extend([-weight * y / r, weight * x / r]);
            rows[1].extend([*weight, 0.0]);
            rows[2].extend([0.0, *weight]);
        }
        // Right-hand sides: how much of each sum a row holds.
        let mut sums = [[0.0; SUMS]; SUMS];
        for (k, row) in sums.iter_mut().enumerate() {
            row[k] = 1.0;
        }
        // The dependent unknowns are two nodes of the sector, far apart, that no other sector has.
        let (a, b) = if nodes.len() > 3 { (1, nodes.len() - 2) } else { (0, 1) };
        // With its mean displacement held, a short stretch of the bore turns by a difference of radial displacements.
        let [x, y] = mesh.nodes[nodes[b]];
        let turning = if x.abs() > y.abs() { 2 * b } else { 2 * b + 1 };
        let pivots = [turning, 2 * a, 2 * a + 1];
        gauss_jordan(&mut rows, &mut sums, pivots);

        for ((row, sum), pivot) in rows.iter().zip(&sums).zip(pivots) {
            let term = |column: usize| EquationTerm {
                node: bore_node(nodes[column / 2]),
                dof: 1 + (column % 2) as u8,
                coefficient: row[column],
            };
            let mut terms = vec![term(pivot)];
            terms.extend((0..row.len()).filter(|&c| c != pivot && row[c].abs() > 1e-14).map(term));
            for (which, share) in sum.iter().enumerate() {
                if share.abs() < 1e-14 {
                    continue;
                }
                let before = if sector == 0 { None } else { sum_node(sector - 1, which) };
                for (helper, sign) in [(sum_node(sector, which), -1.0), (before, 1.0)] {
                    terms.extend(helper.map(|node| EquationTerm { node, dof: 1, coefficient: sign * share }));
                }
            }
            equations.push(terms);
        }
    }
    BoreSums { equations, edges: mesh.teeth * mesh.base_edges.len() }
}

/// Makes the columns `pivots` of `rows` the unit matrix; `right` follows.
fn gauss_jordan(rows: &mut [Vec<f64>; SUMS], right: &mut [[f64; SUMS]; SUMS], pivots: [usize; SUMS]) {
    // The pivot of the first row is the smallest: last, when the others have been taken out of it.
    for k in [1, 2, 0] {
        let scale = 1.0 / rows[k][pivots[k]];
        rows[k].iter_mut().for_each(|x| *x *= scale);
        right[k].iter_mut().for_each(|x| *x *= scale);
        for other in (0..SUMS).filter(|&other| other != k) {
            let factor = rows[other][pivots[k]];
            let (row, sums) = (rows[k].clone(), right[k]);
            rows[other].iter_mut().zip(row).for_each(|(x, y)| *x -= factor * y);
            right[other].iter_mut().zip(sums).for_each(|(x, y)| *x -= factor * y);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_mechanics::drive::{Drive, GeneratorKind};
    use flexspline_mechanics::mesh::MeshLevel;
    use flexspline_mechanics::stepping::{Problem, Solver, SolverSettings};

    const HELPERS: usize = 1_000_000;

    /// The running sums that the equations give for a displacement field, sector by sector.
    fn running_sums(mesh: &WheelMesh, u: &[f64]) -> Vec<[f64; SUMS]> {
        let sums = bore_sums(mesh, |n| n, |sector, which| Some(HELPERS + SUMS * sector + which));
        let mut running = Vec::new();
        let mut before = [0.0; SUMS];
        for (sector, equations) in sums.equations.chunks(SUMS).enumerate() {
            // Three equations in the three sums at the end of this sector; Cramer's rule.
            let mut matrix = [[0.0; SUMS]; SUMS];
            let mut right = [0.0; SUMS];
            for (k, equation) in equations.iter().enumerate() {
                for term in equation {
                    if term.node < HELPERS {
                        right[k] -= term.coefficient * u[2 * term.node + usize::from(term.dof) - 1];
                        continue;
                    }
                    let helper = term.node - HELPERS;
                    if helper / SUMS == sector {
                        matrix[k][helper % SUMS] = term.coefficient;
                    } else {
                        assert_eq!(helper / SUMS + 1, sector, "a sum of a sector that is no neighbour");
                        right[k] -= term.coefficient * before[helper % SUMS];
                    }
                }
            }
            let determinant = |m: &[[f64; 3]; 3]| {
                m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
                    + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
            };
            let whole = determinant(&matrix);
            before = std::array::from_fn(|column| {
                let mut replaced = matrix;
                (0..SUMS).for_each(|k| replaced[k][column] = right[k]);
                determinant(&replaced) / whole
            });
            running.push(before);
        }
        running
    }

    #[test]
    fn sums_over_the_bore_are_its_mean_rotation_and_displacement() {
        let drive = Drive::hhd_95();
        for level in [MeshLevel::Coarse, MeshLevel::Standard] {
            let mesh = WheelMesh::flexspline(&drive, level).unwrap();
            let edges = (mesh.teeth * mesh.base_edges.len()) as f64;
            // A rigid motion: small turn and shift.
            let (turn, shift) = (1e-4, [0.02, -0.03]);
            let u: Vec<f64> =
                mesh.nodes.iter().flat_map(|x| [shift[0] - turn * x[1], shift[1] + turn * x[0]]).collect();
            let [rotation, x, y] = running_sums(&mesh, &u)[mesh.teeth - 1].map(|sum| sum / edges);
            assert!((rotation / mesh.base_radius - turn).abs() < 1e-13, "{level}: {rotation}");
            assert!((x - shift[0]).abs() < 1e-10 && (y - shift[1]).abs() < 1e-10, "{level}: {x} {y}");
        }
    }

    /// A sum that our solver holds at zero, weighted in its own way, is zero in the deck's sums too.
    #[test]
    fn a_loaded_drive_of_ours_satisfies_the_equations() {
        let drive = Drive::hhd_95();
        let settings = SolverSettings { mesh: MeshLevel::Coarse, ..SolverSettings::default() };
        let problem = Problem::new(&drive, GeneratorKind::TwoRoller, drive.temperature.reference_c, settings).unwrap();
        let mut solver = Solver::new(&problem);
        let (state, _) = solver.deform(0.3).unwrap();
        let (state, _) = solver.increment(&state, 0.3, 10.0).unwrap();
        let running = running_sums(&problem.flexspline, &state.u);
        let largest = running.iter().map(|sums| sums[0].abs()).fold(0.0, f64::max);
        let last = running[running.len() - 1][0];
        assert!(largest > 1.0 && last.abs() < 1e-11 * largest, "{last} at the end, up to {largest} on the way");
    }

    #[test]
    fn no_unknown_depends_twice_and_none_that_depends_serves_another() {
        let mesh = WheelMesh::flexspline(&Drive::hhd_95(), MeshLevel::Standard).unwrap();
        let sums = bore_sums(&mesh, |n| n, |sector, which| Some(HELPERS + SUMS * sector + which));
        let name = |term: &EquationTerm| (term.node, term.dof);
        let dependent: std::collections::BTreeSet<_> = sums.equations.iter().map(|e| name(&e[0])).collect();
        assert_eq!(dependent.len(), SUMS * mesh.teeth);
        for equation in &sums.equations {
            assert!(equation.len() < 40, "a long equation fills the matrix");
            assert!((equation[0].coefficient - 1.0).abs() < 1e-12);
            assert!(equation[1..].iter().all(|term| !dependent.contains(&name(term))));
        }
    }
}
