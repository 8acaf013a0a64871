//! How long ten minutes of flight at 1 kHz take: `cargo run --release -p flexspline-motion --example ten_minutes`.

use flexspline::{Drive, FixedMember};
use flexspline_motion::flight::{ARCSEC_PER_RAD, CONTROLLERS, Unit, fly_one};
use flexspline_motion::gear::Sampled;
use flexspline_motion::scenario::{Leg, Load, Scenario, TableKnown, TorqueKnown};
use flexspline_motion::servo::ServoSettings;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let drive = Drive::new(188, 190, FixedMember::Flexspline).map_err(|error| error.to_string())?;
    let law = |_: f64, flank: f64| (31.0 + 1.1 * flank / (1.0 + 0.006 * flank)) / ARCSEC_PER_RAD;
    let unit = Unit::of_spring(drive, Sampled::of_law(188.0, 100.0, law));
    let servo = ServoSettings {
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
    };
    let legs = (0..60).map(|k| Leg { seconds: 10.0, rate_rad_s: if k % 2 == 0 { 2e-3 } else { -1e-4 } });
    let scenario = Scenario {
        name: "ten minutes".to_owned(),
        legs: legs.collect(),
        acceleration_rad_s2: 0.05,
        load: Load { bias_n_m: 8.0, swing: [6.0, 0.05], gust: [1.5, 0.3], step: [0.0; 2], gravity: [2.0, 0.0] },
        load_kg_m2: 3.0,
        drag_n_m: 0.5,
        damping: 0.02,
        temperature_c: 20.0,
        warming_k_s: 0.0,
        servo,
        friction: 1.0,
        friction_known: 0.8,
        load_fed_forward: 1.0,
        torque: TorqueKnown::OnLoad,
        torque_noise_n_m: 0.05,
        table: TableKnown::Calibrated,
        seed: 3,
    };
    // The ideal asks the law itself some hundred times in a tick.
    for (k, name) in CONTROLLERS.iter().enumerate().take(4) {
        let begun = std::time::Instant::now();
        let flown = fly_one(&scenario, &unit, k)?;
        println!("{name:20} {:6.2} s, {:.2}\" rms", begun.elapsed().as_secs_f64(), flown.error.rms());
    }
    Ok(())
}
