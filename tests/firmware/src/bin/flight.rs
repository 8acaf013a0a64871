//! The flight program, and nothing else: tables in flash, a store, a joint, its slow group. Linked with a panic handler
//! that cannot be linked, so it has no panic path; its size is the size of the core, its call graph bounds the stack.
//!
//! With `--features deliberate-panic` it has one, and must not link.
#![no_std]
#![no_main]

use core::hint::black_box;

use cortex_m_rt::entry;
use flexspline::{Images, JointState, Mode, PlayState, Store};
use flexspline_estimation::{Disturbance, Measured, PredictorState, TwoMassObserver};
use flexspline_firmware::trajectory::{JOINT, Trajectory};
use flexspline_firmware::{PREDICTOR, TABLES, finish};

const TICKS: u32 = 2000;

/// A call of its own: its matrices are not on the stack while the table is checked.
#[inline(never)]
fn predictor() -> Option<TwoMassObserver> {
    TwoMassObserver::from_parts(&PREDICTOR).ok()
}

/// A call of its own: what it makes is on the stack only until it lies in its place.
#[inline(never)]
fn store() -> Option<&'static mut Store> {
    cortex_m::singleton!(: Store = Store::new())
}

#[entry]
fn main() -> ! {
    let Some(store) = store() else { finish(false) };
    let [.., (_, [first, second])] = TABLES;
    let images = Images::new(first, second);
    if store.activate(&images, JOINT.drive(), 21.0).is_err() {
        finish(false);
    }
    let saved = black_box(JointState::new()).save(&JOINT, store);
    let mut state = JointState::restore(&saved, &JOINT, store).unwrap_or_default();
    let _ = state.request(Mode::Tracking);
    let Some(predictor) = predictor() else { finish(false) };
    let mut inertias = PredictorState::new();
    let mut trajectory = Trajectory::new(1);
    let mut held_back = 0u32;
    for tick in 0..TICKS {
        let out = black_box(JOINT.tick(&images, store, &mut state, &trajectory.input()));
        trajectory.saw(&out);
        let measured = Measured { torque_n_m: 12.0, speed_rad_s: 0.01, twist_rad: out.transmission_error_rad };
        predictor.step(&mut inertias, black_box(&measured));
        held_back = held_back.wrapping_add((out.held_back_rad != 0.0) as u32);
        if tick % 100 == 50 {
            store.set_temperature(&images, 21.0);
            store.check_images(&images, 16);
        }
    }
    #[cfg(feature = "deliberate-panic")]
    assert!(held_back < TICKS);
    let off = Disturbance { torque_n_m: 1.0, ..Disturbance::default() };
    let ahead = predictor.ahead(&inertias, 12.0, 10, [1e-6, 1e-4, 1e-3, 0.1], &off);
    let known = ahead.load_rad.is_finite() & (state.play() != &PlayState::unknown());
    finish(known & (held_back > 0) & (store.counters().words_skipped == 0))
}
