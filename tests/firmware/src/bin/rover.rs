//! A rover of four joints, one of each generator, in one loop: static order, the slow groups of each joint in ticks of
//! their own. Beside each joint runs one at the nominal ratio, for comparison. The same lines as
//! `examples/closed_loop.rs rover` on the host. Ends with exit code 0 if every joint points ten times better than at
//! the nominal ratio.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use flexspline_firmware::flight::gear::DenseGear;
use flexspline_firmware::flight::profile::BRIEF;
use flexspline_firmware::plant::{Console, EMPTY, Room, read};
use flexspline_firmware::rover::RoverJoint;
use flexspline_firmware::{TABLES, finish};

#[entry]
fn main() -> ! {
    let Some(rooms) = cortex_m::singleton!(: [Room; 4] = [EMPTY; 4]) else { finish(false) };
    finish(drive(rooms).unwrap_or(false))
}

fn drive(rooms: &mut [Room; 4]) -> Option<bool> {
    let profile = BRIEF;
    let [first_c, _] = profile.temperature_c;
    let [one, two, three, four] = rooms;
    let maps = [read(0, one)?, read(1, two)?, read(2, three)?, read(3, four)?];
    let joint = |number: usize| {
        let (name, largest_n_m, map) = *maps.get(number)?;
        let (_, images) = *TABLES.get(number)?;
        RoverJoint::new(number as u32, name, images, DenseGear::new(map, first_c), largest_n_m, first_c)
    };
    let mut joints = [joint(0)?, joint(1)?, joint(2)?, joint(3)?];
    let mut moments = maps.map(|(_, largest_n_m, _)| profile.moments(largest_n_m));
    for tick in 0..profile.ticks() {
        for (joint, moments) in joints.iter_mut().zip(&mut moments) {
            joint.tick(tick, &moments.next()?);
        }
    }
    joints.iter().try_for_each(|joint| joint.write(&mut Console)).ok()?;
    Some(joints.iter().all(|joint| joint.gain() >= 10.0))
}
