//! An antenna of one joint, pointed in closed loop with each generator's table in flash and a drive made of contact
//! FEM: what is flown, and every line printed, is what `examples/closed_loop.rs fly brief` has on the host.
//!
//! In every tick: target, encoder and torque sensor; the joint; the servo; the observer of the two inertias. Every
//! 100th tick the thermometer, every 20th a slice of the check of the images. Off, tracking, and at the end hold. Ends
//! with exit code 0 if the core points at least ten times better than the nominal ratio and three times better than
//! tables by sign of velocity.
#![no_std]
#![no_main]

use core::fmt::Write as _;

use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use flexspline::{Flags, Mode, Predictor};
use flexspline_firmware::flight::antenna::{Antenna, COLUMNS, CORE, Observer};
use flexspline_firmware::flight::gear::DenseGear;
use flexspline_firmware::flight::profile::{BRIEF, ProfileMoment};
use flexspline_firmware::flight::score::ARCSEC_PER_RAD;
use flexspline_firmware::plant::{Console, EMPTY, Room, read};
use flexspline_firmware::{MOTOR_PREDICTOR, TABLES, finish};

/// Ticks of holding after the flight.
const HELD: u32 = 100;
/// Most that a correction may move while it is brought to rest, rad: 10″, from 0.016 rad/s, braking with half of 5
/// rad/s².
const MOST_MOVED_RAD: f32 = 5e-5;

#[entry]
fn main() -> ! {
    let Some(room) = cortex_m::singleton!(: Room = EMPTY) else { finish(false) };
    hprintln!("{}", COLUMNS);
    let mut well = true;
    for generator in 0..TABLES.len() {
        well &= fly(generator, room).unwrap_or(false);
    }
    finish(well)
}

/// One generator; `None` if something is missing.
fn fly(generator: usize, room: &mut Room) -> Option<bool> {
    let (_, images) = *TABLES.get(generator)?;
    let (name, largest_n_m, map) = read(generator, room)?;
    let [first_c, _] = BRIEF.temperature_c;
    let mean_n_m = BRIEF.mean_torque_n_m(largest_n_m);
    let gear = DenseGear::new(map, first_c);
    let plants = core::array::from_fn(|_| gear.clone());
    let mut antenna = Antenna::new(images, plants, largest_n_m, mean_n_m, first_c)?;
    let mut observer = Observer::new(Predictor::from_parts(&MOTOR_PREDICTOR).ok()?);
    let (mut last, mut missed_squares) = (ProfileMoment::default(), 0.0);
    for moment in BRIEF.moments(largest_n_m) {
        antenna.tick(&moment);
        observer.tick(antenna.lane(CORE), map.header.ratio);
        let missed_n_m = f64::from(observer.state.load_torque_n_m()) - moment.torque_n_m;
        missed_squares += missed_n_m * missed_n_m / f64::from(BRIEF.ticks());
        // Here telemetry takes `antenna.core.out` and the observer's state, once it has a bounded queue to put them
        // into.
        last = moment;
    }
    antenna.write(name, &mut Console).ok()?;

    let [uncompensated, by_sign, by_mean, _, core] = antenna.scores().map(|scores| scores.whole.rms_arcsec());
    let by_sign = if by_mean < by_sign { by_mean } else { by_sign };
    let (against_none, against_sign) = (uncompensated / core, by_sign / core);
    let quiet = antenna.flags()[4..].iter().all(|&count| count == 0);

    // The flight is over: the correction stays as it is.
    antenna.core.request(Mode::Hold);
    let held = antenna.core.out?.correction_rad;
    let mut moved = 0.0_f32;
    for _ in 0..HELD {
        antenna.tick(&last);
        let out = antenna.core.out?;
        moved = moved.max((out.correction_rad - held).abs());
        well_flagged(out.flags)?;
    }
    let observed_n_m = libm::sqrt(missed_squares);
    let _ = writeln!(
        Console,
        "{name}: {against_none:.1} times better than the nominal ratio, {against_sign:.1} times than by sign of velocity; observer \
         without a torque sensor {observed_n_m:.2} N.m rms from the load; held within {:.2} arcsec",
        f64::from(moved) * ARCSEC_PER_RAD
    );
    let observed = observed_n_m < 0.1 * largest_n_m;
    Some(against_none >= 10.0 && against_sign >= 3.0 && quiet && observed && moved < MOST_MOVED_RAD)
}

/// Nothing is wrong with table and state.
fn well_flagged(flags: Flags) -> Option<()> {
    (!flags.contains(Flags::TABLE_DOUBT) && !flags.contains(Flags::STATE_TORN)).then_some(())
}
