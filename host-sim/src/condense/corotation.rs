//! A cell in the frame that turns with it.
//!
//! The frame is the rotation that fits the nodes of the faces best: with their positions X from their middle and x in the
//! deformed cell, `tan phi = sum X cross x / sum X . x`. Seen from it, what is left of the displacement,
//!
//! `q = R(-phi) x - X`,
//!
//! is strain and little else (5e-4), and the energy is `q^T K q / 2`. Its derivatives are taken exactly, so that forces and
//! moments balance whatever frame was chosen: with `a = dphi/dx` (in the frame), `S` a quarter turn, `F = K q`,
//!
//! * force: `F - (F . S q) a`, in the frame;
//! * tangent: `K + g a^T + a g^T + c a a^T`, with `g = S F - K S q` and `c = (S q)^T K (S q) - F . (X + q)`; a term of the
//!   order of the energy is left out.
//!
//! After Felippa and Haugen, A unified formulation of small-strain corotational finite elements, 2005.

use super::superelement::rotate;

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

    /// The same frame without the first `nodes` nodes, which are not on a face.
    pub fn without(&self, nodes: usize) -> CoRotation {
        CoRotation { position: self.position[nodes..].to_vec(), first_face: self.first_face - nodes }
    }

    /// The frame and what is left of the displacements `d` (x and y of each kept node, in the frame of the cell at rest).
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

    /// The other way: displacement (in the frame of the cell at rest) of a node at `position` from the middle of the faces,
    /// displaced by `q` in the turned frame.
    pub fn join(state: &CellState, position: [f64; 2], q: [f64; 2]) -> [f64; 2] {
        let forth @ (sin, _) = state.turn.sin_cos();
        let shortening = -2.0 * (0.5 * state.turn).sin().powi(2);
        let moved = rotate(q, forth);
        [
            state.middle[0] + moved[0] + shortening * position[0] - sin * position[1],
            state.middle[1] + moved[1] + sin * position[0] + shortening * position[1],
        ]
    }

    /// Positions of the nodes, from the middle of the faces.
    pub fn positions(&self) -> &[[f64; 2]] {
        &self.position
    }

    /// Forces of the nodes on the cell in its turned frame: `F - (F . S q) a`, in place of F.
    pub fn balance(&self, state: &CellState, force: &mut [f64]) {
        let moment: f64 =
            force.chunks(2).zip(state.q.chunks(2)).map(|(f, q)| f[1] * q[0] - f[0] * q[1]).sum();
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
