//! Flights with drives by a law: what the core gains on a unit that its table does not know, in motion.

use flexspline::{Drive, FixedMember};
use flexspline_motion::flight::{ARCSEC_PER_RAD, CONTROLLERS, Flight, Unit, fly};
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
        legs: [(2.0, 0.0), (4.0, 2e-3), (4.0, -2e-3), (4.0, 1e-4), (4.0, -1e-4)]
            .map(|(seconds, rate_rad_s)| Leg { seconds, rate_rad_s })
            .to_vec(),
        acceleration_rad_s2: 0.05,
        load: Load { bias_n_m: 8.0, swing: [6.0, 0.05], gust: [1.5, 0.3], step: [0.0; 2], gravity: [0.0; 2] },
        load_kg_m2: 3.0,
        drag_n_m: 0.5,
        damping: 0.02,
        temperature_c: 20.0,
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
        friction_known: 0.8,
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

#[test]
fn look() {
    let unit = unit();
    for torque in [TorqueKnown::OnLoad, TorqueKnown::InMesh, TorqueKnown::Current, TorqueKnown::Not] {
        let begun = std::time::Instant::now();
        let flight = fly(&Scenario { torque, ..scenario() }, &unit).unwrap();
        show(&format!("{torque:?} {:.2} s", begun.elapsed().as_secs_f64()), &flight);
    }
    for table in [TableKnown::Nominal, TableKnown::Extended] {
        show(&format!("{table:?}"), &fly(&Scenario { table, ..scenario() }, &unit).unwrap());
    }
}
