//! Ten minutes of a joint with mass at 1 kHz (motor, servo, drive, friction, load, wind; five steps of the plant in a
//! tick), by controller.
//!
//! ```text
//! cargo bench --bench flight
//! ```
//!
//! Prints processor seconds for each, its table made included, and the rms of the pointing error.

use cpu_time::ProcessTime;
use flexspline::{Drive, FixedMember};
use flexspline_motion::dish;
use flexspline_motion::flight::{CONTROLLERS, IDEAL, fly_one};

fn main() {
    let unit = dish::unit(Drive::new(188, 190, FixedMember::Flexspline).expect("teeth of a drive"));
    let scenario = dish::ten_minutes();
    // The ideal asks the law itself some hundred times in a tick.
    for (kind, name) in CONTROLLERS.iter().enumerate().take(IDEAL) {
        let clock = ProcessTime::now();
        let flown = fly_one(&scenario, &unit, kind).expect("the dish can be flown");
        println!("{name:20} {:5.2} s of processor, {:.2} arcsec rms", clock.elapsed().as_secs_f64(), flown.error.rms());
    }
}
