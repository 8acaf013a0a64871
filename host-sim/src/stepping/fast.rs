//! The `fast` solver's wheels: condensed cells in turning frames, and a block factorisation around the rings.
//!
//! Every factorisation does, for the flexspline, cell by cell:
//!
//! 1. the tangent in the turned frame: stiffness, contact on the bore, and the rank-two part of the turning frame;
//! 2. flank nodes eliminated: they follow linearly from the rest of the cell, and the contact of a pair of flanks, of low
//!    rank, enters through its tractions;
//! 3. bore nodes eliminated;
//!
//! for the circular spline the same without bore and turning; then the faces and tractions around both rings
//! ([`crate::condense::Chain`]).
//!
//! Contact of a pair has the stiffness `D = G G^T`, G of as many columns as nodes and directions take part. With the tractions
//! `lambda = G^T z` as unknowns, `[K G; G^T -I]` holds instead of `K + G G^T`, and G reaches no further than the flanks.

use std::f64::consts::{FRAC_PI_2, TAU};

use crate::condense::{Block, Cell, CellState, Chain, CondensedWheel, Contribution, Kernels};
use crate::contact::{BorePressure, FlankPair, PairContribution};
use crate::drive::Side;
use crate::fem::Factor;
use crate::mesh::WheelMesh;

use super::newton::ANCHOR;
use super::problem::Problem;
use super::state::State;
use super::wheels::Wheels;

/// Tangent of a pair of flanks of less than this, relative to the largest, is left out of the factor.
const RANK_TOLERANCE: f64 = 1e-10;

/// Both wheels of a drive, condensed: what all solvers of a problem share.
#[derive(Debug, Clone)]
pub struct CondensedDrive {
    /// The flexspline.
    pub flexspline: CondensedWheel,
    /// The circular spline.
    pub circular_spline: CondensedWheel,
}

/// The tangent of one flexspline cell, its flank and bore nodes eliminated.
#[derive(Debug, Clone, Default)]
struct CellFactor {
    /// (sine, cosine) of the frame of the cell.
    frame: (f64, f64),
    /// Of the frame against those of its two faces.
    faces: [(f64, f64); 2],
    /// `a` and the part of `g` on the flanks.
    turn_rate: Vec<f64>,
    flank_geometric: Vec<f64>,
    /// Pairs on the flanks of this cell, and the order of the front.
    pairs: Vec<u32>,
    order: usize,
    /// Panel of the bore nodes; rows: bore, faces, tractions, geometric.
    panel: Vec<f64>,
}

/// Tangent of a pair of flanks.
#[derive(Debug, Clone)]
struct Pair {
    pair: FlankPair,
    rank: usize,
    /// Columns of G on the flexspline, in the frame of its cell, and on the circular spline.
    on_flexspline: Vec<f64>,
    on_circular_spline: Vec<f64>,
}

pub(super) struct CondensedWheels<'p> {
    problem: &'p Problem,
    model: &'p CondensedDrive,
    kernels: Kernels,
    states: Vec<CellState>,
    /// Forces of the flexspline cells in their turned frames, before balancing.
    forces: Vec<Vec<f64>>,
    /// Where the wave and the output stand.
    generator_rad: f64,
    output_rad: f64,
    /// Bore contact of this state.
    bore: Vec<(usize, [f64; 21])>,
    /// Flank contact of this state: nodal tangent.
    contact: Vec<(FlankPair, Vec<f64>)>,
    factors: Vec<CellFactor>,
    pairs: Vec<Pair>,
    /// Pairs that touch each circular-spline cell.
    cs_pairs: Vec<Vec<u32>>,
    chain: Chain,
}

/// Unknowns of the skins begin with those of the flexspline.
struct Layout {
    fs_unknowns: usize,
}

fn rotate_pairs(x: &mut [f64], (sin, cos): (f64, f64)) {
    for p in x.chunks_exact_mut(2) {
        (p[0], p[1]) = (cos * p[0] - sin * p[1], sin * p[0] + cos * p[1]);
    }
}

fn back((sin, cos): (f64, f64)) -> (f64, f64) {
    (-sin, cos)
}

impl<'p> CondensedWheels<'p> {
    pub fn new(problem: &'p Problem, model: &'p CondensedDrive) -> Self {
        let teeth = model.flexspline.class.len();
        CondensedWheels {
            problem,
            model,
            kernels: Kernels::default(),
            states: vec![CellState::default(); teeth],
            forces: vec![Vec::new(); teeth],
            generator_rad: 0.0,
            output_rad: 0.0,
            bore: Vec::new(),
            contact: Vec::new(),
            factors: vec![CellFactor::default(); teeth],
            pairs: Vec::new(),
            cs_pairs: vec![Vec::new(); model.circular_spline.class.len()],
            chain: Chain::default(),
        }
    }

    fn fs_mesh(&self) -> &'p WheelMesh {
        &self.model.flexspline.skin.mesh
    }

    fn cs_mesh(&self) -> &'p WheelMesh {
        &self.model.circular_spline.skin.mesh
    }

    fn layout(&self) -> Layout {
        Layout { fs_unknowns: 2 * self.fs_mesh().nodes.len() }
    }

    /// Frame of a circular-spline cell, rad.
    fn cs_frame(&self, cell: usize) -> f64 {
        (cell as f64 + 0.5) * self.cs_mesh().pitch()
    }

    /// The circular-spline cell that carries the flank of a pair.
    fn cs_cell(&self, pair: FlankPair) -> usize {
        let teeth = self.cs_mesh().teeth;
        match pair.side {
            Side::Plus => pair.space,
            Side::Minus => (pair.space + teeth - 1) % teeth,
        }
    }

    /// Splits the contact of every pair into the columns of G.
    fn split_contact(&mut self) {
        self.pairs.clear();
        self.cs_pairs.iter_mut().for_each(Vec::clear);
        self.factors.iter_mut().for_each(|f| f.pairs.clear());
        for (pair, stiffness) in &self.contact {
            let fs_nodes = self.fs_mesh().flanks[pair.side.index()].nodes.len();
            let columns = low_rank(stiffness);
            let n = (stiffness.len() as f64).sqrt().round() as usize;
            let rank = columns.len() / n.max(1);
            if rank == 0 {
                continue;
            }
            let cs_cell = self.cs_cell(*pair);
            let fs_turn = -(self.fs_mesh().sector_angle(pair.tooth) + self.states[pair.tooth].turn);
            let cs_turn = -self.cs_frame(cs_cell);
            let (mut on_flexspline, mut on_circular_spline) = (Vec::new(), Vec::new());
            for column in columns.chunks(n) {
                let (fs, cs) = column.split_at(2 * fs_nodes);
                on_flexspline.extend_from_slice(fs);
                on_circular_spline.extend_from_slice(cs);
            }
            rotate_pairs(&mut on_flexspline, fs_turn.sin_cos());
            rotate_pairs(&mut on_circular_spline, cs_turn.sin_cos());
            let index = self.pairs.len() as u32;
            self.factors[pair.tooth].pairs.push(index);
            self.cs_pairs[cs_cell].push(index);
            self.pairs.push(Pair { pair: *pair, rank, on_flexspline, on_circular_spline });
        }
    }

    /// Eliminates flank and bore nodes of a flexspline cell; what is left on faces and tractions.
    fn eliminate_flexspline_cell(&mut self, j: usize) -> Option<Contribution> {
        let cell = self.model.flexspline.cell(j);
        let (f, b, i) = (cell.flank(), cell.bore(), 2 * cell.face());
        let r = b + i;
        let state = &self.states[j];
        let turned: Vec<f64> = {
            let quarter: Vec<f64> = state.q.chunks(2).flat_map(|q| [-q[1], q[0]]).collect();
            let mut turned = vec![0.0; quarter.len()];
            self.kernels.multiply_add(&cell.stiffness, &quarter, 1.0, &mut turned);
            turned
        };
        let (g, c) = cell.frame.geometric(state, &self.forces[j], &turned);
        let (g_flank, g_body) = g.split_at(f);

        let mut factor = std::mem::take(&mut self.factors[j]);
        let columns: Vec<(usize, &[f64])> = factor
            .pairs
            .iter()
            .flat_map(|&p| {
                let pair = &self.pairs[p as usize];
                let n = pair.on_flexspline.len() / pair.rank;
                pair.on_flexspline.chunks(n).map(move |column| (pair.pair.side.index() * n, column))
            })
            .collect();
        let tractions = columns.len();
        let m = r + tractions + 1;
        let mut front = vec![0.0; m * m];
        for k in 0..r {
            front[k * m + k..k * m + r].copy_from_slice(&cell.body[k * r + k..(k + 1) * r]);
        }
        self.add_bore_contact(j, b, m, &mut front);
        let coupling = &cell.flank_coupling;
        let flexibility = &cell.flank_flexibility;
        let mut follow = vec![0.0; r];
        let mut yielded = vec![0.0; f];
        for (k, &(start, column)) in columns.iter().enumerate() {
            let row = r + k;
            for (x, t) in follow.iter_mut().zip(coupling.chunks_exact(f)) {
                *x = dot(column, &t[start..start + column.len()]);
            }
            for (col, x) in follow.iter().enumerate() {
                front[row + col * m] = -x;
            }
            for (y, c) in yielded.iter_mut().zip(flexibility.chunks_exact(f)) {
                *y = dot(column, &c[start..start + column.len()]);
            }
            for (l, &(other, against)) in columns.iter().enumerate().skip(k) {
                front[r + l + row * m] = -dot(against, &yielded[other..other + against.len()]);
            }
            front[m - 1 + row * m] = -dot(g_flank, &yielded);
        }
        // The geometric column.
        for (col, t) in coupling.chunks_exact(f).enumerate() {
            front[m - 1 + col * m] = g_body[col] - dot(g_flank, t);
        }
        yielded.fill(0.0);
        self.kernels.multiply_add(flexibility, g_flank, 1.0, &mut yielded);
        front[m * m - 1] = c - dot(g_flank, &yielded);
        if !self.kernels.eliminate(&mut front, m, b, 1.0) {
            return None;
        }
        // Fold the geometric row: rank two on the faces, one with the tractions.
        let a = state.turn_rate.as_slice();
        let n = i + tractions;
        let mut matrix = vec![0.0; n * n];
        for col in 0..n {
            let from = (b + col) * m + b;
            matrix[col * n + col..(col + 1) * n].copy_from_slice(&front[from + col..from + n]);
        }
        let corner = front[m * m - 1];
        let geometric: Vec<f64> = (0..n).map(|k| front[m - 1 + (b + k) * m]).collect();
        for col in 0..i {
            for row in col..i {
                matrix[row + col * n] +=
                    geometric[row] * a[col] + a[row] * geometric[col] + corner * a[row] * a[col];
            }
            for row in i..n {
                matrix[row + col * n] += geometric[row] * a[col];
            }
        }
        let pitch = self.fs_mesh().pitch();
        let half = i / 2;
        // From the frame of the cell to those of its faces.
        factor.faces = [state.turn + 0.5 * pitch, state.turn - 0.5 * pitch].map(f64::sin_cos);
        rotate_faces(&mut matrix, n, half, &factor.faces);
        factor.frame = (self.fs_mesh().sector_angle(j) + state.turn).sin_cos();
        factor.turn_rate.clone_from(&state.turn_rate);
        factor.flank_geometric = g_flank.to_vec();
        factor.order = m;
        factor.panel.clear();
        factor.panel.extend_from_slice(&front[..m * b]);
        let teeth = self.fs_mesh().teeth;
        let mut blocks = vec![j as u32, ((j + 1) % teeth) as u32];
        blocks.extend(factor.pairs.iter().map(|p| self.first_traction() + p));
        self.factors[j] = factor;
        Some(Contribution { blocks, matrix })
    }

    fn first_traction(&self) -> u32 {
        (self.fs_mesh().teeth + self.cs_mesh().teeth) as u32
    }

    /// Contact on the bore of a cell, in the front of its body.
    fn add_bore_contact(&self, j: usize, b: usize, m: usize, front: &mut [f64]) {
        let per_cell = self.fs_mesh().base_edges.len();
        let face = self.model.flexspline.cell(j).face();
        let (sin, cos) = (self.fs_mesh().sector_angle(j) + self.states[j].turn).sin_cos();
        let first = self.bore.partition_point(|(edge, _)| *edge < j * per_cell);
        for (edge, k) in self.bore[first..].iter().take_while(|(edge, _)| *edge < (j + 1) * per_cell) {
            // Nodes along the bore of the cell: corner of the first face, bore nodes, corner of the second face.
            let place = |n: usize| match n {
                0 => b,
                n if n == 2 * per_cell => b + face,
                n => 2 * (n - 1),
            };
            let along = 2 * (edge - j * per_cell);
            let entry = |r: usize, c: usize| if r >= c { k[r * (r + 1) / 2 + c] } else { k[c * (c + 1) / 2 + r] };
            for a in 0..3 {
                for c in 0..3 {
                    let (row, column) = (place(along + a), place(along + c));
                    if row < column {
                        continue;
                    }
                    // R^T K R with R the frame.
                    let block = [0, 1].map(|x| [0, 1].map(|y| entry(2 * a + x, 2 * c + y)));
                    let rows = [0, 1].map(|y| {
                        [cos * block[0][y] + sin * block[1][y], cos * block[1][y] - sin * block[0][y]]
                    });
                    for x in 0..2 {
                        let values = [cos * rows[0][x] + sin * rows[1][x], cos * rows[1][x] - sin * rows[0][x]];
                        for y in 0..2 {
                            if row + x >= column + y {
                                front[row + x + (column + y) * m] += values[y];
                            }
                        }
                    }
                }
            }
        }
    }

    /// Eliminates the flank nodes of a circular-spline cell.
    fn eliminate_circular_spline_cell(&self, t: usize) -> Contribution {
        let cell = self.model.circular_spline.cell(t);
        let (f, i) = (cell.flank(), 2 * cell.face());
        let columns: Vec<(usize, &[f64])> = self.cs_pairs[t]
            .iter()
            .flat_map(|&p| {
                let pair = &self.pairs[p as usize];
                let n = pair.on_circular_spline.len() / pair.rank;
                pair.on_circular_spline.chunks(n).map(move |column| (pair.pair.side.index() * n, column))
            })
            .collect();
        let n = i + columns.len();
        let mut matrix = vec![0.0; n * n];
        for k in 0..i {
            matrix[k * n + k..k * n + i].copy_from_slice(&cell.body[k * i + k..(k + 1) * i]);
        }
        let mut yielded = vec![0.0; f];
        for (k, &(start, column)) in columns.iter().enumerate() {
            for (col, t) in cell.flank_coupling.chunks_exact(f).enumerate() {
                matrix[i + k + col * n] = -dot(column, &t[start..start + column.len()]);
            }
            for (y, c) in yielded.iter_mut().zip(cell.flank_flexibility.chunks_exact(f)) {
                *y = dot(column, &c[start..start + column.len()]);
            }
            for (l, &(other, against)) in columns.iter().enumerate().skip(k) {
                matrix[i + l + (i + k) * n] = -dot(against, &yielded[other..other + against.len()]);
            }
        }
        rotate_faces(&mut matrix, n, i / 2, &self.cs_faces());
        let (first, teeth) = (self.fs_mesh().teeth, self.cs_mesh().teeth);
        let mut blocks = vec![(first + t) as u32, (first + (t + 1) % teeth) as u32];
        blocks.extend(self.cs_pairs[t].iter().map(|p| self.first_traction() + p));
        Contribution { blocks, matrix }
    }

    /// Frame of a circular-spline cell against those of its faces.
    fn cs_faces(&self) -> [(f64, f64); 2] {
        let half = 0.5 * self.cs_mesh().pitch();
        [half, -half].map(f64::sin_cos)
    }

    /// Blocks around the rings, ordered by their angle from the minor axis of the generator, where no flanks touch.
    fn blocks(&self) -> Vec<Block> {
        let cut = self.generator_rad + FRAC_PI_2;
        let from_cut = |angle: f64| (angle - cut).rem_euclid(TAU);
        let (fs, cs) = (self.fs_mesh(), self.cs_mesh());
        let fs_size = self.model.flexspline.cell(0).face();
        let cs_size = self.model.circular_spline.cell(0).face();
        let mut blocks: Vec<Block> = (0..fs.teeth)
            .map(|j| Block { size: fs_size, sign: 1.0, key: from_cut((j as f64 - 0.5) * fs.pitch()) })
            .collect();
        blocks.extend((0..cs.teeth).map(|t| Block {
            size: cs_size,
            sign: 1.0,
            key: from_cut(t as f64 * cs.pitch() + self.output_rad),
        }));
        // The first face of each ring closes it.
        for ring in [0..fs.teeth, fs.teeth..fs.teeth + cs.teeth] {
            if let Some(first) = ring.min_by(|a, b| blocks[*a].key.total_cmp(&blocks[*b].key)) {
                blocks[first].key += TAU;
            }
        }
        blocks.extend(self.pairs.iter().map(|pair| {
            let angle = (pair.pair.tooth as f64 + 0.25 * pair.pair.side.sign()) * fs.pitch();
            Block { size: pair.rank, sign: -1.0, key: from_cut(angle) }
        }));
        blocks
    }

    fn anchored_face(&self) -> [(usize, f64); 2] {
        // Bore corner of the first face of cell 0; its tangential direction.
        let (sin, cos) = (-0.5 * self.fs_mesh().pitch()).sin_cos();
        [(0, -sin), (1, cos)]
    }

    /// Solves for one right-hand side.
    fn solve_one(&mut self, x: &mut [f64], scratch: &mut Scratch) {
        let layout = self.layout();
        let Scratch { fs, cs, chain } = scratch;
        chain.clear();
        chain.resize(self.chain.unknowns(), 0.0);
        // Flexspline cells: forward.
        let teeth = self.fs_mesh().teeth;
        for j in 0..teeth {
            let cell = self.model.flexspline.cell(j);
            let (f, b, face) = (cell.flank(), cell.bore(), cell.face());
            let factor = &self.factors[j];
            let to_frame = back(factor.frame);
            let local = &mut fs[j];
            local.gather(&self.model.flexspline.unknowns[j][..f + b], x, 0);
            rotate_pairs(&mut local.force, to_frame);
            let (flank, bore) = local.force.split_at_mut(f);
            local.rest.clear();
            local.rest.resize(factor.order - b, 0.0);
            local.body.clear();
            local.body.resize(b + 2 * face, 0.0);
            local.yielded.clear();
            local.yielded.resize(f, 0.0);
            self.kernels.multiply_transposed_add(&cell.flank_coupling, flank, -1.0, &mut local.body);
            self.kernels.multiply_add(&cell.flank_flexibility, flank, 1.0, &mut local.yielded);
            for (x, y) in bore.iter_mut().zip(&local.body) {
                *x += y;
            }
            local.rest[..2 * face].copy_from_slice(&local.body[b..]);
            let mut k = 2 * face;
            for &p in &factor.pairs {
                let pair = &self.pairs[p as usize];
                let n = pair.on_flexspline.len() / pair.rank;
                let start = pair.pair.side.index() * n;
                for column in pair.on_flexspline.chunks(n) {
                    local.rest[k] = -dot(column, &local.yielded[start..start + n]);
                    k += 1;
                }
            }
            local.rest[k] = -dot(&factor.flank_geometric, &local.yielded);
            self.kernels.forward(&factor.panel, factor.order, b, 1.0, bore, &mut local.rest);
            let folded = local.rest[k];
            for (r, a) in local.rest.iter_mut().zip(&factor.turn_rate) {
                *r += folded * a;
            }
            for side in 0..2 {
                let part = &mut local.rest[side * face..(side + 1) * face];
                rotate_pairs(part, factor.faces[side]);
                let to = self.chain.offset((j + side) % teeth);
                chain[to..to + face].iter_mut().zip(part.iter()).for_each(|(c, x)| *c += x);
            }
            let mut k = 2 * face;
            for &p in &factor.pairs {
                let to = self.chain.offset((self.first_traction() + p) as usize);
                let rank = self.pairs[p as usize].rank;
                chain[to..to + rank].iter_mut().zip(&local.rest[k..]).for_each(|(c, x)| *c += x);
                k += rank;
            }
        }
        let cs_teeth = self.cs_mesh().teeth;
        let cs_faces = self.cs_faces();
        for t in 0..cs_teeth {
            let cell = self.model.circular_spline.cell(t);
            let (f, face) = (cell.flank(), cell.face());
            let local = &mut cs[t];
            local.gather(&self.model.circular_spline.unknowns[t][..f], x, layout.fs_unknowns);
            rotate_pairs(&mut local.force, back(self.cs_frame(t).sin_cos()));
            local.body.clear();
            local.body.resize(2 * face, 0.0);
            local.yielded.clear();
            local.yielded.resize(f, 0.0);
            self.kernels.multiply_transposed_add(&cell.flank_coupling, &local.force, -1.0, &mut local.body);
            self.kernels.multiply_add(&cell.flank_flexibility, &local.force, 1.0, &mut local.yielded);
            for side in 0..2 {
                let part = &mut local.body[side * face..(side + 1) * face];
                rotate_pairs(part, cs_faces[side]);
                let to = self.chain.offset(teeth + (t + side) % cs_teeth);
                chain[to..to + face].iter_mut().zip(part.iter()).for_each(|(c, x)| *c += x);
            }
            for &p in &self.cs_pairs[t] {
                let pair = &self.pairs[p as usize];
                let n = pair.on_circular_spline.len() / pair.rank;
                let start = pair.pair.side.index() * n;
                let to = self.chain.offset((self.first_traction() + p) as usize);
                for (k, column) in pair.on_circular_spline.chunks(n).enumerate() {
                    chain[to + k] -= dot(column, &local.yielded[start..start + n]);
                }
            }
        }
        // Forces on the faces themselves.
        let faces = self.faces();
        for (block, start, angle) in faces.iter().copied() {
            let to = self.chain.offset(block);
            let size = self.chain_block_size(block);
            let mut own = x[start..start + size].to_vec();
            rotate_pairs(&mut own, (-angle).sin_cos());
            chain[to..to + size].iter_mut().zip(&own).for_each(|(c, x)| *c += x);
        }
        self.chain.solve(chain);
        for (block, start, angle) in faces.iter().copied() {
            let from = self.chain.offset(block);
            let size = self.chain_block_size(block);
            x[start..start + size].copy_from_slice(&chain[from..from + size]);
            rotate_pairs(&mut x[start..start + size], angle.sin_cos());
        }
        // Back into the cells.
        for j in 0..teeth {
            let cell = self.model.flexspline.cell(j);
            let (f, b, face) = (cell.flank(), cell.bore(), cell.face());
            let factor = &self.factors[j];
            let local = &mut fs[j];
            for side in 0..2 {
                let from = self.chain.offset((j + side) % teeth);
                let part = &mut local.rest[side * face..(side + 1) * face];
                part.copy_from_slice(&chain[from..from + face]);
                rotate_pairs(part, back(factor.faces[side]));
            }
            let turn = dot(&factor.turn_rate, &local.rest[..2 * face]);
            let (flank, bore) = local.force.split_at_mut(f);
            // Displacements of the flanks: yielded - C (G lambda + g turn) - T rest.
            let mut load: Vec<f64> = factor.flank_geometric.iter().map(|g| turn * g).collect();
            let mut k = 2 * face;
            for &p in &factor.pairs {
                let pair = &self.pairs[p as usize];
                let n = pair.on_flexspline.len() / pair.rank;
                let start = pair.pair.side.index() * n;
                let from = self.chain.offset((self.first_traction() + p) as usize);
                for (column, traction) in pair.on_flexspline.chunks(n).zip(&chain[from..]) {
                    local.rest[k] = *traction;
                    load[start..start + n].iter_mut().zip(column).for_each(|(l, g)| *l += traction * g);
                    k += 1;
                }
            }
            local.rest[k] = turn;
            self.kernels.backward(&factor.panel, factor.order, b, 1.0, bore, &local.rest);
            local.body[..b].copy_from_slice(bore);
            local.body[b..].copy_from_slice(&local.rest[..2 * face]);
            flank.copy_from_slice(&local.yielded);
            self.kernels.multiply_add(&cell.flank_flexibility, &load, -1.0, flank);
            self.kernels.multiply_add(&cell.flank_coupling, &local.body, -1.0, flank);
            rotate_pairs(&mut local.force, factor.frame);
            local.scatter(&self.model.flexspline.unknowns[j][..f + b], x, 0);
        }
        for t in 0..cs_teeth {
            let cell = self.model.circular_spline.cell(t);
            let (f, face) = (cell.flank(), cell.face());
            let local = &mut cs[t];
            for side in 0..2 {
                let from = self.chain.offset(teeth + (t + side) % cs_teeth);
                let part = &mut local.body[side * face..(side + 1) * face];
                part.copy_from_slice(&chain[from..from + face]);
                rotate_pairs(part, back(cs_faces[side]));
            }
            let mut load = vec![0.0; f];
            for &p in &self.cs_pairs[t] {
                let pair = &self.pairs[p as usize];
                let n = pair.on_circular_spline.len() / pair.rank;
                let start = pair.pair.side.index() * n;
                let from = self.chain.offset((self.first_traction() + p) as usize);
                for (column, traction) in pair.on_circular_spline.chunks(n).zip(&chain[from..]) {
                    load[start..start + n].iter_mut().zip(column).for_each(|(l, g)| *l += traction * g);
                }
            }
            local.force.copy_from_slice(&local.yielded);
            self.kernels.multiply_add(&cell.flank_flexibility, &load, -1.0, &mut local.force);
            self.kernels.multiply_add(&cell.flank_coupling, &local.body, -1.0, &mut local.force);
            rotate_pairs(&mut local.force, self.cs_frame(t).sin_cos());
            local.scatter(&self.model.circular_spline.unknowns[t][..f], x, layout.fs_unknowns);
        }
    }

    /// Of every face: its block, the first of its unknowns, the angle of its frame.
    fn faces(&self) -> Vec<(usize, usize, f64)> {
        let (fs, cs) = (self.fs_mesh(), self.cs_mesh());
        let first = self.layout().fs_unknowns;
        let fs_faces =
            (0..fs.teeth).map(|j| (j, 2 * j * fs.nodes_per_sector, (j as f64 - 0.5) * fs.pitch()));
        let cs_faces = (0..cs.teeth)
            .map(|t| (fs.teeth + t, first + 2 * t * cs.nodes_per_sector, t as f64 * cs.pitch()));
        fs_faces.chain(cs_faces).collect()
    }

    fn chain_block_size(&self, block: usize) -> usize {
        if block < self.fs_mesh().teeth {
            self.model.flexspline.cell(0).face()
        } else {
            self.model.circular_spline.cell(0).face()
        }
    }
}

/// Work space of a solve.
#[derive(Default)]
struct Scratch {
    fs: Vec<Local>,
    cs: Vec<Local>,
    chain: Vec<f64>,
}

/// Right-hand side and solution of one cell.
#[derive(Default, Clone)]
struct Local {
    force: Vec<f64>,
    body: Vec<f64>,
    rest: Vec<f64>,
    yielded: Vec<f64>,
}

impl Local {
    fn gather(&mut self, unknowns: &[u32], x: &[f64], first: usize) {
        self.force.clear();
        self.force.extend(unknowns.iter().map(|u| x[first + *u as usize]));
    }

    fn scatter(&self, unknowns: &[u32], x: &mut [f64], first: usize) {
        for (u, value) in unknowns.iter().zip(&self.force) {
            x[first + *u as usize] = *value;
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Turns the first two groups of `half` unknowns of a matrix (lower triangle, order n) by an angle each.
fn rotate_faces(matrix: &mut [f64], n: usize, half: usize, turns: &[(f64, f64); 2]) {
    // Complete the triangle where the rotation needs it: within the faces.
    for col in 0..2 * half {
        for row in 0..col {
            matrix[row + col * n] = matrix[col + row * n];
        }
    }
    for (side, &(sin, cos)) in turns.iter().enumerate() {
        for k in (side * half..(side + 1) * half).step_by(2) {
            let (left, right) = matrix.split_at_mut((k + 1) * n);
            let (a, b) = (&mut left[k * n..], &mut right[..n]);
            for (x, y) in a.iter_mut().zip(b) {
                (*x, *y) = (cos * *x - sin * *y, sin * *x + cos * *y);
            }
        }
    }
    for column in matrix.chunks_exact_mut(n).take(2 * half) {
        for (side, turn) in turns.iter().enumerate() {
            rotate_pairs(&mut column[side * half..(side + 1) * half], *turn);
        }
    }
}

/// Columns of G with `D = G G^T` for a positive semi-definite D (n x n by rows, lower triangle): Cholesky with diagonal
/// pivoting until nothing is left.
fn low_rank(stiffness: &[f64]) -> Vec<f64> {
    let n = (stiffness.len() as f64).sqrt().round() as usize;
    let entry = |i: usize, j: usize| if i >= j { stiffness[i * n + j] } else { stiffness[j * n + i] };
    let mut diagonal: Vec<f64> = (0..n).map(|i| entry(i, i)).collect();
    let largest = diagonal.iter().fold(0.0_f64, |m, x| m.max(*x));
    let mut columns: Vec<f64> = Vec::new();
    while columns.len() < n * n {
        let (pivot, &value) =
            diagonal.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).expect("a pair has nodes");
        if value.is_nan() || value <= RANK_TOLERANCE * largest {
            break;
        }
        let mut column: Vec<f64> = (0..n).map(|i| entry(i, pivot)).collect();
        for earlier in columns.chunks(n) {
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
    columns
}

impl Factor for CondensedWheels<'_> {
    fn solve(&mut self, columns: &mut [f64], count: usize) {
        let n = columns.len() / count;
        let mut scratch = Scratch {
            fs: vec![Local::default(); self.fs_mesh().teeth],
            cs: vec![Local::default(); self.cs_mesh().teeth],
            chain: Vec::new(),
        };
        for column in columns.chunks_exact_mut(n) {
            self.solve_one(column, &mut scratch);
        }
    }
}

impl Wheels for CondensedWheels<'_> {
    fn unknowns(&self) -> usize {
        2 * (self.fs_mesh().nodes.len() + self.cs_mesh().nodes.len())
    }

    fn has_room(&self, _pair: FlankPair) -> bool {
        true
    }

    fn make_room(&mut self, _pairs: &[FlankPair]) {}

    fn assemble(&mut self, state: &State, force: &mut [f64]) {
        self.bore.clear();
        self.contact.clear();
        self.generator_rad = state.generator_rad;
        self.output_rad = state.output_rad;
        let fs = &self.model.flexspline;
        let mut d = Vec::new();
        for j in 0..fs.class.len() {
            let cell: &Cell = fs.cell(j);
            let unknowns = &fs.unknowns[j];
            d.clear();
            d.extend(unknowns.iter().map(|u| state.u[*u as usize]));
            let angle = self.fs_mesh().sector_angle(j);
            rotate_pairs(&mut d, (-angle).sin_cos());
            cell.frame.split(&d, &mut self.states[j]);
            let f = &mut self.forces[j];
            f.clear();
            f.resize(d.len(), 0.0);
            self.kernels.multiply_add(&cell.stiffness, &self.states[j].q, 1.0, f);
            d.clone_from(f);
            cell.frame.balance(&self.states[j], &mut d);
            rotate_pairs(&mut d, (angle + self.states[j].turn).sin_cos());
            for (u, f) in unknowns.iter().zip(&d) {
                force[*u as usize] -= f;
            }
        }
        let cs = &self.model.circular_spline;
        let first = self.layout().fs_unknowns;
        let mut f = Vec::new();
        for t in 0..cs.class.len() {
            let cell = cs.cell(t);
            let unknowns = &cs.unknowns[t];
            d.clear();
            d.extend(unknowns.iter().map(|u| state.v[*u as usize]));
            let frame = self.cs_frame(t).sin_cos();
            rotate_pairs(&mut d, back(frame));
            f.clear();
            f.extend(cell.element.seat.col(0).iter().map(|s| s * self.problem.seat_displacement));
            self.kernels.multiply_add(&cell.stiffness, &d, 1.0, &mut f);
            rotate_pairs(&mut f, frame);
            for (u, f) in unknowns.iter().zip(&f) {
                force[first + *u as usize] -= f;
            }
        }
    }

    fn add_bore(&mut self, contact: &BorePressure) {
        self.bore.push((contact.edge, contact.stiffness));
    }

    fn add_flank(&mut self, pair: FlankPair, contact: &PairContribution) {
        self.contact.push((pair, contact.stiffness.clone()));
    }

    fn anchor(&self) -> Vec<(usize, f64)> {
        self.anchored_face().to_vec()
    }

    fn factorise(&mut self, spring: f64) -> bool {
        self.split_contact();
        let mut contributions = Vec::with_capacity(2 * self.factors.len() + self.cs_pairs.len());
        for j in 0..self.factors.len() {
            match self.eliminate_flexspline_cell(j) {
                Some(contribution) => contributions.push(contribution),
                None => return false,
            }
        }
        for t in 0..self.cs_pairs.len() {
            contributions.push(self.eliminate_circular_spline_cell(t));
        }
        let blocks = self.blocks();
        // Anchor (in the frame of the face: tangential is y), springs, and the unit of the tractions.
        for (k, block) in blocks.iter().enumerate() {
            let n = block.size;
            let mut matrix = vec![0.0; n * n];
            let diagonal = if block.sign < 0.0 { -1.0 } else { spring };
            (0..n).for_each(|i| matrix[i * n + i] = diagonal);
            if k == 0 {
                matrix[n + 1] += ANCHOR;
            }
            if diagonal != 0.0 || k == 0 {
                contributions.push(Contribution { blocks: vec![k as u32], matrix });
            }
        }
        self.chain.factorise(&blocks, &contributions)
    }
}
