//! Cost of an increment of 0.01 rad of the whole drive in steady motion, standard mesh, and of its parts.
//!
//! ```text
//! cargo bench -p flexspline-sim --bench increment
//! ```
//!
//! `increment/…` is the time of a whole increment, Newton iterations and predictor included; the lines after it say how it
//! is made up: assembly of the elements, contact, factorisation, triangular solves, and the rest. `assembly` and
//! `contact/…` time one pass over the elements and over the two kinds of contact at the deformed state.

use std::cell::RefCell;
use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{Criterion, criterion_group, criterion_main};
use flexspline_sim::contact::{BoreContact, BoreLaw, Configuration, FlankLaw};
use flexspline_sim::drive::{Drive, GeneratorKind};
use flexspline_sim::element::{PACKED, add_tangent_and_force};
use flexspline_sim::stepping::{Effort, Problem, Solver, SolverSettings, State};

const STEP_RAD: f64 = 0.01;
const TORQUE_N_M: f64 = 50.0;

fn problem(kind: GeneratorKind) -> Problem {
    let drive = Drive::hhd_95();
    let problem = Problem::new(&drive, kind, drive.temperature.reference_c, SolverSettings::default()).unwrap();
    assert!(problem.degrees_of_freedom() >= 60_000, "{} degrees of freedom", problem.degrees_of_freedom());
    problem
}

/// Loaded and in steady motion.
fn settled<'p>(problem: &'p Problem, torque_n_m: f64) -> (Solver<'p>, State) {
    let mut solver = Solver::new(problem);
    let (mut state, _) = solver.deform(0.0).unwrap();
    if torque_n_m != 0.0 {
        state = solver.increment(&state, 0.0, torque_n_m).unwrap().0;
    }
    for _ in 0..5 {
        state = solver.increment(&state, state.generator_rad + STEP_RAD, torque_n_m).unwrap().0;
    }
    (solver, state)
}

fn whole_increments(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("increment");
    group.sample_size(10).warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(8));
    for (kind, torque_n_m) in
        [(GeneratorKind::Cam, 0.0), (GeneratorKind::Cam, TORQUE_N_M), (GeneratorKind::TwoRoller, TORQUE_N_M)]
    {
        let problem = problem(kind);
        let (solver, state) = settled(&problem, torque_n_m);
        let effort_before = solver.effort;
        let run = RefCell::new((solver, state, 0_u32, 0_usize, Duration::ZERO));
        group.bench_function(format!("{kind}/{torque_n_m} N.m/{} dof", problem.degrees_of_freedom()), |bencher| {
            bencher.iter(|| {
                let (solver, state, count, iterations, time) = &mut *run.borrow_mut();
                let clock = Instant::now();
                let (next, increment) = solver.increment(state, state.generator_rad + STEP_RAD, torque_n_m).unwrap();
                *time += clock.elapsed();
                *state = next;
                *count += 1;
                *iterations += increment.iterations;
            });
        });
        let (solver, _, count, iterations, time) = run.into_inner();
        report(kind, effort_before, solver.effort, count, iterations, time);
    }
    group.finish();
}

fn report(kind: GeneratorKind, before: Effort, after: Effort, count: u32, iterations: usize, time: Duration) {
    let part = |f: fn(&Effort) -> Duration| (f(&after) - f(&before)).as_secs_f64() * 1e3 / f64::from(count);
    let parts = [
        ("assembly", part(|e| e.assembly)),
        ("contact", part(|e| e.contact)),
        ("analysis", part(|e| e.analysis)),
        ("factorisation", part(|e| e.factorisation)),
        ("solution", part(|e| e.solution)),
    ];
    let whole = time.as_secs_f64() * 1e3 / f64::from(count);
    let rest = whole - parts.iter().map(|(_, ms)| ms).sum::<f64>();
    print!("    {kind}: {:.1} iterations, {whole:.1} ms:", iterations as f64 / f64::from(count));
    for (name, ms) in parts {
        print!(" {name} {ms:.1}");
    }
    println!(" rest {rest:.1}");
}

fn parts(criterion: &mut Criterion) {
    let problem = problem(GeneratorKind::Cam);
    let (_, state) = settled(&problem, TORQUE_N_M);
    let mut group = criterion.benchmark_group("part");
    group.sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2));
    group.bench_function("assembly/flexspline tangents", |bencher| {
        bencher.iter(|| {
            let mut sum = 0.0;
            for (element, points) in problem.flexspline.elements.iter().zip(&problem.flexspline.gauss) {
                let local = std::array::from_fn(|i| state.u[2 * element[i / 2] as usize + i % 2]);
                let (mut stiffness, mut force) = ([0.0; PACKED], [0.0; 16]);
                add_tangent_and_force(points, &problem.material, &local, &mut stiffness, &mut force);
                sum += stiffness[0] + force[0];
            }
            black_box(sum)
        });
    });
    let bore = BoreContact::new(&problem.flexspline, problem.settings.bore_points(problem.kind));
    let law = BoreLaw::new(problem.settings.bore_penalty(problem.kind), None);
    group.bench_function("contact/bore on cam", |bencher| {
        bencher.iter(|| {
            let mut moment = 0.0;
            bore.evaluate(law, &problem.outline, state.generator_rad, &state.u, |edge| moment += edge.moment);
            black_box(moment)
        });
    });
    let flanks = problem.flanks();
    let at = Configuration { u: &state.u, v: &state.v, output_rad: state.output_rad };
    let law = FlankLaw { stiffness: problem.settings.flank_penalty, stick_stiffness: 0.0, friction: 0.0 };
    group.bench_function("contact/flanks: search, layout, forces", |bencher| {
        bencher.iter(|| {
            let torque: f64 = flanks
                .near_pairs(at, 0.015)
                .into_iter()
                .filter_map(|pair| flanks.evaluate(pair, at, law, &flanks.layout(pair, at).points))
                .map(|contact| contact.torque)
                .sum();
            black_box(torque)
        });
    });
    group.bench_function("set-up", |bencher| {
        bencher.iter(|| self::problem(GeneratorKind::Cam).degrees_of_freedom());
    });
    group.finish();
}

criterion_group!(increment, whole_increments, parts);
criterion_main!(increment);
