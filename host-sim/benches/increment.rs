//! Cost of an increment of 0.01 rad of the whole drive in steady motion, standard mesh, by both solvers side by side.
//!
//! ```text
//! cargo bench --bench increment
//! ```
//!
//! Criterion's figures `increment/<generator> <torque> N.m/<solver>` are CPU time of one increment: predictor, contact,
//! Newton iterations and all. The line after each gives the mean over all increments of that run (CPU), Newton
//! iterations and factorisations for each, and how the time is made up by the solver's own clocks (those are wall
//! clocks: on a machine that does other things they add up to more than the CPU time). The line `reference / fast` is
//! the ratio of the means. The drive moves on from sample to sample; what was settled before is not timed.

mod common;

use std::cell::RefCell;
use std::time::Duration;

use cpu_time::ProcessTime;
use criterion::measurement::Measurement;
use criterion::{BenchmarkGroup, Criterion, SamplingMode, criterion_group, criterion_main};
use flexspline_sim::drive::GeneratorKind;
use flexspline_sim::stepping::{Method, Problem};

use common::{CpuTime, Run, SETTLING, STEP_RAD};

const CASES: [(GeneratorKind, f64); 5] = [
    (GeneratorKind::Cam, 0.0),
    (GeneratorKind::Cam, 50.0),
    (GeneratorKind::TwoRoller, 20.0),
    (GeneratorKind::FourRoller, 50.0),
    (GeneratorKind::DoubleDisc, 100.0),
];

fn increments(criterion: &mut Criterion<CpuTime>) {
    let mut group = criterion.benchmark_group("increment");
    group.sample_size(10).warm_up_time(Duration::from_millis(300)).sampling_mode(SamplingMode::Flat);
    for (kind, torque_n_m) in CASES {
        let means = [(Method::Reference, 2.5), (Method::Fast, 1.0)].map(|(method, seconds)| {
            group.measurement_time(Duration::from_secs_f64(seconds));
            let problem = common::problem(kind, method);
            assert!(problem.degrees_of_freedom() >= 60_000, "{} degrees of freedom", problem.degrees_of_freedom());
            mean_ms(&mut group, &problem, torque_n_m)
        });
        if let [Some(reference), Some(fast)] = means {
            println!("    {kind} {torque_n_m} N.m: reference / fast = {:.1}\n", reference / fast);
        }
    }
    group.finish();
}

/// Benchmarks one case; mean CPU milliseconds of its increments, if the filter of the command let it run.
fn mean_ms<M: Measurement>(group: &mut BenchmarkGroup<'_, M>, problem: &Problem, torque_n_m: f64) -> Option<f64> {
    let (kind, method) = (problem.kind, problem.settings.method);
    let settle = if method == Method::Fast { Run::new } else { Run::taken_over };
    // Settled when it first runs: a case that is filtered out costs nothing.
    let run: RefCell<Option<(Run, Duration)>> = RefCell::new(None);
    group.bench_function(format!("{kind} {torque_n_m} N.m/{method}"), |bencher| {
        let mut run = run.borrow_mut();
        let (settled, time) =
            run.get_or_insert_with(|| (settle(problem, torque_n_m, STEP_RAD, SETTLING), Duration::ZERO));
        bencher.iter(|| {
            let clock = ProcessTime::now();
            settled.advance();
            *time += clock.elapsed();
        });
    });
    let (mut settled, time) = run.into_inner()?;
    let each = |time: Duration| time.as_secs_f64() * 1e3 / settled.increments as f64;
    let effort = settled.motion.take_effort();
    println!(
        "    {kind} {torque_n_m} N.m, {method}, {} dof: {:.2} ms CPU, {:.1} iterations, {:.2} factorisations (mean of \
         {}); clocks: assembly {:.2}, contact {:.2}, analysis {:.2}, factorisation {:.2}, solution {:.2} ms",
        problem.degrees_of_freedom(),
        each(time),
        settled.iterations as f64 / settled.increments as f64,
        effort.factorisations as f64 / settled.increments as f64,
        settled.increments,
        each(effort.assembly),
        each(effort.contact),
        each(effort.analysis),
        each(effort.factorisation),
        each(effort.solution),
    );
    Some(each(time))
}

criterion_group! { name = increment; config = common::criterion(); targets = increments }
criterion_main!(increment);
