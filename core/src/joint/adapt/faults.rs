//! Sensors that are wrong while a joint learns, and right again afterwards.
//!
//! The plant, its table and the noise are those of [`super::tests`], 1000 measurements a second. A twin does not learn. T counts from
//! when the sensor is right again.

use super::tests::{HIDDEN, Loop, SETTINGS, mixed};
use super::*;
use std::collections::VecDeque;
use std::vec::Vec;

pub(super) const ARCSEC: f64 = core::f64::consts::PI / 648_000.0;

/// What is wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
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
struct Pair {
    learns: Loop<7>,
    twin: Loop<7>,
    past: VecDeque<f64>,
    frozen: f64,
    tick: usize,
    /// Speed of the swing, rad/s, and its amplitude at the generator, rad.
    swing: [f64; 2],
}

impl Pair {
    fn new(hidden: [f64; 7], seed: u64) -> Self {
        let [learns, mut twin] = [seed; 2].map(|seed| Loop::new(&SETTINGS, hidden, seed));
        twin.state.set_learning(Learning::Off);
        Self { learns, twin, past: VecDeque::new(), frozen: 0.0, tick: 0, swing: [0.9, 30.0] }
    }

    /// One tick; `since` counts from the beginning of the fault.
    fn tick(&mut self, fault: Option<(Fault, usize)>) {
        let time = self.tick as f64 * 1e-3;
        let [speed, amplitude] = self.swing;
        let (generator, torque) = (amplitude * (speed * time).sin(), mixed(time));
        let seen = if let Some((Fault::Torque(by), _)) = fault { by * torque } else { torque };
        let (past, frozen) = (&mut self.past, &mut self.frozen);
        self.learns.tick_as(generator, [torque, seen], |truth| {
            past.push_front(truth);
            past.truncate(100);
            let Some((fault, since)) = fault else { return Some(truth) };
            if since == 0 {
                *frozen = truth;
            }
            Some(match fault {
                Fault::Off(off) => truth + off,
                Fault::Slide(rate) => truth + rate * since as f64 * 1e-3,
                Fault::Jump(by, half) => truth + if since / half % 2 == 0 { by } else { -by },
                Fault::Frozen => *frozen,
                Fault::Late(by) => past.get(by).copied().unwrap_or(truth),
                Fault::OtherSign => -truth,
                Fault::Torque(_) => truth,
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

/// What a fault did.
#[derive(Debug)]
struct Story {
    /// Largest miss while it lasted, arcsec.
    during: f64,
    /// The last measurement after it at which learning was worse than none beyond what it states; 0 if it never was.
    recovered: usize,
    /// Largest miss later than so many measurements after it, arcsec, and the largest that was stated there.
    later: f64,
    stated: f64,
}

const LATER: usize = 2000;

fn story(hidden: [f64; 7], seed: u64, before: usize, fault: Fault, lasts: usize) -> Story {
    let mut pair = Pair::new(hidden, seed);
    for _ in 0..before {
        pair.tick(None);
    }
    let mut found = Story { during: 0.0, recovered: 0, later: 0.0, stated: 0.0 };
    for since in 0..lasts {
        pair.tick(Some((fault, since)));
        found.during = found.during.max(pair.learns.missed.abs() / ARCSEC);
    }
    for since in 0..20_000 {
        pair.tick(None);
        if pair.beyond() > 0.0 {
            found.recovered = since + 1;
        }
        if since >= LATER {
            found.later = found.later.max(pair.learns.missed.abs() / ARCSEC);
            found.stated = found.stated.max(pair.last_uncertainty() / ARCSEC);
        }
    }
    found
}

#[test]
fn explore() {
    let faults: Vec<Fault> = [5.0, 10.0, 20.0, 30.0, -30.0].map(|off| Fault::Off(off * ARCSEC)).into_iter()
        .chain([0.2, 1.0, 5.0, 50.0].map(|rate| Fault::Slide(rate * ARCSEC)))
        .chain([(5.0, 300), (20.0, 300), (20.0, 50), (20.0, 3000), (100.0, 300)].map(|(by, half)| Fault::Jump(by * ARCSEC, half)))
        .chain([Fault::Frozen, Fault::Late(1), Fault::Late(5), Fault::Late(20), Fault::OtherSign, Fault::Torque(1.3), Fault::Torque(0.0), Fault::Torque(-1.0)])
        .collect();
    for hidden in [[0.0; 7], HIDDEN] {
        for before in [0, 30_000] {
            for &fault in &faults {
                let s = story(hidden, 1, before, fault, 20_000);
                std::println!("{:?} {before} {fault:?}: during {:.1} recovered {} later {:.2} stated {:.2}", hidden[0], s.during, s.recovered, s.later, s.stated);
            }
        }
    }
}
