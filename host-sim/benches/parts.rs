//! Cost of the parts that both solvers are made of: cam, 50 N.m, standard mesh, one pass each, CPU time.
//!
//! ```text
//! cargo bench --bench parts
//! ```
//!
//! * `reference/assembly`: element tangents and forces of the flexspline, added into the sparse matrix;
//! * `reference/factorisation`: sparse Cholesky factor of both wheels, with the pattern of the flank pairs that are
//!   near;
//! * `reference/solve`: one right-hand side;
//! * `contact/bore`, `contact/flanks`: one pass at the deformed, loaded state; flanks: search, layout and forces;
//! * `fast/set-up`: `Problem::new`, both wheels meshed and condensed (all threads);
//! * `fast/condensation`: the condensation alone (all threads);
//! * `fast/reduction`, `fast/chain`, `fast/solve`: one factorisation without contact in two parts (cells reduced to
//!   their faces, faces eliminated around both rings), and one right-hand side brought there and back;
//! * `fast/whole field`: the nodes that were condensed away; `fast/peak stress`: these and the stresses of every node.

mod common;

use std::hint::black_box;
use std::time::Duration;

use criterion::measurement::Measurement;
use criterion::{BenchmarkGroup, Criterion, criterion_group, criterion_main};
use flexspline_sim::condense::{
    Block, Cell, CellAt, CellPlacement, CellState, CellTangent, Chain, CondensedWheel, Contribution, DenseKernels,
    Geometric, one, one_mut, rotate_pairs,
};
use flexspline_sim::contact::{BoreContact, BoreLaw, Configuration, FlankLaw};
use flexspline_sim::drive::GeneratorKind;
use flexspline_sim::fem::element::{PACKED, add_tangent_and_force, linear_stiffness};
use flexspline_sim::fem::{Cholesky, ElementPositions, Factor, Pattern};
use flexspline_sim::mesh::WheelMesh;
use flexspline_sim::simulate::peak_stress;
use flexspline_sim::stepping::{CondensedDrive, Method, Problem, State};

use common::{CpuTime, Run, STEP_RAD};

const TORQUE_N_M: f64 = 50.0;
/// Gap (mm) up to which flank pairs are looked at, and have a place in the sparsity pattern.
const REACH: f64 = 0.015;
const PATTERN_REACH: f64 = 0.04;
/// Spring (N/mm per mm) at every node that holds the wheels where nothing else does.
const SPRING: f64 = 1.0;

fn parts(criterion: &mut Criterion<CpuTime>) {
    let problem = common::problem(GeneratorKind::Cam, Method::Fast);
    let state = Run::new(&problem, TORQUE_N_M, STEP_RAD, 5).motion.state().clone();
    let whole = problem.whole_state(&state).into_owned();
    let mut group = criterion.benchmark_group("part");
    group.sample_size(10).warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_millis(800));
    reference(&mut group, &problem, &whole);
    contact(&mut group, &problem, &state);
    fast(&mut group, &problem, &state);
    group.finish();
}

/// Displacements of the nodes of an element.
fn of_element(element: &[u32; 8], field: &[f64]) -> [f64; 16] {
    std::array::from_fn(|i| field[2 * element[i / 2] as usize + i % 2])
}

/// Numbers of the circular-spline nodes behind those of the flexspline; none for those that the housing holds.
fn free_nodes(problem: &Problem) -> (Vec<Option<u32>>, usize) {
    let outer = problem.drive.circular_spline.outer_radius_mm;
    let mut next = problem.flexspline.nodes.len();
    let number = |x: &[f64; 2]| {
        (x[0].hypot(x[1]) <= outer - 1e-6).then(|| {
            next += 1;
            next as u32 - 1
        })
    };
    (problem.circular_spline.nodes.iter().map(number).collect(), next)
}

fn reference<M: Measurement>(group: &mut BenchmarkGroup<'_, M>, problem: &Problem, state: &State) {
    let (fs, cs) = (&problem.flexspline, &problem.circular_spline);
    let (number, nodes) = free_nodes(problem);
    let cs_nodes: Vec<[Option<u32>; 8]> = cs.elements.iter().map(|e| e.map(|n| number[n as usize])).collect();
    let cs_groups: Vec<Vec<u32>> = cs_nodes.iter().map(|e| e.iter().flatten().copied().collect()).collect();
    let flanks = problem.flanks_on(fs, cs);
    let at = Configuration { u: &state.u, v: &state.v, output_rad: state.output_rad, leans: &state.leans };
    let pairs: Vec<(Vec<u32>, Vec<u32>)> = flanks
        .near_pairs(at, PATTERN_REACH)
        .into_iter()
        .map(|pair| {
            let free = |n: usize| number[n].expect("flank nodes are free");
            (flanks.fs_nodes(pair).map(|n| n as u32).collect(), flanks.cs_nodes(pair).map(free).collect())
        })
        .collect();
    let groups = fs.elements.iter().map(|e| e.as_slice()).chain(cs_groups.iter().map(Vec::as_slice));
    let pattern = Pattern::new(nodes, groups, pairs.iter().map(|(a, b)| (a.as_slice(), b.as_slice())));

    let mut fixed = vec![0.0; pattern.stored()];
    for &start in &pattern.column_starts[..pattern.unknowns()] {
        fixed[start as usize] = SPRING;
    }
    for (element, points) in cs_nodes.iter().zip(&cs.gauss) {
        pattern.element(element).scatter(&linear_stiffness(points, &problem.material), &mut fixed);
    }
    let positions: Vec<ElementPositions> = fs.elements.iter().map(|e| pattern.element(&e.map(Some))).collect();
    let mut values = fixed.clone();
    let mut force = vec![0.0; pattern.unknowns()];
    let mut assemble = || {
        values.copy_from_slice(&fixed);
        force.fill(0.0);
        for ((element, points), positions) in fs.elements.iter().zip(&fs.gauss).zip(&positions) {
            let (mut stiffness, mut nodal) = ([0.0; PACKED], [0.0; 16]);
            let local = of_element(element, &state.u);
            add_tangent_and_force(points, &problem.material, &local, &mut stiffness, &mut nodal);
            positions.scatter(&stiffness, &mut values);
            for (i, f) in nodal.iter().enumerate() {
                force[2 * element[i / 2] as usize + i % 2] -= f;
            }
        }
    };
    group.bench_function("reference/assembly", |bencher| bencher.iter(&mut assemble));
    assemble();
    let mut factor = Cholesky::new(&pattern);
    let mut factorise = || factor.factorise(&pattern, &values).expect("springs hold the wheels");
    group.bench_function("reference/factorisation", |bencher| bencher.iter(&mut factorise));
    factorise();
    group.bench_function("reference/solve", |bencher| {
        bencher.iter(|| {
            let mut side = force.clone();
            factor.solve(&mut side, 1);
            black_box(side[0])
        });
    });
}

fn contact<M: Measurement>(group: &mut BenchmarkGroup<'_, M>, problem: &Problem, state: &State) {
    let (kind, settings) = (problem.kind, &problem.settings);
    let bore = BoreContact::new(problem.wheels().0, settings.bore_points(kind));
    let law = BoreLaw::new(settings.bore_penalty(kind), None);
    group.bench_function("contact/bore", |bencher| {
        bencher.iter(|| {
            let mut moment = 0.0;
            bore.evaluate(law, &problem.outline, state.generator_rad, &state.u, |edge| moment += edge.moment);
            black_box(moment)
        });
    });
    let flanks = problem.flanks();
    let at = Configuration { u: &state.u, v: &state.v, output_rad: state.output_rad, leans: &state.leans };
    let law = FlankLaw { stiffness: settings.flank_penalty, stick_stiffness: 0.0, friction: 0.0 };
    let torque = || -> f64 {
        let pairs = flanks.near_pairs(at, REACH).into_iter();
        pairs.filter_map(|p| flanks.evaluate(p, at, law, &flanks.layout(p, at).points)).map(|c| c.torque).sum()
    };
    // The pass is the real one: flanks carry the load, which is forward.
    let carried = torque() / problem.per_width(-TORQUE_N_M);
    assert!((carried - 1.0).abs() < 0.01, "the flanks carry {carried} of the load");
    group.bench_function("contact/flanks", |bencher| bencher.iter(|| black_box(torque())));
}

fn fast<M: Measurement>(group: &mut BenchmarkGroup<'_, M>, problem: &Problem, state: &State) {
    group.bench_function("fast/set-up", |bencher| {
        bencher.iter(|| common::problem(GeneratorKind::Cam, Method::Fast).degrees_of_freedom());
    });
    let (number, _) = free_nodes(problem);
    let condense = || {
        let held = |n: u32| number[n as usize].is_none();
        CondensedDrive::new(&problem.flexspline, &problem.circular_spline, &problem.material, held)
    };
    group.bench_function("fast/condensation", |bencher| bencher.iter(condense));

    let model = condense();
    let mut tangent = Tangent::new(&model, state);
    group.bench_function("fast/reduction", |bencher| bencher.iter(|| tangent.reduce()));
    tangent.reduce();
    group.bench_function("fast/chain", |bencher| bencher.iter(|| tangent.factorise()));
    tangent.factorise();
    let side: Vec<f64> = (0..tangent.unknowns()).map(|i| (i as f64).sin()).collect();
    group.bench_function("fast/solve", |bencher| {
        bencher.iter(|| {
            let mut side = side.clone();
            tangent.solve(&mut side);
            black_box(side[0])
        });
    });
    group.bench_function("fast/whole field", |bencher| bencher.iter(|| problem.whole_state(state).output_rad));
    group.bench_function("fast/peak stress", |bencher| bencher.iter(|| peak_stress(problem, state).von_mises_mpa));
}

/// A cell of either wheel in its place.
struct Placed<'m> {
    cell: &'m Cell,
    unknowns: &'m [u32],
    place: CellPlacement,
    /// In the flexspline.
    frame: Option<TurningFrame>,
}

/// How far the frame of a cell has turned, and what that adds to its tangent (see [`Geometric`]).
struct TurningFrame {
    turn_rad: f64,
    a: Vec<f64>,
    g: Vec<f64>,
    c: f64,
}

/// The tangent of both wheels without contact; springs at the faces hold it.
struct Tangent<'m> {
    kernels: DenseKernels,
    cells: Vec<Placed<'m>>,
    blocks: Vec<Block>,
    reduced: Vec<CellTangent>,
    contributions: Vec<Contribution>,
    chain: Chain,
}

impl<'m> Tangent<'m> {
    fn new(model: &'m CondensedDrive, state: &State) -> Tangent<'m> {
        let kernels = DenseKernels::default();
        let (fs, cs) = (&model.flexspline, &model.circular_spline);
        let mut cells = Vec::new();
        for (wheel, first, turning) in [(fs, 0, true), (cs, fs.count(), false)] {
            let mesh: &WheelMesh = &wheel.skin.mesh;
            for j in 0..wheel.count() {
                // A flexspline cell is centred on its tooth, a circular-spline cell between two numbered spaces.
                let middle = if turning { mesh.sector_angle(j) } else { (j as f64 + 0.5) * mesh.pitch() };
                let (cell, unknowns) = wheel.cell(j, false);
                let frame = turning.then(|| TurningFrame::new(kernels, cell, unknowns, middle, state));
                let turn = frame.as_ref().map_or(0.0, |frame| frame.turn_rad);
                let place = CellPlacement {
                    frame: middle + turn,
                    faces: [turn + 0.5 * mesh.pitch(), turn - 0.5 * mesh.pitch()],
                    blocks: [(first + j) as u32, (first + (j + 1) % wheel.count()) as u32],
                };
                cells.push(Placed { cell, unknowns, place, frame });
            }
        }
        // Around both rings, the first face of each last.
        let ring = |wheel: &CondensedWheel| {
            let (count, size) = (wheel.count(), wheel.face());
            (0..count).map(move |j| Block { size, sign: 1.0, key: if j == 0 { 2.0 } else { j as f64 / count as f64 } })
        };
        let blocks: Vec<Block> = ring(fs).chain(ring(cs)).collect();
        Tangent {
            kernels,
            reduced: vec![CellTangent::default(); cells.len()],
            contributions: Vec::new(),
            chain: Chain::default(),
            cells,
            blocks,
        }
    }

    fn reduce(&mut self) {
        self.contributions.clear();
        for (placed, tangent) in self.cells.iter().zip(&mut self.reduced) {
            let geometric = placed.frame.as_ref().map(|f| Geometric { a: &f.a, g: &f.g, c: f.c });
            let reduced = tangent.reduce(self.kernels, placed.cell, placed.place, Vec::new(), geometric, |_, _| false);
            self.contributions.push(reduced.expect("a cell held at its faces is stiff"));
        }
        for (k, block) in self.blocks.iter().enumerate() {
            let n = block.size;
            let mut matrix = vec![0.0; n * n];
            (0..n).for_each(|i| matrix[i * n + i] = SPRING);
            self.contributions.push(Contribution { blocks: vec![k as u32], matrix });
        }
    }

    fn factorise(&mut self) {
        assert!(self.chain.factorise(&self.blocks, &self.contributions), "springs hold the wheels");
    }

    /// Unknowns of both wheels.
    fn unknowns(&self) -> usize {
        self.cells.iter().flat_map(|cell| cell.unknowns).max().map_or(0, |last| *last as usize + 1)
    }

    /// Forces on flanks and bores to the faces, around the rings, and back. (Forces on the faces themselves, which the
    /// solver adds in between, are left out.)
    fn solve(&mut self, x: &mut [f64]) {
        let mut side = vec![[0.0]; self.chain.unknowns()];
        let x = one_mut(x);
        let (kernels, order) = (self.kernels, &self.chain);
        let cells = || self.cells.iter().map(|p| CellAt { kernels, cell: p.cell, unknowns: p.unknowns, order });
        let mut kept: Vec<Vec<[f64; 1]>> = cells().map(|at| vec![[0.0]; at.kept()]).collect();
        for ((at, tangent), kept) in cells().zip(&self.reduced).zip(&mut kept) {
            tangent.forward(at, x, &mut side, kept);
        }
        order.solve(&mut side);
        for ((at, tangent), kept) in cells().zip(&self.reduced).zip(&mut kept) {
            tangent.backward(at, x, &side, kept);
        }
    }
}

impl TurningFrame {
    fn new(kernels: DenseKernels, cell: &Cell, unknowns: &[u32], middle_rad: f64, state: &State) -> TurningFrame {
        let mut d: Vec<f64> = unknowns.iter().map(|u| state.u[*u as usize]).collect();
        rotate_pairs(&mut d, (-middle_rad).sin_cos());
        let mut inner = CellState::default();
        cell.frame.split(&d, &mut inner);
        let quarter: Vec<f64> = inner.q.chunks_exact(2).flat_map(|q| [-q[1], q[0]]).collect();
        let [force, turned] = [&inner.q, &quarter].map(|q| {
            let mut product = vec![0.0; q.len()];
            kernels.multiply_add(&cell.stiffness, one(q), 1.0, one_mut(&mut product));
            product
        });
        let (g, c) = cell.frame.geometric(&inner, &force, &turned);
        TurningFrame { turn_rad: inner.turn, a: inner.turn_rate, g, c }
    }
}

criterion_group! { name = part; config = common::criterion(); targets = parts }
criterion_main!(part);
