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

use pulp::{Simd, WithSimd};

use crate::mesh::rotate;

use super::chain::Chain;
use super::dense::{Backward, Eliminate, Forward, Multiply, MultiplyTransposed, kernel, one, one_mut};
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
    pub panel: Vec<f64>,
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

/// A cell at its place in a system that is being solved.
#[derive(Clone, Copy)]
pub struct CellAt<'a> {
    /// Its tangent.
    pub tangent: &'a CellTangent,
    /// The cell.
    pub cell: &'a Cell,
    /// Its unknowns among those of both wheels.
    pub unknowns: &'a [u32],
    /// The factor of faces and tractions.
    pub order: &'a Chain,
}

impl CellTangent {
    fn panel<'a>(&'a self, cell: &'a Cell) -> &'a [f64] {
        if self.panel.is_empty() { &cell.free_body } else { &self.panel }
    }
}

impl CellAt<'_> {
    /// Values that the way forward leaves for the way back, and those behind them that either uses up.
    pub fn kept(&self) -> [usize; 2] {
        [2 * self.cell.flank() + self.cell.bore(), self.cell.bore() + 2 * self.cell.face()]
    }

    /// Those of forces and of what the flanks yield, which are kept; of bore and faces.
    fn parts<'v, const W: usize>(&self, kept: &'v mut [[f64; W]]) -> [&'v mut [[f64; W]]; 3] {
        let (force, others) = kept.split_at_mut(self.cell.flank() + self.cell.bore());
        let (yielded, others) = others.split_at_mut(self.cell.flank());
        [force, yielded, &mut others[..self.kept()[1]]]
    }

    /// Brings the forces on flank and bore nodes (`unknowns` of `x`) to faces and tractions (`chain`). What the way
    /// back needs of it goes to `kept`.
    #[inline(always)]
    pub fn forward<S: Simd, const W: usize>(self, simd: S, x: &Sides, chain: &mut [[f64; W]], kept: &mut [[f64; W]]) {
        let CellAt { tangent, cell, unknowns, order } = self;
        let (f, b, face) = (cell.flank(), cell.bore(), cell.face());
        let [force, yielded, body] = self.parts(kept);
        take(x, unknowns.iter().map(|u| *u as usize), force);
        rotate_sides(force, back(tangent.place.frame));
        let (flank, bore) = force.split_at_mut(f);
        body[..b].copy_from_slice(bore);
        body[b..].fill([0.0; W]);
        yielded.fill([0.0; W]);
        MultiplyTransposed { a: &cell.flank_coupling, x: flank, sign: -1.0, y: body }.with_simd(simd);
        Multiply { a: &cell.flank_flexibility, x: flank, sign: 1.0, y: yielded }.with_simd(simd);
        bore.copy_from_slice(&body[..b]);
        let faces = &mut body[b..];
        Forward { panel: tangent.panel(cell), sign: 1.0, x: bore, rest: faces }.with_simd(simd);
        // Rows of tractions and geometry.
        let columns = tangent.tractions.iter().flat_map(|t| t.forces());
        let on = |(start, column): (usize, &[f64])| dot_sides(column, &yielded[start..start + column.len()]);
        let mut rest: Vec<[f64; W]> = columns.map(|column| on(column).map(|x| -x)).collect();
        if !tangent.turn_rate.is_empty() {
            rest.push(dot_sides(&tangent.flank_geometric, yielded).map(|x| -x));
        }
        for (r, earlier) in rest.iter_mut().zip(tangent.extra.chunks_exact(b.max(1))) {
            add(r, -1.0, &dot_sides(earlier, bore));
        }
        if let (Some(folded), false) = (rest.last(), tangent.turn_rate.is_empty()) {
            faces.iter_mut().zip(&tangent.turn_rate).for_each(|(x, a)| add(x, *a, folded));
        }
        for (side, part) in faces.chunks_exact_mut(face).enumerate() {
            rotate_sides(part, tangent.place.faces[side]);
            let to = order.offset(tangent.place.blocks[side] as usize);
            chain[to..to + face].iter_mut().zip(part.iter()).for_each(|(c, x)| add(c, 1.0, x));
        }
        let mut rest = rest.as_slice();
        for traction in &tangent.tractions {
            let (own, others) = rest.split_at(traction.forces().count());
            let to = order.offset(traction.block as usize);
            chain[to..to + own.len()].iter_mut().zip(own).for_each(|(c, x)| add(c, 1.0, x));
            rest = others;
        }
    }

    /// Displacements of flank and bore nodes, faces and tractions being solved; `kept` as the way forward left it.
    #[inline(always)]
    pub fn backward<S: Simd, const W: usize>(self, simd: S, x: &mut Sides, chain: &[[f64; W]], kept: &mut [[f64; W]]) {
        let CellAt { tangent, cell, unknowns, order } = self;
        let (f, b, face) = (cell.flank(), cell.bore(), cell.face());
        let [force, yielded, body] = self.parts(kept);
        for (side, part) in body[b..].chunks_exact_mut(face).enumerate() {
            let from = order.offset(tangent.place.blocks[side] as usize);
            part.copy_from_slice(&chain[from..from + face]);
            rotate_sides(part, back(tangent.place.faces[side]));
        }
        let mut rest = Vec::with_capacity(tangent.extra.len() / b.max(1));
        for traction in &tangent.tractions {
            let from = order.offset(traction.block as usize);
            rest.extend_from_slice(&chain[from..from + traction.forces().count()]);
        }
        let turn = dot_sides(&tangent.turn_rate, &body[b..b + tangent.turn_rate.len()]);
        if !tangent.turn_rate.is_empty() {
            rest.push(turn);
        }
        let (flank, bore) = force.split_at_mut(f);
        for (value, earlier) in rest.iter().zip(tangent.extra.chunks_exact(b.max(1))) {
            bore.iter_mut().zip(earlier).for_each(|(x, e)| add(x, -e, value));
        }
        let (bore_body, faces) = body.split_at_mut(b);
        Backward { panel: tangent.panel(cell), sign: 1.0, x: bore, rest: faces }.with_simd(simd);
        bore_body.copy_from_slice(bore);
        // Flanks: yielded - C (G lambda + g turn) - T body.
        flank.copy_from_slice(yielded);
        yielded.fill([0.0; W]);
        yielded.iter_mut().zip(&tangent.flank_geometric).for_each(|(l, g)| add(l, *g, &turn));
        let columns = tangent.tractions.iter().flat_map(|t| t.forces());
        for ((start, column), traction) in columns.zip(rest.iter()) {
            yielded[start..].iter_mut().zip(column).for_each(|(l, g)| add(l, *g, traction));
        }
        Multiply { a: &cell.flank_flexibility, x: yielded, sign: -1.0, y: flank }.with_simd(simd);
        Multiply { a: &cell.flank_coupling, x: body, sign: -1.0, y: flank }.with_simd(simd);
        rotate_sides(force, tangent.place.frame);
        put(x, unknowns.iter().map(|u| *u as usize), force);
    }
}

/// Right-hand sides, or their solutions.
pub type Sides<'a> = [&'a mut [f64]];

/// The values of some unknowns, all sides beside one another; zero beyond the last side.
#[inline(always)]
pub fn take<const W: usize>(sides: &Sides, of: impl Iterator<Item = usize> + Clone, to: &mut [[f64; W]]) {
    to.fill([0.0; W]);
    for (w, side) in sides.iter().enumerate() {
        to.iter_mut().zip(of.clone()).for_each(|(to, unknown)| to[w] = side[unknown]);
    }
}

/// The other way.
#[inline(always)]
pub fn put<const W: usize>(sides: &mut Sides, of: impl Iterator<Item = usize> + Clone, from: &[[f64; W]]) {
    for (w, side) in sides.iter_mut().enumerate() {
        from.iter().zip(of.clone()).for_each(|(from, unknown)| side[unknown] = from[w]);
    }
}

// Reduces a cell to its contribution, maybe that of its last time; false where it is not stiff. Where anything touches
// the bore, the panel has the columns of the bore of bore and faces, as they are then, and `touched` the others, which
// are used up. `geometric`: a on the faces, g on all nodes and c of a frame that turns (see `CoRotation`).
kernel!(Reduce {
    tangent: &'a mut CellTangent, cell: &'a Cell, place: CellPlacement, tractions: Vec<Traction>,
    geometric: Option<(&'a [f64], Vec<f64>, f64)>, touched: &'a mut [f64], matrix: &'a mut Vec<f64>
} -> bool, |simd| {
    let (f, b, i) = (cell.flank(), cell.bore(), 2 * cell.face());
    let r = b + i;
    (tangent.place, tangent.tractions) = (place, tractions);

    // Bore and faces.
    let touches = !tangent.panel.is_empty();
    if touches && !(Eliminate { panel: &mut tangent.panel, rest: touched, m: r, sign: 1.0 }).with_simd(simd) {
        return false;
    }
    let faces = if touches { &*touched } else { &cell.free_body[r * b..] };
    let columns: Vec<(usize, &[f64])> = tangent.tractions.iter().flat_map(|t| t.forces()).collect();
    let n = i + columns.len();
    if geometric.is_none() && columns.is_empty() && matrix.len() == n * n {
        // A cell that neither turns nor bears anything contributes the same whenever it does.
        tangent.extra.clear();
        return true;
    }
    matrix.resize(n * n, 0.0);
    for col in 0..i {
        matrix[col * n + col..col * n + i].copy_from_slice(&faces[col * r + b + col..(col + 1) * r]);
    }

    // Tractions, then the geometric row: flank nodes, bore nodes, one row after the other.
    let panel = if tangent.panel.is_empty() { &cell.free_body[..r * b] } else { &tangent.panel };
    let geometric_flank = geometric.as_ref().map_or(&[][..], |(_, g, _)| &g[..f]);
    tangent.extra.clear();
    let mut yielded = vec![0.0; f];
    let mut geometric_tractions = vec![0.0; columns.len()];
    for (k, &(start, column)) in columns.iter().enumerate() {
        let done = tangent.extra.len();
        tangent.extra.resize(done + r, 0.0);
        let (earlier, follow) = tangent.extra.split_at_mut(done);
        for (x, t) in follow.iter_mut().zip(cell.flank_coupling.chunks_exact(f)) {
            *x = -dot(column, &t[start..start + column.len()]);
        }
        yielded.fill(0.0);
        let flexibility = &cell.flank_flexibility[start * f..(start + column.len()) * f];
        Multiply { a: flexibility, x: one(column), sign: 1.0, y: one_mut(&mut yielded) }.with_simd(simd);
        for (l, &(other, against)) in columns.iter().enumerate().skip(k) {
            matrix[i + l + (i + k) * n] = -dot(against, &yielded[other..other + against.len()]);
        }
        if geometric.is_some() {
            geometric_tractions[k] = -dot(geometric_flank, &yielded);
        }
        let (bore, faces) = follow.split_at_mut(b);
        Forward { panel, sign: 1.0, x: one_mut(bore), rest: one_mut(faces) }.with_simd(simd);
        for (l, earlier) in earlier.chunks_exact(b.max(1)).enumerate() {
            matrix[i + k + (i + l) * n] -= dot(earlier, bore);
        }
        matrix[i + k + (i + k) * n] -= dot(bore, bore);
        for (col, x) in faces.iter().enumerate() {
            matrix[i + k + col * n] = *x;
        }
        tangent.extra.truncate(done + b);
    }
    tangent.turn_rate.clear();
    tangent.flank_geometric.clear();
    if let Some((a, g, c)) = &geometric {
        let done = tangent.extra.len();
        tangent.extra.extend_from_slice(&g[f..]);
        let (earlier, follow) = tangent.extra.split_at_mut(done);
        MultiplyTransposed {
            a: &cell.flank_coupling,
            x: one(geometric_flank),
            sign: -1.0,
            y: one_mut(follow),
        }.with_simd(simd);
        yielded.fill(0.0);
        Multiply {
            a: &cell.flank_flexibility,
            x: one(geometric_flank),
            sign: 1.0,
            y: one_mut(&mut yielded),
        }.with_simd(simd);
        let mut c = c - dot(geometric_flank, &yielded);
        let (bore, faces) = follow.split_at_mut(b);
        Forward { panel, sign: 1.0, x: one_mut(bore), rest: one_mut(faces) }.with_simd(simd);
        for (x, earlier) in geometric_tractions.iter_mut().zip(earlier.chunks_exact(b.max(1))) {
            *x -= dot(earlier, bore);
        }
        c -= dot(bore, bore);
        for (col, column) in matrix.chunks_exact_mut(n).take(i).enumerate() {
            let (ga, aa) = (a[col], faces[col] + c * a[col]);
            let (on_faces, on_tractions) = column.split_at_mut(i);
            for ((x, g), a) in on_faces[col..].iter_mut().zip(&faces[col..]).zip(&a[col..]) {
                *x += g * ga + a * aa;
            }
            on_tractions.iter_mut().zip(&geometric_tractions).for_each(|(x, g)| *x += g * ga);
        }
        tangent.extra.truncate(done + b);
        tangent.turn_rate.extend_from_slice(a);
        tangent.flank_geometric.extend_from_slice(geometric_flank);
    }
    rotate_faces(matrix, n, i / 2, &tangent.place.faces);
    true
});

/// Dot products with W right-hand sides.
#[inline(always)]
fn dot_sides<const W: usize>(a: &[f64], b: &[[f64; W]]) -> [f64; W] {
    let mut sum = [0.0; W];
    a.iter().zip(b).for_each(|(a, b)| add(&mut sum, *a, b));
    sum
}

/// `x += factor y`.
#[inline(always)]
fn add<const W: usize>(x: &mut [f64; W], factor: f64, y: &[f64; W]) {
    x.iter_mut().zip(y).for_each(|(x, y)| *x += factor * y);
}

/// Rotates the vectors of W right-hand sides, x and y in turn.
#[inline(always)]
pub fn rotate_sides<const W: usize>(x: &mut [[f64; W]], turn: Turn) {
    for [x, y] in x.as_chunks_mut().0 {
        for (x, y) in x.iter_mut().zip(y) {
            [*x, *y] = rotate([*x, *y], turn);
        }
    }
}

/// Rotates vectors, x and y in turn.
#[inline(always)]
pub fn rotate_pairs(x: &mut [f64], turn: Turn) {
    rotate_sides(one_mut(x), turn);
}

/// Dot product in four strands: at these lengths a kernel is not worth its call.
#[inline(always)]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
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
#[inline(always)]
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
