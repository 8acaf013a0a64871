//! Flights with drives by a law: what the core gains on a unit that its table does not know, in motion.

use flexspline_motion::flight::{COMPENSATED, Flown, fly_one};
use flexspline_motion::scenario::{Leg, Load, Scenario, TableKnown};

mod dish;
use dish::{scenario, unit};

fn alone(scenario: &Scenario, kind: usize) -> Flown {
    fly_one(scenario, &unit(), kind).unwrap()
}

#[test]
fn a_diagnosed_table_is_nearly_as_good_as_a_calibrated_one_and_the_nominal_is_not() {
    let [nominal, extended, calibrated] = [TableKnown::Nominal, TableKnown::Extended, TableKnown::Calibrated]
        .map(|table| alone(&Scenario { table, ..scenario() }, COMPENSATED).error.rms());
    println!("left with a nominal table {nominal:.2}, extended {extended:.2}, calibrated {calibrated:.2} arcsec rms");
    assert!(extended < 1.3 * calibrated && nominal > 2.0 * extended);
}

#[test]
fn a_flight_is_the_same_to_the_last_bit() {
    let [one, two] = [0, 1].map(|_| alone(&scenario(), COMPENSATED).digest);
    assert_eq!(one, two);
    // Another seed is another sky.
    assert_ne!(one, alone(&Scenario { seed: 4, ..scenario() }, COMPENSATED).digest);
}

/// The core takes error out of a loaded joint, of one whose load changes its sign, and of one that turns back often.
#[test]
fn the_core_gains_where_the_play_is_crossed() {
    let calm = Load { bias_n_m: 0.0, swing: [0.0, 0.05], gust: [0.0, 0.3], ..scenario().load };
    let crossing = Load { swing: [3.0, 0.4], ..calm };
    let turning: Vec<Leg> = [(2.0, 0.0)]
        .into_iter()
        .chain((0..10).map(|k| (1.0, if k % 2 == 0 { 1e-3 } else { -1e-3 })))
        .map(|(seconds, rate_rad_s)| Leg { seconds, rate_rad_s })
        .collect();
    for (what, load, legs, drag_n_m) in [
        ("loaded", scenario().load, scenario().legs, 0.5),
        ("load crosses zero", crossing, scenario().legs, 0.5),
        ("reverses every second, calm", calm, turning.clone(), 0.5),
        ("reverses every second, calm, no drag", calm, turning, 0.02),
    ] {
        let scenario = Scenario { load, legs, drag_n_m, ..scenario() };
        let [none, core] = [0, COMPENSATED].map(|kind| alone(&scenario, kind).error.rms());
        println!("{what}: {none:.2} without, {core:.2} core");
        assert!(core < none, "{what}: {core} {none}");
    }
}
