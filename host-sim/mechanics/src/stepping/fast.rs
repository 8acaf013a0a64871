//! The `fast` solver's wheels: condensed cells in turning frames, and a block factorisation around the rings.
//!
//! A factorisation reduces every cell to its faces and to the tractions on its flanks ([`CellTangent`]) and then
//! eliminates faces and tractions around both rings ([`Chain`]).

use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;
use std::rc::Rc;

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use crate::condense::{
    CellAt, CellPlacement, CellState, CellTangent, Chain, ChainBlock, CoRotation, CondensedWheel, Multiply, Reduce,
    Sides, Traction, Turn, back, kernel, one, one_mut, put, rotate_pairs, rotate_sides, take,
};
use crate::contact::{BorePressure, FlankPair};
use crate::drive::Side;
use crate::fem::Factor;
use crate::fem::element::packed_index;
use crate::fem::material::PlaneStrain;
use crate::mesh::WheelMesh;

use super::newton::ANCHOR;
use super::problem::Problem;
use super::state::State;
use super::wheels::Wheels;

/// Both wheels of a drive, condensed: what all solvers of a problem share.
#[derive(Debug, Clone)]
pub struct CondensedDrive {
    /// The flexspline.
    pub flexspline: CondensedWheel,
    /// The circular spline.
    pub circular_spline: CondensedWheel,
    /// Frames at rest of the flexspline cells and of the circular-spline cells.
    frames: [Vec<Turn>; 2],
    faces: Vec<CellFace>,
}

/// A face between two cells: its block, its unknowns, and its frame.
#[derive(Debug, Clone)]
pub(crate) struct CellFace {
    block: usize,
    unknowns: Range<usize>,
    turn: Turn,
}

impl CondensedDrive {
    /// Condenses both wheels; `held` are the circular-spline nodes that the housing holds.
    pub fn new(
        flexspline: &WheelMesh,
        circular_spline: &WheelMesh,
        material: &PlaneStrain,
        held: impl Fn(u32) -> bool + Sync,
    ) -> CondensedDrive {
        let flexspline = CondensedWheel::new(flexspline, material, 0, |_| false);
        let first = 2 * flexspline.skin.mesh.nodes.len();
        let circular_spline = CondensedWheel::new(circular_spline, material, first, held);
        let (fs, cs) = (&flexspline.skin.mesh, &circular_spline.skin.mesh);
        let face = |block: usize, first: usize, size: usize, angle: f64| CellFace {
            block,
            unknowns: first..first + size,
            turn: angle.sin_cos(),
        };
        let fs_face = |j: usize| face(j, 2 * j * fs.nodes_per_sector, flexspline.face(), (j as f64 - 0.5) * fs.pitch());
        let cs_face = |t: usize| {
            let start = first + 2 * t * cs.nodes_per_sector;
            face(fs.teeth + t, start, circular_spline.face(), t as f64 * cs.pitch())
        };
        let faces = (0..fs.teeth).map(fs_face).chain((0..cs.teeth).map(cs_face)).collect();
        let frames = [
            (0..fs.teeth).map(|j| fs.sector_angle(j).sin_cos()).collect(),
            (0..cs.teeth).map(|t| cs_frame(cs, t).sin_cos()).collect(),
        ];
        CondensedDrive { flexspline, circular_spline, frames, faces }
    }

    /// A flexspline cell as it is under the displacements `u` of the skin. `d` is work space.
    fn flexspline_cell(&self, j: usize, flanks: bool, u: &[f64], d: &mut Vec<f64>, inner: &mut CellState) {
        let (cell, unknowns) = self.flexspline.cell(j, flanks);
        d.clear();
        d.extend(unknowns.iter().map(|k| u[*k as usize]));
        rotate_pairs(d, back(self.frames[0][j]));
        cell.frame.split(d, inner);
    }

    /// Displacements of a circular-spline cell in its frame, into `d`, of the displacements `v` of the skin.
    fn circular_spline_cell(&self, t: usize, flanks: bool, v: &[f64], d: &mut Vec<f64>) {
        let cs = &self.circular_spline;
        let (_, unknowns) = cs.cell(t, flanks);
        d.clear();
        d.extend(unknowns.iter().map(|k| v[*k as usize - cs.first_unknown]));
        rotate_pairs(d, back(self.frames[1][t]));
    }

    /// The state on all nodes of the wheels of `problem`, which this was made of.
    pub(super) fn recover(&self, problem: &Problem, state: &State) -> State {
        let (fs, whole) = (&self.flexspline, &problem.flexspline);
        let mut u = fs.spread(whole, &state.u);
        let inside_flexspline = |j: usize| -> Vec<f64> {
            let mut inner = CellState::default();
            self.flexspline_cell(j, true, &state.u, &mut Vec::new(), &mut inner);
            let (element, _) = fs.element(j);
            let mut moved = CoRotation::join(&inner, element.interior().1, &element.recover(&inner.q, 0.0));
            rotate_pairs(&mut moved, self.frames[0][j]);
            moved
        };
        place_interiors(fs, whole, inside_flexspline, &mut u);
        let (cs, whole) = (&self.circular_spline, &problem.circular_spline);
        let mut v = cs.spread(whole, &state.v);
        let inside_circular_spline = |t: usize| -> Vec<f64> {
            let mut d = Vec::new();
            self.circular_spline_cell(t, true, &state.v, &mut d);
            let mut moved = cs.element(t).0.recover(&d, problem.seat_displacement);
            rotate_pairs(&mut moved, self.frames[1][t]);
            moved
        };
        place_interiors(cs, whole, inside_circular_spline, &mut v);
        problem.seat(&mut v);
        State { u, v, ..state.clone() }
    }

    fn fs_mesh(&self) -> &WheelMesh {
        &self.flexspline.skin.mesh
    }

    fn cs_mesh(&self) -> &WheelMesh {
        &self.circular_spline.skin.mesh
    }

    /// The circular-spline cell that carries the flank of a pair.
    fn cs_cell(&self, pair: FlankPair) -> usize {
        let teeth = self.cs_mesh().teeth;
        match pair.side {
            Side::Plus => pair.space,
            Side::Minus => (pair.space + teeth - 1) % teeth,
        }
    }
}

/// Angle of the frame of a circular-spline cell, rad.
fn cs_frame(mesh: &WheelMesh, cell: usize) -> f64 {
    (cell as f64 + 0.5) * mesh.pitch()
}

/// Writes the displacements of the nodes inside the cells of a wheel, cell by cell, into a field of the whole wheel.
fn place_interiors(
    wheel: &CondensedWheel,
    whole: &WheelMesh,
    displacements: impl Fn(usize) -> Vec<f64> + Send + Sync,
    field: &mut [f64],
) {
    let cells: Vec<Vec<f64>> = (0..wheel.count()).into_par_iter().with_min_len(24).map(displacements).collect();
    for (j, moved) in cells.iter().enumerate() {
        let (element, further) = wheel.element(j);
        for (node, x) in element.interior().0.iter().zip(moved.chunks_exact(2)) {
            // The node is given in the cell that was condensed, `further` sectors back.
            let (sector, local) = (*node as usize / whole.nodes_per_sector, node % whole.nodes_per_sector as u32);
            let n = whole.node((sector + further) as isize, local);
            field[2 * n..2 * n + 2].copy_from_slice(x);
        }
    }
}

/// A factorised tangent.
#[derive(Debug, Clone, Default)]
pub(super) struct Factorisation {
    /// Cells whose flank nodes took part.
    live: Vec<bool>,
    /// Cells of the flexspline, then of the circular spline.
    cells: Vec<CellTangent>,
    chain: Chain,
}

/// A factorised tangent that others hold too.
pub(super) type Kept = Rc<Factorisation>;

pub(super) struct CondensedWheels<'p> {
    problem: &'p Problem,
    model: &'p CondensedDrive,
    arch: Arch,
    /// Cells with a flank that touches or may soon; the flank nodes of the others follow when all is done.
    live: Vec<bool>,
    /// Those whose flank nodes took part in the last solution.
    solved: Vec<bool>,
    /// The flexspline cells of this state, their forces before balancing, and those of their displacements turned by a
    /// quarter, for the tangent.
    states: Vec<CellState>,
    forces: Vec<Vec<f64>>,
    quarter_forces: Vec<Vec<f64>>,
    /// Where the wave and the output stand.
    generator_rad: f64,
    output_rad: f64,
    /// Contact of this state: edges of the bore; pairs of flanks with their nodal tangent.
    bore: Vec<(usize, [f64; 21])>,
    flanks: Vec<(FlankPair, Vec<f64>)>,
    factor: Kept,
    /// What cells contribute to a factorisation: work space for those of the flexspline, then each of the circular
    /// spline.
    contributions: Vec<Vec<f64>>,
    /// Work space of a solution.
    kept: Vec<f64>,
    /// Pitches by which the state is turned against the one that the factor was made for.
    turned: isize,
}

impl<'p> CondensedWheels<'p> {
    pub fn new(problem: &'p Problem, model: &'p CondensedDrive) -> Self {
        let teeth = model.flexspline.count();
        let cells = teeth + model.circular_spline.count();
        CondensedWheels {
            problem,
            model,
            arch: Arch::new(),
            live: vec![false; cells],
            solved: vec![false; cells],
            states: vec![CellState::default(); teeth],
            forces: vec![Vec::new(); teeth],
            quarter_forces: vec![Vec::new(); teeth],
            generator_rad: 0.0,
            output_rad: 0.0,
            bore: Vec::new(),
            flanks: Vec::new(),
            factor: Rc::default(),
            contributions: Vec::new(),
            kept: Vec::new(),
            turned: 0,
        }
    }

    /// The contact of every pair as tractions on the cells of both wheels; and the size and tooth side of each pair's
    /// block.
    fn tractions(&self) -> (Vec<Vec<Traction>>, Vec<(FlankPair, usize)>) {
        let (fs, cs) = (self.model.fs_mesh(), self.model.cs_mesh());
        let mut by_cell = vec![Vec::new(); fs.teeth + cs.teeth];
        let mut ranks = Vec::new();
        for (pair, stiffness) in &self.flanks {
            let on_fs = 2 * fs.flanks[pair.side.index()].nodes.len();
            let (n, columns) = low_rank(stiffness);
            if columns.is_empty() {
                continue;
            }
            let block = (fs.teeth + cs.teeth + ranks.len()) as u32;
            let cs_cell = self.model.cs_cell(*pair);
            let traction = |turn: f64, part: std::ops::Range<usize>| {
                let length = part.len();
                let mut columns: Vec<f64> = columns.chunks_exact(n).flat_map(|c| &c[part.clone()]).copied().collect();
                rotate_pairs(&mut columns, turn.sin_cos());
                Traction { block, start: pair.side.index() * length, length, columns }
            };
            let fs_turn = fs.sector_angle(pair.tooth) + self.states[pair.tooth].turn;
            by_cell[pair.tooth].push(traction(-fs_turn, 0..on_fs));
            by_cell[fs.teeth + cs_cell].push(traction(-cs_frame(cs, cs_cell), on_fs..n));
            ranks.push((*pair, columns.len() / n));
        }
        (by_cell, ranks)
    }

    /// Blocks of the faces of a cell, those of the circular spline after those of the flexspline.
    fn faces(&self, cell: usize) -> [u32; 2] {
        let fs = self.model.flexspline.count();
        let ring = if cell < fs { 0..fs } else { fs..self.live.len() };
        let next = if cell + 1 < ring.end { cell + 1 } else { ring.start };
        [cell as u32, next as u32]
    }

    /// Forces of each flexspline cell by its displacements, turned by a quarter or not: of cells that are alike, four
    /// together.
    fn cell_forces(&self, quarter: bool, mut forces: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let cell = |j: usize| self.model.flexspline.cell(j, self.live[j]).0;
        let all: Vec<usize> = (0..forces.len()).collect();
        for group in all.chunk_by(|i, j| std::ptr::eq(cell(*i), cell(*j))).flat_map(|alike| alike.chunks(4)) {
            let mut sides = vec![[0.0; 4]; self.states[group[0]].q.len()];
            let mut products = sides.clone();
            for (w, j) in group.iter().enumerate() {
                for ([x, y], q) in sides.as_chunks_mut().0.iter_mut().zip(self.states[*j].q.as_chunks::<2>().0) {
                    (x[w], y[w]) = if quarter { (-q[1], q[0]) } else { (q[0], q[1]) };
                }
            }
            self.arch.dispatch(Multiply { a: &cell(group[0]).stiffness, x: &sides, sign: 1.0, y: &mut products });
            for (w, j) in group.iter().enumerate() {
                forces[*j].clear();
                forces[*j].extend(products.iter().map(|product| product[w]));
            }
        }
        forces
    }

    /// Reduces a flexspline cell.
    fn reduce_flexspline_cell(
        &self,
        j: usize,
        tangent: &mut CellTangent,
        tractions: Vec<Traction>,
        matrix: &mut Vec<f64>,
        rest: &mut Vec<f64>,
    ) -> bool {
        let mesh = self.model.fs_mesh();
        let (cell, _) = self.model.flexspline.cell(j, self.live[j]);
        let state = &self.states[j];
        let (g, c) = cell.frame.geometric(state, &self.forces[j], &self.quarter_forces[j]);
        let place = CellPlacement {
            frame: (mesh.sector_angle(j) + state.turn).sin_cos(),
            faces: [0.5, -0.5].map(|half| (state.turn + half * mesh.pitch()).sin_cos()),
            blocks: self.faces(j),
        };
        let geometric = Some((&state.turn_rate[..], g, c));
        self.touched_body(j, &mut tangent.panel, rest);
        self.arch.dispatch(Reduce { tangent, cell, place, tractions, geometric, touched: rest, matrix })
    }

    /// The matrix of bore and face nodes of a cell with the contact on its bore, columns of the bore (the `panel`) and
    /// the others; nothing where nothing touches it.
    fn touched_body(&self, j: usize, panel: &mut Vec<f64>, rest: &mut Vec<f64>) {
        let mesh = self.model.fs_mesh();
        let (cell, _) = self.model.flexspline.cell(j, false);
        let [b, face, order] = [cell.bore(), cell.face(), cell.bore() + 2 * cell.face()];
        let per_cell = mesh.base_edges.len();
        let (sin, cos) = (mesh.sector_angle(j) + self.states[j].turn).sin_cos();
        let first = self.bore.partition_point(|(edge, _)| *edge < j * per_cell);
        let touching = self.bore[first..].iter().take_while(|(edge, _)| *edge < (j + 1) * per_cell);
        panel.clear();
        for (edge, k) in touching {
            if panel.is_empty() {
                panel.extend_from_slice(&cell.body[..b * order]);
                rest.clear();
                rest.extend_from_slice(&cell.body[b * order..]);
            }
            // Nodes along the bore of the cell: corner of the first face, bore nodes, corner of the second face.
            let place = |n: usize| match n {
                0 => b,
                n if n == 2 * per_cell => b + face,
                n => 2 * (n - 1),
            };
            let along = 2 * (edge - j * per_cell);
            let entry = |r: usize, c: usize| k[packed_index(r, c)];
            for n in 0..3 {
                for m in 0..3 {
                    let (row, column) = (place(along + n), place(along + m));
                    if row < column {
                        continue;
                    }
                    // R^T K R, R being the frame of the cell.
                    let block = [0, 1].map(|x| [0, 1].map(|y| entry(2 * n + x, 2 * m + y)));
                    let rows =
                        [0, 1].map(|y| [cos * block[0][y] + sin * block[1][y], cos * block[1][y] - sin * block[0][y]]);
                    for x in 0..2 {
                        let values = [cos * rows[0][x] + sin * rows[1][x], cos * rows[1][x] - sin * rows[0][x]];
                        for y in 0..2 {
                            if row + x >= column + y {
                                let to = row + x + (column + y) * order;
                                if column < b { panel[to] += values[y] } else { rest[to - b * order] += values[y] }
                            }
                        }
                    }
                }
            }
        }
    }

    fn reduce_circular_spline_cell(
        &self,
        t: usize,
        tangent: &mut CellTangent,
        tractions: Vec<Traction>,
        matrix: &mut Vec<f64>,
    ) -> bool {
        let (first, mesh) = (self.model.fs_mesh().teeth, self.model.cs_mesh());
        let place = CellPlacement {
            frame: cs_frame(mesh, t).sin_cos(),
            faces: [0.5, -0.5].map(|half| (half * mesh.pitch()).sin_cos()),
            blocks: self.faces(first + t),
        };
        let (cell, _) = self.model.circular_spline.cell(t, self.live[first + t]);
        self.arch.dispatch(Reduce { tangent, cell, place, tractions, geometric: None, touched: &mut [], matrix })
    }

    /// Places the flank nodes of these cells where they stand while no force acts on them.
    fn place_flanks(&self, state: &mut State, of: impl Fn(usize) -> bool) {
        let (fs, cs) = (&self.model.flexspline, &self.model.circular_spline);
        let (mut d, mut inner) = (Vec::new(), CellState::default());
        for j in (0..fs.count()).filter(|j| of(*j)) {
            self.model.flexspline_cell(j, false, &state.u, &mut d, &mut inner);
            let (cell, all) = fs.cell(j, true);
            let q = cell.free_flanks(self.arch, &inner.q, 0.0);
            let mut flanks = CoRotation::join(&inner, cell.frame.positions(), &q);
            rotate_pairs(&mut flanks, self.model.frames[0][j]);
            all.iter().zip(&flanks).for_each(|(u, x)| state.u[*u as usize] = *x);
        }
        for t in (0..cs.count()).filter(|t| of(fs.count() + t)) {
            self.model.circular_spline_cell(t, false, &state.v, &mut d);
            let (cell, all) = cs.cell(t, true);
            let mut flanks = cell.free_flanks(self.arch, &d, self.problem.seat_displacement);
            rotate_pairs(&mut flanks, self.model.frames[1][t]);
            all.iter().zip(&flanks).for_each(|(u, x)| state.v[*u as usize - cs.first_unknown] = *x);
        }
    }

    /// Blocks around the rings, ordered by their angle from the minor axis of the generator, where no flanks touch.
    fn blocks(&self, ranks: &[(FlankPair, usize)]) -> Vec<ChainBlock> {
        let cut = self.generator_rad + FRAC_PI_2;
        let from_cut = |angle: f64| (angle - cut).rem_euclid(TAU);
        let (fs, cs) = (self.model.fs_mesh(), self.model.cs_mesh());
        let block = |size, angle| ChainBlock { size, sign: 1.0, key: from_cut(angle) };
        let (fs_size, cs_size) = (self.model.flexspline.face(), self.model.circular_spline.face());
        let fs_blocks = (0..fs.teeth).map(|j| block(fs_size, (j as f64 - 0.5) * fs.pitch()));
        let cs_blocks = (0..cs.teeth).map(|t| block(cs_size, t as f64 * cs.pitch() + self.output_rad));
        let mut blocks: Vec<ChainBlock> = fs_blocks.chain(cs_blocks).collect();
        // The first face of each ring closes it.
        for ring in [0..fs.teeth, fs.teeth..fs.teeth + cs.teeth] {
            if let Some(first) = ring.min_by(|a, b| blocks[*a].key.total_cmp(&blocks[*b].key)) {
                blocks[first].key += TAU;
            }
        }
        blocks.extend(ranks.iter().map(|(pair, rank)| {
            let angle = (pair.tooth as f64 + 0.25 * pair.side.sign()) * fs.pitch();
            ChainBlock { sign: -1.0, ..block(*rank, angle) }
        }));
        blocks
    }
}

/// Tangent of a pair of flanks of less than this, relative to the largest, is left out of the factor.
const RANK_TOLERANCE: f64 = 1e-10;

/// Order n and columns of G with `D = G G^T` for a positive semi-definite D (n x n by rows, lower triangle): Cholesky
/// with diagonal pivoting until nothing is left.
fn low_rank(stiffness: &[f64]) -> (usize, Vec<f64>) {
    let n = (stiffness.len() as f64).sqrt().round() as usize;
    let entry = |i: usize, j: usize| if i >= j { stiffness[i * n + j] } else { stiffness[j * n + i] };
    let mut diagonal: Vec<f64> = (0..n).map(|i| entry(i, i)).collect();
    let largest = diagonal.iter().fold(0.0_f64, |m, x| m.max(*x));
    let mut columns: Vec<f64> = Vec::new();
    while columns.len() < n * n {
        let (pivot, &value) = diagonal.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).expect("a pair has nodes");
        if value.is_nan() || value <= RANK_TOLERANCE * largest {
            break;
        }
        let mut column: Vec<f64> = (0..n).map(|i| entry(i, pivot)).collect();
        for earlier in columns.chunks_exact(n) {
            let factor = earlier[pivot];
            column.iter_mut().zip(earlier).for_each(|(c, e)| *c -= factor * e);
        }
        let scale = 1.0 / value.sqrt();
        for (c, d) in column.iter_mut().zip(&mut diagonal) {
            *c *= scale;
            *d -= *c * *c;
        }
        diagonal[pivot] = 0.0;
        columns.extend(column);
    }
    (n, columns)
}

impl Factor for CondensedWheels<'_> {
    fn solve(&mut self, columns: &mut [f64], count: usize) {
        match count {
            1 => self.solve_sides::<1>(columns),
            2..=4 => self.solve_sides::<4>(columns),
            _ => self.solve_sides::<8>(columns),
        }
    }
}

impl CondensedWheels<'_> {
    /// Solves in place for at most W right-hand sides, which lie one after the other in `columns`.
    fn solve_sides<const W: usize>(&mut self, columns: &mut [f64]) {
        self.solved.clone_from(&self.live);
        let unknowns = self.unknowns();
        let CondensedWheels { model, arch, factor, live, turned, kept, .. } = self;
        let factor = factor.as_ref();
        let (fs, cs) = (&model.flexspline, &model.circular_spline);
        // A cell that is near contact now has forces on its flanks, even if it had not where the factor was made.
        let (fs_live, cs_live) = live.split_at(fs.count());
        let now = |ring: &[bool], cell: usize| ring[(cell as isize + *turned).rem_euclid(ring.len() as isize) as usize];
        let cells: Vec<CellAt> = (0..fs.count())
            .map(|j| fs.cell(j, factor.live[j] || now(fs_live, j)))
            .chain((0..cs.count()).map(|t| cs.cell(t, factor.live[fs.count() + t] || now(cs_live, t))))
            .zip(&factor.cells)
            .map(|((cell, unknowns), tangent)| CellAt { tangent, cell, unknowns, order: &factor.chain })
            // A cell with neither flank nor bore has nothing to give and to take.
            .filter(|at| at.cell.flank() + at.cell.bore() > 0)
            .collect();
        let most = cells.iter().map(|at| at.kept()[1]).max().unwrap_or(0);
        let each = cells.iter().map(|at| at.kept()[0]).sum::<usize>() + most;
        kept.resize(kept.len().max(W * each), 0.0);
        let (mut sides, kept): (Vec<_>, _) =
            (columns.chunks_exact_mut(unknowns).collect(), kept.as_chunks_mut::<W>().0);
        arch.dispatch(Solve { order: &factor.chain, cells: &cells, faces: &model.faces, sides: &mut sides, kept });
    }
}

// Solves for W right-hand sides, which lie beside one another in `kept`.
kernel!(Solve<W> {
    order: &'a Chain, cells: &'a [CellAt<'a>], faces: &'a [CellFace], sides: &'a mut Sides<'a>,
    kept: &'a mut [[f64; W]]
} -> (), |simd| {
    let mut chain = vec![[0.0; W]; order.unknowns()];
    let mut start = 0;
    for at in cells {
        at.forward(simd, sides, &mut chain, &mut kept[start..]);
        start += at.kept()[0];
    }
    let mut own = Vec::new();
    for face in faces {
        own.resize(face.unknowns.len(), [0.0; W]);
        take(sides, face.unknowns.clone(), &mut own);
        rotate_sides(&mut own, back(face.turn));
        for (to, own) in chain[order.offset(face.block)..].iter_mut().zip(&own) {
            to.iter_mut().zip(own).for_each(|(to, x)| *to += *x);
        }
    }
    order.solve(&mut chain);
    // What a cell uses up lies where the next one kept something, which is done by then.
    for at in cells.iter().rev() {
        start -= at.kept()[0];
        at.backward(simd, sides, &chain, &mut kept[start..]);
    }
    for face in faces {
        own.clear();
        own.extend_from_slice(&chain[order.offset(face.block)..][..face.unknowns.len()]);
        rotate_sides(&mut own, face.turn);
        put(sides, face.unknowns.clone(), &own);
    }
});

impl Wheels for CondensedWheels<'_> {
    fn unknowns(&self) -> usize {
        2 * (self.model.fs_mesh().nodes.len() + self.model.cs_mesh().nodes.len())
    }

    fn prepare(&mut self, near: &[FlankPair], _widely: &dyn Fn() -> Vec<FlankPair>) -> bool {
        self.live.fill(false);
        for &pair in near {
            let cs_cell = self.model.cs_cell(pair);
            self.live[pair.tooth] = true;
            self.live[self.model.flexspline.count() + cs_cell] = true;
        }
        false
    }

    fn complete(&self, state: &mut State) {
        self.place_flanks(state, |cell| !self.live[cell]);
    }

    fn follow(&self, state: &mut State) {
        self.place_flanks(state, |cell| self.live[cell] && !self.solved[cell]);
    }

    fn assemble(&mut self, state: &State, force: &mut [f64]) {
        self.bore.clear();
        self.flanks.clear();
        self.generator_rad = state.generator_rad;
        self.output_rad = state.output_rad;
        let fs = &self.model.flexspline;
        let mut d = Vec::new();
        for (j, inner) in self.states.iter_mut().enumerate() {
            self.model.flexspline_cell(j, self.live[j], &state.u, &mut d, inner);
        }
        let forces = std::mem::take(&mut self.forces);
        self.forces = self.cell_forces(false, forces);
        for (j, inner) in self.states.iter().enumerate() {
            let (cell, unknowns) = fs.cell(j, self.live[j]);
            d.clone_from(&self.forces[j]);
            cell.frame.balance(inner, &mut d);
            rotate_pairs(&mut d, (fs.skin.mesh.sector_angle(j) + inner.turn).sin_cos());
            for (u, f) in unknowns.iter().zip(&d) {
                force[*u as usize] -= f;
            }
        }
        let cs = &self.model.circular_spline;
        let mut f = Vec::new();
        for t in 0..cs.count() {
            let live = self.live[fs.count() + t];
            let (cell, unknowns) = cs.cell(t, live);
            self.model.circular_spline_cell(t, live, &state.v, &mut d);
            f.clear();
            f.extend(cell.seat.iter().map(|s| s * self.problem.seat_displacement));
            self.arch.dispatch(Multiply { a: &cell.stiffness, x: one(&d), sign: 1.0, y: one_mut(&mut f) });
            rotate_pairs(&mut f, self.model.frames[1][t]);
            for (u, f) in unknowns.iter().zip(&f) {
                force[*u as usize] -= f;
            }
        }
    }

    fn add_bore(&mut self, contact: &BorePressure) {
        self.bore.push((contact.edge, contact.stiffness));
    }

    fn add_flank(&mut self, pair: FlankPair, stiffness: Vec<f64>) {
        self.flanks.push((pair, stiffness));
    }

    /// The bore corner of the first face of cell 0, along the bore.
    fn anchor(&self) -> Vec<(usize, f64)> {
        let (sin, cos) = (-0.5 * self.model.fs_mesh().pitch()).sin_cos();
        vec![(0, -sin), (1, cos)]
    }

    fn factorise(&mut self, spring: f64) -> bool {
        let forces = std::mem::take(&mut self.quarter_forces);
        self.quarter_forces = self.cell_forces(true, forces);
        let (mut tractions, ranks) = self.tractions();
        let blocks = self.blocks(&ranks);
        let mut factor = Rc::try_unwrap(std::mem::take(&mut self.factor)).unwrap_or_default();
        let Factorisation { live, cells, chain } = &mut factor;
        live.clone_from(&self.live);
        cells.resize_with(live.len(), CellTangent::default);
        let of_cell = |(c, tractions): (usize, &Vec<Traction>)| {
            self.faces(c).into_iter().chain(tractions.iter().map(|traction| traction.block)).collect()
        };
        let mut contributions: Vec<Vec<u32>> = tractions.iter().enumerate().map(of_cell).collect();
        // Springs, the anchor (tangential is y in the frame of a face), and the unit of the tractions.
        let diagonal = |block: &ChainBlock| if block.sign < 0.0 { -1.0 } else { spring };
        let stiffened = blocks.iter().enumerate().filter(|(k, block)| diagonal(block) != 0.0 || *k == 0);
        contributions.extend(stiffened.map(|(k, _)| vec![k as u32]));
        let (mut matrices, mut rest) = (std::mem::take(&mut self.contributions), Vec::new());
        let fs_cells = self.model.flexspline.count();
        matrices.resize_with(1 + live.len() - fs_cells, Vec::new);
        let definite = chain.factorise(&blocks, &contributions, |c, add| {
            let Some(tangent) = cells.get_mut(c) else {
                let k = contributions[c][0] as usize;
                let n = blocks[k].size;
                let mut matrix = vec![0.0; n * n];
                matrix.iter_mut().step_by(n + 1).for_each(|x| *x = diagonal(&blocks[k]));
                if k == 0 {
                    matrix[n + 1] += ANCHOR;
                }
                add(&matrix);
                return true;
            };
            let tractions = std::mem::take(&mut tractions[c]);
            // Cells of the flexspline share a matrix, those of the circular spline may have theirs from last time.
            let matrix = &mut matrices[(c + 1).saturating_sub(fs_cells)];
            let definite = if c < fs_cells {
                self.reduce_flexspline_cell(c, tangent, tractions, matrix, &mut rest)
            } else {
                self.reduce_circular_spline_cell(c - fs_cells, tangent, tractions, matrix)
            };
            if definite {
                add(matrix);
            }
            definite
        });
        self.contributions = matrices;
        self.factor = Rc::new(factor);
        self.turned = 0;
        definite
    }

    fn keep(&self) -> Option<Kept> {
        Some(self.factor.clone())
    }

    fn recall(&mut self, kept: &Kept, pitches: isize) {
        self.factor = kept.clone();
        self.turned = pitches;
    }

    fn turn(&self, x: &mut [f64], pitches: isize) {
        let (fs, cs) = x.split_at_mut(self.model.circular_spline.first_unknown);
        for (mesh, part) in [(self.model.fs_mesh(), fs), (self.model.cs_mesh(), cs)] {
            let sector = 2 * mesh.nodes_per_sector;
            part.rotate_right(pitches.rem_euclid(mesh.teeth as isize) as usize * sector);
            rotate_pairs(part, (pitches as f64 * mesh.pitch()).sin_cos());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{Drive, GeneratorKind};
    use crate::mesh::MeshLevel;
    use crate::stepping::near::configuration;
    use crate::stepping::{Method, SolverSettings};

    /// Right-hand sides that are solved together have the solutions that each has alone.
    #[test]
    fn sides_solved_together_are_solved() {
        let settings = SolverSettings { method: Method::Fast, mesh: MeshLevel::Coarse, ..SolverSettings::default() };
        let problem = Problem::new(&Drive::hhd_95(), GeneratorKind::Cam, 20.0, settings).unwrap();
        let mut wheels = CondensedWheels::new(&problem, problem.condensed.as_ref().unwrap());
        let state = problem.starting_shape(0.0);
        let near = problem.flanks().near_pairs(configuration(&state), 0.1);
        wheels.prepare(&near, &Vec::new);
        wheels.assemble(&state, &mut vec![0.0; wheels.unknowns()]);
        assert!(wheels.factorise(1.0));
        let n = wheels.unknowns();
        let sides: Vec<f64> = (0..6 * n).map(|i| (0.7 * i as f64).sin()).collect();
        let mut alone = sides.clone();
        alone.chunks_exact_mut(n).for_each(|side| wheels.solve(side, 1));
        let size = alone.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        for count in [2, 3, 6] {
            let mut together = sides.clone();
            together.chunks_exact_mut(count * n).for_each(|part| wheels.solve(part, count));
            let off = together.iter().zip(&alone).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
            assert!(size > 0.0 && off < 1e-9 * size, "{count} at once: {off} of {size}");
        }
    }

    /// A step that was solved without a tooth's flanks moves the tooth alone; following it, the flanks bear no force,
    /// as before.
    #[test]
    fn flanks_that_come_near_after_a_step_was_solved_stay_with_their_teeth() {
        let drive = Drive::hhd_95();
        let settings = SolverSettings { method: Method::Fast, mesh: MeshLevel::Coarse, ..SolverSettings::default() };
        let problem = Problem::new(&drive, GeneratorKind::Cam, drive.temperature.reference_c, settings).unwrap();
        let mut wheels = CondensedWheels::new(&problem, problem.condensed.as_ref().unwrap());
        let mut state = problem.starting_shape(0.0);
        wheels.complete(&mut state);
        let mut step = vec![0.0; wheels.unknowns()];
        wheels.assemble(&state, &mut step);
        assert!(wheels.factorise(1.0));
        wheels.solve(&mut step, 1);

        let near = problem.flanks().near_pairs(configuration(&state), 0.1);
        wheels.prepare(&near, &Vec::new);
        state.u.iter_mut().zip(&step).for_each(|(u, d)| *u += d);
        let left_behind = largest_on_flanks(&mut wheels, &near, &state);
        wheels.follow(&mut state);
        let followed = largest_on_flanks(&mut wheels, &near, &state);
        assert!(
            near.len() > 20 && left_behind > 1e6 * followed,
            "{} pairs: {left_behind} and {followed} N",
            near.len()
        );
    }

    /// Largest force of the elements on a flank node of these teeth, N/mm.
    fn largest_on_flanks(wheels: &mut CondensedWheels<'_>, near: &[FlankPair], state: &State) -> f64 {
        let mut force = vec![0.0; wheels.unknowns()];
        wheels.assemble(state, &mut force);
        let flanks = wheels.problem.flanks();
        let nodes = near.iter().flat_map(|pair| flanks.fs_nodes(*pair));
        nodes.flat_map(|n| [force[2 * n], force[2 * n + 1]]).fold(0.0, |most, f| most.max(f.abs()))
    }
}
