//! Flights with drives by a law: what the core gains on a unit that its table does not know, in motion.

use flexspline::{Drive, FixedMember};
use flexspline_motion::flight::{
    ARCSEC_PER_RAD, BY_TORQUE, COMPENSATED, CONTROLLERS, Flight, Flown, Unit, fly, fly_one,
};
use flexspline_motion::gear::Sampled;
use flexspline_motion::scenario::{Leg, Load, Scenario, TableKnown, TorqueKnown};
use flexspline_motion::servo::ServoSettings;

/// As HHD-95 with a double disc: 31″ of clearance to each side, wind-up that hardens, a ripple of the tooth pitch.
fn unit() -> Unit {
    let drive = Drive::new(188, 190, FixedMember::Flexspline).unwrap();
    let law = |phase: f64, flank: f64| {
        (31.0 + 1.1 * flank / (1.0 + 0.006 * flank) + 0.2 * libm::cos(std::f64::consts::TAU * phase)) / ARCSEC_PER_RAD
    };
    Unit::of_spring(drive, Sampled::of_law(188.0, 100.0, law))
}

fn scenario() -> Scenario {
    Scenario {
        name: "test".to_owned(),
        legs: [(2.0, 0.0), (3.0, 2e-3), (3.0, -2e-3), (3.0, 1e-4), (3.0, -1e-4)]
            .map(|(seconds, rate_rad_s)| Leg { seconds, rate_rad_s })
            .to_vec(),
        acceleration_rad_s2: 0.05,
        load: Load { bias_n_m: 8.0, swing: [6.0, 0.05], gust: [1.5, 0.3], step: [0.0; 2], gravity: [0.0; 2] },
        load_kg_m2: 3.0,
        drag_n_m: 0.5,
        damping: 0.02,
        temperature_c: 20.0,
        warming_k_s: 0.0,
        servo: ServoSettings {
            tick_s: 1e-3,
            steps: 5,
            late_steps: 1,
            inertia_kg_m2: 1.1e-4,
            largest_n_m: 4.0,
            position_hz: 12.0,
            speed_hz: 50.0,
            integral_hz: 5.0,
            encoder_bits: 17,
            jitter_s: 5e-6,
            current_noise_n_m: 1e-3,
        },
        friction: 1.0,
        friction_known: 0.8,
        load_fed_forward: 1.0,
        torque: TorqueKnown::OnLoad,
        torque_noise_n_m: 0.05,
        table: TableKnown::Calibrated,
        seed: 3,
    }
}

fn show(what: &str, flight: &Flight) {
    println!(
        "{what}: stable {}, low-pass {:.2} Hz, phase margin {:.0?}, resonances {:.0?} Hz",
        flight.stable, flight.bandwidth_hz, flight.phase_margin_deg, flight.resonances_hz
    );
    for (name, flown) in CONTROLLERS.iter().zip(&flight.flown) {
        println!(
            "  {name:20} {:8.2}\" rms {:8.2}\" max {:9.1} \"/s ripple, limits {:?}, told {:.3}",
            flown.error.rms(),
            flown.error.largest(),
            flown.ripple.rms(),
            flown.limits,
            flown.told
        );
    }
}

fn flown(scenario: &Scenario) -> Flight {
    fly(scenario, &unit()).unwrap()
}

fn alone(scenario: &Scenario, kind: usize) -> Flown {
    fly_one(scenario, &unit(), kind).unwrap()
}

/// On a unit that its table was sampled from with noise, the core removes what an inverse that knows everything but the motion removes, and keeps
/// the joint as stable as it was.
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
            assert!(flight.flown[COMPENSATED].told > 0.95, "{}", flight.flown[COMPENSATED].told);
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

/// Load less than the drag: on the wrong flank the core was worse than nothing.
#[test]
fn a_load_below_the_drag_and_noise_about_zero_are_never_worse_than_no_compensation() {
    for (bias_n_m, torque_noise_n_m, torque) in [
        (0.3, 0.05, TorqueKnown::OnLoad),
        (0.0, 0.3, TorqueKnown::OnLoad),
        (0.3, 0.3, TorqueKnown::InMesh),
        (0.0, 0.03, TorqueKnown::InMesh),
    ] {
        let load = Load { bias_n_m, swing: [0.0, 0.05], gust: [0.0, 0.3], ..scenario().load };
        let scenario = Scenario { load, torque, torque_noise_n_m, ..scenario() };
        let [none, core] = [0, COMPENSATED].map(|kind| alone(&scenario, kind).error.rms());
        println!("load {bias_n_m}, noise {torque_noise_n_m} N.m, {torque:?}: {none:.2} without, {core:.2} with");
        assert!(core < none, "{bias_n_m} {torque_noise_n_m} {torque:?}: {none} {core}");
    }
}

#[test]
fn a_flight_is_the_same_to_the_last_bit() {
    let [one, two] = [0, 1].map(|_| alone(&scenario(), COMPENSATED).digest);
    assert_eq!(one, two);
    // Another seed is another sky.
    assert_ne!(one, alone(&Scenario { seed: 4, ..scenario() }, COMPENSATED).digest);
}

/// Where the state of the play gains over the same table by the sign of the target's velocity, and where it does not.
#[test]
fn the_play_is_held_against_the_same_table_by_the_sign_of_velocity() {
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
        let [none, core, by_torque] = [0, COMPENSATED, BY_TORQUE].map(|kind| alone(&scenario, kind).error.rms());
        println!("{what}: {none:.2} without, {core:.2} core, {by_torque:.2} by torque and sign of velocity");
        // Without load and drag neither knows the flank: the load coasts from one to the other.
        let known = drag_n_m > 0.1;
        assert!(core < none && (!known || core < 1.05 * by_torque), "{what}: {core} {by_torque}");
    }
}
