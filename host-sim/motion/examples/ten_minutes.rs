//! How long ten minutes of flight at 1 kHz take: `cargo run --release -p flexspline-motion --example ten_minutes`.

use flexspline::{Drive, FixedMember};
use flexspline_motion::dish;
use flexspline_motion::flight::{CONTROLLERS, IDEAL, fly_one};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let unit = dish::unit(Drive::new(188, 190, FixedMember::Flexspline).map_err(|error| error.to_string())?);
    let scenario = dish::ten_minutes();
    // The ideal asks the law itself some hundred times in a tick.
    for (kind, name) in CONTROLLERS.iter().enumerate().take(IDEAL) {
        let begun = std::time::Instant::now();
        let flown = fly_one(&scenario, &unit, kind)?;
        println!("{name:20} {:6.2} s, {:.2}\" rms", begun.elapsed().as_secs_f64(), flown.error.rms());
    }
    Ok(())
}
