//! One joint of an antenna: a slew of 1.1° and back in four seconds, under a load that swings through zero, a thousand
//! ticks a second.
//!
//! Printed every 20 ms: time, load, what the drive is off by, and how far the output is from its target with the
//! correction. There is no drive here: the motor is taken to stand where it was told to, and the output where the table
//! says. `flexspline fly` flies the same calls with motor, servo, drive and load.
#![no_std]
#![no_main]

// Only for its critical section, which the printing needs.
use cortex_m as _;
use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hprintln};
use flexspline::{
    Adjustment, Drive, FixedMember, Flags, GeneratorAngle, Images, Input, Joint, JointState, Limits, Mode, OutputAngle,
    Overrun, Store,
};
use panic_halt as _;

/// The table at two places of the flash: what an upset leaves of one is mended from the other.
static FIRST: [u8; BYTES] = *include_bytes!(concat!(env!("OUT_DIR"), "/cam.fxt"));
static SECOND: [u8; BYTES] = *include_bytes!(concat!(env!("OUT_DIR"), "/cam.fxt"));
const BYTES: usize = include_bytes!(concat!(env!("OUT_DIR"), "/cam.fxt")).len();

/// What never changes, checked by the compiler.
const JOINT: Joint = {
    let Ok(drive) = Drive::new(188, 190, FixedMember::Flexspline) else { panic!() };
    let limits = Limits {
        tick_s: 1e-3,
        rate_rad_s: 0.05,
        acceleration_rad_s2: 5.0,
        generator_rate_rad_s: 600.0,
        debounce_ticks: 5,
        deadband_rad: 0.0,
    };
    let Ok(joint) = Joint::new(drive, limits, Overrun::FadeOut { ticks: 50 }) else { panic!() };
    joint
};

const TICKS: i32 = 4000;
/// Counts of 2⁻³² output turn in a tick: 0.01 rad/s.
const SLEW_COUNTS: i64 = 6836;

#[entry]
fn main() -> ! {
    let well = fly();
    loop {
        debug::exit(if well { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    }
}

fn fly() -> bool {
    let images = Images::new(&FIRST, &SECOND);
    let (mut store, mut state) = (Store::new(), JointState::new());
    if store.activate(&images, JOINT.drive(), 20.0).is_err() || state.request(Mode::Tracking).is_err() {
        return false;
    }
    let (mut generator, mut target, mut limited) = (GeneratorAngle::ZERO, OutputAngle::ZERO, 0);
    hprintln!("time_ms,load_n_m,error_mas,missed_mas");
    for tick in 0..TICKS {
        let told = target;
        target = target.offset_counts(if tick < TICKS / 2 { SLEW_COUNTS } else { -SLEW_COUNTS });
        // From +40 N·m to -40 and back.
        let torque_n_m = ((TICKS / 2 - tick).abs() - TICKS / 4) as f32 * 0.04;
        let input = Input {
            generator: Some(generator),
            target,
            torque_n_m,
            missed_ticks: 0,
            adjustment: Adjustment::default(),
        };
        let out = JOINT.tick(&images, &mut store, &mut state, &input);
        generator = out.command;
        // In a slower rate group: the temperature, and a slice of the check of both images.
        if tick % 100 == 50 {
            store.set_temperature(&images, 20.0);
            store.check_images(&images, 16);
        }
        limited += i32::from(out.flags.contains(Flags::HELD_BACK));
        if tick % 20 == 0 {
            let mas = |rad: f32| (rad * 206_264_806.0) as i32;
            let (error, missed) = (mas(out.transmission_error_rad), mas(out.output.minus_rad(told)));
            hprintln!("{},{},{},{}", tick, torque_n_m as i32, error, missed);
        }
        if out.flags.contains(Flags::TABLE_DOUBT) || out.flags.contains(Flags::NOT_CORRECTED) {
            return false;
        }
    }
    // The limiter was busy at the start and where the load changed the flank, and not for ever.
    limited > 0 && limited < TICKS / 4
}
