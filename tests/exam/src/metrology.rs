//! Family E: a slow bench. An autocollimator or an index table reads the output while the drive stands: it moves on,
//! waits, is read several times. Weights on a lever or over a pulley load it in steps. Some sessions turn slowly behind
//! a heavy flywheel. Between sessions the bench may be set to zero anew, and the counter of the motor may start again
//! some turns off.

use std::f64::consts::{PI, TAU};

use crate::ARCSEC;
use crate::cause::Cause;
use crate::chance::Chance;
use crate::drive::{Drive, Unit};
use crate::gear::{Gear, Laws, Place};
use crate::hides::{Hides, Stranger, Thing};
use crate::record::{Record, Row};

pub const ROW_S: f64 = 0.125;
const READS: usize = 7;
/// Rows that the drive takes to move on: less than the ten that begin a session.
const MOVES: usize = 6;
/// Parts of a move: the clearance and the hysteresis follow each.
const PARTS: usize = 10;

#[derive(Debug, Clone)]
enum Manner {
    /// From stop to stop around the output, a weight over a pulley: step of the generator in rad, share of the rated
    /// torque.
    Index(f64, f64),
    /// A lever clamped on the output: weights on and off at places some degrees apart. Stream of the order of the
    /// weights.
    Lever(u64),
    /// Without stops: speed of the generator, rad/s, and the weight over the pulley.
    Flywheel(f64, f64),
}

#[derive(Debug, Clone)]
struct Session {
    manner: Manner,
    rows: usize,
    gap_s: f64,
    from_c: f64,
    drift_c: f64,
    settles_s: f64,
    orientation_rad: f64,
    /// Drift of the bench itself, arcsec, and its time constant, s.
    bench: (f64, f64),
    /// Set to zero anew: shift of the output's reading, arcsec.
    zero_arcsec: f64,
    /// Turns by which the motor's counter starts off.
    restarted: f64,
}

#[derive(Debug, Clone)]
pub struct Metrology {
    sessions: Vec<Session>,
    orientation_known: bool,
    pub zeroed: bool,
    pub restarted: bool,
    pub chamber: bool,
}

impl Metrology {
    /// Draws one; a chamber and turned housings where the effects ask for them.
    pub fn draw(drive: &Drive, things: &[Thing], chance: &mut Chance) -> Self {
        let thermal = [Cause::ThermalClearance, Cause::ThermalStiffness].map(Thing::Cause);
        let chamber = things.iter().any(|thing| thermal.contains(thing)) || chance.one_in(0.4);
        let turned = things.contains(&Thing::Cause(Cause::GravitySideLoad)) || chance.one_in(0.3);
        let (zeroed, restarted) = (chance.one_in(0.5), chance.one_in(0.25));
        let step = TAU * drive.ratio().abs() * 0.65 / (4600.0 / (READS + MOVES) as f64);
        let mut manners = vec![
            Manner::Index(step * chance.uniform(0.95, 1.05), chance.sign() * chance.uniform(0.2, 0.8)),
            Manner::Lever(chance.number()),
            Manner::Index(-step * chance.uniform(0.95, 1.05), chance.sign() * chance.uniform(0.2, 0.8)),
            Manner::Flywheel(chance.sign() * chance.uniform(0.5, 1.2), chance.sign() * chance.uniform(0.1, 0.5)),
            Manner::Lever(chance.number()),
        ];
        if chance.one_in(0.5) {
            manners.push(Manner::Index(step, 0.0));
        }
        chance.shuffle(&mut manners);
        let count = manners.len();
        let mut warm: Vec<f64> = (0..count)
            .map(
                |at| if chamber { -10.0 + 55.0 * (at as f64 + 0.5) / count as f64 } else { chance.uniform(19.0, 24.0) },
            )
            .collect();
        chance.shuffle(&mut warm);
        let sessions = manners.into_iter().zip(warm).enumerate();
        let sessions = sessions
            .map(|(at, (manner, warm))| Session {
                // A stop costs as much time as rows.
                rows: 4200 + chance.below(1600),
                manner,
                gap_s: chance.log_uniform(600.0, 2e4).round(),
                from_c: warm,
                drift_c: if chamber { chance.uniform(-8.0, 8.0) } else { chance.uniform(-1.0, 1.0) },
                settles_s: chance.uniform(120.0, 600.0),
                orientation_rad: if turned { 0.5 * PI * (at % 4) as f64 } else { 0.0 },
                bench: (1.2 * chance.normal(), chance.uniform(150.0, 900.0)),
                zero_arcsec: if zeroed { 80.0 * chance.normal() } else { 0.0 },
                restarted: if restarted && at > 0 { (60.0 * chance.normal()).round() } else { 0.0 },
            })
            .collect();
        Self { sessions, orientation_known: turned, zeroed, restarted, chamber }
    }

    /// Shift of zero (rad) and of the counter (rad) in each session: what the bench adds to the readings.
    pub fn shifts(&self) -> Vec<(f64, f64)> {
        self.sessions.iter().map(|s| (s.zero_arcsec / ARCSEC, s.restarted * TAU)).collect()
    }

    /// Readings without noise, before the bench is set to zero.
    pub fn run(&self, drive: &Drive, unit: &Unit, hidden: &[Hides]) -> Record {
        let gear = Gear::new(drive, unit, Laws::E, hidden);
        let mut record = Record::new(ROW_S, self.orientation_known);
        let mut state = Still::new(&gear);
        let rows: usize = self.sessions.iter().map(|s| s.rows).sum();
        let (mut start_s, mut generator, mut rows_done) = (0.0, 0.0, 0);
        for (number, session) in self.sessions.iter().enumerate() {
            record.begin_session();
            let mut programme = Programme::new(session, drive, state.output_rad);
            let mut t = 0.0;
            let mut read = 0;
            while read < session.rows {
                let stop = programme.next(state.output_rad, drive.rated_n_m);
                let seconds = stop.moves_s;
                let (from, torque_from) = (generator, state.torque_n_m);
                let parts = if seconds > ROW_S { PARTS } else { 2 };
                let mut place = Place::default();
                for part in 1..=parts {
                    let x = f64::from(part as u32) / parts as f64;
                    t += seconds / parts as f64;
                    let warm = 1.0 - (-t / session.settles_s).exp();
                    let slow = 1.0 - (-t / (2.5 * session.settles_s)).exp();
                    // As the sine of a smooth start and stop.
                    generator =
                        from + stop.turns_rad * (x - (TAU * x).sin() / TAU * f64::from(u8::from(parts == PARTS)));
                    place = Place {
                        time_s: start_s + t,
                        done: (rows_done + read) as f64 / rows as f64,
                        session: number,
                        generator_rad: generator,
                        output_rad: state.output_rad,
                        torque_n_m: 0.0,
                        temperature_c: session.from_c + session.drift_c * warm,
                        housing_c: session.from_c + session.drift_c * slow,
                        orientation_rad: session.orientation_rad,
                    };
                    let level = torque_from + x * (stop.torque_n_m - torque_from);
                    state.settle(&gear, place, level, seconds / parts as f64);
                }
                for at in 0..stop.reads {
                    if at > 0 {
                        t += ROW_S;
                        place.time_s = start_s + t;
                        state.settle(&gear, place, stop.torque_n_m, ROW_S);
                    }
                    let since = (at as f64 + 1.0) * ROW_S;
                    let own = session.bench.0 * (1.0 - (-t / session.bench.1).exp());
                    let output =
                        gear.output_reading(state.output_rad) + (own + bench_adds(&gear, place, &stop, since)) / ARCSEC;
                    record.push(&Row {
                        time_s: place.time_s,
                        generator_rad: generator,
                        speed_rad_s: stop.speed_rad_s,
                        torque_n_m: stop.torque_n_m,
                        temperature_c: place.temperature_c,
                        orientation_rad: place.orientation_rad,
                    });
                    record.generator_read_rad.push(gear.generator_reading(generator));
                    record.output_read_rad.push(output);
                    read += 1;
                }
            }
            rows_done += read;
            start_s += t + session.gap_s;
            generator = state.generator_rad;
        }
        record
    }
}

/// Effects of the bench on the reading, arcsec.
fn bench_adds(gear: &Gear, place: Place, stop: &Stop, since_s: f64) -> f64 {
    let mut sum = 0.0;
    for one in gear.hidden {
        sum += match one.thing {
            // The weight swings on its string once it was lifted on; the pull across the pulley tilts the mirror.
            Thing::Stranger(Stranger::SwingingWeight) => {
                let load = stop.torque_n_m / gear.drive.rated_n_m;
                let hz = 0.9 + 0.7 * one.shape[0];
                let rings = (-since_s / 2.5).exp() * (TAU * hz * since_s + one.phase(1)).sin();
                2.0 * one.size * load * rings
            }
            Thing::Stranger(Stranger::AirConditioning) => {
                let period_s = 300.0 + 900.0 * one.shape[0];
                let x = (place.time_s / period_s + one.shape[1]).fract();
                one.size * (4.0 * (x - 0.5).abs() - 1.0)
            }
            _ => 0.0,
        };
    }
    sum
}

#[derive(Debug, Clone, Copy, Default)]
struct Stop {
    moves_s: f64,
    turns_rad: f64,
    torque_n_m: f64,
    reads: usize,
    speed_rad_s: f64,
}

struct Programme {
    manner: Manner,
    ratio: f64,
    chance: Chance,
    clamped_rad: f64,
    levels: Vec<f64>,
    at: usize,
}

impl Programme {
    fn new(session: &Session, drive: &Drive, output_rad: f64) -> Self {
        let seed = if let Manner::Lever(seed) = session.manner { seed } else { 0 };
        Self {
            manner: session.manner.clone(),
            ratio: drive.ratio(),
            chance: Chance::new(seed, "weights", 0),
            clamped_rad: output_rad,
            levels: Vec::new(),
            at: 0,
        }
    }

    fn next(&mut self, output_rad: f64, rated_n_m: f64) -> Stop {
        self.at += 1;
        let moves_s = MOVES as f64 * ROW_S;
        match self.manner {
            Manner::Index(step, share) => {
                // A little uneven, as an operator's table is: no order hides between the stops.
                let turns_rad = step * self.chance.uniform(0.9, 1.1);
                Stop { moves_s, turns_rad, torque_n_m: share * rated_n_m, reads: READS, speed_rad_s: 0.0 }
            }
            Manner::Flywheel(speed, share) => Stop {
                moves_s: ROW_S,
                turns_rad: speed * ROW_S,
                torque_n_m: share * rated_n_m,
                reads: 1,
                speed_rad_s: speed,
            },
            Manner::Lever(_) => {
                let mut turns_rad = 0.0;
                if self.levels.is_empty() {
                    // On to the next place within a quarter of a right angle, then weights on one side, off, on the
                    // other, off.
                    let to = self.clamped_rad + self.chance.uniform(-0.4, 0.4);
                    turns_rad = (to - output_rad) * self.ratio;
                    let most = 2 + self.chance.below(3);
                    let side = self.chance.sign();
                    let up: Vec<f64> = (1..=most).map(|at| side * 0.9 * at as f64 / most as f64).collect();
                    let down: Vec<f64> = up.iter().rev().skip(1).copied().chain([0.0]).collect();
                    let there: Vec<f64> = up.into_iter().chain(down).collect();
                    self.levels = there.iter().map(|x| -x).rev().chain(there.iter().copied().rev()).collect();
                }
                let level = self.levels.pop().unwrap_or(0.0) * rated_n_m;
                let moves_s = if turns_rad == 0.0 { moves_s } else { 1.4 * moves_s };
                // The lever turns with the output, and a weight pulls down.
                let torque_n_m = level * (output_rad - self.clamped_rad).cos();
                Stop { moves_s, turns_rad, torque_n_m, reads: READS, speed_rad_s: 0.0 }
            }
        }
    }
}

/// Times in which what creeps follows the load, s.
const CREEPS_S: [f64; 4] = [4.0, 25.0, 150.0, 900.0];
const PLAYS: usize = 12;

/// The drive at rest: the hub in its clearance and what remembers the load.
struct Still {
    generator_rad: f64,
    output_rad: f64,
    torque_n_m: f64,
    hub_arcsec: f64,
    plays: [f64; PLAYS],
    creeps: [f64; 4],
}

impl Still {
    fn new(gear: &Gear) -> Self {
        Self {
            generator_rad: 0.0,
            output_rad: 0.0,
            torque_n_m: 0.0,
            hub_arcsec: gear.lines(0.0).0,
            plays: [0.0; PLAYS],
            creeps: [0.0; 4],
        }
    }

    /// Equilibrium under a torque, friction of the hub included.
    fn settle(&mut self, gear: &Gear, mut place: Place, torque_n_m: f64, seconds: f64) {
        place.output_rad = self.output_rad;
        let spring = torque_n_m + gear.unseen(&place, 0.0);
        place.torque_n_m = spring;
        let (low, high) = gear.limits(&place);
        let teeth = place.generator_rad / gear.drive.ratio() * ARCSEC;
        let friction = gear.drive.friction_torque_n_m * gear.unit.friction;
        let free = if spring > friction {
            f64::INFINITY
        } else if spring < -friction {
            f64::NEG_INFINITY
        } else {
            self.hub_arcsec
        };
        self.hub_arcsec = free.clamp(teeth + low, teeth + high);
        let mut lags = 0.0;
        let share = spring / gear.drive.rated_n_m;
        if let Some(one) = gear.size_of(Thing::Cause(Cause::TorsionalHysteresis)) {
            // Joints that slip one after another (Prandtl and Ishlinskii); most of them early.
            let of = |at: usize| (-2.5 * (at as f64 + 0.5) / PLAYS as f64).exp();
            let all: f64 = (0..PLAYS).map(of).sum();
            for (at, held) in self.plays.iter_mut().enumerate() {
                let half = (0.25 + 0.5 * one.shape[0]) * (at as f64 + 0.5) / PLAYS as f64;
                *held = held.clamp(share - half, share + half);
                lags += one.size * of(at) / all * (*held - share) / half;
            }
        }
        if let Some(one) = gear.size_of(Thing::Stranger(Stranger::SlowCreep)) {
            for (held, lasts) in self.creeps.iter_mut().zip(CREEPS_S) {
                *held += (share - *held) * (1.0 - (-seconds / lasts).exp());
                lags += one.size * 0.5 * (*held - share);
            }
        }
        self.generator_rad = place.generator_rad;
        self.torque_n_m = torque_n_m;
        self.output_rad = (self.hub_arcsec + gear.wind_up(spring, &place) + lags) / ARCSEC;
    }
}
