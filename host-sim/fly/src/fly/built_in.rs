//! The scenarios that have a name.

use flexspline_motion::scenario::{Leg, Load, Scenario};
use flexspline_motion::servo::ServoSettings;

use super::Flown;
use flexspline_mechanics::drive::GeneratorKind;

/// Names of scenarios.
pub const SCENARIOS: [&str; 4] = ["antenna", "rover", "camera", "telescope"];

fn legs(legs: &[(f64, f64)]) -> Vec<Leg> {
    legs.iter().map(|&(seconds, rate_rad_s)| Leg { seconds, rate_rad_s }).collect()
}

/// The scenario of a name.
pub fn built_in(name: &str) -> Option<Flown> {
    let base = |legs: Vec<Leg>, load: Load| Scenario { legs, load, ..Scenario::usual(name) };
    let none = Load::default();
    let flown = |kind, scenario| Some(Flown { kind, scenario, own: None });
    match name {
        // 0.001 to 1 °/s with reversals, a slow swing of the wind that crosses zero, gusts.
        "antenna" => {
            let degree = std::f64::consts::PI / 180.0;
            let mut way = vec![(2.0, 0.0)];
            for rate in [1.0, 0.1, 0.01, 0.001] {
                way.extend([(8.0, rate * degree), (8.0, -rate * degree)]);
            }
            let load = Load { bias_n_m: 10.0, swing: [25.0, 0.03], gust: [4.0, 0.3], ..none };
            flown(GeneratorKind::DoubleDisc, base(legs(&way), load))
        }
        // A wheel over stones: steps of its torque while it turns.
        "rover" => flown(
            GeneratorKind::FourRoller,
            Scenario {
                acceleration_rad_s2: 0.5,
                load_kg_m2: 0.8,
                ..base(
                    legs(&[(2.0, 0.0), (20.0, 0.1), (2.0, 0.0), (16.0, -0.06)]),
                    Load { bias_n_m: 12.0, step: [15.0, 3.0], gust: [1.0, 1.0], ..none },
                )
            },
        ),
        // A light camera on a boom: slews, and stands still.
        "camera" => flown(
            GeneratorKind::Cam,
            Scenario {
                acceleration_rad_s2: 0.3,
                load_kg_m2: 0.3,
                servo: ServoSettings { speed_hz: 40.0, ..ServoSettings::HHD_95 },
                ..base(
                    legs(&[
                        (2.0, 0.0),
                        (3.0, 0.15),
                        (4.0, 0.0),
                        (3.0, -0.1),
                        (4.0, 0.0),
                        (1.0, 0.02),
                        (4.0, 0.0),
                        (1.0, -0.02),
                        (4.0, 0.0),
                    ]),
                    Load { gravity: [6.0, 0.4], gust: [0.1, 1.0], ..none },
                )
            },
        ),
        // The stars, under an unbalanced tube and wind.
        "telescope" => flown(
            GeneratorKind::Cam,
            Scenario {
                acceleration_rad_s2: 1e-3,
                load_kg_m2: 6.0,
                servo: ServoSettings {
                    position_hz: 3.0,
                    speed_hz: 25.0,
                    integral_hz: 1.5,
                    encoder_bits: 20,
                    ..ServoSettings::HHD_95
                },
                ..base(
                    legs(&[(2.0, 0.0), (60.0, 7.292_115e-5)]),
                    Load { gravity: [25.0, 0.8], gust: [2.0, 0.1], ..none },
                )
            },
        ),
        _ => None,
    }
}
