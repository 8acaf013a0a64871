//! A cell in the frame that turns with it.
//!
//! The frame is the rotation that fits the nodes of the faces best: with their positions X from their middle and x in
//! the deformed cell, `tan phi = sum X cross x / sum X . x`. Seen from it, what is left of the displacement,
//!
//! `q = R(-phi) x - X`,
//!
//! is strain and little else (5e-4), and the energy is `q^T K q / 2`. Its derivatives are taken exactly, so that forces
//! and moments balance whatever frame was chosen: with `a = dphi/dx` (in the frame), `S` a quarter turn, `F = K q`,
//!
//! * force: `F - (F . S q) a`, in the frame;
//! * tangent: `K + g a^T + a g^T + c a a^T`, with `g = S F - K S q` and `c = (S q)^T K (S q) - F . (X + q)`; a term of
//!   the order of the energy is left out.
//!
//! After Felippa and Haugen, A unified formulation of small-strain corotational finite elements, 2005.

use crate::mesh::rotate;

/// Kinematics of the frame of a cell.
#[derive(Debug, Clone)]
pub struct CoRotation {
    /// Positions of the kept nodes in the frame at rest, from the middle of the faces.
    position: Vec<[f64; 2]>,
    /// First node on a face.
    first_face: usize,
}

/// A cell as it is now.
#[derive(Debug, Clone, Default)]
pub struct CellState {
    /// Rotation of the frame, rad.
    pub turn: f64,
    /// Displacement of the middle of the faces, in the frame of the cell at rest.
    pub middle: [f64; 2],
    /// Displacements in the frame, x and y of each kept node, from the middle of the faces.
    pub q: Vec<f64>,
    /// Derivative of the rotation by the displacements of the nodes of both faces, in the frame.
    pub turn_rate: Vec<f64>,
}

impl CoRotation {
    /// Frame of a cell with nodes at these positions from the middle of its faces, face nodes from `first_face` on.
    pub fn new(position: &[[f64; 2]], first_face: usize) -> CoRotation {
        CoRotation { position: position.to_vec(), first_face }
    }

    /// This frame without the first `nodes` nodes, which are not on a face.
    pub fn without(&self, nodes: usize) -> CoRotation {
        CoRotation { position: self.position[nodes..].to_vec(), first_face: self.first_face - nodes }
    }

    /// The frame and what is left of the displacements `d` (x and y of each kept node, in the frame of the cell at
    /// rest).
    pub fn split(&self, d: &[f64], state: &mut CellState) {
        let faces = self.first_face..self.position.len();
        let count = faces.len() as f64;
        let mut middle = [0.0; 2];
        for n in faces.clone() {
            middle[0] += d[2 * n];
            middle[1] += d[2 * n + 1];
        }
        let middle = middle.map(|m| m / count);
        let (mut along, mut across) = (0.0, 0.0);
        for n in faces.clone() {
            let [px, py] = self.position[n];
            let (x, y) = (d[2 * n] - middle[0], d[2 * n + 1] - middle[1]);
            along += px * (px + x) + py * (py + y);
            across += px * y - py * x;
        }
        let turn = across.atan2(along);
        let back @ (sin, _) = (-turn).sin_cos();
        // cos - 1 without cancellation.
        let shortening = -2.0 * (0.5 * turn).sin().powi(2);
        state.turn = turn;
        state.middle = middle;
        state.q.clear();
        for (n, [px, py]) in self.position.iter().enumerate() {
            let moved = rotate([d[2 * n] - middle[0], d[2 * n + 1] - middle[1]], back);
            state.q.push(moved[0] + shortening * px - sin * py);
            state.q.push(moved[1] + sin * px + shortening * py);
        }
        let length = along.hypot(across);
        state.turn_rate.clear();
        for [px, py] in &self.position[faces] {
            state.turn_rate.extend([-py / length, px / length]);
        }
    }

    /// The other way: displacements (in the frame of the cell at rest) of nodes at `positions` from the middle of the
    /// faces, displaced by `q` in the turned frame.
    pub fn join(state: &CellState, positions: &[[f64; 2]], q: &[f64]) -> Vec<f64> {
        let forth @ (sin, _) = state.turn.sin_cos();
        let shortening = -2.0 * (0.5 * state.turn).sin().powi(2);
        let place = |([px, py], q): (&[f64; 2], &[f64])| {
            let moved = rotate([q[0], q[1]], forth);
            [
                state.middle[0] + moved[0] + shortening * px - sin * py,
                state.middle[1] + moved[1] + sin * px + shortening * py,
            ]
        };
        positions.iter().zip(q.chunks_exact(2)).flat_map(place).collect()
    }

    /// Positions of the nodes, from the middle of the faces.
    pub(crate) fn positions(&self) -> &[[f64; 2]] {
        &self.position
    }

    /// Forces of the nodes on the cell in its turned frame: `F - (F . S q) a`, in place of F.
    pub(crate) fn balance(&self, state: &CellState, force: &mut [f64]) {
        let moment: f64 = force.chunks(2).zip(state.q.chunks(2)).map(|(f, q)| f[1] * q[0] - f[0] * q[1]).sum();
        for (f, a) in force[2 * self.first_face..].iter_mut().zip(&state.turn_rate) {
            *f -= moment * a;
        }
    }

    /// `g` and `c` of the tangent, from `F = K q` and `K S q`.
    pub fn geometric(&self, state: &CellState, force: &[f64], turned: &[f64]) -> (Vec<f64>, f64) {
        let mut g = Vec::with_capacity(force.len());
        let mut c = 0.0;
        for (n, [px, py]) in self.position.iter().enumerate() {
            let (x, y) = (2 * n, 2 * n + 1);
            g.push(-force[y] - turned[x]);
            g.push(force[x] - turned[y]);
            c += -state.q[y] * turned[x] + state.q[x] * turned[y];
            c -= force[x] * (px + state.q[x]) + force[y] * (py + state.q[y]);
        }
        (g, c)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;
    use crate::fem::material::PlaneStrain;
    use crate::mesh::{MeshLevel, WheelMesh};

    use super::super::dense::{Multiply, one, one_mut};
    use super::super::model::{Cell, CondensedWheel};
    use pulp::Arch;

    fn flexspline() -> CondensedWheel {
        let mesh = WheelMesh::flexspline(&Drive::hhd_95(), MeshLevel::Coarse).unwrap();
        CondensedWheel::new(&mesh, &PlaneStrain::new(206_000.0, 0.3), 0, |_| false)
    }

    /// Energy of a cell, and its forces in the frame of the cell at rest.
    fn energy_and_force(cell: &Cell, d: &[f64]) -> (f64, Vec<f64>, CellState) {
        let mut state = CellState::default();
        cell.frame.split(d, &mut state);
        let mut force = vec![0.0; d.len()];
        Arch::new().dispatch(Multiply { a: &cell.stiffness, x: one(&state.q), sign: 1.0, y: one_mut(&mut force) });
        let energy = 0.5 * force.iter().zip(&state.q).map(|(f, q)| f * q).sum::<f64>();
        cell.frame.balance(&state, &mut force);
        for f in force.chunks_exact_mut(2) {
            [f[0], f[1]] = rotate([f[0], f[1]], state.turn.sin_cos());
        }
        (energy, force, state)
    }

    /// A cell turned by 0.3 rad, moved by millimetres and strained by 1e-3, as displacements.
    fn deformed(cell: &Cell) -> Vec<f64> {
        let mut rng = fastrand::Rng::with_seed(7);
        let turn = 0.3_f64.sin_cos();
        let positions = cell.frame.positions();
        positions
            .iter()
            .flat_map(|p| {
                let q = [1e-3 * (rng.f64() - 0.5) + 1e-3 * p[0], 1e-3 * (rng.f64() - 0.5)];
                let moved = rotate([p[0] + q[0], p[1] + q[1]], turn);
                [moved[0] - p[0] + 2.0, moved[1] - p[1] - 3.0]
            })
            .collect()
    }

    #[test]
    fn a_turn_of_any_size_costs_nothing() {
        let wheel = flexspline();
        for flanks in [false, true] {
            let (cell, _) = wheel.cell(0, flanks);
            for angle in [0.01, 0.3, -1.2, 3.0_f64] {
                let d: Vec<f64> = cell
                    .frame
                    .positions()
                    .iter()
                    .flat_map(|p| {
                        let moved = rotate(*p, angle.sin_cos());
                        [moved[0] - p[0] + 5.0, moved[1] - p[1] - 7.0]
                    })
                    .collect();
                let (_, force, state) = energy_and_force(cell, &d);
                assert!((state.turn - angle).abs() < 1e-12, "{} for {angle}", state.turn);
                let largest = force.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
                assert!(largest < 1e-6, "{largest} N/mm at {angle} rad");
            }
        }
    }

    #[test]
    fn forces_are_the_slope_of_the_energy_and_balance() {
        let wheel = flexspline();
        let (cell, _) = wheel.cell(0, true);
        let d = deformed(cell);
        let (_, force, _) = energy_and_force(cell, &d);
        let scale = force.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
        let step = 1e-5;
        for k in (0..d.len()).step_by(5) {
            let shifted = |by: f64| {
                let mut d = d.clone();
                d[k] += by;
                energy_and_force(cell, &d).0
            };
            let slope = (shifted(step) - shifted(-step)) / (2.0 * step);
            assert!((slope - force[k]).abs() < 1e-6 * scale, "unknown {k}: {slope} against {}", force[k]);
        }
        let positions = cell.frame.positions();
        let mut sum = [0.0; 3];
        for ((f, u), p) in force.chunks(2).zip(d.chunks(2)).zip(positions) {
            let (x, y) = (p[0] + u[0], p[1] + u[1]);
            sum = [sum[0] + f[0], sum[1] + f[1], sum[2] + x * f[1] - y * f[0]];
        }
        assert!(sum.iter().all(|s| s.abs() < 1e-8 * scale), "{sum:?} of {scale}");
    }

    #[test]
    fn the_tangent_is_the_slope_of_the_forces() {
        let wheel = flexspline();
        let (cell, _) = wheel.cell(0, true);
        let d = deformed(cell);
        let n = d.len();
        let arch = Arch::new();
        let (_, _, state) = energy_and_force(cell, &d);
        let mut force = vec![0.0; n];
        arch.dispatch(Multiply { a: &cell.stiffness, x: one(&state.q), sign: 1.0, y: one_mut(&mut force) });
        let quarter: Vec<f64> = state.q.chunks(2).flat_map(|q| [-q[1], q[0]]).collect();
        let mut turned = vec![0.0; n];
        arch.dispatch(Multiply { a: &cell.stiffness, x: one(&quarter), sign: 1.0, y: one_mut(&mut turned) });
        let (g, c) = cell.frame.geometric(&state, &force, &turned);
        let mut a = vec![0.0; n - state.turn_rate.len()];
        a.extend(&state.turn_rate);
        let stiff = cell.stiffness.iter().fold(0.0_f64, |m, k| m.max(k.abs()));
        // What is left out is of the order of the moment F . S q, against stiffness times length squared.
        let step = 1e-6;
        let mut worst = 0.0_f64;
        for k in (0..n).step_by(7) {
            let (node, axis) = (k / 2, k % 2);
            let mut along = [0.0; 2];
            along[axis] = step;
            let along = rotate(along, state.turn.sin_cos());
            let shifted = |sign: f64| {
                let mut d = d.clone();
                d[2 * node] += sign * along[0];
                d[2 * node + 1] += sign * along[1];
                energy_and_force(cell, &d).1
            };
            let (plus, minus) = (shifted(1.0), shifted(-1.0));
            for i in 0..n / 2 {
                let slope = [0, 1].map(|x| (plus[2 * i + x] - minus[2 * i + x]) / (2.0 * step));
                let slope = rotate(slope, (-state.turn).sin_cos());
                for x in 0..2 {
                    let row = 2 * i + x;
                    let said = cell.stiffness[row + k * n] + g[row] * a[k] + a[row] * g[k] + c * a[row] * a[k];
                    worst = worst.max((said - slope[x]).abs());
                }
            }
        }
        println!("tangent off by {worst:.2e} of {stiff:.2e} N/mm");
        assert!(worst < 1e-5 * stiff, "{worst} of {stiff}");
    }
}
