//! A dish on a joint by a law: what tests and the example fly without a contact FEM.

use core::f64::consts::TAU;

use flexspline::{Drive, FixedMember};
use flexspline_motion::flight::{ARCSEC_PER_RAD, JointUnit};
use flexspline_motion::gear::SampledSpring;
use flexspline_motion::scenario::{Leg, Load, Scenario};
use flexspline_motion::servo::ServoSettings;

/// A unit like HHD-95 with a double disc: 31″ of clearance to each side, wind-up that hardens,
/// a ripple of the tooth pitch.
#[allow(dead_code, reason = "not every test flies it")]
pub fn unit() -> JointUnit {
    let drive = Drive::new(188, 190, FixedMember::Flexspline).expect("the teeth of HHD-95");
    let law = |phase: f64, flank: f64| {
        (31.0 + 1.1 * flank / (1.0 + 0.006 * flank) + 0.2 * libm::cos(TAU * phase)) / ARCSEC_PER_RAD
    };
    JointUnit::of_spring(drive, SampledSpring::of_law(f64::from(drive.ripple_order()), 100.0, law))
}

/// A dish of 3 kg·m² under a load that swings and gusts, turned to and fro, quickly and slowly; the torque is known on
/// the load, the table calibrated.
pub fn scenario() -> Scenario {
    Scenario {
        legs: [(2.0, 0.0), (3.0, 2e-3), (3.0, -2e-3), (3.0, 1e-4), (3.0, -1e-4)]
            .map(|(seconds, rate_rad_s)| Leg { seconds, rate_rad_s })
            .to_vec(),
        load: Load { bias_n_m: 8.0, swing: [6.0, 0.05], gust: [1.5, 0.3], ..Load::default() },
        servo: ServoSettings { position_hz: 12.0, integral_hz: 5.0, ..ServoSettings::HHD_95 },
        seed: 3,
        ..Scenario::usual("dish")
    }
}
