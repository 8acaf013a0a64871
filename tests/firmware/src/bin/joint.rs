//! Flights of a joint with mass on board: the inputs of the core in them are on tapes that the host recorded
//! (`host-sim/motion/examples/tape.rs`), and every line printed is what the host's own flight had. As each command is
//! the same, so would be the next input: the loop is.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use flexspline::{Direction, GeneratorAngle, Images, Limits, OutputAngle, Store, Table, TorqueReading, TorqueSettings};
use flexspline_firmware::on_board::{HASH_START, LINE_TICKS, OnBoard, OnBoardInput, OnBoardSettings, hashed, line};
use flexspline_firmware::{Console, finish, twice};

static IMAGE: [&[u8]; 2] = twice!(concat!(env!("FLEXSPLINE_TABLES"), "/joint.fxt"));
/// Counts of generator and target, rate and acceleration of the target, whether it moves backward, whether the torque
/// is that in the mesh, the torque, and that for the load's inertia.
type Tick = (i64, i64, f32, f32, bool, bool, f32, f32);
/// Name, settings of the core, and inputs of a flight.
static TAPES: [(&str, OnBoardSettings, &[Tick]); 2] = [
    include!(concat!(env!("FLEXSPLINE_TABLES"), "/on_load.rs")),
    include!(concat!(env!("FLEXSPLINE_TABLES"), "/in_mesh.rs")),
];

#[entry]
fn main() -> ! {
    let Some(store) = cortex_m::singleton!(: Store = Store::new()) else { finish(false) };
    for (name, settings, ticks) in TAPES {
        hprintln!("{}", name);
        if fly(settings, ticks, store).is_none() {
            finish(false);
        }
    }
    finish(true)
}

/// One tape; `None` if its table is not whole.
fn fly(settings: OnBoardSettings, ticks: &[Tick], store: &mut Store) -> Option<()> {
    let [image, twin] = IMAGE;
    let drive = *Table::check(image).ok()?.drive();
    let images = Images::new(image, twin);
    *store = Store::new();
    store.activate(&images, &drive, settings.temperature_c).ok()?;
    let mut on_board = OnBoard::new(drive, &settings).ok()?;
    let mut hash = HASH_START;
    for (tick, input) in ticks.iter().enumerate() {
        let &(generator, target, rate, acceleration, backward, in_mesh, torque, inertia_n_m) = input;
        let input = OnBoardInput {
            generator: GeneratorAngle::from_counts(generator),
            target: OutputAngle::from_counts(target),
            motion: [rate, acceleration],
            direction: if backward { Direction::Backward } else { Direction::Forward },
            reading: if in_mesh { TorqueReading::InMesh(torque) } else { TorqueReading::OnLoad(torque) },
            inertia_n_m,
        };
        let given = on_board.tick(&images, store, &input);
        hash = hashed(hash, &given);
        if tick % LINE_TICKS == LINE_TICKS - 1 {
            line(&mut Console, tick, &given, hash).ok()?;
        }
    }
    Some(())
}
