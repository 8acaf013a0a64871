//! Measured data, damaged in every way that is known: each file ends in a clear error or in a fault with its name, and what is physics
//! is not taken for a fault.

#[path = "bench_data.rs"]
mod bench_data;

use bench_data::{ARCSEC, Bench, RATIO, normal};
use flexspline_sim::measurement::{ColumnMap, FaultName, Gear, MeasuredError, Recording, Treatment, parse};

fn gear() -> Gear {
    Gear::of_teeth(188, 190, true)
}

fn read(text: &[u8]) -> Result<Recording, MeasuredError> {
    parse("m.csv", text, &ColumnMap::default(), &gear())
}

fn names(recording: &Recording) -> Vec<FaultName> {
    let mut names: Vec<FaultName> = recording.faults.iter().map(|fault| fault.name).collect();
    names.sort();
    names.dedup();
    names
}

#[test]
fn clean_data_has_no_fault() {
    let bench = Bench::plain(6000, 1.0, 3);
    let read = read(bench.csv().as_bytes()).unwrap();
    assert_eq!(read.faults, []);
    assert_eq!(read.sessions.len(), 1);
    let session = &read.sessions[0];
    assert_eq!(session.len(), 6000);
    assert_eq!((session.line[0], session.line[5999]), (2, 6001));
    for row in [0, 777, 5999] {
        let error = bench.output_rad[row] - bench.generator_rad[row] / RATIO;
        assert!((session.error_rad[row] - error).abs() < 1e-9);
        assert!((session.output_rad(RATIO)[row] - bench.output_rad[row]).abs() < 1e-10);
    }
}

/// False alarms over many drives with backlash, hysteresis, resonance, damaged teeth, wear, heat, latency, gravity and the rest.
#[test]
fn physics_is_not_taken_for_a_fault_of_the_data() {
    let seeds = std::env::var("FLEXSPLINE_SEEDS").ok().and_then(|n| n.parse().ok()).unwrap_or(300);
    let mut alarms = Vec::new();
    for seed in 0..seeds {
        let (bench, said) = Bench::drawn(5000, seed);
        let read = read(bench.csv().as_bytes()).unwrap_or_else(|error| panic!("seed {seed} {said:?}: {error}"));
        if !read.faults.is_empty() || !read.tooth_steps.is_empty() {
            let what: Vec<_> = read.faults.iter().map(|fault| &fault.what).collect();
            alarms.push(format!("seed {seed} {said:?}: {what:?} {:?}", read.tooth_steps));
        }
    }
    println!("{} false alarms in {seeds}", alarms.len());
    assert!(alarms.len() as f64 <= 0.01 * seeds as f64, "{} in {seeds}:\n{}", alarms.len(), alarms.join("\n"));
}
