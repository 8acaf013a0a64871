//! Flights of a joint with mass on board: the inputs of the core in them are on tapes that the host recorded
//! (`host-sim/motion/examples/tape.rs`), and every line printed is what the host's own flight had. As each command is
//! the same, so would be the next input: the loop is.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use flexspline::{Images, Store, Table};
use flexspline_firmware::on_board::{HASH_START, LINE_TICKS, OnBoard, OnBoardInput, OnBoardSettings, hashed, line};
use flexspline_firmware::{Console, finish, twice};

static IMAGE: [&[u8]; 2] = twice!(concat!(env!("FLEXSPLINE_TABLES"), "/joint.fxt"));
static TAPES: [(&str, &[u8]); 2] = [
    ("on_load", include_bytes!(concat!(env!("FLEXSPLINE_TABLES"), "/on_load.tape"))),
    ("in_mesh", include_bytes!(concat!(env!("FLEXSPLINE_TABLES"), "/in_mesh.tape"))),
];

#[entry]
fn main() -> ! {
    let Some(store) = cortex_m::singleton!(: Store = Store::new()) else { finish(false) };
    for (name, tape) in TAPES {
        hprintln!("{}", name);
        if fly(tape, store).is_none() {
            finish(false);
        }
    }
    finish(true)
}

/// One tape; `None` if it or its table is not whole.
fn fly(tape: &[u8], store: &mut Store) -> Option<()> {
    let [image, twin] = IMAGE;
    let (settings, ticks) = tape.split_first_chunk()?;
    let settings = OnBoardSettings::of_bytes(settings);
    let drive = *Table::check(image).ok()?.drive();
    let images = Images::new(image, twin);
    *store = Store::new();
    store.activate(&images, &drive, settings.temperature_c).ok()?;
    let mut on_board = OnBoard::new(drive, &settings).ok()?;
    let mut hash = HASH_START;
    for (tick, bytes) in ticks.as_chunks().0.iter().enumerate() {
        let given = on_board.tick(&images, store, &OnBoardInput::of_bytes(bytes));
        hash = hashed(hash, &given);
        if tick % LINE_TICKS == LINE_TICKS - 1 {
            line(&mut Console, tick, &given, hash).ok()?;
        }
    }
    Some(())
}
