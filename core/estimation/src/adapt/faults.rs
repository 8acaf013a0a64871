//! Sensors that are wrong while a joint learns, and right again afterwards.
//!
//! The plant, its table and the noise are those of [`super::tests`], 1000 measurements a second. A twin does not learn.
//! T counts from when the sensor is right again.

use super::tests::{HIDDEN, Loop, SETTINGS, mixed};
use super::*;
use proptest::prelude::*;
use std::collections::VecDeque;

pub(super) const ARCSEC: f64 = core::f64::consts::PI / 648_000.0;

/// Kind of fault.
#[derive(Clone, Copy, Debug, PartialEq)]
enum SensorFault {
    /// The output sensor is off, rad.
    Off(f64),
    /// It slides away, rad/s.
    Slide(f64),
    /// It jumps to and fro, rad, with this half period, ticks.
    Jump(f64, usize),
    /// It keeps the value that it had when the fault began.
    Frozen,
    /// It is late, ticks.
    Late(usize),
    /// It counts the other way.
    OtherSign,
    /// The load sensor gives this many times the torque.
    Torque(f64),
}

/// Two joints on one unit: one learns, its twin does not.
struct LearnerAndTwin {
    learns: Loop<7>,
    twin: Loop<7>,
    past: VecDeque<f64>,
    frozen: f64,
    tick: usize,
    /// Ticks from one measurement to the next.
    every: usize,
    /// Speed of the swing, rad/s, and its amplitude at the generator, rad.
    swing: [f64; 2],
}

impl LearnerAndTwin {
    fn new(hidden: [f64; 7], seed: u64) -> Self {
        let [learns, mut twin] = [seed; 2].map(|seed| Loop::new(&SETTINGS, hidden, seed));
        twin.state.set_learning(Learning::Off);
        Self { learns, twin, past: VecDeque::new(), frozen: 0.0, tick: 0, every: 1, swing: [0.9, 30.0] }
    }

    /// One tick; `since` counts from the beginning of the fault.
    fn tick(&mut self, fault: Option<(SensorFault, usize)>) {
        let time = self.tick as f64 * 1e-3;
        let [speed, amplitude] = self.swing;
        let (generator, torque) = (amplitude * (speed * time).sin(), mixed(time));
        let seen = if let Some((SensorFault::Torque(by), _)) = fault { by * torque } else { torque };
        let (past, frozen) = (&mut self.past, &mut self.frozen);
        let measures = self.tick.is_multiple_of(self.every);
        self.learns.tick_as(generator, [torque, seen], |truth| {
            past.push_front(truth);
            past.truncate(100);
            let Some((fault, since)) = fault else { return measures.then_some(truth) };
            if since == 0 {
                *frozen = truth;
            }
            measures.then_some(match fault {
                SensorFault::Off(off) => truth + off,
                SensorFault::Slide(rate) => truth + rate * since as f64 * 1e-3,
                SensorFault::Jump(by, half) => truth + if since / half % 2 == 0 { by } else { -by },
                SensorFault::Frozen => *frozen,
                SensorFault::Late(by) => past.get(by).copied().unwrap_or(truth),
                SensorFault::OtherSign => -truth,
                SensorFault::Torque(_) => truth,
            })
        });
        self.twin.tick_as(generator, [torque, seen], Some);
        self.tick += 1;
    }

    /// By how much learning is worse than no learning, beyond three times what it states, rad.
    fn beyond(&self) -> f64 {
        self.learns.missed.abs() - self.twin.missed.abs() - 3.0 * self.last_uncertainty()
    }

    fn last_uncertainty(&self) -> f64 {
        f64::from(self.learns.stated)
    }
}

/// Effects of a fault.
#[derive(Debug, Default)]
struct FaultEffects {
    /// Largest miss while it lasted, arcsec.
    during: f64,
    /// Longest spell after it in which learning was worse than none beyond what it states, measurements.
    astray: usize,
    /// Largest miss later than [`T`] measurements after it, arcsec, and the largest standard deviation stated there.
    later: f64,
    stated: f64,
}

/// Learning is worse than no learning by more than three times what it states for no longer than this, measurements:
/// half of the memory.
const T: usize = 1000;

/// A fault after this number of good measurements, and its length in measurements; then 20 000 good ones.
fn story(mut pair: LearnerAndTwin, before: usize, fault: SensorFault, lasts: usize) -> FaultEffects {
    for _ in 0..before {
        pair.tick(None);
    }
    let mut found = FaultEffects::default();
    for since in 0..lasts {
        pair.tick(Some((fault, since)));
        found.during = found.during.max(pair.learns.missed.abs() / ARCSEC);
    }
    let mut spell = 0;
    for since in 0..20_000 {
        pair.tick(None);
        spell = if pair.beyond() > 0.0 { spell + 1 } else { 0 };
        found.astray = found.astray.max(spell);
        if since >= T {
            found.later = found.later.max(pair.learns.missed.abs() / ARCSEC);
            found.stated = found.stated.max(pair.last_uncertainty() / ARCSEC);
        }
    }
    found
}

/// The fault for 20 s, from the start and after 30 s of learning, on a unit that is its table and on one that is not.
/// `left` is what may be left on the former, arcsec.
fn recovers(fault: SensorFault, left: f64) {
    for (hidden, left) in [([0.0; 7], left), (HIDDEN, f64::INFINITY)] {
        for before in [0, 30_000] {
            let found = story(LearnerAndTwin::new(hidden, 1), before, fault, 20_000);
            assert!(found.astray <= T && found.later < left, "{fault:?}, {before} before, {hidden:?}: {found:?}");
        }
    }
}

/// Off, away, to and fro, late, with another gain of the load or none, standing still, of the other sign.
#[test]
fn a_sensor_that_was_wrong_is_recovered_from() {
    use SensorFault::{Frozen, Jump, Late, Off, OtherSign, Slide, Torque};
    [5.0, 10.0, 20.0, 30.0, -30.0].into_iter().for_each(|off| recovers(Off(off * ARCSEC), 2.0));
    let slid = [0.2, 1.0, 5.0, 50.0].map(|rate| Slide(rate * ARCSEC));
    let jumps = [(5.0, 300), (20.0, 300), (20.0, 50), (20.0, 3000), (100.0, 300)];
    let others = [Late(1), Late(5), Late(20), Torque(1.3), Torque(0.7), Torque(-1.0), Torque(0.0), Frozen, OtherSign];
    let jumped = jumps.map(|(by, half)| Jump(by * ARCSEC, half));
    slid.into_iter().chain(jumped).chain(others).for_each(|fault| recovers(fault, 15.0));
}

prop_compose! {
    fn any_fault()(kind in 0..7, size in -1.0f64..1.0, part in 0.0f64..1.0) -> SensorFault {
        match kind {
            0 => SensorFault::Off(size * 40.0 * ARCSEC),
            1 => SensorFault::Slide(size * 10.0 * ARCSEC),
            2 => SensorFault::Jump(size * 100.0 * ARCSEC, 10 + (part * 5000.0) as usize),
            3 => SensorFault::Frozen,
            4 => SensorFault::Late(1 + (part * 50.0) as usize),
            5 => SensorFault::OtherSign,
            _ => SensorFault::Torque(2.0 * size),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// Once the sensor is right, learning is worse than no learning beyond what it states for no longer than T.
    #[test]
    fn whatever_was_wrong_it_recovers(
        fault in any_fault(), parts in prop::array::uniform7(-0.25f64..0.25), scale in 0.0f64..1.0,
        seed in any::<u64>(),
        before in 0usize..20_000, lasts in 100usize..20_000, every in prop::sample::select(&[1usize, 7][..]),
        speed in 0.3f64..2.0, amplitude in 3.0f64..30.0,
    ) {
        let mut hidden = parts;
        hidden.iter_mut().zip(SETTINGS.coefficients).for_each(|(h, of)| *h *= scale * of.limit as f64);
        let pair = LearnerAndTwin { every, swing: [speed, amplitude], ..LearnerAndTwin::new(hidden, seed) };
        let found = story(pair, before, fault, lasts);
        prop_assert!(found.astray <= T * every, "{:?}", found);
    }
}
