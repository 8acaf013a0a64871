//! Joints of one table that share a store: what their number takes of memory. `FLEXSPLINE_JOINTS` says how many when it
//! is compiled, 1 without it. The table is the largest that the store has room for.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use flexspline::{Images, JointState, Mode, Store};
use flexspline_firmware::trajectory::{JOINT, Trajectory};
use flexspline_firmware::{TABLES, finish};

/// How many joints.
const JOINTS: usize = match option_env!("FLEXSPLINE_JOINTS") {
    Some(number) => match usize::from_str_radix(number, 10) {
        Ok(number) => number,
        Err(_) => panic!("FLEXSPLINE_JOINTS is a number"),
    },
    None => 1,
};
const TICKS: u32 = 300;

#[entry]
fn main() -> ! {
    let store = cortex_m::singleton!(: Store = Store::new());
    let states = cortex_m::singleton!(: [JointState; JOINTS] = [const { JointState::new() }; JOINTS]);
    let (Some(store), Some(states)) = (store, states) else { finish(false) };
    let mut images = TABLES.map(|(_, [first, second])| Images::new(first, second)).into_iter().rev();
    let Some(images) = images.find(|images| store.activate(images, JOINT.drive(), 21.0).is_ok()) else { finish(false) };
    let mut trajectories: [_; JOINTS] = core::array::from_fn(|number| Trajectory::new(number as u32 + 1));
    states.iter_mut().for_each(|state| _ = state.request(Mode::Tracking));
    let mut corrected = 0;
    for tick in 0..TICKS {
        for (state, trajectory) in states.iter_mut().zip(&mut trajectories) {
            let out = JOINT.tick(&images, store, state, &trajectory.input());
            trajectory.saw(&out);
            corrected += (out.correction_rad != 0.0) as usize;
        }
        // Once for all of them.
        if tick % 100 == 50 {
            store.set_temperature(&images, 21.0);
            store.check_images(&images, 16);
        }
    }
    finish(corrected > JOINTS * TICKS as usize / 2)
}
