//! Cost of one small table, through the library: torque nodes chosen, swept, projected.
//!
//! ```text
//! cargo bench --bench table
//! ```
//!
//! Criterion's figure is CPU time of all threads for a table of the cam up to 50 N.m, at both ends of the operating
//! temperatures, on the torque nodes that the choice begins with (it may add none) and four positions over a tooth
//! pitch, by the fast solver, standard mesh, set-up of the problems included. The line after it says what the table
//! holds.

mod common;

use std::ops::ControlFlow;
use std::time::Duration;

use criterion::{Criterion, SamplingMode, criterion_group, criterion_main};
use flexspline_sim::drive::{Drive, GeneratorKind};
use flexspline_sim::tables::NodeChoice;
use flexspline_sim::tables::{MadeTable, TableSettings, TorqueNodes, make};

use common::CpuTime;

/// The table.
fn made() -> MadeTable {
    let (drive, kind) = (Drive::hhd_95(), GeneratorKind::Cam);
    let choice = NodeChoice { largest_n_m: 50.0, most: 5, tolerance_arcsec: 0.6 };
    let settings = TableSettings {
        torque_nodes: TorqueNodes::Chosen(choice),
        positions: 4,
        ..TableSettings::for_generator(&drive, kind)
    };
    make(&drive, kind, &settings, &|_| ControlFlow::Continue(())).expect("the cam has a table")
}

fn small_table(criterion: &mut Criterion<CpuTime>) {
    let mut group = criterion.benchmark_group("table");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(100)).measurement_time(Duration::from_secs(5));
    let mut last = None;
    group.bench_function("cam to 50 N.m, 4 positions", |bencher| bencher.iter(|| last = Some(made())));
    if let Some(table) = last {
        println!(
            "    {} bytes, {} torque nodes, wind-up at the ends {:.2?}″",
            table.info.image_bytes,
            table.info.torque_nodes_n_m.len(),
            table.info.wind_up_arcsec,
        );
    }
    group.finish();
}

criterion_group! { name = table; config = common::criterion(); targets = small_table }
criterion_main!(table);
