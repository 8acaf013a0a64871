//! The tangent of one cell, reduced to its faces and to the tractions on its flanks; and the way back.
//!
//! With the tangent `K + g a^T + a g^T + c a a^T` of a turning cell (see [`super::corotation`]; a reaches the faces
//! only) and the columns G of the contact on its flanks (see [`Traction`]), flank and bore nodes are eliminated from
//!
//! ```text
//!           flank      bore        faces   tractions  geometric
//!   flank   K_ff                                                    eliminated once for all congruent cells
//!   bore    K_bf       K_bb + N                                     N: contact on the bore
//!   faces   K_if       K_ib + N    K_ii + N
//!   tract.  G^T        0           0        0
//!   geom.   g_f^T      g_b^T       g_i^T    0          c
//! ```
//!
//! and the geometric row, which is no equation, is folded onto the faces: with the reduced `g_i`, `g_t`, `c`, the faces
//! get `g_i a^T + a g_i^T + c a a^T` and their coupling with the tractions `g_t a^T`. This is exact, because a is zero
//! on what was eliminated.

use crate::mesh::rotate;

use super::chain::Chain;
use super::dense::{DenseKernels, one, one_mut};
use super::model::Cell;

/// Contact of a pair of flanks as this cell sees it: columns of G on its flank nodes, in its frame.
///
/// The contact has the stiffness `D = G G^T`. With the tractions `lambda = G^T z` as unknowns `[K G; G^T -I]` stands
/// for `K + G G^T`, and what one wheel contributes does not depend on the other.
#[derive(Debug, Clone)]
pub struct Traction {
    /// Its block in the chain.
    pub block: u32,
    /// First unknown of the cell that it acts on.
    pub start: usize,
    /// Unknowns that it acts on.
    pub length: usize,
    /// The columns, one after the other.
    pub columns: Vec<f64>,
}

impl Traction {
    /// Number of columns.
    pub(crate) fn rank(&self) -> usize {
        self.columns.len() / self.length
    }

    fn forces<'a>(&'a self) -> impl Iterator<Item = (usize, &'a [f64])> + Clone + 'a {
        self.columns.chunks_exact(self.length).map(|column| (self.start, column))
    }
}

/// (sine, cosine) of an angle.
pub type Turn = (f64, f64);

/// A reduced tangent.
#[derive(Debug, Clone, Default)]
pub struct CellTangent {
    place: CellPlacement,
    tractions: Vec<Traction>,
    /// a on the faces and g on the flanks; empty in a cell that does not turn.
    turn_rate: Vec<f64>,
    flank_geometric: Vec<f64>,
    /// Panel of the bore, where contact has changed it.
    panel: Vec<f64>,
    /// `L^-1` of the bore part of each traction and of the geometric row.
    extra: Vec<f64>,
}

/// Where a cell stands.
#[derive(Debug, Clone, Copy, Default)]
pub struct CellPlacement {
    /// Turn of its frame against the global one.
    pub frame: Turn,
    /// Of its frame against those of its two faces.
    pub faces: [Turn; 2],
    /// Blocks of its faces in the chain.
    pub blocks: [u32; 2],
}

/// Addition of a turning frame to the tangent: a on the faces; g on all nodes; c.
#[derive(Debug, Clone, Copy)]
pub struct Geometric<'a> {
    /// Derivative of the rotation.
    pub a: &'a [f64],
    /// See [`super::CoRotation`].
    pub g: &'a [f64],
    /// See [`super::CoRotation`].
    pub c: f64,
}

/// A cell at its place in a system that is being solved.
#[derive(Clone, Copy)]
pub struct CellAt<'a> {
    /// The kernels.
    pub kernels: DenseKernels,
    /// The cell.
    pub cell: &'a Cell,
    /// Its unknowns among those of both wheels.
    pub unknowns: &'a [u32],
    /// The factor of faces and tractions.
    pub order: &'a Chain,
}

impl CellAt<'_> {
    /// Values that the way forward leaves for the way back.
    pub fn kept(&self) -> usize {
        2 * (self.cell.flank() + self.cell.bore() + self.cell.face())
    }

    /// Those of forces, of bore and faces, and of what the flanks yield.
    fn parts<'v, const W: usize>(&self, kept: &'v mut [[f64; W]]) -> [&'v mut [[f64; W]]; 3] {
        let (force, others) = kept.split_at_mut(self.cell.flank() + self.cell.bore());
        let (body, yielded) = others.split_at_mut(self.cell.bore() + 2 * self.cell.face());
        [force, body, yielded]
    }
}

impl CellTangent {
    /// Reduces a cell to its contribution, maybe that of its last time; false where it is not stiff. `touched` is
    /// the matrix of bore and faces with what touches the bore, where anything does, and is used up.
    pub fn reduce(
        &mut self,
        kernels: DenseKernels,
        cell: &Cell,
        (place, tractions): (CellPlacement, Vec<Traction>),
        geometric: Option<Geometric>,
        touched: Option<&mut [f64]>,
        matrix: &mut Vec<f64>,
    ) -> bool {
        let (f, b, i) = (cell.flank(), cell.bore(), 2 * cell.face());
        let r = b + i;
        self.place = place;
        self.tractions = tractions;

        // Bore and faces.
        self.panel.clear();
        let front = match touched {
            Some(front) => {
                if !kernels.eliminate(front, r, b, 1.0) {
                    return false;
                }
                self.panel.extend_from_slice(&front[..r * b]);
                front
            }
            None => &cell.free_body[..],
        };
        let columns: Vec<(usize, &[f64])> = self.tractions.iter().flat_map(|t| t.forces()).collect();
        let n = i + columns.len();
        if geometric.is_none() && columns.is_empty() && matrix.len() == n * n {
            // A cell that neither turns nor bears anything contributes the same whenever it does.
            self.extra.clear();
            return true;
        }
        matrix.resize(n * n, 0.0);
        for col in 0..i {
            let from = (b + col) * r + b;
            matrix[col * n + col..col * n + i].copy_from_slice(&front[from + col..from + i]);
        }

        // Tractions, then the geometric row: flank nodes, bore nodes, one row after the other.
        let panel = if self.panel.is_empty() { &cell.free_body[..r * b] } else { &self.panel };
        let geometric_flank = geometric.map_or(&[][..], |x| &x.g[..f]);
        self.extra.clear();
        let mut yielded = vec![0.0; f];
        let mut geometric_tractions = vec![0.0; columns.len()];
        for (k, &(start, column)) in columns.iter().enumerate() {
            let done = self.extra.len();
            self.extra.resize(done + r, 0.0);
            let (earlier, follow) = self.extra.split_at_mut(done);
            for (x, t) in follow.iter_mut().zip(cell.flank_coupling.chunks_exact(f)) {
                *x = -dot(column, &t[start..start + column.len()]);
            }
            yielded.fill(0.0);
            let flexibility = &cell.flank_flexibility[start * f..(start + column.len()) * f];
            kernels.multiply_add(flexibility, one(column), 1.0, one_mut(&mut yielded));
            for (l, &(other, against)) in columns.iter().enumerate().skip(k) {
                matrix[i + l + (i + k) * n] = -dot(against, &yielded[other..other + against.len()]);
            }
            if geometric.is_some() {
                geometric_tractions[k] = -dot(geometric_flank, &yielded);
            }
            let (bore, faces) = follow.split_at_mut(b);
            kernels.forward(panel, [r, b], 1.0, one_mut(bore), one_mut(faces));
            for (l, earlier) in earlier.chunks_exact(b.max(1)).enumerate() {
                matrix[i + k + (i + l) * n] -= dot(earlier, bore);
            }
            matrix[i + k + (i + k) * n] -= dot(bore, bore);
            for (col, x) in faces.iter().enumerate() {
                matrix[i + k + col * n] = *x;
            }
            self.extra.truncate(done + b);
        }
        self.turn_rate.clear();
        self.flank_geometric.clear();
        if let Some(Geometric { a, g, c }) = geometric {
            let done = self.extra.len();
            self.extra.extend_from_slice(&g[f..]);
            let (earlier, follow) = self.extra.split_at_mut(done);
            kernels.multiply_transposed_add(&cell.flank_coupling, one(geometric_flank), -1.0, one_mut(follow));
            yielded.fill(0.0);
            kernels.multiply_add(&cell.flank_flexibility, one(geometric_flank), 1.0, one_mut(&mut yielded));
            let mut c = c - dot(geometric_flank, &yielded);
            let (bore, faces) = follow.split_at_mut(b);
            kernels.forward(panel, [r, b], 1.0, one_mut(bore), one_mut(faces));
            for (x, earlier) in geometric_tractions.iter_mut().zip(earlier.chunks_exact(b.max(1))) {
                *x -= dot(earlier, bore);
            }
            c -= dot(bore, bore);
            for col in 0..i {
                let (ga, aa) = (a[col], faces[col] + c * a[col]);
                for row in col..i {
                    matrix[row + col * n] += faces[row] * ga + a[row] * aa;
                }
                for (row, x) in geometric_tractions.iter().enumerate() {
                    matrix[i + row + col * n] += x * ga;
                }
            }
            self.extra.truncate(done + b);
            self.turn_rate.extend_from_slice(a);
            self.flank_geometric.extend_from_slice(geometric_flank);
        }
        rotate_faces(matrix, n, i / 2, &self.place.faces);
        true
    }

    fn panel<'a>(&'a self, cell: &'a Cell) -> &'a [f64] {
        if self.panel.is_empty() { &cell.free_body } else { &self.panel }
    }

    /// Brings the forces on flank and bore nodes (`unknowns` of `x`) to faces and tractions (`chain`). What the way
    /// back needs of it goes to `kept`, [`CellAt::kept`] of them.
    pub fn forward<const W: usize>(&self, at: CellAt, x: &[[f64; W]], chain: &mut [[f64; W]], kept: &mut [[f64; W]]) {
        let CellAt { kernels, cell, unknowns, order } = at;
        let (f, b, face) = (cell.flank(), cell.bore(), cell.face());
        let [force, body, yielded] = at.parts(kept);
        force.iter_mut().zip(unknowns).for_each(|(force, u)| *force = x[*u as usize]);
        rotate_sides(force, back(self.place.frame));
        let (flank, bore) = force.split_at_mut(f);
        body[..b].copy_from_slice(bore);
        body[b..].fill([0.0; W]);
        yielded.fill([0.0; W]);
        kernels.multiply_transposed_add(&cell.flank_coupling, flank, -1.0, body);
        kernels.multiply_add(&cell.flank_flexibility, flank, 1.0, yielded);
        bore.copy_from_slice(&body[..b]);
        let faces = &mut body[b..];
        kernels.forward(self.panel(cell), [b + 2 * face, b], 1.0, bore, faces);
        // Rows of tractions and geometry.
        let columns = self.tractions.iter().flat_map(|t| t.forces());
        let on = |(start, column): (usize, &[f64])| dot_sides(column, &yielded[start..start + column.len()]);
        let mut rest: Vec<[f64; W]> = columns.map(|column| on(column).map(|x| -x)).collect();
        if !self.turn_rate.is_empty() {
            rest.push(dot_sides(&self.flank_geometric, yielded).map(|x| -x));
        }
        for (r, earlier) in rest.iter_mut().zip(self.extra.chunks_exact(b.max(1))) {
            add(r, -1.0, &dot_sides(earlier, bore));
        }
        if let (Some(folded), false) = (rest.last(), self.turn_rate.is_empty()) {
            faces.iter_mut().zip(&self.turn_rate).for_each(|(x, a)| add(x, *a, folded));
        }
        for (side, part) in faces.chunks_exact_mut(face).enumerate() {
            rotate_sides(part, self.place.faces[side]);
            let to = order.offset(self.place.blocks[side] as usize);
            chain[to..to + face].iter_mut().zip(part.iter()).for_each(|(c, x)| add(c, 1.0, x));
        }
        let mut rest = rest.as_slice();
        for traction in &self.tractions {
            let (own, others) = rest.split_at(traction.rank());
            let to = order.offset(traction.block as usize);
            chain[to..to + own.len()].iter_mut().zip(own).for_each(|(c, x)| add(c, 1.0, x));
            rest = others;
        }
    }

    /// Displacements of flank and bore nodes, faces and tractions being solved; `kept` as the way forward left it.
    pub fn backward<const W: usize>(&self, at: CellAt, x: &mut [[f64; W]], chain: &[[f64; W]], kept: &mut [[f64; W]]) {
        let CellAt { kernels, cell, unknowns, order } = at;
        let (f, b, face) = (cell.flank(), cell.bore(), cell.face());
        let [force, body, yielded] = at.parts(kept);
        for (side, part) in body[b..].chunks_exact_mut(face).enumerate() {
            let from = order.offset(self.place.blocks[side] as usize);
            part.copy_from_slice(&chain[from..from + face]);
            rotate_sides(part, back(self.place.faces[side]));
        }
        let mut rest = Vec::with_capacity(self.extra.len() / b.max(1));
        for traction in &self.tractions {
            let from = order.offset(traction.block as usize);
            rest.extend_from_slice(&chain[from..from + traction.rank()]);
        }
        let turn = dot_sides(&self.turn_rate, &body[b..b + self.turn_rate.len()]);
        if !self.turn_rate.is_empty() {
            rest.push(turn);
        }
        let (flank, bore) = force.split_at_mut(f);
        for (value, earlier) in rest.iter().zip(self.extra.chunks_exact(b.max(1))) {
            bore.iter_mut().zip(earlier).for_each(|(x, e)| add(x, -e, value));
        }
        let (bore_body, faces) = body.split_at_mut(b);
        kernels.backward(self.panel(cell), [b + 2 * face, b], 1.0, bore, faces);
        bore_body.copy_from_slice(bore);
        // Flanks: yielded - C (G lambda + g turn) - T body.
        flank.copy_from_slice(yielded);
        yielded.fill([0.0; W]);
        yielded.iter_mut().zip(&self.flank_geometric).for_each(|(l, g)| add(l, *g, &turn));
        let columns = self.tractions.iter().flat_map(|t| t.forces());
        for ((start, column), traction) in columns.zip(rest.iter()) {
            yielded[start..].iter_mut().zip(column).for_each(|(l, g)| add(l, *g, traction));
        }
        kernels.multiply_add(&cell.flank_flexibility, yielded, -1.0, flank);
        kernels.multiply_add(&cell.flank_coupling, body, -1.0, flank);
        rotate_sides(force, self.place.frame);
        for (u, value) in unknowns.iter().zip(force.iter()) {
            x[*u as usize] = *value;
        }
    }
}

/// Dot products with W right-hand sides.
#[inline]
fn dot_sides<const W: usize>(a: &[f64], b: &[[f64; W]]) -> [f64; W] {
    let mut sum = [0.0; W];
    a.iter().zip(b).for_each(|(a, b)| add(&mut sum, *a, b));
    sum
}

/// `x += factor y`.
#[inline]
fn add<const W: usize>(x: &mut [f64; W], factor: f64, y: &[f64; W]) {
    x.iter_mut().zip(y).for_each(|(x, y)| *x += factor * y);
}

/// Rotates the vectors of W right-hand sides, x and y in turn.
#[inline]
pub fn rotate_sides<const W: usize>(x: &mut [[f64; W]], turn: Turn) {
    for [x, y] in x.as_chunks_mut().0 {
        for (x, y) in x.iter_mut().zip(y) {
            [*x, *y] = rotate([*x, *y], turn);
        }
    }
}

/// Rotates vectors, x and y in turn.
#[inline]
pub fn rotate_pairs(x: &mut [f64], turn: Turn) {
    rotate_sides(one_mut(x), turn);
}

/// Dot product in four strands: at these lengths a kernel is not worth its call.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a4, b4) = (a[..n].chunks_exact(4), b[..n].chunks_exact(4));
    let tail: f64 = a4.remainder().iter().zip(b4.remainder()).map(|(a, b)| a * b).sum();
    let mut strands = [0.0; 4];
    for (a, b) in a4.zip(b4) {
        for i in 0..4 {
            strands[i] += a[i] * b[i];
        }
    }
    strands.iter().sum::<f64>() + tail
}

/// The opposite turn.
#[inline]
pub fn back((sin, cos): Turn) -> Turn {
    (-sin, cos)
}

/// Turns the first two groups of `half` unknowns of a matrix (lower triangle, order n) by an angle each.
fn rotate_faces(matrix: &mut [f64], n: usize, half: usize, turns: &[Turn; 2]) {
    for k in (0..2 * half).step_by(2) {
        // The rotation of columns needs the whole of the blocks on the diagonal.
        matrix[k + (k + 1) * n] = matrix[k + 1 + k * n];
        let (sin, cos) = turns[k / half];
        let (left, right) = matrix.split_at_mut((k + 1) * n);
        for (x, y) in left[k * n + k..].iter_mut().zip(&mut right[k..n]) {
            (*x, *y) = (cos * *x - sin * *y, sin * *x + cos * *y);
        }
    }
    for (col, column) in matrix.chunks_exact_mut(n).take(2 * half).enumerate() {
        for (side, turn) in turns.iter().enumerate() {
            let from = (col - col % 2).clamp(side * half, (side + 1) * half);
            rotate_pairs(&mut column[from..(side + 1) * half], *turn);
        }
    }
}
