//! Cost of one small table, through the library: torque nodes chosen, swept, projected.
//!
//! ```text
//! cargo bench -p flexspline-sim --bench table
//! ```
//!
//! Criterion's figure is CPU time of all threads for a table of the cam up to 50 N.m, at both ends of the operating
//! temperatures, on the torque nodes that the choice begins with (it may add none) and four positions over a tooth pitch, by
//! the fast solver, standard mesh, set-up of the problems included. The line after it says what the table holds.

mod common;

use std::ops::ControlFlow;
use std::time::Duration;

use criterion::{Criterion, SamplingMode, criterion_group, criterion_main};
use flexspline_sim::drive::{Drive, GeneratorKind};
use flexspline_sim::stepping::{Method, SolverSettings};
use flexspline_sim::tables::sweep::{SweepPlan, sweep};
use flexspline_sim::tables::torque_nodes::{NodeChoice, choose_torque_nodes};
use flexspline_sim::tables::{MadeTable, from_sweep};
use flexspline_sim::units::ARCSEC_PER_RAD;

use common::CpuTime;

/// The table, and the increments of its sweep beyond those that chose the nodes.
fn make() -> (MadeTable, usize) {
    let (drive, kind) = (Drive::hhd_95(), GeneratorKind::Cam);
    let settings = SolverSettings { method: Method::Fast, ..SolverSettings::default() };
    let mut plan = SweepPlan { positions: 4, ..SweepPlan::for_generator(&drive, kind) };
    let choice = NodeChoice { largest_n_m: 50.0, most: 5, tolerance_rad: 0.6 / ARCSEC_PER_RAD };
    let observe = |_| ControlFlow::Continue(());
    let chosen = choose_torque_nodes(&drive, kind, &plan, choice, settings, &observe).expect("nodes are found");
    plan.torque_nodes_n_m = chosen.torque_nodes_n_m;
    let swept = sweep(&drive, kind, &plan, &chosen.known, settings, &observe).expect("the sweep ends");
    let table = from_sweep(&drive, &plan, &swept, settings, 0.0).expect("the samples make a table");
    (table, swept.increments)
}

fn small_table(criterion: &mut Criterion<CpuTime>) {
    let mut group = criterion.benchmark_group("table");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(100)).measurement_time(Duration::from_secs(5));
    let mut made = None;
    group.bench_function("cam to 50 N.m, 4 positions", |bencher| bencher.iter(|| made = Some(make())));
    if let Some((table, increments)) = made {
        println!(
            "    {} bytes, {} torque nodes, {} increments swept beside those that chose the nodes, wind-up at the ends {:.2?}″",
            table.info.image_bytes,
            table.info.torque_nodes_n_m.len(),
            increments,
            table.info.wind_up_arcsec,
        );
    }
    group.finish();
}

criterion_group! { name = table; config = common::criterion(); targets = small_table }
criterion_main!(table);
