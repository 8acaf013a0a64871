//! With all that flies in the loop no joint that comes to rest by itself is kept from it: over inertias, stiffnesses,
//! servos, and what is known of the torque.

use flexspline::{Drive, FixedMember};
use flexspline_motion::flight::{ARCSEC_PER_RAD, JointUnit, comes_to_rest};
use flexspline_motion::gear::SampledSpring;
use flexspline_motion::scenario::{Load, Scenario, TorqueKnown};
use flexspline_motion::servo::ServoSettings;

mod dish;

/// With a wind-up that begins with this compliance, arcsec for each N·m.
fn unit(arcsec_n_m: f64) -> JointUnit {
    let law = |_: f64, flank: f64| (30.0 + arcsec_n_m * flank / (1.0 + 0.01 * flank)) / ARCSEC_PER_RAD;
    JointUnit::of_spring(
        Drive::new(188, 190, FixedMember::Flexspline).unwrap(),
        SampledSpring::of_law(188.0, 100.0, law),
    )
}

#[test]
#[ignore = "long: tests/run slow"]
fn no_joint_is_kept_from_coming_to_rest() {
    let base = dish::scenario();
    let (mut joints, mut refused, mut slowest) = (0, 0, f64::INFINITY);
    for arcsec_n_m in [0.4, 2.0, 8.0] {
        let unit = unit(arcsec_n_m);
        for load_kg_m2 in [0.3, 3.0] {
            for (position_hz, speed_hz, late_steps) in [(6.0, 50.0, 1), (12.0, 50.0, 5), (3.0, 25.0, 1)] {
                for torque in [TorqueKnown::OnLoad, TorqueKnown::InMesh, TorqueKnown::Current] {
                    let servo = ServoSettings {
                        position_hz,
                        speed_hz,
                        late_steps,
                        integral_hz: 0.5 * position_hz,
                        ..base.servo
                    };
                    let load = Load { bias_n_m: 6.0, swing: [0.0; 2], ..base.load };
                    let scenario = Scenario { servo, load, load_kg_m2, torque, ..base.clone() };
                    let (rests, low_pass_hz) = comes_to_rest(&scenario, &unit).unwrap();
                    assert!(
                        rests,
                        "{arcsec_n_m}\"/N.m, {load_kg_m2} kg.m2, {position_hz} Hz, late {late_steps}, {torque:?}"
                    );
                    joints += 1;
                    refused += usize::from(low_pass_hz.is_none());
                    slowest = low_pass_hz.map_or(slowest, |hz| slowest.min(hz));
                }
            }
        }
    }
    println!(
        "{joints} joints come to rest; {refused} may not use a torque in the mesh; slowest low-pass {slowest:.2} Hz"
    );
    assert!(refused < joints / 3);
}
