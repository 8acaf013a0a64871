//! The drives that the programs fly: the files of `host-sim/fly/plant`, read once at the start.

use crate::flight::gear::{GearMap, MOST, parse};

/// Contact FEM of the four generators, in the order of [`crate::TABLES`]: name, largest torque of the table in N·m,
/// file.
static FILES: [(&str, f64, &str); 4] = [
    ("cam", 200.0, include_str!("../../../host-sim/fly/plant/cam.csv")),
    ("double-disc", 200.0, include_str!("../../../host-sim/fly/plant/double-disc.csv")),
    ("four-roller", 100.0, include_str!("../../../host-sim/fly/plant/four-roller.csv")),
    ("two-roller", 20.0, include_str!("../../../host-sim/fly/plant/two-roller.csv")),
];

/// Room for the numbers of one drive.
pub type Room = [[f64; MOST]; 2];
/// Nothing read yet.
pub const EMPTY: Room = [[0.0; MOST]; 2];

/// Name, largest torque (N·m) and map of a generator; `None` if its file is not one.
pub fn read(generator: usize, room: &mut Room) -> Option<(&'static str, f64, GearMap<'_>)> {
    let (name, largest_n_m, text) = *FILES.get(generator)?;
    let header = parse(text, room).ok()?;
    let size = header.nodes * header.phases;
    let [cold, warm] = room;
    Some((name, largest_n_m, GearMap { header, planes: [cold.get(..size)?, warm.get(..size)?] }))
}

/// Prints through semihosting, for what wants a [`core::fmt::Write`].
pub struct Console;

impl core::fmt::Write for Console {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        cortex_m_semihosting::hprint!("{}", text);
        Ok(())
    }
}
