//! Flights with drives by a law: what the core gains on a unit that its table does not know, in motion.

use flexspline::{Drive, FixedMember};
use flexspline_motion::dish::{self, scenario};
use flexspline_motion::flight::{COMPENSATED, CONTROLLERS, Flight, Flown, JointUnit, fly, fly_one};
use flexspline_motion::scenario::{Leg, Load, Scenario, TableKnown, TorqueKnown};

fn unit() -> JointUnit {
    dish::unit(Drive::new(188, 190, FixedMember::Flexspline).unwrap())
}

fn show(what: &str, flight: &Flight) {
    println!(
        "{what}: stable {}, low-pass {:.2} Hz, phase margin {:.0?}, resonances {:.0?} Hz",
        flight.stable, flight.bandwidth_hz, flight.phase_margin_deg, flight.resonances_hz
    );
    for (name, flown) in CONTROLLERS.iter().zip(&flight.flown) {
        println!(
            "  {name:20} {:8.2}\" rms {:8.2}\" max {:9.1} \"/s ripple, limits {:?}, within bound {:.3}",
            flown.error.rms(),
            flown.error.largest(),
            flown.ripple.rms(),
            flown.limits,
            flown.within_bound
        );
    }
}

fn flown(scenario: &Scenario) -> Flight {
    fly(scenario, &unit()).unwrap()
}

fn alone(scenario: &Scenario, kind: usize) -> Flown {
    fly_one(scenario, &unit(), kind).unwrap()
}

/// On a unit that its table was sampled from with noise, the core removes what an inverse that knows everything but the
/// motion removes, and keeps the joint as stable as it was.
#[test]
fn the_core_removes_what_a_quasi_static_inverse_removes() {
    let mut left = Vec::new();
    for torque in [TorqueKnown::OnLoad, TorqueKnown::InMesh, TorqueKnown::Current, TorqueKnown::Not] {
        let flight = flown(&Scenario { torque, ..scenario() });
        show(&format!("{torque:?}"), &flight);
        let [none, .., by_direction, core, ideal] = [0, 1, 2, 3, 4].map(|k| flight.flown[k].error.rms());
        assert!(flight.stable && core < by_direction, "{torque:?}: {core} {by_direction}");
        left.push((none - core) / (none - ideal));
        if torque == TorqueKnown::Current {
            // The bound that is stated with the torque.
            assert!(flight.flown[COMPENSATED].within_bound > 0.95, "{}", flight.flown[COMPENSATED].within_bound);
        }
    }
    println!("removed of what the ideal removes, torque on load, in mesh, by current, unknown: {left:.3?}");
    assert!(left[0] > 0.95 && left[1] > 0.9 && left[2] > left[3]);
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
