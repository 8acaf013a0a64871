//! The `reference` solver's wheels: every node of both meshes in one sparse matrix.
//!
//! The flexspline is geometrically non-linear (total Lagrangian); the circular spline, which hardly deforms, is linear
//! in the frame that turns with it.

use std::collections::BTreeMap;

use crate::contact::{BorePressure, FlankPair};
use crate::fem::element::{PACKED, add_tangent_and_force, linear_stiffness};
use crate::fem::{Cholesky, Factor, PackedPositions, Pattern};
use crate::mesh::rotate;

use super::newton::ANCHOR;
use super::problem::Problem;
use super::state::State;
use super::wheels::Wheels;

/// Both wheels, with the sparse tangent for one set of flank pairs.
pub(super) struct SparseWheels<'p> {
    problem: &'p Problem,
    /// Number of each circular-spline node among the free nodes.
    cs_index: Vec<Option<u32>>,
    free_nodes: usize,
    /// Small-strain stiffness of the circular-spline elements of sector 0.
    cs_template: Vec<[f64; PACKED]>,
    system: Option<SparseSystem>,
}

/// The sparse system for one set of flank pairs.
struct SparseSystem {
    pairs: BTreeMap<FlankPair, PackedPositions>,
    pattern: Pattern,
    fs_positions: Vec<PackedPositions>,
    bore_positions: Vec<PackedPositions>,
    /// Values of the circular spline, which do not change.
    cs_values: Vec<f64>,
    factor: Cholesky,
    values: Vec<f64>,
}

impl<'p> SparseWheels<'p> {
    pub fn new(problem: &'p Problem, cs_index: &[Option<u32>]) -> Self {
        let cs_template = problem.circular_spline.gauss[..problem.circular_spline.elements_per_sector]
            .iter()
            .map(|points| linear_stiffness(points, &problem.material))
            .collect();
        let free_nodes = problem.flexspline.nodes.len() + cs_index.iter().flatten().count();
        SparseWheels { problem, cs_index: cs_index.to_vec(), free_nodes, cs_template, system: None }
    }

    fn analyse(&self, pairs: &[FlankPair]) -> SparseSystem {
        let problem = self.problem;
        let flanks = problem.flanks();
        let cs_nodes: Vec<[Option<u32>; 8]> =
            problem.circular_spline.elements.iter().map(|element| element.map(|n| self.cs_index[n as usize])).collect();
        let cs_groups: Vec<Vec<u32>> = cs_nodes.iter().map(|e| e.iter().flatten().copied().collect()).collect();
        let pair_nodes: Vec<(Vec<u32>, Vec<u32>)> = pairs
            .iter()
            .map(|&pair| {
                let fs = flanks.fs_nodes(pair).map(|n| n as u32).collect();
                let cs = flanks.cs_nodes(pair).map(|n| self.cs_index[n].expect("flank nodes are free")).collect();
                (fs, cs)
            })
            .collect();
        let groups =
            problem.flexspline.elements.iter().map(|e| e.as_slice()).chain(cs_groups.iter().map(Vec::as_slice));
        let across = pair_nodes.iter().map(|(fs, cs)| (fs.as_slice(), cs.as_slice()));
        let pattern = Pattern::new(self.free_nodes, groups, across);
        let factor = Cholesky::new(&pattern);

        let mut cs_values = vec![0.0; pattern.stored()];
        for (nodes, points) in cs_nodes.iter().zip(&problem.circular_spline.gauss) {
            pattern.positions(nodes).scatter(&linear_stiffness(points, &problem.material), &mut cs_values);
        }
        let fs_positions = problem.flexspline.elements.iter().map(|e| pattern.positions(&e.map(Some))).collect();
        let bore_positions = problem.bore.edges.iter().map(|e| pattern.positions(&e.map(Some))).collect();
        let of_pair =
            |(fs, cs): (Vec<u32>, Vec<u32>)| pattern.positions(&fs.into_iter().chain(cs).map(Some).collect::<Vec<_>>());
        let pairs = pairs.iter().copied().zip(pair_nodes.into_iter().map(of_pair)).collect();
        let values = vec![0.0; pattern.stored()];
        SparseSystem { pairs, pattern, fs_positions, bore_positions, cs_values, factor, values }
    }

    /// The tangential unknown of a bore node at angle ~0.
    fn anchored_unknown(&self) -> usize {
        2 * self.problem.bore.edges[0][1] as usize + 1
    }

    fn system(&mut self) -> &mut SparseSystem {
        self.system.as_mut().expect("room was made for the pairs")
    }
}

impl Factor for SparseWheels<'_> {
    fn solve(&mut self, columns: &mut [f64], count: usize) {
        self.system().factor.solve(columns, count);
    }
}

impl Wheels for SparseWheels<'_> {
    fn unknowns(&self) -> usize {
        2 * self.free_nodes
    }

    fn prepare(&mut self, near: &[FlankPair], widely: &dyn Fn() -> Vec<FlankPair>) -> bool {
        if self.system.as_ref().is_some_and(|system| near.iter().all(|pair| system.pairs.contains_key(pair))) {
            return false;
        }
        let mut pairs = widely();
        pairs.extend(near);
        pairs.sort_unstable();
        pairs.dedup();
        self.system = Some(self.analyse(&pairs));
        true
    }

    fn complete(&self, _state: &mut State) {}

    fn assemble(&mut self, state: &State, force: &mut [f64]) {
        let system = self.system.as_mut().expect("room was made for the pairs");
        let problem = self.problem;
        system.values.copy_from_slice(&system.cs_values);
        let fs = &problem.flexspline;
        for ((element, points), positions) in fs.elements.iter().zip(&fs.gauss).zip(&system.fs_positions) {
            let mut local = [0.0; 16];
            for (a, &n) in element.iter().enumerate() {
                local[2 * a] = state.u[2 * n as usize];
                local[2 * a + 1] = state.u[2 * n as usize + 1];
            }
            let (mut stiffness, mut nodal) = ([0.0; PACKED], [0.0; 16]);
            add_tangent_and_force(points, &problem.material, &local, &mut stiffness, &mut nodal);
            positions.scatter(&stiffness, &mut system.values);
            for (a, &n) in element.iter().enumerate() {
                force[2 * n as usize] -= nodal[2 * a];
                force[2 * n as usize + 1] -= nodal[2 * a + 1];
            }
        }
        let cs = &problem.circular_spline;
        for (e, element) in cs.elements.iter().enumerate() {
            let turn @ (sin, cos) = cs.sector_angle(e / cs.elements_per_sector).sin_cos();
            let stiffness = &self.cs_template[e % cs.elements_per_sector];
            let mut local = [0.0; 16];
            for (a, &n) in element.iter().enumerate() {
                let d = [state.v[2 * n as usize], state.v[2 * n as usize + 1]];
                [local[2 * a], local[2 * a + 1]] = rotate(d, (-sin, cos));
            }
            let nodal = packed_times(stiffness, &local);
            for (a, &n) in element.iter().enumerate() {
                if let Some(free) = self.cs_index[n as usize] {
                    let k = 2 * free as usize;
                    let [x, y] = rotate([nodal[2 * a], nodal[2 * a + 1]], turn);
                    force[k] -= x;
                    force[k + 1] -= y;
                }
            }
        }
    }

    fn add_bore(&mut self, contact: &BorePressure) {
        let system = self.system();
        system.bore_positions[contact.edge].scatter(&contact.stiffness, &mut system.values);
    }

    fn add_flank(&mut self, pair: FlankPair, stiffness: Vec<f64>) {
        let system = self.system();
        let n = stiffness.len().isqrt();
        let packed = (0..n).flat_map(|i| &stiffness[i * n..=i * n + i]);
        system.pairs[&pair].scatter(packed, &mut system.values);
    }

    fn anchor(&self) -> Vec<(usize, f64)> {
        vec![(self.anchored_unknown(), 1.0)]
    }

    fn factorise(&mut self, spring: f64) -> bool {
        let anchored = self.anchored_unknown();
        let SparseSystem { pattern, values, factor, .. } = self.system();
        let mut stiffened = values.clone();
        stiffened[pattern.column_starts[anchored] as usize] += ANCHOR;
        if spring > 0.0 {
            for &start in &pattern.column_starts[..pattern.unknowns()] {
                stiffened[start as usize] += spring;
            }
        }
        factor.factorise(pattern, &stiffened).is_ok()
    }
}

/// Product of a packed symmetric 16 x 16 matrix with a vector.
fn packed_times(packed: &[f64; PACKED], x: &[f64; 16]) -> [f64; 16] {
    let mut y = [0.0; 16];
    let mut k = 0;
    for i in 0..16 {
        for j in 0..i {
            y[i] += packed[k] * x[j];
            y[j] += packed[k] * x[i];
            k += 1;
        }
        y[i] += packed[k] * x[i];
        k += 1;
    }
    y
}
