//! The `fast` solver's wheels: condensed cells in turning frames, and a block factorisation around the rings.
//!
//! A factorisation reduces every cell to its faces and to the tractions on its flanks ([`CellTangent`]) and then
//! eliminates faces and tractions around both rings ([`Chain`]).

use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;
use std::rc::Rc;

use rayon::prelude::*;

use crate::condense::{
    CellAt, CellPlacement, CellState, CellTangent, Chain, ChainBlock, CoRotation, CondensedWheel, DenseKernels,
    Geometric, Traction, Turn, back, one, one_mut, rotate_pairs, rotate_sides,
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
struct CellFace {
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
    kernels: DenseKernels,
    /// Cells with a flank that touches or may soon; the flank nodes of the others follow when all is done.
    live: Vec<bool>,
    /// Those whose flank nodes took part in the last solution.
    solved: Vec<bool>,
    /// The flexspline cells of this state, and their forces before balancing.
    states: Vec<CellState>,
    forces: Vec<Vec<f64>>,
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
            kernels: DenseKernels::default(),
            live: vec![false; cells],
            solved: vec![false; cells],
            states: vec![CellState::default(); teeth],
            forces: vec![Vec::new(); teeth],
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

    /// Reduces a flexspline cell.
    fn reduce_flexspline_cell(
        &self,
        j: usize,
        tangent: &mut CellTangent,
        tractions: Vec<Traction>,
        matrix: &mut Vec<f64>,
        front: &mut Vec<f64>,
    ) -> bool {
        let mesh = self.model.fs_mesh();
        let (cell, _) = self.model.flexspline.cell(j, self.live[j]);
        let state = &self.states[j];
        let quarter: Vec<f64> = state.q.chunks_exact(2).flat_map(|q| [-q[1], q[0]]).collect();
        let mut turned = vec![0.0; quarter.len()];
        self.kernels.multiply_add(&cell.stiffness, one(&quarter), 1.0, one_mut(&mut turned));
        let (g, c) = cell.frame.geometric(state, &self.forces[j], &turned);
        let place = CellPlacement {
            frame: (mesh.sector_angle(j) + state.turn).sin_cos(),
            faces: [0.5, -0.5].map(|half| (state.turn + half * mesh.pitch()).sin_cos()),
            blocks: self.faces(j),
        };
        let geometric = Geometric { a: &state.turn_rate, g: &g, c };
        let touched = self.touched_body(j, front).then_some(front.as_mut_slice());
        tangent.reduce(self.kernels, cell, (place, tractions), Some(geometric), touched, matrix)
    }

    /// The matrix of bore and face nodes of a cell with the contact on its bore, if there is any.
    fn touched_body(&self, j: usize, matrix: &mut Vec<f64>) -> bool {
        let mesh = self.model.fs_mesh();
        let (cell, _) = self.model.flexspline.cell(j, false);
        let [b, face, order] = [cell.bore(), cell.face(), cell.bore() + 2 * cell.face()];
        let per_cell = mesh.base_edges.len();
        let (sin, cos) = (mesh.sector_angle(j) + self.states[j].turn).sin_cos();
        let first = self.bore.partition_point(|(edge, _)| *edge < j * per_cell);
        let touching = self.bore[first..].iter().take_while(|(edge, _)| *edge < (j + 1) * per_cell);
        let mut any = false;
        for (edge, k) in touching {
            if !std::mem::replace(&mut any, true) {
                matrix.clone_from(&cell.body);
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
                                matrix[row + x + (column + y) * order] += values[y];
                            }
                        }
                    }
                }
            }
        }
        any
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
        tangent.reduce(self.kernels, cell, (place, tractions), None, None, matrix)
    }

    /// Places the flank nodes of these cells where they stand while no force acts on them.
    fn place_flanks(&self, state: &mut State, of: impl Fn(usize) -> bool) {
        let (fs, cs) = (&self.model.flexspline, &self.model.circular_spline);
        let (mut d, mut inner) = (Vec::new(), CellState::default());
        for j in (0..fs.count()).filter(|j| of(*j)) {
            self.model.flexspline_cell(j, false, &state.u, &mut d, &mut inner);
            let (cell, all) = fs.cell(j, true);
            let q = cell.free_flanks(self.kernels, &inner.q, 0.0);
            let mut flanks = CoRotation::join(&inner, cell.frame.positions(), &q);
            rotate_pairs(&mut flanks, self.model.frames[0][j]);
            all.iter().zip(&flanks).for_each(|(u, x)| state.u[*u as usize] = *x);
        }
        for t in (0..cs.count()).filter(|t| of(fs.count() + t)) {
            self.model.circular_spline_cell(t, false, &state.v, &mut d);
            let (cell, all) = cs.cell(t, true);
            let mut flanks = cell.free_flanks(self.kernels, &d, self.problem.seat_displacement);
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
            1 => self.solve_sides(one_mut(columns)),
            2..=4 => self.solve_beside::<4>(columns),
            _ => self.solve_beside::<8>(columns),
        }
    }
}

impl CondensedWheels<'_> {
    /// Solves in place for at most W right-hand sides, which lie one after the other in `columns`.
    fn solve_beside<const W: usize>(&mut self, columns: &mut [f64]) {
        let n = self.unknowns();
        let mut x = vec![[0.0; W]; n];
        for (w, column) in columns.chunks_exact(n).enumerate() {
            x.iter_mut().zip(column).for_each(|(x, value)| x[w] = *value);
        }
        self.solve_sides(&mut x);
        for (w, column) in columns.chunks_exact_mut(n).enumerate() {
            x.iter().zip(column).for_each(|(x, value)| *value = x[w]);
        }
    }

    /// Solves in place for W right-hand sides that lie beside one another.
    fn solve_sides<const W: usize>(&mut self, x: &mut [[f64; W]]) {
        self.solved.clone_from(&self.live);
        let CondensedWheels { model, kernels, factor, live, turned, kept, .. } = self;
        let factor = factor.as_ref();
        let (fs, cs) = (&model.flexspline, &model.circular_spline);
        // A cell that is near contact now has forces on its flanks, even if it had not where the factor was made.
        let (fs_live, cs_live) = live.split_at(fs.count());
        let now = |ring: &[bool], cell: usize| ring[(cell as isize + *turned).rem_euclid(ring.len() as isize) as usize];
        let cells: Vec<CellAt> = (0..fs.count())
            .map(|j| fs.cell(j, factor.live[j] || now(fs_live, j)))
            .chain((0..cs.count()).map(|t| cs.cell(t, factor.live[fs.count() + t] || now(cs_live, t))))
            .map(|(cell, unknowns)| CellAt { kernels: *kernels, cell, unknowns, order: &factor.chain })
            .collect();
        let mut chain = vec![[0.0; W]; factor.chain.unknowns()];
        let each: usize = cells.iter().map(CellAt::kept).sum();
        kept.resize(kept.len().max(W * each), 0.0);
        let mut left = &mut kept.as_chunks_mut().0[..];
        for (at, tangent) in cells.iter().zip(&factor.cells) {
            let (own, others) = left.split_at_mut(at.kept());
            tangent.forward(*at, x, &mut chain, own);
            left = others;
        }
        for face in &model.faces {
            let own = &mut x[face.unknowns.clone()];
            rotate_sides(own, back(face.turn));
            let to = &mut chain[factor.chain.offset(face.block)..];
            for (to, own) in to.iter_mut().zip(own) {
                to.iter_mut().zip(own).for_each(|(to, x)| *to += *x);
            }
        }
        factor.chain.solve(&mut chain);
        let mut left = &mut kept.as_chunks_mut().0[..];
        for (at, tangent) in cells.iter().zip(&factor.cells) {
            let (own, others) = left.split_at_mut(at.kept());
            tangent.backward(*at, x, &chain, own);
            left = others;
        }
        for face in &model.faces {
            let own = &mut x[face.unknowns.clone()];
            own.copy_from_slice(&chain[factor.chain.offset(face.block)..][..own.len()]);
            rotate_sides(own, face.turn);
        }
    }
}

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
        for j in 0..fs.count() {
            let (cell, unknowns) = fs.cell(j, self.live[j]);
            let (inner, f) = (&mut self.states[j], &mut self.forces[j]);
            self.model.flexspline_cell(j, self.live[j], &state.u, &mut d, inner);
            f.clear();
            f.resize(d.len(), 0.0);
            self.kernels.multiply_add(&cell.stiffness, one(&inner.q), 1.0, one_mut(f));
            d.copy_from_slice(f);
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
            self.kernels.multiply_add(&cell.stiffness, one(&d), 1.0, one_mut(&mut f));
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
        let (mut matrices, mut front) = (std::mem::take(&mut self.contributions), Vec::new());
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
                self.reduce_flexspline_cell(c, tangent, tractions, matrix, &mut front)
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
