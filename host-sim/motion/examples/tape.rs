//! Flights of a joint with mass, and the inputs of its core in every tick as tapes for the emulated target:
//! `tape FOLDER` writes `joint.fxt` and, as a Rust program has them, `on_load.rs` and `in_mesh.rs`, and prints what the
//! core gave.

use std::path::PathBuf;

use flexspline::{Direction, TorqueReading};
use flexspline_motion::flight::{OneJoint, table_image};
use flexspline_motion::on_board::{HASH_START, LINE_TICKS, OnBoardInput, hashed, line};
use flexspline_motion::scenario::{Scenario, TorqueKnown};

#[path = "../tests/dish/mod.rs"]
mod dish;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("tape FOLDER")?);
    let unit = dish::unit();
    let image = table_image(&dish::scenario(), &unit, |_| *b"thejoint")?;
    std::fs::write(folder.join("joint.fxt"), &image)?;
    let mut lines = String::new();
    for (name, torque) in [("on_load", TorqueKnown::OnLoad), ("in_mesh", TorqueKnown::InMesh)] {
        let scenario = Scenario { torque, ..dish::scenario() };
        let mut joint = OneJoint::new(&scenario, &unit, Some(image.clone()), true)?;
        let mut tape = format!("(\"{name}\", {:?}, &[\n", joint.on_board_settings());
        let mut hash = HASH_START;
        lines += &format!("{name}\n");
        for (tick, moment) in scenario.moments().enumerate() {
            joint.tick(&moment);
            let (input, given) = joint.on_board().ok_or("a joint without the core")?;
            let OnBoardInput { generator, target, motion: [rate, acceleration], direction, reading, inertia_n_m } =
                input;
            let (generator, target, backward) =
                (generator.counts(), target.counts(), *direction == Direction::Backward);
            let (in_mesh, torque) = match reading {
                TorqueReading::OnLoad(torque) => (false, torque),
                TorqueReading::InMesh(torque) => (true, torque),
            };
            tape += &format!(
                "({generator}, {target}, {rate:?}, {acceleration:?}, {backward}, {in_mesh}, {torque:?}, \
                 {inertia_n_m:?}),\n"
            );
            hash = hashed(hash, given);
            if tick % LINE_TICKS == LINE_TICKS - 1 {
                line(&mut lines, tick, given, hash)?;
            }
        }
        std::fs::write(folder.join(format!("{name}.rs")), tape + "])")?;
    }
    print!("{lines}");
    Ok(())
}
